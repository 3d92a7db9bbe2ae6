//! Records in CSV: long, a row for each number and each word, which loses nothing; or wide, a row for each tool, as tools
//! leave a spreadsheet.

use std::collections::BTreeMap;

use precut_calc::calculator::Finding;
use precut_library::Kind;
use precut_library::record::{ISO_13399, Record, schema};
use serde_json::{Map, Value};

use super::super::set::set;
use super::super::{RecordError, set};
use super::Raw;
use crate::engine::budget::Room;
use crate::engine::json::{self, RETRY_AFTER};
use crate::engine::{Error, SyntaxFault};
use crate::registry::{Faults, child, nearest};
use crate::render::defused;
use crate::units;

/// The columns of the long form. A row is a number with what is said of it, or a word.
const LONG: [&str; 10] = ["kind", "name", "pointer", "value", "unit", "source", "certainty", "low", "high", "note"];
/// Parts of a number that have columns of their own.
const PARTS: [&str; 5] = ["source", "certainty", "low", "high", "note"];
/// What the rows of such a file take of memory, at most about so many times its size.
const TREE: usize = 20;

pub(super) fn written(lists: &[(Kind, Vec<Record>)]) -> Vec<u8> {
    let mut file = csv::Writer::from_writer(Vec::new());
    let mut put = |row: &[String]| drop(file.write_record(row));
    put(&LONG.map(str::to_owned));
    for (kind, records) in lists {
        let schema = schema(*kind);
        for record in records {
            let mut rows = Rows { kind: *kind, name: &record.name, schema: &schema, lines: Vec::new() };
            rows.add(&record.value, "");
            rows.lines.iter().for_each(|row| put(row));
        }
    }
    // Into memory nothing fails.
    file.into_inner().unwrap_or_default()
}

struct Rows<'a> {
    kind: Kind,
    name: &'a str,
    schema: &'a Value,
    lines: Vec<[String; 10]>,
}

impl Rows<'_> {
    fn add(&mut self, value: &Value, pointer: &str) {
        match value {
            // What stands in a job is one cell.
            Value::Object(_) | Value::Array(_)
                if !pointer.is_empty() && place(self.schema, pointer).is_some_and(|place| place["type"].is_array()) =>
            {
                self.row(pointer, value, Default::default());
            }
            Value::Object(fields) if fields.get("value").is_some_and(is_scalar) => {
                let part = |name: &str| match fields.get(name) {
                    Some(Value::String(word)) => defused(word),
                    Some(other) => other.to_string(),
                    None => String::new(),
                };
                self.row(pointer, &fields["value"], PARTS.map(part));
                for (name, part) in
                    fields.iter().filter(|(name, _)| *name != "value" && !PARTS.contains(&name.as_str()))
                {
                    self.add(part, &child(pointer, name));
                }
            }
            Value::Object(fields) if !fields.is_empty() => {
                fields.iter().for_each(|(name, part)| self.add(part, &child(pointer, name)));
            }
            Value::Array(items) if !items.is_empty() => {
                items.iter().enumerate().for_each(|(index, item)| self.add(item, &format!("{pointer}/{index}")));
            }
            leaf => self.row(pointer, leaf, Default::default()),
        }
    }

    fn row(&mut self, pointer: &str, value: &Value, [source, certainty, low, high, note]: [String; 5]) {
        let place = place(self.schema, pointer);
        let unit = place.and_then(|place| place.get("x-unit")).and_then(Value::as_str).unwrap_or_default();
        let (kind, name) = (self.kind.name().to_owned(), self.name.to_owned());
        let (value, unit) = (cell(value, place), unit.to_owned());
        self.lines.push([kind, name, pointer.to_owned(), value, unit, source, certainty, low, high, note]);
    }
}

fn is_scalar(value: &Value) -> bool {
    matches!(value, Value::Number(_) | Value::String(_) | Value::Bool(_))
}

