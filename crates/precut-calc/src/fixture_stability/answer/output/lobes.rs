//! Limits and multiplier over the spindle speed.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::{BetterSpeed, SpeedLimit};

/// The lobe diagram.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct LobeDiagram {
    /// The traced boundary, by spindle speed.
    pub boundary: LobeBoundary,
    /// Lowest limit on it.
    pub lowest: Option<SpeedLimit>,
    /// Speeds at which more can be removed than at the working speed, each tried, the highest removal rate first.
    pub better_speeds: Vec<BetterSpeed>,
    /// |multiplier| over the plane, where it was asked for.
    pub map: Option<LobeMap>,
}

/// The traced boundary: one entry per spindle speed.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct LobeBoundary {
    /// Spindle speed.
    #[schema(extensions(("x-unit" = json!("rev/min"))))]
    pub spindle_speed_rpm: Vec<f64>,
    /// Depth up to which limits are looked for: the greatest of the diagram; less where joints harden and no forced motion
    /// is found in a deeper cut.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub depth_examined_mm: Vec<f64>,
    /// Depth at which chatter begins; null where none begins up to the depth examined.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub chatter_mm: Vec<Option<f64>>,
    /// Depth at which it ends again (above an island), where it does.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub stable_again_mm: Vec<Option<f64>>,
    /// Depth at which the forced peak-to-peak displacement exceeds the feed per tooth, without chatter.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub amplitude_mm: Vec<Option<f64>>,
    /// Depth at which the joint at the movable jaw opens at the given clamp force, without chatter.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub movable_opens_mm: Vec<Option<f64>>,
    /// That at the fixed jaw.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub fixed_opens_mm: Vec<Option<f64>>,
    /// Depth at which the workpiece slips along the jaws at the given clamp force and the lowest friction, without chatter; null where none of both is given, too.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub slips_mm: Vec<Option<f64>>,
    /// Depth at which the power of the spindle gives out, up to the greatest depth.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub power_mm: Vec<Option<f64>>,
    /// Depth at which the torque of the spindle gives out, up to the greatest depth.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub torque_mm: Vec<Option<f64>>,
    /// The zeroth-order approximation.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub zeroth_order_mm: Vec<Option<f64>>,
}

impl LobeBoundary {
    /// How deep was looked where no chatter begins; `None` where that is the same at every speed.
    pub(in crate::fixture_stability) fn examined_without_chatter_mm(&self) -> Option<Vec<Option<f64>>> {
        /// Of the depth; beyond the round-off of a depth, which is a share of the greatest.
        const SAME: f64 = 1e-9;
        let greatest = self.depth_examined_mm.iter().copied().fold(0.0, f64::max);
        let without = self.depth_examined_mm.iter().zip(&self.chatter_mm);
        let depths: Vec<Option<f64>> = without.map(|(depth, chatter)| chatter.is_none().then_some(*depth)).collect();
        depths.iter().flatten().any(|depth| *depth < (1.0 - SAME) * greatest).then_some(depths)
    }

    /// How deep one may cut at each speed: the least of all limits, no deeper than was looked.
    pub(in crate::fixture_stability) fn safe_mm(&self) -> Vec<f64> {
        let limits = [
            &self.chatter_mm,
            &self.amplitude_mm,
            &self.movable_opens_mm,
            &self.fixed_opens_mm,
            &self.power_mm,
            &self.torque_mm,
        ];
        let least = |at: usize| {
            limits.iter().filter_map(|limit| limit.get(at).copied().flatten()).fold(f64::INFINITY, f64::min)
        };
        self.depth_examined_mm.iter().enumerate().map(|(at, depth)| depth.min(least(at))).collect()
    }
}

/// |multiplier| over speed and depth.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct LobeMap {
    /// Spindle speeds of the columns.
    #[schema(extensions(("x-unit" = json!("rev/min"))))]
    pub spindle_speed_rpm: Vec<f64>,
    /// Depths of the rows.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub depth_mm: Vec<f64>,
    /// Modulus per tooth period, row by row; null where joints harden and no forced motion is found about which to ask.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub modulus: Vec<Option<f64>>,
    /// Points of the boundary found by halving cells, spindle speeds.
    #[schema(extensions(("x-unit" = json!("rev/min"))))]
    pub refined_speed_rpm: Vec<f64>,
    /// The same, depths.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub refined_depth_mm: Vec<f64>,
}

impl LobeMap {
    pub(in crate::fixture_stability) fn of(map: crate::fixture_stability::model::lobes::Map) -> Self {
        let (refined_speed_rpm, refined_depth_mm) = map.refined.into_iter().unzip();
        Self {
            spindle_speed_rpm: map.speeds_rpm,
            depth_mm: map.depths_mm,
            modulus: map.modulus.into_iter().map(|modulus| Some(modulus).filter(|m| m.is_finite())).collect(),
            refined_speed_rpm,
            refined_depth_mm,
        }
    }
}
