//! Tailstocks and rests that are set off the axis, and headstocks that clamp, against the closed forms of the held beam.
#![allow(clippy::unwrap_used, clippy::panic, missing_docs)]

use std::f64::consts::PI;

use crate::support::{prepared, solved};
use precut_calc::calculator::{Check, Finding, Violations};
use precut_calc::deflection_compensation::{Job, Outcome};
use serde_json::{Value, json};

const L: f64 = 600.0;
const D: f64 = 30.0;
const E: f64 = 210_000.0;

/// The solver stops within a few units in the last place of 16 mm, 1e-11 um; shapes are worked out to 1e-13 of some
/// 100 um. The force of the jobs without a cut to speak of moves the shaft by 1e-9 N l³/(3 E J) = 1e-8 um.
const TOLERANCE_UM: f64 = 1e-7;

fn flexural() -> f64 {
    E * PI * D.powi(4) / 64.0
}

fn centre(z: f64) -> Value {
    json!({ "kind": "centre", "z_mm": z })
}

fn rest(z: f64) -> Value {
    json!({ "kind": "steady_rest", "z_mm": z })
}

fn one_sided(z: f64, gap_um: f64) -> Value {
    json!({ "kind": "steady_rest", "z_mm": z, "one_sided": true, "gap_um": gap_um })
}

fn tailstock(offset_um: f64) -> Value {
    json!({ "kind": "tailstock_offset", "offset_um": offset_um })
}

fn rest_set_off(z: f64, offset_um: f64) -> Value {
    json!({ "kind": "steady_rest_offset", "station_mm": z, "offset_um": offset_um })
}

/// A shaft on supports under a force that does not depend on the depth, with effects.
fn job(supports: &[Value], passive_n: f64, effects: &[Value]) -> Value {
    json!({
        "shaft": { "segments": [{ "length_mm": L, "diameter_mm": D, "stock_diameter_mm": D + 2.0 }], "youngs_modulus_n_per_mm2": E },
        "supports": supports,
        "force": { "kind": "constant", "passive_n": passive_n },
        "cut": { "feed_mm_per_rev": 0.2, "spindle_speed_rpm": 500 },
        "stations": { "kind": "list", "z_mm": [0.0, 150.0, 300.0, 450.0, 600.0] },
        "effects": effects
    })
}

fn errors_um(outcome: &Outcome) -> Vec<f64> {
    outcome.stations.diameter_error_uncompensated_um.iter().map(|e| e.unwrap()).collect()
}

/// Without a cut to speak of: what the offset alone does to the diameter.
fn shape_um(supports: &[Value], effect: Value) -> Vec<f64> {
    errors_um(&solved(job(supports, 1e-9, &[effect])))
}

/// Radial shape, um, against the diameter errors found.
fn assert_shape(what: &str, found: &[f64], radial_um: impl Fn(f64) -> f64) {
    for (z, found) in [0.0, 150.0, 300.0, 450.0, 600.0].into_iter().zip(found) {
        let expected = 2.0 * radial_um(z);
        assert!((found - expected).abs() < TOLERANCE_UM, "{what}, z {z}: {found} instead of {expected}");
    }
}

/// G(z, a) of the shaft between rigid centres, mm/N.
fn green(z: f64, a: f64) -> f64 {
    let (z, a) = if z <= a { (z, a) } else { (L - z, L - a) };
    let b = L - a;
    b * z * (L * L - b * b - z * z) / (6.0 * flexural() * L)
}

/// The bend of the shaft between centres that is 1 at mid-span.
fn bend(z: f64) -> f64 {
    green(z, 300.0) / green(300.0, 300.0)
}

#[test]
fn a_tailstock_set_off_bends_the_shaft_that_a_chuck_clamps() {
    // 3 E J a/l³ at the free end of a cantilever: a (3 l x² - x³)/(2 l³).
    let chuck =
        |rotational: f64| json!({ "kind": "chuck", "z_mm": 0.0, "rotational_compliance_rad_per_n_mm": rotational });
    let clamped = shape_um(&[chuck(0.0), centre(L)], tailstock(20.0));
    assert_shape("clamped", &clamped, |x| 20.0 * (3.0 * L * x * x - x.powi(3)) / (2.0 * L.powi(3)));
    // A chuck that turns by w_r per couple: the force R at the tailstock turns it by R l w_r, R (l³/3EJ + l² w_r) = a.
    let w_r = 4e-9;
    let force = 20.0 / (L.powi(3) / (3.0 * flexural()) + L * L * w_r);
    let turning = shape_um(&[chuck(w_r), centre(L)], tailstock(20.0));
    assert_shape("turning", &turning, |x| force * (L * w_r * x + x * x * (3.0 * L - x) / (6.0 * flexural())));
    // So soft a chuck is a centre: a taper, whatever the centres yield.
    let soft = json!({ "kind": "centre", "z_mm": L, "compliance_um_per_n": 0.05 });
    assert_shape("centres", &shape_um(&[centre(0.0), soft], tailstock(-20.0)), |x| -20.0 * x / L);
}

