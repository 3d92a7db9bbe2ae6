//! Logs of cuts with an end mill whose modes yield in two directions: each stable or chattering, some with the frequency heard.

mod mill;

use serde_json::{Value, json};

use crate::{Class, Hidden, Random, Trial, Truth};
use mill::{Mill, Mode};

/// Speeds, and depths at each; the step of their logarithm.
const SPEEDS: usize = 8;
const DEPTHS: usize = 5;
const STEP: f64 = 0.16;
/// Standard deviation of the level of all limits, and of a frequency that is heard, as shares.
const LEVEL: f64 = 0.01;
const HEARD: f64 = 0.006;
/// Share of the chattering cuts of which a frequency was written down.
const LISTENED: f64 = 0.6;
/// Step of the logarithm of the depth for the slope of growth, and the least slope.
const SLOPE_STEP: f64 = 0.05;
const FLATTEST: f64 = 0.03;
/// Rubbing of the flank at a size of 1.
const RUBBING_N_PER_MM: f64 = 3000.0;
/// Largest shift of the limit at one speed that no catalogue holds.
const ODD_SHIFT: f64 = 0.8;

/// A cause that can be hidden, and the size of it that is tried first: of a factor its logarithm.
#[derive(Debug, Clone, Copy)]
struct Size {
    kind: &'static str,
    most: f64,
    two_sided: bool,
}

const fn size(kind: &'static str, most: f64, two_sided: bool) -> Size {
    Size { kind, most, two_sided }
}

const CAUSES: &[Size] = &[
    size("mode_frequency", 0.15, true),
    size("mode_damping", 1.0, true),
    size("mode_stiffness", 0.8, true),
    size("force_coefficient", 0.6, true),
    size("radial_ratio", 0.8, true),
    size("tooth_runout", 2.0, false),
    size("process_damping", 1.0, false),
];

/// Errors of limits that no catalogue holds.
const OUTSIDE: &[&str] = &["odd_speed", "every_other_speed"];

/// A cause at a size, and the mode that it acts on.
#[derive(Debug, Clone, Copy)]
struct Scaled {
    cause: Size,
    size: f64,
    mode: usize,
}

/// Cutter, speeds, and the limits without what is hidden, ln mm, with the slope of growth over that logarithm.
struct Rig {
    mill: Mill,
    speeds: Vec<f64>,
    limits: Vec<f64>,
    slopes: Vec<f64>,
}

/// Draws a log. `shift` is the root mean square over the speeds by which every hidden cause moves the margin of chatter at the limit, as a
/// share of the depth, in standard deviations of its scatter from cut to cut.
pub fn draw_log(class: Class, shift: f64, seed: u64) -> Trial {
    drawn(class, None, shift, seed)
}

/// Draws a log that hides one given cause of the catalogue; of a kind that there is not, nothing.
pub fn draw_log_hiding(kind: &str, shift: f64, seed: u64) -> Trial {
    let cause = CAUSES.iter().copied().find(|cause| cause.kind == kind);
    let class = if cause.is_some() { Class::One } else { Class::Nothing };
    drawn(class, cause, shift, seed)
}

/// The same log as [`draw_log`] with the machine that it was cut on, which can cut more.
pub fn draw_log_and_machine(class: Class, shift: f64, seed: u64) -> (Trial, Machine) {
    drawn_with_machine(class, None, shift, seed)
}

fn drawn(class: Class, given: Option<Size>, shift: f64, seed: u64) -> Trial {
    drawn_with_machine(class, given, shift, seed).0
}

fn drawn_with_machine(class: Class, given: Option<Size>, shift: f64, seed: u64) -> (Trial, Machine) {
    let mut random = Random::new(seed);
    loop {
        // A cause that cannot be seen on this cutter is drawn again, with another.
        if let Some((trial, mill, scatter, level)) = attempt(class, given, shift, &mut random) {
            return (trial, Machine { mill, scatter, level, random });
        }
    }
}

/// A machine with what is hidden in it.
pub struct Machine {
    mill: Mill,
    scatter: f64,
    level: f64,
    random: Random,
}

impl Machine {
    /// A cut at a speed, rev/min, and a depth, mm, as a row of its log. Each is another cut, even of the same numbers.
    pub fn cut(&mut self, spindle_rpm: f64, depth_mm: f64) -> Value {
        row(&self.mill, [spindle_rpm, depth_mm], [self.level, self.scatter], &mut self.random)
    }
}

/// A cut at a speed and a depth that behaves like one of another depth: off by `level`, and from cut to cut.
fn row(mill: &Mill, [rpm, depth]: [f64; 2], [level, scatter]: [f64; 2], random: &mut Random) -> Value {
    let scattered = level + scatter * random.student_6();
    let followed = mill.follow(rpm, depth * (-scattered).exp());
    let chatters = followed.growth > 0.0;
    let class = if chatters { "chatter" } else { "stable" };
    let mut row = json!({ "spindle_speed_rpm": rpm, "depth_mm": depth, "class": class });
    if chatters && random.chance(LISTENED) {
        row["frequency_hz"] = json!(round(followed.loudest_hz() * (1.0 + HEARD * random.normal()), 1));
    }
    row
}

