//! Every text in every language: what is missing, what nobody asks for, what says something else, what is left of
//! English. Each test names all that it finds, as it would stand in the file.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;
use std::sync::LazyLock;

use precut_library::{Kind, built_in};
use serde_json::Value;

use super::{Glossary, Language, Texts};
use crate::engine::studies_of;
use crate::registry::Registry;

/// The languages that are translations.
const TRANSLATIONS: [Language; 1] = [Language::Ru];

/// Words in Latin letters that Russian texts have beside the names of the contract: protocols, standards, names.
const LATIN: &[&str] = &[
    // Protocols, formats, programs, standards, names.
    "Accept",
    "After",
    "Allow",
    "Authorization",
    "Bearer",
    "Content",
    "Encoding",
    "Excel",
    "Fanuc",
    "GET",
    "Idempotency",
    "Infinity",
    "Key",
    "LinuxCNC",
    "Location",
    "NaN",
    "RONt",
    "RONp",
    "RONv",
    "RONq",
    "Retry",
    "Siemens",
    "1.2738",
    "1.4301",
    "after",
    "angle",
    "application",
    "boundary",
    "calculators",
    "csv",
    "data",
    "docs",
    "errors",
    "events",
    "form",
    "jobs",
    "json",
    "materials",
    "money",
    "multipart",
    "next",
    "openapi",
    "percent",
    "rad",
    "rough",
    // Symbols, functions and units of formulas.
    "abs",
    "alpha",
    "ap",
    "cos",
    "deg",
    "delta",
    "dn",
    "dp",
    "dw",
    "dx",
    "exp",
    "km",
    "lambda",
    "ln",
    "log",
    "max",
    "min",
    "mm",
    "mu",
    "ph",
    "phi",
    "rev",
    "rho",
    "sin",
    "sqrt",
    "tanh",
    "tau",
    "um",
    // Values of fields, and an example of a name.
    "around",
    "common",
    "frequency",
    "quadratic",
    "from",
    "held",
    "holder",
    "ETag",
    "If-Match",
    "If-None-Match",
    "insert",
    "normal_force",
    "set",
    "lathe-7",
    "provenance",
    "regression",
    "table",
    "repeats",
    "shear",
    "stated",
    // Values of JSON.
    "false",
    "inf",
    "null",
    "true",
];

/// Names of templates without their language, by language.
fn codes(language: Language) -> BTreeSet<String> {
    let tag = format!("{}/", language.tag());
    let templates = Texts::shared().sources.of(language);
    templates.keys().filter_map(|name| Some(name.strip_prefix(&tag)?.to_owned())).collect()
}

fn source(language: Language, name: &str) -> String {
    let template = Texts::shared().environment.get_template(&format!("{}/{name}", language.tag()));
    template.expect("the name comes from the texts").source().to_owned()
}

fn none(found: &BTreeSet<String>, what: &str) {
    let list = found.iter().fold(String::new(), |mut list, each| {
        let _ = writeln!(list, "{each}");
        list
    });
    assert!(found.is_empty(), "{} {what}:\n{list}", found.len());
}

#[test]
fn every_sentence_is_there_in_every_language() {
    let english = codes(Language::En);
    for language in TRANSLATIONS {
        let own = codes(language);
        let missing = english.difference(&own).map(|name| format!("{name} = {:?}", source(Language::En, name)));
        none(&missing.collect(), &format!("sentences are missing in {}", language.tag()));
        let orphaned = own.difference(&english).cloned().collect();
        none(&orphaned, &format!("sentences of {} are in no English file", language.tag()));
    }
}

#[test]
fn everything_that_a_watched_process_says_has_its_sentence() {
    use precut_calc::process::{ACTION_CODES, EXPLANATION_CODES, FAULT_CODES};
    let english = codes(Language::En);
    let said = [("fault", FAULT_CODES), ("explanation", EXPLANATION_CODES), ("explanation", ACTION_CODES)];
    let names = said.into_iter().flat_map(|(section, codes)| codes.iter().map(move |code| format!("{section}.{code}")));
    let missing = names.filter(|name| !english.contains(name));
    none(&missing.collect(), "codes of processes are not worded");
}

#[test]
fn every_sentence_says_the_same_values_in_every_language() {
    let environment = &Texts::shared().environment;
    let asked = |language: Language, name: &str| -> BTreeSet<String> {
        let template = environment.get_template(&format!("{}/{name}", language.tag()));
        template.map(|template| template.undeclared_variables(false).into_iter().collect()).unwrap_or_default()
    };
    for language in TRANSLATIONS {
        let mut different = BTreeSet::new();
        for name in codes(Language::En).intersection(&codes(language)) {
            let (english, own) = (asked(Language::En, name), asked(language, name));
            if english != own {
                different.insert(format!("{name}: {english:?} in English, {own:?} in {}", language.tag()));
            }
        }
        none(&different, "sentences say other values than the English ones");
    }
}

