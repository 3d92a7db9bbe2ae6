//! The contents of a panel.

use precut_calc::calculator::{Glyph, Item, Panel, Role, Spacing};

use super::bars::Stand;
use super::glyph::{self, Stance};
use super::map::Key;
use super::page::{Escaped, Page, Px, put};
use super::plane::{Place, Plane};
use super::style::{Styles, is_hatched, role_class};
use super::{Wording, ribbon, thin};

/// A drawing area, px.
#[derive(Debug, Clone, Copy)]
pub(super) struct Frame {
    pub(super) left: f64,
    pub(super) right: f64,
    pub(super) top: f64,
    pub(super) bottom: f64,
    pub(super) plane: Plane,
    /// Of its symbols.
    pub(super) glyph_size: f64,
}

/// Draws everything in a panel, in its order; the grid again over a map that hides it.
pub(super) fn items(
    page: &mut Page,
    (panel, key): (&Panel, Option<&Key<'_>>),
    frame: &Frame,
    (x, grid): (Spacing, &dyn Fn(&mut Page)),
    (styles, wording): (&Styles, &Wording<'_>),
) {
    let plane = &frame.plane;
    let mut stand = Stand::of(panel, x);
    for item in &panel.items {
        let code = match item {
            Item::Line { name, .. }
            | Item::Band { name, .. }
            | Item::Points { name, .. }
            | Item::Bars { name, .. }
            | Item::Ribbon { name, .. }
            | Item::Outline { name, .. } => *name,
            Item::HeatMap { value, .. } => value.label,
            Item::Glyph { glyph, .. } => glyph::label(*glyph),
            // Nobody takes hold of paper.
            Item::Handle(_) | Item::Setting(_) => continue,
        };
        put!(page, "<g><title>{}</title>", Escaped(&(wording.label)(code)));
        // Between a curve and the colours under it.
        match item {
            Item::Line { x, y, .. } if key.is_some() => line(page, plane, x, y, "casing"),
            Item::Points { x, y, role, .. } if key.is_some() => {
                points(page, plane, x, y, ("casing", role_class(*role).1));
            }
            _ => {}
        }
        match item {
            Item::Line { name, x, y, role } => line(page, plane, x, y, &styles.class(name, *role)),
            Item::Band { name, x, lower, upper, role } => {
                band(page, plane, (x, lower, upper), &styles.class(name, *role), *role);
            }
            Item::Points { name, x, y, role } => {
                points(page, plane, x, y, (&styles.class(name, *role), role_class(*role).1));
            }
            Item::Bars { name, x, y, role } => stand.draw(page, plane, (x, y), &styles.class(name, *role)),
            Item::Ribbon { name, role, .. } => {
                ribbon::draw(page, panel, frame, item, &styles.class(name, *role), wording);
            }
            Item::HeatMap { .. } => {
                if let Some(key) = key {
                    key.draw(page, plane, (x, panel.y.scale));
                    grid(page);
                }
            }
            Item::Outline { name, x, y, role } => outline(page, plane, x, y, &styles.class(name, *role)),
            Item::Glyph { glyph, x, y } => {
                if let Some(place) = plane.place(*x, *y) {
                    put!(page, "<g class=\"glyph\">");
                    glyph::draw(page, *glyph, stance(panel, frame, *glyph, (*x, *y), place));
                    put!(page, "</g>");
                }
            }
            Item::Handle(_) | Item::Setting(_) => {}
        }
        put!(page, "</g>");
    }
}

/// Runs of points between gaps.
fn runs(points: impl IntoIterator<Item = Option<Place>>) -> Vec<Vec<Place>> {
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

fn line(page: &mut Page, plane: &Plane, x: &[f64], y: &[Option<f64>], class: &str) {
    let mut places: Vec<_> = x.iter().zip(y).map(|(x, y)| y.and_then(|y| plane.place(*x, y))).collect();
    plane.close(&mut places);
    let (single, long): (Vec<_>, Vec<_>) = runs(places).into_iter().partition(|run| run.len() == 1);
    if !long.is_empty() {
        put!(page, "<path class=\"line {class}\" d=\"");
        for run in long {
            plane.draw(page, &thin::line(run));
        }
        put!(page, "\"/>");
    }
    for (x, y) in single.into_iter().flatten().map(|place| plane.bent(place)) {
        put!(page, "<circle class=\"dot {class}\" cx=\"{}\" cy=\"{}\" r=\"2\"/>", Px(x), Px(y));
    }
}

fn band(page: &mut Page, plane: &Plane, (x, lower, upper): (&[f64], &[f64], &[f64]), class: &str, role: Role) {
    let pairs = x.iter().zip(lower.iter().zip(upper));
    let both = |(x, (low, high)): (&f64, (&f64, &f64))| plane.place(*x, *low).zip(plane.place(*x, *high));
    // Where one edge has a gap, so has the other.
    let (mut lower, mut upper): (Vec<_>, Vec<_>) = pairs.map(|pair| both(pair).unzip()).unzip();
    plane.close(&mut lower);
    plane.close(&mut upper);
    for (lower, upper) in runs(lower).into_iter().zip(runs(upper)) {
        let (mut lower, upper) = (thin::line(lower), thin::line(upper));
        if role == Role::Tolerance {
            put!(page, "<path class=\"edge {class}\" d=\"");
            plane.draw(page, &upper);
            plane.draw(page, &lower);
            put!(page, "\"/>");
        }
        lower.reverse();
        let area = [upper, lower].concat();
        filled(page, plane, &area, &format!("band {class}"), role);
    }
}

fn points(page: &mut Page, plane: &Plane, x: &[f64], y: &[f64], (class, marker): (&str, &str)) {
    let places = x.iter().zip(y).filter_map(|(x, y)| plane.place(*x, *y)).map(|place| plane.bent(place));
    let points: Vec<_> = places.collect();
    if points.is_empty() {
        return;
    }
    put!(page, "<path class=\"points {class}\" d=\"");
    for (x, y) in thin::markers(points) {
        put!(page, "M{} {}{marker}", Px(x), Px(y));
    }
    put!(page, "\"/>");
}

fn outline(page: &mut Page, plane: &Plane, x: &[f64], y: &[f64], class: &str) {
    let corners: Vec<_> = x.iter().zip(y).filter_map(|(x, y)| plane.place(*x, *y)).collect();
    if corners.len() > 1 {
        put!(page, "<path class=\"outline {class}\" d=\"");
        plane.draw(page, &thin::line(corners));
        put!(page, "z\"/>");
    }
}

/// A closed area, and its hatching.
fn filled(page: &mut Page, plane: &Plane, area: &[Place], class: &str, role: Role) {
    let hatch = is_hatched(role).then_some("hatch");
    for class in std::iter::once(class).chain(hatch) {
        put!(page, "<path class=\"{class}\" d=\"");
        plane.draw(page, area);
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
fn reach(panel: &Panel, plane: &Plane, x: f64, y: f64) -> Option<f64> {
    let corners = panel.items.iter().filter_map(|item| match item {
        Item::Outline { x, y, role: Role::Part, .. } => Some(x.iter().copied().zip(y.iter().copied())),
        _ => None,
    });
    let corners: Vec<(f64, f64)> = corners.flatten().filter(|(x, y)| x.is_finite() && y.is_finite()).collect();
    let nearest = corners.iter().map(|corner| (corner.0 - x).abs()).min_by(f64::total_cmp)?;
    let axis = plane.along_y().at(y)?;
    corners
        .iter()
        .filter(|corner| (corner.0 - x).abs() <= nearest)
        .filter_map(|corner| Some((plane.along_y().at(corner.1)? - axis).abs()))
        .max_by(f64::total_cmp)
}

fn stance(panel: &Panel, frame: &Frame, glyph: Glyph, (x, y): (f64, f64), place: Place) -> Stance {
    let (px, py) = frame.plane.bent(place);
    let upright = Stance { x: px, y: py, reach: 12.0, mirrored: false, size: frame.glyph_size, turn: 0.0 };
    match frame.plane {
        // Its tip inward.
        Plane::Round { .. } => {
            let angle = x.rem_euclid(360.0);
            let turn = match glyph {
                Glyph::CentreLeft | Glyph::Chuck => 180.0 - angle,
                Glyph::CentreRight => -angle,
                Glyph::SteadyRest | Glyph::FollowRest | Glyph::Tool => 90.0 - angle,
            };
            Stance { turn, ..upright }
        }
        Plane::Flat { .. } => {
            let mirrored = match glyph {
                Glyph::Chuck => px > f64::midpoint(frame.left, frame.right),
                _ => !stands_above(panel, y),
            };
            Stance { mirrored, reach: reach(panel, &frame.plane, x, y).unwrap_or(upright.reach), ..upright }
        }
    }
}
