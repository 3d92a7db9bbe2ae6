//! Machines, tools and materials in jobs. A job names them; when it is accepted their records fill in what it leaves open,
//! and the names go: the filled job stands without them, and beside it which records it got and where each number is from.
//!
//! The rules are `precut_library`'s. Here is where names stand in jobs that hold other jobs, how they are looked up
//! ([`find`]), and how what came of them is kept ([`kept`]).

mod find;
mod given;
mod kept;

use std::borrow::Cow;

use precut_calc::calculator::{Finding, Message};
use precut_library::resolve::Revision;
use precut_library::{Asked, Kind, Lookup, Resolution, Resource};
use serde_json::{Map, Value};

use super::json;
use super::model::{self, FoundModel};
use super::study::STUDIES;
use crate::registry::{Entry, ModelUse, Registry, canonical, takes_names as takes};

pub(crate) use find::{Asks, Finder, Remembered, sha256_of_built_in};
pub use given::{Given, Library, NotGiven};

/// The field of a kept job that says which records it got.
const RESOURCES: &str = "resources";
/// The field of a kept study that holds the records that its points name.
const RECORDS: &str = "records";
const MODEL: &str = "model";
const JOB: &str = "job";
const CALCULATOR: &str = "calculator";
/// How a material was called, which is no part of what it is.
const ASKED_AS: &str = "asked_as";

/// What was found of the names of a job.
#[derive(Debug, Clone, Default)]
pub(crate) struct Found {
    /// What came of looking each record up.
    pub(crate) records: Vec<Looked>,
    /// What came of looking stored models up, by how they were asked for.
    pub(crate) models: Vec<(String, FoundModel)>,
}

/// What came of looking a record up.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Looked {
    pub(crate) kind: Kind,
    pub(crate) name: String,
    pub(crate) revision: Option<u32>,
    pub(crate) lookup: Lookup,
    /// Hash of the record; empty where there is none.
    pub(crate) sha256: String,
}

impl Found {
    fn of(&self, asked: &Asked) -> Option<&Looked> {
        let is_it = |one: &&Looked| (one.kind, &one.name, one.revision) == (asked.kind, &asked.name, asked.revision);
        self.records.iter().find(is_it)
    }

    /// What is known of the model of that name; nothing where nobody was asked.
    pub(crate) fn model(&self, asked: &str) -> Option<&FoundModel> {
        self.models.iter().find(|(name, _)| name == asked).map(|(_, found)| found)
    }
}

/// What a job got from records, for its answer.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct Drawn {
    /// Which records, by what they are.
    pub(crate) resources: Map<String, Value>,
    /// Where the numbers that records had a say in come from.
    pub(crate) origins: Value,
    pub(crate) warnings: Vec<Finding>,
    pub(crate) explanation: Vec<Message>,
}

/// The fields that lead to the job that names records, and whose job it is; `None` in a study, whose points name them, and
/// where nothing can be named.
fn place(entry: &Entry, job: &Value) -> Option<(Vec<&'static str>, String)> {
    match entry.model_use() {
        ModelUse::None | ModelUse::OfJob => Some((vec![], entry.meta().id.to_owned())),
        ModelUse::OfBase => Some((vec![JOB], job.get(CALCULATOR)?.as_str()?.to_owned())),
        ModelUse::Within => None,
    }
}

fn within<'a>(job: &'a Value, path: &[&str]) -> Option<&'a Value> {
    path.iter().try_fold(job, |value, name| value.get(name))
}

fn within_mut<'a>(job: &'a mut Value, path: &[&str]) -> Option<&'a mut Value> {
    path.iter().try_fold(job, |value, name| value.get_mut(name))
}

/// The records that a job names, at their places in it.
fn asked(registry: &Registry, entry: &Entry, job: &Value) -> Vec<Asked> {
    if entry.model_use() == ModelUse::Within {
        return asked_by_points(registry, job);
    }
    let Some((path, calculator)) = place(entry, job) else { return Vec::new() };
    let Some(inner) = within(job, &path) else { return Vec::new() };
    precut_library::asked(&calculator, inner)
}

