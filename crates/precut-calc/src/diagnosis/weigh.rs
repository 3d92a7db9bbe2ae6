//! From rows to posterior weights and a verdict (`diagnosis/3.5`, `diagnosis/3.7`).

use super::discrepancy::{self, Kind, Remainder};
use super::evidence::{Normal, Side, log_sum_exp};
use super::fairness::Left;
use super::foundation::Foundation;
use super::likelihood::Likelihood;
use super::link;
use super::noise::Noise;
use super::optima::{Optimum, Peak, elsewhere};
use super::profile::{Profile, Profiler};
use super::refine::{Fit, Refinement};
use super::search::{Candidate, Linear, by_weight};
use super::subject::Setting;
use super::whiten::{White, Whitener};
use crate::calculator::{Failure, Hypothesis, Monitor, Treatment, checkpoint};

/// Sets that are refined about the model itself.
const LEADERS: usize = 12;
/// Sets that lead only after the others were refined, and are then refined too.
const LATE_LEADERS: usize = 6;
/// Sets that are tried with an unnamed remainder beside them.
const WITH_REMAINDER: usize = 5;
/// Prior of the remainder beside a set, relative to the set.
const REMAINDER_PRIOR: f64 = 0.08;
/// Below this posterior of "nothing", something is wrong: an alarm needs a Bayes factor of about nine.
const ALARM: f64 = 0.1;
/// Posterior of the remainder from which on the answer is "not in the catalogue".
pub(super) const UNNAMED: f64 = 0.5;
/// Posterior from which on a set is named.
const NAMED: f64 = 0.8;
/// Posterior from which on a set is named if every likely set contains it.
const NAMED_IF_COMMON: f64 = 0.5;
/// Share of the named posterior that the list of likely sets holds.
const LIKELY: f64 = 0.95;
/// Posterior of the remainder from which on no set is named: one in ten, as much as "nothing" may have in an alarm.
pub(super) const UNNAMED_MATTERS: f64 = ALARM;

/// Free sizes of a remainder up to which its band is computed: beyond, a triangular solution for every row takes longer
/// than everything else.
const MOST_FREE_SIZES: usize = 200;

/// How far the search goes, and how badly a set may fit that is named.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Effort {
    /// Causes at the same time, 0 to 3.
    pub most_causes: usize,
    /// Sets that are refined about the model itself.
    pub leaders: usize,
    /// Of the sets of none, one, two and three causes those that are refined in any case: from the base a single cause
    /// of a model that is far from linear looks worse than a set that mimics it.
    pub of_each_size: [usize; 4],
    /// How often those that lead only after others were refined are refined, too, and how many each time.
    pub rounds: usize,
    /// See `rounds`.
    pub late_leaders: usize,
    /// Whether the model is far from linear in its sizes: then a refinement takes more steps, and what it changes at
    /// the best point of a grid corrects the whole grid.
    pub nonlinear: bool,
    /// Whether other optima of the leading set are looked for.
    pub other_optima: bool,
    /// Least probability of what a set leaves for it to be named.
    pub level: f64,
}

/// Significance level of the tests unless another is asked for.
pub(super) const LEVEL: f64 = 0.01;

impl Effort {
    /// The whole search.
    pub fn full(most_causes: usize) -> Self {
        Self {
            most_causes,
            leaders: LEADERS,
            of_each_size: [0; 4],
            rounds: 1,
            late_leaders: LATE_LEADERS,
            nonlinear: false,
            other_optima: true,
            level: LEVEL,
        }
    }

    /// Where every prediction is a simulation: fewer sets.
    pub fn dear(most_causes: usize) -> Self {
        Self {
            most_causes,
            leaders: 1,
            of_each_size: [0, 4, 2, 1],
            rounds: 3,
            late_leaders: 2,
            nonlinear: true,
            other_optima: true,
            level: LEVEL,
        }
    }

    /// The same in a fold.
    pub fn dear_fold(most_causes: usize) -> Self {
        Self {
            most_causes,
            leaders: 1,
            of_each_size: [0, 2, 1, 0],
            rounds: 1,
            late_leaders: 1,
            nonlinear: true,
            other_optima: false,
            level: LEVEL,
        }
    }
}

