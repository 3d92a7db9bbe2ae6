//! Jobs at the ends of every range: each is answered with finite numbers or refused with a reason, never our own fault.

use precut::engine::{Body, Error, Given, solve_now};
use precut::registry::Registry;
use precut_calc::calculator::{Failure, Unwatched};
use proptest::prelude::*;
use serde_json::{Value, json};

/// Between the ends evenly in the logarithm, and often one of the ends.
fn wide(low: f64, high: f64) -> impl Strategy<Value = f64> {
    prop_oneof![1 => Just(low), 1 => Just(high), 4 => (low.ln()..high.ln()).prop_map(move |x| x.exp().clamp(low, high))]
}

/// The same, and often 0.
fn wide_or_zero(high: f64) -> impl Strategy<Value = f64> {
    prop_oneof![1 => Just(0.0), 2 => wide(1e-9, high)]
}

fn segment() -> impl Strategy<Value = Value> {
    (wide(0.001, 100_000.0), wide(0.01, 5000.0), wide(1e-9, 1.0), prop::sample::select(vec![0.0, 0.5, 0.999_999])).prop_map(
        |(length, d, stock, bore)| {
            json!({ "length_mm": length, "diameter_mm": d, "stock_diameter_mm": d * (1.0 + stock), "bore_diameter_mm": bore * d })
        },
    )
}

/// A support at a share of the length; its station is put in when the length is known.
fn support() -> impl Strategy<Value = (Value, f64)> {
    let spring = || wide_or_zero(1000.0);
    prop_oneof![
        (spring(), 0.0..=1.0_f64).prop_map(|(c, at)| (json!({ "kind": "centre", "compliance_um_per_n": c }), at)),
        (spring(), wide_or_zero(1.0), 0.0..=1.0_f64).prop_map(|(c, r, at)| {
            (json!({ "kind": "chuck", "compliance_um_per_n": c, "rotational_compliance_rad_per_n_mm": r }), at)
        }),
        (spring(), wide_or_zero(1e5), 0.0..=1.0_f64).prop_map(|(c, gap, at)| {
            (json!({ "kind": "steady_rest", "compliance_um_per_n": c, "one_sided": true, "gap_um": gap }), at)
        }),
        (spring(), 0.0..=1.0_f64).prop_map(|(c, at)| (json!({ "kind": "steady_rest", "compliance_um_per_n": c }), at)),
        (spring(), -100.0..=100.0_f64, any::<bool>()).prop_map(|(c, offset, one_sided)| {
            (
                json!({ "kind": "follow_rest", "offset_mm": offset, "compliance_um_per_n": c, "one_sided": one_sided }),
                f64::NAN,
            )
        }),
    ]
}

fn term() -> impl Strategy<Value = Value> {
    (wide(1e-3, 1e7), prop::sample::select(vec![0.0, 0.3, 0.9, 1.0, 2.0, 3.0]), -1.0..2.0_f64, -1.0..1.0_f64, wide_or_zero(1e5))
        .prop_map(|(c, z, feed, speed, constant)| {
            json!({ "coefficient": c, "depth_exponent": z, "feed_exponent": feed, "speed_exponent": speed, "constant_n": constant })
        })
}

fn force() -> impl Strategy<Value = Value> {
    prop_oneof![
        (term(), term(), term())
            .prop_map(|(p, m, f)| json!({ "kind": "power_law", "passive": p, "main": m, "feed": f })),
        (wide_or_zero(1e6), wide_or_zero(1e6), wide_or_zero(1e6))
            .prop_map(|(p, m, f)| json!({ "kind": "constant", "passive_n": p, "main_n": m, "feed_n": f })),
        (0.1..=90.0_f64, wide_or_zero(10.0), wide(1.0, 1e4), 0.0..0.9_f64, wide(1.0, 1e4), 0.0..0.9_f64).prop_map(
            |(angle, nose, kc, mc, kn, mn)| {
                json!({
                    "kind": "kienzle", "cutting_edge_angle_deg": angle, "nose_radius_mm": nose,
                    "specific_cutting_force_n_per_mm2": kc, "cutting_exponent": mc,
                    "specific_normal_force_n_per_mm2": kn, "normal_exponent": mn
                })
            }
        ),
    ]
}

