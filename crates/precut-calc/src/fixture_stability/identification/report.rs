//! The answer of a search, put together.

use crate::calculator::{Failure, checkpoint};
use crate::num::stats::GENERATOR;

use super::certainty::Certainty;
use super::input::{IdentificationJob, OpenedJoint};
use super::output::{
    ClampBounds, Combination, HypothesisFit, IdentificationOutcome, IdentifiedFixture, IdentifiedParameter,
    IdentifiedRow, OnsetFit, ParameterPair, TableFit,
};
use super::problem::{Law, Predicted, Problem, huber, onset_mm};
use super::search::Found;
use super::unknowns::{Unknown, Values};
use crate::fixture_stability::job::input::Vise;
use crate::fixture_stability::model::lobes::critical_depth;

const UM_PER_MM: f64 = 1e3;
/// Standard deviations of a 95 % interval.
const INTERVAL: f64 = 1.96;
/// Distance from an end of the range that counts as the end.
const AT_BOUND: f64 = 2e-3;

/// A law with its best set and what that predicts.
pub(super) struct Tried {
    pub law: Law,
    pub found: Found,
    pub values: Values,
    /// With the step of the search, and with half of it.
    pub coarse: Vec<Predicted>,
    pub fine: Vec<Predicted>,
}

impl Tried {
    pub(super) fn new(problem: &Problem<'_>, law: Law, found: Found) -> Result<Self, Failure> {
        let values = problem.values(&found.at);
        let coarse = problem.predict(&values, law, 1)?;
        checkpoint(problem.monitor)?;
        let fine = problem.predict(&values, law, 2)?;
        Ok(Self { law, found, values, coarse, fine })
    }

    pub(super) fn fit(&self, problem: &Problem<'_>) -> TableFit {
        let used: Vec<usize> = (0..self.fine.len()).filter(|&row| problem.sigma(row).is_some()).collect();
        let logs: Vec<f64> = used
            .iter()
            .map(|&row| problem.residual(row, self.fine[row].amplitude_mm) * problem.sigma(row).unwrap_or(1.0))
            .collect();
        let mut sizes: Vec<f64> = logs.iter().map(|log| log.abs()).collect();
        sizes.sort_by(f64::total_cmp);
        let middle = sizes.len() / 2;
        let median_log = match sizes.len() {
            0 => 0.0,
            n if n % 2 == 1 => sizes[middle],
            _ => 0.5 * (sizes[middle - 1] + sizes[middle]),
        };
        let worst = used.iter().zip(&logs).max_by(|a, b| a.1.abs().total_cmp(&b.1.abs()));
        TableFit {
            rows: used.len(),
            objective: used.iter().map(|&row| huber(problem.residual(row, self.fine[row].amplitude_mm))).sum(),
            rms_log: (logs.iter().map(|log| log * log).sum::<f64>() / logs.len().max(1) as f64).sqrt(),
            median_log,
            worst_log: worst.map_or(0.0, |(_, log)| log.abs()),
            worst_row: worst.map(|(row, _)| row + 1),
        }
    }
}

