//! Processes under watch that are kept: declared, fed part by part, asked what to do next.
//!
//! What is kept of a process is its record: all that happened, in order. Its state is a function of the document, the parts in
//! the order of their numbers, and what persons decided; it is computed again wherever it is not in memory, so that a process
//! that was killed between a part and its answer has lost nothing. Who adds to the record says how far he knows it
//! ([`crate::store::processes`]): of two who report at once the second computes again with what the first has added.

mod body;
mod error;
mod live;
mod next;
mod part;
mod record;
mod said;
mod stored;
mod table;

use std::collections::HashMap;
use std::sync::{Arc, Mutex, PoisonError};

use precut_calc::calculator::Finding;
use precut_calc::process::{Decision, MOST_PARTS};
use serde_json::{Value, json};
use tokio::sync::watch;

use super::{Engine, Error, Inner, Shelf, model};
use crate::registry::{canonical, nearest};
use crate::store::documents::{Kind, NewDocument};
use crate::store::processes::{Added, Addition, Entry, EntryKind, Head, KeptPart, NewEntry};
use body::Document;
use live::{Live, Seat};

pub use error::ProcessError;
pub use next::{NextAsked, NextPart, WhichPath};
pub use part::{PartAnswer, PartOutcome, Precondition};
pub(crate) use said::in_language;

/// Processes that are kept in memory at most; any other is computed again when it is asked for.
const MOST_LIVE: usize = 32;
/// So often an addition is tried anew where others add to the same process.
const TRIES: usize = 20;
/// Entries and parts that are read at once.
const PAGE: u32 = 1000;

/// A process with how far it is.
#[derive(Debug, Clone, PartialEq)]
pub struct KeptProcess {
    /// Its name.
    pub name: String,
    /// Of its document.
    pub revision: u32,
    /// Number of the last entry of its record.
    pub sequence: i64,
    /// When its document was stored, ms since 1970, UTC.
    pub created_ms: i64,
    /// Its document as it was sent.
    pub document: Value,
    /// What was said last; nothing before the first part.
    pub state: Option<Value>,
}

impl KeptProcess {
    /// What tells one state of it from every other.
    pub fn tag(&self) -> String {
        format!("{}-{}", self.revision, self.sequence)
    }
}

/// The processes that are in memory.
pub(crate) struct Processes {
    seats: Mutex<HashMap<String, Arc<Seat>>>,
    /// Counts additions that were made here.
    news: watch::Sender<u64>,
}

impl Default for Processes {
    fn default() -> Self {
        Self { seats: Mutex::default(), news: watch::channel(0).0 }
    }
}

impl Processes {
    /// The place of a process in memory; whoever was longest unused makes room.
    fn seat(&self, full: &str) -> Arc<Seat> {
        let mut seats = self.seats.lock().unwrap_or_else(PoisonError::into_inner);
        if !seats.contains_key(full) && seats.len() >= MOST_LIVE {
            let oldest = seats.iter().min_by_key(|(_, seat)| seat.used()).map(|(name, _)| name.clone());
            oldest.and_then(|name| seats.remove(&name));
        }
        let seat = Arc::clone(seats.entry(full.to_owned()).or_default());
        seat.touch();
        seat
    }

    fn told(&self) {
        self.news.send_modify(|count| *count += 1);
    }
}

impl Inner {
    async fn no_process(&self, shelf: &Shelf, name: &str) -> Result<ProcessError, Error> {
        let known = self.documents.documents(Kind::Process, shelf.prefix(), String::new(), PAGE).await?;
        let names: Vec<String> = known.into_iter().map(|kept| shelf.plain(kept).name).collect();
        let nearest = nearest(name, names.iter().map(String::as_str)).map(str::to_owned);
        Ok(ProcessError::Unknown { name: name.to_owned(), nearest })
    }

    /// How far a process is.
    async fn head(&self, shelf: &Shelf, name: &str) -> Result<Head, ProcessError> {
        let head = if model::is_name(name) { self.processes.process(shelf.full(name)).await? } else { None };
        match head {
            Some(head) => Ok(head),
            None => Err(self.no_process(shelf, name).await?),
        }
    }

    /// Adds to a process; tells who listens.
    async fn add(&self, addition: Addition) -> Result<Option<i64>, ProcessError> {
        let bytes: usize = addition.entries.iter().map(|entry| entry.content.len() + entry.said.len()).sum();
        let with_model = addition.model.is_some();
        let processes = Arc::clone(&self.processes);
        let added = async move { processes.add_to_process(addition).await };
        // What a model says counts for every job that comes after it.
        let added = if with_model { self.generation.after(added).await? } else { added.await? };
        match added {
            Added::Done { sequence, .. } => {
                self.live_processes.told();
                Ok(Some(sequence))
            }
            Added::Stale => Ok(None),
            Added::OverQuota(usage) => Err(self.no_room(&usage, bytes as u64).into()),
        }
    }
}