/// What the rows say.
#[derive(Debug, Clone, PartialEq)]
pub enum Verdict {
    /// Nothing is wrong that these rows could show.
    Adequate,
    /// These causes, by their hypotheses.
    Named(Vec<usize>),
    /// One of these sets; the data cannot tell which.
    Confounded(Vec<Vec<usize>>),
    /// Something that the catalogue does not hold, beside at least these causes.
    Unknown(Vec<usize>),
}

/// A set of causes with its posterior.
#[derive(Debug, Clone, PartialEq)]
pub struct SetWeight {
    /// Hypotheses, ascending.
    pub members: Vec<usize>,
    /// Share of the whole posterior.
    pub posterior: f64,
    /// Fitted values.
    pub settings: Vec<Setting>,
    /// Posterior standard deviations of the values, 0 where they are stated.
    pub standard_deviations: Vec<Vec<f64>>,
    /// Whether the model itself was linearised at the optimum.
    pub refined: bool,
    /// The remainder beside them, where there is one.
    pub(super) remainder: Option<Remainder>,
    /// Other optima that the rows fit nearly as well, as far as they were looked for.
    pub(super) others: Vec<Optimum>,
}

/// All sets of causes weighed against each other, against nothing, and against a remainder without a name.
pub struct Weighing<'a> {
    pub(super) foundation: &'a Foundation<'a>,
    /// Rows that count.
    pub keep: Vec<bool>,
    /// Scatter of the rows.
    pub noise: Noise,
    /// Distances between predictions in standard deviations; of classes about the leading set.
    pub(super) whitener: Whitener,
    pub(super) linear: Linear<'a>,
    /// Whitened regressors of an unordered design.
    low_order: Vec<White>,
    ranking: Ranking,
    pub(super) kinds: Vec<Kind>,
    /// All sets, heaviest first.
    pub sets: Vec<SetWeight>,
    /// Posterior of "nothing is wrong".
    pub none: f64,
    /// Posterior of all sets with an unnamed remainder.
    pub unnamed: f64,
    /// Posterior that a hypothesis takes part, for every hypothesis.
    pub inclusion: Vec<f64>,
    /// The verdict.
    pub verdict: Verdict,
}

impl<'a> Weighing<'a> {
    /// Weighs with the rows that are kept.
    pub fn of(
        foundation: &'a Foundation<'a>,
        keep: Vec<bool>,
        effort: Effort,
        monitor: &dyn Monitor,
    ) -> Result<Self, Failure> {
        let Foundation { subject, data, residual, nuisances, signatures, .. } = foundation;
        let noise = Noise::of(data, residual, &keep, foundation.heavy_tails.as_deref());
        let likelihood = Likelihood::of(data, &noise, nuisances, &keep);
        let linear = Linear::new(subject.hypotheses(), signatures, likelihood, residual);
        let candidates = linear.search(effort.most_causes, monitor)?;
        let refinement = Refinement {
            subject: *subject,
            value: &data.value,
            keep: &keep,
            likelihood: &linear.likelihood,
            nonlinear: effort.nonlinear,
            monitor,
        };
        let mut ranking = Ranking { candidates, fits: Vec::new(), others: (Vec::new(), Vec::new()) };
        ranking.refine(&linear, &refinement, effort.leaders, effort.of_each_size, monitor)?;
        for _ in 0..effort.rounds {
            ranking.refine(&linear, &refinement, effort.late_leaders, [0; 4], monitor)?;
        }
        ranking.refine_parts(&linear, &refinement, monitor)?;
        if effort.other_optima {
            ranking.look_elsewhere(&linear, &refinement)?;
        }
        let kinds = discrepancy::kinds(data, &linear.likelihood, noise.sigma, monitor)?;
        let mut weighed = ranking.weigh(&linear, &kinds, monitor)?;
        let total = log_sum_exp(&weighed.iter().map(|set| set.0).collect::<Vec<_>>());
        weighed.sort_by(|a, b| b.0.total_cmp(&a.0).then_with(|| a.1.members.cmp(&b.1.members)));
        let sets: Vec<SetWeight> = weighed
            .into_iter()
            .map(|(log_weight, set)| SetWeight { posterior: (log_weight - total).exp(), ..set })
            .collect();
        let sum = |choose: &dyn Fn(&SetWeight) -> bool| -> f64 {
            let sum: f64 = sets.iter().filter(|set| choose(set)).map(|set| set.posterior).sum();
            // The last digit of many shares may lie beyond all of them.
            sum.min(1.0)
        };
        let none = sum(&|set| set.members.is_empty() && set.remainder.is_none());
        let unnamed = sum(&|set| set.remainder.is_some());
        let inclusion = (0..subject.hypotheses().len()).map(|h| sum(&|set| set.members.contains(&h))).collect();
        let whitener = match &linear.likelihood {
            Likelihood::Gaussian { whitener, .. } => whitener.clone(),
            Likelihood::Classes(_) => about_leader(foundation, &sets, &noise, &keep)?,
        };
        let at_limit =
            |set: &SetWeight| ranking.fit(&set.members).is_some_and(|fit| at_limit(fit, subject.hypotheses()));
        let low_order: Vec<White> = data.layout.design.regressors.iter().map(|column| whitener.white(column)).collect();
        let is_fair = |set: &SetWeight| {
            ranking
                .lack_of_fit(&linear, &noise, &low_order, &set.members)
                .is_none_or(|probability| probability >= effort.level)
        };
        let verdict = verdict(&sets, none, unnamed, &at_limit, &is_fair);
        Ok(Self {
            foundation,
            keep,
            noise,
            whitener,
            linear,
            low_order,
            ranking,
            kinds,
            sets,
            none,
            unnamed,
            inclusion,
            verdict,
        })
    }

