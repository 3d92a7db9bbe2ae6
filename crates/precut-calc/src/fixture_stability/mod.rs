//! Fixture stability: how deep can this face mill cut in this vise before chatter or a joint opens, and how hard must
//! one clamp?
//!
//! The workpiece moves along the feed between two unilateral joints; the teeth regenerate what earlier teeth left.
//! Three methods, each checked against the others: the exact forced motion (`response`), the Floquet multiplier of the
//! motion linearised about it (`floquet`, `lobes`), and the cut in time with joints that open and teeth that leave the
//! cut (`march`).
//!
//! The way of a job: `input` -> `check` -> `acting` (effects, numbers) -> `cutting` (teeth, force), `holding` (masses,
//! springs) -> `answer` -> `output`, `advice`, `picture`. `forward` gives the same model to the diagnosis.

mod acting;
mod advice;
mod answer;
mod answering;
mod check;
mod clamp;
mod consequence;
mod cutting;
mod drive;
mod floquet;
mod forward;
mod holding;
mod hypotheses;
pub mod identification;
mod input;
mod lobes;
mod march;
mod margins;
mod measurement;
mod next_runs;
mod output;
mod parts;
mod picture;
mod plausible;
mod predict;
mod response;
mod settled;
mod simulate;
mod slip;
mod speeds;
mod zeroth;

pub use forward::{FixtureAllowances, FixturePoint, FixtureRun, RegimeMargin};
pub use input::{
    Analysis, ConstantForce, Entry, FaceMill, FeedToward, FixtureJob, Friction, JawGrip, LimitSettings, LimitSpeed,
    LobeSettings, MAX_MAP_POINTS, MillingCut, MillingForce, Regeneration, SelfLocking, SimulationSettings, Spindle,
    SpindlePoint, Vise, ViseJoint,
};
pub use measurement::{FixtureMeasurement, ObservedRegime};
pub use output::{
    AmplitudeCurve, ArcProfile, BetterSpeed, ChatterKind, ClampForce, CuttingDrive, DepthLimits, Engagement,
    FirstLimit, FixtureOutcome, FixtureState, FixtureVerdict, FloquetMultiplier, ForcedMotion, Histories, LobeBoundary,
    LobeDiagram, LobeMap, OpenJoint, Oscillogram, PushedAlong, QuasiStatic, Simulated, SlipForce, SpeedLimit,
    TextbookForce, VibrationMode, ZerothOrder,
};

pub use parts::{TimeRun, forced_motion, lobe_boundary, lobe_map, multiplier_modulus, run_in_time};

use crate::calculator::{
    Answer, Basis, Calculator, CalculatorKind, Codes, Cost, Example, Failure, Figure, Hallmark, Message, Meta, Monitor,
    Place, Table, checkpoint,
};

use acting::Case;
use answer::{Study, outcome};

/// The calculator.
#[derive(Debug, Clone, Copy)]
pub struct FixtureStability;

impl Calculator for FixtureStability {
    type Input = FixtureJob;
    type Output = FixtureOutcome;

    const META: Meta = Meta {
        id: "fixture-stability",
        kind: CalculatorKind::Calculator,
        version: 8,
        title: "Fixture stability",
        question: "How deep can this face mill cut in this vise before chatter or a joint opens, and how hard must one clamp?",
        summary: "A face mill shakes the workpiece in its vise: teeth enter and leave, each cuts what earlier ones left, \
                  and the joints to the jaws can open. From cutter, cut, masses, stiffness, damping and clamp force: \
                  the forced motion, the Floquet multiplier with chatter frequency, the limiting depth and the lobe \
                  diagram, the cut in time, the least clamp force by which no joint opens and nothing slips.",
        references: &[
            "Petrakov, Conditions of workpiece clamping in fixtures of the first and second type in face milling, NTUU KPI, 2014",
            "Insperger, Stepan, Updated semi-discretization method for periodic delay-differential equations with discrete delay, Int. J. Numer. Meth. Engng 61 (2004) 117-141",
            "Altintas, Budak, Analytical prediction of stability lobes in milling, CIRP Annals 44 (1995) 357-362",
        ],
        examples: &[
            Example {
                id: "paper",
                title: "Eight teeth, 3 mm deep, in a screw vise: it shakes by 15 µm and holds",
                job: include_str!("examples/paper.json"),
            },
            Example {
                id: "lobes",
                title: "A fast full slot: at which speeds and depths it stays quiet, and the best of them",
                job: include_str!("examples/lobes.json"),
            },
            Example {
                id: "pneumatic",
                title: "How little a pneumatic vise may press, and how deep one may cut in it",
                job: include_str!("examples/pneumatic.json"),
            },
            Example {
                id: "opening",
                title: "A vise set too loosely: a stable cut opens a joint and begins to chatter",
                job: include_str!("examples/opening.json"),
            },
        ],
        hallmarks: &[
            Hallmark::Of("/cutter/diameter_mm"),
            Hallmark::Of("/cutter/teeth"),
            Hallmark::Of("/cut/depth_mm"),
            Hallmark::Of("/cut/width_mm"),
            Hallmark::Of("/cut/spindle_speed_rpm"),
            Hallmark::Of("/cut/feed_mm_per_tooth"),
            Hallmark::Of("/fixture/clamp_force_n"),
        ],
        study_outputs: &[
            "/chatter_depth_mm",
            "/verdict/peak_to_peak_um",
            "/forced/clamp_fixed_n",
            "/multiplier/modulus",
        ],
        codes: CODES,
        figures: picture::FIGURE_IDS,
        tables: picture::TABLE_IDS,
        program: None,
    };

