//! Node-aligned stepping: one node is cut per step, the ring located exactly at each (`ring/3.1` to `ring/3.4`).
//!
//! For the node θ that comes to the tool next, the centre c of the ring and its rotation φ follow from
//!
//! ```text
//! |A-c| = E(arg(A-c) - φ),   |B-c| = E(arg(B-c) - φ),   φ = arg(T(φ)-c) - θ
//! ```
//!
//! by Newton's method on ½(|A-c|² - E²), which needs no root. Angles are taken from directions fixed once per
//! revolution by a short series of the arctangent. A step depends on those before only through its first guess, so
//! several steps are solved side by side ([`LANES`]): the processor overlaps their chains of dependent operations.

use std::f64::consts::TAU;

use super::envelope::{self, Envelope};
use super::log::Log;
use super::nodes::{CUBIC_PAD, Nodes, Place};
use super::plane::{Vec2, angle, cross, dot, norm, scaled, sub, turned, unit};
use super::setting::{Machine, Setting};
use super::{After, Stuck, Turned};

/// Steps solved side by side.
const LANES: usize = 4;
/// Nodes between tool and supports from which on steps may be solved side by side, beside the reach of the readings.
const CLEAR: f64 = 12.0;
/// A step of Newton's method below this leaves less than 1e-9 mm: the error left is at most its square over the
/// radius, and its product with the relative error of the frozen parts of the Jacobian, about 1e-5 at r'/r = 0.02.
const LAST_STEP_MM: f64 = 2e-5;
/// More than ever needed: four are, where the profile tears.
pub(super) const MOST_ITERATIONS: u32 = 60;
/// Tangent of the angle from the fixed directions beyond which they are fixed anew; the series is then exact to 1e-13.
const FAR: f64 = 0.05;
/// Steps between two looks, a tenth of a microsecond each on points and some on rollers.
const STEPS_PER_LOOK: usize = 4096;
/// A rolling contact computed so many steps ago still holds.
const FRESH_STEPS: u64 = 16;

/// Directions fixed for about a revolution.
#[derive(Debug, Clone, Copy)]
pub(super) struct Frame {
    a: Vec2,
    b: Vec2,
    tip: Vec2,
    /// Angles from the tip to the supports, seen from the centre, -π..π.
    to_a_rad: f64,
    to_b_rad: f64,
    /// Angle of the tip, continued over whole turns.
    pub(super) tip_rad: f64,
    /// One over the squared distances.
    per_a2: f64,
    per_b2: f64,
    per_tip2: f64,
    /// Steps may be solved side by side.
    wide: bool,
}

/// Arctangent for small tangents: relative error x⁸/9.
#[inline]
fn arctangent(x: f64) -> f64 {
    let x2 = x * x;
    x * (1.0 - x2 * (1.0 / 3.0 - x2 * (0.2 - x2 * (1.0 / 7.0))))
}

/// The state between two steps.
pub(super) struct Stepper<'a, M> {
    pub(super) machine: &'a M,
    pub(super) setting: &'a Setting,
    pub(super) nodes: Nodes,
    envelope: Option<Envelope>,
    pub(super) per_step: f64,
    pub(super) step_rad: f64,
    /// Rotation of the machine per rotation of the body.
    pub(super) machine_per_body: f64,
    /// Share of the depth that is removed.
    removed: f64,
    pub(super) frame: Frame,
    /// Steps taken.
    pub(super) count: u64,
    /// Node that is cut next, and body angle of the first.
    pub(super) node: usize,
    pub(super) first_rad: f64,
    /// Centres after the last three blocks, newest first.
    pub(super) before: [Vec2; 3],
    /// Rotation of the body after the last step.
    pub(super) body_rad: f64,
    /// Largest radius at the start of the revolution.
    highest_mm: f64,
    /// The directions are too far off.
    pub(super) stale: bool,
    ended: bool,
    /// Most by which a contact was not met, where both supports stood on flanks, mm.
    pub(super) unmet_mm: f64,
}

/// Steps solved side by side.
pub(super) struct Solved<const L: usize> {
    pub(super) centre: [Vec2; L],
    /// Rotation of the body.
    pub(super) body_rad: [f64; L],
}

