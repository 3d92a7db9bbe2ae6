//! The answer: cylinders with their proofs, sections, axis, taper, what makes the deviation, and the drawing.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::ring_roundness::evaluation::{ContactKind, RoundnessRepair};

/// The cylindricity of measured sections.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[schema(title = "CylindricityEvaluationResult")]
pub struct Outcome {
    /// `CYLt` about the reference that was asked for.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub cylindricity_um: f64,
    /// Largest `RONt` of a section, about the circle that was asked for.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub roundness_um: f64,
    /// What the drawing asks, and whether it is kept.
    pub requirements: Vec<CylinderRequirement>,
    /// The four reference cylinders.
    pub cylinders: ReferenceCylinders,
    /// The sections, from the lowest.
    pub sections: Vec<CylinderSection>,
    /// The line of the sections' centres.
    pub axis: CylinderAxis,
    /// How the radius changes along the axis.
    pub taper: CylinderTaper,
    /// What the cylindricity is made of: each part is taken out of the sections, and the cylinder fitted anew.
    pub parts: Vec<CylinderPart>,
    /// The surface unrolled, about the least-squares cylinder; without sections that leave a gap.
    pub surface: CylinderSurface,
    /// What the points are like.
    pub data: CylinderData,
}

/// What the points are like.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct CylinderData {
    /// Number of points.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub points: usize,
    /// Number of sections.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub sections: usize,
    /// Length along the axis from the lowest point to the highest.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub length_mm: f64,
    /// Whether the filter was applied: in all sections or in none.
    pub filter_applied: bool,
    /// What was put right in reading.
    pub repairs: Vec<RoundnessRepair>,
}

/// The four reference cylinders.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct ReferenceCylinders {
    /// LSCY.
    pub least_squares: ReferenceCylinder,
    /// MZCY.
    pub minimum_zone: ReferenceCylinder,
    /// MICY.
    pub maximum_inscribed: ReferenceCylinder,
    /// MCCY.
    pub minimum_circumscribed: ReferenceCylinder,
}

/// A reference cylinder and the cylindricity about it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct ReferenceCylinder {
    /// Where its axis passes the middle of the measured length.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub centre_x_mm: f64,
    /// As `centre_x_mm`.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub centre_y_mm: f64,
    /// How far its axis moves along x per millimetre of height.
    #[schema(extensions(("x-unit" = json!("um/mm"))))]
    pub slope_x_um_per_mm: f64,
    /// How far its axis moves along y per millimetre of height.
    #[schema(extensions(("x-unit" = json!("um/mm"))))]
    pub slope_y_um_per_mm: f64,
    /// Radius; of the minimum zone the mean of both.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub radius_mm: f64,
    /// Distance of the nearest point from the axis.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub inner_radius_mm: f64,
    /// Distance of the farthest point from the axis.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub outer_radius_mm: f64,
    /// `CYLt`, peak to valley about the axis.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub cylt_um: f64,
    /// `CYLp`, peak beyond the cylinder; defined for the least-squares cylinder alone.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub cylp_um: Option<f64>,
    /// `CYLv`, valley inside the cylinder, positive; defined for the least-squares cylinder alone.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub cylv_um: Option<f64>,
    /// `CYLq`, root mean square of the deviations; defined for the least-squares cylinder alone.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub cylq_um: Option<f64>,
    /// Points that hold the cylinder; of the least-squares cylinder its peak and its valley.
    pub contacts: Vec<CylinderContact>,
    /// How much better another cylinder of the kind could be; absent for the least-squares cylinder, which all points decide.
    pub proof: Option<CylinderProof>,
}

/// A bound on how much better any other cylinder could be.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct CylinderProof {
    /// No other has a zone narrower, or a radius better, by more than this.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub gap_um: f64,
    /// This holds for every axis that passes both ends of the measured length within this distance of the one given.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub within_mm: f64,
}

/// A point that decides about a cylinder.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct CylinderContact {
    /// What it does.
    pub kind: ContactKind,
    /// Section that it belongs to, from 1.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub section: usize,
    /// Direction from the centre of its section.
    #[schema(extensions(("x-unit" = json!("deg"))))]
    pub angle_deg: f64,
}

