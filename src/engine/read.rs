//! From the bytes of a job to a job that can run: syntax, tables, schema, types, rules between fields, defaults, key.

mod found;
#[cfg(test)]
mod tests;

use std::sync::Arc;

use bytes::Bytes;
use precut_calc::calculator::{Failure, Finding};
use serde_json::Value;

use super::budget::Room;
use super::error::Error;
use super::json::{Parsed, ParsedHead};
use super::model::{self, Held};
use super::names::{self, Asks, Drawn, Names};
use super::{Body, Checked, FilePart, json, study, table, text_file};
use crate::key::Key;
use crate::registry::{Entry, Faults, Prepared, Registry, Shape, Unprepared};
use crate::store::documents::KeptDocument;
use found::{Found, invalid};

/// A job that can run, with the address of its answer.
pub(crate) struct Ready {
    pub(crate) entry: Arc<Entry>,
    pub(crate) prepared: Prepared,
    pub(crate) key: Key,
    /// The filled job as RFC 8785 writes it.
    pub(crate) canonical: Bytes,
    /// The stored model that extends it.
    pub(crate) model: Option<Held>,
    /// The job without what the model adds.
    pub(crate) base: Option<Prepared>,
    /// What it got from machines, tools and materials that it names.
    pub(crate) drawn: Option<Drawn>,
    /// Whether the same bytes may come to mean another job: where they name what may be revised.
    pub(crate) names_any: bool,
    /// Whether there are measured tables in it.
    has_rows: bool,
}

/// Bodies up to this size, bytes, are kept whole while they are read: the values of their rows take little more than a
/// request takes anyway.
const KEPT_WHOLE: usize = 64 << 10;

/// A body whose syntax is in order: what it names can be told.
pub(crate) struct Draft {
    job: Value,
    left_out: usize,
    /// Where only the heads of long lists were kept, the faults of what follows them.
    beyond: Option<Faults>,
    /// The model that was put into the job.
    imposed: Option<KeptDocument>,
}

impl Draft {
    /// Of a body.
    pub(crate) fn of(entry: &Entry, body: &Body, (registry, room): (&Registry, &Room)) -> Result<Self, Error> {
        let (Body::Json(job) | Body::Parts { job, .. }) = body;
        if job.len() <= KEPT_WHOLE {
            return Self::whole(entry, body, (registry, room));
        }
        if entry.is_composed() {
            return Self::of_study(entry, job, (registry, room));
        }
        let shape = entry.shape_of_named(job).unwrap_or_else(|| registry.shape_of(entry));
        let ParsedHead { parsed, beyond } = json::parse_head(job, shape, room)?;
        Ok(Self { job: parsed.value, left_out: parsed.left_out, beyond, imposed: None })
    }

    /// Of a large study. Where it cannot be told whose job it varies, nothing of the job is kept: the study is refused, whatever
    /// it is.
    fn of_study(entry: &Entry, body: &[u8], (registry, room): (&Registry, &Room)) -> Result<Self, Error> {
        let (shape, is_whole) = match study::shape(registry, entry, body) {
            Some(shape) => (shape, true),
            None => (registry.shape_of(entry).clone().with_field("job", Shape::default()), false),
        };
        let ParsedHead { parsed, beyond } = json::parse_head(body, &shape, room)?;
        let beyond = if is_whole { beyond } else { Some(beyond.unwrap_or_default()) };
        Ok(Self { job: parsed.value, left_out: parsed.left_out, beyond, imposed: None })
    }

    /// The same with all that is in the body.
    fn whole(entry: &Entry, body: &Body, (registry, room): (&Registry, &Room)) -> Result<Self, Error> {
        let (Body::Json(job) | Body::Parts { job, .. }) = body;
        let Parsed { value: job, left_out } = json::parse_as(job, registry.shape_of(entry), room)?;
        Ok(Self { job, left_out, beyond: None, imposed: None })
    }

    /// The same with a model that the job takes although it may not name it.
    pub(crate) fn with_model(
        mut self,
        registry: &Registry,
        entry: &Entry,
        given: &KeptDocument,
    ) -> Result<Self, Error> {
        match model::impose(registry, entry, &mut self.job, given) {
            None => Ok(Self { imposed: Some(given.clone()), ..self }),
            Some(misfit) => Err(Found::of(vec![misfit]).with_rules(entry, &self.job)),
        }
    }

    /// What it names.
    pub(crate) fn asks(&mut self, registry: &Registry, entry: &Entry) -> Asks {
        Asks::of(registry, entry, &mut self.job)
    }

