//! Codes with values into sentences.
//!
//! Texts stand in `locales/{language}/*.toml`, one file for what is common and one per calculator, each with tables
//! `[section]` of `code = "template"`; in `[problem.{code}]` stand `title` and `detail`. The files of a language are
//! one whole. A template sees the values of its message and fails on one that is not there, which a test finds; a
//! reader then gets the code in plain words, never an error.

#[cfg(test)]
pub(crate) mod complete;
mod described;
mod glossary;
pub(crate) mod kept;
mod language;
mod mark;
mod named;
mod notice;
mod number;
mod template;

pub(crate) use described::described;
pub(crate) use glossary::{Glossary, capitalised, within};
pub(crate) use kept::{datum, reworded, reworded_rows};
pub use language::Language;
pub(crate) use mark::{Mark, Said, told};
pub use notice::{Notice, Remark};
pub(crate) use number::{significant, spoken_number};

use std::collections::BTreeMap;
use std::sync::{Arc, LazyLock, OnceLock};

use minijinja::{Environment, ErrorKind};
use precut_calc::calculator::{Finding, Message, Value, Values};

#[derive(rust_embed::RustEmbed)]
#[folder = "locales"]
struct Locales;

/// Why texts cannot be used.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum TextError {
    /// A file that is no table of texts.
    #[error("{file}: {reason}")]
    BadFile {
        /// Which file.
        file: String,
        /// Why.
        reason: String,
    },
    /// A code that two files word differently.
    #[error("{name} has two texts")]
    Twice {
        /// `{language}/{section}.{code}`.
        name: String,
    },
    /// A code without text.
    #[error("{name} has no text")]
    Missing {
        /// `{language}/{section}.{code}`.
        name: String,
    },
    /// A text that asks for a value which the message does not have, or the like.
    #[error("{name}: {reason}")]
    BadTemplate {
        /// `{language}/{section}.{code}`.
        name: String,
        /// Why.
        reason: String,
    },
}

/// The texts of every language.
pub struct Texts {
    sources: Arc<Sources>,
    /// Compiles a template when it is first asked for: a compiled one takes ten kilobytes, and few are ever asked for.
    environment: Environment<'static>,
}

/// Templates by name.
type Templates = BTreeMap<String, String>;

/// The templates of every language; those in the binary are read when a language is first spoken.
#[derive(Default)]
struct Sources([OnceLock<Templates>; Language::ALL.len()]);

impl Sources {
    fn of(&self, language: Language) -> &Templates {
        self.0[language.index()].get_or_init(|| {
            let own: Vec<_> = embedded().into_iter().filter(|(path, _)| language.owns(path)).collect();
            templates(&own).expect("the texts in the binary are tested")
        })
    }

    fn get(&self, name: &str) -> Option<&String> {
        self.of(Language::ALL.into_iter().find(|language| language.owns(name))?).get(name)
    }

    fn iter(&self) -> impl Iterator<Item = (&String, &String)> {
        Language::ALL.into_iter().flat_map(|language| self.of(language))
    }
}

static SHARED: LazyLock<Texts> = LazyLock::new(|| Texts::of(Sources::default()));

/// Folder of the glossary's files, below that of the language: words and names, which are no templates.
const FIELDS: &str = "fields/";

/// Path below `locales/` and content of every file of templates.
fn embedded() -> Vec<(String, String)> {
    let files = files().filter(|(path, _)| !path.contains(FIELDS));
    #[cfg(test)]
    let files = files.chain([
        ("en/toy-bar.toml".to_owned(), include_str!("registry/toy.en.toml").to_owned()),
        ("ru/toy-bar.toml".to_owned(), include_str!("registry/toy.ru.toml").to_owned()),
    ]);
    files.collect()
}

/// Path below `locales/` and content of every file.
fn files() -> impl Iterator<Item = (String, String)> {
    Locales::iter()
        .filter(|path| path.ends_with(".toml"))
        .filter_map(|path| Some((path.to_string(), String::from_utf8(Locales::get(&path)?.data.into_owned()).ok()?)))
}

/// Changes with any text of a language: for the tags of what is worded when it is asked for.
pub(crate) fn fingerprint(language: Language) -> &'static str {
    static PRINTS: LazyLock<[String; Language::ALL.len()]> = LazyLock::new(|| {
        Language::ALL.map(|language| {
            let mut own: Vec<_> = files().filter(|(path, _)| language.owns(path)).collect();
            own.sort();
            let mut hasher = blake3::Hasher::new();
            for (path, content) in &own {
                hasher.update(path.as_bytes()).update(&[0]).update(content.as_bytes()).update(&[0]);
            }
            hasher.finalize().to_hex()[..8].to_owned()
        })
    });
    &PRINTS[language.index()]
}

