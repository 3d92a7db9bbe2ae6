//! Single rows that do not belong to their trace (`diagnosis/3.1`, robustness).

use crate::calculator::{Failure, Monitor, Smooth, checkpoint};
use crate::diagnosis::rows::basis::{dot, orthonormal, smooth_columns};
use crate::diagnosis::rows::data::Data;
use crate::diagnosis::rows::noise::smooth_order;

/// Scaled deleted residual beyond which a row is looked at, in robust standard deviations.
const SUSPECT: f64 = 4.5;
/// Below this, a neighbour of a row that was taken out is at peace: the row stood alone.
const AT_PEACE: f64 = 3.0;
/// 1 / Phi^-1(3/4): makes the median absolute deviation a standard deviation of Gaussian scatter.
const MAD_TO_SD: f64 = 1.482_602_218_505_602;
/// So many far rows side by side are no chance.
const SIDE_BY_SIDE: usize = 3;
/// More flagged rows than one in so many are no outliers but heavy tails.
const ONE_IN: usize = 20;

/// Rows that stand alone.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Outliers {
    /// Their numbers, worst first.
    pub rows: Vec<usize>,
    /// Whether there are too many to be called outliers: then none is left out.
    pub too_many: bool,
    /// Of too many along sweeps: standard deviation of every row under scatter with heavy tails, that of a row far from its
    /// sweep being large. `None` for rows without an order: there nothing tells a blunder from an island that the model
    /// lacks, and what is weighed down is not found.
    pub heavy_tails: Option<Vec<f64>>,
    /// Rows along sweeps that lie as far away and stay: nothing tells whether they are blunders side by side or belong to a
    /// narrow structure. Ascending; none where there are too many outliers.
    pub far_rows: Vec<usize>,
    /// Those of them that the part has for certain: several side by side, or shown by other sweeps, too. What they are off is no
    /// scatter.
    pub structure: Vec<usize>,
}

impl Outliers {
    /// Which rows stay.
    pub fn keep(&self, rows: usize) -> Vec<bool> {
        let mut keep = vec![true; rows];
        if !self.too_many {
            self.rows.iter().for_each(|&row| keep[row] = false);
        }
        keep
    }
}

/// Worst first: a row is taken out, its trace fitted again without it, and flagged if its neighbours are
/// then at peace and no other sweep shows the same there. So are two neighbours that only come to peace together, where another sweep passed there and saw nothing
/// of it. Otherwise the row is part of a structure and stays.
///
/// The deletion is essential: in a fit that contains it, a spike of 20 sigma drags its neighbours beyond
/// 3 sigma with it and would pass for structure. The scatter is that of all rows, unless it is `known` from elsewhere.
pub(crate) fn outliers(
    data: &Data,
    residual: &[f64],
    known: Option<f64>,
    monitor: &dyn Monitor,
) -> Result<Outliers, Failure> {
    let ordered = data.layout.design.smooth != Smooth::None;
    let mut traces: Vec<Fit> = if ordered {
        data.layout
            .traces
            .iter()
            .map(|rows| {
                let count = smooth_order(&data.layout.design.smooth, rows.len());
                Fit::of(rows, smooth_columns(&data.layout.design.smooth, rows, count), residual, None)
            })
            .collect()
    } else {
        let rows: Vec<usize> = (0..residual.len()).collect();
        vec![Fit::of(&rows, data.layout.design.regressors.clone(), residual, Some(&data.layout.design.cell))]
    };
    let mut flagged = Vec::new();
    let most = (residual.len() / ONE_IN).max(1);
    let spread = loop {
        checkpoint(monitor)?;
        let spread = known.unwrap_or_else(|| robust_sd(traces.iter().flat_map(Fit::open_residuals)));
        if spread <= 0.0 {
            break spread;
        }
        let worst = traces
            .iter()
            .enumerate()
            .filter_map(|(k, fit)| fit.worst().map(|(place, t)| (k, place, t)))
            .max_by(|a, b| a.2.total_cmp(&b.2));
        let Some((trace, place, t)) = worst else { break spread };
        if t < SUSPECT * spread {
            break spread;
        }
        let smooth = &data.layout.design.smooth;
        let blunders = if !traces[trace].stands_alone(place, AT_PEACE * spread) {
            two_blunders(&traces, smooth, trace, place, spread)
        } else if is_shown_elsewhere(&traces, smooth, trace, place, spread) {
            Vec::new()
        } else {
            vec![place]
        };
        let fit = &mut traces[trace];
        if blunders.is_empty() {
            fit.structure[place] = true;
            continue;
        }
        for place in blunders {
            flagged.push(fit.rows[place]);
            fit.out[place] = true;
        }
        fit.refit();
        // What they dragged with them is looked at anew.
        fit.structure.fill(false);
        if flagged.len() > most {
            let heavy_tails = ordered.then(|| heavy_tails(&traces, residual.len()));
            return Ok(Outliers { rows: flagged, too_many: true, heavy_tails, ..Outliers::default() });
        }
    };
    let mut found = Outliers { rows: flagged, ..Outliers::default() };
    for (trace, fit) in traces.iter().enumerate().filter(|_| ordered) {
        let far = fit.far_structure(SUSPECT * spread);
        for &place in &far {
            found.far_rows.push(fit.rows[place]);
            if in_a_row(&far, place) || is_shown_elsewhere(&traces, &data.layout.design.smooth, trace, place, spread) {
                found.structure.push(fit.rows[place]);
            }
        }
    }
    found.far_rows.sort_unstable();
    Ok(found)
}

