//! A measured table as CSV text into rows.

#[cfg(test)]
mod tests;

use std::borrow::Cow;
use std::collections::HashSet;

use precut_calc::calculator::Finding;
use serde_json::{Map, Value};

use super::budget::Room;
use super::{headings, json};
use crate::registry::{CellKind, Faults, TableColumn, TablePlace, child, nearest};
use crate::units;

/// Longest name of a column that no field names.
const LONGEST_NAME: usize = 64;
/// Most columns beside those that fields name: each takes its time in every row.
const MOST_FURTHER: usize = 64;
/// Cells of a line that is read at all: each takes some memory of its own before anything is known of it.
const MOST_CELLS: usize = 200_000;
/// Longest piece of a cell that is shown.
const SHOWN_CHARS: usize = 40;

/// Rows with the line on which each stood.
#[derive(Debug, Default)]
pub(crate) struct CsvRows {
    pub(crate) rows: Vec<Value>,
    pub(crate) lines: Vec<u64>,
}

/// The rows of `text`; `None` after adding what is wrong with it at `pointer`.
pub(crate) fn read(
    text: &str,
    place: &TablePlace,
    (pointer, room): (&str, &Room),
    faults: &mut Faults,
) -> Option<CsvRows> {
    let before = faults.total;
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    let separator = separator(text);
    let most = place.columns.len() + MOST_FURTHER;
    if let Some(columns) = overlong_line(text, separator) {
        faults.add(Finding::new("too_many_columns", pointer).with("columns", columns).with("maximum", most));
        return None;
    }
    let Some(header) = Records::of(text, separator).next() else {
        faults.add(Finding::new("empty_table", pointer));
        return None;
    };
    let records = || Records::of(text, separator).skip(1);
    if records().nth(place.max_rows).is_some() {
        // A table has far fewer rows than 2^53.
        #[allow(clippy::cast_precision_loss)]
        faults.add(Finding::new("too_many_rows", pointer).with("maximum", place.max_rows as f64));
        return None;
    }
    let lines = Lines { header: line(text, &header), decimal_comma: separator != b',', records: &records };
    let columns = columns(&header, &lines, place, pointer, faults);
    if faults.total > before {
        return None;
    }
    let table = Table { columns: &columns, decimal_comma: separator != b',', pointer };
    if records().nth(json::HEAD_ITEMS).is_some() {
        // As values many rows take a multiple of their text: a table with a fault in it is refused without them.
        for (number, record) in records().enumerate() {
            let (line, so_far) = (line(text, &record), faults.total);
            let row = table.row(number, &record, line, faults);
            if faults.total > so_far {
                continue;
            }
            let mut of_row = Faults::default();
            place.rules.check(&row, || format!("{pointer}/{number}"), &mut of_row);
            of_row.listed = of_row.listed.into_iter().map(|finding| finding.with("line", whole(line))).collect();
            faults.extend(of_row);
        }
        if faults.total > before {
            return None;
        }
    }
    let mut read = CsvRows::default();
    for (number, record) in records().enumerate() {
        if !room.take(row_bytes(columns.len())) {
            return None;
        }
        let line = line(text, &record);
        read.rows.push(table.row(number, &record, line, faults));
        read.lines.push(line);
    }
    (faults.total == before).then_some(read)
}

/// How many cells the first line has that has too many to be read.
fn overlong_line(text: &str, separator: u8) -> Option<usize> {
    let cells = |line: &str| line.split(char::from(separator)).count();
    text.split('\n').map(cells).find(|cells| *cells > MOST_CELLS)
}

/// The line on which a record stands. The reader's own position is that of the empty lines before it.
fn line(text: &str, record: &csv::StringRecord) -> u64 {
    let Some(position) = record.position() else { return 0 };
    let before = usize::try_from(position.byte()).unwrap_or(usize::MAX);
    let skipped = text.as_bytes().get(before..).unwrap_or_default();
    let empty = skipped.iter().take_while(|byte| matches!(byte, b'\n' | b'\r')).filter(|byte| **byte == b'\n').count();
    position.line() + empty as u64
}

