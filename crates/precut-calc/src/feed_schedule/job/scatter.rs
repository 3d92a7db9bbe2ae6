//! Limits on outputs that scatter: with which probability the parts, and the edges, keep them (`feed/10.1`, `certainty/5`).

use std::sync::Arc;

use nalgebra::{DMatrix, DVector};
use statrs::distribution::{Continuous, ContinuousCDF, StudentsT};

use crate::calculator::{Failure, Finding};
use crate::certainty::lines::points;
use crate::certainty::{bounded, normal_quantile};
use crate::machinability::ModelForm;
use crate::num::stats::{normal_tail, t_quantile};

use crate::feed_schedule::answer::output::{Outcome, ScheduleConformance, ScheduledLimitKept, ZoneOutcome};
use crate::feed_schedule::job::case::{Case, ZoneCase};
use crate::feed_schedule::job::input::Job;
use crate::feed_schedule::job::models::Output;
use crate::feed_schedule::job::of_fit;
use crate::feed_schedule::job::open::{Given, Move, MovedResults, OpenModels};

/// A share below this is not told.
const LEAST_SHARE: f64 = 0.01;
/// A share that was asked for may be passed by this, relative: what a schedule is solved to.
const SOLVED: f64 = 1e-3;
/// Points over which coefficients that are uncertain are integrated, and effects; fewer where every one takes models anew. Their seed.
const POINTS: usize = 4096;
const POINTS_BENT: usize = 1024;
const SEED: u32 = 1;

type Of = fn(&ZoneOutcome) -> Option<f64>;
/// A limit that a zone has.
pub(in crate::feed_schedule) type LimitOf = fn(&Case, &ZoneCase) -> Option<f64>;

/// A limit on an output of every zone.
pub(in crate::feed_schedule) struct OutputLimit {
    pub output: Output,
    /// As answers name it.
    pub name: &'static str,
    of: Of,
    pub limit: LimitOf,
}

/// Upper limits on outputs.
pub(in crate::feed_schedule) const OUTPUT_LIMITS: [OutputLimit; 6] = [
    OutputLimit {
        output: Output::ForceY,
        name: "deflection",
        of: |zone| zone.deflection_um,
        limit: |case, zone| {
            zone.yields()?;
            Some(zone.deflection_max_um? / case.limits.deflection_residual_fraction)
        },
    },
    OutputLimit {
        output: Output::ForceY,
        name: "force_y",
        of: |zone| zone.force_y_n,
        limit: |case, _| case.limits.force_y_max_n,
    },
    OutputLimit {
        output: Output::ForceZ,
        name: "force_z",
        of: |zone| zone.force_z_n,
        limit: |case, _| case.limits.force_z_max_n,
    },
    OutputLimit {
        output: Output::Roughness,
        name: "roughness",
        of: |zone| zone.roughness_um,
        limit: |_, zone| zone.roughness_max_um,
    },
    OutputLimit {
        output: Output::Hardening,
        name: "hardening",
        of: |zone| zone.hardening_percent,
        limit: |_, zone| zone.hardening_max_percent,
    },
    OutputLimit {
        output: Output::HardeningDepth,
        name: "hardening_depth",
        of: |zone| zone.hardening_depth_um,
        limit: |_, zone| zone.hardening_depth_max_um,
    },
];

/// How single results scatter about a model at one depth: about it, and with it.
#[derive(Debug, Clone, PartialEq)]
pub(in crate::feed_schedule) struct Scatter {
    /// s: about it.
    residual: f64,
    /// The variance that the coefficients bring, and effects whose numbers are not known, as a quadratic form in 1, ln V, ln S.
    coefficients: Option<[[f64; 3]; 3]>,
    /// What else effects move, which bends over ln V, ln S.
    bent: Arc<[Move]>,
    /// Student's degrees of freedom, where they are stated.
    degrees: Option<f64>,
    log_log: bool,
}

