//! Where a hypothesis comes nearest to the rows, where a straight line through 0 does not tell (`diagnosis/3.4`).
//!
//! A search by coarse predictions alone, before anything is known of scatter and priors: it only says about which sizes the
//! model is worth being linearised. What is found there is weighed with all that is known.

use nalgebra::{Cholesky, DMatrix, DVector};
use rayon::prelude::*;

use crate::calculator::{Expansions, Failure, Hypothesis, JacobianColumn, Monitor, Prediction, Range, checkpoint};
use crate::diagnosis::causes::subject::{Setting, Subject};
use crate::diagnosis::rows::basis::dot;

/// Share of a change by which the model may miss its straight line at the largest sizes and still be called straight.
const STRAIGHT: f64 = 0.05;
/// Share of what was measured below which a change at the largest sizes explains nothing: waves that died out.
const UNSEEN: f64 = 0.02;
/// Directions in which that is tried.
const DIRECTIONS: usize = 4;
/// Farthest that a straight line is followed, prior standard deviations.
const FARTHEST: f64 = 4.0;
/// Places from which it goes downhill at each shape, at least.
const OF_EACH_START: usize = 2;
/// Gauss-Newton steps of a descent.
const STEPS: usize = 8;
/// Shares of a step that are tried.
const SHARES: [f64; 2] = [1.0, 0.3];
/// A step that lowers the misfit by less than this share ends a descent by steps.
const WORTH_IT: f64 = 0.01;
/// Share of what was measured that a place may leave and still explain it.
const LITTLE: f64 = 0.1;
/// Share of the largest size below which a straight line tells of a wave.
const SMALL: f64 = 0.2;
/// How many of the places far from the straight line, for every one that is used, are gone downhill from a few steps, and how
/// many then to the end: halfway between two points that are tried a narrow valley leaves hardly less than its surroundings.
const OF_EACH_FAR: usize = 12;
const FEW_STEPS: usize = 2;
const OF_EACH_NEARER: usize = 2;
/// First move along one variable, share of the largest size.
const FIRST_MOVE: f64 = 0.1;
/// How often the moves are halved: to a quarter.
const HALVINGS: u32 = 3;
/// How many of the places are moved so.
const FELT: usize = 4;
/// Places nearer to one another than this, on the scale of each variable, are one.
const SAME: f64 = 0.02;
/// Step of a divided difference of a size in prior standard deviations, of a shape in steps of its grid: predictions that are
/// rough have errors of their own, but the same ones on both sides.
const STEP: f64 = 1e-3;
/// Points that are looked at between two questions whether anybody still waits.
const AT_ONCE: usize = 16;

/// A place beside 0 with what the model changes there against 0.
pub(in crate::diagnosis) struct Place {
    pub(in crate::diagnosis) setting: Setting,
    pub(in crate::diagnosis) change: Vec<f64>,
}

/// One hypothesis and what was measured.
pub(in crate::diagnosis) struct Survey<'a> {
    subject: &'a dyn Subject,
    hypothesis: usize,
    /// Measured minus base.
    residual: &'a [f64],
    expansions: Expansions,
}

impl<'a> Survey<'a> {
    pub(in crate::diagnosis) fn new(subject: &'a dyn Subject, hypothesis: usize, residual: &'a [f64]) -> Self {
        Self { subject, hypothesis, residual, expansions: subject.expansions(hypothesis) }
    }

    /// The places about which a hypothesis is linearised beside 0, each with its point of the grid; those that were
    /// looked for off the grid have none. `grid` are its shapes with sizes of 0. Where the model has no value there is no
    /// place.
    pub(in crate::diagnosis) fn places(
        &self,
        grid: &[Setting],
        monitor: &dyn Monitor,
    ) -> Result<Vec<(Option<usize>, Place)>, Failure> {
        let predict = |settings: &[Setting]| self.subject.predict_coarsely(settings);
        if self.expansions.places.len() > self.expansions.nearest {
            let on_grid = self.declared().fitted_shapes().next().is_none().then_some(0);
            let nearest = self.nearest(grid, monitor)?.into_iter().map(|place| place.setting).collect();
            return Ok(changes(nearest, &predict)?.into_iter().map(|place| (on_grid, place)).collect());
        }
        let mut found = Vec::new();
        for (point, at) in grid.iter().enumerate() {
            checkpoint(monitor)?;
            let places = changes(self.sized(at, &self.expansions.places), &predict)?;
            found.extend(places.into_iter().map(|place| (Some(point), place)));
        }
        Ok(found)
    }

