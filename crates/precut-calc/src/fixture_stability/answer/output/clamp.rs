//! What the clamp force has to hold.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::OpenJoint;

/// Least clamp force for a regime in which no joint opens.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct ClampForce {
    /// Clamp force below which a joint opens in the steady state; null where the cut chatters and its simulation shows no steady state.
    #[schema(extensions(
        ("x-unit" = json!("N")),
        ("x-bars" = json!({
            "asks": [["static_movable_n", "static_fixed_n"], ["least_n"], ["least_with_entry_n"]],
            "needs": ["least_n", "least_with_entry_n"],
            "set": "/fixture/clamp_force_n",
        }))
    ))]
    pub least_n: Option<f64>,
    /// The same with the hard entry.
    #[schema(extensions(("x-unit" = json!("N"))))]
    pub least_with_entry_n: Option<f64>,
    /// Which joint asks for it; null where none asks for any.
    pub binding_joint: Option<OpenJoint>,
    /// Steady state: joint at the movable jaw, with its damping.
    #[schema(extensions(("x-unit" = json!("N"))))]
    pub movable_n: Option<f64>,
    /// Joint at the fixed jaw.
    #[schema(extensions(("x-unit" = json!("N"))))]
    pub fixed_n: Option<f64>,
    /// Elastic part alone: joint at the movable jaw.
    #[schema(extensions(("x-unit" = json!("N"))))]
    pub movable_elastic_n: Option<f64>,
    /// Joint at the fixed jaw.
    #[schema(extensions(("x-unit" = json!("N"))))]
    pub fixed_elastic_n: Option<f64>,
    /// What a textbook asks: the static force on the joint at the movable jaw, factor 1.
    #[schema(extensions(("x-unit" = json!("N"))))]
    pub static_movable_n: f64,
    /// On the joint at the fixed jaw.
    #[schema(extensions(("x-unit" = json!("N"))))]
    pub static_fixed_n: f64,
    /// The safety factor that opening asks on the static force; null where the static force is 0, or what is needed is not known.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub factor_needed: Option<f64>,
    /// The same with the hard entry.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub factor_needed_with_entry: Option<f64>,
    /// Whether it comes from the exact forced motion (stable) or from a simulated chatter that should not be run.
    pub stable: bool,
    /// What pushes the workpiece along the jaws, where only friction holds it.
    pub along: PushedAlong,
    /// Clamp force by which friction holds that; null where the job does not say how the jaws grip, and in chatter.
    pub slip: Option<SlipForce>,
    /// Deepest cut that the given clamp force holds, where it is reached before chatter.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub depth_for_given_force_mm: Option<f64>,
    /// What happens if the joint at the movable jaw opens: modulus of the multiplier of what is left in the cut, a drift as one body left out.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub modulus_movable_open: f64,
    /// If that at the fixed jaw opens.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub modulus_fixed_open: f64,
    /// Textbook safety factors beside it.
    pub textbook: Vec<TextbookForce>,
}

/// Force of smooth chips on the workpiece along the jaws, where only friction holds it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct PushedAlong {
    /// Across the feed, mean.
    #[schema(extensions(("x-unit" = json!("N"))))]
    pub across_mean_n: f64,
    /// Across the feed, largest either way.
    #[schema(extensions(("x-unit" = json!("N"))))]
    pub across_peak_n: f64,
    /// Upward, mean; 0 where the cut presses down.
    #[schema(extensions(("x-unit" = json!("N"))))]
    pub upward_mean_n: f64,
    /// Upward, largest.
    #[schema(extensions(("x-unit" = json!("N"))))]
    pub upward_peak_n: f64,
}

/// Clamp force by which friction holds the workpiece at every instant of the forced motion.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct SlipForce {
    /// With the lowest friction: the force to set where it is above that against opening.
    #[schema(extensions(("x-unit" = json!("N"))))]
    pub clamp_force_min_n: f64,
    /// With the likely friction.
    #[schema(extensions(("x-unit" = json!("N"))))]
    pub at_likely_friction_n: f64,
    /// With the highest friction.
    #[schema(extensions(("x-unit" = json!("N"))))]
    pub at_high_friction_n: f64,
    /// Against the mean forces alone, without vibration, with the lowest friction.
    #[schema(extensions(("x-unit" = json!("N"))))]
    pub against_mean_n: f64,
    /// Friction with which the given clamp force holds; null where none is given, or some moment leaves no normal force.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub friction_needed: Option<f64>,
    /// Whether the given clamp force holds with the lowest friction; null where none is given.
    pub holds: Option<bool>,
}

/// Static clamp force times a safety factor.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct TextbookForce {
    /// Safety factor.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub factor: f64,
    /// Clamp force with it.
    #[schema(extensions(("x-unit" = json!("N"))))]
    pub clamp_force_n: f64,
    /// Whether it is enough in the steady state.
    pub enough: bool,
}