    /// Reads the job of a body. What the schema refuses is listed together with what the rules between fields refuse, as far as
    /// the job can be read in spite of its faults.
    pub(crate) fn read(self, entry: &Arc<Entry>, body: &Body, names: &Names<'_>) -> Result<Ready, Error> {
        let parts = match body {
            Body::Json(_) => [].as_slice(),
            Body::Parts { files, .. } => files.as_slice(),
        };
        let Some(beyond) = self.beyond else { return read_named(entry, self.job, (parts, self.left_out), names) };
        held_to_schema(entry, self.job, (parts, self.left_out, beyond), names)?;
        let mut whole = Self::whole(entry, body, (names.registry, &names.room))?;
        if let Some(imposed) = &self.imposed {
            whole = whole.with_model(names.registry, entry, imposed)?;
        }
        read_named(entry, whole.job, (parts, whole.left_out), names)
    }
}

/// Reads the job of a body.
#[cfg(test)]
pub(crate) fn read(entry: &Arc<Entry>, body: &Body, names: &Names<'_>) -> Result<Ready, Error> {
    Draft::of(entry, body, (names.registry, &names.room))?.read(entry, body, names)
}

/// The job of a point of a study. Its model may be resolved already.
pub(crate) fn read_point(entry: &Arc<Entry>, mut job: Value, found: &names::Found) -> Result<Ready, Error> {
    let (drawn, of_names) = names::fill(entry, &mut job, found);
    names::turn_model_off(entry, &mut job);
    let of_model = model::extend_point(found, entry, &mut job);
    let resolved = Resolved { job, drawn, of_names, of_model, enclosed: None };
    read_resolved(entry, resolved, (&[], &Room::default()), 0)
}

/// A job whose names are given their meaning.
pub(crate) fn read_named(
    entry: &Arc<Entry>,
    mut job: Value,
    (parts, left_out): (&[FilePart], usize),
    names: &Names<'_>,
) -> Result<Ready, Error> {
    let names_any = names::names_any(names.registry, entry, &mut job);
    let ready = read_resolved(entry, Resolved::of(entry, job, names), (parts, &names.room), left_out)?;
    Ok(Ready { names_any, ..ready })
}

/// What the schema refuses in a job of which the heads of long lists are there, and the faults beyond them. The rules between
/// fields, which need all of the job, are asked when these are mended.
fn held_to_schema(
    entry: &Arc<Entry>,
    job: Value,
    (parts, left_out, beyond): (&[FilePart], usize, Faults),
    names: &Names<'_>,
) -> Result<(), Error> {
    let Resolved { mut job, of_names, of_model, .. } = Resolved::of(entry, job, names);
    let found = check_schema(entry, &mut job, (parts, &names.room)).err().unwrap_or_else(|| Found::of(Vec::new()));
    let found = Found { total: found.total + left_out + beyond.total, ..found }.listing(beyond.listed);
    names::enclose(entry, &mut job, &names.found);
    let found = found.and(entry.faults_of_head(&job));
    let found = if of_names.is_empty() { found } else { found.without_missing() };
    let found = found.and(of_names).and(of_model);
    if found.total == 0 { Ok(()) } else { Err(found.told()) }
}

/// A job without names, and what came of them.
#[derive(Default)]
struct Resolved<'a> {
    job: Value,
    drawn: Option<Drawn>,
    /// What the points of a study may name.
    enclosed: Option<&'a names::Found>,
    of_names: Vec<Finding>,
    of_model: Vec<Finding>,
}

impl<'a> Resolved<'a> {
    /// The job whose names are given their meaning.
    fn of(entry: &Entry, mut job: Value, names: &'a Names<'_>) -> Self {
        let (drawn, of_names) = names::fill(entry, &mut job, &names.found);
        names::turn_model_off(entry, &mut job);
        let of_model = model::extend(names.registry, &names.found, entry, &mut job);
        Self { job, drawn, enclosed: Some(&names.found), of_names, of_model }
    }
}

fn read_resolved(
    entry: &Arc<Entry>,
    resolved: Resolved<'_>,
    (parts, room): (&[FilePart], &Room),
    left_out: usize,
) -> Result<Ready, Error> {
    let Resolved { mut job, drawn, enclosed, of_names, of_model } = resolved;
    let checked = check_schema(entry, &mut job, (parts, room));
    if room.is_spent() {
        return Err(Error::Busy { retry_after: json::RETRY_AFTER });
    }
    let checked = checked.map_err(|found| Found { total: found.total + left_out, ..found });
    match checked {
        Ok(()) if of_names.is_empty() && of_model.is_empty() => {
            if let Some(drawn) = &drawn {
                names::with_drawn(&mut job, drawn);
            }
            if let Some(found) = enclosed {
                names::enclose(entry, &mut job, found);
            }
            prepared(entry, &job)
        }
        Ok(()) if of_names.is_empty() => Err(Found::of(of_model).with_rules(entry, &job)),
        Ok(()) => Err(Found::of(of_names).and(of_model).told()),
        Err(found) if of_names.is_empty() => Err(found.and(of_model).with_rules(entry, &job)),
        // What a name that means nothing would have filled in is missing for that alone.
        Err(found) => Err(found.without_missing().and(of_names).and(of_model).told()),
    }
}