fn attempt(class: Class, given: Option<Size>, shift: f64, random: &mut Random) -> Option<(Trial, Mill, f64, f64)> {
    let rig = rig(random)?;
    let scatter = random.uniform(0.03, 0.06);
    let mut odd = vec![0.0; rig.speeds.len()];
    let mut causes = Vec::new();
    let wanted = match (class, given) {
        (_, Some(cause)) => vec![cause],
        (Class::Nothing, None) => Vec::new(),
        (Class::One, None) => vec![random.pick(CAUSES)],
        (Class::Two, None) => vec![random.pick(CAUSES), random.pick(CAUSES)],
        (Class::Outside, None) => {
            let kind = random.pick(OUTSIDE);
            let alone = random.whole(0, odd.len() - 1);
            let mut sign = random.sign();
            for (speed, odd) in odd.iter_mut().enumerate() {
                if kind == "every_other_speed" || speed == alone {
                    *odd = ODD_SHIFT * sign * random.uniform(0.7, 1.0);
                    sign = -sign;
                }
            }
            causes.push(hidden(kind, ODD_SHIFT, Vec::new(), shift));
            Vec::new()
        }
    };
    let mut mill = rig.mill.clone();
    for cause in wanted {
        if causes.iter().any(|known: &Hidden| known.kind == cause.kind) {
            return None;
        }
        let scaled = scaled(cause, &rig, shift * scatter, random)?;
        scaled.act(&mut mill);
        causes.push(hidden(cause.kind, scaled.told(&mill), scaled.shapes(), shift));
    }
    let level = random.uniform_sd(LEVEL);
    let mut rows = Vec::new();
    for (speed, &rpm) in rig.speeds.iter().enumerate() {
        // Around the limit that the base predicts, as whoever wants to know it would cut.
        for k in 0..DEPTHS {
            let depth = round((rig.limits[speed] + STEP * (k as f64 - 0.5 * (DEPTHS as f64 - 1.0))).exp(), 3);
            rows.push(row(&mill, [rpm, depth], [odd[speed] + level, scatter], random));
        }
    }
    let request = rig.request(&rows);
    let truth = Truth { class, causes, together: Vec::new() };
    Some((Trial { request, truth, sigma: scatter, later: None }, mill, scatter, level))
}

fn hidden(kind: &'static str, size: f64, shapes: Vec<(&'static str, f64)>, snr: f64) -> Hidden {
    Hidden { kind, size, shapes, snr, signature: Vec::new() }
}

fn round(value: f64, digits: i32) -> f64 {
    let scale = 10.0_f64.powi(digits);
    (value * scale).round() / scale
}

/// A cutter with a mode or two in each direction; `None` where chatter begins at no depth that a cutter has.
fn rig(random: &mut Random) -> Option<Rig> {
    let diameter_mm = random.pick(&[12.0, 16.0, 20.0]);
    let teeth = random.pick(&[2_usize, 3, 4]);
    let mut modes = Vec::new();
    for axis in 0..2 {
        for _ in 0..random.whole(1, 2) {
            modes.push(Mode {
                axis,
                frequency_hz: round(random.uniform(500.0, 1800.0), 1),
                damping_ratio: round(random.uniform(0.015, 0.05), 4),
                stiffness_n_per_mm: round(random.uniform(6000.0, 30_000.0), 0),
            });
        }
    }
    let softest = modes.iter().copied().min_by(|a, b| a.stiffness_n_per_mm.total_cmp(&b.stiffness_n_per_mm))?;
    let mill = Mill {
        diameter_mm,
        teeth,
        width_mm: round(diameter_mm * random.pick(&[0.25, 0.5, 1.0]), 2),
        tangential_n_per_mm2: round(random.uniform(600.0, 1500.0), 0),
        radial_n_per_mm2: round(random.uniform(200.0, 600.0), 0),
        feed_mm: round(random.uniform(0.05, 0.12), 3),
        runout_mm: 0.0,
        rubbing_n_per_mm: 0.0,
        modes,
    };
    // From one oscillation to seven between two teeth.
    let mut swings = random.uniform(0.8, 1.4);
    let mut speeds = Vec::new();
    for _ in 0..SPEEDS {
        speeds.push(round(60.0 * softest.frequency_hz / (swings * teeth as f64), 0));
        swings *= random.uniform(1.15, 1.4);
    }
    let limits: Option<Vec<f64>> = speeds.iter().map(|speed| limit(&mill, *speed, 0.0)).collect();
    let limits = limits?;
    let slope = |(speed, limit): (&f64, &f64)| {
        let at = |shift: f64| mill.follow(*speed, (limit + shift).exp()).growth;
        (at(SLOPE_STEP) - at(-SLOPE_STEP)) / (2.0 * SLOPE_STEP)
    };
    let slopes: Vec<f64> = speeds.iter().zip(&limits).map(slope).collect();
    // A limit that growth but grazes is none to be known.
    slopes.iter().all(|slope| *slope > FLATTEST).then_some(Rig { mill, speeds, limits, slopes })
}

