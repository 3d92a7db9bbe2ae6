//! Machinability models from a table of trials: `machinability-fit`.
//!
//! Ordinary least squares in the logarithms, `L = c_0 + sum a_k ln x_k + shifts of factors`, with L the logarithm
//! of the output (`log_log`) or the output (`semi_log`); the variables are taken about their geometric means while
//! fitting. What the model is worth is measured on conditions that it has not seen; whether the form, the terms and the
//! scatter are what they are taken for is tested; where a prediction leaves the convex hull of the trials it says so.
//!
//! The way of a job: `input` -> `check` -> `sample` (columns, conditions, folds) -> `choice` (form, terms) over
//! `regression` -> `report` (answer), `advice`, `picture`.

mod advice;
mod check;
mod choice;
mod input;
mod output;
mod picture;
mod regression;
mod report;
mod sample;

pub use input::{FitJob, FormChoice, MAX_TRIALS, Place, Standing, Terms, Trial};
pub use output::{
    Coefficient, CrossValidation, Design, FactorSpan, FitOutcome, FittedFurther, FittedModels, MissingTerm, OtherForm,
    OutputFit, Prediction, PureError, Rival, TestResult, TrialColumns, VariableSpan,
};

use crate::calculator::{
    Answer, Basis, Calculator, CalculatorKind, Codes, Cost, Example, Failure, Figure, Finding, Hallmark, Message, Meta,
    Monitor, Table, checkpoint,
};
use crate::num::stats::GENERATOR;

use report::Fit;
use sample::Sample;

/// The evaluation.
#[derive(Debug, Clone, Copy)]
pub struct MachinabilityFit;

impl Calculator for MachinabilityFit {
    type Input = FitJob;
    type Output = FitOutcome;

    const META: Meta = Meta {
        id: "machinability-fit",
        kind: CalculatorKind::Evaluation,
        version: 3,
        title: "Machinability models from trials",
        question: "Which models of roughness, tool life and force do my own trials give, and how far can they be trusted?",
        summary: "From a table of trials: power laws or semi-logarithmic models of every measured output in the form that \
                  a feed schedule takes, with intervals of the coefficients, the error on conditions held out, tests of \
                  form, scatter and order, outliers and leverage, and a warning where a prediction leaves the hull of the \
                  trials.",
        references: &[
            "D. A. Belsley, E. Kuh, R. E. Welsch, Regression Diagnostics, Wiley 1980",
            "N. R. Draper, H. Smith, Applied Regression Analysis, 3rd ed., Wiley 1998",
            "C. M. Hurvich, C.-L. Tsai, Regression and time series model selection in small samples, Biometrika 76 (1989) 297-307",
            "P. Wolfe, Finding the nearest point in a polytope, Mathematical Programming 11 (1976) 128-149",
        ],
        examples: &[
            Example {
                id: "roughness_and_life",
                title: "Roughness, tool life and passive force over speed, feed and depth, with repeats in the middle",
                job: include_str!("examples/roughness_and_life.json"),
            },
            Example {
                id: "batches_and_nose_radius",
                title: "Roughness with a further variable and a factor, smallest sufficient model, a prediction outside the trials",
                job: include_str!("examples/batches_and_nose_radius.json"),
            },
        ],
        hallmarks: &[
            Hallmark::Count("/trials"),
            Hallmark::Of("/outputs/*"),
            Hallmark::Of("/trials/*/speed_m_per_min"),
            Hallmark::Of("/trials/*/feed_mm_per_rev"),
        ],
        study_outputs: &["/worst_held_out_error_percent", "/design/hull_share"],
        codes: CODES,
        figures: picture::FIGURE_IDS,
        tables: picture::TABLE_IDS,
        program: None,
    };

    fn fill(_job: &mut FitJob) {}

