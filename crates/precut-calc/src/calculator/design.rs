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
    /// Conditions with which, and with pairs of which, an unnamed remainder may go smoothly.
    pub conditions: Vec<Condition>,
    /// Position of every row in the order of testing, 0 to 1, where rows have one.
    pub order: Option<Vec<f64>>,
    /// Number of the fold of every row: what is held back together.
    pub fold: Vec<usize>,
}

impl Design {
    /// Numbers from 0 on by which keys are told apart, in their order.
    pub fn numbered<K: Ord + Copy>(keys: &[K]) -> Vec<usize> {
        let mut known = keys.to_vec();
        known.sort_unstable();
        known.dedup();
        keys.iter().map(|key| known.partition_point(|other| other < key)).collect()
    }
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
    /// Names that the user gave to it; empty where `name` says all.
    pub over: Vec<String>,
    /// The conditions whose values decide the group; empty where others do, too.
    pub conditions: Vec<&'static str>,
    /// Group of every row.
    pub group: Vec<usize>,
}

/// A condition of the rows that differs between them.
#[derive(Debug, Clone, PartialEq)]
pub struct Condition {
    /// Which.
    pub name: &'static str,
    /// Where every row stands in it, 0 to 1.
    pub place: Vec<f64>,
    /// How many different values there are.
    pub levels: usize,
}

impl Condition {
    /// Values further apart than this share of their range are two.
    const APART: f64 = 1e-6;

    /// `None` where all rows have one value.
    pub fn of(name: &'static str, values: &[f64]) -> Option<Self> {
        let low = values.iter().copied().reduce(f64::min)?;
        let high = values.iter().copied().reduce(f64::max)?;
        if high - low <= 1e-9 * high.abs().max(low.abs()) {
            return None;
        }
        let place: Vec<f64> = values.iter().map(|value| (value - low) / (high - low)).collect();
        let mut condition = Self { name, place, levels: 0 };
        condition.levels = condition.values(|_| true).len();
        Some(condition)
    }

    /// Where rows stand in it, each place once, ascending.
    pub fn values(&self, counts: impl Fn(usize) -> bool) -> Vec<f64> {
        let rows = (0..self.place.len()).filter(|&row| counts(row));
        let mut values: Vec<f64> = rows.map(|row| self.place[row]).collect();
        values.sort_by(f64::total_cmp);
        let all = std::mem::take(&mut values);
        for (k, value) in all.iter().enumerate() {
            // A place apart from the one before it.
            if k == 0 || value - all[k - 1] > Self::APART {
                values.push(*value);
            }
        }
        values
    }
}
