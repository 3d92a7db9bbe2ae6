//! A process under watch that goes on from what was kept of it.
#![allow(clippy::unwrap_used, missing_docs)]

use crate::process_support::{Document, Part, Shop, process, stream};
use precut_calc::calculator::Unwatched;
use precut_calc::deflection_compensation::DeflectionCompensation;
use precut_calc::effects::DeflectionEffect;
use precut_calc::process::{Snapshot, State, Watch};
use serde_json::{Value, json};

/// Wear with changed edges, two types, warmth, an odd part, changes that joined, readings of a master, and more parts than are
/// remembered.
const STREAMS: [&str; 5] = [
    "r03-carriage-two-part-types.json",
    "r05-edges-wear-faster.json",
    "r10-nothing-300.json",
    "r11-one-bad-part.json",
    "r12-gauge-moved-master-says-so.json",
];

type Watched = Watch<DeflectionCompensation>;

/// Everything that is said after some more parts, and at last.
fn goes_on(mut watch: Watched, parts: &[Part]) -> (Vec<State>, Value) {
    let states = parts.iter().map(|part| watch.take(part, &Unwatched).unwrap()).collect();
    let outlook = watch.outlook(&Unwatched).unwrap();
    let gain = watch.gain(&Unwatched).unwrap();
    (states, json!([outlook, gain.0, gain.1]))
}

/// The process that was kept, read again beside no more parts than it asks for.
fn read_again(document: &Document, kept: &str, parts: &[Part]) -> Watched {
    let snapshot: Snapshot = serde_json::from_str(kept).unwrap();
    let first = snapshot.first_part().unwrap_or(0);
    let needed: Vec<Part> = parts.iter().filter(|part| part.number >= first).cloned().collect();
    assert!(needed.len() <= 161, "{}", needed.len());
    Watch::from_snapshot(document.clone(), snapshot, &needed, &Unwatched).unwrap()
}

fn is_the_same(name: &str, document: &Document, parts: &[Part], places: &[usize]) {
    let mut watch = Watched::new(document.clone());
    for (taken, part) in parts.iter().enumerate() {
        if places.contains(&taken) {
            let kept = serde_json::to_string(&watch.snapshot()).unwrap();
            assert!(kept.len() < 1_000_000, "{name} after {taken}: {} bytes", kept.len());
            let again = read_again(document, &kept, &parts[..taken]);
            assert_eq!(serde_json::to_string(&again.snapshot()).unwrap(), kept, "{name} after {taken}");
            let rest = &parts[taken..parts.len().min(taken + 25)];
            let (said, last) = goes_on(watch.copy(), rest);
            let (said_again, last_again) = goes_on(again, rest);
            assert_eq!(said_again, said, "{name} after {taken}");
            assert_eq!(last_again, last, "{name} after {taken}");
        }
        watch.take(part, &Unwatched).unwrap();
    }
}

#[test]
fn a_process_goes_on_from_what_was_kept_to_the_last_digit() {
    for name in STREAMS {
        let (document, parts) = process(&stream(name));
        is_the_same(name, &document, &parts, &[10, parts.len() / 2, parts.len() - 10]);
    }
}

#[test]
fn a_process_on_paths_of_its_own_keeps_its_account() {
    let mut shop = Shop::new(5);
    let softer = DeflectionEffect::TailstockCompliance { delta_um_per_n: 0.012 };
    let mut parts = shop.cut(1..=200, |number| if number < 26 { Vec::new() } else { vec![softer.clone()] });
    let path = json!([{ "z_mm": 0.0, "diameter_mm": 39.99 }, { "z_mm": 560.0, "diameter_mm": 39.996 }]);
    for part in parts.iter_mut().filter(|part| part.number > 20) {
        let mut conditions = json!(part.conditions);
        conditions["commanded_path"] = path.clone();
        part.conditions = serde_json::from_value(conditions).unwrap();
    }
    is_the_same("paths", &shop.document, &parts, &[190]);
}

#[test]
fn what_was_kept_by_another_version_or_of_other_parts_is_not_read() {
    let (document, parts) = process(&stream(STREAMS[0]));
    let mut watch = Watched::new(document.clone());
    parts[..30].iter().for_each(|part| drop(watch.take(part, &Unwatched).unwrap()));
    let kept = json!(watch.snapshot());
    let read = |kept: Value, parts: &[Part]| {
        Watched::from_snapshot(document.clone(), serde_json::from_value(kept).unwrap(), parts, &Unwatched)
    };
    assert!(read(kept.clone(), &parts[..30]).is_ok());
    assert!(read(kept.clone(), &parts[1..30]).is_err(), "the first part is not there");
    for version in ["version", "calculator"] {
        let mut other = kept.clone();
        other[version] = json!(0);
        assert!(read(other, &parts[..30]).is_err(), "{version}");
    }
}
