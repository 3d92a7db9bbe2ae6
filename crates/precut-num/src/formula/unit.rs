//! Units of formulas.

use std::fmt::Write as _;

/// Powers of length, time, force and temperature.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Dimension([f64; 4]);

/// Their units, in which all is computed.
const BASE: [&str; 4] = ["mm", "min", "N", "K"];
/// What can be written: a name, how much of the base it is, and of which.
const KNOWN: [(&str, f64, [f64; 4]); 12] = [
    ("mm", 1.0, [1.0, 0.0, 0.0, 0.0]),
    ("um", 1e-3, [1.0, 0.0, 0.0, 0.0]),
    ("m", 1e3, [1.0, 0.0, 0.0, 0.0]),
    ("km", 1e6, [1.0, 0.0, 0.0, 0.0]),
    ("min", 1.0, [0.0, 1.0, 0.0, 0.0]),
    ("s", 1.0 / 60.0, [0.0, 1.0, 0.0, 0.0]),
    ("N", 1.0, [0.0, 0.0, 1.0, 0.0]),
    ("K", 1.0, [0.0, 0.0, 0.0, 1.0]),
    ("deg", std::f64::consts::PI / 180.0, [0.0; 4]),
    ("rad", 1.0, [0.0; 4]),
    ("rev", 1.0, [0.0; 4]),
    ("percent", 0.01, [0.0; 4]),
];
/// Largest power in a unit.
const MOST_POWER: i32 = 4;

impl Dimension {
    /// A plain number.
    pub(super) const NONE: Self = Self([0.0; 4]);

    pub(super) fn times(self, other: Self, power: f64) -> Self {
        Self(std::array::from_fn(|k| self.0[k] + power * other.0[k]))
    }

    pub(super) fn power(self, power: f64) -> Self {
        Self(self.0.map(|own| own * power))
    }

    /// As it would be written.
    pub(super) fn said(self) -> String {
        let is_one = |power: f64| (power - 1.0).abs() < 1e-9;
        let one = |(name, power): (&str, f64)| if is_one(power) { name.to_owned() } else { format!("{name}^{power}") };
        let of = |sign: f64| -> Vec<String> {
            let powers = BASE.iter().zip(self.0).filter(|(_, power)| sign * power > 0.0);
            powers.map(|(name, power)| one((name, sign * power))).collect()
        };
        let mut said = of(1.0).join("*");
        if said.is_empty() {
            said.push('1');
        }
        for below in of(-1.0) {
            let _ = write!(said, "/{below}");
        }
        said
    }
}

/// A unit: how much of the base it is, and of which.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Unit {
    /// One of it in mm, min, N, K and rad.
    pub factor: f64,
    pub(super) dimension: Dimension,
}

impl Unit {
    /// Of a plain number.
    pub const ONE: Self = Self { factor: 1.0, dimension: Dimension::NONE };

    /// A unit as the contract writes it: `m/min`, `um`, `N/mm^2`; `None` where it is not known.
    pub fn read(text: &str) -> Option<Self> {
        let mut unit = Self::ONE;
        let mut sign = 1.0;
        let mut rest = text.trim();
        loop {
            let end = rest.find(['*', '/']).unwrap_or(rest.len());
            unit = unit.times(Self::one(rest[..end].trim())?, sign);
            match rest[end..].chars().next() {
                Some(operator) => {
                    sign = if operator == '/' { -1.0 } else { 1.0 };
                    rest = &rest[end + 1..];
                }
                None => return Some(unit),
            }
        }
    }

    fn one(text: &str) -> Option<Self> {
        let (name, power) = match text.split_once('^') {
            None => (text, 1),
            Some((name, power)) => (name, power.parse().ok().filter(|power: &i32| power.abs() <= MOST_POWER)?),
        };
        if name == "1" {
            return Some(Self::ONE);
        }
        let (_, factor, powers) = KNOWN.iter().find(|(known, ..)| *known == name)?;
        Some(Self { factor: factor.powi(power), dimension: Dimension(*powers).power(f64::from(power)) })
    }

    fn times(self, other: Self, sign: f64) -> Self {
        Self { factor: self.factor * other.factor.powf(sign), dimension: self.dimension.times(other.dimension, sign) }
    }
}
