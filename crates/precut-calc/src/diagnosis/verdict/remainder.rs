//! The shape of what the catalogue does not explain (`diagnosis/3.7`, unknown remainder).

use crate::calculator::Smooth;
use crate::diagnosis::statistics::evidence::Normal;
use crate::diagnosis::verdict::weigh::Weighing;

/// A remainder without a name, at its posterior mean.
#[derive(Debug, Clone, PartialEq)]
pub struct RemainderShape {
    /// What it is free over: `common` to all runs, `per_run`, `around` the part, over `test_order`, or the
    /// levels of a grouping, smooth in one of the `conditions` or in a `pair_of_conditions`.
    pub kind: &'static str,
    /// Which conditions or which factor, where the kind does not say.
    pub over: Vec<String>,
    /// One value per row, in the unit of the rows.
    pub value: Vec<f64>,
    /// Its posterior standard deviation at every row; empty where it has too many free sizes.
    pub deviation: Vec<f64>,
    /// Orders of its waves with the amplitude of each: along a part half waves over its length, round it whole ones, of
    /// several runs the root mean square over them. Empty where it has levels.
    pub spectrum: Vec<(f64, f64)>,
    /// Its root mean square over the rows that count.
    pub rms: f64,
    /// Row where it is largest in magnitude.
    pub extreme_row: usize,
    /// Share of the mean square of the residuals (of classes: of the deviance) that it explains, the named part taken out.
    pub explained: f64,
    /// Where one step explains most of it, along a part.
    pub step: Option<Step>,
    /// How its size goes from run to run with what the base predicts there, where it has one shape in all runs: 0 where it
    /// is the same in all, 1 where it is in proportion; with its standard deviation.
    pub with_base: Option<(f64, f64)>,
}

/// A step along a part.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Step {
    /// Place, as a share of the length.
    pub place: f64,
    /// What is beyond it, above what is before it, in the unit of the rows.
    pub size: f64,
    /// How much likelier a line with this step is than a line without: difference of log likelihoods.
    pub log_likelihood: f64,
}

/// Of the heaviest set that has a remainder beside it; `None` where none was weighed.
pub fn remainder_shape(weighing: &Weighing<'_>) -> Option<RemainderShape> {
    let set = weighing.sets.iter().find(|set| set.remainder.is_some())?;
    let remainder = set.remainder.as_ref()?;
    let kind = &weighing.kinds[remainder.kind];
    let rows = weighing.keep.len();
    let mut value = vec![0.0; rows];
    for (column, amplitude) in kind.columns.iter().zip(&remainder.amplitudes) {
        column.add_to(&mut value, *amplitude);
    }
    let deviation = weighing.remainder_deviation(set, kind, remainder).unwrap_or_default();
    let named = weighing.foundation.subject.predict(&set.settings).ok()?;
    let left = |row: usize| weighing.foundation.data.value[row] - named[row].unwrap_or(weighing.foundation.base[row]);
    let kept: Vec<usize> = (0..rows).filter(|&row| weighing.keep[row]).collect();
    let mean = |of: &dyn Fn(usize) -> f64| kept.iter().map(|&row| of(row)).sum::<f64>() / kept.len().max(1) as f64;
    let rms = mean(&|row| value[row] * value[row]).sqrt();
    let before = mean(&|row| weighing.loss(row, left(row)));
    let after = mean(&|row| weighing.loss(row, left(row) - value[row]));
    let extreme_row = kept.iter().copied().max_by(|&a, &b| value[a].abs().total_cmp(&value[b].abs()))?;
    let explained = if before > 0.0 { (1.0 - after / before).clamp(0.0, 1.0) } else { 0.0 };
    let spectrum = kind.orders.as_ref().map_or_else(Vec::new, |orders| spectrum(orders, &remainder.amplitudes));
    let left: Vec<f64> = (0..rows).map(left).collect();
    let step = step(weighing, &left, &kept);
    let with_base = (kind.name == "common").then(|| with_base(weighing, &left, &value)).flatten();
    let (over, kind) = (kind.over.clone(), kind.name);
    Some(RemainderShape { kind, over, value, deviation, spectrum, rms, extreme_row, explained, step, with_base })
}

/// Places at which a step is tried.
const STEP_PLACES: u32 = 49;

