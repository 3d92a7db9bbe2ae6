//! Scatter of the rows, from what was stated, from repeats, or from the rows themselves (`diagnosis/3.1`).

use std::collections::BTreeMap;

use statrs::distribution::{ChiSquared, ContinuousCDF, FisherSnedecor};

use crate::calculator::Smooth;
use crate::diagnosis::rows::basis::{dot, orthonormal, smooth_columns};
use crate::diagnosis::rows::data::Data;
use crate::diagnosis::rows::link::told;

/// Correlations from row to row that are weighed.
const CORRELATIONS: [f64; 8] = [0.0, 0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0.7];
/// Cosines that are projected out of a trace along a part.
const COSINES: usize = 8;
/// Cosines, or Fourier orders, that are projected out of the difference of two sweeps: how the gauge stood, and how it drifted.
const OF_DIFFERENCE: [usize; 2] = [2, 1];
/// Fourier orders that are projected out of a trace round a part.
const FOURIER_ORDERS: usize = 12;
/// Pure-error degrees of freedom that suffice on their own.
const ENOUGH_REPEATS: f64 = 10.0;

/// Probability of so much scatter below which rows contradict what was stated, or what sweeps differ by.
const BY_CHANCE: f64 = 0.01;

/// Scatter of single rows.
#[derive(Debug, Clone, PartialEq)]
pub struct Noise {
    /// Standard deviation; the pooled one where rows have uncertainties of their own.
    pub sigma: f64,
    /// Standard deviation of every row, where stated.
    pub per_row: Option<Vec<f64>>,
    /// Correlation from one row of a trace to the next.
    pub rho: f64,
    /// Degrees of freedom of `sigma`.
    pub dof: f64,
    /// Where it comes from.
    pub source: NoiseSource,
}

/// Where the scatter comes from.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum NoiseSource {
    /// Stated with the rows; what the rows themselves say, relative to it.
    Stated {
        /// Scatter of the rows in units of what was stated.
        scatter_factor: f64,
    },
    /// Stated, and multiplied by what the rows scatter beyond it: they cannot scatter so far by chance.
    Scaled {
        /// Scatter of the rows in units of what was stated.
        scatter_factor: f64,
    },
    /// From repeats.
    Repeats,
    /// From what is left of every trace when smooth columns are taken out.
    Profile,
    /// From what a regression without physics leaves.
    Regression,
    /// Of classes: granted to their margins.
    Spread,
}

/// How many smooth columns a trace of so many rows can lose.
pub(in crate::diagnosis) fn smooth_order(smooth: &Smooth, rows: usize) -> usize {
    match smooth {
        Smooth::Along(_) if rows < 16 => rows / 2,
        Smooth::Along(_) => COSINES,
        Smooth::Around(_) if rows < 50 => rows / 4,
        Smooth::Around(_) => FOURIER_ORDERS,
        Smooth::None => 0,
    }
}

impl Noise {
    /// Scatter of the kept rows about the base; `residual` is measured minus base. `heavy_tails`: standard deviations of the
    /// rows where their scatter is not Gaussian; what was stated stands before them.
    pub fn of(data: &Data, residual: &[f64], keep: &[bool], heavy_tails: Option<&[f64]>) -> Self {
        if let (Some(_), Some(spread)) = (&data.sides, &data.uncertainty) {
            return Self::granted(spread, keep);
        }
        let mut noise = Self::of_rows(data, residual, keep);
        if let (Some(own), None) = (heavy_tails, &noise.per_row) {
            // The scale of Student's t; the rows' own deviations are larger the farther they lie from their trace.
            let least = own.iter().copied().fold(f64::INFINITY, f64::min);
            noise = Self { sigma: least, per_row: Some(own.to_vec()), ..noise };
        }
        // Equal values in all rows say nothing of the scatter; the resolution does.
        let floor = resolution(&data.value, keep) / 12.0_f64.sqrt();
        // Where all values are equal even that is nothing: then the last digits of a number are.
        let largest =
            data.value.iter().zip(keep).filter(|(_, keep)| **keep).fold(0.0, |most: f64, (v, _)| most.max(v.abs()));
        noise.sigma = noise.sigma.max(floor).max(1e-9 * largest).max(1e-12);
        noise
    }

