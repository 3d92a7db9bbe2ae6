//! The job: several measured sections of a cylinder, and what the drawing asks of it.

use serde::{Deserialize, Serialize};
use utoipa::openapi::extensions::Extensions;
use utoipa::openapi::schema::{ObjectBuilder, SchemaType, Type};
use utoipa::openapi::{RefOr, Schema};
use utoipa::{PartialSchema, ToSchema};

use crate::calculator::{Measured, MeasuredRow};
use crate::ring_roundness::evaluation::{FileColumn, MAX_POINTS, ReferenceCircle, RoundnessFilter};

/// Measured sections of a cylinder at two or more heights: `points`, or `radii`, or `deviations` from a nominal radius,
/// or a `file`. Rows whose heights lie within 0.2 mm of each other are one section.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
#[schema(title = "CylindricityEvaluationJob")]
pub struct Job {
    /// Points of the surface, the axis roughly along z, in any order: a coordinate measuring machine.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(schema_with = Measured::<CylinderPointRow>::schema, required = false)]
    pub points: Option<Measured<CylinderPointRow>>,
    /// Distances from one straight axis of measurement, by height and angle: a roundness tester with a column.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(schema_with = Measured::<CylinderRadiusRow>::schema, required = false)]
    pub radii: Option<Measured<CylinderRadiusRow>>,
    /// Deviations from `nominal_radius_mm`, seen from one straight axis of measurement, by height and angle.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(schema_with = Measured::<CylinderDeviationRow>::schema, required = false)]
    pub deviations: Option<Measured<CylinderDeviationRow>>,
    /// A file as the instrument wrote it, in place of a table.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub file: Option<CylinderFile>,
    /// Nominal radius: what `deviations` are deviations from; with `radii` and `points` it serves to find wrong units.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.01, maximum = 20_000.0, example = 25.0, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("R")), ("x-group" = json!("workpiece"))))]
    pub nominal_radius_mm: Option<f64>,
    /// Which waves round the circumference are kept before circles and cylinders are fitted.
    #[serde(default)]
    #[schema(extensions(("x-group" = json!("evaluation"))))]
    pub filter: RoundnessFilter,
    /// The reference that `cylindricity_um` and the roundness of the sections are about: the cylinder, and the circle of
    /// the same kind. All four cylinders are always given.
    #[serde(default = "minimum_zone")]
    #[schema(default = "minimum_zone", example = "minimum_zone", extensions(("x-group" = json!("evaluation"))))]
    pub reference: ReferenceCircle,
    /// Sections, from 1 for the lowest, whose centres make the datum axis of the coaxiality: two bearing seats, say. At
    /// least two, and not all; empty where no coaxiality is asked for.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schema(max_items = 1000, example = json!([1, 5]), extensions(("x-group" = json!("evaluation"))))]
    pub datum_sections: Vec<DatumSection>,
    /// Cylindricity tolerance of the drawing.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.001, maximum = 100_000.0, example = 20.0, extensions(("x-unit" = json!("um")), ("x-symbol" = json!("t_cyl")), ("x-group" = json!("limits"))))]
    pub cylindricity_tolerance_um: Option<f64>,
    /// Roundness tolerance of the drawing, for every section.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.001, maximum = 100_000.0, example = 10.0, extensions(("x-unit" = json!("um")), ("x-symbol" = json!("t_ron")), ("x-group" = json!("limits"))))]
    pub roundness_tolerance_um: Option<f64>,
    /// Straightness tolerance of the drawing for the axis: the diameter of a cylinder.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.001, maximum = 100_000.0, example = 10.0, extensions(("x-unit" = json!("um")), ("x-symbol" = json!("t_str")), ("x-group" = json!("limits"))))]
    pub straightness_tolerance_um: Option<f64>,
    /// Coaxiality tolerance of the drawing: the diameter of a cylinder about the datum axis. Asks for `datum_sections`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.001, maximum = 100_000.0, example = 20.0, extensions(("x-unit" = json!("um")), ("x-symbol" = json!("t_coax")), ("x-group" = json!("limits"))))]
    pub coaxiality_tolerance_um: Option<f64>,
    /// Expanded uncertainty (k = 2) of the instrument for any of these deviations: spindle, column, probe. Added to what
    /// the evaluation itself leaves open.
    #[serde(default)]
    #[schema(minimum = 0.0, maximum = 10_000.0, default = 0.0, example = 0.4, extensions(("x-unit" = json!("um")), ("x-symbol" = json!("U")), ("x-group" = json!("limits"))))]
    pub uncertainty_um: f64,
}

fn minimum_zone() -> ReferenceCircle {
    ReferenceCircle::MinimumZone
}

