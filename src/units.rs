//! Units of the contract and those that a user's table may bring instead.

/// A unit: its spellings, its dimension, its size in the base unit of the dimension.
struct Unit {
    spellings: &'static [&'static str],
    dimension: Dimension,
    size: f64,
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Dimension {
    Length,
    FeedPerRev,
    FeedPerTooth,
    Speed,
    Frequency,
    Rotation,
    Angle,
    Force,
    Torque,
    Stress,
    Stiffness,
    Compliance,
    Power,
    Time,
    Mass,
    Density,
    Damping,
    Share,
    TemperatureRise,
    Expansion,
    Acceleration,
}

const fn unit(spellings: &'static [&'static str], dimension: Dimension, size: f64) -> Unit {
    Unit { spellings, dimension, size }
}

/// International inch, mm.
pub const INCH_MM: f64 = 25.4;

/// The first spelling is the one that is printed. Sizes are exact but for degrees.
static UNITS: &[Unit] = &[
    unit(&["mm"], Dimension::Length, 1.0),
    unit(&["um", "µm", "μm"], Dimension::Length, 1e-3),
    unit(&["nm"], Dimension::Length, 1e-6),
    unit(&["cm"], Dimension::Length, 10.0),
    unit(&["m"], Dimension::Length, 1e3),
    unit(&["km"], Dimension::Length, 1e6),
    unit(&["inch", "in"], Dimension::Length, INCH_MM),
    unit(&["mm/rev", "mm/r"], Dimension::FeedPerRev, 1.0),
    unit(&["um/rev", "µm/rev", "μm/rev"], Dimension::FeedPerRev, 1e-3),
    unit(&["inch/rev", "in/rev"], Dimension::FeedPerRev, INCH_MM),
    unit(&["mm/tooth"], Dimension::FeedPerTooth, 1.0),
    unit(&["um/tooth", "µm/tooth", "μm/tooth"], Dimension::FeedPerTooth, 1e-3),
    unit(&["inch/tooth", "in/tooth"], Dimension::FeedPerTooth, INCH_MM),
    unit(&["m/min"], Dimension::Speed, 1e3),
    unit(&["mm/min"], Dimension::Speed, 1.0),
    unit(&["m/s"], Dimension::Speed, 6e4),
    unit(&["mm/s"], Dimension::Speed, 60.0),
    unit(&["rpm", "1/min", "rev/min"], Dimension::Rotation, 1.0),
    unit(&["rev/s"], Dimension::Rotation, 60.0),
    unit(&["Hz", "1/s"], Dimension::Frequency, 1.0),
    unit(&["kHz"], Dimension::Frequency, 1e3),
    unit(&["deg", "°"], Dimension::Angle, 1.0),
    unit(&["rad"], Dimension::Angle, 180.0 / std::f64::consts::PI),
    unit(&["N"], Dimension::Force, 1.0),
    unit(&["daN"], Dimension::Force, 10.0),
    unit(&["kN"], Dimension::Force, 1e3),
    unit(&["N m", "Nm", "N*m"], Dimension::Torque, 1.0),
    unit(&["N mm", "Nmm", "N*mm"], Dimension::Torque, 1e-3),
    unit(&["kN m", "kNm", "kN*m"], Dimension::Torque, 1e3),
    unit(&["N/mm2", "N/mm²", "N/mm^2", "MPa"], Dimension::Stress, 1.0),
    unit(&["Pa", "N/m2", "N/m²", "N/m^2"], Dimension::Stress, 1e-6),
    unit(&["kPa"], Dimension::Stress, 1e-3),
    unit(&["GPa", "kN/mm2", "kN/mm²"], Dimension::Stress, 1e3),
    unit(&["N/mm"], Dimension::Stiffness, 1.0),
    unit(&["N/um", "N/µm", "N/μm", "kN/mm"], Dimension::Stiffness, 1e3),
    unit(&["N/m"], Dimension::Stiffness, 1e-3),
    unit(&["um/N", "µm/N", "μm/N"], Dimension::Compliance, 1.0),
    unit(&["mm/N"], Dimension::Compliance, 1e3),
    unit(&["m/N"], Dimension::Compliance, 1e6),
    unit(&["nm/N", "um/kN", "µm/kN", "μm/kN"], Dimension::Compliance, 1e-3),
    unit(&["kW"], Dimension::Power, 1.0),
    unit(&["W"], Dimension::Power, 1e-3),
    unit(&["MW"], Dimension::Power, 1e3),
    unit(&["s"], Dimension::Time, 1.0),
    unit(&["ms"], Dimension::Time, 1e-3),
    unit(&["min"], Dimension::Time, 60.0),
    unit(&["h"], Dimension::Time, 3600.0),
    unit(&["kg"], Dimension::Mass, 1.0),
    unit(&["g"], Dimension::Mass, 1e-3),
    unit(&["t"], Dimension::Mass, 1e3),
    unit(&["kg/m3", "kg/m³", "kg/m^3"], Dimension::Density, 1.0),
    unit(&["g/cm3", "g/cm³", "g/cm^3", "kg/dm3"], Dimension::Density, 1e3),
    unit(&["N s/mm", "N*s/mm", "Ns/mm"], Dimension::Damping, 1.0),
    unit(&["N s/m", "N*s/m", "Ns/m"], Dimension::Damping, 1e-3),
    unit(&["1"], Dimension::Share, 1.0),
    unit(&["%", "percent"], Dimension::Share, 1e-2),
    unit(&["K", "°C", "degC"], Dimension::TemperatureRise, 1.0),
    unit(&["um/(m K)", "um/m/K", "µm/(m K)", "1e-6/K", "ppm/K"], Dimension::Expansion, 1.0),
    unit(&["1/K"], Dimension::Expansion, 1e6),
    unit(&["m/s2", "m/s²", "m/s^2"], Dimension::Acceleration, 1.0),
    unit(&["mm/s2", "mm/s²", "mm/s^2"], Dimension::Acceleration, 1e-3),
];

