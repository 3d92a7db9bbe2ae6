//! A ring on a machine that swings: limits, the closed form of chatter opposite to a support, and the growth that the delay
//! equation shows when it is marched through time.
#![allow(clippy::unwrap_used, clippy::panic, missing_docs)]

use std::f64::consts::TAU;

use crate::draw::Draw;
use crate::ring_support::{codes, run};
use precut_calc::ring_roundness::{Outcome, SpeedMapOutcome};
use serde_json::{Value, json};

/// A ring of 150 mm at the angles asked for, centre in the origin at the end of the feed.
fn at_angles(beta_deg: f64, tool_deg: f64) -> Value {
    let (radius, travel) = (150.0, 0.01);
    let (beta, tool) = (beta_deg.to_radians(), tool_deg.to_radians());
    json!({
        "ring": { "radius_mm": radius },
        "supports": { "distance_mm": 2.0 * radius * beta.sin(), "depth_mm": radius * beta.cos() },
        "tool": {
            "x_mm": (radius + travel) * tool.cos(), "y_mm": (radius + travel) * tool.sin(),
            "feed_direction_deg": tool_deg + 180.0, "feed_mm_per_rev": travel, "revolutions": 1.0
        },
        "analyses": ["linear_theory"], "highest_order": 20
    })
}

/// A mode whose natural frequency is so many lobes at 60 rev/min, with the stiffness of the cut over its own.
fn mode(lobes: f64, ratio: f64, damping_ratio: f64) -> Value {
    json!({ "frequency_hz": lobes, "stiffness_n_per_mm": 1e4 / ratio, "damping_ratio": damping_ratio })
}

fn swinging(job: &Value, modes: Value) -> Value {
    let mut job = job.clone();
    job["dynamics"] = json!({ "cut_n_per_mm": 1e4, "work_speed_rpm": 60, "modes": modes });
    job
}

fn over_speeds(job: &Value, from: f64, to: f64, speeds: u32) -> SpeedMapOutcome {
    let mut job = job.clone();
    job["analyses"] = json!(["speed_map"]);
    job["speed_map"] = json!({ "from_rpm": from, "to_rpm": to, "speeds": speeds });
    run(&job).output.speed_map.unwrap()
}

/// Lobes and factor per revolution of the roots.
fn roots(outcome: &Outcome) -> Vec<(f64, f64)> {
    let linear = outcome.linear_theory.as_ref().unwrap();
    assert!(linear.complete);
    linear.roots.iter().map(|root| (root.lobes, root.factor_per_revolution)).collect()
}

/// Farthest that a root of the first has to the next of the second.
fn missed(wanted: &[(f64, f64)], found: &[(f64, f64)]) -> f64 {
    let near = |p: &(f64, f64)| found.iter().map(|q| (p.0 - q.0).hypot(p.1 - q.1)).fold(f64::INFINITY, f64::min);
    // At the edges of what is listed a root may fall out.
    wanted.iter().filter(|root| root.1 > 0.02 && root.0 < 20.0).map(near).fold(0.0, f64::max)
}

fn apart(p: &[f64], q: &[f64]) -> f64 {
    p.iter().zip(q).map(|(p, q)| (p - q).abs()).fold(0.0, f64::max)
}

#[test]
fn a_stiff_mode_leaves_the_geometry_and_a_fast_one_its_give_at_rest() {
    for (beta, tool) in [(30.0, 60.0), (25.0, 80.0), (40.0, 100.0)] {
        let mut job = at_angles(beta, tool);
        job["compliance_ratio"] = json!(0.4);
        let geometric = roots(&run(&job).output);
        // In proportion to the give as it vanishes: by the implicit function theorem.
        // Beside them the mode swings freely, a root of its own.
        let with =
            |ratio: f64| missed(&geometric, &roots(&run(&swinging(&job, json!([mode(6.3, ratio, 0.05)]))).output));
        let (near, nearer) = (with(1e-6), with(1e-7));
        assert!(near < 1e-4 && nearer < 0.11 * near + 1e-10, "{beta} {tool}: {near:e} {nearer:e}");
        // The first term that is left is 2 ζ λ/ν of the give.
        let mut soft = job.clone();
        soft["compliance_ratio"] = json!(0.7);
        let at_rest = roots(&run(&soft).output);
        let fast = |lobes: f64| {
            let found = run(&swinging(&job, json!([mode(lobes, 0.3, 0.03)]))).output;
            assert!((found.setting.compliance_ratio - 0.7).abs() < 1e-12);
            missed(&at_rest, &roots(&found))
        };
        let (near, nearer) = (fast(500.0), fast(4000.0));
        assert!(near < 0.05 && nearer < 0.15 * near, "{beta} {tool}: {near:e} {nearer:e}");
    }
}

