//! What a cut asks of the spindle, against closed forms, and the depths at which it gives out.
#![allow(clippy::unwrap_used, clippy::panic, clippy::float_cmp, missing_docs)]

use std::f64::consts::{PI, TAU};

use crate::fixture_support::{checked, example, outcome, reference_job, said, solve, with};
use precut_calc::calculator::{Calculator, Item, Message, Value as Said};
use precut_calc::fixture_stability::{FirstLimit, FixtureStability, FixtureState};
use serde_json::{Value, json};

/// Closed forms in double precision: a handful of operations each.
const EXACT: f64 = 1e-12;

fn close(have: f64, want: f64, within: f64) {
    assert!((have / want - 1.0).abs() < within, "{have}, expected {want}");
}

/// A force that is linear in chip and depth takes its coefficient of every removed volume, wherever the strip lies.
#[test]
fn power_of_a_linear_law_is_the_coefficient_times_the_removal_rate() {
    let mut job = reference_job(1);
    job["force"] = json!({ "coefficient": 2500, "radial_ratio": 0.3 });
    for (width, offset) in [(50.0, 0.0), (30.0, -33.0), (20.0, 39.0), (100.0, 0.0), (150.0, 10.0)] {
        job["cut"]["width_mm"] = json!(width);
        job["cut"]["offset_mm"] = json!(offset);
        let got = outcome(&job);
        // N/mm2 times mm3/min, in kW.
        let power = 2500.0 * got.engagement.removal_rate_cm3_per_min * 1000.0 / 60.0 / 1e6;
        close(got.drive.power_kw, power, EXACT);
        close(got.drive.motor_power_kw, power, EXACT);
        close(got.drive.torque_mean_n_m, power * 1000.0 / (TAU * got.engagement.spindle_speed_rpm / 60.0), EXACT);
    }
}

/// Half a turn of sqrt(sin): sqrt(pi) Gamma(3/4)/Gamma(5/4).
#[test]
fn torque_of_a_slot_has_its_gamma_functions() {
    let (three_quarters, five_quarters) = (1.225_416_702_465_177_6, 0.906_402_477_055_477);
    let mut job = reference_job(1);
    job["force"] = json!({ "coefficient": 900, "chip_thickness_exponent": 0.5, "depth_exponent": 0.25 });
    job["cut"]["width_mm"] = json!(100);
    let got = outcome(&job);
    let (feed, depth) = (got.engagement.feed_mm_per_tooth, 3.0_f64);
    let arc = PI.sqrt() * three_quarters / five_quarters;
    let torque = 0.05 * 8.0 / TAU * 900.0 * feed.sqrt() * depth.powf(0.75) * arc;
    close(got.drive.torque_mean_n_m, torque, EXACT);
}

/// Any arc and power by the midpoint rule, teeth of unequal reach included.
#[test]
fn torque_is_the_mean_over_a_revolution() {
    let mut job = reference_job(1);
    job["force"] = json!({ "coefficient": 900, "chip_thickness_exponent": 0.3, "depth_exponent": 0.1 });
    job["cut"]["offset_mm"] = json!(12);
    job["cut"]["width_mm"] = json!(30);
    job["effects"] = json!([{ "kind": "tooth_runout", "runout_mm": 0.02 }]);
    let got = outcome(&job);
    let feed = got.engagement.feed_mm_per_tooth;
    let (entry, exit) = (((12.0 + 15.0) / 50.0_f64).acos(), ((12.0 - 15.0) / 50.0_f64).acos());
    let (mut arc, count) = (0.0, 20_000_u32);
    for i in 0..count {
        let angle = entry + (exit - entry) * (f64::from(i) + 0.5) / f64::from(count);
        arc += angle.sin().powf(0.7) * (exit - entry) / f64::from(count);
    }
    let chips = 6.0 * feed.powf(0.7) + (feed + 0.02).powf(0.7) + (feed - 0.02).powf(0.7);
    let torque = 0.05 / TAU * 900.0 * 3.0_f64.powf(0.9) * chips * arc;
    // The midpoint rule's error: the arc's cube over 24 squares of the count, 1e-10.
    close(got.drive.torque_mean_n_m, torque, 1e-9);
}

