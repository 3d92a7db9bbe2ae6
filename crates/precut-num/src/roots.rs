//! Roots of a polynomial, all at once, by the derivative of its logarithm alone.

use nalgebra::Complex;

/// Steps at most, and how near is enough of the size of a root.
const STEPS: u32 = 60;
const NEAR: f64 = 1e-11;
/// The size of a root counts as this at least: roots are to be scaled to about 1.
const LEAST: f64 = 1e-3;

/// Moves starts to the roots (Aberth). `log_slope` is P'/P, `None` at a root that is met. Starts that lie symmetrically about an
/// axis, or on one another, stay so.
pub fn aberth(at: &mut [Complex<f64>], log_slope: impl Fn(Complex<f64>) -> Option<Complex<f64>>) {
    for _ in 0..STEPS {
        let mut moved: f64 = 0.0;
        for i in 0..at.len() {
            let Some(mut away) = log_slope(at[i]) else { continue };
            for j in 0..at.len() {
                let apart = at[i] - at[j];
                if j != i && apart.norm_sqr() > 0.0 {
                    away -= apart.inv();
                }
            }
            let step = away.inv();
            if step.re.is_finite() && step.im.is_finite() {
                at[i] -= step;
                moved = moved.max(step.norm() / at[i].norm().max(LEAST));
            }
        }
        if moved < NEAR {
            break;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Roots of a product of known factors.
    #[test]
    fn roots_of_known_factors_are_found() {
        let known = [(0.3, 0.9), (-0.2, 0.5), (-0.7, -0.1), (0.3, -0.9)].map(|(re, im)| Complex::new(re, im));
        let log_slope = |s: Complex<f64>| {
            let met = known.iter().any(|root| (s - root).norm_sqr() <= 0.0);
            (!met).then(|| known.iter().map(|root| (s - root).inv()).sum())
        };
        let mut at: Vec<Complex<f64>> = (0..4).map(|k| Complex::from_polar(0.9, 0.4 + 1.5 * f64::from(k))).collect();
        aberth(&mut at, log_slope);
        for root in known {
            let nearest = at.iter().map(|one| (one - root).norm()).fold(f64::INFINITY, f64::min);
            assert!(nearest < 1e-12, "{root}: {at:?}");
        }
    }
}
