//! Properties of the force laws: slopes, limits, continuity, monotony, quadrature.
#![allow(clippy::unwrap_used, clippy::float_cmp, missing_docs)]

use precut_calc::calculator::Violations;
use precut_calc::force::{Component, DepthLaw, ForceModel, Forces};
use proptest::prelude::*;
use serde_json::{Value, json};

const COMPONENTS: [Component; 3] = [Component::Passive, Component::Main, Component::Feed];

fn model(job: Value) -> ForceModel {
    let model: ForceModel = serde_json::from_value(job).unwrap();
    let mut violations = Violations::default();
    model.check("/force", &mut violations);
    assert!(violations.is_empty(), "{violations:?}");
    model
}

fn kienzle(angle: f64, radius: f64) -> Value {
    json!({
        "kind": "kienzle", "cutting_edge_angle_deg": angle, "nose_radius_mm": radius,
        "specific_cutting_force_n_per_mm2": 2100.0, "cutting_exponent": 0.26,
        "specific_normal_force_n_per_mm2": 900.0, "normal_exponent": 0.35,
    })
}

fn steel() -> Value {
    let term = |coefficient: f64, x: f64, y: f64, n: f64| json!({"coefficient": coefficient, "depth_exponent": x, "feed_exponent": y, "speed_exponent": n});
    json!({
        "kind": "power_law", "passive": term(2430.0, 0.9, 0.6, -0.3), "main": term(3000.0, 1.0, 0.75, -0.15),
        "feed": term(3390.0, 1.0, 0.5, -0.4),
    })
}

fn table() -> Value {
    json!({"kind": "table", "rows": [
        {"depth_mm": 0.2, "passive_n": 90.0, "main_n": 150.0, "feed_n": 40.0},
        {"depth_mm": 0.5, "passive_n": 190.0, "main_n": 400.0, "feed_n": 120.0},
        {"depth_mm": 0.6, "passive_n": 190.0, "main_n": 470.0, "feed_n": 110.0},
        {"depth_mm": 2.0, "passive_n": 300.0, "main_n": 1500.0, "feed_n": 700.0},
    ]})
}

fn all_models() -> Vec<ForceModel> {
    let mut worn = steel();
    worn["wear_factor"] = json!(1.3);
    worn["passive"]["constant_n"] = json!(60.0);
    let mut rubbing = kienzle(75.0, 0.8);
    rubbing["rubbing"] = json!({"passive_n": 25.0, "main_n": 40.0});
    let constant = json!({"kind": "constant", "passive_n": 200.0, "main_n": 400.0});
    let handbook = json!({
        "kind": "handbook", "material": "steel_45", "tool_material": "hss", "cutting_edge_angle_deg": 75.0,
        "nose_radius_mm": 1.5,
    });
    [steel(), worn, kienzle(45.0, 0.0), kienzle(75.0, 0.8), kienzle(90.0, 0.4), rubbing, constant, table(), handbook]
        .map(model)
        .into()
}

fn law(job: Value) -> DepthLaw {
    model(job).at(0.2, 120.0)
}

fn value(law: &DepthLaw, component: Component, depth: f64) -> f64 {
    law.component_and_slope(component, depth).0
}

#[test]
fn slopes_are_the_derivatives() {
    // Five-point central difference, exact to fourth order; away from the joints of the laws.
    for model in all_models() {
        let law = model.at(0.25, 100.0);
        for component in COMPONENTS {
            for depth in [0.03, 0.11, 0.3, 0.45, 0.55, 0.71, 0.95, 1.5, 2.6] {
                let h = 1e-3 * depth;
                let at = |shift: f64| value(&law, component, depth + shift * h);
                let difference = (8.0 * (at(1.0) - at(-1.0)) - (at(2.0) - at(-2.0))) / (12.0 * h);
                let slope = law.component_and_slope(component, depth).1;
                let scale = slope.abs().max(at(0.0).abs() / depth).max(1e-9);
                assert!(
                    (difference - slope).abs() < 1e-8 * scale,
                    "{model:?} {component:?} {depth}: {difference} {slope}"
                );
            }
        }
    }
}

