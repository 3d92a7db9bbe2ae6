//! The simulation: a ring that rests on the surface that is being turned.

mod bracketing;
mod envelope;
mod log;
mod nodes;
pub(crate) mod plane;
mod sampled;
mod setting;
mod stepper;
#[cfg(test)]
mod tests;

use plane::Vec2;
pub(crate) use sampled::turn_sampled;
pub(crate) use setting::{Motion, Oscillation, Setting, moved_across};
use setting::{Moving, Still};
use stepper::Stepper;

/// A run at its end.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Turned {
    /// Final profile at the nodes, mm.
    pub radii_mm: Vec<f64>,
    /// Largest depth that the tip found, before it was pushed off, mm.
    pub largest_bite_mm: f64,
    /// Smallest distance that was left between tip and ring, mm; negative where it cut.
    pub smallest_gap_mm: f64,
    /// Revolution of the first contact.
    pub first_contact_rev: Option<f64>,
    /// Last revolution of the feed at which the tip was in the air.
    pub last_air_cut_rev: Option<f64>,
    /// Where the ring was during the last revolution.
    pub path: Vec<Place>,
    /// Most by which a contact was not met, mm: 0 but where both supports stood on flanks steeper than nodes resolve.
    pub unmet_mm: f64,
    /// Nodes cut, or found to be clear.
    pub steps: u64,
}

/// Where the body's origin is at a rotation of the machine.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Place {
    pub turned_rad: f64,
    pub centre_mm: Vec2,
}

/// What happened in a revolution.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Revolution {
    /// Turned so far.
    pub turned_revolutions: f64,
    /// Deepest cut, mm.
    pub deepest_cut_mm: f64,
    /// Share of the revolution in cut.
    pub cutting_share: f64,
}

/// Hears of every revolution with the profile so far, and now and then between two of them; an error ends the run.
pub(crate) type After<'a, E> = dyn FnMut(Option<&Revolution>, &[f64]) -> Result<(), E> + 'a;

/// The ring falls between its supports: there is no place where both touch it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Stuck {
    /// When.
    pub turned_revolutions: f64,
    /// Distance between the supports, mm.
    pub apart_mm: f64,
    /// Largest distance that a ring of this size could span, mm.
    pub reach_mm: f64,
}

/// Turns a ring whose radii at uniform body angles are `profile_mm`; `after` hears of every revolution and now and then
/// in between, with the profile so far, and may end the run.
///
/// Interpolation between nodes is cubic; the location leaves less than 1e-9 mm. What the number of nodes does to a
/// result is to be asked with half of them.
pub(crate) fn turn<E: From<Stuck>>(
    profile_mm: &[f64],
    setting: &Setting,
    after: &mut After<'_, E>,
) -> Result<Turned, E> {
    match Still::of(setting) {
        Some(machine) => Stepper::new(profile_mm, setting, &machine)?.run(after),
        None => Stepper::new(profile_mm, setting, &Moving::of(setting))?.run(after),
    }
}

/// Where a ring comes to rest on its supports before it turns.
pub(crate) fn centre_at_rest_mm(profile_mm: &[f64], setting: &Setting) -> Result<Vec2, Stuck> {
    let machine = Moving::of(setting);
    Ok(Stepper::new(profile_mm, setting, &machine)?.centre_mm())
}
