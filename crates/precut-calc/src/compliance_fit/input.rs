//! The job: a bar of known section, what holds it, and what a dial gauge read under known loads.

use serde::{Deserialize, Serialize};
use utoipa::{PartialSchema, ToSchema};

use crate::calculator::{Measured, MeasuredRow};

/// Most rows of a table.
pub const MAX_ROWS: usize = 2000;

/// A static test of a lathe: loads on a bar, readings of a gauge.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
#[schema(title = "ComplianceFitJob")]
pub struct Job {
    /// The bar that was loaded; what bends of it is counted, so a thick one says most of the machine.
    #[schema(extensions(("x-group" = json!("workpiece"))))]
    pub bar: TestBar,
    /// What holds the bar, as it holds the work. A compliance that is stated is kept; one that is not is found.
    #[schema(min_items = 1, max_items = 8, extensions(("x-group" = json!("machine"))))]
    pub supports: Vec<TestSupport>,
    /// Compliance of carriage and tool post between tool and bed, where it is known; it is found from readings at the tool.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.0, maximum = 1000.0, example = 0.02, extensions(("x-unit" = json!("um/N")), ("x-symbol" = json!("c_t")), ("x-group" = json!("machine"))))]
    pub carriage_um_per_n: Option<f64>,
    /// Loads and readings, one row each.
    #[schema(schema_with = Measured::<GaugeRow>::schema)]
    pub measurements: Measured<GaugeRow>,
    /// Standard error of one reading.
    #[serde(default = "default_gauge_error")]
    #[schema(minimum = 0.001, maximum = 1000.0, default = 1.0, example = 1.0, extensions(("x-unit" = json!("um")), ("x-symbol" = json!("s"))))]
    pub gauge_error_um: f64,
    /// Whether readings have a constant of their own, the play that is gone before the first load, with the sign of the force:
    /// load both ways to find it.
    #[serde(default)]
    #[schema(default = false, example = false)]
    pub play: bool,
}

fn default_gauge_error() -> f64 {
    1.0
}

/// The bar.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct TestBar {
    /// Cylindrical pieces from the headstock end, end to end.
    #[schema(min_items = 1, max_items = 50, extensions(("x-code" = json!("no_segments"))))]
    pub segments: Vec<BarSegment>,
    /// Name in the material library; gives the elastic constants that are not stated. The echoed job has the numbers.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(example = "steel_45", max_length = 64, extensions(("x-library" = json!("materials"))))]
    pub material: Option<String>,
    /// Young's modulus; needed where no material is named.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 1000.0, maximum = 2_000_000.0, example = 210_000.0, extensions(("x-unit" = json!("N/mm2")), ("x-symbol" = json!("E")), ("x-code" = json!("bad_modulus"))))]
    pub youngs_modulus_n_per_mm2: Option<f64>,
    /// Poisson's ratio; of the material, or 0.3. It acts through the shear.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(exclusive_minimum = -1.0, exclusive_maximum = 0.5, example = 0.3, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("nu")), ("x-code" = json!("bad_poisson"))))]
    pub poisson_ratio: Option<f64>,
}

/// A cylindrical piece of the bar.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct BarSegment {
    /// Length along the axis.
    #[schema(minimum = 0.001, maximum = 100_000.0, example = 500.0, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("l")), ("x-code" = json!("bad_length"))))]
    pub length_mm: f64,
    /// Diameter.
    #[schema(minimum = 0.01, maximum = 10_000.0, example = 80.0, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("d")), ("x-code" = json!("bad_diameter"))))]
    pub diameter_mm: f64,
    /// Diameter of the bore, 0 for solid.
    #[serde(default)]
    #[schema(minimum = 0.0, maximum = 10_000.0, default = 0.0, example = 0.0, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("d_in")), ("x-code" = json!("bad_bore"))))]
    pub bore_diameter_mm: f64,
}

