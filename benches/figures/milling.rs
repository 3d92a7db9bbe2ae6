//! What milling in three directions costs: the 2 x 2 modes of the specification.

use std::f64::consts::{PI, TAU};

use precut_calc::calculator::{Calculator, Failure, Unwatched};
use precut_calc::milling_stability::model::{About, Cut, Law, Milling, Mode, Orders, Rotation, Side, Structure, Tooth};
use precut_calc::milling_stability::{Job, MillingStability};
use serde_json::{Value, json};

use crate::measure::{Measured, cpu_time};

/// Which teeth.
#[derive(Clone, Copy, PartialEq)]
pub(crate) enum Teeth {
    Straight,
    Helical,
    UnevenPitch,
    UnevenHelix,
}

fn milling(teeth: Teeth) -> Milling {
    let radius_mm = 15.875;
    let lag = |helix_deg: f64| helix_deg.to_radians().tan() / radius_mm;
    let part = if teeth == Teeth::Straight || teeth == Teeth::Helical { 0.0 } else { 0.2 };
    let helix = |tooth: usize| match teeth {
        Teeth::Straight => 0.0,
        Teeth::UnevenHelix if tooth == 1 => 33.0,
        _ => 30.0,
    };
    let tooth = |j: usize| Tooth {
        pitch_rad: if j == 0 { PI - part } else { PI + part },
        lag_rad_per_mm: lag(helix(j)),
        radial_mm: 0.0,
        axial_mm: 0.0,
    };
    Milling {
        radius_mm,
        teeth: (0..2).map(tooth).collect(),
        edge_angle_rad: 0.5 * PI,
        entry_rad: 0.5 * PI,
        exit_rad: PI,
        feed_mm: 0.1,
        law: Law::Mechanistic { edge: [0.0; 3], cutting: [1319.4, 788.8, 0.0] },
        depth_exponent: 0.0,
        rubbing: None,
        about: About::SmoothChips,
    }
}

fn structure() -> Structure {
    let mode = |direction, frequency_hz, damping_ratio, mass_kg| Mode {
        side: Side::Tool,
        direction,
        frequency_hz,
        damping_ratio,
        mass_kg,
    };
    let (x, y) = ([1.0, 0.0, 0.0], [0.0, 1.0, 0.0]);
    Structure::new(vec![
        mode(x, 456.780_432, 0.111_705_4, 0.963_094_25),
        mode(x, 1_448.889_14, 0.017_037_01, 0.177_274),
        mode(y, 516.518_189, 0.024_579_63, 0.890_067_9),
        mode(y, 1_408.448_141, 0.031_357_6, 0.158_418_06),
    ])
}

fn said(error: &Failure) -> String {
    error.to_string()
}

/// One multiplier, to 1e-9.
pub(crate) fn multiplier(teeth: Teeth) -> Result<Measured, String> {
    let (milling, structure, orders) = (milling(teeth), structure(), Orders::default());
    let cut = Cut { milling: &milling, structure: &structure, rotation: Rotation::steady(9500.0), depth_mm: 1.5 };
    cpu_time(|| orders.multiplier(&cut, &Unwatched).map_err(|error| said(&error)))
}

/// The converged map, 200 x 100, 3000 to 16,000 rev/min, 0.1 to 6 mm: on every tenth speed, times 10.
pub(crate) fn map(teeth: Teeth) -> Result<Measured, String> {
    let (milling, structure, orders) = (milling(teeth), structure(), Orders::default());
    let part = cpu_time(|| {
        let mut unstable = 0;
        for i in 0..20_u32 {
            let rotation = Rotation::steady(3000.0 + 13_000.0 * f64::from(i) / 19.0);
            for j in 0..100_u32 {
                let depth_mm = 0.1 + 5.9 * f64::from(j) / 99.0;
                let cut = Cut { milling: &milling, structure: &structure, rotation, depth_mm };
                let found = orders.on_map(&cut, &Unwatched).map_err(|error| said(&error))?;
                unstable += u32::from(found.is_some_and(|found| found.modulus() > 1.0));
            }
        }
        Ok::<u32, String>(unstable)
    })?;
    Ok(Measured { median: 10.0 * part.median, low: 10.0 * part.low, high: 10.0 * part.high })
}

/// Forced motion with the error of its wall.
pub(crate) fn forced() -> Result<Measured, String> {
    let (milling, structure, orders) = (milling(Teeth::Helical), structure(), Orders::default());
    let cut = Cut { milling: &milling, structure: &structure, rotation: Rotation::steady(9500.0), depth_mm: 1.5 };
    cpu_time(|| {
        let forced = orders.forced(&cut, &Unwatched).map_err(|error| said(&error))?.ok_or("no motion")?;
        let errors: f64 = forced
            .walls()
            .into_iter()
            .map(|wall| (0..20).map(|k| forced.surface_error_mm(wall, 0.075 * f64::from(k))).sum::<f64>())
            .sum();
        Ok::<(f64, f64), String>((errors, forced.extremes().1[1]))
    })
}

/// Some analyses of the example with 200 speeds.
pub(crate) fn answer(analyses: &Value) -> Result<Measured, String> {
    let example = MillingStability::META.examples.first().ok_or("no example")?;
    let mut job: Value = serde_json::from_str(example.job).map_err(|error| error.to_string())?;
    job["analyses"] = analyses.clone();
    job["lobes"] = json!({ "speeds": 200 });
    let mut job: Job = serde_json::from_value(job).map_err(|error| error.to_string())?;
    MillingStability::fill(&mut job);
    cpu_time(|| MillingStability::run(&job, &Unwatched))
}

/// A boundary of 400 speeds over modulations of the speed: a tenth, times 10.
pub(crate) fn varying() -> Result<Measured, String> {
    let (milling, structure, orders) = (milling(Teeth::Straight), structure(), Orders::default());
    let part = cpu_time(|| {
        let mut grown = 0.0;
        for i in 0..40_u32 {
            let spindle_rpm = 6000.0 + 10_000.0 * f64::from(i) / 39.0;
            // Twenty tooth pitches to a modulation.
            let frequency_hz = TAU * spindle_rpm / 60.0 / PI / 20.0;
            let rotation = Rotation { spindle_rpm, amplitude: 0.1, frequency_hz, modulations: 1 };
            for depth_mm in [0.5, 1.0, 1.5, 2.0, 2.5, 3.0, 3.5, 4.0] {
                let cut = Cut { milling: &milling, structure: &structure, rotation, depth_mm };
                grown +=
                    orders.on_map(&cut, &Unwatched).map_err(|error| said(&error))?.map_or(0.0, |found| found.growth());
            }
        }
        Ok::<f64, String>(grown)
    })?;
    Ok(Measured { median: 10.0 * part.median, low: 10.0 * part.low, high: 10.0 * part.high })
}
