//! Slow cuts: hundreds of oscillations from tooth to tooth.
#![allow(clippy::unwrap_used, clippy::panic, clippy::print_stdout, missing_docs)]

use std::sync::atomic::{AtomicUsize, Ordering};

use crate::draw::Draw;
use crate::fixture_support::{checked, example, outcome, said, solve, with};
use precut_calc::calculator::{Calculator, Failure, Figure, Message, Monitor};
use precut_calc::fixture_stability::{FixtureOutcome, FixtureStability, FixtureState, multiplier_modulus};
use serde_json::{Value, json};

/// The first example at another speed, with as many teeth and such a strip.
fn at(rpm: f64, depth_mm: f64) -> Value {
    let mut job = example("paper");
    job["cut"]["spindle_speed_rpm"] = json!(rpm);
    job["cut"]["depth_mm"] = json!(depth_mm);
    job["analyses"] = json!(["verdict"]);
    job.as_object_mut().unwrap().remove("limits");
    job
}

/// Speed at which so many oscillations go into a tooth period.
fn slow_rpm(job: &Value, oscillations: f64) -> f64 {
    let hz = outcome(job).modes.last().unwrap().natural_frequency_hz;
    60.0 * hz / (oscillations * job["cutter"]["teeth"].as_f64().unwrap())
}

/// Spectral elements below 120 oscillations, the closed form from there on: the modulus goes on within both errors.
#[test]
fn the_closed_form_goes_on_where_elements_end() {
    let mut pneumatic = with(&example("pneumatic"), "/analyses", json!(["verdict"]));
    pneumatic["cut"].as_object_mut().unwrap().retain(|key, _| key != "speed_m_per_min" && key != "feed_mm_per_min");
    pneumatic["cut"]["feed_mm_per_tooth"] = json!(0.04);
    pneumatic["cut"]["spindle_speed_rpm"] = json!(200);
    // Damped so that its slower mode dies out in a slow tooth period, too.
    pneumatic["fixture"]["movable_joint"]["damping_n_s_per_mm"] = json!(1.0);
    let mut slot = at(200.0, 2.0);
    slot["cut"]["width_mm"] = json!(100);
    for job in [at(200.0, 3.0), at(200.0, 4.0), slot, pneumatic] {
        let of = |oscillations: f64| {
            let there = with(&job, "/cut/spindle_speed_rpm", json!(slow_rpm(&job, oscillations)));
            multiplier_modulus(&checked(&there).unwrap()).unwrap()
        };
        let ((elements, small), (closed, error)) = (of(119.9), of(120.1));
        assert!(small < 1e-3 * error && error < 0.02 * closed, "{small} {error}");
        // What differs besides is the phase at which neighbouring lobes cross: the closed form takes the worst.
        assert!((elements / closed - 1.0).abs() < error / closed, "{elements} {closed} {error}: {job}");
    }
}

