//! What an answer about a ring says, done: jobs from use, and random set-ups whose generator knows nothing of how the answer
//! was found. `PRECUT_RING_TRIALS` sets how many of each property; the suite takes few.
#![allow(clippy::unwrap_used, clippy::panic, clippy::print_stdout, missing_docs)]

use crate::draw::Draw;
use crate::ring_support::{as_job, ends_of_the_feed, faults, run, trials, try_run};
use precut_calc::calculator::Failure;
use precut_calc::ring_roundness::{CauseKind, Outcome, SearchStatus};
use serde_json::{Value, json};

fn case(name: &str) -> Value {
    let path =
        std::path::Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/..")).join("tests/cases/ring-roundness").join(name);
    serde_json::from_str(&std::fs::read_to_string(&path).unwrap_or_else(|e| panic!("{}: {e}", path.display()))).unwrap()
}

fn roundness_um(outcome: &Outcome) -> f64 {
    outcome.roundness_um.unwrap()
}

fn without(outcome: &Outcome, cause: CauseKind) -> Option<(f64, f64)> {
    let causes = &outcome.simulation.as_ref().unwrap().causes;
    causes.switched_off.iter().find(|c| c.cause == cause).map(|c| (c.roundness_without_um, c.share))
}

/// Located all the way, with few nodes and with many: finer ones never make it likelier that there is no answer.
#[test]
fn a_ring_that_can_lie_on_its_supports_is_located() {
    for name in [
        "nc_clear_4.json",
        "nc_clear_9.json",
        "nc_clear_11.json",
        "nc_clear_19.json",
        "nc_clear_26.json",
        "nc_clear_58.json",
        "nc_top_be20_inside0p3.json",
        "nc_top_be30_inside0p3.json",
    ] {
        for samples in [1800, 3600] {
            let mut job = case(name);
            job["samples"] = json!(samples);
            let found = roundness_um(&run(&job).output);
            assert!(found.is_finite(), "{name} {samples}: {found}");
            if name == "nc_top_be20_inside0p3.json" {
                assert!((found - 114.9).abs() < 0.2, "{samples}: {found}");
            }
        }
    }
}

/// A set-up with anything that shakes a ring: steep waves, a tool inside, small rollers, wild run-out.
fn wild(seed: u64) -> Value {
    let mut draw = Draw::new(seed);
    let radius = 10.0_f64.powf(draw.between(1.0, 2.5));
    let beta = draw.between(16.0, 65.0).to_radians();
    let roller = if draw.share() < 0.5 { 0.0 } else { radius * draw.between(0.005, 0.3) };
    let tool = draw.between(25.0, 155.0).to_radians();
    let deviation_um = 1e3 * radius * 10.0_f64.powf(draw.between(-5.0, -2.5));
    let waves: Vec<Value> = (0..3)
        .map(|_| {
            let order = 2 + draw.between(0.0, 60.0).powi(2).floor() as u32 / 60;
            json!({ "order": order, "amplitude_um": deviation_um * draw.share() / 3.0, "angle_of_max_deg": draw.between(0.0, 360.0) })
        })
        .collect();
    let inside = if draw.share() < 0.4 { draw.between(0.0, 0.02) } else { -draw.between(0.0, 0.002) } * radius;
    let reach = radius + roller;
    let effects = if draw.share() < 0.4 {
        json!([{ "kind": "roller_runout", "amplitude_mm": 10.0_f64.powf(draw.between(-3.0, -0.7)), "ratio": draw.between(0.5, 20.0), "phase_rad": 0.0 }])
    } else {
        json!([])
    };
    let tip = radius - inside;
    json!({
        "ring": { "radius_mm": radius, "harmonics": waves },
        "supports": { "distance_mm": 2.0 * reach * beta.sin(), "depth_mm": reach * beta.cos(), "roller_radius_mm": roller },
        "tool": {
            "x_mm": tip * tool.cos(), "y_mm": tip * tool.sin(),
            "feed_direction_deg": (tool.to_degrees() + 180.0).rem_euclid(360.0),
            "feed_mm_per_rev": radius * 10.0_f64.powf(draw.between(-5.0, -3.3)), "revolutions": draw.between(4.0, 20.0).round(),
            "spark_out_revolutions": 1
        },
        "compliance_ratio": if draw.share() < 0.5 { 0.0 } else { draw.between(0.1, 2.0) },
        "effects": effects,
        "samples": ([360, 720, 1800][(draw.share() * 2.99) as usize])
    })
}

