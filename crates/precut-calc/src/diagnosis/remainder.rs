//! The shape of what the catalogue does not explain (`diagnosis/3.7`, unknown remainder).

use super::weigh::Weighing;

/// A remainder without a name, at its posterior mean.
#[derive(Debug, Clone, PartialEq)]
pub struct RemainderShape {
    /// What it is free over: `common` to all runs, `per_run`, `around` the part, over `test_order`, or the
    /// levels of a grouping.
    pub kind: &'static str,
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
}

/// Of the heaviest set that has a remainder beside it; `None` where none was weighed.
pub fn remainder_shape(weighing: &Weighing<'_>) -> Option<RemainderShape> {
    let set = weighing.sets.iter().find(|set| set.remainder.is_some())?;
    let remainder = set.remainder.as_ref()?;
    let kind = &weighing.kinds[remainder.kind];
    let rows = weighing.keep.len();
    let mut value = vec![0.0; rows];
    for (column, amplitude) in kind.columns.iter().zip(&remainder.amplitudes) {
        value.iter_mut().zip(column).for_each(|(v, c)| *v += amplitude * c);
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
    Some(RemainderShape { kind: kind.name, value, deviation, spectrum, rms, extreme_row, explained })
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
