//! What a job will take on this machine: its calculator's own estimate, corrected by what earlier jobs took.

use std::collections::HashMap;
use std::sync::{Mutex, PoisonError};

use crate::store::jobs::Timing;

/// Below so many timings a calculator's estimate stands as it is.
const ENOUGH: f64 = 5.0;
/// Share of the newest timing in the mean.
const WEIGHT: f64 = 0.1;
/// However wrong an estimate was, it is corrected by no more than this factor, up or down: a machine that was once
/// busy shall not turn every short job into a long one.
const MOST: f64 = 20.0;
/// What takes less says nothing: reading and writing dominate.
const LEAST_MS: f64 = 5.0;

/// Mean logarithm of actual over predicted time, and of how many.
#[derive(Debug, Clone, Copy, Default)]
struct Mean {
    logarithm: f64,
    count: f64,
}

/// Corrections by calculator and version.
#[derive(Default)]
pub(crate) struct Estimates(Mutex<HashMap<(String, u32), Mean>>);

impl Estimates {
    /// The estimate on this machine, ms.
    pub(crate) fn corrected(&self, calculator: &str, version: u32, ms: f64) -> f64 {
        let means = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let mean = means.get(&(calculator.to_owned(), version)).copied().unwrap_or_default();
        if mean.count < ENOUGH { ms } else { ms * mean.logarithm.exp() }
    }

    /// Takes a timing in, the oldest first.
    pub(crate) fn learn(&self, timing: &Timing) {
        if timing.predicted_ms < LEAST_MS || timing.actual_ms < LEAST_MS {
            return;
        }
        let logarithm = (timing.actual_ms / timing.predicted_ms).ln().clamp(-MOST.ln(), MOST.ln());
        if !logarithm.is_finite() {
            return;
        }
        let mut means = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let mean = means.entry((timing.calculator.clone(), timing.version)).or_default();
        mean.count += 1.0;
        mean.logarithm += (logarithm - mean.logarithm) * WEIGHT.max(1.0 / mean.count);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn timing(actual_ms: f64) -> Timing {
        Timing { calculator: "a".to_owned(), version: 1, predicted_ms: 100.0, actual_ms }
    }

    #[test]
    fn estimates_follow_what_jobs_took_once_there_are_enough() {
        let estimates = Estimates::default();
        for _ in 0..4 {
            estimates.learn(&timing(300.0));
        }
        assert!((estimates.corrected("a", 1, 10.0) - 10.0).abs() < 1e-12);
        estimates.learn(&timing(300.0));
        // The mean of equal logarithms, to rounding.
        assert!((estimates.corrected("a", 1, 10.0) - 30.0).abs() < 1e-9);
        assert!((estimates.corrected("a", 2, 10.0) - 10.0).abs() < 1e-12, "another version is another calculator");
    }

    #[test]
    fn one_outlier_moves_an_estimate_little_and_none_beyond_the_bound() {
        let estimates = Estimates::default();
        for _ in 0..20 {
            estimates.learn(&timing(100.0));
        }
        estimates.learn(&timing(1e9));
        // exp(0.1 ln 20) = 1.35
        assert!(estimates.corrected("a", 1, 10.0) < 13.6);
        for _ in 0..200 {
            estimates.learn(&timing(1e9));
        }
        assert!(estimates.corrected("a", 1, 10.0) <= 10.0 * MOST * (1.0 + 1e-9));
        estimates.learn(&timing(f64::NAN));
        assert!(estimates.corrected("a", 1, 10.0).is_finite());
    }
}
