//! Gauss-Newton about the model itself for the sets that lead (`diagnosis/3.4`, refinement).

use nalgebra::{Cholesky, DMatrix};

use crate::calculator::{Failure, Hypothesis, Monitor, Range, Shape, Treatment, Variable, checkpoint};
use crate::diagnosis::causes::subject::{Setting, Subject};
use crate::diagnosis::statistics::discrepancy::Remainder;
use crate::diagnosis::statistics::evidence::{Evidence, Normal, Side};
use crate::diagnosis::statistics::likelihood::Likelihood;
use crate::diagnosis::statistics::whiten::White;

/// Steps where only amplitudes are free.
const STEPS: usize = 4;
/// Steps where shapes are free too.
const STEPS_WITH_SHAPES: usize = 6;
/// Longest step, prior standard deviations.
const LONGEST_STEP: f64 = 2.0;
/// A step shorter than this changes nothing that is reported: a hundredth of a prior standard deviation,
/// or of a posterior one where that is smaller.
pub(in crate::diagnosis) const SETTLED: f64 = 0.01;
/// Where the steps end before that, one shorter than this still says that the optimum is near.
const SHORT: f64 = 0.2;

/// Where a refinement begins.
#[derive(Debug, Clone, PartialEq)]
pub(in crate::diagnosis) struct Start {
    /// The optimum of the model as it was linearised.
    pub(in crate::diagnosis) settings: Vec<Setting>,
    /// About what it was linearised.
    pub(in crate::diagnosis) about: Vec<Setting>,
}

/// A set of causes fitted with the model linearised at its optimum.
#[derive(Debug, Clone, PartialEq)]
pub(in crate::diagnosis) struct Fit {
    pub(in crate::diagnosis) settings: Vec<Setting>,
    /// What is free: member of the set and its variable.
    pub(in crate::diagnosis) free: Vec<(usize, usize)>,
    /// Their Gaussian coordinates.
    pub(in crate::diagnosis) coordinates: Vec<Coordinate>,
    /// Laplace evidence.
    pub(in crate::diagnosis) log_z: f64,
    /// Covariance of the free values, in their units.
    pub(in crate::diagnosis) covariance: DMatrix<f64>,
    /// Posterior means in units of the priors, before they are cut at the bounds.
    pub(in crate::diagnosis) t: Vec<f64>,
    pub(in crate::diagnosis) sides: Vec<Side>,
    /// Columns at the optimum, whitened, at one prior standard deviation.
    pub(in crate::diagnosis) columns: Vec<White>,
    /// y - f(theta) + X t there, whitened.
    pub(in crate::diagnosis) residual: White,
    /// The same columns on the rows, per unit of each value.
    pub(in crate::diagnosis) slopes: Vec<Vec<f64>>,
    /// Whether the last step was short.
    pub(in crate::diagnosis) settled: bool,
    /// Whether a shape is free.
    pub(in crate::diagnosis) with_shapes: bool,
    /// min |r - X t|^2 + |t|^2.
    pub(in crate::diagnosis) q: f64,
}

impl Fit {
    /// Posterior standard deviations of the values of every member, 0 of what is not free.
    pub(in crate::diagnosis) fn standard_deviations(&self) -> Vec<Vec<f64>> {
        let mut deviations: Vec<Vec<f64>> = self.settings.iter().map(|s| vec![0.0; s.values.len()]).collect();
        for (k, &(member, variable)) in self.free.iter().enumerate() {
            deviations[member][variable] = self.covariance[(k, k)].sqrt();
        }
        deviations
    }

    /// Values as they are beside a remainder that takes its share of the rows, with what that leaves open of them.
    pub(in crate::diagnosis) fn move_beside(
        &self,
        remainder: &Remainder,
        hypotheses: &[Hypothesis],
        settings: &mut [Setting],
        standard_deviations: &mut [Vec<f64>],
    ) {
        for (k, (&(member, variable), coordinate)) in self.free.iter().zip(&self.coordinates).enumerate() {
            let range = hypotheses[settings[member].hypothesis].variables[variable].range;
            let value = &mut settings[member].values[variable];
            *value = coordinate.moved(remainder.of_causes[k], range);
            let open: f64 = remainder.directions.iter().map(|direction| direction[k] * direction[k]).sum();
            let own = &mut standard_deviations[member][variable];
            *own = own.max(open.sqrt() * coordinate.slope(*value));
        }
    }

    /// The settings with these free values, in units of their priors, within their bounds.
    pub(in crate::diagnosis) fn moved(&self, t: &[f64], hypotheses: &[Hypothesis]) -> Vec<Setting> {
        let mut settings = self.settings.clone();
        for ((&(member, variable), coordinate), t) in self.free.iter().zip(&self.coordinates).zip(t) {
            let range = hypotheses[settings[member].hypothesis].variables[variable].range;
            settings[member].values[variable] = coordinate.moved(*t, range);
        }
        settings
    }

