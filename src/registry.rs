//! Calculators by name, their types closed over.
//!
//! One line in `precut_calc::register` makes a calculator known; everything that the service needs of it
//! follows from its [`Calculator`] declaration through [`Entry`].

mod calculation;
mod canonical;
mod checker;
mod contract;
mod entry;
mod family;
mod fault;
mod names;
mod nearest;
mod place;
mod result_text;
mod schema;
mod shape;
#[cfg(test)]
mod tests;
#[cfg(test)]
pub(crate) mod toy;
mod typed;
mod watched;
mod way;

use entry::Member;

pub use calculation::{Prepared, ResultNotes, UnreadableResult};
pub use entry::{Entry, Schemas};

pub(crate) use calculation::{Calculation, Job, Sharded, Unfinished, Unprepared};
pub(crate) use canonical::canonical;
pub(crate) use checker::{Checker, Faults, by_pointer, child};
pub(crate) use entry::ModelUse;
pub(crate) use fault::{cut_short_at, intern as interned};
pub(crate) use names::takes as takes_names;
pub(crate) use nearest::nearest;
#[cfg(test)]
pub(crate) use place::FreeColumns;
pub(crate) use place::{CellKind, Step, TableColumn, TablePlace, TextPlace};
pub(crate) use result_text::{Unwritable, append as append_result, non_finite_place};
pub(crate) use shape::Shape;
pub(crate) use typed::second_line;
pub(crate) use watched::{NotReplayed, Observed, Replayed, Watching};
pub(crate) use way::{forms, way};

use std::collections::BTreeMap;
use std::sync::Arc;

use precut_calc::calculator::{Calculator, Diagnosable, ForwardModel, Registrar, Watched};
use utoipa::openapi::{RefOr, Schema};

/// Names under `/v1/` that the service itself uses: no calculator may have one of them.
pub const RESERVED: [&str; 11] = [
    "jobs",
    "results",
    "studies",
    "models",
    "machines",
    "tools",
    "materials",
    "parts",
    "library",
    "processes",
    "calculators",
];

/// Every calculator, in the order in which they are offered. Cheap to clone.
#[derive(Clone)]
pub struct Registry {
    entries: Arc<Vec<Arc<Entry>>>,
    by_id: Arc<BTreeMap<&'static str, usize>>,
}

impl std::fmt::Debug for Registry {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_list().entries(self.by_id.keys()).finish()
    }
}

/// Why a set of calculators is none. Faults of the program, never of a user.
#[derive(Debug, Clone, PartialEq, Eq, thiserror::Error)]
pub enum RegistryError {
    /// A calculator's id is one of [`RESERVED`].
    #[error("the calculator's id {0:?} is a route of the service itself")]
    Reserved(&'static str),
    /// An id that cannot stand in an address.
    #[error("the calculator's id {0:?} is not made of lower-case letters, digits and hyphens")]
    BadId(&'static str),
    /// Two calculators have one id.
    #[error("two calculators are called {0:?}")]
    Twice(&'static str),
    /// Two types have one name in the contract.
    #[error("two types are called {component:?}, one of them in {calculator:?}")]
    ComponentClash {
        /// The name.
        component: String,
        /// The later of the two calculators.
        calculator: &'static str,
    },
    /// A schema refers to a component that is not there.
    #[error("a schema refers to the unknown component {0:?}")]
    UnknownComponent(String),
    /// A type contains itself.
    #[error("a type of a job contains itself")]
    Recursive,
    /// A measured table whose schema has no rows.
    #[error("a measured table has no rows in its schema")]
    TableWithoutRows,
    /// A schema that does not compile.
    #[error("a schema does not compile: {0}")]
    BadSchema(String),
}

impl Registry {
    /// The calculators of `precut_calc`.
    pub fn standard() -> Result<Self, RegistryError> {
        Self::with(precut_calc::register)
    }

    /// The calculators that `offer` names.
    pub fn with(offer: impl FnOnce(&mut Offered)) -> Result<Self, RegistryError> {
        let mut offered = Offered { entries: Vec::new(), diagnoses: Vec::new() };
        offer(&mut offered);
        let mut entries = offered.entries.into_iter().collect::<Result<Vec<_>, _>>()?;
        entries.extend(Entry::family(offered.diagnoses));
        let mut by_id = BTreeMap::new();
        for (index, entry) in entries.iter().enumerate() {
            let id = entry.meta().id;
            if by_id.insert(id, index).is_some() {
                return Err(RegistryError::Twice(id));
            }
        }
        Ok(Self { entries: Arc::new(entries.into_iter().map(Arc::new).collect()), by_id: Arc::new(by_id) })
    }

    /// Makes everything that is made on demand of the contracts, and says whether it fits together. A test does this: contracts
    /// follow from types alone, and it takes most of a second in a debug build.
    pub fn verify(&self) -> Result<(), RegistryError> {
        let mut components = schema::Components::new();
        self.entries.iter().try_for_each(|entry| entry.verify(&mut components))
    }

    /// All of them.
    pub fn entries(&self) -> &[Arc<Entry>] {
        &self.entries
    }

    /// The one of that id.
    pub fn entry(&self, id: &str) -> Option<&Arc<Entry>> {
        self.by_id.get(id).map(|&index| &self.entries[index])
    }

    /// What a field of a job has to be whose type, or that of its items, has that name in the contract; of the first calculator
    /// that has such a field.
    pub(crate) fn part(&self, field: &str, type_name: &str) -> Option<Checker> {
        self.entries.iter().find_map(|entry| entry.part(field, type_name))
    }

    /// The id most like `name`, if one is like it at all.
    pub fn nearest(&self, name: &str) -> Option<&'static str> {
        nearest(name, self.by_id.keys().copied())
    }

    /// What a job of `entry` may be made of; of one that is made of other calculators' jobs, whichever of them.
    pub(crate) fn shape_of<'a>(&self, entry: &'a Entry) -> &'a Shape {
        entry.shape(|| {
            let mut any = Shape::default();
            self.entries.iter().for_each(|entry| any.join(self.shape_of(entry).clone()));
            any
        })
    }

    /// Every component of every calculator by name, for the OpenAPI document. A type that occurs in a job is closed
    /// (no unknown fields), one that occurs in results only is open, so that results may grow.
    pub fn components(&self) -> Vec<(String, RefOr<Schema>)> {
        let mut all = BTreeMap::new();
        for entry in self.entries.iter() {
            all.extend(entry.output_components());
        }
        for entry in self.entries.iter() {
            all.extend(entry.input_components());
        }
        all.into_iter().collect()
    }
}

/// Takes calculators in.
pub struct Offered {
    entries: Vec<Result<Entry, RegistryError>>,
    diagnoses: Vec<Member>,
}

impl Registrar for Offered {
    fn calculator<C: Calculator>(&mut self) {
        self.entries.push(Entry::of::<C>());
    }
    fn with_forward_model<C: Calculator + ForwardModel<Job = C::Input>>(&mut self) {
        self.entries.push(Entry::with_model::<C>());
    }
    fn diagnosable<C: Diagnosable>(&mut self) {
        self.with_forward_model::<C>();
        self.diagnoses.push(Member { calculator: C::META.id, entry: Entry::of_diagnosis::<C>() });
    }
    fn watched<C: Watched>(&mut self) {
        self.diagnosable::<C>();
        if let Some(entry) = self.entries.pop() {
            self.entries.push(entry.map(Entry::watching::<C>));
        }
    }
}
