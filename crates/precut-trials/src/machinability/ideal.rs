//! What an observer of cutting trials would say who knows everything but which cause acts.

use super::hide::CAUSES;
use super::{LEVEL, Plan, drawn, scaled};
use crate::observer::{Covariance, Expected};
use crate::{Class, Random, Scatter};

/// Whether that observer finds the one cause that [`super::draw`] hides under this seed.
pub fn is_found(snr: f64, seed: u64) -> bool {
    let drawn = drawn((Plan::Levels, Scatter::Student), Class::One, snr, seed);
    let (Some(truth), Some(hidden)) = (drawn.trial.truth.causes.first(), drawn.hidden.first()) else { return false };
    // Numbers of its own: what the draw takes is not changed by who looks on.
    let mut random = Random::new(seed ^ 0x5eed);
    let two_sided = hidden.cause.two_sided;
    let mut expected = vec![Expected { kind: truth.kind, two_sided, signature: truth.signature.clone() }];
    for cause in CAUSES.iter().filter(|cause| cause.kind != truth.kind) {
        let found = scaled(*cause, &drawn.output, &drawn.cuts, snr * drawn.trial.sigma, &mut random);
        let of = |one| Expected { kind: cause.kind, two_sided: cause.two_sided, signature: drawn.signature(&[one]) };
        expected.extend(found.map(of));
    }
    // Cuts stand alone: each is a sweep of its own.
    let mut covariance = Covariance::new(drawn.trial.sigma, 0.0, 1);
    covariance.allow(&vec![LEVEL; drawn.cuts.len()]);
    covariance.best(&drawn.residual, &expected) == Some(truth.kind)
}
