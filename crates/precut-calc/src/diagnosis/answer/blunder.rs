//! Blunders of whoever wrote the rows down, as rivals of physics (`diagnosis/8`): two runs exchanged, a run or a condition in
//! another unit, a shifted zero, places counted from the other end. Each makes other rows of those that were given; what it
//! explains is weighed against all that the causes explain of the rows as they stand.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::calculator::{Diagnosable, Failure, Monitor, Quantity, Rows, Smooth, checkpoint, divided};
use crate::diagnosis::answer::view::class_and_kinds;
use crate::diagnosis::base::Bound;
use crate::diagnosis::calculator::{JobOf, Measured, base_of};
use crate::diagnosis::rows::data::{Data, Layout};
use crate::diagnosis::rows::sparse::Sparse;
use crate::diagnosis::rows::suspect::factors_of;
use crate::diagnosis::statistics::evidence::{Normal, Scale, Side, log_sum_exp};
use crate::diagnosis::statistics::likelihood::Likelihood;
use crate::diagnosis::statistics::whiten::Whitener;
use crate::diagnosis::verdict::effort::Effort;
use crate::diagnosis::verdict::foundation::Foundation;
use crate::diagnosis::verdict::judge::POSSIBLE;
use crate::diagnosis::verdict::weigh::Weighing;

/// Prior of any blunder, relative to none: one table in fifty.
const PRIOR: f64 = 0.02;
/// Kinds of blunders, which share it.
const KINDS: f64 = 5.0;
/// Runs up to which single runs are suspected: beyond, their pairs are too many.
const MOST_RUNS: usize = 40;
/// Rows of a run from which on it can be told from the others.
const LEAST_OF_RUN: usize = 3;
/// Blunders that are weighed with all causes beside them: those that explain most by themselves.
const WEIGHED: usize = 3;
/// What a blunder has to explain beyond its prior, in units of the log-likelihood, to be weighed so.
const WORTH_IT: f64 = 3.0;
/// Standard deviation of a shifted zero before anything is measured, in units of the scatter.
const SHIFT: f64 = 30.0;
/// Probability of a blunder from which on nothing is said about physics.
pub(in crate::diagnosis) const SUSPECTED: f64 = 0.8;

/// Factors that a wrong unit leaves in a condition, by the end of its name: inches, feet, seconds, or a depth on the diameter.
const UNITS_OF_CONDITIONS: [(&str, &[f64]); 6] = [
    ("depth_mm", &[2.0, 0.5, 25.4, 1.0 / 25.4]),
    ("_mm", &[25.4, 1.0 / 25.4, 1000.0, 0.001]),
    ("_mm_per_rev", &[25.4, 1.0 / 25.4]),
    ("_m_per_min", &[0.3048, 1.0 / 0.3048, 60.0, 1.0 / 60.0]),
    ("_min", &[60.0, 1.0 / 60.0]),
    ("_m", &[0.3048, 1.0 / 0.3048, 1000.0, 0.001]),
];

/// A blunder that the rows look like.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct BlunderReport {
    /// `runs_exchanged`, `run_in_unit`, `condition_in_unit`, `zero_shifted`, `from_other_end`.
    pub kind: String,
    /// The runs that it is about; none where it is about all rows.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub runs: Vec<u32>,
    /// Of `condition_in_unit`: which.
    pub condition: Option<String>,
    /// Of `run_in_unit` and `condition_in_unit`: how many times too large the numbers are.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub factor: Option<f64>,
    /// Of `zero_shifted`: by how much the values are too large, in the unit of the quantity.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub shift: Option<f64>,
    /// Posterior probability, against all other blunders and against rows that are right.
    #[schema(minimum = 0.0, maximum = 1.0, extensions(("x-unit" = json!("1"))))]
    pub probability: f64,
    /// What the rows say once it is corrected.
    pub verdict_if_corrected: crate::diagnosis::answer::output::VerdictClass,
    /// The sets of causes of that verdict, by their kinds.
    pub causes_if_corrected: Vec<Vec<String>>,
}

/// What was done to the rows.
#[derive(Debug, Clone, Copy, PartialEq)]
enum Blunder {
    FromOtherEnd,
    RunsExchanged(usize, usize),
    /// Numbers too large by a factor.
    RunInUnit {
        run: usize,
        factor: f64,
    },
    ConditionInUnit {
        run: Option<usize>,
        condition: &'static str,
        factor: f64,
    },
    ZeroShifted {
        run: usize,
    },
}

