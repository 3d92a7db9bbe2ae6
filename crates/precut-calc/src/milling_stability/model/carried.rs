//! What the fixture carries of the force on the work over a period (`milling/6.21`): the force of undisturbed chips, and where the
//! work yields that of its springs and dampers in the forced motion.

use nalgebra::{Matrix3, Vector3};

use crate::calculator::{Failure, Monitor, Pace};

use super::cutter::Vector;
use super::edge::Edges;
use super::forced::{Forced, highest};
use super::map::Cut;
use super::structure::{Side, Structure};

/// Instants of a period, and of an oscillation of the fastest mode of the work.
const INSTANTS: f64 = 96.0;
const PER_OSCILLATION: f64 = 16.0;
/// Instants of a period at most, and at least where fewer are wanted.
const MOST: f64 = 4000.0;
const FEWEST: f64 = 32.0;
/// Local maxima as high as this share of the highest are looked at closely.
const HIGH: f64 = 0.98;
/// A direction in which the work is so much stiffer than in its softest one does not yield.
const STIFF: f64 = 1e-9;

/// The force on the tool that the fixture has to balance, in the axes of the cut.
#[derive(Debug)]
pub struct Carried<'a> {
    edges: Edges<'a>,
    cut: &'a Cut<'a>,
    /// The forced motion with what makes a force of what the springs of the work are pressed, and the directions in which it yields.
    moving: Option<(&'a Forced<'a>, Matrix3<f64>, Matrix3<f64>)>,
}

/// The force at a rotation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Instant {
    /// Rotation since the first tooth stood at +y, rad.
    pub rotation_rad: f64,
    /// On the tool, N.
    pub force_n: Vector,
}

/// How many instants are looked at.
#[derive(Debug, Clone, Copy)]
pub struct Sampling {
    /// No more than these, if that is not too few to tell a period.
    pub most: f64,
    /// Multiplications that one takes beside the force itself.
    pub work: usize,
}

/// C+ and C C+ of the static compliance C of the work; `None` where it does not yield.
fn held(structure: &Structure) -> Option<(Matrix3<f64>, Matrix3<f64>)> {
    let mut compliance = Matrix3::zeros();
    for mode in structure.modes.iter().filter(|mode| mode.side == Side::Work) {
        let d = Vector3::from(mode.direction);
        compliance += d * d.transpose() / mode.stiffness_n_per_mm();
    }
    let softest = compliance.trace();
    if softest <= 0.0 {
        return None;
    }
    let stiffness = compliance.pseudo_inverse(STIFF * softest).ok()?;
    Some((stiffness, compliance * stiffness))
}

impl<'a> Carried<'a> {
    /// With a forced motion the fixture carries what its springs and dampers do; without one, the force itself.
    pub fn new(cut: &'a Cut<'a>, forced: Option<&'a Forced<'a>>) -> Self {
        let edges = Edges::new(cut.milling, cut.depth_mm);
        let moving =
            forced.zip(held(cut.structure)).map(|(forced, (stiffness, yielding))| (forced, stiffness, yielding));
        Self { edges, cut, moving }
    }

    /// The force on the tool, N.
    pub fn at(&self, rotation_rad: f64) -> Vector {
        let (force, _) = self.edges.force(rotation_rad);
        let Some((forced, stiffness, yielding)) = &self.moving else { return force };
        let force = Vector3::from(force);
        let pressed = Vector3::from(forced.pressed(self.cut.rotation.time_s(rotation_rad)));
        (force - yielding * force + stiffness * pressed).into()
    }

    /// The part of a force in the directions in which the work yields, N; `None` where it does not.
    pub fn yielding_n(&self, force_n: &Vector) -> Option<f64> {
        let (.., yielding) = self.moving.as_ref()?;
        Some((yielding * Vector3::from(*force_n)).norm())
    }

    /// Smooth stretches of a period.
    fn stretches(&self) -> Vec<[f64; 2]> {
        let period = self.cut.milling.period_rad();
        let mut ends = self.edges.rotations();
        ends.extend([0.0, period]);
        ends.sort_by(f64::total_cmp);
        ends.dedup_by(|a, b| (*a - *b).abs() < 1e-10);
        // A hair inside: the ends are one-sided limits.
        ends.windows(2)
            .map(|pair| [pair[0] + 1e-9 * (pair[1] - pair[0]), pair[1] - 1e-9 * (pair[1] - pair[0])])
            .collect()
    }

    /// Instants that tell a period, those at which something of the force is largest between two others among them.
    pub fn instants(
        &self,
        of: impl Fn(&Vector) -> f64,
        sampling: Sampling,
        monitor: &dyn Monitor,
    ) -> Result<Vec<Instant>, Failure> {
        let mut pace = Pace::new(monitor);
        let period = self.cut.milling.period_rad();
        let at = |rotation_rad: f64| Instant { rotation_rad, force_n: self.at(rotation_rad) };
        let fastest = self.moving.as_ref().map_or(0.0, |_| self.fastest_in_period());
        let wanted = (PER_OSCILLATION * fastest).clamp(INSTANTS, MOST).min(sampling.most.max(FEWEST));
        let work = self.edges.work() + sampling.work;
        let mut found: Vec<Vec<(f64, Instant)>> = Vec::new();
        for [from, to] in self.stretches() {
            let steps = (wanted * (to - from) / period).ceil().max(2.0);
            #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // some thousands at most
            let steps = steps as u32;
            let mut stretch = Vec::new();
            for step in 0..=steps {
                pace.work(work)?;
                let instant = at(from + (to - from) * f64::from(step) / f64::from(steps));
                stretch.push((of(&instant.force_n), instant));
            }
            found.push(stretch);
        }
        let top = found.iter().flatten().map(|(value, _)| *value).fold(f64::NEG_INFINITY, f64::max);
        let mut all = Vec::new();
        for stretch in found {
            let (values, stretch): (Vec<f64>, Vec<Instant>) = stretch.into_iter().unzip();
            for (k, instant) in stretch.iter().enumerate() {
                all.push(*instant);
                let (before, after) = (k.saturating_sub(1), (k + 1).min(stretch.len() - 1));
                let is_peak = values[k] >= values[before] && values[k] >= values[after] && values[k] > 0.0;
                if is_peak && values[k] >= HIGH * top {
                    pace.work(100 * work)?;
                    let (from, to) = (stretch[before].rotation_rad, stretch[after].rotation_rad);
                    all.push(at(highest(from, to, |rotation_rad| of(&self.at(rotation_rad)))));
                }
            }
        }
        all.sort_by(|a, b| a.rotation_rad.total_cmp(&b.rotation_rad));
        Ok(all)
    }

    /// Oscillations of the fastest mode of the work in a period.
    fn fastest_in_period(&self) -> f64 {
        let work = self.cut.structure.modes.iter().filter(|mode| mode.side == Side::Work);
        let fastest_hz = work.map(|mode| mode.frequency_hz).fold(0.0, f64::max);
        fastest_hz * self.cut.rotation.period_s(self.cut.milling.period_rad())
    }
}
