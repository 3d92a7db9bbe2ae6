//! Where a hypothesis comes nearest to the rows, where a straight line through 0 does not tell (`diagnosis/3.4`).
//!
//! A search by coarse predictions alone, before anything is known of scatter and priors: it only says about which sizes the
//! model is worth being linearised. What is found there is weighed with all that is known.

use nalgebra::{Cholesky, DMatrix, DVector};
use rayon::prelude::*;

use super::basis::dot;
use super::subject::{Setting, Subject};
use crate::calculator::{Expansions, Failure, Hypothesis, JacobianColumn, Monitor, Range, checkpoint};

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
/// Where it does not: which of the sizes are tried far from the straight line, and which points between those of the grid.
const EVERY_PLACE: usize = 3;
const EVERY_PART: usize = 2;
/// First move along one variable, share of the largest size.
const FIRST_MOVE: f64 = 0.1;
/// How often the moves are halved: to a quarter.
const HALVINGS: u32 = 3;
/// How many of the places are moved so.
const FELT: usize = 4;
/// Places nearer to one another than this, on the scale of each variable, are one.
const SAME: f64 = 0.02;

/// A place beside 0 with what the model changes there against 0.
pub(super) struct Place {
    pub(super) setting: Setting,
    pub(super) change: Vec<f64>,
}

/// One hypothesis and what was measured.
pub(super) struct Survey<'a> {
    subject: &'a dyn Subject,
    hypothesis: usize,
    /// Measured minus base.
    residual: &'a [f64],
    expansions: Expansions,
}

impl<'a> Survey<'a> {
    pub(super) fn new(subject: &'a dyn Subject, hypothesis: usize, residual: &'a [f64]) -> Self {
        Self { subject, hypothesis, residual, expansions: subject.expansions(hypothesis) }
    }

    /// The places about which a hypothesis is linearised beside 0, each with its point of the grid; those that were
    /// looked for off the grid have none. `grid` are its shapes with sizes of 0. Where the model has no value there is no
    /// place.
    pub(super) fn places(
        &self,
        grid: &[Setting],
        monitor: &dyn Monitor,
    ) -> Result<Vec<(Option<usize>, Place)>, Failure> {
        if self.expansions.places.len() > self.expansions.nearest {
            let on_grid = self.declared().fitted_shapes().next().is_none().then_some(0);
            return Ok(self.nearest(grid, monitor)?.into_iter().map(|place| (on_grid, place)).collect());
        }
        let mut found = Vec::new();
        for (point, at) in grid.iter().enumerate() {
            checkpoint(monitor)?;
            let places = self.with_sizes(at, &self.expansions.places)?;
            found.extend(places.into_iter().map(|place| (Some(point), place)));
        }
        Ok(found)
    }

