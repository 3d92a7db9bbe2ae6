//! What a job is expected to cost.

use crate::calculator::{Calculator, Cost};
use crate::certainty::Quantity;
use crate::receptance_fit::ReceptanceFit;

use super::answer::conformance::draws;
use super::answer::lobes::{CLAMP_MAP_DEPTHS, CLAMP_MAP_SPEEDS};
use super::job::{Asked, Case, Job, PartClamping, Yielding, clamped, guessed, range_rpm, uncertainties};
use super::model::{self, MOST_OSCILLATIONS};

/// A multiplier: of an element whose force acts in two directions, ms; its Krylov spaces grow with the oscillations of a period, and
/// from some hundreds on they are restarted. Measured with 1 to 2000 oscillations.
const ELEMENT_MS: f64 = 0.03;
const SPACES_GROW: f64 = 60.0;
const RESTARTED: f64 = 800.0;
/// Multipliers that the search for the motion takes about which a cutter with run-out is looked at.
const ABOUT: f64 = 40.0;
/// Better speeds that are tried about it at most.
const TRIED: f64 = 3.0;
/// What is made whatever the cut.
const ANY_MS: f64 = 2.0;
/// Multipliers that a search over the depth takes on average, and the share of it that the first crossing alone takes.
const PER_SEARCH: f64 = 40.0;
const FIRST_ALONE: f64 = 0.5;
/// The accuracy of maps takes half; refinement of a boundary adds to its speeds.
const ON_MAP: f64 = 0.5;
const REFINED: f64 = 1.8;
/// Multipliers that the trials of pockets take.
const TRIALS: f64 = 1500.0;

/// The limit by measured lines.
const DIRECT_MS: f64 = 150.0;

/// A search for the limit of a slow cut with one mode, what a pair of modes adds, and its motion.
const SLOW_MS: f64 = 60.0;
const SLOW_PAIR_MS: f64 = 10.0;
const SLOW_MOTION_MS: f64 = 60.0;

/// Clamping: loads of a period at one place of the cut, on a dozen contacts; of a dozen times as many where the law bends.
const CLAMPING_MS: f64 = 15.0;
/// Share of it that loads take which go with the force of the cut.
const RIGID_LOADS: f64 = 0.01;
/// Halvings of the depth at which a clamp force gives out.
const CLAMP_DEPTHS: f64 = 8.0;

/// Elements of a period: by oscillations, by breaks of the edges, and by what delays bring back.
fn elements(case: &Case, rotation: &model::Rotation) -> f64 {
    let (milling, turn) = (&case.milling, case.milling.period_rad());
    let is_alike = milling.teeth_are_alike();
    let teeth = milling.teeth.len() as f64;
    let of_edge = 4.0 + 8.0 * f64::from(u8::from(milling.law.bends()));
    let breaks = if is_alike { of_edge } else { 2.0 * of_edge * teeth };
    // With run-out every tooth may meet what any other left.
    let run_out = if milling.has_run_out() { 0.8 * teeth * teeth } else { 1.0 };
    let periods = if rotation.varies() { rotation.rotation_rad(rotation.period_s(turn)) / turn } else { 1.0 };
    2.0 * case.oscillations_at(rotation).min(MOST_OSCILLATIONS) + periods * (breaks * run_out + turn / 0.8)
}

/// Of one multiplier to the accuracy of maps, at a speed.
pub(super) fn on_map_ms(case: &Case, spindle_rpm: f64) -> f64 {
    case.at_speed(spindle_rpm).map_or(0.0, |rotation| ON_MAP * point_ms(case, &rotation))
}

/// Of one multiplier.
fn point_ms(case: &Case, rotation: &model::Rotation) -> f64 {
    if (model::Cut { rotation: *rotation, ..case.cut() }).is_slow() {
        return slow_ms(case) / PER_SEARCH;
    }
    by_elements_ms(case, rotation)
}