#[test]
fn a_rest_holds_the_shaft_of_a_tailstock_set_off() {
    // Two spans b: the rest's moment is 3 E J a/(2 b²), both spans bend by it, 0 at the rest.
    let (a, b) = (20.0_f64, 300.0_f64);
    let bow = |x: f64| a / (4.0 * b.powi(3)) * x * (b * b - x * x);
    let over_rest = |x: f64| if x <= b { -bow(x) } else { a * (x - b) / b - bow(L - x) };
    assert_shape("two-sided", &shape_um(&[centre(0.0), rest(b), centre(L)], tailstock(a)), over_rest);
    // One-sided: away from the tool it is met by a/2 - gap at mid-span, toward the tool never.
    let with_gap = |gap: f64| [centre(0.0), one_sided(b, gap), centre(L)];
    assert_shape("closed", &shape_um(&with_gap(0.0), tailstock(a)), over_rest);
    assert_shape("gap", &shape_um(&with_gap(4.0), tailstock(a)), |x| a * x / L - (a / 2.0 - 4.0) * bend(x));
    assert_shape("within the gap", &shape_um(&with_gap(12.0), tailstock(a)), |x| a * x / L);
    // What the rest holds back is there without a force: that nobody knows the force to a tenth makes it no surer.
    let held = solved(job(&with_gap(0.0), 1e-9, &[tailstock(a)]));
    let unsure = held.stations.diameter_uncertainty_um.unwrap().into_iter().fold(0.0, f64::max);
    assert!(unsure < TOLERANCE_UM, "{unsure}");
    assert_shape("open", &shape_um(&with_gap(0.0), tailstock(-a)), |x| -a * x / L);
}

#[test]
fn a_rest_on_the_overhang_is_not_taken_for_the_tailstock() {
    let chuck = json!({ "kind": "chuck", "z_mm": 0.0 });
    let supports = [chuck, centre(400.0)];
    let tried = |effects: &[Value]| {
        let mut job = job(&supports, 100.0, effects);
        job["stations"] = json!({ "kind": "per_zone", "count": 21 });
        solved(job).one_more_rest.is_some()
    };
    assert!(tried(&[]));
    assert!(!tried(&[tailstock(20.0)]));
    assert!(!tried(&[json!({ "kind": "tailstock_compliance", "delta_um_per_n": 0.05 })]));
}

#[test]
fn a_one_sided_rest_pushes_and_never_pulls() {
    let with_gap = |gap: f64| [centre(0.0), one_sided(300.0, gap), centre(L)];
    // Set off away from the tool, or toward it by less than its gap, it leaves the shaft alone.
    for (gap, offset) in [(0.0, 8.0), (1000.0, 10.0), (1000.0, -500.0)] {
        assert_shape("apart", &shape_um(&with_gap(gap), rest_set_off(300.0, offset)), |_| 0.0);
    }
    assert_shape("pushed", &shape_um(&with_gap(0.0), rest_set_off(300.0, -8.0)), |x| -8.0 * bend(x));
    assert_shape("beyond its gap", &shape_um(&with_gap(100.0), rest_set_off(300.0, -500.0)), |x| -400.0 * bend(x));
    // Under a cut the work first closes what the rest was set off by: y = P G(x, x) - G(x, b) r, r > 0 where
    // P G(x, b) > gap + offset.
    let (p, gap, offset) = (200.0, 5.0, 3.0);
    let found = errors_um(&solved(job(&with_gap(gap), p, &[rest_set_off(300.0, offset)])));
    let mut pressed = 0;
    for (z, found) in [0.0, 150.0, 300.0, 450.0, 600.0].into_iter().zip(found) {
        let force = ((p * green(z, 300.0) - 1e-3 * (gap + offset)) / green(300.0, 300.0)).max(0.0);
        let expected = 2e3 * (p * green(z, z) - green(z, 300.0) * force);
        pressed += usize::from(force > 0.0);
        assert!((found - expected).abs() < TOLERANCE_UM, "z {z}: {found} instead of {expected}");
    }
    assert_eq!(pressed, 3);
}

