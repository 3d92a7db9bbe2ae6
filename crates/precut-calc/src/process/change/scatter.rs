//! How far single readings and whole parts scatter, learned from the parts (`process/3.4`).

use nalgebra::{Cholesky, DMatrix, DVector};
use serde::{Deserialize, Serialize};

use crate::calculator::{Design, Smooth};
use crate::diagnosis::{Data, Layout, Noise, NoiseSource, Whitener};
use crate::process::change::null::Null;
use crate::process::part::sight::Sighting;

/// Correlations from row to row that are tried.
const CORRELATIONS: [f64; 5] = [0.0, 0.1, 0.2, 0.3, 0.45];
/// What is stated counts as so many parts.
const PSEUDO_PARTS: f64 = 10.0;
/// Rounds over all numbers, and steps of the search for each: the last interval is 1e-3 wide.
const ROUNDS: usize = 3;
const STEPS: usize = 16;
/// How far a number may move in one round, as a factor.
const REACH: f64 = 3.0;

/// Scatter of readings and of parts.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(in crate::process) struct Scatter {
    /// Standard deviation of a reading, in the unit of the quantity.
    pub(in crate::process) sigma: f64,
    /// Correlation from one row of a sweep to the next.
    pub(in crate::process) rho: f64,
    /// Each allowance of a part relative to what was stated.
    pub(in crate::process) factors: Vec<f64>,
}

impl Scatter {
    /// As it is stated, or as the smooth parts of the rows leave it.
    pub(in crate::process) fn first(parts: &[Sighting], stated: Option<f64>) -> Self {
        let factors = vec![1.0; parts.first().map_or(0, |part| part.signs.scatter.len())];
        let rows: usize = parts.iter().map(|part| part.value.len()).sum();
        let mut data = Data { value: Vec::with_capacity(rows), uncertainty: None, sides: None, layout: empty_layout() };
        let (mut residual, mut keep) = (Vec::with_capacity(rows), Vec::with_capacity(rows));
        for (run, part) in parts.iter().enumerate() {
            let first = data.value.len();
            data.value.extend_from_slice(&part.value);
            residual.extend_from_slice(&part.residual);
            keep.extend_from_slice(&part.keep);
            let own = &part.signs.layout;
            data.layout.traces.extend(own.traces.iter().map(|rows| rows.iter().map(|row| row + first).collect()));
            data.layout.run_of_trace.extend(own.traces.iter().map(|_| run));
            if let (Smooth::Along(all), Smooth::Along(own)) = (&mut data.layout.design.smooth, &own.design.smooth) {
                all.extend_from_slice(own);
            }
            data.layout.design.cell.extend(first..data.value.len());
        }
        let noise = Noise::of(&data, &residual, &keep, None);
        Self { sigma: stated.unwrap_or(noise.sigma), rho: noise.rho, factors }
    }

    pub(in crate::process) fn noise(&self) -> Noise {
        let source = NoiseSource::Profile;
        Noise { sigma: self.sigma, per_row: None, rho: self.rho, dof: f64::INFINITY, source }
    }

    /// Most likely numbers with what is free in `null`, what was stated counting as ten parts.
    ///
    /// A part by itself says little of the correlation between neighbours, as its smooth part is its own; parts of one mean
    /// profile say much.
    pub(in crate::process) fn learned(&self, parts: &[Sighting], null: &Null, stated: Option<f64>) -> Self {
        let with = |rho: f64| {
            let told: Vec<Told> = parts.iter().map(|part| Told::of(part, null, rho)).collect();
            let own = Self { rho, ..self.clone() }.most_likely(&told, null, stated);
            // A correlation is the less likely the larger it is, as in a diagnosis.
            let likely = log_likelihood(&told, null, &own, stated) + (1.0 - rho).ln();
            (likely, own)
        };
        let tried = CORRELATIONS.map(with).into_iter();
        tried.max_by(|a, b| a.0.total_cmp(&b.0)).map_or_else(|| self.clone(), |(_, own)| own)
    }

    /// At one correlation.
    fn most_likely(&self, told: &[Told], null: &Null, stated: Option<f64>) -> Self {
        let mut best = self.clone();
        for _ in 0..ROUNDS {
            for number in 0..=self.factors.len() {
                // An allowance that is 0 stays so.
                if number > 0 && told.iter().all(|part| part.gram[(number - 1, number - 1)] <= 0.0) {
                    continue;
                }
                let (before, centre) = (best.clone(), best.number(number).ln());
                let at = |value: f64| {
                    let mut moved = before.clone();
                    *moved.number(number) = value.exp();
                    log_likelihood(told, null, &moved, stated)
                };
                *best.number(number) = highest(at, centre - REACH.ln(), centre + REACH.ln()).exp();
            }
        }
        best
    }

