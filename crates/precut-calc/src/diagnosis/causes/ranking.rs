//! Sets of causes in the order of their weight, refined about the model itself where they lead (`diagnosis/3.4`).

use crate::calculator::{Failure, Monitor, checkpoint};
use crate::diagnosis::causes::optima::{Optimum, elsewhere};
use crate::diagnosis::causes::refine::{Fit, Refinement, Start};
use crate::diagnosis::causes::search::{Beside, Candidate, Linear, by_weight};
use crate::diagnosis::causes::subject::Setting;
use crate::diagnosis::statistics::discrepancy::{self, Kind, Remainder};
use crate::diagnosis::statistics::evidence::Side;
use crate::diagnosis::statistics::whiten::White;

/// Sets that are tried with an unnamed remainder beside them.
const WITH_REMAINDER: usize = 5;
/// Prior of the remainder beside a set, relative to the set.
const REMAINDER_PRIOR: f64 = 0.08;
/// Where nothing leads, a pair that is foretold so much less weight, as a logarithm, will not matter: 1 in 150.
const HOPELESS: f64 = 5.0;
/// By so much less a fit with free shapes may explain than the mean over their grid, and is taken all the same.
const PRICE_OF_SHAPES: f64 = 2.0;

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
    pub(in crate::diagnosis) remainder: Option<Remainder>,
    /// Other optima that the rows fit nearly as well, as far as they were looked for.
    pub(in crate::diagnosis) others: Vec<Optimum>,
}

/// Candidates, and the fits of those that were refined.
pub(in crate::diagnosis) struct Ranking {
    pub(in crate::diagnosis) candidates: Vec<Candidate>,
    fits: Vec<(Vec<usize>, Option<Fit>)>,
    /// Of the set that led then: its members, and the fits at its other optima.
    others: (Vec<usize>, Vec<Fit>),
}

impl Ranking {
    /// Of sets that were searched, heaviest first.
    pub(in crate::diagnosis) fn new(candidates: Vec<Candidate>) -> Self {
        Self { candidates, fits: Vec::new(), others: (Vec::new(), Vec::new()) }
    }

    pub(in crate::diagnosis) fn fit(&self, members: &[usize]) -> Option<&Fit> {
        self.fits.iter().find(|(of, _)| of == members).and_then(|(_, fit)| fit.as_ref())
    }

