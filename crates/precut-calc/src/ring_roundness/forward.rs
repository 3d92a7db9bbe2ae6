//! The model as a diagnosis needs it: measured angles in, predictions out, effects as parameters.

use std::f64::consts::TAU;

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::calculator::{
    Cost, Failure, Finding, ForwardModel, JacobianColumn, Missing, Monitor, Prediction, PrepareError, Quantity, Rows,
    checkpoint,
};
use crate::effects::{Cause, RING_CAUSES, RingEffect};

use super::RingRoundness;
use super::input::Job;
use super::scene::Scene;
use super::surface::UM_PER_MM;
use super::turning::{Stuck, turn};

/// Nodes of a prediction: an error of 0.02 to 0.07 um rms in the cases measured.
const NODES: usize = 7200;

/// How wrong the base may be without that being a finding: standard deviations.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields, default)]
pub struct RingAllowances {
    /// Zero of the body angle.
    #[schema(minimum = 0.0, maximum = 90.0, example = 0.05, extensions(("x-unit" = json!("deg"))))]
    pub angle_deg: f64,
    /// What the centring and the size of the measured circle leave: a constant and the two first waves.
    #[schema(minimum = 0.0, maximum = 1000.0, example = 0.2, extensions(("x-unit" = json!("um"))))]
    pub centring_um: f64,
    /// Multiple of the difference that twice as many nodes make.
    #[schema(minimum = 0.0, maximum = 100.0, example = 1.0, extensions(("x-unit" = json!("1"))))]
    pub discretisation: f64,
}

impl Default for RingAllowances {
    fn default() -> Self {
        Self { angle_deg: 0.05, centring_um: 0.2, discretisation: 1.0 }
    }
}

/// Conditions of one run: all are in the job.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct RingRun {}

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
    job: Job,
    measure: Measure,
    /// Body angles of the rows, rad.
    angles_rad: Vec<f64>,
}

impl ForwardModel for RingRoundness {
    type Job = Job;
    type Run = RingRun;
    type Point = RingPoint;
    type Effect = RingEffect;
    type Allowances = RingAllowances;
    type Prepared = PreparedRing;

    const CAUSES: &'static [Cause] = RING_CAUSES;
    const QUANTITIES: &'static [Quantity] = QUANTITIES;

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
        match measure {
            Some(measure) if faults.is_empty() => Ok(PreparedRing {
                job: job.clone(),
                measure,
                angles_rad: rows.points.iter().map(|(_, point)| point.angle_deg.to_radians()).collect(),
            }),
            _ => Err(PrepareError::Invalid(faults)),
        }
    }

    fn predict(prepared: &PreparedRing, effects: &[RingEffect]) -> Result<Vec<Prediction>, Failure> {
        Ok(match prepared.profile(effects, NODES) {
            Ok(profile) => prepared.angles_rad.iter().map(|angle| Ok(read(&profile, *angle))).collect(),
            // An effect so large that the ring cannot rest on its supports.
            Err(Unlocated) => vec![Err(Missing::NoSolution); prepared.angles_rad.len()],
        })
    }

    fn effect(cause: &Cause, values: &[f64]) -> Option<RingEffect> {
        RingEffect::from_parameters(cause, values)
    }

    fn nuisances(prepared: &PreparedRing, allowances: &RingAllowances) -> Result<Vec<JacobianColumn>, Failure> {
        let base = |n: usize| {
            prepared.profile(&[], n).map_err(|Unlocated| Failure::NotConverged {
                what: "location of the ring on its supports",
                residual: 0.0,
                iterations: 0,
            })
        };
        let (once, twice) = (base(NODES)?, base(2 * NODES)?);
        let of = |column: &dyn Fn(f64) -> f64| prepared.angles_rad.iter().map(|a| column(*a)).collect::<Vec<f64>>();
        let centring = allowances.centring_um * prepared.measure.per_um();
        let step = TAU / NODES as f64;
        let slope = |a: f64| (read(&once, a + step) - read(&once, a - step)) / (2.0 * step);
        Ok(vec![
            of(&|a| allowances.angle_deg.to_radians() * slope(a)),
            of(&|_| centring),
            of(&|a| centring * a.cos()),
            of(&|a| centring * a.sin()),
            of(&|a| allowances.discretisation * (read(&twice, a) - read(&once, a))),
        ])
    }

    fn predict_cost(prepared: &PreparedRing) -> Cost {
        let turns = prepared.job.tool.revolutions + prepared.job.tool.spark_out_revolutions;
        let step_ns = if prepared.job.supports.roller_radius_mm > 0.0 { 400.0 } else { 100.0 };
        Cost { ms: 1e-6 * step_ns * NODES as f64 * turns, bytes: 1_000_000, driver: "/job/tool/revolutions" }
    }
}

/// The ring cannot be located on its supports.
struct Unlocated;

impl From<Stuck> for Unlocated {
    fn from(_: Stuck) -> Self {
        Self
    }
}

impl PreparedRing {
    /// The measured quantity at uniform body angles: the least-squares circle removed to first order (mean and first
    /// wave), or the radius.
    fn profile(&self, effects: &[RingEffect], n: usize) -> Result<Vec<f64>, Unlocated> {
        let mut all = self.job.effects.clone();
        all.extend_from_slice(effects);
        let scene = Scene::of(&self.job, &all);
        let blank = scene.blank_mm(&self.job, n).map_err(|_| Unlocated)?;
        let turned = turn::<Unlocated>(&blank, &scene.setting, &mut |_, _| Ok(()))?;
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
