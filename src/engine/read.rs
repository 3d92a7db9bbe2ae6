//! From the bytes of a job to a job that can run: syntax, tables, schema, types, rules between fields, defaults, key.

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
use crate::registry::{Entry, Faults, Prepared, Registry, Shape, Unprepared, by_pointer};
use crate::store::documents::KeptDocument;

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

/// What the schema and the tables found.
struct Found {
    findings: Vec<Finding>,
    total: usize,
    /// Pointers of tables that could not be read.
    unread: Vec<String>,
}

impl Found {
    fn of(findings: Vec<Finding>) -> Self {
        Self { total: findings.len(), findings, unread: Vec::new() }
    }

    /// Without fields that are missing.
    fn without_missing(mut self) -> Self {
        let before = self.findings.len();
        self.findings.retain(|finding| general_code(finding) != "missing_field");
        self.total -= before - self.findings.len();
        self
    }

    /// With more of its faults.
    fn listing(mut self, more: Vec<Finding>) -> Self {
        self.findings.extend(more);
        self
    }

    /// As an error.
    fn told(self) -> Error {
        invalid(self.findings, self.total)
    }

    /// With more; the first fault at a place is enough.
    fn and(mut self, more: Vec<Finding>) -> Self {
        for finding in more {
            if !self.findings.iter().any(|there| there.pointer == finding.pointer) {
                self.findings.push(finding);
                self.total += 1;
            }
        }
        self
    }

    /// With the faults that the rules between fields find in a job that is readable although it breaks its schema.
    ///
    /// A rule's fault replaces the schema's at the same place, and takes over what only the schema knows. Arrays beyond their most are not looked
    /// at: their length is what is wrong, and rules may cost more than their length.
    fn with_rules(mut self, entry: &Entry, job: &Value) -> Error {
        let overlong = self.findings.iter().any(|finding| general_code(finding) == "too_many_items");
        if !overlong && self.total <= Error::MOST_FAULTS {
            let (job, model) = model::split(entry, job);
            for rule in rules_whatever_is_unread(entry, &job, &self.unread) {
                let rule = model::pointed_at_model(entry, &job, model.as_ref(), rule);
                match self.findings.iter_mut().find(|finding| finding.pointer == rule.pointer) {
                    Some(finding) if finding.code == general_code(finding) || finding.code == rule.code => {
                        *finding = with_schema(rule, finding);
                    }
                    Some(_) => {}
                    None => {
                        self.findings.push(rule);
                        self.total += 1;
                    }
                }
            }
        }
        invalid(self.findings, self.total)
    }
}

/// The rule's fault with what the schema says of the place besides: unit, ends of the range, another unit that was meant.
fn with_schema(mut rule: Finding, schema: &Finding) -> Finding {
    const ENDS: [[&str; 2]; 2] = [["minimum", "above"], ["maximum", "below"]];
    rule.unit = rule.unit.or(schema.unit);
    for (name, value) in schema.values.iter().filter(|(name, _)| *name != "rule") {
        let same = ENDS.iter().find(|end| end.contains(&name)).map_or([name, name], |end| *end);
        if same.iter().all(|name| rule.values.get(name).is_none()) {
            rule = rule.with(name, value.clone());
        }
    }
    rule
}

/// The rules that a job breaks whether a table that could not be read were absent or empty: a rule that one of the two
/// breaks would speak of the table, whose fault is listed already.
fn rules_whatever_is_unread(entry: &Entry, job: &Value, unread: &[String]) -> Vec<Finding> {
    let mut broken = entry.broken_rules(job);
    if !unread.is_empty() && !broken.is_empty() {
        let mut empty = job.clone();
        for pointer in unread {
            if let Some(table) = empty.pointer_mut(pointer) {
                *table = Value::Array(Vec::new());
            }
        }
        let also = entry.broken_rules(&empty);
        broken.retain(|rule| also.iter().any(|other| (other.code, &other.pointer) == (rule.code, &rule.pointer)));
    }
    broken
}

