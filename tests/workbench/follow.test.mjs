// What goes along when a number of the job changes: places at the end of a part, and the numbers that another place of a picture
// stands for.
import { test } from 'node:test';
import assert from 'node:assert/strict';
import { withFollowers } from '../../ui/app/follow.js';
import { followed, Places } from '../../ui/app/elsewhere.js';

const number = { type: 'number' };
const place = { type: 'number', 'x-ends-with': '/part/pieces/*/length' };
const schema = {
  type: 'object',
  properties: {
    part: { type: 'object', properties: { pieces: { type: 'array', items: { type: 'object', properties: { length: number } } } } },
    holders: {
      type: 'array',
      items: {
        oneOf: [
          { type: 'object', properties: { kind: { const: 'rest' }, z: place } },
          { type: 'object', properties: { kind: { const: 'follows' }, offset: number } },
        ],
      },
    },
  },
};
const job = (lengths, ...places) => ({
  part: { pieces: lengths.map(length => ({ length })) },
  holders: [...places.map(z => ({ kind: 'rest', z })), { kind: 'follows', offset: 7 }],
});

test('what stands at the end of a part stays there when the part gets shorter or longer', () => {
  assert.deepEqual(withFollowers(schema, job([39.2, 292.9], 0, 332.1), job([39.2, 200], 0, 332.1)), job([39.2, 200], 0, 239.2));
  // A piece that goes, and one that comes.
  assert.deepEqual(withFollowers(schema, job([300, 100], 0, 400), job([300], 0, 400)), job([300], 0, 300));
  assert.deepEqual(withFollowers(schema, job([300], 0, 300), job([300, 50], 0, 300)), job([300, 50], 0, 350));
  // What stands elsewhere, or is being moved itself, is nobody's follower; nor is anything while a length is none.
  assert.deepEqual(withFollowers(schema, job([300], 0, 290), job([250], 0, 290)), job([250], 0, 290));
  assert.deepEqual(withFollowers(schema, job([300], 0, 300), job([300], 0, 280)), job([300], 0, 280));
  assert.deepEqual(withFollowers(schema, job([300], 0, 300), job([undefined], 0, 300)), job([undefined], 0, 300));
});

test('a job inside another one has its own ends', () => {
  const outer = { type: 'object', properties: { job: schema } };
  assert.deepEqual(withFollowers(outer, { job: job([300], 0, 300) }, { job: job([280], 0, 300) }), { job: job([280], 0, 280) });
});

test('another place of a picture changes what the service says, in the words in which the job was typed', () => {
  const typed = { cut: { speed: 100, depth: 2 }, tool: {} };
  const filled = { cut: { turns: 318, depth: 2 }, tool: { radius: 1 }, all: 3 };
  // What the service has under another name goes; what it filled in elsewhere is left to it.
  assert.deepEqual(followed(typed, filled, { ...filled, cut: { turns: 400, depth: 1.5 } }), { cut: { turns: 400, depth: 1.5 }, tool: {} });
  assert.deepEqual(followed(typed, filled, { ...filled, tool: { radius: 2 } }), { ...typed, tool: { radius: 2 } });
  assert.equal(followed(typed, filled, filled), typed);
});

test('of places that are passed by quickly the last one counts, and what is typed meanwhile is not undone', async () => {
  const asked = [];
  const desk = {
    isClosed: false,
    state: { job: { d: 1 }, answer: { key: 'b3:1', job: { d: 1 } }, waiting: false },
    service: { jobOf: async () => ({ job: { d: 1 } }), jobAt: (_key, { x }) => new Promise(go => asked.push(() => go({ job: { d: x } }))) },
    change: next => {
      desk.state = { ...desk.state, job: next };
    },
    ask: () => {},
  };
  const settle = async () => {
    for (let turn = 0; turn < 20; turn += 1) await null;
  };
  const places = new Places(desk);
  places.put({ x: 2 }, 'typing');
  places.put({ x: 3 }, 'typing');
  places.put({ x: 4 }, 'run');
  await settle();
  assert.equal(asked.length, 1);
  asked.shift()();
  await settle();
  asked.shift()();
  await settle();
  assert.deepEqual([desk.state.job, asked.length], [{ d: 4 }, 0]);
  places.put({ x: 5 }, 'typing');
  await settle();
  desk.change({ d: 9 });
  asked.shift()();
  await settle();
  assert.deepEqual(desk.state.job, { d: 9 });
});