/// The records that the points of a study name: those of its job, and those that take a name's place.
fn asked_by_points(registry: &Registry, study: &Value) -> Vec<Asked> {
    let calculator = study.get(CALCULATOR).and_then(Value::as_str).filter(|calculator| *calculator != STUDIES);
    let Some(entry) = calculator.and_then(|calculator| registry.entry(calculator)) else { return Vec::new() };
    let Some(job) = study.get(JOB) else { return Vec::new() };
    let mut found = asked(registry, entry, job);
    let variables = study.get("vary").and_then(Value::as_array);
    for variable in variables.into_iter().flatten() {
        let Some(pointer) = variable.get("pointer").and_then(Value::as_str) else { continue };
        let values = variable.get("values").and_then(Value::as_array).into_iter().flatten();
        let Some((path, of)) = place(entry, job) else { continue };
        let Some(pointer) = path.iter().try_fold(pointer, |rest, name| rest.strip_prefix('/')?.strip_prefix(name))
        else {
            continue;
        };
        for name in values.filter(|value| value.is_string()) {
            found.extend(precut_library::asked(&of, &with(within(job, &path), pointer, name)));
        }
    }
    found.sort_by(|one, other| (one.kind, &one.name, one.revision).cmp(&(other.kind, &other.name, other.revision)));
    found.dedup_by(|one, other| (one.kind, &one.name, one.revision) == (other.kind, &other.name, other.revision));
    found
}

/// The field of a job that a pointer leads into, with a value at the pointer.
fn with(job: Option<&Value>, pointer: &str, value: &Value) -> Value {
    let field = pointer.split('/').nth(1).unwrap_or_default();
    let mut part = serde_json::json!({ field: job.and_then(|job| job.get(field)) });
    let path: Vec<String> = pointer.split('/').skip(1).map(str::to_owned).collect();
    if let Some(target) = super::table::place_at(&mut part, &path) {
        *target = value.clone();
    }
    part
}

/// The model that the machine of a job brings along, by its calculator, where the job does not say one itself.
fn model_of_machine<'a>(calculator: &str, found: &'a Looked) -> Option<&'a str> {
    let Lookup::Found(resource) = &found.lookup else { return None };
    resource.record.value.get("models")?.get(calculator)?.as_str()
}

/// Names that are none: what stands in their place is no text, and no object with a name or codes. They are taken out, so
/// that nothing else is said of them.
fn malformed(calculator: &str, declared: &Value, job: &mut Value) -> Vec<Finding> {
    let Some(fields) = job.as_object_mut() else { return Vec::new() };
    let mut faults = Vec::new();
    for kind in Kind::NAMED {
        let name = kind.name();
        let is_declared = declared.get(name).is_some();
        let is_name = match fields.get(name) {
            None | Some(Value::String(_)) => true,
            Some(Value::Object(said)) => {
                let has = |field: &str| said.get(field).is_some_and(Value::is_string);
                is_declared || has("name") || (kind == Kind::Tool && (has("insert") || has("holder")))
            }
            Some(_) => is_declared,
        };
        if !is_name && takes(calculator, kind) {
            fields.shift_remove(name);
            faults.push(Finding::new("not_a_record", format!("/{name}")).with("kind", name));
        }
    }
    faults
}

