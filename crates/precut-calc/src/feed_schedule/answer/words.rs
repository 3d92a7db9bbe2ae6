//! Feed and speed in the control's steps, and what rounding does to the limits (`feed/9.2`).

use crate::calculator::Failure;
use crate::path::round_to_increment;

use crate::feed_schedule::answer::output::{Outcome, ZoneOutcome};
use crate::feed_schedule::job::blank::SAME_MM;
use crate::feed_schedule::job::case::{Case, TOUCHING_MM, ZoneCase};
use crate::feed_schedule::job::compliance::Held;
use crate::feed_schedule::job::input::{FeedMode, Job, SpeedMode, Variables};
use crate::feed_schedule::job::plan::Method;
use crate::feed_schedule::model::assess;
use crate::feed_schedule::model::continuous::add_zone;
use crate::feed_schedule::model::edges;
use crate::feed_schedule::model::program::{Built, Place, Variation, build};
use crate::feed_schedule::model::stretches::step_of;

/// A limit may be passed by this much in logarithms: the rounding of the schedule itself.
const KEPT: f64 = 1e-9;
/// What a schedule is solved to, in logarithms: beyond it a limit was passed before anything was rounded.
const SOLVED: f64 = 1e-6;

/// Feed and speed as programmed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::feed_schedule) struct Words {
    pub(in crate::feed_schedule) feed_mm_per_rev: f64,
    /// rev/min, or m/min with constant surface speed.
    pub(in crate::feed_schedule) speed: f64,
    limits: Limits,
}

/// What becomes of the limits of a zone by itself.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Limits {
    Kept,
    /// No neighbouring pair of steps keeps them all.
    LostByRounding,
    /// The schedule itself does not: a rule asks nobody.
    LostBefore,
}

/// The words of a program, and what is to be said of them.
pub(in crate::feed_schedule) struct Spoken {
    pub(in crate::feed_schedule) case: Case,
    /// In the order of the answer's zones.
    pub(in crate::feed_schedule) words: Vec<Words>,
    /// ln V and ln S of the words.
    at: Vec<(f64, f64)>,
    /// Limits over several zones or the part that do not hold, each in words.
    pub(in crate::feed_schedule) passed: Vec<String>,
}

impl Spoken {
    pub(in crate::feed_schedule) fn of(job: &Job, outcome: &Outcome) -> Result<Self, Failure> {
        let held = Held::of(job)?;
        let (case, built) = limits_of_zones(job, outcome, held.as_ref())?;
        let rounding = Rounding { job, built: &built, zones: &outcome.zones };
        let words = rounding.words();
        let logs = |(zone, words): (&ZoneOutcome, &Words)| {
            (rounding.metres_per_min(zone, words.speed).ln(), words.feed_mm_per_rev.ln())
        };
        let at: Vec<(f64, f64)> = outcome.zones.iter().zip(&words).map(logs).collect();
        let mut passed = passed(&case, &built, &at, &exact(outcome));
        passed.extend(spread_passed(&case, job, &at, &exact(outcome)));
        Ok(Self { case, words, at, passed })
    }

    /// What a zone comes to with its words.
    pub(in crate::feed_schedule) fn note(&self, job: &Job, zone: usize) -> String {
        note(&assess::zone_outcome(&self.case, job, zone, self.at[zone]), self.words[zone])
    }
}

fn note(zone: &ZoneOutcome, words: Words) -> String {
    use std::fmt::Write as _;
    let mut text = format!("zone {}", zone.id);
    // Writing to a string does not fail.
    if let Some(deflection) = zone.deflection_um {
        let _ = write!(text, " deflection {deflection:.1} um");
    }
    if let Some(roughness) = zone.roughness_um {
        let _ = write!(text, " Ra {roughness:.2} um");
    }
    if let Some(usage) = zone.tool_usage {
        let _ = write!(text, " edge {:.1} percent", 100.0 * usage);
    }
    text.push_str(match words.limits {
        Limits::Kept => "",
        Limits::LostByRounding => " rounding breaks a limit of this zone",
        Limits::LostBefore => " the schedule breaks a limit of this zone",
    });
    text
}

