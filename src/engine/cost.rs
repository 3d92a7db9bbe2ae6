//! What a job may cost.

use std::time::Duration;

use precut_calc::calculator::Cost;

use super::{Error, Inner};

impl Inner {
    pub(super) fn afford(&self, cost: Cost) -> Result<(), Error> {
        affordable(cost, self.settings.cost_limit, self.settings.cost_limit_bytes)
    }

    /// Whether an owner may ask for so much work in an hour at all.
    pub(super) fn afford_at_all(&self, cost: &Cost, estimate_ms: f64) -> Result<(), Error> {
        let (most_ms, limit_bytes) = (self.settings.quota.work_ms, self.settings.cost_limit_bytes);
        match most_ms.filter(|most_ms| estimate_ms > *most_ms) {
            Some(most_ms) => Err(Error::TooExpensive {
                cost: Cost { ms: estimate_ms, ..*cost },
                limit: Duration::from_secs_f64(most_ms / 1e3),
                limit_bytes,
            }),
            None => Ok(()),
        }
    }
}

/// Whether a job may cost so much.
pub(super) fn affordable(cost: Cost, limit: Duration, limit_bytes: u64) -> Result<(), Error> {
    // An estimate that is no number is not below the limit.
    let is_affordable = cost.ms <= limit.as_secs_f64() * 1e3 && cost.bytes <= limit_bytes;
    if is_affordable { Ok(()) } else { Err(Error::TooExpensive { cost, limit, limit_bytes }) }
}
