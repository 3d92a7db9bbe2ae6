//! A roller of finite radius touches the profile where its centre is farthest out (`ring/3.2`).

use super::nodes::{CUBIC_PAD, Nodes, Place};

/// Largest angle of the contact seen from the centre of the ring that is looked at, rad.
const WIDEST_RAD: f64 = 0.5;
/// Share of the roller's radius up to which its side is looked at.
const SIDE: f64 = 0.95;
/// The window reaches so many times as deep as the profile is.
const MARGIN: f64 = 1.5;

/// Distance of the roller's centre from that of the ring, at the nodes, computed where the rollers come by.
#[derive(Debug, Clone)]
pub(super) struct Envelope {
    roller_mm: f64,
    step_rad: f64,
    /// Roller-centre distances; those not stamped of late are out of date.
    distance: Nodes,
    stamp: Vec<u64>,
    /// cos ψ and sin² ψ for ψ = -half..=half nodes.
    cos: Vec<f64>,
    sin2: Vec<f64>,
    half: usize,
    scratch: Vec<f64>,
    lowest_mm: f64,
    depth_mm: f64,
    /// Most that a contact between two nodes can lie above the better of them, mm.
    between_mm: f64,
}

/// Most that the curvature of the pair of contacts may exceed that of two circles.
const SHARPER: f64 = 1.5;

/// Ghosts that the window of a roller needs on a profile of n nodes.
pub(super) fn pad(n: usize, roller_mm: f64, largest_mm: f64) -> usize {
    let widest = (SIDE * roller_mm / largest_mm).min(1.0).asin().min(WIDEST_RAD);
    nodes_within(widest, std::f64::consts::TAU / n as f64).clamp(CUBIC_PAD, n / 2)
}

#[allow(
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    reason = "an angle below pi over one of at least 2 pi / 2^31"
)]
fn nodes_within(angle_rad: f64, step_rad: f64) -> usize {
    (angle_rad / step_rad).clamp(0.0, 2e9) as usize
}

impl Envelope {
    pub(super) fn new(roller_mm: f64, radii: &Nodes) -> Self {
        let n = radii.len();
        let mut envelope = Self {
            roller_mm,
            step_rad: std::f64::consts::TAU / n as f64,
            distance: Nodes::new(&vec![0.0; n], CUBIC_PAD),
            stamp: vec![0; n],
            cos: Vec::new(),
            sin2: Vec::new(),
            half: 0,
            scratch: Vec::new(),
            lowest_mm: 0.0,
            depth_mm: 0.0,
            between_mm: 0.0,
        };
        envelope.fit(radii);
        envelope
    }

    /// Fits the window to the profile as it is: |ψ| ≤ sqrt(2δ/(R(1+R/r_s))), δ = 1.5 times its depth.
    pub(super) fn fit(&mut self, radii: &Nodes) {
        let (low, high) = radii.range();
        (self.lowest_mm, self.depth_mm) = (low, high - low);
        let curvature = low * (1.0 + low / self.roller_mm);
        self.between_mm = SHARPER * curvature * self.step_rad.powi(2) / 8.0;
        let wanted = (2.0 * MARGIN * self.depth_mm / curvature).sqrt();
        // One node more on either side, for the parabola.
        self.half = (nodes_within(wanted, self.step_rad) + 2).min(radii.pad());
        self.cos.clear();
        self.sin2.clear();
        for j in 0..=2 * self.half {
            let psi = (j as f64 - self.half as f64) * self.step_rad;
            self.cos.push(psi.cos());
            self.sin2.push(psi.sin().powi(2));
        }
        self.scratch.resize(2 * self.half + 1, 0.0);
    }

    /// To be told of every cut: a valley much deeper than the window was made for wants a new one.
    #[inline]
    pub(super) fn heard_of(&mut self, radius_mm: f64, radii: &Nodes) {
        if radius_mm < self.lowest_mm - 0.2 * self.depth_mm {
            self.fit(radii);
        }
    }

