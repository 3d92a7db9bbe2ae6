//! What an edge does over its height: pieces between the angles at which the form of the chip changes.

use std::f64::consts::{PI, TAU};

use crate::num::quadrature::gauss_legendre;

use super::cutter::{About, Law, Milling, Rubbing, Tensor, Vector};

/// From one break to the next the chip grows by so much at most where its power is to be a polynomial.
const GROWTH: f64 = 2.0;
/// Gauss points of a piece by its angle, rad.
const POINTS: [(f64, usize); 3] = [(0.4, 6), (1.2, 10), (f64::INFINITY, 16)];

/// The cutting stiffness against one earlier passage.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Entry {
    /// Rotation since that passage, rad.
    pub turned_rad: f64,
    /// N/mm.
    pub stiffness: Tensor,
}

/// Sums over all edges at one instant.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Engagement {
    /// By rotation since the passage whose surface is met.
    pub entries: Vec<Entry>,
    /// Process damping times the cutting speed, N/mm s mm/s.
    pub rubbing: Tensor,
}

/// Samples of a motion between two angles at which the form of a chip is compared; a break is found to so much.
const SAMPLES_A_STEP: f64 = 4.0;
const BESIDE_RAD: f64 = 1e-11;

/// A stretch of an edge on which one surface is met.
struct Piece {
    from_rad: f64,
    to_rad: f64,
    l: usize,
}

/// Quadrature of edges, made once.
#[derive(Debug, Clone)]
pub struct Edges<'a> {
    milling: &'a Milling,
    depth_mm: f64,
    /// Per tooth, rising, entry first and exit last.
    breaks: Vec<Vec<f64>>,
    rules: Vec<(Vec<f64>, Vec<f64>)>,
    one_helix: bool,
    behind: Vec<f64>,
}

impl<'a> Edges<'a> {
    /// For a depth.
    pub fn new(milling: &'a Milling, depth_mm: f64) -> Self {
        let teeth = 0..milling.teeth.len();
        Self {
            milling,
            depth_mm,
            breaks: teeth.clone().map(|tooth| breaks(milling, tooth, depth_mm)).collect(),
            rules: POINTS.iter().map(|(_, points)| gauss_legendre(*points)).collect(),
            one_helix: milling.has_one_helix(),
            behind: teeth.map(|tooth| milling.behind_rad(tooth)).collect(),
        }
    }

    /// Rotations in a period at which a coefficient is not smooth: either end of every edge at every break.
    pub fn rotations(&self) -> Vec<f64> {
        let period = self.milling.period_rad();
        let mut found = Vec::new();
        for (tooth, breaks) in self.breaks.iter().enumerate() {
            let lag = self.milling.teeth[tooth].lag_rad_per_mm * self.depth_mm;
            for angle in breaks {
                let tip = angle + self.behind[tooth];
                found.push(tip.rem_euclid(period));
                found.push((tip + lag).rem_euclid(period));
            }
        }
        found
    }

    /// How many multiplications an instant takes, roughly: every edge is looked at between its breaks, against all teeth where
    /// one stands out.
    pub(super) fn work(&self) -> usize {
        const PER_CHIP: usize = 40;
        let against = if self.milling.meets_any() { self.milling.teeth.len() } else { 1 };
        PER_CHIP * against * self.breaks.iter().map(Vec::len).sum::<usize>()
    }

    /// Rotations between the passages that meet each other.
    pub fn delays_rad(&self) -> Vec<f64> {
        let mut found: Vec<f64> = Vec::new();
        for (tooth, breaks) in self.breaks.iter().enumerate() {
            for pair in breaks.windows(2) {
                for height in [0.0, self.depth_mm] {
                    let Some((_, l)) = self.milling.chip(tooth, 0.5 * (pair[0] + pair[1]), height) else { continue };
                    let turned = self.milling.turned_rad(tooth, l, height);
                    if !found.iter().any(|known| (known - turned).abs() < 1e-12) {
                        found.push(turned);
                    }
                }
            }
        }
        found
    }

