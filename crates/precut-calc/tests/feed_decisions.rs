//! What an answer tells a user to do, done over random jobs: edges bought, numbers turned, limits loosened.
//!
//! `PRECUT_DECISIONS` is the number of jobs; 100 in the suite. Jobs, costs and limits are worked out here, not by the
//! product's own path to them.
#![allow(clippy::unwrap_used, clippy::panic, missing_docs)]

use crate::feed_support::{near, solve, solved};
use precut_calc::calculator::{Failure, Infeasible};
use precut_calc::feed_schedule::{ChangePlace, Looser, Outcome, Price, PriceBasis, ZoneOutcome};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64Mcg;
use serde_json::{Value, json};

fn count() -> usize {
    std::env::var("PRECUT_DECISIONS").ok().and_then(|text| text.parse().ok()).unwrap_or(100)
}

struct Dice(Pcg64Mcg);

impl Dice {
    fn of(&mut self, low: f64, high: f64) -> f64 {
        low * (high / low).powf(self.0.random::<f64>())
    }

    fn chance(&mut self, share: f64) -> bool {
        self.0.random::<f64>() < share
    }
}

/// A job of some zones with given compliances: every kind of limit now and then.
fn random(dice: &mut Dice, zones: usize) -> Value {
    let mut at = 0.0;
    let mut list = Vec::new();
    let surfaces = dice.chance(0.5);
    for k in 0..zones {
        let end = at + dice.of(10.0, 200.0);
        let mut zone = json!({ "id": format!("z{k}"), "z_start_mm": at, "z_end_mm": end, "diameter_mm": dice.of(30.0, 120.0),
            "depth_mm": dice.of(0.3, 3.0), "compliance_um_per_n": dice.of(0.01, 0.3) });
        if surfaces {
            zone["surface"] = json!(format!("s{}", k / 2));
        }
        if dice.chance(0.2) {
            zone["repeat"] = json!(2);
        }
        if dice.chance(0.6) {
            zone["deflection_max_um"] = json!(dice.of(8.0, 80.0));
        }
        if dice.chance(0.7) {
            zone["roughness_max_um"] = json!(dice.of(1.2, 6.0));
        }
        if dice.chance(0.1) {
            zone["feed_max_mm_per_rev"] = json!(dice.of(0.12, 0.3));
        }
        list.push(zone);
        at = end + if dice.chance(0.2) { 5.0 } else { 0.0 };
    }
    let mut job = json!({
        "zones": list,
        "models": {
            "force_y": { "constant": 7.0, "speed_exponent": -0.2, "feed_exponent": dice.of(0.5, 0.8), "depth_exponent": 0.9 },
            "force_z": { "constant": 7.6, "speed_exponent": -0.1, "feed_exponent": 0.75, "depth_exponent": 1.0 },
            "tool_life": { "constant": 5.3 + 3.5 * 5.0 - 1.9 - dice.of(0.05, 2.0), "speed_exponent": -3.5, "feed_exponent": -dice.of(0.6, 1.4), "depth_exponent": -0.3 },
            "roughness": { "constant": 3.7, "speed_exponent": -0.05, "feed_exponent": 1.7 }
        },
        "limits": { "feed_min_mm_per_rev": 0.05, "feed_max_mm_per_rev": 0.5, "speed_min_m_per_min": 40.0, "speed_max_m_per_min": 300.0 },
        "machine": {},
        "objective": { "kind": "cost", "machine_rate_per_min": dice.of(0.5, 3.0), "tool_change_time_min": dice.of(0.5, 4.0),
            "edge_cost": dice.of(1.0, 12.0), "fixed_cost": dice.of(0.1, 5.0) },
    });
    if dice.chance(0.3) {
        job["objective"] = json!({ "kind": "time", "tool_change_time_min": dice.of(0.5, 4.0), "fixed_time_min": 1.0 });
    }
    if dice.chance(0.4) {
        job["machine"] = json!({ "power_kw": dice.of(2.0, 12.0), "efficiency": 0.8 });
    }
    if dice.chance(0.3) {
        job["limits"]["feed_step_ratio_max"] = json!(dice.of(1.05, 1.6));
    }
    if dice.chance(0.2) {
        job["limits"]["deflection_spread_ratio_max"] = json!(dice.of(3.0, 12.0));
    }
    if dice.chance(0.2) {
        job["limits"]["tool_life_min_min"] = json!(dice.of(5.0, 20.0));
    }
    if dice.chance(0.4) {
        let speed = if dice.chance(0.5) { "constant_rpm" } else { "constant_speed" };
        job["variables"] = json!({ "speed": speed });
    }
    job
}

