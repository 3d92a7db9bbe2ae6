//! Sides that are given by measured frequency responses: the same cut as with the modes behind them, the error of the fit, and what
//! is refused.
#![allow(clippy::unwrap_used, clippy::panic, clippy::cast_precision_loss, missing_docs)]

use std::f64::consts::TAU;
use std::fmt::Write as _;
use std::fs;
use std::path::PathBuf;

use nalgebra::Complex;
use precut_calc::calculator::{Calculator, Failure, Unwatched};
use precut_calc::milling_stability::{MillingStability, ReceptanceLimit, YieldingSide};
use precut_calc::num::stats::Resampler;
use serde_json::{Value, json};

use crate::milling_answers::{Told, example, faults, merged, solve};

/// Receptance in m/N of the modes of a job, each with a phase by which its residue leaves that of a real mode.
fn receptance(modes: &Value, (p, q): (usize, usize), hz: f64, phase_deg: f64) -> Complex<f64> {
    let w = TAU * hz;
    let of = |mode: &Value| {
        let number = |name: &str| mode[name].as_f64().unwrap();
        let (w_k, zeta) = (TAU * number("frequency_hz"), number("damping_ratio"));
        let mass = mode["mass_kg"].as_f64().unwrap_or_else(|| 1e3 * number("stiffness_n_per_mm") / (w_k * w_k));
        let d: Vec<f64> = (0..3).map(|i| mode["direction"][i].as_f64().unwrap()).collect();
        let length = d.iter().map(|x| x * x).sum::<f64>().sqrt();
        let share = d[p] * d[q] / (length * length * mass);
        // R exp(i phase) and its conjugate over the pole and its own.
        let (damped, decay) = (w_k * (1.0 - zeta * zeta).sqrt(), zeta * w_k);
        let residue = Complex::from_polar(share / (2.0 * damped), phase_deg.to_radians()) * Complex::new(0.0, -1.0);
        let pole = Complex::new(-decay, damped);
        let s = Complex::new(0.0, w);
        residue / (s - pole) + residue.conj() / (s - pole.conj())
    };
    modes.as_array().unwrap().iter().map(of).sum()
}

/// How functions are made of modes.
#[derive(Clone, Copy)]
struct Struck<'a> {
    /// Response and excitation, 0 for X.
    pairs: &'a [(usize, usize)],
    step_hz: f64,
    lines: usize,
    phase_deg: f64,
    /// Share of the root mean square.
    noise: f64,
}

const ALONG: Struck<'_> = Struck { pairs: &[(0, 0), (1, 1)], step_hz: 4.0, lines: 700, phase_deg: 0.0, noise: 0.0 };

/// A side by its functions, um/N as CSV.
fn measured(modes: &Value, struck: &Struck<'_>) -> Value {
    let mut draw = Resampler::new(17, 5);
    let file = |&(p, q): &(usize, usize)| {
        let hz: Vec<f64> = (1..=struck.lines).map(|i| 60.0 + struck.step_hz * i as f64).collect();
        let exact: Vec<Complex<f64>> = hz.iter().map(|f| receptance(modes, (p, q), *f, struck.phase_deg)).collect();
        let rms = (exact.iter().map(Complex::norm_sqr).sum::<f64>() / hz.len() as f64).sqrt();
        let mut text = "frequency [Hz],real [um/N],imaginary [um/N]\n".to_owned();
        for (f, value) in hz.iter().zip(exact) {
            let off = Complex::new(draw.normal(), draw.normal()) * (struck.noise * rms / 2.0_f64.sqrt());
            let value = (value + off) * 1e6;
            writeln!(text, "{f},{:.12e},{:.12e}", value.re, value.im).unwrap();
        }
        let axes = ["x", "y", "z"];
        json!({ "text": text, "response": axes[p], "excitation": axes[q] })
    };
    json!({ "kind": "receptances", "files": struck.pairs.iter().map(file).collect::<Vec<_>>(), "residuals": "none" })
}

/// A job with a side measured in place of its modes.
fn with_measured(job: &Value, side: &str, struck: &Struck<'_>) -> Value {
    let mut other = job.clone();
    other[side] = measured(&job[side]["modes"], struck);
    other
}

