//! Documents under names: stored models, the machines, tools and materials that jobs name, parts of jobs, and processes under
//! watch. Each belongs to somebody and has revisions that never change.

use futures_util::future::BoxFuture;

use super::StoreError;
use super::quota::{Quota, Usage};

/// What a document is.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Kind {
    /// What a diagnosis found.
    Model,
    /// A machine.
    Machine,
    /// A tool.
    Tool,
    /// A work material.
    Material,
    /// A part of a job.
    Part,
    /// A process under watch.
    Process,
}

impl Kind {
    /// As it is kept.
    pub fn word(self) -> &'static str {
        match self {
            Self::Model => "model",
            Self::Machine => "machine",
            Self::Tool => "tool",
            Self::Material => "material",
            Self::Part => "part",
            Self::Process => "process",
        }
    }
}

/// A document as it is kept.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct KeptDocument {
    /// Its name.
    pub name: String,
    /// From 1; a revision never changes.
    pub revision: u32,
    /// What lists are filtered by: the calculator of a model or a process, the kind of a machine or a tool, the group of a
    /// material, the field of a part.
    pub class: String,
    /// Canonical JSON.
    pub content: String,
    /// SHA-256 of the content, 64 hexadecimal digits.
    pub sha256: String,
    /// When it was stored, ms since 1970, UTC.
    pub created_ms: i64,
}

from_row!(KeptDocument { name, revision as i32, class, content, sha256, created_ms });

/// What is searched of a document.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Title {
    /// Its name.
    pub name: String,
    /// See [`KeptDocument::class`].
    pub class: String,
    /// Title and other names, a line each.
    pub words: String,
}

from_row!(Title { name, class, words });

/// The revisions of a name.
#[derive(Debug, Clone, Default, PartialEq, Eq)]
pub struct Revisions {
    /// Those that are there, in order.
    pub there: Vec<u32>,
    /// The last number that was given, to one that is there or was deleted.
    pub last: Option<u32>,
}

impl Revisions {
    /// From numbers in order, each with whether it is there.
    pub(super) fn of(rows: &[(i32, bool)]) -> Self {
        let number = |row: &(i32, bool)| u32::try_from(row.0).ok();
        Self { last: rows.last().and_then(number), there: rows.iter().filter(|row| row.1).filter_map(number).collect() }
    }
}

/// A document to be kept.
#[derive(Debug, Clone, PartialEq)]
pub struct NewDocument {
    /// What it is.
    pub kind: Kind,
    /// Its name.
    pub name: String,
    /// See [`KeptDocument::class`].
    pub class: String,
    /// See [`Title::words`].
    pub words: String,
    /// Canonical JSON.
    pub content: String,
    /// SHA-256 of the content.
    pub sha256: String,
}

/// Documents to be kept together, all of them or none, each as the next revision of its name.
#[derive(Debug, Clone, PartialEq)]
pub struct NewDocuments {
    /// The documents, no name twice.
    pub documents: Vec<NewDocument>,
    /// Only if nothing has their names.
    pub only_new: bool,
    /// One whose newest revision says the same makes none.
    pub unless_equal: bool,
    /// Who stores them: for him they count.
    pub owner: String,
    /// What he may take.
    pub quota: Quota,
    /// So many revisions are kept at most, of everybody together; models and processes are not counted.
    pub most: u64,
}

/// What came of documents that were to be kept.
#[derive(Debug, Clone, PartialEq)]
pub enum PutDocuments {
    /// They are kept.
    Kept(Vec<Placed>),
    /// A name is taken, and only new ones were wanted.
    Taken,
    /// For their owner so much is kept that there is no room for them.
    OverQuota(Usage),
    /// There would be more than there may be.
    Full,
}

/// The revision that a document is kept as.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Placed {
    /// Its number.
    pub revision: u32,
    /// When it was stored, ms since 1970, UTC.
    pub created_ms: i64,
    /// What was there before.
    pub before: Before,
}

/// What a name had when something was to be kept under it.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Before {
    /// Nothing.
    Nothing,
    /// Something else.
    Other,
    /// The same, and no revision was made.
    Same,
}

/// Where documents are found. Names are with the shelf that they stand on: what stands before the names, see
/// [`crate::engine::Shelf`]. Nothing behind a shelf has a slash.
pub trait DocumentShelf: Send + Sync + 'static {
    /// A revision of a document, or its newest.
    fn document(
        &self,
        kind: Kind,
        name: String,
        revision: Option<u32>,
    ) -> BoxFuture<'_, Result<Option<KeptDocument>, StoreError>>;
    /// The newest revisions of up to `limit` documents of a shelf whose names follow `after`, by name.
    fn documents(
        &self,
        kind: Kind,
        shelf: String,
        after: String,
        limit: u32,
    ) -> BoxFuture<'_, Result<Vec<KeptDocument>, StoreError>>;
    /// What is searched of the newest revisions of up to `limit` documents of a shelf, by name, which is given without the
    /// shelf.
    fn titles(&self, kind: Kind, shelf: String, limit: u32) -> BoxFuture<'_, Result<Vec<Title>, StoreError>>;
    /// The revisions of a name.
    fn revisions(&self, kind: Kind, name: String) -> BoxFuture<'_, Result<Revisions, StoreError>>;
}

/// Where documents are kept.
pub trait DocumentStore: DocumentShelf {
    /// Keeps documents, on the disk on return.
    fn put_documents(&self, new: NewDocuments) -> BoxFuture<'_, Result<PutDocuments, StoreError>>;
    /// Deletes every revision of a document; whether there was one.
    fn delete_document(&self, kind: Kind, name: String) -> BoxFuture<'_, Result<bool, StoreError>>;
    /// A number that is another one after every change that another process made; none where there is no other process.
    fn generation(&self) -> BoxFuture<'_, Result<Option<i64>, StoreError>> {
        Box::pin(async { Ok(None) })
    }
}

/// The newest revision of a name.
pub(super) struct Newest {
    pub(super) revision: u32,
    sha256: String,
    created_ms: i64,
}

from_row!(Newest { revision as i32, sha256, created_ms });

impl NewDocuments {
    /// What becomes of a document beside the newest revision of its name: where it is kept already, that; else whether its name
    /// is new.
    pub(super) fn beside(&self, new: &NewDocument, newest: Option<&Newest>) -> Result<Placed, Before> {
        match newest {
            Some(Newest { revision, sha256, created_ms }) if self.unless_equal && *sha256 == new.sha256 => {
                Ok(Placed { revision: *revision, created_ms: *created_ms, before: Before::Same })
            }
            Some(_) => Err(Before::Other),
            None => Err(Before::Nothing),
        }
    }

    /// Why these of them cannot be kept beside what is; nothing where they can.
    pub(super) fn refused(
        &self,
        beside: &[Result<Placed, Before>],
        kept: u64,
        usage: Option<Usage>,
    ) -> Option<PutDocuments> {
        if self.only_new && beside.iter().any(|one| *one != Err(Before::Nothing)) {
            return Some(PutDocuments::Taken);
        }
        let new = || self.documents.iter().zip(beside).filter(|(_, one)| one.is_err()).map(|(new, _)| new);
        let counted = new().filter(|new| !matches!(new.kind, Kind::Model | Kind::Process)).count() as u64;
        if counted > 0 && kept + counted > self.most {
            return Some(PutDocuments::Full);
        }
        let bytes = new().map(|new| new.content.len() as u64).sum();
        usage.filter(|usage| !usage.has_room(&self.quota, bytes)).map(PutDocuments::OverQuota)
    }
}
