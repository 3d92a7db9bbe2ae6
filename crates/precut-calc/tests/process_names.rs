//! What a second type of part tells of a cause, and what one odd part is taken for.
#![allow(clippy::unwrap_used, clippy::panic, missing_docs)]

use crate::process_support::series::{Hidden, Recipe, Series};
use crate::process_support::{draws, first_seed, replay};
use precut_calc::calculator::Unwatched;
use precut_calc::deflection_compensation::DeflectionCompensation;
use precut_calc::process::{Change, ChangeVerdict, Watch};
use rayon::prelude::*;

/// The change comes with this part; so many parts after its report it is judged.
const CHANGED: u32 = 41;
const AFTER: u32 = 10;
/// The odd part, and how many come in all.
const ODD: u32 = 45;
const COUNT: u32 = 60;
/// A series whose first alarm was chance says nothing of the change: it is drawn anew.
const ANEW: u64 = 20;

/// The change of one draw, so many parts after its report; nothing where chance alarms before.
fn change_of(hidden: Hidden, delta: f64, seed: u64) -> Option<Change> {
    let change = Some((hidden, delta, CHANGED));
    let recipe = Recipe { count: CHANGED + 60, change, lives: hidden.lives(), two_types: true, tails: false };
    let Series { document, parts, .. } = Series::of(&recipe, seed);
    let mut watch = Watch::<DeflectionCompensation>::new(document);
    let mut said = None;
    for part in &parts {
        said = watch.take(part, &Unwatched).unwrap().changes.first().cloned();
        if said.as_ref().is_some_and(|change| part.number >= change.reported_at_part + AFTER) {
            break;
        }
    }
    said.filter(|change| change.reported_at_part >= CHANGED)
}

/// `PRECUT_PROCESS_NAMES=34` draws the figures of the documentation anew.
#[test]
fn a_second_type_of_part_names_the_cause() {
    let (count, is_measured) = draws("PRECUT_PROCESS_NAMES", 1);
    let first = first_seed();
    let deltas: &[f64] = if is_measured { &[3.0, 5.0] } else { &[5.0] };
    let hidden = [Hidden::Tailstock, Hidden::TailstockOffset, Hidden::Carriage, Hidden::Force, Hidden::Gauge];
    for &delta in deltas {
        let cases: Vec<(Hidden, u64)> =
            hidden.into_iter().flat_map(|own| (0..count).map(move |draw| (own, draw))).collect();
        let of = |&(own, draw): &(Hidden, u64)| {
            let seed = |again: u64| first + 50_000_000 + again * 100_000 + draw * 100 + own as u64;
            (own, (0..ANEW).find_map(|again| change_of(own, delta, seed(again))).unwrap())
        };
        let all: Vec<(Hidden, Change)> = cases.par_iter().map(of).collect();
        // A level that moved is one name, be it that of the part or of the gauge: only a master tells them apart.
        let leads = |(own, change): &&(Hidden, Change)| {
            let kind = change.causes[0].kind.as_str();
            kind == own.kind() || *own == Hidden::Gauge && kind == "size_offset"
        };
        let right = all.iter().filter(leads).count();
        let named: Vec<_> = all.iter().filter(|(_, change)| change.verdict == ChangeVerdict::Named).collect();
        let wrong = named.iter().filter(|own| !leads(own)).count();
        if is_measured {
            eprintln!(
                "two types, {delta}: {right} of {} lead, named {}, of these wrong {wrong}",
                all.len(),
                named.len()
            );
        } else {
            assert!(right == all.len() && wrong == 0, "{all:?}");
        }
    }
}

/// `PRECUT_PROCESS_NAMES=34` draws the figures of the documentation anew.
#[test]
fn one_odd_part_is_no_change() {
    let (count, is_measured) = draws("PRECUT_PROCESS_NAMES", 1);
    let first = first_seed();
    let recipe = Recipe { count: COUNT, change: None, lives: false, two_types: false, tails: false };
    // A gauge that slipped is off alike all along the part, a bad blank in three half waves.
    for (name, size_um, is_level) in [
        ("gauge", 6.0, true),
        ("gauge", 30.0, true),
        ("gauge", -200.0, true),
        ("blank", 6.0, false),
        ("blank", 30.0, false),
    ] {
        let of = |draw: u64| {
            let mut series = Series::of(&recipe, first + 60_000_000 + draw);
            let place = ODD as usize - 1;
            for (row, share) in series.parts[place].measurements.iter_mut().zip(&series.share[place]) {
                let shape = if is_level { 1.0 } else { (3.0 * std::f64::consts::PI * share).sin() };
                row.diameter_deviation_um = row.diameter_deviation_um.map(|um| um + size_um * shape);
            }
            let (_, states) = replay(&series.document, &series.parts);
            let last = states.last().unwrap();
            // An alarm before it is chance.
            let from_it = last.changes.iter().filter(|change| (ODD..ODD + 3).contains(&change.reported_at_part));
            (from_it.count(), usize::from(last.odd_parts.iter().any(|odd| odd.number == ODD)))
        };
        let all: Vec<(usize, usize)> = (0..count).into_par_iter().map(of).collect();
        let (alarms, taken_out) = all.iter().fold((0, 0), |sum, own| (sum.0 + own.0, sum.1 + own.1));
        if is_measured {
            eprintln!("{name} off by {size_um} um: taken out {taken_out} of {count}, called a change {alarms}");
        } else {
            assert!(alarms == 0 && (size_um.abs() < 10.0 || taken_out == all.len()), "{name} {size_um}: {all:?}");
        }
    }
}
