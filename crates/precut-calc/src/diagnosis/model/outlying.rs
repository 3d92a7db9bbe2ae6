//! Whole runs that the others do not lead one to expect (`diagnosis/3.10`).

use nalgebra::{Cholesky, DMatrix};
use statrs::distribution::{ChiSquared, ContinuousCDF};

use crate::diagnosis::model::term::Term;
use crate::diagnosis::rows::sparse::Sparse;
use crate::diagnosis::statistics::whiten::Whitener;
use crate::diagnosis::verdict::judge::Verdict;
use crate::diagnosis::verdict::weigh::Weighing;

/// Runs that it takes to tell which one is odd.
const LEAST_RUNS: usize = 4;
/// A run is odd when chance leaves so much in fewer than one in so many sets of runs ...
const LEVEL: f64 = 0.01;
/// ... and when it leaves so many times more, per row, than the other runs leave of the model that is fitted to them: one
/// that is wrong everywhere leaves much in every run.
const TIMES_TYPICAL: f64 = 4.0;
/// At most this share of the runs is called odd: of more, none.
const AT_MOST: f64 = 0.25;

/// A run that the others do not lead one to expect.
#[derive(Debug, Clone, PartialEq)]
pub struct OutlyingRun {
    /// Index of the run.
    pub run: usize,
    /// Squared Mahalanobis distance from what the others predict, per row: about 1 where nothing is odd.
    pub misfit_per_row: f64,
    /// What the rows say without it.
    pub without: Verdict,
}

/// A run that was held back, and how far it lies from its prediction.
pub(in crate::diagnosis) struct HeldRun {
    run: usize,
    rows: f64,
    distance: f64,
    /// What the other runs leave of the same model, per row.
    typical: f64,
    without: Verdict,
}

impl HeldRun {
    /// Of rows that are one whole run; `None` where they are parts of several, or where other rows of the run count.
    pub(in crate::diagnosis) fn of(
        without: &Weighing<'_>,
        predicted: &[f64],
        held: impl Fn(usize) -> bool,
    ) -> Option<Self> {
        let foundation = without.foundation;
        let layout = &foundation.data.layout;
        let keep: Vec<bool> = (0..predicted.len()).map(&held).collect();
        let sweeps = layout.kept_traces(&keep);
        let run = sweeps.first().map(|(run, _)| *run)?;
        let elsewhere = layout.kept_traces(&without.keep).iter().any(|(of, _)| *of == run);
        if elsewhere || sweeps.iter().any(|(of, _)| *of != run) {
            return None;
        }
        // What the fit without the run leaves open widens the prediction like an allowance.
        let mut allowed = foundation.nuisances.clone();
        let term = Term::of(without);
        let fit = match without.verdict {
            Verdict::Adequate => None,
            _ => without.named_sets().next().and_then(|set| without.fit(&set.members)),
        };
        if let Some(term) = term {
            let kept = |column: Vec<f64>| {
                Sparse::new(
                    predicted.len(),
                    (0..predicted.len()).filter(|&row| keep[row]).map(|row| (row, column[row])),
                )
            };
            allowed.extend(term.on_rows().into_iter().map(kept));
        } else if let Some(fit) = fit {
            // Of values at their bounds the covariance may be singular: then each is taken by itself.
            let alone = || DMatrix::from_diagonal(&fit.covariance.diagonal().map(|v| v.max(0.0).sqrt()));
            let lower = Cholesky::new(fit.covariance.clone()).map_or_else(alone, Cholesky::unpack);
            allowed.extend((0..fit.free.len()).map(|k| {
                let of_row = |row: usize| (k..fit.free.len()).map(|i| fit.slopes[i][row] * lower[(i, k)]).sum();
                Sparse::new(
                    predicted.len(),
                    (0..predicted.len()).filter(|&row| keep[row]).map(|row| (row, of_row(row))),
                )
            }));
        }
        let whitener = Whitener::new(foundation.data, &without.noise, &allowed, &keep);
        let error: Vec<f64> = foundation.data.value.iter().zip(predicted).map(|(y, f)| y - f).collect();
        let (white, others) = (whitener.white(&error), without.whitener.white(&error));
        Some(Self {
            run,
            rows: whitener.rows(),
            distance: white.inner(&white).max(0.0),
            typical: (others.inner(&others) / without.whitener.rows()).max(1.0),
            without: without.verdict.clone(),
        })
    }

    fn per_row(&self) -> f64 {
        self.distance / self.rows
    }

    /// Probability of a larger distance by chance.
    fn chance(&self) -> f64 {
        ChiSquared::new(self.rows).map_or(1.0, |law| law.sf(self.distance))
    }
}

/// Those that are odd, of all runs held back, `folds` in number.
pub(in crate::diagnosis) fn outlying(runs: Vec<HeldRun>, folds: usize) -> Vec<OutlyingRun> {
    if runs.len() < LEAST_RUNS || runs.len() < folds {
        return Vec::new();
    }
    let count = runs.len() as f64;
    let odd: Vec<OutlyingRun> = runs
        .into_iter()
        .filter(|run| run.chance() < LEVEL / count && run.per_row() > TIMES_TYPICAL * run.typical)
        .map(|run| OutlyingRun { run: run.run, misfit_per_row: run.per_row(), without: run.without })
        .collect();
    if odd.len() as f64 > AT_MOST * count { Vec::new() } else { odd }
}
