//! Two records beside each other, field by field.

use std::collections::BTreeMap;

use precut_library::resolve::Revision;
use serde::Serialize;
use serde_json::Value;
use utoipa::ToSchema;

use super::StoredRecord;
use crate::registry::child;

/// One record against another.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct RecordComparison {
    /// The record asked for.
    pub record: RecordHead,
    /// The record that it is compared with.
    pub other: RecordHead,
    /// Whether both say the same: equal hashes.
    pub identical: bool,
    /// Fields in which they differ, by their place.
    pub fields: Vec<FieldComparison>,
}

/// Which state of which record.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, ToSchema)]
pub struct RecordHead {
    /// Its name.
    #[schema(example = "lathe-3")]
    pub name: String,
    /// Whether it is the engine's own.
    pub built_in: bool,
    /// Its revision; of the engine's own the version of the data.
    #[schema(minimum = 1, example = 3)]
    pub revision: u32,
    /// Hash of what it says.
    #[schema(pattern = "^[0-9a-f]{64}$")]
    pub sha256: String,
}

/// A field in which two records differ.
#[derive(Debug, Clone, PartialEq, Serialize, ToSchema)]
pub struct FieldComparison {
    /// Where it stands.
    #[schema(example = "/compliance/carriage_um_per_n/value")]
    pub pointer: String,
    /// What the record says there; null where it says nothing.
    #[schema(value_type = Value)]
    pub record: Value,
    /// What the other says.
    #[schema(value_type = Value)]
    pub other: Value,
    /// By how much the other's number is above the record's, in percent of it; null where one is no number, or the record's is 0.
    #[schema(example = 12.5, extensions(("x-unit" = json!("percent")), ("x-symbol" = json!("d"))))]
    pub difference_percent: Option<f64>,
}

fn head(record: &StoredRecord) -> RecordHead {
    let (built_in, revision) = match record.revision {
        Revision::Own(revision) => (false, revision),
        Revision::BuiltIn(version) => (true, version),
    };
    RecordHead { name: record.record.name.clone(), built_in, revision, sha256: record.sha256.clone() }
}

/// Both beside each other.
pub(super) fn compare(record: &StoredRecord, other: &StoredRecord) -> RecordComparison {
    let fields = differences(&record.record.value, &other.record.value);
    RecordComparison { record: head(record), other: head(other), identical: record.sha256 == other.sha256, fields }
}

/// The fields in which two values differ.
pub(super) fn differences(one: &Value, other: &Value) -> Vec<FieldComparison> {
    let (one, other) = (leaves(one), leaves(other));
    let mut pointers: Vec<&String> = one.keys().chain(other.keys()).collect();
    pointers.sort_unstable();
    pointers.dedup();
    let differs = |pointer: &&String| one.get(*pointer) != other.get(*pointer);
    let compared = |pointer: &String| {
        let side =
            |leaves: &BTreeMap<String, &Value>| leaves.get(pointer).map_or(Value::Null, |value| (*value).clone());
        let (record, other) = (side(&one), side(&other));
        let numbers = record.as_f64().zip(other.as_f64()).filter(|(record, _)| record.abs() > 0.0);
        let difference_percent = numbers.map(|(record, other)| 100.0 * (other - record) / record.abs());
        FieldComparison { pointer: pointer.clone(), record, other, difference_percent }
    };
    pointers.into_iter().filter(differs).map(compared).collect()
}

/// Every number and word of a value by its pointer; what is empty stands for itself.
fn leaves(value: &Value) -> BTreeMap<String, &Value> {
    let mut found = BTreeMap::new();
    walk(value, String::new(), &mut found);
    found
}

fn walk<'a>(value: &'a Value, pointer: String, found: &mut BTreeMap<String, &'a Value>) {
    match value {
        Value::Object(fields) if !fields.is_empty() => {
            for (name, part) in fields {
                walk(part, child(&pointer, name), found);
            }
        }
        Value::Array(items) if !items.is_empty() => {
            for (index, item) in items.iter().enumerate() {
                walk(item, format!("{pointer}/{index}"), found);
            }
        }
        leaf => {
            found.insert(pointer, leaf);
        }
    }
}