/// Opposite to a support waves obey K e^{-πλ} = 1 + K beside the odd ones, which stay: chatter from cut to cut half a
/// revolution later. For one mode it begins at k_c w/k = 2 ζ (1 + ζ) (Tlusty), at (ω/ν)² = 1 + 2 ζ.
#[test]
fn opposite_to_a_support_chatter_begins_where_it_is_known_to() {
    let job = at_angles(42.0, 48.0);
    for damping in [0.02, 0.05, 0.1] {
        let limit = 2.0 * damping * (1.0 + damping);
        let map = |share: f64, speeds: u32| {
            over_speeds(&swinging(&job, json!([mode(20.0, share * limit, damping)])), 40.0, 90.0, speeds)
        };
        let worst = |map: &SpeedMapOutcome| {
            let grown = map.worst.iter().flatten().copied();
            grown.max_by(|p, q| p.factor_per_revolution.total_cmp(&q.factor_per_revolution)).unwrap()
        };
        let below = map(0.98, 101);
        // The odd waves stay, to the rounding of the angles.
        assert!((worst(&below).factor_per_revolution - 1.0).abs() < 1e-6 && !worst(&below).is_chatter);
        let above = map(1.06, 401);
        let chatter = worst(&above);
        assert!(chatter.is_chatter && chatter.factor_per_revolution > 1.0001, "{damping}: {chatter:?}");
        let expected_hz = 20.0 * (1.0 + 2.0 * damping).sqrt();
        assert!((chatter.frequency_hz / expected_hz - 1.0).abs() < 0.02, "{damping}: {chatter:?} {expected_hz}");
        // Lobes of the diagram: at the limit the phase of K/(1+K) is a whole number of turns in half a revolution.
        let x = 1.0 + 2.0 * damping;
        let k = limit / ((1.0 - x).powi(2) + 4.0 * damping * damping * x);
        let (re, im) = (k * (1.0 - x), -k * 2.0 * damping * x.sqrt());
        let phase = im.atan2(re) - im.atan2(1.0 + re);
        let half_turns = (chatter.lobes * std::f64::consts::PI - phase) / TAU;
        assert!((half_turns - half_turns.round()).abs() < 0.06, "{damping}: {half_turns}");
    }
}

/// A term K/P of the compliance, marched by the trapezoidal rule: state y, y' over t in radians of the ring.
struct Swing {
    ratio: f64,
    lobes: f64,
    damping: f64,
    y: f64,
    rate: f64,
    force: f64,
}

impl Swing {
    /// y after a step as a constant and a multiple of the force then.
    fn ahead(&self, dt: f64) -> (f64, f64) {
        // y'' = ν² (K h - y) - 2 ζ ν y', trapezoidal: solve for y.
        let (n2, c) = (self.lobes * self.lobes, 2.0 * self.damping * self.lobes);
        let half = 0.5 * dt;
        let before = n2 * (self.ratio * self.force - self.y) - c * self.rate;
        // y1 = y + half (v + v1), v1 = v + half (before + n2 (K h1 - y1) - c v1)
        let denominator = 1.0 + half * c + half * half * n2;
        let constant =
            (self.y * (1.0 + half * c) + half * self.rate * (2.0 + half * c) + half * half * before) / denominator;
        (constant, half * half * n2 * self.ratio / denominator)
    }

    fn step(&mut self, dt: f64, force: f64) {
        let (constant, multiple) = self.ahead(dt);
        let y = constant + multiple * force;
        self.rate = 2.0 * (y - self.y) / dt - self.rate;
        (self.y, self.force) = (y, force);
    }
}