impl Engine {
    /// Declares a process, or declares it otherwise; whether it is new.
    pub async fn put_process(
        &self,
        shelf: &Shelf,
        name: &str,
        sent: Value,
        (precondition, owner): (Precondition, String),
    ) -> Result<(KeptProcess, bool), ProcessError> {
        if !model::is_name(name) {
            return Err(ProcessError::one(Finding::new("bad_process_name", "").with("name", name.to_owned())));
        }
        if sent.get("record").is_some() {
            return self.import_process(shelf, name, sent, owner).await;
        }
        let seat = self.inner.live_processes.seat(&shelf.full(name));
        let mut live = seat.lock().await;
        let mut read_as: Option<Document> = None;
        for _ in 0..TRIES {
            let there = match self.process(shelf, name).await {
                Ok(there) => Some(there),
                Err(ProcessError::Unknown { .. }) => None,
                Err(error) => return Err(error),
            };
            if let Some(there) = &there
                && canonical_text(&there.document)? == canonical_text(&sent)?
            {
                return Ok((there.clone(), false));
            }
            // What is wrong by itself is told before what has changed meanwhile.
            let document = match read_as.take() {
                Some(document) => document,
                None => self.read_document(shelf, sent.clone()).await?,
            };
            read_as = Some(document.clone());
            if let Some(there) = &there {
                precondition.hold(&there.tag())?;
            }
            let made = self.declared(shelf, name, document, there.as_ref(), &owner).await?;
            *live = None;
            if made {
                return Ok((self.process(shelf, name).await?, there.is_none()));
            }
        }
        Err(Error::Busy { retry_after: super::json::RETRY_AFTER }.into())
    }

    /// Writes a document; all parts are judged by it.
    async fn declared(
        &self,
        shelf: &Shelf,
        name: &str,
        document: Document,
        there: Option<&KeptProcess>,
        owner: &str,
    ) -> Result<bool, ProcessError> {
        let inner = &self.inner;
        let full = shelf.full(name);
        if there.is_none() {
            inner.model_name_is_free(shelf, name).await?;
        }
        let content = document.content()?;
        let (mut parts, mut snapshots, mut state, mut stored) = (Vec::new(), Vec::new(), None, None);
        if there.is_some() {
            let live = Live::load(inner, &full, Some(document.clone())).await?;
            parts = live.nows().collect();
            snapshots = live.snapshots();
            stored = live.stored_model(&full, None).await?;
            state = live.state(name, there.map_or(0, |there| there.sequence) + 1);
        }
        let entry = NewEntry {
            kind: EntryKind::Document,
            part: None,
            revision: 1,
            number: None,
            content: content.clone(),
            said: json!({ "replayed_parts": parts.len() }).to_string(),
            created_ms: None,
        };
        let kept = NewDocument {
            kind: Kind::Process,
            name: full.clone(),
            class: document.calculator().to_owned(),
            words: String::new(),
            sha256: model::sha256(&content),
            content,
        };
        let addition = Addition {
            process: full,
            after: there.map(|there| there.sequence),
            document: Some(kept),
            model: stored,
            entries: vec![entry],
            parts,
            snapshots,
            state: state.map(|state| state.to_string()),
            owner: owner.to_owned(),
            quota: inner.settings.quota,
            ..Addition::default()
        };
        Ok(inner.add(addition).await?.is_some())
    }

    /// An entry that is told, with the owner of the process and his name of it; nothing where the process is gone.
    pub(crate) async fn told_entry(
        &self,
        process: &str,
        sequence: i64,
    ) -> Result<Option<(String, String, Entry)>, Error> {
        let mut entries = self.inner.processes.process_entries(process.to_owned(), sequence - 1, 1, false).await?;
        let (owner, name) = Shelf::split(process);
        let entry = entries.pop().filter(|entry| entry.sequence == sequence);
        Ok(entry.map(|entry| (owner, name.to_owned(), entry)))
    }

    /// A process.
    pub async fn process(&self, shelf: &Shelf, name: &str) -> Result<KeptProcess, ProcessError> {
        let head = self.inner.head(shelf, name).await?;
        let kept = self.inner.documents.document(Kind::Process, shelf.full(name), None).await?;
        let Some(kept) = kept else { return Err(self.inner.no_process(shelf, name).await?) };
        Ok(KeptProcess {
            name: name.to_owned(),
            revision: kept.revision,
            sequence: head.sequence,
            created_ms: kept.created_ms,
            document: Document::read(&self.inner.registry, &kept.content)?.sent,
            state: head.state.and_then(|state| serde_json::from_str(&state).ok()),
        })
    }

    /// Up to `limit` processes whose names follow `after`, by name.
    pub async fn processes(&self, shelf: &Shelf, after: String, limit: u32) -> Result<Vec<KeptProcess>, ProcessError> {
        let kept = self.inner.documents.documents(Kind::Process, shelf.prefix(), after, limit).await?;
        let mut all = Vec::with_capacity(kept.len());
        for kept in kept {
            match self.process(shelf, &shelf.plain(kept).name).await {
                Ok(process) => all.push(process),
                // It was deleted meanwhile.
                Err(ProcessError::Unknown { .. }) => {}
                Err(error) => return Err(error),
            }
        }
        Ok(all)
    }

