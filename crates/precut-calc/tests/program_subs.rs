//! Cycles of LinuxCNC over a contour in a subprogram: what they leave is what the same contour leaves by the words of another control
//! or by plain passes; what is no such cycle is refused.
#![allow(clippy::unwrap_used, clippy::panic, missing_docs)]

use precut_calc::calculator::{Answer, Failure};
use precut_calc::program_compensation::{CycleKind, LeftSurface, Outcome, WhyLeftAlone};
use serde_json::json;

use crate::program_correction::{bar, compensate, compensation, off_from_told, said_by_linuxcnc};
use crate::program_reading::{job, number, read, word};
use crate::program_yielding::try_solve;

const HEAD: &str = "G21 G18 G40 G90 G95 G7\nT1 M6\nG97 S500 M3\n";
/// A cylinder, a taper, a quarter of a circle, a shoulder: the same blocks for LinuxCNC and for Fanuc.
const ALONG: &str = "G1 X20. Z0.\nG1 Z-20.\nG1 X30. Z-40.\nG2 X40. Z-45. I5. K0.\nG1 Z-60.\nG1 X50.\n";
/// The same from the shoulder to the face.
const ACROSS: &str = "G1 Z-60.\nG1 X40.\nG1 Z-45.\nG3 X30. Z-40. I0. K5.\nG1 X20. Z-20.\nG1 Z0.\nG1 X18.\n";

fn linuxcnc(contour: &str, cycles: &str) -> String {
    format!("{HEAD}O100 SUB\n{contour}O100 ENDSUB\nF0.25\nG0 X62. Z2.\n{cycles}G0 X100. Z50.\nM2\n")
}

fn fanuc(contour: &str, head: &str, finish: &str) -> String {
    let lines: Vec<&str> = contour.lines().collect();
    let (first, rest) = lines.split_first().unwrap();
    let (last, between) = rest.split_last().unwrap();
    let between = between.join("\n");
    let cycle = format!("{head} F0.25\nN10 {first}\n{between}\nN20 {last}\n{finish}");
    format!("G21 G18 G40 G99\nT0101\nG97 S500 M3\nG0 X62. Z2.\nF0.25\n{cycle}G0 X100. Z50.\nM30\n")
}

/// The trailing edge of a tool that goes into the work straight across the axis leaves ridges, which a steep one would come rapidly through.
fn turned(text: &str, dialect: &str) -> Answer<Outcome> {
    let minor_deg = if text.contains("G72") { 44 } else { 60 };
    let mut job = job(text, dialect, &json!({}));
    job["program_zero_z_mm"] = json!(100);
    job["stock"] = json!({ "profile": [{ "z_mm": 0, "diameter_mm": 60 }, { "z_mm": 100, "diameter_mm": 60 }] });
    job["tools"] = json!([{ "number": "1", "nose_radius_mm": 0, "cutting_edge_angle_deg": 93, "minor_edge_angle_deg": minor_deg, "tip_direction": 3 }]);
    let answer = read(&job).unwrap_or_else(|e| panic!("{e:?}\n{text}"));
    assert!(answer.warnings.iter().all(|warning| warning.code != "rapid_in_stock"), "{:?}\n{text}", answer.warnings);
    answer
}

/// Diameter of what is left at a place from program zero.
fn left(surface: &LeftSurface, z: f64) -> f64 {
    let z = z + 100.0;
    let at = (0..surface.z_start_mm.len()).find(|&i| surface.z_start_mm[i] <= z && z <= surface.z_end_mm[i]).unwrap();
    if let Some(((centre_z, centre), radius)) =
        surface.centre_z_mm[at].zip(surface.centre_diameter_mm[at]).zip(surface.arc_radius_mm[at])
    {
        let height = (radius * radius - (z - centre_z).powi(2)).sqrt();
        return centre + 2.0 * height.copysign(radius);
    }
    let share = (z - surface.z_start_mm[at]) / (surface.z_end_mm[at] - surface.z_start_mm[at]);
    surface.diameter_start_mm[at] + share * (surface.diameter_end_mm[at] - surface.diameter_start_mm[at])
}

fn assert_same(one: &Answer<Outcome>, other: &Answer<Outcome>, what: &str) {
    let [one, other] = [one, other].map(|answer| answer.output.surface.as_ref().unwrap());
    for i in 1..700 {
        // Beside steps both have the one or the other diameter.
        let z = -0.1 * f64::from(i) + 0.003;
        let (a, b) = (left(one, z), left(other, z));
        assert!((a - b).abs() < 1e-6, "{what}, z {z}: {a} {b}");
    }
}

