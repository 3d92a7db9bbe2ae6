//! Figures as SVG: panels under each other on one axis, to scale, or a roundness chart; worth printing.
//!
//! Own code: kuva 0.6, the plotting crate that came nearest, has no filled outlines and no symbols in
//! the units of the axes, no gaps in a line, and writes its colours into every element, so that a
//! picture cannot follow a dark screen.
//! Text stays text; light on paper, dark on dark screens.

mod bars;
mod colour;
mod draw;
mod glyph;
mod legend;
mod map;
mod page;
mod plane;
mod ribbon;
mod round;
mod scale;
mod stacked;
mod style;
mod thin;
mod unit;

use precut_calc::calculator::{Axis, Figure, Frame, Item, Message, Panel};

pub use self::colour::palette;
use self::map::Key;
use self::page::{Escaped, Page, Px, lines, put};
use self::scale::{Ticks, rough};
use self::style::{Styles, identity};
pub use self::unit::unit_symbol;

/// The caller's words for the codes in a figure.
#[derive(Clone, Copy)]
pub struct Wording<'a> {
    /// Sentence of a title.
    pub message: &'a dyn Fn(&Message) -> String,
    /// Label of an axis, name of a curve or of a symbol (`glyph_centre`, `glyph_chuck`,
    /// `glyph_steady_rest`, `glyph_follow_rest`, `glyph_tool`); `chart_division` is what one step between
    /// the circles of a roundness chart is called.
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

/// A figure as a complete SVG document of 960 px width: valid for any numbers, what is not finite or has
/// no place on its axis is a gap; the same figure and words give the same bytes.
pub fn svg(figure: &Figure, wording: &Wording<'_>) -> String {
    let title = lines(&(wording.message)(&figure.title), TITLE_SIZE * 1.06, WIDTH - 4.0 * MARGIN);
    let top = MARGIN + TITLE_LINE * counted(title.len()) + 4.0;
    let keys: Vec<Option<Key<'_>>> = figure.panels.iter().map(Key::of).collect();
    let styles = Styles::of(figure);
    let mut page = Page::default();
    match figure.frame {
        Frame::Stacked => {
            let layout = stacked::Layout::new(figure, &keys, wording, top);
            open(&mut page, figure, &keys, wording, (layout.bottom() + 8.0, layout.left(), &title));
            layout.draw(&mut page, &styles, wording);
        }
        Frame::Polar => {
            let layout = round::Layout::new(figure, &keys, wording, top);
            open(&mut page, figure, &keys, wording, (layout.bottom() + 8.0, MARGIN, &title));
            layout.draw(&mut page, &styles, wording);
        }
    }
    put!(page, "</svg>\n");
    page.into_string()
}

/// The ordinates of an item; of a map the numbers that its colours show.
fn ordinates(item: &Item) -> Box<dyn Iterator<Item = f64> + '_> {
    match item {
        Item::Line { y, .. } | Item::Bars { y, .. } => Box::new(y.iter().copied().flatten()),
        Item::Band { lower, upper, .. } => Box::new(lower.iter().chain(upper).copied()),
        Item::Points { y, .. } | Item::Outline { y, .. } => Box::new(y.iter().copied()),
        Item::HeatMap { values, .. } => Box::new(values.iter().copied().flatten()),
        // What it weighs is no place on the ordinate; a handle is not drawn.
        Item::Ribbon { .. } | Item::Handle(_) | Item::Setting(_) => Box::new(std::iter::empty()),
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

/// The document's head: size, style, the figure in words for those who cannot see it, and its title.
fn open(
    page: &mut Page,
    figure: &Figure,
    keys: &[Option<Key<'_>>],
    wording: &Wording<'_>,
    (height, left, title): (f64, f64, &[String]),
) {
    let height = Px(height.ceil());
    put!(
        page,
        "<svg xmlns=\"http://www.w3.org/2000/svg\" class=\"precut-figure\" width=\"960\" height=\"{height}\" \
         viewBox=\"0 0 960 {height}\" role=\"img\">\n"
    );
    put!(page, "<title>{}</title>\n", Escaped(&(wording.message)(&figure.title)));
    put!(page, "<desc>{}</desc>\n", Escaped(&described(figure, wording)));
    let has_ribbons = ribbon::any(&figure.panels);
    put!(page, "<style>{}{}", style::CSS, if has_ribbons { style::RIBBONS } else { "" });
    colour::roles(page);
    for diverging in [false, true] {
        if keys.iter().flatten().any(|key| key.diverging == diverging) {
            colour::css(page, diverging);
        }
    }
    put!(page, "</style>\n");
    if style::has_hatching(figure) {
        put!(page, "{}", style::HATCH);
    }
    if has_ribbons {
        put!(page, "{}", ribbon::WEAVES);
    }
    put!(page, "<rect class=\"paper\" width=\"960\" height=\"{height}\"/>\n");
    for (index, line) in title.iter().enumerate() {
        let y = MARGIN + TITLE_LINE * (counted(index) + 0.75);
        put!(page, "<text class=\"title\" x=\"{}\" y=\"{}\">{}</text>", Px(left), Px(y), Escaped(line));
    }
}

/// A figure in words, for those who cannot see it: each axis with its curves and what they span.
pub fn described(figure: &Figure, wording: &Wording<'_>) -> String {
    let named = |axis: Axis| match (wording.unit)(axis.unit) {
        unit if unit.is_empty() => (wording.label)(axis.label),
        unit => format!("{}, {unit}", (wording.label)(axis.label)),
    };
    let span = |item: &Item| {
        if let Item::Ribbon { name, places, .. } = item {
            return Some(format!("{} {}", (wording.label)(name), places.join(" ")));
        }
        let name = match item {
            Item::HeatMap { value, .. } => value.label,
            item => identity(item)?.0,
        };
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

/// Counts here are numbers of panels, lines, ticks.
fn counted(count: usize) -> f64 {
    u32::try_from(count).map_or(f64::from(u32::MAX), f64::from)
}

#[cfg(test)]
mod chart_tests;
#[cfg(test)]
mod tests;
