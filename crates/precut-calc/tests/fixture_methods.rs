//! Every method against the others: spectral elements, first-order semi-discretisation, marching, forced motion,
//! zeroth order.
#![allow(clippy::unwrap_used, clippy::panic, clippy::float_cmp, missing_docs)]

use std::f64::consts::{PI, TAU};

use crate::fixture_support::semi::{Equation, multiplier};
use crate::fixture_support::{example, outcome, reference, reference_job, said, solve, translate, with};
use nalgebra::DMatrix;
use precut_calc::calculator::Value as Said;
use precut_calc::fixture_stability::{ClampForce, FixtureState};
use precut_calc::num::dde::{PeriodMap, Propagator, Rule, largest};
use serde_json::{Value, json};

/// Largest multiplier of q' = A q - b [present(t) x + delayed(t) x(t - T)] on even elements.
fn spectral<const N: usize, const P: usize>(
    a: &[[f64; N]; N],
    b: &[f64; N],
    period: f64,
    elements: u32,
    coefficients: impl Fn(f64) -> (f64, f64),
) -> f64 {
    let rule = Rule::<P>::new();
    let h = period / f64::from(elements);
    let propagator = Propagator::new(&rule, a, b, h);
    let mut map = PeriodMap::new();
    for e in 0..elements {
        let at = |i: usize| coefficients((f64::from(e) + rule.points[i]) * h);
        let present = std::array::from_fn(|i| at(i).0);
        let delayed = std::array::from_fn(|i| at(i).1);
        map.element(&propagator, &present, &delayed, usize::try_from(e).unwrap()).unwrap();
    }
    largest(map.dimension(), 8, 1e-11, |v| map.apply(v)).modulus()
}

#[test]
fn the_delayed_mathieu_equation_has_its_published_radius() {
    // x'' + 0.1 x' + (3 + 2 cos t) x = -0.15 x(t - 2 pi).
    let a = [[0.0, 1.0], [-3.0, -0.1]];
    let of = |p8: bool| {
        let coefficients = |t: f64| (2.0 * t.cos(), 0.15);
        if p8 {
            spectral::<2, 8>(&a, &[0.0, 1.0], TAU, 6, coefficients)
        } else {
            spectral::<2, 12>(&a, &[0.0, 1.0], TAU, 8, coefficients)
        }
    };
    let exact = reference("benchmark.json")["other_checks"][0]["spectral_radius"].as_f64().unwrap();
    assert!((of(false) - exact).abs() < 2e-5, "{}", of(false));
    // Eight points on longer elements: the accuracy that maps rely on.
    assert!((of(true) - of(false)).abs() < 2e-5);
    // The first-order scheme converges to the same number, order 2, through the published sequence.
    let mean = |from: f64, to: f64| (-2.0 * (to.sin() - from.sin()) / (to - from), -0.15);
    let equation = Equation {
        a: DMatrix::from_row_slice(2, 2, &[0.0, 1.0, -3.0, -0.1]),
        push: DMatrix::from_row_slice(2, 1, &[0.0, 1.0]),
        period: TAU,
        mean: &mean,
    };
    let sequence = &reference("benchmark.json")["other_checks"][0]["first_order_sequence"];
    let (hundred, two_hundred) = (multiplier(&equation, 100), multiplier(&equation, 200));
    assert!((hundred - sequence["m100"].as_f64().unwrap()).abs() < 1e-9, "{hundred}");
    assert!((two_hundred - sequence["m200"].as_f64().unwrap()).abs() < 1e-9, "{two_hundred}");
    let ratio = (hundred - of(false)) / (two_hundred - of(false));
    assert!((ratio - 4.0).abs() < 0.05, "order 2 has ratio 4: {ratio}");
}

#[test]
fn the_hayes_equation_has_the_root_of_lambert() {
    // x' = -x - x(t - 1): exact |exp(lambda)|, lambda = -1 + W0(-e).
    let per_tenth = reference("benchmark.json")["other_checks"][1]["spectral_radius_per_0_1"].as_f64().unwrap();
    let found = spectral::<1, 12>(&[[-1.0]], &[1.0], 1.0, 1, |_| (0.0, 1.0));
    assert!((found.powf(0.1) - per_tenth).abs() < 1e-8, "{found}");
}