fn near(a: f64, b: f64, within: f64) -> bool {
    (a / b - 1.0).abs() < within
}

fn limits(told: &Told) -> (f64, f64) {
    (told.outcome.first_limit_mm.unwrap(), told.outcome.limit_by_receptance_mm.unwrap())
}

/// Functions without noise give the cut of the modes behind them: multiplier, limit, what limits; and the lines themselves the limit
/// that the modes have, which another method found.
#[test]
fn measured_functions_give_the_cut_of_their_modes() {
    let asked = json!({ "analyses": ["verdict", "intervals"], "limits": { "depth_max_mm": 8 } });
    let job = merged(example("two_modes"), &asked);
    let known = solve(&job).outcome;
    let told = solve(&with_measured(&job, "tool", &ALONG));
    let found = &told.outcome;
    let modulus = [&known, found].map(|of| of.multiplier.as_ref().unwrap().modulus);
    assert!(near(modulus[1], modulus[0], 1e-6) && near(modulus[0], 1.315_233_515, 1e-6), "{modulus:?}");
    let (limit, direct) = limits(&told);
    assert!(near(limit, known.first_limit_mm.unwrap(), 1e-6), "{limit}");
    // Half a percent is what harmonics are added for.
    assert!(near(direct, limit, 5e-3), "{direct} {limit}");
    let rigid = [&known, found].map(|of| of.limited_by.as_ref().unwrap().x_rigid_limit_mm.unwrap());
    assert!(near(rigid[1], rigid[0], 1e-6), "{rigid:?}");
    let side = &found.measured[0];
    assert_eq!((side.side, side.certainty.len(), side.rigid_directions.len()), (YieldingSide::Tool, 4, 1));
    assert!(side.largest_residual_share < 1e-6, "{}", side.largest_residual_share);
    assert!(told.says("side_is_measured") && told.says("measured_side_is_rigid") && told.says("limit_by_receptance"));
    assert!(!told.warns("fit_changes_limit"));
}

/// Both sides together, one measured and one stated, or both measured, with functions across; which of them limits is the same.
#[test]
fn measured_and_stated_sides_are_coupled() {
    let mut job =
        merged(example("wall"), &json!({ "analyses": ["verdict", "intervals"], "limits": { "depth_max_mm": 12 } }));
    job["tool"]["modes"][0]["direction"] = json!([1.0, 0.4, 0.0]);
    job["tool"]["modes"][1]["direction"] = json!([-0.3, 1.0, 0.0]);
    job["work"]["modes"][0]["direction"] = json!([0.2, 1.0, 0.0]);
    let known = solve(&job).outcome;
    let all = Struck { pairs: &[(0, 0), (1, 1), (0, 1)], ..ALONG };
    let work = with_measured(&job, "work", &all);
    let both = with_measured(&work, "tool", &all);
    for other in [work, both] {
        let told = solve(&other);
        let found = &told.outcome;
        let (limit, direct) = limits(&told);
        assert!(near(limit, known.first_limit_mm.unwrap(), 1e-5), "{limit} {:?}", known.first_limit_mm);
        assert!(near(direct, limit, 5e-3), "{direct} {limit}");
        let rigid = |of: &precut_calc::milling_stability::RigidLimits| [of.tool_rigid_limit_mm, of.work_rigid_limit_mm];
        let sides = [&known, found].map(|of| rigid(of.limited_by.as_ref().unwrap()));
        for (a, b) in sides[0].into_iter().zip(sides[1]) {
            assert!(a.zip(b).map_or(a == b, |(a, b)| near(a, b, 1e-5)), "{sides:?}");
        }
        let energy = |of: &precut_calc::milling_stability::Outcome| -> f64 {
            let shares = of.modes.iter().filter(|mode| mode.side == YieldingSide::Work);
            shares.map(|mode| mode.energy_share.unwrap()).sum()
        };
        assert!(near(energy(found), energy(&known), 1e-4), "{} {}", energy(found), energy(&known));
    }
}