/// Writes what the records of a job say into it. What it got, where it names any; and what is wrong with its names.
pub(crate) fn fill(entry: &Entry, job: &mut Value, found: &Found) -> (Option<Drawn>, Vec<Finding>) {
    let Some((path, calculator)) = place(entry, job) else { return (None, Vec::new()) };
    let prefix = path.iter().fold(String::new(), |prefix, name| prefix + "/" + name);
    let declared = entry.job_fields(&calculator);
    let Some(inner) = within_mut(job, &path) else { return (None, Vec::new()) };
    let mut faults = malformed(&calculator, declared, inner);
    let asked = precut_library::asked(&calculator, inner);
    let looked: Vec<Option<&Looked>> = asked.iter().map(|asked| found.of(asked)).collect();
    let pairs: Vec<(Asked, Lookup)> = asked
        .iter()
        .zip(&looked)
        .map(|(asked, looked)| {
            let unknown = || Lookup::Unknown { nearest: Vec::new() };
            (asked.clone(), looked.map_or_else(unknown, |looked| looked.lookup.clone()))
        })
        .collect();
    let Resolution { origins, faults: of_names, mut warnings, explanation } =
        precut_library::resolve(&calculator, inner, &pairs);
    faults.extend(of_names);
    let moved = |finding: Finding| finding.under(&prefix);
    faults = faults.into_iter().map(moved).collect();
    if origins.is_empty() && asked.is_empty() {
        return (None, faults);
    }
    if !path.is_empty() {
        lift_model(job, &path);
    }
    warnings = warnings.into_iter().map(moved).collect();
    let mut origins = serde_json::to_value(origins).unwrap_or_default();
    for origin in origins.as_array_mut().into_iter().flatten() {
        if let Some(Value::String(pointer)) = origin.get_mut("pointer") {
            pointer.insert_str(0, &prefix);
        }
    }
    let resources = asked.iter().zip(looked).filter_map(|(asked, looked)| Some(resource(asked, looked?))).flatten();
    let drawn = Drawn { resources: resources.collect(), origins, warnings, explanation };
    (Some(drawn), faults)
}

/// A base job has no place for a model: that of its machine is for the diagnosis, which may say another.
fn lift_model(job: &mut Value, path: &[&str]) {
    let taken = within_mut(job, path).and_then(Value::as_object_mut).and_then(|inner| inner.shift_remove(MODEL));
    if let (Some(name), Some(outer)) = (taken, job.as_object_mut()) {
        outer.entry(MODEL).or_insert(name);
    }
}

/// A record as an answer tells it, under what it is: a material of a part alone, under its place.
fn resource(asked: &Asked, looked: &Looked) -> Option<(String, Value)> {
    let Lookup::Found(Resource { record, revision }) = &looked.lookup else { return None };
    let place = asked.pointer.trim_end_matches("/name").trim_start_matches('/').replace('/', "_");
    let mut said = Map::new();
    said.insert("name".to_owned(), record.name.clone().into());
    match revision {
        Revision::Own(revision) => said.insert("revision".to_owned(), (*revision).into()),
        Revision::BuiltIn(version) => {
            said.insert("built_in".to_owned(), true.into());
            said.insert("data_version".to_owned(), (*version).into())
        }
    };
    said.insert("sha256".to_owned(), looked.sha256.clone().into());
    if asked.name != record.name {
        said.insert(ASKED_AS.to_owned(), asked.name.clone().into());
    }
    Some((place, said.into()))
}

/// The model that is turned off: null in its place.
pub(crate) fn turn_model_off(entry: &Entry, job: &mut Value) {
    if entry.model_use() != ModelUse::None
        && let Some(fields) = job.as_object_mut()
        && fields.get(MODEL).is_some_and(Value::is_null)
    {
        fields.shift_remove(MODEL);
    }
}

/// A job without what it got from records, and that.
pub(crate) fn split(job: &Value) -> (Cow<'_, Value>, Option<Drawn>) {
    if job.get(RESOURCES).is_none() {
        return (Cow::Borrowed(job), None);
    }
    let mut job = job.clone();
    let drawn = job.as_object_mut().and_then(|fields| fields.shift_remove(RESOURCES));
    (Cow::Owned(job), drawn.as_ref().and_then(kept::read_drawn))
}

/// The same with it again.
pub(crate) fn with_drawn(job: &mut Value, drawn: &Drawn) {
    if let Value::Object(fields) = job {
        fields.insert(RESOURCES.to_owned(), kept::drawn(drawn));
    }
}

/// A filled job in two forms, as RFC 8785 writes them: as it is kept, and what its key is of. How a material was called is
/// no part of the key, and sentences follow from the rest.
pub(crate) fn canonical_with(job: &[u8], drawn: &Drawn) -> Result<(Vec<u8>, Vec<u8>), String> {
    let text = |value: &Value| canonical(value).map_err(|error| format!("the records of a filled job: {error}"));
    let kept = json::with_top_level(job, RESOURCES, &text(&kept::drawn(drawn))?);
    let mut resources = drawn.resources.clone();
    for resource in resources.values_mut().filter_map(Value::as_object_mut) {
        resource.shift_remove(ASKED_AS);
    }
    let numbers = text(&serde_json::json!({ "resources": resources, "origins": drawn.origins }))?;
    let hashed = json::with_top_level(job, RESOURCES, &numbers);
    Ok((kept, hashed))
}

