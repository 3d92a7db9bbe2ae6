//! The calculator of milling in three directions: what it says is done and seen.
#![allow(clippy::unwrap_used, clippy::panic, missing_docs)]

use precut_calc::calculator::{Calculator, Check, Finding, Unwatched, Violations};
use precut_calc::fixture_stability::FixtureStability;
use precut_calc::milling_stability::{CrossingMethod, InstabilityKind, MillingStability, MillingState, Outcome};
use serde_json::{Value, json};

pub(crate) fn example(id: &str) -> Value {
    let example = MillingStability::META.examples.iter().find(|example| example.id == id).unwrap();
    serde_json::from_str(example.job).unwrap()
}

pub(crate) fn merged(mut value: Value, patch: &Value) -> Value {
    fn merge(value: &mut Value, patch: &Value) {
        match (value, patch) {
            (Value::Object(into), Value::Object(from)) if !from.contains_key("kind") => {
                for (name, part) in from {
                    if part.is_null() {
                        into.remove(name);
                    } else {
                        merge(into.entry(name).or_insert(Value::Null), part);
                    }
                }
            }
            (value, patch) => *value = patch.clone(),
        }
    }
    merge(&mut value, patch);
    value
}

pub(crate) fn faults(job: &Value) -> Vec<Finding> {
    let job: <MillingStability as Calculator>::Input = serde_json::from_value(job.clone()).unwrap();
    let mut violations = Violations::default();
    job.check(&mut violations);
    violations.into_vec()
}

pub(crate) struct Told {
    pub(crate) outcome: Outcome,
    pub(crate) warnings: Vec<Finding>,
    pub(crate) said: Vec<precut_calc::calculator::Message>,
}

pub(crate) fn solve(job: &Value) -> Told {
    assert!(faults(job).is_empty(), "{:?}", faults(job));
    let mut job: <MillingStability as Calculator>::Input = serde_json::from_value(job.clone()).unwrap();
    MillingStability::fill(&mut job);
    let answer = MillingStability::run(&job, &Unwatched).unwrap();
    Told { outcome: answer.output, warnings: answer.warnings, said: answer.explanation }
}

impl Told {
    pub(crate) fn warns(&self, code: &str) -> bool {
        self.warnings.iter().any(|warning| warning.code == code)
    }

    pub(crate) fn says(&self, code: &str) -> bool {
        self.said.iter().any(|message| message.code == code)
    }
}

/// Where one mode along the feed yields, the calculator of fixture stability computes the same by other kernels.
#[test]
fn one_direction_is_that_of_fixture_stability() {
    for (speed, depth, exponent, width, offset) in
        [(9200.0, 0.4, 0.0, 10.0, 0.0), (14_000.0, 1.2, 0.0, 3.0, 2.0), (7100.0, 0.3, 0.2, 6.0, -1.0)]
    {
        let vise: Value = json!({
            "cutter": { "diameter_mm": 10, "teeth": 2 },
            "force": { "coefficient": 600, "radial_ratio": 0.3, "chip_thickness_exponent": exponent },
            "cut": { "width_mm": width, "offset_mm": offset, "depth_mm": depth, "spindle_speed_rpm": speed, "feed_mm_per_tooth": 0.1 },
            "fixture": {
                "kind": "self_locking", "workpiece_mass_kg": 0.03993,
                "movable_joint": { "stiffness_n_per_mm": 670.0248, "damping_n_s_per_mm": 0.002_544_5 },
                "fixed_joint": { "stiffness_n_per_mm": 670.0248, "damping_n_s_per_mm": 0.002_544_5 }
            },
            "limits": { "depth_max_mm": 4 }
        });
        let mut job: <FixtureStability as Calculator>::Input = serde_json::from_value(vise.clone()).unwrap();
        FixtureStability::fill(&mut job);
        let known = FixtureStability::run(&job, &Unwatched).unwrap().output;
        let mut same = vise;
        same["force"] = json!({
            "kind": "power_law", "coefficient": 600, "radial_ratio": 0.3, "chip_thickness_exponent": exponent, "chip_floor_mm": 0
        });
        let fixture = same.as_object_mut().unwrap().remove("fixture").unwrap();
        same["tool"] = json!({ "kind": "rigid" });
        same["work"] = json!({ "kind": "vise", "fixture": fixture });
        same["analyses"] = json!(["verdict", "intervals", "motion"]);
        let found = solve(&same).outcome;
        let multiplier = found.multiplier.unwrap();
        // Powers of the chip have a root where a tooth enters with none: both know it to their own error.
        let within = 1e-9 + known.multiplier.modulus_error + multiplier.modulus_error;
        let off = (multiplier.per_tooth / known.multiplier.modulus - 1.0).abs();
        assert!(off < within && within < 1e-6, "{speed}: off {off}, within {within}");
        if exponent <= 0.0 {
            assert!(off < 1e-9, "{speed}: {off}");
        }
        match (found.first_limit_mm, known.chatter_depth_mm) {
            (Some(limit), Some(given)) => assert!((limit / given - 1.0).abs() < 1e-8, "{speed}: {limit} for {given}"),
            (limit, given) => assert_eq!(limit, given, "{speed}"),
        }
        let motion = found.motion.unwrap();
        let swing = motion.x_max_um - motion.x_min_um;
        assert!((swing / known.forced.peak_to_peak_um - 1.0).abs() < 1e-5, "{speed}: {swing}");
        let torque = found.force.torque_mean_n_m;
        assert!((torque / known.drive.torque_mean_n_m - 1.0).abs() < 1e-5, "{speed}: {torque}");
    }
}

/// The case of the specification, in all its numbers.
#[test]
fn two_modes_each_way_are_those_of_the_specification() {
    let job = merged(
        example("two_modes"),
        &json!({ "limits": { "depth_max_mm": 8 }, "lobes": { "speeds": 3, "map": false } }),
    );
    let told = solve(&job);
    let outcome = &told.outcome;
    let near = |value: f64, given: f64| (value / given - 1.0).abs() < 6e-6;
    assert!(near(outcome.multiplier.as_ref().unwrap().modulus, 1.315_233_515));
    assert!(near(outcome.first_limit_mm.unwrap(), 0.913_07), "{:?}", outcome.first_limit_mm);
    assert!(near(outcome.zeroth_order_min_mm.unwrap(), 0.957_11));
    let limited = outcome.limited_by.as_ref().unwrap();
    assert!(near(limited.x_rigid_limit_mm.unwrap(), 1.864_21), "{limited:?}");
    assert_eq!((limited.y_rigid_limit_mm, limited.tried.len()), (None, 2));
    assert_eq!(outcome.verdict.as_ref().unwrap().state, MillingState::Chatter);
    assert!(told.warns("zeroth_order_above") && told.says("milling_chatters") && told.says("direction_limits"));
    for (speed, depth) in [(14_000.0, 4.954_12), (10_500.0, 3.600_74), (7000.0, 2.210_55)] {
        let at = merged(job.clone(), &json!({ "cut": { "spindle_speed_rpm": speed }, "analyses": ["intervals"] }));
        let limit = solve(&at).outcome.first_limit_mm.unwrap();
        // Printed there to five digits of a search that ended 2e-5 away.
        assert!((limit / depth - 1.0).abs() < 3e-5, "{speed}: {limit}");
    }
}

