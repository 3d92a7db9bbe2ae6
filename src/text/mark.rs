//! What a job is told apart by, in the language of the reader.

use super::named::amount;
use super::{Glossary, Language, glossary, number, significant};

/// Something that tells a job from others.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum Mark {
    /// Whose job it is: the English title of a calculator.
    Title(&'static str),
    /// A field, `Type.name`, and what it is.
    Field { name: String, unit: Option<String>, said: Said },
    /// Words of the contract; `more` of them are left out.
    Words { words: Vec<String>, more: bool },
    /// A name that the user gave.
    Name(String),
}

/// What a field is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Said {
    /// One number.
    Number(f64),
    /// From one to another.
    Span(f64, f64),
    /// So many items.
    Count(usize),
}

/// Digits that tell jobs apart.
const DIGITS: usize = 5;

/// The marks in one line.
pub(crate) fn told(language: Language, marks: &[Mark]) -> String {
    let told: Vec<String> = marks.iter().map(|mark| one(language, mark)).collect();
    let mut line = String::new();
    for (place, (mark, part)) in marks.iter().zip(told).enumerate() {
        let is_first = place == 0;
        line.push_str(if is_first { "" } else { " · " });
        line.push_str(&match mark {
            Mark::Name(_) => part,
            _ if is_first => glossary::capitalised(&part),
            _ => glossary::within(&part),
        });
    }
    line
}

fn one(language: Language, mark: &Mark) -> String {
    let glossary = Glossary::of(language);
    match mark {
        Mark::Title(english) => glossary.help(english).to_owned(),
        Mark::Name(name) => name.clone(),
        Mark::Words { words, more } => {
            let said: Vec<String> = words.iter().map(|word| glossary.name_within(word)).collect();
            format!("{}{}", said.join(", "), if *more { " …" } else { "" })
        }
        Mark::Field { name, unit, said } => {
            let label = glossary.way(name);
            let spoken = |x: f64| number::spoken(&significant(x, DIGITS), language);
            let unit = unit.as_deref().unwrap_or("1");
            match said {
                Said::Number(x) => format!("{label} {}", amount(&spoken(*x), unit, language)),
                Said::Span(from, to) => {
                    format!("{label} {}", amount(&format!("{}…{}", spoken(*from), spoken(*to)), unit, language))
                }
                Said::Count(items) => format!("{label}: {items}"),
            }
        }
    }
}