/// A value as a cell: words as they are, unless nothing says that they are words and they look like something else.
fn cell(value: &Value, place: Option<&Value>) -> String {
    match value {
        Value::String(word) if place.is_none() && serde_json::from_str::<Value>(word).is_ok() => {
            Value::String(word.clone()).to_string()
        }
        Value::String(word) => defused(word),
        other => other.to_string(),
    }
}

/// What the schema says of a part of a value.
fn part_of<'s>(schema: &'s Value, part: &str) -> Option<&'s Value> {
    let property = schema.get("properties").and_then(|fields| fields.get(part));
    let item = || schema.get("items").filter(|_| set::index(part).is_some());
    property.or_else(item).or_else(|| schema.get("additionalProperties").filter(|free| free.is_object()))
}

/// What the schema says of the value at a pointer: of a number with a source, of the number in it.
fn place<'s>(schema: &'s Value, pointer: &str) -> Option<&'s Value> {
    let parts = precut_library::record::pointer_parts(pointer);
    let place = parts.into_iter().try_fold(schema, |node, part| part_of(node, &part))?;
    Some(place.pointer("/properties/value").unwrap_or(place))
}

/// A record of rows, with lists where the schema has them: rows say the index of an item as they say the name of a field.
fn with_lists(value: Value, schema: Option<&Value>) -> Value {
    let Value::Object(fields) = value else { return value };
    let inner = fields.into_iter().map(|(name, part)| {
        let of_part = schema.and_then(|schema| part_of(schema, &name));
        let part = with_lists(part, of_part);
        (name, part)
    });
    if schema.and_then(|schema| schema.get("type")).is_none_or(|kind| kind != "array") {
        return Value::Object(inner.collect());
    }
    let fields: Map<String, Value> = inner.collect();
    let mut items: Vec<(usize, &Value)> =
        fields.iter().filter_map(|(name, part)| Some((set::index(name)?, part))).collect();
    items.sort_unstable_by_key(|(index, _)| *index);
    let is_whole = items.len() == fields.len() && items.iter().enumerate().all(|(place, (index, _))| place == *index);
    if is_whole { items.into_iter().map(|(_, part)| part.clone()).collect() } else { Value::Object(fields) }
}

/// The value of a cell, by what may stand at its place.
fn value_of(text: &str, place: Option<&Value>) -> Value {
    let kind = place.and_then(|place| place.get("type")).and_then(Value::as_str);
    let word = || Value::String(text.strip_prefix('\'').unwrap_or(text).to_owned());
    match kind {
        Some("string") => word(),
        Some("number" | "integer") => number_of(text).unwrap_or_else(word),
        _ => serde_json::from_str(text).ok().map_or_else(word, whole),
    }
}

fn whole(value: Value) -> Value {
    match value {
        Value::Number(number) => number.as_f64().and_then(json::number).unwrap_or(Value::Number(number)),
        other => other,
    }
}

fn number_of(text: &str) -> Option<Value> {
    text.trim().parse::<f64>().ok().filter(|number| number.is_finite()).and_then(json::number)
}

pub(super) fn read(bytes: &[u8], room: &Room) -> Result<Vec<Raw>, RecordError> {
    if !room.take(TREE * bytes.len()) {
        return Err(Error::Busy { retry_after: RETRY_AFTER }.into());
    }
    let bytes = bytes.strip_prefix(b"\xEF\xBB\xBF").unwrap_or(bytes);
    let head = bytes.split(|byte| *byte == b'\n').next().unwrap_or_default();
    let delimiter = [b';', b'\t'].into_iter().find(|delimiter| head.contains(delimiter)).unwrap_or(b',');
    let mut file = csv::ReaderBuilder::new().delimiter(delimiter).flexible(true).from_reader(bytes);
    let header: Vec<String> =
        file.headers().map_err(|error| broken(&error))?.iter().map(|name| name.trim().to_owned()).collect();
    let rows: Vec<csv::StringRecord> = file.records().collect::<Result<_, _>>().map_err(|error| broken(&error))?;
    if header.iter().any(|name| name == "pointer") { long(&header, &rows) } else { wide(&header, &rows) }
}

