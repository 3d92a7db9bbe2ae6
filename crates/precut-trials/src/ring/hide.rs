//! What can be hidden in a ring: the causes of the catalogue, written down again, and some that it lacks.

use std::f64::consts::{PI, TAU};

use super::{Acting, Rig};

/// A cause and how large it may get.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Size {
    pub(crate) kind: &'static str,
    /// Largest size that is tried, in the catalogue's unit.
    pub(crate) most: f64,
    /// Whether it may be negative.
    pub(crate) two_sided: bool,
}

const fn size(kind: &'static str, most: f64, two_sided: bool) -> Size {
    Size { kind, most, two_sided }
}

/// Causes of the catalogue, up to what a workshop would still believe.
pub(crate) const CAUSES: &[Size] = &[
    size("initial_harmonic", 0.06, false),
    size("tool_off_line", 1.5, true),
    size("support_position", 1.5, true),
    size("support_wear", 1.0, false),
    size("roller_runout", 0.02, false),
    size("tool_push_off", 1.0, false),
    size("spark_out_missing", 1.0, false),
    size("chatter_harmonic", 0.008, true),
    size("work_slip", 2.0, true),
];

/// Errors that no catalogue holds.
pub(crate) const OUTSIDE: &[Size] =
    &[size("flat", 400.0, false), size("released_clamping", 200.0, false), size("bump", 400.0, false)];

/// A hidden cause at its size.
#[derive(Debug, Clone)]
pub(crate) struct Scaled {
    pub(crate) cause: Size,
    pub(crate) size: f64,
    /// Drawn constants of its form, 0 to 1.
    pub(crate) form: [f64; 3],
}

impl Scaled {
    /// Whether it is there or not, and has no size.
    pub(crate) fn is_switch(&self) -> bool {
        self.cause.kind == "spark_out_missing"
    }

    fn phase(&self) -> f64 {
        TAU * self.form[0]
    }

    /// The first value that a diagnosis fits: of a wave with a phase A cos ph, of a roller with the phase at the end.
    pub(crate) fn first_value(&self, rig: &Rig) -> f64 {
        match self.cause.kind {
            "initial_harmonic" => self.size * self.phase().cos(),
            "roller_runout" => self.size * self.end_phase(rig).cos(),
            "spark_out_missing" => 0.0,
            _ => self.size,
        }
    }

    /// Phase of a roller where the turning ends.
    fn end_phase(&self, rig: &Rig) -> f64 {
        self.ratio() * TAU * (rig.revolutions + rig.spark_out) + self.phase()
    }

    /// What the catalogue fits beside the first value.
    pub(crate) fn shapes(&self, rig: &Rig) -> Vec<(&'static str, f64)> {
        match self.cause.kind {
            "initial_harmonic" => vec![("amplitude_sin_phase_mm", self.size * self.phase().sin())],
            "roller_runout" => {
                vec![("amplitude_sin_end_phase_mm", self.size * self.end_phase(rig).sin()), ("ratio", self.ratio())]
            }
            _ => Vec::new(),
        }
    }

    /// Of a roller, whole in six of ten.
    fn ratio(&self) -> f64 {
        let ratio = 3.0 + 7.0 * self.form[1];
        if self.form[2] < 0.6 { ratio.round() } else { ratio }
    }

    /// Adds what it does while the ring is turned. `None` where it has nothing to act on.
    pub(crate) fn act(&self, rig: &Rig, acting: &mut Acting) -> Option<()> {
        match self.cause.kind {
            "initial_harmonic" => {
                let order = 2.0 + (5.0 * self.form[1]).floor();
                acting.waves.push((order, self.size, self.phase()));
            }
            "tool_off_line" => acting.tool_aside_mm += self.size,
            "support_position" => acting.support_b_mm += self.size,
            "support_wear" => acting.wear_mm_per_rev += 1e-3 * self.size,
            "roller_runout" => acting.runout = (self.size, self.ratio(), self.phase()),
            "tool_push_off" => acting.push_off += self.size,
            "spark_out_missing" => {
                if rig.spark_out <= 0.0 {
                    return None;
                }
                acting.spark_out = Some(0.0);
            }
            "chatter_harmonic" => acting.chatter = (self.size, 9.0 + (38.0 * self.form[1]).floor()),
            "work_slip" => acting.slip_deg_per_rev += self.size,
            _ => {}
        }
        Some(())
    }

    /// What it adds to the finished ring, um.
    pub(crate) fn after_um(&self, angle: f64) -> f64 {
        let away = (angle - self.phase() + PI).rem_euclid(TAU) - PI;
        match self.cause.kind {
            // A chord where the ring stood still under the tool.
            "flat" => {
                let half = 0.05 + 0.1 * self.form[1];
                -self.size * (1.0 - (away / half).powi(2)).max(0.0)
            }
            "released_clamping" => self.size * (2.0 * away).cos(),
            "bump" => self.size * (-0.5 * (away / (0.03 + 0.1 * self.form[1])).powi(2)).exp(),
            _ => 0.0,
        }
    }
}
