//! The contents of a panel.

use precut_calc::calculator::{Glyph, Item, Panel, Role};

use super::glyph::{self, Place};
use super::page::{Escaped, Page, Px, put};
use super::scale::Scale;
use super::style::{Styles, role_class};
use super::{Wording, thin};

/// A drawing area, px.
#[derive(Debug, Clone, Copy)]
pub(super) struct Frame {
    pub(super) left: f64,
    pub(super) right: f64,
    pub(super) top: f64,
    pub(super) bottom: f64,
    pub(super) x: Scale,
    pub(super) y: Scale,
    /// Of its symbols.
    pub(super) glyph_size: f64,
}

impl Frame {
    fn point(&self, x: f64, y: f64) -> Option<(f64, f64)> {
        (x.is_finite() && y.is_finite()).then(|| (self.x.at(x), self.y.at(y)))
    }
}

/// Draws everything in a panel, in its order.
pub(super) fn items(page: &mut Page, panel: &Panel, frame: &Frame, styles: &Styles, wording: &Wording<'_>) {
    for item in &panel.items {
        let code = match item {
            Item::Line { name, .. }
            | Item::Band { name, .. }
            | Item::Points { name, .. }
            | Item::Bars { name, .. }
            | Item::Outline { name, .. } => name,
            Item::HeatMap { value, .. } => value.label,
            Item::Glyph { glyph, .. } => glyph::label(*glyph),
        };
        put!(page, "<g><title>{}</title>", Escaped(&(wording.label)(code)));
        match item {
            Item::Line { name, x, y, role } => line(page, frame, x, y, &styles.class(name, *role)),
            Item::Band { name, x, lower, upper, role } => {
                band(page, frame, (x, lower, upper), &styles.class(name, *role), *role);
            }
            Item::Points { name, x, y, role } => {
                points(page, frame, x, y, (&styles.class(name, *role), role_class(*role).1));
            }
            Item::Bars { .. } | Item::HeatMap { .. } => {}
            Item::Outline { name, x, y, role } => outline(page, frame, x, y, &styles.class(name, *role)),
            Item::Glyph { glyph, x, y } => {
                if let Some((px, py)) = frame.point(*x, *y) {
                    put!(page, "<g class=\"glyph\">");
                    glyph::draw(page, *glyph, place(panel, frame, *glyph, (*x, *y), (px, py)));
                    put!(page, "</g>");
                }
            }
        }
        put!(page, "</g>");
    }
}

/// Runs of points between gaps.
fn runs(points: impl Iterator<Item = Option<(f64, f64)>>) -> Vec<Vec<(f64, f64)>> {
    let mut runs = vec![Vec::new()];
    for point in points {
        match (point, runs.last_mut()) {
            (Some(point), Some(run)) => run.push(point),
            (None, Some(run)) if !run.is_empty() => runs.push(Vec::new()),
            _ => {}
        }
    }
    runs.retain(|run| !run.is_empty());
    runs
}

fn path(page: &mut Page, points: &[(f64, f64)]) {
    for (index, (x, y)) in points.iter().enumerate() {
        put!(page, "{}{} {}", if index == 0 { 'M' } else { 'L' }, Px(*x), Px(*y));
    }
}

fn line(page: &mut Page, frame: &Frame, x: &[f64], y: &[Option<f64>], class: &str) {
    let runs = runs(x.iter().zip(y).map(|(x, y)| y.and_then(|y| frame.point(*x, y))));
    let (single, long): (Vec<_>, Vec<_>) = runs.into_iter().partition(|run| run.len() == 1);
    if !long.is_empty() {
        put!(page, "<path class=\"line {class}\" d=\"");
        for run in long {
            path(page, &thin::line(run));
        }
        put!(page, "\"/>");
    }
    for (x, y) in single.into_iter().flatten() {
        put!(page, "<circle class=\"dot {class}\" cx=\"{}\" cy=\"{}\" r=\"2\"/>", Px(x), Px(y));
    }
}