/// The records that a kept job got: `machines/NAME@REVISION` of each, all between bars, so that each can be found in it.
/// Empty where it got none.
pub(crate) fn records_of(input: &[u8]) -> String {
    let Some(place) = json::top_level_field(input, RESOURCES) else { return String::new() };
    let drawn = &input[place];
    let resources = json::top_level_field(drawn, "resources")
        .and_then(|place| serde_json::from_slice::<Map<String, Value>>(&drawn[place]).ok())
        .unwrap_or_default();
    let named = resources.iter().filter_map(|(place, resource)| {
        // `tool`, `shaft_material`, or `tools_0`.
        let mut words = place.split('_');
        let kind =
            words.find_map(|word| Kind::NAMED.into_iter().find(|kind| [kind.name(), kind.plural()].contains(&word)))?;
        let name = resource.get("name")?.as_str()?;
        let revision = resource.get("revision").or_else(|| resource.get("data_version"))?.as_u64()?;
        Some(format!("{}/{name}@{revision}|", kind.plural()))
    });
    let all: String = named.collect();
    if all.is_empty() { all } else { format!("|{all}") }
}

/// A kept job without what is not the calculator's.
pub(crate) fn without_drawn(input: &[u8]) -> Cow<'_, [u8]> {
    if json::top_level_field(input, RESOURCES).is_none() {
        return Cow::Borrowed(input);
    }
    let Ok(job) = serde_json::from_slice::<Value>(input) else { return Cow::Borrowed(input) };
    match split(&job) {
        (job, Some(_)) => serde_json::to_vec(&*job).map_or(Cow::Borrowed(input), Cow::Owned),
        (_, None) => Cow::Borrowed(input),
    }
}

/// Puts the records that the points of a study name into it, so that they mean the same whenever a point is computed.
pub(crate) fn enclose(entry: &Entry, study: &mut Value, found: &Found) {
    if entry.model_use() != ModelUse::Within || found.records.is_empty() {
        return;
    }
    if let Some(fields) = study.as_object_mut() {
        fields.insert(RECORDS.to_owned(), kept::found(found));
    }
}

/// What a kept study encloses.
pub(crate) fn enclosed(records: Option<&Value>) -> Found {
    records.map(kept::read_found).unwrap_or_default()
}

/// Whether a way through a job leads to a name, or into what stands beside it.
pub(crate) fn is_a_name(entry: &Entry, job: &Value, tokens: &[String]) -> bool {
    let Some((path, calculator)) = place(entry, job) else { return false };
    let rest = if path.is_empty() { Some(tokens) } else { tokens.strip_prefix(&[JOB.to_owned()]) };
    let Some([first, ..]) = rest else { return false };
    let pointer = format!("/{}", rest.unwrap_or_default().join("/"));
    let of_kind = || Kind::NAMED.into_iter().any(|kind| first == kind.name() && takes(&calculator, kind));
    let described = || precut_library::asked(&calculator, &with(within(job, &path), &pointer, &Value::from("x")));
    of_kind() || described().iter().any(|asked| asked.pointer == pointer)
}

/// What may be asked about names while a job is read.
pub(crate) struct Names<'a> {
    pub(crate) registry: &'a Registry,
    /// What the store knows of the names that the job has.
    pub(crate) found: Found,
    /// Memory for what is made of the body.
    pub(crate) room: super::budget::Room,
}

impl<'a> Names<'a> {
    /// Without a limit of memory.
    pub(crate) fn new(registry: &'a Registry, found: Found) -> Self {
        Self { registry, found, room: super::budget::Room::default() }
    }
}

/// Whether a job names anything that may come to mean something else.
pub(crate) fn names_any(registry: &Registry, entry: &Entry, job: &mut Value) -> bool {
    model::named(registry, entry, job).is_some() || !asked(registry, entry, job).is_empty()
}