fn broken(error: &csv::Error) -> Error {
    let line = error.position().map_or(1, |position| usize::try_from(position.line()).unwrap_or(usize::MAX));
    let message = error.to_string();
    Error::Syntax(SyntaxFault { code: "bad_syntax", pointer: String::new(), line, column: 1, message })
}

/// A fault in a row of the file, counted as in a spreadsheet: the header is the first.
fn fault(code: &'static str, index: usize, column: &str) -> Finding {
    Finding::new(code, child(&format!("/rows/{}", index + 2), column))
        .with("row", index + 2)
        .with("column", column.to_owned())
}

fn long(header: &[String], rows: &[csv::StringRecord]) -> Result<Vec<Raw>, RecordError> {
    let mut found = Faults::default();
    let column = |name: &str| header.iter().position(|there| there == name);
    for name in header.iter().filter(|name| !LONG.contains(&name.as_str())) {
        let finding = Finding::new("unknown_library_column", child("/rows/1", name)).with("name", name.clone());
        found.add(finding.with("allowed", LONG.to_vec()));
    }
    for name in ["kind", "name", "pointer", "value"].into_iter().filter(|name| column(name).is_none()) {
        found.add(Finding::new("missing_library_column", "/rows/1").with("name", name));
    }
    if found.total > 0 {
        return Err(RecordError::invalid(found));
    }
    let schemas = Kind::ALL.map(|kind| (kind, schema(kind)));
    let mut records: BTreeMap<(Kind, String), (Value, String)> = BTreeMap::new();
    for (index, row) in rows.iter().enumerate() {
        let cell = |name: &str| column(name).and_then(|at| row.get(at)).map(str::trim).unwrap_or_default();
        let word = cell("kind");
        let Some((kind, schema)) = schemas.iter().find(|(kind, _)| kind.name() == word) else {
            let allowed = Kind::ALL.map(Kind::name).to_vec();
            found.add(fault("not_one_of", index, "kind").with("received", word.to_owned()).with("allowed", allowed));
            continue;
        };
        let (pointer, name) = (cell("pointer"), cell("name"));
        let at_pointer = place(schema, pointer);
        let unit = at_pointer.and_then(|place| place.get("x-unit")).and_then(Value::as_str).unwrap_or_default();
        if !cell("unit").is_empty() && cell("unit") != unit {
            found.add(
                fault("wrong_library_unit", index, "unit")
                    .with("received", cell("unit").to_owned())
                    .with("expected", unit.to_owned()),
            );
            continue;
        }
        let is_list =
            at_pointer.is_some_and(|place| place.get("type").is_some_and(|kind| kind == "array" || kind == "object"));
        let raw = column("value").and_then(|at| row.get(at)).unwrap_or_default();
        let mut value =
            if is_list { serde_json::from_str(raw).unwrap_or_else(|_| raw.into()) } else { value_of(raw, at_pointer) };
        let parts: Map<String, Value> = PARTS
            .iter()
            .filter_map(|part| {
                let text = column(part).and_then(|at| row.get(at)).filter(|text| !text.is_empty())?;
                let is_end = ["low", "high"].contains(part);
                let end = || number_of(text).unwrap_or_else(|| text.into());
                let words = || Value::String(text.strip_prefix('\'').unwrap_or(text).to_owned());
                Some(((*part).to_owned(), if is_end { end() } else { words() }))
            })
            .collect();
        if !parts.is_empty() {
            let mut sourced = Map::new();
            sourced.insert("value".to_owned(), value);
            sourced.extend(parts);
            value = sourced.into();
        }
        let place = format!("/rows/{}", index + 2);
        let (record, _) = records.entry((*kind, name.to_owned())).or_insert_with(|| (Value::Object(Map::new()), place));
        if !set(record, pointer, value) {
            found.add(fault("set_leads_nowhere", index, "pointer").with("received", pointer.to_owned()));
        }
    }
    if found.total > 0 {
        return Err(RecordError::invalid(found));
    }
    let raw = |((kind, name), (value, _))| {
        let schema = schemas.iter().find(|(of, _)| *of == kind).map(|(_, schema)| schema);
        let value = with_lists(value, schema);
        let place = format!("/{}/{name}", Kind::plural(kind));
        Raw { kind, name, value, place }
    };
    Ok(records.into_iter().map(raw).collect())
}

