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
    moment: Form,
    shear: Form,
}

impl Course {
    fn of(diagram: &Diagram) -> Self {
        Self {
            moment: Form::new(&diagram.ends).plus(Form::new(&[0.0, 4.0 * diagram.bulge, 0.0])),
            shear: Form::new(&diagram.shear),
        }
    }
}

impl Bending<'_> {
    /// Generalised reaction of the base to a unit force at the tool.
    pub(super) fn reaction(&self, k: usize, generalised: usize) -> Form {
        let interval = &self.frame.intervals[k];
        let at = |z: f64| self.frame.base.reactions(Load { z, couple: false })[generalised];
        Form::new(&[at(interval.start), at(interval.end)])
    }

    /// Generalised reactions of the base to a unit couple at the tool; the same everywhere.
    pub(super) fn couple_reactions(&self) -> [f64; 2] {
        self.frame.base.reactions(Load { z: 0.0, couple: true })
    }

    /// Displacement and rotation at the tool by a unit force there, from one side of the tool.
    pub(super) fn by_force(&self, k: usize, side: Side) -> [Form; 2] {
        let interval = &self.frame.intervals[k];
        match (interval.zone, side) {
            (Zone::Span, _) => {
                let reaction = self.reaction(k, usize::from(side == Side::Right));
                let functional = self.functional(k, side);
                let held = self.table(side).gram(node(k, side))[0];
                let work = self.running(k, side, &functional, &functional, held).times(&reaction);
                [work.times(&reaction), work.scaled(self.couple_reactions()[usize::from(side == Side::Right)])]
            }
            (Zone::Right, Side::Left) => cantilever(self.left.gram(k), interval.length, interval.section(side), side),
            (Zone::Left, Side::Right) => {
                cantilever(self.right.gram(k + 1), interval.length, interval.section(side), side)
            }
            (Zone::Left, Side::Left) | (Zone::Right, Side::Right) => [Form::new(&[0.0]); 2],
        }
    }

    /// Displacement and rotation at the tool by a unit load of a fixed unknown (or by the weight), from one side.
    pub(super) fn by_column(&self, k: usize, side: Side, column: usize) -> [Form; 2] {
        match (self.frame.intervals[k].zone, side) {
            (Zone::Span, _) => {
                let end = usize::from(side == Side::Right);
                let held = self.table(side).column(node(k, side), column)[0];
                let course = Course::of(self.frame.diagram(k, column, side));
                let work = self.running(k, side, &self.functional(k, side), &course, held);
                [work.times(&self.reaction(k, end)), work.scaled(self.couple_reactions()[end])]
            }
            (Zone::Right, Side::Left) | (Zone::Left, Side::Right) => self.curve(k, side, column),
            (Zone::Left, Side::Left) | (Zone::Right, Side::Right) => [Form::new(&[0.0]); 2],
        }
    }

    /// Work of two fixed diagrams on one side of the tool.
    pub(super) fn pair(&self, k: usize, side: Side, i: usize, j: usize) -> Form {
        let course = |column| Course::of(self.frame.diagram(k, column, side));
        self.running(k, side, &course(i), &course(j), self.table(side).pair(node(k, side), i, j))
    }

    /// Displacement and rotation along the interval by a unit load of a fixed unknown, or by the weight: where one
    /// section is in force on both sides, or one side gives all.
    pub(super) fn curve(&self, k: usize, side: Side, column: usize) -> [Form; 2] {
        let (start, end) = (self.state(k, column), self.state(k + 1, column));
        let interval = &self.frame.intervals[k];
        let section = interval.section(side);
        let diagram = self.frame.diagram(k, column, side);
        let bubble =
            interval.length * section.bending_flexibility_per_n_mm2 * (diagram.ends[1] - diagram.ends[0]) / 2.0;
        [
            deflection([start[0], end[0]], interval.length, section, diagram),
            Form::new(&[start[1], end[1]]).plus(Form::new(&[0.0, bubble, 0.0])),
        ]
    }

    fn table(&self, side: Side) -> &Tables {
        if side == Side::Left { self.left } else { self.right }
    }

    /// Diagram of a unit reaction of the near support, in the span.
    fn functional(&self, k: usize, side: Side) -> Course {
        let (interval, base) = (&self.frame.intervals[k], &self.frame.base);
        let (ends, shear) = match side {
            Side::Left => ([interval.start - base.p, interval.end - base.p], 1.0),
            Side::Right => ([base.q - interval.start, base.q - interval.end], -1.0),
        };
        Course { moment: Form::new(&ends), shear: Form::new(&[shear]) }
    }

    /// The work of two diagrams up to the tool: what was held before the interval, and its part.
    fn running(&self, k: usize, side: Side, a: &Course, b: &Course, held: f64) -> Form {
        let interval = &self.frame.intervals[k];
        let section = interval.section(side);
        let bend = interval.length * section.bending_flexibility_per_n_mm2;
        let mut density = a.moment.times(&b.moment).scaled(bend);
        if section.shear_flexibility_per_n > 0.0 {
            let shear = interval.length * section.shear_flexibility_per_n;
            density = density.plus(a.shear.times(&b.shear).scaled(shear));
        }
        density.accumulated(side).plus(Form::new(&[held]))
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
fn cantilever(gram: [f64; 3], h: f64, section: &Section, side: Side) -> [Form; 2] {
    let [vv, vt, tt] = gram;
    let (vt, sign) = if side == Side::Left { (vt, 1.0) } else { (-vt, -1.0) };
    let along = |coefficients: &mut [f64]| {
        if side == Side::Right {
            coefficients.reverse();
        }
        Form::new(coefficients)
    };
    let bend = section.bending_flexibility_per_n_mm2;
    let displacement = along(&mut [vv, vv + h * (2.0 * vt + section.shear_flexibility_per_n)])
        .plus(along(&mut [0.0, 0.0, h * h * tt]))
        .plus(along(&mut [0.0, 0.0, 0.0, h * h * h * bend / 3.0]));
    let rotation = along(&mut [vt, vt + h * tt]).plus(along(&mut [0.0, 0.0, h * h * bend / 2.0]));
    [displacement, rotation.scaled(sign)]
}

/// The deflection curve between two break points: chord, bending by the chord of the moments, and by a distributed
/// load. Of degree three, with the latter four; vanishes at an end where the displacement is zero to full relative accuracy.
fn deflection(ends: [f64; 2], h: f64, section: &Section, diagram: &Diagram) -> Form {
    let bend = section.bending_flexibility_per_n_mm2;
    let [a, b] = diagram.ends;
    let cubic = h * h * bend / 6.0;
    let mut curve = Form::new(&ends).plus(Form::new(&[0.0, cubic * (2.0 * a + b), cubic * (a + 2.0 * b), 0.0]));
    if diagram.bulge.abs() > 0.0 {
        // The bulge is q h²/8: q h⁴ / 24 EJ (xi eta + xi² eta²) of bending, q h² / 2 kGA xi eta of shear.
        let bow = diagram.bulge * h * h * bend / 3.0;
        let shear = 4.0 * diagram.bulge * section.shear_flexibility_per_n;
        curve = curve.plus(Form::new(&[0.0, bow + shear, 0.0])).plus(Form::new(&[0.0, 0.0, bow, 0.0, 0.0]));
    }
    curve
}
