//! What a part of a watched process costs, without writing JSON.

use precut_calc::calculator::{Calculator, ForwardModel, Rows, Unwatched};
use precut_calc::deflection_compensation::{DeflectionCompensation, DeflectionPoint};
use precut_calc::num::stats::Resampler;
use precut_calc::process::{DocumentOf, PartOf, Watch};
use serde_json::{Value, json};

use crate::measure::{Measured, cpu_time};

type Document = DocumentOf<DeflectionCompensation>;
type Part = PartOf<DeflectionCompensation>;

/// Lengths of the types, mm: the first is the shaft of the reference streams.
const LENGTHS_MM: [f64; 3] = [560.0, 420.0, 480.0];

fn job(length_mm: f64) -> Value {
    json!({
        "shaft": {
            "segments": [{ "length_mm": length_mm, "diameter_mm": 40.0, "stock_diameter_mm": 41.6 }],
            "youngs_modulus_n_per_mm2": 210_000.0
        },
        "supports": [
            { "kind": "centre", "z_mm": 0.0, "compliance_um_per_n": 0.02 },
            { "kind": "centre", "z_mm": length_mm, "compliance_um_per_n": 0.03 }
        ],
        "carriage": { "compliance_um_per_n": 0.025 },
        "force": { "kind": "power_law", "passive": {
            "coefficient": 1643.56634, "depth_exponent": 0.9, "feed_exponent": 0.6, "speed_exponent": -0.15
        } },
        "cut": { "feed_mm_per_rev": 0.3, "speed_m_per_min": 100.0, "feed_direction": "to_headstock" },
        "include": { "tangential": false, "axial_moment": false, "weight": false },
        "tolerance": { "form_um": 12.0, "diameter_um": 20.0 }
    })
}

/// A process of so many types and parts in turn, each measured in so many rows: nothing changes in it.
fn quiet(types: usize, rows: usize, parts: u32) -> Result<(Document, Vec<Part>), String> {
    let names = ["A", "B", "C"];
    let of: serde_json::Map<String, Value> = names
        .iter()
        .zip(LENGTHS_MM)
        .take(types)
        .map(|(name, length_mm)| ((*name).to_owned(), json!({ "job": job(length_mm) })))
        .collect();
    let document = json!({
        "calculator": "deflection-compensation", "part_types": of, "quantity": "diameter_deviation_um",
        "allowances": { "setup_diameter_um": 1.0, "force_per_run_rel": 0.007 }
    });
    let mut document: Document = serde_json::from_value(document).map_err(|error| error.to_string())?;
    document.part_types.values_mut().for_each(|of| DeflectionCompensation::fill(&mut of.job));
    let expected = names[..types]
        .iter()
        .zip(LENGTHS_MM)
        .map(|(name, length_mm)| predicted(&document, name, length_mm, rows))
        .collect::<Result<Vec<_>, _>>()?;
    let mut random = Resampler::new(1, 0);
    let parts = (0..parts)
        .map(|part| {
            let own = part as usize % types;
            let setting_um = random.normal();
            let measured: Vec<Value> = expected[own]
                .iter()
                .map(|(z, um)| json!({ "z_mm": z, "diameter_deviation_um": um + setting_um + random.normal() }))
                .collect();
            let part = json!({
                "number": part + 1, "part_type": names[own], "edge": 1,
                "conditions": { "tool_path_at_start_m": 0.0, "warm_time_at_start_min": 0.0 }, "measurements": measured
            });
            serde_json::from_value(part).map_err(|error| error.to_string())
        })
        .collect::<Result<_, _>>()?;
    Ok((document, parts))
}

/// Places of the rows, and what the model says of them.
fn predicted(document: &Document, name: &str, length_mm: f64, rows: usize) -> Result<Vec<(f64, f64)>, String> {
    let job = &document.part_types[name].job;
    let z: Vec<f64> = (0..rows).map(|row| length_mm * (0.03 + 0.94 * row as f64 / (rows - 1) as f64)).collect();
    let run = serde_json::from_value(json!({ "tool_path_at_start_m": 0.0, "warm_time_at_start_min": 0.0 }))
        .map_err(|error| error.to_string())?;
    let points = z.iter().map(|&z_mm| (0, DeflectionPoint { z_mm })).collect();
    let rows = Rows { runs: vec![run], points };
    let prepared = DeflectionCompensation::prepare(job, &rows, &document.quantity, &Unwatched)
        .map_err(|error| format!("{error:?}"))?;
    let um = DeflectionCompensation::predict(&prepared, &[], &Unwatched).map_err(|failure| format!("{failure:?}"))?;
    Ok(z.into_iter().zip(um.into_iter().map(|um| um.unwrap_or(0.0))).collect())
}

/// All parts of a quiet process, one after the other.
pub(crate) fn replay(types: usize, rows: usize, parts: u32) -> Result<Measured, String> {
    let (document, all) = quiet(types, rows, parts)?;
    Watch::<DeflectionCompensation>::replay(document.clone(), &all, &Unwatched)
        .map_err(|failure| format!("{failure:?}"))?;
    cpu_time(|| Watch::<DeflectionCompensation>::replay(document.clone(), &all, &Unwatched).map(|(_, states)| states))
}

/// One of them.
pub(crate) fn part(types: usize, rows: usize) -> Result<Measured, String> {
    const PARTS: u32 = 300;
    let Measured { median, low, high } = replay(types, rows, PARTS)?;
    let each = |all: f64| all / f64::from(PARTS);
    Ok(Measured { median: each(median), low: each(low), high: each(high) })
}