/// One tooth at a time over the top of the arc: the largest torque is that at 90 degrees.
#[test]
fn the_largest_torque_stands_where_the_chip_is_thickest() {
    let mut job = reference_job(1);
    job["cutter"]["teeth"] = json!(3);
    job["force"] = json!({ "coefficient": 900, "chip_thickness_exponent": 0.2 });
    job["cut"]["feed_mm_per_tooth"] = json!(0.08);
    let got = outcome(&job);
    // The parabola through samples a 400th of the arc apart: below 1e-8.
    close(got.drive.torque_max_n_m, 0.05 * 900.0 * 0.08_f64.powf(0.8) * 3.0, 1e-8);
    assert!(got.drive.torque_mean_n_m < got.drive.torque_max_n_m);
}

/// Torque up to a base speed, power beyond it.
fn driven(power_kw: f64) -> Value {
    let mut job = reference_job(1);
    let torque = power_kw * 1000.0 / (TAU * 400.0 / 60.0);
    job["spindle"] = json!({
        "efficiency": 0.8, "power_kw": power_kw,
        "characteristic": [
            { "spindle_speed_rpm": 200, "power_kw": 0.5 * power_kw, "torque_n_m": torque },
            { "spindle_speed_rpm": 400, "power_kw": power_kw, "torque_n_m": torque },
            { "spindle_speed_rpm": 1000, "power_kw": 2.0 * power_kw },
        ],
    });
    job
}

#[test]
fn a_characteristic_is_read_between_its_rows() {
    let at = |rpm: f64| outcome(&with(&driven(2.0), "/cut/spindle_speed_rpm", json!(rpm))).drive;
    // Straight lines between rows, never above the power that holds everywhere; a column ends with its last row.
    for (rpm, power) in
        [(150.0, 2.0), (200.0, 1.0), (250.0, 1.25), (400.0, 2.0), (700.0, 2.0), (1000.0, 2.0), (1100.0, 2.0)]
    {
        close(at(rpm).power_limit_kw.unwrap(), power, EXACT);
    }
    assert!(at(150.0).torque_limit_n_m.is_none() && at(700.0).torque_limit_n_m.is_none());
    close(at(300.0).torque_limit_n_m.unwrap(), at(400.0).torque_limit_n_m.unwrap(), EXACT);
}

#[test]
fn the_spindle_bounds_the_depth_over_the_speed() {
    let mut job = driven(0.6);
    job["force"]["depth_exponent"] = json!(0.2);
    job["analyses"] = json!(["lobes", "limits"]);
    job["lobes"] = json!({ "from_rpm": 150, "to_rpm": 900, "speeds": 31, "depth_max_mm": 8 });
    job["limits"] = json!({ "depths": 4, "speeds_rpm": [300, 700] });
    job["simulation"] = json!({ "tooth_periods": 40, "steps_per_tooth": 64 });
    let answer = solve(&job);
    let got = &answer.output;
    // What 1 mm asks at the working speed; power goes with the speed.
    let (speed, depth) = (got.engagement.spindle_speed_rpm, 3.0_f64);
    let motor_at_1_mm = got.drive.motor_power_kw / depth.powf(0.8);
    let torque_at_1_mm = got.drive.torque_mean_n_m / depth.powf(0.8);
    let boundary = &got.lobes.as_ref().unwrap().boundary;
    let (mut powers, mut torques) = (0, 0);
    for (i, &rpm) in boundary.spindle_speed_rpm.iter().enumerate() {
        let power = if rpm < 200.0 { 0.6 } else { 0.3 + 0.3 * (rpm - 200.0) / 200.0 }.min(0.6);
        let wanted = (power / (motor_at_1_mm * rpm / speed)).powf(1.25);
        match boundary.power_mm[i] {
            Some(depth) => close(depth, wanted, 1e-10),
            None => assert!(wanted > 8.0, "{rpm}"),
        }
        let wanted = (600.0 / (TAU * 400.0 / 60.0) / torque_at_1_mm).powf(1.25);
        match boundary.torque_mm[i] {
            Some(depth) => close(depth, wanted, 1e-10),
            None => assert!(!(200.0..=400.0).contains(&rpm) || wanted > 8.0, "{rpm}"),
        }
        powers += usize::from(boundary.power_mm[i].is_some());
        torques += usize::from(boundary.torque_mm[i].is_some());
    }
    assert!(powers > 20 && torques > 3, "{powers} {torques}");
    // 0.6 kW at this speed are less than what chatter leaves.
    let limits = got.limits.as_ref().unwrap();
    let power = limits.power_mm.unwrap();
    assert_eq!((limits.first, limits.first_mm), (Some(FirstLimit::Power), Some(power)));
    assert!(power < limits.chatter_mm.unwrap() && Some(power) == got.drive.power_depth_mm);
    for limit in &limits.at_speeds {
        let there = outcome(&with(&job, "/cut/spindle_speed_rpm", json!(limit.spindle_speed_rpm))).drive;
        let least = [there.power_depth_mm, there.torque_depth_mm].into_iter().flatten().reduce(f64::min);
        assert_eq!(limit.drive_mm, least);
    }
    // Better speeds are those that the spindle allows, too: what is removed there asks no more of it than it has.
    for better in &got.lobes.as_ref().unwrap().better_speeds {
        let there = outcome(&posted(&job, better.spindle_speed_rpm, better.depth_mm));
        assert!(there.verdict.drive_margin.unwrap() >= 1.0, "{better:?}");
    }
    assert!(answer.explanation.iter().any(|said| said.code == "spindle_limits_depth"));
    assert!(answer.basis.iter().any(|of| of.equation == "fixture/5.8"));
    let figures = FixtureStability::figures(&checked(&job).unwrap(), got);
    let drawn = |wanted: &str| {
        let items = figures.iter().filter(|f| f.id == "lobes").flat_map(|f| &f.panels[0].items);
        items.filter(|item| matches!(item, Item::Line { name, .. } if *name == wanted)).count()
    };
    assert_eq!((drawn("spindle_power_limit"), drawn("spindle_torque_limit")), (1, 1));
}

