//! From rows to posterior weights and a verdict (`diagnosis/3.5`, `diagnosis/3.7`).

use crate::calculator::{Failure, Hypothesis, Monitor, Smooth};
use crate::diagnosis::causes::optima::Peak;
use crate::diagnosis::causes::profile::{Profile, Profiler};
use crate::diagnosis::causes::ranking::{Ranking, SetWeight};
use crate::diagnosis::causes::refine::{Fit, Refinement};
use crate::diagnosis::causes::search::{Candidate, Linear};
use crate::diagnosis::rows::link;
use crate::diagnosis::rows::noise::Noise;
use crate::diagnosis::statistics::discrepancy::{self, Kind, Remainder};
use crate::diagnosis::statistics::evidence::{Normal, log_sum_exp};
use crate::diagnosis::statistics::fairness::Left;
use crate::diagnosis::statistics::likelihood::Likelihood;
use crate::diagnosis::statistics::whiten::{White, Whitener};
use crate::diagnosis::verdict::adequacy::{Test, adequacy};
use crate::diagnosis::verdict::foundation::Foundation;

/// Probability of a blunder from which on it is told.
pub(in crate::diagnosis) const POSSIBLE: f64 = 0.1;
/// Singles with which pairs are made, and pairs with which triples are, where a part of the rows is held back or every
/// prediction is a simulation; of the whole all singles and more pairs are.
const LEADING_SINGLES: usize = 6;
const LEADING_PAIRS: usize = 6;
const PAIRS_OF_WHOLE: usize = 20;
/// Pairs that are refined beside those that lead from the base, see [`Effort::beside_fits`].
const PAIRS_BESIDE_FITS: usize = 12;
/// A set whose evidence is below that of the leader by no more than this may lead from another of its optima.
const NEAR: f64 = 2.0;
/// Sets that are refined about the model itself.
const LEADERS: usize = 12;
/// Sets that lead only after the others were refined, and are then refined too.
const LATE_LEADERS: usize = 6;
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

/// Free sizes of a remainder up to which its band is computed: beyond, a triangular solution for every row takes longer
/// than everything else.
const MOST_FREE_SIZES: usize = 200;

/// Of which sets other optima are looked for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum OtherOptima {
    /// Of none.
    None,
    /// Of the set that leads.
    OfLeader,
    /// Of every single cause, too, and of every set that may yet lead.
    OfAll,
}

/// How far the search goes, and how badly a set may fit that is named.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Effort {
    /// Causes at the same time, 0 to 3.
    pub most_causes: usize,
    /// Heaviest singles that may have partners, and heaviest pairs that may have a third.
    pub leading: [usize; 2],
    /// Sets that are refined about the model itself.
    pub leaders: usize,
    /// Of the sets of none, one, two and three causes those that are refined in any case: from the base a single cause
    /// of a model that is far from linear looks worse than a set that mimics it.
    pub of_each_size: [usize; 4],
    /// Pairs that are refined since they explain most where one of both is taken about its own fit.
    pub beside_fits: usize,
    /// How often those that lead only after others were refined are refined, too, and how many each time.
    pub rounds: usize,
    /// See `rounds`.
    pub late_leaders: usize,
    /// Whether the model is far from linear in its sizes: then a refinement takes more steps, and what it changes at
    /// the best point of a grid corrects the whole grid.
    pub nonlinear: bool,
    /// Of which sets other optima are looked for.
    pub other_optima: OtherOptima,
    /// Least probability of what a set leaves for it to be named, and of what the base leaves for it to be adequate.
    pub level: f64,
    /// Whether a part of the rows is held back: then of classes, whose test of the base draws thousands, it is not tested.
    pub in_fold: bool,
}

/// Significance level of the tests unless another is asked for.
pub(in crate::diagnosis) const LEVEL: f64 = 0.01;

impl Effort {
    /// The whole search.
    pub fn full(most_causes: usize) -> Self {
        Self {
            most_causes,
            leading: [usize::MAX, PAIRS_OF_WHOLE],
            leaders: LEADERS,
            of_each_size: [0, usize::MAX, 0, 0],
            beside_fits: 0,
            rounds: 1,
            late_leaders: LATE_LEADERS,
            nonlinear: false,
            other_optima: OtherOptima::OfLeader,
            level: LEVEL,
            in_fold: false,
        }
    }

