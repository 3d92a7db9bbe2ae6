//! What came of names as JSON, and back: with jobs that are run later, and with studies, whose points name records.

use std::sync::Arc;

use precut_calc::calculator::{Finding, Message};
use precut_library::record::Record;
use precut_library::resolve::Revision;
use precut_library::{Kind, Lookup, Resource};
use serde_json::{Map, Value, json};

use super::{Drawn, Found, FoundModel, Looked};
use crate::engine::jobs::{finding_of, message, message_of, note};
use crate::store::documents::KeptDocument;

pub(super) fn drawn(drawn: &Drawn) -> Value {
    json!({
        "resources": drawn.resources,
        "origins": drawn.origins,
        "warnings": drawn.warnings.iter().map(note).collect::<Vec<_>>(),
        "explanation": drawn.explanation.iter().map(message).collect::<Vec<_>>(),
    })
}

pub(super) fn read_drawn(value: &Value) -> Option<Drawn> {
    let list = |name: &str| value.get(name).and_then(Value::as_array);
    Some(Drawn {
        resources: value.get("resources")?.as_object()?.clone(),
        origins: value.get("origins")?.clone(),
        warnings: list("warnings")?.iter().map(finding_of).collect::<Option<Vec<Finding>>>()?,
        explanation: list("explanation")?.iter().map(message_of).collect::<Option<Vec<Message>>>()?,
    })
}

pub(super) fn found(found: &Found) -> Value {
    let models: Vec<Value> = found
        .models
        .iter()
        .filter_map(|(asked, found)| match found {
            FoundModel::Model(kept) => Some(json!({
                "asked": asked, "name": kept.name, "revision": kept.revision, "class": kept.class,
                "content": kept.content, "sha256": kept.sha256,
            })),
            FoundModel::Unknown(_) => None,
        })
        .collect();
    json!({ "records": found.records.iter().map(looked).collect::<Vec<_>>(), "models": models })
}

fn looked(looked: &Looked) -> Value {
    let mut said = Map::new();
    said.insert("kind".to_owned(), looked.kind.name().into());
    said.insert("name".to_owned(), looked.name.clone().into());
    if let Some(revision) = looked.revision {
        said.insert("revision".to_owned(), revision.into());
    }
    let (came, value) = match &looked.lookup {
        Lookup::Found(Resource { record, revision }) => {
            let (own, built_in) = match revision {
                Revision::Own(revision) => (Some(*revision), None),
                Revision::BuiltIn(version) => (None, Some(*version)),
            };
            let value = json!({
                "name": record.name, "revision": own, "data_version": built_in, "value": record.value, "sha256": looked.sha256,
            });
            ("found", value)
        }
        Lookup::Unknown { nearest } => ("unknown", json!(nearest)),
        Lookup::UnknownRevision { last } => ("unknown_revision", json!(last)),
        Lookup::Deleted => ("deleted", json!(true)),
        Lookup::Ambiguous { candidates } => ("ambiguous", json!(candidates)),
    };
    said.insert(came.to_owned(), value);
    said.into()
}

pub(super) fn read_found(value: &Value) -> Found {
    let list = |name: &str| value.get(name).and_then(Value::as_array).into_iter().flatten();
    Found {
        records: list("records").filter_map(read_looked).collect(),
        models: list("models").filter_map(read_model).collect(),
    }
}

fn whole(value: &Value, name: &str) -> Option<u32> {
    value.get(name)?.as_u64().and_then(|number| u32::try_from(number).ok())
}

fn text(value: &Value, name: &str) -> Option<String> {
    value.get(name)?.as_str().map(str::to_owned)
}

fn texts(value: &Value) -> Vec<String> {
    value.as_array().into_iter().flatten().filter_map(Value::as_str).map(str::to_owned).collect()
}

fn read_looked(value: &Value) -> Option<Looked> {
    let kind = Kind::NAMED.into_iter().find(|kind| value.get("kind").is_some_and(|word| word == kind.name()))?;
    let found = value.get("found");
    let lookup = if let Some(found) = found {
        let revision = match (whole(found, "revision"), whole(found, "data_version")) {
            (Some(revision), _) => Revision::Own(revision),
            (None, version) => Revision::BuiltIn(version?),
        };
        let record = Record { kind, name: text(found, "name")?, value: found.get("value")?.clone() };
        Lookup::Found(Resource { record: Arc::new(record), revision })
    } else if let Some(nearest) = value.get("unknown") {
        Lookup::Unknown { nearest: texts(nearest) }
    } else if let Some(last) = whole(value, "unknown_revision") {
        Lookup::UnknownRevision { last }
    } else if let Some(candidates) = value.get("ambiguous") {
        Lookup::Ambiguous { candidates: texts(candidates) }
    } else {
        Lookup::Deleted
    };
    let sha256 = found.and_then(|found| text(found, "sha256")).unwrap_or_default();
    Some(Looked { kind, name: text(value, "name")?, revision: whole(value, "revision"), lookup, sha256 })
}

fn read_model(value: &Value) -> Option<(String, FoundModel)> {
    let kept = KeptDocument {
        name: text(value, "name")?,
        revision: whole(value, "revision")?,
        class: text(value, "class")?,
        content: text(value, "content")?,
        sha256: text(value, "sha256")?,
        created_ms: 0,
    };
    Some((text(value, "asked")?, FoundModel::Model(Box::new(kept))))
}
