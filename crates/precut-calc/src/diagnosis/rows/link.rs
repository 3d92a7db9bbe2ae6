//! How probable a class is at a margin: Student's t with five degrees of freedom and unit variance (`diagnosis/3.11`). A row beside
//! classes that was measured to stand at zero, as a frequency that was heard, scatters about it as a Gaussian: its side is 0. One in twenty
//! may be another one than is meant, anywhere: beyond some four standard deviations such a row says no more.
//!
//! Cuts scatter with heavy tails, and a class says nothing of how far beyond the boundary its cut went: under a normal
//! distribution a single cut four standard deviations on the wrong side outweighs thirty others, and names a cause.

use std::f64::consts::{FRAC_1_PI, PI};

/// Degrees of freedom of the scatter, as of values with too many outliers (`diagnosis/3.1`).
const DEGREES: f64 = 5.0;
/// t of a value that is one standard deviation: the variance of t is 5/3.
const UNIT: f64 = 1.290_994_448_735_805_6;
/// Below this t the closed form loses the tail to round-off, and its series in 1/t^2 is exact to 3e-8.
const FAR: f64 = -60.0;

/// Share of values that are others than is meant, and their density over that of the others at its top: spread over a factor of e, with
/// a scatter of 1 %.
const OTHERS: f64 = 0.05;
const OTHER_DENSITY: f64 = 1e-3;
/// That factor in standard deviations.
const OTHERS_SPREAD: f64 = 100.0;

/// Whether a row is no class, but was measured to stand at zero.
pub(in crate::diagnosis) fn is_value(side: f64) -> bool {
    side.abs() < 0.5
}

/// ln of the probability of what was seen at a margin in standard deviations of its scatter; of a value up to the constant of its
/// density.
pub(in crate::diagnosis) fn log_likelihood(side: f64, margin: f64) -> f64 {
    if is_value(side) { (as_meant(margin) + OTHER_DENSITY).ln() } else { log_probability(side * margin) }
}

fn as_meant(margin: f64) -> f64 {
    (-0.5 * margin * margin).exp()
}

/// Where a value stands that is drawn as values scatter, in standard deviations, from one normal and one uniform number: about zero, or
/// anywhere within a factor of e.
pub(in crate::diagnosis) fn drawn_value(normal: f64, uniform: f64) -> f64 {
    if uniform < OTHERS { OTHERS_SPREAD * (uniform / OTHERS - 0.5) } else { normal }
}

/// Slope of [`log_likelihood`] over the margin, and minus its second derivative; where the tail of a class makes that negative, 0.
pub(in crate::diagnosis) fn bend(side: f64, margin: f64) -> (f64, f64) {
    if is_value(side) {
        let meant = as_meant(margin);
        let share = meant / (meant + OTHER_DENSITY);
        return (-margin * share, (share * (1.0 - margin * margin * (1.0 - share))).max(0.0));
    }
    let (slope, weight) = derivatives(side * margin);
    (side * slope, weight)
}

/// Fisher's information of a row on its margin, in units of its scatter.
pub(in crate::diagnosis) fn told(side: f64, margin: f64) -> f64 {
    if is_value(side) { 1.0 } else { information(margin) }
}

/// ln F(z), z in standard deviations of the scatter, positive on the side of the class.
pub(in crate::diagnosis) fn log_probability(z: f64) -> f64 {
    cumulative(UNIT * z).ln()
}

/// d ln F/dz and minus its second derivative; where the tail makes that negative, 0.
fn derivatives(z: f64) -> (f64, f64) {
    let t = UNIT * z;
    let ratio = density(t) / cumulative(t);
    let falling = 6.0 * t / (DEGREES + t * t);
    (UNIT * ratio, (UNIT * UNIT * ratio * (ratio + falling)).max(0.0))
}

/// Fisher's information of a class on its margin, in units of its scatter: f^2/(F (1 - F)).
fn information(z: f64) -> f64 {
    let t = UNIT * z;
    (UNIT * density(t)).powi(2) / (cumulative(t) * cumulative(-t))
}

/// 8/(3 pi sqrt 5) (1 + t^2/5)^-3.
fn density(t: f64) -> f64 {
    8.0 / (3.0 * PI * DEGREES.sqrt()) * (1.0 + t * t / DEGREES).powi(-3)
}

