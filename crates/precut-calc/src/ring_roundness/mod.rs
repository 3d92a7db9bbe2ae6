//! Ring roundness: how round will a ring get that is turned while it rests on the surface being turned?
//!
//! The ring lies with its outer surface on two supports; a wide-edge tool, a point in the cross-section, is fed toward
//! it. Every error of the surface that passes a support moves the ring and is copied onto what passes the tool. The
//! simulation (`turning`) locates the ring exactly at every step and cuts every body angle; the linear theory (`lobing`)
//! says which waves grow, stay or decay; the reference circles are those of [`crate::num::roundness`].
//!
//! The way of a job: `job` (`input` -> `check`) -> `model` (`scene`: setting and blank with effects, mirrored for
//! clockwise rotation -> `simulate`, `linear`, `search`) -> `answer` (`output`, `advice`, `picture`). `measured` gives the
//! same model to the diagnosis.

mod answer;
pub mod cylindricity;
pub mod evaluation;
mod job;
mod measured;
mod model;

pub use answer::conformance::RingConformance;
pub use answer::output::{
    CauseKind, CauseOutcome, CausesOutcome, CircleValues, Evaluated, HistoryColumns, Outcome, PathColumns,
    ProfileColumns, ReactionsOutcome, ReplayFrame, ReplayOutcome, SettingOutcome, SimulationOutcome, SpectrumColumns,
    WaveColumn,
};
pub use answer::output_settings::{
    CutCell, Fate, LinearOutcome, MapCell, MapOutcome, OrderOutcome, RootOutcome, SearchOutcome, SearchSetting,
    SearchStatus, SecondStage, SpeedCell, SpeedMapOutcome, TriedColumns,
};
pub use job::cut_force::{CutForce, ForceLaw};
pub use job::input::{
    Analysis, Drive, Dynamics, ErrorEstimate, Forces, Job, LongWave, Method, Mode, ModePlace, ProfileRow, Ring,
    RingTolerance, Rotation, Stiffness, Supports, Tool, Wave,
};
pub use job::input_ranges::{MapRange, SearchRange, SpeedRange};
pub use job::uncertain::{RingCorrelation, RingQuantity, RingUncertainQuantity, RingUncertainty};
pub use measured::forward::{RingAllowances, RingPoint, RingRun};
pub use measured::measurement::RingMeasurement;

use crate::certainty::{DISTRIBUTION_CODES, MISSING_CODES, QUANTITY_CODES};

use crate::calculator::{
    Answer, Basis, Calculator, CalculatorKind, Codes, Cost, Example, Failure, Figure, Finding, Hallmark, Message, Meta,
    Monitor, Place, Table, checkpoint,
};

use model::scene::Scene;
use model::simulate::Share;
use model::stance::{Load, Stance, reactions_n};
use model::surface::UM_PER_MM;

/// The calculator.
#[derive(Debug, Clone, Copy)]
pub struct RingRoundness;

impl Calculator for RingRoundness {
    type Input = Job;
    type Output = Outcome;

