//! The reference cases of the ring: the paper's runs as printed and with a clear start, rollers, compliance, lobing,
//! linear theory, closed forms, support reactions.
#![allow(clippy::unwrap_used, clippy::panic, missing_docs)]

use crate::ring_support::{reference, run, translate};
use precut_calc::calculator::Answer;
use precut_calc::ring_roundness::{Outcome, SimulationOutcome};
use serde_json::{Value, json};

/// Compares within the file's own tolerance, which is three times what halving the nodes changes.
fn near(name: &str, case: &Value, found: f64) {
    let (expected, tolerance) =
        (case["expected"][name].as_f64().unwrap(), case["tolerance_abs"][name].as_f64().unwrap());
    assert!(
        (found - expected).abs() <= tolerance,
        "{}: {name} is {found}, expected {expected} within {tolerance}",
        case["name"]
    );
}

fn simulation(answer: &Answer<Outcome>) -> &SimulationOutcome {
    answer.output.simulation.as_ref().unwrap()
}

/// What must hold at the nodes that a user would ask for.
fn filtered_values(case: &Value) -> Answer<Outcome> {
    let answer = run(&translate(&case["input"]));
    let simulated = simulation(&answer);
    let end = simulated.end.as_ref().unwrap();
    near("RONt_LSCI_filtered_um", case, end.filtered.least_squares_um);
    near("RONq_LSCI_filtered_um", case, end.filtered.rms_um);
    near("RONt_MZCI_filtered_um", case, end.filtered.minimum_zone_um);
    near("RONt_MICI_filtered_um", case, end.filtered.inscribed_um);
    near("RONt_MCCI_filtered_um", case, end.filtered.circumscribed_um);
    near("LSCI_radius_mm", case, end.mean_radius_mm);
    near("first_contact_rev", case, simulated.first_contact_rev.unwrap());
    near("last_air_cut_rev", case, simulated.last_air_cut_rev.unwrap());
    near("uncut_fraction", case, simulated.uncut_share);
    for (order, expected) in case["expected"]["harmonic_amplitudes_um"].as_object().unwrap() {
        let tolerance = case["tolerance_abs"]["harmonic_amplitudes_um"][order].as_f64().unwrap();
        let at: usize = order.parse().unwrap();
        let found = simulated.spectrum.end_um[at - 2];
        assert!(
            (found - expected.as_f64().unwrap()).abs() <= tolerance,
            "{}: order {order}: {found} {expected}",
            case["name"]
        );
    }
    let setting = &answer.output.setting;
    // Printed to twelve digits.
    assert!((setting.circumradius_mm - case["expected"]["circumradius_end_mm"].as_f64().unwrap()).abs() < 2e-9);
    assert!((setting.coefficient_a - case["expected"]["coeff_a"].as_f64().unwrap()).abs() < 1e-9);
    assert!((setting.coefficient_b - case["expected"]["coeff_b"].as_f64().unwrap()).abs() < 1e-9);
    let mut expected: Vec<String> =
        case["expected"]["warnings"].as_array().unwrap().iter().map(|w| w.as_str().unwrap().to_lowercase()).collect();
    let listed = [
        "setting_not_diametral_lobes_grow",
        "not_cleaned_up",
        "first_bite_too_large_odd_lobes_locked_in",
        "supports_too_close_unstable",
    ];
    let mut found: Vec<String> =
        answer.warnings.iter().map(|w| w.code.to_owned()).filter(|code| listed.contains(&code.as_str())).collect();
    expected.sort();
    found.sort();
    assert_eq!(found, expected, "{}", case["name"]);
    answer
}

/// Unfiltered values and the largest bite, at the nodes behind the expected values.
fn unfiltered_values(case: &Value) {
    let mut job = translate(&case["input"]);
    job["samples"] = case["samples_of_expected"].clone();
    let answer = run(&job);
    let simulated = simulation(&answer);
    let end = simulated.end.as_ref().unwrap();
    near("RONt_LSCI_unfiltered_um", case, end.unfiltered.least_squares_um);
    near("RONt_MZCI_unfiltered_um", case, end.unfiltered.minimum_zone_um);
    near("max_depth_of_cut_um", case, simulated.largest_bite_um.unwrap());
    near("RONt_LSCI_filtered_um", case, end.filtered.least_squares_um);
}

fn both(name: &str) {
    let case = reference(name);
    let answer = filtered_values(&case);
    let simulated = simulation(&answer);
    // The estimate of the error covers the difference to the reference, which has more nodes, up to the reference's own
    // error (a third of its tolerance).
    let end = simulated.end.as_ref().unwrap();
    let error = simulated.end_error.as_ref().unwrap().filtered.least_squares_um;
    let off = (end.filtered.least_squares_um - case["expected"]["RONt_LSCI_filtered_um"].as_f64().unwrap()).abs();
    let slack = case["tolerance_abs"]["RONt_LSCI_filtered_um"].as_f64().unwrap() / 3.0;
    assert!(off <= error + slack, "{name}: off by {off}, estimated {error}");
    unfiltered_values(&case);
}

#[test]
fn paper_as_printed_32() {
    both("paper_as_printed_32rev_1.5mm.json");
}

#[test]
fn paper_as_printed_64() {
    both("paper_as_printed_64rev_1.5mm.json");
}

