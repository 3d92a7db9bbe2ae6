//! How a cut goes, as margins that are positive where it stays quiet and closed (`fixture/7.1`, `fixture/7.2`).

use crate::calculator::{ClassLimits, Failure, LimitCurve, Missing, Monitor, Prediction};
use crate::effects::FixtureEffect;

use crate::fixture_stability::answer::study::forced;
use crate::fixture_stability::job::acting::Case;
use crate::fixture_stability::measured::forward::RegimeMargin;
use crate::fixture_stability::measured::predict::PreparedFixture;
use crate::fixture_stability::model::floquet::Working;
use crate::fixture_stability::model::holding::Closed;
use crate::fixture_stability::model::lobes::{Plane, boundary, critical_depth, point};
use crate::fixture_stability::model::response::Response;

/// How far beyond the rows the limit of the base is looked for: so many times the largest depth of the speed.
const LOOKED_FOR: [f64; 3] = [4.0, 16.0, 64.0];
/// Step of the logarithm of the depth for the growth of ln|mu|: its truncation is of order 1e-4 of the curvature.
const STEP: f64 = 0.01;
/// Least growth: where |mu| but grazes 1, a margin in terms of depth would be as long as one likes.
pub(crate) const FLATTEST: f64 = 0.1;
/// Least share of the clamp force that a cut asks for: no force at all is as bad as a thousandth.
const LEAST_CLAMP: f64 = 1e-3;
/// Speeds of a limit that is drawn, before it is refined.
const SPEEDS: usize = 40;
/// Feeds whose limits are drawn.
const MOST_FEEDS: usize = 4;

impl PreparedFixture {
    fn log_modulus(&self, case: &Case, working: Working, monitor: &dyn Monitor) -> Result<f64, Failure> {
        let found = point(&self.rules, &case.holding, &case.cutting, working, Closed::BOTH, monitor)?;
        Ok(found.multiplier.counted().max(f64::MIN_POSITIVE).ln())
    }

    /// g = d ln|mu|/d ln H of the base where chatter begins at the speed and feed of these rows; 1 where it never does.
    pub(in crate::fixture_stability) fn steepness_of(
        &self,
        rows: &[usize],
        monitor: &dyn Monitor,
    ) -> Result<f64, Failure> {
        let of = |row: &usize| self.rows[*row].working;
        let deepest = rows.iter().map(|row| of(row).depth_mm).fold(f64::MIN_POSITIVE, f64::max);
        let Some(working) = rows.first().map(of) else { return Ok(1.0) };
        let Case { holding, cutting, .. } = &self.base;
        for times in LOOKED_FOR {
            let most_mm = times * deepest;
            let found = critical_depth(&self.rules, holding, cutting, working, most_mm, monitor)?;
            if let Some(limit) = found.depth_mm {
                let at = |depth_mm: f64| self.log_modulus(&self.base, Working { depth_mm, ..working }, monitor);
                return Ok(steepness(limit, at)?.max(FLATTEST));
            }
        }
        Ok(1.0)
    }

    /// Margins of rows at one working point, that of chatter given; the other is computed once.
    pub(in crate::fixture_stability) fn margins(
        &self,
        case: &Case,
        rows: &[usize],
        chatter: Prediction,
        unit: &mut Option<Response>,
        monitor: &dyn Monitor,
    ) -> Result<Vec<(usize, Prediction)>, Failure> {
        let asks = |margin: RegimeMargin| rows.iter().any(|&row| self.rows[row].margin == margin);
        let opening =
            if asks(RegimeMargin::Opening) { opening(case, unit, monitor)? } else { Err(Missing::NoSolution) };
        let of = |row: usize| match self.rows[row].margin {
            RegimeMargin::Chatter => chatter,
            RegimeMargin::Opening => opening,
        };
        Ok(rows.iter().map(|&row| (row, of(row))).collect())
    }

