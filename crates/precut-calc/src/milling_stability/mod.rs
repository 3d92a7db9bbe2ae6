//! Milling in three directions: how deep may this cutter go at this speed before it chatters, what limits, and what does the
//! cut do to tool, work and surface?
//!
//! The way of a job: `job` (fields, rules, numbers in the axes of the cut) -> `model` (chips, edges, the map over a period,
//! forced motion) -> `answer` (numbers, pictures, what is said).

mod answer;
mod job;
pub mod model;

pub use answer::conformance::MillingConformance;
pub use answer::output::{
    ClampCriterion, ClampDeciding, ClampLift, ClampRemedy, ClampRemedyKind, ClampStation, ClampTurn, ClampingStatus,
    ContactUse, CrossingMethod, CutterProposal, DepthLine, ForceOfSide, FrequencyShare, InstabilityKind,
    LeadingMultiplier, LobeIntervals, MeasuredSide, MillingBoundary, MillingClamping, MillingCost, MillingEngagement,
    MillingForces, MillingLobes, MillingMap, MillingMotion, MillingState, MillingVerdict, ModeShare, OtherAssumptions,
    Outcome, PocketLimit, ProposalKind, ReceptanceLimit, RigidLimits, SpeedCurve, SpeedPocket, SpeedStatus,
    UnstableInterval, WallSide, WallSurface, YieldingSide,
};
pub use job::{
    Asked, Coordinate, Cut, CutLimits, CutStation, CutWidth, Cutter, DirectionPart, EdgeForce, FlankRubbing,
    GrippingContacts, GrippingPoint, GrippingVise, Job, KienzleForce, LobePlane, MechanisticForce, MillSpindle,
    Milling, MillingCorrelation, MillingQuantity, MillingUncertainQuantity, MillingUncertainty, NothingYields,
    PartClamping, PowerForce, RubbingSource, SpeedVariation, ToothHelix, ToothOffset, ToothPitch, Yielding,
    YieldingMode, YieldingModes, YieldingReceptances, YieldingVise,
};

use crate::calculator::{
    Answer, Basis, Calculator, CalculatorKind, Codes, Cost, Example, Failure, Figure, Hallmark, Message, Meta, Monitor,
    Place, Table, checkpoint,
};

use crate::certainty::picture::LABEL_CODES as DOUBT_CODES;
use crate::certainty::{DISTRIBUTION_CODES, MISSING_CODES, QUANTITY_CODES, Quantity};
use crate::fixture_stability::IMPROBABLE_CODES;
use crate::receptance_fit::{FAILURE_CODES, FAULT_CODES, ReceptanceFit, WARNING_CODES as FIT_WARNING_CODES};

use answer::conformance::draws;
use answer::{Study, advice, conformance, outcome, picture};
use job::{Case, clamped, fits, guessed, range_rpm, too_expensive, uncertainties};
use model::MOST_OSCILLATIONS;

/// The calculator.
#[derive(Debug, Clone, Copy)]
pub struct MillingStability;

impl Calculator for MillingStability {
    type Input = Job;
    type Output = Outcome;

    const META: Meta = Meta {
        id: "milling-stability",
        kind: CalculatorKind::Calculator,
        version: 5,
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

/// A multiplier: of an element whose force acts in two directions, ms; its Krylov spaces grow with the oscillations of a period, and
/// from some hundreds on they are restarted. Measured with 1 to 2000 oscillations.
const ELEMENT_MS: f64 = 0.03;
const SPACES_GROW: f64 = 60.0;
const RESTARTED: f64 = 800.0;
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
const RIGID_LOADS: f64 = 0.1;
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
fn cost(job: &Job) -> Cost {
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
            parts.push((TRIALS * mean, "/lobes/speeds"));
            let others = job.cut.widths_mm.len() as f64;
            parts.push((others * (TRIALS + REFINED * speeds * steps * PER_SEARCH) * mean, "/cut/widths_mm"));
            if clamping.is_some_and(|of| of.clamp_force().is_some()) {
                parts.push((REFINED * speeds * CLAMP_DEPTHS * 0.2 * clamping_ms, "/clamping/stations"));
            }
        }
        if job.asks(Asked::Lobes) && job.lobes.map {
            parts.push((speeds * f64::from(job.lobes.depths) * mean, "/lobes/depths"));
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
    let mut names: Vec<&str> = of.of.iter().map(|one| one.quantity.name()).collect();
    names.sort_unstable();
    names.dedup();
    let limits = &job.limits;
    let moves = [limits.amplitude_max_um, limits.surface_error_max_um, limits.roughness_max_um];
    let motion_ms = if moves.iter().any(Option::is_some) { by_elements_ms(case, &case.rotation) } else { 0.0 };
    let loads = if case.structure.modes.iter().any(|mode| mode.side == model::Side::Work) { 1.0 } else { RIGID_LOADS };
    let clamping_ms = clamped(job).map_or(0.0, |(of, _)| {
        let places = of.places_mm(job.cut.feed_direction_deg).map_or(1, |places| places.len());
        places as f64 * CLAMPING_MS * loads
    });
    draws(of.of.len(), names.len()) * (ON_MAP * point_ms(case, &case.rotation) + motion_ms + clamping_ms)
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
    faults: &[job::CODES, FAULT_CODES[0], FAULT_CODES[1], DISTRIBUTION_CODES, QUANTITY_CODES, MISSING_CODES],
    failures: &[FAILURE_CODES],
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
