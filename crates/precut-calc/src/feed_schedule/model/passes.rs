//! Number of passes and depth of the last, by enumeration: free depths with a given sum make no convex program (`feed/7.1`).

use crate::calculator::{Failure, Message, Monitor};

use crate::feed_schedule::answer::output::{PassTrial, PassesOutcome};
use crate::feed_schedule::job::case::{Case, PassSplit};
use crate::feed_schedule::job::compliance::Held;
use crate::feed_schedule::job::input::Job;
use crate::feed_schedule::job::plan::PassPlan;
use crate::feed_schedule::model::solve::{Solved, Unsolved, solve};

/// Depths tried before the best is refined.
const GRID: usize = 9;
/// Golden-section steps: 0.618^40 of the range is below 1e-8 of it.
const GOLDEN_STEPS: usize = 40;

type Tried = (PassSplit, Case, Solved);

/// The best split, its schedule, and what was tried.
pub(in crate::feed_schedule) fn best(
    job: &Job,
    plan: &PassPlan,
    held: Option<&Held>,
    monitor: &dyn Monitor,
) -> Result<(Case, Solved, PassesOutcome), Unsolved> {
    let mut best: Option<Tried> = None;
    let mut tried = Vec::new();
    let mut why: Option<Unsolved> = None;
    for roughing in 0..=plan.roughing_passes_max {
        monitor.progress(
            // The comparison begins at 0.7.
            0.65 * (f64::from(roughing) / f64::from(plan.roughing_passes_max + 1)),
            Message::new("stage_passes").with("passes", roughing as usize + 1),
        );
        let Some((low, high)) = range(plan, roughing) else {
            tried.push(PassTrial { roughing_passes: roughing, finishing_depth_mm: None, objective: None });
            continue;
        };
        let found = of_count(job, plan, held, roughing, (low, high), monitor)?;
        tried.push(PassTrial {
            roughing_passes: roughing,
            finishing_depth_mm: found.as_ref().map(|found| found.0.finishing_mm),
            objective: found.as_ref().map(|found| found.2.objective),
        });
        match found {
            Some(found) if best.as_ref().is_none_or(|best| found.2.objective < best.2.objective) => best = Some(found),
            // Analysed at the deepest finishing pass; asked for only when nothing at all is feasible.
            None if why.is_none() => why = attempt(job, held, &split(plan, roughing, high), true, monitor).err(),
            _ => {}
        }
    }
    match best {
        Some((split, case, solved)) => {
            let outcome = PassesOutcome {
                roughing_passes: split.roughing_passes,
                roughing_depth_mm: (split.roughing_passes > 0).then_some(split.roughing_mm),
                finishing_depth_mm: split.finishing_mm,
                tried,
            };
            Ok((case, solved, outcome))
        }
        None => Err(why.unwrap_or_else(|| {
            Unsolved::Failed(Failure::OutOfModel(crate::calculator::Finding::new("no_pass_split", "/passes")))
        })),
    }
}

/// Least and largest depth of the finishing pass.
fn range(plan: &PassPlan, roughing: u32) -> Option<(f64, f64)> {
    let (least, most, total) = (plan.depth_min_mm, plan.depth_max_mm, plan.total_depth_mm);
    let (thinnest, thickest) = plan.finishing_mm();
    let slack = 1e-12 * total;
    if roughing == 0 {
        return (total >= thinnest - slack && total <= thickest + slack).then_some((total, total));
    }
    let k = f64::from(roughing);
    let low = thinnest.max(total - k * most);
    let mut high = thickest.min(total - k * least);
    if plan.finishing_not_deeper {
        high = high.min(total / (k + 1.0));
    }
    (low <= high + slack).then_some((low.min(high), high))
}

fn split(plan: &PassPlan, roughing: u32, finishing_mm: f64) -> PassSplit {
    let rest = plan.total_depth_mm - finishing_mm;
    PassSplit {
        roughing_passes: roughing,
        roughing_mm: if roughing > 0 { rest / f64::from(roughing) } else { 0.0 },
        finishing_mm,
    }
}

fn attempt(
    job: &Job,
    held: Option<&Held>,
    split: &PassSplit,
    why: bool,
    monitor: &dyn Monitor,
) -> Result<(Case, Solved), Unsolved> {
    let case = Case::of(job, held, Some(split))?;
    let solved = solve(&case, why, monitor)?;
    Ok((case, solved))
}

/// The best depth of the finishing pass with so many roughing passes: a grid, then golden section about its best.
fn of_count(
    job: &Job,
    plan: &PassPlan,
    held: Option<&Held>,
    roughing: u32,
    (low, high): (f64, f64),
    monitor: &dyn Monitor,
) -> Result<Option<Tried>, Unsolved> {
    let mut best: Option<Tried> = None;
    let value = |depth: f64, best: &mut Option<Tried>| -> Result<f64, Unsolved> {
        let split = split(plan, roughing, depth);
        match attempt(job, held, &split, false, monitor) {
            Ok((case, solved)) => {
                let objective = solved.objective;
                if best.as_ref().is_none_or(|best| objective < best.2.objective) {
                    *best = Some((split, case, solved));
                }
                Ok(objective)
            }
            Err(Unsolved::Infeasible(_)) => Ok(f64::INFINITY),
            Err(failed) => Err(failed),
        }
    };
    if high - low <= 1e-9 * high {
        value(high, &mut best)?;
        return Ok(best);
    }
    let step = (high - low) / (GRID - 1) as f64;
    let depths: Vec<f64> = (0..GRID).map(|k| if k + 1 == GRID { high } else { low + step * k as f64 }).collect();
    let mut values = Vec::with_capacity(GRID);
    for &depth in &depths {
        values.push(value(depth, &mut best)?);
    }
    let Some(at) = (0..GRID).filter(|&k| values[k].is_finite()).min_by(|&a, &b| values[a].total_cmp(&values[b])) else {
        return Ok(None);
    };
    let (mut a, mut b) = (depths[at.saturating_sub(1)], depths[(at + 1).min(GRID - 1)]);
    let ratio = 0.5 * (5.0_f64.sqrt() - 1.0);
    let (mut c, mut d) = (b - ratio * (b - a), a + ratio * (b - a));
    let (mut fc, mut fd) = (value(c, &mut best)?, value(d, &mut best)?);
    for _ in 0..GOLDEN_STEPS {
        if fc < fd {
            (b, d, fd) = (d, c, fc);
            c = b - ratio * (b - a);
            fc = value(c, &mut best)?;
        } else {
            (a, c, fc) = (c, d, fd);
            d = a + ratio * (b - a);
            fd = value(d, &mut best)?;
        }
    }
    Ok(best)
}