/// What is one for all zones in the program. The rule of equal deflection has feeds of its own and states one cutting speed,
/// so of `variables` only G96 is left to it.
pub(in crate::feed_schedule) fn modes(job: &Job) -> (FeedMode, SpeedMode) {
    match (&job.method, job.variables.speed) {
        (Method::EqualDeflection { .. }, SpeedMode::ConstantSpeed) => (FeedMode::PerZone, SpeedMode::ConstantSpeed),
        (Method::EqualDeflection { .. }, _) => (FeedMode::PerZone, SpeedMode::PerZone),
        (_, speed) => (job.variables.feed, speed),
    }
}

/// Whether one cutting speed is programmed for all zones.
pub(in crate::feed_schedule) fn is_surface(job: &Job) -> bool {
    modes(job).1 == SpeedMode::ConstantSpeed
}

/// Speeds of the spindle that the machine has, whole rev/min.
fn spindle_rpm(job: &Job) -> (f64, f64) {
    let least = job.machine.spindle_speed_min_rpm.map_or(1.0, |least| (least - 1e-9).ceil().max(1.0));
    (least, job.machine.spindle_speed_max_rpm.map_or(f64::INFINITY, |most| (most + 1e-9).floor().max(1.0)))
}

/// The words of a zone for a pass at another diameter: the same speed at the cut, where a pass may have a speed of
/// its own and the machine turns so slowly.
pub(in crate::feed_schedule) fn at_diameter(words: Words, zone: &ZoneOutcome, diameter_mm: f64, job: &Job) -> Words {
    let is_counted = diameter_mm <= zone.diameter_mm + SAME_MM;
    match modes(job).1 {
        SpeedMode::PerZone | SpeedMode::Fixed if !is_counted => {
            let wanted = (words.speed * zone.diameter_mm / diameter_mm + 1e-9).floor();
            Words { speed: wanted.max(spindle_rpm(job).0), ..words }
        }
        _ => words,
    }
}

/// ln V and ln S of the schedule.
fn exact(outcome: &Outcome) -> Vec<(f64, f64)> {
    outcome.zones.iter().map(|zone| (zone.speed_m_per_min.ln(), zone.feed_mm_per_rev.ln())).collect()
}

/// The limits of every zone with feed and speed of its own, in the order of the answer's zones.
fn limits_of_zones(job: &Job, outcome: &Outcome, held: Option<&Held>) -> Result<(Case, Built), Failure> {
    let split = outcome.passes.as_ref().map(|passes| crate::feed_schedule::job::case::PassSplit {
        roughing_passes: passes.roughing_passes,
        roughing_mm: passes.roughing_depth_mm.unwrap_or(0.0),
        finishing_mm: passes.finishing_depth_mm,
    });
    let base = Case::of(job, held, split.as_ref())?;
    let mut case = base.clone();
    case.variables = Variables::default();
    if outcome.continuous.is_some() {
        // Found zones take over the limits of the zone that they lie in, and keep their own names.
        case.custom.clear();
        case.zones.clear();
        for (k, given) in outcome.zones.iter().enumerate() {
            let lies_in = |own: &ZoneCase| own.from_mm <= given.z_start_mm + 1e-6 && own.to_mm >= given.z_end_mm - 1e-6;
            let zone = base.zones.iter().position(lies_in);
            let zone = zone.ok_or_else(|| Failure::Internal("a found zone lies in none of the job's".to_owned()))?;
            let mut piece = base.zones[zone].clone();
            piece.id.clone_from(&given.id);
            (piece.from_mm, piece.to_mm) = (given.z_start_mm, given.z_end_mm);
            piece.compliance_um_per_n = given.compliance_um_per_n;
            let next = outcome.zones.get(k + 1);
            piece.touches_next = next.is_some_and(|next| (next.z_start_mm - given.z_end_mm).abs() <= TOUCHING_MM);
            add_zone(&mut case, &base, zone, piece);
        }
    }
    case.limits.deflection_spread_ratio_max = None;
    let at = exact(outcome);
    let edges = outcome.certificate.lower_bound.map(|_| edges::limits_of(&case, outcome));
    let about = Some((at.as_slice(), f64::INFINITY));
    let variation = Variation { parts_per_edge: outcome.parts_per_edge, edges: edges.as_ref(), about, beside: &[] };
    let built = build(&case, &variation);
    Ok((case, built))
}