#[test]
fn no_set_up_is_given_up_without_a_reason_in_mechanics() {
    for seed in 0..trials(30) {
        let job = wild(seed);
        if !faults(&job).is_empty() {
            continue;
        }
        match try_run(&job) {
            Ok(answer) => assert!(roundness_um(&answer.output).is_finite(), "{seed}"),
            Err(Failure::Infeasible(finding)) => {
                assert!(["nothing_cut", "ring_falls_in_run"].contains(&finding.code), "{seed}: {finding:?}");
            }
            Err(other) => panic!("{seed}: {other} {job}"),
        }
    }
}

#[test]
fn sections_of_pure_lobes_are_evaluated() {
    for name in ["four-lobes-r25-50um.json", "four-lobes-r50-5um.json"] {
        let answer = run(&case(name));
        let blank = &answer.output.simulation.as_ref().unwrap().start;
        let lobes_um = case(name)["ring"]["harmonics"][0]["amplitude_um"].as_f64().unwrap();
        // Four lobes of amplitude A are 2 A wide about every circle.
        for found in [
            blank.unfiltered.least_squares_um,
            blank.unfiltered.minimum_zone_um,
            blank.unfiltered.inscribed_um,
            blank.unfiltered.circumscribed_um,
        ] {
            assert!((found - 2.0 * lobes_um).abs() < 1e-3 * lobes_um, "{name}: {found}");
        }
    }
}

#[test]
fn the_search_finds_the_setting_beyond_opposite() {
    let job = case("search-beyond-opposite.json");
    let search = run(&job).output.settings_search.unwrap();
    let best = search.best.unwrap();
    assert!(matches!(search.status, SearchStatus::Robust | SearchStatus::Fragile), "{search:?}");
    assert!(search.simulated > 0 && best.margin_um > 2.0 && best.roundness_um < 0.5, "{best:?}");
    // Done, it gives what it promises.
    let found = run(&as_job(&job, &best)).output;
    assert!((roundness_um(&found) - best.roundness_um).abs() < 1e-3 + best.roundness_error_um, "{best:?} {found:?}");
    // What is said of the robustness comes about as often.
    let mut met = 0;
    let count = 40;
    for i in 0..count {
        let mut draw = Draw::new(1000 + i);
        let (tool, support) = (draw.between(-0.5, 0.5).to_radians(), draw.between(-0.5, 0.5).to_radians());
        let mut off = as_job(&job, &best);
        // Turned about the ring's centre at the end; the supports spread or closed.
        let half_angle = best.support_half_angle_deg.to_radians() + support;
        let reach = 0.5 * best.support_distance_mm / best.support_half_angle_deg.to_radians().sin();
        off["supports"]["distance_mm"] = json!(2.0 * reach * half_angle.sin());
        let centre_y = -best.support_depth_mm + reach * best.support_half_angle_deg.to_radians().cos();
        off["supports"]["depth_mm"] = json!(reach * half_angle.cos() - centre_y);
        let (x, y) = (best.tool_x_mm, best.tool_y_mm - centre_y);
        off["tool"]["x_mm"] = json!(x * tool.cos() - y * tool.sin());
        off["tool"]["y_mm"] = json!(centre_y + x * tool.sin() + y * tool.cos());
        off["tool"]["feed_direction_deg"] = json!(best.feed_direction_deg + tool.to_degrees());
        off["samples"] = json!(720);
        met += u32::from(roundness_um(&run(&off).output) <= 3.0);
    }
    let share = f64::from(met) / 40.0;
    assert!((share - best.robust_share).abs() < 0.25, "{share} against {}", best.robust_share);
}

