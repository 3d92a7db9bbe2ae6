//! Reactions, shares and bending moments for one place of the tool, and the influence of a force that stands still.

use super::frame::Ordinates;
use super::matrix::Symmetric;
use super::model::{BeamError, State};
use super::plane::Plane;
use super::station::{Rows, Works};
use super::{Beam, Support};

/// What the shaft does to a support, for a unit force at the tool in the radial plane.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Reaction {
    /// Force per unit force, in the direction of the force at the tool.
    pub force: f64,
    /// Couple on a chuck per unit force, mm.
    pub couple_mm: f64,
}

/// The compliance at a place, divided up: `W = bending + shear + sum supports`.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct Shares {
    /// `∫ M²/EJ`, mm/N.
    pub bending_mm_per_n: f64,
    /// `∫ V²/kGA`, mm/N.
    pub shear_mm_per_n: f64,
    /// `R² c` of every support, for a chuck with its couple, mm/N; in the order given to the beam.
    pub supports_mm_per_n: Vec<f64>,
}

/// The bending moment at a place for a unit force at the tool.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct BendingMoment {
    /// Place, mm.
    pub z_mm: f64,
    /// Moment per unit force, mm; signed, positive where the force bends a shaft between two supports.
    pub moment_mm: f64,
}

impl Beam {
    /// Reactions of all supports to a unit radial force at `x_mm`; one-sided rests open.
    pub fn reactions(&self, x_mm: f64) -> Vec<Reaction> {
        self.solve(x_mm).1.reactions
    }

    /// Where the radial compliance at `x_mm` comes from, exactly: the works of all internal forces add up to it.
    pub fn shares(&self, x_mm: f64) -> Shares {
        let (mut works, solution) = self.solve(x_mm);
        let mut shares = Shares { supports_mm_per_n: Vec::with_capacity(self.supports.len()), ..Shares::default() };
        works.walk(x_mm, |_, work, unit| {
            let real = solution.superpose(unit);
            shares.bending_mm_per_n += work.bending(&real, &real);
            shares.shear_mm_per_n += work.shearing(&real, &real);
        });
        for (support, reaction) in self.supports.iter().zip(&solution.reactions) {
            let turned = support.rotational().unwrap_or(0.0) * reaction.couple_mm * reaction.couple_mm;
            let moved = support.springs().radial_mm_per_n * reaction.force * reaction.force;
            shares.supports_mm_per_n.push(moved + turned);
        }
        shares
    }

    /// The bending moment diagram for a unit radial force at `x_mm`: both ends of every part in which it is straight,
    /// in the order of their places. One-sided rests open.
    pub fn bending_moments(&self, x_mm: f64) -> Vec<BendingMoment> {
        let (mut works, solution) = self.solve(x_mm);
        let mut moments = Vec::new();
        works.walk(x_mm, |[start, end], _, unit| {
            let real = solution.superpose(unit);
            moments.push(BendingMoment { z_mm: start, moment_mm: real.moment[0] });
            moments.push(BendingMoment { z_mm: end, moment_mm: real.moment[2] });
        });
        moments
    }

    /// The largest bending moment of the whole shaft per unit radial force at `x_mm`, mm; one-sided rests open.
    pub fn peak_bending_moment_mm(&self, x_mm: f64) -> f64 {
        self.bending_moments(x_mm).iter().fold(0.0, |peak, at| at.moment_mm.abs().max(peak))
    }

    /// Radial displacement at the stations, mm/N, by a unit radial force that stands still at `load_z_mm`.
    ///
    /// Fixed bilateral supports only: one-sided rests are open, follow rests away. `left_out` removes the support of
    /// that index. Stations ascending. For [`State::Mixed`] the finished section.
    ///
    /// # Errors
    /// [`BeamError::Unstable`] if what is left doesn't hold the shaft.
    pub fn influence(
        &self,
        load_z_mm: f64,
        stations_mm: &[f64],
        left_out: Option<usize>,
    ) -> Result<Vec<f64>, BeamError> {
        let kept: Vec<Support> = self
            .supports
            .iter()
            .enumerate()
            .filter(|(i, support)| Some(*i) != left_out && support.bilateral_z_mm().is_some())
            .map(|(_, support)| *support)
            .collect();
        let state = if self.stock { State::Stock } else { State::Finished };
        let beam = Self::with_probe(&self.segments, &kept, state, Some(load_z_mm))?;
        let Some(steady) = &beam.steady else { return Ok(Vec::new()) };
        let pieces = beam.pieces(&beam.radial, &steady.radial);
        let probe = beam.frame.columns() - 1;
        Ok(beam.sample((0..beam.frame.intervals.len()).map(|k| pieces.at_rest(k, probe)), stations_mm))
    }

    /// All reactions to a unit force at the tool.
    fn solve(&self, x_mm: f64) -> (Works<'_>, Solution) {
        let mut works =
            Works::new(&self.frame, &self.left, &self.right, &self.follow, Rows { couple: false, weight: false });
        works.place(x_mm);
        let mut matrix = Symmetric::default();
        works.sprung(&self.radial, &mut matrix);
        let mut redundants = Vec::new();
        works.redundants(&self.radial, &mut redundants);
        let mut pivots = Vec::new();
        matrix.eliminate(&redundants, &mut pivots);
        let forces = matrix.back_substitute(&redundants, &pivots, works.force_row());
        let reactions = self.collect(&works, &redundants, &forces, &self.radial);
        let solution = Solution { tool: works.force_row(), redundants, forces, reactions };
        (works, solution)
    }

    fn collect(&self, works: &Works<'_>, redundants: &[usize], forces: &[f64], plane: &Plane) -> Vec<Reaction> {
        debug_assert_eq!(plane.fixed.len(), self.unknowns.len());
        let mut reactions = vec![Reaction::default(); self.supports.len()];
        let mut base = works.reactions[works.force_row()];
        for (&row, &force) in redundants.iter().zip(forces) {
            for (generalised, own) in base.iter_mut().zip(works.reactions[row]) {
                *generalised -= force * own;
            }
            match self.unknowns.get(row) {
                Some(unknown) if unknown.couple => reactions[unknown.support].couple_mm += force,
                Some(unknown) => reactions[unknown.support].force += force,
                None => reactions[self.follow[row - self.frame.columns()].0].force += force,
            }
        }
        let [first, second] = self.frame.base.supports;
        reactions[first].force += base[0];
        if self.frame.base.is_chuck() {
            reactions[first].couple_mm += base[1];
        } else {
            reactions[second].force += base[1];
        }
        reactions
    }
}

/// The redundants' share in a load case.
struct Solution {
    tool: usize,
    redundants: Vec<usize>,
    forces: Vec<f64>,
    reactions: Vec<Reaction>,
}

impl Solution {
    /// The diagram of the complete structure from those of the unit loads.
    fn superpose(&self, unit: &[Ordinates]) -> Ordinates {
        let mut real = unit[self.tool];
        for (&row, &force) in self.redundants.iter().zip(&self.forces) {
            real = real.plus(-force, &unit[row]);
        }
        real
    }
}
