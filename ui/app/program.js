// A program that the job brought along, beside the picture of what it does: a line that is pressed shows its cut, a cut that is
// pressed its line; what changed stands under what it was. Where all of it is found, the schema of the result says (`x-program`).
import { html, useEffect, useMemo, useRef, useState } from './lib.js';
import { t, capital, number, unitOf, plural } from './text.js';
import { at, labelOf, memberOf, parts, resolve, spoken } from './schema.js';

/** A shorter program is shown whole; of a longer one so much around what matters, and so much more at a press. */
const SHORT = 60;
const AROUND = 3;
const MORE = 200;
/** Faults and warnings told at one line. */
const MOST_TOLD = 4;
/** Places of a picture that are looked at where several are the same. */
const MOST_ALIKE = 8;

/** What the schema of a result says of the program of its job; `null` where it has none. */
export function declaredProgram({ output_schema: root }) {
  // A study answers with what it read off, which no schema describes.
  if (!root) return null;
  const fields = Object.values(memberOf(root, {})?.properties ?? {}).map(part => resolve(part, root));
  return fields.find(part => part['x-program'])?.['x-program'] ?? null;
}

/** The text of the program in a job. */
export const programText = (said, job) => job && at(job, [said.text]);

/** Whether an answer has a program to take away: one that was only read has none. */
export function isGivenBack(description, result) {
  const said = declaredProgram(description);
  return !said || at(result, parts(said.changes)) !== undefined;
}

/** Lines as the service counts them. */
export const linesOf = text => {
  const lines = text.split(/\r\n|\r|\n/);
  if (lines.at(-1) === '') lines.pop();
  return lines;
};

/** What a result has in the columns of a table: rows as objects of those fields. */
const rowsOf = (result, { of }, fields) => {
  const table = at(result, parts(of));
  if (!table?.line) return [];
  return table.line.map((line, row) => ({ line, ...Object.fromEntries(fields.map(name => [name, table[name]?.[row]])) }));
};

/** The moves of every line in the panels of the picture: `{ line, x: [..], y: [..] }`, in their order. */
function movesOf(said, figure, result, job) {
  return said.places.map((place, index) => {
    const panel = figure.panels[index];
    const start = place.from ? (at(job, [place.from]) ?? 0) : 0;
    const rows = rowsOf(result, place, [place.x, place.y]);
    const points = rows.map(row => ({ line: row.line, x: row[place.x] === null ? null : row[place.x] - start, y: row[place.y] }));
    if (!panel) return [];
    return place.is_path ? steps(points, panel) : stretches(points);
  });
}

/** From point to point: each is the end of a move of its line. An arc has points between, those that are drawn. */
function steps(points, { items }) {
  const curves = items.filter(({ kind }) => kind === 'line');
  const drawn = new Map();
  curves.forEach(({ x, y }, curve) =>
    x.forEach((value, index) => {
      const place = `${value} ${y[index]}`;
      const list = drawn.get(place) ?? [];
      if (list.length < MOST_ALIKE) drawn.set(place, [...list, { curve, index }]);
    }),
  );
  const between = (from, end) => {
    for (const { curve, index: first } of drawn.get(`${from.x} ${from.y}`) ?? []) {
      const { x, y } = curves[curve];
      let last = first + 1;
      while (last < x.length && last - first < SHORT && y[last] !== null && !(x[last] === end.x && y[last] === end.y)) last += 1;
      if (x[last] === end.x && y[last] === end.y) return { x: x.slice(first, last + 1), y: y.slice(first, last + 1) };
    }
    return { x: [from.x, end.x], y: [from.y, end.y] };
  };
  return points.flatMap((end, index) => {
    const from = points[index - 1];
    if (!from || [from.x, from.y, end.x, end.y].some(value => value === null)) return [];
    return [{ line: end.line, ...between(from, end) }];
  });
}

/** Neighbours of one line. */
function stretches(points) {
  const found = [];
  for (const { line, x, y } of points) {
    if (found.at(-1)?.line !== line) found.push({ line, x: [], y: [] });
    found.at(-1).x.push(x);
    found.at(-1).y.push(y);
  }
  return found;
}

/** How far a place is from a move, in shares of the axes. */
function distance({ x, y }, place, [width, height]) {
  const at = index => [(x[index] - place.x) / width, (y[index] - place.y) / height];
  let least = Infinity;
  for (let index = 0; index < x.length; index += 1) {
    const [ax, ay] = at(index);
    const [bx, by] = at(Math.min(index + 1, x.length - 1));
    const [dx, dy] = [bx - ax, by - ay];
    const length = dx * dx + dy * dy;
    const share = length > 0 ? Math.min(1, Math.max(0, -(ax * dx + ay * dy) / length)) : 0;
    least = Math.min(least, Math.hypot(ax + share * dx, ay + share * dy));
  }
  return least;
}

