//! The shaft and what holds it, as they stand in a job.

use std::ops::RangeInclusive;

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::places;
use crate::material;

/// Poisson's ratio where neither job nor material states one (steel).
const DEFAULT_POISSON_RATIO: f64 = 0.3;
/// Lengths of a segment that the schema allows, mm.
const LENGTH_MM: RangeInclusive<f64> = 0.001..=100_000.0;
/// Diameters that the schema allows, mm.
pub(crate) const DIAMETER_MM: RangeInclusive<f64> = 0.01..=10_000.0;
/// Density where neither job nor material states one (steel), kg/m³.
const DEFAULT_DENSITY_KG_PER_M3: f64 = 7850.0;

/// The workpiece: segments from the headstock end to the tailstock end.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct Shaft {
    /// Cylindrical segments, end to end, concentric.
    #[schema(min_items = 1, max_items = 200, extensions(("x-group" = json!("workpiece")), ("x-code" = json!("no_segments"))))]
    pub segments: Vec<Segment>,
    /// Name in the material library; gives the elastic constants that are not stated. The echoed job has the numbers.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(example = "steel_45", max_length = 64, extensions(("x-library" = json!("materials"))))]
    pub material: Option<String>,
    /// Young's modulus; needed where no material is named.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 1000.0, maximum = 2_000_000.0, example = 210_000.0, extensions(("x-unit" = json!("N/mm2")), ("x-symbol" = json!("E")), ("x-code" = json!("bad_modulus"))))]
    pub youngs_modulus_n_per_mm2: Option<f64>,
    /// Poisson's ratio; of the material, or 0.3. It acts with `theory` Timoshenko.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(exclusive_minimum = -1.0, exclusive_maximum = 0.5, example = 0.3, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("nu")), ("x-code" = json!("bad_poisson"))))]
    pub poisson_ratio: Option<f64>,
    /// Density; of the material, or 7850. It acts with `include.weight`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 1.0, maximum = 30_000.0, example = 7850.0, extensions(("x-unit" = json!("kg/m3")), ("x-symbol" = json!("rho"))))]
    pub density_kg_per_m3: Option<f64>,
    /// Yield strength; where given, bending stress above half of it is warned of.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 1.0, maximum = 10_000.0, example = 360.0, extensions(("x-unit" = json!("N/mm2")), ("x-symbol" = json!("sigma_y"))))]
    pub yield_strength_n_per_mm2: Option<f64>,
    /// Beam theory; not said: bending alone, and with shear where `include.mode` lets it act.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(example = "euler_bernoulli")]
    pub theory: Option<Theory>,
    /// Which section bends; not said: the finished one, and the mixed one where `include.mode` lets it act.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(example = "mixed")]
    pub section: Option<Section>,
}

impl Shaft {
    /// Left ends of the segments, from 0 on, and the end of the shaft.
    pub(crate) fn ends_mm(&self) -> Vec<f64> {
        places::ends_mm(self.segments.iter().map(|segment| segment.length_mm))
    }

    /// Length of all segments.
    pub fn length_mm(&self) -> f64 {
        self.ends_mm().last().copied().unwrap_or(0.0)
    }

    /// Length of all segments, where every one has a length that it may have: nothing can be held against another.
    pub(crate) fn known_length_mm(&self) -> Option<f64> {
        let known = !self.segments.is_empty() && self.segments.iter().all(|s| LENGTH_MM.contains(&s.length_mm));
        known.then(|| self.length_mm())
    }

    /// Takes the elastic constants that are not stated from the material, where one is named.
    pub(crate) fn fill(&mut self) {
        if let Some(found) = self.material.take().as_deref().and_then(material::find) {
            self.youngs_modulus_n_per_mm2.get_or_insert(found.youngs_modulus_n_per_mm2.value);
            self.poisson_ratio.get_or_insert(found.poisson_ratio.value);
            self.density_kg_per_m3.get_or_insert(found.density_kg_per_m3.value);
            if let (None, Some(strength)) = (self.yield_strength_n_per_mm2, found.yield_strength_n_per_mm2) {
                self.yield_strength_n_per_mm2 = Some(strength.value);
            }
        }
        self.poisson_ratio.get_or_insert(DEFAULT_POISSON_RATIO);
        self.density_kg_per_m3.get_or_insert(DEFAULT_DENSITY_KG_PER_M3);
        for segment in &mut self.segments {
            segment.stock_diameter_mm.get_or_insert(segment.diameter_mm);
        }
    }

