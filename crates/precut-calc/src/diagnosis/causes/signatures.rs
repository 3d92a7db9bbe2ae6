//! What every hypothesis does to the rows, linearised at 0 and, where that says too little, about other sizes
//! (`diagnosis/3.4`).

use crate::calculator::{Failure, Hypothesis, Monitor, Treatment, checkpoint};
use crate::diagnosis::causes::refine::Coordinate;
use crate::diagnosis::causes::subject::{Setting, Subject};
use crate::diagnosis::causes::survey::{Place, Survey};
use crate::diagnosis::statistics::evidence::Side;

/// A hypothesis at one point of the grid of its shapes, linearised about one place in its sizes.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Variant {
    /// Which point of the grid; `None` where the shapes that are fitted are free, too.
    pub(crate) grid_point: Option<usize>,
    /// Values with every size at 0, or where it is linearised.
    pub(crate) setting: Setting,
    /// What is free.
    pub(crate) free: Vec<Free>,
    /// Column of what it does without a size of its own, or of what a straight line through the place of its
    /// linearisation does where every coordinate is 0.
    pub(crate) offset: Option<usize>,
}

/// A free value of a variant.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Free {
    /// Index of the variable.
    pub(crate) variable: usize,
    pub(in crate::diagnosis) coordinate: Coordinate,
    pub(in crate::diagnosis) side: Side,
    /// Which column among all, at one prior standard deviation.
    pub(crate) column: usize,
}

/// Signatures of all hypotheses before they are whitened: what a fold can use again.
#[derive(Default)]
pub(crate) struct Signatures {
    /// Variants of every hypothesis; the points of its grid first.
    pub(crate) variants: Vec<Vec<Variant>>,
    /// How many of them are points of its grid.
    pub(in crate::diagnosis) grid_points: Vec<usize>,
    /// Whether it was found off its grid, too.
    pub(in crate::diagnosis) is_off_grid: Vec<bool>,
    /// Columns at one prior standard deviation.
    pub(crate) columns: Vec<Vec<f64>>,
}

impl Signatures {
    /// One Jacobian column for every amplitude at every point of the grids, and about the places beside 0. `residual` is
    /// measured minus base: it says which places are worth it where there are many.
    pub(crate) fn of(
        subject: &dyn Subject,
        base: &[f64],
        residual: &[f64],
        monitor: &dyn Monitor,
    ) -> Result<Self, Failure> {
        let mut signatures = Self::default();
        for (index, hypothesis) in subject.hypotheses().iter().enumerate() {
            checkpoint(monitor)?;
            let grid: Vec<Setting> =
                grid(hypothesis).into_iter().map(|values| Setting { hypothesis: index, values }).collect();
            let mut variants = Vec::with_capacity(grid.len());
            for (grid_point, setting) in grid.iter().enumerate() {
                variants.push(signatures.variant(subject, base, Some(grid_point), setting.clone())?);
            }
            for (grid_point, place) in Survey::new(subject, index, residual).places(&grid, monitor)? {
                checkpoint(monitor)?;
                variants.push(signatures.expansion(subject, grid_point, place)?);
            }
            signatures.is_off_grid.push(variants.iter().any(|variant| variant.grid_point.is_none()));
            signatures.variants.push(variants);
            signatures.grid_points.push(grid.len());
        }
        Ok(signatures)
    }

    /// Linearised about a place: f(theta) = f(0) + (f(theta_0) - f(0) - J theta_0) + J theta.
    fn expansion(
        &mut self,
        subject: &dyn Subject,
        grid_point: Option<usize>,
        place: Place,
    ) -> Result<Variant, Failure> {
        let Place { setting, change: mut offset } = place;
        let values = setting.values.clone();
        let mut variant = self.variant(subject, &[], grid_point, setting)?;
        for free in &variant.free {
            let t = free.coordinate.t(values[free.variable]);
            offset.iter_mut().zip(&self.columns[free.column]).for_each(|(o, c)| *o -= c * t);
        }
        self.columns.push(offset);
        variant.offset = Some(self.columns.len() - 1);
        Ok(variant)
    }

    /// Linearised in its sizes, and off the grid in the shapes that are fitted.
    fn variant(
        &mut self,
        subject: &dyn Subject,
        base: &[f64],
        grid_point: Option<usize>,
        setting: Setting,
    ) -> Result<Variant, Failure> {
        let variables = &subject.hypotheses()[setting.hypothesis].variables;
        let coordinates: Vec<(usize, Coordinate)> = variables
            .iter()
            .enumerate()
            .filter_map(|(index, variable)| Some((index, Coordinate::of(variable)?)))
            .filter(|(_, coordinate)| grid_point.is_none() || matches!(coordinate, Coordinate::Amplitude { .. }))
            .collect();
        let mut offset = None;
        if coordinates.is_empty() {
            let with = subject.predict(std::slice::from_ref(&setting))?;
            self.columns.push(with.iter().zip(base).map(|(with, base)| with.map_or(0.0, |with| with - base)).collect());
            offset = Some(self.columns.len() - 1);
        }
        let of: Vec<(usize, usize)> = coordinates.iter().map(|(variable, _)| (0, *variable)).collect();
        let slopes = subject.jacobian(std::slice::from_ref(&setting), &of)?;
        let mut free = Vec::new();
        for ((variable, coordinate), slope) in coordinates.into_iter().zip(slopes) {
            let by = coordinate.slope(setting.values[variable]);
            self.columns.push(slope.iter().map(|x| x * by).collect());
            let side = coordinate.side(variables[variable].range);
            free.push(Free { variable, coordinate, side, column: self.columns.len() - 1 });
        }
        Ok(Variant { grid_point, setting, free, offset })
    }
}

/// Product grid of a hypothesis' shapes, amplitudes at 0.
fn grid(hypothesis: &Hypothesis) -> Vec<Vec<f64>> {
    hypothesis.variables.iter().fold(vec![Vec::new()], |points, variable| {
        let choices = match &variable.treatment {
            Treatment::Amplitude { .. } => vec![0.0],
            Treatment::Shape { grid, .. } => grid.clone(),
            Treatment::Stated { value } => vec![*value],
        };
        points
            .into_iter()
            .flat_map(|point| choices.iter().map(move |choice| [point.as_slice(), &[*choice]].concat()))
            .collect()
    })
}
