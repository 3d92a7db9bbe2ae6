//! The parameter set that fits a table best under one law.

use crate::calculator::{Failure, Message, checkpoint};
use crate::num::evolve::{Evolution, Member, evolve, simplex};

use super::input::AmplitudeMeaning;
use super::problem::{Law, Problem};

/// Values of the last refinement per unknown, size of its first simplex and of its last.
const REFINEMENTS: u32 = 40;
const SIMPLEX: (f64, f64) = (0.02, 2e-4);

/// A parameter set with its objective.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Found {
    pub at: Vec<f64>,
    pub objective: f64,
    pub evaluations: u64,
}

/// Where the search stands: what part of it, from 0 to 1.
pub(super) type Progress<'a> = &'a dyn Fn(f64, Message);

fn evolution(problem: &Problem<'_>) -> Evolution {
    let of = &problem.job.search;
    Evolution { members: of.members as usize, generations: of.generations, seed: u64::from(of.seed) }
}

/// Coordinates of what the job states.
fn stated(problem: &Problem<'_>) -> Vec<f64> {
    let values = problem.values(&[]);
    problem.unknowns.iter().map(|unknown| unknown.coordinate(values.get(unknown.parameter))).collect()
}

/// Sets that fit stable rows and the onset, found without runs in time (`fixture/6.2`).
pub(super) fn first_sets(
    problem: &Problem<'_>,
    amplitude: AmplitudeMeaning,
    progress: Progress<'_>,
) -> Result<Vec<Member>, Failure> {
    let settings = evolution(problem);
    let objective = |at: &[f64], _: f64| unless_cancelled(problem, || problem.quick(at, amplitude));
    let found = evolve(problem.unknowns.len(), &[stated(problem)], &settings, &objective, &mut |generation, best| {
        let part = f64::from(generation) / f64::from(settings.generations);
        progress(part, Message::new("stage_identification_first").with("objective", best.value));
    });
    found.ok_or(Failure::Cancelled)
}

/// A value of the search; none once nobody waits for it. A set whose multiplier does not converge is no set.
fn unless_cancelled(problem: &Problem<'_>, value: impl Fn() -> Result<f64, Failure>) -> Option<f64> {
    match checkpoint(problem.monitor).and_then(|()| value()) {
        Err(Failure::Cancelled) => None,
        Err(_) => Some(f64::INFINITY),
        Ok(value) => Some(value),
    }
}

/// The best set: evolved from the first sets and as many others, then refined (`fixture/6.1`).
pub(super) fn best_set(
    problem: &Problem<'_>,
    law: Law,
    first: &[Member],
    progress: Progress<'_>,
) -> Result<Found, Failure> {
    let settings = evolution(problem);
    let value = |at: &[f64], bound: f64| unless_cancelled(problem, || problem.objective(at, law, bound));
    let mut begin: Vec<Vec<f64>> = vec![stated(problem)];
    begin.extend(first.iter().take(settings.members / 2).map(|member| member.at.clone()));
    let mut generations = 0;
    let said = |part: f64, best: f64| {
        let message = Message::new("stage_identification_search")
            .with("law", law.regeneration.name())
            .with("amplitude", law.amplitude.name());
        progress(part, message.with("objective", best));
    };
    let population = evolve(problem.unknowns.len(), &begin, &settings, &value, &mut |generation, best| {
        generations = generation + 1;
        said(0.8 * f64::from(generation) / f64::from(settings.generations), best.value);
    });
    let Some(best) = population.ok_or(Failure::Cancelled)?.into_iter().next() else {
        return Err(Failure::Internal("a search without members".to_owned()));
    };
    let most = REFINEMENTS * u32::try_from(problem.unknowns.len()).unwrap_or(1);
    let mut refinements = 0;
    let refined = simplex(&best, SIMPLEX.0, SIMPLEX.1, most, &|at| value(at, f64::INFINITY), &mut |taken| {
        refinements = taken;
        said(0.8 + 0.2 * f64::from(taken) / f64::from(most), best.value);
    })
    .ok_or(Failure::Cancelled)?;
    if !refined.value.is_finite() {
        return Err(Failure::NotConverged {
            what: "identification of fixture parameters",
            residual: 1.0,
            iterations: generations,
        });
    }
    let evaluations = settings.members as u64 * u64::from(generations + 1) + u64::from(refinements);
    Ok(Found { at: refined.at, objective: refined.value, evaluations })
}
