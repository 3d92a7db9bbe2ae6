//! Roundness charts: deviations magnified outward from a base circle, as a roundness tester draws them.

use precut_calc::calculator::{Figure, Item, Panel, Spacing};

use super::draw::{self, Frame};
use super::legend::Legend;
use super::map::Key;
use super::page::{Escaped, Page, Px, put};
use super::plane::Plane;
use super::scale::{Range, Scale, Ticks, round_number};
use super::stacked::{KeyAxis, up};
use super::style::Styles;
use super::{MARGIN, WIDTH, Wording, axis_name};

/// Radius of the outermost circle, px, and the share of it within the innermost.
const RADIUS: f64 = 270.0;
const INNER: f64 = 0.42;
/// Round the chart, for the numbers of the angles; more where symbols stand outside.
const ROOM: f64 = 30.0;
const ROOM_FOR_GLYPHS: f64 = 34.0;
/// Between two spokes.
const SPOKE_DEG: u16 = 30;
/// Along this spoke the circles have their numbers.
const NUMBERED_DEG: f64 = 75.0;
/// The line under the chart.
const NOTE: f64 = 26.0;

/// Everything's place.
pub(super) struct Layout<'a> {
    charts: Vec<Chart<'a>>,
    bottom: f64,
}

struct Chart<'a> {
    panel: &'a Panel,
    key: Option<&'a Key<'a>>,
    legend: Legend<'a>,
    legend_top: f64,
    ticks: Ticks,
    radius: Scale,
    /// Angles of symbols that reach beyond the outermost circle, degrees.
    glyphs_outside: Vec<f64>,
    frame: Frame,
}

impl<'a> Layout<'a> {
    /// Below `top`; `keys` are those of the panels.
    pub(super) fn new(figure: &'a Figure, keys: &'a [Option<Key<'a>>], wording: &Wording<'_>, top: f64) -> Self {
        let mut top = top;
        let mut charts = Vec::new();
        for (panel, key) in figure.panels.iter().zip(keys) {
            let chart = Chart::new(panel, key.as_ref(), wording, top);
            top = chart.frame.bottom + NOTE;
            charts.push(chart);
        }
        Self { charts, bottom: top }
    }

    pub(super) fn bottom(&self) -> f64 {
        self.bottom
    }

    pub(super) fn draw(&self, page: &mut Page, styles: &Styles, wording: &Wording<'_>) {
        for chart in &self.charts {
            chart.legend.draw(page, MARGIN, chart.legend_top, styles);
            chart.grid(page, "");
            let again = |page: &mut Page| chart.grid(page, " over");
            let grid = (Spacing::Linear, &again as &dyn Fn(&mut Page));
            draw::items(page, (chart.panel, chart.key), &chart.frame, grid, (styles, wording));
            chart.numbers(page, wording);
            if let Some(key) = chart.key {
                let (top, bottom) = (chart.centre().1 - RADIUS / 2.0, chart.centre().1 + RADIUS / 2.0);
                KeyAxis::new(key, RADIUS, wording.decimal).draw(page, key, chart.frame.right, (top, bottom));
            }
        }
    }
}

impl<'a> Chart<'a> {
    fn new(panel: &'a Panel, key: Option<&'a Key<'a>>, wording: &Wording<'_>, top: f64) -> Self {
        let spacing = panel.y.scale;
        let (range, ticks) = circles(panel, wording.decimal);
        let name = axis_name(panel.y, &ticks, wording);
        let map = key.map(|key| (key, axis_name(key.value, &key.ticks(RADIUS, wording.decimal), wording)));
        let legend = Legend::new(name, panel, map, wording, WIDTH - 2.0 * MARGIN);
        let radius = Scale::new(spacing, range, INNER * RADIUS, RADIUS);
        let glyphs_outside: Vec<f64> = panel.items.iter().filter_map(|item| stands_outside(item, &radius)).collect();
        let half = RADIUS + ROOM + if glyphs_outside.is_empty() { 0.0 } else { ROOM_FOR_GLYPHS };
        let upper = top + legend.height();
        let centre = (WIDTH / 2.0, upper + half);
        let frame = Frame {
            left: centre.0 - half,
            right: centre.0 + half,
            top: upper,
            bottom: upper + 2.0 * half,
            plane: Plane::Round { centre, radius },
            glyph_size: 1.0,
        };
        Self { panel, key, legend, legend_top: top, ticks, radius, glyphs_outside, frame }
    }

