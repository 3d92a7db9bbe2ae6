//! The contract of a type: its schema in the forms in which it is asked for.
//!
//! A contract is made whenever it is asked for. Kept, those of all calculators would take most of the memory of a
//! service at rest and most of the time of its start, and few of them are ever asked for.

use std::collections::BTreeMap;

use serde::de::DeserializeOwned;
use serde_json::Value;
use utoipa::ToSchema;
use utoipa::openapi::{RefOr, Schema};

use super::schema::{self, Components};
use super::{RegistryError, family, names};

/// Makes the contract of a type.
pub(super) type Make = Box<dyn Fn() -> Result<Contract, RegistryError> + Send + Sync>;

/// A type's schema with the components that it refers to.
pub(super) struct Contract {
    root: Value,
    components: Components,
    /// Before objects were closed: what makes two types of one name the same type.
    open: Components,
    /// Jobs that may name records, by the calculator whose they are: the root, or the components of that name.
    named: Vec<(Option<String>, &'static str)>,
}

/// Makes the contract of `T`, a job or a result of that calculator. `adapt` may change its root before objects are
/// closed.
pub(super) fn of<T: ToSchema>(
    calculator: &'static str,
    closed: bool,
    adapt: impl Fn(&mut Value) + Send + Sync + 'static,
) -> Make {
    Box::new(move || Contract::of::<T>(calculator, closed, &adapt))
}

impl Contract {
    fn of<T: ToSchema>(
        calculator: &'static str,
        closed: bool,
        adapt: impl Fn(&mut Value),
    ) -> Result<Self, RegistryError> {
        let broken = |error: serde_json::Error| RegistryError::BadSchema(error.to_string());
        let mut parts = Vec::new();
        T::schemas(&mut parts);
        let mut raw = Components::new();
        for (name, part) in parts {
            let part = serde_json::to_value(&part).map_err(broken)?;
            if raw.get(&name).is_some_and(|other| *other != part) {
                return Err(RegistryError::ComponentClash { component: name, calculator });
            }
            raw.insert(name, part);
        }
        let mut root = schema::tidy(&serde_json::to_value(T::schema()).map_err(broken)?, &raw);
        adapt(&mut root);
        let tidied: Components = raw.iter().map(|(name, part)| (name.clone(), schema::tidy(part, &raw))).collect();
        // Parts that were joined into others are no components of their own any more.
        let mut open = Components::new();
        schema::collect(&root, &tidied, &mut open);
        let mut components = open.clone();
        if closed {
            schema::close(&mut root);
            components.values_mut().for_each(schema::close);
        }
        let named = closed.then_some((None, calculator)).into_iter().collect();
        Ok(Self { root, components, open, named })
    }

    /// One of several contracts, by what stands in the field `calculator` of a job.
    pub(super) fn joined(
        parts: impl Iterator<Item = Result<(String, Self), RegistryError>>,
        told_apart: bool,
    ) -> Result<Self, RegistryError> {
        let (mut components, mut open) = (Components::new(), Components::new());
        let (mut names, mut named) = (Vec::new(), Vec::new());
        for part in parts {
            let (name, part) = part?;
            named.extend(part.named.into_iter().map(|(_, calculator)| (Some(name.clone()), calculator)));
            components.extend(part.components);
            open.extend(part.open);
            components.insert(name.clone(), part.root);
            names.push(name);
        }
        let root = family::one_of(&names, &components, told_apart);
        Ok(Self { root, components, open, named })
    }

    /// The schema for the OpenAPI document.
    pub(super) fn schema(&self) -> Result<RefOr<Schema>, RegistryError> {
        let mut root = self.root.clone();
        for (_, calculator) in self.named.iter().filter(|(component, _)| component.is_none()) {
            names::offer(calculator, &mut root);
        }
        typed(&root)
    }

    /// The components for the OpenAPI document.
    pub(super) fn components(&self) -> Result<BTreeMap<String, RefOr<Schema>>, RegistryError> {
        self.offered().into_iter().map(|(name, part)| Ok((name, typed(&part)?))).collect()
    }

    /// The components with names, and what stands beside them.
    fn offered(&self) -> Components {
        let mut components = self.components.clone();
        for (name, part) in &mut components {
            names::add_beside(name, part);
            names::relax(name, part);
        }
        for (component, calculator) in &self.named {
            if let Some(job) = component.as_ref().and_then(|name| components.get_mut(name)) {
                names::offer(calculator, job);
            }
        }
        if self.named.iter().any(|(_, calculator)| names::takes_any(calculator)) {
            components.extend(names::components());
        }
        components
    }

    /// The schema of a field of the job, with references followed, where the field or its items are of the type of that name.
    pub(super) fn part(&self, field: &str, type_name: &str) -> Option<Result<Value, RegistryError>> {
        let schema = self.root["properties"].get(field)?;
        let is_of_type = |part: &Value| part["$ref"].as_str().and_then(|way| way.rsplit('/').next()) == Some(type_name);
        let forms = ["oneOf", "anyOf", "allOf"].into_iter().filter_map(|word| schema[word].as_array()).flatten();
        let mut meant = forms.chain([schema, &schema["items"]]);
        meant.any(is_of_type).then(|| schema::strict(schema, &self.offered()))
    }

    /// The components before their objects were closed.
    pub(super) fn into_open(self) -> Components {
        self.open
    }

    /// The schema with its components inside it. What stands beside names is in it; names are not, which forms ask for in a
    /// way of their own.
    pub(super) fn document(&self) -> Value {
        let mut components = self.components.clone();
        for (name, part) in &mut components {
            names::add_beside(name, part);
        }
        let mut root = self.root.clone();
        if let Some((_, calculator)) = self.named.iter().find(|(component, _)| component.is_none()) {
            names::add_to_job(calculator, &mut root);
        }
        schema::standing_alone(&root, &components)
    }

    /// The schema with references followed and unions told apart.
    pub(super) fn strict(&self) -> Result<Value, RegistryError> {
        schema::strict(&self.root, &self.components)
    }
}

/// A schema that the types of the OpenAPI document hold.
fn typed<T: DeserializeOwned>(schema: &Value) -> Result<T, RegistryError> {
    T::deserialize(schema).map_err(|error| RegistryError::BadSchema(error.to_string()))
}