impl Scatter {
    /// Whether it changes with speed and feed.
    pub(in crate::feed_schedule) fn bends(&self) -> bool {
        self.coefficients.is_some() || self.is_mixed()
    }

    /// Whether that may bend either way; what goes by 1, ln V, ln S alone bends upward.
    pub(in crate::feed_schedule) fn is_mixed(&self) -> bool {
        !self.bent.is_empty()
    }

    /// sigma(ln V, ln S) and its slopes (`certainty/5.1`).
    pub(in crate::feed_schedule) fn deviation(&self, u: f64, x: f64) -> (f64, [f64; 2]) {
        if !self.bends() {
            return (self.residual, [0.0; 2]);
        }
        let by = self.coefficients.unwrap_or_default().map(|row| row[0] + row[1] * u + row[2] * x);
        let mut variance = self.residual * self.residual + by[0] + by[1] * u + by[2] * x;
        let mut slopes = [by[1], by[2]];
        for (own, by) in self.bent.iter().map(|one| one.at(u, x)) {
            variance += own * own;
            slopes.iter_mut().zip(by).for_each(|(slope, by)| *slope += own * by);
        }
        let deviation = variance.max(0.0).sqrt();
        (deviation, slopes.map(|slope| if deviation > 0.0 { slope / deviation } else { 0.0 }))
    }

    /// How many deviations lie between what is expected and a limit that is passed with this probability.
    pub(in crate::feed_schedule) fn deviations(&self, risk: f64) -> f64 {
        self.degrees.map_or_else(|| deviations(risk), |degrees| t_quantile(1.0 - risk, degrees))
    }

    /// The density of the standardised result at so many deviations.
    pub(in crate::feed_schedule) fn density(&self, at: f64) -> f64 {
        self.degrees.map_or_else(
            || (-0.5 * at * at).exp() / (2.0 * std::f64::consts::PI).sqrt(),
            |degrees| StudentsT::new(0.0, 1.0, degrees).map_or(0.0, |of| of.pdf(at)),
        )
    }

    /// The probability that a limit is passed which lies so many deviations beyond what is expected.
    pub(in crate::feed_schedule) fn tail(&self, at: f64) -> f64 {
        self.degrees.map_or_else(
            || normal_tail(at),
            |degrees| StudentsT::new(0.0, 1.0, degrees).map_or(f64::NAN, |of| of.sf(at)),
        )
    }

    /// The same of one that lies so far beyond, in the scale of the model.
    fn passed(&self, beyond: f64, (u, x): (f64, f64)) -> f64 {
        self.tail(beyond / self.deviation(u, x).0)
    }
}

/// How results scatter about an output's model at a depth; `None` where neither scatter nor covariance is stated, and nothing that moves
/// it is left open of effects.
pub(in crate::feed_schedule) fn scatter(
    job: &Job,
    open: &OpenModels,
    output: Output,
    depth_mm: f64,
) -> Option<Scatter> {
    let model = job.models.get(output);
    let covariance = model.and_then(|model| model.coefficient_covariance.as_ref());
    let mut coefficients = covariance.and_then(|covariance| {
        let (matrix, factors) = (covariance.as_matrix()?, of_fit::factors(job, output, depth_mm)?);
        let mut form = [[0.0; 3]; 3];
        for (i, by) in factors.iter().enumerate() {
            for (j, with) in factors.iter().enumerate() {
                add_product(&mut form, (by, with), matrix[(i, j)]);
            }
        }
        Some(form)
    });
    let mut bent = Vec::new();
    for one in open.moves(job, output, depth_mm) {
        match one {
            Move::Straight(by) => add_product(coefficients.get_or_insert_default(), (&by, &by), 1.0),
            Move::Bent(_) => bent.push(one),
        }
    }
    let residual = model.and_then(|model| model.residual_scatter).unwrap_or(0.0);
    let degrees = covariance.and_then(|covariance| covariance.degrees_of_freedom);
    let log_log = model.is_none_or(|model| model.form == ModelForm::LogLog);
    let scatter = Scatter { residual, coefficients, bent: bent.into(), degrees, log_log };
    (residual > 0.0 || scatter.bends()).then_some(scatter)
}

