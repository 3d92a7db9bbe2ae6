//! What a fit leaves open of the coefficients of a model, beside effects that a diagnosis has found with them (`feed/10.2`).
//!
//! A diagnosis takes the coefficients as they are: what they are off by goes into the effects that it finds. With d = phi'(c - c_0)
//! and r the cut about which effects turn, d = d(r) + sum over k of (phi_k - r_k)(c_k - c_0k). A level that is found, with what is
//! not known of it, stands for d(r) as well, an exponent that is found for its own term: neither is counted again.

use crate::effects::{MachinabilityConditions, MachinabilityEffect as Effect};
use crate::machinability::ModelCoefficient;

use crate::feed_schedule::job::input::{Job, Reference};
use crate::feed_schedule::job::models::Output;

/// What a diagnosis has found of an output's level or of one of its exponents.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Found {
    Level,
    /// The exponent, and the logarithm about which it turns.
    Exponent(ModelCoefficient, f64),
}

/// What every coefficient of the fit of an output is multiplied by at a depth, as parts of 1, ln V and ln S: as far as no effect that was
/// found stands for it. `None` of a model without a covariance.
pub(in crate::feed_schedule) fn factors(job: &Job, output: Output, depth_mm: f64) -> Option<Vec<[f64; 3]>> {
    let covariance = job.models.get(output)?.coefficient_covariance.as_ref()?;
    let mut factors = covariance.factors(depth_mm, job.cutting_edge_angle_deg);
    let found = found(job, output);
    let about = |one: ModelCoefficient| {
        let own = found.iter().find_map(|found| match *found {
            Found::Exponent(of, about) if of == one => Some(about),
            _ => None,
        });
        own.or_else(|| of_reference(one, &job.reference.unwrap_or_default()))
    };
    let turned: Vec<Option<f64>> = covariance.order.iter().map(|one| about(*one)).collect();
    // Only where all of the cut is known about which a level was found.
    let is_level = found.contains(&Found::Level) && turned.iter().all(Option::is_some);
    for ((factor, one), about) in factors.iter_mut().zip(&covariance.order).zip(turned) {
        let Some(about) = about else { continue };
        if found.iter().any(|found| matches!(found, Found::Exponent(of, _) if of == one)) {
            *factor = [about, 0.0, 0.0];
        }
        if is_level {
            factor[0] -= about;
        }
    }
    Some(factors)
}

/// Outputs of which a found effect stands for something that a fit leaves open.
pub(in crate::feed_schedule) fn replaced(job: &Job) -> Vec<Output> {
    let is_replaced = |output: &Output| {
        let covariance = job.models.get(*output).and_then(|model| model.coefficient_covariance.as_ref());
        covariance.is_some_and(|all| factors(job, *output, 1.0) != Some(all.factors(1.0, job.cutting_edge_angle_deg)))
    };
    Output::ALL.into_iter().filter(is_replaced).collect()
}

/// What the cut about which effects turn is multiplied by.
fn of_reference(one: ModelCoefficient, reference: &Reference) -> Option<f64> {
    let stated = match one {
        ModelCoefficient::Constant => return Some(1.0),
        ModelCoefficient::SpeedExponent => reference.speed_m_per_min,
        ModelCoefficient::FeedExponent => reference.feed_mm_per_rev,
        ModelCoefficient::DepthExponent => reference.depth_mm,
        ModelCoefficient::AngleExponent => reference.cutting_edge_angle_deg,
    };
    stated.map(f64::ln)
}

/// Effects on an output that act here and of which a diagnosis says how far off they may be.
fn found(job: &Job, output: Output) -> Vec<Found> {
    let is_open = |place: usize, parameter: &str| {
        let mut moves = job.uncertainty.effects.iter().flat_map(|entry| &entry.moves);
        moves.any(|own| own.effect as usize == place + 1 && own.parameter == parameter && own.by.abs() > 0.0)
    };
    let own = job.effects.iter().enumerate().filter(|(_, effect)| effect.output() == Some(output.name()));
    let reference = job.reference.unwrap_or_default();
    own.filter_map(|(place, effect)| {
        if is_level(effect, &job.conditions) {
            return is_open(place, "delta_ln").then_some(Found::Level);
        }
        let (one, own) = exponent(effect)?;
        let about = own.map(f64::ln).or_else(|| of_reference(one, &reference))?;
        is_open(place, "delta").then_some(Found::Exponent(one, about))
    })
    .collect()
}

/// Whether an effect moves the whole output in the conditions of the job.
fn is_level(effect: &Effect, at: &MachinabilityConditions) -> bool {
    match effect {
        Effect::LevelShift { .. } => true,
        Effect::BatchShift { batch, .. } => at.batch.as_deref() == Some(batch),
        Effect::FactorShift { factor, level, .. } => at.level(factor) == Some(level),
        _ => false,
    }
}

/// The coefficient that an effect moves, and about what it says that it turns.
fn exponent(effect: &Effect) -> Option<(ModelCoefficient, Option<f64>)> {
    Some(match *effect {
        Effect::SpeedExponent { reference_speed_m_per_min, .. } => {
            (ModelCoefficient::SpeedExponent, reference_speed_m_per_min)
        }
        Effect::FeedExponent { reference_feed_mm_per_rev, .. } => {
            (ModelCoefficient::FeedExponent, reference_feed_mm_per_rev)
        }
        Effect::DepthExponent { reference_depth_mm, .. } => (ModelCoefficient::DepthExponent, reference_depth_mm),
        Effect::AngleExponent { reference_angle_deg, .. } => (ModelCoefficient::AngleExponent, reference_angle_deg),
        _ => return None,
    })
}
