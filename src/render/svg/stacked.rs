//! Panels under each other on one abscissa.

use precut_calc::calculator::{Figure, Item, Panel, Spacing};

use super::bars::Stand;
use super::draw::{self, Frame};
use super::glyph;
use super::legend::Legend;
use super::map::{Key, edges};
use super::page::{Escaped, Page, Px, put, width};
use super::plane::Plane;
use super::scale::{Range, Scale, Ticks, coordinate};
use super::style::Styles;
use super::{MARGIN, WIDTH, Wording, axis_name, counted, ordinates, ribbon};

const NUMBER_SIZE: f64 = 12.5;
/// Between a panel and the legend of the next.
const PANEL_GAP: f64 = 12.0;
/// Tick labels and name of the common axis.
const X_AXIS: f64 = 48.0;

/// Everything's place.
pub(super) struct Layout<'a> {
    figure: &'a Figure,
    left: f64,
    right: f64,
    /// Under the last panel.
    bottom: f64,
    x: Scale,
    x_ticks: Ticks,
    panels: Vec<Placed<'a>>,
}

struct Placed<'a> {
    panel: &'a Panel,
    key: Option<&'a Key<'a>>,
    legend: Legend<'a>,
    legend_top: f64,
    ticks: Ticks,
    frame: Frame,
}

impl<'a> Layout<'a> {
    /// Below `top`; `keys` are those of the panels.
    pub(super) fn new(figure: &'a Figure, keys: &'a [Option<Key<'a>>], wording: &Wording<'_>, top: f64) -> Self {
        let heights = panel_heights(&figure.panels);
        let axes: Vec<VerticalAxis> = figure
            .panels
            .iter()
            .zip(&heights)
            .map(|(panel, height)| VerticalAxis::new(panel, *height, wording.decimal))
            .collect();
        let left = MARGIN + widest(axes.iter().map(|axis| &axis.ticks)).max(24.0) + 10.0;
        let bars: Vec<Option<KeyAxis>> = keys
            .iter()
            .zip(&heights)
            .map(|(key, height)| key.as_ref().map(|key| KeyAxis::new(key, *height, wording.decimal)))
            .collect();
        let numbers = widest(bars.iter().flatten().map(|bar| &bar.ticks));
        let right = WIDTH - MARGIN - if numbers > 0.0 { numbers + KeyAxis::ROOM } else { 0.0 };

        let spacing = figure.x.scale;
        let range = Range::spanning(figure.panels.iter().flat_map(|panel| across(panel, spacing)));
        let (room_left, room_right) = room_at_ends(figure, range);
        let x = Scale::new(spacing, range, left + room_left, right - room_right);
        let x_ticks = x_ticks(spacing, range, right - left - room_left - room_right, wording.decimal);

        let mut top = top;
        let mut panels = Vec::new();
        let parts = figure.panels.iter().zip(heights).zip(axes).zip(keys.iter().zip(&bars));
        for (((panel, height), axis), (key, bar)) in parts {
            let name = axis_name(panel.y, &axis.ticks, wording);
            let map = key.as_ref().zip(bar.as_ref());
            let map = map.map(|(key, bar)| (key, axis_name(key.value, &bar.ticks, wording)));
            let legend = Legend::new(name, panel, map, wording, right - left);
            let legend_top = top;
            top += legend.height();
            let frame = axis.frame((left, right), top, height, x);
            panels.push(Placed { panel, key: key.as_ref(), legend, legend_top, ticks: axis.ticks, frame });
            top += height + PANEL_GAP;
        }
        Self { figure, left, right, bottom: top - PANEL_GAP, x, x_ticks, panels }
    }

    pub(super) fn bottom(&self) -> f64 {
        self.bottom + X_AXIS
    }

    /// Left end of the panels and of what is written above.
    pub(super) fn left(&self) -> f64 {
        self.left
    }

    pub(super) fn draw(&self, page: &mut Page, styles: &Styles, wording: &Wording<'_>) {
        for placed in &self.panels {
            placed.legend.draw(page, self.left, placed.legend_top, styles);
            axes(page, placed, self);
            let again = |page: &mut Page| grid(page, placed, self, " over");
            let grid = (self.figure.x.scale, &again as &dyn Fn(&mut Page));
            draw::items(page, (placed.panel, placed.key), &placed.frame, grid, (styles, wording));
            if let Some(key) = placed.key {
                let Frame { right, top, bottom, .. } = placed.frame;
                KeyAxis::new(key, bottom - top, wording.decimal).draw(page, key, right, (top, bottom));
            }
        }
        x_axis(page, self, wording);
    }
}

/// Width of the widest number.
fn widest<'t>(ticks: impl Iterator<Item = &'t Ticks>) -> f64 {
    ticks.flat_map(|ticks| &ticks.marks).map(|(_, label)| width(label, NUMBER_SIZE)).fold(0.0, f64::max)
}

/// The scale of a map's colours, beside its panel.
pub(super) struct KeyAxis {
    pub(super) ticks: Ticks,
}

