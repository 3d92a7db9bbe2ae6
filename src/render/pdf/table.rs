//! Tables: as wide as their columns ask for, with their head again on every page.

use precut_calc::calculator::{Cells, Column};

use super::figures::{self, column_texts};
use super::layout::{Element, Kind, LEFT, Layout, Mark, WIDTH};
use super::style::{CELL, FAINT, GROUP, HEAD, Line, NOTE, RULE};
use crate::render::report::{Counted, Counts, Datum, Field, Sheet};

/// Rows of a longer table that are shown.
pub(super) const MOST_ROWS: usize = 30;
/// Letters of a cell that are shown.
const MOST_LETTERS: usize = 240;
/// Between columns, points.
const GAP: f32 = 9.0;
/// A column of words is no wider unless there is room, points.
const WORDS_WIDE: f32 = 170.0;
/// Above and below the lines of a row, points.
const PAD: f32 = 1.2;

/// A column as it is printed.
#[derive(Debug, Clone)]
pub(super) struct Printed {
    pub(super) head: String,
    pub(super) is_number: bool,
    pub(super) cells: Vec<String>,
}

/// A table of the answer: all rows, or some of a long one with the count said.
pub(super) fn sheet(layout: &mut Layout, sheet: &Sheet, decimal: char, counts: Counts<'_>) -> Vec<Element> {
    let rows = rows(sheet);
    let (chosen, note) = chosen(&sheet.table.columns, rows, counts);
    let columns: Vec<Printed> = sheet
        .table
        .columns
        .iter()
        .zip(&sheet.heads)
        .map(|(column, (name, unit))| {
            let head = if unit.is_empty() { name.clone() } else { format!("{name}, {unit}") };
            let (is_number, cells) = match &column.cells {
                Cells::Numbers(cells) => {
                    let picked: Vec<_> = chosen.iter().map(|row| cells.get(*row).copied().flatten()).collect();
                    (true, column_texts(&picked, decimal))
                }
                Cells::Words(cells) => {
                    let picked =
                        chosen.iter().map(|row| cells.get(*row).map(|word| shortened(word)).unwrap_or_default());
                    (false, picked.collect())
                }
            };
            Printed { head, is_number, cells }
        })
        .collect();
    layout.skip(6.0);
    let mut elements = vec![layout.heading(&sheet.title, GROUP, 3, 50.0)];
    if let Some(note) = note {
        elements.push(layout.paragraph(&note, NOTE, (LEFT, WIDTH)));
    }
    elements.extend(grid(layout, columns));
    elements
}

/// How many rows a table has: what the job did not ask for has none.
pub(super) fn rows(sheet: &Sheet) -> usize {
    sheet.table.columns.iter().map(length).max().unwrap_or(0)
}

fn length(column: &Column) -> usize {
    match &column.cells {
        Cells::Numbers(cells) => cells.len(),
        Cells::Words(cells) => cells.len(),
    }
}

/// The rows that are shown, and what is said of the others. A table that goes along something, whose first column always
/// rises or always falls, is shown from end to end; another one from its beginning.
fn chosen(columns: &[Column], rows: usize, counts: Counts<'_>) -> (Vec<usize>, Option<String>) {
    if rows <= MOST_ROWS {
        return ((0..rows).collect(), None);
    }
    if columns.first().is_some_and(goes_along) {
        let last = MOST_ROWS - 1;
        let even = (0..=last).map(|index| (index * (rows - 1) + last / 2) / last).collect();
        (even, Some(counts(Counted::EvenRows(MOST_ROWS, rows))))
    } else {
        ((0..MOST_ROWS).collect(), Some(counts(Counted::FirstRows(MOST_ROWS, rows))))
    }
}

fn goes_along(column: &Column) -> bool {
    let Cells::Numbers(cells) = &column.cells else { return false };
    let all = |in_order: fn(f64, f64) -> bool| {
        cells.windows(2).all(|pair| matches!(*pair, [Some(one), Some(next)] if in_order(one, next)))
    };
    all(|one, next| one < next) || all(|one, next| one > next)
}

