//! Parameter studies: one calculator's job computed over values of one to three of its fields.
//!
//! A study is declared like a calculator and served like one: it has an entry of its own (`studies`), so that parsing,
//! the cache, jobs, tables, figures, the contract and the command line are those of every calculator. Its physics is
//! other calculators': every point is an ordinary job, looked up and kept under its own key.

mod check;
mod expand;
mod faults;
mod figure;
mod head;
mod host;
mod in_engine;
mod input;
mod label;
mod pick;
mod place;
mod plan;
mod point;
mod report;
mod result;
mod run;
mod table;
#[cfg(test)]
mod tests;

pub(crate) use head::shape;
pub(crate) use host::{Alone, Host};
pub(crate) use in_engine::InEngine;

use std::sync::Arc;

use precut_calc::calculator::{
    CalculatorKind, Codes, Example, Failure, Figure, Finding, Meta, Monitor, Program, Table,
};
use serde::Deserialize;
use serde_json::Value;

use input::StudyInput;
use plan::Plan;
use result::StudyResult;
use run::Shards;

use crate::engine::names;
use crate::registry::{
    Calculation, Entry, Job, Prepared, Registry, ResultNotes, Sharded, Unprepared, UnreadableResult, canonical,
    second_line,
};

/// Name of studies in routes and job files.
pub const STUDIES: &str = "studies";
/// So many points has a study at most, unless it is set otherwise.
pub(crate) const MOST_POINTS: u64 = 100_000;

/// Studies that are shown in the contract; those of calculators that are not there are left out.
pub(crate) const EXAMPLES: &[Example] = &[
    Example {
        id: "feed_and_tailstock",
        title: "Form error of a slender shaft over feed and tailstock compliance",
        job: include_str!("examples/feed_and_tailstock.json"),
    },
    Example {
        id: "bore",
        title: "How far a shaft may be bored out; the last bore leaves nothing and keeps its row",
        job: include_str!("examples/bore.json"),
    },
];

const META: Meta = Meta {
    id: STUDIES,
    kind: CalculatorKind::Calculator,
    version: 1,
    title: "Parameter study",
    question: "How does an answer change with one to three fields of its job?",
    summary: "Varies one to three fields of any calculator's or evaluation's job over a grid or side by side, and reads \
              numbers off each result. Every point is an ordinary job with an answer of its own: `key` in its row is its \
              address. A point that has no answer keeps its row with status and code. The picture is a map over two \
              fields, curves over one, slices over three.",
    references: &[],
    examples: EXAMPLES,
    hallmarks: &[],
    study_outputs: &[],
    codes: Codes {
        faults: &[faults::FAULTS],
        failures: &[],
        warnings: &[report::WARNINGS],
        explanations: &[report::EXPLANATIONS],
        stages: &[&["study_point"]],
        labels: &[figure::LABELS, figure::TITLES],
    },
    figures: figure::FIGURES,
    tables: table::TABLES,
    program: None,
};

/// The entry of studies over the calculators of a registry.
pub(crate) fn entry(registry: &Registry, most_points: u64, host: Arc<dyn Host>) -> Entry {
    let studies = Studies { registry: registry.clone(), most_points, host };
    Entry::composed::<StudyInput, StudyResult>(&META, Box::new(studies))
}

/// Studies over the calculators of a registry.
struct Studies {
    registry: Registry,
    most_points: u64,
    host: Arc<dyn Host>,
}

impl Calculation for Studies {
    fn prepare(&self, job: &Value) -> Result<Prepared, Unprepared> {
        let input: StudyInput =
            serde_path_to_error::deserialize(job).map_err(|error| Unprepared::Invalid(vec![second_line(&error)]))?;
        let plan = Plan::new(&self.registry, self.most_points, input).map_err(Unprepared::Invalid)?;
        let canonical = canonical(&plan.input)
            .map_err(|error| Unprepared::Failed(Failure::Internal(format!("the filled study: {error}"))))?;
        let (cost, entry, plan) = (plan.cost, Arc::clone(&plan.entry), Arc::new(plan));
        let study = Study { shards: Arc::new(Shards::new(&plan, &self.host)), plan };
        Ok(Prepared::new(cost, canonical, Some(entry.meta()), Box::new(study)))
    }

    fn broken_rules(&self, job: &Value) -> Vec<Finding> {
        let Ok(input) = StudyInput::deserialize(job) else { return Vec::new() };
        Plan::new(&self.registry, self.most_points, input).err().unwrap_or_default()
    }

    fn faults_of_head(&self, job: &Value) -> Vec<Finding> {
        let Ok(input) = StudyInput::deserialize(job) else { return Vec::new() };
        let Some(entry) = self.registry.entry(&input.calculator) else { return Vec::new() };
        let fields = check::variables(entry, &input, &mut Vec::new());
        check::job(entry, &input, &fields, &names::enclosed(input.records.as_ref()))
    }

    fn figures(&self, _input: &[u8], envelope: &[u8]) -> Result<Vec<Figure>, UnreadableResult> {
        Ok(figure::of_result(&self.registry, &read(envelope)?))
    }

    fn tables(&self, _input: &[u8], envelope: &[u8]) -> Result<Vec<Table>, UnreadableResult> {
        Ok(table::tables(&read(envelope)?))
    }

    fn program(&self, _input: &[u8], _envelope: &[u8]) -> Result<Option<Result<Program, Failure>>, UnreadableResult> {
        Ok(None)
    }
}

fn read(envelope: &[u8]) -> Result<StudyResult, UnreadableResult> {
    #[derive(Deserialize)]
    struct Envelope {
        result: StudyResult,
    }
    let envelope: Envelope = serde_json::from_slice(envelope).map_err(|error| UnreadableResult(error.to_string()))?;
    Ok(envelope.result)
}

/// A study that can run.
struct Study {
    plan: Arc<Plan>,
    shards: Arc<Shards>,
}

impl Job for Study {
    /// Measured tables of the job as row count and hash.
    fn input(&self) -> Result<Value, Failure> {
        let mut input = self.plan.input.clone();
        let job = Value::Object(std::mem::take(&mut input.job));
        let places = self.plan.entry.tables_of(&job).to_vec();
        let job = super::table::without_rows(job, &places);
        if let Value::Object(job) = job {
            input.job = job;
        }
        input.records = None;
        serde_json::to_value(&input).map_err(|error| Failure::Internal(format!("the filled study: {error}")))
    }

    fn write_input(&self, body: &mut Vec<u8>) -> Result<(), Failure> {
        let input = self.input()?;
        serde_json::to_writer(body, &input).map_err(|error| Failure::Internal(format!("the filled study: {error}")))
    }

    fn run(&self, monitor: &dyn Monitor, body: &mut Vec<u8>) -> Result<ResultNotes, Failure> {
        let (result, notes) = report::report(&self.plan, self.shards.all(monitor)?);
        serde_json::to_writer(body, &result).map_err(|error| Failure::Internal(format!("the study: {error}")))?;
        Ok(notes)
    }

    fn sharded(&self) -> Option<Arc<dyn Sharded>> {
        self.shards.are_many().then(|| Arc::<Shards>::clone(&self.shards) as _)
    }
}
