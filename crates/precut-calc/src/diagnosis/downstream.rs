//! What comes of deciding with the extended model instead of the base (`diagnosis/3.9`).

use nalgebra::{Cholesky, DVector};
use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use statrs::distribution::{ContinuousCDF, Normal};

use super::base::Bound;
use super::calculator::{JobOf, base_of};
use super::output::{DecisionReport, DownstreamReport};
use super::refine::Fit;
use super::subject::{Setting, Subject};
use super::weigh::{SetWeight, Weighing};
use crate::calculator::{Consequence, Diagnosable, Failure, Monitor, checkpoint};

/// Draws from what the fit leaves open.
const DRAWS: usize = 200;
/// Draws that must have an outcome for it to be reported.
const LEAST: usize = DRAWS / 2;
/// Degrees of freedom from which on Student's t is a normal distribution to 2 % of its 95 % interval.
const NEARLY_NORMAL: f64 = 60.0;

/// Decisions with the base and with the extended model, each judged where the extended model acts with what the rows leave
/// open of its sizes and with what the job allows besides. Empty where the leading set was not refined, or where the job
/// decides nothing.
pub(super) fn downstream<M: Diagnosable>(
    job: &JobOf<M>,
    runs: &[M::Run],
    bound: &Bound<'_, M>,
    weighing: &Weighing<'_>,
    leading: Option<&SetWeight>,
    monitor: &dyn Monitor,
) -> Result<Vec<DownstreamReport>, Failure> {
    let Some((set, fit)) = leading.and_then(|set| Some((set, weighing.fit(&set.members)?))) else {
        return Ok(Vec::new());
    };
    let mut random = Gaussian { random: Pcg64::seed_from_u64(u64::from(job.options.seed)), normal: Normal::standard() };
    let Some(draws) = draws(bound, set, fit, weighing.noise.dof, &mut random) else {
        return Ok(Vec::new());
    };
    let mut acting = draws.iter().map(|settings| bound.acting(settings)).collect::<Result<Vec<_>, _>>()?;
    for effects in &mut acting {
        effects.extend(M::allowed(&job.allowances, &mut || random.next()));
    }
    let (base_job, _) = base_of::<M>(job);
    let decided = |believed: &[Setting]| -> Result<Vec<Consequence>, Failure> {
        let believed = bound.acting(believed)?;
        let decided = M::consequences(&base_job, &job.quantity, runs, &believed, &acting, monitor)?;
        // What was cancelled has no consequences, either.
        checkpoint(monitor)?;
        Ok(decided)
    };
    let (base, extended) = (decided(&[])?, decided(&set.settings)?);
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

/// Settings drawn from the posterior of a fit: Student's t about the optimum, cut at the bounds. What a grid of shapes
/// widens is widened here, too.
fn draws(
    subject: &dyn Subject,
    set: &SetWeight,
    fit: &Fit,
    dof: f64,
    random: &mut Gaussian,
) -> Option<Vec<Vec<Setting>>> {
    let lower = Cholesky::new(fit.covariance.clone())?.unpack();
    let widened: Vec<f64> = fit
        .free
        .iter()
        .enumerate()
        .map(|(k, &(member, variable))| set.standard_deviations[member][variable] / fit.covariance[(k, k)].sqrt())
        .collect();
    let draw = |_| {
        let scale = random.student_scale(dof);
        let step = &lower * DVector::from_fn(fit.free.len(), |_, _| scale * random.next());
        let mut settings = set.settings.clone();
        for (k, &(member, variable)) in fit.free.iter().enumerate() {
            let range = subject.hypotheses()[settings[member].hypothesis].variables[variable].range;
            let value = &mut settings[member].values[variable];
            *value = (*value + step[k] * widened[k]).clamp(range.lower, range.upper);
        }
        settings
    };
    Some((0..DRAWS).map(draw).collect())
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
