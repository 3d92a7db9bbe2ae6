//! What is to be said of the fits: warnings and explanations.

use super::check::term_name;
use super::input::{FitJob, KNOWN_OUTPUTS};
use super::output::{FitOutcome, OutputFit};
use super::report::{Fit, closest_pair, swing};
use crate::calculator::{Finding, Message};
use crate::machinability::{ModelForm, Variable};

/// Codes of the warnings.
pub(super) const WARNING_CODES: &[&str] = &[
    "fit_extrapolates",
    "fit_lack_of_fit",
    "fit_outlier",
    "fit_unit_suspected",
    "fit_high_leverage",
    "fit_collinear",
    "fit_uneven_scatter",
    "fit_drift",
    "fit_not_normal",
    "fit_unused_column",
    "fit_incomplete_trials",
    "fit_copied_trials",
    "fit_corners_untried",
    "fit_few_trials",
    "fit_no_better_than_mean",
    "fit_unit_of_column_suspected",
];

/// Codes of the explanations.
pub(super) const EXPLANATION_CODES: &[&str] = &[
    "fit_predicts",
    "fit_predicts_semi_log",
    "fit_driven_by",
    "fit_not_determined",
    "fit_form_decided",
    "fit_form_undecided",
    "fit_rivals",
    "fit_terms_missing",
    "fit_to_the_noise",
    "fit_no_repeats",
    "fit_varies_not",
];

/// Level of the tests that warn.
const LEVEL: f64 = 0.01;
/// Variance inflation above which columns are called hard to tell apart (two columns: a correlation of 0.95).
const HARD: f64 = 10.0;
/// Most findings of one kind that are listed.
const MOST: usize = 10;

