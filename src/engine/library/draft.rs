//! From what is sent to a record that may be kept: written out, held against its schema and the rules between its fields.

use std::sync::{Arc, LazyLock};

use precut_calc::calculator::Finding;
use precut_library::record::{MAX_BYTES, Record, faults, is_name, schema, settle};
use precut_library::{Kind, built_in};
use serde_json::{Map, Value, json};

use super::{RecordError, kind_of, set};
use crate::engine::model;
use crate::registry::{Checker, Faults, Shape, canonical, child};
use crate::store::documents::NewDocument;

/// Fields that an answer has beside those of the record; sent again, they say nothing.
const SAID_BESIDE: &[&str] = &[
    "name",
    "id",
    "revision",
    "built_in",
    "data_version",
    "sha256",
    "created_at",
    "links",
    "uses",
    "conflict",
    "force_sources",
    "power_laws",
];

static CHECKERS: LazyLock<[Checker; Kind::ALL.len()]> = LazyLock::new(|| {
    Kind::ALL.map(|kind| Checker::new(schema(kind)).expect("the schema of records is made by every test"))
});

/// What a record may be made of, with what may stand beside it.
pub(super) fn shape(kind: Kind) -> &'static Shape {
    static SHAPES: LazyLock<[Shape; Kind::ALL.len()]> = LazyLock::new(|| {
        Kind::ALL.map(|kind| {
            let mut shape = Shape::of(&schema(kind));
            let word = json!({ "type": "string" });
            for name in SAID_BESIDE {
                shape = shape.with_field(name, Shape::of(&json!({ "type": ["string", "object"] })));
            }
            if kind == Kind::Tool {
                for (symbol, name) in precut_library::record::ISO_13399 {
                    if let Some(field) = shape.field(name).cloned() {
                        shape = shape.with_field(symbol, field);
                    }
                }
            }
            if let (Kind::Material, Some(rows)) = (kind, shape.field("kienzle").cloned()) {
                shape = shape.with_field("kienzle_rows", rows.clone());
                let mut either = rows;
                either.join(Shape::of(&json!({ "type": "object" })));
                shape = shape.with_field("kienzle", either);
            }
            shape.with_field("from", Shape::of(&word)).with_field("set", Shape::of(&json!({ "type": "object" })))
        })
    });
    &SHAPES[kind.place()]
}

/// A record that may be kept under a name.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Draft {
    pub(super) record: Arc<Record>,
    content: String,
    pub(super) sha256: String,
}

impl Draft {
    /// Of a record as it was sent; every fault at once, at its place in it.
    pub(super) fn of(kind: Kind, name: &str, mut value: Value) -> Result<Self, RecordError> {
        plain(kind, &mut value);
        settle(kind, &mut value);
        let mut found = Faults::default();
        if !is_name(name) {
            found.add(Finding::new("bad_record_name", "").with("name", name.to_owned()));
        }
        CHECKERS[kind.place()].check(&value, "", &mut found);
        if found.total == 0 {
            for fault in faults(kind, &value).into_iter().chain(models(&value)) {
                found.add(fault);
            }
        }
        if found.total > 0 {
            return Err(RecordError::invalid(found));
        }
        // Numbers as they are written in canonical form, whatever they were spelled as.
        let bytes = canonical(&value).expect("a record came as JSON");
        if bytes.len() > MAX_BYTES {
            return Err(RecordError::TooLarge { bytes: bytes.len(), most: MAX_BYTES });
        }
        let content = String::from_utf8(bytes).expect("JSON is UTF-8");
        let sha256 = model::sha256(&content);
        Ok(Self { record: Arc::new(Record { kind, name: name.to_owned(), value }), content, sha256 })
    }

    /// As the store takes it, under the name that stands on a shelf.
    pub(super) fn document(&self, name: String) -> NewDocument {
        let record = &self.record;
        let class = record.text(record.kind.class());
        let title = record.text("title").unwrap_or_default().replace('\n', " ");
        let words = std::iter::once(title.as_str()).chain(record.names().skip(1));
        NewDocument {
            kind: kind_of(record.kind),
            name,
            class: class.unwrap_or_default().to_owned(),
            words: words.collect::<Vec<_>>().join("\n"),
            content: self.content.clone(),
            sha256: self.sha256.clone(),
        }
    }
}

/// Takes out what answers say beside a record, and gives the rows of a material their place again: an answer has the one
/// preferred row in `kienzle` and all of them in `kienzle_rows`.
fn plain(kind: Kind, value: &mut Value) {
    let Some(fields) = value.as_object_mut() else { return };
    fields.retain(|name, _| !SAID_BESIDE.contains(&name.as_str()));
    if kind == Kind::Material {
        let rows = fields.shift_remove("kienzle_rows");
        match (rows, fields.get("kienzle")) {
            (Some(rows), _) => {
                fields.insert("kienzle".to_owned(), rows);
            }
            (None, Some(Value::Object(row))) => {
                let row = Value::Object(row.clone());
                fields.insert("kienzle".to_owned(), json!([row]));
            }
            _ => {}
        }
    }
    if kind.has_sources() {
        without_addresses(value);
    }
}

/// Answers say the address of a source behind it; a record has the source alone.
fn without_addresses(value: &mut Value) {
    match value {
        Value::Object(fields) => {
            if fields.contains_key("source") {
                fields.shift_remove("address");
            }
            fields.values_mut().for_each(without_addresses);
        }
        Value::Array(items) => items.iter_mut().for_each(without_addresses),
        _ => {}
    }
}

/// Stored models of a machine must be named as jobs name them.
fn models(value: &Value) -> Vec<Finding> {
    let models = value.get("models").and_then(Value::as_object).into_iter().flatten();
    models
        .filter(|(_, name)| name.as_str().is_none_or(|name| model::asked(name).is_none()))
        .map(|(calculator, name)| {
            Finding::new("bad_model_name", child("/models", calculator))
                .with("name", name.as_str().unwrap_or_default().to_owned())
        })
        .collect()
}

/// A built-in record as one's own would say it: with sources in words in place of their keys.
pub(super) fn cited(mut value: Value) -> Value {
    cite(&mut value);
    value
}

fn cite(value: &mut Value) {
    match value {
        Value::Object(fields) => {
            for (name, part) in fields.iter_mut() {
                match part {
                    Value::String(key) if ["source", "superseded_by", "names_source"].contains(&name.as_str()) => {
                        *key = in_words(key);
                    }
                    other => cite(other),
                }
            }
        }
        Value::Array(items) => items.iter_mut().for_each(cite),
        _ => {}
    }
}

fn in_words(key: &str) -> String {
    match built_in::source(key) {
        Some(source) => match &source.address {
            Some(address) => format!("{} ({address})", source.text()),
            None => source.text(),
        },
        None => key.to_owned(),
    }
}

/// A copy with changes: each value goes where its JSON Pointer leads, null takes away what is there.
pub(super) fn changed(mut value: Value, changes: &Map<String, Value>) -> Result<Value, RecordError> {
    let mut found = Faults::default();
    for (pointer, new) in changes {
        // As answers have it.
        let plain = pointer.replacen("/kienzle_rows", "/kienzle", 1);
        if !set::set(&mut value, &plain, new.clone()) {
            let place = child("/set", pointer);
            found.add(Finding::new("set_leads_nowhere", place).with("received", pointer.clone()));
        }
    }
    if found.total > 0 { Err(RecordError::invalid(found)) } else { Ok(value) }
}
