//! What a cut would tell of which only the class is seen, and values beside it (`diagnosis/3.11`): how far the entropy over the sets
//! that may be right is expected to fall.

use std::f64::consts::PI;

use nalgebra::Cholesky;

use crate::calculator::{Diagnosable, Failure, Hypothesis, Monitor, NextRun, Outlook, Rows, Treatment, checkpoint};
use crate::diagnosis::base::Bound;
use crate::diagnosis::calculator::{JobOf, base_of};
use crate::diagnosis::causes::ranking::SetWeight;
use crate::diagnosis::causes::subject::{Setting, Subject};
use crate::diagnosis::input::DiagnosisOptions;
use crate::diagnosis::rows::link;
use crate::diagnosis::verdict::weigh::Weighing;

/// Sets that may be right, at most, and the share of the probability of all sets without a remainder that they hold.
const MOST_SETS: usize = 6;
const HELD: f64 = 0.97;
/// Gaussian numbers as three: places in standard deviations and weights, exact up to the fifth power (Gauss and Hermite).
const THREE: [(f64, f64); 3] =
    [(-1.732_050_807_568_877_2, 1.0 / 6.0), (0.0, 2.0 / 3.0), (1.732_050_807_568_877_2, 1.0 / 6.0)];
/// Beliefs after cuts that are planned together, at most: the likeliest.
const MOST_BELIEFS: usize = 60;

/// Every cut that could be made, as every set foresees it at some of its likely sizes.
pub(super) struct Outlooks {
    /// Sets that may be right with their sizes: by set, and by size.
    sets: Vec<Vec<Vec<Option<Outlook>>>>,
    /// What is believed now.
    now: Belief,
    leader: usize,
    rival: usize,
}

/// Probability of every size of every set.
type Belief = Vec<Vec<f64>>;

/// What a cut is expected to tell.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Told {
    /// Fall of the entropy over the sets, nats.
    pub(super) of_sets: f64,
    /// Logarithm of the Bayes factor between leader and rival where the leader is right.
    pub(super) log_bayes: f64,
}

/// What may be seen of a cut.
#[derive(Debug, Clone, Copy)]
enum Seen {
    Quiet,
    /// With the logarithm of the value that is measured beside it.
    Loud(Option<f64>),
}

impl Outlooks {
    /// `None` where the model tells no more of a cut than its margin, where a set has no place among these cuts, or where none
    /// of them can be computed.
    pub(super) fn of<M: Diagnosable>(
        job: &JobOf<M>,
        runs: &[NextRun<M::Run, M::Point>],
        weighing: &Weighing<'_>,
        [leader, rival]: [Option<&SetWeight>; 2],
        monitor: &dyn Monitor,
    ) -> Result<Option<Self>, Failure> {
        let mut rows: Rows<M::Run, M::Point> = Rows { runs: Vec::new(), points: Vec::new() };
        for (number, candidate) in runs.iter().enumerate() {
            let [point] = candidate.points.as_slice() else { return Ok(None) };
            rows.runs.push(candidate.run.clone());
            rows.points.push((number, point.clone()));
        }
        let (base, known) = base_of::<M>(job);
        let Ok(prepared) = M::prepare(&base, &rows, &job.quantity, monitor) else { return Ok(None) };
        // Every cause: the sets are found in it by kind.
        let every = DiagnosisOptions::default();
        let bound = Bound::<M>::new(prepared, known, job.allowances.clone(), &job.quantity, &every, monitor)?;
        let likely = likely(weighing, [leader, rival]);
        let place = |of: Option<&SetWeight>| {
            let members = of.map_or(&[][..], |set| set.members.as_slice());
            likely.iter().position(|set| set.members == members)
        };
        let (Some(leader), Some(rival)) = (place(leader), place(rival)) else { return Ok(None) };
        let allowed = allowed(&bound, runs.len())?;
        let mut sets = Vec::with_capacity(likely.len());
        for set in &likely {
            let mut of_set = Vec::new();
            for settings in sizes(weighing, set) {
                checkpoint(monitor)?;
                let Some(settings) = translated(weighing, &bound, &settings) else { return Ok(None) };
                let effects = bound.with_settings(&settings)?;
                let Some(mut seen) = M::outlooks(bound.prepared(), &job.allowances, &effects, monitor)? else {
                    return Ok(None);
                };
                for (own, allowed) in seen.iter_mut().zip(&allowed) {
                    if let Some(own) = own {
                        own.scatter = own.scatter.hypot(*allowed);
                    }
                }
                of_set.push(seen);
            }
            sets.push(of_set);
        }
        let whole: f64 = likely.iter().map(|set| set.posterior).sum();
        let even = |(set, of): (&&SetWeight, &Vec<_>)| vec![set.posterior / whole / of.len() as f64; of.len()];
        let now = likely.iter().zip(&sets).map(even).collect();
        Ok(Some(Self { sets, now, leader, rival }))
    }

