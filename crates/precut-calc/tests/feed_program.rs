//! Programs of schedules, driven over a blank: what they cut, and that no rapid motion goes through what stands.
#![allow(clippy::unwrap_used, clippy::panic)]
#![allow(clippy::float_cmp, reason = "diameters are cut to the very number")]
#![allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "cells of a blank are few")]

use precut_calc::calculator::{Answer, Block, Calculator, Failure, Finding, Unwatched, Value as Said, Violations};
use precut_calc::feed_schedule::{FeedSchedule, Job, Outcome};
use serde_json::{Value, json};

use crate::feed_support;

/// Length of a cell of the blank, mm: every station of these tests lies between two.
const CELL_MM: f64 = 0.5;

/// A shaft of steel between centres, zones without a limit on the deflection, segments as (length, drawing, blank).
fn job(segments: &[(f64, f64, f64)], zones: &Value) -> Value {
    let length: f64 = segments.iter().map(|segment| segment.0).sum();
    let segments: Vec<Value> = segments
        .iter()
        .map(|(length, d, stock)| json!({ "length_mm": length, "diameter_mm": d, "stock_diameter_mm": stock }))
        .collect();
    json!({
        "shaft": { "youngs_modulus_n_per_mm2": 210_000, "segments": segments },
        "supports": [{ "kind": "centre", "z_mm": 0 }, { "kind": "centre", "z_mm": length }],
        "zones": zones,
        "models": { "tool_life": { "form": "log_log", "constant": 9, "speed_exponent": -1.5, "feed_exponent": -0.3 } },
        "limits": {
            "feed_min_mm_per_rev": 0.05, "feed_max_mm_per_rev": 0.4,
            "speed_min_m_per_min": 10, "speed_max_m_per_min": 80, "tool_life_min_min": 20
        },
        "objective": { "kind": "time" },
    })
}

fn zone(id: &str, from: f64, to: f64, diameter: f64, depth: f64) -> Value {
    json!({ "id": id, "z_start_mm": from, "z_end_mm": to, "diameter_mm": diameter, "depth_mm": depth })
}

fn answered(job: &Value) -> (Job, Answer<Outcome>) {
    let job = feed_support::job(job.clone());
    let answer = FeedSchedule::run(&job, &Unwatched).unwrap();
    (job, answer)
}

fn program(job: &Value) -> Result<Vec<Block>, Failure> {
    let (job, answer) = answered(job);
    FeedSchedule::program(&job, &answer.output).unwrap().map(|program| program.blocks)
}

fn refused(job: &Value) -> &'static str {
    match program(job) {
        Err(Failure::OutOfModel(finding)) => finding.code,
        other => panic!("{other:?}"),
    }
}

fn warned(job: &Value) -> Vec<&'static str> {
    answered(job).1.warnings.iter().map(|warning| warning.code).collect()
}

fn number(finding: &Finding, name: &str) -> f64 {
    match finding.values.get(name) {
        Some(Said::Number(value)) => *value,
        other => panic!("{name}: {other:?}"),
    }
}

/// A turned blank by cells.
struct Driven {
    diameters_mm: Vec<f64>,
    /// Deepest cut on the radius.
    deepest_mm: f64,
}

