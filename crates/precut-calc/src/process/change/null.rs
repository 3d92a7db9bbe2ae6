//! What is free although nothing changed, and what the parts tell of it (`process/3.1`).

use std::sync::OnceLock;

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};
use serde::{Deserialize, Serialize};

use crate::diagnosis::Whitener;
use crate::process::change::scatter::Scatter;
use crate::process::part::sight::{COSINES, Catalogue, Sighting};

/// Prior standard deviation of each cosine of the mean profile, um on the diameter.
const PROFILE_UM: f64 = 10.0;
/// A drift is as large as its cause's prior after so many parts.
pub(in crate::process) const DRIFT_PARTS: f64 = 20.0;

/// A column that is free in every part, with a standard normal size.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(in crate::process) struct Column {
    pub(in crate::process) source: Source,
    /// From which part on it acts, and whether it grows from there.
    pub(in crate::process) since: Option<(u32, Form)>,
    /// Prior standard deviation, in units of its column.
    pub(in crate::process) sd: f64,
}

/// What a column is of.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(in crate::process) enum Source {
    /// A cosine of the mean profile of one type of parts.
    Profile { kind: usize, order: usize },
    /// A cosine, whatever the part.
    Wave(usize),
    /// A variant of a cause.
    Cause(usize),
}

/// How something changed.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
pub(in crate::process) enum Form {
    Step,
    Drift,
}

impl Form {
    /// g: how much of a change since a part acts in a later one.
    pub(in crate::process) fn of(self, number: u32, since: u32) -> f64 {
        match self {
            _ if number < since => 0.0,
            Self::Step => 1.0,
            Self::Drift => (f64::from(number - since) + 1.0) / DRIFT_PARTS,
        }
    }
}

impl Column {
    /// The mean profile of a type of parts.
    pub(in crate::process) fn profile(kind: usize, per_um: f64) -> impl Iterator<Item = Self> {
        let of = move |order| Self { source: Source::Profile { kind, order }, since: None, sd: PROFILE_UM * per_um };
        (0..COSINES).map(of)
    }

    /// How much of its basic column acts in a part.
    pub(in crate::process) fn weight(&self, kind: usize, number: u32) -> f64 {
        let is_own = !matches!(self.source, Source::Profile { kind: own, .. } if own != kind);
        let acts = self.since.map_or(1.0, |(since, form)| form.of(number, since));
        if is_own { self.sd * acts } else { 0.0 }
    }

    /// Which of the basic columns it is.
    pub(in crate::process) fn basic(&self) -> usize {
        match self.source {
            Source::Profile { order, .. } | Source::Wave(order) => order,
            Source::Cause(variant) => COSINES + variant,
        }
    }
}

/// Inner products of all basic columns of a part, whitened: cosines, variants of causes, and last what was measured beside the
/// prediction.
#[derive(Clone)]
pub(in crate::process) struct Gram {
    pub(in crate::process) inner: DMatrix<f64>,
    /// How many rows it stands for, with the readings of a master.
    pub(in crate::process) rows: usize,
    /// B'B and B'r with the weights under which they were asked for first.
    free: OnceLock<OfFree>,
}

/// B'B, its lower triangle alone, and B'r of a part.
#[derive(Clone)]
struct OfFree {
    weights: Vec<(f64, usize)>,
    a: DMatrix<f64>,
    eta: DVector<f64>,
}

impl Gram {
    pub(in crate::process) fn new(inner: DMatrix<f64>, rows: usize) -> Self {
        Self { inner, rows, free: OnceLock::new() }
    }

    /// Something else is free: B'B is to be made anew. Where that is left out it is made at every sum.
    pub(in crate::process) fn forget_free(&mut self) {
        self.free = OnceLock::new();
    }

    pub(in crate::process) fn of(part: &Sighting, scatter: &Scatter, catalogue: &Catalogue) -> Self {
        let data = part.data();
        let whitener = Whitener::new(&data, &scatter.noise(), &part.scatter(&scatter.factors), &part.keep);
        let last = COSINES + catalogue.variants.len();
        let mut white = vec![None; last + 1];
        for (order, column) in part.signs.cosines.iter().enumerate() {
            white[order] = Some(whitener.white(column));
        }
        for (variant, column) in &part.signs.causes {
            white[COSINES + variant] = Some(whitener.white(column));
        }
        white[last] = Some(whitener.white(&part.residual));
        let mut inner = DMatrix::zeros(last + 1, last + 1);
        for i in 0..=last {
            for j in 0..=i {
                if let (Some(a), Some(b)) = (&white[i], &white[j]) {
                    inner[(i, j)] = a.inner(b);
                    inner[(j, i)] = inner[(i, j)];
                }
            }
        }
        if let Some(gauge) = catalogue.gauge() {
            let of_gauge = COSINES + gauge;
            for check in &part.checks {
                // A master reads what the gauge is off, on the diameter, and nothing of the part.
                let (reads, read) = (2.0 * catalogue.variants[gauge].prior_sd, check.measured_um);
                let weight = check.uncertainty_um.powi(-2);
                inner[(of_gauge, of_gauge)] += weight * reads * reads;
                inner[(of_gauge, last)] += weight * reads * read;
                inner[(last, of_gauge)] += weight * reads * read;
                inner[(last, last)] += weight * read * read;
            }
        }
        Self::new(inner, part.keep.iter().filter(|keep| **keep).count() + part.checks.len())
    }