/// The benchmark's equation at full immersion.
fn benchmark_equation(rpm: f64, depth: f64) -> (DMatrix<f64>, f64, impl Fn(f64, f64) -> f64) {
    let (mass, rate, zeta) = (0.03993, TAU * 922.0, 0.011);
    let tau = 60.0 / (2.0 * rpm);
    let a = DMatrix::from_row_slice(2, 2, &[0.0, 1.0, -rate * rate, -2.0 * zeta * rate]);
    // One tooth in the arc at a time, phi = pi t/tau: the antiderivative of sin (cos + rho sin).
    let part = move |t: f64| {
        let phi = PI * t / tau;
        (0.5 * phi.sin().powi(2) + (0.5 * phi - 0.25 * (2.0 * phi).sin()) / 3.0) * tau / PI
    };
    let mean = move |from: f64, to: f64| 600e6 * depth * 1e-3 / mass * (part(to) - part(from)) / (to - from);
    (a, tau, mean)
}

#[test]
fn the_first_order_scheme_runs_through_its_published_sequence_to_our_value() {
    let sequence = &reference("benchmark.json")["semi_discretisation_first_order"];
    for (i, depth) in sequence["depth_mm"].as_array().unwrap().iter().map(|d| d.as_f64().unwrap()).enumerate() {
        let (a, tau, mean) = benchmark_equation(5000.0, depth);
        let both = |from: f64, to: f64| (-mean(from, to), mean(from, to));
        let equation = Equation { a, push: DMatrix::from_row_slice(2, 1, &[0.0, 1.0]), period: tau, mean: &both };
        let (forty, hundred) = (multiplier(&equation, 40), multiplier(&equation, 100));
        assert!((forty - sequence["m40"][i].as_f64().unwrap()).abs() < 2e-6, "{depth}: {forty}");
        assert!((hundred - sequence["m100"][i].as_f64().unwrap()).abs() < 2e-6, "{depth}: {hundred}");
        let converged = reference("benchmark.json")["multipliers"][i]["multiplier_abs"].as_f64().unwrap();
        // Error of order 2: (100/40)^2 = 6.25 times smaller, up to the next order.
        let ratio = (forty - converged) / (hundred - converged);
        assert!((ratio / 6.25 - 1.0).abs() < 0.1, "{depth}: {ratio}");
    }
}

fn growth(job: &Value, periods: u32) -> f64 {
    let mut job = with(
        job,
        "/simulation",
        json!({
            "tooth_periods": periods, "steady_tooth_periods": 2, "steps_per_tooth": 600
        }),
    );
    job["analyses"] = json!(["history"]);
    outcome(&job).simulation.as_ref().unwrap().sample_scatter
}

#[test]
fn small_disturbances_grow_and_decay_as_the_multiplier_says() {
    for kind in [1, 2] {
        let base = reference_job(kind);
        let limit = outcome(&base).chatter_depth_mm.unwrap();
        for share in [0.98, 0.9] {
            let job = with(&base, "/cut/depth_mm", json!(share * limit));
            let modulus = outcome(&job).multiplier.modulus;
            // Scatter of pairs of samples 90 tooth periods apart: it turns with the angle of the pair of multipliers, so
            // the largest of some neighbours is compared.
            let largest = |from: u32| (0..8).map(|i| growth(&job, from + i)).fold(0.0, f64::max);
            let rate = (largest(180) / largest(90)).ln() / 90.0;
            // The vise with two modes has a second pair of multipliers that is hardly smaller.
            let within = if kind == 1 { 0.03 } else { 0.3 } * modulus.ln().abs();
            assert!((rate - modulus.ln()).abs() < within, "{kind} {share}: {rate}, {}", modulus.ln());
        }
        let above = outcome(&with(&base, "/cut/depth_mm", json!(1.02 * limit)));
        assert!(above.multiplier.modulus > 1.0 && !above.simulation.as_ref().unwrap().settled, "{kind}");
        let below = outcome(&with(&base, "/cut/depth_mm", json!(0.98 * limit)));
        assert!(below.multiplier.modulus < 1.0 && below.simulation.as_ref().unwrap().settled, "{kind}");
    }
}

