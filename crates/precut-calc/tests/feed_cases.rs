//! Jobs from use, each with what is right, worked out independently.
#![allow(clippy::unwrap_used, clippy::panic, missing_docs)]

use crate::feed_support::{conflict, job, near, solve, solved};
use precut_calc::calculator::{Answer, Block, Calculator, ElasticScope, Failure, Unwatched};
use precut_calc::feed_schedule::{ChangePlace, FeedSchedule, Outcome, Price, PriceBasis};
use serde_json::{Value, json};

fn case(name: &str) -> Value {
    let path = format!("{}/tests/cases/feed-schedule/{name}.json", concat!(env!("CARGO_MANIFEST_DIR"), "/.."));
    serde_json::from_str(&std::fs::read_to_string(&path).unwrap_or_else(|e| panic!("{path}: {e}"))).unwrap()
}

fn answer(value: Value) -> Answer<Outcome> {
    FeedSchedule::run(&job(value), &Unwatched).unwrap_or_else(|failure| panic!("{failure:?}"))
}

fn codes(answer: &Answer<Outcome>) -> (Vec<&str>, Vec<&str>) {
    (
        answer.warnings.iter().map(|warning| warning.code).collect(),
        answer.explanation.iter().map(|message| message.code).collect(),
    )
}

fn price<'o>(outcome: &'o Outcome, pointer: &str) -> Option<&'o Price> {
    outcome.prices.iter().find(|price| price.pointer == pointer)
}

/// Three surfaces, a fresh edge for each: the edges paid are three whatever is cut, so least time is least cost.
#[test]
fn fresh_edge_per_surface() {
    let given = case("fresh-edge-per-surface");
    let shares = answer(given.clone());
    near("shares", shares.output.objective, 154.09, 0.0, 0.005);
    near("whole", shares.output.whole_edge_objective.unwrap(), 163.69, 0.0, 0.005);
    assert_eq!(shares.output.edges_per_part, Some(3.0));
    let (warnings, said) = codes(&shares);
    assert!(warnings.contains(&"shares_of_edges_priced"), "{warnings:?}");
    assert!(said.contains(&"optimum_of_shares") && !said.contains(&"optimum_within"), "{said:?}");
    let mut whole = given;
    whole["limits"]["whole_edges"] = json!(true);
    let whole = answer(whole);
    near("whole edges", whole.output.objective, 156.19, 0.0, 0.005);
    assert!(!codes(&whole).0.contains(&"shares_of_edges_priced"));
    assert!(codes(&whole).1.contains(&"whole_edges_within"));
}

#[test]
fn three_edges_are_counted_and_two_are_found() {
    let given = case("three-edges-no-stop");
    let shares = solved(given.clone());
    near("shares", shares.objective, 33.89, 0.0, 0.005);
    near("whole", shares.whole_edge_objective.unwrap(), 41.79, 0.0, 0.005);
    assert_eq!((shares.edges.len(), shares.edges_per_part), (3, Some(3.0)));
    let mut whole = given;
    whole["limits"]["whole_edges"] = json!(true);
    let whole = solved(whole);
    near("whole edges", whole.objective, 34.876, 0.0, 0.001);
    near("bound", whole.certificate.lower_bound.unwrap(), whole.objective, 1e-6, 0.0);
    assert_eq!(whole.edges_per_part, Some(2.0));
    let change = &whole.tool_changes[0];
    let mut between = [change.after_zone.as_str(), change.before_zone.as_str()];
    between.sort_unstable();
    assert_eq!((change.place, between), (ChangePlace::BetweenZones, ["end", "mid"]));
    near("where", change.z_mm, 750.0, 0.0, 1e-9);
}