    /// What a cut tells by itself; `None` of one that some set does not foresee.
    pub(super) fn told(&self, cut: usize) -> Option<Told> {
        Some(Told { of_sets: self.fall(&self.now, cut)?, log_bayes: self.log_bayes(cut)? })
    }

    /// The same after other cuts, whose outcomes are not known yet.
    pub(super) fn told_after(&self, before: &[usize], cut: usize) -> Option<f64> {
        let beliefs =
            before.iter().try_fold(vec![(1.0, self.now.clone())], |beliefs, made| self.after(beliefs, *made))?;
        beliefs.iter().map(|(share, belief)| Some(share * self.fall(belief, cut)?)).sum()
    }

    /// Fall of the entropy over sets: the mean of ln(posterior/prior) over what may be seen.
    fn fall(&self, belief: &Belief, cut: usize) -> Option<f64> {
        let gain = |then: f64, before: f64| if then > 0.0 { then * (then / before).ln() } else { 0.0 };
        let mut fall = 0.0;
        for (share, posterior) in self.outcomes(belief, cut)? {
            for (then, before) in posterior.iter().zip(belief) {
                fall += share * gain(then.iter().sum(), before.iter().sum());
            }
        }
        Some(fall.max(0.0))
    }

    /// What may be seen, each with its probability and what is believed then.
    fn outcomes(&self, belief: &Belief, cut: usize) -> Option<Vec<(f64, Belief)>> {
        let mut outcomes = Vec::new();
        for (set, of_set) in belief.iter().enumerate() {
            for (size, share) in of_set.iter().enumerate() {
                for (of_seen, seen) in expected(self.sets[set][size][cut].as_ref()?) {
                    if share * of_seen > 1e-9 {
                        outcomes.push((share * of_seen, self.posterior(belief, cut, seen)?));
                    }
                }
            }
        }
        Some(outcomes)
    }

    fn posterior(&self, belief: &Belief, cut: usize, seen: Seen) -> Option<Belief> {
        let mut posterior = belief.clone();
        let mut whole = 0.0;
        for (of_set, sizes) in posterior.iter_mut().zip(&self.sets) {
            for (share, size) in of_set.iter_mut().zip(sizes) {
                *share *= likelihood(size[cut].as_ref()?, seen);
                whole += *share;
            }
        }
        posterior.iter_mut().flatten().for_each(|share| *share /= whole);
        (whole > 0.0).then_some(posterior)
    }

    /// Beliefs after a cut, the likeliest of them.
    fn after(&self, beliefs: Vec<(f64, Belief)>, cut: usize) -> Option<Vec<(f64, Belief)>> {
        let mut then = Vec::new();
        for (share, belief) in beliefs {
            let outcomes = self.outcomes(&belief, cut)?;
            then.extend(outcomes.into_iter().map(|(of_outcome, posterior)| (share * of_outcome, posterior)));
        }
        then.sort_by(|a, b| b.0.total_cmp(&a.0));
        then.truncate(MOST_BELIEFS);
        let whole: f64 = then.iter().map(|(share, _)| share).sum();
        for (share, _) in &mut then {
            *share /= whole;
        }
        Some(then)
    }

    /// Mean over what may be seen where the leader is right of ln of its probability under the leader over that under the rival.
    fn log_bayes(&self, cut: usize) -> Option<f64> {
        let of_set = |set: usize, seen: Seen| -> Option<f64> {
            let (sizes, shares) = (&self.sets[set], &self.now[set]);
            let whole: f64 = shares.iter().sum();
            let of_size = |(size, share): (&Vec<Option<Outlook>>, &f64)| {
                Some(share / whole * likelihood(size[cut].as_ref()?, seen))
            };
            sizes.iter().zip(shares).map(of_size).sum()
        };
        let leader = &self.now[self.leader];
        let whole: f64 = leader.iter().sum();
        let mut sum = 0.0;
        for (size, share) in leader.iter().enumerate() {
            for (of_seen, seen) in expected(self.sets[self.leader][size][cut].as_ref()?) {
                sum += share / whole * of_seen * (of_set(self.leader, seen)? / of_set(self.rival, seen)?).ln();
            }
        }
        Some(sum.max(0.0))
    }
}