/// As much of a text as a cell shows.
pub(super) fn shortened(text: &str) -> String {
    match text.char_indices().nth(MOST_LETTERS) {
        Some((end, _)) => format!("{} …", &text[..end]),
        None => text.to_owned(),
    }
}

/// Columns beside each other. Where they do not fit, further ones follow below, each time after the first.
pub(super) fn grid(layout: &mut Layout, columns: Vec<Printed>) -> Vec<Element> {
    let wide: Vec<f32> = columns.iter().map(wanted).collect();
    let mut columns = columns.into_iter().zip(wide);
    let Some(first) = columns.next() else { return Vec::new() };
    let mut elements = Vec::new();
    let mut block = vec![first.clone()];
    for column in columns {
        let taken: f32 = block.iter().map(|(_, width)| width + GAP).sum();
        if taken + column.1 > WIDTH && block.len() > 1 {
            elements.push(drawn(layout, std::mem::replace(&mut block, vec![first.clone()])));
        }
        block.push(column);
    }
    elements.push(drawn(layout, block));
    elements
}

/// How wide a column is: of numbers as its longest, of words not without bounds; a heading goes over several lines.
fn wanted(column: &Printed) -> f32 {
    let longest = |texts: &mut dyn Iterator<Item = &str>| texts.map(|text| CELL.width(text)).fold(0.0, f32::max);
    let cells = longest(&mut column.cells.iter().map(String::as_str));
    let word = column.head.split(' ').map(|word| HEAD.width(word)).fold(0.0, f32::max);
    let whole = HEAD.width(&column.head);
    let bounded = if column.is_number { cells } else { cells.min(WORDS_WIDE) };
    // A heading has at most some lines.
    bounded.max(word).max(whole / 3.0 + 6.0).min(WIDTH / 2.0)
}

/// One block of columns.
fn drawn(layout: &mut Layout, mut block: Vec<(Printed, f32)>) -> Element {
    widen(&mut block);
    let places: Vec<f32> = block
        .iter()
        .scan(LEFT, |x, (_, width)| {
            let place = *x;
            *x += width + GAP;
            Some(place)
        })
        .collect();
    let end = places.iter().zip(&block).map(|(x, (_, width))| x + width).fold(LEFT, f32::max);
    let heads: Vec<Vec<Line>> = block.iter().map(|(column, width)| HEAD.lines(&column.head, *width)).collect();
    let head_height = height(&heads);
    let rows = block.iter().map(|(column, _)| column.cells.len()).max().unwrap_or(0);
    layout.y += 3.0;
    layout.need(head_height + 3.0 * CELL.leading());
    let leaves: Vec<usize> =
        head_marks(layout.y, &heads, &block, &places).into_iter().map(|marks| layout.put(marks)).collect();
    let cells = leaves.into_iter().map(|leaf| Element::of_leaves(Kind::Head, vec![leaf])).collect();
    let mut lines = vec![Element::new(Kind::Row, cells)];
    rule(layout, head_height, end);
    for row in 0..rows {
        let texts: Vec<Vec<Line>> = block
            .iter()
            .map(|(column, width)| CELL.lines(column.cells.get(row).map_or("", String::as_str), *width))
            .collect();
        let height = height(&texts);
        if layout.need(height) {
            // The head again is for the eye alone.
            for marks in head_marks(layout.y, &heads, &block, &places) {
                layout.decorate(marks);
            }
            rule(layout, head_height, end);
        }
        let mut cells = Vec::with_capacity(block.len());
        for ((lines, x), (column, width)) in texts.into_iter().zip(&places).zip(&block) {
            let marks = cell_marks(lines, (*x, layout.y + PAD), *width, column.is_number);
            cells.push(Element::of_leaves(Kind::Cell, if marks.is_empty() { vec![] } else { vec![layout.put(marks)] }));
        }
        lines.push(Element::new(Kind::Row, cells));
        layout.y += height;
        layout.decorate(vec![Mark::Area { x: LEFT, y: layout.y - 0.2, width: end - LEFT, height: 0.4, color: FAINT }]);
    }
    layout.y += 6.0;
    Element::new(Kind::Table, lines)
}

