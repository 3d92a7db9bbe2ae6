//! The force below which slip is certain (`clamping/3`): least F for which any forces at all balance a load.
//!
//! A second-order cone programme: normal force N_i and tangential force t_i of each contact, |t_i| <= mu_i N_i, in balance with
//! load and weight, N_i = c_i F at clamps. A cone is (mu_i N_i, t_i).

use nalgebra::DVector;

use crate::num::socp::Program;

use super::{Contact, Fixture, Load, Wrench, across};

/// A factor on the loads beyond which none is looked for.
pub const LARGEST_FACTOR: f64 = 1000.0;

/// Contacts as columns of a programme.
struct Cones {
    /// Balance alone.
    balance: Vec<[Wrench; 3]>,
    /// Contacts that are clamped, with mu c of each.
    clamped: Vec<(usize, f64)>,
}

impl Cones {
    fn of(fixture: &Fixture, friction: &[f64]) -> Self {
        let frame = fixture.frame();
        let columns = |(contact, friction): (&Contact, &f64)| {
            let [first, second] = across(&contact.normal);
            let wrench = |direction| frame.wrench(direction, &contact.position_mm);
            [wrench(&contact.normal) / *friction, wrench(&first), wrench(&second)]
        };
        let clamped = fixture.contacts.iter().zip(friction).enumerate();
        Self {
            balance: fixture.contacts.iter().zip(friction).map(columns).collect(),
            clamped: clamped
                .filter(|(_, (contact, _))| contact.is_clamped())
                .map(|(i, (contact, friction))| (i, friction * contact.clamp_share))
                .collect(),
        }
    }

    /// Columns with `further` equations below the balance.
    fn columns(&self, further: usize) -> Vec<[DVector<f64>; 3]> {
        let grown = |wrench: &Wrench| DVector::from_fn(6 + further, |i, _| if i < 6 { wrench[i] } else { 0.0 });
        self.balance.iter().map(|three| [grown(&three[0]), grown(&three[1]), grown(&three[2])]).collect()
    }
}

/// Least clamp force, N, with which a load `factor` times as large and the weight can be balanced at all; `None` where it cannot.
fn least_clamp_n(fixture: &Fixture, cones: &Cones, load: &Load, factor: f64) -> Option<f64> {
    let frame = fixture.frame();
    let asked = frame.load(load, factor) + frame.load(&fixture.weight(), 1.0);
    let size = asked.norm();
    let (&(first, of_first), others) = cones.clamped.split_first()?;
    if size <= 0.0 {
        return Some(0.0);
    }
    // The same F at all clamps.
    let mut columns = cones.columns(others.len());
    for (row, (contact, of)) in others.iter().enumerate() {
        columns[*contact][0][6 + row] = 1.0 / of;
        columns[first][0][6 + row] = -1.0 / of_first;
    }
    let mut cost = vec![[0.0; 3]; columns.len()];
    cost[first][0] = 1.0 / of_first;
    let right = DVector::from_fn(6 + others.len(), |i, _| if i < 6 { -asked[i] / size } else { 0.0 });
    let found = Program { columns, right, cost }.least()?;
    Some((found.value * size).max(0.0))
}

/// The least clamp force with which every load, `factor` times as large, can be balanced at all, and the load that asks for it;
/// `None` where one cannot be. `enough_n` says of each load a force that is known to be enough; no more than `programmes` loads are
/// solved, those that may ask for most.
pub fn certain_slip_below_n(
    fixture: &Fixture,
    loads: &[Load],
    factor: f64,
    friction: &[f64],
    enough_n: &[f64],
    programmes: usize,
) -> Option<(f64, Option<usize>)> {
    let cones = Cones::of(fixture, friction);
    let mut order: Vec<usize> = (0..loads.len()).collect();
    order.sort_by(|a, b| enough_n[*b].total_cmp(&enough_n[*a]));
    let mut most: (f64, Option<usize>) = (0.0, None);
    for load in order.into_iter().take(programmes) {
        if enough_n[load] <= most.0 {
            break;
        }
        let force_n = least_clamp_n(fixture, &cones, &loads[load], factor)?;
        if force_n > most.0 {
            most = (force_n, Some(load));
        }
    }
    Some(most)
}

/// The largest factor on a load that any forces balance under a clamp force, [`LARGEST_FACTOR`] at most; `None` where the weight
/// alone is not held.
pub fn load_factor(fixture: &Fixture, load: &Load, clamp_force_n: f64, friction: &[f64]) -> Option<f64> {
    let frame = fixture.frame();
    let cones = Cones::of(fixture, friction);
    let (cutting, weight) = (frame.load(load, 1.0), frame.load(&fixture.weight(), 1.0));
    let size = cutting.norm();
    if size <= 0.0 {
        return Some(LARGEST_FACTOR);
    }
    // Two cones more, of which the tips alone matter: the factor, and what it is short of the largest; both over the largest.
    let rows = cones.clamped.len() + 1;
    let mut columns = cones.columns(rows);
    let mut right = DVector::from_fn(6 + rows, |i, _| if i < 6 { -weight[i] / size } else { 0.0 });
    for (row, (contact, of)) in cones.clamped.iter().enumerate() {
        columns[*contact][0][6 + row] = 1.0;
        right[6 + row] = of * clamp_force_n / size;
    }
    let last = 5 + rows;
    right[last] = 1.0;
    let nothing = || DVector::zeros(6 + rows);
    let mut of_factor = nothing();
    for i in 0..6 {
        of_factor[i] = cutting[i] / size;
    }
    of_factor[last] = 1.0 / LARGEST_FACTOR;
    let mut of_rest = nothing();
    of_rest[last] = 1.0;
    columns.extend([[of_factor, nothing(), nothing()], [of_rest, nothing(), nothing()]]);
    let mut cost = vec![[0.0; 3]; columns.len()];
    cost[columns.len() - 2][0] = -1.0;
    let found = Program { columns, right, cost }.least()?;
    Some(-found.value)
}