#[test]
fn marching_tends_to_the_forced_motion_with_the_square_of_the_step() {
    for kind in [1, 2] {
        let job = reference_job(kind);
        let forced = outcome(&job).forced;
        let error = |steps: u32| {
            let settings = json!({ "steps_per_tooth": steps, "tooth_periods": 200, "steady_tooth_periods": 40 });
            outcome(&with(&job, "/simulation", settings)).simulation.unwrap().peak_to_peak_um - forced.peak_to_peak_um
        };
        let (coarse, fine) = (error(200), error(800));
        // 20 steps to an oscillation, then 80: order 2 has 16 times less; half of that leaves room for the next order.
        assert!(coarse.abs() < 5e-3 * forced.peak_to_peak_um, "{kind}: {coarse}");
        assert!(fine.abs() < coarse.abs() / 8.0 + 1e-6 * forced.peak_to_peak_um, "{kind}: {coarse} {fine}");
    }
}

#[test]
fn both_feed_directions_have_one_multiplier_and_mirrored_motion() {
    for kind in [1, 2] {
        let toward = |jaw: &str| outcome(&with(&reference_job(kind), "/cut/feed_toward", json!(jaw)));
        let (movable, fixed) = (toward("movable_jaw"), toward("fixed_jaw"));
        assert_eq!(movable.multiplier, fixed.multiplier);
        assert_eq!(movable.forced.displacement_max_um, -fixed.forced.displacement_min_um);
        assert_eq!(
            movable.simulation.as_ref().unwrap().displacement_max_um,
            -fixed.simulation.as_ref().unwrap().displacement_min_um
        );
    }
}

#[test]
fn both_laws_of_regeneration_agree_while_no_tooth_leaves_the_cut() {
    let job = reference_job(1);
    let of = |law: &str, job: &Value| outcome(&with(job, "/simulation/regeneration", json!(law))).simulation.unwrap();
    // To the order of rounding: the same chips are computed along two ways.
    let (multiple, single) = (of("multiple", &job), of("single", &job));
    assert!((multiple.peak_to_peak_um - single.peak_to_peak_um).abs() < 1e-9, "{multiple:?} {single:?}");
    let deep = with(&job, "/cut/depth_mm", json!(6.0));
    assert!(of("single", &deep).peak_to_peak_um > 1.1 * of("multiple", &deep).peak_to_peak_um);
}

/// A joint that never opens is a bonded one: the run that asks at every step, and the run of a plain vise that does not, by
/// the same operations.
#[test]
fn joints_that_stay_closed_run_as_bonded_ones() {
    for kind in [1, 2] {
        for (depth, law) in [(3.0, "multiple"), (5.0, "multiple"), (5.0, "single")] {
            let mut job = with(&reference_job(kind), "/cut/depth_mm", json!(depth));
            job["simulation"] = json!({ "regeneration": law, "tooth_periods": 100 });
            let bonded = outcome(&job).simulation.unwrap();
            let held = outcome(&with(&job, "/fixture/clamp_force_n", json!(1e8))).simulation.unwrap();
            assert!(held.unilateral && !bonded.unilateral);
            assert_eq!(precut_calc::fixture_stability::Simulated { unilateral: true, ..bonded }, held, "{kind} {law}");
        }
    }
}