    pub(in crate::process) fn residual(&self) -> usize {
        self.inner.nrows() - 1
    }
}

/// A part with what it tells.
pub(in crate::process) struct Told<'a> {
    pub(in crate::process) number: u32,
    pub(in crate::process) ordinal: usize,
    pub(in crate::process) gram: &'a Gram,
    /// Weight and basic column of everything that is free.
    pub(in crate::process) free: Vec<(f64, usize)>,
}

impl<'a> Told<'a> {
    pub(in crate::process) fn of(part: &Sighting, gram: &'a Gram, columns: &[Column]) -> Self {
        let free = columns.iter().map(|column| (column.weight(part.kind, part.number), column.basic())).collect();
        Self { number: part.number, ordinal: part.ordinal, gram, free }
    }

    /// B'c of a basic column c.
    pub(in crate::process) fn along(&self, basic: usize) -> impl Iterator<Item = f64> + '_ {
        self.free
            .iter()
            .map(move |&(weight, own)| if weight == 0.0 { 0.0 } else { weight * self.gram.inner[(own, basic)] })
    }

    /// B'B, added to the lower triangle, which is all that a factorisation reads.
    fn add_to(&self, a: &mut DMatrix<f64>, eta: &mut DVector<f64>) {
        let known = self.gram.free.get_or_init(|| {
            let count = self.free.len();
            let (mut a, mut eta) = (DMatrix::zeros(count, count), DVector::zeros(count));
            self.add_anew(&mut a, &mut eta);
            OfFree { weights: self.free.clone(), a, eta }
        });
        if known.weights == self.free {
            *a += &known.a;
            *eta += &known.eta;
        } else {
            self.add_anew(a, eta);
        }
    }

    fn add_anew(&self, a: &mut DMatrix<f64>, eta: &mut DVector<f64>) {
        let last = self.gram.residual();
        for (j, &(weight, own)) in self.free.iter().enumerate() {
            if weight == 0.0 {
                continue;
            }
            let inner = self.gram.inner.column(own);
            for (sum, &(other, basic)) in a.column_mut(j).iter_mut().zip(&self.free).skip(j) {
                *sum += weight * other * inner[basic];
            }
            eta[j] += weight * inner[last];
        }
    }
}

/// What parts that left the memory still tell: A and eta without the prior.
#[derive(Debug, Clone, Serialize, Deserialize)]
#[serde(try_from = "Sums", into = "Sums")]
pub(in crate::process) struct Older {
    pub(in crate::process) a: DMatrix<f64>,
    pub(in crate::process) eta: DVector<f64>,
}

impl Older {
    pub(in crate::process) fn none() -> Self {
        Self { a: DMatrix::zeros(0, 0), eta: DVector::zeros(0) }
    }

    /// With a part more, everything before it counting a little less.
    pub(in crate::process) fn take(&mut self, part: &Told<'_>, memory: f64) {
        let count = part.free.len();
        let stays = 1.0 - 1.0 / memory;
        self.a = self.a.clone().resize(count, count, 0.0) * stays;
        self.eta = self.eta.clone().resize_vertically(count, 0.0) * stays;
        part.add_to(&mut self.a, &mut self.eta);
    }

    /// Without one column.
    pub(in crate::process) fn without(&self, gone: &[bool]) -> Self {
        let kept: Vec<usize> = (0..self.eta.len()).filter(|&k| !gone[k]).collect();
        Self {
            a: DMatrix::from_fn(kept.len(), kept.len(), |i, j| self.a[(kept[i], kept[j])]),
            eta: DVector::from_fn(kept.len(), |i, _| self.eta[kept[i]]),
        }
    }
}

/// What is free, and what is known of it: A0 = I + sum B'B, eta = sum B'r.
pub(in crate::process) struct Null {
    pub(in crate::process) columns: Vec<Column>,
    /// Of A0.
    pub(in crate::process) factor: Cholesky<f64, Dyn>,
    /// L^-1: it is applied to all columns at every onset.
    inverse: DMatrix<f64>,
    /// L^-1 eta.
    pub(in crate::process) half: DVector<f64>,
}

