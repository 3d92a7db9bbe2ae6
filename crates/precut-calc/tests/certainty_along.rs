//! Errors that are new at every place along a shaft: against closed forms, and against errors that are drawn from their correlation.
#![allow(clippy::unwrap_used, clippy::panic, missing_docs)]

use serde_json::{Value, json};

use crate::deflection_certainty::{job as shaft, number};
use crate::draw::Draw;

const OWN_UM: f64 = 5.0;

fn quantity(level: &str, length_mm: Option<f64>) -> Value {
    let mut one = json!({ "quantity": "spindle_scatter", "level": level,
        "distribution": { "kind": "normal", "standard_uncertainty_um": OWN_UM } });
    if let Some(length_mm) = length_mm {
        one["correlation_length_mm"] = json!(length_mm);
    }
    one
}

fn told(one: Value, half_um: f64) -> Value {
    let job = shaft(&json!([one]), &json!({ "diameter_um": 2.0 * half_um }));
    serde_json::to_value(crate::support::solved(job)).unwrap()["conformance"].clone()
}

/// Alike over a length far beyond the shaft it is one number for all of the shaft.
#[test]
fn what_is_alike_all_along_is_new_for_every_part() {
    let part = told(quantity("part", None), 8.0);
    let along = told(quantity("place", Some(100_000.0)), 8.0);
    // Over 600 mm of 100 m the correlation is 1 - 5e-5: differences along the shaft of a hundredth of the deviation.
    let [part, along] = [part, along].map(|of| number(&of, "/joint/probability"));
    assert!((part - along).abs() < 0.01, "{part} {along}");
}

/// Drawn by the triangular factor of the correlation at many places, a part is good as often as is told.
#[test]
fn parts_are_good_as_often_as_told() {
    const PLACES: usize = 61;
    let draws = 10_000;
    for (length_mm, half_um) in [(250.0, 8.0), (80.0, 11.0)] {
        let rho = |i: usize, j: usize| {
            let q = 3.0_f64.sqrt() * 600.0 * i.abs_diff(j) as f64 / (PLACES - 1) as f64 / length_mm;
            (1.0 + q) * (-q).exp()
        };
        let mut lower = vec![vec![0.0; PLACES]; PLACES];
        for i in 0..PLACES {
            for j in 0..=i {
                let rest = rho(i, j) - (0..j).map(|k| lower[i][k] * lower[j][k]).sum::<f64>();
                lower[i][j] = if i == j { rest.sqrt() } else { rest / lower[j][j] };
            }
        }
        let mut draw = Draw::new(17);
        let good = (0..draws)
            .filter(|_| {
                let scores: Vec<f64> = (0..PLACES).map(|_| normal(&mut draw)).collect();
                let error = |row: &Vec<f64>| OWN_UM * row.iter().zip(&scores).map(|(a, b)| a * b).sum::<f64>();
                lower.iter().all(|row| error(row).abs() <= half_um)
            })
            .count();
        let share = good as f64 / f64::from(draws);
        let of = told(quantity("place", Some(length_mm)), half_um);
        eprintln!("{length_mm} mm: {} of {draws}: {share}", of["joint"]);
        let deviation = (share * (1.0 - share) / f64::from(draws)).sqrt();
        let slack = 2.5 * deviation + number(&of, "/joint/numerical_error") + 0.002;
        assert!((number(&of, "/joint/probability") - share).abs() < slack, "{share}: {}", of["joint"]);
        // All of it is new on the next part.
        assert!(number(&of, "/setup/share_common_to_all").abs() < 1e-9);
        // Of widths of nothing beside it no share: all modes of the quantity are one.
        let contributions = of["contributions"].as_array().unwrap();
        let own: Vec<&Value> = contributions.iter().filter(|one| one["quantity"] == "spindle_scatter").collect();
        assert_eq!((own.len(), &own[0]["level"]), (1, &json!("place")));
        assert!((number(own[0], "/share_of_variance") - 1.0).abs() < 1e-9, "{contributions:?}");
    }
}

/// By Box and Muller.
fn normal(draw: &mut Draw) -> f64 {
    (-2.0 * draw.between(1e-12, 1.0).ln()).sqrt() * (std::f64::consts::TAU * draw.share()).cos()
}

#[test]
fn what_cannot_be_along_a_shaft_is_refused() {
    let refused = |one: Value, correlations: Value| {
        let own =
            json!({ "quantity": "force", "distribution": { "kind": "lognormal", "log_standard_deviation": 0.1 } });
        let quantities = if one["quantity"] == "force" { json!([one]) } else { json!([one, own]) };
        let mut job = shaft(&quantities, &json!({ "diameter_um": 30 }));
        job["uncertainty"]["correlations"] = correlations;
        let codes: Vec<&str> = crate::deflection_faults::faults(job).iter().map(|fault| fault.code).collect();
        codes
    };
    let none = || json!([]);
    let mut force = quantity("place", Some(80.0));
    force["quantity"] = json!("force");
    force["distribution"] = json!({ "kind": "lognormal", "log_standard_deviation": 0.1 });
    assert_eq!(refused(force, none()), ["level_of_quantity"]);
    let mut even = quantity("place", Some(80.0));
    even["distribution"] = json!({ "kind": "uniform", "half_width_um": 10.0 });
    assert_eq!(refused(even, none()), ["level_of_quantity"]);
    assert_eq!(refused(quantity("place", None), none()), ["correlation_length_missing"]);
    // Of 600 mm.
    assert_eq!(refused(quantity("place", Some(29.9)), none()), ["correlation_length_too_short"]);
    assert!(refused(quantity("place", Some(30.1)), none()).is_empty());
    assert_eq!(refused(quantity("part", Some(80.0)), none()), ["correlation_length_unused"]);
    let pair = json!([{ "between": ["spindle_scatter", "force"], "coefficient": 0.5 }]);
    assert_eq!(refused(quantity("place", Some(80.0)), pair), ["place_correlated"]);
}
