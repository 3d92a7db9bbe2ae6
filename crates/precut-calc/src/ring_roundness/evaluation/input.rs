//! The job: a measured profile, and how it is to be evaluated.

use serde::{Deserialize, Serialize};
use utoipa::{PartialSchema, ToSchema};

use crate::calculator::{Measured, MeasuredRow};
use crate::num::roundness::Filter;

/// Most points of a profile.
pub const MAX_POINTS: usize = 200_000;

/// A measured profile of a round section: `radii`, or `deviations` from a nominal radius, or `points`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
#[schema(title = "RoundnessEvaluationJob")]
pub struct Job {
    /// Distances from an axis near the middle, by angle: a roundness tester with absolute radii, a simulation.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(schema_with = Measured::<RoundnessRadiusRow>::schema, required = false)]
    pub radii: Option<Measured<RoundnessRadiusRow>>,
    /// Deviations from `nominal_radius_mm`, by angle: what most roundness testers write.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(schema_with = Measured::<RoundnessDeviationRow>::schema, required = false)]
    pub deviations: Option<Measured<RoundnessDeviationRow>>,
    /// Points in the plane of the section, in any order, the centre anywhere: a coordinate measuring machine.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(schema_with = Measured::<RoundnessPointRow>::schema, required = false)]
    pub points: Option<Measured<RoundnessPointRow>>,
    /// A file as the instrument wrote it, in place of a table.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub file: Option<InstrumentFile>,
    /// Nominal radius: what `deviations` are deviations from; with `radii` and `points` it serves to find wrong units.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.01, maximum = 20_000.0, example = 149.4, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("R")), ("x-group" = json!("workpiece"))))]
    pub nominal_radius_mm: Option<f64>,
    /// Which waves are kept before the circles are fitted.
    #[serde(default)]
    #[schema(extensions(("x-group" = json!("evaluation"))))]
    pub filter: RoundnessFilter,
    /// What is done with spikes: readings that stand off all around them. They are listed in `data.spikes` in any case.
    #[serde(default)]
    #[schema(default = "keep", example = "keep", extensions(("x-group" = json!("evaluation"))))]
    pub spikes: SpikeTreatment,
    /// The reference circle that `roundness_um` is about. All four are always given.
    #[serde(default)]
    #[schema(default = "least_squares", example = "minimum_zone")]
    pub reference: ReferenceCircle,
    /// Number of uniform angles to which the profile is brought for filter and spectrum; that of the points where it is
    /// not given.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 16, maximum = 200_000, example = 3600, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("N")), ("x-group" = json!("numerics")), ("x-advanced" = json!(true))))]
    pub profile_points: Option<u32>,
    /// Highest harmonic of the spectrum; at most half of `profile_points` are given.
    #[serde(default = "highest_harmonic")]
    #[schema(minimum = 2, maximum = 5000, default = 50, example = 50, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("k_max")), ("x-group" = json!("evaluation")), ("x-advanced" = json!(true))))]
    pub highest_harmonic: u32,
    /// Roundness tolerance of the drawing for `roundness_um`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.001, maximum = 100_000.0, example = 10.0, extensions(("x-unit" = json!("um")), ("x-symbol" = json!("t")), ("x-group" = json!("workpiece"))))]
    pub tolerance_um: Option<f64>,
}

/// What is done with spikes.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
#[schema(as = RoundnessSpikeTreatment)]
pub enum SpikeTreatment {
    /// They count as any reading.
    #[default]
    Keep,
    /// They are left out, and that is told.
    Remove,
}

/// The text of a file as a roundness tester or a coordinate machine wrote it: header text and comments in any language,
/// decimal point or comma, separated by tab, semicolon, comma, bar or blanks; with or without angles; radii, diameters,
/// deviations or points. What was done in reading it stands in `data.repairs`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
#[schema(as = RoundnessInstrumentFile)]
pub struct InstrumentFile {
    /// The text.
    #[schema(max_length = 30_000_000, example = "Winkel [°];Abweichung [µm]\n0;1,2\n120;1,4\n240;1,1")]
    pub text: String,
    /// Which of the file's sections, from 1.
    #[serde(default = "first_section")]
    #[schema(minimum = 1, maximum = 10_000, default = 1, example = 1, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("i_s")), ("x-advanced" = json!(true))))]
    pub section: u32,
    /// What the columns hold, where the file does not say it or says it in words that are not known; from the first.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schema(max_items = 64, extensions(("x-advanced" = json!(true))))]
    pub columns: Vec<FileColumn>,
}

fn first_section() -> u32 {
    1
}

/// What a column of a file holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
#[schema(as = RoundnessFileColumn)]
pub enum FileColumn {
    /// Angle in degrees.
    AngleDeg,
    /// Angle in radians.
    AngleRad,
    /// Distance from the axis in mm.
    RadiusMm,
    /// Twice that.
    DiameterMm,
    /// Deviation from the nominal radius in micrometres.
    DeviationUm,
    /// Deviation from the nominal radius in mm.
    DeviationMm,
    /// Coordinate in the plane of the section in mm.
    XMm,
    /// Coordinate square to it in mm.
    YMm,
    /// Height along the axis in mm: rows at different heights are different sections.
    ZMm,
    /// Something else.
    Ignored,
}

