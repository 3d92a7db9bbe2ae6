//! Tails and quantiles of the distributions that tests need. A shape that makes no sense gives NaN.

use statrs::distribution::{ChiSquared, Continuous, ContinuousCDF, FisherSnedecor, Normal, StudentsT};

/// P(|T| > |t|) of Student's t with `degrees` degrees of freedom.
pub fn t_two_sided(t: f64, degrees: f64) -> f64 {
    StudentsT::new(0.0, 1.0, degrees).map_or(f64::NAN, |law| (2.0 * law.cdf(-t.abs())).min(1.0))
}

/// The t below which a share `p` of Student's distribution lies.
pub fn t_quantile(p: f64, degrees: f64) -> f64 {
    let Ok(law) = StudentsT::new(0.0, 1.0, degrees) else { return f64::NAN };
    // From the smaller tail, which keeps its digits.
    let tail = p.min(1.0 - p);
    let magnitude = -refined(law.inverse_cdf(tail), tail, |x| law.cdf(x), |x| law.pdf(x));
    if p < 0.5 { -magnitude } else { magnitude }
}

/// P(F > f) of Fisher's F.
pub fn f_tail(f: f64, numerator: f64, denominator: f64) -> f64 {
    if f.is_infinite() && f > 0.0 {
        return 0.0;
    }
    FisherSnedecor::new(numerator, denominator).map_or(f64::NAN, |law| law.sf(f.max(0.0)))
}

/// The F below which a share `p` of Fisher's distribution lies.
pub fn f_quantile(p: f64, numerator: f64, denominator: f64) -> f64 {
    let Ok(law) = FisherSnedecor::new(numerator, denominator) else { return f64::NAN };
    refined(law.inverse_cdf(p), p, |x| law.cdf(x), |x| law.pdf(x))
}

/// P(X > x) of chi-square.
pub fn chi_squared_tail(x: f64, degrees: f64) -> f64 {
    ChiSquared::new(degrees).map_or(f64::NAN, |law| law.sf(x.max(0.0)))
}

/// The x below which a share `p` of chi-square lies.
pub fn chi_squared_quantile(p: f64, degrees: f64) -> f64 {
    let Ok(law) = ChiSquared::new(degrees) else { return f64::NAN };
    refined(law.inverse_cdf(p), p, |x| law.cdf(x), |x| law.pdf(x))
}

/// P(Z > z) of the standard normal.
pub fn normal_tail(z: f64) -> f64 {
    Normal::standard().sf(z)
}

/// Newton steps on a quantile: the library's searches stop at some 1e-8.
fn refined(start: f64, p: f64, cdf: impl Fn(f64) -> f64, pdf: impl Fn(f64) -> f64) -> f64 {
    let mut x = start;
    for _ in 0..4 {
        let step = (cdf(x) - p) / pdf(x);
        if !step.is_finite() || step.abs() > 0.1 * x.abs().max(1.0) {
            break;
        }
        x -= step;
    }
    x
}

#[cfg(test)]
mod tests {
    use super::*;

    fn near(value: f64, expected: f64) {
        // The tables print so many digits.
        assert!((value - expected).abs() < 6e-4 * expected.abs().max(1e-3), "{value} {expected}");
    }

    #[test]
    fn quantiles_are_those_of_the_tables() {
        near(t_quantile(0.975, 1.0), 12.706);
        near(t_quantile(0.975, 10.0), 2.2281);
        near(t_quantile(0.995, 3.0), 5.8409);
        near(t_quantile(0.025, 10.0), -2.2281);
        near(f_quantile(0.95, 3.0, 7.0), 4.3468);
        near(chi_squared_quantile(0.95, 4.0), 9.4877);
        near(f_tail(4.3468, 3.0, 7.0), 0.05);
        near(chi_squared_tail(9.4877, 4.0), 0.05);
        near(normal_tail(1.959_964), 0.025);
    }

    #[test]
    fn closed_forms_hold_to_many_digits() {
        // Two degrees: t = (2p - 1) sqrt(2/(1 - (2p - 1)^2)); two and m: P(F > f) = (1 + 2 f/m)^(-m/2).
        for p in [0.51, 0.9, 0.999, 0.999_999] {
            let a: f64 = 2.0 * p - 1.0;
            let exact = a * (2.0 / (1.0 - a * a)).sqrt();
            assert!((t_quantile(p, 2.0) / exact - 1.0).abs() < 1e-10, "{p}");
        }
        for (f, m) in [(0.3_f64, 5.0_f64), (2.0, 9.0), (30.0, 40.0)] {
            let exact = (1.0 + 2.0 * f / m).powf(-m / 2.0);
            assert!((f_tail(f, 2.0, m) / exact - 1.0).abs() < 1e-10, "{f} {m}");
        }
        assert!((chi_squared_tail(7.0, 2.0) / (-3.5_f64).exp() - 1.0).abs() < 1e-12);
        assert!(t_quantile(0.9, -1.0).is_nan());
    }
}
