//! What comes of deciding with the extended model instead of the base (`diagnosis/3.9`).

use nalgebra::{Cholesky, DMatrix, DVector};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use serde::{Deserialize, Serialize};
use statrs::distribution::{ContinuousCDF, Normal};
use utoipa::ToSchema;

use crate::calculator::{Consequence, Diagnosable, Failure, Monitor, checkpoint};
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
    let mut random = Gaussian { random: Pcg64::seed_from_u64(u64::from(job.options.seed)), normal: Normal::standard() };
    let dof = weighing.noise.dof;
    let draws: Vec<Belief> = if let Some(term) = &extension.term {
        let directions = term.directions();
        (0..DRAWS).map(|_| random.beside(bound, &extension.believed, &directions, dof)).collect()
    } else {
        let mut parts = Vec::with_capacity(extension.parts.len());
        for &(share, set) in &extension.parts {
            let open = weighing.fit(&set.members).and_then(|fit| Open::of(bound, set, fit));
            let Some(open) = open else { return Ok(Vec::new()) };
            parts.push((share, open));
        }
        if parts.is_empty() {
            return Ok(Vec::new());
        }
        (0..DRAWS).map(|_| Belief::of(&random.one_of(&parts).draw(dof, &mut random))).collect()
    };
    let mut acting = draws.iter().map(|believed| bound.acting(believed)).collect::<Result<Vec<_>, _>>()?;
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
