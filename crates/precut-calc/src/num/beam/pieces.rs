//! Compliance, coupling, sag and influence as polynomials between break points.
//!
//! Valid where the elimination of the redundants does not depend on the tool: one section for the whole shaft, or the
//! partly turned one without redundants; no follow rest. With the redundants' influence functions `u_i` (cubic between
//! break points) reduced by the Cholesky factor of their matrix to `g_i`, `W = W_base - sum g_i²` is one polynomial of
//! degree six, however many supports there are.

use super::form::{Form, Raised};
use super::frame::{Diagram, Frame, Load, Zone};
use super::model::Side;
use super::plane::{Factor, Plane};
use super::tables::Tables;

/// Everything that the polynomials of a plane are made from.
#[derive(Clone, Copy)]
pub(super) struct Pieces<'a> {
    pub(super) frame: &'a Frame,
    pub(super) left: &'a Tables,
    pub(super) right: &'a Tables,
    pub(super) plane: &'a Plane,
    pub(super) factor: &'a Factor,
}

/// Bending and shear part of displacement and rotation at a break point.
type State = [f64; 2];

impl Pieces<'_> {
    /// Compliance `W`, mm/N, over an interval.
    pub(super) fn compliance(&self, k: usize) -> Raised {
        let mut form = self.base_compliance(k);
        for generalised in 0..2 {
            let reaction = self.reaction(k, generalised);
            form = form.plus(reaction.times(&reaction).scaled(self.plane.base[generalised]));
        }
        for g in self.reduced(k, |column| self.influence(k, column)).0 {
            form = form.plus(g.times(&g).scaled(-1.0));
        }
        let mut raised = form.raised();
        // Euler-Bernoulli: at a rigid support the compliance touches zero; with shear it meets zero under an angle.
        let smooth = self.frame.intervals[k].section(Side::Left).shear_flexibility_per_n <= 0.0
            && self.frame.intervals[k].section(Side::Right).shear_flexibility_per_n <= 0.0;
        if self.plane.is_rigid(k) {
            raised[0] = 0.0;
            raised[1] = if smooth { 0.0 } else { raised[1] };
        }
        if self.plane.is_rigid(k + 1) {
            raised[6] = 0.0;
            raised[5] = if smooth { 0.0 } else { raised[5] };
        }
        raised
    }

    /// Coupling `G_vt`, 1/N: displacement at the tool by a unit couple at the tool.
    pub(super) fn coupling(&self, k: usize) -> Raised {
        let turned = self.couple_reactions(k);
        let mut form = self.base_coupling(k);
        for (generalised, reaction) in turned.iter().enumerate() {
            form = form.plus(self.reaction(k, generalised).scaled(self.plane.base[generalised] * reaction));
        }
        let (displacements, _) = self.reduced(k, |column| self.influence(k, column));
        let (rotations, _) = self.reduced(k, |column| self.rotation(k, column));
        for (g, turn) in displacements.iter().zip(&rotations) {
            form = form.plus(g.times(turn).scaled(-1.0));
        }
        self.held(k, form)
    }

    /// Displacement by the whole weight acting in the positive direction, mm.
    pub(super) fn sag(&self, k: usize) -> Raised {
        let weight = self.frame.columns();
        let mut form = self.influence(k, weight);
        let (displacements, _) = self.reduced(k, |column| self.influence(k, column));
        for (g, &redundant) in displacements.iter().zip(&self.plane.redundants) {
            form = form.plus(g.scaled(-self.factor.matrix.at(redundant, weight)));
        }
        self.held(k, form)
    }

    /// Displacement at the tool by a unit load of a fixed unknown that is not eliminated, mm/N.
    pub(super) fn at_rest(&self, k: usize, column: usize) -> Raised {
        let (_, open) = self.reduced(k, |column| self.influence(k, column));
        self.held(k, open[column])
    }

    /// Displacement of a rest by a unit couple at the tool, 1/N.
    pub(super) fn couple_at_rest(&self, k: usize, column: usize) -> Raised {
        let (_, open) = self.reduced(k, |column| self.rotation(k, column));
        open[column].raised()
    }

    /// Exactly zero on rigid supports.
    fn held(&self, k: usize, form: Form) -> Raised {
        let mut raised = form.raised();
        if self.plane.is_rigid(k) {
            raised[0] = 0.0;
        }
        if self.plane.is_rigid(k + 1) {
            raised[6] = 0.0;
        }
        raised
    }

    /// Influence functions after the elimination: of the redundants (`g_i`), and of all unknowns with the redundants
    /// in place.
    fn reduced(&self, k: usize, influence: impl Fn(usize) -> Form) -> (Vec<Form>, Vec<Form>) {
        let redundants = &self.plane.redundants;
        let mut open: Vec<Form> = (0..self.frame.columns()).map(&influence).collect();
        let mut done = Vec::with_capacity(redundants.len());
        for (&redundant, &inverse) in redundants.iter().zip(&self.factor.pivots) {
            let g = open[redundant].scaled(inverse);
            for (column, form) in open.iter_mut().enumerate() {
                *form = form.plus(g.scaled(-self.factor.matrix.at(redundant, column)));
            }
            done.push(g);
        }
        debug_assert!(k < self.frame.intervals.len());
        (done, open)
    }

    /// Generalised reaction of the base to a unit force at the tool.
    fn reaction(&self, k: usize, generalised: usize) -> Form {
        let interval = &self.frame.intervals[k];
        let at = |z: f64| self.frame.base.reactions(Load { z, couple: false })[generalised];
        Form::new(&[at(interval.start), at(interval.end)])
    }

    fn couple_reactions(&self, k: usize) -> [f64; 2] {
        self.frame.base.reactions(Load { z: self.frame.intervals[k].start, couple: true })
    }

    /// Bending and shear of the base by a unit force at the tool: sums of positive terms.
    fn base_compliance(&self, k: usize) -> Form {
        let interval = &self.frame.intervals[k];
        let h = interval.length;
        match interval.zone {
            Zone::Span => {
                let (t, v) = (self.reaction(k, 0), self.reaction(k, 1));
                let (a, b) = self.span_integrals(k);
                t.times(&t).times(&a).plus(v.times(&v).times(&b))
            }
            Zone::Right => cantilever(self.left.gram(k), h, interval.section(Side::Left), false),
            Zone::Left => cantilever(self.right.gram(k + 1), h, interval.section(Side::Right), true),
        }
    }

    fn base_coupling(&self, k: usize) -> Form {
        let interval = &self.frame.intervals[k];
        let h = interval.length;
        match interval.zone {
            Zone::Span => {
                let [left, right] = self.couple_reactions(k);
                let (t, v) = (self.reaction(k, 0), self.reaction(k, 1));
                let (a, b) = self.span_integrals(k);
                t.times(&a).scaled(left).plus(v.times(&b).scaled(right))
            }
            Zone::Right => {
                let [_, vt, tt] = self.left.gram(k);
                let curve = 0.5 * h * h * interval.section(Side::Left).bending_flexibility_per_n_mm2;
                Form::new(&[vt]).plus(Form::new(&[0.0, h * tt])).plus(Form::new(&[0.0, 0.0, curve]))
            }
            Zone::Left => {
                let [_, vt, tt] = self.right.gram(k + 1);
                let curve = -0.5 * h * h * interval.section(Side::Right).bending_flexibility_per_n_mm2;
                Form::new(&[vt]).plus(Form::new(&[-h * tt, 0.0])).plus(Form::new(&[curve, 0.0, 0.0]))
            }
        }
    }

    /// `∫_p^x (s-p)²/EJ + 1/kGA ds` and `∫_x^q (q-s)²/EJ + 1/kGA ds` as forms of `x`.
    fn span_integrals(&self, k: usize) -> (Form, Form) {
        let interval = &self.frame.intervals[k];
        let h = interval.length;
        let base = &self.frame.base;
        let section = interval.section(Side::Left);
        let (near, far) = (interval.start - base.p, interval.end - base.p);
        let bend = h * section.bending_flexibility_per_n_mm2;
        let left = Form::new(&[self.left.gram(k)[0]])
            .plus(Form::new(&[
                0.0,
                bend * near * near,
                bend * near * (near + far),
                bend * (near * near + near * far + far * far) / 3.0,
            ]))
            .plus(Form::new(&[0.0, h * section.shear_flexibility_per_n]));
        let section = interval.section(Side::Right);
        let (far, near) = (base.q - interval.start, base.q - interval.end);
        let bend = h * section.bending_flexibility_per_n_mm2;
        let right = Form::new(&[self.right.gram(k + 1)[0]])
            .plus(Form::new(&[
                bend * (near * near + near * far + far * far) / 3.0,
                bend * near * (near + far),
                bend * near * near,
                0.0,
            ]))
            .plus(Form::new(&[h * section.shear_flexibility_per_n, 0.0]));
        (left, right)
    }

    /// Displacement at the tool by a unit load of a fixed unknown (or by the weight), springs included.
    fn influence(&self, k: usize, column: usize) -> Form {
        let curve = deflection(
            self.state(k, column)[0],
            self.state(k + 1, column)[0],
            self.frame.intervals[k].length,
            self.frame.intervals[k].section(Side::Left),
            self.frame.diagram(k, column, Side::Left),
        );
        let reactions = self.frame.reactions[column];
        curve
            .plus(self.reaction(k, 0).scaled(self.plane.base[0] * reactions[0]))
            .plus(self.reaction(k, 1).scaled(self.plane.base[1] * reactions[1]))
    }

    /// Rotation of the section at the tool by a unit load of a fixed unknown.
    fn rotation(&self, k: usize, column: usize) -> Form {
        let interval = &self.frame.intervals[k];
        let [start, end] = self.frame.diagram(k, column, Side::Left).ends;
        let bubble = 0.5 * interval.length * interval.section(Side::Left).bending_flexibility_per_n_mm2 * (end - start);
        let springs = self.plane.base_work(self.couple_reactions(k), self.frame.reactions[column]);
        Form::new(&[self.state(k, column)[1], self.state(k + 1, column)[1]])
            .plus(Form::new(&[0.0, bubble, 0.0]))
            .plus(Form::new(&[springs]))
    }

    fn state(&self, node: usize, column: usize) -> State {
        let intervals = &self.frame.intervals;
        if node == intervals.len() || intervals[node].zone == Zone::Right {
            return self.left.column(node, column);
        }
        if node == 0 || intervals[node - 1].zone == Zone::Left {
            return self.right.column(node, column);
        }
        let place = intervals[node].start;
        let force = self.frame.base.reactions(Load { z: place, couple: false });
        let couple = self.frame.base.reactions(Load { z: place, couple: true });
        let (before, behind) = (self.left.column(node, column)[0], self.right.column(node, column)[0]);
        [force[0] * before + force[1] * behind, couple[0] * before + couple[1] * behind]
    }
}

