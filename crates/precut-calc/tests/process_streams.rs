//! Streams of parts with a known truth: what is said of them, and when (`reference/process`).
#![allow(clippy::unwrap_used, clippy::panic, missing_docs)]

use crate::process_support::{process, stream};
use precut_calc::calculator::Unwatched;
use precut_calc::deflection_compensation::DeflectionCompensation;
use precut_calc::process::{Change, Situation, State, Watch, faults};
use serde_json::Value;

fn replayed(stream: &Value) -> Vec<State> {
    let (document, parts) = process(stream);
    assert_eq!(faults::<DeflectionCompensation>(&document, &parts), Vec::new());
    Watch::<DeflectionCompensation>::replay(document, &parts, &Unwatched).unwrap().1
}

fn kinds(change: &Change) -> Vec<&str> {
    change.causes.iter().map(|cause| cause.kind.as_str()).collect()
}

fn within(value: u32, range: &Value) -> bool {
    let end = |k: usize| range[k].as_u64().unwrap();
    (end(0)..=end(1)).contains(&u64::from(value))
}

/// As the README of the streams demands.
fn holds(name: &str) {
    let stream = stream(name);
    let states = replayed(&stream);
    let last = states.last().unwrap();
    let expected = &stream["expected"];
    let changes = expected["changes"].as_array().unwrap();
    let said: Vec<_> =
        last.changes.iter().map(|change| (change.reported_at_part, change.since_part, kinds(change))).collect();
    assert_eq!(last.changes.len(), changes.len(), "{name}: {said:?}");
    for (change, expected) in last.changes.iter().zip(changes) {
        assert!(within(change.reported_at_part, &expected["reported_between_parts"]), "{name}: {said:?}");
        assert!(within(change.since_part, &expected["since_between_parts"]), "{name}: {said:?}");
        let judged_after = expected["judged_after_part"].as_u64().unwrap_or(0);
        let listed = |change: &Change, field: &str| {
            expected[field].as_array().into_iter().flatten().any(|kind| kinds(change).contains(&kind.as_str().unwrap()))
        };
        // From three parts after the report on.
        for state in states.iter().filter(|state| state.number >= change.reported_at_part + 3) {
            let now = state.changes.iter().find(|own| own.id == change.id).unwrap();
            let (number, list) = (state.number, kinds(now));
            if u64::from(number) > judged_after {
                assert!(listed(now, "cause_in_95_list"), "{name} after {number}: {list:?}");
                assert!(!listed(now, "cause_not_in_95_list"), "{name} after {number}: {list:?}");
            }
            assert!(
                expected.get("gauge_offset_in_95_list").is_none() || list.contains(&"gauge_offset"),
                "{name}: {list:?}"
            );
        }
    }
    let odd: Vec<u64> = last.odd_parts.iter().map(|odd| u64::from(odd.number)).collect();
    let bad: Vec<u64> = expected["single_bad_parts"].as_array().unwrap().iter().map(|n| n.as_u64().unwrap()).collect();
    assert_eq!(odd, bad, "{name}");
    assert_eq!(serde_json::to_value(last.state).unwrap(), expected["final_state"], "{name}");
    assert_eq!(states[0].state, Situation::Learning);
}

macro_rules! streams {
    ($($test:ident: $name:literal),* $(,)?) => { $(#[test] fn $test() { holds($name); })* };
}

streams! {
    a_softer_tailstock: "r01-tailstock-softer.json",
    a_softer_headstock: "r02-headstock-softer.json",
    a_softer_carriage_with_two_types: "r03-carriage-two-part-types.json",
    a_moved_tailstock: "r04-tailstock-moved.json",
    edges_that_wear_faster: "r05-edges-wear-faster.json",
    a_machine_that_warms_more: "r06-warms-more.json",
    a_harder_batch: "r07-harder-batch.json",
    a_moved_gauge: "r08-gauge-moved.json",
    a_distorting_clamp: "r09-clamp-distortion.json",
    nothing_in_300_parts: "r10-nothing-300.json",
    one_bad_part: "r11-one-bad-part.json",
    a_moved_gauge_and_a_master: "r12-gauge-moved-master-says-so.json",
    a_gauge_that_a_master_clears: "r13-master-says-gauge-is-right.json",
}