#[test]
fn the_shorthands_agree_with_the_components() {
    for model in all_models() {
        let law = model.at(0.25, 100.0);
        let depth = 0.37;
        let Forces { passive_n, main_n, feed_n } = law.forces(depth);
        assert_eq!(law.passive(depth), passive_n);
        assert_eq!(law.passive_and_slope(depth), law.component_and_slope(Component::Passive, depth));
        assert_eq!(law.main_and_slope(depth).0, main_n);
        assert_eq!(law.feed_and_slope(depth).0, feed_n);
    }
}

#[test]
fn nothing_is_cut_at_depths_up_to_zero_and_the_limit_is_the_constant_part() {
    for model in all_models() {
        let law = model.at(0.25, 100.0);
        for depth in [0.0, -0.0, -1.0, f64::NEG_INFINITY] {
            assert_eq!(law.forces(depth), Forces::default());
        }
        let limit = law.limit();
        for component in COMPONENTS {
            let just_above = value(&law, component, 1e-30);
            assert!((just_above - limit.get(component)).abs() < 1e-15 * (1.0 + just_above) + 1e-18, "{model:?}");
            assert!(value(&law, component, f64::MIN_POSITIVE / 1e10).is_finite());
        }
    }
    let mut worn = steel();
    worn["passive"]["constant_n"] = json!(60.0);
    worn["wear_factor"] = json!(1.3);
    let (worn, sharp) = (law(worn), law(steel()));
    assert_eq!(worn.limit(), Forces { passive_n: 60.0, main_n: 0.0, feed_n: 0.0 });
    // The factor of wear acts on the law, not on the constant part.
    assert!((worn.passive(0.7) - (60.0 + 1.3 * sharp.passive(0.7))).abs() < 1e-12);
}

#[test]
fn the_nose_runs_into_the_straight_edge_without_a_jump() {
    for angle in [3.0, 30.0, 45.0, 75.0, 89.9, 90.0_f64] {
        let law = law(kienzle(angle, 0.8));
        let joint = 0.8 * (1.0 - angle.to_radians().cos());
        for component in COMPONENTS {
            let (below, above) = (joint * (1.0 - 1e-12), joint * (1.0 + 1e-12));
            let (from, to) = (law.component_and_slope(component, below), law.component_and_slope(component, above));
            assert!((from.0 - to.0).abs() < 1e-10 * to.0.abs(), "{angle} {component:?}: {from:?} {to:?}");
            assert!(
                (from.1 - to.1).abs() < 1e-9 * (to.1.abs() + to.0 / joint),
                "{angle} {component:?}: {from:?} {to:?}"
            );
        }
    }
}

#[test]
fn at_ninety_degrees_the_passive_force_is_level_beyond_the_nose() {
    let law = law(kienzle(90.0, 0.8));
    assert_eq!(law.passive_and_slope(0.8).1, 0.0);
    assert_eq!(law.passive(0.9), law.passive(3.0));
}

#[test]
fn a_sharp_corner_is_the_limit_of_small_noses() {
    let sharp = law(kienzle(60.0, 0.0));
    let nearly = law(kienzle(60.0, 1e-9));
    for component in COMPONENTS {
        let (a, b) = (value(&sharp, component, 0.7), value(&nearly, component, 0.7));
        assert!((a - b).abs() < 1e-8 * a, "{component:?}");
    }
    assert_eq!(model(kienzle(60.0, 0.0)).depth_exponent(), Some(1.0));
    assert_eq!(model(kienzle(60.0, 0.8)).depth_exponent(), None);
}

