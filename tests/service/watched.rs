//! A process under watch by the command line: reference streams through the shipped program.

use std::io::Write;
use std::process::{Output, Stdio};

use serde_json::{Value, json};

use crate::stream::process_file;
use crate::support::precut_command;

fn replay(arguments: &[&str], process: &Value) -> Output {
    let mut command = precut_command(&[&["process", "replay"], arguments].concat());
    let mut child = command.stdin(Stdio::piped()).spawn().unwrap();
    child.stdin.take().unwrap().write_all(process.to_string().as_bytes()).unwrap();
    child.wait_with_output().unwrap()
}

fn states(output: &Output) -> Vec<Value> {
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let text = String::from_utf8(output.stdout.clone()).unwrap();
    let lines = text.lines().filter(|line| line.starts_with('{'));
    lines.map(|line| serde_json::from_str(line).unwrap()).collect()
}

#[test]
fn the_tailstock_that_softened_is_named_with_its_part() {
    let states = states(&replay(&[], &process_file("r01-tailstock-softer.json")));
    assert_eq!(states.len(), 70);
    assert_eq!(states[0]["state"], "learning");
    let reported = states.iter().find(|state| state["state"] == "changed").unwrap();
    assert!((37..=43).contains(&reported["number"].as_u64().unwrap()), "{reported}");
    let last = states.last().unwrap();
    let change = &last["changes"][0];
    assert_eq!(change["since_part"], 37);
    assert_eq!(change["causes"][0]["kind"], "tailstock_compliance");
    assert!(last["outlook"]["action"]["text"].as_str().unwrap().ends_with('.'), "{last}");
    assert!(states[..69].iter().all(|state| state.get("outlook").is_none()));
}

#[test]
fn a_moved_gauge_is_looked_at_first_and_a_master_names_it() {
    let mut process = process_file("r12-gauge-moved-master-says-so.json");
    let named = states(&replay(&["--last"], &process));
    assert_eq!(named.len(), 1);
    assert_eq!(named[0]["changes"][0]["causes"][0]["kind"], "gauge_offset");
    process["parts"].as_array_mut().unwrap().truncate(37);
    let before = states(&replay(&["--last"], &process));
    assert_eq!(before[0]["outlook"]["action"]["kind"], "measure_gauge");
    assert_eq!(before[0]["outlook"]["measure_next"][0]["code"], "master_on_gauge");
    let russian = states(&replay(&["--last", "--lang", "ru"], &process));
    let text = russian[0]["outlook"]["action"]["text"].as_str().unwrap();
    assert!(text.contains("эталон"), "{text}");
}

#[test]
fn faults_of_a_process_file_are_told_with_their_places() {
    let mut process = process_file("r01-tailstock-softer.json");
    process["part_types"]["A"]["job"]["cut"]["feed_mm_per_rev"] = json!(-1.0);
    let job_at_fault = replay(&[], &process);
    assert_eq!(job_at_fault.status.code(), Some(2));
    let told: Value = serde_json::from_slice(&job_at_fault.stderr).unwrap();
    assert_eq!(told["errors"][0]["pointer"], "/part_types/A/job/cut/feed_mm_per_rev", "{told}");
    let mut process = process_file("r01-tailstock-softer.json");
    process["parts"][3]["number"] = json!(1);
    process["parts"][4]["part_type"] = json!("C");
    let parts_at_fault = replay(&[], &process);
    assert_eq!(parts_at_fault.status.code(), Some(2));
    let told: Value = serde_json::from_slice(&parts_at_fault.stderr).unwrap();
    let places: Vec<&str> = told["errors"].as_array().unwrap().iter().map(|e| e["pointer"].as_str().unwrap()).collect();
    assert_eq!(places, ["/parts/3/number", "/parts/4/part_type"], "{told}");
    process["calculator"] = json!("ring-clamping");
    let told: Value = serde_json::from_slice(&replay(&[], &process).stderr).unwrap();
    assert_eq!(told["errors"][0]["code"], "calculator_not_watched", "{told}");
}
