//! Stored models in jobs. A job names a model; when it is accepted the model's effects join the job's own and the name
//! becomes `{name, revision, sha256}`, so that a model that is revised or deleted later changes no accepted job.

use std::borrow::Cow;
use std::fmt::Write as _;

use precut_calc::calculator::{Failure, Finding, Message, Monitor, Violations};
use precut_calc::diagnosis::{JointUncertainty, ParameterMove};
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value, json};
use sha2::{Digest, Sha256};

use super::Quiet;
use super::names::Found;
use super::read::Ready;
use crate::registry::{Entry, ModelUse, Prepared, Registry, canonical, child, nearest, way};
use crate::store::documents::KeptDocument;
use crate::text::significant;

/// The field of a job that names a model.
const MODEL: &str = "model";
const EFFECTS: &str = "effects";
/// The field of a diagnosis, and of what a model says of its origin, that tells how unsure effects are.
pub(super) const UNCERTAINTY: &str = "effects_uncertainty";
/// The fields of a job that say the same of its own effects: a block, and the list in it.
const DOUBT: &str = "uncertainty";
/// The field that holds the base job of a diagnosis or a study.
const JOB: &str = "job";
/// The field by which a diagnosis or a study names the calculator of its base job.
const CALCULATOR: &str = "calculator";
/// Letters of a name at most.
const MOST_LETTERS: usize = 64;

/// A model as an accepted job holds it.
#[derive(Debug, Clone, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Held {
    pub(crate) name: String,
    pub(crate) revision: u32,
    pub(crate) sha256: String,
    /// So many of the job's effects, the last ones, are the model's.
    pub(crate) effects: usize,
}

/// What a model says: the part of it that its hash covers.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub struct ModelContent {
    /// Whose jobs it extends.
    pub calculator: String,
    /// The effects that it adds to a job.
    pub effects: Vec<Value>,
    /// Where it comes from.
    pub provenance: Value,
}

impl ModelContent {
    /// As it is kept and hashed.
    pub(crate) fn canonical(&self) -> String {
        let bytes = canonical(self).expect("effects and provenance came as JSON");
        String::from_utf8(bytes).expect("JSON is UTF-8")
    }
    pub(crate) fn read(kept: &KeptDocument) -> Option<Self> {
        serde_json::from_str(&kept.content).ok()
    }

    /// How unsure its effects are, by its diagnosis. What says so of no number of theirs says nothing.
    fn unsure(&self) -> Vec<JointUncertainty> {
        let stated = self.provenance.get(UNCERTAINTY).cloned().unwrap_or_default();
        let stated: Vec<JointUncertainty> = serde_json::from_value(stated).unwrap_or_default();
        let is_there = |own: &ParameterMove| {
            let effect = (own.effect as usize).checked_sub(1).and_then(|index| self.effects.get(index));
            effect.and_then(|effect| effect.pointer(&format!("/{}", own.parameter))).is_some_and(Value::is_number)
        };
        stated.into_iter().filter(|entry| entry.moves.iter().all(is_there)).collect()
    }
}

/// SHA-256 of a text, hexadecimal.
pub(crate) fn sha256(text: &str) -> String {
    Sha256::digest(text.as_bytes()).iter().fold(String::new(), |mut hex, byte| {
        let _ = write!(hex, "{byte:02x}");
        hex
    })
}

/// A name with the revision asked for, `name` or `name@3`.
pub(crate) fn asked(text: &str) -> Option<(String, Option<u32>)> {
    let (name, revision) = match text.split_once('@') {
        None => (text, None),
        Some((name, digits)) => {
            let plain = digits.bytes().all(|digit| digit.is_ascii_digit()) && !digits.starts_with('0');
            (name, Some(digits.parse().ok().filter(|_| plain)?))
        }
    };
    is_name(name).then(|| (name.to_owned(), revision))
}

/// Whether a text can name a model.
pub(crate) fn is_name(text: &str) -> bool {
    let plain = |byte: u8| byte.is_ascii_lowercase() || byte.is_ascii_digit();
    text.len() <= MOST_LETTERS
        && text.bytes().next().is_some_and(plain)
        && text.bytes().all(|byte| plain(byte) || byte == b'_' || byte == b'-')
}