    /// The places that come nearest to the rows: where a straight line explains most, at every point of the grid and at the points
    /// between, and there all the sizes given; from the best of these downhill.
    fn nearest(&self, grid: &[Setting], monitor: &dyn Monitor) -> Result<Vec<Place>, Failure> {
        let between: Vec<Setting> = grid.iter().flat_map(|at| self.refined(at)).collect();
        let mut along = Vec::with_capacity(between.len());
        for some in between.chunks(AT_ONCE) {
            checkpoint(monitor)?;
            let fits: Vec<Option<Place>> =
                some.par_iter().map(|at| self.straight_fit(at)).collect::<Result<_, Failure>>()?;
            along.extend(fits);
        }
        let mut starts = self.valleys(along);
        self.rank(&mut starts);
        let of_each = OF_EACH_START.max(self.expansions.nearest / starts.len().max(1));
        let mut straight = true;
        let mut found = Vec::new();
        for start in starts {
            checkpoint(monitor)?;
            let at = self.at_zero(&start.setting);
            let mut near = vec![start];
            if !self.is_straight(&at)? {
                straight = false;
                near.extend(self.with_sizes(&at, &self.expansions.places)?);
            }
            self.rank(&mut near);
            found.extend(near.into_iter().take(of_each));
        }
        let mut found = self.downhill(found, STEPS, monitor)?;
        self.leave_one_of_each(&mut found);
        if !straight && self.expansions.parts > 1 && !found.first().is_some_and(|best| self.explains(best)) {
            found.extend(self.far_from_straight(&between, monitor)?);
            self.leave_one_of_each(&mut found);
        }
        if !straight {
            for place in found.iter_mut().take(FELT) {
                checkpoint(monitor)?;
                self.feel_downhill(place)?;
            }
            self.leave_one_of_each(&mut found);
        }
        Ok(found)
    }

    /// Of places along a shape those that leave less than their neighbours.
    fn valleys(&self, along: Vec<Option<Place>>) -> Vec<Place> {
        let left: Vec<f64> =
            along.iter().map(|place| place.as_ref().map_or(f64::INFINITY, |place| self.misfit(place))).collect();
        let is_lower = |k: usize| {
            let beside = |other: Option<usize>| other.and_then(|k| left.get(k)).copied().unwrap_or(f64::INFINITY);
            left[k] < beside(k.checked_sub(1)) && left[k] <= beside(Some(k + 1))
        };
        along.into_iter().enumerate().filter(|(k, _)| is_lower(*k)).filter_map(|(_, place)| place).collect()
    }

    /// Where the best of those that a straight line leads to leaves much: all but the small sizes at every point between those of the
    /// grid, and from the best of these downhill. A large wave shows another shape than a small one, so that no straight line
    /// tells which ratio it has; and one that comes back alike in every turn is found at that very ratio only.
    fn far_from_straight(&self, between: &[Setting], monitor: &dyn Monitor) -> Result<Vec<Place>, Failure> {
        let far = self.expansions.beyond(SMALL);
        let mut found = Vec::new();
        for at in between {
            checkpoint(monitor)?;
            let places = self.with_sizes(&self.at_zero(at), &far)?;
            found.extend(places.into_iter().min_by(|a, b| self.misfit(a).total_cmp(&self.misfit(b))));
        }
        self.rank_to(&mut found, OF_EACH_FAR * self.expansions.nearest);
        let mut found = self.downhill(found, FEW_STEPS, monitor)?;
        self.rank_to(&mut found, OF_EACH_NEARER * self.expansions.nearest);
        self.downhill(found, STEPS, monitor)
    }

    fn downhill(&self, places: Vec<Place>, steps: usize, monitor: &dyn Monitor) -> Result<Vec<Place>, Failure> {
        checkpoint(monitor)?;
        places.into_par_iter().map(|place| self.step_downhill(place, steps)).collect()
    }

    /// Whether a place leaves little of what was measured.
    fn explains(&self, place: &Place) -> bool {
        self.misfit(place) <= LITTLE * dot(self.residual, self.residual)
    }