    fn height(&self, tooth: usize, tip_rad: f64, angle_rad: f64) -> f64 {
        let lag = self.milling.teeth[tooth].lag_rad_per_mm;
        if lag.abs() > 0.0 { (tip_rad - angle_rad) / lag } else { 0.0 }
    }

    /// Calls with every angle of the edge in cut, its height, its share of the depth in mm and the surface met.
    fn points(&self, tooth: usize, rotation_rad: f64, mut call: impl FnMut(f64, f64, f64, usize)) {
        let tip = rotation_rad - self.behind[tooth];
        let lag = self.milling.teeth[tooth].lag_rad_per_mm;
        if lag.abs() <= 0.0 {
            let angle = tip.rem_euclid(TAU);
            if angle <= self.milling.entry_rad || angle >= self.milling.exit_rad {
                return;
            }
            if self.one_helix {
                if let Some((_, l)) = self.milling.chip(tooth, angle, 0.0) {
                    call(angle, 0.0, self.depth_mm, l);
                }
                return;
            }
            let (points, weights) = &self.rules[2];
            for (c, w) in points.iter().zip(weights) {
                let height = c * self.depth_mm;
                if let Some((_, l)) = self.milling.chip(tooth, angle, height) {
                    call(angle, height, w * self.depth_mm, l);
                }
            }
            return;
        }
        self.pieces(tooth, tip, |piece, turn| {
            let span = piece.to_rad - piece.from_rad;
            let rule = POINTS.iter().position(|(most, _)| span <= *most).unwrap_or(POINTS.len() - 1);
            let (points, weights) = &self.rules[rule];
            for (c, w) in points.iter().zip(weights) {
                let angle = piece.from_rad + c * span;
                call(angle, self.height(tooth, tip - turn, angle), w * span / lag.abs(), piece.l);
            }
        });
    }

    /// Calls with every piece of a helical edge in cut, and the whole turns by which its angles are behind those of the tip.
    fn pieces(&self, tooth: usize, tip_rad: f64, mut call: impl FnMut(&Piece, f64)) {
        let breaks = &self.breaks[tooth];
        let (entry, exit) = (self.milling.entry_rad, self.milling.exit_rad);
        let top = tip_rad - self.milling.teeth[tooth].lag_rad_per_mm * self.depth_mm;
        let (low, high) = (top.min(tip_rad), top.max(tip_rad));
        let mut turn = TAU * ((low - exit) / TAU).floor();
        while entry + turn < high {
            let (from, to) = (low.max(entry + turn) - turn, high.min(exit + turn) - turn);
            for pair in breaks.windows(2) {
                let (a, b) = (pair[0].max(from), pair[1].min(to));
                if b <= a {
                    continue;
                }
                let middle = 0.5 * (a + b);
                let height = self.height(tooth, tip_rad - turn, middle);
                if let Some((_, l)) = self.milling.chip(tooth, middle, height) {
                    call(&Piece { from_rad: a, to_rad: b, l }, turn);
                }
            }
            turn += TAU;
        }
    }

