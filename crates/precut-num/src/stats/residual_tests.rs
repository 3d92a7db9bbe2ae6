//! Tests of what is left over.

use super::distributions::{chi_squared_tail, f_tail, normal_tail};
use super::linear::{Linear, regress};
use crate::dense::Columns;

/// A statistic and how probable it is to be that large or larger by chance.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Test {
    /// The statistic.
    pub statistic: f64,
    /// Degrees of freedom: of the numerator, or the only one.
    pub degrees: f64,
    /// Degrees of freedom of the denominator, where there is one.
    pub degrees_below: Option<f64>,
    /// Probability.
    pub p_value: f64,
}

/// Lack of fit against the pure error of repeats: F = [SS_lof/(c - p)] / [SS_pe/(n - c)]. `groups` holds the rows of
/// each distinct condition. `None` without repeats or without conditions to spare; pure error 0 gives p = 0.
pub fn lack_of_fit(fit: &Linear, groups: &[Vec<usize>], y: &[f64]) -> Option<Test> {
    let pure: f64 = groups
        .iter()
        .map(|group| {
            let mean = group.iter().map(|&i| y[i]).sum::<f64>() / group.len().max(1) as f64;
            group.iter().map(|&i| (y[i] - mean) * (y[i] - mean)).sum::<f64>()
        })
        .sum();
    let spare = groups.len().checked_sub(fit.coefficients.len()).filter(|spare| *spare > 0)? as f64;
    let repeats = y.len().checked_sub(groups.len()).filter(|repeats| *repeats > 0)? as f64;
    let lack = (fit.rss - pure).max(0.0);
    let statistic = (lack / spare) / (pure / repeats);
    let statistic = if statistic.is_nan() { 0.0 } else { statistic };
    Some(Test { statistic, degrees: spare, degrees_below: Some(repeats), p_value: f_tail(statistic, spare, repeats) })
}

/// Whether the further columns of a larger fit of the same data earn their place.
pub fn nested_f(smaller: &Linear, larger: &Linear) -> Option<Test> {
    let more = larger.coefficients.len().checked_sub(smaller.coefficients.len()).filter(|more| *more > 0)? as f64;
    let left = larger.degrees_of_freedom as f64;
    if left <= 0.0 {
        return None;
    }
    let statistic = ((smaller.rss - larger.rss).max(0.0) / more) / (larger.rss / left);
    let p_value = f_tail(statistic, more, left);
    Some(Test { statistic, degrees: more, degrees_below: Some(left), p_value })
}

/// Whether the scatter grows with the columns of `by` (Breusch and Pagan, in Koenker's form: n R^2 of the squared
/// residuals on the columns, chi-square). `by` holds a constant first.
pub fn breusch_pagan(residuals: &[f64], by: &Columns) -> Option<Test> {
    let squares: Vec<f64> = residuals.iter().map(|e| e * e).collect();
    let auxiliary = regress(by, &squares).ok()?;
    let mean = squares.iter().sum::<f64>() / squares.len().max(1) as f64;
    let total: f64 = squares.iter().map(|s| (s - mean) * (s - mean)).sum();
    let degrees = by.count().checked_sub(1).filter(|more| *more > 0)? as f64;
    if total <= 0.0 {
        return None;
    }
    let statistic = squares.len() as f64 * (1.0 - auxiliary.rss / total).max(0.0);
    Some(Test { statistic, degrees, degrees_below: None, p_value: chi_squared_tail(statistic, degrees) })
}

