//! Faults of a job: all of them, with what would mend them.

use std::collections::BTreeMap;

use super::choice::forms;
use super::input::{FitJob, FormChoice, KNOWN_OUTPUTS, MAX_TERMS, MAX_TRIALS, Place, known_variable};
use super::sample::{Sample, Term};
use crate::calculator::{Check, Finding, Violations};
use crate::machinability::ModelForm;
use crate::num::stats::regress;

/// Codes of the faults found here.
pub(super) const CODES: &[&str] = &[
    "too_many_trials",
    "no_output",
    "unknown_output_column",
    "output_is_variable",
    "named_twice",
    "unknown_variable_column",
    "unknown_factor",
    "too_many_terms",
    "nothing_varies",
    "duplicate_trial",
    "number_not_finite",
    "variable_not_positive",
    "constant_variable",
    "single_level_factor",
    "too_few_trials",
    "collinear_columns",
    "output_not_positive",
    "constant_output",
    "semi_log_not_allowed",
    "prediction_condition_missing",
    "unknown_level",
    "bad_speed",
    "bad_feed",
];

impl Check for FitJob {
    fn check(&self, violations: &mut Violations) {
        let before = Names::of(self);
        before.check(self, violations);
        self.check_numbers(violations);
        self.check_ids(violations);
        if !violations.is_empty() {
            // What follows makes sense of sound columns only.
            return;
        }
        for (index, output) in before.outputs.iter().enumerate() {
            let at = if self.outputs.is_empty() { "/trials".to_owned() } else { format!("/outputs/{index}") };
            self.check_output(output, &before.variables, &at, violations);
        }
        self.check_places(&before.variables, violations);
    }
}

/// The columns of a job.
struct Names {
    outputs: Vec<String>,
    variables: Vec<String>,
}

impl Names {
    fn of(job: &FitJob) -> Self {
        Self { outputs: job.wanted_outputs(), variables: job.wanted_variables() }
    }

    fn check(&self, job: &FitJob, violations: &mut Violations) {
        let rows = job.trials.rows();
        violations.require(rows.len() <= MAX_TRIALS, || {
            Finding::new("too_many_trials", "/trials").measured(rows.len() as f64, MAX_TRIALS as f64, "1")
        });
        violations
            .require(!self.outputs.is_empty(), || Finding::new("no_output", "/trials").with("there", numbers(job)));
        violations.require(!self.variables.is_empty() || !job.factors.is_empty(), || {
            Finding::new("nothing_varies", "/trials").with("there", numbers(job))
        });
        let terms = self.variables.len() + job.factors.len();
        violations.require(terms <= MAX_TERMS, || {
            Finding::new("too_many_terms", "/variables").measured(terms as f64, MAX_TERMS as f64, "1")
        });
        let known_number = |column: &String| rows.iter().any(|trial| trial.number(column).is_some());
        let lists = [("outputs", &job.outputs), ("variables", &job.variables), ("factors", &job.factors)];
        for (list, names) in lists {
            for (index, name) in names.iter().enumerate() {
                let pointer = || format!("/{list}/{index}");
                if names[..index].contains(name) {
                    violations.add(Finding::new("named_twice", pointer()).with("name", name.clone()));
                }
                let (known, code) = match list {
                    "factors" => (rows.iter().any(|t| t.factors.contains_key(name)), "unknown_factor"),
                    "variables" => (known_number(name), "unknown_variable_column"),
                    _ => (known_number(name), "unknown_output_column"),
                };
                violations.require(known, || {
                    let there = if list == "factors" { words(job) } else { numbers(job) };
                    Finding::new(code, pointer()).with("name", name.clone()).with("there", there)
                });
                violations.require(list != "outputs" || !self.variables.contains(name), || {
                    Finding::new("output_is_variable", pointer()).with("name", name.clone())
                });
                let power_law_only = KNOWN_OUTPUTS.iter().any(|o| o.column == name && o.power_law_only);
                violations.require(list != "outputs" || job.form != FormChoice::SemiLog || !power_law_only, || {
                    Finding::new("semi_log_not_allowed", pointer()).with("name", name.clone())
                });
            }
        }
        if let Some(factor) = &job.hold_out {
            violations.require(rows.iter().any(|trial| trial.factors.contains_key(factor)), || {
                Finding::new("unknown_factor", "/hold_out").with("name", factor.clone()).with("there", words(job))
            });
        }
    }
}

