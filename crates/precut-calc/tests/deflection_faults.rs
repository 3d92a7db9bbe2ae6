//! What a refused job is told: both ends of every range, and no fault that only follows from another one.
#![allow(clippy::unwrap_used, clippy::panic, missing_docs)]

use precut_calc::calculator::{Check, Finding, Value as Said, Violations};
use precut_calc::deflection_compensation::Job;
use serde_json::{Value, json};

pub(crate) fn faults(job: Value) -> Vec<Finding> {
    let job: Job = serde_json::from_value(job).unwrap();
    let mut violations = Violations::default();
    job.check(&mut violations);
    violations.into_vec()
}

fn job() -> Value {
    json!({
        "shaft": {
            "segments": [
                { "length_mm": 1000.0, "diameter_mm": 90.0, "stock_diameter_mm": 91.0 },
                { "length_mm": 1000.0, "diameter_mm": 80.0, "stock_diameter_mm": 91.0 }
            ],
            "youngs_modulus_n_per_mm2": 210_000.0
        },
        "supports": [
            { "kind": "centre", "z_mm": 0.0 },
            { "kind": "steady_rest", "z_mm": 700.0 },
            { "kind": "centre", "z_mm": 2000.0 }
        ],
        "force": { "kind": "constant", "passive_n": 100.0 },
        "cut": { "feed_mm_per_rev": 0.2, "speed_m_per_min": 100.0 }
    })
}

fn changed(changes: &[(&str, Value)]) -> Value {
    let mut job = job();
    for (pointer, value) in changes {
        let (parent, name) = pointer.rsplit_once('/').unwrap();
        job.pointer_mut(parent).unwrap()[name] = value.clone();
    }
    job
}

