//! Effects that the base of a diagnosis holds already: they stay in the catalogue as changes of themselves.
#![allow(clippy::unwrap_used, clippy::panic, missing_docs)]

use precut_calc::calculator::{
    Answer, Calculator, Check, Diagnosable, Measurement, Reading, Rows, Treatment, Unwatched, Violations,
};
use precut_calc::deflection_compensation::DeflectionCompensation;
use precut_calc::diagnosis::{Diagnosis, JobOf, ResultOf, VerdictClass};
use precut_calc::feed_schedule::FeedSchedule;
use precut_calc::fixture_stability::FixtureStability;
use precut_calc::ring_roundness::RingRoundness;
use serde_json::{Value, json};

fn example<M: Diagnosable>() -> Value {
    serde_json::from_str(M::DIAGNOSES[0].job).unwrap()
}

fn job<M: Diagnosable>(value: &Value) -> JobOf<M> {
    let mut job: JobOf<M> = serde_json::from_value(value.clone()).unwrap();
    let mut violations = Violations::default();
    job.check(&mut violations);
    assert!(violations.is_empty(), "{:?}", violations.into_vec());
    Diagnosis::<M>::fill(&mut job);
    job
}

/// What a hypothesis stands for is told back as its values: else a held effect would be compared with something else.
fn effects_are_told_back<M: Diagnosable>() {
    let job = job::<M>(&example::<M>());
    let runs = if job.runs.is_empty() { vec![M::Run::default()] } else { job.runs.clone() };
    let rows = job.measurements.rows().iter();
    let point = |readings: Vec<Reading<M::Point>>| readings.into_iter().next().unwrap().point;
    let points = rows.map(|row| (row.run() as usize - 1, point(row.readings(&job.job, &job.quantity)))).collect();
    let prepared = M::prepare(&job.job, &Rows { runs, points }, &job.quantity, &Unwatched).ok().unwrap();
    let hypotheses = M::hypotheses(&prepared, &[], &Unwatched).unwrap().applicable;
    for hypothesis in hypotheses.iter().filter(|of| of.cause.kind != "chatter_harmonic") {
        let values: Vec<f64> = hypothesis
            .variables
            .iter()
            .map(|variable| match &variable.treatment {
                Treatment::Amplitude { prior_sd } => variable.range.clamp(0.7 * prior_sd),
                Treatment::Shape { grid, .. } => grid[grid.len() / 2],
                Treatment::Stated { value } => *value,
            })
            .collect();
        let effect = M::effects(&prepared, hypothesis, &values).unwrap().remove(0);
        let back = M::values(&prepared, hypothesis, &effect).unwrap();
        let near = values.iter().zip(&back).all(|(a, b)| (a - b).abs() <= 1e-9 * a.abs().max(1e-6));
        assert!(near, "{} {}: {values:?} {back:?}", hypothesis.cause.kind, hypothesis.label);
        // And as no other's.
        let others =
            hypotheses.iter().filter(|of| (of.cause.kind, &of.label) != (hypothesis.cause.kind, &hypothesis.label));
        for other in others {
            assert_eq!(M::values(&prepared, other, &effect), None, "{} {}", other.cause.kind, other.label);
        }
    }
}

#[test]
fn every_effect_is_told_back_as_what_it_was_made_of() {
    effects_are_told_back::<DeflectionCompensation>();
    effects_are_told_back::<FeedSchedule>();
    effects_are_told_back::<RingRoundness>();
    effects_are_told_back::<FixtureStability>();
}

/// The headstock of the example is softer than stated; `held` of it is known, give or take `unsure`.
fn under(held: f64, unsure: f64) -> Answer<ResultOf<DeflectionCompensation>> {
    let mut value = example::<DeflectionCompensation>();
    value["options"] = json!({ "held_out": false });
    value["job"]["effects"] = json!([
        { "kind": "size_offset", "offset_um": 0.0 },
        { "kind": "headstock_compliance", "delta_um_per_n": held }
    ]);
    let moved = json!({ "effect": 2, "parameter": "delta_um_per_n", "by": unsure });
    value["effects_uncertainty"] = if unsure > 0.0 { json!([{ "moves": [moved] }]) } else { json!([]) };
    Diagnosis::<DeflectionCompensation>::run(&job::<DeflectionCompensation>(&value), &Unwatched).unwrap()
}

