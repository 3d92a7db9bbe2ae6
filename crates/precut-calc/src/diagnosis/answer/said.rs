//! What is said about an answer: warnings, and the verdict in a sentence.

use crate::calculator::{Basis, Finding, Message, Quantity, Smooth, Value};
use crate::diagnosis::answer::blunder::BlunderReport;
use crate::diagnosis::answer::classes;
use crate::diagnosis::answer::output::{
    CauseReport, DiagnosisResult, NamedCause, PlaceRange, Refusal, SetReport, VerdictClass,
};
use crate::diagnosis::answer::refuse::{most_causes, rows_for};
use crate::diagnosis::input::DiagnosisOptions;
use crate::diagnosis::model::extension::ExtensionKind;
use crate::diagnosis::rows::noise::{NoiseSource, is_finer_structure};
use crate::diagnosis::rows::outlier::Outliers;
use crate::diagnosis::rows::suspect::swapped_columns;
use crate::diagnosis::verdict::adequacy::TestKind;
use crate::diagnosis::verdict::identify::{COLLINEAR_ABOVE, CONFOUNDED_BELOW};
use crate::diagnosis::verdict::judge::{ALARM, UNNAMED, UNNAMED_MATTERS};
use crate::diagnosis::verdict::weigh::Weighing;

/// Difference of the information criterion that is more than a bare mention (Raftery).
const BIC_MATTERS: f64 = 2.0;
/// Copied rows that are named by their numbers.
const SAID_ROWS: usize = 12;
/// Sets that the sentence of a confounded answer names.
const SAID_SETS: usize = 6;

pub(in crate::diagnosis) const WARNING_CODES: &[&str] = &[
    "rows_not_predicted",
    "outliers_left_out",
    "too_many_outliers",
    "far_rows_kept",
    "repeated_rows",
    "scatter_unlike_stated",
    "one_place",
    "swapped_columns",
    "rows_for_causes",
    "nothing_held_back",
    "one_class",
    "classes_against_all",
    "finer_structure",
    "collinear_causes",
    "outlying_run",
    "rankings_disagree",
    "blunder_possible",
];
pub(in crate::diagnosis) const EXPLANATION_CODES: &[&str] = &[
    "diagnosis_adequate",
    "diagnosis_adequate_with_hint",
    "diagnosis_named",
    "diagnosis_confounded",
    "diagnosis_unknown",
    "diagnosis_objected",
    "diagnosis_unit_suspected",
    "diagnosis_blunder",
    "diagnosis_absolute_values",
    "diagnosis_constant_values",
    "diagnosis_too_few_rows",
    "diagnosis_base_fails",
    "diagnosis_recognised",
    "diagnosis_extended",
    "diagnosis_gain",
    "diagnosis_class_gain",
    "diagnosis_next",
    "diagnosis_next_further",
    "diagnosis_next_none",
    "diagnosis_negligible",
    "diagnosis_several_values",
    "diagnosis_changed",
    "diagnosis_downstream",
    "diagnosis_good_parts",
];

