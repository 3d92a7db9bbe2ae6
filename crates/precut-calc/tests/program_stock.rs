//! What a program leaves of its blank: the reference programs, the envelope on a grid of its own, and advice that is done.
#![allow(clippy::unwrap_used, clippy::panic, clippy::cast_precision_loss, missing_docs)]

use std::fmt::Write as _;

use precut_calc::calculator::{Answer, Calculator, Check, Failure, Finding, Unwatched, Value as Said, Violations};
use precut_calc::program_compensation::{LeftSurface, Outcome, ProgramCompensation};
use serde_json::{Value, json};

use crate::draw::Draw;

fn faults(job: &Value) -> Vec<(&'static str, String)> {
    let parsed: <ProgramCompensation as Calculator>::Input = serde_json::from_value(job.clone()).unwrap();
    let mut violations = Violations::default();
    parsed.check(&mut violations);
    violations.into_vec().into_iter().map(|fault| (fault.code, fault.pointer)).collect()
}

fn try_solve(job: &Value) -> Result<Answer<Outcome>, Failure> {
    assert_eq!(faults(job), []);
    let mut parsed: <ProgramCompensation as Calculator>::Input = serde_json::from_value(job.clone()).unwrap();
    ProgramCompensation::fill(&mut parsed);
    ProgramCompensation::run(&parsed, &Unwatched)
}

fn solve(job: &Value) -> Answer<Outcome> {
    try_solve(job).unwrap_or_else(|e| panic!("{e:?}\n{}", job["nc_program"].as_str().unwrap()))
}

fn refused(job: &Value) -> Finding {
    match try_solve(job) {
        Err(Failure::OutOfModel(finding)) => finding,
        other => panic!("{other:?}"),
    }
}

fn surface(answer: &Answer<Outcome>) -> &LeftSurface {
    answer.output.surface.as_ref().unwrap()
}

/// Diameter at a station, and the line that made it.
fn at(surface: &LeftSurface, z: f64) -> (f64, Option<usize>) {
    let i = (0..surface.z_start_mm.len()).find(|&i| surface.z_start_mm[i] <= z && z <= surface.z_end_mm[i]).unwrap();
    let circle = (surface.centre_diameter_mm[i], surface.centre_z_mm[i], surface.arc_radius_mm[i]);
    let diameter = if let (Some(x), Some(centre), Some(radius)) = circle {
        x + 2.0 * radius.signum() * (radius * radius - (z - centre).powi(2)).max(0.0).sqrt()
    } else {
        let share = (z - surface.z_start_mm[i]) / (surface.z_end_mm[i] - surface.z_start_mm[i]);
        surface.diameter_start_mm[i] + share * (surface.diameter_end_mm[i] - surface.diameter_start_mm[i])
    };
    (diameter, surface.line[i])
}

fn warned(answer: &Answer<Outcome>) -> Vec<&'static str> {
    answer.warnings.iter().map(|warning| warning.code).collect()
}

/// What may be said of the reference programs: they cut tapers without compensation of the nose.
const KNOWN: [&str; 2] = ["unknown_m", "nose_error_on_taper"];

#[test]
fn the_reference_programs_leave_what_they_should() {
    let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("reference/program-compensation/simulation.json");
    let file: Value = serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap();
    let mut compared = 0;
    for case in file["cases"].as_array().unwrap() {
        let (name, given, expected) = (&case["name"], &case["job"], &case["expected"]);
        let tools = given["tools"].as_array().unwrap().iter().map(|tool| {
            json!({
                "number": tool["number"], "nose_radius_mm": tool["nose_radius_mm"], "tip_direction": tool["tip_direction"],
                "cutting_edge_angle_deg": tool["cutting_edge_angle_deg"], "minor_edge_angle_deg": tool["end_edge_angle_deg"],
            })
        });
        let program = if given["nc_program"].is_string() { &given["nc_program"] } else { &given["program"] };
        let answer = solve(&json!({
            "nc_program": program, "dialect": given["dialect"], "mode": { "kind": "read" },
            "program_zero_z_mm": given["program_zero_z_mm"], "stock": { "profile": given["stock"]["profile"] },
            "tools": tools.collect::<Vec<_>>(),
        }));
        assert_eq!(json!(surface(&answer).finishing_lines), expected["finishing_lines"], "{name}");
        assert_eq!(warned(&answer).iter().filter(|code| !KNOWN.contains(code)).count(), 0, "{name}");
        for row in expected["surface"].as_array().unwrap() {
            let (z, wanted) = (row["z_mm"].as_f64().unwrap(), row["wanted_diameter_mm"].as_f64().unwrap());
            let (diameter, line) = at(surface(&answer), z);
            assert!((diameter - wanted).abs() < 1e-3, "{name} at {z}: {diameter}, {wanted}");
            assert_eq!(json!(line), row["made_by_line"], "{name} at {z}");
            compared += 1;
        }
    }
    assert!(compared > 200, "{compared}");
}

