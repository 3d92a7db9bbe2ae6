//! Roughing across the axis: read, expanded, driven over a blank, corrected with what finishes it, and refused where it is no such
//! cycle.
#![allow(clippy::unwrap_used, clippy::panic, missing_docs)]

use precut_calc::calculator::{Failure, Finding};
use precut_calc::program_compensation::CycleKind;
use serde_json::{Value, json};

use crate::program_correction::{bar, compensate, compensation, off_from_told};
use crate::program_reading::{job, number, read, word};
use crate::program_yielding::try_solve;

/// The numbers of the cycles: roughing across, and finishing.
const CONTROLS: [(&str, &str, &str, &str); 3] = [
    ("fanuc_a", "G21 G18 G40 G99", "G72", "G70"),
    ("fanuc", "G21 G18 G40 G90 G95", "G72", "G70"),
    ("fanuc_c", "G71 G18 G40 G90 G95", "G74", "G72"),
];

/// Stairs that fall to the tailstock: a taper, a quarter of a circle, a cylinder.
const CONTOUR: &str = "N10 G0 Z-30.\nG1 X50. F0.1\nX40. Z-20.\nG3 X30. Z-15. I0. K5.\nG1 Z-10.\nX20.\nN20 Z2.\n";

fn text(head: &str, rough: &str, finish: &str) -> String {
    let cycle = format!("{rough} W2. R0.5\n{rough} P10 Q20 U0.4 W0.2 F0.25\n{CONTOUR}{finish} P10 Q20\n");
    format!("{head}\nT0101\nG97 S500 M3\nG0 X62. Z2.\n{cycle}G0 X100.\nM30\n")
}

/// Radius of the contour at a place from program zero, of what stands left of it.
fn radius(z: f64) -> f64 {
    match z {
        _ if z < -20.0 => 20.0 - 0.5 * (z + 20.0),
        // About the centre at 20 mm and -15 mm.
        _ if z < -15.0 => 20.0 - (25.0 - (z + 15.0).powi(2)).sqrt(),
        _ if z < -10.0 => 15.0,
        _ => 10.0,
    }
}

#[test]
fn passes_across_the_axis_are_those_of_every_control() {
    let mut all = Vec::new();
    for (dialect, head, rough, finish) in CONTROLS {
        let answer = read(&job(&text(head, rough, finish), dialect, &json!({}))).unwrap();
        let kinds: Vec<CycleKind> = answer.output.cycles.iter().map(|cycle| cycle.kind).collect();
        assert_eq!(kinds, [CycleKind::RoughX, CycleKind::Finishing]);
        all.push(answer.output.moves);
    }
    assert_eq!((&all[0], &all[0]), (&all[1], &all[2]));
    let moves = &all[0];
    let place = |i: usize| (moves.x_diameter_mm[i].unwrap(), moves.z_mm[i].unwrap());
    let of_cycle: Vec<usize> = (0..moves.line.len()).filter(|&i| moves.line[i] == 6).collect();
    // Fifteen passes of 2 mm, each of four moves, lie above -29.8; the last step is smaller.
    for (pass, four) in of_cycle.chunks(4).take(15).enumerate() {
        let z = -2.0 * pass as f64;
        let deep = 2.0 * (radius(z - 0.2) + 0.2);
        let wanted = [(62.0, z), (deep, z), (deep + 1.0, z + 0.5), (62.0, z + 0.5)];
        for (&i, (x, wanted_z)) in four.iter().zip(wanted) {
            assert!((place(i).0 - x).abs() < 1e-9 && (place(i).1 - wanted_z).abs() < 1e-9, "{pass}: {:?}", place(i));
        }
        let kinds: Vec<&str> = four.iter().map(|&i| moves.kind[i].name()).collect();
        assert_eq!(kinds, ["rapid", "line", "line", "rapid"]);
    }
    // Then along the contour that is left, and back to the begin.
    let behind: Vec<(f64, f64)> = of_cycle[60..].iter().map(|&i| place(i)).collect();
    let along = [
        (62.0, -29.8),
        (62.4, -29.8),
        (50.4, -29.8),
        (40.4, -19.8),
        (30.4, -14.8),
        (30.4, -9.8),
        (20.4, -9.8),
        (20.4, 2.2),
        (20.4, 2.0),
        (62.0, 2.0),
    ];
    assert_eq!(behind.len(), along.len(), "{behind:?}");
    for (found, wanted) in behind.iter().zip(along) {
        assert!((found.0 - wanted.0).abs() < 1e-9 && (found.1 - wanted.1).abs() < 1e-9, "{behind:?}");
    }
}