    pub(super) fn half(&self) -> usize {
        self.half
    }

    /// Value and slope per node at a place; nodes older than `since` are computed anew.
    pub(super) fn cubic(&mut self, radii: &Nodes, place: Place, now: u64, since: u64) -> (f64, f64) {
        let n = self.stamp.len();
        let mut node = if place.node == 0 { n - 1 } else { place.node - 1 };
        for _ in 0..4 {
            let node_here = if node >= n { node - n } else { node };
            if self.stamp[node_here] < since {
                let distance = self.at_node(radii, node_here);
                self.distance.set(node_here, distance);
                self.stamp[node_here] = now;
            }
            node = node_here + 1;
        }
        self.distance.cubic(place)
    }

    /// E(θ) = max over ψ of r(θ+ψ) cos ψ + sqrt(r_s² - r²(θ+ψ) sin² ψ): the best node, refined by the parabola
    /// through it and its neighbours.
    pub(super) fn at_node(&mut self, radii: &Nodes, node: usize) -> f64 {
        let square = self.roller_mm * self.roller_mm;
        let window = radii.window(node, self.half);
        let angles = self.cos.iter().zip(&self.sin2);
        for ((out, r), (cos, sin2)) in self.scratch.iter_mut().zip(window).zip(angles) {
            *out = r * cos + (square - r * r * sin2).max(0.0).sqrt();
        }
        let mut best = self.half;
        for (j, value) in self.scratch.iter().enumerate() {
            if *value > self.scratch[best] {
                best = j;
            }
        }
        let top = self.scratch[best];
        if best == 0 || best + 1 == self.scratch.len() {
            return top;
        }
        let (below, above) = (self.scratch[best - 1], self.scratch[best + 1]);
        let bend = above - 2.0 * top + below;
        // At the edge of a groove the parabola would rise far above the contact.
        let gain = if bend < 0.0 { -(above - below).powi(2) / (8.0 * bend) } else { 0.0 };
        top + gain.min(self.between_mm)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    /// An off-centre true circle of radius R: the centre of the roller runs on a circle of R + r_s about the same centre.
    #[test]
    fn roller_on_an_eccentric_circle_runs_on_a_circle() {
        let (big, small, off) = (150.0_f64, 20.0_f64, 0.4_f64);
        let polar =
            |radius: f64, theta: f64| off * theta.cos() + (radius * radius - (off * theta.sin()).powi(2)).sqrt();
        for (n, tolerance) in [(720_u32, 6e-6), (3600, 1e-8)] {
            let radii: Vec<f64> = (0..n).map(|i| polar(big, TAU * f64::from(i) / f64::from(n))).collect();
            let nodes = Nodes::new(&radii, pad(n as usize, small, big + off));
            let mut envelope = Envelope::new(small, &nodes);
            for i in (0..n).step_by(31) {
                let expected = polar(big + small, TAU * f64::from(i) / f64::from(n));
                let found = envelope.at_node(&nodes, i as usize);
                // The parabola's error falls with h⁴.
                assert!((found - expected).abs() < tolerance, "{n} {i}: {found} {expected}");
            }
        }
    }

    #[test]
    fn a_narrow_groove_is_bridged() {
        let mut radii = vec![150.0; 3600];
        radii[100] = 149.9;
        let nodes = Nodes::new(&radii, pad(3600, 20.0, 150.0));
        let mut envelope = Envelope::new(20.0, &nodes);
        // The roller stands on the neighbours of the groove, h = 2π/3600 away; between nodes at most 0.7 µm more.
        let h = TAU / 3600.0;
        let expected = 150.0 * h.cos() + (400.0 - (150.0 * h.sin()).powi(2)).sqrt();
        let found = envelope.at_node(&nodes, 100);
        assert!(found >= expected && found < expected + 8e-4, "{found} {expected}");
        assert!((envelope.at_node(&nodes, 300) - 170.0).abs() < 1e-12);
    }
}
