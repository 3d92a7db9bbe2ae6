//! Chance with a fixed seed.

use std::time::Duration;

/// A small generator (Knuth's multiplier, the upper bits): the same numbers in every run.
pub struct Dice(u64);

impl Dice {
    pub fn new(seed: u64) -> Self {
        Self(seed)
    }

    /// A number below `end`.
    pub fn below(&mut self, end: u64) -> u64 {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        (self.0 >> 33) % end
    }

    /// A time between two, in milliseconds.
    pub fn time(&mut self, from_ms: u64, to_ms: u64) -> Duration {
        Duration::from_millis(from_ms + self.below(to_ms - from_ms))
    }
}

/// How many times as long the tests shall be: 1 in the ordinary run.
pub fn scale() -> usize {
    std::env::var("PRECUT_RELIABILITY").ok().and_then(|text| text.parse().ok()).unwrap_or(1)
}