    /// What every value of every member of a set whose shapes stay on their grid may be, point by point of the grid; `None` of
    /// other sets, and beside a remainder.
    pub fn peaks(&self, set: &SetWeight) -> Option<Vec<Vec<Vec<Peak>>>> {
        let fit = self.fit(&set.members);
        if set.remainder.is_some() || fit.is_some_and(|fit| fit.with_shapes) {
            return None;
        }
        let candidate = self.ranking.candidates.iter().find(|candidate| candidate.members == set.members)?;
        let mut peaks = self.linear.peaks(candidate)?;
        // About the model itself the best point is better known.
        if let Some(fit) = fit {
            for (k, &(member, variable)) in fit.free.iter().enumerate() {
                if let Some(best) = peaks[member][variable].first_mut() {
                    best.value = fit.settings[member].values[variable];
                    best.standard_deviation = fit.covariance[(k, k)].sqrt();
                }
            }
        }
        Some(peaks)
    }

    /// The fit of a set about the model itself, where it was made.
    pub(super) fn fit(&self, members: &[usize]) -> Option<&Fit> {
        self.ranking.fit(members)
    }

    /// What every fitted value of a set costs when the others are fitted anew, out to `reach` posterior standard
    /// deviations. Not of values that a grid of shapes widens: there the fit knows a point of the grid only. Nor of a set
    /// that was not refined.
    pub fn profiles(
        &self,
        set: &SetWeight,
        reach: f64,
        dear: bool,
        monitor: &dyn Monitor,
    ) -> Result<Vec<Profile>, Failure> {
        let Some(fit) = self.fit(&set.members) else { return Ok(Vec::new()) };
        let refinement = Refinement {
            subject: self.foundation.subject,
            value: &self.foundation.data.value,
            keep: &self.keep,
            likelihood: &self.linear.likelihood,
            nonlinear: dear,
            monitor,
        };
        let of_fit = |k: &usize| {
            let (member, variable) = fit.free[*k];
            set.standard_deviations[member][variable] <= fit.covariance[(*k, *k)].sqrt() * (1.0 + 1e-9)
        };
        let free: Vec<usize> = (0..fit.free.len()).filter(of_fit).collect();
        Profiler { refinement: &refinement, fit, dear }.profiles(&free, reach, monitor)
    }

