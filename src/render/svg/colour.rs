//! Colours that colour-blind eyes tell apart: of roles (after Okabe and Ito), and of maps, evenly spaced in lightness
//! (OKLab), whose low end is next to the paper, on white paper and on a dark screen alike. The workbench draws with the
//! same ones: they are served to it.

use std::fmt::Write as _;

use super::page::{Page, put};

/// A colour by its name in the workbench, what has it in a picture and as what, on paper and on a dark screen.
type Colour = (&'static str, &'static [&'static str], &'static str, &'static str, &'static str);
const COLOURS: [Colour; 20] = [
    ("r-nominal", &["nominal", "n6"], "color", "5c6470", "aab2bd"),
    ("r-before", &["before", "plain.v2"], "color", "d55e00", "ff8f45"),
    ("r-after", &["after", "n2", "plain.v3"], "color", "007a59", "2fc79a"),
    ("r-command", &["command", "n0", "plain.v1"], "color", "0072b2", "62bdf5"),
    ("r-comparison", &["comparison", "n3", "plain.v4"], "color", "a8487f", "e59ac4"),
    ("r-part", &["part"], "color", "6b7480", "98a1ad"),
    ("r-part-fill", &["part.outline"], "fill", "dde1e6", "343a43"),
    ("r-stock", &["stock", "plain.v5"], "color", "a06a00", "dba63a"),
    ("r-tolerance", &["tolerance"], "color", "2a8fd0", "62bdf5"),
    ("r-uncertainty", &["uncertainty"], "color", "c98500", "f0b93a"),
    ("r-limit", &["limit"], "color", "b00020", "ff6b78"),
    ("r-stable", &["stable"], "color", "1f6fb4", "62bdf5"),
    ("r-unstable", &["unstable", "n1"], "color", "c24a00", "ff8f45"),
    ("r-plain", &["plain"], "color", "1a1d21", "e8eaed"),
    ("r-4", &["n4"], "color", "8a5c00", "dba63a"),
    ("r-5", &["n5"], "color", "1a7f9c", "6fd3ec"),
    ("r-7", &["n7"], "color", "5b4bb0", "ab9ff2"),
    ("plot-grid", &["grid"], "stroke", "e4e7eb", "2a2f36"),
    ("plot-frame", &["zero", "frame"], "stroke", "9aa2ad", "69727e"),
    ("plot-ink", &["number"], "fill", "4d5561", "aab2bd"),
];

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

/// Dark rules are for screens only: paper stays white.
const DARK: &str = "@media screen and (prefers-color-scheme:dark)";

/// A map's colours from low to high, on paper and on a dark screen.
fn map(diverging: bool) -> [Vec<&'static str>; 2] {
    let sequential = || SEQUENTIAL.iter().copied();
    if diverging {
        [DIVERGING.to_vec(), DIVERGING_DARK.to_vec()]
    } else {
        [sequential().collect(), sequential().rev().collect()]
    }
}

/// The rules of the roles.
pub(super) fn roles(page: &mut Page) {
    let rules = |page: &mut Page, is_dark: bool| {
        for (_, classes, property, light, dark) in COLOURS {
            let of: Vec<String> = classes.iter().map(|class| format!(".precut-figure .{class}")).collect();
            put!(page, "{}{{{property}:#{}}}", of.join(","), if is_dark { dark } else { light });
        }
    };
    rules(page, false);
    put!(page, "{DARK}{{");
    rules(page, true);
    put!(page, "}}");
}

/// The rules of all steps of one scale.
pub(super) fn css(page: &mut Page, diverging: bool) {
    let [light, dark] = map(diverging);
    rules(page, diverging, &light);
    put!(page, "{DARK}{{");
    rules(page, diverging, &dark);
    put!(page, "}}");
}

/// All colours as variables of a style sheet: roles by screen, the colours of maps of either screen as lists.
pub fn palette() -> String {
    let mut css = String::from(":root{");
    for (name, _, _, light, _) in COLOURS {
        let _ = write!(css, "--{name}:#{light};");
    }
    for (name, diverging) in [("map", false), ("map-diverging", true)] {
        let [light, dark] = map(diverging);
        let _ = write!(css, "--{name}:{};--{name}-dark:{};", light.join(" "), dark.join(" "));
    }
    let _ = write!(css, "}}{DARK}{{:root{{");
    for (name, _, _, _, dark) in COLOURS {
        let _ = write!(css, "--{name}:#{dark};");
    }
    css.push_str("}}");
    css
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
