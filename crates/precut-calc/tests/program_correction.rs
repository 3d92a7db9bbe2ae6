//! Programs that are corrected: what they leave is seen by driving what is given back, as any other program.
#![allow(clippy::unwrap_used, clippy::panic, clippy::print_stdout, clippy::cast_precision_loss, missing_docs)]

use std::fmt::Write as _;
use std::process::{Command, Stdio};

use precut_calc::calculator::Answer;
use precut_calc::program_compensation::{CompensatedProgram, ErrorAlong, Outcome, Transition, WhyLeftAlone};
use serde_json::{Value, json};

use crate::draw::Draw;
use crate::program_reading::number;
use crate::program_yielding::{DIALECTS, cases, job_of, shaft, try_solve};

/// Chord tolerance and increment, on the radius, um.
const RESIDUAL_UM: f64 = 1.5;

pub(crate) fn compensation(answer: &Answer<Outcome>) -> &CompensatedProgram {
    answer.output.compensation.as_ref().unwrap()
}

pub(crate) fn compensate(job: &Value) -> Value {
    let mut job = job.clone();
    job["mode"] = json!({ "kind": "compensate" });
    job
}

/// The job that drives what was given back as a program of its own.
fn again(job: &Value, compensation: &CompensatedProgram) -> Value {
    let mut again = job.clone();
    again["nc_program"] = json!(compensation.nc_program);
    again["mode"] = json!({ "kind": "read" });
    for lines in again.get_mut("support_lines").and_then(Value::as_array_mut).into_iter().flatten() {
        let from = lines["from_line"].as_u64().unwrap();
        let added: usize = compensation
            .changes
            .iter()
            .filter(|change| (change.line as u64) < from)
            .map(|change| change.new.len() - 1)
            .sum();
        lines["from_line"] = json!(from + added as u64);
    }
    again
}

/// The diameter that a contour really has at a place, by what one line makes.
fn real(contour: &ErrorAlong, z: f64) -> Option<f64> {
    let at = |i: usize| contour.wanted_diameter_mm[i] + contour.diameter_error_um[i] / 1000.0;
    let after = contour.z_mm.partition_point(|place| *place < z);
    let before = after.checked_sub(1)?;
    // A round corner is not straight between its places.
    let is_straight = |a: usize, b: usize| (contour.wanted_diameter_mm[a] - contour.wanted_diameter_mm[b]).abs() < 0.05;
    if after == contour.z_mm.len() || contour.line[after] != contour.line[before] || !is_straight(before, after) {
        return None;
    }
    let share = (z - contour.z_mm[before]) / (contour.z_mm[after] - contour.z_mm[before]);
    Some(at(before) + share * (at(after) - at(before)))
}

/// Every line that is not among the changed ones stands in the returned program, byte for byte and in its order.
fn assert_rest_is_kept(given: &str, compensation: &CompensatedProgram) {
    let mut expected = String::new();
    let lines: Vec<&str> = given.split_inclusive('\n').collect();
    for (i, line) in lines.iter().enumerate() {
        match compensation.changes.iter().find(|change| change.line == i + 1) {
            None => expected.push_str(line),
            Some(change) => {
                assert_eq!(change.old, line.trim_end_matches(['\r', '\n']));
                let end = &line[change.old.len()..];
                change.new.iter().for_each(|new| {
                    let _ = write!(expected, "{new}{end}");
                });
            }
        }
    }
    assert_eq!(compensation.nc_program, expected);
}

