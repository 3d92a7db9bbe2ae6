//! Circles through three points that hold their centre.

use super::contact::{FLAT, cross, dot, equidistant, hold_of_three, order_from_gap, unit};
use super::section::{Section, square};

/// A circle through three points that are not in one half circle.
#[derive(Debug, Clone, Copy)]
pub(super) struct Held {
    pub(super) contacts: [usize; 3],
    /// As the lists of the section have it.
    pub(super) centre: [f64; 2],
    pub(super) radius_mm: f64,
    /// See [`hold_of_three`]; positive, but for [`FLAT`].
    pub(super) hold: f64,
}

impl Held {
    /// The circle through three points; `None` where they lie in one half circle of it by more than round-off.
    pub(super) fn through(section: &Section, near: [f64; 2], contacts: [usize; 3]) -> Option<Self> {
        let [i, j, k] = contacts;
        let centre = equidistant(section, near, [i, j], [i, k])?;
        let spokes = contacts.map(|index| section.from(centre, index));
        let hold = hold_of_three(spokes.map(unit));
        let radius_mm = spokes.map(|spoke| square(spoke).sqrt()).iter().sum::<f64>() / 3.0;
        (hold > -FLAT).then_some(Self { contacts, centre, radius_mm, hold })
    }

    /// Distance of a point from the centre, mm.
    pub(super) fn distance_mm(&self, section: &Section, index: usize) -> f64 {
        square(section.from(self.centre, index)).sqrt()
    }
}

/// Three points that hold the centre between them: the best by `better` (of squared distances), and the best of either
/// quarter opposite to it; where a quarter is empty, its neighbours in angle. `None` where the points leave half a turn free.
pub(super) fn first_triple(
    section: &Section,
    centre: [f64; 2],
    first: usize,
    better: fn(f64, f64) -> bool,
) -> Option<[usize; 3]> {
    let ahead = section.from(centre, first);
    let mut quarters: [Option<(usize, f64)>; 2] = [None, None];
    for index in 0..section.len() {
        let v = section.from(centre, index);
        if dot(ahead, v) < 0.0 {
            let quarter = usize::from(cross(ahead, v) < 0.0);
            let d = square(v);
            if quarters[quarter].is_none_or(|(_, best)| better(d, best)) {
                quarters[quarter] = Some((index, d));
            }
        }
    }
    if let [Some((left, _)), Some((right, _))] = quarters {
        return Some([first, left, right]);
    }
    around(section, centre, first)
}

/// A point, the last one less than half a turn after it, and the one after that.
fn around(section: &Section, centre: [f64; 2], first: usize) -> Option<[usize; 3]> {
    let mut order = order_from_gap(section, centre);
    let at = order.iter().position(|&index| index == first)?;
    order.rotate_left(at);
    let ahead = section.from(centre, first);
    let left = order.iter().rposition(|&index| cross(ahead, section.from(centre, index)) > 0.0)?;
    let right = *order.get(left + 1)?;
    Some([first, order[left], right])
}
