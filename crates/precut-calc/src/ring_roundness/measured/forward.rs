//! The model as a diagnosis needs it: measured angles in, predictions out, effects as parameters.

use std::f64::consts::TAU;

use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::calculator::{
    Check, Cost, Design, Diagnosable, Example, Expansions, Failure, Finding, ForwardModel, Hypotheses, Hypothesis,
    JacobianColumn, Missing, Monitor, NextRuns, Prediction, PrepareError, Quantity, Ranges, Rows, Violations,
    checkpoint,
};
use crate::effects::{Cause, JointUncertainty, RING_CAUSES, RingEffect};

use crate::ring_roundness::RingRoundness;
use crate::ring_roundness::job::input::{Job, Method};
use crate::ring_roundness::measured::hypotheses::{design, effects, expansions, hypotheses, values};
use crate::ring_roundness::measured::measurement::RingMeasurement;
use crate::ring_roundness::measured::next_runs::next_runs;
use crate::ring_roundness::model::scene::Scene;
use crate::ring_roundness::model::surface::UM_PER_MM;
use crate::ring_roundness::model::turning::{Stuck, turn};

/// Nodes of a prediction: an error of 0.02 to 0.07 um rms in the cases measured.
const NODES: usize = 7200;
/// Nodes of the predictions that divided differences are made of.
const COARSE_NODES: usize = 1440;
/// Nodes of the predictions that say where a wave comes near to the rows: twenty to a wave of a roller of a twelfth of the ring.
const ROUGH_NODES: usize = 240;

/// How wrong the base may be without that being a finding: standard deviations.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RingAllowances {
    /// Zero of the body angle.
    #[schema(minimum = 0.0, maximum = 90.0, example = 0.05, extensions(("x-symbol" = json!("u_theta")), ("x-unit" = json!("deg"))))]
    pub angle_deg: f64,
    /// What the instrument's circle leaves in deviations: a constant and the two first waves.
    #[schema(minimum = 0.0, maximum = 1000.0, example = 0.2, extensions(("x-symbol" = json!("u_c")), ("x-unit" = json!("um"))))]
    pub centring_um: f64,
    /// Size of the ring against the setting of the tool, where radii were measured.
    #[schema(minimum = 0.0, maximum = 10_000.0, example = 5.0, extensions(("x-symbol" = json!("u_R")), ("x-unit" = json!("um"))))]
    pub size_um: f64,
    /// How far off the axis of the instrument the ring may lie in each direction, where radii were measured.
    #[schema(minimum = 0.0, maximum = 10_000.0, example = 50.0, extensions(("x-symbol" = json!("u_e")), ("x-unit" = json!("um"))))]
    pub eccentricity_um: f64,
    /// Multiple of the difference that twice as many nodes make.
    #[schema(minimum = 0.0, maximum = 100.0, example = 1.0, extensions(("x-symbol" = json!("k_N")), ("x-unit" = json!("1"))))]
    pub discretisation: f64,
}

impl Default for RingAllowances {
    fn default() -> Self {
        Self { angle_deg: 0.05, centring_um: 0.2, size_um: 5.0, eccentricity_um: 50.0, discretisation: 1.0 }
    }
}

/// One ring: what was set otherwise for it than in the job.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct RingRun {
    /// Tip at the start of the feed, to the right.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = -100_000.0, maximum = 100_000.0, example = 100.0, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("L_t"))))]
    pub tool_x_mm: Option<f64>,
    /// Tip at the start of the feed, upwards.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = -100_000.0, maximum = 100_000.0, example = 113.5, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("H_t"))))]
    pub tool_y_mm: Option<f64>,
    /// Feed per revolution.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 1e-7, maximum = 10.0, example = 0.0117, extensions(("x-unit" = json!("mm/rev")), ("x-symbol" = json!("S"))))]
    pub feed_mm_per_rev: Option<f64>,
    /// Revolutions with feed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.01, maximum = 1e7, example = 128.0, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("n"))))]
    pub revolutions: Option<f64>,
    /// Revolutions without feed at the end.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.0, maximum = 1e6, example = 4.0, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("n_s"))))]
    pub spark_out_revolutions: Option<f64>,
}

