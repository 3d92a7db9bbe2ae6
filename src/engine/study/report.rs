//! From the rows of a study to what is to be said of them.

use std::collections::{BTreeMap, BTreeSet};

use precut_calc::calculator::{Basis, Finding, Message, Value};
use serde_json::{Map, Value as Json};

use super::figure::set;
use super::input::Combine;
use super::label::{Side, ways};
use super::pick::Cited;
use super::plan::Plan;
use super::point::{Shard, Warned, Warnings};
use super::result::{Extreme, FailureCount, OutputField, Row, Setting, Status, StudyResult, VariedField};
use crate::registry::{ResultNotes, interned};
use crate::text::datum;

/// Codes of what a study explains.
pub(crate) const EXPLANATIONS: &[&str] = &[
    "study_constant",
    "study_dominant",
    "study_extremes",
    "study_least_at_end",
    "study_largest_at_end",
    "study_no_answers",
    "study_own_error",
    "study_some_failed",
];
/// Codes of what a study warns of.
pub(crate) const WARNINGS: &[&str] = &["study_points_warn"];

/// So many outputs are spoken of.
const OUTPUTS_SPOKEN_OF: usize = 4;
/// Values that differ by no more than this share of their size are the same to the reader: what is left is rounding.
const SAME: f64 = 1e-5;
/// So many reasons are named.
const REASONS_NAMED: usize = 5;

/// The result of a study and what is to be said of it.
pub(crate) fn report(plan: &Plan, shards: Vec<Shard>) -> (StudyResult, ResultNotes) {
    let mut rows = Vec::with_capacity(plan.points);
    let mut warnings = Warnings::default();
    let mut basis: BTreeSet<Cited> = BTreeSet::new();
    for shard in shards {
        rows.extend(shard.rows);
        for warned in shard.warnings {
            warnings.add(warned);
        }
        basis.extend(shard.basis);
    }
    let succeeded = rows.iter().filter(|row| row.status == Status::Succeeded).count();
    let result = StudyResult {
        calculator: plan.entry.meta().id.to_owned(),
        calculator_version: plan.entry.meta().version,
        points: plan.points,
        succeeded,
        failed: plan.points - succeeded,
        combine: plan.input.combine,
        variables: plan
            .variables
            .iter()
            .map(|variable| VariedField {
                pointer: variable.pointer.clone(),
                unit: variable.unit.clone(),
                spacing: variable.spacing,
                values: variable.values.iter().filter_map(Setting::of).collect(),
            })
            .collect(),
        outputs: outputs(plan, &rows),
        failures: failures(&rows),
        rows,
    };
    let notes = ResultNotes {
        warnings: warnings.into_list().into_iter().map(|warning| warned(warning, succeeded)).collect(),
        explanation: explanation(plan, &result),
        basis: basis
            .into_iter()
            // Written by calculators of ours, of which each has a handful.
            .map(|cited| Basis { equation: interned(&cited.equation), source: interned(&cited.source) })
            .collect(),
    };
    (result, notes)
}

fn warned(warned: Warned, of: usize) -> Finding {
    let Warned { code, pointer, points, first } = warned;
    Finding::new("study_points_warn", format!("/job{pointer}"))
        .with("code", code)
        .with("points", points)
        .with("of", of)
        .with("first", told(&first))
}

/// What a warning says, so that its sentence can be said inside another one, in any language: `[name, value]` of each
/// of its numbers and names.
fn told(said: &Map<String, Json>) -> Value {
    let own = ["value", "limit", "unit"].into_iter().filter_map(|name| Some((name, said.get(name)?)));
    let further = said.get("values").and_then(Json::as_object).into_iter().flatten();
    let pairs = own.chain(further.map(|(name, value)| (name.as_str(), value)));
    let pair = |(name, value): (&str, &Json)| Some(Value::List(vec![name.to_owned().into(), datum(value)?]));
    Value::List(pairs.filter_map(pair).collect())
}

fn outputs(plan: &Plan, rows: &[Row]) -> Vec<OutputField> {
    let field = |(index, output): (usize, &super::plan::Output)| {
        let extreme = |better: fn(f64, f64) -> bool| {
            let mut best: Option<(usize, f64)> = None;
            for (row, value) in rows.iter().enumerate().filter_map(|(row, one)| Some((row, one.outputs[index]?))) {
                if best.is_none_or(|(_, so_far)| better(value, so_far)) {
                    best = Some((row, value));
                }
            }
            best.map(|(row, value)| Extreme {
                value,
                row,
                at: rows[row].values.clone(),
                at_end_of: ends(plan, &rows[row].values),
            })
        };
        OutputField {
            pointer: output.pointer.clone(),
            unit: output.unit.clone(),
            least: extreme(|a, b| a < b),
            largest: extreme(|a, b| a > b),
        }
    };
    plan.outputs.iter().enumerate().map(field).collect()
}

