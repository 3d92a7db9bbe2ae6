//! Where the limit of classes runs with what the rows leave open of their causes (`diagnosis/3.11`).

use crate::calculator::{Diagnosable, Failure, LimitCurve, Monitor};
use crate::diagnosis::base::Bound;
use crate::diagnosis::causes::ranking::SetWeight;
use crate::diagnosis::causes::subject::Belief;
use crate::diagnosis::model::gain::predicting;
use crate::diagnosis::model::known::directions;
use crate::diagnosis::verdict::judge::Verdict;
use crate::diagnosis::verdict::weigh::Weighing;

/// Likely sets whose limits are drawn together.
const MOST_SETS: usize = 3;
/// Half of the 95 % interval of a normal distribution, standard deviations.
const HALF_WIDTH: f64 = 1.959_963_984_540_054;

/// Two speeds nearer than this share are one.
const ONE_SPEED: f64 = 1e-6;

/// ln of a limit at the speeds of a curve: its mean over the sets, and its mean square.
struct Moments {
    mean: Vec<f64>,
    square: Vec<f64>,
    /// Whether every set has a limit there.
    known: Vec<bool>,
}

/// The limit of the sets that may be right, each by its share, with its 95 % interval: what the rows leave open of the sizes of every set,
/// one standard deviation of each independent direction at a time, and how far the sets lie apart. Empty where nothing is wrong, or
/// rows are no classes.
pub(super) fn band<M: Diagnosable>(
    bound: &Bound<'_, M>,
    weighing: &Weighing<'_>,
    monitor: &dyn Monitor,
) -> Result<Vec<LimitCurve>, Failure> {
    if matches!(weighing.verdict, Verdict::Adequate | Verdict::Unknown(_)) {
        return Ok(Vec::new());
    }
    let mut sets = predicting(weighing);
    sets.truncate(MOST_SETS);
    let whole: f64 = sets.iter().map(|(share, _)| share).sum();
    let limits = |believed: &Belief| -> Result<Vec<LimitCurve>, Failure> {
        // Beyond the bounds of an effect there is no model.
        let Ok(effects) = bound.acting(believed) else { return Ok(Vec::new()) };
        Ok(M::class_limits(bound.prepared(), &effects, monitor)?.map_or_else(Vec::new, |limits| limits.curves))
    };
    let mut each_set: Vec<(f64, Vec<Vec<LimitCurve>>)> = Vec::with_capacity(sets.len());
    for (share, set) in sets {
        each_set.push((share / whole, with_open(weighing, set, &limits)?));
    }
    Ok(put_together(&each_set))
}

/// The band of every width and feed, from the share of every set, its own limits, and those along its directions.
fn put_together(each_set: &[(f64, Vec<Vec<LimitCurve>>)]) -> Vec<LimitCurve> {
    let own = |index: usize| each_set.iter().filter_map(move |(_, each)| each.first()?.get(index));
    let of_curve = |(index, first): (usize, &LimitCurve)| {
        let mut curve = LimitCurve { spindle_speed_rpm: all_speeds(own(index)), ..first.clone() };
        let mut sums = Moments::of(&curve);
        for (share, each) in each_set {
            let curves: Vec<Option<&LimitCurve>> = each.iter().map(|curves| curves.get(index)).collect();
            sums.add(&curve, *share, &curves);
        }
        sums.put(&mut curve);
        curve
    };
    let first = each_set.first().and_then(|(_, each)| each.first());
    first.map_or_else(Vec::new, |curves| curves.iter().enumerate().map(of_curve).collect())
}

/// Every speed at which one of the limits is known, rising: each set has lobes of its own, and bends where they do.
fn all_speeds<'a>(curves: impl Iterator<Item = &'a LimitCurve>) -> Vec<f64> {
    let mut speeds: Vec<f64> = curves.flat_map(|curve| curve.spindle_speed_rpm.iter().copied()).collect();
    speeds.sort_by(f64::total_cmp);
    speeds.dedup_by(|next, known| (*next / *known - 1.0).abs() < ONE_SPEED);
    speeds
}

/// The limits of a set at its fit, and one standard deviation along each direction that the rows leave open.
fn with_open(
    weighing: &Weighing<'_>,
    set: &SetWeight,
    limits: &dyn Fn(&Belief) -> Result<Vec<LimitCurve>, Failure>,
) -> Result<Vec<Vec<LimitCurve>>, Failure> {
    let believed = Belief::of(&set.settings);
    let mut each = vec![limits(&believed)?];
    for direction in directions(weighing, set) {
        let above = limits(&direction.moved(&believed, 1.0))?;
        each.push(if above.is_empty() { limits(&direction.moved(&believed, -1.0))? } else { above });
    }
    Ok(each)
}

impl Moments {
    fn of(curve: &LimitCurve) -> Self {
        let count = curve.spindle_speed_rpm.len();
        Self { mean: vec![0.0; count], square: vec![0.0; count], known: vec![true; count] }
    }