/// Whether a place is one of so many side by side that chance, however heavy its tails, does not put there.
fn in_a_row(far: &[usize], place: usize) -> bool {
    let before = (1..SIDE_BY_SIDE).take_while(|by| place >= *by && far.contains(&(place - by))).count();
    let after = (1..SIDE_BY_SIDE).take_while(|by| far.contains(&(place + by))).count();
    before + after + 1 >= SIDE_BY_SIDE
}

/// Whether at least half of the other sweeps that have a row there, within half of the way to the next one, are as far away on
/// the same side: the part has something there that is narrower than the rows are apart. Of heavy tails now and then one is.
fn is_shown_elsewhere(traces: &[Fit], smooth: &Smooth, trace: usize, place: usize, spread: f64) -> bool {
    let (Smooth::Along(along) | Smooth::Around(along)) = smooth else { return false };
    let fit = &traces[trace];
    let (at, t) = (along[fit.rows[place]], fit.t[place]);
    let gaps = beyond(place, &fit.out).into_iter().map(|next| (along[fit.rows[next]] - at).abs());
    let Some(gap) = gaps.reduce(f64::min) else { return false };
    let others = traces.iter().enumerate().filter(|(other, _)| *other != trace).map(|(_, other)| other);
    let witnesses: Vec<f64> = others.filter_map(|other| other.nearest(along, at, 0.5 * gap)).collect();
    let agree = witnesses.iter().filter(|other| **other * t > 0.0 && other.abs() > SUSPECT * spread).count();
    agree > 0 && 2 * agree >= witnesses.len()
}

/// A far row and a neighbour as far away, if the rows beside both are at peace without them and every sweep that passed the
/// place is, too: a structure of the part would show in it. With no other sweep there is no witness, and none is taken out.
fn two_blunders(traces: &[Fit], smooth: &Smooth, trace: usize, place: usize, spread: f64) -> Vec<usize> {
    let (Smooth::Along(along) | Smooth::Around(along)) = smooth else { return Vec::new() };
    let fit = &traces[trace];
    let pair = beyond(place, &fit.out).into_iter().find(|&beside| {
        let mut out = fit.out.clone();
        out[place] = true;
        let beside_alone = scaled_residuals(&fit.columns, &fit.value, &out)[beside];
        out[beside] = true;
        let without = scaled_residuals(&fit.columns, &fit.value, &out);
        let edges = [beyond(place, &out), beyond(beside, &out)].concat();
        beside_alone.abs() > SUSPECT * spread && edges.iter().all(|&i| without[i].abs() < AT_PEACE * spread)
    });
    let Some(beside) = pair else { return Vec::new() };
    let far = [fit.rows[place], fit.rows[beside]];
    let reach = (along[far[0]] - along[far[1]]).abs();
    let witnesses: Vec<f64> = traces
        .iter()
        .enumerate()
        .filter(|(other, _)| *other != trace)
        .flat_map(|(_, other)| far.iter().filter_map(|&row| other.nearest(along, along[row], reach)))
        .collect();
    let undisturbed = witnesses.iter().all(|t| t.abs() < AT_PEACE * spread);
    if !witnesses.is_empty() && undisturbed { vec![place, beside] } else { Vec::new() }
}