impl<'a, M: Machine> Stepper<'a, M> {
    pub(super) fn new(profile_mm: &[f64], setting: &'a Setting, machine: &'a M) -> Result<Self, Stuck> {
        let n = profile_mm.len();
        let largest = profile_mm.iter().copied().fold(0.0, f64::max);
        let rollers = setting.roller_radius_mm > 0.0;
        let pad = if rollers { envelope::pad(n, setting.roller_radius_mm, largest) } else { CUBIC_PAD };
        let nodes = Nodes::new(profile_mm, pad);
        let envelope = rollers.then(|| Envelope::new(setting.roller_radius_mm, &nodes));
        let step_rad = TAU / n as f64;
        let still = Frame {
            a: [0.0; 2],
            b: [0.0; 2],
            tip: [0.0; 2],
            to_a_rad: 0.0,
            to_b_rad: 0.0,
            tip_rad: 0.0,
            per_a2: 0.0,
            per_b2: 0.0,
            per_tip2: 0.0,
            wide: false,
        };
        let mut stepper = Self {
            machine,
            setting,
            nodes,
            envelope,
            per_step: 1.0 / step_rad,
            step_rad,
            machine_per_body: 1.0 / (1.0 - setting.motion.slip),
            removed: 1.0 / (1.0 + setting.compliance_ratio),
            frame: still,
            count: 0,
            node: 0,
            first_rad: 0.0,
            before: [[0.0; 2]; 3],
            body_rad: 0.0,
            highest_mm: largest,
            stale: false,
            ended: false,
            unmet_mm: 0.0,
        };
        stepper.start()?;
        Ok(stepper)
    }

    /// Locates the ring at rest and finds the first node that comes to the tool.
    fn start(&mut self) -> Result<(), Stuck> {
        let mean = self.nodes.values().iter().sum::<f64>() / self.nodes.len() as f64;
        let (a, b) = self.machine.supports(0.0);
        let half = 0.5 * norm(sub(b, a));
        let height = ((mean + self.setting.roller_radius_mm).powi(2) - half * half).max(0.0).sqrt();
        let middle = [0.5 * (a[0] + b[0]), 0.5 * (a[1] + b[1])];
        let along = unit(sub(b, a));
        let mut c = [middle[0] - along[1] * height, middle[1] + along[0] * height];
        let mut left = f64::INFINITY;
        for _ in 0..MOST_ITERATIONS {
            let (va, vb) = (sub(a, c), sub(b, c));
            let (ea, eb) = (self.at_angle(angle(va)), self.at_angle(angle(vb)));
            // The slope is left out: the ring stands still, and |r'|/r is small.
            let step = solve(scaled(va, -1.0), scaled(vb, -1.0), half_gap(va, ea), half_gap(vb, eb));
            c = sub(c, step);
            left = norm(step);
            if left < 1e-12 * mean {
                break;
            }
        }
        // Waves too steep for that; or what is no number.
        if left.is_nan() || left > 1e-9 * mean {
            let upright = [middle[0] - along[1] * height, middle[1] + along[0] * height];
            c = self.rest_slowly(a, b, upright)?;
        }
        self.before = [c; 3];
        let tip_rad = angle(sub(self.machine.tip(0.0), c)).rem_euclid(TAU);
        let (node, first) = node_below(tip_rad, self.step_rad, self.nodes.len());
        (self.node, self.first_rad) = (node, first);
        self.frame.tip_rad = tip_rad;
        self.body_rad = tip_rad - first - self.step_rad;
        Ok(())
    }

    /// The located centre before the first step.
    pub(super) fn centre_mm(&self) -> Vec2 {
        self.before[0]
    }

    /// Roller-centre distance, or radius, at a body angle.
    pub(super) fn at_angle(&mut self, body_rad: f64) -> f64 {
        let n = self.nodes.len();
        let place = Place::of(wrapped(body_rad * self.per_step, n as f64), n);
        match &mut self.envelope {
            None => self.nodes.cubic(place).0,
            Some(envelope) => envelope.cubic(&self.nodes, place, 1, 1).0,
        }
    }

    /// Fixes the directions anew at the present place.
    fn refresh(&mut self) {
        let turned_rad = self.body_rad.max(0.0) * self.machine_per_body;
        let (a, b) = self.machine.supports(turned_rad);
        let c = self.before[0];
        let (va, vb, vt) = (sub(a, c), sub(b, c), sub(self.machine.tip(turned_rad), c));
        let (a, b, tip) = (unit(va), unit(vb), unit(vt));
        let near = angle(vt);
        let turns = ((self.frame.tip_rad - near) / TAU).round();
        let (to_a, to_b) = (cross(tip, a).atan2(dot(tip, a)), cross(tip, b).atan2(dot(tip, b)));
        let reach = self.envelope.as_ref().map_or(0, Envelope::half) as f64 + CLEAR;
        let nearest = to_a.abs().min(to_b.abs()) * self.per_step;
        self.stale = false;
        self.frame = Frame {
            a,
            b,
            tip,
            to_a_rad: to_a,
            to_b_rad: to_b,
            tip_rad: near + turns * TAU,
            per_a2: 1.0 / dot(va, va),
            per_b2: 1.0 / dot(vb, vb),
            per_tip2: 1.0 / dot(vt, vt),
            wide: nearest > reach && self.setting.wheel_radius_mm.is_none(),
        };
    }