    /// The beam theory that acts.
    pub(crate) fn theory(&self) -> Theory {
        self.theory.unwrap_or_default()
    }

    /// The section that bends.
    pub(crate) fn section(&self) -> Section {
        self.section.unwrap_or_default()
    }

    /// Young's modulus of a filled job; NaN, which no answer lets pass, of one that is not.
    pub(crate) fn modulus(&self) -> f64 {
        self.youngs_modulus_n_per_mm2.unwrap_or(f64::NAN)
    }

    /// Poisson's ratio of a filled job.
    pub(crate) fn poisson(&self) -> f64 {
        self.poisson_ratio.unwrap_or(f64::NAN)
    }

    /// Density of a filled job.
    pub(crate) fn density(&self) -> f64 {
        self.density_kg_per_m3.unwrap_or(f64::NAN)
    }
}

/// A cylindrical piece of the shaft.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct Segment {
    /// Length along the axis.
    #[schema(minimum = 0.001, maximum = 100_000.0, example = 2000.0, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("l")), ("x-code" = json!("bad_length"))))]
    pub length_mm: f64,
    /// Drawing diameter.
    #[schema(minimum = 0.01, maximum = 10_000.0, example = 90.0, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("d")), ("x-code" = json!("bad_diameter"))))]
    pub diameter_mm: f64,
    /// Diameter of the blank; the drawing diameter where the segment is not turned.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.01, maximum = 10_000.0, example = 91.0, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("D_0")), ("x-code" = json!("bad_diameter"))))]
    pub stock_diameter_mm: Option<f64>,
    /// Diameter of the bore, 0 for solid.
    #[serde(default)]
    #[schema(minimum = 0.0, maximum = 10_000.0, default = 0.0, example = 0.0, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("d_in")), ("x-code" = json!("bad_bore"))))]
    pub bore_diameter_mm: f64,
}

impl Segment {
    /// Diameter of the blank.
    pub fn stock_mm(&self) -> f64 {
        self.stock_diameter_mm.unwrap_or(self.diameter_mm)
    }

    /// Whether the drawing diameter is one that a shaft may have.
    pub(crate) fn has_diameter(&self) -> bool {
        DIAMETER_MM.contains(&self.diameter_mm)
    }

    /// Whether its bore is one that it may have.
    pub(crate) fn has_bore(&self) -> bool {
        self.has_diameter() && self.bore_diameter_mm < self.diameter_mm
    }

    /// Whether drawing and blank fit together, so that something follows from both.
    pub(crate) fn has_stock(&self) -> bool {
        self.has_diameter() && DIAMETER_MM.contains(&self.stock_mm()) && self.stock_mm() >= self.diameter_mm
    }
}

/// Beam theory.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum Theory {
    /// Bending alone.
    #[default]
    EulerBernoulli,
    /// Bending and shear (Cowper's coefficient).
    Timoshenko,
}

/// Which section bends.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum Section {
    /// The drawing's diameters everywhere.
    #[default]
    Finished,
    /// The blank's diameters everywhere.
    Stock,
    /// Partly turned: the blank's where the tool has yet to pass, the drawing's where it has passed.
    Mixed,
}

