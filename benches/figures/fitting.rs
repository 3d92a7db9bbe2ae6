//! What fitting costs, and how often it fails.

use precut_calc::calculator::{Calculator, Unwatched};
use precut_calc::feed_schedule::fit::{FitJob, MachinabilityFit};
use precut_calc::receptance_fit::{self, ReceptanceFit};

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

/// A tap test of two modes over so many lines.
pub(crate) fn receptance(lines: usize) -> Result<Measured, String> {
    use std::f64::consts::TAU;
    use std::fmt::Write;
    let mut text = String::from("frequency [Hz],real [um/N],imaginary [um/N]\n");
    // Noise of about 1 %, the same each time.
    let mut noise = (1..).map(|i| f64::sin(12.9898 * f64::from(i)) * 43_758.545).map(|x| 0.02 * (x - x.floor() - 0.5));
    for i in 0..lines {
        let hz = 50.0 + 2950.0 * i as f64 / lines as f64;
        let (mut re, mut im) = (0.0, 0.0);
        for (f, zeta, mass) in [(456.0, 0.03, 0.96), (1448.0, 0.017, 0.177)] {
            let (w, w_k) = (TAU * hz, TAU * f);
            let (a, b) = (w_k * w_k - w * w, 2.0 * zeta * w_k * w);
            re += 1e6 * a / (mass * (a * a + b * b));
            im -= 1e6 * b / (mass * (a * a + b * b));
        }
        let mut off = || noise.next().unwrap_or_default();
        let (re, im) = (re + 0.5 * off(), im + 0.5 * off());
        writeln!(text, "{hz},{re},{im}").map_err(|error| error.to_string())?;
    }
    let mut job: receptance_fit::Job =
        serde_json::from_str(ReceptanceFit::META.examples[0].job).map_err(|error| error.to_string())?;
    job.files[0].text = Some(text);
    cpu_time(|| ReceptanceFit::run(&job, &Unwatched))
}