    /// Probability that rows scatter so far from a set or farther, if nothing else acts; see [`Ranking::lack_of_fit`].
    pub(super) fn lack_of_fit(&self, set: &SetWeight) -> Option<f64> {
        if set.remainder.is_some() {
            return None;
        }
        self.ranking.lack_of_fit(&self.linear, &self.noise, &self.low_order, &set.members)
    }

    /// n ln(RSS/n) + k ln n of a set without a remainder, RSS whitened and at the fit without priors. Where it has a
    /// remainder its sizes are as many as one likes, and there is none; nor of classes.
    pub(super) fn bic(&self, set: &SetWeight) -> Option<f64> {
        let Likelihood::Gaussian { whitener, .. } = &self.linear.likelihood else { return None };
        let candidate = self.ranking.candidates.iter().find(|candidate| candidate.members == set.members)?;
        let (columns, residual, _) = self.ranking.parts(&self.linear, candidate);
        let misfit = Normal::of(&columns, &residual).misfit().max(f64::MIN_POSITIVE);
        let rows = whitener.rows();
        set.remainder.is_none().then(|| rows * (misfit / rows).ln() + columns.len() as f64 * rows.ln())
    }

    /// Standard deviation of a measured row about the prediction of a set: scatter, allowances, and what the fitted
    /// values leave open. `None` where the set was not refined.
    pub fn deviation(&self, set: &SetWeight) -> Option<Vec<f64>> {
        let fit = self.fit(&set.members)?;
        let count = fit.free.len();
        let of_row = |row: usize| {
            let slope = |k: usize| fit.slopes[k][row];
            let fitted: f64 = (0..count)
                .flat_map(|i| (0..count).map(move |j| (i, j)))
                .map(|(i, j)| slope(i) * fit.covariance[(i, j)] * slope(j))
                .sum();
            (self.own_variance(row) + fitted.max(0.0)).sqrt()
        };
        Some((0..self.keep.len()).map(of_row).collect())
    }

    /// Posterior standard deviation of a set's remainder at every row; `None` where it has too many free sizes for it.
    pub(super) fn remainder_deviation(&self, set: &SetWeight, kind: &Kind, remainder: &Remainder) -> Option<Vec<f64>> {
        if kind.columns.len() > MOST_FREE_SIZES {
            return None;
        }
        let candidate = self.ranking.candidates.iter().find(|candidate| candidate.members == set.members)?;
        let (columns, residual, _) = self.ranking.parts(&self.linear, candidate);
        kind.deviation(remainder, &columns, &residual, &self.linear.likelihood)
    }

    /// What a row costs a prediction that leaves so much: the square; of a class twice minus the log-probability of it.
    pub(super) fn loss(&self, row: usize, left: f64) -> f64 {
        match &self.foundation.data.sides {
            None => left * left,
            Some(sides) => -2.0 * link::log_probability(-sides[row] * left / self.scatter(row)),
        }
    }

    /// Standard deviation of a row about its prediction, without allowances.
    pub(super) fn scatter(&self, row: usize) -> f64 {
        self.noise.per_row.as_ref().map_or(self.noise.sigma, |own| own[row])
    }

    /// Variance of a row: scatter and allowances.
    pub(super) fn own_variance(&self, row: usize) -> f64 {
        let sigma = self.noise.per_row.as_ref().map_or(self.noise.sigma, |own| own[row]);
        sigma * sigma + self.foundation.allowed[row]
    }

    /// Columns of a fit in the coordinates of `whitener`, each up to a factor.
    pub(super) fn directions(&self, fit: &Fit) -> Vec<White> {
        match &self.linear.likelihood {
            Likelihood::Gaussian { .. } => fit.columns.clone(),
            Likelihood::Classes(_) => fit.slopes.iter().map(|slope| self.whitener.white(slope)).collect(),
        }
    }

    /// Rows of a run that count.
    pub(super) fn rows_of_run(&self, run: usize) -> Vec<usize> {
        let sweeps = self.foundation.data.layout.kept_traces(&self.keep);
        sweeps.into_iter().filter(|(of, _)| *of == run).flat_map(|(_, rows)| rows).collect()
    }

    /// Sets without a remainder, heaviest first.
    pub fn named_sets(&self) -> impl Iterator<Item = &SetWeight> {
        self.sets.iter().filter(|set| set.remainder.is_none() && !set.members.is_empty())
    }
}