/// Columns of numbers that the table has.
fn numbers(job: &FitJob) -> Vec<String> {
    let fixed = crate::machinability::Variable::ALL
        .into_iter()
        .map(crate::machinability::Variable::field)
        .chain(KNOWN_OUTPUTS.iter().map(|output| output.column));
    let mut there: Vec<String> = fixed
        .filter(|column| job.trials.rows().iter().any(|trial| trial.number(column).is_some()))
        .map(str::to_owned)
        .collect();
    let further: std::collections::BTreeSet<&String> =
        job.trials.rows().iter().flat_map(|trial| trial.further.keys()).collect();
    there.extend(further.into_iter().take(20).cloned());
    there
}

/// Columns of words that the table has.
fn words(job: &FitJob) -> Vec<String> {
    let there: std::collections::BTreeSet<&String> =
        job.trials.rows().iter().flat_map(|trial| trial.factors.keys()).collect();
    there.into_iter().take(20).cloned().collect()
}

impl FitJob {
    fn check_numbers(&self, violations: &mut Violations) {
        let fixed = || {
            crate::machinability::Variable::ALL
                .into_iter()
                .map(crate::machinability::Variable::field)
                .chain(KNOWN_OUTPUTS.iter().map(|output| output.column))
        };
        let variables = self.wanted_variables();
        for (row, trial) in self.trials.rows().iter().enumerate() {
            for column in fixed() {
                let Some(value) = trial.number(column) else { continue };
                check_number(
                    column,
                    value,
                    &format!("/trials/{row}/{column}"),
                    known_variable(column).is_some(),
                    violations,
                );
            }
            for (column, value) in &trial.further {
                let pointer = format!("/trials/{row}/further/{}", escaped(column));
                check_number(column, *value, &pointer, variables.contains(column), violations);
            }
        }
        for (index, place) in self.predict.iter().enumerate() {
            for column in &variables {
                if let Some(value) = place.number(column) {
                    let inner = if known_variable(column).is_some() { String::new() } else { "further/".to_owned() };
                    check_number(
                        column,
                        value,
                        &format!("/predict/{index}/{inner}{}", escaped(column)),
                        true,
                        violations,
                    );
                }
            }
        }
        for (column, value) in &self.at.further {
            check_number(column, *value, &format!("/at/further/{}", escaped(column)), true, violations);
        }
        violations.require(self.confidence > 0.0 && self.confidence < 1.0, || {
            Finding::new("number_not_finite", "/confidence").with("name", "confidence")
        });
    }

    fn check_ids(&self, violations: &mut Violations) {
        let mut seen: BTreeMap<&str, usize> = BTreeMap::new();
        for (row, trial) in self.trials.rows().iter().enumerate() {
            if let Some(id) = trial.id.as_deref()
                && let Some(first) = seen.insert(id, row)
            {
                let finding = Finding::new("duplicate_trial", format!("/trials/{row}/id"));
                violations.add(finding.with("id", id.to_owned()).with("row", row).with("first", first));
            }
        }
    }

