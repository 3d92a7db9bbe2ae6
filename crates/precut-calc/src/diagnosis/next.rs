//! The next measurement worth making (`diagnosis/3.6`).

use std::collections::BTreeMap;

use super::base::Bound;
use super::calculator::{JobOf, base_of};
use super::data::{Data, Layout};
use super::identify::Signature;
use super::input::DiagnosisOptions;
use super::sparse::Sparse;
use super::subject::{Setting, Subject};
use super::weigh::{SetWeight, Verdict, Weighing};
use super::whiten::Whitener;
use crate::calculator::{Diagnosable, Failure, Monitor, NextRun, Ranges, Rows, checkpoint};

/// Odds that settle a question.
const SETTLING_ODDS: f64 = 20.0;

/// A run worth measuring.
#[derive(Debug, Clone, PartialEq)]
pub struct NextMeasurement<R> {
    /// The condition that it changes.
    pub changes: &'static str,
    /// Its conditions.
    pub run: R,
    /// Rows that it would bring.
    pub rows: usize,
    /// Where they would be measured: columns by the fields of a row.
    pub places: BTreeMap<String, Vec<Option<f64>>>,
    /// Separation of the leader from its strongest rival with the rows there are, sigmas.
    pub separation_now: f64,
    /// The same with this run measured too.
    pub separation_then: f64,
    /// Bayes factor to be expected from this run alone.
    pub bayes_factor: f64,
    /// Rows of this kind that would bring odds of 20 to 1; `None` where no number would.
    pub rows_needed: Option<usize>,
    /// Hypotheses of the leader.
    pub leader: Vec<usize>,
    /// Hypotheses of its strongest rival; none for the base.
    pub rival: Vec<usize>,
    /// Every run that was looked at: the condition that it changes, its conditions, and the separation with it measured
    /// too, sigmas.
    pub candidates: Vec<(&'static str, R, f64)>,
}

/// The run that parts the leader from its strongest rival best; `None` where there is no rival or no run.
pub(super) fn next_measurement<M: Diagnosable>(
    job: &JobOf<M>,
    rows: &Rows<M::Run, M::Point>,
    weighing: &Weighing<'_>,
    monitor: &dyn Monitor,
) -> Result<Option<NextMeasurement<M::Run>>, Failure> {
    let Some((leader, rival)) = contenders(weighing) else { return Ok(None) };
    let mut best: Option<NextMeasurement<M::Run>> = None;
    let now = Signature::of(weighing, &leader.members, &leader.settings)?;
    let other = match rival {
        Some(rival) => Signature::of(weighing, &rival.members, &rival.settings)?,
        None => Signature::nothing(&now),
    };
    let separation_now = now.separation(&other);
    let mut candidates = Vec::new();
    for candidate in M::next_runs(&job.job, rows, Ranges(&job.options.ranges)) {
        checkpoint(monitor)?;
        let then = separation_with::<M>(job, rows, &candidate, weighing, [Some(leader), rival], monitor)?;
        // What was cancelled is no run beyond the model.
        checkpoint(monitor)?;
        let Some(separation_then) = then else { continue };
        let gained = separation_then * separation_then - separation_now * separation_now;
        candidates.push((candidate.changes, candidate.run.clone(), separation_then));
        if best.as_ref().is_none_or(|best| separation_then > best.separation_then) {
            best = Some(NextMeasurement {
                changes: candidate.changes,
                rows: candidate.points.len(),
                places: columns::<M>(&candidate.points),
                run: candidate.run,
                separation_now,
                separation_then,
                bayes_factor: bayes_factor(separation_now, separation_then),
                rows_needed: rows_needed(gained, candidate.points.len()),
                leader: leader.members.clone(),
                rival: rival.map_or_else(Vec::new, |rival| rival.members.clone()),
                candidates: Vec::new(),
            });
        }
    }
    Ok(best.map(|best| NextMeasurement { candidates, ..best }))
}

/// Places as columns: the numbers of each by the names of their fields.
fn columns<M: Diagnosable>(points: &[M::Point]) -> BTreeMap<String, Vec<Option<f64>>> {
    let places: Vec<_> = points.iter().map(M::place).filter(|place| !place.is_empty()).collect();
    let mut columns: BTreeMap<String, Vec<Option<f64>>> = BTreeMap::new();
    for (row, place) in places.iter().enumerate() {
        for &(field, value) in place {
            columns.entry(field.to_owned()).or_insert_with(|| vec![None; places.len()])[row] = value;
        }
    }
    columns.retain(|_, values| values.iter().any(Option::is_some));
    columns
}

/// To be expected from what a run adds to the separation; no larger than a number can say.
pub(super) fn bayes_factor(now: f64, then: f64) -> f64 {
    (0.5 * (then * then - now * now).max(0.0)).min(600.0).exp()
}

/// Rows in proportion to what a whole run gains: odds grow as exp(d^2/2), d^2 with the number of rows.
fn rows_needed(gained: f64, rows: usize) -> Option<usize> {
    let wanted = 2.0 * SETTLING_ODDS.ln();
    // Less than a thousandth of what is needed from a whole run will not be had by more of the same.
    (gained > 1e-3 * wanted).then(|| {
        let count = (wanted / gained * rows as f64).ceil();
        // At most a thousand runs, by the bound above.
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        let count = count as usize;
        count.max(1)
    })
}

/// The leading set, and the heaviest set that is no superset of it; the base is a rival while it may be right.
fn contenders<'a>(weighing: &'a Weighing<'_>) -> Option<(&'a SetWeight, Option<&'a SetWeight>)> {
    let leader = weighing.named_sets().next()?;
    if matches!(weighing.verdict, Verdict::Adequate) {
        return Some((leader, None));
    }
    let rival = weighing.named_sets().skip(1).find(|set| !leader.members.iter().all(|h| set.members.contains(h)))?;
    Some((leader, Some(rival)))
}