/// A tool of the test: the radius of its lower boundary above the programmed point, u along the axis from it.
struct Tool {
    number: u32,
    nose: f64,
    lead: f64,
    trail: f64,
    tip: u32,
}

impl Tool {
    fn job(&self) -> Value {
        json!({
            "number": self.number.to_string(), "nose_radius_mm": self.nose, "cutting_edge_angle_deg": self.lead,
            "minor_edge_angle_deg": self.trail, "tip_direction": self.tip,
        })
    }

    fn boundary(&self, u: f64) -> f64 {
        let (cu, cr) = match self.tip {
            3 => (self.nose, self.nose),
            4 => (-self.nose, self.nose),
            8 => (0.0, self.nose),
            _ => (0.0, 0.0),
        };
        let from = u - cu;
        let (left, right) = if self.tip == 4 { (self.trail, self.lead) } else { (self.lead, self.trail) };
        let angle = if from < 0.0 { left } else { right };
        // The nose is a circle up to where it has the angle of the edge.
        let reach = self.nose * if angle >= 90.0 { 1.0 } else { angle.to_radians().sin() };
        if from.abs() <= reach {
            return cr - (self.nose * self.nose - from * from).max(0.0).sqrt();
        }
        if angle >= 90.0 {
            return f64::INFINITY;
        }
        let low = cr - self.nose * angle.to_radians().cos();
        low + (from.abs() - reach) * angle.to_radians().tan()
    }
}

/// A program for a bar of 40 x 100 and the points of its path at the feed, closely: x from the headstock end, radius, tool.
fn drawn(draw: &mut Draw) -> (String, Vec<Tool>, Vec<[f64; 2]>, Vec<usize>) {
    let tools: Vec<Tool> = (1..=2)
        .map(|number| Tool {
            number,
            nose: [0.0, 0.4, 0.8, 1.6][(draw.share() * 4.0) as usize % 4],
            lead: [45.0, 75.0, 90.0, 93.0, 95.0][(draw.share() * 5.0) as usize % 5],
            trail: draw.between(3.0, 40.0).round(),
            tip: [3, 3, 4, 8, 9][(draw.share() * 5.0) as usize % 5],
        })
        .collect();
    let mut text = "G21 G18 G40 G99\nG97 S500\nF0.1\n".to_owned();
    let (mut points, mut of_tool) = (Vec::new(), Vec::new());
    let round = |value: f64| (value * 1000.0).round() / 1000.0;
    for (k, tool) in tools.iter().enumerate() {
        let (mut x, mut z) = (round(draw.between(10.0, 19.0)), 3.0);
        let _ = writeln!(text, "T{0:02}{0:02}\nG0 X60. Z3.\nX{1:.3}", tool.number, 2.0 * x);
        for _ in 0..5 {
            let (to_x, to_z) =
                (round((x + draw.between(-2.0, 4.0)).clamp(3.0, 22.0)), round(z - draw.between(0.0, 25.0)));
            let chord = (to_x - x).hypot(to_z - z);
            let radius = round(draw.between(0.6, 2.0) * chord);
            let clockwise = draw.share() < 0.5;
            let steps = 6000;
            if draw.share() < 0.6 || chord < 1.0 {
                let _ = writeln!(text, "G1 X{:.3} Z{to_z:.3}", 2.0 * to_x);
                for i in 0..=steps {
                    let share = f64::from(i) / f64::from(steps);
                    points.push([z + share * (to_z - z) + 100.0, x + share * (to_x - x)]);
                }
            } else {
                let _ = writeln!(text, "G{} X{:.3} Z{to_z:.3} R{radius:.3}", if clockwise { 2 } else { 3 }, 2.0 * to_x);
                let height = (radius * radius - 0.25 * chord * chord).sqrt();
                let side = if clockwise { -height } else { height };
                let centre =
                    [0.5 * (x + to_x) + side * (to_z - z) / chord, 0.5 * (z + to_z) - side * (to_x - x) / chord];
                let angle = |r: f64, z: f64| (r - centre[0]).atan2(z - centre[1]);
                let (from, to) = (angle(x, z), angle(to_x, to_z));
                let full = std::f64::consts::TAU;
                let turn = if clockwise { -(from - to).rem_euclid(full) } else { (to - from).rem_euclid(full) };
                for i in 0..=steps {
                    let at = from + turn * f64::from(i) / f64::from(steps);
                    points.push([centre[1] + radius * at.cos() + 100.0, centre[0] + radius * at.sin()]);
                }
            }
            of_tool.resize(points.len(), k);
            (x, z) = (to_x, to_z);
        }
        text += "G0 X60.\nZ50.\n";
    }
    (text + "M30\n", tools, points, of_tool)
}