    /// So many of the heaviest sets of several causes that were refined with free shapes.
    pub(in crate::diagnosis) fn heaviest_with_shapes(&self, count: usize) -> Vec<Vec<usize>> {
        let has_shapes =
            |members: &Vec<usize>| members.len() > 1 && self.fit(members).is_some_and(|fit| fit.with_shapes);
        let sets = self.candidates.iter().map(|candidate| &candidate.members);
        sets.filter(|members| has_shapes(members)).take(count).cloned().collect()
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
    pub(in crate::diagnosis) fn refine(
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
    pub(in crate::diagnosis) fn refine_parts(
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

    /// Begins the parts of the set that leads once more from where it has its best optimum. A companion that has nothing to do there
    /// would keep its place if its partner alone were only known at another one.
    pub(in crate::diagnosis) fn refine_parts_from_leader(
        &mut self,
        refinement: &Refinement<'_>,
        monitor: &dyn Monitor,
    ) -> Result<(), Failure> {
        let mut tried: Vec<Vec<usize>> = Vec::new();
        while let Some(leader) = self.candidates.iter().find(|candidate| !candidate.members.is_empty()) {
            let Some(fit) = self.fit(&leader.members).filter(|_| !tried.contains(&leader.members)) else { break };
            let (leader, settings, with_shapes) = (leader.members.clone(), fit.settings.clone(), fit.with_shapes);
            let is_part = |members: &[usize]| {
                (1..leader.len()).contains(&members.len()) && members.iter().all(|member| leader.contains(member))
            };
            for candidate in self.candidates.iter_mut().filter(|candidate| is_part(&candidate.members)) {
                checkpoint(monitor)?;
                let own = self.fits.iter_mut().find(|(of, _)| *of == candidate.members);
                let Some(fit) = own.and_then(|(_, fit)| fit.as_mut()) else { continue };
                let of_part = |setting: &&Setting| candidate.members.contains(&setting.hypothesis);
                let there: Vec<Setting> = settings.iter().filter(of_part).cloned().collect();
                let start = Start { about: there.clone(), settings: there };
                if let Some(found) = refinement.fit(start, with_shapes)?.filter(|found| found.settled) {
                    take_if_better(candidate, fit, found);
                }
            }
            by_weight(&mut self.candidates);
            tried.push(leader);
        }
        Ok(())
    }

    /// Refines pairs of which a member has no size, a floor for instance: what such a cause does beside another is not the sum
    /// of what both do alone, as the search takes it to be.
    pub(in crate::diagnosis) fn refine_beside_sizeless(
        &mut self,
        linear: &Linear<'_>,
        refinement: &Refinement<'_>,
        monitor: &dyn Monitor,
    ) -> Result<(), Failure> {
        let is_sizeless = |h: &usize| !linear.hypotheses[*h].has_amplitude();
        let concerned = |members: &[usize]| members.len() == 2 && members.iter().any(is_sizeless);
        let pairs: Vec<usize> =
            (0..self.candidates.len()).filter(|&index| concerned(&self.candidates[index].members)).collect();
        self.refine_these(pairs, linear, refinement, monitor)
    }

    /// Refines so many pairs at most that explain most where one of both is taken about its own fit: where the model is far from
    /// linear, what is left beside a cause about the base is not what it leaves. Where a refinement falls short of what that
    /// foretells, it begins from there once more.
    pub(in crate::diagnosis) fn refine_beside_fits(
        &mut self,
        linear: &Linear<'_>,
        refinement: &Refinement<'_>,
        count: usize,
        monitor: &dyn Monitor,
    ) -> Result<(), Failure> {
        let mut pairs: Vec<(f64, usize, Start)> = Vec::new();
        for (index, pair) in self.candidates.iter().enumerate().filter(|_| count > 0) {
            checkpoint(monitor)?;
            let [a, b] = pair.members[..] else { continue };
            let of_both = [self.beside_fit(linear, a, b), self.beside_fit(linear, b, a)].into_iter().flatten();
            let most = of_both.max_by(|a, b| a.0.total_cmp(&b.0));
            pairs.extend(most.map(|(log_z, start)| (log_z, index, start)));
        }
        let weight = |pair: &(f64, usize, Start)| pair.0 + self.candidates[pair.1].log_prior;
        if let Some(nothing) = self.candidates.first().filter(|leader| leader.members.is_empty()) {
            pairs.retain(|pair| weight(pair) > nothing.log_weight() - HOPELESS);
        }
        pairs.sort_by(|a, b| weight(b).total_cmp(&weight(a)).then(a.1.cmp(&b.1)));
        pairs.truncate(count);
        let indices = pairs.iter().map(|(_, index, _)| *index).collect();
        let of_members =
            |(log_z, index, start): (f64, usize, Start)| (self.candidates[index].members.clone(), log_z, start);
        let foretold: Vec<_> = pairs.into_iter().map(of_members).collect();
        self.refine_these(indices, linear, refinement, monitor)?;
        for (members, log_z, start) in foretold {
            checkpoint(monitor)?;
            self.refine_again(&members, (log_z, start), refinement)?;
        }
        by_weight(&mut self.candidates);
        Ok(())
    }

    /// Logarithm of the evidence of two causes where the first is taken about its fit, and where they begin to be refined.
    fn beside_fit(&self, linear: &Linear<'_>, first: usize, second: usize) -> Option<(f64, Start)> {
        let alone = self.candidates.iter().find(|candidate| candidate.members == [first])?;
        let Beside { gain, start } = linear.beside(self.fit(&alone.members)?, second)?;
        Some((alone.log_z + gain, start))
    }

    /// Refines a set from another start where it explains less than is foretold of that.
    fn refine_again(
        &mut self,
        members: &[usize],
        (foretold, start): (f64, Start),
        refinement: &Refinement<'_>,
    ) -> Result<(), Failure> {
        let falls_short = |candidate: &&mut Candidate| candidate.members == members && candidate.log_z < foretold;
        let candidate = self.candidates.iter_mut().find(falls_short);
        let of_set = self.fits.iter_mut().find(|(of, _)| of == members).and_then(|(_, fit)| fit.as_mut());
        let (Some(candidate), Some(fit)) = (candidate, of_set) else { return Ok(()) };
        if let Some(again) = refinement.fit(start, fit.with_shapes)?.filter(|again| again.settled) {
            take_if_better(candidate, fit, again);
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
            let start = linear.start_of(candidate);
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
    pub(in crate::diagnosis) fn look_elsewhere(
        &mut self,
        linear: &Linear<'_>,
        refinement: &Refinement<'_>,
    ) -> Result<(), Failure> {
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

    /// Looks for other optima of the refined sets of a choice, which is told the evidence of the set that leads: a mass that swings
    /// at another frequency, a tooth that stands out to the other side. Alone they would be looked for there, too; the best one is
    /// the fit of its set from then on.
    pub(in crate::diagnosis) fn look_elsewhere_of(
        &mut self,
        choice: impl Fn(&Candidate, f64) -> bool,
        linear: &Linear<'_>,
        refinement: &Refinement<'_>,
        monitor: &dyn Monitor,
    ) -> Result<(), Failure> {
        let leads = self.candidates.iter().map(|candidate| candidate.log_z).fold(f64::NEG_INFINITY, f64::max);
        for candidate in self.candidates.iter_mut().filter(|candidate| choice(candidate, leads)) {
            checkpoint(monitor)?;
            let own = self.fits.iter_mut().find(|(of, _)| *of == candidate.members);
            let Some(fit) = own.and_then(|(_, fit)| fit.as_mut()) else { continue };
            if let Some(best) = elsewhere(candidate, fit, linear, refinement)?.into_iter().next() {
                take_if_better(candidate, fit, best);
            }
        }
        by_weight(&mut self.candidates);
        Ok(())
    }

    /// Log weight of every set, alone and, where it leads, beside a remainder.
    pub(in crate::diagnosis) fn weigh(
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
    pub(in crate::diagnosis) fn parts<'b>(
        &'b self,
        linear: &'b Linear<'_>,
        candidate: &Candidate,
    ) -> (Vec<&'b White>, White, Vec<Side>) {
        if let Some(fit) = self.fit(&candidate.members) {
            return (fit.columns.iter().collect(), fit.residual.clone(), fit.sides.clone());
        }
        let (columns, sides, residual) = linear.parts(&candidate.members, &candidate.variants);
        (columns, residual, sides)
    }

    fn set(&self, linear: &Linear<'_>, candidate: &Candidate, remainder: Option<Remainder>) -> SetWeight {
        let fit = self.fit(&candidate.members);
        let mut settings = fit.map_or_else(|| linear.settings(candidate), |fit| fit.settings.clone());
        let nothing = || settings.iter().map(|s| vec![0.0; s.values.len()]).collect();
        let mut standard_deviations: Vec<Vec<f64>> = fit.map_or_else(nothing, Fit::standard_deviations);
        // A shape that stays on its grid is uncertain, too, and widens the sizes.
        if fit.is_none_or(|fit| !fit.with_shapes) {
            for (own, spread) in standard_deviations.iter_mut().zip(&candidate.spread) {
                own.iter_mut().zip(spread).for_each(|(own, spread)| *own = own.max(*spread));
            }
        }
        if let (Some(fit), Some(remainder)) = (fit, &remainder) {
            fit.move_beside(remainder, linear.hypotheses, &mut settings, &mut standard_deviations);
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

/// Another fit of a set in the place of its own, where it explains more.
fn take_if_better(candidate: &mut Candidate, fit: &mut Fit, other: Fit) {
    if other.log_z > fit.log_z {
        candidate.log_z += other.log_z - fit.log_z;
        *fit = other;
    }
}

/// Refines from a point of the grids: with free shapes where that explains more than the mean over the grid, or, far from linear,
/// hardly less; else on it.
fn refine_from_grid(
    candidate: &mut Candidate,
    start: Start,
    linear: &Linear<'_>,
    refinement: &Refinement<'_>,
) -> Result<Option<Fit>, Failure> {
    let free = if linear.has_free_shapes(&candidate.members) {
        refinement.fit(start.clone(), true)?.filter(|fit| fit.with_shapes && fit.settled)
    } else {
        None
    };
    let explains_more = |log_z: f64| free.as_ref().is_some_and(|free| free.log_z >= log_z);
    if explains_more(candidate.log_z) {
        return Ok(free.inspect(|free| candidate.log_z = free.log_z));
    }
    let plain = refinement.fit(start, false)?;
    let has_no_grid = candidate.members.iter().all(|&h| linear.has_no_grid(h));
    let on_grid = match &plain {
        Some(plain) if has_no_grid => plain.log_z,
        Some(plain) if refinement.nonlinear => candidate.log_z + plain.log_z - candidate.best_log_z,
        _ => candidate.log_z,
    };
    // Shapes that are no part of the grid are known to nobody on it: a size there is as sure as if they were stated.
    let chosen = if refinement.nonlinear && explains_more(on_grid - PRICE_OF_SHAPES) { free } else { plain };
    candidate.log_z = match &chosen {
        Some(fit) if fit.with_shapes => fit.log_z.max(on_grid),
        _ => on_grid,
    };
    Ok(chosen)
}
