//! Codes with their numbers as text, and back: why a job failed and what it was doing, in no language yet.

use std::collections::HashSet;
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

use precut_calc::calculator::{Conflict, Failure, Finding, Message, Value as Datum, Values};
use serde_json::{Map, Value, json};

use crate::engine::Error;

/// Why a job failed, as it is kept.
pub(super) fn written(error: &Error) -> String {
    let value = match error {
        Error::Calculation(failure) => failed(failure),
        Error::Invalid { findings, total } => {
            let findings: Vec<Value> = findings.iter().map(note).collect();
            json!({"kind": "invalid", "findings": findings, "total": total})
        }
        Error::UnknownCalculator { name, .. } => json!({"kind": "unknown_calculator", "name": name}),
        Error::DeadlineExceeded => json!({"kind": "deadline_exceeded"}),
        Error::CrashedRepeatedly { attempts } => json!({"kind": "crashed_repeatedly", "attempts": attempts}),
        Error::Crashed => json!({"kind": "crashed"}),
        Error::KeptQuota { kept_bytes, quota_bytes, room_ms, .. } => {
            json!({"kind": "kept_quota", "kept_bytes": kept_bytes, "quota_bytes": quota_bytes, "room_ms": room_ms})
        }
        other => json!({"kind": "internal", "cause": other.to_string()}),
    };
    value.to_string()
}

fn failed(failure: &Failure) -> Value {
    match failure {
        Failure::Infeasible(finding) => json!({"kind": "infeasible", "finding": note(finding)}),
        Failure::Conflicting(conflict) => {
            json!({"kind": "conflicting", "finding": note(&conflict.finding), "infeasible": conflict.infeasible})
        }
        Failure::OutOfModel(finding) => json!({"kind": "out_of_model", "finding": note(finding)}),
        // A residual that is no number becomes `null`.
        Failure::NotConverged { what, residual, iterations } => {
            json!({"kind": "not_converged", "what": what, "residual": residual, "iterations": iterations})
        }
        Failure::NotRead { findings, total } => {
            let findings: Vec<Value> = findings.iter().map(note).collect();
            json!({"kind": "not_read", "findings": findings, "total": total})
        }
        Failure::Internal(cause) => json!({"kind": "internal", "cause": cause}),
        // A cancelled job did not fail.
        Failure::Cancelled => json!({"kind": "internal", "cause": failure.to_string()}),
    }
}

/// Why a job failed, read back. What is not understood is a fault of ours.
pub(super) fn read(text: &str) -> Error {
    let unreadable = || Error::Calculation(Failure::Internal(format!("the kept problem is not readable: {text}")));
    serde_json::from_str(text).ok().and_then(|value: Value| error_of(&value)).unwrap_or_else(unreadable)
}

fn error_of(value: &Value) -> Option<Error> {
    let whole = |name: &str| value[name].as_u64().and_then(|number| u32::try_from(number).ok());
    Some(match value["kind"].as_str()? {
        "infeasible" => Error::Calculation(Failure::Infeasible(finding_of(&value["finding"])?)),
        "conflicting" => Error::Calculation(Failure::Conflicting(Box::new(Conflict {
            finding: finding_of(&value["finding"])?,
            infeasible: serde_json::from_value(value["infeasible"].clone()).ok()?,
        }))),
        "out_of_model" => Error::Calculation(Failure::OutOfModel(finding_of(&value["finding"])?)),
        "not_converged" => Error::Calculation(Failure::NotConverged {
            what: interned(value["what"].as_str()?),
            residual: value["residual"].as_f64().unwrap_or(f64::NAN),
            iterations: whole("iterations")?,
        }),
        "invalid" => Error::Invalid {
            findings: value["findings"].as_array()?.iter().map(finding_of).collect::<Option<_>>()?,
            total: whole("total")? as usize,
        },
        "not_read" => Error::Calculation(Failure::NotRead {
            findings: value["findings"].as_array()?.iter().map(finding_of).collect::<Option<_>>()?,
            total: whole("total")? as usize,
        }),
        "unknown_calculator" => Error::UnknownCalculator { name: value["name"].as_str()?.to_owned(), nearest: None },
        "deadline_exceeded" => Error::DeadlineExceeded,
        "kept_quota" => Error::KeptQuota {
            kept_bytes: value["kept_bytes"].as_u64()?,
            quota_bytes: value["quota_bytes"].as_u64()?,
            room_ms: value["room_ms"].as_i64()?,
            retry_after: None,
        },
        "crashed_repeatedly" => Error::CrashedRepeatedly { attempts: whole("attempts")? },
        "crashed" => Error::Crashed,
        "internal" => Error::Calculation(Failure::Internal(value["cause"].as_str()?.to_owned())),
        _ => return None,
    })
}

/// What a job is doing, as it is kept.
pub(super) fn written_stage(stage: &Message) -> String {
    message(stage).to_string()
}