    /// Of classes on these sides with these margins: what a Gaussian row would scatter that said as much of its margin.
    pub(in crate::diagnosis) fn informed(&self, sides: &[f64], margin: &[f64]) -> Self {
        let own = |row: usize| self.per_row.as_ref().map_or(self.sigma, |own| own[row]);
        // A class far from the boundary says nothing; its row stays finite.
        let of_row = |row: usize| own(row) / told(sides[row], margin[row] / own(row)).max(1e-12).sqrt();
        Self { per_row: Some((0..margin.len()).map(of_row).collect()), ..self.clone() }
    }

    /// Of the margins of classes, which say too little to find it from them.
    fn granted(spread: &[f64], keep: &[bool]) -> Self {
        let kept = || spread.iter().zip(keep).filter(|(_, keep)| **keep).map(|(spread, _)| spread * spread);
        let sigma = (kept().sum::<f64>() / kept().count().max(1) as f64).sqrt();
        let (per_row, source) = (Some(spread.to_vec()), NoiseSource::Spread);
        Self { sigma, per_row, rho: 0.0, dof: f64::INFINITY, source }
    }

    fn of_rows(data: &Data, residual: &[f64], keep: &[bool]) -> Self {
        let ordered = data.layout.design.smooth != Smooth::None;
        let own = if ordered { profile(data, residual, keep) } else { unordered(data, residual, keep) };
        match &data.uncertainty {
            None => own,
            Some(stated) => {
                let between = between_sweeps(data, residual, keep).filter(|(_, dof)| *dof >= ENOUGH_REPEATS);
                let (scatter, dof) = between.unwrap_or((own.sigma, own.dof));
                // What a regression without physics leaves may be a cause that it lacks: that contradicts nothing.
                let is_scatter = between.is_some() || own.source != NoiseSource::Regression;
                held_against_rows(stated, keep, &Noise { sigma: scatter, dof, ..own }, is_scatter)
            }
        }
    }
}

/// What was stated; as much more as the rows scatter where their own scatter contradicts it.
fn held_against_rows(stated: &[f64], keep: &[bool], own: &Noise, is_scatter: bool) -> Noise {
    let kept = || stated.iter().zip(keep).filter(|(_, keep)| **keep).map(|(u, _)| u * u);
    let sigma = (kept().sum::<f64>() / kept().count().max(1) as f64).sqrt();
    let scatter_factor = own.sigma / sigma;
    let chance = ChiSquared::new(own.dof).map_or(1.0, |law| law.sf(own.dof * scatter_factor * scatter_factor));
    if is_scatter && chance < BY_CHANCE {
        let per_row = Some(stated.iter().map(|u| u * scatter_factor).collect());
        return Noise { per_row, source: NoiseSource::Scaled { scatter_factor }, ..own.clone() };
    }
    let source = NoiseSource::Stated { scatter_factor };
    Noise { sigma, per_row: Some(stated.to_vec()), rho: own.rho, dof: f64::INFINITY, source }
}

/// Smallest difference between two different values.
pub(in crate::diagnosis) fn resolution(values: &[f64], keep: &[bool]) -> f64 {
    let mut values: Vec<f64> = values.iter().zip(keep).filter(|(_, keep)| **keep).map(|(v, _)| *v).collect();
    values.sort_by(f64::total_cmp);
    values.windows(2).map(|pair| pair[1] - pair[0]).filter(|d| *d > 0.0).min_by(f64::total_cmp).unwrap_or(0.0)
}

