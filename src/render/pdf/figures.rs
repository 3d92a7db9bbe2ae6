//! Numbers as they are printed.

use crate::render::number;
use crate::render::report::{Datum, Field};
use crate::text::significant;

/// Digits of the largest number of a column.
const COLUMN_DIGITS: i32 = 5;
/// Digits of each where they are of many magnitudes.
const DIGITS: usize = 5;
/// A number that is written with so many characters stands as it is.
const SHORT: usize = 8;
/// Whole numbers below it are printed with all of their digits.
const WHOLE_BELOW: f64 = 1e12;

/// A value of a job or a result.
pub(super) fn datum(field: &Field, decimal: char) -> String {
    match &field.value {
        Datum::Word(word) => word.clone(),
        Datum::Number(number) => alone(*number, field.digits, decimal),
    }
}

/// As it came where it is short, else with some digits.
fn alone(value: f64, digits: usize, decimal: char) -> String {
    let Some(shortest) = number::shortest(value) else { return String::new() };
    let text = if shortest.len() <= SHORT { shortest } else { significant(value, digits) };
    with_decimal(text, decimal)
}

fn with_decimal(text: String, decimal: char) -> String {
    if decimal == '.' { text } else { text.replace('.', decimal.encode_utf8(&mut [0; 4])) }
}

/// A column of numbers with their points under each other; over many magnitudes each with its own digits.
pub(super) fn column_texts(cells: &[Option<f64>], decimal: char) -> Vec<String> {
    let values = || cells.iter().flatten().copied().filter(|value| value.is_finite() && *value != 0.0).map(f64::abs);
    let largest = values().fold(0.0, f64::max);
    if largest < WHOLE_BELOW && values().all(|value| value.fract() == 0.0) {
        let text = |value: f64| number::at_most(value, 0);
        return cells.iter().map(|cell| cell.filter(|value| value.is_finite()).map(text).unwrap_or_default()).collect();
    }
    let decimals = (COLUMN_DIGITS - 1 - magnitude(largest)).clamp(0, 9);
    let least = values().fold(f64::INFINITY, f64::min);
    let is_even = magnitude(largest) < 9 && (least.is_infinite() || magnitude(least) >= 1 - decimals);
    let text = |value: f64| match usize::try_from(decimals) {
        Ok(decimals) if is_even => number::at_most(value, decimals),
        _ => significant(value, DIGITS),
    };
    let texts: Vec<String> =
        cells.iter().map(|cell| cell.filter(|value| value.is_finite()).map(text).unwrap_or_default()).collect();
    if !is_even {
        return texts.into_iter().map(|text| with_decimal(text, decimal)).collect();
    }
    let of = |text: &String| text.split_once('.').map_or(0, |(_, decimals)| decimals.len());
    let most = texts.iter().map(of).max().unwrap_or(0);
    let filled = |text: String| {
        let missing = most - of(&text);
        let point = if missing == most && most > 0 { "." } else { "" };
        if text.is_empty() { text } else { format!("{text}{point}{}", "0".repeat(missing)) }
    };
    texts.into_iter().map(|text| with_decimal(filled(text), decimal)).collect()
}

/// Power of ten of the first digit.
fn magnitude(value: f64) -> i32 {
    if value == 0.0 {
        return 0;
    }
    let written = format!("{value:e}");
    written.split_once('e').and_then(|(_, exponent)| exponent.parse().ok()).unwrap_or(0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn points_stand_under_each_other() {
        let texts = column_texts(&[Some(0.0), Some(12.5), None, Some(-103.456_78)], '.');
        assert_eq!(texts, ["0.00", "12.50", "", "-103.46"]);
        assert_eq!(column_texts(&[Some(1.0), Some(1_234_567.0)], '.'), ["1", "1234567"]);
        assert_eq!(column_texts(&[Some(0.2), Some(0.25)], ','), ["0,20", "0,25"]);
    }

    #[test]
    fn over_many_magnitudes_each_has_its_own_digits() {
        assert_eq!(column_texts(&[Some(1.0), Some(1.234_567e-7)], '.'), ["1", "1.2346e-7"]);
        assert_eq!(column_texts(&[Some(2e300), Some(f64::NAN)], '.'), ["2e300", ""]);
        assert_eq!(column_texts(&[], '.'), Vec::<String>::new());
    }

    #[test]
    fn a_number_alone_is_as_it_came_or_has_its_digits() {
        for (value, text) in [(210_000.0, "210000"), (0.1 + 0.2, "0,3"), (-104.364_912, "-104,36"), (1e-9, "1e-9")] {
            assert_eq!(alone(value, 5, ','), text);
        }
        assert_eq!(alone(1.153_187_2e-7, 2, '.'), "1.2e-7");
    }
}