/// A part that takes several edges: they are worn so soon, and slower cutting, which saves edges, is out of bounds.
fn needs_several(dice: &mut Dice, job: &mut Value) {
    job["limits"]["speed_min_m_per_min"] = json!(200.0);
    let mut bare = job.clone();
    bare["limits"].as_object_mut().unwrap().remove("whole_edges");
    let Some(used) = solve(bare).ok().and_then(|outcome| outcome.tool_usage) else { return };
    let constant = number(&job["models"]["tool_life"]["constant"]);
    job["models"]["tool_life"]["constant"] = json!(constant + (used / dice.of(1.5, 5.0)).ln());
}

/// Edges that are sooner worn by a factor, in logarithms.
fn wear(dice: &mut Dice, job: &mut Value, most: f64) {
    let constant = number(&job["models"]["tool_life"]["constant"]);
    job["models"]["tool_life"]["constant"] = json!(constant - dice.of(1.0, most));
}

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or(0.0)
}

/// Share of an edge that a zone of the printed plan uses, by the job's tool life alone.
fn usage(job: &Value, outcome: &Outcome, zone: usize) -> f64 {
    let (given, life) = (&outcome.zones[zone], &job["models"]["tool_life"]);
    let of = &job["zones"][zone];
    let minutes = std::f64::consts::PI * given.diameter_mm * (number(&of["z_end_mm"]) - number(&of["z_start_mm"]))
        / 1000.0
        * of["repeat"].as_f64().unwrap_or(1.0)
        / (given.speed_m_per_min * given.feed_mm_per_rev);
    let ln_life = number(&life["constant"])
        + number(&life["speed_exponent"]) * given.speed_m_per_min.ln()
        + number(&life["feed_exponent"]) * given.feed_mm_per_rev.ln()
        + number(&life["depth_exponent"]) * given.depth_mm.ln();
    minutes / ln_life.exp()
}

fn rates(job: &Value) -> (f64, f64, f64) {
    let of = |name: &str| number(&job["objective"][name]);
    if job["objective"]["kind"] == "time" {
        return (1.0, of("tool_change_time_min"), of("fixed_time_min"));
    }
    let minute = of("machine_rate_per_min");
    (minute, minute * of("tool_change_time_min") + of("edge_cost"), of("fixed_cost") + minute * of("fixed_time_min"))
}

/// Cuts the part by the printed plan alone: every edge up to its change, and what the edges and minutes cost.
fn cut(job: &Value, outcome: &Outcome) -> f64 {
    let mut edges: Vec<f64> = vec![0.0];
    let mut changes = outcome.tool_changes.iter();
    let mut next = changes.next().unwrap();
    // To the headstock: from the last zone to the first.
    for k in (0..outcome.zones.len()).rev() {
        let (whole, given) = (usage(job, outcome, k), &outcome.zones[k]);
        let repeat = job["zones"][k]["repeat"].as_f64().unwrap_or(1.0);
        let mut done = 0.0;
        while next.place != ChangePlace::BetweenParts && next.before_zone == given.id {
            let along = (given.z_end_mm - next.z_mm) / (given.z_end_mm - given.z_start_mm);
            let share = (f64::from(next.pass - 1) + along) / repeat;
            *edges.last_mut().unwrap() += (share - done) * whole;
            done = share;
            near("told use of the edge", next.tool_usage, *edges.last().unwrap(), 1e-6, 1e-9);
            edges.push(0.0);
            next = changes.next().unwrap();
        }
        *edges.last_mut().unwrap() += (1.0 - done) * whole;
    }
    assert_eq!(next.place, ChangePlace::BetweenParts);
    assert!(changes.next().is_none());
    let parts = f64::from(next.every_parts);
    assert!(parts < 2.0 || edges.len() == 1);
    for used in &edges {
        assert!(used * parts <= 1.0 + 1e-6, "an edge is used to {} by {parts} parts", used * parts);
    }
    assert_eq!(edges.len(), outcome.edges.len());
    let per_part = edges.len() as f64 * bought(job, next.every_parts);
    near("edges per part", outcome.edges_per_part.unwrap(), per_part, 1e-12, 0.0);
    let (minute, edge, fixed) = rates(job);
    fixed + minute * outcome.cutting_time_min + edge * per_part
}