#[test]
fn an_island_is_told_with_certified_ends_and_what_lies_beyond() {
    let told = solve(&example("island"));
    let intervals = &told.outcome.unstable_intervals;
    assert_eq!(intervals.len(), 2, "{intervals:?}");
    assert!(intervals.iter().all(|interval| interval.certified));
    let near = |value: Option<f64>, given: f64| (value.unwrap() / given - 1.0).abs() < 1e-6;
    assert!(near(intervals[0].from_mm, 6.867_838_932) && near(intervals[0].to_mm, 17.825_586_499));
    assert!(near(intervals[1].from_mm, 65.381_460_257) && intervals[1].to_mm.is_none());
    assert_eq!((intervals[0].kind, intervals[1].kind), (InstabilityKind::Flip, InstabilityKind::Hopf));
    assert!(told.says("milling_island"));
    // What it says is tried: below, inside, above.
    for (depth, state) in [
        (6.8, MillingState::Stable),
        (6.9, MillingState::Chatter),
        (17.8, MillingState::Chatter),
        (17.9, MillingState::Stable),
    ] {
        let job = merged(example("island"), &json!({ "cut": { "depth_mm": depth }, "analyses": ["verdict"] }));
        assert_eq!(solve(&job).outcome.verdict.unwrap().state, state, "{depth}");
    }
}

/// What limits is told by limits with one side rigid: such jobs have them.
#[test]
fn a_limit_with_one_side_rigid_is_that_of_such_a_job() {
    let job = merged(example("wall"), &json!({ "analyses": ["intervals"], "limits": { "depth_max_mm": 30 } }));
    let limited = solve(&job).outcome.limited_by.unwrap();
    let rigid = json!({ "kind": "rigid" });
    for (side, told) in [("tool", limited.tool_rigid_limit_mm), ("work", limited.work_rigid_limit_mm)] {
        let mut other = job.clone();
        other[side] = rigid.clone();
        let found = solve(&other).outcome.first_limit_mm;
        match (told, found) {
            (Some(told), Some(found)) => assert!((told / found - 1.0).abs() < 1e-7, "{side}: {told} {found}"),
            (told, found) => assert_eq!(told, found, "{side}"),
        }
    }
    let along_x = merged(job.clone(), &json!({}));
    assert_eq!(solve(&along_x).outcome.limited_by.unwrap(), limited);
}

/// Turned about the spindle with everything in it a cut is the same; so is one whose modes change sides.
#[test]
fn a_cut_turned_about_the_spindle_is_the_same() {
    let job = merged(example("wall"), &json!({ "analyses": ["verdict"] }));
    let plain = solve(&job).outcome.multiplier.unwrap().modulus;
    let turned = |angle: f64| {
        let mut other = job.clone();
        let (sin, cos) = angle.to_radians().sin_cos();
        other["cut"]["feed_direction_deg"] = json!(angle);
        for side in ["tool", "work"] {
            for mode in other[side]["modes"].as_array_mut().unwrap() {
                let [x, y] = [0, 1].map(|i| mode["direction"][i].as_f64().unwrap());
                mode["direction"] = json!([cos * x - sin * y, sin * x + cos * y, 0.0]);
            }
        }
        solve(&other).outcome.multiplier.unwrap().modulus
    };
    for angle in [180.0, 37.0, -90.0] {
        assert!((turned(angle) / plain - 1.0).abs() < 1e-9, "{angle}");
    }
    let mut swapped = job.clone();
    (swapped["tool"], swapped["work"]) = (job["work"].clone(), job["tool"].clone());
    assert!((solve(&swapped).outcome.multiplier.unwrap().modulus / plain - 1.0).abs() < 1e-9);
}

#[test]
fn other_cutters_are_not_tried_where_no_multiplier_is_computed() {
    let slow = json!({ "cutter": { "teeth": 8 }, "cut": { "spindle_speed_rpm": 0.1 }, "analyses": ["proposals"] });
    let job = merged(example("two_modes"), &slow);
    let found = faults(&job);
    assert_eq!(found.len(), 1, "{found:?}");
    assert_eq!((found[0].code, found[0].pointer.as_str()), ("too_expensive", "/cut/spindle_speed_rpm"));
    let Some(precut_calc::calculator::Value::Number(lowest)) = found[0].values.get("lowest_rpm") else {
        panic!("{found:?}")
    };
    let at = |speed: f64| faults(&merged(job.clone(), &json!({ "cut": { "spindle_speed_rpm": speed } }))).len();
    assert_eq!((at(1.001 * lowest), at(0.999 * lowest)), (0, 1));
    // Everything else is told at any speed.
    let told = solve(&merged(job, &json!({ "analyses": ["verdict", "intervals", "motion"] })));
    assert!(told.outcome.force.torque_mean_n_m > 0.0 && told.outcome.zeroth_order_min_mm.is_some());
}