/// Whether residuals in their order remember one another (Ljung and Box): Q = n (n + 2) sum r_k^2/(n - k) over `lags`.
pub fn ljung_box(residuals: &[f64], lags: usize) -> Option<Test> {
    let n = residuals.len();
    if lags == 0 || n <= lags + 1 {
        return None;
    }
    let mean = residuals.iter().sum::<f64>() / n as f64;
    let centred: Vec<f64> = residuals.iter().map(|e| e - mean).collect();
    let variance: f64 = centred.iter().map(|e| e * e).sum();
    if variance <= 0.0 {
        return None;
    }
    let sum: f64 = (1..=lags)
        .map(|k| {
            let r = centred[k..].iter().zip(&centred).map(|(a, b)| a * b).sum::<f64>() / variance;
            r * r / (n - k) as f64
        })
        .sum();
    let statistic = n as f64 * (n as f64 + 2.0) * sum;
    let degrees = lags as f64;
    Some(Test { statistic, degrees, degrees_below: None, p_value: chi_squared_tail(statistic, degrees) })
}

/// Whether signs change too seldom or too often (Wald and Wolfowitz), two-sided normal approximation.
pub fn runs_test(residuals: &[f64]) -> Option<Test> {
    let signs: Vec<bool> = residuals.iter().filter(|e| **e != 0.0).map(|e| *e > 0.0).collect();
    let up = signs.iter().filter(|s| **s).count() as f64;
    let down = signs.len() as f64 - up;
    let n = up + down;
    if up < 1.0 || down < 1.0 || n < 3.0 {
        return None;
    }
    let runs = 1.0 + signs.windows(2).filter(|pair| pair[0] != pair[1]).count() as f64;
    let mean = 1.0 + 2.0 * up * down / n;
    let variance = 2.0 * up * down * (2.0 * up * down - n) / (n * n * (n - 1.0));
    if variance <= 0.0 {
        return None;
    }
    let z = (runs - mean) / variance.sqrt();
    let p_value = (2.0 * normal_tail(z.abs())).min(1.0);
    Some(Test { statistic: z, degrees: n, degrees_below: None, p_value })
}

/// Whether numbers are normal, mean and variance unknown (Anderson and Darling, with Stephens' correction and p-values).
pub fn anderson_darling(values: &[f64]) -> Option<Test> {
    let n = values.len() as f64;
    let mean = values.iter().sum::<f64>() / n;
    let sd = (values.iter().map(|x| (x - mean) * (x - mean)).sum::<f64>() / (n - 1.0)).sqrt();
    if values.len() < 8 || !sd.is_finite() || sd <= 0.0 {
        return None;
    }
    let mut z: Vec<f64> = values.iter().map(|x| (x - mean) / sd).collect();
    z.sort_by(f64::total_cmp);
    let sum: f64 = z
        .iter()
        .zip(z.iter().rev())
        .enumerate()
        .map(|(i, (low, high))| (2.0 * i as f64 + 1.0) * (normal_tail(-low).ln() + normal_tail(*high).ln()))
        .sum();
    let a = (-n - sum / n) * (1.0 + 0.75 / n + 2.25 / (n * n));
    // D'Agostino and Stephens, Goodness-of-fit techniques (1986), table 4.9.
    let p_value = if a >= 0.6 {
        (1.2937 - 5.709 * a + 0.0186 * a * a).exp()
    } else if a >= 0.34 {
        (0.9177 - 4.279 * a - 1.38 * a * a).exp()
    } else if a >= 0.2 {
        1.0 - (-8.318 + 42.796 * a - 59.938 * a * a).exp()
    } else {
        1.0 - (-13.436 + 101.14 * a - 223.73 * a * a).exp()
    };
    Some(Test { statistic: a, degrees: n, degrees_below: None, p_value: p_value.clamp(0.0, 1.0) })
}

/// Probabilities of a family of tests, each corrected for the number of looks (Holm), in the same order.
pub fn holm(p_values: &[f64]) -> Vec<f64> {
    let mut order: Vec<usize> = (0..p_values.len()).collect();
    order.sort_by(|&a, &b| p_values[a].total_cmp(&p_values[b]));
    let mut corrected = vec![0.0; p_values.len()];
    let mut least = 0.0_f64;
    for (rank, &index) in order.iter().enumerate() {
        least = least.max(p_values[index] * (p_values.len() - rank) as f64).min(1.0);
        corrected[index] = least;
    }
    corrected
}