fn highest_harmonic() -> u32 {
    50
}

/// A distance from the axis.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct RoundnessRadiusRow {
    /// Angle, counter-clockwise, ascending from row to row within one turn.
    #[schema(minimum = -720.0, maximum = 720.0, example = 12.5, extensions(("x-unit" = json!("deg")), ("x-symbol" = json!("theta"))))]
    pub angle_deg: f64,
    /// Distance from the axis of rotation.
    #[schema(minimum = 0.01, maximum = 20_000.0, example = 149.403, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("r")), ("x-code" = json!("bad_radius"))))]
    pub radius_mm: f64,
}

/// A deviation from the nominal radius.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct RoundnessDeviationRow {
    /// Angle, counter-clockwise, ascending from row to row within one turn.
    #[schema(minimum = -720.0, maximum = 720.0, example = 12.5, extensions(("x-unit" = json!("deg")), ("x-symbol" = json!("theta"))))]
    pub angle_deg: f64,
    /// Deviation of the radius from `nominal_radius_mm`, outward positive.
    #[schema(minimum = -1_000_000.0, maximum = 1_000_000.0, example = 3.2, extensions(("x-unit" = json!("um")), ("x-symbol" = json!("delta_r"))))]
    pub radial_deviation_um: f64,
}

/// A point of the section.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct RoundnessPointRow {
    /// Coordinate in the plane of the section.
    #[schema(minimum = -100_000.0, maximum = 100_000.0, example = 105.6, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("x"))))]
    pub x_mm: f64,
    /// Coordinate in the plane of the section, square to `x_mm`.
    #[schema(minimum = -100_000.0, maximum = 100_000.0, example = -22.3, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("y"))))]
    pub y_mm: f64,
}

impl MeasuredRow for RoundnessRadiusRow {
    const MAX_ROWS: usize = MAX_POINTS;
}
impl MeasuredRow for RoundnessDeviationRow {
    const MAX_ROWS: usize = MAX_POINTS;
}
impl MeasuredRow for RoundnessPointRow {
    const MAX_ROWS: usize = MAX_POINTS;
}

/// Which waves are kept: the Gaussian filter of closed profiles (ISO 16610-21, ISO 12181-2).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
pub enum RoundnessFilter {
    /// All waves.
    None {},
    /// Long waves: form. The standard's cut-offs are 15, 50, 150, 500 and 1500 undulations per revolution.
    LowPass {
        /// Undulations per revolution of which half the amplitude passes.
        #[schema(minimum = 1.0, maximum = 50_000.0, example = 50.0, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("f_c"))))]
        cutoff_upr: f64,
    },
    /// Short waves: waviness and chatter without form.
    HighPass {
        /// Undulations per revolution of which half the amplitude passes.
        #[schema(minimum = 1.0, maximum = 50_000.0, example = 15.0, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("f_c"))))]
        cutoff_upr: f64,
    },
    /// Waves between two cut-offs.
    BandPass {
        /// Lower cut-off: slower waves are held back.
        #[schema(minimum = 1.0, maximum = 50_000.0, example = 15.0, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("f_1"))))]
        from_upr: f64,
        /// Upper cut-off: faster waves are held back.
        #[schema(minimum = 1.0, maximum = 50_000.0, example = 500.0, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("f_2"))))]
        to_upr: f64,
    },
}

impl Default for RoundnessFilter {
    fn default() -> Self {
        Self::LowPass { cutoff_upr: 50.0 }
    }
}

impl RoundnessFilter {
    /// The filter of the numerics.
    pub(super) fn filter(self) -> Filter {
        match self {
            Self::None {} => Filter::None,
            Self::LowPass { cutoff_upr } => Filter::LowPass { cutoff_upr },
            Self::HighPass { cutoff_upr } => Filter::HighPass { cutoff_upr },
            Self::BandPass { from_upr, to_upr } => Filter::BandPass { from_upr, to_upr },
        }
    }

    /// The highest cut-off, and the name of its field.
    pub(super) fn highest_cutoff(self) -> Option<(f64, &'static str)> {
        match self {
            Self::None {} => None,
            Self::LowPass { cutoff_upr } | Self::HighPass { cutoff_upr } => Some((cutoff_upr, "cutoff_upr")),
            Self::BandPass { to_upr, .. } => Some((to_upr, "to_upr")),
        }
    }
}

/// Reference circles (ISO 12181-1).
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum ReferenceCircle {
    /// LSCI: least sum of squared distances.
    #[default]
    LeastSquares,
    /// MZCI: two concentric circles nearest to each other that hold the profile between them.
    MinimumZone,
    /// MICI: the largest circle inside, for holes.
    MaximumInscribed,
    /// MCCI: the smallest circle outside, for shafts.
    MinimumCircumscribed,
}

impl ReferenceCircle {
    /// Its name in the contract.
    pub(in crate::ring_roundness) const fn name(self) -> &'static str {
        match self {
            Self::LeastSquares => "least_squares",
            Self::MinimumZone => "minimum_zone",
            Self::MaximumInscribed => "maximum_inscribed",
            Self::MinimumCircumscribed => "minimum_circumscribed",
        }
    }
}
