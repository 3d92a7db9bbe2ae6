//! What comes of deciding with the extended model instead of the base (`diagnosis/3.9`).

use nalgebra::{Cholesky, DMatrix, DVector};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use serde::{Deserialize, Serialize};
use statrs::distribution::{ContinuousCDF, Normal};
use utoipa::ToSchema;

use crate::calculator::{Consequence, Diagnosable, Failure, Monitor, ToldEffects, checkpoint};
use crate::diagnosis::base::Bound;
use crate::diagnosis::calculator::{JobOf, base_of};
use crate::diagnosis::causes::ranking::SetWeight;
use crate::diagnosis::causes::refine::Fit;
use crate::diagnosis::causes::subject::{Belief, Setting, Subject};
use crate::diagnosis::model::extension::Extension;
use crate::diagnosis::model::known::Direction;
use crate::diagnosis::verdict::weigh::Weighing;

/// Draws from what the fit leaves open.
const DRAWS: usize = 200;
/// Draws that must have an outcome for it to be reported.
const LEAST: usize = DRAWS / 2;
/// Degrees of freedom from which on Student's t is a normal distribution to 2 % of its 95 % interval.
const NEARLY_NORMAL: f64 = 60.0;

/// What comes of deciding with either model (the path that is compensated, the schedule, the depth), where the extended
/// one is right within what the rows leave open.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct DownstreamReport {
    /// What is judged, with its unit: `form_error_um`, `largest_error_um`, `limit_use`, `depth_margin_percent`.
    pub outcome: String,
    /// Its unit.
    pub unit: String,
    /// Draws from the fit of the extended model.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub draws: u32,
    /// Decided with the base.
    pub base: DecisionReport,
    /// Decided with the extended model.
    pub extended: DecisionReport,
}

/// How a decision turns out.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct DecisionReport {
    /// Mean over the draws, in the unit of the outcome.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub mean: f64,
    /// 95 % interval over the draws.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub interval_95: [f64; 2],
    /// Share of the draws within what the job allows; absent where it says nothing.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub share_allowed: Option<f64>,
}

/// Decisions with the base and with the extended model, each judged where one of the sets behind the extended model acts, as
/// often as its share, with what the rows leave open of its sizes and with what the job allows besides. Empty where a set was
/// not refined, or where the job decides nothing.
pub(in crate::diagnosis) fn downstream<M: Diagnosable>(
    job: &JobOf<M>,
    runs: &[M::Run],
    bound: &Bound<'_, M>,
    weighing: &Weighing<'_>,
    extension: &Extension<'_>,
    monitor: &dyn Monitor,
) -> Result<Vec<DownstreamReport>, Failure> {
    let mut random = Gaussian::of(job.options.seed);
    let Some(mut acting) = drawn(DRAWS, bound, weighing, extension, &mut random)? else { return Ok(Vec::new()) };
    for effects in &mut acting {
        effects.extend(M::allowed(&job.allowances, &mut || random.next()));
    }
    let (base_job, _) = base_of::<M>(job);
    let decided = |believed: &Belief| -> Result<Vec<Consequence>, Failure> {
        let believed = bound.acting(believed)?;
        let decided = M::consequences(&base_job, &job.quantity, runs, &believed, &acting, monitor)?;
        // What was cancelled has no consequences, either.
        checkpoint(monitor)?;
        Ok(decided)
    };
    let (base, extended) = (decided(&Belief::default())?, decided(&extension.believed)?);
    let both = base.iter().filter_map(|of_base| {
        let of_extended = extended.iter().find(|other| other.name == of_base.name)?;
        Some(DownstreamReport {
            outcome: of_base.name.to_owned(),
            unit: of_base.unit.to_owned(),
            draws: u32::try_from(DRAWS).unwrap_or(u32::MAX),
            base: turned_out(of_base)?,
            extended: turned_out(of_extended)?,
        })
    });
    Ok(both.collect())
}