/// A slow cut by closed forms: its limit is that of fixture stability, which looks at growth between two teeth by other means, its
/// motion that of exact elements.
#[test]
fn a_slow_cut_is_that_of_fixture_stability() {
    for (rpm, teeth, depth) in [(0.1, 2, 0.05), (0.5, 4, 0.1), (1.0, 8, 0.3), (5.0, 4, 0.02)] {
        let vise: Value = json!({
            "cutter": { "diameter_mm": 10, "teeth": teeth },
            "force": { "coefficient": 600, "radial_ratio": 0.3 },
            "cut": { "width_mm": 5, "offset_mm": 0, "depth_mm": depth, "spindle_speed_rpm": rpm, "feed_mm_per_tooth": 0.1 },
            "fixture": {
                "kind": "self_locking", "workpiece_mass_kg": 0.03993,
                "movable_joint": { "stiffness_n_per_mm": 670.0248, "damping_n_s_per_mm": 0.0075 },
                "fixed_joint": { "stiffness_n_per_mm": 670.0248, "damping_n_s_per_mm": 0.0075 }
            },
        });
        let mut job: <FixtureStability as Calculator>::Input = serde_json::from_value(vise.clone()).unwrap();
        FixtureStability::fill(&mut job);
        let known = FixtureStability::run(&job, &Unwatched).unwrap().output;
        let mut same = vise;
        same["force"] = json!({
            "kind": "power_law", "coefficient": 600, "radial_ratio": 0.3, "chip_thickness_exponent": 0, "chip_floor_mm": 0
        });
        let fixture = same.as_object_mut().unwrap().remove("fixture").unwrap();
        same["tool"] = json!({ "kind": "rigid" });
        same["work"] = json!({ "kind": "vise", "fixture": fixture });
        same["analyses"] = json!(["verdict", "intervals", "motion"]);
        let told = solve(&same);
        assert!(told.says("milling_slow_cut") && !told.warns("crossing_not_certified"), "{rpm}");
        // Both look at sixteen places of a stretch, and growth begins and ends between two of them; stretches are divided otherwise.
        let limit = told.outcome.first_limit_mm.unwrap();
        let other = known.chatter_depth_mm.unwrap();
        assert!((limit / other - 1.0).abs() < 3e-3, "{rpm}: {limit} {other}");
        let interval = &told.outcome.unstable_intervals[0];
        assert_eq!((interval.found_by, interval.certified), (CrossingMethod::ClosedForm, false));
        let (multiplier, other) = (told.outcome.multiplier.as_ref().unwrap(), &known.multiplier);
        // The same of the integral of growth, to which a small modulus is proportional: it has a kink where the chips change sign.
        let within = multiplier.modulus_error + other.modulus_error + 3e-3 * multiplier.modulus;
        assert!((multiplier.modulus - other.modulus).abs() <= within, "{rpm}: {multiplier:?} {other:?}");
        let growths = [multiplier.transient_growth.unwrap(), other.growth_within.unwrap()];
        assert!((growths[0].ln() - growths[1].ln()).abs() < 1e-2 * growths[1].ln().max(1.0), "{rpm}: {growths:?}");
        let state = told.outcome.verdict.as_ref().unwrap().state;
        let grows = [MillingState::Chatter, MillingState::GrowsWithin].contains(&state);
        assert_eq!(
            (grows, state == MillingState::Chatter),
            (depth >= limit, multiplier.modulus > 1.0),
            "{rpm}: {limit}"
        );
        let motion = told.outcome.motion.as_ref().unwrap();
        let swing = motion.x_max_um - motion.x_min_um;
        assert!((swing / known.forced.peak_to_peak_um - 1.0).abs() < 1e-4, "{rpm}: {swing} {:?}", known.forced);
    }
}

/// Elements in time below 120 oscillations from tooth to tooth, the closed form from there on: multiplier and motion go on, with modes
/// of tool and workpiece in several directions.
#[test]
fn the_closed_form_goes_on_where_elements_end() {
    let mode = |direction: [f64; 3], hz: f64, ratio: f64, stiffness: f64| json!({ "direction": direction, "frequency_hz": hz, "damping_ratio": ratio, "stiffness_n_per_mm": stiffness });
    let one = json!([mode([1.0, 0.0, 0.0], 600.0, 0.06, 8000.0)]);
    let across = json!([mode([1.0, 0.0, 0.0], 600.0, 0.06, 8000.0), mode([0.0, 1.0, 0.0], 560.0, 0.07, 7000.0)]);
    let (work, none) = (json!([mode([0.3, 1.0, 0.2], 400.0, 0.09, 20_000.0)]), json!(null));
    for (tool, work, helix, arc, shares) in [
        (&one, &none, 0, [0, 70], &[0.7, 1.6][..]),
        (&across, &none, 30, [100, 180], &[1.6]),
        (&across, &work, 40, [0, 180], &[0.7]),
    ] {
        let mut job = json!({
            "cutter": { "diameter_mm": 20, "teeth": 3, "helix_angle_deg": helix },
            "force": { "kind": "mechanistic", "tangential_n_per_mm2": 800, "radial_n_per_mm2": 300, "axial_n_per_mm2": 100 },
            "cut": { "entry_deg": arc[0], "exit_deg": arc[1], "depth_mm": 1, "spindle_speed_rpm": 100, "feed_mm_per_tooth": 0.1 },
            "tool": { "kind": "modes", "modes": tool }, "work": { "kind": "rigid" }, "analyses": ["intervals"],
            "limits": { "depth_max_mm": 60 }
        });
        if !work.is_null() {
            job["work"] = json!({ "kind": "modes", "modes": work });
        }
        let at = |oscillations: f64, depth: f64| {
            let cut = json!({ "spindle_speed_rpm": 60.0 * 600.0 / (3.0 * oscillations), "depth_mm": depth });
            solve(&merged(job.clone(), &json!({ "cut": cut, "analyses": ["verdict", "motion"] }))).outcome
        };
        let slow = merged(job.clone(), &json!({ "cut": { "spindle_speed_rpm": 60.0 * 600.0 / (3.0 * 120.1) } }));
        let limit = solve(&slow).outcome.first_limit_mm.unwrap();
        for depth in shares.iter().map(|share| share * limit) {
            let (elements, closed) = (at(119.9, depth), at(120.1, depth));
            let swings = [&elements, &closed].map(|of| of.motion.as_ref().unwrap().peak_to_peak_um);
            // The speed differs by 0.17 %, and with it how far the force goes on while the first swing lasts.
            assert!((swings[0] / swings[1] - 1.0).abs() < 1e-3, "{swings:?}");
            let (elements, closed) = (elements.multiplier.unwrap(), closed.multiplier.unwrap());
            let off = (elements.modulus - closed.modulus).abs();
            assert!(off <= closed.modulus_error + elements.modulus_error, "{elements:?} {closed:?}");
            // One mode has no shape that turns: there it is known to half a percent.
            let is_one = tool.as_array().unwrap().len() == 1 && work.is_null();
            assert!(!is_one || closed.modulus_error < 5e-3 * closed.modulus, "{closed:?}");
            assert_eq!(closed.transient_growth.unwrap() >= 50.0, depth > limit, "{closed:?}");
        }
    }
}

/// With the cut as stiff everywhere (a slot of many teeth) the limit of a slow cut is the least of the zeroth order; of an edge in a
/// helix it is that of a straight one but for its lag.
#[test]
fn the_limit_of_a_slow_cut_is_a_closed_form() {
    let slow = json!({
        "cutter": { "teeth": 8, "helix_angle_deg": 0 }, "cut": { "spindle_speed_rpm": 0.5, "width_mm": 31.75 },
        "analyses": ["verdict", "intervals"]
    });
    let slot = solve(&merged(example("two_modes"), &slow)).outcome;
    let (limit, zeroth) = (slot.first_limit_mm.unwrap(), slot.zeroth_order_min_mm.unwrap());
    assert!((limit / zeroth - 1.0).abs() < 1e-3, "{limit} {zeroth}");
    let with = |helix: f64| {
        let job = merged(example("two_modes"), &slow);
        let quarter = json!({ "cutter": { "helix_angle_deg": helix }, "cut": { "width_mm": 4.0 } });
        solve(&merged(job, &quarter)).outcome.first_limit_mm.unwrap()
    };
    let (straight, slight, steep) = (with(0.0), with(1.0), with(40.0));
    // The top of an edge meets the same later by its lag: the limit moves by less than that is of the arc.
    let (radius, arc) = (0.5 * 31.75_f64, (1.0_f64 - 4.0 / 15.875).acos());
    for (helix, limit) in [(1.0_f64, slight), (40.0, steep)] {
        let lag = limit * helix.to_radians().tan() / radius;
        assert!((limit / straight - 1.0).abs() < lag / arc, "{helix}: {limit} {straight}");
    }
}

