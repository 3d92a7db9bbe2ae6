//! What a diagnosis leaves open of the effects on a schedule's models: against limits moved in by hand, and by parts that are drawn from
//! it with formulas of the test's own.
#![allow(clippy::unwrap_used, clippy::panic, clippy::cast_precision_loss, missing_docs)]

use crate::draw::Draw;
use crate::feed_risk::{answered, case, near, normal, number, solved};
use precut_calc::calculator::{Check as _, Violations};
use precut_calc::feed_schedule::Job;
use serde_json::{Value, json};

const DRAWS: u32 = 20_000;
/// The quantile of the standard normal distribution at 1 %.
const ONE_PERCENT: f64 = 2.326_347_874_040_841;

fn by(effect: u32, parameter: &str, by: f64) -> Value {
    json!({ "effect": effect, "parameter": parameter, "by": by })
}

fn open(directions: &[&[Value]]) -> Value {
    json!({ "effects": directions.iter().map(|moves| json!({ "moves": moves })).collect::<Value>() })
}

/// A level that is not known by so much.
fn open_level(deviation: f64) -> Value {
    open(&[&[by(1, "delta_ln", deviation)]])
}

/// Three zones with limits of roughness and deflection, each at a risk of 1 %, edges at 2 %.
fn job(effects: Value, uncertainty: Value) -> Value {
    let mut job = case("f1-each-one-percent")["job"].clone();
    job["effects"] = effects;
    job["uncertainty"] = uncertainty;
    job
}

fn limits(answer: &Value) -> Vec<Value> {
    answer["conformance"]["limits"].as_array().unwrap().clone()
}

fn scatter(job: &Value, model: &str) -> f64 {
    number(job, &format!("/models/{model}/residual_scatter"))
}

/// A level that is not known is one scatter more: of all parts alike, but as wide for each of them.
#[test]
fn an_open_level_moves_limits_in_like_a_scatter() {
    let level = |output: &str| json!({ "kind": "level_shift", "delta_ln": 0.0, "output": output });
    let effects = json!([level("roughness"), level("tool_life")]);
    let open = open(&[&[by(1, "delta_ln", 0.2), by(2, "delta_ln", -0.1)], &[by(2, "delta_ln", 0.3)]]);
    let plain = job(json!([]), json!({}));
    let mut by_hand = plain.clone();
    for (model, deviation) in [("roughness", 0.2), ("tool_life", 0.1_f64.hypot(0.3))] {
        by_hand["models"][model]["residual_scatter"] = json!(scatter(&plain, model).hypot(deviation));
    }
    let (found, expected) = (solved(&job(effects, open)), solved(&by_hand));
    near("objective", number(&found, "/objective"), number(&expected, "/objective"), 1e-7);
    for (own, other) in limits(&found).iter().zip(limits(&expected)) {
        assert_eq!(own["limit"], other["limit"]);
        assert!((number(own, "/probability") - number(&other, "/probability")).abs() < 1e-6, "{own} {other}");
    }
    assert!((number(&limits(&found)[0], "/probability") - 0.99).abs() < 1e-6, "{found}");
    // A model whose results do not scatter has a limit at a risk by what is open alone.
    let mut alone = job(json!([level("roughness")]), open_level(0.2));
    alone["models"]["roughness"].as_object_mut().unwrap().remove("residual_scatter");
    let mut stated = plain.clone();
    stated["models"]["roughness"]["residual_scatter"] = json!(0.2);
    near("alone", number(&solved(&alone), "/objective"), number(&solved(&stated), "/objective"), 1e-7);
    // What is open of an effect that does not act here is nothing.
    let batch = json!([{ "kind": "batch_shift", "batch": "B", "delta_ln": 0.1, "output": "roughness" }]);
    let mut elsewhere = job(batch, open_level(0.2));
    elsewhere["conditions"] = json!({ "batch": "A" });
    near("elsewhere", number(&solved(&elsewhere), "/objective"), number(&solved(&plain), "/objective"), 1e-9);
}

