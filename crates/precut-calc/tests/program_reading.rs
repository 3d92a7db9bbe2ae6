//! The reader of programs: the reference files, the same part written for every control, and bytes of any kind.
#![allow(clippy::unwrap_used, clippy::panic, clippy::cast_precision_loss, missing_docs)]

use std::fmt::Write as _;

use precut_calc::calculator::{Answer, Calculator, Check, Failure, Finding, Unwatched, Value as Said, Violations};
use precut_calc::program_compensation::{Outcome, ProgramCompensation};
use serde_json::{Value, json};

use crate::draw::Draw;

pub(crate) fn cases(name: &str) -> Vec<Value> {
    let package = std::path::Path::new(env!("CARGO_MANIFEST_DIR"));
    let path = package.join("reference/program-compensation").join(name);
    let text = std::fs::read_to_string(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()));
    let file: Value = serde_json::from_str(&text).unwrap();
    file["cases"].as_array().unwrap().clone()
}

pub(crate) fn job(program: &str, dialect: &str, reading: &Value) -> Value {
    json!({ "nc_program": program, "dialect": dialect, "reading": reading, "mode": { "kind": "read" } })
}

pub(crate) fn read(job: &Value) -> Result<Answer<Outcome>, Failure> {
    let mut parsed: <ProgramCompensation as Calculator>::Input = serde_json::from_value(job.clone()).unwrap();
    let mut violations = Violations::default();
    parsed.check(&mut violations);
    assert!(violations.is_empty());
    ProgramCompensation::fill(&mut parsed);
    ProgramCompensation::run(&parsed, &Unwatched)
}

fn faults(outcome: Result<Answer<Outcome>, Failure>) -> Vec<Finding> {
    match outcome {
        Err(Failure::NotRead { findings, .. }) => findings,
        other => panic!("{other:?}"),
    }
}

/// A case as a job.
fn job_of(case: &Value) -> Value {
    let reading = if case["reading"].is_object() { case["reading"].clone() } else { json!({}) };
    job(case["program"].as_str().unwrap(), case["dialect"].as_str().unwrap(), &reading)
}

pub(crate) fn number(finding: &Finding, name: &str) -> f64 {
    match finding.values.get(name) {
        Some(Said::Number(number)) => *number,
        other => panic!("{name}: {other:?}"),
    }
}

pub(crate) fn word(finding: &Finding) -> String {
    match finding.values.get("word") {
        Some(Said::Text(text)) => text.to_string(),
        other => panic!("{other:?}"),
    }
}

/// Line, kind and numbers of a move, by names of the reference.
pub(crate) type Row = serde_json::Map<String, Value>;

/// The moves of an answer, one by one.
pub(crate) fn rows(outcome: &Outcome) -> Vec<Row> {
    let columns = serde_json::to_value(&outcome.moves).unwrap();
    let columns = columns.as_object().unwrap();
    let row = |i: usize| -> Row {
        let cell = |(name, column): (&String, &Value)| {
            let cell = match name.as_str() {
                "tool" => column[i].as_u64().map_or(Value::Null, |tool| outcome.tools[tool as usize].clone().into()),
                _ => column[i].clone(),
            };
            (name.clone(), cell)
        };
        columns.iter().map(cell).collect()
    };
    (0..outcome.moves.line.len()).map(row).filter(|row| row["kind"] != "dwell").collect()
}

fn same(found: &Value, expected: &Value, within: f64) -> bool {
    match (found.as_f64(), expected.as_f64()) {
        (Some(found), Some(expected)) => (found - expected).abs() <= within,
        _ => found == expected,
    }
}

