//! From what is varied to the points of a study. Nothing is allocated before the number of points is known.

use serde_json::{Map, Value};

use super::input::{Combine, Spacing};
use crate::engine::json;

/// Inner values of a range are rounded to so many significant digits: 0.1 to 0.5 in five is 0.1, 0.2, 0.3, and not
/// 0.30000000000000004, so that a point is the job that a user would type.
const RANGE_DIGITS: usize = 12;

/// How many values each variable has, and how they are put together.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Shape {
    lengths: Vec<u64>,
    combine: Combine,
}

impl Shape {
    pub(crate) fn new(lengths: Vec<u64>, combine: Combine) -> Self {
        Self { lengths, combine }
    }

    /// How many points there are: exact, whatever the lengths.
    pub(crate) fn points(&self) -> u128 {
        match self.combine {
            // Three factors below 2^53 may pass 2^128; what is saturated is beyond every limit.
            Combine::Grid => self.lengths.iter().fold(1, |all: u128, &one| all.saturating_mul(u128::from(one))),
            Combine::Zip => self.lengths.iter().copied().min().unwrap_or(0).into(),
        }
    }

    /// Which value each variable has at a point; the last changes fastest.
    pub(crate) fn at(&self, point: usize) -> Vec<usize> {
        match self.combine {
            Combine::Zip => vec![point; self.lengths.len()],
            Combine::Grid => {
                let mut rest = point;
                let mut places = vec![0; self.lengths.len()];
                for (place, &length) in places.iter_mut().zip(&self.lengths).rev() {
                    // A grid that is walked has lengths that fit.
                    let length = usize::try_from(length).unwrap_or(usize::MAX).max(1);
                    *place = rest % length;
                    rest /= length;
                }
                places
            }
        }
    }
}

/// The values of a range: both ends exactly, those between rounded. `count` is at least 2, and for logarithmic spacing
/// both ends are above zero.
pub(crate) fn range(from: f64, to: f64, count: usize, spacing: Spacing) -> Vec<f64> {
    let last = count.saturating_sub(1);
    (0..count)
        .map(|index| {
            if index == 0 {
                from
            } else if index == last {
                to
            } else {
                let share = index as f64 / last as f64;
                let value = match spacing {
                    // Without overflow where the ends are far apart.
                    Spacing::Linear => from * (1.0 - share) + to * share,
                    Spacing::Log => (from.ln() * (1.0 - share) + to.ln() * share).exp(),
                };
                rounded(value, f64::max(from.abs(), to.abs()), spacing)
            }
        })
        .collect()
}

/// To [`RANGE_DIGITS`] of its own; on a linear scale to as many of the largest, so that the middle of -1 to 1 is 0.
fn rounded(value: f64, largest: f64, spacing: Spacing) -> f64 {
    let noise = largest * 1e-14;
    if spacing == Spacing::Linear && value.abs() < noise {
        return 0.0;
    }
    let digits = RANGE_DIGITS - 1;
    format!("{value:.digits$e}").parse().unwrap_or(value)
}

/// A number as the JSON of a job.
pub(crate) fn number(value: f64) -> Value {
    json::number(value).unwrap_or(Value::Null)
}

/// The tokens of a JSON Pointer (RFC 6901); `None` if it is none, or the root's.
pub(crate) fn tokens(pointer: &str) -> Option<Vec<String>> {
    let rest = pointer.strip_prefix('/')?;
    Some(rest.split('/').map(|token| token.replace("~1", "/").replace("~0", "~")).collect())
}

/// Puts `value` where the tokens lead. Objects that are absent on the way are made; an item of an array must be there.
/// `false` if there is no way.
pub(crate) fn set(job: &mut Map<String, Value>, tokens: &[String], value: Value) -> bool {
    let Some((first, rest)) = tokens.split_first() else { return false };
    let mut place = job.entry(first.as_str()).or_insert(Value::Null);
    for token in rest {
        if place.is_null() {
            *place = Value::Object(Map::new());
        }
        let inner = match place {
            Value::Object(fields) => Some(fields.entry(token.as_str()).or_insert(Value::Null)),
            Value::Array(items) => index(token).and_then(|index| items.get_mut(index)),
            _ => None,
        };
        let Some(inner) = inner else { return false };
        place = inner;
    }
    *place = value;
    true
}

/// An index of an array as RFC 6901 has it: digits without leading zeros.
pub(crate) fn index(token: &str) -> Option<usize> {
    let is_index = token == "0" || (!token.starts_with('0') && !token.is_empty());
    (is_index && token.bytes().all(|byte| byte.is_ascii_digit())).then(|| token.parse().ok())?
}