fn effects() -> impl Strategy<Value = Value> {
    let each = vec![
        json!({ "kind": "force_level", "delta": -0.95 }),
        json!({ "kind": "depth_exponent", "delta": -0.9, "reference_depth_mm": 0.001 }),
        json!({ "kind": "depth_exponent", "delta": 3.0, "reference_depth_mm": 0.001 }),
        json!({ "kind": "size_offset", "offset_um": -1000.0 }),
        json!({ "kind": "hardness_gradient", "gradient": 1.9 }),
        json!({ "kind": "chuck_rotational_stiffness", "ktheta_n_mm_per_rad": 1.0 }),
        json!({ "kind": "thermal_growth", "growth_um": 600.0, "time_constant_min": 0.05 }),
        json!({ "kind": "bending_scale", "delta": -0.9 }),
        json!({ "kind": "uncut_side_stiffness" }),
        json!({ "kind": "steady_rest_offset", "station_mm": 0.0, "offset_um": 1000.0 }),
    ];
    prop::sample::subsequence(each, 0..4).prop_map(Value::from)
}

fn job() -> impl Strategy<Value = Value> {
    (
        prop::collection::vec(segment(), 1..5),
        prop::collection::vec(support(), 1..5),
        any::<bool>(),
        force(),
        effects(),
        (wide(1000.0, 2e6), wide(1e-4, 20.0), wide(0.01, 20_000.0)),
        (any::<[bool; 6]>(), prop::sample::select(vec!["finished", "stock", "mixed"])),
    )
        .prop_map(|(segments, supports, centres, force, effects, (modulus, feed, speed), (flags, section))| {
            let length: f64 = segments.iter().map(|s| s["length_mm"].as_f64().unwrap()).sum();
            let mut placed: Vec<Value> = supports
                .into_iter()
                .map(|(mut support, share)| {
                    if share.is_finite() {
                        support["z_mm"] = json!((share * length).min(length));
                    }
                    support
                })
                .collect();
            if centres {
                placed.push(json!({ "kind": "centre", "z_mm": 0.0 }));
                placed.push(json!({ "kind": "centre", "z_mm": length, "compliance_um_per_n": 0.02 }));
            }
            let effects: Vec<Value> = effects
                .as_array()
                .unwrap()
                .iter()
                .cloned()
                .map(|mut effect| {
                    let rest = placed.iter().find(|s| s["kind"] == "steady_rest");
                    if let (true, Some(rest)) = (effect["kind"] == "steady_rest_offset", rest) {
                        effect["station_mm"] = rest["z_mm"].clone();
                    }
                    effect
                })
                .collect();
            json!({
                "shaft": { "segments": segments, "youngs_modulus_n_per_mm2": modulus, "section": section,
                           "theory": if flags[0] { "timoshenko" } else { "euler_bernoulli" } },
                "supports": placed,
                "force": force,
                "cut": if flags[1] { json!({ "feed_mm_per_rev": feed, "speed_m_per_min": speed }) }
                       else { json!({ "feed_mm_per_rev": feed, "spindle_speed_rpm": speed, "feed_direction": "to_tailstock" }) },
                "include": { "tangential": flags[2], "axial_moment": flags[3], "weight": flags[4] },
                "stations": { "kind": "per_zone", "count": 5 },
                "detail": if flags[5] { "full" } else { "profile" },
                "tolerance": { "form_um": 10.0 },
                "effects": effects,
                "conditions": { "tool_path_at_start_m": 0.0, "warm_time_at_start_min": 1e5 }
            })
        })
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 2000, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn every_job_is_answered_or_refused_with_a_reason(job in job()) {
        thread_local! {
            static REGISTRY: Registry = Registry::standard().unwrap();
        }
        let solved = REGISTRY.with(|registry| {
            solve_now(registry, "deflection-compensation", Body::Json(job.to_string().into()), &Given::default(), &Unwatched)
        });
        match solved {
            Ok(stored) => {
                for figure in stored.figures().unwrap() {
                    prop_assert!(!figure.panels.is_empty());
                }
                stored.tables().unwrap();
                let program = stored.program();
                prop_assert!(
                    matches!(program, Ok(_) | Err(Error::Calculation(Failure::OutOfModel(_)))),
                    "{job}: {:?}", program.err()
                );
            }
            Err(Error::Invalid { .. } | Error::Calculation(Failure::OutOfModel(_) | Failure::Infeasible(_))) => {}
            Err(error) => prop_assert!(false, "{job}: {error:?}"),
        }
    }
}