/// A contour as a CAM system writes it: blocks far shorter than what a line has to make to be said to finish.
#[test]
fn short_blocks_of_a_contour_are_corrected_together() {
    let text = include_str!("../src/program_compensation/examples/slender_shaft.json");
    for step in [0.1, 0.5] {
        let mut job: Value = serde_json::from_str(text).unwrap();
        let mut contour = String::new();
        let count = (198.0 / step) as u32;
        for block in 1..=count {
            let along = f64::from(block) * step;
            let diameter = 22.0 + 0.5 * (std::f64::consts::PI * along / 198.0).sin();
            let _ = write!(contour, "X{diameter:.3} Z{:.3}{}", -2.0 - along, if block < count { "\n" } else { "" });
        }
        let given = job["nc_program"].as_str().unwrap().replace("N180 Z-200.", &contour);
        job["nc_program"] = json!(given);
        let answer = try_solve(&job).unwrap();
        let compensation = compensation(&answer);
        assert_rest_is_kept(&given, compensation);
        let proof = compensation.proof.as_ref().unwrap();
        let said = format!("{step}: {proof:?} {:?}", compensation.left_alone);
        assert!(proof.largest_error_before_um > 25.0 && proof.largest_residual_um <= RESIDUAL_UM, "{said}");
        let of_contour = |line: &usize| (18..18 + count as usize).contains(line);
        let alone = compensation.left_alone.iter().filter(|left| of_contour(&left.line));
        assert!(alone.clone().all(|left| left.reason == WhyLeftAlone::BelowResolution), "{said}");
        let changed = compensation.lines_changed.iter().filter(|line| of_contour(line)).count();
        assert!(changed > count as usize / 2, "{changed} of {count}: {said}");
    }
}

#[test]
fn the_reference_programs_come_out_as_they_are_meant() {
    let mut wrong = String::new();
    for case in cases() {
        let name = case["name"].as_str().unwrap();
        let job = job_of(&case["job"]);
        let answer = match try_solve(&compensate(&job)) {
            Ok(answer) => answer,
            Err(failure) => {
                let _ = writeln!(wrong, "{name}: {failure:?}");
                continue;
            }
        };
        let compensation = compensation(&answer);
        let may: Vec<u64> = case["expected"]["lines_that_may_change"]
            .as_array()
            .unwrap()
            .iter()
            .map(|line| line.as_u64().unwrap())
            .collect();
        let said = format!(
            "{name}: {:?}\n{:?}\n{:?}\n{}",
            compensation.proof, compensation.left_alone, compensation.transitions, compensation.diff
        );
        let is_allowed = compensation.lines_changed.iter().all(|line| may.contains(&(*line as u64)));
        assert!(is_allowed && !compensation.lines_changed.is_empty(), "{said}");
        assert_rest_is_kept(job["nc_program"].as_str().unwrap(), compensation);
        let only_faces = compensation.left_alone.iter().all(|left| left.reason == WhyLeftAlone::Face);
        let proof = compensation.proof.unwrap();
        let longest = compensation.transitions.iter().map(|one| one.length_mm).fold(0.0, f64::max);
        if !only_faces || proof.largest_residual_um > RESIDUAL_UM || proof.largest_error_after_um > 2.0 * RESIDUAL_UM {
            let _ = writeln!(wrong, "{said}");
        }
        // The longest is beside the finished seat, where the shift jumps by 0.1 mm.
        assert!(longest < if name == "step-in-blank" { 4.0 } else { 0.7 }, "{said}");
    }
    assert!(wrong.is_empty(), "{wrong}");
}

/// What LinuxCNC's own interpreter makes of a program, and whether it runs it to its end; nothing where it is not installed, which is
/// told.
pub(crate) fn said_by_linuxcnc(program: &str, name: &str) -> Option<(bool, String)> {
    let folder = std::env::temp_dir().join(format!("precut-{name}-{}", std::process::id()));
    std::fs::create_dir_all(&folder).unwrap();
    let file = folder.join("program.ngc");
    std::fs::write(&file, program).unwrap();
    let run = Command::new("rs274").arg("-g").arg(&file).current_dir(&folder).stdin(Stdio::null()).output();
    let _ = std::fs::remove_dir_all(&folder);
    let Ok(output) = run else {
        println!("rs274 is not here");
        return None;
    };
    let said = String::from_utf8_lossy(&output.stdout).into_owned();
    Some((output.status.success() && said.contains("STRAIGHT_FEED") && said.contains("PROGRAM_END"), said))
}

/// Whether it runs a program to its end.
fn is_run_by_linuxcnc(program: &str) -> bool {
    said_by_linuxcnc(program, "correction").is_none_or(|(is_run, _)| is_run)
}

