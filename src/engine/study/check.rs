//! Everything that can be wrong with a study, found at once.

use std::collections::BTreeSet;

use precut_calc::calculator::Finding;
use serde_json::Value;

use super::expand::{self, Shape, number, set, tokens};
use super::faults;
use super::input::{Combine, Spacing, StudyInput, Variable};
use super::place;
use super::plan::{Found, Output, Planned};
use crate::engine::{model, names, read};
use crate::registry::Entry;

/// What can be told without the calculator: how many values each variable has, and what is wrong with that.
pub(super) fn structure(input: &StudyInput, most_points: u64) -> (Vec<u64>, Vec<Finding>) {
    let mut found = Vec::new();
    let mut lengths = Vec::new();
    let mut pointers = BTreeSet::new();
    for (index, variable) in input.vary.iter().enumerate() {
        lengths.push(length(index, variable, &mut found));
        if !pointers.insert(variable.pointer.as_str()) {
            let place = format!("/vary/{index}/pointer");
            found.push(Finding::new("duplicate_variable", place).with("received", variable.pointer.clone()));
        }
    }
    let known: Vec<u64> = lengths.iter().flatten().copied().collect();
    let all_known = known.len() == lengths.len();
    if input.combine == Combine::Zip && known.iter().any(|one| *one != known[0]) {
        let lengths: Vec<String> = known.iter().map(ToString::to_string).collect();
        found.push(Finding::new("unequal_lengths", "/vary").with("lengths", lengths));
    } else if all_known {
        // A variable without values is told of elsewhere, and makes no other one's values fewer.
        let lengths: Vec<u64> = known.iter().map(|&length| length.max(1)).collect();
        let points = Shape::new(lengths.clone(), input.combine).points();
        if points > u128::from(most_points) {
            // Printed with six digits; a product of three counts may be beyond every whole number type.
            let lengths = lengths.iter().map(|&length| length as f64);
            let points = if input.combine == Combine::Zip { points as f64 } else { lengths.product() };
            let limit = most_points as f64;
            found.push(Finding::new("too_many_points", "/vary").measured(points, limit, "1"));
        }
    }
    (known, found)
}

/// How many values a variable has, if it says so.
fn length(index: usize, variable: &Variable, found: &mut Vec<Finding>) -> Option<u64> {
    let at = |name: &str| format!("/vary/{index}{name}");
    let Variable { values, from, to, count, spacing, .. } = variable;
    let is_range = from.is_some() || to.is_some() || count.is_some() || spacing.is_some();
    match values {
        Some(values) if !is_range => return Some(values.len() as u64),
        Some(_) => {
            found.push(Finding::new("values_and_range", at("")));
            return None;
        }
        None if !is_range => {
            found.push(Finding::new("no_values", at("")));
            return None;
        }
        None => {}
    }
    for (name, missing) in [("/from", from.is_none()), ("/to", to.is_none()), ("/count", count.is_none())] {
        if missing {
            found.push(Finding::new("missing_field", at(name)));
        }
    }
    if let (Some(from), Some(to)) = (from, to)
        && from.total_cmp(to).is_eq()
    {
        found.push(Finding::new("empty_range", at("/to")).value(*to, "1"));
    }
    if *spacing == Some(Spacing::Log) {
        for (name, end) in [("/from", from), ("/to", to)] {
            if let Some(end) = end.filter(|end| *end <= 0.0) {
                found.push(Finding::new("log_not_positive", at(name)).measured(end, 0.0, "1"));
            }
        }
    }
    *count
}

/// The fields that are varied; `None` where one cannot be.
pub(super) fn variables(entry: &Entry, input: &StudyInput, found: &mut Vec<Finding>) -> Vec<Option<Found>> {
    let job = Value::Object(input.job.clone());
    let each = input.vary.iter().enumerate();
    each.map(|(index, variable)| self::variable(entry, &job, index, variable, found)).collect()
}

fn variable(entry: &Entry, job: &Value, index: usize, variable: &Variable, found: &mut Vec<Finding>) -> Option<Found> {
    let at = format!("/vary/{index}/pointer");
    let Some(tokens) = tokens(&variable.pointer) else {
        found.push(faults::bad_pointer(at, &variable.pointer));
        return None;
    };
    if model::is_its_place(entry, &tokens) {
        found.push(Finding::new("model_not_variable", at));
        return None;
    }
    let is_a_name = names::is_a_name(entry, job, &tokens);
    let field = match place::field(entry.strict_input(), Some(job), &tokens) {
        Ok(field) if field.is_scalar() => field,
        // What a name may be, or what is said over its record: the points show whether it fits.
        Ok(_) | Err(_) if is_a_name => place::Field::any(),
        Ok(_) => {
            found.push(Finding::new("not_variable", at).with("received", variable.pointer.clone()));
            return None;
        }
        Err(lost) => {
            found.push(faults::lost(at, &variable.pointer, lost));
            return None;
        }
    };
    if !set(&mut job.as_object().cloned().unwrap_or_default(), &tokens, Value::Null) {
        // Something that is no object stands on the way.
        found.push(Finding::new("not_variable", at).with("received", variable.pointer.clone()));
        return None;
    }
    if variable.values.is_none() && variable.from.is_some() && !field.is_number() {
        found.push(Finding::new("range_of_words", format!("/vary/{index}")).with("expected", field.types()));
        return None;
    }
    for (number, value) in variable.values.iter().flatten().enumerate() {
        let at = || format!("/vary/{index}/values/{number}");
        let fits = match value {
            Value::Number(number) => {
                field.is_number() && (!field.is_whole() || number.as_f64().is_some_and(|n| n.fract() == 0.0))
            }
            Value::Bool(_) => field.truth,
            Value::String(_) => field.word,
            Value::Null | Value::Array(_) | Value::Object(_) => false,
        };
        match value.as_str() {
            _ if !fits => found.push(faults::wrong_type(at(), value, &field)),
            Some(word) if !field.options.is_empty() && !field.options.iter().any(|option| option == word) => {
                found.push(faults::not_one_of(at(), word, &field.options));
            }
            _ => {}
        }
    }
    Some(Found { tokens, field })
}

