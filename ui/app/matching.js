// A table that is about to be used: which column is what, in which unit, its first rows and its chart.
import { html, useState, useMemo } from './lib.js';
import { t, plural, number, typed, unitSymbol, unitOf } from './text.js';
import { labelOf } from './schema.js';
import { choicesOf, converted } from './units.js';
import { hasUnit, unitRead, numbersOf, sizeAbout } from './table-file.js';
import { read } from './number.js';
import { extent } from './scale.js';
import { linePath } from './draw.js';

/** Rows of the file that are shown. */
const SHOWN = 4;
const CHART = { width: 360, height: 96, left: 6, right: 6, top: 6, bottom: 6 };

/** Columns and units of a file, to be confirmed. */
export function Matching({
  id,
  draft,
  filled,
  setDraft,
  columns,
  measured,
  most,
  others,
  conditions,
  rows,
  isMore,
  accept,
  cancel,
  label,
}) {
  const { file, matches } = draft;
  const set = (column, match) => setDraft({ ...draft, matches: { ...matches, [column]: match } });
  const isNeeded = ({ name, required }) => required || measured.includes(name);
  const sure = columns.filter(column => isNeeded(column) || matches[column.name]);
  const [all, setAll] = useState(sure.length === 0);
  const shown = all ? columns : sure;
  const isUnitless = ({ name, schema }) => Boolean(matches[name]) && hasUnit(schema) && matches[name].unit === null;
  const unitless = columns.filter(isUnitless);
  const missing = columns.filter(({ name, required }) => required && !matches[name]);
  const isUnmeasured = measured.length > 0 && !measured.some(name => matches[name]);
  const labelled = names =>
    columns
      .filter(({ name }) => names.includes(name))
      .map(({ name, schema }) => labelOf(name, schema))
      .join(', ');
  // Numbers that look like sizes where deviations are asked for: which they are is said by whoever knows.
  const asked = columns.filter(({ name }) => matches[name]?.size !== undefined && matches[name].less === null);
  const isLong = filled.rows.length + (isMore ? rows : 0) > most;
  const empty = file.rows.length - filled.rows.length;
  const isReady =
    missing.length === 0 &&
    unitless.length === 0 &&
    asked.length === 0 &&
    !isUnmeasured &&
    !isLong &&
    filled.rows.length > 0 &&
    Object.values(matches).some(Boolean);
  const unitFault = ({ name, schema }) =>
    matches[name].said === null
      ? t('unit_missing', { name: labelOf(name, schema) })
      : t('unit_unknown', { name: labelOf(name, schema), unit: matches[name].said });
  const titleOf = ({ title, index }) => title || t('column_number', { number: index + 1 });
  const titles = list => list.map(titleOf).join('; ');
  const pick = ({ name, schema }, text) => {
    if (text === '') {
      set(name, undefined);
      return;
    }
    const index = Number(text);
    settle({ name, schema }, { index, isGuess: false, ...unitRead(file.header[index], schema) });
  };
  /** The match with what its numbers look like. */
  const settle = (column, match) => {
    const size = sizeAbout(file, column, match);
    set(column.name, size === null ? { ...match, size: undefined, less: undefined } : { ...match, size, less: null });
  };
  return html`
    <div class="matching" role="group" id=${id} tabindex="-1" aria-label=${t('match_columns')}>
      <p><strong>${draft.source}</strong> <span class="quiet">${plural('rows', file.rows.length)}, ${plural('columns', file.header.length)}${file.isHeadless ? `; ${t('no_heading')}` : ''}</span></p>
      ${isLong && html`<p class="fault" role="alert"><span>${t('too_many_rows', { count: number(file.rows.length), most: number(most) })}</span></p>`}
      <p>${t('match_hint')}</p>
      <table class="grid still match"><thead><tr><th scope="col">${t('needed_column')}</th><th scope="col">${t('file_column')}</th><th scope="col">${t('unit')}</th></tr></thead>
        <tbody>${shown.map(column => {
          const { name, schema, required } = column;
          const match = matches[name];
          const units = hasUnit(schema) ? choicesOf(schema['x-unit']) : [];
          const isOpen = isUnitless(column);
          return html`<tr key=${name} class=${(required && !match) || isOpen || (isUnmeasured && measured.includes(name)) ? 'faulty' : ''}>
            <th scope="row" title=${schema.description}>${labelOf(name, schema)}${required && html`<span aria-hidden="true"> *</span>`}</th>
            <td><select aria-label=${`${labelOf(name, schema)}: ${t('file_column')}`} value=${match ? match.index : ''} onChange=${event => pick(column, event.currentTarget.value)}>
              <option value="">${t('no_column')}</option>
              ${file.header.map((title, index) => html`<option value=${index}>${titleOf({ title, index })}${file.rows[0]?.[index] ? ` (${file.rows[0][index]} …)` : ''}</option>`)}
            </select>${match?.isGuess && html`<span class="guessed">${t('guessed')}</span>`}</td>
            <td class="unit-cell">${
              match &&
              (units.length > 1
                ? html`<select aria-label=${`${labelOf(name, schema)}: ${t('unit')}`} aria-invalid=${isOpen ? 'true' : undefined} value=${match.unit ?? ''} onChange=${event => settle(column, { ...match, unit: event.currentTarget.value })}>
              ${match.unit === null && html`<option value="" disabled>${t('choose_unit')}</option>`}
              ${units.map(unit => html`<option value=${unit}>${unitSymbol(unit) || '1'}</option>`)}</select>`
                : unitOf(schema))
            }</td>
          </tr>`;
        })}</tbody></table>
      ${!all && columns.length > shown.length && html`<button type="button" class="more" onClick=${() => setAll(true)}>${t('more_fields', { count: columns.length - shown.length })}</button>`}
      ${missing.length > 0 && html`<p class="fault"><span>${t('columns_missing', { names: missing.map(({ name, schema }) => labelOf(name, schema)).join(', ') })}</span></p>`}
      ${isUnmeasured && html`<p class="fault"><span>${t('nothing_measured', { names: labelled(measured) })}</span></p>`}
      ${unitless.length > 0 && html`<p class="fault" role="alert">${unitless.map(column => html`<span key=${column.name}>${unitFault(column)}</span>`)}</p>`}
      ${columns.filter(({ name }) => matches[name]?.size !== undefined).map(column => html`<${Sizes} key=${column.name} column=${column} match=${matches[column.name]} set=${match => set(column.name, match)} />`)}
      ${others.kept.length > 0 && html`<p class="columns-kept">${t('columns_kept', { names: titles(others.kept) })}</p>`}
      ${conditions.length > 0 && html`<p class="columns-runs">${t('columns_runs', { names: conditions.map(({ name, schema }) => labelOf(name, schema)).join('; ') })}</p>`}
      ${empty > 0 && html`<p class=${filled.rows.length === 0 ? 'fault' : 'quiet'} role="status"><span>${t('rows_empty', { count: number(empty) })}</span></p>`}
      ${others.left.length > 0 && html`<p class="columns-left">${t('columns_left', { names: titles(others.left) })}</p>`}
      <${Chart} ...${{ file: filled, columns, matches, measured }} />
      <div class="actions">${isMore && html`<button type="button" class="primary" disabled=${!isReady} onClick=${() => accept(true)}>${t('add_rows', { count: number(rows) })}<span class="hidden">: ${label}</span></button>`}
        <button type="button" class=${isMore ? '' : 'primary'} disabled=${!isReady} onClick=${() => accept(false)}>${isMore ? t('use_table_alone') : t('use_table')}<span class="hidden">: ${label}</span></button>
        <button type="button" onClick=${cancel}>${t('cancel')}</button></div>
    </div>`;
}