/// An exponent that is not known widens a limit with the distance from where it turns: one zone at a given speed, whose feed stands
/// where the limit is by hand.
#[test]
fn an_open_exponent_has_the_closed_form() {
    let (about, deviation, speed) = (0.12_f64, 0.25, 120.0_f64);
    let effects =
        json!([{ "kind": "feed_exponent", "delta": 0.1, "reference_feed_mm_per_rev": about, "output": "roughness" }]);
    let mut job = job(effects, open(&[&[by(1, "delta", deviation)]]));
    job["zones"] = json!([job["zones"][1]]);
    job["zones"][0].as_object_mut().unwrap().remove("deflection_max_um");
    job["variables"] = json!({ "speed": "fixed", "fixed_speed_m_per_min": speed });
    job["objective"] = json!({ "kind": "time" });
    let feed = number(&solved(&job), "/zones/0/feed_mm_per_rev");
    let own = |field: &str| number(&job, &format!("/models/roughness/{field}"));
    let off = (feed / about).ln();
    let expected = own("constant") + own("speed_exponent") * speed.ln() + own("feed_exponent") * feed.ln() + 0.1 * off;
    let kept = expected + ONE_PERCENT * own("residual_scatter").hypot(deviation * off);
    near("limit", kept.exp(), number(&job, "/zones/0/roughness_max_um"), 1e-6);
}

/// A posterior of three effects on roughness and passive force: the second and third bend over feed, or in their own numbers.
fn posterior(is_bent: bool) -> (Value, Value) {
    let level = json!({ "kind": "level_shift", "delta_ln": 0.1, "output": "roughness" });
    let of_feed = |kind: &str, field: &str, value: f64| json!({ "kind": kind, field: value, "reference_feed_mm_per_rev": 0.12, "output": "roughness" });
    if is_bent {
        let offset = json!({ "kind": "edge_force_offset", "offset_n": 60.0, "output": "force_y" });
        let directions =
            [[by(1, "delta_ln", 0.12), by(3, "offset_n", 20.0)], [by(2, "coef", 0.15), by(3, "offset_n", -15.0)]];
        return (
            json!([level, of_feed("feed_curvature", "coef", 0.05), offset]),
            open(&directions.each_ref().map(<[_; 2]>::as_slice)),
        );
    }
    let force =
        json!({ "kind": "speed_exponent", "delta": -0.05, "reference_speed_m_per_min": 100.0, "output": "force_y" });
    let directions = [[by(1, "delta_ln", 0.12), by(2, "delta", 0.1)], [by(2, "delta", 0.2), by(3, "delta", 0.15)]];
    (
        json!([level, of_feed("feed_exponent", "delta", 0.1), force]),
        open(&directions.each_ref().map(<[_; 2]>::as_slice)),
    )
}

/// Parts drawn with the effects as they may be keep the limits as often as told, each and together; effects go together over outputs.
#[test]
fn parts_of_a_posterior_keep_their_limits_as_often_as_said() {
    let [each, joint] = [json!({ "kind": "each", "risk_percent": 5 }), json!({ "kind": "joint", "risk_percent": 10 })];
    for (is_bent, risk) in [(false, joint), (true, each)] {
        let (effects, open) = posterior(is_bent);
        let mut job = job(effects, open);
        job["risk"] = risk;
        // So narrow that both limits are passed.
        for zone in job["zones"].as_array_mut().unwrap() {
            zone["deflection_max_um"] = json!(0.7 * zone["deflection_max_um"].as_f64().unwrap());
        }
        let answer = solved(&job);
        let told = &answer["conformance"];
        let mut draw = Draw::new(31);
        let (mut kept, mut all) = ([[0_u32; 2]; 3], 0_u32);
        for _ in 0..DRAWS {
            let scores = [normal(&mut draw), normal(&mut draw)];
            let mut is_good = true;
            for (zone, of_zone) in kept.iter_mut().enumerate() {
                let results = drawn(&job, &answer, zone, is_bent, scores, &mut draw);
                let limits = ["roughness_max_um", "deflection_max_um"];
                for ((field, result), count) in limits.iter().zip(results).zip(of_zone) {
                    let is_kept = result <= number(&job, &format!("/zones/{zone}/{field}"));
                    *count += u32::from(is_kept);
                    is_good &= is_kept;
                }
            }
            all += u32::from(is_good);
        }
        let share = |count: u32| f64::from(count) / f64::from(DRAWS);
        let joint = number(told, "/joint_probability");
        eprintln!("{}: told {joint:.4}, kept {:.4}", job["risk"]["kind"], share(all));
        // Three deviations of 20,000 draws are 0.007.
        assert!((share(all) - joint).abs() < 0.01, "told {joint}, kept {}", share(all));
        for (place, name) in ["roughness", "deflection"].iter().enumerate() {
            let worst = told["limits"].as_array().unwrap().iter().find(|one| one["limit"] == *name).unwrap();
            let least = kept.iter().map(|zone| share(zone[place])).fold(1.0, f64::min);
            eprintln!("    {name}: told {worst}, kept {least:.4}");
            // What bends is told as it is drawn: of 20,000 draws three deviations are 0.005 at 0.95.
            assert!((least - number(worst, "/probability")).abs() < 0.005, "{worst}, kept {least}");
        }
        if job["risk"]["kind"] == "joint" {
            // Boole's bound keeps more than is asked.
            assert!(share(all) > 0.89, "{}", share(all));
        }
    }
}

