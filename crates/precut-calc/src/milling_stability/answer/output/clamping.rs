//! How hard the workpiece must be clamped.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// How hard the workpiece must be clamped. Forces are those by which it holds at the lowest friction, with the safety on the loads.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct MillingClamping {
    /// How the clamp force at hand holds.
    pub status: ClampingStatus,
    /// Least clamp force at which no contact slips or opens at any instant; null where none holds.
    #[schema(extensions(("x-unit" = json!("N"))))]
    pub clamp_force_min_n: Option<f64>,
    /// The same at the likely friction.
    #[schema(extensions(("x-unit" = json!("N"))))]
    pub at_likely_friction_n: Option<f64>,
    /// The same at the highest friction.
    #[schema(extensions(("x-unit" = json!("N"))))]
    pub at_high_friction_n: Option<f64>,
    /// The same by the mean force of the cut.
    #[schema(extensions(("x-unit" = json!("N"))))]
    pub against_mean_n: Option<f64>,
    /// Below this the workpiece slips for certain, whatever friction does; null where that is not known.
    #[schema(extensions(("x-unit" = json!("N"))))]
    pub certain_slip_below_n: Option<f64>,
    /// The same by the mean force of the cut.
    #[schema(extensions(("x-unit" = json!("N"))))]
    pub certain_slip_by_mean_n: Option<f64>,
    /// Places of the cut, in the order in which they are numbered, and what each asks for.
    pub stations: Vec<ClampStation>,
    /// Whether the job states no place but the first, so that the ends of the way along the feed were taken.
    pub stations_assumed: bool,
    /// What asks for the least clamp force; null where none holds, or nothing asks for any.
    pub decides: Option<ClampDeciding>,
    /// Factor on the loads at which a contact slips or opens; null without a clamp force at hand.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub clamp_safety: Option<f64>,
    /// Factor on the loads beyond which slip is certain; null without a clamp force at hand.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub certain_slip_safety: Option<f64>,
    /// Least friction, the same everywhere, by which the clamp force at hand holds; null without one, or where a contact opens.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub friction_needed: Option<f64>,
    /// Largest upward force of the cut on the workpiece.
    #[schema(extensions(("x-unit" = json!("N"))))]
    pub upward_n: f64,
    /// Contacts without clamp force that come off; no failure by itself.
    pub lifts: Vec<ClampLift>,
    /// Largest force that takes the workpiece off all such contacts at once; null where one of them always stays.
    #[schema(extensions(("x-unit" = json!("N"))))]
    pub comes_off_n: Option<f64>,
    /// Peak of what the springs of the work carry over that of the static force; 1 where the work is rigid, null where the motion is not known.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub dynamic_factor: Option<f64>,
    /// Contacts, at the clamp force at hand, else at the least that holds.
    pub contacts: Vec<ContactUse>,
    /// Clamp force that is asked for over a period of the cut.
    pub over_turn: ClampTurn,
    /// What would hold where no clamp force does; it was solved.
    pub remedy: Option<ClampRemedy>,
}

/// A place of the cut.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct ClampStation {
    /// Where, along X of the fixture.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub x_mm: f64,
    /// Along Y.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub y_mm: f64,
    /// Along Z.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub z_mm: f64,
    /// Least clamp force that holds while the cut acts there; null where none holds.
    #[schema(extensions(("x-unit" = json!("N"))))]
    pub clamp_force_min_n: Option<f64>,
}

/// How a clamp force holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum ClampingStatus {
    /// No contact slips or opens.
    Holds,
    /// Single contacts slip; the workpiece may stay.
    Creeps,
    /// The workpiece slips for certain.
    Slips,
    /// A contact opens.
    Opens,
    /// None is at hand.
    NoForceGiven,
    /// None would do.
    CannotHold,
}

impl ClampingStatus {
    /// Its name, as in the contract.
    pub fn name(self) -> &'static str {
        match self {
            Self::Holds => "holds",
            Self::Creeps => "creeps",
            Self::Slips => "slips",
            Self::Opens => "opens",
            Self::NoForceGiven => "no_force_given",
            Self::CannotHold => "cannot_hold",
        }
    }
}

/// What asks for the least clamp force.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct ClampDeciding {
    /// Number of the contact, from 1.
    #[schema(minimum = 1, extensions(("x-unit" = json!("1"))))]
    pub contact: u32,
    /// Number of the place of the cut, from 1.
    #[schema(minimum = 1, extensions(("x-unit" = json!("1"))))]
    pub station: u32,
    /// Rotation of the cutter in its period.
    #[schema(extensions(("x-unit" = json!("deg"))))]
    pub rotation_deg: f64,
    /// What fails first.
    pub criterion: ClampCriterion,
}

/// What fails at a contact.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum ClampCriterion {
    /// Its friction is used up.
    Slip,
    /// Its normal force is gone.
    Opening,
}

/// A contact that comes off.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct ClampLift {
    /// Number of the contact, from 1.
    #[schema(minimum = 1, extensions(("x-unit" = json!("1"))))]
    pub contact: u32,
    /// Force of the cut off it; below 0 where the workpiece rocks off it.
    #[schema(extensions(("x-unit" = json!("N"))))]
    pub off_n: f64,
}

/// What a contact carries.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct ContactUse {
    /// Where, along X of the fixture.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub x_mm: f64,
    /// Along Y.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub y_mm: f64,
    /// Along Z.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub z_mm: f64,
    /// Normal force at rest.
    #[schema(extensions(("x-unit" = json!("N"))))]
    pub rest_n: f64,
    /// Least normal force under the cut.
    #[schema(extensions(("x-unit" = json!("N"))))]
    pub least_normal_n: f64,
    /// Largest force across the normal.
    #[schema(extensions(("x-unit" = json!("N"))))]
    pub tangential_n: f64,
    /// Share of its lowest friction that is used; null where it opens or comes off.
    #[schema(extensions(("x-unit" = json!("percent"))))]
    pub friction_used_percent: Option<f64>,
}

/// Clamp force that is asked for over a period of the cut, the largest of all places of the cut.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct ClampTurn {
    /// Rotation.
    #[schema(extensions(("x-unit" = json!("deg"))))]
    pub rotation_deg: Vec<f64>,
    /// Clamp force at which no contact slips or opens.
    #[schema(extensions(("x-unit" = json!("N"))))]
    pub clamp_force_n: Vec<f64>,
}

/// What would hold, as one more contact or two.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct ClampRemedy {
    /// What is added.
    pub kind: ClampRemedyKind,
    /// Where, along X of the fixture; of a pair the clamp, the locator lies opposite about the middle of the contacts.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub x_mm: f64,
    /// Along Y.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub y_mm: f64,
    /// Along Z.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub z_mm: f64,
    /// Direction into the workpiece, along X.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub normal_x: f64,
    /// Along Y.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub normal_y: f64,
    /// Along Z.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub normal_z: f64,
    /// How far from the clamp of a pair its locator lies, along the normal; null for a stop.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub apart_mm: Option<f64>,
    /// Clamp force that holds then.
    #[schema(extensions(("x-unit" = json!("N"))))]
    pub clamp_force_min_n: f64,
}

/// What is added to a fixture.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum ClampRemedyKind {
    /// A locator.
    Stop,
    /// A clamp and a locator opposite to it.
    SecondPair,
}