/// The numeric variables that stand at an end of their values.
fn ends(plan: &Plan, settings: &[Setting]) -> Vec<String> {
    let is_end = |(index, setting): (usize, &Setting)| {
        let here = setting.number()?;
        let values: Vec<f64> = plan.variables[index].values.iter().filter_map(serde_json::Value::as_f64).collect();
        let beyond = |more: fn(f64, f64) -> bool| values.iter().any(|&value| more(value, here));
        let inside = beyond(|value, here| value < here) && beyond(|value, here| value > here);
        (!inside).then(|| plan.variables[index].pointer.clone())
    };
    settings.iter().enumerate().filter_map(is_end).collect()
}

fn failures(rows: &[Row]) -> Vec<FailureCount> {
    let mut counts: BTreeMap<(Status, &str), (usize, usize)> = BTreeMap::new();
    for (number, row) in rows.iter().enumerate() {
        if let Some(code) = &row.code {
            counts.entry((row.status, code.as_str())).or_insert((0, number)).0 += 1;
        }
    }
    let mut counts: Vec<FailureCount> = counts
        .into_iter()
        .map(|((status, code), (points, first_row))| FailureCount { status, code: code.to_owned(), points, first_row })
        .collect();
    counts.sort_by(|a, b| b.points.cmp(&a.points).then(a.first_row.cmp(&b.first_row)));
    counts
}

fn explanation(plan: &Plan, result: &StudyResult) -> Vec<Message> {
    let mut said = Vec::new();
    let reasons: Vec<String> = result
        .failures
        .iter()
        .take(REASONS_NAMED)
        .map(|one| format!("{} {} ({})", one.points, one.code, one.status.name()))
        .collect();
    if result.succeeded == 0 {
        said.push(Message::new("study_no_answers").with("points", result.points).with("reasons", reasons));
        return said;
    }
    let names = Names::of(plan, result);
    for (index, output) in result.outputs.iter().take(OUTPUTS_SPOKEN_OF).enumerate() {
        let (Some(least), Some(largest)) = (&output.least, &output.largest) else { continue };
        let unit = output.unit.clone().unwrap_or_else(|| "1".to_owned());
        let message = |code| {
            let name = names.outputs[index].clone();
            Message::new(code).with("output", output.pointer.clone()).with("name", name)
        };
        let with_least = |code| message(code).with("unit", unit.clone()).with("least", least.value);
        if (largest.value - least.value).abs() <= SAME * largest.value.abs().max(least.value.abs()) {
            let without_influence = seen_varied(result, index);
            said.push(
                with_least("study_constant")
                    .with("points", result.points)
                    .with("answered", result.rows.iter().filter(|row| row.outputs[index].is_some()).count())
                    .with("variable_names", names.of_variables(result, &without_influence))
                    .with("variables", without_influence),
            );
            continue;
        }
        said.push(
            with_least("study_extremes")
                .with("least_at", names.settings(result, &least.at))
                .with("largest", largest.value)
                .with("largest_at", names.settings(result, &largest.at)),
        );
        if let Some((variable, share)) = dominant(plan, result, index) {
            let (pointer, way) = (result.variables[variable].pointer.clone(), names.variables[variable].clone());
            said.push(
                message("study_dominant").with("variable", pointer).with("variable_name", way).with("share", share),
            );
        }
        for (code, extreme) in [("study_least_at_end", least), ("study_largest_at_end", largest)] {
            if index == 0 && !extreme.at_end_of.is_empty() {
                let at_end = names.of_variables(result, &extreme.at_end_of);
                said.push(message(code).with("variables", extreme.at_end_of.clone()).with("variable_names", at_end));
            }
        }
    }
    if result.failed > 0 {
        said.push(
            Message::new("study_some_failed")
                .with("failed", result.failed)
                .with("points", result.points)
                .with("reasons", reasons),
        );
    }
    said.push(Message::new("study_own_error"));
    said
}

/// The variables that differ among the points that have this output: of others nothing can be said.
fn seen_varied(result: &StudyResult, output: usize) -> Vec<String> {
    let answered: Vec<&Row> = result.rows.iter().filter(|row| row.outputs[output].is_some()).collect();
    let differs = |variable: usize| answered.iter().any(|row| row.values[variable] != answered[0].values[variable]);
    let varied = (0..result.variables.len()).filter(|variable| differs(*variable));
    varied.map(|variable| result.variables[variable].pointer.clone()).collect()
}

/// The ways to what is varied and read off, to be called by their labels.
struct Names {
    variables: Vec<String>,
    outputs: Vec<String>,
}