/// Something that holds the shaft. Compliance 0 is rigid.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
pub enum Support {
    /// A centre: holds against displacement.
    Centre {
        /// Station along the shaft from the headstock end.
        #[schema(minimum = -100_000.0, maximum = 100_000.0, example = 0.0, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("z")), ("x-ends-with" = json!("/shaft/segments/*/length_mm"))))]
        z_mm: f64,
        /// Radial compliance.
        #[serde(default)]
        #[schema(minimum = 0.0, maximum = 1000.0, default = 0.0, example = 0.033, extensions(("x-unit" = json!("um/N")), ("x-symbol" = json!("w")), ("x-code" = json!("negative_compliance"))))]
        compliance_um_per_n: f64,
        /// Compliance across the radial direction; the radial one where not given.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schema(minimum = 0.0, maximum = 1000.0, example = 0.033, extensions(("x-unit" = json!("um/N")), ("x-symbol" = json!("w_z")), ("x-code" = json!("negative_compliance"))))]
        tangential_compliance_um_per_n: Option<f64>,
    },
    /// A chuck: holds against displacement and rotation; the shaft may go on to both sides.
    Chuck {
        /// Station along the shaft from the headstock end.
        #[schema(minimum = -100_000.0, maximum = 100_000.0, example = 0.0, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("z")), ("x-ends-with" = json!("/shaft/segments/*/length_mm"))))]
        z_mm: f64,
        /// Radial compliance.
        #[serde(default)]
        #[schema(minimum = 0.0, maximum = 1000.0, default = 0.0, example = 0.005, extensions(("x-unit" = json!("um/N")), ("x-symbol" = json!("w")), ("x-code" = json!("negative_compliance"))))]
        compliance_um_per_n: f64,
        /// Compliance across the radial direction; the radial one where not given.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schema(minimum = 0.0, maximum = 1000.0, example = 0.005, extensions(("x-unit" = json!("um/N")), ("x-symbol" = json!("w_z")), ("x-code" = json!("negative_compliance"))))]
        tangential_compliance_um_per_n: Option<f64>,
        /// Compliance against rotation, 0 = clamped.
        #[serde(default)]
        #[schema(minimum = 0.0, maximum = 1.0, default = 0.0, example = 4e-10, extensions(("x-unit" = json!("rad/(N mm)")), ("x-symbol" = json!("w_r")), ("x-code" = json!("negative_compliance"))))]
        rotational_compliance_rad_per_n_mm: f64,
    },
    /// A steady rest: stands on the bed.
    SteadyRest {
        /// Station along the shaft from the headstock end.
        #[schema(minimum = -100_000.0, maximum = 100_000.0, example = 600.0, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("z")), ("x-ends-with" = json!("/shaft/segments/*/length_mm"))))]
        z_mm: f64,
        /// Radial compliance.
        #[serde(default)]
        #[schema(minimum = 0.0, maximum = 1000.0, default = 0.0, example = 0.03, extensions(("x-unit" = json!("um/N")), ("x-symbol" = json!("w")), ("x-code" = json!("negative_compliance"))))]
        compliance_um_per_n: f64,
        /// Compliance across the radial direction; the radial one where not given.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schema(minimum = 0.0, maximum = 1000.0, example = 0.03, extensions(("x-unit" = json!("um/N")), ("x-symbol" = json!("w_z")), ("x-code" = json!("negative_compliance"))))]
        tangential_compliance_um_per_n: Option<f64>,
        /// Whether it only bears when the work moves away from the tool by more than the gap.
        #[serde(default)]
        #[schema(default = false, example = true)]
        one_sided: bool,
        /// Gap of a one-sided rest to the undeflected work.
        #[serde(default)]
        #[schema(minimum = 0.0, maximum = 100_000.0, default = 0.0, example = 20.0, extensions(("x-unit" = json!("um")), ("x-symbol" = json!("gap")), ("x-code" = json!("negative_compliance"))))]
        gap_um: f64,
    },
    /// A follow rest: travels with the tool.
    FollowRest {
        /// Distance from the tool, positive toward the tailstock. Where it would leave the shaft it does not act.
        #[schema(minimum = -100_000.0, maximum = 100_000.0, example = 15.0, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("offset"))))]
        offset_mm: f64,
        /// Radial compliance.
        #[serde(default)]
        #[schema(minimum = 0.0, maximum = 1000.0, default = 0.0, example = 0.015, extensions(("x-unit" = json!("um/N")), ("x-symbol" = json!("w_f")), ("x-code" = json!("negative_compliance"))))]
        compliance_um_per_n: f64,
        /// Compliance across the radial direction; the radial one where not given.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schema(minimum = 0.0, maximum = 1000.0, example = 0.015, extensions(("x-unit" = json!("um/N")), ("x-symbol" = json!("w_z")), ("x-code" = json!("negative_compliance"))))]
        tangential_compliance_um_per_n: Option<f64>,
        /// Whether it only bears when the work moves away from the tool by more than the gap.
        #[serde(default)]
        #[schema(default = false, example = true)]
        one_sided: bool,
        /// Gap of a one-sided rest to the undeflected work.
        #[serde(default)]
        #[schema(minimum = 0.0, maximum = 100_000.0, default = 0.0, example = 20.0, extensions(("x-unit" = json!("um")), ("x-symbol" = json!("gap")), ("x-code" = json!("negative_compliance"))))]
        gap_um: f64,
    },
}

