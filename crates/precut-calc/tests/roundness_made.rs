//! Made profiles, few points, gaps, and rows as instruments write them.
#![allow(clippy::unwrap_used, clippy::panic, clippy::cast_precision_loss, missing_docs)]

use std::f64::consts::TAU;

use precut_calc::calculator::{Answer, Calculator, Check, Unwatched, Violations};
use precut_calc::num::roundness::{Section, circles};
use precut_calc::ring_roundness::evaluation::{Job, Outcome, RepairKind, RoundnessEvaluation};
use serde_json::{Value, json};

fn solve(text: Value) -> Answer<Outcome> {
    let mut job: Job = serde_json::from_value(text).unwrap();
    let mut violations = Violations::default();
    job.check(&mut violations);
    let found: Vec<&str> = violations.into_vec().into_iter().map(|finding| finding.code).collect();
    assert_eq!(found, Vec::<&str>::new());
    RoundnessEvaluation::fill(&mut job);
    RoundnessEvaluation::run(&job, &Unwatched).unwrap()
}

fn warned(answer: &Answer<Outcome>) -> Vec<&'static str> {
    answer.warnings.iter().map(|finding| finding.code).collect()
}

fn told(answer: &Answer<Outcome>) -> Vec<&'static str> {
    answer.explanation.iter().map(|message| message.code).collect()
}

fn case(name: &str) -> Value {
    let path = std::path::Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/.."))
        .join("tests/cases/roundness-evaluation")
        .join(name);
    serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap()
}

#[test]
fn made_profiles_have_all_four_circles_and_their_ties_are_told() {
    for (name, width_um) in [("four-lobes-120-points.json", None), ("twelve-lobes-256-points.json", Some(6.0))] {
        let answer = solve(case(name));
        let circles = &answer.output.measured;
        let ront =
            [&circles.least_squares, &circles.minimum_zone, &circles.maximum_inscribed, &circles.minimum_circumscribed]
                .map(|circle| circle.ront_um);
        let least = ront[1];
        assert!(ront.iter().all(|um| *um >= least - 1e-6 && *um < 1.01 * least), "{name}: {ront:?}");
        if let Some(width_um) = width_um {
            assert!((least - width_um).abs() < 0.02, "{name}: {ront:?}");
        }
        assert!(told(&answer).contains(&"contacts_tied"), "{name}: {:?}", told(&answer));
        assert!(circles.maximum_inscribed.touching.unwrap() > 3, "{name}");
        for circle in [&circles.minimum_zone, &circles.maximum_inscribed] {
            assert!(circle.proof.as_ref().unwrap().is_global, "{name}");
        }
    }
}

/// Pure lobes of any order on any number of points, about any centre, rounded or not: four circles in their order.
#[test]
fn pure_lobes_of_any_order_are_evaluated() {
    let mut unproven = 0;
    for order in 2..=40_u32 {
        for count in [16_u32, 36, 64, 100, 120, 256, 360] {
            for (radius, amplitude, phase, decimals) in
                [(50.0, 0.005, 0.0, 15), (25.0, 0.05, 0.3, 15), (10.0, 0.3, 0.0, 5)]
            {
                let scale = 10.0_f64.powi(decimals);
                let (x, y): (Vec<f64>, Vec<f64>) = (0..count)
                    .map(|i| {
                        let angle = TAU * f64::from(i) / f64::from(count);
                        let r = radius + amplitude * (f64::from(order) * angle + phase).cos();
                        let round = |v: f64| if decimals < 15 { (v * scale).round() / scale } else { v };
                        (round(r * angle.cos()), round(r * angle.sin()))
                    })
                    .unzip();
                let section = Section::from_points(&x, &y).unwrap();
                let found =
                    circles(&section, &|| true).unwrap_or_else(|error| panic!("{order} {count} {radius}: {error}"));
                let zone = found.minimum_zone.width_mm();
                let others = [found.least_squares.span, found.inscribed.span, found.circumscribed.span]
                    .map(|span| span.width_mm());
                assert!(others.iter().all(|width| *width >= zone - 1e-9), "{order} {count}: {zone} {others:?}");
                assert!(found.inscribed.circle.radius_mm >= found.least_squares.span.nearest_mm - 1e-9);
                assert!(found.circumscribed.circle.radius_mm <= found.least_squares.span.farthest_mm + 1e-9);
                unproven += u32::from(!found.minimum_zone.is_global || !found.inscribed.is_global);
            }
        }
    }
    assert_eq!(unproven, 0);
}

