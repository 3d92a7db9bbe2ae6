//! Better speeds: how deep each may cut under all limits together, ranked by removal rate, the best solved again as printed.

use rayon::prelude::*;

use crate::calculator::{Failure, Message, checkpoint};
use crate::fixture_stability::power_kw;

use super::super::job::{Case, CutLimits, Held};
use super::super::model::{Cut, Mode, Rotation, Structure, statics};
use super::clamping::is_enough;
use super::lobes::{Row, rotation_at};
use super::output::{MillingState, Outcome, PocketLimit, SpeedCurve, SpeedPocket, SpeedStatus};
use super::{MM3_PER_CM3, MODEL_ENDS, N_MM_PER_N_M, Study, UM_PER_MM, surface};

/// A cut has to stay stable where the speed is off by so much, and every natural frequency.
const SPEED_OFF: f64 = 0.01;
const FREQUENCY_OFF: f64 = 0.02;
/// Modes whose frequencies are tried in all combinations; of more all together and each by itself.
const COMBINED: usize = 3;
/// Peaks that are looked at closely, and how many are told.
const LOOKED_AT: usize = 6;
const TOLD: usize = 3;
/// Halvings of a depth that does not hold.
const HALVINGS: u32 = 7;
/// Removal rates closer than this are one: a spindle at its power.
const SAME: f64 = 1e-3;
/// A speed is told where it removes so much more than the working point.
const GAIN: f64 = 1.01;

/// How deep one speed may cut, and what binds.
#[derive(Debug, Clone, Copy)]
struct Depth {
    depth_mm: f64,
    binds: PocketLimit,
}

/// Every speed with the depth that it allows, and the best of them.
pub(super) fn speeds(
    study: &Study<'_>,
    rows: &[Row],
    outcome: &Outcome,
) -> Result<(Vec<SpeedPocket>, SpeedCurve), Failure> {
    study.monitor.progress(0.8, Message::new("stage_speeds"));
    let depths: Vec<Option<Depth>> = (0..rows.len()).map(|k| estimate(study, rows, k)).collect();
    let held: Result<Vec<Option<Depth>>, Failure> = rows
        .par_iter()
        .zip(&depths)
        .map(|(row, depth)| match depth {
            Some(depth) => surface_holds(study, row.spindle_rpm, *depth).map(Some),
            None => Ok(None),
        })
        .collect();
    let depths = held?;
    let removal = |k: usize| depths[k].map_or(0.0, |depth| removal(study, rows[k].spindle_rpm, depth.depth_mm));
    let rates: Vec<f64> = (0..rows.len()).map(removal).collect();
    let curve = SpeedCurve {
        spindle_speed_rpm: rows.iter().map(|row| row.spindle_rpm).collect(),
        depth_mm: depths.iter().map(|depth| depth.map(|depth| depth.depth_mm)).collect(),
        binds: depths.iter().map(|depth| depth.map(|depth| depth.binds)).collect(),
        removal_rate_cm3_per_min: depths.iter().zip(&rates).map(|(depth, rate)| depth.map(|_| *rate)).collect(),
    };
    let working = outcome.verdict.as_ref().is_some_and(|verdict| verdict.state == MillingState::Stable);
    let least = if working { GAIN * outcome.engagement.removal_rate_cm3_per_min } else { 0.0 };
    let mut found: Vec<SpeedPocket> = Vec::new();
    let speeds: Vec<f64> = rows.iter().map(|row| row.spindle_rpm).collect();
    for k in apart(&speeds, peaks(&rates)).into_iter().take(LOOKED_AT) {
        checkpoint(study.monitor)?;
        let Some(depth) = depths[k] else { continue };
        let pocket = tried(study, printed_speed(rows[k].spindle_rpm), depth)?;
        found.extend(pocket.filter(|pocket| pocket.removal_rate_cm3_per_min > least));
    }
    Ok((ranked(found), curve))
}