/// Drives a program whose zero is the right face over a blank. Every rapid motion must be clear of what stands.
fn driven(blocks: &[Block], segments: &[(f64, f64, f64)]) -> Driven {
    let mut diameters_mm = Vec::new();
    let mut length = 0.0;
    for (part, _, stock) in segments {
        diameters_mm.extend(vec![*stock; (part / CELL_MM).round() as usize]);
        length += part;
    }
    let mut turned = Driven { diameters_mm, deepest_mm: 0.0 };
    let mut at: Option<(f64, f64)> = None;
    for block in blocks {
        match *block {
            Block::Rapid { x_diameter_mm, z_mm } => {
                let from = at.unwrap_or_else(|| (f64::INFINITY, z_mm.unwrap() + length));
                let to = (x_diameter_mm.unwrap_or(from.0), z_mm.map_or(from.1, |z| z + length));
                let lowest = from.0.min(to.0);
                for d in turned.between(from.1, to.1) {
                    assert!(*d < lowest, "rapid from {from:?} to {to:?} through {d}");
                }
                at = Some(to);
            }
            Block::Cut { x_diameter_mm, z_mm, .. } => {
                let from = at.unwrap();
                let to = (x_diameter_mm, z_mm + length);
                let mut deepest = turned.deepest_mm;
                let is_level = (from.0 - to.0).abs() < 1e-9;
                for d in turned.between(from.1, to.1) {
                    // These programs cut no tapers: only the ways to a cut and from it slope, in the air.
                    assert!(is_level || *d <= from.0.min(to.0) + 1e-9, "a slope from {from:?} to {to:?} through {d}");
                    deepest = f64::max(deepest, (*d - to.0) / 2.0);
                    *d = d.min(to.0);
                }
                turned.deepest_mm = deepest;
                at = Some(to);
            }
            _ => {}
        }
    }
    turned
}

impl Driven {
    fn between(&mut self, a: f64, b: f64) -> impl Iterator<Item = &mut f64> {
        let cell = |z: f64| (z / CELL_MM).round().max(0.0) as usize;
        let (low, high) = (cell(a.min(b)), cell(a.max(b)).min(self.diameters_mm.len()));
        self.diameters_mm[low.min(high)..high].iter_mut()
    }

    fn at(&self, z: f64) -> f64 {
        self.diameters_mm[(z / CELL_MM) as usize]
    }
}

fn each_way(job: &Value) -> [Value; 2] {
    ["to_headstock", "to_tailstock"].map(|direction| {
        let mut job = job.clone();
        job["feed_direction"] = json!(direction);
        job
    })
}

#[test]
fn no_rapid_motion_goes_through_a_collar_that_no_zone_cuts() {
    let groove = [(300.0, 60.0, 60.0), (300.0, 50.0, 51.0), (300.0, 60.0, 60.0)];
    let flange = [(300.0, 50.0, 51.0), (100.0, 120.0, 120.0), (300.0, 50.0, 51.0)];
    let of_groove = job(&groove, &json!([zone("m", 300.0, 600.0, 50.0, 0.5)]));
    let of_flange = job(&flange, &json!([zone("a", 0.0, 300.0, 50.0, 0.5), zone("b", 400.0, 700.0, 50.0, 0.5)]));
    for (of, segments, plunges) in [(of_groove, &groove, true), (of_flange, &flange, true)] {
        for job in each_way(&of) {
            let turned = driven(&program(&job).unwrap(), segments);
            let mut from = 0.0;
            for (length, drawing, _) in segments {
                assert_eq!(turned.at(from + length / 2.0), *drawing);
                from += length;
            }
            assert!((turned.deepest_mm - 0.5).abs() < 1e-9, "{}", turned.deepest_mm);
            assert_eq!(warned(&job).contains(&"plunge_at_shoulder"), plunges);
        }
    }
}

/// Three steps down to a middle and up again, each with a blank half a millimetre thicker on the radius.
#[test]
fn stepped_shafts_are_turned_to_their_drawing() {
    let steps = [(100.0, 40.0, 41.0), (150.0, 50.0, 51.0), (80.0, 44.0, 45.0), (120.0, 60.0, 61.0)];
    let mut from = 0.0;
    let mut zones = Vec::new();
    for (i, (length, d, _)) in steps.iter().enumerate() {
        zones.push(zone(&format!("z{i}"), from, from + length, *d, 0.5));
        from += length;
    }
    for job in each_way(&job(&steps, &json!(zones))) {
        let turned = driven(&program(&job).unwrap(), &steps);
        assert!((turned.deepest_mm - 0.5).abs() < 1e-9, "{}", turned.deepest_mm);
        assert_eq!([50.0, 200.0, 300.0, 400.0].map(|z| turned.at(z)), [40.0, 50.0, 44.0, 60.0]);
        // Down to 44 or 40 beside 60 or 50, whichever way.
        assert!(warned(&job).contains(&"plunge_at_shoulder"));
    }
}

