//! The motion that the chips force on tool and work, and the surface that it leaves (`milling/4.20`).
//!
//! Where all teeth are alike every one repeats it and no wave is left: modes under a known force. Else what earlier teeth left acts as
//! well, and the motion is the fixed point of an affine map over a turn: linear about undisturbed chips, or about the motion itself, which
//! is found by rounds of that.

use std::f64::consts::{PI, TAU};

use crate::calculator::{Failure, Monitor, Pace};
use crate::num::dde::Rule;
use crate::num::gmres::gmres;

use super::cutter::{About, Milling, Turn, Vector};
use super::map::{Acting, Cut, Map};
use super::multiplier::POINTS;
use super::structure::Side;

/// Residual of the fixed point, and the largest that is a motion at all.
const TOLERANCE: f64 = 1e-13;
const ACCEPTED: f64 = 1e-7;
/// Applications at most.
const APPLICATIONS: usize = 400;
/// Samples of an element between two ends.
const SAMPLES: u32 = 24;
/// Rounds in which a motion is looked for about itself, what it may change at last as a share of its size, and how much of the change before
/// a round may make; the least part of a step that is gone.
const ROUNDS: usize = 16;
const SETTLED: f64 = 1e-7;
const SLOWLY: f64 = 0.7;
const LEAST_SHARE: f64 = 0.125;
/// Samples of a motion for each oscillation of the fastest mode, and at least and at most in a turn.
const PER_OSCILLATION: f64 = 48.0;
const FEWEST: f64 = 720.0;
const MOST: f64 = 40_000.0;
/// Samples of the profile of a wall over a feed per turn.
const PROFILE: u32 = 2000;
/// An angle this near to 0 or pi is a tooth that leaves a wall.
const WALL_RAD: f64 = 1e-9;

/// A wall that the cutter leaves.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Wall {
    /// At phi = 0, toward +y: teeth begin there.
    Up,
    /// At phi = pi, toward -y: teeth end there.
    Down,
}

/// Of the profile that all teeth leave along the feed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Roughness {
    /// Peak to valley, mm.
    pub rz_mm: f64,
    /// Mean deviation from the mean line, mm.
    pub ra_mm: f64,
}

/// A periodic motion of the tool against the work.
#[derive(Debug)]
pub struct Forced<'a> {
    cut: &'a Cut<'a>,
    rule: &'a Rule<POINTS>,
    times: Vec<f64>,
    /// Per element, point by point, in the basis.
    motion: Vec<Vec<f64>>,
    /// The same of what the springs and dampers of the work are pressed by: its modes with c/k of their velocity.
    pressed: Vec<Vec<f64>>,
}

/// The cutter with its chips taken about the motion that they force; `None` where that is not asked for, changes nothing, or is not found.
///
/// Newton's method: with chips and surfaces of the motion before the force is linear in the motion, and of a law that is a straight
/// line exact but for the angles at which another surface is met. Where a round changes hardly less than the one before, half of it is gone.
pub(super) fn about_forced(
    cut: &Cut<'_>,
    rule: &Rule<POINTS>,
    monitor: &dyn Monitor,
) -> Result<Option<Milling>, Failure> {
    let matters = cut.milling.has_run_out() && !cut.structure.modes.is_empty();
    if !matches!(cut.milling.about, About::ForcedMotion) || !matters || cut.rotation.varies() {
        return Ok(None);
    }
    let count = samples(cut);
    let period_s = cut.rotation.period_s(TAU);
    let mut milling = Milling { about: About::SmoothChips, ..cut.milling.clone() };
    let mut known: Vec<Vector> = Vec::new();
    let (mut share, mut before) = (1.0_f64, f64::INFINITY);
    for _ in 0..ROUNDS {
        let there = Cut { milling: &milling, ..*cut };
        let Some(periodic) = forced(&there, rule, monitor)? else { return Ok(None) };
        let found: Vec<Vector> = (0..count).map(|k| periodic.at(period_s * k as f64 / count as f64)).collect();
        let size = found.iter().flatten().fold(0.0, |most: f64, x| most.max(x.abs()));
        if !size.is_finite() || size > cut.milling.radius_mm {
            return Ok(None);
        }
        let mut off = f64::INFINITY;
        if !known.is_empty() {
            let pairs = found.iter().flatten().zip(known.iter().flatten());
            off = pairs.fold(0.0, |most: f64, (x, y)| most.max((x - y).abs())) / size.max(f64::MIN_POSITIVE);
            if off > SLOWLY * before {
                share = (0.5 * share).max(LEAST_SHARE);
            }
        }
        before = off;
        known = if known.is_empty() {
            found
        } else {
            let step = |(x, y): (&Vector, &Vector)| std::array::from_fn(|q| y[q] + share * (x[q] - y[q]));
            found.iter().zip(&known).map(step).collect()
        };
        milling.about = About::Known(Turn::new(known.clone()));
        if off < SETTLED {
            return Ok(Some(milling));
        }
    }
    Ok(None)
}

