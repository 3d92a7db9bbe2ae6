//! What the extended model gains on rows that were held back (`diagnosis/3.8`).

use crate::calculator::{Failure, Monitor, checkpoint};
use crate::diagnosis::causes::ranking::SetWeight;
use crate::diagnosis::model::outlying::{HeldRun, OutlyingRun, outlying};
use crate::diagnosis::model::term::Term;
use crate::diagnosis::rows::noise::between_sweeps;
use crate::diagnosis::statistics::evidence::quantile;
use crate::diagnosis::verdict::effort::Effort;
use crate::diagnosis::verdict::foundation::Foundation;
use crate::diagnosis::verdict::judge::Verdict;
use crate::diagnosis::verdict::weigh::Weighing;

/// Logarithm of the largest ratio of errors that an interval tells: beyond, nothing is known.
const MOST_LOG_RATIO: f64 = 10.0;
/// What comes on other parts varies so many times as much as the jackknife says of these; see [`interval`].
const TIMES_JACKKNIFE: f64 = 3.0;
/// Leading sets over which a prediction is averaged where none holds enough.
const AVERAGED: usize = 6;
/// Leading sets that have an error of their own; fewer where every prediction is a simulation.
const SCORED: usize = 6;
const SCORED_DEAR: usize = 2;
/// Posterior from which on one set predicts alone.
const ALONE: f64 = 0.8;
/// The base is at the ceiling within this share: then there is nothing to explain.
const AT_CEILING: f64 = 0.05;

/// Errors on held-back rows.
#[derive(Debug, Clone, PartialEq)]
pub struct Gain {
    /// Root mean square error of the base.
    pub rmse_base: f64,
    /// Of the extended model.
    pub rmse_extended: f64,
    /// 1 - extended/base.
    pub gain: f64,
    /// 95 % interval of the gain on as many folds measured anew.
    pub interval: (f64, f64),
    /// Root mean square error that scatter and allowances leave to any model.
    pub ceiling: f64,
    /// Share of what could be explained that was; `None` where the base is at the ceiling already.
    pub explained_share: Option<f64>,
    /// Folds that were held back.
    pub folds: usize,
    /// Errors by row, of the base and of the extended model; 0 where no fold held the row.
    pub errors: Vec<(f64, f64)>,
    /// Root mean square errors of the leading sets, fitted anew in every fold and not chosen anew; of those that every
    /// fold had found.
    pub of_sets: Vec<(Vec<usize>, f64)>,
    /// Runs that the others do not lead one to expect.
    pub outlying: Vec<OutlyingRun>,
}

/// Held-back error with causes chosen anew in every fold (`nested`), or with those of the whole data.
///
/// Sets are judged and fitted without the fold; its own set-up, force level and gauge position are not
/// known to the prediction.
pub fn gain(
    foundation: &Foundation<'_>,
    whole: &Weighing<'_>,
    effort: Effort,
    nested: bool,
    monitor: &dyn Monitor,
) -> Result<Option<Gain>, Failure> {
    let fold = &foundation.data.layout.design.fold;
    let folds = fold.iter().copied().max().map_or(0, |most| most + 1);
    let held: Vec<usize> =
        (0..folds).filter(|f| fold.iter().zip(&whole.keep).any(|(of, keep)| of == f && *keep)).collect();
    if held.len() < 2 {
        return Ok(None);
    }
    let mut errors = vec![(0.0, 0.0); fold.len()];
    let most = if effort.nonlinear { SCORED_DEAR } else { SCORED };
    let mut runs = Vec::new();
    // Of classes a square means nothing.
    let values = foundation.data.sides.is_none();
    let most = if values { most } else { 0 };
    let mut scores: Vec<Score> = whole.named_sets().take(most).map(|set| Score::of(&set.members)).collect();
    for &f in &held {
        checkpoint(monitor)?;
        let keep: Vec<bool> = whole.keep.iter().zip(fold).map(|(keep, of)| *keep && *of != f).collect();
        let predicted = if matches!(whole.verdict, Verdict::Adequate) && !nested {
            foundation.base.clone()
        } else {
            let without = Weighing::of(foundation, keep, effort, monitor)?;
            for score in &mut scores {
                score.add(&without, |row| fold[row] == f && whole.keep[row])?;
            }
            let predicted = prediction(foundation, &without, (!nested).then_some(whole))?;
            let own = || HeldRun::of(&without, &predicted, |row| fold[row] == f && whole.keep[row]);
            runs.extend(if values { own() } else { None });
            predicted
        };
        for row in 0..fold.len() {
            if fold[row] == f && whole.keep[row] {
                let y = foundation.data.value[row];
                errors[row] = (y - foundation.base[row], y - predicted[row]);
            }
        }
    }
    let of_sets = scores.into_iter().filter_map(Score::rmse).collect();
    Ok(Some(Gain { of_sets, outlying: outlying(runs, held.len()), ..summary(errors, whole, &held) }))
}