fn draws(in_the_suite: u64) -> u64 {
    std::env::var("PRECUT_READINGS").ok().and_then(|text| text.parse().ok()).unwrap_or(in_the_suite)
}

/// The outline is the least of all places of the tool. On a grid of its own the least is missed by less than a step makes.
#[test]
fn the_outline_is_the_envelope_of_the_tool() {
    for seed in 0..draws(8) {
        let mut draw = Draw::new(300 + seed);
        let (text, tools, points, of_tool) = drawn(&mut draw);
        let answer = solve(&json!({
            "nc_program": text, "dialect": "fanuc_a", "mode": { "kind": "read" }, "program_zero_z_mm": 100,
            "stock": { "profile": [{ "z_mm": 0, "diameter_mm": 40 }, { "z_mm": 100, "diameter_mm": 40 }] },
            "tools": tools.iter().map(Tool::job).collect::<Vec<_>>(),
        }));
        for i in 0..40 {
            let z = 1.3 + 2.43 * f64::from(i);
            let covers = |(point, &k): (&[f64; 2], &usize)| point[1] + tools[k].boundary(z - point[0]);
            let least = points.iter().zip(&of_tool).map(covers).fold(20.0, f64::min).max(0.0);
            let found = 0.5 * at(surface(&answer), z).0;
            // Of a corner that runs along a steep path a step of 0.005 mm along it shows.
            assert!(found <= least + 1e-6 && found > least - 0.02, "{seed} at {z}: {found}, {least}\n{text}");
        }
    }
}

fn bar(program: &str, zero: f64) -> Value {
    json!({
        "nc_program": program, "dialect": "fanuc_a", "mode": { "kind": "read" }, "program_zero_z_mm": zero,
        "stock": { "profile": [{ "z_mm": 0, "diameter_mm": 40 }, { "z_mm": 100, "diameter_mm": 40 }] },
        "tools": [{ "number": "1", "nose_radius_mm": 0.8, "cutting_edge_angle_deg": 95, "minor_edge_angle_deg": 5, "tip_direction": 3 }],
    })
}

const HEAD: &str = "G21 G18 G40 G99\nT0101\nG97 S500\n";

/// Whoever reads it knows which line goes how deep.
#[test]
fn a_rapid_move_through_stock_is_told() {
    let text = format!("{HEAD}G0 X36. Z2.\nG1 Z-50. F0.2\nG0 X30.\nZ2.\nX60.\nM30\n");
    let answer = solve(&bar(&text, 100.0));
    let told: Vec<&Finding> = answer.warnings.iter().filter(|warning| warning.code == "rapid_in_stock").collect();
    let lines: Vec<_> = told.iter().map(|warning| warning.values.get("line").cloned().unwrap()).collect();
    assert_eq!(lines, [Said::from(6_usize), Said::from(7_usize)]);
    assert!((told[0].value.unwrap() - 3.0).abs() < 1e-9, "{told:?}");
    let clear = format!("{HEAD}G0 X36. Z2.\nG1 Z-50. F0.2\nX40.\nG0 X42.\nZ2.\nM30\n");
    assert_eq!(warned(&solve(&bar(&clear, 100.0))), Vec::<&str>::new());
}