/// How far the diameter of the returned program, driven as one of its own, is off what was told of it, um, and at how many
/// places that was looked at.
pub(crate) fn off_from_told(job: &Value, compensation: &CompensatedProgram) -> (f64, usize) {
    let returned = try_solve(&again(job, compensation)).unwrap();
    let (told, contour) = (&compensation.contour, &returned.output.yielding.as_ref().unwrap().contour);
    let (mut worst, mut compared) = (0.0_f64, 0);
    for i in 0..told.z_mm.len() {
        let z = told.z_mm[i];
        // Where the work stays thick the error has a point, and round corners are not straight between places.
        let is_thick = |one: &Transition| (one.z_mm - 0.3..one.z_mm + one.length_mm + 0.3).contains(&z);
        let beside = [i.saturating_sub(1), (i + 1).min(told.z_mm.len() - 1)];
        let is_round = beside.iter().any(|&j| (told.wanted_diameter_mm[i] - told.wanted_diameter_mm[j]).abs() > 1e-6);
        if is_round || compensation.transitions.iter().any(is_thick) {
            continue;
        }
        let Some(real) = real(contour, z) else {
            continue;
        };
        let error = 1000.0 * (real - told.wanted_diameter_mm[i]);
        worst = worst.max((error - told.diameter_error_um[i]).abs());
        compared += 1;
    }
    (worst, compared)
}

/// What an answer says of the returned program, comes of it when it is driven as a program of its own.
#[test]
fn programs_of_every_control_are_corrected_and_proved() {
    let (mut changed, mut changed_lines, mut left, mut compared, mut wrong) = (0, 0, 0, 0, String::new());
    let mut worst = 0.0_f64;
    for seed in 0..draws(6) {
        let mut in_all: Option<Vec<usize>> = None;
        for dialect in DIALECTS {
            let mut job = shaft(&mut Draw::new(2000 + seed), dialect);
            job["force"]["specific_normal_force_n_per_mm2"] = json!(2500);
            let answer = match try_solve(&compensate(&job)) {
                Ok(answer) => answer,
                Err(failure) => {
                    let _ = writeln!(wrong, "{dialect} {seed}: {failure:?}\n{}", job["nc_program"].as_str().unwrap());
                    continue;
                }
            };
            let compensation = compensation(&answer);
            assert_rest_is_kept(job["nc_program"].as_str().unwrap(), compensation);
            let lines = in_all.get_or_insert_with(|| compensation.lines_changed.clone());
            assert_eq!(*lines, compensation.lines_changed, "{dialect} {seed}");
            left +=
                compensation.left_alone.iter().filter(|left| left.reason == WhyLeftAlone::NotSupportedByModel).count();
            if dialect == "linuxcnc" {
                assert!(is_run_by_linuxcnc(&compensation.nc_program), "{}", compensation.nc_program);
            }
            let Some(proof) = &compensation.proof else {
                continue;
            };
            changed += 1;
            changed_lines += compensation.lines_changed.len();
            assert!(proof.largest_residual_um <= RESIDUAL_UM, "{proof:?}");
            let (off, at_places) = off_from_told(&job, compensation);
            worst = worst.max(off);
            compared += at_places;
        }
    }
    println!("{changed} programs and {changed_lines} lines changed, {left} lines left; {worst} um");
    assert!(wrong.is_empty(), "{wrong}");
    assert!(worst < 0.15, "{worst}");
    assert!(changed > 20 && compared > 30 * changed, "{changed}, {compared}");
}

pub(crate) fn draws(in_the_suite: u64) -> u64 {
    std::env::var("PRECUT_PROGRAMS")
        .ok()
        .and_then(|text| text.parse().ok())
        .map_or(in_the_suite, |all: u64| all.div_ceil(5))
}

#[test]
fn rigid_work_changes_no_line() {
    let mut job = shaft(&mut Draw::new(950), "fanuc_a");
    job["force"]["specific_normal_force_n_per_mm2"] = json!(1e-3);
    let answer = try_solve(&compensate(&job)).unwrap();
    let compensation = compensation(&answer);
    assert_eq!(
        (compensation.nc_program.as_str(), compensation.diff.as_str()),
        (job["nc_program"].as_str().unwrap(), "")
    );
    assert!(compensation.proof.is_none() && compensation.lines_changed.is_empty());
    assert!(answer.explanation.iter().any(|said| said.code == "nothing_to_correct"));
}

