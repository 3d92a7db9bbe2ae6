//! Machines, tools and materials: the engine's own and those of whoever asks. They are kept as stored models are: under names,
//! in revisions that never change.

mod compare;
mod draft;
mod exchange;
mod index;
mod list;
mod set;

use std::sync::Arc;

use precut_calc::calculator::Finding;
use precut_library::record::{Record, is_name};
use precut_library::resolve::Revision;
use precut_library::{Asked, Kind, Lookup, Resource, built_in, search};
use serde_json::Value;

use super::names::{Finder, Looked, sha256_of_built_in};
use super::{Engine, Error, Inner, Shelf, json, model};
use crate::registry::Faults;
use crate::store::documents::{self, Before, DocumentStore, NewDocuments, Placed, PutDocuments};
use draft::Draft;

pub use compare::{FieldComparison, RecordComparison, RecordHead};
pub(crate) use exchange::File;
pub use exchange::{Form, ImportReport, Imported};
pub(crate) use index::Index;
pub use list::{RecordPage, RecordQuery};

/// A record with its state.
#[derive(Debug, Clone, PartialEq)]
pub struct StoredRecord {
    /// What it says.
    pub record: Arc<Record>,
    /// Its state.
    pub revision: Revision,
    /// SHA-256 of it in canonical JSON.
    pub sha256: String,
    /// When it was stored, ms since 1970, UTC; none of the engine's own.
    pub created_ms: Option<i64>,
}

impl StoredRecord {
    /// Its address within the service: `machines/lathe-3@4`.
    pub fn address(&self) -> String {
        let (Revision::Own(number) | Revision::BuiltIn(number)) = self.revision;
        format!("{}/{}@{number}", self.record.kind.plural(), self.record.name)
    }

    /// One of the engine's own.
    pub(crate) fn built_in(record: &Arc<Record>) -> Self {
        Self {
            record: Arc::clone(record),
            revision: Revision::BuiltIn(built_in::DATA_VERSION),
            sha256: sha256_of_built_in(record).to_owned(),
            created_ms: None,
        }
    }
}

/// Why a record is not stored or not found.
#[derive(Debug, Clone, PartialEq)]
pub enum RecordError {
    /// No record of that name, or no such revision of it; the names most like it.
    Unknown {
        /// What it would be.
        kind: Kind,
        /// The name asked for.
        name: String,
        /// Those most like it.
        nearest: Vec<String>,
    },
    /// The name belongs to the engine.
    BuiltInName(String),
    /// The name is taken, and only a new one was wanted.
    Exists(String),
    /// What was sent breaks rules.
    Invalid {
        /// The first faults.
        findings: Vec<Finding>,
        /// How many there are.
        total: usize,
    },
    /// A record is larger than any may be.
    TooLarge {
        /// Its size, bytes.
        bytes: usize,
        /// What is allowed, bytes.
        most: usize,
    },
    /// As many are kept as may be.
    Full {
        /// How many.
        most: u64,
    },
    /// Anything else.
    Other(Error),
}

impl<E: Into<Error>> From<E> for RecordError {
    fn from(error: E) -> Self {
        Self::Other(error.into())
    }
}

impl RecordError {
    fn invalid(mut found: Faults) -> Self {
        found.listed.sort_by(crate::registry::by_pointer);
        found.listed.truncate(Error::MOST_FAULTS);
        Self::Invalid { findings: found.listed, total: found.total }
    }

    fn one(finding: Finding) -> Self {
        Self::Invalid { findings: vec![finding], total: 1 }
    }
}

/// What came of storing a record.
#[derive(Debug, Clone, PartialEq)]
pub struct RecordAnswer {
    /// As it is kept.
    pub record: StoredRecord,
    /// Whether nothing had the name before.
    pub is_new: bool,
}

