//! A remainder without a name: smooth columns or free levels with amplitudes of their own (`diagnosis/3.5`).

use std::f64::consts::PI;

use nalgebra::{Cholesky, DMatrix, DVector};

use super::basis::cosine;
use super::data::Data;
use super::evidence::{Normal, Scale, Side, log_mean_exp};
use super::likelihood::Likelihood;
use super::whiten::White;
use crate::calculator::Smooth;

/// Cosines common to all runs.
const COMMON_ORDERS: usize = 25;
/// Cosines free in every run.
const RUN_ORDERS: usize = 8;
/// Fourier orders round a part.
const FOURIER: std::ops::RangeInclusive<usize> = 2..=60;
/// Cosines over the order of testing.
const TEST_ORDERS: std::ops::RangeInclusive<usize> = 1..=15;
/// Correlation lengths, share of the length.
const LENGTHS: [f64; 3] = [0.0, 0.08, 0.2];
/// Pointwise root mean square, in standard deviations of the scatter.
const SIZES: [f64; 4] = [1.0, 3.0, 10.0, 30.0];

/// A kind of remainder.
pub(super) struct Kind {
    /// What it is free over: `common`, `per_run`, `around`, a grouping's name, `test_order`.
    pub(super) name: &'static str,
    /// Its columns on the rows, for the picture of the remainder.
    pub(super) columns: Vec<Vec<f64>>,
    /// Order of every column, where the columns are waves: along a part half waves, round it whole ones.
    pub(super) orders: Option<Vec<f64>>,
    white: Vec<White>,
    gram: DMatrix<f64>,
    /// Prior standard deviations of the amplitudes for every correlation length, at a size of one.
    spreads: Vec<Vec<f64>>,
}

/// A remainder fitted beside a set of causes.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Remainder {
    /// Mean over kinds, lengths and sizes.
    pub(super) log_z: f64,
    /// The best single one: kind, amplitudes, and their factor.
    pub(super) kind: usize,
    pub(super) amplitudes: Vec<f64>,
    /// Sizes of the causes beside it there, in units of their priors.
    pub(super) of_causes: Vec<f64>,
    /// Standard deviations of their priors at the best length and size.
    pub(super) prior_sd: Vec<f64>,
}

/// The kinds of remainder that these rows can show.
pub(super) fn kinds(data: &Data, likelihood: &Likelihood, sigma: f64) -> Vec<Kind> {
    let rows = data.value.len();
    let mut kinds = Vec::new();
    match &data.layout.design.smooth {
        Smooth::Along(u) => {
            let common = (0..COMMON_ORDERS).map(|k| u.iter().map(|u| cosine(k, *u)).collect()).collect();
            let orders: Vec<f64> = (0..COMMON_ORDERS).map(|k| k as f64).collect();
            kinds.push(Kind::smooth("common", common, &orders, likelihood, sigma));
            let runs: Vec<Vec<usize>> = runs(data);
            if runs.len() > 1 {
                let mut columns = Vec::new();
                let mut orders = Vec::new();
                for run in &runs {
                    for k in 0..RUN_ORDERS {
                        let mut column = vec![0.0; rows];
                        for &row in run {
                            column[row] = cosine(k, u[row]);
                        }
                        columns.push(column);
                        orders.push(k as f64);
                    }
                }
                kinds.push(Kind::smooth("per_run", columns, &orders, likelihood, sigma));
            }
        }
        Smooth::Around(angle) => {
            let mut columns = Vec::new();
            let mut orders = Vec::new();
            for k in FOURIER {
                columns.push(angle.iter().map(|a| (k as f64 * a).cos()).collect());
                columns.push(angle.iter().map(|a| (k as f64 * a).sin()).collect());
                // Once round is two lengths of the cosines along a part.
                orders.extend([2.0 * k as f64; 2]);
            }
            kinds.push(Kind::smooth("around", columns, &orders, likelihood, sigma));
        }
        Smooth::None => {}
    }
    for grouping in &data.layout.design.groupings {
        let count = grouping.group.iter().copied().max().map_or(0, |most| most + 1);
        let level = |g: usize| grouping.group.iter().map(|&of| f64::from(u8::from(of == g))).collect();
        kinds.push(Kind::levels(grouping.name, (0..count).map(level).collect(), likelihood, sigma));
    }
    if let Some(order) = &data.layout.design.order {
        let columns = TEST_ORDERS.map(|k| order.iter().map(|u| cosine(k, *u)).collect()).collect();
        let orders: Vec<f64> = TEST_ORDERS.map(|k| k as f64).collect();
        kinds.push(Kind::smooth("test_order", columns, &orders, likelihood, sigma));
    }
    kinds
}

