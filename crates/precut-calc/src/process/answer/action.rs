//! What to do before the next part (`process/5`).

use nalgebra::{DMatrix, DVector};

use crate::calculator::Limits;
use crate::process::answer::outlook::Expected;
use crate::process::answer::output::{Action, ActionKind, Change, ChangeVerdict, ChangedCause, Decided, Forecast};
use crate::process::history::memory::Memory;
use crate::process::part::sight::{GAUGE, Sighting};

/// A new path only where the mean deviation is this much larger than what is unsure of it, and than what a part scatters.
const OVER_UNSURE: f64 = 1.5;
const OVER_SCATTER: f64 = 0.5;
/// And only where the path that the calculator really gives leaves at most this share of its mean square.
const LEFT: f64 = 0.5;
/// Below this probability, even with the best path, a person is called.
const LIKELY: f64 = 0.9;
/// Share of the tolerance of form from which on something without a name is too large to be left alone, and from which on two
/// causes call for different paths.
const LARGE: f64 = 0.5;
const DIFFERENT: f64 = 0.25;
/// Two changes within so many parts are too many.
const SOON: u32 = 10;

/// Everything that an action may give as its reason.
pub const ACTION_CODES: &[&str] = &[
    "process_within_dead_band",
    "process_drifted_past_dead_band",
    "process_gauge_may_have_moved",
    "process_causes_call_for_different_paths",
    "process_out_of_tolerance_with_any_path",
    "process_large_without_a_name",
    "process_two_changes_at_once",
    "process_effect_at_its_bound",
    "process_offset_limit",
];

/// What is expected of the next part on the path in use and, where that leaves the dead band, on the path that was tried.
pub(in crate::process) struct Expectation<'a> {
    pub(in crate::process) now: &'a Expected,
    pub(in crate::process) tried: Option<&'a Expected>,
    /// One standard deviation of what parts scatter by themselves, a column each.
    pub(in crate::process) scatter: &'a DMatrix<f64>,
}

/// Whether a deviation is more than what is unsure of it, and than what parts scatter anyway.
pub(in crate::process) fn is_beyond_dead_band(expected: &Expected, scatter: &DMatrix<f64>) -> bool {
    let square = expected.mean.norm_squared();
    square > OVER_UNSURE * expected.variance.sum() && square > OVER_SCATTER.powi(2) * scatter.norm_squared()
}

pub(in crate::process) fn of(
    memory: &Memory,
    part: &Sighting,
    expected: &Expectation<'_>,
    forecast: &Forecast,
    limits: Limits,
) -> Action {
    let act = |kind, code| Action { kind, code };
    let change = memory.changes.last().filter(|change| change.decided != Some(Decided::Rejected));
    if change.is_some_and(|change| change.causes.iter().any(|cause| cause.kind == GAUGE)) {
        return act(ActionKind::MeasureGauge, "process_gauge_may_have_moved");
    }
    if let Some(code) = calls_person(memory, part, expected.now, forecast, limits, change) {
        return act(ActionKind::CallPerson, code);
    }
    if change.is_some_and(|change| !change.accepted && call_for_different_paths(memory, part, change, limits)) {
        return act(ActionKind::MeasureMore, "process_causes_call_for_different_paths");
    }
    let is_worth_it = |tried: &Expected| tried.mean.norm_squared() <= LEFT * expected.now.mean.norm_squared();
    if is_beyond_dead_band(expected.now, expected.scatter) && expected.tried.is_none_or(is_worth_it) {
        return act(ActionKind::NewPath, "process_drifted_past_dead_band");
    }
    act(ActionKind::Keep, "process_within_dead_band")
}

fn calls_person(
    memory: &Memory,
    part: &Sighting,
    expected: &Expected,
    forecast: &Forecast,
    limits: Limits,
    change: Option<&Change>,
) -> Option<&'static str> {
    let best = [&forecast.as_now, &forecast.new_path].into_iter().filter_map(|path| path.in_tolerance_probability);
    let leader = change.and_then(|change| change.causes.first());
    let unnamed = change.filter(|change| change.verdict == ChangeVerdict::Unnamed && !change.accepted);
    let reported: Vec<u32> = memory.changes.iter().rev().take(2).map(|change| change.reported_at_part).collect();
    let is_now = |reported: u32| part.number - reported <= SOON;
    if best.reduce(f64::max).is_some_and(|probability| probability < LIKELY) {
        Some("process_out_of_tolerance_with_any_path")
    } else if unnamed.is_some() && limits.form_um.is_some_and(|form| forecast.as_now.form_um > LARGE * form) {
        Some("process_large_without_a_name")
    } else if matches!(reported[..], [last, before] if is_now(last) && last - before < SOON) {
        Some("process_two_changes_at_once")
    } else if leader.is_some_and(|cause| cause.at_bound) {
        Some("process_effect_at_its_bound")
    } else if expected.mean.amax() / part.signs.per_um > memory.options.offset_limit_um {
        Some("process_offset_limit")
    } else {
        None
    }
}

/// Whether the two likeliest causes shift the next part differently.
fn call_for_different_paths(memory: &Memory, part: &Sighting, change: &Change, limits: Limits) -> bool {
    let (Some(form_um), [one, other, ..]) = (limits.form_um, change.causes.as_slice()) else { return false };
    let of = |cause: &ChangedCause| {
        let (variant, size) = memory.place(cause)?;
        let (_, own) = part.signs.causes.iter().find(|(own, _)| *own == variant)?;
        Some(DVector::from_column_slice(own) * size)
    };
    let (Some(one), Some(other)) = (of(one), of(other)) else { return false };
    let apart = (one - other).norm() / (part.value.len() as f64).sqrt() / part.signs.per_um;
    apart > DIFFERENT * form_um
}
