//! Other cuts that are advised since they make a good shaft more probable: done, they are as good as told.
#![allow(clippy::unwrap_used, clippy::panic, missing_docs)]

use crate::deflection_certainty::{number, solved, uncertain_job};
use serde_json::{Value, json};

fn advice(answer: &Value) -> Vec<Value> {
    answer["conformance"]["advice"].as_array().unwrap().clone()
}

/// The job with one advice done, as its user would; `None` of what is no other cut.
fn done(job: &Value, advised: &Value) -> Option<Value> {
    let mut job = job.clone();
    let add = |job: &mut Value, support: Value| job["supports"].as_array_mut().unwrap().push(support);
    let action = &advised["action"];
    let (z_mm, compliance) = (&action["z_mm"], &action["compliance_um_per_n"]);
    match action["kind"].as_str().unwrap() {
        "lower_feed" => match job.get_mut("passes").and_then(|passes| passes.as_array_mut()?.last_mut()) {
            Some(pass) => pass["feed_mm_per_rev"] = action["feed_mm_per_rev"].clone(),
            None => job["cut"]["feed_mm_per_rev"] = action["feed_mm_per_rev"].clone(),
        },
        "shallower_last_pass" => {
            let before = json!({ "diameter_mm": action["diameter_mm"], "compensated": true });
            match job.get_mut("passes").and_then(Value::as_array_mut) {
                Some(passes) => passes.insert(passes.len() - 1, before),
                None => job["passes"] = json!([before, { "diameter_mm": 40.0, "compensated": true }]),
            }
        }
        "add_steady_rest" => {
            add(&mut job, json!({ "kind": "steady_rest", "z_mm": z_mm, "compliance_um_per_n": compliance }));
        }
        "add_centre" => add(&mut job, json!({ "kind": "centre", "z_mm": z_mm, "compliance_um_per_n": compliance })),
        _ => return None,
    }
    Some(job)
}

/// Every other cut that is advised of a job, and how good it is when it is done.
fn tried(job: &Value) -> Vec<String> {
    let answer = solved(job);
    let now = number(&answer, "/conformance/joint/probability");
    let mut kinds = Vec::new();
    for advised in advice(&answer) {
        let Some(done) = done(job, &advised) else { continue };
        let then = solved(&done);
        let (told, found) = (number(&advised, "/joint_probability"), number(&then, "/conformance/joint/probability"));
        eprintln!("{}: {now:.4} before, {told:.4} told, {found:.4} found", advised["action"]["kind"]);
        // The same points, the same model: what is told is what is then answered.
        assert!((told - found).abs() < 1e-9 && found > now, "{advised}: {found}, before {now}");
        kinds.push(advised["action"]["kind"].as_str().unwrap().to_owned());
    }
    kinds
}

#[test]
fn other_cuts_are_as_good_as_told() {
    let tolerance = json!({ "diameter_um": 24.0 });
    let between_centres = uncertain_job(&tolerance);
    assert_eq!(tried(&between_centres).len(), 3);
    let mut in_two_passes = between_centres.clone();
    in_two_passes["passes"] =
        json!([{ "diameter_mm": 40.6 }, { "diameter_mm": 40.0, "feed_mm_per_rev": 0.15, "compensated": true }]);
    let kinds = tried(&in_two_passes);
    assert!(kinds.contains(&"lower_feed".to_owned()) && kinds.contains(&"shallower_last_pass".to_owned()), "{kinds:?}");
    let mut free_end = between_centres;
    free_end["supports"] = json!([{ "kind": "chuck", "z_mm": 0, "compliance_um_per_n": 0.03 }]);
    free_end["shaft"]["segments"][0]["length_mm"] = json!(250);
    assert!(tried(&free_end).contains(&"add_centre".to_owned()));
}

#[test]
fn nothing_is_advised_where_the_probability_suffices() {
    let mut sure = uncertain_job(&json!({ "diameter_um": 24.0 }));
    sure["uncertainty"]["wanted_probability"] = json!(0.01);
    assert!(advice(&solved(&sure)).iter().all(|advised| done(&sure, advised).is_none()));
}

/// What a job cannot ask for is not advised: a feed below the least one, a pass more than it may have.
#[test]
fn no_other_cut_is_advised_that_a_job_cannot_have() {
    let kinds = |job: &Value| -> Vec<Value> {
        advice(&solved(job)).iter().map(|advised| advised["action"]["kind"].clone()).collect()
    };
    let has = |job: &Value, kind: &str| kinds(job).contains(&json!(kind));
    let mut job = uncertain_job(&json!({ "diameter_um": 24.0 }));
    // All but the last take next to nothing.
    let passes = |count: u32| -> Value {
        let step = |left: u32| 40.9 + 0.002 * f64::from(left);
        let before = (1..count).rev().map(step);
        before.chain([40.0]).map(|diameter_mm| json!({ "diameter_mm": diameter_mm, "compensated": true })).collect()
    };
    job["uncertainty"]["wanted_probability"] = json!(0.999_999);
    job["passes"] = passes(19);
    assert!(has(&job, "shallower_last_pass"));
    job["passes"] = passes(20);
    assert!(!has(&job, "shallower_last_pass"));
    job.as_object_mut().unwrap().remove("passes");
    for (feed, is_advised) in [(1.5e-4_f64, true), (1.4e-4, false)] {
        job["cut"]["feed_mm_per_rev"] = json!(feed);
        // A material of which so thin a chip asks for the same force.
        job["force"]["passive"]["coefficient"] = json!(1500.0 * (0.2 / feed).powf(0.6));
        assert_eq!(has(&job, "lower_feed"), is_advised, "{feed}");
    }
}
