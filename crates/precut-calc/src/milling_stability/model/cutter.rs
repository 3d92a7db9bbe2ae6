//! The cutter in its cut: teeth with their own pitch, helix and run-out, and the force of an edge.

use std::f64::consts::TAU;
use std::sync::Arc;

/// A vector in the axes of the cut: x along the feed, y across it, z along the spindle.
pub type Vector = [f64; 3];
/// A matrix in the same axes, row by row.
pub type Tensor = [[f64; 3]; 3];

/// One tooth.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Tooth {
    /// Angle from this tooth to the tooth before it, at the tip, rad.
    pub pitch_rad: f64,
    /// tan(helix)/R: how far the edge lags per mm of height, rad/mm.
    pub lag_rad_per_mm: f64,
    /// How far it stands out, mm.
    pub radial_mm: f64,
    /// How far it stands down, mm.
    pub axial_mm: f64,
}

/// Force per mm of edge over the thickness of the chip (`milling/2.3`), tangential, radial, axial.
#[derive(Debug, Clone, Copy, PartialEq)]
pub enum Law {
    /// An edge force, N/mm, and one that grows with the chip, N/mm2.
    Mechanistic {
        /// At no chip, N/mm.
        edge: Vector,
        /// Per mm of chip, N/mm2.
        cutting: Vector,
    },
    /// A power of the chip, below the floor a straight line.
    Power {
        /// At 1 mm of chip, N/mm2.
        at_1_mm: Vector,
        /// How much less than in proportion it grows.
        exponent: Vector,
        /// The floor, mm.
        floor_mm: f64,
    },
}

impl Law {
    /// Whether the slope changes with the chip.
    pub fn bends(&self) -> bool {
        matches!(self, Self::Power { exponent, .. } if exponent.iter().any(|e| *e > 0.0))
    }

    /// Times a factor for each component.
    pub fn scale(&mut self, factor: Vector) {
        let times = |of: &mut Vector| of.iter_mut().zip(factor).for_each(|(part, factor)| *part *= factor);
        match self {
            Self::Mechanistic { edge, cutting } => [edge, cutting].into_iter().for_each(times),
            Self::Power { at_1_mm, .. } => times(at_1_mm),
        }
    }

    /// Force per mm of edge, N/mm.
    pub fn force(&self, chip_mm: f64) -> Vector {
        match self {
            Self::Mechanistic { edge, cutting } => std::array::from_fn(|q| edge[q] + cutting[q] * chip_mm),
            Self::Power { at_1_mm, exponent, floor_mm } => std::array::from_fn(|q| {
                if chip_mm >= *floor_mm {
                    at_1_mm[q] * chip_mm.powf(1.0 - exponent[q])
                } else {
                    at_1_mm[q] * floor_mm.powf(-exponent[q]) * chip_mm
                }
            }),
        }
    }

    /// Its slope over the chip, N/mm2 (`milling/2.5`).
    pub fn slope(&self, chip_mm: f64) -> Vector {
        match self {
            Self::Mechanistic { cutting, .. } => *cutting,
            Self::Power { at_1_mm, exponent, floor_mm } => std::array::from_fn(|q| {
                if chip_mm >= *floor_mm {
                    (1.0 - exponent[q]) * at_1_mm[q] * chip_mm.powf(-exponent[q])
                } else {
                    at_1_mm[q] * floor_mm.powf(-exponent[q])
                }
            }),
        }
    }
}

/// Rubbing of the flank in the wave that it left (`milling/2.8`).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rubbing {
    /// K_w, N/mm.
    pub coefficient_n_per_mm: f64,
    /// Tangential over radial.
    pub friction: f64,
}

/// What chips, and the surfaces that they meet, are taken about (`milling/2.2`).
#[derive(Debug, Clone, PartialEq, Default)]
pub enum About {
    /// Undisturbed chips.
    #[default]
    SmoothChips,
    /// Where teeth stand out the motion that the chips force, which has to be found first: without run-out each meets the surface of the
    /// tooth before it, but for the shallowest chips.
    ForcedMotion,
    /// This motion.
    Known(Turn),
}

/// A motion of the tool against the work that repeats itself from turn to turn: at even rotations, mm.
#[derive(Debug, Clone, PartialEq)]
pub struct Turn(Arc<[Vector]>);

impl Turn {
    /// At even rotations from that on at which the first tooth stands at +y; four at least.
    pub fn new(at: Vec<Vector>) -> Self {
        Self(at.into())
    }

    /// How many rotations.
    pub fn count(&self) -> usize {
        self.0.len()
    }

    /// At a rotation, by the cubic through the nearest four.
    pub fn at(&self, rotation_rad: f64) -> Vector {
        let count = self.0.len();
        let place = (rotation_rad / TAU).rem_euclid(1.0) * count as f64;
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // below the count
        let k = (place.floor() as usize).min(count - 1);
        let c = place - place.floor();
        let weights = [
            -c * (c - 1.0) * (c - 2.0) / 6.0,
            (c + 1.0) * (c - 1.0) * (c - 2.0) / 2.0,
            -(c + 1.0) * c * (c - 2.0) / 2.0,
            (c + 1.0) * c * (c - 1.0) / 6.0,
        ];
        let mut sum = [0.0; 3];
        for (i, weight) in weights.iter().enumerate() {
            for (sum, value) in sum.iter_mut().zip(&self.0[(k + count + i - 1) % count]) {
                *sum += weight * value;
            }
        }
        sum
    }
}