/// Adaptive Simpson's rule.
fn integral(f: &dyn Fn(f64) -> f64, from: f64, to: f64, tolerance: f64, depth: u32) -> f64 {
    let middle = 0.5 * (from + to);
    let simpson = |a: f64, b: f64| (b - a) / 6.0 * (f(a) + 4.0 * f(0.5 * (a + b)) + f(b));
    let (whole, halves) = (simpson(from, to), simpson(from, middle) + simpson(middle, to));
    if depth == 0 || (whole - halves).abs() < 15.0 * tolerance {
        return halves + (halves - whole) / 15.0;
    }
    integral(f, from, middle, 0.5 * tolerance, depth - 1) + integral(f, middle, to, 0.5 * tolerance, depth - 1)
}

/// Integral of sin^a from 0 to `end`; the substitution phi = end p^8 takes the root out of the corner.
fn sine_integral(power: f64, end: f64) -> f64 {
    let integrand = |p: f64| 8.0 * p.powi(7) * end * (end * p.powi(8)).sin().max(0.0).powf(power);
    let size = end.powf(power + 1.0) / (power + 1.0);
    integral(&integrand, 0.0, 1.0, 1e-14 * size, 30)
}

#[test]
fn forces_on_the_nose_are_the_integrals_along_the_edge() {
    let (radius, feed) = (0.8, 0.2_f64);
    for (cutting, normal) in [(0.0, 0.0), (0.26, 0.35), (0.6, 0.5), (0.95, 0.9)] {
        let mut job = kienzle(90.0, radius);
        job["cutting_exponent"] = json!(cutting);
        job["normal_exponent"] = json!(normal);
        let law = law(job);
        for depth in [1e-6, 1e-3, 0.05, 0.3, 0.6, 0.799, 0.8] {
            let end = 2.0 * (depth / (2.0 * radius)).sqrt().asin();
            let (main, feed_force) = (law.main_and_slope(depth).0, law.feed_and_slope(depth).0);
            let expected_main = 2100.0 * feed.powf(1.0 - cutting) * radius * sine_integral(1.0 - cutting, end);
            let expected_feed = 900.0 * feed.powf(1.0 - normal) * radius * sine_integral(2.0 - normal, end);
            assert!((main / expected_main - 1.0).abs() < 1e-12, "{cutting} {depth}: {main} {expected_main}");
            assert!((feed_force / expected_feed - 1.0).abs() < 1e-12, "{normal} {depth}: {feed_force} {expected_feed}");
        }
    }
}

#[test]
fn whole_exponents_have_elementary_integrals() {
    // m_c = 0: integral of sin; m_n = 0: integral of sin². Relative accuracy also at tiny depths.
    let mut job = kienzle(90.0, 1.0);
    job["cutting_exponent"] = json!(0.0);
    job["normal_exponent"] = json!(0.0);
    let law = law(job);
    for depth in [1e-12, 1e-6, 0.1, 0.5, 1.0_f64] {
        let main = law.main_and_slope(depth).0 / (2100.0 * 0.2);
        assert!((main / depth - 1.0).abs() < 4e-15, "{depth}: {main:e}");
        let passive = law.passive(depth) / (900.0 * 0.2);
        assert!((passive / (0.5 * depth * (2.0 - depth)) - 1.0).abs() < 4e-15);
    }
    let quarter = law.feed_and_slope(1.0).0 / (900.0 * 0.2);
    assert!((quarter - std::f64::consts::FRAC_PI_4).abs() < 2e-15);
}