/// Rotations at which a motion is known.
fn samples(cut: &Cut<'_>) -> usize {
    let oscillations = cut.structure.fastest_rad_per_s() * cut.rotation.period_s(TAU) / TAU;
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // between both
    let count = (PER_OSCILLATION * oscillations).clamp(FEWEST, MOST).ceil() as usize;
    count
}

/// The periodic motion, linear about what the chips of the cut are taken about.
pub(super) fn forced<'a>(
    cut: &'a Cut<'a>,
    rule: &'a Rule<POINTS>,
    monitor: &dyn Monitor,
) -> Result<Option<Forced<'a>>, Failure> {
    let repeats = cut.milling.teeth_are_alike() && !cut.rotation.varies();
    let acting = if repeats { Acting::Force } else { Acting::WavesAndForce };
    let Some(map) = Map::of(cut, rule, acting, monitor)? else { return Ok(None) };
    let mut pace = Pace::new(monitor);
    let mut pushed = vec![0.0; map.dimension()];
    map.apply(&mut pushed);
    let left = |vector: &[f64]| -> Result<Vec<f64>, Failure> {
        let mut moved = vector.to_vec();
        map.apply(&mut moved);
        pace.work(map.work())?;
        Ok(vector.iter().zip(&moved).zip(&pushed).map(|((v, m), c)| v - (m - c)).collect())
    };
    let found = gmres(&pushed, TOLERANCE, APPLICATIONS, left)?;
    if found.residual.is_nan() || found.residual > ACCEPTED {
        return Ok(None);
    }
    let (mut motion, mut pressed) = (Vec::with_capacity(map.times.len()), Vec::new());
    let mut state = found.x;
    let work = cut.structure.modes.iter().any(|mode| mode.side == Side::Work);
    map.apply_seen(&mut state, |element, force, q| {
        motion.push(map.motion(element, force, q));
        if work {
            let length_s = map.times[element + 1] - map.times[element];
            pressed.push(cut.structure.pressed(rule, length_s, force, q));
        }
    });
    Ok(Some(Forced { cut, rule, times: map.times, motion, pressed }))
}

impl<'a> Forced<'a> {
    /// Of what is known at the points of elements, in the basis.
    pub(super) fn of(
        cut: &'a Cut<'a>,
        rule: &'a Rule<POINTS>,
        times: Vec<f64>,
        motion: Vec<Vec<f64>>,
        pressed: Vec<Vec<f64>>,
    ) -> Self {
        Self { cut, rule, times, motion, pressed }
    }
}

