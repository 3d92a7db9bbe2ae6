//! Programs that are corrected to the drawing: what comes back is driven as a program of its own and held against it.
#![allow(clippy::unwrap_used, clippy::panic, missing_docs)]

use precut_calc::calculator::{Answer, Calculator, Check, Violations};
use precut_calc::program_compensation::{CompensatedProgram, LineChange, Outcome, ProgramCompensation};
use serde_json::{Value, json};

use crate::draw::Draw;
use crate::program_correction::{bar, codes, compensation};
use crate::program_yielding::{shaft, try_solve};

/// Chord tolerance and increment, on the radius, um.
const RESIDUAL_UM: f64 = 1.5;

const PLAIN: &str = "G21 G18 G40 G99\nT0101\nG97 S800 M3\nG0 X32. Z2.\nX26.\nG1 Z-250. F0.1\nG0 X100.\nM30\n";

fn to_drawing(job: &Value, drawing: &Value) -> Value {
    let mut job = job.clone();
    job["mode"] = json!({ "kind": "compensate", "correct_to": "drawing" });
    job["drawing"] = drawing.clone();
    job
}

/// Places and real diameters of what a returned program leaves when it is driven with no drawing beside it, without stretches that
/// stay thick.
fn left(job: &Value, compensation: &CompensatedProgram) -> Vec<(f64, f64)> {
    let mut again = job.clone();
    again["nc_program"] = json!(compensation.nc_program);
    again["mode"] = json!({ "kind": "read" });
    again.as_object_mut().unwrap().remove("drawing");
    let answer = try_solve(&again).unwrap();
    let contour = &answer.output.yielding.as_ref().unwrap().contour;
    let is_thick = |z: f64| {
        compensation.transitions.iter().any(|one| (one.z_mm - 0.3..one.z_mm + one.length_mm + 0.3).contains(&z))
    };
    let places = (0..contour.z_mm.len()).filter(|&i| !is_thick(contour.z_mm[i]));
    places.map(|i| (contour.z_mm[i], contour.wanted_diameter_mm[i] + contour.diameter_error_um[i] / 1000.0)).collect()
}

/// How far the diameter is off a drawing at the most, um, and at how many places that was looked at.
fn off(left: &[(f64, f64)], drawing: impl Fn(f64) -> Option<f64>) -> (f64, usize) {
    let off = left.iter().filter_map(|&(z, d)| drawing(z).map(|drawn| 1000.0 * (d - drawn).abs()));
    off.fold((0.0, 0), |(worst, count), off| (worst.max(off), count + 1))
}

/// A program that means other diameters than the drawing leaves those of the drawing, step and taper and all.
#[test]
fn the_work_comes_out_as_the_drawing_says() {
    let drawing = json!([
        { "z_mm": 100, "diameter_mm": 25.98 }, { "z_mm": 150, "diameter_mm": 25.98 }, { "z_mm": 200, "diameter_mm": 26.03 },
        { "z_mm": 200, "diameter_mm": 26.01 }, { "z_mm": 280, "diameter_mm": 26.01 },
    ]);
    let drawn = |z: f64| {
        let is_near = [100.0, 150.0, 200.0, 280.0].iter().any(|corner| (z - corner).abs() < 0.5);
        let diameter = match z {
            _ if is_near || !(100.0..=280.0).contains(&z) => return None,
            _ if z < 150.0 => 25.98,
            _ if z < 200.0 => 25.98 + 0.05 * (z - 150.0) / 50.0,
            _ => 26.01,
        };
        Some(diameter)
    };
    let job = to_drawing(&bar(PLAIN, "fanuc_a"), &drawing);
    let answer = try_solve(&job).unwrap();
    let compensation = compensation(&answer);
    let (worst, count) = off(&left(&job, compensation), drawn);
    assert!(worst <= 2.0 * RESIDUAL_UM && count > 60, "{worst} um at {count} places\n{}", compensation.diff);
    // Beside the drawing the program is what is meant.
    let beside = left(&job, compensation).into_iter().filter(|(z, _)| (55.0..99.0).contains(z) || *z > 281.0);
    let beside: Vec<(f64, f64)> = beside.collect();
    let (worst, count) = off(&beside, |z| (z < 299.0).then_some(26.0));
    assert!(worst <= 2.0 * RESIDUAL_UM && count > 20, "{worst} um at {count} places");
    let proof = compensation.proof.unwrap();
    assert!(proof.largest_residual_um <= RESIDUAL_UM, "{proof:?}");
    assert!(proof.largest_error_after_um <= 2.0 * RESIDUAL_UM, "{proof:?}");
    // What the program is off the drawing is told of it as it was: by 0.02 and 0.03 mm, and what the work gives way.
    assert!(proof.largest_error_before_um > 20.0 && proof.smallest_error_before_um < -20.0, "{proof:?}");
    for code in ["program_brought_to_drawing", "error_against_drawing"] {
        assert!(answer.explanation.iter().any(|said| said.code == code), "{code}");
    }
    // As the program means it, is what it was without the drawing.
    let mut to_program = job.clone();
    to_program["mode"]["correct_to"] = json!("program");
    let mut without = to_program.clone();
    without.as_object_mut().unwrap().remove("drawing");
    let of = |job: &Value| try_solve(job).unwrap().output.compensation;
    assert_eq!(of(&to_program), of(&without));
}