#[test]
fn paper_as_printed_256() {
    both("paper_as_printed_256rev_1.5mm.json");
}

#[test]
fn paper_as_printed_128_revolutions_of_3_mm() {
    both("paper_as_printed_128rev_3.0mm.json");
}

#[test]
fn clear_start_32() {
    both("clear_start_feed_1.5_over_32_spark0.json");
    both("clear_start_feed_1.5_over_32_spark1.json");
}

#[test]
fn clear_start_64() {
    both("clear_start_feed_1.5_over_64_spark0.json");
    both("clear_start_feed_1.5_over_64_spark1.json");
}

#[test]
fn clear_start_128_revolutions_of_3_mm() {
    both("clear_start_feed_3.0_over_128_spark0.json");
    both("clear_start_feed_3.0_over_128_spark1.json");
}

#[test]
fn clear_start_256() {
    both("clear_start_feed_1.5_over_256_spark0.json");
}

#[test]
fn clear_start_256_with_spark_out() {
    both("clear_start_feed_1.5_over_256_spark1.json");
}

#[test]
fn odd_lobes_are_not_removed() {
    both("odd_lobes_not_removed.json");
}

#[test]
fn tool_at_the_top_makes_lobes() {
    both("tool_at_top_lobing.json");
}

#[test]
fn compliance() {
    both("compliant_K1.json");
}

#[test]
fn rollers() {
    both("rollers_r20.json");
}

/// The closed form per angle, of first order in the deviations, in the limit of many nodes.
#[test]
fn closed_form_of_the_diametral_setting() {
    let case = reference("closed_form_diametral_clear_start.json");
    for (name, expected) in case["expected"].as_object().unwrap() {
        let feed = match &name[..name.find(" spark").unwrap()] {
            "S=1.5/32" => 1.5 / 32.0,
            "S=1.5/64" | "S=3.0/128" => 1.5 / 64.0,
            "S=1.5/256" => 1.5 / 256.0,
            other => panic!("{other}"),
        };
        let spark = if name.ends_with("spark1") { 1.0 } else { 0.0 };
        // The travel of the simulated cases beside it.
        let file = format!(
            "clear_start_feed_{}_spark{spark}.json",
            name[2..name.find(" spark").unwrap()].replace('/', "_over_")
        );
        let mut input = case["input"].clone();
        input["feed_per_rev_mm"] = json!(feed);
        input["spark_out_revolutions"] = json!(spark);
        input["revolutions"] = reference(&file)["input"]["revolutions"].clone();
        // Teeth 0.13° wide want more than the 3600 nodes of the others; the limit is that of many nodes.
        input["samples"] = json!(if feed < 0.01 { 14_400 } else { 7200 });
        let answer = run(&translate(&input));
        let simulated = simulation(&answer);
        let end = simulated.end.as_ref().unwrap();
        let (radius, ron) = (expected["LSCI_radius_mm"].as_f64().unwrap(), expected["RONt_LSCI_um"].as_f64().unwrap());
        assert!((end.mean_radius_mm - radius).abs() < 2e-5, "{name}: {} {radius}", end.mean_radius_mm);
        let teeth = answer.output.setting.half_turn_reduction_um;
        let found = end.unfiltered.least_squares_um;
        if spark < 0.5 {
            assert!((found - ron).abs() < 0.1 * ron, "{name}: {found} {ron}");
            // The step of the spiral s = D' is the only even content: A_k = s/(πk).
            for k in [2_usize, 4, 6, 8] {
                let spiral = teeth / (std::f64::consts::PI * k as f64);
                let found = simulated.spectrum.end_um[k - 2];
                assert!((found - spiral).abs() < 0.01 * spiral, "{name}: order {k}: {found} {spiral}");
            }
        } else {
            assert!((found - ron).abs() < 1.0 && found <= teeth, "{name}: {found} {ron} {teeth}");
        }
    }
}

/// Even waves fall by (K/(1+K))² per revolution, odd ones stay.
#[test]
fn waves_decay_as_the_closed_form_says() {
    let case = reference("closed_form_even_decay_with_compliance.json");
    let tolerance = case["tolerance_abs_um"].as_f64().unwrap();
    let complex = |input: &Value, k: usize| -> (f64, f64) {
        let mut job = translate(input);
        job["error_estimate"] = json!("half_samples");
        let answer = run(&job);
        let spectrum = &simulation(&answer).spectrum;
        let phase = k as f64 * spectrum.end_angle_of_max_deg[k - 2].to_radians();
        (spectrum.end_um[k - 2] * phase.cos(), spectrum.end_um[k - 2] * phase.sin())
    };
    for expected in case["expected"].as_array().unwrap() {
        let k = usize::try_from(expected["k"].as_u64().unwrap()).unwrap();
        let mut input = case["input"].clone();
        input["compliance_ratio_K"] = expected["K"].clone();
        input["revolutions"] = expected["revolutions"].clone();
        let bare = complex(&input, k);
        input["profile"]["harmonics"] = json!([{ "k": k, "amplitude_um": 1.0, "angle_of_max_deg": 0.0 }]);
        let waved = complex(&input, k);
        let found = (waved.0 - bare.0).hypot(waved.1 - bare.1);
        let closed = expected["amplitude_um"].as_f64().unwrap();
        assert!((found - closed).abs() < tolerance, "k = {k}, K = {}: {found} {closed}", expected["K"]);
    }
}
