//! From posterior weights to a verdict that the tests beside it do not object to (`diagnosis/3.7`).

use crate::calculator::{Failure, Hypothesis, Monitor, Smooth};
use crate::diagnosis::causes::ranking::SetWeight;
use crate::diagnosis::causes::refine::Fit;
use crate::diagnosis::statistics::fairness::Left;
use crate::diagnosis::statistics::likelihood::Likelihood;
use crate::diagnosis::verdict::adequacy::Test;
use crate::diagnosis::verdict::class_tests::fit_of_classes;
use crate::diagnosis::verdict::weigh::Weighing;

/// Probability of a blunder from which on it is told.
pub(in crate::diagnosis) const POSSIBLE: f64 = 0.1;
/// Below this posterior of "nothing", something is wrong: an alarm needs a Bayes factor of about nine.
pub(in crate::diagnosis) const ALARM: f64 = 0.1;
/// Posterior of the remainder from which on the answer is "not in the catalogue".
pub(in crate::diagnosis) const UNNAMED: f64 = 0.5;
/// Posterior from which on a set is named.
const NAMED: f64 = 0.8;
/// Posterior from which on a set is named if every likely set contains it.
const NAMED_IF_COMMON: f64 = 0.5;
/// Share of the named posterior that the list of likely sets holds.
const LIKELY: f64 = 0.95;
/// Posterior of the remainder from which on no set is named: one in ten, as much as "nothing" may have in an alarm.
pub(in crate::diagnosis) const UNNAMED_MATTERS: f64 = ALARM;
/// Of rows along or round a part the share of the level at which a test speaks against the base. How neighbours hang together is
/// one number there, found from the rows: where it is a little too small, what goes smoothly looks many times less likely than
/// it is. Two of forty shafts with nothing hidden are rejected at the level itself.
const SHARE_OF_LEVEL: f64 = 1e-3;

/// How many times as heavy a set is as one that adds to it and is not listed therefore. Of 120 shafts with two causes lists of the middle
/// length fell from eight sets to three, and one truth of 105 was on none any more; by 4 and by 1 three and five were not.
const ADDS_LITTLE: f64 = 10.0;

/// Sets by their members, and the probability that classes drawn from what each foresees look as odd as those seen.
pub(super) type FitsOfClasses = Vec<(Vec<usize>, Option<f64>)>;

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

impl Weighing<'_> {
    /// Whether no test says that the base is wrong: neither one of the family, nor what it leaves.
    fn base_stands(&self, level: f64) -> bool {
        let is_ordered = self.foundation.data.layout.design.smooth != Smooth::None;
        let level = if is_ordered { level * SHARE_OF_LEVEL } else { level };
        let fits = self.sets.iter().find(|set| set.members.is_empty() && set.remainder.is_none());
        let objects = |test: &Test| test.kind.is_of_base() && test.p_holm < level;
        !self.tests.iter().any(objects) && fits.is_none_or(|base| self.is_fair(base, level))
    }

    /// The likely sets against classes that are drawn from what each foresees.
    pub(super) fn tested_on_classes(&self, sides: &[f64], monitor: &dyn Monitor) -> Result<FitsOfClasses, Failure> {
        let of_set = |set: &&SetWeight| {
            let margins = self.margins(set);
            let fit = margins.map(|margins| fit_of_classes(self, margins, sides, monitor)).transpose()?;
            Ok((set.members.clone(), fit.flatten()))
        };
        self.likely_sets().iter().map(of_set).collect()
    }

    /// Margins of the rows that count in standard deviations of their scatter where a set is at its most probable.
    fn margins(&self, set: &SetWeight) -> Option<Vec<f64>> {
        let candidate = self.ranking.candidates.iter().find(|candidate| candidate.members == set.members)?;
        let (columns, residual, sides) = self.ranking.parts(&self.linear, candidate);
        let t = self.linear.likelihood.evidence(&columns, &residual, &sides)?.t;
        // What is left of classes is minus the margin.
        let mut margins: Vec<f64> = residual.own().iter().map(|left| -left).collect();
        for (t, column) in t.iter().zip(&columns) {
            margins.iter_mut().zip(column.own()).for_each(|(margin, column)| *margin += t * column);
        }
        Some(margins)
    }

    /// The sets that hold most of what is named, heaviest first.
    fn likely_sets(&self) -> Vec<&SetWeight> {
        let of_named: f64 = self.named_sets().map(|set| set.posterior).sum();
        let mut held = 0.0;
        self.named_sets()
            .take_while(|set| {
                let is_wanted = held < LIKELY * of_named;
                held += set.posterior;
                is_wanted
            })
            .collect()
    }

    /// Whether the rows do not object to a set.
    fn is_fair(&self, set: &SetWeight, level: f64) -> bool {
        self.lack_of_fit(set).is_none_or(|probability| probability >= level)
    }

    pub(super) fn judged(&self, level: f64) -> Verdict {
        let (none, unnamed) = (self.none, self.unnamed);
        let quiet = none >= ALARM;
        if quiet && self.base_stands(level) {
            return Verdict::Adequate;
        }
        // Where rows object to a base that is likely, what is left to choose from is all else.
        let whole = if quiet { 1.0 - none } else { 1.0 };
        if unnamed >= UNNAMED * whole {
            let leading = self.sets.iter().find(|set| set.remainder.is_some());
            return Verdict::Unknown(leading.map_or_else(Vec::new, |set| set.members.clone()));
        }
        let mut likely = self.likely_sets();
        let held: f64 = likely.iter().map(|set| set.posterior).sum();
        if let Some(leader) = likely.first() {
            let in_all = likely.iter().all(|set| leader.members.iter().all(|h| set.members.contains(h)));
            let leads = leader.posterior >= NAMED || (leader.posterior >= NAMED_IF_COMMON && in_all);
            // The best of the catalogue, and the rows still object.
            if leads && !self.is_fair(leader, level) {
                return Verdict::Unknown(Vec::new());
            }
            // At its limit a size is not what the data ask for: something else acts, or the limit is wrong.
            let at_limit =
                self.fit(&leader.members).is_some_and(|fit| at_limit(fit, self.foundation.subject.hypotheses()));
            if leads && unnamed < UNNAMED_MATTERS && !at_limit {
                return Verdict::Named(leader.members.clone());
            }
        }
        likely.retain(|set| self.is_fair(set, level));
        let fair: f64 = likely.iter().map(|set| set.posterior).sum();
        // Of what is likely by name more than half does not fit.
        if fair < UNNAMED * held || likely.is_empty() {
            return Verdict::Unknown(Vec::new());
        }
        let weighed: Vec<(&[usize], f64)> = likely.iter().map(|set| (set.members.as_slice(), set.posterior)).collect();
        Verdict::Confounded(without_companions(&weighed))
    }

    /// Beside rows that may have been written down wrongly no set is named, however much it explains.
    pub(in crate::diagnosis) fn doubt(&mut self, of_blunders: f64) {
        if let (true, Verdict::Named(members)) = (of_blunders >= POSSIBLE, &self.verdict) {
            self.verdict = Verdict::Confounded(vec![members.clone()]);
        }
    }

    /// Probability that rows scatter so far from a set or farther, if nothing else acts; see [`Left::probability`], of classes
    /// [`fit_of_classes`]. `None` beside a remainder, and of classes where a set is not likely.
    pub(in crate::diagnosis) fn lack_of_fit(&self, set: &SetWeight) -> Option<f64> {
        let Likelihood::Gaussian { whitener, .. } = &self.linear.likelihood else {
            let fit = self.fits_of_classes.iter().find(|(members, _)| *members == set.members);
            return fit.filter(|_| set.remainder.is_none()).and_then(|(_, probability)| *probability);
        };
        let candidate = self.ranking.candidates.iter().find(|candidate| candidate.members == set.members)?;
        let (columns, residual, _) = self.ranking.parts(&self.linear, candidate);
        let left = Left { columns, residual: &residual, rows: whitener.rows(), noise: &self.noise };
        if set.remainder.is_some() { None } else { left.probability(&self.low_order) }
    }

    /// Sets without a remainder, heaviest first.
    pub fn named_sets(&self) -> impl Iterator<Item = &SetWeight> {
        self.sets.iter().filter(|set| set.remainder.is_none() && !set.members.is_empty())
    }
}

