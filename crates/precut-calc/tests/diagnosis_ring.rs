//! The diagnosis of rings: the open case of the reference, whose hidden cause is known.
#![allow(clippy::unwrap_used, clippy::panic, clippy::print_stdout, missing_docs)]

use precut_calc::calculator::{Answer, Calculator, Check, Unwatched, Violations};
use precut_calc::diagnosis::{Diagnosis, DiagnosisResult, VerdictClass};
use precut_calc::effects::RingEffect;
use precut_calc::ring_roundness::{RingRoundness, RingRun};
use serde_json::{Value, json};

type Rings = Diagnosis<RingRoundness>;

fn answered(job: &Value) -> Answer<DiagnosisResult<RingEffect, RingRun>> {
    let mut job: <Rings as Calculator>::Input = serde_json::from_value(job.clone()).unwrap();
    let mut violations = Violations::default();
    job.check(&mut violations);
    assert_eq!(violations.into_vec(), []);
    Rings::fill(&mut job);
    Rings::run(&job, &Unwatched).unwrap()
}

#[test]
fn probe() {
    let mut job: Value = serde_json::from_str(&std::fs::read_to_string("/tmp/diagnosis_roller_ref.json").unwrap()).unwrap();
    job["options"] = json!({ "held_out": std::env::var("HELD").is_ok() });
    let start = std::time::Instant::now();
    let answer = answered(&job);
    println!("{:?}", start.elapsed());
    let r = &answer.output;
    println!("{:?} none {} unnamed {}", r.verdict, r.none_probability, r.unnamed_probability);
    println!("{}", serde_json::to_string(&r.effects).unwrap());
    println!("{}", serde_json::to_string(&r.noise).unwrap());
    for s in r.sets.iter().take(6) {
        println!("{:.3e} {} {:?}", s.posterior, s.with_remainder, s.causes.iter().map(|c| (c.kind.clone(), c.label.clone(), c.parameters.iter().map(|p| (p.value, p.standard_deviation)).collect::<Vec<_>>())).collect::<Vec<_>>());
    }
    println!("{}", serde_json::to_string(&r.gain).unwrap());
    println!("{}", serde_json::to_string(&r.next_measurement).unwrap());
    println!("{}", serde_json::to_string(&r.tests).unwrap());
    println!("{}", serde_json::to_string(&r.not_applicable).unwrap());
    println!("{}", serde_json::to_string(&r.twins).unwrap());
    let _ = VerdictClass::Named;
}
