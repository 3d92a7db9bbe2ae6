//! Processes under watch, without an engine: nothing is kept.

use precut_calc::calculator::{Finding, Monitor};
use serde_json::Value;

use super::{Body, Error, Given, check_now, json};
use crate::registry::{NotReplayed, Registry, Replayed, child};

/// Fields that a part states among its conditions and that are no condition of the calculator's.
const OF_PART: [&str; 2] = ["edge", "batch"];

/// What a process would have said after each of its parts: `{"calculator": ..., "part_types": ..., "parts": [...]}`.
pub(crate) fn replay(registry: &Registry, bytes: &[u8], monitor: &dyn Monitor) -> Result<Replayed, Error> {
    let mut process = json::parse(bytes)?;
    let Some(calculator) = process.get("calculator").and_then(Value::as_str).map(ToOwned::to_owned) else {
        return Err(invalid(vec![Finding::new("process_without_calculator", "/calculator")]));
    };
    let observed = registry.entry(&calculator).and_then(|entry| entry.observed());
    let Some(observed) = observed else { return Err(invalid(vec![not_watched(registry, &calculator)])) };
    fill_jobs(registry, &calculator, &mut process)?;
    let parts = process.get_mut("parts").and_then(Value::as_array_mut);
    parts.into_iter().flatten().for_each(lift);
    (observed.replay)(process, monitor).map_err(Error::from)
}

impl From<NotReplayed> for Error {
    fn from(error: NotReplayed) -> Self {
        match error {
            NotReplayed::Faults(findings) => invalid(findings),
            NotReplayed::Failed(failure) => Self::Calculation(failure),
        }
    }
}

/// Nobody watches processes of that calculator.
pub(super) fn not_watched(registry: &Registry, calculator: &str) -> Finding {
    let watched = registry.entries().iter().filter(|own| own.observed().is_some());
    let known: Vec<&str> = watched.map(|own| own.meta().id).collect();
    Finding::new("calculator_not_watched", "/calculator").with("name", calculator.to_owned()).with("known", known)
}

/// Every default of the jobs of all types, or all faults of all of them.
fn fill_jobs(registry: &Registry, calculator: &str, process: &mut Value) -> Result<(), Error> {
    let types = process.get_mut("part_types").and_then(Value::as_object_mut);
    let mut faults = Vec::new();
    for (name, of_type) in types.into_iter().flatten() {
        let Some(job) = of_type.get_mut("job") else { continue };
        match check_now(registry, calculator, Body::Json(job.to_string().into()), &Given::default()) {
            Ok(checked) => *job = checked.input,
            Err(Error::Invalid { findings, .. }) => {
                let pointer = child(&child("/part_types", name), "job");
                faults.extend(findings.into_iter().map(|finding| finding.under(&pointer)));
            }
            Err(error) => return Err(error),
        }
    }
    if faults.is_empty() { Ok(()) } else { Err(invalid(faults)) }
}

/// What is the part's own stands beside its conditions.
pub(super) fn lift(part: &mut Value) {
    for field in OF_PART {
        let own = part.get_mut("conditions").and_then(Value::as_object_mut).and_then(|fields| fields.remove(field));
        if let (Some(own), Some(fields)) = (own, part.as_object_mut()) {
            fields.insert(field.to_owned(), own);
        }
    }
}

pub(super) fn invalid(mut findings: Vec<Finding>) -> Error {
    let total = findings.len();
    findings.sort_by(|a, b| a.pointer.cmp(&b.pointer));
    findings.truncate(Error::MOST_FAULTS);
    Error::Invalid { findings, total }
}