/// A tool whose trailing edge is steeper than the way falls does what is advised.
#[test]
fn a_way_that_falls_behind_the_tip_is_told() {
    let text = format!("{HEAD}G0 X36. Z2.\nG1 Z-20. F0.2\nX30. Z-30.\nZ-50.\nX42.\nG0 X60.\nM30\n");
    let job = bar(&text, 100.0);
    let answer = solve(&job);
    let told: Vec<&Finding> = answer.warnings.iter().filter(|warning| warning.code == "gouge").collect();
    let [told] = told[..] else { panic!("{told:?}") };
    assert_eq!(told.values.get("line").cloned(), Some(Said::from(6_usize)));
    let falls = 0.3_f64.atan().to_degrees();
    assert!((told.value.unwrap() - falls).abs() < 1e-9 && told.limit == Some(5.0), "{told:?}");
    for (edge, gouges) in [(falls - 0.01, true), (falls + 0.01, false)] {
        let mut job = job.clone();
        job["tools"][0]["minor_edge_angle_deg"] = json!(edge);
        assert_eq!(warned(&solve(&job)).contains(&"gouge"), gouges, "{edge}");
    }
    // The other way round it leads.
    let up = format!("{HEAD}G0 X30. Z2.\nG1 Z-20. F0.2\nX36. Z-30.\nZ-50.\nX42.\nG0 X60.\nM30\n");
    assert!(!warned(&solve(&bar(&up, 100.0))).contains(&"gouge"));
    // Along a circle it is its steepest place: here the half of a right angle.
    let arc = format!("{HEAD}G0 X36. Z2.\nG1 Z-20. F0.2\nG3 X30. Z-27.2426 R10.2426\nG1 Z-50.\nX42.\nM30\n");
    let told = solve(&bar(&arc, 100.0));
    let told = told.warnings.iter().find(|warning| warning.code == "gouge").unwrap().value.unwrap();
    assert!((40.0..=45.5).contains(&told), "{told}");
}

/// A cut that goes on beyond the end of the edge is told, and no more once what is advised is done.
#[test]
fn an_edge_that_is_too_short_is_told() {
    let told = |text: &str, edit: &dyn Fn(&mut Value)| {
        let mut job = bar(&format!("{HEAD}{text}M30\n"), 100.0);
        job["tools"][0]["edge_length_mm"] = json!(6);
        edit(&mut job);
        let found = solve(&job).warnings.into_iter().find(|warning| warning.code == "edge_too_short");
        found.map(|warning| {
            let line = match warning.values.get("line") {
                Some(Said::Number(line)) => *line,
                other => panic!("{other:?}"),
            };
            (line, warning.value.unwrap(), warning.limit.unwrap())
        })
    };
    let same = |found: Option<(f64, f64, f64)>, wanted: (f64, f64)| {
        let (line, value, limit) = found.unwrap();
        assert!((line - wanted.0).abs() < 1e-9 && (value - wanted.1).abs() < 1e-9, "{line} {value}, {wanted:?}");
        assert!((limit - 6.0).abs() < 1e-9, "{limit}");
    };
    // The corner without a nose lies 0.8 / tan 40 deg off the end of the nose; the edge leans by 5 degrees.
    let (leans, corner) = (5_f64.to_radians(), 0.8 / 40_f64.to_radians().tan());
    let end = 0.8 + 0.8 * leans.sin() + (6.0 - corner) * leans.cos();
    let along = "G0 X24. Z2.\nG1 Z-50. F0.2\nX42.\nG0 X60.\n";
    same(told(along, &|_| {}), (5.0, 8.0 - end));
    assert_eq!(told(&along.replace("X24.", &format!("X{:.3}", 40.01 - 2.0 * end)), &|_| {}), None, "less depth");
    assert_eq!(told(along, &|job| job["tools"][0]["edge_length_mm"] = json!(8.2)), None, "a longer edge");
    assert_eq!(told(along, &|job| job["tools"][0]["edge_length_mm"] = Value::Null), None, "nothing is known of it");
    // Facing inward the trailing edge leads: it rises by as little, so that its end has nearly all of the radius above it.
    let face = "G0 X44. Z-7.\nG1 X10. F0.2\nG0 Z2.\nX60.\n";
    let risen = 0.8 - 0.8 * leans.cos() + (6.0 - corner) * leans.sin();
    same(told(face, &|_| {}), (5.0, 15.0 - risen));
    assert_eq!(told(&face.replace("Z-7.", "Z-5."), &|_| {}), None, "less depth");
    // An edge at 45 degrees comes to a collar long before its tip: 15 mm before it the edge has risen by as much.
    let collar = |job: &mut Value| {
        job["stock"]["profile"] = json!([
            { "z_mm": 0, "diameter_mm": 70 }, { "z_mm": 40, "diameter_mm": 70 },
            { "z_mm": 40, "diameter_mm": 40 }, { "z_mm": 100, "diameter_mm": 40 },
        ]);
        job["tools"][0]["cutting_edge_angle_deg"] = json!(45);
        job["tools"][0]["nose_radius_mm"] = json!(0);
    };
    let up_to = |z: f64| format!("G0 X36. Z2.\nG1 Z{z:.1} F0.2\nG0 X100.\n");
    same(told(&up_to(-45.0), &collar), (5.0, 35.0 - 33.0));
    assert_eq!(told(&up_to(-42.0), &collar), None);
    // Along an arc the end of the edge goes along one; most stands above it where it comes into the work, behind the tip.
    let arc = "G0 X20. Z2.\nG1 Z0. F0.2\nG3 X40. Z-10. R10.\nG1 X42.\nG0 X60.\n";
    let behind = 0.8 - 0.8 * leans.cos() + (6.0 - corner) * leans.sin();
    let radius = 10.0 + (100.0 - (10.0 - behind).powi(2)).sqrt();
    same(told(arc, &|_| {}), (6.0, 20.0 - radius - end));
}

