//! Programs, loaded into a machine of our own: read as text, driven over a blank that yields, and held against what the
//! answer says, and read back by the product. 100 random jobs of each calculator; `PRECUT_PROGRAMS=1000 cargo test -p precut --test programs` drives more.
#![allow(clippy::unwrap_used, clippy::panic, clippy::cast_possible_truncation, clippy::cast_sign_loss, missing_docs)]

mod machine;
mod shop;

use machine::{Done, number};
use precut::render::gcode;
use precut_calc::calculator::{Block, Calculator, Check, Failure, Finding, Program, Unwatched, Violations};
use precut_calc::deflection_compensation::DeflectionCompensation;
use precut_calc::feed_schedule::FeedSchedule;
use precut_calc::program_compensation::{Kind, ProgramCompensation};
use serde::Serialize;
use serde::de::DeserializeOwned;
use serde_json::{Value, json};
use shop::Shop;

/// Rounding of the increments and of S words, on the diameter, um.
const ROUNDED_UM: f64 = 0.3;

fn jobs() -> u64 {
    std::env::var("PRECUT_PROGRAMS").ok().and_then(|text| text.parse().ok()).unwrap_or(100)
}

/// Answer and program of a job.
fn solved<C>(job: &Value) -> (Value, Result<String, Failure>)
where
    C: Calculator,
    C::Input: DeserializeOwned + Check,
    C::Output: Serialize,
{
    let mut parsed: C::Input = serde_json::from_value(job.clone()).unwrap_or_else(|e| panic!("{e}: {job}"));
    let mut violations = Violations::default();
    parsed.check(&mut violations);
    let faults = violations.into_vec();
    assert!(faults.is_empty(), "{faults:?}: {job}");
    C::fill(&mut parsed);
    let answer = C::run(&parsed, &Unwatched).unwrap_or_else(|e| panic!("{e:?}: {job}"));
    let program = C::program(&parsed, &answer.output).unwrap().map(|program| {
        let text = gcode(&program, &[]);
        is_read_as_written(&program, &text);
        text
    });
    (serde_json::to_value(&answer.output).unwrap(), program)
}

/// The product's own reader reads every move that is written, and wonders at nothing but a tool that nobody names.
fn is_read_as_written(program: &Program, text: &str) {
    let job = json!({ "nc_program": text, "dialect": program.dialect, "mode": { "kind": "read" } });
    let job = serde_json::from_value(job).unwrap();
    let answer = ProgramCompensation::run(&job, &Unwatched).unwrap_or_else(|e| panic!("{e:?}\n{text}"));
    let is_tool = |warning: &Finding| warning.values.get("what") == Some(&"tool".into());
    assert!(answer.warnings.iter().all(is_tool), "{:?}\n{text}", answer.warnings);
    let steps = |value: f64| (value / program.increment_mm).round();
    let mut at = [None; 2];
    let mut written = Vec::new();
    for block in &program.blocks {
        let (kind, x, z) = match *block {
            Block::Rapid { x_diameter_mm, z_mm } => (Kind::Rapid, x_diameter_mm, z_mm),
            Block::Cut { x_diameter_mm, z_mm, .. } => (Kind::Line, Some(x_diameter_mm), Some(z_mm)),
            _ => continue,
        };
        let to = [x.map(steps).or(at[0]), z.map(steps).or(at[1])];
        if std::mem::replace(&mut at, to) != to {
            written.push((kind, to));
        }
    }
    let moves = answer.output.moves;
    let places = moves.x_diameter_mm.iter().zip(&moves.z_mm).map(|(x, z)| [x.map(steps), z.map(steps)]);
    let read: Vec<(Kind, [Option<f64>; 2])> = moves.kind.iter().copied().zip(places).collect();
    assert_eq!(read, written, "{text}");
}

/// Largest and smallest diameter error of a lathe's columns, um.
fn errors(shop: &Shop, lathe: &machine::Lathe) -> (f64, f64) {
    let errors = lathe.columns.iter().map(|column| 2000.0 * (column.r - shop.drawing(column.z)));
    errors.fold((f64::NEG_INFINITY, f64::INFINITY), |(high, low), error| (high.max(error), low.min(error)))
}

