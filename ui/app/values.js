// The numbers and words of a result or a job, by their schema: on the page, and on the printed sheet.
import { html, useMemo } from './lib.js';
import { t, capital, number, unitSymbol, unitOf, moment } from './text.js';
import { resolve, labelOf, wordOf, vocabularyOf, within } from './schema.js';
import { spreadOf, withSpread } from './digits.js';

/** Items of a list that the printed sheet has. */
const PRINTED_ITEMS = 40;

/** The unit of a number whose unit is a result itself (`as objective_unit says`): that of the nearest field so named. */
function saidUnit(schema, beside) {
  const name = /^as (\w+) says$/.exec(schema['x-unit'] || '')?.[1];
  const found = name && beside.find(object => typeof object[name] === 'string');
  return found ? unitSymbol(found[name]) : undefined;
}

/** The single numbers and words of a result, by groups. */
export function flat(schema, value, root, path = [], out = [], names = [], spread = null, beside = [{}], lists = false) {
  const whole = resolve(schema || {}, root);
  if (value === null || value === undefined || (!lists && whole['x-advanced'])) return out;
  if (Array.isArray(value)) {
    if (!lists || whole['x-table']) return out;
    if (value.every(item => typeof item !== 'object')) {
      if (value.length > 0)
        out.push({
          path,
          value: value
            .slice(0, PRINTED_ITEMS)
            .map(item => shownValue(item, resolve(whole.items || {}, root)))
            .join('; '),
          unit: unitOf(whole['x-unit'] ? whole : whole.items),
          schema: {},
          label: labelOf(path.at(-1), whole),
          group: names.slice(0, -1).join(' · '),
        });
      return out;
    }
    value
      .slice(0, PRINTED_ITEMS)
      .forEach((item, index) =>
        flat(
          whole.items,
          item,
          root,
          [...path, index],
          out,
          [...names.slice(0, -1), `${names.at(-1)} ${index + 1}`, ''],
          spread,
          beside,
          lists,
        ),
      );
    return out;
  }
  if (typeof value === 'object') {
    const forms = whole.oneOf || whole.anyOf;
    const shape = forms?.map(form => resolve(form, root)).find(form => Object.keys(value).every(name => form.properties?.[name])) || whole;
    for (const [name, part] of Object.entries(value))
      flat(
        shape.properties?.[name],
        part,
        root,
        [...path, name],
        out,
        [...names, labelOf(name, resolve(shape.properties?.[name] || {}, root))].filter(Boolean),
        spread,
        [value, ...beside],
        lists,
      );
    return out;
  }
  out.push({
    path,
    value,
    spread: spread?.(path),
    unit: saidUnit(whole, beside) ?? unitOf(whole),
    description: whole.description,
    schema: whole,
    label: labelOf(path.at(-1), whole),
    group: names.slice(0, -1).join(' · '),
  });
  return out;
}

/** An error of the numbers is known to two digits. */
export const digitsOf = ({ path }) => (/(^|_)(numerical|uncertainty)(_[a-z]+)*$/.test(String(path.at(-1))) ? 2 : 5);

/** Words of results that no schema lists. */
const SAID = {
  quadratic: 'said_quadratic',
  grid: 'said_shape_grid',
  several_optima: 'said_several_optima',
  opening: 'said_opening',
  rpm_min: 'said_rpm_min',
  rpm_max: 'said_rpm_max',
  ln_factor: 'said_ln_factor',
  kappa: 'size_share',
  common: 'said_common',
  per_run: 'said_per_run',
  around: 'said_around',
  test_order: 'said_test_order',
  per_speed: 'said_per_speed',
  per_depth: 'said_per_depth',
  per_cell: 'said_per_cell',
  speed_and_depth: 'said_per_cell',
  'fitted to trials': 'said_fitted',
  "pcg64 (XSL RR 128/64), Lemire's multiplication without rejection": 'said_generator',
  amplitude_cos_phase_mm: 'said_cosine',
  amplitude_sin_phase_mm: 'said_sine',
  amplitude_cos_end_phase_mm: 'said_cosine',
  amplitude_sin_end_phase_mm: 'said_sine',
};
/** Columns and fields in which names stand that the user gave: they are nobody's words. */
const OWN_NAMES = ['zone', 'id', 'label', 'batch', 'level', 'of_level'];
const isCode = text => /^[a-z][a-z0-9_.]*$/.test(text);

/** A name of a field or a kind, or several of them, in the words of the form; what is none of them stays as it is. */
function worded(text, names) {
  const one = word => names?.get(word) ?? (SAID[word] && t(SAID[word]));
  const own = one(text);
  if (own) return capital(own);
  for (const joint of [' + ', ', ', '|', ' ']) {
    const parts = text.split(joint);
    // Between words of a sentence there are spaces, too.
    const isList = joint === ' ' ? parts.every(part => one(part) || part.includes('_')) : parts.every(isCode);
    if (parts.length > 1 && isList && parts.some(one))
      return capital(parts.map(part => (one(part) ? within(one(part)) : part)).join(joint === ' ' ? ', ' : joint));
  }
  const [field, ...value] = text.split(' = ');
  return value.length > 0 && one(field) ? `${one(field)} = ${value.join(' = ')}` : text;
}

const ANSWERS = { true: 'yes', yes: 'yes', false: 'no', no: 'no' };
/** A word under the name of its field or column. */
export const wordUnder = (name, text, names) =>
  name === 'unit' || name.endsWith('_unit')
    ? unitSymbol(text)
    : OWN_NAMES.includes(name)
      ? text
      : ANSWERS[text]
        ? t(ANSWERS[text])
        : worded(text, names);