fn band(page: &mut Page, frame: &Frame, (x, lower, upper): (&[f64], &[f64], &[f64]), class: &str, role: Role) {
    let pairs = x.iter().zip(lower.iter().zip(upper));
    let both = |(x, (low, high)): (&f64, (&f64, &f64))| frame.point(*x, *low).zip(frame.point(*x, *high));
    // Where one edge has a gap, so has the other.
    let (lower, upper): (Vec<_>, Vec<_>) = pairs.map(|pair| both(pair).unzip()).unzip();
    let (lower, upper) = (runs(lower.into_iter()), runs(upper.into_iter()));
    for (lower, upper) in lower.into_iter().zip(upper) {
        let (mut lower, upper) = (thin::line(lower), thin::line(upper));
        if role == Role::Tolerance {
            put!(page, "<path class=\"edge {class}\" d=\"");
            path(page, &upper);
            path(page, &lower);
            put!(page, "\"/>");
        }
        lower.reverse();
        put!(page, "<path class=\"band {class}\" d=\"");
        path(page, &[upper, lower].concat());
        put!(page, "z\"/>");
    }
}

fn points(page: &mut Page, frame: &Frame, x: &[f64], y: &[f64], (class, marker): (&str, &str)) {
    let points: Vec<_> = x.iter().zip(y).filter_map(|(x, y)| frame.point(*x, *y)).collect();
    if points.is_empty() {
        return;
    }
    put!(page, "<path class=\"points {class}\" d=\"");
    for (x, y) in thin::markers(points) {
        put!(page, "M{} {}{marker}", Px(x), Px(y));
    }
    put!(page, "\"/>");
}

fn outline(page: &mut Page, frame: &Frame, x: &[f64], y: &[f64], class: &str) {
    let corners: Vec<_> = x.iter().zip(y).filter_map(|(x, y)| frame.point(*x, *y)).collect();
    if corners.len() > 1 {
        put!(page, "<path class=\"outline {class}\" d=\"");
        path(page, &thin::line(corners));
        put!(page, "z\"/>");
    }
}

/// The part's lowest and highest corner, in the units of the axis; `None` without a part.
fn part_span(panel: &Panel) -> Option<(f64, f64)> {
    panel
        .items
        .iter()
        .filter_map(|item| match item {
            Item::Outline { y, role: Role::Part, .. } => Some(y),
            _ => None,
        })
        .flatten()
        .copied()
        .filter(|y| y.is_finite())
        .fold(None, |span, y| span.map_or(Some((y, y)), |(low, high): (f64, f64)| Some((low.min(y), high.max(y)))))
}

/// Whether a symbol at this height stands on the upper side of the part.
pub(super) fn stands_above(panel: &Panel, y: f64) -> bool {
    part_span(panel).is_none_or(|(low, high)| y >= f64::midpoint(low, high))
}

/// Half of the part's height where it is nearest to `x`, px.
fn reach(panel: &Panel, frame: &Frame, x: f64, y: f64) -> Option<f64> {
    let corners = panel.items.iter().filter_map(|item| match item {
        Item::Outline { x, y, role: Role::Part, .. } => Some(x.iter().copied().zip(y.iter().copied())),
        _ => None,
    });
    let corners: Vec<(f64, f64)> = corners.flatten().filter(|(x, y)| x.is_finite() && y.is_finite()).collect();
    let nearest = corners.iter().map(|corner| (corner.0 - x).abs()).min_by(f64::total_cmp)?;
    let axis = frame.y.at(y);
    corners
        .iter()
        .filter(|corner| (corner.0 - x).abs() <= nearest)
        .map(|corner| (frame.y.at(corner.1) - axis).abs())
        .max_by(f64::total_cmp)
}

fn place(panel: &Panel, frame: &Frame, glyph: Glyph, (x, y): (f64, f64), (px, py): (f64, f64)) -> Place {
    let mirrored = match glyph {
        Glyph::Chuck => px > f64::midpoint(frame.left, frame.right),
        _ => !stands_above(panel, y),
    };
    let reach = reach(panel, frame, x, y).unwrap_or(12.0);
    Place { x: px, y: py, reach, mirrored, size: frame.glyph_size }
}