/// Effects that act, so many draws of what the rows leave open of the extended model; `None` where one of its sets was not refined.
fn drawn<M: Diagnosable>(
    count: usize,
    bound: &Bound<'_, M>,
    weighing: &Weighing<'_>,
    extension: &Extension<'_>,
    random: &mut Gaussian,
) -> Result<Option<Vec<Vec<M::Effect>>>, Failure> {
    let dof = weighing.noise.dof;
    let draws: Vec<Belief> = if let Some(term) = &extension.term {
        let directions = term.directions();
        (0..count).map(|_| random.beside(bound, &extension.believed, &directions, dof)).collect()
    } else {
        let mut parts = Vec::with_capacity(extension.parts.len());
        for &(share, set) in &extension.parts {
            let open = weighing.fit(&set.members).and_then(|fit| Open::of(bound, set, fit));
            let Some(open) = open else { return Ok(None) };
            parts.push((share, open));
        }
        if parts.is_empty() {
            return Ok(None);
        }
        (0..count).map(|_| Belief::of(&random.one_of(&parts).draw(dof, random))).collect()
    };
    draws.iter().map(|believed| bound.acting(believed)).collect::<Result<Vec<_>, _>>().map(Some)
}

/// With which probability the next part keeps all limits of the base job, where the extended model is right within what the rows
/// leave open of it, with what else the base job says is uncertain.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct GoodPartsReport {
    /// Draws of both.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub draws: u32,
    /// Made with the base.
    pub base: ProbablyGood,
    /// Made with the extended model.
    pub extended: ProbablyGood,
}

/// The probability of a good part.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct ProbablyGood {
    /// Share of the draws that keep every limit.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub probability: f64,
    /// Twice its standard error.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub numerical_error: f64,
}

impl ProbablyGood {
    /// The standard error is that of a share with one draw more on either side (Laplace's rule): of 0 of 500 it is not 0.
    fn of(kept: &[bool]) -> Self {
        let (good, count) = (kept.iter().filter(|good| **good).count() as f64, kept.len() as f64);
        let chance = (good + 1.0) / (count + 2.0);
        Self { probability: good / count, numerical_error: 2.0 * (chance * (1.0 - chance) / count).sqrt() }
    }
}

/// The probability that the next part is good, made with the base and with the extended model, on common draws. `None` where a set was
/// not refined, and where nothing of a part is limited.
pub(in crate::diagnosis) fn good_parts<M: Diagnosable>(
    job: &JobOf<M>,
    runs: &[M::Run],
    bound: &Bound<'_, M>,
    weighing: &Weighing<'_>,
    extension: &Extension<'_>,
    told: &ToldEffects<'_, M::Effect>,
    monitor: &dyn Monitor,
) -> Result<Option<GoodPartsReport>, Failure> {
    if M::PARTS_DRAWN == 0 {
        return Ok(None);
    }
    let mut random = Gaussian::of(job.options.seed);
    let Some(acting) = drawn(M::PARTS_DRAWN, bound, weighing, extension, &mut random)? else { return Ok(None) };
    let (base_job, _) = base_of::<M>(job);
    let made = |believed: &Belief| -> Result<Option<ProbablyGood>, Failure> {
        let kept = M::parts_kept(&base_job, runs, &bound.acting(believed)?, &acting, told, monitor)?;
        checkpoint(monitor)?;
        Ok(kept.map(|kept| ProbablyGood::of(&kept)))
    };
    let (base, extended) = (made(&Belief::default())?, made(&extension.believed)?);
    let draws = u32::try_from(M::PARTS_DRAWN).unwrap_or(u32::MAX);
    Ok(base.zip(extended).map(|(base, extended)| GoodPartsReport { draws, base, extended }))
}

/// What the rows leave open of a set: Student's t about its optimum, cut at the bounds. What a grid of shapes widens is
/// widened here, too.
struct Open<'a> {
    subject: &'a dyn Subject,
    set: &'a SetWeight,
    fit: &'a Fit,
    /// Triangular factor of the covariance.
    lower: DMatrix<f64>,
    widened: Vec<f64>,
}

