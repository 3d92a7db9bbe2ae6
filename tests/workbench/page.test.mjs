// What holds of every file of the page.
import { test } from 'node:test';
import assert from 'node:assert/strict';
import { readdirSync, readFileSync } from 'node:fs';

const folder = new URL('../../ui/app/', import.meta.url);
const files = readdirSync(folder).filter(name => name.endsWith('.js')).map(name => [name, readFileSync(new URL(name, folder), 'utf8')]);

test('nothing in the page names a calculator', () => {
  const ids = ['deflection-compensation', 'ring-roundness', 'roundness-evaluation', 'feed-schedule', 'machinability-fit', 'fixture-stability', 'fixture-identification', 'diagnosis'];
  for (const [name, text] of files) for (const id of ids) assert.ok(!new RegExp(`['"\`/]${id}['"\`/?]`).test(text), `${name} names ${id}`);
});

test('nothing leaves the page past the rule', () => {
  // What saves, copies or prints stands in one file, or asks it; lists, models and records are no answers.
  for (const [name, text] of files) {
    if (!['handover.js', 'pages.js', 'library.js'].includes(name)) assert.ok(!/createObjectURL|api\.file\(|[^a-z]save\(/.test(text), `${name} saves by itself`);
    for (const found of text.matchAll(/window\.print\(\)/g)) assert.match(text.slice(Math.max(0, found.index - 60), found.index), /owns\(/, `${name} prints unasked`);
  }
});

test('no file is long', () => {
  for (const [name, text] of files) assert.ok(text.split('\n').length <= 420, `${name} has ${text.split('\n').length} lines`);
});

test('maps have the colours of the service\'s own drawings', () => {
  const service = readFileSync(new URL('../../src/render/svg/colour.rs', import.meta.url), 'utf8');
  const page = files.find(([name]) => name === 'palette.js')[1];
  for (const name of ['SEQUENTIAL', 'DIVERGING', 'DIVERGING_DARK']) {
    const own = page.match(new RegExp(`const ${name} = split\\('([^']*)'\\)`))[1].split(' ');
    const list = service.match(new RegExp(`const ${name}: [^=]*= \\[([^\\]]*)\\]`))[1];
    assert.ok(own.length > 1, name);
    assert.deepEqual(own, [...list.matchAll(/"([0-9a-f]{6})"/g)].map(([, colour]) => colour), name);
  }
});
