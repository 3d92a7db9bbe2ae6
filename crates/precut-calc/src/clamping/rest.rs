//! The part clamped and not yet cut (`clamping/2`).

use nalgebra::Matrix6;

use super::springs::{Pressing, Springs};
use super::{Fixture, Unheld, Wrench};

/// A normal force that is less than this share of the clamp force is none.
const NONE: f64 = 1e-9;

/// Normal forces at rest: N_i = a_i F + b_i, F the clamp force.
#[derive(Debug, Clone, PartialEq)]
pub struct Rest {
    /// a_i.
    pub shares: Vec<f64>,
    /// b_i, by the weight.
    pub by_weight_n: Vec<f64>,
    /// Whether no normal carries the weight: it hangs on friction, and is a load.
    pub weight_hangs: bool,
}

impl Rest {
    /// Of a clamped part: locators press with least complementary energy, sum of N^2/2k with N >= 0, in balance with the clamps;
    /// without friction, as the jaw closes.
    pub fn of(fixture: &Fixture) -> Result<Self, Unheld> {
        if !fixture.contacts.iter().any(super::Contact::is_clamped) {
            return Err(Unheld::NothingClamped);
        }
        let frame = fixture.frame();
        let along: Vec<Wrench> =
            fixture.contacts.iter().map(|one| frame.wrench(&one.normal, &one.position_mm)).collect();
        let clamps: Wrench = fixture.contacts.iter().zip(&along).map(|(one, along)| along * one.clamp_share).sum();
        // Least complementary energy: the part moves against springs that only press.
        let locators: Vec<usize> = (0..along.len()).filter(|i| !fixture.contacts[*i].is_clamped()).collect();
        let pressing = |i: &usize| Pressing {
            along: along[*i],
            stiffness_n_per_mm: fixture.contacts[*i].normal_stiffness_n_per_mm,
            before_n: 0.0,
        };
        let springs = Springs { bound: Matrix6::zeros(), pressing: locators.iter().map(pressing).collect() };
        let forces = |load: &Wrench| {
            let motion = springs.displaced(load)?;
            let mut forces = vec![0.0; along.len()];
            for (i, one) in locators.iter().zip(&springs.pressing) {
                forces[*i] = one.force_n(&motion).max(0.0);
            }
            Ok(forces)
        };
        let mut shares = forces(&clamps)?;
        let most = shares.iter().copied().fold(0.0, f64::max);
        for (share, contact) in shares.iter_mut().zip(&fixture.contacts) {
            if contact.is_clamped() {
                *share = contact.clamp_share;
            } else if *share < NONE * most {
                *share = 0.0;
            }
        }
        let carried: Result<Vec<f64>, Unheld> = forces(&frame.load(&fixture.weight(), 1.0));
        let weight_hangs = carried.is_err();
        Ok(Self { shares, by_weight_n: carried.unwrap_or_else(|_| vec![0.0; along.len()]), weight_hangs })
    }
}
