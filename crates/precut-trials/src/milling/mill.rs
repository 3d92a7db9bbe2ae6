//! An end mill in a cut, in time: modes along x and y by exact rotation over even steps, the force at both ends of a step, and what
//! earlier teeth left by its place in time, a whole number of steps ago. No map over a period, no eigenvalue.

use std::f64::consts::{PI, TAU};

use crate::Random;

/// Steps of a tooth period, and of an oscillation of the fastest mode, at least.
const PER_TOOTH: f64 = 120.0;
const PER_OSCILLATION: f64 = 40.0;
/// Teeth over which a disturbance is followed before growth is looked at, and over which it is.
const SETTLING: usize = 40;
const FOLLOWED: usize = 60;
/// Lines of a spectrum between the lowest and the highest frequency that is heard.
const LINES: u32 = 1500;
const HEARD_HZ: (f64, f64) = (100.0, 3500.0);
/// m x'' in kg mm/s2 over the force in N.
const MM_PER_S2: f64 = 1000.0;

/// A mode of the tool along one axis.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Mode {
    /// 0 along the feed, 1 across it.
    pub(crate) axis: usize,
    pub(crate) frequency_hz: f64,
    pub(crate) damping_ratio: f64,
    pub(crate) stiffness_n_per_mm: f64,
}

/// Cutter, cut and modes.
#[derive(Debug, Clone)]
pub(crate) struct Mill {
    pub(crate) diameter_mm: f64,
    pub(crate) teeth: usize,
    /// Of a strip at the side where teeth leave with no chip.
    pub(crate) width_mm: f64,
    pub(crate) tangential_n_per_mm2: f64,
    pub(crate) radial_n_per_mm2: f64,
    pub(crate) feed_mm: f64,
    /// How far the first tooth stands out.
    pub(crate) runout_mm: f64,
    pub(crate) rubbing_n_per_mm: f64,
    pub(crate) modes: Vec<Mode>,
}

/// Share of a tangential force in the rubbing of the flank.
const FRICTION: f64 = 0.3;

/// What became of a disturbance.
pub(crate) struct Followed {
    /// ln of its size from tooth to tooth.
    pub(crate) growth: f64,
    /// Its displacement along both axes without that growth, step by step, and the step.
    motion: Vec<[f64; 2]>,
    step_s: f64,
}

/// What one tooth does at an instant.
struct Edge {
    /// Radial and tangential direction.
    radial: [f64; 2],
    tangential: [f64; 2],
    /// How many teeth ago the surface was left that it meets.
    ago: usize,
}