#[cfg(test)]
#[allow(clippy::unwrap_used, clippy::float_cmp, clippy::cast_possible_truncation)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use serde_json::json;

    #[test]
    fn a_range_is_what_a_user_would_type() {
        assert_eq!(range(0.1, 0.5, 5, Spacing::Linear), [0.1, 0.2, 0.3, 0.4, 0.5]);
        assert_eq!(range(-1.0, 1.0, 5, Spacing::Linear), [-1.0, -0.5, 0.0, 0.5, 1.0]);
        assert_eq!(range(0.01, 100.0, 5, Spacing::Log), [0.01, 0.1, 1.0, 10.0, 100.0]);
        assert_eq!(range(1.0, 4.0, 3, Spacing::Log), [1.0, 2.0, 4.0]);
        assert_eq!(range(5.0, 1.0, 3, Spacing::Linear), [5.0, 3.0, 1.0], "downward, too");
        let wide = range(-f64::MAX, f64::MAX, 3, Spacing::Linear);
        assert_eq!(wide[1], 0.0, "nothing overflows");
    }

    #[test]
    fn a_billion_points_are_counted_and_not_made() {
        let shape = Shape::new(vec![1000, 1000, 1000], Combine::Grid);
        assert_eq!(shape.points(), 1_000_000_000);
        let most = Shape::new(vec![1 << 53; 3], Combine::Grid);
        assert_eq!(most.points(), u128::MAX, "saturated");
        assert_eq!(Shape::new(vec![4, 4], Combine::Zip).points(), 4);
    }

    #[test]
    fn the_last_variable_changes_fastest() {
        let shape = Shape::new(vec![2, 3], Combine::Grid);
        let all: Vec<_> = (0..6).map(|point| shape.at(point)).collect();
        assert_eq!(all, [[0, 0], [0, 1], [0, 2], [1, 0], [1, 1], [1, 2]]);
        assert_eq!(Shape::new(vec![3, 3], Combine::Zip).at(2), [2, 2]);
    }

    #[test]
    fn a_value_is_put_where_its_pointer_leads() {
        let mut job = json!({"a": {"b~/": [{"c": 1}]}, "n": null}).as_object().unwrap().clone();
        let put = |job: &mut Map<String, Value>, pointer: &str| set(job, &tokens(pointer).unwrap(), json!(7));
        assert!(put(&mut job, "/a/b~0~1/0/c"));
        assert!(put(&mut job, "/n/deep/er"));
        assert!(put(&mut job, "/new"));
        assert_eq!(Value::from(job.clone()), json!({"a": {"b~/": [{"c": 7}]}, "n": {"deep": {"er": 7}}, "new": 7}));
        for nowhere in ["/a/b~0~1/1/c", "/a/b~0~1/00/c", "/a/b~0~1/-/c", "/new/x"] {
            assert!(!put(&mut job.clone(), nowhere), "{nowhere}");
        }
        assert_eq!(tokens(""), None);
        assert_eq!(tokens("a"), None);
    }

    proptest! {
        #[test]
        fn every_combination_occurs_once(lengths in prop::collection::vec(1_u64..7, 1..4)) {
            let shape = Shape::new(lengths.clone(), Combine::Grid);
            let all: std::collections::BTreeSet<_> = (0..shape.points() as usize).map(|point| shape.at(point)).collect();
            prop_assert_eq!(all.len() as u128, shape.points());
            for places in all {
                for (place, length) in places.iter().zip(&lengths) {
                    prop_assert!((*place as u64) < *length);
                }
            }
        }

        /// Rounding to 12 digits moves a value by at most 5e-12 of its own size: far less than a step, unless the
        /// steps themselves are that small.
        #[test]
        fn a_range_is_monotone_keeps_its_ends_and_is_evenly_spaced(
            from in 1e-6..1e6_f64, span in 1e-3..1e6_f64, count in 2_usize..200, log in any::<bool>(),
        ) {
            let spacing = if log { Spacing::Log } else { Spacing::Linear };
            let to = from + span;
            let values = range(from, to, count, spacing);
            prop_assert_eq!(values.len(), count);
            prop_assert_eq!((values[0], values[count - 1]), (from, to));
            let steps: Vec<f64> = values
                .windows(2)
                .map(|pair| if log { (pair[1] / pair[0]).ln() } else { pair[1] - pair[0] })
                .collect();
            let mean = steps.iter().sum::<f64>() / steps.len() as f64;
            let noise = if log { 2e-11 } else { 2e-11 * to };
            for step in steps {
                prop_assert!((step - mean).abs() <= noise, "{} against {}", step, mean);
            }
        }
    }
}