/// The text of a file as a coordinate machine or a roundness tester wrote it: points with heights, or one block of rows
/// per section whose height stands in a column, above the block, or in `section_heights_mm`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct CylinderFile {
    /// The text.
    #[schema(
        max_length = 30_000_000,
        example = "x [mm];y [mm];z [mm]\n25,001;0,000;5,0\n-12,501;21,651;5,0\n-12,500;-21,650;5,0"
    )]
    pub text: String,
    /// What the columns hold, where the file does not say it or says it in words that are not known; from the first.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schema(max_items = 64, extensions(("x-advanced" = json!(true))))]
    pub columns: Vec<FileColumn>,
    /// Heights of the file's sections, in its order, where the file does not tell them.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schema(max_items = 1000, extensions(("x-advanced" = json!(true))))]
    pub section_heights_mm: Vec<SectionHeight>,
}

/// A section by its number, from 1 for the lowest.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct DatumSection(pub u32);

impl PartialSchema for DatumSection {
    fn schema() -> RefOr<Schema> {
        let number =
            number(Type::Integer, "1", "i_A").description(Some("A section by its number, from 1 for the lowest."));
        number.minimum(Some(1)).maximum(Some(1000)).examples([1]).into()
    }
}

impl ToSchema for DatumSection {}

/// Height of a section along the axis.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
#[serde(transparent)]
pub struct SectionHeight(pub f64);

impl PartialSchema for SectionHeight {
    fn schema() -> RefOr<Schema> {
        let number = number(Type::Number, "mm", "z").description(Some("Height of a section along the axis."));
        number.minimum(Some(-100_000.0)).maximum(Some(100_000.0)).examples([12.5]).into()
    }
}

impl ToSchema for SectionHeight {}

fn number(kind: Type, unit: &'static str, symbol: &'static str) -> ObjectBuilder {
    let mut extensions = Extensions::default();
    extensions.insert("x-unit".to_owned(), unit.into());
    extensions.insert("x-symbol".to_owned(), symbol.into());
    ObjectBuilder::new().schema_type(SchemaType::new(kind)).extensions(Some(extensions))
}

/// A point of the surface.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct CylinderPointRow {
    /// Coordinate square to the axis.
    #[schema(minimum = -100_000.0, maximum = 100_000.0, example = 25.002, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("x"))))]
    pub x_mm: f64,
    /// Coordinate square to the axis and to `x_mm`.
    #[schema(minimum = -100_000.0, maximum = 100_000.0, example = -0.35, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("y"))))]
    pub y_mm: f64,
    /// Height along the axis.
    #[schema(minimum = -100_000.0, maximum = 100_000.0, example = 12.5, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("z"))))]
    pub z_mm: f64,
}

/// A distance from the axis of measurement.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct CylinderRadiusRow {
    /// Height along the axis.
    #[schema(minimum = -100_000.0, maximum = 100_000.0, example = 12.5, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("z"))))]
    pub z_mm: f64,
    /// Angle, counter-clockwise, from the same zero at every height.
    #[schema(minimum = -720.0, maximum = 720.0, example = 12.5, extensions(("x-unit" = json!("deg")), ("x-symbol" = json!("theta"))))]
    pub angle_deg: f64,
    /// Distance from the axis of measurement.
    #[schema(minimum = 0.01, maximum = 20_000.0, example = 25.003, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("r"))))]
    pub radius_mm: f64,
}

/// A deviation from the nominal radius.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct CylinderDeviationRow {
    /// Height along the axis.
    #[schema(minimum = -100_000.0, maximum = 100_000.0, example = 12.5, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("z"))))]
    pub z_mm: f64,
    /// Angle, counter-clockwise, from the same zero at every height.
    #[schema(minimum = -720.0, maximum = 720.0, example = 12.5, extensions(("x-unit" = json!("deg")), ("x-symbol" = json!("theta"))))]
    pub angle_deg: f64,
    /// Deviation of the distance from `nominal_radius_mm`, outward positive.
    #[schema(minimum = -1_000_000.0, maximum = 1_000_000.0, example = 3.2, extensions(("x-unit" = json!("um")), ("x-symbol" = json!("delta_r"))))]
    pub radial_deviation_um: f64,
}

impl MeasuredRow for CylinderPointRow {
    const MAX_ROWS: usize = MAX_POINTS;
}
impl MeasuredRow for CylinderRadiusRow {
    const MAX_ROWS: usize = MAX_POINTS;
}
impl MeasuredRow for CylinderDeviationRow {
    const MAX_ROWS: usize = MAX_POINTS;
}
