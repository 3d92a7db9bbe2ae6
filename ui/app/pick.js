// Points of a picture that stand for a job: where a click, a dragged point or Enter at the cross puts numbers into the
// form.
import { t } from './text.js';
import { resolve, kindOf, stem, changed } from './schema.js';

/** Fields of the job that the axes of a figure show: `[field of x, field of y]`. */
function fieldsOfAxes(figure, schema, job) {
  if (figure.frame !== 'stacked' || figure.panels.length !== 1) return null;
  const leaves = [];
  const walk = (part, value, path) => {
    const whole = resolve(part, schema);
    if (kindOf(whole) === 'object') for (const [name, inner] of Object.entries(whole.properties)) walk(inner, value?.[name], [...path, name]);
    else if (kindOf(whole) === 'number' && typeof value === 'number') leaves.push({ path, value, unit: whole['x-unit'], stem: stem(path.at(-1), whole['x-unit']), schema: whole });
  };
  walk(schema, job, []);
  const find = axis => leaves.find(({ unit, stem: name }) => unit === axis.unit && (name === axis.label || axis.label.startsWith(`${name}_`)));
  const [x, y] = [find(figure.x), find(figure.panels[0].y)];
  return x && y && x !== y ? [x, y] : null;
}

function byAxes(figure, schema, job) {
  const axes = fieldsOfAxes(figure, schema, job);
  if (!axes) return null;
  const round = (value, field) => (field.type === 'integer' ? Math.round(value) : Number(value.toPrecision(3)));
  return {
    hint: t('click_to_try'),
    at: [axes[0].value, axes[1].value],
    jobAt: (x, y) => changed(changed(job, axes[0].path, round(x, axes[0].schema)), axes[1].path, round(y, axes[1].schema)),
  };
}

const RAD = Math.PI / 180;
/** A feed that goes less than this into the ring, as a share of it, is turned toward the centre. */
const LEAST_APPROACH = 0.3;
const rounded = (value, digits) => Number(value.toFixed(digits));

/** By how much the machine stands beside what the job says: the right support to the right, the tip across its direction
 *  from the origin. */
function shiftsOf(effects) {
  const sum = (kind, field) => effects.filter(effect => effect.kind === kind).reduce((total, effect) => total + effect[field], 0);
  return { support: sum('support_position', 'support_b_shift_mm'), tip: sum('tool_off_line', 'tangential_offset_mm') };
}

/** The point that stands there once it is moved across its direction from the origin: on the same circle less the way. */
function beforeShift(point, by) {
  const [x, y] = point;
  const reach = Math.hypot(x, y);
  if (by === 0 || reach <= Math.abs(by)) return point;
  // A right angle at the point that is looked for: reach² = its own² + by².
  const own = Math.sqrt(reach * reach - by * by);
  const turn = Math.atan2(y, x) - Math.atan2(by, own);
  return [own * Math.cos(turn), own * Math.sin(turn)];
}

/** The job whose tool and supports really stand at these angles when the feed ends. Size and radius taken off per
 *  revolution stay what they were, so that nothing but the angles differs: the circle through the tip that touches both
 *  supports has the same radius, and the feed is scaled by what it takes off the radius there (`ring/2.3`, `ring/5.1`).
 *  Effects that put a support or the tip beside their places in the job are taken off these places. */
export function ringAt(job, setting, toolDeg, halfDeg, effects = []) {
  const shifts = shiftsOf(effects);
  const [tool, half] = [toolDeg * RAD, halfDeg * RAD];
  const radius = setting.circumradius_mm;
  const reach = radius + (job.supports.roller_radius_mm ?? 0);
  const toTip = [Math.cos(tool), Math.sin(tool)];
  const approach = direction => toTip[0] * Math.cos(direction * RAD) + toTip[1] * Math.sin(direction * RAD);
  const own = job.tool.feed_direction_deg ?? 270;
  const direction = approach(own) > -LEAST_APPROACH ? rounded((toolDeg + 180 + 360) % 360, 3) : own;
  const seen = (Math.cos(tool + half) - Math.cos(tool - half)) / Math.sin(2 * half);
  const perFeed = -approach(direction) / (1 - seen);
  if (!(perFeed > 0) || !(setting.radius_per_feed > 0)) return null;
  const feed = Number((job.tool.feed_mm_per_rev * (setting.radius_per_feed / perFeed)).toPrecision(6));
  const fed = feed * job.tool.revolutions;
  // The ring stands over the middle of the supports as they really are.
  const centre = [shifts.support / 2, reach * Math.cos(half) - job.supports.depth_mm];
  const tip = [centre[0] + radius * toTip[0] - fed * Math.cos(direction * RAD), centre[1] + radius * toTip[1] - fed * Math.sin(direction * RAD)];
  const [x, y] = beforeShift(tip, shifts.tip);
  return {
    ...job,
    supports: { ...job.supports, distance_mm: rounded(2 * reach * Math.sin(half) - shifts.support, 4) },
    tool: {
      ...job.tool,
      x_mm: rounded(x, 5),
      y_mm: rounded(y, 5),
      feed_mm_per_rev: feed,
      ...(direction !== own && { feed_direction_deg: direction }),
    },
  };
}

function byMap(job, { result, effects }) {
  const map = result.setup_map;
  if (!map) return null;
  const near = (list, value) => list.reduce((best, one) => (Math.abs(one - value) < Math.abs(best - value) ? one : best));
  const { support, tip } = shiftsOf(effects);
  return {
    hint: `${t('click_to_set_up')}${support !== 0 || tip !== 0 ? ` ${t('shifts_allowed_for')}` : ''}`,
    at: [map.here.tool_angle_deg, map.here.support_half_angle_deg],
    jobAt: (x, y) => ringAt(job, result.setting, near(map.tool_angle_deg, x), near(map.support_half_angle_deg, y), effects),
  };
}

/** What a point of a figure stands for: `{ hint, at: [x, y], jobAt(x, y) }`, or `null`. */
export function pickOf(figure, schema, job, body) {
  if (!figure) return null;
  if (figure.id === 'map' && body.result.setup_map) return byMap(job, body);
  return byAxes(figure, schema, job);
}
