//! What an entry's jobs and results look like, as the contract has it.

use std::collections::{BTreeMap, BTreeSet};

use serde_json::Value;
use utoipa::openapi::{RefOr, Schema};

use super::{Contracts, Entry, Member, Schemas, follows};
use crate::registry::checker::Checker;
use crate::registry::contract::Contract;
use crate::registry::place::{Places, places};
use crate::registry::schema::Components;
use crate::registry::{RegistryError, family};

impl Entry {
    pub(super) fn made_input(&self) -> Result<Contract, RegistryError> {
        match &self.contracts {
            Contracts::Types { input, .. } => input(),
            Contracts::Members(members) => {
                let part = |of: &Member| Ok((family::type_name(of.calculator, "DiagnosisJob"), of.entry.made_input()?));
                Contract::joined(members.iter().map(part), true)
            }
        }
    }

    pub(super) fn made_output(&self) -> Result<Contract, RegistryError> {
        match &self.contracts {
            Contracts::Types { output, .. } => output(),
            Contracts::Members(members) => {
                let part =
                    |of: &Member| Ok((family::type_name(of.calculator, "DiagnosisResult"), of.entry.made_output()?));
                Contract::joined(members.iter().map(part), false)
            }
        }
    }

    pub(super) fn input(&self) -> Contract {
        follows(self.made_input())
    }
    pub(super) fn output(&self) -> Contract {
        follows(self.made_output())
    }

    /// What jobs are held against; where stands what may come as files is read off the same schema.
    pub(super) fn checker(&self) -> &Checker {
        let made = || match self.members() {
            [] => {
                let strict = follows(self.input().strict());
                self.files.get_or_init(|| places(&strict));
                Checker::new(strict)
            }
            members => of_members(members),
        };
        self.checker.get_or_init(|| follows(made()))
    }

    /// Makes all that is made on demand, so that what cannot be made is known at once; `components` are those of the
    /// entries before.
    pub(in crate::registry) fn verify(&self, components: &mut Components) -> Result<(), RegistryError> {
        for member in self.members() {
            member.entry.verify(components)?;
        }
        let (input, output) = (self.made_input()?, self.made_output()?);
        for contract in [&input, &output] {
            contract.schema()?;
            contract.components()?;
        }
        let strict = input.strict()?;
        let _ = self.files.set(places(&strict));
        let checker = match self.members() {
            [] => Checker::new(strict),
            members => of_members(members),
        };
        let _ = self.checker.set(checker?);
        let _ = self.strict_output.set(output.strict()?);
        for (name, component) in input.into_open().into_iter().chain(output.into_open()) {
            if components.get(&name).is_some_and(|other| *other != component) {
                return Err(RegistryError::ComponentClash { component: name, calculator: self.meta.id });
            }
            components.insert(name, component);
        }
        Ok(())
    }

    /// What the OpenAPI document says of job and result.
    pub fn schemas(&self) -> Schemas {
        let made = || {
            let (input, output) = (self.made_input()?, self.made_output()?);
            let mut components = output.components()?;
            components.extend(input.components()?);
            let components = components.into_iter().collect();
            Ok(Schemas { input: input.schema()?, output: output.schema()?, components })
        };
        follows(made())
    }
    pub(in crate::registry) fn input_components(&self) -> BTreeMap<String, RefOr<Schema>> {
        follows(self.input().components())
    }
    pub(in crate::registry) fn output_components(&self) -> BTreeMap<String, RefOr<Schema>> {
        follows(self.output().components())
    }
    /// Self-contained JSON Schema (2020-12) of the job.
    pub fn input_document(&self) -> Value {
        self.input().document()
    }
    /// Self-contained JSON Schema (2020-12) of the result.
    pub fn output_document(&self) -> Value {
        self.output().document()
    }
    /// Whether the job takes measured tables (CSV in place, or file parts).
    pub fn takes_tables(&self) -> bool {
        !self.files().tables.is_empty()
    }
    /// Whether anything of the job may come as a file part.
    pub fn takes_files(&self) -> bool {
        self.takes_tables() || !self.files().texts.is_empty()
    }
    /// Names of its measured tables, with dots from the root.
    pub fn table_names(&self) -> Vec<String> {
        self.files().tables.iter().map(|place| place.way.dotted()).collect()
    }
    /// Names of its long texts that may come as file parts, in the same way.
    pub fn text_names(&self) -> Vec<String> {
        self.files().texts.iter().map(|place| place.way.dotted()).collect()
    }
    pub(super) fn files(&self) -> &Places {
        self.files.get_or_init(|| places(&follows(self.input().strict())))
    }
    /// Every code that it may utter: those of its declaration and those of its fields.
    pub fn codes(&self) -> BTreeSet<String> {
        let mut codes: BTreeSet<String> =
            self.meta.codes.all().chain(self.more_codes.iter().copied()).map(str::to_owned).collect();
        for member in self.members() {
            codes.extend(member.entry.more_codes.iter().map(|code| (*code).to_owned()));
        }
        codes_in(self.strict_input(), &mut codes);
        codes
    }
}

/// What a job is held against that names no member. One that does is held against that member's own schema: all of them
/// in one would be the largest schema of all.
fn of_members(members: &[Member]) -> Result<Checker, RegistryError> {
    Checker::new(family::told_apart(members.iter().map(|of| of.calculator)))
}

fn codes_in(schema: &Value, codes: &mut BTreeSet<String>) {
    match schema {
        Value::Object(map) => {
            if let Some(Value::String(code)) = map.get("x-code") {
                codes.insert(code.clone());
            }
            map.values().for_each(|part| codes_in(part, codes));
        }
        Value::Array(parts) => parts.iter().for_each(|part| codes_in(part, codes)),
        _ => {}
    }
}
