//! Looking names up: among the records of the engine, and among the own ones of whoever asks.

use std::collections::HashMap;
use std::sync::{Arc, LazyLock};

use precut_library::record::{Record, is_name};
use precut_library::resolve::Revision;
use precut_library::search::{fold, nearest};
use precut_library::{Asked, Kind, Lookup, Resource, built_in};
use quick_cache::Weighter;
use quick_cache::sync::Cache;
use serde_json::Value;

use super::{Found, Looked, asked, model_of_machine, place};
use crate::engine::library::{Index, kind_of, of_json};
use crate::engine::model::{self, FoundModel};
use crate::engine::{Error, Shelf};
use crate::registry::{Entry, Registry, canonical};
use crate::store::documents::{self, DocumentShelf};

/// Names that are looked through for one like an unknown name.
const NEAR_NAMES: u32 = 1000;

/// What a job names.
#[derive(Debug, Default)]
pub(crate) struct Asks {
    records: Vec<Asked>,
    /// A stored model.
    model: Option<String>,
    /// Whose models machines may bring along, where the job says none itself.
    calculators: Vec<String>,
}

impl Asks {
    /// The names in a job as it came.
    pub(crate) fn of(registry: &Registry, entry: &Entry, job: &mut Value) -> Self {
        let model = model::named(registry, entry, job);
        let records = asked(registry, entry, job);
        let calculators = if records.is_empty() { Vec::new() } else { of_models(registry, entry, job) };
        Self { records, model, calculators }
    }

    /// The stored model that the job names.
    pub(crate) fn model(&self) -> Option<&str> {
        self.model.as_deref()
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.records.is_empty() && self.model.is_none()
    }
}

/// The calculator whose jobs a machine's model would extend here.
fn of_models(registry: &Registry, entry: &Entry, job: &Value) -> Vec<String> {
    if let Some((_, calculator)) = place(entry, job) {
        return vec![calculator];
    }
    let inner = job.get("calculator").and_then(Value::as_str).and_then(|name| registry.entry(name));
    let place = inner.zip(job.get("job")).and_then(|(entry, job)| place(entry, job));
    place.map(|(_, calculator)| calculator).into_iter().collect()
}

/// A record by kind and name, of a revision or the newest.
type Wanted = (documents::Kind, String, Option<u32>);

/// Records that were looked up lately, each with the generation that it holds for.
pub(crate) struct Remembered {
    records: Cache<Wanted, (u64, Arc<Outcome>), Bytes>,
    indices: Cache<(documents::Kind, String), (u64, Arc<Index>), Bytes>,
}

/// What came of looking for an own record: nothing where there never was one.
struct Outcome {
    found: Option<(Lookup, String)>,
    /// Of its text.
    bytes: usize,
}

#[derive(Clone)]
struct Bytes;

impl<K> Weighter<K, (u64, Arc<Outcome>)> for Bytes {
    fn weight(&self, _: &K, (_, outcome): &(u64, Arc<Outcome>)) -> u64 {
        /// A record as a tree takes several times its text.
        const TREE: usize = 4;
        (256 + TREE * outcome.bytes) as u64
    }
}

impl<K> Weighter<K, (u64, Arc<Index>)> for Bytes {
    fn weight(&self, _: &K, (_, index): &(u64, Arc<Index>)) -> u64 {
        index.bytes() as u64
    }
}

impl Default for Remembered {
    fn default() -> Self {
        /// For records, and for indices: each of these.
        const MOST_BYTES: u64 = 32 << 20;
        Self {
            records: Cache::with_weighter(1024, MOST_BYTES, Bytes),
            indices: Cache::with_weighter(64, MOST_BYTES, Bytes),
        }
    }
}

/// Where names are looked up.
pub(crate) struct Finder<'a, S: ?Sized> {
    pub(crate) documents: &'a S,
    pub(crate) shelf: &'a Shelf,
    /// What is remembered, and the generation for which it has to hold; none where nothing is.
    pub(crate) remembered: Option<(&'a Remembered, u64)>,
}