fn separation_with<M: Diagnosable>(
    job: &JobOf<M>,
    rows: &Rows<M::Run, M::Point>,
    candidate: &NextRun<M::Run, M::Point>,
    weighing: &Weighing<'_>,
    sets: [Option<&SetWeight>; 2],
    monitor: &dyn Monitor,
) -> Result<Option<f64>, Failure> {
    let mut all = rows.clone();
    let run = all.runs.len();
    all.runs.push(candidate.run.clone());
    all.points.extend(candidate.points.iter().map(|point| (run, point.clone())));
    // A candidate beyond what the model covers is no candidate.
    let (base, known) = base_of::<M>(job);
    let Ok(prepared) = M::prepare(&base, &all, &job.quantity, monitor) else { return Ok(None) };
    let old = weighing.foundation.data;
    let first = old.value.len();
    let layout = Layout {
        traces: old.layout.traces.iter().cloned().chain([(first..all.points.len()).collect()]).collect(),
        run_of_trace: old.layout.run_of_trace.iter().copied().chain([run]).collect(),
        design: M::design(&prepared),
    };
    let mut noise = weighing.noise.clone();
    if let Some(per_row) = &mut noise.per_row {
        per_row.resize(all.points.len(), noise.sigma);
    }
    let classes = old.sides.is_some();
    let data = Data { value: vec![0.0; all.points.len()], uncertainty: None, sides: None, layout };
    // Every cause: the sets are found in it by kind.
    let every = DiagnosisOptions::default();
    let bound = Bound::<M>::new(prepared, known, job.allowances.clone(), &job.quantity, &every, monitor)?;
    let translated = |set: &SetWeight| -> Option<Vec<Setting>> {
        set.settings
            .iter()
            .map(|setting| {
                let of = &weighing.foundation.subject.hypotheses()[setting.hypothesis];
                let hypothesis = bound.hypotheses().iter().position(|h| h.cause == of.cause && h.label == of.label)?;
                Some(Setting { hypothesis, values: setting.values.clone() })
            })
            .collect()
    };
    let [Some(of_leader), Some(of_rival)] = sets.map(|set| set.map_or(Some(Vec::new()), translated)) else {
        return Ok(None);
    };
    let mut keep = weighing.keep.clone();
    keep.resize(all.points.len(), true);
    // Nor one that the model cannot run.
    let Ok(nuisances) = bound.nuisances() else { return Ok(None) };
    let nuisances: Vec<Sparse> = nuisances.iter().map(|column| Sparse::of(column)).collect();
    if classes {
        // About the leader, as it is taken to be right.
        let with = bound.predict(&of_leader)?;
        // What has no margin tells nothing.
        noise = noise.informed(&with.iter().map(|margin| margin.unwrap_or(f64::MAX)).collect::<Vec<_>>());
    }
    let whitener = Whitener::new(&data, &noise, &nuisances, &keep);
    let a = Signature::anew(&bound, &whitener, &keep, &of_leader)?;
    let b = Signature::anew(&bound, &whitener, &keep, &of_rival)?;
    Ok(Some(a.separation(&b)))
}
