//! Rules between fields. What one field alone may hold stands in its schema.

use crate::calculator::{Check, Finding, Violations};
use crate::material;

use super::input::{Holding, Job};
use super::presses;

/// Codes of the faults found here.
pub(super) const CODES: &[&str] =
    &["ring_without_wall", "unknown_material", "elastic_constants_missing", "forces_not_balanced", "jaws_overlap"];

/// The sum of forces as vectors may be this share of the sum of their sizes: printed decimals.
const UNBALANCED: f64 = 0.01;

impl Check for Job {
    fn check(&self, violations: &mut Violations) {
        violations.require(self.inner_diameter_mm < self.outer_diameter_mm, || {
            Finding::new("ring_without_wall", "/inner_diameter_mm").measured(
                self.inner_diameter_mm,
                self.outer_diameter_mm,
                "mm",
            )
        });
        match &self.material {
            Some(id) => violations.require(material::find(id).is_some(), || {
                Finding::new("unknown_material", "/material")
                    .with("id", id.clone())
                    .with("known", material::library().iter().map(|m| m.id).collect::<Vec<_>>())
            }),
            None => violations.require(self.youngs_modulus_n_per_mm2.is_some(), || {
                Finding::new("elastic_constants_missing", "/youngs_modulus_n_per_mm2")
            }),
        }
        if let Holding::Jaws { jaws, contact_angle_deg, .. } = self.holding {
            let room_deg = 360.0 / f64::from(jaws.max(1));
            violations.require(contact_angle_deg <= room_deg, || {
                Finding::new("jaws_overlap", "/holding/contact_angle_deg").measured(contact_angle_deg, room_deg, "deg")
            });
        }
        if let Holding::Contacts { .. } = self.holding {
            let presses = presses(&self.holding);
            let sum = |of: fn(f64) -> f64| presses.iter().map(|p| p.force_n * of(p.angle_rad)).sum::<f64>();
            let left_n = sum(f64::cos).hypot(sum(f64::sin));
            let all_n: f64 = presses.iter().map(|press| press.force_n.abs()).sum();
            violations.require(left_n <= UNBALANCED * all_n, || {
                let towards = sum(f64::sin).atan2(sum(f64::cos)).to_degrees().rem_euclid(360.0);
                Finding::new("forces_not_balanced", "/holding/contacts")
                    .measured(left_n, UNBALANCED * all_n, "N")
                    .with("angle_deg", (towards + 180.0).rem_euclid(360.0))
            });
        }
    }
}
