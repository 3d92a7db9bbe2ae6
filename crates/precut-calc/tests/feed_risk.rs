//! Schedules at a stated risk: against cases that other programs computed, against the plain schedule with limits moved in by
//! hand, and by drawing the scatter.
#![allow(clippy::unwrap_used, clippy::panic, missing_docs)]

use crate::draw::Draw;
use crate::feed_support;
use precut_calc::calculator::{Calculator as _, Check as _, Failure, Unwatched, Violations};
use precut_calc::feed_schedule::fit::{FitJob, MachinabilityFit};
use precut_calc::feed_schedule::{FeedSchedule, Job};
use serde_json::{Value, json};

pub(crate) fn case(name: &str) -> Value {
    let path = format!("{}/reference/certainty/{name}.json", env!("CARGO_MANIFEST_DIR"));
    serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap()
}

pub(crate) fn answered(
    job: &Value,
) -> Result<precut_calc::calculator::Answer<precut_calc::feed_schedule::Outcome>, Failure> {
    FeedSchedule::run(&feed_support::job(job.clone()), &Unwatched)
}

pub(crate) fn solved(job: &Value) -> Value {
    serde_json::to_value(answered(job).unwrap().output).unwrap()
}

pub(crate) fn number(value: &Value, pointer: &str) -> f64 {
    value.pointer(pointer).and_then(Value::as_f64).unwrap_or_else(|| panic!("{pointer} in {value}"))
}

pub(crate) fn near(name: &str, found: f64, expected: f64, relative: f64) {
    assert!((found / expected - 1.0).abs() <= relative, "{name}: {found}, expected {expected}");
}

#[test]
fn references_are_met() {
    for name in ["f1-each-one-percent", "f2-joint-one-percent", "f3-covariance-each"] {
        let case = case(name);
        let expected = &case["expected"];
        let answer = solved(&case["job"]);
        eprintln!("{name}: {} {}", answer["objective"], answer["conformance"]);
        near(name, number(&answer, "/objective"), number(expected, "/objective"), 2e-6);
        let joint = number(&answer, "/conformance/joint_probability");
        assert!((joint - number(expected, "/probability_joint_monte_carlo")).abs() < 0.002, "{name}: {joint}");
        let gain = number(&answer, "/conformance/gain_percent_per_percent_of_risk");
        near(name, gain, number(expected, "/gain_percent_per_percent_of_risk"), 0.01);
    }
    let whole = case("f6-whole-edges-risk");
    let answer = solved(&whole["job"]);
    near("f6", number(&answer, "/objective"), number(&whole, "/expected/objective"), 2e-6);
    assert!((number(&answer, "/edges_per_part") - 3.0).abs() < 1e-12);
    let edge = answer["conformance"]["limits"].as_array().unwrap().iter().find(|one| one["limit"] == "edge").unwrap();
    assert!(number(edge, "/probability") > 0.95 - 1e-6, "{edge}");
}

#[test]
fn a_risk_that_cannot_be_had_is_refused_with_the_least_that_can() {
    let case = case("f4-infeasible-at-the-risk");
    let refused = |job: &Value| match answered(job) {
        Err(Failure::OutOfModel(finding)) => finding,
        other => panic!("{other:?}"),
    };
    for kind in ["joint", "each"] {
        let mut job = case["job"].clone();
        job["risk"]["kind"] = json!(kind);
        let finding = refused(&job);
        assert_eq!(finding.code, "infeasible_at_this_risk");
        let least = finding.limit.unwrap_or(f64::NAN);
        eprintln!("{kind}: {least}");
        if kind == "joint" {
            near("least risk", least, number(&case, "/expected/least_risk_percent"), 1e-3);
        }
        // What is advised is done; a little less is refused.
        job["risk"]["risk_percent"] = json!(least * 1.0001);
        solved(&job);
        job["risk"]["risk_percent"] = json!(least * 0.999);
        assert_eq!(refused(&job).code, "infeasible_at_this_risk");
    }
}

/// The job without a risk whose limits are moved in by hand: only power laws scatter in it.
fn by_hand(job: &Value, [of_part, of_edges]: [f64; 2]) -> Value {
    let mut job = job.clone();
    let scatter = |name: &str| number(&job, &format!("/models/{name}/residual_scatter"));
    let [roughness, force, life] = ["roughness", "force_y", "tool_life"].map(scatter);
    for zone in job["zones"].as_array_mut().unwrap() {
        for (field, s) in [("roughness_max_um", roughness), ("deflection_max_um", force)] {
            zone[field] = json!(zone[field].as_f64().unwrap() * (-of_part * s).exp());
        }
    }
    job["limits"]["tool_usage_max"] = json!((-of_edges * life).exp());
    job["risk"] = json!({ "kind": "none" });
    job
}

