//! What is said about an answer: warnings, and the verdict in a sentence.

use super::classes;
use super::identify::CONFOUNDED_BELOW;
use super::input::DiagnosisOptions;
use super::noise::NoiseSource;
use super::outlier::Outliers;
use super::output::{DiagnosisResult, NamedCause, Refusal, VerdictClass};
use super::refuse::{most_causes, rows_for};
use super::suspect::{copied_traces, repeated_rows, swapped_columns};
use super::weigh::Weighing;
use crate::calculator::{Basis, Finding, Message, Quantity, Smooth};

/// Sets that the sentence of a confounded answer names.
const SAID_SETS: usize = 6;

pub(super) const WARNING_CODES: &[&str] = &[
    "rows_not_predicted",
    "outliers_left_out",
    "too_many_outliers",
    "copied_sweeps",
    "repeated_rows",
    "scatter_unlike_stated",
    "one_place",
    "swapped_columns",
    "rows_for_causes",
    "nothing_held_back",
    "one_class",
    "classes_against_all",
];
pub(super) const EXPLANATION_CODES: &[&str] = &[
    "diagnosis_adequate",
    "diagnosis_adequate_with_hint",
    "diagnosis_named",
    "diagnosis_confounded",
    "diagnosis_unknown",
    "diagnosis_unit_suspected",
    "diagnosis_absolute_values",
    "diagnosis_constant_values",
    "diagnosis_too_few_rows",
    "diagnosis_base_fails",
    "diagnosis_gain",
    "diagnosis_class_gain",
    "diagnosis_next",
];

/// What is odd about the rows, and what was asked for and not done.
pub(super) fn warnings(
    options: &DiagnosisOptions,
    weighing: &Weighing<'_>,
    found: &Outliers,
    used: &[usize],
    judged: bool,
    has_gain: bool,
) -> Vec<Finding> {
    let foundation = weighing.foundation;
    let mut warnings = odd_rows(options.leave_outliers_out, weighing, found, used);
    let asked_for = usize::from(options.most_causes);
    if judged && most_causes(asked_for, used.len()) < asked_for {
        let needed = rows_for(asked_for) as f64;
        warnings.push(
            Finding::new("rows_for_causes", "/options/most_causes")
                .measured(used.len() as f64, needed, "1")
                .with("causes", asked_for)
                .with("searched", most_causes(asked_for, used.len())),
        );
    }
    if judged && options.held_out && !has_gain {
        warnings.push(Finding::new("nothing_held_back", "/options/held_out"));
    }
    let design = &foundation.data.layout.design;
    let one = |places: &[f64]| places.windows(2).all(|pair| pair[0].total_cmp(&pair[1]).is_eq());
    let at_one_place = match &design.smooth {
        Smooth::Along(places) | Smooth::Around(places) => one(places),
        Smooth::None => design.cell.windows(2).all(|pair| pair[0] == pair[1]),
    };
    if at_one_place {
        warnings.push(Finding::new("one_place", "/measurements").with("count", used.len()));
    } else if swapped_columns(foundation.data) {
        warnings.push(Finding::new("swapped_columns", "/measurements"));
    }
    warnings
}

fn odd_rows(leave_out: bool, weighing: &Weighing<'_>, found: &Outliers, used: &[usize]) -> Vec<Finding> {
    let foundation = weighing.foundation;
    let mut warnings = Vec::new();
    let missing = foundation.predicted.iter().filter(|ok| !**ok).count();
    if missing > 0 {
        warnings.push(Finding::new("rows_not_predicted", "/measurements").with("count", missing));
    }
    if found.too_many {
        warnings.push(Finding::new("too_many_outliers", "/measurements").with("count", found.rows.len()));
    } else if leave_out && !found.rows.is_empty() {
        let rows: Vec<usize> = found.rows.iter().map(|&row| used[row] + 1).collect();
        warnings.push(Finding::new("outliers_left_out", "/measurements").with("count", rows.len()).with("rows", rows));
    }
    if let NoiseSource::Stated { scatter_factor } = weighing.noise.source
        && !(0.5..=2.0).contains(&scatter_factor)
    {
        warnings.push(Finding::new("scatter_unlike_stated", "/measurements").value(scatter_factor, "1"));
    }
    let data = foundation.data;
    if data.sides.is_some() {
        // Equal classes are no copies of each other.
        warnings.extend(classes::warnings(weighing, used));
        return warnings;
    }
    warnings.extend(copied_traces(data).into_iter().map(|(first, second)| {
        Finding::new("copied_sweeps", "/measurements").with("first", first + 1).with("second", second + 1)
    }));
    let repeated: Vec<usize> = repeated_rows(data).into_iter().map(|row| used[row] + 1).collect();
    if !repeated.is_empty() {
        let finding = Finding::new("repeated_rows", format!("/measurements/{}", repeated[0] - 1));
        warnings.push(finding.with("count", repeated.len()).with("rows", repeated));
    }
    warnings
}

