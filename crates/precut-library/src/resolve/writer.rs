//! Writing into a job.

use precut_calc::calculator::{Finding, Message};
use serde_json::{Map, Value};

use super::Resolution;
use super::origin::{From, Origin, Part};

/// A field overrules a record where it differs by more than this share.
const DIFFERS: f64 = 0.01;

/// A job that is being filled, with what is to be said of it.
pub(super) struct Writer<'a> {
    job: &'a mut Value,
    out: Resolution,
}

impl<'a> Writer<'a> {
    pub(super) fn new(job: &'a mut Value) -> Self {
        Self { job, out: Resolution::default() }
    }

    pub(super) fn into_resolution(self) -> Resolution {
        self.out
    }

    pub(super) fn job(&self) -> &Value {
        self.job
    }

    pub(super) fn fields(&mut self) -> Option<&mut Map<String, Value>> {
        self.job.as_object_mut()
    }

    /// What stands at a pointer; null is nothing.
    pub(super) fn at(&self, pointer: &str) -> Option<&Value> {
        self.job.pointer(pointer).filter(|value| !value.is_null())
    }

    pub(super) fn number(&self, pointer: &str) -> Option<f64> {
        self.at(pointer)?.as_f64()
    }

    pub(super) fn word(&self, pointer: &str) -> Option<&str> {
        self.at(pointer)?.as_str()
    }

    /// The items of a list.
    pub(super) fn items(&self, pointer: &str) -> &[Value] {
        self.at(pointer).and_then(Value::as_array).map_or(&[], Vec::as_slice)
    }

    pub(super) fn fault(&mut self, finding: Finding) {
        self.out.faults.push(finding);
    }

    pub(super) fn warn(&mut self, finding: Finding) {
        self.out.warnings.push(finding);
    }

    pub(super) fn explain(&mut self, message: Message) {
        self.out.explanation.push(message);
    }

    /// Takes a field out of the object at a pointer.
    pub(super) fn take(&mut self, pointer: &str, field: &str) -> Option<Value> {
        self.job.pointer_mut(pointer)?.as_object_mut()?.shift_remove(field)
    }

    /// Fills a field that the job leaves open; an explicit value stays. Whether it was filled.
    pub(super) fn offer(&mut self, pointer: &str, value: impl Into<Value>, parts: Vec<Part>) -> bool {
        let value = value.into();
        if let Some(there) = self.at(pointer) {
            let there = there.clone();
            self.overruled(pointer, &there, &value);
            self.out.origins.push(Origin {
                pointer: pointer.to_owned(),
                value: there,
                parts: vec![Part::new(From::Job)],
            });
            return false;
        }
        if !self.put(pointer, value.clone()) {
            return false;
        }
        self.out.origins.push(Origin { pointer: pointer.to_owned(), value, parts });
        true
    }

    /// Puts a value where the job may have one; objects on the way are made. Not where something else stands in the way.
    pub(super) fn put(&mut self, pointer: &str, value: Value) -> bool {
        let mut parts = pointer.split('/').skip(1).peekable();
        let mut place = &mut *self.job;
        while let Some(part) = parts.next() {
            if place.is_null() {
                *place = Value::Object(Map::new());
            }
            let next = match place {
                Value::Object(fields) => Some(fields.entry(part).or_insert(Value::Null)),
                Value::Array(items) => part.parse::<usize>().ok().and_then(|index| items.get_mut(index)),
                _ => None,
            };
            let Some(next) = next else { return false };
            if parts.peek().is_none() {
                *next = value;
                return true;
            }
            place = next;
        }
        false
    }

    /// A warning where the job says something else than the record.
    fn overruled(&mut self, pointer: &str, there: &Value, record: &Value) {
        let finding = Finding::new("overrides_record", pointer);
        match (there.as_f64(), record.as_f64()) {
            (Some(value), Some(of_record)) => {
                if (value - of_record).abs() > DIFFERS * of_record.abs() {
                    self.warn(finding.with("value", value).with("record", of_record));
                }
            }
            _ if there == record => {}
            _ => {
                if let (Some(value), Some(of_record)) = (there.as_str(), record.as_str()) {
                    self.warn(finding.with("value", value.to_owned()).with("record", of_record.to_owned()));
                }
            }
        }
    }
}