#[test]
fn roughing_and_finishing_leave_what_other_controls_leave() {
    for (contour, rough, head) in [
        (ALONG, "G71 Q100 D0 I2. R0.5", "G71 U2. R0.5\nG71 P10 Q20 U0. W0."),
        (ACROSS, "G72 Q100 D0 I2. R0.5", "G72 W2. R0.5\nG72 P10 Q20 U0. W0."),
    ] {
        let roughed = turned(&linuxcnc(contour, &format!("{rough}\n")), "linuxcnc");
        assert_same(&roughed, &turned(&fanuc(contour, head, ""), "fanuc_a"), rough);
        let both = format!("{rough}\nG0 X62.\nG0 Z2.\nG70 Q100\n");
        let finished = turned(&linuxcnc(contour, &both), "linuxcnc");
        assert_same(&finished, &turned(&fanuc(contour, head, "G70 P10 Q20\n"), "fanuc_a"), "finished");
        let kinds: Vec<CycleKind> = finished.output.cycles.iter().map(|cycle| cycle.kind).collect();
        let first = if contour == ALONG { CycleKind::RoughZ } else { CycleKind::RoughX };
        assert_eq!(kinds, [first, CycleKind::Finishing]);
    }
}

/// Ends of moves, radius and z, each once where several follow each other at one place.
fn once(places: impl Iterator<Item = [f64; 2]>) -> Vec<[f64; 2]> {
    let mut found: Vec<[f64; 2]> = Vec::new();
    for [r, z] in places {
        if found.last().is_none_or(|last| (last[0] - r).abs() > 2e-4 || (last[1] - z).abs() > 2e-4) {
            found.push([r, z]);
        }
    }
    found
}

/// The moves are those of LinuxCNC's own interpreter, which tells four decimals.
#[test]
fn moves_are_those_of_the_interpreter() {
    for (contour, cycles) in [
        (ALONG, "G71 Q100 D0 I2. R0.5\nG0 X62. Z2.\nG70 Q100\n"),
        (ALONG, "G71 Q100 X64. Z3. D0.5 I1.7 R0.3\nG0 X62. Z2.\nG70 Q100 D0.6 E0.2 P2\n"),
        (ALONG, "G71.1 Q100 D0.4\n"),
        (ACROSS, "G72 Q100 D0 I2. R0.5\nG0 X62. Z2.\nG70 Q100\n"),
        (ACROSS, "G72.1 Q100 D0.5 I2.3 R0.5\n"),
    ] {
        let text = linuxcnc(contour, cycles);
        let Some((is_run, said)) = said_by_linuxcnc(&text, "subs") else {
            return;
        };
        assert!(is_run, "{text}{said}");
        let told = said.lines().filter_map(|line| {
            let (head, rest) = line.split_once('(')?;
            let numbers: Vec<f64> = rest.split([',', ')']).map_while(|word| word.trim().parse().ok()).collect();
            match head.rsplit(' ').next()? {
                "STRAIGHT_TRAVERSE" | "STRAIGHT_FEED" => Some([numbers[0], numbers[2]]),
                "ARC_FEED" => Some([numbers[1], numbers[0]]),
                _ => None,
            }
        });
        let told = once(told);
        let moves = read(&job(&text, "linuxcnc", &json!({}))).unwrap().output.moves;
        let own = (0..moves.line.len()).map(|i| [0.5 * moves.x_diameter_mm[i].unwrap(), moves.z_mm[i].unwrap()]);
        let own = once(own);
        let off = |(a, b): (&[f64; 2], &[f64; 2])| (a[0] - b[0]).abs().max((a[1] - b[1]).abs());
        let first = own.iter().zip(&told).position(|pair| off(pair) > 2e-4);
        assert!(first.is_none() && own.len() == told.len(), "{cycles}{first:?}\n{own:?}\n{told:?}");
    }
}

/// What D leaves is the contour at that distance: longer radii, shoulders nearer to the tailstock, an arc about a corner.
#[test]
fn what_remains_lies_beside_the_contour() {
    let d = 0.5_f64;
    let tangent = (5.0_f64 / 20.0).atan();
    for (contour, cycle) in [(ALONG, "G71 Q100 D0.5 I2. R0.5\n"), (ACROSS, "G72 Q100 D0.5 I2. R0.5\n")] {
        let roughed = turned(&linuxcnc(contour, cycle), "linuxcnc");
        let surface = roughed.output.surface.as_ref().unwrap();
        // The cylinder, the taper, the quarter about the centre at 20 mm and -40 mm, the cylinder before the shoulder.
        let quarter = |z: f64| 40.0 - 2.0 * ((5.0 - d).powi(2) - (z + 40.0).powi(2)).sqrt();
        let taper = |z: f64| 20.0 - (z + 20.0) * 0.5 + 2.0 * d / tangent.cos();
        for (z, wanted) in [
            (-10.0, 20.0 + 2.0 * d),
            (-25.0, taper(-25.0)),
            (-35.0, taper(-35.0)),
            (-42.0, quarter(-42.0)),
            (-44.0, quarter(-44.0)),
            (-50.0, 40.0 + 2.0 * d),
        ] {
            // Toward the tailstock the trailing edge cuts into what is steeper than it.
            if contour == ALONG || !(-45.0..-40.0).contains(&z) {
                assert!((left(surface, z) - wanted).abs() < 1e-6, "{cycle}{z}: {}, {wanted}", left(surface, z));
            }
        }
        if contour == ACROSS {
            continue;
        }
        // Behind the arc the cylinder begins with an arc about its corner.
        let corner = (d * d - 0.3_f64.powi(2)).sqrt();
        let found = left(surface, -45.0 + 0.3);
        assert!((found - (40.0 + 2.0 * corner)).abs() < 1e-6, "{cycle}{found} {corner}");
    }
}

