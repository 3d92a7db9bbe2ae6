//! How many nodes a run gets.

use crate::ring_roundness::job::check::mean_radius_mm;
use crate::ring_roundness::job::input::{DEFAULT_SAMPLES, Job, LongWave, Method};
use crate::ring_roundness::model::scene::Scene;

/// Points of the paper's algorithm where the job states none: those with which it comes nearest to its published figures.
const NEAREST_SAMPLES: u32 = 500;
/// Most nodes that are chosen where the job states none.
pub(in crate::ring_roundness) const MOST_CHOSEN: u32 = 57_600;
/// Nodes per tooth.
const PER_TOOTH: f64 = 12.0;

/// Nodes of the job.
pub(in crate::ring_roundness) fn samples_of(job: &Job) -> u32 {
    match (job.samples, job.method, job.filter) {
        (Some(samples), _, _) => samples,
        (None, Method::NearestSamples, _) => NEAREST_SAMPLES,
        (None, Method::ExactContact, LongWave::None) => samples_for_teeth(job).clamp(DEFAULT_SAMPLES, MOST_CHOSEN),
        (None, Method::ExactContact, _) => DEFAULT_SAMPLES,
    }
}

/// Nodes that resolve the teeth of the surface: N >= 12·2π max|dW/dθ|/D', W the local diameter of the blank, D' what the
/// tool takes off it in half a revolution (`ring/8.2`). A multiple of 720.
pub(in crate::ring_roundness) fn samples_for_teeth(job: &Job) -> u32 {
    let scene = Scene::of(job, &job.effects);
    let (Some(end), Some(_)) = (scene.end(), mean_radius_mm(job)) else { return DEFAULT_SAMPLES };
    let reduction = end.radius_per_feed(scene.setting.feed_direction) * scene.setting.feed_mm_per_rev;
    // Steeper waves than the grid holds cannot be asked of it.
    let Ok(blank) = scene.blank_mm(job, DEFAULT_SAMPLES as usize) else { return DEFAULT_SAMPLES };
    let n = blank.len();
    let width = |i: usize| blank[i % n] + blank[(i + n / 2) % n];
    let steepest = (0..n / 2).map(|i| (width(i + 1) - width(i)).abs()).fold(0.0, f64::max);
    // 2π dW/dθ = n dW per node.
    let needed = PER_TOOTH * n as f64 * steepest / reduction;
    rounded_up(needed)
}

#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "clamped far below 2^32")]
fn rounded_up(needed: f64) -> u32 {
    (needed / 720.0).ceil().clamp(1.0, 1e5) as u32 * 720
}