/// What the nose leaves on a taper goes with the rest.
#[test]
fn the_nose_on_a_taper_is_corrected_to_the_drawing() {
    let program =
        "G21 G18 G40 G99\nT0101\nG97 S800 M3\nG0 X32. Z2.\nX20.\nG1 Z-50. F0.1\nX28. Z-150.\nX31.\nG0 X100.\nM30\n";
    let drawing = json!([
        { "z_mm": 150, "diameter_mm": 28 }, { "z_mm": 250, "diameter_mm": 20 }, { "z_mm": 300, "diameter_mm": 20 },
    ]);
    let taper = |z: f64| (152.0..248.0).contains(&z).then(|| 20.0 + 8.0 * (250.0 - z) / 100.0);
    let job = to_drawing(&bar(program, "fanuc_a"), &drawing);
    let as_programmed = {
        let mut job = bar(program, "fanuc_a");
        job["mode"] = json!({ "kind": "compensate" });
        let answer = try_solve(&job).unwrap();
        off(&left(&job, compensation(&answer)), taper).0
    };
    // 0.4 mm (cos alpha + sin alpha - 1) normal to a slope of 0.04, on the diameter.
    let slope = 0.04_f64.atan();
    let of_nose = 800.0 * (slope.cos() + slope.sin() - 1.0) / slope.cos();
    assert!((as_programmed - of_nose).abs() < 2.0 * RESIDUAL_UM && of_nose > 30.0, "{as_programmed}, {of_nose}");
    let answer = try_solve(&job).unwrap();
    let (worst, count) = off(&left(&job, compensation(&answer)), taper);
    assert!(worst <= 2.0 * RESIDUAL_UM && count > 30, "{worst} um at {count} places");
}

/// What is left by a rigid program as a drawing.
fn drawing_of(answer: &Answer<Outcome>) -> Value {
    let surface = answer.output.surface.as_ref().unwrap();
    let rows = (0..surface.z_start_mm.len()).filter(|&i| surface.line[i].is_some()).flat_map(|i| {
        let chords: u32 = if surface.arc_radius_mm[i].is_some() { 24 } else { 1 };
        let (from, to) = (surface.z_start_mm[i], surface.z_end_mm[i]);
        let circle = (surface.centre_diameter_mm[i], surface.centre_z_mm[i], surface.arc_radius_mm[i]);
        let diameter = move |z: f64| {
            if let (Some(x), Some(centre), Some(radius)) = circle {
                return x + 2.0 * radius.signum() * (radius * radius - (z - centre).powi(2)).max(0.0).sqrt();
            }
            let share = (z - from) / (to - from);
            surface.diameter_start_mm[i] + share * (surface.diameter_end_mm[i] - surface.diameter_start_mm[i])
        };
        (0..=chords).map(move |k| {
            let z = from + (to - from) * f64::from(k) / f64::from(chords);
            json!({ "z_mm": z, "diameter_mm": diameter(z) })
        })
    });
    Value::Array(rows.collect())
}

/// A corrected program leaves what was meant: corrected to that, it changes by no more than two increments and what chords may be off
/// what they follow, those that are there and those that are laid anew: half a micrometre each, on the radius.
#[test]
fn a_corrected_program_needs_no_other_correction() {
    let mut lines = 0;
    for (seed, dialect) in [(2000, "fanuc_a"), (2001, "siemens"), (2002, "linuxcnc"), (2003, "fanuc")] {
        let mut job = shaft(&mut Draw::new(seed), dialect);
        job["force"]["specific_normal_force_n_per_mm2"] = json!(2500);
        job["mode"] = json!({ "kind": "compensate" });
        let first = try_solve(&job).unwrap();
        let corrected = compensation(&first);
        let drawing = drawing_of(&first);
        let mut again = to_drawing(&job, &drawing);
        again["nc_program"] = json!(corrected.nc_program);
        let answer = try_solve(&again).unwrap();
        let second = compensation(&answer);
        let largest = |one: &LineChange| one.largest_shift_um.max(-one.smallest_shift_um);
        for change in &second.changes {
            assert!(largest(change) <= 2.0 + 2.0 + 1e-6, "{dialect} {}: {}", change.line, second.diff);
        }
        lines += corrected.lines_changed.len();
    }
    assert!(lines > 8, "{lines}");
}

/// What is another shape is told with its lines, and corrected to the program.
#[test]
fn another_shape_is_not_made() {
    let rows =
        |diameter: f64| json!([{ "z_mm": 100, "diameter_mm": diameter }, { "z_mm": 250, "diameter_mm": diameter }]);
    let plain = {
        let mut job = bar(PLAIN, "fanuc_a");
        job["mode"] = json!({ "kind": "compensate" });
        try_solve(&job).unwrap()
    };
    let far = try_solve(&to_drawing(&bar(PLAIN, "fanuc_a"), &rows(25.4))).unwrap();
    assert!(codes(&far).contains(&"far_from_drawing"));
    assert_eq!(compensation(&far).nc_program, compensation(&plain).nc_program);
    // Mended as it says, it is made.
    let near = try_solve(&to_drawing(&bar(PLAIN, "fanuc_a"), &rows(25.6))).unwrap();
    assert!(!codes(&near).contains(&"far_from_drawing"));
    assert!(
        compensation(&near).changes.iter().any(|one| one.smallest_shift_um < -390.0),
        "{}",
        compensation(&near).diff
    );
}

#[test]
fn a_correction_to_a_drawing_needs_one() {
    let mut job = bar(PLAIN, "fanuc_a");
    job["mode"] = json!({ "kind": "compensate", "correct_to": "drawing" });
    let faults = |job: &Value| {
        let parsed: <ProgramCompensation as Calculator>::Input = serde_json::from_value(job.clone()).unwrap();
        let mut violations = Violations::default();
        parsed.check(&mut violations);
        violations.into_vec().into_iter().map(|fault| fault.code).collect::<Vec<_>>()
    };
    assert_eq!(faults(&job), ["drawing_missing"]);
    job["mode"]["correct_to"] = json!("program");
    assert_eq!(faults(&job), Vec::<&str>::new());
}