#[test]
fn an_overloaded_spindle_is_the_verdict() {
    let of = |power: f64| solve(&driven(power));
    let (weak, strong) = (of(0.2), of(6.0));
    let got = &weak.output;
    assert_eq!(got.verdict.state, FixtureState::SpindleOverloaded);
    let margin = got.verdict.drive_margin.unwrap();
    let torque = got.drive.torque_limit_n_m.unwrap() / got.drive.torque_mean_n_m;
    close(margin, torque.min(got.drive.power_limit_kw.unwrap() / got.drive.motor_power_kw), EXACT);
    assert!(margin < 1.0 && got.verdict.peak_to_peak_um == got.forced.peak_to_peak_um);
    let warned = |code: &str| weak.warnings.iter().any(|warning| warning.code == code);
    assert!(warned("spindle_power_exceeded") && warned("spindle_torque_exceeded"));
    assert_eq!(weak.explanation[0].code, "fixture_spindle_overloaded");
    assert_eq!(strong.output.verdict.state, FixtureState::Stable);
    assert!(strong.output.verdict.drive_margin.unwrap() > 1.0);
    assert!(strong.explanation.iter().any(|said| said.code == "spindle_suffices"));
    assert!(!strong.warnings.iter().any(|warning| warning.code.starts_with("spindle")));
    // Chatter is worse than a spindle that is too weak.
    let deep = outcome(&with(&driven(0.2), "/cut/depth_mm", json!(6)));
    assert_eq!(deep.verdict.state, FixtureState::Chatter);
    // Outside its table nothing is known but what holds everywhere.
    let fast = solve(&with(&driven(6.0), "/cut/spindle_speed_rpm", json!(1200)));
    assert!(fast.warnings.iter().any(|warning| warning.code == "spindle_speed_outside_table"));
    // Without a spindle nothing is asked, and what the cut takes is told all the same.
    let without = outcome(&reference_job(1));
    assert_eq!((without.verdict.drive_margin, without.drive.power_depth_mm), (None, None));
    close(without.drive.power_kw, got.drive.power_kw, EXACT);
}