/// Rows without an order: pooled pure error where it has enough degrees of freedom, else what a
/// regression leaves.
fn unordered(data: &Data, residual: &[f64], keep: &[bool]) -> Noise {
    let (sum, dof) = pure_error(data, residual, keep);
    if dof >= ENOUGH_REPEATS {
        return Noise { sigma: (sum / dof).sqrt(), per_row: None, rho: 0.0, dof, source: NoiseSource::Repeats };
    }
    let pick = |column: &[f64]| -> Vec<f64> {
        column.iter().zip(keep).filter(|(_, keep)| **keep).map(|(value, _)| *value).collect()
    };
    let mut left = pick(residual);
    let basis = orthonormal(data.layout.design.regressors.iter().map(|column| pick(column)).collect());
    for column in &basis {
        let along = dot(column, &left);
        left.iter_mut().zip(column).for_each(|(r, c)| *r -= along * c);
    }
    let dof = (left.len() as f64 - basis.len() as f64).max(1.0);
    Noise { sigma: (dot(&left, &left) / dof).sqrt(), per_row: None, rho: 0.0, dof, source: NoiseSource::Regression }
}

/// Sum of squares within repeats, and its degrees of freedom.
pub(in crate::diagnosis) fn pure_error(data: &Data, residual: &[f64], keep: &[bool]) -> (f64, f64) {
    let cells = data.layout.design.cell.iter().copied().max().map_or(0, |most| most + 1);
    let mut groups: Vec<Vec<f64>> = vec![Vec::new(); cells];
    for (row, &cell) in data.layout.design.cell.iter().enumerate() {
        if keep[row] {
            groups[cell].push(residual[row]);
        }
    }
    groups.iter().filter(|group| group.len() > 1).fold((0.0, 0.0), |(sum, dof), group| {
        let mean = group.iter().sum::<f64>() / group.len() as f64;
        let within: f64 = group.iter().map(|r| (r - mean) * (r - mean)).sum();
        (sum + within, dof + group.len() as f64 - 1.0)
    })
}

/// Standard deviation of single rows from the differences between sweeps of one run over the same places, and its degrees
/// of freedom: means of sweeps and of places taken out. `None` without such sweeps.
///
/// Structure that all sweeps share, however fine, is no part of it.
pub(in crate::diagnosis) fn between_sweeps(data: &Data, residual: &[f64], keep: &[bool]) -> Option<(f64, f64)> {
    if data.layout.design.smooth == Smooth::None {
        return None;
    }
    let sweeps = data.layout.kept_traces(keep);
    let mut runs: Vec<usize> = sweeps.iter().map(|(run, _)| *run).collect();
    runs.sort_unstable();
    runs.dedup();
    let (mut sum, mut dof) = (0.0, 0.0);
    for run in runs {
        let own: Vec<BTreeMap<usize, f64>> = sweeps
            .iter()
            .filter(|(of, _)| *of == run)
            .map(|(_, rows)| rows.iter().map(|&row| (data.layout.design.cell[row], residual[row])).collect())
            .collect();
        let Some((first, others)) = own.split_first() else { continue };
        let shared: Vec<usize> =
            first.keys().copied().filter(|cell| others.iter().all(|sweep| sweep.contains_key(cell))).collect();
        if others.is_empty() || shared.len() < 2 {
            continue;
        }
        let (many, places) = (own.len() as f64, shared.len() as f64);
        let of_sweep = |sweep: &BTreeMap<usize, f64>| shared.iter().map(|cell| sweep[cell]).sum::<f64>() / places;
        let of_place = |cell: usize| own.iter().map(|sweep| sweep[&cell]).sum::<f64>() / many;
        let mean = own.iter().map(&of_sweep).sum::<f64>() / many;
        for sweep in &own {
            let level = of_sweep(sweep);
            sum += shared.iter().map(|&cell| (sweep[&cell] - level - of_place(cell) + mean).powi(2)).sum::<f64>();
        }
        dof += (many - 1.0) * (places - 1.0);
    }
    (dof > 0.0).then(|| ((sum / dof).sqrt(), dof))
}

