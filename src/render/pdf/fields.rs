//! Single values of a job or a result: by groups, in two columns; lists of alike things as tables.

use super::face::GLUE;
use super::figures;
use super::layout::{Element, Kind, LEFT, Layout, Mark, WIDTH};
use super::style::{GROUP, LABEL, Line, NOTE, VALUE};
use super::table;
use crate::render::report::{Counted, Counts, Field};

/// Between the two columns, points.
const GUTTER: f32 = 18.0;
const COLUMN: f32 = (WIDTH - GUTTER) / 2.0;
/// Of a column for the name.
const NAME: f32 = COLUMN * 0.56;
/// Between a name and its value.
const GAP: f32 = 6.0;
/// Values that are shown.
const MOST_FIELDS: usize = 300;

/// Everything of these.
pub(super) fn all(layout: &mut Layout, all: &[Field], decimal: char, counts: Counts<'_>) -> Vec<Element> {
    let fields = &all[..all.len().min(MOST_FIELDS)];
    let lists = lists(fields);
    let mut elements = Vec::new();
    if fields.len() < all.len() {
        let note = counts(Counted::Fields(fields.len(), all.len()));
        elements.push(layout.paragraph(&note, NOTE, (LEFT, WIDTH)));
    }
    let mut rest = fields.iter().filter(|field| list_of(&lists, field).is_none()).collect::<Vec<_>>();
    // Groups as they come: those of one name may stand apart from each other.
    while let Some(first) = rest.first() {
        let group = first.group.clone();
        let (own, others): (Vec<_>, Vec<_>) = rest.into_iter().partition(|field| field.group == group);
        rest = others;
        elements.extend(self::group(layout, &group, &own, decimal));
    }
    for list in &lists {
        layout.skip(5.0);
        elements.extend(table::of_items(layout, &list.items, decimal));
    }
    elements
}

/// Alike things at one place.
struct List<'f> {
    place: &'f [String],
    items: Vec<(String, Vec<&'f Field>)>,
}

/// Lists of at least two items that have fields of their own.
fn lists(fields: &[Field]) -> Vec<List<'_>> {
    let mut lists: Vec<List<'_>> = Vec::new();
    for field in fields {
        let Some(place) = place_of(field) else { continue };
        let known = lists.iter().position(|list| list.place == place);
        let index = known.unwrap_or_else(|| {
            lists.push(List { place, items: Vec::new() });
            lists.len() - 1
        });
        let list = &mut lists[index];
        match list.items.last_mut() {
            Some((title, own)) if *title == field.group => own.push(field),
            _ => list.items.push((field.group.clone(), vec![field])),
        }
    }
    lists.retain(|list| list.items.len() > 1);
    lists
}

/// The list in whose item a field stands.
fn place_of(field: &Field) -> Option<&[String]> {
    let (_, around) = field.way.split_last()?;
    let (item, place) = around.split_last()?;
    item.bytes().all(|byte| byte.is_ascii_digit()).then_some(place)
}

fn list_of<'l, 'f>(lists: &'l [List<'f>], field: &Field) -> Option<&'l List<'f>> {
    let place = place_of(field)?;
    lists.iter().find(|list| list.place == place)
}

/// A name with its value, as it is set.
struct Entry {
    name: Vec<Line>,
    value: Vec<Line>,
}

impl Entry {
    fn of(field: &Field, decimal: char) -> Self {
        let value = table::shortened(&figures::datum(field, decimal));
        // An angle's sign stands at its number.
        let value = match field.unit.as_str() {
            "" => value,
            "°" => format!("{value}°"),
            unit => format!("{value}{GLUE}{unit}"),
        };
        Self { name: LABEL.lines(&field.label, NAME), value: VALUE.lines(&value, COLUMN - NAME - GAP) }
    }

    fn height(&self) -> f32 {
        self.name.len().max(self.value.len()).max(1) as f32 * VALUE.leading() + 1.0
    }
}

/// A group: its name, and its fields, half of them in each column.
fn group(layout: &mut Layout, title: &str, fields: &[&Field], decimal: char) -> Vec<Element> {
    let entries: Vec<Entry> = fields.iter().map(|field| Entry::of(field, decimal)).collect();
    let mut elements = Vec::new();
    if title.is_empty() {
        layout.y += 2.0;
    } else {
        layout.skip(5.0);
        elements.push(layout.heading(title, GROUP, 3, 24.0));
    }
    let half = entries.len().div_ceil(2);
    let mut lines = Vec::new();
    for row in 0..half {
        let pair = [entries.get(row), entries.get(row + half)];
        let height = pair.iter().flatten().map(|entry| entry.height()).fold(0.0, f32::max);
        layout.need(height);
        let mut cells = Vec::new();
        for (entry, x) in pair.into_iter().flatten().zip([LEFT, LEFT + COLUMN + GUTTER]) {
            for (lines, x, kind) in [(&entry.name, x, Kind::Head), (&entry.value, x + NAME + GAP, Kind::Cell)] {
                let leaf = layout.put(marks(lines, x, layout.y));
                cells.push(Element::of_leaves(kind, vec![leaf]));
            }
        }
        lines.push(Element::new(Kind::Row, cells));
        layout.y += height;
    }
    elements.push(Element::new(Kind::Table, lines));
    elements
}

fn marks(lines: &[Line], x: f32, y: f32) -> Vec<Mark> {
    let place =
        |(index, line): (usize, &Line)| Mark::Text { x, y: y + index as f32 * VALUE.leading(), line: line.clone() };
    lines.iter().enumerate().map(place).collect()
}