#[test]
fn the_zeroth_order_is_right_where_the_cut_is_nearly_steady() {
    // 48 teeth, an arc of eight pitches: 0.5671 against 0.5673 mm.
    let mut many = reference_job(1);
    many["cutter"]["teeth"] = json!(48);
    many["cut"]["feed_mm_per_tooth"] = json!(0.00655);
    many["cut"]["spindle_speed_rpm"] = json!(100);
    many["cut"]["depth_mm"] = json!(0.3);
    let got = outcome(&many);
    let (limit, zeroth) = (got.chatter_depth_mm.unwrap(), got.zeroth_order.depth_at_speed_mm.unwrap());
    assert!((limit / zeroth - 1.0).abs() < 0.01, "{limit} {zeroth}");
    assert!((limit - 0.5671).abs() < 3e-4 || (limit - 0.5673).abs() < 3e-4, "{limit}");
    // The cut pulls: a0 = -0.416, zeroth order 5.382, multiplier 5.357 mm.
    let mut pulls = reference_job(1);
    pulls["force"]["radial_ratio"] = json!(0.2);
    pulls["cut"]["width_mm"] = json!(30);
    pulls["cut"]["offset_mm"] = json!(-33);
    let got = outcome(&pulls);
    assert!((got.zeroth_order.mean_directional_factor + 0.416).abs() < 1e-3, "{:?}", got.zeroth_order);
    assert!((got.zeroth_order.depth_at_speed_mm.unwrap() - 5.382).abs() < 2e-3, "{:?}", got.zeroth_order);
    assert!((got.chatter_depth_mm.unwrap() - 5.357).abs() < 2e-3, "{:?}", got.chatter_depth_mm);
}

#[test]
fn a_heavy_jaw_stands_still_at_high_frequency() {
    // m3 -> very large: the vise becomes one with two springs to ground, but for the slow motion of the jaw.
    let mut heavy = reference_job(2);
    heavy["fixture"]["jaw_mass_kg"] = json!(5e4);
    let (two, one) = (outcome(&heavy), outcome(&reference_job(1)));
    // The jaw's own frequency falls as 1/sqrt(m3): what is left of it in the upper mode is of order m/m3 = 1e-4.
    let upper = two.modes.last().unwrap();
    assert!((upper.natural_frequency_hz / one.modes[0].natural_frequency_hz - 1.0).abs() < 1e-4, "{:?}", two.modes);
}

#[test]
fn a_forced_depth_follows_its_power_law() {
    let mut job = reference_job(1);
    job["force"]["depth_exponent"] = json!(0.2);
    let at = |h: f64| outcome(&with(&job, "/cut/depth_mm", json!(h))).forced;
    let (one, two) = (at(1.0), at(2.0));
    let ratio = 2.0_f64.powf(0.8);
    assert!((two.peak_to_peak_um / one.peak_to_peak_um / ratio - 1.0).abs() < 1e-9);
    assert!((two.clamp_fixed_n / one.clamp_fixed_n / ratio - 1.0).abs() < 1e-9);
}

#[test]
fn without_depth_nothing_moves_and_the_free_vise_decays() {
    for kind in [1, 2] {
        let got = outcome(&with(&reference_job(kind), "/cut/depth_mm", json!(0)));
        assert_eq!((got.forced.peak_to_peak_um, got.simulation.as_ref().unwrap().peak_to_peak_um), (0.0, 0.0));
        // The slowest mode's decay over a tooth period.
        let tau = 1.0 / got.engagement.tooth_frequency_hz;
        let decay = got
            .modes
            .iter()
            .map(|mode| (-mode.damping_ratio * TAU * mode.natural_frequency_hz * tau).exp())
            .fold(0.0, f64::max);
        assert!((got.multiplier.modulus - decay).abs() < 1e-9, "{} {decay}", got.multiplier.modulus);
    }
}

/// A unilateral run shows no opening just above the least clamp force of its own entry, and one below.
#[test]
fn the_least_clamp_force_is_the_border_of_opening() {
    for kind in [1, 2] {
        for toward in ["movable_jaw", "fixed_jaw"] {
            let mut job = with(&reference_job(kind), "/cut/feed_toward", json!(toward));
            job["analyses"] = json!(["clamp_force"]);
            let least = outcome(&job).clamp.unwrap().least_with_entry_n.unwrap();
            let opens = |share: f64| {
                let got = outcome(&with(&job, "/fixture/clamp_force_n", json!(share * least)));
                got.verdict.joint.is_some()
            };
            assert!(!opens(1.01), "{kind} {toward}");
            // Of the elastic part alone; its viscous companion is larger where the jaw's inertia dominates.
            assert!(opens(0.95), "{kind} {toward}");
        }
    }
}