/// Restricted likelihood of sigma and rho after taking smooth columns out of every trace.
///
/// The likelihood of Q'r with Q spanning the complement of Z is that of the generalised least-squares
/// residual: log|Q'RQ| = log|R| + log|Z'R^-1 Z| - log|Z'Z|. With the stationary AR(1) correlation R,
/// whitening is a difference of neighbours and log|R| = (n-1) log(1 - rho^2).
///
/// Rho is found no better than its likelihood tells, and what it decides is how far long waves scatter: their variance is
/// (1 + rho)/(1 - rho) times that of rows that know nothing of each other. The mean of that ratio over the likelihood, with a
/// prior of 2 (1 - rho), is taken, not its value at the likeliest rho: a rho that is too small by chance makes chance look like
/// a cause.
///
/// Sweeps that share structure finer than the columns taken out (see [`is_finer_structure`]) are looked at one by one: their
/// differences would tell of a scatter that is none of the rows'.
fn profile(data: &Data, residual: &[f64], keep: &[bool]) -> Noise {
    let Some(alone) = weighed(&told_of_scatter(data, residual, keep, false)) else {
        return unordered(data, residual, keep);
    };
    let between = between_sweeps(data, residual, keep);
    match between.filter(|between| !is_finer_structure((alone.sigma, alone.dof), *between)) {
        Some(_) => weighed(&told_of_scatter(data, residual, keep, true)).unwrap_or(alone),
        None => alone,
    }
}

/// Whether rows scatter beyond what sweeps differ by, each with its degrees of freedom, more than chance lets them.
pub(in crate::diagnosis) fn is_finer_structure((sigma, dof): (f64, f64), (between, dof_between): (f64, f64)) -> bool {
    between > 0.0
        && FisherSnedecor::new(dof, dof_between).is_ok_and(|law| law.sf((sigma / between).powi(2)) < BY_CHANCE)
}

/// Scatter at the correlation that its likelihood tells; `None` without traces.
fn weighed(traces: &[Told]) -> Option<Noise> {
    if traces.is_empty() {
        return None;
    }
    let tried = CORRELATIONS.map(|rho| (restricted(traces, rho).0 + (1.0 - rho).ln(), (1.0 + rho) / (1.0 - rho)));
    let most = tried.iter().map(|(log_l, _)| *log_l).fold(f64::NEG_INFINITY, f64::max);
    let shares = tried.iter().map(|(log_l, ratio)| ((log_l - most).exp(), ratio));
    let (sum, weight) = shares.fold((0.0, 0.0), |(sum, all), (share, ratio)| (sum + share * ratio, all + share));
    let ratio = sum / weight;
    Some(restricted(traces, (ratio - 1.0) / (ratio + 1.0)).1)
}

/// A trace that scatters as its rows do, and the orthonormal smooth columns that say nothing of that.
type Told = (Vec<f64>, Vec<Vec<f64>>);

