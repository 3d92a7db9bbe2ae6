//! What a ring job may not be, what is said of it, and what must hold of every answer.
#![allow(clippy::unwrap_used, clippy::panic, missing_docs)]

use crate::ring_support::{codes, faults, run, try_run};
use precut_calc::calculator::{Calculator, Failure, Figure, Glyph, Item, Role, Unwatched, Value as Said};
use precut_calc::ring_roundness::evaluation::RoundnessEvaluation;
use precut_calc::ring_roundness::{Outcome, RingRoundness};
use serde_json::{Value, json};

fn paper() -> Value {
    serde_json::from_str(RingRoundness::META.examples[0].job).unwrap()
}

fn with(pointer: &str, value: Value) -> Value {
    let mut job = paper();
    let (parent, name) = pointer.rsplit_once('/').unwrap();
    job.pointer_mut(parent).unwrap()[name] = value;
    job
}

/// The paper's ring, a few revolutions at a coarse feed.
fn short() -> Value {
    let mut job = with("/tool/y_mm", json!(113.5));
    job["tool"]["feed_mm_per_rev"] = json!(0.08);
    job["tool"]["revolutions"] = json!(32);
    job["tool"]["spark_out_revolutions"] = json!(1);
    job["samples"] = json!(1440);
    job
}

fn points(count: u32, radius: f64) -> Value {
    (0..count)
        .map(|i| {
            let angle = 360.0 * f64::from(i) / f64::from(count);
            json!({ "angle_deg": angle, "radius_mm": radius * (1.0 + 2e-4 * (2.0 * angle.to_radians()).cos()) })
        })
        .collect()
}

fn measured(rows: Value) -> Value {
    let mut job = short();
    job.as_object_mut().unwrap().remove("ring");
    job["measured_profile"] = rows;
    job
}

#[test]
fn impossible_geometry_is_refused_at_its_field() {
    let cases = [
        (with("/supports/distance_mm", json!(310)), "ring_falls_through", "/supports/distance_mm"),
        (with("/supports/distance_mm", json!(295)), "ring_jams", "/supports/distance_mm"),
        (with("/tool/y_mm", json!(100)), "tool_too_deep", "/tool/y_mm"),
        (with("/tool/y_mm", json!(140)), "tool_out_of_reach", "/tool/revolutions"),
        (with("/tool/feed_direction_deg", json!(90)), "feed_away_from_ring", "/tool/feed_direction_deg"),
        (with("/tool/revolutions", json!(1e7)), "run_too_long", "/tool/revolutions"),
        (with("/ring/ellipticity_mm", json!(20)), "deviation_too_large", "/ring"),
        (with("/samples", json!(358)), "bad_samples", "/samples"),
        (with("/samples", json!(3602)), "bad_samples", "/samples"),
    ];
    for (job, code, at) in cases {
        let found = faults(&job);
        assert!(found.iter().any(|f| f.code == code && f.pointer == at), "{code} at {at} is not among {found:?}");
    }
    let mut below = with("/tool/y_mm", json!(-170));
    below["tool"]["x_mm"] = json!(0);
    assert!(codes(&below).contains(&"tool_below_ring"));
    let mut beside = with("/tool/y_mm", json!(-104));
    beside["tool"]["x_mm"] = json!(108);
    assert!(codes(&beside).contains(&"tool_at_support"), "{:?}", codes(&beside));
}

/// What a field alone is guilty of is its schema's to say; the rules between fields add no consequences of it.
#[test]
fn a_number_that_is_no_good_draws_no_other_faults() {
    for (pointer, value) in [
        ("/ring/radius_mm", json!(0)),
        ("/supports/distance_mm", json!(0)),
        ("/tool/feed_mm_per_rev", json!(-0.1)),
        ("/tool/revolutions", json!(0)),
    ] {
        assert_eq!(codes(&with(pointer, value)), Vec::<&str>::new(), "{pointer}");
    }
    let mut reversed = points(36, 150.0).as_array().unwrap().clone();
    reversed.reverse();
    let found = codes(&measured(json!(reversed)));
    assert!(found.iter().all(|code| *code == "angles_not_ascending"), "{found:?}");
    assert_eq!(found.len(), 35);
}

#[test]
fn a_tip_that_never_touches_is_told_the_gap() {
    // 0.9 mm clear of the largest diameter and 0.05 mm of travel.
    let mut job = with("/tool/y_mm", json!(115.7));
    job["tool"]["revolutions"] = json!(8);
    match try_run(&job) {
        Err(Failure::Infeasible(finding)) => {
            assert_eq!(finding.code, "nothing_cut");
            // The tip is vertically above B: what is left is D(T_end) less the largest diameter, nearly.
            let end: f64 = 115.7 - 8.0 * 0.005_859_375;
            let expected = ((200.0_f64.powi(2) + (end + 111.0).powi(2)).sqrt() - 300.5) * 1e3;
            assert!((finding.value.unwrap() - expected).abs() < 0.02 * expected, "{finding:?} {expected}");
        }
        other => panic!("{other:?}"),
    }
}

