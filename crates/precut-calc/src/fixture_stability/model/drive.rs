//! What the cut asks of the spindle, and the depths at which its power or torque gives out (`fixture/5.8`).
//!
//! A motion that repeats itself from tooth to tooth leaves every chip as it is, so the mean torque of a stable cut is that
//! of smooth chips: exact, and proportional to H^(1-mu). In chatter it is a guide, no more.

use std::f64::consts::{FRAC_PI_2, PI, TAU};

use crate::force::SineIntegral;

use crate::fixture_stability::job::acting::Case;
use crate::fixture_stability::job::input::{Spindle, SpindlePoint};
use crate::fixture_stability::model::cutting::Cutting;
use crate::fixture_stability::model::floquet::Working;

/// N mm in a N m, W in a kW.
const N_MM_PER_N_M: f64 = 1000.0;
const W_PER_KW: f64 = 1000.0;

/// What a spindle gives at a speed; `None` where nothing is said of it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Available {
    /// Power of the motor, kW.
    pub power_kw: Option<f64>,
    /// Torque at the cutter, N m.
    pub torque_n_m: Option<f64>,
}

/// Depths at which a spindle gives out, mm.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(in crate::fixture_stability) struct DriveDepths {
    pub power_mm: Option<f64>,
    pub torque_mm: Option<f64>,
}

impl DriveDepths {
    /// The smaller of both.
    pub(in crate::fixture_stability) fn least_mm(&self) -> Option<f64> {
        match (self.power_mm, self.torque_mm) {
            (Some(power), Some(torque)) => Some(power.min(torque)),
            (power, torque) => power.or(torque),
        }
    }
}

impl Spindle {
    /// What it gives at a speed: the least of what is stated for all speeds and of the table there.
    pub(crate) fn available(&self, spindle_rpm: f64) -> Available {
        let least = |constant: Option<f64>, of: fn(&SpindlePoint) -> Option<f64>| match self.in_table(spindle_rpm, of) {
            Some(tabled) => Some(constant.map_or(tabled, |constant| constant.min(tabled))),
            None => constant,
        };
        Available {
            power_kw: least(self.power_kw, |point| point.power_kw),
            torque_n_m: least(self.torque_n_m, |point| point.torque_n_m),
        }
    }

    /// Straight lines between the rows that state a value; nothing is known outside of them.
    fn in_table(&self, spindle_rpm: f64, of: fn(&SpindlePoint) -> Option<f64>) -> Option<f64> {
        let rows: Vec<(f64, f64)> =
            self.characteristic.iter().filter_map(|row| Some((row.spindle_speed_rpm, of(row)?))).collect();
        let after = rows.partition_point(|(speed, _)| *speed < spindle_rpm);
        let (above, value_above) = *rows.get(after)?;
        if above <= spindle_rpm {
            return Some(value_above);
        }
        let (below, value_below) = *rows.get(after.checked_sub(1)?)?;
        Some(value_below + (spindle_rpm - below) / (above - below) * (value_above - value_below))
    }

    /// Range of speeds of its table, where it has one.
    pub(crate) fn tabled_rpm(&self) -> Option<(f64, f64)> {
        Some((self.characteristic.first()?.spindle_speed_rpm, self.characteristic.last()?.spindle_speed_rpm))
    }
}

/// Mean torque on the cutter with smooth chips, N m: R z/(2 pi) Cp H^(1-mu) times the mean of f^(1-k) over the teeth times
/// the integral of sin^(1-k) over the arc.
pub(in crate::fixture_stability) fn mean_torque_n_m(cutting: &Cutting, feed_mm: f64, depth_mm: f64) -> f64 {
    let teeth = cutting.teeth as f64;
    let powers: f64 =
        (0..cutting.teeth).map(|tooth| cutting.chip_power(cutting.chip_mm(feed_mm, tooth))).sum::<f64>() / teeth;
    let arc = sine_over_arc(1.0 - cutting.chip_exponent, cutting.entry_rad, cutting.exit_rad);
    cutting.radius_mm / N_MM_PER_N_M * teeth / TAU * cutting.level(depth_mm) * powers * arc
}

/// Integral of sin^power over an arc within 0 to pi.
fn sine_over_arc(power: f64, from_rad: f64, to_rad: f64) -> f64 {
    let integral = SineIntegral::new(power);
    let quarter = |angle_rad: f64| integral.at((0.5 * angle_rad).sin().powi(2));
    let from_start = |angle_rad: f64| {
        if angle_rad <= FRAC_PI_2 {
            quarter(angle_rad.max(0.0))
        } else {
            2.0 * quarter(FRAC_PI_2) - quarter((PI - angle_rad).max(0.0))
        }
    };
    from_start(to_rad) - from_start(from_rad)
}

/// Power at the cutter, kW.
pub(crate) fn power_kw(torque_n_m: f64, spindle_rpm: f64) -> f64 {
    torque_n_m * TAU * spindle_rpm / (60.0 * W_PER_KW)
}

/// Depths at which the mean torque reaches what the spindle gives at that speed.
pub(in crate::fixture_stability) fn depths(case: &Case, spindle: &Spindle, working: Working) -> DriveDepths {
    let torque_at_1_mm = mean_torque_n_m(&case.cutting, working.feed_mm, 1.0);
    let power_at_1_mm = power_kw(torque_at_1_mm, working.spindle_rpm) / spindle.efficiency;
    let available = spindle.available(working.spindle_rpm);
    let exponent = 1.0 / (1.0 - case.cutting.depth_exponent);
    let depth = |limit: Option<f64>, at_1_mm: f64| limit.map(|limit| (limit / at_1_mm).powf(exponent));
    DriveDepths {
        power_mm: depth(available.power_kw, power_at_1_mm),
        torque_mm: depth(available.torque_n_m, torque_at_1_mm),
    }
}
