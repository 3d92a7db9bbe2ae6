//! Measured rows, and what they have in common with each other.

use crate::calculator::Design;

/// Rows of one quantity.
#[derive(Debug, Clone, PartialEq)]
pub struct Data {
    /// Measured values, in the unit in which residuals are taken.
    pub value: Vec<f64>,
    /// Standard uncertainties of the rows, in the same unit, where stated.
    pub uncertainty: Option<Vec<f64>>,
    /// Of classes: the side of zero, +1 or -1, on which the margin of every row lay; 0 of a row beside them that was measured to stand
    /// at zero. Then `value` is 0, the boundary, and `uncertainty` the spread of the margins.
    pub sides: Option<Vec<f64>>,
    /// How the rows hang together.
    pub layout: Layout,
}

/// How rows hang together.
#[derive(Debug, Clone, PartialEq)]
pub struct Layout {
    /// Rows measured one after the other in one sweep, in measuring order. Every row is in one.
    pub traces: Vec<Vec<usize>>,
    /// Run of every trace.
    pub run_of_trace: Vec<usize>,
    /// The experiment behind them.
    pub design: Design,
}

impl Layout {
    /// Traces with only those rows that are kept, without traces that have none left.
    pub(in crate::diagnosis) fn kept_traces(&self, keep: &[bool]) -> Vec<(usize, Vec<usize>)> {
        self.traces
            .iter()
            .zip(&self.run_of_trace)
            .map(|(rows, run)| (*run, rows.iter().copied().filter(|row| keep[*row]).collect::<Vec<_>>()))
            .filter(|(_, rows)| !rows.is_empty())
            .collect()
    }
}