    const META: Meta = Meta {
        id: "ring-roundness",
        kind: CalculatorKind::Calculator,
        version: 9,
        title: "Ring roundness",
        question: "How round will a ring get that is turned while it rests on the surface being turned?",
        summary: "A ring or a journal rests with the surface being turned on two supports while a wide-edge tool is fed \
                  toward it. From blank, supports, tool and feed: the profile that comes out, its roundness about all \
                  four reference circles, how it develops revolution by revolution, which waves grow, stay or decay, \
                  which setting and feed reach a target, and how sure all this is.",
        references: &[
            "Shchurova, Bulletin of the South Ural State University, Mechanical Engineering, 2012",
            "Dall, Rounding effect in centreless grinding, Mechanical Engineering 68 (1946) 325-329",
            "Gurney, An analysis of centerless grinding, J. Eng. Ind. 86 (1964) 163-174",
            "Rowe, Barash, Computer method for investigating the inherent accuracy of centreless grinding, Int. J. Mach. Tool Des. Res. 4 (1964) 91-116",
            "ISO 12181-1, ISO 12181-2, ISO 16610-21",
        ],
        examples: &[
            Example {
                id: "paper",
                title: "A ring of 300 mm that comes out 0.25 mm out of round",
                job: include_str!("examples/paper.json"),
            },
            Example {
                id: "clear_start",
                title: "The same ring, the tool starting clear of it: round to 3 µm",
                job: include_str!("examples/clear_start.json"),
            },
            Example {
                id: "paper_algorithm",
                title: "An algorithm whose roundness depends on the number of samples",
                job: include_str!("examples/paper_algorithm.json"),
            },
            Example {
                id: "rollers",
                title: "A measured blank on rollers, one of which runs out: round to 10 µm",
                job: include_str!("examples/rollers.json"),
            },
            Example {
                id: "set_up",
                title: "Which angles and which feed make a ring round: a map to choose from",
                job: include_str!("examples/set_up.json"),
            },
            Example {
                id: "cut_map",
                title: "How round the same cut would come out at other angles of tool and supports",
                job: include_str!("examples/cut_map.json"),
            },
            Example {
                id: "speeds",
                title: "A tool post that swings: which work speed does not chatter",
                job: include_str!("examples/speeds.json"),
            },
            Example {
                id: "how_sure",
                title: "How probably a ring stays within 3 µm when its tool stands half a degree off",
                job: include_str!("examples/how_sure.json"),
            },
        ],
        hallmarks: &[
            Hallmark::Of("/ring/radius_mm"),
            Hallmark::Of("/ring/ellipticity_mm"),
            Hallmark::Of("/supports/distance_mm"),
            Hallmark::Of("/tool/feed_mm_per_rev"),
            Hallmark::Of("/tool/revolutions"),
        ],
        study_outputs: &[
            "/roundness_um",
            "/roundness_unfiltered_um",
            "/mean_radius_mm",
            "/setting/coefficient_sum",
            "/conformance/joint/probability",
        ],
        codes: CODES,
        figures: answer::picture::FIGURE_IDS,
        tables: answer::tables::TABLE_IDS,
        program: None,
    };

    fn fill(job: &mut Job) {
        job.samples = Some(job::sampling::samples_of(job));
    }

    fn cost(job: &Job) -> Cost {
        cost(job)
    }

    fn run(job: &Job, monitor: &dyn Monitor) -> Result<Answer<Outcome>, Failure> {
        run(job, monitor)
    }

    fn figures(job: &Job, outcome: &Outcome) -> Vec<Figure> {
        answer::picture::figures(job, outcome)
    }

    fn tables(_job: &Job, outcome: &Outcome) -> Vec<Table> {
        answer::tables::tables(outcome)
    }

    fn at_place(job: &Job, outcome: &Outcome, place: &Place<'_>) -> Option<Job> {
        answer::elsewhere::at_place(job, outcome, place)
    }
}

/// What the parts of a job take, ms.
struct Work {
    simulation: f64,
    theory: f64,
    speeds: f64,
    map: f64,
    search: f64,
    certainty: f64,
}

