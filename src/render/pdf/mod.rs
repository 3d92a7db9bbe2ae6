//! An answer as a report on paper: PDF 1.7 that may be archived (PDF/A-2a) and heard (tagged).
//!
//! Pages are laid out first and painted then, so that each knows how many there are. Texts are data all the way: nothing
//! in them is read as markup. The same report gives the same bytes. Its length is bounded: of long tables and long lists
//! some rows are shown, and how many there are is said; all of them are in the workbook and in CSV.

mod face;
mod fields;
mod figures;
mod layout;
mod paint;
mod style;
mod table;

use usvg::{Options, Tree};

use self::face::{FAMILY, database, printable};
use self::layout::{Element, Kind, LEFT, Layout, Mark, WIDTH};
use self::style::{
    ACCENT, ALARM, ALARM_TINT, BODY, FORMULA, KICKER, Line, NOTE, SUBJECT, Style, TINT, TITLE, VALUE, VERDICT,
};
use super::report::{Counts, Equation, Field, Report};

/// Why there is no report.
#[derive(Debug, thiserror::Error)]
pub enum PdfError {
    /// A picture that is no SVG.
    #[error("a picture cannot be read: {0}")]
    Picture(#[from] usvg::Error),
    /// The document breaks a rule of its standard.
    #[error("the document cannot be written: {0}")]
    Document(String),
}

/// The report as a PDF.
pub fn pdf(report: &Report, counts: Counts<'_>) -> Result<Vec<u8>, PdfError> {
    let mut layout = Layout::new();
    let mut parts = head(&mut layout, report);
    parts.extend(warnings(&mut layout, report));
    let mut pictures = Vec::with_capacity(report.pictures.len());
    for picture in &report.pictures {
        pictures.push((Tree::from_str(&printable(&picture.svg), &options(report.language))?, &picture.description));
    }
    let headings = &report.headings;
    let numbers = |layout: &mut Layout| values(layout, (&headings.results, &report.results), report.decimal, counts);
    // Numbers fill the page on which the main picture has no room.
    let is_full = pictures.first().is_some_and(|(tree, _)| Layout::picture_height(tree) + 10.0 > layout.room());
    if is_full {
        parts.extend(numbers(&mut layout));
    }
    for (tree, description) in pictures {
        layout.skip(10.0);
        parts.push(layout.picture(tree, description));
    }
    if !is_full {
        parts.extend(numbers(&mut layout));
    }
    parts.extend(values(&mut layout, (&headings.inputs, &report.inputs), report.decimal, counts));
    parts.extend(tables(&mut layout, report, counts));
    parts.extend(equations(&mut layout, report));
    parts.extend(origin(&mut layout, report));
    paint::painted(&layout, &parts, report, counts)
}

fn options(language: &str) -> Options<'static> {
    Options {
        font_family: FAMILY.to_owned(),
        fontdb: database(),
        languages: vec![language.to_owned()],
        ..Options::default()
    }
}

/// What was asked, and the answer.
fn head(layout: &mut Layout, report: &Report) -> Vec<Element> {
    let whole = (LEFT, WIDTH);
    let mut parts = vec![layout.paragraph(&report.title, KICKER, whole)];
    layout.y += 1.0;
    parts.push(layout.heading(&report.question, TITLE, 1, 40.0));
    layout.y += 2.0;
    parts.push(layout.paragraph(&marks_together(&report.subject), SUBJECT, whole));
    layout.y += 8.0;
    let mut remarks = report.remarks.iter();
    if let Some(verdict) = remarks.next() {
        parts.push(boxed(layout, verdict, VERDICT, (ACCENT, TINT)));
        layout.y += 4.0;
    }
    let items: Vec<Element> = remarks.map(|remark| item(layout, remark)).collect();
    if !items.is_empty() {
        parts.push(Element::new(Kind::List, items));
    }
    parts
}

/// The marks of a job, each on one line unless it is long.
fn marks_together(subject: &str) -> String {
    const BETWEEN: &str = " · ";
    const MOST_LETTERS: usize = 60;
    let glued =
        |mark: &str| if mark.chars().count() > MOST_LETTERS { mark.to_owned() } else { mark.replace(' ', "\u{a0}") };
    subject.split(BETWEEN).map(glued).collect::<Vec<_>>().join("\u{a0}· ")
}

