// A figure of the service, drawn to be read: hover or arrow keys read a station through all panels, dragging zooms,
// a pinned run lies under the present one. What to draw comes as data; nothing here knows a calculator.
import { html, useState, useRef, useMemo, useLayoutEffect, useEffect, usePrinting, unique } from './lib.js';
import { t, number, unitSymbol } from './text.js';
import { scale, extent, aired, ticks, labels, valueAt, cellAt } from './scale.js';
import { items, styles, weaves, hasRibbons, stretchAt, barStep, linePath } from './draw.js';
import { axisName, readDigits, abscissae, ordinates, Head, describe } from './panel.js';
import { Polar } from './polar.js';
import { Handles, usePlane } from './handles.js';

const LEAST_PANEL = 78;
const LEAST_RIBBON = 44;
/** So many panels are each a little lower. */
const MANY_PANELS = 5;
const LEAST_OF_MANY = 62;
const LEAST_POLAR = 380;
const AXIS_ROOM = 40;
/** The same on a low screen. */
const LOW = { panel: 46, ofMany: 30, ribbon: 36, polar: 260 };
/** On paper a picture has the room that the words and the inputs leave on the same sheet: its width, that of the sheet in
 *  CSS pixels, what of the sheet's height is not taken anyway, and what a letter and the names above a panel take of it. */
const PAPER_WIDTH = 960;
const SHEET_WIDTH = 703;
const SHEET_ROOM = 840;
const OF_WORDS = 0.2;
const OF_INPUTS = 0.17;
const OF_NAMES = 22;
const LEAST_PAPER = 170;
const MOST_PAPER = 520;
const LEAST_ON_PAPER = 32;
const END_GLYPHS = ['centre_left', 'centre_right', 'chuck'];
const GLYPH_ROOM = 36;
/** Rows of the table that says what the picture shows. */
const TABLE_ROWS = 120;

/** A shop tablet, a small window: every line of its height counts. */
export const isLowScreen = () => innerWidth > 860 && innerHeight < 700;
/** A phone: the form and the picture are two panes. */
const isNarrow = () => innerWidth <= 860;

function paperHeight({ frame, panels }) {
  const letters = selector => document.querySelector(selector)?.textContent.length || 0;
  const room = SHEET_ROOM - OF_WORDS * letters('.words') - OF_INPUTS * letters('.sheet') - OF_NAMES * panels.length;
  const axes = frame === 'polar' ? 0 : 14 * panels.length + AXIS_ROOM - 8;
  return Math.round(Math.max(LEAST_PAPER, Math.min((room * PAPER_WIDTH) / SHEET_WIDTH - axes, MOST_PAPER)));
}

/** The width of an element, as it changes. */
function useWidth() {
  const ref = useRef(null);
  const [width, setWidth] = useState(0);
  useLayoutEffect(() => {
    const measure = () => setWidth(Math.floor(ref.current?.clientWidth || 0));
    measure();
    const observer = new ResizeObserver(measure);
    observer.observe(ref.current);
    return () => observer.disconnect();
  }, []);
  return [ref, width];
}

/** Draws again when the colour scheme changes: maps are pictures of pixels. */
function useScheme() {
  const [scheme, setScheme] = useState(0);
  useEffect(() => {
    const query = matchMedia('(prefers-color-scheme: dark)');
    const change = () => setScheme(count => count + 1);
    query.addEventListener('change', change);
    return () => query.removeEventListener('change', change);
  }, []);
  return scheme;
}

/** What a figure is with another taken from it: curves of the same name, point by point. */
export function differenceOf(figure, other) {
  const panels = figure.panels.map((panel, index) => {
    const twins = other.panels[index]?.items || [];
    const lines = panel.items
      .filter(item => item.kind === 'line' || item.kind === 'bars')
      .flatMap(item => {
        const twin = twins.find(candidate => candidate.kind === item.kind && candidate.name === item.name);
        if (!twin) return [];
        const y = item.x.map((x, at) => {
          const before = valueAt(twin.x, twin.y, x, item.kind === 'line');
          return item.y[at] === null || before === null || before === undefined ? null : item.y[at] - before;
        });
        return [{ ...item, y }];
      });
    return { ...panel, y: { ...panel.y, scale: 'linear', text: `Δ ${panel.y.text}` }, items: lines };
  });
  return { ...figure, panels: panels.filter(panel => panel.items.length > 0) };
}

