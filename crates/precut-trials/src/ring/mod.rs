//! Rings turned on their own surface, measured all round.

mod hide;
mod trace;

use std::f64::consts::TAU;

use serde_json::{Value, json};

use crate::{Class, Hidden, Random, Trial, Truth};
use hide::{CAUSES, OUTSIDE, Scaled, Size};

/// Standard deviation of the zero of the angle, deg.
const ANGLE_ZERO_DEG: f64 = 0.04;
/// Largest error of a single angle, deg.
const ANGLE_ERROR_DEG: f64 = 0.02;

/// Supports, tool and blank.
#[derive(Debug, Clone)]
pub(crate) struct Rig {
    pub(crate) radius_mm: f64,
    pub(crate) ovality_mm: f64,
    pub(crate) support_a_mm: [f64; 2],
    pub(crate) support_b_mm: [f64; 2],
    pub(crate) tip_mm: [f64; 2],
    pub(crate) feed_mm_per_rev: f64,
    pub(crate) revolutions: f64,
    pub(crate) spark_out: f64,
}

/// What acts beside the base: the hidden effects.
#[derive(Debug, Clone, Default)]
pub(crate) struct Acting {
    /// Waves of the blank: order, size (mm), phase.
    pub(crate) waves: Vec<(f64, f64, f64)>,
    pub(crate) tool_aside_mm: f64,
    pub(crate) support_b_mm: f64,
    pub(crate) wear_mm_per_rev: f64,
    /// Size (mm), ratio, phase.
    pub(crate) runout: (f64, f64, f64),
    pub(crate) push_off: f64,
    pub(crate) spark_out: Option<f64>,
    /// Size (mm), waves per revolution.
    pub(crate) chatter: (f64, f64),
    pub(crate) slip_deg_per_rev: f64,
}

/// Draws a trial. `snr` is that of every hidden cause; a switch without a size acts where it reaches half of it.
pub fn draw(class: Class, snr: f64, seed: u64) -> Trial {
    let mut random = Random::new(seed);
    loop {
        // A cause that this draw cannot show is drawn again.
        if let Some(trial) = attempt(class, snr, &mut random) {
            return trial;
        }
    }
}

fn attempt(class: Class, snr: f64, random: &mut Random) -> Option<Trial> {
    let rig = rig(random);
    let sigma = random.uniform(0.8, 1.6);
    let traces = random.whole(1, 2);
    let count = random.pick(&[120_u32, 180, 240]);
    let places: Vec<f64> = (0..count).map(|i| 360.0 * f64::from(i) / f64::from(count)).collect();
    let angles: Vec<f64> = places.iter().map(|deg| deg.to_radians()).collect();
    let sizes = match class {
        Class::Nothing => Vec::new(),
        Class::One => vec![random.pick(CAUSES)],
        Class::Two => {
            let (first, second) = (random.pick(CAUSES), random.pick(CAUSES));
            if first.kind == second.kind {
                return None;
            }
            vec![first, second]
        }
        Class::Outside => vec![random.pick(OUTSIDE)],
    };
    let base = if sizes.is_empty() { Vec::new() } else { trace::deviations_um(&rig, &Acting::default(), &angles) };
    let mut hidden = Vec::new();
    for cause in sizes {
        hidden.push(scaled(cause, &rig, &base, &angles, snr * sigma, random)?);
    }
    let zero = random.uniform_sd(ANGLE_ZERO_DEG);
    let mut rows = Vec::new();
    for trace in 1..=traces {
        let at: Vec<f64> = places
            .iter()
            .map(|deg| (deg + zero + random.uniform(-ANGLE_ERROR_DEG, ANGLE_ERROR_DEG)).to_radians())
            .collect();
        let clean = clean_um(&rig, &hidden, &at)?;
        let mut before = random.student_6();
        for (place, clean) in places.iter().zip(clean) {
            let fresh = random.student_6();
            let noise = (fresh + 0.2 * before) / 1.04_f64.sqrt();
            before = fresh;
            let value = clean + sigma * random.uniform(0.8, 1.2) * noise;
            rows.push(json!({ "trace": trace, "angle_deg": place, "radial_deviation_um": round(value, 2) }));
        }
    }
    let signature = |hidden: &[Scaled]| {
        let with = clean_um(&rig, hidden, &angles)?;
        let change: Vec<f64> = with.iter().zip(&base).map(|(with, base)| with - base).collect();
        Some(change.repeat(traces))
    };
    let mut causes = Vec::new();
    for one in &hidden {
        causes.push(Hidden {
            kind: one.cause.kind,
            size: one.first_value(&rig),
            shapes: one.shapes(&rig),
            snr,
            signature: signature(std::slice::from_ref(one))?,
        });
    }
    let truth = Truth { class, causes, together: signature(&hidden)? };
    Some(Trial { request: request(&rig, &rows), truth, sigma, later: None })
}

fn round(value: f64, digits: i32) -> f64 {
    let scale = 10.0_f64.powi(digits);
    (value * scale).round() / scale
}