impl KeyAxis {
    const GAP: f64 = 14.0;
    const WIDTH: f64 = 14.0;
    const ROOM: f64 = Self::GAP + Self::WIDTH + 6.0;

    pub(super) fn new(key: &Key<'_>, height: f64, decimal: char) -> Self {
        Self { ticks: key.ticks(height, decimal) }
    }

    /// To the right of `left`.
    pub(super) fn draw(&self, page: &mut Page, key: &Key<'_>, left: f64, (top, bottom): (f64, f64)) {
        let left = left + Self::GAP;
        key.bar(page, (left, Self::WIDTH), (top, bottom));
        let scale = key.scale(top, bottom);
        for (at, label) in &self.ticks.marks {
            let (x, y) = (Px(left + Self::WIDTH + 6.0), Px(scale.px(*at) + 4.3));
            put!(page, "<text class=\"number\" x=\"{x}\" y=\"{y}\">{}</text>", Escaped(label));
        }
    }
}

/// Shares of the page: a single panel is drawn large, many get what each needs.
fn panel_heights(panels: &[Panel]) -> Vec<f64> {
    const LEAST: f64 = 64.0;
    let share = |panel: &Panel| if panel.height.is_finite() { panel.height.clamp(0.05, 20.0) } else { 1.0 };
    let total: f64 = panels.iter().map(share).sum();
    let page = 220.0 + 140.0 * counted(panels.len());
    panels.iter().map(|panel| (page * share(panel) / total).max(LEAST)).collect()
}

/// A panel's numbers before its place on the page is known.
struct VerticalAxis {
    spacing: Spacing,
    range: Range,
    ticks: Ticks,
    room_top: f64,
    room_bottom: f64,
    glyph_size: f64,
}

impl VerticalAxis {
    fn new(panel: &Panel, height: f64, decimal: char) -> Self {
        let glyph_size = (height / 110.0).clamp(0.6, 1.0);
        let (mut room_top, mut room_bottom): (f64, f64) = (0.0, 0.0);
        for item in &panel.items {
            if let Item::Glyph { glyph, y, .. } = item {
                let (room, one_side) = glyph::room_above(*glyph);
                let above = draw::stands_above(panel, *y);
                if above || !one_side {
                    room_top = room_top.max(room * glyph_size);
                }
                if !above || !one_side {
                    room_bottom = room_bottom.max(room * glyph_size);
                }
            }
        }
        let spacing = panel.y.scale;
        let data = Range::spanning(up(panel));
        // A drawing to scale and a map fill their panel.
        let is_full = |item: &Item| matches!(item, Item::Glyph { .. } | Item::HeatMap { .. });
        let range = if panel.items.iter().any(is_full) { data } else { data.roomy(spacing) };
        let ticks = if ribbon::is_only(panel) {
            Ticks { marks: Vec::new(), minor: Vec::new(), power: 0, step: None }
        } else {
            y_ticks(spacing, range, height - room_top - room_bottom, decimal)
        };
        Self { spacing, range, ticks, room_top, room_bottom, glyph_size }
    }

    fn frame(&self, (left, right): (f64, f64), top: f64, height: f64, x: Scale) -> Frame {
        let bottom = top + height;
        let y = Scale::new(self.spacing, self.range, bottom - self.room_bottom, top + self.room_top);
        Frame { left, right, top, bottom, plane: Plane::Flat { x, y }, glyph_size: self.glyph_size }
    }
}

/// Room for symbols that stand beyond the ends.
fn room_at_ends(figure: &Figure, range: Range) -> (f64, f64) {
    let is_map = |item: &Item| matches!(item, Item::HeatMap { .. });
    let least = if figure.panels.iter().flat_map(|panel| &panel.items).any(is_map) { 0.0 } else { 8.0 };
    let (mut left, mut right): (f64, f64) = (least, least);
    for item in figure.panels.iter().flat_map(|panel| &panel.items) {
        if let Item::Glyph { glyph, x, .. } = item {
            let room = glyph::room_at_end(*glyph);
            let at = coordinate(figure.x.scale, *x).unwrap_or(range.low);
            if at < f64::midpoint(range.low, range.high) {
                left = left.max(room);
            } else {
                right = right.max(room);
            }
        }
    }
    (left, right)
}

/// About one for every 27 px, closer where that would leave fewer than three.
fn y_ticks(spacing: Spacing, range: Range, room: f64, decimal: char) -> Ticks {
    let most = (room / 27.0).clamp(2.0, 10.0);
    let ticks = Ticks::new(spacing, range, most, decimal);
    if ticks.marks.len() < 3 { Ticks::new(spacing, range, 1.7 * most, decimal) } else { ticks }
}

/// As many as have room for their labels.
fn x_ticks(spacing: Spacing, range: Range, room: f64, decimal: char) -> Ticks {
    let fits = |ticks: &Ticks| (widest(std::iter::once(ticks)) + 18.0) * counted(ticks.marks.len()) <= room;
    [10.0, 8.0, 6.0, 4.0, 2.0]
        .into_iter()
        .map(|count| Ticks::new(spacing, range, count, decimal))
        .find(fits)
        .unwrap_or_else(|| Ticks::new(spacing, range, 1.0, decimal))
}

