//! The first limit by measured lines themselves: modes and what they leave of the lines, over all harmonics of the cut
//! (`milling/4.13`).
//!
//! A disturbance exp(i w t) times a Fourier series of the tooth period T has, with r_q and F_q at w_q = w + 2 pi q/T,
//!
//! ```text
//!     r_q = G(w_q) F_q,   F_p = sum over q of [W_(p-q) (1 - exp(-i w T)) + i w_q C_(p-q)] r_q.
//! ```
//!
//! The determinant of that system turns, as w goes from 0 to half the tooth frequency, by -pi for every multiplier outside the unit
//! circle: it is 1 far to the right, repeats with the tooth frequency, and G has no pole there.

use std::f64::consts::{PI, TAU};

use nalgebra::{Complex, DMatrix};

use crate::calculator::{Failure, Monitor, Pace};

use super::cutter::{Tensor, Vector};
use super::map::Cut;
use super::structure::{Mode, Side, Structure, dot};
use super::zeroth::{each_instant, modal, projected};

/// Harmonics to either side at most, and how far beyond the fastest mode they reach at least.
const MOST_HARMONICS: usize = 12;
const BEYOND: f64 = 1.2;
/// Harmonics are added until the limit moves by less than half a percent; a limit is found to a tenth of that.
const SETTLED: f64 = 0.0025;
const FOUND: f64 = 5e-4;
/// Even depths that are looked at, and depths to either side of a known limit.
const DEPTHS: u32 = 12;
const BESIDE: f64 = 0.03;
/// Frequencies of a half of the tooth frequency, two to a half width of a resonance.
const LEAST: f64 = 24.0;
const MOST: f64 = 400.0;
/// Between neighbouring frequencies the determinant turns by less than this, or they are halved, so often at most.
const TURN: f64 = 0.7;
const HALVINGS: u32 = 8;
/// Longest piece of the period over which a coefficient is integrated, as a share of the period.
const PIECE: f64 = 1.0 / 12.0;

/// A measured function: motion along one direction over force along another.
#[derive(Debug, Clone, PartialEq)]
pub struct MeasuredPair {
    /// Whose.
    pub side: Side,
    /// Direction of the motion, of length 1, in the axes of the cut.
    pub response: Vector,
    /// Direction of the force.
    pub excitation: Vector,
    /// Frequency in Hz and receptance in mm/N, rising.
    pub lines: Vec<(f64, Complex<f64>)>,
}

/// What the modes leave of a function.
struct Remainder {
    /// Response and excitation in the basis of the motion.
    response: Vec<f64>,
    excitation: Vec<f64>,
    /// 1 over how often the pair was measured; half where a pair across was not measured back, which is then the same.
    share: f64,
    back: bool,
    lines: Vec<(f64, Complex<f64>)>,
}

/// A limit by measured lines.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct DirectLimit {
    /// Where a disturbance begins to grow; `None` where none does up to the depth that was looked at, mm.
    pub depth_mm: Option<f64>,
    /// Harmonics to either side.
    pub harmonics: usize,
}

/// Why there is no such limit.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum NotDirect {
    /// Teeth differ.
    Uneven,
    /// The speed varies.
    Varying,
    /// The modes reach over more harmonics than are taken.
    Slow,
}

/// A cut whose structure was measured.
pub struct Direct<'a> {
    cut: Cut<'a>,
    remainders: Vec<Remainder>,
    /// Harmonics to begin with.
    least: usize,
    tooth_rad_per_s: f64,
}

impl<'a> Direct<'a> {
    /// Of a cut and the functions that its modes were made of.
    pub fn new(cut: Cut<'a>, measured: &[MeasuredPair]) -> Result<Self, NotDirect> {
        if !cut.milling.teeth_are_alike() {
            return Err(NotDirect::Uneven);
        }
        if cut.rotation.varies() {
            return Err(NotDirect::Varying);
        }
        let tooth_rad_per_s = TAU / cut.rotation.period_s(cut.milling.period_rad());
        let reach = BEYOND * cut.structure.fastest_rad_per_s() / tooth_rad_per_s;
        let most = MOST_HARMONICS as f64;
        if reach > most {
            return Err(NotDirect::Slow);
        }
        // At most twelve.
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        let least = (reach.ceil() as usize).max(1);
        let remainders = measured.iter().map(|pair| remainder(cut.structure, pair, measured)).collect();
        Ok(Self { cut, remainders, least, tooth_rad_per_s })
    }