#[test]
fn an_opening_joint_turns_a_stable_cut_into_chatter() {
    let job = reference_job(1);
    let mut peak = Vec::new();
    for share in [1.01, 0.85, 0.68] {
        let got = outcome(&with(&job, "/fixture/clamp_force_n", json!(share * 732.0)));
        assert_eq!(got.verdict.joint.is_some(), share < 1.0, "{share}");
        peak.push(got.verdict.peak_to_peak_um);
    }
    // 19.6, 21.1 and 430 um.
    assert!((peak[0] - 19.6).abs() < 0.5 && (peak[1] - 22.0).abs() < 2.5 && peak[2] > 300.0, "{peak:?}");
}

/// Right joint open under a steady force: x = (P - F)/C1, without the jump of the source paper.
#[test]
fn an_open_joint_keeps_the_preload_of_the_other() {
    // An arc of exactly one pitch and a radial force alone give a nearly steady force; heavy damping kills the rest.
    let mut job = reference_job(1);
    job["cutter"]["teeth"] = json!(60);
    job["cut"]["feed_mm_per_tooth"] = json!(0.02);
    job["force"] = json!({ "coefficient": 3000, "radial_ratio": 0.6 });
    job["fixture"]["movable_joint"]["damping_n_s_per_mm"] = json!(30);
    job["fixture"]["fixed_joint"]["damping_n_s_per_mm"] = json!(3);
    job["fixture"]["clamp_force_n"] = json!(500);
    job["cut"]["depth_mm"] = json!(2.0);
    let got = outcome(&job);
    let mean = 0.5 * (got.simulation.as_ref().unwrap().force_max_n + got.simulation.as_ref().unwrap().force_min_n);
    assert!(mean > 500.0 * 36.0 / 30.0, "{mean} does not open the joint");
    let x = 0.5
        * (got.simulation.as_ref().unwrap().displacement_max_um + got.simulation.as_ref().unwrap().displacement_min_um);
    let wanted = (mean - 500.0) / 6000.0 * 1e3;
    // The force of ten teeth in cut ripples by a percent.
    assert!(
        got.simulation.as_ref().unwrap().open_fixed_share > 0.99 && (x / wanted - 1.0).abs() < 0.02,
        "{x} {wanted}"
    );
}

#[test]
fn halving_the_step_changes_the_chatter_little() {
    let mut job = with(&reference_job(1), "/cut/depth_mm", json!(5.0));
    job["simulation"] = json!({ "verified": true });
    let got = outcome(&job);
    let change = got.simulation.as_ref().unwrap().halved_step_change_um.unwrap();
    // 80 steps to an oscillation: 0.3 %.
    assert!(
        change < 0.005 * got.simulation.as_ref().unwrap().peak_to_peak_um,
        "{change} of {}",
        got.simulation.as_ref().unwrap().peak_to_peak_um
    );
    assert_eq!(got.verdict.peak_to_peak_error_um, Some(change));
}

/// Thirty oscillations between two teeth are dozens of multipliers of nearly one modulus: the largest of all eigenvalues of
/// the same map, written out as a matrix.
#[test]
fn the_largest_of_many_multipliers_is_found() {
    let (mass, rate, zeta) = (0.03993, TAU * 922.0, 0.011);
    // Scaled by the natural frequency, as the norm of a state asks.
    let a = [[0.0, rate], [-rate, -2.0 * zeta * rate]];
    let tau = 30.0 / 900.0;
    let rule = Rule::<8>::new();
    let elements = 52_u32;
    let h = tau / f64::from(elements);
    let propagator = Propagator::new(&rule, &a, &[0.0, 1.0 / rate], h);
    for depth in [0.05, 0.15, 0.4] {
        let mut map = PeriodMap::new();
        for e in 0..elements {
            let stiffness = |i: usize| {
                let (sin, cos) = (PI * (f64::from(e) + rule.points[i]) / f64::from(elements)).sin_cos();
                600e6 * depth * 1e-3 / mass * sin * (cos + sin / 3.0)
            };
            let present = std::array::from_fn(stiffness);
            let delayed = std::array::from_fn(|i| -stiffness(i));
            map.element(&propagator, &present, &delayed, usize::try_from(e).unwrap()).unwrap();
        }
        let dimension = map.dimension();
        let mut all = DMatrix::<f64>::zeros(dimension, dimension);
        for (column, mut image) in all.column_iter_mut().enumerate() {
            let mut unit = vec![0.0; dimension];
            unit[column] = 1.0;
            map.apply(&mut unit);
            image.copy_from_slice(&unit);
        }
        let dense = all.complex_eigenvalues().iter().map(|value| value.norm()).fold(0.0, f64::max);
        let found = largest(dimension, 8, 1e-9, |v| map.apply(v));
        assert!(found.residual <= 1e-9, "{depth}: {found:?}");
        // Both to the round-off of 418 rows times a condition of some hundred.
        assert!((found.modulus() / dense - 1.0).abs() < 1e-9, "{depth}: {found:?}, dense {dense}");
    }
}