/// A column of the wide form.
struct Column {
    /// Where its values go.
    pointer: String,
    /// The unit that it says, with that of the field.
    units: Option<(String, String)>,
}

fn wide(header: &[String], rows: &[csv::StringRecord]) -> Result<Vec<Raw>, RecordError> {
    let schema = schema(Kind::Tool);
    let mut found = Faults::default();
    let columns: Vec<Option<Column>> = header.iter().map(|name| wide_column(name, &schema, &mut found)).collect();
    let name_at = header.iter().position(|name| name == "name" || name == "id");
    if name_at.is_none() {
        found.add(Finding::new("missing_library_column", "/rows/1").with("name", "name"));
    }
    let (Some(name_at), 0) = (name_at, found.total) else { return Err(RecordError::invalid(found)) };
    let mut raws = Vec::with_capacity(rows.len());
    for (index, row) in rows.iter().enumerate() {
        let mut value = Value::Object(Map::new());
        for (at, column) in columns.iter().enumerate() {
            let text = row.get(at).map(str::trim).unwrap_or_default();
            let Some(Column { pointer, units }) = column else { continue };
            if text.is_empty() {
                continue;
            }
            let of_cell = match units {
                Some((from, to)) => units::converted(text, from, to).and_then(json::number),
                None => Some(value_of(text, place(&schema, pointer))),
            };
            match of_cell {
                Some(of_cell) => drop(set(&mut value, pointer, of_cell)),
                None => found.add(fault("not_a_number", index, &header[at]).with("received", text.to_owned())),
            }
        }
        let name = row.get(name_at).unwrap_or_default().trim().to_owned();
        raws.push(Raw { kind: Kind::Tool, name, value, place: format!("/rows/{}", index + 2) });
    }
    if found.total > 0 { Err(RecordError::invalid(found)) } else { Ok(raws) }
}

/// The column of a header: our name, with dots into parts, or a symbol of ISO 13399, and a unit in brackets; nothing for
/// the name of the record.
fn wide_column(header: &str, schema: &Value, found: &mut Faults) -> Option<Column> {
    let (name, unit) = match header.split_once('[') {
        Some((name, unit)) => (name.trim(), Some(unit.trim_end_matches(']').trim())),
        None => (header, None),
    };
    if name == "name" || name == "id" {
        return None;
    }
    let ours = ISO_13399.iter().find(|(symbol, _)| *symbol == name).map_or(name, |(_, ours)| ours);
    let pointer: String = ours.split('.').map(|part| child("", part)).collect();
    let Some(place) = place(schema, &pointer) else {
        let fields = schema["properties"].as_object().into_iter().flatten().map(|(name, _)| name.clone());
        let known: Vec<String> = fields.chain(ISO_13399.iter().map(|(symbol, _)| (*symbol).to_owned())).collect();
        let finding = Finding::new("unknown_library_column", child("/rows/1", header)).with("name", name.to_owned());
        found.add(match nearest(name, known.iter().map(String::as_str)) {
            Some(nearest) => finding.with("nearest", nearest.to_owned()),
            None => finding.with("allowed", known),
        });
        return None;
    };
    let of_field = place.get("x-unit").and_then(Value::as_str).unwrap_or_default();
    match unit {
        Some(unit) if unit != of_field => {
            if units::convert(1.0, unit, of_field).is_none() {
                let finding = Finding::new("wrong_library_unit", child("/rows/1", header))
                    .with("row", 1.0)
                    .with("column", name.to_owned());
                found.add(finding.with("received", unit.to_owned()).with("expected", of_field.to_owned()));
            }
            Some(Column { pointer, units: Some((unit.to_owned(), of_field.to_owned())) })
        }
        _ => Some(Column { pointer, units: None }),
    }
}