#[test]
fn a_risk_of_each_limit_is_the_plain_schedule_with_limits_moved_in() {
    let job = case("f1-each-one-percent")["job"].clone();
    // Quantiles of the standard normal distribution at 1 and 2 %.
    let by_hand = solved(&by_hand(&job, [2.326_347_874_040_841, 2.053_748_910_631_823]));
    near("objective", number(&solved(&job), "/objective"), number(&by_hand, "/objective"), 1e-7);
    // At a half the limits are where the models expect their results.
    let mut half = job;
    half["risk"] = json!({ "kind": "each", "risk_percent": 49.999_999, "edge_risk_percent": 49.999_999 });
    let mut plain = half.clone();
    plain["risk"] = json!({ "kind": "none" });
    near("a half", number(&solved(&half), "/objective"), number(&solved(&plain), "/objective"), 1e-6);
}

/// A zone with a risk of its own is the plain schedule whose limits there are moved in by that.
#[test]
fn a_zone_may_have_a_risk_of_its_own() {
    let mut job = case("f1-each-one-percent")["job"].clone();
    let edges = 2.053_748_910_631_823;
    let mut moved = by_hand(&job, [2.326_347_874_040_841, edges]);
    // The quantile of 0.1 %.
    moved["zones"][1] = by_hand(&job, [3.090_232_306_167_813, edges])["zones"][1].clone();
    let everywhere = number(&solved(&job), "/objective");
    job["zones"][1]["risk_percent"] = json!(0.1);
    let own = solved(&job);
    near("objective", number(&own, "/objective"), number(&solved(&moved), "/objective"), 1e-7);
    assert!(number(&own, "/objective") > everywhere * (1.0 + 1e-5));
    let of = |answer: &Value, limit: &str| -> Value {
        let all = answer["conformance"]["limits"].as_array().unwrap();
        all.iter().find(|one| one["limit"] == limit).unwrap().clone()
    };
    // The worst place of a limit stays in another zone, and no warning is told of what was asked for.
    assert!((number(&of(&own, "roughness"), "/probability") - 0.99).abs() < 1e-6);
    assert_ne!(of(&own, "roughness")["zone"], "z2");
    // What a percent of the common risk is worth, by difference, the zone's own as it is.
    let gain = number(&own, "/conformance/gain_percent_per_percent_of_risk");
    let at = |percent: f64| {
        let mut job = job.clone();
        job["risk"]["risk_percent"] = json!(percent);
        number(&solved(&job), "/objective")
    };
    near("gain", gain, (at(0.99) / at(1.01)).ln() / (1.01_f64 / 0.99).ln(), 0.01);
}

/// A risk of a zone that cannot be had is told with the least that can, and that is tried.
#[test]
fn a_risk_of_a_zone_that_cannot_be_had_is_refused_with_the_least_that_can() {
    let mut job = case("f4-infeasible-at-the-risk")["job"].clone();
    job["risk"]["kind"] = json!("each");
    job["risk"]["risk_percent"] = json!(45.0);
    solved(&job);
    job["zones"][0]["risk_percent"] = json!(0.001);
    let least = match answered(&job) {
        Err(Failure::OutOfModel(finding)) if finding.code == "infeasible_at_this_risk" => finding.limit.unwrap(),
        other => panic!("{other:?}"),
    };
    job["zones"][0]["risk_percent"] = json!(least * 1.0001);
    solved(&job);
    job["zones"][0]["risk_percent"] = json!(least * 0.999);
    assert!(answered(&job).is_err());
}

/// A worn-out edge costs what it costs as often as it is worn out: an edge costs as much more.
#[test]
fn a_worn_out_edge_is_paid_as_often_as_it_is_risked() {
    for name in ["f1-each-one-percent", "f6-whole-edges-risk"] {
        let mut job = case(name)["job"].clone();
        let risk = number(&job, "/risk/edge_risk_percent") / 100.0;
        let mut dearer = job.clone();
        dearer["objective"]["edge_cost"] = json!(number(&job, "/objective/edge_cost") + risk * 80.0);
        let before = number(&solved(&job), "/objective");
        job["risk"]["edge_failure_cost"] = json!(80.0);
        let [own, dearer] = [&job, &dearer].map(|job| number(&solved(job), "/objective"));
        near(name, own, dearer, 1e-9);
        assert!(own > before * (1.0 + 1e-4), "{own} {before}");
    }
}