/// The job of one ring.
pub(in crate::ring_roundness) fn job_of_run(job: &Job, run: &RingRun) -> Job {
    let mut job = job.clone();
    let tool = &mut job.tool;
    tool.x_mm = run.tool_x_mm.unwrap_or(tool.x_mm);
    tool.y_mm = run.tool_y_mm.unwrap_or(tool.y_mm);
    tool.feed_mm_per_rev = run.feed_mm_per_rev.unwrap_or(tool.feed_mm_per_rev);
    tool.revolutions = run.revolutions.unwrap_or(tool.revolutions);
    tool.spark_out_revolutions = run.spark_out_revolutions.unwrap_or(tool.spark_out_revolutions);
    job
}

/// Where a radius was measured.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct RingPoint {
    /// Body angle.
    #[schema(minimum = -720.0, maximum = 720.0, example = 12.0, extensions(("x-unit" = json!("deg")), ("x-symbol" = json!("theta"))))]
    pub angle_deg: f64,
}

/// What the measured value is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Measure {
    Deviation,
    Radius,
}

const QUANTITIES: &[Quantity] = &[
    Quantity { name: "radial_deviation_um", unit: "um", logarithmic: false },
    Quantity { name: "radius_mm", unit: "mm", logarithmic: false },
];

impl Measure {
    fn named(name: &str) -> Option<Self> {
        match name {
            "radial_deviation_um" => Some(Self::Deviation),
            "radius_mm" => Some(Self::Radius),
            _ => None,
        }
    }

    /// Size of 1 um in the quantity.
    fn per_um(self) -> f64 {
        match self {
            Self::Deviation => 1.0,
            Self::Radius => 1.0 / UM_PER_MM,
        }
    }
}

/// What no effect parameter changes.
pub struct PreparedRing {
    measure: Measure,
    rings: Vec<TurnedRing>,
    /// Ring and body angle (rad) of every row.
    places: Vec<(usize, f64)>,
}

/// One ring as it is turned.
struct TurnedRing {
    job: Job,
    /// Rows that were measured on it.
    rows: Vec<usize>,
}

impl ForwardModel for RingRoundness {
    type Job = Job;
    type Run = RingRun;
    type Point = RingPoint;
    type Effect = RingEffect;
    type Allowances = RingAllowances;
    type Prepared = PreparedRing;

    const CAUSES: &'static [Cause] = RING_CAUSES;
    const TAKES_OPEN_EFFECTS: bool = true;
    const QUANTITIES: &'static [Quantity] = QUANTITIES;
    const CONDITIONS: &'static [&'static str] = &["spark_out_revolutions"];

    fn own_effects(job: &Job) -> &[RingEffect] {
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
        rows: &Rows<RingRun, RingPoint>,
        quantity: &str,
        monitor: &dyn Monitor,
    ) -> Result<PreparedRing, PrepareError> {
        checkpoint(monitor).map_err(PrepareError::Failed)?;
        let mut faults = Vec::new();
        let measure = Measure::named(quantity);
        if measure.is_none() {
            let known: Vec<&'static str> = QUANTITIES.iter().map(|q| q.name).collect();
            faults.push(
                Finding::new("unknown_quantity", "/quantity")
                    .with("quantity", quantity.to_owned())
                    .with("known", known),
            );
        }
        for (row, (run, _)) in rows.points.iter().enumerate() {
            if *run >= rows.runs.len() {
                faults.push(Finding::new("unknown_run", format!("/measurements/{row}/run")).with("run", *run));
            }
        }
        if job.method == Method::NearestSamples {
            faults.push(Finding::new("not_with_nearest_samples", "/job/method"));
        }
        let places: Vec<(usize, f64)> =
            rows.points.iter().map(|(run, point)| (*run, point.angle_deg.to_radians())).collect();
        let rings = rows.runs.iter().enumerate().map(|(k, run)| TurnedRing {
            job: job_of_run(job, run),
            rows: (0..places.len()).filter(|&row| places[row].0 == k).collect(),
        });
        let rings: Vec<TurnedRing> = rings.collect();
        for (k, ring) in rings.iter().enumerate() {
            faults.extend(faults_of_ring(k, &ring.job));
        }
        match measure {
            Some(measure) if faults.is_empty() => Ok(PreparedRing { measure, rings, places }),
            _ => Err(PrepareError::Invalid(faults)),
        }
    }

    fn predict(
        prepared: &PreparedRing,
        effects: &[RingEffect],
        monitor: &dyn Monitor,
    ) -> Result<Vec<Prediction>, Failure> {
        prepared.predicted(effects, NODES, monitor)
    }

    fn effect(cause: &Cause, values: &[f64]) -> Option<RingEffect> {
        RingEffect::from_parameters(cause, values)
    }

    fn nuisances(
        prepared: &PreparedRing,
        effects: &[RingEffect],
        allowances: &RingAllowances,
        monitor: &dyn Monitor,
    ) -> Result<Vec<JacobianColumn>, Failure> {
        let (size_um, centre_um) = match prepared.measure {
            Measure::Deviation => (allowances.centring_um, allowances.centring_um),
            Measure::Radius => (allowances.size_um, allowances.eccentricity_um),
        };
        let unit = prepared.measure.per_um();
        let (size, centre) = (size_um * unit, centre_um * unit);
        let step = TAU / NODES as f64;
        let mut columns = Vec::new();
        for ring in &prepared.rings {
            let base = |n: usize| {
                prepared.profile(ring, effects, n, monitor).map_err(|why| match why {
                    Unpredicted::Unlocated => Failure::NotConverged {
                        what: "location of the ring on its supports",
                        residual: 0.0,
                        iterations: 0,
                    },
                    Unpredicted::Cancelled => Failure::Cancelled,
                })
            };
            let (once, twice) = rayon::join(|| base(NODES), || base(2 * NODES));
            let (once, twice) = (once?, twice?);
            let slope = |a: f64| (read(&once, a + step) - read(&once, a - step)) / (2.0 * step);
            let mut of = |column: &dyn Fn(f64) -> f64| {
                let mut values = vec![0.0; prepared.places.len()];
                for &row in &ring.rows {
                    values[row] = column(prepared.places[row].1);
                }
                columns.push(values);
            };
            of(&|a| allowances.angle_deg.to_radians() * slope(a));
            of(&|_| size);
            of(&|a| centre * a.cos());
            of(&|a| centre * a.sin());
            of(&|a| allowances.discretisation * (read(&twice, a) - read(&once, a)));
        }
        Ok(columns)
    }

    fn predict_cost(prepared: &PreparedRing) -> Cost {
        let ms = prepared.rings.iter().map(|ring| predict_ms(&ring.job)).sum();
        Cost { ms, bytes: 1_000_000 * prepared.rings.len() as u64, driver: "/job/tool/revolutions" }
    }
}