/// Edges a part where one serves so many: those that the batch buys over its parts.
fn bought(job: &Value, parts: u32) -> f64 {
    let Some(batch) = job["limits"]["batch_parts"].as_u64() else { return 1.0 / f64::from(parts) };
    let (mut edges, mut left) = (0, i64::try_from(batch).unwrap());
    while left > 0 {
        edges += 1;
        left -= i64::from(parts);
    }
    f64::from(edges) / batch as f64
}

#[test]
fn edges_and_cost_are_those_of_the_printed_plan() {
    let mut dice = Dice(Pcg64Mcg::seed_from_u64(71));
    let (mut found, mut several) = (0, 0);
    for round in 0..count() {
        let zones = 1 + round % 7;
        let mut job = random(&mut dice, zones);
        if dice.chance(0.2) {
            job["limits"]["tool_usage_scope"] = json!("surface");
        }
        if dice.chance(0.3) {
            wear(&mut dice, &mut job, 4.0);
        }
        let Ok(outcome) = solve(job.clone()) else { continue };
        found += 1;
        several += usize::from(outcome.edges.len() > 1);
        near("cost in whole edges", outcome.whole_edge_objective.unwrap(), cut(&job, &outcome), 1e-7, 0.0);
        // Shares never cost more than wholes where one edge may cut on over the part's end.
        if job["limits"].get("tool_usage_scope").is_none() {
            assert!(outcome.objective <= outcome.whole_edge_objective.unwrap() * (1.0 + 1e-7));
        }
    }
    assert!(found > count() / 2 && several > count() / 20, "{found} {several}");
}

/// All ways to lay borders between units, and all numbers of parts per edge, solved one by one.
fn best_by_hand(job: &Value, units: &[Vec<usize>]) -> f64 {
    let (_, per_edge, _) = rates(job);
    let mut bare = job.clone();
    for field in ["whole_edges", "batch_parts"] {
        bare["limits"].as_object_mut().unwrap().remove(field);
    }
    bare["objective"]["tool_change_time_min"] = json!(0.0);
    if bare["objective"]["kind"] == "cost" {
        bare["objective"]["edge_cost"] = json!(0.0);
    }
    let mut best = f64::INFINITY;
    for mask in 0..(1_u32 << (units.len() - 1)) {
        let mut blocks = bare.clone();
        let mut block = 0;
        for (k, unit) in units.iter().enumerate() {
            block += usize::from(k > 0 && mask & (1 << (k - 1)) != 0);
            for &zone in unit {
                blocks["zones"][zone]["surface"] = json!(format!("b{block}"));
            }
        }
        blocks["limits"]["tool_usage_scope"] = json!("surface");
        blocks["limits"]["tool_usage_max"] = json!(1.0);
        if let Ok(outcome) = solve(blocks) {
            best = best.min(outcome.objective + per_edge * (block + 1) as f64);
        }
    }
    for parts in 2..=job["limits"]["batch_parts"].as_u64().map_or(2000, |batch| u32::try_from(batch).unwrap()) {
        let mut several = bare.clone();
        several["limits"]["tool_usage_max"] = json!(1.0 / f64::from(parts));
        let Ok(outcome) = solve(several) else { break };
        // More parts per edge never take less time: from here on nothing comes below the best.
        if outcome.objective >= best {
            break;
        }
        best = best.min(outcome.objective + per_edge * bought(job, parts));
    }
    best
}

#[test]
fn whole_edges_against_every_plan() {
    let mut dice = Dice(Pcg64Mcg::seed_from_u64(72));
    let (mut found, mut several) = (0, 0);
    for round in 0..count() / 2 {
        let mut job = random(&mut dice, 2 + round % 5);
        job["limits"]["whole_edges"] = json!(true);
        if dice.chance(0.7) {
            needs_several(&mut dice, &mut job);
        }
        let zones = job["zones"].as_array().unwrap().len();
        let mut units: Vec<Vec<usize>> = Vec::new();
        for k in 0..zones {
            let surface = |k: usize| job["zones"][k].get("surface");
            match units.last_mut() {
                Some(unit) if surface(k).is_some() && surface(k) == surface(unit[0]) => unit.push(k),
                _ => units.push(vec![k]),
            }
        }
        let best = best_by_hand(&job, &units);
        match solve(job.clone()) {
            Ok(outcome) => {
                found += 1;
                several += usize::from(outcome.edges.len() > 1);
                near("printed", outcome.objective, cut(&job, &outcome), 1e-7, 0.0);
                let bound = outcome.certificate.lower_bound.unwrap();
                assert!(bound <= best * (1.0 + 1e-7), "{round}: a plan of {best} lies below the bound {bound}");
                assert!(bound >= outcome.objective * (1.0 - 1e-6), "{round}: {bound} {}", outcome.objective);
                near(&format!("{round}: best of all plans"), outcome.objective, best, 1e-6, 0.0);
                assert!(outcome.edges.iter().all(|edge| edge.tool_usage <= 1.0 + 1e-6));
            }
            Err(Failure::Conflicting(_)) => assert!(best.is_infinite(), "{round}: {best} is a plan"),
            Err(other) => panic!("{round}: {other:?}"),
        }
    }
    eprintln!("{found} schedules, {several} with several edges");
    assert!(found >= count() / 10 && several > count() / 20, "{found} {several}");
}