/// Degrees of freedom of scatter with heavy tails.
const TAILS: f64 = 5.0;
/// Rounds of reweighting; the scale settles to a thousandth in ten.
const ROUNDS: usize = 20;

/// Standard deviations of the rows by iteratively reweighted fits of their traces: under Student's t with nu degrees of
/// freedom and scale s a row at distance r counts as a Gaussian one of variance s^2/w, w = (nu + 1)/(nu + r^2/s^2).
fn heavy_tails(traces: &[Fit], rows: usize) -> Vec<f64> {
    let mut weights: Vec<Vec<f64>> = traces.iter().map(|fit| vec![1.0; fit.rows.len()]).collect();
    let mut scale = 0.0;
    for _ in 0..ROUNDS {
        let left: Vec<Vec<f64>> =
            traces.iter().zip(&weights).map(|(fit, own)| weighted_residuals(&fit.columns, &fit.value, own)).collect();
        let fitted: usize = traces.iter().map(|fit| fit.columns.len().min(fit.rows.len())).sum();
        let squares: f64 = left.iter().flatten().zip(weights.iter().flatten()).map(|(r, w)| w * r * r).sum();
        scale = (squares / (rows.saturating_sub(fitted)).max(1) as f64).sqrt();
        if scale <= 0.0 {
            break;
        }
        for (own, left) in weights.iter_mut().zip(&left) {
            for (weight, r) in own.iter_mut().zip(left) {
                *weight = (TAILS + 1.0) / (TAILS + (r / scale).powi(2));
            }
        }
    }
    let mut deviations = vec![scale; rows];
    for (fit, own) in traces.iter().zip(&weights) {
        for (&row, weight) in fit.rows.iter().zip(own) {
            deviations[row] = scale / weight.sqrt();
        }
    }
    deviations
}

/// What weighted least squares by the columns leaves.
fn weighted_residuals(columns: &[Vec<f64>], value: &[f64], weights: &[f64]) -> Vec<f64> {
    let scaled = |column: &[f64]| -> Vec<f64> { column.iter().zip(weights).map(|(c, w)| c * w.sqrt()).collect() };
    let mut left = scaled(value);
    for column in &orthonormal(columns.iter().map(|column| scaled(column)).collect()) {
        let along = dot(column, &left);
        left.iter_mut().zip(column).for_each(|(r, c)| *r -= along * c);
    }
    left.iter().zip(weights).map(|(r, w)| r / w.sqrt()).collect()
}

fn robust_sd(values: impl Iterator<Item = f64>) -> f64 {
    let mut values: Vec<f64> = values.map(f64::abs).collect();
    if values.is_empty() {
        return 0.0;
    }
    values.sort_by(f64::total_cmp);
    let middle = values.len() / 2;
    let median =
        if values.len().is_multiple_of(2) { f64::midpoint(values[middle - 1], values[middle]) } else { values[middle] };
    MAD_TO_SD * median
}

/// The rich fit of one trace.
struct Fit {
    rows: Vec<usize>,
    columns: Vec<Vec<f64>>,
    value: Vec<f64>,
    /// Condition of every row, for rows without an order: those with one condition are repeats.
    cell: Option<Vec<usize>>,
    /// Taken out.
    out: Vec<bool>,
    /// Looked at, and found to be part of a structure.
    structure: Vec<bool>,
    /// residual / sqrt(1 - leverage), 0 where a row is out.
    t: Vec<f64>,
}