/// The same by elements in time.
fn by_elements_ms(case: &Case, rotation: &model::Rotation) -> f64 {
    let oscillations = case.oscillations_at(rotation).min(MOST_OSCILLATIONS);
    let directions = (0.5 * case.structure.basis.len() as f64).max(0.5).powf(1.5);
    let spaces = (1.0 + oscillations / SPACES_GROW) * (oscillations / RESTARTED).max(1.0).powf(1.3);
    // An edge whose law bends is summed on points, tooth by tooth.
    let milling = &case.milling;
    let is_summed = milling.law.bends() && milling.teeth.iter().any(|tooth| tooth.lag_rad_per_mm.abs() > 0.0);
    let summed = if is_summed || !milling.has_one_helix() { 2.0 } else { 1.0 };
    0.05 + ELEMENT_MS * directions * summed * elements(case, rotation) * spaces
}

/// Of a search for the limit of a slow cut.
fn slow_ms(case: &Case) -> f64 {
    let modes = case.structure.modes.len() as f64;
    SLOW_MS + SLOW_PAIR_MS * modes * modes
}

/// Expected work.
pub(super) fn cost(job: &Job) -> Cost {
    if !job.is_measured() {
        return cost_of_modes(job);
    }
    let Some(with_modes) = guessed(job) else { return Cost { ms: 1.0, bytes: 100_000, driver: "/tool" } };
    let mut cost = cost_of_modes(&with_modes);
    for (.., yielding) in job.sides() {
        if let Yielding::Receptances(of) = yielding {
            let fit = ReceptanceFit::cost(&of.fit_job());
            (cost.ms, cost.bytes) = (cost.ms + fit.ms, cost.bytes + fit.bytes);
        }
    }
    if job.asks(Asked::Intervals) {
        cost.ms += DIRECT_MS;
    }
    cost
}

