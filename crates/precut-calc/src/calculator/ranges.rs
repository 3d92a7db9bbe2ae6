//! Ranges in which the conditions of a next run may lie.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// How far beyond the observed range of a condition a next run may go, on either side, where nobody says.
const WIDENED: f64 = 1.5;

/// Range of a condition of a run.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct ConditionRange {
    /// Name of the condition: a field of the run.
    #[schema(max_length = 64, example = "depth_mm")]
    pub condition: String,
    /// Least value, in the unit of the condition.
    #[schema(minimum = 0.0, maximum = 1e9, example = 0.3, extensions(("x-symbol" = json!("c_min")), ("x-unit" = json!("as condition says"))))]
    pub from: f64,
    /// Largest value, in the unit of the condition.
    #[schema(exclusive_minimum = 0.0, maximum = 1e9, example = 2.0, extensions(("x-symbol" = json!("c_max")), ("x-unit" = json!("as condition says"))))]
    pub to: f64,
}

/// Ranges that were stated; other conditions have their observed range, widened.
#[derive(Debug, Clone, Copy)]
pub struct Ranges<'a>(pub &'a [ConditionRange]);

impl Ranges<'_> {
    /// Both ends for a condition; `None` where it is neither stated nor observed.
    pub fn ends(&self, condition: &str, observed: impl Iterator<Item = f64>) -> Option<[f64; 2]> {
        self.stated(condition).or_else(|| {
            let both = observed.map(|value| (value, value)).reduce(|a, b| (a.0.min(b.0), a.1.max(b.1)));
            both.map(|(low, high)| [low / WIDENED, high * WIDENED])
        })
    }

    /// Both ends where they are stated.
    pub fn stated(&self, condition: &str) -> Option<[f64; 2]> {
        self.0.iter().find(|range| range.condition == condition).map(|range| [range.from, range.to])
    }
}
