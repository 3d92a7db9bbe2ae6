//! What templates may do with their values, each in the language of the template.

use std::collections::BTreeMap;

use minijinja::value::ValueKind;
use minijinja::{Environment, Error, State, UndefinedBehavior, Value};

use super::glossary::Glossary;
use super::named::{amount, named};
use super::number;
use super::{Language, significant};

/// A probability beyond this is told as that.
const MOST_CERTAIN: f64 = 0.99;

/// An environment that knows the filters of the texts and no text yet.
pub(super) fn environment() -> Environment<'static> {
    let mut environment = Environment::new();
    environment.set_undefined_behavior(UndefinedBehavior::Strict);
    environment.set_auto_escape_callback(|_| minijinja::AutoEscape::None);
    environment.set_formatter(|out, state, value| match as_number(value) {
        Some(number) => Ok(out.write_str(&number::spoken(&significant(number, 6), language_of(state)))?),
        None => minijinja::escape_formatter(out, state, value),
    });
    environment.add_filter("sig", |state: &State<'_, '_>, x: f64, digits: usize| {
        number::spoken(&significant(x, digits), language_of(state))
    });
    environment.add_filter("fixed", |state: &State<'_, '_>, x: f64, decimals: usize| {
        number::spoken(&number::fixed(x, decimals), language_of(state))
    });
    environment.add_filter("percent", |state: &State<'_, '_>, share: f64| {
        format!("{} %", number::spoken(&significant(100.0 * share, 3), language_of(state)))
    });
    environment.add_filter("chance", |state: &State<'_, '_>, probability: f64| {
        // No finite data make anything certain.
        let (sign, shown) = match probability {
            high if high > MOST_CERTAIN => ("> ", MOST_CERTAIN),
            low if low < 1.0 - MOST_CERTAIN => ("< ", 1.0 - MOST_CERTAIN),
            between => ("", between),
        };
        format!("{sign}{}", number::spoken(&significant(shown, 2), language_of(state)))
    });
    environment.add_filter("um", |state: &State<'_, '_>, value: f64| measured(state, value, 3, "um"));
    environment.add_filter("mm", |state: &State<'_, '_>, value: f64| measured(state, value, 6, "mm"));
    environment.add_filter("unit", |state: &State<'_, '_>, unit: &str| Glossary::of(language_of(state)).unit(unit));
    environment.add_filter("word", |state: &State<'_, '_>, word: &str| Glossary::of(language_of(state)).word(word));
    environment.add_filter("words", words);
    environment.add_filter("field", |state: &State<'_, '_>, name: &str| {
        let said: Vec<String> =
            name.split(", ").map(|name| Glossary::of(language_of(state)).name_within(name)).collect();
        said.join(", ")
    });
    environment.add_filter("labelled", labelled);
    environment.add_filter("limits", limits);
    environment.add_filter("names", |state: &State<'_, '_>, ways: Value| names(state, &ways, false));
    environment.add_filter("names_within", |state: &State<'_, '_>, ways: Value| names(state, &ways, true));
    environment.add_filter("amount", |state: &State<'_, '_>, x: f64, digits: usize, unit: &str| {
        let language = language_of(state);
        amount(&number::spoken(&significant(x, digits), language), unit, language)
    });
    environment.add_filter("reason", |state: &State<'_, '_>, text: &str| Glossary::of(language_of(state)).reason(text));
    environment.add_filter("list", list);
    environment.add_filter("warning", warning);
    environment.add_filter("plural", plural);
    environment
}

/// Templates are called `{language}/{section}.{code}`.
fn language_of(state: &State<'_, '_>) -> Language {
    Language::ALL.into_iter().find(|language| language.owns(state.name())).unwrap_or_default()
}

/// The sentence of another warning: its numbers and names as `[name, value]`, its code, and the field it is about.
#[allow(clippy::needless_pass_by_value)]
fn warning(state: &State<'_, '_>, said: Value, code: &str, pointer: &str) -> Result<String, Error> {
    let mut context: BTreeMap<String, Value> = BTreeMap::new();
    for pair in said.try_iter()? {
        context.insert(pair.get_item_by_index(0)?.to_string(), pair.get_item_by_index(1)?);
    }
    context.insert("pointer".to_owned(), pointer.into());
    context.insert("field".to_owned(), super::field(pointer).into());
    let name = super::name(language_of(state), "warning", code);
    state.env().get_template(&name)?.render(context)
}

