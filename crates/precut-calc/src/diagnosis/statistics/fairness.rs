//! Whether a set fits: what it leaves, against the scatter (`diagnosis/3.7`).

use statrs::distribution::{ChiSquared, ContinuousCDF, FisherSnedecor};

use crate::diagnosis::rows::noise::{Noise, NoiseSource};
use crate::diagnosis::statistics::evidence::Normal;
use crate::diagnosis::statistics::whiten::White;

/// What a set leaves of the rows without its priors.
pub(in crate::diagnosis) struct Left<'a> {
    /// Whitened columns of its fitted values.
    pub(in crate::diagnosis) columns: Vec<&'a White>,
    /// What they are to explain.
    pub(in crate::diagnosis) residual: &'a White,
    /// Number of rows that count.
    pub(in crate::diagnosis) rows: f64,
    /// Scatter of the rows.
    pub(in crate::diagnosis) noise: &'a Noise,
}

impl Left<'_> {
    /// Probability that so much or more is left if nothing else acts: the lesser one of all that is left and of what goes
    /// with `low_order`, the whitened regressors of an unordered design, doubled where both are asked, so that it is below a
    /// level by chance no more often than that (Bonferroni). `None` where the scatter was found from all of it.
    ///
    /// What is missing most often goes smoothly with the conditions: among a few directions a test sees what it
    /// misses among many.
    pub(in crate::diagnosis) fn probability(&self, low_order: &[White]) -> Option<f64> {
        let alone = Normal::of(&self.columns, self.residual);
        let misfit = alone.misfit();
        match (self.of_all(misfit), self.of_low_order(misfit, alone.rank(), low_order)) {
            (Some(all), Some(low_order)) => Some((2.0 * all.min(low_order)).min(1.0)),
            (one, other) => one.or(other),
        }
    }

    /// Of what is left that part which the scatter was not found from.
    fn of_all(&self, misfit: f64) -> Option<f64> {
        let free = self.rows - self.columns.len() as f64;
        match self.noise.source {
            NoiseSource::Stated { .. } => self.tail(misfit, free),
            _ => self.tail((misfit - self.noise.dof).max(0.0), free - self.noise.dof),
        }
    }

    /// What the regressors explain beyond the set.
    fn of_low_order(&self, misfit: f64, rank: usize, low_order: &[White]) -> Option<f64> {
        let with: Vec<&White> = self.columns.iter().copied().chain(low_order).collect();
        let with = Normal::of(&with, self.residual);
        let directions = with.rank().saturating_sub(rank);
        self.tail((misfit - with.misfit()).max(0.0), directions as f64)
    }

    /// Probability of a larger sum of squares over so many directions.
    fn tail(&self, sum: f64, directions: f64) -> Option<f64> {
        if directions < 1.0 {
            return None;
        }
        if let NoiseSource::Stated { scatter_factor } = self.noise.source {
            // Where the rows scatter more than was stated that is what is said; shape is judged by their own scatter.
            return Some(ChiSquared::new(directions).ok()?.sf(sum / scatter_factor.max(1.0).powi(2)));
        }
        Some(FisherSnedecor::new(directions, self.noise.dof).ok()?.sf(sum / directions))
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    /// The k-th of twenty directions.
    fn along(k: usize, length: f64) -> White {
        White::plain((0..20).map(|row| if row == k { length } else { 0.0 }).collect())
    }

    /// What is missing lies in one of two directions that the set leaves; of two each tail has a closed form.
    fn probability(source: NoiseSource, dof: f64) -> (f64, f64) {
        let (cause, missing) = (along(1, 3.0), along(0, 4.0));
        let noise = Noise { sigma: 1.0, per_row: None, rho: 0.0, dof, source };
        let left = Left { columns: vec![&cause], residual: &missing, rows: 20.0, noise: &noise };
        // One lies in the set and one is there twice: neither is a direction more.
        let low_order = [along(0, 0.1), along(1, 7.0), along(2, 1.0), along(0, 5.0)];
        (left.probability(&low_order).unwrap(), left.probability(&[]).unwrap_or(1.0))
    }

    #[test]
    fn of_stated_scatter_the_tail_is_that_of_chi_squared() {
        let (few, many) = probability(NoiseSource::Stated { scatter_factor: 1.0 }, f64::INFINITY);
        assert!((few / (2.0 * (-8.0_f64).exp()) - 1.0).abs() < 1e-9, "{few}");
        assert!((many - ChiSquared::new(19.0).unwrap().sf(16.0)).abs() < 1e-12 && many > 0.6, "{many}");
        // Rows that scatter twice as far as was stated: the same four are two.
        let (few, _) = probability(NoiseSource::Stated { scatter_factor: 2.0 }, f64::INFINITY);
        assert!((few / (2.0 * (-2.0_f64).exp()) - 1.0).abs() < 1e-9, "{few}");
    }

    #[test]
    fn of_scatter_from_repeats_the_tail_is_that_of_f() {
        let nu = 12.0;
        let (few, many) = probability(NoiseSource::Repeats, nu);
        assert!((few / (2.0 * (1.0 + 16.0 / nu).powf(-nu / 2.0)) - 1.0).abs() < 1e-9, "{few}");
        // Of sixteen that are left twelve are the scatter's own.
        assert!((many - FisherSnedecor::new(7.0, nu).unwrap().sf(4.0 / 7.0)).abs() < 1e-12, "{many}");
    }
}
