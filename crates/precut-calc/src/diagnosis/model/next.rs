//! The next measurement worth making (`diagnosis/3.6`).

use std::collections::BTreeMap;

use crate::calculator::{Diagnosable, Failure, ForwardModel, Monitor, NextRun, Ranges, Rows, checkpoint};
use crate::diagnosis::base::Bound;
use crate::diagnosis::calculator::{JobOf, base_of};
use crate::diagnosis::causes::ranking::SetWeight;
use crate::diagnosis::causes::subject::{Setting, Subject};
use crate::diagnosis::input::DiagnosisOptions;
use crate::diagnosis::model::outlook::{Outlooks, Told, likely_effects};
use crate::diagnosis::rows::data::{Data, Layout};
use crate::diagnosis::rows::sparse::Sparse;
use crate::diagnosis::statistics::whiten::Whitener;
use crate::diagnosis::verdict::identify::Signature;
use crate::diagnosis::verdict::judge::Verdict;
use crate::diagnosis::verdict::weigh::Weighing;

/// Odds that settle a question.
const SETTLING_ODDS: f64 = 20.0;
/// A run of which more than so many would be needed to settle it is no advice.
const MOST_RUNS: f64 = 20.0;

/// A further cut that is expected to tell less, nats, is not added.
const LEAST_TOLD: f64 = 1e-3;
/// Rivals that several runs are to part from the leader at most.
const MOST_RIVALS: usize = 4;

/// A run worth measuring.
#[derive(Debug, Clone, PartialEq)]
pub struct NextMeasurement<R> {
    /// The run with which the question is settled at the least cost.
    pub best: Looked<R>,
    /// Separation of the leader from its strongest rival with the rows there are, sigmas.
    pub separation_now: f64,
    /// Hypotheses of the leader.
    pub leader: Vec<usize>,
    /// Hypotheses of its strongest rival; none for the base.
    pub rival: Vec<usize>,
    /// Runs to measure with it.
    pub further: Vec<Further<R>>,
    /// Every run that was looked at.
    pub candidates: Vec<Looked<R>>,
}

/// A run that was looked at.
#[derive(Debug, Clone, PartialEq)]
pub struct Looked<R> {
    /// Its place among those that could be made.
    pub number: usize,
    /// The condition that it changes.
    pub changes: &'static str,
    /// Its conditions.
    pub run: R,
    /// Rows that it would bring.
    pub rows: usize,
    /// Where they would be measured: columns by the fields of a row.
    pub places: BTreeMap<String, Vec<Option<f64>>>,
    /// Separation of the leader from its rival with this run measured too, sigmas.
    pub separation_then: f64,
    /// Bayes factor to be expected from this run alone.
    pub bayes_factor: f64,
    /// Rows of this kind that would bring odds of 20 to 1, and what they cost; `None` where no number would.
    pub settles: Option<(usize, f64)>,
    /// Of a class: by how much the entropy over the sets that may be right is expected to fall, nats.
    pub entropy_drop_nats: Option<f64>,
}

/// A run that is measured with those before it.
#[derive(Debug, Clone, PartialEq)]
pub struct Further<R> {
    /// The run.
    pub looked: Looked<R>,
    /// Hypotheses of the rival that those before it part from the leader least.
    pub rival: Vec<usize>,
    /// Separation from that rival before it, sigmas.
    pub separation_before: f64,
}

/// The run that parts the leader from its strongest rival at the least cost, and those that are best measured with it; `None`
/// where there is no rival or no run.
pub(in crate::diagnosis) fn next_measurement<M: Diagnosable>(
    job: &JobOf<M>,
    rows: &Rows<M::Run, M::Point>,
    weighing: &Weighing<'_>,
    monitor: &dyn Monitor,
) -> Result<Option<NextMeasurement<M::Run>>, Failure> {
    let Some((leader, rival)) = contenders(weighing) else { return Ok(None) };
    let now = Signature::of(weighing, &leader.members, &leader.settings)?;
    let other = match rival {
        Some(rival) => Signature::of(weighing, &rival.members, &rival.settings)?,
        None => Signature::nothing(&now),
    };
    let separation_now = now.separation(&other);
    let planning: Planning<'_, M> = Planning { job, rows, weighing, monitor };
    let ranges = Ranges(&job.options.ranges);
    let runs = match weighing.foundation.data.sides {
        // A class tells most where one likely set foresees it and another does not: between their limits.
        Some(_) => {
            let likely = likely_effects::<M>(job, rows, weighing, [Some(leader), rival], monitor)?;
            M::next_runs_between(&job.job, rows, ranges, &likely, monitor)?
        }
        None => M::next_runs(&job.job, rows, ranges, monitor)?,
    };
    if let Some(outlooks) = Outlooks::of::<M>(job, &runs, weighing, [Some(leader), rival], monitor)? {
        let members = [leader.members.clone(), rival.map_or_else(Vec::new, |rival| rival.members.clone())];
        return Ok(planning.telling(&runs, &outlooks, members, separation_now));
    }
    let candidates = planning.looked_at(&runs, &[], [Some(leader), rival], separation_now)?;
    let Some(best) = cheapest(&candidates).cloned() else { return Ok(None) };
    let further = if best.settles.is_some() { planning.further(&runs, best.number, leader)? } else { Vec::new() };
    let rival = rival.map_or_else(Vec::new, |rival| rival.members.clone());
    Ok(Some(NextMeasurement { best, separation_now, leader: leader.members.clone(), rival, further, candidates }))
}

