//! Bars from zero to their ordinates; those of several names over one abscissa stand side by side.

use std::collections::BTreeMap;

use precut_calc::calculator::{Item, Panel, Spacing};

use super::map::alone;
use super::page::{Page, put};
use super::plane::{Place, Plane};
use super::scale::coordinate;
use super::thin;

/// Share of the room between neighbours that bars take.
const FILLED: f64 = 0.8;

/// Where the bars of a panel stand.
#[derive(Debug)]
pub(super) struct Stand {
    spacing: Spacing,
    /// Half of the distance between neighbours, as a coordinate.
    half: f64,
    /// How many names have a bar over an abscissa, and how many of them are drawn.
    over: BTreeMap<u64, (u32, u32)>,
}

impl Stand {
    pub(super) fn of(panel: &Panel, spacing: Spacing) -> Self {
        let mut over: BTreeMap<u64, (u32, u32)> = BTreeMap::new();
        let mut places = Vec::new();
        for (x, _) in panel.items.iter().filter_map(bars).flatten() {
            over.entry(bits(x)).or_default().0 += 1;
            places.extend(coordinate(spacing, x));
        }
        places.sort_by(f64::total_cmp);
        let nearest = places.windows(2).map(|pair| pair[1] - pair[0]).filter(|gap| *gap > 0.0).min_by(f64::total_cmp);
        let half = nearest.map_or_else(|| places.first().map_or(0.5, |place| alone(*place)), |gap| gap / 2.0);
        Self { spacing, half, over }
    }

    /// Outer ends of all bars, as coordinates.
    pub(super) fn ends(&self, x: &[f64]) -> impl Iterator<Item = f64> {
        x.iter().filter_map(|x| coordinate(self.spacing, *x)).flat_map(|at| [at - self.half, at + self.half])
    }

    /// Draws the bars of one name.
    pub(super) fn draw(&mut self, page: &mut Page, plane: &Plane, (x, y): (&[f64], &[Option<f64>]), class: &str) {
        let foot = plane.along_y().foot();
        let mut drawn: Vec<(Place, Place)> = Vec::new();
        for (x, y) in x.iter().zip(y).filter_map(|(x, y)| Some((*x, (*y)?))) {
            let (count, number) = self.over.get_mut(&bits(x)).map_or((1, 0), |(count, drawn)| {
                *drawn += 1;
                (*count, *drawn - 1)
            });
            let Some((at, top)) = coordinate(self.spacing, x).zip(plane.along_y().at(y)) else { continue };
            let width = 2.0 * FILLED * self.half / f64::from(count);
            let left = at - FILLED * self.half + width * f64::from(number);
            drawn.push((plane.abscissae((left, left + width)), (foot, top)));
        }
        if drawn.is_empty() {
            return;
        }
        put!(page, "<path class=\"bars {class}\" d=\"");
        for (across, up) in thin::bars(drawn) {
            plane.cell(page, across, up);
        }
        put!(page, "\"/>");
    }
}

fn bars(item: &Item) -> Option<impl Iterator<Item = (f64, f64)>> {
    match item {
        Item::Bars { x, y, .. } => Some(x.iter().zip(y).filter_map(|(x, y)| Some((*x, (*y)?)))),
        _ => None,
    }
}

/// Equal numbers are one abscissa: zero has one sign.
fn bits(x: f64) -> u64 {
    (x + 0.0).to_bits()
}
