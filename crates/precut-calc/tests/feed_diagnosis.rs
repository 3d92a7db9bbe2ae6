//! The diagnosis of machinability models: open cases whose hidden cause is known, measured tables, and what the
//! calculator brings to a diagnosis.
#![allow(clippy::unwrap_used, clippy::panic, clippy::print_stdout, missing_docs)]

use precut_calc::calculator::{Answer, Calculator, Check, Failure, Unwatched, Violations};
use precut_calc::diagnosis::{Diagnosis, DiagnosisResult, VerdictClass};
use precut_calc::effects::MachinabilityEffect;
use precut_calc::feed_schedule::{FeedSchedule, MachinabilityRun};
use serde_json::{Value, json};

type Cuts = Diagnosis<FeedSchedule>;
type Result_ = DiagnosisResult<MachinabilityEffect, MachinabilityRun>;

fn answered(job: &Value) -> Result<Answer<Result_>, Failure> {
    let mut job: <Cuts as Calculator>::Input = serde_json::from_value(job.clone()).unwrap();
    let mut violations = Violations::default();
    job.check(&mut violations);
    assert_eq!(violations.into_vec(), []);
    Cuts::fill(&mut job);
    Cuts::run(&job, &Unwatched)
}

fn talk(name: &str, result: &Result_) {
    println!(
        "{name}: {:?}, none {:.2e}, unnamed {:.2e}, scatter {:.4} ({})",
        result.verdict,
        result.none_probability,
        result.unnamed_probability,
        result.noise.standard_deviation,
        result.noise.source
    );
    for set in result.sets.iter().take(5) {
        let each = set.causes.iter().map(|cause| {
            let values: Vec<String> = cause.parameters.iter().map(|p| format!("{:.4}", p.value)).collect();
            format!("{} {} [{}]", cause.kind, cause.label, values.join(" "))
        });
        let rest = if set.with_remainder { "+ rest" } else { "" };
        println!("  {:.3e} {} {rest}", set.posterior, each.collect::<Vec<_>>().join(" + "));
    }
    if let Some(gain) = &result.gain {
        println!("  held back: {:.4} -> {:.4}, ceiling {:.4}", gain.rmse_base, gain.rmse_extended, gain.noise_ceiling);
    }
}

/// A short job of the reference in the terms of the contract.
fn open_case(name: &str) -> (Value, Value) {
    let path = std::path::Path::new(env!("CARGO_MANIFEST_DIR"))
        .join(format!("tests/reference/diagnosis/example-machinability-{name}.json"));
    let case: Value = serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap();
    let short = &case["job"]["model"];
    let number = |name: &str| short[name].as_f64().unwrap();
    let at = |name: &str| short["reference"][name].as_f64().unwrap().ln();
    let constant = number("ln_value_at_reference")
        - number("speed_exponent") * at("speed_m_per_min")
        - number("feed_exponent") * at("feed_mm_per_rev")
        - number("depth_exponent") * at("depth_mm");
    let (output, quantity) = match case["job"]["response"].as_str().unwrap() {
        "Ra" => ("roughness", "roughness_um"),
        "F" => ("force_z", "force_z_n"),
        other => panic!("{other}"),
    };
    let rows: Vec<Value> = case["measurements"]
        .as_array()
        .unwrap()
        .iter()
        .map(|row| {
            let mut row = row.clone();
            let fields = row.as_object_mut().unwrap();
            let value = fields.remove("value").unwrap();
            fields.remove("id");
            fields.insert(quantity.to_owned(), value);
            row
        })
        .collect();
    let model = json!({
        "form": "log_log", "constant": constant, "speed_exponent": short["speed_exponent"],
        "feed_exponent": short["feed_exponent"], "depth_exponent": short["depth_exponent"]
    });
    let request = json!({
        "calculator": "feed-schedule",
        "job": { "models": { output: model }, "reference": short["reference"] },
        "runs": [{ "nose_radius_mm": case["job"]["nose_radius_mm"] }],
        "quantity": quantity,
        "measurements": rows
    });
    (request, case["answer"].clone())
}

#[test]
fn an_open_case_with_nothing_hidden_is_adequate() {
    let (request, _) = open_case("adequate");
    let result = answered(&request).unwrap().output;
    talk("adequate", &result);
    assert_eq!(result.verdict, VerdictClass::Adequate);
    // Nothing is chosen in most folds: the gain is about 0, and no loss beyond chance.
    assert!(result.gain.unwrap().gain > -0.05);
}

#[test]
fn an_open_case_with_a_built_up_edge_is_named_with_its_size() {
    let (request, truth) = open_case("built_up_edge");
    let result = answered(&request).unwrap().output;
    talk("built-up edge", &result);
    assert_eq!(result.verdict, VerdictClass::Named);
    assert_eq!(result.named.iter().map(|cause| cause.kind.as_str()).collect::<Vec<_>>(), ["built_up_edge"]);
    let hidden = &truth["effects"][0]["params"];
    for parameter in &result.named[0].parameters {
        let [low, high] = parameter.interval_95.unwrap();
        let value = hidden[&parameter.name].as_f64().unwrap();
        assert!((low..=high).contains(&value), "{} {value} not in {low} .. {high}", parameter.name);
    }
}

#[test]
fn an_open_case_with_a_chatter_island_is_unknown() {
    let (request, _) = open_case("chatter_island");
    let result = answered(&request).unwrap().output;
    talk("chatter island", &result);
    assert_eq!(result.verdict, VerdictClass::Unknown);
    assert_eq!(result.remainder.unwrap().kind, "speed_and_depth");
}