    /// The places that come nearest to the rows. At every point of the grid that shape is taken at which a straight line
    /// explains most; from the best of these, and there from all the sizes given, downhill.
    fn nearest(&self, grid: &[Setting], monitor: &dyn Monitor) -> Result<Vec<Place>, Failure> {
        let mut starts = Vec::new();
        for at in grid {
            checkpoint(monitor)?;
            let settings = self.refined(at);
            let fits: Vec<Vec<Place>> =
                settings.par_iter().map(|at| self.straight_fit(at)).collect::<Result<_, Failure>>()?;
            let best = fits.into_iter().flatten().min_by(|a, b| self.misfit(a).total_cmp(&self.misfit(b)));
            starts.extend(best);
        }
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
        for place in &mut found {
            checkpoint(monitor)?;
            self.step_downhill(place)?;
        }
        self.leave_one_of_each(&mut found);
        if !straight && self.expansions.parts > 1 && !found.first().is_some_and(|best| self.explains(best)) {
            found.extend(self.far_from_straight(grid, monitor)?);
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

    /// Where the best of those that a straight line leads to leaves much: all the sizes given at every point of the grid, a few at
    /// points between, and from the best of these downhill. A large wave shows another shape than a small one, so that no
    /// straight line tells which ratio it has; and one that comes back alike in every turn is found at that very ratio only.
    fn far_from_straight(&self, grid: &[Setting], monitor: &dyn Monitor) -> Result<Vec<Place>, Failure> {
        let few: Vec<Vec<f64>> = self.expansions.places.iter().step_by(EVERY_PLACE).cloned().collect();
        let mut found = Vec::new();
        for at in grid {
            checkpoint(monitor)?;
            let mut best = |at: &Setting, sizes: &[Vec<f64>]| {
                let places = self.with_sizes(&self.at_zero(at), sizes)?;
                found.extend(places.into_iter().min_by(|a, b| self.misfit(a).total_cmp(&self.misfit(b))));
                Ok::<(), Failure>(())
            };
            best(at, &self.expansions.places)?;
            for between in self.refined(at).iter().step_by(EVERY_PART) {
                best(between, &few)?;
            }
        }
        self.rank(&mut found);
        for place in &mut found {
            checkpoint(monitor)?;
            self.step_downhill(place)?;
        }
        Ok(found)
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

    fn with_sizes(&self, at: &Setting, sizes: &[Vec<f64>]) -> Result<Vec<Place>, Failure> {
        let settings = sizes.iter().map(|sizes| {
            let mut setting = at.clone();
            self.declared().amplitudes().zip(sizes).for_each(|((variable, _), size)| setting.values[variable] = *size);
            setting
        });
        self.at_all(settings.collect())
    }

    /// What the model changes against 0; places where it has no value are left out.
    fn at_all(&self, settings: Vec<Setting>) -> Result<Vec<Place>, Failure> {
        let without = self.subject.predict_coarsely(&[])?;
        let place = |setting: Setting| {
            let with = self.subject.predict_coarsely(std::slice::from_ref(&setting))?;
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

    /// What was measured and is not explained at a place.
    fn misfit(&self, place: &Place) -> f64 {
        self.residual.iter().zip(&place.change).map(|(r, change)| (r - change) * (r - change)).sum()
    }

    /// Leaves those that come nearest to the rows, nearest first.
    fn rank(&self, places: &mut Vec<Place>) {
        places.sort_by(|a, b| self.misfit(a).total_cmp(&self.misfit(b)));
        places.truncate(self.expansions.nearest);
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

    fn slopes(&self, at: &Setting, of: &[(usize, f64)]) -> Result<Vec<JacobianColumn>, Failure> {
        let of: Vec<(usize, usize)> = of.iter().map(|(variable, _)| (0, *variable)).collect();
        self.subject.jacobian(std::slice::from_ref(at), &of)
    }

    /// The place where the straight line through 0 comes nearest to the rows.
    fn straight_fit(&self, at: &Setting) -> Result<Vec<Place>, Failure> {
        let sizes: Vec<(usize, f64)> = self.declared().amplitudes().collect();
        let Some(fit) = least_squares(&self.slopes(at, &sizes)?, self.residual) else { return Ok(Vec::new()) };
        let mut setting = at.clone();
        for (&(size, prior_sd), fit) in sizes.iter().zip(&fit) {
            setting.values[size] = self.range(size).clamp(fit.clamp(-FARTHEST * prior_sd, FARTHEST * prior_sd));
        }
        self.at_all(vec![setting])
    }

    /// Whether the straight line through 0 foretells what the model does at the largest sizes, or nothing is seen of them.
    fn is_straight(&self, at: &Setting) -> Result<bool, Failure> {
        let sizes: Vec<(usize, f64)> = self.declared().amplitudes().collect();
        let slopes = self.slopes(at, &sizes)?;
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

    /// By Gauss-Newton steps while they help.
    fn step_downhill(&self, place: &mut Place) -> Result<(), Failure> {
        let free = self.free();
        for _ in 0..STEPS {
            let slopes = self.slopes(&place.setting, &free)?;
            let left: Vec<f64> = self.residual.iter().zip(&place.change).map(|(r, change)| r - change).collect();
            let Some(step) = least_squares(&slopes, &left) else { return Ok(()) };
            let shortened = SHARES.iter().map(|share| {
                let mut setting = place.setting.clone();
                for (&(variable, scale), step) in free.iter().zip(&step) {
                    let by = share * step.clamp(-scale, scale);
                    setting.values[variable] = self.range(variable).clamp(setting.values[variable] + by);
                }
                setting
            });
            if !self.improve(place, shortened.collect(), WORTH_IT)? {
                return Ok(());
            }
        }
        Ok(())
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
mod tests {
    use super::*;
    use crate::calculator::{Hypothesis, Prediction, Shape, Treatment, Unwatched, Variable};
    use crate::effects::RING_CAUSES;

    /// A wave of two quadratures with a ratio, whose phase turns with its amplitude.
    struct Wave {
        hypotheses: Vec<Hypothesis>,
        turns_per_size: f64,
        parts: u32,
    }

    const ROWS: usize = 200;
    const NEAREST: usize = 6;

    impl Wave {
        fn new(turns_per_size: f64, ratios: Vec<f64>, parts: u32) -> Self {
            let variable =
                |name, treatment, lower, upper| Variable { name, unit: "mm", treatment, range: Range { lower, upper } };
            let size = || Treatment::Amplitude { prior_sd: 1.0 };
            let prior = (ratios.len() > 1).then_some(Shape { mean: 5.0, sd: 3.0, logarithmic: false });
            let variables = vec![
                variable("cos", size(), -10.0, 10.0),
                variable("sin", size(), -10.0, 10.0),
                variable("ratio", Treatment::Shape { grid: ratios, prior }, 0.5, 50.0),
            ];
            let cause = &RING_CAUSES[0];
            let hypotheses = vec![Hypothesis { cause, label: String::new(), variables, prior_weight: 1.0, held: None }];
            Self { hypotheses, turns_per_size, parts }
        }

        fn rows(&self, values: &[f64]) -> Vec<f64> {
            let (amplitude, phase) = (values[0].hypot(values[1]), values[1].atan2(values[0]));
            let of = |i: usize| 20.0 * i as f64 / ROWS as f64;
            let turned = phase + self.turns_per_size * std::f64::consts::TAU * amplitude;
            (0..ROWS).map(|i| amplitude * (values[2] * of(i) + turned).cos()).collect()
        }

        fn nearest(&self, truth: &[f64]) -> (Vec<Place>, Vec<f64>) {
            let residual = self.rows(truth);
            let grid: Vec<Setting> = match &self.hypotheses[0].variables[2].treatment {
                Treatment::Shape { grid, .. } => grid.clone(),
                _ => Vec::new(),
            }
            .into_iter()
            .map(|ratio| Setting { hypothesis: 0, values: vec![0.0, 0.0, ratio] })
            .collect();
            let places = Survey::new(self, 0, &residual).places(&grid, &Unwatched).expect("nothing cancels it");
            (places.into_iter().map(|(_, place)| place).collect(), residual)
        }
    }

    impl Subject for Wave {
        fn hypotheses(&self) -> &[Hypothesis] {
            &self.hypotheses
        }

        fn predict(&self, effects: &[Setting]) -> Result<Vec<Prediction>, Failure> {
            let values = effects.first().map_or(vec![0.0; ROWS], |setting| self.rows(&setting.values));
            Ok(values.into_iter().map(Ok).collect())
        }

        fn expansions(&self, _hypothesis: usize) -> Expansions {
            let of = |k: usize, size: f64| {
                let (sin, cos) = (std::f64::consts::TAU * k as f64 / 12.0).sin_cos();
                vec![size * cos, size * sin]
            };
            let places = [0.4, 0.8, 1.2].iter().flat_map(|&size| (0..12).map(move |k| of(k, size))).collect();
            Expansions { places, nearest: NEAREST, parts: self.parts }
        }

        fn jacobian(&self, effects: &[Setting], of: &[(usize, usize)]) -> Result<Vec<JacobianColumn>, Failure> {
            let slope = |&(member, variable): &(usize, usize)| {
                let mut moved = effects[member].values.clone();
                moved[variable] += 1e-6;
                let (with, without) = (self.rows(&moved), self.rows(&effects[member].values));
                with.iter().zip(&without).map(|(with, without)| (with - without) / 1e-6).collect()
            };
            Ok(of.iter().map(slope).collect())
        }

        fn nuisances(&self) -> Result<Vec<JacobianColumn>, Failure> {
            Ok(Vec::new())
        }
    }

    /// Share of what was measured that a place leaves.
    fn left(place: &Place, residual: &[f64]) -> f64 {
        let left: Vec<f64> = residual.iter().zip(&place.change).map(|(r, change)| r - change).collect();
        dot(&left, &left) / dot(residual, residual)
    }

    #[test]
    fn a_straight_model_has_one_place_where_least_squares_puts_it() {
        let truth = [0.6, -0.9, 5.0];
        let (places, residual) = Wave::new(0.0, vec![5.0], 1).nearest(&truth);
        assert_eq!(places.len(), 1);
        assert!(left(&places[0], &residual) < 1e-10);
        let values = &places[0].setting.values;
        assert!(values.iter().zip(truth).all(|(found, truth)| (found - truth).abs() < 1e-5), "{values:?}");
    }

    #[test]
    fn a_model_that_turns_with_its_size_is_found_far_from_its_straight_line() {
        // Three whole turns at the size hidden: a straight line from 0 shows nothing of it.
        let wave = Wave::new(3.0, vec![5.0], 1);
        let (places, residual) = wave.nearest(&[0.7, 0.71, 5.0]);
        assert!(places.len() <= NEAREST);
        // Beside the truth lie local optima a turn farther in or out; the first must be the truth itself.
        assert!(left(&places[0], &residual) < 1e-2, "{}", left(&places[0], &residual));
        assert!(places.windows(2).all(|pair| left(&pair[0], &residual) <= left(&pair[1], &residual)));
    }

    #[test]
    fn a_shape_between_the_points_of_its_grid_is_found() {
        // A whole step of the grid turns the end of the rows three times; a tenth of it keeps the phase within a third.
        let wave = Wave::new(0.0, (2..=10).map(f64::from).collect(), 10);
        let (places, residual) = wave.nearest(&[0.3, 0.4, 5.37]);
        assert!(left(&places[0], &residual) < 1e-6, "{}", left(&places[0], &residual));
        assert!((places[0].setting.values[2] - 5.37).abs() < 1e-3, "{:?}", places[0].setting.values);
    }
}