impl Names {
    fn of(plan: &Plan, result: &StudyResult) -> Self {
        let variables: Vec<&str> = result.variables.iter().map(|one| one.pointer.as_str()).collect();
        let outputs: Vec<&str> = result.outputs.iter().map(|one| one.pointer.as_str()).collect();
        Self {
            variables: ways(Some(&plan.entry), Side::Job, &variables),
            outputs: ways(Some(&plan.entry), Side::Result, &outputs),
        }
    }

    /// What every variable is set to.
    fn settings(&self, result: &StudyResult, at: &[Setting]) -> Value {
        let each = result.variables.iter().zip(&self.variables).zip(at);
        Value::List(each.map(|((variable, way), setting)| set(way, setting, variable.unit.as_deref())).collect())
    }

    fn of_variables(&self, result: &StudyResult, pointers: &[String]) -> Vec<String> {
        let each = result.variables.iter().zip(&self.variables);
        each.filter(|(variable, _)| pointers.contains(&variable.pointer)).map(|(_, way)| way.clone()).collect()
    }
}

/// The variable that alone explains most of how an output varies over a complete grid, and which share of the variance
/// the means over the others have.
fn dominant(plan: &Plan, result: &StudyResult, output: usize) -> Option<(usize, f64)> {
    if plan.input.combine != Combine::Grid || plan.variables.len() < 2 {
        return None;
    }
    let values: Option<Vec<f64>> = result.rows.iter().map(|row| row.outputs[output]).collect();
    let values = values?;
    let mean = values.iter().sum::<f64>() / values.len() as f64;
    let variance = values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / values.len() as f64;
    let shares = plan.variables.iter().enumerate().map(|(index, variable)| {
        let mut sums = vec![(0.0, 0_usize); variable.values.len()];
        for (point, value) in values.iter().enumerate() {
            let sum = &mut sums[plan.shape.at(point)[index]];
            sum.0 += value;
            sum.1 += 1;
        }
        let between: f64 = sums.iter().map(|(sum, count)| (sum / *count as f64 - mean).powi(2)).sum();
        (index, between / sums.len() as f64 / variance)
    });
    shares.max_by(|a, b| a.1.total_cmp(&b.1)).filter(|(_, share)| share.is_finite())
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use precut_calc::calculator::Unwatched;
    use serde_json::json;

    use super::Json;
    use crate::engine::{Body, Given, solve_now};
    use crate::registry::toy;
    use crate::text::{Language, reworded};

    /// What a study of an output that is the same everywhere says first, in both languages.
    fn said(vary: &Json) -> [String; 2] {
        let job = json!({"length_mm": 500, "segments": [{"diameter_mm": 20}]});
        let study = json!({"calculator": "toy-bar", "job": job, "vary": vary, "outputs": ["/rows"]});
        let stored = solve_now(
            &toy::registry(),
            super::super::STUDIES,
            Body::Json(study.to_string().into()),
            &Given::default(),
            &Unwatched,
        );
        let answer: Json = serde_json::from_slice(&stored.unwrap().body).unwrap();
        let english = serde_json::to_vec(&answer["explanation"]).unwrap();
        let russian: Json = serde_json::from_slice(&reworded("explanation", &english, Language::Ru).unwrap()).unwrap();
        assert_eq!(answer["explanation"][0]["code"], "study_constant");
        [&answer["explanation"], &russian].map(|said| said[0]["text"].as_str().unwrap().to_owned())
    }

    #[test]
    fn without_influence_is_only_what_differs_among_the_answers() {
        let diameters = |values: &[f64]| json!({"pointer": "/segments/0/diameter_mm", "values": values});
        let stations = |values: &[u8]| json!({"pointer": "/stations", "values": values});
        for (vary, english, russian) in [
            (
                json!([diameters(&[20.0, 30.0])]),
                "Rows is 0 at every point: segments 1 · diameter has no influence on it",
                "во всех точках 0; не влияет: ",
            ),
            (json!([diameters(&[20.0])]), "Rows is 0 at the only point", "в единственной точке 0"),
            // Thicker than the bar is long: there is no answer.
            (
                json!([diameters(&[20.0, 600.0])]),
                "Rows is 0 at the only point that has an answer",
                "в единственной точке, где есть ответ, 0",
            ),
            (
                json!([diameters(&[20.0, 30.0, 600.0])]),
                "Rows is 0 at every point that has an answer: segments 1 · diameter has no influence on it there",
                "во всех точках, где есть ответ, 0; там не влияет: ",
            ),
            (
                json!([diameters(&[20.0, 600.0]), stations(&[2, 4])]),
                "Rows is 0 at every point that has an answer: stations has no influence on it there",
                "во всех точках, где есть ответ, 0; там не влияет: ",
            ),
        ] {
            let [in_english, in_russian] = said(&vary);
            assert_eq!(in_english, english);
            assert!(in_russian.contains(russian), "{in_russian}");
        }
    }
}