/// Coordinates that a panel takes up along the abscissa.
fn across(panel: &Panel, spacing: Spacing) -> Vec<f64> {
    let stand = Stand::of(panel, spacing);
    let mut taken = Vec::new();
    for item in &panel.items {
        match item {
            Item::Line { x, .. } | Item::Band { x, .. } | Item::Points { x, .. } | Item::Outline { x, .. } => {
                taken.extend(x.iter().filter_map(|x| coordinate(spacing, *x)));
            }
            Item::Bars { x, .. } => taken.extend(stand.ends(x)),
            Item::Ribbon { x, x_end, .. } => {
                taken.extend(x.iter().chain(x_end).filter_map(|x| coordinate(spacing, *x)));
            }
            Item::HeatMap { x, .. } => taken.extend(ends(spacing, x)),
            Item::Glyph { x, .. } => taken.extend(coordinate(spacing, *x)),
            Item::Handle(_) | Item::Setting(_) => {}
        }
    }
    taken
}

/// Coordinates that a panel takes up along the ordinate.
pub(super) fn up(panel: &Panel) -> Vec<f64> {
    let spacing = panel.y.scale;
    let mut taken = Vec::new();
    for item in &panel.items {
        match item {
            Item::HeatMap { y, .. } => taken.extend(ends(spacing, y)),
            item => taken.extend(ordinates(item).filter_map(|y| coordinate(spacing, y))),
        }
        if matches!(item, Item::Bars { .. }) {
            taken.extend(coordinate(spacing, 0.0));
        }
    }
    taken
}

fn ends(spacing: Spacing, middles: &[f64]) -> impl Iterator<Item = f64> {
    edges(spacing, middles).into_iter().flatten().flat_map(|(from, to)| [from, to])
}

/// Lines at the ticks of both axes.
fn grid(page: &mut Page, placed: &Placed<'_>, layout: &Layout<'_>, class: &str) {
    let Frame { left, right, top, bottom, plane, .. } = placed.frame;
    let all = |ticks: &'_ Ticks| -> Vec<f64> { ticks.marks.iter().map(|(at, _)| *at).collect() };
    let mut lines = |class: &str, across: &[f64], up: &[f64]| {
        put!(page, "<path class=\"grid{class}\" d=\"");
        for at in across {
            put!(page, "M{} {}V{}", Px(layout.x.px(*at)), Px(top), Px(bottom));
        }
        for at in up {
            put!(page, "M{} {}H{}", Px(left), Px(plane.along_y().px(*at)), Px(right));
        }
        put!(page, "\"/>");
    };
    let (across, up) = (&layout.x_ticks, &placed.ticks);
    if !(across.minor.is_empty() && up.minor.is_empty()) {
        lines(&format!("{class} fine"), &across.minor, &up.minor);
    }
    lines(class, &all(across), &all(up));
}

/// Grid, frame and numbers of a panel.
fn axes(page: &mut Page, placed: &Placed<'_>, layout: &Layout<'_>) {
    let Frame { left, right, top, bottom, plane, .. } = placed.frame;
    grid(page, placed, layout, "");
    let zero = (!placed.ticks.marks.is_empty()).then(|| plane.along_y().at(0.0)).flatten();
    if let Some(zero) = zero.filter(|zero| *zero > top + 1.0 && *zero < bottom - 1.0) {
        put!(page, "<path class=\"zero\" d=\"M{} {}H{}\"/>", Px(left), Px(zero), Px(right));
    }
    let (width, height) = (Px(right - left), Px(bottom - top));
    put!(page, "<rect class=\"frame\" x=\"{}\" y=\"{}\" width=\"{width}\" height=\"{height}\"/>", Px(left), Px(top));
    put!(page, "<g class=\"number\" text-anchor=\"end\">");
    for (at, label) in &placed.ticks.marks {
        let y = plane.along_y().px(*at) + 4.3;
        put!(page, "<text class=\"number\" x=\"{}\" y=\"{}\">{}</text>", Px(left - 6.0), Px(y), Escaped(label));
    }
    put!(page, "</g>\n");
}

/// Numbers and name of the common axis, under the last panel.
fn x_axis(page: &mut Page, layout: &Layout<'_>, wording: &Wording<'_>) {
    put!(page, "\n<g text-anchor=\"middle\">");
    for (at, label) in &layout.x_ticks.marks {
        let (x, y) = (Px(layout.x.px(*at)), Px(layout.bottom + 17.0));
        put!(page, "<text class=\"number\" x=\"{x}\" y=\"{y}\">{}</text>", Escaped(label));
    }
    let name = axis_name(layout.figure.x, &layout.x_ticks, wording);
    let (x, y) = (Px(f64::midpoint(layout.left, layout.right)), Px(layout.bottom + 39.0));
    put!(page, "<text class=\"name\" x=\"{x}\" y=\"{y}\">{}</text></g>\n", Escaped(&name));
}
