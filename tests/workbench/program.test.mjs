// A program beside its picture: its lines, what is folded, which cut is under a place, and the bytes of its file.
import { test } from 'node:test';
import assert from 'node:assert/strict';
import { lineAt, linesOf, shownRanges } from '../../ui/app/program.js';
import { textOf, withEnds } from '../../ui/app/text-file.js';

test('lines are those of the service, whatever ends them', () => {
  assert.deepEqual(linesOf('%\r\nG0\rG1\n\nM30\n'), ['%', 'G0', 'G1', '', 'M30']);
  assert.deepEqual(linesOf('%\nM30'), ['%', 'M30']);
});

test('a file is read byte for byte', () => {
  const latin = Uint8Array.from({ length: 256 }, (_, byte) => byte);
  const { text, encoding } = textOf(latin);
  assert.equal(encoding, 'latin_1');
  assert.deepEqual(
    Uint8Array.from(text, letter => letter.charCodeAt(0)),
    latin,
  );
  const marked = new TextEncoder().encode('\ufeff(Ö)\r\n');
  assert.deepEqual(textOf(marked), { text: '\ufeff(Ö)\r\n', encoding: undefined });
});

test('what is typed keeps the ends of its lines', () => {
  assert.equal(withEnds('a\nb\n', 'a\r\n'), 'a\r\nb\r\n');
  assert.equal(withEnds('a\nb', 'a\rc'), 'a\rb');
  assert.equal(withEnds('a\nb', undefined), 'a\nb');
});

test('a long program shows its beginning and what is told, and folds the rest', () => {
  assert.deepEqual(shownRanges(40, [], []), [[1, 40]]);
  assert.deepEqual(shownRanges(1000, [500], []), [
    [1, 1],
    [497, 503],
  ]);
  // One line between is shown; what was opened stays.
  assert.deepEqual(shownRanges(1000, [4], [8]), [[1, 8]]);
  assert.deepEqual(shownRanges(1000, [999], []).at(-1), [996, 1000]);
});

test('the cut under a place is the nearest one, and of two on each other the last', () => {
  const moves = [
    { line: 1, x: [0, 100], y: [30, 30] },
    { line: 2, x: [0, 100], y: [20, 20] },
    { line: 3, x: [100, 0], y: [20, 20] },
    { line: 4, x: [0, 0], y: [20, 40] },
  ];
  assert.equal(lineAt(moves, { x: 50, y: 29 }), 1);
  assert.equal(lineAt(moves, { x: 50, y: 20.1 }), 3);
  assert.equal(lineAt(moves, { x: -5, y: 38 }), 4);
  assert.equal(lineAt([], { x: 0, y: 0 }), null);
});
