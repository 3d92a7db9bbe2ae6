//! A round ring in a setting: where it rests, where the contacts are, what the supports bear.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use crate::ring_roundness::model::turning::Setting;
use crate::ring_roundness::model::turning::plane::{Vec2, add, angle, cross, dot, norm, scaled, sub, turned, unit};

/// A circle that rests on both supports, with the tip in its contact direction (`ring/2.1`).
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Stance {
    /// Centre of the ring, mm.
    pub centre_mm: Vec2,
    /// Its radius, mm.
    pub radius_mm: f64,
    /// Support half angle β, rad.
    pub half_angle_rad: f64,
    /// Directions of the supports and the tip from the centre.
    pub to_a: Vec2,
    pub to_b: Vec2,
    pub to_tip: Vec2,
}

/// A circle of that radius on the supports; `None` where it falls through between them.
pub(crate) fn at_radius(setting: &Setting, tip_mm: Vec2, radius_mm: f64) -> Option<Stance> {
    let (middle, up, half) = between(setting);
    let reach = radius_mm + setting.roller_radius_mm;
    let height2 = reach * reach - half * half;
    (height2 > 0.0).then(|| of(setting, tip_mm, add(middle, scaled(up, height2.sqrt())), radius_mm))
}

/// The circle through the tip that touches both supports: |T-c| + r_s = |A-c| = |B-c| (`ring/2.2`); `None` where there is
/// none, the tip being too low.
///
/// Bisection in the height of the centre, in which |A-c| - |T-c| rises; exact to the last digits.
pub(crate) fn through_tip(setting: &Setting, tip_mm: Vec2) -> Option<Stance> {
    let (middle, up, half) = between(setting);
    let gap = |height: f64| {
        let c = add(middle, scaled(up, height));
        norm(sub(setting.support_a_mm, c)) - norm(sub(tip_mm, c)) - setting.roller_radius_mm
    };
    let scale = half + norm(sub(tip_mm, middle)) + setting.roller_radius_mm;
    let (mut low, mut high) = (0.0, 1e6 * scale);
    if gap(low) > 0.0 || gap(high) < 0.0 {
        return None;
    }
    // Halving a range of 1e6 scales 80 times reaches the spacing of doubles.
    for _ in 0..90 {
        let mid = 0.5 * (low + high);
        if gap(mid) < 0.0 {
            low = mid;
        } else {
            high = mid;
        }
    }
    let centre = add(middle, scaled(up, 0.5 * (low + high)));
    Some(of(setting, tip_mm, centre, norm(sub(tip_mm, centre))))
}

fn between(setting: &Setting) -> (Vec2, Vec2, f64) {
    let (a, b) = (setting.support_a_mm, setting.support_b_mm);
    (scaled(add(a, b), 0.5), turned(unit(sub(b, a))), 0.5 * norm(sub(b, a)))
}

fn of(setting: &Setting, tip_mm: Vec2, centre_mm: Vec2, radius_mm: f64) -> Stance {
    let (_, _, half) = between(setting);
    let reach = norm(sub(setting.support_a_mm, centre_mm));
    Stance {
        centre_mm,
        radius_mm,
        half_angle_rad: (half / reach).min(1.0).asin(),
        to_a: unit(sub(setting.support_a_mm, centre_mm)),
        to_b: unit(sub(setting.support_b_mm, centre_mm)),
        to_tip: unit(sub(tip_mm, centre_mm)),
    }
}

/// How the errors at the supports come back at the tool (`ring/5.1`).
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Copying {
    /// Copying coefficients a and b: u_T = a u_A + b u_B.
    pub a: f64,
    pub b: f64,
    /// Rotation from the tool to each support, 0..2π.
    pub delay_a_rad: f64,
    pub delay_b_rad: f64,
}