    /// The free values at other settings, in units of their priors.
    pub(in crate::diagnosis) fn coordinates_at(&self, settings: &[Setting]) -> Vec<f64> {
        let of = |(&(member, variable), coordinate): (&(usize, usize), &Coordinate)| {
            coordinate.t(settings[member].values[variable])
        };
        self.free.iter().zip(&self.coordinates).map(of).collect()
    }
}

/// A free value and its Gaussian coordinate t ~ N(0, 1).
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::diagnosis) enum Coordinate {
    /// t = value / sd.
    Amplitude {
        /// Prior standard deviation.
        sd: f64,
    },
    /// About the mean of a shape's prior.
    Shape(Shape),
}

impl Coordinate {
    pub(in crate::diagnosis) fn of(variable: &Variable) -> Option<Self> {
        match &variable.treatment {
            Treatment::Amplitude { prior_sd } => Some(Self::Amplitude { sd: *prior_sd }),
            Treatment::Shape { prior: Some(prior), .. } => Some(Self::Shape(*prior)),
            _ => None,
        }
    }

    /// On which side of 0 it may lie.
    pub(in crate::diagnosis) fn side(self, range: Range) -> Side {
        match self {
            Self::Amplitude { .. } => Side::of(range),
            Self::Shape(_) => Side::Both,
        }
    }

    pub(in crate::diagnosis) fn t(self, value: f64) -> f64 {
        match self {
            Self::Amplitude { sd } => value / sd,
            Self::Shape(Shape { mean, sd, logarithmic: true }) => (value.ln() - mean) / sd,
            Self::Shape(Shape { mean, sd, logarithmic: false }) => (value - mean) / sd,
        }
    }

    pub(in crate::diagnosis) fn value(self, t: f64) -> f64 {
        match self {
            Self::Amplitude { sd } => sd * t,
            Self::Shape(Shape { mean, sd, logarithmic: true }) => (mean + sd * t).exp(),
            Self::Shape(Shape { mean, sd, logarithmic: false }) => mean + sd * t,
        }
    }

    /// d value / d t.
    pub(in crate::diagnosis) fn slope(self, value: f64) -> f64 {
        match self {
            Self::Shape(Shape { sd, logarithmic: true, .. }) => sd * value,
            Self::Amplitude { sd } | Self::Shape(Shape { sd, logarithmic: false, .. }) => sd,
        }
    }

    /// The value at t, inside its range.
    pub(in crate::diagnosis) fn moved(self, t: f64, range: Range) -> f64 {
        range.clamp(self.value(t))
    }
}

/// What stays the same while a set is refined.
pub(in crate::diagnosis) struct Refinement<'a> {
    pub(in crate::diagnosis) subject: &'a dyn Subject,
    pub(in crate::diagnosis) value: &'a [f64],
    pub(in crate::diagnosis) keep: &'a [bool],
    pub(in crate::diagnosis) likelihood: &'a Likelihood,
    /// Minus twice the log-likelihood of the base alone.
    pub(in crate::diagnosis) misfit_of_base: f64,
    /// Whether the model is far from linear in its sizes.
    pub(in crate::diagnosis) nonlinear: bool,
    pub(in crate::diagnosis) monitor: &'a dyn Monitor,
}

