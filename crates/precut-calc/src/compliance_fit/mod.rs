//! Compliances of a lathe from a static test: known loads on a bar, readings of a dial gauge (`library/7`).
//!
//! The way of a job: `input` -> `check` -> `model` (readings and slopes from compliances) -> `solve` (least squares with
//! bounds, uncertainty, which load tells more) -> `output`; `advice` says what it means, `picture` draws.

mod advice;
mod check;
mod input;
mod model;
mod output;
mod picture;
mod solve;

pub use input::{BarSegment, GaugeRow, GaugedAt, Job, MAX_ROWS, TestBar, TestSupport};
pub use output::{FittedRow, FoundCompliance, GaugeFit, MeasuredNumber, NextLoad, Outcome, Part};

use crate::calculator::{
    Answer, Basis, Calculator, CalculatorKind, Codes, Cost, Example, Failure, Figure, Hallmark, Message, Meta, Monitor,
    Table, checkpoint,
};
use crate::material;
use crate::num::stats::t_quantile;

use model::{Model, Unknown};
use solve::Found;

const DEFAULT_POISSON_RATIO: f64 = 0.3;
const PERCENT: f64 = 100.0;
/// A number whose relative standard uncertainty is below this is known well enough, %.
const KNOWN_PERCENT: f64 = 10.0;
/// Largest relative uncertainty that a record keeps, %.
const MOST_PERCENT: f64 = 200.0;
/// Degrees of freedom of a gauge whose error is stated: the normal distribution.
const MANY: f64 = 1e6;
/// Probability of an interval.
const LEVEL: f64 = 0.95;

/// The evaluation.
#[derive(Debug, Clone, Copy)]
pub struct ComplianceFit;

impl Calculator for ComplianceFit {
    type Input = Job;
    type Output = Outcome;

    const META: Meta = Meta {
        id: "compliance-fit",
        kind: CalculatorKind::Evaluation,
        version: 1,
        title: "Machine from a dial gauge",
        question: "How much do headstock, tailstock and carriage of my lathe yield, and how well do my readings know it?",
        summary: "From known loads on a bar as it will be held and the readings of a dial gauge: the compliances of centres, \
                  chuck (against rotation, too), rest and carriage with their uncertainties, play where it is asked for, \
                  whether the readings fit, which further load would tell most, and what a machine's record takes over. \
                  Bending and shear of the bar are counted; least squares with bounds.",
        references: &[
            "Timoshenko, Gere, Mechanics of materials, theorem of Castigliano",
            "Cowper, The shear coefficient in Timoshenko's beam theory, J. Appl. Mech. 33 (1966) 335-340",
            "JCGM 100:2008, Guide to the expression of uncertainty in measurement",
        ],
        examples: &[
            Example {
                id: "two_centres",
                title: "Bar of 80 x 600 between centres, loaded at four stations, and the carriage",
                job: include_str!("examples/two_centres.json"),
            },
            Example {
                id: "chuck_alone",
                title: "Bar of 60 in a chuck: its radial and its rotational compliance",
                job: include_str!("examples/chuck_alone.json"),
            },
        ],
        hallmarks: &[
            Hallmark::Count("/measurements"),
            Hallmark::Count("/supports"),
            Hallmark::Of("/bar/segments/*/diameter_mm"),
            Hallmark::Of("/gauge_error_um"),
        ],
        study_outputs: &["/fit/rms_um", "/fit/widened"],
        codes: CODES,
        figures: picture::FIGURE_IDS,
        tables: picture::TABLE_IDS,
        program: None,
    };

    fn fill(job: &mut Job) {
        if let Some(found) = job.bar.material.take().as_deref().and_then(material::find) {
            job.bar.youngs_modulus_n_per_mm2.get_or_insert(found.youngs_modulus_n_per_mm2.value);
            job.bar.poisson_ratio.get_or_insert(found.poisson_ratio.value);
        }
        job.bar.poisson_ratio.get_or_insert(DEFAULT_POISSON_RATIO);
    }

    fn cost(job: &Job) -> Cost {
        // Measured: about 10 us a row and step, some ten steps, and as much for each load that is tried.
        // Rows are far fewer than 2^53.
        #[allow(clippy::cast_precision_loss)]
        let rows = job.measurements.rows().len() as f64;
        Cost {
            ms: 2.0 + 1.2 * rows,
            bytes: 100_000 + job.measurements.rows().len() as u64 * 2000,
            driver: "/measurements",
        }
    }

    fn run(job: &Job, monitor: &dyn Monitor) -> Result<Answer<Outcome>, Failure> {
        checkpoint(monitor)?;
        monitor.progress(0.0, Message::new("stage_compliances"));
        let output = outcome(job, monitor)?;
        let warnings = advice::warnings(job, &output);
        let explanation = advice::explanation(&output);
        monitor.progress(1.0, Message::new("stage_done"));
        Ok(Answer { output, warnings, explanation, basis: BASIS.to_vec() })
    }

    fn figures(job: &Job, outcome: &Outcome) -> Vec<Figure> {
        picture::figures(job, outcome)
    }

    fn tables(_job: &Job, outcome: &Outcome) -> Vec<Table> {
        picture::tables(outcome)
    }
}