/// |mu| of a workpiece with one mode by the equation of the page itself, at hundreds of places and phases.
fn dense_modulus(job: &Value, natural_rad_per_s: f64, damping_ratio: f64) -> f64 {
    const PLACES: u32 = 200;
    const PHASES: u32 = 180;
    let number = |pointer: &str| job.pointer(pointer).unwrap().as_f64().unwrap();
    let pitch = std::f64::consts::TAU / number("/cutter/teeth");
    let half = 0.5 * number("/cut/width_mm");
    let offset = number("/cut/offset_mm");
    let radius = 0.5 * number("/cutter/diameter_mm");
    let arc = [((offset + half) / radius).min(1.0).acos(), ((offset - half) / radius).max(-1.0).acos()];
    let (k, rho) = (number("/force/chip_thickness_exponent"), number("/force/radial_ratio"));
    let stiffness: f64 =
        number("/fixture/movable_joint/stiffness_n_per_mm") + number("/fixture/fixed_joint/stiffness_n_per_mm");
    let level =
        (1.0 - k) * number("/force/coefficient") * number("/cut/depth_mm") * number("/cut/feed_mm_per_tooth").powf(-k);
    let slope = |since: f64| -> f64 {
        let teeth =
            (0..40).map(|tooth| since + f64::from(tooth) * pitch).filter(|angle| (arc[0]..arc[1]).contains(angle));
        teeth.map(|angle| level / stiffness * angle.sin().powf(1.0 - k) * (angle.cos() + rho * angle.sin())).sum()
    };
    let mut ends = [0.0, arc[0] % pitch, arc[1] % pitch, pitch];
    ends.sort_by(f64::total_cmp);
    let seconds_per_rad = 60.0 / (number("/cut/spindle_speed_rpm") * std::f64::consts::TAU);
    let places: Vec<(f64, f64)> = ends
        .windows(2)
        .flat_map(|pair| {
            let step = (pair[1] - pair[0]) / f64::from(PLACES);
            (0..PLACES).map(move |i| (pair[0] + (f64::from(i) + 0.5) * step, step))
        })
        .map(|(since, step)| (slope(since), step * seconds_per_rad))
        .collect();
    // s^2 + 2 zeta w s + w^2 (1 + (1 - 1/mu) W/C) = 0: the root with the larger real part, integrated over a tooth period.
    let growth = |ln_modulus: f64, phase: f64| -> f64 {
        let (re, im) = (1.0 - (-ln_modulus).exp() * phase.cos(), (-ln_modulus).exp() * phase.sin());
        let of = |(slope, seconds): &(f64, f64)| {
            let (a, b) = (damping_ratio * damping_ratio - 1.0 - slope * re, -slope * im);
            natural_rad_per_s * ((0.5 * (a.hypot(b) + a)).max(0.0).sqrt() - damping_ratio) * seconds
        };
        places.iter().map(of).sum()
    };
    let fastest = |ln_modulus: f64| {
        let step = std::f64::consts::PI / f64::from(PHASES);
        let all: Vec<f64> = (0..=PHASES).map(|i| growth(ln_modulus, f64::from(i) * step)).collect();
        let best = (0..all.len()).max_by(|a, b| all[*a].total_cmp(&all[*b])).unwrap();
        let neighbours = best.checked_sub(1).zip(all.get(best + 1));
        // The vertex of the parabola through the largest and its neighbours.
        neighbours.map_or(all[best], |(before, after)| {
            let bend = all[before] - 2.0 * all[best] + after;
            all[best] - (all[before] - after).powi(2) / (8.0 * bend.min(-1e-300))
        })
    };
    let (mut low, mut high) = (-30.0, 690.0);
    for _ in 0..34 {
        let middle = 0.5 * (low + high);
        if fastest(middle) > middle { low = middle } else { high = middle }
    }
    (0.5_f64 * (low + high)).exp()
}

/// The error that is told holds, for one mode: the same equation at many times as many places and phases, of drawn cuts.
#[test]
fn the_error_of_a_slow_modulus_holds() {
    let mut draw = Draw::new(34);
    let count = std::env::var("PRECUT_SLOW").ok().and_then(|count| count.parse().ok()).unwrap_or(12);
    let mut missed = 0;
    for _ in 0..count {
        let mut job = at(200.0, draw.between(0.3, 4.0));
        job["cutter"]["teeth"] = json!(draw.between(2.0, 12.0) as u32);
        job["cut"]["width_mm"] = json!(draw.between(20.0, 100.0));
        job["cut"]["offset_mm"] = json!(draw.between(-20.0, 20.0));
        job["force"]["chip_thickness_exponent"] = json!(draw.between(0.0, 0.5));
        job["fixture"]["movable_joint"]["damping_n_s_per_mm"] = json!(draw.between(0.8, 4.0));
        let oscillations = 200.0 * draw.between(0.0, 4.0).exp();
        let number = |pointer: &str| job.pointer(pointer).unwrap().as_f64().unwrap();
        let both = |field: &str| {
            ["movable_joint", "fixed_joint"]
                .map(|joint| number(&format!("/fixture/{joint}/{field}")))
                .iter()
                .sum::<f64>()
        };
        let mass = number("/fixture/workpiece_mass_kg");
        let natural = (1e3 * both("stiffness_n_per_mm") / mass).sqrt();
        let damping_ratio = 1e3 * both("damping_n_s_per_mm") / (2.0 * mass * natural);
        let rpm = 60.0 * natural / (std::f64::consts::TAU * oscillations * number("/cutter/teeth"));
        let job = with(&job, "/cut/spindle_speed_rpm", json!(rpm));
        let (modulus, error) = multiplier_modulus(&checked(&job).unwrap()).unwrap();
        let off = (modulus - dense_modulus(&job, natural, damping_ratio)).abs();
        missed += i32::from(off > error);
        if count > 12 {
            let of_form = modulus * (1.0 / (std::f64::consts::TAU * oscillations));
            println!("{oscillations:.0} |mu| {modulus:.6} off {off:.2e} told {error:.2e} form >= {of_form:.2e}");
        }
        assert!(modulus < 1e-12 || error < 0.05 * modulus, "{modulus} {error}: {job}");
    }
    assert_eq!(missed, 0, "of {count}");
}