#[test]
fn what_is_asked_of_single_risks_in_vain_is_told() {
    let faults = |change: &dyn Fn(&mut Value)| -> Vec<String> {
        let mut job = case("f1-each-one-percent")["job"].clone();
        change(&mut job);
        let job: Job = serde_json::from_value(job).unwrap();
        let mut violations = Violations::default();
        job.check(&mut violations);
        violations.into_vec().iter().map(|one| format!("{} {}", one.code, one.pointer)).collect()
    };
    let of_zone = faults(&|job| {
        job["risk"] = json!({ "kind": "joint", "risk_percent": 1 });
        job["zones"][2]["risk_percent"] = json!(0.5);
    });
    assert_eq!(of_zone, ["zone_risk_without_each /zones/2/risk_percent"]);
    let of_edges = faults(&|job| {
        job["risk"] = json!({ "kind": "each", "risk_percent": 1, "edge_failure_cost": 80 });
        job["objective"] = json!({ "kind": "time", "tool_change_time_min": 2 });
    });
    assert_eq!(
        of_edges,
        ["edge_failure_without_cost /objective/kind", "edge_failure_without_risk /risk/edge_failure_cost"]
    );
}

/// A standard normal number.
pub(crate) fn normal(draw: &mut Draw) -> f64 {
    let share = draw.share().clamp(1e-12, 1.0 - 1e-12);
    -std::f64::consts::SQRT_2 * statrs::function::erf::erfc_inv(2.0 * share)
}

#[test]
fn parts_keep_their_limits_as_often_as_said() {
    for (name, draws) in [("f1-each-one-percent", 20_000), ("f2-joint-one-percent", 20_000)] {
        let job = case(name)["job"].clone();
        let answer = solved(&job);
        let told = number(&answer, "/conformance/joint_probability");
        let mut draw = Draw::new(23);
        let scatter = |name: &str| number(&job, &format!("/models/{name}/residual_scatter"));
        let zones: Vec<(&Value, &Value)> =
            answer["zones"].as_array().unwrap().iter().zip(job["zones"].as_array().unwrap()).collect();
        let keeps = |draw: &mut Draw| {
            zones.iter().all(|(given, asked)| {
                let rough = number(given, "/roughness_um") * (scatter("roughness") * normal(draw)).exp();
                let bent = number(given, "/deflection_um") * (scatter("force_y") * normal(draw)).exp();
                rough <= number(asked, "/roughness_max_um") && bent <= number(asked, "/deflection_max_um")
            })
        };
        let good = (0..draws).filter(|_| keeps(&mut draw)).count();
        let share = good as f64 / f64::from(draws);
        let deviation = (told * (1.0 - told) / f64::from(draws)).sqrt();
        eprintln!("{name}: told {told}, {share} of {draws}");
        assert!((share - told).abs() < 3.5 * deviation, "{name}: told {told}, {share}");
        // Edges are worn out no more often than is accepted.
        let life = scatter("tool_life");
        let used = number(&answer, "/tool_usage");
        let worn = (0..draws).filter(|_| used * (-life * normal(&mut draw)).exp() > 1.0).count();
        let share = worn as f64 / f64::from(draws);
        assert!(share < 0.02 + 3.5 * (0.02 * 0.98 / f64::from(draws)).sqrt(), "{share}");
    }
}

fn codes(job: &Value) -> Vec<&'static str> {
    answered(job).unwrap().warnings.iter().map(|warning| warning.code).collect()
}

#[test]
fn what_the_warning_of_failures_tells_ends_them() {
    let mut job = case("f1-each-one-percent")["job"].clone();
    job["risk"] = json!({ "kind": "none" });
    assert!(codes(&job).contains(&"half_fail"));
    job["risk"] = json!({ "kind": "each", "risk_percent": 1 });
    // Edges are still used to their median life.
    assert!(codes(&job).contains(&"half_fail"));
    job["risk"]["edge_risk_percent"] = json!(2);
    assert!(!codes(&job).contains(&"half_fail"));
    job["risk"]["kind"] = json!("joint");
    assert!(!codes(&job).contains(&"half_fail"));
    // What a joint risk refuses is not offered beside it.
    let warnings = answered(&job).unwrap().warnings;
    let shares = warnings.iter().find(|warning| warning.code == "shares_of_edges_priced").unwrap();
    assert!(shares.values.get("risk").is_some());
    job["models"]["roughness"].as_object_mut().unwrap().remove("residual_scatter");
    assert!(codes(&job).contains(&"no_scatter_given"));
}

