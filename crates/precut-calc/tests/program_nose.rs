//! Programs with compensation of the nose: what they leave is what is programmed, and what yields is corrected to it.
#![allow(clippy::unwrap_used, clippy::panic, missing_docs)]

use precut_calc::calculator::Answer;
use precut_calc::program_compensation::{LeftSurface, Outcome};
use serde_json::{Value, json};

use crate::program_correction::{bar, compensate, compensation, off_from_told};
use crate::program_reading::{job, read};
use crate::program_yielding::try_solve;

const NOSE_MM: f64 = 0.8;

/// Heads for every control, and the motions of a right-hand tool.
const CONTROLS: [(&str, &str); 5] = [
    ("fanuc_a", "G21 G18 G40 G99\nT0101\nG97 S500 M3\n"),
    ("fanuc", "G21 G18 G40 G90 G95\nT0101\nG97 S500 M3\n"),
    ("fanuc_c", "G71 G18 G40 G90 G95\nT0101\nG97 S500 M3\n"),
    ("siemens", "G710 G18 G40 G90 G95 DIAMON\nT1 D1\nG97 S500 M3\n"),
    ("linuxcnc", "G21 G18 G40 G90 G95 G7\nT1 M6\nG97 S500 M3\n"),
];

/// A cylinder, a taper, a quarter of a circle outward, a shoulder with a hollow, a cylinder.
const CONTOUR: &str = "G0 X62. Z5.\nG42 G0 X20. Z2.\nG1 Z-10. F0.1\nX28. Z-26.\nG3 X36. Z-30. I0. K-4.\nG1 Z-40.\nG2 X40. Z-42. I2. K0.\n\
                       G1 X50.\nZ-60.\nX62.\nG40 G0 X70. Z5.\nM30\n";

/// Radius that is programmed at a place from program zero.
fn programmed(z: f64) -> f64 {
    match z {
        _ if z > -10.0 => 10.0,
        _ if z > -26.0 => 10.0 + 0.25 * (-10.0 - z),
        _ if z > -30.0 => 14.0 + (16.0 - (z + 30.0).powi(2)).sqrt(),
        _ if z > -40.0 => 18.0,
        _ if z > -42.0 => 20.0 - (4.0 - (z + 40.0).powi(2)).sqrt(),
        _ => 25.0,
    }
}

fn on_a_bar(text: &str, dialect: &str) -> Value {
    let mut job = job(text, dialect, &json!({}));
    job["program_zero_z_mm"] = json!(100);
    job["stock"] = json!({ "profile": [{ "z_mm": 0, "diameter_mm": 60 }, { "z_mm": 100, "diameter_mm": 60 }] });
    job["tools"] = json!([{ "number": "1", "nose_radius_mm": NOSE_MM, "cutting_edge_angle_deg": 95, "minor_edge_angle_deg": 50, "tip_direction": 3 }]);
    job
}

/// Radius that is left at a place from the headstock end.
fn left(surface: &LeftSurface, x: f64) -> f64 {
    let at = (0..surface.z_start_mm.len()).find(|&i| surface.z_start_mm[i] <= x && x <= surface.z_end_mm[i]).unwrap();
    let circle = (surface.centre_diameter_mm[at], surface.centre_z_mm[at], surface.arc_radius_mm[at]);
    if let (Some(diameter), Some(centre), Some(radius)) = circle {
        return 0.5 * diameter + radius.signum() * (radius * radius - (x - centre).powi(2)).max(0.0).sqrt();
    }
    let share = (x - surface.z_start_mm[at]) / (surface.z_end_mm[at] - surface.z_start_mm[at]);
    0.5 * (surface.diameter_start_mm[at] + share * (surface.diameter_end_mm[at] - surface.diameter_start_mm[at]))
}

fn surface(answer: &Answer<Outcome>) -> &LeftSurface {
    answer.output.surface.as_ref().unwrap()
}

/// Places along the contour, without the corner between taper and arc, which the nose does not reach, and the last one.
fn places() -> impl Iterator<Item = f64> {
    let is_beside = |z: f64| (z + 42.0).abs() > 0.2 && (z + 25.5).abs() > 0.65;
    (1..590).map(|i| -0.1 * f64::from(i)).filter(move |z| is_beside(*z))
}

#[test]
fn what_is_programmed_is_left_by_every_control() {
    for (dialect, head) in CONTROLS {
        let answer = read(&on_a_bar(&format!("{head}{CONTOUR}"), dialect)).unwrap();
        for z in places() {
            let (found, wanted) = (left(surface(&answer), 100.0 + z), programmed(z));
            // In a corner at which the tool is on the inside the nose leaves its round: where the taper begins, by so much at the most.
            let round = NOSE_MM * (1.0 - (1.0 - (0.5 * 0.25_f64.atan()).tan().powi(2)).sqrt());
            let within = if (z + 10.0).abs() < 0.3 { round + 1e-9 } else { 1e-6 };
            assert!((found - wanted).abs() <= within, "{dialect} {z}: {found}, {wanted}");
        }
    }
    // Without compensation the taper stays thick, and so does the arc.
    let plain = CONTOUR.replace("G42 ", "").replace("G40 ", "");
    let answer = read(&on_a_bar(&format!("{}{plain}", CONTROLS[0].1), "fanuc_a")).unwrap();
    let slope = 0.25_f64.atan();
    let thick = NOSE_MM * (slope.cos() + slope.sin() - 1.0) / slope.cos();
    assert!((left(surface(&answer), 82.0) - programmed(-18.0) - thick).abs() < 1e-6);
    assert!(left(surface(&answer), 72.0) > programmed(-28.0) + 0.1);
}