/// The limit follows from the circle criterion: below it nothing grows at any speed, for 0 <= W <= its largest value.
#[test]
fn the_slowest_cut_is_limited_by_its_stiffest_chip() {
    let job = at(0.1, 1.0);
    let got = outcome(&job);
    let mode = &got.modes[0];
    let stiffness: f64 = ["movable_joint", "fixed_joint"]
        .iter()
        .map(|joint| job["fixture"][joint]["stiffness_n_per_mm"].as_f64().unwrap())
        .sum();
    // Largest slope over the arc per mm of depth, by a scan of its angles.
    let (k, rho) = (0.3291, 0.6);
    let per_mm = 1186.0 * (1.0 - k) * 0.039_f64.powf(-k);
    let entry = std::f64::consts::FRAC_PI_3;
    let shape = |angle: f64| angle.sin().powf(1.0 - k) * (angle.cos() + rho * angle.sin());
    let stiffest = (0..4000)
        .map(|i| f64::from(i) / 4000.0 * std::f64::consts::FRAC_PI_4)
        .map(|since| {
            let second = entry + since + std::f64::consts::FRAC_PI_4;
            shape(entry + since) + if second < 2.0 * entry { shape(second) } else { 0.0 }
        })
        .fold(0.0, f64::max);
    let zeta = mode.damping_ratio;
    let least = 2.0 * stiffness * zeta * (1.0 + zeta) / (per_mm * stiffest);
    let limit = got.chatter_depth_mm.unwrap();
    assert!(limit > least && limit < 1.03 * least, "{limit} {least}");
    // The sooner the next tooth comes, the less time there is to grow before it.
    let limits: Vec<f64> = [0.5, 1.0, 5.0, 20.0].map(|rpm| outcome(&at(rpm, 1.0)).chatter_depth_mm.unwrap()).into();
    assert!(limits[0] > limit && limits.is_sorted() && limits[3] < 3.53, "{limits:?}");
}

/// Every analysis of a slow cut answers, and says what is not simulated.
#[test]
fn slow_cuts_are_answered_in_full() {
    for (rpm, depth_mm) in [(0.1, 1.0), (0.5, 3.0), (1.0, 1.0), (5.0, 1.5)] {
        let mut job = at(rpm, depth_mm);
        job["analyses"] = json!(["verdict", "clamp_force", "limits", "history", "lobes"]);
        job["lobes"] = json!({ "speeds": 8 });
        job["limits"] = json!({ "depths": 6 });
        let answer = solve(&job);
        let got = &answer.output;
        assert!(got.simulation.is_none() && got.history.is_none());
        let is_stable = depth_mm < got.chatter_depth_mm.unwrap();
        assert_eq!(got.verdict.state == FixtureState::Stable, is_stable, "{rpm}: {:?}", got.verdict);
        assert!(said(&answer, "fixture_slow_cut").is_some());
        assert_eq!(said(&answer, "fixture_grows_within").is_some(), got.multiplier.modulus < 1.0 && !is_stable);
        let clamp = got.clamp.as_ref().unwrap();
        assert_eq!(clamp.least_n.is_some(), is_stable);
        if is_stable {
            assert!(clamp.least_n.unwrap() > clamp.static_fixed_n, "{clamp:?}");
        }
    }
}