#[test]
fn three_points_have_their_circle_and_few_their_waves() {
    let point = |angle: f64, r: f64| json!({ "x_mm": 5.0 + r * angle.cos(), "y_mm": -3.0 + r * angle.sin() });
    let three: Vec<Value> = (0..3).map(|i| point(TAU * f64::from(i) / 3.0, 12.0)).collect();
    let found = solve(json!({ "points": three })).output;
    assert!((found.measured.least_squares.radius_mm - 12.0).abs() < 1e-12 && found.roundness_um < 1e-6);
    assert!(!found.data.filter_applied);
    // Twelve even points tell waves up to six.
    let twelve: Vec<Value> = (0..12)
        .map(|i| TAU * f64::from(i) / 12.0)
        .map(|angle| point(angle, 12.0 + 0.01 * (3.0 * angle).cos()))
        .collect();
    let found = solve(json!({ "points": twelve, "filter": { "kind": "none" } })).output;
    assert_eq!(found.spectrum.order, [2.0, 3.0, 4.0, 5.0, 6.0]);
    assert!((found.spectrum.amplitude_um[1] - 10.0).abs() < 0.02, "{:?}", found.spectrum.amplitude_um);
}

#[test]
fn an_arc_and_a_keyway_are_evaluated_and_told() {
    for (from, to) in [(0.0, 90.0), (0.0, 200.0), (20.0, 340.0)] {
        let rows: Vec<Value> = (0..100)
            .map(|i| from + (to - from) * f64::from(i) / 99.0)
            .map(|deg: f64| json!({ "angle_deg": deg, "radius_mm": 30.0 + 0.004 * (5.0 * deg.to_radians()).cos() }))
            .collect();
        let answer = solve(json!({ "radii": rows }));
        let gap = 360.0 - (to - from);
        assert!((answer.output.data.largest_gap_deg - gap).abs() < 1.0, "{}", answer.output.data.largest_gap_deg);
        for code in ["filter_not_applied", "form_between_points_unknown"] {
            assert!(warned(&answer).contains(&code), "{code}: {:?}", warned(&answer));
        }
        assert!(answer.output.spectrum.order.is_empty() && answer.output.roundness_um > 0.0);
        assert!(!RoundnessEvaluation::figures(&job_of(&rows), &answer.output).is_empty());
    }
}

fn job_of(rows: &[Value]) -> Job {
    serde_json::from_value(json!({ "radii": rows })).unwrap()
}

/// The same section as instruments order its rows: the same answer, and what was put right is told.
#[test]
fn rows_in_any_order_and_of_any_turns_give_the_same_answer() {
    let r = |deg: f64| 30.0 + 0.004 * (3.0 * deg.to_radians()).cos() + 0.001 * (7.0 * deg.to_radians()).sin();
    let row = |deg: f64| json!({ "angle_deg": deg, "radius_mm": r(deg) });
    let plain: Vec<Value> = (0..180).map(|i| row(2.0 * f64::from(i))).collect();
    let expected = solve(json!({ "radii": plain })).output;
    assert!(expected.data.repairs.is_empty());
    let mut closing = plain.clone();
    closing.push(row(360.0));
    let mut clockwise = plain.clone();
    clockwise.reverse();
    let from_half: Vec<Value> = (0..180).map(|i| row((180.0 + 2.0 * f64::from(i)) % 360.0)).collect();
    let turns: Vec<Value> = (0..360).map(|i| row(2.0 * f64::from(i))).collect();
    let mut twice = plain.clone();
    twice.insert(4, plain[4].clone());
    let negative: Vec<Value> = (0..180).map(|i| row(-180.0 + 2.0 * f64::from(i))).collect();
    for (name, rows, repair) in [
        ("closing row", closing, Some(RepairKind::ClosingRowLeftOut)),
        ("clockwise", clockwise, Some(RepairKind::RowsPutInOrder)),
        ("from 180", from_half, Some(RepairKind::RowsPutInOrder)),
        ("two turns", turns, Some(RepairKind::TurnsLaidOnEachOther)),
        ("twice", twice, Some(RepairKind::SameAngleAveraged)),
        ("from -180", negative, None),
    ] {
        let answer = solve(json!({ "radii": rows }));
        let found = &answer.output;
        // Read at other angles where there are more rows.
        assert!((found.roundness_um - expected.roundness_um).abs() < 0.02, "{name}: {}", found.roundness_um);
        for (a, b) in found.spectrum.amplitude_um.iter().zip(&expected.spectrum.amplitude_um) {
            assert!((a - b).abs() < 1e-3, "{name}");
        }
        let kinds: Vec<RepairKind> = found.data.repairs.iter().map(|repair| repair.kind).collect();
        assert_eq!(kinds.first().copied(), repair, "{name}");
        assert_eq!(told(&answer).iter().filter(|code| **code == "repaired_in_reading").count(), kinds.len(), "{name}");
    }
}

