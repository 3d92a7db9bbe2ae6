//! Units of the contract and those that a user's table may bring instead.

#[cfg(test)]
mod tests;

/// A unit: its spellings, its dimension, its size in the base unit of the dimension.
struct Unit {
    spellings: &'static [&'static str],
    dimension: Dimension,
    size: Size,
    /// Whether a number that lies outside its range may have been meant in it.
    is_usual: bool,
}

/// How many base units a unit is.
#[derive(Clone, Copy)]
enum Size {
    /// `times / over * 10^power`, exactly.
    Exact {
        times: u64,
        over: u64,
        power: i32,
    },
    Irrational(f64),
}

impl Size {
    fn value(self) -> f64 {
        match self {
            Self::Exact { times, over, power } => times as f64 / over as f64 * 10_f64.powi(power),
            Self::Irrational(size) => size,
        }
    }
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

type Spellings = &'static [&'static str];

/// A power of ten of the base unit.
const fn unit(spellings: Spellings, dimension: Dimension, power: i32) -> Unit {
    ratio(spellings, dimension, (1, 1), power)
}

/// `times * 10^power` base units.
const fn multiple(spellings: Spellings, dimension: Dimension, times: u64, power: i32) -> Unit {
    ratio(spellings, dimension, (times, 1), power)
}

/// `times / over * 10^power` base units.
const fn ratio(spellings: Spellings, dimension: Dimension, (times, over): (u64, u64), power: i32) -> Unit {
    Unit { spellings, dimension, size: Size::Exact { times, over, power }, is_usual: true }
}

const fn irrational(spellings: Spellings, dimension: Dimension, size: f64) -> Unit {
    Unit { spellings, dimension, size: Size::Irrational(size), is_usual: true }
}

impl Unit {
    /// Taken where it is named, but nobody who forgets a unit means it.
    const fn unusual(self) -> Self {
        Self { is_usual: false, ..self }
    }
}

/// International inch, mm.
pub const INCH_MM: f64 = 25.4;
/// Pound-force, N, times 10^13.
const LBF: u64 = 44_482_216_152_605;
/// Kilogram-force, N, times 10^5.
const KGF: u64 = 980_665;
/// Pound, kg, times 10^8.
const LB: u64 = 45_359_237;