/// What classes tell of margins near those of the leading set.
fn about_leader(
    foundation: &Foundation<'_>,
    sets: &[SetWeight],
    noise: &Noise,
    keep: &[bool],
) -> Result<Whitener, Failure> {
    let leader = sets.iter().find(|set| set.remainder.is_none() && !set.members.is_empty());
    let margin: Vec<f64> = match leader {
        Some(set) => {
            let with = foundation.subject.predict(&set.settings)?;
            with.iter().zip(&foundation.base).map(|(with, base)| with.unwrap_or(*base)).collect()
        }
        None => foundation.base.clone(),
    };
    Ok(Whitener::new(foundation.data, &noise.informed(&margin), &foundation.nuisances, keep))
}

/// Candidates, and the fits of those that were refined.
struct Ranking {
    candidates: Vec<Candidate>,
    fits: Vec<(Vec<usize>, Option<Fit>)>,
    /// Of the set that led then: its members, and the fits at its other optima.
    others: (Vec<usize>, Vec<Fit>),
}

impl Ranking {
    fn fit(&self, members: &[usize]) -> Option<&Fit> {
        self.fits.iter().find(|(of, _)| of == members).and_then(|(_, fit)| fit.as_ref())
    }

    /// The heaviest sets: so many of all, and so many of each size.
    fn leaders(&self, count: usize, of_each_size: [usize; 4]) -> Vec<usize> {
        let mut met = [0; 4];
        (0..self.candidates.len())
            .filter(|&index| {
                let size = self.candidates[index].members.len().min(3);
                met[size] += 1;
                index < count || met[size] <= of_each_size[size]
            })
            .collect()
    }

    /// Refines the heaviest sets that are not refined yet, and gives them the evidence found there.
    fn refine(
        &mut self,
        linear: &Linear<'_>,
        refinement: &Refinement<'_>,
        count: usize,
        of_each_size: [usize; 4],
        monitor: &dyn Monitor,
    ) -> Result<(), Failure> {
        let leaders = self.leaders(count, of_each_size);
        self.refine_these(leaders, linear, refinement, monitor)
    }

    /// Refines the parts of the set that leads: what fits only beside others from where it is linearised may fit alone about
    /// the model itself, and a companion that has nothing to do must not keep its place.
    fn refine_parts(
        &mut self,
        linear: &Linear<'_>,
        refinement: &Refinement<'_>,
        monitor: &dyn Monitor,
    ) -> Result<(), Failure> {
        while let Some(leader) = self.candidates.iter().find(|candidate| !candidate.members.is_empty()) {
            let is_part = |candidate: &Candidate| {
                let fewer = (1..leader.members.len()).contains(&candidate.members.len());
                fewer && candidate.members.iter().all(|h| leader.members.contains(h)) && !self.is_refined(candidate)
            };
            let parts: Vec<usize> =
                (0..self.candidates.len()).filter(|&index| is_part(&self.candidates[index])).collect();
            if parts.is_empty() {
                break;
            }
            self.refine_these(parts, linear, refinement, monitor)?;
        }
        Ok(())
    }

    fn is_refined(&self, candidate: &Candidate) -> bool {
        self.fits.iter().any(|(of, _)| *of == candidate.members)
    }

    fn refine_these(
        &mut self,
        indices: Vec<usize>,
        linear: &Linear<'_>,
        refinement: &Refinement<'_>,
        monitor: &dyn Monitor,
    ) -> Result<(), Failure> {
        for index in indices {
            checkpoint(monitor)?;
            if self.candidates[index].members.is_empty() || self.is_refined(&self.candidates[index]) {
                continue;
            }
            let candidate = &mut self.candidates[index];
            let start = linear.settings(candidate);
            let fit = if linear.is_off_grid(candidate) {
                // Its shapes were free before, and have paid for it.
                let free = refinement.fit(start, true)?;
                free.inspect(|free| candidate.log_z += free.log_z - candidate.best_log_z)
            } else {
                refine_from_grid(candidate, start, linear, refinement)?
            };
            self.fits.push((candidate.members.clone(), fit));
        }
        by_weight(&mut self.candidates);
        Ok(())
    }

