// What every panel of a figure has, whatever its frame: the axis with its name, the curves with theirs, the numbers
// that it spans.
import { html } from './lib.js';
import { capital, t, number, unitSymbol } from './text.js';
import { extent, valueAt, cellAt } from './scale.js';
import { isDrawn, markerOf, stretchAt, ribbonSample, weaves } from './draw.js';
import { colouring } from './palette.js';

export const axisName = (axis, factor) => {
  const unit = [factor, unitSymbol(axis.unit)].filter(Boolean).join(' ');
  const text = capital(axis.text);
  return unit ? `${text}, ${unit}` : text;
};

/** Digits that a number needs beside others of the span shown: about a thousandth of it. */
export function readDigits(value, span) {
  if (value === null || value === undefined || !Number.isFinite(value)) return '–';
  const size = Math.abs(value);
  if (size === 0 || !span) return number(value, 4);
  return number(value, Math.min(8, Math.max(3, Math.ceil(Math.log10(size / span)) + 4)));
}

/** The outer edges of the first and the last cell of a map. */
const edges = (x, isLog) => {
  if (x.length < 2) return x;
  const [low, high] = [x[0] - (x[1] - x[0]) / 2, x.at(-1) + (x.at(-1) - x.at(-2)) / 2];
  return [isLog && low <= 0 ? x[0] : low, high];
};

export function abscissae(figure) {
  const isLog = figure.x.scale === 'logarithmic';
  return figure.panels.flatMap(panel =>
    panel.items.flatMap(item =>
      !isDrawn(item) ? [] : item.kind === 'ribbon' ? [...item.x, ...item.x_end] : item.kind === 'heat_map' ? edges(item.x, isLog) : item.x,
    ),
  );
}

/** Of one side of an item what is seen of it in a view. */
function seenOf({ kind, x }, side, view) {
  if (!view) return side;
  const inside = at => x[at] >= view[0] && x[at] <= view[1];
  const found = [];
  side.forEach((value, at) => {
    if (inside(at)) found.push(value);
    // The points next to the view on either side: the curve enters from there.
    else if (kind !== 'points' && (inside(at - 1) || inside(at + 1))) found.push(value);
    // Of a view between two points the curve is all that there is.
    else if (kind !== 'points' && x[at - 1] < view[0] && x[at] > view[1]) found.push(side[at - 1], value);
  });
  return found;
}

export function ordinates(panel, view) {
  return panel.items.flatMap(item => {
    const sides = { line: [item.y], bars: [item.y], points: [item.y], outline: [item.y], band: [item.lower, item.upper] }[item.kind] ?? [];
    const found = sides.flatMap(side => seenOf(item, side, view));
    if (item.kind === 'bars') return [...found, 0];
    if (item.kind !== 'heat_map') return found;
    const half = item.y.length > 1 ? (item.y[1] - item.y[0]) / 2 : 0;
    return [Math.max(item.y[0] - half, item.y[0] > 0 ? item.y[0] / 10 : -Infinity), item.y.at(-1) + half];
  });
}

/** What has a value at the cursor: its room is there before the value, so that nothing moves. */
const READ = ['line', 'bars', 'points', 'band', 'ribbon'];

