//! Multipliers where a period holds hundreds of oscillations and its coefficients hardly change during one.
//!
//! What comes back after a period as mu times itself, x(t - T) = x(t)/mu, obeys q' = (A - (1 - 1/mu) B(t)) q, an equation without a
//! delay. Over many oscillations its solution grows as the integral of the largest real part of the eigenvalues s(t) of that matrix
//! (adiabatic theorem), and neighbouring phases of mu lie so close that the one of fastest growth is met:
//!
//! ```text
//!     ln |mu| = max over arg mu of the integral over T of max Re s(t; mu) dt.
//! ```
//!
//! Beside that, what comes back again and again grows on its way through the period by at most the largest such integral over a
//! part of it, at |mu| = 1: as much as a steady ripple is amplified although it dies out from period to period.

use std::f64::consts::PI;

use nalgebra::Complex;

/// Phases of the multiplier that do: evenly up to pi, since of its conjugate everything is the same.
pub const SLOW_PHASES: usize = 12;
/// Logarithm of the modulus below which a disturbance is as good as gone.
const GONE: f64 = -30.0;
/// Steps of the secant, and how near is enough.
const STEPS: u32 = 12;
const NEAR: f64 = 1e-9;

/// The largest multiplier of a slow period.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SlowMultiplier {
    /// Logarithm of its modulus over the period.
    pub ln_modulus: f64,
    /// Its phase, rad.
    pub angle_rad: f64,
    /// Logarithm of the largest growth inside the period of what comes back unchanged; 0 where nothing grows anywhere.
    pub ln_within: f64,
    /// Angular frequency where it grows most, rad/s.
    pub rad_per_s: f64,
}

/// Growth of a disturbance that comes back with its own size.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct SlowGrowth {
    /// Logarithm of the growth over the period, of the sign of ln |mu|.
    pub ln_whole: f64,
    /// Logarithm of the largest growth inside the period; 0 where nothing grows anywhere.
    pub ln_within: f64,
    /// Angular frequency where it grows most, rad/s.
    pub rad_per_s: f64,
}

/// Growth over the period at one multiplier.
#[derive(Clone, Copy)]
struct Growth {
    whole: f64,
    within: f64,
    rad_per_s: f64,
}

/// A period cut into places, in the order of time.
pub struct SlowPeriod<'a> {
    /// How long each place lasts, s.
    pub shares_s: &'a [f64],
    /// Steps between the phases of the multiplier that are looked at, from 0 to pi.
    pub phases: usize,
    /// At a place and for a share 1 - 1/mu of the coupling: the eigenvalue with the largest real part, 1/s.
    pub leading: &'a dyn Fn(usize, Complex<f64>) -> Complex<f64>,
}

impl SlowPeriod<'_> {
    /// The largest multiplier; `look` is asked every few hundred eigenvalues whether to go on.
    pub fn multiplier<E>(&self, mut look: impl FnMut() -> Result<(), E>) -> Result<SlowMultiplier, E> {
        let free = self.at(Complex::new(0.0, 0.0)).whole;
        let (at_one, phase, ln_within) = self.fastest(0.0, &mut look)?;
        // Growth less its logarithm falls as the modulus rises. It is nearly proportional to the coupling over the modulus.
        let mut before = (0.0, at_one.whole);
        let mut found = (at_one, phase);
        let relative = 1.0 - at_one.whole / free;
        let mut ln_modulus = match free < 0.0 {
            true if relative > 0.0 => relative.ln().max(GONE),
            true => GONE,
            false => at_one.whole.min(1.0),
        };
        for _ in 0..STEPS {
            if (ln_modulus - before.0).abs() < NEAR {
                break;
            }
            let (growth, phase, _) = self.fastest(ln_modulus, &mut look)?;
            found = (growth, phase);
            let left = growth.whole - ln_modulus;
            if ln_modulus <= GONE && left <= 0.0 {
                break;
            }
            let slope = (left - before.1) / (ln_modulus - before.0);
            before = (ln_modulus, left);
            // A step of the secant, at most twofold or by a half.
            let step = if slope < 0.0 { -left / slope } else { left.signum() };
            ln_modulus = (ln_modulus + step.clamp(-1.0, 1.0)).max(GONE);
        }
        let (growth, phase) = found;
        Ok(SlowMultiplier { ln_modulus, angle_rad: phase, ln_within, rad_per_s: growth.rad_per_s })
    }

    /// What becomes of a disturbance that comes back with its own size: whether the multiplier is above 1, without finding it.
    pub fn at_one<E>(&self, mut look: impl FnMut() -> Result<(), E>) -> Result<SlowGrowth, E> {
        let (growth, _, ln_within) = self.fastest(0.0, &mut look)?;
        Ok(SlowGrowth { ln_whole: growth.whole, ln_within, rad_per_s: growth.rad_per_s })
    }

    /// Over the phases of a multiplier of one modulus: the fastest growth with its phase, and the largest growth inside the period.
    fn fastest<E>(&self, ln_modulus: f64, look: &mut impl FnMut() -> Result<(), E>) -> Result<(Growth, f64, f64), E> {
        let coupling = |phase: f64| Complex::new(1.0, 0.0) - Complex::from_polar((-ln_modulus).exp(), -phase);
        let step = PI / self.phases as f64;
        let mut all = Vec::with_capacity(self.phases + 1);
        for number in 0..=self.phases {
            look()?;
            all.push(self.at(coupling(number as f64 * step)));
        }
        let best = (0..=self.phases).max_by(|&a, &b| all[a].whole.total_cmp(&all[b].whole)).unwrap_or(0);
        let within = all.iter().map(|growth| growth.within).fold(0.0, f64::max);
        let (mut growth, mut phase) = (all[best], best as f64 * step);
        if best > 0 && best < self.phases {
            let (before, next) = (all[best - 1].whole, all[best + 1].whole);
            let bend = before - 2.0 * growth.whole + next;
            if bend < 0.0 {
                let refined = phase + (0.5 * (before - next) / bend).clamp(-0.5, 0.5) * step;
                let there = self.at(coupling(refined));
                if there.whole > growth.whole {
                    (growth, phase) = (there, refined);
                }
            }
        }
        Ok((growth, phase, within.max(growth.within)))
    }

    fn at(&self, coupling: Complex<f64>) -> Growth {
        let roots: Vec<Complex<f64>> = (0..self.shares_s.len()).map(|place| (self.leading)(place, coupling)).collect();
        let grown = |place: usize| roots[place].re * self.shares_s[place];
        let whole = (0..roots.len()).map(grown).sum();
        // The largest sum of neighbours, around the end of the period as well.
        let (mut sum, mut within): (f64, f64) = (0.0, 0.0);
        for place in (0..roots.len()).chain(0..roots.len()) {
            sum = (sum + grown(place)).max(0.0);
            within = within.max(sum);
        }
        let leader = roots.iter().max_by(|a, b| a.re.total_cmp(&b.re));
        Growth { whole, within, rad_per_s: leader.map_or(0.0, |root| root.im.abs()) }
    }
}
