//! Symbols of workholding and tool.

use precut_calc::calculator::Glyph;

use super::page::{Page, Px, put};

/// Code of a symbol's name.
pub(super) fn label(glyph: Glyph) -> &'static str {
    match glyph {
        Glyph::CentreLeft | Glyph::CentreRight => "glyph_centre",
        Glyph::Chuck => "glyph_chuck",
        Glyph::SteadyRest => "glyph_steady_rest",
        Glyph::FollowRest => "glyph_follow_rest",
        Glyph::Tool => "glyph_tool",
    }
}

/// How far it reaches beyond the end of the part, px.
pub(super) fn room_at_end(glyph: Glyph) -> f64 {
    match glyph {
        Glyph::CentreLeft | Glyph::CentreRight | Glyph::Chuck => 34.0,
        Glyph::SteadyRest | Glyph::FollowRest | Glyph::Tool => 14.0,
    }
}

/// How far it reaches beyond the surface of the part, px, and whether only on its own side.
pub(super) fn room_above(glyph: Glyph) -> (f64, bool) {
    match glyph {
        Glyph::CentreLeft | Glyph::CentreRight => (4.0, false),
        Glyph::Chuck => (16.0, false),
        Glyph::SteadyRest | Glyph::FollowRest | Glyph::Tool => (34.0, true),
    }
}

/// Where and how a symbol is drawn.
#[derive(Debug, Clone, Copy)]
pub(super) struct Stance {
    /// Its tip, px.
    pub(super) x: f64,
    pub(super) y: f64,
    /// From the axis of the part to its surface, px.
    pub(super) reach: f64,
    /// Whether the part lies to the left of it or above it: the symbol is mirrored.
    pub(super) mirrored: bool,
    /// 1 for full size.
    pub(super) size: f64,
    /// Clockwise, degrees.
    pub(super) turn: f64,
}

/// Draws a symbol, its tip at the place.
pub(super) fn draw(page: &mut Page, glyph: Glyph, stance: Stance) {
    let Stance { x, y, size, mirrored, .. } = stance;
    let flip = |condition: bool| if condition { -size } else { size };
    let across = flip(glyph == Glyph::CentreRight || (glyph == Glyph::Chuck && mirrored));
    let up = flip(mirrored && matches!(glyph, Glyph::SteadyRest | Glyph::FollowRest | Glyph::Tool));
    put!(page, "<g transform=\"translate({} {})", Px(x), Px(y));
    if stance.turn.abs() > 0.0 {
        put!(page, "rotate({})", Px(stance.turn));
    }
    put!(page, "scale({} {})\">", Px(across), Px(up));
    match glyph {
        // 60 degrees, with its shank.
        Glyph::CentreLeft | Glyph::CentreRight => {
            put!(page, "<path d=\"M0 0L-15.6-9H-30V9H-15.6z\"/><path d=\"M-15.6-9V9\"/>");
        }
        Glyph::Chuck => chuck(page, stance.reach / size.max(0.1)),
        // A roller in a bracket that stands on the ground.
        Glyph::SteadyRest => {
            put!(
                page,
                "<path d=\"M0-6V-22M-10-22H10M-10-27l5 5M-5-27l5 5M0-27l5 5M5-27l5 5\"/><circle cy=\"-6\" r=\"6\"/><circle class=\"solid\" cy=\"-6\" r=\"1.4\"/>"
            );
        }
        // The same on a slide that goes along.
        Glyph::FollowRest => {
            put!(
                page,
                "<path d=\"M0-6V-18\"/><rect x=\"-9\" y=\"-24\" width=\"18\" height=\"6\"/><path d=\"M-10-29H10M-6-32l-4 3l4 3M6-32l4 3l-4 3\" fill=\"none\"/><circle cy=\"-6\" r=\"6\"/><circle class=\"solid\" cy=\"-6\" r=\"1.4\"/>"
            );
        }
        // An insert on its shank.
        Glyph::Tool => {
            put!(page, "<path d=\"M-5.5-12V-32H5.5V-12z\"/><path class=\"solid\" d=\"M0 0L6.5-9L0-18L-6.5-9z\"/>");
        }
    }
    put!(page, "</g>");
}

/// Body and two jaws that grip the part at `reach`.
fn chuck(page: &mut Page, reach: f64) {
    let jaw = Px(reach.max(5.0));
    let half = reach.max(5.0) + 12.0;
    put!(page, "<rect x=\"-30\" y=\"{}\" width=\"22\" height=\"{}\"/>", Px(-half), Px(2.0 * half));
    put!(page, "<path d=\"M-8-{jaw}H12v-8H-8zM-8 {jaw}H12v8H-8z\"/>");
}
