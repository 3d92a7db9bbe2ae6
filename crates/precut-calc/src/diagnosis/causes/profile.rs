//! Profile likelihoods of fitted parameters (`diagnosis/3.6`).

use rayon::prelude::*;

use crate::calculator::{Failure, Monitor, Range, checkpoint};
use crate::diagnosis::causes::refine::{Fit, Refinement};
use crate::diagnosis::causes::subject::Setting;

/// From one point to the next, posterior standard deviations.
///
/// An edge is read off a straight line between two points of the root of the rise, which is itself straight where the
/// likelihood is quadratic. Where its slope changes by a fifth over one standard deviation, twice what counts as a
/// disagreement, the line is off by 0.2 h^2 / 8: half a hundredth of a standard deviation.
const STEP: f64 = 0.5;
/// The same where every prediction is dear; off by two hundredths.
const DEAR_STEP: f64 = 1.0;
/// Steps of equal length on a side: twice, and of dear ones four times, as far as the 95 % interval of a quadratic reaches.
const EQUAL_STEPS: usize = 8;
/// From there on every step leads so many times as far from the fit as the one before: an edge that lies far away is read off
/// no worse in proportion to its distance.
const FARTHER: f64 = 1.25;
/// Points on a side at most: 29 standard deviations, of dear ones 20.
const MOST_POINTS: usize = 18;
/// The same where every prediction is dear.
const MOST_DEAR_POINTS: usize = 12;
/// How far beyond the edge of the 95 % interval the walk goes, as a share of its distance.
const BEYOND: f64 = 1.1;
/// Gauss-Newton steps of the other parameters at a point, with the columns of the fit.
const ROUNDS: usize = 2;
/// The same where shapes are free, with columns made anew, as long as they help by so much.
const BENT_ROUNDS: usize = 6;
const WORTH_A_ROUND: f64 = 1e-3;
/// The same where every prediction is dear.
const DEAR_ROUNDS: usize = 1;

/// What one parameter costs when all others are fitted anew: the rise of the least |r - X t|^2 + |t|^2 above that of the
/// fit. Of a quadratic likelihood it is the square of the distance in posterior standard deviations.
#[derive(Debug, Clone, PartialEq)]
pub struct Profile {
    /// The hypothesis whose parameter it is.
    pub hypothesis: usize,
    /// Which of its variables.
    pub variable: usize,
    /// Values, ascending.
    pub value: Vec<f64>,
    /// The rise at each, 0 at the least.
    pub rise: Vec<f64>,
    range: Range,
}

impl Profile {
    /// Where the rise stays below the square of `reach`; up to the bound where it does not reach that far.
    pub fn interval(&self, reach: f64) -> [f64; 2] {
        let least = (0..self.rise.len()).min_by(|&a, &b| self.rise[a].total_cmp(&self.rise[b])).unwrap_or(0);
        let below: Vec<usize> = (0..=least).rev().collect();
        let above: Vec<usize> = (least..self.value.len()).collect();
        [self.edge(&below, reach).unwrap_or(self.range.lower), self.edge(&above, reach).unwrap_or(self.range.upper)]
    }

    fn edge(&self, way: &[usize], reach: f64) -> Option<f64> {
        way.windows(2).find(|pair| self.rise[pair[1]] >= reach * reach).map(|pair| {
            let [low, high] = [pair[0], pair[1]].map(|i| self.rise[i].sqrt());
            let share = if high > low { (reach - low) / (high - low) } else { 1.0 };
            self.value[pair[0]] + share.clamp(0.0, 1.0) * (self.value[pair[1]] - self.value[pair[0]])
        })
    }

    /// Whether intervals of the same likelihood as if it were quadratic are as wide, on either side, within `tolerance`.
    pub fn agrees(&self, value: f64, quadratic: [f64; 2], reach: f64, tolerance: f64) -> bool {
        let own = self.interval(reach);
        own.iter().zip(quadratic).all(|(own, other)| (own - other).abs() <= tolerance * (other - value).abs())
    }
}

/// A fit with what it was made with, its free values fixed one after the other.
pub(in crate::diagnosis) struct Profiler<'a> {
    pub(in crate::diagnosis) refinement: &'a Refinement<'a>,
    pub(in crate::diagnosis) fit: &'a Fit,
    pub(in crate::diagnosis) dear: bool,
}

