//! Which output an effect of the job acts on, and what it needs.

use crate::calculator::{Finding, Violations};
use crate::effects::MachinabilityEffect as Effect;

use crate::feed_schedule::job::input::Job;
use crate::feed_schedule::job::models::Output;
use crate::feed_schedule::job::{formula, remainder};

/// Codes of the faults found here.
pub(in crate::feed_schedule) const CODES: &[&str] = &[
    "duplicate_effect",
    "condition_missing",
    "effect_output_missing",
    "effect_reference_missing",
    "effect_condition_missing",
    "formula_unreadable",
    "remainder_not_a_table",
];

/// The name of a further output that wear effects are about.
const FLANK_WEAR: &str = "flank_wear";

/// Outputs of the job that an effect may act on.
fn eligible(job: &Job, effect: &Effect) -> Vec<String> {
    let known = |outputs: &[Output]| -> Vec<String> {
        outputs
            .iter()
            .filter(|output| job.models.has(**output, job.force.as_ref()))
            .map(|output| output.name().to_owned())
            .collect()
    };
    let further = || job.models.further.iter().map(|further| further.name.clone());
    match effect {
        Effect::NoseRadiusFloor { .. } => known(&[Output::Roughness]),
        Effect::EdgeForceOffset { .. } | Effect::WearForceAdditive { .. } => known(&[Output::ForceZ, Output::ForceY]),
        Effect::WearIn { .. } => further().filter(|name| name.starts_with(FLANK_WEAR)).collect(),
        _ => known(&Output::ALL).into_iter().chain(further()).collect(),
    }
}

/// The output that an effect acts on, where it is certain.
fn output_of(job: &Job, effect: &Effect) -> Option<String> {
    let eligible = eligible(job, effect);
    match effect.output() {
        Some(named) => eligible.into_iter().find(|known| known == named),
        None => (eligible.len() == 1).then(|| eligible[0].clone()),
    }
}

/// Writes out which output every effect acts on.
pub(in crate::feed_schedule) fn fill(job: &mut Job) {
    let outputs: Vec<Option<String>> = job.effects.iter().map(|effect| output_of(job, effect)).collect();
    for (effect, output) in job.effects.iter_mut().zip(outputs) {
        effect.set_output(output);
    }
}

/// Adds the faults of the effects.
pub(in crate::feed_schedule) fn check(job: &Job, violations: &mut Violations) {
    let mut seen: Vec<(String, Option<String>)> = Vec::new();
    for (i, effect) in job.effects.iter().enumerate() {
        let at = format!("/effects/{i}");
        let kind = effect.kind();
        let output = output_of(job, effect);
        violations.require(output.is_some(), || {
            let known = eligible(job, effect);
            Finding::new("effect_output_missing", format!("{at}/output")).with("kind", kind).with("known", known)
        });
        // Shifts may recur with another batch, level or pair of levels, remainders over other conditions, formulas by
        // other names.
        let identity = match effect {
            Effect::BatchShift { batch, .. } => format!("{kind} {batch}"),
            Effect::FactorShift { factor, level, .. } => format!("{kind} {factor}={level}"),
            Effect::FactorInteraction { factor_1, level_1, factor_2, level_2, .. } => {
                format!("{kind} {factor_1}={level_1} {factor_2}={level_2}")
            }
            Effect::Remainder { profile, .. } => {
                remainder::check(job, profile, &at, violations);
                format!("{kind} {}", remainder::label("", profile))
            }
            _ => match effect.formula() {
                Some(own) => {
                    formula::check(job, &own, &at, violations);
                    format!("{kind} {}", own.label())
                }
                None => kind.to_owned(),
            },
        };
        let key = (identity, output);
        violations.require(!seen.contains(&key), || Finding::new("duplicate_effect", at.clone()).with("kind", kind));
        seen.push(key);
        check_conditions(job, effect, &at, violations);
        check_reference(job, effect, &at, violations);
    }
}

fn check_conditions(job: &Job, effect: &Effect, at: &str, violations: &mut Violations) {
    let c = &job.conditions;
    let mut need = |there: bool, condition: &str| {
        violations.require(there, || {
            Finding::new("condition_missing", format!("/conditions/{condition}"))
                .with("kind", effect.kind())
                .with("condition", condition.to_owned())
                .with("effect", at.to_owned())
        });
    };
    match effect {
        Effect::BatchShift { .. } => need(c.batch.is_some(), "batch"),
        Effect::FactorShift { factor, .. } => need(c.level(factor).is_some(), "factors"),
        Effect::FactorInteraction { factor_1, factor_2, .. } => {
            need(c.level(factor_1).is_some() && c.level(factor_2).is_some(), "factors");
        }
        Effect::WearMultiplicative { .. } | Effect::WearForceAdditive { .. } => {
            need(c.flank_wear_mm.is_some(), "flank_wear_mm");
        }
        Effect::WearIn { .. } => need(c.time_min.is_some(), "time_min"),
        _ => {}
    }
}

fn check_reference(job: &Job, effect: &Effect, at: &str, violations: &mut Violations) {
    let r = job.reference.unwrap_or_default();
    let mut need = |own: Option<f64>, of_job: Option<f64>, field: &str| {
        violations.require(own.or(of_job).is_some(), || {
            Finding::new("effect_reference_missing", format!("{at}/{field}"))
                .with("kind", effect.kind())
                .with("field", field.to_owned())
        });
    };
    let (speed, feed, depth) = ("reference_speed_m_per_min", "reference_feed_mm_per_rev", "reference_depth_mm");
    match effect {
        Effect::SpeedExponent { reference_speed_m_per_min: own, .. }
        | Effect::SpeedCurvature { reference_speed_m_per_min: own, .. } => need(*own, r.speed_m_per_min, speed),
        Effect::FeedExponent { reference_feed_mm_per_rev: own, .. }
        | Effect::FeedCurvature { reference_feed_mm_per_rev: own, .. } => need(*own, r.feed_mm_per_rev, feed),
        Effect::DepthExponent { reference_depth_mm: own, .. }
        | Effect::DepthCurvature { reference_depth_mm: own, .. } => need(*own, r.depth_mm, depth),
        Effect::WearForceAdditive { reference_depth_mm: own, depth_power, .. } if *depth_power != 0.0 => {
            need(*own, r.depth_mm, depth);
        }
        Effect::AngleExponent { reference_angle_deg: own, .. } => {
            need(*own, r.cutting_edge_angle_deg, "reference_angle_deg");
        }
        Effect::SpeedFeedInteraction { reference_speed_m_per_min: a, reference_feed_mm_per_rev: b, .. } => {
            need(*a, r.speed_m_per_min, speed);
            need(*b, r.feed_mm_per_rev, feed);
        }
        Effect::FeedDepthInteraction { reference_feed_mm_per_rev: a, reference_depth_mm: b, .. } => {
            need(*a, r.feed_mm_per_rev, feed);
            need(*b, r.depth_mm, depth);
        }
        Effect::SpeedDepthInteraction { reference_speed_m_per_min: a, reference_depth_mm: b, .. } => {
            need(*a, r.speed_m_per_min, speed);
            need(*b, r.depth_mm, depth);
        }
        _ => {}
    }
}
