//! An observer who knows what every cause would look like and how rows scatter, but not which one acts: what no diagnosis
//! can surpass by much.

/// Correlation of neighbours in a sweep: that of a moving average with a coefficient of 0.2.
pub(crate) const NEIGHBOURS: f64 = 0.2 / 1.04;

/// What a cause would change in every row.
pub(crate) struct Expected {
    pub(crate) kind: &'static str,
    /// Whether its size may be negative.
    pub(crate) two_sided: bool,
    pub(crate) signature: Vec<f64>,
}

/// Covariance of the rows as an inner product a' C^-1 b: scatter, and what may be off without being a finding.
pub(crate) struct Covariance {
    sigma: f64,
    correlation: f64,
    /// Rows of a sweep.
    sweep: usize,
    /// By Sherman and Morrison, one allowance after the other: C_k^-1 = C_(k-1)^-1 - u u'/d.
    allowed: Vec<(Vec<f64>, f64)>,
}

impl Covariance {
    /// Rows come sweep by sweep, all equally long.
    pub(crate) fn new(sigma: f64, correlation: f64, sweep: usize) -> Self {
        Self { sigma, correlation, sweep, allowed: Vec::new() }
    }

    /// Adds what one standard deviation of an allowance does to every row.
    pub(crate) fn allow(&mut self, column: &[f64]) {
        let white = self.white(column);
        let u = self.solved(&white);
        let d = 1.0 + dot(&white, &u);
        self.allowed.push((u, d));
    }

    /// Rows without correlation, in units of the scatter: L x = a with the Cholesky factor of a band of three.
    fn white(&self, column: &[f64]) -> Vec<f64> {
        let mut white = Vec::with_capacity(column.len());
        for sweep in column.chunks(self.sweep) {
            let (mut diagonal, mut before) = (1.0, 0.0);
            for (row, value) in sweep.iter().enumerate() {
                let below = if row == 0 { 0.0 } else { self.correlation / diagonal };
                diagonal = (1.0 - below * below).sqrt();
                before = (value / self.sigma - below * before) / diagonal;
                white.push(before);
            }
        }
        white
    }

    fn solved(&self, white: &[f64]) -> Vec<f64> {
        let mut solved = white.to_vec();
        for (u, d) in &self.allowed {
            let share = dot(u, white) / d;
            solved.iter_mut().zip(u).for_each(|(s, u)| *s -= share * u);
        }
        solved
    }

    fn inner(&self, a: &[f64], b: &[f64]) -> f64 {
        dot(&self.white(a), &self.solved(&self.white(b)))
    }

    /// The cause whose signature matches best what was measured beside the base.
    pub(crate) fn best(&self, measured: &[f64], expected: &[Expected]) -> Option<&'static str> {
        let matched = |one: &Expected| {
            let along = self.inner(&one.signature, measured);
            let length = self.inner(&one.signature, &one.signature).max(f64::MIN_POSITIVE).sqrt();
            (if one.two_sided { along.abs() } else { along }) / length
        };
        expected.iter().max_by(|a, b| matched(a).total_cmp(&matched(b))).map(|one| one.kind)
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// C of two sweeps of two rows, written out, times what its inverse gives.
    #[test]
    fn the_inner_product_is_that_of_the_inverse_covariance() {
        let (sigma, correlation) = (1.5, 0.3);
        let allowances = [[0.7, 0.7, 0.0, 0.0], [0.2, -0.4, 0.9, 1.1]];
        let mut covariance = Covariance::new(sigma, correlation, 2);
        for column in &allowances {
            covariance.allow(column);
        }
        let c = |i: usize, j: usize| {
            let own = match (i == j, i / 2 == j / 2) {
                (true, _) => 1.0,
                (false, true) => correlation,
                _ => 0.0,
            };
            sigma * sigma * own + allowances.iter().map(|column| column[i] * column[j]).sum::<f64>()
        };
        let unit = |i: usize| -> Vec<f64> { (0..4).map(|k| if k == i { 1.0 } else { 0.0 }).collect() };
        for i in 0..4 {
            for j in 0..4 {
                let product: f64 = (0..4).map(|k| c(i, k) * covariance.inner(&unit(k), &unit(j))).sum();
                let expected = f64::from(u8::from(i == j));
                assert!((product - expected).abs() < 1e-12, "{i} {j}: {product}");
            }
        }
    }
}
