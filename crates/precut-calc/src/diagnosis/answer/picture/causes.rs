//! Pictures of causes and sets: how likely, how far apart, how sure, and what is gained.

use utoipa::ToSchema;

use super::{figure, panel};
use crate::calculator::{Axis, Diagnosable, Figure, Item, Panel, Role};
use crate::diagnosis::answer::output::{CauseReport, DiagnosisResult, ProfileReport, VerdictClass};
use crate::diagnosis::verdict::identify::CONFOUNDED_BELOW;

/// Causes with a bar of their own; colours repeat after eight.
const MOST_CAUSES: usize = 8;
/// Profiles drawn at most.
const MOST_PROFILES: usize = 8;

/// Conditions of runs that a next measurement may change.
const CONDITIONS: &[&str] = &[
    "depth_mm",
    "feed_mm_per_rev",
    "speed_m_per_min",
    "feed_direction",
    "tool_path_at_start_m",
    "warm_time_at_start_min",
    "spindle_speed_rpm",
    "feed_mm_per_tooth",
    "time_since_clamping_min",
    "spark_out_revolutions",
    "infeed_revolutions",
    "tool_x_mm",
    "flank_wear_mm",
    "time_min",
];

/// What decisions are judged by, with the unit.
const OUTCOMES: &[(&str, &str)] =
    &[("form_error_um", "um"), ("largest_error_um", "um"), ("limit_use", "1"), ("depth_margin_percent", "percent")];

/// A cause's own name where the catalogue has it: pictures take words that live as long as the program.
fn kind_of<M: Diagnosable>(kind: &str) -> &'static str {
    M::CAUSES.iter().find(|cause| cause.kind == kind).map_or("diagnosis_candidate", |cause| cause.kind)
}

/// The likeliest causes, nothing, and what has no name. Where that is the answer it comes first, and what of the catalogue
/// only comes nearest stands last and pale: its share makes it no name.
pub(super) fn evidence<M: Diagnosable>(output: &DiagnosisResult<M::Effect, M::Run>) -> Figure {
    let is_unknown = output.verdict == VerdictClass::Unknown;
    let is_named =
        |cause: &CauseReport| output.named.iter().any(|one| one.kind == cause.kind && one.label == cause.label);
    let (own, nearest): (Vec<&CauseReport>, Vec<&CauseReport>) =
        output.causes.iter().take(MOST_CAUSES).partition(|&cause| !is_unknown || is_named(cause));
    let nothing = ("diagnosis_nothing", output.none_probability, Role::Nominal);
    let unnamed = ("diagnosis_unnamed", output.unnamed_probability, Role::Unstable);
    // Every second series is drawn pale, too: beside what only comes near none of them is taken.
    let step = if is_unknown { 2 } else { 1 };
    let own = (0_u8..)
        .step_by(step)
        .zip(own)
        .map(|(number, cause)| (kind_of::<M>(&cause.kind), cause.probability, Role::Series(number)));
    let bars: Vec<(&'static str, f64, Role)> = if is_unknown {
        let nearest = nearest.into_iter().map(|cause| (kind_of::<M>(&cause.kind), cause.probability, Role::Comparison));
        [unnamed].into_iter().chain(own).chain([nothing]).chain(nearest).collect()
    } else {
        [nothing].into_iter().chain(own).chain([unnamed]).collect()
    };
    let items = bars
        .into_iter()
        .enumerate()
        .map(|(place, (name, share, role))| Item::Bars { name, x: vec![place as f64], y: vec![Some(share)], role })
        .collect();
    let title = if is_unknown { "diagnosis_evidence_unknown" } else { "diagnosis_evidence" };
    let y = Axis::linear("diagnosis_probability", "1");
    figure("evidence", title, Axis::linear("diagnosis_cause_rank", "1"), vec![panel(y, items)])
}

/// How far leading sets lie apart, in units of the distance below which they are confounded.
pub(super) fn separations<E: ToSchema, R: ToSchema>(output: &DiagnosisResult<E, R>) -> Option<Figure> {
    let sets: Vec<&Vec<String>> = output.signatures.iter().map(|signature| &signature.causes).collect();
    if sets.len() < 2 {
        return None;
    }
    let between = |a: &Vec<String>, b: &Vec<String>| {
        let either = |pair: &&crate::diagnosis::answer::output::SeparationReport| {
            (pair.a == *a && pair.b == *b) || (pair.a == *b && pair.b == *a)
        };
        // Equal fits have no place on a logarithmic scale: a thousandth of the limit stands for them.
        output.separations.iter().find(either).map(|pair| (pair.sigmas / CONFOUNDED_BELOW).max(1e-3))
    };
    let values = sets.iter().enumerate().flat_map(|(i, a)| {
        let sets = &sets;
        (0..sets.len()).map(move |j| if i == j { None } else { between(a, sets[j]) })
    });
    let ranks: Vec<f64> = (1..=sets.len()).map(|rank| rank as f64).collect();
    let map = Item::HeatMap {
        value: Axis::logarithmic("diagnosis_separation", "1"),
        values: values.collect(),
        x: ranks.clone(),
        y: ranks,
        diverging: true,
    };
    let y = Axis::linear("diagnosis_other_set_rank", "1");
    Some(figure(
        "separations",
        "diagnosis_separations",
        Axis::linear("diagnosis_set_rank", "1"),
        vec![panel(y, vec![map])],
    ))
}