#[test]
fn a_profile_in_another_unit_is_suspected() {
    for (factor, unit) in [(1e3, "um"), (1e-3, "m"), (1.0 / 25.4, "inch"), (2.0, "diameter")] {
        let found = faults(&measured(points(72, 150.0 * factor)));
        let said =
            found.iter().find(|f| f.code == "profile_unit_suspected").unwrap_or_else(|| panic!("{unit}: {found:?}"));
        assert_eq!(said.values.get("unit_meant"), Some(&unit.to_owned().into()), "{unit}");
        assert_eq!(said.pointer, "/measured_profile");
    }
    assert!(codes(&with("/ring/radius_mm", json!(0.15))).contains(&"profile_unit_suspected"));
    assert!(codes(&measured(points(72, 150.0))).is_empty());
}

#[test]
fn measured_points_must_make_a_profile() {
    assert!(codes(&measured(points(12, 150.0))).contains(&"profile_too_few_points"));
    let mut rows = points(72, 150.0);
    rows.as_array_mut().unwrap().swap(3, 4);
    assert!(codes(&measured(rows)).contains(&"angles_not_ascending"));
    let mut rows = points(72, 150.0);
    rows[5]["angle_deg"] = rows[4]["angle_deg"].clone();
    assert!(codes(&measured(rows)).contains(&"duplicate_angle"));
    let mut rows = points(72, 150.0);
    rows.as_array_mut().unwrap().drain(10..18);
    let found = faults(&measured(rows));
    assert!(found.iter().any(|f| f.code == "gap_in_profile" && f.value == Some(45.0)), "{found:?}");
    let mut rows = points(72, 150.0);
    rows.as_array_mut().unwrap().drain(66..);
    assert!(codes(&measured(rows)).contains(&"gap_in_profile"));
    let mut rows = points(72, 150.0);
    rows.as_array_mut().unwrap().push(json!({ "angle_deg": 360.0, "radius_mm": 150.0 }));
    assert!(codes(&measured(rows)).contains(&"angles_overlap"));
    let radians: Value = points(72, 150.0)
        .as_array()
        .unwrap()
        .iter()
        .map(|row| json!({ "angle_deg": row["angle_deg"].as_f64().unwrap().to_radians(), "radius_mm": row["radius_mm"] }))
        .collect();
    assert!(codes(&measured(radians)).contains(&"angles_look_like_radians"));
}

#[test]
fn everything_wrong_is_said_at_once() {
    let mut job = with("/supports/distance_mm", json!(310));
    job["samples"] = json!(1001);
    job["compliance_ratio"] = json!(1);
    job["stiffness"] =
        json!({ "cut_n_per_mm": 1, "tool_n_per_mm": 1, "support_a_n_per_mm": 1, "support_b_n_per_mm": 1 });
    job["tool"]["wheel_radius_mm"] = json!(100);
    job["analyses"] = json!(["settings_search", "settings_search"]);
    job["effects"] = json!([
        { "kind": "work_slip", "slip_deg_per_rev": 0.5 },
        { "kind": "work_slip", "slip_deg_per_rev": 0.5 },
        { "kind": "initial_harmonic", "order": 3, "amplitude_mm": 0.01, "phase_rad": 0 },
        { "kind": "initial_harmonic", "order": 5, "amplitude_mm": 0.01, "phase_rad": 0 }
    ]);
    let mut found = codes(&job);
    found.sort_unstable();
    let mut expected = vec![
        "bad_samples",
        "compliance_given_twice",
        "duplicate_analysis",
        "duplicate_effect",
        "ring_falls_through",
        "search_range_missing",
        "wheel_with_compliance",
    ];
    expected.sort_unstable();
    found.retain(|code| *code != "profile_unit_suspected");
    assert_eq!(found, expected);
    let mut both = paper();
    both["measured_profile"] = points(72, 150.0);
    assert!(codes(&both).contains(&"ring_or_profile"));
    let mut nearest = paper();
    nearest["method"] = json!("nearest_samples");
    nearest["samples"] = json!(2000);
    nearest["compliance_ratio"] = json!(1);
    assert_eq!(codes(&nearest), ["bad_samples", "not_with_nearest_samples"]);
}

#[test]
fn a_tip_that_starts_inside_is_told_its_first_bite() {
    let answer = run(&paper());
    let said = answer.warnings.iter().find(|w| w.code == "tip_starts_inside").unwrap();
    // The centre rests 0.7695 mm high on the sampled ellipse: 0.02 mm inside, first bite 0.58 mm.
    assert!((said.value.unwrap() - 23.04).abs() < 0.01, "{said:?}");
    let bite = answer.output.simulation.unwrap().largest_bite_um.unwrap();
    assert!((bite - 579.8).abs() < 1.8 && said.values.get("bite_um") == Some(&bite.into()));
}

fn ron(outcome: &Outcome) -> (f64, f64) {
    (outcome.roundness_um.unwrap(), outcome.roundness_unfiltered_um.unwrap())
}

