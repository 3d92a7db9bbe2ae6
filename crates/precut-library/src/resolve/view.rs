//! Records as a job sees them: with the fields that it overrules.

use precut_calc::calculator::Finding;
use serde_json::{Map, Value};

use super::asked::tools;
use super::kinds::Room;
use super::origin::{From, Part};
use super::writer::Writer;
use super::{Asked, Lookup, Resource, overrides};
use crate::iso;
use crate::record::{Kind, Number, Record};

/// A record with what the job says over it.
pub(super) struct View<'a> {
    pub(super) kind: Kind,
    /// Where the job names it.
    pub(super) pointer: String,
    record: Option<&'a Record>,
    over: Value,
    /// What its codes say, of a tool.
    pub(super) codes: iso::Read,
}

impl<'a> View<'a> {
    fn new(kind: Kind, pointer: String, record: Option<&'a Record>, over: Value) -> Self {
        let mut view = Self { kind, pointer, record, over, codes: iso::Read::default() };
        if kind == Kind::Tool {
            view.codes = iso::read(view.text("insert"), view.text("holder"));
        }
        view
    }

    fn from(&self, is_over: bool) -> From {
        match (is_over, self.kind) {
            (true, _) | (_, Kind::Part) => From::Job,
            (_, Kind::Machine) => From::Machine,
            (_, Kind::Tool) => From::Tool,
            (_, Kind::Material) => From::Material,
        }
    }

    /// What stands at a path, the job's word first.
    pub(super) fn at(&self, path: &str) -> Option<(&Value, From)> {
        let over = self.over.pointer(path).map(|value| (value, true));
        let of_record = || Some((self.record?.value.pointer(path)?, false));
        over.or_else(of_record).map(|(value, is_over)| (value, self.from(is_over)))
    }

    pub(super) fn text(&self, field: &str) -> Option<&str> {
        self.at(&format!("/{field}"))?.0.as_str()
    }

    /// The record itself.
    pub(super) fn record(&self) -> Option<&'a Record> {
        self.record
    }

    /// Name of the record, empty without one.
    pub(super) fn name(&self) -> &str {
        self.record.map_or("", |record| &record.name)
    }

    /// A number with its part of an origin.
    pub(super) fn number(&self, path: &str) -> Option<(f64, Part)> {
        let (value, from) = self.at(path)?;
        let number = Number::of(value)?;
        let part = match from {
            From::Job => Part::new(From::Job).at(path).worth(number.value),
            from => Part::of(from, path, &number),
        };
        Some((number.value, part))
    }

    /// A word with its part of an origin.
    pub(super) fn word(&self, path: &str) -> Option<(&str, Part)> {
        let (value, from) = self.at(path)?;
        let text = |field: &str| value.get(field).and_then(Value::as_str);
        let part = match from {
            From::Job => Part::new(From::Job),
            from => Part::sourced(from, text("source").unwrap_or_default(), text("certainty").unwrap_or_default()),
        };
        Some((text("value")?, part.at(path)))
    }

    /// The rows of a list.
    pub(super) fn rows(&self, field: &str) -> &[Value] {
        self.at(&format!("/{field}")).and_then(|(value, _)| value.as_array()).map_or(&[], Vec::as_slice)
    }
}

/// The records of a job.
#[derive(Default)]
pub(super) struct Views<'a> {
    pub(super) machine: Option<View<'a>>,
    pub(super) tool: Option<View<'a>>,
    /// Those that the job names where it describes them, as far as they have a record or codes.
    pub(super) described: Vec<View<'a>>,
    /// The material of the whole job.
    material: Option<View<'a>>,
    /// The material of what is turned alone.
    of_shaft: Option<View<'a>>,
    /// The material of `/force` alone.
    of_force: Option<View<'a>>,
}