impl Fit {
    fn of(rows: &[usize], columns: Vec<Vec<f64>>, residual: &[f64], cell: Option<&[usize]>) -> Self {
        let value: Vec<f64> = rows.iter().map(|&row| residual[row]).collect();
        let count = rows.len();
        let mut fit = Self {
            rows: rows.to_vec(),
            columns,
            value,
            cell: cell.map(|cell| rows.iter().map(|&row| cell[row]).collect()),
            out: vec![false; count],
            structure: vec![false; count],
            t: vec![0.0; count],
        };
        fit.refit();
        fit
    }

    fn refit(&mut self) {
        self.t = scaled_residuals(&self.columns, &self.value, &self.out);
    }

    /// Scaled residuals of the rows that are in.
    fn open_residuals(&self) -> impl Iterator<Item = f64> + '_ {
        self.t.iter().zip(&self.out).filter(|(_, out)| !**out).map(|(t, _)| *t)
    }

    fn worst(&self) -> Option<(usize, f64)> {
        (0..self.rows.len())
            .filter(|&place| !self.out[place] && !self.structure[place])
            .map(|place| (place, self.t[place].abs()))
            .max_by(|a, b| a.1.total_cmp(&b.1))
    }

    /// Places of rows that were looked at, are part of a structure, and lie farther away than this, ascending.
    fn far_structure(&self, from: f64) -> Vec<usize> {
        (0..self.rows.len()).filter(|&place| self.structure[place] && self.t[place].abs() >= from).collect()
    }

    /// Whether, with this row out, its neighbours in measuring order fit. Of rows without an order: whether no repeat lies
    /// where it lies, for repeats that agree are witnesses, however far the regression runs from them.
    fn stands_alone(&self, place: usize, peace: f64) -> bool {
        if let Some(cell) = &self.cell {
            let agrees = |i: usize| cell[i] == cell[place] && (self.value[i] - self.value[place]).abs() < peace;
            return !(0..cell.len()).any(|i| i != place && !self.out[i] && agrees(i));
        }
        let mut out = self.out.clone();
        out[place] = true;
        let t = scaled_residuals(&self.columns, &self.value, &out);
        beyond(place, &out).into_iter().all(|i| t[i].abs() < peace)
    }

    /// Scaled residual of the row that is in and lies nearest to a position, within reach.
    fn nearest(&self, along: &[f64], position: f64, reach: f64) -> Option<f64> {
        let away = |place: &usize| (along[self.rows[*place]] - position).abs();
        let within = (0..self.rows.len()).filter(|&place| !self.out[place] && away(&place) <= reach);
        within.min_by(|a, b| away(a).total_cmp(&away(b))).map(|place| self.t[place])
    }
}

/// The next rows to either side of a place that are in.
fn beyond(place: usize, out: &[bool]) -> Vec<usize> {
    let before = (0..place).rev().find(|&i| !out[i]);
    let after = (place + 1..out.len()).find(|&i| !out[i]);
    [before, after].into_iter().flatten().collect()
}

fn scaled_residuals(columns: &[Vec<f64>], value: &[f64], out: &[bool]) -> Vec<f64> {
    let pick = |column: &[f64]| -> Vec<f64> {
        column.iter().zip(out).filter(|(_, out)| !**out).map(|(value, _)| *value).collect()
    };
    let mut residual = pick(value);
    let basis = orthonormal(columns.iter().map(|column| pick(column)).collect());
    let mut free = vec![1.0; residual.len()];
    for column in &basis {
        let along = dot(column, &residual);
        residual.iter_mut().zip(column).for_each(|(r, c)| *r -= along * c);
        free.iter_mut().zip(column).for_each(|(f, c)| *f -= c * c);
    }
    let mut kept = residual.into_iter().zip(free);
    out.iter()
        .map(|out| match kept_next(*out, &mut kept) {
            // A row that its trace cannot judge: the fit goes through it.
            Some((r, free)) if free > 1e-6 => r / free.sqrt(),
            _ => 0.0,
        })
        .collect()
}

fn kept_next(out: bool, kept: &mut impl Iterator<Item = (f64, f64)>) -> Option<(f64, f64)> {
    if out { None } else { kept.next() }
}
