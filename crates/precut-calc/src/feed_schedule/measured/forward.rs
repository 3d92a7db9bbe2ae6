//! The machinability models as functions of their effects: what a diagnosis runs forward.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::calculator::{
    Consequence, Cost, Design, Diagnosable, Example, Expansions, Failure, Finding, ForwardModel, Hypotheses,
    Hypothesis, JacobianColumn, KnownOver, Missing, Monitor, NextRuns, Prediction, PrepareError, Quantity, Ranges,
    Rows, Unnamed, checkpoint,
};
use crate::effects::{
    Cause, FactorLevel, JointUncertainty, MACHINABILITY_CAUSES, MachinabilityConditions, MachinabilityEffect as Effect,
};
use crate::machinability::{MachinabilityModel, ModelForm};

use crate::feed_schedule::FeedSchedule;
use crate::feed_schedule::job::acting::ActingModel;
use crate::feed_schedule::job::input::{Job, Reference};
use crate::feed_schedule::job::models::Output;
use crate::feed_schedule::job::open::ScheduleUncertainty;
use crate::feed_schedule::job::remainder;
use crate::feed_schedule::measured::conditions::with_conditions;
use crate::feed_schedule::measured::consequence::consequences;
use crate::feed_schedule::measured::design::{MOST_FOLDS, design};
use crate::feed_schedule::measured::hypotheses::expansions;
use crate::feed_schedule::measured::levels::{self, NamedLevel};
use crate::feed_schedule::measured::measurement::MachinabilityMeasurement;
use crate::feed_schedule::measured::next_runs::next_runs;

with_conditions! {
    /// Conditions that all measurements of a run share.
    #[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, ToSchema)]
    #[serde(deny_unknown_fields)]
    MachinabilityRun, wear: "Flank wear of the edge.", {} conditions {}
}

with_conditions! {
    /// The cut in which a value was measured; what it leaves out is taken from its run, then from the job.
    #[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, ToSchema)]
    #[serde(deny_unknown_fields)]
    MachinabilityPoint, wear: "Flank wear of the edge.", {} conditions {}
}

/// How wrong the model may be without that being a finding.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct MachinabilityAllowances {
    /// Level of the output, as a share, one standard deviation.
    #[serde(default = "level_rel")]
    #[schema(minimum = 0.0, maximum = 10.0, default = 0.01, example = 0.05, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("a_level"))))]
    pub level_rel: f64,
}

fn level_rel() -> f64 {
    0.01
}

impl Default for MachinabilityAllowances {
    fn default() -> Self {
        Self { level_rel: level_rel() }
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

/// Codes of the faults found here.
pub(in crate::feed_schedule) const CODES: &[&str] = &["regime_incomplete"];

/// What no effect parameter changes.
pub struct PreparedMachinability {
    pub(in crate::feed_schedule) model: MachinabilityModel,
    /// The output's name in `models`.
    pub(in crate::feed_schedule) output: String,
    /// Effects of the job, on any output.
    pub(in crate::feed_schedule) own: Vec<Effect>,
    pub(in crate::feed_schedule) reference: Reference,
    pub(in crate::feed_schedule) rows: Vec<Row>,
    pub(in crate::feed_schedule) named: Vec<NamedLevel>,
}

/// The cut behind a row.
pub(in crate::feed_schedule) struct Row {
    pub(in crate::feed_schedule) u: f64,
    pub(in crate::feed_schedule) x: f64,
    pub(in crate::feed_schedule) depth_mm: f64,
    pub(in crate::feed_schedule) angle_deg: Option<f64>,
    pub(in crate::feed_schedule) nose_radius_mm: Option<f64>,
    pub(in crate::feed_schedule) conditions: MachinabilityConditions,
    pub(in crate::feed_schedule) test: Option<f64>,
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
    const TAKES_OPEN_EFFECTS: bool = true;
    const QUANTITIES: &'static [Quantity] = QUANTITIES;
    const CONDITIONS: &'static [&'static str] =
        &["speed_m_per_min", "feed_mm_per_rev", "depth_mm", "time_min", "flank_wear_mm"];

    fn own_effects(job: &Job) -> &[Effect] {
        &job.effects
    }

    fn open_effects(job: &Job) -> &[JointUncertainty] {
        &job.uncertainty.effects
    }

    fn without_effects(job: &Job) -> Job {
        Job { effects: Vec::new(), uncertainty: ScheduleUncertainty::default(), ..job.clone() }
    }

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
        let mut cuts = Vec::with_capacity(rows.points.len());
        for (k, (run, point)) in rows.points.iter().enumerate() {
            let Some(shared) = rows.runs.get(*run) else {
                faults.push(Finding::new("unknown_run", format!("/measurements/{k}/run")).with("run", *run));
                continue;
            };
            let cut = row(job, shared, point);
            if let Err(field) = &cut {
                faults.push(Finding::new("regime_incomplete", format!("/measurements/{k}/{field}")));
            }
            let angle = point.cutting_edge_angle_deg.or(shared.cutting_edge_angle_deg).or(job.cutting_edge_angle_deg);
            if model.needs_angle() && angle.is_none() {
                faults.push(
                    Finding::new("edge_angle_missing", format!("/measurements/{k}/cutting_edge_angle_deg"))
                        .with("model", name.to_owned()),
                );
            }
            cuts.extend(cut.ok());
        }
        // What is measured is no condition of itself.
        if quantity == "flank_wear_mm" {
            for cut in &mut cuts {
                cut.conditions.flank_wear_mm = None;
            }
        }
        if !faults.is_empty() {
            return Err(PrepareError::Invalid(faults));
        }
        Ok(PreparedMachinability {
            own: job.effects.clone(),
            reference: reference(job, &cuts),
            named: levels::named(&job.conditions, &cuts, name),
            rows: cuts,
            output: name.to_owned(),
            model,
        })
    }

