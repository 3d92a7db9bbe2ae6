//! From numbers to places on the paper.
//!
//! In two steps, so that everything is thinned, joined and filled alike: first straight, along the axes;
//! then, on a roundness chart, bent round its centre.

use super::page::{Page, Px, put};
use super::scale::Scale;

/// One turn of a roundness chart, straight: in half degrees, about a pixel each on the paper.
const TURN: f64 = 720.0;
/// Three degrees: a chord of this leaves its circle by a tenth of a pixel.
const CHORD: f64 = 6.0;

/// A place on the straight axes, px; on a roundness chart half degrees and px of radius.
pub(super) type Place = (f64, f64);

/// How numbers lie on the paper.
#[derive(Debug, Clone, Copy)]
pub(super) enum Plane {
    /// Abscissa to the right, ordinate up.
    Flat {
        /// To the right.
        x: Scale,
        /// Up.
        y: Scale,
    },
    /// Abscissa an angle in degrees, counter-clockwise from the right; ordinate outward.
    Round {
        /// Middle of the chart, px.
        centre: (f64, f64),
        /// From ordinates to radii, px.
        radius: Scale,
    },
}

impl Plane {
    /// The place of a point along the axes; `None` if it has none.
    pub(super) fn place(&self, x: f64, y: f64) -> Option<Place> {
        match self {
            Self::Flat { x: scale, .. } => scale.at(x),
            Self::Round { .. } => x.is_finite().then(|| x.clamp(-1e300, 1e300) * 2.0),
        }
        .zip(self.along_y().at(y))
    }

    /// From coordinates of the abscissa to places along it.
    pub(super) fn abscissae(&self, (from, to): (f64, f64)) -> (f64, f64) {
        match self {
            Self::Flat { x, .. } => (x.px(from), x.px(to)),
            Self::Round { .. } => (from * 2.0, to * 2.0),
        }
    }

    /// From coordinates of the ordinate to places along it.
    pub(super) fn ordinates(&self, (from, to): (f64, f64)) -> (f64, f64) {
        (self.along_y().px(from), self.along_y().px(to))
    }

    /// The scale of the ordinates.
    pub(super) fn along_y(&self) -> &Scale {
        match self {
            Self::Flat { y, .. } => y,
            Self::Round { radius, .. } => radius,
        }
    }

    /// The place on the paper.
    pub(super) fn bent(&self, (u, v): Place) -> (f64, f64) {
        match self {
            Self::Flat { .. } => (u, v),
            Self::Round { centre, .. } => {
                let (sine, cosine) = (u.rem_euclid(TURN) / 2.0).to_radians().sin_cos();
                (centre.0 + v * cosine, centre.1 - v * sine)
            }
        }
    }

    /// Straight on the paper where the axes are, along the circle where they are not.
    pub(super) fn draw(&self, page: &mut Page, places: &[Place]) {
        let mut previous: Option<Place> = None;
        for place in places {
            if let (Self::Round { .. }, Some((u, v))) = (self, previous) {
                let (du, dv) = (place.0 - u, place.1 - v);
                let chords = (du.abs().min(TURN) / CHORD).ceil();
                for chord in (1_u8..=120).map(f64::from).take_while(|chord| *chord < chords) {
                    self.step(page, (u + du * chord / chords, v + dv * chord / chords), false);
                }
            }
            self.step(page, *place, previous.is_none());
            previous = Some(*place);
        }
    }

    /// A closed rectangle along the axes.
    pub(super) fn cell(&self, page: &mut Page, (left, right): (f64, f64), (low, high): (f64, f64)) {
        match self {
            Self::Flat { .. } => put!(page, "M{} {}H{}V{}H{}z", Px(left), Px(low), Px(right), Px(high), Px(left)),
            Self::Round { .. } => {
                self.draw(page, &[(left, low), (right, low), (right, high), (left, high)]);
                put!(page, "z");
            }
        }
    }

    fn step(&self, page: &mut Page, place: Place, is_first: bool) {
        let (x, y) = self.bent(place);
        put!(page, "{}{} {}", if is_first { 'M' } else { 'L' }, Px(x), Px(y));
    }

    /// Joins the end of a curve to its start where it goes once round: where no more is missing to a full
    /// turn than one and a half of its longest step.
    pub(super) fn close(&self, places: &mut Vec<Option<Place>>) {
        let (Self::Round { .. }, [Some(first), .., Some(last)]) = (self, places.as_slice()) else {
            return;
        };
        let turned = last.0 - first.0;
        let rest = TURN - turned.abs();
        let steps = places.windows(2).filter_map(|pair| Some((pair[1]?.0 - pair[0]?.0).abs()));
        if places.len() > 2 && rest > 1e-9 && rest <= 1.5 * steps.fold(0.0, f64::max) {
            let joined = (first.0 + TURN.copysign(turned), first.1);
            places.push(Some(joined));
        }
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::super::scale::Range;
    use super::*;
    use precut_calc::calculator::Spacing;

    fn round() -> Plane {
        let radius = Scale::new(Spacing::Linear, Range { low: 0.0, high: 10.0 }, 100.0, 200.0);
        Plane::Round { centre: (300.0, 300.0), radius }
    }

    fn drawn(places: &[Place]) -> String {
        let mut page = Page::default();
        round().draw(&mut page, places);
        page.into_string()
    }

    #[test]
    fn angles_run_counter_clockwise_from_the_right() {
        for (angle, (x, y)) in
            [(0.0, (500.0, 300.0)), (90.0, (300.0, 100.0)), (180.0, (100.0, 300.0)), (-90.0, (300.0, 500.0))]
        {
            let at = round().bent(round().place(angle, 10.0).unwrap());
            assert!((at.0 - x).abs() < 1e-9 && (at.1 - y).abs() < 1e-9, "{angle}: {at:?}");
        }
        let base = round().bent(round().place(0.0, 0.0).unwrap());
        assert!((base.0 - 400.0).abs() < 1e-9, "nothing deviates on the base circle");
    }

    #[test]
    fn long_steps_follow_the_circle() {
        let places: Vec<_> = [0.0, 360.0].map(|angle| round().place(angle, 10.0).unwrap()).to_vec();
        let text = drawn(&places);
        assert_eq!(text.matches('L').count(), 120);
        for point in text[1..].split('L') {
            let (x, y) = point.split_once(' ').unwrap();
            let radius = (x.parse::<f64>().unwrap() - 300.0).hypot(y.parse::<f64>().unwrap() - 300.0);
            assert!((radius - 200.0).abs() < 0.01, "{radius}");
        }
    }

    #[test]
    fn a_curve_once_round_closes_and_an_arc_does_not() {
        let ends_where_it_began = |angles: &[f64]| {
            let mut places: Vec<_> = angles.iter().map(|angle| round().place(*angle, *angle / 100.0)).collect();
            round().close(&mut places);
            places.len() > angles.len()
        };
        let turn: Vec<f64> = (0..36).map(|k| 10.0 * f64::from(k)).collect();
        assert!(ends_where_it_began(&turn));
        assert!(ends_where_it_began(&turn.iter().rev().copied().collect::<Vec<_>>()));
        assert!(!ends_where_it_began(&turn[..30]));
        assert!(!ends_where_it_began(&[turn.as_slice(), &[360.0]].concat()), "it is closed");
    }
}
