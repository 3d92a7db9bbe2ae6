//! What can be hidden in a shaft: the causes of the catalogue, written down again, and some that it lacks.

use std::f64::consts::PI;

use super::{Acting, Lathe, REFERENCE, Run, Scaled};

/// A cause and how large it may get.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Size {
    pub(crate) kind: &'static str,
    /// Largest size that is tried, in the catalogue's unit.
    most: f64,
    /// Whether it may be negative.
    pub(crate) two_sided: bool,
}

const fn two_sided(kind: &'static str, most: f64) -> Size {
    Size { kind, most, two_sided: true }
}

const fn positive(kind: &'static str, most: f64) -> Size {
    Size { kind, most, two_sided: false }
}

/// Causes of the catalogue.
pub(crate) const CAUSES: &[Size] = &[
    positive("headstock_compliance", 0.12),
    positive("tailstock_compliance", 0.12),
    positive("carriage_compliance", 0.12),
    two_sided("bending_scale", 0.5),
    two_sided("tailstock_offset", 100.0),
    two_sided("guideway_bow", 80.0),
    positive("tool_wear", 60.0),
    positive("thermal_growth", 55.0),
    two_sided("force_level", 0.5),
    two_sided("depth_exponent", 0.5),
    two_sided("feed_exponent", 0.5),
    two_sided("speed_exponent", 0.7),
    two_sided("hardness_gradient", 1.0),
    positive("built_up_edge", 0.65),
    positive("ploughing_force", 350.0),
    two_sided("reversal_backlash", 55.0),
    two_sided("size_offset", 100.0),
    positive("chuck_rotational_stiffness", 0.98),
];

/// Errors that no catalogue holds.
pub(crate) const OUTSIDE: &[Size] = &[
    positive("waviness", 100.0),
    positive("soft_spot", 3.0),
    two_sided("step", 100.0),
    two_sided("s_curve", 100.0),
    positive("random_tilt", 200.0),
];

impl Size {
    /// Whether these runs can show it.
    pub(crate) fn applies(&self, runs: &[Run]) -> bool {
        let varies = |of: fn(&Run) -> f64| runs.iter().any(|run| (of(run) - of(&runs[0])).abs() > 1e-9);
        match self.kind {
            "depth_exponent" => varies(|run| run.depth_mm),
            "feed_exponent" => varies(|run| run.feed_mm_per_rev),
            "speed_exponent" => varies(|run| run.speed_m_per_min),
            // In the dip and out of it.
            "built_up_edge" => {
                runs.iter().any(|run| run.speed_m_per_min < 70.0) && runs.iter().any(|run| run.speed_m_per_min > 100.0)
            }
            "reversal_backlash" => runs.iter().any(|run| run.to_headstock) && runs.iter().any(|run| !run.to_headstock),
            _ => true,
        }
    }

    /// The largest size that is tried.
    pub(crate) fn most(&self) -> f64 {
        self.most
    }
}

impl Scaled {
    fn is(&self, kind: &str) -> bool {
        self.cause.kind == kind
    }

    /// Time constant of a warming.
    fn time_constant_min(&self) -> f64 {
        (8.0_f64.ln() + 0.7 * (2.0 * self.form[0] - 1.0)).exp()
    }

    /// Centre and width of the dip of a built-up edge.
    fn dip_m_per_min(&self) -> (f64, f64) {
        (30.0 + 24.0 * self.form[0], 14.0 + 12.0 * self.form[1])
    }

    /// What the catalogue fits beside the size.
    pub(crate) fn shapes(&self) -> Vec<(&'static str, f64)> {
        let (centre, width) = self.dip_m_per_min();
        match self.cause.kind {
            "thermal_growth" => vec![("time_constant_min", self.time_constant_min())],
            "built_up_edge" => vec![("centre_m_per_min", centre), ("width_m_per_min", width)],
            _ => Vec::new(),
        }
    }

    /// Whether shaft and supports are others with it.
    pub(crate) fn changes_beam(&self) -> bool {
        self.is("bending_scale") || self.is("chuck_rotational_stiffness")
    }

    /// Change of the bending flexibility, as a share.
    pub(crate) fn bending_change(&self) -> f64 {
        if self.is("bending_scale") { self.size } else { 0.0 }
    }

