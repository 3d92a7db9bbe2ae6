//! The machinability models as functions of their effects: what a diagnosis runs forward.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::calculator::{
    Cost, Failure, Finding, ForwardModel, JacobianColumn, Missing, Monitor, Prediction, PrepareError, Quantity, Rows,
};
use crate::effects::{
    Cause, FactorLevel, MACHINABILITY_CAUSES, MachinabilityConditions, MachinabilityEffect as Effect,
};
use crate::machinability::{MachinabilityModel, ModelForm};

use super::FeedSchedule;
use super::acting::ActingModel;
use super::input::{Job, Reference};
use super::models::Output;

/// Conditions that all measurements of a run share; what it leaves out is taken from the job.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct MachinabilityRun {
    /// Batch of the material.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(max_length = 64, example = "B")]
    pub batch: Option<String>,
    /// Levels of named factors.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schema(max_items = 20)]
    pub factors: Vec<FactorLevel>,
}

/// The cut in which a value was measured; what it leaves out is taken from the job.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct MachinabilityPoint {
    /// Cutting speed.
    #[schema(minimum = 1e-2, maximum = 20_000.0, example = 60.0, extensions(("x-unit" = json!("m/min")), ("x-symbol" = json!("V"))))]
    pub speed_m_per_min: f64,
    /// Feed.
    #[schema(minimum = 1e-4, maximum = 20.0, example = 0.2, extensions(("x-unit" = json!("mm/rev")), ("x-symbol" = json!("S"))))]
    pub feed_mm_per_rev: f64,
    /// Depth of cut.
    #[schema(minimum = 1e-4, maximum = 1000.0, example = 0.5, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("t"))))]
    pub depth_mm: f64,
    /// Major cutting edge angle.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 1.0, maximum = 179.0, example = 75.0, extensions(("x-unit" = json!("deg")), ("x-symbol" = json!("phi"))))]
    pub cutting_edge_angle_deg: Option<f64>,
    /// Flank wear of the edge.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.0, maximum = 10.0, example = 0.2, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("VB"))))]
    pub flank_wear_mm: Option<f64>,
    /// Batch of the material.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(max_length = 64, example = "B")]
    pub batch: Option<String>,
    /// Levels of named factors.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schema(max_items = 20)]
    pub factors: Vec<FactorLevel>,
    /// Place in the order of the tests.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.0, maximum = 1e9, example = 7.0, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("test"))))]
    pub test: Option<f64>,
    /// Time that the edge had been in the cut.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.0, maximum = 1e6, example = 5.0, extensions(("x-unit" = json!("min")), ("x-symbol" = json!("T"))))]
    pub time_min: Option<f64>,
}

/// How wrong the model may be without that being a finding.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct MachinabilityAllowances {
    /// Level of the output, relative, one standard deviation.
    #[serde(default = "no_allowance")]
    #[schema(minimum = 0.0, maximum = 10.0, default = 0.0, example = 0.05, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("a_level"))))]
    pub level_rel: f64,
}

fn no_allowance() -> f64 {
    0.0
}

impl Default for MachinabilityAllowances {
    fn default() -> Self {
        Self { level_rel: no_allowance() }
    }
}

const QUANTITIES: &[Quantity] = &[
    Quantity { name: "force_z_n", unit: "N", logarithmic: true },
    Quantity { name: "force_y_n", unit: "N", logarithmic: true },
    Quantity { name: "tool_life_min", unit: "min", logarithmic: true },
    Quantity { name: "roughness_um", unit: "um", logarithmic: true },
    Quantity { name: "hardening_percent", unit: "percent", logarithmic: true },
    Quantity { name: "hardening_depth_um", unit: "um", logarithmic: true },
    Quantity { name: "flank_wear_mm", unit: "mm", logarithmic: true },
];

/// What no effect parameter changes.
pub struct PreparedMachinability {
    model: MachinabilityModel,
    /// Effects of the job on this output.
    own: Vec<Effect>,
    reference: Reference,
    rows: Vec<Row>,
}

struct Row {
    u: f64,
    x: f64,
    depth_mm: f64,
    angle_deg: Option<f64>,
    conditions: MachinabilityConditions,
}

/// The model behind a quantity, and its name among the outputs: `roughness_um`, or a further output by its own name,
/// with or without its unit at the end.
fn model_of<'a>(job: &'a Job, quantity: &str) -> Option<(&'a str, MachinabilityModel)> {
    for output in Output::ALL {
        if quantity == format!("{}_{}", output.name(), output.unit().to_lowercase()) || quantity == output.name() {
            return job.models.acting(output, job.force.as_ref()).map(|model| (output.name(), model));
        }
    }
    job.models
        .further
        .iter()
        .find(|further| quantity == further.name || quantity == format!("{}_{}", further.name, further.unit))
        .map(|further| (further.name.as_str(), further.model.clone()))
}

impl ForwardModel for FeedSchedule {
    type Job = Job;
    type Run = MachinabilityRun;
    type Point = MachinabilityPoint;
    type Effect = Effect;
    type Allowances = MachinabilityAllowances;
    type Prepared = PreparedMachinability;

    const CAUSES: &'static [Cause] = MACHINABILITY_CAUSES;
    const QUANTITIES: &'static [Quantity] = QUANTITIES;