/// The general code of a schema's fault, whatever code its field has of its own.
fn general_code(finding: &Finding) -> &str {
    match finding.values.get("rule") {
        Some(precut_calc::calculator::Value::Text(rule)) => rule,
        _ => finding.code,
    }
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

/// The faults sorted by pointer, as many as are listed.
fn invalid(mut findings: Vec<Finding>, total: usize) -> Error {
    findings.sort_by(by_pointer);
    findings.truncate(Error::MOST_FAULTS);
    Error::Invalid { findings, total }
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

#[cfg(test)]
#[allow(clippy::unwrap_used, clippy::panic)]
mod tests {
    use super::*;
    use crate::registry::toy;
    use crate::text::{Language, Texts};
    use proptest::prelude::*;
    use serde_json::json;

    fn toy() -> Arc<Entry> {
        Arc::clone(toy::registry().entry("toy-bar").unwrap())
    }

    fn read(entry: &Arc<Entry>, body: &Body) -> Result<Ready, Error> {
        super::read(entry, body, &Names::new(toy::shared(), names::Found::default()))
    }

    fn body(job: &Value) -> Body {
        Body::Json(job.to_string().into())
    }

    fn key(job: &Value) -> Key {
        read(&toy(), &body(job)).unwrap_or_else(|error| panic!("{job}: {error:?}")).key
    }

    /// Code and pointer of every fault; each must have a text that fits its values.
    fn faults(job: &Value) -> Vec<(&'static str, String)> {
        let Err(Error::Invalid { findings, total }) = read(&toy(), &body(job)) else { panic!("{job} is accepted") };
        assert_eq!(findings.len(), total.min(Error::MOST_FAULTS));
        for finding in &findings {
            Texts::shared().try_finding(Language::En, "fault", finding).unwrap();
        }
        findings.into_iter().map(|finding| (finding.code, finding.pointer)).collect()
    }

    fn only(job: &Value) -> Finding {
        let Err(Error::Invalid { mut findings, total: 1 }) = read(&toy(), &body(job)) else {
            panic!("not one fault in {job}")
        };
        findings.remove(0)
    }

    fn plain() -> Value {
        json!({"length_mm": 500, "segments": [{"diameter_mm": 20}]})
    }

    fn with(name: &str, value: Value) -> Value {
        let mut job = plain();
        job[name] = value;
        job
    }

    #[test]
    fn spelling_order_and_defaults_do_not_change_the_key() {
        let same = json!({
            "segments": [{"diameter_mm": 2e1}], "support": {"kind": "rigid"}, "stations": 3.0, "length_mm": 500.0,
            "youngs_modulus_n_per_mm2": 210_000.0, "measurements": [], "steady": null,
        });
        assert_eq!(key(&plain()), key(&same));
        let left_out = json!({
            "length_mm": 500, "segments": [{"diameter_mm": 20}], "youngs_modulus_n_per_mm2": null, "support": null,
            "stations": null, "measurements": null, "effects": null,
        });
        assert_eq!(key(&plain()), key(&left_out));
        let needed = with("segments", json!([{"diameter_mm": null}]));
        assert_eq!(faults(&needed), [("wrong_type", "/segments/0/diameter_mm".to_owned())]);
        assert_ne!(key(&plain()), key(&with("length_mm", json!(501))));
    }

    #[test]
    fn a_table_gives_one_key_however_it_comes() {
        let rows = with("measurements", json!([{"z_mm": 10, "deviation_um": 12}]));
        let text = "z [cm];deviation_mm\n1;0,012\n";
        assert_eq!(key(&rows), key(&with("measurements", json!({ "csv": text }))));
        let part = FilePart { name: "measurements".to_owned(), bytes: text.into() };
        let parts = Body::Parts { job: plain().to_string().into(), files: vec![part] };
        let ready = read(&toy(), &parts).unwrap();
        assert_eq!(ready.key, key(&rows));
        assert_eq!(ready.echo().unwrap()["measurements"]["rows"], 1);
    }

    #[test]
    fn every_fault_is_listed_at_once_at_its_own_place() {
        let job = json!({
            "lenght_mm": 500,
            "youngs_modulus_n_per_mm2": "2.1e5",
            "segments": [{"diameter_mm": 20}, {"diameter_mm": -1, "colour": "red"}, {}],
            "support": {"kind": "elastic", "compliance_um_per_n": 99, "stiffness": 3},
            "steady": {"kind": "elastik"},
            "stations": "many",
            "mode": "plane",
            "effects": [{"kind": "bar"}, {"diameter_mm": 3}],
        });
        let expected = [
            ("unknown_field", "/lenght_mm"),
            ("missing_field", "/length_mm"),
            ("wrong_type", "/youngs_modulus_n_per_mm2"),
            ("unknown_field", "/segments/1/colour"),
            ("out_of_range", "/segments/1/diameter_mm"),
            ("missing_field", "/segments/2/diameter_mm"),
            ("out_of_range", "/support/compliance_um_per_n"),
            ("unknown_field", "/support/stiffness"),
            ("unknown_kind", "/steady/kind"),
            ("wrong_type", "/stations"),
            ("not_one_of", "/mode"),
            ("missing_field", "/effects/0/diameter_mm"),
            ("missing_kind", "/effects/1/kind"),
        ];
        let mut expected: Vec<(&str, String)> = expected.map(|(code, pointer)| (code, pointer.to_owned())).to_vec();
        expected.sort_by(|a, b| a.1.cmp(&b.1));
        assert_eq!(faults(&job), expected);
    }

    #[test]
    fn a_field_may_have_a_code_of_its_own() {
        assert!(faults(&with("length_mm", json!(0))).contains(&("toy_bad_length", "/length_mm".to_owned())));
        let finding = only(&with("length_mm", json!("500")));
        assert_eq!((finding.code, finding.values.get("rule")), ("toy_bad_length", Some(&"wrong_type".into())));
        assert_eq!(
            Texts::shared().finding(Language::En, "fault", &finding),
            "length_mm is of type string, expected number; write the number without quotes and with a decimal point"
        );
        assert_eq!(faults(&with("segments", json!([]))), [("toy_no_segments", "/segments".to_owned())]);
        assert_eq!(
            faults(&with("support", json!({"kind": "soft"}))),
            [("unknown_support", "/support/kind".to_owned())]
        );
    }

    #[test]
    fn a_number_out_of_range_says_both_ends_the_unit_and_what_was_meant() {
        let finding = only(&with("youngs_modulus_n_per_mm2", json!(210)));
        assert_eq!((finding.value, finding.limit, finding.unit), (Some(210.0), Some(1000.0), Some("N/mm2")));
        assert_eq!(
            Texts::shared().finding(Language::En, "fault", &finding),
            "youngs_modulus_n_per_mm2 is 210 N/mm²; allowed is 1000 to 1000000 N/mm²; \
             210 looks like GPa, in N/mm² it would be 210000"
        );
        let finding = only(&with("segments", json!([{"diameter_mm": 0}])));
        assert_eq!(
            Texts::shared().finding(Language::En, "fault", &finding),
            "diameter_mm is 0 mm; allowed is above 0, at most 1000 mm"
        );
    }

    #[test]
    fn an_unknown_name_comes_with_the_nearest() {
        let finding = only(&with("suport", json!({"kind": "rigid"})));
        assert_eq!(finding.values.get("nearest"), Some(&"support".into()));
        let finding = only(&with("steady", json!({"kind": "elastik"})));
        assert_eq!(finding.values.get("nearest"), Some(&"elastic".into()));
        let finding = only(&with("mode", json!("plane")));
        assert!(finding.values.get("allowed").is_some());
    }

    /// The same job as a body that is kept whole while it is read, and as one of which the heads of lists are kept.
    fn small_and_large(job: &Value) -> [Body; 2] {
        let text = job.to_string();
        assert!(text.len() <= KEPT_WHOLE, "{}", text.len());
        [Body::Json(text.clone().into()), Body::Json((text + &" ".repeat(KEPT_WHOLE)).into())]
    }

    #[test]
    fn a_large_body_has_the_faults_that_it_has_when_it_is_kept_whole() {
        let rows = |count: usize, bad: &[(usize, Value)]| {
            let mut rows = vec![json!({"z_mm": 1, "deviation_um": 2}); count];
            for (index, row) in bad {
                rows[*index] = row.clone();
            }
            with("measurements", rows.into())
        };
        let bad = [
            (3, json!({"z_mm": -1, "deviation_um": "x"})),
            (300, json!({"z_mm": 1, "deviation_um": 2, "colour": [1, 2]})),
            (1999, json!({"z_mm": null, "deviation_um": 2})),
        ];
        let mut with_more = rows(2000, &bad[1..]);
        with_more["lenght_mm"] = json!(3);
        with_more.as_object_mut().unwrap().remove("segments");
        for job in [rows(2000, &bad[..1]), rows(2000, &bad[1..]), rows(2002, &bad), with_more] {
            let [small, large] = small_and_large(&job).map(|body| match read(&toy(), &body) {
                Err(Error::Invalid { findings, total }) => (findings, total),
                _ => panic!("accepted"),
            });
            assert!(small.1 > 0);
            assert_eq!(small, large);
        }
        let [small, large] = small_and_large(&rows(2000, &[])).map(|body| read(&toy(), &body).unwrap().key);
        assert_eq!(small, large);
        let swapped = rows(2000, &[(1999, json!({"deviation_um": 2, "z_mm": 7}))]);
        let [small, large] = small_and_large(&swapped).map(|body| read(&toy(), &body).unwrap().key);
        assert!(small == large && small != key(&rows(2000, &[])));
    }

    #[test]
    fn a_row_beyond_the_head_of_a_text_says_its_line() {
        let lines: String = (0..400).map(|line| if line == 350 { "-3,4\n" } else { "1,2\n" }).collect();
        let finding = only(&with("measurements", json!({"csv": format!("z_mm,deviation_um\n{lines}")})));
        assert_eq!((finding.code, finding.pointer.as_str()), ("out_of_range", "/measurements/350/z_mm"));
        assert_eq!(finding.values.get("line"), Some(&352.0.into()));
    }

    #[test]
    fn a_row_from_a_text_says_its_line() {
        let job = with("measurements", json!({"csv": "z_mm,deviation_um\n\n1,2\n\n-3,4\n"}));
        let finding = only(&job);
        assert_eq!((finding.code, finding.pointer.as_str()), ("out_of_range", "/measurements/1/z_mm"));
        assert_eq!(finding.values.get("line"), Some(&5.0.into()));
        let unreadable = with("measurements", json!({"csv": "z_mm,deviation_um\n1,x\n"}));
        assert_eq!(faults(&unreadable), [("bad_cell", "/measurements/0/deviation_um".to_owned())]);
    }

    #[test]
    fn rules_between_fields_come_after_the_schema() {
        let job = with("segments", json!([{"diameter_mm": 600}, {"diameter_mm": 20}, {"diameter_mm": 700}]));
        assert_eq!(
            faults(&job),
            [
                ("thicker_than_long", "/segments/0/diameter_mm".to_owned()),
                ("thicker_than_long", "/segments/2/diameter_mm".to_owned())
            ]
        );
    }

    #[test]
    fn rules_are_checked_too_where_the_schema_is_broken_elsewhere() {
        let mut job = with("segments", json!([{"diameter_mm": 600}]));
        job["length_mm"] = json!(-5);
        let codes: Vec<&str> = faults(&job).into_iter().map(|fault| fault.0).collect();
        assert_eq!(codes, ["toy_bad_length", "thicker_than_long"]);
    }

    #[test]
    fn a_thousand_bad_rows_are_counted_and_a_hundred_listed() {
        let rows: Vec<Value> = (0..2000).map(|_| json!({"z_mm": -1, "deviation_um": "x"})).collect();
        let Err(Error::Invalid { findings, total }) = read(&toy(), &body(&with("measurements", rows.into()))) else {
            panic!("accepted")
        };
        assert_eq!((findings.len(), total), (100, 4000));
        assert_eq!(findings[99].pointer, "/measurements/49/z_mm");
    }

    #[test]
    fn items_are_checked_wherever_their_array_is_and_none_beyond_its_most() {
        let several = |places: Value| json!({"kind": "several", "places_mm": places});
        let job = with("effects", json!([several(json!([1, -1, "x"])), several(json!([0, 0, 0, -1]))]));
        let expected = [
            ("out_of_range", "/effects/0/places_mm/1"),
            ("wrong_type", "/effects/0/places_mm/2"),
            ("too_many_items", "/effects/1/places_mm"),
        ];
        assert_eq!(faults(&job), expected.map(|(code, pointer)| (code, pointer.to_owned())));
        key(&with("support", several(json!([1, 2, 3]))));
    }

    #[test]
    fn a_hostile_body_costs_no_more_than_its_bytes() {
        let fields: serde_json::Map<String, Value> = (0..50_000).map(|i| (format!("f{i}"), Value::Null)).collect();
        let Err(Error::Invalid { findings, total }) = read(&toy(), &body(&fields.into())) else { panic!("accepted") };
        assert_eq!((findings.len(), total), (100, 50_002));
        let many: Vec<Value> = vec![Value::Null; 1_000_000];
        let Err(Error::Invalid { total, .. }) = read(&toy(), &body(&with("segments", many.into()))) else {
            panic!("accepted")
        };
        assert_eq!(total, 1 + 5, "too many, and the first five of them bad");
    }

    #[test]
    fn what_is_no_object_is_a_fault_of_the_whole_job() {
        for job in [json!([]), json!(3), json!(null)] {
            assert_eq!(faults(&job), [("wrong_type", String::new())]);
        }
    }

    #[test]
    fn what_only_the_types_refuse_is_a_fault_too() {
        assert_eq!(faults(&with("stations", json!(5_000_000_000_u64))), [("not_readable", "/stations".to_owned())]);
    }

    /// Something like a job: right names, any values.
    fn any_job() -> impl Strategy<Value = Value> {
        let leaf = prop_oneof![
            Just(Value::Null),
            any::<bool>().prop_map(Value::from),
            any::<i32>().prop_map(Value::from),
            any::<f64>().prop_map(Value::from),
            prop_oneof![Just("rigid"), Just("elastic"), Just("several"), Just("bar"), Just("z_mm;deviation_um\n1;2")]
                .prop_map(Value::from),
        ];
        let name = prop_oneof![
            Just("length_mm"),
            Just("segments"),
            Just("diameter_mm"),
            Just("support"),
            Just("kind"),
            Just("stations"),
            Just("measurements"),
            Just("csv"),
            Just("z_mm"),
            Just("effects"),
            Just("steady"),
            Just("x"),
            Just("compliance_um_per_n"),
            Just("places_mm"),
        ];
        leaf.prop_recursive(4, 40, 5, move |inner| {
            prop_oneof![
                prop::collection::vec(inner.clone(), 0..5).prop_map(Value::from),
                prop::collection::vec((name.clone(), inner), 0..6).prop_map(|fields| {
                    Value::Object(fields.into_iter().map(|(name, value)| (name.to_owned(), value)).collect())
                }),
            ]
        })
    }

    proptest! {
        #[test]
        fn any_job_is_accepted_or_has_worded_faults(job in any_job()) {
            match read(&toy(), &body(&job)) {
                Ok(_) => {}
                Err(Error::Invalid { findings, total }) => {
                    prop_assert!(total > 0 && !findings.is_empty());
                    for finding in findings {
                        Texts::shared().try_finding(Language::En, "fault", &finding).unwrap();
                    }
                }
                Err(other) => prop_assert!(false, "{:?}", other),
            }
        }

        #[test]
        fn the_verdict_is_that_of_the_published_schema(job in any_job()) {
            let entry = toy();
            let published = jsonschema::draft202012::new(&entry.input_document()).unwrap();
            let parsed = json::parse(job.to_string().as_bytes()).unwrap();
            let mut faults = Faults::default();
            entry.validate(&parsed, &mut faults);
            // CSV has become rows before the service validates.
            let has_csv = parsed.pointer("/measurements/csv").is_some();
            prop_assert!(has_csv || published.is_valid(&parsed) == (faults.total == 0));
        }

        #[test]
        fn fields_that_differ_give_keys_that_differ(a in 1.0..20000.0_f64, b in 1.0..20000.0_f64) {
            let job = |length: f64| with("length_mm", json!(length));
            let small = |length: f64| length < 20.0;
            prop_assume!(!small(a) && !small(b));
            prop_assert_eq!(key(&job(a)) == key(&job(b)), a.to_bits() == b.to_bits());
        }
    }
}