    fn fill(job: &mut FixtureJob) {
        let (spindle, feed) = (job.spindle_rpm(), job.feed_mm());
        if spindle.is_some() {
            (job.cut.spindle_speed_rpm, job.cut.speed_m_per_min) = (spindle, None);
        }
        if feed.is_some() {
            (job.cut.feed_mm_per_tooth, job.cut.feed_mm_per_min) = (feed, None);
        }
        job.analyses.push(Analysis::Verdict);
        job.analyses.sort_unstable();
        job.analyses.dedup();
    }

    fn cost(job: &FixtureJob) -> Cost {
        cost(job)
    }

    fn run(job: &FixtureJob, monitor: &dyn Monitor) -> Result<Answer<FixtureOutcome>, Failure> {
        checkpoint(monitor)?;
        let case = Case::of(job).ok_or_else(|| Failure::Internal("a job that the check refuses".to_owned()))?;
        let study = Study::new(job, case, monitor)?;
        let (outcome, aside) = outcome(&study)?;
        let warnings = advice::warnings(&study, &outcome, &aside);
        let explanation = advice::explanation(&study, &outcome, &aside);
        monitor.progress(1.0, Message::new("stage_fixture_done"));
        Ok(Answer { output: outcome, warnings, explanation, basis: basis(job) })
    }

    fn figures(job: &FixtureJob, outcome: &FixtureOutcome) -> Vec<Figure> {
        picture::figures(job, outcome)
    }

    fn tables(_job: &FixtureJob, outcome: &FixtureOutcome) -> Vec<Table> {
        picture::tables(outcome)
    }

    fn at_place(job: &FixtureJob, _outcome: &FixtureOutcome, place: &Place<'_>) -> Option<FixtureJob> {
        picture::at_place(job, place)
    }
}

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

