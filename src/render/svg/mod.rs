//! Figures as SVG: panels under each other on one axis, to scale, worth printing.
//!
//! Own code: kuva 0.6, the plotting crate that came nearest, has no filled outlines and no symbols in
//! the units of the axes, no gaps in a line, and writes its colours into every element, so that a
//! picture cannot follow a dark screen.
//! Text stays text; light on paper, dark on dark screens.

mod draw;
mod glyph;
mod legend;
mod page;
mod scale;
mod style;
mod thin;
mod unit;

use precut_calc::calculator::{Axis, Figure, Item, Message, Panel};

use self::draw::Frame;
use self::legend::Legend;
use self::page::{Escaped, Page, Px, lines, put, width};
use self::scale::{Range, Scale, Ticks, rough};
use self::style::{Styles, identity};
pub use self::unit::unit_symbol;

/// The caller's words for the codes in a figure.
#[derive(Clone, Copy)]
pub struct Wording<'a> {
    /// Sentence of a title.
    pub message: &'a dyn Fn(&Message) -> String,
    /// Label of an axis, name of a curve or of a symbol (`glyph_centre`, `glyph_chuck`,
    /// `glyph_steady_rest`, `glyph_follow_rest`, `glyph_tool`).
    pub label: &'a dyn Fn(&'static str) -> String,
    /// Symbol of a unit; [`unit_symbol`] where the language has no own.
    pub unit: &'a dyn Fn(&'static str) -> String,
    /// Between whole and decimals: `.` or `,`.
    pub decimal: char,
}

impl std::fmt::Debug for Wording<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.debug_struct("Wording").field("decimal", &self.decimal).finish_non_exhaustive()
    }
}

const WIDTH: f64 = 960.0;
const MARGIN: f64 = 16.0;
const TITLE_SIZE: f64 = 17.0;
const TITLE_LINE: f64 = 24.0;
const NUMBER_SIZE: f64 = 12.5;
/// Between a panel and the legend of the next.
const PANEL_GAP: f64 = 12.0;
/// Tick labels and name of the common axis.
const X_AXIS: f64 = 48.0;

/// A figure as a complete SVG document of 960 px width: valid for any numbers, what is not finite is
/// a gap; the same figure and words give the same bytes.
pub fn svg(figure: &Figure, wording: &Wording<'_>) -> String {
    let layout = Layout::new(figure, wording);
    let styles = Styles::of(figure);
    let mut page = Page::default();
    open(&mut page, figure, wording, layout.height);
    for (index, line) in layout.title.iter().enumerate() {
        let y = MARGIN + TITLE_LINE * (counted(index) + 0.75);
        put!(page, "<text class=\"title\" x=\"{}\" y=\"{}\">{}</text>", Px(layout.left), Px(y), Escaped(line));
    }
    for panel in &layout.panels {
        panel.legend.draw(&mut page, layout.left, panel.legend_top, &styles);
        axes(&mut page, panel, &layout);
        draw::items(&mut page, panel.panel, &panel.frame, &styles, wording);
    }
    x_axis(&mut page, figure, &layout, wording);
    put!(page, "</svg>\n");
    page.into_string()
}

/// Everything's place.
struct Layout<'a> {
    title: Vec<String>,
    left: f64,
    height: f64,
    x: Scale,
    x_ticks: Ticks,
    panels: Vec<Placed<'a>>,
}

struct Placed<'a> {
    panel: &'a Panel,
    legend: Legend<'a>,
    legend_top: f64,
    ticks: Ticks,
    frame: Frame,
}

