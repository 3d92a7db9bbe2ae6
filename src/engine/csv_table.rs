//! A measured table as CSV text into rows.

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

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::registry::toy;
    use crate::text::{Language, Texts};
    use proptest::prelude::*;
    use serde_json::json;

    fn place() -> TablePlace {
        toy::registry().entry("toy-bar").unwrap().tables_of(&Value::Null)[0].clone()
    }

    fn rows(text: &str) -> Value {
        let mut faults = Faults::default();
        let read = read(text, &place(), ("/measurements", &Room::default()), &mut faults);
        assert!(faults.listed.is_empty(), "{text}: {:?}", faults.listed);
        read.unwrap().rows.into()
    }

    fn codes(text: &str) -> Vec<&'static str> {
        let mut faults = Faults::default();
        assert!(read(text, &place(), ("/measurements", &Room::default()), &mut faults).is_none(), "{text}");
        for finding in &faults.listed {
            Texts::shared().try_finding(Language::En, "fault", finding).unwrap();
        }
        faults.listed.iter().map(|finding| finding.code).collect()
    }

    #[test]
    fn every_way_to_write_a_table_gives_the_same_rows() {
        let expected = json!([{"z_mm": 10, "deviation_um": -1.5}, {"z_mm": 20, "deviation_um": 0.012}]);
        for text in [
            "z_mm,deviation_um\n10,-1.5\n20,0.012\n",
            "z [mm];deviation [um]\r\n10;-1,5\r\n20;0,012\r\n",
            "\u{feff}z_mm\tdeviation_um\n\n10\t-1.5\n\n20\t1.2e-2\n\n",
            "Z [mm],Deviation [nm]\n10,-1500\n20,12\n",
            "z [cm];deviation [µm]\n1;-1.5\n2;,012\n",
            "\"z [m]\",\"deviation_mm\"\n\"0.01\",\"-0.0015\"\n0.02,0.000012\n",
            "z_mm;deviation_um;\n10;\u{2212}1,5;\n20;0,012;;\n",
            "deviation [um],z_mm,gauge\n-1.5,10,\n0.012,20,\n",
        ] {
            let read = rows(text);
            for (row, expected) in read.as_array().unwrap().iter().zip(expected.as_array().unwrap()) {
                for name in ["z_mm", "deviation_um"] {
                    let (a, b) = (row[name].as_f64().unwrap(), expected[name].as_f64().unwrap());
                    assert!(a.to_bits() == b.to_bits(), "{text}: {name} is {a:e}, not {b:e}");
                }
            }
            assert_eq!(read.as_array().unwrap().len(), 2, "{text}");
        }
    }

    #[test]
    fn numbers_in_another_unit_are_those_of_the_rows() {
        for (text, z, deviation) in [
            ("z [m],deviation [mm]\n0.0275,0.02757\n", "27.5", "27.57"),
            ("z [cm];deviation [nm]\n1,15;-27570,3\n", "11.5", "-27.5703"),
            ("z [in],deviation [uin]\n0.1,40\n", "2.54", "1.016"),
            ("z_ft,deviation_thou\n0.25,-1.1\n", "76.2", "-27.94"),
            ("z_m,deviation_mm\n1.1234567890123456,0.1234567890123456\n", "1123.4567890123456", "123.4567890123456"),
        ] {
            let read = rows(text);
            for (name, expected) in [("z_mm", z), ("deviation_um", deviation)] {
                let expected: f64 = expected.parse().unwrap();
                assert_eq!(read[0][name].as_f64().map(f64::to_bits), Some(expected.to_bits()), "{text}: {name}");
            }
        }
    }

    /// A field's name ends in its unit, so that the header may leave it to the bracket: `feed [mm/tooth]` as `feed [mm/rev]`.
    #[test]
    fn a_feed_per_tooth_has_its_own_unit() {
        let registry = crate::registry::Registry::standard().unwrap();
        let place = registry.entry("fixture-identification").unwrap().tables_of(&Value::Null)[0].clone();
        for header in ["feed [mm/tooth]", "feed [um/tooth]", "feed_mm_per_tooth", "feed_um_per_tooth"] {
            let column = column(header, &place).ok().unwrap();
            assert_eq!(column.field.name, "feed_mm_per_tooth", "{header}");
        }
        assert!(matches!(column("feed [mm/rev]", &place), Err(BadHeader::WrongUnit { .. })));
    }

    #[test]
    fn a_column_that_comes_twice_names_the_field() {
        let mut faults = Faults::default();
        read("z_mm,z [m]\n1,2", &place(), ("/measurements", &Room::default()), &mut faults);
        let said = Texts::shared().try_finding(Language::En, "fault", &faults.listed[0]).unwrap();
        assert_eq!(said, "line 1: the column z [m] fills z_mm, which another column fills already");
    }

    #[test]
    fn columns_without_a_field_go_where_the_row_takes_them() {
        let mut place = place();
        place.free =
            crate::registry::FreeColumns { numbers: Some("further".to_owned()), words: Some("factors".to_owned()) };
        let mut faults = Faults::default();
        let text = "z_mm;deviation_um;Nose radius [mm];coolant;humidity\n1;2;0,8;on;\n3;4;1,2;7;0,5\n";
        let read = read(text, &place, ("/measurements", &Room::default()), &mut faults).unwrap();
        assert!(faults.listed.is_empty(), "{:?}", faults.listed);
        assert_eq!(
            Value::Array(read.rows),
            json!([
                {"z_mm": 1, "deviation_um": 2, "further": {"nose_radius_mm": 0.8}, "factors": {"coolant": "on"}},
                {"z_mm": 3, "deviation_um": 4, "further": {"nose_radius_mm": 1.2, "humidity": 0.5}, "factors": {"coolant": "7"}}
            ])
        );
    }

    #[test]
    fn a_header_has_its_columns_and_so_many_more() {
        let mut place = place();
        place.free.numbers = Some("further".to_owned());
        let further = |count: usize| (0..count).map(|i| format!("a{i}")).collect::<Vec<_>>().join(",");
        let table = |count: usize| format!("z_mm,deviation_um,{}\n1,2{}\n", further(count), ",3".repeat(count));
        let most = place.columns.len() + MOST_FURTHER;
        let mut faults = Faults::default();
        let rows = read(&table(most - 2), &place, ("/measurements", &Room::default()), &mut faults).unwrap().rows;
        assert_eq!(rows[0]["further"].as_object().map(Map::len), Some(most - 2));
        // Of a longer header nothing is read but its length.
        for further in [most - 1, 100_000, 1_000_000] {
            let mut faults = Faults::default();
            assert!(read(&table(further), &place, ("/measurements", &Room::default()), &mut faults).is_none());
            let finding = &faults.listed[0];
            assert_eq!((finding.code, faults.total), ("too_many_columns", 1));
            let said = |language| Texts::shared().try_finding(language, "fault", finding).unwrap();
            let columns = further + 2;
            assert_eq!(
                said(Language::En),
                format!("the table measurements has {columns} columns, at most {most} are taken")
            );
            assert!(said(Language::Ru).contains("столб"), "{}", said(Language::Ru));
        }
    }

    #[test]
    fn words_and_counts_are_read() {
        assert_eq!(
            rows("z_mm;deviation_um;gauge;repeats\n1;2;\"A;B\";3\n"),
            json!([{"z_mm": 1, "deviation_um": 2, "gauge": "A;B", "repeats": 3}])
        );
    }

    #[test]
    fn a_table_says_what_is_wrong_with_it() {
        assert_eq!(codes(""), ["empty_table"]);
        assert_eq!(codes("z,deviation_um\n1,2"), ["missing_unit"]);
        assert_eq!(codes("z [N],deviation_um\n1,2"), ["wrong_unit"]);
        assert_eq!(codes("z [furlong],deviation_um\n1,2"), ["wrong_unit"]);
        assert_eq!(codes("z_mm,deviaton_um\n1,2"), ["unknown_column"]);
        assert_eq!(codes("z_mm,z [m]\n1,2"), ["duplicate_column"]);
        assert_eq!(codes("z_mm\n1"), ["missing_column"]);
        assert_eq!(codes("z_mm,deviation_um\n1,2,3"), ["ragged_row"]);
        assert_eq!(codes("z_mm,deviation_um\n1,"), ["empty_cell"]);
        assert_eq!(codes("z_mm,deviation_um\n1,nan\n1,inf\n1,1e999\n1,x"), ["bad_cell"; 4]);
        assert_eq!(codes("z_mm;deviation_um\n1;1.000,5"), ["bad_cell"]);
        assert_eq!(codes(&format!("z_mm,deviation_um\n{}", "1,2\n".repeat(2001))), ["too_many_rows"]);
    }

    #[test]
    fn a_bad_cell_is_named_by_line_and_column() {
        let mut faults = Faults::default();
        read("z_mm,deviation_um\n\n1,2\n3,four\n", &place(), ("/measurements", &Room::default()), &mut faults);
        let finding = &faults.listed[0];
        assert_eq!(finding.pointer, "/measurements/1/deviation_um");
        assert_eq!(finding.values.get("line"), Some(&4.0.into()));
        assert_eq!(finding.values.get("column"), Some(&"deviation_um".into()));
        assert_eq!(finding.values.get("received"), Some(&"four".into()));
    }

    proptest! {
        #[test]
        fn no_text_makes_it_panic(text in "[a-z_ \\[\\];,\t\r\n\"0-9.eE+-]{0,200}") {
            let mut faults = Faults::default();
            let read = read(&text, &place(), ("/measurements", &Room::default()), &mut faults);
            prop_assert_eq!(read.is_none(), faults.total > 0);
        }

        #[test]
        fn any_bytes_after_a_good_header_give_rows_or_faults(text in "\\PC{0,200}") {
            let mut faults = Faults::default();
            let read = read(&format!("z_mm,deviation_um\n{text}"), &place(), ("", &Room::default()), &mut faults);
            prop_assert_eq!(read.is_none(), faults.total > 0);
        }

        #[test]
        fn numbers_are_read_back_to_the_last_bit(z in 0.0..20000.0_f64, d in -1e6..1e6_f64) {
            let read = rows(&format!("z_mm;deviation_um\n{z};{}\n", format!("{d}").replace('.', ",")));
            prop_assert_eq!(read[0]["z_mm"].as_f64().unwrap().to_bits(), z.to_bits());
            prop_assert_eq!(read[0]["deviation_um"].as_f64().unwrap().to_bits(), d.to_bits());
        }
    }
}
