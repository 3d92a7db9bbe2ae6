//! Resampling with a named generator.

use rand::Rng;
use rand_pcg::Pcg64;

/// Name of the generator, for answers: with the same seed the same draws, for ever.
pub const GENERATOR: &str = "pcg64 (XSL RR 128/64), Lemire's multiplication without rejection";

/// Draws with replacement. Every resample has a stream of its own, so that their order does not matter.
#[derive(Debug, Clone)]
pub struct Resampler {
    generator: Pcg64,
}

impl Resampler {
    /// The generator of resample `index` under `seed`.
    pub fn new(seed: u64, index: u64) -> Self {
        Self { generator: Pcg64::new(u128::from(seed), u128::from(index)) }
    }

    /// A whole number below `count`; bias below `count`/2^64.
    pub fn below(&mut self, count: usize) -> usize {
        let wide = u128::from(self.generator.next_u64()) * count as u128;
        usize::try_from(wide >> 64).unwrap_or(0)
    }

    /// A number in [0, 1) with 53 random bits.
    pub fn uniform(&mut self) -> f64 {
        (self.generator.next_u64() >> 11) as f64 / (1_u64 << 53) as f64
    }

    /// A standard normal number (Box and Muller).
    pub fn normal(&mut self) -> f64 {
        let radius = (-2.0 * (1.0 - self.uniform()).ln()).sqrt();
        radius * (2.0 * std::f64::consts::PI * self.uniform()).cos()
    }

    /// `count` indices below `count`, with replacement.
    pub fn indices(&mut self, count: usize) -> Vec<usize> {
        (0..count).map(|_| self.below(count)).collect()
    }
}

/// The value below which a share `p` of ascending numbers lies, interpolated (definition 7 of Hyndman and Fan).
pub fn quantile(ascending: &[f64], p: f64) -> Option<f64> {
    let last = ascending.len().checked_sub(1)?;
    let place = p.clamp(0.0, 1.0) * last as f64;
    // Between 0 and the length of a slice.
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    let below = (place.floor() as usize).min(last);
    let above = (below + 1).min(last);
    Some(ascending[below] + (place - below as f64) * (ascending[above] - ascending[below]))
}

/// The middle share `level` of samples; what is not finite is left out.
pub fn percentile_interval(samples: &[f64], level: f64) -> Option<(f64, f64)> {
    let mut ascending: Vec<f64> = samples.iter().copied().filter(|s| s.is_finite()).collect();
    ascending.sort_by(f64::total_cmp);
    let tail = 0.5 * (1.0 - level);
    Some((quantile(&ascending, tail)?, quantile(&ascending, 1.0 - tail)?))
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    #[test]
    fn draws_are_those_of_the_seed() {
        let draw = |seed, index| Resampler::new(seed, index).indices(1000);
        assert_eq!(draw(1, 0), draw(1, 0));
        assert_ne!(draw(1, 0), draw(1, 1));
        assert_ne!(draw(1, 0), draw(2, 0));
        assert!(draw(3, 4).iter().all(|i| *i < 1000));
        // Mean of 1000 numbers uniform on 0..999: 499.5 with standard deviation 9.1; five of them.
        let mean = draw(5, 6).iter().sum::<usize>() as f64 / 1000.0;
        assert!((mean - 499.5).abs() < 46.0, "{mean}");
    }

    #[test]
    fn normal_numbers_have_their_moments() {
        let mut resampler = Resampler::new(7, 0);
        let draws: Vec<f64> = (0..20_000).map(|_| resampler.normal()).collect();
        let mean = draws.iter().sum::<f64>() / 20_000.0;
        let variance = draws.iter().map(|x| x * x).sum::<f64>() / 20_000.0;
        // Standard deviations 0.007 and 0.01; five of them.
        assert!(mean.abs() < 0.036 && (variance - 1.0).abs() < 0.05, "{mean} {variance}");
    }

    #[test]
    fn quantiles_interpolate() {
        assert_eq!(quantile(&[1.0, 2.0, 4.0], 0.75), Some(3.0));
        assert_eq!(quantile(&[], 0.5), None);
        let (low, high) = percentile_interval(&(0..=100).map(f64::from).collect::<Vec<_>>(), 0.9).unwrap();
        assert!((low - 5.0).abs() < 1e-12 && (high - 95.0).abs() < 1e-12);
    }
}