/// The one-line form says the depth itself; a blank that rises from pass to pass is roughed as well.
#[test]
fn one_line_does_as_two_and_either_way_along_the_axis() {
    let (dialect, head, rough, finish) = CONTROLS[0];
    let two = text(head, rough, finish);
    let one = two.replace("G72 W2. R0.5\n", "\n").replace("W0.2 F0.25", "W0.2 D2. F0.25");
    let moves = |text: &str| read(&job(text, dialect, &json!({}))).unwrap().output.moves;
    assert_eq!(moves(&two), moves(&one));
    let mirrored = "G21 G18 G40 G99\nT0101\nG97 S500 M3\nG0 X62. Z-2.\nG72 W2. R0.5\nG72 P10 Q20 U0.4 W-0.2 F0.25\n\
                    N10 G0 Z30.\nG1 X50. F0.1\nX40. Z20.\nG2 X30. Z15. I0. K-5.\nG1 Z10.\nX20.\nN20 Z-2.\nG70 P10 Q20\nG0 X100.\nM30\n";
    let (given, other) = (moves(&two), moves(mirrored));
    assert_eq!(given.line, other.line);
    for i in 0..given.line.len() {
        let (x, z) = (given.x_diameter_mm[i].unwrap(), given.z_mm[i].unwrap());
        let (other_x, other_z) = (other.x_diameter_mm[i].unwrap(), other.z_mm[i].unwrap());
        assert!((x - other_x).abs() < 1e-9 && (z + other_z).abs() < 1e-9, "{i}");
    }
}

/// What roughing leaves is the contour with its allowances, what finishing leaves the contour; no rapid move goes through it.
#[test]
fn the_blank_is_turned_to_the_contour() {
    let (dialect, head, rough, finish) = CONTROLS[0];
    let both = text(head, rough, finish);
    for (text, [by_r, by_z]) in [(both.replace("G70 P10 Q20\n", ""), [0.2, 0.2]), (both.clone(), [0.0, 0.0])] {
        let mut job = job(&text, dialect, &json!({}));
        job["program_zero_z_mm"] = json!(100);
        job["stock"] = json!({ "profile": [{ "z_mm": 0, "diameter_mm": 60 }, { "z_mm": 100, "diameter_mm": 60 }] });
        job["tools"] = json!([{ "number": "1", "nose_radius_mm": 0, "cutting_edge_angle_deg": 95, "minor_edge_angle_deg": 50, "tip_direction": 3 }]);
        let answer = read(&job).unwrap();
        assert!(answer.warnings.iter().all(|warning| warning.code != "rapid_in_stock"), "{:?}", answer.warnings);
        let surface = answer.output.surface.as_ref().unwrap();
        for z in [-29.0, -27.0, -21.0, -14.0, -12.0, -9.0, -1.0] {
            let at = (0..surface.z_start_mm.len())
                .find(|&i| surface.z_start_mm[i] <= 100.0 + z && 100.0 + z <= surface.z_end_mm[i]);
            let at = at.unwrap();
            let share = (100.0 + z - surface.z_start_mm[at]) / (surface.z_end_mm[at] - surface.z_start_mm[at]);
            let left =
                surface.diameter_start_mm[at] + share * (surface.diameter_end_mm[at] - surface.diameter_start_mm[at]);
            let wanted = 2.0 * (radius(z - by_z) + by_r);
            assert!((left - wanted).abs() < 1e-6, "{z}: {left}, {wanted}");
        }
    }
}