#[test]
fn a_target_reached_is_reached_by_the_job_that_is_advised() {
    let mut met = 0;
    for seed in 0..trials(3) {
        let mut draw = Draw::new(500 + seed);
        let radius = draw.between(30.0, 120.0);
        let beta = draw.between(30.0, 50.0).to_radians();
        let job = json!({
            "ring": { "radius_mm": radius, "harmonics": [
                { "order": 2, "amplitude_um": draw.between(5.0, 40.0) },
                { "order": 3, "amplitude_um": draw.between(0.0, 15.0), "angle_of_max_deg": draw.between(0.0, 360.0) }
            ] },
            "supports": { "distance_mm": 2.0 * radius * beta.sin(), "depth_mm": radius * beta.cos() },
            "tool": { "x_mm": radius * beta.sin(), "y_mm": radius * beta.cos() + 0.1, "feed_mm_per_rev": 0.01, "revolutions": 40 },
            "compliance_ratio": draw.between(0.0, 1.0), "samples": 1440,
            "analyses": ["settings_search"],
            "settings_search": {
                "target_um": draw.between(2.0, 6.0), "revolutions_max": 300, "compliance_ratio_max": draw.between(1.0, 3.0)
            }
        });
        let search = run(&job).output.settings_search.unwrap();
        let best = search.best.unwrap();
        let found = roundness_um(&run(&as_job(&job, &best)).output);
        assert!((found - best.roundness_um).abs() <= best.roundness_error_um + 0.02, "{seed}: {found} {best:?}");
        let target = job["settings_search"]["target_um"].as_f64().unwrap();
        let reached = matches!(search.status, SearchStatus::Robust | SearchStatus::Fragile);
        met += u32::from(reached);
        assert_eq!(
            reached,
            best.roundness_um + best.roundness_error_um <= target,
            "{seed}: {:?} {best:?}",
            search.status
        );
    }
    println!("{met} targets of {} met", trials(3));
}

/// Freer limits never make the answer worse: what is reached in few revolutions is reached where more are allowed, too.
#[test]
fn a_larger_range_of_revolutions_loses_no_setting() {
    let job = |revolutions_max: u32| {
        json!({
            "ring": { "radius_mm": 150, "harmonics": [{ "order": 3, "amplitude_um": 50 }] },
            "supports": { "distance_mm": 200, "depth_mm": 111 },
            "tool": { "x_mm": 100, "y_mm": 112.5, "feed_mm_per_rev": 0.005_859_375, "revolutions": 256 },
            "analyses": ["settings_search"],
            "settings_search": {
                "target_um": 5, "clearance_mm": 0.3, "allowance_mm": 0.5, "revolutions_max": revolutions_max
            }
        })
    };
    let [few, more] = [100, 300].map(|most| run(&job(most)).output.settings_search.unwrap());
    assert_eq!([few.status, more.status], [SearchStatus::Robust; 2]);
    assert!(more.best.unwrap().robust_share >= 0.9, "{:?}", more.best);
}

/// A number of revolutions in a cell of the map, driven.
#[test]
fn a_cell_with_a_number_of_revolutions_comes_to_the_target() {
    let mut job = case("map-revolutions-to-target.json");
    job["setup_map"]["tool_angles"] = json!(29);
    job["setup_map"]["support_angles"] = json!(16);
    let map = run(&job).output.setup_map.unwrap();
    let columns = map.tool_angle_deg.len();
    let mut numbered = 0;
    for (i, revolutions) in map.revolutions_to_target.iter().enumerate() {
        let Some(revolutions) = *revolutions else { continue };
        numbered += 1;
        // No wave grows there.
        assert!(map.worst_factor_per_revolution[i].is_none_or(|factor| factor <= 1.0 + 1e-6), "{i}");
        if numbered % 5 != 1 {
            continue;
        }
        let (tool, beta) =
            (map.tool_angle_deg[i % columns].to_radians(), map.support_half_angle_deg[i / columns].to_radians());
        // From just clear of the blank (49 um of waves), so far that the angles are those of the cell at the end, to
        // which the ring has sunk between its supports.
        let (mut cell, revolutions) = (job.clone(), revolutions + 15.0);
        cell["analyses"] = json!(["simulation"]);
        cell["samples"] = json!(1440);
        let depth = 32.0;
        let travel = 0.004 * revolutions;
        let (start, end, half) = ends_of_the_feed(45.06, travel, beta, tool, depth);
        cell["supports"] = json!({ "distance_mm": 2.0 * half, "depth_mm": depth });
        cell["tool"] = json!({
            "x_mm": start[0], "y_mm": start[1],
            "feed_direction_deg": (end[1] - start[1]).atan2(end[0] - start[0]).to_degrees(),
            "feed_mm_per_rev": 0.004, "revolutions": revolutions, "spark_out_revolutions": 3
        });
        let found = roundness_um(&run(&cell).output);
        assert!(found <= 1.2 * 3.0, "cell {i}: {found} um after {revolutions} revolutions");
    }
    assert!(numbered > 3, "{numbered} cells have a number");
}