/// Where a job names a model and has its effects.
struct Places {
    /// Fields that lead to the object with the name.
    model: Vec<&'static str>,
    /// Fields that lead to the object with the effects.
    effects: Vec<&'static str>,
    calculator: String,
    /// Whether the object with the effects says what is not known of them.
    takes_open_effects: bool,
}

/// `None` where this job cannot name one.
fn places(registry: &Registry, entry: &Entry, job: &Value) -> Option<Places> {
    if entry.model_use() != ModelUse::Within {
        return places_in(entry, job);
    }
    let inner = registry.entry(of_base(job)?)?;
    let mut places = places(registry, inner, job.get(JOB)?)?;
    places.model.insert(0, JOB);
    places.effects.insert(0, JOB);
    Some(places)
}

/// The same of a job that is no study.
fn places_in(entry: &Entry, job: &Value) -> Option<Places> {
    match entry.model_use() {
        ModelUse::None | ModelUse::Within => None,
        ModelUse::OfJob => Some(Places {
            model: vec![],
            effects: vec![],
            calculator: entry.meta().id.to_owned(),
            takes_open_effects: entry.takes_open_effects(),
        }),
        // A diagnosis is told itself, beside its base job.
        ModelUse::OfBase => Some(Places {
            model: vec![],
            effects: vec![JOB],
            calculator: of_base(job)?.to_owned(),
            takes_open_effects: false,
        }),
    }
}

fn of_base(job: &Value) -> Option<&str> {
    job.get(CALCULATOR)?.as_str()
}

fn within<'a>(job: &'a mut Value, path: &[&str]) -> Option<&'a mut Map<String, Value>> {
    path.iter().try_fold(job, |value, name| value.get_mut(name))?.as_object_mut()
}

fn pointer(path: &[&str], name: &str) -> String {
    path.iter().chain([&name]).fold(String::new(), |pointer, part| child(&pointer, part))
}

/// The model that a job as it came names, without looking at the rest of it.
pub(crate) fn named(registry: &Registry, entry: &Entry, job: &mut Value) -> Option<String> {
    let places = places(registry, entry, job)?;
    Some(within(job, &places.model)?.get(MODEL)?.as_str()?.to_owned())
}

/// Puts the name of a model into a job that names none. A fault where the job names another, or cannot name one.
pub(crate) fn impose(registry: &Registry, entry: &Entry, job: &mut Value, given: &KeptDocument) -> Option<Finding> {
    let Some(places) = places(registry, entry, job) else {
        let finding = Finding::new("job_without_model", "").with("name", given.name.clone());
        return Some(finding.with("calculator", entry.meta().id));
    };
    let at = pointer(&places.model, MODEL);
    // What is no object is the schema's to refuse.
    let fields = within(job, &places.model)?;
    match fields.get(MODEL).and_then(Value::as_str) {
        None => {
            fields.insert(MODEL.to_owned(), json!(given.name));
            None
        }
        Some(named) => {
            let same = asked(named).is_some_and(|(name, revision)| {
                name == given.name && revision.is_none_or(|revision| revision == given.revision)
            });
            (!same).then(|| {
                Finding::new("model_not_given", at)
                    .with("name", named.to_owned())
                    .with("given", format!("{}@{}", given.name, given.revision))
            })
        }
    }
}

/// What the store knows of a name.
#[derive(Debug, Clone, PartialEq)]
pub(crate) enum FoundModel {
    /// This one.
    Model(Box<KeptDocument>),
    /// None of that name; these are there.
    Unknown(Vec<String>),
}

/// Puts the effects of the model that a job names to the job's own. Faults where that cannot be.
pub(crate) fn extend(registry: &Registry, found: &Found, entry: &Entry, job: &mut Value) -> Vec<Finding> {
    extend_with(found, places(registry, entry, job), job)
}

