//! Cutters with run-out about the motion that their chips force, against a cut in time that remembers every surface.
#![allow(clippy::unwrap_used, clippy::panic, clippy::print_stdout, missing_docs)]

use std::f64::consts::{PI, TAU};

use precut_calc::calculator::Unwatched;
use precut_calc::milling_stability::model::{About, Cut, Law, Milling, Mode, Orders, Rotation, Side, Structure, Tooth};

use crate::draw::Draw;

/// Steps of a turn: whole for every tooth, and so many that the period of the fastest mode is off by 1e-4 (200 steps to it).
const STEPS: usize = 5 * 600;

/// A cut in time: straight edges, even pitch, one mode along x and one along y.
struct Marching<'a> {
    milling: &'a Milling,
    modes: &'a [Mode],
    depth_mm: f64,
    step_s: f64,
    /// x, v of both modes.
    state: [[f64; 2]; 2],
    force: [f64; 2],
    /// Motion at all steps so far.
    motion: Vec<[f64; 2]>,
}

impl Marching<'_> {
    fn force(&self, step: usize, at: [f64; 2]) -> [f64; 2] {
        let milling = self.milling;
        let teeth = milling.teeth.len();
        let Law::Mechanistic { cutting, .. } = milling.law else { panic!("a straight line") };
        let mut force = [0.0; 2];
        for (j, tooth) in milling.teeth.iter().enumerate() {
            // Half a step aside: entry and exit lie between two steps.
            let turned = TAU * (step as f64 + 0.5) / STEPS as f64;
            let angle = (turned - j as f64 * TAU / teeth as f64).rem_euclid(TAU);
            if angle <= milling.entry_rad || angle >= milling.exit_rad {
                continue;
            }
            let (sin, cos) = angle.sin_cos();
            // What any tooth left in the last two turns.
            let against = |l: usize| {
                let ago = l * STEPS / teeth;
                let then = step.checked_sub(ago).map_or([0.0; 2], |before| self.motion[before]);
                let other = milling.teeth[(j + 2 * teeth - l) % teeth];
                let fed = l as f64 * milling.feed_mm * sin;
                fed + tooth.radial_mm - other.radial_mm + sin * (at[0] - then[0]) + cos * (at[1] - then[1])
            };
            let chip = (1..=2 * teeth).map(against).fold(f64::INFINITY, f64::min).max(0.0) * self.depth_mm;
            force[0] += chip * (-cutting[0] * cos - cutting[1] * sin);
            force[1] += chip * (cutting[0] * sin - cutting[1] * cos);
        }
        force
    }

    /// A step by the mean acceleration of its ends.
    fn step(&mut self) {
        let step = self.motion.len();
        let h = self.step_s;
        let before = self.force;
        let mut next = self.state;
        let mut force = before;
        for _ in 0..3 {
            for (q, mode) in self.modes.iter().enumerate() {
                let (w, zeta) = (mode.rad_per_s(), mode.damping_ratio);
                let [x, v] = self.state[q];
                let pushed = 500.0 * (before[q] + force[q]) / mode.mass_kg;
                // v1 = v + h (p - zeta w (v + v1) - w^2 (x + x1)/2), x1 = x + h (v + v1)/2.
                let right = v + h * (pushed - zeta * w * v - w * w * (x + 0.25 * h * v));
                let v1 = right / (1.0 + h * zeta * w + 0.25 * h * h * w * w);
                next[q] = [x + 0.5 * h * (v + v1), v1];
            }
            force = self.force(step, [next[0][0], next[1][0]]);
        }
        self.state = next;
        self.force = force;
        self.motion.push([next[0][0], next[1][0]]);
    }

    fn turns(&mut self, turns: usize) {
        for _ in 0..turns * STEPS {
            self.step();
        }
    }

    fn last_turn(&self) -> &[[f64; 2]] {
        &self.motion[self.motion.len() - STEPS..]
    }
}

/// Motion and |mu| of a turn with a cut in time, once it has settled.
fn marched(milling: &Milling, modes: &[Mode], rpm: f64, depth_mm: f64) -> (Vec<[f64; 2]>, f64) {
    let step_s = 60.0 / rpm / STEPS as f64;
    let start = Marching { milling, modes, depth_mm, step_s, state: [[0.0; 2]; 2], force: [0.0; 2], motion: vec![] };
    let mut one = start;
    one.turns(30);
    let settled = one.last_turn().to_vec();
    // The same beside it, 1e-4 of its size: how far both are apart from turn to turn.
    let mut other = Marching { state: one.state, force: one.force, motion: one.motion.clone(), ..one };
    for [x, v] in &mut other.state {
        (*x, *v) = (*x * 1.000_1 + 1e-6, *v * 1.000_1);
    }
    let mut apart = Vec::new();
    for _ in 0..15 {
        one.turns(1);
        other.turns(1);
        let squares = one.last_turn().iter().zip(other.last_turn()).flat_map(|(a, b)| [a[0] - b[0], a[1] - b[1]]);
        apart.push(squares.map(|d| d * d).sum::<f64>().sqrt());
    }
    (settled, (apart[14] / apart[6]).powf(1.0 / 8.0))
}