impl Blunder {
    fn kind(self) -> &'static str {
        match self {
            Self::FromOtherEnd => "from_other_end",
            Self::RunsExchanged(..) => "runs_exchanged",
            Self::RunInUnit { .. } => "run_in_unit",
            Self::ConditionInUnit { .. } => "condition_in_unit",
            Self::ZeroShifted { .. } => "zero_shifted",
        }
    }

    fn runs(self) -> Vec<usize> {
        match self {
            Self::FromOtherEnd | Self::ConditionInUnit { run: None, .. } => Vec::new(),
            Self::RunsExchanged(a, b) => vec![a, b],
            Self::RunInUnit { run, .. } | Self::ConditionInUnit { run: Some(run), .. } | Self::ZeroShifted { run } => {
                vec![run]
            }
        }
    }

    /// Whether it is about a row of this run.
    fn concerns(self, run: usize) -> bool {
        let runs = self.runs();
        runs.is_empty() || runs.contains(&run)
    }
}

/// The rows as they were given, and what is needed to correct them.
struct Suspect<'a, 'b, M: Diagnosable> {
    job: &'a JobOf<M>,
    measured: &'a Measured<M::Run, M::Point>,
    weighing: &'a Weighing<'b>,
    whitener: &'a Whitener,
    scale: Scale,
    logarithmic: bool,
    monitor: &'a dyn Monitor,
}

/// Blunders that the rows look like, likeliest first: none where nothing speaks against the base, of classes, and where every
/// prediction is a simulation.
pub(in crate::diagnosis) fn blunders<M: Diagnosable>(
    job: &JobOf<M>,
    measured: &Measured<M::Run, M::Point>,
    weighing: &Weighing<'_>,
    quantity: &Quantity,
    effort: Effort,
    monitor: &dyn Monitor,
) -> Result<Vec<BlunderReport>, Failure> {
    let Likelihood::Gaussian { whitener, scale } = &weighing.linear.likelihood else { return Ok(Vec::new()) };
    let logarithmic = quantity.logarithmic;
    let suspect = Suspect::<M> { job, measured, weighing, whitener, scale: *scale, logarithmic, monitor };
    suspect.weighed(suspect.likeliest(&suspect.candidates(quantity))?, effort)
}

impl<M: Diagnosable> Suspect<'_, '_, M> {
    /// All that is looked at.
    fn candidates(&self, quantity: &Quantity) -> Vec<Blunder> {
        let places = &self.measured.places;
        let mut all = vec![Blunder::FromOtherEnd];
        for &condition in M::CONDITIONS {
            for &factor in units_of_condition(condition) {
                all.push(Blunder::ConditionInUnit { run: None, condition, factor });
            }
        }
        let data = self.weighing.foundation.data;
        if data.layout.design.smooth == Smooth::None || !(2..=MOST_RUNS).contains(&places.runs.len()) {
            return all;
        }
        let seen: Vec<usize> =
            (0..places.runs.len()).filter(|&run| self.weighing.rows_of_run(run).len() >= LEAST_OF_RUN).collect();
        for (index, &run) in seen.iter().enumerate() {
            let others = seen[..index].iter().filter(|&&other| places.runs[other] != places.runs[run]);
            all.extend(others.map(|&other| Blunder::RunsExchanged(other, run)));
            all.extend(factors_of(quantity).iter().map(|&factor| Blunder::RunInUnit { run, factor }));
            if !self.logarithmic {
                all.push(Blunder::ZeroShifted { run });
            }
            for &condition in M::CONDITIONS {
                for &factor in units_of_condition(condition) {
                    all.push(Blunder::ConditionInUnit { run: Some(run), condition, factor });
                }
            }
        }
        all
    }

    /// Those that explain most by themselves, each with the logarithm of its prior.
    fn likeliest(&self, candidates: &[Blunder]) -> Result<Vec<(Blunder, f64)>, Failure> {
        let rows = self.whitener.rows();
        let none = self.scale.log_likelihood(self.square(&self.weighing.foundation.residual), rows);
        let mut found: Vec<(f64, Blunder, f64)> = Vec::new();
        let of_kind = |blunder: &Blunder| candidates.iter().filter(|other| other.kind() == blunder.kind()).count();
        for blunder in candidates {
            checkpoint(self.monitor)?;
            let log_prior = (PRIOR / KINDS / of_kind(blunder) as f64).ln();
            let Some(evidence) = self.alone(*blunder)? else { continue };
            let gained = evidence - none + log_prior;
            if gained > WORTH_IT {
                found.push((gained, *blunder, log_prior));
            }
        }
        found.sort_by(|a, b| b.0.total_cmp(&a.0));
        Ok(found.into_iter().take(WEIGHED).map(|(_, blunder, log_prior)| (blunder, log_prior)).collect())
    }