fn compare(found: &Row, expected: &Value, at: &str) {
    let names = [
        ("x_diameter_mm", 1e-9),
        ("z_mm", 1e-9),
        ("centre_x_diameter_mm", 1e-6),
        ("centre_z_mm", 1e-6),
        ("feed_mm_per_rev", 1e-9),
        ("spindle_speed_rpm", 1e-9),
        ("speed_m_per_min", 1e-9),
        ("spindle_limit_rpm", 1e-9),
    ];
    assert_eq!((&found["line"], &found["kind"]), (&expected["line"], &expected["kind"]), "{at}: {found:?}");
    for (name, within) in names {
        assert!(same(&found[name], &expected[name], within), "{at}: {name} of {found:?} and {expected}");
    }
    assert!(same(&found["feed_mm_per_min"], &expected["feed_mm_per_min"], 1e-9), "{at}: {found:?}");
    if ["line", "arc_cw", "arc_ccw"].iter().any(|kind| found["kind"] == *kind) {
        let nose =
            if expected["nose_compensation"].is_null() { json!("off") } else { expected["nose_compensation"].clone() };
        assert_eq!((&found["tool"], &found["nose_compensation"]), (&expected["tool"], &nose), "{at}: {found:?}");
    }
}

fn place(row: &Value) -> (f64, f64) {
    (row["x_diameter_mm"].as_f64().unwrap(), row["z_mm"].as_f64().unwrap())
}

/// Diameters and ends of the passes of a roughing cycle, and the points of its last one.
fn passes(moves: &[Value]) -> (Vec<(f64, f64)>, Vec<Value>) {
    let along = |i: usize| moves[i]["kind"] == "rapid" && moves[i + 1]["kind"] == "line";
    let begins: Vec<usize> = (0..moves.len() - 1).filter(|&i| along(i)).collect();
    let (&last, ends) = begins.split_last().unwrap();
    (ends.iter().map(|&i| place(&moves[i + 1])).collect(), moves[last + 1..moves.len() - 2].to_vec())
}

/// Roughing of the reference goes along chords of arcs: they stay within this of them, mm.
const CHORD_MM: f64 = 2e-4;

fn compare_roughing(found: &[Value], expected: &[Value], name: &str) {
    let ((ends, last), (expected_ends, expected_last)) = (passes(found), passes(expected));
    assert_eq!(ends.len(), expected_ends.len(), "{name}");
    let arc_z: Vec<[f64; 2]> = last
        .windows(2)
        .filter(|pair| pair[1]["kind"] != "line")
        .map(|pair| [place(&pair[1]).1, place(&pair[0]).1])
        .collect();
    let on_arc = |z: f64| arc_z.iter().any(|[low, high]| (low - 1e-9..=high + 1e-9).contains(&z));
    for (found, expected) in ends.iter().zip(&expected_ends) {
        let within = if on_arc(expected.1) { CHORD_MM } else { 1e-9 };
        assert!(
            (found.0 - expected.0).abs() < 1e-9 && (found.1 - expected.1).abs() < within,
            "{name}: {found:?} {expected:?}"
        );
    }
    let off = |(x, z): (f64, f64)| {
        let to_part = |pair: &[Value]| {
            let (from, to) = (place(&pair[0]), place(&pair[1]));
            if pair[1]["kind"] == "line" {
                let (dx, dz) = ((to.0 - from.0) / 2.0, to.1 - from.1);
                let share = (((x - from.0) / 2.0 * dx + (z - from.1) * dz) / (dx * dx + dz * dz)).clamp(0.0, 1.0);
                ((x - from.0) / 2.0 - share * dx).hypot(z - from.1 - share * dz)
            } else {
                let centre =
                    [pair[1]["centre_x_diameter_mm"].as_f64().unwrap(), pair[1]["centre_z_mm"].as_f64().unwrap()];
                let from_centre = |(x, z): (f64, f64)| ((x - centre[0]) / 2.0).hypot(z - centre[1]);
                (from_centre((x, z)) - from_centre(from)).abs()
            }
        };
        last.windows(2).map(to_part).fold(f64::INFINITY, f64::min)
    };
    for (own, expected) in [(last.first(), expected_last.first()), (last.last(), expected_last.last())] {
        let (own, expected) = (place(own.unwrap()), place(expected.unwrap()));
        assert!((own.0 - expected.0).abs() < 1e-9 && (own.1 - expected.1).abs() < 1e-9, "{name}");
    }
    for point in &expected_last {
        assert!(off(place(point)) < 1e-8, "{name}: the last pass leaves {point}");
    }
}

