//! What the numbers mean: codes with numbers.

use crate::calculator::{Finding, Message};

use super::input::Job;
use super::output::{FoundCompliance, Outcome, Part};
use super::solve::{UNLIKELY, at_name};

/// Codes of the explanations made here.
pub(super) const EXPLANATION_CODES: &[&str] = &["compliance_is", "play_is", "readings_met", "load_tells_more"];

/// Codes of the warnings made here.
pub(super) const WARNING_CODES: &[&str] =
    &["readings_do_not_fit", "no_spare_readings", "compliance_not_seen", "repeats_scatter"];

/// Repeated readings that scatter this many times the stated error say that it is stated too small.
const SCATTERED: f64 = 2.0;

pub(super) fn warnings(job: &Job, outcome: &Outcome) -> Vec<Finding> {
    let mut found = Vec::new();
    let fit = &outcome.fit;
    match fit.p_value {
        None => found.push(Finding::new("no_spare_readings", "/measurements").with("rows", fit.rows)),
        Some(p) if p < UNLIKELY => found.push(
            Finding::new("readings_do_not_fit", "/measurements")
                .measured(fit.rms_um, job.gauge_error_um, "um")
                .with("widened", fit.widened),
        ),
        Some(_) => {}
    }
    if let Some(repeat_um) = fit.repeat_um.filter(|repeat| *repeat > SCATTERED * job.gauge_error_um) {
        found.push(Finding::new("repeats_scatter", "/gauge_error_um").measured(repeat_um, job.gauge_error_um, "um"));
    }
    for one in outcome.compliances.iter().filter(|one| is_unseen(one)) {
        found.push(
            Finding::new("compliance_not_seen", "/measurements")
                .with("part", one.of.name())
                .with("upper", one.upper)
                .with("unit_of_part", one.of.unit()),
        );
    }
    found
}

/// Whether the readings do not tell a number from 0.
pub(super) fn is_unseen(one: &FoundCompliance) -> bool {
    one.lower <= 0.0
}

pub(super) fn explanation(outcome: &Outcome) -> Vec<Message> {
    let mut said: Vec<Message> = outcome
        .compliances
        .iter()
        .map(|one| {
            let code = match one.of {
                Part::PlayAtWork | Part::PlayAtTool => "play_is",
                _ => "compliance_is",
            };
            Message::new(code)
                .with("part", one.of.name())
                .with("value", one.value)
                .with("uncertainty", one.standard_uncertainty)
                .with("unit_of_part", one.of.unit())
        })
        .collect();
    said.push(Message::new("readings_met").with("rows", outcome.fit.rows).with("rms_um", outcome.fit.rms_um));
    if let Some(next) = outcome.next_load {
        let message = Message::new("load_tells_more")
            .with("part", next.narrows.name())
            .with("at", at_name(next.at))
            .with("force_n", next.force_n)
            .with("now_percent", next.now_percent)
            .with("then_percent", next.then_percent);
        said.push(match next.z_load_mm {
            Some(z) => message.with("z_mm", z),
            None => message,
        });
    }
    said
}