    /// Where the rows stand, and the depth at which chatter begins with these effects, of every feed.
    pub(in crate::fixture_stability) fn class_limits(
        &self,
        effects: &[FixtureEffect],
        monitor: &dyn Monitor,
    ) -> Result<ClassLimits, Failure> {
        let speeds: Vec<f64> = self.rows.iter().map(|row| row.working.spindle_rpm).collect();
        let depths: Vec<f64> = self.rows.iter().map(|row| row.working.depth_mm).collect();
        let mut feeds: Vec<f64> = self.rows.iter().map(|row| row.working.feed_mm).collect();
        feeds.sort_by(f64::total_cmp);
        feeds.dedup();
        let (from_rpm, to_rpm) =
            speeds.iter().fold((f64::INFINITY, 0.0_f64), |(low, high), n| (low.min(0.95 * n), high.max(1.05 * n)));
        let most_mm = 2.0 * depths.iter().copied().fold(1e-3, f64::max);
        let mut all = self.job.effects.clone();
        all.extend_from_slice(effects);
        let Some(case) = Case::with(&self.job, &all, &self.job.conditions) else {
            return Ok(ClassLimits { spindle_speed_rpm: speeds, depth_mm: depths, curves: Vec::new() });
        };
        // Where joints harden there may be no forced motion at some depth of some speed, and no limit to draw.
        let curve = |feed_mm: f64| -> Result<Option<LimitCurve>, Failure> {
            let plane = Plane { from_rpm, to_rpm, speeds: SPEEDS, most_mm, depths: 2, feed_mm };
            let found = boundary(&self.rules, &case.holding, &case.cutting, &plane, monitor, &mut |_, _| {});
            Ok(or_missing(found)?.ok().map(|found| LimitCurve {
                feed_mm_per_tooth: feed_mm,
                width_mm: None,
                low_mm: Vec::new(),
                high_mm: Vec::new(),
                spindle_speed_rpm: found.iter().map(|point| point.spindle_rpm).collect(),
                depth_mm: found.iter().map(|point| point.crossings_mm.first().copied()).collect(),
            }))
        };
        let curves = feeds.into_iter().take(MOST_FEEDS).map(curve).collect::<Result<Vec<_>, _>>()?;
        let curves = curves.into_iter().flatten().collect();
        Ok(ClassLimits { spindle_speed_rpm: speeds, depth_mm: depths, curves })
    }
}

/// g = d ln|mu|/d ln H at a limit (`fixture/7.1`), by a central difference.
pub(crate) fn steepness(limit_mm: f64, log_modulus: impl Fn(f64) -> Result<f64, Failure>) -> Result<f64, Failure> {
    let at = |shift: f64| log_modulus(limit_mm * shift.exp());
    Ok((at(STEP)? - at(-STEP)?) / (2.0 * STEP))
}

/// Joints that harden may have no forced motion about which to ask.
pub(in crate::fixture_stability) fn or_missing<T>(found: Result<T, Failure>) -> Result<Result<T, Missing>, Failure> {
    match found {
        Ok(value) => Ok(Ok(value)),
        Err(Failure::OutOfModel(_) | Failure::NotConverged { .. }) => Ok(Err(Missing::NoSolution)),
        Err(other) => Err(other),
    }
}

/// ln of the clamp force over what the forced motion in closed joints asks for. `unit` is the motion at 1 mm of depth, where
/// it goes with H^(1-mu).
fn opening(case: &Case, unit: &mut Option<Response>, monitor: &dyn Monitor) -> Result<Prediction, Failure> {
    let Some(force) = case.holding.clamp_force_n else { return Ok(Err(Missing::NoSolution)) };
    let asked = |forced: &Response| forced.left_elastic_n.high.max(forced.right_elastic_n.high);
    let forced = |working| or_missing(forced(case, working, monitor));
    let asked = if case.is_linear() {
        let unit = match unit {
            Some(unit) => unit,
            None => match forced(case.at_depth(1.0))? {
                Ok(response) => unit.insert(response),
                Err(missing) => return Ok(Err(missing)),
            },
        };
        asked(unit) * case.cutting.depth_power(case.working.depth_mm)
    } else {
        match forced(case.working)? {
            Ok(response) => asked(&response),
            Err(missing) => return Ok(Err(missing)),
        }
    };
    if asked <= 0.0 {
        return Ok(Err(Missing::NoCut));
    }
    Ok(Ok((force / asked).max(LEAST_CLAMP).ln()))
}
