//! Streams of parts with a known truth.
#![allow(clippy::unwrap_used, clippy::panic, missing_docs)]

pub(crate) mod knowing;
pub(crate) mod series;

use precut_calc::calculator::{Calculator, ForwardModel, Rows, Unwatched};
use precut_calc::deflection_compensation::{DeflectionCompensation, DeflectionPoint, DeflectionRun, Job};
use precut_calc::effects::DeflectionEffect;
use precut_calc::num::stats::Resampler;
use precut_calc::process::{DocumentOf, PartOf, State, Watch};
use serde_json::{Value, json};
use std::ops::RangeInclusive;

pub(crate) type Document = DocumentOf<DeflectionCompensation>;
pub(crate) type Part = PartOf<DeflectionCompensation>;

/// A stream of the reference, as its file has it.
pub(crate) fn stream(name: &str) -> Value {
    let path =
        std::path::Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/..")).join("tests/reference/process").join(name);
    serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap()
}

/// As a process and its parts; allowances stated are those of the file but for the sigma, which is learned.
pub(crate) fn process(stream: &Value) -> (Document, Vec<Part>) {
    let types: serde_json::Map<String, Value> =
        stream["jobs"].as_object().unwrap().iter().map(|(name, job)| (name.clone(), json!({ "job": job }))).collect();
    let allowances = &stream["allowances"];
    let document = json!({
        "calculator": stream["calculator"], "part_types": types, "quantity": "diameter_deviation_um",
        "allowances": {
            "setup_diameter_um": allowances["setup_diameter_um"], "force_per_run_rel": allowances["force_per_run_rel"]
        },
        "options": stream["options"]
    });
    let mut document: Document = serde_json::from_value(document).unwrap();
    document.part_types.values_mut().for_each(|of| DeflectionCompensation::fill(&mut of.job));
    let parts = stream["parts"].as_array().unwrap().iter().map(|part| {
        let stations = stream["stations_mm"][part["type"].as_str().unwrap()].as_array().unwrap();
        let rows: Vec<Value> = stations
            .iter()
            .zip(part["rows_um"].as_array().unwrap())
            .map(|(z, um)| json!({ "z_mm": z, "diameter_deviation_um": um }))
            .collect();
        let checks = part.get("gauge_checks").cloned().unwrap_or_else(|| json!([]));
        serde_json::from_value(json!({
            "number": part["number"], "part_type": part["type"], "edge": part["edge"],
            "batch": part["batch"].to_string(), "gauge_checks": checks,
            "conditions": {
                "tool_path_at_start_m": part["tool_path_at_start_m"],
                "warm_time_at_start_min": part["warm_time_at_start_min"]
            },
            "measurements": rows
        }))
        .unwrap()
    });
    (document, parts.collect())
}

pub(crate) fn replay(document: &Document, parts: &[Part]) -> (Watch<DeflectionCompensation>, Vec<State>) {
    Watch::replay(document.clone(), parts, &Unwatched).unwrap()
}

/// Parts of one process with its own scatter and nothing else; `acting` tells what acts beside the job in a part.
pub(crate) struct Shop {
    pub(crate) document: Document,
    pub(crate) random: Resampler,
    pub(crate) template: Part,
    /// What the last part really was, row by row.
    pub(crate) truth: Vec<f64>,
}

impl Shop {
    pub(crate) fn new(seed: u64) -> Self {
        let (mut document, parts) = process(&stream("r10-nothing-300.json"));
        document.options.false_alarm_every_parts = 500;
        Self { document, random: Resampler::new(seed, 3), template: parts[0].clone(), truth: Vec::new() }
    }

    pub(crate) fn parts(&mut self, count: u32, acting: impl Fn(u32) -> Vec<DeflectionEffect>) -> Vec<Part> {
        self.cut(1..=count, acting)
    }

    pub(crate) fn cut(
        &mut self,
        numbers: RangeInclusive<u32>,
        acting: impl Fn(u32) -> Vec<DeflectionEffect>,
    ) -> Vec<Part> {
        let job = &self.document.part_types["A"].job;
        let points = self.template.measurements.iter().map(|row| (0, DeflectionPoint { z_mm: row.z_mm })).collect();
        let rows = Rows { runs: vec![self.template.conditions.clone()], points };
        let prepared = DeflectionCompensation::prepare(job, &rows, &self.document.quantity, &Unwatched).unwrap();
        let mut part = |number: u32| {
            let setup_um = self.random.normal();
            let mut acting = acting(number);
            acting.push(DeflectionEffect::ForceLevel { delta: 0.007 * self.random.normal() });
            let predicted = DeflectionCompensation::predict(&prepared, &acting, &Unwatched).unwrap();
            let mut part = Part { number, ..self.template.clone() };
            self.truth = predicted.into_iter().map(|um| um.unwrap() + setup_um).collect();
            for (row, um) in part.measurements.iter_mut().zip(&self.truth) {
                row.diameter_deviation_um = Some(um + self.random.normal());
            }
            part
        };
        numbers.map(&mut part).collect()
    }
}

/// The run on the path that the calculator gives for a job.
pub(crate) fn on_path(job: &Job, run: &DeflectionRun) -> DeflectionRun {
    let path = DeflectionCompensation::run(job, &Unwatched).unwrap().output.path.unwrap();
    assert!(path.complete);
    let zones = path.zones.iter();
    let points = zones.flat_map(|zone| zone.z_mm.iter().zip(&zone.commanded_diameter_mm));
    let points: Vec<Value> = points.map(|(z, d)| json!({ "z_mm": z, "diameter_mm": d })).collect();
    DeflectionRun { commanded_path: serde_json::from_value(json!(points)).unwrap(), ..run.clone() }
}

/// A number of draws: few, or as many as the environment asks for.
pub(crate) fn draws(variable: &str, few: u64) -> (u64, bool) {
    let wanted = std::env::var(variable).ok().and_then(|count| count.parse().ok());
    (wanted.unwrap_or(few), wanted.is_some())
}

/// Where the seeds of series begin; `PRECUT_PROCESS_SEED` takes others: what was chosen on some has to hold on others.
pub(crate) fn first_seed() -> u64 {
    draws("PRECUT_PROCESS_SEED", 0).0 * 100_000_000
}