    fn predict(
        prepared: &PreparedMachinability,
        effects: &[Effect],
        monitor: &dyn Monitor,
    ) -> Result<Vec<Prediction>, Failure> {
        checkpoint(monitor)?;
        Ok(prepared.rows.iter().map(|row| prepared.value(row, effects)).collect())
    }

    fn effect(cause: &Cause, values: &[f64]) -> Option<Effect> {
        Effect::from_parameters(cause, values)
    }

    fn nuisances(
        prepared: &PreparedMachinability,
        _effects: &[Effect],
        allowances: &MachinabilityAllowances,
        _monitor: &dyn Monitor,
    ) -> Result<Vec<JacobianColumn>, Failure> {
        // Residuals are taken of logarithms: a share of the level is the same on every row.
        Ok(vec![vec![allowances.level_rel; prepared.rows.len()]])
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

impl Diagnosable for FeedSchedule {
    type Row = MachinabilityMeasurement;

    const DIAGNOSES: &'static [Example] = &[Example {
        id: "built_up_edge",
        title: "Roughness of 69 cuts: a built-up edge at low speed that the model does not know",
        job: include_str!("../examples/diagnosis_built_up_edge.json"),
    }];

    fn allowed(allowances: &MachinabilityAllowances, normal: &mut dyn FnMut() -> f64) -> Vec<Effect> {
        vec![Effect::LevelShift { delta_ln: allowances.level_rel * normal(), output: None }]
    }

    fn hypotheses(
        prepared: &PreparedMachinability,
        held: &[Effect],
        _monitor: &dyn Monitor,
    ) -> Result<Hypotheses, Failure> {
        Ok(prepared.hypotheses(held))
    }

    fn remainder(prepared: &PreparedMachinability, held: &[Effect], found: &Unnamed<'_>) -> Option<Effect> {
        prepared.remainder(held, found)
    }

    fn known_over(remainder: &Effect) -> Vec<KnownOver> {
        match remainder {
            Effect::Remainder { profile, .. } => remainder::known_over(profile),
            _ => Vec::new(),
        }
    }

    fn is_same(one: &Effect, other: &Effect) -> bool {
        match (one, other) {
            (
                Effect::Remainder { profile: one, output: of_one, .. },
                Effect::Remainder { profile: other, output: of_other, .. },
            ) => {
                let is_on_same = of_one.is_none() || of_other.is_none() || of_one == of_other;
                is_on_same && remainder::is_over_same(one, other)
            }
            _ => std::mem::discriminant(one) == std::mem::discriminant(other),
        }
    }

    fn effects(prepared: &PreparedMachinability, hypothesis: &Hypothesis, values: &[f64]) -> Option<Vec<Effect>> {
        prepared.effects_of(hypothesis, values)
    }

    fn values(prepared: &PreparedMachinability, hypothesis: &Hypothesis, effect: &Effect) -> Option<Vec<f64>> {
        prepared.values_of(hypothesis, effect)
    }

    fn design(prepared: &PreparedMachinability) -> Design {
        design(prepared)
    }

    fn next_runs(
        job: &Job,
        rows: &Rows<MachinabilityRun, MachinabilityPoint>,
        ranges: Ranges<'_>,
        _monitor: &dyn Monitor,
    ) -> Result<NextRuns<MachinabilityRun, MachinabilityPoint>, Failure> {
        let cuts: Vec<Row> =
            rows.points.iter().filter_map(|(run, point)| row(job, rows.runs.get(*run)?, point).ok()).collect();
        Ok(next_runs(&cuts, ranges))
    }