    /// Cutting stiffness and process damping at a rotation (`milling/2.6`).
    pub fn at(&self, rotation_rad: f64) -> Engagement {
        let mut sums = Engagement::default();
        let factor = self.milling.depth_factor(self.depth_mm);
        let about_motion = matches!(self.milling.about, About::Known(_));
        for tooth in 0..self.milling.teeth.len() {
            let lag = self.milling.teeth[tooth].lag_rad_per_mm;
            if lag.abs() > 0.0 && self.one_helix && !self.milling.law.bends() && !about_motion {
                let slope = self.milling.law.slope(1.0);
                self.pieces(tooth, rotation_rad - self.behind[tooth], |piece, _| {
                    let over = |slope: &Vector| {
                        let [high, low] =
                            [piece.to_rad, piece.from_rad].map(|a| self.milling.stiffness_integral(a, slope));
                        combined(&high, 1.0 / lag.abs(), &low, -1.0 / lag.abs())
                    };
                    let turned = self.milling.turned_rad(tooth, piece.l, 0.0);
                    sums.add(turned, &over(&slope), factor);
                    if let Some(rubbing) = self.milling.rubbing {
                        sums.rub(&over(&pressing(rubbing)));
                    }
                });
                continue;
            }
            self.points(tooth, rotation_rad, |angle, height, share, l| {
                let Some((chip, met)) = self.milling.chip(tooth, angle, height) else { return };
                let slope = self.milling.law.slope(chip);
                // About a motion another surface may be met inside a piece.
                let l = if about_motion { met } else { l };
                let turned = self.milling.turned_rad(tooth, l, height);
                sums.add(turned, &self.milling.stiffness(angle, &slope), share * factor);
                if let Some(rubbing) = self.milling.rubbing {
                    let one = self.milling.stiffness(angle, &pressing(rubbing));
                    sums.rub(&combined(&one, share, &one, 0.0));
                }
            });
        }
        sums
    }

    /// Force on the tool, N, and torque against the spindle, N mm (`milling/2.9`).
    pub fn force(&self, rotation_rad: f64) -> (Vector, f64) {
        self.summed(rotation_rad, |chip, _| self.milling.law.force(chip))
    }

    /// The force on the tool that drives its motion, N: that of the chips, less what their slope makes of the motion that they are taken
    /// about.
    pub(super) fn driving(&self, rotation_rad: f64) -> Vector {
        let law = &self.milling.law;
        let linear = |chip: f64, thicker: f64| -> Vector {
            let (force, slope) = (law.force(chip), law.slope(chip));
            std::array::from_fn(|q| force[q] - slope[q] * thicker)
        };
        self.summed(rotation_rad, linear).0
    }

    /// Force and torque of what a chip, and how much of it is motion, makes per mm of edge.
    fn summed(&self, rotation_rad: f64, per_edge: impl Fn(f64, f64) -> Vector) -> (Vector, f64) {
        let (mut force, mut torque) = ([0.0; 3], 0.0);
        let factor = self.milling.depth_factor(self.depth_mm);
        for tooth in 0..self.milling.teeth.len() {
            self.points(tooth, rotation_rad, |angle, height, share, _| {
                let Some((chip, l)) = self.milling.chip(tooth, angle, height) else { return };
                let per_edge = per_edge(chip, self.milling.thicker_mm(tooth, l, angle, height));
                let one = self.milling.on_tool(angle, &per_edge);
                for (sum, part) in force.iter_mut().zip(one) {
                    *sum += part * share * factor;
                }
                torque += per_edge[0] / self.milling.edge_angle_rad.sin() * share * factor * self.milling.radius_mm;
            });
        }
        (force, torque)
    }
}

impl Engagement {
    fn add(&mut self, turned_rad: f64, stiffness: &Tensor, factor: f64) {
        let known = self.entries.iter_mut().find(|entry| (entry.turned_rad - turned_rad).abs() < 1e-12);
        match known {
            Some(entry) => entry.stiffness = combined(&entry.stiffness, 1.0, stiffness, factor),
            None => self.entries.push(Entry { turned_rad, stiffness: combined(stiffness, factor, stiffness, 0.0) }),
        }
    }

    fn rub(&mut self, one: &Tensor) {
        self.rubbing = combined(&self.rubbing, 1.0, one, 1.0);
    }
}

/// Force per mm of edge of a flank that is pressed in.
fn pressing(rubbing: Rubbing) -> Vector {
    [rubbing.friction * rubbing.coefficient_n_per_mm, rubbing.coefficient_n_per_mm, 0.0]
}

