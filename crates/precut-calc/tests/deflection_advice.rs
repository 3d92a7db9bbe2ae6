//! What is advised and warned of besides the numbers: one more rest, rests that never touch.
#![allow(clippy::unwrap_used, clippy::panic, missing_docs)]

use crate::support::prepared;
use precut_calc::calculator::{Answer, Calculator, Finding, Item, Message, Unwatched, Value as Said};
use precut_calc::deflection_compensation::{DeflectionCompensation, Outcome};
use serde_json::{Value, json};

fn answer(job: Value) -> Answer<Outcome> {
    DeflectionCompensation::run(&prepared(job), &Unwatched).unwrap()
}

fn job(supports: &Value) -> Value {
    json!({
        "shaft": {
            "segments": [{ "length_mm": 800.0, "diameter_mm": 40.0, "stock_diameter_mm": 42.0 }],
            "youngs_modulus_n_per_mm2": 210_000.0
        },
        "supports": supports,
        "force": { "kind": "constant", "passive_n": 200.0 },
        "cut": { "feed_mm_per_rev": 0.2, "speed_m_per_min": 100.0 }
    })
}

fn centres(compliance_um_per_n: f64) -> Value {
    let centre = |z: f64| json!({ "kind": "centre", "z_mm": z, "compliance_um_per_n": compliance_um_per_n });
    json!([centre(0.0), centre(800.0)])
}

fn advised(answer: &Answer<Outcome>) -> Option<&Message> {
    answer.explanation.iter().find(|message| message.code == "one_more_rest_buys")
}

#[test]
fn one_more_rest_is_advised_with_the_compliance_that_its_figure_is_for() {
    for compliance in [0.0, 0.02] {
        let answer = answer(job(&centres(compliance)));
        let message = advised(&answer).unwrap();
        assert_eq!(message.values.get("compliance_um_per_n"), Some(&Said::from(compliance)));
    }
}

/// What the rest that is tried would take away from the form error.
fn gain_um(answer: &Answer<Outcome>) -> f64 {
    let rest = answer.output.one_more_rest.as_ref().unwrap();
    answer.output.form_error_um.unwrap() - rest.form_error_um
}

/// Nothing is advised that makes the form worse, or better by less than matters.
#[test]
fn one_more_rest_is_not_advised_where_it_is_not_worth_it() {
    // Ends about as soft as the middle of the shaft: held in the middle it comes out as a saddle.
    let soft = answer(job(&centres(0.65)));
    assert!(gain_um(&soft) < -1.0, "{:?}", soft.output.one_more_rest);
    assert_eq!(advised(&soft), None);
    // A stout shaft: all that could be gained is below a step of the control.
    let mut stout = job(&centres(0.0));
    stout["shaft"]["segments"][0]["diameter_mm"] = json!(300.0);
    stout["shaft"]["segments"][0]["stock_diameter_mm"] = json!(302.0);
    let stout = answer(stout);
    assert!((0.0..1.0).contains(&gain_um(&stout)), "{:?}", stout.output.one_more_rest);
    assert_eq!(advised(&stout), None);
}

fn idle(supports: &Value) -> Vec<Finding> {
    answer(job(supports)).warnings.into_iter().filter(|warning| warning.code == "rest_never_touches").collect()
}

fn with(rest: Value) -> Value {
    let mut supports = centres(0.0);
    supports.as_array_mut().unwrap().push(rest);
    supports
}