/// `tried` the best first.
pub(super) fn outcome(
    problem: &Problem<'_>,
    tried: &[Tried],
    certainty: &Certainty,
) -> Result<IdentificationOutcome, Failure> {
    let Some(best) = tried.first() else { return Err(Failure::Internal("a job without laws".to_owned())) };
    let job = problem.job;
    let parameters: Vec<IdentifiedParameter> =
        (0..problem.unknowns.len()).map(|k| parameter(&problem.unknowns[k], best, k, certainty)).collect();
    let name = |k: usize| problem.unknowns[k].parameter.name().to_owned();
    let objective = best.fit(problem).objective;
    let unknown_speed = job.measurements.rows().iter().any(|row| row.spindle_speed_rpm.is_none());
    Ok(IdentificationOutcome {
        identified: IdentifiedFixture {
            spindle_speed_rpm: best.values.spindle_rpm.filter(|_| unknown_speed),
            force: best.values.force.clone(),
            fixture: best.values.vise(stated_clamp(&job.fixture)),
        },
        regeneration: best.law.regeneration,
        amplitude: best.law.amplitude,
        parameters,
        fit: best.fit(problem),
        rows: rows(problem, best)?,
        onsets: onsets(problem, best)?,
        clamp_force: clamp_bounds(job, &best.fine),
        hypotheses: tried
            .iter()
            .map(|one| {
                let fit = one.fit(problem);
                HypothesisFit {
                    regeneration: one.law.regeneration,
                    amplitude: one.law.amplitude,
                    worse_by: fit.objective - objective,
                    fit,
                    values: problem.unknowns.iter().map(|unknown| one.values.get(unknown.parameter)).collect(),
                    simulated_um: one.fine.iter().map(|row| row.amplitude_mm * UM_PER_MM).collect(),
                }
            })
            .collect(),
        correlations: certainty
            .correlations
            .iter()
            .map(|&(i, j, correlation)| ParameterPair { first: name(i), second: name(j), correlation })
            .collect(),
        combinations: certainty
            .combinations
            .iter()
            .map(|(sd, powers)| Combination { standard_deviation: *sd, powers: powers.clone() })
            .collect(),
        evaluations: tried.iter().map(|one| one.found.evaluations).sum(),
        generator: GENERATOR.to_owned(),
    })
}

fn stated_clamp(fixture: &Vise) -> Option<f64> {
    fixture.common().3
}

fn parameter(unknown: &Unknown, best: &Tried, k: usize, certainty: &Certainty) -> IdentifiedParameter {
    let value = best.values.get(unknown.parameter);
    let sd = certainty.sd[k];
    let logarithmic = unknown.parameter.is_logarithmic();
    let moved = |by: f64| if logarithmic { value * by.exp() } else { value + by };
    // An interval beyond the range searched says no more than the range.
    let width = sd.map_or(f64::INFINITY, |sd| INTERVAL * sd);
    let at = best.found.at[k];
    IdentifiedParameter {
        name: unknown.parameter.name().to_owned(),
        unit: unknown.parameter.unit().to_owned(),
        value,
        standard_error: sd.map(|sd| if logarithmic { sd * value } else { sd }).filter(|sd| sd.is_finite()),
        lower: moved(-width).max(unknown.from).min(value),
        upper: moved(width).min(unknown.to).max(value),
        at_bound: !(AT_BOUND..=1.0 - AT_BOUND).contains(&at),
    }
}

fn rows(problem: &Problem<'_>, best: &Tried) -> Result<Vec<IdentifiedRow>, Failure> {
    let mut found: Vec<IdentifiedRow> = Vec::with_capacity(best.fine.len());
    for group in &problem.groups {
        let cut = problem
            .cut(&best.values, group)
            .ok_or_else(|| Failure::Internal("a job that the check refuses".to_owned()))?;
        for &row in &group.rows {
            let (of, fine) = (&problem.job.measurements.rows()[row], best.fine[row]);
            let simulated_um = fine.amplitude_mm * UM_PER_MM;
            found.push(IdentifiedRow {
                row: row + 1,
                teeth: group.teeth,
                spindle_speed_rpm: cut.working.spindle_rpm,
                feed_mm_per_tooth: cut.working.feed_mm,
                depth_mm: of.depth_mm,
                measured_um: of.amplitude_um,
                opened: of.opened,
                used: problem.sigma(row).is_some(),
                simulated_um,
                simulated_error_um: (fine.amplitude_mm - best.coarse[row].amplitude_mm).abs() * UM_PER_MM,
                ratio: of.amplitude_um.map(|measured| simulated_um / measured),
                residual: problem.sigma(row).map(|_| problem.residual(row, fine.amplitude_mm)),
                modulus: fine.modulus,
                clamp_movable_n: fine.movable_n,
                clamp_fixed_n: fine.fixed_n,
            });
        }
    }
    found.sort_by_key(|row| row.row);
    Ok(found)
}