/// A left-hand tool goes to the tailstock with its nose to the left of the path.
#[test]
fn a_left_hand_tool_leaves_the_mirrored_part() {
    let mirrored = CONTOUR.replace("Z-", "Z+").replace("Z5.", "Z-5.").replace("Z2.", "Z-2.").replace("Z+", "Z");
    let mirrored = mirrored.replace("G42", "G41").replace("G3 ", "G9 ").replace("G2 ", "G3 ").replace("G9 ", "G2 ");
    let mirrored = mirrored.replace("K-4.", "K4.");
    let (dialect, head) = CONTROLS[0];
    let mut job = on_a_bar(&format!("{head}{mirrored}"), dialect);
    job["program_zero_z_mm"] = json!(0);
    job["tools"][0]["tip_direction"] = json!(4);
    let answer = read(&job).unwrap();
    for z in places().filter(|z| (z + 10.0).abs() > 0.3) {
        let (found, wanted) = (left(surface(&answer), -z), programmed(z));
        assert!((found - wanted).abs() < 1e-6, "{z}: {found}, {wanted}");
    }
}

/// Roughing is done without compensation, finishing along the same contour with it.
#[test]
fn finishing_cycles_are_compensated_and_roughing_is_not() {
    let head = CONTROLS[0].1;
    let cycle = format!(
        "{head}G0 X62. Z2.\nG71 U2. R0.5\nG71 P10 Q20 U1. W0.2 F0.25\nN10 G42 G0 X20.\nG1 Z-10. F0.1\nX28. Z-26.\n\
         G3 X36. Z-30. I0. K-4.\nG1 Z-40.\nX50.\nZ-60.\nN20 G40 X62.\nG70 P10 Q20\nG0 X100.\nM30\n"
    );
    let answer = read(&on_a_bar(&cycle, "fanuc_a")).unwrap();
    for z in places().filter(|z| (z + 10.0).abs() > 0.3 && (*z > -39.0 || *z < -40.2)) {
        let wanted = if z < -40.0 { 25.0 } else { programmed(z) };
        let found = left(surface(&answer), 100.0 + z);
        assert!((found - wanted).abs() < 1e-6, "{z}: {found}, {wanted}");
    }
    let rough = cycle.replace("G70 P10 Q20\n", "");
    let answer = read(&on_a_bar(&rough, "fanuc_a")).unwrap();
    let slope = 0.25_f64.atan();
    let thick = NOSE_MM * (slope.cos() + slope.sin() - 1.0) / slope.cos();
    // The contour with its allowances, thick by what the nose leaves.
    let wanted = programmed(-18.2) + 0.5 + thick;
    assert!((left(surface(&answer), 82.0) - wanted).abs() < 1e-6, "{}", left(surface(&answer), 82.0));
}

/// With compensation the work is corrected to what is programmed, in blocks that the control can compensate.
#[test]
fn a_compensated_program_is_corrected_and_proved() {
    let program = "G21 G18 G40 G99\nT0101\nG97 S800 M3\nG0 X32. Z5.\nG42 G0 X20. Z2.\nG1 Z-50. F0.1\nX26. Z-150.\nZ-200.\nX27.\n\
                   Z-250.\nX32.\nG40 G0 X100.\nM30\n";
    let mut job = bar(program, "fanuc_a");
    job["force"]["specific_normal_force_n_per_mm2"] = json!(2500);
    let answer = try_solve(&compensate(&job)).unwrap();
    let compensation = compensation(&answer);
    let proof = compensation.proof.unwrap();
    let said = format!("{proof:?} {:?} {:?}\n{}", compensation.left_alone, compensation.transitions, compensation.diff);
    assert!(proof.largest_error_before_um > 10.0 && proof.largest_residual_um <= 1.5, "{said}");
    assert!(proof.largest_error_after_um < 3.0 && proof.smallest_error_after_um > -3.0, "{said}");
    assert!([7, 8, 10].iter().all(|line| compensation.lines_changed.contains(line)), "{said}");
    let (off, compared) = off_from_told(&job, compensation);
    assert!(off < 0.15 && compared > 60, "{off} {compared}\n{said}");
    // The taper comes out as it is programmed, nose and all.
    let contour = &compensation.contour;
    let along = (0..contour.z_mm.len()).filter(|&i| (152.0..248.0).contains(&contour.z_mm[i]));
    for i in along {
        let wanted = 20.0 + 0.06 * (250.0 - contour.z_mm[i]);
        assert!((contour.wanted_diameter_mm[i] - wanted).abs() < 1e-6, "{}", contour.z_mm[i]);
    }
    let z = |line: &str| line.split('Z').nth(1).and_then(|word| word.split(' ').next()?.parse::<f64>().ok());
    for change in &compensation.changes {
        let ends: Vec<f64> = change.new.iter().filter_map(|line| z(line)).collect();
        assert!(ends.windows(2).all(|pair| (pair[1] - pair[0]).abs() >= 2.0 * 0.4 - 2e-3), "{said}");
    }
}