/// The one with which the question is settled at the least cost; where none settles it, that which parts most.
fn cheapest<R>(looked: &[Looked<R>]) -> Option<&Looked<R>> {
    let cost = |own: &Looked<R>| own.settles.map_or(f64::INFINITY, |(_, cost)| cost);
    looked.iter().min_by(|a, b| cost(a).total_cmp(&cost(b)).then(b.separation_then.total_cmp(&a.separation_then)))
}

/// What further runs are planned with.
struct Planning<'a, M: Diagnosable> {
    job: &'a JobOf<M>,
    rows: &'a Rows<M::Run, M::Point>,
    weighing: &'a Weighing<'a>,
    monitor: &'a dyn Monitor,
}

type Run<M> = NextRun<<M as ForwardModel>::Run, <M as ForwardModel>::Point>;

impl<M: Diagnosable> Planning<'_, M> {
    /// Each run that the model can run, by its number, as it would part two sets with those of `before` measured too.
    fn looked_at(
        &self,
        runs: &[Run<M>],
        before: &[&Run<M>],
        sets: [Option<&SetWeight>; 2],
        separation_before: f64,
    ) -> Result<Vec<Looked<M::Run>>, Failure> {
        let mut all = Vec::new();
        for (number, candidate) in runs.iter().enumerate() {
            checkpoint(self.monitor)?;
            let added: Vec<&Run<M>> = before.iter().copied().chain([candidate]).collect();
            let then = separation_with::<M>(self.job, self.rows, &added, self.weighing, sets, self.monitor)?;
            // What was cancelled is no run beyond the model.
            checkpoint(self.monitor)?;
            let Some(separation_then) = then else { continue };
            let rows = candidate.points.len();
            let gained = separation_then * separation_then - separation_before * separation_before;
            let options = &self.job.options;
            all.push(Looked {
                number,
                changes: candidate.changes,
                run: candidate.run.clone(),
                rows,
                places: columns::<M>(&candidate.points),
                separation_then,
                bayes_factor: bayes_factor(separation_before, separation_then),
                settles: settles(gained, rows, [options.cost_per_run, options.cost_per_row]),
                entropy_drop_nats: None,
            });
        }
        Ok(all)
    }

    /// After the first run those that are asked for beside it, one by one: each parts the leader best from the rival that those
    /// before it part least. A run that adds nothing is not added.
    fn further(&self, runs: &[Run<M>], first: usize, leader: &SetWeight) -> Result<Vec<Further<M::Run>>, Failure> {
        let mut chosen = vec![&runs[first]];
        let mut further = Vec::new();
        while chosen.len() < usize::from(self.job.options.next_runs) {
            let mut least: Option<(f64, Option<&SetWeight>)> = None;
            for rival in rivals(self.weighing, leader) {
                let sets = [Some(leader), rival];
                let parted = separation_with::<M>(self.job, self.rows, &chosen, self.weighing, sets, self.monitor)?;
                if let Some(parted) = parted.filter(|parted| least.is_none_or(|(least, _)| *parted < least)) {
                    least = Some((parted, rival));
                }
            }
            let Some((separation_before, rival)) = least else { break };
            let looked = self.looked_at(runs, &chosen, [Some(leader), rival], separation_before)?;
            let Some(looked) = cheapest(&looked).filter(|best| best.settles.is_some()).cloned() else { break };
            chosen.push(&runs[looked.number]);
            let rival = rival.map_or_else(Vec::new, |rival| rival.members.clone());
            further.push(Further { looked, rival, separation_before });
        }
        Ok(further)
    }
}