/// Adds a product of two rows, times a number, to a quadratic form.
fn add_product(form: &mut [[f64; 3]; 3], (by, with): (&[f64; 3], &[f64; 3]), times: f64) {
    for (row, a) in form.iter_mut().zip(by) {
        row.iter_mut().zip(with).for_each(|(entry, b)| *entry += a * times * b);
    }
}

/// A limit in a zone, or of an edge, that a result passes with some probability.
struct Kept {
    output: Output,
    name: &'static str,
    zone: String,
    value: f64,
    limit: f64,
    /// The probability that it is passed.
    passed: f64,
    /// How far the limit lies beyond what is expected, in the scale of the model, on which side (-1 of a least value), and where.
    beyond: f64,
    side: f64,
    at: (f64, f64),
    depth_mm: f64,
}

/// Every limit of a part whose output scatters, in every zone.
fn of_part(job: &Job, case: &Case, outcome: &Outcome) -> Vec<Kept> {
    let mut all = Vec::new();
    for OutputLimit { output, name, of, limit } in &OUTPUT_LIMITS {
        all.extend(case.zones.iter().zip(&outcome.zones).filter_map(|(zone, given)| {
            let scatter = scatter(job, &case.open, *output, zone.depth_mm)?;
            let (value, limit) = (of(given)?, limit(case, zone)?);
            let beyond = if scatter.log_log { (limit / value).ln() } else { limit - value };
            let at = logarithms(given);
            let passed = scatter.passed(beyond, at);
            let zone_id = given.id.clone();
            Some(Kept {
                output: *output,
                name,
                zone: zone_id,
                value,
                limit,
                passed,
                beyond,
                side: 1.0,
                at,
                depth_mm: zone.depth_mm,
            })
        }));
    }
    all
}

fn logarithms(given: &ZoneOutcome) -> (f64, f64) {
    (given.speed_m_per_min.ln(), given.feed_mm_per_rev.ln())
}

/// Every limit on the life of an edge: the least one of a zone, and what is used of each edge before it is changed.
fn of_edges(job: &Job, case: &Case, outcome: &Outcome) -> (Vec<Kept>, Vec<Kept>) {
    let kept = |name, zone: &str, value: f64, limit: f64, beyond: f64| {
        let place = outcome.zones.iter().position(|given| given.id == zone)?;
        let (at, depth_mm) = (logarithms(&outcome.zones[place]), case.zones.get(place)?.depth_mm);
        let scatter = scatter(job, &case.open, Output::ToolLife, depth_mm)?;
        let passed = scatter.passed(beyond, at);
        let zone = zone.to_owned();
        Some(Kept { output: Output::ToolLife, name, zone, value, limit, passed, beyond, side: -1.0, at, depth_mm })
    };
    let lives = outcome.zones.iter().filter_map(|zone| {
        let (life, least) = (zone.tool_life_min?, case.limits.tool_life_min_min?);
        kept("tool_life_min", &zone.id, life, least, (life / least).ln())
    });
    // Life scatters from edge to edge: one that is to be used to U is worn out before with this probability; coefficients
    // are taken at the zone after which it is changed.
    let edges = outcome
        .tool_changes
        .iter()
        .filter_map(|change| kept("edge", &change.after_zone, change.tool_usage, 1.0, -change.tool_usage.ln()));
    (lives.collect(), edges.collect())
}

