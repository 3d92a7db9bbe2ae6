//! Rows that are values beside classes, as frequencies that were heard beside cuts that chattered (`diagnosis/3.11`): another quantity, of
//! another scatter, than the margins of the classes.

use crate::diagnosis::rows::data::Data;
use crate::diagnosis::rows::link;

/// Rows of every group, by its number.
pub(in crate::diagnosis) fn members(group: &[usize]) -> Vec<Vec<usize>> {
    let mut groups: Vec<Vec<usize>> = Vec::new();
    for (row, &group) in group.iter().enumerate() {
        groups.resize(groups.len().max(group + 1), Vec::new());
        groups[group].push(row);
    }
    groups
}

/// Which rows are values beside classes.
pub(in crate::diagnosis) struct ValuesBeside {
    /// Of these the scatter over that of all rows; 0 of classes. Empty where there are none.
    scatter: Vec<f64>,
}

impl ValuesBeside {
    pub(in crate::diagnosis) fn of(data: &Data, sigma: f64) -> Self {
        let (Some(sides), Some(spreads)) = (&data.sides, &data.uncertainty) else {
            return Self { scatter: Vec::new() };
        };
        let of = |(side, spread): (&f64, &f64)| if link::is_value(*side) { spread / sigma } else { 0.0 };
        let scatter: Vec<f64> = sides.iter().zip(spreads).map(of).collect();
        Self { scatter: if scatter.iter().any(|own| *own > 0.0) { scatter } else { Vec::new() } }
    }

    pub(in crate::diagnosis) fn are_there(&self) -> bool {
        !self.scatter.is_empty()
    }

    pub(in crate::diagnosis) fn holds(&self, row: usize) -> bool {
        self.scatter.get(row).is_some_and(|own| *own > 0.0)
    }

    /// What a remainder of one standard deviation of all rows does to a row: as much in its own.
    pub(in crate::diagnosis) fn unit(&self, row: usize) -> f64 {
        self.scatter.get(row).copied().filter(|own| *own > 0.0).unwrap_or(1.0)
    }

    /// The same groups of the classes alone and of the values alone.
    pub(in crate::diagnosis) fn apart(&self, groups: &[Vec<usize>]) -> [Vec<Vec<usize>>; 2] {
        [false, true].map(|of_values| {
            let part = |group: &Vec<usize>| group.iter().copied().filter(|row| self.holds(*row) == of_values).collect();
            groups.iter().map(part).filter(|part: &Vec<usize>| !part.is_empty()).collect()
        })
    }
}
