//! From rows to posterior weights and a verdict (`diagnosis/3.5`, `diagnosis/3.7`).

use super::data::Data;
use super::discrepancy::{self, Kind, Remainder};
use super::evidence::{Scale, Side, log_sum_exp};
use super::noise::Noise;
use super::outlier::{Outliers, outliers};
use super::refine::{Fit, Refinement};
use super::search::{Candidate, Linear, Signatures, by_weight};
use super::subject::{Setting, Subject};
use super::whiten::{White, Whitener};
use crate::calculator::{Failure, Message, Monitor, checkpoint};

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
const UNNAMED: f64 = 0.5;
/// Posterior from which on a set is named.
const NAMED: f64 = 0.8;
/// Posterior from which on a set is named if every likely set contains it.
const NAMED_IF_COMMON: f64 = 0.5;
/// Share of the named posterior that the list of likely sets holds.
const LIKELY: f64 = 0.95;

/// What the search may do.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Settings {
    /// Causes at the same time, 0 to 3.
    pub most_causes: usize,
    /// Whether rows that stand alone are left out.
    pub leave_outliers_out: bool,
}

impl Default for Settings {
    fn default() -> Self {
        Self { most_causes: 3, leave_outliers_out: true }
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
    /// Whether an unnamed remainder stands beside them.
    pub with_remainder: bool,
    /// Fitted values.
    pub settings: Vec<Setting>,
    /// Posterior standard deviations of the values, 0 where they are stated.
    pub standard_deviations: Vec<Vec<f64>>,
    /// Whether the model itself was linearised at the optimum.
    pub refined: bool,
}

/// Everything that the later steps need.
#[derive(Debug, Clone, PartialEq)]
pub struct Diagnosed {
    /// The verdict.
    pub verdict: Verdict,
    /// All sets, heaviest first.
    pub sets: Vec<SetWeight>,
    /// Posterior of "nothing is wrong".
    pub none: f64,
    /// Posterior of all sets with an unnamed remainder.
    pub unnamed: f64,
    /// Scatter of the rows.
    pub noise: Noise,
    /// Rows that stand alone.
    pub outliers: Outliers,
    /// Posterior that a hypothesis takes part, for every hypothesis.
    pub inclusion: Vec<f64>,
    /// Hypotheses whose signature is too small to be seen in these rows.
    pub invisible: Vec<usize>,
}

/// Weighs all sets of causes against each other, against nothing, and against a remainder without a name.
pub fn diagnose(
    subject: &dyn Subject,
    data: &Data,
    settings: Settings,
    monitor: &dyn Monitor,
) -> Result<Diagnosed, Failure> {
    let base = subject.predict(&[])?;
    let predicted: Vec<bool> = base.iter().map(Result::is_ok).collect();
    let base: Vec<f64> = base.into_iter().map(|f| f.unwrap_or(0.0)).collect();
    let signatures = Signatures::of(subject, &base, monitor)?;
    let nuisances = subject.nuisances()?;
    let residual: Vec<f64> =
        data.value.iter().zip(&base).zip(&predicted).map(|((y, f), ok)| if *ok { y - f } else { 0.0 }).collect();
    let found = if settings.leave_outliers_out {
        outliers(data, &residual)
    } else {
        Outliers { rows: Vec::new(), too_many: false }
    };
    let keep: Vec<bool> = found.keep(data.value.len()).iter().zip(&predicted).map(|(a, b)| *a && *b).collect();
    let noise = Noise::of(data, &residual, &keep);
    let whitener = Whitener::new(data, &noise, &nuisances, &keep);
    let scale = Scale::of(&noise);
    let linear = Linear::new(subject.hypotheses(), &signatures, &whitener, &residual, scale);
    monitor.progress(0.2, Message::new("diagnosis_search"));
    let candidates = linear.search(settings.most_causes, monitor)?;
    let refinement = Refinement { subject, value: &data.value, keep: &keep, whitener: &whitener, scale };
    let mut ranking = Ranking { candidates, fits: Vec::new() };
    ranking.refine(&linear, &refinement, LEADERS, monitor)?;
    ranking.refine(&linear, &refinement, LATE_LEADERS, monitor)?;
    monitor.progress(0.6, Message::new("diagnosis_remainder"));
    let kinds = discrepancy::kinds(data, &whitener, noise.sigma);
    let mut weighed = ranking.weigh(&linear, &kinds, monitor)?;
    let total = log_sum_exp(&weighed.iter().map(|set| set.0).collect::<Vec<_>>());
    weighed.sort_by(|a, b| b.0.total_cmp(&a.0).then_with(|| a.1.members.cmp(&b.1.members)));
    let sets: Vec<SetWeight> = weighed
        .into_iter()
        .map(|(log_weight, set)| SetWeight { posterior: (log_weight - total).exp(), ..set })
        .collect();
    let sum =
        |choose: &dyn Fn(&SetWeight) -> bool| sets.iter().filter(|set| choose(set)).map(|set| set.posterior).sum();
    let none = sum(&|set| set.members.is_empty() && !set.with_remainder);
    let unnamed = sum(&|set| set.with_remainder);
    let inclusion = (0..subject.hypotheses().len()).map(|h| sum(&|set| set.members.contains(&h))).collect();
    let invisible = (0..subject.hypotheses().len()).filter(|h| !linear.visible.contains(h)).collect();
    let verdict = verdict(&sets, none, unnamed);
    Ok(Diagnosed { verdict, sets, none, unnamed, noise, outliers: found, inclusion, invisible })
}

/// Candidates, and the fits of those that were refined.
struct Ranking {
    candidates: Vec<Candidate>,
    fits: Vec<(Vec<usize>, Option<Fit>)>,
}

impl Ranking {
    fn fit(&self, members: &[usize]) -> Option<&Fit> {
        self.fits.iter().find(|(of, _)| of == members).and_then(|(_, fit)| fit.as_ref())
    }

