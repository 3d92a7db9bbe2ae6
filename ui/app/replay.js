// A run state by state: all states on the way come with one answer, that of the same job asked for them. Which figure shows
// them, what to ask for and where it then stands, the schema of the result says (`x-replay` at a field of the history).
import { html, useState, useEffect, useMemo } from './lib.js';
import { t, number, unitOf } from './text.js';
import { at, changed, labelOf, parts, resolve } from './schema.js';
import { below } from './scale.js';
import { useProbe } from './probe.js';

/** Between two frames of a replay, ms. */
const FRAME_MS = 160;
/** A replay shows so many of the states. */
const PLAYED = 60;
/** A blank larger than so many times the surface would hide it. */
const SHOWN_TOGETHER = 4;
const CURVE_WIDTH = 1000;
const CURVE_HEIGHT = 40;

/** Revolutions as they are told: what is counted in nodes ends a little before the whole one. */
const told = turns => number(Math.round(turns * 100) / 100, 8);

/** The object of a result of whose fields one carries `x-replay`: `{ said, history, schema }`. */
function historyIn(root, schema, value) {
  const whole = resolve(schema, root);
  if (!value || typeof value !== 'object' || Array.isArray(value) || !whole.properties) return null;
  const fields = Object.entries(whole.properties).map(([name, part]) => [name, resolve(part, root)]);
  // What a list carries, the schema has at its items.
  const said = fields.map(([, part]) => part['x-replay'] ?? part.items?.['x-replay']).find(Boolean);
  if (said) return { said, history: value, schema: whole };
  return fields.map(([name, part]) => historyIn(root, part, value[name])).find(Boolean) ?? null;
}

/** The history that a figure can be taken through, `null` where there is none. */
export function replayOf({ output_schema: root }, figure, result) {
  const found = historyIn(root, root, result);
  if (!found || found.said.figure !== figure.id || !(found.history[found.said.at]?.length > 1)) return null;
  const field = name => resolve(found.schema.properties[name], root);
  const named = name => ({ name, label: labelOf(name, field(name)), unit: unitOf(field(name)) });
  return { ...found, value: named(found.said.value), beside: named(found.said.beside) };
}

/** The job with its states on the way and nothing else that takes time or room. */
export function withFrames(job, result, { asks, keeps, drops }) {
  const bare = drops.reduce(
    (whole, place) => (at(whole, parts(place)) === undefined ? whole : changed(whole, parts(place), undefined)),
    job,
  );
  const kept = Object.entries(keeps).reduce((whole, [place, from]) => changed(whole, parts(place), at(result, parts(from))), bare);
  return Object.entries(asks).reduce((whole, [place, value]) => changed(whole, parts(place), value), kept);
}

/** The revolutions at which there is a state: of the start, of one in so many, of the end. */
function stepsOf(revolution, most) {
  const total = revolution.at(-1);
  const every = Math.max(1, Math.ceil(total / most - 1e-3));
  const steps = [0];
  for (let turns = every; turns < total - 0.01; turns += every) steps.push(turns);
  return [...steps, total];
}

/** The first state: the blank, which the answer holds already. */
const blankOf = (figures, { blank }) => figures.find(({ id }) => id === blank)?.panels[0]?.items[0];
const spanOf = values => Math.max(...values) - Math.min(...values);

/** The chart of one state: the curves of the end with its own, symbols where they stood. */
function chartOf(shown, blank, replay, frame, said) {
  const [angles, values] = [replay[said.angles], frame[said.values]];
  const turned = frame[said.turned] - replay.frames.at(-1)[said.turned];
  const after = shown.panels[0].items.find(({ name }) => name === said.curve);
  const items = shown.panels[0].items.flatMap(item => {
    if (item.kind !== 'glyph') return [];
    const x = (item.x + turned + 720) % 360;
    return [{ ...item, x, y: values[Math.max(0, below(angles, x))] }];
  });
  const isShown = blank && spanOf(blank.y.filter(value => value !== null)) < SHOWN_TOGETHER * spanOf(values);
  const closed = { ...after, x: [...angles, angles[0] + 360], y: [...values, values[0]] };
  return { ...shown, panels: [{ ...shown.panels[0], items: [...(isShown ? [blank] : []), closed, ...items] }] };
}

const titled = (figure, turns, of) =>
  figure && { ...figure, title: { ...figure.title, text: t('ring_at', { revolution: told(turns), of: told(of) }) } };