/// F(t) = 1/2 + (theta + sin theta cos theta (1 + 2/3 cos^2 theta))/pi, tan theta = t/sqrt 5.
fn cumulative(t: f64) -> f64 {
    if t < FAR {
        let w = 1.0 / (t * t);
        let tail = 125.0 * t.abs().powi(-5) * (0.2 - w * (15.0 / 7.0 - w * 150.0 / 9.0));
        return 8.0 / (3.0 * PI * DEGREES.sqrt()) * tail;
    }
    let theta = (t / DEGREES.sqrt()).atan();
    let (sin, cos) = theta.sin_cos();
    0.5 + FRAC_1_PI * (theta + sin * cos * (1.0 + 2.0 / 3.0 * cos * cos))
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use statrs::distribution::{ContinuousCDF, StudentsT};

    #[test]
    fn it_is_students_distribution() {
        let student = StudentsT::new(0.0, 1.0, DEGREES).unwrap();
        for t in [-40.0, -7.5, -2.0, -0.3, 0.0, 0.8, 3.0, 12.0] {
            let expected = student.cdf(t);
            assert!((log_probability(t / UNIT) - expected.ln()).abs() < 1e-8, "{t}");
        }
        assert!((UNIT * UNIT - 5.0 / 3.0).abs() < 1e-15);
    }

    #[test]
    fn the_tail_goes_on_where_the_closed_form_ends() {
        let [before, after] = [FAR + 1e-9, FAR - 1e-9].map(cumulative);
        assert!((before / after - 1.0).abs() < 1e-7, "{before} {after}");
        assert!((cumulative(-1e6) / cumulative(-1e5) - 1e-5).abs() < 1e-12);
    }

    #[test]
    fn slopes_are_those_of_the_logarithm() {
        let h = 1e-4;
        for z in [-3.0, -1.0, 0.0, 0.5, 2.0] {
            let [low, here, high] = [z - h, z, z + h].map(log_probability);
            let (slope, weight) = derivatives(z);
            assert!((slope - (high - low) / (2.0 * h)).abs() < 1e-7, "{z}");
            let second = (high - 2.0 * here + low) / (h * h);
            assert!((weight - (-second).max(0.0)).abs() < 1e-6, "{z}: {weight} {second}");
        }
        assert!(derivatives(-50.0).1 <= 0.0);
        assert!((information(0.0) - 4.0 * (UNIT * density(0.0)).powi(2)).abs() < 1e-12);
    }

    #[test]
    fn a_value_is_a_gaussian_within_some_deviations_and_a_class_its_side() {
        for margin in [-5.0, -2.0, 0.0, 0.7, 3.5] {
            let [low, here, high] = [margin - 1e-4, margin, margin + 1e-4].map(|m| log_likelihood(0.0, m));
            let (slope, weight) = bend(0.0, margin);
            // The third derivative of a logarithm whose terms bend by up to a few units, times the square of the step.
            assert!((slope - (high - low) / 2e-4).abs() < 1e-6, "{margin}");
            // Round-off of a difference of order 1e-8.
            let second = (high - 2.0 * here + low) / 1e-8;
            assert!((weight - (-second).max(0.0)).abs() < 1e-5, "{margin}: {weight} {second}");
            assert!((log_likelihood(-1.0, margin) - log_probability(-margin)).abs() < 1e-15);
            assert!((bend(-1.0, margin).0 + derivatives(-margin).0).abs() < 1e-15);
        }
        // A thousandth at the top of the density, all of it far away.
        assert!(
            (log_likelihood(0.0, 1.0) + 0.5).abs() < 2e-3
                && (log_likelihood(0.0, 1e6) - OTHER_DENSITY.ln()).abs() < 1e-12
        );
        assert!((drawn_value(0.3, 0.9) - 0.3).abs() < 1e-15);
        let [low, high] = [0.0, 0.999_999 * OTHERS].map(|uniform| drawn_value(0.3, uniform));
        assert!((low + 50.0).abs() < 1e-9 && (high - 50.0).abs() < 1e-3, "{low} {high}");
    }
}