#[test]
fn every_reference_is_read_as_it_is_meant() {
    let mut compared = 0;
    for case in cases("reading.json") {
        let name = case["name"].as_str().unwrap();
        let Some(expected) = case["expected"]["moves"].as_array() else { continue };
        let answer = read(&job_of(&case)).unwrap_or_else(|e| panic!("{name}: {e:?}"));
        let found = rows(&answer.output);
        let mut at = 0;
        let mut i = 0;
        let mut cycles = answer.output.cycles.iter();
        while i < expected.len() {
            let one = &expected[i];
            i += 1;
            if one["kind"] == "cycle_head" {
                continue;
            }
            if one["kind"] != "cycle" {
                compare(&found[at], one, &format!("{name}, move {at}"));
                at += 1;
                compared += 1;
                continue;
            }
            let cycle = serde_json::to_value(cycles.next().unwrap()).unwrap();
            for field in ["line", "from_line", "to_line"] {
                assert_eq!(cycle[field], one[field], "{name}");
            }
            let kind = one["cycle"].as_str().unwrap().replace("finish", "finishing");
            assert_eq!(cycle["kind"], kind, "{name}");
            if one["cycle"] == "rough_z" {
                for field in ["allowance_x_diameter_mm", "allowance_z_mm"] {
                    assert!(same(&cycle[field], &one[field], 1e-9), "{name}");
                }
                let of_cycle = |row: &&Value| row["line"] == one["line"];
                let roughing: Vec<Value> = expected[i..].iter().take_while(of_cycle).cloned().collect();
                let ours = found[at..].iter().take_while(|row| row["line"] == one["line"]);
                let ours: Vec<Value> = ours.map(|row| Value::Object(row.clone())).collect();
                compare_roughing(&ours, &roughing, name);
                compared += roughing.len();
                (i, at) = (i + roughing.len(), at + ours.len());
            }
        }
        assert_eq!(at, found.len(), "{name}: more moves than expected");
        let warned: Vec<Value> = answer
            .warnings
            .iter()
            .map(|warning| json!({ "code": warning.code, "line": number(warning, "line") as usize, "word": word(warning) }))
            .collect();
        assert_eq!(json!(warned), case["expected"]["warnings"], "{name}");
    }
    assert!(compared > 300, "{compared}");
}

#[test]
fn every_reference_that_is_no_program_is_refused_at_its_place() {
    let mut refused = cases("refused.json");
    refused.extend(cases("reading.json").into_iter().filter(|case| case["expected"]["refused"].is_object()));
    assert!(refused.len() > 25);
    for case in refused {
        let name = case["name"].as_str().unwrap();
        let found = faults(read(&job_of(&case)));
        let (first, expected) = (&found[0], &case["expected"]["refused"]);
        let place = json!({ "code": first.code, "line": number(first, "line"), "column": number(first, "column") });
        let wanted = json!({ "code": expected["code"], "line": expected["line"].as_f64(), "column": expected["column"].as_f64() });
        assert_eq!(place, wanted, "{name}: {found:?}");
        // The reference shows what stands around the word in one case.
        let expected = expected["word"].as_str().unwrap();
        assert!(expected.starts_with(&word(first)) && !word(first).is_empty(), "{name}: {}, {expected}", word(first));
    }
}

#[test]
fn every_fault_is_told_at_once() {
    let program = "G21 G18 G99\nG0 X40. Z2. Y5.\n#1=2.\nG1 Z-5. F0.2 ,R2.\nG112\nM98 P1\nG999\nX\nM30\n";
    let found = faults(read(&job(program, "fanuc_a", &json!({}))));
    let told: Vec<(&str, f64)> = found.iter().map(|fault| (fault.code, number(fault, "line"))).collect();
    assert_eq!(
        told,
        [
            ("axis_not_turned", 2.0),
            ("variable_in_program", 3.0),
            ("drawing_dimension", 4.0),
            ("polar_or_cylinder", 5.0),
            ("subprogram", 6.0),
            ("unknown_g", 7.0),
            ("word_without_number", 8.0)
        ]
    );
    let many = format!("G21 G18 G99\n{}", "#1=2.\n".repeat(250));
    let Err(Failure::NotRead { findings, total }) = read(&job(&many, "fanuc_a", &json!({}))) else { panic!() };
    assert_eq!((findings.len(), total), (100, 250));
}