impl Texts {
    /// Sections in which a code of a calculator may have its text.
    pub const SECTIONS: [&'static str; 9] =
        ["fault", "warning", "explanation", "problem", "label", "figure", "table", "stage", "cause"];

    /// The texts in the binary.
    pub fn shared() -> &'static Self {
        &SHARED
    }

    /// The texts of some files: path `{language}/{room}.toml` and content.
    pub fn from_files(files: &[(String, String)]) -> Result<Self, TextError> {
        let sources = Sources::default();
        for language in Language::ALL {
            let own: Vec<_> = files.iter().filter(|(path, _)| language.owns(path)).cloned().collect();
            let _ = sources.0[language.index()].set(templates(&own)?);
        }
        let texts = Self::of(sources);
        for (name, source) in texts.sources.iter() {
            let compiled = texts.environment.template_from_named_str(name, source);
            compiled.map_err(|error| TextError::BadTemplate { name: name.clone(), reason: error.to_string() })?;
        }
        Ok(texts)
    }

    fn of(sources: Sources) -> Self {
        let sources = Arc::new(sources);
        let mut environment = template::environment();
        let by_name = Arc::clone(&sources);
        environment.set_loader(move |name| Ok(by_name.get(name).cloned()));
        Self { sources, environment }
    }

    /// Whether there is a text.
    pub fn has(&self, language: Language, section: &str, code: &str) -> bool {
        self.sources.get(&name(language, section, code)).is_some()
    }

    /// The text of `code` in `section`. A code without text, or whose text asks for a value that is not there, comes
    /// out as its own words.
    pub fn word(&self, language: Language, section: &str, code: &str, values: &Values) -> String {
        self.try_word(language, section, code, values).unwrap_or_else(|error| plain(code, &error))
    }

    /// The text of `code` in `section`, or why there is none.
    pub fn try_word(
        &self,
        language: Language,
        section: &str,
        code: &str,
        values: &Values,
    ) -> Result<String, TextError> {
        self.render(language, section, code, context(values))
    }

    /// What a column of a table is called: as in pictures, or as the field of that name and unit is.
    pub(crate) fn column(&self, language: Language, name: &str, unit: &str) -> String {
        if self.has(language, "label", name) {
            return self.word(language, "label", name, &Values::new());
        }
        Glossary::of(language).column(name, unit)
    }

    /// What a list of ways through the contract says: the labels of their fields, and what those are set to.
    pub(crate) fn names(language: Language, value: &Value) -> Option<String> {
        named::named(&template_value(value), "; ", false, language)
    }

    /// The sentence of a message in `section`.
    pub fn message(&self, language: Language, section: &str, message: &Message) -> String {
        self.word(language, section, message.code, &message.values)
    }

    /// The sentence of a finding in `section` (`fault`, `warning`); it knows `value`, `limit`, `unit`, `pointer` and
    /// `field` (the last name of the pointer) besides the finding's own values.
    pub fn finding(&self, language: Language, section: &str, finding: &Finding) -> String {
        self.try_finding(language, section, finding).unwrap_or_else(|error| plain(finding.code, &error))
    }

    /// The sentence of a finding, or why there is none. Where a field's own code has no text that fits (a text about a
    /// number, and something else came), the text of the general rule that is broken (`rule`) takes its place.
    pub fn try_finding(&self, language: Language, section: &str, finding: &Finding) -> Result<String, TextError> {
        let own = self.finding_as(language, section, finding.code, finding);
        match (own, finding.values.get("rule")) {
            (Err(_), Some(Value::Text(rule))) => self.finding_as(language, section, rule, finding),
            // A problem of the whole job that is listed as its only fault.
            (Err(TextError::Missing { .. }), _) if self.has(language, "problem", &detail(finding.code)) => {
                self.finding_as(language, "problem", &detail(finding.code), finding)
            }
            (own, _) => own,
        }
    }

