//! The beam against closed forms.
#![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]

use crate::beam_support::{assert_close, beam, number, numbers};
use precut_calc::num::beam::Wanted;
use serde_json::Value;

fn read(text: &str) -> Value {
    serde_json::from_str(text).unwrap()
}

fn closed_forms() -> Vec<Value> {
    let file = read(include_str!("reference/deflection-compensation/closed-forms.json"));
    file["cases"].as_array().unwrap().clone()
}

/// A component of the cutting force by the power law at nominal depth, with `K` = 1.
fn power(input: &Value, component: &str) -> f64 {
    let Some(law) = input["force"].get(component) else { return 0.0 };
    let segment = &input["shaft"]["segments"][0];
    let depth = (segment["d_stock"].as_f64().unwrap() - segment["d"].as_f64().unwrap()) / 2.0;
    let (feed, speed) = (input["cut"]["s"].as_f64().unwrap(), input["cut"]["v"].as_f64().unwrap());
    10.0 * number(law, "C", 0.0)
        * depth.powf(number(law, "x", 0.0))
        * feed.powf(number(law, "y", 0.0))
        * speed.powf(number(law, "n", 0.0))
}

#[test]
fn every_closed_form_is_met() {
    for case in closed_forms() {
        let (id, input) = (case["id"].as_str().unwrap(), &case["input"]);
        let stations = numbers(&input["stations"]);
        let effect = |name: &str| input["effects"].get(name).and_then(Value::as_bool) == Some(true);
        let want = Wanted { tangential: false, couple: effect("axial_moment"), weight: effect("weight") };
        let profile = beam(input).profile(&stations, want);
        let quantity = case["quantity"].as_str().unwrap();
        let got: Vec<f64> = match quantity {
            "compliance_work" => profile.radial_mm_per_n,
            "compliance" => profile.radial_mm_per_n.iter().map(|w| w + number(&input["carriage"], "c", 0.0)).collect(),
            "y_nominal" => (0..stations.len())
                .map(|i| {
                    let radius = input["shaft"]["segments"][0]["d"].as_f64().unwrap() / 2.0;
                    let moment = profile.couple_per_n.get(i).map_or(0.0, |g| -radius * power(input, "Px") * g);
                    let sag = profile.sag_radial_mm.get(i).copied().unwrap_or(0.0);
                    profile.radial_mm_per_n[i] * power(input, "Py") + moment + sag
                })
                .collect(),
            other => panic!("unknown quantity {other}"),
        };
        let expected = numbers(&case["expected"][quantity]);
        let largest = expected.iter().fold(0.0_f64, |largest, value| largest.max(value.abs()));
        let tolerance = &case["tolerance"];
        let absolute = number(tolerance, "abs", number(tolerance, "abs_fraction_of_max", 0.0) * largest);
        assert_close(id, &got, &expected, number(tolerance, "rel", 0.0), absolute);
        // The method itself is far better than the tolerance; only here a lost digit would be seen.
        assert_close(id, &got, &expected, 2e-13, 1e-15 * largest);
    }
}

#[test]
fn many_stations_lose_no_digits() {
    let case = read(include_str!("reference/deflection-compensation/scale.json"));
    let springs = closed_forms().into_iter().find(|case| case["id"] == "ss-springs").unwrap();
    let beam = beam(&springs["input"]);
    let (l, flexibility) = (2000.0_f64, 64.0 / (std::f64::consts::PI * 90.0_f64.powi(4) * 210_000.0));
    for count in numbers(&case["stations"]) {
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        let count = count as u32;
        let stations: Vec<f64> = (0..count).map(|i| l * f64::from(i) / f64::from(count - 1)).collect();
        let expected: Vec<f64> = stations
            .iter()
            .map(|x| {
                let (t, v) = ((l - x) / l, x / l);
                x * x * (l - x) * (l - x) * flexibility / (3.0 * l) + t * t * 3e-5 + v * v * 6e-5
            })
            .collect();
        let got = beam.profile(&stations, Wanted::default()).radial_mm_per_n;
        assert_close("scale", &got, &expected, number(&case["tolerance"], "rel", 0.0), 0.0);
        // Some thirty roundings of positive terms.
        assert_close("scale", &got, &expected, 1e-14, 0.0);
    }
}
