//! The model as a diagnosis needs it: cuts in, margins out, effects as parameters.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::calculator::{
    ClassLimits, Consequence, Cost, Design, Diagnosable, Example, Expansions, Failure, Finding, ForwardModel,
    Hypotheses, Hypothesis, JacobianColumn, Monitor, NextRuns, Outlook, Prediction, PrepareError, Quantity, Ranges,
    Rows,
};
use crate::effects::{Cause, JointUncertainty, MILLING_CAUSES, MillingEffect};

use super::super::MillingStability;
use super::super::job::Job;
use super::consequence::consequences;
use super::hypotheses::{design, effects, expansions, hypotheses, values};
use super::measurement::MillingMeasurement;
use super::next_runs::next_runs;
use super::predict::{PreparedMilling, cut_ms};

/// How wrong the base may be without that being a finding: standard deviations.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields, default)]
pub struct MillingAllowances {
    /// Level of all depths at which chatter begins, as a share.
    #[schema(minimum = 0.0, maximum = 1.0, example = 0.02, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("s_L"))))]
    pub limit_level_rel: f64,
    /// Scatter from cut to cut of the depth at which chatter begins, as a share: what makes a class uncertain near the limit.
    #[schema(minimum = 0.001, maximum = 1.0, example = 0.05, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("s_H"))))]
    pub limit_scatter_rel: f64,
    /// Scatter of a frequency that was heard about that of the model, as a share.
    #[schema(minimum = 0.0001, maximum = 1.0, example = 0.01, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("s_f"))))]
    pub frequency_scatter_rel: f64,
}

impl Default for MillingAllowances {
    fn default() -> Self {
        Self { limit_level_rel: 0.02, limit_scatter_rel: 0.05, frequency_scatter_rel: 0.01 }
    }
}

/// Conditions of some cuts; what they leave out is as in the job.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct MillingRun {
    /// Spindle speed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.1, maximum = 200_000.0, example = 9500.0, extensions(("x-unit" = json!("rev/min")), ("x-symbol" = json!("n"))))]
    pub spindle_speed_rpm: Option<f64>,
    /// Feed per tooth.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.000_01, maximum = 10.0, example = 0.1, extensions(("x-unit" = json!("mm/tooth")), ("x-symbol" = json!("S_z"))))]
    pub feed_mm_per_tooth: Option<f64>,
    /// Axial depth of cut.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.0, maximum = 1000.0, example = 1.5, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("H"))))]
    pub depth_mm: Option<f64>,
    /// Width of the milled strip.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.001, maximum = 5000.0, example = 8.0, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("a_e"))))]
    pub width_mm: Option<f64>,
}

/// A cut of a log.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct MillingPoint {
    /// Spindle speed, where the run does not state it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.1, maximum = 200_000.0, example = 9500.0, extensions(("x-unit" = json!("rev/min")), ("x-symbol" = json!("n"))))]
    pub spindle_speed_rpm: Option<f64>,
    /// Axial depth of cut, where the run does not state it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.0, maximum = 1000.0, example = 1.5, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("H"))))]
    pub depth_mm: Option<f64>,
    /// Width of the milled strip, where the run does not state it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.001, maximum = 5000.0, example = 8.0, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("a_e"))))]
    pub width_mm: Option<f64>,
    /// Frequency that was heard.
    #[serde(skip)]
    pub frequency_hz: Option<f64>,
    /// What is asked.
    #[serde(skip)]
    pub margin: CutMargin,
    /// Whether the cut was stable.
    #[serde(skip)]
    pub is_stable: bool,
}

/// What a row of a log speaks about.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, PartialOrd, Ord)]
pub enum CutMargin {
    /// Distance from chatter (`fixture/7.1`).
    #[default]
    Chatter,
    /// ln of the frequency of the model over that which was heard.
    Frequency,
}