/// A section of 25 mm with three and five lobes, as files have it.
fn radius_mm(deg: f64) -> f64 {
    let angle = deg.to_radians();
    25.0 + 0.004 * (3.0 * angle).cos() + 0.002 * (5.0 * angle).sin()
}

fn off_um(deg: f64) -> f64 {
    1e3 * (radius_mm(deg) - 25.0)
}

/// Lines of a file, one per five degrees.
fn lines(line: &dyn Fn(f64, u32) -> String) -> String {
    (0..72).map(|i| line(5.0 * f64::from(i), i) + "\n").collect()
}

fn comma(text: String) -> String {
    text.replace('.', ",")
}

/// Files as testers and coordinate machines write them: name, text, nominal radius where the user states it.
#[allow(clippy::too_many_lines)] // one file after the other
fn files() -> Vec<(&'static str, String, Option<f64>)> {
    let xy = |deg: f64| {
        let (sin, cos) = deg.to_radians().sin_cos();
        (100.0 + radius_mm(deg) * cos, -3.0 + radius_mm(deg) * sin)
    };
    let radii = |deg: f64, _: u32| format!("{deg};{:.6}", radius_mm(deg));
    vec![
        (
            "comma separated",
            format!("angle_deg,radius_mm\n{}", lines(&|d, _| format!("{d},{:.6}", radius_mm(d)))),
            None,
        ),
        (
            "header text, German, decimal comma",
            format!(
                "Formmessung 1\nDatum: 12.03.2024\nPrüfer: X\n\nWinkel [°];Radius [mm]\n{}",
                lines(&|d, _| comma(format!("{d:.1};{:.6}", radius_mm(d))))
            ),
            None,
        ),
        (
            "comment lines, blanks",
            format!(
                "# made by a tester\n# unit um\nangle deviation\n{}",
                lines(&|d, _| format!("{d:.2} {:.4}", off_um(d)))
            ),
            Some(25.0),
        ),
        (
            "further columns",
            format!(
                "No\tAngle [deg]\tRadius [mm]\tTemp\tStatus\n{}",
                lines(&|d, i| format!("{i}\t{d}\t{:.6}\t20.1\t0", radius_mm(d)))
            ),
            None,
        ),
        (
            "Russian, nominal radius in the header",
            format!(
                "Кругломер\nНоминальный радиус: 25 мм\nУгол, град;Отклонение, мкм\n{}",
                lines(&|d, _| comma(format!("{d};{:.4}", off_um(d))))
            ),
            None,
        ),
        (
            "no angle",
            format!(
                "Roundness profile\nUnit: um\nNominal radius = 25 mm\nDeviation\n{}",
                lines(&|d, _| format!("{:.4}", off_um(d)))
            ),
            None,
        ),
        ("no header", lines(&|d, _| format!("{d} {:.6}", radius_mm(d))), None),
        ("radii alone", lines(&|d, _| format!("{:.6}", radius_mm(d))), None),
        ("radii alone, decimal comma", lines(&|d, _| comma(format!("{:.6}", radius_mm(d)))), None),
        ("points in space", format!("X,Y,Z\n{}", lines(&|d, _| format!("{:.6},{:.6},12.5", xy(d).0, xy(d).1))), None),
        ("numbered points", lines(&|d, i| format!("{i} {:.6} {:.6} 12.5", xy(d).0, xy(d).1)), None),
        (
            "a line of units",
            format!("Angle;Deviation\n[deg];[um]\n{}", lines(&|d, _| format!("{d};{:.4}", off_um(d)))),
            Some(25.0),
        ),
        (
            "radians",
            format!("theta [rad]\tr [mm]\n{}", lines(&|d, _| format!("{:.7}\t{:.6}", d.to_radians(), radius_mm(d)))),
            None,
        ),
        (
            "inch",
            format!("angle (deg), radius (in)\n{}", lines(&|d, _| format!("{d},{:.8}", radius_mm(d) / 25.4))),
            None,
        ),
        (
            "diameters",
            format!("Angle deg;Diameter mm\n{}", lines(&|d, _| format!("{d};{:.6}", 2.0 * radius_mm(d)))),
            None,
        ),
        (
            "clockwise",
            format!(
                "Direction: clockwise\nangle_deg;radius_mm\n{}",
                lines(&|d, _| format!("{d};{:.6}", radius_mm(-d)))
            ),
            None,
        ),
        (
            "magnified",
            format!(
                "Magnification: 1000x\nNominal radius: 25 mm\nAngle [deg];Deviation [mm]\n{}",
                lines(&|d, _| format!("{d};{:.5}", off_um(d)))
            ),
            None,
        ),
        (
            "two sections",
            format!("Section 1\nangle;radius [mm]\n{0}\nSection 2\nangle;radius [mm]\n{0}", lines(&radii)),
            None,
        ),
        (
            "raw and filtered",
            format!(
                "Angle [deg],Deviation raw [um],Deviation filtered [um]\n{}",
                lines(&|d, _| format!("{d},{:.4},{:.4}", off_um(d), 0.9 * off_um(d)))
            ),
            Some(25.0),
        ),
        (
            "units in the cells",
            format!("Angle;Radius\n{}", lines(&|d, _| format!("{d}°;{:.6} mm", radius_mm(d)))),
            None,
        ),
        (
            "bars",
            format!("| Angle [deg] | Radius [mm] |\n{}", lines(&|d, _| format!("{d} | {:.6}", radius_mm(d)))),
            None,
        ),
        (
            "results below",
            format!(
                "angle,radius\n{}\nRONt = 12.1 um\nEnd of file\n",
                lines(&|d, _| format!("{d},{:.6}", radius_mm(d)))
            ),
            None,
        ),
        (
            "nanometres",
            format!("Angle [deg]\tError [nm]\n{}", lines(&|d, _| format!("{d}\t{:.1}", 1e3 * off_um(d)))),
            Some(25.0),
        ),
        (
            "Japanese",
            format!("真円度測定\n角度 [deg],半径 [mm]\n{}", lines(&|d, _| format!("{d},{:.6}", radius_mm(d)))),
            None,
        ),
        (
            "French",
            format!(
                "Mesure de circularité\nAngle (°)\tÉcart (µm)\n{}",
                lines(&|d, _| comma(format!("{d}\t{:.4}", off_um(d))))
            ),
            Some(25.0),
        ),
        ("byte order mark, CR", format!("\u{feff}angle_deg;radius_mm\r\n{}", lines(&|d, i| radii(d, i) + "\r")), None),
        ("powers of ten", format!("angle radius\n{}", lines(&|d, _| format!("{d:e} {:.8e}", radius_mm(d)))), None),
        ("closing row", format!("angle;radius\n{}360;{:.6}\n", lines(&radii), radius_mm(0.0)), None),
        ("from 180 degrees", format!("angle;radius\n{}", lines(&|d, i| radii((d + 180.0) % 360.0, i))), None),
    ]
}

