//! What is sent of a process and its parts: checked, filled, kept, and read again.

use std::sync::Arc;

use precut_calc::calculator::Finding;
use precut_calc::process::Decision;
use serde_json::{Map, Value, json};
use url::Url;

use super::{ProcessError, canonical_text};
use crate::engine::budget::Room;
use crate::engine::read::check_body;
use crate::engine::watch::{lift, not_watched};
use crate::engine::{Body, Engine, Error, FilePart, Shelf};
use crate::outward::place_of;
use crate::registry::{Entry, Observed, Registry, child};
use crate::store::callbacks::NewCallback;
use crate::store::processes::EntryKind;

/// What the service adds to the options of a process.
const PATH: &str = "path";
/// What is told where a process names no events.
const TOLD: [&str; 3] = ["change", "odd_part", "warning"];

/// A declared process.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Document {
    /// As it was sent.
    pub(super) sent: Value,
    /// As the calculator reads it: jobs with every default and number.
    pub(super) filled: Value,
}

impl Document {
    /// As it is kept.
    pub(super) fn content(&self) -> Result<String, Error> {
        canonical_text(&json!({ "sent": self.sent, "filled": self.filled }))
    }

    /// From what is kept.
    pub(super) fn read(registry: &Registry, content: &str) -> Result<Self, Error> {
        let unreadable = |error: String| Error::internal(format!("a kept process: {error}"));
        let mut kept: Value = serde_json::from_str(content).map_err(|error| unreadable(error.to_string()))?;
        let document = Self { sent: kept["sent"].take(), filled: kept["filled"].take() };
        document.observed(registry).map(|_| document.clone())
    }

    pub(super) fn calculator(&self) -> &str {
        self.sent["calculator"].as_str().unwrap_or_default()
    }

    pub(super) fn entry<'a>(&self, registry: &'a Registry) -> Result<&'a Arc<Entry>, Error> {
        registry.entry(self.calculator()).ok_or_else(|| Error::unknown(registry, self.calculator()))
    }

    pub(super) fn observed<'a>(&self, registry: &'a Registry) -> Result<&'a Observed, Error> {
        let observed = self.entry(registry)?.observed();
        observed.ok_or_else(|| Error::internal(format!("nobody watches {}", self.calculator())))
    }

    /// Whether a new path is given out at once.
    pub(super) fn is_automatic(&self) -> bool {
        self.sent["options"][PATH] == "auto"
    }

    /// Who is told of an entry of which that is new.
    pub(super) fn told(&self, kind: EntryKind, news: &[&str]) -> Option<NewCallback> {
        let callback = self.sent.get("callback")?;
        let wanted = match callback.get("events").and_then(Value::as_array) {
            Some(events) => events.iter().filter_map(Value::as_str).collect(),
            None => TOLD.to_vec(),
        };
        let is_wanted = wanted.iter().any(|word| *word == kind.word() || news.contains(word));
        let url: Url = callback.get("url").and_then(Value::as_str)?.parse().ok().filter(|_| is_wanted)?;
        Some(NewCallback { host: place_of(&url), url: url.into() })
    }

    pub(super) fn is_stopped(&self) -> bool {
        self.sent["stopped"] == true
    }
}

impl Engine {
    /// A process as it is sent: every fault at once, the jobs filled and tried.
    pub(super) async fn read_document(&self, shelf: &Shelf, sent: Value) -> Result<Document, ProcessError> {
        let inner = &self.inner;
        let named = sent.get("calculator").and_then(Value::as_str).map(ToOwned::to_owned);
        let Some(calculator) = named else {
            return Err(ProcessError::one(Finding::new("process_without_calculator", "/calculator")));
        };
        let entry = inner.registry.entry(&calculator).cloned();
        let Some((entry, observed)) = entry.as_ref().and_then(|entry| entry.observed().map(|own| (entry, own))) else {
            return Err(ProcessError::one(not_watched(&inner.registry, &calculator)));
        };
        let mut filled = sent.clone();
        let mut found = match check_body(&observed.document, &mut filled, (&[], &Room::default())) {
            Ok(()) => Vec::new(),
            Err(Error::Invalid { findings, .. }) => findings,
            Err(error) => return Err(error.into()),
        };
        let model = filled.as_object_mut().and_then(|fields| fields.remove("model"));
        for own in ["stopped", "callback"] {
            filled.as_object_mut().and_then(|fields| fields.remove(own));
        }
        filled["options"].as_object_mut().and_then(|options| options.remove(PATH));
        for absent in ["options", "allowances"] {
            if filled[absent].is_null() {
                filled.as_object_mut().and_then(|fields| fields.remove(absent));
            }
        }
        let types = filled.get_mut("part_types").and_then(Value::as_object_mut);
        for (name, of_type) in types.into_iter().flatten() {
            let pointer = child(&child("/part_types", name), "job");
            let Some(fields) = of_type.as_object_mut() else {
                found.push(Finding::new("part_type_without_job", pointer).with("part_type", name.clone()));
                continue;
            };
            found.extend(fields.keys().filter(|field| *field != "job").map(|field| {
                Finding::new("unknown_field", child(&child("/part_types", name), field)).with("name", field.clone())
            }));
            let Some(job) = fields.get_mut("job").filter(|job| job.is_object()) else {
                found.push(Finding::new("part_type_without_job", pointer).with("part_type", name.clone()));
                continue;
            };
            if let (Some(model), None) = (&model, job.get("model")) {
                job["model"] = model.clone();
            }
            match inner.read(entry, Body::Json(job.to_string().into()), shelf).await {
                Ok(ready) => *job = ready.prepared.input().map_err(Error::Calculation)?,
                Err(Error::Invalid { findings, .. }) => {
                    found.extend(findings.into_iter().map(|finding| finding.under(&pointer)));
                }
                Err(error) => return Err(error.into()),
            }
        }
        if found.is_empty() {
            found = (observed.faults)(filled.clone(), Vec::new());
        }
        if !found.is_empty() {
            return Err(faulty(found));
        }
        // A job without an answer has no process either.
        for of_type in filled["part_types"].as_object().into_iter().flat_map(Map::values) {
            self.solve(&calculator, Body::Json(of_type["job"].to_string().into())).await?;
        }
        Ok(Document { sent, filled })
    }
}