/// What a text says outside the tags of its template.
fn plain(template: &str) -> String {
    let mut text = String::new();
    let mut rest = template;
    while let Some(start) = rest.find(['{']).filter(|start| matches!(rest.as_bytes().get(start + 1), Some(b'{' | b'%')))
    {
        text.push_str(&rest[..start]);
        text.push(' ');
        let close = if rest.as_bytes()[start + 1] == b'{' { "}}" } else { "%}" };
        // A dictionary inside a tag ends with one brace more.
        let end = rest[start..].find(close).map_or(rest.len(), |end| start + end + 2);
        rest = rest[end..].trim_start_matches('}');
    }
    text.push_str(rest);
    text
}

/// What stands in quotes in the tags of a template behind a colon or in a plural: words that are said.
fn quoted(template: &str) -> Vec<String> {
    let said = |part: &str| part.contains("plural(") || part.contains("': '");
    let mut words = Vec::new();
    for tag in template.split("{{").skip(1).filter_map(|part| part.split("}}").next()).filter(|part| said(part)) {
        let pieces: Vec<&str> = tag.split('\'').collect();
        for (index, piece) in pieces.iter().enumerate().skip(1).step_by(2) {
            let is_key = pieces.get(index + 1).is_some_and(|next| next.trim_start().starts_with(':'));
            if !is_key {
                words.push((*piece).to_owned());
            }
        }
    }
    words
}

/// Words of English in a text of another language, and decimal points.
fn leftovers(text: &str, names: &BTreeSet<String>) -> Vec<String> {
    let part_of_word = |c: char| c.is_ascii_alphanumeric() || "_/.-{}`:".contains(c);
    let mut found = Vec::new();
    for token in text.split(|c| !part_of_word(c)) {
        let token = token.trim_matches(|c: char| "/.-{}:`".contains(c));
        let is_name = token.contains(['_', '/']) || names.contains(token) || LATIN.contains(&token);
        let parts: Vec<&str> = token.split(['.', '-', ':', '`']).collect();
        let all_known = parts.iter().all(|part| {
            names.contains(*part) || LATIN.contains(part) || part.bytes().any(|byte| byte.is_ascii_digit())
        });
        let in_lower = token.as_bytes().windows(2).any(|pair| pair.iter().all(u8::is_ascii_lowercase));
        let decimal = token.split_once('.').is_some_and(|(whole, decimals)| {
            let digits = |text: &str| !text.is_empty() && text.bytes().all(|byte| byte.is_ascii_digit());
            digits(whole) && digits(decimals)
        });
        if (in_lower && !is_name && !all_known) || (decimal && !is_name) {
            found.push(token.to_owned());
        }
    }
    found
}

/// Words of English in a sentence as it is said.
pub(crate) fn english_in(text: &str) -> Vec<String> {
    static NAMES: LazyLock<BTreeSet<String>> = LazyLock::new(|| Asked::of_contract().names());
    leftovers(text, &NAMES)
}

/// What the contract asks the glossary for, each with where.
#[derive(Default)]
struct Asked {
    help: BTreeMap<String, String>,
    label: BTreeMap<(String, String), String>,
    word: BTreeMap<String, String>,
    group: BTreeMap<String, String>,
    unit: BTreeMap<String, String>,
}

impl Asked {
    fn of_contract() -> Self {
        let registry = Registry::standard().expect("the calculators fit together");
        let mut asked = Self::default();
        for entry in registry.entries().iter().cloned().chain([studies_of(&registry)]) {
            let meta = entry.meta();
            let mut texts = vec![meta.title, meta.question, meta.summary];
            texts.extend(meta.examples.iter().map(|example| example.title));
            for text in texts {
                asked.help.insert(text.to_owned(), meta.id.to_owned());
            }
            for id in meta.figures.iter().chain(meta.tables) {
                asked.word.insert((*id).to_owned(), meta.id.to_owned());
            }
            for document in [entry.input_document(), entry.output_document()] {
                asked.walk(&document, meta.id, meta.id);
            }
        }
        for record in Kind::ALL.into_iter().flat_map(built_in::records) {
            asked.help.insert(record.text("title").unwrap_or_default().to_owned(), record.kind.plural().to_owned());
        }
        asked.help.insert(crate::http::DESCRIPTION.to_owned(), "GET /".to_owned());
        asked
    }

    fn walk(&mut self, schema: &Value, calculator: &str, component: &str) {
        let Value::Object(map) = schema else {
            schema.as_array().into_iter().flatten().for_each(|item| self.walk(item, calculator, component));
            return;
        };
        let place = || format!("{calculator}, {component}");
        for (name, part) in map {
            match (name.as_str(), part) {
                ("default" | "example" | "examples", _) => {}
                ("description", Value::String(text)) => {
                    self.help.insert(text.clone(), place());
                }
                ("x-unit", Value::String(unit)) => {
                    self.unit.insert(unit.clone(), place());
                }
                ("x-group", Value::String(group)) => {
                    self.group.insert(group.clone(), place());
                }
                ("enum", Value::Array(words)) => {
                    self.word.extend(words.iter().filter_map(|word| Some((word.as_str()?.to_owned(), place()))));
                }
                ("properties", Value::Object(fields)) => {
                    for (field, part) in fields {
                        self.label.insert((component.to_owned(), field.clone()), place());
                        self.walk(part, calculator, component);
                    }
                }
                ("$defs", Value::Object(types)) => {
                    types.iter().for_each(|(name, part)| self.walk(part, calculator, name));
                }
                (_, part) => self.walk(part, calculator, component),
            }
        }
    }