#[test]
fn a_follow_rest_at_the_tool_holds_the_shaft_where_it_is() {
    let follow = json!({ "kind": "follow_rest", "offset_mm": 0.0 });
    let supports = [centre(0.0), rest(300.0), centre(L), follow];
    let found = shape_um(&supports, rest_set_off(300.0, 10.0));
    // At the rest itself the two contradict each other, and at 0 and l the centres hold.
    for i in [0, 1, 3, 4] {
        assert!(found[i].abs() < TOLERANCE_UM, "{found:?}");
    }
}

#[test]
fn the_state_of_the_blank_shapes_what_a_rest_does() {
    // Fed to the headstock, the tool at mid-span: stock left of it, finished right of it. phi = G(z, b)/G(b, b) of that
    // shaft between centres, by virtual work with the moments (1-v) s and v (l-s), Simpson's rule exact on each side.
    let (z, b) = (150.0, 300.0);
    let mut job = job(&[centre(0.0), rest(b), centre(L)], 1e-9, &[rest_set_off(b, 10.0)]);
    job["shaft"]["section"] = json!("mixed");
    job["stations"] = json!({ "kind": "list", "z_mm": [z] });
    let flexibility = |s: f64| 64.0 / (E * PI * if s < z { D + 2.0 } else { D }.powi(4));
    let moment = |s: f64, at: f64| if s < at { (1.0 - at / L) * s } else { at / L * (L - s) };
    let work = |i: f64, j: f64| -> f64 {
        [(0.0, z), (z, b), (b, L)]
            .into_iter()
            .map(|(from, to)| {
                let middle = 0.5 * (from + to);
                let at = |s: f64| moment(s, i) * moment(s, j);
                flexibility(middle) * (to - from) / 6.0 * (at(from) + 4.0 * at(middle) + at(to))
            })
            .sum()
    };
    let expected = 2.0 * 10.0 * work(z, b) / work(b, b);
    let found = errors_um(&solved(job))[0];
    assert!((found - expected).abs() < TOLERANCE_UM, "{found} instead of {expected}");
}

fn faults(job: Value) -> Vec<Finding> {
    let job: Job = serde_json::from_value(job).unwrap();
    let mut violations = Violations::default();
    job.check(&mut violations);
    violations.into_vec()
}

#[test]
fn a_clamping_headstock_is_the_chuck_and_no_rest() {
    let (p, k) = (150.0, 2.4e7);
    let clamps = json!({ "kind": "chuck_rotational_stiffness", "ktheta_n_mm_per_rad": k });
    let chuck =
        |rotational: f64| json!({ "kind": "chuck", "z_mm": 120.0, "rotational_compliance_rad_per_n_mm": rotational });
    // The rest stands left of the chuck.
    let by_effect = solved(job(&[rest(30.0), chuck(1e-6), centre(L)], p, std::slice::from_ref(&clamps)));
    let stated = solved(job(&[rest(30.0), chuck(1.0 / k), centre(L)], p, &[]));
    assert_eq!(errors_um(&by_effect), errors_um(&stated));
    // A centre right of a rest becomes a chuck.
    let centred = solved(job(&[rest(30.0), centre(120.0), centre(L)], p, std::slice::from_ref(&clamps)));
    assert_eq!(errors_um(&centred), errors_um(&stated));
    // Whatever the order in which the supports are given.
    let reversed = solved(job(&[centre(L), centre(120.0), rest(30.0)], p, std::slice::from_ref(&clamps)));
    for (a, b) in errors_um(&reversed).iter().zip(errors_um(&stated)) {
        assert!((a - b).abs() < TOLERANCE_UM);
    }
    // Nothing to clamp: rests alone, or rests and a tailstock.
    for supports in [vec![rest(30.0), rest(L)], vec![rest(0.0), centre(L)]] {
        let found = faults(job(&supports, p, std::slice::from_ref(&clamps)));
        assert_eq!(found.len(), 1, "{found:?}");
        assert_eq!((found[0].code, found[0].pointer.as_str()), ("effect_without_headstock", "/effects/0"));
    }
    assert_eq!(prepared(job(&[chuck(0.0)], p, &[clamps])).supports.len(), 1);
}
