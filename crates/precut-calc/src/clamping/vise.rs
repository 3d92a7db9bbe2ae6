//! A machine vise as contacts (`clamping/1`).

use super::{Contact, Fixture, Vector};

/// A part between two flat jaws on parallels. Its bottom is at z = 0, its middle at x = y = 0; the fixed jaw is at -y.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Vise {
    /// Length of the jaws along x that touch the part.
    pub jaw_length_mm: f64,
    /// Height from the bottom of the part that they grip.
    pub jaw_height_mm: f64,
    /// Width of the part between them.
    pub part_width_mm: f64,
    /// Whether the part rests on parallels.
    pub parallels: bool,
    /// Friction at jaws and parallels.
    pub friction: f64,
    /// Whether the movable jaw presses with a constant force (pneumatic, hydraulic).
    pub constant_force: bool,
    /// Weight of the part.
    pub weight_n: f64,
    /// Its centre of mass.
    pub centre_of_mass_mm: Vector,
}

/// Stiffness of a corner of a jaw and of a parallel, N/mm. Of all corners alike it shares forces out, and its size drops out.
const JAW_N_PER_MM: [f64; 2] = [40_000.0, 28_000.0];
const PARALLEL_N_PER_MM: [f64; 2] = [60_000.0, 42_000.0];
/// Share of the width from the middle to a parallel's contact.
const PARALLEL_OUT: f64 = 5.0 / 12.0;
/// Corners of a jaw.
const CORNERS: f64 = 4.0;

impl Vise {
    /// Its corners as contacts: of each jaw four, the movable ones first, then those of the parallels.
    pub fn fixture(&self) -> Fixture {
        let (x, y) = (0.5 * self.jaw_length_mm, 0.5 * self.part_width_mm);
        let contact = |position_mm, normal, [normal_n_per_mm, tangential_n_per_mm]: [f64; 2], clamp_share| Contact {
            position_mm,
            normal,
            friction: self.friction,
            normal_stiffness_n_per_mm: normal_n_per_mm,
            tangential_stiffness_n_per_mm: tangential_n_per_mm,
            clamp_share,
            constant_force: clamp_share > 0.0 && self.constant_force,
        };
        let corners = [[-x, 0.0], [-x, self.jaw_height_mm], [x, 0.0], [x, self.jaw_height_mm]];
        let jaw = |side: f64, clamp_share: f64| {
            corners.map(|[x, z]| contact([x, side * y, z], [0.0, -side, 0.0], JAW_N_PER_MM, clamp_share))
        };
        let mut contacts: Vec<Contact> = jaw(1.0, 1.0 / CORNERS).into_iter().chain(jaw(-1.0, 0.0)).collect();
        if self.parallels {
            let out = PARALLEL_OUT * self.part_width_mm;
            let places = [[-x, -out], [-x, out], [x, -out], [x, out]];
            contacts.extend(places.map(|[x, y]| contact([x, y, 0.0], [0.0, 0.0, 1.0], PARALLEL_N_PER_MM, 0.0)));
        }
        Fixture { contacts, weight_n: self.weight_n, centre_of_mass_mm: self.centre_of_mass_mm }
    }
}