#[test]
fn the_mirror_turns_the_other_way_round() {
    let mut job = short();
    job["tool"]["x_mm"] = json!(90);
    job["tool"]["y_mm"] = json!(121);
    job["ring"]["harmonics"] = json!([{ "order": 5, "amplitude_um": 10, "angle_of_max_deg": 25 }]);
    job["effects"] = json!([{ "kind": "support_wear", "recession_um_per_rev": 0.2 }]);
    let straight = run(&job).output;
    job["rotation"] = json!("clockwise");
    job["tool"]["x_mm"] = json!(-90);
    // A wave at θ becomes one at 180° - θ.
    job["ring"]["harmonics"] = json!([{ "order": 5, "amplitude_um": 10, "angle_of_max_deg": 155 }]);
    let mirrored = run(&job).output;
    // The same sums in another order: rounding of the radius, 1e-13 of 150 mm, through 33 revolutions.
    assert!((ron(&straight).0 - ron(&mirrored).0).abs() < 1e-5);
    assert!((ron(&straight).1 - ron(&mirrored).1).abs() < 1e-5);
    assert!((straight.setting.coefficient_a - mirrored.setting.coefficient_b).abs() < 1e-12);
    assert!((straight.setting.tool_angle_deg + mirrored.setting.tool_angle_deg - 180.0).abs() < 1e-9);
    let (p, q) = (straight.simulation.unwrap(), mirrored.simulation.unwrap());
    let m = p.profile.angle_deg.len();
    for i in 0..m {
        let j = (m / 2 + m - i) % m;
        assert!((p.profile.end_radius_mm[i] - q.profile.end_radius_mm[j]).abs() < 1e-7, "{i}");
    }
}

#[test]
fn feed_is_all_that_decides_after_a_clear_start() {
    // RONt after spark-out is at most D', whatever the total depth and the ellipse.
    for (ellipticity, y, revolutions) in [(0.5, 113.5, 54.0), (0.5, 113.5, 90.0), (0.2, 113.5, 60.0)] {
        let mut job = short();
        job["ring"]["ellipticity_mm"] = json!(ellipticity);
        job["tool"]["y_mm"] = json!(y);
        job["tool"]["feed_mm_per_rev"] = json!(0.046_875);
        job["tool"]["revolutions"] = json!(revolutions);
        let answer = run(&job).output;
        let bound = answer.setting.half_turn_reduction_um;
        assert!(ron(&answer).1 <= bound && ron(&answer).1 > 0.3 * bound, "{} {bound}", ron(&answer).1);
    }
}

#[test]
fn a_measured_profile_is_the_ring_it_was_measured_on() {
    let form = run(&short()).output;
    let (long, short_axis) = (150.25_f64, 149.75_f64);
    let rows: Value = (0..180)
        .map(|i| {
            let angle = 2.0 * f64::from(i);
            let t = angle.to_radians();
            let r = long * short_axis / ((short_axis * t.cos()).powi(2) + (long * t.sin()).powi(2)).sqrt();
            json!({ "angle_deg": angle, "radius_mm": r })
        })
        .collect();
    let points = run(&measured(rows)).output;
    // The spline through points 2° apart misses the ellipse by h⁴/384 of its fourth derivative, about 1e-8 mm.
    assert!((ron(&form).0 - ron(&points).0).abs() < 1e-3);
    assert!((form.mean_radius_mm.unwrap() - points.mean_radius_mm.unwrap()).abs() < 1e-6);
}

#[test]
fn more_samples_bring_the_estimated_error_down_and_keep_within_it() {
    let at = |samples: u32| {
        let mut job = short();
        job["samples"] = json!(samples);
        run(&job).output
    };
    let (coarse, fine) = (at(720), at(5760));
    let off = (ron(&coarse).0 - ron(&fine).0).abs();
    assert!(off <= coarse.roundness_error_um.unwrap() + fine.roundness_error_um.unwrap());
    assert!(fine.roundness_error_um < coarse.roundness_error_um);
}

#[test]
fn minimum_zone_is_the_narrowest() {
    for example in RingRoundness::META.examples {
        let job: Value = serde_json::from_str(example.job).unwrap();
        let Some(simulation) = run(&job).output.simulation else { continue };
        for values in simulation.end.iter().flat_map(|end| [&end.unfiltered, &end.filtered]) {
            let least = values.least_squares_um.min(values.inscribed_um).min(values.circumscribed_um);
            assert!(values.minimum_zone_um <= least + 1e-7, "{}: {values:?}", example.id);
        }
    }
}