/// A program that goes through stock as it is gets no new one.
#[test]
fn a_program_that_does_harm_is_not_corrected() {
    let mut job = shaft(&mut Draw::new(950), "fanuc_a");
    job["nc_program"] = json!(job["nc_program"].as_str().unwrap().replacen("G1 X", "G0 X", 1));
    let answer = try_solve(&compensate(&job)).unwrap();
    assert!(answer.output.compensation.is_none());
    let codes: Vec<&str> = answer.warnings.iter().map(|warning| warning.code).collect();
    assert!(codes.contains(&"rapid_in_stock") && codes.contains(&"program_unsafe"), "{codes:?}");
}

/// Ends of lines, small letters, comments, block numbers and relative words stay what they are.
#[test]
fn words_keep_their_form() {
    let mut job = job_of(&cases()[0]["job"]);
    for (given, expected) in [
        ("N70 g1 w-2002. f0.5 (cut)\r\n", "N70 g1 x"),
        ("N70 G1Z-2000.F.5;cut\r\n", "N70 G1X"),
        ("N70 G1 X+090.00 Z-2000.0 F0.5\r\n", "N70 G1 X+89."),
    ] {
        let program =
            format!("G21 G18 G40 G99\r\nT0101\r\nG97 S500 M3\r\nG0 X96. Z2.\r\nX90.\r\n{given}G0 X96.\r\nM30\r\n");
        job["nc_program"] = json!(program);
        let answer = try_solve(&compensate(&job)).unwrap();
        let compensation = compensation(&answer);
        assert_rest_is_kept(&program, compensation);
        let [change] = compensation.changes.as_slice() else { panic!("{:?}", compensation.changes) };
        let tail = &given[given.find(['f', 'F']).unwrap()..given.len() - 2];
        assert!(change.new[0].starts_with(expected) && change.new[0].ends_with(tail), "{:?}", change.new);
        assert!(change.new.len() > 5 && compensation.nc_program.matches("\r\n").count() == 7 + change.new.len());
    }
}

/// A bar between chuck and centre, and a program that cuts it.
pub(crate) fn bar(program: &str, dialect: &str) -> Value {
    let mut job = shaft(&mut Draw::new(950), dialect);
    job["nc_program"] = json!(program);
    job["program_zero_z_mm"] = json!(300);
    job["stock"]["profile"] = json!([{ "z_mm": 0, "diameter_mm": 30 }, { "z_mm": 300, "diameter_mm": 30 }]);
    job["supports"][1]["z_mm"] = json!(300);
    job["tools"][0]["nose_radius_mm"] = json!(0.4);
    job["tools"][0]["cutting_edge_angle_deg"] = json!(93);
    job["tools"][0]["minor_edge_angle_deg"] = json!(32);
    job
}

/// A cycle that finishes becomes its moves; the lines of its contour stay.
#[test]
fn cycles_that_finish_are_written_out() {
    let contour = "N10 G0 X22.\nG1 Z-100. F0.1\nX24. Z-150.\nG2 X26. Z-151. R1.\nG1 Z-250.\nN20 X31.\n";
    let head = "G21 G18 G40 G99\nT0101\nG97 S800 M3\nG0 X32. Z2.\n";
    let finishing =
        format!("{head}G71 U1.5 R0.5\nG71 P10 Q20 U0.6 W0.1 F0.25\n{contour}G70 P10 Q20 (finish)\nG0 X100.\nM30\n");
    let single = format!("{head}G90 X27. Z-250. F0.25\nX25.\nX24. F0.1 S900\nG0 X100.\nM30\n");
    for (program, call, first) in [(&finishing, 13, "(G70 P10 Q20 [finish])"), (&single, 7, "(X24. F0.1 S900)")] {
        let job = bar(program, "fanuc_a");
        let answer = try_solve(&compensate(&job)).unwrap();
        let compensation = compensation(&answer);
        assert_rest_is_kept(program, compensation);
        assert_eq!(compensation.lines_changed, [call], "{}", compensation.diff);
        assert_eq!(compensation.changes[0].new[0], first);
        let proof = compensation.proof.unwrap();
        assert!(proof.largest_error_before_um > 8.0 && proof.largest_residual_um < RESIDUAL_UM, "{proof:?}");
        let (off, compared) = off_from_told(&job, compensation);
        assert!(off < 0.1 && compared > 40, "{off} {compared}");
        // What the line said beside its way is said once, by the first block that needs it.
        let told = |word: &str| compensation.changes[0].new[1..].iter().filter(|line| line.contains(word)).count();
        assert_eq!((told("F"), told("S900")), (1, usize::from(call == 7)), "{}", compensation.diff);
    }
}

