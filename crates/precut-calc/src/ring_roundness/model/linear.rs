//! The analysis `linear_theory`.

use crate::ring_roundness::answer::output_settings::{Fate, LinearOutcome, OrderOutcome, RootOutcome};
use crate::ring_roundness::job::input::Job;
use crate::ring_roundness::model::lobing::{Root, of_order};
use crate::ring_roundness::model::scene::Scene;
use crate::ring_roundness::model::stance::Stance;

/// A factor per revolution nearer to 1 than this stays: rounding of the angles makes about 1e-12, and a thousandth of a
/// degree in the setting 1e-5.
pub(in crate::ring_roundness) const NEUTRAL: f64 = 1e-6;

/// Whether a wave grows.
pub(in crate::ring_roundness) fn grows(root: &Root) -> bool {
    root.factor_per_revolution() > 1.0 + NEUTRAL
}

pub(in crate::ring_roundness) fn outcome(root: &Root) -> RootOutcome {
    RootOutcome { lobes: root.lobes, factor_per_revolution: root.factor_per_revolution() }
}

/// Growth or decay of every order.
pub(in crate::ring_roundness) fn theory(job: &Job, scene: &Scene, end: &Stance) -> LinearOutcome {
    let lobing = scene.lobing(end.copying());
    let (roots, complete) = lobing.roots(0.5, f64::from(job.highest_order) + 0.45);
    let orders = (2..=job.highest_order)
        .map(|order| {
            let k = f64::from(order);
            let (visibility_real, visibility_imaginary) = lobing.visibility(k);
            let root = of_order(&roots, k);
            let fate = match &root {
                None => Fate::Gone,
                Some(root) if grows(root) => Fate::Grows,
                Some(root) if root.factor_per_revolution() > 1.0 - NEUTRAL => Fate::Stays,
                Some(_) => Fate::Decays,
            };
            OrderOutcome {
                order,
                visibility_real,
                visibility_imaginary,
                factor_per_revolution: root.map(|root| root.factor_per_revolution()),
                fate,
            }
        })
        .collect();
    LinearOutcome {
        orders,
        worst: worst_of(&roots).as_ref().map(outcome),
        roots: roots.iter().map(outcome).collect(),
        complete,
    }
}

/// The worst of the waves from 1.5 lobes on: one lobe is the eccentricity, which is no error.
pub(in crate::ring_roundness) fn worst_of(roots: &[Root]) -> Option<Root> {
    roots.iter().filter(|root| root.lobes > 1.5).copied().max_by(|p, q| p.growth_per_rad.total_cmp(&q.growth_per_rad))
}