    fn finding_as(
        &self,
        language: Language,
        section: &str,
        code: &str,
        finding: &Finding,
    ) -> Result<String, TextError> {
        let mut context = context(&finding.values);
        context.insert("pointer", finding.pointer.as_str().into());
        context.insert("field", field(&finding.pointer).into());
        if let Some(value) = finding.value {
            context.entry("value").or_insert_with(|| value.into());
        }
        if let Some(limit) = finding.limit {
            context.entry("limit").or_insert_with(|| limit.into());
        }
        if let Some(unit) = finding.unit {
            context.entry("unit").or_insert_with(|| unit.into());
        }
        self.render(language, section, code, context)
    }

    /// Title and detail of a problem.
    pub fn problem(&self, language: Language, code: &str, values: &Values) -> (String, String) {
        (
            self.word(language, "problem", &format!("{code}.title"), values),
            self.word(language, "problem", &detail(code), values),
        )
    }

    /// A fault or warning as it stands in documents.
    pub fn notice(&self, language: Language, section: &str, finding: &Finding) -> Notice {
        Notice {
            pointer: finding.pointer.clone(),
            code: finding.code,
            detail: self.finding(language, section, finding),
            value: finding.value,
            limit: finding.limit,
            unit: finding.unit,
            values: finding.values.clone(),
        }
    }

    /// A sentence of the explanation as it stands in answers.
    pub fn remark(&self, language: Language, message: &Message) -> Remark {
        Remark {
            code: message.code,
            text: self.message(language, "explanation", message),
            values: message.values.clone(),
        }
    }

    fn render(
        &self,
        language: Language,
        section: &str,
        code: &str,
        context: BTreeMap<&'static str, minijinja::Value>,
    ) -> Result<String, TextError> {
        let name = name(language, section, code);
        let template = match self.environment.get_template(&name) {
            Err(error) if error.kind() == ErrorKind::TemplateNotFound => return Err(TextError::Missing { name }),
            template => template,
        };
        let said = template.and_then(|template| template.render(context));
        said.map_err(|error| TextError::BadTemplate { name, reason: error.to_string() })
    }
}

fn name(language: Language, section: &str, code: &str) -> String {
    format!("{}/{section}.{code}", language.tag())
}

/// The templates of some files by name.
fn templates(files: &[(String, String)]) -> Result<Templates, TextError> {
    let mut templates = Templates::new();
    for (file, content) in files {
        let bad = |reason: String| TextError::BadFile { file: file.clone(), reason };
        let language = file.split('/').next().unwrap_or_default();
        let table: toml::Table = content.parse().map_err(|error: toml::de::Error| bad(error.to_string()))?;
        let mut flat = Vec::new();
        flatten(language, "/", &table, &mut flat).map_err(bad)?;
        for (name, source) in flat {
            if templates.get(&name).is_some_and(|other| *other != source) {
                return Err(TextError::Twice { name });
            }
            templates.insert(name, source);
        }
    }
    Ok(templates)
}

/// `en/section.code` and the template, for every text of a table.
fn flatten(prefix: &str, joint: &str, table: &toml::Table, flat: &mut Vec<(String, String)>) -> Result<(), String> {
    for (key, value) in table {
        let name = format!("{prefix}{joint}{key}");
        match value {
            toml::Value::String(source) => flat.push((name, source.clone())),
            toml::Value::Table(inner) => flatten(&name, ".", inner, flat)?,
            other => return Err(format!("{name} is {}, not a text", other.type_str())),
        }
    }
    Ok(())
}

/// Last name of a pointer, without its index.
fn field(pointer: &str) -> String {
    let last = pointer.rsplit('/').find(|part| part.parse::<usize>().is_err()).unwrap_or_default();
    last.replace("~1", "/").replace("~0", "~")
}

fn detail(code: &str) -> String {
    format!("{code}.detail")
}

/// What is shown in place of a text that failed.
fn plain(code: &str, error: &TextError) -> String {
    tracing::error!(%error, "a text is missing or does not fit its values");
    code.strip_suffix(".title").or_else(|| code.strip_suffix(".detail")).unwrap_or(code).replace('_', " ")
}

fn context(values: &Values) -> BTreeMap<&'static str, minijinja::Value> {
    values.iter().map(|(name, value)| (name, template_value(value))).collect()
}