    /// Runs to the end; `after` may end the run before.
    pub(super) fn run<E: From<Stuck>>(mut self, after: &mut After<'_, E>) -> Result<Turned, E> {
        let n = self.nodes.len();
        let mut log = Log::new(self.setting, n);
        while !self.ended {
            self.refresh();
            if let Some(envelope) = &mut self.envelope {
                envelope.fit(&self.nodes);
            }
            self.highest_mm = self.nodes.range().1;
            let (mut left, mut next_look) = (n, n.saturating_sub(STEPS_PER_LOOK));
            while left > 0 && !self.ended {
                if self.stale {
                    self.refresh();
                }
                if left < next_look {
                    next_look = next_look.saturating_sub(STEPS_PER_LOOK);
                    after(None, self.nodes.values())?;
                }
                left -= if left >= LANES && self.frame.wide {
                    self.block::<LANES>(&mut log)?
                } else {
                    self.block::<1>(&mut log)?
                };
            }
            if let Some(revolution) = log.revolution() {
                after(Some(&revolution), self.nodes.values())?;
            }
        }
        Ok(log.turned(self.nodes.values().to_vec(), self.unmet_mm))
    }

    /// Takes up to `L` steps; how many.
    fn block<const L: usize>(&mut self, log: &mut Log) -> Result<usize, Stuck> {
        if let Some(solved) = self.solve::<L>() {
            return Ok(self.advance(&solved, log));
        }
        let solved = self.slowly()?;
        Ok(self.advance(&solved, log))
    }

    fn advance<const L: usize>(&mut self, solved: &Solved<L>, log: &mut Log) -> usize {
        for lane in 0..L {
            let turned_rad = solved.body_rad[lane] * self.machine_per_body;
            if turned_rad > log.end_rad {
                self.ended = true;
                break;
            }
            let centre = solved.centre[lane];
            self.cut(centre, turned_rad, log);
            self.node = if self.node == 0 { self.nodes.len() - 1 } else { self.node - 1 };
            self.count += 1;
        }
        self.before = [solved.centre[L - 1], self.before[0], self.before[1]];
        self.body_rad = solved.body_rad[L - 1];
        L
    }

    /// Removes what the tip finds at the present node: r <- r - max(0, r - ρ_T)/(1+K).
    #[inline]
    fn cut(&mut self, centre: Vec2, turned_rad: f64, log: &mut Log) {
        let tip_mm = norm(sub(self.machine.tip(turned_rad), centre));
        let old = self.nodes.get(self.node);
        let depth = old - tip_mm;
        log.step(depth, turned_rad, centre);
        if depth > 0.0 {
            let new = old - depth * self.removed;
            self.nodes.set(self.node, new);
            if let Some(envelope) = &mut self.envelope {
                envelope.heard_of(new, &self.nodes);
            }
        }
        if let Some(wheel_mm) = self.setting.wheel_radius_mm {
            self.grind(tip_mm, wheel_mm);
        }
    }

    /// The sides of a wheel or cutter: every angle ψ down to ρ + ½ρ(1+ρ/r_w)ψ² (`ring/3.5`).
    fn grind(&mut self, tip_mm: f64, wheel_mm: f64) {
        let n = self.nodes.len();
        let curvature = tip_mm * (1.0 + tip_mm / wheel_mm);
        for j in 1..n / 8 {
            let psi = j as f64 * self.step_rad;
            let reach = tip_mm + 0.5 * curvature * psi * psi;
            if reach > self.highest_mm {
                break;
            }
            for node in [(self.node + j) % n, (self.node + n - j) % n] {
                if self.nodes.get(node) > reach {
                    self.nodes.set(node, reach);
                }
            }
        }
    }