/// What holds of every program.
fn comes_near_nothing(shop: &Shop, done: &Done, text: &str, what: &str) {
    // Columns beside a step and the steps of Z: a few thousandths.
    assert!(
        done.inside.as_ref().is_none_or(|inside| inside.0 < 0.012),
        "{what}: {:?} of {:?}\n{}\n{text}",
        done.inside,
        shop.clearance,
        shop.job
    );
    let (x, z) = ((shop.clearance.0 / 2.0).max(0.1), shop.clearance.1.max(0.1));
    let allowed = 2.0 * (x + z) + 1.5;
    let drop = shop.segments.iter().map(|s| s.2).fold(0.0, f64::max)
        - shop.segments.iter().map(|s| s.1).fold(f64::INFINITY, f64::min);
    assert!(
        done.longest_air < allowed + drop,
        "{what}: {} mm in the air, {allowed}\n{}\n{text}",
        done.longest_air,
        shop.job
    );
    if let Some(rest) = shop.rest {
        // Between two stops the tool stays on one side, but for the leg that the stop announces.
        for leg in &done.legs {
            let passes = leg.low + 0.01 < rest && rest < leg.high - 0.01;
            assert!(!passes || leg.reason.contains("steady rest"), "{what}: {leg:?} passes the rest at {rest}\n{text}");
        }
    }
}

fn close(told: f64, found: f64, what: &str, shop: &Shop, text: &str) {
    assert!(
        (told - found).abs() <= ROUNDED_UM + 0.005 * found.abs(),
        "{what}: told {told}, found {found}\n{}\n{text}",
        shop.job
    );
}

/// X and Z of every move at the feed.
fn fed(text: &str) -> Vec<[f64; 2]> {
    let (mut at, mut fed) = ([f64::NAN; 2], Vec::new());
    for line in text.lines().filter(|line| line.starts_with("G0 ") || line.starts_with("G1 ")) {
        let feeds = line.starts_with("G1 ");
        for word in line.split(' ') {
            match word.split_at(1) {
                ("X", value) => at[0] = value.parse().unwrap(),
                ("Z", value) => at[1] = value.parse().unwrap(),
                _ => {}
            }
        }
        if feeds {
            fed.push(at);
        }
    }
    fed
}

/// Whatever effects the answer turns on by itself: the program drives the answer's path.
fn drives_the_path_of_the_answer(shop: &Shop, what: &str) {
    let mut job = shop.job.clone();
    job["include"] = json!({});
    let (answer, program) = solved::<DeflectionCompensation>(&job);
    let text = program.unwrap_or_else(|e| panic!("{what}: {e:?}\n{job}"));
    let zero = shop.lathe().zero;
    let fed = fed(&text);
    for zone in answer["path"]["zones"].as_array().unwrap() {
        let [z, x] = ["z_mm", "commanded_diameter_mm"].map(|name| zone[name].as_array().unwrap());
        for (z, x) in z.iter().zip(x) {
            let (z, x) = (number(z) - zero, number(x));
            let is_there = fed.iter().any(|at| (at[0] - x).abs() < 1e-4 && (at[1] - z).abs() < 0.0016);
            assert!(is_there, "{what}: no move to X{x} Z{z}\n{job}\n{text}");
        }
    }
}

fn compensation_does_what_it_says(seed: u64) {
    let shop = Shop::compensation(seed);
    let what = format!("compensation {seed}");
    drives_the_path_of_the_answer(&shop, &what);
    let (answer, program) = solved::<DeflectionCompensation>(&shop.job);
    let text = program.unwrap_or_else(|e| panic!("{what}: {e:?}\n{}", shop.job));
    let mut lathe = shop.lathe();
    let done = lathe.run(&text);
    comes_near_nothing(&shop, &done, &text, &what);
    let (high, low) = errors(&shop, &lathe);
    let after = &answer["after"];
    for told in [&after["largest"], &answer["proof"]["largest"]] {
        // What is not turned has no error of its own.
        close(number(&told["diameter_error_um"]).max(0.0), high.max(0.0), &format!("{what}: largest"), &shop, &text);
    }
    for told in [&after["smallest"], &answer["proof"]["smallest"]] {
        close(number(&told["diameter_error_um"]).min(0.0), low.min(0.0), &format!("{what}: smallest"), &shop, &text);
    }
    let clear = number(&answer["proof"]["rapid_clearance_mm"]);
    assert!(clear >= (shop.clearance.0 / 2.0).max(0.1).min(shop.clearance.1.max(0.1)) - 1e-6, "{what}: {clear}");
    close(
        1000.0 * number(&answer["proof"]["feed_time_min"]),
        1000.0 * done.feed_time_min,
        &format!("{what}: time"),
        &shop,
        &text,
    );
    // Every pass, at the stations: on what the last one really left.
    for (k, pass) in answer["passes"].as_array().unwrap().iter().enumerate() {
        let z = answer["stations"]["z_mm"].as_array().unwrap();
        for (z, told) in z.iter().zip(pass["produced_diameter_mm"].as_array().unwrap()) {
            let (z, told) = (number(z), number(told));
            let near = lathe.columns.iter().enumerate().filter(|(_, column)| (column.z - z).abs() < 0.3);
            let found = near.map(|(i, _)| (2.0 * done.after_pass[k][i] - told).abs()).fold(f64::INFINITY, f64::min);
            assert!(
                found == f64::INFINITY || found < 0.001,
                "{what}: pass {k} at {z}: {told} is off by {found}\n{}\n{text}",
                shop.job
            );
        }
    }
}

