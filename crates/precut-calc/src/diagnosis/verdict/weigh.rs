//! From rows to posterior weights (`diagnosis/3.5`).

use crate::calculator::{Failure, Monitor};
use crate::diagnosis::causes::optima::Peak;
use crate::diagnosis::causes::profile::{Profile, Profiler};
use crate::diagnosis::causes::ranking::{Ranking, SetWeight};
use crate::diagnosis::causes::refine::{Fit, Refinement};
use crate::diagnosis::causes::search::{Candidate, Linear};
use crate::diagnosis::rows::link;
use crate::diagnosis::rows::noise::Noise;
use crate::diagnosis::statistics::discrepancy::{self, Kind, Remainder};
use crate::diagnosis::statistics::evidence::{Normal, log_sum_exp};
use crate::diagnosis::statistics::likelihood::Likelihood;
use crate::diagnosis::statistics::whiten::{White, Whitener};
use crate::diagnosis::verdict::adequacy::{Test, adequacy};
use crate::diagnosis::verdict::effort::{Effort, OtherOptima};
use crate::diagnosis::verdict::foundation::Foundation;
use crate::diagnosis::verdict::judge::{FitsOfClasses, Verdict};

/// A set whose evidence is below that of the leader by no more than this may lead from another of its optima.
const NEAR: f64 = 2.0;
/// Sets of several causes that may, too, with whatever evidence: where shapes are free another optimum may have far more. A support
/// out of place beside a runout at a ratio of 7.94 had 24 less than at 8.09, its best.
const FAR: usize = 4;

/// Free sizes of a remainder up to which its band is computed: beyond, a triangular solution for every row takes longer
/// than everything else.
const MOST_FREE_SIZES: usize = 200;

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
    pub(super) low_order: Vec<White>,
    pub(super) ranking: Ranking,
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
    /// Of classes, of the likely sets.
    pub(super) fits_of_classes: FitsOfClasses,
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
            let heaviest = ranking.heaviest_with_shapes(FAR);
            let is_near = |set: &Candidate, leads: f64| {
                set.members.len() > 1 && (set.log_z > leads - NEAR || heaviest.contains(&set.members))
            };
            ranking.look_elsewhere_of(is_near, &linear, &refinement, monitor)?;
            ranking.refine_parts_from_leader(&refinement, monitor)?;
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
            fits_of_classes: Vec::new(),
            verdict: Verdict::Adequate,
        };
        if data.sides.is_none() || !effort.in_fold {
            weighing.tests = adequacy(&weighing, monitor)?;
        }
        if let (Some(sides), false) = (&data.sides, effort.in_fold) {
            weighing.fits_of_classes = weighing.tested_on_classes(sides, monitor)?;
        }
        weighing.verdict = weighing.judged(effort.level);
        Ok(weighing)
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