#[test]
fn every_fault_is_named_at_its_field() {
    let cases = [
        (json!({ "cut": { "width_mm": null, "entry_deg": 90, "exit_deg": 80 } }), "arc_empty", "/cut/exit_deg"),
        (json!({ "cut": { "entry_deg": 90, "exit_deg": 180 } }), "arc_or_width", "/cut/width_mm"),
        (json!({ "cut": { "width_mm": null, "entry_deg": 90 } }), "arc_or_width", "/cut/width_mm"),
        (json!({ "cut": { "milling": "centred", "offset_mm": 40 } }), "strip_misses_cutter", "/cut/offset_mm"),
        (json!({ "cutter": { "pitch_deg": [170, 180] } }), "pitch_sum", "/cutter/pitch_deg"),
        (json!({ "cutter": { "pitch_deg": [100, 160, 100] } }), "one_for_each_tooth", "/cutter/pitch_deg"),
        (
            json!({ "cutter": { "tooth_helix_angle_deg": [0, 80] }, "cut": { "depth_mm": 9 } }),
            "teeth_meet",
            "/cutter/tooth_helix_angle_deg",
        ),
        (json!({ "tool": { "kind": "rigid" } }), "nothing_yields", "/tool"),
        (
            json!({ "process_damping": { "source": "assumed", "wear_land_mm": 0.1 } }),
            "rubbing_coefficient",
            "/process_damping/coefficient_n_per_mm",
        ),
        (
            json!({ "speed_variation": { "amplitude": 0.1, "frequency_hz": 973.0 } }),
            "modulation_incommensurate",
            "/speed_variation/frequency_hz",
        ),
        (json!({ "lobes": { "from_rpm": 9000, "to_rpm": 8000 } }), "speeds_reversed", "/lobes/to_rpm"),
        (
            json!({ "force": { "kind": "kienzle", "tangential_n_per_mm2": 1700, "tangential_exponent": 0.2, "chip_floor_mm": 0 } }),
            "chip_floor_needed",
            "/force/chip_floor_mm",
        ),
        (json!({ "cut": { "speed_m_per_min": 900 } }), "spindle_speed_or_speed", "/cut"),
        (json!({ "cut": { "feed_mm_per_tooth": null } }), "feed_missing", "/cut/feed_mm_per_tooth"),
        (json!({ "cut": { "feed_mm_per_min": 1000 } }), "feeds_disagree", "/cut/feed_mm_per_min"),
    ];
    for (patch, code, pointer) in cases {
        let found = faults(&merged(example("two_modes"), &patch));
        let named: Vec<_> = found.iter().map(|fault| (fault.code, fault.pointer.as_str())).collect();
        assert_eq!(named, [(code, pointer)], "{patch}");
    }
    let joint = json!({ "stiffness_n_per_mm": 9000, "damping_n_s_per_mm": 0.3 });
    let vise = |kind: &str| {
        let mut fixture = json!({ "kind": kind, "workpiece_mass_kg": 3, "movable_joint": joint, "fixed_joint": joint });
        if kind == "constant_force" {
            fixture["jaw_mass_kg"] = json!(1);
        }
        json!({ "kind": "vise", "fixture": fixture })
    };
    for (side, kind, expected) in [
        ("work", "self_locking", vec![]),
        ("work", "constant_force", vec![("vise_not_modal", "/work/fixture/kind")]),
        ("tool", "self_locking", vec![("vise_holds_work", "/tool")]),
    ] {
        let mut job = example("two_modes");
        job[side] = vise(kind);
        let found = faults(&job);
        assert_eq!(found.iter().map(|fault| (fault.code, fault.pointer.as_str())).collect::<Vec<_>>(), expected);
    }
    let mode = |mode: Value| json!({ "tool": { "kind": "modes", "modes": [mode] } });
    for (given, code, pointer) in [
        (
            json!({ "direction": [0, 0, 0], "frequency_hz": 500, "mass_kg": 1, "damping_ratio": 0.02 }),
            "direction_zero",
            "/tool/modes/0/direction",
        ),
        (
            json!({ "direction": [1, 0, 0], "mass_kg": 1, "damping_ratio": 0.02 }),
            "mode_underdetermined",
            "/tool/modes/0",
        ),
        (
            json!({ "direction": [1, 0, 0], "mass_kg": 1, "frequency_hz": 500, "stiffness_n_per_mm": 9000, "damping_ratio": 0.02 }),
            "mode_overdetermined",
            "/tool/modes/0",
        ),
        (
            json!({ "direction": [1, 0, 0], "mass_kg": 1, "frequency_hz": 500 }),
            "damping_of_mode",
            "/tool/modes/0/damping_ratio",
        ),
        (
            json!({ "direction": [1, 0, 0], "mass_kg": 1, "frequency_hz": 500, "damping_n_s_per_mm": 900 }),
            "negative_damping",
            "/tool/modes/0/damping_n_s_per_mm",
        ),
    ] {
        let found = faults(&merged(example("two_modes"), &mode(given)));
        assert_eq!(
            found.iter().map(|fault| (fault.code, fault.pointer.as_str())).collect::<Vec<_>>(),
            [(code, pointer)]
        );
    }
}

/// A number in another unit is warned of at its field with that unit, its neighbour inside the range is not.
#[test]
fn a_likely_unit_is_named_and_no_number_is_changed() {
    let likely = |patch: Value| {
        let told = solve(&merged(example("two_modes"), &merged(json!({ "analyses": [] }), &patch)));
        let of = |warning: &Finding| (warning.pointer.clone(), format!("{:?}", warning.values.get("likely")));
        told.warnings.iter().filter(|warning| warning.code == "implausible_unit").map(of).collect::<Vec<_>>()
    };
    assert!(likely(json!({})).is_empty());
    let mode = |stiffness: f64, damping: f64| json!({ "tool": { "kind": "modes", "modes": [{ "direction": [1, 0, 0], "mass_kg": 1, "stiffness_n_per_mm": stiffness, "damping_n_s_per_mm": damping }] } });
    assert!(likely(mode(9000.0, 0.1)).is_empty());
    let found = likely(mode(9.0, 0.003));
    assert!(found.len() == 1 && found[0].1.contains("stiffness_n_per_um"), "{found:?}");
    let found = likely(mode(9000.0, 5.0));
    assert!(found.len() == 1 && found[0].1.contains("damping_n_s_per_m"), "{found:?}");
    let found = likely(json!({ "force": { "kind": "mechanistic", "tangential_n_per_mm2": 1.3 } }));
    assert!(found.len() == 1 && found[0].1.contains("coefficient_gpa"), "{found:?}");
    let found = likely(json!({ "cut": { "feed_mm_per_tooth": 1.1 } }));
    assert_eq!(found[0].0, "/cut/feed_mm_per_tooth");
}

