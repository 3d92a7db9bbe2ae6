//! A whole history as one table: a row for each measured place, with the part that it is of.

use precut_calc::calculator::Finding;
use serde_json::{Map, Value, json};

use super::live::Live;
use super::{ProcessError, body::faulty};
use crate::engine::{Engine, Shelf};
use crate::registry::Observed;

/// Columns that say which part a row is of.
const OF_PART: [&str; 3] = ["part", "number", "part_type"];

impl Engine {
    /// Takes a whole history as CSV: columns `part`, `number`, `part_type`, conditions, and those of measured rows.
    pub async fn put_history(
        &self,
        shelf: &Shelf,
        process: &str,
        text: &str,
        owner: String,
    ) -> Result<Value, ProcessError> {
        let inner = &self.inner;
        inner.head(shelf, process).await?;
        let full = shelf.full(process);
        let parts = {
            let seat = inner.live_processes.seat(&full);
            let mut seated = seat.lock().await;
            let live = Live::current(inner, &full, &mut seated).await?;
            parts_of(live.document.observed(&inner.registry)?, text)?
        };
        self.put_parts(shelf, process, parts, owner).await
    }
}

/// The separator of a table: that of which its first line has most.
fn separator(text: &str) -> char {
    let header = text.lines().next().unwrap_or_default();
    let count = |separator: char| header.matches(separator).count();
    [',', ';', '\t'].into_iter().max_by_key(|separator| count(*separator)).unwrap_or(',')
}

fn cell(text: &str, separator: char, is_word: bool) -> Value {
    let number = if separator == ',' { text.to_owned() } else { text.replace(',', ".") };
    match number.parse::<f64>() {
        Ok(number) if !is_word && number.fract() == 0.0 && number.abs() < 1e9 => {
            #[allow(clippy::cast_possible_truncation)] // a whole number below 1e9
            let whole = number as i64;
            json!(whole)
        }
        Ok(number) if !is_word && number.is_finite() => json!(number),
        _ => json!(text),
    }
}

/// The parts of a table, in the order in which they come.
fn parts_of(observed: &Observed, text: &str) -> Result<Vec<(String, Value)>, ProcessError> {
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    let separator = separator(text);
    let mut lines = text.lines().filter(|line| !line.trim().is_empty());
    let cells = |line: &str| -> Vec<String> {
        line.split(separator).map(|cell| cell.trim().trim_matches('"').to_owned()).collect()
    };
    let header = cells(lines.next().unwrap_or_default());
    let schema = observed.part.input_document();
    let conditions = &schema["properties"]["conditions"]["properties"];
    let is_condition = |name: &str| conditions.get(name).is_some();
    let missing: Vec<Finding> = OF_PART
        .into_iter()
        .filter(|name| !header.iter().any(|own| own == name))
        .map(|name| Finding::new("column_missing", "").with("name", name))
        .collect();
    if !missing.is_empty() {
        return Err(faulty(missing));
    }
    let measured: Vec<usize> =
        (0..header.len()).filter(|&k| !OF_PART.contains(&&*header[k]) && !is_condition(&header[k])).collect();
    let joined = |row: &[String]| -> String {
        let cells: Vec<&str> = measured.iter().map(|&k| row.get(k).map_or("", String::as_str)).collect();
        cells.join(&separator.to_string()) + "\n"
    };
    let mut parts: Vec<(String, Map<String, Value>, String)> = Vec::new();
    for line in lines {
        let row = cells(line);
        let of = |name: &str| header.iter().position(|own| own == name).and_then(|k| row.get(k)).cloned();
        let name = of("part").unwrap_or_default();
        if parts.last().is_none_or(|(last, ..)| *last != name) {
            let mut fields = Map::new();
            fields.insert("number".to_owned(), cell(&of("number").unwrap_or_default(), separator, false));
            fields.insert("part_type".to_owned(), json!(of("part_type").unwrap_or_default()));
            let mut stated = Map::new();
            for (k, column) in header.iter().enumerate().filter(|(_, column)| is_condition(column)) {
                let is_word = conditions[column]["type"] == "string" || conditions[column].get("enum").is_some();
                let text = row.get(k).map_or("", String::as_str);
                if !text.is_empty() {
                    stated.insert(column.clone(), cell(text, separator, is_word));
                }
            }
            fields.insert("conditions".to_owned(), stated.into());
            parts.push((name, fields, joined(&header)));
        }
        if let Some((.., table)) = parts.last_mut() {
            table.push_str(&joined(&row));
        }
    }
    Ok(parts
        .into_iter()
        .map(|(name, mut fields, table)| {
            fields.insert("measurements".to_owned(), json!({ "csv": table }));
            (name, Value::Object(fields))
        })
        .collect())
}