/// Cutter, engagement and law.
#[derive(Debug, Clone, PartialEq)]
pub struct Milling {
    /// Radius over the tips, mm.
    pub radius_mm: f64,
    /// In the order in which they pass.
    pub teeth: Vec<Tooth>,
    /// kappa, rad.
    pub edge_angle_rad: f64,
    /// Where a tooth enters, rad from +y.
    pub entry_rad: f64,
    /// Where it leaves.
    pub exit_rad: f64,
    /// Mean feed per tooth, mm.
    pub feed_mm: f64,
    /// Force of an edge.
    pub law: Law,
    /// mu: the force goes with the power 1-mu of the depth.
    pub depth_exponent: f64,
    /// Process damping, where there is some.
    pub rubbing: Option<Rubbing>,
    /// What the chips are taken about.
    pub about: About,
}

impl Milling {
    /// Sum of the pitches of teeth 1..j: how far tooth j is behind tooth 0 at the tip.
    pub fn behind_rad(&self, tooth: usize) -> f64 {
        self.teeth[1..=tooth].iter().map(|t| t.pitch_rad).sum()
    }

    /// The tooth that passed l teeth before.
    pub fn before(&self, tooth: usize, l: usize) -> usize {
        (tooth + self.teeth.len() - l % self.teeth.len()) % self.teeth.len()
    }

    /// Rotation from the passage of the tooth l before to that of this one, at a height (`milling/2.7`).
    pub fn turned_rad(&self, tooth: usize, l: usize, height_mm: f64) -> f64 {
        let pitches: f64 = (0..l).map(|k| self.teeth[self.before(tooth, k)].pitch_rad).sum();
        let lags = self.teeth[tooth].lag_rad_per_mm - self.teeth[self.before(tooth, l)].lag_rad_per_mm;
        pitches + lags * height_mm
    }

    /// Of the chip against the tooth l before: what goes with sin phi, and what is always there (`milling/2.2`), mm.
    pub fn chip_parts(&self, tooth: usize, l: usize, height_mm: f64) -> (f64, f64) {
        let (sin, cos) = self.edge_angle_rad.sin_cos();
        let (own, other) = (self.teeth[tooth], self.teeth[self.before(tooth, l)]);
        let feed_per_turn = self.feed_mm * self.teeth.len() as f64;
        let fed = feed_per_turn * self.turned_rad(tooth, l, height_mm) / TAU * sin;
        (fed, (own.radial_mm - other.radial_mm) * sin + (own.axial_mm - other.axial_mm) * cos)
    }

    /// The chip of a tooth at an angle and a height, and whose surface it meets; `None` where it does not cut.
    pub fn chip(&self, tooth: usize, angle_rad: f64, height_mm: f64) -> Option<(f64, usize)> {
        let sin = angle_rad.sin();
        let moved = self.motion(tooth, angle_rad, height_mm);
        let against = |l: usize| {
            let (fed, offset) = self.chip_parts(tooth, l, height_mm);
            (fed * sin + offset + moved.as_ref().map_or(0.0, |moved| moved.thicker_mm(self, tooth, l, height_mm)), l)
        };
        let last = if self.meets_any() { self.teeth.len() } else { 1 };
        (1..=last).map(against).min_by(|a, b| a.0.total_cmp(&b.0)).filter(|(chip, _)| *chip > 0.0)
    }

    /// By how much the motion that the chips are taken about makes that against the tooth l before thicker, mm.
    pub fn thicker_mm(&self, tooth: usize, l: usize, angle_rad: f64, height_mm: f64) -> f64 {
        self.motion(tooth, angle_rad, height_mm).map_or(0.0, |moved| moved.thicker_mm(self, tooth, l, height_mm))
    }

