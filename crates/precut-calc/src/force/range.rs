//! Where a force law was measured, and how far beyond a cut goes.

use super::Reached;
use crate::calculator::Finding;

/// Depth, feed and speed that the trials behind a force law covered: least and largest.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Range {
    pub depth_mm: (f64, f64),
    pub feed_mm_per_rev: (f64, f64),
    pub speed_m_per_min: (f64, f64),
}

/// What a cut reaches, to be held against a force law's range.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct ReachedCut<'a> {
    /// Nominal depth, mm.
    pub depth_mm: Reached<'a>,
    /// Feed, mm/rev.
    pub feed_mm_per_rev: Reached<'a>,
    /// Cutting speed, m/min.
    pub speed_m_per_min: Reached<'a>,
}

/// So many times the upper end of its range a law says nothing any more, and the job is refused.
const FAR: f64 = 4.0;
/// The digits of a difference of diameters are no depth.
const SLACK: f64 = 1e-9;

impl ReachedCut<'_> {
    fn quantities(&self, range: &Range) -> [(Reached<'_>, (f64, f64), &'static str, &'static str); 3] {
        [
            (self.depth_mm, range.depth_mm, "depth", "mm"),
            (self.feed_mm_per_rev, range.feed_mm_per_rev, "feed", "mm/rev"),
            (self.speed_m_per_min, range.speed_m_per_min, "speed", "m/min"),
        ]
    }

    /// A warning for every quantity that leaves its range.
    pub(super) fn outside(&self, range: &Range) -> Vec<Finding> {
        let quantities = self.quantities(range).into_iter();
        quantities.filter_map(|(reached, range, quantity, unit)| outside(reached, range, quantity, unit)).collect()
    }

    /// The depth or the feed that lies so far beyond its range that the law says nothing of it.
    pub(super) fn far_beyond(&self, range: &Range) -> Option<Finding> {
        let [depth, feed, _] = self.quantities(range);
        [depth, feed].into_iter().find(|(reached, range, ..)| reached.largest > FAR * range.1).map(
            |(reached, range, quantity, unit)| {
                Finding::new("far_beyond_force_model", reached.pointer)
                    .measured(reached.largest, FAR * range.1, unit)
                    .with("quantity", quantity)
                    .with("known_to", range.1)
            },
        )
    }
}

/// A warning if a quantity leaves its range, below before above.
pub(super) fn outside(
    reached: Reached,
    (least, largest): (f64, f64),
    quantity: &'static str,
    unit: &'static str,
) -> Option<Finding> {
    let finding = |value, limit| {
        Finding::new("extrapolated_force_model", reached.pointer)
            .measured(value, limit, unit)
            .with("quantity", quantity)
    };
    if reached.least < least * (1.0 - SLACK) {
        Some(finding(reached.least, least))
    } else if reached.largest > largest * (1.0 + SLACK) {
        Some(finding(reached.largest, largest))
    } else {
        None
    }
}