/// What is odd about the rows, and what was asked for and not done.
pub(in crate::diagnosis) fn warnings(
    options: &DiagnosisOptions,
    weighing: &Weighing<'_>,
    found: &Outliers,
    (used, copies): (&[usize], &[usize]),
    judged: bool,
    has_gain: bool,
) -> Vec<Finding> {
    let foundation = weighing.foundation;
    let mut warnings = Vec::new();
    if let Some(first) = copies.first() {
        let finding = Finding::new("repeated_rows", format!("/measurements/{first}")).with("count", copies.len());
        let said: Vec<usize> = copies.iter().take(SAID_ROWS).map(|row| row + 1).collect();
        warnings.push(finding.with("more", copies.len() - said.len()).with("rows", said));
    }
    warnings.extend(odd_rows(options.leave_outliers_out, weighing, found, used));
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
        let weighed = u8::from(leave_out && found.heavy_tails.is_some());
        warnings.push(
            Finding::new("too_many_outliers", "/measurements")
                .with("count", found.rows.len())
                .with("weighed", f64::from(weighed)),
        );
    } else if leave_out && !found.rows.is_empty() {
        let rows: Vec<usize> = found.rows.iter().map(|&row| used[row] + 1).collect();
        warnings.push(Finding::new("outliers_left_out", "/measurements").with("count", rows.len()).with("rows", rows));
    }
    let unlike = |factor: f64, own: f64| {
        Finding::new("scatter_unlike_stated", "/measurements").value(factor, "1").with("own", own)
    };
    match weighing.noise.source {
        NoiseSource::Scaled { scatter_factor } => warnings.push(unlike(scatter_factor, 1.0)),
        NoiseSource::Stated { scatter_factor } if !(0.5..=2.0).contains(&scatter_factor) => {
            warnings.push(unlike(scatter_factor, 0.0));
        }
        _ => {}
    }
    if !found.far_rows.is_empty() {
        let rows: Vec<usize> = found.far_rows.iter().map(|&row| used[row] + 1).collect();
        warnings.push(Finding::new("far_rows_kept", "/measurements").with("count", rows.len()).with("rows", rows));
    }
    let data = foundation.data;
    if data.sides.is_some() {
        warnings.extend(classes::warnings(weighing, used));
    }
    warnings
}

/// What speaks against taking the verdict as it stands.
pub(in crate::diagnosis) fn doubts<E: utoipa::ToSchema, R: utoipa::ToSchema>(
    output: &DiagnosisResult<E, R>,
    quantity: &Quantity,
) -> Vec<Finding> {
    let told = |blunder: &BlunderReport| {
        let said = of_blunder(blunder, quantity).into_iter();
        said.fold(Finding::new("blunder_possible", "/measurements"), |said, (name, value)| said.with(name, value))
    };
    let mut doubts: Vec<Finding> = output.blunders.iter().map(told).collect();
    let noise = &output.noise;
    if let (Some(between), Some(dof), Some(of_rows)) =
        (noise.between_sweeps, noise.between_sweeps_degrees_of_freedom, noise.degrees_of_freedom)
        && is_finer_structure((noise.standard_deviation, of_rows), (between, dof))
    {
        doubts.push(
            Finding::new("finer_structure", "/measurements")
                .with("sigma", noise.standard_deviation)
                .with("between", between),
        );
    }
    if let Some(index) = output.collinearity.filter(|index| *index > COLLINEAR_ABOVE) {
        doubts.push(
            Finding::new("collinear_causes", "/measurements")
                .measured(index, COLLINEAR_ABOVE, "1")
                .with("causes", kinds(&output.named)),
        );
    }
    doubts.extend(output.outlying_runs.iter().map(|odd| {
        Finding::new("outlying_run", format!("/runs/{}", odd.run.saturating_sub(1)))
            .value(odd.misfit_per_row, "1")
            .with("run", f64::from(odd.run))
            .with("verdict", odd.verdict_without.name())
            .with("sets", odd.sets_without.clone())
    }));
    doubts.extend(disagreement(output));
    doubts
}

/// Where posterior, information criterion and data held back favour different sets, each by more than its own scatter.
fn disagreement<E: utoipa::ToSchema, R: utoipa::ToSchema>(output: &DiagnosisResult<E, R>) -> Option<Finding> {
    let leader = output.sets.first().filter(|set| !set.with_remainder)?;
    let least = |of: &dyn Fn(&SetReport) -> Option<f64>| {
        let scored = output.sets.iter().filter_map(|set| Some((of(set)?, set)));
        scored.min_by(|a, b| a.0.total_cmp(&b.0))
    };
    let (bic, by_bic) = least(&|set| set.bic)?;
    let (rmse, by_held_out) = least(&|set| set.held_out_rmse)?;
    let rows = output.rows.used.iter().filter(|used| **used).count() as f64;
    let bic_differs = leader.bic.is_some_and(|own| own - bic > BIC_MATTERS);
    let held_out_differs = leader.held_out_rmse.is_some_and(|own| own > rmse * (1.0 + 1.0 / (2.0 * rows).sqrt()));
    (bic_differs || held_out_differs).then(|| {
        Finding::new("rankings_disagree", "/measurements")
            .with("posterior", kinds(&leader.causes))
            .with("bic", kinds(&by_bic.causes))
            .with("held_out", kinds(&by_held_out.causes))
    })
}