export const shownValue = (value, schema, names, digits = 5, name = '') =>
  typeof value === 'number'
    ? number(value, digits)
    : value === true
      ? t('yes')
      : value === false
        ? t('no')
        : schema?.enum
          ? wordOf(schema, value)
          : wordUnder(name, String(value), names);

/** `own` is the schema of this result, one of those that `root` has. */
export function Values({ root, own, inputs, result, pinned }) {
  const names = useMemo(() => vocabularyOf(root, inputs), [root, inputs]);
  const rows = useMemo(() => {
    const all = flat(own, result, root, [], [], [], path => spreadOf(result, path));
    // An uncertainty stands behind its number, not once more in a line of its own.
    const said = new Set(all.filter(({ spread, value }) => spread && typeof value === 'number').map(({ spread }) => spread.path.join('/')));
    return all.filter(({ path }) => !said.has(path.join('/')));
  }, [root, result]);
  const before = pinned ? new Map(flat(own, pinned, root).map(row => [row.path.join('/'), row.value])) : null;
  const groups = [...new Set(rows.map(({ group }) => group))];
  return html`
    <div class=${`values ${before ? 'compared' : ''}`}>${groups.map(
      group => html`
      <table key=${group} class="value-table">
        <caption>${group || t('main_values')}</caption>
        <thead class=${before ? '' : 'hidden'}><tr><th scope="col">${t('name')}</th><th scope="col">${t('value')}</th>${before && html`<th scope="col">${t('pinned_value')}</th><th scope="col">${t('difference')}</th>`}<th scope="col">${t('unit')}</th></tr></thead>
        <tbody>${rows
          .filter(row => row.group === group)
          .map(row => {
            const other = before?.get(row.path.join('/'));
            return html`<tr key=${row.path.join('/')}><th scope="row" title=${row.description}>${row.label}</th><td class=${typeof row.value === 'number' ? 'number' : ''}>${row.spread ? withSpread(row.value, row.spread.spread) : shownValue(row.value, row.schema, names, digitsOf(row), String(row.path.at(-1)))}</td>
            ${before && html`<td class=${typeof other === 'number' ? 'number' : ''}>${other === undefined ? '' : shownValue(other, row.schema, names, digitsOf(row), String(row.path.at(-1)))}</td><td class="number">${typeof other === 'number' && typeof row.value === 'number' ? `${row.value > other ? '+' : ''}${number(row.value - other, 3)}` : ''}</td>`}
            <td class="unit">${row.unit}</td></tr>`;
          })}</tbody>
      </table>`,
    )}</div>`;
}

/** Lists of alike objects among the rows: the items of each, `[{ title, rows }]`, as they would be lines of their own. */
function listsOf(rows) {
  const lists = new Map();
  for (const row of rows) {
    if (typeof row.path.at(-2) !== 'number') continue;
    const place = row.path.slice(0, -2).join('/');
    const items = lists.get(place) || lists.set(place, new Map()).get(place);
    const item = items.get(row.group) || items.set(row.group, []).get(row.group);
    item.push(row);
  }
  return [...lists.values()].filter(items => items.size > 1).map(items => [...items].map(([title, own]) => ({ title, rows: own })));
}

/** What only the printed sheet shows: inputs, those of one group in one line, alike ones as tables; key and versions. */
export function Sheet({ description, body, job }) {
  const rows = flat(description.input_schema, job, description.input_schema, [], [], [], null, [{}], true);
  const names = useMemo(() => vocabularyOf(description.output_schema, description.input_schema), [description]);
  const lists = listsOf(rows);
  const inTables = new Set(lists.flatMap(items => items.flatMap(item => item.rows)));
  const others = rows.filter(row => !inTables.has(row));
  const groups = [...new Set(others.map(({ group }) => group))];
  const value = row => shownValue(row.value, row.schema, names, 5, String(row.path.at(-1)));
  const said = row => `${row.label} ${value(row)}${row.unit ? ` ${row.unit}` : ''}`;
  return html`
    <section class="sheet" aria-hidden="true">
      <h2>${t('inputs')}</h2>
      ${lists.map(items => {
        const columns = [...new Map(items.flatMap(item => item.rows.map(row => [row.path.at(-1), row]))).values()];
        return html`<table key=${items[0].title}>
          <thead><tr><th></th>${columns.map(({ label, unit, value: one }) => html`<th class=${typeof one === 'number' ? 'number' : ''}>${label}${unit ? `, ${unit}` : ''}</th>`)}</tr></thead>
          <tbody>${items.map(
            ({ title, rows: own }) =>
              html`<tr key=${title}><th>${title}:</th>${columns.map(({ path }) => {
                const row = own.find(one => one.path.at(-1) === path.at(-1));
                return html`<td class=${typeof row?.value === 'number' ? 'number' : ''}>${row && value(row)}</td>`;
              })}</tr>`,
          )}</tbody>
        </table>`;
      })}
      <ul>${groups.map(
        group =>
          html`<li key=${group}>${group && html`<strong>${group}:</strong> `}${others
            .filter(row => row.group === group)
            .map(said)
            .join(', ')}</li>`,
      )}</ul>
      <p>precut ${body.engine} · ${body.calculator} ${t('version')} ${body.version} · ${body.key} · ${moment(new Date().toISOString())}</p>
    </section>`;
}