/// Sets with their weights, heaviest first, without those that only add to one that is [`ADDS_LITTLE`] times as heavy: what they add is
/// rather not there than there. Where one set would be left all stand, since what the rows leave open is just what is added.
fn without_companions(sets: &[(&[usize], f64)]) -> Vec<Vec<usize>> {
    let adds_to = |(set, weight): &(&[usize], f64), (other, heavier): &(&[usize], f64)| {
        other.len() < set.len() && other.iter().all(|h| set.contains(h)) && *heavier >= ADDS_LITTLE * weight
    };
    let mut kept: Vec<(&[usize], f64)> = Vec::new();
    for set in sets {
        if !kept.iter().any(|heavier| adds_to(set, heavier)) {
            kept.push(*set);
        }
    }
    let listed = if kept.len() > 1 { &kept } else { sets };
    listed.iter().map(|(set, _)| set.to_vec()).collect()
}

/// Whether the size of a cause lies at its physical limit; absent, at 0, is no limit, and of several sizes
/// of one cause the first counts.
fn at_limit(fit: &Fit, hypotheses: &[Hypothesis]) -> bool {
    fit.settings.iter().any(|setting| {
        let hypothesis = &hypotheses[setting.hypothesis];
        hypothesis.amplitudes().next().is_some_and(|(index, _)| {
            let (range, value) = (hypothesis.variables[index].range, setting.values[index]);
            let near = |bound: f64| (value - bound).abs() < 1e-9 * (range.upper - range.lower);
            let is_absent = range.lower + hypothesis.counted_from(index) >= 0.0;
            (near(range.lower) && !is_absent) || near(range.upper)
        })
    })
}

#[cfg(test)]
mod tests {
    use super::without_companions;

    #[test]
    fn a_set_that_adds_to_a_heavier_one_is_not_listed() {
        let sets: [(&[usize], f64); 6] =
            [(&[1], 0.4), (&[2, 3], 0.2), (&[1, 5], 0.15), (&[2], 0.08), (&[1, 4], 0.03), (&[0, 1, 4], 0.02)];
        assert_eq!(without_companions(&sets), [vec![1], vec![2, 3], vec![1, 5], vec![2]]);
    }

    #[test]
    fn where_all_add_to_one_set_all_are_listed() {
        let sets: [(&[usize], f64); 3] = [(&[1], 0.8), (&[1, 4], 0.08), (&[1, 2], 0.05)];
        assert_eq!(without_companions(&sets), [vec![1], vec![1, 4], vec![1, 2]]);
    }
}
