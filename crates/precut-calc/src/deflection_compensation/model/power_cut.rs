//! The equilibrium at one station where a power of the depth is all that acts: t + k t^z + e = t_c.
//!
//! Along a shaft the engaged depth hardly changes. The power is therefore taken from its Taylor polynomial about a
//! depth met before, and a step of third order from a good start leaves nothing to be iterated: one polynomial and two
//! divisions per station instead of a logarithm and an exponential per Newton step. Whatever is unusual (a tool beyond
//! the axis, a step that leaves the stock) is left to the [general solution](crate::deflection_compensation::model::equilibrium::engage).

use crate::deflection_compensation::model::equilibrium::{Engagement, Opening};

/// Relative distance from its reference up to which the polynomial is used. What it cuts off is below
/// `REACH^10 |C(z, 10)|` = 1e-17 for exponents up to [`MAX_EXPONENT`].
const REACH: f64 = 1.0 / 32.0;
/// Largest exponent of the depth for which the polynomial holds to round-off.
pub(in crate::deflection_compensation) const MAX_EXPONENT: f64 = 3.0;
const ORDINALS: [f64; 10] = [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0];
/// Relative step after which the error, of the order of its cube, is below round-off.
const CLOSE: f64 = 1.0 / 131_072.0;
/// Steps tried before the general solution takes over; one or two do.
const MAX_STEPS: u32 = 8;

/// t^z by a polynomial about a reference depth, which follows the depths asked for.
#[derive(Debug)]
pub(in crate::deflection_compensation) struct NearbyPower {
    exponent: f64,
    /// Binomial coefficients C(z, k).
    binomials: [f64; 10],
    reference_mm: f64,
    inverse_per_mm: f64,
    value: f64,
}

impl NearbyPower {
    /// For exponents above 0 and up to [`MAX_EXPONENT`]; the first depth asked for becomes the reference.
    pub(in crate::deflection_compensation) fn new(exponent: f64) -> Self {
        let mut binomials = [1.0; 10];
        for k in 1..binomials.len() {
            binomials[k] = binomials[k - 1] * (exponent - ORDINALS[k - 1]) / ORDINALS[k];
        }
        Self { exponent, binomials, reference_mm: f64::NAN, inverse_per_mm: f64::NAN, value: f64::NAN }
    }

    /// t^z for t > 0, to two or three units in the last place.
    #[inline]
    fn at(&mut self, depth_mm: f64) -> f64 {
        let mut x = (depth_mm - self.reference_mm) * self.inverse_per_mm;
        if x.is_nan() || x.abs() > REACH {
            self.refer_to(depth_mm);
            x = 0.0;
        }
        let [_, c1, c2, c3, c4, c5, c6, c7, c8, c9] = self.binomials;
        // In pairs: a chain half as long as Horner's.
        let xx = x * x;
        let high = (c6 + c7 * x) + xx * (c8 + c9 * x);
        let rest = (c2 + c3 * x) + xx * ((c4 + c5 * x) + xx * high);
        self.value + self.value * (c1 * x + xx * rest)
    }

    #[cold]
    fn refer_to(&mut self, depth_mm: f64) {
        self.reference_mm = depth_mm;
        self.inverse_per_mm = 1.0 / depth_mm;
        self.value = (self.exponent * depth_mm.ln()).exp();
    }
}

/// One command at one station.
#[allow(clippy::struct_field_names)] // Names carry units.
#[derive(Debug, Clone, Copy)]
pub(in crate::deflection_compensation) struct PowerCut {
    pub stock_radius_mm: f64,
    pub command_radius_mm: f64,
    /// k of y = k t^z + e: compliance times the force at 1 mm, mm.
    pub stiffness_mm: f64,
    /// e, mm.
    pub offset_mm: f64,
    /// Guess of the engaged depth.
    pub start_mm: f64,
}

impl PowerCut {
    /// What becomes of the command; `None` where the general solution has to be asked.
    #[inline]
    pub(in crate::deflection_compensation) fn engage(&self, power: &mut NearbyPower) -> Option<Engagement> {
        let commanded = self.stock_radius_mm - self.command_radius_mm;
        if commanded <= 0.0 {
            let stands_towards_tool = commanded < 0.0 && self.offset_mm < commanded;
            return (!stands_towards_tool).then_some(Engagement::NoContact);
        }
        // Only if the work stays on the tool's side of the axis the produced radius is r_c + Y, and the root unique.
        if self.command_radius_mm + self.offset_mm <= 0.0 {
            return None;
        }
        if self.offset_mm >= commanded {
            return Some(Engagement::NoCut);
        }
        let mut depth = self.start_mm;
        for _ in 0..MAX_STEPS {
            // Written so that a NaN leaves too.
            if !(depth > 0.0 && depth < self.stock_radius_mm) {
                return None;
            }
            let inverse = 1.0 / depth;
            let y = self.stiffness_mm * power.at(depth);
            let slope = power.exponent * y * inverse;
            let gain = 1.0 / (1.0 + slope);
            let newton = (depth - commanded + (y + self.offset_mm)) * gain;
            // Chebyshev's step: F''/F' = (z - 1)/t Y'/(1 + Y').
            let bend = (power.exponent - 1.0) * slope * gain * inverse;
            let step = newton * (1.0 + 0.5 * bend * newton);
            depth -= step;
            let share = step * inverse;
            if share.abs() <= CLOSE {
                return Some(self.closed(depth, y, slope, share, power.exponent));
            }
        }
        None
    }