#[test]
fn the_run_out_that_the_job_states_is_the_cause() {
    let job = case("roller-runout-as-effect.json");
    let answer = run(&job);
    let (without_um, share) = without(&answer.output, CauseKind::Effect).unwrap();
    assert!(share > 0.8 && without_um < 0.4, "{without_um} {share}");
    let codes: Vec<&str> = answer.explanation.iter().map(|message| message.code).collect();
    assert!(codes.contains(&"without_it") && !codes.contains(&"growing_waves"), "{codes:?}");
    // Done: the job without it.
    let mut quiet = job;
    quiet["effects"] = json!([]);
    let found = roundness_um(&run(&quiet).output);
    assert!((found - without_um).abs() < 0.05, "{found} {without_um}");
}

/// The blank's three lobes are the cause opposite to a support and a little off it alike.
#[test]
fn a_cause_does_not_vanish_a_hair_off_the_line() {
    let mut shares = Vec::new();
    for off_deg in [0.0_f64, 0.02, 0.1, 0.5] {
        let mut job = case("why-three-lobes.json");
        let angle = 45.0_f64 + off_deg;
        let tip = 31.95_f64.hypot(31.82);
        job["tool"]["x_mm"] = json!(tip * angle.to_radians().cos());
        job["tool"]["y_mm"] = json!(tip * angle.to_radians().sin());
        job["samples"] = json!(1440);
        let answer = run(&job);
        let (_, share) = without(&answer.output, CauseKind::BlankOddWaves).unwrap();
        let told = answer.explanation.iter().any(|message| {
            message.code == "without_it" && message.values.get("cause") == Some(&"blank_odd_waves".into())
        });
        assert!(told && share > 0.3, "{off_deg}: {share}");
        let growing = answer.output.linear_theory.unwrap().orders.iter().filter(|o| o.fate.name() == "grows").count();
        let says_growth = answer.explanation.iter().any(|m| ["off_the_diameter", "growing_waves"].contains(&m.code));
        assert!(growing > 0 || !says_growth, "{off_deg}: none of the orders grows");
        shares.push(share);
    }
    assert!(shares.windows(2).all(|pair| (pair[1] - pair[0]).abs() < 0.25), "{shares:?}");
}

/// Opposite to a support, waves of the blank and a coarse feed: every cause that is named goes away with its term.
#[test]
fn what_is_switched_off_is_what_the_job_without_it_gives() {
    let mut tried = 0;
    for seed in 0..trials(6) {
        let mut draw = Draw::new(90 + seed);
        let radius = draw.between(30.0, 150.0);
        let beta = draw.between(30.0, 50.0).to_radians();
        let height = radius * beta.cos();
        let job = json!({
            "ring": { "radius_mm": radius, "harmonics": [
                { "order": 2, "amplitude_um": draw.between(5.0, 40.0) },
                { "order": 3, "amplitude_um": draw.between(0.0, 10.0), "angle_of_max_deg": draw.between(0.0, 360.0) }
            ] },
            "supports": { "distance_mm": 2.0 * radius * beta.sin(), "depth_mm": height },
            "tool": {
                "x_mm": radius * beta.sin(), "y_mm": height + 0.12, "feed_mm_per_rev": draw.between(0.004, 0.03),
                "revolutions": 40, "spark_out_revolutions": draw.between(0.0, 2.0).floor()
            },
            "compliance_ratio": draw.between(0.1, 1.0), "samples": 1440,
            "effects": [{ "kind": "chatter_harmonic", "amplitude_mm": draw.between(0.0, 0.003), "waves_per_revolution": 7 }]
        });
        let outcome = run(&job).output;
        let mut rigid = job.clone();
        rigid["compliance_ratio"] = json!(0);
        let mut quiet = job.clone();
        quiet["effects"] = json!([]);
        let mut longer = job.clone();
        let spark = job["tool"]["spark_out_revolutions"].as_f64().unwrap();
        longer["tool"]["spark_out_revolutions"] = json!(spark + 3.0);
        let mut finer = job.clone();
        finer["tool"]["feed_mm_per_rev"] = json!(0.5 * job["tool"]["feed_mm_per_rev"].as_f64().unwrap());
        finer["tool"]["revolutions"] = json!(80);
        let blank_of = |wave: usize| {
            let mut job = job.clone();
            job["ring"]["harmonics"] = json!([job["ring"]["harmonics"][wave]]);
            job
        };
        for (cause, changed) in [
            (CauseKind::Compliance, rigid),
            (CauseKind::Effect, quiet),
            (CauseKind::SparkOutMissing, longer),
            (CauseKind::Feed, finer),
            (CauseKind::BlankOddWaves, blank_of(0)),
            (CauseKind::BlankEvenWaves, blank_of(1)),
        ] {
            let (without_um, _) = without(&outcome, cause).unwrap();
            let found = roundness_um(&run(&changed).output);
            assert!((found - without_um).abs() < 0.05 + 0.03 * found, "{seed} {cause:?}: {found} against {without_um}");
            tried += 1;
        }
    }
    println!("{tried} causes switched off");
}

