//! A formula that a user writes as a number that acts.

use std::sync::OnceLock;

use serde::{Deserialize, Deserializer, Serialize, Serializer};

use super::{Fit, Parameter};
use crate::num::formula::{Fault, Formula, Unit};

/// The numbers that a formula may have, as its catalogue lists them; the effect itself says how far each may lie from what is
/// stated.
pub(crate) const NUMBERS: [Parameter; 3] = [number("k1"), number("k2"), number("k3")];

const fn number(name: &'static str) -> Parameter {
    Parameter { name, unit: "1", fit: Fit::Amplitude, prior_sd: 1.0, lower: -1e6, upper: 1e6 }
}

/// A formula with its numbers, as an effect states it.
#[derive(Debug, Clone, Copy)]
pub(crate) struct UserFormula<'a> {
    /// What the user calls it; may be empty.
    pub(crate) name: &'a str,
    pub(crate) expression: &'a Expression,
    pub(crate) numbers: [f64; NUMBERS.len()],
    /// How far each number may be off before anything is measured.
    pub(crate) deviations: [f64; NUMBERS.len()],
}

impl<'a> UserFormula<'a> {
    /// What it is called: as the user does, else as it is written.
    pub(crate) fn label(&self) -> &'a str {
        if self.name.is_empty() { self.expression.text() } else { self.name }
    }
}

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
