//! Colours of maps: evenly spaced in lightness (OKLab), told apart by colour-blind eyes. Low is next to the paper,
//! on white paper and on a dark screen alike.

use super::page::{Page, put};

/// Steps of a scale.
pub(super) const STEPS: u8 = 20;
const COUNT: usize = STEPS as usize;

/// From low to high on paper: pale yellow over green to dark blue. Backwards on a dark screen.
const SEQUENTIAL: [&str; COUNT] = [
    "f2e7a0", "dbe29e", "c4dc9c", "add79a", "99cf9e", "86c7a3", "72bea7", "5cb6aa", "4facab", "47a1ac", "3e96ac",
    "368bac", "2f80ab", "2b76a7", "2a6c9f", "296297", "28588f", "274e88", "264480", "243a78",
];

/// Blue below, orange above, pale where they part.
const DIVERGING: [&str; COUNT] = [
    "0a4a80", "195b92", "276da4", "357fb7", "4991c7", "67a2d0", "84b3d9", "a1c5e1", "bdd6ea", "d9e7f2", "f7e3d2",
    "f3cfb3", "eeba94", "e9a674", "e29152", "d67f3c", "c76e30", "b85d22", "a94c13", "9a3b00",
];

/// The same on a dark screen, dark where they part.
const DIVERGING_DARK: [&str; COUNT] = [
    "9ad4fa", "85c1e9", "70aed9", "5c9cc8", "478ab8", "3778a4", "31668b", "2a5573", "24445c", "1d3446", "43301f",
    "593b23", "704726", "885228", "a05e29", "b66c31", "c87d44", "da8f56", "eda068", "ffb27a",
];

/// Class of a step.
pub(super) fn class(diverging: bool, step: u8) -> String {
    format!("{}{step}", if diverging { 'd' } else { 'm' })
}

/// The rules of all steps of one scale.
pub(super) fn css(page: &mut Page, diverging: bool) {
    let dark: Vec<&str> = if diverging { DIVERGING_DARK.to_vec() } else { SEQUENTIAL.iter().rev().copied().collect() };
    let light = if diverging { DIVERGING } else { SEQUENTIAL };
    rules(page, diverging, &light);
    put!(page, "@media screen and (prefers-color-scheme:dark){{");
    rules(page, diverging, &dark);
    put!(page, "}}");
}

fn rules(page: &mut Page, diverging: bool, colours: &[&str]) {
    for (step, colour) in (0..STEPS).zip(colours) {
        put!(page, ".precut-figure .{}{{fill:#{colour}}}", class(diverging, step));
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    /// Relative luminance as WCAG defines it.
    fn luminance(colour: &str) -> f64 {
        let part = |at: usize| f64::from(u8::from_str_radix(&colour[at..at + 2], 16).unwrap()) / 255.0;
        let linear = |c: f64| if c <= 0.04045 { c / 12.92 } else { ((c + 0.055) / 1.055).powf(2.4) };
        0.2126 * linear(part(0)) + 0.7152 * linear(part(2)) + 0.0722 * linear(part(4))
    }

    #[test]
    fn lightness_alone_tells_low_from_high() {
        assert!(SEQUENTIAL.is_sorted_by(|a, b| luminance(a) > luminance(b)));
        for (ends_are_dark, colours) in [(true, DIVERGING), (false, DIVERGING_DARK)] {
            let (below, above) = colours.split_at(COUNT / 2);
            assert!(below.is_sorted_by(|a, b| (luminance(a) < luminance(b)) == ends_are_dark));
            assert!(above.is_sorted_by(|a, b| (luminance(a) > luminance(b)) == ends_are_dark));
        }
    }
}