/// The first spelling is the one that is printed.
static UNITS: &[Unit] = &[
    unit(&["mm"], Dimension::Length, 0),
    unit(&["um", "µm", "μm"], Dimension::Length, -3),
    unit(&["nm"], Dimension::Length, -6),
    unit(&["cm"], Dimension::Length, 1),
    unit(&["m"], Dimension::Length, 3),
    unit(&["km"], Dimension::Length, 6),
    multiple(&["inch", "in"], Dimension::Length, 254, -1),
    multiple(&["uin", "µin", "μin"], Dimension::Length, 254, -7).unusual(),
    multiple(&["thou", "mil"], Dimension::Length, 254, -4).unusual(),
    multiple(&["ft"], Dimension::Length, 3048, -1).unusual(),
    unit(&["mm/rev", "mm/r"], Dimension::FeedPerRev, 0),
    unit(&["um/rev", "µm/rev", "μm/rev"], Dimension::FeedPerRev, -3),
    multiple(&["inch/rev", "in/rev", "ipr"], Dimension::FeedPerRev, 254, -1),
    multiple(&["thou/rev", "mil/rev"], Dimension::FeedPerRev, 254, -4).unusual(),
    unit(&["mm/tooth", "mm/z"], Dimension::FeedPerTooth, 0),
    unit(&["um/tooth", "µm/tooth", "μm/tooth"], Dimension::FeedPerTooth, -3),
    multiple(&["inch/tooth", "in/tooth", "ipt"], Dimension::FeedPerTooth, 254, -1),
    multiple(&["thou/tooth", "mil/tooth"], Dimension::FeedPerTooth, 254, -4).unusual(),
    unit(&["m/min"], Dimension::Speed, 3),
    unit(&["mm/min"], Dimension::Speed, 0),
    multiple(&["m/s"], Dimension::Speed, 6, 4),
    multiple(&["mm/s"], Dimension::Speed, 6, 1),
    multiple(&["ft/min", "sfm", "fpm"], Dimension::Speed, 3048, -1).unusual(),
    multiple(&["ft/s"], Dimension::Speed, 18_288, 0).unusual(),
    multiple(&["inch/min", "in/min", "ipm"], Dimension::Speed, 254, -1).unusual(),
    unit(&["rpm", "1/min", "rev/min"], Dimension::Rotation, 0),
    multiple(&["rev/s"], Dimension::Rotation, 6, 1),
    irrational(&["rad/s"], Dimension::Rotation, 30.0 / std::f64::consts::PI).unusual(),
    unit(&["Hz", "1/s"], Dimension::Frequency, 0),
    unit(&["kHz"], Dimension::Frequency, 3),
    unit(&["deg", "°"], Dimension::Angle, 0),
    irrational(&["rad"], Dimension::Angle, 180.0 / std::f64::consts::PI),
    irrational(&["mrad"], Dimension::Angle, 0.18 / std::f64::consts::PI).unusual(),
    ratio(&["arcmin"], Dimension::Angle, (1, 6), -1).unusual(),
    ratio(&["arcsec"], Dimension::Angle, (1, 36), -2).unusual(),
    unit(&["N"], Dimension::Force, 0),
    unit(&["daN"], Dimension::Force, 1),
    unit(&["kN"], Dimension::Force, 3),
    unit(&["MN"], Dimension::Force, 6).unusual(),
    multiple(&["lbf"], Dimension::Force, LBF, -13).unusual(),
    multiple(&["klbf", "kip"], Dimension::Force, LBF, -10).unusual(),
    multiple(&["kgf", "kp"], Dimension::Force, KGF, -5).unusual(),
    unit(&["N m", "Nm", "N*m"], Dimension::Torque, 0),
    unit(&["N mm", "Nmm", "N*mm"], Dimension::Torque, -3),
    unit(&["N cm", "Ncm", "N*cm"], Dimension::Torque, -2),
    unit(&["kN m", "kNm", "kN*m"], Dimension::Torque, 3),
    multiple(&["lbf ft", "ft lbf", "lbf*ft", "ft*lbf"], Dimension::Torque, 3048 * LBF, -17).unusual(),
    multiple(&["lbf inch", "lbf in", "in lbf", "lbf*in", "in*lbf"], Dimension::Torque, 254 * LBF, -17).unusual(),
    multiple(&["kgf m", "kgf*m"], Dimension::Torque, KGF, -5).unusual(),
    unit(&["N/mm2", "N/mm²", "N/mm^2", "MPa"], Dimension::Stress, 0),
    unit(&["Pa", "N/m2", "N/m²", "N/m^2"], Dimension::Stress, -6),
    unit(&["kPa"], Dimension::Stress, -3),
    unit(&["GPa", "kN/mm2", "kN/mm²", "kN/mm^2"], Dimension::Stress, 3),
    unit(&["bar"], Dimension::Stress, -1).unusual(),
    // An inch is 25.4 mm, its square 645.16 mm².
    ratio(&["psi", "lbf/in2", "lbf/in²", "lbf/in^2"], Dimension::Stress, (LBF, 64_516), -11).unusual(),
    ratio(&["ksi"], Dimension::Stress, (LBF, 64_516), -8).unusual(),
    multiple(&["kgf/mm2", "kgf/mm²", "kgf/mm^2"], Dimension::Stress, KGF, -5).unusual(),
    multiple(&["kgf/cm2", "kgf/cm²", "kgf/cm^2"], Dimension::Stress, KGF, -7).unusual(),
    unit(&["N/mm", "kN/m"], Dimension::Stiffness, 0),
    unit(&["N/um", "N/µm", "N/μm", "kN/mm", "MN/m"], Dimension::Stiffness, 3),
    unit(&["N/m"], Dimension::Stiffness, -3),
    ratio(&["lbf/inch", "lbf/in"], Dimension::Stiffness, (LBF, 254), -12).unusual(),
    multiple(&["kgf/mm"], Dimension::Stiffness, KGF, -5).unusual(),
    unit(&["um/N", "µm/N", "μm/N", "mm/kN"], Dimension::Compliance, 0),
    unit(&["mm/N"], Dimension::Compliance, 3),
    unit(&["m/N"], Dimension::Compliance, 6),
    unit(&["nm/N", "um/kN", "µm/kN", "μm/kN"], Dimension::Compliance, -3),
    ratio(&["inch/lbf", "in/lbf"], Dimension::Compliance, (254, LBF), 15).unusual(),
    ratio(&["uin/lbf", "µin/lbf", "μin/lbf"], Dimension::Compliance, (254, LBF), 9).unusual(),
    unit(&["kW"], Dimension::Power, 0),
    unit(&["W"], Dimension::Power, -3),
    unit(&["MW"], Dimension::Power, 3),
    multiple(&["hp"], Dimension::Power, 74_569_987_158_227_022, -17).unusual(),
    multiple(&["PS"], Dimension::Power, 73_549_875, -8).unusual(),
    unit(&["s", "sec"], Dimension::Time, 0),
    unit(&["ms"], Dimension::Time, -3),
    unit(&["us", "µs", "μs"], Dimension::Time, -6).unusual(),
    multiple(&["min"], Dimension::Time, 6, 1),
    multiple(&["h"], Dimension::Time, 36, 2),
    unit(&["kg"], Dimension::Mass, 0),
    unit(&["g"], Dimension::Mass, -3),
    unit(&["t"], Dimension::Mass, 3),
    multiple(&["lb", "lbm"], Dimension::Mass, LB, -8).unusual(),
    unit(&["kg/m3", "kg/m³", "kg/m^3"], Dimension::Density, 0),
    unit(&["g/cm3", "g/cm³", "g/cm^3", "kg/dm3", "t/m3", "t/m³", "t/m^3"], Dimension::Density, 3),
    // A cubic inch is 16.387064 cm³.
    ratio(&["lb/in3", "lb/in³", "lb/in^3"], Dimension::Density, (LB, 16_387_064), 4).unusual(),
    unit(&["N s/mm", "N*s/mm", "Ns/mm", "kN s/m", "kN*s/m", "kNs/m"], Dimension::Damping, 0),
    unit(&["N s/m", "N*s/m", "Ns/m"], Dimension::Damping, -3),
    ratio(&["lbf s/inch", "lbf s/in", "lbf*s/in"], Dimension::Damping, (LBF, 254), -12).unusual(),
    unit(&["1"], Dimension::Share, 0),
    unit(&["%", "percent"], Dimension::Share, -2),
    unit(&["K", "°C", "degC"], Dimension::TemperatureRise, 0),
    ratio(&["°F", "degF"], Dimension::TemperatureRise, (5, 9), 0).unusual(),
    unit(&["um/(m K)", "um/m/K", "µm/(m K)", "1e-6/K", "ppm/K"], Dimension::Expansion, 0),
    unit(&["1/K"], Dimension::Expansion, 6),
    multiple(&["1/°F", "1/degF"], Dimension::Expansion, 18, 5).unusual(),
    unit(&["m/s2", "m/s²", "m/s^2"], Dimension::Acceleration, 0),
    unit(&["mm/s2", "mm/s²", "mm/s^2"], Dimension::Acceleration, -3),
    multiple(&["ft/s2", "ft/s²", "ft/s^2"], Dimension::Acceleration, 3048, -4).unusual(),
];