/// A varying speed lifts a flip and one that does not fit exactly is moved and told.
#[test]
fn a_varying_speed_is_answered_over_its_period() {
    let job = json!({
        "cutter": { "diameter_mm": 20, "teeth": 2 },
        "force": { "kind": "mechanistic", "tangential_n_per_mm2": 600, "radial_n_per_mm2": 200 },
        "cut": { "entry_deg": 154.158_067_236_832_9, "exit_deg": 180, "depth_mm": 2, "spindle_speed_rpm": 18000, "feed_mm_per_tooth": 0.1 },
        "tool": { "kind": "modes", "modes": [{ "direction": [1, 0, 0], "frequency_hz": 922, "damping_ratio": 0.011, "mass_kg": 0.03993 }] },
        "work": { "kind": "rigid" }, "analyses": ["intervals"], "limits": { "depth_max_mm": 5 },
        "speed_variation": { "amplitude": 0.1, "frequency_hz": 50.0 }
    });
    let told = solve(&job);
    let limit = told.outcome.first_limit_mm.unwrap();
    assert!((limit / 3.490_201_572 - 1.0).abs() < 1e-6 && !told.warns("modulation_moved"), "{limit}");
    let steady = solve(&merged(job.clone(), &json!({ "speed_variation": null }))).outcome.first_limit_mm.unwrap();
    assert!((steady / 1.295_141_849 - 1.0).abs() < 1e-6, "{steady}");
    let moved = solve(&merged(job, &json!({ "speed_variation": { "frequency_hz": 50.1 }, "analyses": ["verdict"] })));
    assert!(moved.warns("modulation_moved"));
}

/// A diagram has the limits of single jobs; speeds so slow that neither a multiplier nor a closed form tells them are left out.
#[test]
fn a_diagram_has_the_limits_of_single_jobs_and_says_what_it_left_out() {
    let job = merged(
        example("two_modes"),
        &json!({ "analyses": ["lobes"], "limits": { "depth_max_mm": 6 }, "lobes": { "from_rpm": 10, "to_rpm": 15010, "speeds": 4, "map": true, "depths": 6 } }),
    );
    let lobes = solve(&job).outcome.lobes.unwrap();
    // The slowest is a slow cut, which a closed form answers.
    assert!(lobes.boundary.status.iter().all(|status| status.name() == "answered"));
    assert!(lobes.map.unwrap().per_tooth.iter().all(Option::is_some));
    for (k, speed) in lobes.boundary.spindle_speed_rpm.iter().enumerate() {
        let one = merged(job.clone(), &json!({ "analyses": ["intervals"], "cut": { "spindle_speed_rpm": speed } }));
        let limit = solve(&one).outcome.first_limit_mm;
        let of_map = lobes.boundary.chatter_mm[k];
        match (limit, of_map) {
            (Some(a), Some(b)) => assert!((a / b - 1.0).abs() < 1e-3, "{speed}: {a} {b}"),
            (a, b) => assert_eq!(a, b, "{speed}"),
        }
    }
    let plane = json!({ "speeds": 2, "to_rpm": 12_010, "depths": 2 });
    let uneven = merged(job, &json!({ "cutter": { "pitch_deg": [170, 190] }, "lobes": plane }));
    let lobes = solve(&uneven).outcome.lobes.unwrap();
    let status: Vec<_> = lobes.boundary.status.iter().map(|status| status.name()).collect();
    let map = lobes.map.unwrap();
    assert_eq!((status[0], lobes.boundary.chatter_mm[0], map.per_tooth[0]), ("too_slow", None, None));
    assert!(status.last() == Some(&"answered") && map.per_tooth[1].is_some());
}

/// Frequencies are aliases of the multiplier, and shares are shares.
#[test]
fn the_frequency_is_an_alias_and_shares_make_a_whole() {
    for id in ["two_modes", "wall"] {
        let outcome = solve(&merged(example(id), &json!({ "analyses": ["verdict"] }))).outcome;
        let multiplier = outcome.multiplier.unwrap();
        let angle = multiplier.imaginary.atan2(multiplier.real) / std::f64::consts::TAU;
        for alias in &multiplier.aliases {
            let turns = alias.frequency_hz * multiplier.period_s;
            let off = [turns - angle, turns + angle].map(|x| (x - x.round()).abs());
            assert!(off[0].min(off[1]) < 1e-6, "{id}: {alias:?}");
        }
        let energy: f64 = outcome.modes.iter().map(|mode| mode.energy_share.unwrap()).sum();
        assert!((energy - 1.0).abs() < 1e-9, "{id}: {energy}");
        assert!(multiplier.aliases.iter().map(|alias| alias.share).sum::<f64>() <= 1.0 + 1e-9);
    }
}

