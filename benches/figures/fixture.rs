//! What fixture stability costs, beside a plainly written textbook semi-discretisation on the same map.

use nalgebra::{DMatrix, Matrix4};
use precut_calc::calculator::{Calculator, Unwatched};
use precut_calc::clamping::{Asked, Load, Vise};
use precut_calc::fixture_stability::identification::{FixtureIdentification, IdentificationJob};
use precut_calc::fixture_stability::{
    FixtureJob, FixtureStability, forced_motion, lobe_boundary, lobe_map, multiplier_modulus, run_in_time,
};
use serde_json::{Value, json};

use crate::measure::{Measured, cpu_time};

/// The published benchmark: one mode at 922 Hz, two teeth, 5000 to 25000 rev/min, 0.1 to 10 mm.
fn benchmark(immersion: f64, speeds: u32, depths: u32) -> Result<FixtureJob, String> {
    let joint =
        json!({ "stiffness_n_per_mm": 670.024_824_025_374_3, "damping_n_s_per_mm": 0.002_544_501_930_839_635_6 });
    prepared(&json!({
        "cutter": { "diameter_mm": 10, "teeth": 2 },
        "force": { "coefficient": 600, "radial_ratio": 1.0 / 3.0 },
        "cut": {
            "width_mm": 10.0 * immersion, "offset_mm": 5.0 * (immersion - 1.0), "depth_mm": 0.5,
            "spindle_speed_rpm": 9000, "feed_mm_per_tooth": 0.1
        },
        "fixture": { "kind": "self_locking", "workpiece_mass_kg": 0.03993, "movable_joint": joint, "fixed_joint": joint },
        "lobes": { "from_rpm": 5000, "to_rpm": 25_000, "speeds": speeds, "depth_max_mm": 10, "depths": depths }
    }))
}

/// The reference fixture: eight teeth, one or two in cut; type 1, or type 2 with two modes.
fn vise(two_modes: bool, chip_exponent: f64, depth: f64) -> Result<FixtureJob, String> {
    let mut fixture = json!({
        "kind": "self_locking", "workpiece_mass_kg": 5,
        "movable_joint": { "stiffness_n_per_mm": 6000, "damping_n_s_per_mm": 0.5 },
        "fixed_joint": { "stiffness_n_per_mm": 30_000, "damping_n_s_per_mm": 3 }
    });
    if two_modes {
        fixture["kind"] = "constant_force".into();
        fixture["jaw_mass_kg"] = 1.into();
    }
    prepared(&json!({
        "cutter": { "diameter_mm": 100, "teeth": 8 },
        "force": { "coefficient": 3000, "chip_thickness_exponent": chip_exponent },
        "cut": { "width_mm": 50, "depth_mm": depth, "spindle_speed_rpm": 318.31, "feed_mm_per_tooth": 0.0393 },
        "fixture": fixture,
        "lobes": { "from_rpm": 300, "to_rpm": 3000, "speeds": 200, "depth_max_mm": 16, "depths": 100 },
        "simulation": { "steps_per_tooth": 1600, "tooth_periods": 400 }
    }))
}

fn prepared(job: &Value) -> Result<FixtureJob, String> {
    let mut job: FixtureJob = serde_json::from_value(job.clone()).map_err(|error| error.to_string())?;
    FixtureStability::fill(&mut job);
    Ok(job)
}

/// The converged map, 200 x 100.
pub(crate) fn map(immersion: f64) -> Result<Measured, String> {
    let job = benchmark(immersion, 200, 100)?;
    cpu_time(|| lobe_map(&job, &Unwatched))
}

pub(crate) fn map_two_modes() -> Result<Measured, String> {
    let job = vise(true, 0.1, 3.0)?;
    cpu_time(|| lobe_map(&job, &Unwatched))
}

/// The boundary at 400 speeds and more where neighbours differ.
pub(crate) fn boundary() -> Result<Measured, String> {
    let job = benchmark(1.0, 400, 2)?;
    cpu_time(|| lobe_boundary(&job, &Unwatched))
}

/// One multiplier by two orders, with its error.
pub(crate) fn multiplier(two_modes: bool) -> Result<Measured, String> {
    let job = vise(two_modes, 0.1, 3.0)?;
    cpu_time(|| multiplier_modulus(&job))
}

pub(crate) fn forced() -> Result<Measured, String> {
    let job = vise(false, 0.1, 3.0)?;
    cpu_time(|| forced_motion(&job))
}

/// Time of one step of the cut in time, in chatter.
pub(crate) fn step(chip_exponent: f64) -> Result<Measured, String> {
    let job = vise(false, chip_exponent, 5.0)?;
    let steps = 1600.0 * 400.0;
    let all = cpu_time(|| run_in_time(&job, 1.2, &Unwatched))?;
    Ok(Measured { median: all.median / steps, low: all.low / steps, high: all.high / steps })
}

/// A complete answer: verdict, clamp force and limits.
pub(crate) fn answer() -> Result<Measured, String> {
    let job = vise(false, 0.1, 3.0)?;
    cpu_time(|| FixtureStability::run(&job, &Unwatched))
}

