//! Measured tables of a job: rows, CSV in their place or file parts become rows, so that the same data give the same
//! key however they came.

use precut_calc::calculator::Finding;
use serde_json::{Map, Value, json};

use super::budget::Room;
use super::{FilePart, csv_table};
use crate::registry::{Faults, Step, TablePlace, canonical, child, nearest};

/// Where the rows of a table stood in its text, for faults found later.
pub(crate) struct CsvSource {
    pointer: String,
    lines: Vec<u64>,
}

/// What became of a job's tables.
#[derive(Default)]
pub(crate) struct Tables {
    sources: Vec<CsvSource>,
    /// Pointers of tables that could not be read; what the schema says of them is noise.
    unread: Vec<String>,
}

/// Puts rows in the place of CSV. What cannot be read becomes null.
pub(crate) fn resolve(
    job: &mut Value,
    (parts, room): (&[&FilePart], &Room),
    places: &[TablePlace],
    faults: &mut Faults,
) -> Tables {
    let mut tables = Tables::default();
    for part in parts {
        if let Err(finding) = place_part(job, part, places) {
            faults.add(finding);
        }
    }
    for place in places {
        each_at(job, &place.way.0, String::new(), &mut |value, pointer| {
            let Some(text) = csv_text(value) else { return };
            if let Some(read) = csv_table::read(&text, place, (&pointer, room), faults) {
                tables.sources.push(CsvSource { pointer, lines: read.lines });
                *value = read.rows.into();
            } else {
                tables.unread.push(pointer);
                *value = Value::Null;
            }
        });
    }
    tables
}

impl Tables {
    /// The same with more that could not be read.
    pub(crate) fn with_unread(mut self, more: Vec<String>) -> Self {
        self.unread.extend(more);
        self
    }

    /// Whether a fault concerns a table that could not be read anyway.
    pub(crate) fn is_noise(&self, finding: &Finding) -> bool {
        self.unread.contains(&finding.pointer)
    }

    /// Pointers of tables that could not be read and are null in the job.
    pub(crate) fn into_unread(self) -> Vec<String> {
        self.unread
    }

    /// A fault in a row that came as CSV also says on which line the row stood.
    pub(crate) fn located(&self, finding: Finding) -> Finding {
        let line = self.sources.iter().find_map(|source| {
            let rest = finding.pointer.strip_prefix(source.pointer.as_str())?.strip_prefix('/')?;
            let row: usize = rest.split('/').next()?.parse().ok()?;
            source.lines.get(row)
        });
        match line {
            // Line numbers are far below 2^53.
            #[allow(clippy::cast_precision_loss)]
            Some(line) => finding.with("line", *line as f64),
            None => finding,
        }
    }
}

/// The job as it is echoed: tables as row count and hash.
pub(crate) fn without_rows(mut input: Value, places: &[TablePlace]) -> Value {
    for place in places {
        each_at(&mut input, &place.way.0, String::new(), &mut |value, _| {
            if let Value::Array(rows) = value {
                let text = canonical(rows).expect("rows are JSON with text keys");
                let hash = blake3::hash(&text).to_hex();
                *value = json!({ "rows": rows.len(), "b3": hash.as_str() });
            }
        });
    }
    input
}

/// Whether a job has rows of a table.
pub(crate) fn has_rows(job: &Value, places: &[TablePlace]) -> bool {
    fn any_at(value: &Value, path: &[Step]) -> bool {
        match (path.split_first(), value) {
            (None, Value::Array(rows)) => !rows.is_empty(),
            (Some((Step::Field(name), rest)), Value::Object(map)) => {
                map.get(name).is_some_and(|inner| any_at(inner, rest))
            }
            (Some((Step::Each, rest)), Value::Array(items)) => items.iter().any(|item| any_at(item, rest)),
            _ => false,
        }
    }
    places.iter().any(|place| any_at(job, &place.way.0))
}

/// Runs `visit` on every value at `path`.
fn each_at(value: &mut Value, path: &[Step], pointer: String, visit: &mut impl FnMut(&mut Value, String)) {
    match (path.split_first(), value) {
        (None, value) => visit(value, pointer),
        (Some((Step::Field(name), rest)), Value::Object(map)) => {
            if let Some(inner) = map.get_mut(name) {
                each_at(inner, rest, child(&pointer, name), visit);
            }
        }
        (Some((Step::Each, rest)), Value::Array(items)) => {
            for (index, item) in items.iter_mut().enumerate() {
                each_at(item, rest, format!("{pointer}/{index}"), visit);
            }
        }
        _ => {}
    }
}

/// The text of `{"csv": "..."}`.
fn csv_text(value: &mut Value) -> Option<String> {
    let map = value.as_object_mut().filter(|map| map.len() == 1)?;
    match map.get_mut("csv")? {
        Value::String(text) => Some(std::mem::take(text)),
        _ => None,
    }
}

