//! Linear least squares with everything that is to be known of each row and each coefficient.

use super::distributions::t_quantile;
use crate::dense::{Columns, Qr, dot, length, symmetric_eigen};

/// A column is dependent on others when less than this share of its length stands out from them.
const DEPENDENT: f64 = 1e-9;

/// Columns that others can replace: their coefficients have no value.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Deficient {
    /// Columns that depend on one another, each group with the one that stands for the rest left out first.
    pub groups: Vec<Vec<usize>>,
}

/// A regression y = X b + noise.
#[derive(Debug, Clone)]
pub struct Linear {
    /// b.
    pub coefficients: Vec<f64>,
    /// X b.
    pub fitted: Vec<f64>,
    /// y - X b.
    pub residuals: Vec<f64>,
    /// Diagonal of the hat matrix.
    pub leverages: Vec<f64>,
    /// Sum of squared residuals.
    pub rss: f64,
    /// Rows less columns.
    pub degrees_of_freedom: usize,
    /// (X'X)^-1.
    pub inverse_gram: Columns,
    design: Columns,
}

/// Fits y by the columns of `design`; least squares by orthogonal factors, columns scaled to like lengths.
pub fn regress(design: &Columns, y: &[f64]) -> Result<Linear, Deficient> {
    // Scaled by powers of two, which loses nothing.
    let lengths: Vec<f64> = design.lengths().into_iter().map(power_of_two).collect();
    let mut unit = design.clone();
    for (j, length) in lengths.iter().enumerate() {
        for entry in unit.column_mut(j) {
            *entry /= if *length > 0.0 { *length } else { 1.0 };
        }
    }
    let qr = Qr::pivoted(unit.clone());
    let rank = if lengths.contains(&0.0) { 0 } else { qr.rank(DEPENDENT) };
    if rank < design.count() || design.rows() < design.count() {
        return Err(Deficient { groups: dependent(&qr, &lengths) });
    }
    let mut coefficients = qr.solve(y);
    // Refinement, with residuals summed in twice the digits: each step gains 16 digits less those of the condition number.
    for _ in 0..3 {
        let correction = qr.solve(&careful_residuals(&unit, &coefficients, y));
        coefficients.iter_mut().zip(&correction).for_each(|(b, c)| *b += c);
        if length(&correction) <= f64::EPSILON * length(&coefficients) {
            break;
        }
    }
    coefficients.iter_mut().zip(&lengths).for_each(|(b, length)| *b /= length);
    let fitted = design.times(&coefficients);
    let residuals: Vec<f64> = y.iter().zip(&fitted).map(|(y, f)| y - f).collect();
    let mut inverse_gram = qr.inverse_gram();
    for j in 0..design.count() {
        for i in 0..design.count() {
            let entry = inverse_gram.at(i, j) / (lengths[i] * lengths[j]);
            inverse_gram.set(i, j, entry);
        }
    }
    Ok(Linear {
        rss: dot(&residuals, &residuals),
        leverages: qr.leverages(),
        degrees_of_freedom: design.rows() - design.count(),
        coefficients,
        fitted,
        residuals,
        inverse_gram,
        design: design.clone(),
    })
}

/// The power of two next below; 0 stays 0.
fn power_of_two(x: f64) -> f64 {
    if x > 0.0 && x.is_finite() { x.log2().floor().exp2() } else { x }
}

/// y - X b, summed in twice the digits.
fn careful_residuals(design: &Columns, coefficients: &[f64], y: &[f64]) -> Vec<f64> {
    y.iter()
        .enumerate()
        .map(|(i, y)| {
            let terms = coefficients.iter().enumerate().flat_map(|(j, b)| {
                let (product, rest) = exact_product(design.at(i, j), -b);
                [product, rest]
            });
            crate::dense::compensated_sum(std::iter::once(*y).chain(terms))
        })
        .collect()
}

/// a b as a rounded product and its rest (Dekker, Veltkamp).
fn exact_product(a: f64, b: f64) -> (f64, f64) {
    const SPLIT: f64 = 134_217_729.0;
    let halves = |x: f64| {
        let big = SPLIT * x;
        let high = big - (big - x);
        (high, x - high)
    };
    let product = a * b;
    let ((ah, al), (bh, bl)) = (halves(a), halves(b));
    let rest = ((ah * bh - product) + ah * bl + al * bh) + al * bl;
    (product, if rest.is_finite() { rest } else { 0.0 })
}

