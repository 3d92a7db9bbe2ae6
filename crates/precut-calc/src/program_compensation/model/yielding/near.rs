//! What of an outline lies about a move: asked at every place of it, and in all of the outline only where a tool reaches farther.

use super::super::stock::{Chain, Part, Shape, Way};

/// So much beside what the tool can reach is looked at with it, mm.
const BESIDE_MM: f64 = 0.5;
/// As many parts take no second allocation.
const AS_USUAL: usize = 64;

/// What of an outline lies about a move, as it was when that was asked.
pub(crate) struct About {
    parts: Vec<Part>,
    from_mm: f64,
    to_mm: f64,
}

impl About {
    /// What a tool with edges up to the highest place of an outline reaches along a way.
    pub(crate) fn of(chain: &Chain, shape: &Shape, way: &Way) -> Self {
        let ends = way.ends();
        // An arc may reach farther than its ends.
        let beyond = if let Way::Arc { radius, .. } = way { 2.0 * radius } else { 0.0 };
        let lowest = ends[0][1].min(ends[1][1]) - beyond;
        let whole = shape.extent_mm((chain.highest() - lowest).max(0.0) + BESIDE_MM);
        // The edge on the side of the feed, and the nose on the other one.
        let nose = shape.extent_mm(0.0);
        let reach = match way {
            Way::Line(from, to) if to[0] < from[0] => [whole[0], nose[1]],
            Way::Line(from, to) if to[0] > from[0] => [nose[0], whole[1]],
            _ => whole,
        };
        let from_mm = ends[0][0].min(ends[1][0]) - beyond + reach[0] - BESIDE_MM;
        let to_mm = ends[0][0].max(ends[1][0]) + beyond + reach[1] + BESIDE_MM;
        let mut parts = Vec::with_capacity(AS_USUAL);
        parts.extend(chain.parts_between(from_mm, to_mm).copied());
        Self { parts, from_mm, to_mm }
    }
}

/// An outline about a move; farther away than its tool reaches it may be that before the moves that it goes on from.
pub(crate) struct Near<'a> {
    pub(crate) chain: &'a Chain,
    pub(crate) about: &'a About,
}

impl Near<'_> {
    /// The parts that lie between two places, wholly or not.
    pub(crate) fn parts_between(&self, from: f64, to: f64) -> impl Iterator<Item = &Part> {
        let About { parts, from_mm, to_mm } = self.about;
        let is_near = *from_mm <= from && to <= *to_mm;
        let first = parts.partition_point(|part| part.piece.x1 <= from);
        let near = if is_near { &parts[first..] } else { &[] };
        let far = (!is_near).then(|| self.chain.parts_between(from, to));
        near.iter().take_while(move |part| part.piece.x0 < to).chain(far.into_iter().flatten())
    }

    /// No radius is larger, mm.
    pub(crate) fn highest(&self) -> f64 {
        self.chain.highest()
    }

    /// Both ends of the outline, mm.
    pub(crate) fn ends(&self) -> [f64; 2] {
        self.chain.ends()
    }
}
