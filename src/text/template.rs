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
/// Less of an angle than this is rounding.
const LEAST_ANGLE_DEG: f64 = 1e-9;

/// An environment that knows the filters of the texts and no text yet.
pub(super) fn environment() -> Environment<'static> {
    let mut environment = Environment::new();
    environment.set_undefined_behavior(UndefinedBehavior::Strict);
    environment.set_auto_escape_callback(|_| minijinja::AutoEscape::None);
    environment.set_formatter(|out, state, value| match as_number(value) {
        Some(number) => Ok(out.write_str(&number::spoken(&number::read(number), language_of(state)))?),
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
    environment.add_filter("angle", |state: &State<'_, '_>, degrees: f64, digits: usize| {
        let degrees = if degrees.abs() < LEAST_ANGLE_DEG { 0.0 } else { degrees };
        format!("{}°", number::spoken(&significant(degrees, digits), language_of(state)))
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
    environment.add_function("allowed_range", allowed_range);
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

/// What is allowed, with its unit: from `minimum` or `above`, and `maximum` or `below`, of the sentence that asks.
fn allowed_range(state: &State<'_, '_>) -> Result<String, Error> {
    let names = ["minimum", "above", "maximum", "below", "unit"];
    let context: BTreeMap<&str, Value> =
        names.into_iter().filter_map(|name| Some((name, state.lookup(name)?))).collect();
    state.env().get_template(&super::name(language_of(state), "range", "allowed"))?.render(context)
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
            Some(number) => number::spoken(&number::read(number), language),
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

/// Words of the contract as `words` says them, each with its own label in brackets where it has one.
#[allow(clippy::needless_pass_by_value)]
fn labelled(state: &State<'_, '_>, words: Value, labels: Value) -> Result<String, Error> {
    if let Some(word) = words.as_str() {
        return with_label(state, word, labels.as_str().unwrap_or_default());
    }
    let mut labels = labels.try_iter()?;
    let mut said = Vec::new();
    let mut has_sets = false;
    for word in words.try_iter()? {
        let label = labels.next().unwrap_or_default();
        has_sets |= word.kind() == ValueKind::Seq;
        said.push(if word.kind() == ValueKind::Seq {
            let own: Vec<Value> = label.try_iter().map(Iterator::collect).unwrap_or_default();
            let label = |index: usize| own.get(index).and_then(Value::as_str).unwrap_or_default();
            let each = word.try_iter()?.enumerate();
            let each = each.map(|(index, word)| with_label(state, &word.to_string(), label(index)));
            each.collect::<Result<Vec<_>, Error>>()?.join(" + ")
        } else {
            with_label(state, &word.to_string(), label.as_str().unwrap_or_default())?
        });
    }
    Ok(said.join(if has_sets { "; " } else { ", " }))
}

/// A word and in brackets which of several it is: `order 5`, `mode 2`, `300 mm`, or a name that the user gave.
fn with_label(state: &State<'_, '_>, word: &str, label: &str) -> Result<String, Error> {
    let language = language_of(state);
    let word = Glossary::of(language).word(word);
    let number = |text: &str| text.parse::<f64>().ok().map(|number| number::spoken(&number::read(number), language));
    let label = match label.split_once(' ') {
        None if label.is_empty() => return Ok(word),
        Some((of @ ("order" | "mode"), which)) if number(which).is_some() => {
            let name = super::name(language, "cause", &format!("cause_of_{of}"));
            state.env().get_template(&name)?.render(BTreeMap::from([(of, number(which))]))?
        }
        Some((place, "mm")) => number(place).map_or_else(|| label.to_owned(), |place| amount(&place, "mm", language)),
        _ => label.to_owned(),
    };
    Ok(format!("{word} ({label})"))
}

/// The form of a noun that a count asks for: two in English (1, all others), three in Russian (1 and 21; 2 to 4 and
/// fractions; 0, 5 to 20 and so on). The count is a number, or one that is written already: what is read decides.
#[allow(clippy::needless_pass_by_value)]
fn plural(
    state: &State<'_, '_>,
    count: Value,
    one: String,
    few: String,
    many: Option<String>,
) -> Result<String, Error> {
    let said = match (as_number(&count), count.as_str()) {
        (Some(number), _) => number::read(number),
        (None, Some(written)) => written.to_owned(),
        (None, None) => {
            return Err(Error::new(minijinja::ErrorKind::InvalidOperation, "a plural is asked for of no number"));
        }
    };
    let said = said.trim_start_matches('-');
    let is_whole = said.bytes().all(|byte| byte.is_ascii_digit());
    Ok(match (language_of(state), many) {
        (Language::Ru, Some(many)) => {
            let last_two =
                said.get(said.len().saturating_sub(2)..).and_then(|end| end.parse::<u32>().ok()).unwrap_or(0);
            match (is_whole, last_two % 10, last_two) {
                (false, ..) => few,
                (true, 1, last) if last != 11 => one,
                (true, 2..=4, last) if !(12..=14).contains(&last) => few,
                _ => many,
            }
        }
        _ if said == "1" => one,
        _ => few,
    })
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use precut_calc::calculator::{Finding, Message, Values};

    use crate::text::{Language, Texts};

    fn explained(message: &Message) -> [String; 2] {
        let said = |language| Texts::shared().try_word(language, "explanation", message.code, &message.values).unwrap();
        [said(Language::En), said(Language::Ru)]
    }

    /// What a template of a test's own says.
    fn rendered(language: Language, template: &str, values: &Values) -> String {
        let file = format!("[explanation]\nown = {template:?}");
        let texts = Texts::from_files(&[(format!("{}/room.toml", language.tag()), file)]).unwrap();
        texts.try_word(language, "explanation", "own", values).unwrap()
    }

    #[test]
    fn the_gain_of_a_diagnosis_says_which_way_the_error_goes() {
        let gain = |base: f64, extended: f64, unit: &'static str| {
            let chance = f64::from(u8::from((3.0..3.9).contains(&extended)));
            let message = Message::new("diagnosis_gain").with("base", base).with("extended", extended);
            let message = message.with("chance", chance).with("low", -0.05).with("high", 0.31);
            explained(&message.with("ceiling", base / 2.0).with("quantity", "diameter_deviation_um").with("unit", unit))
        };
        for (base, extended, unit, english, russian) in [
            (3.9, 1.5, "um", "falls from 3.9 to 1.5 µm; scatter", "падает с 3,9 до 1,5 мкм; разброс"),
            (
                3.9,
                3.5,
                "um",
                "to 3.5 µm, which may be chance: the share it falls by lies between -5 % and 31 % (95 %); scatter",
                "до 3,5 мкм, что может быть случайностью: доля, на которую она падает, лежит между -5 % и 31 % (95 %); разброс",
            ),
            (3.9, 4.78, "um", "rises from 3.9 to 4.78 µm: there the", "растёт с 3,9 до 4,78 мкм: на них"),
            (1.511, 1.512, "um", "stays at 1.51 µm; scatter", "остаётся равной 1,51 мкм; разброс"),
            (0.25, 0.35, "", "rises from 25 % to 35 %: there the", "растёт с 25 % до 35 %: на них"),
            (0.25, 0.25, "", "stays at 25 %; scatter", "остаётся равной 25 %; разброс"),
        ] {
            let [in_english, in_russian] = gain(base, extended, unit);
            assert!(in_english.contains(english), "{in_english}");
            assert!(in_russian.contains(russian), "{in_russian}");
        }
    }

    #[test]
    fn causes_of_one_kind_are_told_apart() {
        let message = Message::new("diagnosis_next")
            .with("changes", "tool_x_mm")
            .with("leader", vec!["roller_runout"])
            .with("leader_labels", vec![""])
            .with("rival", vec!["initial_harmonic", "initial_harmonic"])
            .with("rival_labels", vec!["order 2", "order 3"])
            .with("now", 18.39)
            .with("then", 36.7);
        let [english, russian] = explained(&message);
        assert!(english.contains("from wave of the blank (order 2), wave of the blank (order 3) best: 18 sigmas now"));
        assert!(russian.contains("(порядок 2), ") && russian.contains("(порядок 3)»"), "{russian}");
        assert!(russian.contains("сейчас 18 сигм, тогда 37."), "{russian}");
        let values = Values::new()
            .with("sets", vec![vec!["batch_shift", "tool_wear"], vec!["steady_rest_offset"]])
            .with("labels", vec![vec!["melt 7", ""], vec!["312.5 mm"]]);
        let said = |language| rendered(language, "{{ sets | labelled(labels) }}", &values);
        assert!(said(Language::En).contains(" (melt 7) + ") && said(Language::En).ends_with(" (312.5 mm)"));
        assert!(said(Language::Ru).contains(" (melt 7) + ") && said(Language::Ru).ends_with(" (312,5 мм)"));
    }

    #[test]
    fn a_plural_is_that_of_the_number_as_it_is_read() {
        let template = "{{ x | sig(2) }} {{ x | sig(2) | plural('сигма', 'сигмы', 'сигм') }}";
        for (x, expected) in
            [(1.0, "1 сигма"), (2.71, "2,7 сигмы"), (18.4, "18 сигм"), (20.6, "21 сигма"), (3.04, "3 сигмы")]
        {
            assert_eq!(rendered(Language::Ru, template, &Values::new().with("x", x)), expected);
        }
        let template = "{{ n }} {{ n | plural('row', 'rows') }}";
        for (n, expected) in [(1.0, "1 row"), (0.0, "0 rows"), (11.0, "11 rows"), (8_388_608.0, "8388608 rows")] {
            assert_eq!(rendered(Language::En, template, &Values::new().with("n", n)), expected);
        }
    }

    #[test]
    fn an_angle_of_rounding_is_none() {
        for (degrees, expected) in [(3.777e-13, "0°"), (-2e-12, "0°"), (12.345_67, "12,35°"), (1e-3, "0,001°")] {
            let values = Values::new().with("x", degrees);
            assert_eq!(rendered(Language::Ru, "{{ x | angle(4) }}", &values), expected);
        }
    }

    #[test]
    fn what_there_is_instead_follows_after_a_stop() {
        let fault = |code, nearest: Option<&'static str>| {
            let finding =
                Finding::new(code, "/supports/0/kind").with("received", "nope").with("allowed", vec!["centre"]);
            let finding = nearest.into_iter().fold(finding, |finding, nearest| finding.with("nearest", nearest));
            [Language::En, Language::Ru]
                .map(|language| Texts::shared().try_finding(language, "fault", &finding).unwrap())
        };
        for (code, nearest, english, russian) in [
            (
                "unknown_kind",
                None,
                "there is no kind nope; known: centre",
                "kind = nope: такого варианта нет; есть: centre",
            ),
            (
                "unknown_kind",
                Some("centre"),
                "there is no kind nope; did you mean centre? Known: centre",
                "kind = nope: такого варианта нет; может быть, centre? Есть: centre",
            ),
            ("not_one_of", None, "kind is nope; allowed: centre", "kind = nope; допустимо: centre"),
            (
                "not_one_of",
                Some("centre"),
                "kind is nope; did you mean centre? Allowed: centre",
                "kind = nope; может быть, centre? Допустимо: centre",
            ),
        ] {
            assert_eq!(fault(code, nearest), [english, russian]);
        }
    }
}