/// The program's variables with these values in the zones.
fn variables(built: &Built, at: impl Iterator<Item = (usize, (f64, f64))>) -> Vec<f64> {
    let mut y = built.program.start.clone();
    for (zone, (u, x)) in at {
        for (source, value) in [(built.speed[zone], u), (built.feed[zone], x)] {
            if let Some(variable) = source.variable {
                y[variable] = value;
            }
        }
    }
    y
}

/// Whether all limits of the zone by itself hold, up to a slack in logarithms.
fn holds(built: &Built, zone: usize, at: (f64, f64), slack: f64) -> bool {
    let y = variables(built, std::iter::once((zone, at)));
    built
        .rows
        .iter()
        .enumerate()
        .filter(|(_, label)| label.place == Place::Zone(zone) && label.kind.is_limit())
        .all(|(row, _)| built.program.rows.value(row, &y) <= slack)
}

/// Limits over several zones or the part that the rounded words pass, each in words. A lower feed takes longer, and can
/// use more of the edge.
fn passed(case: &Case, built: &Built, at: &[(f64, f64)], exact: &[(f64, f64)]) -> Vec<String> {
    let of = |at: &[(f64, f64)]| -> Vec<f64> {
        let y = variables(built, at.iter().copied().enumerate());
        let rows = (0..built.rows.len()).map(|row| built.program.rows.value(row, &y));
        rows.chain(built.program.sums.iter().map(|terms| terms.log_sum_exp(&y))).collect()
    };
    let labels = built.rows.iter().chain(&built.sums);
    labels
        .zip(of(at).into_iter().zip(of(exact)))
        .filter(|(label, (value, _))| label.kind.is_limit() && !matches!(label.place, Place::Zone(_)) && *value > KEPT)
        .map(|(label, (value, before))| {
            let name = label.name(case);
            told(before, &name.constraint, &name.zone, value)
        })
        .collect()
}

/// The same of the spread of the deflections, which is no limit of one zone.
fn spread_passed(case: &Case, job: &Job, at: &[(f64, f64)], exact: &[(f64, f64)]) -> Option<String> {
    let limit = job.limits.as_ref()?.deflection_spread_ratio_max?;
    let beyond = |at: &[(f64, f64)]| {
        let of = |(zone, at): (usize, &(f64, f64))| assess::zone_outcome(case, job, zone, *at).deflection_um;
        let deflections: Vec<Option<f64>> = at.iter().enumerate().map(of).collect();
        Some((assess::spread(deflections.iter().copied())? / limit).ln())
    };
    let (value, before) = (beyond(at)?, beyond(exact)?);
    (value > KEPT).then(|| told(before, "deflection_spread", "part", value))
}

/// A limit that the words pass by so much in logarithms, and the schedule before them.
fn told(before: f64, constraint: &str, place: &str, value: f64) -> String {
    let who = if before > SOLVED { "the schedule passes" } else { "rounded words pass" };
    format!("{who} {constraint} of {place} by {:.2} percent", 100.0 * value.exp_m1())
}

/// From a schedule to the words of its program.
struct Rounding<'a> {
    job: &'a Job,
    built: &'a Built,
    zones: &'a [ZoneOutcome],
}