#[test]
fn a_table_meets_its_rows_and_does_not_overshoot() {
    let law = law(table());
    for (depth, passive, main, feed) in
        [(0.2, 90.0, 150.0, 40.0), (0.5, 190.0, 400.0, 120.0), (2.0, 300.0, 1500.0, 700.0)]
    {
        let forces = law.forces(depth);
        for (got, expected) in [(forces.passive_n, passive), (forces.main_n, main), (forces.feed_n, feed)] {
            assert!((got - expected).abs() < 1e-12 * expected, "{depth}");
        }
    }
    // Level between equal rows, not a wave; an extremum of the rows is one of the curve.
    assert!((law.passive(0.55) - 190.0).abs() < 1e-12);
    let steps = |from: i32, to: i32| (from..=to).map(|i| f64::from(i) * 1e-3);
    assert!(steps(500, 600).all(|depth| law.feed_and_slope(depth).0 <= 120.0 + 1e-12));
    // Beyond the last row in a straight line with the slope of the last row.
    let (last, slope) = law.main_and_slope(2.0);
    assert!((law.main_and_slope(3.0).0 - (last + slope)).abs() < 1e-9);
    assert!((law.main_and_slope(3.0).1 - slope).abs() < 1e-12);
}

#[test]
fn a_row_at_depth_zero_is_the_constant_part() {
    let law = law(json!({"kind": "table", "rows": [
        {"depth_mm": 0.0, "passive_n": 30.0}, {"depth_mm": 1.0, "passive_n": 130.0},
    ]}));
    assert_eq!(law.limit().passive_n, 30.0);
    assert_eq!(law.passive(0.0), 0.0);
    assert!((law.passive(0.5) - 80.0).abs() < 1e-12);
}

#[test]
fn a_table_of_one_row_is_a_line_through_the_origin() {
    let law = law(json!({"kind": "table", "rows": [{"depth_mm": 0.5, "passive_n": 100.0}]}));
    assert!((law.passive(0.1) - 20.0).abs() < 1e-12 && (law.passive(2.0) - 400.0).abs() < 1e-12);
}

#[test]
fn effects_act_on_any_law() {
    for model in all_models() {
        let law = model.at(0.25, 100.0);
        let base = law.passive(0.7);
        assert!((law.clone().scaled(1.2).passive(0.7) - 1.2 * base).abs() < 1e-12 * base);
        let added = law.clone().with_added(Forces { passive_n: 30.0, ..Forces::default() });
        assert!((added.passive(0.7) - base - 30.0).abs() < 1e-12 * base);
        // The exponent turns about its reference, there nothing changes; slopes follow.
        let turned = law.clone().with_depth_exponent(0.2, 0.7);
        assert!((turned.passive(0.7) - base).abs() < 1e-12 * base);
        let constant = law.limit().passive_n * f64::from(u8::from(law.passive_power().is_none()));
        let expected = constant + (law.passive(1.4) - constant) * 2.0_f64.powf(0.2);
        assert!((turned.passive(1.4) - expected).abs() < 1e-12 * expected, "{model:?}");
        let h = 1e-4;
        let at = |shift: f64| turned.passive(0.9 + shift * h);
        let difference = (8.0 * (at(1.0) - at(-1.0)) - (at(2.0) - at(-2.0))) / (12.0 * h);
        assert!((difference - turned.passive_and_slope(0.9).1).abs() < 1e-6 * difference.abs().max(1.0));
    }
}

#[test]
fn a_pure_power_says_so() {
    let law = law(steel());
    let (factor, exponent) = law.passive_power().unwrap();
    assert!((exponent - 0.9).abs() < 1e-15);
    assert!((factor * 0.7_f64.powf(0.9) / law.passive(0.7) - 1.0).abs() < 1e-14);
    let (factor, exponent) = law.clone().with_depth_exponent(-0.1, 0.5).scaled(2.0).passive_power().unwrap();
    assert!((exponent - 0.8).abs() < 1e-15);
    let turned = law.clone().with_depth_exponent(-0.1, 0.5).scaled(2.0);
    assert!((factor * 0.7_f64.powf(0.8) / turned.passive(0.7) - 1.0).abs() < 1e-14);
    // A power and a constant are no power; two constants are a constant.
    let rubbing = Forces { passive_n: 10.0, ..Forces::default() };
    assert_eq!(law.with_added(rubbing).passive_power(), None);
    let constant = model(json!({"kind": "constant", "passive_n": 200.0, "rubbing": {"passive_n": 10.0}}));
    assert_eq!(constant.at(0.2, 100.0).passive_power(), Some((210.0, 0.0)));
    assert_eq!(constant.depth_exponent(), Some(0.0));
    assert!((DepthLaw::passive_only(50.0, 2.0).passive(3.0) - 450.0).abs() < 1e-10);
    assert_eq!(DepthLaw::zero().forces(1.0), Forces::default());
}

