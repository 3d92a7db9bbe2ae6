//! How probably a ring is within its tolerance: against rings that are drawn and turned one by one. `PRECUT_CERTAINTY` sets how
//! many; the suite takes few.
#![allow(clippy::unwrap_used, clippy::print_stdout, missing_docs)]

use std::f64::consts::TAU;

use crate::draw::Draw;
use crate::ring_support::{faults, run};
use precut_calc::ring_roundness::RingConformance;
use serde_json::{Value, json};

const ROLLER_MM: f64 = 10.0;
const RADIUS_MM: f64 = 44.9;
const TRAVEL_MM: f64 = 0.16;
const HALF_ANGLE_DEG: f64 = 25.0;
const TOOL_ANGLE_DEG: f64 = 74.0;

/// What a ring may be set up with.
#[derive(Clone, Copy)]
struct Truth {
    tool_deg: f64,
    half_angle_deg: f64,
    compliance: f64,
    runout: f64,
    waves: f64,
    blank_turn: f64,
    roller_turn: f64,
}

const STATED: Truth = Truth {
    tool_deg: 0.0,
    half_angle_deg: 0.0,
    compliance: 1.0,
    runout: 1.0,
    waves: 1.0,
    blank_turn: 0.0,
    roller_turn: 0.0,
};

/// A journal on rollers: the finished circle rests on both, the tip ends on it at its angle and comes to it along it.
fn job(truth: &Truth) -> Value {
    let reach = RADIUS_MM + ROLLER_MM;
    let depth_mm = reach * HALF_ANGLE_DEG.to_radians().cos();
    let half_angle = (HALF_ANGLE_DEG + truth.half_angle_deg).to_radians();
    let tool = (TOOL_ANGLE_DEG + truth.tool_deg).to_radians();
    let centre_mm = reach * half_angle.cos() - depth_mm;
    let from_mm = RADIUS_MM + TRAVEL_MM;
    let turned_deg = 360.0 * truth.blank_turn;
    let wave = |order: u32, um: f64, deg: f64| json!({ "order": order, "amplitude_um": um * truth.waves, "angle_of_max_deg": (deg + turned_deg) % 360.0 });
    json!({
        "ring": { "radius_mm": 45.0, "harmonics": [wave(2, 15.0, 10.0), wave(3, 7.0, 20.0), wave(5, 2.0, 0.0)] },
        "supports": {
            "distance_mm": 2.0 * reach * half_angle.sin(), "depth_mm": depth_mm, "roller_radius_mm": ROLLER_MM
        },
        "tool": {
            "x_mm": from_mm * tool.cos(), "y_mm": centre_mm + from_mm * tool.sin(),
            "feed_direction_deg": TOOL_ANGLE_DEG + truth.tool_deg + 180.0,
            "feed_mm_per_rev": TRAVEL_MM / 16.0, "revolutions": 16.0, "spark_out_revolutions": 2.0
        },
        "compliance_ratio": 0.4 * truth.compliance,
        "effects": [{ "kind": "roller_runout", "amplitude_mm": 0.0005 * truth.runout, "ratio": 4.5,
            "phase_rad": 0.3 + TAU * truth.roller_turn }],
        "filter": "upr_15", "samples": 360
    })
}

const TOOL_DEG: f64 = 0.6;
const WAVES: f64 = 0.3;

pub(crate) fn certain(tolerance_um: f64) -> Value {
    let mut job = job(&STATED);
    job["analyses"] = json!(["certainty"]);
    job["tolerance"] = json!({ "roundness_um": tolerance_um });
    job["uncertainty"] = json!({ "quantities": [
        { "quantity": "tool_angle", "distribution": { "kind": "normal", "standard_uncertainty_deg": TOOL_DEG } },
        { "quantity": "blank_amplitude", "distribution": { "kind": "lognormal", "log_standard_deviation": WAVES } }
    ] });
    job
}

pub(crate) fn conformance(job: &Value) -> RingConformance {
    run(job).output.conformance.unwrap()
}

/// By Box and Muller.
fn normal(draw: &mut Draw) -> f64 {
    (-2.0 * draw.between(1e-12, 1.0).ln()).sqrt() * (TAU * draw.share()).cos()
}

/// Roundness of rings that are set up as the job says that they may be, one by one.
fn drawn_um(count: u32) -> Vec<f64> {
    let mut draw = Draw::new(31);
    let mut all = Vec::new();
    for _ in 0..count {
        let (tool_deg, half_angle_deg) = (TOOL_DEG * normal(&mut draw), 0.1 * normal(&mut draw));
        let mut factor = |width: f64| (width * normal(&mut draw)).exp();
        let (compliance, runout, waves) = (factor(0.3), factor(0.2), factor(WAVES));
        let (blank_turn, roller_turn) = (draw.share(), draw.share());
        let truth = Truth { tool_deg, half_angle_deg, compliance, runout, waves, blank_turn, roller_turn };
        all.push(run(&job(&truth)).output.roundness_um.unwrap());
    }
    all
}