/// a x + b y.
pub(super) fn combined(x: &Tensor, a: f64, y: &Tensor, b: f64) -> Tensor {
    std::array::from_fn(|i| std::array::from_fn(|j| a * x[i][j] + b * y[i][j]))
}

/// Angles of a tooth at which its chip changes its form: entry, exit, another surface met, no chip, floor and its multiples. Edges in a
/// helix have those of tip and top.
fn breaks(milling: &Milling, tooth: usize, depth_mm: f64) -> Vec<f64> {
    let mut found = match &milling.about {
        About::Known(turn) => breaks_about(milling, turn.count(), tooth, depth_mm),
        About::SmoothChips | About::ForcedMotion => breaks_of_smooth_chips(milling, tooth, depth_mm),
    };
    found.extend([milling.entry_rad, milling.exit_rad]);
    found.sort_by(f64::total_cmp);
    found.dedup_by(|a, b| (*a - *b).abs() < 1e-10);
    found
}

/// About a motion: found between neighbours of angles that follow it.
fn breaks_about(milling: &Milling, samples: usize, tooth: usize, depth_mm: f64) -> Vec<f64> {
    let (entry, exit) = (milling.entry_rad, milling.exit_rad);
    // The surface met, and between which multiples of the floor the chip lies.
    let form = |angle: f64, height: f64| {
        milling.chip(tooth, angle, height).map(|(chip, l)| match milling.law {
            Law::Power { floor_mm, .. } if milling.law.bends() && floor_mm > 0.0 => {
                (l, (chip / floor_mm).max(0.5).log2().floor())
            }
            _ => (l, 0.0),
        })
    };
    let is_straight = milling.teeth[tooth].lag_rad_per_mm.abs() <= 0.0 && milling.has_one_helix();
    let heights: &[f64] = if is_straight { &[0.0] } else { &[0.0, depth_mm] };
    let step = TAU * SAMPLES_A_STEP / samples as f64;
    let mut found = Vec::new();
    for &height in heights {
        let mut from = (entry, form(entry + BESIDE_RAD, height));
        while from.0 < exit {
            let angle = (from.0 + step).min(exit);
            let to = (angle, form(angle.min(exit - BESIDE_RAD), height));
            if to.1 != from.1 {
                let (mut low, mut high) = (from.0, to.0);
                while high - low > BESIDE_RAD {
                    let middle = 0.5 * (low + high);
                    if form(middle, height) == from.1 { low = middle } else { high = middle }
                }
                found.push(0.5 * (low + high));
            }
            from = to;
        }
    }
    found
}

/// The same of undisturbed chips, in closed form.
fn breaks_of_smooth_chips(milling: &Milling, tooth: usize, depth_mm: f64) -> Vec<f64> {
    let (entry, exit) = (milling.entry_rad, milling.exit_rad);
    let mut found = Vec::new();
    let mut at_sine = |sine: f64| {
        if (0.0..=1.0).contains(&sine) {
            for angle in [sine.asin(), PI - sine.asin()] {
                if angle > entry && angle < exit {
                    found.push(angle);
                }
            }
        }
    };
    let last = if milling.has_run_out() { milling.teeth.len() } else { 1 };
    let heights: &[f64] = if milling.has_one_helix() { &[0.0] } else { &[0.0, depth_mm] };
    for &height in heights {
        for l in 1..=last {
            let (fed, offset) = milling.chip_parts(tooth, l, height);
            if last > 1 {
                at_sine(-offset / fed);
                for other in l + 1..=last {
                    let (more, further) = milling.chip_parts(tooth, other, height);
                    at_sine((offset - further) / (more - fed));
                }
            }
            if let Law::Power { floor_mm, .. } = milling.law
                && milling.law.bends()
            {
                let mut chip = if floor_mm > 0.0 { floor_mm } else { 1e-4 * fed };
                while chip < fed + offset {
                    at_sine((chip - offset) / fed);
                    chip *= GROWTH;
                }
            }
        }
    }
    found
}
