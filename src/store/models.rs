//! Stored models: what a diagnosis found, under a name that later jobs ask for.

use futures_util::future::BoxFuture;

use super::StoreError;
use super::quota::{Quota, Usage};

/// A model as it is kept.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct KeptModel {
    /// Its name.
    pub name: String,
    /// From 1; a revision never changes.
    pub revision: u32,
    /// Whose jobs it extends.
    pub calculator: String,
    /// Effects and provenance, canonical JSON.
    pub content: String,
    /// SHA-256 of the content, 64 hexadecimal digits.
    pub sha256: String,
    /// When it was stored, ms since 1970, UTC.
    pub created_ms: i64,
}

/// A model to be kept.
#[derive(Debug, Clone, PartialEq)]
pub struct NewModel {
    /// Its name.
    pub name: String,
    /// Whose jobs it extends.
    pub calculator: String,
    /// Effects and provenance, canonical JSON.
    pub content: String,
    /// SHA-256 of the content.
    pub sha256: String,
    /// Only if nothing has the name.
    pub only_new: bool,
    /// Who stores it: for him it counts.
    pub owner: String,
    /// What he may take.
    pub quota: Quota,
}

/// What came of a model that was to be kept.
#[derive(Debug, Clone, PartialEq)]
pub enum PutModel {
    /// It is kept.
    Kept(KeptModel),
    /// Its name is taken, and only a new one was wanted.
    Taken,
    /// For its owner so much is kept that there is no room for it.
    OverQuota(Usage),
}

/// Where models are found.
pub trait ModelShelf: Send + Sync + 'static {
    /// A revision of a model, or its newest.
    fn model(&self, name: String, revision: Option<u32>) -> BoxFuture<'_, Result<Option<KeptModel>, StoreError>>;
    /// The newest revisions of up to `limit` models of a shelf whose names follow `after`, by name. A shelf is what stands
    /// before the names, see [`crate::engine::Shelf`]; nothing behind it has a slash.
    fn models(&self, shelf: String, after: String, limit: u32) -> BoxFuture<'_, Result<Vec<KeptModel>, StoreError>>;
    /// The names of up to `limit` models of a shelf, in order.
    fn model_names(&self, shelf: String, limit: u32) -> BoxFuture<'_, Result<Vec<String>, StoreError>>;
}

/// Where models are kept.
pub trait ModelStore: ModelShelf {
    /// Keeps a model as the next revision of its name, on the disk on return.
    fn put_model(&self, model: NewModel) -> BoxFuture<'_, Result<PutModel, StoreError>>;
    /// Deletes every revision of a model; whether there was one.
    fn delete_model(&self, name: String) -> BoxFuture<'_, Result<bool, StoreError>>;
}

/// A row of the table of models that is not deleted.
#[derive(sqlx::FromRow)]
pub(super) struct ModelRow {
    name: String,
    revision: i32,
    calculator: String,
    content: String,
    sha256: String,
    created_ms: i64,
}

impl ModelRow {
    /// What came of it: a row, where one was written.
    pub(super) fn put(row: Option<Self>) -> PutModel {
        row.and_then(Self::model).map_or(PutModel::Taken, PutModel::Kept)
    }
    pub(super) fn model(self) -> Option<KeptModel> {
        Some(KeptModel {
            name: self.name,
            revision: u32::try_from(self.revision).ok()?,
            calculator: self.calculator,
            content: self.content,
            sha256: self.sha256,
            created_ms: self.created_ms,
        })
    }
}

/// A revision as a column; beyond what a column holds there is none.
pub(super) fn column(revision: Option<u32>) -> Option<i32> {
    revision.map(|revision| i32::try_from(revision).unwrap_or(i32::MAX))
}