/// The program stops for a new edge as often as the plan changes it, and goes on where the plan says.
fn changes_the_tool_as_planned(answer: &Value, done: &Done, text: &str, what: &str) {
    let changes = answer["tool_changes"].as_array().unwrap();
    let planned: Vec<f64> =
        changes.iter().filter(|change| change["place"] != json!("between_parts")).map(|c| number(&c["z_mm"])).collect();
    let stops: Vec<usize> = (0..done.legs.len()).filter(|&k| done.legs[k].reason.contains("insert")).collect();
    assert!(planned.len() == stops.len(), "{what}: {} changes, {} stops\n{text}", planned.len(), stops.len());
    for (planned, stop) in planned.into_iter().zip(stops) {
        // Another stop may follow at once, for a rest.
        let begins = done.legs[stop..].iter().find_map(|leg| leg.begins);
        assert!(begins.is_some_and(|z| (z - planned).abs() < 0.002), "{what}: {begins:?}, not {planned}\n{text}");
    }
}

fn schedule_does_what_it_says(seed: u64) {
    let shop = Shop::schedule(seed);
    let what = format!("schedule {seed}");
    let (answer, program) = solved::<FeedSchedule>(&shop.job);
    let text = program.unwrap_or_else(|e| panic!("{what}: {e:?}\n{}", shop.job));
    let mut lathe = shop.lathe();
    let done = lathe.run(&text);
    comes_near_nothing(&shop, &done, &text, &what);
    let (high, low) = errors(&shop, &lathe);
    let proof = &answer["proof"];
    close(
        number(&proof["largest"]["diameter_error_um"]).max(0.0),
        high.max(0.0),
        &format!("{what}: largest"),
        &shop,
        &text,
    );
    close(
        number(&proof["smallest"]["diameter_error_um"]).min(0.0),
        low.min(0.0),
        &format!("{what}: smallest"),
        &shop,
        &text,
    );
    changes_the_tool_as_planned(&answer, &done, &text, &what);
    // No edge cuts for longer than it lasts.
    let life = &shop.job["models"]["tool_life"];
    let mut used = 0.0;
    for leg in &done.legs {
        if leg.reason.contains("edge") {
            used = 0.0;
        }
        for &(length, feed, rpm, speed) in &leg.cuts {
            let life = (number(&life["constant"]) - 2.0 * speed.ln() - 0.5 * feed.ln()).exp();
            used += length / (feed * rpm) / life;
        }
        assert!(used < 1.05, "{what}: an edge is used to {used}\n{}\n{text}", shop.job);
    }
}

/// Every job is tried, however many fail before it.
fn of_all_jobs(holds: fn(u64)) {
    let failed: Vec<u64> = (0..jobs()).filter(|seed| std::panic::catch_unwind(|| holds(*seed)).is_err()).collect();
    assert!(failed.is_empty(), "{} of {} jobs: {failed:?}", failed.len(), jobs());
}

#[test]
fn programs_of_compensations_do_what_the_answer_says() {
    of_all_jobs(compensation_does_what_it_says);
}

#[test]
fn programs_of_schedules_do_what_the_answer_says() {
    of_all_jobs(schedule_does_what_it_says);
}

fn case(folder: &str, name: &str) -> Value {
    let path = format!("{}/tests/cases/{folder}/{name}.json", env!("CARGO_MANIFEST_DIR"));
    serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap()
}

