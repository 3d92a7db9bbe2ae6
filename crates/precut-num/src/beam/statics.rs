//! Reactions, shares and bending moments for one place of the tool, and the influence of a force that stands still.

use super::frame::{Ordinates, Work};
use super::matrix::Symmetric;
use super::model::{BeamError, State};
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
        let mut case = Case::of(self);
        case.load(x_mm);
        case.reactions()
    }

    /// Where the radial compliance at `x_mm` comes from, exactly: the works of all internal forces add up to it.
    pub fn shares(&self, x_mm: f64) -> Shares {
        let mut case = Case::of(self);
        case.load(x_mm);
        let mut shares = Shares { supports_mm_per_n: Vec::with_capacity(self.supports.len()), ..Shares::default() };
        case.walk(x_mm, |_, work, real| {
            shares.bending_mm_per_n += work.bending(real, real);
            shares.shear_mm_per_n += work.shearing(real, real);
        });
        for (support, reaction) in self.supports.iter().zip(case.reactions()) {
            let turned = support.rotational().unwrap_or(0.0) * reaction.couple_mm * reaction.couple_mm;
            let moved = support.springs().radial_mm_per_n * reaction.force * reaction.force;
            shares.supports_mm_per_n.push(moved + turned);
        }
        shares
    }

    /// The bending moment diagram for a unit radial force at `x_mm`: both ends of every part in which it is straight,
    /// in the order of their places. One-sided rests open.
    pub fn bending_moments(&self, x_mm: f64) -> Vec<BendingMoment> {
        let mut case = Case::of(self);
        case.load(x_mm);
        let mut moments = Vec::new();
        case.walk(x_mm, |[start, end], _, real| {
            moments.push(BendingMoment { z_mm: start, moment_mm: real.moment[0] });
            moments.push(BendingMoment { z_mm: end, moment_mm: real.moment[2] });
        });
        moments
    }

    /// The largest bending moment of the whole shaft per unit radial force at any of `tools_mm`, mm; one-sided rests
    /// open.
    pub fn peak_bending_moment_mm(&self, tools_mm: impl IntoIterator<Item = f64>) -> f64 {
        let mut case = Case::of(self);
        let mut peak = 0.0_f64;
        for x_mm in tools_mm {
            case.load(x_mm);
            case.walk(x_mm, |_, _, real| peak = peak.max(real.moment[0].abs()).max(real.moment[2].abs()));
        }
        peak
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
        let state = if self.state == State::Stock { State::Stock } else { State::Finished };
        let beam = Self::with_probe(&self.segments, &kept, state, Some(load_z_mm))?;
        let Some(steady) = &beam.steady else { return Ok(Vec::new()) };
        let pieces = beam.pieces(&beam.radial, &steady.radial);
        let probe = beam.frame.columns() - 1;
        Ok(beam.sample((0..beam.frame.intervals.len()).map(|k| pieces.at_rest(k, probe)), stations_mm))
    }
}

/// A unit radial force at the tool, wherever that is: what it raises in the redundants.
struct Case<'a> {
    beam: &'a Beam,
    works: Works<'a>,
    matrix: Symmetric,
    redundants: Vec<usize>,
    pivots: Vec<f64>,
    /// The redundants' forces, each in the direction of the load.
    forces: Vec<f64>,
}

impl<'a> Case<'a> {
    fn of(beam: &'a Beam) -> Self {
        let rows = Rows { couple: false, weight: false };
        let works = Works::new(&beam.frame, &beam.left, &beam.right, &beam.follow, rows);
        let matrix = Symmetric::default();
        Self { beam, works, matrix, redundants: Vec::new(), pivots: Vec::new(), forces: Vec::new() }
    }

    /// Puts the tool at `x_mm`.
    fn load(&mut self, x_mm: f64) {
        let Self { beam, works, matrix, redundants, pivots, forces } = self;
        works.arrange(x_mm);
        works.redundants(&beam.radial, redundants);
        forces.clear();
        if redundants.is_empty() {
            // Statics alone: nobody asks for works.
            return;
        }
        works.place(x_mm);
        works.sprung(&beam.radial, matrix);
        matrix.eliminate(redundants, pivots);
        forces.extend(matrix.back_substitute(redundants, pivots, works.force_row()));
    }

    /// All parts of the shaft: visits start, end, work and the diagram of the complete structure.
    fn walk(&mut self, x_mm: f64, mut visit: impl FnMut([f64; 2], &Work, &Ordinates)) {
        let Self { works, redundants, forces, .. } = self;
        let tool = works.force_row();
        works.walk(x_mm, |ends, work, unit| {
            let mut real = unit[tool];
            for (&row, &force) in redundants.iter().zip(forces.iter()) {
                real = real.plus(-force, &unit[row]);
            }
            visit(ends, work, &real);
        });
    }

    /// Of all supports, in the order given to the beam.
    fn reactions(&self) -> Vec<Reaction> {
        let Self { beam, works, .. } = self;
        debug_assert_eq!(beam.radial.fixed.len(), beam.unknowns.len());
        let mut reactions = vec![Reaction::default(); beam.supports.len()];
        let mut base = works.reactions[works.force_row()];
        for (&row, &force) in self.redundants.iter().zip(&self.forces) {
            for (generalised, own) in base.iter_mut().zip(works.reactions[row]) {
                *generalised -= force * own;
            }
            match beam.unknowns.get(row) {
                Some(unknown) if unknown.couple => reactions[unknown.support].couple_mm += force,
                Some(unknown) => reactions[unknown.support].force += force,
                None => reactions[beam.follow[row - beam.frame.columns()].0].force += force,
            }
        }
        let [first, second] = beam.frame.base.supports;
        reactions[first].force += base[0];
        if beam.frame.base.is_chuck() {
            reactions[first].couple_mm += base[1];
        } else {
            reactions[second].force += base[1];
        }
        reactions
    }
}
