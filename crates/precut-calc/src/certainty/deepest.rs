//! How deep one may cut with a probability.

use crate::calculator::Failure;

use super::normal_quantile;

/// Steps toward the depth of a probability, and how near to it is enough, in standard normal scores.
const STEPS: usize = 24;
const NEAR_ENOUGH: f64 = 0.01;
/// Change of the logarithm of the depth by which the way to the wanted probability is begun.
const FIRST_STEP: f64 = 0.1;
/// Least depth that is looked at, as a share of the deepest.
const LEAST: f64 = 1e-3;

/// Deepest cut up to `deepest_mm` with a probability, looked for from `from_mm` on: the standard normal score is nearly straight over
/// the logarithm of the depth. `None` where not even a thousandth of it is.
pub(crate) fn deepest_mm(
    from_mm: f64,
    deepest_mm: f64,
    wanted: f64,
    probability: &mut dyn FnMut(f64) -> Result<f64, Failure>,
) -> Result<Option<f64>, Failure> {
    // From the side on which the probability is kept.
    let mut over = |depth_mm: f64| -> Result<f64, Failure> {
        Ok(normal_quantile(probability(depth_mm)?) - normal_quantile(wanted) - 0.5 * NEAR_ENOUGH)
    };
    let (mut low, mut high) = (None, None);
    let least_mm = LEAST * deepest_mm;
    let mut depth_mm = from_mm.clamp(least_mm, deepest_mm);
    let mut step = FIRST_STEP;
    for _ in 0..STEPS {
        let here = over(depth_mm)?;
        if here.abs() < 0.5 * NEAR_ENOUGH {
            return Ok(Some(depth_mm));
        }
        if here > 0.0 {
            low = Some((depth_mm, here));
        } else {
            high = Some((depth_mm, here));
        }
        depth_mm = match (low, high) {
            (Some((from, above)), Some((to, below))) => {
                let share: f64 = above / (above - below);
                from * (to / from).powf(share.clamp(0.1, 0.9))
            }
            (Some((from, _)), None) if from >= deepest_mm => return Ok(Some(deepest_mm)),
            (None, Some((to, _))) if to <= least_mm => return Ok(None),
            (Some((from, _)), None) => (from * step.exp()).min(deepest_mm),
            (None, Some((to, _))) => (to * (-step).exp()).max(least_mm),
            (None, None) => return Ok(None),
        };
        step *= 2.0;
    }
    Ok(low.map(|(depth_mm, _)| depth_mm))
}