#[test]
fn a_rest_that_never_touches_the_shaft_is_warned_of() {
    let follow = |offset_mm: f64, one_sided: bool, gap_um: f64| json!({ "kind": "follow_rest", "offset_mm": offset_mm, "one_sided": one_sided, "gap_um": gap_um });
    for (rest, pointer, cause) in [
        (follow(900.0, false, 0.0), "/supports/2/offset_mm", "place"),
        (follow(-900.0, true, 10.0), "/supports/2/offset_mm", "place"),
        (follow(15.0, true, 50_000.0), "/supports/2/gap_um", "gap"),
        (
            json!({ "kind": "steady_rest", "z_mm": 300.0, "one_sided": true, "gap_um": 50_000.0 }),
            "/supports/2/gap_um",
            "gap",
        ),
    ] {
        let found = idle(&with(rest.clone()));
        let [finding] = &found[..] else { panic!("{rest}: {found:?}") };
        assert_eq!((finding.pointer.as_str(), finding.values.get("cause")), (pointer, Some(&Said::from(cause))));
        assert!(finding.value.is_some() && finding.unit.is_some());
    }
    for rest in [
        follow(15.0, false, 0.0),
        follow(790.0, false, 0.0),
        follow(15.0, true, 10.0),
        json!({ "kind": "steady_rest", "z_mm": 300.0, "one_sided": true, "gap_um": 10.0 }),
    ] {
        assert_eq!(idle(&with(rest.clone())), [], "{rest}");
    }
}

fn number(values: &precut_calc::calculator::Values, name: &str) -> f64 {
    match values.get(name) {
        Some(Said::Number(number)) => *number,
        other => panic!("{name} is {other:?}"),
    }
}

/// A long shaft, thin for its weight.
fn heavy(angle_deg: f64, passive_n: f64) -> Value {
    let mut job = job(&centres(0.02));
    job["shaft"]["segments"][0]["length_mm"] = json!(2000.0);
    job["supports"][1]["z_mm"] = json!(2000.0);
    job["include"] = json!({ "weight": true });
    job["gravity"] = json!({ "angle_deg": angle_deg });
    job["force"]["passive_n"] = json!(passive_n);
    job
}

/// Sag toward the tool makes the shaft thin: what is named is the deviation of larger size, as in the answer.
#[test]
fn the_largest_deviation_is_the_largest_in_size() {
    let answer = answer(heavy(180.0, 5.0));
    let largest = answer.output.largest_error_um.unwrap();
    assert!(largest < -100.0, "{largest}");
    let said = answer.explanation.iter().find(|message| message.code == "nominal_path_leaves").unwrap();
    assert!((number(&said.values, "largest_error_um") - largest).abs() < 1e-9, "{said:?}");
    assert!((number(&said.values, "z_mm") - 1000.0).abs() < 1e-9, "{said:?}");
}

fn dominates(job: Value) -> Message {
    let found: Vec<Message> =
        answer(job).explanation.into_iter().filter(|message| message.code.ends_with("_dominates")).collect();
    let [one] = &found[..] else { panic!("{found:?}") };
    one.clone()
}

/// The shares are those of the compliance: they tell nothing of what no passive force makes.
#[test]
fn what_dominates_is_what_opens_the_gap_most() {
    assert_eq!(dominates(job(&centres(0.001))).code, "work_dominates");
    assert_eq!(dominates(heavy(-45.0, 2000.0)).code, "work_dominates");
    let sag = dominates(heavy(-45.0, 5.0));
    assert_eq!(sag.code, "weight_dominates");
    let (part, force, all) =
        (number(&sag.values, "part_um"), number(&sag.values, "force_um"), number(&sag.values, "deflection_um"));
    assert!((part + force - all).abs() < 1e-9 * all && part > 5.0 * force, "{sag:?}");
    let mut offset = job(&centres(0.0));
    offset["effects"] = json!([{ "kind": "tailstock_offset", "offset_um": 5000.0 }]);
    assert_eq!(dominates(offset).code, "offset_dominates");
    let gap = json!({ "kind": "steady_rest", "z_mm": 400.0, "one_sided": true, "gap_um": 30.0 });
    let held = dominates(job(&with(gap)));
    assert_eq!(held.code, "offset_dominates", "{held:?}");
    let mut couple = job(&centres(0.0));
    couple["force"] = json!({ "kind": "constant", "passive_n": 1.0, "main_n": 100.0, "feed_n": 3000.0 });
    couple["include"] = json!({ "axial_moment": true });
    assert_eq!(dominates(couple).code, "couple_dominates");
}

