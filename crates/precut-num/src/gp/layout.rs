//! A program sorted by what its rows touch, so that the inner loops have no branches.

use super::{Affines, Objective, Program};

/// Half-bandwidth of the chain: two variables per zone, and rows that touch two neighbouring zones.
pub(super) const BAND: usize = 3;

/// Rows of at most two entries, both in the chain and near each other.
#[derive(Debug, Clone, Default)]
pub(super) struct Pairs {
    /// The further variable of the two; both are the same where there is one.
    pub high: Vec<u32>,
    /// The nearer.
    pub low: Vec<u32>,
    pub a_high: Vec<f64>,
    pub a_low: Vec<f64>,
    pub constant: Vec<f64>,
}

/// A program prepared for the interior-point method.
///
/// Rows are numbered anew: pairs, then `mixed` (chain entries near each other, or common variables), then `far`.
#[derive(Debug, Clone)]
pub struct Layout {
    pub(super) local: usize,
    pub(super) common: usize,
    pub(super) pairs: Pairs,
    pub(super) mixed: Affines,
    pub(super) far: Affines,
    pub(super) sums: Vec<Affines>,
    pub(super) objective: Objective,
    pub(super) start: Vec<f64>,
    /// Number in the program of every row here.
    pub(super) order: Vec<usize>,
    /// Constant rows above 0: no y satisfies them.
    pub(super) impossible: Vec<usize>,
    pub(super) program_rows: usize,
}

impl Layout {
    /// Sorts a program; `None` where a term of a sum spans more of the chain than the method can hold.
    pub fn new(program: &Program) -> Option<Self> {
        let nl = program.local;
        let near = |terms: &Affines| (0..terms.len()).all(|row| span(terms, row, nl) <= BAND);
        let objective_near = match &program.objective {
            Objective::Sum(terms) => near(terms),
            Objective::Linear(_) => true,
        };
        if !objective_near || !program.sums.iter().all(near) {
            return None;
        }
        let mut layout = Self {
            local: nl,
            common: program.common,
            pairs: Pairs::default(),
            mixed: Affines::new(),
            far: Affines::new(),
            sums: program.sums.clone(),
            objective: program.objective.clone(),
            start: program.start.clone(),
            order: Vec::with_capacity(program.rows.len()),
            impossible: Vec::new(),
            program_rows: program.rows.len(),
        };
        layout.sort_rows(&program.rows);
        Some(layout)
    }

    fn sort_rows(&mut self, rows: &Affines) {
        let (mut mixed, mut far) = (Vec::new(), Vec::new());
        let pairs = &mut self.pairs;
        for list in [&mut pairs.a_high, &mut pairs.a_low, &mut pairs.constant] {
            list.reserve(rows.len());
        }
        for row in 0..rows.len() {
            let mut entries = rows.entries(row);
            let (first, second, third) = (entries.next(), entries.next(), entries.next());
            let Some((i, a)) = first else {
                // A limit on what is fixed: met within rounding, or never.
                if rows.constant(row) > 1e-9 {
                    self.impossible.push(row);
                }
                continue;
            };
            let (j, b) = second.unwrap_or((i, 0.0));
            let (high, low, a_high, a_low) = if i >= j { (i, j, a, b) } else { (j, i, b, a) };
            if third.is_none() && high < self.local && high - low <= BAND {
                // Below 2^32, as the affine forms hold them so.
                pairs.high.push(u32::try_from(high).unwrap_or(u32::MAX));
                pairs.low.push(u32::try_from(low).unwrap_or(u32::MAX));
                pairs.a_high.push(a_high);
                pairs.a_low.push(a_low);
                pairs.constant.push(rows.constant(row));
                self.order.push(row);
            } else if span(rows, row, self.local) <= BAND {
                mixed.push(row);
            } else {
                far.push(row);
            }
        }
        self.mixed = rows.chosen(&mixed);
        self.far = rows.chosen(&far);
        self.order.extend(mixed);
        self.order.extend(far);
    }

    /// Rows that can bind.
    pub(super) fn rows(&self) -> usize {
        self.order.len()
    }

    /// Rows and sums.
    pub(super) fn limits(&self) -> usize {
        self.order.len() + self.sums.len()
    }
}

/// Distance of the outermost chain variables of a form.
fn span(forms: &Affines, row: usize, local: usize) -> usize {
    let chain = || forms.entries(row).map(|(i, _)| i).filter(|&i| i < local);
    match (chain().min(), chain().max()) {
        (Some(low), Some(high)) => high - low,
        _ => 0,
    }
}