/** From the least to the largest; 1 where that is nothing. */
function span(values) {
  let [low, high] = [Infinity, -Infinity];
  for (const value of values) [low, high] = [Math.min(low, value), Math.max(high, value)];
  return high - low || 1;
}

/** The line of the move nearest to a place of a panel; of several that lie on each other the last. */
export function lineAt(moves, place) {
  const wide = span(moves.flatMap(({ x }) => x.filter(value => value !== null)));
  const tall = span(moves.flatMap(({ y }) => y.filter(value => value !== null)));
  let best = null;
  for (const move of moves) {
    const far = distance(move, place, [wide, tall]);
    if (!best || far <= best.far + 1e-9) best = { line: move.line, far };
  }
  return best?.line ?? null;
}

/** A program with all that an answer says of its lines. */
export function useProgram({ description, answer, figure, job, problem }) {
  const said = useMemo(() => declaredProgram(description), [description]);
  const [line, choose] = useState(null);
  useEffect(() => choose(null), [answer?.key]);
  const isShown = Boolean(said && answer && figure && figure.id === said.figure);
  const moves = useMemo(() => (isShown ? movesOf(said, figure, answer.answer.result, answer.answer.input) : []), [answer, figure]);
  if (!said) return null;
  // A text that is refused is shown with its faults, in the place of the one that was answered.
  const faults = (problem?.errors ?? []).filter(({ pointer, values }) => pointer === `/${said.text}` && values?.line);
  const marks = line === null ? null : moves.map(list => list.filter(move => move.line === line));
  return { said, line, choose, moves, marks, faults, text: programText(said, faults.length > 0 ? job : answer?.job) };
}

/** The lines that are there to be seen: from, to, in order; what lies between is folded. */
export function shownRanges(count, telling, opened) {
  if (count <= SHORT) return [[1, count]];
  const wanted = new Set([1, ...opened]);
  for (const line of telling) for (let near = line - AROUND; near <= line + AROUND; near += 1) wanted.add(near);
  const ranges = [];
  for (const line of [...wanted].filter(line => line >= 1 && line <= count).sort((a, b) => a - b)) {
    const last = ranges.at(-1);
    // One line is no longer than the words that would stand in its place.
    if (last && line <= last[1] + 2) last[1] = line;
    else ranges.push([line, line]);
  }
  return ranges;
}