/// Most important first: the verdict, then the gain.
pub(super) fn explanation<E: utoipa::ToSchema, R: utoipa::ToSchema>(
    output: &DiagnosisResult<E, R>,
    quantity: &Quantity,
) -> Vec<Message> {
    let mut said = vec![match output.verdict {
        VerdictClass::Adequate if output.none_probability < 0.5 => {
            let hint = output.causes.first().map_or_else(String::new, |cause| cause.kind.clone());
            Message::new("diagnosis_adequate_with_hint")
                .with("probability_none", output.none_probability)
                .with("cause", hint)
        }
        VerdictClass::Adequate => Message::new("diagnosis_adequate").with("probability_none", output.none_probability),
        VerdictClass::Named => Message::new("diagnosis_named")
            .with("causes", kinds(&output.named))
            .with("labels", labels(&output.named))
            .with("probability", output.sets.first().map_or(0.0, |set| set.posterior)),
        VerdictClass::Confounded => {
            let all: Vec<Vec<String>> = output.likely_sets.iter().map(|set| kinds(&set.causes)).collect();
            let mut sets = folded(&all);
            let more = sets.len().saturating_sub(SAID_SETS);
            sets.truncate(SAID_SETS);
            Message::new("diagnosis_confounded")
                .with("sets", sets)
                .with("more", more)
                .with("limit_sigmas", CONFOUNDED_BELOW)
        }
        VerdictClass::Unknown => Message::new("diagnosis_unknown")
            .with("probability", output.unnamed_probability)
            .with("rms", output.remainder.as_ref().map_or(0.0, |remainder| remainder.rms))
            .with("kind", output.remainder.as_ref().map_or_else(String::new, |remainder| remainder.kind.clone()))
            .with("named", kinds(&output.named)),
        VerdictClass::Refused => refused(output.refusal.as_ref(), output.rows.row.len()),
    }];
    // A run that parts nothing is not worth a sentence.
    if let Some(next) = output.next_measurement.as_ref().filter(|next| next.rows_needed.is_some()) {
        said.push(
            Message::new("diagnosis_next")
                .with("changes", next.changes.clone())
                .with("leader", next.leader.clone())
                .with("rival", next.rival.clone())
                .with("now", next.separation_now_sigmas)
                .with("then", next.separation_then_sigmas),
        );
    }
    if let Some(gain) = &output.gain {
        said.push(
            Message::new("diagnosis_gain")
                .with("base", gain.rmse_base)
                .with("extended", gain.rmse_extended)
                .with("ceiling", gain.noise_ceiling)
                .with("quantity", quantity.name)
                // Errors of logarithms are shares.
                .with("unit", if quantity.logarithmic { "" } else { quantity.unit }),
        );
    }
    if let Some(held_out) = output.classes.as_ref().and_then(|classes| classes.held_out.as_ref()) {
        said.push(
            Message::new("diagnosis_class_gain")
                .with("base", held_out.share_right_base)
                .with("extended", held_out.share_right_extended)
                .with("base_score", held_out.log_score_base)
                .with("extended_score", held_out.log_score_extended),
        );
    }
    said
}

/// Sets without those that only extend another of them.
fn folded(sets: &[Vec<String>]) -> Vec<Vec<String>> {
    let extends =
        |set: &Vec<String>, other: &Vec<String>| other.len() < set.len() && other.iter().all(|kind| set.contains(kind));
    sets.iter().filter(|set| !sets.iter().any(|other| extends(set, other))).cloned().collect()
}

fn kinds(causes: &[NamedCause]) -> Vec<String> {
    causes.iter().map(|cause| cause.kind.clone()).collect()
}

fn labels(causes: &[NamedCause]) -> Vec<String> {
    causes.iter().map(|cause| cause.label.clone()).collect()
}

fn refused(refusal: Option<&Refusal>, rows: usize) -> Message {
    let Some(refusal) = refusal else { return Message::new("diagnosis_base_fails") };
    match (refusal.reason.as_str(), refusal.factor, refusal.fitted_factor) {
        ("unit_suspected", Some(factor), Some(fitted)) => {
            Message::new("diagnosis_unit_suspected").with("factor", factor).with("fitted", fitted)
        }
        ("absolute_values", ..) => Message::new("diagnosis_absolute_values"),
        ("constant_values", ..) => Message::new("diagnosis_constant_values").with("count", rows),
        ("too_few_rows", ..) => Message::new("diagnosis_too_few_rows")
            .with("count", rows)
            .with("needed", refusal.rows_needed.map_or(0.0, f64::from)),
        _ => Message::new("diagnosis_base_fails"),
    }
}

pub(super) fn basis() -> Vec<Basis> {
    vec![
        Basis { equation: "diagnosis/3.1", source: "scatter: stated, from repeats, or restricted maximum likelihood" },
        Basis { equation: "diagnosis/3.2", source: "scatter and allowances as one covariance" },
        Basis { equation: "diagnosis/3.4", source: "evidence of linear Gaussian hypotheses, Laplace at the optimum" },
        Basis { equation: "diagnosis/3.5", source: "weights of causes, of nothing, and of an unnamed remainder" },
    ]
}