/// The tool about opposite to the left support, fed toward the origin until the whole surface is cut.
fn rig(random: &mut Random) -> Rig {
    let radius_mm = random.pick(&[60.0, 80.0, 100.0, 150.0]);
    let ovality_mm = round(random.uniform(0.06, 0.18), 3);
    let half = random.uniform(38.0, 50.0_f64).to_radians();
    // Inside the largest diameter: a first bite that locks odd lobes in; or clear of it.
    let gap_mm = ovality_mm * random.uniform(0.5, 1.3);
    let (sin, cos) = half.sin_cos();
    let aside = (half + random.uniform(-0.2, 0.2_f64).to_radians()).sin_cos();
    let reach = radius_mm + gap_mm;
    let revolutions = random.whole(12, 18) as f64;
    // The diameter ends below the smallest of the blank.
    let travel_mm = gap_mm + 1.25 * ovality_mm + 0.03;
    let place = |x: f64| round(x, 4);
    Rig {
        radius_mm,
        ovality_mm,
        support_a_mm: [place(-radius_mm * sin), place(-radius_mm * cos)],
        support_b_mm: [place(radius_mm * sin), place(-radius_mm * cos)],
        tip_mm: [place(reach * aside.0), place(reach * aside.1)],
        feed_mm_per_rev: round(travel_mm / revolutions, 5),
        revolutions,
        spark_out: random.pick(&[0.0, 1.0, 2.0]),
    }
}

fn clean_um(rig: &Rig, hidden: &[Scaled], angles: &[f64]) -> Option<Vec<f64>> {
    let mut acting = Acting::default();
    for effect in hidden {
        effect.act(rig, &mut acting)?;
    }
    let mut values = trace::deviations_um(rig, &acting, angles);
    for (value, &angle) in values.iter_mut().zip(angles) {
        *value += hidden.iter().map(|effect| effect.after_um(angle)).sum::<f64>();
    }
    // As an instrument gives them: the least-squares circle of its own points taken out.
    let n = angles.len() as f64;
    let sum = |of: &dyn Fn(f64) -> f64| values.iter().zip(angles).map(|(v, &a)| v * of(a)).sum::<f64>() / n;
    let (mean, x, y) = (sum(&|_| 1.0), 2.0 * sum(&f64::cos), 2.0 * sum(&f64::sin));
    let left = values.iter().zip(angles).map(|(v, &a)| v - mean - x * a.cos() - y * a.sin()).collect::<Vec<f64>>();
    left.iter().all(|v| v.is_finite()).then_some(left)
}

/// The size at which the root mean square of the signature is as asked for, to a few percent: by bisection, since most
/// effects are far from linear. `None` where the cause cannot be seen on this ring.
fn scaled(cause: Size, rig: &Rig, base: &[f64], angles: &[f64], rms_um: f64, random: &mut Random) -> Option<Scaled> {
    let sign = if cause.two_sided { random.sign() } else { 1.0 };
    let form = [random.uniform(0.0, 1.0), random.uniform(0.0, 1.0), random.uniform(0.0, 1.0)];
    let at = |size: f64| Scaled { cause, size: sign * size, form };
    let rms = |size: f64| {
        let with = clean_um(rig, &[at(size)], angles)?;
        Some((with.iter().zip(base).map(|(w, b)| (w - b).powi(2)).sum::<f64>() / base.len() as f64).sqrt())
    };
    if at(1.0).is_switch() {
        return (rms(1.0)? >= 0.5 * rms_um).then(|| at(1.0));
    }
    if rms(cause.most)? < rms_um {
        return None;
    }
    // Between a thousandth and the whole, evenly in the logarithm.
    let (mut low, mut high) = (-3.0_f64, 0.0);
    for _ in 0..7 {
        let middle = 0.5 * (low + high);
        if rms(cause.most * 10.0_f64.powf(middle))? < rms_um { low = middle } else { high = middle }
    }
    Some(at(cause.most * 10.0_f64.powf(0.5 * (low + high))))
}

fn request(rig: &Rig, rows: &[Value]) -> Value {
    let feed = (rig.tip_mm[1].atan2(rig.tip_mm[0]) + 0.5 * TAU).to_degrees();
    json!({
        "calculator": "ring-roundness",
        "job": {
            "ring": {
                "radius_mm": rig.radius_mm,
                "harmonics": [{ "order": 2, "amplitude_um": round(500.0 * rig.ovality_mm, 6) }]
            },
            "supports": { "distance_mm": 2.0 * rig.support_b_mm[0], "depth_mm": -rig.support_b_mm[1] },
            "tool": {
                "x_mm": rig.tip_mm[0], "y_mm": rig.tip_mm[1], "feed_direction_deg": feed,
                "feed_mm_per_rev": rig.feed_mm_per_rev, "revolutions": rig.revolutions,
                "spark_out_revolutions": rig.spark_out
            }
        },
        "quantity": "radial_deviation_um",
        "measurements": rows
    })
}
