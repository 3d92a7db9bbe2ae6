//! What is counted while the ring turns.

use std::f64::consts::TAU;

use super::plane::Vec2;
use super::setting::Setting;
use super::{Place, Revolution, Turned};

/// Counts steps.
pub(super) struct Log {
    pub(super) end_rad: f64,
    stop_rad: f64,
    last_from_rad: f64,
    /// Whole run.
    deepest_mm: f64,
    first_contact_rad: Option<f64>,
    last_air_cut_rad: Option<f64>,
    steps: u64,
    path: Vec<Place>,
    /// This revolution.
    deepest_here_mm: f64,
    steps_here: usize,
    cuts_here: usize,
    turned_rad: f64,
}

impl Log {
    pub(super) fn new(setting: &Setting, n: usize) -> Self {
        // Rounding of a whole number of turns must not lose the last node.
        let end_rad = setting.end_rad() * (1.0 + 1e-14);
        Self {
            end_rad,
            stop_rad: TAU * setting.revolutions,
            last_from_rad: end_rad - TAU,
            deepest_mm: f64::NEG_INFINITY,
            first_contact_rad: None,
            last_air_cut_rad: None,
            steps: 0,
            path: Vec::with_capacity(n + 1),
            deepest_here_mm: f64::NEG_INFINITY,
            steps_here: 0,
            cuts_here: 0,
            turned_rad: 0.0,
        }
    }

    #[inline]
    pub(super) fn step(&mut self, depth_mm: f64, turned_rad: f64, centre_mm: Vec2) {
        self.deepest_here_mm = self.deepest_here_mm.max(depth_mm);
        self.steps_here += 1;
        self.turned_rad = turned_rad;
        if depth_mm > 0.0 {
            self.cuts_here += 1;
            if self.first_contact_rad.is_none() {
                self.first_contact_rad = Some(turned_rad);
            }
        } else if turned_rad <= self.stop_rad {
            self.last_air_cut_rad = Some(turned_rad);
        }
        if turned_rad > self.last_from_rad {
            self.path.push(Place { turned_rad, centre_mm });
        }
    }

    /// Closes a revolution; `None` where it had no step.
    pub(super) fn revolution(&mut self) -> Option<Revolution> {
        let steps = std::mem::take(&mut self.steps_here);
        let cuts = std::mem::take(&mut self.cuts_here);
        let deepest = std::mem::replace(&mut self.deepest_here_mm, f64::NEG_INFINITY);
        self.deepest_mm = self.deepest_mm.max(deepest);
        self.steps += steps as u64;
        (steps > 0).then(|| Revolution {
            turned_revolutions: self.turned_rad / TAU,
            deepest_cut_mm: deepest.max(0.0),
            cutting_share: cuts as f64 / steps as f64,
        })
    }

    pub(super) fn turned(self, radii_mm: Vec<f64>, unmet_mm: f64) -> Turned {
        Turned {
            radii_mm,
            unmet_mm,
            largest_bite_mm: self.deepest_mm.max(0.0),
            smallest_gap_mm: -self.deepest_mm,
            first_contact_rev: self.first_contact_rad.map(|rad| rad / TAU),
            last_air_cut_rev: self.last_air_cut_rad.map(|rad| rad / TAU),
            path: self.path,
            steps: self.steps,
        }
    }
}
