// Places of a picture that can be taken hold of, with the mouse, a finger or the keys: numbers of the job follow. Which places
// these are, along which axis they go and what follows them, the figure says; what it does to the answer stands above the
// hand.
import { html, useRef, useState, useEffect } from './lib.js';
import { t, capital, number, unitSymbol } from './text.js';
import { at, changed, parts } from './schema.js';
import { settingsOf } from './elsewhere.js';

/** A handle this near to one of its stops is there, px. */
const STOP_PX = 7;
const FAR = 10;
/** Digits that a number which follows a handle keeps. */
const DIGITS = 10;

/** The largest round number that is no more than so many units are to a pixel. */
export const stepOf = perPixel => 10 ** Math.floor(Math.log10(perPixel) + 1e-9);

/** Where a handle is that is pulled to a place: on a round number or at one of its stops, within its reach. */
export function settled(handle, place, step, near = 0) {
  const [least, most] = handle.reach;
  const stop = handle.stops.reduce((best, one) => (Math.abs(one - place) <= Math.abs((best ?? Infinity) - place) ? one : best), null);
  const to = stop !== null && Math.abs(stop - place) <= near ? stop : Number((Math.round(place / step) * step).toPrecision(DIGITS));
  return Math.min(Math.max(to, least), most);
}

/** The job with the numbers that follow a handle, once it is so far from where it was; `filled` has those that the job leaves
 *  to the service. */
export const movedJob = (job, filled, handle, by) =>
  handle.moves.reduce((whole, { pointer, per_unit: perUnit }) => {
    const path = parts(pointer);
    const before = at(job, path) ?? at(filled, path);
    return typeof before === 'number' ? changed(whole, path, Number((before + perUnit * by).toPrecision(DIGITS))) : whole;
  }, job);

const placeOf = handle => handle[handle.along];

/** A handle stands within its panel; one that makes way reaches out of it so far at most. */
const INSIDE_PX = 9;
const OUTSIDE_PX = 6;
const withinFrame = (v, { top, height }) => Math.min(Math.max(v, top + INSIDE_PX), top + height - INSIDE_PX);

/** Handles nearer to each other than this, px, both across and up, cover too much of each other to be hit: what comes later in
 *  the figure stays. */
const APART_PX = 26;

/** Those of a panel that have room, each at its place `h`, `v`; the others come when the picture is larger, or a part of it. How
 *  high one stands that goes along x says nothing: it makes way upwards or downwards. */
export function roomy(handles, x, y, frame) {
  const kept = [];
  for (const one of handles.toReversed()) {
    const h = x(one.handle.x);
    const own = withinFrame(y(one.handle.y), frame);
    const near = kept.filter(other => Math.abs(other.h - h) < APART_PX);
    const beside = one.handle.along === 'x' ? near.flatMap(other => [other.v - APART_PX, other.v + APART_PX]) : [];
    const [least, most] = [frame.top - OUTSIDE_PX, frame.top + frame.height + OUTSIDE_PX];
    const v = [own, ...beside.sort((a, b) => Math.abs(a - own) - Math.abs(b - own))].find(
      place => least <= place && place <= most && near.every(other => Math.abs(other.v - place) >= APART_PX),
    );
    if (v !== undefined) kept.push({ ...one, h, v });
  }
  return kept.reverse();
}

/** The handles of a panel. `x` and `y` are its scales; `hold(handle)` begins, and gives `move(place)` and `drop()`; `effect`
 *  says what that did to the answer. */
