//! How probable a class is at a margin: Student's t with five degrees of freedom and unit variance (`diagnosis/3.11`).
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

/// ln F(z), z in standard deviations of the scatter, positive on the side of the class.
pub(in crate::diagnosis) fn log_probability(z: f64) -> f64 {
    cumulative(UNIT * z).ln()
}

/// d ln F/dz and minus its second derivative; where the tail makes that negative, 0.
pub(in crate::diagnosis) fn derivatives(z: f64) -> (f64, f64) {
    let t = UNIT * z;
    let ratio = density(t) / cumulative(t);
    let falling = 6.0 * t / (DEGREES + t * t);
    (UNIT * ratio, (UNIT * UNIT * ratio * (ratio + falling)).max(0.0))
}

/// Fisher's information of a class on its margin, in units of its scatter: f^2/(F (1 - F)).
pub(in crate::diagnosis) fn information(z: f64) -> f64 {
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
}