/// The equations that act.
const BASIS: &[Basis] = &[
    Basis { equation: "library/7", source: "bar on springs, theorem of Castigliano" },
    Basis { equation: "deflection/3.2", source: "Timoshenko's beam, Cowper 1966" },
];

/// Everything that this evaluation may utter.
const CODES: Codes = Codes {
    faults: &[check::CODES],
    failures: &[solve::FAILURE_CODES],
    warnings: &[advice::WARNING_CODES],
    explanations: &[advice::EXPLANATION_CODES],
    stages: &[&["stage_compliances", "stage_done"]],
    labels: &[picture::LABEL_CODES],
};

fn outcome(job: &Job, monitor: &dyn Monitor) -> Result<Outcome, Failure> {
    let model = Model::new(job);
    let found = solve::solve(&model, monitor)?;
    checkpoint(monitor)?;
    let compliances: Vec<FoundCompliance> = (0..model.unknowns.len()).map(|j| compliance(&model, &found, j)).collect();
    let predicted = model
        .predict(&found.values, job.measurements.rows())
        .ok_or_else(|| Failure::Internal("a fitted bar does not stand".to_owned()))?;
    let rows: Vec<FittedRow> = predicted
        .iter()
        .zip(job.measurements.rows())
        .enumerate()
        .map(|(i, (predicted, row))| FittedRow {
            row: i + 1,
            reading_um: row.reading_um,
            predicted_um: predicted.reading_um,
            bending_um: predicted.bending_um,
            residual: (row.reading_um - predicted.reading_um) / job.gauge_error_um,
        })
        .collect();
    // Rows are far fewer than 2^53.
    #[allow(clippy::cast_precision_loss)]
    let count = rows.len() as f64;
    let squares: f64 = rows.iter().map(|row| (row.reading_um - row.predicted_um).powi(2)).sum();
    let fit = GaugeFit {
        rows: rows.len(),
        spare_rows: rows.len() - model.unknowns.len(),
        rms_um: (squares / count).sqrt(),
        repeat_um: found.repeat_um,
        p_value: found.p_value,
        widened: found.widened,
    };
    let next_load = next_load(&model, &found, &compliances);
    let set = record(&model, &compliances, rows.len());
    Ok(Outcome { compliances, fit, next_load, set, rows })
}

fn compliance(model: &Model<'_>, found: &Found, j: usize) -> FoundCompliance {
    let (value, uncertainty) = (found.values[j], found.uncertainties[j]);
    let half = t_quantile(0.5 + 0.5 * LEVEL, MANY) * uncertainty;
    let of = model.part(model.unknowns[j]);
    FoundCompliance {
        of,
        support: match model.unknowns[j] {
            Unknown::Radial(index) | Unknown::Rotation(index) => Some(index),
            Unknown::Carriage | Unknown::PlayAtWork | Unknown::PlayAtTool => None,
        },
        unit: of.unit().to_owned(),
        value,
        standard_uncertainty: uncertainty,
        lower: (value - half).max(0.0),
        upper: value + half,
    }
}

/// Relative standard uncertainty, %; of a number that is 0, and of one that is known to less, the most that is told.
fn percent(value: f64, uncertainty: f64) -> f64 {
    if value > 0.0 { (PERCENT * uncertainty / value).min(MOST_PERCENT) } else { MOST_PERCENT }
}

/// What one more reading would narrow the least known compliance to, where that is worth it.
fn next_load(model: &Model<'_>, found: &Found, compliances: &[FoundCompliance]) -> Option<NextLoad> {
    let relative = |j: usize| percent(compliances[j].value, compliances[j].standard_uncertainty);
    let is_compliance = |j: &usize| !matches!(model.unknowns[*j], Unknown::PlayAtWork | Unknown::PlayAtTool);
    let least = (0..compliances.len()).filter(is_compliance).max_by(|&a, &b| relative(a).total_cmp(&relative(b)))?;
    if relative(least) <= KNOWN_PERCENT {
        return None;
    }
    let (row, uncertainty) = solve::narrowing(model, found, least)?;
    Some(NextLoad {
        at: row.gauged_at(),
        z_load_mm: row.z_load_mm,
        force_n: row.force_n,
        narrows: compliances[least].of,
        now_percent: relative(least),
        then_percent: percent(compliances[least].value, uncertainty),
    })
}

/// What a machine's record takes over: what the readings tell from 0.
fn record(
    model: &Model<'_>,
    compliances: &[FoundCompliance],
    rows: usize,
) -> std::collections::BTreeMap<String, MeasuredNumber> {
    let seen = |(j, one): (usize, &FoundCompliance)| {
        let place = model.place_in_record(model.unknowns[j]).filter(|_| !advice::is_unseen(one))?;
        let number = MeasuredNumber {
            value: one.value,
            source: format!("dial gauge, {rows} readings"),
            certainty: "measured".to_owned(),
            determined_by: "measured".to_owned(),
            relative_standard_uncertainty_percent: percent(one.value, one.standard_uncertainty),
        };
        Some((place.to_owned(), number))
    };
    compliances.iter().enumerate().filter_map(seen).collect()
}
