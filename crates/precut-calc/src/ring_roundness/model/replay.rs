//! The surface revolution by revolution, thinned out and rounded for the eye.

use crate::calculator::Failure;
use crate::num::roundness::{Circle, Grid, least_squares};

use crate::ring_roundness::answer::output::{ReplayFrame, ReplayOutcome};
use crate::ring_roundness::model::scene::{Scene, mirrored_rad};
use crate::ring_roundness::model::surface::{UM_PER_MM, unevaluable};
use crate::ring_roundness::model::turning::plane::{direction, norm, scaled, sub};

/// Angles of a frame at most.
pub(in crate::ring_roundness) const MOST_POINTS: u64 = 360;
/// A frame is rounded to this share of its deviation or finer: a tenth of a pixel of a chart.
const GRAIN: f64 = 5e-4;
/// Powers of ten to round by, exact.
const SCALES: [f64; 7] = [1.0, 1e1, 1e2, 1e3, 1e4, 1e5, 1e6];

/// Keeps frames of a run.
pub(in crate::ring_roundness) struct Recorder<'s> {
    scene: &'s Scene,
    /// One frame in so many revolutions.
    every: u64,
    /// Tool angle in space at the end of the feed, deg.
    tool_deg: f64,
    frames: Vec<ReplayFrame>,
}

impl<'s> Recorder<'s> {
    /// At most `frames` of a run of `total` revolutions; `None` where none are wanted.
    pub(in crate::ring_roundness) fn new(scene: &'s Scene, frames: u32, total: f64) -> Option<Self> {
        let tool_rad = scene.end()?.tool_rad();
        (frames > 0).then(|| Self {
            scene,
            every: whole((total / f64::from(frames)).ceil().max(1.0)),
            tool_deg: mirrored_rad(tool_rad, scene.mirrored).to_degrees(),
            frames: Vec::new(),
        })
    }

    /// After a revolution, the `seen`-th; `radii_mm` as the kernel has them, `is_last` where none follows.
    pub(in crate::ring_roundness) fn see(
        &mut self,
        (seen, is_last): (u64, bool),
        turned: f64,
        radii_mm: &[f64],
        grid: &Grid,
    ) -> Result<(), Failure> {
        if !seen.is_multiple_of(self.every) && !is_last {
            return Ok(());
        }
        // A run may end a node behind a whole revolution: that is the same frame.
        if is_last && self.frames.last().is_some_and(|frame| turned - frame.revolution < 2.0 / radii_mm.len() as f64) {
            self.frames.pop();
        }
        let radii_mm = self.scene.unmirrored(radii_mm.to_vec());
        let section = grid.section(&radii_mm).map_err(unevaluable)?;
        let circle = least_squares(&section, &|| true).map_err(unevaluable)?.circle;
        let sense = if self.scene.mirrored { -1.0 } else { 1.0 };
        let turns = turned * (1.0 - self.scene.setting.motion.slip);
        self.frames.push(ReplayFrame {
            revolution: turned,
            tool_angle_deg: (self.tool_deg - sense * 360.0 * turns.fract()).rem_euclid(360.0),
            deviation_um: rounded(nodes(radii_mm.len()).map(|at| deviation_um(&radii_mm, at, circle)).collect()),
        });
        Ok(())
    }

    pub(in crate::ring_roundness) fn replay(self, n: usize) -> ReplayOutcome {
        let angle_deg = nodes(n).map(|at| 360.0 * at as f64 / n as f64).collect();
        ReplayOutcome { angle_deg, frames: self.frames }
    }
}

#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "revolutions below 1e8")]
fn whole(count: f64) -> u64 {
    count as u64
}

/// The nodes that are kept of so many.
fn nodes(n: usize) -> impl Iterator<Item = usize> {
    let most = usize::try_from(MOST_POINTS).unwrap_or(usize::MAX).min(n);
    (0..most).map(move |i| i * n / most)
}

fn deviation_um(radii_mm: &[f64], at: usize, circle: Circle) -> f64 {
    let angle = std::f64::consts::TAU * at as f64 / radii_mm.len() as f64;
    (norm(sub(scaled(direction(angle), radii_mm[at]), circle.centre_mm)) - circle.radius_mm) * UM_PER_MM
}

/// To as many decimals as the grain asks for: short in writing.
fn rounded(deviations_um: Vec<f64>) -> Vec<f64> {
    let size = deviations_um.iter().fold(0.0_f64, |size, deviation| size.max(deviation.abs()));
    let scale = SCALES.into_iter().find(|scale| 1.0 / scale <= GRAIN * size).unwrap_or(SCALES[SCALES.len() - 1]);
    deviations_um.into_iter().map(|deviation| (deviation * scale).round() / scale + 0.0).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rounding_keeps_the_grain_and_writes_short() {
        let frame = rounded(vec![-138.456_789, 0.049, 276.0, -0.001]);
        // The grain of 276 is 0.138: one decimal.
        assert_eq!(format!("{frame:?}"), "[-138.5, 0.0, 276.0, 0.0]");
        assert_eq!(format!("{:?}", rounded(vec![0.012_345_678, -0.2])), "[0.0123, -0.2]");
        assert_eq!(rounded(vec![0.0; 3]), [0.0; 3]);
    }

    #[test]
    fn few_nodes_are_all_kept_and_many_evenly() {
        assert_eq!(nodes(100).count(), 100);
        assert_eq!(nodes(3600).take(3).collect::<Vec<_>>(), [0, 10, 20]);
        assert_eq!(nodes(1000).last(), Some(997));
    }
}