    /// The state at `depth_mm`, a relative step of `share` below where y and y' are known: (1 - share)^z to third order.
    fn closed(&self, depth_mm: f64, y_mm: f64, y_slope: f64, share: f64, z: f64) -> Engagement {
        let after = |exponent: f64| 1.0 - exponent * share * (1.0 - 0.5 * (exponent - 1.0) * share);
        let y_mm = y_mm * after(z) + self.offset_mm;
        let commanded = self.stock_radius_mm - self.command_radius_mm;
        Engagement::Cut {
            depth_mm,
            opening: Opening { y_mm, y_slope: y_slope * after(z - 1.0), z_mm: 0.0, z_slope: 0.0 },
            residual_mm: depth_mm - commanded + y_mm,
        }
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::deflection_compensation::model::equilibrium::{copying_factor, engage};
    use proptest::prelude::*;

    fn in_general(cut: &PowerCut, z: f64) -> Engagement {
        let at_zero = Opening { y_mm: cut.offset_mm, ..Opening::default() };
        engage(cut.stock_radius_mm, cut.command_radius_mm, cut.start_mm, at_zero, |t| {
            let y = cut.stiffness_mm * (z * t.ln()).exp();
            Opening { y_mm: y + cut.offset_mm, y_slope: z * y / t, ..Opening::default() }
        })
    }

    /// Same kind of engagement, same depth and copying to a few units in the last place of what the equation is made of.
    fn agree(cut: &PowerCut, power: &mut NearbyPower) -> Result<(), TestCaseError> {
        let general = in_general(cut, power.exponent);
        let Some(fast) = cut.engage(power) else { return Ok(()) };
        if let (Engagement::Cut { opening, residual_mm, .. }, Engagement::Cut { opening: other, .. }) = (fast, general)
        {
            let commanded = cut.stock_radius_mm - cut.command_radius_mm;
            let scale = commanded.max(cut.offset_mm.abs()) * f64::EPSILON;
            let (a, b) = (fast.depth_mm(), general.depth_mm());
            prop_assert!((a - b).abs() <= 8.0 * scale, "{a} and {b} differ by {} ulp", (a - b) / scale);
            prop_assert!(residual_mm.abs() <= 8.0 * scale);
            let (a, b) = (copying_factor(cut.command_radius_mm, opening), copying_factor(cut.command_radius_mm, other));
            // The slope at small depths magnifies what the depth may differ by.
            let slack = 16.0 + 16.0 * scale / f64::EPSILON / general.depth_mm();
            prop_assert!((a - b).abs() <= slack * f64::EPSILON, "{a} and {b} in the copying factor");
        } else {
            prop_assert_eq!(fast, general);
        }
        Ok(())
    }

    proptest! {
        #[test]
        fn the_power_is_the_power(z in 0.3..=MAX_EXPONENT, about in 1e-3..50.0_f64, away in -0.03..0.03_f64) {
            let mut power = NearbyPower::new(z);
            prop_assert!((power.at(about) / about.powf(z) - 1.0).abs() <= 4.0 * f64::EPSILON * (1.0 + about.ln().abs()));
            let t = about * (1.0 + away);
            let here = power.at(t);
            prop_assert!((here / t.powf(z) - 1.0).abs() <= 4.0 * f64::EPSILON * (1.0 + about.ln().abs()));
        }

        /// Flexibility up to eta = y/a = 2, stated errors, stock other than planned; a shaft whose depth goes along.
        #[test]
        fn agrees_with_the_general_solution(
            a in 0.02..6.0_f64, eta in 1e-4..2.0_f64, z in 0.3..2.0_f64,
            e in -0.5..1.2_f64, extra in -1.2..1.0_f64, start in 0.05..1.5_f64, rise in -0.5..0.5_f64,
        ) {
            let mut power = NearbyPower::new(z);
            for station in 0..40_u32 {
                let along = f64::from(station) / 39.0;
                let cut = PowerCut {
                    stock_radius_mm: 25.0 + a * (1.0 + extra * along),
                    command_radius_mm: 25.0,
                    stiffness_mm: eta * (1.0 + rise * along) * a / a.powf(z),
                    offset_mm: e * a * along,
                    start_mm: a * start,
                };
                agree(&cut, &mut power)?;
            }
        }
    }

    #[test]
    fn the_usual_cut_is_not_left_to_the_general_solution() {
        let mut power = NearbyPower::new(0.9);
        for k in [1e-6, 0.05, 0.3, 2.0] {
            let cut = PowerCut {
                stock_radius_mm: 21.0,
                command_radius_mm: 20.0,
                stiffness_mm: k,
                offset_mm: 0.01,
                start_mm: 1.0 - k / (1.0 + 0.9 * k),
            };
            assert!(cut.engage(&mut power).is_some(), "k = {k}");
        }
    }

    #[test]
    fn what_is_unusual_is_left_to_the_general_solution() {
        let mut power = NearbyPower::new(0.9);
        let usual = PowerCut {
            stock_radius_mm: 21.0,
            command_radius_mm: 20.0,
            stiffness_mm: 0.1,
            offset_mm: 0.0,
            start_mm: 0.9,
        };
        assert_eq!(PowerCut { command_radius_mm: -1.0, ..usual }.engage(&mut power), None);
        assert_eq!(PowerCut { start_mm: f64::NAN, ..usual }.engage(&mut power), None);
        assert_eq!(PowerCut { command_radius_mm: 21.0, ..usual }.engage(&mut power), Some(Engagement::NoContact));
        assert_eq!(PowerCut { offset_mm: 1.0, ..usual }.engage(&mut power), Some(Engagement::NoCut));
    }
}