/// Finishing along it in passes that come nearer, and its correction.
#[test]
fn finishing_comes_nearer_and_is_corrected() {
    let passes = turned(&linuxcnc(ALONG, "G71 Q100 D1 I2.\nG0 X62.\nG0 Z2.\nG70 Q100 D0.6 E0.2 P2\n"), "linuxcnc");
    let surface = passes.output.surface.as_ref().unwrap();
    assert!((left(surface, -10.0) - 20.4).abs() < 1e-6 && (left(surface, -50.0) - 40.4).abs() < 1e-6);
    let contour = "G1 X22. Z0.\nG1 Z-100.\nG1 X24. Z-150.\nG1 Z-250.\nG1 X31.\n";
    let cycles = "G71 Q100 D0.3 I1.5\nG0 X32.\nG0 Z2.\nF0.1\nG70 Q100\n";
    let text = linuxcnc(contour, cycles).replace("X62.", "X32.");
    let mut job = bar(&text, "linuxcnc");
    job["tools"][0]["minor_edge_angle_deg"] = json!(50);
    let answer = try_solve(&compensate(&job)).unwrap_or_else(|e| panic!("{e:?}\n{text}"));
    let compensation = compensation(&answer);
    let call = text.lines().position(|line| line.starts_with("G70")).unwrap() + 1;
    assert_eq!(compensation.lines_changed, [call], "{:?}\n{}", compensation.left_alone, compensation.diff);
    let proof = compensation.proof.unwrap();
    assert!(proof.largest_error_before_um > 5.0 && proof.largest_residual_um <= 1.5, "{proof:?}");
    let (off, compared) = off_from_told(&job, compensation);
    assert!(off < 0.15 && compared > 20, "{off} {compared}");
    let is_face = |why: WhyLeftAlone| why == WhyLeftAlone::Face;
    assert!(compensation.left_alone.iter().all(|one| is_face(one.reason)), "{:?}", compensation.left_alone);
}

#[test]
fn what_is_no_such_cycle_is_refused() {
    let good = linuxcnc(ALONG, "G71 Q100 D0 I2.\n");
    for (from, to, code, line, told) in [
        ("G71 Q100", "G71 Q200", "subprogram", 4.0, "O100"),
        ("G71 Q100", "G71", "subprogram", 4.0, "O100"),
        ("G71 Q100", "G71.2 Q100", "cycle_not_read", 14.0, "G71.2"),
        ("G71 Q100", "G91 G71 Q100", "cycle_not_read", 14.0, "Q100"),
        ("G71 Q100", "G42 G71 Q100", "cycle_not_read", 14.0, "G71"),
        ("G71 Q100", "G71 Q100 P2", "word_not_used", 14.0, "P2"),
        ("G1 Z-60.\n", "G1 X38. Z-60.\n", "contour_not_monotone", 9.0, "X38."),
        ("G1 Z-60.\n", "O101 CALL\n", "subprogram", 9.0, "O101"),
        ("G0 X62. Z2.\n", "G0 X62.\n", "position_unknown", 14.0, "G71"),
    ] {
        let text = good.replace(from, to);
        let findings = match read(&job(&text, "linuxcnc", &json!({}))) {
            Err(Failure::NotRead { findings, .. }) => findings,
            other => panic!("{text}{other:?}"),
        };
        let found = &findings[0];
        assert_eq!((found.code, word(found).as_str()), (code, told), "{text}\n{findings:?}");
        assert!((number(found, "line") - line).abs() < 1e-9, "{text}\n{findings:?}");
    }
    // Where no motion is named behind it, nobody says which one acts.
    let text = good.replace("G0 X100. Z50.", "X100. Z50.");
    assert!(matches!(read(&job(&text, "linuxcnc", &json!({}))), Err(Failure::NotRead { .. })));
}
