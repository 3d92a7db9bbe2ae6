//! What a cut adds to the contacts, and the least clamp force by which none slips or opens (`clamping/4`).

use nalgebra::Matrix6;

use super::rest::Rest;
use super::springs::{Pressing, Springs};
use super::{Fixture, Load, Unheld, Vector, across, against_slip_n, friction_needed};

/// Forces that a load adds, contact by contact.
#[derive(Debug, Clone, PartialEq)]
pub struct Loaded {
    /// Change of the normal force, N.
    pub normal_n: Vec<f64>,
    /// Force across the normal, N.
    pub tangential: Vec<Vector>,
    /// Which contacts came off: those that no clamp force presses on.
    pub lifted: Vec<usize>,
}

/// What fails first.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Criterion {
    /// Friction is used up.
    Slip,
    /// The normal force is gone.
    Opening,
}

/// The contact, load and criterion that ask for most.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Deciding {
    /// Clamp force that it asks for, N; below 0 where it would hold without.
    pub clamp_force_n: f64,
    /// Contact.
    pub contact: usize,
    /// Load.
    pub load: usize,
    /// What fails.
    pub criterion: Criterion,
}

/// A contact that a load takes off its locator.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Lift {
    /// Contact.
    pub contact: usize,
    /// Load.
    pub load: usize,
    /// Force of the load off the locator, N.
    pub off_n: f64,
}

fn length(v: &Vector) -> f64 {
    v.iter().map(|x| x * x).sum::<f64>().sqrt()
}

impl Rest {
    /// The part on all its springs, ready for loads. Contacts that the clamp presses hold both ways while they are closed, one of
    /// constant force across its normal alone; the others only press, without friction.
    fn springs(&self, fixture: &Fixture) -> (Springs, Vec<usize>) {
        let frame = fixture.frame();
        let mut bound = Matrix6::zeros();
        let (mut pressing, mut unclamped) = (Vec::new(), Vec::new());
        for (i, contact) in fixture.contacts.iter().enumerate() {
            let along = frame.wrench(&contact.normal, &contact.position_mm);
            if self.shares[i] <= 0.0 {
                let stiffness_n_per_mm = contact.normal_stiffness_n_per_mm;
                pressing.push(Pressing { along, stiffness_n_per_mm, before_n: self.by_weight_n[i] });
                unclamped.push(i);
                continue;
            }
            if !(contact.is_clamped() && contact.constant_force) {
                bound += along * along.transpose() * contact.normal_stiffness_n_per_mm;
            }
            for tangent in across(&contact.normal) {
                let along = frame.wrench(&tangent, &contact.position_mm);
                bound += along * along.transpose() * contact.tangential_stiffness_n_per_mm;
            }
        }
        (Springs { bound, pressing }, unclamped)
    }

    /// What each load adds, `factor` times as large; the weight with it where it hangs on friction.
    pub fn loaded(&self, fixture: &Fixture, loads: &[Load], factor: f64) -> Result<Vec<Loaded>, Unheld> {
        let frame = fixture.frame();
        let (springs, unclamped) = self.springs(fixture);
        let hanging = frame.load(&fixture.weight(), if self.weight_hangs { 1.0 } else { 0.0 });
        let one = |load: &Load| {
            let motion = springs.displaced(&(frame.load(load, factor) + hanging))?;
            let mut found = Loaded {
                normal_n: vec![0.0; fixture.contacts.len()],
                tangential: vec![[0.0; 3]; fixture.contacts.len()],
                lifted: Vec::new(),
            };
            for (i, pressing) in unclamped.iter().zip(&springs.pressing) {
                let force_n = pressing.force_n(&motion);
                found.normal_n[*i] = force_n.max(0.0) - self.by_weight_n[*i];
                if force_n < 0.0 {
                    found.lifted.push(*i);
                }
            }
            for (i, contact) in fixture.contacts.iter().enumerate().filter(|(i, _)| self.shares[*i] > 0.0) {
                let moved = |direction: &Vector| frame.wrench(direction, &contact.position_mm).dot(&motion);
                if !(contact.is_clamped() && contact.constant_force) {
                    found.normal_n[i] = -contact.normal_stiffness_n_per_mm * moved(&contact.normal);
                }
                for tangent in across(&contact.normal) {
                    let force_n = -contact.tangential_stiffness_n_per_mm * moved(&tangent);
                    for (sum, share) in found.tangential[i].iter_mut().zip(tangent) {
                        *sum += force_n * share;
                    }
                }
            }
            Ok(found)
        };
        loads.iter().map(one).collect()
    }