fn extend_with(found: &Found, places: Option<Places>, job: &mut Value) -> Vec<Finding> {
    let Some(places) = places else { return Vec::new() };
    let at = pointer(&places.model, MODEL);
    let Some(asked) = within(job, &places.model).and_then(|fields| fields.get(MODEL)).cloned() else {
        return Vec::new();
    };
    let Value::String(name) = asked else {
        // Only what was resolved here may stand in the form of a resolved model.
        return vec![Finding::new("model_not_a_name", at)];
    };
    if self::asked(&name).is_none() {
        return vec![Finding::new("bad_model_name", at).with("name", name)];
    }
    let kept = match found.model(&name) {
        Some(FoundModel::Model(kept)) => kept,
        Some(FoundModel::Unknown(known)) => {
            let finding = Finding::new("unknown_model", at).with("name", name.clone());
            let near = nearest(&name, known.iter().map(String::as_str)).map(str::to_owned);
            return vec![near.into_iter().fold(finding, |finding, near| finding.with("nearest", near))];
        }
        None => return vec![Finding::new("no_models_here", at).with("name", name)],
    };
    if kept.class != places.calculator {
        return vec![
            Finding::new("model_of_another_calculator", at)
                .with("name", name)
                .with("of", kept.class.clone())
                .with("calculator", places.calculator),
        ];
    }
    let Some(content) = ModelContent::read(kept) else {
        return vec![Finding::new("unknown_model", at).with("name", name)];
    };
    let held = Held {
        name: kept.name.clone(),
        revision: kept.revision,
        sha256: kept.sha256.clone(),
        effects: content.effects.len(),
    };
    let unsure = content.unsure();
    match join(job, &places, content.effects) {
        Ok(before) => {
            if let Some(fields) = within(job, &places.model) {
                fields.insert(MODEL.to_owned(), json!(held));
                // A diagnosis has its base job inside it.
                if places.effects.len() > places.model.len() {
                    tell(fields, UNCERTAINTY, unsure, before);
                } else if places.takes_open_effects && !unsure.is_empty() {
                    // What is no object is the schema's to refuse.
                    if let Value::Object(doubt) = fields.entry(DOUBT).or_insert_with(|| json!({})) {
                        tell(doubt, EFFECTS, unsure, before);
                    }
                }
            }
            Vec::new()
        }
        Err(faults) => faults,
    }
}

/// The same for a point of a study, whose model may be resolved already; its calculator takes the models of its own jobs, or of
/// its base.
pub(crate) fn extend_point(found: &Found, entry: &Entry, job: &mut Value) -> Vec<Finding> {
    if job.get(MODEL).is_some_and(Value::is_string) {
        extend_with(found, places_in(entry, job), job)
    } else {
        Vec::new()
    }
}

fn kind(effect: &Value) -> Option<&str> {
    effect.get("kind")?.as_str()
}

/// Appends how unsure the effects of the model are, which stand behind so many others, to a list.
fn tell(fields: &mut Map<String, Value>, list: &str, unsure: Vec<JointUncertainty>, before: usize) {
    let behind = |own: ParameterMove| ParameterMove {
        effect: own.effect.saturating_add(u32::try_from(before).unwrap_or(u32::MAX)),
        ..own
    };
    let moved =
        unsure.into_iter().map(|entry| json!({ "moves": entry.moves.into_iter().map(behind).collect::<Vec<_>>() }));
    // What is no list is the schema's to refuse.
    if let Value::Array(stated) = fields.entry(list).or_insert_with(|| json!([])) {
        stated.extend(moved);
    }
}