/// What may be seen where this is right, with its probability. A value stands at the likeliest that the model knows.
fn expected(outlook: &Outlook) -> Vec<(f64, Seen)> {
    let quiet = quiet(outlook);
    let loud = match outlook.heard.first() {
        None => vec![(1.0 - quiet, Seen::Loud(None))],
        Some(at) => THREE
            .map(|(place, weight)| (weight * (1.0 - quiet), Seen::Loud(Some(at + place * outlook.heard_scatter))))
            .to_vec(),
    };
    [(quiet, Seen::Quiet)].into_iter().chain(loud).collect()
}

/// Of a value: the density in units of ln, that of the nearest of those that the model knows.
fn likelihood(outlook: &Outlook, seen: Seen) -> f64 {
    let loud = 1.0 - quiet(outlook);
    match seen {
        Seen::Quiet => quiet(outlook),
        Seen::Loud(None) => loud,
        Seen::Loud(Some(at)) => {
            let off = outlook.heard.iter().map(|own| ((at - own) / outlook.heard_scatter).abs());
            let off = off.fold(f64::INFINITY, f64::min);
            loud * link::log_likelihood(0.0, off).exp() / (outlook.heard_scatter * (2.0 * PI).sqrt())
        }
    }
}

fn quiet(outlook: &Outlook) -> f64 {
    link::log_probability(outlook.margin / outlook.scatter).exp().clamp(1e-12, 1.0 - 1e-12)
}

/// Effects of the likeliest sets without a remainder at their sizes, the leading one first; none where a set has no place in the model.
pub(super) fn likely_effects<M: Diagnosable>(
    job: &JobOf<M>,
    rows: &Rows<M::Run, M::Point>,
    weighing: &Weighing<'_>,
    contenders: [Option<&SetWeight>; 2],
    monitor: &dyn Monitor,
) -> Result<Vec<Vec<M::Effect>>, Failure> {
    // One row does: what is asked are effects, not what they do to it.
    let Some((run, point)) = rows.points.first() else { return Ok(Vec::new()) };
    let one = Rows { runs: rows.runs.get(*run).cloned().into_iter().collect(), points: vec![(0, point.clone())] };
    let (base, known) = base_of::<M>(job);
    let Ok(prepared) = M::prepare(&base, &one, &job.quantity, monitor) else { return Ok(Vec::new()) };
    let every = DiagnosisOptions::default();
    let bound = Bound::<M>::new(prepared, known, job.allowances.clone(), &job.quantity, &every, monitor)?;
    let mut likely = likely(weighing, contenders);
    let leader = contenders[0].map_or(&[][..], |set| set.members.as_slice());
    likely.sort_by_key(|set| set.members != leader);
    let mut effects = Vec::with_capacity(likely.len());
    for set in likely {
        let Some(settings) = translated(weighing, &bound, &set.settings) else { return Ok(Vec::new()) };
        effects.push(bound.with_settings(&settings)?);
    }
    Ok(effects)
}

/// The likeliest sets without a remainder, nothing among them, leader and rival in any case.
fn likely<'a>(weighing: &'a Weighing<'_>, contenders: [Option<&SetWeight>; 2]) -> Vec<&'a SetWeight> {
    let whole: f64 = weighing.sets.iter().filter(|set| set.remainder.is_none()).map(|set| set.posterior).sum();
    let is_contender =
        |set: &SetWeight| contenders.iter().any(|of| of.map_or(&[][..], |of| &of.members) == set.members);
    let (mut held, mut likely) = (0.0, Vec::new());
    for set in weighing.sets.iter().filter(|set| set.remainder.is_none()) {
        let is_needed = held < HELD * whole && likely.len() < MOST_SETS;
        if is_needed || is_contender(set) {
            held += set.posterior;
            likely.push(set);
        }
    }
    likely
}

/// Equally likely settings of a set whose mean and covariance are those of its fit: sqrt(d) standard deviations along each of d
/// independent directions, either way.
fn sizes(weighing: &Weighing<'_>, set: &SetWeight) -> Vec<Vec<Setting>> {
    let hypotheses = weighing.foundation.subject.hypotheses();
    let (free, directions) = match weighing.fit(&set.members) {
        Some(fit) => match Cholesky::new(fit.covariance.clone()) {
            Some(factor) => {
                let directions = factor.l().column_iter().map(|column| column.iter().copied().collect()).collect();
                (fit.free.clone(), directions)
            }
            None => (Vec::new(), Vec::new()),
        },
        None => alone(set, hypotheses),
    };
    let far = (free.len() as f64).sqrt();
    let moved = |direction: &Vec<f64>, sign: f64| {
        let mut settings = set.settings.clone();
        for (&(member, variable), by) in free.iter().zip(direction) {
            let range = hypotheses[settings[member].hypothesis].variables[variable].range;
            let value = &mut settings[member].values[variable];
            *value = range.clamp(*value + sign * far * by);
        }
        settings
    };
    let both = |direction: &Vec<f64>| [1.0, -1.0].map(|sign| moved(direction, sign));
    let all: Vec<Vec<Setting>> = directions.iter().flat_map(both).collect();
    if all.is_empty() { vec![set.settings.clone()] } else { all }
}