/// What a record is to the store.
pub(crate) fn kind_of(kind: Kind) -> documents::Kind {
    match kind {
        Kind::Machine => documents::Kind::Machine,
        Kind::Tool => documents::Kind::Tool,
        Kind::Material => documents::Kind::Material,
        Kind::Part => documents::Kind::Part,
    }
}

/// A record as it is kept.
pub(crate) fn of_json(kind: Kind, name: &str, content: &str) -> Result<Record, Error> {
    let value = serde_json::from_str(content).map_err(|error| Error::internal(format!("a kept record: {error}")))?;
    Ok(Record { kind, name: name.to_owned(), value })
}

/// Whether an entry still says all that it said; what it left open, such as a last day, may be added.
fn holds(new: &Value, old: &Value) -> bool {
    let fields = old.as_object().into_iter().flatten();
    fields.fold(true, |holds, (name, value)| holds && new.get(name) == Some(value))
}

/// A name in an address: `name` or `name@3`.
fn named(kind: Kind, asked: &str) -> Option<Asked> {
    let (name, revision) = model::asked(asked)?;
    Some(Asked { kind, pointer: String::new(), name, revision })
}

impl Inner {
    /// Looks names up on a shelf, with what is remembered of them.
    pub(super) async fn finder<'a>(&'a self, shelf: &'a Shelf) -> Result<Finder<'a, dyn DocumentStore>, Error> {
        let generation = self.generation().await?;
        Ok(Finder { documents: &*self.documents, shelf, remembered: Some((&self.remembered, generation)) })
    }

    async fn no_record(&self, shelf: &Shelf, kind: Kind, name: &str) -> Result<RecordError, Error> {
        let mut known = self.finder(shelf).await?.names(kind_of(kind)).await?;
        known.extend(built_in::records(kind).iter().map(|record| record.name.clone()));
        let plain = name.split('@').next().unwrap_or_default();
        let nearest = search::nearest(plain, known.iter().map(String::as_str));
        Ok(RecordError::Unknown { kind, name: name.to_owned(), nearest })
    }

    /// When a revision was stored, ms UTC.
    async fn created_ms(&self, shelf: &Shelf, kind: Kind, name: &str, revision: u32) -> Result<Option<i64>, Error> {
        let kept = self.documents.document(kind_of(kind), shelf.full(name), Some(revision)).await?;
        Ok(kept.map(|kept| kept.created_ms))
    }
}

impl Engine {
    /// A record, by its exact name or `name@revision`.
    pub async fn record(&self, shelf: &Shelf, kind: Kind, asked: &str) -> Result<StoredRecord, RecordError> {
        let inner = &self.inner;
        let Some(exact) = named(kind, asked) else { return Err(inner.no_record(shelf, kind, asked).await?) };
        let Looked { lookup, sha256, .. } = inner.finder(shelf).await?.record(&exact).await?;
        match lookup {
            // Another name of a material finds it in a job; in an address each record has one.
            Lookup::Found(Resource { record, revision }) if record.name == exact.name => {
                let created_ms = match revision {
                    Revision::Own(revision) => inner.created_ms(shelf, kind, &record.name, revision).await?,
                    Revision::BuiltIn(_) => None,
                };
                Ok(StoredRecord { record, revision, sha256, created_ms })
            }
            _ => Err(inner.no_record(shelf, kind, asked).await?),
        }
    }

    /// The numbers of the revisions that an own record has.
    pub async fn record_revisions(&self, shelf: &Shelf, kind: Kind, name: &str) -> Result<Vec<u32>, RecordError> {
        Ok(self.inner.documents.revisions(kind_of(kind), shelf.full(name)).await?.there)
    }