#[test]
fn unfiltered_values_get_the_nodes_that_teeth_need() {
    let mut job = short();
    job.as_object_mut().unwrap().remove("samples");
    job["filter"] = json!("none");
    job["tool"]["feed_mm_per_rev"] = json!(0.04);
    job["tool"]["revolutions"] = json!(64);
    let answer = run(&job);
    // N >= 12·2π max|dW/dθ|/D': the ellipse has 2e = 1 mm per rad, D' = 0.04 · 0.3715 mm.
    let needed = 12.0 * std::f64::consts::TAU * 1.0 / (0.04 * 0.3715);
    let samples = f64::from(answer.output.simulation.unwrap().samples);
    assert!(samples >= needed && samples <= needed + 800.0, "{samples} {needed}");
    job["samples"] = json!(1440);
    assert!(run(&job).warnings.iter().any(|w| w.code == "teeth_unresolved"));
}

#[test]
fn stiffness_gives_the_compliance_ratio() {
    let mut job = short();
    job["stiffness"] = json!({
        "cut_n_per_mm": 20_000, "tool_n_per_mm": 60_000, "support_a_n_per_mm": 150_000, "support_b_n_per_mm": 90_000
    });
    // Opposite to A: a = -1, b = 0.
    let found = run(&job).output.setting.compliance_ratio;
    assert!((found - 20_000.0 * (1.0 / 60_000.0 + 1.0 / 150_000.0)).abs() < 1e-9);
}

/// Kienzle's law for the job of [`short`], b = 12 mm.
fn force_law() -> Value {
    json!({ "edge_width_mm": 12, "specific_cutting_force_n_per_mm2": 2100, "cutting_exponent": 0.26,
        "specific_normal_force_n_per_mm2": 900, "normal_exponent": 0.35 })
}

#[test]
fn the_force_law_gives_what_the_job_leaves_open() {
    let mut job = short();
    job["force"] = force_law();
    job["analyses"] = json!(["simulation", "linear_theory"]);
    job["stiffness"] = json!({ "tool_n_per_mm": 60_000, "support_a_n_per_mm": 150_000, "support_b_n_per_mm": 90_000 });
    job["forces"] = json!({ "weight_n": 300 });
    let answer = run(&job);
    assert!(answer.basis.iter().any(|basis| basis.equation == "ring/4.3"));
    let by_law = answer.output;
    let cut = by_law.setting.cut_force.unwrap();
    // The closed form at h = S dR/ds.
    let h = by_law.setting.radius_per_feed * 0.08;
    let thrust = 900.0 * 12.0 * h.powf(0.65);
    for (found, expected) in [
        (cut.chip_thickness_um, 1000.0 * h),
        (cut.thrust_n, thrust),
        (cut.cutting_n, 2100.0 * 12.0 * h.powf(0.74)),
        (cut.cut_n_per_mm, 0.65 * thrust / h),
    ] {
        assert!((found / expected - 1.0).abs() < 1e-12, "{found} {expected}");
    }
    // The same job with these numbers in it.
    let mut stated = job.clone();
    stated.as_object_mut().unwrap().remove("force");
    stated["stiffness"]["cut_n_per_mm"] = json!(cut.cut_n_per_mm);
    stated["forces"] = json!({ "weight_n": 300, "thrust_n": cut.thrust_n, "cutting_n": cut.cutting_n });
    let mut plain = run(&stated).output;
    assert_eq!(plain.setting.cut_force, None);
    plain.setting.cut_force = by_law.setting.cut_force;
    assert_eq!(json!(plain), json!(by_law));
    // What is stated beside the law stays.
    job["stiffness"]["cut_n_per_mm"] = json!(20_000);
    let ratio = run(&job).output.setting.compliance_ratio;
    assert!((ratio - 20_000.0 * (1.0 / 60_000.0 + 1.0 / 150_000.0)).abs() < 1e-9);
}

#[test]
fn the_chip_of_the_force_law_is_what_a_revolution_takes_off() {
    let mut job = short();
    job["ring"] = json!({ "radius_mm": 150 });
    job["force"] = force_law();
    job["tool"]["spark_out_revolutions"] = json!(0);
    let mean = |revolutions: u32| {
        let mut job = job.clone();
        job["tool"]["revolutions"] = json!(revolutions);
        run(&job).output
    };
    let (before, after) = (mean(31), mean(32));
    let taken_um = 1000.0 * (before.mean_radius_mm.unwrap() - after.mean_radius_mm.unwrap());
    let chip_um = after.setting.cut_force.unwrap().chip_thickness_um;
    // dR/ds changes over a revolution by about S/R.
    assert!((taken_um / chip_um - 1.0).abs() < 2e-3, "{taken_um} {chip_um}");
}

#[test]
fn what_no_force_law_gives_is_asked_for() {
    let mut job = short();
    job["stiffness"] = json!({ "tool_n_per_mm": 60_000, "support_a_n_per_mm": 150_000, "support_b_n_per_mm": 90_000 });
    job["dynamics"] = json!({ "work_speed_rpm": 60, "modes": [{ "frequency_hz": 180, "stiffness_n_per_mm": 80_000, "damping_ratio": 0.04 }] });
    job["forces"] = json!({ "weight_n": 300 });
    assert_eq!(codes(&job), ["cut_force_missing"; 4]);
    job["force"] = force_law();
    assert!(faults(&job).is_empty());
    // The message's own remedy works.
    job["analyses"] = json!(["settings_search"]);
    job["settings_search"] = json!({ "target_um": 20 });
    assert_eq!(codes(&job), ["search_needs_cut_stiffness"; 2]);
    let cut = {
        let mut job = job.clone();
        job["analyses"] = json!(["linear_theory"]);
        run(&job).output.setting.cut_force.unwrap().cut_n_per_mm
    };
    job["stiffness"]["cut_n_per_mm"] = json!(cut);
    job["dynamics"]["cut_n_per_mm"] = json!(cut);
    assert!(faults(&job).is_empty());
}