impl<'a> Layout<'a> {
    fn new(figure: &'a Figure, wording: &Wording<'_>) -> Self {
        let heights = panel_heights(&figure.panels);
        let axes: Vec<VerticalAxis> = figure
            .panels
            .iter()
            .zip(&heights)
            .map(|(panel, height)| VerticalAxis::new(panel, *height, wording.decimal))
            .collect();
        let labels = axes.iter().flat_map(|axis| &axis.ticks.marks).map(|(_, label)| width(label, NUMBER_SIZE));
        let left = MARGIN + labels.fold(24.0, f64::max) + 10.0;
        let right = WIDTH - MARGIN;

        let range = Range::of(figure.panels.iter().flat_map(|panel| &panel.items).flat_map(abscissae));
        let (room_left, room_right) = room_at_ends(figure, range);
        let x = Scale::new(range, left + room_left, right - room_right);
        let x_ticks = x_ticks(range, right - left - room_left - room_right, wording.decimal);

        let title = lines(&(wording.message)(&figure.title), TITLE_SIZE * 1.06, right - left);
        let mut top = MARGIN + TITLE_LINE * counted(title.len()) + 4.0;
        let mut panels = Vec::new();
        for ((panel, height), axis) in figure.panels.iter().zip(heights).zip(axes) {
            let name = axis_name(panel.y, &axis.ticks, wording);
            let legend = Legend::new(name, panel, wording, right - left);
            let legend_top = top;
            top += legend.height();
            let frame = axis.frame((left, right), top, height, x);
            panels.push(Placed { panel, legend, legend_top, ticks: axis.ticks, frame });
            top += height + PANEL_GAP;
        }
        Self { title, left, height: top - PANEL_GAP + X_AXIS + 8.0, x, x_ticks, panels }
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
        let data = Range::of(panel.items.iter().flat_map(ordinates));
        let range = if panel.items.iter().any(|item| matches!(item, Item::Glyph { .. })) { data } else { data.roomy() };
        let ticks = y_ticks(range, height - room_top - room_bottom, decimal);
        Self { range, ticks, room_top, room_bottom, glyph_size }
    }

    fn frame(&self, (left, right): (f64, f64), top: f64, height: f64, x: Scale) -> Frame {
        let bottom = top + height;
        let y = Scale::new(self.range, bottom - self.room_bottom, top + self.room_top);
        Frame { left, right, top, bottom, x, y, glyph_size: self.glyph_size }
    }
}

/// Room for symbols that stand beyond the ends.
fn room_at_ends(figure: &Figure, range: Range) -> (f64, f64) {
    let (mut left, mut right): (f64, f64) = (8.0, 8.0);
    for item in figure.panels.iter().flat_map(|panel| &panel.items) {
        if let Item::Glyph { glyph, x, .. } = item {
            let room = glyph::room_at_end(*glyph);
            if *x < f64::midpoint(range.low, range.high) {
                left = left.max(room);
            } else {
                right = right.max(room);
            }
        }
    }
    (left, right)
}

/// About one for every 27 px, closer where that would leave fewer than three.
fn y_ticks(range: Range, room: f64, decimal: char) -> Ticks {
    let most = (room / 27.0).clamp(2.0, 10.0);
    let ticks = Ticks::new(range, most, decimal);
    if ticks.marks.len() < 3 { Ticks::new(range, 1.7 * most, decimal) } else { ticks }
}

/// As many as have room for their labels.
fn x_ticks(range: Range, room: f64, decimal: char) -> Ticks {
    let fits = |ticks: &Ticks| {
        let widest = ticks.marks.iter().map(|(_, label)| width(label, NUMBER_SIZE)).fold(0.0, f64::max);
        (widest + 18.0) * counted(ticks.marks.len()) <= room
    };
    [10.0, 8.0, 6.0, 4.0, 2.0]
        .into_iter()
        .map(|count| Ticks::new(range, count, decimal))
        .find(fits)
        .unwrap_or_else(|| Ticks::new(range, 1.0, decimal))
}

fn abscissae(item: &Item) -> Box<dyn Iterator<Item = f64> + '_> {
    match item {
        Item::Line { x, .. }
        | Item::Band { x, .. }
        | Item::Points { x, .. }
        | Item::Bars { x, .. }
        | Item::HeatMap { x, .. }
        | Item::Outline { x, .. } => Box::new(x.iter().copied()),
        Item::Glyph { x, .. } => Box::new(std::iter::once(*x)),
    }
}

fn ordinates(item: &Item) -> Box<dyn Iterator<Item = f64> + '_> {
    match item {
        Item::Line { y, .. } | Item::Bars { y, .. } => Box::new(y.iter().copied().flatten()),
        Item::Band { lower, upper, .. } => Box::new(lower.iter().chain(upper).copied()),
        Item::Points { y, .. } | Item::HeatMap { y, .. } | Item::Outline { y, .. } => Box::new(y.iter().copied()),
        Item::Glyph { y, .. } => Box::new(std::iter::once(*y)),
    }
}

/// `Diameter error, 10⁻³ µm`.
fn axis_name(axis: Axis, ticks: &Ticks, wording: &Wording<'_>) -> String {
    let label = (wording.label)(axis.label);
    let unit = (wording.unit)(axis.unit);
    let unit: Vec<String> = ticks.factor().into_iter().chain((!unit.is_empty()).then_some(unit)).collect();
    if unit.is_empty() { label } else { format!("{label}, {}", unit.join(" ")) }
}

