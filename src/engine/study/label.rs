//! Names for people out of pointers.

use super::expand::{index, tokens};
use crate::units;

/// A short name for each pointer: its last word without the unit (`feed`), with the item it belongs to
/// (`segments 0 diameter`), and the whole way where two would be the same.
pub(super) fn labels<'p>(fields: &[(&'p str, Option<&'p str>)]) -> Vec<String> {
    let short: Vec<String> = fields.iter().map(|(pointer, unit)| short(pointer, *unit)).collect();
    fields
        .iter()
        .zip(&short)
        .map(|((pointer, unit), name)| {
            let alone = short.iter().filter(|other| *other == name).count() == 1;
            if alone { name.clone() } else { words(&way(pointer, *unit)) }
        })
        .collect()
}

/// The name of a column: the whole way with dots, without the unit (`cut.feed`).
pub(super) fn column(pointer: &str, unit: Option<&str>) -> String {
    way(pointer, unit).join(".")
}

fn short(pointer: &str, unit: Option<&str>) -> String {
    let way = way(pointer, unit);
    let from = match way.as_slice() {
        [.., _, item, _] if index(item).is_some() => way.len() - 3,
        [.., _, item] if index(item).is_some() => way.len() - 2,
        _ => way.len().saturating_sub(1),
    };
    words(&way[from..])
}

fn words(way: &[String]) -> String {
    way.join(" ").replace('_', " ")
}

/// The tokens, the last named one without the suffix of its unit.
fn way(pointer: &str, unit: Option<&str>) -> Vec<String> {
    let mut way = tokens(pointer).unwrap_or_default();
    let suffix = unit.map(units::suffix).unwrap_or_default();
    if !suffix.is_empty()
        && let Some(last) = way.iter_mut().rev().find(|token| index(token).is_none())
        && let Some(stem) = last.strip_suffix(suffix.as_str()).filter(|stem| !stem.is_empty())
    {
        *last = stem.to_owned();
    }
    way
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_are_short_where_they_are_clear() {
        let feed = ("/cut/feed_mm_per_rev", Some("mm/rev"));
        let diameter = ("/shaft/segments/0/diameter_mm", Some("mm"));
        let item = ("/deflections_um/3", Some("um"));
        assert_eq!(labels(&[feed, diameter, item]), ["feed", "segments 0 diameter", "deflections 3"]);
        let (a, b) = (("/a/stiffness", None), ("/b/stiffness", None));
        assert_eq!(labels(&[a, b]), ["a stiffness", "b stiffness"]);
        assert_eq!(column("/cut/feed_mm_per_rev", Some("mm/rev")), "cut.feed");
        assert_eq!(column("/deflections_um/3", Some("um")), "deflections.3");
    }
}