export function Handles({ panel, axis, x, y, hold, frame, effect }) {
  // What is being pulled stays, wherever it comes.
  const pulled = useRef(null);
  const all = panel.items.map((handle, index) => ({ handle, index })).filter(({ handle }) => handle.kind === 'handle');
  const shown = pulled.current
    ? all.flatMap(one => (pulled.current.has(one.index) ? [{ ...one, v: pulled.current.get(one.index) }] : []))
    : roomy(all, x, y, frame);
  const take = handle => {
    // Up and down with the picture, but for what made way.
    pulled.current = new Map(shown.map(one => [one.index, one.handle.along === 'x' ? one.v : undefined]));
    const { move, drop } = hold(handle);
    return {
      move,
      drop: () => {
        pulled.current = null;
        drop();
      },
    };
  };
  return html`
    <div class="handles">${shown.map(({ handle, index, v }) => html`<${Grip} key=${index} ...${{ handle, x, y, v, frame, effect }} hold=${take} axis=${handle.along === 'x' ? axis : panel.y} />`)}</div>`;
}

function Grip({ handle, x, y, v, axis, hold, frame, effect }) {
  // Pulled: the scale and the place of then, as both change with the picture that follows.
  const pulled = useRef(null);
  const own = handle.along === 'x' ? x : y;
  const [left, top] = [x(handle.x), v ?? withinFrame(y(handle.y), frame)];
  if (!(left >= frame.left - 1 && left <= frame.left + frame.width + 1)) return null;
  const pixel = event => (handle.along === 'x' ? event.clientX : event.clientY);
  const perPixel = Math.abs(own.back(1) - own.back(0));
  const step = stepOf(perPixel);
  const down = event => {
    if (event.button !== 0) return;
    event.stopPropagation();
    event.preventDefault();
    event.currentTarget.focus();
    event.currentTarget.setPointerCapture(event.pointerId);
    pulled.current = { ...hold(handle), from: pixel(event), scale: own, step, handle };
  };
  const move = event => {
    event.stopPropagation();
    const held = pulled.current;
    if (!held) return;
    const begun = held.scale(placeOf(held.handle));
    const to = settled(
      held.handle,
      held.scale.back(begun + pixel(event) - held.from),
      held.step,
      STOP_PX * Math.abs(held.scale.back(1) - held.scale.back(0)),
    );
    held.move(to);
  };
  const up = event => {
    event.stopPropagation();
    pulled.current?.drop();
    pulled.current = null;
  };
  const key = event => {
    const way = { ArrowRight: 1, ArrowUp: 1, ArrowLeft: -1, ArrowDown: -1 }[event.key];
    const to =
      event.key === 'Home'
        ? handle.reach[0]
        : event.key === 'End'
          ? handle.reach[1]
          : way
            ? placeOf(handle) + way * step * (event.shiftKey ? FAR : 1)
            : null;
    if (to === null || event.ctrlKey || event.metaKey || event.altKey) return;
    event.preventDefault();
    event.stopPropagation();
    const { move: go, drop } = hold(handle);
    go(settled(handle, to, step));
    drop();
  };
  const said = `${number(placeOf(handle), 6)} ${unitSymbol(axis.unit)}`;
  // The name stands within the picture.
  const side = left > frame.left + 0.7 * frame.width ? 'late' : left < frame.left + 0.2 * frame.width ? 'early' : '';
  return html`<span class=${`grip ${handle.along} ${side}`} role="slider" tabindex="0" style=${{ left: `${left}px`, top: `${top}px` }} data-name=${handle.name} aria-label=${`${capital(handle.text)}. ${t('grip_keys')}`}
    aria-orientation=${handle.along === 'x' ? 'horizontal' : 'vertical'} aria-valuenow=${placeOf(handle)} aria-valuemin=${handle.reach[0]} aria-valuemax=${handle.reach[1]} aria-valuetext=${effectOf(effect, handle) ? `${said}; ${effectOf(effect, handle)}` : said}
    onPointerDown=${down} onPointerMove=${move} onPointerUp=${up} onPointerCancel=${up} onKeyDown=${key} onDblClick=${event => event.stopPropagation()}><${Name} ...${{ handle, said, effect }} /></span>`;
}

/** What pulling this handle did to the answer. */
const effectOf = (effect, handle) => (effect?.name === handle.name && effect.texts.length > 0 ? effect.texts.join('; ') : '');

