//! What is what, in one line or a few above each panel.

use precut_calc::calculator::{Glyph, Item, Panel, Role};

use super::Wording;
use super::glyph::{self, Stance};
use super::map::Key;
use super::page::{Escaped, Page, Px, put, width};
use super::ribbon;
use super::style::{Styles, identity, is_hatched, role_class};

/// Height of a line, px.
pub(super) const LINE: f64 = 20.0;
const SIZE: f64 = 12.5;
const SAMPLE: f64 = 30.0;
const GAP: f64 = 18.0;

/// One entry and where it stands, relative to the first line's left end.
#[derive(Debug)]
struct Entry<'a> {
    sample: Sample<'a>,
    text: String,
    x: f64,
    line: u32,
}

#[derive(Debug)]
enum Sample<'a> {
    Item(&'a Item),
    Glyph(Glyph),
    Map(&'a Key<'a>),
}

/// The name of a panel's axis and the entries after it.
#[derive(Debug)]
pub(super) struct Legend<'a> {
    name: String,
    entries: Vec<Entry<'a>>,
    lines: u32,
}

impl<'a> Legend<'a> {
    /// Entries in the order of drawing, each name once, in lines of `room` px.
    /// A map comes with its colours' meaning in words.
    pub(super) fn new(
        name: String,
        panel: &'a Panel,
        map: Option<(&'a Key<'a>, String)>,
        wording: &Wording<'_>,
        room: f64,
    ) -> Self {
        let map = map.map(|(key, text)| (Sample::Map(key), text));
        let named = distinct(panel).into_iter().map(|(sample, code)| (sample, (wording.label)(code)));
        let mut x = width(&name, SIZE * 1.05) + 1.5 * GAP;
        let mut line = 0;
        let mut entries = Vec::new();
        for (sample, text) in map.into_iter().chain(named) {
            let wide = SAMPLE + 6.0 + width(&text, SIZE);
            if x + wide > room && x > 0.0 {
                (x, line) = (0.0, line + 1);
            }
            entries.push(Entry { sample, text, x, line });
            x += wide + GAP;
        }
        Self { name, entries, lines: line + 1 }
    }

    pub(super) fn height(&self) -> f64 {
        f64::from(self.lines) * LINE
    }

    /// Draws it with its upper left corner there.
    pub(super) fn draw(&self, page: &mut Page, left: f64, top: f64, styles: &Styles) {
        let baseline = top + LINE - 7.0;
        put!(page, "<text class=\"name\" x=\"{}\" y=\"{}\">{}</text>", Px(left), Px(baseline), Escaped(&self.name));
        for entry in &self.entries {
            let (x, y) = (left + entry.x, baseline + f64::from(entry.line) * LINE);
            sample(page, &entry.sample, x, y - 4.5, styles);
            put!(page, "<text x=\"{}\" y=\"{}\">{}</text>", Px(x + SAMPLE + 6.0), Px(y), Escaped(&entry.text));
        }
    }
}

fn distinct(panel: &Panel) -> Vec<(Sample<'_>, &'static str)> {
    let mut seen = Vec::new();
    let mut samples = Vec::new();
    for item in &panel.items {
        let (key, code, sample) = match (item, identity(item)) {
            (Item::Glyph { glyph, .. }, _) => {
                (("glyph", glyph::label(*glyph)), glyph::label(*glyph), Sample::Glyph(*glyph))
            }
            (item, Some((name, role))) => ((role_class(role).0, name), name, Sample::Item(item)),
            (_, None) => continue,
        };
        if !seen.contains(&key) {
            seen.push(key);
            samples.push((sample, code));
        }
    }
    samples
}

fn sample(page: &mut Page, sample: &Sample<'_>, x: f64, y: f64, styles: &Styles) {
    let class = |name: &'static str, role: Role| styles.class(name, role);
    match sample {
        Sample::Item(Item::Line { name, role, .. }) => {
            put!(page, "<path class=\"line {}\" d=\"M{} {}h{}\"/>", class(name, *role), Px(x), Px(y), Px(SAMPLE));
        }
        Sample::Item(Item::Band { name, role, .. }) => {
            let class = class(name, *role);
            let (left, top) = (Px(x), Px(y - 5.0));
            put!(page, "<rect class=\"band {class}\" x=\"{left}\" y=\"{top}\" width=\"{SAMPLE}\" height=\"10\"/>");
            if is_hatched(*role) {
                put!(page, "<rect class=\"hatch\" x=\"{left}\" y=\"{top}\" width=\"{SAMPLE}\" height=\"10\"/>");
            }
            if *role == Role::Tolerance {
                put!(page, "<path class=\"edge {class}\" d=\"M{left} {top}h{SAMPLE}m-{SAMPLE} 10h{SAMPLE}\"/>");
            }
        }
        Sample::Item(Item::Points { name, role, .. }) => {
            let (class, marker) = (class(name, *role), role_class(*role).1);
            put!(page, "<path class=\"points {class}\" d=\"M{} {}{marker}\"/>", Px(x + SAMPLE / 2.0), Px(y));
        }
        Sample::Item(Item::Ribbon { name, role, .. }) => {
            ribbon::sample(page, (x, y - 6.0), (SAMPLE, 12.0), &class(name, *role), *role);
        }
        // The map has an entry of its own; a handle has none.
        Sample::Item(Item::HeatMap { .. } | Item::Handle(_) | Item::Setting(_)) => {}
        Sample::Map(key) => key.sample(page, (x, y - 5.0), (SAMPLE, 10.0)),
        Sample::Item(Item::Bars { name, role, .. }) => {
            let class = class(name, *role);
            let middle = Px(x + SAMPLE / 2.0 - 5.0);
            put!(
                page,
                "<rect class=\"bars {class}\" x=\"{middle}\" y=\"{}\" width=\"10\" height=\"10\"/>",
                Px(y - 5.0)
            );
        }
        Sample::Item(Item::Outline { name, role, .. }) => {
            let class = class(name, *role);
            let (x, y) = (Px(x), Px(y - 5.0));
            put!(page, "<rect class=\"outline {class}\" x=\"{x}\" y=\"{y}\" width=\"{SAMPLE}\" height=\"10\"/>");
        }
        Sample::Item(Item::Glyph { glyph, .. }) | Sample::Glyph(glyph) => {
            let (dx, dy) = match glyph {
                Glyph::CentreLeft | Glyph::Chuck => (24.0, 0.0),
                Glyph::CentreRight => (6.0, 0.0),
                Glyph::SteadyRest | Glyph::FollowRest | Glyph::Tool => (15.0, 8.0),
            };
            put!(page, "<g class=\"glyph\">");
            glyph::draw(
                page,
                *glyph,
                Stance { x: x + dx, y: y + dy, reach: 3.0, mirrored: false, size: 0.5, turn: 0.0 },
            );
            put!(page, "</g>");
        }
    }
}