/// Puts the text of a file part where its name says.
fn place_part(job: &mut Value, part: &FilePart, places: &[TablePlace]) -> Result<(), Finding> {
    let mut fitting = places.iter().filter_map(|place| place.way.fit(&part.name));
    let name = || part.name.clone();
    let Some(path) = fitting.next() else {
        let names: Vec<String> = places.iter().map(|place| place.way.dotted()).collect();
        let finding = Finding::new("unknown_table", meant(&part.name)).with("name", name());
        let near = nearest(&part.name, names.iter().map(String::as_str)).map(str::to_owned);
        return Err(match near {
            Some(near) => finding.with("nearest", near),
            None => finding.with("allowed", names),
        });
    };
    if fitting.next().is_some() {
        return Err(Finding::new("ambiguous_table", meant(&part.name)).with("name", name()));
    }
    let Ok(text) = std::str::from_utf8(&part.bytes) else {
        return Err(Finding::new("table_not_utf8", pointer_of(&path)).with("name", name()));
    };
    put(job, &path, &part.name, json!({ "csv": text }))
}

/// The pointer of a way.
pub(super) fn pointer_of(path: &[String]) -> String {
    path.iter().fold(String::new(), |pointer, step| child(&pointer, step))
}

/// Puts what came as a file where nothing stands yet.
pub(super) fn put(job: &mut Value, path: &[String], name: &str, value: Value) -> Result<(), Finding> {
    let refused = |code| Err(Finding::new(code, pointer_of(path)).with("name", name.to_owned()));
    match place_at(job, path) {
        None => refused("no_place_for_table"),
        Some(target) if !target.is_null() => refused("table_given_twice"),
        Some(target) => {
            *target = value;
            Ok(())
        }
    }
}

/// The value at the end of a way, with the objects on it that are not there yet; `None` where something else stands on it.
pub(super) fn place_at<'j>(job: &'j mut Value, path: &[String]) -> Option<&'j mut Value> {
    path.iter().try_fold(job, |value, step| {
        if value.is_null() {
            *value = Value::Object(Map::new());
        }
        match value {
            Value::Object(map) => Some(map.entry(step.as_str()).or_insert(Value::Null)),
            Value::Array(items) => step.parse::<usize>().ok().and_then(|index| items.get_mut(index)),
            _ => None,
        }
    })
}

/// Where a part with this name would stand in the job.
fn meant(name: &str) -> String {
    name.split('.').fold(String::new(), |pointer, step| child(&pointer, step))
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::registry::toy;
    use crate::text::{Language, Texts};

    fn resolved(mut job: Value, parts: &[(&str, &str)]) -> (Value, Vec<&'static str>) {
        let registry = toy::registry();
        let parts: Vec<FilePart> = parts
            .iter()
            .map(|(name, text)| FilePart { name: (*name).into(), bytes: text.to_string().into() })
            .collect();
        let parts: Vec<&FilePart> = parts.iter().collect();
        let mut faults = Faults::default();
        resolve(
            &mut job,
            (&parts, &Room::default()),
            registry.entry("toy-bar").unwrap().tables_of(&Value::Null),
            &mut faults,
        );
        for finding in &faults.listed {
            Texts::shared().try_finding(Language::En, "fault", finding).unwrap();
        }
        (job, faults.listed.iter().map(|finding| finding.code).collect())
    }

    const TEXT: &str = "z_mm,deviation_um\n1,2\n";

    #[test]
    fn text_in_place_and_a_file_part_become_the_rows_that_json_has() {
        let rows = json!({"measurements": [{"z_mm": 1, "deviation_um": 2}]});
        assert_eq!(resolved(rows.clone(), &[]), (rows.clone(), vec![]));
        assert_eq!(resolved(json!({"measurements": {"csv": TEXT}}), &[]), (rows.clone(), vec![]));
        assert_eq!(resolved(json!({}), &[("measurements", TEXT)]), (rows, vec![]));
    }

    #[test]
    fn a_part_that_fits_nowhere_is_a_fault() {
        assert_eq!(resolved(json!({}), &[("measurement", TEXT)]).1, ["unknown_table"]);
        assert_eq!(resolved(json!({"measurements": []}), &[("measurements", TEXT)]).1, ["table_given_twice"]);
        assert_eq!(resolved(json!(3), &[("measurements", TEXT)]).1, ["no_place_for_table"]);
    }

    #[test]
    fn the_echo_has_the_hash_of_the_rows() {
        let registry = toy::registry();
        let places = registry.entry("toy-bar").unwrap().tables_of(&Value::Null);
        let echo = without_rows(json!({"measurements": [{"z_mm": 1, "deviation_um": 2}]}), places);
        let other = without_rows(json!({"measurements": [{"deviation_um": 2.0, "z_mm": 1.0}]}), places);
        assert_eq!(echo["measurements"]["rows"], 1);
        assert_eq!(echo, other);
    }
}
