//! Bending and shear works of a moving load as forms between break points, without springs.
//!
//! The shaft is cut at the tool; each side has its own section and gives its own share. For a shaft of one section the
//! shares of both sides add up to a deflection curve of lower degree, which is used instead.

use super::form::Form;
use super::frame::{Diagram, Frame, Load, Zone};
use super::model::Side;
use super::section::Section;
use super::tables::Tables;

/// Frame and running integrals.
#[derive(Clone, Copy)]
pub(super) struct Bending<'a> {
    pub(super) frame: &'a Frame,
    pub(super) left: &'a Tables,
    pub(super) right: &'a Tables,
}

/// Moment and shear over an interval.
#[derive(Clone, Copy)]
struct Course {
    moment: Form<3>,
    shear: Form<2>,
}

impl Course {
    fn of(diagram: &Diagram) -> Self {
        Self { moment: Form([0.0, 4.0 * diagram.bulge, 0.0]).plus(Form(diagram.ends)), shear: Form(diagram.shear) }
    }
}

impl Bending<'_> {
    /// Generalised reaction of the base to a unit force at the tool.
    pub(super) fn reaction(&self, k: usize, generalised: usize) -> Form<2> {
        let interval = &self.frame.intervals[k];
        let at = |z: f64| self.frame.base.reactions(Load { z, couple: false })[generalised];
        Form([at(interval.start), at(interval.end)])
    }

    /// Generalised reactions of the base to a unit couple at the tool; the same everywhere.
    pub(super) fn couple_reactions(&self) -> [f64; 2] {
        self.frame.base.reactions(Load { z: 0.0, couple: true })
    }

    /// Displacement and rotation at the tool by a unit force there, from one side of the tool.
    #[inline]
    pub(super) fn by_force(&self, k: usize, side: Side) -> (Form<6>, Form<5>) {
        let interval = &self.frame.intervals[k];
        let overhang = |gram| {
            let (displacement, rotation) = cantilever(gram, interval.length, interval.section(side), side);
            (displacement.raised(), rotation.raised())
        };
        match (interval.zone, side) {
            (Zone::Span, _) => {
                let end = usize::from(side == Side::Right);
                let (reaction, (moment, shear)) = (self.reaction(k, end), self.functional(k, side));
                let held = self.table(side).gram(node(k, side))[0];
                let (bending, shearing) = (moment.times::<2, 3>(moment), Form([shear * shear]));
                let work: Form<5> = self.running::<3, 1, 4>(k, side, bending, shearing, held).times(reaction);
                (work.times(reaction), work.scaled(self.couple_reactions()[end]))
            }
            (Zone::Right, Side::Left) => overhang(self.left.gram(k)),
            (Zone::Left, Side::Right) => overhang(self.right.gram(k + 1)),
            (Zone::Left, Side::Left) | (Zone::Right, Side::Right) => (Form::ZERO, Form::ZERO),
        }
    }

    /// Displacement and rotation at the tool by a unit load of a fixed unknown (or by the weight), from one side.
    pub(super) fn by_column(&self, k: usize, side: Side, column: usize) -> (Form<6>, Form<5>) {
        match (self.frame.intervals[k].zone, side) {
            (Zone::Span, _) => {
                let end = usize::from(side == Side::Right);
                let held = self.table(side).column(node(k, side), column)[0];
                let (course, (moment, shear)) =
                    (Course::of(self.frame.diagram(k, column, side)), self.functional(k, side));
                let (bending, shearing) = (moment.times::<3, 4>(course.moment), course.shear.scaled(shear));
                let work: Form<5> = self.running(k, side, bending, shearing, held);
                (work.times(self.reaction(k, end)), work.scaled(self.couple_reactions()[end]))
            }
            (Zone::Right, Side::Left) | (Zone::Left, Side::Right) => {
                let (displacement, rotation) = self.curve(k, side, column);
                (displacement.raised().plus(self.bow(k, side, column)), rotation.raised())
            }
            (Zone::Left, Side::Left) | (Zone::Right, Side::Right) => (Form::ZERO, Form::ZERO),
        }
    }

    /// Work of two fixed diagrams on one side of the tool.
    pub(super) fn pair(&self, k: usize, side: Side, i: usize, j: usize) -> Form<6> {
        let course = |column| Course::of(self.frame.diagram(k, column, side));
        let (a, b) = (course(i), course(j));
        let (bending, shearing) = (a.moment.times::<3, 5>(b.moment), a.shear.times::<2, 3>(b.shear));
        self.running(k, side, bending, shearing, self.table(side).pair(node(k, side), i, j))
    }

    /// Displacement and rotation along the interval by a unit load of a fixed unknown, or by the weight less its
    /// [`Self::bow`]: where one section is in force on both sides, or one side gives all.
    #[inline]
    pub(super) fn curve(&self, k: usize, side: Side, column: usize) -> (Form<4>, Form<3>) {
        let (start, end) = (self.state(k, column), self.state(k + 1, column));
        let interval = &self.frame.intervals[k];
        let (h, bend) = (interval.length, interval.section(side).bending_flexibility_per_n_mm2);
        let [a, b] = self.frame.diagram(k, column, side).ends;
        // The chord, and bending by the chord of the moments: vanishes at an end where the displacement is zero to full
        // relative accuracy.
        let cubic = h * h * bend / 6.0;
        let bubble = h * bend * (b - a) / 2.0;
        (
            Form([0.0, cubic * (2.0 * a + b), cubic * (a + 2.0 * b), 0.0]).plus(Form([start[0], end[0]])),
            Form([0.0, bubble, 0.0]).plus(Form([start[1], end[1]])),
        )
    }

    /// What a distributed load adds to the deflection curve between two break points.
    pub(super) fn bow(&self, k: usize, side: Side, column: usize) -> Form<5> {
        let interval = &self.frame.intervals[k];
        let (h, section, bulge) = (interval.length, interval.section(side), self.frame.diagram(k, column, side).bulge);
        // The bulge is q h²/8: q h⁴ / 24 EJ (xi eta + xi² eta²) of bending, q h² / 2 kGA xi eta of shear.
        let bow = bulge * h * h * section.bending_flexibility_per_n_mm2 / 3.0;
        let shear = 4.0 * bulge * section.shear_flexibility_per_n;
        Form([0.0, 0.0, bow, 0.0, 0.0]).plus(Form([0.0, bow + shear, 0.0]))
    }

    fn table(&self, side: Side) -> &Tables {
        if side == Side::Left { self.left } else { self.right }
    }

    /// Moment and shear by a unit reaction of the near support, in the span.
    fn functional(&self, k: usize, side: Side) -> (Form<2>, f64) {
        let (interval, base) = (&self.frame.intervals[k], &self.frame.base);
        match side {
            Side::Left => (Form([interval.start - base.p, interval.end - base.p]), 1.0),
            Side::Right => (Form([base.q - interval.start, base.q - interval.end]), -1.0),
        }
    }

    /// The work of two diagrams up to the tool, from the products of their moments and of their shears: what was held
    /// before the interval, and its part.
    #[inline]
    fn running<const M: usize, const S: usize, const R: usize>(
        &self,
        k: usize,
        side: Side,
        moments: Form<M>,
        shears: Form<S>,
        held: f64,
    ) -> Form<R> {
        let interval = &self.frame.intervals[k];
        let section = interval.section(side);
        let mut density = moments.scaled(interval.length * section.bending_flexibility_per_n_mm2);
        if section.shear_flexibility_per_n > 0.0 {
            density = density.plus(shears.scaled(interval.length * section.shear_flexibility_per_n));
        }
        density.accumulated::<R>(side).plus(Form([held]))
    }

    /// Displacement and rotation at a break point by a fixed load. Inside the span only for a shaft of one section.
    fn state(&self, node: usize, column: usize) -> [f64; 2] {
        let intervals = &self.frame.intervals;
        if node == intervals.len() || intervals[node].zone == Zone::Right {
            return self.left.column(node, column);
        }
        if node == 0 || intervals[node - 1].zone == Zone::Left {
            return self.right.column(node, column);
        }
        let force = self.frame.base.reactions(Load { z: intervals[node].start, couple: false });
        let couple = self.couple_reactions();
        let (before, behind) = (self.left.column(node, column)[0], self.right.column(node, column)[0]);
        [force[0] * before + force[1] * behind, couple[0] * before + couple[1] * behind]
    }
}

/// The break point at which the tables of a side hold what lies before an interval.
fn node(k: usize, side: Side) -> usize {
    if side == Side::Left { k } else { k + 1 }
}

/// Displacement and rotation of a point on an overhang by a unit force there: the compliance of the place where the
/// interval is held, carried to the point, and the interval's own. `side`: on which side of the point it is held.
fn cantilever(gram: [f64; 3], h: f64, section: &Section, side: Side) -> (Form<4>, Form<3>) {
    let [vv, vt, tt] = gram;
    let (vt, sign) = if side == Side::Left { (vt, 1.0) } else { (-vt, -1.0) };
    let bend = section.bending_flexibility_per_n_mm2;
    let displacement = Form([0.0, 0.0, 0.0, h * h * h * bend / 3.0])
        .plus(Form([vv, vv + h * (2.0 * vt + section.shear_flexibility_per_n)]))
        .plus(Form([0.0, 0.0, h * h * tt]));
    let rotation = Form([0.0, 0.0, h * h * bend / 2.0]).plus(Form([vt, vt + h * tt])).scaled(sign);
    if side == Side::Left { (displacement, rotation) } else { (displacement.mirrored(), rotation.mirrored()) }
}
