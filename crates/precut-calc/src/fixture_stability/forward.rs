//! The model as a diagnosis needs it: measured working points in, predictions out, effects as parameters.

use std::collections::BTreeMap;

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::calculator::{
    Cost, Failure, Finding, ForwardModel, JacobianColumn, Missing, Monitor, Prediction, PrepareError, Quantity, Rows,
    Unwatched, checkpoint,
};
use crate::effects::{Cause, FIXTURE_CAUSES, FixtureConditions, FixtureEffect};

use super::FixtureStability;
use super::acting::Case;
use super::answer::{UM_PER_MM, forced};
use super::check;
use super::floquet::Working;
use super::holding::Closed;
use super::input::FixtureJob;
use super::lobes::{Rules, critical_depth, point};
use super::response::Response;
use super::simulate::{plan, run as simulate};

/// How wrong the base may be without that being a finding: standard deviations.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields, default)]
pub struct FixtureAllowances {
    /// Level of all amplitudes (calibration of the gauge, force level), as a share.
    #[schema(minimum = 0.0, maximum = 1.0, example = 0.005, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("s_A"))))]
    pub amplitude_level_rel: f64,
}

impl Default for FixtureAllowances {
    fn default() -> Self {
        Self { amplitude_level_rel: 0.005 }
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
    #[schema(minimum = 0.000_01, maximum = 10.0, example = 0.05, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("S_z"))))]
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
}

#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Measure {
    PeakToPeak,
    Displacement,
    Regime,
    DepthLimit,
}

const QUANTITIES: &[Quantity] = &[
    Quantity { name: "peak_to_peak_um", unit: "um", logarithmic: true },
    Quantity { name: "displacement_um", unit: "um", logarithmic: false },
    // Margin: positive stable with closed joints, negative chattering or opened; enters as a probit.
    Quantity { name: "regime", unit: "1", logarithmic: false },
    Quantity { name: "depth_limit_mm", unit: "mm", logarithmic: true },
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

/// What no effect parameter changes.
pub struct PreparedFixture {
    job: FixtureJob,
    rows: Vec<PreparedRow>,
    measure: Measure,
    rules: Rules,
}

#[derive(Clone, Copy)]
struct PreparedRow {
    working: Working,
    time_since_clamping_min: Option<f64>,
    time_s: Option<f64>,
}

impl ForwardModel for FixtureStability {
    type Job = FixtureJob;
    type Run = FixtureRun;
    type Point = FixturePoint;
    type Effect = FixtureEffect;
    type Allowances = FixtureAllowances;
    type Prepared = PreparedFixture;

    const CAUSES: &'static [Cause] = FIXTURE_CAUSES;
    const QUANTITIES: &'static [Quantity] = QUANTITIES;

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
            prepared.push(PreparedRow {
                working: Working {
                    spindle_rpm: of.spindle_speed_rpm.unwrap_or(base.working.spindle_rpm),
                    feed_mm: of.feed_mm_per_tooth.unwrap_or(base.working.feed_mm),
                    depth_mm: point.depth_mm.or(of.depth_mm).unwrap_or(base.working.depth_mm),
                },
                time_since_clamping_min: of.time_since_clamping_min.or(job.conditions.time_since_clamping_min),
                time_s: point.time_s,
            });
        }
        if !faults.is_empty() {
            return Err(PrepareError::Invalid(faults));
        }
        Ok(PreparedFixture { job: job.clone(), rows: prepared, measure, rules: Rules::new() })
    }

    fn predict(prepared: &PreparedFixture, effects: &[FixtureEffect]) -> Result<Vec<Prediction>, Failure> {
        prepared.predict(effects)
    }

    fn effect(cause: &Cause, values: &[f64]) -> Option<FixtureEffect> {
        FixtureEffect::from_parameters(cause, values)
    }

    fn nuisances(prepared: &PreparedFixture, allowances: &FixtureAllowances) -> Result<Vec<JacobianColumn>, Failure> {
        // A level moves every value by the same share; the margin of a regime has none.
        let share = if prepared.measure == Measure::Regime { 0.0 } else { allowances.amplitude_level_rel };
        let base = prepared.predict(&[])?;
        Ok(vec![base.iter().map(|value| value.map_or(0.0, |value| share * value)).collect()])
    }

    fn predict_cost(prepared: &PreparedFixture) -> Cost {
        let each_ms = match prepared.measure {
            Measure::PeakToPeak | Measure::Regime => 0.3,
            Measure::DepthLimit => 2.0,
            Measure::Displacement => 8.0,
        };
        Cost { ms: each_ms * prepared.rows.len() as f64, bytes: 200_000, driver: "/measurements" }
    }
}

/// Rows of one working point share their prediction's ingredients.
type Key = (u64, u64, u64, u64);

