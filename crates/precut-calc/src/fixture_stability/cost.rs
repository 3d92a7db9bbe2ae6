//! What a job will take.

use crate::calculator::Cost;
use crate::certainty::ProbabilityCheck;
use crate::certainty::judging::Checking;

use crate::fixture_stability::answer::probable_depths::{BOUNDARIES, LEAST_SPEEDS, scales};
use crate::fixture_stability::job::acting::Case;
use crate::fixture_stability::job::input::{Analysis, FixtureJob};
use crate::fixture_stability::model::simulate;
use crate::fixture_stability::model::slow::{in_a_period, is_slow};

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
/// A multiplier of a slow cut with one, two and three masses, and a piece of the forced motion, ms.
const SLOW_MS: [f64; 3] = [1.0, 4.0, 10.0];
const PIECE_MS: f64 = 0.0005;
/// Steps of a range of speeds over which the mean multiplier is taken.
const RANGE: u32 = 16;
/// Multipliers of a speed of a boundary.
const OF_BOUNDARY: f64 = 45.0;
/// Vises that are tried for a probability, and for one that a response surface tells, with what that costs besides, ms;
/// probabilities that are found for the analysis `certainty`.
const VISES: f64 = 2800.0;
const VISES_OF_SURFACE: f64 = 30.0;
const SURFACE_MS: f64 = 10.0;
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

    fn is_slow(&self, spindle_rpm: f64) -> bool {
        is_slow(&self.case.holding, &self.case.cutting, spindle_rpm)
    }

    /// Pieces of the forced motion: of a slow cut those in which what an entry or exit sets off dies out.
    fn pieces(&self, spindle_rpm: f64) -> f64 {
        let (oscillations, decays) = in_a_period(&self.case.holding, &self.case.cutting, spindle_rpm);
        let followed = if self.is_slow(spindle_rpm) { (2.0 * 18.5 / decays).min(1.0) } else { 1.0 };
        self.case.cutting.phases() as f64 * (240.0 + 48.0 * oscillations * followed)
    }

    fn history(&self, spindle_rpm: f64) -> f64 {
        24.0 + 14.0 * self.oscillations(spindle_rpm)
    }

    /// A multiplier costs about 1 us per point of its history and 10 us besides, some hundred times as much where the cutter turns
    /// so slowly that hundreds of oscillations go into a tooth period.
    fn multiplier_ms(&self, spindle_rpm: f64) -> f64 {
        if self.is_slow(spindle_rpm) {
            return SLOW_MS[(self.case.holding.states() / 2).min(3) - 1];
        }
        let restarted = (self.oscillations(spindle_rpm) / ONE_SPACE).powf(RESTARTS_GROW);
        let of_phases = 0.7 + 0.3 * self.case.cutting.phases() as f64;
        let per_point = 0.0006 * of_phases * restarted.clamp(1.0, ALL_RESTARTS);
        (0.008 + per_point * self.history(spindle_rpm)) * (0.5 + 0.25 * self.case.holding.states() as f64)
    }

    /// A vise that is tried at the working point.
    fn vise_ms(&self) -> f64 {
        let case = self.case;
        let forced = if !case.is_linear() {
            NOT_LINEAR
        } else if case.holding.clamp_force_n.is_some() {
            1.0
        } else {
            0.0
        };
        (1.0 + forced) * self.multiplier_ms(case.working.spindle_rpm)
    }

    /// A probability at the working point.
    fn probability_ms(&self, check: Checking) -> f64 {
        match check {
            Checking::None => SURFACE_MS + VISES_OF_SURFACE * self.vise_ms(),
            Checking::OnLines | Checking::WithHalves(_) => VISES * self.vise_ms(),
        }
    }
}

/// How the probability is found that is told without the analysis `certainty`; `None` where even a response surface takes too long.
pub(in crate::fixture_stability) fn without_analysis(case: &Case, asked_for: ProbabilityCheck) -> Option<Checking> {
    let points = Points::new(case);
    let is_soon = |check: &Checking| points.probability_ms(*check) <= UNASKED_MS;
    match asked_for {
        ProbabilityCheck::Always => Some(Checking::OnLines),
        ProbabilityCheck::Auto => [Checking::OnLines, Checking::None].into_iter().find(is_soon),
        ProbabilityCheck::Never => Some(Checking::None).filter(is_soon),
    }
}