/// The limit by lines against the limit by modes, which Floquet multipliers have: other cutters, helical, with process damping, with
/// the feed turned, at half of the speed.
#[test]
fn the_limit_by_lines_is_that_of_multipliers() {
    let job = merged(example("two_modes"), &json!({ "analyses": ["intervals"], "limits": { "depth_max_mm": 10 } }));
    let rubbing = json!({ "coefficient_n_per_mm": 400.0, "source": "measured" });
    for patch in [
        json!({ "cutter": { "helix_angle_deg": 35 } }),
        json!({ "cutter": { "teeth": 4 }, "cut": { "milling": "up", "width_mm": 4.0 } }),
        json!({ "cut": { "spindle_speed_rpm": 6000, "width_mm": 2.0 }, "process_damping": rubbing }),
        json!({ "cut": { "feed_direction_deg": 35 } }),
        // An island of flips is met, too.
        json!({ "cut": { "spindle_speed_rpm": 14_000, "width_mm": 1.5 }, "cutter": { "helix_angle_deg": 30 } }),
    ] {
        let told = solve(&with_measured(&merged(job.clone(), &patch), "tool", &ALONG));
        let outcome = &told.outcome;
        match (outcome.first_limit_mm, outcome.limit_by_receptance_mm) {
            (Some(limit), Some(direct)) => assert!(near(direct, limit, 6e-3), "{patch}: {direct} {limit}"),
            (limit, direct) => assert_eq!(limit, direct, "{patch}"),
        }
    }
}

/// With noise the modes are known to their standard errors, and the limit to what follows from them.
#[test]
fn the_error_of_the_fit_is_told() {
    let job = merged(example("two_modes"), &json!({ "analyses": ["intervals"], "limits": { "depth_max_mm": 4 } }));
    let noisy = Struck { noise: 0.01, ..ALONG };
    let told = solve(&with_measured(&job, "tool", &noisy));
    let side = &told.outcome.measured[0];
    // Noise of 1 % of the root mean square is what is left.
    assert!(near(side.largest_residual_share, 0.01, 0.1), "{}", side.largest_residual_share);
    for (mode, known) in told.outcome.modes.iter().zip(&side.certainty) {
        let truth = job["tool"]["modes"].as_array().unwrap().iter().map(|mode| mode["frequency_hz"].as_f64().unwrap());
        let off = truth.map(|hz| (mode.frequency_hz - hz).abs()).fold(f64::INFINITY, f64::min);
        // Four standard errors of one draw.
        assert!(off < 4.0 * known.frequency_error_hz && known.frequency_error_hz > 0.0, "{mode:?} {known:?}");
    }
    let (limit, direct) = limits(&told);
    // Masses and dampings are known to about a percent, the depth goes with both.
    assert!(near(limit, 0.913_07, 0.05) && near(direct, limit, 0.05), "{limit} {direct}");
}

/// Modes whose residues are complex are no real modes: the lines have another limit, and it is warned of.
#[test]
fn modes_that_do_not_meet_the_lines_are_warned_of() {
    let job = merged(example("two_modes"), &json!({ "analyses": ["intervals"], "limits": { "depth_max_mm": 6 } }));
    let at = |phase_deg: f64| solve(&with_measured(&job, "tool", &Struck { phase_deg, ..ALONG }));
    let (slight, twisted) = (at(1.0), at(40.0));
    assert!(!slight.warns("fit_changes_limit") && !slight.warns("modes_not_proportional"));
    assert!(twisted.warns("fit_changes_limit") && twisted.warns("modes_not_proportional"));
    let (limit, direct) = limits(&twisted);
    assert!((direct / limit - 1.0).abs() > 0.05, "{direct} {limit}");
    let warning = twisted.warnings.iter().find(|warning| warning.code == "modes_not_proportional").unwrap();
    assert_eq!(warning.pointer, "/tool/files");
}

/// A universal file and CSV with the same numbers make the same answer; the fit is that of the reference.
#[test]
fn the_reference_functions_are_taken_in_every_form() {
    let folder = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("reference/milling");
    let text = |name: &str| String::from_utf8(fs::read(folder.join(name)).unwrap()).unwrap();
    let job = |name: &str| {
        let mut job = merged(example("two_modes"), &json!({ "analyses": ["verdict"] }));
        job["tool"] = json!({ "kind": "receptances", "files": [{ "text": text(name) }], "modes": 2 });
        solve(&job).outcome
    };
    let (csv, uff) = (job("frf-P01.csv"), job("frf-P01-ascii.uff"));
    for (of, hz) in csv.modes.iter().zip([456.787_495_695_891_5, 1_448.891_774_767_629_8]) {
        assert!(near(of.frequency_hz, hz, 1e-5), "{of:?}");
    }
    // The ASCII file has 11 digits.
    let modulus = [csv, uff].map(|of| of.multiplier.unwrap().modulus);
    assert!(near(modulus[0], modulus[1], 1e-6), "{modulus:?}");
}