impl Support {
    /// Its station; a follow rest has none of its own.
    pub fn station_mm(&self) -> Option<f64> {
        match *self {
            Self::Centre { z_mm, .. } | Self::Chuck { z_mm, .. } | Self::SteadyRest { z_mm, .. } => Some(z_mm),
            Self::FollowRest { .. } => None,
        }
    }

    /// Whether it can carry the shaft: bilateral, translational, standing still.
    pub fn carries(&self) -> bool {
        match self {
            Self::Centre { .. } | Self::Chuck { .. } => true,
            Self::SteadyRest { one_sided, .. } => !one_sided,
            Self::FollowRest { .. } => false,
        }
    }

    /// Writes out what follows from other fields: the compliance across the radial direction, and its place where that
    /// is the end of a segment.
    pub(crate) fn fill(&mut self, ends_mm: &[f64]) {
        if let Self::Centre { z_mm, .. } | Self::Chuck { z_mm, .. } | Self::SteadyRest { z_mm, .. } = self {
            *z_mm = places::settled(*z_mm, ends_mm);
        }
        match self {
            Self::Centre { compliance_um_per_n: c, tangential_compliance_um_per_n: across, .. }
            | Self::Chuck { compliance_um_per_n: c, tangential_compliance_um_per_n: across, .. }
            | Self::SteadyRest { compliance_um_per_n: c, tangential_compliance_um_per_n: across, .. }
            | Self::FollowRest { compliance_um_per_n: c, tangential_compliance_um_per_n: across, .. } => {
                across.get_or_insert(*c);
            }
        }
    }

    /// Multiplies its compliances.
    pub(crate) fn yield_times(&mut self, factor: f64) {
        match self {
            Self::Centre { compliance_um_per_n: c, tangential_compliance_um_per_n: across, .. }
            | Self::Chuck { compliance_um_per_n: c, tangential_compliance_um_per_n: across, .. }
            | Self::SteadyRest { compliance_um_per_n: c, tangential_compliance_um_per_n: across, .. }
            | Self::FollowRest { compliance_um_per_n: c, tangential_compliance_um_per_n: across, .. } => {
                *c *= factor;
                *across = across.map(|across| across * factor);
            }
        }
    }

    /// Radial compliance.
    pub fn compliance_um_per_n(&self) -> f64 {
        match *self {
            Self::Centre { compliance_um_per_n, .. }
            | Self::Chuck { compliance_um_per_n, .. }
            | Self::SteadyRest { compliance_um_per_n, .. }
            | Self::FollowRest { compliance_um_per_n, .. } => compliance_um_per_n,
        }
    }
}

/// Carriage with cross slide, tool post and tool, at the cutting point.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct Carriage {
    /// Radial compliance.
    #[serde(default)]
    #[schema(minimum = 0.0, maximum = 1000.0, default = 0.0, example = 0.033, extensions(("x-unit" = json!("um/N")), ("x-symbol" = json!("w_c")), ("x-group" = json!("machine")), ("x-code" = json!("negative_compliance"))))]
    pub compliance_um_per_n: f64,
    /// Compliance across the radial direction; does not follow the radial one.
    #[serde(default)]
    #[schema(minimum = 0.0, maximum = 1000.0, default = 0.0, example = 0.0, extensions(("x-unit" = json!("um/N")), ("x-symbol" = json!("w_cz")), ("x-group" = json!("machine")), ("x-code" = json!("negative_compliance"))))]
    pub tangential_compliance_um_per_n: f64,
}

/// Which way the tool travels.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum FeedDirection {
    /// From the tailstock to the headstock.
    #[default]
    ToHeadstock,
    /// From the headstock to the tailstock.
    ToTailstock,
}

impl FeedDirection {
    /// The side along the shaft that the tool comes from: 1 from the tailstock, -1 from the headstock.
    pub(crate) fn comes_from(self) -> f64 {
        if self == Self::ToHeadstock { 1.0 } else { -1.0 }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use utoipa::PartialSchema;

    #[test]
    fn ranges_are_those_of_the_schema() {
        let schema = serde_json::to_value(Segment::schema()).unwrap_or_default();
        for (field, range) in
            [("length_mm", LENGTH_MM), ("diameter_mm", DIAMETER_MM), ("stock_diameter_mm", DIAMETER_MM)]
        {
            let end = |name: &str| schema["properties"][field][name].as_f64();
            assert_eq!((end("minimum"), end("maximum")), (Some(*range.start()), Some(*range.end())), "{field}");
        }
    }
}