/// The worst place of every limit whose model states a scatter, where more pass it than the risk that is asked for, or, where
/// none is, than one in a hundred.
pub(in crate::feed_schedule) fn warnings(job: &Job, case: &Case, outcome: &Outcome) -> Vec<Finding> {
    let part = of_part(job, case, outcome);
    let mut found = Vec::new();
    for OutputLimit { name, .. } in &OUTPUT_LIMITS {
        let least = |kept: &Kept| {
            let place = case.zones.iter().find(|zone| zone.id == kept.zone).map(|zone| zone.index);
            let asked = place.and_then(|place| job.risk_in_zone(place)).or(job.risk.of_part());
            asked.map_or(LEAST_SHARE, |risk| risk * (1.0 + SOLVED))
        };
        found.extend(told("limit", &least, part.iter().filter(|kept| kept.name == *name)));
    }
    let (lives, edges) = of_edges(job, case, outcome);
    let least = job.risk.of_edges().map_or(LEAST_SHARE, |risk| risk * (1.0 + SOLVED));
    found.extend(told("limit", &|_| least, lives.iter()));
    found.extend(told("edge", &|_| least, edges.iter()));
    found
}

/// Limited outputs whose models state no scatter, where a risk is asked for: their limits are not moved in.
pub(in crate::feed_schedule) fn without(job: &Job, case: &Case) -> Vec<Finding> {
    let is_limited = |output: Output| {
        let of_output = OUTPUT_LIMITS.iter().filter(|limit| limit.output == output);
        let any = |limit: &OutputLimit| case.zones.iter().any(|zone| (limit.limit)(case, zone).is_some());
        job.risk.of_part().is_some() && of_output.into_iter().any(any)
    };
    let of_edges = job.risk.of_edges().is_some();
    let mut found = Vec::new();
    for output in Output::ALL {
        let is_asked = if output == Output::ToolLife { of_edges } else { is_limited(output) };
        if is_asked && job.models.get(output).is_some() && scatter(job, &case.open, output, 1.0).is_none() {
            let at = format!("/models/{}/residual_scatter", output.name());
            found.push(Finding::new("no_scatter_given", at).with("model", output.name()));
        }
    }
    found
}

fn told<'k>(of: &'static str, least: &dyn Fn(&Kept) -> f64, places: impl Iterator<Item = &'k Kept>) -> Option<Finding> {
    let passed = places.filter(|kept| kept.passed > least(kept));
    let worst = passed.max_by(|a, b| a.passed.total_cmp(&b.passed))?;
    let unit = if of == "edge" { "1" } else { worst.output.unit() };
    Some(
        Finding::new("half_fail", format!("/models/{}/residual_scatter", worst.output.name()))
            .measured(worst.value, worst.limit, unit)
            .with("share", worst.passed)
            .with("model", worst.output.name())
            .with("of", of)
            .with("zone", worst.zone.clone()),
    )
}

/// With which probability the limits are kept; `None` where no model of a limited output states a scatter.
pub(in crate::feed_schedule) fn conformance(
    job: &Job,
    case: &Case,
    outcome: &Outcome,
) -> Result<Option<ScheduleConformance>, Failure> {
    let mut kept = of_part(job, case, outcome);
    let of_part = kept.len();
    let (lives, edges) = of_edges(job, case, outcome);
    kept.extend(lives.into_iter().chain(edges));
    let joint = joint(job, &case.open, &mut kept, of_part)?;
    let worst = |name: &'static str| {
        let of_name = kept.iter().filter(|kept| kept.name == name);
        of_name.max_by(|a, b| a.passed.total_cmp(&b.passed)).map(|kept| ScheduledLimitKept {
            limit: name.to_owned(),
            zone: kept.zone.clone(),
            probability: bounded(1.0 - kept.passed),
        })
    };
    let names = OUTPUT_LIMITS.iter().map(|limit| limit.name).chain(["tool_life_min", "edge"]);
    let mut limits: Vec<ScheduledLimitKept> = names.filter_map(worst).collect();
    if limits.is_empty() {
        return Ok(None);
    }
    limits.sort_by(|a, b| a.probability.total_cmp(&b.probability));
    Ok(Some(ScheduleConformance {
        limits,
        joint_probability: (of_part > 0).then(|| bounded(joint)),
        gain_percent_per_percent_of_risk: None,
        risk_percent: None,
    }))
}