/// The likeliest step: whitened least squares of a line, with and without it.
fn step(weighing: &Weighing<'_>, left: &[f64], kept: &[usize]) -> Option<Step> {
    let Smooth::Along(place) = &weighing.foundation.data.layout.design.smooth else { return None };
    let white = |of: &dyn Fn(usize) -> f64| weighing.whitener.white(&(0..left.len()).map(of).collect::<Vec<_>>());
    let (residual, level, slope) = (weighing.whitener.white(left), white(&|_| 1.0), white(&|row| place[row]));
    let line = Normal::of(&[&level, &slope], &residual).misfit();
    let ends = kept.iter().map(|&row| place[row]).fold((1.0_f64, 0.0_f64), |(l, h), u| (l.min(u), h.max(u)));
    let tried = (1..=STEP_PLACES).map(|k| ends.0 + (ends.1 - ends.0) * f64::from(k) / f64::from(STEP_PLACES + 1));
    let of_place = |at: f64| {
        let jump = white(&|row| f64::from(u8::from(place[row] > at)));
        let normal = Normal::of(&[&level, &slope, &jump], &residual);
        let size = normal.least_squares()?[2];
        let rows = kept.len() as f64;
        Some(Step { place: at, size, log_likelihood: 0.5 * rows * (line / normal.misfit().max(1e-300)).ln() })
    };
    tried.filter_map(of_place).max_by(|a, b| a.log_likelihood.total_cmp(&b.log_likelihood))
}

/// A common shape in one run.
struct RunSize {
    /// Root mean square of what the base predicts there.
    base: f64,
    /// How large the shape is.
    size: f64,
    /// Mean square of the shape times the rows.
    weight: f64,
}

/// Regression of the size of a common shape in every run, a_i, on what the base predicts there, F_i:
/// a_i = a (1 + p (F_i/F - 1)), F the mean of F_i; p and its standard deviation.
fn with_base(weighing: &Weighing<'_>, left: &[f64], shape: &[f64]) -> Option<(f64, f64)> {
    let foundation = weighing.foundation;
    let mut runs: Vec<RunSize> = Vec::new();
    for run in 0..=*foundation.data.layout.run_of_trace.iter().max()? {
        let rows: Vec<usize> = weighing.rows_of_run(run);
        let sum = |of: &dyn Fn(usize) -> f64| rows.iter().map(|&row| of(row)).sum::<f64>();
        // Set-ups differ from run to run: levels are taken out.
        let count = rows.len() as f64;
        let (mean_shape, mean_left) = (sum(&|row| shape[row]) / count, sum(&|row| left[row]) / count);
        let square = sum(&|row| (shape[row] - mean_shape).powi(2));
        if rows.len() < 3 || square <= 0.0 {
            continue;
        }
        let size = sum(&|row| (shape[row] - mean_shape) * (left[row] - mean_left)) / square;
        let base = (sum(&|row| foundation.base[row].powi(2)) / count).sqrt();
        runs.push(RunSize { base, size, weight: square });
    }
    let weight: f64 = runs.iter().map(|run| run.weight).sum();
    let mean = |of: fn(&RunSize) -> f64| runs.iter().map(|run| run.weight * of(run)).sum::<f64>() / weight;
    let (base, size) = (mean(|run| run.base), mean(|run| run.size));
    let spread: f64 = runs.iter().map(|run| run.weight * (run.base / base - 1.0).powi(2)).sum();
    // Bases that differ by less than a tenth say nothing.
    if runs.len() < 3 || base <= 0.0 || size.abs() <= 0.0 || spread < 0.01 * weight {
        return None;
    }
    let along = |run: &RunSize| run.weight * (run.base / base - 1.0) * (run.size - size);
    let slope = runs.iter().map(along).sum::<f64>() / spread;
    Some((slope / size, weighing.noise.sigma / spread.sqrt() / size.abs()))
}

/// Amplitude of every order: cosine and sine of one order together, of several runs the root mean square.
fn spectrum(orders: &[f64], amplitudes: &[f64]) -> Vec<(f64, f64)> {
    let mut known: Vec<f64> = orders.to_vec();
    known.sort_by(f64::total_cmp);
    known.dedup();
    // Neighbours of one order are a wave's cosine and sine.
    let pairs = orders.len() > 1 && orders[0].total_cmp(&orders[1]).is_eq();
    let of_order = |order: f64| {
        let squares: Vec<f64> = orders
            .iter()
            .zip(amplitudes)
            .filter(|(of, _)| of.total_cmp(&order).is_eq())
            .map(|(_, amplitude)| amplitude * amplitude)
            .collect();
        let waves = if pairs { squares.len() as f64 / 2.0 } else { squares.len() as f64 };
        (squares.iter().sum::<f64>() / waves).sqrt()
    };
    known.into_iter().map(|order| (order, of_order(order))).collect()
}
