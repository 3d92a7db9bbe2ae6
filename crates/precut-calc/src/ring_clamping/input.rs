//! The job: a thin ring and what holds it while it is finished.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// A ring that is clamped, finished and let go.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
#[schema(title = "RingClampingJob")]
pub struct Job {
    /// Outer diameter of the finished ring.
    #[schema(minimum = 1.0, maximum = 20_000.0, example = 150.0, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("d_o")), ("x-group" = json!("workpiece"))))]
    pub outer_diameter_mm: f64,
    /// Inner diameter of the finished ring: its last cut decides the form, and by then the ring has this wall.
    #[schema(minimum = 0.5, maximum = 20_000.0, example = 130.0, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("d_i")), ("x-group" = json!("workpiece"))))]
    pub inner_diameter_mm: f64,
    /// Width of the ring along its axis.
    #[schema(minimum = 0.1, maximum = 10_000.0, example = 24.0, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("b")), ("x-group" = json!("workpiece"))))]
    pub width_mm: f64,
    /// Name in the material library; gives the constants that are not stated. The echoed job has the numbers.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(example = "steel_45", max_length = 64, extensions(("x-library" = json!("materials")), ("x-group" = json!("workpiece"))))]
    pub material: Option<String>,
    /// Young's modulus; needed where no material is named.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 1000.0, maximum = 2_000_000.0, example = 210_000.0, extensions(("x-unit" = json!("N/mm2")), ("x-symbol" = json!("E")), ("x-group" = json!("workpiece"))))]
    pub youngs_modulus_n_per_mm2: Option<f64>,
    /// Poisson's ratio; of the material, or 0.3.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.0, maximum = 0.49, example = 0.3, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("nu")), ("x-group" = json!("workpiece"))))]
    pub poisson_ratio: Option<f64>,
    /// Yield strength; of the material. Where it is known, bending stress above half of it is warned of.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 1.0, maximum = 10_000.0, example = 360.0, extensions(("x-unit" = json!("N/mm2")), ("x-symbol" = json!("sigma_y")), ("x-group" = json!("workpiece"))))]
    pub yield_strength_n_per_mm2: Option<f64>,
    /// What holds the ring.
    #[schema(extensions(("x-group" = json!("machine"))))]
    pub holding: Holding,
    /// What the last cut asks of the grip; left out, nothing is said of the smallest force.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(extensions(("x-group" = json!("cut"))))]
    pub cutting: Option<GripDemand>,
    /// Roundness tolerance of the drawing, for the ring let go.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.001, maximum = 100_000.0, example = 10.0, extensions(("x-unit" = json!("um")), ("x-symbol" = json!("t")), ("x-group" = json!("limits"))))]
    pub roundness_tolerance_um: Option<f64>,
}

/// What holds a ring. Forces are those that act during the last cut: at speed jaws outside press less by what their mass
/// is thrown out with.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
#[schema(as = RingHolding)]
pub enum Holding {
    /// Equal jaws at equal angles, the first at 0 degrees.
    Jaws {
        /// Number of jaws.
        #[schema(minimum = 2, maximum = 64, example = 3, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("n"))))]
        jaws: u32,
        /// Force of each jaw on the ring.
        #[schema(minimum = 0.1, maximum = 1_000_000.0, example = 2000.0, extensions(("x-unit" = json!("N")), ("x-symbol" = json!("F"))))]
        force_per_jaw_n: f64,
        /// Angle over which a jaw presses evenly, seen from the axis: 0 for a point, more for soft jaws bored to size.
        #[serde(default)]
        #[schema(minimum = 0.0, maximum = 180.0, default = 0.0, example = 20.0, extensions(("x-unit" = json!("deg")), ("x-symbol" = json!("phi"))))]
        contact_angle_deg: f64,
        /// From which side they press.
        #[serde(default)]
        #[schema(default = "outside", example = "outside")]
        grip: Grip,
    },
    /// Contacts one by one: shoes and wheel, rollers, a clamp. Their forces must balance.
    Contacts {
        /// The contacts.
        #[schema(min_items = 2, max_items = 64)]
        contacts: Vec<RingContact>,
    },
}

/// From which side jaws press.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
#[schema(as = RingGrip)]
pub enum Grip {
    /// From outside, inward.
    #[default]
    Outside,
    /// From inside, outward.
    Inside,
}

/// A contact.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct RingContact {
    /// Where it presses, counter-clockwise.
    #[schema(minimum = -360.0, maximum = 360.0, example = 0.0, extensions(("x-unit" = json!("deg")), ("x-symbol" = json!("theta"))))]
    pub angle_deg: f64,
    /// Its radial force, inward positive.
    #[schema(minimum = -1_000_000.0, maximum = 1_000_000.0, example = 300.0, extensions(("x-unit" = json!("N")), ("x-symbol" = json!("F"))))]
    pub force_n: f64,
    /// Angle over which it presses evenly, seen from the axis: 0 for a point.
    #[serde(default)]
    #[schema(minimum = 0.0, maximum = 180.0, default = 0.0, example = 5.0, extensions(("x-unit" = json!("deg")), ("x-symbol" = json!("phi"))))]
    pub contact_angle_deg: f64,
}

/// What a cut asks of the grip.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
#[schema(as = RingGripDemand)]
pub struct GripDemand {
    /// Main cutting force, along the surface.
    #[schema(minimum = 0.0, maximum = 1_000_000.0, example = 250.0, extensions(("x-unit" = json!("N")), ("x-symbol" = json!("F_c"))))]
    pub tangential_force_n: f64,
    /// Feed force, along the axis, where no stop takes it.
    #[serde(default)]
    #[schema(minimum = 0.0, maximum = 1_000_000.0, default = 0.0, example = 0.0, extensions(("x-unit" = json!("N")), ("x-symbol" = json!("F_f"))))]
    pub axial_force_n: f64,
    /// Diameter of the cut.
    #[schema(minimum = 0.5, maximum = 20_000.0, example = 130.0, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("d_c"))))]
    pub cutting_diameter_mm: f64,
    /// Coefficient of friction between jaws and ring.
    #[serde(default = "friction")]
    #[schema(minimum = 0.01, maximum = 2.0, default = 0.12, example = 0.12, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("mu"))))]
    pub friction: f64,
    /// How many times the force that just holds is wanted.
    #[serde(default = "safety")]
    #[schema(minimum = 1.0, maximum = 20.0, default = 2.0, example = 2.0, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("S"))))]
    pub safety: f64,
}

fn friction() -> f64 {
    0.12
}

fn safety() -> f64 {
    2.0
}
