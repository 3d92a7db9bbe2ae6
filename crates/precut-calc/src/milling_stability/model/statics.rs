//! Force, torque and what they do over a period with undisturbed chips (`milling/2.9`).

use crate::calculator::{Failure, Monitor, Pace};
use crate::num::quadrature::gauss_legendre;

use super::cutter::{Milling, Vector};
use super::edge::Edges;

/// Gauss points of a smooth stretch.
const POINTS: usize = 12;
/// Samples of a smooth stretch before an extreme is refined by a parabola.
const SAMPLES: u32 = 32;

/// Force on the tool and torque against the spindle over a period of the cut.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Statics {
    /// Mean force, N.
    pub mean_n: Vector,
    /// Least of each direction, N.
    pub min_n: Vector,
    /// Largest of each direction, N.
    pub max_n: Vector,
    /// Mean torque, N mm.
    pub torque_mean_n_mm: f64,
    /// Its largest value, N mm.
    pub torque_max_n_mm: f64,
}

/// Of a depth.
pub fn statics(milling: &Milling, depth_mm: f64, monitor: &dyn Monitor) -> Result<Statics, Failure> {
    let mut pace = Pace::new(monitor);
    let edges = Edges::new(milling, depth_mm);
    let period = milling.period_rad();
    let mut ends = edges.rotations();
    ends.extend([0.0, period]);
    ends.sort_by(f64::total_cmp);
    ends.dedup_by(|a, b| (*a - *b).abs() < 1e-10);
    let (points, weights) = gauss_legendre(POINTS);
    let of = |rotation: f64| {
        let ([x, y, z], torque) = edges.force(rotation);
        [x, y, z, torque]
    };
    let mut mean = [0.0; 4];
    let (mut low, mut high) = ([f64::INFINITY; 4], [f64::NEG_INFINITY; 4]);
    for pair in ends.windows(2) {
        let length = pair[1] - pair[0];
        pace.work((POINTS + SAMPLES as usize) * edges.work())?;
        for (c, w) in points.iter().zip(&weights) {
            for (sum, value) in mean.iter_mut().zip(of(pair[0] + c * length)) {
                *sum += value * w * length / period;
            }
        }
        // A hair inside: the ends are one-sided limits.
        let at = |step: u32| of(pair[0] + length * (f64::from(step) / f64::from(SAMPLES)).clamp(1e-9, 1.0 - 1e-9));
        let values: Vec<[f64; 4]> = (0..=SAMPLES).map(at).collect();
        for q in 0..4 {
            let (least, largest) = extremes(values.iter().map(|value| value[q]));
            low[q] = low[q].min(least);
            high[q] = high[q].max(largest);
        }
    }
    let three = |of: [f64; 4]| [of[0], of[1], of[2]];
    Ok(Statics {
        mean_n: three(mean),
        min_n: three(low),
        max_n: three(high),
        torque_mean_n_mm: mean[3],
        torque_max_n_mm: high[3],
    })
}

/// Least and largest of evenly spaced samples, between them by a parabola.
fn extremes(samples: impl Iterator<Item = f64>) -> (f64, f64) {
    let values: Vec<f64> = samples.collect();
    let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
    let mut take = |value: f64| {
        low = low.min(value);
        high = high.max(value);
    };
    values.iter().copied().for_each(&mut take);
    for three in values.windows(3) {
        let (before, here, next) = (three[0], three[1], three[2]);
        let curvature = before - 2.0 * here + next;
        if (here - before) * (next - here) < 0.0 {
            let slope = 0.5 * (next - before);
            take(here - 0.5 * slope * slope / curvature);
        }
    }
    (low, high)
}