/// Squared errors of one set on what was held back.
struct Score {
    members: Vec<usize>,
    /// Their sum and number; `None` once a fold had not found the set, or predicts nothing with it.
    sum: Option<(f64, f64)>,
}

impl Score {
    fn of(members: &[usize]) -> Self {
        Self { members: members.to_vec(), sum: Some((0.0, 0.0)) }
    }

    fn add(&mut self, without: &Weighing<'_>, held: impl Fn(usize) -> bool) -> Result<(), Failure> {
        let Some((sum, count)) = self.sum.take() else { return Ok(()) };
        let Some(set) = without.named_sets().find(|set| set.members == self.members) else { return Ok(()) };
        let foundation = without.foundation;
        let predicted = foundation.subject.predict(&set.settings)?;
        let errors = (0..predicted.len()).filter(|&row| held(row)).map(|row| {
            let error = foundation.data.value[row] - predicted[row].ok()?;
            Some(error * error)
        });
        self.sum = errors.sum::<Option<f64>>().map(|own| {
            let rows = (0..predicted.len()).filter(|&row| held(row)).count();
            (sum + own, count + rows as f64)
        });
        Ok(())
    }

    fn rmse(self) -> Option<(Vec<usize>, f64)> {
        let (sum, count) = self.sum.filter(|(_, count)| *count > 0.0)?;
        Some((self.members, (sum / count).sqrt()))
    }
}

/// Prediction of what leads without the fold: the base where nothing is wrong, with what has no name where that is a term, the
/// leader where it holds enough, else the mean over the leading sets.
fn prediction(
    foundation: &Foundation<'_>,
    without: &Weighing<'_>,
    chosen: Option<&Weighing<'_>>,
) -> Result<Vec<f64>, Failure> {
    if let (None, Some(term)) = (chosen, Term::of(without)) {
        return term.prediction();
    }
    let leading: Vec<&SetWeight> = match chosen.map(|whole| &whole.verdict) {
        Some(Verdict::Named(members) | Verdict::Unknown(members)) => {
            without.sets.iter().filter(|set| set.remainder.is_none() && set.members == *members).collect()
        }
        Some(_) => without.named_sets().take(AVERAGED).collect(),
        None if matches!(without.verdict, Verdict::Adequate) => Vec::new(),
        None => predicting(without).into_iter().map(|(_, set)| set).collect(),
    };
    let total: f64 = leading.iter().map(|set| set.posterior).sum();
    if leading.is_empty() || total <= 0.0 {
        return Ok(foundation.base.clone());
    }
    let mut mean = vec![0.0; foundation.base.len()];
    for set in leading {
        let with = foundation.subject.predict(&set.settings)?;
        let share = set.posterior / total;
        for (row, value) in with.iter().enumerate() {
            mean[row] += share * value.unwrap_or(foundation.base[row]);
        }
    }
    Ok(mean)
}

/// The sets that predict together, likeliest first, with their shares: the leader alone where it holds enough.
pub(in crate::diagnosis) fn predicting<'a>(weighing: &'a Weighing<'_>) -> Vec<(f64, &'a SetWeight)> {
    let alone = weighing.named_sets().next().is_some_and(|leader| leader.posterior >= ALONE);
    let sets: Vec<&SetWeight> = weighing.named_sets().take(if alone { 1 } else { AVERAGED }).collect();
    let total: f64 = sets.iter().map(|set| set.posterior).sum();
    sets.into_iter().filter(|_| total > 0.0).map(|set| (set.posterior / total, set)).collect()
}