#[test]
fn a_blank_that_is_too_thin_is_told() {
    let text = format!("{HEAD}G0 X36. Z2.\nG1 Z-100. F0.2\nX42.\nG0 X60.\nM30\n");
    assert!(!warned(&solve(&bar(&text, 100.0))).contains(&"blank_below_contour"));
    let mut thin = bar(&text, 100.0);
    thin["stock"]["profile"] = json!([
        { "z_mm": 0, "diameter_mm": 40 }, { "z_mm": 30, "diameter_mm": 40 },
        { "z_mm": 30, "diameter_mm": 35.9 }, { "z_mm": 55, "diameter_mm": 35.9 },
        { "z_mm": 55, "diameter_mm": 40 }, { "z_mm": 100, "diameter_mm": 40 },
    ]);
    let answer = solve(&thin);
    let told = answer.warnings.iter().find(|warning| warning.code == "blank_below_contour").unwrap();
    let number = |name: &str| match told.values.get(name) {
        Some(Said::Number(number)) => *number,
        other => panic!("{other:?}"),
    };
    assert!((told.value.unwrap() - 50.0).abs() < 1e-6, "{told:?}");
    assert!((number("from_mm") - 30.0).abs() < 1e-9 && (number("to_mm") - 55.0).abs() < 1e-9, "{told:?}");
    assert_eq!(told.values.get("line").cloned(), Some(Said::from(5_usize)));
    assert_eq!(at(surface(&answer), 40.0), (35.9, None), "nothing is cut there");
}

/// What the warning says mends it.
#[test]
fn a_program_zero_elsewhere_is_told_with_one_that_fits() {
    let text = format!("{HEAD}G0 X36. Z2.\nG1 Z-50. F0.2\nX42.\nG0 X60.\nZ2.\nM30\n");
    for (zero, code) in [(300.0, "nothing_cut"), (-80.0, "nothing_cut")] {
        let answer = solve(&bar(&text, zero));
        let told = answer.warnings.iter().find(|warning| warning.code == code).unwrap_or_else(|| panic!("{zero}"));
        let Some(Said::Number(fits)) = told.values.get("fits_z_mm") else { panic!("{told:?}") };
        assert_eq!(warned(&solve(&bar(&text, *fits))), Vec::<&str>::new());
        assert!((fits - 100.0).abs() < 1e-9);
    }
    let deep = format!("{HEAD}G0 X8. Z2.\nG1 Z-50. F0.2\nX42.\nM30\n");
    assert!(warned(&solve(&bar(&deep, 100.0))).contains(&"cut_implausible"));
}

/// Waves over a bar, every one of so many short moves, and one pass between them.
fn waves(orders: [usize; 3], moves: u32) -> String {
    let wave = |turns: f64, phase: f64| {
        let mut text = "G0 X60.\nZ2.\n".to_owned();
        for i in 0..=moves {
            let share = f64::from(i) / f64::from(moves);
            let x = 34.0 + 2.0 * (turns * share + phase).sin() + 1.2 * (31.0 * turns * share).sin();
            let _ = writeln!(text, "G1 X{x:.3} Z{:.3}", 1.0 - 90.0 * share);
        }
        text + "G1 X45.\n"
    };
    let passes = [wave(20.0, 0.0), "G0 X60.\nZ2.\nX34.5\nG1 Z-70.\nX45.\n".to_owned(), wave(33.0, 1.0)];
    let text: String = orders.iter().map(|&k| passes[k].as_str()).collect();
    format!("{HEAD}F0.1\n{text}G0 X60.\nM30\n")
}