impl Null {
    /// From older parts and those in memory.
    pub(in crate::process) fn of<'a>(
        columns: &[Column],
        older: &Older,
        parts: impl Iterator<Item = &'a Told<'a>>,
    ) -> Option<Self> {
        let count = columns.len();
        let mut a = older.a.clone().resize(count, count, 0.0) + DMatrix::identity(count, count);
        let mut eta = older.eta.clone().resize_vertically(count, 0.0);
        parts.for_each(|part| part.add_to(&mut a, &mut eta));
        let factor = Cholesky::new(a)?;
        let half = factor.l_dirty().solve_lower_triangular(&eta)?;
        let inverse = factor.l_dirty().solve_lower_triangular(&DMatrix::identity(count, count))?;
        Some(Self { columns: columns.to_vec(), factor, inverse, half })
    }

    /// L^-1 c.
    pub(in crate::process) fn halved(&self, c: &DMatrix<f64>) -> DMatrix<f64> {
        &self.inverse * c
    }

    /// Posterior mean of what is free.
    pub(in crate::process) fn mean(&self) -> DVector<f64> {
        self.back(&self.half)
    }

    /// L'^-1 c.
    pub(in crate::process) fn back(&self, c: &DVector<f64>) -> DVector<f64> {
        self.factor.l_dirty().tr_solve_lower_triangular(c).unwrap_or_else(|| c.clone())
    }

    /// What is free in a part, row by row, before it is whitened.
    pub(in crate::process) fn rows_of(&self, part: &Sighting) -> Vec<Vec<f64>> {
        self.columns.iter().map(|column| row_column(column, part)).collect()
    }

    /// The rows of a part as they are expected.
    pub(in crate::process) fn expected_rows(&self, part: &Sighting) -> Vec<f64> {
        let mut expected = part.signs.base.clone();
        for (size, column) in self.mean().iter().zip(self.rows_of(part)) {
            expected.iter_mut().zip(column).for_each(|(sum, x)| *sum += size * x);
        }
        expected
    }

    /// Mahalanobis distance of a part to its prediction from what is known here, the part itself not in it: chi2 with as many
    /// degrees as it has rows; and how far its mean, taper and bow lie, in standard deviations.
    pub(in crate::process) fn distance(&self, part: &Told<'_>) -> Option<(f64, [f64; 3])> {
        let (last, count) = (part.gram.residual(), part.free.len());
        let mean = self.mean();
        let free = |basic: usize| DVector::from_iterator(count, part.along(basic));
        let (mut own, mut none) = (DMatrix::zeros(count, count), DVector::zeros(count));
        part.add_to(&mut own, &mut none);
        own.fill_upper_triangle_with_lower_triangle();
        // e = r - B beta: e'e and B'e.
        let to_r = free(last);
        let left = &to_r - &own * &mean;
        let square = part.gram.inner[(last, last)] - mean.dot(&to_r) - mean.dot(&left);
        let all = self.factor.l() * self.factor.l().transpose() + own;
        let all = Cholesky::new(all)?;
        // (I + B A^-1 B')^-1 = I - B (A + B'B)^-1 B'.
        let chi2 = square - left.dot(&all.solve(&left));
        let shape = |order: usize| {
            let along = free(order);
            let size = part.gram.inner[(order, last)] - along.dot(&mean);
            let unsure = self.halved(&DMatrix::from_columns(std::slice::from_ref(&along)));
            size / (part.gram.inner[(order, order)] + unsure.norm_squared()).sqrt()
        };
        Some((chi2.max(0.0), [0, 1, 2].map(shape)))
    }
}

/// A free column in the rows of a part.
fn row_column(column: &Column, part: &Sighting) -> Vec<f64> {
    let weight = column.weight(part.kind, part.number);
    let basic = match column.source {
        Source::Profile { order, .. } | Source::Wave(order) => Some(&part.signs.cosines[order]),
        Source::Cause(variant) => part.signs.causes.iter().find(|(own, _)| *own == variant).map(|(_, column)| column),
    };
    basic.map_or_else(|| vec![0.0; part.residual.len()], |column| column.iter().map(|x| weight * x).collect())
}

/// A symmetric matrix and a vector as they are kept.
#[derive(Serialize, Deserialize)]
struct Sums {
    a: Vec<f64>,
    eta: Vec<f64>,
}

impl From<Older> for Sums {
    fn from(older: Older) -> Self {
        Self { a: older.a.as_slice().to_vec(), eta: older.eta.as_slice().to_vec() }
    }
}

impl TryFrom<Sums> for Older {
    type Error = &'static str;

    fn try_from(sums: Sums) -> Result<Self, Self::Error> {
        let count = sums.eta.len();
        if sums.a.len() != count * count {
            return Err("a matrix that is not square");
        }
        Ok(Self { a: DMatrix::from_vec(count, count, sums.a), eta: DVector::from_vec(sums.eta) })
    }
}