/// Limits by name and place (`deflection@z5`): one, or several with commas between them.
#[allow(clippy::needless_pass_by_value)]
fn limits(state: &State<'_, '_>, limits: Value) -> Result<String, Error> {
    let glossary = Glossary::of(language_of(state));
    let said = |limit: &str| match limit.split_once('@') {
        Some((name, place)) => format!("{} ({})", glossary.name_within(name), glossary.word(place)),
        None => glossary.name_within(limit),
    };
    if let Some(limit) = limits.as_str() {
        return Ok(said(limit));
    }
    let all: Vec<String> = limits.try_iter()?.map(|limit| said(&limit.to_string())).collect();
    Ok(all.join(", "))
}

/// Names of fields by their ways through the contract, with commas between them; with semicolons where commas stand in
/// the numbers.
fn names(state: &State<'_, '_>, ways: &Value, within: bool) -> Result<String, Error> {
    let language = language_of(state);
    let joint = if language.decimal() == ',' { "; " } else { ", " };
    named(ways, joint, within, language)
        .ok_or_else(|| Error::new(minijinja::ErrorKind::InvalidOperation, "names are asked for of what are no ways"))
}

fn as_number(value: &Value) -> Option<f64> {
    value.is_number().then(|| f64::try_from(value.clone()).ok()).flatten()
}

fn measured(state: &State<'_, '_>, value: f64, digits: usize, unit: &str) -> String {
    let language = language_of(state);
    format!("{} {}", number::spoken(&significant(value, digits), language), Glossary::of(language).unit(unit))
}

/// Items with commas between them; with semicolons where commas stand in the numbers.
#[allow(clippy::needless_pass_by_value)] // the form of a filter
fn list(state: &State<'_, '_>, items: Vec<Value>) -> String {
    let language = language_of(state);
    let said: Vec<String> = items
        .iter()
        .map(|item| match as_number(item) {
            Some(number) => number::spoken(&significant(number, 6), language),
            None => item.to_string(),
        })
        .collect();
    let ambiguous = items.iter().zip(&said).any(|(item, said)| item.is_number() && said.contains(','));
    said.join(if ambiguous { "; " } else { ", " })
}

/// Words of the contract in the language of the sentence: one, or several with commas between them; a list in the list
/// is a set, its words with a plus between them and semicolons between the sets.
#[allow(clippy::needless_pass_by_value)]
fn words(state: &State<'_, '_>, words: Value) -> Result<String, Error> {
    let glossary = Glossary::of(language_of(state));
    if let Some(word) = words.as_str() {
        return Ok(glossary.word(word));
    }
    let mut said = Vec::new();
    let mut has_sets = false;
    for word in words.try_iter()? {
        has_sets |= word.kind() == ValueKind::Seq;
        said.push(match word.kind() {
            ValueKind::Seq => {
                let own: Vec<String> = word.try_iter()?.map(|word| glossary.word(&word.to_string())).collect();
                own.join(" + ")
            }
            _ => glossary.word(&word.to_string()),
        });
    }
    Ok(said.join(if has_sets { "; " } else { ", " }))
}

/// Words of the contract, each with its own label in brackets where it has one.
#[allow(clippy::needless_pass_by_value)]
fn labelled(state: &State<'_, '_>, words: Value, labels: Value) -> Result<String, Error> {
    let glossary = Glossary::of(language_of(state));
    let labels = labels.try_iter()?.map(|label| label.to_string());
    let said: Vec<String> = words
        .try_iter()?
        .zip(labels)
        .map(|(word, label)| match (glossary.word(&word.to_string()), label.as_str()) {
            (word, "") => word,
            (word, label) => format!("{word} ({label})"),
        })
        .collect();
    Ok(said.join(", "))
}

/// The form of a noun that a count asks for: two in English (1, all others), three in Russian (1 and 21; 2 to 4 and
/// fractions; 0, 5 to 20 and so on).
#[allow(clippy::needless_pass_by_value)]
fn plural(state: &State<'_, '_>, count: f64, one: String, few: String, many: Option<String>) -> String {
    // What counts is the number as it is read, with six digits.
    let said = significant(count.abs(), 6);
    let is_whole = said.bytes().all(|byte| byte.is_ascii_digit());
    match (language_of(state), many) {
        (Language::Ru, Some(many)) => {
            let last_two: u32 = said[said.len().saturating_sub(2)..].parse().unwrap_or(0);
            match (is_whole, last_two % 10, last_two) {
                (false, ..) => few,
                (true, 1, last) if last != 11 => one,
                (true, 2..=4, last) if !(12..=14).contains(&last) => few,
                _ => many,
            }
        }
        _ if said == "1" => one,
        _ => few,
    }
}
