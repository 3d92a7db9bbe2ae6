//! An answer as a workbook: the answer in words, its inputs, and every table on a sheet of its own.
//!
//! Numbers are numbers at full precision, units stand in the heads, and words are words: a spreadsheet runs none of them,
//! whatever they begin with. The same answer gives the same bytes.

use precut_calc::calculator::Cells;
use rust_xlsxwriter::{
    DocProperties, ExcelDateTime, Format, FormatAlign, FormatBorder, Workbook, Worksheet, XlsxError,
};

use super::report::{Datum, Field, Report, Sheet};

/// Numbers and words of all tables together: a workbook is made in memory, of about 150 bytes for each.
pub const MOST_CELLS: usize = 2_000_000;
/// Lines of a sheet, the head among them.
const MOST_LINES: usize = 1 << 20;
/// Letters of a cell.
const MOST_LETTERS: usize = 32_000;
/// Letters of a sheet's name.
const NAME_LETTERS: usize = 31;
/// Lines by which the width of a column is found.
const MEASURED_LINES: usize = 200;
/// Letters of the narrowest and the widest column.
const WIDTHS: (usize, usize) = (8, 60);
/// Letters on a line of a sheet of words.
const PAGE_LETTERS: f64 = 130.0;

/// Why there is no workbook.
#[derive(Debug, thiserror::Error)]
pub enum XlsxFault {
    /// Too many cells, or more rows than a sheet has.
    #[error("{0} cells")]
    TooLarge(usize),
    /// Our own fault.
    #[error("the workbook cannot be written: {0}")]
    Unwritten(#[from] XlsxError),
}

/// The workbook as a file.
pub fn xlsx(report: &Report) -> Result<Vec<u8>, XlsxFault> {
    let lines = |sheet: &Sheet| sheet.table.columns.iter().map(|column| length(&column.cells)).max().unwrap_or(0);
    let cells = report.tables.iter().map(|sheet| lines(sheet) * sheet.table.columns.len()).sum();
    if cells > MOST_CELLS || report.tables.iter().any(|sheet| lines(sheet) >= MOST_LINES) {
        return Err(XlsxFault::TooLarge(cells));
    }
    let mut book = Book { workbook: Workbook::new(), looks: Looks::new(), names: Vec::new() };
    book.workbook.set_properties(&properties(report)?);
    book.answer(report)?;
    book.fields(&report.headings.inputs, &report.inputs, report)?;
    for sheet in &report.tables {
        book.table(sheet, &report.signature)?;
    }
    Ok(book.workbook.save_to_buffer()?)
}

/// The same answer gives the same bytes: the file has no date of its own, and the format asks for one.
fn properties(report: &Report) -> Result<DocProperties, XlsxError> {
    let date = ExcelDateTime::from_ymd(2000, 1, 1)?;
    let (title, subject) = (cell_text(&report.title), cell_text(&report.subject));
    let properties = DocProperties::new().set_title(title).set_subject(subject).set_comment(&report.signature);
    Ok(properties.set_author("precut").set_creation_datetime(&date))
}

fn length(cells: &Cells) -> usize {
    match cells {
        Cells::Numbers(cells) => cells.len(),
        Cells::Words(cells) => cells.len(),
    }
}

/// How cells look.
struct Looks {
    head: Format,
    title: Format,
    verdict: Format,
    section: Format,
    words: Format,
    /// Of a word that would be a formula if it were typed: it stays a word when the cell is edited.
    quoted: Format,
    quiet: Format,
}

impl Looks {
    fn new() -> Self {
        let wrapped = || Format::new().set_text_wrap().set_align(FormatAlign::Top);
        Self {
            head: wrapped().set_bold().set_border_bottom(FormatBorder::Thin),
            title: Format::new().set_bold().set_font_size(14),
            verdict: wrapped().set_bold().set_font_size(12),
            section: Format::new().set_bold().set_font_color(0x00_5A8F),
            words: wrapped(),
            quoted: Format::new().set_quote_prefix(),
            quiet: Format::new().set_font_color(0x5C_6470),
        }
    }
}

/// A workbook under way.
struct Book {
    workbook: Workbook,
    looks: Looks,
    /// Of its sheets, in lower case.
    names: Vec<String>,
}

impl Book {
    fn sheet(&mut self, wanted: &str, signature: &str) -> Result<&mut Worksheet, XlsxError> {
        let name = sheet_name(wanted, &self.names);
        self.names.push(name.to_lowercase());
        let sheet = self.workbook.add_worksheet();
        sheet.set_name(name)?.set_paper_size(9).set_print_fit_to_pages(1, 0);
        sheet.set_footer(format!("&L&8{signature}&R&8&P / &N"));
        Ok(sheet)
    }