    /// The same in a fold.
    pub fn fold(most_causes: usize) -> Self {
        Self {
            leading: [LEADING_SINGLES, LEADING_PAIRS],
            of_each_size: [0; 4],
            in_fold: true,
            ..Self::full(most_causes)
        }
    }

    /// Where every prediction is a simulation: fewer sets. Every single cause is looked for wherever it would be if it were
    /// asked for alone: a tool that is pushed off looks worse from the base than many that mimic it, and from one frequency a
    /// second mode is not found that swings at another.
    pub fn dear(most_causes: usize) -> Self {
        Self {
            most_causes,
            leading: [LEADING_SINGLES, LEADING_PAIRS],
            leaders: 1,
            of_each_size: [0, usize::MAX, 3, 1],
            beside_fits: PAIRS_BESIDE_FITS,
            rounds: 3,
            late_leaders: 2,
            nonlinear: true,
            other_optima: OtherOptima::OfAll,
            level: LEVEL,
            in_fold: false,
        }
    }

    /// Where every prediction is a simulation, or else the whole search.
    pub(in crate::diagnosis) fn of(most_causes: usize, is_dear: bool) -> Self {
        if is_dear { Self::dear(most_causes) } else { Self::full(most_causes) }
    }

    /// The same in a fold.
    pub fn dear_fold(most_causes: usize) -> Self {
        Self {
            most_causes,
            leading: [LEADING_SINGLES, LEADING_PAIRS],
            leaders: 1,
            of_each_size: [0, 2, 1, 0],
            beside_fits: 0,
            rounds: 1,
            late_leaders: 1,
            nonlinear: true,
            other_optima: OtherOptima::None,
            level: LEVEL,
            in_fold: true,
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

/// All sets of causes weighed against each other, against nothing, and against a remainder without a name.
pub struct Weighing<'a> {
    pub(in crate::diagnosis) foundation: &'a Foundation<'a>,
    /// Rows that count.
    pub keep: Vec<bool>,
    /// Scatter of the rows.
    pub noise: Noise,
    /// Distances between predictions in standard deviations; of classes about the leading set.
    pub(in crate::diagnosis) whitener: Whitener,
    pub(in crate::diagnosis) linear: Linear<'a>,
    /// Whitened regressors of an unordered design.
    low_order: Vec<White>,
    ranking: Ranking,
    pub(in crate::diagnosis) kinds: Vec<Kind>,
    /// All sets, heaviest first.
    pub sets: Vec<SetWeight>,
    /// Posterior of "nothing is wrong".
    pub none: f64,
    /// Posterior of all sets with an unnamed remainder.
    pub unnamed: f64,
    /// Logarithm of the evidence of all sets together, each by its prior: comparable between tables of as many rows.
    pub(in crate::diagnosis) log_evidence: f64,
    /// Posterior that a hypothesis takes part, for every hypothesis.
    pub inclusion: Vec<f64>,
    /// Tests of the base.
    pub tests: Vec<Test>,
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
        let scattering = foundation.scattering(&keep);
        let noise = Noise::of(data, residual, &scattering, foundation.heavy_tails.as_deref());
        let likelihood = Likelihood::of(data, &noise, nuisances, &keep);
        let linear = Linear::new(subject.hypotheses(), signatures, likelihood, residual);
        let candidates = linear.search(effort.most_causes, effort.leading, monitor)?;
        let refinement = Refinement {
            subject: *subject,
            value: &data.value,
            keep: &keep,
            likelihood: &linear.likelihood,
            misfit_of_base: linear.likelihood.misfit(&linear.residual),
            nonlinear: effort.nonlinear,
            monitor,
        };
        let mut ranking = Ranking::new(candidates);
        ranking.refine(&linear, &refinement, effort.leaders, effort.of_each_size, monitor)?;
        if effort.other_optima == OtherOptima::OfAll {
            ranking.look_elsewhere_of(|set, _| set.members.len() == 1, &linear, &refinement, monitor)?;
        }
        ranking.refine_beside_fits(&linear, &refinement, effort.beside_fits, monitor)?;
        for _ in 0..effort.rounds {
            ranking.refine(&linear, &refinement, effort.late_leaders, [0; 4], monitor)?;
        }
        if !effort.nonlinear && !effort.in_fold {
            ranking.refine_beside_sizeless(&linear, &refinement, monitor)?;
        }
        ranking.refine_parts(&linear, &refinement, monitor)?;
        if effort.other_optima == OtherOptima::OfAll {
            let is_near = |set: &Candidate, leads: f64| set.members.len() > 1 && set.log_z > leads - NEAR;
            ranking.look_elsewhere_of(is_near, &linear, &refinement, monitor)?;
        }
        if effort.other_optima != OtherOptima::None {
            ranking.look_elsewhere(&linear, &refinement)?;
        }
        let kinds = discrepancy::kinds(data, &linear.likelihood, noise.sigma, foundation.unnamed.as_deref(), monitor)?;
        let mut weighed = ranking.weigh(&linear, &kinds, monitor)?;
        let total = log_sum_exp(&weighed.iter().map(|set| set.0).collect::<Vec<_>>());
        weighed.sort_by(|a, b| b.0.total_cmp(&a.0).then_with(|| a.1.members.cmp(&b.1.members)));
        let sets: Vec<SetWeight> = weighed
            .into_iter()
            .map(|(log_weight, set)| SetWeight { posterior: (log_weight - total).exp(), ..set })
            .collect();
        let sum = |choose: &dyn Fn(&SetWeight) -> bool| -> f64 {
            // An empty sum of floats is -0. The last digit of many shares may lie beyond all of them.
            sets.iter().filter(|set| choose(set)).fold(0.0, |sum: f64, set| sum + set.posterior).min(1.0)
        };
        let none = sum(&|set| set.members.is_empty() && set.remainder.is_none());
        let unnamed = sum(&|set| set.remainder.is_some());
        let inclusion = (0..subject.hypotheses().len()).map(|h| sum(&|set| set.members.contains(&h))).collect();
        let whitener = match &linear.likelihood {
            Likelihood::Gaussian { whitener, .. } => whitener.clone(),
            Likelihood::Classes(_) => about_leader(foundation, &sets, &noise, &keep)?,
        };
        let log_evidence = total - 0.5 * whitener.log_det();
        let low_order: Vec<White> = data.layout.design.regressors.iter().map(|column| whitener.white(column)).collect();
        let mut weighing = Self {
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
            log_evidence,
            inclusion,
            tests: Vec::new(),
            verdict: Verdict::Adequate,
        };
        if data.sides.is_none() || !effort.in_fold {
            weighing.tests = adequacy(&weighing, monitor)?;
        }
        weighing.verdict = weighing.judged(effort.level);
        Ok(weighing)
    }

    /// Whether no test says that the base is wrong: neither one of the family, nor what it leaves.
    fn base_stands(&self, level: f64) -> bool {
        let is_ordered = self.foundation.data.layout.design.smooth != Smooth::None;
        let level = if is_ordered { level * SHARE_OF_LEVEL } else { level };
        let fits = self.sets.iter().find(|set| set.members.is_empty() && set.remainder.is_none());
        let objects = |test: &Test| test.kind.is_of_base() && test.p_holm < level;
        !self.tests.iter().any(objects) && fits.is_none_or(|base| self.is_fair(base, level))
    }

    /// Whether the rows do not object to a set.
    fn is_fair(&self, set: &SetWeight, level: f64) -> bool {
        self.lack_of_fit(set).is_none_or(|probability| probability >= level)
    }

    fn judged(&self, level: f64) -> Verdict {
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
        let of_named: f64 = self.named_sets().map(|set| set.posterior).sum();
        let mut likely: Vec<&SetWeight> = Vec::new();
        let mut held = 0.0;
        for set in self.named_sets() {
            if held >= LIKELY * of_named {
                break;
            }
            held += set.posterior;
            likely.push(set);
        }
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
        Verdict::Confounded(likely.iter().map(|set| set.members.clone()).collect())
    }

    /// Beside rows that may have been written down wrongly no set is named, however much it explains.
    pub(in crate::diagnosis) fn doubt(&mut self, of_blunders: f64) {
        if let (true, Verdict::Named(members)) = (of_blunders >= POSSIBLE, &self.verdict) {
            self.verdict = Verdict::Confounded(vec![members.clone()]);
        }
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
    pub(in crate::diagnosis) fn fit(&self, members: &[usize]) -> Option<&Fit> {
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
            misfit_of_base: self.linear.likelihood.misfit(&self.linear.residual),
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

    /// Probability that rows scatter so far from a set or farther, if nothing else acts; see [`Left::probability`]. `None`
    /// of classes, and beside a remainder.
    pub(in crate::diagnosis) fn lack_of_fit(&self, set: &SetWeight) -> Option<f64> {
        let Likelihood::Gaussian { whitener, .. } = &self.linear.likelihood else { return None };
        let candidate = self.ranking.candidates.iter().find(|candidate| candidate.members == set.members)?;
        let (columns, residual, _) = self.ranking.parts(&self.linear, candidate);
        let left = Left { columns, residual: &residual, rows: whitener.rows(), noise: &self.noise };
        if set.remainder.is_some() { None } else { left.probability(&self.low_order) }
    }

    /// n ln(RSS/n) + k ln n of a set without a remainder, RSS whitened and at the fit without priors. Where it has a
    /// remainder its sizes are as many as one likes, and there is none; nor of classes.
    pub(in crate::diagnosis) fn bic(&self, set: &SetWeight) -> Option<f64> {
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
    pub(in crate::diagnosis) fn remainder_deviation(
        &self,
        set: &SetWeight,
        kind: &Kind,
        remainder: &Remainder,
    ) -> Option<Vec<f64>> {
        if kind.columns.len() > MOST_FREE_SIZES {
            return None;
        }
        let candidate = self.ranking.candidates.iter().find(|candidate| candidate.members == set.members)?;
        let (columns, residual, _) = self.ranking.parts(&self.linear, candidate);
        kind.deviation(remainder, &columns, &residual, &self.linear.likelihood)
    }

    /// What a row costs a prediction that leaves so much: the square; of a class, and of a value beside classes, twice
    /// minus the logarithm of its probability.
    pub(in crate::diagnosis) fn loss(&self, row: usize, left: f64) -> f64 {
        match &self.foundation.data.sides {
            None => left * left,
            Some(sides) => -2.0 * link::log_likelihood(sides[row], -left / self.scatter(row)),
        }
    }

    /// Standard deviation of a row about its prediction, without allowances.
    pub(in crate::diagnosis) fn scatter(&self, row: usize) -> f64 {
        self.noise.per_row.as_ref().map_or(self.noise.sigma, |own| own[row])
    }

    /// Variance of a row: scatter and allowances.
    pub(in crate::diagnosis) fn own_variance(&self, row: usize) -> f64 {
        let sigma = self.noise.per_row.as_ref().map_or(self.noise.sigma, |own| own[row]);
        sigma * sigma + self.foundation.allowed[row]
    }

    /// Columns of a fit in the coordinates of `whitener`, each up to a factor.
    pub(in crate::diagnosis) fn directions(&self, fit: &Fit) -> Vec<White> {
        match &self.linear.likelihood {
            Likelihood::Gaussian { .. } => fit.columns.clone(),
            Likelihood::Classes(_) => fit.slopes.iter().map(|slope| self.whitener.white(slope)).collect(),
        }
    }

    /// Rows of a run that count.
    pub(in crate::diagnosis) fn rows_of_run(&self, run: usize) -> Vec<usize> {
        let sweeps = self.foundation.data.layout.kept_traces(&self.keep);
        sweeps.into_iter().filter(|(of, _)| *of == run).flat_map(|(_, rows)| rows).collect()
    }

    /// Logarithm of the largest evidence that any set of causes has, the empty one among them, without its prior.
    pub fn best_evidence(&self) -> f64 {
        self.ranking.candidates.iter().map(|candidate| candidate.log_z).fold(f64::NEG_INFINITY, f64::max)
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
    let informed = match &foundation.data.sides {
        Some(sides) => noise.informed(sides, &margin),
        None => noise.clone(),
    };
    Ok(Whitener::new(foundation.data, &informed, &foundation.nuisances, keep))
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