    /// Centre and rotation of the next steps.
    fn solve<const L: usize>(&mut self) -> Option<Solved<L>> {
        let n = self.nodes.len();
        let whole = n as f64;
        let frame = self.frame;
        let mut centre = [[0.0; 2]; L];
        let mut body_rad = [0.0; L];
        let mut node = [0.0; L];
        let [newest, middle, oldest] = self.before;
        for l in 0..L {
            // Parabola through the last three blocks.
            let ahead = (l + 1) as f64 / L as f64;
            let bend = 0.5 * ahead * (ahead + 1.0);
            for i in 0..2 {
                let (first, second) = (newest[i] - middle[i], newest[i] - 2.0 * middle[i] + oldest[i]);
                centre[l][i] = newest[i] + ahead * first + bend * second;
            }
            body_rad[l] = self.body_rad + (l + 1) as f64 * self.step_rad;
            node[l] = if l > self.node { (self.node + n - l) as f64 } else { (self.node - l) as f64 };
        }
        let mut places = [[Place { node: 0, share: 0.0 }; 2]; L];
        let mut arms = [[[0.0; 2]; 3]; L];
        for _ in 0..MOST_ITERATIONS {
            let mut far = 0.0_f64;
            for l in 0..L {
                let turned_rad = body_rad[l] * self.machine_per_body;
                let (a, b) = self.machine.supports(turned_rad);
                let (va, vb) = (sub(a, centre[l]), sub(b, centre[l]));
                let vt = sub(self.machine.tip(turned_rad), centre[l]);
                let xa = cross(frame.a, va) / dot(frame.a, va);
                let xb = cross(frame.b, vb) / dot(frame.b, vb);
                let xt = cross(frame.tip, vt) / dot(frame.tip, vt);
                far = far.max(xa.abs()).max(xb.abs()).max(xt.abs());
                let tip = arctangent(xt);
                let at = |to: f64, x: f64| wrapped_once(node[l] + (to + arctangent(x) - tip) * self.per_step, whole);
                places[l] = [Place::of(at(frame.to_a_rad, xa), n), Place::of(at(frame.to_b_rad, xb), n)];
                body_rad[l] = frame.tip_rad + tip - self.first_rad + self.step_rad * (self.count + l as u64) as f64;
                arms[l] = [va, vb, vt];
            }
            let mut left = 0.0;
            for l in 0..L {
                let [va, vb, vt] = arms[l];
                let ((ea, slope_a), (eb, slope_b)) = self.read(places[l], l);
                let tip = scaled(turned(vt), frame.per_tip2);
                let row = |v: Vec2, e: f64, slope: f64, per2: f64| {
                    let by = e * slope * self.per_step;
                    let side = sub(scaled(turned(v), per2), tip);
                    [by * side[0] - v[0], by * side[1] - v[1]]
                };
                let step = solve(
                    row(va, ea, slope_a, frame.per_a2),
                    row(vb, eb, slope_b, frame.per_b2),
                    half_gap(va, ea),
                    half_gap(vb, eb),
                );
                centre[l] = sub(centre[l], step);
                body_rad[l] += dot(turned(vt), step) * frame.per_tip2;
                // Not `max`, which would hide a not-a-number.
                let size = step[0].abs() + step[1].abs();
                left = if size <= left { left } else { size };
            }
            if left < LAST_STEP_MM {
                self.stale = far > FAR;
                return Some(Solved { centre, body_rad });
            }
            if left.is_nan() {
                break;
            }
        }
        None
    }

    /// Distance of the contact and its slope per node, for one support and lane.
    #[inline]
    pub(super) fn read(&mut self, places: [Place; 2], lane: usize) -> ((f64, f64), (f64, f64)) {
        let Some(envelope) = &mut self.envelope else {
            return (self.nodes.cubic(places[0]), self.nodes.cubic(places[1]));
        };
        // The start has stamped with 1.
        let now = self.count + lane as u64 + 2;
        let since = if self.frame.wide { now.saturating_sub(FRESH_STEPS).max(1) } else { now };
        let a = envelope.cubic(&self.nodes, places[0], now, since);
        (a, envelope.cubic(&self.nodes, places[1], now, since))
    }
}

/// ½(|v|² - e²), mm².
#[inline]
pub(super) fn half_gap(v: Vec2, e: f64) -> f64 {
    0.5 * (dot(v, v) - e * e)
}

/// Solves two linear equations by their rows.
#[inline]
pub(super) fn solve(a: Vec2, b: Vec2, fa: f64, fb: f64) -> Vec2 {
    let per_determinant = 1.0 / cross(a, b);
    [(fa * b[1] - fb * a[1]) * per_determinant, (fb * a[0] - fa * b[0]) * per_determinant]
}

/// Brought from less than one period outside into 0..period.
#[inline]
fn wrapped_once(x: f64, period: f64) -> f64 {
    let up = if x < 0.0 { x + period } else { x };
    if up >= period { up - period } else { up }
}

pub(super) fn wrapped(x: f64, period: f64) -> f64 {
    wrapped_once(x.rem_euclid(period), period)
}

/// The node at or just before an angle of 0..2π in the sense of rotation, and its angle; one exactly there counts.
#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 <= angle/step <= n")]
fn node_below(angle_rad: f64, step_rad: f64, n: usize) -> (usize, f64) {
    let k = (angle_rad / step_rad + 1e-9).floor().max(0.0) as usize;
    (k % n, k as f64 * step_rad)
}