/// A tool beside the line through support and centre, turned onto it about the ring's centre; a start inside the blank, moved
/// back as far as the answer says.
#[test]
fn a_tool_off_the_line_and_a_first_bite_go_away_as_told() {
    let (mut turned, mut moved) = (0, 0);
    for seed in 0..trials(4) {
        let mut draw = Draw::new(190 + seed);
        let (radius, depth) = (draw.between(30.0, 150.0), 30.0);
        let (beta, off) = (draw.between(30.0, 45.0).to_radians(), draw.between(1.0, 12.0).to_radians());
        let (feed, revolutions) = (draw.between(0.004, 0.02), 40.0);
        let opposite = 0.25 * std::f64::consts::TAU - beta;
        let waves = json!([{ "order": 2, "amplitude_um": draw.between(5.0, 30.0) }]);
        let job = |start: [f64; 2], end: [f64; 2], half: f64| {
            json!({
                "ring": { "radius_mm": radius, "harmonics": waves },
                "supports": { "distance_mm": 2.0 * half, "depth_mm": depth },
                "tool": {
                    "x_mm": start[0], "y_mm": start[1], "feed_mm_per_rev": feed, "revolutions": revolutions,
                    "feed_direction_deg": (end[1] - start[1]).atan2(end[0] - start[0]).to_degrees(), "spark_out_revolutions": 1
                },
                "compliance_ratio": 0.3, "samples": 1440
            })
        };
        let (start, end, half) = ends_of_the_feed(radius + 0.06, feed * revolutions, beta, opposite + off, depth);
        let beside = run(&job(start, end, half)).output;
        let (without_um, _) = without(&beside, CauseKind::ToolOffLine).unwrap();
        let centre_y = (beside.setting.circumradius_mm.powi(2) - half * half).sqrt() - depth;
        let back = |[x, y]: [f64; 2]| {
            let (sin, cos) = (-off).sin_cos();
            [x * cos - (y - centre_y) * sin, centre_y + x * sin + (y - centre_y) * cos]
        };
        let found = roundness_um(&run(&job(back(start), back(end), half)).output);
        assert!((found - without_um).abs() < 0.05 + 0.03 * found, "{seed}: {found} against {without_um}");
        turned += 1;

        let (start, end, half) = ends_of_the_feed(radius - 0.02, feed * revolutions, beta, opposite, depth);
        let inside = job(start, end, half);
        let answer = run(&inside);
        let Some(said) = answer.explanation.iter().find(|message| message.code == "start_clear") else { continue };
        let Some(precut_calc::calculator::Value::Number(back_mm)) = said.values.get("back_mm") else {
            panic!("{said:?}")
        };
        let (without_um, _) = without(&answer.output, CauseKind::FirstBite).unwrap();
        let mut clear = inside.clone();
        let along = |axis: usize| (end[axis] - start[axis]) / (feed * revolutions);
        clear["tool"]["x_mm"] = json!(start[0] - back_mm * along(0));
        clear["tool"]["y_mm"] = json!(start[1] - back_mm * along(1));
        clear["tool"]["revolutions"] = json!(revolutions + back_mm / feed);
        let found = roundness_um(&run(&clear).output);
        assert!((found - without_um).abs() < 0.05 + 0.03 * found, "{seed}: {found} against {without_um}");
        moved += 1;
    }
    assert!(moved > 0);
    println!("{turned} tools turned onto the line, {moved} starts moved back");
}

#[test]
fn more_friction_than_can_be_relied_on_is_warned_of() {
    let mut job = case("four-lobes-r50-5um.json");
    job["samples"] = json!(720);
    let slips = |job: &Value| run(job).warnings.iter().any(|warning| warning.code == "ring_slips");
    job["forces"] = json!({ "thrust_n": 400, "cutting_n": 300, "weight_n": 200, "drive": "rollers" });
    let needed = run(&job).output.setting.reactions.unwrap().friction_needed.unwrap();
    for (available, expected) in [(needed * 1.001, false), (needed * 0.999, true)] {
        job["forces"]["friction_available"] = json!(available);
        assert_eq!(slips(&job), expected, "{needed}");
    }
}
