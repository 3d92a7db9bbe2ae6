//! The pure compute core of `precut`.
//!
//! No async, no I/O, no clock, no HTTP, no global state: a job in, an answer out, and
//! [`calculator::Monitor`] as the only window. Lengths are mm, forces N, angles rad, stresses N/mm²
//! inside; micrometres and degrees only at the border, where every field's name carries its unit.

pub mod calculator;
pub mod deflection_compensation;
pub mod diagnosis;
pub mod effects;
pub mod force;
pub mod material;
pub mod num;
pub mod path;

use calculator::Registrar;

/// Every calculator, one line each. Nothing else has to change when one moves in.
pub fn register(registrar: &mut impl Registrar) {
    registrar.with_forward_model::<deflection_compensation::DeflectionCompensation>();
}