/// More than 50 oscillations between two teeth, stiff masses, one tooth, arcs of many pitches.
#[test]
fn hard_cases_are_answered() {
    let base = reference_job(2);
    for (pointer, value) in [
        ("/cut/spindle_speed_rpm", json!(75)),
        ("/fixture/jaw_mass_kg", json!(0.005)),
        ("/cutter/teeth", json!(1)),
        ("/cutter/teeth", json!(96)),
        ("/cut/width_mm", json!(150)),
        ("/cut/offset_mm", json!(74.0)),
        ("/fixture/clamp_force_n", json!(0)),
    ] {
        let got = outcome(&with(&base, pointer, value.clone()));
        assert!(
            got.multiplier.modulus.is_finite() && got.multiplier.modulus_error < 1e-7,
            "{pointer} {value}: {:?}",
            got.multiplier
        );
        // Without a clamp force nothing holds the workpiece, and it walks away.
        assert_eq!(got.simulation.as_ref().unwrap().diverged, value == 0, "{pointer} {value}");
    }
}

/// At a few percent of radial immersion the limit is a flip that the zeroth order does not see.
#[test]
fn small_immersion_has_flip_lobes() {
    let benchmark = reference("benchmark.json");
    let mut input = benchmark["as_fixture_input"].clone();
    input["regime"] = json!({
        "width_mm": 0.5, "offset_mm": -4.75, "spindle_rpm": 5000, "feed_per_tooth_mm": 0.1, "depth_mm": 1.0,
    });
    let mut job = translate(&input);
    job["analyses"] = json!(["lobes"]);
    job["simulation"] = json!({ "tooth_periods": 20, "steps_per_tooth": 64 });
    job["lobes"] = json!({ "from_rpm": 10_000, "to_rpm": 25_000, "speeds": 40, "depth_max_mm": 8 });
    let lobes = outcome(&job).lobes.unwrap();
    let lowest = lobes.lowest.unwrap();
    let mut there = with(&job, "/cut/spindle_speed_rpm", json!(lowest.spindle_speed_rpm));
    there["analyses"] = json!(["verdict"]);
    there["cut"]["depth_mm"] = json!(lowest.chatter_mm.unwrap());
    let got = outcome(&there);
    assert!((got.multiplier.modulus - 1.0).abs() < 1e-3, "{:?}", got.multiplier);
    assert!(lobes.boundary.stable_again_mm.iter().any(Option::is_some) || got.multiplier.modulus > 0.0);
}

/// The source paper's cut with so much of its damping, for the clamp force it asks.
fn violent(depth_mm: f64, damping: f64) -> Value {
    let mut job = example("paper");
    job["analyses"] = json!(["clamp_force"]);
    job["cut"]["depth_mm"] = json!(depth_mm);
    for joint in ["movable_joint", "fixed_joint"] {
        let whole = job["fixture"][joint]["damping_n_s_per_mm"].as_f64().unwrap();
        job["fixture"][joint]["damping_n_s_per_mm"] = json!(damping * whole);
    }
    job
}

/// Nothing is known of the clamp force, and it is not said to be nothing.
fn asks_the_unknown(clamp: &ClampForce) -> bool {
    let forces = [clamp.least_n, clamp.least_with_entry_n, clamp.movable_n, clamp.fixed_n];
    let parts = [clamp.movable_elastic_n, clamp.fixed_elastic_n];
    let factors = [clamp.factor_needed, clamp.factor_needed_with_entry, clamp.depth_for_given_force_mm];
    let none = forces.iter().chain(&parts).chain(&factors).all(Option::is_none);
    none && clamp.binding_joint.is_none() && !clamp.stable && clamp.textbook.iter().all(|of| !of.enough)
}