fn find(spelling: &str) -> Option<&'static Unit> {
    let spelling = spelling.trim();
    UNITS.iter().find(|unit| unit.spellings.contains(&spelling))
}

/// Every spelling of a unit of the same dimension, the unit itself among them.
pub fn alike(spelling: &str) -> impl Iterator<Item = &'static str> {
    let dimension = find(spelling).map(|unit| unit.dimension);
    UNITS.iter().filter(move |unit| Some(unit.dimension) == dimension).flat_map(|unit| unit.spellings).copied()
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

/// `value` of unit `from` in unit `to`: the shortest decimal number that stands for `value`, converted.
pub fn convert(value: f64, from: &str, to: &str) -> Option<f64> {
    converted(&format!("{value:e}"), from, to)
}

/// The decimal number that `text` writes (`-1.5`, `2e-3`), from unit `from` into unit `to`. It is rounded once, at the
/// end, so that `0.02757` mm and `27.57` um are the same to the last bit, however a table wrote them.
pub fn converted(text: &str, from: &str, to: &str) -> Option<f64> {
    let (from, to) = (find(from)?, find(to)?);
    if from.dimension != to.dimension {
        return None;
    }
    let finite = |number: f64| number.is_finite().then_some(number);
    if std::ptr::eq(from, to) {
        return finite(text.parse().ok()?);
    }
    match (from.size, to.size) {
        (Size::Exact { times, over, power }, Size::Exact { times: to_times, over: to_over, power: to_power }) => {
            let (times, over) = (u128::from(times) * u128::from(to_over), u128::from(over) * u128::from(to_times));
            finite(scaled(text, reduced(times, over), i64::from(power) - i64::from(to_power))?)
        }
        (from, to) => finite(text.parse::<f64>().ok()? * (from.value() / to.value())),
    }
}