/// The numbers of the result that are asked for, the calculator's own choice where none is.
pub(super) fn outputs(entry: &Entry, input: &mut StudyInput, found: &mut Vec<Finding>) -> Vec<Output> {
    if input.outputs.is_empty() {
        input.outputs = entry.meta().study_outputs.iter().map(|&pointer| pointer.to_owned()).collect();
    }
    if input.outputs.is_empty() {
        found.push(Finding::new("no_outputs", "/outputs").with("calculator", entry.meta().id));
    }
    let mut seen = BTreeSet::new();
    let mut outputs = Vec::new();
    for (index, pointer) in input.outputs.iter().enumerate() {
        let at = format!("/outputs/{index}");
        if !seen.insert(pointer) {
            found.push(Finding::new("repeated_output", at).with("received", pointer.clone()));
            continue;
        }
        let Some(tokens) = tokens(pointer) else {
            found.push(faults::bad_pointer(at, pointer));
            continue;
        };
        match place::field(entry.strict_output(), None, &tokens) {
            Ok(field) if field.is_number() => {
                outputs.push(Output { pointer: pointer.clone(), tokens, unit: field.unit });
            }
            Ok(_) => found.push(Finding::new("not_a_number", at).with("received", pointer.clone())),
            Err(lost) => found.push(faults::lost(at, pointer, lost)),
        }
    }
    outputs
}

/// The values of the variables. The number of points has been held against its limit.
pub(super) fn values(input: &StudyInput, fields: Vec<Option<Found>>, found: &mut Vec<Finding>) -> Vec<Planned> {
    let mut planned = Vec::new();
    for (index, (variable, field)) in input.vary.iter().zip(fields).enumerate() {
        let Some(Found { tokens, field }) = field else { continue };
        let spacing = variable.values.is_none().then(|| variable.spacing.unwrap_or_default());
        let values = match (&variable.values, variable.from, variable.to, variable.count) {
            (Some(values), ..) => values.clone(),
            (None, Some(from), Some(to), Some(count)) => {
                let count = usize::try_from(count).unwrap_or(usize::MAX);
                let values = expand::range(from, to, count, spacing.unwrap_or_default());
                if field.is_whole() && values.iter().any(|value| value.fract() != 0.0) {
                    found.push(Finding::new("range_not_whole", format!("/vary/{index}/count")));
                }
                values.into_iter().map(number).collect()
            }
            (None, ..) => Vec::new(),
        };
        let texts: Vec<String> = values.iter().map(ToString::to_string).collect();
        let mut seen = BTreeSet::new();
        // The same value twice makes sense only where other variables tell the points apart.
        let may_repeat = input.combine == Combine::Zip && input.vary.len() > 1 && spacing.is_none();
        let twice = texts.iter().position(|text| !seen.insert(text)).filter(|_| !may_repeat);
        match (twice, spacing) {
            (Some(twice), None) => found.push(
                Finding::new("duplicate_value", format!("/vary/{index}/values/{twice}"))
                    .with("received", texts[twice].clone()),
            ),
            (Some(_), Some(_)) => found.push(Finding::new("range_too_fine", format!("/vary/{index}/count"))),
            (None, _) => {}
        }
        planned.push(Planned { pointer: variable.pointer.clone(), tokens, unit: field.unit, spacing, values });
    }
    planned
}

/// What the schema finds wrong with the job where no variable is concerned. Rules between fields may be broken by the
/// variables' values alone, and say nothing yet.
pub(super) fn job(entry: &Entry, input: &StudyInput, fields: &[Option<Found>], names: &names::Found) -> Vec<Finding> {
    let mut job = input.job.clone();
    for (variable, found) in input.vary.iter().zip(fields) {
        if let Some(found) = found
            && let Some(first) = variable.first()
        {
            set(&mut job, &found.tokens, first);
        }
    }
    let mut job = Value::Object(job);
    names::fill(entry, &mut job, names);
    let findings = read::schema_faults(entry, job);
    let concerns = |finding: &Finding| input.vary.iter().any(|variable| variable.pointer == finding.pointer);
    findings.into_iter().filter(|finding| !concerns(finding)).map(faults::in_job).collect()
}