impl<M: Diagnosable> Planning<'_, M> {
    /// The cuts by what is expected to be seen of them: that by which the entropy over the sets that may be right falls farthest, and
    /// with it those that tell most after it.
    fn telling(
        &self,
        runs: &[Run<M>],
        outlooks: &Outlooks,
        [leader, rival]: [Vec<usize>; 2],
        separation_now: f64,
    ) -> Option<NextMeasurement<M::Run>> {
        let options = &self.job.options;
        let then = |log_bayes: f64| (separation_now * separation_now + 2.0 * log_bayes).sqrt();
        let looked = |number: usize, told: &Told| Looked {
            number,
            changes: runs[number].changes,
            run: runs[number].run.clone(),
            rows: 1,
            places: columns::<M>(&runs[number].points),
            separation_then: then(told.log_bayes),
            bayes_factor: told.log_bayes.min(600.0).exp(),
            settles: settles(2.0 * told.log_bayes, 1, [options.cost_per_run, options.cost_per_row]),
            entropy_drop_nats: Some(told.of_sets),
        };
        let told: Vec<(usize, Told)> = (0..runs.len()).filter_map(|cut| Some((cut, outlooks.told(cut)?))).collect();
        let best = told.iter().max_by(|a, b| a.1.of_sets.total_cmp(&b.1.of_sets))?;
        let mut made = vec![best.0];
        let mut further = Vec::new();
        let mut log_bayes = best.1.log_bayes;
        while made.len() < usize::from(options.next_runs) {
            let after = |(cut, own): &(usize, Told)| Some((*cut, *own, outlooks.told_after(&made, *cut)?));
            let most = told.iter().filter_map(after).max_by(|a, b| a.2.total_cmp(&b.2));
            let Some((cut, own, of_sets)) = most.filter(|most| most.2 > LEAST_TOLD) else { break };
            let separation_before = then(log_bayes);
            log_bayes += own.log_bayes;
            let looked =
                Looked { separation_then: then(log_bayes), entropy_drop_nats: Some(of_sets), ..looked(cut, &own) };
            further.push(Further { looked, rival: rival.clone(), separation_before });
            made.push(cut);
        }
        let candidates = told.iter().map(|(cut, own)| looked(*cut, own)).collect();
        let best = looked(best.0, &best.1);
        Some(NextMeasurement { best, separation_now, leader, rival, further, candidates })
    }
}

/// Sets that may be right instead of the leader, heaviest first; the base while it may be.
fn rivals<'a>(weighing: &'a Weighing<'_>, leader: &SetWeight) -> Vec<Option<&'a SetWeight>> {
    if matches!(weighing.verdict, Verdict::Adequate) {
        return vec![None];
    }
    let is_other = |set: &&SetWeight| !leader.members.iter().all(|h| set.members.contains(h));
    weighing.named_sets().filter(is_other).take(MOST_RIVALS).map(Some).collect()
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
fn bayes_factor(now: f64, then: f64) -> f64 {
    (0.5 * (then * then - now * now).max(0.0)).min(600.0).exp()
}

/// Rows in proportion to what a whole run gains: odds grow as exp(d^2/2), d^2 with the number of rows; and what as many runs as
/// that takes cost, each with its rows.
fn settles(gained: f64, rows: usize, [per_run, per_row]: [f64; 2]) -> Option<(usize, f64)> {
    let wanted = 2.0 * SETTLING_ODDS.ln();
    (gained * MOST_RUNS > wanted).then(|| {
        let runs = wanted / gained;
        // At most twenty runs, by the bound above.
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        let count = (runs * rows as f64).ceil() as usize;
        // No run is cut in part.
        (count.max(1), runs.max(1.0) * (per_run + per_row * rows as f64))
    })
}

/// The leading set, and the heaviest set that is no superset of it; the base is a rival while it may be right.
fn contenders<'a>(weighing: &'a Weighing<'_>) -> Option<(&'a SetWeight, Option<&'a SetWeight>)> {
    let leader = weighing.named_sets().next()?;
    if matches!(weighing.verdict, Verdict::Adequate) {
        return Some((leader, None));
    }
    let rival = rivals(weighing, leader).into_iter().next().flatten()?;
    Some((leader, Some(rival)))
}