/// After every entry the workpiece rings, then follows the force: the motion of a slower cut is that of a faster one, at the same
/// angles, once the ringing takes no time.
#[test]
fn the_motion_of_a_slow_cut_is_that_of_elements() {
    let spans =
        |of: &FixtureOutcome| (of.forced.peak_to_peak_um, of.forced.clamp_fixed_n, of.forced.displacement_min_um);
    let job = at(200.0, 1.0);
    let of =
        |oscillations: f64| spans(&outcome(&with(&job, "/cut/spindle_speed_rpm", json!(slow_rpm(&job, oscillations)))));
    let (fast, slow) = (of(119.9), of(120.1));
    for (a, b) in [(fast.0, slow.0), (fast.1, slow.1), (fast.2, slow.2)] {
        // The speed differs by 0.17 %, and with it how far the force goes on while the first swing lasts.
        assert!((a / b - 1.0).abs() < 1e-4, "{a} {b}");
    }
    // A step of the force answered by one mode: the first swing is exp(-pi zeta/root(1 - zeta^2)) of the step beyond it.
    let mut slot = at(0.1, 0.5);
    slot["cutter"]["teeth"] = json!(1);
    slot["force"]["chip_thickness_exponent"] = json!(0);
    let got = outcome(&slot);
    let (zeta, entry) = (got.modes[0].damping_ratio, std::f64::consts::FRAC_PI_3);
    let shape = |angle: f64| angle.sin() * (angle.cos() + 0.6 * angle.sin());
    let static_um = 1e3 * 1186.0 * 0.039 * 0.5 * shape(entry) / (10830.0 + 32510.0);
    let swing = (-std::f64::consts::PI * zeta / (1.0 - zeta * zeta).sqrt()).exp();
    let wanted = static_um * (1.0 + swing);
    assert!((got.forced.displacement_max_um / wanted - 1.0).abs() < 1e-4, "{:?} {wanted}", got.forced);
}

/// Cancels after so many looks.
struct Impatient {
    looks: AtomicUsize,
    most: usize,
}

impl Monitor for Impatient {
    fn cancelled(&self) -> bool {
        self.looks.fetch_add(1, Ordering::Relaxed) >= self.most
    }
    fn progress(&self, _: f64, _: Message) {}
    fn interim(&self, _: Figure) {}
}

#[test]
fn a_cancelled_slow_cut_stops_wherever_it_is() {
    let mut job = at(0.1, 1.0);
    job["analyses"] = json!(["clamp_force", "limits", "lobes"]);
    let job = checked(&job).unwrap();
    for most in [0, 1, 20, 200, 2000, 20_000] {
        let watch = Impatient { looks: AtomicUsize::new(0), most };
        assert_eq!(FixtureStability::run(&job, &watch), Err(Failure::Cancelled), "{most}");
        // Work that goes on side by side asks once more each.
        assert!(watch.looks.into_inner() < most + 64, "{most}");
    }
}

/// What it costs does not grow with the time from tooth to tooth.
#[test]
fn a_slower_cut_costs_no_more() {
    let cost = |rpm: f64| FixtureStability::cost(&checked(&at(rpm, 1.0)).unwrap());
    let (slow, slower) = (cost(5.0), cost(0.1));
    assert!(slower.ms < 1.01 * slow.ms && slow.ms < 1000.0 && slower.bytes < 1 << 22, "{slow:?} {slower:?}");
    // Joints that harden answer to the motion: such a cut is followed in time, and its cost is told.
    let mut hard = at(0.1, 1.0);
    hard["effects"] = json!([{ "kind": "contact_hardening", "cubic_per_mm2": 1.0 }]);
    assert!(FixtureStability::cost(&checked(&hard).unwrap()).ms > 3.6e6);
}