impl Copying {
    /// Of support half angle β and tool angle α_T with supports at equal height.
    pub(crate) fn of_angles(half_angle_rad: f64, tool_rad: f64) -> Self {
        let double = (2.0 * half_angle_rad).sin();
        let below = 1.5 * PI;
        Self {
            a: -(tool_rad - half_angle_rad).cos() / double,
            b: (tool_rad + half_angle_rad).cos() / double,
            delay_a_rad: (below - half_angle_rad - tool_rad).rem_euclid(TAU),
            delay_b_rad: (below + half_angle_rad - tool_rad).rem_euclid(TAU),
        }
    }

    /// |a| + |b|: 1 where the tool is opposite to a support, more everywhere else.
    pub(crate) fn gain(&self) -> f64 {
        self.a.abs() + self.b.abs()
    }

    /// Whether the tool counts as opposite to a support, where it makes the diameter (`ring/5.4`).
    pub(crate) fn is_diametral(&self) -> bool {
        self.gain() <= DIAMETRAL
    }
}

impl Stance {
    /// Angle of the tool seen from the ring's centre, 0..2π.
    pub(crate) fn tool_rad(&self) -> f64 {
        angle(self.to_tip).rem_euclid(TAU)
    }

    pub(crate) fn copying(&self) -> Copying {
        let across = cross(self.to_a, self.to_b);
        let delay = |to: Vec2| angle([dot(self.to_tip, to), cross(self.to_tip, to)]).rem_euclid(TAU);
        Copying {
            a: cross(self.to_tip, self.to_b) / across,
            b: cross(self.to_a, self.to_tip) / across,
            delay_a_rad: delay(self.to_a),
            delay_b_rad: delay(self.to_b),
        }
    }

    /// Radius that the ring loses per mm of feed, mm/mm (`ring/2.3`): -u_T·f/(1-a-b).
    pub(crate) fn radius_per_feed(&self, feed_direction: Vec2) -> f64 {
        let copying = self.copying();
        -dot(self.to_tip, feed_direction) / (1.0 - copying.a - copying.b)
    }

    /// Smallest angle between the tool and a contact with a support, rad.
    pub(crate) fn tool_clearance_rad(&self) -> f64 {
        let between = |to: Vec2| cross(self.to_tip, to).atan2(dot(self.to_tip, to)).abs();
        between(self.to_a).min(between(self.to_b))
    }

    /// Whether the tool stands between the supports, below.
    pub(crate) fn tool_is_below(&self) -> bool {
        let down = scaled(unit(add(self.to_a, self.to_b)), 1.0);
        dot(down, self.to_tip) > self.half_angle_rad.cos()
    }
}

/// Forces on the ring, N, for the support reactions.
#[derive(Debug, Clone, Copy, PartialEq)]
#[allow(clippy::struct_field_names, reason = "the unit stands in every name")]
pub(crate) struct Load {
    pub thrust_n: f64,
    pub cutting_n: f64,
    pub weight_n: f64,
}

/// Reactions N_A, N_B of the supports, N: N_A u_A + N_B u_B = -F_p u_T - F_c t_T - W y (`ring/4.1`); negative where
/// the ring would lift off. `rotation` is +1 counter-clockwise, -1 clockwise. `driven` adds the friction of rollers
/// that drive the ring, T_A + T_B = F_c along the rotation, shared equally.
pub(crate) fn reactions_n(stance: &Stance, load: &Load, rotation: f64, driven: bool) -> (f64, f64) {
    let along = scaled(turned(stance.to_tip), rotation);
    let mut force =
        add(add(scaled(stance.to_tip, -load.thrust_n), scaled(along, -load.cutting_n)), [0.0, -load.weight_n]);
    if driven {
        for to in [stance.to_a, stance.to_b] {
            force = add(force, scaled(turned(to), 0.5 * rotation * load.cutting_n));
        }
    }
    let across = cross(stance.to_a, stance.to_b);
    (cross(force, stance.to_b) / across, cross(stance.to_a, force) / across)
}

