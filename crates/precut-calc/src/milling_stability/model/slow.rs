//! Slow cuts: over a hundred oscillations from tooth to tooth (`milling/4.21`).

use std::f64::consts::TAU;

use nalgebra::DMatrix;

use crate::calculator::{Failure, Monitor, Pace};
use crate::num::dde::Rule;

use super::cutter::{Milling, Vector};
use super::edge::{Edges, combined};
use super::forced::Forced;
use super::map::Cut;
use super::mesh::times_s;
use super::multiplier::POINTS;
use super::slow_period::slow_margin;
use super::structure::{Mode, Side, Structure, dot};
use super::zeroth::{Zeroth, least, projected};

/// Oscillations of the fastest mode in a period of the map up to which the multiplier is computed.
pub const MOST_OSCILLATIONS: f64 = 2000.0;
/// A cut is slow where so many go from tooth to tooth, too.
const FROM_TOOTH: f64 = 120.0;
/// Where every tooth is followed by one alike these are enough once a free vibration falls by so many factors of e between them.
const DECAYS: f64 = 40.0;
/// Places of a smooth stretch of the period at which the stiffness of the chips is looked at, and frequencies at each.
const PLACES: u32 = 24;
const FREQUENCIES: u32 = 240;
/// First step beyond the depth at which something grows.
const FIRST_STEP: f64 = 0.05;
/// Steps toward the limit, and how near is enough.
const STEPS: u32 = 60;
const NEAR: f64 = 1e-7;
/// Places between which growth begins tell a limit to a thousandth.
const NEAR_MARGIN: f64 = 1e-5;
/// Factors of e by which a ringing has died out: to 1e-8.
const DIED_OUT: f64 = 18.5;
/// Longest element times the angular frequency of what rings.
const LONGEST: f64 = 3.5;
/// A break across which the force changes by less than this share is none.
const SAME: f64 = 1e-9;
/// One-sided limits lie so far beside a break, rad.
const BESIDE_RAD: f64 = 1e-9;
/// Multiplications of a receptance with its eigenvalues.
const PER_FREQUENCY: usize = 400;

impl Cut<'_> {
    /// Oscillations of the fastest mode in a period of the map.
    pub fn oscillations(&self) -> f64 {
        self.structure.fastest_rad_per_s() / TAU * self.rotation.period_s(self.milling.period_rad())
    }

    /// Whether closed forms tell it in place of elements in time.
    pub fn is_slow(&self) -> bool {
        let (oscillations, decays) = in_a_tooth(self);
        let dies_out = self.repeats() && self.milling.rubbing.is_none() && decays >= DECAYS;
        oscillations >= FROM_TOOTH && (dies_out || self.oscillations() > MOST_OSCILLATIONS)
    }

    /// Whether closed forms serve in the place of a slow cut: one with another structure.
    pub fn is_as_slow(&self) -> bool {
        in_a_tooth(self).0 >= FROM_TOOTH || self.oscillations() > MOST_OSCILLATIONS
    }

    /// Whether the closed form tells the multiplier of a slow cut, too: every tooth is followed by one alike.
    pub fn repeats(&self) -> bool {
        self.milling.teeth_are_alike() && !self.rotation.varies()
    }
}

/// Oscillations of the fastest mode from tooth to tooth, and how many factors of e the slowest free vibration falls by meanwhile.
pub(super) fn in_a_tooth(cut: &Cut<'_>) -> (f64, f64) {
    let turned = cut.rotation.rotation_rad(cut.rotation.period_s(cut.milling.period_rad()));
    let tooth_s = cut.rotation.period_s(cut.milling.period_rad()) * TAU / (turned * cut.milling.teeth.len() as f64);
    let decay = |mode: &Mode| mode.damping_ratio * mode.rad_per_s();
    let slowest = cut.structure.modes.iter().map(decay).reduce(f64::min).unwrap_or(0.0);
    (cut.structure.fastest_rad_per_s() / TAU * tooth_s, slowest * tooth_s)
}

