//! One point of a study: its job looked up or computed, and what the table says of it.

use std::collections::btree_map::Entry;
use std::collections::{BTreeMap, BTreeSet};
use std::sync::Arc;
use std::time::Instant;

use precut_calc::calculator::{Failure, Finding, Monitor};
use serde::{Deserialize, Serialize};

use super::host::Host;
use super::pick::{Cited, Picked, Warning};
use super::plan::Plan;
use super::result::{Row, Status};
use crate::engine::answer::Stored;
use crate::engine::error::Error;
use crate::engine::exec::guarded;
use crate::engine::memory::Kept;
use crate::registry::Unfinished;
use crate::text::{Language, Texts};

/// Some points that are done.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct Shard {
    pub(crate) rows: Vec<Row>,
    /// Warnings of their answers.
    pub(crate) warnings: Vec<Warned>,
    pub(crate) basis: BTreeSet<Cited>,
}

/// A warning, and how many points have it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct Warned {
    pub(crate) code: String,
    pub(crate) pointer: String,
    pub(crate) points: usize,
    /// What it says of the first of them.
    pub(crate) first: serde_json::Map<String, serde_json::Value>,
}

/// Counts warnings by code and pointer.
#[derive(Debug, Clone, Default)]
pub(crate) struct Warnings(BTreeMap<(String, String), Warned>);

impl Warnings {
    /// Adds what points warn of that come after all before.
    pub(crate) fn add(&mut self, warned: Warned) {
        let place = (warned.code.clone(), warned.pointer.clone());
        match self.0.entry(place) {
            Entry::Vacant(place) => drop(place.insert(warned)),
            Entry::Occupied(mut known) => known.get_mut().points += warned.points,
        }
    }
    pub(crate) fn into_list(self) -> Vec<Warned> {
        self.0.into_values().collect()
    }
}

impl Shard {
    /// Computes the points of a range, each `apart` where that is wanted; after each one `done` is told.
    pub(crate) fn compute(
        plan: &Plan,
        points: std::ops::Range<usize>,
        host: &dyn Host,
        (monitor, apart): (&dyn Monitor, bool),
        mut done: impl FnMut(),
    ) -> Result<Self, Unfinished> {
        let mut shard = Self::default();
        let mut warnings = Warnings::default();
        for point in points {
            if monitor.cancelled() {
                return Err(Unfinished::Cancelled);
            }
            let (row, picked) = compute(plan, point, host, (monitor, apart))?;
            shard.rows.push(row);
            // Once per point, however many places of its answer warn of the same.
            let mut own = BTreeSet::new();
            for Warning { code, pointer, mut said } in picked.warnings {
                if own.insert((code.clone(), pointer.clone())) {
                    // It is worded when it is read.
                    said.shift_remove("detail");
                    warnings.add(Warned { code, pointer, points: 1, first: said });
                }
            }
            shard.basis.extend(picked.basis);
            done();
        }
        shard.warnings = warnings.into_list();
        Ok(shard)
    }
}

fn compute(
    plan: &Plan,
    point: usize,
    host: &dyn Host,
    (monitor, apart): (&dyn Monitor, bool),
) -> Result<(Row, Picked), Unfinished> {
    let mut key = None;
    let outcome = guarded(|| plan.ready(point)).and_then(|ready| {
        key = Some(ready.key);
        match host.kept(&ready.key) {
            Some(Kept::Answer(stored)) => Ok(stored),
            Some(Kept::Failure(failure)) => Err(Error::Calculation(failure)),
            None => {
                let begun = Instant::now();
                let outcome = guarded(|| host.compute(&ready, monitor, apart));
                host.keep(&ready, outcome, begun.elapsed())
            }
        }
    });
    let picked = outcome.and_then(|stored: Arc<Stored>| {
        let unreadable = |error: serde_json::Error| Error::Calculation(Failure::Internal(error.to_string()));
        plan.wanted.pick(&stored.body).map_err(unreadable)
    });
    let row = |status, said: Option<&Finding>, outputs| Row {
        values: plan.settings(point),
        status,
        code: said.map(|finding| finding.code.to_owned()),
        detail: said.map(|finding| Texts::shared().finding(Language::default(), "fault", finding)),
        detail_values: said.map(values_of),
        outputs,
        key: key.map(|key| key.to_string()),
    };
    match picked {
        Ok(picked) => Ok((row(Status::Succeeded, None, picked.numbers.clone()), picked)),
        Err(Error::Cancelled | Error::ShuttingDown) => Err(Unfinished::Cancelled),
        Err(Error::CrashedRepeatedly { .. }) => Err(Unfinished::Deadly),
        Err(error) => {
            let (status, finding) = reason(&error);
            let nothing = vec![None; plan.outputs.len()];
            Ok((row(status, Some(&finding), nothing), Picked::default()))
        }
    }
}

/// Why a point has no answer: what kind of reason, and what is to be said.
fn reason(error: &Error) -> (Status, Finding) {
    let whole = |code| Finding::new(code, "");
    match error {
        Error::Invalid { findings, .. } => {
            (Status::Invalid, findings.first().cloned().unwrap_or_else(|| whole("invalid_job")))
        }
        Error::Calculation(Failure::Infeasible(finding)) => (Status::Infeasible, finding.clone()),
        Error::Calculation(Failure::Conflicting(conflict)) => (Status::Infeasible, conflict.finding.clone()),
        Error::Calculation(Failure::OutOfModel(finding)) => (Status::OutOfModel, finding.clone()),
        Error::Calculation(Failure::NotRead { findings, .. }) => {
            (Status::Invalid, findings.first().cloned().unwrap_or_else(|| whole("program_not_read")))
        }
        Error::Calculation(Failure::NotConverged { what, residual, iterations }) => {
            let finding = whole("not_converged").with("what", *what).with("iterations", f64::from(*iterations));
            (Status::NotConverged, if residual.is_finite() { finding.with("residual", *residual) } else { finding })
        }
        Error::Crashed => (Status::Failed, whole("crashed")),
        _ => (Status::Failed, whole("internal")),
    }
}

/// What a sentence says beside its code, so that it can be said in another language.
fn values_of(finding: &Finding) -> serde_json::Value {
    serde_json::json!({
        "pointer": finding.pointer, "value": finding.value, "limit": finding.limit, "unit": finding.unit,
        "values": finding.values,
    })
}