/// A run that ends before its steady state, or one whose steady state is a pause of hundreds of tooth periods between two
/// throws, asks no force: not 0 N, nor what a pause asks.
#[test]
fn no_clamp_force_is_named_for_a_cut_without_a_steady_state() {
    // The second passes 10 mm within a tooth period and is below at its end; the third is thrown by 6 mm, 148 feeds.
    for (depth_mm, damping, code, why) in [
        (6.0, 0.03, "simulation_diverged", "diverged"),
        (3.0, 0.01, "simulation_diverged", "diverged"),
        (4.5, 0.05, "simulation_thrown", "thrown"),
    ] {
        let answer = solve(&violent(depth_mm, damping));
        let clamp = answer.output.clamp.as_ref().unwrap();
        assert!(asks_the_unknown(clamp), "{depth_mm} {damping}: {clamp:?}");
        let closed = Some(Said::from("closed"));
        let warned = answer.warnings.iter().any(|it| it.code == code && it.values.get("joints") == closed.as_ref());
        assert!(warned, "{depth_mm} {damping}: {:?}", answer.warnings);
        assert_eq!(said(&answer, "clamp_force_unknown").unwrap().values.get("why"), Some(&Said::from(why)));
        // Neither is there a joint of which to say what becomes of it.
        assert!(!answer.explanation.iter().any(|said| said.code.starts_with("opening_")), "{:?}", answer.explanation);
        // The run itself: without a clamp force joints are bonded, and its numbers are those until then.
        let mut bonded = violent(depth_mm, damping);
        bonded["fixture"].as_object_mut().unwrap().remove("clamp_force_n");
        let answer = solve(&bonded);
        let run = &answer.output.simulation.as_ref().unwrap();
        assert_eq!((run.diverged, run.settled), (why == "diverged", false), "{run:?}");
        assert_eq!(run.steady_tooth_periods, run.tooth_periods);
        assert!(run.clamp_fixed_n == run.clamp_fixed_entry_n && run.clamp_fixed_n > 1e5 && run.force_max_n > 1e3);
        assert!(answer.output.verdict.peak_to_peak_um > 5e3, "{:?}", answer.output.verdict);
        assert_eq!(answer.warnings.iter().filter(|warning| warning.code == code).count(), 1, "{:?}", answer.warnings);
    }
}

/// A run that is long enough for what is thrown shows its steady state.
#[test]
fn a_longer_run_follows_what_is_thrown() {
    let mut job = violent(3.0, 0.05);
    assert!(asks_the_unknown(outcome(&job).clamp.as_ref().unwrap()));
    // 2.4 mm are 61 feeds; the steady periods are a quarter of these.
    job["simulation"] = json!({ "tooth_periods": 480 });
    let clamp = outcome(&job).clamp.unwrap();
    let (least, entry) = (clamp.least_n.unwrap(), clamp.least_with_entry_n.unwrap());
    assert!(least > 5e4 && entry < 1.3 * least, "{clamp:?}");
}

/// Chatter that stays within bounds asks a force, as the limit of a process that should not be run.
#[test]
fn a_clamp_force_in_chatter_is_called_what_it_is() {
    let answer = solve(&violent(4.5, 1.0));
    let clamp = answer.output.clamp.as_ref().unwrap();
    assert!(!clamp.stable && clamp.least_n.unwrap() > 1000.0, "{clamp:?}");
    let least = said(&answer, "clamp_force_in_chatter").unwrap().values.get("least_n");
    assert_eq!(least, Some(&Said::from(clamp.least_n.unwrap())));
    let other = |said: &str| said == "clamp_force_needed" || said.starts_with("opening_");
    assert!(!answer.explanation.iter().any(|said| other(said.code)), "{:?}", answer.explanation);
    let steady = solve(&violent(3.0, 1.0));
    assert!(said(&steady, "clamp_force_needed").is_some() && said(&steady, "clamp_force_in_chatter").is_none());
}

