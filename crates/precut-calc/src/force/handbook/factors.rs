//! Correction factors for the geometry of the edge, table 23.

use super::Triple;
use crate::material::Certainty;

/// A row of table 23: factors at one angle or radius.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct FactorRow {
    /// Angle, deg, or radius, mm.
    pub at: f64,
    /// K for each component.
    pub factors: Triple,
    /// How certain they are.
    pub certainty: Certainty,
}

const fn likely(at: f64, main: f64, passive: f64, feed: f64) -> FactorRow {
    FactorRow { at, factors: Triple::of(main, passive, feed), certainty: Certainty::Likely }
}

const fn unity(at: f64) -> FactorRow {
    FactorRow { at, factors: Triple::ONE, certainty: Certainty::Confirmed }
}

/// K_phi over the lead angle, deg, carbide.
pub static LEAD_ANGLE_CARBIDE: [FactorRow; 4] =
    [likely(30.0, 1.08, 1.30, 0.78), unity(45.0), likely(60.0, 0.94, 0.77, 1.11), likely(90.0, 0.89, 0.50, 1.17)];

/// K_phi over the lead angle, deg, high-speed steel.
pub static LEAD_ANGLE_HSS: [FactorRow; 4] =
    [likely(30.0, 1.08, 1.63, 0.70), unity(45.0), likely(60.0, 0.98, 0.71, 1.27), likely(90.0, 1.08, 0.44, 1.82)];

/// K_gamma over the rake angle, deg, carbide.
pub static RAKE_CARBIDE: [FactorRow; 3] = [likely(-15.0, 1.25, 2.0, 2.0), likely(0.0, 1.1, 1.4, 1.4), unity(10.0)];

/// K_gamma over the rake angle, deg, high-speed steel: level over 12 to 15 and 20 to 25 degrees.
pub static RAKE_HSS: [FactorRow; 4] =
    [likely(12.0, 1.15, 1.6, 1.7), likely(15.0, 1.15, 1.6, 1.7), unity(20.0), unity(25.0)];

/// K_lambda over the inclination, deg, carbide.
pub static INCLINATION: [FactorRow; 4] =
    [likely(-5.0, 1.0, 0.75, 1.07), unity(0.0), likely(5.0, 1.0, 1.25, 0.85), likely(15.0, 1.0, 1.7, 0.65)];

/// K_r over the nose radius, mm, high-speed steel. The handbook may mean 5 mm where 4 mm stands here.
pub static NOSE_RADIUS_HSS: [FactorRow; 5] = [
    likely(0.5, 0.87, 0.66, 1.0),
    likely(1.0, 0.93, 0.82, 1.0),
    unity(2.0),
    likely(3.0, 1.04, 1.14, 1.0),
    FactorRow { at: 4.0, factors: Triple::of(1.10, 1.33, 1.0), certainty: Certainty::ToBeChecked },
];

/// How a table is read between its rows.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Reading {
    /// Straight lines over the angle.
    Linear,
    /// Straight lines in logarithms of both.
    LogLog,
}

/// The factors at `at` and how certain they are; `None` outside the table, NaN included.
pub(super) fn read(table: &[FactorRow], at: f64, reading: Reading) -> Option<(Triple, Certainty)> {
    let (first, last) = (table.first()?, table.last()?);
    if !(first.at..=last.at).contains(&at) {
        return None;
    }
    // The first row at or beyond `at` exists, since the last row is.
    let right = table.partition_point(|row| row.at < at);
    let to = &table[right];
    if right == 0 || to.at <= at {
        return Some((to.factors, to.certainty));
    }
    let from = &table[right - 1];
    let share = match reading {
        Reading::Linear => (at - from.at) / (to.at - from.at),
        Reading::LogLog => (at / from.at).ln() / (to.at / from.at).ln(),
    };
    let mix = |a: f64, b: f64| match reading {
        Reading::Linear => a + share * (b - a),
        Reading::LogLog => a * (share * (b / a).ln()).exp(),
    };
    let factors = Triple::of(
        mix(from.factors.main, to.factors.main),
        mix(from.factors.passive, to.factors.passive),
        mix(from.factors.feed, to.factors.feed),
    );
    Some((factors, from.certainty.max(to.certainty)))
}

/// Ends of a table.
pub(super) fn range(table: &[FactorRow]) -> (f64, f64) {
    (table.first().map_or(f64::NAN, |row| row.at), table.last().map_or(f64::NAN, |row| row.at))
}