    /// Looks for other optima of the leading set; the best one is its fit from then on.
    fn look_elsewhere(&mut self, linear: &Linear<'_>, refinement: &Refinement<'_>) -> Result<(), Failure> {
        let leader = self.candidates.iter_mut().find(|candidate| !candidate.members.is_empty());
        let Some(leader) = leader else { return Ok(()) };
        let of_leader = self.fits.iter_mut().find(|(of, _)| *of == leader.members);
        let Some(fit) = of_leader.and_then(|(_, fit)| fit.as_mut()) else { return Ok(()) };
        let mut others = elsewhere(leader, fit, linear, refinement)?;
        if let Some(best) = others.first_mut().filter(|best| best.log_z > fit.log_z) {
            leader.log_z += best.log_z - fit.log_z;
            std::mem::swap(fit, best);
        }
        self.others = (leader.members.clone(), others);
        by_weight(&mut self.candidates);
        Ok(())
    }

    /// Log weight of every set, alone and, where it leads, beside a remainder.
    fn weigh(
        &self,
        linear: &Linear<'_>,
        kinds: &[Kind],
        monitor: &dyn Monitor,
    ) -> Result<Vec<(f64, SetWeight)>, Failure> {
        let mut weighed: Vec<(f64, SetWeight)> =
            self.candidates.iter().map(|c| (c.log_weight(), self.set(linear, c, None))).collect();
        let empty = self.candidates.iter().filter(|c| c.members.is_empty());
        let leading = self.candidates.iter().filter(|c| !c.members.is_empty()).take(WITH_REMAINDER - 1);
        for candidate in empty.chain(leading) {
            if let Some(remainder) = self.beside(linear, kinds, candidate, monitor)? {
                let log_weight = remainder.log_z + candidate.log_prior + REMAINDER_PRIOR.ln();
                weighed.push((log_weight, self.set(linear, candidate, Some(remainder))));
            }
        }
        Ok(weighed)
    }

    /// Probability that a set leaves so much or more; see [`Left::probability`]. `None` of classes.
    fn lack_of_fit(&self, linear: &Linear<'_>, noise: &Noise, low_order: &[White], members: &[usize]) -> Option<f64> {
        let Likelihood::Gaussian { whitener, .. } = &linear.likelihood else { return None };
        let candidate = self.candidates.iter().find(|candidate| candidate.members == members)?;
        let (columns, residual, _) = self.parts(linear, candidate);
        Left { columns, residual: &residual, rows: whitener.rows(), noise }.probability(low_order)
    }

    fn beside(
        &self,
        linear: &Linear<'_>,
        kinds: &[Kind],
        candidate: &Candidate,
        monitor: &dyn Monitor,
    ) -> Result<Option<Remainder>, Failure> {
        let (columns, residual, sides) = self.parts(linear, candidate);
        discrepancy::beside(kinds, &columns, &residual, &sides, &linear.likelihood, monitor)
    }

    /// Columns of a set, the residual that they are to explain, and their sides: about the fit where it was made.
    fn parts<'b>(&'b self, linear: &'b Linear<'_>, candidate: &Candidate) -> (Vec<&'b White>, White, Vec<Side>) {
        if let Some(fit) = self.fit(&candidate.members) {
            return (fit.columns.iter().collect(), fit.residual.clone(), fit.sides.clone());
        }
        let (columns, sides, residual) = linear.parts(&candidate.members, &candidate.variants);
        (columns, residual, sides)
    }

    fn set(&self, linear: &Linear<'_>, candidate: &Candidate, remainder: Option<Remainder>) -> SetWeight {
        let fit = self.fit(&candidate.members);
        let settings = fit.map_or_else(|| linear.settings(candidate), |fit| fit.settings.clone());
        let nothing = || settings.iter().map(|s| vec![0.0; s.values.len()]).collect();
        let mut standard_deviations: Vec<Vec<f64>> = fit.map_or_else(nothing, Fit::standard_deviations);
        // A shape that stays on its grid is uncertain, too, and widens the sizes.
        if fit.is_none_or(|fit| !fit.with_shapes) {
            for (own, spread) in standard_deviations.iter_mut().zip(&candidate.spread) {
                own.iter_mut().zip(spread).for_each(|(own, spread)| *own = own.max(*spread));
            }
        }
        let others = match (fit, &self.others) {
            (Some(fit), (of, others)) if *of == candidate.members && remainder.is_none() => {
                others.iter().map(|other| Optimum::beside(fit, other)).collect()
            }
            _ => Vec::new(),
        };
        SetWeight {
            members: candidate.members.clone(),
            posterior: 0.0,
            settings,
            standard_deviations,
            refined: fit.is_some(),
            remainder,
            others,
        }
    }
}