/// The last edge of a batch is paid whole, however few parts it cuts: against every number of parts per edge.
#[test]
fn a_batch_pays_its_last_edge_whole() {
    let mut dice = Dice(Pcg64Mcg::seed_from_u64(76));
    let (mut found, mut several, mut other) = (0, 0, 0);
    for round in 0..count() / 2 {
        let mut job = random(&mut dice, 1 + round % 3);
        job["limits"]["whole_edges"] = json!(true);
        let Ok(free) = solve(job.clone()) else { continue };
        job["limits"]["batch_parts"] = json!(dice.of(1.0, 40.0).round() as u32);
        let units: Vec<Vec<usize>> = if job["zones"][0].get("surface").is_some() {
            let zones = job["zones"].as_array().unwrap().len();
            (0..zones.div_ceil(2)).map(|k| (2 * k..(2 * k + 2).min(zones)).collect()).collect()
        } else {
            (0..job["zones"].as_array().unwrap().len()).map(|k| vec![k]).collect()
        };
        let outcome = solved(job.clone());
        found += 1;
        let every = |outcome: &Outcome| outcome.tool_changes.last().unwrap().every_parts;
        several += usize::from(every(&outcome) > 1);
        other += usize::from(every(&outcome) != every(&free));
        near("printed", outcome.objective, cut(&job, &outcome), 1e-7, 0.0);
        let best = best_by_hand(&job, &units);
        near(&format!("{round}: best of all plans"), outcome.objective, best, 1e-6, 0.0);
        let bound = outcome.certificate.lower_bound.unwrap();
        assert!(bound <= best * (1.0 + 1e-7) && bound >= best * (1.0 - 1e-6), "{round}: {bound} {best}");
        assert!(outcome.objective >= free.objective * (1.0 - 1e-7), "{round}: a batch is never cheaper a part");
    }
    eprintln!("{found} batches, {several} with several parts per edge, {other} with other edges than without end");
    assert!(found > count() / 5 && several > count() / 20 && other > count() / 20, "{found} {several} {other}");
}

/// The objective with a number of the job multiplied.
fn turned(job: &Value, pointer: &str, factor: f64) -> Option<f64> {
    let mut job = job.clone();
    let number = job.pointer_mut(pointer)?;
    *number = json!(number.as_f64()? * factor);
    solve(job).ok().map(|outcome| outcome.objective)
}

/// Step of a number, in logarithms: small enough that a price that itself changes by a fifth per thousandth is met within
/// half a percent.
const STEP: f64 = 1e-5;

/// Percent of the objective for one percent: looser, and tighter where that has an answer.
fn differences(job: &Value, before: f64, pointer: &str, looser: Looser) -> (f64, Option<f64>) {
    differences_over(STEP, job, before, pointer, looser)
}

fn differences_over(step: f64, job: &Value, before: f64, pointer: &str, looser: Looser) -> (f64, Option<f64>) {
    let sign = if looser == Looser::Less { -1.0 } else { 1.0 };
    let at = |by: f64| turned(job, pointer, (sign * by).exp()).map(f64::ln);
    let gain = at(step).map_or(f64::NAN, |after| (before.ln() - after) / step);
    (gain, at(-step).map(|after| (after - before.ln()) / step))
}

fn within(found: f64, expected: f64) -> bool {
    (found - expected).abs() <= (0.01 * expected.abs()).max(2e-4)
}