/// The best by removal rate; of equal ones the shallower cut pushes less.
pub(super) fn ranked(mut found: Vec<SpeedPocket>) -> Vec<SpeedPocket> {
    found.sort_by(|a, b| {
        let (p, q) = (a.removal_rate_cm3_per_min, b.removal_rate_cm3_per_min);
        if (p / q - 1.0).abs() < SAME { a.depth_mm.total_cmp(&b.depth_mm) } else { q.total_cmp(&p) }
    });
    found.truncate(TOLD);
    found
}

/// The best speeds with each of the other widths that may be cut (`milling/7.26`).
pub(super) fn of_other_widths(study: &Study<'_>, outcome: &Outcome) -> Result<Vec<SpeedPocket>, Failure> {
    let mut found = Vec::new();
    for job in study.job.with_other_widths() {
        checkpoint(study.monitor)?;
        let case = Case::of(&job).ok_or_else(|| Failure::Internal("a width that the check refuses".to_owned()))?;
        let other = Study::new(&job, case, Vec::new(), study.monitor)?;
        let rows = super::lobes::rows(&other)?;
        found.extend(speeds(&other, &rows, outcome)?.0);
    }
    Ok(found)
}

fn removal(study: &Study<'_>, spindle_rpm: f64, depth_mm: f64) -> f64 {
    let milling = &study.case.milling;
    study.case.width_mm * depth_mm * milling.feed_mm * milling.teeth.len() as f64 * spindle_rpm / MM3_PER_CM3
}

/// Places of the interior maxima of a curve, the highest first; of a level stretch its last place. A range end is no peak.
fn peaks(rates: &[f64]) -> Vec<usize> {
    let above = |a: f64, b: f64| a > b * (1.0 + SAME);
    let mut found = Vec::new();
    let mut k = 1;
    while k + 1 < rates.len() {
        let mut end = k;
        while end + 1 < rates.len() && (rates[end + 1] / rates[k] - 1.0).abs() <= SAME {
            end += 1;
        }
        if rates[k] > 0.0 && above(rates[k], rates[k - 1]) && end + 1 < rates.len() && above(rates[k], rates[end + 1]) {
            found.push(end);
        }
        k = end + 1;
    }
    found.sort_by(|a, b| rates[*b].total_cmp(&rates[*a]));
    found
}

/// Peaks that are not within what a speed may be off of a higher one: those belong to one pocket.
fn apart(speeds_rpm: &[f64], peaks: Vec<usize>) -> Vec<usize> {
    let mut kept: Vec<usize> = Vec::new();
    for k in peaks {
        let is_apart =
            |other: &usize| (speeds_rpm[k] / speeds_rpm[*other] - 1.0).abs() > 2.0 * (SPEED_OFF + FREQUENCY_OFF);
        if kept.iter().all(is_apart) {
            kept.push(k);
        }
    }
    kept
}

/// The depth of a speed by what is known already: neighbours stand for a speed or frequencies that are off.
fn estimate(study: &Study<'_>, rows: &[Row], k: usize) -> Option<Depth> {
    let here = &rows[k];
    if here.status != SpeedStatus::Answered {
        return None;
    }
    let off = SPEED_OFF + FREQUENCY_OFF;
    let near =
        |row: &&Row| (row.spindle_rpm / here.spindle_rpm - 1.0).abs() <= off && row.status == SpeedStatus::Answered;
    let around = rows.iter().filter(near).filter_map(Row::limit_mm).fold(f64::INFINITY, f64::min);
    let margin = 1.0 - 0.01 * study.job.limits.margin_percent;
    let [power, torque] = study.drive_depths_mm(here.spindle_rpm);
    let bounds = [
        (here.limit_mm().map(|limit| margin * limit), PocketLimit::Chatter),
        (around.is_finite().then_some(around), PocketLimit::Robustness),
        (power, PocketLimit::Power),
        (torque, PocketLimit::Torque),
        (Some(study.examined_mm), PocketLimit::Examined),
    ];
    let least =
        bounds.into_iter().filter_map(|(depth, binds)| Some((depth?, binds))).min_by(|a, b| a.0.total_cmp(&b.0))?;
    (least.0 > 0.0).then_some(Depth { depth_mm: least.0, binds: least.1 })
}