/// With two edges for every part a batch changes nothing; of a part that an edge serves several times the last edge of the
/// batch is paid whole, and the words and the program count it.
#[test]
fn a_batch_pays_and_tells_its_edges() {
    let mut two = case("three-edges-no-stop");
    two["limits"]["whole_edges"] = json!(true);
    two["limits"]["batch_parts"] = json!(7);
    let two = solved(two);
    near("whole edges", two.objective, 34.876, 0.0, 0.001);
    assert_eq!((two.edges.len(), two.edges_per_part), (2, Some(2.0)));

    let mut given = case("three-edges-no-stop");
    given["limits"]["whole_edges"] = json!(true);
    let life = given["models"]["tool_life"]["constant"].as_f64().unwrap();
    given["models"]["tool_life"]["constant"] = json!(life + 100.0_f64.ln());
    let without_end = solved(given.clone());
    let many = without_end.tool_changes.last().unwrap().every_parts;
    assert!(many > 2, "{many}");
    given["limits"]["batch_parts"] = json!(many + 1);
    let batch = answer(given.clone());
    let every = batch.output.tool_changes.last().unwrap().every_parts;
    let edges = f64::from((many + 1).div_ceil(every));
    near("edges", batch.output.edges_per_part.unwrap(), edges / f64::from(many + 1), 1e-12, 0.0);
    assert!(batch.output.objective > without_end.objective);
    let said = batch.explanation.iter().find(|message| message.code == "batch_edges").unwrap();
    let said = serde_json::to_value(&said.values).unwrap();
    for (name, expected) in [("parts", f64::from(many + 1)), ("edges", edges), ("every", f64::from(every))] {
        near(name, said[name].as_f64().unwrap(), expected, 1e-12, 0.0);
    }
    if every > 1 {
        let program = FeedSchedule::program(&job(given), &batch.output).unwrap().unwrap();
        let told = format!("after every {every} parts, {edges} edges for {} parts", many + 1);
        let is_told = |block: &Block| matches!(block, Block::Note(note) if note.contains(&told));
        assert!(program.blocks.iter().any(is_told), "{told}");
    }
}

#[test]
fn edges_that_are_needed_are_counted() {
    let outcome = solved(case("edges-6-said-27-needed"));
    let usage = outcome.tool_usage.unwrap();
    assert!(usage > 26.0, "{usage}");
    assert_eq!(outcome.edges.len(), 27);
    assert!(outcome.edges.iter().all(|edge| edge.tool_usage <= 1.0 + 1e-6));
    let used: f64 = outcome.edges.iter().map(|edge| edge.tool_usage).sum();
    near("used", used, usage, 1e-9, 0.0);
    assert_eq!(outcome.tool_changes.len(), 27);
}

/// One motor stands in thirteen rows, and costs most of all.
#[test]
fn one_knob_over_many_rows_has_one_price() {
    let outcome = solved(case("price-ranking"));
    let first = &outcome.prices[0];
    assert_eq!(first.pointer, "/machine/power_kw");
    near("power", first.gain_percent.unwrap(), 0.893, 0.0, 0.0005);
}

/// One spindle speed for six zones: the price of the speed limit is one, and none of its six rows alone buys anything.
#[test]
fn one_speed_for_all_zones_has_one_price() {
    let outcome = solved(case("constant-rpm-price"));
    let first = &outcome.prices[0];
    assert_eq!(first.pointer, "/limits/speed_max_m_per_min");
    near("speed", first.gain_percent.unwrap(), 1.124, 0.0, 0.0015);
    let rows = outcome.binding.iter().filter(|row| row.constraint == "speed_max");
    assert_eq!(rows.clone().count(), 6);
    assert!(rows.clone().all(|row| row.degenerate));
}

#[test]
fn a_scatter_that_is_given_is_told() {
    let told = answer(case("scatter-ignored"));
    let share = |at: &str| {
        let warning = told.warnings.iter().find(|warning| warning.code == "half_fail" && warning.pointer.contains(at));
        serde_json::to_value(&warning.unwrap().values).unwrap()["share"].as_f64().unwrap()
    };
    near("roughness", share("roughness"), 0.5, 0.0, 1e-4);
    assert!((0.4..0.5).contains(&share("tool_life")), "{}", share("tool_life"));
    // Without a scatter, or with the limit far enough away, nothing is said.
    let mut quiet = case("scatter-ignored");
    quiet["models"]["roughness"].as_object_mut().unwrap().remove("residual_scatter");
    quiet["models"]["tool_life"].as_object_mut().unwrap().remove("residual_scatter");
    assert!(!codes(&answer(quiet)).0.contains(&"half_fail"));
    let mut far = case("scatter-ignored");
    far["limits"]["feed_max_mm_per_rev"] = json!(0.06);
    far["models"]["tool_life"].as_object_mut().unwrap().remove("residual_scatter");
    assert!(!codes(&answer(far)).0.contains(&"half_fail"));
}

