//! How measured rows hang together: what a diagnosis has to know of an experiment beside its physics.

/// The experiment behind a set of rows, one entry per row in every list.
#[derive(Debug, Clone, PartialEq)]
pub struct Design {
    /// The coordinate along which the quantity varies smoothly.
    pub smooth: Smooth,
    /// Number of the condition (and place) of every row: rows with one number are repeats.
    pub cell: Vec<usize>,
    /// Columns that explain the quantity without physics, for the noise of rows without an order.
    pub regressors: Vec<Vec<f64>>,
    /// Ways to group rows by which an unnamed remainder may have levels of its own.
    pub groupings: Vec<Grouping>,
    /// Position of every row in the order of testing, 0 to 1, where rows have one.
    pub order: Option<Vec<f64>>,
    /// Number of the fold of every row: what is held back together.
    pub fold: Vec<usize>,
}

/// The coordinate along which a quantity varies smoothly.
#[derive(Debug, Clone, PartialEq)]
pub enum Smooth {
    /// Position of every row along the part, 0 to 1.
    Along(Vec<f64>),
    /// Angle of every row round the part, rad.
    Around(Vec<f64>),
    /// None: single values under different conditions.
    None,
}

/// A way to group rows.
#[derive(Debug, Clone, PartialEq)]
pub struct Grouping {
    /// What the groups have in common.
    pub name: &'static str,
    /// Group of every row.
    pub group: Vec<usize>,
}
