//! Names of fields, and what they are set to, in the language of the reader. A message holds ways through the contract
//! (`Cut.feed_mm_per_rev`, see `registry::way`), not labels, so that it can be said again in another language.

use minijinja::Value;
use minijinja::value::ValueKind;

use super::glossary::Glossary;
use super::{Language, number, significant};

/// One way, or a list of parts: each a way, or `[way, value, unit]` of a field that is set, or `[way, item, number]`
/// of a field that each of several items has.
pub(super) fn named(value: &Value, joint: &str, within: bool, language: Language) -> Option<String> {
    let name = |way: &str| {
        let name = Glossary::of(language).way(way);
        if within { lowered(&name) } else { name }
    };
    if let Some(way) = value.as_str() {
        return Some(name(way));
    }
    let part = |part: Value| match part.kind() {
        ValueKind::Seq => {
            let fields: Vec<Value> = part.try_iter().ok()?.collect();
            let [way, set, unit] = fields.as_slice() else { return None };
            if unit.is_number() {
                let item = lowered(&Glossary::of(language).way(set.as_str()?));
                let number = number::spoken(&number::read(f64::try_from(unit.clone()).ok()?), language);
                return Some(format!("{}, {item} {number}", name(way.as_str()?)));
            }
            Some(setting(&name(way.as_str()?), set, unit.as_str()?, language))
        }
        _ => Some(name(part.as_str()?)),
    };
    let parts: Option<Vec<String>> = value.try_iter().ok()?.map(part).collect();
    Some(parts?.join(joint))
}

/// `feed = 0.2 mm/rev`
fn setting(name: &str, set: &Value, unit: &str, language: Language) -> String {
    let value = match f64::try_from(set.clone()) {
        Ok(number) if set.is_number() => number::spoken(&significant(number, 6), language),
        _ => Glossary::of(language).word(&set.to_string()),
    };
    format!("{name} = {}", amount(&value, unit, language))
}

/// A number that is written already with its unit, where it has one.
pub(super) fn amount(number: &str, unit: &str, language: Language) -> String {
    match Glossary::of(language).unit(unit) {
        unit if unit.is_empty() => number.to_owned(),
        unit => format!("{number} {unit}"),
    }
}

/// As inside a sentence: every part without its capital, but for abbreviations.
fn lowered(name: &str) -> String {
    name.split(" · ").map(super::glossary::within).collect::<Vec<_>>().join(" · ")
}
