//! The answer: circles with their proofs, filtered profile, spectrum, and how far each number is to be trusted.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// The roundness of a measured section.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[schema(title = "RoundnessEvaluationResult")]
pub struct Outcome {
    /// RONt of the filtered profile about the reference circle that was asked for; without a filter, of the points.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub roundness_um: f64,
    /// What the points are like.
    pub data: RoundnessData,
    /// Circles of the points as they are; centres in the coordinates of the job.
    pub measured: RoundnessCircles,
    /// Circles of the filtered profile at uniform angles, or of the points where no filter acted; centres relative to the
    /// least-squares centre of the points.
    pub filtered: RoundnessCircles,
    /// The profile about the least-squares centre of the points.
    pub profile: RoundnessProfile,
    /// Harmonics of the profile before the filter.
    pub spectrum: RoundnessSpectrum,
    /// Bound of the round-off in `roundness_um`, in every radius and in every amplitude.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub numerical_error_um: f64,
}

/// What the points are like.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct RoundnessData {
    /// Number of points.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub points: usize,
    /// Widest angle between neighbours, as seen from the least-squares centre.
    #[schema(extensions(("x-unit" = json!("deg"))))]
    pub largest_gap_deg: f64,
    /// Whether the angles of the job are uniform; if not, filter and spectrum act on a spline through the points.
    pub uniform: bool,
    /// Distance of the least-squares centre from the origin of the job.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub eccentricity_mm: f64,
    /// Direction of the least-squares centre from the origin of the job.
    #[schema(extensions(("x-unit" = json!("deg"))))]
    pub eccentricity_angle_deg: f64,
    /// Whether the filter of the job acted. It does not where the points leave a gap that a curve would have to invent, or
    /// are fewer than two per wave of the cut-off: then the values are those of the points, and with a gap there is no
    /// spectrum.
    pub filter_applied: bool,
    /// What was put right in reading.
    pub repairs: Vec<RoundnessRepair>,
    /// Readings that stand off all around them by more than eight standard deviations of those: dirt, a scratch, a jump of
    /// the probe, a keyway. Whether they count is a matter of the job's `spikes`.
    pub spikes: Vec<RoundnessSpike>,
    /// `roundness_um` of the same job with its spikes left out; null where there are none, or they are left out.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub roundness_without_spikes_um: Option<f64>,
    /// Estimated error of the spline between the points (root mean square): a spline through every second point misses
    /// the others by sixteen times as much, if the form is smooth. Exact points have none.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub interpolation_error_um: f64,
    /// Estimated amplitude that waves too short for the points add to any harmonic: root mean square of the highest
    /// quarter of all harmonics.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub aliasing_um: f64,
}

/// Readings side by side that stand off all around them.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct RoundnessSpike {
    /// Row of the job's table that stands off most, from 0.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub row: usize,
    /// Direction of it from the least-squares centre of the points.
    #[schema(extensions(("x-unit" = json!("deg"))))]
    pub angle_deg: f64,
    /// Angle between the readings beside the spike.
    #[schema(extensions(("x-unit" = json!("deg"))))]
    pub width_deg: f64,
    /// How many readings it has.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub points: usize,
    /// How far it stands off, outward positive.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub height_um: f64,
}

/// What was put right in reading the table, and what it changes.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct RoundnessRepair {
    /// What was done.
    pub kind: RepairKind,
    /// To how many rows, places or turns.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub count: usize,
    /// Largest difference of the readings that were left out or made one.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub change_um: f64,
}

impl RoundnessRepair {
    pub(in crate::ring_roundness) fn new(kind: RepairKind, count: usize, change_um: f64) -> Self {
        Self { kind, count, change_um }
    }
}

/// A repair made in reading.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum RepairKind {
    /// The last row stood where the first stands, a turn later: it was left out.
    ClosingRowLeftOut,
    /// The rows run through several turns: they were laid on each other.
    TurnsLaidOnEachOther,
    /// The angles did not ascend: the rows were sorted by angle. `count` is how often they fell.
    RowsPutInOrder,
    /// Several readings at one angle were averaged.
    SameAngleAveraged,
    /// Points given more than once were taken once.
    SamePointLeftOut,
    /// Numbers of the file have decimal commas.
    DecimalCommaRead,
    /// Lines of the file that are no rows of numbers: header, comments, results.
    TextLinesSkipped,
    /// Columns of the file that are no angle and no reading.
    ColumnsLeftOut,
    /// The file has no angles: its rows were spread evenly over one turn.
    AnglesSpreadEvenly,
    /// The file says that it runs clockwise: the signs of its angles were changed.
    TurnedRound,
    /// The file states a magnification, by which its deviations were divided.
    MagnificationTakenOut,
    /// The file states no unit of its deviations: they were taken for micrometres.
    TakenAsUm,
    /// Readings of spikes were left out, as the job asks; `change_um` is the height of the highest.
    SpikesLeftOut,
}

impl RepairKind {
    /// Its name, as in the contract.
    pub(in crate::ring_roundness) const fn name(self) -> &'static str {
        match self {
            Self::ClosingRowLeftOut => "closing_row_left_out",
            Self::TurnsLaidOnEachOther => "turns_laid_on_each_other",
            Self::RowsPutInOrder => "rows_put_in_order",
            Self::SameAngleAveraged => "same_angle_averaged",
            Self::SamePointLeftOut => "same_point_left_out",
            Self::DecimalCommaRead => "decimal_comma_read",
            Self::TextLinesSkipped => "text_lines_skipped",
            Self::ColumnsLeftOut => "columns_left_out",
            Self::AnglesSpreadEvenly => "angles_spread_evenly",
            Self::TurnedRound => "turned_round",
            Self::MagnificationTakenOut => "magnification_taken_out",
            Self::TakenAsUm => "taken_as_um",
            Self::SpikesLeftOut => "spikes_left_out",
        }
    }
}

