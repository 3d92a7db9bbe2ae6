//! Names and words of the contract in a language: labels and help of fields, words of choices, units.
//!
//! They stand in `locales/{language}/fields/*.toml` and are no templates:
//!
//! - `[label]`: what a field is called, by the field's name, or by `Type.name` where one type means something else;
//! - `[help]`: what a field, a type, an example or a calculator is, by the English text, which stands in the code as
//!   the description of the field. So a changed English text asks for its translation anew;
//! - `[word]`: values of choices, kinds, states, names of figures and tables, by the value;
//! - `[said]`: the same of words that stand in sentences only;
//! - `[group]`: parts of a form; `[unit]`: symbols of units;
//! - `[reason]`: what libraries say in English; `*` stands for what they quote.
//!
//! In English a label follows from the field's name and a word from its value unless the files know better, and the
//! other texts are what the code says.

use std::collections::BTreeMap;
use std::sync::{LazyLock, OnceLock};

use super::{FIELDS, Language, TextError, files};
use crate::units;

/// Names and words of one language.
#[derive(Debug, Default)]
pub(crate) struct Glossary {
    sections: BTreeMap<String, BTreeMap<String, String>>,
}

static SHARED: [OnceLock<Glossary>; Language::ALL.len()] = [const { OnceLock::new() }; Language::ALL.len()];

/// Ends of names that only say the unit, longest first.
static SUFFIXES: LazyLock<Vec<String>> = LazyLock::new(|| {
    let units = "mm um m km deg rad percent s ms min n kw kg hz k rpm n_m n_per_mm n_per_mm2 um_per_n mm_per_rev um_per_rev \
                 mm_per_tooth mm_per_min m_per_min n_mm_per_rad rad_per_n_mm n_s_per_mm kg_per_m3 um_per_m_k um_per_m \
                 um_per_km m_per_s2 cm3_per_min deg_per_rev per_mm per_mm2 per_s";
    let mut suffixes: Vec<String> = units.split_whitespace().map(|unit| format!("_{unit}")).collect();
    suffixes.sort_by_key(|suffix| std::cmp::Reverse(suffix.len()));
    suffixes
});

