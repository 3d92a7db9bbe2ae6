//! What is wrong with a job, put together from its schema, its tables, its names and the rules between its fields.

use precut_calc::calculator::Finding;
use serde_json::Value;

use crate::engine::error::Error;
use crate::engine::model;
use crate::registry::{Entry, by_pointer};

/// What the schema and the tables found.
pub(super) struct Found {
    pub(super) findings: Vec<Finding>,
    pub(super) total: usize,
    /// Pointers of tables that could not be read.
    pub(super) unread: Vec<String>,
}

impl Found {
    pub(super) fn of(findings: Vec<Finding>) -> Self {
        Self { total: findings.len(), findings, unread: Vec::new() }
    }

    /// Without fields that are missing.
    pub(super) fn without_missing(mut self) -> Self {
        let before = self.findings.len();
        self.findings.retain(|finding| general_code(finding) != "missing_field");
        self.total -= before - self.findings.len();
        self
    }

    /// With more of its faults.
    pub(super) fn listing(mut self, more: Vec<Finding>) -> Self {
        self.findings.extend(more);
        self
    }

    /// As an error.
    pub(super) fn told(self) -> Error {
        invalid(self.findings, self.total)
    }

    /// With more; the first fault at a place is enough.
    pub(super) fn and(mut self, more: Vec<Finding>) -> Self {
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
    pub(super) fn with_rules(mut self, entry: &Entry, job: &Value) -> Error {
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

/// The faults sorted by pointer, as many as are listed.
pub(super) fn invalid(mut findings: Vec<Finding>, total: usize) -> Error {
    findings.sort_by(by_pointer);
    findings.truncate(Error::MOST_FAULTS);
    Error::Invalid { findings, total }
}
