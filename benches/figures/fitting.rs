//! What fitting costs, and how often it fails.

use precut_calc::calculator::{Calculator, Unwatched};
use precut_calc::feed_schedule::fit::{FitJob, MachinabilityFit};

use crate::measure::{Measured, cpu_time};
use crate::strd;

const ABSENT: &str = "the reference problems are not beside the repository";

/// All 27 problems from both starts.
pub(crate) fn nist_time() -> Result<Measured, String> {
    let problems = strd::problems().ok_or(ABSENT)?;
    cpu_time(|| problems.iter().flat_map(|problem| [problem.solve(0), problem.solve(1)]).collect::<Vec<_>>())
}

/// How many of the 54 runs agree with the certificate to fewer digits.
pub(crate) fn nist_missed(digits: f64) -> Result<Measured, String> {
    let problems = strd::problems().ok_or(ABSENT)?;
    let runs = problems.iter().flat_map(|problem| [0, 1].map(|start| (problem, start)));
    let missed = runs
        .filter(|(problem, start)| problem.solve(*start).map_or(true, |fit| problem.digits(&fit.parameters) < digits));
    let missed = missed.count() as f64;
    Ok(Measured { median: missed, low: missed, high: missed })
}

/// The first example of the fit of machinability models.
pub(crate) fn machinability(resamples: u32) -> Result<Measured, String> {
    let mut job: FitJob =
        serde_json::from_str(MachinabilityFit::META.examples[0].job).map_err(|error| error.to_string())?;
    job.resamples = resamples;
    cpu_time(|| MachinabilityFit::run(&job, &Unwatched))
}