    fn check_output(&self, output: &str, variables: &[String], at: &str, violations: &mut Violations) {
        let forms = forms(self, output);
        for (row, trial) in self.used() {
            let value = trial.number(output);
            if forms == [ModelForm::LogLog] && value.is_some_and(|v| v <= 0.0) {
                let inner = if KNOWN_OUTPUTS.iter().any(|known| known.column == output) { "" } else { "further/" };
                let finding = Finding::new("output_not_positive", format!("/trials/{row}/{inner}{}", escaped(output)));
                let finding = finding.with("name", output.to_owned()).with("row", row);
                violations.add(finding.measured(value.unwrap_or(0.0), 0.0, super::input::unit_of(output)));
            }
        }
        let sample = Sample::new(self, output, variables);
        let named = |finding: Finding| finding.with("output", output.to_owned());
        for (index, column) in variables.iter().enumerate() {
            let design = sample.design.column(index + 1);
            let first = design.first().copied().unwrap_or(0.0);
            if design.iter().all(|x| x.to_bits() == first.to_bits()) && !design.is_empty() {
                let pointer = if self.variables.is_empty() { at.to_owned() } else { format!("/variables/{index}") };
                violations.add(named(Finding::new("constant_variable", pointer).with("name", column.clone())));
                return;
            }
        }
        for (index, factor) in self.factors.iter().enumerate() {
            if !sample.terms.iter().any(|term| term.column == *factor) {
                let finding = Finding::new("single_level_factor", format!("/factors/{index}"));
                violations.add(named(finding.with("name", factor.clone())));
                return;
            }
        }
        let coefficients = sample.terms.len() + 1;
        let (conditions, needed) = (sample.conditions.len(), coefficients + 1);
        if conditions < needed || sample.rows.len() < coefficients + 2 {
            let finding = Finding::new("too_few_trials", at);
            let finding = finding
                .with("coefficients", coefficients)
                .with("conditions", conditions)
                .with("trials", sample.rows.len())
                .with("incomplete", sample.incomplete)
                .with("enough", 3 * coefficients);
            violations.add(named(finding.measured(conditions as f64, needed.max(coefficients + 2) as f64, "1")));
            return;
        }
        let first = sample.values.first().copied().unwrap_or(0.0);
        if sample.values.iter().all(|value| value.to_bits() == first.to_bits()) {
            violations.add(named(Finding::new("constant_output", at).value(first, super::input::unit_of(output))));
            return;
        }
        if let Err(deficient) = regress(&sample.design, &sample.values) {
            let groups: Vec<String> = deficient
                .groups
                .iter()
                .map(|group| {
                    let mut names: Vec<String> =
                        group.iter().filter(|j| **j > 0).map(|j| term_name(&sample.terms[j - 1])).collect();
                    names.dedup();
                    names.join(" + ")
                })
                .collect();
            violations.add(named(Finding::new("collinear_columns", at).with("groups", groups)));
        }
    }

    fn check_places(&self, variables: &[String], violations: &mut Violations) {
        let Some(output) = self.wanted_outputs().into_iter().next() else { return };
        let sample = Sample::new(self, &output, variables);
        let standing = Place { further: self.at.further.clone(), factors: self.at.factors.clone(), ..Place::default() };
        let places = self.predict.iter().enumerate().map(|(index, place)| (format!("/predict/{index}"), place, true));
        for (pointer, place, is_prediction) in places.chain([("/at".to_owned(), &standing, false)]) {
            for column in variables {
                let given = place.number(column).or_else(|| self.at.further.get(column).copied());
                violations.require(given.is_some() || !is_prediction, || {
                    Finding::new("prediction_condition_missing", pointer.clone()).with("name", column.clone())
                });
            }
            for (factor, level) in &place.factors {
                let levels: Vec<String> = sample
                    .first_levels
                    .get(factor)
                    .into_iter()
                    .cloned()
                    .chain(sample.terms.iter().filter(|t| t.column == *factor).filter_map(level_of))
                    .collect();
                violations.require(levels.contains(level), || {
                    Finding::new("unknown_level", format!("{pointer}/factors/{}", escaped(factor)))
                        .with("name", factor.clone())
                        .with("level", level.clone())
                        .with("there", levels)
                });
            }
        }
    }
}

fn level_of(term: &Term) -> Option<String> {
    match &term.source {
        super::sample::Source::Level { level } => Some(level.clone()),
        super::sample::Source::Logarithm { .. } => None,
    }
}

/// How a term is called.
pub(super) fn term_name(term: &Term) -> String {
    level_of(term).map_or_else(|| term.column.clone(), |level| format!("{} = {level}", term.column))
}

fn check_number(column: &str, value: f64, pointer: &str, is_variable: bool, violations: &mut Violations) {
    if !value.is_finite() {
        violations.add(Finding::new("number_not_finite", pointer).with("name", column.to_owned()));
    } else if is_variable && value <= 0.0 {
        let code = match column {
            "speed_m_per_min" => "bad_speed",
            "feed_mm_per_rev" => "bad_feed",
            _ => "variable_not_positive",
        };
        let finding = Finding::new(code, pointer).with("name", column.to_owned());
        violations.add(finding.with("field", column.to_owned()).value(value, super::input::unit_of(column)));
    }
}

/// A name as a piece of a JSON Pointer.
fn escaped(name: &str) -> String {
    name.replace('~', "~0").replace('/', "~1")
}