#[test]
fn search_says_what_is_out_of_reach_and_what_would_help() {
    let mut job = paper();
    job["analyses"] = json!(["settings_search"]);
    job["ring"] = json!({ "radius_mm": 150, "ellipticity_mm": 0.0, "harmonics": [{ "order": 3, "amplitude_um": 50 }] });
    job["settings_search"] =
        json!({ "target_um": 5, "clearance_mm": 0.3, "allowance_mm": 0.5, "revolutions_max": 100 });
    let answer = run(&job);
    let search = answer.output.settings_search.unwrap();
    assert_eq!(search.odd_orders, [3]);
    // 50 um of 3 lobes are 100 um from peak to valley; the filter of 50 UPR takes 0.25 % of the wave.
    assert!((search.odd_lobes_um - 99.75).abs() < 0.01, "{}", search.odd_lobes_um);
    // Opposite to a support they stay; elsewhere they do not.
    assert!(search.simulated > 0);
    let best = search.best.unwrap();
    assert!(best.roundness_um < 10.0, "{best:?}");
    job["ring"] = json!({ "radius_mm": 150, "ellipticity_mm": 0.1 });
    job["settings_search"] = json!({ "target_um": 0.01, "revolutions_max": 20 });
    let search = run(&job).output.settings_search.unwrap();
    assert_eq!(json!(search.status), "beyond_limits");
    job["settings_search"] = json!({ "target_um": 4.0 });
    let search = run(&job).output.settings_search.unwrap();
    let best = search.best.unwrap();
    assert!(best.margin_um >= 0.0 && best.roundness_um + best.roundness_error_um <= 4.0);
    // The setting advised, sent as a job, gives the roundness promised.
    job["analyses"] = json!(["simulation"]);
    job["tool"] = json!({
        "x_mm": best.tool_x_mm, "y_mm": best.tool_y_mm, "feed_mm_per_rev": best.feed_mm_per_rev,
        "revolutions": best.revolutions, "spark_out_revolutions": best.spark_out_revolutions
    });
    let found = run(&job).output.roundness_um.unwrap();
    assert!((found - best.roundness_um).abs() < 1e-9, "{found} {best:?}");
}

fn figures(job: &Value) -> Vec<Figure> {
    let outcome = run(job).output;
    RingRoundness::figures(&serde_json::from_value(job.clone()).unwrap(), &outcome)
}

/// What a job does not ask for has no figure, and no panel of a figure is an empty frame.
#[test]
fn figures_and_panels_without_data_are_absent() {
    let ids = |job: &Value| figures(job).iter().map(|figure| figure.id).collect::<Vec<_>>();
    let example = |id: &str| -> Value {
        let example = RingRoundness::META.examples.iter().find(|example| example.id == id).unwrap();
        serde_json::from_str(example.job).unwrap()
    };
    assert_eq!(ids(&example("clear_start")), ["polar", "profile", "history", "spectrum"]);
    let mut job = short();
    job["analyses"] = json!(["linear_theory"]);
    assert_eq!(ids(&job), ["spectrum"]);
    for figure in figures(&short()) {
        assert!(figure.panels.iter().all(|panel| !panel.items.is_empty()), "{}", figure.id);
    }
}

/// The symbol is that of a steady rest of a lathe; a ring has supports.
#[test]
fn the_supports_of_a_ring_are_called_so() {
    let polar = &figures(&short())[0];
    let supports =
        polar.panels[0].items.iter().filter(|item| matches!(item, Item::Glyph { glyph: Glyph::SteadyRest, .. }));
    assert_eq!((polar.id, supports.count()), ("polar", 2));
    assert_eq!(polar.title.values.get("glyph_steady_rest"), Some(&Said::from(vec!["supports"])));
}

/// No two curves of a roundness chart have one colour with one dash: the measured profile is drawn as the second of a family
/// would be.
#[test]
fn the_circles_of_a_roundness_chart_look_unlike_its_profiles() {
    let mut job = serde_json::from_str(RoundnessEvaluation::META.examples[0].job).unwrap();
    RoundnessEvaluation::fill(&mut job);
    let outcome = RoundnessEvaluation::run(&job, &Unwatched).unwrap().output;
    let role = |figure: &Figure, wanted: &str| {
        let found = figure.panels[0].items.iter().find_map(|item| match item {
            Item::Line { name, role, .. } if *name == wanted => Some(*role),
            _ => None,
        });
        found.unwrap_or_else(|| panic!("no line {wanted}"))
    };
    for figure in &RoundnessEvaluation::figures(&job, &outcome)[..2] {
        assert_eq!(role(figure, "measured_profile"), Role::Before, "{}", figure.id);
        assert!(![Role::Before, Role::Series(1)].contains(&role(figure, "circumscribed_circle")), "{}", figure.id);
    }
}