    /// Adds a set by its share: its own limit first, then those along its directions.
    fn add(&mut self, curve: &LimitCurve, share: f64, each: &[Option<&LimitCurve>]) {
        for (k, speed) in curve.spindle_speed_rpm.iter().enumerate() {
            let at = |of: Option<&LimitCurve>| of.and_then(|of| ln_limit(of, *speed));
            let Some(own) = each.first().copied().and_then(at) else {
                self.known[k] = false;
                continue;
            };
            // Where a limit along a direction is beyond what is looked at, it is not known how far.
            let open: f64 = each[1..].iter().map(|of| at(*of).map_or(0.0, |moved| (moved - own).powi(2))).sum();
            self.mean[k] += share * own;
            self.square[k] += share * (own * own + open);
        }
    }

    fn put(&self, curve: &mut LimitCurve) {
        let half = |k: usize| HALF_WIDTH * (self.square[k] - self.mean[k] * self.mean[k]).max(0.0).sqrt();
        let at = |k: usize, ln: f64| self.known[k].then(|| ln.exp());
        let count = self.mean.len();
        curve.depth_mm = (0..count).map(|k| at(k, self.mean[k])).collect();
        curve.low_mm = (0..count).map(|k| at(k, self.mean[k] - half(k))).collect();
        curve.high_mm = (0..count).map(|k| at(k, self.mean[k] + half(k))).collect();
    }
}

/// ln of the limit at a speed, straight between those of a curve; `None` beside a speed that has none.
fn ln_limit(curve: &LimitCurve, speed_rpm: f64) -> Option<f64> {
    let speeds = &curve.spindle_speed_rpm;
    let ln = |k: usize| curve.depth_mm.get(k).copied().flatten().filter(|depth| *depth > 0.0).map(f64::ln);
    let behind = speeds.partition_point(|known| *known < speed_rpm);
    if speeds.get(behind).is_some_and(|known| (known / speed_rpm - 1.0).abs() < ONE_SPEED) {
        return ln(behind);
    }
    let before = behind.checked_sub(1)?;
    if (speeds[before] / speed_rpm - 1.0).abs() < ONE_SPEED {
        return ln(before);
    }
    let (from, to) = (speeds[before], *speeds.get(behind)?);
    let (a, b) = (ln(before)?, ln(behind)?);
    Some(a + (b - a) * (speed_rpm - from) / (to - from))
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    fn curve(depth_mm: &[f64]) -> LimitCurve {
        LimitCurve {
            feed_mm_per_tooth: 0.1,
            width_mm: None,
            spindle_speed_rpm: (1..=depth_mm.len()).map(|k| k as f64).collect(),
            depth_mm: depth_mm.iter().map(|depth| Some(*depth)).collect(),
            low_mm: Vec::new(),
            high_mm: Vec::new(),
        }
    }

    #[test]
    fn one_set_is_as_wide_as_its_directions() {
        let mut own = curve(&[1.0, 2.0]);
        let (one, other) = (curve(&[1.1, 2.0]), curve(&[1.0, 2.0 * 1.2]));
        let mut sums = Moments::of(&own);
        sums.add(&own.clone(), 1.0, &[Some(&own.clone()), Some(&one), Some(&other)]);
        sums.put(&mut own);
        let sd = [1.1_f64.ln(), 1.2_f64.ln()];
        for (k, sd) in sd.into_iter().enumerate() {
            let ratio = own.high_mm[k].unwrap() / own.depth_mm[k].unwrap();
            assert!((ratio.ln() - HALF_WIDTH * sd).abs() < 1e-12 && own.low_mm[k] < own.depth_mm[k]);
        }
    }

    #[test]
    fn two_sets_are_as_far_apart_as_they_are() {
        let (low, high) = (curve(&[1.0]), curve(&[4.0]));
        let mut found = low.clone();
        let mut sums = Moments::of(&found);
        sums.add(&low, 0.5, &[Some(&low)]);
        sums.add(&low, 0.5, &[Some(&high)]);
        sums.put(&mut found);
        // Half the distance is one standard deviation of two alike shares.
        assert!((found.depth_mm[0].unwrap() - 2.0).abs() < 1e-12);
        assert!((found.high_mm[0].unwrap().ln() - 2.0_f64.ln() - HALF_WIDTH * 2.0_f64.ln()).abs() < 1e-12);
    }

    #[test]
    fn the_band_bends_where_any_set_does() {
        // Lobes that meet at 2 of one set, at 2.5 of the other.
        let one = curve(&[1.0, 4.0, 1.0]);
        let other = LimitCurve { spindle_speed_rpm: vec![1.0, 2.5, 3.0], ..curve(&[1.0, 4.0, 1.0]) };
        let band = put_together(&[(0.5, vec![vec![one]]), (0.5, vec![vec![other]])]);
        assert_eq!(band[0].spindle_speed_rpm, [1.0, 2.0, 2.5, 3.0]);
        // At 2.5 the first has come down half way: 2 and 4, whose mean is the root of 8.
        assert!((band[0].depth_mm[2].unwrap() - 8.0_f64.sqrt()).abs() < 1e-12, "{band:?}");
    }

    #[test]
    fn a_limit_between_two_speeds_is_straight_in_its_logarithm() {
        let limits = curve(&[1.0, 4.0]);
        assert!((ln_limit(&limits, 1.5).unwrap() - 2.0_f64.ln()).abs() < 1e-12);
        assert!(ln_limit(&limits, 0.9).is_none() && ln_limit(&limits, 2.1).is_none());
    }
}