/** Sizes or deviations: the nominal size is taken off, or it is said that there is none. */
function Sizes({ column, match, set }) {
  const [text, setText] = useState(typed(match.less || match.size));
  const nominal = read(text, 'mm');
  const isRead = !nominal.fault && nominal.value > 0;
  return html`
    <div class="sizes-asked" role="group" aria-label=${t('sizes_or_deviations')}>
      <p class=${match.less === null ? 'fault' : ''}><span>${t('looks_like_sizes', { name: labelOf(column.name, column.schema), size: number(match.size) })}</span></p>
      <div class="line"><button type="button" aria-pressed=${match.less > 0} disabled=${!isRead} onClick=${() => set({ ...match, less: nominal.value })}>${t('take_off')}</button>
        <input type="text" inputmode="decimal" aria-label=${t('nominal_size')} aria-invalid=${isRead ? undefined : 'true'} value=${text} onInput=${event => {
          setText(event.currentTarget.value);
          if (match.less) set({ ...match, less: null });
        }} /><span class="unit">${unitSymbol('mm')}</span></div>
      <button type="button" aria-pressed=${match.less === 0} onClick=${() => set({ ...match, less: 0 })}>${t('are_deviations')}</button>
    </div>`;
}

/** What the table will be: its first rows, and the measured numbers over their places. */
function Chart({ file, columns, matches, measured }) {
  const used = columns.filter(
    ({ name, schema }) => matches[name] && schema.type === 'number' && !(hasUnit(schema) && matches[name].unit === null),
  );
  const y = used.find(({ name }) => measured.includes(name)) ?? used.filter(({ required }) => required).at(-1);
  const x = used.find(column => column !== y && column.required) ?? used.find(column => column !== y);
  const columnOf = column =>
    numbersOf(file, matches[column.name]).map(value => {
      if (value === null || Number.isNaN(value)) return null;
      const { unit, less } = matches[column.name];
      const own = column.schema['x-unit'];
      const shown = hasUnit(column.schema) ? converted(value, unit, own) : value;
      return less ? shown - converted(less, 'mm', own) : shown;
    });
  const drawn = useMemo(
    () => (y ? { xs: x ? columnOf(x) : file.rows.map((_, index) => index + 1), ys: columnOf(y) } : null),
    [file, matches],
  );
  if (!drawn) return html`<p class="quiet">${t('chart_waits')}</p>`;
  const [xSpan, ySpan] = [extent(drawn.xs, 'linear'), extent(drawn.ys, 'linear')];
  const unread = drawn.ys.filter(value => value === null).length;
  if (!xSpan || !ySpan) return html`<p class="fault"><span>${t('no_numbers', { name: labelOf(y.name, y.schema) })}</span></p>`;
  const { width, height, left, right, top, bottom } = CHART;
  const place = (h, v) => [
    left + ((h - xSpan[0]) / (xSpan[1] - xSpan[0] || 1)) * (width - left - right),
    height - bottom - ((v - ySpan[0]) / (ySpan[1] - ySpan[0] || 1)) * (height - top - bottom),
  ];
  const named = (column, span) =>
    `${labelOf(column.name, column.schema)}: ${number(span[0], 4)} … ${number(span[1], 4)} ${unitOf(column.schema)}`.trim();
  const told = [named(y, ySpan), x ? named(x, xSpan) : t('rows_in_order')];
  // A table whose rows do not go on in one direction is one of points.
  const isLine = drawn.xs.every((value, index) => index === 0 || value >= drawn.xs[index - 1]);
  const points = drawn.xs.map((h, index) => (h === null || drawn.ys[index] === null ? null : place(h, drawn.ys[index]))).filter(Boolean);
  return html`
    <figure class="table-chart"><svg class="chart" viewBox=${`0 0 ${width} ${height}`} role="img" aria-label=${told.join('; ')}><rect class="frame" x="0.5" y="0.5" width=${width - 1} height=${height - 1} />
      ${isLine && points.length > 1 ? html`<path class="line command" d=${linePath(drawn.xs, drawn.ys, place, width)} />` : html`<path class="points command" d=${points.map(([h, v]) => `M${h.toFixed(1)} ${v.toFixed(1)}m-2 0h4m-2-2v4`).join('')} />`}</svg>
      <figcaption>${told.map(text => html`<span key=${text}>${text}</span>`)}${unread > 0 && html`<span class="fault">${t('cells_unread', { count: unread })}</span>`}</figcaption></figure>
    <div class="grid-scroll" tabindex="0" role="region" aria-label=${t('first_rows')}><table class="grid still"><thead><tr>${used.map(({ name, schema }) => html`<th scope="col">${labelOf(name, schema)} <span class="unit">${unitOf(schema)}</span></th>`)}</tr></thead>
      <tbody>${file.rows.slice(0, SHOWN).map(
        (_, row) =>
          html`<tr key=${row}>${used.map(column => {
            const value = columnOf(column)[row];
            return html`<td>${value === null ? '' : number(value, 6)}</td>`;
          })}</tr>`,
      )}</tbody></table></div>`;
}
