//! Names for people out of pointers.

use serde_json::Value;

use super::expand::{index, tokens};
use crate::registry::{Entry, way};
use crate::units;

/// Which side of a calculator's contract a pointer leads into.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Side {
    Job,
    Result,
}

/// The way of each pointer through the contract, to be called by its labels in any language: short where that is clear
/// (the field, with the item it belongs to), the whole way where two fields have the same name. Without an entry the
/// names are those of the pointers.
pub(super) fn ways(entry: Option<&Entry>, side: Side, pointers: &[&str]) -> Vec<String> {
    let document = match (entry, side) {
        (Some(entry), Side::Job) => entry.input_document(),
        (Some(entry), Side::Result) => entry.output_document(),
        (None, _) => Value::Null,
    };
    let root = entry.map_or("", |entry| entry.meta().id);
    let all: Vec<Vec<String>> =
        pointers.iter().map(|pointer| way(&document, root, &tokens(pointer).unwrap_or_default()).steps).collect();
    let short: Vec<&[String]> = all.iter().map(|steps| &steps[owner(steps)..]).collect();
    let bare = |steps: &[String]| -> Vec<String> {
        steps.iter().map(|step| step.rsplit('.').next().unwrap_or_default().to_owned()).collect()
    };
    let is_alone = |steps: &[String]| short.iter().filter(|other| bare(other) == bare(steps)).count() == 1;
    short.iter().zip(&all).map(|(short, all)| if is_alone(short) { short } else { all.as_slice() }.join("/")).collect()
}

/// Where the short name begins: at the list whose item it is or stands in, else at the field.
fn owner(steps: &[String]) -> usize {
    match steps {
        [.., _, item, _] if index(item).is_some() => steps.len() - 3,
        [.., _, item] if index(item).is_some() => steps.len() - 2,
        _ => steps.len().saturating_sub(1),
    }
}

/// The name of a column: the whole way with dots, without the unit (`cut.feed`).
pub(super) fn column(pointer: &str, unit: Option<&str>) -> String {
    bare(pointer, unit).join(".")
}

/// The tokens, the last named one without the suffix of its unit.
fn bare(pointer: &str, unit: Option<&str>) -> Vec<String> {
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
        let registry = crate::registry::toy::registry();
        let entry = registry.entry("toy-bar").map(|entry| &**entry);
        let of = |pointers: &[&str]| ways(entry, Side::Job, pointers).join(" ");
        assert_eq!(of(&["/length_mm"]), "toy-bar.length_mm");
        assert_eq!(of(&["/segments/0/diameter_mm"]), "toy-bar.segments/1/ToySegment.diameter_mm");
        // Two of one name are told apart by the whole way.
        let two = ways(None, Side::Job, &["/a/stiffness", "/b/stiffness"]);
        assert_eq!(two, [".a/.stiffness", ".b/.stiffness"]);
        assert_eq!(ways(None, Side::Result, &["/a/stiffness"]), [".stiffness"]);
        assert_eq!(column("/cut/feed_mm_per_rev", Some("mm/rev")), "cut.feed");
        assert_eq!(column("/cut/spindle_speed_rpm", Some("rev/min")), "cut.spindle_speed");
        assert_eq!(column("/deflections_um/3", Some("um")), "deflections.3");
    }
}