/// Edges below 90 degrees run into every step up in the direction of the feed, and into no other.
#[test]
fn a_square_shoulder_needs_an_edge_of_90_degrees() {
    let steps = [(100.0, 40.0, 41.0), (150.0, 50.0, 51.0), (80.0, 44.0, 45.0), (120.0, 60.0, 60.0)];
    let zones = json!([
        zone("a", 0.0, 100.0, 40.0, 0.5),
        zone("b", 100.0, 250.0, 50.0, 0.5),
        zone("c", 250.0, 330.0, 44.0, 0.5),
    ]);
    let met = |direction: &str, angle_deg: f64| {
        let mut job = job(&steps, &zones);
        job["feed_direction"] = json!(direction);
        job["cutting_edge_angle_deg"] = json!(angle_deg);
        let (_, answer) = answered(&job);
        let of_edge = answer.warnings.into_iter().filter(|warning| warning.code == "edge_meets_shoulder");
        of_edge.map(|warning| ["z_mm", "reach_mm"].map(|name| number(&warning, name))).collect::<Vec<_>>()
    };
    let reach_mm = |height_mm: f64| height_mm / 75.0_f64.to_radians().tan();
    let near = |found: Vec<[f64; 2]>, right: &[[f64; 2]]| {
        assert_eq!(found.len(), right.len(), "{found:?}");
        let pairs = found.iter().flatten().zip(right.iter().flatten());
        assert!(pairs.clone().all(|(a, b)| (a - b).abs() < 1e-9), "{found:?}");
    };
    // A collar that no zone cuts is a shoulder, too.
    near(met("to_tailstock", 75.0), &[[100.0, reach_mm(5.0)], [330.0, reach_mm(8.0)]]);
    near(met("to_headstock", 75.0), &[[250.0, reach_mm(3.0)]]);
    near(met("to_tailstock", 90.0), &[]);
    near(met("to_headstock", 93.0), &[]);
}

#[test]
fn every_pass_takes_its_own_depth_at_its_own_speed() {
    let bar = [(300.0, 50.0, 62.0)];
    let plain = zone("a", 0.0, 300.0, 50.0, 2.0);
    let mut repeated = plain.clone();
    repeated["repeat"] = json!(3);
    let mut planned = job(&bar, &json!([plain]));
    planned["passes"] =
        json!({ "total_depth_mm": 6.0, "depth_min_mm": 1.0, "depth_max_mm": 2.5, "roughing_passes_max": 4 });
    for of in [job(&bar, &json!([repeated])), planned] {
        for job in each_way(&of) {
            let blocks = program(&job).unwrap();
            let turned = driven(&blocks, &bar);
            assert!(turned.deepest_mm <= 2.5 + 1e-9 && turned.at(150.0) == 50.0, "{}", turned.deepest_mm);
            // 80 m/min at most, at whatever diameter.
            let mut rpm = 0.0;
            for block in &blocks {
                match *block {
                    Block::SpindleSpeed { rpm: next } => rpm = next,
                    Block::Cut { x_diameter_mm, .. } => {
                        assert!(std::f64::consts::PI * x_diameter_mm * rpm / 1000.0 <= 80.0 * (1.0 + 1e-9));
                    }
                    Block::Rapid { x_diameter_mm: Some(x), .. } => assert!(x == 67.0 || x < 62.0, "{x}"),
                    _ => {}
                }
            }
            assert!(warned(&job).contains(&"pass_thicker_than_counted"));
        }
    }
}