impl Glossary {
    /// That of a language.
    pub(crate) fn of(language: Language) -> &'static Self {
        SHARED[language.index()].get_or_init(|| {
            let own: Vec<_> = files().filter(|(path, _)| language.owns(path) && path.contains(FIELDS)).collect();
            Self::from_files(&own).expect("the words in the binary are tested")
        })
    }

    pub(super) fn from_files(files: &[(String, String)]) -> Result<Self, TextError> {
        let mut glossary = Self::default();
        for (file, content) in files {
            let bad = |reason: String| TextError::BadFile { file: file.clone(), reason };
            let tables: BTreeMap<String, BTreeMap<String, String>> =
                toml::from_str(content).map_err(|error| bad(error.to_string()))?;
            for (section, texts) in tables {
                let known = glossary.sections.entry(section.clone()).or_default();
                for (name, text) in texts {
                    if known.insert(name.clone(), text.clone()).is_some_and(|other| other != text) {
                        return Err(TextError::Twice { name: format!("{file}: {section}.{name}") });
                    }
                }
            }
        }
        Ok(glossary)
    }

    /// The text of a section by its name, where the files have one.
    pub(super) fn get(&self, section: &str, name: &str) -> Option<&str> {
        self.sections.get(section)?.get(name).map(String::as_str)
    }

    /// Section and name of every text.
    #[cfg(test)]
    pub(super) fn names(&self) -> impl Iterator<Item = (&str, &str)> {
        self.sections.iter().flat_map(|(section, texts)| texts.keys().map(|name| (section.as_str(), name.as_str())))
    }

    /// Every text with section and name.
    #[cfg(test)]
    pub(super) fn texts(&self) -> impl Iterator<Item = (&str, &str, &str)> {
        self.sections.iter().flat_map(|(section, texts)| {
            texts.iter().map(|(name, text)| (section.as_str(), name.as_str(), text.as_str()))
        })
    }

    /// What a field of a type is called.
    pub(crate) fn label(&self, component: &str, field: &str, unit: Option<&str>) -> String {
        let own = self.get("label", &format!("{component}.{field}")).or_else(|| self.get("label", field));
        own.map_or_else(|| derived(field, unit), str::to_owned)
    }

    /// What a column of that name and unit is called: as the field, or in its own words.
    pub(crate) fn column(&self, name: &str, unit: &str) -> String {
        let suffix = units::suffix(unit);
        let as_field = self.get("label", &format!("{name}{suffix}")).or_else(|| self.get("label", name));
        as_field.map_or_else(|| self.word(name), str::to_owned)
    }

    /// What an English description says.
    pub(crate) fn help<'a>(&'a self, english: &'a str) -> &'a str {
        self.get("help", english).unwrap_or(english)
    }

    /// A value of a choice, a kind, the name of a figure.
    pub(crate) fn word(&self, word: &str) -> String {
        self.get("word", word).or_else(|| self.get("said", word)).map_or_else(|| word.replace('_', " "), str::to_owned)
    }

    /// The same, if there is a word for it.
    pub(crate) fn known(&self, word: &str) -> Option<&str> {
        self.get("word", word).or_else(|| self.get("said", word))
    }

    /// What a value of a choice or a field is called where it stands alone: its word, else the field's label.
    pub(crate) fn name(&self, code: &str) -> String {
        let own = self.get("word", code).or_else(|| self.get("said", code)).map(capitalised);
        own.unwrap_or_else(|| self.label("", code, None))
    }

    /// The same within a sentence.
    pub(crate) fn name_within(&self, code: &str) -> String {
        within(&self.name(code))
    }

    /// The labels along a way through the contract, items after the list that they belong to.
    pub(super) fn way(&self, way: &str) -> String {
        let mut said: Vec<String> = Vec::new();
        for step in way.split('/') {
            if let (Ok(item), Some(list)) = (step.parse::<usize>(), said.last_mut()) {
                *list = format!("{list} {item}");
            } else {
                let (component, field) = step.split_once('.').unwrap_or(("", step));
                said.push(capitalised(&self.label(component, field, None)));
            }
        }
        said.join(" · ")
    }

    /// A part of a form.
    pub(crate) fn group(&self, group: &str) -> String {
        self.get("group", group).map_or_else(|| capitalised(&group.replace('_', " ")), str::to_owned)
    }

    /// What a library said in English.
    pub(crate) fn reason(&self, english: &str) -> String {
        if let Some(said) = self.get("reason", english) {
            return said.to_owned();
        }
        let patterns = self.sections.get("reason").into_iter().flatten();
        patterns
            .filter(|(pattern, _)| pattern.contains('*'))
            .find_map(|(pattern, said)| Some(filled(said, &quoted(pattern, english)?)))
            .unwrap_or_else(|| english.to_owned())
    }

    /// A unit of the contract as it is printed: `µm/N` for `um/N`, nothing for `1`.
    pub(crate) fn unit(&self, unit: &str) -> String {
        // A unit that another field says is not known here.
        if unit == "1" || unit.starts_with("as ") {
            return String::new();
        }
        if let Some(own) = self.get("unit", unit) {
            return own.to_owned();
        }
        let mut printed = String::with_capacity(unit.len() + 8);
        let mut word = String::new();
        for character in unit.chars().chain(['\0']) {
            if character.is_alphabetic() {
                word.push(character);
                continue;
            }
            let is_power = !word.is_empty();
            printed.push_str(self.get("unit", &word).unwrap_or(&word));
            word.clear();
            match character {
                '\0' => {}
                '2' if is_power => printed.push('²'),
                '3' if is_power => printed.push('³'),
                ' ' | '*' => printed.push('·'),
                other => printed.push(other),
            }
        }
        printed
    }
}

/// A name as inside a sentence: an abbreviation or a name keeps its capitals.
pub(crate) fn within(name: &str) -> String {
    let mut letters = name.chars();
    match (letters.next(), letters.next()) {
        (Some(first), Some(second)) if second.is_lowercase() => {
            first.to_lowercase().chain([second]).chain(letters).collect()
        }
        _ => name.to_owned(),
    }
}

/// A label out of a field's name: without the unit, with spaces, with a capital.
fn derived(field: &str, unit: Option<&str>) -> String {
    let suffix = unit.map(units::suffix).filter(|suffix| !suffix.is_empty());
    let bare = suffix.and_then(|suffix| field.strip_suffix(suffix.as_str()));
    let bare = bare.or_else(|| SUFFIXES.iter().find_map(|suffix| field.strip_suffix(suffix.as_str())));
    capitalised(&bare.unwrap_or(field).replace('_', " "))
}

