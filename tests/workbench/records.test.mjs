// Machines, tools and materials by name: how they are found, and what a name does to a job.
import { test } from 'node:test';
import assert from 'node:assert/strict';
import { numbersOf } from '../../ui/app/library.js';
import { codesOf, find, fold, indexOf, named, nameOf, overruled } from '../../ui/app/records.js';

test('names are folded as the service folds them', () => {
  for (const [one, other] of [
    ['1.7225', '17225'],
    ['40Х', '40Kh'],
    ['40Х', '40X'],
    ['ШХ15', 'ShKh15'],
    ['38ХМ', '38khm'],
    ['42 CrMo 4', '42crmo4'],
    ['Größe', 'grosse'],
  ]) {
    assert.equal(fold(one), fold(other), `${one} and ${other}`);
  }
});

test('a record is found by everything that it is called, the name itself first', () => {
  const index = indexOf([
    { name: 'c10', title: 'Steel C10', names: { en: ['C10E'] } },
    { name: '42crmo4', title: 'Heat-treatable steel', names: { aisi: ['4140'], en_number: ['1.7225'], gost: ['38ХМ'] } },
    { name: 'mine', title: 'like 4140', names: {} },
    { name: 'cnmg', title: 'turning', insert: 'CNMG120408', holder: 'PCLNR2525M12' },
  ]);
  const found = text => find(index, text).map(({ name }) => name);
  assert.deepEqual(found('4140'), ['42crmo4', 'mine']);
  assert.deepEqual(found('38xm'), ['42crmo4']);
  assert.deepEqual(found('steel treatable'), ['42crmo4']);
  assert.deepEqual(found('PCLNR 2525'), ['cnmg']);
  assert.deepEqual(found('nothing'), []);
});

test('codes are told from names', () => {
  assert.deepEqual(codesOf('cnmg120408 pclnr2525m12'), { insert: 'CNMG120408', holder: 'PCLNR2525M12' });
  assert.deepEqual(codesOf('A25R-PCLNR12'), { holder: 'A25R-PCLNR12' });
  assert.deepEqual(codesOf('DCMT11T304'), { insert: 'DCMT11T304' });
  for (const text of ['bar_a25_pclnr12', 'mine', 'CNMG120408 and more', '']) assert.equal(codesOf(text), null, text);
});

test('a name stands alone or beside what is said over its record', () => {
  assert.equal(named(undefined, 'lathe-3', false), 'lathe-3');
  assert.deepEqual(named({ power_kw: 5 }, 'lathe-3', true), { name: 'lathe-3', power_kw: 5 });
  assert.deepEqual(named({ name: 'bar', overhang_mm: 100 }, 'bar-2', false), { name: 'bar-2', overhang_mm: 100 });
  assert.deepEqual(named('mine', { insert: 'CNMG120408' }, false), { insert: 'CNMG120408' });
  assert.deepEqual(named({ name: 'lathe-3', power_kw: 5 }, null, true), { power_kw: 5 });
  assert.equal(named({ name: 'lathe-3' }, null, true), undefined);
  assert.equal(nameOf({ insert: 'CNMG120408', holder: 'PCLNR2525M12' }), 'CNMG120408 PCLNR2525M12');
  const origins = [
    { pointer: '/a', parts: [{ from: 'job' }] },
    { pointer: '/b', parts: [{ from: 'machine' }, { from: 'tool' }] },
  ];
  assert.deepEqual(overruled({ origins, resources: { material: {}, shaft_material: {} } }), ['/shaft/material', '/a']);
  assert.deepEqual(overruled(undefined), []);
});

test('the numbers of a record are found with their places', () => {
  const record = {
    name: 'lathe-3',
    compliance: { carriage_um_per_n: { value: 0.018, certainty: 'user', source: 'user' } },
    control: { dialect: { value: 'fanuc' } },
    spindle: { characteristic: [{ power_kw: 5 }] },
  };
  assert.deepEqual(numbersOf(record), [
    { place: '/compliance/carriage_um_per_n', label: 'compliance · carriage_um_per_n', value: 0.018, certainty: 'user', source: 'user' },
  ]);
});
