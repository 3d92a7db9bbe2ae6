// Parts that a user calls his own.
import { test, beforeEach } from 'node:test';
import assert from 'node:assert/strict';

const stores = {};
for (const name of ['localStorage', 'sessionStorage']) {
  stores[name] = new Map();
  globalThis[name] = { getItem: key => stores[name].get(key) ?? null, setItem: (key, value) => stores[name].set(key, value) };
}
const { keep, forget, ownName, withOwn, noteLast, lastJob } = await import('../../ui/app/mine.js');
const { jobOf } = await import('../../ui/app/address.js');

const shaft = { type: 'object', properties: { length_mm: { type: 'number' } } };
const root = {
  type: 'object',
  properties: {
    shaft: { $ref: '#/$defs/Shaft' },
    carriage: { anyOf: [{ type: 'null' }, { $ref: '#/$defs/Carriage' }] },
    rows: { $ref: '#/$defs/Rows' },
    note: { type: 'string' },
  },
  $defs: {
    Shaft: shaft,
    Carriage: { type: 'object', properties: { compliance: { type: 'number' } } },
    Rows: { type: 'array', 'x-table': {} },
  },
};
const example = { shaft: { length_mm: 100 }, carriage: { compliance: 1 }, note: 'an example' };
const description = { id: 'one', input_schema: root, examples: [{ id: 'first' }], jobs: { first: example } };
const query = text => new URLSearchParams(text);

beforeEach(() => ['shaft Shaft', 'carriage Carriage'].forEach(forget));

test('what has a type of its own is kept under it, tables and single values are not', () => {
  const of = name => ownName(name, root.properties[name], root);
  assert.deepEqual(['shaft', 'carriage', 'rows', 'note'].map(of), ['shaft Shaft', 'carriage Carriage', null, null]);
});

test('whoever asks for nothing in particular begins with his own', async () => {
  keep('shaft Shaft', { length_mm: 700 });
  assert.equal(stores.localStorage.get('precut-own-parts'), '{"shaft Shaft":{"length_mm":700}}');
  const begun = await jobOf(description, query(''));
  assert.deepEqual([begun.job.shaft, begun.job.carriage, begun.own], [{ length_mm: 700 }, { compliance: 1 }, ['shaft']]);
  // The address tells it by what differs from the example.
  assert.equal(begun.base, example);
  const found = await jobOf(description, query('model=headstock'));
  assert.deepEqual([found.job.shaft, found.job.model], [{ length_mm: 700 }, 'headstock']);
});

test('an address that says what it is about gets that', async () => {
  keep('shaft Shaft', { length_mm: 700 });
  for (const asked of ['example=first', '/note="mine"']) {
    const { job, own } = await jobOf(description, query(asked));
    assert.deepEqual([job.shaft, own], [{ length_mm: 100 }, []], asked);
  }
});

test('a part of another type of the same name is left alone', () => {
  keep('shaft Shaft', { length_mm: 700 });
  const other = { ...root, properties: { shaft: { $ref: '#/$defs/Spindle' } }, $defs: { Spindle: shaft } };
  assert.deepEqual(withOwn(other, { shaft: { length_mm: 1 } }), { job: { shaft: { length_mm: 1 } }, own: [] });
});

test('what is kept and the same is no change', () => {
  keep('shaft Shaft', { length_mm: 100 });
  assert.deepEqual(withOwn(root, example), { job: example, own: [] });
});

test('a model goes onto the last job, not onto what was on its way or beside it', () => {
  assert.equal(String(lastJob('one')), '');
  noteLast('one', 'example=first&/shaft/length_mm=5&run=j1&pin=b3:1');
  assert.equal(lastJob('one').get('/shaft/length_mm'), '5');
  assert.deepEqual([...lastJob('one').keys()], ['example', '/shaft/length_mm']);
});

test('a kept result with a model is another job', async () => {
  const service = { jobOf: async () => ({ calculator: 'one', job: example }) };
  const { job, key } = await jobOf(description, query('result=b3:1&model=headstock'), service);
  assert.deepEqual([job.model, key], ['headstock', null]);
});
