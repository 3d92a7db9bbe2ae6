//! Residuals and priors as one system of equations, weighted by the loss.

use super::differences::Differences;
use super::{Loss, Model, NoFit, Parameter};
use crate::dense::Columns;

/// How well derivatives must be known.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Quality {
    /// Good enough to descend.
    Plain,
    /// As good as the model's own digits allow.
    Best,
}

/// The equations of a fit.
pub(super) struct System<'a> {
    model: &'a dyn Model,
    pub(super) parameters: &'a [Parameter],
    loss: Loss,
    differences: Differences,
    evaluations: u32,
    start: Point,
}

/// A point with all that was computed there.
#[derive(Debug, Clone)]
pub(super) struct Point {
    /// Parameters.
    pub(super) at: Vec<f64>,
    /// Residuals, then priors.
    pub(super) raw: Vec<f64>,
    /// What is made small.
    pub(super) objective: f64,
}

/// First-order model at a point, weighted.
#[derive(Debug, Clone)]
pub(super) struct Tangent {
    pub(super) residuals: Vec<f64>,
    pub(super) columns: Columns,
}

impl<'a> System<'a> {
    pub(super) fn new(model: &'a dyn Model, parameters: &'a [Parameter], loss: Loss) -> Result<Self, NoFit> {
        for (index, parameter) in parameters.iter().enumerate() {
            let Parameter { start, lower, upper, prior } = *parameter;
            let sound = start.is_finite()
                && lower <= start
                && start <= upper
                && prior.is_none_or(|(mean, sd)| mean.is_finite() && sd.is_finite() && sd > 0.0);
            if !sound {
                return Err(NoFit::BadParameter(index));
            }
        }
        let free = parameters.iter().filter(|p| p.lower < p.upper).count();
        let equations = model.residual_count() + parameters.iter().filter(|p| p.prior.is_some()).count();
        if equations < free {
            return Err(NoFit::TooFewResiduals { residuals: equations, parameters: free });
        }
        let at: Vec<f64> = parameters.iter().map(|p| p.start).collect();
        let differences = Differences::new(parameters);
        let start = Point { at: at.clone(), raw: Vec::new(), objective: 0.0 };
        let mut system = Self { model, parameters, loss, differences, evaluations: 0, start };
        let start = system.point(at);
        if let Some(row) = start.raw.iter().position(|r| !r.is_finite()) {
            return Err(NoFit::UndefinedAtStart(row));
        }
        system.start = start;
        Ok(system)
    }

    pub(super) fn evaluations(&self) -> u32 {
        self.evaluations
    }
    pub(super) fn start(&self) -> Point {
        self.start.clone()
    }
    pub(super) fn data_count(&self) -> usize {
        self.model.residual_count()
    }

    /// Residuals and priors at a point.
    pub(super) fn point(&mut self, at: Vec<f64>) -> Point {
        let raw = self.raw(&at);
        let data = self.data_count();
        let loss = self.loss;
        let objective =
            raw.iter().enumerate().map(|(i, r)| if i < data { loss.cost(r * r) } else { r * r }).sum::<f64>();
        let objective = if objective.is_nan() { f64::INFINITY } else { objective };
        Point { at, raw, objective }
    }

    pub(super) fn raw(&mut self, at: &[f64]) -> Vec<f64> {
        self.evaluations += 1;
        let mut raw = vec![0.0; self.data_count()];
        self.model.residuals(at, &mut raw);
        let priors = self.parameters.iter().zip(at).filter_map(|(p, b)| p.prior.map(|(mean, sd)| (b - mean) / sd));
        raw.extend(priors);
        raw
    }

    /// By how much the objective falls from one point to another, without the loss of digits of two sums.
    pub(super) fn fall(&self, from: &Point, to: &Point) -> f64 {
        let data = self.data_count();
        let falls = from.raw.iter().zip(&to.raw).enumerate().map(|(i, (a, b))| {
            if i < data && self.loss != Loss::Squared {
                self.loss.cost(a * a) - self.loss.cost(b * b)
            } else {
                (a - b) * (a + b)
            }
        });
        falls.sum()
    }

    /// Roots of the loss's weights, 1 for priors.
    fn weights(&self, raw: &[f64]) -> Vec<f64> {
        let data = self.data_count();
        let weight = |(i, r): (usize, &f64)| if i < data { self.loss.weight(r * r).sqrt() } else { 1.0 };
        raw.iter().enumerate().map(weight).collect()
    }

    /// The loss's weights applied to rows computed from `point`.
    pub(super) fn weigh(&self, point: &Point, rows: &mut [f64]) {
        if self.loss != Loss::Squared {
            for (row, weight) in rows.iter_mut().zip(self.weights(&point.raw)) {
                *row *= weight;
            }
        }
    }

    /// Residuals and derivatives at a point, weighted; `None` where the derivatives do not exist.
    pub(super) fn tangent(&mut self, point: &Point, quality: Quality) -> Option<Tangent> {
        let data = self.data_count();
        let mut columns = Columns::zeros(point.raw.len(), self.parameters.len());
        let mut own = Columns::zeros(data, self.parameters.len());
        if self.model.jacobian(&point.at, &mut own) {
            for j in 0..self.parameters.len() {
                columns.column_mut(j)[..data].copy_from_slice(own.column(j));
            }
        } else {
            let mut differences = std::mem::take(&mut self.differences);
            let complete = differences.columns(self, point, quality, &mut columns);
            self.differences = differences;
            if !complete {
                return None;
            }
        }
        let mut row = data;
        for (j, parameter) in self.parameters.iter().enumerate() {
            if let Some((_, sd)) = parameter.prior {
                columns.column_mut(j)[row] = 1.0 / sd;
                row += 1;
            }
        }
        if (0..columns.count()).any(|j| columns.column(j).iter().any(|d| !d.is_finite())) {
            return None;
        }
        let mut residuals = point.raw.clone();
        if self.loss != Loss::Squared {
            let weights = self.weights(&point.raw);
            self.weigh(point, &mut residuals);
            columns = columns.scaled_rows(&weights);
        }
        Some(Tangent { residuals, columns })
    }

    /// Steps of the differences are to be looked for anew.
    pub(super) fn forget_steps(&mut self) {
        self.differences.forget();
    }

    /// Size against which changes of a parameter are measured at a point.
    pub(super) fn scale(&self, at: &[f64], index: usize) -> f64 {
        at[index].abs().max(1e-3 * self.parameters[index].scale())
    }
}