fn find(spelling: &str) -> Option<&'static Unit> {
    let spelling = spelling.trim();
    UNITS.iter().find(|unit| unit.spellings.contains(&spelling))
}

/// Units of the same dimension, as they are printed, the unit itself among them.
pub fn alike(spelling: &str) -> impl Iterator<Item = &'static str> {
    let dimension = find(spelling).map(|unit| unit.dimension);
    UNITS.iter().filter(move |unit| Some(unit.dimension) == dimension).map(|unit| unit.spellings[0])
}

/// How the unit stands at the end of a field's name: `_um_per_n` for `um/N`, nothing for `1`.
pub fn suffix(spelling: &str) -> String {
    let words: String = match spelling {
        "" | "1" | "money" => return String::new(),
        "%" => "percent".to_owned(),
        "rev/min" => "rpm".to_owned(),
        other => other.replace('/', " per ").replace(['(', ')'], "").to_lowercase(),
    };
    words.split_whitespace().fold(String::new(), |suffix, word| format!("{suffix}_{word}"))
}

/// `value` of unit `from` in unit `to`. A factor below 1 is applied as a division by its inverse, which is exact for
/// powers of ten: 12 um is 0.012 mm to the last bit.
pub fn convert(value: f64, from: &str, to: &str) -> Option<f64> {
    let (from, to) = (find(from)?, find(to)?);
    if from.dimension != to.dimension {
        return None;
    }
    if std::ptr::eq(from, to) {
        return Some(value);
    }
    let up = from.size / to.size;
    let down = to.size / from.size;
    Some(if up >= 1.0 { value * nearly_whole(up) } else { value / nearly_whole(down) })
}

/// Ratios of sizes such as 1e-3/1e-6 that miss a whole number by rounding alone.
fn nearly_whole(ratio: f64) -> f64 {
    let whole = ratio.round();
    if (ratio - whole).abs() <= 1e-12 * ratio { whole } else { ratio }
}