    /// Stores a record as the next revision of its name, for an owner. `sent` is the whole record, or
    /// `{"from": NAME, "set": {...}}`.
    pub async fn put_record(
        &self,
        shelf: &Shelf,
        (kind, name): (Kind, &str),
        sent: &[u8],
        (only_new, owner): (bool, String),
    ) -> Result<RecordAnswer, RecordError> {
        if built_in::find(kind, name).is_some() {
            return Err(RecordError::BuiltInName(name.to_owned()));
        }
        let sent = json::parse_as(sent, draft::shape(kind), &super::budget::Room::default())?.value;
        let draft = Draft::of(kind, name, self.sent(shelf, kind, sent).await?)?;
        let mut placed = self.keep(shelf, std::slice::from_ref(&draft), (only_new, false), owner).await?;
        let Some(Placed { revision, created_ms, before }) = placed.pop() else {
            return Err(Error::internal(format!("record {name} is not kept")).into());
        };
        let record = StoredRecord {
            record: Arc::clone(&draft.record),
            revision: Revision::Own(revision),
            sha256: draft.sha256,
            created_ms: Some(created_ms),
        };
        Ok(RecordAnswer { record, is_new: before == Before::Nothing })
    }

    /// The record that a body says, written out or as a copy with changes.
    async fn sent(&self, shelf: &Shelf, kind: Kind, sent: Value) -> Result<Value, RecordError> {
        let Some(fields) = sent.as_object().filter(|fields| fields.contains_key("from") || fields.contains_key("set"))
        else {
            return Ok(sent);
        };
        let mut found = Faults::default();
        for name in fields.keys().filter(|name| !["from", "set"].contains(&name.as_str())) {
            found.add(Finding::new("beside_from", format!("/{name}")).with("name", name.clone()));
        }
        let from = fields.get("from").and_then(Value::as_str);
        if from.is_none() {
            found.add(Finding::new("missing_field", "/from"));
        }
        let changes = fields.get("set");
        if changes.is_some_and(|changes| !changes.is_object()) {
            found.add(Finding::new("not_an_object", "/set"));
        }
        let (Some(from), 0) = (from, found.total) else { return Err(RecordError::invalid(found)) };
        let base = self.record(shelf, kind, from).await.map_err(|error| match error {
            RecordError::Unknown { nearest, .. } => {
                let finding = Finding::new(kind.unknown(), "/from").with(kind.name(), from.to_owned());
                RecordError::one(if nearest.is_empty() { finding } else { finding.with("nearest", nearest) })
            }
            other => other,
        })?;
        let value = match base.revision {
            Revision::BuiltIn(_) => draft::cited(base.record.value.clone()),
            Revision::Own(_) => base.record.value.clone(),
        };
        match changes.and_then(Value::as_object) {
            Some(changes) => draft::changed(value, changes),
            None => Ok(value),
        }
    }

    /// Keeps records, all or none.
    async fn keep(
        &self,
        shelf: &Shelf,
        drafts: &[Draft],
        (only_new, unless_equal): (bool, bool),
        owner: String,
    ) -> Result<Vec<Placed>, RecordError> {
        let inner = &self.inner;
        self.refuse_taken(shelf, drafts).await?;
        self.refuse_shorter_histories(shelf, drafts).await?;
        self.refuse_strange_parts(drafts)?;
        let documents: Vec<_> = drafts.iter().map(|draft| draft.document(shelf.full(&draft.record.name))).collect();
        let bytes = documents.iter().map(|document| document.content.len() as u64).sum();
        let (quota, most) = (inner.settings.quota, inner.settings.most_records);
        let new = NewDocuments { documents, only_new, unless_equal, owner, quota, most };
        match inner.put_documents(new).await? {
            PutDocuments::Kept(placed) => Ok(placed),
            PutDocuments::Taken => {
                Err(RecordError::Exists(drafts.first().map(|draft| draft.record.name.clone()).unwrap_or_default()))
            }
            PutDocuments::OverQuota(usage) => Err(inner.no_room(&usage, bytes).into()),
            PutDocuments::Full => Err(RecordError::Full { most }),
        }
    }