/// What is to be seen at once: on a ground of its own.
fn boxed(layout: &mut Layout, text: &str, style: Style, (edge, ground): ((u8, u8, u8), (u8, u8, u8))) -> Element {
    const PAD: f32 = 7.0;
    let lines: Vec<Line> = style.lines(text, WIDTH - 2.0 * PAD - 3.0);
    let height = style.leading() * lines.len() as f32 + 2.0 * PAD;
    // What is longer than a page has no ground.
    if height <= Layout::page_room() {
        layout.need(height);
        let y = layout.y;
        layout.decorate(vec![
            Mark::Area { x: LEFT, y, width: WIDTH, height, color: ground },
            Mark::Area { x: LEFT, y, width: 3.0, height, color: edge },
        ]);
    }
    layout.y += PAD;
    let leaves = layout.lines(lines, LEFT + 3.0 + PAD);
    layout.y += PAD;
    Element::of_leaves(Kind::Paragraph, leaves)
}

/// An item of a list.
fn item(layout: &mut Layout, text: &str) -> Element {
    const INDENT: f32 = 10.0;
    layout.y += 2.0;
    layout.need(BODY.leading());
    let bullet = Mark::Text { x: LEFT, y: layout.y, line: BODY.line("•") };
    layout.decorate(vec![bullet]);
    let lines = BODY.lines(text, WIDTH - INDENT);
    let leaves = layout.lines(lines, LEFT + INDENT);
    Element::new(Kind::Item, vec![Element::of_leaves(Kind::ItemText, leaves)])
}

fn warnings(layout: &mut Layout, report: &Report) -> Vec<Element> {
    if report.warnings.is_empty() {
        return Vec::new();
    }
    let mut parts = vec![layout.section(&report.headings.warnings)];
    for warning in &report.warnings {
        parts.push(boxed(layout, warning, BODY, (ALARM, ALARM_TINT)));
        layout.y += 3.0;
    }
    parts
}

/// A section of single values.
fn values(layout: &mut Layout, (heading, own): (&str, &[Field]), decimal: char, counts: Counts<'_>) -> Vec<Element> {
    if own.is_empty() {
        return Vec::new();
    }
    let mut parts = vec![layout.section(heading)];
    parts.extend(fields::all(layout, own, decimal, counts));
    parts
}

fn tables(layout: &mut Layout, report: &Report, counts: Counts<'_>) -> Vec<Element> {
    let filled: Vec<_> = report.tables.iter().filter(|sheet| table::rows(sheet) > 0).collect();
    if filled.is_empty() {
        return Vec::new();
    }
    let mut parts = vec![layout.section(&report.headings.tables)];
    parts.extend(filled.into_iter().flat_map(|sheet| table::sheet(layout, sheet, report.decimal, counts)));
    parts
}

fn equations(layout: &mut Layout, report: &Report) -> Vec<Element> {
    let mut parts = Vec::new();
    if !report.equations.is_empty() {
        parts.push(layout.section(&report.headings.equations));
        for equation in &report.equations {
            parts.extend(self::equation(layout, equation));
        }
    }
    if !report.references.is_empty() {
        parts.push(layout.section(&report.headings.references));
        let items: Vec<Element> = report.references.iter().map(|reference| item(layout, reference)).collect();
        parts.push(Element::new(Kind::List, items));
    }
    parts
}

/// Number and source of an equation, and what it says.
fn equation(layout: &mut Layout, equation: &Equation) -> Vec<Element> {
    const INDENT: f32 = 12.0;
    layout.skip(4.0);
    let said = format!("{}  {}", equation.number, equation.source);
    let height = FORMULA.leading() * equation.formula.len() as f32;
    layout.need((VALUE.leading() * 2.0 + height).min(Layout::page_room() / 2.0));
    let mut parts = vec![layout.paragraph(&said, VALUE, (LEFT, WIDTH))];
    if !equation.formula.is_empty() {
        layout.y += 1.0;
        let lines: Vec<Line> = equation.formula.iter().flat_map(|line| fitting(line, WIDTH - INDENT)).collect();
        let leaves = layout.lines(lines, LEFT + INDENT);
        parts.push(Element::of_leaves(Kind::Formula(printable(&equation.formula.join(" "))), leaves));
    }
    parts
}

/// A line of a formula; a long one in somewhat smaller letters, a very long one broken between its terms.
fn fitting(text: &str, room: f32) -> Vec<Line> {
    const SMALLEST: f32 = 0.85;
    let line = FORMULA.line(text);
    let share = room / line.width.max(1.0);
    if share >= 1.0 {
        vec![line]
    } else if share >= SMALLEST {
        vec![Style { size: FORMULA.size * share, ..FORMULA }.line(text)]
    } else {
        FORMULA.lines(text, room)
    }
}

