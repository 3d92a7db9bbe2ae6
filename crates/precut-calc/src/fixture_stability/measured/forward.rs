//! The model as a diagnosis needs it: measured working points in, predictions out, effects as parameters.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::calculator::{
    ClassLimits, Consequence, Cost, Design, Diagnosable, Example, Expansions, Failure, Finding, ForwardModel,
    Hypotheses, Hypothesis, JacobianColumn, Monitor, NextRuns, Prediction, PrepareError, Quantity, Ranges, Rows,
    checkpoint,
};
use crate::effects::{Cause, FIXTURE_CAUSES, FixtureEffect, JointUncertainty};

use crate::fixture_stability::FixtureStability;
use crate::fixture_stability::job::acting::Case;
use crate::fixture_stability::job::input::FixtureJob;
use crate::fixture_stability::measured::consequence::consequences;
use crate::fixture_stability::measured::hypotheses::{Experiment, design, effects, expansions, values};
use crate::fixture_stability::measured::measurement::FixtureMeasurement;
use crate::fixture_stability::measured::next_runs::next_runs;
use crate::fixture_stability::measured::predict::{Ask, PreparedFixture, PreparedRow};
use crate::fixture_stability::model::floquet::Working;
use crate::fixture_stability::model::lobes::Rules;

/// How wrong the base may be without that being a finding: standard deviations.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields, default)]
pub struct FixtureAllowances {
    /// Level of all amplitudes (calibration of the gauge, force level), as a share.
    #[schema(minimum = 0.0, maximum = 1.0, example = 0.005, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("s_A"))))]
    pub amplitude_level_rel: f64,
    /// Scatter from cut to cut of the depth at which chatter begins, as a share: what makes a class uncertain near the limit.
    #[schema(minimum = 0.001, maximum = 1.0, example = 0.05, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("s_H"))))]
    pub limit_scatter_rel: f64,
    /// Scatter from cut to cut of the clamp force over what the cut asks for, as a share.
    #[schema(minimum = 0.001, maximum = 1.0, example = 0.1, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("s_F"))))]
    pub clamp_scatter_rel: f64,
    /// Zero of the time of each history.
    #[schema(minimum = 0.0, maximum = 1000.0, example = 0.05, extensions(("x-unit" = json!("ms")), ("x-symbol" = json!("s_t"))))]
    pub time_zero_ms: f64,
}

impl Default for FixtureAllowances {
    fn default() -> Self {
        Self { amplitude_level_rel: 0.005, limit_scatter_rel: 0.05, clamp_scatter_rel: 0.1, time_zero_ms: 0.05 }
    }
}

/// Conditions of one run; what it leaves out is as in the job.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct FixtureRun {
    /// Spindle speed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.1, maximum = 200_000.0, example = 380.0, extensions(("x-unit" = json!("rev/min")), ("x-symbol" = json!("n"))))]
    pub spindle_speed_rpm: Option<f64>,
    /// Feed per tooth.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.000_01, maximum = 10.0, example = 0.05, extensions(("x-unit" = json!("mm/tooth")), ("x-symbol" = json!("S_z"))))]
    pub feed_mm_per_tooth: Option<f64>,
    /// Axial depth of cut.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.0, maximum = 1000.0, example = 2.0, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("H"))))]
    pub depth_mm: Option<f64>,
    /// Time since the workpiece was clamped.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.0, maximum = 1e6, example = 10.0, extensions(("x-unit" = json!("min")), ("x-symbol" = json!("t"))))]
    pub time_since_clamping_min: Option<f64>,
}

/// What was measured in a run.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct FixturePoint {
    /// Axial depth of cut, where the run does not state it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.0, maximum = 1000.0, example = 2.0, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("H"))))]
    pub depth_mm: Option<f64>,
    /// Number of the repetition.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0, maximum = 1_000_000, example = 1, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("i"))))]
    pub repeat: Option<u32>,
    /// Time since the entry, for `displacement_um`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.0, maximum = 1000.0, example = 0.05, extensions(("x-unit" = json!("s")), ("x-symbol" = json!("t"))))]
    pub time_s: Option<f64>,
    /// Of a class: the margin that is asked for.
    #[serde(skip)]
    pub margin: RegimeMargin,
}

/// What decides how a cut goes.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, PartialOrd, Ord)]
pub enum RegimeMargin {
    /// Distance from chatter (`fixture/7.1`).
    #[default]
    Chatter,
    /// Distance from a joint that opens (`fixture/7.2`).
    Opening,
}

impl RegimeMargin {
    pub(in crate::fixture_stability) fn name(self) -> &'static str {
        match self {
            Self::Chatter => "chatter",
            Self::Opening => "opening",
        }
    }
}

/// What was measured.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::fixture_stability) enum Measure {
    PeakToPeak,
    Displacement,
    Regime,
    DepthLimit,
}