/// The same kept within clamp force, motion, surface error and roughness, where they are limited.
fn surface_holds(study: &Study<'_>, spindle_rpm: f64, depth: Depth) -> Result<Depth, Failure> {
    if !is_limited(study) {
        return Ok(depth);
    }
    let Ok(rotation) = rotation_at(study, spindle_rpm) else { return Ok(depth) };
    let Some(first) = out(study, rotation, depth.depth_mm)? else { return Ok(depth) };
    let (mut low, mut high, mut binds) = (0.0, depth.depth_mm, first);
    for _ in 0..HALVINGS {
        let middle = 0.5 * (low + high);
        match out(study, rotation, middle)? {
            Some(what) => (high, binds) = (middle, what),
            None => low = middle,
        }
    }
    Ok(Depth { depth_mm: low, binds })
}

/// The clamping with its force at hand.
fn clamped<'a>(study: &'a Study<'_>) -> Option<(&'a Held, f64)> {
    study.held.as_ref().and_then(|held| Some((held, held.clamp_force_n?)))
}

/// Whether the clamp force, motion or surface limit a depth.
fn is_limited(study: &Study<'_>) -> bool {
    clamped(study).is_some() || limits_motion(&study.job.limits)
}

/// Whether motion or surface do.
fn limits_motion(limits: &CutLimits) -> bool {
    limits.amplitude_max_um.or(limits.surface_error_max_um).or(limits.roughness_max_um).is_some()
}

/// What passes its limit at a depth.
fn out(study: &Study<'_>, rotation: Rotation, depth_mm: f64) -> Result<Option<PocketLimit>, Failure> {
    if let Some((held, force_n)) = clamped(study) {
        let asked = study.clamp_asked_n(held, &Cut { rotation, depth_mm, ..study.cut() })?;
        if !asked.is_some_and(|asked| is_enough(force_n, asked)) {
            return Ok(Some(PocketLimit::ClampForce));
        }
    }
    let limits = &study.job.limits;
    if !limits_motion(limits) {
        return Ok(None);
    }
    let Some(left) = left(study, rotation, depth_mm)? else { return Ok(Some(PocketLimit::Amplitude)) };
    let passes = |value: f64, limit: Option<f64>| limit.is_some_and(|limit| value > limit);
    Ok(if passes(left.peak_to_peak_um, limits.amplitude_max_um) {
        Some(PocketLimit::Amplitude)
    } else if passes(left.surface_error_um.unwrap_or(0.0), limits.surface_error_max_um) {
        Some(PocketLimit::SurfaceError)
    } else if passes(left.roughness_rz_um.unwrap_or(0.0), limits.roughness_max_um) {
        Some(PocketLimit::Roughness)
    } else {
        None
    })
}

/// What a cut leaves.
#[allow(clippy::struct_field_names)] // each has its unit
struct Left {
    peak_to_peak_um: f64,
    surface_error_um: Option<f64>,
    roughness_rz_um: Option<f64>,
}

fn left(study: &Study<'_>, rotation: Rotation, depth_mm: f64) -> Result<Option<Left>, Failure> {
    let cut = Cut { rotation, depth_mm, ..study.cut() };
    let Some(forced) = study.orders.forced(&cut, study.monitor)? else { return Ok(None) };
    let swing = forced.swing_mm();
    if swing > MODEL_ENDS * cut.milling.radius_mm {
        return Ok(None);
    }
    let walls: Vec<_> = forced.walls().into_iter().map(|wall| surface(&forced, wall, depth_mm)).collect();
    let largest = |of: &dyn Fn(&super::output::WallSurface) -> f64| walls.iter().map(of).reduce(f64::max);
    Ok(Some(Left {
        peak_to_peak_um: UM_PER_MM * swing,
        surface_error_um: largest(&|wall| wall.largest_um()),
        roughness_rz_um: largest(&|wall| wall.roughness_rz_um),
    }))
}

