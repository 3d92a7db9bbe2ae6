//! The open deflection cases of the diagnosis, whose hidden cause is known.
#![allow(clippy::unwrap_used, clippy::panic, missing_docs)]

mod support;

use precut_calc::calculator::{ForwardModel, Rows, Unwatched};
use precut_calc::deflection_compensation::{
    DeflectionAllowances, DeflectionCompensation, DeflectionPoint, DeflectionRun, Job,
};
use precut_calc::diagnosis::{Bound, Data, Layout, Settings, Subject, Verdict, diagnose};
use serde_json::{Value, json};
use support::prepared;

fn example(name: &str) -> Value {
    let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/reference/diagnosis").join(name);
    serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap()
}

fn job(sketch: &Value) -> Job {
    let (f, reference) = (&sketch["force"], &sketch["force"]["reference"]);
    let power = |key: &str| f[key].as_f64().unwrap();
    let at = |key: &str| reference[key].as_f64().unwrap();
    let (x, p, n) = (power("depth_exponent"), power("feed_exponent"), power("speed_exponent"));
    let coefficient = f["force_at_reference_n"].as_f64().unwrap()
        / (at("depth_mm").powf(x) * at("feed_mm_per_rev").powf(p) * at("speed_m_per_min").powf(n));
    let d = sketch["diameter_mm"].as_f64().unwrap();
    prepared(json!({
        "shaft": { "segments": [{ "length_mm": sketch["length_mm"], "diameter_mm": d, "stock_diameter_mm": d + 2.0 * at("depth_mm") }],
                   "youngs_modulus_n_per_mm2": sketch["youngs_modulus_n_per_mm2"] },
        "supports": [
            { "kind": "centre", "z_mm": 0.0, "compliance_um_per_n": sketch["headstock_compliance_um_per_n"] },
            { "kind": "centre", "z_mm": sketch["length_mm"], "compliance_um_per_n": sketch["tailstock_compliance_um_per_n"] }
        ],
        "carriage": { "compliance_um_per_n": sketch["carriage_compliance_um_per_n"] },
        "force": { "kind": "power_law", "passive": { "coefficient": coefficient, "depth_exponent": x, "feed_exponent": p, "speed_exponent": n } },
        "cut": { "feed_mm_per_rev": at("feed_mm_per_rev"), "speed_m_per_min": at("speed_m_per_min"), "feed_direction": "to_headstock" },
        "include": { "tangential": false, "axial_moment": false, "weight": false }
    }))
}

fn bound(sketch: &Value) -> (Bound<DeflectionCompensation>, Data) {
    let base = &sketch["job"];
    let mut number = std::collections::BTreeMap::new();
    let runs: Vec<DeflectionRun> = sketch["runs"]
        .as_array()
        .unwrap()
        .iter()
        .enumerate()
        .map(|(index, run)| {
            number.insert(run["run"].as_u64().unwrap(), index);
            let direction = run["direction"].as_str().unwrap().replace("towards", "to");
            serde_json::from_value(json!({
                "depth_mm": run["depth_mm"], "feed_mm_per_rev": run["feed_mm_per_rev"],
                "speed_m_per_min": run["speed_m_per_min"], "feed_direction": direction,
                "tool_path_at_start_m": run["tool_path_at_start_m"],
                "warm_time_at_start_min": run["warm_time_at_start_min"]
            }))
            .unwrap()
        })
        .collect();
    let rows = sketch["measurements"].as_array().unwrap();
    let run_of = |row: &Value| number[&row["run"].as_u64().unwrap()];
    let points =
        rows.iter().map(|row| (run_of(row), DeflectionPoint { z_mm: row["z_mm"].as_f64().unwrap() })).collect();
    let mut traces: Vec<((usize, u64), Vec<usize>)> = Vec::new();
    for (index, row) in rows.iter().enumerate() {
        let id = (run_of(row), row["trace"].as_u64().unwrap());
        match traces.iter_mut().find(|(of, _)| *of == id) {
            Some((_, rows)) => rows.push(index),
            None => traces.push((id, vec![index])),
        }
    }
    let quantity = "diameter_deviation_um";
    let prepared = DeflectionCompensation::prepare(&job(base), &Rows { runs, points }, quantity, &Unwatched).unwrap();
    let a = &base["allowances"];
    let share = |key: &str| a[key].as_f64().unwrap();
    let allowances = DeflectionAllowances {
        force_level_rel: share("force_level_rel"),
        force_per_run_rel: share("force_per_run_rel"),
        bending_rel: share("bending_rel"),
        setup_diameter_um: share("setup_diameter_um"),
        ..DeflectionAllowances::default()
    };
    let design = DeflectionCompensation::design(&prepared);
    let layout = Layout {
        run_of_trace: traces.iter().map(|((run, _), _)| *run).collect(),
        traces: traces.into_iter().map(|(_, rows)| rows).collect(),
        design,
    };
    let value = rows.iter().map(|row| row["diameter_deviation_um"].as_f64().unwrap()).collect();
    (Bound::new(prepared, allowances, quantity), Data { value, uncertainty: None, layout })
}

fn verdict(name: &str) -> (Verdict, Vec<String>) {
    let sketch = example(name);
    let (subject, data) = bound(&sketch);
    let start = std::time::Instant::now();
    let found = diagnose(&subject, &data, Settings::default(), &Unwatched).unwrap();
    println!("{name}: {:?}, noise {:?} rho {}", start.elapsed(), found.noise.sigma, found.noise.rho);
    println!("  answer {}", sketch["answer"]);
    println!("  none {:.4} unnamed {:.4} outliers {:?}", found.none, found.unnamed, found.outliers.rows);
    let kind = |h: usize| subject.hypotheses()[h].cause.kind;
    for set in found.sets.iter().take(6) {
        let names: Vec<&str> = set.members.iter().map(|h| kind(*h)).collect();
        let values: Vec<_> = set.settings.iter().map(|s| s.values.clone()).collect();
        println!(
            "  {:.4} {names:?} remainder {} {values:?} +- {:?}",
            set.posterior, set.with_remainder, set.standard_deviations
        );
    }
    let names = match &found.verdict {
        Verdict::Named(set) | Verdict::Unknown(set) => set.iter().map(|h| kind(*h).to_owned()).collect(),
        _ => Vec::new(),
    };
    (found.verdict, names)
}

#[test]
fn nothing_is_found_where_nothing_is_hidden() {
    assert_eq!(verdict("example-deflection-adequate.json").0, Verdict::Adequate);
}

#[test]
fn single_causes_are_named() {
    for (name, cause) in [
        ("example-deflection-headstock_compliance.json", "headstock_compliance"),
        ("example-deflection-tool_wear.json", "tool_wear"),
    ] {
        let (found, names) = verdict(name);
        assert!(matches!(found, Verdict::Named(_)), "{found:?}");
        assert_eq!(names, [cause]);
    }
}

#[test]
fn two_causes_are_named_together() {
    let (found, names) = verdict("example-deflection-tailstock_offset-speed_exponent.json");
    assert!(matches!(found, Verdict::Named(_)), "{found:?}");
    assert_eq!(names, ["tailstock_offset", "speed_exponent"]);
}

#[test]
fn what_the_catalogue_does_not_hold_is_not_named() {
    let (found, _) = verdict("example-deflection-s_curve.json");
    assert!(matches!(found, Verdict::Unknown(_)), "{found:?}");
}