/// The same over a tenth of the step, where a schedule's own error of 1e-10 counts ten times as much.
fn within_finely(found: f64, expected: f64) -> bool {
    (found - expected).abs() <= (0.01 * expected.abs()).max(5e-4)
}

/// What differences over a step and a tenth of it come to over none: where one number moves another fifty times as far, a
/// price changes by a thousand times the step.
fn extrapolated(long: (f64, Option<f64>), short: (f64, Option<f64>)) -> (f64, Option<f64>) {
    let over_none = |long: f64, short: f64| (10.0 * short - long) / 9.0;
    (over_none(long.0, short.0), long.1.zip(short.1).map(|(long, short)| over_none(long, short)))
}

#[test]
fn a_number_turned_buys_its_price() {
    let mut dice = Dice(Pcg64Mcg::seed_from_u64(73));
    let mut seen = Seen::default();
    for round in 0..count() {
        let job = random(&mut dice, 1 + round % 6);
        let Ok(outcome) = solve(job.clone()) else { continue };
        prices_are_met(round, &job, &outcome, &mut seen);
        // What is not in the list buys nothing.
        let is_listed = |pointer: &str| outcome.prices.iter().any(|price: &Price| price.pointer == pointer);
        for pointer in ["/limits/speed_max_m_per_min", "/limits/feed_max_mm_per_rev", "/machine/power_kw"] {
            if !is_listed(pointer) && job.pointer(pointer).is_some() {
                let (gain, _) = differences(&job, outcome.objective, pointer, Looser::More);
                assert!(gain < 3e-4, "{round} {pointer} buys {gain}");
            }
        }
        let gains: Vec<f64> = outcome.prices.iter().filter_map(|price| price.gain_percent).collect();
        assert!(gains.windows(2).all(|pair| pair[0] >= pair[1]), "{gains:?}");
    }
    eprintln!("{seen:?}");
    assert!(seen.finely == 0, "{seen:#?}");
    assert!(seen.wrong.is_empty() && seen.checked > 2 * count() && seen.untried * 20 < seen.checked, "{seen:#?}");
}

/// Prices that were compared, those of them at kinks, and those that the answer did not try.
#[derive(Debug, Default)]
struct Seen {
    checked: usize,
    kinks: usize,
    untried: usize,
    /// Met over the finer step, or over none, alone.
    finely: usize,
    wrong: Vec<String>,
}

/// Every price of an answer against the number turned by hand: both ways, and one way each at a kink, as it says.
fn prices_are_met(round: usize, job: &Value, outcome: &Outcome, seen: &mut Seen) {
    // Edges are held as they are: where a tighter limit takes one more, that is no price.
    let is_whole = job["limits"].get("whole_edges").is_some();
    for price in &outcome.prices {
        let Some(gain) = price.gain_percent else { continue };
        if price.basis == PriceBasis::OneOfSeveral {
            seen.untried += 1;
            continue;
        }
        let is_met = |(looser, tighter): (f64, Option<f64>), within: fn(f64, f64) -> bool| {
            let loss = if price.basis == PriceBasis::Multipliers { Some(gain) } else { price.loss_percent };
            let is_alike = loss.is_some() == tighter.is_some() || price.basis == PriceBasis::Multipliers || is_whole;
            within(gain, looser) && is_alike && loss.zip(tighter).is_none_or(|(loss, tighter)| within(loss, tighter))
        };
        let over = |step: f64| differences_over(step, job, outcome.objective, &price.pointer, price.looser);
        let long = over(STEP);
        if !is_met(long, within) {
            // Where limits meet a price may change by more than a hundredth within the step.
            let short = over(0.1 * STEP);
            if is_met(short, within_finely) || is_met(extrapolated(long, short), within_finely) {
                seen.finely += 1;
            } else {
                seen.wrong.push(format!("{round} {price:?}: {long:?} {short:?}"));
            }
        }
        seen.kinks += usize::from(price.basis == PriceBasis::SolvedAnew);
        seen.checked += 1;
    }
}