    /// The first limit up to a depth; `near_mm` is a limit by the modes alone, beside which is looked as well.
    pub fn limit(&self, most_mm: f64, near_mm: Option<f64>, monitor: &dyn Monitor) -> Result<DirectLimit, Failure> {
        let mut pace = Pace::new(monitor);
        let mut harmonics = self.least;
        let mut depth_mm = self.first(most_mm, near_mm, harmonics, &mut pace)?;
        while harmonics < MOST_HARMONICS {
            harmonics += 1;
            let settled = match depth_mm {
                Some(depth) => {
                    let below = self.is_unstable(depth * (1.0 - SETTLED), harmonics, &mut pace)?;
                    !below && self.is_unstable(depth * (1.0 + SETTLED), harmonics, &mut pace)?
                }
                None => !self.is_unstable(most_mm, harmonics, &mut pace)?,
            };
            if settled {
                break;
            }
            depth_mm = self.first(most_mm, depth_mm.or(near_mm), harmonics, &mut pace)?;
        }
        Ok(DirectLimit { depth_mm, harmonics })
    }

    fn first(
        &self,
        most_mm: f64,
        near_mm: Option<f64>,
        harmonics: usize,
        pace: &mut Pace<'_>,
    ) -> Result<Option<f64>, Failure> {
        let mut depths: Vec<f64> = (1..=DEPTHS).map(|k| most_mm * f64::from(k) / f64::from(DEPTHS)).collect();
        depths.extend(near_mm.iter().flat_map(|near| [near * (1.0 - BESIDE), near * (1.0 + BESIDE)]));
        depths.sort_by(f64::total_cmp);
        let mut stable = 0.0;
        for depth in depths.into_iter().filter(|depth| *depth > 0.0 && *depth <= most_mm) {
            if !self.is_unstable(depth, harmonics, pace)? {
                stable = depth;
                continue;
            }
            let mut unstable = depth;
            while unstable - stable > FOUND * unstable && unstable > FOUND * most_mm / f64::from(DEPTHS) {
                let middle = 0.5 * (stable + unstable);
                if self.is_unstable(middle, harmonics, pace)? { unstable = middle } else { stable = middle }
            }
            return Ok(Some(0.5 * (stable + unstable)));
        }
        Ok(None)
    }

    /// Whether any disturbance grows at a depth.
    fn is_unstable(&self, depth_mm: f64, harmonics: usize, pace: &mut Pace<'_>) -> Result<bool, Failure> {
        let system = System::new(self, depth_mm, harmonics);
        let half = 0.5 * self.tooth_rad_per_s;
        let narrowest = self.cut.structure.modes.iter().map(|of| of.damping_ratio * of.rad_per_s());
        let narrowest = narrowest.fold(f64::INFINITY, f64::min).max(1e-12);
        let count = (2.0 * half / narrowest).ceil().clamp(LEAST, MOST);
        let mut before = (0.0, system.angle(0.0, pace)?);
        let (mut turned, mut k) = (0.0, 1.0);
        while k <= count {
            let at = half * k / count;
            let next = (at, system.angle(at, pace)?);
            turned += system.turned(before, next, HALVINGS, pace)?;
            (before, k) = (next, k + 1.0);
        }
        Ok(-turned / PI > 0.5)
    }

    /// Receptance at an angular frequency of either sign, in the basis of the motion, mm/N.
    fn receptance(&self, rad_per_s: f64) -> DMatrix<Complex<f64>> {
        let mut found = modal(self.cut.structure, rad_per_s.abs());
        for remainder in &self.remainders {
            let value = remainder.at(rad_per_s.abs()) * remainder.share;
            for (a, response) in remainder.response.iter().enumerate() {
                for (b, excitation) in remainder.excitation.iter().enumerate() {
                    found[(a, b)] += value * (response * excitation);
                    if remainder.back {
                        found[(b, a)] += value * (response * excitation);
                    }
                }
            }
        }
        if rad_per_s < 0.0 { found.map(|value| value.conj()) } else { found }
    }
}

impl Remainder {
    /// Between its lines straight, beside them nothing.
    fn at(&self, rad_per_s: f64) -> Complex<f64> {
        let hz = rad_per_s / TAU;
        let next = self.lines.partition_point(|(line, _)| *line < hz);
        let Some(&(to, above)) = self.lines.get(next) else { return Complex::default() };
        if next == 0 {
            return if to > hz { Complex::default() } else { above };
        }
        let (from, below) = self.lines[next - 1];
        below + (above - below) * ((hz - from) / (to - from))
    }
}

