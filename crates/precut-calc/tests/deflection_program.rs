//! What the tool meets where the program takes it: chucks, rests, shoulders.
#![allow(clippy::unwrap_used, clippy::panic, missing_docs)]

use crate::support::prepared;
use precut_calc::calculator::{Block, Calculator, Failure, Finding, Program, Unwatched, Value as Said};
use precut_calc::deflection_compensation::DeflectionCompensation;
use serde_json::{Value, json};

/// Warnings of a job, and its program.
fn programmed(job: Value) -> (Vec<Finding>, Result<Program, Failure>) {
    let job = prepared(job);
    let answer = DeflectionCompensation::run(&job, &Unwatched).unwrap();
    let program = DeflectionCompensation::program(&job, &answer.output).unwrap();
    (answer.warnings, program)
}

fn job(segments: &Value, supports: &Value, feed_direction: &str) -> Value {
    json!({
        "shaft": { "segments": segments, "youngs_modulus_n_per_mm2": 210_000.0 },
        "supports": supports,
        "force": { "kind": "constant", "passive_n": 100.0 },
        "cut": { "feed_mm_per_rev": 0.2, "speed_m_per_min": 100.0, "feed_direction": feed_direction },
        "stations": { "kind": "per_zone", "count": 11 }
    })
}

/// A journal for the chuck, and the turned part up to the tailstock.
fn held_at(chuck_mm: f64, feed_direction: &str) -> Value {
    let segments = json!([
        { "length_mm": 50.0, "diameter_mm": 38.0 },
        { "length_mm": 450.0, "diameter_mm": 40.0, "stock_diameter_mm": 42.0 }
    ]);
    let supports = json!([{ "kind": "chuck", "z_mm": chuck_mm }, { "kind": "centre", "z_mm": 500.0 }]);
    job(&segments, &supports, feed_direction)
}

fn named<'a>(warnings: &'a [Finding], code: &str) -> Vec<&'a Finding> {
    warnings.iter().filter(|warning| warning.code == code).collect()
}

fn number(finding: &Finding, name: &str) -> f64 {
    match finding.values.get(name) {
        Some(Said::Number(number)) => *number,
        other => panic!("{name} is {other:?}"),
    }
}

fn assert_refused(job: &Value, motion: &'static str) {
    let (warnings, program) = programmed(job.clone());
    let Err(Failure::OutOfModel(fault)) = program else { panic!("{job} has a program: {program:?}") };
    for finding in [&fault, named(&warnings, "tool_hits_chuck")[0]] {
        assert_eq!((finding.code, finding.pointer.as_str()), ("tool_hits_chuck", "/supports/0/z_mm"));
        assert_eq!(finding.values.get("motion"), Some(&Said::from(motion)));
        assert_eq!(finding.unit, Some("mm"));
    }
    assert!(named(&warnings, "tool_passes_support").is_empty(), "{warnings:?}");
}

#[test]
fn no_program_takes_the_tool_through_a_chuck() {
    // The approach begins beyond the chuck, at it, and the cut passes it.
    assert_refused(&held_at(50.0, "to_tailstock"), "rapid");
    assert_refused(&held_at(48.5, "to_tailstock"), "rapid");
    assert_refused(&held_at(48.0, "to_tailstock"), "rapid");
    assert_refused(&held_at(100.0, "to_headstock"), "cut");
    assert_refused(&held_at(100.0, "to_tailstock"), "cut");
    // Held in the middle: the tool goes from one turned segment to the other past the jaws.
    let segments = json!([
        { "length_mm": 200.0, "diameter_mm": 40.0, "stock_diameter_mm": 42.0 },
        { "length_mm": 100.0, "diameter_mm": 50.0 },
        { "length_mm": 200.0, "diameter_mm": 40.0, "stock_diameter_mm": 42.0 }
    ]);
    assert_refused(&job(&segments, &json!([{ "kind": "chuck", "z_mm": 250.0 }]), "to_headstock"), "rapid");
}

/// The whole length turned, from the chuck on and up to it.
#[test]
fn a_chuck_at_the_end_of_the_shaft_counts() {
    let segments = json!([{ "length_mm": 500.0, "diameter_mm": 40.0, "stock_diameter_mm": 42.0 }]);
    let supports = json!([{ "kind": "chuck", "z_mm": 0.0 }, { "kind": "centre", "z_mm": 500.0 }]);
    assert_refused(&job(&segments, &supports, "to_tailstock"), "rapid");
    let (warnings, program) = programmed(job(&segments, &supports, "to_headstock"));
    assert!(program.is_ok());
    let near = named(&warnings, "tool_reaches_support");
    assert!(matches!(near[..], [near] if near.value == Some(0.0) && near.pointer == "/supports/0/z_mm"), "{near:?}");
    assert_eq!(near[0].values.get("kind"), Some(&Said::from("chuck")));
}

