//! How the spindle turns: at one speed, or at one that varies as a sine (`milling/4.18`).

use std::f64::consts::TAU;

/// Steps of Newton's method; it converges in five where the speed stays positive.
const STEPS: u32 = 60;

/// Omega(t) = Omega_0 (1 + A sin 2 pi f t).
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Rotation {
    /// Mean speed, rev/min.
    pub spindle_rpm: f64,
    /// A, below 1; 0 for one speed.
    pub amplitude: f64,
    /// f, Hz.
    pub frequency_hz: f64,
    /// Modulations in a period of the map.
    pub modulations: u32,
}

impl Rotation {
    /// One speed.
    pub fn steady(spindle_rpm: f64) -> Self {
        Self { spindle_rpm, amplitude: 0.0, frequency_hz: 0.0, modulations: 0 }
    }

    /// Whether the speed varies.
    pub fn varies(&self) -> bool {
        self.amplitude > 0.0
    }

    fn mean_rad_per_s(&self) -> f64 {
        TAU * self.spindle_rpm / 60.0
    }

    /// Speed at a time.
    pub fn rad_per_s(&self, time_s: f64) -> f64 {
        self.mean_rad_per_s() * (1.0 + self.amplitude * (TAU * self.frequency_hz * time_s).sin())
    }

    /// Rotation since time 0.
    pub fn rotation_rad(&self, time_s: f64) -> f64 {
        let varied = if self.varies() {
            let w = TAU * self.frequency_hz;
            self.amplitude * (1.0 - (w * time_s).cos()) / w
        } else {
            0.0
        };
        self.mean_rad_per_s() * (time_s + varied)
    }

    /// When it has turned so far: by Newton's method, never by the delay of the mean speed.
    pub fn time_s(&self, rotation_rad: f64) -> f64 {
        let mut time = rotation_rad / self.mean_rad_per_s();
        if self.varies() {
            for _ in 0..STEPS {
                let step = (self.rotation_rad(time) - rotation_rad) / self.rad_per_s(time);
                time -= step;
                if step.abs() <= 1e-15 * time.abs() {
                    break;
                }
            }
        }
        time
    }

    /// Period of the map, s, where the cut repeats after so much rotation.
    pub fn period_s(&self, period_rad: f64) -> f64 {
        if self.varies() { f64::from(self.modulations) / self.frequency_hz } else { period_rad / self.mean_rad_per_s() }
    }
}
