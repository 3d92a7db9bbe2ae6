//! The records of processes under watch: all that happened to each, in order, and each of its parts as it is now.
//!
//! The document of a process is one of [`super::documents`]; here is what comes after it. Whoever adds to a record says how
//! far he knows it. Where somebody else was faster nothing is written, so that what is added follows from all that is there,
//! and sequences have no gap.

use futures_util::future::BoxFuture;

use super::StoreError;
use super::callbacks::{Callback, NewCallback};
use super::documents::NewDocument;
use super::quota::{Quota, Usage};

/// How far a process is.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Head {
    /// Number of its last entry.
    pub sequence: i64,
    /// What was said last, JSON.
    pub state: Option<String>,
}

from_row!(Head { sequence, state });

/// What happened.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum EntryKind {
    /// The process was declared, or declared otherwise.
    Document,
    /// A part came, or was corrected.
    Part,
    /// A part was withdrawn.
    Withdrawn,
    /// A person decided on a change.
    Decision,
    /// A path was given out.
    Path,
}

impl EntryKind {
    const ALL: [Self; 5] = [Self::Document, Self::Part, Self::Withdrawn, Self::Decision, Self::Path];

    /// As it is kept.
    pub fn word(self) -> &'static str {
        match self {
            Self::Document => "document",
            Self::Part => "part",
            Self::Withdrawn => "withdrawn",
            Self::Decision => "decision",
            Self::Path => "path",
        }
    }

    /// From what is kept.
    pub fn of_word(word: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|kind| kind.word() == word)
    }
}

/// Something that happened to a process.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Entry {
    /// Its number, from 1 without a gap.
    pub sequence: i64,
    /// What it is.
    pub kind: String,
    /// The part that it is about.
    pub part: Option<String>,
    /// Of the document, of the part, or of the path.
    pub revision: u32,
    /// Number of the part.
    pub number: Option<i64>,
    /// What came, JSON.
    pub content: String,
    /// What was said then, JSON.
    pub said: String,
    /// When, ms since 1970, UTC.
    pub created_ms: i64,
    /// What has become of the callback that tells of it.
    pub callback: Option<Callback>,
}

/// A part as it is now.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct KeptPart {
    /// Its name.
    pub part: String,
    /// Its number; none where it was withdrawn.
    pub number: Option<i64>,
    /// Of its last entry.
    pub sequence: i64,
    /// Rises with each correction.
    pub revision: u32,
    /// What came, JSON.
    pub content: String,
    /// What was said then, JSON.
    pub said: String,
    /// What is said of it now, JSON.
    pub now: String,
    /// When it came or was corrected, ms since 1970, UTC.
    pub created_ms: i64,
}

from_row!(KeptPart { part, number, sequence, revision as i32, content, said, now, created_ms });

/// An entry to be added.
#[derive(Debug, Clone, PartialEq)]
pub struct NewEntry {
    /// What it is.
    pub kind: EntryKind,
    /// See [`Entry::part`].
    pub part: Option<String>,
    /// See [`Entry::revision`]; of a document that is kept with it, the one that it is kept as.
    pub revision: u32,
    /// See [`Entry::number`].
    pub number: Option<u32>,
    /// What came, JSON.
    pub content: String,
    /// What is said, JSON.
    pub said: String,
    /// When, where it happened elsewhere before, ms UTC.
    pub created_ms: Option<i64>,
}

impl NewEntry {
    pub(super) fn bytes(&self) -> usize {
        self.content.len() + self.said.len()
    }
}

/// What becomes of a part.
#[derive(Debug, Clone, PartialEq)]
pub struct PartNow {
    /// Its name.
    pub part: String,
    /// Where an entry is about it: its number, none where it is withdrawn, and the place of the entry among those added.
    pub entry: Option<(Option<u32>, usize)>,
    /// What is said of it now, JSON.
    pub now: String,
}

/// A process as it was after one of its parts, so that it need not be computed again from its first.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Snapshot {
    /// Number of the part.
    pub number: i64,
    /// JSON.
    pub content: String,
}

from_row!(Snapshot { number, content });

/// So many snapshots of a process are kept, the last ones.
pub const MOST_SNAPSHOTS: u32 = 4;

/// What is added to a process.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Addition {
    /// Its name.
    pub process: String,
    /// How far whoever adds knows it; none makes the process.
    pub after: Option<i64>,
    /// Its document, where that is new.
    pub document: Option<NewDocument>,
    /// The model that it stores in its name, where that is new.
    pub model: Option<NewDocument>,
    /// What happened.
    pub entries: Vec<NewEntry>,
    /// The parts of which something else is said now.
    pub parts: Vec<PartNow>,
    /// The process as it is after some of the parts that are judged with this addition, of ascending numbers.
    pub snapshots: Vec<Snapshot>,
    /// Who is told of which of the entries.
    pub tells: Vec<(usize, NewCallback)>,
    /// What is said of it now, JSON.
    pub state: Option<String>,
    /// For whom it counts.
    pub owner: String,
    /// What he may take.
    pub quota: Quota,
}

impl Addition {
    /// What it takes, bytes.
    pub(super) fn bytes(&self) -> u64 {
        let entries: usize = self.entries.iter().map(NewEntry::bytes).sum();
        let documents = self.document.iter().chain(&self.model).map(|document| document.content.len());
        (entries + documents.sum::<usize>()) as u64
    }
}

/// What came of an addition.
#[derive(Debug, Clone, PartialEq)]
pub enum Added {
    /// It is on the disk.
    Done {
        /// Number of the last entry.
        sequence: i64,
        /// When, ms since 1970, UTC.
        created_ms: i64,
    },
    /// Somebody else has added, made or deleted meanwhile.
    Stale,
    /// For its owner so much is kept that there is no room for it.
    OverQuota(Usage),
}

/// Where records of processes are kept.
pub trait ProcessStore: Send + Sync + 'static {
    /// How far a process is.
    fn process(&self, name: String) -> BoxFuture<'_, Result<Option<Head>, StoreError>>;
    /// Up to `limit` of the entries after that one, in order; all, or those that are about no part.
    fn process_entries(
        &self,
        name: String,
        after: i64,
        limit: u32,
        without_parts: bool,
    ) -> BoxFuture<'_, Result<Vec<Entry>, StoreError>>;
    /// All entries of a part, in order.
    fn part_entries(&self, name: String, part: String) -> BoxFuture<'_, Result<Vec<Entry>, StoreError>>;
    /// Up to `limit` parts that are not withdrawn, by number, those numbers among them.
    fn process_parts(
        &self,
        name: String,
        numbers: (i64, i64),
        limit: u32,
    ) -> BoxFuture<'_, Result<Vec<KeptPart>, StoreError>>;
    /// A part, withdrawn or not.
    fn process_part(&self, name: String, part: String) -> BoxFuture<'_, Result<Option<KeptPart>, StoreError>>;
    /// The last snapshot before a part of that number, or before the last part, since which nothing before it has changed.
    fn process_snapshot(
        &self,
        name: String,
        before: Option<i64>,
    ) -> BoxFuture<'_, Result<Option<Snapshot>, StoreError>>;
    /// Adds to a process, or makes it; on the disk on return.
    fn add_to_process(&self, addition: Addition) -> BoxFuture<'_, Result<Added, StoreError>>;
    /// Deletes a process with its parts, if that is how far it is; numbers of its document are never given again.
    fn delete_process(&self, name: String, at: i64) -> BoxFuture<'_, Result<bool, StoreError>>;
}
