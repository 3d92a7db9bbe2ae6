//! A setting of tool and supports by their angles: where they must stand for a blank, and how the tool is fed.

use crate::ring_roundness::model::stance::{Copying, at_radius};
use crate::ring_roundness::model::turning::Setting;
use crate::ring_roundness::model::turning::plane::{add, direction, norm, scaled, sub, unit};

/// Where tool and supports stand, seen from the ring's centre.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::ring_roundness) struct Angles {
    pub half_angle_rad: f64,
    /// In the kernel's frame, in which the ring turns counter-clockwise.
    pub tool_rad: f64,
}

impl Angles {
    pub(in crate::ring_roundness) fn copying(&self) -> Copying {
        Copying::of_angles(self.half_angle_rad, self.tool_rad)
    }
}

/// A setting at given angles, without its feed.
#[derive(Debug, Clone)]
pub(in crate::ring_roundness) struct Placed {
    /// Without its feed.
    setting: Setting,
    pub travel_mm: f64,
    /// Radius that the ring loses per mm of feed.
    pub radius_per_feed: f64,
}

/// Between which radii of the circle through the tip a blank is first and last touched, mm.
///
/// The tip meets r_T - a r_A - b r_B of the blank; on a circle of radius R that is R (1 - a - b).
pub(in crate::ring_roundness) fn touched_mm(blank: &[f64], copying: &Copying) -> (f64, f64) {
    let n = blank.len();
    let nodes = |delay: f64| rounded(delay / std::f64::consts::TAU * n as f64);
    let (to_a, to_b) = (nodes(copying.delay_a_rad), nodes(copying.delay_b_rad));
    let whole = 1.0 - copying.a - copying.b;
    (0..n)
        .map(|i| (blank[i] - copying.a * blank[(i + to_a) % n] - copying.b * blank[(i + to_b) % n]) / whole)
        .fold((f64::INFINITY, f64::NEG_INFINITY), |(low, high), radius| (low.min(radius), high.max(radius)))
}

impl Placed {
    /// The supports at the depth of `base`; the tool starts at a radius of `from_mm` and ends at `to_mm`, at the same
    /// angle at both. `None` where the ring would not rest so.
    pub(in crate::ring_roundness) fn new(base: &Setting, angles: Angles, from_mm: f64, to_mm: f64) -> Option<Self> {
        let mut setting = base.clone();
        let half = (to_mm + base.roller_radius_mm) * angles.half_angle_rad.sin();
        let y = f64::midpoint(base.support_a_mm[1], base.support_b_mm[1]);
        (setting.support_a_mm, setting.support_b_mm) = ([-half, y], [half, y]);
        let tip = |radius: f64| {
            let rest = at_radius(&setting, [0.0; 2], radius)?;
            Some(add(rest.centre_mm, scaled(direction(angles.tool_rad), radius)))
        };
        let (start, end) = (tip(from_mm)?, tip(to_mm)?);
        let way = sub(end, start);
        let travel_mm = norm(way);
        // Also refuses what is no number.
        let moves = travel_mm > 0.0 && from_mm > to_mm;
        if !moves {
            return None;
        }
        setting.tip_start_mm = start;
        setting.feed_direction = unit(way);
        Some(Self { radius_per_feed: (from_mm - to_mm) / travel_mm, setting, travel_mm })
    }

    /// The whole way in so many revolutions.
    pub(in crate::ring_roundness) fn in_revolutions(&self, revolutions: f64) -> Setting {
        Setting { revolutions, feed_mm_per_rev: self.travel_mm / revolutions, ..self.setting.clone() }
    }
}

#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a place between nodes, 0 to n")]
fn rounded(nodes: f64) -> usize {
    nodes.round() as usize
}
