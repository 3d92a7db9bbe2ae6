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
    /// Compliance `W`, mm/N, over every interval.
    pub(super) fn compliances(&self) -> Vec<Raised> {
        let mut eliminated = Vec::with_capacity(self.plane.redundants.len());
        let intervals = 0..self.bending.frame.intervals.len();
        intervals.map(|k| self.compliance(k, &mut eliminated)).collect()
    }

    /// Over one interval; with room for the influence functions of the redundants.
    fn compliance(&self, k: usize, eliminated: &mut Vec<Form<4>>) -> Raised {
        let (left, right) = (self.bending.by_force(k, Side::Left).0, self.bending.by_force(k, Side::Right).0);
        let mut form = left.plus(right);
        for generalised in 0..2 {
            let reaction = self.bending.reaction(k, generalised);
            form = form.plus(reaction.times::<2, 3>(reaction).scaled(self.plane.base[generalised]));
        }
        let mut raised: Raised = form.raised();
        self.eliminate(eliminated, |column| self.influence(k, column));
        for g in &*eliminated {
            raised = raised.plus(g.times::<4, 7>(*g).scaled(-1.0));
        }
        // Euler-Bernoulli: at a rigid support the compliance touches zero; with shear it meets zero under an angle.
        let interval = &self.bending.frame.intervals[k];
        let smooth =
            [Side::Left, Side::Right].iter().all(|side| interval.section(*side).shear_flexibility_per_n <= 0.0);
        let Form(coefficients) = &mut raised;
        if self.plane.is_rigid(k) {
            coefficients[0] = 0.0;
            coefficients[1] = if smooth { 0.0 } else { coefficients[1] };
        }
        if self.plane.is_rigid(k + 1) {
            coefficients[6] = 0.0;
            coefficients[5] = if smooth { 0.0 } else { coefficients[5] };
        }
        raised
    }

    /// Coupling `G_vt`, 1/N: displacement at the tool by a unit couple at the tool.
    pub(super) fn coupling(&self, k: usize) -> Raised {
        let (left, right) = (self.bending.by_force(k, Side::Left).1, self.bending.by_force(k, Side::Right).1);
        let mut form: Raised = left.plus(right).raised();
        for (generalised, turned) in self.bending.couple_reactions().iter().enumerate() {
            form = form.plus(self.bending.reaction(k, generalised).scaled(self.plane.base[generalised] * turned));
        }
        let displacements = self.eliminated(|column| self.influence(k, column));
        let rotations = self.eliminated(|column| self.rotation(k, column));
        for (g, turn) in displacements.iter().zip(&rotations) {
            form = form.plus(g.times::<3, 6>(*turn).scaled(-1.0));
        }
        self.held(k, form)
    }

    /// Displacement by the whole weight acting in the positive direction, mm.
    pub(super) fn sag(&self, k: usize) -> Raised {
        let weight = self.bending.frame.columns();
        let eliminated = self.eliminated(|column| self.influence(k, column));
        let form = self.open(&eliminated, weight, self.influence(k, weight));
        self.held(k, form.raised().plus(self.bending.bow(k, Side::Left, weight)))
    }

    /// Displacement at the tool, mm, by supports that are set off: those of the base by `base_mm`, and the redundants so
    /// that `reduced` is left of their column ([`super::matrix::Symmetric::reduce_column`]).
    pub(super) fn displaced(&self, k: usize, base_mm: [f64; 2], reduced: &[f64]) -> Raised {
        let mut form: Raised = self.bending.reaction(k, 0).scaled(base_mm[0]).raised();
        form = form.plus(self.bending.reaction(k, 1).scaled(base_mm[1]));
        for (g, value) in self.eliminated(|column| self.influence(k, column)).iter().zip(reduced) {
            form = form.plus(g.scaled(-value));
        }
        form
    }

    /// Displacement at the tool by a unit load of a fixed unknown that is not eliminated, mm/N.
    pub(super) fn at_rest(&self, k: usize, column: usize) -> Raised {
        let eliminated = self.eliminated(|column| self.influence(k, column));
        self.held(k, self.open(&eliminated, column, self.influence(k, column)).raised())
    }

    /// Displacement of a rest by a unit couple at the tool, 1/N.
    pub(super) fn couple_at_rest(&self, k: usize, column: usize) -> Raised {
        let eliminated = self.eliminated(|column| self.rotation(k, column));
        self.open(&eliminated, column, self.rotation(k, column)).raised()
    }

    /// Exactly zero on rigid supports.
    fn held(&self, k: usize, mut raised: Raised) -> Raised {
        let Form(coefficients) = &mut raised;
        if self.plane.is_rigid(k) {
            coefficients[0] = 0.0;
        }
        if self.plane.is_rigid(k + 1) {
            coefficients[6] = 0.0;
        }
        raised
    }

    /// The influence functions of the redundants after the elimination, `g_i`.
    fn eliminated<const N: usize>(&self, influence: impl Fn(usize) -> Form<N>) -> Vec<Form<N>> {
        let mut eliminated = Vec::with_capacity(self.plane.redundants.len());
        self.eliminate(&mut eliminated, influence);
        eliminated
    }

    #[inline]
    fn eliminate<const N: usize>(&self, into: &mut Vec<Form<N>>, influence: impl Fn(usize) -> Form<N>) {
        into.clear();
        for (&redundant, &inverse) in self.plane.redundants.iter().zip(&self.factor.pivots) {
            into.push(self.open(into, redundant, influence(redundant)).scaled(inverse));
        }
    }

    /// The influence function of an unknown, or of the weight, with those redundants in place that are eliminated.
    #[inline]
    fn open<const N: usize>(&self, eliminated: &[Form<N>], column: usize, mut influence: Form<N>) -> Form<N> {
        for (g, &redundant) in eliminated.iter().zip(&self.plane.redundants) {
            influence = influence.plus(g.scaled(-self.factor.matrix.at(redundant, column)));
        }
        influence
    }

    /// Displacement at the tool by a unit load of a fixed unknown (or by the weight without its bow), springs included.
    #[inline]
    fn influence(&self, k: usize, column: usize) -> Form<4> {
        let reactions = self.bending.frame.reactions[column];
        let (displacement, _) = self.bending.curve(k, Side::Left, column);
        displacement
            .plus(self.bending.reaction(k, 0).scaled(self.plane.base[0] * reactions[0]))
            .plus(self.bending.reaction(k, 1).scaled(self.plane.base[1] * reactions[1]))
    }

    /// Rotation of the section at the tool by a unit load of a fixed unknown.
    fn rotation(&self, k: usize, column: usize) -> Form<3> {
        let springs = self.plane.base_work(self.bending.couple_reactions(), self.bending.frame.reactions[column]);
        self.bending.curve(k, Side::Left, column).1.plus(Form([springs]))
    }
}
