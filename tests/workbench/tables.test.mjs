// Measured tables: how a file is read, which column is what, and what of it is sent; rows that are pasted.
import { test } from 'node:test';
import assert from 'node:assert/strict';
import { decoded, readFile, guess, matched, othersOf, sizeAbout } from '../../ui/app/table-file.js';
import { rowsOf, pasted } from '../../ui/app/paste.js';

const angle = { name: 'angle_deg', required: true, schema: { type: 'number', 'x-unit': 'deg', title: 'angle' } };
const deviation = { name: 'radial_deviation_um', required: true, schema: { type: 'number', 'x-unit': 'um', title: 'radial deviation' } };
const columns = [angle, deviation];
const diameter = { name: 'diameter_mm', required: false, schema: { type: 'number', 'x-unit': 'mm', title: 'diameter' } };
const place = { name: 'z_mm', required: true, schema: { type: 'number', 'x-unit': 'mm', title: 'station', 'x-symbol': 'z' } };

test('files are read whoever wrote them', () => {
  const text = 'Угол;Отклонение, мкм\n0;1,5\n';
  const windows1251 = Uint8Array.from(
    [...text].map(c => {
      const code = c.charCodeAt(0);
      return code < 128 ? code : code - 0x350;
    }),
  );
  const utf16 = new Uint8Array([0xff, 0xfe, ...[...text].flatMap(c => [c.charCodeAt(0) & 255, c.charCodeAt(0) >> 8])]);
  for (const [bytes, tag] of [
    [new TextEncoder().encode(`\ufeff${text}`), 'en'],
    [utf16, 'en'],
    [windows1251, 'ru'],
  ]) {
    assert.deepEqual(readFile(decoded(bytes, tag)).file.header, ['Угол', 'Отклонение, мкм']);
  }
  assert.equal(readFile(decoded(Uint8Array.from([0xb5, 0x6d, 0x3b, 0x78, 0x0a, 0x31, 0x3b, 0x32]))).file.header[0], 'µm');
  assert.equal(readFile('PK\u0003\u0004zip').fault, 'file_no_text');
  assert.equal(readFile('\n\n').fault, 'csv_empty');
});

test('a file without a heading has its first row', () => {
  for (const [text, first] of [
    ['0;1,5\n6;2\n', ['0', '1,5']],
    ['0\t1.5\n6\t2\n', ['0', '1.5']],
    ['0,1.5\n6,2\n', ['0', '1.5']],
    ['  0  1,5\n 6 2\n', ['0', '1,5']],
  ]) {
    const { file } = readFile(text);
    assert.deepEqual([file.isHeadless, file.rows.length, file.rows[0]], [true, 2, first], text);
    const found = guess(columns, file.header, [], file.rows);
    // Both are guesses, and neither has a unit: that is asked for.
    assert.deepEqual(
      [found.angle_deg, found.radial_deviation_um].map(({ index, isGuess, unit }) => [index, isGuess, unit]),
      [
        [0, true, null],
        [1, true, null],
      ],
      text,
    );
  }
});

test("headings in people's own words are matched, and a guess is said to be one", () => {
  const found = (header, fields, measured) => guess(fields, header, measured, [header.map(() => '1')]);
  assert.equal(found(['angle [deg]', 'radial_deviation_um'], columns).radial_deviation_um.isGuess, false);
  const own = found(['Pos (mm)', 'Measured dia, inch'], [place, diameter], ['diameter_mm']);
  assert.deepEqual(
    [own.z_mm.index, own.z_mm.isGuess, own.diameter_mm.index, own.diameter_mm.unit, own.diameter_mm.isGuess],
    [0, true, 1, 'inch', true],
  );
  const deviations = {
    name: 'diameter_deviation_um',
    required: false,
    schema: { type: 'number', 'x-unit': 'um', title: 'diameter deviation' },
  };
  const both = found(['Pos (mm)', 'Measured dia, inch'], [place, deviations, diameter], ['diameter_deviation_um', 'diameter_mm']);
  assert.deepEqual([both.diameter_mm?.index, both.diameter_deviation_um], [1, undefined]);
  // A column of another dimension is none of the field's.
  assert.equal(found(['Force, N', 'Angle, deg'], [angle]).angle_deg.index, 1);
  assert.equal(found(['Ø, mm', 'Station, mm'], [place, diameter], ['diameter_mm']).diameter_mm.index, 0);
});

test('sizes in a column of deviations are seen, and deviations are not taken for sizes', () => {
  const about = (values, unit) => sizeAbout({ separator: ';', rows: values.map(value => [String(value)]) }, deviation, { index: 0, unit });
  assert.equal(about([32.003, 32.001, 31.998], 'mm'), 32);
  assert.equal(about([1.26, 1.2601, 1.2599], 'inch'), 32);
  assert.equal(about([3, -4, 5], 'um'), null);
  assert.equal(about([0.003, 0.004], 'mm'), null);
  assert.equal(about([400, 410, 405], 'um'), null);
});

test("what is sent has the service's names, the units that were said, and every row as it was", () => {
  const { file } = readFile('Angle [deg];Dev [mm];Remark\n0;1,5;a\n6;;b\n');
  const found = guess(columns, file.header, [], file.rows);
  const { kept, left } = othersOf(file, columns, found, new Set());
  assert.deepEqual([kept, left.map(({ title }) => title)], [[], ['Remark']]);
  assert.equal(matched(file, columns, found, kept), 'angle_deg;radial_deviation [mm]\n0;1,5\n6;\n');
  const sizes = readFile('Angle [deg];Dev [inch]\n0;1,2601\n6;1,26\n').file;
  const less = { ...guess(columns, sizes.header, [], sizes.rows) };
  less.radial_deviation_um = { ...less.radial_deviation_um, less: 32 };
  assert.equal(matched(sizes, columns, less, []), 'angle_deg;radial_deviation [mm]\n0;0.00654\n6;0.004\n');
});

const field = (name, title) => ({ name, schema: { type: 'number', 'x-unit': 'mm', title } });
const grid = {
  columns: [field('length_mm', 'length'), field('diameter_mm', 'diameter'), field('bore_mm', 'bore')],
  items: { required: ['length_mm', 'diameter_mm'] },
  most: 4,
  value: [{ length_mm: 1, diameter_mm: 2 }],
};

test('rows of a spreadsheet fill a table, all or none', () => {
  assert.equal(rowsOf('60 mm'), null);
  const put = (text, from = 'length_mm', row = 0) => pasted(rowsOf(text), { ...grid, from, row });
  assert.deepEqual(put('10\t20\n30\t40\n').rows, [
    { length_mm: 10, diameter_mm: 20 },
    { length_mm: 30, diameter_mm: 40 },
  ]);
  assert.deepEqual(put('Length\tDiameter\n10 cm\t1 in\n').rows, [{ length_mm: 100, diameter_mm: 25.4 }]);
  assert.deepEqual(put('10\t20\t0,5', 'length_mm', 1).rows, [
    { length_mm: 1, diameter_mm: 2 },
    { length_mm: 10, diameter_mm: 20, bore_mm: 0.5 },
  ]);
  assert.deepEqual([put('10\tx\n1\t2').fault, put('10\tx\n1\t2').values.row], ['paste_cell', 1]);
  assert.equal(put('10\t2,000\n1\t2').fault, 'paste_cell');
  assert.equal(put('1\t2\t3\t4').fault, 'paste_wide');
  assert.equal(put('1\n2\n3').fault, 'paste_narrow');
  assert.equal(put('1\t2\n1\t2\n1\t2\n1\t2\n1\t2').fault, 'paste_long');
  assert.equal(grid.value.length, 1);
});