/// Cycles that cannot be written out stay as they are, and the answer says so.
#[test]
fn cycles_with_something_else_in_them_are_left_alone() {
    let head = "G21 G18 G40 G99\nT0101\nG97 S800 M3\nG0 X32. Z2.\n";
    for tail in [
        // The next line goes on with the cycle, one has a function of the machine in it, one may be skipped.
        "G90 X27. Z-250. F0.25\nX24.\nX35.\nG0 X100.\nM30\n",
        "G90 X27. Z-250. F0.25\nX24. M8\nG0 X100.\nM30\n",
        "G90 X27. Z-250. F0.25\n/X24.\nG0 X100.\nM30\n",
    ] {
        let job = bar(&format!("{head}{tail}"), "fanuc_a");
        let answer = try_solve(&compensate(&job)).unwrap();
        let compensation = compensation(&answer);
        assert!(compensation.lines_changed.is_empty(), "{}", compensation.diff);
        assert!(compensation.left_alone.iter().any(|left| left.line == 6 && left.reason == WhyLeftAlone::Cycle));
    }
}

/// Arcs that a centre tells keep their form, and the work its shape.
#[test]
fn arcs_by_centres_are_corrected() {
    for (dialect, head, arc) in [
        ("fanuc_a", "G21 G18 G40 G99\nT0101\n", "G3 X28. Z-157.991 I-38. K-60. F0.1"),
        ("siemens", "G710 G18 G40 G90 G95 DIAMON\nT1 D1\n", "G3 X28. Z-157.991 I=AC(-27) K=AC(-100) F0.1"),
        ("linuxcnc", "G21 G18 G40 G90 G95 G7\nT1 M6\n", "G3 X28. Z-157.991 I-38. K-60. F0.1"),
    ] {
        let program = format!("{head}G97 S800 M3\nG0 X32. Z2.\nX22.\nG1 Z-40. F0.1\n{arc}\nG1 X31.\nG0 X100.\nM30\n");
        let mut job = bar(&program, dialect);
        job["stock"]["profile"] = json!([{ "z_mm": 0, "diameter_mm": 30 }, { "z_mm": 300, "diameter_mm": 30 }]);
        let answer = try_solve(&compensate(&job)).unwrap_or_else(|e| panic!("{dialect} {e:?}"));
        let compensation = compensation(&answer);
        assert_rest_is_kept(&program, compensation);
        let change = compensation.changes.iter().find(|change| change.line == 7).unwrap();
        assert!(change.new.len() > 1, "{}", compensation.diff);
        let form = if dialect == "siemens" { "I=AC(" } else { "I-" };
        assert!(change.new.iter().all(|line| line.contains(form)), "{}", compensation.diff);
        let proof = compensation.proof.unwrap();
        assert!(proof.largest_residual_um < RESIDUAL_UM, "{proof:?}");
        if dialect == "linuxcnc" {
            assert!(is_run_by_linuxcnc(&compensation.nc_program), "{}", compensation.nc_program);
        }
    }
}