#[test]
fn a_program_for_another_control_is_told_as_such() {
    for (dialect, program, other) in [
        ("fanuc_a", "G18 G90 G95 DIAMON\nG0 X40 Z2\nM30\n", "siemens"),
        ("fanuc", "G21 G18 G90 G7\nT1 M6\nG0 X4 Z2\n", "linuxcnc"),
        ("fanuc", "G50 S2000\nG0 X40. Z2.\nU2.\nM30\n", "fanuc_a"),
    ] {
        let found = faults(read(&job(program, dialect, &json!({ "decimal_point": "as_units" }))));
        let told = found.iter().find(|fault| fault.code == "dialect_looks_like").unwrap_or_else(|| panic!("{found:?}"));
        assert_eq!(told.values.get("looks_like"), Some(&Said::from(other.to_owned())));
    }
}

/// A part in moves: what every control can write.
pub(crate) enum Step {
    Rapid(f64, f64),
    Line(f64, f64),
    /// End and radius; clockwise or not.
    Arc(f64, f64, f64, bool),
    Feed(f64),
    Surface(f64, f64),
    Spindle(f64),
    Tool(u32),
}

pub(crate) fn part(draw: &mut Draw) -> Vec<Step> {
    let round = |value: f64| (value * 1000.0).round() / 1000.0;
    let mut steps = vec![Step::Tool(1 + (draw.share() * 8.0) as u32)];
    steps.push(if draw.share() < 0.5 { Step::Spindle(500.0) } else { Step::Surface(180.0, 2500.0) });
    let mut x = round(draw.between(10.0, 40.0));
    let mut z = 2.0;
    steps.extend([Step::Rapid(x, z), Step::Feed(round(draw.between(0.05, 0.4)))]);
    for _ in 0..2 + (draw.share() * 6.0) as usize {
        let (dx, dz) = (round(draw.between(0.5, 8.0)), round(draw.between(1.0, 40.0)));
        match (draw.share() * 5.0) as u32 {
            0 => steps.push(Step::Line(x, z - dz)),
            1 => steps.push(Step::Line(x + dx, z)),
            2 => steps.push(Step::Line(x + dx, z - dz)),
            3 => {
                let chord = (dx / 2.0).hypot(dz);
                steps.push(Step::Arc(
                    x + dx,
                    z - dz,
                    round(draw.between(0.6 * chord, 3.0 * chord)),
                    draw.share() < 0.5,
                ));
            }
            _ => steps.push(Step::Rapid(x + 1.0, z + 3.0)),
        }
        if let Some(Step::Rapid(to_x, to_z) | Step::Line(to_x, to_z) | Step::Arc(to_x, to_z, ..)) = steps.last() {
            (x, z) = (round(*to_x), round(*to_z));
        }
    }
    steps.push(Step::Rapid(100.0, 50.0));
    steps
}

pub(crate) const DIALECTS: [&str; 5] = ["fanuc_a", "fanuc", "fanuc_c", "siemens", "linuxcnc"];