/// The end of the cut is a step of the surface: cut on one side, a revolution older on the other. It is there that the
/// picture has to draw the tool, also where the ring stops after a part of a revolution and whichever way it turns.
#[test]
fn the_tool_is_drawn_at_the_step_where_the_cut_ends() {
    // Opposite to a support: elsewhere lobes grow, with steps of their own.
    for (rotation, x_mm) in [("counter_clockwise", 100.0), ("clockwise", -100.0)] {
        for revolutions in [70.0, 70.3, 70.85] {
            let job = json!({
                "ring": { "radius_mm": 150 },
                "supports": { "distance_mm": 200, "depth_mm": 111 },
                "tool": { "x_mm": x_mm, "y_mm": 113.5, "feed_mm_per_rev": 0.02, "revolutions": revolutions },
                "rotation": rotation,
                "profile_points": 3600
            });
            let outcome = run(&job).output;
            let profile = &outcome.simulation.as_ref().unwrap().profile;
            let radii = &profile.end_radius_mm;
            let jump = |i: usize| (radii[(i + 1) % radii.len()] - radii[i]).abs();
            let step = (0..radii.len()).max_by(|a, b| jump(*a).total_cmp(&jump(*b))).unwrap();
            let figures = RingRoundness::figures(&serde_json::from_value(job).unwrap(), &outcome);
            let tools: Vec<(f64, f64)> = figures[0].panels[0]
                .items
                .iter()
                .filter_map(|item| match item {
                    Item::Glyph { glyph: Glyph::Tool, x, y } => Some((*x, *y)),
                    _ => None,
                })
                .collect();
            let [(x, y)] = tools[..] else { panic!("{tools:?}") };
            let apart = (x - profile.angle_deg[step] + 180.0).rem_euclid(360.0) - 180.0;
            // The profile has a point every 0.1 degrees; the step lies between two of them.
            assert!(apart.abs() < 0.25, "{rotation} {x_mm} {revolutions}: {apart} deg off");
            let near = (0..radii.len()).filter(|i| (profile.angle_deg[*i] - x).abs() < 0.11);
            assert!(near.into_iter().any(|i| (profile.end_deviation_um[i] - y).abs() < 1e-9), "{x} {y}");
        }
    }
}

mod any {
    use proptest::prelude::*;
    use serde_json::{Value, json};

    /// Between the ends evenly in the logarithm, and often one of the ends.
    fn wide(low: f64, high: f64) -> impl Strategy<Value = f64> {
        prop_oneof![1 => Just(low), 1 => Just(high), 4 => (low.ln()..high.ln()).prop_map(move |x| x.exp().clamp(low, high))]
    }

    fn effects() -> impl Strategy<Value = Value> {
        let each = vec![
            json!({ "kind": "initial_harmonic", "order": 500, "amplitude_mm": 10.0, "phase_rad": 100.0 }),
            json!({ "kind": "initial_harmonic", "order": 3, "amplitude_mm": 0.02, "phase_rad": 1.0 }),
            json!({ "kind": "tool_off_line", "tangential_offset_mm": -100.0 }),
            json!({ "kind": "support_position", "support_b_shift_mm": 100.0 }),
            json!({ "kind": "support_wear", "recession_um_per_rev": 100.0 }),
            json!({ "kind": "roller_runout", "amplitude_mm": 1.0, "ratio": 1000.0, "phase_rad": 0.3 }),
            json!({ "kind": "tool_push_off", "push_off_ratio": 1000.0 }),
            json!({ "kind": "spark_out_missing", "spark_out_revolutions": 0.0 }),
            json!({ "kind": "chatter_harmonic", "amplitude_mm": -1.0, "waves_per_revolution": 1000 }),
            json!({ "kind": "work_slip", "slip_deg_per_rev": 90.0 }),
        ];
        prop::sample::subsequence(each, 0..=3).prop_map(Value::from)
    }

