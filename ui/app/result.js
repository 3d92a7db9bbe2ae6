// What a run gave: the picture, a sentence, and everything else behind tabs.
import { html, useState, useEffect, useLayoutEffect, useMemo, useRef, usePrinting } from './lib.js';
import { t, capital, number, unitSymbol, unitOf, plural, moment } from './text.js';
import * as api from './api.js';
import { Picture, differenceOf, isLowScreen } from './figure.js';
import { resolve, humanised, labelOf, wordOf, namesOf, vocabularyOf, spoken, within } from './schema.js';
import { spreadOf, spreadColumns, withSpread } from './digits.js';
import { canReplay, Replay } from './replay.js';
import { canTrade, spanOf, TradeOff } from './tradeoff.js';
import { hasClamp, ClampBars } from './clamp.js';
import { hasCauses, Causes, answerSchema } from './cause.js';

/** The curve above a schedule leaves room for it. */
const TRADE_HEIGHT = 260;
/** More warnings than these are folded. */
const FEW_WARNINGS = 3;
/** More pictures than these are chosen from a list. */
const MOST_BUTTONS = 6;
/** What the picture of the causes tells already. */
const SHOWN_BY_CAUSES = ['diagnosis_next', 'diagnosis_gain'];
/** Items of a list that the printed sheet has. */
const PRINTED_ITEMS = 40;
/** On a low screen: what the panels have before it is measured, and at least; what a chart needs around its panel, the last
 *  one for the axis, and what is left free below. */
const LOW_ROOM = 260;
const LEAST_LOW_ROOM = 100;
const CHART_ROOM = 14;
const AXIS_ROOM = 32;
const END_ROOM = 10;
/** Rows of a table shown at once. */
const TABLE_ROWS = 200;

export function save(blob, name) {
  const link = document.createElement('a');
  link.href = URL.createObjectURL(blob);
  link.download = name;
  document.body.append(link);
  link.click();
  link.remove();
  setTimeout(() => URL.revokeObjectURL(link.href), 1000);
}

/** The height that the panels of a picture may have: what is left beside titles, names and a first sentence. On a low
 *  screen it is measured: the picture ends where the screen does. */
export function usePictureHeight(panels) {
  const [size, setSize] = useState([innerWidth, innerHeight]);
  const [room, setRoom] = useState(LOW_ROOM);
  useEffect(() => {
    const change = () => setSize([innerWidth, innerHeight]);
    addEventListener('resize', change);
    return () => removeEventListener('resize', change);
  }, []);
  const isLow = isLowScreen();
  // Names stand above the panels in as many lines as they need: what they leave does not depend on the panels.
  useLayoutEffect(() => {
    const plot = isLow && document.querySelector('.picture.main .plot');
    if (!plot) return undefined;
    const measure = () => {
      const charts = [...plot.querySelectorAll('svg.chart')];
      if (charts.length === 0) return;
      const box = plot.getBoundingClientRect();
      const charted = charts.reduce((sum, chart) => sum + chart.getBoundingClientRect().height, 0);
      const axes = charts[0].classList.contains('polar') ? 0 : CHART_ROOM * charts.length + AXIS_ROOM;
      setRoom(Math.round(innerHeight - (box.top + scrollY) - (box.height - charted) - axes - END_ROOM));
    };
    const observer = new ResizeObserver(measure);
    observer.observe(plot);
    return () => observer.disconnect();
  });
  if (isLow) return Math.max(LEAST_LOW_ROOM, room);
  const around = size[0] <= 860 ? 290 : 330;
  return Math.round(Math.max(240, Math.min(size[1] - around - 34 * panels, 900)));
}

const drawn = figure => figure.panels.flatMap(panel => panel.items).filter(({ kind, x }) => kind !== 'glyph' && x.length > 0);
/** Pictures of what the job did not ask for are empty: they are not offered. */
const shownOf = figures => { const some = figures.filter(figure => drawn(figure).length > 0); return some.length > 0 ? some : figures.slice(0, 1); };
/** The unit of what a diagnosis judges, empty for logarithms. */
const residualUnit = figures => { const unit = figures.find(({ id }) => id === 'residuals')?.panels[0]?.y.unit; return unit === undefined ? undefined : unitSymbol(unit); };
/** Whether a picture shows more than a single point. */
const isTelling = figure => drawn(figure).some(({ kind, x }) => kind !== 'points' || x.length > 1);

