//! A study that can run: its variables and outputs found in the contracts, its points counted, its cost estimated.

use std::collections::BTreeSet;
use std::sync::Arc;

use precut_calc::calculator::{Cost, Finding};
use serde_json::{Map, Value};

use super::expand::{Shape, set};
use super::input::{Spacing, StudyInput};
use super::pick::Wanted;
use super::result::Setting;
use super::{check, faults};
use crate::engine::budget::Room;
use crate::engine::error::Error;
use crate::engine::names;
use crate::engine::read::{self, Ready};
use crate::registry::{Entry, Faults, Registry};

/// So many points at most are looked at before a study is accepted; all of them where there are no more.
const LOOKED_AT: usize = 64;
/// Fewer where the job is large: so many of its values are looked at in all, about 50 ms of work.
const VALUES_LOOKED_AT: usize = 100_000;
/// What a point costs beside its calculation (its job made, checked, looked up, its answer kept), ms.
const POINT_MS: f64 = 0.2;
/// What a row takes until the study is written, bytes.
const ROW_BYTES: u64 = 600;
/// What is lost at most when the process dies: the work of a shard that is computed, ms.
const SHARD_MS: f64 = 500.0;
/// Most points of a shard.
const MOST_SHARD_POINTS: usize = 256;

/// A study that can run.
pub(crate) struct Plan {
    /// The calculator whose job is varied.
    pub(crate) entry: Arc<Entry>,
    /// The study with its defaults, tables as rows.
    pub(crate) input: StudyInput,
    pub(crate) variables: Vec<Planned>,
    pub(crate) outputs: Vec<Output>,
    pub(crate) shape: Shape,
    pub(crate) points: usize,
    /// So many points are computed, and kept, together.
    pub(crate) shard_points: usize,
    pub(crate) cost: Cost,
    pub(crate) wanted: Wanted,
    /// What names in its points mean.
    names: names::Found,
}

/// A variable with its values.
pub(crate) struct Planned {
    pub(crate) pointer: String,
    pub(crate) tokens: Vec<String>,
    pub(crate) unit: Option<String>,
    pub(crate) spacing: Option<Spacing>,
    pub(crate) values: Vec<Value>,
}

/// A number of the result.
pub(crate) struct Output {
    pub(crate) pointer: String,
    pub(crate) tokens: Vec<String>,
    pub(crate) unit: Option<String>,
}

impl Plan {
    /// The plan of a study, or everything that is wrong with it.
    pub(crate) fn new(registry: &Registry, most_points: u64, mut input: StudyInput) -> Result<Self, Vec<Finding>> {
        let Some(entry) = registry.entry(&input.calculator) else {
            let mut found = vec![faults::unknown_calculator(registry, &input.calculator)];
            found.extend(check::structure(&input, most_points).1);
            return Err(found);
        };
        let mut found = rows_for_tables(entry, &mut input.job);
        let (lengths, structure) = check::structure(&input, most_points);
        found.extend(structure);
        let names = names::enclosed(input.records.as_ref());
        let fields = check::variables(entry, &input, &mut found);
        let outputs = check::outputs(entry, &mut input, &mut found);
        if !found.is_empty() {
            // What is wrong with the job itself is said along with it, as far as it can be told.
            // A table that could not be read is no fault of its own once more.
            let said: BTreeSet<String> = found.iter().map(|finding| finding.pointer.clone()).collect();
            found.extend(
                check::job(entry, &input, &fields, &names).into_iter().filter(|one| !said.contains(&one.pointer)),
            );
            return Err(found);
        }
        let shape = Shape::new(lengths, input.combine);
        // The check has held it against the limit.
        let points = usize::try_from(shape.points()).unwrap_or(usize::MAX);
        let variables = check::values(&input, fields, &mut found);
        if !found.is_empty() {
            return Err(found);
        }
        let wanted = Wanted::new(&outputs.iter().map(|output| output.tokens.clone()).collect::<Vec<_>>());
        let mut plan = Self {
            entry: Arc::clone(entry),
            input,
            variables,
            outputs,
            shape,
            points,
            shard_points: 1,
            cost: Cost { ms: 0.0, bytes: 0, driver: "/vary" },
            wanted,
            names,
        };
        plan.look()?;
        Ok(plan)
    }