/// Tab, semicolon or comma: the first of them that the header has outside quotes. A header without any is a single
/// column, which may then have decimal commas.
fn separator(text: &str) -> u8 {
    const ALL: [u8; 3] = [b'\t', b';', b','];
    let header = text.lines().find(|line| !line.trim().is_empty()).unwrap_or_default();
    // Noted as they are met: the characters of a header may take many times its bytes.
    let (mut quoted, mut met) = (false, [false; 3]);
    for byte in header.bytes() {
        quoted ^= byte == b'"';
        for (met, separator) in met.iter_mut().zip(ALL) {
            *met |= !quoted && byte == separator;
        }
    }
    ALL.into_iter().zip(met).find(|(_, met)| *met).map_or(b'\t', |(separator, _)| separator)
}

/// A column of the text: which field it fills and from which unit.
struct CsvColumn<'a> {
    field: Cow<'a, TableColumn>,
    unit: String,
    /// The field of the row that holds it by name, of a column that has no field of its own.
    within: Option<&'a str>,
}

/// What stands around the header.
struct Lines<'a> {
    header: u64,
    decimal_comma: bool,
    /// The lines that have something in them, from the first after the header: read again each time, as all of them
    /// together take many times the memory of their text.
    records: &'a dyn Fn() -> std::iter::Skip<Records<'a>>,
}

/// The lines of a text that have something in them.
struct Records<'a>(csv::StringRecordsIntoIter<&'a [u8]>);

impl<'a> Records<'a> {
    fn of(text: &'a str, separator: u8) -> Self {
        let reader = csv::ReaderBuilder::new()
            .delimiter(separator)
            .has_headers(false)
            .flexible(true)
            .trim(csv::Trim::All)
            .from_reader(text.as_bytes());
        Self(reader.into_records())
    }
}

impl Iterator for Records<'_> {
    type Item = csv::StringRecord;
    fn next(&mut self) -> Option<csv::StringRecord> {
        self.0.by_ref().filter_map(Result::ok).find(|record| record.iter().any(|cell| !cell.is_empty()))
    }
}

/// What a row with so many cells takes, bytes.
const fn row_bytes(cells: usize) -> usize {
    /// Name, value and place of a cell; a short name takes as much as the smallest piece of memory.
    const CELL: usize = size_of::<Value>() + size_of::<String>() + 4 * size_of::<usize>();
    size_of::<Value>() + size_of::<u64>() + cells * CELL
}

fn columns<'a>(
    header: &csv::StringRecord,
    lines: &Lines<'_>,
    place: &'a TablePlace,
    pointer: &str,
    faults: &mut Faults,
) -> Vec<CsvColumn<'a>> {
    let before = faults.total;
    let used = used_cells(header);
    let most = place.columns.len() + MOST_FURTHER;
    if used > most {
        faults.add(Finding::new("too_many_columns", pointer).with("columns", used).with("maximum", most));
        return Vec::new();
    }
    let mut found: Vec<CsvColumn<'a>> = Vec::new();
    let mut filled: HashSet<String> = HashSet::new();
    for (index, cell) in header.iter().take(used).enumerate() {
        let fault = |code| Finding::new(code, pointer).with("column", shown(cell)).with("line", whole(lines.header));
        let read = match column(cell, place) {
            Err(BadHeader::Unknown { nearest }) => {
                free_column(cell, index, lines, place).ok_or(BadHeader::Unknown { nearest })
            }
            known => known,
        };
        match read {
            Ok(column) if !filled.insert(column.field.name.clone()) => {
                faults.add(fault("duplicate_column").with("fills", column.field.name.clone()));
            }
            Ok(column) => found.push(column),
            Err(BadHeader::Unknown { nearest: Some(nearest) }) => {
                faults.add(fault("unknown_column").with("nearest", nearest));
            }
            Err(BadHeader::Unknown { nearest: None }) => {
                let allowed: Vec<String> = place.columns.iter().map(|column| column.name.clone()).collect();
                let found: Vec<String> = header.iter().take(used).map(shown).collect();
                faults.add(fault("unknown_column").with("allowed", allowed).with("found", found));
            }
            Err(BadHeader::NoUnit { expected }) => faults.add(fault("missing_unit").with("expected", expected)),
            Err(BadHeader::WrongUnit { expected, received }) => {
                faults.add(fault("wrong_unit").with("expected", expected).with("received", received));
            }
        }
    }
    let names_read = faults.total == before;
    for field in place.columns.iter().filter(|field| field.required) {
        // A column under a name that was not understood is not missing as well.
        if names_read && !filled.contains(&field.name) {
            let found: Vec<String> = header.iter().take(used).map(shown).collect();
            faults.add(Finding::new("missing_column", pointer).with("column", field.name.clone()).with("found", found));
        }
    }
    found
}

