// The ring revolution by revolution. What the surface looked like after k revolutions is what the same job gives that
// stops there: feed, angles and surface up to then are the same, so every frame is an answer of its own.
import { html, useState, useEffect, useMemo } from './lib.js';
import { t, number } from './text.js';
import { useProbe } from './probe.js';

/** Between two frames of a replay, ms. */
const FRAME_MS = 160;
/** A replay shows at most so many frames, whatever the number of revolutions. */
const FRAMES = 60;
const CURVE_WIDTH = 1000;
const CURVE_HEIGHT = 40;

/** Revolutions as they are told: what is counted in nodes ends a little before the whole one. */
const told = turns => number(Math.round(turns * 100) / 100, 8);

/** Whether there is a history to go through. */
export const canReplay = (id, figure, result) => id === 'ring-roundness' && figure?.id === 'polar' && (result?.simulation?.history?.revolution?.length ?? 0) > 1;

/** The job that stops after so many revolutions. */
export function stoppedAt(job, { result, effects }, turns) {
  const { simulation, setting } = result;
  const fed = Math.min(turns, job.tool.revolutions);
  const dwell = Math.max(0, turns - job.tool.revolutions);
  // All that acted, a stored model's among them: the one that sets the spark-out stops with the ring.
  const acting = effects.map(effect => (effect.kind === 'spark_out_missing' ? { ...effect, spark_out_revolutions: dwell } : effect));
  const pushOff = acting.filter(({ kind }) => kind === 'tool_push_off').reduce((sum, effect) => sum + effect.push_off_ratio, 0);
  const { model, stiffness, settings_search: search, setup_map: map, ...rest } = job;
  return {
    ...rest,
    // The ratio of the whole feed: that of stiffnesses would be taken where this one stops.
    ...(stiffness && { compliance_ratio: Math.max(0, setting.compliance_ratio - pushOff) }),
    tool: { ...job.tool, revolutions: fed, spark_out_revolutions: dwell },
    effects: acting,
    samples: simulation.samples,
    analyses: ['simulation'],
  };
}

/** The first state: the blank, which the answer holds already. */
function blankOf(figures, polar) {
  const before = figures.find(({ id }) => id === 'profile')?.panels[0]?.items;
  return before && { ...polar, panels: [{ ...polar.panels[0], items: before }] };
}

const titled = (figure, turns, of) => figure && { ...figure, title: { ...figure.title, text: t('ring_at', { revolution: told(turns), of: told(of) }) } };

/** A scrubber over the history; `onShow(figure)` with the state that is to be seen, `null` for the end. */
export function Replay({ id, answer, job, figures, onShow }) {
  const { history } = answer.result.simulation;
  const turns = useMemo(() => (history.revolution[0] > 0 ? [0, ...history.revolution] : history.revolution), [history]);
  const last = turns.length - 1;
  const [step, setStep] = useState(last);
  const [isPlaying, setPlaying] = useState(false);
  const offset = turns.length - history.revolution.length;
  const polar = figures.find(figure => figure.id === 'polar');
  const isFrame = step > 0 && step < last;
  const found = useProbe(id, isFrame ? `${answer.key} ${turns[step]}` : null, isFrame ? stoppedAt(job, answer, turns[step]) : null);
  useEffect(() => {
    if (step === last) onShow(null);
    else if (step === 0) onShow(titled(blankOf(figures, polar), 0, turns[last]));
    else if (found?.figures) onShow(titled(found.figures.find(figure => figure.id === 'polar'), Number(found.tag.split(' ')[1]), turns[last]));
  }, [step, found]);
  useEffect(() => {
    if (!isPlaying) return undefined;
    const stride = Math.max(1, Math.ceil(last / FRAMES));
    const timer = setInterval(() => setStep(now => Math.min(now + stride, last)), FRAME_MS);
    return () => clearInterval(timer);
  }, [isPlaying]);
  useEffect(() => { if (step === last) setPlaying(false); }, [step]);

  const at = step - offset;
  const roundness = at >= 0 ? history.roundness_um[at] : answer.result.simulation.start.unfiltered.least_squares_um;
  const radius = at >= 0 ? history.mean_radius_mm[at] : answer.result.simulation.start.mean_radius_mm;
  const curve = useMemo(() => curveOf(turns, offset, history.roundness_um, answer.result.simulation.start.unfiltered.least_squares_um), [answer.key]);
  const says = t('revolution_is', { revolution: told(turns[step]), of: told(turns[last]), roundness: number(roundness, 4) });
  return html`
    <div class="scrubber" role="group" aria-label=${t('replay')}>
      <button type="button" class="icon" aria-label=${isPlaying ? t('replay_stop') : t('replay_play')} title=${isPlaying ? t('replay_stop') : t('replay_play')} aria-pressed=${isPlaying}
        onClick=${() => { if (!isPlaying && step === last) setStep(0); setPlaying(!isPlaying); }}>${isPlaying ? '❚❚' : '▶'}</button>
      <div class="track">
        <svg viewBox=${`0 0 ${CURVE_WIDTH} ${CURVE_HEIGHT}`} preserveAspectRatio="none" aria-hidden="true"><path class="after" d=${curve} vector-effect="non-scaling-stroke" /><path class="cursor" d=${`M${(CURVE_WIDTH * step) / last} 0V${CURVE_HEIGHT}`} vector-effect="non-scaling-stroke" /></svg>
        <input type="range" id="replay" min="0" max=${last} step="1" value=${step} aria-label=${t('replay')} aria-valuetext=${says} onInput=${event => { setPlaying(false); setStep(Number(event.currentTarget.value)); }} />
      </div>
      <p class="scrub-text">${says}<span class="quiet"> · ${t('mean_radius')} ${number(radius, 7)} ${t('unit_mm')}</span></p>
      ${found?.problem && isFrame && html`<p class="fault"><span>${found.problem.detail || found.problem.title}</span></p>`}
    </div>`;
}

/** The roundness over the revolutions, by its logarithm. */
function curveOf(turns, offset, roundness, start) {
  const values = turns.map((_, index) => (index < offset ? start : roundness[index - offset])).map(value => Math.log10(Math.max(value, 1e-6)));
  const [low, high] = [Math.min(...values), Math.max(...values)];
  const stride = Math.max(1, Math.ceil(values.length / CURVE_WIDTH));
  return values.map((value, index) => (index % stride && index < values.length - 1 ? '' : `${index ? 'L' : 'M'}${((CURVE_WIDTH * index) / (values.length - 1)).toFixed(1)} ${(3 + (CURVE_HEIGHT - 6) * (1 - (value - low) / (high - low || 1))).toFixed(1)}`)).join('');
}
