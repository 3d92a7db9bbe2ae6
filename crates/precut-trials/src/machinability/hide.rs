//! What can be hidden in a cutting trial: the causes of the catalogue, written down again, and some that it lacks.

use super::{Cut, MIDDLE, Output};

/// A cause and how large it may get.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Size {
    pub(crate) kind: &'static str,
    /// Largest size that is tried, in the catalogue's unit.
    pub(crate) most: f64,
    /// Whether it may be negative.
    pub(crate) two_sided: bool,
    /// Whether `most` is a share of the output.
    pub(crate) share: bool,
}

const fn size(kind: &'static str, most: f64, two_sided: bool) -> Size {
    Size { kind, most, two_sided, share: false }
}

/// Causes of the catalogue, up to what a workshop would still believe.
pub(crate) const CAUSES: &[Size] = &[
    size("level_shift", 0.6, true),
    size("batch_shift", 0.6, true),
    size("speed_exponent", 0.6, true),
    size("feed_exponent", 0.6, true),
    size("depth_exponent", 0.6, true),
    size("speed_curvature", 0.5, true),
    size("feed_curvature", 0.5, true),
    size("depth_curvature", 0.5, true),
    size("speed_feed_interaction", 0.5, true),
    size("feed_depth_interaction", 0.5, true),
    size("speed_depth_interaction", 0.5, true),
    size("built_up_edge", 1.2, false),
    size("nose_radius_floor", 3.0, false),
    Size { kind: "edge_force_offset", most: 0.5, two_sided: false, share: true },
    size("wear_multiplicative", 4.0, false),
    size("wear_force_additive", 1500.0, false),
];

/// Deviations that no catalogue holds.
pub(crate) const OUTSIDE: &[Size] =
    &[size("chatter_island", 1.5, false), size("drift", 1.0, true), size("threshold", 1.0, true)];

/// The same where regimes are continuous and nobody wrote down their order: what goes with a condition in a way, or in a
/// direction, that the catalogue does not hold.
pub(crate) const OUTSIDE_CONDITIONS: &[Size] = &[
    size("chatter_island", 1.5, false),
    size("threshold", 1.0, true),
    size("linear_in_time", 1.0, true),
    size("smoother_when_worn", 4.0, false),
    size("nose_radius_power", 2.0, true),
    size("speed_limit", 1.5, true),
];

impl Size {
    /// Whether it can act on an output at all.
    pub(crate) fn acts_on(&self, output: &Output) -> bool {
        match self.kind {
            "nose_radius_floor" => output.model == "roughness",
            "edge_force_offset" | "wear_force_additive" => output.model == "force_z",
            _ => true,
        }
    }
}

/// A hidden cause at its size.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Scaled {
    pub(crate) cause: Size,
    pub(crate) size: f64,
    /// Drawn constants of its form, 0 to 1.
    pub(crate) form: [f64; 2],
}

impl Scaled {
    /// Centre and width of the hump of a built-up edge.
    fn hump_m_per_min(&self) -> (f64, f64) {
        (28.0 + 22.0 * self.form[0], 13.0 + 12.0 * self.form[1])
    }

    /// What the catalogue fits beside the size.
    pub(crate) fn shapes(&self) -> Vec<(&'static str, f64)> {
        let (centre, width) = self.hump_m_per_min();
        match self.cause.kind {
            "built_up_edge" => vec![("centre_m_per_min", centre), ("width_m_per_min", width)],
            "wear_force_additive" => vec![("depth_power", self.form[0])],
            _ => Vec::new(),
        }
    }

    /// The factor on the output.
    pub(crate) fn times(&self, cut: &Cut) -> f64 {
        let [v, s, t] = [cut.speed / MIDDLE[0], cut.feed / MIDDLE[1], cut.depth / MIDDLE[2]];
        let size = self.size;
        match self.cause.kind {
            "level_shift" => size.exp(),
            "batch_shift" if cut.second_batch => size.exp(),
            "speed_exponent" => v.powf(size),
            "feed_exponent" => s.powf(size),
            "depth_exponent" => t.powf(size),
            "speed_curvature" => v.powf(size * v.ln()),
            "feed_curvature" => s.powf(size * s.ln()),
            "depth_curvature" => t.powf(size * t.ln()),
            "speed_feed_interaction" => v.powf(size * s.ln()),
            "feed_depth_interaction" => s.powf(size * t.ln()),
            "speed_depth_interaction" => v.powf(size * t.ln()),
            "built_up_edge" => {
                let (centre, width) = self.hump_m_per_min();
                (size * (-((cut.speed - centre) / width).powi(2)).exp()).exp()
            }
            "wear_multiplicative" => (size * cut.wear_mm).exp(),
            // Self-excited vibration in a patch of speed and depth.
            "chatter_island" => {
                let (speed, depth) = (35.0 + 70.0 * self.form[0], 0.6 + 1.4 * self.form[1]);
                let away = ((cut.speed / speed).ln() / 0.35).powi(2) + ((cut.depth / depth).ln() / 0.4).powi(2);
                (size * (-away).exp()).exp()
            }
            // The machine warms up, or the gauge wanders, while the plan is cut.
            "drift" => {
                let bend = 1.0 + 2.0 * self.form[0];
                (size * (cut.when.powf(bend) - 0.5)).exp()
            }
            // The edge, or what carries it, changes while it cuts.
            "linear_in_time" => (size * (cut.time_min / 30.0 - 0.5)).exp(),
            "smoother_when_worn" => (-size * cut.wear_mm).exp(),
            "nose_radius_power" => (cut.radius_mm / 0.8).powf(size),
            // Beyond a speed and a feed something gives way.
            "speed_limit" if cut.speed > 80.0 && cut.feed > 0.15 => size.exp(),
            // Beyond a depth the chip breaks in another way, below it does not.
            "threshold" if cut.depth > 0.8 && cut.feed > 0.12 => size.exp(),
            _ => 1.0,
        }
    }

    /// Height of the feed marks, where they are hidden, um.
    pub(crate) fn marks_um(&self, cut: &Cut) -> Option<f64> {
        (self.cause.kind == "nose_radius_floor")
            .then(|| self.size * 1000.0 * cut.feed * cut.feed / (32.0 * cut.radius_mm))
    }

    /// What is added to the output, in its unit.
    pub(crate) fn added(&self, output: &Output, cut: &Cut) -> f64 {
        match self.cause.kind {
            "edge_force_offset" => self.size,
            "wear_force_additive" if output.model == "force_z" => {
                // Not only where a grid has its points.
                let power = self.form[0];
                self.size * cut.wear_mm * (cut.depth / MIDDLE[2]).powf(power)
            }
            _ => 0.0,
        }
    }
}
