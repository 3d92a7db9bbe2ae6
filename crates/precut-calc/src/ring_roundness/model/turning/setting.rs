//! Where supports and tool stand, and how they move while the ring turns.

use std::f64::consts::TAU;

use super::plane::{Vec2, add, scaled, turned, unit};

/// A machine set up for a ring: positions in the machine frame, x to the right, y up, mm. The ring turns counter-clockwise;
/// a clockwise one is computed in the mirror.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Setting {
    /// Left support: the point, or the centre of the roller.
    pub support_a_mm: Vec2,
    /// Right support.
    pub support_b_mm: Vec2,
    /// Radius of the rollers; 0 for points.
    pub roller_radius_mm: f64,
    /// Tip of the tool at the start.
    pub tip_start_mm: Vec2,
    /// Unit vector of the feed.
    pub feed_direction: Vec2,
    /// Feed, mm per revolution of the machine.
    pub feed_mm_per_rev: f64,
    /// Revolutions with feed.
    pub revolutions: f64,
    /// Revolutions without feed at the end.
    pub spark_out_revolutions: f64,
    /// Thrust stiffness of the cut over stiffness seen by the tool, K.
    pub compliance_ratio: f64,
    /// Radius of a grinding wheel or cutter in place of the tip.
    pub wheel_radius_mm: Option<f64>,
    /// What moves beside the feed.
    pub motion: Motion,
}

impl Setting {
    /// The tip at the end of the feed.
    pub(crate) fn tip_end_mm(&self) -> Vec2 {
        add(self.tip_start_mm, scaled(self.feed_direction, self.feed_mm_per_rev * self.revolutions))
    }

    /// Rotation of the machine over the whole run, rad.
    pub(super) fn end_rad(&self) -> f64 {
        TAU * (self.revolutions + self.spark_out_revolutions)
    }
}

/// A motion A cos(ratio·φ + phase) along a fixed direction.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Oscillation {
    pub amplitude_mm: f64,
    pub ratio: f64,
    pub phase_rad: f64,
}

impl Oscillation {
    fn at(&self, turned_rad: f64) -> f64 {
        self.amplitude_mm * (self.ratio * turned_rad + self.phase_rad).cos()
    }
}

/// What moves beside the feed (effects), as functions of the rotation of the machine.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct Motion {
    /// Support A, towards the origin of the machine frame.
    pub runout_a: Vec<Oscillation>,
    /// Support B, likewise.
    pub runout_b: Vec<Oscillation>,
    /// Tip, towards the origin of the machine frame.
    pub chatter: Vec<Oscillation>,
    /// Both supports recede from the origin, mm per revolution.
    pub wear_mm_per_rev: f64,
    /// Angle that the body loses on the machine per revolution of the machine, as a share of it.
    pub slip: f64,
}

impl Motion {
    fn is_still(&self) -> bool {
        [&self.runout_a, &self.runout_b, &self.chatter].into_iter().all(Vec::is_empty)
            && self.wear_mm_per_rev.abs() < f64::MIN_POSITIVE
    }
}

/// Supports and tip as functions of the rotation of the *machine*, rad.
pub(super) trait Machine {
    fn supports(&self, turned_rad: f64) -> (Vec2, Vec2);
    fn tip(&self, turned_rad: f64) -> Vec2;
}

/// The feed, which stops.
#[derive(Debug, Clone, Copy)]
struct Feed {
    start: Vec2,
    per_rad: Vec2,
    stop_rad: f64,
}

impl Feed {
    fn of(setting: &Setting) -> Self {
        Self {
            start: setting.tip_start_mm,
            per_rad: scaled(setting.feed_direction, setting.feed_mm_per_rev / TAU),
            stop_rad: TAU * setting.revolutions,
        }
    }
    #[inline]
    fn tip(&self, turned_rad: f64) -> Vec2 {
        add(self.start, scaled(self.per_rad, turned_rad.min(self.stop_rad)))
    }
}

/// Nothing moves but the feed.
#[derive(Debug, Clone, Copy)]
pub(super) struct Still {
    feed: Feed,
    a: Vec2,
    b: Vec2,
}

impl Still {
    /// `None` where something else moves.
    pub(super) fn of(setting: &Setting) -> Option<Self> {
        setting.motion.is_still().then(|| Self {
            feed: Feed::of(setting),
            a: setting.support_a_mm,
            b: setting.support_b_mm,
        })
    }
}

impl Machine for Still {
    #[inline]
    fn supports(&self, _turned_rad: f64) -> (Vec2, Vec2) {
        (self.a, self.b)
    }
    #[inline]
    fn tip(&self, turned_rad: f64) -> Vec2 {
        self.feed.tip(turned_rad)
    }
}

/// Supports or tip move beside the feed.
#[derive(Debug, Clone)]
pub(super) struct Moving {
    still: Still,
    motion: Motion,
    /// Unit vectors from the origin.
    a: Vec2,
    b: Vec2,
    tip: Vec2,
}

impl Moving {
    pub(super) fn of(setting: &Setting) -> Self {
        Self {
            still: Still { feed: Feed::of(setting), a: setting.support_a_mm, b: setting.support_b_mm },
            motion: setting.motion.clone(),
            a: unit(setting.support_a_mm),
            b: unit(setting.support_b_mm),
            tip: unit(setting.tip_start_mm),
        }
    }
}

impl Machine for Moving {
    fn supports(&self, turned_rad: f64) -> (Vec2, Vec2) {
        let wear = self.motion.wear_mm_per_rev * turned_rad / TAU;
        let outward = |runout| wear - sum_at(runout, turned_rad);
        let (a, b) = (outward(&self.motion.runout_a), outward(&self.motion.runout_b));
        (add(self.still.a, scaled(self.a, a)), add(self.still.b, scaled(self.b, b)))
    }
    fn tip(&self, turned_rad: f64) -> Vec2 {
        add(self.still.tip(turned_rad), scaled(self.tip, -sum_at(&self.motion.chatter, turned_rad)))
    }
}

fn sum_at(oscillations: &[Oscillation], turned_rad: f64) -> f64 {
    oscillations.iter().map(|oscillation| oscillation.at(turned_rad)).fold(0.0, |sum, x| sum + x)
}

/// A point moved across its direction from the origin, positive counter-clockwise.
pub(crate) fn moved_across(point: Vec2, by_mm: f64) -> Vec2 {
    add(point, scaled(turned(unit(point)), by_mm))
}