fn remainder(structure: &Structure, pair: &MeasuredPair, all: &[MeasuredPair]) -> Remainder {
    let is_same = |a: &Vector, b: &Vector| dot(a, b).abs() > 0.5;
    let of_side = |other: &&MeasuredPair| other.side == pair.side;
    let is_this =
        |other: &MeasuredPair| is_same(&other.response, &pair.response) && is_same(&other.excitation, &pair.excitation);
    let is_back =
        |other: &MeasuredPair| is_same(&other.response, &pair.excitation) && is_same(&other.excitation, &pair.response);
    let count = all.iter().filter(of_side).filter(|other| is_this(other)).count();
    let modes: Vec<&Mode> = structure.modes.iter().filter(|mode| mode.side == pair.side).collect();
    let by_modes = |hz: f64| -> Complex<f64> {
        let of = |mode: &&Mode| {
            let along = dot(&mode.direction, &pair.response) * dot(&mode.direction, &pair.excitation);
            mode.receptance_at(Complex::new(0.0, TAU * hz)) * along
        };
        modes.iter().map(of).sum()
    };
    let in_basis = |of: &Vector| structure.basis.iter().map(|b| dot(b, of)).collect();
    Remainder {
        response: in_basis(&pair.response),
        excitation: in_basis(&pair.excitation),
        share: 1.0 / count.max(1) as f64,
        back: !all.iter().filter(of_side).any(is_back),
        lines: pair.lines.iter().map(|(hz, value)| (*hz, value - by_modes(*hz))).collect(),
    }
}

/// The system of one depth.
struct System<'a> {
    direct: &'a Direct<'a>,
    harmonics: usize,
    /// Coefficients of stiffness and rubbing from -(2 m + 1) to 2 m + 1.
    stiffness: Vec<DMatrix<Complex<f64>>>,
    rubbing: Option<Vec<DMatrix<Complex<f64>>>>,
}

impl<'a> System<'a> {
    fn new(direct: &'a Direct<'a>, depth_mm: f64, harmonics: usize) -> Self {
        let cut = &direct.cut;
        let (milling, structure) = (cut.milling, cut.structure);
        let d = structure.basis.len();
        let count = 2 * (2 * harmonics + 1) + 1;
        let none = || vec![DMatrix::zeros(d, d); count];
        let (mut stiffness, mut rubbing) = (none(), none());
        let period = milling.period_rad();
        let cutting_mm_per_s = milling.radius_mm * direct.tooth_rad_per_s * period / TAU;
        each_instant(milling, depth_mm, PIECE * period, |rotation, share, instant| {
            let add = |sums: &mut [DMatrix<Complex<f64>>], of: &Tensor, factor: f64| {
                let part = projected(structure, of);
                for (k, sum) in sums.iter_mut().enumerate() {
                    let order = k as f64 - (2 * harmonics + 1) as f64;
                    let turned = Complex::from_polar(share * factor, -order * TAU * rotation / period);
                    *sum += part.map(|value| turned * value);
                }
            };
            for entry in &instant.entries {
                add(&mut stiffness, &entry.stiffness, 1.0);
            }
            if milling.rubbing.is_some() {
                add(&mut rubbing, &instant.rubbing, 1.0 / cutting_mm_per_s);
            }
        });
        Self { direct, harmonics, stiffness, rubbing: milling.rubbing.map(|_| rubbing) }
    }

    /// How far the determinant turns between two frequencies, of which its angles are known.
    fn turned(&self, from: (f64, f64), to: (f64, f64), halvings: u32, pace: &mut Pace<'_>) -> Result<f64, Failure> {
        let turn = (to.1 - from.1 + PI).rem_euclid(TAU) - PI;
        if turn.abs() < TURN || halvings == 0 {
            return Ok(turn);
        }
        let at = 0.5 * (from.0 + to.0);
        let middle = (at, self.angle(at, pace)?);
        Ok(self.turned(from, middle, halvings - 1, pace)? + self.turned(middle, to, halvings - 1, pace)?)
    }

    /// Angle of the determinant at w.
    fn angle(&self, rad_per_s: f64, pace: &mut Pace<'_>) -> Result<f64, Failure> {
        let d = self.direct.cut.structure.basis.len();
        let count = 2 * self.harmonics + 2;
        let (size, middle) = (d * count, 2 * self.harmonics + 1);
        pace.work(4 * (size * size * (d + size / 3)))?;
        let tooth = self.direct.tooth_rad_per_s;
        let again = Complex::new(1.0, 0.0) - Complex::from_polar(1.0, -rad_per_s * TAU / tooth);
        let mut matrix = DMatrix::<Complex<f64>>::identity(size, size);
        for q in 0..count {
            let at = rad_per_s + tooth * (q as f64 - (self.harmonics + 1) as f64);
            let receptance = self.direct.receptance(at);
            for p in 0..count {
                let order = middle + p - q;
                let mut force = &self.stiffness[order] * again;
                if let Some(rubbing) = &self.rubbing {
                    force += &rubbing[order] * Complex::new(0.0, at);
                }
                let block = force * &receptance;
                for a in 0..d {
                    for b in 0..d {
                        matrix[(p * d + a, q * d + b)] -= block[(a, b)];
                    }
                }
            }
        }
        Ok(matrix.lu().determinant().arg())
    }
}
