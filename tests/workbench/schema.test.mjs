// What a form learns from a schema.
import { test } from 'node:test';
import assert from 'node:assert/strict';
import { kept, resolve, variants } from '../../ui/app/schema.js';

const number = unit => ({ type: 'number', 'x-unit': unit, example: 7 });
const schema = {
  oneOf: [
    {
      type: 'object',
      required: ['kind', 'z_mm'],
      properties: {
        kind: { const: 'centre' },
        z_mm: number('mm'),
        compliance_um_per_n: number('um/N'),
        law: { enum: ['a', 'b'] },
        at: { type: 'object', properties: { x_mm: number('mm') } },
      },
    },
    {
      type: 'object',
      required: ['kind', 'z_mm', 'length_mm'],
      properties: {
        kind: { const: 'chuck' },
        z_mm: number('mm'),
        compliance_um_per_n: number('um/N'),
        length_mm: number('mm'),
        law: { enum: ['b', 'c'] },
        at: { type: 'object', properties: { x_mm: number('mm') } },
      },
    },
    { type: 'object', required: ['kind'], properties: { kind: { const: 'rest' }, z_mm: number('um') } },
  ],
};
const [centre, chuck, rest] = variants(schema, schema);

test('a change of kind keeps what both kinds have, required or not, and nothing else', () => {
  const before = { kind: 'centre', z_mm: 0, compliance_um_per_n: 0.03, law: 'b', at: { x_mm: 1 } };
  const now = resolve(centre.schema, schema);
  assert.deepEqual(kept(before, now, chuck, schema), {
    kind: 'chuck',
    z_mm: 0,
    compliance_um_per_n: 0.03,
    length_mm: 7,
    law: 'b',
    at: { x_mm: 1 },
  });
  // A word that the other kind does not know, and a number of another unit, mean nothing there.
  assert.deepEqual(kept({ ...before, law: 'a' }, now, chuck, schema).law, undefined);
  assert.deepEqual(kept(before, now, rest, schema), { kind: 'rest' });
  assert.deepEqual(kept(undefined, now, rest, schema), { kind: 'rest' });
});