/// A job at whose optimum many limits meet: what the schedule of another one gives are limits of this one.
fn at_kinks(dice: &mut Dice, job: &Value, outcome: &Outcome) -> Value {
    let mut job = job.clone();
    for (k, zone) in outcome.zones.iter().enumerate() {
        for (field, value) in [
            ("deflection_max_um", zone.deflection_um),
            ("roughness_max_um", zone.roughness_um),
            ("feed_max_mm_per_rev", Some(zone.feed_mm_per_rev)),
        ] {
            if let (Some(value), true) = (value, dice.chance(0.4)) {
                job["zones"][k][field] = json!(value);
            }
        }
    }
    let largest = |of: fn(&ZoneOutcome) -> Option<f64>| outcome.zones.iter().filter_map(of).fold(0.0, f64::max);
    for (pointer, value) in [
        ("speed_max_m_per_min", Some(largest(|zone| Some(zone.speed_m_per_min)))),
        ("feed_max_mm_per_rev", Some(largest(|zone| Some(zone.feed_mm_per_rev)))),
        ("force_z_max_n", Some(largest(|zone| zone.force_z_n))),
        ("time_max_min", Some(outcome.cutting_time_min)),
        ("tool_usage_max", outcome.tool_usage.filter(|_| job["limits"].get("whole_edges").is_none())),
    ] {
        if let (Some(value), true) = (value, dice.chance(0.25)) {
            job["limits"][pointer] = json!(value);
        }
    }
    job
}

/// Places of the numbers that limit a job, and which way they are looser.
fn limiting(job: &Value) -> Vec<(String, Looser)> {
    let of_zone = ["deflection_max_um", "roughness_max_um", "feed_max_mm_per_rev"];
    let general = [
        "feed_min_mm_per_rev",
        "speed_min_m_per_min",
        "tool_life_min_min",
        "feed_max_mm_per_rev",
        "speed_max_m_per_min",
        "force_z_max_n",
        "time_max_min",
        "tool_usage_max",
        "feed_step_ratio_max",
    ];
    let zones = job["zones"].as_array().unwrap().len();
    let mut places: Vec<String> = (0..zones).flat_map(|k| of_zone.map(|field| format!("/zones/{k}/{field}"))).collect();
    places.extend(general.map(|field| format!("/limits/{field}")));
    places.push("/machine/power_kw".to_owned());
    places.retain(|place| job.pointer(place).is_some_and(Value::is_number));
    let looser = |place: &String| if place.contains("_min_") { Looser::Less } else { Looser::More };
    places.into_iter().map(|place| (place.clone(), looser(&place))).collect()
}

/// Where several limits meet in one point, zones are alike, or edges are whole, a number has a price each way.
#[test]
fn prices_at_kinks_are_those_of_either_side() {
    let mut dice = Dice(Pcg64Mcg::seed_from_u64(77));
    let mut seen = Seen::default();
    for round in 0..count() {
        let mut job = random(&mut dice, 1 + round % 4);
        if dice.chance(0.3) {
            // Zones alike: one limit of all of them is many rows of which each binds alone.
            let first = job["zones"][0].clone();
            for zone in job["zones"].as_array_mut().unwrap() {
                for field in ["diameter_mm", "depth_mm", "compliance_um_per_n", "deflection_max_um", "roughness_max_um"]
                {
                    zone[field] = first[field].clone();
                }
            }
        }
        if dice.chance(0.2) {
            job["variables"] = json!({ "feed": "constant", "speed": "per_zone" });
        }
        if dice.chance(0.2) {
            job["limits"]["whole_edges"] = json!(true);
        }
        let Ok(before) = solve(job.clone()) else { continue };
        let job = at_kinks(&mut dice, &job, &before);
        let outcome = solve(job.clone()).unwrap_or_else(|failure| panic!("{round}: {failure:?}"));
        near("the same optimum", outcome.objective, before.objective, 1e-6, 0.0);
        prices_are_met(round, &job, &outcome, &mut seen);
        for (place, looser) in limiting(&job) {
            if outcome.prices.iter().all(|price| price.pointer != place) {
                let (gain, _) = differences(&job, outcome.objective, &place, looser);
                if gain >= 3e-4 {
                    seen.wrong.push(format!("{round} {place} buys {gain}"));
                }
            }
        }
    }
    eprintln!("{seen:?}");
    assert!(seen.wrong.is_empty() && seen.checked > 2 * count(), "{seen:#?}");
    assert!(seen.kinks > count() / 2 && seen.untried * 20 < seen.checked, "{seen:#?}");
}