    /// Rotational stiffness at the headstock: the size is kappa = k/(k + 3 E I/L).
    pub(crate) fn chuck_n_mm_per_rad(&self, lathe: &Lathe) -> Option<f64> {
        let second_moment = PI * lathe.diameter_mm.powi(4) / 64.0;
        let unit = 3.0 * super::beam::YOUNGS_MODULUS_N_PER_MM2 * second_moment / lathe.length_mm;
        self.is("chuck_rotational_stiffness").then(|| self.size / (1.0 - self.size) * unit)
    }

    /// Adds what it does at a station of a run; `rotation_n_mm_per_rad` is what clamps the shaft at the headstock.
    pub(crate) fn act(
        &self,
        lathe: &Lathe,
        run: &Run,
        index: usize,
        z: f64,
        rotation_n_mm_per_rad: Option<f64>,
        acting: &mut Acting,
    ) {
        let (size, u) = (self.size, z / lathe.length_mm);
        let travelled = if run.to_headstock { lathe.length_mm - z } else { z };
        let cut_m = PI * lathe.diameter_mm * travelled / (1000.0 * run.feed_mm_per_rev);
        let path_m = run.path_at_start_m + cut_m;
        let warm_min = run.warm_at_start_min + cut_m / run.speed_m_per_min;
        let (depth, feed, speed) = REFERENCE;
        let form = self.form;
        match self.cause.kind {
            "headstock_compliance" => acting.compliance += size * (1.0 - u).powi(2),
            "tailstock_compliance" => acting.compliance += size * u * u,
            "carriage_compliance" => acting.compliance += size,
            // A shaft between centres follows as a stiff one; one that is clamped bends.
            "tailstock_offset" => {
                let clamped = |rotation| super::beam::carried_by_tailstock(lathe, z, Some(rotation));
                acting.error_um += size * rotation_n_mm_per_rad.map_or(u, clamped);
            }
            "guideway_bow" => acting.error_um += 4.0 * size * u * (1.0 - u),
            "tool_wear" => {
                let wear_in = size * 1.5 * form[0];
                acting.error_um += wear_in * (1.0 - (-path_m / 400.0).exp()) + size * path_m / 1000.0;
            }
            "thermal_growth" => {
                acting.error_um -= size * (1.0 - (-warm_min / self.time_constant_min()).exp());
            }
            "force_level" => acting.factor = (1.0 + acting.factor) * (1.0 + size) - 1.0,
            "depth_exponent" => {
                // The reference depth is 1 mm, where the law itself is stated.
                debug_assert!((depth - 1.0).abs() < 1e-12);
                acting.depth_power += size;
            }
            "feed_exponent" => {
                acting.factor = (1.0 + acting.factor) * (run.feed_mm_per_rev / feed).powf(size) - 1.0;
            }
            "speed_exponent" => {
                acting.factor = (1.0 + acting.factor) * (run.speed_m_per_min / speed).powf(size) - 1.0;
            }
            "hardness_gradient" => acting.factor = (1.0 + acting.factor) * (1.0 + size * (u - 0.5)) - 1.0,
            "built_up_edge" => {
                let (centre, width) = self.dip_m_per_min();
                let dip = size * (-((run.speed_m_per_min - centre) / width).powi(2)).exp();
                acting.factor = (1.0 + acting.factor) * (1.0 - dip) - 1.0;
            }
            "ploughing_force" => acting.force_n += size,
            "reversal_backlash" => acting.error_um += if run.to_headstock { 0.5 * size } else { -0.5 * size },
            "size_offset" => acting.error_um += size,
            "waviness" => {
                let waves = 6.0 + (8.0 * form[0]).floor();
                acting.error_um += size * (2.0 * PI * (waves * u + form[1])).sin();
            }
            "soft_spot" => {
                let place = 0.2 + 0.6 * form[0];
                acting.factor = (1.0 + acting.factor) * (1.0 + size * (-((u - place) / 0.06).powi(2)).exp()) - 1.0;
            }
            "step" => acting.error_um += if u > 0.25 + 0.5 * form[0] { size } else { 0.0 },
            "s_curve" => acting.error_um += size * (2.0 * PI * u).sin(),
            "random_tilt" => {
                // Another tilt in every run, from the digits of a number that no physics knows.
                let seed = (form[0] + 0.618_033_988_749_895 * (index as f64 + 1.0)).fract();
                acting.error_um += size * (2.0 * seed - 1.0) * (u - 0.5);
            }
            _ => {}
        }
    }
}