    fn declared(&self) -> &'a Hypothesis {
        &self.subject.hypotheses()[self.hypothesis]
    }

    /// A point of the grid and those about it, its step of the fitted shape divided.
    fn refined(&self, at: &Setting) -> Vec<Setting> {
        let Some((shape, spacing)) = self.declared().fitted_shapes().next() else { return vec![at.clone()] };
        let parts = self.expansions.parts.max(1);
        let part = |part: u32| {
            let mut moved = at.clone();
            let share = f64::from(part) / f64::from(parts) - 0.5;
            moved.values[shape] = self.range(shape).clamp(at.values[shape] + share * spacing);
            moved
        };
        (0..parts).map(part).collect()
    }

    fn range(&self, variable: usize) -> Range {
        self.declared().variables[variable].range
    }

    /// Sizes, and shapes that are fitted, each with the scale on which it matters.
    fn free(&self) -> Vec<(usize, f64)> {
        self.declared().amplitudes().chain(self.declared().fitted_shapes()).collect()
    }

    fn at_zero(&self, setting: &Setting) -> Setting {
        let mut zero = setting.clone();
        self.declared().amplitudes().for_each(|(size, _)| zero.values[size] = 0.0);
        zero
    }

    /// A setting with other sizes.
    fn sized(&self, at: &Setting, sizes: &[Vec<f64>]) -> Vec<Setting> {
        let with = |sizes: &Vec<f64>| {
            let mut setting = at.clone();
            self.declared().amplitudes().zip(sizes).for_each(|((variable, _), size)| setting.values[variable] = *size);
            setting
        };
        sizes.iter().map(with).collect()
    }

    fn with_sizes(&self, at: &Setting, sizes: &[Vec<f64>]) -> Result<Vec<Place>, Failure> {
        self.at_all(self.sized(at, sizes))
    }

    /// What the model changes against 0, roughly.
    fn at_all(&self, settings: Vec<Setting>) -> Result<Vec<Place>, Failure> {
        changes(settings, &|settings: &[Setting]| self.subject.predict_roughly(settings))
    }

    /// What was measured and is not explained at a place.
    fn misfit(&self, place: &Place) -> f64 {
        self.residual.iter().zip(&place.change).map(|(r, change)| (r - change) * (r - change)).sum()
    }

    /// Leaves those that come nearest to the rows, nearest first.
    fn rank(&self, places: &mut Vec<Place>) {
        self.rank_to(places, self.expansions.nearest);
    }

    fn rank_to(&self, places: &mut Vec<Place>, count: usize) {
        places.sort_by(|a, b| self.misfit(a).total_cmp(&self.misfit(b)));
        places.truncate(count);
    }

    fn leave_one_of_each(&self, places: &mut Vec<Place>) {
        let free = self.free();
        let same = |a: &Setting, b: &Setting| {
            free.iter().all(|&(variable, scale)| (a.values[variable] - b.values[variable]).abs() < SAME * scale)
        };
        self.rank(places);
        let mut kept: Vec<Place> = Vec::new();
        for place in places.drain(..) {
            if kept.iter().all(|known| !same(&known.setting, &place.setting)) {
                kept.push(place);
            }
        }
        *places = kept;
    }

    /// What one unit of every variable, given with its scale, changes beside a place.
    fn slopes(&self, beside: &Place, of: &[(usize, f64)]) -> Result<Vec<JacobianColumn>, Failure> {
        let slope = |&(variable, scale): &(usize, f64)| {
            let at = beside.setting.values[variable];
            let inwards = if at + STEP * scale <= self.range(variable).upper { STEP } else { -STEP };
            let mut moved = beside.setting.clone();
            moved.values[variable] = at + inwards * scale;
            let with = self.at_all(vec![moved])?.pop();
            let per_unit = |with: Place| {
                let change = with.change.iter().zip(&beside.change);
                change.map(|(with, without)| (with - without) / (inwards * scale)).collect()
            };
            Ok(with.map_or_else(|| vec![0.0; self.residual.len()], per_unit))
        };
        of.iter().map(slope).collect()
    }

    /// A place without sizes, where nothing changes.
    fn unchanged(&self, at: &Setting) -> Place {
        Place { setting: self.at_zero(at), change: vec![0.0; self.residual.len()] }
    }

    /// The place where the straight line through 0 comes nearest to the rows.
    fn straight_fit(&self, at: &Setting) -> Result<Option<Place>, Failure> {
        let sizes: Vec<(usize, f64)> = self.declared().amplitudes().collect();
        let slopes = self.slopes(&self.unchanged(at), &sizes)?;
        let Some(fit) = least_squares(&slopes, self.residual) else { return Ok(None) };
        let mut setting = at.clone();
        for (&(size, prior_sd), fit) in sizes.iter().zip(&fit) {
            setting.values[size] = self.range(size).clamp(fit.clamp(-FARTHEST * prior_sd, FARTHEST * prior_sd));
        }
        Ok(self.at_all(vec![setting])?.pop())
    }

    /// Whether the straight line through 0 foretells what the model does at the largest sizes, or nothing is seen of them.
    fn is_straight(&self, at: &Setting) -> Result<bool, Failure> {
        let sizes: Vec<(usize, f64)> = self.declared().amplitudes().collect();
        let slopes = self.slopes(&self.unchanged(at), &sizes)?;
        let outermost = self.expansions.outermost(DIRECTIONS);
        let places = self.with_sizes(at, &outermost)?;
        let foretold = |place: &Place| {
            let mut left = place.change.clone();
            for (&(size, _), slope) in sizes.iter().zip(&slopes) {
                let value = place.setting.values[size];
                left.iter_mut().zip(slope).for_each(|(left, slope)| *left -= slope * value);
            }
            let whole = dot(&place.change, &place.change);
            dot(&left, &left) <= STRAIGHT * STRAIGHT * whole
                || whole <= UNSEEN * UNSEEN * dot(self.residual, self.residual)
        };
        Ok(places.len() == outermost.len() && places.iter().all(foretold))
    }

    /// By Gauss-Newton steps while they help, so many at most.
    fn step_downhill(&self, mut place: Place, steps: usize) -> Result<Place, Failure> {
        let free = self.free();
        for _ in 0..steps {
            let slopes = self.slopes(&place, &free)?;
            let left: Vec<f64> = self.residual.iter().zip(&place.change).map(|(r, change)| r - change).collect();
            let Some(step) = least_squares(&slopes, &left) else { break };
            let shortened = SHARES.map(|share| {
                let mut setting = place.setting.clone();
                for (&(variable, scale), step) in free.iter().zip(&step) {
                    let by = share * step.clamp(-scale, scale);
                    setting.values[variable] = self.range(variable).clamp(setting.values[variable] + by);
                }
                setting
            });
            if !self.improve(&mut place, shortened.to_vec(), WORTH_IT)? {
                break;
            }
        }
        Ok(place)
    }

    /// Along each variable in turn, by moves that are halved where none helps: a simulation whose teeth move has more
    /// kinks than slopes.
    fn feel_downhill(&self, place: &mut Place) -> Result<(), Failure> {
        let sizes = self.declared().amplitudes();
        let largest = sizes.map(|(size, _)| place.setting.values[size].abs()).fold(0.0, f64::max);
        let parts = f64::from(self.expansions.parts.max(1));
        let of_shapes = self.declared().fitted_shapes().map(|(shape, spacing)| (shape, 0.5 * spacing / parts));
        let mut moves: Vec<(usize, f64)> =
            self.declared().amplitudes().map(|(size, _)| (size, FIRST_MOVE * largest)).chain(of_shapes).collect();
        let mut halvings = 0;
        while halvings < HALVINGS {
            let moved = moves.iter().flat_map(|&(variable, by)| [(variable, by), (variable, -by)]);
            let settings = moved.map(|(variable, by)| {
                let mut setting = place.setting.clone();
                setting.values[variable] = self.range(variable).clamp(setting.values[variable] + by);
                setting
            });
            if !self.improve(place, settings.collect(), 0.0)? {
                for (_, by) in &mut moves {
                    *by *= 0.5;
                }
                halvings += 1;
            }
        }
        Ok(())
    }

    /// Goes to the best of several settings where it lowers the misfit by more than a share.
    fn improve(&self, place: &mut Place, settings: Vec<Setting>, share: f64) -> Result<bool, Failure> {
        let tried = self.at_all(settings)?;
        let best = tried.into_iter().min_by(|a, b| self.misfit(a).total_cmp(&self.misfit(b)));
        let Some(best) = best.filter(|best| self.misfit(best) < (1.0 - share) * self.misfit(place)) else {
            return Ok(false);
        };
        *place = best;
        Ok(true)
    }
}