    /// Looks at some points, all if they are few: what they cost, and whether the job is at fault wherever one looks.
    fn look(&mut self) -> Result<(), Vec<Finding>> {
        let size: usize = self.input.job.values().map(values_in).sum();
        let most = (VALUES_LOOKED_AT / size.max(1)).clamp(2, LOOKED_AT);
        let looked_at: Vec<usize> = if self.points <= most {
            (0..self.points).collect()
        } else {
            (0..most).map(|index| index * (self.points - 1) / (most - 1)).collect()
        };
        let mut common: Option<Vec<Finding>> = None;
        let (mut fine, mut ms, mut bytes) = (0_usize, 0.0, 0_u64);
        for &point in &looked_at {
            match self.ready(point) {
                Ok(ready) => {
                    fine += 1;
                    ms += ready.prepared.cost.ms;
                    bytes = bytes.max(ready.prepared.cost.bytes);
                }
                Err(Error::Invalid { findings, .. }) => match &mut common {
                    None => common = Some(findings),
                    Some(common) => {
                        let here: BTreeSet<_> = findings.iter().map(|one| (one.code, one.pointer.as_str())).collect();
                        common.retain(|one| here.contains(&(one.code, one.pointer.as_str())));
                    }
                },
                Err(_) => {}
            }
        }
        if fine == 0
            && let Some(common) = common.filter(|common| !common.is_empty())
        {
            return Err(common.into_iter().map(|finding| self.of_study(finding)).collect());
        }
        let each_ms = if fine > 0 { ms / fine as f64 } else { 0.0 };
        let points = u64::try_from(self.points).unwrap_or(u64::MAX);
        self.cost.ms = (each_ms + POINT_MS) * self.points as f64;
        self.cost.bytes = bytes.saturating_add(points.saturating_mul(ROW_BYTES));
        let together = (SHARD_MS / (each_ms + POINT_MS)).clamp(1.0, MOST_SHARD_POINTS as f64);
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // between 1 and 256
        {
            self.shard_points = together as usize;
        }
        Ok(())
    }

    /// A fault of every point as a fault of the study: at the variable that it concerns, or in the job.
    fn of_study(&self, mut finding: Finding) -> Finding {
        let varied = self.variables.iter().position(|variable| variable.pointer == finding.pointer);
        finding.pointer = match varied {
            Some(index) => format!("/vary/{index}"),
            None => format!("/job{}", finding.pointer),
        };
        finding
    }

    /// The job of a point.
    pub(crate) fn job(&self, point: usize) -> Map<String, Value> {
        let mut job = self.input.job.clone();
        for (variable, place) in self.variables.iter().zip(self.shape.at(point)) {
            // There is a way: the check has walked it.
            set(&mut job, &variable.tokens, variable.values[place].clone());
        }
        job
    }

    /// The job of a point, ready to run.
    pub(crate) fn ready(&self, point: usize) -> Result<Ready, Error> {
        read::read_point(&self.entry, Value::Object(self.job(point)), &self.names)
    }

    /// What the variables are at a point.
    pub(crate) fn settings(&self, point: usize) -> Vec<Setting> {
        let places = self.shape.at(point);
        self.variables.iter().zip(places).filter_map(|(variable, place)| Setting::of(&variable.values[place])).collect()
    }

    /// How many shards there are.
    pub(crate) fn shards(&self) -> usize {
        self.points.div_ceil(self.shard_points)
    }

    /// The points of a shard.
    pub(crate) fn shard(&self, index: usize) -> std::ops::Range<usize> {
        let first = index * self.shard_points;
        first..self.points.min(first + self.shard_points)
    }
}

/// How many values there are in a value, itself among them.
fn values_in(value: &Value) -> usize {
    match value {
        Value::Array(items) => 1 + items.iter().map(values_in).sum::<usize>(),
        Value::Object(fields) => 1 + fields.values().map(values_in).sum::<usize>(),
        _ => 1,
    }
}

/// Puts rows in the place of CSV in the job; its faults.
fn rows_for_tables(entry: &Entry, job: &mut Map<String, Value>) -> Vec<Finding> {
    let mut whole = Value::Object(std::mem::take(job));
    let mut faults = Faults::default();
    let places = entry.tables_of(&whole).to_vec();
    crate::engine::table::resolve(&mut whole, (&[], &Room::default()), &places, &mut faults);
    if let Value::Object(resolved) = whole {
        *job = resolved;
    }
    faults.listed.into_iter().map(faults::in_job).collect()
}

/// A variable's field and its values, not expanded yet.
pub(crate) struct Found {
    pub(crate) tokens: Vec<String>,
    pub(crate) field: super::place::Field,
}