/// A job whose syntax, tables and schema are in order, or were when it was accepted.
pub(crate) fn prepared(entry: &Arc<Entry>, job: &Value) -> Result<Ready, Error> {
    let (job, drawn) = names::split(job);
    let (job, model) = model::split(entry, &job);
    let has_rows = table::has_rows(&job, entry.tables_of(&job));
    let mut prepared = entry.prepare(&job).map_err(|unprepared| match unprepared {
        Unprepared::Invalid(findings) => {
            let total = findings.len();
            let findings =
                findings.into_iter().map(|one| model::pointed_at_model(entry, &job, model.as_ref(), one)).collect();
            invalid(findings, total)
        }
        Unprepared::Failed(failure) => Error::Calculation(failure),
    })?;
    let canonical = std::mem::take(&mut prepared.canonical);
    let canonical = match &model {
        None => canonical,
        Some(held) => model::canonical_with(&canonical, held).map_err(Error::internal)?,
    };
    let (canonical, hashed) = match &drawn {
        None => (Bytes::from(canonical), None),
        Some(drawn) => {
            let (kept, hashed) = names::canonical_with(&canonical, drawn).map_err(Error::internal)?;
            (Bytes::from(kept), Some(hashed))
        }
    };
    let base = model.as_ref().and_then(|held| model::base(entry, &job, held));
    if let Some(base) = &base {
        prepared.cost.ms += base.cost.ms;
    }
    let key = Key::of(entry.meta(), prepared.numbers_of.as_ref(), hashed.as_deref().unwrap_or(&canonical));
    let names_any = model.is_some() || drawn.is_some();
    Ok(Ready { entry: Arc::clone(entry), prepared, key, canonical, model, base, drawn, names_any, has_rows })
}

fn check_schema(entry: &Entry, job: &mut Value, (parts, room): (&[FilePart], &Room)) -> Result<(), Found> {
    let mut table_faults = Faults::default();
    let texts = entry.texts_of(job).to_vec();
    let (parts, unread) = text_file::resolve(job, parts, &texts, &mut table_faults);
    let places = entry.tables_of(job).to_vec();
    let tables = table::resolve(job, (&parts, room), &places, &mut table_faults).with_unread(unread);
    let mut schema_faults = Faults::default();
    // A resolved model is in order.
    let (plain, held) = model::split(entry, job);
    entry.validate(if held.is_some() { &plain } else { job }, &mut schema_faults);
    let listed = schema_faults.listed.len();
    let mut findings: Vec<Finding> = schema_faults
        .listed
        .into_iter()
        .filter(|finding| !tables.is_noise(finding))
        .map(|f| tables.located(f))
        .collect();
    let total = schema_faults.total - (listed - findings.len()) + table_faults.total;
    findings.extend(table_faults.listed);
    if total == 0 { Ok(()) } else { Err(Found { findings, total, unread: tables.into_unread() }) }
}

/// Holds something to its schema, its tables read.
pub(crate) fn check_body(entry: &Entry, body: &mut Value, tables: (&[FilePart], &Room)) -> Result<(), Error> {
    check_schema(entry, body, tables).map_err(Found::told)
}

/// What the schema alone finds wrong with a job.
pub(crate) fn schema_faults(entry: &Entry, mut job: Value) -> Vec<Finding> {
    check_schema(entry, &mut job, (&[], &Room::default())).err().map(|found| found.findings).unwrap_or_default()
}

impl Ready {
    /// The filled job as it is echoed.
    pub(crate) fn echo(&self) -> Result<Value, Failure> {
        let input = self.prepared.input()?;
        let places = self.entry.tables_of(&input).to_vec();
        let echo = table::without_rows(input, &places);
        Ok(match &self.model {
            Some(held) => model::with_model(echo, held),
            None => echo,
        })
    }

    /// Appends the same as JSON.
    pub(crate) fn write_echo(&self, body: &mut Vec<u8>) -> Result<(), Failure> {
        if self.has_rows || self.model.is_some() {
            let echo = self.echo()?;
            return serde_json::to_writer(body, &echo).map_err(|error| Failure::Internal(format!("the echo: {error}")));
        }
        self.prepared.write_input(body)
    }

    pub(crate) fn into_checked(self) -> Result<Checked, Error> {
        let input = self.echo().map_err(Error::Calculation)?;
        Ok(Checked { input, cost: self.prepared.cost, key: self.key })
    }
}
