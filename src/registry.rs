//! Calculators by name, their types closed over.
//!
//! One line in `precut_calc::register` makes a calculator known; everything that the service needs of it
//! follows from its [`Calculator`] declaration through [`Entry`].

use std::collections::BTreeMap;
use std::sync::Arc;

use precut_calc::calculator::{Calculator, Meta, Registrar};
use serde_json::Value;
use utoipa::openapi::{RefOr, Schema};

/// Names under `/v1/` that the service itself uses: no calculator may have one of them.
pub const RESERVED: [&str; 6] = ["jobs", "results", "studies", "models", "materials", "calculators"];

/// Every calculator, in the order in which they are offered. Cheap to clone.
#[derive(Clone)]
pub struct Registry {
    entries: Arc<Vec<Arc<Entry>>>,
    by_id: Arc<BTreeMap<&'static str, usize>>,
}

/// Why a set of calculators is none.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum RegistryError {
    /// A calculator's id is one of [`RESERVED`].
    #[error("the calculator's id {0:?} is a route of the service itself")]
    Reserved(&'static str),
}

impl Registry {
    /// The calculators of `precut_calc`.
    pub fn standard() -> Result<Self, RegistryError> {
        Self::with(|offered| precut_calc::register(offered))
    }
    /// The calculators that `offer` names.
    pub fn with(offer: impl FnOnce(&mut Offered)) -> Result<Self, RegistryError> {
        let mut offered = Offered;
        offer(&mut offered);
        Ok(Self { entries: Arc::default(), by_id: Arc::default() })
    }
    /// All of them.
    pub fn entries(&self) -> &[Arc<Entry>] {
        &self.entries
    }
    /// The one of that id.
    pub fn entry(&self, id: &str) -> Option<&Arc<Entry>> {
        self.by_id.get(id).map(|&index| &self.entries[index])
    }
    /// The id most like `name`, if one is like it at all.
    pub fn nearest(&self, _name: &str) -> Option<&'static str> {
        None
    }
}

/// Takes calculators in.
pub struct Offered;

impl Registrar for Offered {
    fn calculator<C: Calculator>(&mut self) {}
}

/// One calculator with its types closed over.
pub struct Entry {
    meta: Meta,
    input: Contract,
    output: Contract,
}

/// A type's schema, in the two forms in which it is asked for.
pub struct Contract {
    schema: RefOr<Schema>,
    components: Vec<(String, RefOr<Schema>)>,
    document: Value,
}

impl Entry {
    /// What stands on the door.
    pub fn meta(&self) -> &Meta {
        &self.meta
    }
    /// Schema of the job for the OpenAPI document; refers to [`Entry::components`].
    pub fn input_schema(&self) -> &RefOr<Schema> {
        &self.input.schema
    }
    /// Schema of the result for the OpenAPI document; refers to [`Entry::components`].
    pub fn output_schema(&self) -> &RefOr<Schema> {
        &self.output.schema
    }
    /// Every component that either schema refers to, by name, each name once.
    pub fn components(&self) -> Vec<(String, RefOr<Schema>)> {
        let mut all: BTreeMap<String, RefOr<Schema>> = self.input.components.iter().cloned().collect();
        all.extend(self.output.components.iter().cloned());
        all.into_iter().collect()
    }
    /// Self-contained JSON Schema (2020-12) of the job.
    pub fn input_document(&self) -> &Value {
        &self.input.document
    }
    /// Self-contained JSON Schema (2020-12) of the result.
    pub fn output_document(&self) -> &Value {
        &self.output.document
    }
    /// Whether the job takes measured tables (CSV in place, or file parts).
    pub fn takes_tables(&self) -> bool {
        false
    }
}