    fn centre(&self) -> (f64, f64) {
        (f64::midpoint(self.frame.left, self.frame.right), f64::midpoint(self.frame.top, self.frame.bottom))
    }

    fn spoke(&self, degrees: f64, radius: f64) -> (f64, f64) {
        self.frame.plane.bent((2.0 * degrees, radius))
    }

    /// Circles at round deviations, spokes, the base circle and the outermost.
    fn grid(&self, page: &mut Page, class: &str) {
        let (x, y) = self.centre();
        let (x, y) = (Px(x), Px(y));
        for (at, _) in &self.ticks.marks {
            put!(page, "<circle class=\"grid{class}\" cx=\"{x}\" cy=\"{y}\" r=\"{}\"/>", Px(self.radius.px(*at)));
        }
        put!(page, "<path class=\"grid{class}\" d=\"");
        for degrees in (0..360).step_by(usize::from(SPOKE_DEG)).map(f64::from) {
            let (from, to) = (self.spoke(degrees, 0.12 * RADIUS), self.spoke(degrees, RADIUS));
            put!(page, "M{} {}L{} {}", Px(from.0), Px(from.1), Px(to.0), Px(to.1));
        }
        put!(page, "\"/><path class=\"zero\" d=\"M{x} {y}m-7 0h14m-7-7v14\"/>");
        if let Some(base) = self.radius.at(0.0) {
            put!(page, "<circle class=\"zero\" cx=\"{x}\" cy=\"{y}\" r=\"{}\"/>", Px(base));
        }
        put!(page, "<circle class=\"frame\" cx=\"{x}\" cy=\"{y}\" r=\"{RADIUS}\"/>");
    }

    /// Angles round the chart, deviations along one spoke, and what a division is worth.
    fn numbers(&self, page: &mut Page, wording: &Wording<'_>) {
        put!(page, "<g class=\"number\" text-anchor=\"middle\">");
        for degrees in (0..360).step_by(usize::from(SPOKE_DEG)) {
            let degrees = f64::from(degrees);
            let beyond = if self.has_glyph_near(degrees) { ROOM_FOR_GLYPHS } else { 0.0 };
            let (x, y) = self.spoke(degrees, RADIUS + beyond + 17.0);
            put!(page, "<text class=\"number\" x=\"{}\" y=\"{}\">{degrees}°</text>", Px(x), Px(y + 4.3));
        }
        for (at, label) in &self.ticks.marks {
            let (x, y) = self.spoke(NUMBERED_DEG, self.radius.px(*at));
            put!(page, "<text class=\"number halo\" x=\"{}\" y=\"{}\">{}</text>", Px(x), Px(y + 4.3), Escaped(label));
        }
        if let Some(step) = self.ticks.step {
            let unit = (wording.unit)(self.panel.y.unit);
            let worth = round_number(step, wording.decimal);
            let space = if unit.is_empty() { "" } else { "\u{a0}" };
            let note = format!("{} = {worth}{space}{unit}", (wording.label)("chart_division"));
            let (x, y) = (Px(self.centre().0), Px(self.frame.bottom + 14.0));
            put!(page, "<text class=\"name\" x=\"{x}\" y=\"{y}\">{}</text>", Escaped(&note));
        }
        put!(page, "</g>\n");
    }

    fn has_glyph_near(&self, degrees: f64) -> bool {
        self.glyphs_outside.iter().any(|angle| {
            let apart = (angle - degrees).rem_euclid(360.0);
            apart.min(360.0 - apart) < 8.0
        })
    }
}

/// The angle of a symbol that reaches beyond the outermost circle.
fn stands_outside(item: &Item, radius: &Scale) -> Option<f64> {
    match item {
        Item::Glyph { x, y, .. } if radius.at(*y)? + ROOM_FOR_GLYPHS > RADIUS => Some(*x),
        _ => None,
    }
}

/// From one circle to another, the base circle among them; at round deviations, so that all divisions are whole.
fn circles(panel: &Panel, decimal: char) -> (Range, Ticks) {
    let spacing = panel.y.scale;
    let base = super::scale::coordinate(spacing, 0.0);
    let range = Range::spanning(up(panel).into_iter().chain(base));
    let ticks = Ticks::new(spacing, range, 6.0, decimal);
    let Some(step) = ticks.step else { return (range, ticks) };
    let whole = Range { low: (range.low / step).floor() * step, high: (range.high / step).ceil() * step };
    let ticks = Ticks::new(spacing, whole, ((whole.high - whole.low) / step).round(), decimal);
    (whole, ticks)
}
