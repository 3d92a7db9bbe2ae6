//! What a job will take.

use crate::calculator::Cost;

use super::acting::Case;
use super::input::{Analysis, FixtureJob};
use super::probable_depths::{BOUNDARIES, LEAST_SPEEDS, scales};
use super::simulate;

/// Oscillations in a tooth period from which on one Krylov space does not suffice for most multipliers, how their time then grows
/// with them, and how much it is at most: that of all restarts. Measured with 20 to 540 oscillations.
const ONE_SPACE: f64 = 120.0;
const RESTARTS_GROW: f64 = 3.5;
const ALL_RESTARTS: f64 = 300.0;
/// Of uneven teeth: a forced motion per tooth squared and 50 points of the history of a multiplier, ms. Measured with 8 to 120
/// teeth.
const UNEVEN_MS: f64 = 0.4 / 50.0;
/// Bytes that a multiplier holds per point of its history: the vectors of its space, and what the map is made of.
const POINT_BYTES: f64 = 700.0;
/// Bytes of a piece of the forced motion, of a kept step, and of a place of the arc.
const PIECE_BYTES: f64 = 250.0;
const STEP_BYTES: f64 = 100.0;
const PLACE_BYTES: f64 = 24.0;
/// Multipliers of a speed of a boundary.
const OF_BOUNDARY: f64 = 45.0;
/// Vises that are tried for a probability; probabilities that are found for the analysis `certainty`.
const VISES: f64 = 300.0;
const PROBABILITIES: f64 = 30.0;
/// How much longer a vise takes whose forced motion is found by Newton's method, in multipliers.
const NOT_LINEAR: f64 = 20.0;
/// What a probability may take that nobody asked for, ms.
const UNASKED_MS: f64 = 50.0;

/// What one working point takes.
struct Points<'a> {
    case: &'a Case,
    highest_hz: f64,
}

impl<'a> Points<'a> {
    fn new(case: &'a Case) -> Self {
        Self { case, highest_hz: case.holding.modes().last().map_or(0.0, |mode| mode.natural_hz) }
    }

    fn oscillations(&self, spindle_rpm: f64) -> f64 {
        self.highest_hz * self.case.cutting.tooth_period_s(spindle_rpm)
    }

    fn history(&self, spindle_rpm: f64) -> f64 {
        24.0 + 14.0 * self.oscillations(spindle_rpm)
    }

    /// A multiplier costs about 1 us per point of its history and 10 us besides, some hundred times as much where the cutter turns
    /// so slowly that hundreds of oscillations go into a tooth period.
    fn multiplier_ms(&self, spindle_rpm: f64) -> f64 {
        let restarted = (self.oscillations(spindle_rpm) / ONE_SPACE).powf(RESTARTS_GROW);
        let of_phases = 0.7 + 0.3 * self.case.cutting.phases() as f64;
        let per_point = 0.0006 * of_phases * restarted.clamp(1.0, ALL_RESTARTS);
        (0.008 + per_point * self.history(spindle_rpm)) * (0.5 + 0.25 * self.case.holding.states() as f64)
    }

    /// A probability at the working point.
    fn probability_ms(&self) -> f64 {
        let case = self.case;
        let forced = if !case.is_linear() {
            NOT_LINEAR
        } else if case.holding.clamp_force_n.is_some() {
            1.0
        } else {
            0.0
        };
        VISES * (1.0 + forced) * self.multiplier_ms(case.working.spindle_rpm)
    }
}

/// Whether the probability is told although nobody asked for the analysis `certainty`.
pub(super) fn tells_probability(case: &Case) -> bool {
    Points::new(case).probability_ms() <= UNASKED_MS
}

/// Expected work. A step in time takes 12 ns (a plain vise, linear law) to 60 ns (joints that open, a power of the chip, kept
/// steps), the most is taken, and 25 ns for every further tooth in cut.
pub(super) fn cost(job: &FixtureJob) -> Cost {
    let Some(case) = Case::of(job) else { return Cost { ms: 1.0, bytes: 100_000, driver: "/cut" } };
    let points = Points::new(&case);
    let phases = case.cutting.phases() as f64;
    let working = case.working.spindle_rpm;
    let steps =
        job.simulation.steps_per_tooth.map_or_else(|| simulate::steps_per_tooth(&case, working) as f64, f64::from);
    let teeth = case.cutting.stretches().iter().map(|stretch| stretch.teeth).max().unwrap_or(0) as f64;
    let step_ms = 6e-5 + 2.5e-5 * (teeth - 2.0).max(0.0);
    let run_ms = steps * job.simulation.tooth_periods.map_or(400.0, f64::from) * step_ms;
    // A better speed is tried before it is named.
    let more = [Analysis::ClampForce, Analysis::Lobes].into_iter().filter(|of| job.asks(*of)).count();
    let runs = 1.0 + f64::from(u8::from(job.simulation.verified)) * 2.0 + more as f64;
    let mut parts = vec![
        (2.0 + 100.0 * points.multiplier_ms(working), "/cut/spindle_speed_rpm"),
        (runs * run_ms, "/simulation/tooth_periods"),
    ];
    if case.cutting.uneven() {
        parts.push((UNEVEN_MS * phases * phases * points.history(working), "/cutter/teeth"));
    }
    if job.asks(Analysis::Limits) {
        parts.push((0.6 * f64::from(job.limits.depths) * run_ms, "/limits/depths"));
    }
    let kept = if job.asks(Analysis::History) { 2.0 * case.cutting.teeth.clamp(4, 40) as f64 } else { 0.0 };
    let pieces = phases * (240.0 + 48.0 * points.oscillations(working));
    let held = POINT_BYTES * phases.sqrt() * points.history(working)
        + PIECE_BYTES * pieces
        + steps * (STEP_BYTES * kept + PLACE_BYTES * (1.0 + teeth));
    // Of what no number of bytes holds the most.
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    let mut bytes = 400_000_u64.saturating_add(held as u64);
    let from = job.lobes.from_rpm.unwrap_or(0.5 * working);
    let to = job.lobes.to_rpm.unwrap_or(2.0 * working).max(from);
    // Slow speeds have long histories: the mean of 1/n over the range.
    let mean = if to > from { (to - from) / (to / from).ln() } else { from };
    let speeds = f64::from(job.lobes.speeds);
    if job.asks(Analysis::Lobes) {
        parts.push((speeds * OF_BOUNDARY * points.multiplier_ms(mean), "/lobes/speeds"));
        if job.lobes.map {
            let refined = 1.0 + 0.3 * f64::from(job.lobes.refinement);
            let of_map = speeds * f64::from(job.lobes.depths) * refined;
            parts.push((of_map * points.multiplier_ms(mean), "/lobes/depths"));
            bytes += 40 * u64::from(job.lobes.speeds) * u64::from(job.lobes.depths);
        }
    }
    if job.asks(Analysis::Certainty) {
        parts.push((PROBABILITIES * points.probability_ms(), "/analyses"));
        if scales(&case) {
            let traced = BOUNDARIES as f64 * speeds.max(LEAST_SPEEDS as f64);
            parts.push((traced * OF_BOUNDARY * points.multiplier_ms(mean), "/lobes/speeds"));
        }
    } else if tells_probability(&case) {
        parts.push((points.probability_ms(), "/uncertainty"));
    }
    let ms = parts.iter().map(|(ms, _)| ms).sum();
    let driver = parts.iter().max_by(|a, b| a.0.total_cmp(&b.0)).map_or("/cut", |(_, driver)| driver);
    Cost { ms, bytes, driver }
}