/// Refines from a point of the grids: with free shapes where that explains more than the mean over the grid, else on it.
fn refine_from_grid(
    candidate: &mut Candidate,
    start: Vec<Setting>,
    linear: &Linear<'_>,
    refinement: &Refinement<'_>,
) -> Result<Option<Fit>, Failure> {
    if linear.has_free_shapes(&candidate.members) {
        let free = refinement.fit(start.clone(), true)?.filter(|fit| fit.with_shapes && fit.settled);
        if let Some(free) = free.filter(|free| free.log_z >= candidate.log_z) {
            candidate.log_z = free.log_z;
            return Ok(Some(free));
        }
    }
    Ok(refinement.fit(start, false)?.inspect(|plain| {
        if candidate.members.iter().all(|&h| linear.has_no_grid(h)) {
            candidate.log_z = plain.log_z;
        } else if refinement.nonlinear {
            candidate.log_z += plain.log_z - candidate.best_log_z;
        }
    }))
}

/// Whether the size of a cause lies at its physical limit; absent, at 0, is no limit, and of several sizes
/// of one cause the first counts.
fn at_limit(fit: &Fit, hypotheses: &[Hypothesis]) -> bool {
    fit.settings.iter().any(|setting| {
        let variables = &hypotheses[setting.hypothesis].variables;
        let first =
            variables.iter().zip(&setting.values).find(|(v, _)| matches!(v.treatment, Treatment::Amplitude { .. }));
        first.is_some_and(|(variable, value)| {
            let near = |bound: f64| (value - bound).abs() < 1e-9 * (variable.range.upper - variable.range.lower);
            (near(variable.range.lower) && variable.range.lower < 0.0) || near(variable.range.upper)
        })
    })
}

fn verdict(
    sets: &[SetWeight],
    none: f64,
    unnamed: f64,
    at_limit: &dyn Fn(&SetWeight) -> bool,
    is_fair: &dyn Fn(&SetWeight) -> bool,
) -> Verdict {
    if none >= ALARM {
        return Verdict::Adequate;
    }
    if unnamed >= UNNAMED {
        let leading = sets.iter().find(|set| set.remainder.is_some());
        return Verdict::Unknown(leading.map_or_else(Vec::new, |set| set.members.clone()));
    }
    let named: Vec<&SetWeight> = sets.iter().filter(|set| set.remainder.is_none() && !set.members.is_empty()).collect();
    let whole: f64 = named.iter().map(|set| set.posterior).sum();
    let mut likely: Vec<&SetWeight> = Vec::new();
    let mut held = 0.0;
    for set in &named {
        if held >= LIKELY * whole {
            break;
        }
        held += set.posterior;
        likely.push(set);
    }
    if let Some(leader) = likely.first() {
        let in_all = likely.iter().all(|set| leader.members.iter().all(|h| set.members.contains(h)));
        let leads = leader.posterior >= NAMED || (leader.posterior >= NAMED_IF_COMMON && in_all);
        let sure = leads && unnamed < UNNAMED_MATTERS;
        // The best of the catalogue, and the rows still object.
        if leads && !is_fair(leader) {
            return Verdict::Unknown(Vec::new());
        }
        // At its limit a size is not what the data ask for: something else acts, or the limit is wrong.
        if sure && !at_limit(leader) {
            return Verdict::Named(leader.members.clone());
        }
    }
    Verdict::Confounded(likely.iter().map(|set| set.members.clone()).collect())
}