/// Appends the model's effects, and tells behind how many. One that the job has already is a fault.
fn join(job: &mut Value, places: &Places, effects: Vec<Value>) -> Result<usize, Vec<Finding>> {
    let at = pointer(&places.effects, EFFECTS);
    // What is no object or no list is the schema's to refuse.
    let Some(fields) = within(job, &places.effects) else { return Ok(0) };
    let Value::Array(own) = fields.entry(EFFECTS).or_insert_with(|| json!([])) else { return Ok(0) };
    let mut violations = Violations::default();
    for (index, one) in own.iter().enumerate() {
        let both = kind(one).filter(|own| effects.iter().any(|effect| kind(effect) == Some(own)));
        if let Some(kind) = both {
            violations.add(Finding::new("effect_in_both", format!("{at}/{index}/kind")).with("kind", kind.to_owned()));
        }
    }
    let violations = violations.into_vec();
    if !violations.is_empty() {
        return Err(violations);
    }
    let before = own.len();
    own.extend(effects);
    Ok(before)
}

/// Whether a way through a job leads to the model that it names, or into it.
pub(crate) fn is_its_place(entry: &Entry, tokens: &[String]) -> bool {
    matches!(entry.model_use(), ModelUse::OfJob | ModelUse::OfBase)
        && tokens.first().is_some_and(|first| first == MODEL)
}

/// A job without its model, and that model where it is resolved.
pub(crate) fn split<'a>(entry: &Entry, job: &'a Value) -> (Cow<'a, Value>, Option<Held>) {
    let names_one = matches!(entry.model_use(), ModelUse::OfJob | ModelUse::OfBase) && job.get(MODEL).is_some();
    if !names_one {
        return (Cow::Borrowed(job), None);
    }
    let mut job = job.clone();
    let held = job.as_object_mut().and_then(|fields| fields.remove(MODEL));
    (Cow::Owned(job), held.and_then(|held| serde_json::from_value(held).ok()))
}

/// The same with the model in it again.
pub(crate) fn with_model(mut job: Value, held: &Held) -> Value {
    if let Value::Object(fields) = &mut job {
        fields.insert(MODEL.to_owned(), json!(held));
    }
    job
}

/// A filled job with the model in it, as RFC 8785 writes it.
pub(crate) fn canonical_with(job: &[u8], held: &Held) -> Result<Vec<u8>, String> {
    let job: Value = serde_json::from_slice(job).map_err(|error| format!("a filled job: {error}"))?;
    canonical(&with_model(job, held)).map_err(|error| format!("a filled job with its model: {error}"))
}

/// A kept job without the resolved model in it.
pub(crate) fn without_model<'a>(entry: &Entry, input: &'a [u8]) -> Cow<'a, [u8]> {
    if super::json::top_level_field(input, MODEL).is_none() {
        return Cow::Borrowed(input);
    }
    let Ok(job) = serde_json::from_slice::<Value>(input) else { return Cow::Borrowed(input) };
    match split(entry, &job) {
        (job, Some(_)) => serde_json::to_vec(&*job).map_or(Cow::Borrowed(input), Cow::Owned),
        (_, None) => Cow::Borrowed(input),
    }
}

/// Faults in effects that are the model's are the model's faults.
pub(crate) fn pointed_at_model(entry: &Entry, job: &Value, held: Option<&Held>, finding: Finding) -> Finding {
    let Some(held) = held else { return finding };
    let effects_in = if entry.model_use() == ModelUse::OfBase { vec![JOB] } else { vec![] };
    let list = effects_in.iter().try_fold(job, |value, name| value.get(name)).and_then(|job| job.get(EFFECTS));
    let count = list.and_then(Value::as_array).map_or(0, Vec::len);
    let index = finding
        .pointer
        .strip_prefix(&format!("{}/", pointer(&effects_in, EFFECTS)))
        .and_then(|rest| rest.split('/').next()?.parse::<usize>().ok());
    match index {
        Some(index) if index + held.effects >= count => Finding { pointer: pointer(&[], MODEL), ..finding },
        _ => finding,
    }
}

/// The job that a model extends, ready to show what the extension changes.
pub(crate) fn base(entry: &Entry, job: &Value, held: &Held) -> Option<Prepared> {
    if entry.model_use() != ModelUse::OfJob {
        return None;
    }
    let mut job = job.clone();
    let effects = job.get_mut(EFFECTS)?.as_array_mut()?;
    effects.truncate(effects.len().saturating_sub(held.effects));
    let left = effects.len();
    if let Some(open) = job.get_mut(DOUBT).and_then(|doubt| doubt.get_mut(EFFECTS)).and_then(Value::as_array_mut) {
        open.retain(|entry| is_of_first(entry, left));
    }
    entry.prepare(&job).ok()
}

