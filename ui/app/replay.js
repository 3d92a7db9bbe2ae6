// The ring revolution by revolution: all surfaces on the way come with one answer, that of the same job asked for them.
import { html, useState, useEffect, useMemo } from './lib.js';
import { t, number } from './text.js';
import { below } from './scale.js';
import { useProbe } from './probe.js';

/** Between two frames of a replay, ms. */
const FRAME_MS = 160;
/** Surfaces that are asked for at most; a replay shows half of them. */
const FRAMES = 120;
const PLAYED = 60;
/** Points of profiles that the answer needs beside them: the fewest there are. */
const LEAST_PROFILE = 36;
/** A blank larger than so many times the surface would hide it. */
const SHOWN_TOGETHER = 4;
const CURVE_WIDTH = 1000;
const CURVE_HEIGHT = 40;

/** Revolutions as they are told: what is counted in nodes ends a little before the whole one. */
const told = turns => number(Math.round(turns * 100) / 100, 8);

/** Whether there is a history to go through. */
export const canReplay = (figure, result) => figure?.id === 'polar' && (result?.simulation?.history?.revolution?.length ?? 0) > 1;

/** The job with its surfaces on the way and nothing else that takes time or room. */
export function withFrames(job, { result }) {
  const { settings_search: search, setup_map: map, ...rest } = job;
  return { ...rest, samples: result.simulation.samples, analyses: ['simulation'], profile_points: LEAST_PROFILE, replay_frames: FRAMES };
}

/** The revolutions at which there is a surface: of the blank, of one in so many, of the end. */
function stepsOf({ revolution }) {
  const total = revolution.at(-1);
  const every = Math.max(1, Math.ceil(total / FRAMES - 1e-3));
  const steps = [0];
  for (let turns = every; turns < total - 0.01; turns += every) steps.push(turns);
  return [...steps, total];
}

/** The first state: the blank, which the answer holds already. */
const blankOf = figures => figures.find(({ id }) => id === 'profile')?.panels[0]?.items[0];
const spanOf = values => Math.max(...values) - Math.min(...values);

/** The chart of one surface: the curves of the end with its own, tool and supports where they stood. */
function chartOf(polar, blank, replay, frame) {
  const end = replay.frames.at(-1);
  const turned = frame.tool_angle_deg - end.tool_angle_deg;
  const after = polar.panels[0].items.find(({ name }) => name === 'ring_after');
  const items = polar.panels[0].items.flatMap(item => {
    if (item.kind !== 'glyph') return [];
    const x = (item.x + turned + 720) % 360;
    return [{ ...item, x, y: frame.deviation_um[Math.max(0, below(replay.angle_deg, x))] }];
  });
  const isShown = blank && spanOf(blank.y.filter(value => value !== null)) < SHOWN_TOGETHER * spanOf(frame.deviation_um);
  const curve = { ...after, x: [...replay.angle_deg, replay.angle_deg[0] + 360], y: [...frame.deviation_um, frame.deviation_um[0]] };
  return { ...polar, panels: [{ ...polar.panels[0], items: [...(isShown ? [blank] : []), curve, ...items] }] };
}

const titled = (figure, turns, of) => figure && { ...figure, title: { ...figure.title, text: t('ring_at', { revolution: told(turns), of: told(of) }) } };