/// What acts at the end of a block stands at the end of its last piece.
#[test]
fn what_acts_at_the_end_goes_to_the_last_piece() {
    let program = "G21 G18 G40 G99\nT0101\nG97 S800 M3\nG0 X32. Z2.\nX26.\nG1 Z-250. F0.1 M9 (end)\nG0 X100.\nM30\n";
    let job = bar(program, "fanuc_a");
    let answer = try_solve(&compensate(&job)).unwrap();
    let compensation = compensation(&answer);
    let new = &compensation.changes.iter().find(|change| change.line == 6).unwrap().new;
    assert!(new.len() > 2 && new[0].ends_with(" F0.1 (end)") && new.last().unwrap().ends_with(" M9"), "{new:?}");
    assert_eq!(new.iter().filter(|line| line.contains("M9")).count(), 1);
}

pub(crate) fn codes(answer: &Answer<Outcome>) -> Vec<&'static str> {
    answer.warnings.iter().map(|warning| warning.code).collect()
}

/// The least time of a block makes blocks longer, and cuts on small diameters stay as they are.
#[test]
fn limits_of_blocks_and_diameters_act() {
    let mut job =
        bar("G21 G18 G40 G99\nT0101\nG97 S800 M3\nG0 X32. Z2.\nX26.\nG1 Z-250. F0.1\nG0 X100.\nM30\n", "fanuc_a");
    job["force"]["specific_normal_force_n_per_mm2"] = json!(3000);
    let of = |job: &Value| compensation(&try_solve(job).unwrap()).changes.clone();
    let mut job = compensate(&job);
    job["mode"]["chord_tolerance_um"] = json!(0.2);
    let free = of(&job);
    // 80 mm/min make 20 mm in 15 s, which no control needs; it shows that the time acts.
    job["mode"]["min_block_time_ms"] = json!(1000.0);
    job["mode"]["min_block_length_mm"] = json!(10.0);
    let longer = of(&job);
    assert!(free.iter().map(|one| one.new.len()).sum::<usize>() > longer.iter().map(|one| one.new.len()).sum());
    job["mode"]["minimum_diameter_mm"] = json!(26.5);
    let answer = try_solve(&job).unwrap();
    let compensation = compensation(&answer);
    assert!(compensation.lines_changed.is_empty());
    assert!(compensation.left_alone.iter().any(|left| left.line == 6 && left.reason == WhyLeftAlone::NearAxis));
}

/// A nose without compensation leaves a taper thick by what is told.
#[test]
fn the_nose_on_a_taper_is_told() {
    let program =
        "G21 G18 G40 G99\nT0101\nG97 S800 M3\nG0 X32. Z2.\nX20.\nG1 Z-50. F0.1\nX28. Z-150.\nX31.\nG0 X100.\nM30\n";
    let answer = try_solve(&bar(program, "fanuc_a")).unwrap();
    let told = answer.warnings.iter().find(|warning| warning.code == "nose_error_on_taper").unwrap().value.unwrap();
    // Half way along the taper the program means 24 mm; the normal stands across the slope.
    let contour = &answer.output.yielding.as_ref().unwrap().contour;
    let nearest = (0..contour.z_mm.len())
        .min_by(|&a, &b| (contour.z_mm[a] - 200.0).abs().total_cmp(&(contour.z_mm[b] - 200.0).abs()));
    let at = nearest.unwrap();
    let meant = 20.0 + 8.0 * (250.0 - contour.z_mm[at]) / 100.0;
    let normal = 500.0 * (contour.wanted_diameter_mm[at] - meant) * (0.04_f64).atan().cos();
    assert!((normal - told).abs() < 0.05, "{normal}, {told}");
}