/// Most important first: the verdict, then the gain.
pub(in crate::diagnosis) fn explanation<E: utoipa::ToSchema, R: utoipa::ToSchema>(
    output: &DiagnosisResult<E, R>,
    quantity: &Quantity,
) -> Vec<Message> {
    let mut said = vec![match output.verdict {
        VerdictClass::Adequate if output.none_probability < 0.5 => {
            let hint = hinted(output);
            Message::new("diagnosis_adequate_with_hint")
                .with("probability_none", output.none_probability)
                .with("cause", hint.map_or_else(String::new, |cause| cause.kind.clone()))
                .with("probability", hint.map_or(output.unnamed_probability, |cause| cause.probability))
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
                .with("likely", all.len())
                .with(
                    "unnamed",
                    if output.unnamed_probability < UNNAMED_MATTERS { 0.0 } else { output.unnamed_probability },
                )
                .with("limit_sigmas", CONFOUNDED_BELOW)
        }
        VerdictClass::Unknown if output.unnamed_probability < UNNAMED => objected(output),
        VerdictClass::Unknown => Message::new("diagnosis_unknown")
            .with("probability", output.unnamed_probability)
            .with("rms", output.remainder.as_ref().map_or(0.0, |remainder| remainder.rms))
            .with("kind", output.remainder.as_ref().map_or_else(String::new, |remainder| remainder.kind.clone()))
            .with("over", output.remainder.as_ref().map_or_else(Vec::new, |remainder| remainder.over.clone()))
            .with("named", kinds(&output.named)),
        VerdictClass::Refused => match output.blunders.first() {
            Some(blunder) => of_blunder(blunder, quantity)
                .into_iter()
                .fold(Message::new("diagnosis_blunder"), |said, (name, value)| said.with(name, value))
                .with("verdict", blunder.verdict_if_corrected.name())
                .with("sets", blunder.causes_if_corrected.clone()),
            None => refused(output.refusal.as_ref(), output.rows.row.len()),
        },
    }];
    if let Some(recognised) = &output.recognised {
        said.push(
            Message::new("diagnosis_recognised")
                .with("label", recognised.label.clone())
                .with("without", recognised.error_without)
                .with("now", recognised.error_with)
                .with("unit", if quantity.logarithmic { "" } else { quantity.unit }),
        );
    }
    let negligible: Vec<String> = output
        .contributions
        .iter()
        .filter(|contribution| contribution.negligible)
        .map(|contribution| contribution.kind.clone())
        .collect();
    if !negligible.is_empty() {
        said.push(Message::new("diagnosis_negligible").with("causes", negligible));
    }
    said.extend(output.named.iter().flat_map(changed));
    said.extend(output.named.iter().filter_map(several_values));
    said.extend(next_runs(output));
    said.extend(extended(output, quantity));
    if let Some(gain) = &output.gain {
        said.push(
            Message::new("diagnosis_gain")
                .with("base", gain.rmse_base)
                .with("extended", gain.rmse_extended)
                .with("ceiling", gain.noise_ceiling)
                .with("chance", f64::from(u8::from(gain.gain_interval_95[0] <= 0.0)))
                .with("low", gain.gain_interval_95[0])
                .with("high", gain.gain_interval_95[1])
                .with("quantity", quantity.name)
                // Errors of logarithms are shares.
                .with("unit", if quantity.logarithmic { "" } else { quantity.unit }),
        );
    }
    said.extend(class_gain(output));
    said.extend(output.downstream.iter().map(|downstream| {
        Message::new("diagnosis_downstream")
            .with("outcome", downstream.outcome.clone())
            .with("unit", downstream.unit.clone())
            .with("base", downstream.base.mean)
            .with("extended", downstream.extended.mean)
            .with("low", downstream.extended.interval_95[0])
            .with("high", downstream.extended.interval_95[1])
    }));
    said.extend(output.good_parts.map(|good| {
        Message::new("diagnosis_good_parts")
            .with("base_percent", 100.0 * good.base.probability)
            .with("extended_percent", 100.0 * good.extended.probability)
            .with("error_percent", 100.0 * good.base.numerical_error.max(good.extended.numerical_error))
    }));
    said
}