/** The smallest part of an axis that is shown, a share of the whole: its numbers can still be told apart. */
const LEAST_PART = 1e-4;
const bent = kind =>
  kind === 'logarithmic' ? { bend: Math.log10, straight: value => 10 ** value } : { bend: value => value, straight: value => value };

/** A part of an axis as it can be shown: with its ends inside the whole, and not too small; `null` for the whole. */
function partOf(ends, full, kind) {
  const { bend, straight } = bent(kind);
  const [start, end] = full.map(bend);
  const [a, b] = ends.map(bend);
  const span = Math.max(b - a, LEAST_PART * (end - start));
  if (!(span < (1 - 1e-9) * (end - start))) return null;
  const from = Math.min(Math.max((a + b - span) / 2, start), end - span);
  return [straight(from), straight(from + span)];
}

/** The part of an axis that is so many times the one shown, with the value `about` at its place. */
function zoomed(shown, about, factor, full, kind) {
  const { bend, straight } = bent(kind);
  const middle = bend(about);
  return partOf(
    shown.map(end => straight(middle + (bend(end) - middle) * factor)),
    full,
    kind,
  );
}

/** Places along an axis at which a cross may stand where nothing is drawn that has places of its own. */
const CROSS_STEPS = 60;
const evenly = (ends, isLog) =>
  Array.from({ length: CROSS_STEPS + 1 }, (_, index) => {
    const [low, high] = ends;
    const share = index / CROSS_STEPS;
    return isLog ? low * (high / low) ** share : low + (high - low) * share;
  });

/** The picture. `onPut(setting, x, y, how)` puts a setting of it elsewhere, `trial` is where one is tried along a curve,
 *  `{ x, move(x) }`; `onHold(handle)` where its handles can be pulled, giving `{ move(place), drop() }`; `effect` says what
 *  that did, `{ name, texts }`; `onPick(x, y, panel)` reads a place; `marks` are curves to be lit, by panels. */