impl Diagnosable for RingRoundness {
    type Row = RingMeasurement;

    /// Most of them the search for the places of waves and for the ratio of a roller, which is made of rough ones: 17,000 of
    /// 240 nodes where no straight line leads there. Trials take 0.4 to 1.4 times this (measured).
    const PREDICTIONS: f64 = 1400.0;

    const DIAGNOSES: &'static [Example] = &[Example {
        id: "roller",
        title: "Two traces of a ring: its left roller runs out",
        job: include_str!("../examples/diagnosis_roller.json"),
    }];

    fn hypotheses(prepared: &PreparedRing, held: &[RingEffect], _monitor: &dyn Monitor) -> Result<Hypotheses, Failure> {
        Ok(hypotheses(&prepared.jobs(), held))
    }

    fn effects(prepared: &PreparedRing, hypothesis: &Hypothesis, values: &[f64]) -> Option<Vec<RingEffect>> {
        effects(hypothesis, values, &prepared.jobs())
    }

    fn values(prepared: &PreparedRing, hypothesis: &Hypothesis, effect: &RingEffect) -> Option<Vec<f64>> {
        values(hypothesis, effect, &prepared.jobs())
    }

    fn design(prepared: &PreparedRing) -> Design {
        design(&prepared.places)
    }

    fn place(point: &RingPoint) -> Vec<(&'static str, Option<f64>)> {
        vec![("angle_deg", Some(point.angle_deg))]
    }

    fn next_runs(
        job: &Job,
        rows: &Rows<RingRun, RingPoint>,
        ranges: Ranges<'_>,
        _monitor: &dyn Monitor,
    ) -> Result<NextRuns<RingRun, RingPoint>, Failure> {
        Ok(next_runs(job, rows, ranges))
    }

    fn expansions(_prepared: &PreparedRing, hypothesis: &Hypothesis) -> Expansions {
        expansions(hypothesis)
    }

    fn predict_coarsely(
        prepared: &PreparedRing,
        effects: &[RingEffect],
        monitor: &dyn Monitor,
    ) -> Result<Vec<Prediction>, Failure> {
        prepared.predicted(effects, COARSE_NODES, monitor)
    }

    fn predict_roughly(
        prepared: &PreparedRing,
        effects: &[RingEffect],
        monitor: &dyn Monitor,
    ) -> Result<Vec<Prediction>, Failure> {
        prepared.predicted(effects, ROUGH_NODES, monitor)
    }

    fn predict_ms(job: &Job) -> f64 {
        predict_ms(job)
    }
}