    /// Refines the heaviest sets that are not refined yet, and gives them the evidence found there.
    fn refine(
        &mut self,
        linear: &Linear<'_>,
        refinement: &Refinement<'_>,
        count: usize,
        monitor: &dyn Monitor,
    ) -> Result<(), Failure> {
        let leaders: Vec<usize> = (0..self.candidates.len().min(count)).collect();
        for index in leaders {
            checkpoint(monitor)?;
            let candidate = &mut self.candidates[index];
            if candidate.members.is_empty() || self.fits.iter().any(|(of, _)| *of == candidate.members) {
                continue;
            }
            let start = linear.settings(candidate);
            let plain = refinement.fit(start.clone(), false)?;
            let free = refinement.fit(start, true)?.filter(|fit| fit.with_shapes && fit.settled);
            let fit = match (plain, free) {
                // Where free shapes explain less than the mean over the grid, the grid stays.
                (plain, Some(free)) if free.log_z >= candidate.log_z => {
                    candidate.log_z = free.log_z;
                    let _ = plain;
                    Some(free)
                }
                (Some(plain), _) => {
                    if linear.settings(candidate).iter().all(|s| linear.has_no_grid(s.hypothesis)) {
                        candidate.log_z = plain.log_z;
                    }
                    Some(plain)
                }
                (None, _) => None,
            };
            self.fits.push((candidate.members.clone(), fit));
        }
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
            self.candidates.iter().map(|c| (c.log_weight(), self.set(linear, c, false))).collect();
        let empty = self.candidates.iter().filter(|c| c.members.is_empty());
        let leading = self.candidates.iter().filter(|c| !c.members.is_empty()).take(WITH_REMAINDER - 1);
        for candidate in empty.chain(leading) {
            checkpoint(monitor)?;
            if let Some(remainder) = self.beside(linear, kinds, candidate) {
                let log_weight = remainder.log_z + candidate.log_prior + REMAINDER_PRIOR.ln();
                weighed.push((log_weight, self.set(linear, candidate, true)));
            }
        }
        Ok(weighed)
    }

    fn beside(&self, linear: &Linear<'_>, kinds: &[Kind], candidate: &Candidate) -> Option<Remainder> {
        let (columns, residual, sides): (Vec<&White>, White, Vec<Side>) = match self.fit(&candidate.members) {
            Some(fit) => (fit.columns.iter().collect(), fit.residual.clone(), fit.sides.clone()),
            None => {
                let (columns, sides, residual) = linear.parts(&candidate.members, &candidate.variants);
                (columns, residual, sides)
            }
        };
        discrepancy::beside(kinds, &columns, &residual, &sides, linear.scale, linear.rows)
    }

    fn set(&self, linear: &Linear<'_>, candidate: &Candidate, with_remainder: bool) -> SetWeight {
        let fit = self.fit(&candidate.members);
        let settings = fit.map_or_else(|| linear.settings(candidate), |fit| fit.settings.clone());
        let mut standard_deviations: Vec<Vec<f64>> = settings.iter().map(|s| vec![0.0; s.values.len()]).collect();
        if let Some(fit) = fit {
            for (k, &(member, variable)) in fit.free.iter().enumerate() {
                standard_deviations[member][variable] = fit.covariance[(k, k)].sqrt();
            }
        }
        SetWeight {
            members: candidate.members.clone(),
            posterior: 0.0,
            with_remainder,
            settings,
            standard_deviations,
            refined: fit.is_some(),
        }
    }
}

fn verdict(sets: &[SetWeight], none: f64, unnamed: f64) -> Verdict {
    if none >= ALARM {
        return Verdict::Adequate;
    }
    if unnamed >= UNNAMED {
        let leading = sets.iter().find(|set| set.with_remainder);
        return Verdict::Unknown(leading.map_or_else(Vec::new, |set| set.members.clone()));
    }
    let named: Vec<&SetWeight> = sets.iter().filter(|set| !set.with_remainder && !set.members.is_empty()).collect();
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
        if leader.posterior >= NAMED || (leader.posterior >= NAMED_IF_COMMON && in_all) {
            return Verdict::Named(leader.members.clone());
        }
    }
    Verdict::Confounded(likely.iter().map(|set| set.members.clone()).collect())
}
