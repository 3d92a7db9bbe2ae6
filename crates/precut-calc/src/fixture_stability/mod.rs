//! Fixture stability: how deep can this face mill cut in this vise before chatter or a joint opens, and how hard must
//! one clamp?
//!
//! The workpiece moves along the feed between two unilateral joints; the teeth regenerate what earlier teeth left.
//! Three methods, each checked against the others: the exact forced motion (`response`), the Floquet multiplier of the
//! motion linearised about it (`floquet`, `lobes`), and the cut in time with joints that open and teeth that leave the
//! cut (`march`).
//!
//! The way of a job: `job` (`input` -> `check` -> `acting`: effects, numbers) -> `model` (`cutting`: teeth, force;
//! `holding`: masses, springs) -> `answer` (`study` -> `output`, `advice`, `picture`). `measured` gives the same model to
//! the diagnosis.

mod answer;
mod cost;
pub mod identification;
mod job;
mod measured;
mod model;

pub use answer::conformance::FixtureConformance;
pub use answer::output::{
    AmplitudeCurve, ArcProfile, BetterSpeed, ChatterKind, ClampForce, CuttingDrive, DepthLimits, Engagement,
    FirstLimit, FixtureOutcome, FixtureState, FixtureVerdict, FloquetMultiplier, ForcedMotion, Histories, LobeBoundary,
    LobeDiagram, LobeMap, OpenJoint, Oscillogram, PushedAlong, QuasiStatic, Simulated, SlipForce, SpeedLimit,
    TextbookForce, VibrationMode, ZerothOrder,
};
pub use job::input::{
    Analysis, ConstantForce, Entry, FaceMill, FeedToward, FixtureJob, Friction, JawGrip, LimitSettings, LimitSpeed,
    LobeSettings, MAX_MAP_POINTS, MillingCut, MillingForce, Regeneration, SelfLocking, SimulationSettings, Spindle,
    SpindlePoint, Vise, ViseJoint,
};
pub(crate) use job::usual_scatter;
pub(crate) use measured::consequence::depth_margin;
pub use measured::forward::{FixtureAllowances, FixturePoint, FixtureRun, RegimeMargin};
pub(crate) use measured::hypotheses::{RUNOUTS, SHIFTS};
pub(crate) use measured::margins::{FLATTEST, steepness};
pub use measured::measurement::{FixtureMeasurement, ObservedRegime};

pub(crate) use answer::conformance::{WARNING_CODES as IMPROBABLE_CODES, quiet_to};
pub(crate) use answer::plausible::{
    CLAMP, COEFFICIENT, DAMPING, EDGE, FEED, FREQUENCY, STATED_FREQUENCY, STATED_RATIO,
};
pub use answer::probable_depths::{ProbableDepths, RobustSpeed};
pub(crate) use job::check::{check_characteristic, check_friction};
pub(crate) use job::input::FrictionRange;
pub use job::uncertain::{FixtureCorrelation, FixtureQuantity, FixtureUncertainQuantity, FixtureUncertainty};
pub(crate) use model::cutting::engagement_rad;
pub(crate) use model::drive::power_kw;

pub use answer::parts::{TimeRun, forced_motion, lobe_boundary, lobe_map, multiplier_modulus, run_in_time};

use crate::calculator::{
    Answer, Basis, Calculator, CalculatorKind, Codes, Cost, Example, Failure, Figure, Hallmark, Message, Meta, Monitor,
    Place, Table, checkpoint,
};

use crate::certainty::{DISTRIBUTION_CODES, MISSING_CODES, QUANTITY_CODES};

use answer::study::{Study, outcome};
use job::acting::Case;

/// The calculator.
#[derive(Debug, Clone, Copy)]
pub struct FixtureStability;

impl Calculator for FixtureStability {
    type Input = FixtureJob;
    type Output = FixtureOutcome;

    const META: Meta = Meta {
        id: "fixture-stability",
        kind: CalculatorKind::Calculator,
        version: 16,
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
            "/conformance/joint/probability",
            "/multiplier/modulus",
        ],
        codes: CODES,
        figures: answer::picture::FIGURE_IDS,
        tables: answer::picture::TABLE_IDS,
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
        cost::cost(job)
    }

    fn run(job: &FixtureJob, monitor: &dyn Monitor) -> Result<Answer<FixtureOutcome>, Failure> {
        checkpoint(monitor)?;
        let case = Case::of(job).ok_or_else(|| Failure::Internal("a job that the check refuses".to_owned()))?;
        let study = Study::new(job, case, monitor)?;
        let (outcome, aside) = outcome(&study)?;
        let warnings = answer::advice::warnings(&study, &outcome, &aside);
        let explanation = answer::advice::explanation(&study, &outcome, &aside);
        monitor.progress(1.0, Message::new("stage_fixture_done"));
        Ok(Answer { output: outcome, warnings, explanation, basis: basis(job) })
    }

    fn figures(job: &FixtureJob, outcome: &FixtureOutcome) -> Vec<Figure> {
        answer::picture::figures(job, outcome)
    }

    fn tables(_job: &FixtureJob, outcome: &FixtureOutcome) -> Vec<Table> {
        answer::picture::tables(outcome)
    }

    fn at_place(job: &FixtureJob, _outcome: &FixtureOutcome, place: &Place<'_>) -> Option<FixtureJob> {
        answer::picture::at_place(job, place)
    }
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
    let is_slow = |case: Case| model::slow::is_slow(&case.holding, &case.cutting, case.working.spindle_rpm);
    if Case::of(job).is_some_and(is_slow) {
        used.retain(|basis| basis.equation != "fixture/5.1" && basis.equation != "fixture/5.5");
        used.push(Basis { equation: "fixture/5.9", source: "adiabatic theorem on the equation without a delay" });
    }
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
    faults: &[
        job::check::CODES,
        DISTRIBUTION_CODES,
        QUANTITY_CODES,
        crate::certainty::open::CODES,
        MISSING_CODES,
        &["time_missing", "opened_without_clamp_force"],
    ],
    failures: &[&["undamped_resonance"]],
    warnings: &[answer::advice::WARNING_CODES, answer::conformance::WARNING_CODES],
    explanations: &[
        answer::advice::EXPLANATION_CODES,
        answer::conformance::EXPLANATION_CODES,
        answer::probable_depths::EXPLANATION_CODES,
    ],
    stages: &[&[
        "stage_simulation",
        "stage_clamp_force",
        "stage_limits",
        "stage_boundary",
        "stage_map",
        "stage_certainty",
        "stage_fixture_done",
    ]],
    labels: &[answer::picture::LABEL_CODES, answer::picture::DOUBT_LABELS, crate::certainty::picture::LABEL_CODES],
};