    /// r'C^-1 r of a residual.
    fn square(&self, residual: &[f64]) -> f64 {
        let white = self.whitener.white(residual);
        white.inner(&white)
    }

    /// Log-evidence of a blunder with the base and nothing else, in the scatter of the rows as they stand.
    fn alone(&self, blunder: Blunder) -> Result<Option<f64>, Failure> {
        let foundation = self.weighing.foundation;
        if let Blunder::ZeroShifted { run } = blunder {
            let column = self.whitener.white(&self.shift(run).dense());
            let residual = self.whitener.white(&foundation.residual);
            let evidence = Normal::of(&[&column], &residual).evidence(&[Side::Both], self.scale, self.whitener.rows());
            return Ok(evidence.map(|evidence| evidence.log_z));
        }
        let Some(places) = self.corrected(blunder) else { return Ok(None) };
        let concerned: Vec<usize> =
            (0..places.points.len()).filter(|&row| blunder.concerns(places.points[row].0)).collect();
        let base = if matches!(blunder, Blunder::RunInUnit { .. }) {
            concerned.iter().map(|&row| foundation.base[row]).collect()
        } else {
            let points = concerned.iter().map(|&row| places.points[row].clone()).collect();
            let Some(base) = self.predicted(&Rows { runs: places.runs, points })? else { return Ok(None) };
            base
        };
        let (value, jacobian) = self.values(blunder);
        let mut residual = foundation.residual.clone();
        for (&row, base) in concerned.iter().zip(base) {
            residual[row] = value[row] - base;
        }
        Ok(Some(self.scale.log_likelihood(self.square(&residual), self.whitener.rows()) + jacobian))
    }

    /// The base on other rows, in the unit of residuals; `None` where it does not predict them all.
    fn predicted(&self, rows: &Rows<M::Run, M::Point>) -> Result<Option<Vec<f64>>, Failure> {
        let (base, known) = base_of::<M>(self.job);
        let Ok(prepared) = M::prepare(&base, rows, &self.job.quantity, self.monitor) else {
            checkpoint(self.monitor)?;
            return Ok(None);
        };
        let predicted = M::predict(&prepared, &known.effects, self.monitor)?;
        let in_unit = |value: f64| if self.logarithmic { (value > 0.0).then(|| value.ln()) } else { Some(value) };
        Ok(predicted.into_iter().map(|value| value.ok().and_then(in_unit)).collect())
    }

    /// Runs and places without the blunder; `None` where there is nothing that it could have changed.
    fn corrected(&self, blunder: Blunder) -> Option<Rows<M::Run, M::Point>> {
        let mut places = self.measured.places.clone();
        match blunder {
            Blunder::FromOtherEnd => {
                for (_, point) in &mut places.points {
                    *point = M::from_other_end(&self.job.job, point)?;
                }
            }
            Blunder::RunsExchanged(a, b) => places.runs.swap(a, b),
            Blunder::ConditionInUnit { run, condition, factor } => {
                let mut is_there = false;
                for (index, own) in places.runs.iter_mut().enumerate() {
                    if run.is_none_or(|run| run == index)
                        && let Some(divided) = divided(own, condition, factor)
                    {
                        *own = divided;
                        is_there = true;
                    }
                }
                for (of, point) in &mut places.points {
                    if run.is_none_or(|run| run == *of)
                        && let Some(divided) = divided(point, condition, factor)
                    {
                        *point = divided;
                        is_there = true;
                    }
                }
                if !is_there {
                    return None;
                }
            }
            Blunder::RunInUnit { .. } | Blunder::ZeroShifted { .. } => {}
        }
        Some(places)
    }

    /// Values without the blunder, and the logarithm of by how much their density is that of what was written down.
    fn values(&self, blunder: Blunder) -> (Vec<f64>, f64) {
        let foundation = self.weighing.foundation;
        let mut value = foundation.data.value.clone();
        let mut jacobian = 0.0;
        if let Blunder::RunInUnit { run, factor } = blunder {
            for (row, value) in value.iter_mut().enumerate() {
                if self.measured.places.points[row].0 != run {
                    continue;
                }
                if self.logarithmic {
                    *value -= factor.ln();
                } else {
                    *value /= factor;
                    jacobian -= if self.weighing.keep[row] { factor.abs().ln() } else { 0.0 };
                }
            }
        }
        (value, jacobian)
    }