/// The unit that a number outside `range` was probably meant in: with it the number would lie inside.
///
/// Considered are units of the same dimension a power of 1000 or an inch away, and degrees against radians. Where
/// several would do, the one that brings the number nearest to `typical` (by ratio), and without a typical value the
/// one nearest to the middle of the range.
pub fn probably_meant(value: f64, unit: &str, range: (f64, f64), typical: Option<f64>) -> Option<Meant> {
    let expected = find(unit)?;
    let (low, high) = range;
    if value == 0.0 || !value.is_finite() {
        return None;
    }
    let aim =
        typical.filter(|aim| *aim != 0.0).or_else(|| (low > 0.0 && high.is_finite()).then(|| (low * high).sqrt()));
    UNITS
        .iter()
        .filter(|other| other.dimension == expected.dimension && is_usual_slip(other.size / expected.size))
        .filter_map(|other| {
            let spelling = other.spellings[0];
            let converted = convert(value, spelling, unit)?;
            let distance =
                aim.map_or((other.size / expected.size).ln().abs(), |aim| (converted / aim).abs().ln().abs());
            (converted >= low && converted <= high).then_some((distance, Meant { unit: spelling, converted }))
        })
        .min_by(|a, b| a.0.total_cmp(&b.0))
        .map(|(_, meant)| meant)
}

/// A unit that a number was probably meant in.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Meant {
    /// The unit.
    pub unit: &'static str,
    /// The number in the unit of the contract.
    pub converted: f64,
}

/// A power of 1000 or of 1000 inches, or 180/pi.
fn is_usual_slip(ratio: f64) -> bool {
    let thousands = |ratio: f64| {
        let power = ratio.log10() / 3.0;
        power.abs() > 0.5 && (power - power.round()).abs() < 1e-9
    };
    let inch = |ratio: f64| {
        let power = (ratio / INCH_MM).log10() / 3.0;
        (power - power.round()).abs() < 1e-9
    };
    thousands(ratio) || inch(ratio) || (ratio - 180.0 / std::f64::consts::PI).abs() < 1e-9
}

#[cfg(test)]
#[allow(clippy::unwrap_used, clippy::float_cmp)]
mod tests {
    use super::*;

    #[test]
    fn a_unit_converts_within_its_dimension_only() {
        assert_eq!(convert(12.0, "um", "mm"), Some(0.012));
        assert_eq!(convert(0.012, "mm", "µm"), Some(12.0));
        assert_eq!(convert(2.0, "inch", "mm"), Some(50.8));
        assert_eq!(convert(1.0, "mm", "N"), None);
        assert_eq!(convert(210.0, "GPa", "N/mm2"), Some(210_000.0));
        assert_eq!(convert(30.0, "nm", "um"), Some(0.03));
        assert_eq!(convert(83.0, "%", "1"), Some(0.83));
        assert_eq!(convert(1.0, "furlong", "mm"), None);
    }

    #[test]
    fn suffixes_are_those_of_the_contract() {
        for (unit, expected) in [
            ("um/N", "_um_per_n"),
            ("N/mm2", "_n_per_mm2"),
            ("um/(m K)", "_um_per_m_k"),
            ("mm/rev", "_mm_per_rev"),
            ("%", "_percent"),
            ("rev/min", "_rpm"),
            ("1", ""),
        ] {
            assert_eq!(suffix(unit), expected);
        }
    }

    #[test]
    fn no_spelling_stands_for_two_units() {
        let mut seen = std::collections::BTreeSet::new();
        for unit in UNITS {
            for spelling in unit.spellings {
                assert!(seen.insert(*spelling), "{spelling} twice");
            }
        }
    }

    #[test]
    fn a_modulus_in_gigapascals_is_recognised() {
        let meant = probably_meant(210.0, "N/mm2", (1e3, 1e6), Some(210_000.0)).unwrap();
        assert_eq!((meant.unit, meant.converted), ("GPa", 210_000.0));
        let meant = probably_meant(2.1e11, "N/mm2", (1e3, 1e6), None).unwrap();
        assert_eq!((meant.unit, meant.converted), ("Pa", 210_000.0));
        // 0.21 would have to be TPa, which nobody writes.
        assert_eq!(probably_meant(0.21, "N/mm2", (1e3, 1e6), Some(210_000.0)), None);
    }

    #[test]
    fn an_inch_and_a_metre_are_told_apart_by_what_is_typical() {
        assert_eq!(probably_meant(0.5, "mm", (1.0, 2e4), Some(500.0)).unwrap().unit, "m");
        assert_eq!(probably_meant(0.5, "mm", (1.0, 2e4), Some(12.0)).unwrap().unit, "inch");
        assert_eq!(probably_meant(0.25, "deg", (1.0, 90.0), Some(45.0)).unwrap().unit, "rad");
    }
}