#[test]
fn what_the_shaft_says_otherwise_is_not_cut() {
    let two = [(300.0, 60.0, 61.0), (300.0, 50.0, 51.0)];
    assert_eq!(refused(&job(&two, &json!([zone("a", 0.0, 600.0, 50.0, 0.5)]))), "zone_off_drawing");
    assert_eq!(refused(&job(&two, &json!([zone("a", 300.0, 600.0, 49.9, 0.5)]))), "zone_off_drawing");
    assert_eq!(refused(&job(&two, &json!([zone("a", 300.0, 600.0, 50.0, 0.3)]))), "zone_off_blank");
    assert!(program(&job(&two, &json!([zone("a", 300.0, 600.0, 50.0, 0.6)]))).is_ok(), "some of it in air");
}

#[test]
fn chucks_and_rests_are_met() {
    let bar = [(600.0, 50.0, 51.0)];
    let mut held = job(&bar, &json!([zone("a", 0.0, 600.0, 50.0, 0.5)]));
    held["supports"] = json!([
        { "kind": "chuck", "z_mm": 200 }, { "kind": "steady_rest", "z_mm": 450 }, { "kind": "centre", "z_mm": 600 }
    ]);
    assert_eq!(refused(&held), "tool_hits_chuck");
    let said = warned(&held);
    assert!(said.contains(&"tool_hits_chuck") && said.contains(&"tool_passes_support"), "{said:?}");
    held["zones"] = json!([zone("a", 250.0, 440.0, 50.0, 0.5)]);
    assert!(program(&held).is_ok());
}

/// A compensated path belongs to one pass: driven again it would cut what the first one left on purpose.
#[test]
fn no_path_is_compensated_for_passes_that_come_again() {
    let mut twice = zone("a", 0.0, 600.0, 50.0, 0.5);
    twice["repeat"] = json!(2);
    let mut of = job(&[(600.0, 50.0, 52.0)], &json!([twice]));
    of["compensation"] = json!({});
    of["models"]["force_y"] = json!({ "form": "log_log", "constant": 6.0, "feed_exponent": 0.6 });
    let parsed: Job = serde_json::from_value(of).unwrap();
    let mut violations = Violations::default();
    precut_calc::calculator::Check::check(&parsed, &mut violations);
    let codes: Vec<&str> = violations.into_vec().iter().map(|finding| finding.code).collect();
    assert_eq!(codes, ["method_not_together"]);
}

fn faults(job: &Value) -> Vec<&'static str> {
    let parsed: Job = serde_json::from_value(job.clone()).unwrap();
    let mut violations = Violations::default();
    precut_calc::calculator::Check::check(&parsed, &mut violations);
    violations.into_vec().iter().map(|finding| finding.code).collect()
}

/// Without a clearance along the shaft there is no place to come down in: the tool feeds in where it begins.
#[test]
fn without_a_clearance_no_rapid_motion_ends_at_a_cut() {
    let groove = [(100.0, 60.0, 60.0), (100.0, 44.0, 46.0), (100.0, 60.0, 60.0)];
    let mut of = job(&groove, &json!([zone("m", 100.0, 200.0, 44.0, 1.0)]));
    for clearance in [0.0, 1e-6, 2.0, 99.99] {
        of["program"] = json!({ "clearance_z_mm": clearance });
        for job in each_way(&of) {
            let turned = driven(&program(&job).unwrap(), &groove);
            assert_eq!([50.0, 150.0, 250.0].map(|z| turned.at(z)), [60.0, 44.0, 60.0]);
            assert!(warned(&job).contains(&"plunge_at_shoulder"));
        }
    }
}