const QUANTITIES: &[Quantity] = &[
    Quantity { name: "peak_to_peak_um", unit: "um", logarithmic: true },
    Quantity { name: "displacement_um", unit: "um", logarithmic: false },
    Quantity { name: "depth_limit_mm", unit: "mm", logarithmic: true },
    // A class: what is predicted is its margin, a difference of logarithms.
    Quantity { name: "regime", unit: "1", logarithmic: false },
];

impl Measure {
    fn named(name: &str) -> Option<Self> {
        match name {
            "peak_to_peak_um" => Some(Self::PeakToPeak),
            "displacement_um" => Some(Self::Displacement),
            "regime" => Some(Self::Regime),
            "depth_limit_mm" => Some(Self::DepthLimit),
            _ => None,
        }
    }
}

impl ForwardModel for FixtureStability {
    type Job = FixtureJob;
    type Run = FixtureRun;
    type Point = FixturePoint;
    type Effect = FixtureEffect;
    type Allowances = FixtureAllowances;
    type Prepared = PreparedFixture;

    const CAUSES: &'static [Cause] = FIXTURE_CAUSES;
    const TAKES_OPEN_EFFECTS: bool = true;
    const QUANTITIES: &'static [Quantity] = QUANTITIES;
    const CONDITIONS: &'static [&'static str] = &["spindle_speed_rpm", "feed_mm_per_tooth", "depth_mm"];

    fn own_effects(job: &FixtureJob) -> &[FixtureEffect] {
        &job.effects
    }

    fn open_effects(job: &FixtureJob) -> &[JointUncertainty] {
        &job.uncertainty.effects
    }

    fn without_effects(job: &FixtureJob) -> FixtureJob {
        let mut job = FixtureJob { effects: Vec::new(), ..job.clone() };
        job.uncertainty.effects.clear();
        job
    }

    fn prepare(
        job: &FixtureJob,
        rows: &Rows<FixtureRun, FixturePoint>,
        quantity: &str,
        monitor: &dyn Monitor,
    ) -> Result<PreparedFixture, PrepareError> {
        checkpoint(monitor).map_err(PrepareError::Failed)?;
        let measure = Measure::named(quantity).ok_or_else(|| {
            let known: Vec<&'static str> = QUANTITIES.iter().map(|q| q.name).collect();
            PrepareError::Invalid(vec![
                Finding::new("unknown_quantity", "/quantity")
                    .with("quantity", quantity.to_owned())
                    .with("known", known),
            ])
        })?;
        let base = Case::of(job)
            .ok_or_else(|| PrepareError::Failed(Failure::Internal("a job that the check refuses".to_owned())))?;
        let mut faults = Vec::new();
        let mut prepared = Vec::with_capacity(rows.points.len());
        for (row, (run, point)) in rows.points.iter().enumerate() {
            let Some(of) = rows.runs.get(*run) else {
                faults.push(Finding::new("unknown_run", format!("/measurements/{row}/run")).with("run", *run));
                continue;
            };
            if measure == Measure::Displacement && point.time_s.is_none() {
                faults.push(Finding::new("time_missing", format!("/measurements/{row}/time_s")));
            }
            if point.margin == RegimeMargin::Opening && base.holding.clamp_force_n.is_none() {
                faults.push(Finding::new("opened_without_clamp_force", format!("/measurements/{row}/regime")));
            }
            prepared.push(PreparedRow {
                run: *run,
                working: Working {
                    spindle_rpm: of.spindle_speed_rpm.unwrap_or(base.working.spindle_rpm),
                    feed_mm: of.feed_mm_per_tooth.unwrap_or(base.working.feed_mm),
                    depth_mm: point.depth_mm.or(of.depth_mm).unwrap_or(base.working.depth_mm),
                },
                time_since_clamping_min: of.time_since_clamping_min.or(job.conditions.time_since_clamping_min),
                time_s: point.time_s.unwrap_or(0.0),
                margin: point.margin,
            });
        }
        if !faults.is_empty() {
            return Err(PrepareError::Invalid(faults));
        }
        PreparedFixture::new(job.clone(), base, prepared, measure, Rules::new(), monitor).map_err(PrepareError::Failed)
    }

    fn predict(
        prepared: &PreparedFixture,
        effects: &[FixtureEffect],
        monitor: &dyn Monitor,
    ) -> Result<Vec<Prediction>, Failure> {
        prepared.predicted(effects, Ask::new(monitor))
    }

    fn effect(cause: &Cause, values: &[f64]) -> Option<FixtureEffect> {
        FixtureEffect::from_parameters(cause, values)
    }

    fn nuisances(
        prepared: &PreparedFixture,
        effects: &[FixtureEffect],
        allowances: &FixtureAllowances,
        monitor: &dyn Monitor,
    ) -> Result<Vec<JacobianColumn>, Failure> {
        let level = allowances.amplitude_level_rel;
        match prepared.measure {
            // A level moves every logarithm alike.
            Measure::PeakToPeak | Measure::DepthLimit | Measure::Regime => Ok(vec![vec![level; prepared.rows.len()]]),
            Measure::Displacement => {
                let base = prepared.predicted(effects, Ask::new(monitor))?;
                let mut columns = vec![base.iter().map(|value| value.map_or(0.0, |value| level * value)).collect()];
                columns.extend(prepared.late_by_ms(allowances.time_zero_ms, effects, monitor)?);
                Ok(columns)
            }
        }
    }

    fn predict_cost(prepared: &PreparedFixture) -> Cost {
        Cost { ms: prepared.predict_ms(), bytes: 200_000, driver: "/measurements" }
    }
}

