//! The bytes of an answer: what every answer has in common around a result. Nothing volatile stands in it.

use precut_calc::calculator::{Failure, Monitor};
use serde::Serialize;

use super::read::Ready;
use super::{json, model};
use crate::key::ENGINE_VERSION;
use crate::registry::{ResultNotes, append_result, non_finite_place};
use crate::text::{Language, Notice, Remark, Texts, reworded, reworded_rows};

/// Runs a job and writes the envelope of its result, in English, in one buffer from the first byte to the last.
pub(crate) fn write(ready: &Ready, monitor: &dyn Monitor) -> Result<Vec<u8>, Failure> {
    let meta = ready.entry.meta();
    let mut body = ready.entry.answer_buffer();
    body.push(b'{');
    field(&mut body, "calculator", &meta.id)?;
    field(&mut body, "version", &meta.version)?;
    field(&mut body, "engine", &ENGINE_VERSION)?;
    field(&mut body, "key", &ready.key.to_string())?;
    name(&mut body, "input");
    let begin = body.len();
    ready.write_echo(&mut body)?;
    let effects = json::top_level_field(&body[begin..], "effects").map(|place| begin + place.start..begin + place.end);
    field(&mut body, "model", &ready.model)?;
    if let Some(drawn) = &ready.drawn {
        field(&mut body, "resources", &drawn.resources)?;
        field(&mut body, "origins", &drawn.origins)?;
    }
    name(&mut body, "effects");
    match effects {
        Some(effects) => body.extend_from_within(effects),
        None => body.extend_from_slice(b"[]"),
    }
    name(&mut body, "result");
    let begin = body.len();
    let ResultNotes { mut warnings, mut explanation, basis } = ready.prepared.run(monitor, &mut body)?;
    explanation.extend(model::changes(ready, &body[begin..], monitor)?);
    if let Some(drawn) = &ready.drawn {
        explanation.extend(drawn.explanation.iter().cloned());
        warnings.extend(drawn.warnings.iter().cloned());
    }
    let texts = Texts::shared();
    let explanation: Vec<Remark> = explanation.iter().map(|message| texts.remark(Language::En, message)).collect();
    let warnings: Vec<Notice> = warnings.iter().map(|finding| texts.notice(Language::En, "warning", finding)).collect();
    if let Some(place) = non_finite_place(&explanation).or_else(|| non_finite_place(&warnings)) {
        return Err(Failure::Internal(format!("a remark of {} is not finite at {place}", meta.id)));
    }
    field(&mut body, "explanation", &explanation)?;
    field(&mut body, "warnings", &warnings)?;
    field(&mut body, "basis", &basis)?;
    body.push(b'}');
    Ok(ready.entry.answer_written(body))
}

/// An envelope with its sentences in another language; as it is where it cannot be taken apart.
pub(crate) fn in_language(body: &[u8], language: Language) -> Vec<u8> {
    let mut said = body.to_vec();
    if language == Language::default() {
        return said;
    }
    for name in ["warnings", "explanation"] {
        replace(&mut said, name, |text| reworded(name, text, language));
    }
    // Only a study's rows have sentences of their own.
    if said.starts_with(br#"{"calculator":"studies""#) {
        replace(&mut said, "result", |text| reworded_rows(text, language));
    }
    said
}

/// Puts what is made of a field of the envelope in its place.
fn replace(body: &mut Vec<u8>, name: &str, make: impl FnOnce(&[u8]) -> Option<Vec<u8>>) {
    if let Some(place) = json::top_level_field(body, name)
        && let Some(again) = make(&body[place.clone()])
    {
        body.splice(place, again);
    }
}

/// Begins a field.
fn name(body: &mut Vec<u8>, name: &str) {
    if body.len() > 1 {
        body.push(b',');
    }
    body.push(b'"');
    body.extend_from_slice(name.as_bytes());
    body.extend_from_slice(b"\":");
}

fn field<T: Serialize + ?Sized>(body: &mut Vec<u8>, called: &str, value: &T) -> Result<(), Failure> {
    name(body, called);
    append_result(body, value).map_err(|error| Failure::Internal(format!("the envelope, {called}: {error}")))
}