/// A ratio without common divisors.
fn reduced(times: u128, over: u128) -> (u128, u128) {
    let (mut divisor, mut rest) = (times, over);
    while rest != 0 {
        (divisor, rest) = (rest, divisor % rest);
    }
    (times / divisor, over / divisor)
}

/// Digits of a quotient that does not end, far more than a number in memory has.
const QUOTIENT_DIGITS: usize = 40;

/// A decimal number as it is written, times `times / over * 10^shift`, in whole digits until it is read.
fn scaled(text: &str, (times, over): (u128, u128), shift: i64) -> Option<f64> {
    let (mantissa, exponent) = match text.split_once(['e', 'E']) {
        Some((mantissa, exponent)) => (mantissa, exponent.parse::<i64>().ok()?),
        None => (text, 0),
    };
    let (sign, mantissa) = match mantissa.strip_prefix('-') {
        Some(size) => ("-", size),
        None => ("", mantissa.strip_prefix('+').unwrap_or(mantissa)),
    };
    let (whole, decimals) = mantissa.split_once('.').unwrap_or((mantissa, ""));
    let digits: Option<Vec<u32>> = whole.chars().chain(decimals.chars()).map(|digit| digit.to_digit(10)).collect();
    let digits = digits.filter(|digits| !digits.is_empty())?;
    let (digits, further) = divided(&multiplied(&digits, times), over);
    let power = exponent
        .checked_add(shift)?
        .checked_sub(i64::try_from(decimals.len()).ok()?)?
        .checked_sub(i64::try_from(further).ok()?)?;
    let digits: Option<String> =
        digits.into_iter().map(|digit| char::from_digit(u32::try_from(digit).ok()?, 10)).collect();
    format!("{sign}{}e{power}", digits?).parse().ok()
}

/// Digits times a factor, most significant first.
fn multiplied(digits: &[u32], factor: u128) -> Vec<u128> {
    let mut product = Vec::with_capacity(digits.len() + 20);
    let mut carried = 0;
    for digit in digits.iter().rev() {
        carried += u128::from(*digit) * factor;
        product.push(carried % 10);
        carried /= 10;
    }
    while carried > 0 {
        product.push(carried % 10);
        carried /= 10;
    }
    product.reverse();
    product
}

/// Digits divided, and how many digits the quotient has after those.
fn divided(digits: &[u128], divisor: u128) -> (Vec<u128>, usize) {
    let mut quotient = Vec::with_capacity(digits.len() + QUOTIENT_DIGITS);
    let mut rest = 0;
    for digit in digits {
        rest = rest * 10 + digit;
        quotient.push(rest / divisor);
        rest %= divisor;
    }
    let mut further = 0;
    while rest != 0 && further < QUOTIENT_DIGITS {
        rest *= 10;
        quotient.push(rest / divisor);
        rest %= divisor;
        further += 1;
    }
    (quotient, further)
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
        .filter(|other| other.dimension == expected.dimension && other.is_usual)
        .map(|other| (other, other.size.value() / expected.size.value()))
        .filter(|(_, ratio)| is_usual_slip(*ratio))
        .filter_map(|(other, ratio)| {
            let spelling = other.spellings[0];
            let converted = convert(value, spelling, unit)?;
            let distance = aim.map_or(ratio.ln().abs(), |aim| (converted / aim).abs().ln().abs());
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