/// Expected work. A step in time takes 12 ns (a plain vise, linear law) to 60 ns (joints that open, a power of the chip, kept
/// steps), the most is taken, and 25 ns for every further tooth in cut.
pub(in crate::fixture_stability) fn cost(job: &FixtureJob) -> Cost {
    let Some(case) = Case::of(job) else { return Cost { ms: 1.0, bytes: 100_000, driver: "/cut" } };
    let points = Points::new(&case);
    let phases = case.cutting.phases() as f64;
    let working = case.working.spindle_rpm;
    let steps =
        job.simulation.steps_per_tooth.map_or_else(|| simulate::steps_per_tooth(&case, working) as f64, f64::from);
    let teeth = case.cutting.stretches().iter().map(|stretch| stretch.teeth).max().unwrap_or(0) as f64;
    let step_ms = 6e-5 + 2.5e-5 * (teeth - 2.0).max(0.0);
    let is_slow = points.is_slow(working);
    let run_ms = if is_slow { 0.0 } else { steps * job.simulation.tooth_periods.map_or(400.0, f64::from) * step_ms };
    // A better speed is tried before it is named.
    let more = [Analysis::ClampForce, Analysis::Lobes].into_iter().filter(|of| job.asks(*of)).count();
    let runs = 1.0 + f64::from(u8::from(job.simulation.verified)) * 2.0 + more as f64;
    let mut parts = vec![
        (2.0 + 100.0 * points.multiplier_ms(working), "/cut/spindle_speed_rpm"),
        (runs * run_ms, "/simulation/tooth_periods"),
    ];
    parts.push((PIECE_MS * points.pieces(working), "/cut/spindle_speed_rpm"));
    if case.cutting.uneven() && !is_slow {
        parts.push((UNEVEN_MS * phases * phases * points.history(working), "/cutter/teeth"));
    }
    if job.asks(Analysis::Limits) {
        let each_ms =
            if is_slow { 2.0 * points.multiplier_ms(working) + PIECE_MS * points.pieces(working) } else { 0.0 };
        parts.push((f64::from(job.limits.depths) * (0.6 * run_ms + each_ms), "/limits/depths"));
        for speed in &job.limits.speeds_rpm {
            parts.push((OF_BOUNDARY * points.multiplier_ms(speed.0), "/limits/speeds_rpm"));
        }
    }
    let kept = if job.asks(Analysis::History) { 2.0 * case.cutting.teeth.clamp(4, 40) as f64 } else { 0.0 };
    let of_run = POINT_BYTES * phases.sqrt() * points.history(working)
        + steps * (STEP_BYTES * kept + PLACE_BYTES * (1.0 + teeth));
    let held = PIECE_BYTES * points.pieces(working) + if is_slow { 0.0 } else { of_run };
    // Of what no number of bytes holds the most.
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    let mut bytes = 400_000_u64.saturating_add(held as u64);
    let from = job.lobes.from_rpm.unwrap_or(0.5 * working);
    let to = job.lobes.to_rpm.unwrap_or(2.0 * working).max(from);
    // Slow speeds have long histories.
    let mean_ms = (0..=RANGE).map(|k| points.multiplier_ms(from + (to - from) * f64::from(k) / f64::from(RANGE)));
    let mean_ms = mean_ms.sum::<f64>() / f64::from(RANGE + 1);
    let speeds = f64::from(job.lobes.speeds);
    if job.asks(Analysis::Lobes) {
        parts.push((speeds * OF_BOUNDARY * mean_ms, "/lobes/speeds"));
        if job.lobes.map {
            let refined = 1.0 + 0.3 * f64::from(job.lobes.refinement);
            let of_map = speeds * f64::from(job.lobes.depths) * refined;
            parts.push((of_map * mean_ms, "/lobes/depths"));
            bytes += 40 * u64::from(job.lobes.speeds) * u64::from(job.lobes.depths);
        }
    }
    if job.asks(Analysis::Certainty) {
        parts.push((PROBABILITIES * points.probability_ms(Checking::OnLines), "/analyses"));
        if scales(&case) {
            let traced = BOUNDARIES as f64 * speeds.max(LEAST_SPEEDS as f64);
            parts.push((traced * OF_BOUNDARY * mean_ms, "/lobes/speeds"));
        }
    } else if let Some(check) = without_analysis(&case, job.uncertainty.check) {
        parts.push((points.probability_ms(check), "/uncertainty"));
    }
    let ms = parts.iter().map(|(ms, _)| ms).sum();
    let driver = parts.iter().max_by(|a, b| a.0.total_cmp(&b.0)).map_or("/cut", |(_, driver)| driver);
    Cost { ms, bytes, driver }
}