/** A scrubber over the history; `onShow(figure)` with the state that is to be seen, `null` for the end. */
export function Replay({ id, said: { said, history, value, beside }, answer, job, figure, figures, onShow }) {
  const turns = history[said.at];
  const steps = useMemo(() => stepsOf(turns, said.most), [history]);
  const last = steps.length - 1;
  const [step, setStep] = useState(last);
  const [isPlaying, setPlaying] = useState(false);
  // Asked for at the first move, then there for all of them.
  const [isWanted, setWanted] = useState(false);
  const found = useProbe(id, isWanted ? answer.key : null, () => withFrames(job, answer.result, said));
  const replay = found?.answer && at(found.answer.result, parts(said.frames));
  useEffect(() => {
    if (step === last) {
      onShow(null);
      return;
    }
    setWanted(true);
    const blank = blankOf(figures, said);
    if (step === 0) onShow(blank && titled({ ...figure, panels: [{ ...figure.panels[0], items: [blank] }] }, 0, steps[last]));
    else if (replay) {
      const frame = replay.frames[Math.min(step - 1, replay.frames.length - 1)];
      onShow(titled(chartOf(figure, blank, replay, frame, said), frame[said.at], steps[last]));
    }
  }, [step, replay, figure]);
  useEffect(() => {
    if (!isPlaying) return undefined;
    const stride = Math.max(1, Math.ceil(last / PLAYED));
    const timer = setInterval(() => setStep(now => Math.min(now + stride, last)), FRAME_MS);
    return () => clearInterval(timer);
  }, [isPlaying]);
  useEffect(() => {
    if (step === last) setPlaying(false);
  }, [step]);

  const here = step === 0 ? -1 : Math.max(0, below(turns, steps[step] + 0.01));
  const [now, other] = [value, beside].map(({ name }, index) =>
    here >= 0 ? history[name][here] : at(answer.result, parts([said.from.value, said.from.beside][index])),
  );
  const curve = useMemo(() => curveOf(turns, history[value.name], steps[last], at(answer.result, parts(said.from.value))), [answer.key]);
  const says = t('revolution_is', {
    revolution: told(steps[step]),
    of: told(steps[last]),
    name: value.label,
    value: `${number(now, 4)} ${value.unit}`,
  });
  const isLate = step > 0 && step < last && !replay && !found?.problem;
  return html`
    <div class="scrubber" role="group" aria-label=${t('replay')}>
      <button type="button" class="icon" aria-label=${isPlaying ? t('replay_stop') : t('replay_play')} title=${isPlaying ? t('replay_stop') : t('replay_play')} aria-pressed=${isPlaying}
        onClick=${() => {
          if (!isPlaying && step === last) setStep(0);
          setPlaying(!isPlaying);
        }}>${isPlaying ? '❚❚' : '▶'}</button>
      <div class="track">
        <svg viewBox=${`0 0 ${CURVE_WIDTH} ${CURVE_HEIGHT}`} preserveAspectRatio="none" aria-hidden="true"><path class="after" d=${curve} vector-effect="non-scaling-stroke" /><path class="cursor" d=${`M${(CURVE_WIDTH * step) / last} 0V${CURVE_HEIGHT}`} vector-effect="non-scaling-stroke" /></svg>
        <input type="range" id="replay" min="0" max=${last} step="1" value=${step} aria-label=${t('replay')} aria-valuetext=${says} onInput=${event => {
          setPlaying(false);
          setStep(Number(event.currentTarget.value));
        }} />
      </div>
      <p class="scrub-text">${says}<span class="quiet"> · ${beside.label} ${number(other, 7)} ${beside.unit}</span>${isLate && html`<span class="late"> · ${t('loading')}</span>`}</p>
      ${found?.problem && html`<p class="fault"><span>${found.problem.detail || found.problem.title}</span></p>`}
    </div>`;
}

/** What is followed over the revolutions, by its logarithm. */
function curveOf(revolution, values, total, start) {
  const points = [[0, start], ...revolution.map((turns, index) => [turns, values[index]])].map(([turns, value]) => [
    turns,
    Math.log10(Math.max(value, 1e-6)),
  ]);
  const [low, high] = [Math.min(...points.map(point => point[1])), Math.max(...points.map(point => point[1]))];
  return points
    .map(
      ([turns, value], index) =>
        `${index ? 'L' : 'M'}${((CURVE_WIDTH * turns) / total).toFixed(1)} ${(3 + (CURVE_HEIGHT - 6) * (1 - (value - low) / (high - low || 1))).toFixed(1)}`,
    )
    .join('');
}
