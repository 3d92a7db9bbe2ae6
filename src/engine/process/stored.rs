//! The stored model of a process: it bears its name, and has a revision more whenever other changes belong to it.

use std::collections::BTreeSet;

use precut_calc::process::{Change, ChangeVerdict, Decided, State};
use serde_json::{Value, json};

use super::ProcessError;
use super::live::Live;
use crate::engine::model::{self, ModelContent, UNCERTAINTY};
use crate::engine::models::renumbered;
use crate::engine::{Inner, Shelf};
use crate::store::documents::{Kind, NewDocument};

/// The field of what a model says of its origin that tells of which process it is.
const PROCESS: &str = "process";

impl Live {
    /// The model to be stored beside an addition: nothing where the same changes belong to it as before.
    pub(super) async fn stored_model(
        &self,
        full: &str,
        before: Option<&Self>,
    ) -> Result<Option<NewDocument>, ProcessError> {
        if joined(self) == before.map(joined).unwrap_or_default() {
            return Ok(None);
        }
        let Some(found) = self.found_model().await? else { return Ok(None) };
        let content = self.model_content(Shelf::split(full).1, &found);
        if content.effects.is_empty() {
            return Ok(None);
        }
        let text = content.canonical();
        Ok(Some(NewDocument {
            kind: Kind::Model,
            name: full.to_owned(),
            class: content.calculator,
            words: String::new(),
            sha256: model::sha256(&text),
            content: text,
        }))
    }

    /// What is found, as a later job takes it: without the effects that its own job has anyway.
    fn model_content(&self, name: &str, found: &Value) -> ModelContent {
        let part_type = found["part_type"].as_str().unwrap_or_default();
        let of_type = |document: &Value| document["part_types"][part_type]["job"]["effects"].as_array().cloned();
        let stated = of_type(&self.document.sent).map_or(0, |effects| effects.len());
        let own: Vec<Value> = of_type(&self.document.filled).unwrap_or_default().into_iter().take(stated).collect();
        let all = found["effects"].as_array().cloned().unwrap_or_default();
        let kept: Vec<usize> = (0..all.len()).filter(|&index| !own.contains(&all[index])).collect();
        let changes: Vec<&Change> = self.last_said().map(changes).unwrap_or_default();
        let changes: Vec<Value> = changes
            .into_iter()
            .map(|change| {
                let causes: BTreeSet<&str> = change.causes.iter().map(|cause| cause.kind.as_str()).collect();
                json!({ "id": change.id, "since_part": change.since_part, "verdict": change.verdict, "causes": causes })
            })
            .collect();
        ModelContent {
            calculator: self.document.calculator().to_owned(),
            effects: kept.iter().map(|&index| all[index].clone()).collect(),
            provenance: json!({
                PROCESS: name,
                "after_part": self.last(),
                "parts": self.count(),
                "part_type": part_type,
                "with_profile": found["with_profile"],
                "quantity": self.document.filled["quantity"],
                "extends": self.document.sent.get("model").cloned().unwrap_or(Value::Null),
                "changes": changes,
                UNCERTAINTY: renumbered(&found[UNCERTAINTY], |effect| kept.iter().position(|&index| index == effect)),
            }),
        }
    }
}

impl Inner {
    /// Whether a process of that name can store its model: nothing has its name, but for the model that a process of that name
    /// left behind.
    pub(super) async fn model_name_is_free(&self, shelf: &Shelf, name: &str) -> Result<(), ProcessError> {
        let there = self.documents.document(Kind::Model, shelf.full(name), None).await?;
        let is_own = |kept| ModelContent::read(kept).is_some_and(|content| content.provenance[PROCESS] == name);
        if there.as_ref().is_none_or(is_own) { Ok(()) } else { Err(ProcessError::ModelTaken(name.to_owned())) }
    }
}

/// The changes that belong to the model.
fn changes(state: &State) -> Vec<&Change> {
    state.changes.iter().filter(|change| change.accepted && change.decided != Some(Decided::Rejected)).collect()
}

/// What tells one set of them from another: a change that later parts name is another one.
fn joined(live: &Live) -> Vec<(String, u32, ChangeVerdict, Option<Decided>)> {
    let changes = live.last_said().map(changes).unwrap_or_default();
    changes.into_iter().map(|change| (change.id.clone(), change.since_part, change.verdict, change.decided)).collect()
}