/// The rise of the misfit over every reported parameter, beside that of a quadratic likelihood.
pub(super) fn profiles<M: Diagnosable>(output: &DiagnosisResult<M::Effect, M::Run>) -> Option<Figure> {
    let panels: Vec<Panel> = output
        .profiles
        .iter()
        .take(MOST_PROFILES)
        .map(|profile| panel(Axis::linear(kind_of::<M>(&profile.kind), "1"), of_profile::<M>(profile)))
        .collect();
    (!panels.is_empty())
        .then(|| figure("profiles", "diagnosis_profiles", Axis::linear("diagnosis_deviations", "1"), panels))
}

fn of_profile<M: Diagnosable>(profile: &ProfileReport) -> Vec<Item> {
    let parameters = M::CAUSES.iter().filter(|cause| cause.kind == profile.kind).flat_map(|cause| cause.parameters);
    let name = parameters.map(|parameter| parameter.name).find(|name| *name == profile.parameter);
    let x = &profile.deviations;
    let line = |name, y: Vec<f64>, role| Item::Line { name, x: x.clone(), y: y.into_iter().map(Some).collect(), role };
    vec![
        line("diagnosis_profile_limit", vec![profile.rise_at_95; x.len()], Role::Limit),
        line("diagnosis_quadratic", x.iter().map(|x| x * x).collect(), Role::Comparison),
        line(name.unwrap_or("diagnosis_size"), profile.rise.clone(), Role::After),
    ]
}

/// Errors on what was held back: base, extended with its interval, and what no model can pass.
pub(super) fn held_back<E: ToSchema, R: ToSchema>(
    output: &DiagnosisResult<E, R>,
    unit: &'static str,
) -> Option<Figure> {
    let gain = output.gain.as_ref()?;
    let bar = |name, x, y, role| Item::Bars { name, x: vec![x], y: vec![Some(y)], role };
    let [low, high] = gain.gain_interval_95.map(|gain_at| (1.0 - gain_at) * gain.rmse_base);
    // What foresees no better is no improvement.
    let extended = if gain.rmse_extended < gain.rmse_base { Role::After } else { Role::Comparison };
    let items = vec![
        bar("diagnosis_base_residual", 1.0, gain.rmse_base, Role::Before),
        bar("diagnosis_extended_residual", 2.0, gain.rmse_extended, extended),
        bar("diagnosis_ceiling", 3.0, gain.noise_ceiling, Role::Uncertainty),
        Item::Line { name: "diagnosis_interval", x: vec![2.0, 2.0], y: vec![Some(low), Some(high)], role: Role::Plain },
    ];
    let y = Axis::linear("diagnosis_error", unit);
    Some(figure("held_back", "diagnosis_held_back", Axis::linear("diagnosis_model", "1"), vec![panel(y, items)]))
}

/// What comes of deciding with either model, an outcome in each panel.
pub(super) fn downstream<E: ToSchema, R: ToSchema>(output: &DiagnosisResult<E, R>) -> Option<Figure> {
    let panels: Vec<Panel> = output
        .downstream
        .iter()
        .filter_map(|downstream| {
            let (name, unit) = *OUTCOMES.iter().find(|(name, _)| *name == downstream.outcome)?;
            let bar = |name, x, y, role| Item::Bars { name, x: vec![x], y: vec![Some(y)], role };
            let spread = |x: f64, [low, high]: [f64; 2]| Item::Line {
                name: "diagnosis_interval",
                x: vec![x, x],
                y: vec![Some(low), Some(high)],
                role: Role::Plain,
            };
            let (base, extended) = (&downstream.base, &downstream.extended);
            let items = vec![
                bar("diagnosis_base_residual", 1.0, base.mean, Role::Before),
                bar("diagnosis_extended_residual", 2.0, extended.mean, Role::After),
                spread(1.0, base.interval_95),
                spread(2.0, extended.interval_95),
            ];
            Some(panel(Axis::linear(name, unit), items))
        })
        .collect();
    (!panels.is_empty())
        .then(|| figure("downstream", "diagnosis_downstream", Axis::linear("diagnosis_decided_with", "1"), panels))
}

/// What every run that could be measured next would part, as the power of ten of the Bayes factor to be expected.
pub(super) fn next_measurement<E: ToSchema, R: ToSchema>(output: &DiagnosisResult<E, R>) -> Option<Figure> {
    let next = output.next_measurement.as_ref()?;
    let candidates: Vec<(f64, &str, f64)> = (1_u32..)
        .zip(&next.candidates)
        .map(|(rank, candidate)| (f64::from(rank), candidate.changes.as_str(), candidate.bayes_factor.log10()))
        .collect();
    let mut names: Vec<&'static str> = Vec::new();
    for (_, changes, _) in &candidates {
        let name = condition(changes);
        if !names.contains(&name) {
            names.push(name);
        }
    }
    let bars = (0_u8..).zip(&names).map(|(number, name)| {
        let own = || candidates.iter().filter(|(_, changes, _)| condition(changes) == *name);
        let (x, y) = own().map(|(rank, _, power)| (*rank, Some(*power))).unzip();
        Item::Bars { name, x, y, role: Role::Series(number) }
    });
    let bars: Vec<Item> = bars.collect();
    let axis = Axis::linear("diagnosis_bayes_factor", "1");
    Some(figure(
        "next_measurement",
        "diagnosis_next_measurement",
        Axis::linear("diagnosis_candidate_rank", "1"),
        vec![panel(axis, bars)],
    ))
}

/// A condition's own name where pictures know it.
fn condition(changes: &str) -> &'static str {
    CONDITIONS.iter().find(|name| **name == changes).copied().unwrap_or("diagnosis_candidate")
}