export function Picture({ figure, pinned, height: screenHeight = 460, onPut, trial, onHold, effect, onPick: onRead, marks, main }) {
  const plane = usePlane(figure, onPut, trial);
  const onPick = plane.onPick ?? onRead;
  const { handle } = plane;
  const [ref, screenWidth] = useWidth();
  const isPrinting = usePrinting();
  const [paper, setPaper] = useState(LEAST_PAPER);
  // After what else changes on paper: all warnings are there then.
  useLayoutEffect(() => {
    if (isPrinting) queueMicrotask(() => setPaper(paperHeight(figure)));
  }, [isPrinting]);
  const [width, height] = isPrinting ? [PAPER_WIDTH, paper] : [screenWidth, screenHeight];
  const [view, setView] = useState(null);
  const [at, setAt] = useState(null);
  // Where the cross is, in a picture that is read in both directions.
  const [over, setOver] = useState(null);
  const [hidden, setHidden] = useState(() => new Set());
  const [drag, setDrag] = useState(null);
  const [spoken, setSpoken] = useState('');
  const [tabled, setTabled] = useState(false);
  useScheme();
  const id = useMemo(() => unique('picture'), []);
  useEffect(() => {
    setView(null);
    setAt(null);
    setOver(null);
  }, [figure.id]);
  const style = useMemo(() => styles(figure), [figure]);
  const toggle = name =>
    setHidden(old => {
      const next = new Set(old);
      if (!next.delete(name)) next.add(name);
      return next;
    });
  const isPolar = figure.frame === 'polar';
  const full = useMemo(() => {
    const span = extent([...abscissae(figure), ...(pinned ? abscissae(pinned) : [])], figure.x.scale);
    const hasWide = figure.panels.some(panel => panel.items.some(item => item.kind === 'bars'));
    const kinds = new Set(figure.panels.flatMap(panel => panel.items.map(item => item.kind)));
    const scatter = kinds.has('points') && !kinds.has('outline') && !kinds.has('heat_map');
    // Bars need half their distance on either side.
    const half = Math.max(0, ...figure.panels.map(panel => barStep(panel))) / 2;
    if (hasWide && span && half > 0 && figure.x.scale !== 'logarithmic') return [span[0] - half, span[1] + half];
    return hasWide || scatter || !span || span[0] === span[1] ? aired(span, figure.x.scale, hasWide ? 0.03 : 0.04) : span;
  }, [figure, pinned]);
  const shown = view || full;
  const map = isPolar ? null : figure.panels.flatMap(panel => panel.items).find(item => item.kind === 'heat_map');
  const samples = useMemo(() => {
    if (map || onPick) return map ? map.x : evenly(full, figure.x.scale === 'logarithmic');
    const longest = figure.panels
      .flatMap(panel => panel.items)
      .filter(item => ['line', 'bars', 'points'].includes(item.kind))
      .sort((a, b) => b.x.length - a.x.length)[0];
    return longest ? [...new Set(longest.x)].sort((a, b) => a - b) : [];
  }, [figure]);

  const zoom = factor => {
    const { bend, straight } = bent(figure.x.scale);
    const [a, b] = shown.map(bend);
    const about = at !== null && at >= shown[0] && at <= shown[1] ? at : straight((a + b) / 2);
    setView(zoomed(shown, about, factor, full, figure.x.scale));
  };
  const step = (count, far) => {
    if (samples.length === 0) return;
    const inside = samples.filter(x => x >= shown[0] && x <= shown[1]);
    if (inside.length === 0) return;
    const now =
      at === null
        ? handle && isPlane
          ? inside.findIndex(x => x >= handle.x)
          : Math.floor(inside.length / 2)
        : inside.findIndex(x => x >= at - 1e-12 * Math.abs(at));
    const stride = far ? Math.max(1, Math.round(inside.length / 10)) : Math.max(1, Math.round(inside.length / 200));
    const next = inside[Math.min(Math.max((now < 0 ? inside.length - 1 : now) + count * stride, 0), inside.length - 1)];
    setAt(next);
    setSpoken(
      readings(figure, next, over)
        .map(({ text, value, unit }) => `${text} ${number(value, 4)} ${unit}`)
        .join('; '),
    );
  };
  // Up and down: the cross of a map, or of a picture in which a point can be tried.
  const rise = (count, far) => {
    const panel = figure.panels[0];
    const span = aired(extent(ordinates(panel, view), panel.y.scale), panel.y.scale);
    const rows = map ? map.y : evenly(span, panel.y.scale === 'logarithmic');
    const from = over ?? handle?.y ?? rows[Math.floor(rows.length / 2)];
    const now = rows.reduce((best, y, index) => (Math.abs(y - from) < Math.abs(rows[best] - from) ? index : best), 0);
    const next = rows[Math.min(Math.max(now + count * (far ? 5 : 1), 0), rows.length - 1)];
    if (at === null) setAt(handle?.x ?? samples[Math.floor(samples.length / 2)]);
    setOver(next);
    setSpoken(
      readings(figure, at, next)
        .map(({ text, value, unit }) => `${text} ${number(value, 4)} ${unit}`)
        .join('; '),
    );
  };
  const isPlane = Boolean(map || (onPick && !isPolar));
  const key = event => {
    const plane = isPlane
      ? {
          ArrowUp: () => rise(1, event.shiftKey),
          ArrowDown: () => rise(-1, event.shiftKey),
          Enter: () => {
            if (onPick && at !== null && over !== null) onPick(at, over, 0);
          },
        }
      : {};
    const act = {
      ...plane,
      ArrowLeft: () => step(-1, event.shiftKey),
      ArrowRight: () => step(1, event.shiftKey),
      Home: () => {
        setAt(shown[0]);
      },
      End: () => {
        setAt(shown[1]);
      },
      '+': () => zoom(0.5),
      '=': () => zoom(0.5),
      '-': () => zoom(2),
      0: () => setView(null),
      Escape: () => {
        setAt(null);
        setOver(null);
        setView(null);
      },
    }[event.key];
    if (!act || event.ctrlKey || event.metaKey || event.altKey || event.target !== event.currentTarget) return;
    event.preventDefault();
    act();
  };
  const least = isLowScreen() || isNarrow() || isPrinting ? LOW.polar : LEAST_POLAR;
  const common = { figure, pinned, width, style, hidden, toggle, at, over: isPlane ? over : null, shown, view, height, isPrinting, effect };
  const tools = html`
    <div class="tools" role="group" aria-label=${t('picture_tools')}>
      ${
        !isPolar &&
        html`<button type="button" class="icon" aria-label=${t('zoom_in')} title=${t('zoom_in')} onClick=${() => zoom(0.5)}>+</button>
      <button type="button" class="icon" aria-label=${t('zoom_out')} title=${t('zoom_out')} disabled=${!view} onClick=${() => zoom(2)}>−</button>
      <button type="button" class="icon" aria-label=${t('zoom_reset')} title=${t('zoom_reset')} disabled=${!view} onClick=${() => setView(null)}>⤢</button>`
      }
      <button type="button" class="icon" aria-label=${t('as_table')} title=${t('as_table')} aria-pressed=${tabled} onClick=${() => setTabled(!tabled)}>▤</button>
    </div>`;
  return html`
    <figure class=${`picture ${main ? 'main' : ''}`} aria-labelledby=${`${id}-title`}>
      <figcaption><h2 id=${`${id}-title`}>${figure.title.text}</h2>${tools}</figcaption>
      <div ref=${ref} class="plot" tabindex="0" role="application" aria-label=${`${figure.title.text}. ${t('picture_keys')}${onPick ? ` ${t('pick_keys')}` : ''}`} onKeyDown=${key}>
        ${
          width > 0 &&
          (isPolar
            ? html`<${Polar} ...${common} ...${{ least, setAt, onPut }} />`
            : html`<${Stacked} ...${common} ...${{ full, setAt, setOver, setView, drag, setDrag, onPick, handle, onHold, marks }} />`)
        }
      </div>
      <p class="hidden" role="status">${spoken}</p>
      ${tabled && html`<${Numbers} figure=${figure} samples=${samples} />`}
    </figure>`;
}