    /// What was asked, the answer in words, its single numbers, its sources.
    fn answer(&mut self, report: &Report) -> Result<(), XlsxError> {
        let looks = Looks::new();
        let headings = &report.headings;
        let sheet = self.sheet(&headings.answer, &report.signature)?;
        let mut page = Page { sheet, line: 0 };
        page.words(&report.title, &looks.title)?;
        page.wrapped(&report.question, &looks.words)?;
        page.words(&report.subject, &looks.quiet)?;
        page.line += 1;
        for (index, remark) in report.remarks.iter().enumerate() {
            page.wrapped(remark, if index == 0 { &looks.verdict } else { &looks.words })?;
        }
        page.section(&headings.warnings, &report.warnings, &looks)?;
        if !report.results.is_empty() {
            page.line += 1;
            page.words(&headings.results, &looks.section)?;
            let line = page.line;
            page.line = fields(page.sheet, &report.results, line, &headings.columns, &looks)?;
        }
        let said = report.equations.iter().map(|equation| {
            let formula = equation.formula.iter().map(|line| line.trim()).collect::<Vec<_>>().join("\n");
            let said = format!("{}  {}", equation.number, equation.source);
            if formula.is_empty() { said } else { format!("{said}\n{formula}") }
        });
        page.section(&headings.equations, &said.collect::<Vec<_>>(), &looks)?;
        page.section(&headings.references, &report.references, &looks)?;
        let made = report.origin.iter().map(|(name, value)| format!("{name}: {value}"));
        page.section(&headings.origin, &made.collect::<Vec<_>>(), &looks)?;
        Ok(())
    }

    /// A sheet of single values.
    fn fields(&mut self, name: &str, own: &[Field], report: &Report) -> Result<(), XlsxError> {
        let looks = Looks::new();
        let sheet = self.sheet(name, &report.signature)?;
        fields(sheet, own, 0, &report.headings.columns, &looks)?;
        sheet.set_freeze_panes(1, 0)?.set_repeat_rows(0, 0)?;
        Ok(())
    }

    /// A table: one line of heads, then its rows.
    fn table(&mut self, table: &Sheet, signature: &str) -> Result<(), XlsxError> {
        let quoted = self.looks.quoted.clone();
        let head = self.looks.head.clone();
        let sheet = self.sheet(&table.title, signature)?;
        for (place, (column, (name, unit))) in (0_u16..).zip(table.table.columns.iter().zip(&table.heads)) {
            let name = if unit.is_empty() { name.clone() } else { format!("{name} [{unit}]") };
            let mut letters = name.chars().count().div_ceil(2);
            write_word(sheet, (0, place), &name, &head, &head)?;
            match &column.cells {
                Cells::Numbers(cells) => {
                    for (line, cell) in (1_u32..).zip(cells) {
                        if let Some(number) = cell.filter(|number| number.is_finite()) {
                            sheet.write_number(line, place, number)?;
                        }
                    }
                    letters = letters.max(12);
                }
                Cells::Words(cells) => {
                    for (line, word) in (1_u32..).zip(cells) {
                        write_word(sheet, (line, place), word, &Format::new(), &quoted)?;
                    }
                    letters = widest(cells.iter().map(|word| word.chars().count())).max(letters);
                }
            }
            sheet.set_column_width(place, as_width(letters))?;
        }
        sheet.set_freeze_panes(1, 0)?.set_repeat_rows(0, 0)?;
        if table.table.columns.len() > 5 {
            sheet.set_landscape();
        }
        Ok(())
    }
}

fn widest(letters: impl Iterator<Item = usize>) -> usize {
    letters.take(MEASURED_LINES).max().unwrap_or(0)
}

fn as_width(letters: usize) -> f64 {
    (letters.clamp(WIDTHS.0, WIDTHS.1) + 2) as f64
}

/// A sheet that is written from top to bottom.
struct Page<'s> {
    sheet: &'s mut Worksheet,
    line: u32,
}

impl Page<'_> {
    fn words(&mut self, text: &str, look: &Format) -> Result<(), XlsxError> {
        self.sheet.write_string_with_format(self.line, 0, cell_text(text), look)?;
        self.line += 1;
        Ok(())
    }

    /// Over all columns, as high as it takes.
    fn wrapped(&mut self, text: &str, look: &Format) -> Result<(), XlsxError> {
        const LINE: f64 = 15.5;
        let text = cell_text(text);
        let lines: f64 = text.lines().map(|line| (line.chars().count() as f64 / PAGE_LETTERS).ceil().max(1.0)).sum();
        self.sheet.merge_range(self.line, 0, self.line, 4, &text, look)?;
        self.sheet.set_row_height(self.line, LINE * lines.min(26.0))?;
        self.line += 1;
        Ok(())
    }

    fn section(&mut self, title: &str, texts: &[String], looks: &Looks) -> Result<(), XlsxError> {
        if texts.is_empty() {
            return Ok(());
        }
        self.line += 1;
        self.words(title, &looks.section)?;
        texts.iter().try_for_each(|text| self.wrapped(text, &looks.words))
    }
}