/// Depth at which a slow cut begins to chatter, and the frequency; `None` where it does not up to a depth. Where every tooth is
/// followed by one alike that is where a disturbance grows from tooth to tooth, or fifty times between two; else where it begins to
/// grow at some place of the arc.
pub fn slow_limit(cut: &Cut<'_>, most_mm: f64, monitor: &dyn Monitor) -> Result<Option<Zeroth>, Failure> {
    let growing = begins_to_grow(cut.milling, cut.structure, most_mm, monitor)?;
    let Some(from) = growing.filter(|_| cut.repeats()) else { return Ok(growing) };
    let mut pace = Pace::new(monitor);
    let mut margin = |depth_mm: f64| slow_margin(&Cut { depth_mm, ..*cut }, &mut pace);
    // Below nothing grows anywhere.
    let (mut low, mut high) = ((from.depth_mm, margin(from.depth_mm)?), None);
    let mut factor = 1.0 + FIRST_STEP;
    while high.is_none() {
        let depth_mm = (low.0 * factor).min(most_mm);
        let found = margin(depth_mm)?;
        if found.0 >= 0.0 {
            high = Some((depth_mm, found));
        } else if depth_mm >= most_mm {
            return Ok(None);
        } else {
            low = (depth_mm, found);
            factor = (factor * factor).min(2.0);
        }
    }
    let Some(mut high) = high else { return Ok(None) };
    // Inside the bracket only: the margin has a kink where the one growth passes the other.
    let mut side = 0;
    let (mut below, mut above) = (low.1.0, high.1.0);
    for _ in 0..STEPS {
        if high.0 - low.0 <= NEAR_MARGIN * high.0 {
            break;
        }
        let share = (below / (below - above)).clamp(1e-3, 1.0 - 1e-3);
        let depth_mm = low.0 + share * (high.0 - low.0);
        let found = margin(depth_mm)?;
        if found.0 >= 0.0 {
            (high, above) = ((depth_mm, found), found.0);
            below *= if side == 1 { 0.5 } else { 1.0 };
            side = 1;
        } else {
            (low, below) = ((depth_mm, found), found.0);
            above *= if side == -1 { 0.5 } else { 1.0 };
            side = -1;
        }
    }
    Ok(Some(Zeroth { depth_mm: high.0, frequency_hz: high.1.1 }))
}

/// Depth at which a disturbance begins to grow from tooth to tooth at some place of the arc, and its frequency: the stiffness of the
/// chips is taken as it stands there, process damping is left out. `None` where none does up to a depth.
fn begins_to_grow(
    milling: &Milling,
    structure: &Structure,
    most_mm: f64,
    monitor: &dyn Monitor,
) -> Result<Option<Zeroth>, Failure> {
    let mut pace = Pace::new(monitor);
    let power = 1.0 / (1.0 - milling.depth_exponent);
    // Where an edge lies in a helix the stiffness at a place grows less than the depth does: no step goes too far.
    let mut depth_mm = 1e-3 * most_mm;
    for _ in 0..STEPS {
        let Some((times, frequency_hz)) = least_times(milling, structure, depth_mm, &mut pace)? else {
            return Ok(None);
        };
        let next = depth_mm * times.powf(power);
        if (next / depth_mm - 1.0).abs() < NEAR {
            return Ok((next <= most_mm).then_some(Zeroth { depth_mm: next, frequency_hz }));
        }
        depth_mm = next;
        if depth_mm > most_mm {
            return Ok(None);
        }
    }
    Ok(Some(Zeroth {
        depth_mm,
        frequency_hz: least_times(milling, structure, depth_mm, &mut pace)?.map_or(0.0, |of| of.1),
    }))
}

/// How many times as stiff the chips of a depth may be until something grows at some place, the least of all, and its frequency.
fn least_times(
    milling: &Milling,
    structure: &Structure,
    depth_mm: f64,
    pace: &mut Pace<'_>,
) -> Result<Option<(f64, f64)>, Failure> {
    let edges = Edges::new(milling, depth_mm);
    let period = milling.period_rad();
    let mut breaks = edges.rotations();
    breaks.extend([0.0, period]);
    breaks.sort_by(f64::total_cmp);
    breaks.dedup_by(|a, b| (*a - *b).abs() < 1e-10);
    let mut found: Option<(f64, f64)> = None;
    for pair in breaks.windows(2) {
        for place in 0..=PLACES {
            let share = (f64::from(place) / f64::from(PLACES)).clamp(BESIDE_RAD, 1.0 - BESIDE_RAD);
            pace.work(edges.work() + PER_FREQUENCY * FREQUENCIES as usize)?;
            let entries = edges.at(pair[0] + share * (pair[1] - pair[0])).entries;
            let stiffness = entries.iter().fold([[0.0; 3]; 3], |sum, entry| combined(&sum, 1.0, &entry.stiffness, 1.0));
            let w: DMatrix<f64> = projected(structure, &stiffness);
            if let Some(times) = least(structure, &w, FREQUENCIES)
                && found.is_none_or(|known| times.0 < known.0)
            {
                found = Some(times);
            }
        }
    }
    Ok(found)
}

/// A jump of the force: what every mode rings by.
struct Jump {
    time_s: f64,
    /// Static answer of every mode, mm.
    amplitudes: Vec<f64>,
}