/// A speed as it is printed and set: four digits, ten revolutions from a thousand on.
fn printed_speed(spindle_rpm: f64) -> f64 {
    let step = 10_f64.powf((spindle_rpm.log10().floor() - 3.0).max(-1.0));
    (spindle_rpm / step).round() * step
}

/// A depth as it is printed: three digits, never more than it was.
fn printed_depth(depth_mm: f64) -> f64 {
    let step = 10_f64.powf(depth_mm.log10().floor() - 2.0);
    (depth_mm / step * (1.0 + 1e-12)).floor() * step
}

/// A pocket solved as it is printed; `None` where no depth holds.
fn tried(study: &Study<'_>, spindle_rpm: f64, depth: Depth) -> Result<Option<SpeedPocket>, Failure> {
    let Ok(rotation) = rotation_at(study, spindle_rpm) else { return Ok(None) };
    let all = corners(&study.case.structure);
    let mut depth = depth;
    let holds = |depth_mm: f64| -> Result<Option<PocketLimit>, Failure> {
        if !stays_stable(study, spindle_rpm, depth_mm, &all)? {
            return Ok(Some(PocketLimit::Robustness));
        }
        out_of_limits(study, rotation, depth_mm)
    };
    let mut printed = printed_depth(depth.depth_mm);
    if let Some(what) = holds(printed)? {
        let (mut low, mut high, mut binds) = (0.0, printed, what);
        for _ in 0..HALVINGS {
            let middle = printed_depth(0.5 * (low + high));
            match holds(middle)? {
                Some(what) => (high, binds) = (middle, what),
                None => low = middle,
            }
        }
        if low <= 0.0 {
            return Ok(None);
        }
        (printed, depth) = (low, Depth { depth_mm: low, binds });
    }
    let cut = Cut { rotation, depth_mm: printed, ..study.cut() };
    let Some((found, error)) = study.orders.with_error(&cut, study.monitor)? else { return Ok(None) };
    let limit = super::lobes::first_mm(study, rotation)?;
    if found.modulus() + error >= 1.0 {
        return Ok(None);
    }
    // Where teeth stand out, about the motion that their chips force, too.
    if let Some(milling) = study.orders.about(&cut, study.monitor)? {
        let found = study.orders.with_error(&Cut { milling: &milling, ..cut }, study.monitor)?;
        if found.is_none_or(|(found, error)| found.modulus() + error >= 1.0) {
            return Ok(None);
        }
    }
    let torque = statics(&study.case.milling, printed, study.monitor)?.torque_mean_n_mm / N_MM_PER_N_M;
    let efficiency = study.job.spindle.as_ref().map_or(1.0, |spindle| spindle.efficiency);
    let left = left(study, rotation, printed)?;
    Ok(Some(SpeedPocket {
        spindle_speed_rpm: spindle_rpm,
        depth_mm: printed,
        width_mm: study.case.width_mm,
        removal_rate_cm3_per_min: removal(study, spindle_rpm, printed),
        binds: depth.binds,
        chatter_depth_mm: limit,
        per_tooth: super::growth::per_tooth(&found, study.teeth_per_period(&rotation)),
        motor_power_kw: power_kw(torque, spindle_rpm) / efficiency,
        torque_n_m: torque,
        peak_to_peak_um: left.as_ref().map(|left| left.peak_to_peak_um),
        surface_error_um: left.as_ref().and_then(|left| left.surface_error_um),
    }))
}

