//! A formula that a user writes as a number that acts.

use std::sync::OnceLock;

use serde::{Deserialize, Deserializer, Serialize, Serializer};

use crate::num::formula::{Fault, Formula, Unit};

/// The text of a formula, read once.
#[derive(Debug, Clone)]
pub struct Expression {
    text: String,
    read: OnceLock<Result<Formula, Fault>>,
}

impl Expression {
    /// As it was written.
    pub fn text(&self) -> &str {
        &self.text
    }

    /// What it says over the names of its room; the same names every time.
    pub(crate) fn formula(&self, names: &[(&str, Unit)], wanted: Unit) -> Result<&Formula, &Fault> {
        self.read.get_or_init(|| Formula::read(&self.text, names, wanted)).as_ref()
    }
}

impl PartialEq for Expression {
    fn eq(&self, other: &Self) -> bool {
        self.text == other.text
    }
}

impl Serialize for Expression {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(&self.text)
    }
}

impl<'de> Deserialize<'de> for Expression {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        Ok(Self { text: String::deserialize(deserializer)?, read: OnceLock::new() })
    }
}
