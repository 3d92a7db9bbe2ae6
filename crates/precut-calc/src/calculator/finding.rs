//! Codes with numbers: what physics says, before anybody words it.

use std::borrow::Cow;
use std::collections::BTreeMap;

use serde::{Serialize, Serializer};

/// A number or a word inside a message.
#[derive(Debug, Clone, PartialEq, Serialize)]
#[serde(untagged)]
pub enum Value {
    /// A number; its unit stands in its name.
    Number(f64),
    /// An identifier or name; never a sentence.
    Text(Cow<'static, str>),
    /// Several of them.
    List(Vec<Value>),
}

impl From<f64> for Value {
    fn from(number: f64) -> Self {
        Self::Number(number)
    }
}
impl From<&'static str> for Value {
    fn from(text: &'static str) -> Self {
        Self::Text(Cow::Borrowed(text))
    }
}
impl From<String> for Value {
    fn from(text: String) -> Self {
        Self::Text(Cow::Owned(text))
    }
}
impl From<usize> for Value {
    fn from(count: usize) -> Self {
        // Counts in messages are far below 2^53.
        #[allow(clippy::cast_precision_loss)]
        Self::Number(count as f64)
    }
}
impl<T: Into<Value>> From<Vec<T>> for Value {
    fn from(items: Vec<T>) -> Self {
        Self::List(items.into_iter().map(Into::into).collect())
    }
}

/// Named values, in the order of their names.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Values(BTreeMap<&'static str, Value>);

impl Values {
    /// No values.
    pub const fn new() -> Self {
        Self(BTreeMap::new())
    }
    /// The same with one more.
    #[must_use]
    pub fn with(mut self, name: &'static str, value: impl Into<Value>) -> Self {
        self.0.insert(name, value.into());
        self
    }
    /// The value of that name.
    pub fn get(&self, name: &str) -> Option<&Value> {
        self.0.get(name)
    }
    /// All of them, by name.
    pub fn iter(&self) -> impl Iterator<Item = (&'static str, &Value)> {
        self.0.iter().map(|(name, value)| (*name, value))
    }
    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }
}

impl Serialize for Values {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_map(&self.0)
    }
}

/// Something to say, as a code with the numbers that its sentence needs.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Message {
    /// `snake_case`; never changes its meaning.
    pub code: &'static str,
    /// The numbers of the sentence.
    #[serde(skip_serializing_if = "Values::is_empty")]
    pub values: Values,
}

impl Message {
    /// A message without numbers.
    pub const fn new(code: &'static str) -> Self {
        Self { code, values: Values::new() }
    }
    /// The same with one more number or name.
    #[must_use]
    pub fn with(mut self, name: &'static str, value: impl Into<Value>) -> Self {
        self.values = self.values.with(name, value);
        self
    }
}

/// Something to say of one field: a fault or a warning.
#[derive(Debug, Clone, PartialEq)]
pub struct Finding {
    /// `snake_case`; never changes its meaning.
    pub code: &'static str,
    /// JSON Pointer to the field, empty for the whole job.
    pub pointer: String,
    /// The value received or reached.
    pub value: Option<f64>,
    /// The limit that it passed.
    pub limit: Option<f64>,
    /// Unit of both, as in the contract (`mm`, `um/N`, `1`).
    pub unit: Option<&'static str>,
    /// Further numbers of the sentence.
    pub values: Values,
}

impl Finding {
    /// A finding about the field at `pointer`.
    pub fn new(code: &'static str, pointer: impl Into<String>) -> Self {
        Self { code, pointer: pointer.into(), value: None, limit: None, unit: None, values: Values::new() }
    }
    /// The same about a field of what stands at `pointer`.
    #[must_use]
    pub fn under(mut self, pointer: &str) -> Self {
        self.pointer.insert_str(0, pointer);
        self
    }
    /// With both ends of what is allowed, in the unit of the value. An end that is not allowed itself is named `above` or
    /// `below` instead.
    #[must_use]
    pub fn within(self, minimum: f64, maximum: f64) -> Self {
        self.with("minimum", minimum).with("maximum", maximum)
    }
    /// With the value and the limit that it passed, both in `unit`.
    #[must_use]
    pub fn measured(mut self, value: f64, limit: f64, unit: &'static str) -> Self {
        self.value = Some(value);
        self.limit = Some(limit);
        self.unit = Some(unit);
        self
    }
    /// With the value received, in `unit`.
    #[must_use]
    pub fn value(mut self, value: f64, unit: &'static str) -> Self {
        self.value = Some(value);
        self.unit = Some(unit);
        self
    }
    /// With one more number or name for the sentence.
    #[must_use]
    pub fn with(mut self, name: &'static str, value: impl Into<Value>) -> Self {
        self.values = self.values.with(name, value);
        self
    }
}

/// Faults of a job, gathered.
#[derive(Debug, Default)]
pub struct Violations(Vec<Finding>);

impl Violations {
    /// Adds a fault.
    pub fn add(&mut self, finding: Finding) {
        self.0.push(finding);
    }
    /// Adds the fault if the condition does not hold.
    pub fn require(&mut self, holds: bool, finding: impl FnOnce() -> Finding) {
        if !holds {
            self.0.push(finding());
        }
    }
    /// Whether nothing was found.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }
    /// All faults, in the order in which they were found.
    pub fn into_vec(self) -> Vec<Finding> {
        self.0
    }
}