impl Forced<'_> {
    fn period_s(&self) -> f64 {
        self.times[self.times.len() - 1]
    }

    fn inside(&self, element: usize, share: f64) -> Vector {
        self.between(&self.motion[element], share)
    }

    /// Between the points of an element.
    fn between(&self, values: &[f64], share: f64) -> Vector {
        let basis = &self.cut.structure.basis;
        let d = basis.len();
        let mut at = [0.0; 3];
        for (i, weight) in self.rule.weights_at(share).iter().enumerate() {
            for (b, direction) in basis.iter().enumerate() {
                for (sum, along) in at.iter_mut().zip(direction) {
                    *sum += weight * values[i * d + b] * along;
                }
            }
        }
        at
    }

    /// The element of a time, and how far inside it lies.
    fn place(&self, time_s: f64) -> (usize, f64) {
        let time = time_s.rem_euclid(self.period_s());
        let element = (self.times.partition_point(|t| *t <= time).max(1) - 1).min(self.times.len() - 2);
        (element, (time - self.times[element]) / (self.times[element + 1] - self.times[element]))
    }

    /// Tool minus work at a time, mm.
    pub fn at(&self, time_s: f64) -> Vector {
        let (element, share) = self.place(time_s);
        self.inside(element, share)
    }

    /// What the springs and dampers of the work are pressed by at a time, toward the tool's side, mm; 0 where it does not yield.
    pub(super) fn pressed(&self, time_s: f64) -> Vector {
        let (element, share) = self.place(time_s);
        self.pressed.get(element).map_or([0.0; 3], |values| self.between(values, share))
    }

    /// The largest peak-to-peak motion of a direction, mm.
    pub fn swing_mm(&self) -> f64 {
        let (low, high) = self.extremes();
        (0..3).map(|q| high[q] - low[q]).fold(0.0, f64::max)
    }

    /// Least and largest of each direction, mm.
    pub fn extremes(&self) -> (Vector, Vector) {
        let (mut low, mut high) = ([0.0; 3], [0.0; 3]);
        for q in 0..3 {
            low[q] = -self.largest(|at| -at[q]);
            high[q] = self.largest(|at| at[q]);
        }
        (low, high)
    }

    /// The largest value of something of the motion: the best of the samples, refined beside it.
    fn largest(&self, of: impl Fn(&Vector) -> f64) -> f64 {
        let at = |element: usize, step: f64| of(&self.inside(element, step / f64::from(SAMPLES)));
        let mut best = (f64::NEG_INFINITY, 0, 0.0);
        for element in 0..self.motion.len() {
            for step in (0..=SAMPLES).map(f64::from) {
                let value = at(element, step);
                if value > best.0 {
                    best = (value, element, step);
                }
            }
        }
        let (value, element, step) = best;
        let (from, to) = ((step - 1.0).max(0.0), (step + 1.0).min(f64::from(SAMPLES)));
        value.max(golden(from, to, |step| at(element, step)))
    }

    /// The walls that the cutter leaves: none where its teeth begin and end inside the work.
    pub fn walls(&self) -> Vec<Wall> {
        let milling = self.cut.milling;
        let up = (milling.entry_rad.abs() < WALL_RAD).then_some(Wall::Up);
        let down = ((milling.exit_rad - PI).abs() < WALL_RAD).then_some(Wall::Down);
        up.into_iter().chain(down).collect()
    }

    /// When a tooth stands at a wall with a height of its edge.
    fn leaves_s(&self, tooth: usize, wall: Wall, height_mm: f64) -> f64 {
        let milling = self.cut.milling;
        let angle = if wall == Wall::Up { 0.0 } else { PI };
        let rotation = angle + milling.behind_rad(tooth) + milling.teeth[tooth].lag_rad_per_mm * height_mm;
        self.cut.rotation.time_s(rotation.rem_euclid(TAU))
    }

    /// How far a tooth cuts beyond a wall at a height, mm.
    fn beyond_mm(&self, tooth: usize, wall: Wall, height_mm: f64) -> f64 {
        let y = self.at(self.leaves_s(tooth, wall, height_mm))[1];
        if wall == Wall::Up { y } else { -y }
    }

    fn teeth(&self) -> std::ops::Range<usize> {
        0..if self.cut.milling.teeth_are_alike() { 1 } else { self.cut.milling.teeth.len() }
    }

    /// Error of a wall at a height: positive where too much is removed. The tooth that cuts farthest makes the wall.
    pub fn surface_error_mm(&self, wall: Wall, height_mm: f64) -> f64 {
        let own = |tooth: usize| self.cut.milling.teeth[tooth].radial_mm + self.beyond_mm(tooth, wall, height_mm);
        self.teeth().map(own).fold(f64::NEG_INFINITY, f64::max)
    }

    /// Least and largest motion along the spindle while anything is cut, mm: the error of the floor.
    pub fn floor_mm(&self) -> (f64, f64) {
        let (low, high) = self.extremes();
        (low[2], high[2])
    }

    /// Of a wall at a height: the envelope of all arcs over a feed per turn.
    pub fn roughness(&self, wall: Wall, height_mm: f64) -> Roughness {
        let milling = self.cut.milling;
        let feed_per_turn = milling.feed_mm * milling.teeth.len() as f64;
        let all = 0..milling.teeth.len();
        // Where along the feed the centre stands when a tooth leaves the wall, how far it cuts, and its radius.
        let arcs: Vec<(f64, f64, f64)> = all
            .map(|tooth| {
                let turned = self.cut.rotation.rotation_rad(self.leaves_s(tooth, wall, height_mm)) / TAU;
                let offset = milling.teeth[tooth].radial_mm;
                (turned * feed_per_turn, offset + self.beyond_mm(tooth, wall, height_mm), milling.radius_mm + offset)
            })
            .collect();
        // The deepest arc of the tooth itself and of its neighbours in the turns before and after.
        let depth = |x: f64| {
            let of = |(centre, top, radius): &(f64, f64, f64)| {
                let away = (x - centre + 0.5 * feed_per_turn).rem_euclid(feed_per_turn) - 0.5 * feed_per_turn;
                top - away * away / (radius + (radius * radius - away * away).max(0.0).sqrt())
            };
            arcs.iter().map(of).fold(f64::NEG_INFINITY, f64::max)
        };
        let values: Vec<f64> = (0..PROFILE).map(|k| depth(feed_per_turn * f64::from(k) / f64::from(PROFILE))).collect();
        let mean = values.iter().sum::<f64>() / f64::from(PROFILE);
        // A valley lies where a centre stands, a peak where two arcs meet, beside the least sample.
        let deepest = arcs.iter().map(|(centre, ..)| depth(*centre)).fold(f64::NEG_INFINITY, f64::max);
        let least = (0..values.len()).min_by(|a, b| values[*a].total_cmp(&values[*b])).unwrap_or(0) as f64;
        let step = feed_per_turn / f64::from(PROFILE);
        let highest = -golden((least - 1.0) * step, (least + 1.0) * step, |x| -depth(x));
        Roughness {
            rz_mm: deepest - highest,
            ra_mm: values.iter().map(|value| (value - mean).abs()).sum::<f64>() / f64::from(PROFILE),
        }
    }
}

/// The largest value between two places with one maximum.
fn golden(from: f64, to: f64, of: impl Fn(f64) -> f64) -> f64 {
    of(highest(from, to, &of))
}

/// Where it is, by the golden section.
pub(super) fn highest(mut from: f64, mut to: f64, of: impl Fn(f64) -> f64) -> f64 {
    const SHARE: f64 = 0.618_033_988_749_894_9;
    for _ in 0..50 {
        let (p, q) = (to - SHARE * (to - from), from + SHARE * (to - from));
        if of(p) < of(q) { from = p } else { to = q }
    }
    0.5 * (from + to)
}