impl Profiler<'_> {
    /// Profiles of the free values whose numbers are given, out to the edge of the interval that `reach` stands for.
    pub(in crate::diagnosis) fn profiles(
        &self,
        free: &[usize],
        reach: f64,
        monitor: &dyn Monitor,
    ) -> Result<Vec<Profile>, Failure> {
        let Some(at_fit) = self.least(&mut self.fit.settings.clone(), None)? else { return Ok(Vec::new()) };
        let walks: Vec<(usize, f64)> = free.iter().flat_map(|&k| [(k, -1.0), (k, 1.0)]).collect();
        let walked: Vec<Vec<(f64, f64)>> =
            walks.par_iter().map(|&(k, side)| self.walk(k, side, at_fit, reach, monitor)).collect::<Result<_, _>>()?;
        let profile = |(&k, sides): (&usize, &[Vec<(f64, f64)>])| {
            let (member, variable) = self.fit.free[k];
            let own = (self.value(k), at_fit);
            let points: Vec<(f64, f64)> = sides[0].iter().rev().chain([&own]).chain(&sides[1]).copied().collect();
            // The fit may have stopped a little beside its optimum.
            let least = points.iter().map(|point| point.1).fold(f64::INFINITY, f64::min);
            Profile {
                hypothesis: self.fit.settings[member].hypothesis,
                variable,
                value: points.iter().map(|point| point.0).collect(),
                rise: points.iter().map(|point| point.1 - least).collect(),
                range: self.refinement.variable(self.fit, k).range,
            }
        };
        Ok(free.iter().zip(walked.chunks(2)).map(profile).collect())
    }

    fn value(&self, k: usize) -> f64 {
        let (member, variable) = self.fit.free[k];
        self.fit.settings[member].values[variable]
    }

    /// From the fit to one side until the rise is beyond reach, or to the bound.
    fn walk(
        &self,
        k: usize,
        side: f64,
        at_fit: f64,
        reach: f64,
        monitor: &dyn Monitor,
    ) -> Result<Vec<(f64, f64)>, Failure> {
        let (member, variable) = self.fit.free[k];
        let coordinate = self.fit.coordinates[k];
        let range = self.refinement.variable(self.fit, k).range;
        let sd = self.fit.covariance[(k, k)].sqrt() / coordinate.slope(self.value(k));
        let step = if self.dear { DEAR_STEP } else { STEP };
        let mut settings = self.fit.settings.clone();
        let mut points = Vec::new();
        let most = if self.dear { MOST_DEAR_POINTS } else { MOST_POINTS };
        for count in 1..=most {
            checkpoint(monitor)?;
            let steps = count.min(EQUAL_STEPS) as f64 * FARTHER.powf(count.saturating_sub(EQUAL_STEPS) as f64);
            let t = coordinate.t(self.value(k)) + side * step * steps * sd;
            let value = coordinate.moved(t, range);
            let bound = if side < 0.0 { range.lower } else { range.upper };
            let before = points.last().map_or(self.value(k), |(value, _): &(f64, f64)| *value);
            // At its bound already.
            if (value - before) * side <= 0.0 {
                break;
            }
            settings[member].values[variable] = value;
            let Some(least) = self.least(&mut settings, Some(k))? else { break };
            points.push((value, least));
            if least - at_fit > (BEYOND * reach).powi(2) || (bound - value) * side <= 0.0 {
                break;
            }
        }
        Ok(points)
    }

    /// |r - X t|^2 + |t|^2 of the model itself with one value fixed and the others fitted, which `settings` follow; with
    /// none fixed at these settings. `None` where the model has no value for a row.
    fn least(&self, settings: &mut [Setting], fixed: Option<usize>) -> Result<Option<f64>, Failure> {
        let mut least: Option<(f64, Vec<Setting>)> = None;
        // A valley along a shape bends: there the columns are made anew.
        let bends = self.fit.with_shapes && !self.dear;
        let rounds = if self.dear {
            DEAR_ROUNDS
        } else if bends {
            BENT_ROUNDS
        } else {
            ROUNDS
        };
        for round in 0..=rounds {
            let Some(residual) = self.refinement.residual(settings)? else { break };
            let t = self.fit.coordinates_at(settings);
            let cost = self.refinement.likelihood.misfit(&residual) + t.iter().map(|t| t * t).sum::<f64>();
            let gained = least.as_ref().map_or(f64::INFINITY, |(known, _)| known - cost);
            if gained > 0.0 {
                least = Some((cost, settings.to_vec()));
            }
            if round == rounds || gained < WORTH_A_ROUND || fixed.is_none() || self.fit.free.len() < 2 {
                break;
            }
            let anew = if bends { Some(self.refinement.columns_at(self.fit, settings)?) } else { None };
            let columns = anew.as_ref().unwrap_or(&self.fit.columns);
            self.refinement.move_others(self.fit, columns, settings, &residual, fixed);
        }
        Ok(least.map(|(cost, at)| {
            settings.clone_from_slice(&at);
            cost
        }))
    }
}
