//! Fixture parameters from a measured table of amplitude against depth: `fixture-identification`.
//!
//! Rows below the limit of chatter fix the compliance under the force, the depth of the jump fixes the multiplier, rows
//! above it show what becomes of the surface that a tooth leaves uncut. Parameters are searched in a box, first without a
//! run in time (forced motion and side of the limit), then with one for every row that chatters; laws that exclude each
//! other are searched side by side and compared by their fit.
//!
//! The way of a job: `input` -> `check` -> `unknowns` (parameters to cut and vise) -> `problem` (rows, objective) ->
//! `search` -> `certainty` -> `report`, `advice`, `picture`. The physics is that of fixture stability.

mod advice;
mod certainty;
mod check;
mod input;
mod output;
mod picture;
mod problem;
mod report;
mod search;
mod unknowns;

pub use input::{
    AmplitudeMeaning, AmplitudeRow, CutOfTable, CutterOfTable, IdentificationJob, MAX_ROWS, OpenedJoint, PeakForce,
    RowRuns, SearchSettings, Unknowns,
};
pub use output::{
    ClampBounds, Combination, HypothesisFit, IdentificationOutcome, IdentifiedFixture, IdentifiedParameter,
    IdentifiedRow, OnsetFit, ParameterPair, TableFit,
};

use crate::calculator::{
    Answer, Basis, Calculator, CalculatorKind, Codes, Cost, Example, Failure, Figure, Hallmark, Message, Meta, Monitor,
    Table, checkpoint,
};
use crate::num::evolve::Member;

use certainty::Certainty;
use problem::{Law, Problem};
use report::{Tried, outcome};
use search::{Found, best_set, first_sets};
use unknowns::{Parameter, Values};

/// The evaluation.
#[derive(Debug, Clone, Copy)]
pub struct FixtureIdentification;

impl Calculator for FixtureIdentification {
    type Input = IdentificationJob;
    type Output = IdentificationOutcome;

    const META: Meta = Meta {
        id: "fixture-identification",
        kind: CalculatorKind::Evaluation,
        version: 4,
        title: "Fixture parameters from a table",
        question: "Which stiffness, damping and mass explain my table of amplitude against depth, and how far does it fix them?",
        summary: "From amplitudes measured at several depths: stiffness, natural frequency, damping and force parameters of \
                  a workpiece in its vise, each with its interval and what it cannot be told apart from; every row \
                  measured and predicted; where chatter begins; the law of regeneration that fits best; and the bounds \
                  that opened and closed joints set to the clamp force.",
        references: &[
            "Petrakov, Conditions of workpiece clamping in fixtures of the first and second type in face milling, NTUU KPI, 2014",
            "Zhang, Sanderson, JADE: adaptive differential evolution with optional external archive, IEEE Trans. Evol. Comput. 13 (2009) 945-958",
            "Nelder, Mead, A simplex method for function minimization, Computer Journal 7 (1965) 308-313",
            "Huber, Robust estimation of a location parameter, Ann. Math. Statist. 35 (1964) 73-101",
        ],
        examples: &[
            Example {
                id: "paper_screw_vise",
                title: "A screw vise known from its table: every row predicted",
                job: include_str!("examples/paper_screw_vise.json"),
            },
            Example {
                id: "paper_pneumatic_vise",
                title: "A pneumatic vise, predicted with what the screw vise taught",
                job: include_str!("examples/paper_pneumatic_vise.json"),
            },
            Example {
                id: "stiffness_and_damping",
                title: "Stiffness and damping of a clamped part of known mass, from ten cuts",
                job: include_str!("examples/stiffness_and_damping.json"),
            },
        ],
        hallmarks: &[
            Hallmark::Count("/measurements"),
            Hallmark::Of("/fixture/kind"),
            Hallmark::Of("/cutter/diameter_mm"),
            Hallmark::Of("/cut/width_mm"),
            Hallmark::Of("/cut/spindle_speed_rpm"),
        ],
        study_outputs: &["/fit/objective", "/fit/rms_log", "/fit/median_log"],
        codes: CODES,
        figures: picture::FIGURE_IDS,
        tables: picture::TABLE_IDS,
        program: None,
    };

    fn fill(_job: &mut IdentificationJob) {}

    fn cost(job: &IdentificationJob) -> Cost {
        cost(job)
    }

    fn run(job: &IdentificationJob, monitor: &dyn Monitor) -> Result<Answer<IdentificationOutcome>, Failure> {
        run(job, monitor)
    }

    fn figures(job: &IdentificationJob, outcome: &IdentificationOutcome) -> Vec<Figure> {
        picture::figures(job, outcome)
    }

    fn tables(_job: &IdentificationJob, outcome: &IdentificationOutcome) -> Vec<Table> {
        picture::tables(outcome)
    }
}