    /// Deletes a process with its record.
    pub async fn delete_process(
        &self,
        shelf: &Shelf,
        name: &str,
        precondition: &Precondition,
    ) -> Result<(), ProcessError> {
        let seat = self.inner.live_processes.seat(&shelf.full(name));
        let mut live = seat.lock().await;
        let there = self.process(shelf, name).await?;
        precondition.hold(&there.tag())?;
        *live = None;
        if self.inner.processes.delete_process(shelf.full(name), there.sequence).await? {
            self.inner.live_processes.told();
            return Ok(());
        }
        Err(ProcessError::PreconditionFailed { tag: there.tag() })
    }

    /// The record of a process after an entry, up to `limit` entries.
    pub async fn process_entries(
        &self,
        shelf: &Shelf,
        name: &str,
        after: i64,
        limit: u32,
    ) -> Result<Vec<Entry>, ProcessError> {
        self.inner.head(shelf, name).await?;
        Ok(self.inner.processes.process_entries(shelf.full(name), after, limit, false).await?)
    }

    /// Parts that are not withdrawn, by number.
    pub async fn process_parts(
        &self,
        shelf: &Shelf,
        name: &str,
        numbers: (i64, i64),
        limit: u32,
    ) -> Result<Vec<KeptPart>, ProcessError> {
        self.inner.head(shelf, name).await?;
        Ok(self.inner.processes.process_parts(shelf.full(name), numbers, limit).await?)
    }

    /// A part with all that was said of it.
    pub async fn process_part(
        &self,
        shelf: &Shelf,
        name: &str,
        part: &str,
    ) -> Result<(KeptPart, Vec<Entry>), ProcessError> {
        self.inner.head(shelf, name).await?;
        let full = shelf.full(name);
        let kept = self.inner.processes.process_part(full.clone(), part.to_owned()).await?;
        let kept = kept.ok_or_else(|| ProcessError::UnknownPart(part.to_owned()))?;
        Ok((kept, self.inner.processes.part_entries(full, part.to_owned()).await?))
    }

    /// Takes what a person says of a change.
    pub async fn decide(
        &self,
        shelf: &Shelf,
        name: &str,
        change: &str,
        (decision, note, owner): (Decision, Option<String>, String),
    ) -> Result<KeptProcess, ProcessError> {
        let inner = &self.inner;
        let full = shelf.full(name);
        let seat = inner.live_processes.seat(&full);
        let mut seated = seat.lock().await;
        for _ in 0..TRIES {
            inner.head(shelf, name).await?;
            let live = Live::current(inner, &full, &mut seated).await?;
            let mut decided = live.copy();
            let is_there = decided.knows_change(change);
            if !decided.decide(change, &decision)? {
                return Err(match &decision {
                    Decision::Name(kind) if is_there => {
                        ProcessError::one(Finding::new("cause_not_listed", "/cause").with("cause", kind.clone()))
                    }
                    _ => ProcessError::UnknownChange(change.to_owned()),
                });
            }
            decided.sequence += 1;
            let content = body::decision(change, decided.last(), &decision, note.as_deref());
            let state = decided.state(name, decided.sequence);
            let stored = decided.stored_model(&full, Some(live)).await?;
            let entry = NewEntry {
                kind: EntryKind::Decision,
                part: None,
                revision: 1,
                number: None,
                content: content.to_string(),
                said: state.clone().unwrap_or_default().to_string(),
                created_ms: None,
            };
            let addition = Addition {
                process: full.clone(),
                after: Some(live.sequence),
                model: stored,
                entries: vec![entry],
                state: state.map(|state| state.to_string()),
                owner: owner.clone(),
                quota: inner.settings.quota,
                ..Addition::default()
            };
            if inner.add(addition).await?.is_some() {
                *seated = Some(decided);
                return self.process(shelf, name).await;
            }
        }
        Err(Error::Busy { retry_after: super::json::RETRY_AFTER }.into())
    }

    /// Kind, field and unit of all that the model of a process may have a size of, by its document.
    pub fn process_sizes(&self, document: &Value) -> Vec<(&'static str, &'static str, &'static str)> {
        let calculator = document["calculator"].as_str().unwrap_or_default();
        let observed = self.inner.registry.entry(calculator).and_then(|entry| entry.observed());
        observed.map(|observed| observed.sizes.clone()).unwrap_or_default()
    }

    /// Something may have been added to some process when this changes.
    pub fn process_news(&self) -> watch::Receiver<u64> {
        self.inner.live_processes.news.subscribe()
    }
}

/// A process has no more parts than so many.
fn too_many_parts(count: usize) -> Option<ProcessError> {
    #[allow(clippy::cast_precision_loss)] // counts of parts
    let finding = || Finding::new("process_too_large", "").measured(count as f64, MOST_PARTS as f64, "1");
    (count > MOST_PARTS).then(|| ProcessError::one(finding()))
}

/// JSON in the one form in which equal values have equal bytes.
fn canonical_text(value: &Value) -> Result<String, Error> {
    let bytes = canonical(value).map_err(|error| Error::internal(error.to_string()))?;
    String::from_utf8(bytes).map_err(|error| Error::internal(error.to_string()))
}
