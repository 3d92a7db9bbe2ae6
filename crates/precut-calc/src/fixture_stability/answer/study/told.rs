//! Numbers of the answer at the working point.

use std::f64::consts::{PI, TAU};

use crate::fixture_stability::answer::output::{
    ArcProfile, ChatterKind, CuttingDrive, Engagement, FloquetMultiplier, ForcedMotion, Histories, Oscillogram,
    QuasiStatic, Simulated, ZerothOrder,
};
use crate::fixture_stability::job::acting::Case;
use crate::fixture_stability::model::drive;
use crate::fixture_stability::model::floquet::Multiplier;
use crate::fixture_stability::model::march::{Marched, Step};
use crate::fixture_stability::model::simulate::{Observed, count, scatter, small};
use crate::fixture_stability::model::zeroth::{at_speed, depth_mm, zeroth};

use super::{Study, UM_PER_MM, removal_rate};

/// Sampling error of the exact forced motion, relative.
pub(super) const SAMPLING: f64 = 1e-6;
/// Share of a disturbance that is left when it has settled.
const DECAYED: f64 = 1e-3;
/// Entries of an oscillogram at most.
const OSCILLOGRAM: usize = 1200;

pub(super) fn engagement(study: &Study<'_>) -> Engagement {
    let case = &study.case;
    let (cutting, working) = (&case.cutting, case.working);
    let stretches = cutting.stretches();
    let z = cutting.teeth as f64;
    let table = working.feed_mm * working.spindle_rpm * z;
    Engagement {
        entry_angle_deg: cutting.entry_rad.to_degrees(),
        exit_angle_deg: cutting.exit_rad.to_degrees(),
        arc_deg: cutting.arc_rad().to_degrees(),
        teeth_in_cut_mean: cutting.arc_rad() * z / TAU,
        teeth_in_cut_max: small(stretches.iter().map(|s| s.teeth).max().unwrap_or(0)),
        teeth_in_cut_min: small(stretches.iter().map(|s| s.teeth).min().unwrap_or(0)),
        spindle_speed_rpm: working.spindle_rpm,
        speed_m_per_min: TAU * cutting.radius_mm * working.spindle_rpm / 1000.0,
        feed_mm_per_tooth: working.feed_mm,
        feed_mm_per_min: table,
        tooth_frequency_hz: working.spindle_rpm * z / 60.0,
        removal_rate_cm3_per_min: removal_rate(case, working),
    }
}

pub(super) fn quasi_static(case: &Case) -> QuasiStatic {
    let (high, low) = case.cutting.static_extremes_n(case.working.feed_mm, case.working.depth_mm);
    let stiffness = case.holding.static_stiffness_n_per_mm();
    QuasiStatic {
        force_max_n: high,
        force_min_n: low,
        stiffness_n_per_mm: stiffness,
        displacement_max_um: high / stiffness * UM_PER_MM,
        displacement_min_um: low / stiffness * UM_PER_MM,
    }
}

/// What the cut asks of the spindle (`fixture/5.8`).
pub(super) fn cutting_drive(study: &Study<'_>) -> CuttingDrive {
    let Study { case, job, .. } = study;
    let working = case.working;
    let torque = drive::mean_torque_n_m(&case.cutting, working.feed_mm, working.depth_mm);
    let power_kw = drive::power_kw(torque, working.spindle_rpm);
    let available = job.spindle.as_ref().map(|spindle| spindle.available(working.spindle_rpm));
    let depths = study.drive_depths(working.spindle_rpm);
    CuttingDrive {
        torque_mean_n_m: torque,
        torque_max_n_m: case.cutting.tangential_max_n(working.feed_mm, working.depth_mm) * case.cutting.radius_mm
            / 1000.0,
        power_kw,
        motor_power_kw: power_kw / job.spindle.as_ref().map_or(1.0, |spindle| spindle.efficiency),
        power_limit_kw: available.and_then(|of| of.power_kw),
        torque_limit_n_m: available.and_then(|of| of.torque_n_m),
        power_depth_mm: depths.power_mm,
        torque_depth_mm: depths.torque_mm,
    }
}