/// Edges have a risk of their own beside a joint one: what they may be used is moved in where it binds, too.
#[test]
fn a_joint_risk_leaves_edges_their_own() {
    let mut job = case("f2-joint-one-percent")["job"].clone();
    let most = 0.7 * number(&solved(&job), "/tool_usage");
    job["limits"]["tool_usage_max"] = json!(most);
    // Quantile of the standard normal distribution at 2 %.
    let allowed = most * (-2.053_748_910_631_823 * number(&job, "/models/tool_life/residual_scatter")).exp();
    near("usage", number(&solved(&job), "/tool_usage"), allowed, 1e-6);
}

#[test]
fn a_joint_risk_costs_no_more_than_the_same_shared_evenly() {
    let job = case("f2-joint-one-percent")["job"].clone();
    let joint = number(&solved(&job), "/objective");
    // Six limits of three zones scatter.
    let mut each = job;
    each["risk"]["kind"] = json!("each");
    each["risk"]["risk_percent"] = json!(100.0 * -((1.0_f64 - 0.01).ln() / 6.0).exp_m1());
    let each = number(&solved(&each), "/objective");
    assert!(joint < each * (1.0 - 1e-3), "{joint} {each}");
}

#[test]
fn prices_are_those_of_the_schedule_at_its_risk() {
    for name in ["f1-each-one-percent", "f2-joint-one-percent"] {
        let job = case(name)["job"].clone();
        let answer = solved(&job);
        let prices = answer["prices"].as_array().unwrap();
        assert!(!prices.is_empty());
        for price in prices.iter().take(4) {
            let pointer = price["pointer"].as_str().unwrap();
            let mut turned = job.clone();
            let step = if price["looser"] == "less" { -1e-3 } else { 1e-3_f64 };
            let value = turned.pointer(pointer).unwrap().as_f64().unwrap();
            *turned.pointer_mut(pointer).unwrap() = json!(value * step.exp());
            let gain = (number(&answer, "/objective") / number(&solved(&turned), "/objective")).ln() / step.abs();
            let told = number(price, "/gain_percent");
            assert!((gain - told).abs() < 0.02 * told + 1e-4, "{name}: {pointer} {told}, {gain}");
        }
    }
}

#[test]
fn a_joint_risk_is_shared_only_where_all_of_it_is() {
    let job = case("f2-joint-one-percent")["job"].clone();
    for (field, value) in [
        ("/method", json!({ "kind": "continuous" })),
        ("/limits/whole_edges", json!(true)),
        ("/trade_off", json!({ "limit": "roughness", "factor_from": 0.8, "factor_to": 1.2, "count": 5 })),
    ] {
        let mut job = job.clone();
        let (parent, name) = field.rsplit_once('/').unwrap();
        job.pointer_mut(parent).unwrap()[name] = value;
        let job: Job = serde_json::from_value(job).unwrap();
        let mut violations = Violations::default();
        job.check(&mut violations);
        assert!(violations.into_vec().iter().any(|fault| fault.code == "joint_risk_elsewhere"), "{field}");
    }
}

#[test]
fn the_risk_that_costs_least_is_where_neither_more_nor_less_of_it_does() {
    let mut job = case("f2-joint-one-percent")["job"].clone();
    let scrap_cost = 5.0;
    job["risk"] = json!({ "kind": "least_cost", "scrap_cost": scrap_cost, "edge_risk_percent": 2 });
    let answer = solved(&job);
    let found = number(&answer, "/conformance/risk_percent");
    let joint = number(&answer, "/conformance/joint_probability");
    assert!((100.0 * (1.0 - joint) / found - 1.0).abs() < 1e-3, "{joint} {found}");
    let at = |percent: f64| {
        let mut job = job.clone();
        job["risk"] = json!({ "kind": "joint", "risk_percent": percent, "edge_risk_percent": 2 });
        number(&solved(&job), "/objective") + scrap_cost * percent / 100.0
    };
    let best = at(found);
    eprintln!("{found} %: {best}; {} {}", at(0.7 * found), at(1.4 * found));
    for factor in [0.3, 0.7, 0.9, 1.1, 1.4, 3.0] {
        assert!(at(factor * found) > best, "{factor}");
    }
}

#[test]
fn a_risk_at_an_end_is_not_said_to_cost_least() {
    for scrap_cost in [1e-4, 1e8] {
        let mut job = case("f2-joint-one-percent")["job"].clone();
        // An end of the range is one of a few zones as of many.
        job["zones"].as_array_mut().unwrap().truncate(2);
        job["risk"] = json!({ "kind": "least_cost", "scrap_cost": scrap_cost });
        let answer = answered(&job).unwrap();
        assert!(answer.warnings.iter().any(|warning| warning.code == "risk_at_its_end"), "{scrap_cost}");
        let said = answer.explanation.iter().find(|message| message.code == "limits_kept").unwrap();
        assert!(said.values.get("found_percent").is_none());
    }
}

