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
    /// Its root mean square over the rows that count.
    pub rms: f64,
    /// Row where it is largest in magnitude.
    pub extreme_row: usize,
    /// Share of the mean square of the residuals, those of the named part taken out, that it explains.
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
    let named = weighing.foundation.subject.predict(&set.settings).ok()?;
    let left = |row: usize| weighing.foundation.data.value[row] - named[row].unwrap_or(weighing.foundation.base[row]);
    let kept: Vec<usize> = (0..rows).filter(|&row| weighing.keep[row]).collect();
    let mean = |of: &dyn Fn(usize) -> f64| kept.iter().map(|&row| of(row)).sum::<f64>() / kept.len().max(1) as f64;
    let rms = mean(&|row| value[row] * value[row]).sqrt();
    let before = mean(&|row| left(row) * left(row));
    let after = mean(&|row| (left(row) - value[row]).powi(2));
    let extreme_row = kept.iter().copied().max_by(|&a, &b| value[a].abs().total_cmp(&value[b].abs()))?;
    let explained = if before > 0.0 { (1.0 - after / before).clamp(0.0, 1.0) } else { 0.0 };
    Some(RemainderShape { kind: kind.name, value, rms, extreme_row, explained })
}