/** The names and values of all curves at one abscissa, of maps at one place. */
function readings(figure, x, y = null) {
  const list = [{ text: figure.x.text, value: x, unit: unitSymbol(figure.x.unit) }];
  if (y !== null) list.push({ text: figure.panels[0].y.text, value: y, unit: unitSymbol(figure.panels[0].y.unit) });
  for (const panel of figure.panels) {
    for (const item of panel.items) {
      if (item.kind === 'heat_map' && y !== null) {
        const value = cellAt(item, x, y);
        if (value !== null) list.push({ text: item.value.text, value, unit: unitSymbol(item.value.unit) });
      }
      const stretch = item.kind === 'ribbon' && stretchAt(item, x);
      if (stretch) list.push({ text: `${stretch.place}: ${item.text}`, value: stretch.weight, unit: unitSymbol(panel.y.unit) });
      if (!['line', 'bars', 'points'].includes(item.kind) || (y !== null && item.kind === 'points')) continue;
      const value = valueAt(item.x, item.y, x, item.kind === 'line');
      if (value !== null && value !== undefined) list.push({ text: item.text, value, unit: unitSymbol(panel.y.unit) });
    }
  }
  return list;
}

/** What the picture shows, as numbers. */
function Numbers({ figure, samples }) {
  const stride = Math.max(1, Math.ceil(samples.length / TABLE_ROWS));
  const xs = samples.filter((_, index) => index % stride === 0);
  const columns = figure.panels.flatMap(panel =>
    panel.items.filter(item => ['line', 'bars', 'points', 'ribbon'].includes(item.kind)).map(item => ({ item, unit: panel.y.unit })),
  );
  if (columns.length === 0) return html`<p class="quiet">${t('see_tables')}</p>`;
  return html`
    <div class="grid-scroll numbers" tabindex="0" role="region" aria-label=${figure.title.text}><table class="grid still">
      <thead><tr><th scope="col">${figure.x.text} <span class="unit">${unitSymbol(figure.x.unit)}</span></th>${columns.map(({ item, unit }) => html`<th scope="col">${item.text} <span class="unit">${unitSymbol(unit)}</span></th>`)}</tr></thead>
      <tbody>${xs.map(
        x =>
          html`<tr key=${x}><th scope="row">${number(x, 6)}</th>${columns.map(({ item }) => {
            const value = item.kind === 'ribbon' ? stretchAt(item, x)?.weight : valueAt(item.x, item.y, x, item.kind === 'line');
            return html`<td>${value === null || value === undefined ? '' : number(value, 5)}</td>`;
          })}</tr>`,
      )}</tbody>
    </table></div>`;
}