impl Refinement<'_> {
    /// Refines from `start`; `None` where the model has no value for a row on the way.
    pub(in crate::diagnosis) fn fit(&self, start: Start, with_shapes: bool) -> Result<Option<Fit>, Failure> {
        let unknowns = Unknowns::of(self.subject.hypotheses(), &start.settings, with_shapes);
        if self.nonlinear { self.descend(&start, unknowns) } else { self.step(start.settings, unknowns) }
    }

    /// Gauss-Newton, every step taken as it comes.
    fn step(&self, start: Vec<Setting>, unknowns: Unknowns) -> Result<Option<Fit>, Failure> {
        let most = if unknowns.with_shapes() { STEPS_WITH_SHAPES } else { STEPS };
        let mut settings = start;
        let mut step = 0;
        loop {
            checkpoint(self.monitor)?;
            let Some(raw) = self.raw_residual(&settings)? else { return Ok(None) };
            let here = self.linearise(&raw, &settings, &unknowns.free, &unknowns.coordinates)?;
            let Some(evidence) = here.evidence(self.likelihood, &unknowns) else { return Ok(None) };
            let (next, longest) = unknowns.moved(&settings, &evidence, 1.0);
            settings = next;
            step += 1;
            if longest < SETTLED || step >= most {
                return Ok(Some(unknowns.fit(settings, evidence, here, longest < SHORT)));
            }
        }
    }

    /// The declaration of a free value.
    pub(in crate::diagnosis) fn variable(&self, fit: &Fit, k: usize) -> &Variable {
        let (member, variable) = fit.free[k];
        &self.subject.hypotheses()[fit.settings[member].hypothesis].variables[variable]
    }

    /// Twice minus the log-posterior, up to a constant, at settings that leave this of the rows.
    pub(in crate::diagnosis) fn cost(&self, raw: &[f64], settings: &[Setting], unknowns: &Unknowns) -> f64 {
        let prior: f64 = unknowns.coordinates_of(settings).map(|t| t * t).sum();
        self.likelihood.misfit(&self.likelihood.white(raw)) + prior
    }

    /// y - f, whitened; `None` where the model has no value for a row that counts.
    pub(in crate::diagnosis) fn residual(&self, settings: &[Setting]) -> Result<Option<White>, Failure> {
        Ok(self.raw_residual(settings)?.map(|raw| self.likelihood.white(&raw)))
    }

    pub(in crate::diagnosis) fn raw_residual(&self, settings: &[Setting]) -> Result<Option<Vec<f64>>, Failure> {
        let predicted = self.subject.predict(settings)?;
        let rows = self.value.iter().zip(predicted).zip(self.keep);
        Ok(rows.map(|((y, f), keep)| if *keep { f.ok().map(|f| y - f) } else { Some(0.0) }).collect())
    }

    /// One Gauss-Newton step of all free values but one, with these columns.
    pub(in crate::diagnosis) fn move_others(
        &self,
        fit: &Fit,
        columns: &[White],
        settings: &mut [Setting],
        residual: &White,
        fixed: Option<usize>,
    ) {
        let t = fit.coordinates_at(settings);
        let others: Vec<usize> = (0..fit.free.len()).filter(|k| Some(*k) != fixed).collect();
        let of_others: Vec<&White> = others.iter().map(|&k| &columns[k]).collect();
        let Some(Normal { mut gram, mut right, .. }) = self.likelihood.normal(&of_others, residual) else { return };
        for (i, &k) in others.iter().enumerate() {
            gram[(i, i)] += 1.0;
            right[i] -= t[k];
        }
        let Some(factor) = Cholesky::new(gram) else { return };
        let step = factor.solve(&right);
        for (i, &k) in others.iter().enumerate() {
            let (member, variable) = fit.free[k];
            let moved = t[k] + step[i].clamp(-LONGEST_STEP, LONGEST_STEP);
            settings[member].values[variable] = fit.coordinates[k].moved(moved, self.variable(fit, k).range);
        }
    }

    /// Columns of the free values of a fit about other settings.
    pub(in crate::diagnosis) fn columns_at(&self, fit: &Fit, settings: &[Setting]) -> Result<Vec<White>, Failure> {
        let nothing = vec![0.0; self.value.len()];
        Ok(self.linearise(&nothing, settings, &fit.free, &fit.coordinates)?.columns)
    }

    /// About settings that leave `raw` of the rows.
    pub(in crate::diagnosis) fn linearise(
        &self,
        raw: &[f64],
        settings: &[Setting],
        free: &[(usize, usize)],
        coordinates: &[Coordinate],
    ) -> Result<Here, Failure> {
        let mut residual = raw.to_vec();
        let slopes = self.subject.jacobian(settings, free)?;
        let mut columns = Vec::with_capacity(free.len());
        for ((&(member, variable), coordinate), slope) in free.iter().zip(coordinates).zip(&slopes) {
            let value = settings[member].values[variable];
            let by = coordinate.slope(value);
            let column: Vec<f64> = slope.iter().map(|s| s * by).collect();
            let t = coordinate.t(value);
            residual.iter_mut().zip(&column).for_each(|(r, c)| *r += c * t);
            columns.push(self.likelihood.white(&column));
        }
        Ok(Here { residual: self.likelihood.white(&residual), columns, slopes })
    }
}

/// The model about a place.
pub(in crate::diagnosis) struct Here {
    /// y - f(theta) + X t there, whitened.
    pub(in crate::diagnosis) residual: White,
    /// Whitened, at one prior standard deviation.
    pub(in crate::diagnosis) columns: Vec<White>,
    slopes: Vec<Vec<f64>>,
}

impl Here {
    pub(in crate::diagnosis) fn evidence(&self, likelihood: &Likelihood, unknowns: &Unknowns) -> Option<Evidence> {
        likelihood.evidence(&self.columns.iter().collect::<Vec<_>>(), &self.residual, &unknowns.sides)
    }