/// What a job was doing, read back.
pub(super) fn read_stage(text: &str) -> Option<Message> {
    message_of(&serde_json::from_str(text).ok()?)
}

/// A message as it is kept.
pub(crate) fn message(message: &Message) -> Value {
    json!({"code": message.code, "values": message.values})
}

/// A message, read back.
pub(crate) fn message_of(value: &Value) -> Option<Message> {
    Some(Message { code: interned(value["code"].as_str()?), values: values_of(value["values"].as_object()?)? })
}

/// A finding as it is kept.
pub(crate) fn note(finding: &Finding) -> Value {
    json!({
        "code": finding.code, "pointer": finding.pointer, "value": finding.value, "limit": finding.limit,
        "unit": finding.unit, "values": finding.values,
    })
}

/// A finding, read back.
pub(crate) fn finding_of(value: &Value) -> Option<Finding> {
    let mut finding = Finding::new(interned(value["code"].as_str()?), value["pointer"].as_str()?);
    finding.value = value["value"].as_f64();
    finding.limit = value["limit"].as_f64();
    finding.unit = value["unit"].as_str().map(interned);
    finding.values = values_of(value["values"].as_object()?)?;
    Some(finding)
}

fn values_of(map: &Map<String, Value>) -> Option<Values> {
    map.iter().try_fold(Values::new(), |values, (name, value)| Some(values.with(interned(name), datum(value)?)))
}

fn datum(value: &Value) -> Option<Datum> {
    Some(match value {
        Value::Number(number) => Datum::Number(number.as_f64()?),
        Value::String(text) => Datum::Text(text.clone().into()),
        Value::Array(items) => Datum::List(items.iter().map(datum).collect::<Option<_>>()?),
        _ => return None,
    })
}

/// A code or a name that lives as long as the program. They come from records that the program wrote itself out of
/// names in its own code, so that there are only so many.
fn interned(text: &str) -> &'static str {
    static KNOWN: Mutex<Option<HashSet<&'static str>>> = Mutex::new(None);
    let mut known = KNOWN.lock().unwrap_or_else(PoisonError::into_inner);
    let known = known.get_or_insert_default();
    if let Some(there) = known.get(text) {
        return there;
    }
    let kept: &'static str = Box::leak(text.to_owned().into_boxed_str());
    known.insert(kept);
    kept
}

/// The pause before something is tried again: it doubles up to two seconds.
pub(super) fn pause(attempt: u32) -> Duration {
    Duration::from_millis(50) * 2_u32.saturating_pow(attempt.min(6)).min(40)
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use precut_calc::calculator::{ConstraintName, ElasticScope, Infeasible, Relaxation};

    use super::*;

    #[test]
    fn what_is_written_reads_back() {
        let finding = Finding::new("too_thick", "/a/0").measured(3.5, 2.0, "mm").with("names", vec!["a", "b"]);
        let infeasible = Infeasible {
            elastic_total: 0.4,
            elastic_scope: ElasticScope::All,
            relaxations: vec![Relaxation { constraint: "power".to_owned(), zone: "z5".to_owned(), factor: 1.5 }],
            conflict_set: vec![ConstraintName { constraint: "power".to_owned(), zone: "z5".to_owned() }],
        };
        let errors = [
            Error::Calculation(Failure::Infeasible(finding.clone())),
            Error::Calculation(Failure::Conflicting(Box::new(Conflict { finding: finding.clone(), infeasible }))),
            Error::Calculation(Failure::OutOfModel(Finding::new("outside", ""))),
            Error::Calculation(Failure::NotConverged { what: "chip", residual: 1e-3, iterations: 40 }),
            Error::Calculation(Failure::NotRead { findings: vec![finding.clone()], total: 3 }),
            Error::Calculation(Failure::Internal("a cause".to_owned())),
            Error::Invalid { findings: vec![finding], total: 7 },
            Error::UnknownCalculator { name: "gone".to_owned(), nearest: None },
            Error::DeadlineExceeded,
            Error::CrashedRepeatedly { attempts: 3 },
            Error::Crashed,
            Error::KeptQuota { kept_bytes: 70, quota_bytes: 60, room_ms: 1_769_941_200_123, retry_after: None },
        ];
        for error in errors {
            assert_eq!(read(&written(&error)), error);
        }
        let nowhere = Error::Calculation(Failure::NotConverged { what: "dual", residual: f64::NAN, iterations: 0 });
        assert_eq!(format!("{:?}", read(&written(&nowhere))), format!("{nowhere:?}"));
        let stage = Message::new("revolution").with("of", 96.0).with("unit", "mm");
        assert_eq!(read_stage(&written_stage(&stage)), Some(stage));
        assert!(matches!(read("nonsense"), Error::Calculation(Failure::Internal(_))));
    }
}
