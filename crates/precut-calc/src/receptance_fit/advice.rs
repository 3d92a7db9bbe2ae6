//! What the modes mean: codes with numbers.

use crate::calculator::{Finding, Message};

use super::input::Job;
use super::output::{FittedMode, Outcome};

/// Codes of the explanations made here.
pub(super) const EXPLANATION_CODES: &[&str] =
    &["mode_is", "modes_by_criterion", "function_met", "direction_counts_as_rigid"];

/// Codes of the warnings made here.
pub(crate) const WARNING_CODES: &[&str] =
    &["modes_not_proportional", "remainder_has_pattern", "other_number_fits_better", "mode_implausible"];

/// Phase of a residue beyond which a mode is not taken for a real one, degrees.
const REAL_MODE_DEG: f64 = 10.0;
/// So many standard errors tell a phase from 0.
const CERTAIN: f64 = 3.0;
/// Correlation of what is left on neighbouring lines beyond which it is no noise.
const PATTERN: f64 = 0.3;
/// Natural frequencies, dampings and masses of machines.
const USUAL_HZ: (f64, f64) = (20.0, 20_000.0);
const USUAL_DAMPING: (f64, f64) = (1e-4, 0.5);
const USUAL_KG: (f64, f64) = (1e-3, 1e4);
const PERCENT: f64 = 100.0;

/// Names of the axes, as in the contract.
const AXES: [&str; 3] = ["x", "y", "z"];

/// Pointers begin with `at`, where the job stands in another one.
pub(crate) fn warnings(job: &Job, outcome: &Outcome, at: &str) -> Vec<Finding> {
    let mut found = Vec::new();
    for (index, (mode, known)) in outcome.modes.iter().zip(&outcome.certainty).enumerate() {
        let certain = CERTAIN * known.residue_phase_error_deg;
        if known.residue_phase_deg > REAL_MODE_DEG.max(certain) {
            found.push(
                Finding::new("modes_not_proportional", format!("{at}/files"))
                    .measured(known.residue_phase_deg, REAL_MODE_DEG, "deg")
                    .with("mode", index + 1)
                    .with("frequency_hz", mode.frequency_hz),
            );
        }
        found.extend(implausible(index, mode, at));
    }
    for function in &outcome.functions {
        if function.neighbour_correlation > PATTERN {
            found.push(
                Finding::new("remainder_has_pattern", format!("{at}/files/{}", function.file))
                    .measured(function.neighbour_correlation, PATTERN, "1")
                    .with("set", function.set)
                    .with("percent", PERCENT * function.residual_share),
            );
        }
    }
    for group in &outcome.groups {
        if let Some(better) = group.better_modes {
            found.push(
                Finding::new("other_number_fits_better", format!("{at}/modes"))
                    .value(f64::from(job.modes.unwrap_or_default()), "1")
                    .with("better", better),
            );
        }
    }
    found
}

/// The first number of a mode that no machine has.
fn implausible(index: usize, mode: &FittedMode, at: &str) -> Option<Finding> {
    let numbers = [
        ("natural_frequency", mode.frequency_hz, USUAL_HZ, "Hz"),
        ("damping_ratio", mode.damping_ratio, USUAL_DAMPING, "1"),
        ("modal_mass", mode.mass_kg, USUAL_KG, "kg"),
    ];
    let (what, value, (low, high), unit) =
        numbers.into_iter().find(|(_, value, (low, high), _)| !(*low..=*high).contains(value))?;
    let limit = if value < low { low } else { high };
    let finding = Finding::new("mode_implausible", format!("{at}/files")).measured(value, limit, unit);
    Some(finding.with("what", what).with("mode", index + 1))
}

/// The axis along which a mode lies; oblique where it is none.
fn direction(mode: &FittedMode) -> &'static str {
    let along = mode.direction.iter().position(|share| share.abs() > 1.0 - 1e-9);
    along.map_or("oblique", |axis| AXES[axis])
}

pub(super) fn explanation(outcome: &Outcome) -> Vec<Message> {
    let of_mode = |(mode, known): (&FittedMode, &super::output::ModeCertainty)| {
        Message::new("mode_is")
            .with("direction", direction(mode))
            .with("frequency_hz", mode.frequency_hz)
            .with("damping_percent", PERCENT * mode.damping_ratio)
            .with("damping_error_percent", PERCENT * known.damping_ratio_error / mode.damping_ratio)
            .with("mass_kg", mode.mass_kg)
            .with("mass_error_percent", PERCENT * known.mass_error_kg / mode.mass_kg)
            .with("stiffness_n_per_mm", known.stiffness_n_per_mm)
    };
    let mut said: Vec<Message> = outcome.modes.iter().zip(&outcome.certainty).map(of_mode).collect();
    for group in &outcome.groups {
        let names: Vec<&'static str> = group.directions.iter().map(|one| one.name()).collect();
        let message = Message::new("modes_by_criterion").with("names", names).with("modes", group.modes);
        let with = |message: Message, name: &'static str, bic: Option<f64>| match bic {
            Some(bic) => message.with(name, bic - group.bic),
            None => message,
        };
        said.push(with(with(message, "less", group.bic_one_less), "more", group.bic_one_more));
    }
    for function in &outcome.functions {
        said.push(
            Message::new("function_met")
                .with("response", function.response.name())
                .with("excitation", function.excitation.name())
                .with("lines", function.lines)
                .with("percent", PERCENT * function.residual_share),
        );
    }
    for (axis, name) in AXES.iter().enumerate().take(2) {
        let is_there = |group: &super::output::FittedGroup| group.directions.iter().any(|one| one.axis() == axis);
        if !outcome.groups.iter().any(is_there) {
            said.push(Message::new("direction_counts_as_rigid").with("direction", *name));
        }
    }
    said
}
