//! Kept results.

use crate::engine::Key;

/// What a list of results asks for.
#[derive(Debug, Clone, Default)]
pub struct ResultQuery {
    /// Only those of this calculator.
    pub calculator: Option<String>,
    /// At most so many; 50 unless told, never above 500.
    pub limit: Option<u32>,
    /// Where the page before ended.
    pub after: Option<Cursor>,
}

/// A place in the list of results; opaque in the contract.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Cursor {
    /// Time of the last result of the page before, ms UTC.
    pub created_ms: i64,
    /// Its key.
    pub key: Key,
}

/// A page of the list, newest first.
#[derive(Debug, Clone, Default)]
pub struct ResultPage {
    /// The results.
    pub items: Vec<ResultSummary>,
    /// Where the next page begins, if there is one.
    pub next: Option<Cursor>,
}

/// A line of the list.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct ResultSummary {
    /// Its address.
    pub key: Key,
    /// Which calculator made it.
    pub calculator: String,
    /// Which version of the calculator.
    pub version: u32,
    /// Which engine.
    pub engine: String,
    /// Size of the body, bytes.
    pub bytes: u64,
    /// When it was computed, ms UTC.
    pub created_ms: i64,
}

/// Why the store did not serve.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum StoreError {
    /// The database did not answer.
    #[error("the store failed: {0}")]
    Failed(String),
    /// The kept result was made by a version whose contract differs.
    #[error("the result was made by another version of its calculator: {0}")]
    Outdated(String),
}