/// Something that holds the bar.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
pub enum TestSupport {
    /// A centre: holds against displacement.
    Centre {
        /// Station along the bar from the headstock end.
        #[schema(minimum = -100_000.0, maximum = 100_000.0, example = 0.0, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("z"))))]
        z_mm: f64,
        /// Radial compliance, where it is known.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schema(minimum = 0.0, maximum = 1000.0, example = 0.033, extensions(("x-unit" = json!("um/N")), ("x-symbol" = json!("c")), ("x-code" = json!("negative_compliance"))))]
        compliance_um_per_n: Option<f64>,
    },
    /// A chuck: holds against displacement and rotation.
    Chuck {
        /// Station along the bar from the headstock end.
        #[schema(minimum = -100_000.0, maximum = 100_000.0, example = 0.0, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("z"))))]
        z_mm: f64,
        /// Radial compliance, where it is known.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schema(minimum = 0.0, maximum = 1000.0, example = 0.005, extensions(("x-unit" = json!("um/N")), ("x-symbol" = json!("c")), ("x-code" = json!("negative_compliance"))))]
        compliance_um_per_n: Option<f64>,
        /// Compliance against rotation, where it is known; 0 = clamped.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schema(minimum = 0.0, maximum = 1.0, example = 4e-10, extensions(("x-unit" = json!("rad/(N mm)")), ("x-symbol" = json!("c_r")), ("x-code" = json!("negative_compliance"))))]
        rotational_compliance_rad_per_n_mm: Option<f64>,
    },
    /// A rest that stands still and holds both ways.
    SteadyRest {
        /// Station along the bar from the headstock end.
        #[schema(minimum = -100_000.0, maximum = 100_000.0, example = 250.0, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("z"))))]
        z_mm: f64,
        /// Radial compliance, where it is known.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schema(minimum = 0.0, maximum = 1000.0, example = 0.02, extensions(("x-unit" = json!("um/N")), ("x-symbol" = json!("c")), ("x-code" = json!("negative_compliance"))))]
        compliance_um_per_n: Option<f64>,
    },
}

impl TestSupport {
    /// Station along the bar.
    pub fn z_mm(&self) -> f64 {
        match *self {
            Self::Centre { z_mm, .. } | Self::Chuck { z_mm, .. } | Self::SteadyRest { z_mm, .. } => z_mm,
        }
    }

    /// Radial compliance, where it is known.
    pub fn compliance_um_per_n(&self) -> Option<f64> {
        match *self {
            Self::Centre { compliance_um_per_n, .. }
            | Self::Chuck { compliance_um_per_n, .. }
            | Self::SteadyRest { compliance_um_per_n, .. } => compliance_um_per_n,
        }
    }
}

/// A load and what the gauge read.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct GaugeRow {
    /// Where the gauge stood: at the bar where left out, or between tool post and bed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(inline, example = "tool")]
    pub at: Option<GaugedAt>,
    /// Station of the load; at the tool its station does not act and may be left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.0, maximum = 100_000.0, example = 250.0, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("z_F"))))]
    pub z_load_mm: Option<f64>,
    /// Radial load; negative the other way.
    #[schema(minimum = -1_000_000.0, maximum = 1_000_000.0, example = 500.0, extensions(("x-unit" = json!("N")), ("x-symbol" = json!("F"))))]
    pub force_n: f64,
    /// Station of a gauge at the bar; that of the load where left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.0, maximum = 100_000.0, example = 250.0, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("z_r"))))]
    pub z_reading_mm: Option<f64>,
    /// Reading, positive in the direction of a positive load.
    #[schema(minimum = -100_000.0, maximum = 100_000.0, example = 12.0, extensions(("x-unit" = json!("um")), ("x-symbol" = json!("y"))))]
    pub reading_um: f64,
}

impl GaugeRow {
    /// Where the gauge stood.
    pub fn gauged_at(&self) -> GaugedAt {
        self.at.unwrap_or_default()
    }
}

impl MeasuredRow for GaugeRow {
    const MAX_ROWS: usize = MAX_ROWS;
}

/// Where a gauge stands.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum GaugedAt {
    /// At the bar, from the bed.
    #[default]
    Work,
    /// At the tool post, from the bed.
    Tool,
}