/// A finished seat amid stock, and a blank with a step: the command jumps there, and so does the program.
#[test]
fn the_program_jumps_where_the_blank_does() {
    for (name, largest) in [("seat-mid", 1.6), ("stepped-blank", 2.6)] {
        let (answer, program) = solved::<DeflectionCompensation>(&case("deflection-compensation", name));
        program.unwrap();
        for place in ["largest", "smallest"] {
            let error = number(&answer["proof"][place]["diameter_error_um"]);
            assert!(error.abs() < largest, "{name}: {}", answer["proof"]);
        }
        let after = number(&answer["largest_error_after_um"]);
        assert!(
            after.abs() < largest && (answer["proof"]["beside_prediction_um"].as_f64().unwrap() < 0.2),
            "{name}: {after}"
        );
    }
    // Nothing goes over the seat but in rapid motion above it.
    let (answer, _) = solved::<DeflectionCompensation>(&case("deflection-compensation", "seat-mid"));
    let zones = answer["path"]["zones"].as_array().unwrap();
    let ends: Vec<(f64, f64)> = zones
        .iter()
        .map(|zone| {
            let z = zone["z_mm"].as_array().unwrap();
            (number(&z[0]), number(z.last().unwrap()))
        })
        .collect();
    assert_eq!(ends, [(0.0, 480.0), (520.0, 1000.0)]);
}

/// Passes that are not compensated are not, and no spring cut is credited that the program does not make.
#[test]
fn what_is_predicted_is_what_is_programmed() {
    let mut job = case("deflection-compensation", "shop-08");
    let (answer, program) = solved::<DeflectionCompensation>(&job);
    let after = number(&answer["largest_error_after_um"]);
    assert!((after - 19.6).abs() < 0.2, "{after}");
    assert!((number(&answer["proof"]["largest"]["diameter_error_um"]) - after).abs() < 0.3);
    let text = program.unwrap();
    assert!(["pass 1 of 3", "pass 2 of 3", "pass 3 of 3"].iter().all(|said| text.contains(said)), "{text}");
    for pass in job["passes"].as_array_mut().unwrap() {
        pass["compensated"] = json!(false);
    }
    let (answer, program) = solved::<DeflectionCompensation>(&job);
    let zones = answer["path"]["zones"].as_array().unwrap();
    let drawn =
        |zone: &Value| zone["commanded_diameter_mm"].as_array().unwrap().iter().all(|x| *x == zone["diameter_mm"]);
    assert!(zones.iter().all(drawn), "{zones:?}");
    assert!(program.unwrap().contains(" X45.\n"));
    let (before, after) = (number(&answer["largest_error_um"]), number(&answer["largest_error_after_um"]));
    assert!((before - after).abs() < 0.1, "{before} {after}");
}

#[test]
fn no_rapid_motion_comes_near_a_finished_surface() {
    for (name, clearance) in [("fits", 2.0), ("rapid-onto-finish-1", 0.1), ("rapid-onto-finish-2", 0.1)] {
        let (answer, program) = solved::<DeflectionCompensation>(&case("deflection-compensation", name));
        let clear = number(&answer["proof"]["rapid_clearance_mm"]);
        assert!(clear >= clearance - 1e-6, "{name}: {clear}\n{}", program.unwrap());
    }
}

/// The tool is changed where an edge is used up.
#[test]
fn the_edges_of_a_schedule_are_changed_in_its_program() {
    let (answer, program) = solved::<FeedSchedule>(&case("feed-schedule", "three-edges-no-stop"));
    let text = program.unwrap();
    assert!(number(&answer["tool_usage"]) > 1.0 && text.lines().filter(|line| *line == "M0").count() >= 2, "{text}");
    let shaft = machine::Shaft {
        segments: vec![(50.0, 90.0), (400.0, 80.0), (300.0, 70.0), (150.0, 60.0)],
        e: 210_000.0,
        springs: [0.0; 3],
    };
    let columns = |(from, to): (f64, f64)| {
        let steps = (4.0 * (to - from)) as usize;
        (0..steps).map(move |k| from + (k as f64 + 0.4) / 4.0).map(|z| machine::Column {
            z,
            r: if z < 50.0 { 45.0 } else { 42.0 },
            w: vec![0.0],
            speed_diameter: vec![0.0],
        })
    };
    let mut lathe = machine::Lathe {
        columns: columns((0.0, 900.0)).collect(),
        force: None,
        zero: shaft.length(),
        box_mm: (1.0, 1.0),
        limit_rpm: 20_000.0,
        at_finish: true,
    };
    let done = lathe.run(&text);
    changes_the_tool_as_planned(&answer, &done, &text, "three-edges-no-stop");
}