/// What to measure next, or that nothing would help.
fn next_runs<E: utoipa::ToSchema, R: utoipa::ToSchema>(output: &DiagnosisResult<E, R>) -> Vec<Message> {
    let Some(next) = output.next_measurement.as_ref().filter(|next| next.rows_needed.is_some()) else {
        let is_open = output.verdict == VerdictClass::Confounded;
        return is_open.then(|| Message::new("diagnosis_next_none")).into_iter().collect();
    };
    let mut said = vec![
        Message::new("diagnosis_next")
            .with("changes", next.changes.clone())
            .with("leader", next.leader.clone())
            .with("rival", next.rival.clone())
            .with("now", next.separation_now_sigmas)
            .with("then", next.separation_then_sigmas),
    ];
    let further: Vec<String> = next.further_runs.iter().map(|run| run.changes.clone()).collect();
    if !further.is_empty() {
        said.push(Message::new("diagnosis_next_further").with("changes", further));
    }
    said
}

/// What the extended model is, where no cause is named by it.
fn extended<E: utoipa::ToSchema, R: utoipa::ToSchema>(
    output: &DiagnosisResult<E, R>,
    quantity: &Quantity,
) -> Option<Message> {
    let kind = match output.extension {
        ExtensionKind::None | ExtensionKind::Named => return None,
        ExtensionKind::Average => "average",
        ExtensionKind::Likeliest => "likeliest",
        ExtensionKind::Remainder => "remainder",
    };
    let said = Message::new("diagnosis_extended").with("kind", kind).with("effects", output.effects.len());
    let known = output.remainder.as_ref().filter(|_| output.extension == ExtensionKind::Remainder);
    let deviations = known.map_or(&[][..], |remainder| remainder.standard_deviation.as_slice());
    let square = deviations.iter().map(|deviation| deviation * deviation).sum::<f64>();
    let between = known.map_or(&[][..], |remainder| remainder.known_between.as_slice());
    let numbers = |of: fn(&PlaceRange) -> f64| between.iter().map(of).collect::<Vec<_>>();
    Some(
        said.with("band", (square / deviations.len().max(1) as f64).sqrt())
            .with("unit", if quantity.logarithmic { "" } else { quantity.unit })
            .with("places", between.iter().map(|range| range.field.clone()).collect::<Vec<_>>())
            .with("units", between.iter().map(|range| range.unit.clone()).collect::<Vec<_>>())
            .with("from", numbers(|range| range.from))
            .with("to", numbers(|range| range.to)),
    )
}

/// What the extension gains where classes were measured.
fn class_gain<E: utoipa::ToSchema, R: utoipa::ToSchema>(output: &DiagnosisResult<E, R>) -> Option<Message> {
    let held_out = output.classes.as_ref()?.held_out.as_ref()?;
    Some(
        Message::new("diagnosis_class_gain")
            .with("base", held_out.share_right_base)
            .with("extended", held_out.share_right_extended)
            .with("base_score", held_out.log_score_base)
            .with("extended_score", held_out.log_score_extended),
    )
}

/// From what to what an effect of the base changed.
fn changed(cause: &NamedCause) -> impl Iterator<Item = Message> {
    cause.parameters.iter().filter_map(|parameter| {
        let [low, high] = parameter.interval_95?;
        Some(
            Message::new("diagnosis_changed")
                .with("cause", cause.kind.clone())
                .with("label", cause.label.clone())
                .with("parameter", parameter.name.clone())
                .with("unit", parameter.unit.clone())
                .with("from", parameter.was?)
                .with("to", parameter.value)
                .with("low", low)
                .with("high", high),
        )
    })
}