    /// Names of fields and values of choices, which stay as they are in every language.
    fn names(&self) -> BTreeSet<String> {
        let of_records = Kind::ALL.into_iter().flat_map(|kind| kind.fields().iter().map(|field| field.name.to_owned()));
        let of_jobs = self.label.keys().map(|(_, field)| field.clone()).chain(self.word.keys().cloned());
        of_jobs.chain(of_records).chain(Kind::ALL.map(|kind| kind.plural().to_owned())).collect()
    }
}

#[test]
fn every_label_help_and_word_is_there_in_every_language() {
    let asked = Asked::of_contract();
    for language in TRANSLATIONS {
        let glossary = Glossary::of(language);
        let mut missing = BTreeSet::new();
        for (text, place) in &asked.help {
            if glossary.get("help", text).is_none() {
                missing.insert(format!("[help] {text:?} = \"\"  # {place}"));
            }
        }
        for ((component, field), place) in &asked.label {
            if glossary.get("label", field).is_none()
                && glossary.get("label", &format!("{component}.{field}")).is_none()
            {
                missing.insert(format!("[label] {field} = \"\"  # {place}"));
            }
        }
        for (section, names) in [("word", &asked.word), ("group", &asked.group)] {
            for (name, place) in names {
                if glossary.get(section, name).is_none() {
                    missing.insert(format!("[{section}] {name} = \"\"  # {place}"));
                }
            }
        }
        for (unit, place) in &asked.unit {
            let printed = glossary.unit(unit);
            if glossary.get("unit", unit).is_none() && printed.chars().any(|c| c.is_ascii_alphabetic()) {
                missing.insert(format!("[unit] {unit:?} = \"\"  # {place}"));
            }
        }
        none(&missing, &format!("names and helps are missing in {}", language.tag()));
    }
}

#[test]
fn no_label_help_or_word_is_left_over() {
    let asked = Asked::of_contract();
    for language in Language::ALL {
        let mut orphaned = BTreeSet::new();
        for (section, name) in Glossary::of(language).names() {
            let known = match section {
                "help" => asked.help.contains_key(name),
                "label" => match name.split_once('.') {
                    Some((component, field)) => asked.label.contains_key(&(component.to_owned(), field.to_owned())),
                    None => asked.label.keys().any(|(_, field)| field == name),
                },
                "word" => asked.word.contains_key(name),
                // Words that stand in sentences only.
                "said" => !asked.word.contains_key(name),
                "group" => asked.group.contains_key(name),
                // Users' tables bring units that no schema has, libraries say what they like.
                "unit" | "reason" => true,
                _ => false,
            };
            if !known {
                orphaned.insert(format!("{}: [{section}] {name:?}", language.tag()));
            }
        }
        none(&orphaned, "names and helps are asked for by nobody");
    }
}

#[test]
fn no_english_is_left_in_russian() {
    let names = Asked::of_contract().names();
    let mut found = BTreeSet::new();
    for name in codes(Language::Ru) {
        let text = source(Language::Ru, &name);
        for piece in std::iter::once(plain(&text)).chain(quoted(&text)) {
            for word in leftovers(&piece, &names) {
                found.insert(format!("{name}: {word}"));
            }
        }
    }
    for (section, name, text) in Glossary::of(Language::Ru).texts() {
        for word in leftovers(text, &names) {
            found.insert(format!("[{section}] {name:?}: {word}"));
        }
    }
    none(&found, "words of English are left");
}

#[test]
fn leftovers_are_found() {
    let names = BTreeSet::from(["samples".to_owned()]);
    for (text, expected) in [
        ("дайте samples или radius_mm, GET /v1/materials, G96, RONt, 0,5 мм, 1e-7", &[][..]),
        ("the вал", &["the"]),
        ("вал length 0.5", &["length", "0.5"]),
        ("ISO 12181-2, log10, x = 3, |a| + |b|, conditions.samples", &["conditions.samples"]),
    ] {
        assert_eq!(leftovers(text, &names), expected, "{text}");
    }
    assert_eq!(plain("a {{ {'x': 'y'}[z] }} b{% if c %}d{% endif %}"), "a   b d ");
    assert_eq!(
        quoted("{{ n | plural('один', 'two') }} {{ {'key': 'value'}[x] }} {{ y | default('z') }}"),
        ["один", "two", "value"]
    );
}
