//! What turning a ring costs: per angular step, and beside the source paper's algorithm written as plainly as the paper
//! has it.

use std::f64::consts::TAU;

use precut_calc::calculator::{Calculator, ForwardModel, Rows, Unwatched};
use precut_calc::ring_roundness::{Job, RingPoint, RingRoundness, RingRun};
use serde_json::{Value, json};

use crate::measure::{Measured, cpu_time};

/// The paper's ring with a clear start.
fn job(more: &Value) -> Result<Job, String> {
    let mut job = json!({
        "ring": { "radius_mm": 150, "ellipticity_mm": 0.5 },
        "supports": { "distance_mm": 200, "depth_mm": 111 },
        "tool": { "x_mm": 100, "y_mm": 113.5, "feed_mm_per_rev": 0.023_437_5, "revolutions": 107 }
    });
    for (name, value) in more.as_object().into_iter().flatten() {
        job[name] = value.clone();
    }
    let mut job: Job = serde_json::from_value(job).map_err(|error| error.to_string())?;
    RingRoundness::fill(&mut job);
    Ok(job)
}

fn per(measured: Measured, count: f64) -> Measured {
    Measured { median: measured.median / count, low: measured.low / count, high: measured.high / count }
}

/// One step of one run: the forward model turns with 7200 nodes and reads one angle off.
pub(crate) fn step(rollers: bool) -> Result<Measured, String> {
    let rolling = json!({
        "supports": { "distance_mm": 226.773_378, "depth_mm": 125.859_225, "roller_radius_mm": 20 },
        "tool": { "x_mm": 100, "y_mm": 113.5, "feed_mm_per_rev": 0.039_062_5, "revolutions": 64 }
    });
    let job = job(&if rollers { rolling } else { json!({}) })?;
    let rows = Rows { runs: vec![RingRun::default()], points: vec![(0, RingPoint { angle_deg: 0.0 })] };
    let prepared =
        RingRoundness::prepare(&job, &rows, "radius_mm", &Unwatched).map_err(|_| "not prepared".to_owned())?;
    let steps = 7200.0 * job.tool.revolutions;
    Ok(per(cpu_time(|| RingRoundness::predict(&prepared, &[], &Unwatched))?, steps))
}

/// The whole answer to the paper's run of 256 revolutions: two runs, history, circles, spectrum.
pub(crate) fn answer() -> Result<Measured, String> {
    let job = job(&json!({
        "tool": { "x_mm": 100, "y_mm": 112.5, "feed_mm_per_rev": 0.005_859_375, "revolutions": 256 }
    }))?;
    cpu_time(|| RingRoundness::run(&job, &Unwatched))
}

/// Set-up map of 91 x 61 cells up to 20 lobes.
pub(crate) fn map() -> Result<Measured, String> {
    let job = job(&json!({ "analyses": ["setup_map"], "compliance_ratio": 0.5 }))?;
    cpu_time(|| RingRoundness::run(&job, &Unwatched))
}

/// One step of the paper's algorithm at N = 3600 as it stands in the paper: all points turned, all distances to both
/// supports until the shift settles, all distances to the tip, the nearest point moved onto the tip.
pub(crate) fn plain_paper() -> Result<Measured, String> {
    const N: u32 = 3600;
    const STEPS: u32 = 20;
    let body: Vec<[f64; 2]> = (0..N)
        .map(|i| {
            let theta = TAU * f64::from(i) / f64::from(N);
            [150.25 * theta.cos(), 149.75 * theta.sin()]
        })
        .collect();
    let run = || {
        let mut body = body.clone();
        let mut shift = [0.0, 0.0];
        for step in 0..STEPS {
            let phi = TAU * f64::from(step) / f64::from(N);
            let turned: Vec<[f64; 2]> = body
                .iter()
                .map(|p| [p[0] * phi.cos() - p[1] * phi.sin(), p[0] * phi.sin() + p[1] * phi.cos()])
                .collect();
            for _ in 0..100 {
                let a = [-100.0 - shift[0], -111.0 - shift[1]];
                let b = [100.0 - shift[0], -111.0 - shift[1]];
                let (at_a, at_b) = (turned[nearest(&turned, a)], turned[nearest(&turned, b)]);
                let dx = f64::midpoint(a[0] - at_a[0], b[0] - at_b[0]);
                let dy = f64::midpoint(a[1] - at_a[1], b[1] - at_b[1]);
                shift = [shift[0] + dx, shift[1] + dy];
                if dx.hypot(dy) < 1e-7 {
                    break;
                }
            }
            let tip = [100.0 - shift[0], 112.5 - 1.5 / 256.0 * phi / TAU - shift[1]];
            let cut = nearest(&turned, tip);
            body[cut] = [tip[0] * phi.cos() + tip[1] * phi.sin(), -tip[0] * phi.sin() + tip[1] * phi.cos()];
        }
        body
    };
    Ok(per(cpu_time(run)?, f64::from(STEPS)))
}

fn nearest(points: &[[f64; 2]], to: [f64; 2]) -> usize {
    let mut best = (0, f64::INFINITY);
    for (i, p) in points.iter().enumerate() {
        let distance = ((p[0] - to[0]).powi(2) + (p[1] - to[1]).powi(2)).sqrt();
        if distance < best.1 {
            best = (i, distance);
        }
    }
    best.0
}
