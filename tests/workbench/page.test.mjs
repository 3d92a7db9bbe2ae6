// What holds of every file of the page.
import { test } from 'node:test';
import assert from 'node:assert/strict';
import { readdirSync, readFileSync } from 'node:fs';

const folder = new URL('../../ui/app/', import.meta.url);
const files = readdirSync(folder)
  .filter(name => name.endsWith('.js'))
  .map(name => [name, readFileSync(new URL(name, folder), 'utf8')]);

const contract = JSON.parse(readFileSync(new URL('../../openapi/precut.json', import.meta.url), 'utf8'));
const schemas = contract.components.schemas;
const calculators = Object.entries(contract.paths)
  .filter(([path, { post }]) => post?.operationId?.startsWith('solve_') && path !== '/v1/studies')
  .map(([path]) => path.slice('/v1/'.length));

/** The names of all fields below a part of the contract. */
function fieldsOf(part, found = new Set(), seen = new Set()) {
  if (!part || typeof part !== 'object' || seen.has(part)) return found;
  seen.add(part);
  for (const name of Object.keys(part.properties ?? {})) found.add(name);
  for (const [name, inner] of Object.entries(part)) {
    if (name === '$ref') fieldsOf(schemas[String(inner).split('/').at(-1)], found, seen);
    // What an example says is no name of a field.
    else if (!['example', 'examples', 'default'].includes(name)) fieldsOf(inner, found, seen);
  }
  return found;
}

test('nothing in the page names a calculator', () => {
  assert.ok(calculators.length > 8);
  for (const [name, text] of files)
    for (const id of calculators) assert.ok(!new RegExp(`['"\`/]${id}['"\`/?]`).test(text), `${name} names ${id}`);
});

/** Names that the page has all the same: what `x-causes` declares has this shape, and two parameters of it are told in words
 *  of their own; the rest are words for units and uncertainties, and what a handle of a figure says. This list only gets
 *  shorter. */
const CAUSES = [
  'at_limit',
  'confounded_with',
  'further_runs',
  'hump_ln',
  'likely_sets',
  'next_measurement',
  'noise_ceiling',
  'none_probability',
  'rmse_base',
  'rmse_extended',
  'rows_needed',
  'separation_now_sigmas',
  'separation_then_sigmas',
  'standard_deviation',
  'unnamed_probability',
  'with_remainder',
];
const KNOWN = {
  'cause.js': CAUSES,
  'inspection.js': ['further_runs', 'next_measurement'],
  'digits.js': ['standard_deviation', 'standard_error'],
  'schema.js': ['n_per_mm'],
  'handles.js': ['per_unit'],
};

/** Names of fields that jobs and results have, and nothing else that the service says. */
function fieldsOfCalculators() {
  const ofOthers = new Set();
  for (const [path, item] of Object.entries(contract.paths)) if (!calculators.includes(path.slice('/v1/'.length))) fieldsOf(item, ofOthers);
  const own = new Set();
  for (const id of calculators) fieldsOf(contract.paths[`/v1/${id}`], own);
  return new Set([...own].filter(name => !ofOthers.has(name)));
}