/// A column that no field names, where the table takes such: numbers if all its cells are, else words.
fn free_column<'a>(cell: &str, index: usize, lines: &Lines<'_>, place: &'a TablePlace) -> Option<CsvColumn<'a>> {
    let (name, unit) = headings::split(cell);
    let unit = unit.map(units::suffix).unwrap_or_default();
    let name = name.trim().to_lowercase().replace(' ', "_") + &unit;
    if name.is_empty() || name.len() > LONGEST_NAME {
        return None;
    }
    let is_number = |cell: &str| cell.is_empty() || decimal(cell, lines.decimal_comma).is_some();
    let numbers = (lines.records)().all(|record| record.get(index).is_none_or(is_number));
    let (within, kind) = match (&place.free.numbers, &place.free.words) {
        (Some(within), _) if numbers => (within, CellKind::Number),
        (_, Some(within)) => (within, CellKind::Word),
        _ => return None,
    };
    let field = Cow::Owned(TableColumn { name, unit: String::new(), kind, required: false });
    Some(CsvColumn { field, unit: String::new(), within: Some(within) })
}

enum BadHeader {
    Unknown { nearest: Option<String> },
    NoUnit { expected: String },
    WrongUnit { expected: String, received: String },
}

/// The field that a header means: `name [unit]`, `name_unit`, or the name alone where there is no unit.
fn column<'a>(cell: &str, place: &'a TablePlace) -> Result<CsvColumn<'a>, BadHeader> {
    let (called, bracket) = headings::split(cell);
    let name = called.trim().to_lowercase().replace(' ', "_");
    for field in &place.columns {
        let stem = field.name.strip_suffix(units::suffix(&field.unit).as_str()).unwrap_or(&field.name);
        if name == field.name || name == stem {
            let unit = match bracket {
                Some(unit) => unit.to_owned(),
                None if name == field.name || has_no_unit(field) => field.unit.clone(),
                None => return Err(BadHeader::NoUnit { expected: field.unit.clone() }),
            };
            if unit == field.unit || (has_no_unit(field) && unit.is_empty()) {
                return Ok(CsvColumn { field: Cow::Borrowed(field), unit: field.unit.clone(), within: None });
            }
            return match units::convert(1.0, &unit, &field.unit) {
                Some(_) => Ok(CsvColumn { field: Cow::Borrowed(field), unit, within: None }),
                None => Err(BadHeader::WrongUnit { expected: field.unit.clone(), received: unit }),
            };
        }
        let other_unit = units::alike(&field.unit).find(|unit| {
            let suffix = units::suffix(unit);
            !suffix.is_empty() && name.strip_suffix(suffix.as_str()) == Some(stem)
        });
        if let (Some(unit), None) = (other_unit, bracket) {
            return Ok(CsvColumn { field: Cow::Borrowed(field), unit: unit.to_owned(), within: None });
        }
    }
    if let Some((field, unit)) = bracket.and_then(|unit| Some((headings::meant(called, unit, &place.columns)?, unit))) {
        return Ok(CsvColumn { field: Cow::Borrowed(field), unit: unit.to_owned(), within: None });
    }
    let names = place.columns.iter().map(|column| column.name.as_str());
    Err(BadHeader::Unknown { nearest: nearest(&name, names).map(str::to_owned) })
}

