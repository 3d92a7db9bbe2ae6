//! What is asked where the truth is known: how well causes could be told apart at all, and what a fitted
//! model is worth on rows that were measured later.

use super::base::Bound;
use super::calculator::{JobOf, with_measured};
use super::foundation::Foundation;
use super::identify::from_others;
use super::weigh::{Effort, Weighing};
use crate::calculator::{Diagnosable, Failure, Unwatched};

/// How far changes of all rows, each of a cause of its kind, stand from what every other single cause of the catalogue could
/// make of them under a job's scatter and allowances, sigmas (`diagnosis/3.6`). In the order of `changes`; a kind that the
/// catalogue lacks stands against all of it.
pub fn separations_of<M: Diagnosable>(job: &JobOf<M>, changes: &[(&str, &[f64])]) -> Result<Vec<f64>, Failure> {
    with_base_weighed::<M, _>(job, |_, weighing| {
        Ok(changes.iter().map(|(kind, change)| from_others(weighing, change, kind)).collect())
    })
}

/// How far a change of all rows stands from what effects change that were fitted to them, sigmas, less what scatter makes of
/// so many fitted values: its square is theirs in number on average.
pub fn separation_from<M: Diagnosable>(
    job: &JobOf<M>,
    change: &[f64],
    effects: &[M::Effect],
    fitted: usize,
) -> Result<f64, Failure> {
    with_base_weighed::<M, _>(job, |bound, weighing| {
        let with = bound.with_effects(effects)?;
        let rows = change.iter().zip(with).zip(&weighing.foundation.base);
        let gap: Vec<f64> =
            rows.map(|((change, with), base)| with.map_or(0.0, |with| change - (with - base))).collect();
        let gap = weighing.whitener.white(&gap);
        Ok((gap.inner(&gap) - fitted as f64).max(0.0).sqrt())
    })
}

/// Scatter, allowances and signatures of a job's rows, without a search.
fn with_base_weighed<M: Diagnosable, T>(
    job: &JobOf<M>,
    then: impl FnOnce(&Bound<M>, &Weighing<'_>) -> Result<T, Failure>,
) -> Result<T, Failure> {
    with_measured::<M, _>(job, &Unwatched, |_, bound, data| {
        let foundation = Foundation::of(bound, data, &Unwatched)?;
        let weighing = Weighing::of(&foundation, foundation.predicted.clone(), Effort::full(0), &Unwatched)?;
        then(bound, &weighing)
    })
}

/// Measured less predicted in every row, the base extended by these effects, in the unit in which residuals are taken; 0
/// where nothing is predicted.
pub fn residuals_with<M: Diagnosable>(job: &JobOf<M>, effects: &[M::Effect]) -> Result<Vec<f64>, Failure> {
    with_measured::<M, _>(job, &Unwatched, |_, bound, data| {
        let predicted = bound.with_effects(effects)?;
        Ok(data.value.iter().zip(predicted).map(|(y, f)| f.map_or(0.0, |f| y - f)).collect())
    })
}