    /// The least clamp force by which no contact slips or opens under the loads, with a friction for each contact; `None` without
    /// loads.
    pub fn against_slip(&self, loaded: &[Loaded], friction: &[f64]) -> Option<Deciding> {
        let asked = loaded.iter().enumerate().flat_map(|(load, of)| {
            let pressed = (0..self.shares.len()).filter(|i| self.shares[*i] > 0.0);
            pressed.flat_map(move |contact| {
                let (share, beside_n) = (self.shares[contact], self.by_weight_n[contact] + of.normal_n[contact]);
                let tangential_n = length(&of.tangential[contact]);
                [
                    (Criterion::Slip, against_slip_n(tangential_n, friction[contact], share, beside_n)),
                    (Criterion::Opening, -beside_n / share),
                ]
                .map(|(criterion, clamp_force_n)| Deciding { clamp_force_n, contact, load, criterion })
            })
        });
        asked.reduce(|most, one| if one.clamp_force_n > most.clamp_force_n { one } else { most })
    }

    /// The least friction, the same at all contacts, by which a clamp force holds; `None` where a contact opens.
    pub fn friction_needed(&self, loaded: &[Loaded], clamp_force_n: f64) -> Option<f64> {
        let mut most: f64 = 0.0;
        for of in loaded {
            for (contact, share) in self.shares.iter().enumerate().filter(|(_, share)| **share > 0.0) {
                let normal_n = share * clamp_force_n + self.by_weight_n[contact] + of.normal_n[contact];
                most = most.max(friction_needed(length(&of.tangential[contact]), normal_n)?);
            }
        }
        Some(most)
    }

    /// The load that takes the part off all contacts at once that no clamp force presses on, with the largest force off; `None`
    /// where one of them always stays.
    pub fn comes_off(&self, fixture: &Fixture, loads: &[Load], loaded: &[Loaded]) -> Option<Lift> {
        let unpressed = self.shares.iter().filter(|share| **share <= 0.0).count();
        let all = loaded.iter().enumerate().filter(|(_, of)| unpressed > 0 && of.lifted.len() == unpressed);
        let off = all.flat_map(|(load, of)| {
            of.lifted.iter().map(move |&contact| {
                let off_n = super::dot(&fixture.contacts[contact].normal, &loads[load].force_n);
                Lift { contact, load, off_n }
            })
        });
        off.filter(|lift| lift.off_n > 0.0).max_by(|a, b| a.off_n.total_cmp(&b.off_n))
    }

    /// Contacts that loads take off, with the largest force that does.
    pub fn lifts(&self, fixture: &Fixture, loads: &[Load], loaded: &[Loaded]) -> Vec<Lift> {
        let mut found: Vec<Lift> = Vec::new();
        for (load, of) in loaded.iter().enumerate() {
            for &contact in &of.lifted {
                let off_n = super::dot(&fixture.contacts[contact].normal, &loads[load].force_n);
                match found.iter_mut().find(|lift| lift.contact == contact) {
                    Some(lift) if lift.off_n >= off_n => {}
                    Some(lift) => *lift = Lift { contact, load, off_n },
                    None => found.push(Lift { contact, load, off_n }),
                }
            }
        }
        found
    }
}
