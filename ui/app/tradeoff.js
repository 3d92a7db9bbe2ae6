// The trade-off curve of a feed schedule: a point on it that is dragged or stepped, the schedule there, and the way of
// its tolerances into the form.
import { html, useMemo } from './lib.js';
import { t, number, unitSymbol, unitOf } from './text.js';
import { resolve, labelOf, at, changed } from './schema.js';
import { valueAt } from './scale.js';
import { useProbe } from './probe.js';
import { Picture } from './figure.js';

const STEPS = 100;
const PREVIEW_HEIGHT = 330;
const PREVIEWED = ['feed', 'cutting_speed', 'limit_gain', 'radial_deflection', 'height_of_roughness'];

/** Where the limits of each kind stand: `[list of objects, field]`, or one path. */
const PLACES = {
  deflection: { list: ['zones'], field: 'deflection_max_um' },
  roughness: { list: ['zones'], field: 'roughness_max_um' },
  tool_usage: { path: ['limits', 'tool_usage_max'] },
  time: { path: ['limits', 'time_max_min'] },
};

const pathsOf = job => {
  const place = PLACES[job.trade_off?.limit ?? 'deflection'];
  const all = place.list ? (at(job, place.list) || []).map((_, index) => [...place.list, index, place.field]) : [place.path];
  return all.filter(path => typeof at(job, path) === 'number');
};

/** Whether the figure is a curve whose point stands for a job. */
export const canTrade = (figure, job) => figure?.id === 'trade_off' && pathsOf(job).length > 0;

/** The ends of the curve. */
export const spanOf = figure => {
  const { x } = figure.panels[0].items[0];
  return [x[0], x.at(-1)];
};

/** The job whose limits are so many times its own. */
export const scaledBy = (job, factor) => pathsOf(job).reduce((whole, path) => changed(whole, path, Number((at(job, path) * factor).toPrecision(4))), job);

export function TradeOff({ id, figure, answer, job, figures, factor, setFactor, schema, apply }) {
  const [low, high] = spanOf(figure);
  const isHere = Math.abs(Math.log(factor)) < 1e-6;
  const changedJob = useMemo(() => (isHere ? null : { ...scaledBy(job, factor), trade_off: undefined }), [job, factor]);
  const found = useProbe(id, isHere ? null : `${answer.key} ${factor}`, changedJob);
  const own = figures.find(one => one.id === 'schedule');
  const there = partOf(isHere ? own : found?.figures?.find(one => one.id === 'schedule'));
  const share = Math.log(factor / low) / Math.log(high / low);
  const line = figure.panels[0].items[0];
  const objective = valueAt(line.x, line.y, factor);
  const paths = pathsOf(job);
  const limits = [...new Set(paths.map(path => Number((at(job, path) * factor).toPrecision(4))))];
  const field = paths[0].reduce((part, name) => {
    const whole = resolve(part, schema);
    return resolve(typeof name === 'number' ? whole.items : whole.properties[name], schema);
  }, schema);
  const unit = unitSymbol(figure.panels[0].y.unit);
  const says = `${labelOf(paths[0].at(-1), field)} ${limits.length > 3 ? `${number(Math.min(...limits), 4)} … ${number(Math.max(...limits), 4)}` : limits.map(value => number(value, 4)).join('; ')} ${unitOf(field)} (× ${number(factor, 3)})`;
  const gives = objective === null || objective === undefined || (found?.problem && !isHere) ? t('no_schedule') : `${figure.panels[0].y.text} ${number(objective, 4)} ${unit}`;
  const better = objective && answer.result.objective ? (100 * (objective - answer.result.objective)) / answer.result.objective : null;
  return html`
    <div class="scrubber trade" role="group" aria-label=${t('trade_off')}>
      <div class="track"><input type="range" id="trade-off" min="0" max=${STEPS} step="1" value=${Math.round(STEPS * share)} aria-label=${t('trade_off')} aria-valuetext=${`${says}: ${gives}`}
        onInput=${event => setFactor(stepped(Number(event.currentTarget.value), low, high))} /></div>
      <p class="scrub-text"><strong>${says}</strong> ${gives}${better !== null && !isHere && !found?.problem ? ` (${better > 0 ? '+' : '−'}${number(Math.abs(better), 2)} %)` : ''}</p>
      <button type="button" id="use-tolerance" class="primary" disabled=${isHere || Boolean(found?.problem)} onClick=${() => apply(scaledBy(job, factor))}>${t('use_tolerance')}</button>
      <button type="button" disabled=${isHere} onClick=${() => setFactor(1)}>${t('reset')}</button>
      ${found?.problem && !isHere && html`<p class="fault"><span>${found.problem.detail || found.problem.title}</span></p>`}
    </div>
    <div class="preview" data-factor=${isHere ? 1 : found?.tag.split(' ')[1]}>${there && html`<${Picture} figure=${there} pinned=${isHere ? null : partOf(own)} height=${PREVIEW_HEIGHT} />`}</div>`;
}

/** Of the schedule what a tolerance changes: feed, speed, what binds, deflection, roughness. */
const partOf = figure => figure && { ...figure, panels: figure.panels.filter(({ y }) => PREVIEWED.includes(y.label)) };

/** The factor at a step of the slider; the job's own limits are always one of them. */
function stepped(step, low, high) {
  const at1 = Math.round((STEPS * Math.log(1 / low)) / Math.log(high / low));
  return step === at1 ? 1 : Number((low * (high / low) ** (step / STEPS)).toPrecision(5));
}