impl<'a> Views<'a> {
    /// Takes the names out of a job. `None` where it has none.
    pub(super) fn take(room: Room, writer: &mut Writer<'_>, found: &'a [(Asked, Lookup)]) -> Option<Self> {
        let mut views = Self::default();
        let tool_by_codes = is_by_codes(writer.job().get("tool"));
        let described = tools(room, writer.job());
        let has_codes = described.iter().any(|place| is_by_codes(writer.at(place)));
        if found.is_empty() && !tool_by_codes && !has_codes {
            return None;
        }
        for (asked, lookup) in found {
            let resource = looked_up(asked, lookup, writer);
            let record = resource.map(|resource| resource.record.as_ref());
            match asked.pointer.as_str() {
                // In their places further down.
                _ if asked.kind == Kind::Tool && !room.takes(Kind::Tool) => {}
                "/shaft/material" | "/stock/material" | "/force/material" => {
                    let (part, _) = asked.pointer.rsplit_once('/').unwrap_or_default();
                    writer.take(part, "material");
                    let view =
                        record.map(|record| View::new(asked.kind, asked.pointer.clone(), Some(record), Value::Null));
                    *(if part == "/force" { &mut views.of_force } else { &mut views.of_shaft }) = view;
                }
                _ => {
                    let over = taken(room, asked.kind, writer);
                    let pointer = format!("/{}", asked.kind.name());
                    let view = record.map(|record| View::new(asked.kind, pointer, Some(record), over));
                    if let Some(slot) = views.slot(asked.kind) {
                        *slot = view;
                    }
                }
            }
        }
        if tool_by_codes && views.tool.is_none() && !found.iter().any(|(asked, _)| asked.kind == Kind::Tool) {
            let over = taken(room, Kind::Tool, writer);
            views.tool = Some(View::new(Kind::Tool, "/tool".to_owned(), None, over));
        }
        for pointer in described {
            let place = format!("{pointer}/name");
            writer.take(&pointer, "name");
            // Mills have no code of their own.
            let codes: &[&str] = if room == Room::Program { &["insert", "holder"] } else { &[] };
            let codes = codes.iter().map(|code| (*code, writer.take(&pointer, code)));
            let over: Map<String, Value> = codes.filter_map(|(code, value)| Some((code.to_owned(), value?))).collect();
            let of_name = found.iter().find(|(asked, _)| asked.pointer == place);
            let resource = of_name.and_then(|(asked, lookup)| looked_up(asked, lookup, writer));
            if resource.is_some() || !over.is_empty() {
                let record = resource.map(|resource| resource.record.as_ref());
                views.described.push(View::new(Kind::Tool, pointer, record, Value::Object(over)));
            }
        }
        for tool in views.tools() {
            for fault in &tool.codes.faults {
                // A code of the record has no place of its own in the job.
                let own = tool.over.pointer(&fault.pointer).is_some();
                let fault = fault.clone();
                let pointer = tool.pointer.clone();
                writer.fault(if own { fault.under(&pointer) } else { Finding { pointer, ..fault } });
            }
        }
        Some(views)
    }

    /// All tools of the job.
    pub(super) fn tools(&self) -> impl Iterator<Item = &View<'a>> {
        self.tool.iter().chain(&self.described)
    }

    /// Where a record that a job names has its place.
    fn slot(&mut self, kind: Kind) -> Option<&mut Option<View<'a>>> {
        match kind {
            Kind::Machine => Some(&mut self.machine),
            Kind::Tool => Some(&mut self.tool),
            Kind::Material => Some(&mut self.material),
            Kind::Part => None,
        }
    }

    /// The material that the elastic constants are of.
    pub(super) fn material_of_shaft(&self) -> Option<&View<'a>> {
        self.of_shaft.as_ref().or(self.material.as_ref())
    }

    /// The material that the force is of.
    pub(super) fn material_of_force(&self) -> Option<&View<'a>> {
        self.of_force.as_ref().or(self.material.as_ref())
    }
}

/// Whether a tool is told by its codes alone.
fn is_by_codes(tool: Option<&Value>) -> bool {
    tool.and_then(Value::as_object).is_some_and(|fields| {
        !fields.contains_key("name") && (fields.contains_key("insert") || fields.contains_key("holder"))
    })
}

/// The record, or a fault.
fn looked_up<'a>(asked: &Asked, lookup: &'a Lookup, writer: &mut Writer<'_>) -> Option<&'a Resource> {
    let fault = |code| Finding::new(code, asked.pointer.clone()).with(asked.kind.name(), asked.name.clone());
    let fault = match lookup {
        Lookup::Found(resource) => return Some(resource),
        Lookup::Unknown { nearest } if nearest.is_empty() => fault(asked.kind.unknown()),
        Lookup::Unknown { nearest } => fault(asked.kind.unknown()).with("nearest", nearest.clone()),
        Lookup::UnknownRevision { last } => {
            let asked_for = f64::from(asked.revision.unwrap_or_default());
            fault("unknown_revision")
                .with("name", asked.name.clone())
                .with("revision", asked_for)
                .with("last", f64::from(*last))
        }
        Lookup::Deleted => fault("deleted_record").with("name", asked.name.clone()),
        Lookup::Ambiguous { candidates } => fault("ambiguous_material").with("candidates", candidates.clone()),
    };
    writer.fault(fault);
    None
}

/// Takes a name out of the job and gives what it says over the record. Of a schedule's machine its own fields stay.
fn taken(room: Room, kind: Kind, writer: &mut Writer<'_>) -> Value {
    let Some(fields) = writer.fields() else { return Value::Null };
    let Some(Value::Object(mut said)) = fields.shift_remove(kind.name()) else { return Value::Null };
    said.shift_remove("name");
    let mut over = Map::new();
    let mut left = Map::new();
    for (name, value) in said {
        let of_record = overrides::is_field(kind, &name);
        let of_job = kind == Kind::Machine && room == Room::Schedule && !of_record;
        if of_job { &mut left } else { &mut over }.insert(name, value);
    }
    if !left.is_empty() {
        writer.put(&format!("/{}", kind.name()), Value::Object(left));
    }
    overrides::settle(kind, over, writer)
}
