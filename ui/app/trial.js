// A setting along a curve that is tried before it is taken: a point that is dragged or stepped, what it changes in the form, and
// the figure of the job there over the present one. Which curve and which figure these are, the setting says.
import { html, useMemo } from './lib.js';
import { t, capital, number, unitSymbol, unitOf } from './text.js';
import { difference, fieldAt, labelOf, parts } from './schema.js';
import { valueAt } from './scale.js';
import { placeOf, settingsOf } from './elsewhere.js';
import { useProbe } from './probe.js';
import { Picture } from './figure.js';

const STEPS = 100;
const PREVIEW_HEIGHT = 330;
/** More numbers of one field than these are told by the least and the largest. */
const MOST_TOLD = 3;

/** The setting of a figure that is tried first, on a curve that has both ends. */
export const triedIn = figure => (figure ? settingsOf(figure).find(setting => setting.tried_in && spanOf(figure)) : undefined);

/** The ends of the curve. */
export function spanOf(figure) {
  const { x } = figure.panels[0].items.find(({ kind }) => kind === 'line') ?? {};
  return x?.length > 1 ? [x[0], x.at(-1)] : null;
}

/** A place along the curve as it is tried: within it, to four digits. */
export const held = (figure, x) => {
  const [low, high] = spanOf(figure);
  return Number(Math.min(Math.max(low, x), high).toPrecision(4));
};

/** What differs between two jobs, by fields: `{ label, unit, values }`. */
function changesOf(schema, before, after) {
  const fields = new Map();
  for (const [place, value] of difference(before, after)) {
    const path = parts(place);
    const field = fieldAt(schema, after, path);
    if (!field || typeof value !== 'number') continue;
    const name = String(path.at(-1));
    const entry = fields.get(name) ?? { label: labelOf(name, field.schema), unit: unitOf(field.schema), values: [] };
    entry.values.push(value);
    fields.set(name, entry);
  }
  return [...fields.values()];
}

function told({ label, unit, values }) {
  const all = [...new Set(values)];
  const text =
    all.length > MOST_TOLD
      ? `${number(Math.min(...all), 4)} … ${number(Math.max(...all), 4)}`
      : all.map(value => number(value, 4)).join('; ');
  return `${label} ${text} ${unit}`.trim();
}

/** Of a figure the panels in which another one of the same job differs. */
const differing = (figure, other) =>
  [...figure.panels.keys()].filter(index => JSON.stringify(figure.panels[index].items) !== JSON.stringify(other.panels[index]?.items));
const partOf = (figure, panels) => ({ ...figure, panels: panels.map(index => figure.panels[index]).filter(Boolean) });

export function Trial({ id, desk, figure, setting, answer, figures, x, setX, apply }) {
  const [low, high] = spanOf(figure);
  const isHere = Math.abs(Math.log(x / setting.x)) < 1e-6;
  const found = useProbe(id, isHere ? null : `${answer.key} ${x}`, signal =>
    desk.places.jobAt(placeOf(figure, setting, x, setting.y), signal),
  );
  const isThere = !isHere && found?.tag === `${answer.key} ${x}`;
  const own = figures.find(({ id: name }) => name === setting.tried_in);
  const there = found?.figures?.find(({ id: name }) => name === setting.tried_in);
  const { input_schema: schema } = desk.state.description;
  const changes = useMemo(() => (found?.job ? changesOf(schema, answer.job, found.job) : []), [found, schema]);
  const line = figure.panels[0].items.find(({ kind }) => kind === 'line');
  const value = valueAt(line.x, line.y, x);
  const { y } = figure.panels[0];
  const factor = `${capital(figure.x.text)} ${number(x, 3)} ${unitSymbol(figure.x.unit)}`.trim();
  const says = [factor, ...(isThere ? changes.map(told) : [])].join(': ');
  const isNone = value === null || value === undefined || (found?.problem && !isHere);
  const gives = isNone ? t('nothing_there') : `${capital(y.text)} ${number(value, 4)} ${unitSymbol(y.unit)}`;
  const better = !isNone && setting.y ? (100 * (value - setting.y)) / setting.y : null;
  const share = Math.log(x / low) / Math.log(high / low);
  const panels = own && there ? differing(there, own) : [];
  return html`
    <div class="scrubber trade" role="group" aria-label=${capital(figure.x.text)}>
      <div class="track"><input type="range" id="trial" min="0" max=${STEPS} step="1" value=${Math.round(STEPS * share)} aria-label=${capital(figure.x.text)} aria-valuetext=${`${says}: ${gives}`}
        onInput=${event => setX(stepped(Number(event.currentTarget.value), low, high, setting.x))} /></div>
      <p class="scrub-text"><strong>${says}</strong> ${gives}${better !== null && !isHere ? ` (${better > 0 ? '+' : '−'}${number(Math.abs(better), 2)} %)` : ''}</p>
      <button type="button" id="take-trial" class="primary" disabled=${!isThere || Boolean(found?.problem)} onClick=${() => apply(found.job)}>${t('use_this')}</button>
      <button type="button" disabled=${isHere} onClick=${() => setX(setting.x)}>${t('reset')}</button>
      ${found?.problem && !isHere && html`<p class="fault"><span>${found.problem.detail || found.problem.title}</span></p>`}
    </div>
    <div class="preview" data-at=${isThere ? x : setting.x}>${panels.length > 0 && !isHere && html`<${Picture} figure=${partOf(there, panels)} pinned=${partOf(own, panels)} height=${PREVIEW_HEIGHT} />`}</div>`;
}

/** The place at a step of the slider, by equal ratios; where the job stands is always one of them. */
function stepped(step, low, high, here) {
  const own = Math.round((STEPS * Math.log(here / low)) / Math.log(high / low));
  return step === own ? here : Number((low * (high / low) ** (step / STEPS)).toPrecision(5));
}
