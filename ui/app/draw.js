// The items of a figure as SVG elements.
import { html } from './lib.js';
import { ascends, below } from './scale.js';
import { colouring, colours } from './palette.js';

const MARKERS = {
  circle: 'm-3 0a3 3 0 1 0 6 0a3 3 0 1 0-6 0',
  square: 'm-3-3h6v6h-6z',
  diamond: 'm0-4l4 4l-4 4l-4-4z',
  triangle: 'm0-4l3.8 6.5h-7.6z',
  down: 'm0 4l3.8-6.5h-7.6z',
  plus: 'm-4 0h8m-4-4v8',
  cross: 'm-3-3l6 6m0-6l-6 6',
  bar: 'm0-4v8',
};
const BY_ROLE = {
  nominal: 'plus',
  before: 'cross',
  after: 'square',
  command: 'diamond',
  comparison: 'triangle',
  part: 'circle',
  stock: 'circle',
  tolerance: 'bar',
  uncertainty: 'bar',
  limit: 'bar',
  stable: 'circle',
  unstable: 'cross',
  plain: 'circle',
};
const SERIES = ['circle', 'square', 'triangle', 'diamond', 'cross', 'plus', 'bar', 'down'];
const VARIANTS = 6;

/** Whether an item is a drawn one of the picture's curves, areas and points; symbols, and what can be taken hold of, are not. */
export const isDrawn = ({ kind }) => !['glyph', 'handle', 'setting'].includes(kind);

/** The class of a role and its marker. */
export function role(of) {
  if (of && typeof of === 'object') {
    const n = of.series % SERIES.length;
    return { name: `n${n}`, marker: MARKERS[SERIES[n]] };
  }
  return { name: of, marker: MARKERS[BY_ROLE[of] || 'circle'] };
}

/** A curve that turns more often than this is a solid band: dashes would break it up. */
const MOST_TURNS = 60;
function isDense(item) {
  if (item.kind !== 'line' || item.x.length < 2 * MOST_TURNS) return false;
  let turns = 0;
  let before = 0;
  for (let index = 1; index < item.y.length; index += 1) {
    const step = Math.sign(item.y[index] - item.y[index - 1]);
    if (step && before && step !== before) turns += 1;
    if (step) before = step;
  }
  return turns > MOST_TURNS;
}

/** The classes of every name: equal names look equal in all panels, different names of one role differ. */
export function styles(figure) {
  const counts = {};
  const known = new Map();
  for (const panel of figure.panels) {
    for (const item of panel.items.filter(item => item.name && isDrawn(item))) {
      const base = role(item.role).name;
      const key = `${base} ${item.name}`;
      if (known.has(key)) continue;
      counts[base] = (counts[base] ?? -1) + 1;
      const variant = counts[base] % VARIANTS;
      known.set(key, `${variant ? `${base} v${variant}` : base}${figure.frame !== 'polar' && isDense(item) ? ' dense' : ''}`);
    }
  }
  return item => known.get(`${role(item.role).name} ${item.name}`) || role(item.role).name;
}

/** The letter and the pattern of a ribbon's role: those of its number in the family. */
export const letterOf = of => String.fromCharCode(65 + (typeof of === 'object' ? of.series % 26 : 0));
const WEAVES = 6;
const weaveOf = of => (typeof of === 'object' ? of.series % WEAVES : 0);
/** Lines and dots over a colour, so that it is not told by colour alone. */
export const weaves = id => [
  html`<pattern id=${`${id}-1`} width="7" height="7" patternUnits="userSpaceOnUse" patternTransform="rotate(45)"><path d="M0 0V7" /></pattern>`,
  html`<pattern id=${`${id}-2`} width="7" height="7" patternUnits="userSpaceOnUse" patternTransform="rotate(-45)"><path d="M0 0V7" /></pattern>`,
  html`<pattern id=${`${id}-3`} width="6" height="6" patternUnits="userSpaceOnUse"><path d="M2 3H4" /></pattern>`,
  html`<pattern id=${`${id}-4`} width="6" height="6" patternUnits="userSpaceOnUse"><path d="M0 3H6" /></pattern>`,
  html`<pattern id=${`${id}-5`} width="6" height="6" patternUnits="userSpaceOnUse"><path d="M3 0V6" /></pattern>`,
];
export const hasRibbons = panel => panel.items.some(item => item.kind === 'ribbon');
/** The lightest of several ribbons over one stretch still has this share of the height. */
const LEAST_SHARE = 0.24;
/** Room that a letter needs, and about that of a name. */
const LETTER = 12;
const widthOf = text => [...text].reduce((sum, letter) => sum + (/[а-яёА-ЯЁA-Zmw]/.test(letter) ? 7.6 : 6.3), 0);