/// Every speed that is told is done as it is printed: stable there and at what may be off, within all limits, by falling removal.
#[test]
fn a_better_speed_gives_what_it_says() {
    let limited = json!({
        "analyses": ["verdict", "speeds"], "lobes": { "speeds": 24, "map": false },
        "spindle": { "power_kw": 2.2, "speed_min_rpm": 6000 }, "cut": { "depth_mm": 0.4 }
    });
    let motion = json!({
        "analyses": ["speeds"], "lobes": { "speeds": 20, "from_rpm": 6000, "to_rpm": 16000, "map": false },
        "limits": { "amplitude_max_um": 60, "surface_error_max_um": 25 }
    });
    for job in [merged(example("two_modes"), &limited), merged(example("two_modes"), &motion)] {
        let told = solve(&job);
        let now = told.outcome.engagement.removal_rate_cm3_per_min;
        let speeds = &told.outcome.speeds;
        assert!(!speeds.is_empty() && told.says("pocket_is"), "{:?}", told.outcome.speed_curve);
        assert!(
            speeds.windows(2).all(|pair| pair[0].removal_rate_cm3_per_min >= 0.999 * pair[1].removal_rate_cm3_per_min)
        );
        for pocket in speeds {
            let cut = json!({ "spindle_speed_rpm": pocket.spindle_speed_rpm, "depth_mm": pocket.depth_mm });
            let done =
                solve(&merged(job.clone(), &json!({ "cut": cut, "analyses": ["verdict", "intervals", "motion"] })));
            let outcome = &done.outcome;
            assert_eq!(outcome.verdict.as_ref().unwrap().state, MillingState::Stable, "{pocket:?}");
            let near = |a: f64, b: f64| (a / b - 1.0).abs() < 1e-6;
            assert!(near(outcome.multiplier.as_ref().unwrap().per_tooth, pocket.per_tooth));
            assert!(near(outcome.engagement.removal_rate_cm3_per_min, pocket.removal_rate_cm3_per_min));
            assert!(near(outcome.force.motor_power_kw, pocket.motor_power_kw));
            assert!(near(outcome.motion.as_ref().unwrap().peak_to_peak_um, pocket.peak_to_peak_um.unwrap()));
            if let Some(limit) = pocket.chatter_depth_mm {
                assert!(near(outcome.first_limit_mm.unwrap(), limit) && pocket.depth_mm <= 0.9 * limit * (1.0 + 1e-9));
            }
            if told.outcome.verdict.as_ref().is_some_and(|verdict| verdict.state == MillingState::Stable) {
                assert!(pocket.removal_rate_cm3_per_min > now, "{pocket:?}");
            }
            for factor in [0.99, 1.01] {
                let off = json!({ "cut": { "spindle_speed_rpm": factor * pocket.spindle_speed_rpm, "depth_mm": pocket.depth_mm }, "analyses": ["verdict"] });
                let multiplier = solve(&merged(job.clone(), &off)).outcome.multiplier.unwrap();
                assert!(multiplier.modulus < 1.0, "{factor} {pocket:?}");
            }
        }
        // Neither end of the range is one of them.
        let curve = told.outcome.speed_curve.as_ref().unwrap();
        for end in [curve.spindle_speed_rpm[0], *curve.spindle_speed_rpm.last().unwrap()] {
            assert!(speeds.iter().all(|pocket| (pocket.spindle_speed_rpm / end - 1.0).abs() > 1e-3));
        }
    }
    // Where the working point is the best there is, nothing else is told.
    let best = merged(
        example("two_modes"),
        &json!({ "cut": { "spindle_speed_rpm": 14030, "depth_mm": 3 }, "analyses": ["verdict", "speeds"],
                 "lobes": { "speeds": 16, "from_rpm": 6000, "to_rpm": 13000, "map": false } }),
    );
    let told = solve(&best);
    assert_eq!(told.outcome.verdict.as_ref().unwrap().state, MillingState::Stable);
    assert!(told.outcome.speeds.is_empty() && told.says("no_better_pocket"));
}

/// Of several widths the best speeds are told with their width: such jobs have them, and none of one width alone is better.
#[test]
fn the_best_speeds_over_several_widths_give_what_they_say() {
    let job = merged(
        example("two_modes"),
        &json!({ "analyses": ["speeds"], "lobes": { "speeds": 12, "from_rpm": 7000, "to_rpm": 16000, "map": false },
                 "limits": { "depths": 12 }, "cut": { "widths_mm": [6, 25] } }),
    );
    let told = solve(&job);
    let speeds = &told.outcome.speeds;
    assert!(!speeds.is_empty() && told.says("pocket_is"));
    let mut best = Vec::new();
    for width in [15.875, 6.0, 25.0] {
        let alone = merged(job.clone(), &json!({ "cut": { "width_mm": width, "widths_mm": null } }));
        best.extend(solve(&alone).outcome.speeds);
    }
    best.sort_by(|a, b| b.removal_rate_cm3_per_min.total_cmp(&a.removal_rate_cm3_per_min));
    best.truncate(speeds.len());
    for (pocket, alone) in speeds.iter().zip(&best) {
        assert!((pocket.removal_rate_cm3_per_min / alone.removal_rate_cm3_per_min - 1.0).abs() < 2e-3, "{best:?}");
        let cut = json!({ "spindle_speed_rpm": pocket.spindle_speed_rpm, "depth_mm": pocket.depth_mm,
                          "width_mm": pocket.width_mm, "widths_mm": null });
        let done = solve(&merged(job.clone(), &json!({ "cut": cut, "analyses": ["verdict"] }))).outcome;
        assert_eq!(done.verdict.unwrap().state, MillingState::Stable, "{pocket:?}");
        let removal = done.engagement.removal_rate_cm3_per_min;
        assert!((removal / pocket.removal_rate_cm3_per_min - 1.0).abs() < 1e-9, "{pocket:?}");
    }
    assert!(speeds.iter().any(|pocket| (pocket.width_mm - 15.875).abs() > 1.0), "{speeds:?}");
    let named = |patch: Value| {
        faults(&merged(job.clone(), &patch)).iter().map(|of| (of.code, of.pointer.clone())).collect::<Vec<_>>()
    };
    let by_angles = json!({ "cut": { "width_mm": null, "entry_deg": 90, "exit_deg": 180 } });
    assert_eq!(named(by_angles), [("widths_beside_width", "/cut/widths_mm".to_owned())]);
    let beside = json!({ "cut": { "milling": "centred", "offset_mm": 20, "widths_mm": [12, 5] } });
    assert_eq!(named(beside), [("strip_misses_cutter", "/cut/widths_mm/1".to_owned())]);
}

/// With a varying speed the largest growth on the way is told: none of a steady one, and what a march of the map's own motion shows.
#[test]
fn growth_within_a_modulation_is_told() {
    let job = json!({
        "cutter": { "diameter_mm": 20, "teeth": 2 },
        "force": { "kind": "mechanistic", "tangential_n_per_mm2": 600, "radial_n_per_mm2": 200 },
        "cut": { "entry_deg": 154.158_067_236_832_9, "exit_deg": 180, "depth_mm": 3, "spindle_speed_rpm": 18000, "feed_mm_per_tooth": 0.1 },
        "tool": { "kind": "modes", "modes": [{ "direction": [1, 0, 0], "frequency_hz": 922, "damping_ratio": 0.011, "mass_kg": 0.03993 }] },
        "work": { "kind": "rigid" }, "analyses": ["verdict"], "speed_variation": { "amplitude": 0.1, "frequency_hz": 50.0 }
    });
    let of = |patch: Value| solve(&merged(job.clone(), &patch)).outcome.multiplier.unwrap();
    let varied = of(json!({}));
    let steady = of(json!({ "speed_variation": null }));
    assert!(steady.transient_growth.is_none() && varied.modulus < 1.0, "{varied:?}");
    // At some speeds of the modulation the steady cut grows from tooth to tooth, at others it decays: what is told lies between no
    // growth and the fastest of them all the way.
    let fastest = (0..=20)
        .map(|k| {
            of(json!({ "speed_variation": null, "cut": { "spindle_speed_rpm": 16_200.0 + 180.0 * f64::from(k) } }))
                .per_tooth
        })
        .fold(0.0, f64::max);
    let growth = varied.transient_growth.unwrap();
    let teeth = varied.period_s * 18_000.0 / 60.0 * 2.0;
    assert!(growth > 1.0 && growth < fastest.powf(teeth), "{growth} {fastest} {teeth}");
    // A variation that hardly varies has no growth on the way but that of the multiplier.
    let slight = of(json!({ "speed_variation": { "amplitude": 1e-6 } }));
    let end = slight.per_tooth.powf(slight.period_s * 18_000.0 / 60.0 * 2.0 - 1.0).max(1.0);
    assert!((slight.transient_growth.unwrap() / end - 1.0).abs() < 0.05, "{slight:?} {end}");
}