/// A fit's covariance as a schedule takes it: a limit at the upper end of a new trial's 90 % interval is passed by one in twenty, and
/// a plan on the edge of what the risk allows stands there.
#[test]
fn a_schedule_uses_the_interval_of_the_fit() {
    let trial = |v: f64, s: f64, t: f64, off: f64| {
        let ra = (1.2 - 0.15 * v.ln() + 1.1 * s.ln() + 0.2 * t.ln() + off).exp() * 10.0;
        json!({ "speed_m_per_min": v, "feed_mm_per_rev": s, "depth_mm": t, "roughness_um": ra })
    };
    let trials = [
        trial(80.0, 0.1, 0.5, 0.04),
        trial(160.0, 0.1, 1.5, -0.06),
        trial(80.0, 0.3, 1.5, 0.02),
        trial(160.0, 0.3, 0.5, 0.05),
        trial(113.0, 0.17, 0.9, -0.03),
        trial(113.0, 0.2, 0.8, 0.01),
        trial(90.0, 0.25, 1.0, -0.05),
    ];
    let at = json!({ "speed_m_per_min": 100.0, "feed_mm_per_rev": 0.15, "depth_mm": 0.8 });
    let fit = json!({ "trials": trials, "form": "log_log", "terms": "all", "resamples": 0, "predict": [at], "confidence": 0.9 });
    let fit = MachinabilityFit::run(&serde_json::from_value::<FitJob>(fit).unwrap(), &Unwatched).unwrap().output;
    let fit = serde_json::to_value(fit).unwrap();
    let upper = number(&fit, "/predictions/0/trial_upper");
    let mut job = case("f1-each-one-percent")["job"].clone();
    job["models"] = json!({ "roughness": fit["models"]["roughness"] });
    job["zones"] = json!([{ "id": "z", "z_start_mm": 0, "z_end_mm": 100, "diameter_mm": 60, "depth_mm": 0.8, "roughness_max_um": upper }]);
    job["variables"] =
        json!({ "speed": "fixed", "fixed_speed_m_per_min": 100.0, "feed": "fixed", "fixed_feed_mm_per_rev": 0.15 });
    job["objective"] = json!({ "kind": "time" });
    job["limits"] = json!({ "feed_min_mm_per_rev": 0.05, "feed_max_mm_per_rev": 0.4, "speed_min_m_per_min": 60, "speed_max_m_per_min": 260 });
    job["risk"] = json!({ "kind": "each", "risk_percent": 5.001 });
    let kept = number(&solved(&job), "/conformance/limits/0/probability");
    assert!((kept - 0.95).abs() < 1e-9, "{kept}");
    job["risk"]["risk_percent"] = json!(4.999);
    assert!(matches!(answered(&job), Err(Failure::OutOfModel(_))));
}

/// With a joint risk and coefficients that all zones have in common no more parts fail than is asked.
#[test]
fn a_joint_risk_holds_with_common_coefficients() {
    let mut job = case("f3-covariance-each")["job"].clone();
    job["risk"] = json!({ "kind": "joint", "risk_percent": 5.0 });
    let answer = solved(&job);
    let joint = number(&answer, "/conformance/joint_probability");
    // Boole's bound: above what is asked, and not far.
    assert!((0.95..0.98).contains(&joint), "{joint}");
    job["risk"] = json!({ "kind": "joint", "risk_percent": 2.0 });
    assert!(number(&solved(&job), "/objective") > number(&answer, "/objective"));
}

#[test]
fn a_covariance_that_is_none_is_told() {
    let refused = |covariance: Value| {
        let mut job = case("f3-covariance-each")["job"].clone();
        job["models"]["roughness"]["coefficient_covariance"] = covariance;
        let job: Job = serde_json::from_value(job).unwrap();
        let mut violations = Violations::default();
        job.check(&mut violations);
        violations.into_vec().iter().any(|fault| fault.code == "bad_covariance")
    };
    let two = |matrix: Value| json!({ "order": ["constant", "feed_exponent"], "matrix": matrix });
    assert!(!refused(two(json!([[1.0, 0.5], [0.5, 1.0]]))));
    assert!(refused(two(json!([[1.0, 1.5], [1.5, 1.0]]))));
    assert!(refused(two(json!([[1.0, 0.5], [0.4, 1.0]]))));
    assert!(refused(two(json!([[1.0, 0.5]]))));
    assert!(refused(json!({ "order": ["constant", "constant"], "matrix": [[1.0, 0.5], [0.5, 1.0]] })));
}