fn dependent(qr: &Qr, lengths: &[f64]) -> Vec<Vec<usize>> {
    let zero = (0..lengths.len()).filter(|j| lengths[*j] == 0.0).map(|j| vec![j]);
    let rank = qr.rank(DEPENDENT).min(qr.rows());
    let rest = (rank..qr.count()).filter(|k| lengths[qr.order()[*k]] > 0.0).map(|k| {
        let mut shares: Vec<f64> = (0..rank).map(|i| qr.r(i, k)).collect();
        qr.solve_upper(&mut shares);
        let others = shares.iter().enumerate().filter(|(_, share)| share.abs() > 1e-6).map(|(i, _)| qr.order()[i]);
        let mut group: Vec<usize> = std::iter::once(qr.order()[k]).chain(others).collect();
        group[1..].sort_unstable();
        group
    });
    zero.chain(rest).collect()
}

impl Linear {
    /// Standard deviation of the noise; 0 without degrees of freedom.
    pub fn residual_sd(&self) -> f64 {
        if self.degrees_of_freedom == 0 { 0.0 } else { (self.rss / self.degrees_of_freedom as f64).sqrt() }
    }

    /// Standard errors of the coefficients.
    pub fn standard_errors(&self) -> Vec<f64> {
        let sd = self.residual_sd();
        (0..self.coefficients.len()).map(|j| sd * self.inverse_gram.at(j, j).max(0.0).sqrt()).collect()
    }

    /// Half width of an interval, in standard errors.
    pub fn half_width(&self, level: f64) -> f64 {
        t_quantile(0.5 + 0.5 * level, self.degrees_of_freedom as f64)
    }

    /// Value at a row of the design and the standard error of its mean.
    pub fn predict(&self, row: &[f64]) -> (f64, f64) {
        let value = dot(row, &self.coefficients);
        let spread = dot(row, &self.inverse_gram.times(row)).max(0.0);
        (value, self.residual_sd() * spread.sqrt())
    }

    /// Residuals over the noise estimated without the row itself (externally studentised: t distributed with one degree
    /// less); `None` for a row that the fit must pass through.
    pub fn deleted_t(&self) -> Vec<Option<f64>> {
        let degrees = self.degrees_of_freedom as f64;
        self.residuals
            .iter()
            .zip(&self.leverages)
            .map(|(e, h)| {
                let open = 1.0 - h;
                let without = (self.rss - e * e / open) / (degrees - 1.0);
                let t = e / (without * open).sqrt();
                (open > 1e-9 && without > 0.0 && degrees > 1.0).then_some(t)
            })
            .collect()
    }

    /// Cook's distances: how far the coefficients move when the row is left out.
    pub fn cooks_distances(&self) -> Vec<Option<f64>> {
        let (sd, count) = (self.residual_sd(), self.coefficients.len() as f64);
        self.residuals
            .iter()
            .zip(&self.leverages)
            .map(|(e, h)| {
                let open = 1.0 - h;
                let distance = e * e * h / (count * sd * sd * open * open);
                (open > 1e-9 && sd > 0.0).then_some(distance)
            })
            .collect()
    }

    /// The design.
    pub fn design(&self) -> &Columns {
        &self.design
    }
}

/// How far columns can be told apart. The first column, the constant, is taken out of the others.
#[derive(Debug, Clone, PartialEq)]
pub struct Collinearity {
    /// Variance inflation of every column after the first: 1 if it is orthogonal to the others.
    pub inflation: Vec<f64>,
    /// Largest over smallest singular value of the centred columns of unit length.
    pub condition: f64,
}

/// Collinearity of the columns after the first one, which must be the constant. Full rank assumed.
pub fn collinearity(design: &Columns) -> Collinearity {
    let count = design.count().saturating_sub(1);
    let mut centred = Columns::zeros(design.rows(), 0);
    for j in 1..design.count() {
        let column = design.column(j);
        let mean = column.iter().sum::<f64>() / column.len().max(1) as f64;
        let mut shifted: Vec<f64> = column.iter().map(|x| x - mean).collect();
        let size = length(&shifted);
        for x in &mut shifted {
            *x /= size;
        }
        centred.push(&shifted);
    }
    let inverse = Qr::pivoted(centred).inverse_gram();
    let inflation = (0..count).map(|j| inverse.at(j, j)).collect();
    let (values, _) = symmetric_eigen(&inverse);
    let condition = match (values.first(), values.last()) {
        (Some(least), Some(most)) if *least > 0.0 => (most / least).sqrt(),
        _ => 1.0,
    };
    Collinearity { inflation, condition }
}