/// A compensated path begins deeper than the drawing: beside a neighbour at the drawing's size the tool feeds in.
#[test]
fn a_compensated_path_comes_down_clear_of_a_finished_neighbour() {
    let step = [(400.0, 40.0, 42.0), (200.0, 39.98, 39.98)];
    let mut of = job(&step, &json!([zone("a", 0.0, 400.0, 40.0, 1.0)]));
    of["compensation"] = json!({});
    of["models"]["force_y"] = json!({ "form": "log_log", "constant": 6.5, "feed_exponent": 0.6 });
    let [to_headstock, _] = each_way(&of);
    let blocks = program(&to_headstock).unwrap();
    let first = blocks.iter().find_map(|block| match *block {
        Block::Cut { x_diameter_mm, .. } => Some(x_diameter_mm).filter(|x| *x < 39.98),
        _ => None,
    });
    assert!(first.is_some(), "{blocks:?}");
    let down = blocks.iter().any(|block| matches!(*block, Block::Rapid { x_diameter_mm: Some(x), .. } if x < 42.0));
    assert!(!down && warned(&to_headstock).contains(&"plunge_at_shoulder"));
}

#[test]
fn a_zone_lies_on_its_shaft_and_a_compensated_one_bends_as_the_shaft_does() {
    let mut beyond = zone("a", 0.0, 500.0, 50.0, 0.5);
    beyond["compliance_um_per_n"] = json!(0.02);
    let bar = [(400.0, 50.0, 51.0)];
    assert_eq!(faults(&job(&bar, &json!([beyond]))), ["zone_outside_shaft"]);
    let mut stated = zone("a", 0.0, 400.0, 50.0, 0.5);
    stated["compliance_um_per_n"] = json!(0.5);
    let mut of = job(&bar, &json!([stated]));
    of["models"]["force_y"] = json!({ "form": "log_log", "constant": 5.0, "feed_exponent": 0.6 });
    assert!(faults(&of).is_empty());
    of["compensation"] = json!({});
    assert_eq!(faults(&of), ["method_not_together"]);
}

/// Only the split into passes gives zones that are roughed; a user's own names mean nothing.
#[test]
fn the_name_of_a_zone_changes_nothing_in_its_path() {
    let bar = [(300.0, 50.0, 51.0), (300.0, 50.0, 51.0)];
    let of = |names: [&str; 2]| {
        let zones = json!([zone(names[0], 0.0, 300.0, 50.0, 0.5), zone(names[1], 300.0, 600.0, 50.0, 0.5)]);
        let blocks = program(&job(&bar, &zones)).unwrap();
        blocks.into_iter().filter(|block| !matches!(block, Block::Note(_))).collect::<Vec<_>>()
    };
    assert_eq!(of(["left:rough", "left:finish"]), of(["a", "b"]));
}

fn spindle_speeds(blocks: &[Block]) -> Vec<f64> {
    blocks.iter().filter_map(|b| if let Block::SpindleSpeed { rpm } = b { Some(*rpm) } else { None }).collect()
}

#[test]
fn no_pass_turns_slower_than_the_spindle_does_and_what_that_passes_is_told() {
    let mut repeated = zone("a", 0.0, 300.0, 50.0, 2.0);
    repeated["repeat"] = json!(4);
    let mut of = job(&[(300.0, 50.0, 66.0)], &json!([repeated]));
    of["machine"] = json!({ "spindle_speed_min_rpm": 450 });
    let told = |job: &Value| {
        let warning = answered(job).1.warnings.into_iter().find(|w| w.code == "pass_thicker_than_counted").unwrap();
        serde_json::to_value(&warning.values).unwrap()
    };
    let speeds = spindle_speeds(&program(&of).unwrap());
    assert!(speeds.iter().all(|rpm| *rpm >= 450.0) && speeds[0] == 450.0, "{speeds:?}");
    let said = told(&of);
    assert_eq!((&said["speed"], &said["beyond"]), (&json!("least"), &json!(["speed_max"])), "{said}");
    of["machine"] = json!({});
    assert!(spindle_speeds(&program(&of).unwrap())[0] < 450.0);
    assert_eq!(told(&of)["speed"], json!("kept"));
    // One spindle speed for all: at the thickest pass the cutting speed is as much more as the diameter.
    of["variables"] = json!({ "speed": "constant_rpm" });
    let said = told(&of);
    assert_eq!((&said["speed"], &said["beyond"]), (&json!("one_for_all"), &json!(["speed_max"])), "{said}");
}

