//! Numbers as they are written into a program (`program/6`).

use super::super::reader::NumberInText;

/// Nearest whole multiple, halves away from zero.
pub(super) fn rounded(value: f64, grid: f64) -> f64 {
    (value / grid).round() * grid
}

/// A number in the form of the one that it replaces, with no more decimals than a step has or it had.
pub(crate) fn number_like(before: &str, length_mm: f64, old: &NumberInText, step: f64) -> String {
    if let Some(step_mm) = old.step_mm {
        let steps = length_mm / step_mm;
        if (steps - steps.round()).abs() < 1e-6 {
            return format!("{:.0}", steps.round() + 0.0);
        }
    }
    let value = length_mm / old.unit_mm;
    let mut number = decimal(value, step);
    // As many decimals as there were.
    if let Some((_, decimals)) = before.split_once('.') {
        let kept = decimals.chars().filter(char::is_ascii_digit).count();
        let now = number.split_once('.').map_or(0, |(_, decimals)| decimals.len());
        number.extend(std::iter::repeat_n('0', kept.saturating_sub(now)));
    }
    let bare = before.trim_start_matches(['+', '-']);
    if bare.starts_with('.') {
        number = number.replacen("0.", ".", 1);
    }
    if before.starts_with('+') && !number.starts_with('-') {
        number.insert(0, '+');
    }
    number
}

/// A number with a decimal point and no more decimals than it needs.
pub(crate) fn decimal(value: f64, step: f64) -> String {
    // A step has six decimals at the most.
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    let decimals = (-step.log10() - 1e-9).ceil().clamp(1.0, 6.0) as usize;
    let value = rounded(value, step) + 0.0;
    let mut text = format!("{value:.decimals$}");
    text.truncate(text.trim_end_matches('0').len());
    if text.starts_with("-0.") && value.abs() < 0.5 * step {
        text.remove(0);
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_the_decimals_that_they_need() {
        let written = [21.995, 22.0, -0.0004, 0.5, -3.1].map(|value| decimal(value, 1e-3));
        assert_eq!(written, ["21.995", "22.", "0.", "0.5", "-3.1"]);
    }
}