/// Measured on one core.
fn predict_ms(job: &Job) -> f64 {
    let turns = job.tool.revolutions + job.tool.spark_out_revolutions;
    let step_ns = if job.supports.roller_radius_mm > 0.0 { 400.0 } else { 100.0 };
    1e-6 * step_ns * NODES as f64 * turns
}

/// What a ring's own settings make impossible.
fn faults_of_ring(k: usize, job: &Job) -> Vec<Finding> {
    let mut violations = Violations::default();
    job.check(&mut violations);
    let mut faults = violations.into_vec();
    for fault in &mut faults {
        fault.pointer = format!("/runs/{k}");
    }
    faults
}

/// Why a ring has no profile.
enum Unpredicted {
    /// It cannot be located on its supports.
    Unlocated,
    /// Nobody waits for it any more.
    Cancelled,
}

impl From<Stuck> for Unpredicted {
    fn from(_: Stuck) -> Self {
        Self::Unlocated
    }
}

impl PreparedRing {
    fn jobs(&self) -> Vec<&Job> {
        self.rings.iter().map(|ring| &ring.job).collect()
    }

    fn predicted(
        &self,
        effects: &[RingEffect],
        nodes: usize,
        monitor: &dyn Monitor,
    ) -> Result<Vec<Prediction>, Failure> {
        let profiles: Vec<_> = self.rings.par_iter().map(|ring| self.profile(ring, effects, nodes, monitor)).collect();
        let mut predicted = vec![Err(Missing::NoSolution); self.places.len()];
        for (ring, profile) in self.rings.iter().zip(&profiles) {
            // None where an effect is so large that the ring cannot rest on its supports.
            let profile = match profile {
                Ok(profile) => profile,
                Err(Unpredicted::Unlocated) => continue,
                Err(Unpredicted::Cancelled) => return Err(Failure::Cancelled),
            };
            for &row in &ring.rows {
                predicted[row] = Ok(read(profile, self.places[row].1));
            }
        }
        Ok(predicted)
    }

    /// The measured quantity at uniform body angles: the least-squares circle removed to first order (mean and first
    /// wave), or the radius.
    fn profile(
        &self,
        ring: &TurnedRing,
        effects: &[RingEffect],
        n: usize,
        monitor: &dyn Monitor,
    ) -> Result<Vec<f64>, Unpredicted> {
        let mut all = ring.job.effects.clone();
        all.extend_from_slice(effects);
        let scene = Scene::of(&ring.job, &all);
        let blank = scene.blank_mm(&ring.job, n).map_err(|_| Unpredicted::Unlocated)?;
        let turned = turn::<Unpredicted>(&blank, &scene.setting, &mut |_, _| {
            if monitor.cancelled() { Err(Unpredicted::Cancelled) } else { Ok(()) }
        })?;
        let radii = scene.unmirrored(turned.radii_mm);
        Ok(match self.measure {
            Measure::Radius => radii,
            Measure::Deviation => deviations_um(&radii),
        })
    }
}

/// Mean and first wave removed, um.
fn deviations_um(radii_mm: &[f64]) -> Vec<f64> {
    let n = radii_mm.len() as f64;
    let mean = radii_mm.iter().sum::<f64>() / n;
    let direction = |i: usize| (TAU * i as f64 / n).sin_cos();
    let (mut x, mut y) = (0.0, 0.0);
    for (i, radius) in radii_mm.iter().enumerate() {
        let (sin, cos) = direction(i);
        x += (radius - mean) * cos * 2.0 / n;
        y += (radius - mean) * sin * 2.0 / n;
    }
    radii_mm
        .iter()
        .enumerate()
        .map(|(i, radius)| {
            let (sin, cos) = direction(i);
            (radius - mean - x * cos - y * sin) * UM_PER_MM
        })
        .collect()
}

/// Straight between nodes: 0.05° apart, teeth are no smoother than that.
fn read(profile: &[f64], angle_rad: f64) -> f64 {
    let n = profile.len();
    let position = (angle_rad / TAU).rem_euclid(1.0) * n as f64;
    let (node, share) = split(position);
    profile[node % n] * (1.0 - share) + profile[(node + 1) % n] * share
}

#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a position between nodes, 0 to n")]
fn split(position: f64) -> (usize, f64) {
    let floor = position.floor();
    (floor as usize, position - floor)
}