impl<'a> Open<'a> {
    fn of(subject: &'a dyn Subject, set: &'a SetWeight, fit: &'a Fit) -> Option<Self> {
        let lower = Cholesky::new(fit.covariance.clone())?.unpack();
        let free = fit.free.iter().enumerate();
        let widened = free
            .map(|(k, &(member, variable))| set.standard_deviations[member][variable] / fit.covariance[(k, k)].sqrt());
        Some(Self { subject, set, fit, lower, widened: widened.collect() })
    }

    fn draw(&self, dof: f64, random: &mut Gaussian) -> Vec<Setting> {
        let free = &self.fit.free;
        let scale = random.student_scale(dof);
        let step = &self.lower * DVector::from_fn(free.len(), |_, _| scale * random.next());
        let mut settings = self.set.settings.clone();
        for (k, &(member, variable)) in free.iter().enumerate() {
            let range = self.subject.hypotheses()[settings[member].hypothesis].variables[variable].range;
            let value = &mut settings[member].values[variable];
            *value = (*value + step[k] * self.widened[k]).clamp(range.lower, range.upper);
        }
        settings
    }
}

struct Gaussian {
    random: Pcg64,
    normal: Normal,
}

impl Gaussian {
    fn of(seed: u32) -> Self {
        Self { random: Pcg64::seed_from_u64(u64::from(seed)), normal: Normal::standard() }
    }

    fn next(&mut self) -> f64 {
        // In the open interval: both ends are infinite.
        let share = self.random.random_range(f64::EPSILON..1.0);
        self.normal.inverse_cdf(share)
    }

    /// What is believed, off in all directions at once; causes kept within their bounds.
    fn beside(&mut self, subject: &dyn Subject, believed: &Belief, directions: &[Direction], dof: f64) -> Belief {
        let scale = self.student_scale(dof);
        let mut drawn = believed.clone();
        for direction in directions {
            drawn = direction.moved(&drawn, scale * self.next());
        }
        for setting in &mut drawn.settings {
            let variables = &subject.hypotheses()[setting.hypothesis].variables;
            setting.values.iter_mut().zip(variables).for_each(|(value, own)| *value = own.range.clamp(*value));
        }
        drawn
    }

    /// One of these as often as its share; the only one without a draw.
    fn one_of<'b, T>(&mut self, parts: &'b [(f64, T)]) -> &'b T {
        let mut left = if parts.len() > 1 { self.random.random_range(0.0..1.0) } else { 0.0 };
        let chosen = parts.iter().position(|(share, _)| {
            left -= share;
            left < 0.0
        });
        &parts[chosen.unwrap_or(parts.len() - 1)].1
    }

    /// sqrt(nu/chi^2), chi^2 a sum of nu squares.
    fn student_scale(&mut self, dof: f64) -> f64 {
        if !(1.0..NEARLY_NORMAL).contains(&dof) {
            return 1.0;
        }
        // At most 60.
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        let count = dof.round() as usize;
        let square: f64 = (0..count).map(|_| self.next().powi(2)).sum();
        (count as f64 / square).sqrt()
    }
}

/// Mean, interval and share allowed; a draw with which nothing can be cut is not allowed.
fn turned_out(consequence: &Consequence) -> Option<DecisionReport> {
    let mut values: Vec<f64> = consequence.values.iter().copied().flatten().collect();
    if values.len() < LEAST {
        return None;
    }
    values.sort_by(f64::total_cmp);
    let count = values.len();
    let share_allowed = consequence.allowed.map(|allowed| {
        values.iter().filter(|value| allowed.holds(**value)).count() as f64 / consequence.values.len() as f64
    });
    Some(DecisionReport {
        mean: values.iter().sum::<f64>() / count as f64,
        interval_95: [values[count / 40], values[count - 1 - count / 40]],
        share_allowed,
    })
}