/// Roughness and deflection of a zone, at the schedule's speed and feed, where the directions of what is open come to these scores.
fn drawn(job: &Value, answer: &Value, zone: usize, is_bent: bool, scores: [f64; 2], draw: &mut Draw) -> [f64; 2] {
    let given = |field: &str| number(answer, &format!("/zones/{zone}/{field}"));
    let moved = |place: usize, field: &str| {
        let mut value = number(job, &format!("/effects/{place}/{field}"));
        for (direction, score) in job["uncertainty"]["effects"].as_array().unwrap().iter().zip(scores) {
            let own = direction["moves"].as_array().unwrap().iter().filter(|own| own["effect"] == json!(place + 1));
            value += own.map(|own| number(own, "/by") * score).sum::<f64>();
        }
        value
    };
    let model = |name: &str, field: &str| {
        job.pointer(&format!("/models/{name}/{field}")).and_then(Value::as_f64).unwrap_or(0.0)
    };
    let (u, x) = (given("speed_m_per_min").ln(), given("feed_mm_per_rev").ln());
    let t = number(job, &format!("/zones/{zone}/depth_mm")).ln();
    let law = |name: &str| {
        let of = |field: &str| model(name, field);
        of("constant") + of("speed_exponent") * u + of("feed_exponent") * x + of("depth_exponent") * t
    };
    let of_feed = x - 0.12_f64.ln();
    let [second, force] = if is_bent {
        let plain_n = law("force_y").exp();
        [moved(1, "coef") * of_feed * of_feed, (plain_n + moved(2, "offset_n")).ln() - plain_n.ln()]
    } else {
        [moved(1, "delta") * of_feed, moved(2, "delta") * (u - 100.0_f64.ln())]
    };
    let roughness = law("roughness") + moved(0, "delta_ln") + second + scatter(job, "roughness") * normal(draw);
    let force_n = (law("force_y") + force + scatter(job, "force_y") * normal(draw)).exp();
    [roughness.exp(), force_n * number(job, &format!("/zones/{zone}/compliance_um_per_n"))]
}