/// What a model changes at settings against 0; those at which it has no value are left out.
fn changes<P>(settings: Vec<Setting>, predict: &P) -> Result<Vec<Place>, Failure>
where
    P: Fn(&[Setting]) -> Result<Vec<Prediction>, Failure> + Sync,
{
    let without = predict(&[])?;
    let place = |setting: Setting| {
        let with = predict(std::slice::from_ref(&setting))?;
        let change: Option<Vec<f64>> = with
            .iter()
            .zip(&without)
            .map(|(with, without)| match (with, without) {
                (Ok(with), Ok(without)) => Some(with - without),
                (Err(_), Ok(_)) => None,
                _ => Some(0.0),
            })
            .collect();
        Ok(change.map(|change| Place { setting, change }))
    };
    let places: Vec<Option<Place>> = settings.into_par_iter().map(place).collect::<Result<_, Failure>>()?;
    Ok(places.into_iter().flatten().collect())
}

/// x of least |target - columns x|; `None` where the columns do not determine it.
fn least_squares(columns: &[Vec<f64>], target: &[f64]) -> Option<Vec<f64>> {
    let count = columns.len();
    let norms: Vec<f64> = columns.iter().map(|column| dot(column, column).sqrt()).collect();
    let unit = |i: usize, j: usize| dot(&columns[i], &columns[j]) / (norms[i] * norms[j]);
    let right = DVector::from_fn(count, |i, _| dot(&columns[i], target) / norms[i]);
    let solution = Cholesky::new(DMatrix::from_fn(count, count, unit))?.solve(&right);
    let x: Vec<f64> = solution.iter().zip(&norms).map(|(x, norm)| x / norm).collect();
    x.iter().all(|x| x.is_finite()).then_some(x)
}

#[cfg(test)]
mod tests;