fn warned(job: Value, code: &str) -> Option<Finding> {
    answer(job).warnings.into_iter().find(|warning| warning.code == code)
}

/// Half of the tolerance of size to either side.
#[test]
fn a_missed_tolerance_of_size_is_warned_of() {
    let mut coarse = job(&centres(0.02));
    coarse["path"] = json!({ "chord_tolerance_um": 5.0 });
    let left = answer(coarse.clone()).output.largest_error_after_um.unwrap().abs();
    assert!(left > 1.0, "{left}");
    for (share, missed) in [(1.99, true), (2.01, false)] {
        coarse["tolerance"] = json!({ "diameter_um": share * left });
        let found = warned(coarse.clone(), "size_tolerance_missed");
        assert_eq!(found.is_some(), missed, "{share}");
        assert!(found.is_none_or(|found| found.pointer == "/tolerance/diameter_um" && found.value == Some(left)));
    }
}

/// The program lets the control go no faster than its limit; forces and time are those of the speed that was asked for.
#[test]
fn a_spindle_limit_that_binds_is_warned_of() {
    let mut thin = job(&centres(0.02));
    thin["shaft"]["segments"][0]["diameter_mm"] = json!(30.0);
    let needed = 1000.0 * 100.0 / (std::f64::consts::PI * 30.0);
    for (limit, binds) in [(0.99 * needed, true), (1.01 * needed, false)] {
        thin["program"] = json!({ "spindle_limit_rpm": limit });
        let found = warned(thin.clone(), "spindle_limit_binds");
        assert_eq!(found.is_some(), binds, "{limit}");
        let Some(found) = found else { continue };
        assert!((found.value.unwrap() - needed).abs() < 1e-9 && found.limit == Some(limit), "{found:?}");
        assert!((number(&found.values, "left_m_per_min") - 99.0).abs() < 1e-9, "{found:?}");
    }
    thin["program"] = json!({ "spindle_limit_rpm": 10.0 });
    thin["cut"] = json!({ "feed_mm_per_rev": 0.2, "spindle_speed_rpm": 1000.0 });
    assert_eq!(warned(thin, "spindle_limit_binds"), None);
}

/// One more rest holds the shaft in every pass, so the last one finds a straighter stock.
#[test]
fn one_more_rest_is_tried_in_all_passes() {
    let mut passes = job(&centres(0.02));
    passes["force"] = json!({ "kind": "power_law", "passive": { "coefficient": 2430.0, "depth_exponent": 0.9, "feed_exponent": 0.6, "speed_exponent": -0.3 } });
    passes["passes"] = json!([{ "diameter_mm": 40.5 }, { "diameter_mm": 40.0 }]);
    let tried = answer(passes.clone()).output.one_more_rest.unwrap();
    let rest = json!({ "kind": "steady_rest", "z_mm": tried.z_mm, "compliance_um_per_n": tried.compliance_um_per_n });
    passes["supports"].as_array_mut().unwrap().push(rest);
    let held = answer(passes).output.form_error_um.unwrap();
    // At 65 stations of 201.
    assert!((tried.form_error_um - held).abs() < 1e-2 * held, "{} {held}", tried.form_error_um);
}

/// Between three stations nobody sees what a rest leaves.
#[test]
fn of_a_few_stations_no_rest_is_advised() {
    let mut few = job(&centres(0.02));
    few["stations"] = json!({ "kind": "list", "z_mm": [0.0, 150.0, 600.0] });
    assert!(answer(few.clone()).output.one_more_rest.is_none());
    few["stations"] = json!({ "kind": "per_zone", "count": 9 });
    assert!(answer(few).output.one_more_rest.is_some());
}