/// Single values under each other from a line on; the line after them.
fn fields(
    sheet: &mut Worksheet,
    fields: &[Field],
    first: u32,
    heads: &[String; 5],
    looks: &Looks,
) -> Result<u32, XlsxError> {
    for (place, (head, width)) in (0_u16..).zip(heads.iter().zip([32.0, 36.0, 18.0, 12.0, 46.0])) {
        sheet.write_string_with_format(first, place, head, &looks.head)?;
        sheet.set_column_width(place, width)?;
    }
    let mut line = first + 1;
    for field in fields {
        for (place, word) in [(0, &field.group), (1, &field.label), (3, &field.unit)] {
            write_word(sheet, (line, place), word, &Format::new(), &looks.quoted)?;
        }
        match &field.value {
            Datum::Number(number) if number.is_finite() => drop(sheet.write_number(line, 2, *number)?),
            Datum::Number(_) => {}
            Datum::Word(word) => write_word(sheet, (line, 2), word, &Format::new(), &looks.quoted)?,
        }
        sheet.write_string_with_format(line, 4, cell_text(&field.pointer()), &looks.quiet)?;
        line += 1;
    }
    Ok(line)
}

/// A word; `quoted` is how one looks that begins like a formula.
fn write_word(
    sheet: &mut Worksheet,
    (line, place): (u32, u16),
    word: &str,
    look: &Format,
    quoted: &Format,
) -> Result<(), XlsxError> {
    if !word.is_empty() {
        let look = if super::csv::begins_a_formula(word) { quoted } else { look };
        sheet.write_string_with_format(line, place, cell_text(word), look)?;
    }
    Ok(())
}

/// As much of a text as a cell takes.
fn cell_text(text: &str) -> String {
    match text.char_indices().nth(MOST_LETTERS) {
        Some((end, _)) => format!("{} …", &text[..end]),
        None => text.to_owned(),
    }
}

/// A name that a sheet may have and no other one has.
fn sheet_name(wanted: &str, taken: &[String]) -> String {
    let fits = |c: char| !c.is_control() && !"[]:*?/\\'".contains(c);
    let plain: String = wanted.chars().map(|c| if fits(c) { c } else { ' ' }).collect();
    let cut = |room: usize| plain.trim().chars().take(room).collect::<String>().trim_end().to_owned();
    let mut name = cut(NAME_LETTERS);
    let mut number = 2;
    while name.is_empty() || taken.contains(&name.to_lowercase()) {
        name = cut(NAME_LETTERS - 5);
        name.push_str(if name.is_empty() { "" } else { " " });
        name.push_str(&number.to_string());
        number += 1;
    }
    name
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::render::report::tests::{report, sheet};
    use calamine::{Data, Reader, Xlsx};
    use precut_calc::calculator::Column;
    use std::borrow::Cow;
    use std::io::Cursor;

    #[test]
    fn what_is_too_large_is_refused_before_it_is_made() {
        let numbers = vec![1.0; MOST_CELLS / 4 + 1];
        let columns = ["a", "b", "c", "d"].map(|name| Column::numbers(name, "mm", &numbers));
        let fault = xlsx(&report(vec![sheet(columns.into())])).unwrap_err();
        assert!(matches!(fault, XlsxFault::TooLarge(2_000_004)), "{fault}");
        let long = Column::numbers("a", "mm", &vec![1.0; MOST_LINES]);
        assert!(matches!(xlsx(&report(vec![sheet(vec![long])])), Err(XlsxFault::TooLarge(_))));
    }

    #[test]
    fn numbers_read_back_bit_for_bit_and_words_as_they_are() {
        let numbers = [0.1 + 0.2, -1e-300, 1.797e308, 5e-324, 1e15 + 0.3, -0.0, f64::NAN];
        let words = ["=1+1", "'x", "", "a\u{1}b\n\tc", "_x0041_", "1e5"];
        let mut words: Vec<Cow<'static, str>> = words.map(Cow::from).into();
        words.push("y".repeat(40_000).into());
        let columns = vec![Column::numbers("a", "mm", &numbers), Column::words("b", words.clone())];
        let bytes = xlsx(&report(vec![sheet(columns)])).unwrap();
        let mut book: Xlsx<_> = Xlsx::new(Cursor::new(bytes)).unwrap();
        let range = book.worksheet_range_at(2).unwrap().unwrap();
        for (row, (number, word)) in numbers.iter().zip(&words).enumerate() {
            let cell = range.get((row + 1, 0)).cloned().unwrap_or_default();
            if number.is_finite() {
                assert_eq!(cell, Data::Float(*number));
            } else {
                assert_eq!(cell, Data::Empty);
            }
            let cell = range.get((row + 1, 1)).cloned().unwrap_or_default();
            match word.as_ref() {
                "" => assert_eq!(cell, Data::Empty),
                word if word.len() > MOST_LETTERS => assert!(cell.to_string().ends_with('…')),
                word => assert_eq!(cell, Data::String(word.to_owned())),
            }
        }
    }

    #[test]
    fn names_of_sheets_are_allowed_and_differ() {
        let mut taken = Vec::new();
        for (wanted, name) in [
            ("Stations", "Stations"),
            ("stations", "stations 2"),
            ("a/b: [c]?", "a b   c"),
            ("", "2"),
            ("'", "3"),
            (&"x".repeat(40), &"x".repeat(31)),
            (&"x".repeat(50), &format!("{} 2", "x".repeat(26))),
        ] {
            let own = sheet_name(wanted, &taken);
            assert_eq!(own, name);
            taken.push(own.to_lowercase());
        }
    }
}