/// A roughness whose coefficients are of a fit, and of which a diagnosis has found a level, or a level and an exponent, about a cut. The diagnosis
/// took the coefficients as they are: what they are really off by is in what it found. Parts are made with coefficients that are drawn from
/// the fit, and with the effects that such a diagnosis found so.
#[test]
fn what_a_diagnosis_found_of_a_fit_is_not_counted_again() {
    const LEVEL: f64 = 0.05;
    const EXPONENT: f64 = 0.2;
    let (speed, feed) = (90.0_f64, 0.15_f64);
    let level = json!({ "kind": "level_shift", "delta_ln": 0.1, "output": "roughness" });
    let exponent =
        json!({ "kind": "feed_exponent", "delta": 0.1, "reference_feed_mm_per_rev": feed, "output": "roughness" });
    let found = [
        (json!([level]), open(&[&[by(1, "delta_ln", LEVEL)]]), 0.0),
        (json!([level, exponent]), open(&[&[by(1, "delta_ln", LEVEL)], &[by(2, "delta", EXPONENT)]]), EXPONENT),
    ];
    for (effects, open, of_exponent) in found {
        let mut job = job(effects, open);
        for zone in job["zones"].as_array_mut().unwrap() {
            zone.as_object_mut().unwrap().remove("deflection_max_um");
        }
        job["risk"] = json!({ "kind": "each", "risk_percent": 5 });
        // Trials about the cut as they leave three coefficients: the constant far off them and correlated with both exponents.
        let lower = [[0.15, 0.0, 0.0], [0.0, 0.12, 0.0], [0.0, 0.05, 0.1]];
        let (u, x) = (speed.ln() + 0.4, feed.ln() - 0.3);
        let constant: [f64; 3] = std::array::from_fn(|k| {
            let own = if k == 0 { lower[0][0] } else { 0.0 };
            own - u * lower[1][k] - x * lower[2][k]
        });
        let factor = [constant, lower[1], lower[2]];
        let product = |i: usize, j: usize| (0..3).map(|k| factor[i][k] * factor[j][k]).sum::<f64>();
        let matrix: Value = (0..3).map(|i| (0..3).map(|j| product(i, j)).collect::<Value>()).collect();
        job["models"]["roughness"]["coefficient_covariance"] =
            json!({ "order": ["constant", "speed_exponent", "feed_exponent"], "matrix": matrix });
        let twice = solved(&job);
        job["reference"] = json!({ "speed_m_per_min": speed, "feed_mm_per_rev": feed });
        let answer = answered(&job).unwrap();
        let limits_kept = answer.explanation.iter().find(|said| said.code == "limits_kept").unwrap();
        assert!(limits_kept.values.get("replaced").is_some());
        let answer = serde_json::to_value(answer.output).unwrap();
        // Where nothing is known of the cut at which a level was found, it and the covariance both count.
        assert!(number(&twice, "/objective") > number(&answer, "/objective"));
        let own =
            |field: &str| job.pointer(&format!("/models/roughness/{field}")).and_then(Value::as_f64).unwrap_or(0.0);
        let mut draw = Draw::new(37);
        let (mut kept, mut all) = ([0_u32; 3], 0_u32);
        for _ in 0..DRAWS {
            let scores: [f64; 3] = std::array::from_fn(|_| normal(&mut draw));
            let off = factor.map(|row| row.iter().zip(scores).map(|(by, score)| by * score).sum::<f64>());
            // The diagnosis has seen the level of the cut, and how the roughness goes with the feed.
            let seen = off[0] + off[1] * speed.ln() + off[2] * feed.ln();
            let level = 0.1 - seen - LEVEL * normal(&mut draw);
            let exponent = if of_exponent > 0.0 { 0.1 - off[2] - of_exponent * normal(&mut draw) } else { 0.0 };
            let mut is_good = true;
            for (place, count) in kept.iter_mut().enumerate() {
                let given = |field: &str| number(&answer, &format!("/zones/{place}/{field}"));
                let (u, x) = (given("speed_m_per_min").ln(), given("feed_mm_per_rev").ln());
                let depth = own("depth_exponent") * number(&job, &format!("/zones/{place}/depth_mm")).ln();
                let cut = own("constant") + off[0] + (own("speed_exponent") + off[1]) * u + depth;
                let cut = cut + (own("feed_exponent") + off[2]) * x + level + exponent * (x - feed.ln());
                let roughness = (cut + own("residual_scatter") * normal(&mut draw)).exp();
                let is_kept = roughness <= number(&job, &format!("/zones/{place}/roughness_max_um"));
                *count += u32::from(is_kept);
                is_good &= is_kept;
            }
            all += u32::from(is_good);
        }
        let share = |count: u32| f64::from(count) / f64::from(DRAWS);
        let (joint, least) = (number(&answer, "/conformance/joint_probability"), kept.iter().copied().min().unwrap());
        let told = limits(&answer).into_iter().find(|one| one["limit"] == "roughness").unwrap();
        eprintln!("all told {joint:.4}, kept {:.4}; worst told {told}, kept {:.4}", share(all), share(least));
        assert!((share(all) - joint).abs() < 0.01, "told {joint}, kept {}", share(all));
        // Three deviations of 20,000 draws at 0.95.
        assert!((share(least) - number(&told, "/probability")).abs() < 0.005, "{told}, kept {}", share(least));
    }
}

/// Without width nothing is open, and the answer says when something is.
#[test]
fn what_is_open_is_said_and_what_cannot_be_is_told() {
    let effects = json!([{ "kind": "level_shift", "delta_ln": 0.05, "output": "roughness" }]);
    let of = |uncertainty: Value| {
        let answer = answered(&job(effects.clone(), uncertainty)).unwrap();
        let said = answer.explanation.iter().find(|said| said.code == "limits_kept").unwrap();
        (said.values.get("open").is_some(), answer.output.objective)
    };
    let (nothing, without_width) = (of(json!({})), of(open_level(0.0)));
    assert_eq!((nothing.0, without_width.0, of(open_level(0.1)).0), (false, false, true));
    near("without width", without_width.1, nothing.1, 1e-12);
    let wrong = open(&[&[by(1, "coef", 0.1), by(2, "delta_ln", 0.1)]]);
    let refused: Job = serde_json::from_value(job(effects.clone(), wrong)).unwrap();
    let mut violations = Violations::default();
    refused.check(&mut violations);
    let codes: Vec<_> = violations.into_vec().into_iter().map(|fault| fault.code).collect();
    assert_eq!(codes, ["unknown_parameter", "unknown_parameter"]);
}