fn template_value(value: &Value) -> minijinja::Value {
    match value {
        Value::Number(number) => (*number).into(),
        Value::Text(text) => text.as_ref().into(),
        Value::List(items) => items.iter().map(template_value).collect(),
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    fn file(content: &str) -> Vec<(String, String)> {
        vec![("en/room.toml".to_owned(), content.to_owned())]
    }

    #[test]
    fn the_texts_in_the_binary_are_sound() {
        let texts = Texts::from_files(&embedded()).unwrap();
        for language in Language::ALL {
            assert!(texts.has(language, "problem", "invalid_job.title"), "{language:?}");
        }
    }

    #[test]
    fn every_problem_has_title_and_detail() {
        let texts = Texts::shared();
        let names: Vec<&str> = texts.sources.iter().map(|(name, _)| name.as_str()).collect();
        for name in names.iter().filter(|name| name.contains("/problem.")) {
            let stem = name.strip_suffix(".title").or_else(|| name.strip_suffix(".detail")).unwrap();
            for part in ["title", "detail"] {
                assert!(names.contains(&format!("{stem}.{part}").as_str()), "{stem} has no {part}");
            }
        }
    }

    #[test]
    fn a_message_is_worded_with_its_numbers() {
        let texts = Texts::from_files(&file(
            "[explanation]\nwork = \"The part gives {{ share | percent }}, {{ depth_um | um }} at {{ z_mm }} mm: {{ names | list }}.\"",
        ))
        .unwrap();
        let message = Message::new("work")
            .with("share", 0.8349)
            .with("depth_um", 104.36)
            .with("z_mm", 250.0)
            .with("names", vec!["a", "b"]);
        let said = texts.message(Language::En, "explanation", &message);
        assert_eq!(said, "The part gives 83.5 %, 104 µm at 250 mm: a, b.");
    }

    #[test]
    fn russian_numbers_have_a_comma_cyrillic_units_and_words_in_their_plural() {
        let content = "[explanation]\nwork = \"{{ share | percent }}, {{ depth_um | um }}, {{ z_mm | mm }}, {{ unit | unit }}, \
                       {{ count }} {{ count | plural('точка', 'точки', 'точек') }}, {{ names | list }}, {{ many | list }}, \
                       {{ small | sig(2) }}\"";
        let texts = Texts::from_files(&[("ru/room.toml".to_owned(), content.to_owned())]).unwrap();
        let said = |count: f64| {
            let message = Message::new("work")
                .with("share", 0.8349)
                .with("depth_um", 1.0436)
                .with("z_mm", 250.5)
                .with("unit", "um/N")
                .with("count", count)
                .with("names", vec!["a", "b"])
                .with("many", vec![1.5, 2.0])
                .with("small", 1.2e-7);
            texts.message(Language::Ru, "explanation", &message)
        };
        assert_eq!(said(1.0), "83,5 %, 1,04 мкм, 250,5 мм, мкм/Н, 1 точка, a, b, 1,5; 2, 1,2e-7");
        for (count, noun) in
            [(2.0, "2 точки"), (5.0, "5 точек"), (11.0, "11 точек"), (21.0, "21 точка"), (1.5, "1,5 точки")]
        {
            assert!(said(count).contains(noun), "{count}");
        }
    }

    #[test]
    fn a_value_that_is_not_there_is_an_error_and_reads_as_plain_words() {
        let texts = Texts::from_files(&file("[fault]\nbad_length = \"{{ value }} and {{ nothing }}\"")).unwrap();
        let finding = Finding::new("bad_length", "/a").value(1.0, "mm");
        assert!(matches!(texts.try_finding(Language::En, "fault", &finding), Err(TextError::BadTemplate { .. })));
        assert_eq!(texts.finding(Language::En, "fault", &finding), "bad length");
        assert_eq!(texts.problem(Language::En, "not_there", &Values::new()).0, "not there");
    }

    #[test]
    fn two_texts_for_one_code_and_broken_templates_are_refused() {
        let two = [file("[fault]\na = \"x\""), file("[fault]\na = \"y\"")].concat();
        assert!(matches!(Texts::from_files(&two), Err(TextError::Twice { .. })));
        let broken = file("[fault]\na = \"{{ x\"");
        assert!(matches!(Texts::from_files(&broken), Err(TextError::BadTemplate { .. })));
        assert!(matches!(Texts::from_files(&file("[fault]\na = 3")), Err(TextError::BadFile { .. })));
    }

    #[test]
    fn the_field_of_a_pointer_is_its_last_name() {
        assert_eq!(field("/shaft/segments/0/diameter_mm"), "diameter_mm");
        assert_eq!(field("/stations/3"), "stations");
        assert_eq!(field(""), "");
    }
}