/// Whether all that an entry of what is not known tells of is among the first effects.
fn is_of_first(entry: &Value, effects: usize) -> bool {
    let own = serde_json::from_value::<JointUncertainty>(entry.clone());
    own.is_ok_and(|own| own.moves.iter().all(|own| own.effect as usize <= effects))
}

/// Digits in which numbers with and without a model are told.
const DIGITS_TOLD: usize = 4;

/// A unit that another field of the result says (`as objective_unit says`), or the unit itself.
fn said_beside(result: &Value, pointer: &str, unit: String) -> String {
    let Some(name) = unit.strip_prefix("as ").and_then(|rest| rest.strip_suffix(" says")) else { return unit };
    let place = pointer.rsplit_once('/').map_or("", |(parent, _)| parent);
    result.pointer(&child(place, name)).and_then(Value::as_str).unwrap_or("1").to_owned()
}

/// What the model changed: the numbers that a study would show, with it and without it, where they differ. A failure
/// only where nobody waits for it any more: a job without the model may take as long as with it.
pub(crate) fn changes(ready: &Ready, result: &[u8], monitor: &dyn Monitor) -> Result<Vec<Message>, Failure> {
    let (Some(held), Some(base)) = (&ready.model, &ready.base) else { return Ok(Vec::new()) };
    let name = format!("{}@{}", held.name, held.revision);
    let Ok(result) = serde_json::from_slice::<Value>(result) else { return Ok(Vec::new()) };
    let mut text = Vec::new();
    match base.run(&Quiet(monitor), &mut text) {
        Ok(_) => {}
        Err(Failure::Cancelled) => return Err(Failure::Cancelled),
        Err(_) => return Ok(vec![Message::new("model_alone_answers").with("model", name)]),
    }
    let Ok(without) = serde_json::from_slice::<Value>(&text) else { return Ok(Vec::new()) };
    let document = ready.entry.output_document();
    let changed = |pointer: &&'static str| {
        let number = |result: &Value| result.pointer(pointer).and_then(Value::as_f64);
        let (with, without) = (number(&result)?, number(&without)?);
        // What is the same in the digits that are told did not change.
        if significant(with, DIGITS_TOLD) == significant(without, DIGITS_TOLD) {
            return None;
        }
        let tokens: Vec<String> = pointer.split('/').skip(1).map(str::to_owned).collect();
        let message = Message::new("model_changed").with("model", name.clone()).with("output", *pointer);
        let way = way(&document, ready.entry.meta().id, &tokens);
        let message = message.with("name", way.steps.join("/"));
        let unit = way.unit.map_or_else(|| "1".to_owned(), |unit| said_beside(&result, pointer, unit));
        Some(message.with("unit", unit).with("with", with).with("without", without))
    };
    let said: Vec<Message> = ready.entry.meta().study_outputs.iter().filter_map(changed).collect();
    Ok(if said.is_empty() { vec![Message::new("model_changed_nothing").with("model", name)] } else { said })
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    #[test]
    fn names_and_revisions_are_read() {
        assert_eq!(asked("lathe-7"), Some(("lathe-7".to_owned(), None)));
        assert_eq!(asked("lathe-7@12"), Some(("lathe-7".to_owned(), Some(12))));
        for bad in ["", "-a", "A", "a b", "a@", "a@0", "a@01", "a@-1", "a@x", "a@1@2", "ä", &"a".repeat(65)] {
            assert_eq!(asked(bad), None, "{bad}");
        }
        assert!(is_name(&"a".repeat(64)));
    }

    #[test]
    fn a_hash_is_that_of_the_standard() {
        // FIPS 180-4, the example "abc".
        assert_eq!(sha256("abc"), "ba7816bf8f01cfea414140de5dae2223b00361a396177a9cb410ff61f20015ad");
    }
}