/// Measured on one core: 60 to 110 ns per step, rollers 0.3 to 0.5 us, the paper's algorithm 6 ns per step and point,
/// a map's cell 30 us.
fn work(job: &Job) -> Work {
    let n = f64::from(job::sampling::samples_of(job));
    let turns = job.tool.revolutions + job.tool.spark_out_revolutions;
    let step_ns = if job.supports.roller_radius_mm > 0.0 { 400.0 } else { 90.0 };
    let mut work = Work { simulation: 0.0, theory: 0.0, speeds: 0.0, map: 0.0, search: 0.0, certainty: 0.0 };
    if job.asks(Analysis::Simulation) {
        let runs = match job.error_estimate {
            ErrorEstimate::HalfSamples => 1.84,
            ErrorEstimate::DoubleSamples => 3.5,
        };
        let per_turn = match job.method {
            Method::ExactContact => runs * n * step_ns,
            Method::NearestSamples => 7.0 * n * n + 3600.0 * step_ns,
        };
        // The causes: one run with everything, one with each term off, one of them with twice the revolutions, one with more.
        let terms = 7.0 + model::causes::MOST_LONGER + job.effects.len() as f64;
        let per_turn = per_turn + terms * f64::from(model::causes::nodes(job)) * step_ns;
        // The history fits a circle per entry.
        work.simulation = 1e-6 * turns * per_turn + 3e-5 * n * turns.min(400.0) + 1e-3 * n;
    }
    if job.asks(Analysis::LinearTheory) {
        work.theory = 5.0;
    }
    if job.asks(Analysis::SpeedMap) {
        work.speeds = model::speeds::work_ms(job);
    }
    if job.asks(Analysis::SetupMap) {
        let cells = f64::from(job.setup_map.tool_angles) * f64::from(job.setup_map.support_angles);
        // A simulated cell takes its revolutions twice at most, some hundred.
        let simulated = cells.min(f64::from(job.setup_map.simulated_cells));
        let nodes = job.filter.cutoff_upr().map_or(n, |cutoff| f64::from(8 * cutoff).max(720.0));
        let everywhere = if job.setup_map.cut_everywhere { cells * turns } else { 0.0 };
        work.map = 2e-3 * cells * f64::from(job.setup_map.highest_order)
            + (simulated * 150.0 + everywhere) * nodes * 1e-6 * step_ns;
    }
    if let (true, Some(range)) = (job.asks(Analysis::SettingsSearch), &job.settings_search) {
        let nodes = if job.filter == LongWave::None { n } else { n.min(1800.0) };
        let expected = model::search::expected(job, range);
        // A scan in steps of 5 % sums to 21 times its largest run.
        work.search = 1e-6 * step_ns * (21.0 * nodes + 6.0 * n) * expected.revolutions;
        if expected.is_wide {
            work.search += model::search_wide::work_ms(job, range, step_ns);
        }
    }
    if job.asks(Analysis::Certainty) {
        work.certainty = 1e-6 * answer::conformance::RINGS * turns * f64::from(model::causes::nodes(job)) * step_ns;
    }
    work
}

fn cost(job: &Job) -> Cost {
    let job = &*job::cut_force::resolved(job);
    let work = work(job);
    let samples = job::sampling::samples_of(job);
    let mut ms = 1.0 + work.simulation + work.theory;
    let mut driver = if samples > 7200 { "/samples" } else { "/tool/revolutions" };
    for (part, field) in [
        (work.speeds, "/speed_map/speeds"),
        (work.map, "/setup_map/tool_angles"),
        (work.search, "/settings_search/revolutions_max"),
        (work.certainty, "/tool/revolutions"),
    ] {
        if part > ms {
            driver = field;
        }
        ms += part;
    }
    let rows = job.measured_profile.as_ref().map_or(0, |profile| profile.rows().len());
    let frames = u64::from(job.replay_frames) * model::replay::MOST_POINTS * 16;
    let bytes = 200_000 + u64::from(samples) * 400 + rows as u64 * 100 + frames;
    Cost { ms, bytes, driver }
}

