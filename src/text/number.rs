//! Numbers as people read them.

use super::Language;

/// Beyond it, 2^53, whole numbers are rounded already.
const WHOLE_BELOW: f64 = 9_007_199_254_740_992.0;

/// `x` with `digits` significant digits, without trailing zeros; very large and very small numbers with an exponent.
pub(crate) fn significant(x: f64, digits: usize) -> String {
    if x == 0.0 || !x.is_finite() {
        return if x.is_finite() { "0".to_owned() } else { x.to_string() };
    }
    let scientific = format!("{x:.*e}", digits.clamp(1, 17) - 1);
    let (mantissa, exponent) = scientific.split_once('e').unwrap_or((&scientific, "0"));
    let exponent: i32 = exponent.parse().unwrap_or(0);
    let mantissa = trimmed(mantissa);
    if !(-5..9).contains(&exponent) {
        return format!("{mantissa}e{exponent}");
    }
    let (sign, mantissa) = mantissa.strip_prefix('-').map_or(("", mantissa), |size| ("-", size));
    let digits = mantissa.replace('.', "");
    match usize::try_from(exponent) {
        Ok(exponent) if digits.len() <= exponent + 1 => format!("{sign}{digits:0<0$}", exponent + 1),
        Ok(exponent) => format!("{sign}{}.{}", &digits[..=exponent], &digits[exponent + 1..]),
        Err(_) => format!("{sign}0.{:0>1$}{digits}", "", usize::try_from(-1 - exponent).unwrap_or(0)),
    }
}

/// `x` as it is read where nothing says how: with six digits, a whole number with all of its digits.
pub(super) fn read(x: f64) -> String {
    let said = significant(x, 6);
    let is_whole = x.fract() == 0.0 && (1e6..WHOLE_BELOW).contains(&x.abs());
    let is_exact = said.parse::<f64>().is_ok_and(|said| said.total_cmp(&x).is_eq());
    if is_whole && !is_exact { format!("{x:.0}") } else { said }
}

/// `x` with `decimals` digits after the point.
pub(super) fn fixed(x: f64, decimals: usize) -> String {
    format!("{x:.*}", decimals.min(17))
}

fn trimmed(number: &str) -> &str {
    if number.contains('.') { number.trim_end_matches('0').trim_end_matches('.') } else { number }
}

/// A number as it stands where nothing says how it is read.
pub(crate) fn spoken_number(x: f64, language: Language) -> String {
    spoken(&read(x), language)
}

/// A number as it stands in a sentence of that language.
pub(super) fn spoken(number: &str, language: Language) -> String {
    match language.decimal() {
        '.' => number.to_owned(),
        decimal => number.replace('.', decimal.encode_utf8(&mut [0; 4])),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_are_rounded_to_digits_not_to_decimals() {
        for (x, digits, expected) in [
            (104.3649, 3, "104"),
            (0.012_345, 3, "0.0123"),
            (210_000.0, 3, "210000"),
            (999.96, 4, "1000"),
            (-0.5, 2, "-0.5"),
            (0.0, 3, "0"),
            (2.1e11, 3, "2.1e11"),
            (1.23e-7, 2, "1.2e-7"),
            (123_456.0, 2, "120000"),
            (0.1 + 0.2, 6, "0.3"),
            (-0.000_123_45, 3, "-0.000123"),
            (1e-5, 3, "0.00001"),
            (-12_000.5, 2, "-12000"),
            (123.456, 6, "123.456"),
        ] {
            assert_eq!(significant(x, digits), expected);
        }
        assert_eq!(fixed(1.005, 1), "1.0");
    }

    #[test]
    fn whole_numbers_keep_their_digits() {
        for (x, expected) in [
            (8_388_608.0, "8388608"),
            (-1_073_741_825.0, "-1073741825"),
            (1e12, "1e12"),
            (123_456.7, "123457"),
            (1e300, "1e300"),
            (1_234_567.5, "1234570"),
            (0.0, "0"),
            (-0.0, "0"),
            (7.0, "7"),
        ] {
            assert_eq!(read(x), expected);
        }
    }
}