/// Expected work. A multiplier costs about 1 us per point of its history and 10 us besides, some hundred times as much where the
/// cutter turns so slowly that hundreds of oscillations go into a tooth period; a step in time 12 ns (a plain vise, linear law) to
/// 60 ns (joints that open, a power of the chip, kept steps), the most is taken, and 25 ns for every further tooth in cut.
fn cost(job: &FixtureJob) -> Cost {
    let Some(case) = Case::of(job) else { return Cost { ms: 1.0, bytes: 100_000, driver: "/cut" } };
    let highest = case.holding.modes().last().map_or(0.0, |mode| mode.natural_hz);
    let oscillations = |spindle_rpm: f64| highest * case.cutting.tooth_period_s(spindle_rpm);
    let history = |spindle_rpm: f64| 24.0 + 14.0 * oscillations(spindle_rpm);
    let restarted = |spindle_rpm: f64| (oscillations(spindle_rpm) / ONE_SPACE).powf(RESTARTS_GROW);
    let states = case.holding.states() as f64;
    let phases = case.cutting.phases() as f64;
    let of_phases = 0.7 + 0.3 * phases;
    let point_ms = |n: f64| {
        let per_point = 0.0006 * of_phases * restarted(n).clamp(1.0, ALL_RESTARTS);
        (0.008 + per_point * history(n)) * (0.5 + 0.25 * states)
    };
    let working = case.working.spindle_rpm;
    let steps =
        job.simulation.steps_per_tooth.map_or_else(|| simulate::steps_per_tooth(&case, working) as f64, f64::from);
    let teeth = case.cutting.stretches().iter().map(|stretch| stretch.teeth).max().unwrap_or(0) as f64;
    let step_ms = 6e-5 + 2.5e-5 * (teeth - 2.0).max(0.0);
    let run_ms = steps * job.simulation.tooth_periods.map_or(400.0, f64::from) * step_ms;
    // A better speed is tried before it is named.
    let more = [Analysis::ClampForce, Analysis::Lobes].into_iter().filter(|of| job.asks(*of)).count();
    let runs = 1.0 + f64::from(u8::from(job.simulation.verified)) * 2.0 + more as f64;
    let mut parts =
        vec![(2.0 + 100.0 * point_ms(working), "/cut/spindle_speed_rpm"), (runs * run_ms, "/simulation/tooth_periods")];
    if case.cutting.uneven() {
        parts.push((UNEVEN_MS * phases * phases * history(working), "/cutter/teeth"));
    }
    if job.asks(Analysis::Limits) {
        parts.push((0.6 * f64::from(job.limits.depths) * run_ms, "/limits/depths"));
    }
    let kept = if job.asks(Analysis::History) { 2.0 * case.cutting.teeth.clamp(4, 40) as f64 } else { 0.0 };
    let pieces = phases * (240.0 + 48.0 * oscillations(working));
    let held = POINT_BYTES * phases.sqrt() * history(working)
        + PIECE_BYTES * pieces
        + steps * (STEP_BYTES * kept + PLACE_BYTES * (1.0 + teeth));
    // Of what no number of bytes holds the most.
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    let mut bytes = 400_000_u64.saturating_add(held as u64);
    if job.asks(Analysis::Lobes) {
        let from = job.lobes.from_rpm.unwrap_or(0.5 * working);
        let to = job.lobes.to_rpm.unwrap_or(2.0 * working).max(from);
        // Slow speeds have long histories: the mean of 1/n over the range.
        let mean = if to > from { (to - from) / (to / from).ln() } else { from };
        let speeds = f64::from(job.lobes.speeds);
        parts.push((speeds * 45.0 * point_ms(mean), "/lobes/speeds"));
        if job.lobes.map {
            let refined = 1.0 + 0.3 * f64::from(job.lobes.refinement);
            parts.push((speeds * f64::from(job.lobes.depths) * refined * point_ms(mean), "/lobes/depths"));
            bytes += 40 * u64::from(job.lobes.speeds) * u64::from(job.lobes.depths);
        }
    }
    let ms = parts.iter().map(|(ms, _)| ms).sum();
    let driver = parts.iter().max_by(|a, b| a.0.total_cmp(&b.0)).map_or("/cut", |(_, driver)| driver);
    Cost { ms, bytes, driver }
}

/// The equations that acted.
fn basis(job: &FixtureJob) -> Vec<Basis> {
    let mut used = vec![
        Basis { equation: "fixture/2.2", source: "Petrakov 2014, equations 1 and 2" },
        Basis { equation: "fixture/3.2", source: "multiple regenerative effect" },
        match job.fixture {
            Vise::SelfLocking(_) => Basis { equation: "fixture/4.1", source: "Petrakov 2014, equation 4, corrected" },
            Vise::ConstantForce(_) => Basis { equation: "fixture/4.2", source: "Petrakov 2014, equation 5" },
        },
        Basis { equation: "fixture/5.1", source: "Floquet theory on spectral elements" },
        Basis { equation: "fixture/5.2", source: "periodic response of the linear system" },
        Basis { equation: "fixture/5.4", source: "Altintas, Budak 1995" },
        Basis { equation: "fixture/5.5", source: "exact propagation between steps, joints by event" },
        Basis { equation: "fixture/5.6", source: "elastic and viscous force of the joints" },
    ];
    if job.asks(Analysis::ClampForce) {
        used.push(Basis { equation: "fixture/5.7", source: "statics of the clamped workpiece" });
    }
    if job.spindle.is_some() {
        used.push(Basis { equation: "fixture/5.8", source: "mean torque of smooth chips" });
    }
    used.extend(
        job.effects.iter().map(|effect| Basis { equation: effect.cause().equation, source: "catalogue of effects" }),
    );
    used
}

/// Everything that this calculator may utter, from where it is said.
const CODES: Codes = Codes {
    faults: &[check::CODES, &["time_missing", "opened_without_clamp_force"]],
    failures: &[&["undamped_resonance"]],
    warnings: &[advice::WARNING_CODES],
    explanations: &[advice::EXPLANATION_CODES],
    stages: &[&[
        "stage_simulation",
        "stage_clamp_force",
        "stage_limits",
        "stage_boundary",
        "stage_map",
        "stage_fixture_done",
    ]],
    labels: &[picture::LABEL_CODES],
};