test('nothing in the page names a field of a job or of a result', () => {
  // One word may be anything; what two are joined to is somebody's name.
  const names = [...fieldsOfCalculators()].filter(name => name.includes('_'));
  assert.ok(names.length > 500, `${names.length} names`);
  for (const [file, text] of files) {
    const code = text.replace(/\/\*[\s\S]*?\*\//g, '').replace(/(^|\s)\/\/.*$/gm, '');
    const words = new Set(code.match(/[a-z][a-z0-9]*(?:_[a-z0-9]+)+/g));
    const found = names.filter(name => words.has(name)).sort();
    assert.deepEqual(found, KNOWN[file] ?? [], file);
  }
});

/** What the page reads of a result by one word, where `x-causes` declares that it is there. This list only gets shorter, too. */
const KNOWN_WORDS = { 'cause.js': ['named'] };

test('nothing in the page reads a field of a job or of a result by one word', () => {
  const own = fieldsOfCalculators();
  // One word may be anything, but for what is read of a job, of its echo or of a result, or written into one.
  const holders = String.raw`(?:\w+\.)*(?:job|input|result)`;
  const reads = new RegExp(String.raw`\b${holders}(?:\?\.|\.)([a-z]+)\b(?!\()|\b${holders}\[?\.?\['([a-z]+)'\]`, 'g');
  const takesApart = new RegExp(String.raw`\{([^{}]*)\} = ${holders}\b(?!\.)`, 'g');
  const pointers = /['"`]\/([a-z]+)(?=[/'"`])/g;
  for (const [file, text] of files) {
    const code = text.replace(/\/\*[\s\S]*?\*\//g, '').replace(/(^|\s)\/\/.*$/gm, '');
    const words = [
      ...[...code.matchAll(reads)].map(([, one, other]) => one ?? other),
      ...[...code.matchAll(takesApart)].flatMap(([, names]) => names.split(',').map(name => name.split(/[:=]/)[0].trim())),
      ...[...code.matchAll(pointers)].map(([, name]) => name),
    ];
    const found = [...new Set(words)].filter(word => /^[a-z]+$/.test(word) && own.has(word)).sort();
    assert.deepEqual(found, KNOWN_WORDS[file] ?? [], file);
  }
});

test('nothing leaves the page past the rule', () => {
  // What saves, copies or prints stands in one file, or asks it.
  for (const [name, text] of files) {
    if (name !== 'handover.js') assert.ok(!/createObjectURL|api\.file\(|[^a-z]save\(/.test(text), `${name} saves by itself`);
    for (const found of text.matchAll(/window\.print\(\)/g))
      assert.match(text.slice(Math.max(0, found.index - 60), found.index), /owns\(/, `${name} prints unasked`);
  }
});

test('no file is long', () => {
  for (const [name, text] of files) assert.ok(text.split('\n').length <= 600, `${name} has ${text.split('\n').length} lines`);
});

test('pictures have no colours of their own', () => {
  // They come from the service, which draws with them, too.
  const sheet = readFileSync(new URL('style.css', folder), 'utf8');
  assert.doesNotMatch(sheet, /--(r-|plot-|map)[a-z0-9-]*:/);
  assert.match(sheet, /var\(--r-after\)/);
  for (const [name, text] of files) assert.ok(!/#[0-9a-f]{6}\b/i.test(text), `${name} has a colour`);
});

test("points look as in the service's own pictures", () => {
  const service = readFileSync(new URL('../../src/render/svg/style.rs', import.meta.url), 'utf8');
  const page = files.find(([name]) => name === 'draw.js')[1];
  const paths = new Map([...service.matchAll(/const ([A-Z]+): &str = "(m[^"]*)";/g)].map(([, name, path]) => [name, path]));
  const own = new Map(
    [...page.match(/const MARKERS = \{([^}]*)\}/)[1].matchAll(/(\w+): '([^']*)'/g)].map(([, name, path]) => [name, path]),
  );
  assert.equal(paths.size, own.size);
  const roles = new Map(
    [...page.match(/const BY_ROLE = \{([^}]*)\}/)[1].matchAll(/(\w+): '(\w+)'/g)].map(([, role, name]) => [role, own.get(name)]),
  );
  const known = [...service.matchAll(/Role::\w+ => \("(\w+)", ([A-Z]+)\)/g)];
  assert.equal(known.length, roles.size);
  for (const [, role, name] of known) assert.equal(roles.get(role), paths.get(name), role);
  const series = [...page.match(/const SERIES = \[([^\]]*)\]/)[1].matchAll(/'(\w+)'/g)].map(([, name]) => own.get(name));
  assert.deepEqual(
    series,
    [...service.matchAll(/\("n\d", ([A-Z]+)\)/g)].map(([, name]) => paths.get(name)),
  );
});
