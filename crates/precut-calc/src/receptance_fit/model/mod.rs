//! Modes from frequency responses (`receptance/3`).
//!
//! Directions that cross functions link are fitted together, every other direction by itself. `poles` finds where modes may
//! be, `select` which of them the lines ask for, `refine` the least squares themselves, `phase` whether real
//! modes suffice.

mod phase;
mod poles;
mod refine;
mod select;

use nalgebra::Complex;

use super::input::Residuals;
use super::reader::Function;

use refine::Mode;
pub(crate) use select::{Chosen, choose};

/// Why lines give no modes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Unfit {
    /// The caller does not want it any more.
    Stopped,
    /// No mode is seen.
    NoMode,
    /// Fewer lines than numbers to find.
    TooFew,
}

/// A function as it is fitted.
#[derive(Debug, Clone)]
pub(crate) struct Lines {
    /// Number of the function in the files.
    pub function: usize,
    /// As measured.
    pub frequency_hz: Vec<f64>,
    /// rad/s.
    pub omega: Vec<f64>,
    /// In the quantity measured, SI.
    pub values: Vec<Complex<f64>>,
    /// (i w)^k of each line: displacement to the quantity measured.
    pub factors: Vec<Complex<f64>>,
    /// What a residual is multiplied by.
    pub weights: Vec<f64>,
    /// Place of the response among the group's axes, and its sign.
    pub response: (usize, f64),
    /// The same of the force.
    pub excitation: (usize, f64),
}

impl Lines {
    fn of(function: &Function, index: usize, axes: &[usize], band_hz: [f64; 2]) -> Self {
        let place = |axis: usize| axes.iter().position(|one| *one == axis).unwrap_or(0);
        let roots = function.root_weights();
        let kept: Vec<usize> = (0..function.values.len())
            .filter(|i| (band_hz[0]..=band_hz[1]).contains(&function.frequency_hz[*i]))
            .collect();
        let omega: Vec<f64> = kept.iter().map(|i| std::f64::consts::TAU * function.frequency_hz[*i]).collect();
        let values: Vec<Complex<f64>> = kept.iter().map(|i| function.values[*i]).collect();
        let factors = omega.iter().map(|w| Complex::new(0.0, *w).powi(function.unit.derivative())).collect();
        let mut lines = Self {
            function: index,
            frequency_hz: kept.iter().map(|i| function.frequency_hz[*i]).collect(),
            omega,
            factors,
            weights: kept.iter().map(|i| roots[*i]).collect(),
            values,
            response: (place(function.response.axis()), function.response.sign()),
            excitation: (place(function.excitation.axis()), function.excitation.sign()),
        };
        // Functions of any size weigh alike until their own scatter is known.
        let rms = (lines.square() / lines.values.len().max(1) as f64).sqrt();
        if rms > 0.0 {
            for weight in &mut lines.weights {
                *weight /= rms;
            }
        }
        lines
    }

    /// Whether it was measured where it was struck, in the same direction.
    pub(crate) fn is_direct(&self) -> bool {
        self.response.0 == self.excitation.0
    }

    /// Sum of the squares of its weighted values.
    fn square(&self) -> f64 {
        self.values.iter().zip(&self.weights).map(|(value, weight)| value.norm_sqr() * weight * weight).sum()
    }

    fn sign(&self) -> f64 {
        self.response.1 * self.excitation.1
    }
}

/// Directions that are fitted together, and their functions.
#[derive(Debug, Clone)]
pub(crate) struct Group {
    /// Axes, 0 for x.
    pub axes: Vec<usize>,
    /// Functions.
    pub lines: Vec<Lines>,
    /// What modes beside the band leave in it.
    pub residuals: Residuals,
}

impl Group {
    /// Least and largest angular frequency.
    pub(crate) fn band(&self) -> [f64; 2] {
        let ends = |lines: &Lines| [lines.omega.first().copied(), lines.omega.last().copied()];
        let all: Vec<f64> = self.lines.iter().flat_map(ends).flatten().collect();
        [all.iter().copied().fold(f64::INFINITY, f64::min), all.iter().copied().fold(0.0, f64::max)]
    }

    /// Real and imaginary parts of all lines.
    pub(crate) fn residual_count(&self) -> usize {
        self.lines.iter().map(|lines| 2 * lines.values.len()).sum()
    }

    /// Whether a function was measured where it was struck, in the same direction: cross functions alone tell no mass.
    pub(crate) fn has_direct(&self) -> bool {
        self.lines.iter().any(Lines::is_direct)
    }

    fn residual_terms(&self) -> usize {
        match self.residuals {
            Residuals::MassAndStiffness => 2,
            Residuals::None => 0,
        }
    }
}

/// The functions by directions that hang together.
pub(crate) fn groups(functions: &[Function], band_hz: [f64; 2], residuals: Residuals) -> Vec<Group> {
    let mut of_axis = [0, 1, 2];
    for function in functions {
        let (a, b) = (of_axis[function.response.axis()], of_axis[function.excitation.axis()]);
        for one in &mut of_axis {
            if *one == a.max(b) {
                *one = a.min(b);
            }
        }
    }
    let group = |root: usize| {
        let is_in = |axis: usize| of_axis[axis] == root;
        let used = |axis: &usize| functions.iter().any(|f| f.response.axis() == *axis || f.excitation.axis() == *axis);
        let axes: Vec<usize> = (0..3).filter(|axis| is_in(*axis)).filter(used).collect();
        let lines = functions
            .iter()
            .enumerate()
            .filter(|(_, function)| is_in(function.response.axis()))
            .map(|(index, function)| Lines::of(function, index, &axes, band_hz));
        Group { lines: lines.collect(), axes, residuals }
    };
    (0..3).map(group).filter(|group| !group.lines.is_empty()).collect()
}
