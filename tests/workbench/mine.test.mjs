// Parts that a user calls his own.
import { test, beforeEach } from 'node:test';
import assert from 'node:assert/strict';

const stores = {};
for (const name of ['localStorage', 'sessionStorage']) {
  stores[name] = new Map();
  globalThis[name] = { getItem: key => stores[name].get(key) ?? null, setItem: (key, value) => stores[name].set(key, value) };
}
const { useKey } = await import('../../ui/app/api.js');
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

test('a part of another type of the same name is left alone', async () => {
  keep('shaft Shaft', { length_mm: 700 });
  const other = { ...root, properties: { shaft: { $ref: '#/$defs/Spindle' } }, $defs: { Spindle: shaft } };
  assert.deepEqual(await withOwn(other, { shaft: { length_mm: 1 } }), { job: { shaft: { length_mm: 1 } }, own: [] });
});

test('what is kept and the same is no change', async () => {
  keep('shaft Shaft', { length_mm: 100 });
  assert.deepEqual(await withOwn(root, example), { job: example, own: [] });
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

test('with a key parts are kept in the service, and none of the browser are used', async () => {
  keep('shaft Shaft', { length_mm: 700 });
  const kept = new Map([['old-carriage', { name: 'old-carriage', field: 'carriage', type: 'Carriage', value: { compliance: 5 } }]]);
  const asked = [];
  globalThis.fetch = (path, { method = 'GET', body, headers }) => {
    asked.push(`${method} ${path} ${headers.Authorization}`);
    const name = path.split('/')[3];
    if (method === 'PUT') kept.set(name, { name, ...JSON.parse(body) });
    if (method === 'DELETE') kept.delete(name);
    return Promise.resolve(new Response(JSON.stringify(method === 'GET' ? { items: [...kept.values()], next: null } : {})));
  };
  useKey('secret');
  const begun = await withOwn(root, example);
  assert.deepEqual([begun.own, begun.job.carriage], [['carriage'], { compliance: 5 }]);
  await keep('shaft Shaft', { length_mm: 300 });
  assert.deepEqual(kept.get('shaft-shaft'), { name: 'shaft-shaft', field: 'shaft', type: 'Shaft', value: { length_mm: 300 } });
  assert.deepEqual((await withOwn(root, example)).own, ['shaft', 'carriage']);
  assert.equal(stores.localStorage.get('precut-own-parts'), '{"shaft Shaft":{"length_mm":700}}', 'the browser keeps nothing of it');
  await forget('carriage Carriage');
  assert.deepEqual([...kept.keys()], ['shaft-shaft']);
  assert.deepEqual(
    asked,
    ['GET /v1/parts', 'PUT /v1/parts/shaft-shaft', 'DELETE /v1/parts/old-carriage'].map(line => `${line} Bearer secret`),
  );
  // What the service refuses is not kept, and whoever gives another key has other parts.
  globalThis.fetch = async () => new Response('{"title": "no"}', { status: 403 });
  await assert.rejects(keep('shaft Shaft', { length_mm: 1 }));
  assert.deepEqual((await withOwn(root, example)).job.shaft, { length_mm: 300 });
  globalThis.fetch = async () => new Response('{"items": [], "next": null}');
  useKey('another');
  assert.deepEqual((await withOwn(root, example)).own, []);
});