pub(super) fn warnings(job: &FitJob, fits: &[Fit<'_>], outcome: &FitOutcome) -> Vec<Finding> {
    let mut warnings = of_table(job, fits, outcome);
    for (fit, output) in fits.iter().zip(&outcome.outputs) {
        let said =
            |code: &'static str, pointer: String| Finding::new(code, pointer).with("output", output.name.clone());
        of_rows(job, fit, output, &mut warnings);
        if let Some(test) = output.lack_of_fit.as_ref().filter(|test| test.p_value < LEVEL) {
            let worst = output.missing_terms.first().filter(|term| term.p_value < 0.05);
            let finding = said("fit_lack_of_fit", "/trials".to_owned()).with("p_value", test.p_value);
            warnings.push(match worst {
                Some(term) => finding.with("column", term.column.clone()).with("with_column", term.with.clone()),
                None => finding,
            });
        }
        if output.largest_inflation > HARD
            && let Some((a, b, r)) = closest_pair(&fit.sample, &fit.sample.design)
        {
            let terms = &fit.sample.terms;
            let finding = said("fit_collinear", "/trials".to_owned()).measured(output.largest_inflation, HARD, "1");
            warnings.push(
                finding.with("first", term_name(&terms[a])).with("second", term_name(&terms[b])).with("correlation", r),
            );
        }
        let tests = [
            ("fit_uneven_scatter", &output.uneven_scatter),
            ("fit_drift", &output.drift_in_order),
            ("fit_not_normal", &output.normality),
        ];
        for (code, test) in tests {
            if let Some(test) = test.as_ref().filter(|test| test.p_value < LEVEL) {
                warnings.push(said(code, "/trials".to_owned()).with("p_value", test.p_value));
            }
        }
        let coefficients = output.coefficients.len();
        if output.conditions < 2 * coefficients {
            let finding = said("fit_few_trials", "/trials".to_owned()).with("coefficients", coefficients);
            warnings.push(finding.measured(output.conditions as f64, (2 * coefficients) as f64, "1"));
        }
        if let Some(share) = output.cross_validation.explained_share.filter(|share| *share <= 0.0) {
            warnings.push(said("fit_no_better_than_mean", "/trials".to_owned()).measured(share, 0.0, "1"));
        }
    }
    for prediction in outcome.predictions.iter().filter(|p| !p.within_hull) {
        let finding = Finding::new("fit_extrapolates", format!("/predict/{}", prediction.place));
        let finding = finding.with("output", prediction.output.clone());
        warnings.push(finding.measured(prediction.hull_distance, 0.0, "1"));
    }
    warnings
}

/// What concerns the table as a whole.
fn of_table(job: &FitJob, fits: &[Fit<'_>], outcome: &FitOutcome) -> Vec<Finding> {
    let mut warnings = Vec::new();
    let variables = job.wanted_variables();
    let outputs = job.wanted_outputs();
    let mut unused: Vec<String> = Vec::new();
    for trial in job.trials.rows() {
        let numbers = trial.further.keys().filter(|name| !variables.contains(name) && !outputs.contains(name));
        let words =
            trial.factors.keys().filter(|name| !job.factors.contains(name) && job.hold_out.as_ref() != Some(*name));
        for name in numbers.chain(words) {
            if !unused.contains(name) {
                unused.push(name.clone());
            }
        }
    }
    if !unused.is_empty() {
        unused.truncate(MOST);
        warnings.push(Finding::new("fit_unused_column", "/trials").with("columns", unused));
    }
    warnings.extend(suspicious_columns(job));
    for (fit, output) in fits.iter().zip(&outcome.outputs) {
        if fit.sample.incomplete > 0 {
            let finding = Finding::new("fit_incomplete_trials", "/trials").with("output", output.name.clone());
            warnings.push(finding.with("trials", fit.sample.incomplete));
        }
    }
    let rows = job.trials.rows();
    let anonymous = |row: usize| {
        let mut trial = rows[row].clone();
        trial.id = None;
        trial
    };
    let copied = (1..rows.len()).filter(|&row| anonymous(row) == anonymous(row - 1)).count();
    // Two equal neighbours happen with coarse gauges; a third of the table does not.
    if copied * 3 > rows.len() {
        warnings.push(Finding::new("fit_copied_trials", "/trials").with("trials", copied));
    }
    if outcome.design.hull_share < 0.95 && outcome.design.variables.len() > 1 {
        let finding = Finding::new("fit_corners_untried", "/trials");
        warnings.push(finding.measured(outcome.design.hull_share, 0.95, "1"));
    }
    warnings
}

/// Columns whose size no machine has in the unit that they claim.
fn suspicious_columns(job: &FitJob) -> Vec<Finding> {
    // The column, what its least and largest value say, and the unit that is likelier then.
    type Rule = (Variable, fn(f64, f64) -> bool, &'static str);
    let rules: [Rule; 3] = [
        (Variable::Speed, |_, high| high < 8.0, "m/s"),
        (Variable::Feed, |low, _| low > 5.0, "mm/min"),
        (Variable::Feed, |_, high| high < 0.003, "inch/rev"),
    ];
    let range = |variable: Variable| {
        let values: Vec<f64> = job.used().filter_map(|(_, trial)| trial.number(variable.field())).collect();
        (!values.is_empty()).then(|| {
            values.iter().fold((f64::INFINITY, 0.0_f64), |(low, high), value| (low.min(*value), high.max(*value)))
        })
    };
    let found = rules.into_iter().filter_map(|(variable, suspicious, unit)| {
        let (low, high) = range(variable)?;
        suspicious(low, high).then(|| {
            Finding::new("fit_unit_of_column_suspected", "/trials")
                .value(high, variable.unit())
                .with("name", variable.field())
                .with("looks_like", unit)
        })
    });
    found.collect()
}

/// Single trials that stand out.
fn of_rows(job: &FitJob, fit: &Fit<'_>, output: &OutputFit, warnings: &mut Vec<Finding>) {
    let inner = if KNOWN_OUTPUTS.iter().any(|known| known.column == output.column) { "" } else { "further/" };
    let pointer = |k: usize| format!("/trials/{}/{inner}{}", output.rows.row[k], output.column);
    let deleted = fit.deleted_errors();
    let outliers: Vec<usize> = (0..output.rows.row.len()).filter(|k| output.rows.outlier[*k]).collect();
    for &k in outliers.iter().take(MOST) {
        let factor = if output.form == ModelForm::LogLog { deleted[k].exp() } else { 1.0 };
        let unit = usual_slip(factor);
        let code = if unit.is_some() { "fit_unit_suspected" } else { "fit_outlier" };
        let row = output.rows.row[k];
        let finding = Finding::new(code, pointer(k)).with("output", output.name.clone()).with("row", row);
        let finding = finding
            .with("measured", output.rows.measured[k])
            .with("fitted", output.rows.fitted[k])
            .with("unit_of_output", output.unit.clone())
            .with("of", outliers.len());
        let finding = match &job.trials.rows()[row].id {
            Some(id) => finding.with("id", id.clone()),
            None => finding,
        };
        warnings.push(match unit {
            Some(factor) => finding.with("factor", factor),
            None => finding.with("studentised", output.rows.studentised[k].unwrap_or(0.0)),
        });
    }
    let limit = (3.0 * output.coefficients.len() as f64 / output.trials as f64).min(0.95);
    let high = (0..output.rows.row.len()).filter(|k| output.rows.leverage[*k] > limit);
    for k in high.take(MOST) {
        let finding = Finding::new("fit_high_leverage", format!("/trials/{}", output.rows.row[k]));
        let finding = finding.with("output", output.name.clone()).with("row", output.rows.row[k]);
        warnings.push(finding.measured(output.rows.leverage[k], limit, "1"));
    }
}

/// The factor of a wrong unit that a ratio is within 12 % of.
fn usual_slip(ratio: f64) -> Option<f64> {
    const SLIPS: [f64; 6] = [1000.0, 0.001, 25.4, 1.0 / 25.4, 39.37, 1.0 / 39.37];
    SLIPS.into_iter().find(|slip| (ratio / slip - 1.0).abs() < 0.12)
}

pub(super) fn explanation(fits: &[Fit<'_>], outcome: &FitOutcome, job: &FitJob) -> Vec<Message> {
    let mut said = Vec::new();
    for (fit, output) in fits.iter().zip(&outcome.outputs) {
        let of = |code: &'static str| Message::new(code).with("output", output.name.clone());
        let validation = &output.cross_validation;
        match (validation.error_percent, validation.error_of_output) {
            (Some(percent), _) => said.push(
                of("fit_predicts")
                    .with("error_percent", percent)
                    .with("trials", validation.predicted_trials)
                    .with("explained_share", validation.explained_share.unwrap_or(0.0)),
            ),
            (None, Some(error)) => said.push(
                of("fit_predicts_semi_log")
                    .with("error", error)
                    .with("unit", output.unit.clone())
                    .with("trials", validation.predicted_trials)
                    .with("explained_share", validation.explained_share.unwrap_or(0.0)),
            ),
            (None, None) => {}
        }
        let fitted = &fit.choice.fitted;
        let strongest = (0..fitted.terms.len())
            .max_by(|&a, &b| swing(&fit.sample, fitted, a).abs().total_cmp(&swing(&fit.sample, fitted, b).abs()));
        if let Some(place) = strongest {
            let change = swing(&fit.sample, fitted, place);
            let message = of("fit_driven_by").with("column", term_name(&fit.sample.terms[fitted.terms[place]]));
            let size = if fitted.form == ModelForm::LogLog { change.exp() } else { change };
            if size.is_finite() {
                said.push(
                    message.with("change", size).with("form", form_name(fitted.form)).with("unit", output.unit.clone()),
                );
            }
        }
        let open: Vec<String> = output
            .coefficients
            .iter()
            .filter(|c| c.p_value.is_some() && c.lower <= 0.0 && c.upper >= 0.0)
            .map(|c| c.name.clone())
            .collect();
        if !open.is_empty() {
            said.push(of("fit_not_determined").with("columns", open).with("confidence", job.confidence));
        }
        if let Some(other) = &output.other_form {
            let code = if output.form_decided == Some(true) { "fit_form_decided" } else { "fit_form_undecided" };
            said.push(
                of(code)
                    .with("form", form_name(output.form))
                    .with("other", form_name(other.form))
                    .with("criterion_above", other.criterion_above),
            );
        }
        if !output.rivals.is_empty() {
            let sets: Vec<String> = output.rivals.iter().take(3).map(|rival| rival.columns.join(", ")).collect();
            said.push(of("fit_rivals").with("sets", sets).with("count", output.rivals.len()));
        }
        let missing = || output.missing_terms.iter().filter(|term| term.p_value < 0.05);
        let columns: Vec<String> = missing().map(|term| term.column.clone()).collect();
        if !columns.is_empty() {
            let with_columns: Vec<String> = missing().map(|term| term.with.clone()).collect();
            said.push(of("fit_terms_missing").with("columns", columns).with("with_columns", with_columns));
        }
        match (&output.lack_of_fit, &output.pure_error) {
            (Some(test), Some(_)) if test.p_value >= LEVEL => {
                said.push(of("fit_to_the_noise").with("p_value", test.p_value));
            }
            (_, None) => said.push(of("fit_no_repeats")),
            _ => {}
        }
    }
    let constant: Vec<&'static str> = Variable::ALL
        .into_iter()
        .map(Variable::field)
        .filter(|column| {
            !job.wanted_variables().iter().any(|used| used == column)
                && job.used().any(|(_, trial)| trial.number(column).is_some())
        })
        .collect();
    if !constant.is_empty() {
        said.push(Message::new("fit_varies_not").with("columns", constant));
    }
    said
}

fn form_name(form: ModelForm) -> &'static str {
    match form {
        ModelForm::LogLog => "log_log",
        ModelForm::SemiLog => "semi_log",
    }
}