/// Columns of words take what is left.
fn widen(block: &mut [(Printed, f32)]) {
    let taken: f32 = block.iter().map(|(_, width)| width + GAP).sum::<f32>() - GAP;
    let mut left = WIDTH - taken;
    for (column, width) in block.iter_mut().filter(|(column, _)| !column.is_number) {
        let natural = column.cells.iter().map(|cell| CELL.width(cell)).fold(HEAD.width(&column.head), f32::max) + 0.5;
        let more = (natural - *width).clamp(0.0, left.max(0.0));
        *width += more;
        left -= more;
    }
}

fn height(cells: &[Vec<Line>]) -> f32 {
    let lines = cells.iter().map(Vec::len).max().unwrap_or(1).max(1);
    lines as f32 * CELL.leading() + 2.0 * PAD
}

/// The lines of the heads, each on the ground of its row.
fn head_marks(top: f32, heads: &[Vec<Line>], block: &[(Printed, f32)], places: &[f32]) -> Vec<Vec<Mark>> {
    let most = heads.iter().map(Vec::len).max().unwrap_or(1);
    let places = heads.iter().zip(block).zip(places);
    places
        .map(|((lines, (column, width)), x)| {
            let down = (most - lines.len()) as f32 * HEAD.leading();
            cell_marks(lines.clone(), (*x, top + PAD + down), *width, column.is_number)
        })
        .collect()
}

fn cell_marks(lines: Vec<Line>, (x, top): (f32, f32), width: f32, is_right: bool) -> Vec<Mark> {
    let place = |(index, line): (usize, Line)| {
        let x = if is_right { x + width - line.width } else { x };
        Mark::Text { x, y: top + index as f32 * line.style.leading(), line }
    };
    lines.into_iter().enumerate().map(place).collect()
}

/// Under the head.
fn rule(layout: &mut Layout, height: f32, end: f32) {
    layout.y += height;
    layout.decorate(vec![Mark::Area { x: LEFT, y: layout.y - 0.4, width: end - LEFT, height: 0.8, color: RULE }]);
}

/// A list of alike things: what each has, in columns.
pub(super) fn of_items<'f>(layout: &mut Layout, items: &[(String, Vec<&'f Field>)], decimal: char) -> Vec<Element> {
    let mut names: Vec<(&str, &str, &str)> = Vec::new();
    for field in items.iter().flat_map(|(_, fields)| fields) {
        let name = field.way.last().map_or("", String::as_str);
        if !names.iter().any(|(known, ..)| *known == name) {
            names.push((name, &field.label, &field.unit));
        }
    }
    let mut columns = vec![Printed {
        head: String::new(),
        is_number: false,
        cells: items.iter().map(|(title, _)| title.clone()).collect(),
    }];
    for (name, label, unit) in names {
        let own = |fields: &[&'f Field]| {
            fields.iter().find(|field| field.way.last().is_some_and(|last| last == name)).copied()
        };
        let values: Vec<_> = items.iter().map(|(_, fields)| own(fields)).collect();
        let is_number = values.iter().flatten().all(|value| matches!(value.value, Datum::Number(_)));
        let cells = values.iter().map(|value| value.map(|value| figures::datum(value, decimal)).unwrap_or_default());
        let head = if unit.is_empty() { label.to_owned() } else { format!("{label}, {unit}") };
        columns.push(Printed { head, is_number, cells: cells.map(|cell| shortened(&cell)).collect() });
    }
    grid(layout, columns)
}
