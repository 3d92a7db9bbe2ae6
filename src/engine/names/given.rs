//! What names in a job mean that is solved without a service.

use std::collections::BTreeMap;
use std::path::Path;
use std::sync::Arc;

use futures_util::FutureExt;
use futures_util::future::{BoxFuture, ready};
use precut_library::record::Record;
use precut_library::{Asked, Lookup, built_in, search};

use super::{Finder, Found, FoundModel, Names};
use crate::engine::alone::entry;
use crate::engine::budget::Room;
use crate::engine::library::{File, kind_of, of_json};
use crate::engine::model;
use crate::engine::read::{Draft, Ready};
use crate::engine::{Body, Error, Form, ModelFile, RecordError, Shelf};
use crate::registry::{Entry, Registry, canonical};
use crate::store::documents::{DocumentShelf, KeptDocument, Kind, Revisions, Title};
use crate::store::sqlite::SqliteShelf;
use crate::store::{OpenError, StoreError};

/// What names in a job mean that is solved without a service: those of the engine's own records alone, unless more is given.
#[derive(Debug, Default)]
pub struct Given {
    /// The model of a file, which the job takes whether it names it or not.
    pub model: Option<ModelFile>,
    /// Own records of a file.
    pub library: Option<Library>,
    /// What a data folder has of the names in the job.
    pub(crate) stored: Option<Found>,
}

impl Given {
    /// Looks in a data folder for what a job names; a service may be serving from it meanwhile.
    pub async fn look_up(
        &mut self,
        registry: &Registry,
        (calculator, body): (&str, &Body),
        data: &Path,
    ) -> Result<(), NotGiven> {
        let entry = entry(registry, calculator)?;
        let mut draft = Draft::of(&entry, body, (registry, &Room::default()))?;
        let documents = SqliteShelf::open(data).await?;
        let finder = Finder { documents: &documents, shelf: &Shelf::default(), remembered: None };
        let found = finder.all(&draft.asks(registry, &entry)).await;
        documents.close().await;
        self.stored = Some(found?);
        Ok(())
    }

    /// Reads a job.
    pub(crate) fn read(&self, registry: &Registry, entry: &Arc<Entry>, body: &Body) -> Result<Ready, Error> {
        let mut draft = Draft::of(entry, body, (registry, &Room::default()))?;
        let given = self.model.as_ref().map(ModelFile::kept);
        if let Some(given) = given {
            draft = draft.with_model(registry, entry, given)?;
        }
        let asks = draft.asks(registry, entry);
        let empty = Library::default();
        let library = self.library.as_ref().unwrap_or(&empty);
        let mut found = match &self.stored {
            Some(found) if self.library.is_none() => found.clone(),
            _ => {
                let finder = Finder { documents: library, shelf: &Shelf::default(), remembered: None };
                let among = finder.all(&asks).now_or_never().unwrap_or(Err(Error::Cancelled))?;
                // Where no model is kept, none is unknown.
                let models = self.stored.as_ref().map(|found| found.models.clone()).unwrap_or_default();
                Found { models, ..among }
            }
        };
        if let (Some(given), Some(asked)) = (given, asks.model()) {
            found.models = vec![(asked.to_owned(), FoundModel::Model(Box::new(given.clone())))];
        }
        draft.read(entry, body, &Names::new(registry, found))
    }
}