#[test]
fn a_chuck_within_the_clearance_is_warned_of_and_one_beyond_it_is_not() {
    for (chuck_mm, warned) in [(50.0, true), (48.5, true), (47.5, false), (25.0, false)] {
        let (warnings, program) = programmed(held_at(chuck_mm, "to_headstock"));
        assert!(program.is_ok(), "{chuck_mm}");
        assert_eq!(named(&warnings, "tool_reaches_support").len(), usize::from(warned), "{chuck_mm}: {warnings:?}");
        assert!(named(&warnings, "tool_hits_chuck").is_empty(), "{chuck_mm}");
    }
    let (warnings, program) = programmed(held_at(25.0, "to_tailstock"));
    assert!(program.is_ok() && warnings.iter().all(|w| !w.code.starts_with("tool_")), "{warnings:?}");
}

/// A rest can be opened or moved while the tool passes: a warning, and the program.
#[test]
fn a_steady_rest_that_the_tool_passes_is_warned_of() {
    for (rest_mm, code) in
        [(300.0, "tool_passes_support"), (49.5, "tool_passes_support"), (47.5, "tool_reaches_support")]
    {
        let mut held = held_at(25.0, "to_tailstock");
        held["supports"].as_array_mut().unwrap().push(json!({ "kind": "steady_rest", "z_mm": rest_mm }));
        let (warnings, program) = programmed(held);
        assert!(program.is_ok());
        let found = named(&warnings, code);
        assert!(matches!(found[..], [found] if found.value == Some(rest_mm)), "{rest_mm}: {warnings:?}");
    }
}

fn stepped(diameters_mm: [f64; 3], feed_direction: &str) -> Value {
    let segments: Vec<Value> = diameters_mm
        .iter()
        .map(|d| json!({ "length_mm": 300.0, "diameter_mm": d, "stock_diameter_mm": 64.0 }))
        .collect();
    let centres = json!([{ "kind": "centre", "z_mm": 0.0 }, { "kind": "centre", "z_mm": 900.0 }]);
    job(&json!(segments), &centres, feed_direction)
}

#[test]
fn a_plunge_behind_a_shoulder_is_told_with_its_place() {
    for (feed_direction, at, z_program) in [("to_headstock", 600.0, -300.0), ("to_tailstock", 300.0, -600.0)] {
        let (warnings, program) = programmed(stepped([60.0, 50.0, 60.0], feed_direction));
        let plunges = named(&warnings, "plunge_at_shoulder");
        let [plunge] = plunges[..] else { panic!("{warnings:?}") };
        assert_eq!((plunge.value, plunge.unit), (Some(at), Some("mm")));
        assert!((number(plunge, "z_program_mm") - z_program).abs() < 1e-9);
        // The program really feeds down there.
        let depth = number(plunge, "diameter_mm");
        let blocks = program.unwrap().blocks;
        let down = Block::Cut { x_diameter_mm: depth, z_mm: z_program, feed_mm_per_rev: None };
        assert!(blocks.contains(&down), "{blocks:?}");
    }
    // Down a flight of steps nothing stands in the way.
    let (warnings, _) = programmed(stepped([60.0, 56.0, 50.0], "to_headstock"));
    assert!(named(&warnings, "plunge_at_shoulder").is_empty(), "{warnings:?}");
}

/// However small the clearance is, a shoulder beside it is no place to come down at.
#[test]
fn a_small_clearance_hides_no_shoulder() {
    for (increment_um, clearance_mm) in [(100.0, 0.2), (1.0, 0.002), (1.0, 0.0), (10.0, 250.0)] {
        for feed_direction in ["to_headstock", "to_tailstock"] {
            let mut of = stepped([60.0, 50.0, 60.0], feed_direction);
            of["program"] = json!({ "clearance_z_mm": clearance_mm, "clearance_x_mm": 0.0 });
            of["path"] = json!({ "increment_um": increment_um });
            of["shaft"]["segments"][0]["stock_diameter_mm"] = json!(64.04);
            let (warnings, program) = programmed(of);
            assert_eq!(named(&warnings, "plunge_at_shoulder").len(), 1, "{warnings:?}");
            for block in program.unwrap().blocks {
                let Block::Rapid { x_diameter_mm: Some(x), .. } = block else { continue };
                // To the first cut from outside, else beyond the blank.
                assert!(x > 59.0 && !(60.5..64.04).contains(&x), "into the blank: {x}");
            }
        }
    }
}

/// Stations that begin inside the blank: what is not cut yet stands there as it came, however deep the command is.
#[test]
fn the_tool_does_not_come_down_rapidly_into_the_blank() {
    let centres = json!([{ "kind": "centre", "z_mm": 0.0 }, { "kind": "centre", "z_mm": 500.0 }]);
    let segments = json!([{ "length_mm": 500.0, "diameter_mm": 40.0, "stock_diameter_mm": 42.0 }]);
    let mut inside = job(&segments, &centres, "to_headstock");
    inside["stations"] = json!({ "kind": "list", "z_mm": [100.0, 200.0, 300.0] });
    // The tailstock stands 0.2 mm toward the tool: the command lies outside the drawing's diameter.
    inside["effects"] = json!([{ "kind": "tailstock_offset", "offset_um": -400.0 }]);
    let (warnings, program) = programmed(inside);
    let first = program.unwrap().blocks.into_iter().find_map(|block| match block {
        Block::Cut { x_diameter_mm, .. } => Some(x_diameter_mm),
        _ => None,
    });
    assert!(first.unwrap() > 40.0, "{first:?}");
    assert_eq!(named(&warnings, "plunge_at_shoulder").len(), 1, "{warnings:?}");
}