/** Where the pieces of a ribbon lie in the height of their panel, from 0 above to 1: by weight, the heaviest above. */
function sharesOf(panel, item) {
  const ribbons = panel.items.filter(({ kind }) => kind === 'ribbon');
  return item.x.map(from => {
    const here = ribbons
      .map(one => ({ name: one.name, weight: one.weight[one.x.indexOf(from)] }))
      .filter(({ weight }) => weight > 0)
      .sort((a, b) => b.weight - a.weight);
    const sum = here.reduce((total, { weight }) => total + weight, 0);
    const raised = here.map(({ weight }) => Math.max(weight / sum, LEAST_SHARE));
    const whole = raised.reduce((total, share) => total + share, 0);
    const place = here.findIndex(({ name }) => name === item.name);
    const above = raised.slice(0, place).reduce((total, share) => total + share, 0);
    return [above / whole, (above + raised[place]) / whole];
  });
}

/** The stretch of a ribbon at a place: its name and its weight; `null` where it has none. */
export function stretchAt(item, x) {
  const at = item.x.findIndex((from, index) => x >= from && (x < item.x_end[index] || (x === item.x_end[index] && !item.x.includes(x))));
  return at < 0 ? null : { place: item.places[at], weight: item.weight[at] };
}

function ribbon(panel, item, { x, frame, id }, look, ghost) {
  // A run that is compared lies as a strip below the present one.
  const [top, height] = ghost
    ? [frame.top + frame.height * 0.74, frame.height * 0.26]
    : [frame.top, frame.height * (frame.hasGhost ? 0.7 : 1)];
  const shares = sharesOf(panel, item);
  return item.x.map((from, index) => {
    const [left, right] = [x(from), x(item.x_end[index])];
    if (!(right > left)) return null;
    const [high, low] = [top + shares[index][0] * height, top + shares[index][1] * height];
    const box = { x: px(left), y: px(high), width: px(right - left), height: px(low - high) };
    const weave = weaveOf(item.role);
    const said = [item.text, letterOf(item.role)].find(text => widthOf(text) + 8 <= right - left);
    return html`<g key=${item.name + index}><title>${`${item.places[index]}: ${item.text}`}</title>
      <rect class=${`ribbon ${look}`} ...${box} />${weave > 0 && html`<rect class="weave" fill=${`url(#${id}-${weave})`} ...${box} />`}
      ${said && low - high >= LETTER && html`<text class="said" x=${px((Math.max(left, frame.left) + Math.min(right, frame.left + frame.width)) / 2)} y=${px((high + low) / 2 + 4)} text-anchor="middle">${said}</text>`}</g>`;
  });
}

/** A piece of a ribbon with its letter, for a legend. */
export const ribbonSample = (item, look, id) =>
  html`<rect class=${`ribbon ${look}`} x="1" y="1" width="26" height="12" />${weaveOf(item.role) > 0 && html`<rect class="weave" fill=${`url(#${id}-${weaveOf(item.role)})`} x="1" y="1" width="26" height="12" />`}<text class="said" x="14" y="11" text-anchor="middle">${letterOf(item.role)}</text>`;

const px = value => Math.round(value * 10) / 10;

/** A curve as a path. Where there are many more points than pixels, the extremes of each pixel stand for them. */
export function linePath(xs, ys, place, width) {
  let path = '';
  let pen = false;
  const put = (x, y) => {
    const [h, v] = place(x, y);
    if (!Number.isFinite(h) || !Number.isFinite(v)) {
      pen = false;
      return;
    }
    path += `${pen ? 'L' : 'M'}${px(h)} ${px(v)}`;
    pen = true;
  };
  const dense = xs.length > 4 * width && ascends(xs);
  if (!dense) {
    for (let index = 0; index < xs.length; index += 1) {
      if (ys[index] === null) pen = false;
      else put(xs[index], ys[index]);
    }
    return path;
  }
  let index = 0;
  while (index < xs.length) {
    const column = Math.floor(place(xs[index], 0)[0]);
    let low = null;
    let high = null;
    let gap = false;
    const first = index;
    while (index < xs.length && Math.floor(place(xs[index], 0)[0]) === column) {
      if (ys[index] === null) gap = true;
      else {
        if (low === null || ys[index] < ys[low]) low = index;
        if (high === null || ys[index] > ys[high]) high = index;
      }
      index += 1;
    }
    if (gap) pen = false;
    if (low !== null)
      for (const at of [...new Set([first, low, high, index - 1])].sort((a, b) => a - b)) if (ys[at] !== null) put(xs[at], ys[at]);
  }
  return path;
}

function ring(xs, ys, place) {
  return xs
    .map((x, index) => place(x, ys[index]))
    .filter(point => point.every(Number.isFinite))
    .map(([h, v], index) => `${index ? 'L' : 'M'}${px(h)} ${px(v)}`)
    .join('');
}