#[test]
fn a_headstock_that_softened_is_named_with_what_it_was() {
    let mut value = example::<DeflectionCompensation>();
    value["options"] = json!({ "held_out": false });
    let fresh = Diagnosis::<DeflectionCompensation>::run(&job::<DeflectionCompensation>(&value), &Unwatched).unwrap();
    let truth = &fresh.output.named[0].parameters[0];
    assert_eq!((fresh.output.named[0].kind.as_str(), truth.was), ("headstock_compliance", None));
    let sd = truth.standard_deviation.unwrap();

    let half = under(0.5 * truth.value, sd);
    assert_eq!(half.output.verdict, VerdictClass::Named);
    assert_eq!(half.output.named.len(), 1);
    let found = &half.output.named[0].parameters[0];
    assert_eq!((half.output.named[0].kind.as_str(), found.was), ("headstock_compliance", Some(0.5 * truth.value)));
    // The whole value as before: what was believed of it hardly matters, unless as a prior.
    assert!((found.value - truth.value).abs() < 1.5 * sd, "{} {} {sd}", found.value, truth.value);
    let [low, high] = found.interval_95.unwrap();
    assert!(low < truth.value && truth.value < high);
    let profile = &half.output.profiles[0];
    assert!(profile.value.first().unwrap() < &found.value && profile.value.last().unwrap() > &found.value);
    // In place of what was held, not beside it.
    let effects = serde_json::to_value(&half.output.effects).unwrap();
    assert_eq!(effects, json!([{ "kind": "headstock_compliance", "delta_um_per_n": found.value }]));
    let left = &half.output.effects_uncertainty[0].moves[0];
    assert_eq!((left.effect, left.parameter.as_str()), (1, "delta_um_per_n"));
    assert!((left.by / found.standard_deviation.unwrap() - 1.0).abs() < 1e-6, "{left:?}");
    let said = half.explanation.iter().find(|said| said.code == "diagnosis_changed").unwrap();
    assert_eq!(said.values.get("from"), Some(&(0.5 * truth.value).into()));

    // Gone altogether is no limit: it can be named, too.
    let gone = under(0.045, 0.0);
    assert_eq!(gone.output.verdict, VerdictClass::Named, "{:?}", gone.output.named);
    assert_eq!(gone.output.named[0].kind, "headstock_compliance");
}

#[test]
fn what_was_known_so_badly_is_no_finding() {
    let value = example::<DeflectionCompensation>();
    let mut value = value.clone();
    value["options"] = json!({ "held_out": false });
    let fresh = Diagnosis::<DeflectionCompensation>::run(&job::<DeflectionCompensation>(&value), &Unwatched).unwrap();
    let truth = &fresh.output.named[0].parameters[0];
    let off = truth.value - 8.0 * truth.standard_deviation.unwrap();
    let surely = under(off, 0.0);
    assert_eq!(surely.output.verdict, VerdictClass::Named);
    let unsurely = under(off, 8.0 * truth.standard_deviation.unwrap());
    assert_eq!(unsurely.output.verdict, VerdictClass::Adequate, "{:?}", unsurely.output.named);
}

#[test]
fn what_is_unsure_must_be_there() {
    let mut value = example::<DeflectionCompensation>();
    value["job"]["effects"] = json!([{ "kind": "size_offset", "offset_um": 1.0 }]);
    let at =
        |effect: u32, parameter: &str| json!({ "moves": [{ "effect": effect, "parameter": parameter, "by": 0.1 }] });
    value["effects_uncertainty"] = json!([at(1, "offset_um"), at(2, "offset_um"), at(0, "offset_um"), at(1, "kind")]);
    let job: JobOf<DeflectionCompensation> = serde_json::from_value(value).unwrap();
    let mut violations = Violations::default();
    job.check(&mut violations);
    let found: Vec<(&str, String)> = violations.into_vec().into_iter().map(|one| (one.code, one.pointer)).collect();
    let place = |entry: usize| ("unknown_parameter", format!("/effects_uncertainty/{entry}/moves/0"));
    assert_eq!(found, [place(1), place(2), place(3)]);
}