    /// The motion that is known, as an edge meets it.
    fn motion(&self, tooth: usize, angle_rad: f64, height_mm: f64) -> Option<Met<'_>> {
        let About::Known(turn) = &self.about else { return None };
        let rotation_rad = angle_rad + self.behind_rad(tooth) + self.teeth[tooth].lag_rad_per_mm * height_mm;
        let normal = self.normal(angle_rad);
        Some(Met { turn, rotation_rad, now_mm: along(&normal, &turn.at(rotation_rad)), normal })
    }

    /// Whether a tooth may meet the surface of any other.
    pub fn meets_any(&self) -> bool {
        self.has_run_out() || matches!(self.about, About::Known(_))
    }

    /// Whether any tooth stands out.
    pub fn has_run_out(&self) -> bool {
        let first = self.teeth[0];
        let differs =
            |t: &Tooth| (t.radial_mm - first.radial_mm).abs() > 0.0 || (t.axial_mm - first.axial_mm).abs() > 0.0;
        self.teeth.iter().any(differs)
    }

    /// How much more the chips of one tooth are than those of another at most, by their offsets, mm.
    pub fn run_out_mm(&self) -> f64 {
        let (sin, cos) = self.edge_angle_rad.sin_cos();
        let out = self.teeth.iter().map(|tooth| tooth.radial_mm * sin + tooth.axial_mm * cos);
        out.clone().fold(f64::NEG_INFINITY, f64::max) - out.fold(f64::INFINITY, f64::min)
    }

    /// Whether all edges lag alike.
    pub fn has_one_helix(&self) -> bool {
        self.teeth.iter().all(|t| (t.lag_rad_per_mm - self.teeth[0].lag_rad_per_mm).abs() < 1e-15)
    }

    /// Whether a tooth pitch is a period of the cut.
    pub fn teeth_are_alike(&self) -> bool {
        let pitch = TAU / self.teeth.len() as f64;
        let even = self.teeth.iter().all(|t| (t.pitch_rad - pitch).abs() < 1e-12);
        even && !self.has_run_out() && self.has_one_helix()
    }

    /// Rotation in a period of the cut, rad.
    pub fn period_rad(&self) -> f64 {
        if self.teeth_are_alike() { TAU / self.teeth.len() as f64 } else { TAU }
    }

    /// What the force of a mm of edge is multiplied with where it goes with a power of the depth.
    pub fn depth_factor(&self, depth_mm: f64) -> f64 {
        if self.depth_exponent > 0.0 && depth_mm > 0.0 { depth_mm.powf(-self.depth_exponent) } else { 1.0 }
    }

    /// Normal of the edge toward the work.
    pub fn normal(&self, angle_rad: f64) -> Vector {
        normal(angle_rad.sin_cos(), self.edge_angle_rad.sin_cos())
    }

    /// T q/sin kappa: the force on the tool per mm of height by a force per mm of edge (`milling/2.4`).
    pub fn on_tool(&self, angle_rad: f64, per_edge: &Vector) -> Vector {
        on_tool(angle_rad.sin_cos(), self.edge_angle_rad.sin_cos(), per_edge)
    }

    /// D: slope of that force over the motion of the tool against the work, N/mm per mm of height (`milling/2.5`).
    pub fn stiffness(&self, angle_rad: f64, slope: &Vector) -> Tensor {
        // At every instant of every map: sine and cosine once.
        let (turned, edge) = (angle_rad.sin_cos(), self.edge_angle_rad.sin_cos());
        let (force, normal) = (on_tool(turned, edge, slope), normal(turned, edge));
        force.map(|f| normal.map(|n| f * n))
    }

    /// An antiderivative of [`Self::stiffness`] over the angle at one slope.
    pub fn stiffness_integral(&self, angle_rad: f64, slope: &Vector) -> Tensor {
        let ((s, c), (sin, cos)) = (angle_rad.sin_cos(), self.edge_angle_rad.sin_cos());
        let [t, r, a] = slope.map(|q| q / sin);
        let inward = r * sin + a * cos;
        let lifting = r * cos - a * sin;
        // Integrals of s^2, c^2, s c, s, c.
        let (ss, cc, sc) = (0.5 * (angle_rad - s * c), 0.5 * (angle_rad + s * c), 0.5 * s * s);
        let (is, ic) = (-c, s);
        [
            [sin * (-t * sc - inward * ss), sin * (-t * cc - inward * sc), -cos * (-t * ic - inward * is)],
            [sin * (t * ss - inward * sc), sin * (t * sc - inward * cc), -cos * (t * is - inward * ic)],
            [sin * lifting * is, sin * lifting * ic, -cos * lifting * angle_rad],
        ]
    }
}

/// A known motion where an edge stands at a rotation.
struct Met<'a> {
    turn: &'a Turn,
    rotation_rad: f64,
    normal: Vector,
    /// Along the normal, mm.
    now_mm: f64,
}

impl Met<'_> {
    fn thicker_mm(&self, milling: &Milling, tooth: usize, l: usize, height_mm: f64) -> f64 {
        self.now_mm - along(&self.normal, &self.turn.at(self.rotation_rad - milling.turned_rad(tooth, l, height_mm)))
    }
}

fn along(normal: &Vector, motion: &Vector) -> f64 {
    normal.iter().zip(motion).map(|(n, r)| n * r).sum()
}

/// Normal of an edge from the sines and cosines of its angle and of kappa.
fn normal((s, c): (f64, f64), (sin, cos): (f64, f64)) -> Vector {
    [sin * s, sin * c, -cos]
}

/// T q/sin kappa from the same.
fn on_tool((s, c): (f64, f64), (sin, cos): (f64, f64), per_edge: &Vector) -> Vector {
    let [t, r, a] = per_edge.map(|q| q / sin);
    let inward = r * sin + a * cos;
    [-t * c - inward * s, t * s - inward * c, r * cos - a * sin]
}