/// Compliance of a point on an overhang: compliance where the interval is held, carried to the point, and the interval's
/// own. `mirrored`: held at its end.
fn cantilever(gram: [f64; 3], h: f64, section: &super::Section, mirrored: bool) -> Form {
    let [vv, vt, tt] = gram;
    let along = |coefficients: &mut [f64]| {
        if mirrored {
            coefficients.reverse();
        }
        Form::new(coefficients)
    };
    let vt = if mirrored { -vt } else { vt };
    along(&mut [vv])
        .plus(along(&mut [0.0, h * (2.0 * vt + section.shear_flexibility_per_n)]))
        .plus(along(&mut [0.0, 0.0, h * h * tt]))
        .plus(along(&mut [0.0, 0.0, 0.0, h * h * h * section.bending_flexibility_per_n_mm2 / 3.0]))
}

/// The deflection curve between two break points: chord, bending by the chord of the moments, and by a distributed
/// load. Of degree four; vanishes at an end where the displacement is zero to full relative accuracy.
fn deflection(start: f64, end: f64, h: f64, section: &super::Section, diagram: &Diagram) -> Form {
    let bend = section.bending_flexibility_per_n_mm2;
    let [a, b] = diagram.ends;
    let cubic = h * h * bend / 6.0;
    let mut curve = Form::new(&[start, end]).plus(Form::new(&[0.0, cubic * (2.0 * a + b), cubic * (a + 2.0 * b), 0.0]));
    if diagram.bulge.abs() > 0.0 {
        // The bulge is q h²/8: q h⁴ / 24 EJ (xi eta + xi² eta²) of bending, q h² / 2 kGA xi eta of shear.
        let bow = diagram.bulge * h * h * bend / 3.0;
        let shear = 4.0 * diagram.bulge * section.shear_flexibility_per_n;
        curve = curve.plus(Form::new(&[0.0, bow + shear, 0.0])).plus(Form::new(&[0.0, 0.0, bow, 0.0, 0.0]));
    }
    curve
}