/// M = P l/4 in the middle however soft the tailstock is, though the shaft yields most at its end then; with the main force
/// the moment is that of both.
#[test]
fn bending_stress_is_that_of_the_largest_moment() {
    let stress = |main_n: f64, tailstock: f64| {
        let mut job = job(&centres(0.0));
        job["supports"][1]["compliance_um_per_n"] = json!(tailstock);
        job["force"]["main_n"] = json!(main_n);
        job["shaft"]["yield_strength_n_per_mm2"] = json!(1.0);
        warned(job, "bending_stress_high").unwrap().value.unwrap()
    };
    let expected = |force_n: f64| force_n * 800.0 / 4.0 * 32.0 / (std::f64::consts::PI * 40.0_f64.powi(3));
    for tailstock in [0.0, 5.0] {
        assert!((stress(0.0, tailstock) / expected(200.0) - 1.0).abs() < 1e-9);
        assert!((stress(480.0, tailstock) / expected(520.0) - 1.0).abs() < 1e-9);
    }
}

#[test]
fn a_soft_tool_makes_no_form_error_only_where_the_force_is_even() {
    let said = |deeper: bool| {
        let mut job = job(&json!([{ "kind": "chuck", "z_mm": 0.0 }, { "kind": "chuck", "z_mm": 800.0 }]));
        job["carriage"] = json!({ "compliance_um_per_n": 5.0 });
        let half = |stock: f64| json!({ "length_mm": 400.0, "diameter_mm": 40.0, "stock_diameter_mm": stock });
        job["shaft"]["segments"] = json!([half(42.0), half(if deeper { 46.0 } else { 42.0 })]);
        job["force"] = json!({ "kind": "power_law", "passive": { "coefficient": 100.0, "depth_exponent": 1.0, "feed_exponent": 0.0, "speed_exponent": 0.0 } });
        dominates(job)
    };
    for deeper in [false, true] {
        let said = said(deeper);
        let even = number(&said.values, "even") > 0.5;
        assert_eq!((said.code, even), ("tool_dominates", !deeper));
    }
}

#[test]
fn where_nothing_yields_nobody_is_blamed() {
    let mut rigid = job(&centres(0.0));
    rigid["force"]["passive_n"] = json!(200.0);
    rigid["shaft"]["segments"][0] = json!({ "length_mm": 1e-3, "diameter_mm": 40.0, "stock_diameter_mm": 42.0 });
    rigid["supports"] = json!([{ "kind": "chuck", "z_mm": 0.0 }, { "kind": "chuck", "z_mm": 1e-3 }]);
    rigid["stations"] = json!({ "kind": "list", "z_mm": [0.0, 1e-3] });
    let said = answer(rigid).explanation;
    assert!(said.iter().any(|message| message.code == "nothing_yields"), "{said:?}");
}

/// What the first of two passes does to insert, shaft and spindle is told with its number.
#[test]
fn passes_before_the_last_are_looked_at_too() {
    let mut of = job(&centres(0.02));
    of["shaft"]["segments"][0]["stock_diameter_mm"] = json!(46.0);
    of["shaft"]["yield_strength_n_per_mm2"] = json!(1.0);
    of["force"] = json!({
        "kind": "power_law", "passive": { "coefficient": 800.0, "depth_exponent": 0.9, "feed_exponent": 0.0, "speed_exponent": 0.0 },
        "measured_range": {
            "least_depth_mm": 0.1, "largest_depth_mm": 2.0, "least_feed_mm_per_rev": 0.01, "largest_feed_mm_per_rev": 1.0,
            "least_speed_m_per_min": 1.0, "largest_speed_m_per_min": 1000.0
        }
    });
    of["limits"] = json!({ "depth_mm": 2.0 });
    of["program"] = json!({ "spindle_limit_rpm": 900.0 });
    of["passes"] = json!([
        { "diameter_mm": 41.0, "speed_m_per_min": 200.0 }, { "diameter_mm": 40.0, "speed_m_per_min": 100.0 }
    ]);
    let of_first = |warning: &&Finding| warning.values.get("pass") == Some(&Said::Number(1.0));
    let answer = answer(of);
    let codes: Vec<&str> = answer.warnings.iter().filter(of_first).map(|warning| warning.code).collect();
    assert_eq!(codes, ["command_too_deep", "extrapolated_force_model", "spindle_limit_binds"]);
    // Both passes bend the shaft: that is told of the last one.
    let stress: Vec<&Finding> = answer.warnings.iter().filter(|w| w.code == "bending_stress_high").collect();
    assert!(matches!(stress[..], [one] if one.values.get("pass").is_none()), "{stress:?}");
    let copied = answer.explanation.iter().find(|message| message.code == "stock_is_copied").unwrap();
    let last = answer.output.passes.last().unwrap();
    let most = last.copied_so_far.iter().flatten().copied().fold(0.0, f64::max);
    assert!((number(&copied.values, "copying_factor") - most).abs() < 1e-12 && most < 0.1, "{most}");
}