/// The job with only some of its limits; bounds in the set stay as custom limits, a feed step as couplings.
fn only(job: &Value, set: &[(String, String)]) -> Value {
    let mut out = job.clone();
    let has = |constraint: &str, zone: &str| set.iter().any(|(c, z)| c == constraint && z == zone);
    let (mut custom, mut couplings) = (Vec::new(), Vec::new());
    let ids: Vec<String> =
        job["zones"].as_array().unwrap().iter().map(|zone| zone["id"].as_str().unwrap().to_owned()).collect();
    let general = job["limits"].clone();
    for (k, id) in ids.iter().enumerate() {
        let fields = out["zones"][k].as_object_mut().unwrap();
        let own_max = fields.remove("feed_max_mm_per_rev").map_or(f64::INFINITY, |own| number(&own));
        for (constraint, field) in [("deflection", "deflection_max_um"), ("roughness", "roughness_max_um")] {
            if !has(constraint, id) {
                fields.remove(field);
            }
        }
        for (constraint, field, v, s, side) in [
            ("feed_min", "feed_min_mm_per_rev", 0.0, 1.0, "min"),
            ("feed_max", "feed_max_mm_per_rev", 0.0, 1.0, "max"),
            ("speed_min", "speed_min_m_per_min", 1.0, 0.0, "min"),
            ("speed_max", "speed_max_m_per_min", 1.0, 0.0, "max"),
        ] {
            if has(constraint, id) {
                let bound = number(&general[field]);
                let bound = if constraint == "feed_max" { bound.min(own_max) } else { bound };
                custom.push(json!({ "name": format!("{constraint}_{id}"), "zone": id, "speed_exponent": v, "feed_exponent": s, side: bound }));
            }
        }
        let depth = number(&job["zones"][k]["depth_mm"]);
        if has("power", id) {
            let model = &job["models"]["force_z"];
            custom.push(json!({ "name": format!("power_{id}"), "zone": id,
                "constant": number(&model["constant"]) + number(&model["depth_exponent"]) * depth.ln()
                    - (60_000.0 * number(&job["machine"]["efficiency"]) * number(&job["machine"]["power_kw"])).ln(),
                "speed_exponent": number(&model["speed_exponent"]) + 1.0, "feed_exponent": model["feed_exponent"], "max": 1.0 }));
        }
        if has("tool_life_min", id) {
            let model = &job["models"]["tool_life"];
            custom.push(json!({ "name": format!("life_{id}"), "zone": id,
                "constant": number(&model["constant"]) + number(&model["depth_exponent"]) * depth.ln(),
                "speed_exponent": model["speed_exponent"], "feed_exponent": model["feed_exponent"],
                "min": general["tool_life_min_min"] }));
        }
        if let Some(next) = ids.get(k + 1).filter(|next| has("feed_step", &format!("{id}|{next}"))) {
            for (a, b) in [(id, next), (next, id)] {
                couplings.push(json!({ "name": format!("step_{a}_{b}"), "max": general["feed_step_ratio_max"],
                    "terms": [{ "zone": a, "feed_exponent": 1.0 }, { "zone": b, "feed_exponent": -1.0 }] }));
            }
        }
    }
    // Without a bound means e^12 from the middle of the range: roughness falls as V^-0.05, so that a speed e^9 higher gives
    // a factor of 1.57 alone, and a finer surface would still seem to need what it does not.
    let e12 = |low: &str, high: &str| {
        let middle = (number(&general[low]) * number(&general[high])).sqrt();
        [(low.to_owned(), middle * (-12.0_f64).exp()), (high.to_owned(), middle * 12.0_f64.exp())]
    };
    let feeds = e12("feed_min_mm_per_rev", "feed_max_mm_per_rev");
    let speeds = e12("speed_min_m_per_min", "speed_max_m_per_min");
    let limits = out["limits"].as_object_mut().unwrap();
    for field in ["feed_step_ratio_max", "tool_life_min_min"] {
        limits.remove(field);
    }
    for (constraint, field) in [("tool_usage", "tool_usage_max"), ("time_max", "time_max_min")] {
        if !has(constraint, "part") {
            limits.remove(field);
        }
    }
    for (field, far) in feeds.into_iter().chain(speeds) {
        limits[&field] = json!(far);
    }
    out["machine"] = json!({});
    out["custom"] = Value::Array(custom);
    out["couplings"] = Value::Array(couplings);
    out
}