/// A contour that is roughed across the axis, or along itself, and finished comes out as it is meant; its own lines stay.
#[test]
fn what_finishes_it_is_corrected_and_proved() {
    let contour = "N10 G0 Z-80.\nG1 X26. F0.1\nX24. Z-40.\nX22.\nN20 Z2.\n";
    let along = "N10 G0 X22.\nG1 Z-40. F0.1\nX24.\nX26. Z-80.\nN20 X31.\n";
    for (rough, contour) in [
        ("G72 W1.5 R0.5\nG72 P10 Q20 U0.6 W0.1 F0.25\n", contour),
        ("G73 U2. W0. R3\nG73 P10 Q20 U0.6 W0.1 F0.25\n", along),
    ] {
        let program =
            format!("G21 G18 G40 G99\nT0101\nG97 S800 M3\nG0 X32. Z2.\n{rough}{contour}G70 P10 Q20\nG0 X100.\nM30\n");
        let mut job = bar(&program, "fanuc_a");
        job["tools"][0]["minor_edge_angle_deg"] = json!(50);
        let answer = try_solve(&compensate(&job)).unwrap();
        let compensation = compensation(&answer);
        let call = program.lines().position(|line| line.starts_with("G70")).unwrap() + 1;
        assert_eq!(compensation.lines_changed, [call], "{:?}\n{}", compensation.left_alone, compensation.diff);
        let proof = compensation.proof.unwrap();
        assert!(proof.largest_error_before_um > 5.0 && proof.largest_residual_um <= 1.5, "{proof:?}");
        assert!(proof.largest_error_after_um < 3.0, "{proof:?}");
        let (off, compared) = off_from_told(&job, compensation);
        assert!(off < 0.15 && compared > 20, "{off} {compared}");
    }
}

fn fault(text: &str, dialect: &str) -> Finding {
    match read(&job(text, dialect, &json!({}))) {
        Err(Failure::NotRead { mut findings, .. }) if findings.len() == 1 => findings.remove(0),
        other => panic!("{text}{other:?}"),
    }
}

/// What is no such cycle is refused at its place.
#[test]
fn what_is_no_such_cycle_is_refused() {
    let (dialect, head, rough, finish) = CONTROLS[0];
    let good = text(head, rough, finish);
    for (from, to, code, place, told) in [
        // A pocket: z goes back, or the radius.
        ("G1 Z-10.\n", "G1 Z-17.\n", "contour_not_monotone", (11.0, 4.0), "Z-17."),
        ("G1 Z-10.\n", "G1 X36. Z-10.\n", "contour_not_monotone", (11.0, 4.0), "X36."),
        // From the axis outward, as in a bore.
        ("G0 X62. Z2.", "G0 X10. Z2.", "inside_turning", (6.0, 1.0), "G72"),
        // No depth; a depth along the radius.
        ("G72 W2. R0.5", "G72 R0.5", "cycle_word_missing", (6.0, 1.0), "G72"),
        ("G72 W2. R0.5", "G72 U2. W2. R0.5", "word_not_used", (5.0, 5.0), "U2."),
    ] {
        let mut text = good.replace(from, to);
        if code == "inside_turning" {
            let start = text.find("N10").unwrap();
            let end = text.find("G70").unwrap();
            text.replace_range(start..end, "N10 G0 Z-30.\nG1 X20. F0.1\nX30. Z-20.\nN20 Z2.\n");
        }
        let found = fault(&text, dialect);
        let at = (number(&found, "line"), number(&found, "column"));
        assert_eq!((found.code, word(&found).as_str()), (code, told), "{text}");
        assert!((at.0 - place.0).abs() < 1e-9 && (at.1 - place.1).abs() < 1e-9, "{at:?}\n{text}");
    }
    // LinuxCNC has it with the contour in a subprogram.
    let found = fault("G21 G18 G7\nT1 M6\nF1\nG0 X40 Z2\nG72 Q100\nM2\n", "linuxcnc");
    assert_eq!((found.code, word(&found).as_str()), ("contour_not_found", "Q100"));
    let place: Value = json!([number(&found, "line"), number(&found, "column")]);
    assert_eq!(place, json!([5.0, 5.0]));
}