/// What the program means against what the drawing asks for is told, and left as it is.
#[test]
fn a_program_off_its_drawing_is_told() {
    let program = "G21 G18 G40 G99\nT0101\nG97 S800 M3\nG0 X32. Z2.\nX26.\nG1 Z-250. F0.1\nG0 X100.\nM30\n";
    let mut job = bar(program, "fanuc_a");
    let plain = try_solve(&compensate(&job)).unwrap();
    job["drawing"] = json!([
        { "z_mm": 100, "diameter_mm": 25.98 }, { "z_mm": 200, "diameter_mm": 25.98 },
        { "z_mm": 200, "diameter_mm": 26.01 }, { "z_mm": 280, "diameter_mm": 26.01 },
    ]);
    let answer = try_solve(&compensate(&job)).unwrap();
    let drawing = answer.output.drawing.as_ref().unwrap();
    assert!(drawing.z_mm.iter().all(|z| (100.0..=280.0).contains(z)) && drawing.z_mm.len() > 20);
    for (z, error) in drawing.z_mm.iter().zip(&drawing.program_error_um) {
        assert!((error - if *z < 200.0 { 20.0 } else { -10.0 }).abs() < 1e-6, "{z} {error}");
    }
    assert_eq!(plain.output.compensation, answer.output.compensation);
    assert!(answer.explanation.iter().any(|said| said.code == "program_off_drawing"));
}

/// Ways through the air and cuts that find nothing are told with their lines.
#[test]
fn what_cuts_nothing_is_told() {
    let program =
        "G21 G18 G40 G99\nT0101\nG97 S800 M3\nG0 X32. Z42.\nX26.\nG1 Z-250. F0.1\nG1 X40.\nZ10.\nG0 X100.\nM30\n";
    let answer = try_solve(&bar(program, "fanuc_a")).unwrap();
    let told = answer.warnings.iter().find(|warning| warning.code == "plunge_at_feed_in_air").unwrap();
    // The way back at 40 mm: 260 mm at 80 mm/min.
    assert!((told.value.unwrap() - 260.0).abs() < 1e-9, "{told:?}");
    assert!((number(told, "time_s") - 195.0).abs() < 1e-6, "{told:?}");
    assert!(!codes(&answer).contains(&"no_cut"));
}

/// The work gives way and comes out thicker than it is meant: a rapid move that is clear of what is meant may come close to it.
#[test]
fn a_rapid_move_close_to_what_comes_out_is_told() {
    for (back, is_close) in [("26.2", true), ("26.4", false)] {
        let program =
            format!("G21 G18 G40 G99\nT0101\nG97 S800 M3\nG0 X26. Z2.\nG1 Z-250. F0.2\nG0 X{back}\nZ2.\nX100.\nM30\n");
        let answer = try_solve(&bar(&program, "fanuc_a")).unwrap();
        let told = answer.warnings.iter().find(|warning| warning.code == "rapid_close");
        assert_eq!(told.is_some(), is_close, "{back}: {:?}", answer.warnings);
        if let Some(told) = told {
            assert!((number(told, "line") - 7.0).abs() < 1e-9, "{told:?}");
            // 0.1 mm off what is meant; what came out thick brings it nearer, by no more than the largest error.
            let thick_mm = answer.output.yielding.as_ref().unwrap().largest_error_um.unwrap() / 1000.0;
            let nearer_mm = 0.1 - told.value.unwrap();
            assert!(nearer_mm > 1e-3 && nearer_mm < thick_mm + 1e-4 && told.limit == Some(0.1), "{told:?}, {thick_mm}");
        }
    }
}

#[test]
fn a_cut_beyond_what_the_force_law_knows_is_told() {
    let program = |feed: &str| {
        format!("G21 G18 G40 G99\nT0101\nG97 S800 M3\nG0 X29. Z2.\nG1 Z-50. F{feed}\nX40.\nG0 X100.\nM30\n")
    };
    let kienzle = |feed: &str| {
        let mut job = bar(&program(feed), "fanuc_a");
        job["force"] = json!({
            "kind": "kienzle", "cutting_edge_angle_deg": 93, "nose_radius_mm": 0.4,
            "specific_cutting_force_n_per_mm2": 1500.0, "cutting_exponent": 0.25,
            "specific_normal_force_n_per_mm2": 700.0, "normal_exponent": 0.35,
        });
        try_solve(&job).unwrap()
    };
    assert!(!codes(&kienzle("0.2")).contains(&"extrapolated_force_model"));
    let answer = kienzle("2.6");
    let told = answer.warnings.iter().find(|warning| warning.code == "extrapolated_force_model").unwrap();
    assert_eq!((told.value, told.limit, told.unit), (Some(2.6), Some(2.5), Some("mm/rev")));
}
