//! What a diagnosis costs: adequacy, every cause and every pair of them, held-out tests, intervals.

use precut_calc::calculator::{Calculator, Unwatched};
use precut_calc::deflection_compensation::DeflectionCompensation;
use precut_calc::diagnosis::{Diagnosis, JobOf};
use serde_json::{Value, json};

use crate::measure::{Measured, cpu_time};

type Of = Diagnosis<DeflectionCompensation>;

/// The first example, a soft headstock over five cuts, measured at as many places along each cut.
fn measured_at(places: usize) -> Result<JobOf<DeflectionCompensation>, String> {
    const Z: &str = "z_mm";
    const Y: &str = "diameter_deviation_um";
    let example = Of::META.examples.first().ok_or("no example")?;
    let mut job: Value = serde_json::from_str(example.job).map_err(|error| error.to_string())?;
    let traces = job["measurements"].as_array().ok_or("no measurements")?;
    let mut runs: Vec<(u64, Vec<(f64, f64)>)> = Vec::new();
    for row in traces {
        let (Some(run), Some(z), Some(y)) = (row["run"].as_u64(), row[Z].as_f64(), row[Y].as_f64()) else {
            return Err("the example's rows have changed".to_owned());
        };
        match runs.iter_mut().find(|(known, _)| *known == run) {
            Some((_, points)) => points.push((z, y)),
            None => runs.push((run, vec![(z, y)])),
        }
    }
    let mut rows = Vec::new();
    for (run, points) in &runs {
        let (first, last) = (points[0].0, points[points.len() - 1].0);
        for place in 0..places {
            let z = first + (last - first) * place as f64 / (places - 1) as f64;
            // Noise of the gauge, about 0.5 um, the same in every run of this program.
            let noise = 0.7 * (12.9898 * (rows.len() + 1) as f64).sin();
            rows.push(json!({"run": run, "trace": 1, Z: z, Y: between(points, z) + noise}));
        }
    }
    job["measurements"] = rows.into();
    let mut job: JobOf<DeflectionCompensation> = serde_json::from_value(job).map_err(|error| error.to_string())?;
    Of::fill(&mut job);
    Ok(job)
}

fn between(points: &[(f64, f64)], z: f64) -> f64 {
    let next = points.iter().position(|point| point.0 >= z).unwrap_or(points.len() - 1).max(1);
    let ((a, from), (b, to)) = (points[next - 1], points[next]);
    from + (to - from) * (z - a) / (b - a)
}

/// A complete diagnosis with five runs of so many points.
pub(crate) fn deflection(places: usize) -> Result<Measured, String> {
    let job = measured_at(places)?;
    // It is to be measured, not refused.
    Of::run(&job, &Unwatched).map_err(|failure| format!("{failure:?}"))?;
    cpu_time(|| Of::run(&job, &Unwatched))
}
