//! A ring that is turned on its own surface, step by step of the rotation: another discretisation than the calculator's
//! (even steps that know nothing of the nodes, the whole arc between two steps cut to the interpolated path of the tip,
//! Hermite interpolation at the supports) and another solver (fixed point without the slope of the profile).

use std::f64::consts::TAU;

use super::{Acting, Rig};

/// Nodes of the profile.
const NODES: usize = 5760;
/// Steps of a revolution: no multiple of the nodes.
const STEPS: usize = 6100;
/// A step of the centre that changes nothing, mm.
const SETTLED_MM: f64 = 1e-10;

type Point = [f64; 2];

/// Radii at uniform body angles, mm.
struct Body {
    radii: Vec<f64>,
}

impl Body {
    fn blank(rig: &Rig, acting: &Acting) -> Self {
        let radius = |i: usize| {
            let angle = TAU * i as f64 / NODES as f64;
            let waves: f64 = acting.waves.iter().map(|(k, size, phase)| size * (k * angle + phase).cos()).sum();
            rig.radius_mm + 0.5 * rig.ovality_mm * (2.0 * angle).cos() + waves
        };
        Self { radii: (0..NODES).map(radius).collect() }
    }

    /// Hermite, slopes from the neighbours.
    fn radius(&self, angle: f64) -> f64 {
        let place = (angle / TAU).rem_euclid(1.0) * NODES as f64;
        let node = whole(place);
        let u = place - node as f64;
        let at = |k: usize| self.radii[(node + NODES + k - 1) % NODES];
        let [p, q, r, s] = [at(0), at(1), at(2), at(3)];
        let (slope_q, slope_r) = (0.5 * (r - p), 0.5 * (s - q));
        let (u2, u3) = (u * u, u * u * u);
        (2.0 * u3 - 3.0 * u2 + 1.0) * q
            + (u3 - 2.0 * u2 + u) * slope_q
            + (3.0 * u2 - 2.0 * u3) * r
            + (u3 - u2) * slope_r
    }

    /// Cuts every node between two places of the tip down to its path; a share of the depth stays where the tool gives way.
    fn cut(&mut self, from: (f64, f64), to: (f64, f64), push_off: f64) {
        let spacing = TAU / NODES as f64;
        // The tip runs backwards over the body.
        let mut node = (to.0 / spacing).ceil();
        while node * spacing < from.0 {
            let share = (from.0 - node * spacing) / (from.0 - to.0);
            let path = from.1 + share * (to.1 - from.1);
            let radius = &mut self.radii[whole(node.rem_euclid(NODES as f64)) % NODES];
            let depth = (*radius - path).max(0.0);
            *radius -= depth / (1.0 + push_off);
            node += 1.0;
        }
    }
}

/// Where the machine stands at a rotation.
struct Machine<'a> {
    rig: &'a Rig,
    acting: &'a Acting,
}

fn length(p: Point) -> f64 {
    p[0].hypot(p[1])
}

impl Machine<'_> {
    fn support_a(&self, turned: f64) -> Point {
        let [x, y] = self.rig.support_a_mm;
        let (size, ratio, phase) = self.acting.runout;
        let outward = self.acting.wear_mm_per_rev * turned / TAU - size * (ratio * turned + phase).cos();
        let scale = 1.0 + outward / length([x, y]);
        [x * scale, y * scale]
    }

    fn support_b(&self, turned: f64) -> Point {
        let [x, y] = [self.rig.support_b_mm[0] + self.acting.support_b_mm, self.rig.support_b_mm[1]];
        let scale = 1.0 + self.acting.wear_mm_per_rev * turned / TAU / length([x, y]);
        [x * scale, y * scale]
    }

    fn tip(&self, turned: f64) -> Point {
        let [x, y] = self.rig.tip_mm;
        let reach = length([x, y]);
        let (across, along) = ([-y / reach, x / reach], [-x / reach, -y / reach]);
        let (size, waves) = self.acting.chatter;
        let fed = self.rig.feed_mm_per_rev * (turned / TAU).min(self.rig.revolutions);
        let inward = fed + size * (waves * turned).cos();
        let aside = self.acting.tool_aside_mm;
        [x + aside * across[0] + inward * along[0], y + aside * across[1] + inward * along[1]]
    }
}

/// The finished profile: deviations from its least-squares circle to first order at these body angles, um.
pub(super) fn deviations_um(rig: &Rig, acting: &Acting, angles: &[f64]) -> Vec<f64> {
    let machine = Machine { rig, acting };
    let mut body = Body::blank(rig, acting);
    let spark_out = acting.spark_out.unwrap_or(rig.spark_out);
    let steps = whole((rig.revolutions + spark_out) * STEPS as f64);
    let mut centre = [0.0, 0.0];
    let mut before: Option<(f64, f64)> = None;
    for step in 0..=steps {
        let turned = TAU * step as f64 / STEPS as f64;
        let body_turned = turned * (1.0 - acting.slip_deg_per_rev / 360.0);
        let (a, b, tip) = (machine.support_a(turned), machine.support_b(turned), machine.tip(turned));
        centre = rest(&body, a, b, body_turned, centre);
        let from_centre = [tip[0] - centre[0], tip[1] - centre[1]];
        let mut angle = from_centre[1].atan2(from_centre[0]) - body_turned;
        if let Some((last, _)) = before {
            // The same turn as the step before.
            angle += TAU * ((last - angle) / TAU).round();
        }
        let here = (angle, length(from_centre));
        if let Some(last) = before {
            body.cut(last, here, acting.push_off);
        }
        before = Some(here);
    }
    centred_um(&body.radii, angles)
}

/// Where the ring lies with both supports on its surface.
fn rest(body: &Body, a: Point, b: Point, turned: f64, near: Point) -> Point {
    let mut c = near;
    for _ in 0..60 {
        let (to_a, to_b) = ([a[0] - c[0], a[1] - c[1]], [b[0] - c[0], b[1] - c[1]]);
        let (far_a, far_b) = (length(to_a), length(to_b));
        let gap_a = far_a - body.radius(to_a[1].atan2(to_a[0]) - turned);
        let gap_b = far_b - body.radius(to_b[1].atan2(to_b[0]) - turned);
        let (ua, ub) = ([to_a[0] / far_a, to_a[1] / far_a], [to_b[0] / far_b, to_b[1] / far_b]);
        let det = ua[0] * ub[1] - ua[1] * ub[0];
        let step = [(gap_a * ub[1] - gap_b * ua[1]) / det, (ua[0] * gap_b - ub[0] * gap_a) / det];
        c = [c[0] + step[0], c[1] + step[1]];
        if length(step) < SETTLED_MM {
            break;
        }
    }
    c
}

fn centred_um(radii: &[f64], angles: &[f64]) -> Vec<f64> {
    let n = radii.len() as f64;
    let sum = |of: &dyn Fn(f64) -> f64| -> f64 {
        radii.iter().enumerate().map(|(i, r)| r * of(TAU * i as f64 / n)).sum::<f64>() / n
    };
    let (mean, x, y) = (sum(&|_| 1.0), 2.0 * sum(&f64::cos), 2.0 * sum(&f64::sin));
    let read = |angle: f64| {
        let place = (angle / TAU).rem_euclid(1.0) * n;
        let node = whole(place);
        let share = place - node as f64;
        radii[node % radii.len()] * (1.0 - share) + radii[(node + 1) % radii.len()] * share
    };
    angles.iter().map(|&a| 1e3 * (read(a) - mean - x * a.cos() - y * a.sin())).collect()
}

#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a place or a count, not negative")]
fn whole(value: f64) -> usize {
    value as usize
}