fn separation_with<M: Diagnosable>(
    job: &JobOf<M>,
    rows: &Rows<M::Run, M::Point>,
    added: &[&Run<M>],
    weighing: &Weighing<'_>,
    sets: [Option<&SetWeight>; 2],
    monitor: &dyn Monitor,
) -> Result<Option<f64>, Failure> {
    let mut all = rows.clone();
    let (mut traces, mut runs) = (Vec::new(), Vec::new());
    for candidate in added {
        let (run, first) = (all.runs.len(), all.points.len());
        all.runs.push(candidate.run.clone());
        all.points.extend(candidate.points.iter().map(|point| (run, point.clone())));
        traces.push((first..all.points.len()).collect());
        runs.push(run);
    }
    // A candidate beyond what the model covers is no candidate.
    let (base, known) = base_of::<M>(job);
    let Ok(prepared) = M::prepare(&base, &all, &job.quantity, monitor) else { return Ok(None) };
    let old = weighing.foundation.data;
    let layout = Layout {
        traces: old.layout.traces.iter().cloned().chain(traces).collect(),
        run_of_trace: old.layout.run_of_trace.iter().copied().chain(runs).collect(),
        design: M::design(&prepared),
    };
    let mut noise = weighing.noise.clone();
    match M::spreads(&prepared, &job.allowances) {
        // Of classes what is granted to each row.
        Some(spreads) => noise.per_row = Some(spreads),
        None => {
            if let Some(per_row) = &mut noise.per_row {
                per_row.resize(all.points.len(), noise.sigma);
            }
        }
    }
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
    if let Some(sides) = &old.sides {
        let mut sides = sides.clone();
        sides.resize(all.points.len(), 1.0);
        // About the leader, as it is taken to be right.
        let with = bound.predict(&of_leader)?;
        // What has no margin tells nothing.
        let margins: Vec<f64> = with.iter().map(|margin| margin.unwrap_or(f64::MAX)).collect();
        noise = noise.informed(&sides, &margins);
    }
    let whitener = Whitener::new(&data, &noise, &nuisances, &keep);
    let a = Signature::anew(&bound, &whitener, &keep, &of_leader)?;
    let b = Signature::anew(&bound, &whitener, &keep, &of_rival)?;
    Ok(Some(a.separation(&b)))
}

#[cfg(test)]
#[allow(clippy::panic, clippy::cast_possible_truncation, clippy::cast_sign_loss)]
mod tests {
    use super::*;

    fn looked(number: usize, rows: usize, gained: f64, costs: [f64; 2]) -> Looked<()> {
        let (changes, run, places, bayes_factor) = ("depth_mm", (), BTreeMap::new(), 1.0);
        let separation_then = gained.sqrt();
        let settles = settles(gained, rows, costs);
        Looked { number, changes, run, rows, places, separation_then, bayes_factor, settles, entropy_drop_nats: None }
    }

    fn best(rows_and_gains: [(usize, f64); 2], costs: [f64; 2]) -> Looked<()> {
        let both = [0, 1].map(|k| looked(k, rows_and_gains[k].0, rows_and_gains[k].1, costs));
        cheapest(&both).cloned().unwrap_or_else(|| panic!("one of two is the cheapest"))
    }

    #[test]
    fn the_run_that_settles_at_the_least_cost_is_the_best() {
        let wanted = 2.0 * SETTLING_ODDS.ln();
        let two = [(1, 1.0), (20, 4.0)];
        // A run costs what it costs, whatever is measured of it: the one that parts more.
        assert_eq!(best(two, [1.0, 0.0]).number, 1);
        // Rows cost as much as the run: a quarter of the runs with ten times the cost each.
        assert_eq!(best(two, [1.0, 1.0]).number, 0);
        let (rows, cost) = looked(0, 20, 4.0, [1.0, 1.0]).settles.unwrap_or_default();
        assert_eq!(rows, (20.0 * wanted / 4.0).ceil() as usize);
        assert!((cost - 21.0 * wanted / 4.0).abs() < 1e-12);
        // One run at least has to be made; among those of which one will do, the one that parts more.
        let enough = best([(4, 2.0 * wanted), (4, 4.0 * wanted)], [3.0, 0.5]);
        assert_eq!((enough.number, enough.settles), (1, Some((1, 5.0))));
        // What settles nothing comes after what does, and among the like what parts more.
        let nothing = best([(5, 1e-9), (5, 0.99 * wanted / MOST_RUNS)], [1.0, 0.0]);
        assert_eq!((nothing.number, nothing.settles), (1, None));
        assert_eq!(cheapest::<()>(&[]), None);
    }
}
