//! Why data are not judged, or not as far as was asked (`diagnosis/8`).

use crate::calculator::{Diagnosable, Quantity};
use crate::diagnosis::answer::blunder::{BlunderReport, SUSPECTED};
use crate::diagnosis::answer::output::Refusal;
use crate::diagnosis::calculator::JobOf;
use crate::diagnosis::rows::suspect::{SuspectedFactor, suspected_factor, suspected_offset};
use crate::diagnosis::verdict::foundation::Foundation;
use crate::diagnosis::verdict::weigh::Weighing;

/// Share of rows that the base must predict.
const LEAST_PREDICTED: f64 = 0.8;
/// Rows from which on a cause can be named; fewer allow the tests alone.
const LEAST_TO_NAME: usize = 12;
/// Half of the deviations beyond this are no deviations of a machined part but its diameter, um.
const NO_DEVIATION_UM: f64 = 1000.0;

/// So many rows as three times the causes and two.
pub(in crate::diagnosis) fn rows_for(causes: usize) -> usize {
    3 * (causes + 2)
}

/// Most causes at the same time that so many rows can carry.
pub(in crate::diagnosis) fn most_causes(asked_for: usize, rows: usize) -> usize {
    (0..=asked_for).rev().find(|&causes| rows_for(causes) <= rows).unwrap_or(0)
}

/// The first reason not to judge the rows.
pub(in crate::diagnosis) fn refusal<M: Diagnosable>(
    job: &JobOf<M>,
    foundation: &Foundation<'_>,
    weighing: &Weighing<'_>,
) -> Option<Refusal> {
    let plain =
        |reason: &str| Refusal { reason: reason.to_owned(), factor: None, fitted_factor: None, rows_needed: None };
    let quantity = M::QUANTITIES.iter().find(|known| known.name == job.quantity)?;
    let count = foundation.predicted.len() as f64;
    let predicted = foundation.predicted.iter().filter(|ok| **ok).count() as f64;
    if predicted < LEAST_PREDICTED * count {
        return Some(plain("base_fails"));
    }
    if foundation.data.sides.is_some() {
        return too_few(kept(weighing).count());
    }
    let values: Vec<f64> = kept(weighing).map(|row| foundation.data.value[row]).collect();
    if values.windows(2).all(|pair| pair[0].to_bits() == pair[1].to_bits()) {
        return Some(plain("constant_values"));
    }
    if !job.options.accept_suspected_unit {
        if is_absolute(quantity, &values) {
            return Some(plain("absolute_values"));
        }
        if let Some(SuspectedFactor { factor, fitted, .. }) = suspected(quantity, foundation, weighing) {
            let (factor, fitted_factor) = (Some(factor), Some(fitted));
            return Some(Refusal { factor, fitted_factor, ..plain("unit_suspected") });
        }
    }
    too_few(values.len())
}

/// Where the rows look like blunders rather than like anything that acts.
pub(in crate::diagnosis) fn of_blunders(blunders: &[BlunderReport]) -> Option<Refusal> {
    let together: f64 = blunders.iter().map(|blunder| blunder.probability).sum();
    (together >= SUSPECTED).then(|| Refusal {
        reason: "blunder_suspected".to_owned(),
        factor: None,
        fitted_factor: None,
        rows_needed: None,
    })
}

fn too_few(rows: usize) -> Option<Refusal> {
    (rows < LEAST_TO_NAME).then(|| Refusal {
        reason: "too_few_rows".to_owned(),
        factor: None,
        fitted_factor: None,
        rows_needed: u32::try_from(LEAST_TO_NAME).ok(),
    })
}

fn kept<'a>(weighing: &'a Weighing<'_>) -> impl Iterator<Item = usize> + 'a {
    (0..weighing.keep.len()).filter(|&row| weighing.keep[row])
}

/// Whether diameters stand where deviations belong.
fn is_absolute(quantity: &Quantity, values: &[f64]) -> bool {
    let mut sizes: Vec<f64> = values.iter().map(|value| value.abs()).collect();
    sizes.sort_by(f64::total_cmp);
    let median = sizes.get(sizes.len() / 2).copied().unwrap_or(0.0);
    quantity.name.contains("deviation") && quantity.unit == "um" && median > NO_DEVIATION_UM
}

fn suspected(quantity: &Quantity, foundation: &Foundation<'_>, weighing: &Weighing<'_>) -> Option<SuspectedFactor> {
    let (values, base, keep) = (&foundation.data.value, &foundation.base, &weighing.keep);
    if quantity.logarithmic {
        return suspected_offset(quantity, values, base, keep)
            .filter(|suspected| !explained_better(foundation, weighing, suspected));
    }
    suspected_factor(values, base, keep).filter(|suspected| !explained_better(foundation, weighing, suspected))
}

/// Whether causes leave a fifth less than what the factor leaves: then the rows are in the right unit. A wrong unit that
/// causes imitate leaves as little with the factor as with them.
fn explained_better(foundation: &Foundation<'_>, weighing: &Weighing<'_>, suspected: &SuspectedFactor) -> bool {
    let Some(set) = weighing.named_sets().next() else { return false };
    let Ok(with) = foundation.subject.predict(&set.settings) else { return false };
    let kept: Vec<usize> = (0..with.len()).filter(|&row| weighing.keep[row]).collect();
    let value = |row: usize| foundation.data.value[row];
    let mean = kept.iter().map(|&row| value(row)).sum::<f64>() / kept.len().max(1) as f64;
    let whole: f64 = kept.iter().map(|&row| (value(row) - mean).powi(2)).sum();
    let left: f64 = kept.iter().map(|&row| with[row].map_or(f64::INFINITY, |f| (value(row) - f).powi(2))).sum();
    left < 0.8 * (1.0 - suspected.explained) * whole
}
