//! Several optima of a set of causes: a cutter swings nearly alike whether a tooth stands out or is worn back.

use statrs::distribution::{ContinuousCDF, Normal, StudentsT};

use crate::calculator::Failure;
use crate::diagnosis::causes::refine::{Fit, Refinement};
use crate::diagnosis::causes::search::{Candidate, Linear};
use crate::diagnosis::causes::subject::Setting;

/// Distance in posterior standard deviations from which on another fit is another optimum.
const APART: f64 = 3.0;
/// Another optimum whose evidence is below that of the best by more than this has no share that an interval would show: 1 in 55.
const COUNTS: f64 = 4.0;
/// The same of a place that is only linearised about; how many of those are looked at, and how many optima are found at most.
const PROMISING: f64 = 8.0;
const LOOKED_AT: usize = 24;
const MOST: usize = 3;
/// Bracket of a quantile, standard deviations, and how often it is halved: to round-off.
const FAR: f64 = 1e3;
const HALVINGS: u32 = 60;

/// A fit beside the best one.
#[derive(Debug, Clone, PartialEq)]
pub(in crate::diagnosis) struct Optimum {
    pub(in crate::diagnosis) settings: Vec<Setting>,
    pub(in crate::diagnosis) standard_deviations: Vec<Vec<f64>>,
    /// Its evidence over that of the best one.
    pub(in crate::diagnosis) odds: f64,
}

impl Optimum {
    pub(in crate::diagnosis) fn beside(best: &Fit, other: &Fit) -> Self {
        Self {
            settings: other.settings.clone(),
            standard_deviations: other.standard_deviations(),
            odds: (other.log_z - best.log_z).exp(),
        }
    }

    /// Where a value of a member lies there.
    pub(in crate::diagnosis) fn peak(&self, member: usize, variable: usize) -> Peak {
        Peak {
            value: self.settings[member].values[variable],
            standard_deviation: self.standard_deviations[member][variable],
            weight: self.odds,
        }
    }
}

/// Optima of a refined set beside the one in `fit`, from the most promising of the other places about which its causes are
/// linearised; those that count, best first.
pub(in crate::diagnosis) fn elsewhere(
    candidate: &Candidate,
    fit: &Fit,
    linear: &Linear<'_>,
    refinement: &Refinement<'_>,
) -> Result<Vec<Fit>, Failure> {
    // What a grid of shapes widens has its other values in that.
    if !fit.with_shapes && !candidate.spread.is_empty() {
        return Ok(Vec::new());
    }
    let mut others: Vec<Fit> = Vec::new();
    for (start, log_z) in linear.starts(&candidate.members).into_iter().take(LOOKED_AT) {
        if log_z < candidate.best_log_z - PROMISING {
            break;
        }
        let is_new = |others: &[Fit], settings: &[Setting]| {
            others.iter().chain([fit]).all(|known| distance(known, settings) > APART)
        };
        if others.len() == MOST || !is_new(&others, &start.settings) {
            continue;
        }
        let found = refinement.fit(start, fit.with_shapes)?;
        others.extend(found.filter(|found| found.settled && is_new(&others, &found.settings)));
    }
    others.sort_by(|a, b| b.log_z.total_cmp(&a.log_z));
    let best = others.first().map_or(fit.log_z, |other| other.log_z.max(fit.log_z));
    others.retain(|other| other.log_z > best - COUNTS);
    Ok(others)
}

/// Largest distance of a fitted value from that of a fit, in its posterior standard deviations.
fn distance(fit: &Fit, settings: &[Setting]) -> f64 {
    fit.free
        .iter()
        .enumerate()
        .map(|(k, &(member, variable))| {
            let moved = settings[member].values[variable] - fit.settings[member].values[variable];
            moved.abs() / fit.covariance[(k, k)].sqrt()
        })
        .fold(0.0, f64::max)
}

/// A value, its posterior standard deviation, and its weight among others.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Peak {
    /// Where it lies, in the unit of the value.
    pub value: f64,
    /// How far it reaches, in the unit of the value.
    pub standard_deviation: f64,
    /// Its share, up to a common factor.
    pub weight: f64,
}

/// The interval that holds `inside` of a mixture of Student distributions.
pub(in crate::diagnosis) fn mixture_interval(peaks: &[Peak], inside: f64, dof: f64) -> [f64; 2] {
    let whole: f64 = peaks.iter().map(|peak| peak.weight).sum();
    let below = |x: f64| -> f64 {
        let of = |peak: &Peak| {
            let t = (x - peak.value) / peak.standard_deviation;
            let share = match StudentsT::new(0.0, 1.0, dof) {
                Ok(student) if dof.is_finite() => student.cdf(t),
                _ => Normal::standard().cdf(t),
            };
            share * peak.weight / whole
        };
        peaks.iter().map(of).sum()
    };
    let reach = |sign: f64| peaks.iter().map(move |peak| peak.value + sign * FAR * peak.standard_deviation);
    let quantile = |wanted: f64| {
        let (mut low, mut high) =
            (reach(-1.0).fold(f64::INFINITY, f64::min), reach(1.0).fold(f64::NEG_INFINITY, f64::max));
        for _ in 0..HALVINGS {
            let middle = f64::midpoint(low, high);
            if below(middle) < wanted {
                low = middle;
            } else {
                high = middle;
            }
        }
        f64::midpoint(low, high)
    };
    [quantile(f64::midpoint(0.0, 1.0 - inside)), quantile(f64::midpoint(1.0, inside))]
}

#[cfg(test)]
mod tests {
    use super::*;

    const PEAK: Peak = Peak { value: 2.0, standard_deviation: 0.5, weight: 1.0 };

    #[test]
    fn one_peak_twice_is_one_peak() {
        let [low, high] = mixture_interval(&[PEAK, Peak { weight: 0.3, ..PEAK }], 0.95, f64::INFINITY);
        assert!((high - 2.0 - 0.5 * 1.959_963_984_540_054).abs() < 1e-9 && (low + high - 4.0).abs() < 1e-9);
    }

    /// Far apart each tail holds its part of its own peak: 0.025 of all is a quarter of a peak that has a tenth.
    #[test]
    fn a_small_peak_far_away_is_held_as_far_as_its_share_asks() {
        let far = |share: f64| Peak { value: -7.0, standard_deviation: 0.1, weight: share / (1.0 - share) };
        let [low, high] = mixture_interval(&[PEAK, far(0.1)], 0.95, f64::INFINITY);
        assert!((low - (-7.0 + 0.1 * Normal::standard().inverse_cdf(0.25))).abs() < 1e-9, "{low}");
        assert!((high - (2.0 + 0.5 * Normal::standard().inverse_cdf(1.0 - 0.025 / 0.9))).abs() < 1e-9, "{high}");
        let [low, _] = mixture_interval(&[PEAK, far(0.02)], 0.95, f64::INFINITY);
        assert!(low > 0.0, "less than what the interval leaves out: {low}");
    }
}