#[test]
fn files_of_any_layout_give_the_same_section() {
    let files = files();
    assert!(files.len() >= 26);
    for (name, text, nominal) in files {
        let mut job = json!({ "file": { "text": text }, "filter": { "kind": "none" } });
        if let Some(nominal) = nominal {
            job["nominal_radius_mm"] = json!(nominal);
        }
        let answer = solve(job);
        let found = &answer.output;
        assert_eq!(found.data.points, 72, "{name}");
        assert!(
            (found.measured.least_squares.radius_mm - 25.0).abs() < 1e-5,
            "{name}: {:?}",
            found.measured.least_squares
        );
        for (order, amplitude_um, max_deg) in [(3, 4.0, 0.0), (5, 2.0, 18.0)] {
            let at = order - 2;
            assert!(
                (found.spectrum.amplitude_um[at] - amplitude_um).abs() < 0.03,
                "{name}: {:?}",
                &found.spectrum.amplitude_um[..5]
            );
            let period = 360.0 / order as f64;
            let off = (found.spectrum.angle_of_max_deg[at] - max_deg).rem_euclid(period);
            assert!(off.min(period - off) < 0.3, "{name}: {order} lobes at {}", found.spectrum.angle_of_max_deg[at]);
        }
        let said = told(&answer).iter().filter(|code| **code == "repaired_in_reading").count();
        assert_eq!(said, found.data.repairs.len(), "{name}");
    }
}

#[test]
fn an_unknown_layout_asks_which_column_is_what() {
    let text = lines(&|d, i| format!("{} {:.6}", i * 7 % 13, radius_mm(d) * 40.0));
    let mut job: Job = serde_json::from_value(json!({ "file": { "text": text } })).unwrap();
    let faults = |job: &Job| {
        let mut violations = Violations::default();
        job.check(&mut violations);
        violations.into_vec()
    };
    let found = faults(&job);
    assert_eq!((found[0].code, found[0].pointer.as_str()), ("layout_unknown", "/file/columns"));
    // Told, it is read.
    let text = lines(&|d, _| format!("{:.6} {d}", off_um(d)));
    job = serde_json::from_value(json!({
        "file": { "text": text, "columns": ["deviation_um", "angle_deg"] }, "nominal_radius_mm": 25, "filter": { "kind": "none" }
    }))
    .unwrap();
    assert!(faults(&job).is_empty(), "{:?}", faults(&job));
    job.file.as_mut().unwrap().section = 2;
    assert_eq!(faults(&job)[0].code, "section_missing");
    job.file.as_mut().unwrap().text = "nothing here".to_owned();
    assert_eq!(faults(&job)[0].code, "layout_unknown");
}