/// The part as this control has it: absolute or relative, as the draw has it.
pub(crate) fn written(steps: &[Step], dialect: &str, draw: &mut Draw) -> String {
    let mut text = match dialect {
        "fanuc_a" => "%\nO0001\nG21 G18 G40 G99\n",
        "fanuc" => "%\nO0001\nG21 G18 G40 G90 G95\n",
        "fanuc_c" => "%\nO0001\nG71 G18 G40 G90 G95\n",
        "siemens" => "%_N_PART_MPF\nG710 G18 G40 G90 G95 DIAMON\n",
        _ => "G21 G18 G40 G90 G95 G7\n",
    }
    .to_owned();
    let mut at: Option<(f64, f64)> = None;
    let mut place = |x: f64, z: f64, draw: &mut Draw| {
        let from = at.replace((x, z)).filter(|_| draw.share() < 0.3);
        match (from, dialect) {
            (Some((x0, z0)), "fanuc_a") => format!("U{:.3} W{:.3}", x - x0, z - z0),
            (Some((x0, z0)), "siemens") => format!("X=IC({:.3}) Z=IC({:.3})", x - x0, z - z0),
            _ => format!("X{x:.3} Z{z:.3}"),
        }
    };
    for step in steps {
        let line = match *step {
            Step::Rapid(x, z) => format!("G0 {}", place(x, z, draw)),
            Step::Line(x, z) => format!("G1 {}", place(x, z, draw)),
            Step::Arc(x, z, radius, clockwise) => {
                let name = if dialect == "siemens" { "CR=" } else { "R" };
                format!("G{} {} {name}{radius:.3}", if clockwise { 2 } else { 3 }, place(x, z, draw))
            }
            Step::Feed(feed) => format!("F{feed:.3}"),
            Step::Surface(speed, limit) => match dialect {
                "fanuc_a" => format!("G50 S{limit}\nG96 S{speed} M3"),
                "siemens" => format!("G96 S{speed} LIMS={limit} M3"),
                "linuxcnc" => format!("G96 D{limit} S{speed} M3"),
                _ => format!("G92 S{limit}\nG96 S{speed} M3"),
            },
            Step::Spindle(speed) => format!("G97 S{speed} M3"),
            Step::Tool(tool) => match dialect {
                "siemens" => format!("T{tool} D1"),
                "linuxcnc" => format!("T{tool} M6"),
                _ => format!("T{tool:02}{tool:02}"),
            },
        };
        let _ = writeln!(text, "{line}");
    }
    text + "M30\n" + if dialect.starts_with("fanuc") { "%\n" } else { "" }
}

/// The moves without their lines, to the digits that relative words keep.
pub(crate) fn without_lines(outcome: &Outcome) -> Vec<Row> {
    let rounded = |row: Row| -> Row {
        let cell = |(name, cell): (String, Value)| {
            let cell = cell.as_f64().map_or(cell.clone(), |number| json!(format!("{:.6}", number + 0.0)));
            (name, cell)
        };
        row.into_iter().filter(|(name, _)| name != "line").map(cell).collect()
    };
    rows(outcome).into_iter().map(rounded).collect()
}

pub(crate) fn draws(in_the_suite: u64) -> u64 {
    std::env::var("PRECUT_READINGS").ok().and_then(|text| text.parse().ok()).unwrap_or(in_the_suite)
}

#[test]
fn the_same_part_is_the_same_moves_to_every_control() {
    for seed in 0..draws(60) {
        let mut draw = Draw::new(seed);
        let steps = part(&mut draw);
        let mut first: Option<Vec<Row>> = None;
        for dialect in DIALECTS {
            let text = written(&steps, dialect, &mut draw);
            let answer = read(&job(&text, dialect, &json!({}))).unwrap_or_else(|e| panic!("{e:?}\n{text}"));
            assert!(answer.warnings.is_empty(), "{:?}\n{text}", answer.warnings);
            let moves = without_lines(&answer.output);
            let expected = first.get_or_insert_with(|| moves.clone());
            assert_eq!(&moves, expected, "{seed}, {dialect}:\n{text}");
        }
    }
}

/// A comment, a blank line, numbers of blocks, other line ends, lines that are skipped.
#[test]
fn what_says_nothing_changes_nothing() {
    for seed in 0..draws(20) {
        let mut draw = Draw::new(1000 + seed);
        let steps = part(&mut draw);
        for dialect in DIALECTS {
            let text = written(&steps, dialect, &mut draw);
            let plain = without_lines(&read(&job(&text, dialect, &json!({}))).unwrap().output);
            let mut dressed = String::new();
            for (i, line) in text.lines().enumerate() {
                let is_block = !line.starts_with('%') && !line.starts_with('O');
                let number = if is_block && draw.share() < 0.5 { format!("N{i} ") } else { String::new() };
                let comment = match (dialect, (draw.share() * 4.0) as u32) {
                    (_, 0) => " ; said".to_owned(),
                    ("siemens", 1) => " MSG(\"said (so)\")".to_owned(),
                    (_, 1) if is_block => " (said, X5)".to_owned(),
                    (_, 2) if is_block => "\r\n\r\n/1 G0 X1. Z1.".to_owned(),
                    _ => String::new(),
                };
                let spaced = if is_block && draw.share() < 0.5 {
                    line.replace(' ', "  ").to_lowercase()
                } else {
                    line.to_owned()
                };
                let comment = if is_block { comment } else { String::new() };
                let _ = write!(dressed, "{number}{spaced}{comment}{}", if draw.share() < 0.5 { "\r\n" } else { "\n" });
            }
            let answer = read(&job(&dressed, dialect, &json!({ "block_delete": true })));
            let answer = answer.unwrap_or_else(|e| panic!("{e:?}\n{dressed}"));
            assert_eq!(without_lines(&answer.output), plain, "{dialect}:\n{dressed}");
        }
    }
}