/// The ends of what is allowed, as a finding names them.
fn range(finding: &Finding) -> (Vec<(&'static str, f64)>, Option<&'static str>) {
    let ends = ["minimum", "above", "maximum", "below"].into_iter();
    let stated = ends.filter_map(|name| match finding.values.get(name) {
        Some(Said::Number(number)) => Some((name, *number)),
        _ => None,
    });
    (stated.collect(), finding.unit)
}

#[test]
fn every_fault_of_a_range_states_both_ends_and_the_unit() {
    let list = |z_mm: Value| json!({ "kind": "list", "z_mm": z_mm });
    let cases = [
        ("/supports/1/z_mm", json!(-1.0), "support_outside_shaft", [("minimum", 0.0), ("maximum", 2000.0)], "mm"),
        ("/supports/1/z_mm", json!(2001.0), "support_outside_shaft", [("minimum", 0.0), ("maximum", 2000.0)], "mm"),
        ("/stations", list(json!([-1.0, 5.0])), "station_outside_shaft", [("minimum", 0.0), ("maximum", 2000.0)], "mm"),
        ("/stations", list(json!([5.0, 4.0])), "stations_not_ascending", [("above", 5.0), ("maximum", 2000.0)], "mm"),
        (
            "/stock_profile",
            json!([{ "z_mm": 5.0, "diameter_mm": 91.0 }, { "z_mm": 4.0, "diameter_mm": 91.0 }]),
            "stock_profile_not_ascending",
            [("above", 5.0), ("maximum", 1e5)],
            "mm",
        ),
        (
            "/stock_profile",
            json!([{ "z_mm": 5.0, "diameter_mm": -91.0 }]),
            "bad_diameter",
            [("minimum", 0.01), ("maximum", 1e4)],
            "mm",
        ),
        (
            "/shaft/segments/0/stock_diameter_mm",
            json!(89.0),
            "stock_below_finish",
            [("minimum", 90.0), ("maximum", 1e4)],
            "mm",
        ),
        (
            "/passes",
            json!([{ "diameter_mm": 85.0 }]),
            "passes_incomplete",
            [("minimum", 0.01), ("maximum", 80.0)],
            "mm",
        ),
        (
            "/passes",
            json!([{ "diameter_mm": 70.0 }, { "diameter_mm": 75.0 }]),
            "passes_not_descending",
            [("minimum", 0.01), ("below", 70.0)],
            "mm",
        ),
        ("/force/passive_n", json!(-1.0), "bad_constant_force", [("minimum", 0.0), ("maximum", 1e6)], "N"),
        (
            "/effects",
            json!([{ "kind": "headstock_compliance", "delta_um_per_n": -0.5 }]),
            "effect_beyond_base",
            [("minimum", 0.0), ("maximum", 10.0)],
            "um/N",
        ),
        (
            "/effects",
            json!([{ "kind": "depth_exponent", "delta": -0.1, "reference_depth_mm": 1.0 }]),
            "force_falls_with_depth",
            [("minimum", 0.0), ("maximum", 3.0)],
            "1",
        ),
    ];
    for (pointer, value, code, ends, unit) in cases {
        let found = faults(changed(&[(pointer, value.clone())]));
        let [finding] = &found[..] else { panic!("{pointer} = {value}: {found:?}") };
        assert_eq!((finding.code, range(finding)), (code, (ends.to_vec(), Some(unit))), "{pointer} = {value}");
        let limit = finding.limit.unwrap();
        assert!(limit != 0.0 || limit.is_sign_positive(), "{pointer}: {limit:?}");
    }
    let hollow = faults(changed(&[("/shaft/segments/0/bore_diameter_mm", json!(95.0))]));
    assert_eq!(hollow.len(), 1, "{hollow:?}");
    assert_eq!(range(&hollow[0]), (vec![("minimum", 0.0), ("below", 90.0)], Some("mm")));
}

/// A support beside the shaft is told the end that it lies beyond.
#[test]
fn a_support_beside_the_shaft_has_the_nearer_end_as_its_limit() {
    for (z, end) in [(-1.0, 0.0), (2001.0, 2000.0)] {
        let found = faults(changed(&[("/supports/1/z_mm", json!(z))]));
        assert_eq!((found[0].value, found[0].limit), (Some(z), Some(end)));
    }
}

/// What the schema refuses is told by the schema; the rules add nothing that only follows from it.
#[test]
fn what_follows_from_an_impossible_shaft_is_not_told() {
    let stations = json!({ "kind": "list", "z_mm": [0.0, 1000.0, 2000.0] });
    let passes = json!([{ "diameter_mm": 85.0 }, { "diameter_mm": 70.0 }]);
    for length in [1e308, -1000.0, 0.0] {
        let found = faults(changed(&[("/shaft/segments/0/length_mm", json!(length)), ("/stations", stations.clone())]));
        assert!(found.is_empty(), "{length}: {found:?}");
    }
    for diameter in [-90.0, 0.0, 1e300] {
        let all: Vec<(String, Value)> = (0..2)
            .map(|i| (format!("/shaft/segments/{i}/diameter_mm"), json!(diameter)))
            .chain([("/passes".to_owned(), passes.clone())])
            .collect();
        let all: Vec<(&str, Value)> = all.iter().map(|(pointer, value)| (pointer.as_str(), value.clone())).collect();
        let found = faults(changed(&all));
        assert!(found.is_empty(), "{diameter}: {found:?}");
    }
    let found = faults(changed(&[("/shaft/segments", json!([])), ("/stations", stations)]));
    assert!(matches!(&found[..], [fault] if fault.code == "no_segments"), "{found:?}");
    // A blank thinner than the drawing is the reason why nothing is to be turned.
    let thin =
        [("/shaft/segments/0/stock_diameter_mm", json!(9.0)), ("/shaft/segments/1/stock_diameter_mm", json!(9.0))];
    let found = faults(changed(&thin));
    assert!(found.len() == 2 && found.iter().all(|fault| fault.code == "stock_below_finish"), "{found:?}");
}

#[test]
fn what_follows_from_one_bad_row_is_not_told_of_the_next() {
    let found = faults(changed(&[("/passes", json!([{ "diameter_mm": -5.0 }, { "diameter_mm": 70.0 }]))]));
    assert!(found.is_empty(), "{found:?}");
    let found = faults(changed(&[("/stations", json!({ "kind": "list", "z_mm": [0.0, 5000.0, 1000.0] }))]));
    assert!(matches!(&found[..], [fault] if fault.code == "station_outside_shaft"), "{found:?}");
}