/// What made the answer, so that it can be asked again.
fn origin(layout: &mut Layout, report: &Report) -> Vec<Element> {
    let mut parts = vec![layout.section(&report.headings.origin)];
    for (name, value) in &report.origin {
        parts.push(layout.paragraph(&format!("{name}: {value}"), NOTE, (LEFT, WIDTH)));
    }
    parts
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::render::report::tests::{field, report, sheet};
    use crate::render::report::{Counted, Datum, Picture};
    use precut_calc::calculator::Column;
    use proptest::prelude::*;
    use std::borrow::Cow;

    fn counts(count: Counted) -> String {
        format!("{count:?}")
    }

    fn pages(pdf: &[u8]) -> usize {
        lopdf::Document::load_mem(pdf).unwrap().get_pages().len()
    }

    fn words(pdf: &[u8]) -> String {
        let document = lopdf::Document::load_mem(pdf).unwrap();
        let pages: Vec<u32> = document.get_pages().into_keys().collect();
        document.extract_text(&pages).unwrap().split_whitespace().collect::<Vec<_>>().join(" ")
    }

    #[test]
    fn equal_reports_give_equal_bytes() {
        let one = pdf(&report(Vec::new()), &counts).unwrap();
        assert_eq!(one, pdf(&report(Vec::new()), &counts).unwrap());
        let text = words(&one);
        for said in
            ["How far does it bend?", "It bends.", "it is a toy", "0.25 mm", "toy/1 none", "y = x²", "Page(1, 1)"]
        {
            assert!(text.contains(said), "{said} in {text}");
        }
    }

    #[test]
    fn whatever_comes_in_masses_takes_few_pages() {
        let numbers: Vec<f64> = (0..200_000).map(f64::from).collect();
        let columns = (0..12).map(|_| Column::numbers("a", "mm", &numbers)).collect();
        let names = vec![Cow::from("x".repeat(100_000)); 500];
        let many = |group: &str| {
            let name = |index: usize| format!("{group}{index}");
            (0..5000)
                .map(|index| field(&[&name(index)], &name(index / 7), Datum::Word("w ".repeat(index % 40))))
                .collect()
        };
        let whole = Report {
            inputs: many("i"),
            results: many("r"),
            ..report(vec![sheet(columns), sheet(vec![Column::words("names", names)])])
        };
        let made = pdf(&whole, &counts).unwrap();
        assert!(pages(&made) < 40, "{}", pages(&made));
        let text = words(&made);
        for said in ["EvenRows(30, 200000)", "FirstRows(30, 500)", "Fields(300, 5000)", "199999"] {
            assert!(text.contains(said), "{said}");
        }
    }

    #[test]
    fn pictures_are_text_and_lines_and_may_hold_any_letters() {
        let svg = "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"960\" height=\"3000\"><style>text{font-family:\
                   system-ui,sans-serif}</style><text x=\"9\" y=\"30\">零 Вал µ ≤ &lt;b&gt;</text></svg>";
        let picture = Picture { svg: svg.to_owned(), description: "零".to_owned() };
        let whole = Report { pictures: vec![picture], ..report(Vec::new()) };
        let text = words(&pdf(&whole, &counts).unwrap());
        // Its letters are placed one by one.
        assert!(text.replace(' ', "").contains("U+96F6Валµ≤<b>"), "{text}");
        let broken = Picture { svg: "no picture".to_owned(), description: String::new() };
        assert!(matches!(
            pdf(&Report { pictures: vec![broken], ..report(Vec::new()) }, &counts),
            Err(PdfError::Picture(_))
        ));
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(16))]
        /// Nothing that anyone may name a thing breaks the document or the rules of its standard.
        #[test]
        fn any_text_can_be_set(text in "\\PC{0,60}", other in any::<String>()) {
            let columns = vec![Column::words("b", vec![text.clone().into(), other.clone().into()])];
            let whole = Report {
                title: other.clone(),
                subject: text.clone(),
                remarks: vec![text.clone(), other.clone()],
                warnings: vec![other.clone()],
                inputs: vec![field(&[&text], &other, Datum::Word(text.clone()))],
                equations: vec![Equation { number: text.clone(), formula: vec![other.clone()], source: text.clone() }],
                ..report(vec![sheet(columns)])
            };
            let made = pdf(&whole, &counts).map_err(|error| TestCaseError::fail(error.to_string()))?;
            prop_assert!(made.starts_with(b"%PDF-1.7"));
        }
    }
}
