//! Tables as CSV.

use ::csv::{Terminator, WriterBuilder};
use precut_calc::calculator::{Cells, Column, Table};

use super::number;

/// A table as CSV: UTF-8 without a byte-order mark, a comma between cells, a line feed after every
/// line, one header line `name [unit]` (the bare name for words), decimal points. Numbers are the
/// shortest that read back bit for bit; where there is none, the cell is empty. A word that a spreadsheet would run as
/// a formula has an apostrophe in front, see `defused`.
#[allow(clippy::missing_panics_doc)] // writing to memory cannot fail
pub fn csv(table: &Table) -> String {
    let rows = table.columns.iter().map(length).max().unwrap_or(0);
    let lines = std::iter::once(table.columns.iter().map(header).collect::<Vec<_>>())
        .chain((0..rows).map(|row| table.columns.iter().map(|column| cell(column, row)).collect()));
    csv_lines(lines)
}

/// Lines of cells as CSV; all have as many cells as the first.
pub(crate) fn csv_lines(lines: impl IntoIterator<Item = Vec<String>>) -> String {
    let mut writer = WriterBuilder::new().terminator(Terminator::Any(b'\n')).from_writer(Vec::new());
    for line in lines {
        writer.write_record(line).expect("memory takes every record, and all have the width of the table");
    }
    let bytes = writer.into_inner().expect("memory can be flushed");
    String::from_utf8(bytes).expect("made of strings")
}

fn header(column: &Column) -> String {
    match column.unit {
        "" => defused(&column.name),
        unit => defused(&format!("{} [{unit}]", column.name)),
    }
}

fn length(column: &Column) -> usize {
    match &column.cells {
        Cells::Numbers(cells) => cells.len(),
        Cells::Words(cells) => cells.len(),
    }
}

fn cell(column: &Column, row: usize) -> String {
    match &column.cells {
        Cells::Numbers(cells) => cells.get(row).copied().flatten().and_then(number::shortest).unwrap_or_default(),
        Cells::Words(cells) => cells.get(row).map(|word| defused(word)).unwrap_or_default(),
    }
}

/// A word as a cell: one that begins with `=`, `+`, `-`, `@`, a tab or a carriage return, where a spreadsheet begins a
/// formula, gets an apostrophe in front, and so does one that begins with an apostrophe. To read it back, take one
/// apostrophe away where there is one. Numbers are numbers: they need none.
pub(crate) fn defused(word: &str) -> String {
    if begins_a_formula(word) || word.starts_with('\'') { format!("'{word}") } else { word.to_owned() }
}

/// Whether a spreadsheet would take a word that is typed in for a formula.
pub(super) fn begins_a_formula(word: &str) -> bool {
    word.starts_with(['=', '+', '-', '@', '\t', '\r'])
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::borrow::Cow;

    #[test]
    fn header_units_gaps_and_words() {
        let table = Table {
            id: "stations",
            columns: vec![
                Column::numbers("z", "mm", &[0.0, 0.1, 2000.0]),
                Column::optional("diameter_error", "um", &[Some(-12.5), None, Some(1e-9)]),
                Column::numbers("copying_factor", "1", &[1.0, f64::NAN, 3.0]),
                Column::words("status", vec!["ok".into(), "no, cut".into(), Cow::Owned("say \"no\"".to_owned())]),
            ],
        };
        assert_eq!(
            csv(&table),
            "z [mm],diameter_error [um],copying_factor [1],status\n\
             0,-12.5,1,ok\n\
             0.1,,,\"no, cut\"\n\
             2000,1e-9,3,\"say \"\"no\"\"\"\n"
        );
    }

    #[test]
    fn one_column_with_a_gap_keeps_its_line() {
        let table = Table { id: "one", columns: vec![Column::optional("a", "1", &[Some(1.0), None])] };
        let text = csv(&table);
        let mut reader = ::csv::Reader::from_reader(text.as_bytes());
        let rows: Vec<_> = reader.records().map(Result::unwrap).collect();
        assert_eq!(rows.len(), 2);
        assert_eq!(&rows[1][0], "");
    }

    #[test]
    fn a_table_without_rows_has_its_header() {
        let table = Table { id: "none", columns: vec![Column::numbers("a", "mm", &[])] };
        assert_eq!(csv(&table), "a [mm]\n");
    }

    proptest! {
        #[test]
        fn no_word_begins_a_formula_and_every_word_reads_back(words in proptest::collection::vec("[=+@\t\r'\\-a|!,\"\n]{0,6}", 1..20)) {
            let cells = words.iter().map(|word| Cow::Owned(word.clone())).collect();
            let numbers = vec![-1.0; words.len()];
            let table = Table { id: "t", columns: vec![Column::words("a", cells), Column::numbers("b", "1", &numbers)] };
            let text = csv(&table);
            let mut reader = ::csv::Reader::from_reader(text.as_bytes());
            for (row, word) in reader.records().map(Result::unwrap).zip(&words) {
                prop_assert!(!row[0].starts_with(['=', '+', '-', '@', '\t', '\r']), "{row:?}");
                prop_assert_eq!(row[0].strip_prefix('\'').unwrap_or(&row[0]), word);
                prop_assert_eq!(&row[1], "-1");
            }
        }

        #[test]
        fn every_number_reads_back(values in proptest::collection::vec(proptest::option::of(-1e300..1e300), 1..50)) {
            let table = Table { id: "t", columns: vec![Column::optional("a", "um/N", &values), Column::numbers("b", "1", &vec![1.0; values.len()])] };
            let text = csv(&table);
            let mut reader = ::csv::Reader::from_reader(text.as_bytes());
            let read: Vec<Option<f64>> =
                reader.records().map(|row| row.unwrap()[0].parse::<f64>().ok()).collect();
            prop_assert_eq!(read, values);
        }
    }
}