fn run(job: &IdentificationJob, monitor: &dyn Monitor) -> Result<Answer<IdentificationOutcome>, Failure> {
    checkpoint(monitor)?;
    let problem = Problem::new(job, monitor);
    let laws: Vec<Law> = job
        .amplitudes
        .iter()
        .flat_map(|&amplitude| job.regenerations.iter().map(move |&regeneration| Law { regeneration, amplitude }))
        .collect();
    // Per law: a fifth for the first sets (once per meaning of the amplitude), the rest for the search.
    let parts = laws.len() as f64;
    let mut first: Vec<Member> = Vec::new();
    let mut tried: Vec<Tried> = Vec::with_capacity(laws.len());
    for (number, &law) in laws.iter().enumerate() {
        let from = number as f64;
        let part = |share: f64, message: Message| monitor.progress(0.95 * (from + share) / parts, message);
        let found = if problem.unknowns.is_empty() {
            Found { at: Vec::new(), objective: 0.0, evaluations: 1 }
        } else {
            if number % job.regenerations.len() == 0 {
                first = first_sets(&problem, law.amplitude, &|share, message| part(0.15 * share, message))?;
            }
            best_set(&problem, law, &first, &|share, message| part(0.15 + 0.85 * share, message))?
        };
        tried.push(Tried::new(&problem, law, found)?);
        monitor.interim(picture::so_far(job, &tried));
    }
    tried.sort_by(|a, b| a.fit(&problem).objective.total_cmp(&b.fit(&problem).objective));
    monitor.progress(0.96, Message::new("stage_identification_certainty"));
    let certainty = match tried.first() {
        Some(best) if !problem.unknowns.is_empty() => {
            certainty::certainty(&problem, best.law, &best.found.at, &best.coarse)?
        }
        _ => Certainty { sd: Vec::new(), correlations: Vec::new(), combinations: Vec::new(), scatter: 1.0 },
    };
    let outcome = outcome(&problem, &tried, &certainty)?;
    let warnings = advice::warnings(&problem, &outcome);
    let explanation = advice::explanation(&problem, &outcome);
    monitor.progress(1.0, Message::new("stage_identified"));
    Ok(Answer { output: outcome, warnings, explanation, basis: basis(job, &problem) })
}

fn basis(job: &IdentificationJob, problem: &Problem<'_>) -> Vec<Basis> {
    let mut used = vec![
        Basis { equation: "fixture/6.1", source: "ln of simulated over measured, Huber 1964" },
        Basis { equation: "fixture/5.1", source: "Floquet theory on spectral elements" },
        Basis { equation: "fixture/5.2", source: "periodic response of the linear system" },
        Basis { equation: "fixture/5.5", source: "exact propagation between steps" },
    ];
    if !problem.unknowns.is_empty() {
        used.push(Basis { equation: "fixture/6.2", source: "differential evolution, then a simplex" });
        used.push(Basis { equation: "fixture/6.3", source: "linearised about the best set" });
    }
    if job.measurements.rows().iter().any(|row| row.opened.is_some()) || job.fixture.common().3.is_some() {
        used.push(Basis { equation: "fixture/6.4", source: "elastic force of the joints" });
    }
    used
}

/// Expected work: every set runs the rows that chatter in time (50 ns a step; half of them are cut short), and
/// a multiplier for each row.
fn cost(job: &IdentificationJob) -> Cost {
    let rows = job.measurements.rows().len().max(1) as f64;
    let values = Values::stated(job);
    let highest = values.holding().modes().last().map_or(0.0, |mode| mode.natural_hz);
    let range = |parameter: Parameter| parameter.range(&job.unknowns).map(|[from, to]| (from * to).sqrt());
    let frequency = range(Parameter::NaturalFrequency).unwrap_or(highest);
    let slow = job.measurements.rows().iter().filter_map(|row| row.spindle_speed_rpm).reduce(f64::min);
    let speed = range(Parameter::SpindleSpeed).or(slow).or(job.cut.spindle_speed_rpm).unwrap_or(100.0);
    let teeth = job.measurements.rows().iter().filter_map(|row| row.teeth).min().or(job.cutter.teeth).unwrap_or(1);
    let oscillations = frequency * 60.0 / (speed * f64::from(teeth));
    let steps = (f64::from(job.simulation.steps_per_oscillation) * oscillations).clamp(200.0, 20_000.0);
    let run_ms = 0.5 * rows * steps * f64::from(job.simulation.tooth_periods) * 5e-5;
    let quick_ms = rows * 0.004 * (20.0 + oscillations);
    let laws = (job.amplitudes.len() * job.regenerations.len()).max(1) as f64;
    let unknowns = unknowns::Unknown::all(job).len() as f64;
    let sets = if unknowns > 0.0 { f64::from(job.search.members) * f64::from(job.search.generations) } else { 0.0 };
    let ms = laws * (sets * (quick_ms + 0.5 * (run_ms + quick_ms)) + (3.0 + 44.0 * unknowns) * (run_ms + quick_ms));
    let driver = if unknowns > 0.0 { "/search/generations" } else { "/measurements" };
    Cost { ms: ms + 5.0, bytes: 4_000_000 + job.measurements.rows().len() as u64 * 20_000, driver }
}

/// Everything that this evaluation may utter.
const CODES: Codes = Codes {
    faults: &[check::CODES],
    failures: &[&["undamped_resonance"]],
    warnings: &[advice::WARNING_CODES],
    explanations: &[advice::EXPLANATION_CODES],
    stages: &[&[
        "stage_identification_first",
        "stage_identification_search",
        "stage_identification_certainty",
        "stage_identified",
    ]],
    labels: &[picture::LABEL_CODES],
};