/// Half angle above which a ring jams, and below which it is laterally unstable.
pub(crate) const JAMS_RAD: f64 = 75.0 / 180.0 * PI;
pub(crate) const LOOSE_RAD: f64 = 15.0 / 180.0 * PI;
/// |a| + |b| up to which the tool counts as opposite to a support.
const DIAMETRAL: f64 = 1.001;
/// Least angle between tool and support contact.
pub(crate) const TOOL_CLEARANCE_RAD: f64 = FRAC_PI_2 / 18.0;

/// How much further back the tip must start to be clear of the largest diameter of a profile, mm along the feed.
pub(in crate::ring_roundness) fn back_off_mm(setting: &Setting, radii: &[f64]) -> Option<f64> {
    let n = radii.len();
    let widest = (0..n).map(|i| radii[i] + radii[(i + n / 2) % n]).fold(0.0, f64::max);
    let radius = |back: f64| {
        through_tip(setting, add(setting.tip_start_mm, scaled(setting.feed_direction, -back))).map(|s| s.radius_mm)
    };
    let (mut low, mut high) = (0.0, 0.2 * widest);
    if radius(0.0)? >= 0.5 * widest || radius(high)? < 0.5 * widest {
        return None;
    }
    for _ in 0..50 {
        let mid = 0.5 * (low + high);
        if radius(mid)? < 0.5 * widest {
            low = mid;
        } else {
            high = mid;
        }
    }
    Some(high)
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::ring_roundness::model::turning::Motion;

    fn seed() -> Setting {
        Setting {
            support_a_mm: [-100.0, -111.0],
            support_b_mm: [100.0, -111.0],
            roller_radius_mm: 0.0,
            tip_start_mm: [100.0, 111.0],
            feed_direction: [0.0, -1.0],
            feed_mm_per_rev: 0.02,
            revolutions: 1.0,
            spark_out_revolutions: 0.0,
            compliance_ratio: 0.0,
            wheel_radius_mm: None,
            motion: Motion::default(),
        }
    }

    #[test]
    fn tip_vertically_above_a_support_stays_opposite_to_the_other() {
        for height in [108.0, 111.0, 114.0] {
            let stance = through_tip(&seed(), [100.0, height]).unwrap();
            let copying = stance.copying();
            // Thales: the angle at B is right, so A and the tip are the ends of a diameter.
            assert!((copying.a + 1.0).abs() < 1e-12 && copying.b.abs() < 1e-12);
            assert!((copying.delay_a_rad - PI).abs() < 1e-12);
        }
        assert!((through_tip(&seed(), [100.0, 111.0]).unwrap().radius_mm - 149.402_141_886).abs() < 1e-8);
    }

    #[test]
    fn radius_lost_per_feed_is_the_derivative_of_the_circle() {
        let mut setting = seed();
        setting.roller_radius_mm = 7.0;
        let radius = |y: f64| through_tip(&setting, [60.0, y]).unwrap().radius_mm;
        let stance = through_tip(&setting, [60.0, 130.0]).unwrap();
        let step = 1e-3;
        let difference = (radius(130.0 + step) - radius(130.0 - step)) / (2.0 * step);
        assert!((stance.radius_per_feed([0.0, -1.0]) - difference).abs() < 1e-8);
    }

    #[test]
    fn coefficients_by_angles_are_those_of_the_geometry() {
        let stance = through_tip(&seed(), [40.0, 140.0]).unwrap();
        let by_angles = Copying::of_angles(stance.half_angle_rad, stance.tool_rad());
        let copying = stance.copying();
        assert!((by_angles.a - copying.a).abs() < 1e-12 && (by_angles.b - copying.b).abs() < 1e-12);
        assert!((by_angles.delay_a_rad - copying.delay_a_rad).abs() < 1e-12);
        assert!((by_angles.delay_b_rad - copying.delay_b_rad).abs() < 1e-12);
    }
}