/// Faults of a file are named inside the side that it belongs to; functions without a mode, and a cut that their modes make too dear,
/// are refused when they are known.
#[test]
fn what_is_wrong_with_a_function_is_told_at_its_place() {
    let job = merged(example("two_modes"), &json!({ "analyses": ["verdict"] }));
    let with = |side: &str, of: Value| {
        let mut other = job.clone();
        other[side] = of;
        other
    };
    let no_unit = "frequency [Hz],real,imaginary\n1,2,3\n";
    for (side, of, code, pointer) in [
        (
            "work",
            json!({ "kind": "receptances", "files": [{ "text": no_unit }] }),
            "unit_missing",
            "/work/files/0/text",
        ),
        ("tool", json!({ "kind": "receptances", "files": [{}] }), "file_missing", "/tool/files/0"),
    ] {
        let found = faults(&with(side, of));
        assert_eq!((found[0].code, found[0].pointer.as_str()), (code, pointer), "{found:?}");
    }
    let across = Struck { pairs: &[(0, 1)], ..ALONG };
    let mut oblique = job.clone();
    oblique["tool"]["modes"][0]["direction"] = json!([1.0, 1.0, 0.0]);
    let found = faults(&with_measured(&oblique, "tool", &across));
    assert_eq!(found.iter().map(|fault| fault.code).collect::<Vec<_>>(), ["no_direct_function"]);
    let refused = |job: &Value| {
        assert!(faults(job).is_empty(), "{:?}", faults(job));
        let mut job: <MillingStability as Calculator>::Input = serde_json::from_value(job.clone()).unwrap();
        MillingStability::fill(&mut job);
        match MillingStability::run(&job, &Unwatched) {
            Err(Failure::OutOfModel(finding)) => (finding.code, finding.pointer),
            other => panic!("{other:?}"),
        }
    };
    let flat: String = (1..60).fold("frequency [Hz],real [um/N],imaginary [um/N]\n".to_owned(), |text, k| {
        text + &format!("{},{},0.0\n", 10 * k, if k % 2 == 0 { 0.1 } else { -0.1 })
    });
    let none = with("tool", json!({ "kind": "receptances", "files": [{ "text": flat }] }));
    assert_eq!(refused(&none), ("no_mode_seen", "/tool/files/0".to_owned()));
    let slow = merged(
        job.clone(),
        &json!({ "cutter": { "teeth": 8 }, "cut": { "spindle_speed_rpm": 0.1 }, "analyses": ["proposals"] }),
    );
    let (code, pointer) = refused(&with_measured(&slow, "tool", &ALONG));
    assert_eq!((code, pointer.as_str()), ("too_expensive", "/cut/spindle_speed_rpm"));
}

/// Where the lines are not solved themselves the reason is told.
#[test]
fn why_there_is_no_limit_by_lines_is_said() {
    let job = merged(example("two_modes"), &json!({ "analyses": ["intervals"], "limits": { "depth_max_mm": 2 } }));
    let pitch = json!({ "cutter": { "pitch_deg": [170, 190] } });
    let slow = json!({ "cut": { "spindle_speed_rpm": 3000 } });
    for (patch, why) in [(pitch, ReceptanceLimit::UnevenTeeth), (slow, ReceptanceLimit::TooSlow)] {
        let told = solve(&with_measured(&merged(job.clone(), &patch), "tool", &ALONG));
        assert_eq!((told.outcome.receptance_limit, told.outcome.limit_by_receptance_mm), (Some(why), None));
        assert!(told.says("receptance_not_solved") && !told.says("limit_by_receptance"));
    }
    assert!(solve(&job).outcome.receptance_limit.is_none());
}