impl Mill {
    /// Follows a disturbance of undisturbed chips.
    pub(crate) fn follow(&self, spindle_rpm: f64, depth_mm: f64) -> Followed {
        let tooth_s = 60.0 / (spindle_rpm * self.teeth as f64);
        let fastest = self.modes.iter().map(|mode| mode.frequency_hz).fold(0.0, f64::max);
        let per_tooth = whole(PER_TOOTH.max(PER_OSCILLATION * fastest * tooth_s).ceil());
        let step_s = tooth_s / per_tooth as f64;
        let passes: Vec<StepOf> = self.modes.iter().map(|mode| StepOf::new(mode, step_s)).collect();
        let edges: Vec<Vec<Edge>> =
            (0..per_tooth * self.teeth).map(|i| self.edges(TAU * i as f64 / (per_tooth * self.teeth) as f64)).collect();
        let speed_mm_per_s = PI * self.diameter_mm * spindle_rpm / 60.0;
        let rubbing = self.rubbing_n_per_mm / speed_mm_per_s;
        // The same beginning of every cut: all modes are struck.
        let mut random = Random::new(7);
        let mut state: Vec<[f64; 2]> = self.modes.iter().map(|_| [1e-3 * random.uniform(0.5, 1.0), 0.0]).collect();
        let teeth = SETTLING + FOLLOWED;
        let mut motion: Vec<[f64; 2]> = vec![[0.0; 2]; per_tooth * self.teeth];
        let before = motion.len();
        let mut grown = 0.0;
        let mut sizes: Vec<f64> = Vec::new();
        let mut kept: Vec<([f64; 2], f64)> = Vec::new();
        for tooth in 0..teeth {
            for step in 0..per_tooth {
                let turned = tooth * per_tooth + step;
                let here = place(&self.modes, &state);
                motion.push([here[0], here[1]]);
                let now = motion.len() - 1;
                let at = |of: [f64; 4], later: usize| {
                    let mut force = [0.0; 2];
                    for edge in &edges[(turned + later) % edges.len()] {
                        let left = motion[now + later - edge.ago * per_tooth];
                        let wave = (0..2).map(|a| edge.radial[a] * (of[a] - left[a])).sum::<f64>();
                        let rate = (0..2).map(|a| edge.radial[a] * of[2 + a]).sum::<f64>();
                        let tangential = self.tangential_n_per_mm2 * wave + FRICTION * rubbing * rate;
                        let radial = self.radial_n_per_mm2 * wave + rubbing * rate;
                        for (axis, force) in force.iter_mut().enumerate() {
                            *force -= depth_mm * (tangential * edge.tangential[axis] + radial * edge.radial[axis]);
                        }
                    }
                    force
                };
                let first = at(here, 0);
                let guessed: Vec<[f64; 2]> =
                    passes.iter().zip(&state).map(|(pass, own)| pass.on(*own, first[pass.axis])).collect();
                let second = at(place(&self.modes, &guessed), 1);
                let mean = [0.5 * (first[0] + second[0]), 0.5 * (first[1] + second[1])];
                state = passes.iter().zip(&state).map(|(pass, own)| pass.on(*own, mean[pass.axis])).collect();
                if tooth >= SETTLING {
                    kept.push(([here[0], here[1]], grown));
                }
            }
            // The motion of a whole turn is kept at size 1, so that it neither overflows nor drowns.
            let recent = &motion[motion.len() - before..];
            let size = recent.iter().flatten().map(|x| x * x).sum::<f64>().sqrt();
            motion = recent.iter().map(|own| own.map(|x| x / size)).collect();
            state.iter_mut().flatten().for_each(|x| *x /= size);
            grown += size.ln();
            if tooth >= SETTLING {
                sizes.push(grown);
            }
        }
        let (growth, from) = (slope(&sizes), kept.first().map_or(0.0, |(_, scale)| *scale));
        // Without its growth the motion is even.
        let motion = kept
            .iter()
            .enumerate()
            .map(|(i, (own, scale))| {
                let decayed = (scale - from - growth * i as f64 / per_tooth as f64).exp();
                own.map(|x| x * decayed)
            })
            .collect();
        Followed { growth, motion, step_s }
    }

    /// Teeth in cut where the first tooth has turned so far.
    fn edges(&self, turned_rad: f64) -> Vec<Edge> {
        let radius = 0.5 * self.diameter_mm;
        // Down milling: teeth leave at half a turn with no chip.
        let entry = (1.0 - (self.width_mm / radius).min(2.0)).clamp(-1.0, 1.0).acos();
        let (entry, exit) = (PI - entry, PI);
        let mut found = Vec::new();
        for tooth in 0..self.teeth {
            let angle = (turned_rad - TAU * tooth as f64 / self.teeth as f64).rem_euclid(TAU);
            if angle <= entry || angle >= exit {
                continue;
            }
            let (sin, cos) = angle.sin_cos();
            let out = |tooth: usize| if tooth == 0 { self.runout_mm } else { 0.0 };
            // Of all surfaces that earlier teeth left the deepest is met.
            let chip = |ago: usize| {
                let other = (tooth + self.teeth - ago % self.teeth) % self.teeth;
                ago as f64 * self.feed_mm * sin + out(tooth) - out(other)
            };
            let ago = (1..=self.teeth).min_by(|a, b| chip(*a).total_cmp(&chip(*b))).unwrap_or(1);
            if chip(ago) > 0.0 {
                found.push(Edge { radial: [sin, cos], tangential: [cos, -sin], ago });
            }
        }
        found
    }
}