fn run(job: &Job, monitor: &dyn Monitor) -> Result<Answer<Outcome>, Failure> {
    checkpoint(monitor)?;
    let cut_force = job::cut_force::of(job);
    let job = &*job::cut_force::resolved(job);
    let scene = Scene::of(job, &job.effects);
    let end = scene.end().ok_or_else(|| Failure::OutOfModel(Finding::new("no_end_position", "/tool")))?;
    let mut outcome = Outcome {
        roundness_um: None,
        roundness_error_um: None,
        roundness_unfiltered_um: None,
        roundness_unfiltered_error_um: None,
        mean_radius_mm: None,
        mean_radius_error_um: None,
        setting: SettingOutcome { cut_force, ..setting(job, &scene, &end)? },
        simulation: None,
        linear_theory: None,
        speed_map: None,
        setup_map: None,
        settings_search: None,
        conformance: None,
    };
    let whole = Share { monitor, from: 0.0, to: 1.0 };
    // Each part has the share of the progress that it is expected to take of the time.
    let work = work(job);
    let total = work.simulation + work.theory + work.speeds + work.map + work.search + work.certainty;
    let after = |done: f64| if total > 0.0 { done / total } else { 0.0 };
    let sped = work.simulation + work.theory + work.speeds;
    let mapped = sped + work.map;
    let [simulated, sped, mapped, searched] = [work.simulation, sped, mapped, mapped + work.search].map(after);
    if job.asks(Analysis::Simulation) {
        let simulated = model::simulate::simulate(job, &scene, &end, whole.part(0.0, simulated))?;
        if let (Some(end), Some(error)) = (&simulated.end, &simulated.end_error) {
            outcome.roundness_um = Some(end.filtered.least_squares_um);
            outcome.roundness_error_um = Some(error.filtered.least_squares_um);
            outcome.roundness_unfiltered_um = Some(end.unfiltered.least_squares_um);
            outcome.roundness_unfiltered_error_um = Some(error.unfiltered.least_squares_um);
            outcome.mean_radius_mm = Some(end.mean_radius_mm);
            outcome.mean_radius_error_um = Some(error.mean_radius_mm * UM_PER_MM);
        }
        outcome.simulation = Some(simulated);
    }
    if job.asks(Analysis::LinearTheory) {
        outcome.linear_theory = Some(model::linear::theory(job, &scene, &end));
    }
    if job.asks(Analysis::SpeedMap) {
        outcome.speed_map = Some(model::speeds::map(job, &scene, &end, whole.part(simulated, sped))?);
    }
    if job.asks(Analysis::SetupMap) {
        outcome.setup_map = Some(answer::map::map(job, &scene, &end, whole.part(sped, mapped))?);
    }
    if let (true, Some(range)) = (job.asks(Analysis::SettingsSearch), &job.settings_search) {
        outcome.settings_search = Some(model::search::search(job, range, &scene, whole.part(mapped, searched))?);
    }
    if let (true, Some(tolerance)) = (job.asks(Analysis::Certainty), &job.tolerance) {
        let share = whole.part(searched, 1.0);
        outcome.conformance = Some(answer::conformance::conformance(job, &scene, &end, tolerance.roundness_um, share)?);
    }
    let mut warnings = answer::advice::warnings(job, &scene, &end, &outcome);
    let mut explanation = answer::advice::explanation(job, &scene, &end, &outcome);
    if let Some(found) = &outcome.conformance {
        warnings.extend(answer::conformance::warning(found));
        explanation.insert(0, answer::conformance::said(found));
    }
    monitor.progress(1.0, Message::new("stage_done"));
    Ok(Answer { basis: basis(job, &outcome), output: outcome, warnings, explanation })
}

fn setting(job: &Job, scene: &Scene, end: &Stance) -> Result<SettingOutcome, Failure> {
    let copying = end.copying();
    let per_feed = end.radius_per_feed(scene.setting.feed_direction);
    // In the mirror the supports have changed places.
    let (a, b, delay_a, delay_b) = if scene.mirrored {
        (copying.b, copying.a, copying.delay_b_rad, copying.delay_a_rad)
    } else {
        (copying.a, copying.b, copying.delay_a_rad, copying.delay_b_rad)
    };
    Ok(SettingOutcome {
        circumradius_mm: end.radius_mm,
        support_half_angle_deg: end.half_angle_rad.to_degrees(),
        tool_angle_deg: model::scene::mirrored_rad(end.tool_rad(), scene.mirrored).to_degrees(),
        coefficient_a: a,
        coefficient_b: b,
        coefficient_sum: copying.gain(),
        delay_a_deg: delay_a.to_degrees(),
        delay_b_deg: delay_b.to_degrees(),
        compliance_ratio: scene.setting.compliance_ratio,
        radius_per_feed: per_feed,
        half_turn_reduction_um: per_feed * scene.setting.feed_mm_per_rev * UM_PER_MM,
        gap_at_start_um: model::simulate::gap_at_start_mm(job, scene)? * UM_PER_MM,
        cut_force: None,
        reactions: job.forces.as_ref().map(|forces| reactions(forces, scene, end)),
    })
}

fn reactions(forces: &Forces, scene: &Scene, end: &Stance) -> ReactionsOutcome {
    let (thrust_n, cutting_n) = (forces.thrust_n.unwrap_or(0.0), forces.cutting_n.unwrap_or(0.0));
    let load = Load { thrust_n, cutting_n, weight_n: forces.weight_n };
    // The mirror turns a clockwise ring into a counter-clockwise one and swaps the supports.
    let swap = |(a, b): (f64, f64)| if scene.mirrored { (b, a) } else { (a, b) };
    let (support_a_n, support_b_n) = swap(reactions_n(end, &load, 1.0, false));
    let driven = (forces.drive == Drive::Rollers).then(|| swap(reactions_n(end, &load, 1.0, true)));
    let (least_a, least_b) = driven.unwrap_or((support_a_n, support_b_n));
    let seated = least_a >= 0.0 && least_b >= 0.0;
    let pressed = least_a + least_b;
    ReactionsOutcome {
        support_a_n,
        support_b_n,
        driven_support_a_n: driven.map(|(a, _)| a),
        driven_support_b_n: driven.map(|(_, b)| b),
        friction_needed: (driven.is_some() && seated && pressed > 0.0).then(|| cutting_n / pressed),
        drive_torque_n_m: cutting_n * end.radius_mm / 1000.0,
        seated,
    }
}

