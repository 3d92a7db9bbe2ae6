//! What an observer of a shaft would say who knows everything but which cause acts.

use super::hide::CAUSES;
use super::{
    BENDING_ALLOWANCE, Drawn, FORCE_LEVEL_ALLOWANCE, FORCE_PER_RUN_ALLOWANCE, SETUP_ALLOWANCE_UM, drawn, scaled,
};
use crate::observer::{Covariance, Expected, NEIGHBOURS};
use crate::{Class, Random, Scatter};

/// Whether that observer finds the one cause that [`super::draw`] hides under this seed.
pub fn is_found(snr: f64, seed: u64) -> bool {
    let drawn = drawn(Scatter::Student, Class::One, snr, seed);
    let Some(truth) = drawn.trial.truth.causes.first() else { return false };
    // Numbers of its own: what the draw takes is not changed by who looks on.
    let mut random = Random::new(seed ^ 0x5eed);
    let mut expected =
        vec![Expected { kind: truth.kind, two_sided: drawn.two_sided(), signature: truth.signature.clone() }];
    for cause in CAUSES.iter().filter(|cause| cause.kind != truth.kind) {
        let Drawn { lathe, runs, places, trial, .. } = &drawn;
        let found = scaled(*cause, lathe, runs, places, snr * trial.sigma, &mut random);
        expected.extend(found.map(|one| Expected {
            kind: cause.kind,
            two_sided: cause.two_sided,
            signature: drawn.signature_um(&[one]),
        }));
    }
    drawn.covariance().best(&drawn.residual_um, &expected) == Some(truth.kind)
}

impl Drawn {
    fn two_sided(&self) -> bool {
        self.hidden.first().is_some_and(|one| one.cause.two_sided)
    }

    fn covariance(&self) -> Covariance {
        let Self { runs, places, trial, .. } = self;
        let mut covariance = Covariance::new(trial.sigma, NEIGHBOURS, places.len());
        let plain = self.clean_um(&[], 1.0, 1.0);
        let change = |bending: f64, force: f64| -> Vec<f64> {
            let with = self.clean_um(&[], bending, force);
            with.iter().zip(&plain).map(|(with, plain)| with - plain).collect()
        };
        let stronger = change(1.0, 1.0 + FORCE_LEVEL_ALLOWANCE);
        covariance.allow(&self.by_trace(&stronger));
        covariance.allow(&self.by_trace(&change(1.0 + BENDING_ALLOWANCE, 1.0)));
        for run in 0..runs.len() {
            let own = |of: &dyn Fn(usize) -> f64| -> Vec<f64> {
                let row = |row: usize| if row / places.len() == run { of(row) } else { 0.0 };
                (0..plain.len()).map(row).collect()
            };
            covariance.allow(&self.by_trace(&own(&|_| SETUP_ALLOWANCE_UM)));
            let per_run = FORCE_PER_RUN_ALLOWANCE / FORCE_LEVEL_ALLOWANCE;
            covariance.allow(&self.by_trace(&own(&|row| per_run * stronger[row])));
        }
        covariance
    }
}