/// All faults of something that was sent.
pub(super) fn faulty(mut findings: Vec<Finding>) -> ProcessError {
    let total = findings.len();
    findings.sort_by(crate::registry::by_pointer);
    findings.truncate(Error::MOST_FAULTS);
    ProcessError::Invalid { findings, total }
}

/// A part as it is sent, held to its schema, its table read.
pub(super) fn part(observed: &Observed, mut sent: Value, tables: &[FilePart]) -> Result<Value, ProcessError> {
    check_body(&observed.part, &mut sent, (tables, &Room::default()))?;
    Ok(sent)
}

/// A path that a process gave out.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Issued {
    pub(super) revision: u32,
    /// `{"key", "part_type", "job", "conditions"}`: the conditions are those of a part that is cut on it.
    pub(super) content: Value,
}

/// The part as the calculator reads it. One that is new says on which path it was cut, once the process gave one out.
pub(super) fn for_calculator(content: &Value, paths: &[Issued], is_new: bool) -> Result<Value, Finding> {
    let mut part = content.clone();
    lift(&mut part);
    let path = part.as_object_mut().and_then(|fields| fields.remove("path")).unwrap_or_default();
    if part.get("conditions").is_none_or(Value::is_null) {
        part["conditions"] = json!({});
    }
    let conditions = part["conditions"].as_object().cloned().unwrap_or_default();
    match path["kind"].as_str() {
        None if is_new && !paths.is_empty() && !conditions.contains_key("commanded_path") => {
            return Err(Finding::new("path_not_stated", "/path").with("paths", paths.len()));
        }
        Some("process") => {
            let revision = path["revision"].as_u64().unwrap_or(0);
            let Some(issued) = paths.iter().find(|issued| u64::from(issued.revision) == revision) else {
                #[allow(clippy::cast_precision_loss)] // a count of paths
                let finding = Finding::new("unknown_path", "/path/revision").value(revision as f64, "1");
                return Err(finding.with("paths", paths.len()));
            };
            for (name, value) in issued.content["conditions"].as_object().into_iter().flatten() {
                part["conditions"][name] = value.clone();
            }
        }
        _ => {}
    }
    for field in ["gauge_checks", "confirmed"] {
        if part.get(field).is_some_and(Value::is_null) {
            part.as_object_mut().and_then(|fields| fields.remove(field));
        }
    }
    Ok(part)
}

/// What a person says, as it is kept.
pub(super) fn decision(change: &str, after: u32, decision: &Decision, note: Option<&str>) -> Value {
    let (word, cause) = match decision {
        Decision::Confirm => ("confirm", None),
        Decision::Reject => ("reject", None),
        Decision::Name(kind) => ("name", Some(kind)),
    };
    json!({ "change": change, "after_part": after, "decision": word, "cause": cause, "note": note })
}

/// The same read again: after which part, on which change, and what.
pub(super) fn read_decision(content: &Value) -> Option<(u32, String, Decision)> {
    let decision = match content["decision"].as_str()? {
        "confirm" => Decision::Confirm,
        "reject" => Decision::Reject,
        _ => Decision::Name(content["cause"].as_str()?.to_owned()),
    };
    let after = u32::try_from(content["after_part"].as_u64()?).ok()?;
    Some((after, content["change"].as_str()?.to_owned(), decision))
}