#[test]
fn rings_are_within_their_tolerance_as_often_as_is_said() {
    let count = std::env::var("PRECUT_CERTAINTY").ok().and_then(|count| count.parse().ok()).unwrap_or(60);
    let mut drawn = drawn_um(count);
    drawn.sort_by(f64::total_cmp);
    let share = |um: f64| drawn.iter().filter(|own| **own <= um).count() as f64 / f64::from(count);
    // Two and a half binomial deviations, and what the answer says of its own error.
    let scatter = |p: f64| 2.5 * (p.max(0.02) * (1.0 - p).max(0.02) / f64::from(count)).sqrt();
    for place in [0.2, 0.5, 0.9] {
        let tolerance_um = drawn[(place * f64::from(count)) as usize];
        let found = conformance(&certain(tolerance_um));
        let (told, error) = (found.joint.probability, found.joint.numerical_error);
        println!(
            "{tolerance_um:.3} um: told {told:.3} +- {error:.3} (linear {:.3}), good {:.3} of {count}, {} rings cut",
            found.linear_probability,
            share(tolerance_um),
            found.rings_cut
        );
        for one in &found.contributions {
            println!("    {} {:?} {:?}", one.quantity, one.share_of_variance, one.joint_probability_if_halved);
        }
        assert!((told - share(tolerance_um)).abs() < scatter(told) + error, "{told} {}", share(tolerance_um));
        let within = share(found.roundness_high_um) - share(found.roundness_low_um);
        println!("    nine of ten from {} to {} um: {within}", found.roundness_low_um, found.roundness_high_um);
        assert!((within - 0.9).abs() < scatter(0.9) + 2.0 * error + 0.01, "{within}");
    }
}

#[test]
fn the_roundness_that_is_said_to_hold_holds() {
    let found = conformance(&certain(3.0));
    let at_wanted = conformance(&certain(found.roundness_at_wanted_um));
    let error = found.joint.numerical_error + at_wanted.joint.numerical_error + 1e-3;
    assert!((at_wanted.joint.probability - found.joint.wanted).abs() < error, "{:?}", at_wanted.joint);
    // From the same rings: a wider tolerance is kept more often, and a known tool angle makes it surer.
    let wide = conformance(&certain(1.5 * found.roundness_at_wanted_um));
    assert!(wide.joint.probability > at_wanted.joint.probability);
    let halved = |quantity: &str| {
        let own = at_wanted.contributions.iter().find(|one| one.quantity == quantity).unwrap();
        own.joint_probability_if_halved.unwrap()
    };
    assert!(halved("tool_angle") > at_wanted.joint.probability - error);
    let sum: f64 = found.contributions.iter().filter_map(|one| one.share_of_variance).sum();
    assert!((sum - 1.0).abs() < 1e-9, "{sum}");
}

#[test]
fn where_nothing_is_uncertain_the_probability_is_all_or_nothing() {
    let mut job = certain(3.0);
    job["uncertainty"] = json!({ "defaults": false });
    job["ring"] = json!({ "radius_mm": 45.0 });
    job["effects"] = json!([]);
    job["analyses"] = json!(["simulation", "certainty"]);
    let exact = run(&job).output.roundness_um.unwrap();
    for (factor, probability) in [(1.05, 1.0 - 1e-6), (0.95, 1e-6)] {
        job["tolerance"] = json!({ "roundness_um": factor * exact });
        let answer = run(&job);
        let found = answer.output.conformance.unwrap();
        assert!((found.joint.probability - probability).abs() < 1e-9, "{factor}: {:?}", found.joint);
        assert!((found.roundness_median_um / exact - 1.0).abs() < 2e-3, "{} {exact}", found.roundness_median_um);
        let warns = |code: &str| answer.warnings.iter().any(|warning| warning.code == code);
        assert_eq!(warns("improbable_roundness"), factor < 1.0);
        assert_eq!(warns("roundness_beyond_tolerance"), factor < 1.0);
    }
}

#[test]
fn what_cannot_be_is_told() {
    let mut job = certain(3.0);
    job.as_object_mut().unwrap().remove("tolerance");
    job["compliance_ratio"] = json!(0.0);
    job["uncertainty"]["quantities"] = json!([
        { "quantity": "tool_angle", "distribution": { "kind": "normal", "standard_uncertainty_um": 3.0 } },
        { "quantity": "compliance_ratio", "distribution": { "kind": "lognormal", "log_standard_deviation": 0.3 } },
        { "quantity": "tool_angle", "distribution": { "kind": "normal", "standard_uncertainty_deg": 0.1 } }
    ]);
    job["uncertainty"]["correlations"] = json!([{ "between": ["tool_angle", "tool_angle"], "coefficient": 0.5 }]);
    let told: Vec<String> = faults(&job).into_iter().map(|fault| format!("{} {}", fault.code, fault.pointer)).collect();
    for expected in [
        "roundness_tolerance_missing /tolerance",
        "unit_of_quantity /uncertainty/quantities/0/distribution",
        "quantity_of_nothing /uncertainty/quantities/1/quantity",
        "duplicate_quantity /uncertainty/quantities/2/quantity",
        "bad_correlation /uncertainty/correlations/0/between",
    ] {
        assert!(told.iter().any(|one| one == expected), "{expected}: {told:?}");
    }
}