/// Where the forced motion is as large as the run-out it is said that pairing rests on undisturbed chips.
#[test]
fn a_motion_as_large_as_the_run_out_is_warned_of() {
    let warns = |run_out_um: f64, feed: f64| {
        let patch = json!({ "cutter": { "radial_offset_um": [0, run_out_um] }, "cut": { "depth_mm": 0.3, "feed_mm_per_tooth": feed },
                            "about": "smooth_chips", "analyses": ["verdict", "motion"] });
        let told = solve(&merged(example("two_modes"), &patch));
        let swing = told.outcome.motion.unwrap().peak_to_peak_um;
        (told.warnings.iter().any(|of| of.code == "pairing_of_undisturbed_chips"), swing > 0.5 * run_out_um)
    };
    for (run_out_um, feed) in [(2.0, 0.2), (60.0, 0.02), (20.0, 0.1), (100.0, 0.1)] {
        let (warned, is_large) = warns(run_out_um, feed);
        assert_eq!(warned, is_large, "{run_out_um} {feed}");
    }
    assert!(warns(2.0, 0.2).0 && !warns(60.0, 0.005).0);
}

/// Of a cutter with run-out the modulus about undisturbed chips stands beside that about the motion that they force; where one of both says
/// chatter, that is warned of.
#[test]
fn both_moduli_of_a_cutter_with_run_out_are_told() {
    let cutter = json!({ "cutter": { "radial_offset_um": [0, 25] }, "cut": { "feed_mm_per_tooth": 0.05 } });
    let job = merged(example("two_modes"), &cutter);
    let smooth = merged(job.clone(), &json!({ "about": "smooth_chips" }));
    let limit = solve(&merged(smooth.clone(), &json!({ "analyses": ["intervals"] }))).outcome.first_limit_mm.unwrap();
    let both = |depth_mm: f64| {
        let cut = json!({ "cut": { "depth_mm": depth_mm }, "analyses": ["verdict"] });
        let [told, undisturbed] = [&job, &smooth].map(|job| solve(&merged(job.clone(), &cut)));
        let of = |told: &Told| told.outcome.multiplier.clone().unwrap();
        let (about, without) = (of(&told), of(&undisturbed));
        assert!((about.smooth_chips_modulus.unwrap() / without.modulus - 1.0).abs() < 1e-9, "{about:?} {without:?}");
        assert!(without.smooth_chips_modulus.is_none());
        let says = told.warnings.iter().any(|of| of.code == "about_changes_verdict");
        assert_eq!(says, (about.modulus < 1.0) != (without.modulus < 1.0), "{about:?}");
        (about.modulus, says)
    };
    // Beside the limit of undisturbed chips, on the side on which they say the other.
    let (at_limit, _) = both(limit);
    assert!((at_limit - 1.0).abs() > 0.01, "{at_limit}");
    let beside = if at_limit > 1.0 { 0.999 } else { 1.001 };
    assert!(both(beside * limit).1 && !both(0.5 * limit).1);
    let even = solve(&merged(example("two_modes"), &json!({ "analyses": ["verdict"] })));
    assert!(even.outcome.multiplier.unwrap().smooth_chips_modulus.is_none());
}

/// Unequal pitch and a varying speed of the specification are proposed, and such jobs have the limits that are told.
#[test]
fn a_proposal_gives_what_it_says() {
    let four = json!({
        "cutter": { "diameter_mm": 19.05, "teeth": 4, "helix_angle_deg": 30 },
        "force": { "kind": "mechanistic", "tangential_n_per_mm2": 679, "radial_n_per_mm2": 256 },
        "cut": { "entry_deg": 0, "exit_deg": 90, "depth_mm": 4, "spindle_speed_rpm": 5000, "feed_mm_per_tooth": 0.1 },
        "tool": { "kind": "modes", "modes": [
            { "direction": [1, 0, 0], "frequency_hz": 563.6, "damping_ratio": 0.0558, "mass_kg": 1.4986 },
            { "direction": [0, 1, 0], "frequency_hz": 516.21, "damping_ratio": 0.025, "mass_kg": 1.199 }] },
        "work": { "kind": "rigid" }, "analyses": ["proposals"], "limits": { "depth_max_mm": 20 }
    });
    let told = solve(&four);
    let pitch = told.outcome.proposals.iter().find(|proposal| !proposal.pitch_deg.is_empty()).unwrap();
    assert!((pitch.first_limit_now_mm.unwrap() / 4.491_582_284 - 1.0).abs() < 1e-6, "{pitch:?}");
    // The specification's own pattern is one of those tried.
    assert!(pitch.first_limit_mm.is_none_or(|limit| limit > 11.87), "{pitch:?}");
    let slot = json!({
        "cutter": { "diameter_mm": 20, "teeth": 2 },
        "force": { "kind": "mechanistic", "tangential_n_per_mm2": 600, "radial_n_per_mm2": 200 },
        "cut": { "entry_deg": 154.158_067_236_832_9, "exit_deg": 180, "depth_mm": 2, "spindle_speed_rpm": 18000, "feed_mm_per_tooth": 0.1 },
        "tool": { "kind": "modes", "modes": [{ "direction": [1, 0, 0], "frequency_hz": 922, "damping_ratio": 0.011, "mass_kg": 0.03993 }] },
        "work": { "kind": "rigid" }, "analyses": ["proposals"], "limits": { "depth_max_mm": 5 },
        "spindle": { "inertia_kg_m2": 0.001, "acceleration_max_rad_per_s2": 500_000 }
    });
    let mut kinds = Vec::new();
    for job in [four, slot] {
        for proposal in solve(&job).outcome.proposals {
            assert!(proposal.gain_percent >= 5.0);
            kinds.push(proposal.kind.name());
            let patch = match proposal.kind.name() {
                "pitch" => json!({ "cutter": { "pitch_deg": proposal.pitch_deg } }),
                "helix" => json!({ "cutter": { "helix_angle_deg": proposal.helix_angle_deg } }),
                _ => {
                    json!({ "speed_variation": { "amplitude": proposal.amplitude, "frequency_hz": proposal.frequency_hz } })
                }
            };
            let done = solve(&merged(merged(job.clone(), &patch), &json!({ "analyses": ["intervals"] }))).outcome;
            match (done.first_limit_mm, proposal.first_limit_mm) {
                (Some(a), Some(b)) => assert!((a / b - 1.0).abs() < 1e-6, "{proposal:?}: {a}"),
                (a, b) => assert_eq!(a, b, "{proposal:?}"),
            }
        }
    }
    assert!(kinds.contains(&"pitch") && kinds.contains(&"speed_variation"), "{kinds:?}");
    // Without the inertia of the spindle no varying speed is proposed; one that asks too much of it is warned of.
    let varied = json!({ "speed_variation": { "amplitude": 0.2, "frequency_hz": 50 }, "analyses": [], "spindle": { "acceleration_max_rad_per_s2": 1e5 } });
    let warns = |most: f64| {
        let job = merged(
            merged(example("two_modes"), &varied),
            &json!({ "cut": { "spindle_speed_rpm": 9000 }, "spindle": { "acceleration_max_rad_per_s2": most } }),
        );
        solve(&job).warns("spindle_acceleration")
    };
    // A Omega_0 2 pi f_m.
    let asked = 0.2 * (std::f64::consts::TAU * 150.0) * std::f64::consts::TAU * 50.0;
    assert!(warns(0.999 * asked) && !warns(1.001 * asked));
}