/// The same of a job whose modes are known.
fn cost_of_modes(job: &Job) -> Cost {
    let Some(case) = Case::of(job) else { return Cost { ms: 1.0, bytes: 100_000, driver: "/cut" } };
    let is_slow = case.cut().is_slow();
    // In place of a multiplier and of a search for the limit stands one search.
    let here = point_ms(&case, &case.rotation);
    let directions = case.structure.basis.len() as f64;
    let mut parts = vec![(ANY_MS, "/cut/spindle_speed_rpm")];
    let mut bytes = 500_000.0 + 4e4 * elements(&case, &case.rotation) * directions;
    if job.asks(Asked::Verdict) {
        let searches = if is_slow { PER_SEARCH } else { 4.0 };
        parts.push((searches * here, "/cut/spindle_speed_rpm"));
    }
    let is_about = case.milling.has_run_out()
        && matches!(case.milling.about, model::About::ForcedMotion)
        && !case.rotation.varies()
        && !is_slow;
    let about_ms = if is_about { ABOUT * here } else { 0.0 };
    if job.asks(Asked::Verdict) || job.asks(Asked::Motion) {
        parts.push((about_ms, "/about"));
    }
    if job.asks(Asked::Motion) {
        let repeats = case.milling.teeth_are_alike() && !case.rotation.varies();
        let solved = if repeats { 0.5 } else { 2.0 } * by_elements_ms(&case, &case.rotation);
        let is_closed = is_slow && case.oscillations() > MOST_OSCILLATIONS;
        parts.push((if is_closed { SLOW_MOTION_MS } else { solved }, "/cut/spindle_speed_rpm"));
    }
    let clamping = job.clamping.as_ref().filter(|_| job.asks(Asked::Clamping));
    let places = |of: &PartClamping| of.places_mm(job.cut.feed_direction_deg).map_or(1, |places| places.len()) as f64;
    let clamping_ms = clamping.map_or(0.0, |of| places(of) * CLAMPING_MS + 0.5 * here);
    if clamping.is_some() {
        parts.push((clamping_ms, "/clamping/stations"));
    }
    let steps = (f64::from(job.limits.depths) / 24.0).max(1.0);
    if job.asks(Asked::Intervals) {
        let others = 2.0 + directions + 2.0 * f64::from(u8::from(case.milling.law.bends()));
        parts.push(((1.0 + FIRST_ALONE * others) * steps * PER_SEARCH * here, "/limits/depths"));
    }
    if job.asks(Asked::Certainty) {
        parts.push((certainty_ms(job, &case), "/analyses"));
    }
    if job.asks(Asked::Proposals) {
        // Some dozen cutters over a turn, whose elements are those of all teeth.
        let teeth = case.milling.teeth.len() as f64;
        parts.push((30.0 * FIRST_ALONE * PER_SEARCH * ON_MAP * here * teeth, "/cutter/teeth"));
    }
    if job.asks(Asked::Lobes) || job.asks(Asked::Speeds) {
        let (from, to) = range_rpm(job, case.rotation.spindle_rpm);
        // Slow speeds take longest; those that are not answered cost nothing.
        let at = |speed: f64| {
            let rotation = case.at_speed(speed).filter(|rotation| case.oscillations_at(rotation) <= MOST_OSCILLATIONS);
            rotation.map_or(0.0, |rotation| ON_MAP * point_ms(&case, &rotation))
        };
        let mean = (0..9).map(|k| at(from + (to - from) * f64::from(k) / 8.0)).sum::<f64>() / 9.0;
        let speeds = f64::from(job.lobes.speeds);
        parts.push((REFINED * speeds * steps * PER_SEARCH * mean, "/lobes/speeds"));
        if job.asks(Asked::Speeds) {
            parts.push((TRIALS * mean + TRIED * about_ms, "/lobes/speeds"));
            let others = job.cut.widths_mm.len() as f64;
            parts.push((others * (TRIALS + REFINED * speeds * steps * PER_SEARCH) * mean, "/cut/widths_mm"));
            if clamping.is_some_and(|of| of.clamp_force().is_some()) {
                parts.push((REFINED * speeds * CLAMP_DEPTHS * 0.2 * clamping_ms, "/clamping/stations"));
            }
        }
        if job.asks(Asked::Lobes) && job.lobes.map {
            parts.push((speeds * f64::from(job.lobes.depths) * mean, "/lobes/depths"));
            if clamping.is_some() {
                let (across, down) =
                    (speeds.min(f64::from(CLAMP_MAP_SPEEDS)), f64::from(job.lobes.depths.min(CLAMP_MAP_DEPTHS)));
                parts.push((across * down * (mean + 0.2 * clamping_ms), "/clamping/stations"));
            }
            bytes += 40.0 * speeds * f64::from(job.lobes.depths);
        }
    }
    let ms = parts.iter().map(|(ms, _)| ms).sum();
    let driver = parts.iter().max_by(|a, b| a.0.total_cmp(&b.0)).map_or("/cut", |(_, driver)| driver);
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    Cost { ms, bytes: bytes as u64, driver }
}

/// Of the probability: draws of the real model, each with its multiplier, its motion and its loads as far as they are limited.
fn certainty_ms(job: &Job, case: &Case) -> f64 {
    let Ok(of) = uncertainties(job, &case.structure, &[]) else { return 0.0 };
    let mut within: Vec<&str> = of.within.iter().map(|one| one.of.quantity.name()).collect();
    within.sort_unstable();
    within.dedup();
    let names = of.named().len() + within.len();
    let limits = &job.limits;
    let moves = [limits.amplitude_max_um, limits.surface_error_max_um, limits.roughness_max_um];
    let motion_ms = if moves.iter().any(Option::is_some) { by_elements_ms(case, &case.rotation) } else { 0.0 };
    let work_yields = case.structure.modes.iter().any(|mode| mode.side == model::Side::Work);
    let loads = if work_yields || case.milling.has_run_out() { 1.0 } else { RIGID_LOADS };
    let clamping_ms = clamped(job).map_or(0.0, |(of, _)| {
        let places = of.places_mm(job.cut.feed_direction_deg).map_or(1, |places| places.len());
        places as f64 * CLAMPING_MS * loads
    });
    draws([of.count(), of.within.len()], names) * (ON_MAP * point_ms(case, &case.rotation) + motion_ms + clamping_ms)
}
