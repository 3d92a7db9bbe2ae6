//! Draws by name of their distribution, from one named generator.

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;

/// Everything random in a trial comes from here: one seed, one trial.
#[derive(Debug, Clone)]
pub struct Random(Pcg64);

impl Random {
    /// Of a seed.
    pub fn new(seed: u64) -> Self {
        Self(Pcg64::seed_from_u64(seed))
    }

    /// Uniform in `low..high`.
    pub fn uniform(&mut self, low: f64, high: f64) -> f64 {
        low + (high - low) * self.0.random::<f64>()
    }

    /// Uniform with standard deviation `sd` about 0.
    pub fn uniform_sd(&mut self, sd: f64) -> f64 {
        let half = sd * 3.0_f64.sqrt();
        self.uniform(-half, half)
    }

    /// One of these.
    pub fn pick<T: Copy>(&mut self, from: &[T]) -> T {
        from[self.0.random_range(0..from.len())]
    }

    /// A whole number in `low..=high`.
    pub fn whole(&mut self, low: usize, high: usize) -> usize {
        self.0.random_range(low..=high)
    }

    /// True with this probability.
    pub fn chance(&mut self, probability: f64) -> bool {
        self.0.random::<f64>() < probability
    }

    /// +1 or -1.
    pub fn sign(&mut self) -> f64 {
        if self.chance(0.5) { 1.0 } else { -1.0 }
    }

    /// Standard normal, by the polar method.
    pub fn normal(&mut self) -> f64 {
        loop {
            let (x, y) = (self.uniform(-1.0, 1.0), self.uniform(-1.0, 1.0));
            let square = x * x + y * y;
            if square > 0.0 && square < 1.0 {
                return x * (-2.0 * square.ln() / square).sqrt();
            }
        }
    }

    /// Student's t with six degrees of freedom, scaled to standard deviation 1.
    pub fn student_6(&mut self) -> f64 {
        let chi: f64 = (0..6).map(|_| self.normal().powi(2)).sum();
        // Variance of t with six degrees of freedom: 6/4.
        self.normal() / (chi / 6.0).sqrt() / 1.5_f64.sqrt()
    }
}