/// What binds is the whole part per edge, and the hardening with it: even with four edges per part three zones harden too
/// much. Doing all that is told has an answer, and no edge that may be used further stands in for the whole part.
#[test]
fn a_whole_part_that_no_edge_serves_is_named() {
    let given = case("whole-parts-conflict");
    let found = conflict(given.clone());
    assert!(found.conflict_set.iter().any(|member| member.constraint == "whole_parts_per_edge"), "{found:?}");
    assert!(found.conflict_set.iter().all(|member| member.constraint != "tool_usage"), "{found:?}");
    let first = &found.relaxations[0];
    assert_eq!(first.constraint, "whole_parts_per_edge");
    near("parts", first.factor, 1.1356, 0.0, 1e-4);
    let of = |taken: &mut Value, without: &str| {
        for relaxation in found.relaxations.iter().filter(|given| given.constraint != without) {
            let more = relaxation.factor * 1.001;
            if relaxation.constraint == "whole_parts_per_edge" {
                // One part takes so many edges.
                taken["limits"]["whole_parts_per_edge"] = json!(false);
                taken["limits"]["tool_usage_max"] = json!(more);
                continue;
            }
            assert_eq!(relaxation.constraint, "hardening");
            let zones = taken["zones"].as_array_mut().unwrap();
            let zone = zones.iter_mut().find(|zone| zone["id"] == relaxation.zone.as_str()).unwrap();
            zone["hardening_max_percent"] = json!(zone["hardening_max_percent"].as_f64().unwrap() * more);
        }
    };
    let mut taken = given.clone();
    of(&mut taken, "");
    solved(taken);
    // The hardening alone is not enough, nor is the usage alone: not even with all the edges that were allowed.
    for without in ["whole_parts_per_edge", "hardening"] {
        let mut taken = given.clone();
        of(&mut taken, without);
        conflict(taken);
    }
    let mut all = given;
    all["limits"]["whole_parts_per_edge"] = json!(false);
    conflict(all);
}

/// A whole number of parts has no price; the usage that it asks for is no knob.
#[test]
fn a_whole_number_has_a_neighbour_and_no_price() {
    let given = case("whole-parts-price");
    let outcome = solved(given.clone());
    assert!(price(&outcome, "/limits/tool_usage_max").is_none());
    let whole = price(&outcome, "/limits/whole_parts_per_edge").unwrap();
    assert_eq!((whole.gain_percent, whole.basis), (None, PriceBasis::Whole));
    let mut looser = given;
    looser["limits"]["tool_usage_max"] = json!(looser["limits"]["tool_usage_max"].as_f64().unwrap() * 1.01);
    near("one percent more", solved(looser).objective, outcome.objective, 1e-9, 0.0);
}

#[test]
fn a_thin_room_is_found() {
    for slack in [1.0, 1.0 + 1e-5] {
        let mut given = case("thin-feasible-1e-05");
        given["limits"]["tool_usage_max"] = json!(given["limits"]["tool_usage_max"].as_f64().unwrap() * slack);
        assert!(solve(given).is_ok());
    }
}

#[test]
fn requirements_alone_are_enough() {
    let found = conflict(case("elastic-scope"));
    assert_eq!(found.elastic_scope, ElasticScope::Requirements);
    assert!(!found.relaxations.is_empty());
}

#[test]
fn a_conflict_of_four_hundred_zones_is_named() {
    match solve(case("slow-conflict-400")) {
        Err(Failure::Conflicting(found)) => assert!(!found.infeasible.conflict_set.is_empty()),
        other => panic!("{other:?}"),
    }
}
