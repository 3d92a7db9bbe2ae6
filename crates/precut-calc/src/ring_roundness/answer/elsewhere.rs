//! The job whose tool and supports stand elsewhere: what a place in the map of angles, or in the roundness chart, stands for.

use crate::calculator::Place;
use crate::effects::RingEffect as Effect;

use crate::ring_roundness::answer::output::Outcome;
use crate::ring_roundness::answer::output_settings::MapOutcome;
use crate::ring_roundness::job::input::Job;

/// A feed that goes less than this into the ring, as a share of it, is turned toward the centre.
const LEAST_APPROACH: f64 = 0.3;
/// Support half angles at which a ring rests between its supports, deg.
const RESTS_DEG: [f64; 2] = [5.0, 85.0];

/// Places that can be taken hold of, by the codes of what they are called.
pub(in crate::ring_roundness) const THIS_SETTING: &str = "this_setting";
pub(in crate::ring_roundness) const CONTACT_TOOL: &str = "contact_tool";
pub(in crate::ring_roundness) const CONTACT_SUPPORT: &str = "contact_support";

/// Tool angle and support half angle, deg.
#[derive(Debug, Clone, Copy)]
struct Angles {
    tool_deg: f64,
    half_deg: f64,
}

/// The job of a place in the figures `map`, `cut_map` and `polar`.
pub(in crate::ring_roundness) fn at_place(job: &Job, outcome: &Outcome, place: &Place<'_>) -> Option<Job> {
    let angles = match (place.figure, place.setting) {
        ("map" | "cut_map", THIS_SETTING) => nearest_cell(outcome.setup_map.as_ref()?, place),
        ("polar", CONTACT_TOOL | CONTACT_SUPPORT) => turned_to(job, outcome, place)?,
        _ => return None,
    };
    set_up(job, outcome, angles)
}

/// Cells are what a map knows something of.
fn nearest_cell(map: &MapOutcome, place: &Place<'_>) -> Angles {
    let near = |middles: &[f64], at: f64| {
        middles.iter().copied().min_by(|a, b| (a - at).abs().total_cmp(&(b - at).abs())).unwrap_or(at)
    };
    Angles { tool_deg: near(&map.tool_angle_deg, place.x), half_deg: near(&map.support_half_angle_deg, place.y) }
}

/// A contact that is pulled round the ring, to whole tenths of a degree; the supports stay alike on both sides.
fn turned_to(job: &Job, outcome: &Outcome, place: &Place<'_>) -> Option<Angles> {
    let setting = &outcome.setting;
    let here = crate::ring_roundness::answer::picture::contacts(job, setting);
    let contact = here.iter().find(|contact| contact.handle == Some(place.setting))?;
    let by_deg = (place.x - contact.body_angle_deg + 180.0).rem_euclid(360.0) - 180.0;
    let tenths = |angle: f64| (angle * 10.0).round() / 10.0;
    Some(if place.setting == CONTACT_TOOL {
        Angles { tool_deg: tenths(setting.tool_angle_deg + by_deg), half_deg: setting.support_half_angle_deg }
    } else {
        let half_deg = tenths(setting.support_half_angle_deg + by_deg).clamp(RESTS_DEG[0], RESTS_DEG[1]);
        Angles { tool_deg: setting.tool_angle_deg, half_deg }
    })
}

/// By how much the machine stands beside what the job says: the right support to the right, the tip across its direction
/// from the origin, mm.
fn shifts_mm(effects: &[Effect]) -> (f64, f64) {
    effects.iter().fold((0.0, 0.0), |(support, tip), effect| match *effect {
        Effect::SupportPosition { support_b_shift_mm } => (support + support_b_shift_mm, tip),
        Effect::ToolOffLine { tangential_offset_mm } => (support, tip + tangential_offset_mm),
        _ => (support, tip),
    })
}

/// The point that stands at `point` once it is moved across its direction from the origin: on the same circle less the way.
fn before_shift([x, y]: [f64; 2], by: f64) -> [f64; 2] {
    let reach = x.hypot(y);
    if reach <= by.abs() {
        return [x, y];
    }
    // A right angle at the point that is looked for: reach² = its own² + by².
    let own = (reach * reach - by * by).sqrt();
    let turn = y.atan2(x) - by.atan2(own);
    [own * turn.cos(), own * turn.sin()]
}

/// Digits of a feed that is told.
const FEED_DIGITS: i32 = 6;

#[allow(clippy::cast_possible_truncation, reason = "the order of a feed that a job may have")]
fn digits_before_point(value: f64) -> i32 {
    value.log10().floor() as i32 + 1
}

fn rounded(value: f64, digits: i32) -> f64 {
    let scale = 10_f64.powi(digits);
    (value * scale).round() / scale
}

/// The job whose tool and supports really stand at these angles when the feed ends. Size and radius taken off per
/// revolution stay what they were, so that nothing but the angles differs: the circle through the tip that touches both
/// supports has the same radius, and the feed is scaled by what it takes off the radius there (`ring/2.3`, `ring/5.1`).
/// Effects that put a support or the tip beside their places in the job are taken off these places.
fn set_up(job: &Job, outcome: &Outcome, angles: Angles) -> Option<Job> {
    let (support_mm, tip_mm) = shifts_mm(&job.effects);
    let (tool, half) = (angles.tool_deg.to_radians(), angles.half_deg.to_radians());
    let radius = outcome.setting.circumradius_mm;
    let reach = radius + job.supports.roller_radius_mm;
    let (sin, cos) = tool.sin_cos();
    let along = |direction_deg: f64| cos * direction_deg.to_radians().cos() + sin * direction_deg.to_radians().sin();
    let own = job.tool.feed_direction_deg;
    let is_away = along(own) > -LEAST_APPROACH;
    let direction = if is_away { rounded((angles.tool_deg + 180.0).rem_euclid(360.0), 3) } else { own };
    let seen = ((tool + half).cos() - (tool - half).cos()) / (2.0 * half).sin();
    let per_feed = -along(direction) / (1.0 - seen);
    if !(per_feed > 0.0 && outcome.setting.radius_per_feed > 0.0) {
        return None;
    }
    let feed = job.tool.feed_mm_per_rev * (outcome.setting.radius_per_feed / per_feed);
    let fed = feed * job.tool.revolutions;
    // The ring stands over the middle of the supports as they really are.
    let centre = [support_mm / 2.0, reach * half.cos() - job.supports.depth_mm];
    let (feed_sin, feed_cos) = direction.to_radians().sin_cos();
    let tip = [centre[0] + radius * cos - fed * feed_cos, centre[1] + radius * sin - fed * feed_sin];
    let [x_mm, y_mm] = before_shift(tip, tip_mm);
    let mut next = job.clone();
    next.supports.distance_mm = rounded(2.0 * reach * half.sin() - support_mm, 4);
    next.tool.x_mm = rounded(x_mm, 5);
    next.tool.y_mm = rounded(y_mm, 5);
    next.tool.feed_mm_per_rev = rounded(feed, FEED_DIGITS - digits_before_point(feed));
    next.tool.feed_direction_deg = direction;
    Some(next)
}