/// 1556 rev/min at 29.9 mm, and nothing else: no digit is lost on the way.
#[test]
fn a_spindle_speed_that_is_whole_stays_whole() {
    let mut of = job(&[(100.0, 29.9, 30.9)], &json!([zone("a", 0.0, 100.0, 29.9, 0.5)]));
    of["machine"] = json!({ "spindle_speed_min_rpm": 1556, "spindle_speed_max_rpm": 1556 });
    of["limits"]["speed_max_m_per_min"] = json!(300);
    of["limits"].as_object_mut().unwrap().remove("tool_life_min_min");
    assert_eq!(spindle_speeds(&program(&of).unwrap()), [1556.0]);
}

fn feeds(blocks: &[Block]) -> Vec<f64> {
    blocks
        .iter()
        .filter_map(|b| if let Block::Cut { feed_mm_per_rev, .. } = b { *feed_mm_per_rev } else { None })
        .collect()
}

#[test]
fn one_feed_for_all_stays_one_and_a_given_one_stays_given() {
    let bar = [(300.0, 50.0, 51.0), (300.0, 48.0, 49.0)];
    let zones = json!([zone("a", 0.0, 300.0, 50.0, 0.5), zone("b", 300.0, 600.0, 48.0, 0.5)]);
    for variables in
        [json!({ "feed": "constant" }), json!({ "feed": "fixed", "fixed_feed_mm_per_rev": 0.15 }), json!({})]
    {
        let mut of = job(&bar, &zones);
        of["variables"] = variables.clone();
        let feeds = feeds(&program(&of).unwrap());
        if variables["feed"] == "fixed" {
            assert!(feeds.iter().all(|feed| *feed == 0.15), "{feeds:?}");
        } else if variables["feed"] == "constant" {
            assert!(feeds.iter().all(|feed| *feed == feeds[0]), "{feeds:?}");
        }
    }
    // Below what a control's thousandth can say.
    let mut of = job(&bar, &zones);
    of["limits"]["feed_min_mm_per_rev"] = json!(0.0001);
    of["limits"]["feed_max_mm_per_rev"] = json!(0.0005);
    assert!(feeds(&program(&of).unwrap()).iter().all(|feed| *feed <= 0.0005));
}

/// The rule has feeds of its own and one cutting speed: what `variables` say of them is told to be unused, and is.
#[test]
fn the_rule_of_equal_deflection_keeps_its_own_feeds() {
    let bar = [(100.0, 50.0, 51.0), (400.0, 50.0, 51.0)];
    let mut of = job(&bar, &json!([zone("a", 0.0, 100.0, 50.0, 0.5), zone("b", 100.0, 500.0, 50.0, 0.5)]));
    of["models"]["force_y"] = json!({ "form": "log_log", "constant": 5.0, "feed_exponent": 0.6 });
    of["method"] = json!({
        "kind": "equal_deflection", "target": "minimum", "reference_feed_mm_per_rev": 0.3, "speed_m_per_min": 60
    });
    let plain = program(&of).unwrap();
    assert!(feeds(&plain).windows(2).any(|pair| pair[0] != pair[1]), "{plain:?}");
    of["variables"] = json!({ "feed": "fixed", "fixed_feed_mm_per_rev": 0.15, "speed": "constant_rpm" });
    assert_eq!(program(&of).unwrap(), plain);
    let warnings = answered(&of).1.warnings;
    let unused: Vec<&str> = warnings.iter().filter(|w| w.code == "unused_input").map(|w| w.pointer.as_str()).collect();
    assert_eq!(unused, ["/variables/feed", "/variables/speed"]);
}