impl PreparedFixture {
    fn predict(&self, effects: &[FixtureEffect]) -> Result<Vec<Prediction>, Failure> {
        let mut all = self.job.effects.clone();
        all.extend_from_slice(effects);
        let mut known: BTreeMap<Key, Prediction> = BTreeMap::new();
        let mut forced_at: BTreeMap<Key, Response> = BTreeMap::new();
        let mut out = Vec::with_capacity(self.rows.len());
        for row in &self.rows {
            let working = row.working;
            let clamped = row.time_since_clamping_min.unwrap_or(0.0);
            let bits = |depth: f64| {
                (working.spindle_rpm.to_bits(), working.feed_mm.to_bits(), depth.to_bits(), clamped.to_bits())
            };
            if self.measure != Measure::Displacement
                && let Some(prediction) = known.get(&bits(working.depth_mm))
            {
                out.push(*prediction);
                continue;
            }
            let conditions = FixtureConditions { time_since_clamping_min: row.time_since_clamping_min };
            let case =
                Case::with(&self.job, &all, &conditions).map(|case| Case { working, ..case }).filter(check::holds);
            let Some(case) = case else {
                out.push(Err(Missing::NoSolution));
                continue;
            };
            let prediction = match self.measure {
                Measure::PeakToPeak => self.peak_to_peak(&case, &mut forced_at, &bits)?,
                Measure::Regime => self.margin(&case)?,
                Measure::DepthLimit => {
                    let most = 4.0 * working.depth_mm.max(2.5);
                    critical_depth(&self.rules, &case.holding, &case.cutting, working, most)?.ok_or(Missing::NoSolution)
                }
                Measure::Displacement => self.displacement(&case, row.time_s.unwrap_or(0.0))?,
            };
            known.insert(bits(working.depth_mm), prediction);
            out.push(prediction);
        }
        Ok(out)
    }

    fn modulus(&self, case: &Case) -> Result<f64, Failure> {
        Ok(point(&self.rules, &case.holding, &case.cutting, case.working, Closed::BOTH)?.multiplier.modulus)
    }

    /// The exact forced motion; a chattering point has no amplitude that a small change moves a little.
    fn peak_to_peak(
        &self,
        case: &Case,
        forced_at: &mut BTreeMap<Key, Response>,
        bits: &dyn Fn(f64) -> Key,
    ) -> Result<Prediction, Failure> {
        if case.working.depth_mm <= 0.0 {
            return Ok(Err(Missing::NoCut));
        }
        if self.modulus(case)? >= 1.0 {
            return Ok(Err(Missing::Unstable));
        }
        if !case.is_linear() {
            return Ok(Ok(forced(case, case.working)?.x_mm.span() * UM_PER_MM));
        }
        // One forced motion per speed and feed: it goes with H^(1-mu).
        let key = bits(1.0);
        if !forced_at.contains_key(&key) {
            forced_at.insert(key, forced(case, case.at_depth(1.0))?);
        }
        let unit = forced_at.get(&key).map_or(0.0, |response| response.x_mm.span());
        Ok(Ok(unit * case.cutting.depth_power(case.working.depth_mm) * UM_PER_MM))
    }

    /// -ln |mu|, or the relative reserve of the clamp force where that is smaller.
    fn margin(&self, case: &Case) -> Result<Prediction, Failure> {
        let growth = -self.modulus(case)?.max(1e-300).ln();
        let Some(force) = case.holding.clamp_force_n.filter(|_| growth > 0.0) else { return Ok(Ok(growth)) };
        let forced = forced(case, case.working)?;
        let asked = forced.left_elastic_n.high.max(forced.right_elastic_n.high).max(0.0);
        // At no clamp force any demand opens: the reserve is then as bad as it gets.
        let reserve = if asked <= 0.0 { f64::INFINITY } else { ((force - asked) / asked).max(-1.0) };
        Ok(Ok(growth.min(reserve)))
    }

    /// x at a time after the entry.
    fn displacement(&self, case: &Case, time_s: f64) -> Result<Prediction, Failure> {
        if self.modulus(case)? >= 1.0 {
            return Ok(Err(Missing::Unstable));
        }
        let tau = case.cutting.tooth_period_s(case.working.spindle_rpm);
        let mut plan = plan(case, &self.job.simulation, case.working, 0.5);
        let wanted = super::simulate::count((time_s / tau).ceil() + 1.0);
        if wanted > plan.tooth_periods {
            // Long after the entry: the forced motion, in step with the tooth that entered at the start.
            return Ok(Ok(forced(case, case.working)?.x_at(time_s) * UM_PER_MM));
        }
        plan.tooth_periods = wanted;
        plan.steady_periods = 1;
        plan.keep_first = wanted;
        plan.unilateral = case.holding.clamp_force_n.is_some();
        let run = simulate(case, &plan, &Unwatched)?;
        let after = run.first.partition_point(|step| step.time_s <= time_s).clamp(1, run.first.len().max(2) - 1);
        let (Some(p), Some(q)) = (run.first.get(after - 1), run.first.get(after)) else {
            return Ok(Err(Missing::NoSolution));
        };
        let share = (time_s - p.time_s) / (q.time_s - p.time_s);
        Ok(Ok((p.x_mm + share * (q.x_mm - p.x_mm)) * UM_PER_MM))
    }
}