fn cutter(draw: &mut Draw) -> Milling {
    let tooth = |draw: &mut Draw| Tooth {
        pitch_rad: TAU / 5.0,
        lag_rad_per_mm: 0.0,
        radial_mm: 1e-3 * draw.between(0.0, 60.0),
        axial_mm: 0.0,
    };
    Milling {
        radius_mm: 10.0,
        teeth: (0..5).map(|_| tooth(draw)).collect(),
        edge_angle_rad: 0.5 * PI,
        entry_rad: PI - draw.between(0.6, 1.6),
        exit_rad: PI,
        feed_mm: draw.between(0.03, 0.1),
        law: Law::Mechanistic { edge: [0.0; 3], cutting: [800.0, 300.0, 0.0] },
        depth_exponent: 0.0,
        rubbing: None,
        about: About::ForcedMotion,
    }
}

/// Cuts that settle within the turns that are made and do not end in round-off; where undisturbed chips are off the most, among sixty
/// that were drawn.
const CUTS: [u64; 2] = [30, 31];

#[test]
fn a_cutter_with_run_out_swings_and_settles_as_a_cut_in_time() {
    let orders = Orders::default();
    let drawn: Option<u64> = std::env::var("PRECUT_ABOUT").ok().and_then(|count| count.parse().ok());
    let cuts: Vec<u64> = drawn.map_or_else(|| CUTS.to_vec(), |count| (0..count).collect());
    let mut off_smooth = 0.0_f64;
    for seed in cuts {
        let mut draw = Draw::new(seed);
        let milling = cutter(&mut draw);
        let mode = |direction, frequency_hz, mass_kg| Mode {
            side: Side::Tool,
            direction,
            frequency_hz,
            damping_ratio: 0.03,
            mass_kg,
        };
        let modes = vec![
            mode([1.0, 0.0, 0.0], draw.between(450.0, 650.0), 0.15),
            mode([0.0, 1.0, 0.0], draw.between(450.0, 650.0), 0.15),
        ];
        let structure = Structure::new(modes.clone());
        let (rpm, depth_mm) = (draw.between(3000.0, 6000.0), draw.between(0.5, 2.5));
        let cut = Cut { milling: &milling, structure: &structure, rotation: Rotation::steady(rpm), depth_mm };
        let smooth = Milling { about: About::SmoothChips, ..milling.clone() };
        let known = orders.about(&cut, &Unwatched).unwrap();
        let Some(known) = known else {
            assert!(drawn.is_some(), "{seed}: no motion to go about");
            continue;
        };
        let about = Cut { milling: &known, ..cut };
        let about_motion = orders.multiplier(&about, &Unwatched).unwrap().unwrap().modulus();
        if !(0.4..0.7).contains(&about_motion) {
            assert!(drawn.is_some(), "{seed}: {about_motion}");
            continue;
        }
        let about_chips = orders.multiplier(&Cut { milling: &smooth, ..cut }, &Unwatched).unwrap().unwrap().modulus();
        let forced = orders.forced(&about, &Unwatched).unwrap().unwrap();
        let (settled, modulus) = marched(&milling, &modes, rpm, depth_mm);
        let swing = forced.swing_mm();
        let mut off = 0.0_f64;
        for (k, at) in settled.iter().enumerate() {
            let found = forced.at(60.0 / rpm * (k as f64 + 0.5) / STEPS as f64);
            off = off.max((found[0] - at[0]).abs()).max((found[1] - at[1]).abs());
        }
        if drawn.is_some() {
            println!(
                "{seed} swing {:.1} um off {:.1e} |mu| in time {modulus:.4} about motion {about_motion:.4} about chips {about_chips:.4}",
                1e3 * swing,
                off / swing,
            );
        }
        // Of second order in the step: half as much at 900 steps to a tooth as at 600.
        assert!(off < 4e-3 * swing, "{seed}: {off} of {swing}");
        off_smooth = off_smooth.max((about_chips / modulus - 1.0).abs());
        // A pair turns on its way: its size over eight turns is known to some percent.
        assert!((about_motion / modulus - 1.0).abs() < 0.06, "{seed}: {modulus} {about_motion}");
    }
    assert!(off_smooth > 0.1, "undisturbed chips are as good: {off_smooth}");
}
