//! Other cutters and a varying speed, each tried: what they allow at the working speed in place of what the job has.

use std::f64::consts::{PI, TAU};

use rayon::prelude::*;

use crate::calculator::{Failure, Message};

use super::super::job::{Case, varying};
use super::super::model::MOST_OSCILLATIONS;
use super::super::model::{Cut, Milling, Rotation, Search, scan};
use super::output::{CutterProposal, ProposalKind};
use super::{MM3_PER_CM3, Study};

/// A proposal that removes less than this much more is none.
const GAIN: f64 = 1.05;
/// Patterns of two pitches: steps by which they part, as shares of the mean pitch, and how many.
const PART: f64 = 1.0 / 36.0;
const PARTS: u32 = 11;
/// Patterns whose pitches rise evenly from tooth to tooth.
const RISE: f64 = 1.0 / 24.0;
const RISES: u32 = 8;
/// Changes of the helix, deg, and the steepest.
const HELICES: [f64; 4] = [-10.0, -5.0, 5.0, 10.0];
const STEEPEST_DEG: f64 = 60.0;
/// Variations of the speed: shares, and times the turns per second.
const AMPLITUDES: [f64; 3] = [0.1, 0.2, 0.3];
const PER_TURN: [f64; 3] = [0.25, 0.5, 1.0];
const W_PER_KW: f64 = 1000.0;

/// Something else to cut with.
struct Trial {
    kind: ProposalKind,
    milling: Milling,
    rotation: Rotation,
}

/// The best of each kind that removes at least 5 % more within chatter with its margin, power and torque.
pub(super) fn proposals(study: &Study<'_>, chatter_hz: Option<f64>) -> Result<Vec<CutterProposal>, Failure> {
    study.monitor.progress(0.9, Message::new("stage_proposals"));
    let case = &study.case;
    let now = tried(study, &case.milling, case.rotation, false)?;
    let mut trials = pitches(case, chatter_hz);
    trials.extend(helices(study));
    trials.extend(variations(study));
    let seen: Result<Vec<f64>, Failure> =
        trials.par_iter().map(|trial| Ok(tried(study, &trial.milling, trial.rotation, true)?.depth_mm)).collect();
    let seen = seen?;
    let mut found = Vec::new();
    for kind in [ProposalKind::Pitch, ProposalKind::Helix, ProposalKind::SpeedVariation] {
        let of_kind = (0..trials.len()).filter(|k| trials[*k].kind == kind);
        let Some(best) = of_kind.max_by(|a, b| seen[*a].total_cmp(&seen[*b])) else { continue };
        let trial = &trials[best];
        // Solved again as it is told.
        let allowed = tried(study, &trial.milling, trial.rotation, false)?;
        if allowed.depth_mm < GAIN * now.depth_mm {
            continue;
        }
        let varies = trial.rotation.varies();
        found.push(CutterProposal {
            kind,
            pitch_deg: match kind {
                ProposalKind::Pitch => trial.milling.teeth.iter().map(|tooth| tooth.pitch_rad.to_degrees()).collect(),
                _ => Vec::new(),
            },
            helix_angle_deg: (kind == ProposalKind::Helix).then(|| helix_deg(&trial.milling)),
            amplitude: varies.then_some(trial.rotation.amplitude),
            frequency_hz: varies.then_some(trial.rotation.frequency_hz),
            first_limit_mm: allowed.limit_mm,
            first_limit_now_mm: now.limit_mm,
            depth_mm: allowed.depth_mm,
            depth_now_mm: now.depth_mm,
            removal_rate_cm3_per_min: allowed.depth_mm * rate_per_mm(case),
            gain_percent: 100.0 * (allowed.depth_mm / now.depth_mm - 1.0),
        });
    }
    found.sort_by(|a, b| b.gain_percent.total_cmp(&a.gain_percent));
    Ok(found)
}

/// cm3/min per mm of depth.
fn rate_per_mm(case: &Case) -> f64 {
    let milling = &case.milling;
    case.width_mm * milling.feed_mm * milling.teeth.len() as f64 * case.rotation.spindle_rpm / MM3_PER_CM3
}

/// A depth under all limits, and where chatter begins.
struct Allowed {
    limit_mm: Option<f64>,
    depth_mm: f64,
}

fn tried(study: &Study<'_>, milling: &Milling, rotation: Rotation, on_map: bool) -> Result<Allowed, Failure> {
    let cut = Cut { rotation, ..study.of(milling, &study.case.structure) };
    let search = Search { depth_max_mm: study.examined_mm, steps: study.job.limits.depths, only_first: true, on_map };
    let limit_mm = scan(&study.orders, &cut, &search, study.monitor)?.first_mm();
    let margin = 1.0 - 0.01 * study.job.limits.margin_percent;
    let [power, torque] = study.drive_depths_mm(rotation.spindle_rpm);
    let bounds = [limit_mm.map(|limit| margin * limit), power, torque, Some(study.examined_mm)];
    Ok(Allowed { limit_mm, depth_mm: bounds.into_iter().flatten().fold(f64::INFINITY, f64::min) })
}

fn helix_deg(milling: &Milling) -> f64 {
    (milling.teeth[0].lag_rad_per_mm * milling.radius_mm).atan().to_degrees()
}