impl CutMargin {
    pub(super) fn name(self) -> &'static str {
        match self {
            Self::Chatter => "chatter",
            Self::Frequency => "frequency",
        }
    }
}

const QUANTITIES: &[Quantity] = &[
    // A class: what is predicted is its margin, a difference of logarithms.
    Quantity { name: "class", unit: "1", logarithmic: false },
];

impl ForwardModel for MillingStability {
    type Job = Job;
    type Run = MillingRun;
    type Point = MillingPoint;
    type Effect = MillingEffect;
    type Allowances = MillingAllowances;
    type Prepared = PreparedMilling;

    const CAUSES: &'static [Cause] = MILLING_CAUSES;
    const TAKES_OPEN_EFFECTS: bool = true;
    const QUANTITIES: &'static [Quantity] = QUANTITIES;
    const CONDITIONS: &'static [&'static str] = &["spindle_speed_rpm", "depth_mm", "width_mm"];

    fn faults_of_point(job: &Job, point: &MillingPoint) -> Vec<Finding> {
        let mut faults = Vec::new();
        if point.is_stable && point.frequency_hz.is_some() {
            faults.push(Finding::new("frequency_of_stable_cut", "/frequency_hz"));
        }
        if point.width_mm.is_some() && job.cut.width_mm.is_none() {
            faults.push(Finding::new("width_beside_angles", "/width_mm"));
        }
        faults
    }

    fn own_effects(job: &Job) -> &[MillingEffect] {
        &job.effects
    }

    fn open_effects(job: &Job) -> &[JointUncertainty] {
        &job.uncertainty.effects
    }

    fn without_effects(job: &Job) -> Job {
        let mut job = Job { effects: Vec::new(), ..job.clone() };
        job.uncertainty.effects.clear();
        job
    }

    fn prepare(
        job: &Job,
        rows: &Rows<MillingRun, MillingPoint>,
        quantity: &str,
        monitor: &dyn Monitor,
    ) -> Result<PreparedMilling, PrepareError> {
        if !QUANTITIES.iter().any(|known| known.name == quantity) {
            let known: Vec<&'static str> = QUANTITIES.iter().map(|known| known.name).collect();
            return Err(PrepareError::Invalid(vec![
                Finding::new("unknown_quantity", "/quantity")
                    .with("quantity", quantity.to_owned())
                    .with("known", known),
            ]));
        }
        PreparedMilling::new(job, rows, monitor)
    }

    fn predict(
        prepared: &PreparedMilling,
        effects: &[MillingEffect],
        monitor: &dyn Monitor,
    ) -> Result<Vec<Prediction>, Failure> {
        prepared.predicted(effects, monitor)
    }

    fn effect(cause: &Cause, values: &[f64]) -> Option<MillingEffect> {
        MillingEffect::from_parameters(cause, values)
    }

    fn nuisances(
        prepared: &PreparedMilling,
        _effects: &[MillingEffect],
        allowances: &MillingAllowances,
        _monitor: &dyn Monitor,
    ) -> Result<Vec<JacobianColumn>, Failure> {
        // A level moves the logarithms of all limits alike, and no frequency.
        let level = |margin: CutMargin| if margin == CutMargin::Chatter { allowances.limit_level_rel } else { 0.0 };
        Ok(vec![prepared.rows.iter().map(|row| level(row.margin)).collect()])
    }

    fn predict_cost(prepared: &PreparedMilling) -> Cost {
        Cost { ms: prepared.predict_ms(), bytes: 400_000, driver: "/measurements" }
    }
}

impl Diagnosable for MillingStability {
    type Row = MillingMeasurement;

    // Processor time over that of one prediction of all rows: thirteen logs of 40 rows took 3 to 21 s, 9.5 s on average.
    const PREDICTIONS: f64 = 1000.0;

