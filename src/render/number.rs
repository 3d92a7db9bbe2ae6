//! Numbers as text, the same on every machine.

/// The shortest decimal text that reads back as the same number; with an exponent where the digits
/// would be mostly zeros. `None` for what is no number.
pub(super) fn shortest(value: f64) -> Option<String> {
    if !value.is_finite() {
        return None;
    }
    let size = value.abs();
    Some(if size == 0.0 {
        "0".to_owned()
    } else if (1e-6..1e16).contains(&size) {
        format!("{value}")
    } else {
        format!("{value:e}")
    })
}

/// With at most `decimals` decimals, halves rounded away from zero, zeros at the end dropped, no
/// minus before a zero.
pub(super) fn at_most(value: f64, decimals: usize) -> String {
    let text = format!("{:.decimals$}", round_half_away(value, decimals));
    let text = if text.contains('.') { text.trim_end_matches('0').trim_end_matches('.') } else { &text };
    if text == "-0" { "0".to_owned() } else { text.to_owned() }
}

/// Rust's formatting decides halves by the exact binary value: 0.0005 with three decimals may come
/// out as 0.000 or 0.001. A machine's operator expects the decimal one.
fn round_half_away(value: f64, decimals: usize) -> f64 {
    let scale = 10_f64.powi(i32::try_from(decimals).unwrap_or(0));
    let scaled = (value * scale).round() / scale;
    // Beyond 2^53 there are no decimals left to round.
    if scaled.is_finite() { scaled } else { value }
}

/// How many decimals the shortest text of `step` has.
pub(super) fn decimals_of(step: f64) -> usize {
    format!("{step}").split_once('.').map_or(0, |(_, decimals)| decimals.len())
}

#[cfg(test)]
#[allow(clippy::unwrap_used, clippy::float_cmp)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn shortest_is_short() {
        for (value, text) in [
            (0.0, "0"),
            (-0.0, "0"),
            (1.0, "1"),
            (0.1, "0.1"),
            (-12.5, "-12.5"),
            (1e-7, "1e-7"),
            (2.5e20, "2.5e20"),
            (0.1 + 0.2, "0.30000000000000004"),
        ] {
            assert_eq!(shortest(value).unwrap(), text);
        }
        assert_eq!(shortest(f64::NAN), None);
        assert_eq!(shortest(f64::INFINITY), None);
    }

    #[test]
    fn halves_go_away_from_zero() {
        for (value, decimals, text) in [
            (0.0005, 3, "0.001"),
            (-0.0005, 3, "-0.001"),
            (89.9665, 3, "89.967"),
            (2.5, 0, "3"),
            (96.0, 3, "96"),
            (100.0, 0, "100"),
            (-0.0001, 3, "0"),
        ] {
            assert_eq!(at_most(value, decimals), text, "{value} with {decimals}");
        }
    }

    #[test]
    fn decimals_of_increments() {
        assert_eq!(decimals_of(0.001), 3);
        assert_eq!(decimals_of(0.0005), 4);
        assert_eq!(decimals_of(1.0), 0);
    }

    proptest! {
        #[test]
        fn shortest_reads_back(value in proptest::num::f64::NORMAL | proptest::num::f64::SUBNORMAL) {
            prop_assert_eq!(shortest(value).unwrap().parse::<f64>().unwrap(), value);
        }
    }
}