    /// A name that one material has is no other one's: of the own ones, kept or to be kept.
    async fn refuse_taken(&self, shelf: &Shelf, drafts: &[Draft]) -> Result<(), RecordError> {
        let materials: Vec<&Draft> = drafts.iter().filter(|draft| draft.record.kind == Kind::Material).collect();
        if materials.is_empty() {
            return Ok(());
        }
        let index = self.inner.finder(shelf).await?.index(Kind::Material).await?;
        let new: std::collections::HashSet<&str> = materials.iter().map(|draft| draft.record.name.as_str()).collect();
        let mut claimed = std::collections::HashMap::new();
        let mut found = Faults::default();
        for draft in materials {
            let name = draft.record.name.as_str();
            for called in draft.record.names() {
                let folded = search::fold(called);
                // What is replaced claims nothing any more.
                let there = index.called(&folded).iter().map(String::as_str).find(|other| !new.contains(other));
                let taken_by = there.or_else(|| claimed.insert(folded, name).filter(|other| *other != name));
                if let Some(other) = taken_by {
                    let finding = Finding::new("name_taken", "/names").with("name", called.to_owned());
                    found.add(finding.with("of", other.to_owned()));
                }
            }
        }
        if found.total > 0 { Err(RecordError::invalid(found)) } else { Ok(()) }
    }

    /// The models that a machine had are not forgotten.
    async fn refuse_shorter_histories(&self, shelf: &Shelf, drafts: &[Draft]) -> Result<(), RecordError> {
        let mut found = Faults::default();
        for draft in drafts.iter().filter(|draft| draft.record.kind == Kind::Machine) {
            let name = &draft.record.name;
            let Some(kept) = self.inner.documents.document(documents::Kind::Machine, shelf.full(name), None).await?
            else {
                continue;
            };
            let before = of_json(Kind::Machine, name, &kept.content)?;
            let (old, new) = (before.rows("history"), draft.record.rows("history"));
            let stays = |(index, row): (usize, &Value)| new.get(index).is_some_and(|new| holds(new, row));
            if !old.iter().enumerate().all(stays) {
                found.add(
                    Finding::new("history_only_grows", "/history").with("name", name.clone()).with("rows", old.len()),
                );
            }
        }
        if found.total > 0 { Err(RecordError::invalid(found)) } else { Ok(()) }
    }

    /// A part is one of a job of some calculator.
    fn refuse_strange_parts(&self, drafts: &[Draft]) -> Result<(), RecordError> {
        let mut found = Faults::default();
        for record in drafts.iter().map(|draft| &draft.record).filter(|record| record.kind == Kind::Part) {
            let said = |name: &str| record.text(name).unwrap_or_default();
            let (field, type_name) = (said("field"), said("type"));
            match self.registry().part(field, type_name) {
                Some(checker) => checker.check(&record.value["value"], "/value", &mut found),
                None => found.add(
                    Finding::new("unknown_part_type", "/type")
                        .with("field", field.to_owned())
                        .with("type", type_name.to_owned()),
                ),
            }
        }
        if found.total > 0 { Err(RecordError::invalid(found)) } else { Ok(()) }
    }

    /// Deletes every revision of an own record. Jobs that were accepted with it are not touched.
    pub async fn delete_record(&self, shelf: &Shelf, kind: Kind, name: &str) -> Result<(), RecordError> {
        let inner = &self.inner;
        if built_in::find(kind, name).is_some() {
            return Err(RecordError::BuiltInName(name.to_owned()));
        }
        if is_name(name) && inner.delete_document(kind_of(kind), shelf.full(name)).await? {
            return Ok(());
        }
        Err(inner.no_record(shelf, kind, name).await?)
    }

    /// Two records of a kind, each by `name` or `name@revision`, field by field.
    pub async fn compare_records(
        &self,
        shelf: &Shelf,
        kind: Kind,
        (asked, with): (&str, &str),
    ) -> Result<RecordComparison, RecordError> {
        let (record, other) = (self.record(shelf, kind, asked).await?, self.record(shelf, kind, with).await?);
        Ok(compare::compare(&record, &other))
    }
}