/// Where the rows fit another value of a cause nearly as well.
fn several_values(cause: &NamedCause) -> Option<Message> {
    let (parameter, other) = cause.parameters.iter().find_map(|own| Some((own, own.other_values.first()?)))?;
    Some(
        Message::new("diagnosis_several_values")
            .with("cause", cause.kind.clone())
            .with("value", parameter.value)
            .with("other", *other)
            .with("unit", parameter.unit.clone()),
    )
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

/// What a hint at something beside an adequate base names: the likeliest cause, where it is likelier than all that has no
/// name.
pub(in crate::diagnosis) fn hinted<E: utoipa::ToSchema, R: utoipa::ToSchema>(
    output: &DiagnosisResult<E, R>,
) -> Option<&CauseReport> {
    output.causes.first().filter(|cause| cause.probability >= output.unnamed_probability)
}

/// What leads without fitting: the best of the catalogue, or, where that is not likely, the base.
pub(in crate::diagnosis) fn nearest<E: utoipa::ToSchema, R: utoipa::ToSchema>(
    output: &DiagnosisResult<E, R>,
) -> Option<&SetReport> {
    output.sets.iter().find(|set| !set.with_remainder && !set.causes.is_empty())
}

/// Rows object to the best of the catalogue, or to a base that nothing of the catalogue mends.
fn objected<E: utoipa::ToSchema, R: utoipa::ToSchema>(output: &DiagnosisResult<E, R>) -> Message {
    let nearest = nearest(output);
    let base = output.sets.iter().find(|set| !set.with_remainder && set.causes.is_empty());
    let of_base = output.tests.iter().filter(|test| TestKind::names_one_of_base(&test.test));
    let of_tests = of_base.map(|test| test.p_holm);
    let against_base = of_tests.chain(base.and_then(|set| set.lack_of_fit_p)).fold(1.0, f64::min);
    let said = Message::new("diagnosis_objected")
        .with("causes", nearest.map_or_else(Vec::new, |set| kinds(&set.causes)))
        .with("likely", nearest.map_or(0.0, |set| set.posterior))
        .with("unnamed", output.unnamed_probability);
    // Of a base that is likely by its weight only the tests say that it is wrong.
    match nearest.and_then(|set| set.lack_of_fit_p).filter(|_| output.none_probability < ALARM) {
        Some(p) => said.with("of_base", 0.0).with("probability", p),
        None => said.with("of_base", 1.0).with("probability", against_base),
    }
}

/// What a sentence about a blunder says: runs by their numbers, 0 for none.
fn of_blunder(blunder: &BlunderReport, quantity: &Quantity) -> Vec<(&'static str, Value)> {
    let run = |index: usize| Value::from(blunder.runs.get(index).map_or(0.0, |run| f64::from(*run)));
    vec![
        ("kind", Value::from(blunder.kind.clone())),
        ("first", run(0)),
        ("second", run(1)),
        ("condition", Value::from(blunder.condition.clone().unwrap_or_default())),
        ("factor", Value::from(blunder.factor.unwrap_or(1.0))),
        ("shift", Value::from(blunder.shift.unwrap_or(0.0))),
        ("unit_of_shift", Value::from(quantity.unit)),
        ("probability", Value::from(blunder.probability)),
    ]
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

pub(in crate::diagnosis) fn basis() -> Vec<Basis> {
    vec![
        Basis { equation: "diagnosis/3.1", source: "scatter: stated, from repeats, or restricted maximum likelihood" },
        Basis { equation: "diagnosis/3.2", source: "scatter and allowances as one covariance" },
        Basis { equation: "diagnosis/3.4", source: "evidence of linear Gaussian hypotheses, Laplace at the optimum" },
        Basis { equation: "diagnosis/3.5", source: "weights of causes, of nothing, and of an unnamed remainder" },
    ]
}
