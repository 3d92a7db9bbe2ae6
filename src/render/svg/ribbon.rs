//! Ribbons: what holds along stretches of the abscissa. Colour, pattern and letter say the same, and the name where it
//! has room.

use precut_calc::calculator::{Item, Panel, Role};

use super::Wording;
use super::draw::Frame;
use super::page::{Escaped, Page, Px, put, width};
use super::scale::rough;

const SIZE: f64 = 12.0;
/// The lightest of several still has this share of the height, so that its letter has room.
const LEAST_SHARE: f64 = 0.24;
/// Patterns beside the plain one.
const PATTERNS: u8 = 5;

/// Lines and dots over a colour, in the colour itself.
pub(super) const WEAVES: &str = "<defs>\
<pattern id=\"precut-weave-1\" width=\"7\" height=\"7\" patternUnits=\"userSpaceOnUse\" patternTransform=\"rotate(45)\"><path d=\"M0 0V7\"/></pattern>\
<pattern id=\"precut-weave-2\" width=\"7\" height=\"7\" patternUnits=\"userSpaceOnUse\" patternTransform=\"rotate(-45)\"><path d=\"M0 0V7\"/></pattern>\
<pattern id=\"precut-weave-3\" width=\"6\" height=\"6\" patternUnits=\"userSpaceOnUse\"><path d=\"M2 3H4\"/></pattern>\
<pattern id=\"precut-weave-4\" width=\"6\" height=\"6\" patternUnits=\"userSpaceOnUse\"><path d=\"M0 3H6\"/></pattern>\
<pattern id=\"precut-weave-5\" width=\"6\" height=\"6\" patternUnits=\"userSpaceOnUse\"><path d=\"M3 0V6\"/></pattern>\
</defs>\n";

/// The pattern over a role's colour; `None` for the plain one.
fn weave(role: Role) -> Option<u8> {
    match role {
        Role::Series(n) => Some(n % (PATTERNS + 1)).filter(|pattern| *pattern > 0),
        _ => None,
    }
}

/// Whether a panel holds nothing but ribbons: it has no numbers at its side then.
pub(super) fn is_only(panel: &Panel) -> bool {
    !panel.items.is_empty() && panel.items.iter().all(|item| matches!(item, Item::Ribbon { .. }))
}

/// Whether anything in a figure is a ribbon.
pub(super) fn any<'p>(panels: impl IntoIterator<Item = &'p Panel>) -> bool {
    panels.into_iter().flat_map(|panel| &panel.items).any(|item| matches!(item, Item::Ribbon { .. }))
}

/// How much of the height the ribbons over a stretch have: by weight, none less than its least share; the heaviest is
/// uppermost. From and to, from the top, of the one named.
fn share(panel: &Panel, name: &str, from: f64) -> Option<(f64, f64)> {
    let mut here: Vec<(&str, f64)> = panel
        .items
        .iter()
        .filter_map(|item| match item {
            Item::Ribbon { name, x, weight, .. } => {
                let at = x.iter().position(|start| start.total_cmp(&from).is_eq())?;
                Some((*name, *weight.get(at)?))
            }
            _ => None,
        })
        .collect();
    here.sort_by(|a, b| b.1.total_cmp(&a.1));
    let sum: f64 = here.iter().map(|(_, weight)| weight).sum();
    let raised = |weight: f64| (weight / sum).max(LEAST_SHARE);
    let whole: f64 = here.iter().map(|(_, weight)| raised(*weight)).sum();
    let mut top = 0.0;
    for (other, weight) in here {
        let height = raised(weight) / whole;
        if other == name {
            return Some((top, top + height));
        }
        top += height;
    }
    None
}

/// Draws one ribbon of a panel.
pub(super) fn draw(page: &mut Page, panel: &Panel, frame: &Frame, item: &Item, class: &str, wording: &Wording<'_>) {
    let Item::Ribbon { name, x, x_end, weight, places, role } = item else { return };
    let text = (wording.label)(name);
    for (((from, to), weight), place) in x.iter().zip(x_end).zip(weight).zip(places) {
        let (Some((left, _)), Some((right, _)), Some((high, low))) =
            (frame.plane.place(*from, 0.0), frame.plane.place(*to, 0.0), share(panel, name, *from))
        else {
            continue;
        };
        let height = frame.bottom - frame.top;
        let (top, bottom) = (frame.top + high * height, frame.top + low * height);
        let unit = (wording.unit)(panel.y.unit);
        put!(page, "<g><title>{}: {}, ", Escaped(place), Escaped(&text));
        put!(page, "{} {}</title>", Escaped(&rough(*weight, wording.decimal)), Escaped(&unit));
        let (wide, tall) = (Px(right - left), Px(bottom - top));
        for class in classes(class, *role) {
            put!(
                page,
                "<rect class=\"{class}\" x=\"{}\" y=\"{}\" width=\"{wide}\" height=\"{tall}\"/>",
                Px(left),
                Px(top)
            );
        }
        let letter = role.letter().to_string();
        let said = [text.as_str(), letter.as_str()].into_iter().find(|said| width(said, SIZE) + 8.0 <= right - left);
        if let Some(said) = said.filter(|_| bottom - top >= SIZE) {
            let (x, y) = (Px(f64::midpoint(left, right)), Px(f64::midpoint(top, bottom) + 4.2));
            put!(page, "<text class=\"halo\" text-anchor=\"middle\" x=\"{x}\" y=\"{y}\">{}</text>", Escaped(said));
        }
        put!(page, "</g>");
    }
}

fn classes(class: &str, role: Role) -> impl Iterator<Item = String> {
    std::iter::once(format!("ribbon {class}")).chain(weave(role).map(|pattern| format!("weave-{pattern} {class}")))
}

/// A piece of it with its letter, for a legend.
pub(super) fn sample(page: &mut Page, (left, top): (f64, f64), (wide, tall): (f64, f64), class: &str, role: Role) {
    for class in classes(class, role) {
        let (x, y, wide, tall) = (Px(left), Px(top), Px(wide), Px(tall));
        put!(page, "<rect class=\"{class}\" x=\"{x}\" y=\"{y}\" width=\"{wide}\" height=\"{tall}\"/>");
    }
    let (x, y) = (Px(left + wide / 2.0), Px(top + tall / 2.0 + 4.2));
    put!(page, "<text class=\"halo\" text-anchor=\"middle\" x=\"{x}\" y=\"{y}\">{}</text>", role.letter());
}
