//! A job on its way in, an answer on its way out.

use std::borrow::Cow;
use std::sync::Arc;
use std::time::Duration;

use bytes::Bytes;
use precut_calc::calculator::{Cost, Figure, Place, Program, ReturnedProgram, Table};
use serde::Deserialize;
use serde_json::Value;

use super::error::Error;
use super::{model, names};
use crate::key::{ENGINE_VERSION, Key};
use crate::registry::{Entry, UnreadableResult};
use crate::store::{KeptResult, StoreError};
use crate::text::{Language, Mark};

/// A job as it came.
#[derive(Debug, Clone)]
pub enum Body {
    /// As JSON.
    Json(Bytes),
    /// As JSON with files beside it.
    Parts {
        /// The job.
        job: Bytes,
        /// Its measured tables and long texts.
        files: Vec<FilePart>,
    },
}

impl Body {
    /// Size of all of it, bytes.
    pub(crate) fn len(&self) -> usize {
        match self {
            Self::Json(job) => job.len(),
            Self::Parts { job, files } => job.len() + files.iter().map(|file| file.bytes.len()).sum::<usize>(),
        }
    }
}

/// A measured table, or a long text, as a file beside the job.
#[derive(Debug, Clone)]
pub struct FilePart {
    /// Name of the field: its last part or all of it with dots.
    pub name: String,
    /// The CSV, or the text as it is.
    pub bytes: Bytes,
}

/// A job that could run.
#[derive(Debug, Clone)]
pub struct Checked {
    /// The job with every default filled in, measured tables replaced by their row count and hash.
    pub input: Value,
    /// What it would cost.
    pub cost: Cost,
    /// The address of its answer.
    pub key: Key,
}

/// An answer with how it came about.
#[derive(Debug, Clone)]
pub struct Solved {
    /// The answer.
    pub stored: Arc<Stored>,
    /// Whether it was there already.
    pub cache: CacheState,
    /// Where the time went.
    pub timings: Timings,
}

/// Whether an answer was there already.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum CacheState {
    /// It was.
    Hit,
    /// It was computed, for this request or for another one at the same time.
    Miss,
}

/// Where the time of a request went.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Timings {
    /// Reading and checking the job.
    pub parse: Duration,
    /// Waiting for a core.
    pub queue: Duration,
    /// Computing and writing the answer.
    pub run: Duration,
}

/// An answer's bytes.
pub struct Stored {
    /// Its address.
    pub key: Key,
    /// The envelope in English, JSON.
    pub body: Bytes,
    /// The filled job in canonical JSON, with its measured tables.
    pub(crate) input: Bytes,
    pub(crate) entry: Arc<Entry>,
}

impl std::fmt::Debug for Stored {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Stored").field("key", &self.key).field("bytes", &self.body.len()).finish_non_exhaustive()
    }
}