export function Program({ program, description, answer, names }) {
  const { said, line: chosen, choose, moves, faults, text } = program;
  const result = faults.length > 0 ? null : answer?.answer.result;
  const lines = useMemo(() => linesOf(text ?? ''), [text]);
  const changes = useMemo(() => new Map(((result && at(result, parts(said.changes))) ?? []).map(one => [one.line, one])), [result]);
  const notes = useMemo(() => notesOf(faults, result ? answer.answer.warnings : [], said), [faults, answer]);
  const moving = useMemo(() => new Set(moves.flatMap(list => list.map(({ line }) => line))), [moves]);
  const [opened, setOpened] = useState([]);
  useEffect(() => setOpened([]), [text]);
  const list = useRef(null);
  useEffect(() => {
    const row = chosen === null ? null : list.current?.querySelector(`[data-line="${chosen}"]`);
    if (row) keepInSight(list.current, row);
  }, [chosen]);
  if (text === undefined) return null;
  const canPress = line => moving.has(line) || notes.has(line);
  const pressable = lines.map((_, index) => index + 1).filter(canPress);
  const go = step => {
    const now = pressable.indexOf(chosen);
    const next = pressable[Math.min(Math.max(now < 0 ? 0 : now + step, 0), pressable.length - 1)];
    if (next === undefined) return;
    choose(next);
    setTimeout(() => list.current?.querySelector(`[data-line="${next}"]`)?.focus({ preventScroll: true }), 0);
  };
  const key = event => {
    const step = { ArrowDown: 1, ArrowUp: -1 }[event.key];
    if (!step || event.ctrlKey || event.metaKey || event.altKey) return;
    event.preventDefault();
    go(step);
  };
  const ranges = shownRanges(lines.length, [...changes.keys(), ...notes.keys(), ...(chosen === null ? [] : [chosen])], opened);
  const rows = ranges.flatMap(([from, to], index) => {
    const before = index === 0 ? 0 : ranges[index - 1][1];
    return [fold(before + 1, from - 1), ...Array.from({ length: to - from + 1 }, (_, at) => row(from + at))];
  });
  rows.push(fold((ranges.at(-1)?.[1] ?? 0) + 1, lines.length));
  function fold(from, to) {
    if (to < from) return null;
    const more = Array.from({ length: Math.min(MORE, to - from + 1) }, (_, at) => from + at);
    return html`<li key=${`fold-${from}`} class="folded"><button type="button" class="more" onClick=${() => setOpened([...opened, ...more])}>${plural('lines_as_they_were', to - from + 1)}</button></li>`;
  }
  function row(line) {
    const change = changes.get(line);
    const note = notes.get(line);
    const kind = [note?.isFault ? 'wrong' : note ? 'warned' : '', change ? 'changed' : '', line === chosen ? 'chosen' : ''].join(' ');
    const first = chosen !== null && canPress(chosen) ? chosen : pressable[0];
    const body = html`<span class="line-number">${line}</span><code>${change ? html`<del>${lines[line - 1]}</del>` : lines[line - 1]}</code>`;
    return html`
      <li key=${line} class=${`line ${kind}`}>
        ${
          canPress(line)
            ? html`<button type="button" data-line=${line} aria-pressed=${line === chosen} tabindex=${line === first ? 0 : -1} onClick=${() => choose(line === chosen ? null : line)}>${body}</button>`
            : html`<p data-line=${line}>${body}</p>`
        }
        ${change && html`<div class="in-its-place">${change.new.map((text, index) => html`<p key=${index}><span class="line-number">+</span><code><ins>${text}</ins></code></p>`)}</div>`}
        ${note && html`<ul class=${note.isFault ? 'fault' : 'note'}>${note.texts.slice(0, MOST_TOLD).map(text => html`<li>${capital(spoken(text, names))}</li>`)}</ul>`}
      </li>`;
  }
  return html`
    <section class="program" aria-label=${t('tab_program')}>
      <ol class="listing" ref=${list} onKeyDown=${key}>${rows}</ol>
      ${result && html`<${Cut} ...${{ said, result, description, line: chosen }} />`}
    </section>`;
}

/** Scrolls a row into sight within its list alone: the page stays where it is. */
function keepInSight(list, row) {
  const [box, own] = [list.getBoundingClientRect(), row.getBoundingClientRect()];
  if (own.top < box.top || own.bottom > box.bottom) list.scrollTop += own.top - box.top - box.height / 3;
}

/** What is said of single lines, by their numbers. */
function notesOf(faults, warnings, { text }) {
  const notes = new Map();
  const add = ({ values, detail }, isFault) => {
    for (const line of [values?.line ?? []].flat()) {
      const note = notes.get(line) ?? { isFault, texts: [] };
      note.texts.push(detail);
      notes.set(line, note);
    }
  };
  faults.forEach(fault => add(fault, true));
  warnings.filter(({ pointer }) => pointer === `/${text}`).forEach(warning => add(warning, false));
  return notes;
}

/** What the cut of a line meets: the least and the largest of each number. */
function Cut({ said, result, description: { output_schema: root }, line }) {
  const facts = useMemo(
    () =>
      line === null
        ? []
        : said.tells.flatMap(told => {
            const rows = rowsOf(result, told, told.fields).filter(row => row.line === line);
            const schema = schemaAt(root, told.of);
            return told.fields.flatMap(name => {
              const values = rows.map(row => row[name]).filter(value => typeof value === 'number');
              if (values.length === 0) return [];
              const field = resolve(schema.properties[name], root);
              // Of a column the unit stands at its numbers.
              const unit = unitOf(field) || (field.items && unitOf(resolve(field.items, root)));
              const ends = [Math.min(...values), Math.max(...values)].map(value => number(value, 3));
              return [{ label: labelOf(name, field), text: ends[0] === ends[1] ? ends[0] : `${ends[0]} … ${ends[1]}`, unit }];
            });
          }),
    [line, result, root],
  );
  return html`
    <div class="cut-of-line" role="status">
      ${line === null ? html`<p class="quiet">${t('press_a_line')}</p>` : html`<p><strong>${t('line_number', { line })}</strong>${facts.length === 0 && html` <span class="quiet">${t('no_cut_told')}</span>`}</p>`}
      ${facts.length > 0 && html`<dl>${facts.map(({ label, text, unit }) => html`<div><dt>${label}</dt><dd>${text} <small>${unit}</small></dd></div>`)}</dl>`}
    </div>`;
}

const schemaAt = (root, place) => parts(place).reduce((schema, name) => resolve(schema.properties[name], root), resolve(root, root));