/// The equations that acted.
fn basis(job: &Job, outcome: &Outcome) -> Vec<Basis> {
    const COPYING: &str = "regenerative centring: Dall 1946, Gurney 1964, Rowe and Barash 1964";
    let mut used = vec![
        Basis { equation: "ring/2.2", source: "circle through the tip that touches both supports" },
        Basis { equation: "ring/5.1", source: COPYING },
    ];
    let mut add = |asked: bool, equations: &[(&'static str, &'static str)]| {
        if asked {
            used.extend(equations.iter().map(|&(equation, source)| Basis { equation, source }));
        }
    };
    let simulation = job.asks(Analysis::Simulation);
    add(
        simulation,
        &[
            ("ring/3.1", "exact location on both supports"),
            ("ring/3.3", "node-aligned stepping"),
            ("ring/3.4", "wide-edge removal"),
            ("ring/6.1", "causes of the error, first order"),
            ("ring/6.2", "causes switched off in turn"),
            ("ring/8.1", "repetition with another number of nodes"),
        ],
    );
    add(simulation && job.supports.roller_radius_mm > 0.0, &[("ring/3.2", "envelope of the roller")]);
    add(simulation && job.tool.wheel_radius_mm.is_some(), &[("ring/3.5", "sides of the wheel")]);
    add(simulation && job.method == Method::NearestSamples, &[("ring/9.1", "Shchurova 2012")]);
    add(outcome.setting.cut_force.is_some(), &[("ring/4.3", "Kienzle, VDI-Z. 94 (1952) 299-305, over the whole edge")]);
    add(job.forces.is_some(), &[("ring/4.1", "equilibrium of the ring")]);
    add(job.stiffness.is_some(), &[("ring/4.2", "stiffness of tool and supports")]);
    add(
        job.asks(Analysis::LinearTheory) || job.asks(Analysis::SetupMap),
        &[("ring/5.2", COPYING), ("ring/5.3", COPYING)],
    );
    add(job.dynamics.is_some(), &[("ring/5.6", "regenerative chatter: Tobias, Fishwick 1958; Tlusty, Polacek 1963")]);
    add(job.asks(Analysis::SetupMap) && job.setup_map.cut_everywhere, &[("ring/7.3", "simulation of every cell")]);
    add(job.asks(Analysis::SettingsSearch), &[("ring/5.4", COPYING), ("ring/7.1", "scan by simulation")]);
    add(outcome.conformance.is_some(), &[("certainty/7.1", "lines over a response surface, rings cut on them")]);
    used.extend(
        job.effects.iter().map(|effect| Basis { equation: effect.cause().equation, source: "catalogue of effects" }),
    );
    used
}

/// Everything that this calculator may utter, from where it is said.
const CODES: Codes = Codes {
    faults: &[job::check::CODES, DISTRIBUTION_CODES, QUANTITY_CODES, MISSING_CODES, crate::certainty::open::CODES],
    failures: &[model::simulate::FAILURE_CODES, &["no_end_position"]],
    warnings: &[answer::advice::WARNING_CODES, answer::conformance::WARNING_CODES],
    explanations: &[answer::advice::EXPLANATION_CODES, answer::conformance::EXPLANATION_CODES],
    stages: &[&[
        "stage_revolution",
        "stage_speed_map",
        "stage_setup_map",
        "stage_search",
        "stage_search_wide",
        "stage_roundness_certainty",
        "stage_done",
    ]],
    labels: &[answer::picture::LABEL_CODES, answer::picture::DOUBT_LABELS, crate::certainty::picture::LABEL_CODES],
};