/// Why nothing was looked up.
#[derive(Debug, thiserror::Error)]
pub enum NotGiven {
    /// The data folder.
    #[error(transparent)]
    Folder(#[from] OpenError),
    /// The job, or the database in the folder.
    #[error("{0:?}")]
    Asked(#[from] Error),
}

/// Own records of a file, in the place of a store.
#[derive(Debug, Clone, Default)]
pub struct Library(BTreeMap<(Kind, String), KeptDocument>);

impl Library {
    /// Reads a file.
    pub fn read(form: Form, bytes: &[u8]) -> Result<Self, RecordError> {
        let file = File::read(form, bytes, &Room::default())?;
        let kept = |(record, sha256): (&Arc<Record>, &str)| {
            let content = canonical(&record.value).ok().and_then(|bytes| String::from_utf8(bytes).ok());
            let kept = KeptDocument {
                name: record.name.clone(),
                revision: 1,
                class: String::new(),
                content: content.unwrap_or_default(),
                sha256: sha256.to_owned(),
                created_ms: 0,
            };
            ((kind_of(record.kind), record.name.clone()), kept)
        };
        Ok(Self(file.records().map(kept).collect()))
    }

    /// What a name means; nothing of it is remembered.
    pub fn find(&self, kind: precut_library::Kind, name: &str) -> Result<(Lookup, String), Error> {
        let finder = Finder { documents: self, shelf: &Shelf::default(), remembered: None };
        let (name, revision) = match model::asked(name) {
            Some((name, revision)) => (name, revision),
            None => (name.to_owned(), None),
        };
        let asked = Asked { kind, pointer: String::new(), name, revision };
        let looked = finder.record(&asked).now_or_never().unwrap_or(Err(Error::Cancelled))?;
        Ok((looked.lookup, looked.sha256))
    }

    /// The records of a kind that a text fits, or all: own ones, then the engine's.
    pub fn list(&self, kind: precut_library::Kind, text: Option<&str>) -> Result<Vec<Arc<Record>>, Error> {
        let own = self.of(kind_of(kind)).map(|kept| of_json(kind, &kept.name, &kept.content).map(Arc::new));
        let mut all: Vec<Arc<Record>> = own.collect::<Result<_, _>>()?;
        all.extend(built_in::records(kind).iter().cloned());
        let Some(text) = text else { return Ok(all) };
        let mut index = search::Index::default();
        for record in &all {
            index.add(&record.name, record.text("title").unwrap_or_default(), record.names().skip(1));
        }
        let found = index.find(text, all.len());
        Ok(found.into_iter().filter_map(|name| all.iter().find(|record| record.name == name).cloned()).collect())
    }

    fn of(&self, kind: Kind) -> impl Iterator<Item = &KeptDocument> {
        self.0.iter().filter(move |((of, _), _)| *of == kind).map(|(_, kept)| kept)
    }
}

type Answer<'a, T> = BoxFuture<'a, Result<T, StoreError>>;

impl DocumentShelf for Library {
    fn document(&self, kind: Kind, name: String, revision: Option<u32>) -> Answer<'_, Option<KeptDocument>> {
        let kept = self.0.get(&(kind, name)).filter(|kept| revision.is_none_or(|revision| revision == kept.revision));
        Box::pin(ready(Ok(kept.cloned())))
    }

    fn documents(&self, kind: Kind, _: String, after: String, limit: u32) -> Answer<'_, Vec<KeptDocument>> {
        let behind = self.of(kind).filter(|kept| kept.name > after).take(limit as usize);
        Box::pin(ready(Ok(behind.cloned().collect())))
    }

    fn titles(&self, kind: Kind, _: String, limit: u32) -> Answer<'_, Vec<Title>> {
        let title = |kept: &KeptDocument| {
            let value: serde_json::Value = serde_json::from_str(&kept.content).unwrap_or_default();
            let title = value.get("title").and_then(serde_json::Value::as_str).unwrap_or_default().to_owned();
            let names = value.get("names").and_then(serde_json::Value::as_object).into_iter().flatten();
            let names = names.filter_map(|(_, names)| names.as_array()).flatten().filter_map(serde_json::Value::as_str);
            let words = names.fold(title, |words, name| words + "\n" + name);
            Title { name: kept.name.clone(), class: String::new(), words }
        };
        Box::pin(ready(Ok(self.of(kind).take(limit as usize).map(title).collect())))
    }

    fn revisions(&self, kind: Kind, name: String) -> Answer<'_, Revisions> {
        let there: Vec<u32> = self.0.get(&(kind, name)).map(|kept| kept.revision).into_iter().collect();
        Box::pin(ready(Ok(Revisions { last: there.last().copied(), there })))
    }
}