/// Growth per revolution of waves with mean and eccentricity taken out, of the delay equation marched through time.
fn marched_factor(a: f64, b: f64, delays: [f64; 2], still: f64, mut modes: Vec<Swing>) -> f64 {
    const STEPS: usize = 4000;
    const REVOLUTIONS: usize = 120;
    let dt = TAU / STEPS as f64;
    let mut draw = Draw::new(5);
    let mut rho: Vec<f64> = (0..STEPS).map(|_| draw.between(-1.0, 1.0)).collect();
    let mut size = Vec::new();
    for revolution in 0..REVOLUTIONS {
        for _ in 0..STEPS {
            let n = rho.len();
            let back = |delay: f64| {
                let at = n as f64 - delay / dt;
                let (low, share) = (at.floor() as usize, at.fract());
                rho[low] * (1.0 - share) + rho[(low + 1).min(n - 1)] * share
            };
            let (copied, old) = (a * back(delays[0]) + b * back(delays[1]), rho[n - STEPS]);
            let (constant, multiple) =
                modes.iter().map(|mode| mode.ahead(dt)).fold((0.0, 0.0), |sum, part| (sum.0 + part.0, sum.1 + part.1));
            // ρ = copied + Σ y + K_0 h, h = ρ(t-2π) - ρ.
            let new = (copied + constant + (multiple + still) * old) / (1.0 + multiple + still);
            for mode in &mut modes {
                mode.step(dt, old - new);
            }
            rho.push(new);
        }
        let last = &rho[rho.len() - STEPS..];
        let wave = |k: f64| {
            let (mut x, mut y) = (0.0, 0.0);
            for (i, value) in last.iter().enumerate() {
                let (sin, cos) = (k * dt * i as f64).sin_cos();
                (x, y) = (x + value * cos, y + value * sin);
            }
            (x * 2.0 / STEPS as f64, y * 2.0 / STEPS as f64)
        };
        let ((mean, _), (x, y)) = (wave(0.0), wave(1.0));
        let rest = |(i, value): (usize, &f64)| {
            let (sin, cos) = (dt * i as f64).sin_cos();
            (value - 0.5 * mean - x * cos - y * sin).powi(2)
        };
        size.push(last.iter().enumerate().map(rest).sum::<f64>().sqrt());
        if revolution % 10 == 9 {
            rho.drain(..rho.len() - STEPS);
            let scale = 1.0 / size[size.len() - 1];
            for value in &mut rho {
                *value *= scale;
            }
            for mode in &mut modes {
                (mode.y, mode.rate, mode.force) = (mode.y * scale, mode.rate * scale, mode.force * scale);
            }
            for size in &mut size {
                *size *= scale;
            }
        }
    }
    (size[REVOLUTIONS - 1] / size[REVOLUTIONS - 61]).powf(1.0 / 60.0)
}

#[test]
fn waves_grow_as_the_marched_delay_equation_does() {
    let mut told = 0;
    for seed in 0..14 {
        let mut draw = Draw::new(300 + seed);
        let job = at_angles(draw.between(22.0, 55.0), draw.between(40.0, 140.0));
        let still = draw.between(0.1, 0.5);
        let modes: Vec<[f64; 3]> = (0..=seed % 2)
            .map(|_| [draw.between(4.0, 14.0), draw.between(0.3, 1.5), draw.between(0.02, 0.1)])
            .collect();
        let mut swings = swinging(&job, modes.iter().map(|[l, r, d]| mode(*l, *r, *d)).collect());
        swings["compliance_ratio"] = json!(still);
        let map = over_speeds(&swings, 59.0, 61.0, 3);
        let here = map.here.unwrap();
        let setting = run(&swings).output.setting;
        let swing = |[lobes, ratio, damping]: &[f64; 3]| Swing {
            ratio: *ratio,
            lobes: *lobes,
            damping: *damping,
            y: 0.0,
            rate: 0.0,
            force: 0.0,
        };
        let delays = [setting.delay_a_deg, setting.delay_b_deg].map(f64::to_radians);
        let marched = marched_factor(
            setting.coefficient_a,
            setting.coefficient_b,
            delays,
            still,
            modes.iter().map(swing).collect(),
        );
        // The worst wave leads after 60 revolutions where it grows by more than a few hundredths.
        if here.factor_per_revolution < 1.03 {
            continue;
        }
        told += 1;
        // The trapezoidal rule and the interpolation err by (lobes·dt)²/12, some 1e-4 a radian of ωt.
        let off = (marched.ln() - here.factor_per_revolution.ln()).abs();
        assert!(off < 0.02 + 0.05 * here.factor_per_revolution.ln(), "{seed}: {marched} {here:?}");
    }
    assert!(told >= 8, "{told}");
}