fn summary(errors: Vec<(f64, f64)>, whole: &Weighing<'_>, held: &[usize]) -> Gain {
    let fold = &whole.foundation.data.layout.design.fold;
    let kept = |row: usize| whole.keep[row];
    // Sums of squares and counts by fold.
    let sums: Vec<(f64, f64, f64)> = held
        .iter()
        .map(|f| {
            let rows = (0..errors.len()).filter(|&row| fold[row] == *f && kept(row));
            rows.fold((0.0, 0.0, 0.0), |(base, extended, count), row| {
                let (b, e) = errors[row];
                (base + b * b, extended + e * e, count + 1.0)
            })
        })
        .collect();
    let all = sums.iter().fold((0.0, 0.0, 0.0), |sum, own| (sum.0 + own.0, sum.1 + own.1, sum.2 + own.2));
    let (rmse_base, rmse_extended) = ((all.0 / all.2).sqrt(), (all.1 / all.2).sqrt());
    let ceiling = ceiling(whole);
    let explainable = rmse_base * rmse_base - ceiling * ceiling;
    let explained_share = (rmse_base > (1.0 + AT_CEILING) * ceiling)
        .then(|| ((rmse_base * rmse_base - rmse_extended * rmse_extended) / explainable).clamp(0.0, 1.0));
    Gain {
        rmse_base,
        rmse_extended,
        gain: if all.0 > 0.0 { 1.0 - (all.1 / all.0).sqrt() } else { 0.0 },
        interval: interval(&sums),
        ceiling,
        explained_share,
        folds: held.len(),
        errors,
        of_sets: Vec::new(),
        outlying: Vec::new(),
    }
}

/// 95 % interval of the gain on as many parts that are measured anew.
///
/// L = 1/2 ln(sum of e_i/sum of b_i) over the parts, e_i and b_i the squared errors of the extended model and of the base in
/// part i. Its variance v is that of the jackknife: with L_i the same without part i,
/// v = (n - 1)/n sum of (L_i - mean)^2. What n other parts will give scatters as much once more, and as much again because
/// they are cut under other conditions, in other parts of what the model explains: with 3 v 155 of 166 intervals held what
/// came, with 2 v 148, with v 131; the half-width is that of Student's t with n - 1 degrees of freedom.
fn interval(sums: &[(f64, f64, f64)]) -> (f64, f64) {
    let log_ratio = |left_out: Option<usize>| {
        let others = sums.iter().enumerate().filter(|(index, _)| Some(*index) != left_out);
        let (base, extended) = others.fold((0.0, 0.0), |(b, e), (_, own)| (b + own.0, e + own.1));
        0.5 * (f64::max(extended, f64::MIN_POSITIVE) / f64::max(base, f64::MIN_POSITIVE)).ln()
    };
    let count = sums.len() as f64;
    let without: Vec<f64> = (0..sums.len()).map(|index| log_ratio(Some(index))).collect();
    let mean = without.iter().sum::<f64>() / count;
    let variance = (count - 1.0) / count * without.iter().map(|own| (own - mean).powi(2)).sum::<f64>();
    let reach = quantile(0.95, count - 1.0) * (TIMES_JACKKNIFE * variance).sqrt();
    let gain = |log_ratio: f64| 1.0 - log_ratio.min(MOST_LOG_RATIO).exp();
    (gain(log_ratio(None) + reach), gain(log_ratio(None) - reach))
}

/// Root mean square of sqrt(diag C): scatter and allowances. Scatter between sweeps, where there are several, is all that no
/// model can foresee: what they share is structure, however fine.
fn ceiling(whole: &Weighing<'_>) -> f64 {
    let foundation = whole.foundation;
    let between = between_sweeps(foundation.data, &foundation.residual, &whole.keep);
    let finer = between.filter(|_| whole.noise.per_row.is_none()).map_or(0.0, |(sigma, _)| {
        let own = whole.noise.sigma;
        (own * own - sigma * sigma).max(0.0)
    });
    let (mut sum, mut count) = (0.0, 0.0);
    for row in (0..whole.keep.len()).filter(|&row| whole.keep[row]) {
        sum += whole.own_variance(row) - finer;
        count += 1.0;
    }
    if count > 0.0 { (sum / count).sqrt() } else { 0.0 }
}