impl Scaled {
    fn act(&self, mill: &mut Mill) {
        let factor = self.size.exp();
        let mode = &mut mill.modes[self.mode];
        match self.cause.kind {
            "mode_frequency" => mode.frequency_hz *= factor,
            "mode_damping" => mode.damping_ratio *= factor,
            "mode_stiffness" => mode.stiffness_n_per_mm *= factor,
            "force_coefficient" => {
                mill.tangential_n_per_mm2 *= factor;
                mill.radial_n_per_mm2 *= factor;
            }
            "radial_ratio" => mill.radial_n_per_mm2 *= factor,
            "tooth_runout" => mill.runout_mm += self.size * mill.feed_mm,
            _ => mill.rubbing_n_per_mm += self.size * RUBBING_N_PER_MM,
        }
    }

    /// The number of the effect that is no mode, as a diagnosis tells it: the logarithm of a factor, mm, or N/mm.
    fn told(&self, mill: &Mill) -> f64 {
        match self.cause.kind {
            "tooth_runout" => self.size * mill.feed_mm,
            "process_damping" => self.size * RUBBING_N_PER_MM,
            _ => self.size,
        }
    }

    fn shapes(&self) -> Vec<(&'static str, f64)> {
        if self.cause.kind.starts_with("mode_") { vec![("mode", self.mode as f64 + 1.0)] } else { Vec::new() }
    }
}

/// The size at which the root mean square over the speeds of what it does to the margin at the limit is as asked for, to a few percent,
/// by bisection. `None` where it is not seen on this cutter.
fn scaled(cause: Size, rig: &Rig, rms_ln: f64, random: &mut Random) -> Option<Scaled> {
    let sign = if cause.two_sided { random.sign() } else { 1.0 };
    let mode = random.whole(0, rig.mill.modes.len() - 1);
    let at = |share: f64| Scaled { cause, size: sign * share * cause.most, mode };
    let rms = |share: f64| -> f64 {
        let mut mill = rig.mill.clone();
        at(share).act(&mut mill);
        let margin = |k: usize| mill.follow(rig.speeds[k], rig.limits[k].exp()).growth / rig.slopes[k];
        let square: f64 = (0..rig.speeds.len()).map(|k| margin(k).clamp(-1.0, 1.0).powi(2)).sum();
        (square / rig.speeds.len() as f64).sqrt()
    };
    let too_much = |share: f64| rms(share) > rms_ln;
    if !too_much(1.0) {
        return None;
    }
    let (mut low, mut high) = (-1.5_f64, 0.0);
    for _ in 0..5 {
        let middle = 0.5 * (low + high);
        if too_much(10.0_f64.powf(middle)) { high = middle } else { low = middle }
    }
    let share = 10.0_f64.powf(low);
    (rms(share) > 0.7 * rms_ln).then(|| at(share))
}

/// ln of the depth at which chatter begins, looked for from a place on; `None` where growth does not change its sign near it.
fn limit(mill: &Mill, spindle_rpm: f64, near: f64) -> Option<f64> {
    let growth = |ln: f64| mill.follow(spindle_rpm, ln.exp()).growth;
    let mut low = (near, growth(near));
    let step = if low.1 < 0.0 { 0.3 } else { -0.3 };
    let mut high = low;
    for _ in 0..14 {
        high = (low.0 + step, growth(low.0 + step));
        if (high.1 < 0.0) != (low.1 < 0.0) {
            break;
        }
        low = high;
    }
    if (high.1 < 0.0) == (low.1 < 0.0) {
        return None;
    }
    for _ in 0..8 {
        let middle = 0.5 * (low.0 + high.0);
        let there = growth(middle);
        if (there < 0.0) == (low.1 < 0.0) { low = (middle, there) } else { high = (middle, there) }
    }
    Some(0.5 * (low.0 + high.0))
}

impl Rig {
    fn request(&self, rows: &[Value]) -> Value {
        let mill = &self.mill;
        let mode = |of: &Mode| {
            json!({
                "direction": if of.axis == 0 { [1, 0, 0] } else { [0, 1, 0] }, "frequency_hz": of.frequency_hz,
                "damping_ratio": of.damping_ratio, "mass_kg": of.mass_kg()
            })
        };
        json!({
            "calculator": "milling-stability",
            "job": {
                "cutter": { "diameter_mm": mill.diameter_mm, "teeth": mill.teeth },
                "force": {
                    "kind": "mechanistic", "tangential_n_per_mm2": mill.tangential_n_per_mm2,
                    "radial_n_per_mm2": mill.radial_n_per_mm2
                },
                "cut": {
                    "spindle_speed_rpm": self.speeds[0], "depth_mm": round(self.limits[0].exp() * 0.8, 3),
                    "width_mm": mill.width_mm, "milling": "down", "feed_mm_per_tooth": mill.feed_mm
                },
                "tool": { "kind": "modes", "modes": mill.modes.iter().map(mode).collect::<Vec<_>>() },
                "work": { "kind": "rigid" }
            },
            "quantity": "class",
            "measurements": rows
        })
    }
}