/// Power, torque, clamp force and surface at a printed depth.
fn out_of_limits(study: &Study<'_>, rotation: Rotation, depth_mm: f64) -> Result<Option<PocketLimit>, Failure> {
    let [power, torque] = study.drive_depths_mm(rotation.spindle_rpm);
    if power.is_some_and(|limit| depth_mm > limit) {
        return Ok(Some(PocketLimit::Power));
    }
    if torque.is_some_and(|limit| depth_mm > limit) {
        return Ok(Some(PocketLimit::Torque));
    }
    if is_limited(study) { out(study, rotation, depth_mm) } else { Ok(None) }
}

/// Structures whose frequencies are off: in all combinations, or together and one by one where there are many modes.
fn corners(structure: &Structure) -> Vec<Structure> {
    let count = structure.modes.len();
    let signs: Vec<Vec<f64>> = if count <= COMBINED {
        (0..1_usize << count)
            .map(|bits| (0..count).map(|k| if bits >> k & 1 == 1 { 1.0 } else { -1.0 }).collect())
            .collect()
    } else {
        let one = |k: usize, sign: f64| (0..count).map(|j| if j == k { sign } else { 0.0 }).collect::<Vec<f64>>();
        let mut all = vec![vec![1.0; count], vec![-1.0; count]];
        all.extend((0..count).flat_map(|k| [one(k, 1.0), one(k, -1.0)]));
        all
    };
    let moved = |mode: &Mode, sign: f64| {
        let factor = 1.0 + FREQUENCY_OFF * sign;
        // Of a mode that is stiffer, not lighter.
        Mode { frequency_hz: mode.frequency_hz * factor, ..*mode }
    };
    signs
        .into_iter()
        .map(|signs| Structure::new(structure.modes.iter().zip(signs).map(|(mode, sign)| moved(mode, sign)).collect()))
        .collect()
}

/// Whether a depth is stable at every corner of speed and frequencies.
fn stays_stable(study: &Study<'_>, spindle_rpm: f64, depth_mm: f64, all: &[Structure]) -> Result<bool, Failure> {
    for factor in [1.0 - SPEED_OFF, 1.0, 1.0 + SPEED_OFF] {
        let Ok(rotation) = rotation_at(study, spindle_rpm * factor) else { return Ok(false) };
        for structure in std::iter::once(&study.case.structure).chain(all) {
            let cut = Cut { milling: &study.case.milling, structure, rotation, depth_mm };
            let found = study.orders.on_map(&cut, study.monitor)?;
            if found.is_none_or(|found| found.modulus() >= 1.0) {
                return Ok(false);
            }
        }
    }
    Ok(true)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_end_of_the_range_is_no_peak_and_a_level_stretch_is_one() {
        assert_eq!(peaks(&[1.0, 2.0, 3.0]), Vec::<usize>::new());
        assert_eq!(peaks(&[3.0, 2.0, 1.0]), Vec::<usize>::new());
        assert_eq!(peaks(&[1.0, 3.0, 2.0, 5.0, 4.0]), vec![3, 1]);
        assert_eq!(peaks(&[1.0, 3.0, 3.0, 3.0, 2.0]), vec![3]);
        // A spindle at its power up to the end of the range.
        assert_eq!(peaks(&[1.0, 3.0, 3.0, 3.0]), Vec::<usize>::new());
        assert_eq!(apart(&[100.0, 104.0, 120.0], vec![1, 0, 2]), vec![1, 2]);
    }

    #[test]
    fn what_is_printed_is_never_deeper() {
        for depth in [4.4567, 0.098_77, 12.0, 1.0, 9.999] {
            let printed = printed_depth(depth);
            assert!(printed <= depth * (1.0 + 1e-9) && printed > 0.989 * depth, "{depth} {printed}");
        }
        assert!((printed_speed(14_483.7) - 14_480.0).abs() < 1e-9 && (printed_speed(853.27) - 853.3).abs() < 1e-9);
    }
}