    fn prepare(
        job: &Job,
        rows: &Rows<MachinabilityRun, MachinabilityPoint>,
        quantity: &str,
        _monitor: &dyn Monitor,
    ) -> Result<PreparedMachinability, PrepareError> {
        let Some((name, model)) = model_of(job, quantity) else {
            let known: Vec<&'static str> = QUANTITIES.iter().map(|q| q.name).collect();
            return Err(PrepareError::Invalid(vec![
                Finding::new("unknown_quantity", "/quantity")
                    .with("quantity", quantity.to_owned())
                    .with("known", known),
            ]));
        };
        let mut faults = Vec::new();
        for (k, (run, point)) in rows.points.iter().enumerate() {
            if *run >= rows.runs.len() {
                faults.push(Finding::new("unknown_run", format!("/measurements/{k}/run")).with("run", *run));
            }
            let angle = point.cutting_edge_angle_deg.or(job.cutting_edge_angle_deg);
            if model.needs_angle() && angle.is_none() {
                faults.push(
                    Finding::new("edge_angle_missing", format!("/measurements/{k}/cutting_edge_angle_deg"))
                        .with("model", name.to_owned()),
                );
            }
        }
        if !faults.is_empty() {
            return Err(PrepareError::Invalid(faults));
        }
        let own = job.effects.iter().filter(|effect| effect.output().is_none_or(|output| output == name)).cloned();
        Ok(PreparedMachinability {
            own: own.collect(),
            reference: reference(job, rows),
            rows: rows.points.iter().map(|(run, point)| row(job, &rows.runs[*run], point)).collect(),
            model,
        })
    }

    fn predict(prepared: &PreparedMachinability, effects: &[Effect]) -> Result<Vec<Prediction>, Failure> {
        Ok(prepared.rows.iter().map(|row| prepared.value(row, effects)).collect())
    }

    fn effect(cause: &Cause, values: &[f64]) -> Option<Effect> {
        Effect::from_parameters(cause, values)
    }

    fn nuisances(
        prepared: &PreparedMachinability,
        allowances: &MachinabilityAllowances,
    ) -> Result<Vec<JacobianColumn>, Failure> {
        // The level: relative, so the column is the prediction itself times the allowance.
        let column = Self::predict(prepared, &[])?
            .into_iter()
            .map(|value| value.map_or(0.0, |value| value * allowances.level_rel))
            .collect();
        Ok(vec![column])
    }

    fn predict_cost(prepared: &PreparedMachinability) -> Cost {
        // About 0.2 us per row: a few logarithms and an exponential.
        Cost {
            ms: 0.0002 * prepared.rows.len() as f64,
            bytes: 300 * prepared.rows.len() as u64,
            driver: "/measurements",
        }
    }
}

impl PreparedMachinability {
    fn value(&self, row: &Row, effects: &[Effect]) -> Prediction {
        let acting = ActingModel::of(
            &self.model,
            self.own.iter().chain(effects),
            &row.conditions,
            &self.reference,
            row.depth_mm,
            row.angle_deg,
        );
        let value = acting.output(row.u, row.x);
        let positive = self.model.form == ModelForm::SemiLog || value > 0.0;
        if value.is_finite() && positive { Ok(value) } else { Err(Missing::NoSolution) }
    }
}

fn row(job: &Job, run: &MachinabilityRun, point: &MachinabilityPoint) -> Row {
    let mut factors = point.factors.clone();
    for known in run.factors.iter().chain(&job.conditions.factors) {
        if !factors.iter().any(|factor| factor.factor == known.factor) {
            factors.push(known.clone());
        }
    }
    Row {
        u: point.speed_m_per_min.ln(),
        x: point.feed_mm_per_rev.ln(),
        depth_mm: point.depth_mm,
        angle_deg: point.cutting_edge_angle_deg.or(job.cutting_edge_angle_deg),
        conditions: MachinabilityConditions {
            flank_wear_mm: point.flank_wear_mm.or(job.conditions.flank_wear_mm),
            batch: point.batch.clone().or_else(|| run.batch.clone()).or_else(|| job.conditions.batch.clone()),
            factors,
            time_min: point.time_min.or(job.conditions.time_min),
        },
    }
}

/// What exponents turn about: the job's reference, else the geometric mean of the rows.
fn reference(job: &Job, rows: &Rows<MachinabilityRun, MachinabilityPoint>) -> Reference {
    let stated = job.reference.unwrap_or_default();
    let count = rows.points.len().max(1) as f64;
    let mean = |of: &dyn Fn(&MachinabilityPoint) -> Option<f64>| -> Option<f64> {
        let sum: Option<f64> = rows.points.iter().map(|(_, point)| of(point).map(f64::ln)).sum();
        sum.filter(|_| !rows.points.is_empty()).map(|sum| (sum / count).exp())
    };
    Reference {
        speed_m_per_min: stated.speed_m_per_min.or_else(|| mean(&|p| Some(p.speed_m_per_min))),
        feed_mm_per_rev: stated.feed_mm_per_rev.or_else(|| mean(&|p| Some(p.feed_mm_per_rev))),
        depth_mm: stated.depth_mm.or_else(|| mean(&|p| Some(p.depth_mm))),
        cutting_edge_angle_deg: stated
            .cutting_edge_angle_deg
            .or_else(|| mean(&|p| p.cutting_edge_angle_deg.or(job.cutting_edge_angle_deg))),
    }
}