    const DIAGNOSES: &'static [Example] = &[Example {
        id: "chatter_log",
        title: "Cuts at eight speeds, stable or chattering: one mode of the tool is slower than the tap test said",
        job: include_str!("../examples/diagnosis_chatter_log.json"),
    }];

    fn hypotheses(
        prepared: &PreparedMilling,
        _held: &[MillingEffect],
        _monitor: &dyn Monitor,
    ) -> Result<Hypotheses, Failure> {
        Ok(hypotheses(prepared))
    }

    fn effects(_prepared: &PreparedMilling, hypothesis: &Hypothesis, values: &[f64]) -> Option<Vec<MillingEffect>> {
        effects(hypothesis, values)
    }

    fn values(_prepared: &PreparedMilling, hypothesis: &Hypothesis, effect: &MillingEffect) -> Option<Vec<f64>> {
        values(hypothesis, effect)
    }

    fn is_same(one: &MillingEffect, other: &MillingEffect) -> bool {
        one.kind() == other.kind() && one.mode() == other.mode()
    }

    fn design(prepared: &PreparedMilling) -> Design {
        design(prepared)
    }

    fn spreads(prepared: &PreparedMilling, allowances: &MillingAllowances) -> Option<Vec<f64>> {
        let of = |margin: CutMargin| match margin {
            CutMargin::Chatter => allowances.limit_scatter_rel,
            CutMargin::Frequency => allowances.frequency_scatter_rel,
        };
        Some(prepared.rows.iter().map(|row| of(row.margin)).collect())
    }

    fn class_limits(
        prepared: &PreparedMilling,
        effects: &[MillingEffect],
        monitor: &dyn Monitor,
    ) -> Result<Option<ClassLimits>, Failure> {
        prepared.class_limits(effects, monitor).map(Some)
    }

    fn place(point: &MillingPoint) -> Vec<(&'static str, Option<f64>)> {
        // A row is one cut, whatever it speaks about; the first is always the margin of chatter.
        if point.margin == CutMargin::Frequency {
            return Vec::new();
        }
        vec![("spindle_speed_rpm", point.spindle_speed_rpm), ("depth_mm", point.depth_mm), ("width_mm", point.width_mm)]
    }

    fn next_runs(
        job: &Job,
        rows: &Rows<MillingRun, MillingPoint>,
        ranges: Ranges<'_>,
        monitor: &dyn Monitor,
    ) -> Result<NextRuns<MillingRun, MillingPoint>, Failure> {
        next_runs(job, rows, ranges, &[], monitor)
    }

    fn next_runs_between(
        job: &Job,
        rows: &Rows<MillingRun, MillingPoint>,
        ranges: Ranges<'_>,
        likely: &[Vec<MillingEffect>],
        monitor: &dyn Monitor,
    ) -> Result<NextRuns<MillingRun, MillingPoint>, Failure> {
        next_runs(job, rows, ranges, likely, monitor)
    }

    fn outlooks(
        prepared: &PreparedMilling,
        allowances: &MillingAllowances,
        effects: &[MillingEffect],
        monitor: &dyn Monitor,
    ) -> Result<Option<Vec<Option<Outlook>>>, Failure> {
        prepared.outlooks(allowances, effects, monitor).map(Some)
    }

    fn consequences(
        job: &Job,
        _quantity: &str,
        _runs: &[MillingRun],
        believed: &[MillingEffect],
        acting: &[Vec<MillingEffect>],
        monitor: &dyn Monitor,
    ) -> Result<Vec<Consequence>, Failure> {
        consequences(job, believed, acting, monitor)
    }

    fn folds(rows: usize, _runs: usize) -> usize {
        rows.min(MOST_FOLDS)
    }

    fn expansions(_prepared: &PreparedMilling, hypothesis: &Hypothesis) -> Expansions {
        expansions(hypothesis)
    }

    fn predict_all_ms(job: &Job, _runs: usize, rows: usize) -> f64 {
        rows as f64 * cut_ms(job)
    }
}

/// Parts of a log that are held back: some speeds each, for the time that each takes.
pub(super) const MOST_FOLDS: usize = 4;