/// A section, square to the axis of the least-squares cylinder.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct CylinderSection {
    /// Height of its middle as measured.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub height_mm: f64,
    /// Number of points.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub points: usize,
    /// Radius of its least-squares circle.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub radius_mm: f64,
    /// Centre of that circle, off the least-squares cylinder's axis, along x.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub off_x_um: f64,
    /// Centre of that circle, off the least-squares cylinder's axis, along y.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub off_y_um: f64,
    /// `RONt` about the circle that was asked for.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub ront_um: f64,
    /// How far `ront_um` is known, beside the error of the instrument.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub error_um: f64,
    /// Distance of the centre from the datum axis; absent without one.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub off_datum_um: Option<f64>,
}

/// The line of the sections' centres.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct CylinderAxis {
    /// Straightness: diameter of the thinnest cylinder that holds the centres of all sections.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub straightness_um: f64,
    /// No cylinder that holds them is thinner by more than this.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub straightness_gap_um: f64,
    /// Coaxiality: diameter of the cylinder about the datum axis that holds the centres of the other sections; absent
    /// without `datum_sections`.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub coaxiality_um: Option<f64>,
}

/// How the radius changes along the axis.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct CylinderTaper {
    /// Diameter at the highest section less that at the lowest, on the straight line of the sections' radii.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub diameter_change_um: f64,
    /// The same per millimetre of length.
    #[schema(extensions(("x-unit" = json!("um/mm"))))]
    pub diameter_change_um_per_mm: f64,
    /// How much larger the diameter is in the middle than at the ends, on the parabola of the sections' radii; negative
    /// where it is smaller. Absent for two sections.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub barrel_um: Option<f64>,
}

/// A part of the cylindricity.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct CylinderPart {
    /// What is taken out.
    pub part: PartKind,
    /// `CYLt` about the reference without it.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub without_um: f64,
}

/// What a cylindricity is made of.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum PartKind {
    /// The form of each section about its circle.
    Roundness,
    /// The straight change of the radius.
    Taper,
    /// The parabolic change of the radius.
    Barrel,
    /// The centres off their straight line.
    Bend,
}

impl PartKind {
    pub(super) const fn name(self) -> &'static str {
        match self {
            Self::Roundness => "roundness",
            Self::Taper => "taper",
            Self::Barrel => "barrel",
            Self::Bend => "bend",
        }
    }
}

/// What the drawing asks, and whether it is kept.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct CylinderRequirement {
    /// Of what.
    pub of: RequirementKind,
    /// Section that decides, from 1; absent where all do.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub section: Option<usize>,
    /// What was found.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub value_um: f64,
    /// How far it is known: the instrument's uncertainty and what the evaluation leaves open.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub error_um: f64,
    /// What the drawing allows.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub tolerance_um: f64,
    /// By the rule of ISO 14253-1: kept or exceeded only if the error does not reach the tolerance.
    pub verdict: CylinderVerdict,
}

/// What a tolerance is about.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum RequirementKind {
    /// CYLt.
    Cylindricity,
    /// `RONt` of the worst section.
    Roundness,
    /// Straightness of the axis.
    Straightness,
    /// Coaxiality to the datum axis.
    Coaxiality,
}

impl RequirementKind {
    pub(super) const fn name(self) -> &'static str {
        match self {
            Self::Cylindricity => "cylindricity",
            Self::Roundness => "roundness",
            Self::Straightness => "straightness",
            Self::Coaxiality => "coaxiality",
        }
    }
}

/// Whether a tolerance is kept.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum CylinderVerdict {
    /// It is.
    Kept,
    /// It is not.
    Exceeded,
    /// The error decides.
    Undecided,
}

/// Deviations of the surface from the least-squares cylinder, by section and angle.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct CylinderSurface {
    /// Angles round the axis.
    #[schema(extensions(("x-unit" = json!("deg"))))]
    pub angle_deg: Vec<f64>,
    /// Heights of the sections.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub height_mm: Vec<f64>,
    /// Deviations, section after section, each over all angles.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub deviation_um: Vec<f64>,
}