fn held_in_centres(stations: &Value) -> Value {
    let centres = json!([{ "kind": "centre", "z_mm": 0.0 }, { "kind": "centre", "z_mm": 900.0 }]);
    let segments: Vec<Value> = [60.0, 50.0, 60.0]
        .map(|d| json!({ "length_mm": 300.0, "diameter_mm": d, "stock_diameter_mm": d + 2.0 }))
        .to_vec();
    let mut job = job(&json!(segments), &centres, "to_tailstock");
    job["force"]["passive_n"] = json!(1500.0);
    job["stations"] = stations.clone();
    job
}

fn list(z_mm: &[f64]) -> Value {
    json!({ "kind": "list", "z_mm": z_mm })
}

/// Few stations ask for a short answer; the path goes through as many as ever.
#[test]
fn a_path_does_not_become_coarse_with_few_stations() {
    let solved = |stations: &Value| crate::support::solved(held_in_centres(stations));
    let few = solved(&list(&[0.0, 450.0, 900.0]));
    assert_eq!(few.stations.z_mm, [0.0, 450.0, 900.0]);
    let errors = few.stations.diameter_error_compensated_um.unwrap();
    let chord = few.path.as_ref().unwrap().achieved_deviation_um.unwrap();
    let after = few.after.unwrap();
    for error in errors.iter().flatten().chain([&few.largest_error_after_um.unwrap()]) {
        assert!(error.abs() <= 2.0 * chord && chord < 1.5, "{error} {chord}");
    }
    assert!(after.form_error_um.unwrap() > 0.5, "the worst lies between the stations: {after:?}");
    // Every zone from end to end, though a list cannot name the left end of one behind a shoulder.
    let ends = |path: &precut_calc::deflection_compensation::Path| -> Vec<[f64; 2]> {
        path.zones.iter().map(|zone| [zone.z_mm[0], *zone.z_mm.last().unwrap()]).collect()
    };
    assert_eq!(ends(few.path.as_ref().unwrap()), [[0.0, 300.0], [300.0, 600.0], [600.0, 900.0]]);
    let usual = solved(&json!({ "kind": "per_zone", "count": 201 }));
    let sparse = solved(&json!({ "kind": "per_zone", "count": 3 }));
    assert_eq!(usual.path, sparse.path);
    assert_eq!(sparse.stations.z_mm.len(), 9);
    // The same places, but for rounding.
    assert!((usual.form_error_after_um.unwrap() - sparse.form_error_after_um.unwrap()).abs() < 1e-6);
}

#[test]
fn what_the_stations_leave_out_is_told() {
    let left_out = |stations: &Value| -> Vec<[f64; 2]> {
        let (warnings, program) = programmed(held_in_centres(stations));
        assert!(program.is_ok());
        let found = named(&warnings, "stretch_stays_uncut");
        found.iter().map(|finding| [number(finding, "from_mm"), number(finding, "to_mm")]).collect()
    };
    assert_eq!(left_out(&list(&[100.0, 450.0, 650.0])), [[0.0, 100.0], [650.0, 900.0]]);
    assert_eq!(left_out(&list(&[350.0, 450.0])), [[0.0, 300.0], [300.0, 350.0], [450.0, 600.0], [600.0, 900.0]]);
    assert!(left_out(&list(&[0.0, 900.0])).is_empty());
    assert!(left_out(&json!({ "kind": "per_zone", "count": 2 })).is_empty());
}

/// A journal that is not to be turned gets no move, whatever is set off, and leaves nothing undone: the rest of the answer stands.
#[test]
fn no_move_goes_where_nothing_is_to_be_cut() {
    let segments = json!([
        { "length_mm": 200.0, "diameter_mm": 60.0 },
        { "length_mm": 400.0, "diameter_mm": 40.0, "stock_diameter_mm": 42.0 }
    ]);
    let centres = json!([{ "kind": "centre", "z_mm": 0.0 }, { "kind": "centre", "z_mm": 600.0 }]);
    let mut of = job(&segments, &centres, "to_headstock");
    of["stations"] = list(&[50.0, 150.0, 210.0, 300.0, 400.0, 500.0, 590.0]);
    for offset_um in [15.0, -15.0] {
        of["effects"] = json!([{ "kind": "size_offset", "offset_um": offset_um }]);
        let answer = crate::support::solved(of.clone());
        let path = answer.path.as_ref().unwrap();
        assert!(path.complete && path.zones.iter().all(|zone| zone.diameter_mm < 50.0), "{path:?}");
        assert!(answer.largest_error_after_um.unwrap().abs() < 3.0, "{:?}", answer.largest_error_after_um);
        for block in programmed(of.clone()).1.unwrap().blocks {
            let Block::Cut { x_diameter_mm, z_mm, .. } = block else { continue };
            assert!(x_diameter_mm < 50.0 && z_mm > -400.1, "{x_diameter_mm} {z_mm}");
        }
    }
}