/** Where the middles of neighbouring columns meet. */
const nearest = (list, value) => {
  const at = below(list, value);
  if (at < 0) return 0;
  if (at >= list.length - 1) return list.length - 1;
  return value - list[at] < list[at + 1] - value ? at : at + 1;
};

/** The picture of a map that was drawn last, by the map, and how it was drawn: it costs more than the rest of its panel. */
const drawnMaps = new WeakMap();

/** A map as a picture of its pixels. */
function mapImage(item, x, y, frame) {
  const { left, top, width, height } = frame;
  const ends = [x.back(left), x.back(left + width), y.back(top), y.back(top + height)];
  const how = [left, top, width, height, ...ends, ...colours(item.diverging)].join();
  if (drawnMaps.get(item)?.how !== how) drawnMaps.set(item, { how, href: mapPixels(item, x, y, frame) });
  return html`<image x=${left} y=${top} width=${width} height=${height} href=${drawnMaps.get(item).href} preserveAspectRatio="none" />`;
}

/** The address of that picture; what is above the parting of colours is hatched, too. */
function mapPixels(item, x, y, { left, top, width, height }) {
  const canvas = document.createElement('canvas');
  const [columns, rows] = [Math.max(1, Math.round(width)), Math.max(1, Math.round(height))];
  canvas.width = columns;
  canvas.height = rows;
  const context = canvas.getContext('2d');
  const image = context.createImageData(columns, rows);
  const { step, steps, isAbove } = colouring(item);
  // A cell has many pixels.
  const cells = item.values.map(value =>
    value === null ? null : { colour: steps[step(value)], isHatched: item.diverging && isAbove(value) },
  );
  const half = list => (list.length > 1 ? [(list[1] - list[0]) / 2, (list.at(-1) - list.at(-2)) / 2] : [0, 0]);
  const inside = (list, value, ends) => value >= list[0] - ends[0] && value <= list.at(-1) + ends[1];
  const [hx, hy] = [half(item.x), half(item.y)];
  const across = Array.from({ length: columns }, (_, column) => {
    const value = x.back(left + column + 0.5);
    return inside(item.x, value, hx) ? nearest(item.x, value) : -1;
  });
  for (let row = 0; row < rows; row += 1) {
    const value = y.back(top + row + 0.5);
    if (!inside(item.y, value, hy)) continue;
    const base = nearest(item.y, value) * item.x.length;
    for (let column = 0; column < columns; column += 1) {
      if (across[column] < 0) continue;
      const cell = cells[base + across[column]];
      if (cell === null) continue;
      const { colour, isHatched } = cell;
      const at = 4 * (row * columns + column);
      const dim = isHatched && (row + column) % 9 === 0 ? 0.78 : 1;
      for (let part = 0; part < 3; part += 1) image.data[at + part] = colour[part] * dim;
      image.data[at + 3] = 255;
    }
  }
  context.putImageData(image, 0, 0);
  return canvas.toDataURL();
}

/** A symbol, its tip at the place. */
function glyph(item, place, { mirrored, turn = 0, reach = 12 }) {
  const [h, v] = place(item.x, item.y);
  if (!Number.isFinite(h) || !Number.isFinite(v)) return null;
  const across = item.glyph === 'centre_right' || (item.glyph === 'chuck' && mirrored) ? -1 : 1;
  const up = mirrored && ['steady_rest', 'follow_rest', 'tool'].includes(item.glyph) ? -1 : 1;
  const half = Math.max(reach, 5) + 12;
  const jaw = Math.max(reach, 5);
  const shape = {
    centre_left: html`<path d="M0 0L-15.6-9H-30V9H-15.6z" /><path d="M-15.6-9V9" />`,
    centre_right: html`<path d="M0 0L-15.6-9H-30V9H-15.6z" /><path d="M-15.6-9V9" />`,
    chuck: html`<rect x="-30" y=${-half} width="22" height=${2 * half} /><path d=${`M-8-${jaw}H12v-8H-8zM-8 ${jaw}H12v8H-8z`} />`,
    steady_rest: html`<path d="M0-6V-22M-10-22H10M-10-27l5 5M-5-27l5 5M0-27l5 5M5-27l5 5" /><circle cy="-6" r="6" /><circle class="solid" cy="-6" r="1.4" />`,
    follow_rest: html`<path d="M0-6V-18" /><rect x="-9" y="-24" width="18" height="6" /><path d="M-10-29H10M-6-32l-4 3l4 3M6-32l4 3l-4 3" fill="none" /><circle cy="-6" r="6" /><circle class="solid" cy="-6" r="1.4" />`,
    tool: html`<path d="M-5.5-12V-32H5.5V-12z" /><path class="solid" d="M0 0L6.5-9L0-18L-6.5-9z" />`,
  }[item.glyph];
  return html`<g class="glyph" transform=${`translate(${px(h)} ${px(v)}) rotate(${turn}) scale(${across} ${up})`}>${shape}</g>`;
}