/// Jobs drawn at random: helical edges, both sides, any arc.
fn drawn(count: usize, seed: u64) -> Vec<Value> {
    let mut state = seed;
    let mut next = |from: f64, to: f64| {
        state = state.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        from + (to - from) * (state >> 11) as f64 / (1_u64 << 53) as f64
    };
    (0..count)
        .map(|_| {
            let teeth = next(1.0, 5.99).floor();
            let diameter = next(8.0, 50.0);
            let mut mode = || {
                let angle: f64 = next(0.0, std::f64::consts::TAU);
                json!({ "direction": [angle.cos(), angle.sin(), next(-0.3, 0.3)], "frequency_hz": next(200.0, 1500.0),
                        "damping_ratio": next(0.01, 0.06), "stiffness_n_per_mm": next(3e3, 3e4) })
            };
            let (tool, work) = (json!([mode(), mode()]), json!([mode()]));
            let entry = next(0.0, 100.0);
            json!({
                "cutter": { "diameter_mm": diameter, "teeth": teeth as u32, "helix_angle_deg": next(0.0, 45.0) },
                "force": { "kind": "mechanistic", "tangential_n_per_mm2": next(500.0, 2500.0), "radial_n_per_mm2": next(100.0, 1200.0),
                           "axial_n_per_mm2": next(0.0, 600.0) },
                "cut": { "entry_deg": entry, "exit_deg": entry + next(20.0, 80.0), "depth_mm": 2,
                         "spindle_speed_rpm": next(3000.0, 20000.0), "feed_mm_per_tooth": 0.1 },
                "tool": { "kind": "modes", "modes": tool }, "work": { "kind": "modes", "modes": work },
                "analyses": ["intervals"]
            })
        })
        .collect()
}

/// Drawn jobs: `PRECUT_TRIALS` of them, a few where that is not said.
pub(crate) fn trials(few: usize) -> usize {
    std::env::var("PRECUT_TRIALS").ok().and_then(|count| count.parse().ok()).unwrap_or(few)
}

/// Unstable stretches against the multiplier at many depths: none thicker than a hundredth of the depth is missed, none is made up.
#[test]
fn intervals_hold_what_a_fine_map_holds() {
    for (k, job) in drawn(trials(2), 7).into_iter().enumerate() {
        let outcome = solve(&job).outcome;
        let most = outcome.examined_to_mm;
        let inside = |depth: f64| {
            outcome.unstable_intervals.iter().any(|interval| {
                depth >= interval.from_mm.unwrap_or(0.0) && depth <= interval.to_mm.unwrap_or(f64::INFINITY)
            })
        };
        let is_near_end = |depth: f64| {
            let ends = outcome.unstable_intervals.iter().flat_map(|interval| [interval.from_mm, interval.to_mm]);
            ends.flatten().any(|end| (depth - end).abs() < 0.01 * most)
        };
        for step in 1..=60 {
            let depth = most * f64::from(step) / 60.0;
            if is_near_end(depth) {
                continue;
            }
            let at = merged(job.clone(), &json!({ "cut": { "depth_mm": depth }, "analyses": ["verdict"] }));
            let multiplier = solve(&at).outcome.multiplier.unwrap();
            assert_eq!(multiplier.modulus > 1.0, inside(depth), "job {k} at {depth}: {job}");
        }
    }
}

/// The same cut: feed and all directions turned, teeth numbered otherwise, a mode in two halves; and what changes little.
#[test]
fn drawn_cuts_are_the_same_where_nothing_changes() {
    for job in drawn(trials(4), 11) {
        let per_tooth = |patch: &dyn Fn(&mut Value)| {
            let mut other = merged(job.clone(), &json!({ "analyses": ["verdict"] }));
            patch(&mut other);
            solve(&other).outcome.multiplier.unwrap().per_tooth
        };
        let plain = per_tooth(&|_| ());
        let halved = per_tooth(&|job| {
            let mode = &mut job["tool"]["modes"][0];
            mode["stiffness_n_per_mm"] = json!(2.0 * mode["stiffness_n_per_mm"].as_f64().unwrap());
            let again = mode.clone();
            job["tool"]["modes"].as_array_mut().unwrap().push(again);
        });
        let turned = per_tooth(&|job| {
            job["cut"]["feed_direction_deg"] = json!(180);
            for side in ["tool", "work"] {
                for mode in job[side]["modes"].as_array_mut().unwrap() {
                    for axis in 0..2 {
                        mode["direction"][axis] = json!(-mode["direction"][axis].as_f64().unwrap());
                    }
                }
            }
        });
        let straight = |helix: f64| per_tooth(&|job| job["cutter"]["helix_angle_deg"] = json!(helix));
        // Uneven by a millionth of a degree: a turn of the same teeth.
        let uneven = per_tooth(&|job| {
            let teeth = job["cutter"]["teeth"].as_f64().unwrap();
            let mut pitch = vec![360.0 / teeth; teeth as usize];
            if teeth > 1.5 {
                (pitch[0], pitch[1]) = (pitch[0] + 1e-5, pitch[1] - 1e-5);
            }
            job["cutter"]["pitch_deg"] = json!(pitch);
        });
        // Both halves against each other swing freely, and nothing reaches them.
        let mode = &job["tool"]["modes"][0];
        let [frequency, ratio] = ["frequency_hz", "damping_ratio"].map(|name| mode[name].as_f64().unwrap());
        let [teeth, speed] = [&job["cutter"]["teeth"], &job["cut"]["spindle_speed_rpm"]].map(|of| of.as_f64().unwrap());
        let free = (-ratio * std::f64::consts::TAU * frequency * 60.0 / (teeth * speed)).exp();
        for (what, other, within) in [
            ("halved", halved / plain.max(free) * plain, 1e-8),
            ("turned", turned, 1e-8),
            ("uneven", uneven, 1e-4),
            ("straight", straight(1e-4) / straight(0.0) * plain, 1e-3),
        ] {
            assert!((other / plain - 1.0).abs() < within, "{what}: {other} for {plain}: {job}");
        }
    }
}