/// The job with every relaxation taken, and a thousandth more.
fn loosened(job: &Value, found: &Infeasible) -> Value {
    let mut job = job.clone();
    let more = 1.001;
    for relaxation in &found.relaxations {
        let factor = relaxation.factor * if relaxation.factor < 1.0 { 1.0 / more } else { more };
        let index = job["zones"].as_array().unwrap().iter().position(|zone| zone["id"] == relaxation.zone.as_str());
        let of_zone = |field: &str| format!("/zones/{}/{field}", index.unwrap());
        let pointer = match relaxation.constraint.as_str() {
            "deflection" => of_zone("deflection_max_um"),
            "roughness" => of_zone("roughness_max_um"),
            "tool_usage" => "/limits/tool_usage_max".to_owned(),
            "time_max" => "/limits/time_max_min".to_owned(),
            "tool_life_min" => "/limits/tool_life_min_min".to_owned(),
            "feed_step" => "/limits/feed_step_ratio_max".to_owned(),
            "deflection_spread" => "/limits/deflection_spread_ratio_max".to_owned(),
            other => panic!("{other} gives"),
        };
        let number = job.pointer_mut(&pointer).unwrap();
        // A general limit gives by the most that any of its places needs.
        let general = pointer.starts_with("/limits");
        let before = number.as_f64().unwrap();
        let original = before;
        let now = original * factor;
        let known = if general { before } else { original };
        *number = json!(if factor < 1.0 { known.min(now) } else { known.max(now) });
    }
    job
}

#[test]
fn relaxations_are_enough_and_every_member_of_a_conflict_is_needed() {
    let mut dice = Dice(Pcg64Mcg::seed_from_u64(74));
    let mut conflicts = 0;
    for round in 0..count() {
        let mut job = random(&mut dice, 1 + round % 6);
        job["limits"].as_object_mut().unwrap().remove("deflection_spread_ratio_max");
        job["variables"] = json!({});
        // Something that cannot be: too little time, or too fine a surface, or too little of an edge.
        match round % 3 {
            0 => job["limits"]["time_max_min"] = json!(dice.of(0.02, 0.3)),
            1 => job["zones"][0]["roughness_max_um"] = json!(dice.of(0.05, 0.2)),
            _ => {
                job["limits"]["tool_usage_max"] = json!(dice.of(0.001, 0.1));
                job["limits"]["time_max_min"] = json!(dice.of(0.2, 2.0));
            }
        }
        let found = match solve(job.clone()) {
            Ok(_) => continue,
            Err(Failure::Conflicting(conflict)) => conflict.infeasible,
            Err(other) => panic!("{round}: {other:?}"),
        };
        conflicts += 1;
        let set: Vec<(String, String)> =
            found.conflict_set.iter().map(|m| (m.constraint.clone(), m.zone.clone())).collect();
        assert!(matches!(solve(only(&job, &set)), Err(Failure::Conflicting(_))), "{round}: {set:?} do not conflict");
        for left_out in 0..set.len() {
            let mut rest = set.clone();
            let one = rest.remove(left_out);
            let outcome = solve(only(&job, &rest));
            assert!(outcome.is_ok(), "{round}: without {one:?} of {set:?} still {:?}", outcome.err());
        }
        if found.relaxations.iter().all(|relaxation| relaxation.constraint != "feed_min") {
            let outcome = solve(loosened(&job, &found));
            assert!(outcome.is_ok(), "{round}: {:?} are not enough: {:?}", found.relaxations, outcome.err());
        }
    }
    assert!(conflicts > count() / 3, "{conflicts}");
}

/// A schedule that exists is found, however little room the limits leave.
#[test]
fn thin_room_is_room() {
    let mut dice = Dice(Pcg64Mcg::seed_from_u64(75));
    let mut found = 0;
    for round in 0..count() / 2 {
        let base = random(&mut dice, 2 + round % 8);
        let Ok(outcome) = solve(base.clone()) else { continue };
        // The limits of the deflection and roughness put to what the schedule gives, and the time to what it takes.
        let mut thin = base.clone();
        let slack = 1.0 + dice.of(1e-6, 1e-4);
        for (k, zone) in outcome.zones.iter().enumerate() {
            thin["zones"][k]["deflection_max_um"] = json!(zone.deflection_um.unwrap() * slack);
            thin["zones"][k]["roughness_max_um"] = json!(zone.roughness_um.unwrap() * slack);
        }
        thin["limits"]["time_max_min"] = json!(outcome.cutting_time_min * slack);
        thin["limits"]["tool_usage_max"] = json!(outcome.tool_usage.unwrap() * slack);
        let again = solved(thin);
        found += 1;
        assert!(again.objective <= outcome.objective * (1.0 + 1e-6), "{round}");
    }
    assert!(found > count() / 5, "{found}");
}
