//! What is advised and warned of besides the numbers: one more rest, rests that never touch.
#![allow(clippy::unwrap_used, clippy::panic, missing_docs)]

use crate::support::prepared;
use precut_calc::calculator::{Answer, Calculator, Finding, Message, Unwatched, Value as Said};
use precut_calc::deflection_compensation::{DeflectionCompensation, Outcome};
use serde_json::{Value, json};

fn answer(job: Value) -> Answer<Outcome> {
    DeflectionCompensation::run(&prepared(job), &Unwatched).unwrap()
}

fn job(supports: &Value) -> Value {
    json!({
        "shaft": {
            "segments": [{ "length_mm": 800.0, "diameter_mm": 40.0, "stock_diameter_mm": 42.0 }],
            "youngs_modulus_n_per_mm2": 210_000.0
        },
        "supports": supports,
        "force": { "kind": "constant", "passive_n": 200.0 },
        "cut": { "feed_mm_per_rev": 0.2, "speed_m_per_min": 100.0 }
    })
}

fn centres(compliance_um_per_n: f64) -> Value {
    let centre = |z: f64| json!({ "kind": "centre", "z_mm": z, "compliance_um_per_n": compliance_um_per_n });
    json!([centre(0.0), centre(800.0)])
}

fn advised(answer: &Answer<Outcome>) -> Option<&Message> {
    answer.explanation.iter().find(|message| message.code == "one_more_rest_buys")
}

#[test]
fn one_more_rest_is_advised_with_the_compliance_that_its_figure_is_for() {
    for compliance in [0.0, 0.02] {
        let answer = answer(job(&centres(compliance)));
        let message = advised(&answer).unwrap();
        assert_eq!(message.values.get("compliance_um_per_n"), Some(&Said::from(compliance)));
    }
}

/// What the rest that is tried would take away from the form error.
fn gain_um(answer: &Answer<Outcome>) -> f64 {
    let rest = answer.output.one_more_rest.as_ref().unwrap();
    answer.output.form_error_um.unwrap() - rest.form_error_um
}

/// Nothing is advised that makes the form worse, or better by less than matters.
#[test]
fn one_more_rest_is_not_advised_where_it_is_not_worth_it() {
    // Ends about as soft as the middle of the shaft: held in the middle it comes out as a saddle.
    let soft = answer(job(&centres(0.65)));
    assert!(gain_um(&soft) < -1.0, "{:?}", soft.output.one_more_rest);
    assert_eq!(advised(&soft), None);
    // A stout shaft: all that could be gained is below a step of the control.
    let mut stout = job(&centres(0.0));
    stout["shaft"]["segments"][0]["diameter_mm"] = json!(300.0);
    stout["shaft"]["segments"][0]["stock_diameter_mm"] = json!(302.0);
    let stout = answer(stout);
    assert!((0.0..1.0).contains(&gain_um(&stout)), "{:?}", stout.output.one_more_rest);
    assert_eq!(advised(&stout), None);
}

fn idle(supports: &Value) -> Vec<Finding> {
    answer(job(supports)).warnings.into_iter().filter(|warning| warning.code == "rest_never_touches").collect()
}

fn with(rest: Value) -> Value {
    let mut supports = centres(0.0);
    supports.as_array_mut().unwrap().push(rest);
    supports
}

#[test]
fn a_rest_that_never_touches_the_shaft_is_warned_of() {
    let follow = |offset_mm: f64, one_sided: bool, gap_um: f64| json!({ "kind": "follow_rest", "offset_mm": offset_mm, "one_sided": one_sided, "gap_um": gap_um });
    for (rest, pointer, cause) in [
        (follow(900.0, false, 0.0), "/supports/2/offset_mm", "place"),
        (follow(-900.0, true, 10.0), "/supports/2/offset_mm", "place"),
        (follow(15.0, true, 50_000.0), "/supports/2/gap_um", "gap"),
        (
            json!({ "kind": "steady_rest", "z_mm": 300.0, "one_sided": true, "gap_um": 50_000.0 }),
            "/supports/2/gap_um",
            "gap",
        ),
    ] {
        let found = idle(&with(rest.clone()));
        let [finding] = &found[..] else { panic!("{rest}: {found:?}") };
        assert_eq!((finding.pointer.as_str(), finding.values.get("cause")), (pointer, Some(&Said::from(cause))));
        assert!(finding.value.is_some() && finding.unit.is_some());
    }
    for rest in [
        follow(15.0, false, 0.0),
        follow(790.0, false, 0.0),
        follow(15.0, true, 10.0),
        json!({ "kind": "steady_rest", "z_mm": 300.0, "one_sided": true, "gap_um": 10.0 }),
    ] {
        assert_eq!(idle(&with(rest.clone())), [], "{rest}");
    }
}
