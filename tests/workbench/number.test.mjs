// What is read of what is typed.
import { test } from 'node:test';
import assert from 'node:assert/strict';
import { readFileSync } from 'node:fs';
import { read } from '../../ui/app/number.js';
import { speak } from '../../ui/app/text.js';

const language = async tag => {
  globalThis.document ??= { documentElement: {} };
  globalThis.fetch = async url => new Response(readFileSync(url));
  await speak(tag);
};

test('units behind a number are understood', async () => {
  await language('en');
  const cases = [
    ['60 mm', 'mm', 60],
    ['60mm', 'mm', 60],
    ['2.36 in', 'mm', 59.944],
    ['2.36"', 'mm', 59.944],
    ['60 мм', 'mm', 60],
    ['0,5', 'mm', 0.5],
    ['6 cm', 'mm', 60],
    ['12 thou', 'um', 304.8],
    ['.5', 'mm', 0.5],
    ['300 sfm', 'm/min', 91.44],
    ['30 %', '1', 0.3],
    ['45°', 'deg', 45],
    ['1e3', 'N', 1000],
    ['1 kN', 'N', 1000],
    ['−3', 'mm', -3],
    ['5', undefined, 5],
    ['1200 об/мин', 'rev/min', 1200],
  ];
  for (const [text, unit, value] of cases) assert.deepEqual(read(text, unit), { value }, text);
  assert.deepEqual(read('  ', 'mm'), { value: null });
});

test('what can be read in two ways is asked, with both', async () => {
  await language('en');
  const asked = read('2,000', 'mm');
  assert.deepEqual([asked.fault, asked.choices], ['two_readings', [2000, 2]]);
  assert.deepEqual(read('2,000 in', 'mm').choices, [50800, 50.8]);
  for (const [text, value] of [
    ['2,000.5', 2000.5],
    ['1,234,567', 1234567],
    ['2.000,5', 2000.5],
    ['0,500', 0.5],
    ['2,00', 2],
    ['2,0005', 2.0005],
    ['2 000', 2000],
    ["12'500", 12500],
    ['2000', 2000],
    ['2.000', 2],
  ])
    assert.deepEqual(read(text, 'mm'), { value }, text);
  await language('ru');
  // There the page itself writes the comma.
  for (const [text, value] of [
    ['2,000', 2],
    ['2,125', 2.125],
    ['2 000', 2000],
    ['2.5', 2.5],
  ])
    assert.deepEqual(read(text, 'mm'), { value }, text);
});

test('what is no number is none', async () => {
  await language('en');
  for (const text of ['abc', '1 2', '12 34', '1,2,3', '1.2.3', '--1', '1-2', '1 23,5', 'e5', '1,,2', '000,000', '0 500'])
    assert.equal(read(text, 'mm').fault, 'not_a_number', text);
  assert.equal(read('60 kg', 'mm').fault, 'unit_not_here');
  assert.equal(read('60 mm', '1').fault, 'no_unit_here');
  assert.equal(read('60 furlong', 'mm').values.unit, 'furlong');
});

test('every number that the page writes is read back', async () => {
  const { typed } = await import('../../ui/app/text.js');
  for (const tag of ['en', 'ru']) {
    await language(tag);
    for (let power = -9; power <= 9; power += 1)
      for (const digits of [1, 1.5, 2.125, 9.87654321, 1 / 3, 1.001])
        for (const sign of [1, -1]) {
          const value = sign * digits * 10 ** power;
          assert.deepEqual(read(typed(value), 'mm'), { value }, typed(value));
        }
  }
});
