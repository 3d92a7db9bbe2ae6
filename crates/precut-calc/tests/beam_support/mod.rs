//! What the tests of the beam share: reference cases translated to the kernel's terms.
#![allow(dead_code, clippy::unwrap_used, clippy::expect_used, clippy::panic)]

pub(crate) mod exact;
pub(crate) mod random;

use precut_calc::num::beam::{Beam, Contact, Material, Section, Segment, Side, Springs, State, Support, Theory};
use serde_json::Value;

/// A number of a case, or its default.
pub(crate) fn number(value: &Value, key: &str, default: f64) -> f64 {
    value.get(key).and_then(Value::as_f64).unwrap_or(default)
}

/// A list of numbers.
pub(crate) fn numbers(value: &Value) -> Vec<f64> {
    value.as_array().unwrap().iter().map(|entry| entry.as_f64().unwrap()).collect()
}

/// The beam of a reference case, with the keys and defaults of the reference files.
pub(crate) fn beam(input: &Value) -> Beam {
    let shaft = &input["shaft"];
    let material = Material {
        youngs_modulus_n_per_mm2: shaft["E"].as_f64().unwrap(),
        poisson_ratio: number(shaft, "nu", 0.3),
        density_kg_per_m3: number(shaft, "density", 7850.0),
        gravity_m_per_s2: number(&input["gravity"], "g", 9.81),
    };
    let theory = match shaft.get("theory").and_then(Value::as_str) {
        Some("timoshenko") => Theory::Timoshenko,
        _ => Theory::EulerBernoulli,
    };
    let state = match shaft.get("section").and_then(Value::as_str) {
        Some("stock") => State::Stock,
        Some("mixed") => {
            let right = shaft.get("feed_direction").and_then(Value::as_str) == Some("to_tailstock");
            State::Mixed { stock_side: if right { Side::Right } else { Side::Left } }
        }
        _ => State::Finished,
    };
    let segments: Vec<Segment> = shaft["segments"]
        .as_array()
        .unwrap()
        .iter()
        .map(|segment| {
            let (d, bore) = (segment["d"].as_f64().unwrap(), number(segment, "d_in", 0.0));
            Segment {
                length_mm: segment["length"].as_f64().unwrap(),
                finished: Section::round(d, bore, &material, theory),
                stock: Section::round(number(segment, "d_stock", d), bore, &material, theory),
            }
        })
        .collect();
    let supports: Vec<Support> = input["supports"].as_array().unwrap().iter().map(support).collect();
    Beam::new(&segments, &supports, state).unwrap()
}

fn support(given: &Value) -> Support {
    let c = number(given, "c", 0.0);
    let springs = Springs { radial_mm_per_n: c, tangential_mm_per_n: number(given, "c_z", c) };
    let contact = if given.get("unilateral").and_then(Value::as_bool) == Some(true) {
        Contact::OneSided { gap_mm: number(given, "gap", 0.0) }
    } else {
        Contact::Bilateral
    };
    let z_mm = number(given, "x", 0.0);
    match given["kind"].as_str().unwrap() {
        "centre" => Support::Centre { z_mm, springs },
        "chuck" => Support::Chuck { z_mm, springs, rotational_rad_per_n_mm: number(given, "c_rot", 0.0) },
        "steady" => Support::SteadyRest { z_mm, springs, contact },
        "follow" => Support::FollowRest { offset_mm: given["offset"].as_f64().unwrap(), springs, contact },
        other => panic!("unknown support {other}"),
    }
}

/// Every value within `max(abs, rel |expected|)`.
pub(crate) fn assert_close(what: &str, got: &[f64], expected: &[f64], relative: f64, absolute: f64) {
    assert_eq!(got.len(), expected.len(), "{what}");
    for (i, (got, expected)) in got.iter().zip(expected).enumerate() {
        let allowed = absolute.max(relative * expected.abs());
        assert!((got - expected).abs() <= allowed, "{what}[{i}]: {got:e} instead of {expected:e}, allowed {allowed:e}");
    }
}