impl Followed {
    /// The frequency at which it is loudest.
    pub(crate) fn loudest_hz(&self) -> f64 {
        let power = |hz: f64| {
            let (mut re, mut im) = ([0.0; 2], [0.0; 2]);
            let (turn_sin, turn_cos) = (TAU * hz * self.step_s).sin_cos();
            let (mut sin, mut cos) = (0.0_f64, 1.0_f64);
            let count = self.motion.len() as f64;
            for (i, own) in self.motion.iter().enumerate() {
                let window = (PI * (i as f64 + 0.5) / count).sin().powi(2);
                for axis in 0..2 {
                    re[axis] += window * own[axis] * cos;
                    im[axis] += window * own[axis] * sin;
                }
                (sin, cos) = (sin * turn_cos + cos * turn_sin, cos * turn_cos - sin * turn_sin);
            }
            re.iter().chain(&im).map(|x| x * x).sum::<f64>()
        };
        let line = |k: u32| HEARD_HZ.0 + (HEARD_HZ.1 - HEARD_HZ.0) * f64::from(k) / f64::from(LINES);
        let found = (0..=LINES).map(|k| (line(k), power(line(k)))).max_by(|a, b| a.1.total_cmp(&b.1));
        found.map_or(0.0, |(hz, _)| hz)
    }
}

/// Of values one step apart, by least squares.
fn slope(values: &[f64]) -> f64 {
    let middle = 0.5 * (values.len() as f64 - 1.0);
    let (mut above, mut below) = (0.0, 0.0);
    for (i, value) in values.iter().enumerate() {
        let from_middle = i as f64 - middle;
        above += from_middle * value;
        below += from_middle * from_middle;
    }
    above / below
}

/// Displacement and velocity along both axes.
fn place(modes: &[Mode], state: &[[f64; 2]]) -> [f64; 4] {
    let mut place = [0.0; 4];
    for (mode, own) in modes.iter().zip(state) {
        place[mode.axis] += own[0];
        place[2 + mode.axis] += own[1];
    }
    place
}

/// A mode over a step with a constant force.
struct StepOf {
    axis: usize,
    whole: [[f64; 2]; 2],
    by_force_mm_per_n: f64,
}

impl StepOf {
    fn new(mode: &Mode, step_s: f64) -> Self {
        let w = TAU * mode.frequency_hz;
        let (decay, damped) = (mode.damping_ratio * w, w * (1.0 - mode.damping_ratio.powi(2)).sqrt());
        let (sin, cos) = (damped * step_s).sin_cos();
        let falls = (-decay * step_s).exp();
        let turned = sin / damped;
        let whole = [
            [falls * (cos + decay * turned), falls * turned],
            [-falls * w * w * turned, falls * (cos - decay * turned)],
        ];
        Self { axis: mode.axis, whole, by_force_mm_per_n: 1.0 / mode.stiffness_n_per_mm }
    }

    /// About the place at which the spring balances the force.
    fn on(&self, [x, v]: [f64; 2], force_n: f64) -> [f64; 2] {
        let still = force_n * self.by_force_mm_per_n;
        let [[xx, xv], [vx, vv]] = self.whole;
        [still + xx * (x - still) + xv * v, vx * (x - still) + vv * v]
    }
}

impl Mode {
    pub(crate) fn mass_kg(&self) -> f64 {
        MM_PER_S2 * self.stiffness_n_per_mm / (TAU * self.frequency_hz).powi(2)
    }
}

/// A count that was computed as a number.
#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)] // some hundreds
fn whole(count: f64) -> usize {
    count.max(1.0) as usize
}