    /// What the straight model foretells of the cost at coordinates.
    pub(in crate::diagnosis) fn foretold(&self, likelihood: &Likelihood, t: &[f64]) -> f64 {
        let left = self.columns.iter().zip(t).fold(self.residual.clone(), |left, (x, t)| left.minus(&x.times(*t)));
        likelihood.misfit(&left) + t.iter().map(|t| t * t).sum::<f64>()
    }
}

/// What is free of a set while it is refined.
pub(in crate::diagnosis) struct Unknowns {
    /// Member of the set and its variable.
    free: Vec<(usize, usize)>,
    coordinates: Vec<Coordinate>,
    ranges: Vec<Range>,
    sides: Vec<Side>,
}

impl Unknowns {
    fn of(hypotheses: &[Hypothesis], settings: &[Setting], with_shapes: bool) -> Self {
        let mut unknowns = Self { free: Vec::new(), coordinates: Vec::new(), ranges: Vec::new(), sides: Vec::new() };
        for (member, setting) in settings.iter().enumerate() {
            for (index, variable) in hypotheses[setting.hypothesis].variables.iter().enumerate() {
                let Some(coordinate) = Coordinate::of(variable) else { continue };
                if matches!(coordinate, Coordinate::Shape(_)) && !with_shapes {
                    continue;
                }
                unknowns.free.push((member, index));
                unknowns.coordinates.push(coordinate);
                unknowns.ranges.push(variable.range);
                unknowns.sides.push(coordinate.side(variable.range));
            }
        }
        unknowns
    }

    fn with_shapes(&self) -> bool {
        self.coordinates.iter().any(|coordinate| matches!(coordinate, Coordinate::Shape(_)))
    }

    pub(in crate::diagnosis) fn coordinates_of(&self, settings: &[Setting]) -> impl Iterator<Item = f64> {
        let of = |(&(member, variable), coordinate): (&(usize, usize), &Coordinate)| {
            coordinate.t(settings[member].values[variable])
        };
        self.free.iter().zip(&self.coordinates).map(of)
    }

    /// The model linearised about settings.
    pub(in crate::diagnosis) fn linearised(
        &self,
        refinement: &Refinement<'_>,
        raw: &[f64],
        settings: &[Setting],
    ) -> Result<Here, Failure> {
        refinement.linearise(raw, settings, &self.free, &self.coordinates)
    }

    /// Settings at coordinates, within their bounds.
    pub(in crate::diagnosis) fn at(&self, settings: &[Setting], t: impl IntoIterator<Item = f64>) -> Vec<Setting> {
        let mut settings = settings.to_vec();
        for (k, t) in t.into_iter().enumerate() {
            let (member, variable) = self.free[k];
            settings[member].values[variable] = self.coordinates[k].moved(t, self.ranges[k]);
        }
        settings
    }

    /// A share of the way to the optimum of the straight model, and its longest move in posterior standard deviations. What
    /// would pass its bound is projected on it: a reflection would swing to and fro about an optimum at a bound.
    pub(in crate::diagnosis) fn moved(
        &self,
        settings: &[Setting],
        evidence: &Evidence,
        share: f64,
    ) -> (Vec<Setting>, f64) {
        let before: Vec<f64> = self.coordinates_of(settings).collect();
        let step = |(t, wanted): (&f64, &f64)| t + share * (wanted - t).clamp(-LONGEST_STEP, LONGEST_STEP);
        let moved = self.at(settings, before.iter().zip(&evidence.t).map(step));
        let longest = self
            .coordinates_of(&moved)
            .zip(&before)
            .enumerate()
            .map(|(k, (t, before))| (t - before).abs() / evidence.covariance[(k, k)].sqrt().clamp(0.05, 1.0))
            .fold(0.0, f64::max);
        (moved, longest)
    }

    /// The fit at settings about which, or nearly so, the model was linearised.
    pub(in crate::diagnosis) fn fit(
        self,
        settings: Vec<Setting>,
        evidence: Evidence,
        here: Here,
        settled: bool,
    ) -> Fit {
        let scale: Vec<f64> = self
            .free
            .iter()
            .zip(&self.coordinates)
            .map(|(&(member, variable), coordinate)| coordinate.slope(settings[member].values[variable]))
            .collect();
        let of = |i: usize, j: usize| evidence.covariance[(i, j)] * scale[i] * scale[j];
        let covariance = DMatrix::from_fn(scale.len(), scale.len(), of);
        Fit {
            settings,
            with_shapes: self.with_shapes(),
            free: self.free,
            coordinates: self.coordinates,
            log_z: evidence.log_z,
            covariance,
            t: evidence.t,
            sides: self.sides,
            columns: here.columns,
            residual: here.residual,
            slopes: here.slopes,
            settled,
            q: evidence.q,
        }
    }
}