const has = (item, x) => {
  const at = below(item.x, x);
  return item.x[at] === x && item.y[at] !== null;
};

/** The least distance of neighbouring bars of a panel, all names together, by `place`; 0 where there is one abscissa. */
export function barStep(panel, place = x => x) {
  const places = [
    ...new Set(panel.items.filter(({ kind }) => kind === 'bars').flatMap(item => item.x.filter((_, at) => item.y[at] !== null))),
  ]
    .map(place)
    .sort((a, b) => a - b);
  const steps = places.slice(1).map((one, at) => one - places[at]);
  return steps.length > 0 ? Math.min(...steps) : 0;
}

/** More points than these are drawn small: they stand for a curve. */
const DENSE = 150;
const smaller = marker =>
  marker === MARKERS.circle
    ? 'm-1.5 0a1.5 1.5 0 1 0 3 0a1.5 1.5 0 1 0-3 0'
    : marker.replace(/-?\d*\.?\d+/g, number => `${Number(number) * 0.5} `);
export const markerOf = item => (item.x.length > DENSE ? smaller(role(item.role).marker) : role(item.role).marker);

/** @typedef {{ style: (item: any) => string, hidden: Set<string>, ghost?: boolean }} Look */
/** Draws the items of a panel. `plane` has `place(x, y)`, the scales, the frame, and how symbols stand.
 *  @param {any} panel @param {any} plane @param {Look} look */
export function items(panel, plane, { style, hidden, ghost }) {
  const { place, x, y, frame, stance } = plane;
  const barNames = [...new Set(panel.items.filter(item => item.kind === 'bars').map(item => item.name))];
  return panel.items.map((item, index) => {
    if (item.name && hidden.has(item.name)) return null;
    const look = `${style(item)}${ghost ? ' ghost' : ''}`;
    switch (item.kind) {
      case 'line':
        return html`<path key=${index} class=${`line ${look}`} d=${linePath(item.x, item.y, place, frame.width)} />`;
      case 'band': {
        const edge = ring([...item.x, ...[...item.x].reverse()], [...item.upper, ...[...item.lower].reverse()], place);
        const lines = [item.upper, item.lower].map(
          side => html`<path class=${`edge ${look}`} d=${linePath(item.x, side, place, frame.width)} />`,
        );
        return html`<g key=${index}><path class=${`band ${look}`} d=${`${edge}z`} />${lines}</g>`;
      }
      case 'points': {
        const marker = markerOf(item);
        const d = item.x
          .map((value, at) => place(value, item.y[at]))
          .filter(point => point.every(Number.isFinite))
          .map(([h, v]) => `M${px(h)} ${px(v)}${marker}`)
          .join('');
        return html`<path key=${index} class=${`points ${look}`} d=${d} />`;
      }
      case 'bars': {
        if (ghost && !x) return null;
        const whole = Math.min(barStep(panel, x) * 0.8 || frame.width / 4, 60);
        const zero = y.spacing === 'logarithmic' ? frame.top + frame.height : Math.min(Math.max(y(0), frame.top), frame.top + frame.height);
        const d = item.x
          .map((value, place_) => {
            if (item.y[place_] === null || !Number.isFinite(y(item.y[place_]))) return '';
            // Those of several names over one abscissa stand side by side.
            const here = barNames.filter(name =>
              panel.items.some(other => other.kind === 'bars' && other.name === name && has(other, value)),
            );
            const width = Math.max(whole / here.length, 1);
            const left = x(value) - whole / 2 + here.indexOf(item.name) * width;
            const tip = y(item.y[place_]);
            return `M${px(left)} ${px(zero)}V${px(tip)}h${px(width * 0.94)}V${px(zero)}z`;
          })
          .join('');
        return html`<path key=${index} class=${`bars ${look}`} d=${d} />`;
      }
      case 'heat_map':
        return ghost || !x ? null : html`<g key=${index}>${mapImage(item, x, y, frame)}</g>`;
      case 'ribbon':
        return x ? html`<g key=${index}>${ribbon(panel, item, plane, look, ghost)}</g>` : null;
      case 'outline':
        return html`<path key=${index} class=${`outline ${look}`} d=${`${ring(item.x, item.y, place)}z`} />`;
      case 'glyph':
        return ghost ? null : html`<g key=${index}>${glyph(item, place, stance(item))}</g>`;
      default:
        return null;
    }
  });
}