fn runs(data: &Data) -> Vec<Vec<usize>> {
    let count = data.layout.run_of_trace.iter().copied().max().map_or(0, |most| most + 1);
    let mut runs = vec![Vec::new(); count];
    for (rows, &run) in data.layout.traces.iter().zip(&data.layout.run_of_trace) {
        runs[run].extend_from_slice(rows);
    }
    runs.retain(|rows| !rows.is_empty());
    runs
}

impl Kind {
    /// Amplitudes with standard deviations proportional to exp(-(k pi l)^2 / 2), so that the pointwise
    /// variance (order 0 counts 1, the others 1/2 each) is sigma^2.
    fn smooth(name: &'static str, columns: Vec<Vec<f64>>, orders: &[f64], likelihood: &Likelihood, sigma: f64) -> Self {
        let mut of_each_order: Vec<f64> = orders.to_vec();
        of_each_order.dedup();
        of_each_order.sort_by(f64::total_cmp);
        of_each_order.dedup();
        let spreads = LENGTHS.map(|length| {
            let shape = |order: f64| (-0.5 * (order * PI * length).powi(2)).exp();
            // A pair of Fourier columns of one order has pointwise variance sd^2; a cosine half of it.
            let pairs = orders.len() > 1 && (orders[0] - orders[1]).abs() < 0.5;
            let share = |order: f64| if order == 0.0 || pairs { 1.0 } else { 0.5 };
            let variance: f64 = of_each_order.iter().map(|&k| share(k) * shape(k) * shape(k)).sum();
            orders.iter().map(|&k| sigma * shape(k) / variance.sqrt()).collect()
        });
        let halved = |order: &f64| if name == "around" { 0.5 * order } else { *order };
        Self {
            orders: Some(orders.iter().map(halved).collect()),
            ..Self::new(name, columns, spreads.to_vec(), likelihood)
        }
    }

    fn levels(name: &'static str, columns: Vec<Vec<f64>>, likelihood: &Likelihood, sigma: f64) -> Self {
        let spreads = vec![vec![sigma; columns.len()]];
        Self::new(name, columns, spreads, likelihood)
    }

    fn new(name: &'static str, columns: Vec<Vec<f64>>, spreads: Vec<Vec<f64>>, likelihood: &Likelihood) -> Self {
        let white: Vec<White> = columns.iter().map(|column| likelihood.white(column)).collect();
        let count = white.len();
        let mut gram = DMatrix::zeros(count, count);
        for i in 0..count {
            for j in 0..=i {
                let product = white[i].inner(&white[j]);
                gram[(i, j)] = product;
                gram[(j, i)] = product;
            }
        }
        Self { name, columns, orders: None, white, gram, spreads }
    }
}

/// A set of causes with a remainder of any kind beside it.
pub(super) fn beside(
    kinds: &[Kind],
    columns: &[&White],
    residual: &White,
    sides: &[Side],
    likelihood: &Likelihood,
) -> Option<Remainder> {
    let own = Normal::of(columns, residual);
    let mut all = Vec::new();
    let mut best: Option<(f64, Remainder)> = None;
    for (index, kind) in kinds.iter().enumerate() {
        let explained = kind.explained(&own, columns, residual, sides, likelihood);
        for spread in &kind.spreads {
            for size in SIZES {
                let scales: Vec<f64> =
                    std::iter::repeat_n(1.0, columns.len()).chain(spread.iter().map(|s| s * size)).collect();
                let (log_z, t) = explained(&scales)?;
                if best.as_ref().is_none_or(|(most, _)| log_z > *most) {
                    let amplitudes = t.iter().zip(&scales).skip(columns.len()).map(|(t, s)| t * s).collect();
                    let prior_sd = scales[columns.len()..].to_vec();
                    let of_causes = t[..columns.len()].to_vec();
                    best = Some((log_z, Remainder { log_z, kind: index, amplitudes, of_causes, prior_sd }));
                }
                all.push(log_z);
            }
        }
    }
    best.map(|(_, remainder)| Remainder { log_z: log_mean_exp(&all), ..remainder })
}

/// Evidence with all columns scaled by what is given, and the sizes found.
type Explained<'a> = Box<dyn Fn(&[f64]) -> Option<(f64, Vec<f64>)> + 'a>;