impl Diagnosable for FixtureStability {
    type Row = FixtureMeasurement;

    const DIAGNOSES: &'static [Example] = &[
        Example {
            id: "fixture",
            title: "Amplitudes at four speeds and six depths: the vise is softer than stated",
            job: include_str!("../examples/diagnosis_stiffness.json"),
        },
        Example {
            id: "fixture_classes",
            title: "Cuts at five speeds, each stable, chattering, or with a joint that opened",
            job: include_str!("../examples/diagnosis_classes.json"),
        },
    ];

    fn hypotheses(
        prepared: &PreparedFixture,
        _held: &[FixtureEffect],
        monitor: &dyn Monitor,
    ) -> Result<Hypotheses, Failure> {
        Experiment { prepared, monitor }.hypotheses()
    }

    fn effects(_prepared: &PreparedFixture, hypothesis: &Hypothesis, values: &[f64]) -> Option<Vec<FixtureEffect>> {
        effects(hypothesis, values)
    }

    fn values(_prepared: &PreparedFixture, hypothesis: &Hypothesis, effect: &FixtureEffect) -> Option<Vec<f64>> {
        values(hypothesis, effect)
    }

    fn design(prepared: &PreparedFixture) -> Design {
        design(prepared)
    }

    fn spreads(prepared: &PreparedFixture, allowances: &FixtureAllowances) -> Option<Vec<f64>> {
        let of = |row: &PreparedRow| match row.margin {
            RegimeMargin::Chatter => allowances.limit_scatter_rel,
            RegimeMargin::Opening => allowances.clamp_scatter_rel,
        };
        (prepared.measure == Measure::Regime).then(|| prepared.rows.iter().map(of).collect())
    }

    fn class_limits(
        prepared: &PreparedFixture,
        effects: &[FixtureEffect],
        monitor: &dyn Monitor,
    ) -> Result<Option<ClassLimits>, Failure> {
        if prepared.measure == Measure::Regime { prepared.class_limits(effects, monitor).map(Some) } else { Ok(None) }
    }

    fn place(point: &FixturePoint) -> Vec<(&'static str, Option<f64>)> {
        // A class is one row, whichever margins it speaks about; the first is always that of chatter.
        if point.margin == RegimeMargin::Opening {
            return Vec::new();
        }
        vec![("repeat", point.repeat.map(f64::from)), ("depth_mm", point.depth_mm), ("time_s", point.time_s)]
    }

    fn next_runs(
        job: &FixtureJob,
        rows: &Rows<FixtureRun, FixturePoint>,
        ranges: Ranges<'_>,
        _monitor: &dyn Monitor,
    ) -> Result<NextRuns<FixtureRun, FixturePoint>, Failure> {
        Ok(next_runs(job, rows, ranges))
    }

    fn consequences(
        job: &FixtureJob,
        _quantity: &str,
        runs: &[FixtureRun],
        believed: &[FixtureEffect],
        acting: &[Vec<FixtureEffect>],
        monitor: &dyn Monitor,
    ) -> Result<Vec<Consequence>, Failure> {
        consequences(job, runs, believed, acting, monitor)
    }

    fn expansions(_prepared: &PreparedFixture, hypothesis: &Hypothesis) -> Expansions {
        expansions(hypothesis)
    }

    fn predict_coarsely(
        prepared: &PreparedFixture,
        effects: &[FixtureEffect],
        monitor: &dyn Monitor,
    ) -> Result<Vec<Prediction>, Failure> {
        // Whether a point is stable is asked of the prediction itself, not of every step beside it.
        prepared.predicted(effects, Ask { whether_stable: false, ..Ask::new(monitor) })
    }

    fn predict_ms(_job: &FixtureJob) -> f64 {
        // Of one run of six depths, on average over the catalogue: 0.8 ms where the motion is linear, 6 ms with joints that
        // harden, 5 ms with uneven teeth (processor time, as measured in `predict`).
        1.6
    }
}
