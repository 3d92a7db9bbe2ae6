//! What is said of a process and its parts, as it stands in documents: in English with its codes and numbers, and in any
//! other language from those.

use std::fmt::Write as _;

use precut_calc::process::{Outlook, State};
use serde_json::{Value, json};

use super::body::Document;
use crate::text::{Glossary, Language, Texts, reworded, within};

/// What is said of a process of a name after an entry and so many parts.
pub(super) fn state(
    (name, sequence, parts): (&str, i64, usize),
    state: &State,
    outlook: Option<&Outlook>,
    document: &Document,
) -> Value {
    let texts = Texts::shared();
    let english = Language::default();
    let mut said = json!(state);
    let last = said.as_object_mut().and_then(|fields| fields.remove("number")).unwrap_or_default();
    let remarks: Vec<_> = state.explanation.iter().map(|message| texts.remark(english, message)).collect();
    said["explanation"] = json!(remarks);
    said["process"] = json!(name);
    said["sequence"] = json!(sequence);
    said["parts"] = json!(parts);
    said["last_number"] = last;
    if document.is_stopped() {
        said["state"] = json!("stopped");
    } else if let Some(outlook) = outlook {
        let told = json!(outlook);
        for (field, value) in told.as_object().into_iter().flatten() {
            said[field] = value.clone();
        }
        said["model"]["name"] = json!(name);
        said["action"]["reason"] = json!(texts.remark(english, &outlook.action.message()));
        said["action"]["next"] = json!(format!("/v1/processes/{name}/next"));
    }
    said
}

/// What is said now of one part.
pub(super) fn now(state: &State) -> Value {
    json!({
        "state": state.state,
        "unused": state.unused,
        "evidence": state.evidence,
        "score": state.score,
        "change": state.change.as_ref().map(|change| &change.id),
    })
}

/// What is new with a part beside what was said before: words of events.
pub(super) fn news(before: Option<&State>, now: &State, replayed: usize) -> Vec<&'static str> {
    let accepted = |state: &State| state.changes.iter().filter(|change| change.accepted).count();
    let reported = |state: &State| state.changes.last().map(|change| change.id.clone());
    let mut news = Vec::new();
    if replayed > 0 {
        news.push("replayed");
    }
    if json!(now.state) == "warning" {
        news.push("warning");
    }
    if reported(now).is_some() && before.and_then(reported) != reported(now) {
        news.push("change");
    }
    if before.map_or(0, accepted) < accepted(now) {
        news.push("accepted");
    }
    if before.map_or(0, |state| state.odd_parts.len()) < now.odd_parts.len() {
        news.push("odd_part");
    }
    news
}

/// What the causes of a change or of a model are called, with the form that tells one from another of its kind.
fn name_causes(causes: Option<&mut Value>, language: Language) {
    let glossary = Glossary::of(language);
    for cause in causes.and_then(Value::as_array_mut).into_iter().flatten() {
        let Some(mut text) = cause["kind"].as_str().map(|kind| glossary.name(kind)) else { continue };
        for own in cause["shape"].as_array().into_iter().flatten() {
            let (Some(parameter), Some(unit)) = (own["parameter"].as_str(), own["unit"].as_str()) else { continue };
            let name = within(&glossary.label("", parameter, Some(unit)));
            let _ = write!(text, ", {name} {} {}", own["value"], glossary.unit(unit));
        }
        cause["text"] = json!(text);
    }
}

/// What was said, in that language.
pub(crate) fn in_language(mut said: Value, language: Language) -> Value {
    for place in ["/change/causes", "/model/sizes"] {
        name_causes(said.pointer_mut(place), language);
    }
    let changes = said.get_mut("changes").and_then(Value::as_array_mut);
    changes.into_iter().flatten().for_each(|change| name_causes(change.get_mut("causes"), language));
    if language == Language::default() {
        return said;
    }
    let again = |remarks: &Value| {
        let text = reworded("explanation", remarks.to_string().as_bytes(), language)?;
        serde_json::from_slice::<Value>(&text).ok()
    };
    if let Some(remarks) = said.get("explanation").and_then(again) {
        said["explanation"] = remarks;
    }
    let reason = said.pointer("/action/reason").map(|reason| json!([reason]));
    if let Some(reason) = reason.as_ref().and_then(again) {
        said["action"]["reason"] = reason[0].clone();
    }
    said
}
