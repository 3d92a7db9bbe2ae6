//! Milling in three directions: how deep may this cutter go at this speed before it chatters, what limits, and what does the
//! cut do to tool, work and surface?
//!
//! The way of a job: `job` (fields, rules, numbers in the axes of the cut) -> `model` (chips, edges, the map over a period,
//! forced motion) -> `answer` (numbers, pictures, what is said). `measured` is the way of a log of cuts into a diagnosis.

mod answer;
mod cost;
mod job;
mod measured;
pub mod model;

pub use answer::conformance::MillingConformance;
pub use answer::output::{
    ClampCriterion, ClampDeciding, ClampLift, ClampRemedy, ClampRemedyKind, ClampStation, ClampTurn, ClampingStatus,
    ContactUse, CrossingMethod, CutterProposal, DepthLine, ForceOfSide, FrequencyShare, InstabilityKind,
    LeadingMultiplier, LobeIntervals, MeasuredSide, MillingBoundary, MillingClampMap, MillingClamping, MillingCost,
    MillingEngagement, MillingForces, MillingLobes, MillingMap, MillingMotion, MillingState, MillingVerdict, ModeShare,
    OtherAssumptions, Outcome, PocketLimit, ProposalKind, ReceptanceLimit, RigidLimits, SpeedCurve, SpeedPocket,
    SpeedStatus, UnstableInterval, WallSide, WallSurface, YieldingSide,
};
pub use job::{
    Asked, ChipsAbout, Coordinate, Cut, CutLimits, CutStation, CutWidth, Cutter, DirectionPart, EdgeForce,
    FlankRubbing, GrippingContacts, GrippingPoint, GrippingVise, Job, KienzleForce, LobePlane, MechanisticForce,
    MillSpindle, Milling, MillingCorrelation, MillingQuantity, MillingUncertainQuantity, MillingUncertainty,
    NothingYields, PartClamping, PowerForce, RubbingSource, SpeedVariation, ToothHelix, ToothOffset, ToothPitch,
    Yielding, YieldingMode, YieldingModes, YieldingReceptances, YieldingVise,
};
pub use measured::{CutMargin, MillingAllowances, MillingMeasurement, MillingPoint, MillingRun, ObservedCut};

use crate::calculator::{
    Answer, Basis, Calculator, CalculatorKind, Codes, Cost, Example, Failure, Figure, Hallmark, Message, Meta, Monitor,
    Place, Table, checkpoint,
};

use crate::certainty::picture::LABEL_CODES as DOUBT_CODES;
use crate::certainty::{DISTRIBUTION_CODES, MISSING_CODES, QUANTITY_CODES};
use crate::fixture_stability::IMPROBABLE_CODES;
use crate::receptance_fit::{FAILURE_CODES, FAULT_CODES, WARNING_CODES as FIT_WARNING_CODES};

use answer::{Study, advice, conformance, outcome, picture};
use cost::cost;
use job::{Case, beyond_modes, fits, too_expensive};

/// The calculator.
#[derive(Debug, Clone, Copy)]
pub struct MillingStability;

impl Calculator for MillingStability {
    type Input = Job;
    type Output = Outcome;