/// The probability that all limits of a part are kept, the first of these. Results scatter independently about their models; coefficients
/// that are uncertain, and what is not known of effects, are common to all zones and integrated over. Where effects bend the results, each
/// limit is told with what that makes of it over the same points, beside what it is to first order.
fn joint(job: &Job, open: &OpenModels, kept: &mut [Kept], of_part: usize) -> Result<f64, Failure> {
    let lower = |output: Output| {
        let covariance = job.models.get(output)?.coefficient_covariance.as_ref()?;
        // A covariance of lower rank gets what round-off leaves of it.
        let matrix = covariance.as_matrix()?;
        let share = 1e-12 * matrix.amax();
        (&matrix + DMatrix::identity(matrix.nrows(), matrix.nrows()) * share).cholesky().map(|found| found.l())
    };
    let lowers = Output::ALL.map(lower);
    if lowers.iter().all(Option::is_none) && open.count() == 0 {
        return Ok(kept[..of_part].iter().map(|kept| (-kept.passed).ln_1p()).sum::<f64>().exp());
    }
    let sizes = lowers.each_ref().map(|lower| lower.as_ref().map_or(0, DMatrix::nrows));
    let factors: Vec<_> =
        kept.iter().map(|kept| of_fit::factors(job, kept.output, kept.depth_mm).unwrap_or_default()).collect();
    let moved = |kept: &Kept, factors: &[[f64; 3]], scores: &[f64]| -> f64 {
        let output = kept.output as usize;
        let Some(lower) = &lowers[output] else { return 0.0 };
        let from: usize = sizes[..output].iter().sum();
        let off = lower * DVector::from_column_slice(&scores[from..from + sizes[output]]);
        let (u, x) = kept.at;
        factors.iter().zip(off.iter()).map(|(by, off)| (by[0] + by[1] * u + by[2] * x) * off).sum()
    };
    let is_kept = |of: &Kept, left: f64| {
        let residual = job.models.get(of.output).and_then(|model| model.residual_scatter).unwrap_or(0.0);
        if residual > 0.0 { 1.0 - normal_tail(left / residual) } else { f64::from(u8::from(left >= 0.0)) }
    };
    let given = kept.iter().map(|kept| Given { output: kept.output, at: kept.at, depth_mm: kept.depth_mm }).collect();
    let by_effects = MovedResults::of(open, job, given)?;
    let is_bent = !by_effects.are_straight();
    let count = if is_bent { POINTS_BENT } else { POINTS };
    let of_coefficients: usize = sizes.iter().sum();
    let (mut all, mut bent) = (0.0, vec![0.0; kept.len()]);
    for scores in points(count, of_coefficients + open.count(), SEED) {
        let own = &scores[of_coefficients..];
        let (really, nearly) = (by_effects.at(own)?, by_effects.nearly(own));
        let mut together = 1.0;
        for (i, kept) in kept.iter().enumerate() {
            let by_fit = moved(kept, &factors[i], &scores);
            let at = |by_effects: f64| is_kept(kept, kept.beyond - kept.side * (by_fit + by_effects));
            let here = at(really[i]);
            if i < of_part {
                together *= here;
            }
            if is_bent {
                bent[i] += here - at(nearly[i]);
            }
        }
        all += together;
    }
    for (kept, bent) in kept.iter_mut().zip(bent) {
        kept.passed = (kept.passed - bent / count as f64).clamp(0.0, 1.0);
    }
    Ok(all / count as f64)
}

/// How many standard deviations lie between what is expected and a limit that is passed with this probability.
pub(in crate::feed_schedule) fn deviations(risk: f64) -> f64 {
    -normal_quantile(risk)
}