/** A scrubber over the history; `onShow(figure)` with the state that is to be seen, `null` for the end. */
export function Replay({ id, answer, job, figures, onShow }) {
  const { history, start } = answer.result.simulation;
  const steps = useMemo(() => stepsOf(history), [history]);
  const last = steps.length - 1;
  const [step, setStep] = useState(last);
  const [isPlaying, setPlaying] = useState(false);
  // Asked for at the first move, then there for all of them.
  const [isWanted, setWanted] = useState(false);
  const polar = figures.find(figure => figure.id === 'polar');
  const found = useProbe(id, isWanted ? answer.key : null, isWanted ? withFrames(job, answer) : null, { bare: true });
  const replay = found?.answer?.result.simulation.replay;
  useEffect(() => {
    if (step === last) { onShow(null); return; }
    setWanted(true);
    const blank = blankOf(figures);
    if (step === 0) onShow(blank && titled({ ...polar, panels: [{ ...polar.panels[0], items: [blank] }] }, 0, steps[last]));
    else if (replay) {
      const frame = replay.frames[Math.min(step - 1, replay.frames.length - 1)];
      onShow(titled(chartOf(polar, blank, replay, frame), frame.revolution, steps[last]));
    }
  }, [step, replay, polar]);
  useEffect(() => {
    if (!isPlaying) return undefined;
    const stride = Math.max(1, Math.ceil(last / PLAYED));
    const timer = setInterval(() => setStep(now => Math.min(now + stride, last)), FRAME_MS);
    return () => clearInterval(timer);
  }, [isPlaying]);
  useEffect(() => { if (step === last) setPlaying(false); }, [step]);

  const at = step === 0 ? -1 : Math.max(0, below(history.revolution, steps[step] + 0.01));
  const roundness = at >= 0 ? history.roundness_um[at] : start.unfiltered.least_squares_um;
  const radius = at >= 0 ? history.mean_radius_mm[at] : start.mean_radius_mm;
  const curve = useMemo(() => curveOf(history, steps[last], start.unfiltered.least_squares_um), [answer.key]);
  const says = t('revolution_is', { revolution: told(steps[step]), of: told(steps[last]), roundness: number(roundness, 4) });
  const isLate = step > 0 && step < last && !replay && !found?.problem;
  return html`
    <div class="scrubber" role="group" aria-label=${t('replay')}>
      <button type="button" class="icon" aria-label=${isPlaying ? t('replay_stop') : t('replay_play')} title=${isPlaying ? t('replay_stop') : t('replay_play')} aria-pressed=${isPlaying}
        onClick=${() => { if (!isPlaying && step === last) setStep(0); setPlaying(!isPlaying); }}>${isPlaying ? '❚❚' : '▶'}</button>
      <div class="track">
        <svg viewBox=${`0 0 ${CURVE_WIDTH} ${CURVE_HEIGHT}`} preserveAspectRatio="none" aria-hidden="true"><path class="after" d=${curve} vector-effect="non-scaling-stroke" /><path class="cursor" d=${`M${(CURVE_WIDTH * step) / last} 0V${CURVE_HEIGHT}`} vector-effect="non-scaling-stroke" /></svg>
        <input type="range" id="replay" min="0" max=${last} step="1" value=${step} aria-label=${t('replay')} aria-valuetext=${says} onInput=${event => { setPlaying(false); setStep(Number(event.currentTarget.value)); }} />
      </div>
      <p class="scrub-text">${says}<span class="quiet"> · ${t('mean_radius')} ${number(radius, 7)} ${t('unit_mm')}</span>${isLate && html`<span class="late"> · ${t('loading')}</span>`}</p>
      ${found?.problem && html`<p class="fault"><span>${found.problem.detail || found.problem.title}</span></p>`}
    </div>`;
}

/** The roundness over the revolutions, by its logarithm. */
function curveOf({ revolution, roundness_um: roundness }, total, start) {
  const points = [[0, start], ...revolution.map((turns, index) => [turns, roundness[index]])].map(([turns, value]) => [turns, Math.log10(Math.max(value, 1e-6))]);
  const [low, high] = [Math.min(...points.map(point => point[1])), Math.max(...points.map(point => point[1]))];
  return points.map(([turns, value], index) => `${index ? 'L' : 'M'}${((CURVE_WIDTH * turns) / total).toFixed(1)} ${(3 + (CURVE_HEIGHT - 6) * (1 - (value - low) / (high - low || 1))).toFixed(1)}`).join('');
}