    const META: Meta = Meta {
        id: "milling-stability",
        kind: CalculatorKind::Calculator,
        version: 10,
        title: "Milling in three directions",
        question: "How deep may this cutter go at this speed before it chatters, and is it the tool or the workpiece that limits?",
        summary: "Tool and workpiece yield by modes in any direction, stated or made of measured frequency responses; edges may be helical, pitches, helices and run-out \
                  uneven, and the spindle speed may vary. From that: the Floquet multiplier with its frequencies, every \
                  stretch of depths that is unstable with certified ends, the lobe diagram with its islands, which side and \
                  direction limits (solved with each held rigid), forces, torque and power, the forced motion and the \
                  surface that it leaves, and how hard the workpiece must be clamped so that it neither slips, opens nor lifts.",
        references: &[
            "Altintas, Budak, Analytical prediction of stability lobes in milling, CIRP Annals 44 (1995) 357-362",
            "Insperger, Stepan, Updated semi-discretization method for periodic delay-differential equations with discrete delay, Int. J. Numer. Meth. Engng 61 (2004) 117-141",
            "Zatarain, Munoa, Peigne, Insperger, Analysis of the influence of mill helix angle on chatter stability, CIRP Annals 55 (2006) 365-368",
            "Merdol, Altintas, Multi frequency solution of chatter stability for low immersion milling, J. Manuf. Sci. Eng. 126 (2004) 459-466",
        ],
        examples: &[
            Example {
                id: "two_modes",
                title: "End mill with two modes in each direction: at 9500 rev/min 1.5 mm chatter",
                job: include_str!("examples/two_modes.json"),
            },
            Example {
                id: "island",
                title: "One helical tooth at full speed: between 6.9 and 17.8 mm it chatters, above and below not",
                job: include_str!("examples/island.json"),
            },
            Example {
                id: "wall",
                title: "Tool and thin work yield: which of both limits, and what wall is left",
                job: include_str!("examples/wall.json"),
            },
            Example {
                id: "measured",
                title: "Tool as a tap test measured it, work by a mode: how well the limit is known",
                job: include_str!("examples/measured.json"),
            },
            Example {
                id: "clamped",
                title: "Part in a vise: does the clamp force at hand hold it along the whole cut?",
                job: include_str!("examples/clamped.json"),
            },
            Example {
                id: "how_sure",
                title: "One cutter, one mode: how probably 2 mm stay quiet, and what makes it uncertain",
                job: include_str!("examples/how_sure.json"),
            },
        ],
        hallmarks: &[
            Hallmark::Of("/cutter/diameter_mm"),
            Hallmark::Of("/cutter/teeth"),
            Hallmark::Of("/cut/depth_mm"),
            Hallmark::Of("/cut/spindle_speed_rpm"),
            Hallmark::Of("/cut/feed_mm_per_tooth"),
            Hallmark::Count("/tool/modes"),
            Hallmark::Count("/work/modes"),
        ],
        study_outputs: &[
            "/first_limit_mm",
            "/multiplier/per_tooth",
            "/force/motor_power_kw",
            "/motion/peak_to_peak_um",
            "/clamping/clamp_force_min_n",
            "/conformance/joint/probability",
            "/conformance/depth_at_wanted_mm",
        ],
        codes: CODES,
        figures: picture::FIGURE_IDS,
        tables: picture::TABLE_IDS,
        program: None,
    };

    fn fill(job: &mut Job) {
        let (spindle, feed) = (job.spindle_rpm(), job.feed_mm());
        if spindle.is_some() {
            (job.cut.spindle_speed_rpm, job.cut.speed_m_per_min) = (spindle, None);
        }
        if feed.is_some() {
            (job.cut.feed_mm_per_tooth, job.cut.feed_mm_per_min) = (feed, None);
        }
        job.analyses.sort_unstable();
        job.analyses.dedup();
    }

    fn cost(job: &Job) -> Cost {
        cost(job)
    }

    fn run(job: &Job, monitor: &dyn Monitor) -> Result<Answer<Outcome>, Failure> {
        checkpoint(monitor)?;
        let estimate_ms = cost(job).ms;
        // From here on the sides that were measured yield by their modes.
        let (fits, job) = fits(job, monitor)?;
        let case = Case::of(&job).ok_or_else(|| Failure::Internal("a job that the check refuses".to_owned()))?;
        if let Some(finding) = beyond_modes(&job.effects, case.structure.modes.len()) {
            return Err(Failure::OutOfModel(finding));
        }
        if let Some(finding) = too_expensive(&job, &case) {
            return Err(Failure::OutOfModel(finding));
        }
        let study = Study::new(&job, case, fits, monitor)?;
        let (outcome, aside) = outcome(&study, estimate_ms)?;
        let warnings = advice::warnings(&study, &outcome, &aside);
        let explanation = advice::explanation(&study, &outcome, &aside);
        monitor.progress(1.0, Message::new("stage_done"));
        Ok(Answer { output: outcome, warnings, explanation, basis: basis(&job, &study) })
    }

    fn figures(job: &Job, outcome: &Outcome) -> Vec<Figure> {
        picture::figures(job, outcome)
    }

    fn tables(_job: &Job, outcome: &Outcome) -> Vec<Table> {
        picture::tables(outcome)
    }

    fn at_place(job: &Job, _outcome: &Outcome, place: &Place<'_>) -> Option<Job> {
        picture::at_place(job, place)
    }
}