/// The four reference circles.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct RoundnessCircles {
    /// LSCI.
    pub least_squares: RoundnessCircle,
    /// MZCI.
    pub minimum_zone: RoundnessCircle,
    /// MICI.
    pub maximum_inscribed: RoundnessCircle,
    /// MCCI.
    pub minimum_circumscribed: RoundnessCircle,
}

impl RoundnessCircles {
    pub(super) fn all_mut(&mut self) -> [&mut RoundnessCircle; 4] {
        [&mut self.least_squares, &mut self.minimum_zone, &mut self.maximum_inscribed, &mut self.minimum_circumscribed]
    }
}

/// A reference circle and the roundness about it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct RoundnessCircle {
    /// Centre.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub centre_x_mm: f64,
    /// Centre.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub centre_y_mm: f64,
    /// Radius; of the minimum zone the mean of both.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub radius_mm: f64,
    /// Distance of the nearest point from the centre: the inner circle of the minimum zone, the inscribed circle.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub inner_radius_mm: f64,
    /// Distance of the farthest point from the centre: the outer circle of the minimum zone, the circumscribed circle.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub outer_radius_mm: f64,
    /// RONt, peak to valley about the centre.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub ront_um: f64,
    /// RONp, peak beyond the circle; defined for the least-squares circle alone.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub ronp_um: Option<f64>,
    /// RONv, valley inside the circle, positive; defined for the least-squares circle alone.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub ronv_um: Option<f64>,
    /// RONq, root mean square of the deviations; defined for the least-squares circle alone.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub ronq_um: Option<f64>,
    /// The points that decide: where the circle touches, and the farthest or nearest point beside them.
    pub contacts: Vec<RoundnessContact>,
    /// Why no other circle of its kind is better; absent for the least-squares circle, which is decided by all points.
    pub proof: Option<RoundnessProof>,
    /// How much RONt changes when the profile is read four times as densely: peaks and valleys between the points. Absent
    /// where a gap leaves the form between the points unknown.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub sampling_error_um: Option<f64>,
    /// How many points the circle touches, round-off aside, on each of its circles together: more than its contacts where
    /// the form is symmetric and the choice among them is free. Absent for the least-squares circle.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub touching: Option<usize>,
    /// Bound of the round-off in RONt: that of the distances, and of the centre where no value is least or largest at it.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub numerical_error_um: f64,
    /// Bound of the round-off in the centre; absent where the centre is not determined.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub centre_numerical_error_um: Option<f64>,
}

/// A point that decides about a circle.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct RoundnessContact {
    /// What it does.
    pub kind: ContactKind,
    /// Direction from the least-squares centre of the points.
    #[schema(extensions(("x-unit" = json!("deg"))))]
    pub angle_deg: f64,
    /// Row of the job's table, from 0; absent for the filtered profile, whose points are no rows.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub row: Option<usize>,
}

/// What a point does to a circle.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum ContactKind {
    /// It lies on the circle, which holds all points inside.
    Outer,
    /// It lies on the circle, which has no point inside.
    Inner,
    /// It is the farthest from the centre.
    Peak,
    /// It is the nearest to the centre.
    Valley,
}

/// Why no other circle is better.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct RoundnessProof {
    /// Best value that any circle of this kind can have: least width of the zone, largest inscribed radius, smallest
    /// circumscribed radius. The circle found has it, up to `numerical_error_um`, where `is_global`.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub bound_mm: f64,
    /// By how much, at least, the value worsens per length of shift of the centre; near 0 the centre is badly
    /// determined though the value is not.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub stiffness: f64,
    /// No centre within this distance gives a better value; absent where that holds for every centre.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub certified_within_mm: Option<f64>,
    /// Whether no circle about any centre is better.
    pub is_global: bool,
    /// Whether no other circle is as good.
    pub is_unique: bool,
    /// Other circles that are as good.
    pub others: Vec<OtherCircle>,
}

/// A circle as good as the one given.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct OtherCircle {
    /// Centre.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub centre_x_mm: f64,
    /// Centre.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub centre_y_mm: f64,
    /// Radius.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub radius_mm: f64,
}

/// The profile at uniform angles about the least-squares centre of the points, in deviations from its radius.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct RoundnessProfile {
    /// Angle.
    #[schema(extensions(("x-unit" = json!("deg"))))]
    pub angle_deg: Vec<f64>,
    /// Radial deviation before the filter.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub radial_deviation_um: Vec<f64>,
    /// Radial deviation after the filter.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub filtered_deviation_um: Vec<f64>,
}

/// Harmonics of the profile before the filter, about the least-squares centre: amplitude·cos(k(θ − angle of maximum)).
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct RoundnessSpectrum {
    /// Undulations per revolution, k, from 2.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub order: Vec<f64>,
    /// Amplitude, half of the peak to valley of the harmonic alone.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub amplitude_um: Vec<f64>,
    /// First angle of a maximum.
    #[schema(extensions(("x-unit" = json!("deg"))))]
    pub angle_of_max_deg: Vec<f64>,
    /// Share of the amplitude that passes the filter.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub transmission: Vec<f64>,
}