    /// Jobs round a ring of some size, from sensible to absurd.
    pub(super) fn job() -> impl Strategy<Value = Value> {
        let machine =
            (wide(0.1, 1e5), 5.0..80.0_f64, -0.06..0.2_f64, 0.0..360.0_f64, prop_oneof![Just(0.0), wide(1e-3, 10.0)]);
        let cut =
            (wide(1e-7, 10.0), wide(0.01, 40.0), 0.0..3.0_f64, 0.0..360.0_f64, prop_oneof![Just(0.0), wide(1e-3, 1e3)]);
        let form = (prop_oneof![Just(0.0), 0.0..0.1_f64], 1..60_u32, prop_oneof![Just(0.0), 0.0..0.05_f64]);
        let rest = (
            any::<bool>(),
            any::<bool>(),
            prop::sample::select(vec!["none", "upr_15", "upr_500"]),
            effects(),
            // A search simulates dozens of settings: a few of the jobs ask for one.
            prop_oneof![79 => 0..3_u32, 1 => Just(3_u32)],
        );
        (machine, cut, form, rest).prop_map(|((radius, beta, gap, tool, roller), (feed, turns, dwell, direction, k), (e, order, wave), (clockwise, inward, filter, effects, what))| {
            let roller = roller * radius;
            let reach = radius + roller;
            let (sin, cos) = beta.to_radians().sin_cos();
            let at = tool.to_radians();
            let tip = radius * (1.0 + gap);
            let mut job = json!({
                "ring": {
                    "radius_mm": radius, "ellipticity_mm": e * radius,
                    "harmonics": [{ "order": order, "amplitude_um": wave * radius * 1e3 }]
                },
                "supports": { "distance_mm": 2.0 * reach * sin, "depth_mm": reach * cos, "roller_radius_mm": roller },
                "tool": {
                    "x_mm": tip * at.cos(), "y_mm": tip * at.sin(),
                    "feed_direction_deg": if inward { (tool + 180.0) % 360.0 } else { direction },
                    "feed_mm_per_rev": feed * radius.min(1.0), "revolutions": turns, "spark_out_revolutions": dwell
                },
                "rotation": if clockwise { "clockwise" } else { "counter_clockwise" },
                "compliance_ratio": k, "filter": filter, "samples": 360, "profile_points": 36, "highest_order": 20,
                "effects": effects
            });
            match what {
                1 => job["method"] = json!("nearest_samples"),
                2 => job["tool"]["wheel_radius_mm"] = json!(radius),
                3 => {
                    job["analyses"] = json!(["linear_theory", "settings_search"]);
                    job["settings_search"] = json!({ "target_um": 5.0, "revolutions_max": 20.0 });
                }
                _ => {}
            }
            job
        })
    }

    /// Every number of a value is finite: JSON has null for the others, which `roundness_um` must not be after a run.
    pub(super) fn finite(value: &Value) -> bool {
        match value {
            Value::Number(number) => number.as_f64().is_some_and(f64::is_finite),
            Value::Array(items) => items.iter().all(finite),
            Value::Object(fields) => fields.values().all(finite),
            _ => true,
        }
    }
}

proptest::proptest! {
    #![proptest_config(proptest::prelude::ProptestConfig { cases: crate::ring_support::cases(120), ..Default::default() })]

    /// Whatever comes is refused with a reason or answered with finite numbers.
    #[test]
    fn any_job_is_answered_or_refused(job in any::job()) {
        if !faults(&job).is_empty() {
            return Ok(());
        }
        match try_run(&job) {
            Ok(answer) => {
                let values = serde_json::to_value(&answer.output).unwrap();
                proptest::prop_assert!(any::finite(&values));
                if let Some(simulation) = &answer.output.simulation {
                    let history = serde_json::to_value(&simulation.history).unwrap().to_string();
                    proptest::prop_assert!(!history.contains("null"), "{history}");
                }
            }
            Err(Failure::Infeasible(finding) | Failure::OutOfModel(finding)) => {
                let known = ["nothing_cut", "profile_not_evaluable", "no_end_position", "ring_falls_in_run"];
                proptest::prop_assert!(known.contains(&finding.code), "{finding:?}");
            }
            Err(other) => proptest::prop_assert!(false, "{other:?}"),
        }
    }
}

/// A start clear of the blank comes to it at the job's own feed: by nanometres a revolution that is no run to try.
#[test]
fn a_first_bite_is_switched_off_only_where_that_ends() {
    let tried = |feed_mm_per_rev: f64, revolutions: u32| {
        let mut job = with("/tool/y_mm", json!(113.0));
        job["tool"]["feed_mm_per_rev"] = json!(feed_mm_per_rev);
        job["tool"]["revolutions"] = json!(revolutions);
        job["samples"] = json!(720);
        let values = serde_json::to_value(&run(&job).output).unwrap();
        let off = values["simulation"]["causes"]["switched_off"].as_array().unwrap().clone();
        off.iter().any(|cause| cause["cause"] == "first_bite")
    };
    assert!(tried(0.08, 8));
    assert!(!tried(1e-6, 8));
}