/// What stands over the outline is the least of all moves, whichever came first, however many there are.
#[test]
fn thousands_of_moves_leave_the_same_in_any_order() {
    let (first, second) = (solve(&bar(&waves([0, 1, 2], 1500), 100.0)), solve(&bar(&waves([2, 0, 1], 1500), 100.0)));
    assert!(surface(&first).z_start_mm.len() > 1500);
    for i in 0..3000 {
        let z = 9.7 + 0.03 * f64::from(i);
        let (a, b) = (at(surface(&first), z).0, at(surface(&second), z).0);
        // Both sides of a step within rounding.
        assert!((a - b).abs() < 1e-6, "{z}: {a}, {b}");
    }
}

/// Passes in another order leave the same.
#[test]
fn the_order_of_passes_changes_who_made_it_and_not_what_is_left() {
    let passes = [
        "G0 X36. Z2.\nG1 Z-50. F0.2\nX42.\n",
        "G0 X30. Z2.\nG1 X38. Z-40. F0.2\nX42.\n",
        "G0 X34. Z2.\nG1 Z-20.F0.2\nG2 X40. Z-23. R3.\n",
    ];
    let leave = |order: [usize; 3]| {
        let text: String = order.iter().map(|&k| passes[k]).collect();
        solve(&bar(&format!("{HEAD}{text}M30\n"), 100.0))
    };
    let (first, second) = (leave([0, 1, 2]), leave([2, 1, 0]));
    for i in 0..200 {
        let z = 0.25 + 0.499 * f64::from(i);
        let (a, b) = (at(surface(&first), z).0, at(surface(&second), z).0);
        assert!((a - b).abs() < 1e-9, "{z}: {a}, {b}");
    }
}

#[test]
fn what_does_not_go_together_is_refused() {
    let text = format!("{HEAD}G0 X36. Z2.\nG1 Z-50. F0.2\nT0303\nG1 X38.\nM30\n");
    let missing = refused(&bar(&text, 100.0));
    assert_eq!((missing.code, missing.pointer.as_str()), ("tool_missing", "/tools"));
    assert_eq!(missing.values.get("names"), Some(&vec!["3"].into()));
    // A hollow that is narrower than the nose.
    let nose = format!("{HEAD}G0 X40. Z2.\nG42 X36.\nG1 Z-50. F0.2\nG2 X37. Z-50.5 R0.5\nG1 X42.\nG40 X44.\nM30\n");
    let refused_nose = refused(&bar(&nose, 100.0));
    assert_eq!(refused_nose.code, "nose_compensation_not_driven");
    assert_eq!(refused_nose.values.get("line").cloned(), Some(Said::from(7_usize)));
    // A smaller nose, as is advised, goes along it, and so does a wider hollow.
    let mut smaller = bar(&nose, 100.0);
    smaller["tools"][0]["nose_radius_mm"] = json!(0.4);
    assert!(solve(&smaller).output.surface.is_some());
    assert!(solve(&bar(&nose.replace("X37. Z-50.5 R0.5", "X38. Z-51. R1."), 100.0)).output.surface.is_some());
    let good = bar(&format!("{HEAD}G0 X36. Z2.\nG1 Z-50. F0.2\nM30\n"), 100.0);
    let with = |pointer: &str, value: Value| {
        let mut job = good.clone();
        *job.pointer_mut(pointer).unwrap() = value;
        faults(&job)
    };
    let is = |found: Vec<(&'static str, String)>, code: &str, pointer: &str| {
        let found: Vec<(&str, &str)> = found.iter().map(|(code, at)| (*code, at.as_str())).collect();
        assert_eq!(found, [(code, pointer)]);
    };
    is(with("/program_zero_z_mm", Value::Null), "program_zero_missing", "/program_zero_z_mm");
    is(with("/tools", json!([])), "tools_missing", "/tools");
    is(with("/tools/0/tip_direction", json!(2)), "tip_not_outside", "/tools/0/tip_direction");
    is(with("/stock/profile/1/z_mm", json!(0)), "stock_without_length", "/stock/profile");
    let mut back = good.clone();
    back["stock"]["profile"].as_array_mut().unwrap().insert(1, json!({ "z_mm": 120, "diameter_mm": 40 }));
    is(faults(&back), "profile_falls_back", "/stock/profile/2/z_mm");
    let mut twice = good.clone();
    let tool = twice["tools"][0].clone();
    twice["tools"].as_array_mut().unwrap().push(tool);
    is(faults(&twice), "duplicate_tool", "/tools/1/number");
}