impl Stored {
    /// The envelope in that language.
    pub fn body_in(&self, language: Language) -> Bytes {
        if language == Language::default() {
            return self.body.clone();
        }
        super::envelope::in_language(&self.body, language).into()
    }
    /// A word or a number of the envelope itself, as text.
    pub fn said(&self, name: &str) -> Option<String> {
        let place = super::json::top_level_field(&self.body, name)?;
        match serde_json::from_slice(&self.body[place]).ok()? {
            Value::String(word) => Some(word),
            other => Some(other.to_string()),
        }
    }
    /// How probably all its limits are kept, where the answer tells.
    pub(crate) fn probability(&self) -> Option<f64> {
        #[derive(Deserialize)]
        struct Told {
            conformance: Option<Conformance>,
        }
        #[derive(Deserialize)]
        struct Conformance {
            joint: Option<Joint>,
            joint_probability: Option<f64>,
        }
        #[derive(Deserialize)]
        struct Joint {
            probability: f64,
        }
        let place = super::json::top_level_field(&self.body, "result")?;
        let told: Told = serde_json::from_slice(&self.body[place]).ok()?;
        let Conformance { joint, joint_probability } = told.conformance?;
        joint.map(|joint| joint.probability).or(joint_probability)
    }
    /// What tells its job from others of the same calculator; nothing of a very large job.
    pub(crate) fn marks(&self) -> Vec<Mark> {
        /// Jobs with more have measured tables, and reading one as a tree takes many times its size.
        const MOST_BYTES: usize = 1 << 20;
        let job = (self.input.len() <= MOST_BYTES).then(|| serde_json::from_slice(&self.input).ok()).flatten();
        job.map(|job| super::summary::hallmarks(&self.entry, &job)).unwrap_or_default()
    }
    /// Which calculator made it.
    pub fn entry(&self) -> &Arc<Entry> {
        &self.entry
    }
    /// As it is kept.
    pub(crate) fn kept(&self) -> KeptResult {
        let meta = self.entry.meta();
        KeptResult {
            key: self.key,
            calculator: meta.id.to_owned(),
            version: meta.version,
            engine: ENGINE_VERSION.to_owned(),
            input: self.input.clone(),
            body: self.body.clone(),
            records: names::records_of(&self.input),
        }
    }
    /// The filled job as its calculator has it.
    fn own_input(&self) -> Vec<u8> {
        let input = names::without_drawn(&self.input);
        model::without_model(&self.entry, &input).into_owned()
    }
    /// The filled job as it may be sent again: without what it got from records beside its numbers.
    pub fn job(&self) -> Cow<'_, [u8]> {
        names::without_drawn(&self.input)
    }
    /// Its pictures; the first is the main one.
    pub fn figures(&self) -> Result<Vec<Figure>, Error> {
        self.entry.figures(&self.own_input(), &self.body).map_err(outdated)
    }
    /// Its tables; the first is the main one.
    pub fn tables(&self) -> Result<Vec<Table>, Error> {
        self.entry.result_tables(&self.own_input(), &self.body).map_err(outdated)
    }
    /// The same with what stands in them as sentences in that language.
    pub fn tables_in(&self, language: Language) -> Result<Vec<Table>, Error> {
        let body = self.body_in(language);
        self.entry.result_tables(&self.own_input(), &body).map_err(outdated)
    }
    /// Its job with what changes where a setting of a picture is put at another place; as it is where no job stands there.
    pub fn job_at(&self, place: &Place<'_>) -> Result<Value, Error> {
        let unreadable = |error: serde_json::Error| outdated(UnreadableResult(error.to_string()));
        let mut job: Value = serde_json::from_slice(&self.job()).map_err(unreadable)?;
        let moved = self.entry.at_place(&self.own_input(), &self.body, place);
        if let Some(moved) = moved.map_err(outdated)? {
            change(&mut job, &moved.before, &moved.after);
        }
        Ok(job)
    }
    /// The program that its job brought along, as it is given back: `None` if jobs of the calculator bring none, `Err` if this
    /// answer has none.
    pub fn returned(&self) -> Result<Option<ReturnedProgram>, Error> {
        let made_by = format!("precut {} result {}", self.said("engine").unwrap_or_default(), self.key);
        let returned = self.entry.returned(&self.own_input(), &self.body, &made_by).map_err(outdated)?;
        returned.transpose().map_err(Error::Calculation)
    }
    /// Its program for the machine: `None` if the calculator has none, `Err` if this answer has none.
    pub fn program(&self) -> Result<Option<Program>, Error> {
        self.entry.program(&self.own_input(), &self.body).map_err(outdated)?.transpose().map_err(Error::Calculation)
    }
}

/// Changes in a value what differs between two others of its shape.
fn change(value: &mut Value, before: &Value, after: &Value) {
    match (value, before, after) {
        (_, before, after) if before == after => {}
        (Value::Object(fields), Value::Object(before), Value::Object(after)) => {
            fields.retain(|name, _| after.contains_key(name) || !before.contains_key(name));
            for (name, after) in after {
                match (fields.get_mut(name), before.get(name)) {
                    (Some(field), Some(before)) => change(field, before, after),
                    _ => drop(fields.insert(name.clone(), after.clone())),
                }
            }
        }
        (Value::Array(items), Value::Array(before), Value::Array(after))
            if items.len() == after.len() && before.len() == after.len() =>
        {
            for ((item, before), after) in items.iter_mut().zip(before).zip(after) {
                change(item, before, after);
            }
        }
        (value, _, after) => *value = after.clone(),
    }
}

fn outdated(error: UnreadableResult) -> Error {
    Error::Store(StoreError::Outdated(error.0))
}