/// What the rows tell of their scatter: each sweep beside its smooth part. Sweeps of one run over the same places share what is
/// smooth: of T of them their sum over sqrt(T) has a smooth part, and T - 1 differences, orthonormal (Helmert), have none
/// but for the gauge. Only those show how far long waves scatter.
fn told_of_scatter(data: &Data, residual: &[f64], keep: &[bool], by_differences: bool) -> Vec<Told> {
    let (smooth, cell) = (&data.layout.design.smooth, &data.layout.design.cell);
    let columns = |rows: &[usize], count: usize| orthonormal(smooth_columns(smooth, rows, count));
    let whole = |rows: &[usize]| columns(rows, smooth_order(smooth, rows.len()));
    let of_difference = OF_DIFFERENCE[usize::from(matches!(smooth, Smooth::Around(_)))];
    let mut sweeps = data.layout.kept_traces(keep);
    sweeps.sort_by_key(|(run, _)| *run);
    let mut told = Vec::with_capacity(sweeps.len());
    let mut rest = sweeps.as_slice();
    while let Some((run, first)) = rest.first() {
        let (own, others) = rest.split_at(rest.iter().take_while(|(of, _)| of == run).count());
        rest = others;
        let values = |rows: &[usize]| -> Vec<f64> { rows.iter().map(|&row| residual[row]).collect() };
        let is_like_first = |rows: &[usize]| {
            rows.len() == first.len() && rows.iter().zip(first).all(|(&row, &other)| cell[row] == cell[other])
        };
        // Of a short sweep a difference would keep no row.
        let is_long = first.len() > 4 * of_difference;
        if !by_differences || !is_long || !own.iter().all(|(_, rows)| is_like_first(rows)) {
            told.extend(own.iter().map(|(_, rows)| (values(rows), whole(rows))));
            continue;
        }
        let mut sum = values(first);
        for (count, (_, rows)) in own.iter().enumerate().skip(1) {
            let (before, next) = (count as f64, values(rows));
            let norm = (before * (before + 1.0)).sqrt();
            let difference = sum.iter().zip(&next).map(|(sum, next)| (sum - before * next) / norm).collect();
            told.push((difference, columns(rows, of_difference)));
            sum.iter_mut().zip(&next).for_each(|(sum, next)| *sum += next);
        }
        let norm = (own.len() as f64).sqrt();
        told.push((sum.into_iter().map(|sum| sum / norm).collect(), whole(first)));
    }
    told
}

/// Restricted log-likelihood at a correlation, sigma at its best, and the scatter there; of rows of traces, each with the
/// orthonormal columns that are taken out of it.
fn restricted(traces: &[Told], rho: f64) -> (f64, Noise) {
    let (mut log_det, mut quadratic, mut dof) = (0.0, 0.0, 0.0);
    for (values, columns) in traces {
        let white: Vec<Vec<f64>> = columns.iter().map(|column| decorrelated(column, rho)).collect();
        let mut left = decorrelated(values, rho);
        log_det += (values.len() as f64 - 1.0) * (1.0 - rho * rho).ln() + log_gram(&white);
        let basis = orthonormal(white);
        for column in &basis {
            let along = dot(column, &left);
            left.iter_mut().zip(column).for_each(|(r, c)| *r -= along * c);
        }
        quadratic += dot(&left, &left);
        dof += values.len() as f64 - columns.len() as f64;
    }
    let dof = dof.max(1.0);
    let variance = (quadratic / dof).max(f64::MIN_POSITIVE);
    let log_l = -0.5 * log_det - 0.5 * dof * variance.ln();
    (log_l, Noise { sigma: variance.sqrt(), per_row: None, rho, dof, source: NoiseSource::Profile })
}

/// AR(1) whitening of a trace in measuring order.
pub(in crate::diagnosis) fn decorrelated(values: &[f64], rho: f64) -> Vec<f64> {
    let scale = 1.0 / (1.0 - rho * rho).sqrt();
    let first = values.first().copied();
    first.into_iter().chain(values.windows(2).map(|pair| (pair[1] - rho * pair[0]) * scale)).collect()
}

/// log|Z'Z|, by the lengths that Gram-Schmidt divides by.
fn log_gram(columns: &[Vec<f64>]) -> f64 {
    let mut basis: Vec<Vec<f64>> = Vec::with_capacity(columns.len());
    let mut sum = 0.0;
    for column in columns {
        let mut column = column.clone();
        for _ in 0..2 {
            for done in &basis {
                let along = dot(done, &column);
                column.iter_mut().zip(done).for_each(|(c, d)| *c -= along * d);
            }
        }
        let length = dot(&column, &column).sqrt().max(f64::MIN_POSITIVE);
        sum += 2.0 * length.ln();
        for c in &mut column {
            *c /= length;
        }
        basis.push(column);
    }
    sum
}