#[test]
fn the_map_says_what_each_of_its_speeds_says_alone() {
    let mut job = swinging(
        &at_angles(30.0, 66.0),
        json!([mode(9.0, 0.8, 0.04), { "at": "support_a", "frequency_hz": 31, "stiffness_n_per_mm": 15_000, "damping_ratio": 0.03 }]),
    );
    job["compliance_ratio"] = json!(0.2);
    let map = over_speeds(&job, 30.0, 120.0, 6);
    let columns = map.work_speed_rpm.len();
    for (i, speed) in map.work_speed_rpm.iter().enumerate() {
        let mut alone = job.clone();
        alone["dynamics"]["work_speed_rpm"] = json!(speed);
        alone["analyses"] = json!(["linear_theory", "speed_map"]);
        let answer = run(&alone);
        let here = answer.output.speed_map.as_ref().unwrap().here.unwrap();
        let worst = map.worst[i].unwrap();
        assert!((here.lobes - worst.lobes).abs() < 1e-6, "{here:?} {worst:?}");
        assert!((here.factor_per_revolution - worst.factor_per_revolution).abs() < 1e-9);
        let warned = answer.warnings.iter().any(|warning| warning.code == "machine_chatters");
        assert_eq!(warned, here.is_chatter, "{speed}");
        // Row by row it is what the linear theory lists, as long as a row is one order.
        let linear = answer.output.linear_theory.unwrap();
        for order in linear.orders.iter().filter(|order| f64::from(order.order) < 20.0) {
            let row = map.lobes_from.iter().position(|from| *from == order.order);
            let Some(row) = row.filter(|row| map.lobes_to[*row] == order.order) else { continue };
            match (map.factor_per_revolution[row * columns + i], order.factor_per_revolution) {
                (Some(p), Some(q)) => assert!(p <= q + 1e-9, "{speed} {}: {p} {q}", order.order),
                (Some(p), None) => panic!("{speed} {}: {p}", order.order),
                (None, _) => {}
            }
        }
    }
    let best = map.best.unwrap();
    let factors = map.worst.iter().flatten().map(|cell| cell.factor_per_revolution);
    assert!((best.factor_per_revolution - factors.fold(f64::INFINITY, f64::min)).abs() < 1e-12);
}

#[test]
fn a_mirrored_machine_chatters_alike() {
    let at =
        |place: &str| json!([{ "at": place, "frequency_hz": 12, "stiffness_n_per_mm": 9000, "damping_ratio": 0.04 }]);
    let mut job = swinging(&at_angles(30.0, 66.0), at("support_a"));
    let mut mirrored = swinging(&at_angles(30.0, 114.0), at("support_b"));
    mirrored["rotation"] = json!("clockwise");
    for job in [&mut job, &mut mirrored] {
        job["compliance_ratio"] = json!(0.3);
    }
    let (p, q) = (over_speeds(&job, 40.0, 80.0, 5), over_speeds(&mirrored, 40.0, 80.0, 5));
    let factors =
        |map: &SpeedMapOutcome| map.worst.iter().map(|cell| cell.unwrap().factor_per_revolution).collect::<Vec<_>>();
    assert!(apart(&factors(&p), &factors(&q)) < 1e-9, "{p:?} {q:?}");
}

#[test]
fn what_is_missing_or_beyond_is_refused() {
    let mut job = at_angles(30.0, 60.0);
    job["analyses"] = json!(["speed_map"]);
    assert_eq!(codes(&job), ["dynamics_missing"]);
    let mut job = swinging(&job, json!([mode(300.0, 0.5, 0.05)]));
    job["dynamics"]["work_speed_rpm"] = json!(3.6);
    assert_eq!(codes(&job), Vec::<&str>::new());
    job["dynamics"]["work_speed_rpm"] = json!(3.59);
    assert_eq!(codes(&job), ["mode_beyond_orders"]);
    job["dynamics"]["work_speed_rpm"] = json!(60);
    job["speed_map"] = json!({ "from_rpm": 130 });
    assert_eq!(codes(&job), ["range_empty"]);
}