    fn number(&mut self, number: usize) -> &mut f64 {
        if number == 0 { &mut self.sigma } else { &mut self.factors[number - 1] }
    }
}

fn empty_layout() -> Layout {
    let design = Design {
        smooth: Smooth::Along(Vec::new()),
        cell: Vec::new(),
        regressors: Vec::new(),
        groupings: Vec::new(),
        conditions: Vec::new(),
        order: None,
        fold: Vec::new(),
    };
    Layout { traces: Vec::new(), run_of_trace: Vec::new(), design }
}

/// Inner products of a part's allowances, of what is free in it, and of its residual, in units of rows without correlation.
struct Told {
    gram: DMatrix<f64>,
    /// How many allowances; what is free and the residual follow.
    allowances: usize,
    rows: f64,
    /// ln |R|.
    log_det: f64,
}

impl Told {
    fn of(part: &Sighting, null: &Null, rho: f64) -> Self {
        let source = NoiseSource::Profile;
        let noise = Noise { sigma: 1.0, per_row: None, rho, dof: f64::INFINITY, source };
        let whitener = Whitener::new(&part.data(), &noise, &[], &part.keep);
        let free = null.rows_of(part);
        let columns = part.signs.scatter.iter().chain(&free).chain(std::iter::once(&part.residual));
        let white: Vec<_> = columns.map(|column| whitener.white(column)).collect();
        let gram = DMatrix::from_fn(white.len(), white.len(), |i, j| white[i.max(j)].inner(&white[i.min(j)]));
        Self { gram, allowances: part.signs.scatter.len(), rows: whitener.rows(), log_det: whitener.log_det() }
    }
}

/// ln of the density of all rows, what is free integrated out.
fn log_likelihood(told: &[Told], null: &Null, scatter: &Scatter, stated: Option<f64>) -> f64 {
    let (count, s2) = (null.columns.len(), scatter.sigma * scatter.sigma);
    let (mut a, mut eta) = (DMatrix::<f64>::identity(count, count), DVector::<f64>::zeros(count));
    let (mut log_l, mut rows) = (0.0, 0.0);
    for part in told {
        let q = part.allowances;
        // (I + N N')^-1 = I - N (I + N'N)^-1 N' in units of sigma.
        let factor = |i: usize| scatter.factors[i];
        let inner =
            DMatrix::from_fn(q, q, |i, j| f64::from(u8::from(i == j)) + factor(i) * factor(j) * part.gram[(i, j)] / s2);
        let Some(inner) = Cholesky::new(inner) else { return f64::NEG_INFINITY };
        let along = DMatrix::from_fn(q, count + 1, |i, j| factor(i) * part.gram[(i, q + j)] / s2);
        let Some(along) = inner.l_dirty().solve_lower_triangular(&along) else { return f64::NEG_INFINITY };
        let product = |i: usize, j: usize| part.gram[(q + i, q + j)] / s2 - along.column(i).dot(&along.column(j));
        for i in 0..count {
            for j in 0..=i {
                a[(i, j)] += product(i, j);
            }
            eta[i] += product(i, count);
        }
        let log_det: f64 = inner.l_dirty().diagonal().iter().map(|d| d.ln()).sum();
        log_l -= 0.5 * (part.rows * s2.ln() + part.log_det) + log_det + 0.5 * product(count, count);
        rows += part.rows;
    }
    let Some(a) = Cholesky::new(a) else { return f64::NEG_INFINITY };
    let Some(free) = a.l_dirty().solve_lower_triangular(&eta) else { return f64::NEG_INFINITY };
    let log_det: f64 = a.l_dirty().diagonal().iter().map(|d: &f64| d.ln()).sum();
    log_l += 0.5 * free.norm_squared() - log_det;
    // Parts that scatter just as stated.
    let pseudo = |ratio: f64| -0.5 * PSEUDO_PARTS * ((ratio * ratio).ln() + 1.0 / (ratio * ratio));
    log_l += scatter.factors.iter().map(|factor| pseudo(*factor)).sum::<f64>();
    if let Some(stated) = stated {
        log_l += rows / (told.len().max(1) as f64) * pseudo(scatter.sigma / stated);
    }
    log_l
}

/// Where a function of one top is highest, by golden section.
fn highest(of: impl Fn(f64) -> f64, mut low: f64, mut high: f64) -> f64 {
    let share = 0.5 * (5.0_f64.sqrt() - 1.0);
    let (mut left, mut right) = (high - share * (high - low), low + share * (high - low));
    let (mut at_left, mut at_right) = (of(left), of(right));
    for _ in 0..STEPS {
        if at_left < at_right {
            (low, left, at_left) = (left, right, at_right);
            right = low + share * (high - low);
            at_right = of(right);
        } else {
            (high, right, at_right) = (right, left, at_left);
            left = high - share * (high - low);
            at_left = of(left);
        }
    }
    f64::midpoint(low, high)
}