/** Panels under each other over one abscissa. */
function Stacked({
  figure,
  pinned,
  width,
  isPrinting,
  style,
  hidden,
  toggle,
  at,
  setAt,
  over,
  setOver,
  full,
  shown,
  view,
  setView,
  height,
  drag,
  setDrag,
  onPick,
  handle,
  onHold,
  effect,
  marks,
}) {
  const shares = figure.panels.reduce((sum, panel) => sum + panel.height, 0) || 1;
  const ghosts = figure.panels.map((_, index) => pinned?.panels[index] || null);
  const visible = figure.panels.map(panel => ({ ...panel, items: panel.items.filter(item => !item.name || !hidden.has(item.name)) }));
  const isMany = visible.length >= MANY_PANELS;
  const least = isPrinting
    ? { panel: LEAST_ON_PAPER, ofMany: LEAST_ON_PAPER, ribbon: LEAST_RIBBON }
    : isLowScreen()
      ? LOW
      : { panel: LEAST_PANEL, ofMany: LEAST_OF_MANY, ribbon: LEAST_RIBBON };
  // While a handle is pulled the axes stay as they are.
  const frozen = useRef(null);
  const panels = visible.map((panel, index) => {
    const isRibbon = hasRibbons(panel);
    const tall = Math.max(isRibbon ? least.ribbon : isMany ? least.ofMany : least.panel, Math.round((height * panel.height) / shares));
    const span = extent([...ordinates(panel, view), ...(ghosts[index] ? ordinates(ghosts[index], view) : [])], panel.y.scale);
    const isMap = panel.items.some(item => item.kind === 'heat_map');
    const domain = frozen.current?.index === index ? frozen.current.domain : isMap ? span : aired(span, panel.y.scale);
    const places = isRibbon ? [] : ticks(panel.y.scale, domain, Math.max(tall < 36 ? 2 : 3, Math.round(tall / 42)));
    return { panel, ghost: ghosts[index], tall, domain, places, ...labels(panel.y.scale, places), span: span ? span[1] - span[0] : 0 };
  });
  const left = Math.max(34, ...panels.map(({ texts }) => 12 + 6.6 * Math.max(0, ...texts.map(text => text.length))));
  const right = width - 10;
  const glyphs = figure.panels.flatMap(panel => panel.items.filter(item => item.kind === 'glyph'));
  const atEnds = glyphs.some(({ glyph }) => END_GLYPHS.includes(glyph));
  const edge = atEnds && !view ? Math.min(GLYPH_ROOM, (right - left) / 8) : 0;
  const x = scale(figure.x.scale, frozen.current?.shown ?? shown, [left + edge, right - edge]);
  const xPlaces = ticks(figure.x.scale, shown, Math.max(2, Math.round((right - left) / 90)));
  const xLabels = labels(figure.x.scale, xPlaces);

  const where = event => {
    const box = event.currentTarget.getBoundingClientRect();
    const place = Math.min(Math.max(event.clientX - box.left, left + edge), right - edge);
    return { place, value: x.back(place) };
  };
  /** The ordinate under the pointer, in the panel that it is over. */
  const under = event => {
    const svgs = [...event.currentTarget.querySelectorAll('svg[data-panel]')];
    return svgs.findLast(one => event.clientY >= one.getBoundingClientRect().top) || svgs[0];
  };
  const spot = event => {
    const svg = under(event);
    const { domain, panel, tall } = panels[Number(svg.dataset.panel)];
    const v = Math.min(Math.max(event.clientY - svg.getBoundingClientRect().top, 6), 6 + tall);
    return scale(panel.y.scale, domain, [6 + tall, 6]).back(v);
  };
  /** The point that can be dragged: its place in the first panel. */
  const grip =
    handle &&
    (() => {
      const { panel, domain, tall } = panels[0];
      const line = panel.items.find(item => item.kind === 'line');
      const value = handle.y ?? (line ? valueAt(line.x, line.y, handle.x) : null);
      const v = value === null || value === undefined ? NaN : scale(panel.y.scale, domain, [6 + tall, 6])(value);
      const h = x(handle.x);
      return h >= left && h <= right && v >= 0 && v <= 12 + tall ? [h, v] : null;
    })();
  const nearGrip = event => {
    if (!grip) return false;
    const svg = event.currentTarget.querySelector('svg[data-panel="0"]').getBoundingClientRect();
    return Math.hypot(event.clientX - svg.left - grip[0], event.clientY - svg.top - grip[1]) <= (event.pointerType === 'touch' ? 26 : 14);
  };
  // Held beside the state: a press and its release may come faster than a drawing.
  const held = useRef(null);
  const hold = next => {
    held.current = next;
    setDrag(next);
  };
  const move = event => {
    const { place, value } = where(event);
    setAt(value);
    if (held.current?.grip) {
      held.current.moved = true;
      handle?.onMove(value, spot(event));
      return;
    }
    setOver(spot(event));
    if (held.current) hold({ ...held.current, to: place });
  };
  const down = event => {
    if (event.button !== 0 || event.target.closest('button')) return;
    const { place } = where(event);
    event.currentTarget.setPointerCapture(event.pointerId);
    if (nearGrip(event)) {
      held.current = { grip: true, moved: false };
      return;
    }
    hold({ from: place, to: place });
  };
  const up = event => {
    if (!held.current) return;
    if (held.current.grip) {
      const { moved } = held.current;
      held.current = null;
      if (moved) handle?.onDrop(where(event).value, spot(event));
      return;
    }
    const ends = [held.current.from, held.current.to].sort((a, b) => a - b);
    hold(null);
    if (ends[1] - ends[0] > 8) {
      setView(partOf(ends.map(x.back), full, figure.x.scale));
      return;
    }
    if (!onPick) return;
    onPick(where(event).value, spot(event), Number(under(event).dataset.panel));
  };
  const wheel = event => {
    if (!event.ctrlKey && !event.metaKey) return;
    event.preventDefault();
    if (event.deltaY !== 0) setView(zoomed(shown, where(event).value, event.deltaY > 0 ? 1.25 : 0.8, full, figure.x.scale));
  };
  return html`
    <div class=${`stack ${onPick ? 'pickable' : ''}`} onPointerMove=${move} onPointerDown=${down} onPointerUp=${up} onPointerCancel=${() => hold(null)} onPointerLeave=${() => {
      if (!held.current) {
        setAt(null);
        setOver(null);
      }
    }} onDblClick=${() => setView(null)} onWheel=${wheel}>
      ${panels.map(({ panel, ghost, tall, domain, places, texts, factor, span }, index) => {
        const last = index === panels.length - 1;
        const own = panel.items.filter(item => item.kind === 'glyph');
        const above = own.some(item => !END_GLYPHS.includes(item.glyph) && item.y >= 0) ? GLYPH_ROOM : own.length ? 14 : 0;
        const under = own.some(item => !END_GLYPHS.includes(item.glyph) && item.y < 0) ? GLYPH_ROOM : own.length ? 14 : 0;
        const y = scale(panel.y.scale, domain, [6 + tall - Math.min(under, tall / 4), 6 + Math.min(above, tall / 4)]);
        const frame = { left, top: 6, width: right - left, height: tall, hasGhost: Boolean(ghost) };
        const clip = `clip-${figure.id}-${index}`;
        const stance = item => {
          const outline = panel.items.find(other => other.kind === 'outline' && other.role === 'part');
          const radius = outline
            ? Math.max(...outline.y.filter((_, place) => Math.abs(outline.x[place] - item.x) <= (shown[1] - shown[0]) / 50 + 1e-9), 0)
            : 0;
          return {
            mirrored: item.glyph === 'chuck' ? item.x > (shown[0] + shown[1]) / 2 : item.y < 0,
            reach: Math.abs(y(0) - y(radius || domain[1] * 0.5)),
          };
        };
        const plane = { x, y, frame, stance, id: `${clip}-weave`, place: (h, v) => [x(h), y(v)] };
        const cursor = at !== null && at >= shown[0] && at <= shown[1] ? x(at) : null;
        const svgHeight = 6 + tall + (last ? AXIS_ROOM : 8);
        return html`
          <${Head} key=${`head-${index}`} ...${{ panel: figure.panels[index], ghost, style, hidden, toggle, at, over, factor, span }} />
          <div key=${`panel-${index}`} class="panel"><svg data-panel=${index} class="chart" width=${width} height=${svgHeight} viewBox=${`0 0 ${width} ${svgHeight}`} role="img" aria-label=${describe(panel, figure)}>
            <defs><clipPath id=${clip}><rect x=${left} y="6" width=${Math.max(1, right - left)} height=${tall} /></clipPath>${hasRibbons(panel) && weaves(`${clip}-weave`)}</defs>
            <g class="grid">${places.map(place => html`<path d=${`M${left} ${y(place).toFixed(1)}H${right}`} />`)}${xPlaces.map(place => html`<path d=${`M${x(place).toFixed(1)} 6V${6 + tall}`} />`)}</g>
            ${places.length > 0 && domain[0] < 0 && domain[1] > 0 && panel.y.scale === 'linear' && html`<path class="zero" d=${`M${left} ${y(0).toFixed(1)}H${right}`} />`}
            <g clip-path=${`url(#${clip})`}>
              ${ghost && items(ghost, plane, { style, hidden, ghost: true })}
              ${items(panel, plane, { style, hidden })}
              ${marks?.[index]?.map((mark, place) => html`<path key=${place} class="marked" d=${linePath(mark.x, mark.y, plane.place, frame.width)} />`)}
            </g>
            <rect class="frame" x=${left} y="6" width=${Math.max(1, right - left)} height=${tall} />
            <g class="tick-labels" text-anchor="end">${places.map((place, tick) => html`<text x=${left - 6} y=${y(place) + 4}>${texts[tick]}</text>`)}</g>
            ${
              last &&
              html`<g class="tick-labels" text-anchor="middle">${xPlaces.map((place, tick) => html`<text x=${Math.min(Math.max(x(place), 12), width - 3 - 3.4 * xLabels.texts[tick].length)} y=${tall + 22}>${xLabels.texts[tick]}</text>`)}</g>
              <text class="x-name" x=${(left + right) / 2} y=${tall + 39} text-anchor="middle">${axisName(figure.x, xLabels.factor)}${at !== null ? ` = ${readDigits(at, shown[1] - shown[0])}` : ''}</text>`
            }
            ${drag && Math.abs(drag.to - drag.from) > 4 && html`<rect class="selection" x=${Math.min(drag.from, drag.to)} y="6" width=${Math.abs(drag.to - drag.from)} height=${tall} />`}
            ${over !== null && over >= domain[0] && over <= domain[1] && html`<path class="cursor" d=${`M${left} ${y(over).toFixed(1)}H${right}`} />`}
            ${index === 0 && grip && html`<circle class="reach" cx=${grip[0]} cy=${grip[1]} r="22" /><circle class="handle" cx=${grip[0]} cy=${grip[1]} r="7.5" />`}
            ${
              cursor !== null &&
              html`<path class="cursor" d=${`M${cursor.toFixed(1)} 6V${6 + tall}`} />
              ${panel.items
                .filter(item => item.kind === 'line' && !hidden.has(item.name))
                .map(item => {
                  const v = valueAt(item.x, item.y, at);
                  const h = v === null || v === undefined ? NaN : y(v);
                  return h >= 5 && h <= 7 + tall ? html`<circle class=${`dot ${style(item)}`} cx=${cursor} cy=${h} r="3.4" />` : null;
                })}`
            }
          </svg>
          ${
            onHold &&
            !isPrinting &&
            html`<${Handles} ...${{ panel, axis: figure.x, x, y, frame, effect }} hold=${item => {
              const { move: pull, drop } = onHold(item);
              frozen.current = { index, domain, shown };
              return {
                move: pull,
                drop: () => {
                  frozen.current = null;
                  drop();
                },
              };
            }} />`
          }</div>`;
      })}
    </div>`;
}