/// A measured blank of which no nominal one is stated is what the first pass is planned on.
#[test]
fn passes_of_a_measured_blank_are_turned_to_their_diameters() {
    let passes = |stock: Option<f64>| {
        let mut of = job(&centres(0.02));
        let mut segment = json!({ "length_mm": 800.0, "diameter_mm": 30.0 });
        if let Some(stock) = stock {
            segment["stock_diameter_mm"] = json!(stock);
        }
        of["shaft"]["segments"] = json!([segment]);
        of["stock_profile"] = json!([{ "z_mm": 0.0, "diameter_mm": 40.0 }, { "z_mm": 800.0, "diameter_mm": 40.4 }]);
        of["passes"] = json!([36.0, 33.0, 30.0].map(|d| json!({ "diameter_mm": d, "compensated": true })));
        answer(of).output.passes
    };
    for stock in [None, Some(30.5), Some(40.0)] {
        let produced: Vec<f64> = passes(stock).iter().map(|pass| pass.diameter_error_um[0].abs()).collect();
        // The force is constant, so every command is right whatever it was planned on.
        assert!(produced.iter().all(|error| *error < 1e-6), "{stock:?} {produced:?}");
    }
}

/// A tool that is set too deep cuts with a command beyond the blank, too: t = a solves t + Y = t_c also where t_c < 0.
#[test]
fn a_command_beyond_the_blank_cuts_what_stands_towards_the_tool() {
    for force in [
        json!({ "kind": "constant", "passive_n": 5.0 }),
        json!({ "kind": "power_law", "passive": { "coefficient": 60.0, "depth_exponent": 0.9, "feed_exponent": 0.0, "speed_exponent": 0.0 } }),
    ] {
        let mut of = job(&centres(0.01));
        of["shaft"]["segments"][0]["stock_diameter_mm"] = json!(40.3);
        of["force"] = force;
        of["effects"] = json!([{ "kind": "size_offset", "offset_um": -600.0 }]);
        of["path"] = json!({ "chord_tolerance_um": 0.1, "increment_um": 0.1 });
        let answer = answer(of);
        let stations = &answer.output.stations;
        assert!(stations.commanded_diameter_mm.iter().flatten().all(|command| *command > 40.3));
        assert!(
            answer.output.largest_error_after_um.unwrap().abs() < 1.0,
            "{:?}",
            answer.output.largest_error_after_um
        );
    }
}

/// The picture of the short answer has the same computed path, and names nothing that it does not draw.
#[test]
fn the_picture_of_the_short_answer_shows_its_path_and_nothing_empty() {
    let items = |detail: &str| -> Vec<Item> {
        let mut of = job(&centres(0.02));
        of["detail"] = json!(detail);
        let job = prepared(of);
        let outcome = DeflectionCompensation::run(&job, &Unwatched).unwrap().output;
        let mut figures = DeflectionCompensation::figures(&job, &outcome);
        figures.swap_remove(0).panels.into_iter().flat_map(|panel| panel.items).collect()
    };
    let path = |items: &[Item]| items.iter().find(|i| matches!(i, Item::Line { name: "commanded_path", .. })).cloned();
    let (full, short) = (items("full"), items("profile"));
    assert!(path(&full).is_some() && path(&full) == path(&short));
    for item in short {
        let drawn = match &item {
            Item::Line { x, .. } | Item::Points { x, .. } => !x.is_empty(),
            _ => true,
        };
        assert!(drawn, "{item:?}");
    }
}