#[test]
fn speed_matters_only_where_it_has_an_exponent() {
    for (job, expected) in [(steel(), true), (table(), false), (kienzle(75.0, 0.8), false)] {
        let model = model(job);
        assert_eq!(model.depends_on_speed(), expected);
        let (slow, fast) = (model.at(0.2, 50.0).forces(1.0), model.at(0.2, 200.0).forces(1.0));
        assert_eq!(slow != fast, expected);
    }
}

proptest! {
    #[test]
    fn kienzle_rises_with_depth_feed_and_constants(
        angle in 1.0..=90.0_f64, radius in 0.0..3.0_f64, t in 1e-4..4.0_f64, step in 1e-4..1.0_f64,
        s in 0.02..0.8_f64, mc in 0.0..0.95_f64, mn in 0.0..0.95_f64,
    ) {
        let mut job = kienzle(angle, radius);
        job["cutting_exponent"] = json!(mc);
        job["normal_exponent"] = json!(mn);
        let model = model(job);
        let law = model.at(s, 100.0);
        let (low, high, more_feed) = (law.forces(t), law.forces(t + step), model.at(1.1 * s, 100.0).forces(t));
        for component in COMPONENTS {
            let (low, high) = (low.get(component), high.get(component));
            prop_assert!(low.is_finite() && low >= 0.0);
            prop_assert!(high >= low * (1.0 - 1e-14));
            prop_assert!(more_feed.get(component) >= low);
            prop_assert!(law.component_and_slope(component, t).1 >= 0.0);
        }
    }

    #[test]
    fn monotone_rows_make_monotone_laws(
        rises in prop::collection::vec((0.01..1.0_f64, 0.0..200.0_f64), 1..20),
        shares in prop::collection::vec(0.0..1.2_f64, 2),
    ) {
        let (mut depth, mut force) = (0.0, 0.0);
        let rows: Vec<Value> = rises.iter().map(|(step, rise)| {
            depth += step;
            force += rise;
            json!({"depth_mm": depth, "passive_n": force})
        }).collect();
        let law = law(json!({"kind": "table", "rows": rows}));
        let (low, high) = (shares[0].min(shares[1]) * depth, shares[0].max(shares[1]) * depth);
        prop_assert!(law.passive(low) <= law.passive(high) + 1e-9 * (1.0 + force));
        prop_assert!(law.passive_and_slope(low).1 >= -1e-9 * (1.0 + force / depth));
    }

    #[test]
    fn tables_stay_between_neighbouring_rows(
        rows in prop::collection::vec((0.01..1.0_f64, 0.0..200.0_f64), 2..12), share in 0.0..=1.0_f64,
    ) {
        let mut depth = 0.0;
        let rows: Vec<(f64, f64)> = rows.iter().map(|(step, force)| { depth += step; (depth, *force) }).collect();
        let job: Vec<Value> = rows.iter().map(|(t, p)| json!({"depth_mm": t, "passive_n": p})).collect();
        let law = law(json!({"kind": "table", "rows": job}));
        for pair in rows.windows(2) {
            let force = law.passive(pair[0].0 + share * (pair[1].0 - pair[0].0));
            let (least, largest) = (pair[0].1.min(pair[1].1), pair[0].1.max(pair[1].1));
            prop_assert!((least - 1e-9..=largest + 1e-9).contains(&force), "{force} outside {least}..{largest}");
        }
    }
}
