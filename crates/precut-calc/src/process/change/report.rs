//! Changes and states in the words of the contract (`process/4`).

use crate::calculator::Message;
use crate::process::answer::output::{
    Change, ChangeForm, ChangeVerdict, ChangedCause, ModelSize, Situation, State, Unused,
};
use crate::process::change::null::{Column, Form, Source};
use crate::process::change::onsets::What;
use crate::process::change::verdict::{Class, Judgement, NORMAL_95, Suspect};
use crate::process::part::document::Options;
use crate::process::part::sight::Catalogue;

/// Everything that a state may say.
pub const EXPLANATION_CODES: &[&str] = &[
    "process_learning",
    "process_in_control",
    "process_warning",
    "process_changed_named",
    "process_changed_one_of",
    "process_changed_unnamed",
    "process_odd_part",
    "process_too_few_rows",
    "process_copied_rows",
    "process_unit_suspected",
    "process_measure_again",
];

/// A change as it is told.
pub(in crate::process) fn change(
    id: &str,
    reported: u32,
    accepted: bool,
    judgement: &Judgement,
    catalogue: &Catalogue,
) -> Change {
    Change {
        id: id.to_owned(),
        verdict: match judgement.class {
            Class::Named => ChangeVerdict::Named,
            Class::OneOf => ChangeVerdict::OneOf,
            Class::Unnamed => ChangeVerdict::Unnamed,
        },
        reported_at_part: reported,
        since_part: judgement.since,
        since_parts_90: judgement.since_90,
        accepted,
        decided: None,
        causes: judgement.list.iter().map(|suspect| cause(suspect, catalogue)).collect(),
    }
}

fn cause(suspect: &Suspect, catalogue: &Catalogue) -> ChangedCause {
    let name = suspect.name.map(|name| &catalogue.names[name]);
    let (parameter, unit, prior_sd, [lower, upper]) = match suspect.what {
        What::Cause(variant) => {
            let own = &catalogue.variants[variant];
            (own.parameter.clone(), own.unit.clone(), own.prior_sd, own.range)
        }
        What::Unnamed(_) => ("rms".into(), "um".into(), 1.0, [f64::NEG_INFINITY, f64::INFINITY]),
    };
    let at = |deviations: f64| (suspect.mean + deviations * suspect.deviation) * prior_sd;
    // A root mean square is no less than nothing.
    let least = if suspect.name.is_none() { 0.0 } else { f64::NEG_INFINITY };
    ChangedCause {
        kind: name.map_or("unnamed", |name| &*name.kind).to_owned(),
        label: name.map_or_else(String::new, |name| name.label.clone()),
        share: suspect.share,
        form: form_of(suspect.form),
        parameter,
        unit,
        delta: at(0.0),
        interval_95: [at(-NORMAL_95).max(least), at(NORMAL_95)],
        at_bound: !(lower..=upper).contains(&at(0.0)),
        same_as_other: suspect.same_as_other,
    }
}

/// A size of the model, of a free column at so many of its standard deviations; nothing of what is no cause.
pub(in crate::process) fn model_size(
    catalogue: &Catalogue,
    column: &Column,
    mean: f64,
    deviation: f64,
) -> Option<ModelSize> {
    let Source::Cause(variant) = column.source else { return None };
    let own = &catalogue.variants[variant];
    let name = &catalogue.names[own.name];
    let at = |deviations: f64| (mean + deviations * deviation) * column.sd * own.prior_sd;
    Some(ModelSize {
        kind: name.kind.clone().into_owned(),
        label: name.label.clone(),
        since_part: column.since.map(|(since, _)| since),
        form: column.since.map(|(_, form)| form_of(form)),
        shape: own.shape.clone(),
        parameter: own.parameter.clone(),
        unit: own.unit.clone(),
        delta: at(0.0),
        interval_95: [at(-NORMAL_95), at(NORMAL_95)],
    })
}

fn form_of(form: Form) -> ChangeForm {
    match form {
        Form::Step => ChangeForm::Step,
        Form::Drift => ChangeForm::Drift,
    }
}

/// What there is to say of a state, most important first.
pub(in crate::process) fn explanation(state: &State, options: &Options) -> Vec<Message> {
    let number = f64::from(state.number);
    let mut said = Vec::new();
    if let Some(unused) = state.unused {
        let code = match unused {
            Unused::TooFewRows => "process_too_few_rows",
            Unused::CopiedRows => "process_copied_rows",
            Unused::UnitSuspected => "process_unit_suspected",
            Unused::MeasureAgain => "process_measure_again",
        };
        said.push(Message::new(code).with("part", number));
    }
    if let Some(change) = &state.change {
        said.push(of_change(change));
    }
    match state.state {
        Situation::Learning => {
            said.push(Message::new("process_learning").with("learning_parts", f64::from(options.learning_parts)));
        }
        Situation::InControl => said.push(
            Message::new("process_in_control")
                .with("false_alarm_every_parts", f64::from(options.false_alarm_every_parts)),
        ),
        Situation::Warning => said.push(Message::new("process_warning").with("part", number)),
        Situation::Changed => {}
    }
    for odd in state.odd_parts.iter().rev().take(1) {
        said.push(
            Message::new("process_odd_part")
                .with("part", f64::from(odd.number))
                .with("reason", odd.reason.clone().into_owned()),
        );
    }
    said
}

fn of_change(change: &Change) -> Message {
    let code = match change.verdict {
        ChangeVerdict::Named => "process_changed_named",
        ChangeVerdict::OneOf => "process_changed_one_of",
        ChangeVerdict::Unnamed => "process_changed_unnamed",
    };
    let causes: Vec<String> = change.causes.iter().map(|cause| cause.kind.clone()).collect();
    Message::new(code)
        .with("since_part", f64::from(change.since_part))
        .with("from_part", f64::from(change.since_parts_90[0]))
        .with("to_part", f64::from(change.since_parts_90[1]))
        .with("causes", causes)
}