#[test]
fn a_spindle_of_which_nothing_is_said_is_a_fault() {
    let faults = |spindle: Value| checked(&with(&reference_job(1), "/spindle", spindle)).unwrap_err();
    let one = |code: &str, pointer: &str| vec![(code.to_owned(), pointer.to_owned())];
    assert_eq!(faults(json!({})), one("spindle_without_limit", "/spindle"));
    let rows = json!({ "characteristic": [
        { "spindle_speed_rpm": 500, "power_kw": 1 }, { "spindle_speed_rpm": 400, "power_kw": 1 },
        { "spindle_speed_rpm": 600 },
    ] });
    let found = faults(rows);
    assert!(found.contains(&("spindle_row_without_limit".to_owned(), "/spindle/characteristic/2".to_owned())));
    let at = "/spindle/characteristic/1/spindle_speed_rpm".to_owned();
    assert!(found.contains(&("spindle_speeds_unordered".to_owned(), at)) && found.len() == 2, "{found:?}");
}

/// Steps that do not resolve the highest mode are said to be too few; those that are chosen are not.
#[test]
fn steps_too_coarse_for_a_mode_are_warned_of() {
    let coarse = solve(&with(&reference_job(1), "/simulation", json!({ "steps_per_tooth": 64, "tooth_periods": 40 })));
    let at = coarse.warnings.iter().find(|warning| warning.code == "simulation_too_coarse").unwrap();
    let per_tooth = coarse.output.modes[0].natural_frequency_hz / coarse.output.engagement.tooth_frequency_hz;
    close(at.value.unwrap(), 64.0 / per_tooth, EXACT);
    assert!(!solve(&reference_job(1)).warnings.iter().any(|warning| warning.code == "simulation_too_coarse"));
}

fn number(said: &Message, name: &str) -> f64 {
    match said.values.get(name) {
        Some(Said::Number(number)) => *number,
        other => panic!("{name}: {other:?}"),
    }
}

/// A speed that is advised is better by every limit that the service knows, and the cut that is advised there is a good one.
#[test]
fn an_advised_speed_keeps_its_promise() {
    // Limited by the amplitude; by chatter; with joints that harden, where nothing goes with a power of H.
    let pneumatic = with(&example("pneumatic"), "/analyses", json!(["limits", "lobes"]));
    let mut chattering = reference_job(1);
    chattering["analyses"] = json!(["limits", "lobes"]);
    chattering["lobes"] = json!({ "from_rpm": 300, "to_rpm": 1200, "speeds": 60 });
    chattering["limits"] = json!({ "depths": 4 });
    let mut hardening = with(&chattering, "/lobes", json!({ "from_rpm": 340, "to_rpm": 480, "speeds": 4 }));
    hardening["effects"] = json!([{ "kind": "contact_hardening", "cubic_per_mm2": 40.0 }]);
    let mut limited_by = Vec::new();
    for job in [pneumatic, chattering, hardening] {
        let answer = solve(&job);
        let got = &answer.output;
        let diagram = got.lobes.as_ref().unwrap();
        let here = got.engagement.removal_rate_cm3_per_min;
        let [from, to] = [0, 1].map(|end| {
            let speeds = &diagram.boundary.spindle_speed_rpm;
            if end == 0 { speeds[0] } else { *speeds.last().unwrap() }
        });
        for pair in diagram.better_speeds.windows(2) {
            assert!(pair[0].removal_rate_cm3_per_min >= pair[1].removal_rate_cm3_per_min);
        }
        for better in &diagram.better_speeds {
            assert!(better.spindle_speed_rpm > from && better.spindle_speed_rpm < to, "{better:?}");
            // As posted: the cut that is told is a good one, and removes what is told, more than here where that is allowed.
            let there = solve(&with(
                &posted(&job, better.spindle_speed_rpm, better.depth_mm),
                "/analyses",
                json!(["verdict", "clamp_force"]),
            ));
            assert_eq!(there.output.verdict.state, FixtureState::Stable, "{better:?}");
            let removed = there.output.engagement.removal_rate_cm3_per_min;
            close(removed, better.removal_rate_cm3_per_min, EXACT);
            assert!(got.verdict.state != FixtureState::Stable || removed > here, "{better:?} {here}");
            close(there.output.clamp.unwrap().least_n.unwrap(), better.clamp_force_n, 1e-9);
        }
        let Some(advice) = said(&answer, "better_speed_is") else { continue };
        let (speed, depth) = (number(advice, "spindle_speed_rpm"), number(advice, "depth_mm"));
        let there = outcome(&posted(&job, speed, depth));
        assert_eq!(there.verdict.state, FixtureState::Stable, "{advice:?}");
        assert!(there.verdict.peak_to_peak_over_feed <= 1.0 && depth <= number(advice, "limit_mm"), "{advice:?}");
        assert!(there.verdict.depth_margin.is_none_or(|margin| margin > 1.0 / 0.9), "{advice:?}");
        // It is said with the digits it has.
        let is_whole = |number: f64| (number - number.round()).abs() < 1e-6;
        assert!(is_whole(100.0 * speed) && is_whole(1000.0 * depth), "{advice:?}");
        if let Some(Said::Text(what)) = advice.values.get("what") {
            limited_by.push(what.to_string());
        }
    }
    assert!(limited_by.contains(&"amplitude".to_owned()) && limited_by.len() >= 2, "{limited_by:?}");
}