#[test]
fn what_is_too_large_is_refused_before_it_is_kept() {
    let refused = |text: &str| faults(read(&job(text, "fanuc_a", &json!({}))))[0].code;
    assert_eq!(refused(&"\n".repeat(200_001)), "too_many_lines");
    assert_eq!(refused(&format!("G0 X1. {}", "(".repeat(4100))), "line_too_long");
    assert_eq!(refused("G0 X1.\0"), "nul_byte");
    // Contours of contours: every call runs a thousand lines.
    let contour = "G1 Z-1. F0.1\n".repeat(1000);
    let calls = "G70 P1 Q2\n".repeat(2000);
    let text = format!("G21 G18 G99\nT0101\nG97 S500\nG0 X50. Z2.\nN1 G0 X40.\n{contour}N2 X50.\n{calls}M30\n");
    assert_eq!(refused(&text), "too_many_moves");
    let thin = "G21 G18 G99\nT0101\nG97 S500\nG0 X50. Z2.\nG71 U0.0001 R0.5\nG71 P1 Q2 F0.2\nN1 G0 X10.\nG1 Z-20.\nN2 X50.\nM30\n";
    assert_eq!(refused(thin), "too_many_moves");
}

/// Whose pass along a contour leaves just what the allowances say.
#[test]
fn passes_along_a_contour_come_nearer_to_it() {
    let text = "G21 G18 G40 G99\nT0101\nG97 S500 M3\nG0 X60. Z5.\nG73 U4. W2. R3\nG73 P1 Q2 U0.4 W0.1 F0.2\nN1 G0 X20. Z2.\n\
                G1 Z-20.\nX30.\nN2 Z-40.\nG70 P1 Q2\nM30\n";
    let answer = read(&job(text, "fanuc_a", &json!({ "decimal_point": "as_units" }))).unwrap();
    let found = rows(&answer.output);
    let first_cut: Vec<(f64, f64)> = found
        .windows(2)
        .filter(|pair| pair[1]["line"] == 6 && pair[0]["kind"] == "rapid" && pair[1]["kind"] == "line")
        .map(|pair| place(&Value::Object(pair[1].clone())))
        .collect();
    assert_eq!(first_cut.len(), 3);
    for ((x, z), (to_x, to_z)) in first_cut.iter().zip([(28.4, 4.1), (24.4, 3.1), (20.4, 2.1)]) {
        assert!((x - to_x).abs() < 1e-9 && (z - to_z).abs() < 1e-9, "{first_cut:?}");
    }
}

/// Finishing goes along the contour that was roughed, however often its numbers come.
#[test]
fn numbers_that_come_twice_name_the_contour_that_was_roughed() {
    let half = |x: f64, z: f64| {
        format!("G0 X62. Z2.\nG71 U2. R1.\nG71 P1 Q2 U0.4 W0.1 F0.2\nN1 G0 X{x}.\nG1 Z{z}. F0.1\nN2 X62.\nG70 P1 Q2\n")
    };
    let text = format!("G21 G18 G40 G99\nT0101\nG97 S500 M3\n{}{}M30\n", half(40.0, -20.0), half(30.0, -10.0));
    let answer = read(&job(&text, "fanuc_a", &json!({}))).unwrap();
    let contours: Vec<(usize, usize)> =
        answer.output.cycles.iter().map(|cycle| (cycle.from_line, cycle.to_line)).collect();
    assert_eq!(contours, [(7, 9), (7, 9), (14, 16), (14, 16)]);
}
