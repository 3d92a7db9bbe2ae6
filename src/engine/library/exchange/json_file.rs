//! Records in a JSON file, as the engine's own data stand in one.

use std::sync::LazyLock;

use precut_calc::calculator::Finding;
use precut_library::Kind;
use precut_library::built_in::Source;
use serde_json::{Map, Value, json};

use super::super::RecordError;
use super::super::draft::shape;
use super::Raw;
use crate::engine::budget::Room;
use crate::engine::json;
use crate::registry::{Faults, Shape, nearest};

/// Version of the form of such files.
pub(super) const SCHEMA_VERSION: u64 = 1;
/// Most records of one list.
const MOST_RECORDS: usize = 100_000;

/// What such a file may be made of.
static SHAPE: LazyLock<Shape> = LazyLock::new(|| {
    let anything = json!({ "type": "object" });
    let list = json!({ "type": "array", "maxItems": MOST_RECORDS, "items": {} });
    Kind::ALL.into_iter().fold(
        Shape::of(&json!({ "type": "object", "properties": {
            "schema_version": { "type": "integer" }, "sources": anything, "iso13399_aliases": anything,
            "iso13399_source": anything, "rake_corrections": list, "judged_normal_force": list,
        } })),
        |file, kind| file.with_field(kind.plural(), Shape::list_of(shape(kind).clone(), MOST_RECORDS)),
    )
});

/// Fields beside the lists of records.
const BESIDE: [&str; 6] =
    ["schema_version", "sources", "iso13399_aliases", "iso13399_source", "rake_corrections", "judged_normal_force"];

pub(super) fn read(bytes: &[u8], room: &Room) -> Result<Vec<Raw>, RecordError> {
    records(json::parse_as(bytes, &SHAPE, room)?.value)
}

/// The records in the tree of a file.
pub(super) fn records(tree: Value) -> Result<Vec<Raw>, RecordError> {
    let mut found = Faults::default();
    let Value::Object(mut fields) = tree else {
        return Err(RecordError::one(Finding::new("not_a_library", "")));
    };
    if fields.get("schema_version").is_some_and(|version| version.as_u64() != Some(SCHEMA_VERSION)) {
        found.add(Finding::new("unknown_schema_version", "/schema_version").with("known", f64::from(1_u8)));
    }
    let sources = sources(fields.get("sources"), &mut found);
    let known: Vec<&str> = BESIDE.into_iter().chain(Kind::ALL.map(Kind::plural)).collect();
    for name in fields.keys().filter(|name| !known.contains(&name.as_str())) {
        let finding = Finding::new("unknown_field", format!("/{name}")).with("name", name.clone());
        found.add(match nearest(name, known.iter().copied()) {
            Some(nearest) => finding.with("nearest", nearest.to_owned()),
            None => finding.with("allowed", known.clone()),
        });
    }
    let mut raws = Vec::new();
    for kind in Kind::ALL {
        let items = match fields.shift_remove(kind.plural()) {
            None => continue,
            Some(Value::Array(items)) => items,
            Some(_) => {
                found.add(Finding::new("not_a_list", format!("/{}", kind.plural())));
                continue;
            }
        };
        if items.len() > MOST_RECORDS {
            found.add(Finding::new("too_many_records", format!("/{}", kind.plural())).with("most", MOST_RECORDS));
        }
        for (index, mut value) in items.into_iter().take(MOST_RECORDS).enumerate() {
            let place = format!("/{}/{index}", kind.plural());
            let name = value.get("id").or_else(|| value.get("name")).and_then(Value::as_str).map(str::to_owned);
            let Some(name) = name else {
                found.add(Finding::new("missing_field", format!("{place}/id")));
                continue;
            };
            if kind.has_sources() {
                cite(&mut value, &sources);
            }
            raws.push(Raw { kind, name, value, place });
        }
    }
    if found.total > 0 { Err(RecordError::invalid(found)) } else { Ok(raws) }
}

/// The texts that the keys of a file's sources stand for.
fn sources(sources: Option<&Value>, found: &mut Faults) -> Map<String, Value> {
    let mut texts = Map::new();
    for (key, source) in sources.and_then(Value::as_object).into_iter().flatten() {
        match serde_json::from_value::<Source>(source.clone()) {
            Ok(source) => {
                let address = source.address.as_ref().map(|address| format!(" ({address})")).unwrap_or_default();
                texts.insert(key.clone(), format!("{}{address}", source.text()).into());
            }
            Err(error) => {
                let place = crate::registry::child("/sources", key);
                found.add(Finding::new("not_readable", place).with("reason", error.to_string()));
            }
        }
    }
    texts
}

fn cite(value: &mut Value, sources: &Map<String, Value>) {
    match value {
        Value::Object(fields) => {
            for (name, part) in fields.iter_mut() {
                let is_key = ["source", "superseded_by", "names_source"].contains(&name.as_str());
                match part.as_str().filter(|_| is_key).and_then(|key| sources.get(key)) {
                    Some(text) => *part = text.clone(),
                    None => cite(part, sources),
                }
            }
        }
        Value::Array(items) => items.iter_mut().for_each(|item| cite(item, sources)),
        _ => {}
    }
}