/// Two pitches in turn, and pitches that rise evenly. The first guess parts them by half a wave of the chatter.
fn pitches(case: &Case, chatter_hz: Option<f64>) -> Vec<Trial> {
    let count = case.milling.teeth.len();
    let pitch = TAU / count as f64;
    let whole_degrees = |rad: f64| rad.to_degrees().round().to_radians();
    let mut patterns: Vec<Vec<f64>> = Vec::new();
    if count >= 2 && count.is_multiple_of(2) {
        let half_wave = chatter_hz.map(|hz| 0.5 * TAU * case.rotation.spindle_rpm / 60.0 / (2.0 * hz));
        let parts =
            (1..=PARTS).map(|k| f64::from(k) * PART * pitch).chain(half_wave.map(|wave| wave % (PI / count as f64)));
        for part in parts {
            let low = whole_degrees(pitch - part);
            let high = 2.0 * pitch - low;
            patterns.push((0..count).map(|j| if j % 2 == 0 { low } else { high }).collect());
        }
    }
    if count >= 3 {
        for k in 1..=RISES {
            let rise = whole_degrees(f64::from(k) * RISE * pitch);
            let middle = 0.5 * (count as f64 - 1.0);
            let all: Vec<f64> = (0..count).map(|j| pitch + (j as f64 - middle) * rise).collect();
            patterns.push(all);
        }
    }
    // A tooth needs room.
    patterns.retain(|pattern| pattern.iter().all(|one| *one > 0.4 * pitch));
    let of = |pattern: Vec<f64>| {
        let mut milling = case.milling.clone();
        for (tooth, pitch_rad) in milling.teeth.iter_mut().zip(pattern) {
            tooth.pitch_rad = pitch_rad;
        }
        Trial { kind: ProposalKind::Pitch, milling, rotation: case.rotation }
    };
    let trials = patterns.into_iter().map(of);
    trials.filter(|trial| is_answered(case, &trial.milling, &trial.rotation)).collect()
}

fn is_answered(case: &Case, milling: &Milling, rotation: &Rotation) -> bool {
    // A modulation that fits into a tooth pitch need not fit into a turn.
    let fits =
        !rotation.varies() || varying(milling, rotation.spindle_rpm, rotation.amplitude, rotation.frequency_hz).is_ok();
    fits && case.structure.fastest_rad_per_s() / TAU * rotation.period_s(milling.period_rad()) <= MOST_OSCILLATIONS
}

fn helices(study: &Study<'_>) -> Vec<Trial> {
    let case = &study.case;
    if !case.milling.has_one_helix() {
        return Vec::new();
    }
    let now = helix_deg(&case.milling);
    let of = |change: f64| {
        let angle = now + change;
        let mut milling = case.milling.clone();
        for tooth in &mut milling.teeth {
            tooth.lag_rad_per_mm = angle.to_radians().tan() / milling.radius_mm;
        }
        (angle.abs() <= STEEPEST_DEG).then_some(Trial { kind: ProposalKind::Helix, milling, rotation: case.rotation })
    };
    HELICES.into_iter().filter_map(of).collect()
}

/// Variations that the spindle can do: of one whose inertia is stated.
fn variations(study: &Study<'_>) -> Vec<Trial> {
    let case = &study.case;
    let Some(spindle) = study.job.spindle.as_ref().filter(|_| !case.rotation.varies()) else { return Vec::new() };
    let Some(inertia) = spindle.inertia_kg_m2 else { return Vec::new() };
    let speed = case.rotation.spindle_rpm;
    let cutting_kw = study.torque_at_1_mm_n_m * case.depth_mm * TAU * speed / 60.0 / W_PER_KW / spindle.efficiency;
    let power_kw = spindle.drive().available(speed).power_kw;
    let mut trials = Vec::new();
    for amplitude in AMPLITUDES {
        for per_turn in PER_TURN {
            let Ok(rotation) = varying(&case.milling, speed, amplitude, per_turn * speed / 60.0) else { continue };
            let (acceleration, extra_kw) = effort(&rotation, inertia);
            let is_slow = spindle.acceleration_max_rad_per_s2.is_none_or(|most| acceleration <= most);
            let has_power = power_kw.is_none_or(|most| cutting_kw + extra_kw <= most);
            if is_slow && has_power && is_answered(case, &case.milling, &rotation) {
                trials.push(Trial { kind: ProposalKind::SpeedVariation, milling: case.milling.clone(), rotation });
            }
        }
    }
    trials
}

/// Largest angular acceleration of a varying speed, rad/s2, and largest power that an inertia takes for it, kW (`milling/4.18`).
pub(super) fn effort(rotation: &Rotation, inertia_kg_m2: f64) -> (f64, f64) {
    let mean = TAU * rotation.spindle_rpm / 60.0;
    let modulation = TAU * rotation.frequency_hz;
    let acceleration = rotation.amplitude * mean * modulation;
    // Of J Omega Omega' over a modulation.
    let power = (0..=360_u32)
        .map(|k| {
            let phase = f64::from(k).to_radians();
            inertia_kg_m2 * mean * (1.0 + rotation.amplitude * phase.sin()) * acceleration * phase.cos()
        })
        .fold(0.0, f64::max);
    (acceleration, power / W_PER_KW)
}
