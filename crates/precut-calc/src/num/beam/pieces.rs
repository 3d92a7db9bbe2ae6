//! Compliance, coupling, sag and influence as polynomials between break points.
//!
//! Valid where the elimination of the redundants does not depend on the tool: one section for the whole shaft, or the
//! partly turned one without redundants; no follow rest. With the redundants' influence functions `u_i` (cubic between
//! break points) reduced by the Cholesky factor of their matrix to `g_i`, `W = W_base - sum g_i²` is one polynomial of
//! degree six, however many supports there are.

use super::bending::Bending;
use super::form::{Form, Raised};
use super::model::Side;
use super::plane::{Factor, Plane};

/// Everything that the polynomials of a plane are made from.
#[derive(Clone, Copy)]
pub(super) struct Pieces<'a> {
    pub(super) bending: Bending<'a>,
    pub(super) plane: &'a Plane,
    pub(super) factor: &'a Factor,
}

impl Pieces<'_> {
    /// Compliance `W`, mm/N, over an interval.
    pub(super) fn compliance(&self, k: usize) -> Raised {
        let mut form = self.both_sides(k, 0);
        for generalised in 0..2 {
            let reaction = self.bending.reaction(k, generalised);
            form = form.plus(reaction.times(&reaction).scaled(self.plane.base[generalised]));
        }
        for g in self.reduced(|column| self.influence(k, column)).0 {
            form = form.plus(g.times(&g).scaled(-1.0));
        }
        let mut raised = form.raised();
        // Euler-Bernoulli: at a rigid support the compliance touches zero; with shear it meets zero under an angle.
        let interval = &self.bending.frame.intervals[k];
        let smooth =
            [Side::Left, Side::Right].iter().all(|side| interval.section(*side).shear_flexibility_per_n <= 0.0);
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
        let mut form = self.both_sides(k, 1);
        for (generalised, turned) in self.bending.couple_reactions().iter().enumerate() {
            form = form.plus(self.bending.reaction(k, generalised).scaled(self.plane.base[generalised] * turned));
        }
        let (displacements, _) = self.reduced(|column| self.influence(k, column));
        let (rotations, _) = self.reduced(|column| self.rotation(k, column));
        for (g, turn) in displacements.iter().zip(&rotations) {
            form = form.plus(g.times(turn).scaled(-1.0));
        }
        self.held(k, form)
    }

    /// Displacement by the whole weight acting in the positive direction, mm.
    pub(super) fn sag(&self, k: usize) -> Raised {
        let weight = self.bending.frame.columns();
        let mut form = self.influence(k, weight);
        let (displacements, _) = self.reduced(|column| self.influence(k, column));
        for (g, &redundant) in displacements.iter().zip(&self.plane.redundants) {
            form = form.plus(g.scaled(-self.factor.matrix.at(redundant, weight)));
        }
        self.held(k, form)
    }

    /// Displacement at the tool, mm, by supports that are set off: those of the base by `base_mm`, and the redundants so
    /// that `eliminated` is left of their column ([`super::matrix::Symmetric::reduce_column`]).
    pub(super) fn displaced(&self, k: usize, base_mm: [f64; 2], eliminated: &[f64]) -> Raised {
        let mut form = self.bending.reaction(k, 0).scaled(base_mm[0]);
        form = form.plus(self.bending.reaction(k, 1).scaled(base_mm[1]));
        for (g, value) in self.reduced(|column| self.influence(k, column)).0.iter().zip(eliminated) {
            form = form.plus(g.scaled(-value));
        }
        form.raised()
    }

    /// Displacement at the tool by a unit load of a fixed unknown that is not eliminated, mm/N.
    pub(super) fn at_rest(&self, k: usize, column: usize) -> Raised {
        let (_, open) = self.reduced(|column| self.influence(k, column));
        self.held(k, open[column])
    }

    /// Displacement of a rest by a unit couple at the tool, 1/N.
    pub(super) fn couple_at_rest(&self, k: usize, column: usize) -> Raised {
        let (_, open) = self.reduced(|column| self.rotation(k, column));
        open[column].raised()
    }

    fn both_sides(&self, k: usize, which: usize) -> Form {
        self.bending.by_force(k, Side::Left)[which].plus(self.bending.by_force(k, Side::Right)[which])
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
    fn reduced(&self, influence: impl Fn(usize) -> Form) -> (Vec<Form>, Vec<Form>) {
        let redundants = &self.plane.redundants;
        let mut open: Vec<Form> = (0..self.bending.frame.columns()).map(&influence).collect();
        let mut done = Vec::with_capacity(redundants.len());
        for (&redundant, &inverse) in redundants.iter().zip(&self.factor.pivots) {
            let g = open[redundant].scaled(inverse);
            for (column, form) in open.iter_mut().enumerate() {
                *form = form.plus(g.scaled(-self.factor.matrix.at(redundant, column)));
            }
            done.push(g);
        }
        (done, open)
    }

    /// Displacement at the tool by a unit load of a fixed unknown (or by the weight), springs included.
    fn influence(&self, k: usize, column: usize) -> Form {
        let reactions = self.bending.frame.reactions[column];
        let [displacement, _] = self.bending.curve(k, Side::Left, column);
        displacement
            .plus(self.bending.reaction(k, 0).scaled(self.plane.base[0] * reactions[0]))
            .plus(self.bending.reaction(k, 1).scaled(self.plane.base[1] * reactions[1]))
    }

    /// Rotation of the section at the tool by a unit load of a fixed unknown.
    fn rotation(&self, k: usize, column: usize) -> Form {
        let springs = self.plane.base_work(self.bending.couple_reactions(), self.bending.frame.reactions[column]);
        self.bending.curve(k, Side::Left, column)[1].plus(Form::new(&[springs]))
    }
}