impl CuttingDrive {
    /// What the spindle gives over what the cut asks, the lesser of power and torque.
    pub(in crate::fixture_stability::answer) fn margin(&self) -> Option<f64> {
        let of = |limit: Option<f64>, asked: f64| limit.filter(|_| asked > 0.0).map(|limit| limit / asked);
        let both = [of(self.power_limit_kw, self.motor_power_kw), of(self.torque_limit_n_m, self.torque_mean_n_m)];
        both.into_iter().flatten().reduce(f64::min)
    }
}

/// Frequency at which a multiplier vibrates: of all aliases the one nearest to a mode, Hz.
fn chatter_frequency_hz(case: &Case, found: &Multiplier) -> f64 {
    let period = case.cutting.tooth_period_s(case.working.spindle_rpm) * found.phases as f64;
    let angle = found.im.atan2(found.re);
    let mut best = (f64::INFINITY, 0.0);
    for mode in case.holding.modes() {
        for sign in [1.0, -1.0] {
            let turns = (mode.damped_hz * period - sign * angle / TAU).round();
            let frequency = (sign * angle / TAU + turns) / period;
            let distance = (frequency - mode.damped_hz).abs();
            if frequency >= 0.0 && distance < best.0 {
                best = (distance, frequency);
            }
        }
    }
    best.1
}

pub(super) fn multiplier(study: &Study<'_>) -> FloquetMultiplier {
    let found = study.point.multiplier;
    let kind = if found.im > 1e-9 * found.modulus {
        ChatterKind::Hopf
    } else if found.re < 0.0 {
        ChatterKind::Flip
    } else {
        ChatterKind::Fold
    };
    let tau = study.case.cutting.tooth_period_s(study.case.working.spindle_rpm);
    FloquetMultiplier {
        modulus: found.modulus,
        real: found.re,
        imaginary: found.im.abs(),
        tooth_periods: small(found.phases),
        kind,
        chatter_frequency_hz: match found.slow {
            Some(slow) => slow.frequency_hz,
            None => chatter_frequency_hz(&study.case, &found),
        },
        // A disturbance that vanishes within a tooth period decays at no finite rate: 1e-300 stands for it.
        growth_per_s: found.modulus.max(1e-300).ln() / tau,
        settling_time_s: (found.modulus < 1.0).then(|| DECAYED.ln() / found.modulus.max(1e-300).ln() * tau),
        modulus_error: study.point.error,
        growth_within: found.slow.map(|slow| slow.within),
    }
}

pub(super) fn zeroth_order(study: &Study<'_>) -> ZerothOrder {
    let case = &study.case;
    let found = zeroth(&case.holding, &case.cutting);
    let feed = case.working.feed_mm;
    let depth = |kappa: f64| depth_mm(&case.cutting, found.mean_factor, kappa, feed);
    ZerothOrder {
        mean_directional_factor: found.mean_factor,
        depth_min_mm: found.least.map(|(kappa, _)| depth(kappa)),
        frequency_hz: found.least.map(|(_, hz)| hz),
        depth_at_speed_mm: at_speed(&case.holding, &case.cutting, case.working.spindle_rpm).map(depth),
    }
}

pub(super) fn forced_motion(study: &Study<'_>) -> ForcedMotion {
    let forced = &study.forced;
    let (high, low) = study.case.cutting.static_extremes_n(study.case.working.feed_mm, study.case.working.depth_mm);
    let quasi = (high - low) / study.case.holding.static_stiffness_n_per_mm();
    ForcedMotion {
        displacement_max_um: forced.x_mm.high * UM_PER_MM,
        displacement_min_um: forced.x_mm.low * UM_PER_MM,
        peak_to_peak_um: forced.x_mm.span() * UM_PER_MM,
        displacement_at_entry_um: forced.x_at_entry_mm * UM_PER_MM,
        displacement_at_exit_um: forced.x_at_exit_mm * UM_PER_MM,
        dynamic_factor: (quasi > 0.0).then(|| forced.x_mm.span() / quasi),
        clamp_movable_n: forced.left_n.high.max(0.0),
        clamp_fixed_n: forced.right_n.high.max(0.0),
    }
}