/// Of a set that was not refined every size by itself.
fn alone(set: &SetWeight, hypotheses: &[Hypothesis]) -> (Vec<(usize, usize)>, Vec<Vec<f64>>) {
    let mut free = Vec::new();
    for (member, setting) in set.settings.iter().enumerate() {
        let variables = hypotheses[setting.hypothesis].variables.iter().enumerate();
        let sized = variables.filter(|(_, variable)| matches!(variable.treatment, Treatment::Amplitude { .. }));
        free.extend(sized.map(|(variable, _)| (member, variable)));
    }
    let direction = |k: usize| {
        let of = |(j, &(member, variable)): (usize, &(usize, usize))| {
            if j == k { set.standard_deviations[member][variable] } else { 0.0 }
        };
        free.iter().enumerate().map(of).collect()
    };
    let directions = (0..free.len()).map(direction).collect();
    (free, directions)
}

/// The same causes by their numbers in another catalogue.
fn translated<M: Diagnosable>(
    weighing: &Weighing<'_>,
    bound: &Bound<'_, M>,
    settings: &[Setting],
) -> Option<Vec<Setting>> {
    let of = |setting: &Setting| {
        let own = &weighing.foundation.subject.hypotheses()[setting.hypothesis];
        let hypothesis = bound.hypotheses().iter().position(|h| h.cause == own.cause && h.label == own.label)?;
        Some(Setting { hypothesis, values: setting.values.clone() })
    };
    settings.iter().map(of).collect()
}

/// Standard deviation of every cut by what is allowed to be off.
fn allowed<M: Diagnosable>(bound: &Bound<'_, M>, cuts: usize) -> Result<Vec<f64>, Failure> {
    let columns = bound.nuisances()?;
    let of = |cut: usize| columns.iter().map(|column| column[cut] * column[cut]).sum::<f64>().sqrt();
    Ok((0..cuts).map(of).collect())
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    fn cut(margin: f64, heard_hz: f64) -> Outlook {
        Outlook { margin, scatter: 0.05, heard: vec![heard_hz.ln()], heard_scatter: 0.01 }
    }

    /// Two sets alike likely, each of one size, and what they foresee of four cuts.
    fn outlooks() -> Outlooks {
        let one = vec![Some(cut(0.1, 800.0)), Some(cut(1.0, 800.0)), Some(cut(-1.0, 800.0)), None];
        let other = [cut(0.1, 800.0), cut(-1.0, 900.0), cut(-1.0, 900.0), cut(0.1, 800.0)].map(Some).to_vec();
        Outlooks { sets: vec![vec![one], vec![other]], now: vec![vec![0.5], vec![0.5]], leader: 0, rival: 1 }
    }

    #[test]
    fn a_cut_tells_as_much_as_the_sets_foresee_it_differently() {
        let of = outlooks();
        let alike = of.told(0).unwrap();
        assert!(alike.of_sets < 1e-12 && alike.log_bayes < 1e-12, "{alike:?}");
        // One of two is told for good, by the class or by the frequency alone: ln 2, but for what the tails of the scatter leave (a class
        // 20 standard deviations away has a probability of 1e-6) and for frequencies that are another line than is meant (a thousandth).
        for number in [1, 2] {
            let told = of.told(number).unwrap();
            assert!((told.of_sets - 2.0_f64.ln()).abs() < 0.02 && told.log_bayes > 4.0, "{number}: {told:?}");
        }
        // What one set does not foresee tells nothing.
        assert!(of.told(3).is_none());
    }

    #[test]
    fn after_a_cut_that_tells_the_sets_apart_another_tells_nothing_more() {
        let of = outlooks();
        assert!(of.told_after(&[1], 2).unwrap() < 0.02);
        assert!((of.told_after(&[0], 2).unwrap() - of.told(2).unwrap().of_sets).abs() < 1e-9);
    }

    #[test]
    fn what_may_be_seen_has_a_probability_of_one_in_all() {
        for own in [cut(0.03, 700.0), cut(-0.2, 700.0)] {
            let whole: f64 = expected(&own).iter().map(|(share, _)| share).sum();
            assert!((whole - 1.0).abs() < 1e-12);
        }
    }
}