/// The equations that acted.
fn basis(job: &Job, study: &Study<'_>) -> Vec<Basis> {
    let mut used = vec![
        Basis { equation: "milling/2.2", source: "geometry of trochoidal teeth as circles" },
        Basis { equation: "milling/2.3", source: "mechanistic and Kienzle force" },
        Basis { equation: "milling/2.4", source: "Altintas, Budak 1995, in three directions" },
        Basis { equation: "milling/3.10", source: "modal superposition of both sides" },
        Basis { equation: "milling/4.16", source: "Altintas, Budak 1995" },
    ];
    let is_slow = study.is_slow;
    if !study.fits.is_empty() {
        used.push(Basis {
            equation: "receptance/3.1",
            source: "least-squares complex frequency, Guillaume et al. 1998",
        });
        used.push(Basis { equation: "receptance/3.3", source: "least squares of real modes in the quantity measured" });
    }
    if !study.fits.is_empty() && job.asks(Asked::Intervals) && !is_slow {
        used.push(Basis { equation: "milling/4.13", source: "multi-frequency solution, Merdol, Altintas 2004" });
    }
    if is_slow {
        used.push(Basis { equation: "milling/4.21", source: "Altintas, Budak 1995, at every place of the arc" });
    }
    if job.asks_stability() && (!is_slow || job.asks(Asked::Lobes) || job.asks(Asked::Speeds)) {
        used.push(Basis { equation: "milling/4.15", source: "Floquet theory on spectral elements" });
    }
    if job.asks(Asked::Verdict) && !is_slow {
        used.push(Basis { equation: "milling/4.19", source: "Fourier series of the leading disturbance" });
    }
    if job.asks(Asked::Intervals) || job.asks(Asked::Lobes) {
        used.push(Basis { equation: "milling/4.17", source: "bracketing with the error of the modulus" });
    }
    if job.asks(Asked::Motion) {
        used.push(Basis { equation: "milling/4.20", source: "periodic response of the linear system" });
    }
    if job.asks(Asked::Clamping) {
        used.push(Basis {
            equation: "milling/6.21",
            source: "loads of a turn on rigid part and contacts with friction",
        });
        used.push(Basis { equation: "clamping/4", source: "rigid part on springs with friction" });
        used.push(Basis { equation: "clamping/3", source: "second-order cone programme" });
    }
    if job.asks(Asked::Speeds) {
        used.push(Basis { equation: "milling/7.25", source: "limits together, by removal rate" });
        if !job.cut.widths_mm.is_empty() {
            used.push(Basis { equation: "milling/7.26", source: "the same at every width" });
        }
    }
    if job.asks(Asked::Certainty) {
        used.push(Basis { equation: "certainty/3.2", source: "lines over a response surface and the real cut" });
        used.push(Basis { equation: "certainty/6.1", source: "limits together" });
    }
    if job.asks(Asked::Proposals) {
        used.push(Basis { equation: "milling/7.27", source: "cutters tried" });
    }
    if job.process_damping.is_some() {
        used.push(Basis { equation: "milling/2.8", source: "indentation of the flank" });
    }
    if job.speed_variation.is_some() {
        used.push(Basis { equation: "milling/4.18", source: "delay by the angle turned" });
    }
    if job.spindle.is_some() {
        used.push(Basis { equation: "milling/2.9", source: "mean torque of undisturbed chips" });
    }
    used
}

/// Everything that this calculator may utter, from where it is said.
const CODES: Codes = Codes {
    faults: &[
        job::CODES,
        &["frequency_of_stable_cut", "width_beside_angles"],
        FAULT_CODES[0],
        FAULT_CODES[1],
        DISTRIBUTION_CODES,
        QUANTITY_CODES,
        MISSING_CODES,
        crate::certainty::open::CODES,
    ],
    failures: &[FAILURE_CODES, &["effect_without_mode", "strip_misses_cutter"]],
    warnings: &[advice::WARNING_CODES, FIT_WARNING_CODES, IMPROBABLE_CODES],
    explanations: &[advice::EXPLANATION_CODES, conformance::EXPLANATION_CODES, &["probably_quiet_depth"]],
    stages: &[&[
        "stage_multiplier",
        "stage_intervals",
        "stage_motion",
        "stage_clamping",
        "stage_boundary",
        "stage_map",
        "stage_speeds",
        "stage_proposals",
        "stage_certainty",
        "stage_done",
    ]],
    labels: &[picture::LABEL_CODES, picture::DOUBT_LABELS, DOUBT_CODES],
};
