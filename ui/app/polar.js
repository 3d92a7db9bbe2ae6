// A roundness chart, as a roundness tester draws it.
import { html } from './lib.js';
import { number } from './text.js';
import { scale, extent, aired, ticks, labels, valueAt } from './scale.js';
import { items } from './draw.js';
import { ordinates, Head, describe } from './panel.js';
import { RoundHandles } from './handles.js';
import { settingsOf } from './elsewhere.js';

/** A roundness chart: deviations magnified outward from a base circle. */
export function Polar({ figure, pinned, width, height, least, style, hidden, toggle, at, setAt, onPut, effect, isPrinting }) {
  const panel = { ...figure.panels[0], items: figure.panels[0].items.filter(item => !item.name || !hidden.has(item.name)) };
  const ghost = pinned?.panels[0];
  const size = Math.max(240, Math.min(width, Math.max(height, least)));
  const hasGlyphs = panel.items.some(item => item.kind === 'glyph');
  const centre = [width / 2, size / 2];
  // The angles at the sides need their width.
  const radius = Math.max(20, Math.min(size / 2 - (hasGlyphs ? 46 : 26), width / 2 - (hasGlyphs ? 56 : 34)));
  const span = extent([...ordinates(panel), ...(ghost ? ordinates(ghost) : [])], panel.y.scale);
  const domain = aired(span, panel.y.scale, 0.04);
  const r = scale(panel.y.scale, domain, [radius * 0.4, radius]);
  const places = ticks(panel.y.scale, domain, 4).filter(place => place >= domain[0] && place <= domain[1]);
  const { texts, factor } = labels(panel.y.scale, places);
  const place = (angle, value) => {
    const length = r(value);
    const turn = (angle * Math.PI) / 180;
    return [centre[0] + length * Math.cos(turn), centre[1] - length * Math.sin(turn)];
  };
  const spoke = (angle, from, to) => {
    const [c, s] = [Math.cos((angle * Math.PI) / 180), Math.sin((angle * Math.PI) / 180)];
    return `M${(centre[0] + from * c).toFixed(1)} ${(centre[1] - from * s).toFixed(1)}L${(centre[0] + to * c).toFixed(1)} ${(centre[1] - to * s).toFixed(1)}`;
  };
  const closed = item => {
    if (item.kind !== 'line' || item.x.length < 2) return item;
    // Two points a turn apart are a circle.
    if (item.x.length === 2) {
      const xs = Array.from({ length: 181 }, (_, index) => item.x[0] + ((item.x[1] - item.x[0]) * index) / 180);
      return { ...item, x: xs, y: xs.map(() => item.y[0]) };
    }
    const turn = item.x.at(-1) - item.x[0];
    return turn > 350 && turn < 360 ? { ...item, x: [...item.x, item.x[0] + 360], y: [...item.y, item.y[0]] } : item;
  };
  const stance = item => ({ mirrored: false, turn: 90 - item.x });
  const plane = { place, frame: { left: 0, top: 0, width: size * 4, height: size }, stance };
  const move = event => {
    const box = event.currentTarget.getBoundingClientRect();
    const angle = (Math.atan2(centre[1] - (event.clientY - box.top), event.clientX - box.left - centre[0]) * 180) / Math.PI;
    setAt((angle + 360) % 360);
  };
  const round = source => ({ ...source, items: source.items.map(closed) });
  const turned = at === null ? null : at;
  const lines = round(panel).items.filter(item => item.kind === 'line');
  return html`
    <${Head} ...${{ panel: round(figure.panels[0]), ghost: ghost && round(ghost), style, hidden, toggle, at, factor, span: span ? span[1] - span[0] : 0, polar: true }} />
    <div class="panel"><svg class="chart polar" width=${width} height=${size} viewBox=${`0 0 ${width} ${size}`} role="img" aria-label=${describe(panel, figure)} onPointerMove=${move} onPointerLeave=${() => setAt(null)}>
      <g class="grid">${places.map(value => html`<circle cx=${centre[0]} cy=${centre[1]} r=${r(value)} class=${value === 0 ? 'zero' : ''} />`)}
        ${Array.from({ length: 12 }, (_, index) => html`<path d=${spoke(30 * index, radius * 0.4, radius)} />`)}</g>
      <circle class="frame" cx=${centre[0]} cy=${centre[1]} r=${radius} />
      ${ghost && items(round(ghost), plane, { style, hidden, ghost: true })}
      ${items(round(panel), plane, { style, hidden })}
      <g class="tick-labels halo" text-anchor="middle">${places.map((value, index) => {
        const [h, v] = place(75, value);
        return html`<text x=${h} y=${v + 4}>${texts[index]}</text>`;
      })}</g>
      <g class="tick-labels" text-anchor="middle">${[0, 90, 180, 270].map(angle => {
        const [c, s] = [Math.cos((angle * Math.PI) / 180), Math.sin((angle * Math.PI) / 180)];
        return html`<text x=${centre[0] + (radius + (hasGlyphs ? 38 : 15)) * c} y=${centre[1] - (radius + (hasGlyphs ? 36 : 13)) * s + 4}>${angle}°</text>`;
      })}</g>
      ${
        turned !== null &&
        html`<path class="cursor" d=${spoke(turned, radius * 0.1, radius)} />
        <text class="x-name" x=${centre[0]} y=${centre[1] + 5} text-anchor="middle">${number(turned, 4)}°</text>
        ${lines.map(item => {
          const value = valueAt(item.x, item.y, turned);
          if (value === null || value === undefined) return null;
          const [h, v] = place(turned, value);
          return html`<circle class=${`dot ${style(item)}`} cx=${h} cy=${v} r="3.4" />`;
        })}`
      }
    </svg>
    ${onPut && !isPrinting && html`<${RoundHandles} settings=${settingsOf(figure)} ...${{ centre, place, effect }} put=${(setting, angle, how) => onPut(setting, angle, 0, how)} />`}</div>`;
}