fn onsets(problem: &Problem<'_>, best: &Tried) -> Result<Vec<OnsetFit>, Failure> {
    let mut found = Vec::with_capacity(problem.groups.len());
    for group in &problem.groups {
        checkpoint(problem.monitor)?;
        let cut = problem
            .cut(&best.values, group)
            .ok_or_else(|| Failure::Internal("a job that the check refuses".to_owned()))?;
        let deepest = group.rows.iter().map(|&row| problem.job.measurements.rows()[row].depth_mm).fold(0.0, f64::max);
        let predicted_mm =
            critical_depth(&problem.rules, &cut.holding, &cut.cutting, cut.working, 2.0 * deepest, problem.monitor)?
                .depth_mm;
        let (stable, chatter) = onset_mm(problem, group);
        let above = stable.is_none_or(|depth| predicted_mm.is_none_or(|limit| limit >= depth));
        let below = chatter.is_none_or(|depth| predicted_mm.is_some_and(|limit| limit <= depth));
        found.push(OnsetFit {
            teeth: group.teeth,
            spindle_speed_rpm: cut.working.spindle_rpm,
            feed_mm_per_tooth: cut.working.feed_mm,
            table_stable_mm: stable,
            table_chatter_mm: chatter,
            predicted_mm,
            within: above && below,
        });
    }
    Ok(found)
}

/// Bounds of the clamp force (`fixture/6.4`): a run with closed joints does not depend on it, so each row asks for a force
/// of its own; where no joint opened the clamp force was above it, where one opened below.
fn clamp_bounds(job: &IdentificationJob, predicted: &[Predicted]) -> Option<ClampBounds> {
    let stated = stated_clamp(&job.fixture);
    let rows = job.measurements.rows();
    if stated.is_none() && rows.iter().all(|row| row.opened.is_none()) {
        return None;
    }
    // Demand of the joint in question, and whether it opened.
    let demands: Vec<(usize, f64, bool)> = rows
        .iter()
        .zip(predicted)
        .enumerate()
        .filter(|(_, (row, _))| !row.excluded)
        .map(|(i, (row, of))| {
            let demand = match row.opened {
                Some(OpenedJoint::Movable) => of.movable_n,
                Some(OpenedJoint::Fixed) => of.fixed_n,
                Some(OpenedJoint::Either) | None => of.movable_n.max(of.fixed_n),
            };
            (i, demand, row.opened.is_some())
        })
        .collect();
    let least_n = demands.iter().filter(|d| !d.2).map(|d| d.1).fold(0.0, f64::max);
    let most_n = demands.iter().filter(|d| d.2).map(|d| d.1).reduce(f64::min);
    let contradicted = |force: f64| -> Vec<usize> {
        let mut rows: Vec<usize> =
            demands.iter().filter(|(_, demand, opened)| (force < *demand) != *opened).map(|(i, ..)| i + 1).collect();
        rows.sort_unstable();
        rows
    };
    let mut sorted: Vec<f64> = demands.iter().map(|d| d.1).collect();
    sorted.sort_by(f64::total_cmp);
    // Between two neighbouring demands nothing changes; above the largest no row asks for more.
    let mut candidates: Vec<f64> = sorted.windows(2).map(|pair| 0.5 * (pair[0] + pair[1])).collect();
    candidates.extend(sorted.last().map(|largest| 1.05 * largest));
    let best_n = match most_n {
        Some(most) if least_n < most => 0.5 * (least_n + most),
        _ => candidates
            .iter()
            .copied()
            .min_by_key(|force| contradicted(*force).len())
            .unwrap_or(least_n)
            .max(if most_n.is_none() { 1.05 * least_n } else { 0.0 }),
    };
    Some(ClampBounds {
        least_n,
        most_n,
        consistent: most_n.is_none_or(|most| least_n < most),
        best_n,
        contradicted_rows: contradicted(best_n),
        contradicted_by_stated: stated.map(contradicted),
    })
}
