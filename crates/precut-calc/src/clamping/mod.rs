//! How hard a part must be clamped so that it neither opens, lifts nor slips (`clamping`).
//!
//! A rigid part on contacts with friction. `rest` is what the clamp alone does, `elastic` what a cut adds on the springs of the
//! contacts, and the force by which no contact slips; `equilibrium` the force below which slip is certain. `vise` builds the
//! contacts of a machine vise.

mod elastic;
mod equilibrium;
mod rest;
mod sheet;
mod springs;
mod vise;

pub use elastic::{Criterion, Deciding, Lift, Loaded};
pub use equilibrium::{LARGEST_FACTOR, certain_slip_below_n, load_factor};
pub use rest::Rest;
pub use sheet::{Asked, AtHand, Sheet, Used};
pub use vise::Vise;

/// A place, direction or force in space: x, y, z.
pub type Vector = [f64; 3];

/// A contact between fixture and part.
#[derive(Debug, Clone, PartialEq)]
pub struct Contact {
    /// Where.
    pub position_mm: Vector,
    /// Direction of length 1 into the part.
    pub normal: Vector,
    /// Coefficient of friction.
    pub friction: f64,
    /// Stiffness along the normal.
    pub normal_stiffness_n_per_mm: f64,
    /// Stiffness across it, the same both ways.
    pub tangential_stiffness_n_per_mm: f64,
    /// Its normal force at rest is this share of the clamp force; 0 for a locator.
    pub clamp_share: f64,
    /// Whether its normal force stays as it is (pneumatic, hydraulic) and is no spring (a screw is one).
    pub constant_force: bool,
}

impl Contact {
    /// Whether a clamp presses here.
    pub fn is_clamped(&self) -> bool {
        self.clamp_share > 0.0
    }
}

/// A force on the part.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Load {
    /// Force.
    pub force_n: Vector,
    /// Where it acts.
    pub point_mm: Vector,
}

/// What holds the part, and its weight.
#[derive(Debug, Clone, PartialEq)]
pub struct Fixture {
    /// Contacts.
    pub contacts: Vec<Contact>,
    /// Weight of the part, along -z.
    pub weight_n: f64,
    /// Where it acts.
    pub centre_of_mass_mm: Vector,
}

/// Why a part does not stand.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Unheld {
    /// No contact is clamped.
    NothingClamped,
    /// Nothing holds against this motion of the part: displacement at the middle of the contacts, and rotation about it, of length 1
    /// together, rotations times the mean distance of the contacts.
    Free([f64; 6]),
}

impl Fixture {
    /// The fixture with its contacts in numbers that are about as large along as about an axis.
    fn frame(&self) -> Frame {
        Frame::of(&self.contacts)
    }

    /// Weight as a load.
    fn weight(&self) -> Load {
        Load { force_n: [0.0, 0.0, -self.weight_n], point_mm: self.centre_of_mass_mm }
    }
}

/// Middle of the contacts and their mean distance from it.
#[derive(Debug, Clone, Copy)]
struct Frame {
    middle_mm: Vector,
    length_mm: f64,
}

/// Force and couple about the middle over the length.
type Wrench = nalgebra::Vector6<f64>;

impl Frame {
    fn of(contacts: &[Contact]) -> Self {
        let count = contacts.len().max(1) as f64;
        let middle_mm: Vector =
            std::array::from_fn(|i| contacts.iter().map(|one| one.position_mm[i]).sum::<f64>() / count);
        let squares: f64 =
            contacts.iter().flat_map(|one| (0..3).map(|i| (one.position_mm[i] - middle_mm[i]).powi(2))).sum();
        let length_mm = (squares / count).sqrt();
        Self { middle_mm, length_mm: if length_mm > 0.0 { length_mm } else { 1.0 } }
    }

    /// A force along `force` at `point_mm`; by the same numbers, how far the point goes along it when the part moves.
    fn wrench(&self, force: &Vector, point_mm: &Vector) -> Wrench {
        let arm: Vector = std::array::from_fn(|i| (point_mm[i] - self.middle_mm[i]) / self.length_mm);
        let couple = cross(&arm, force);
        Wrench::new(force[0], force[1], force[2], couple[0], couple[1], couple[2])
    }

    fn load(&self, load: &Load, factor: f64) -> Wrench {
        self.wrench(&load.force_n, &load.point_mm) * factor
    }
}

fn cross(a: &Vector, b: &Vector) -> Vector {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

fn dot(a: &Vector, b: &Vector) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

/// Two directions of length 1 across a normal.
fn across(normal: &Vector) -> [Vector; 2] {
    let least = (0..3).min_by(|a, b| normal[*a].abs().total_cmp(&normal[*b].abs())).unwrap_or(0);
    let axis: Vector = std::array::from_fn(|i| if i == least { 1.0 } else { 0.0 });
    let first = cross(normal, &axis);
    let length = dot(&first, &first).sqrt();
    let first = first.map(|x| x / length);
    [first, cross(normal, &first)]
}

/// Least clamp force, N, by which friction holds `tangential_n` where the normal force is `share` of the clamp force and
/// `beside_n` more.
pub fn against_slip_n(tangential_n: f64, friction: f64, share: f64, beside_n: f64) -> f64 {
    (tangential_n / friction - beside_n) / share
}

/// Least friction by which `normal_n` holds `tangential_n`; `None` where nothing presses.
pub fn friction_needed(tangential_n: f64, normal_n: f64) -> Option<f64> {
    if tangential_n <= 0.0 { Some(0.0) } else { (normal_n > 0.0).then(|| tangential_n / normal_n) }
}