/// The same job at another speed and depth, for the verdict alone.
fn posted(job: &Value, rpm: f64, depth_mm: f64) -> Value {
    let feed = checked(job).unwrap().cut.feed_mm_per_tooth;
    let mut job = with(job, "/analyses", json!(["verdict"]));
    let cut = job["cut"].as_object_mut().unwrap();
    for other in ["speed_m_per_min", "feed_mm_per_min"] {
        cut.remove(other);
    }
    job["cut"]["spindle_speed_rpm"] = json!(rpm);
    job["cut"]["feed_mm_per_tooth"] = json!(feed);
    job["cut"]["depth_mm"] = json!(depth_mm);
    job
}

/// What a job does not ask for has no figure, and the first is one that has something.
#[test]
fn figures_without_data_are_absent() {
    let shown = |job: &Value| -> Vec<&'static str> {
        let checked = checked(job).unwrap();
        FixtureStability::figures(&checked, &outcome(job)).iter().map(|figure| figure.id).collect()
    };
    assert_eq!(shown(&example("opening")), ["oscillogram", "last_revolution", "chip"]);
    assert_eq!(shown(&example("paper")), ["oscillogram", "last_revolution", "chip", "amplitude"]);
    assert_eq!(shown(&with(&example("paper"), "/analyses", json!(["verdict"]))), [""; 0]);
}

/// The safe area ends at the lowest limit that the table has at that speed, nowhere above one, and reaches it wherever one
/// lies below what was examined.
#[test]
fn the_safe_area_ends_at_the_lowest_limit_of_the_table() {
    for name in ["lobes", "pneumatic"] {
        let job = example(name);
        let outcome = outcome(&job);
        let figures = FixtureStability::figures(&checked(&job).unwrap(), &outcome);
        let lobes = figures.iter().find(|figure| figure.id == "lobes").unwrap();
        let mut bands = lobes.panels[0].items.iter().filter_map(|item| match item {
            Item::Band { name: "safe_area", x, lower, upper, .. } => Some((x, lower, upper)),
            _ => None,
        });
        let (x, lower, upper) = bands.next_back().unwrap();
        assert!(lower.iter().all(|&depth| depth == 0.0));
        let boundary = serde_json::to_value(&outcome).unwrap()["lobes"]["boundary"].take();
        let mut reached = 0;
        for (at, (&speed, &depth)) in x.iter().zip(upper).enumerate() {
            assert_eq!(boundary["spindle_speed_rpm"][at], speed);
            let names = ["chatter_mm", "amplitude_mm", "movable_opens_mm", "fixed_opens_mm", "power_mm", "torque_mm"];
            let limits: Vec<f64> = names.iter().filter_map(|limit| boundary[limit][at].as_f64()).collect();
            assert!(limits.iter().all(|&limit| depth <= limit), "{name} at {speed}: {depth} in {limits:?}");
            let examined = boundary["depth_examined_mm"][at].as_f64().unwrap();
            assert!(depth == examined || limits.contains(&depth), "{name} at {speed}: {depth} is no limit");
            reached += usize::from(limits.contains(&depth));
        }
        assert!(reached > x.len() / 4, "{name}: {reached} limits");
    }
}
