//! What is asked where the truth is known: how well causes could be told apart at all, and what a fitted
//! model is worth on rows that were measured later.

use crate::calculator::{Diagnosable, Failure, Hypothesis, Unwatched};
use crate::diagnosis::answer::output::NamedCause;
use crate::diagnosis::base::Bound;
use crate::diagnosis::calculator::{JobOf, with_measured};
use crate::diagnosis::causes::subject::{Setting, Subject};
use crate::diagnosis::statistics::whiten::White;
use crate::diagnosis::verdict::effort::Effort;
use crate::diagnosis::verdict::foundation::Foundation;
use crate::diagnosis::verdict::identify::{distance, from_others};
use crate::diagnosis::verdict::weigh::Weighing;

/// Logarithm of the largest evidence that the search finds under a job, up to a constant of its rows: comparable between
/// jobs that differ only in the causes that they ask for.
pub fn best_evidence<M: Diagnosable>(job: &JobOf<M>) -> Result<f64, Failure> {
    with_measured::<M, _>(job, &Unwatched, |_, bound, data| {
        let foundation = Foundation::of(bound, data, &Unwatched)?;
        let most_causes = usize::from(job.options.most_causes);
        let effort = bound.effort(most_causes);
        let weighing = Weighing::of(&foundation, foundation.predicted.clone(), effort, &Unwatched)?;
        Ok(weighing.best_evidence())
    })
}

/// How far changes of all rows, each of a cause of its kind, stand from what every other single cause of the catalogue could
/// make of them under a job's scatter and allowances, sigmas (`diagnosis/3.6`). In the order of `changes`; a kind that the
/// catalogue lacks stands against all of it.
pub fn separations_of<M: Diagnosable>(job: &JobOf<M>, changes: &[(&str, &[f64])]) -> Result<Vec<f64>, Failure> {
    with_base_weighed::<M, _>(job, |_, weighing| {
        Ok(changes.iter().map(|(kind, change)| from_others(weighing, change, kind)).collect())
    })
}

/// How far a change of all rows stands from what named causes could make of it, sigmas: the least distance over all their
/// parameters, linearised where they were fitted, or over the size of the change, whichever is less (`diagnosis/3.6`).
pub fn separation_from<M: Diagnosable>(job: &JobOf<M>, change: &[f64], named: &[NamedCause]) -> Result<f64, Failure> {
    with_base_weighed::<M, _>(job, |bound, weighing| {
        let settings: Vec<Setting> = named.iter().map(|cause| setting_of(bound, cause)).collect::<Result<_, _>>()?;
        let base = &weighing.foundation.base;
        let with = bound.predict(&settings)?;
        let gap: Vec<f64> = change
            .iter()
            .zip(with.iter().zip(base))
            .map(|(change, (with, base))| with.map_or(0.0, |with| change - (with - base)))
            .collect();
        let white = |rows: &[f64]| weighing.whitener.white(rows);
        let of_named: Vec<White> =
            bound.jacobian(&settings, &fitted(bound, &settings))?.iter().map(|rows| white(rows)).collect();
        let gap = white(&gap);
        let from_named = distance(&gap, &of_named.iter().collect::<Vec<_>>());
        Ok(from_named.min(distance(&gap, &[&white(change)])))
    })
}

/// The hypothesis of a named cause with its values.
fn setting_of<M: Diagnosable>(bound: &Bound<'_, M>, cause: &NamedCause) -> Result<Setting, Failure> {
    let is_of = |hypothesis: &Hypothesis| hypothesis.cause.kind == cause.kind && hypothesis.label == cause.label;
    let hypothesis = bound.hypotheses().iter().position(is_of);
    let hypothesis = hypothesis.ok_or_else(|| Failure::Internal(format!("no hypothesis {}", cause.kind)))?;
    let counted_from = |variable: usize| bound.hypotheses()[hypothesis].counted_from(variable);
    let values = cause.parameters.iter().enumerate().map(|(k, parameter)| parameter.value - counted_from(k));
    Ok(Setting { hypothesis, values: values.collect() })
}

/// Which variables of settings are fitted: sizes, and shapes that have a prior.
fn fitted<M: Diagnosable>(bound: &Bound<'_, M>, settings: &[Setting]) -> Vec<(usize, usize)> {
    let of_setting = |(member, setting): (usize, &Setting)| {
        let hypothesis = &bound.hypotheses()[setting.hypothesis];
        let sizes = hypothesis.amplitudes().map(|(variable, _)| variable);
        let all: Vec<usize> = sizes.chain(hypothesis.fitted_shapes().map(|(variable, _)| variable)).collect();
        all.into_iter().map(move |variable| (member, variable))
    };
    settings.iter().enumerate().flat_map(of_setting).collect()
}

/// Scatter, allowances and signatures of a job's rows, without a search.
fn with_base_weighed<M: Diagnosable, T>(
    job: &JobOf<M>,
    then: impl FnOnce(&Bound<'_, M>, &Weighing<'_>) -> Result<T, Failure>,
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
