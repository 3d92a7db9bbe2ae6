//! Times of reading an existing turning program and of turning its blank.

use std::fmt::Write as _;

use precut_calc::calculator::{Calculator, Unwatched};
use precut_calc::program_compensation::ProgramCompensation;
use serde_json::{Value, json};

use crate::measure::{Measured, cpu_time};

const HEAD: &str = "G21 G18 G40 G99\nT0101\nG97 S500\nG0 X60. Z2.\nG1 F0.1\n";

/// A bar turned along waves of so many short moves.
fn text(lines: u32) -> String {
    let mut text = HEAD.to_owned();
    for i in 0..lines {
        let share = f64::from(i) / f64::from(lines);
        let x = 34.0 + 2.0 * (20.0 * share).sin() + 1.2 * (620.0 * share).sin();
        // A String takes whatever is written.
        let _ = writeln!(text, "G1 X{x:.3} Z{:.3}", 1.0 - 90.0 * share);
    }
    text + "G0 X60.\nM30\n"
}

/// A program of so many lines, read; with its stock, turned, too.
pub(crate) fn read(lines: u32, with_stock: bool) -> Result<Measured, String> {
    let stock = json!({ "profile": [{ "z_mm": 0, "diameter_mm": 40 }, { "z_mm": 100, "diameter_mm": 40 }] });
    let mut job: <ProgramCompensation as Calculator>::Input = serde_json::from_value(json!({
        "nc_program": text(lines), "dialect": "fanuc_a", "mode": { "kind": "read" }, "program_zero_z_mm": 100,
        "stock": if with_stock { stock } else { Value::Null },
        "tools": [{ "number": "1", "nose_radius_mm": 0.8, "cutting_edge_angle_deg": 95, "minor_edge_angle_deg": 5, "tip_direction": 3 }],
    }))
    .map_err(|error| error.to_string())?;
    ProgramCompensation::fill(&mut job);
    ProgramCompensation::run(&job, &Unwatched).map_err(|failure| format!("{failure:?}"))?;
    cpu_time(|| ProgramCompensation::run(&job, &Unwatched))
}