/// What drifts freely once a joint is open has a multiplier of 1 whatever the cut: it is not what is judged.
#[test]
fn an_open_joint_is_judged_without_what_drifts() {
    let mut job = example("pneumatic");
    job["analyses"] = json!(["clamp_force"]);
    let answer = solve(&job);
    let clamp = answer.output.clamp.as_ref().unwrap();
    // The jaw off the workpiece leaves that on the fixed joint alone: a vise whose other joint is as good as none.
    let mut alone = job.clone();
    alone["fixture"] = json!({
        "kind": "self_locking", "workpiece_mass_kg": job["fixture"]["workpiece_mass_kg"],
        "movable_joint": { "stiffness_n_per_mm": 1e-4, "damping_n_s_per_mm": 0 },
        "fixed_joint": job["fixture"]["fixed_joint"],
    });
    let modulus = outcome(&alone).multiplier.modulus;
    assert!((clamp.modulus_movable_open / modulus - 1.0).abs() < 1e-6, "{clamp:?} {modulus}");
    let joint = said(&answer, if modulus < 1.0 { "opening_stays_stable" } else { "opening_is_unstable" }).unwrap();
    assert_eq!(joint.values.get("joint"), Some(&Said::from("movable")));
    // The fixed jaw off: jaw and workpiece drift as one body, and in a deep cut shake besides, as they did with the drift.
    assert!((clamp.modulus_fixed_open - 5.036_152_974).abs() < 1e-6, "{clamp:?}");
    // In a cut of a micrometre nothing but that drift is left at 1.
    let clamp = outcome(&with(&job, "/cut/depth_mm", json!(0.001))).clamp.unwrap();
    assert!(clamp.modulus_fixed_open < 0.99 && clamp.modulus_movable_open < 0.99, "{clamp:?}");
}

/// A cut of no depth asks nothing: there is no joint to name, and a screw vise has no jaw with an inertia.
#[test]
fn nothing_is_said_of_joints_that_nothing_moves() {
    for id in ["paper", "pneumatic"] {
        let mut job = with(&example(id), "/cut/depth_mm", json!(0));
        job["analyses"] = json!(["clamp_force"]);
        let answer = solve(&job);
        assert_eq!(answer.output.verdict.state, FixtureState::Stable);
        let clamp = answer.output.clamp.as_ref().unwrap();
        assert_eq!((clamp.least_n, clamp.binding_joint, clamp.factor_needed), (Some(0.0), None, None));
        let none = said(&answer, "clamp_force_needed").unwrap();
        assert_eq!(none.values.get("joint"), Some(&Said::from("none")));
        let silent = |said: &str| !said.starts_with("opening_") && said != "clamp_force_only_inertia";
        assert!(answer.explanation.iter().all(|said| silent(said.code)), "{id}: {:?}", answer.explanation);
    }
}

/// Twenty teeth in a full slot: their tangential forces along the feed cancel at every moment, and what rounding leaves of them
/// asks for no clamp force.
#[test]
fn forces_that_cancel_ask_for_no_clamp_force() {
    let mut job = reference_job(1);
    let diameter = job["cutter"]["diameter_mm"].clone();
    job["cutter"]["teeth"] = json!(20);
    job["force"]["chip_thickness_exponent"] = json!(0);
    job["force"]["radial_ratio"] = json!(0);
    job["cut"]["width_mm"] = diameter;
    job["cut"]["offset_mm"] = json!(0);
    job["cut"]["depth_mm"] = json!(1);
    job["fixture"]["clamp_force_n"] = json!(5000);
    job["analyses"] = json!(["verdict", "clamp_force"]);
    let got = outcome(&job);
    let clamp = got.clamp.unwrap();
    assert!(got.multiplier.modulus < 1.0, "{:?}", got.multiplier);
    assert_eq!((clamp.least_n, clamp.least_with_entry_n, clamp.binding_joint), (Some(0.0), Some(0.0), None));
    assert_eq!((clamp.static_movable_n, clamp.static_fixed_n, clamp.factor_needed), (0.0, 0.0, None));
    assert_eq!(got.verdict.clamp_margin, None);
}