    /// A run's zero, at one standard deviation.
    fn shift(&self, run: usize) -> Sparse {
        let count = self.weighing.keep.len();
        let by = SHIFT * self.weighing.noise.sigma;
        Sparse::new(count, (0..count).filter(|&row| self.measured.places.points[row].0 == run).map(|row| (row, by)))
    }

    /// With all causes beside each of them: what has a probability worth telling.
    fn weighed(&self, likeliest: Vec<(Blunder, f64)>, effort: Effort) -> Result<Vec<BlunderReport>, Failure> {
        let mut found = Vec::new();
        for (blunder, log_prior) in likeliest {
            checkpoint(self.monitor)?;
            if let Some((log_evidence, report)) = self.corrected_verdict(blunder, effort)? {
                found.push((log_evidence + log_prior, report));
            }
        }
        let all: Vec<f64> = found.iter().map(|(weight, _)| *weight).chain([self.weighing.log_evidence]).collect();
        let total = log_sum_exp(&all);
        let mut reports: Vec<BlunderReport> = found
            .into_iter()
            .map(|(weight, report)| BlunderReport { probability: (weight - total).exp(), ..report })
            .filter(|report| report.probability >= POSSIBLE)
            .collect();
        reports.sort_by(|a, b| b.probability.total_cmp(&a.probability));
        Ok(reports)
    }

    /// All sets of causes on the corrected rows: their evidence together, and what they say.
    fn corrected_verdict(&self, blunder: Blunder, effort: Effort) -> Result<Option<(f64, BlunderReport)>, Failure> {
        let Some(places) = self.corrected(blunder) else { return Ok(None) };
        let old = self.weighing.foundation.data;
        let (base, known) = base_of::<M>(self.job);
        let Ok(prepared) = M::prepare(&base, &places, &self.job.quantity, self.monitor) else {
            checkpoint(self.monitor)?;
            return Ok(None);
        };
        let (value, jacobian) = self.values(blunder);
        let scaled = |(row, own): (usize, &f64)| match blunder {
            Blunder::RunInUnit { run, factor } if !self.logarithmic && places.points[row].0 == run => {
                own / factor.abs()
            }
            _ => *own,
        };
        let data = Data {
            value,
            uncertainty: old.uncertainty.as_ref().map(|own| own.iter().enumerate().map(scaled).collect()),
            sides: None,
            layout: Layout { design: M::design(&prepared), ..old.layout.clone() },
        };
        let (allowances, quantity, options) = (self.job.allowances.clone(), &self.job.quantity, &self.job.options);
        let bound = Bound::<M>::new(prepared, known, allowances, quantity, options, self.monitor)?;
        let mut foundation = Foundation::of(&bound, &data, self.monitor)?;
        let mut shift = None;
        if let Blunder::ZeroShifted { run } = blunder {
            let column = self.shift(run);
            shift = self.fitted_shift(&column);
            foundation.allow(column);
        }
        let keep: Vec<bool> =
            self.weighing.keep.iter().zip(&foundation.predicted).map(|(keep, predicted)| *keep && *predicted).collect();
        if keep != self.weighing.keep {
            return Ok(None);
        }
        let weighing = Weighing::of(&foundation, keep, effort, self.monitor)?;
        let (verdict_if_corrected, causes_if_corrected) = class_and_kinds(&bound, &weighing.verdict);
        let (condition, factor) = match blunder {
            Blunder::RunInUnit { factor, .. } => (None, Some(factor)),
            Blunder::ConditionInUnit { condition, factor, .. } => (Some(condition.to_owned()), Some(factor)),
            _ => (None, None),
        };
        let report = BlunderReport {
            kind: blunder.kind().to_owned(),
            runs: blunder.runs().into_iter().map(|run| u32::try_from(run + 1).unwrap_or(u32::MAX)).collect(),
            condition,
            factor,
            shift,
            probability: 0.0,
            verdict_if_corrected,
            causes_if_corrected,
        };
        Ok(Some((weighing.log_evidence + jacobian, report)))
    }

    /// By how much a zero is shifted, beside the base.
    fn fitted_shift(&self, column: &Sparse) -> Option<f64> {
        let (white, residual) =
            (self.whitener.white(&column.dense()), self.whitener.white(&self.weighing.foundation.residual));
        let fitted = Normal::of(&[&white], &residual).evidence(&[Side::Both], self.scale, self.whitener.rows())?;
        Some(fitted.t[0] * SHIFT * self.weighing.noise.sigma)
    }
}

fn units_of_condition(condition: &str) -> &'static [f64] {
    UNITS_OF_CONDITIONS.iter().find(|(end, _)| condition.ends_with(end)).map_or(&[], |(_, factors)| factors)
}