    fn consequences(
        job: &Job,
        quantity: &str,
        runs: &[MachinabilityRun],
        believed: &[Effect],
        acting: &[Vec<Effect>],
        monitor: &dyn Monitor,
    ) -> Result<Vec<Consequence>, Failure> {
        consequences(job, quantity, runs, believed, acting, monitor)
    }

    fn folds(rows: usize, _runs: usize) -> usize {
        rows.min(MOST_FOLDS)
    }

    fn expansions(_prepared: &PreparedMachinability, hypothesis: &Hypothesis) -> Expansions {
        expansions(hypothesis)
    }
}

impl PreparedMachinability {
    /// The base at the reference, where effects that are shares of the output have their scale.
    pub(in crate::feed_schedule) fn value_at_reference(&self) -> f64 {
        let typical = &self.reference;
        let model = &self.model;
        let depth = typical.depth_mm.unwrap_or(1.0);
        let l = model.constant_at(depth, typical.cutting_edge_angle_deg)
            + model.speed_exponent * typical.speed_m_per_min.unwrap_or(1.0).ln()
            + model.feed_exponent * typical.feed_mm_per_rev.unwrap_or(1.0).ln();
        if model.form == ModelForm::SemiLog { l } else { l.exp() }
    }

    fn value(&self, row: &Row, effects: &[Effect]) -> Prediction {
        let on_this = |effect: &&Effect| effect.output().is_none_or(|output| output == self.output);
        let all = || self.own.iter().chain(effects).filter(on_this);
        // Feed marks are those of the row's own insert.
        let marks = row.nose_radius_mm.and_then(|radius| {
            all().find_map(|effect| match effect {
                Effect::NoseRadiusFloor { k, output, .. } => {
                    Some(Effect::NoseRadiusFloor { k: *k, nose_radius_mm: radius, output: output.clone() })
                }
                _ => None,
            })
        });
        let acting = ActingModel::of(
            &self.model,
            all().map(|effect| match (effect, &marks) {
                (Effect::NoseRadiusFloor { .. }, Some(marks)) => marks,
                _ => effect,
            }),
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

/// A row with what its run and the job say of it; the field that nobody states.
fn row(job: &Job, run: &MachinabilityRun, point: &MachinabilityPoint) -> Result<Row, &'static str> {
    let mut factors = point.factors.clone();
    for known in run.factors.iter().chain(&job.conditions.factors) {
        if !factors.iter().any(|factor| factor.factor == known.factor) {
            factors.push(known.clone());
        }
    }
    let own = &job.conditions;
    Ok(Row {
        u: point.speed_m_per_min.or(run.speed_m_per_min).ok_or("speed_m_per_min")?.ln(),
        x: point.feed_mm_per_rev.or(run.feed_mm_per_rev).ok_or("feed_mm_per_rev")?.ln(),
        depth_mm: point.depth_mm.or(run.depth_mm).ok_or("depth_mm")?,
        angle_deg: point.cutting_edge_angle_deg.or(run.cutting_edge_angle_deg).or(job.cutting_edge_angle_deg),
        nose_radius_mm: point.nose_radius_mm.or(run.nose_radius_mm),
        conditions: MachinabilityConditions {
            flank_wear_mm: point.flank_wear_mm.or(run.flank_wear_mm).or(own.flank_wear_mm),
            batch: point.batch.clone().or_else(|| run.batch.clone()).or_else(|| own.batch.clone()),
            factors,
            nose_radius_mm: point.nose_radius_mm.or(run.nose_radius_mm).or(own.nose_radius_mm),
            time_min: point.time_min.or(run.time_min).or(own.time_min),
        },
        test: point.test.or(run.test),
    })
}

/// What exponents turn about: the job's reference, else the geometric mean of the rows.
fn reference(job: &Job, rows: &[Row]) -> Reference {
    let stated = job.reference.unwrap_or_default();
    let count = rows.len().max(1) as f64;
    let mean = |of: &dyn Fn(&Row) -> Option<f64>| -> Option<f64> {
        let sum: Option<f64> = rows.iter().map(of).sum();
        sum.filter(|_| !rows.is_empty()).map(|sum| (sum / count).exp())
    };
    Reference {
        speed_m_per_min: stated.speed_m_per_min.or_else(|| mean(&|row| Some(row.u))),
        feed_mm_per_rev: stated.feed_mm_per_rev.or_else(|| mean(&|row| Some(row.x))),
        depth_mm: stated.depth_mm.or_else(|| mean(&|row| Some(row.depth_mm.ln()))),
        cutting_edge_angle_deg: stated.cutting_edge_angle_deg.or_else(|| mean(&|row| row.angle_deg.map(f64::ln))),
    }
}