impl<S: DocumentShelf + ?Sized> Finder<'_, S> {
    /// What is known of all names of a job.
    pub(crate) async fn all(&self, asks: &Asks) -> Result<Found, Error> {
        let mut found = Found::default();
        for asked in &asks.records {
            found.records.push(self.record(asked).await?);
        }
        let mut models: Vec<String> = asks.model.iter().cloned().collect();
        for calculator in &asks.calculators {
            let of_machines = found.records.iter().filter_map(|looked| model_of_machine(calculator, looked));
            models.extend(of_machines.map(str::to_owned));
        }
        models.sort_unstable();
        models.dedup();
        for name in models {
            let Some((plain, revision)) = model::asked(&name) else { continue };
            let kept = self.documents.document(documents::Kind::Model, self.shelf.full(&plain), revision).await?;
            let model = match kept {
                Some(kept) => FoundModel::Model(Box::new(self.shelf.plain(kept))),
                None => FoundModel::Unknown(self.names(documents::Kind::Model).await?),
            };
            found.models.push((name, model));
        }
        Ok(found)
    }

    /// The names of a kind, as many as are looked through for one like another.
    pub(crate) async fn names(&self, kind: documents::Kind) -> Result<Vec<String>, Error> {
        let titles = self.documents.titles(kind, self.shelf.prefix(), NEAR_NAMES).await?;
        Ok(titles.into_iter().map(|title| title.name).collect())
    }

    /// What comes of looking a record up.
    pub(crate) async fn record(&self, asked: &Asked) -> Result<Looked, Error> {
        let (lookup, sha256) = self.look_up(asked).await?;
        Ok(Looked { kind: asked.kind, name: asked.name.clone(), revision: asked.revision, lookup, sha256 })
    }

    async fn look_up(&self, asked: &Asked) -> Result<(Lookup, String), Error> {
        if built_in::find(asked.kind, &asked.name).is_some() {
            return Ok(of_built_in(asked));
        }
        if is_name(&asked.name)
            && let Some(found) = self.own(asked.kind, &asked.name, asked.revision).await?
        {
            return Ok(found);
        }
        if asked.kind == Kind::Material
            && let Some(found) = self.called(asked).await?
        {
            return Ok(found);
        }
        let mut known: Vec<String> = self.names(kind_of(asked.kind)).await?;
        known.extend(built_in::records(asked.kind).iter().flat_map(|record| record.names()).map(str::to_owned));
        Ok((Lookup::Unknown { nearest: nearest(&asked.name, known.iter().map(String::as_str)) }, String::new()))
    }

    /// What is known of an own record; nothing where there never was one.
    async fn own(&self, kind: Kind, name: &str, revision: Option<u32>) -> Result<Option<(Lookup, String)>, Error> {
        let full = self.shelf.full(name);
        let key = (kind_of(kind), full.clone(), revision);
        if let Some((cache, generation)) = self.remembered
            && let Some((then, outcome)) = cache.records.get(&key)
            && then == generation
        {
            return Ok(outcome.found.clone());
        }
        let outcome = self.read(kind, name, full, revision).await?;
        let found = outcome.found.clone();
        if let Some((cache, generation)) = self.remembered {
            cache.records.insert(key, (generation, Arc::new(outcome)));
        }
        Ok(found)
    }

    async fn read(&self, kind: Kind, name: &str, full: String, revision: Option<u32>) -> Result<Outcome, Error> {
        if let Some(kept) = self.documents.document(kind_of(kind), full.clone(), revision).await? {
            let record = Arc::new(of_json(kind, name, &kept.content)?);
            let found = Lookup::Found(Resource { record, revision: Revision::Own(kept.revision) });
            return Ok(Outcome { bytes: kept.content.len(), found: Some((found, kept.sha256)) });
        }
        let revisions = self.documents.revisions(kind_of(kind), full).await?;
        let lookup = match (revisions.there.last(), revisions.last) {
            (Some(&last), _) => Some(Lookup::UnknownRevision { last }),
            (None, Some(_)) => Some(Lookup::Deleted),
            (None, None) => None,
        };
        Ok(Outcome { found: lookup.map(|lookup| (lookup, String::new())), bytes: 0 })
    }

    /// The material that is called so, or several.
    async fn called(&self, asked: &Asked) -> Result<Option<(Lookup, String)>, Error> {
        let mut names: Vec<String> =
            built_in::materials_called(&asked.name).iter().map(|record| record.name.clone()).collect();
        let index = self.index(asked.kind).await?;
        let own: Vec<String> = index.called(&fold(&asked.name)).to_vec();
        names.extend(own.iter().cloned());
        match (&names[..], &own[..]) {
            ([], _) => Ok(None),
            ([_], []) => Ok(Some(of_built_in(asked))),
            ([_], [own]) => self.own(asked.kind, own, asked.revision).await,
            _ => Ok(Some((Lookup::Ambiguous { candidates: names }, String::new()))),
        }
    }

    /// What own records of a kind are called.
    pub(crate) async fn index(&self, kind: Kind) -> Result<Arc<Index>, Error> {
        let key = (kind_of(kind), self.shelf.prefix());
        if let Some((cache, generation)) = self.remembered
            && let Some((then, index)) = cache.indices.get(&key)
            && then == generation
        {
            return Ok(index);
        }
        let titles = self.documents.titles(key.0, self.shelf.prefix(), u32::MAX).await?;
        let index = Arc::new(Index::of(titles));
        if let Some((cache, generation)) = self.remembered {
            cache.indices.insert(key, (generation, Arc::clone(&index)));
        }
        Ok(index)
    }
}

/// What the engine's own records say of a name.
fn of_built_in(asked: &Asked) -> (Lookup, String) {
    let lookup = Lookup::built_in(asked);
    let sha256 = match &lookup {
        Lookup::Found(resource) => sha256_of_built_in(&resource.record).to_owned(),
        _ => String::new(),
    };
    (lookup, sha256)
}

/// Hash of a built-in record: they are hashed once.
pub(crate) fn sha256_of_built_in(record: &Record) -> &'static str {
    static HASHES: LazyLock<HashMap<(Kind, String), String>> = LazyLock::new(|| {
        let all = Kind::ALL.into_iter().flat_map(|kind| built_in::records(kind).iter());
        all.map(|record| ((record.kind, record.name.clone()), hashed(&record.value))).collect()
    });
    HASHES.get(&(record.kind, record.name.clone())).map_or("", String::as_str)
}

/// SHA-256 of a record in canonical JSON.
fn hashed(value: &Value) -> String {
    let bytes = canonical(value).expect("a record came as JSON");
    model::sha256(std::str::from_utf8(&bytes).expect("JSON is UTF-8"))
}
