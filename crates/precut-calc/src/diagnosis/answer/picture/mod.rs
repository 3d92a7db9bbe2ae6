//! Pictures and tables of a diagnosis.

mod causes;
mod classes;
mod rows;
mod tables;

use crate::calculator::{Axis, Diagnosable, Figure, Frame, Message, Panel, Quantity};
use crate::diagnosis::answer::output::DiagnosisResult;

pub(in crate::diagnosis) use tables::{TABLE_IDS, tables};

pub(in crate::diagnosis) const FIGURE_IDS: &[&str] = &[
    "classes",
    "residuals",
    "residuals_along",
    "residuals_by_run",
    "evidence",
    "prediction",
    "predicted_against_measured",
    "signatures",
    "separations",
    "profiles",
    "held_back",
    "downstream",
    "next_measurement",
    "remainder",
    "remainder_spectrum",
];
pub(in crate::diagnosis) const LABEL_CODES: &[&str] = &[
    "diagnosis_classes",
    "diagnosis_spindle_speed",
    "diagnosis_depth",
    "diagnosis_stable",
    "diagnosis_chatter",
    "diagnosis_opened",
    "diagnosis_limit_base",
    "diagnosis_limit_extended",
    "diagnosis_residuals",
    "diagnosis_residuals_along",
    "diagnosis_residuals_by_run",
    "diagnosis_evidence",
    "diagnosis_evidence_unknown",
    "diagnosis_prediction",
    "diagnosis_predicted_against_measured",
    "diagnosis_signatures",
    "diagnosis_separations",
    "diagnosis_profiles",
    "diagnosis_held_back",
    "diagnosis_downstream",
    "diagnosis_next_measurement",
    "diagnosis_remainder",
    "diagnosis_remainder_spectrum",
    "diagnosis_row",
    "diagnosis_run",
    "diagnosis_place",
    "diagnosis_residual",
    "diagnosis_residual_rms",
    "diagnosis_base_residual",
    "diagnosis_extended_residual",
    "diagnosis_scatter",
    "diagnosis_measured",
    "diagnosis_measured_1",
    "diagnosis_measured_2",
    "diagnosis_measured_3",
    "diagnosis_measured_4",
    "diagnosis_measured_5",
    "diagnosis_measured_6",
    "diagnosis_predicted",
    "diagnosis_band",
    "diagnosis_agreement",
    "diagnosis_set_1",
    "diagnosis_set_2",
    "diagnosis_set_3",
    "diagnosis_set_4",
    "diagnosis_set_rank",
    "diagnosis_other_set_rank",
    "diagnosis_separation",
    "diagnosis_cause_rank",
    "diagnosis_probability",
    "diagnosis_nothing",
    "diagnosis_unnamed",
    "diagnosis_deviations",
    "diagnosis_quadratic",
    "diagnosis_profile_limit",
    "diagnosis_size",
    "diagnosis_error",
    "diagnosis_model",
    "diagnosis_ceiling",
    "diagnosis_interval",
    "diagnosis_decided_with",
    "diagnosis_candidate",
    "diagnosis_candidate_rank",
    "diagnosis_bayes_factor",
    "diagnosis_remainder_value",
    "diagnosis_order",
    "diagnosis_amplitude",
];

/// Every figure that has something to show, in the order of [`FIGURE_IDS`].
pub(in crate::diagnosis) fn figures<M: Diagnosable>(
    quantity: &str,
    output: &DiagnosisResult<M::Effect, M::Run>,
) -> Vec<Figure> {
    let quantity = M::QUANTITIES.iter().find(|known| known.name == quantity);
    let unit = unit_of(quantity);
    let mut all = Vec::new();
    // A class leaves no residual.
    if let Some(classes) = &output.classes {
        all.push(classes::plane(classes));
        all.push(causes::evidence::<M>(output));
    } else {
        all.extend(rows::residuals(output, unit));
        all.push(causes::evidence::<M>(output));
        all.extend(rows::predictions(output, unit));
        all.extend(rows::signatures(output, unit));
    }
    all.extend(causes::separations(output));
    all.extend(causes::profiles::<M>(output));
    all.extend(causes::held_back(output, unit));
    all.extend(causes::downstream(output));
    all.extend(causes::next_measurement(output));
    all.extend(rows::remainder(output, unit));
    all
}

/// Logarithms have none.
fn unit_of(quantity: Option<&Quantity>) -> &'static str {
    match quantity {
        Some(Quantity { logarithmic: false, unit, .. }) => unit,
        _ => "1",
    }
}

fn figure(id: &'static str, title: &'static str, x: Axis, panels: Vec<Panel>) -> Figure {
    Figure { id, title: Message::new(title), frame: Frame::Stacked, x, panels }
}

fn panel(y: Axis, items: Vec<crate::calculator::Item>) -> Panel {
    Panel { y, height: 1.0, items }
}