    fn cost(job: &FitJob) -> Cost {
        let rows = job.trials.rows().len() as f64;
        let terms = 4.0 + job.variables.len() as f64 + 2.0 * job.factors.len() as f64;
        let outputs = job.outputs.len().max(2) as f64;
        let sets = if job.terms == Terms::Best { (terms - 1.0).min(8.0).exp2() } else { 1.0 };
        // Measured: about 6 ns per row and squared term for one regression.
        let regressions = 2.0 * sets + 10.0 + f64::from(job.resamples);
        let ms = outputs * (1.0 + regressions * rows * terms * terms * 1.2e-5);
        let bytes = 1_000_000 + job.trials.rows().len() as u64 * 4000 + u64::from(job.resamples) * 200;
        Cost { ms, bytes, driver: "/resamples" }
    }

    fn run(job: &FitJob, monitor: &dyn Monitor) -> Result<Answer<FitOutcome>, Failure> {
        run(job, monitor)
    }

    fn figures(job: &FitJob, outcome: &FitOutcome) -> Vec<Figure> {
        picture::figures(job, outcome)
    }

    fn tables(job: &FitJob, outcome: &FitOutcome) -> Vec<Table> {
        picture::tables(job, outcome)
    }
}

fn run(job: &FitJob, monitor: &dyn Monitor) -> Result<Answer<FitOutcome>, Failure> {
    checkpoint(monitor)?;
    let (columns, variables) = (job.wanted_outputs(), job.wanted_variables());
    let mut fits = Vec::new();
    for (index, column) in columns.iter().enumerate() {
        checkpoint(monitor)?;
        monitor.progress(index as f64 / columns.len() as f64, Message::new("stage_fit").with("output", column.clone()));
        let sample = Sample::new(job, column, &variables);
        let choice = choice::choose(job, column, &sample).ok_or_else(|| {
            Failure::OutOfModel(Finding::new("fit_impossible", "/trials").with("output", column.clone()))
        })?;
        fits.push(Fit { job, column: column.clone(), sample, choice });
    }
    let mut models = FittedModels::default();
    let (mut outputs, mut predictions) = (Vec::new(), Vec::new());
    for fit in &fits {
        checkpoint(monitor)?;
        let hull = fit.sample.unit_points();
        let output = fit.output();
        models.put(&output.name, &output.unit, fit.model());
        predictions.extend(fit.predictions(&hull));
        outputs.push(output);
    }
    checkpoint(monitor)?;
    monitor.progress(0.9, Message::new("stage_hull"));
    let Some(first) = fits.first() else { return Err(Failure::Internal("a job without outputs".to_owned())) };
    let design = report::design(job, &first.sample, &first.sample.unit_points());
    let worst = outputs.iter().filter_map(|o: &OutputFit| o.cross_validation.error_percent).reduce(f64::max);
    let outcome = FitOutcome {
        models,
        worst_held_out_error_percent: worst,
        outputs,
        design,
        predictions,
        generator: GENERATOR.to_owned(),
    };
    let warnings = advice::warnings(job, &fits, &outcome);
    let explanation = advice::explanation(&fits, &outcome, job);
    monitor.progress(1.0, Message::new("stage_fitted"));
    Ok(Answer { output: outcome, warnings, explanation, basis: BASIS.to_vec() })
}

const BASIS: [Basis; 6] = [
    Basis { equation: "fit/1.1", source: "ordinary least squares in logarithms" },
    Basis { equation: "fit/1.2", source: "intervals by Student's t" },
    Basis { equation: "fit/2.1", source: "held-out errors in closed form (Belsley, Kuh, Welsch 1980)" },
    Basis { equation: "fit/3.1", source: "Hurvich, Tsai 1989" },
    Basis { equation: "fit/4.1", source: "pure error and lack of fit (Draper, Smith 1998)" },
    Basis { equation: "fit/5.1", source: "nearest point of a polytope (Wolfe 1976)" },
];

/// Everything that this evaluation may utter.
const CODES: Codes = Codes {
    faults: &[check::CODES],
    failures: &[&["fit_impossible"]],
    warnings: &[advice::WARNING_CODES],
    explanations: &[advice::EXPLANATION_CODES],
    stages: &[&["stage_fit", "stage_hull", "stage_fitted"]],
    labels: &[picture::LABEL_CODES],
};