impl Rounding<'_> {
    fn metres_per_min(&self, zone: &ZoneOutcome, speed: f64) -> f64 {
        if is_surface(self.job) { speed } else { speed * std::f64::consts::PI * zone.diameter_mm / 1000.0 }
    }

    fn keeps(&self, i: usize, feed: f64, speed: f64) -> bool {
        let at = (self.metres_per_min(&self.zones[i], speed).ln(), feed.ln());
        holds(self.built, i, at, KEPT)
    }

    fn exact_speed(&self, i: usize) -> f64 {
        let zone = &self.zones[i];
        if is_surface(self.job) { zone.speed_m_per_min } else { zone.spindle_speed_rpm.min(spindle_rpm(self.job).1) }
    }

    fn lower(&self, i: usize) -> f64 {
        (self.exact_speed(i) + 1e-9).floor().max(1.0)
    }

    fn upper(&self, i: usize) -> f64 {
        (self.exact_speed(i) - 1e-9).ceil().max(1.0)
    }

    /// A speed beside the exact one that keeps all limits of a zone with this feed: not always the lower one, since
    /// the passive force grows when the speed falls.
    fn speed(&self, i: usize, feed: f64, all_upper: Option<bool>) -> Option<f64> {
        let tries = match all_upper {
            Some(true) => vec![self.upper(i)],
            Some(false) => vec![self.lower(i)],
            None => vec![self.upper(i), self.lower(i)],
        };
        tries.into_iter().find(|&speed| self.keeps(i, feed, speed))
    }

    /// Feeds rounded down and speeds to a neighbouring whole number that keep all limits; where none does, one more
    /// step of feed down. A speed or a feed that is one for all zones stays one, and a feed that is given stays given.
    fn words(&self) -> Vec<Words> {
        let feeds: Vec<f64> = self.zones.iter().map(|zone| down(zone.feed_mm_per_rev)).collect();
        let (feed_mode, speed_mode) = modes(self.job);
        let shared = matches!(speed_mode, SpeedMode::ConstantSpeed | SpeedMode::ConstantRpm);
        let all_upper = shared.then(|| (0..feeds.len()).all(|i| self.keeps(i, feeds[i], self.upper(i))));
        let all_keep = |feed: f64| (0..feeds.len()).all(|i| self.speed(i, feed, all_upper).is_some());
        let common = feeds.iter().copied().fold(f64::INFINITY, f64::min);
        let tried = |i: usize| match feed_mode {
            FeedMode::PerZone => vec![feeds[i], slower(feeds[i])],
            FeedMode::Constant if !all_keep(common) && all_keep(slower(common)) => vec![slower(common)],
            FeedMode::Constant | FeedMode::Fixed => vec![common],
        };
        let of = |i: usize| {
            let tried = tried(i);
            let found = tried.iter().find_map(|&feed| Some((feed, self.speed(i, feed, all_upper)?)));
            let (feed, speed) = found.unwrap_or((tried[0], self.lower(i)));
            let zone = &self.zones[i];
            let before = (zone.speed_m_per_min.ln(), zone.feed_mm_per_rev.ln());
            let limits = if found.is_some() {
                Limits::Kept
            } else if holds(self.built, i, before, SOLVED) {
                Limits::LostByRounding
            } else {
                Limits::LostBefore
            };
            Words { feed_mm_per_rev: feed, speed, limits }
        };
        (0..self.zones.len()).map(of).collect()
    }
}

/// The feed at most as large in whole steps; one that lies a hair below a step, as far as limits are kept, is that step.
fn down(feed: f64) -> f64 {
    let step = step_of(feed);
    round_to_increment((feed / step * (1.0 + 0.9 * KEPT)).floor().max(1.0) * step, step)
}

/// One step less.
fn slower(feed: f64) -> f64 {
    let step = step_of(feed);
    round_to_increment((feed - step).max(step), step)
}

#[cfg(test)]
#[allow(clippy::float_cmp)] // steps are met to the last digit
mod tests {
    use super::*;

    #[test]
    fn a_feed_a_hair_below_a_step_is_that_step_and_a_small_one_has_finer_steps() {
        let cases =
            [(0.399_999_999_999_9, 0.4), (0.3999, 0.399), (0.0005, 0.0005), (0.00057, 0.0005), (0.01234, 0.0123)];
        for (feed, expected) in cases {
            assert_eq!(down(feed), expected, "{feed}");
        }
        assert_eq!([slower(0.4), slower(0.0005), slower(0.0001)], [0.399, 0.0004, 0.0001]);
    }
}