fn has_no_unit(field: &TableColumn) -> bool {
    field.unit.is_empty() || field.unit == "1"
}

struct Table<'a> {
    columns: &'a [CsvColumn<'a>],
    decimal_comma: bool,
    pointer: &'a str,
}

impl Table<'_> {
    fn row(&self, number: usize, record: &csv::StringRecord, line: u64, faults: &mut Faults) -> Value {
        let used = used_cells(record);
        let place = || format!("{}/{number}", self.pointer);
        if used > self.columns.len() {
            let finding = Finding::new("ragged_row", place()).with("line", whole(line));
            faults.add(finding.with("cells", used).with("columns", self.columns.len()));
            return Value::Null;
        }
        let mut row = Map::with_capacity(self.columns.len());
        for (index, column) in self.columns.iter().enumerate() {
            let cell = record.get(index).unwrap_or_default();
            let fault = |code| {
                let map = column.within.map_or_else(place, |map| child(&place(), map));
                Finding::new(code, child(&map, &column.field.name))
                    .with("line", whole(line))
                    .with("column", column.field.name.clone())
                    .with("column_number", index + 1)
                    .with("received", shown(cell))
            };
            if cell.is_empty() {
                if column.field.required {
                    faults.add(fault("empty_cell"));
                }
            } else if let Some(value) = self.value(cell, column) {
                let name = column.field.name.clone();
                match column.within {
                    None => row.insert(name, value),
                    Some(map) => row
                        .entry(map)
                        .or_insert_with(|| Value::Object(Map::new()))
                        .as_object_mut()
                        .and_then(|map| map.insert(name, value)),
                };
            } else {
                faults.add(fault("bad_cell"));
            }
        }
        row.into()
    }

    fn value(&self, cell: &str, column: &CsvColumn<'_>) -> Option<Value> {
        match column.field.kind {
            CellKind::Word => Some(cell.into()),
            CellKind::Truth => match cell.to_lowercase().as_str() {
                "true" | "1" | "yes" => Some(true.into()),
                "false" | "0" | "no" => Some(false.into()),
                _ => None,
            },
            CellKind::Number | CellKind::Integer => {
                let text = decimal(cell, self.decimal_comma)?;
                let same = column.unit == column.field.unit;
                json::number(if same {
                    text.parse().ok()?
                } else {
                    units::converted(&text, &column.unit, &column.field.unit)?
                })
            }
        }
    }
}

/// A plain decimal number as Rust and JSON write it: no words such as `inf`, no thousands separators.
fn decimal(cell: &str, decimal_comma: bool) -> Option<String> {
    let plain = |c: char| c.is_ascii_digit() || matches!(c, '+' | '-' | '.' | 'e' | 'E');
    let read = if decimal_comma && cell.contains(',') {
        if cell.contains('.') {
            return None;
        }
        cell.replace(',', ".")
    } else {
        cell.to_owned()
    };
    // The minus sign of typesetting, which spreadsheets export.
    let read = read.replace('\u{2212}', "-");
    if !read.chars().all(plain) {
        return None;
    }
    read.parse::<f64>().is_ok_and(f64::is_finite).then_some(read)
}

/// How many cells a line has, empty ones at its end left out.
fn used_cells(record: &csv::StringRecord) -> usize {
    (0..record.len()).rfind(|&index| !record[index].is_empty()).map_or(0, |last| last + 1)
}

fn shown(cell: &str) -> String {
    if cell.chars().count() > SHOWN_CHARS {
        cell.chars().take(SHOWN_CHARS).chain(['…']).collect()
    } else {
        cell.to_owned()
    }
}

/// A line number; far below 2^53.
#[allow(clippy::cast_precision_loss)]
fn whole(line: u64) -> f64 {
    line as f64
}