/// The document's head: size, style, and the figure in words for those who cannot see it.
fn open(page: &mut Page, figure: &Figure, wording: &Wording<'_>, height: f64) {
    let height = Px(height.ceil());
    put!(
        page,
        "<svg xmlns=\"http://www.w3.org/2000/svg\" class=\"precut-figure\" width=\"960\" height=\"{height}\" \
         viewBox=\"0 0 960 {height}\" role=\"img\">\n"
    );
    put!(page, "<title>{}</title>\n", Escaped(&(wording.message)(&figure.title)));
    put!(page, "<desc>{}</desc>\n", Escaped(&description(figure, wording)));
    put!(page, "<style>{}</style>\n", style::CSS);
    put!(page, "<rect class=\"paper\" width=\"960\" height=\"{height}\"/>\n");
}

/// Each axis with its curves and what they span.
fn description(figure: &Figure, wording: &Wording<'_>) -> String {
    let named = |axis: Axis| match (wording.unit)(axis.unit) {
        unit if unit.is_empty() => (wording.label)(axis.label),
        unit => format!("{}, {unit}", (wording.label)(axis.label)),
    };
    let span = |item: &Item| {
        let (name, _) = identity(item)?;
        let values = || ordinates(item).filter(|y| y.is_finite());
        let (low, high) = (values().reduce(f64::min)?, values().reduce(f64::max)?);
        Some(format!("{} {} … {}", (wording.label)(name), rough(low, wording.decimal), rough(high, wording.decimal)))
    };
    let panel = |panel: &Panel| {
        let spans: Vec<String> = panel.items.iter().filter_map(span).collect();
        format!("{}: {}.", named(panel.y), spans.join("; "))
    };
    let panels: Vec<String> = figure.panels.iter().map(panel).collect();
    format!("{}. {}", named(figure.x), panels.join(" "))
}

/// Grid, frame and numbers of a panel.
fn axes(page: &mut Page, placed: &Placed<'_>, layout: &Layout<'_>) {
    let Frame { left, right, top, bottom, .. } = placed.frame;
    put!(page, "<path class=\"grid\" d=\"");
    for (value, _) in &layout.x_ticks.marks {
        put!(page, "M{} {}V{}", Px(layout.x.at(*value)), Px(top), Px(bottom));
    }
    for (value, _) in &placed.ticks.marks {
        put!(page, "M{} {}H{}", Px(left), Px(placed.frame.y.at(*value)), Px(right));
    }
    put!(page, "\"/>");
    let zero = placed.frame.y.at(0.0);
    if zero > top + 1.0 && zero < bottom - 1.0 {
        put!(page, "<path class=\"zero\" d=\"M{} {}H{}\"/>", Px(left), Px(zero), Px(right));
    }
    let (width, height) = (Px(right - left), Px(bottom - top));
    put!(page, "<rect class=\"frame\" x=\"{}\" y=\"{}\" width=\"{width}\" height=\"{height}\"/>", Px(left), Px(top));
    put!(page, "<g class=\"number\" text-anchor=\"end\">");
    for (value, label) in &placed.ticks.marks {
        let y = placed.frame.y.at(*value) + 4.3;
        put!(page, "<text class=\"number\" x=\"{}\" y=\"{}\">{}</text>", Px(left - 6.0), Px(y), Escaped(label));
    }
    put!(page, "</g>\n");
}

/// Numbers and name of the common axis, under the last panel.
fn x_axis(page: &mut Page, figure: &Figure, layout: &Layout<'_>, wording: &Wording<'_>) {
    let bottom = layout.height - X_AXIS - 8.0;
    put!(page, "\n<g text-anchor=\"middle\">");
    for (value, label) in &layout.x_ticks.marks {
        let (x, y) = (Px(layout.x.at(*value)), Px(bottom + 17.0));
        put!(page, "<text class=\"number\" x=\"{x}\" y=\"{y}\">{}</text>", Escaped(label));
    }
    let name = axis_name(figure.x, &layout.x_ticks, wording);
    let middle = f64::midpoint(layout.left, WIDTH - MARGIN);
    put!(page, "<text class=\"name\" x=\"{}\" y=\"{}\">{}</text></g>\n", Px(middle), Px(bottom + 39.0), Escaped(&name));
}

/// Counts here are numbers of panels, lines, ticks.
fn counted(count: usize) -> f64 {
    u32::try_from(count).map_or(f64::from(u32::MAX), f64::from)
}

#[cfg(test)]
mod tests;