pub(crate) fn capitalised(text: &str) -> String {
    let mut letters = text.chars();
    letters.next().map_or_else(String::new, |first| first.to_uppercase().chain(letters).collect())
}

/// What stands in `text` where `pattern` has its stars, if it is of that pattern.
fn quoted<'a>(pattern: &str, text: &'a str) -> Option<Vec<&'a str>> {
    let mut parts = pattern.split('*');
    let mut rest = text.strip_prefix(parts.next()?)?;
    let mut found = Vec::new();
    let mut parts = parts.peekable();
    while let Some(part) = parts.next() {
        let end = if parts.peek().is_none() {
            rest.len().checked_sub(part.len()).filter(|end| rest.is_char_boundary(*end) && rest.ends_with(part))?
        } else {
            rest.find(part)?
        };
        found.push(&rest[..end]);
        rest = &rest[end + part.len()..];
    }
    Some(found)
}

fn filled(pattern: &str, quoted: &[&str]) -> String {
    let mut quoted = quoted.iter();
    let mut text = String::with_capacity(pattern.len() + 32);
    for character in pattern.chars() {
        match character {
            '*' => text.push_str(quoted.next().copied().unwrap_or_default()),
            other => text.push(other),
        }
    }
    text
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    fn glossary(content: &str) -> Glossary {
        Glossary::from_files(&[("ru/fields/room.toml".to_owned(), content.to_owned())]).unwrap()
    }

    #[test]
    fn labels_follow_from_names_unless_the_files_know_better() {
        let english = Glossary::default();
        for (field, unit, label) in [
            ("feed_mm_per_rev", Some("mm/rev"), "Feed"),
            ("stock_diameter_mm", None, "Stock diameter"),
            ("spindle_speed_rpm", Some("rev/min"), "Spindle speed"),
            ("feed_direction", None, "Feed direction"),
            ("compliance_um_per_n", Some("um/N"), "Compliance"),
        ] {
            assert_eq!(english.label("Cut", field, unit), label);
        }
        let own = glossary("[label]\nlength_mm = \"Длина\"\n\"Shaft.length_mm\" = \"Длина вала\"");
        assert_eq!(own.label("Segment", "length_mm", Some("mm")), "Длина");
        assert_eq!(own.label("Shaft", "length_mm", Some("mm")), "Длина вала");
        assert_eq!(own.label("Shaft", "width_mm", Some("mm")), "Width");
        // A column of a table is called as the field is.
        assert_eq!(own.column("length", "mm"), "Длина");
        assert_eq!(own.column("diameter_error", "um"), "diameter error");
    }

    #[test]
    fn units_are_printed_with_their_signs() {
        let english = Glossary::of(Language::En);
        let russian = Glossary::of(Language::Ru);
        for (unit, in_english, in_russian) in [
            ("um/N", "µm/N", "мкм/Н"),
            ("N/mm2", "N/mm²", "Н/мм²"),
            ("kg/m3", "kg/m³", "кг/м³"),
            ("mm/rev", "mm/rev", "мм/об"),
            ("N s/mm", "N·s/mm", "Н·с/мм"),
            ("rad/(N mm)", "rad/(N·mm)", "рад/(Н·мм)"),
            ("percent", "%", "%"),
            ("deg", "°", "°"),
            ("1/mm2", "1/mm²", "1/мм²"),
            ("1", "", ""),
        ] {
            assert_eq!(english.unit(unit), in_english);
            assert_eq!(russian.unit(unit), in_russian);
        }
    }

    #[test]
    fn what_libraries_say_keeps_what_they_quote() {
        let own = glossary(
            "[reason]\n\"unknown field `*`, expected *\" = \"поле `*` неизвестно, ожидается *\"\nend = \"конец\"",
        );
        assert_eq!(own.reason("unknown field `tabel`, expected `table`"), "поле `tabel` неизвестно, ожидается `table`");
        assert_eq!(own.reason("end"), "конец");
        assert_eq!(own.reason("something else"), "something else");
    }

    #[test]
    fn one_name_has_one_text() {
        let two = [("ru/fields/a.toml", "[word]\na = \"x\""), ("ru/fields/b.toml", "[word]\na = \"y\"")];
        let files: Vec<_> = two.map(|(path, content)| (path.to_owned(), content.to_owned())).into();
        assert!(matches!(Glossary::from_files(&files), Err(TextError::Twice { .. })));
    }
}