pub(super) fn simulation(study: &Study<'_>, Observed { plan, run, .. }: &Observed) -> Simulated {
    let scatter = scatter(&study.case, plan, run);
    Simulated {
        steps_per_tooth: small(plan.steps_per_tooth),
        tooth_periods: small(plan.tooth_periods),
        steady_tooth_periods: small(plan.steady_periods),
        diverged: run.diverged,
        settled: scatter.settled && !run.diverged,
        sample_scatter: scatter.of_feed,
        displacement_max_um: run.x_mm.high * UM_PER_MM,
        displacement_min_um: run.x_mm.low * UM_PER_MM,
        peak_to_peak_um: run.x_mm.span() * UM_PER_MM,
        force_max_n: run.force_n.high,
        force_min_n: run.force_n.low,
        effective_feed_max_mm: run.feed_mm.high,
        effective_feed_min_mm: run.feed_mm.low,
        lost_cut_share: run.lost_cut,
        first_lost_cut_s: run.first_lost_s,
        clamp_movable_n: run.left_n.high.max(0.0),
        clamp_fixed_n: run.right_n.high.max(0.0),
        clamp_movable_entry_n: run.left_entry_n.max(0.0),
        clamp_fixed_entry_n: run.right_entry_n.max(0.0),
        unilateral: plan.unilateral,
        open_movable_share: run.open.left,
        open_fixed_share: run.open.right,
        open_both_share: run.open.both,
        halved_step_change_um: None,
    }
}

pub(super) fn histories(study: &Study<'_>, run: &Marched) -> Histories {
    let feed = study.case.working.feed_mm;
    // The arc is drawn with as many places as it has degrees and more.
    let stride = (run.arc.len() / OSCILLOGRAM).max(1);
    let arc: Vec<(f64, f64)> = run.arc.iter().step_by(stride).copied().collect();
    let sine = |angle: f64| angle.min(PI).sin().max(0.0);
    Histories {
        entry: oscillogram(&run.first),
        steady: oscillogram(&run.last),
        arc: ArcProfile {
            angle_deg: arc.iter().map(|(angle, _)| angle.to_degrees()).collect(),
            effective_feed_mm: arc.iter().map(|(_, f)| *f).collect(),
            chip_thickness_mm: arc.iter().map(|(angle, f)| f * sine(*angle)).collect(),
            smooth_chip_mm: arc.iter().map(|(angle, _)| feed * sine(*angle)).collect(),
        },
    }
}

fn oscillogram(steps: &[Step]) -> Oscillogram {
    let stride = count((steps.len() as f64 / OSCILLOGRAM as f64).ceil().max(1.0));
    let kept: Vec<&Step> = steps.iter().step_by(stride).collect();
    let jaw = kept.first().is_some_and(|step| step.jaw_mm.is_some());
    Oscillogram {
        time_s: kept.iter().map(|s| s.time_s).collect(),
        displacement_um: kept.iter().map(|s| s.x_mm * UM_PER_MM).collect(),
        jaw_um: jaw.then(|| kept.iter().map(|s| s.jaw_mm.unwrap_or(0.0) * UM_PER_MM).collect()),
        force_n: kept.iter().map(|s| s.force_n).collect(),
        effective_feed_mm: kept.iter().map(|s| s.feed_mm).collect(),
        clamp_movable_n: kept.iter().map(|s| s.left_demand_n).collect(),
        clamp_fixed_n: kept.iter().map(|s| s.right_demand_n).collect(),
    }
}