export function Result({ id, description, answer, problem, trouble, running, pinned, pin, models, pickOf, onApply, study, stale, isCancelled }) {
  const [chosen, setChosen] = useState(null);
  const [difference, setDifference] = useState(false);
  // An earlier state of the same run, in place of its end.
  const [earlier, setEarlier] = useState(null);
  const [factor, setFactor] = useState(1);
  // A point that is being dragged.
  const [grabbed, setGrabbed] = useState(null);
  useEffect(() => { setEarlier(null); setFactor(1); setGrabbed(null); }, [answer?.key]);
  const interim = running?.interim;
  const figures = shownOf(answer?.figures || []);
  const figure = interim || figures.find(({ id: name }) => name === chosen) || figures.find(isTelling) || figures[0];
  const height = usePictureHeight(figure?.panels.length || 1);
  if (!answer && !interim) {
    return html`<div class="empty">${running ? '' : problem ? html`<div class="no-answer">${trouble}<p>${isCancelled ? t('cancelled_waits') : t('picture_waits')}</p></div>` : html`<p class="late">${t('first_answer')}</p>`}</div>`;
  }
  const twin = pinned && !interim && pinned.key !== answer?.key ? pinned.figures.find(({ id: name }) => name === figure?.id) : null;
  const subtracted = twin && difference ? differenceOf(figure, twin) : null;
  const body = answer?.answer;
  const isOwn = figure && body && !interim && !subtracted;
  const picks = isOwn ? pickOf(figure, body) : null;
  const replays = isOwn && canReplay(id, figure, body.result);
  const trades = isOwn && canTrade(id, figure, answer.job);
  const pick = (x, y) => { const next = picks.jobAt(x, y); if (next) onApply(next); };
  const held = ([low, high], value) => Math.min(Math.max(value, low), high);
  const handle = trades ? { x: factor, onMove: x => setFactor(Number(held(spanOf(figure), x).toPrecision(4))), onDrop: () => {} }
    : picks?.at ? { x: (grabbed || picks.at)[0], y: (grabbed || picks.at)[1], onMove: (x, y) => setGrabbed([x, y]), onDrop: (x, y) => { setGrabbed(null); pick(x, y); } } : null;
  const [first, ...others] = body?.explanation.filter(({ code }) => !(hasCauses(id, body.result) && SHOWN_BY_CAUSES.includes(code))) || [];
  return html`
    <div class=${`result ${stale ? 'stale' : ''}`}>
      ${figures.length > MOST_BUTTONS && !interim && html`<${FigurePick} ...${{ figures, figure, choose: setChosen }} />`}
      ${figures.length > 1 && figures.length <= MOST_BUTTONS && !interim && html`
        <div class="figure-choice" role="group" aria-label=${t('figures')}>
          ${figures.map(({ id: name, title }) => html`<button type="button" key=${name} aria-pressed=${figure.id === name} onClick=${() => setChosen(name)}>${figures.filter(other => short(other.title.text) === short(title.text)).length > 1 ? title.text : short(title.text)}</button>`)}
        </div>`}
      <div class="picture-and-words">
        <div class="picture-box">
          ${figure ? html`<${Picture} key=${figure.id} figure=${subtracted && subtracted.panels.length ? subtracted : (replays && earlier) || figure} pinned=${subtracted ? null : twin} height=${trades ? Math.min(height, TRADE_HEIGHT) : height} main onPick=${picks ? pick : null} handle=${handle} />`
            : html`<p class="quiet">${t('no_figure')}</p>`}
          <div class="under">${(interim || stale) && html`<p class="stale-note" role="status">${interim ? t('so_far') : `${isCancelled ? `${t('state_cancelled')}. ` : ''}${t('stale_note')}`}</p>`}</div>
          ${replays && html`<${Replay} key=${answer.key} id=${id} answer=${body} job=${answer.job} figures=${figures} onShow=${setEarlier} />`}
          ${trades && html`<${TradeOff} key=${answer.key} ...${{ id, figure, factor, setFactor, figures }} answer=${body} job=${answer.job} schema=${description.input_schema} apply=${onApply} />`}
          ${picks && html`<p class="quiet hint">${picks.hint}</p>`}
        </div>
        ${body && html`
        <div class="words">
          ${first && html`<p class="verdict" aria-live="polite">${capital(first.text)}</p>`}
          <${Warnings} key=${answer.key} list=${body.warnings} names=${namesOf(description.input_schema)} />
          ${hasClamp(id, body.result) && html`<${ClampBars} result=${body.result} input=${body.input} schema=${description.output_schema} />`}
          ${hasCauses(id, body.result) && html`<${Causes} result=${body.result} description=${description} calculator=${body.input.calculator} unit=${residualUnit(figures)} />`}
          ${others.length > 0 && html`<ul class="explanation">${others.map(({ code, text }, index) => html`<li key=${code + index}>${capital(text)}</li>`)}</ul>`}
        </div>`}
      </div>
      ${body && html`
        <div class="bar">
          <button type="button" aria-pressed=${Boolean(pinned)} onClick=${pin}>${pinned ? t('unpin') : t('pin')}</button>
          ${pinned && (pinned.key === answer.key ? html`<span class="quiet">${t('pinned_same')}</span>` : html`
            <label><input type="checkbox" checked=${difference} onChange=${event => setDifference(event.currentTarget.checked)} /> ${t('draw_difference')}</label>
            <a href=${`#/${id}?result=${pinned.key}`}>${t('open_pinned')}</a>`)}
          ${study && html`<a class="button" id="vary" href=${study}>${t('vary_fields')}</a>`}
          <${Downloads} ...${{ id, description, answer, figure }} />
        </div>
        ${id === 'diagnosis' && models && body.result.named?.length > 0 && html`<${SaveModel} resultKey=${answer.key} />`}
        <${Tabs} ...${{ id, description, answer, pinned }} />
        <${Sheet} ...${{ description, body, job: answer.job }} />`}
    </div>`;
}

/** Many pictures: a list, and the way to the next and the one before. */
function FigurePick({ figures, figure, choose }) {
  const at = figures.indexOf(figure);
  const go = step => choose(figures[(at + step + figures.length) % figures.length].id);
  return html`
    <div class="figure-pick" role="group" aria-label=${t('figures')}>
      <button type="button" class="icon" aria-label=${t('picture_before')} title=${t('picture_before')} onClick=${() => go(-1)}>‹</button>
      <select id="figure" aria-label=${t('figures')} value=${figure.id} onChange=${event => choose(event.currentTarget.value)}>${figures.map(({ id, title }) => html`<option value=${id}>${title.text}</option>`)}</select>
      <button type="button" class="icon" aria-label=${t('picture_after')} title=${t('picture_after')} onClick=${() => go(1)}>›</button>
      <span class="quiet">${at + 1} / ${figures.length}</span>
    </div>`;
}

/** Warnings; of many the first few until all are asked for, and all on paper. */
export function Warnings({ list, names }) {
  const [asked, setAsked] = useState(list.length <= FEW_WARNINGS + 1);
  const isPrinting = usePrinting();
  const whole = asked || isPrinting;
  if (list.length === 0) return null;
  return html`
    <ul class="warnings" aria-label=${t('warnings')}>${(whole ? list : list.slice(0, FEW_WARNINGS)).map(({ code, detail, pointer }, index) => html`<li key=${code + pointer + index}><span class="sign" aria-hidden="true">!</span><span>${capital(spoken(detail, names))}</span></li>`)}</ul>
    ${!whole && html`<button type="button" class="more" onClick=${() => setAsked(true)}>${t('and_more', { count: list.length - FEW_WARNINGS })}</button>`}`;
}

export const short = text => text.split(/[:;,(–]/)[0].trim();

export function Downloads({ id, description, answer, figure }) {
  const [trouble, setTrouble] = useState(null);
  const name = `${id}-${answer.key.slice(3, 11)}`;
  const get = (accept, ending, query) => async () => {
    setTrouble(null);
    try { save(await api.file(answer.key, accept, query), `${name}.${ending}`); } catch (error) { setTrouble(error.problem?.detail || error.message); }
  };
  const has = type => description.media_types.includes(type);
  return html`
    <span class="downloads" role="group" aria-label=${t('download')}><span class="quiet">${t('download')}</span>
      <button type="button" onClick=${get('application/json', 'json', '')}>JSON</button>
      ${has('text/csv') && html`<button type="button" onClick=${get('text/csv', 'csv', '')}>CSV</button>`}
      ${has('image/svg+xml') && figure && html`<button type="button" onClick=${get('image/svg+xml', 'svg', `?figure=${figure.id}`)}>SVG</button>`}
      ${has('text/x-gcode') && html`<button type="button" onClick=${get('text/x-gcode', 'nc', '')}>${t('gcode')}</button>`}
      <button type="button" onClick=${() => window.print()}>${t('print')}</button>
    </span>
    ${trouble && html`<p class="fault" role="alert"><span>${trouble}</span></p>`}`;
}

function Tabs({ id, description, answer, pinned }) {
  const names = ['values', ...(description.tables.length ? ['tables'] : []), ...(description.media_types.includes('text/x-gcode') ? ['program'] : []), 'basis', 'request'];
  const [open, setOpen] = useState('values');
  const current = names.includes(open) ? open : names[0];
  const key = event => {
    const step = { ArrowRight: 1, ArrowLeft: -1 }[event.key];
    if (!step) return;
    event.preventDefault();
    const next = names[(names.indexOf(current) + step + names.length) % names.length];
    setOpen(next);
    document.getElementById(`tab-${next}`)?.focus();
  };
  return html`
    <div class="tabs">
      <div role="tablist" aria-label=${t('details')} onKeyDown=${key}>
        ${names.map(name => html`<button type="button" role="tab" key=${name} id=${`tab-${name}`} aria-selected=${name === current} aria-controls="tab-panel" tabindex=${name === current ? 0 : -1} onClick=${() => setOpen(name)}>${t(`tab_${name}`)}</button>`)}
      </div>
      <div role="tabpanel" id="tab-panel" aria-labelledby=${`tab-${current}`} tabindex="0">
        ${current === 'values' && html`<${Values} root=${description.output_schema} own=${id === 'diagnosis' ? answerSchema(description, answer.answer.input.calculator) : description.output_schema} inputs=${description.input_schema} result=${answer.answer.result} pinned=${pinned && pinned.key !== answer.key ? pinned.answer.result : null} />`}
        ${current === 'tables' && html`<${Tables} answerKey=${answer.key} said=${answer.language} id=${id} description=${description} />`}
        ${current === 'program' && html`<${Program} answerKey=${answer.key} said=${answer.language} />`}
        ${current === 'basis' && html`<${Basis} body=${answer.answer} description=${description} />`}
        ${current === 'request' && html`<${RequestView} id=${id} job=${answer.job} answer=${answer} />`}
      </div>
    </div>`;
}

/** The unit of a number whose unit is a result itself (`as objective_unit says`): that of the nearest field so named. */
function saidUnit(schema, beside) {
  const name = /^as (\w+) says$/.exec(schema['x-unit'] || '')?.[1];
  const found = name && beside.find(object => typeof object[name] === 'string');
  return found ? unitSymbol(found[name]) : undefined;
}

/** The single numbers and words of a result, by groups. */
function flat(schema, value, root, path = [], out = [], names = [], spread = null, beside = [{}], lists = false) {
  const whole = resolve(schema || {}, root);
  if (value === null || value === undefined || (!lists && whole['x-advanced'])) return out;
  if (Array.isArray(value)) {
    if (!lists || whole['x-table']) return out;
    if (value.every(item => typeof item !== 'object')) {
      if (value.length > 0) out.push({ path, value: value.slice(0, PRINTED_ITEMS).map(item => shownValue(item, resolve(whole.items || {}, root))).join('; '), unit: unitOf(whole['x-unit'] ? whole : whole.items), schema: {}, label: labelOf(path.at(-1), whole), group: names.slice(0, -1).join(' · ') });
      return out;
    }
    value.slice(0, PRINTED_ITEMS).forEach((item, index) => flat(whole.items, item, root, [...path, index], out, [...names.slice(0, -1), `${names.at(-1)} ${index + 1}`, ''], spread, beside, lists));
    return out;
  }
  if (typeof value === 'object') {
    const forms = whole.oneOf || whole.anyOf;
    const shape = forms?.map(form => resolve(form, root)).find(form => Object.keys(value).every(name => form.properties?.[name])) || whole;
    for (const [name, part] of Object.entries(value)) flat(shape.properties?.[name], part, root, [...path, name], out, [...names, labelOf(name, resolve(shape.properties?.[name] || {}, root))].filter(Boolean), spread, [value, ...beside], lists);
    return out;
  }
  out.push({ path, value, spread: spread?.(path), unit: saidUnit(whole, beside) ?? unitOf(whole), description: whole.description, schema: whole, label: labelOf(path.at(-1), whole), group: names.slice(0, -1).join(' · ') });
  return out;
}

/** An error of the numbers is known to two digits. */
const digitsOf = ({ path }) => (/(^|_)(numerical_error|uncertainty)(_[a-z]+)*$/.test(String(path.at(-1))) ? 2 : 5);

/** Words of results that no schema lists. */
const SAID = {
  quadratic: 'said_quadratic', grid: 'said_shape_grid', several_optima: 'said_several_optima', opening: 'said_opening', rpm_min: 'said_rpm_min', rpm_max: 'said_rpm_max', ln_factor: 'said_ln_factor', kappa: 'size_share',
  common: 'said_common', per_run: 'said_per_run', around: 'said_around', test_order: 'said_test_order', per_speed: 'said_per_speed', per_depth: 'said_per_depth', per_cell: 'said_per_cell', speed_and_depth: 'said_per_cell',
  'fitted to trials': 'said_fitted', 'pcg64 (XSL RR 128/64), Lemire\'s multiplication without rejection': 'said_generator',
  amplitude_cos_phase_mm: 'said_cosine', amplitude_sin_phase_mm: 'said_sine', amplitude_cos_end_phase_mm: 'said_cosine', amplitude_sin_end_phase_mm: 'said_sine',
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
    if (parts.length > 1 && isList && parts.some(one)) return capital(parts.map(part => (one(part) ? within(one(part)) : part)).join(joint === ' ' ? ', ' : joint));
  }
  const [field, ...value] = text.split(' = ');
  return value.length > 0 && one(field) ? `${one(field)} = ${value.join(' = ')}` : text;
}

const ANSWERS = { true: 'yes', yes: 'yes', false: 'no', no: 'no' };
/** A word under the name of its field or column. */
const wordUnder = (name, text, names) => (name === 'unit' || name.endsWith('_unit') ? unitSymbol(text) : OWN_NAMES.includes(name) ? text : ANSWERS[text] ? t(ANSWERS[text]) : worded(text, names));
const shownValue = (value, schema, names, digits = 5, name = '') => (typeof value === 'number' ? number(value, digits) : value === true ? t('yes') : value === false ? t('no') : schema?.enum ? wordOf(schema, value) : wordUnder(name, String(value), names));

/** `own` is the schema of this result, one of those that `root` has. */
function Values({ root, own, inputs, result, pinned }) {
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
    <div class=${`values ${before ? 'compared' : ''}`}>${groups.map(group => html`
      <table key=${group} class="value-table">
        <caption>${group || t('main_values')}</caption>
        <thead class=${before ? '' : 'hidden'}><tr><th scope="col">${t('name')}</th><th scope="col">${t('value')}</th>${before && html`<th scope="col">${t('pinned_value')}</th><th scope="col">${t('difference')}</th>`}<th scope="col">${t('unit')}</th></tr></thead>
        <tbody>${rows.filter(row => row.group === group).map(row => {
          const other = before?.get(row.path.join('/'));
          return html`<tr key=${row.path.join('/')}><th scope="row" title=${row.description}>${row.label}</th><td class=${typeof row.value === 'number' ? 'number' : ''}>${row.spread ? withSpread(row.value, row.spread.spread) : shownValue(row.value, row.schema, names, digitsOf(row), String(row.path.at(-1)))}</td>
            ${before && html`<td class=${typeof other === 'number' ? 'number' : ''}>${other === undefined ? '' : shownValue(other, row.schema, names, digitsOf(row), String(row.path.at(-1)))}</td><td class="number">${typeof other === 'number' && typeof row.value === 'number' ? `${row.value > other ? '+' : ''}${number(row.value - other, 3)}` : ''}</td>`}
            <td class="unit">${row.unit}</td></tr>`;
        })}</tbody>
      </table>`)}</div>`;
}

/** What the service gives for the answer of that key, in that language: `{ value }` or `{ trouble }`, `null` before the
 *  first. Until it is there what was shown before stays, `isOld`: nothing moves. What comes late is nobody's. */
function useFetched(fetched, key, said) {
  const [found, setFound] = useState(null);
  useEffect(() => {
    const control = new AbortController();
    const tell = what => { if (!control.signal.aborted) setFound({ key, ...what }); };
    api.patient(() => fetched(key, control.signal), control.signal)
      .then(value => tell({ value }), error => tell({ trouble: error.problem?.detail || error.message }));
    return () => control.abort();
  }, [key, said]);
  return found && { ...found, isOld: found.key !== key };
}

/** The tables of an answer; what the job did not ask for has one without rows. */
const filledTables = async (key, signal) => (await api.tables(key, signal)).filter(({ columns }) => columns.some(({ cells }) => cells.length > 0));

function Tables({ answerKey, said, id, description }) {
  const { labels } = description;
  const names = useMemo(() => vocabularyOf(description.output_schema, description.input_schema), [description]);
  const titled = name => (labels?.[name] ? capital(labels[name]) : humanised(name));
  const found = useFetched(filledTables, answerKey, said);
  const [chosen, setChosen] = useState(0);
  const [rows, setRows] = useState(TABLE_ROWS);
  if (!found) return html`<p class="late">${t('loading')}</p>`;
  if (found.trouble) return html`<p class="fault"><span>${found.trouble}</span></p>`;
  const { value: tables, isOld } = found;
  if (tables.length === 0) return html`<p class="quiet">${t('no_table')}</p>`;
  const table = tables[Math.min(chosen, tables.length - 1)];
  const count = Math.max(0, ...table.columns.map(({ cells }) => cells.length));
  const spreads = spreadColumns(table.columns);
  const cell = (name, value, spread) => {
    if (value === null || value === undefined) return '';
    if (typeof value === 'number') return spread ? withSpread(value, spread, false) : number(value, 6);
    // A set without causes is the model itself.
    return value === '' && name === 'causes' ? capital(t('the_base')) : wordUnder(name, String(value), names);
  };
  return html`
    <div class="bar">${tables.length > 1 && html`<label>${t('table')} <select value=${chosen} onChange=${event => { setChosen(Number(event.currentTarget.value)); setRows(TABLE_ROWS); }}>${tables.map(({ id: name }, index) => html`<option value=${index}>${titled(name)}</option>`)}</select></label>`}
      <span class="quiet">${plural('rows', count)}</span>
      <button type="button" disabled=${isOld} onClick=${async () => save(await api.file(answerKey, 'text/csv', `?table=${table.id}`), `${id}-${table.id}.csv`)}>CSV</button></div>
    <div class=${`grid-scroll tall ${isOld ? 'old' : ''}`} aria-busy=${isOld ? 'true' : undefined} tabindex="0" role="region" aria-label=${titled(table.id)}><table class="grid still">
      <thead><tr>${table.columns.map(({ text, unit }) => html`<th scope="col" class=${unit === '' ? 'word' : ''}>${capital(text)} <span class="unit">${unitSymbol(unit)}</span></th>`)}</tr></thead>
      <tbody>${Array.from({ length: Math.min(rows, count) }, (_, row) => html`<tr key=${row}>${table.columns.map(({ name, cells, unit }, at) => html`<td class=${unit === '' ? 'word' : ''}>${cell(name, cells[row], spreads[at]?.[row])}</td>`)}</tr>`)}</tbody>
    </table></div>
    ${count > rows && html`<button type="button" class="more" onClick=${() => setRows(rows + 1000)}>${t('more_rows', { count: count - rows })}</button>`}`;
}

function Program({ answerKey, said }) {
  const found = useFetched(api.program, answerKey, said);
  if (!found) return html`<p class="late">${t('loading')}</p>`;
  if (found.trouble) return html`<p class="fault"><span>${found.trouble}</span></p>`;
  const { value: text, isOld } = found;
  const lines = text.split('\n');
  return html`<div class=${`code-box ${isOld ? 'old' : ''}`} aria-busy=${isOld ? 'true' : undefined}><${Copy} text=${text} disabled=${isOld} /><pre tabindex="0" aria-label=${t('tab_program')}>${lines.slice(0, 400).join('\n')}${lines.length > 400 ? `\n… ${lines.length - 400}` : ''}</pre></div>`;
}

function Basis({ body, description }) {
  return html`
    <dl class="facts">
      <dt>${t('equations')}</dt><dd><ul>${body.basis.map(({ equation, source }, index) => html`<li key=${index}><code>${equation}</code> ${source}</li>`)}</ul></dd>
      ${description.references.length > 0 && html`<dt>${t('references')}</dt><dd><ul>${description.references.map(text => html`<li>${text}</li>`)}</ul></dd>`}
      <dt>${t('engine')}</dt><dd>${body.engine} · ${body.calculator} ${t('version')} ${body.version}</dd>
      <dt>${t('key')}</dt><dd><code class="key-text">${body.key}</code></dd>
      ${body.model && html`<dt>${t('model')}</dt><dd>${body.model.name} (${t('revision')} ${body.model.revision})</dd>`}
    </dl>`;
}

export function RequestView({ id, job, answer, link = `#/${id}?result=${answer.key}` }) {
  const text = JSON.stringify(job, null, 2);
  const line = `curl -sS ${location.origin}/v1/${id} -H 'Content-Type: application/json' -d '${JSON.stringify(job).replace(/'/g, "'\\''")}'`;
  const short_ = line.length > 20000 ? `${line.slice(0, 2000)} …` : line;
  return html`
    <p>${t('curl_line')}</p><div class="code-box"><${Copy} text=${line} /><pre class="wrapped" tabindex="0" aria-label=${t('curl_line')}>${short_}</pre></div>
    <p>${t('job_json')}</p><div class="code-box"><${Copy} text=${text} /><pre tabindex="0" aria-label=${t('job_json')}>${text.slice(0, 40000)}</pre></div>
    <p>${t('kept_under')} <a href=${link}>${t('share_link')}</a></p>`;
}

function Copy({ text, disabled }) {
  const [done, setDone] = useState(false);
  const area = useRef(null);
  const copy = async () => {
    try { await navigator.clipboard.writeText(text); } catch {
      // Without a secure origin there is no clipboard: the old way.
      area.current.hidden = false;
      area.current.value = text;
      area.current.select();
      document.execCommand('copy');
      area.current.hidden = true;
    }
    setDone(true);
    setTimeout(() => setDone(false), 1500);
  };
  return html`<button type="button" class="copy" disabled=${disabled} onClick=${copy}>${done ? t('copied') : t('copy')}</button><textarea ref=${area} hidden aria-hidden="true" tabindex="-1"></textarea>`;
}

/** The extended model of a diagnosis, under a name of the user's own. */
function SaveModel({ resultKey }) {
  const [name, setName] = useState('');
  const [done, setDone] = useState(null);
  const [trouble, setTrouble] = useState(null);
  const keep = async event => {
    event.preventDefault();
    setTrouble(null);
    try { setDone(await api.saveModel(name, { from_result: resultKey })); } catch (error) { setTrouble(error.problem?.errors?.[0]?.detail || error.problem?.detail || error.message); }
  };
  return html`
    <form class="bar save-model" onSubmit=${keep}>
      <label for="model-name">${t('save_model')}</label>
      <input id="model-name" type="text" value=${name} placeholder="lathe-7-winter" pattern="[a-z0-9][a-z0-9_\\-]{0,63}" required onInput=${event => setName(event.currentTarget.value)} aria-describedby="model-name-hint" />
      <button type="submit" class="primary">${t('save')}</button>
      <span class="quiet" id="model-name-hint">${done ? html`${t('model_saved', { name: done.name, revision: done.revision })} <a href="#/models">${t('models')}</a>` : t('model_name_hint')}</span>
      ${trouble && html`<p class="fault" role="alert"><span>${trouble}</span></p>`}
    </form>`;
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
          <tbody>${items.map(({ title, rows: own }) => html`<tr key=${title}><th>${title}:</th>${columns.map(({ path }) => {
            const row = own.find(one => one.path.at(-1) === path.at(-1));
            return html`<td class=${typeof row?.value === 'number' ? 'number' : ''}>${row && value(row)}</td>`;
          })}</tr>`)}</tbody>
        </table>`;
      })}
      <ul>${groups.map(group => html`<li key=${group}>${group && html`<strong>${group}:</strong> `}${others.filter(row => row.group === group).map(said).join(', ')}</li>`)}</ul>
      <p>precut ${body.engine} · ${body.calculator} ${t('version')} ${body.version} · ${body.key} · ${moment(new Date().toISOString())}</p>
    </section>`;
}