/// Frames of a replay are the surface on the way: what their history says, and what a run that stops there leaves.
#[test]
fn a_replay_shows_what_the_history_says_and_what_a_shorter_run_leaves() {
    for (rotation, x_mm) in [("counter_clockwise", 100.0), ("clockwise", -100.0)] {
        let mut job = short();
        job["rotation"] = json!(rotation);
        job["tool"]["x_mm"] = json!(x_mm);
        job["replay_frames"] = json!(11);
        let whole = run(&job).output.simulation.unwrap();
        let replay = whole.replay.as_ref().unwrap();
        // 33 revolutions, one in three.
        assert_eq!(replay.frames.len(), 11);
        assert_eq!(replay.angle_deg.len(), 360);
        for frame in &replay.frames {
            assert_eq!(frame.deviation_um.len(), 360);
            let entry =
                whole.history.revolution.iter().position(|turns| (turns - frame.revolution).abs() < 1e-9).unwrap();
            let noted = whole.history.roundness_um[entry];
            let fold = |by: fn(f64, f64) -> f64| frame.deviation_um.iter().copied().reduce(by).unwrap();
            let span = fold(f64::max) - fold(f64::min);
            // Rounding adds the grain of each end at most, 0.05 %; the peak may lie between two of every fourth node.
            assert!(span <= 1.001 * noted && span > 0.9 * noted, "{rotation} {}: {span} {noted}", frame.revolution);
        }
        // The run that stops after the fourth frame: 12 revolutions.
        job["tool"]["revolutions"] = json!(12);
        job["tool"]["spark_out_revolutions"] = json!(0);
        job["replay_frames"] = json!(0);
        job["profile_points"] = json!(360);
        let outcome = run(&job).output;
        let stopped = outcome.simulation.as_ref().unwrap();
        assert!(stopped.replay.is_none());
        let frame = &replay.frames[3];
        assert!((frame.revolution - 12.0).abs() < 0.01, "{}", frame.revolution);
        let grain = 1e-3 * stopped.end.as_ref().unwrap().unfiltered.least_squares_um;
        let deviations = frame.deviation_um.iter().zip(&stopped.profile.end_deviation_um);
        // Both are the same nodes; one step more or less at the stop moves the one where the cut ends.
        let apart = deviations.filter(|(a, b)| (*a - *b).abs() > grain).count();
        assert!(apart <= 2, "{rotation}: {apart} of 360 differ");
        let figures = RingRoundness::figures(&serde_json::from_value(job).unwrap(), &outcome);
        let tool = figures[0].panels[0].items.iter().find_map(|item| match item {
            Item::Glyph { glyph: Glyph::Tool, x, .. } => Some(*x),
            _ => None,
        });
        // The tool angle in space changes a little while the ring gets smaller.
        let off = (tool.unwrap() - frame.tool_angle_deg + 180.0).rem_euclid(360.0) - 180.0;
        assert!(off.abs() < 2.0, "{rotation}: {off}");
    }
}

fn said(answer: &precut_calc::calculator::Answer<Outcome>, code: &str) -> bool {
    answer.explanation.iter().any(|message| message.code == code)
}

/// A soft tool takes a large bite from both ends of a diameter: the less stays one-sided the softer it is.
#[test]
fn what_a_large_bite_leaves_falls_with_the_compliance() {
    let mut job = paper();
    job["samples"] = json!(1440);
    job["tool"]["spark_out_revolutions"] = json!(8);
    for k in [0.0_f64, 0.5, 3.0, 10.0] {
        job["compliance_ratio"] = json!(k);
        let answer = run(&job);
        let (_, end) = ron(&answer.output);
        let simulated = answer.output.simulation.as_ref().unwrap();
        let left = simulated.causes.first_bite_um.unwrap();
        // First order: the waves' sum is a little less.
        assert!((0.9..1.02).contains(&(end / left)), "{k}: {left} stated, {end} left");
        let even = answer.explanation.iter().find(|message| message.code == "opposite_to_support").unwrap();
        assert_eq!(even.values.get("even_factor"), Some(&Said::from((k / (1.0 + k)).powi(2))));
    }
}

/// Three lobes decay where the tool stands on top between close supports: nothing of it is locked in.
#[test]
fn odd_waves_are_locked_in_only_opposite_to_a_support() {
    let mut job = paper();
    job["ring"] = json!({ "radius_mm": 150, "harmonics": [{ "order": 3, "amplitude_um": 50, "angle_of_max_deg": 0 }] });
    let beta = 20.0_f64.to_radians();
    job["supports"] = json!({ "distance_mm": 300.0 * beta.sin(), "depth_mm": 150.0 * beta.cos() });
    job["tool"] = json!({ "x_mm": 0, "y_mm": 150.35, "feed_direction_deg": 270, "feed_mm_per_rev": 0.04, "revolutions": 49, "spark_out_revolutions": 1 });
    job["samples"] = json!(1440);
    let answer = run(&job);
    assert!(answer.output.setting.coefficient_sum > 1.02 && ron(&answer.output).0 < 10.0);
    let causes = &answer.output.simulation.as_ref().unwrap().causes;
    assert_eq!((causes.first_bite_um, causes.odd_lobes_um), (None, None));
    for code in ["start_clear", "opposite_to_support"] {
        assert!(!said(&answer, code), "{code}");
    }
    // Begun well inside the ring it takes a large bite all the same.
    job["tool"]["y_mm"] = json!(149.85);
    let inside = run(&job);
    assert!(inside.output.simulation.as_ref().unwrap().largest_bite_um.unwrap() > 150.0);
    assert!(inside.warnings.iter().all(|w| w.code != "first_bite_too_large_odd_lobes_locked_in"));
}