/** What stands above a handle: its name, its place, what it does. */
const Name = ({ handle, said, effect }) =>
  html`<b aria-hidden="true">${capital(handle.text)} ${said}${effectOf(effect, handle) && html`<small>${effectOf(effect, handle)}</small>`}</b>`;

/** What of a picture in the plane can be put elsewhere: `onPick(x, y)` of a click or of Enter at the cross, and the point that
 *  can be dragged, `{ x, y, onMove(x, y), onDrop(x, y) }`, without `y` along the first curve. */
export function usePlane(figure, onPut, trial) {
  // Where the point is while it is dragged.
  const [grabbed, setGrabbed] = useState(null);
  useEffect(() => {
    setGrabbed(null);
  }, [figure]);
  const settings = onPut && figure.frame !== 'polar' ? settingsOf(figure) : [];
  if (trial) return { onPick: null, handle: { x: trial.x, onMove: trial.move, onDrop: () => {} } };
  const point = settings.find(setting => !setting.tried_in);
  if (!point) return { onPick: null, handle: null };
  const put = (x, y, how) => onPut(point, x, y, how);
  return {
    onPick: (x, y) => put(x, y, 'run'),
    handle: {
      x: grabbed ? grabbed[0] : point.x,
      y: grabbed ? grabbed[1] : point.y,
      onMove: (x, y) => {
        setGrabbed([x, y]);
        put(x, y, 'typing');
      },
      onDrop: (x, y) => {
        setGrabbed(null);
        put(x, y, 'run');
      },
    },
  };
}

/** Degrees by which the keys turn a place round a polar picture. */
const TURN = 1;

/** Settings of a polar picture: places round it. `place(angle, value)` is that of the picture, `put(setting, angle, how)` goes
 *  there. */
export function RoundHandles({ settings, centre, place, put, effect }) {
  const pulled = useRef(null);
  return html`
    <div class="handles">${settings.map(setting => {
      const [left, top] = place(setting.x, setting.y);
      const angleOf = event => {
        const box = event.currentTarget.closest('.handles').getBoundingClientRect();
        return ((Math.atan2(centre[1] - (event.clientY - box.top), event.clientX - box.left - centre[0]) * 180) / Math.PI + 360) % 360;
      };
      const down = event => {
        if (event.button !== 0) return;
        event.preventDefault();
        event.currentTarget.focus();
        event.currentTarget.setPointerCapture(event.pointerId);
        pulled.current = setting.name;
      };
      const move = event => {
        if (pulled.current === setting.name) put(setting, angleOf(event), 'typing');
      };
      const up = event => {
        if (pulled.current !== setting.name) return;
        pulled.current = null;
        put(setting, angleOf(event), 'run');
      };
      const key = event => {
        const way = { ArrowRight: -1, ArrowDown: -1, ArrowLeft: 1, ArrowUp: 1 }[event.key];
        if (!way || event.ctrlKey || event.metaKey || event.altKey) return;
        event.preventDefault();
        event.stopPropagation();
        put(setting, (setting.x + way * TURN * (event.shiftKey ? FAR : 1) + 360) % 360, 'run');
      };
      const said = `${number(setting.x, 4)}°`;
      return html`<span key=${setting.name} class="grip round" role="slider" tabindex="0" style=${{ left: `${left}px`, top: `${top}px` }} data-name=${setting.name} aria-label=${`${capital(setting.text)}. ${t('grip_keys')}`}
        aria-valuenow=${Math.round(10 * setting.x) / 10} aria-valuemin="0" aria-valuemax="360" aria-valuetext=${effectOf(effect, setting) ? `${said}; ${effectOf(effect, setting)}` : said}
        onPointerDown=${down} onPointerMove=${move} onPointerUp=${up} onPointerCancel=${up} onKeyDown=${key}><${Name} handle=${setting} said=${said} effect=${effect} /></span>`;
    })}</div>`;
}
