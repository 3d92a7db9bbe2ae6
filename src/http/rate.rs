//! How much one client may ask: a token bucket each.

use std::collections::HashMap;
use std::hash::{BuildHasher, RandomState};
use std::sync::Mutex;
use std::time::{Duration, Instant};

/// So many clients are remembered; beyond, those that have asked for nothing lately are forgotten.
const MOST_CLIENTS: usize = 65_536;

/// Buckets of tokens, one per client: each request takes one, they refill at a steady rate.
pub(super) struct RateLimiter {
    per_second: f64,
    burst: f64,
    hasher: RandomState,
    buckets: Mutex<HashMap<u64, Bucket>>,
}

struct Bucket {
    tokens: f64,
    at: Instant,
}

impl RateLimiter {
    /// `None` if the rate is 0: no limit.
    pub(super) fn new(per_second: f64, burst: f64) -> Option<Self> {
        (per_second > 0.0).then(|| Self { per_second, burst, hasher: RandomState::new(), buckets: Mutex::default() })
    }

    /// Takes a token of the client; `Err` says when there will be one.
    pub(super) fn take(&self, client: impl std::hash::Hash, now: Instant) -> Result<(), Duration> {
        // A keyed hash instead of the client itself: fixed size, and nobody can aim at another's bucket.
        let client = self.hasher.hash_one(client);
        let mut buckets = self.buckets.lock().unwrap_or_else(std::sync::PoisonError::into_inner);
        if buckets.len() >= MOST_CLIENTS && !buckets.contains_key(&client) {
            buckets.retain(|_, bucket| self.filled(bucket, now) < self.burst);
            if buckets.len() >= MOST_CLIENTS {
                buckets.clear();
            }
        }
        let bucket = buckets.entry(client).or_insert(Bucket { tokens: self.burst, at: now });
        bucket.tokens = self.filled(bucket, now);
        bucket.at = now;
        if bucket.tokens >= 1.0 {
            bucket.tokens -= 1.0;
            Ok(())
        } else {
            Err(Duration::from_secs_f64((1.0 - bucket.tokens) / self.per_second))
        }
    }

    fn filled(&self, bucket: &Bucket, now: Instant) -> f64 {
        let idle_s = now.saturating_duration_since(bucket.at).as_secs_f64();
        (bucket.tokens + idle_s * self.per_second).min(self.burst)
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    #[test]
    fn a_burst_passes_then_the_rate_holds() {
        let limiter = RateLimiter::new(2.0, 3.0).unwrap();
        let start = Instant::now();
        for _ in 0..3 {
            limiter.take("a", start).unwrap();
        }
        let wait = limiter.take("a", start).unwrap_err();
        assert!((wait.as_secs_f64() - 0.5).abs() < 1e-9, "{wait:?}");
        limiter.take("b", start).unwrap();
        limiter.take("a", start + wait).unwrap();
        limiter.take("a", start + wait).unwrap_err();
        // However long it was idle, no more than a burst.
        let later = start + Duration::from_hours(1);
        assert_eq!((0..10).filter(|_| limiter.take("a", later).is_ok()).count(), 3);
    }

    #[test]
    fn a_rate_of_zero_is_no_limit() {
        assert!(RateLimiter::new(0.0, 1.0).is_none());
    }

    #[test]
    fn memory_is_bounded() {
        let limiter = RateLimiter::new(1.0, 2.0).unwrap();
        let now = Instant::now();
        for client in 0..MOST_CLIENTS + 10 {
            limiter.take(client, now).unwrap();
        }
        assert!(limiter.buckets.lock().unwrap().len() <= MOST_CLIENTS);
    }
}
