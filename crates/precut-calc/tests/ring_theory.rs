//! Linear theory and support reactions of the ring against the reference, through jobs with the same angles.
#![allow(clippy::unwrap_used, clippy::panic, missing_docs)]

use crate::ring_support::{reference, run};
use precut_calc::ring_roundness::{Fate, Outcome};
use serde_json::{Value, json};

/// A job whose ring rests at the end of its feed with its centre in the origin, at the angles asked for.
fn at_angles(beta_deg: f64, tool_deg: f64, more: &Value) -> Value {
    let (radius, travel) = (150.0, 0.01);
    let (beta, tool) = (beta_deg.to_radians(), tool_deg.to_radians());
    let mut job = json!({
        "ring": { "radius_mm": radius },
        "supports": { "distance_mm": 2.0 * radius * beta.sin(), "depth_mm": radius * beta.cos() },
        "tool": {
            "x_mm": (radius + travel) * tool.cos(),
            "y_mm": (radius + travel) * tool.sin(),
            "feed_direction_deg": tool_deg + 180.0,
            "feed_mm_per_rev": travel,
            "revolutions": 1.0
        },
        "analyses": ["linear_theory"],
        "highest_order": 20
    });
    for (name, value) in more.as_object().unwrap() {
        job[name] = value.clone();
    }
    job
}

fn outcome(job: &Value) -> Outcome {
    run(job).output
}

#[test]
fn coefficients_delays_and_roots() {
    let file = reference("linear_lobing.json");
    let tolerance = |name: &str| file["tolerance_abs"][name].as_f64().unwrap();
    for case in file["cases"].as_array().unwrap() {
        let (input, expected) = (&case["input"], &case["expected"]);
        let number = |value: &Value, name: &str| value[name].as_f64().unwrap();
        let more = json!({ "compliance_ratio": input["compliance_ratio_K"] });
        let found = outcome(&at_angles(number(input, "beta_deg"), number(input, "alpha_T_deg"), &more));
        let near = |found: f64, expected: f64, tolerance: f64, what: &str| {
            assert!((found - expected).abs() <= tolerance, "{input}: {what}: {found} {expected}");
        };
        near(found.setting.coefficient_a, number(expected, "a"), tolerance("a"), "a");
        near(found.setting.coefficient_b, number(expected, "b"), tolerance("a"), "b");
        near(found.setting.coefficient_sum, number(expected, "abs_sum"), 2.0 * tolerance("a"), "|a| + |b|");
        near(found.setting.delay_a_deg, number(expected, "tau_A_deg"), tolerance("tau_deg"), "delay A");
        near(found.setting.delay_b_deg, number(expected, "tau_B_deg"), tolerance("tau_deg"), "delay B");
        let linear = found.linear_theory.unwrap();
        assert!(linear.complete, "{input}");
        for order in &linear.orders {
            let at = &expected["A_of_k"][order.order.to_string()];
            near(order.visibility_real, at[0].as_f64().unwrap(), tolerance("A_of_k"), "Re A");
            near(order.visibility_imaginary, at[1].as_f64().unwrap(), tolerance("A_of_k"), "Im A");
        }
        let roots = expected["roots"].as_array().unwrap();
        assert_eq!(linear.roots.len(), roots.len(), "{input}");
        for (found, expected) in linear.roots.iter().zip(roots) {
            near(found.lobes, number(expected, "lobes"), tolerance("roots"), "lobes");
            let factor = number(expected, "factor_per_rev");
            near(found.factor_per_revolution, factor, tolerance("roots") * factor.max(1.0) * 7.0, "factor");
        }
    }
}

#[test]
fn opposite_to_a_support_even_waves_go_and_odd_ones_stay() {
    for k in [0.0, 1.0, 4.0] {
        let found = outcome(&at_angles(42.0, 48.0, &json!({ "compliance_ratio": k })));
        let linear = found.linear_theory.unwrap();
        for order in &linear.orders {
            if order.order % 2 == 1 {
                assert_eq!(order.fate, Fate::Stays, "{k} {order:?}");
            } else if k > 0.0 {
                let closed = (k / (1.0_f64 + k)).powi(2);
                assert_eq!(order.fate, Fate::Decays, "{k} {order:?}");
                assert!((order.factor_per_revolution.unwrap() - closed).abs() < 1e-9, "{k} {order:?}");
            } else {
                assert_eq!(order.fate, Fate::Gone, "{order:?}");
            }
        }
    }
}

#[test]
fn supports_bear_what_the_reference_says() {
    let file = reference("support_reactions.json");
    let tolerance = file["tolerance_abs_N"].as_f64().unwrap();
    for case in file["cases"].as_array().unwrap() {
        let (input, expected) = (&case["input"], &case["expected"]);
        let rotation = if input["rotation"] == 1 { "counter_clockwise" } else { "clockwise" };
        let more = json!({
            "forces": { "thrust_n": input["thrust_force_N"], "cutting_n": input["cutting_force_N"], "weight_n": input["weight_N"] },
            "rotation": rotation
        });
        let answer =
            run(&at_angles(input["beta_deg"].as_f64().unwrap(), input["alpha_T_deg"].as_f64().unwrap(), &more));
        let found = answer.output.setting.reactions.clone().unwrap();
        assert!((found.support_a_n - expected["N_A_N"].as_f64().unwrap()).abs() < tolerance, "{case} {found:?}");
        assert!((found.support_b_n - expected["N_B_N"].as_f64().unwrap()).abs() < tolerance, "{case} {found:?}");
        assert_eq!(json!(found.seated), expected["seated"]);
        let torque = expected["drive_torque_needed_Nmm_per_mm_radius"].as_f64().unwrap();
        assert!((found.drive_torque_n_m * 1000.0 / answer.output.setting.circumradius_mm - torque).abs() < 1e-6);
        assert_eq!(answer.warnings.iter().any(|w| w.code == "ring_lifts_off"), !found.seated);
    }
}

#[test]
fn friction_drive_adds_its_own_load() {
    let more = json!({ "forces": { "thrust_n": 400, "cutting_n": 800, "weight_n": 3000, "drive": "rollers" } });
    let found = outcome(&at_angles(42.0165, 47.9835, &more)).setting.reactions.unwrap();
    let (a, b) = (found.driven_support_a_n.unwrap(), found.driven_support_b_n.unwrap());
    // Equilibrium with T_A = T_B = F_c/2 along the rotation, by hand: the vertical sum with u_A, u_B at ∓β from below.
    let (beta, tool) = (42.0165_f64.to_radians(), 47.9835_f64.to_radians());
    let vertical = (a + b) * beta.cos() - 3000.0 - 400.0 * tool.sin() - 800.0 * tool.cos();
    // The tangents turned +90° from the supports: vertical parts cancel.
    let tangents = 400.0 * ((270.0_f64.to_radians() - beta).cos() + (270.0_f64.to_radians() + beta).cos());
    assert!((vertical + tangents).abs() < 1e-6, "{vertical} {tangents}");
    assert!(found.seated && (found.friction_needed.unwrap() - 800.0 / (a + b)).abs() < 1e-12);
}