/// What an answer takes for the probability of a quiet cut, in a vise with a grip: over the same answer without.
pub(crate) fn probability(analyses: &[&str], check: &str) -> Result<Measured, String> {
    let job = |uncertainty: Value| {
        let joint =
            |stiffness: f64, damping: f64| json!({ "stiffness_n_per_mm": stiffness, "damping_n_s_per_mm": damping });
        prepared(&json!({
            "cutter": { "diameter_mm": 63, "teeth": 4 },
            "force": { "coefficient": 2600, "radial_ratio": 0.4 },
            "cut": { "width_mm": 40, "depth_mm": 3.11, "spindle_speed_rpm": 1100, "feed_mm_per_tooth": 0.08 },
            "fixture": {
                "kind": "self_locking", "workpiece_mass_kg": 4, "clamp_force_n": 2700,
                "movable_joint": joint(12_000.0, 0.5), "fixed_joint": joint(20_000.0, 0.3),
                "clamp": { "friction": { "low": 0.13, "value": 0.18, "high": 0.25 }, "force_height_mm": 12, "jaw_length_mm": 125, "jaw_height_mm": 32 }
            },
            "analyses": analyses, "uncertainty": uncertainty
        }))
    };
    let plain = job(json!({ "defaults": false }))?;
    let with = job(json!({ "check": check }))?;
    let plain = cpu_time(|| FixtureStability::run(&plain, &Unwatched))?;
    let with = cpu_time(|| FixtureStability::run(&with, &Unwatched))?;
    let less = |with: f64| (with - plain.median).max(0.0);
    Ok(Measured { median: less(with.median), low: less(with.low), high: less(with.high) })
}

/// The source paper's table of the screw vise: every row predicted under both laws of regeneration.
fn paper() -> Result<Value, String> {
    let example = FixtureIdentification::META.examples.first().ok_or("no example")?;
    serde_json::from_str(example.job).map_err(|error| error.to_string())
}

pub(crate) fn table() -> Result<Measured, String> {
    let job: IdentificationJob = serde_json::from_value(paper()?).map_err(|error| error.to_string())?;
    cpu_time(|| FixtureIdentification::run(&job, &Unwatched))
}

/// The textbook on the map of [`map`]: first-order semi-discretisation, 40 intervals, a matrix exponential for every
/// interval and depth, dense matrices multiplied up, all eigenvalues. On every twentieth speed and tenth depth, times 200.
pub(crate) fn textbook(immersion: f64) -> Result<Measured, String> {
    let part = cpu_time(|| {
        let mut unstable = 0;
        for i in 0..10_u32 {
            for j in 0..10_u32 {
                let rpm = 5000.0 + 20_000.0 * f64::from(i) / 9.0;
                let depth = 0.1 + 9.9 * f64::from(j) / 9.0;
                unstable += u32::from(textbook_radius(immersion, rpm, depth) > 1.0);
            }
        }
        unstable
    })?;
    Ok(Measured { median: part.median * 200.0, low: part.low * 200.0, high: part.high * 200.0 })
}

const INTERVALS: usize = 40;

fn textbook_radius(immersion: f64, rpm: f64, depth: f64) -> f64 {
    let (mass, rate, zeta) = (0.039_93, std::f64::consts::TAU * 922.0, 0.011);
    let tau = 30.0 / rpm;
    let h = tau / INTERVALS as f64;
    let entry = (2.0 * immersion - 1.0).acos();
    let size = INTERVALS + 2;
    let mut total = DMatrix::<f64>::identity(size, size);
    for i in 0..INTERVALS {
        // Mean of the directional factor over the interval, the arc's entry inside it included.
        let fine = 8_u32;
        let mean: f64 = (0..fine)
            .map(|k| {
                let angle =
                    std::f64::consts::PI * (i as f64 + (f64::from(k) + 0.5) / f64::from(fine)) / INTERVALS as f64;
                if angle < entry { 0.0 } else { angle.sin() * (angle.cos() + angle.sin() / 3.0) }
            })
            .sum::<f64>()
            / f64::from(fine);
        let stiffness = 600e6 * depth * 1e-3 / mass * mean;
        let generator = Matrix4::new(
            0.0,
            1.0,
            0.0,
            0.0, //
            -rate * rate - stiffness,
            -2.0 * zeta * rate,
            stiffness,
            0.0, //
            0.0,
            0.0,
            0.0,
            1.0 / h, //
            0.0,
            0.0,
            0.0,
            0.0,
        );
        let step = (generator * h).exp();
        let mut map = DMatrix::<f64>::zeros(size, size);
        for row in 0..2 {
            map[(row, 0)] = step[(row, 0)];
            map[(row, 1)] = step[(row, 1)];
            map[(row, size - 1)] = step[(row, 2)] - step[(row, 3)];
            map[(row, size - 2)] = step[(row, 3)];
        }
        map[(2, 0)] = 1.0;
        for k in 1..INTERVALS {
            map[(2 + k, 1 + k)] = 1.0;
        }
        total = map * total;
    }
    total.complex_eigenvalues().iter().map(|value| value.norm()).fold(0.0, f64::max)
}

/// A vise with parallels under the loads of a turn: the force by which nothing slips, and below which slip is certain.
pub(crate) fn clamping(loads: u32) -> Result<Measured, String> {
    let vise = Vise {
        jaw_length_mm: 100.0,
        jaw_height_mm: 30.0,
        part_width_mm: 60.0,
        parallels: true,
        friction: 0.2,
        constant_force: true,
        weight_n: 15.0,
        centre_of_mass_mm: [0.0, 0.0, 25.0],
    };
    let fixture = vise.fixture();
    let friction: Vec<f64> = fixture.contacts.iter().map(|contact| contact.friction).collect();
    let load = |i: u32| {
        let (s, c) = (f64::from(i) / f64::from(loads) * std::f64::consts::TAU).sin_cos();
        Load { force_n: [300.0 + 400.0 * c, 200.0 + 400.0 * s, 100.0 * s], point_mm: [20.0 * c, 5.0, 40.0] }
    };
    let loads: Vec<Load> = (0..loads).map(load).collect();
    let asked = Asked {
        fixture: &fixture,
        peaks: &loads,
        means: &[],
        safety: 1.0,
        friction: [&friction; 3],
        clamp_force_n: None,
        programmes: usize::MAX,
    };
    cpu_time(|| asked.sheet())
}