impl Kind {
    /// Evidence of causes and of this remainder with all columns scaled, and the sizes found.
    fn explained<'a>(
        &'a self,
        own: &Normal,
        columns: &'a [&White],
        residual: &'a White,
        sides: &'a [Side],
        likelihood: &'a Likelihood,
    ) -> Explained<'a> {
        if let Likelihood::Gaussian { whitener, scale } = likelihood {
            let joint = self.joined(own, columns, residual);
            return Box::new(move |scales| scaled_evidence(&joint, scales, sides, *scale, whitener.rows()));
        }
        Box::new(move |scales| {
            let all = columns.iter().copied().chain(&self.white);
            let scaled: Vec<White> = all.zip(scales).map(|(column, scale)| column.times(*scale)).collect();
            let evidence = likelihood.evidence(&scaled.iter().collect::<Vec<_>>(), residual, sides)?;
            Some((evidence.log_z, evidence.t))
        })
    }

    /// Posterior standard deviation of a remainder at every row, beside causes with these columns.
    pub(super) fn deviation(
        &self,
        remainder: &Remainder,
        columns: &[&White],
        residual: &White,
        likelihood: &Likelihood,
    ) -> Option<Vec<f64>> {
        let causes = columns.len();
        let joint = match likelihood {
            Likelihood::Gaussian { .. } => self.joined(&Normal::of(columns, residual), columns, residual),
            Likelihood::Classes(_) => {
                let all: Vec<&White> = columns.iter().copied().chain(&self.white).collect();
                let sizes = remainder.of_causes.iter().chain(&remainder.amplitudes);
                let left = all
                    .iter()
                    .zip(sizes)
                    .fold(residual.clone(), |left, (column, size)| left.minus(&column.times(*size)));
                likelihood.normal(&all, &left)?
            }
        };
        let scale = |i: usize| if i < causes { 1.0 } else { remainder.prior_sd[i - causes] };
        let count = joint.right.len();
        let a = DMatrix::from_fn(count, count, |i, j| {
            joint.gram[(i, j)] * scale(i) * scale(j) + f64::from(u8::from(i == j))
        });
        let factor = Cholesky::new(a)?;
        let rows = self.columns.first().map_or(0, Vec::len);
        let of_row = |row: usize| {
            let of = |i: usize| if i < causes { 0.0 } else { self.columns[i - causes][row] * scale(i) };
            factor.l_dirty().solve_lower_triangular(&DVector::from_fn(count, |i, _| of(i))).map(|half| half.norm())
        };
        (0..rows).map(of_row).collect()
    }

    fn joined(&self, own: &Normal, columns: &[&White], residual: &White) -> Normal {
        let (causes, free) = (columns.len(), self.white.len());
        let mut gram = DMatrix::zeros(causes + free, causes + free);
        gram.view_mut((0, 0), (causes, causes)).copy_from(&own.gram);
        gram.view_mut((causes, causes), (free, free)).copy_from(&self.gram);
        for (i, column) in columns.iter().enumerate() {
            for (j, white) in self.white.iter().enumerate() {
                let product = column.inner(white);
                gram[(i, causes + j)] = product;
                gram[(causes + j, i)] = product;
            }
        }
        let mut right = DVector::zeros(causes + free);
        right.rows_mut(0, causes).copy_from(&own.right);
        for (j, white) in self.white.iter().enumerate() {
            right[causes + j] = white.inner(residual);
        }
        Normal { gram, right, square: own.square }
    }
}

/// [`Normal::evidence`] with every column scaled, and without the inverse of what nobody asks for.
fn scaled_evidence(
    normal: &Normal,
    scales: &[f64],
    sides: &[Side],
    scale: Scale,
    rows: f64,
) -> Option<(f64, Vec<f64>)> {
    let count = scales.len();
    let a = DMatrix::from_fn(count, count, |i, j| {
        normal.gram[(i, j)] * scales[i] * scales[j] + f64::from(u8::from(i == j))
    });
    let right = DVector::from_iterator(count, normal.right.iter().zip(scales).map(|(b, s)| b * s));
    let factor = Cholesky::new(a)?;
    let t = factor.solve(&right);
    let q = (normal.square - right.dot(&t)).max(0.0);
    let log_det: f64 = factor.l_dirty().diagonal().iter().map(|d| 2.0 * d.ln()).sum();
    let mut log_z = scale.log_likelihood(q, rows) - 0.5 * log_det;
    for (i, side) in sides.iter().enumerate() {
        if let Some(sign) = side.sign() {
            let mut unit = DVector::zeros(count);
            unit[i] = 1.0;
            let variance = factor.solve(&unit)[i];
            log_z += std::f64::consts::LN_2 + super::evidence::log_normal_cdf(sign * t[i] / variance.sqrt());
        }
    }
    Some((log_z, t.as_slice().to_vec()))
}