/// The motion of a slow cut about undisturbed chips: the modes follow the force, and ring where it jumps until that has died out.
pub(super) fn slow_forced<'a>(
    cut: &'a Cut<'a>,
    rule: &'a Rule<POINTS>,
    monitor: &dyn Monitor,
) -> Result<Forced<'a>, Failure> {
    let mut pace = Pace::new(monitor);
    let edges = Edges::new(cut.milling, cut.depth_mm);
    let breaks = times_s(cut.milling, &edges, &cut.rotation, 0.0);
    let period_s = breaks[breaks.len() - 1];
    let modes = &cut.structure.modes;
    let still = |force: &Vector| -> Vec<f64> {
        modes.iter().map(|mode| dot(&mode.direction, force) / mode.stiffness_n_per_mm()).collect()
    };
    let jumps = jumps(cut, &edges, &breaks, &still);
    let lasts: Vec<f64> =
        modes.iter().map(|mode| (DIED_OUT / (mode.damping_ratio * mode.rad_per_s())).min(period_s)).collect();
    // Jumps of the period before still ring at its beginning.
    let since = |time_s: f64, jump: &Jump| {
        let since = time_s - jump.time_s;
        if since < 0.0 { since + period_s } else { since }
    };
    let mut times = vec![0.0];
    for pair in breaks.windows(2) {
        let mut at = pair[0];
        while at < pair[1] - 1e-12 * period_s {
            let rings = |k: usize| jumps.iter().any(|jump| since(at, jump) < lasts[k]);
            let fastest = (0..modes.len()).filter(|&k| rings(k)).map(|k| modes[k].rad_per_s()).fold(0.0, f64::max);
            pace.work(4 * modes.len() * jumps.len() + POINTS * edges.work())?;
            at = if fastest > 0.0 { (at + LONGEST / fastest).min(pair[1]) } else { pair[1] };
            times.push(at);
        }
    }
    let d = cut.structure.basis.len();
    let (mut motion, mut pressed) = (Vec::with_capacity(times.len()), Vec::with_capacity(times.len()));
    for pair in times.windows(2) {
        pace.work(POINTS * (edges.work() + 40 * modes.len() * jumps.len()))?;
        let (mut of_motion, mut of_pressed) = (vec![0.0; POINTS * d], vec![0.0; POINTS * d]);
        for (i, point) in rule.points.iter().enumerate() {
            let time = pair[0] + point * (pair[1] - pair[0]);
            let (force, _) = edges.force(cut.rotation.rotation_rad(time));
            for (k, (mode, at_rest)) in modes.iter().zip(still(&force)).enumerate() {
                let (mut x, mut pressing) = (at_rest, at_rest);
                for jump in jumps.iter().filter(|jump| since(time, jump) < lasts[k]) {
                    let (moved, speed) = rung(mode.rad_per_s(), mode.damping_ratio, since(time, jump));
                    x -= jump.amplitudes[k] * moved;
                    pressing += jump.amplitudes[k] * (2.0 * mode.damping_ratio / mode.rad_per_s() * speed - moved);
                }
                for (b, along) in cut.structure.directions[k].iter().enumerate() {
                    of_motion[i * d + b] += along * x;
                    if mode.side == Side::Work {
                        of_pressed[i * d + b] += along * pressing;
                    }
                }
            }
        }
        motion.push(of_motion);
        pressed.push(of_pressed);
    }
    if modes.iter().all(|mode| mode.side != Side::Work) {
        pressed.clear();
    }
    Ok(Forced::of(cut, rule, times, motion, pressed))
}

/// Where the force jumps, by how much every mode is thrown.
fn jumps(cut: &Cut<'_>, edges: &Edges<'_>, breaks: &[f64], still: &dyn Fn(&Vector) -> Vec<f64>) -> Vec<Jump> {
    let near = |time_s: f64, beside: f64| edges.force(cut.rotation.rotation_rad(time_s) + beside).0;
    let ends = &breaks[..breaks.len() - 1];
    let sides: Vec<(f64, Vector, Vector)> =
        ends.iter().map(|&time_s| (time_s, near(time_s, -BESIDE_RAD), near(time_s, BESIDE_RAD))).collect();
    let length = |force: &Vector| dot(force, force).sqrt();
    let largest = sides.iter().map(|(_, before, behind)| length(before).max(length(behind))).fold(0.0, f64::max);
    sides
        .into_iter()
        .map(|(time_s, before, behind)| (time_s, std::array::from_fn(|i| behind[i] - before[i])))
        .filter(|(_, jump)| length(jump) > SAME.sqrt() * largest)
        .map(|(time_s, jump)| Jump { time_s, amplitudes: still(&jump) })
        .collect()
}

/// What is left of a step of 1 to which a mode comes, and how fast it moves there, 1/s.
fn rung(rad_per_s: f64, damping_ratio: f64, since_s: f64) -> (f64, f64) {
    let ratio = damping_ratio.min(1.0 - 1e-6);
    let root = (1.0 - ratio * ratio).sqrt();
    let decayed = (-ratio * rad_per_s * since_s).exp();
    let (sin, cos) = (rad_per_s * root * since_s).sin_cos();
    (decayed * (cos + ratio / root * sin), decayed * rad_per_s / root * sin)
}
