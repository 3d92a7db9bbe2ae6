//! Why a process is not there, or does not take what is sent.

use precut_calc::calculator::Finding;

use crate::engine::Error;

/// Why a process is not there, or does not take what is sent.
#[derive(Debug, Clone, PartialEq)]
pub enum ProcessError {
    /// No process of that name; the one most like it.
    Unknown {
        /// The name asked for.
        name: String,
        /// The one most like it.
        nearest: Option<String>,
    },
    /// The process has no such part.
    UnknownPart(String),
    /// The process has no such change.
    UnknownChange(String),
    /// The name is taken.
    Exists(String),
    /// A stored model that is of no process has the name under which this one would store its own.
    ModelTaken(String),
    /// Another part has the number.
    NumberTaken {
        /// The number.
        number: u32,
        /// The part that has it.
        part: String,
    },
    /// It is there and says something else: whoever changes it says which one he has seen.
    PreconditionRequired {
        /// Its tag.
        tag: String,
    },
    /// It is not what whoever changes it has seen.
    PreconditionFailed {
        /// Its tag.
        tag: String,
    },
    /// What was sent breaks rules.
    Invalid {
        /// The first faults.
        findings: Vec<Finding>,
        /// How many there are.
        total: usize,
    },
    /// A program is asked for while a person is to be called.
    CallPerson,
    /// Anything else.
    Other(Error),
}

impl<E: Into<Error>> From<E> for ProcessError {
    fn from(error: E) -> Self {
        match error.into() {
            Error::Invalid { findings, total } => Self::Invalid { findings, total },
            other => Self::Other(other),
        }
    }
}

impl ProcessError {
    /// One fault.
    pub(crate) fn one(finding: Finding) -> Self {
        Self::Invalid { findings: vec![finding], total: 1 }
    }

    /// A field is not there.
    pub(crate) fn missing(pointer: &str) -> Self {
        Self::one(Finding::new("missing_field", pointer.to_owned()))
    }

    /// A table is no text.
    pub(crate) fn not_utf8() -> Self {
        Self::one(Finding::new("not_utf8", "/measurements"))
    }
}