/** Name of the axis and of each curve, with its value at the cursor. */
export function Head({ panel, ghost, style, hidden, toggle, at, over = null, factor, span, polar }) {
  const seen = new Set();
  const named = panel.items.filter(item => item.name && isDrawn(item) && !seen.has(item.name) && seen.add(item.name));
  const value = (source, item) => {
    if (at === null) return null;
    const twin = source.items.find(other => other.name === item.name && other.kind === item.kind);
    if (!twin) return null;
    if (twin.kind === 'band') {
      const [low, high] = [valueAt(twin.x, twin.lower, at), valueAt(twin.x, twin.upper, at)];
      return low === null || low === undefined ? null : `${readDigits(low, span)} … ${readDigits(high, span)}`;
    }
    if (twin.kind === 'ribbon') {
      const stretch = stretchAt(twin, at);
      return stretch && `${number(stretch.weight, 3)} ${unitSymbol(panel.y.unit)}`;
    }
    if (!['line', 'bars', 'points'].includes(twin.kind)) return null;
    const read = valueAt(twin.x, twin.y, at, twin.kind === 'line');
    return read === null || read === undefined ? null : readDigits(read, span);
  };
  const map = panel.items.find(item => item.kind === 'heat_map');
  const stretch =
    at === null
      ? null
      : panel.items
          .filter(({ kind }) => kind === 'ribbon')
          .map(item => stretchAt(item, at))
          .find(Boolean);
  return html`
    <div class="panel-head">
      <span class="axis-name">${polar ? t('magnified', { name: axisName(panel.y, factor) }) : axisName(panel.y, factor)}${panel.items.some(({ kind }) => kind === 'ribbon') && html` <output class="stretch">${stretch?.place}</output>`}</span>
      ${named.map(item => {
        const now = value(panel, item);
        const before = ghost ? value(ghost, item) : null;
        return html`<button type="button" key=${item.name} class="series" aria-pressed=${!hidden.has(item.name)} onClick=${() => toggle(item.name)}>
          <${Swatch} item=${item} look=${style(item)} /><span>${item.text}</span>
          ${READ.includes(item.kind) && html`<output class=${`of-${item.kind} ${ghost ? 'two' : ''}`}>${now}${now !== null && before !== null && html`<small> (${before})</small>`}</output>`}
        </button>`;
      })}
      ${map && html`<${Key} item=${map} now=${at !== null && over !== null ? cellAt(map, at, over) : null} />`}
    </div>`;
}

function Swatch({ item, look }) {
  if (item.kind === 'ribbon')
    return html`<svg class="swatch" width="28" height="14" viewBox="0 0 28 14" aria-hidden="true"><defs>${weaves(`legend-${item.name}`)}</defs>${ribbonSample(item, look, `legend-${item.name}`)}</svg>`;
  const shape = {
    line: html`<path class=${`line ${look}`} d="M1 7H27" />`,
    band: html`<rect class=${`band ${look}`} x="1" y="2" width="26" height="10" />`,
    points: html`<path class=${`points ${look}`} d=${item.x.length > 150 ? `M8 9${markerOf(item)}M14 7${markerOf(item)}M20 5${markerOf(item)}` : `M14 7${markerOf(item)}`} />`,
    bars: html`<rect class=${`bars ${look}`} x="8" y="2" width="12" height="10" />`,
    outline: html`<rect class=${`outline ${look}`} x="2" y="2" width="24" height="10" />`,
  }[item.kind];
  return html`<svg class="swatch" width="28" height="14" viewBox="0 0 28 14" aria-hidden="true">${shape}</svg>`;
}

/** The colours of a map with their numbers. */
function Key({ item, now }) {
  const { steps, low, high } = colouring(item);
  return html`
    <span class="key"><span>${axisName(item.value)}</span><output>${now === null ? '' : `= ${number(now, 3)}`}</output><span class="key-scale"><span class="key-end">${number(low, 3)}</span>
      <svg width="120" height="12" viewBox="0 0 120 12" aria-hidden="true">${steps.map((colour, index) => html`<rect x=${(index * 120) / steps.length} width=${120 / steps.length + 0.4} height="12" fill=${`rgb(${colour})`} />`)}</svg>
      <span class="key-end">${number(high, 3)}</span></span></span>`;
}

/** A panel in words, for those who cannot see it. */
export function describe(panel, figure) {
  const spans = panel.items
    .filter(item => item.name && isDrawn(item) && (item.y || item.lower || item.places))
    .map(item => {
      if (item.places) return `${item.text} ${item.places.join(' ')}`;
      const span = extent(item.y || [...item.lower, ...item.upper], 'linear');
      return span ? `${item.text} ${number(span[0], 3)} … ${number(span[1], 3)}` : item.text;
    });
  return `${axisName(panel.y)} (${axisName(figure.x)}): ${spans.join('; ')}`;
}
