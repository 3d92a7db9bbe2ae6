//! Supports that are set off the axis: what that alone does to the shaft.
//!
//! A support set off by `delta` moves the place of a unit load by `delta` times the reaction that this load raises in
//! it. In the base structure that is a column of displacements with no work of its own, `delta_p rho_p + delta_q rho_q`,
//! less the rest's own `delta` in the row of a redundant or of a rest; with the redundants eliminated the column holds
//! the displacements that are left. Exact for every support, section and follow rest of `deflection/3.2`.

use super::matrix::Symmetric;
use super::profile::Reduction;
use super::station::{Rows, Works};
use super::{Beam, BeamError, Steady};

/// How far a support is set off.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Offset {
    /// Index in the list given to the beam.
    pub support: usize,
    /// In the radial plane, mm, positive away from the tool.
    pub offset_mm: f64,
}

/// What supports that are set off do with no load, all one-sided rests open.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Displaced {
    /// Radial displacement of the work at the tool, mm, at every station.
    pub work_mm: Vec<f64>,
    /// How far the work moves toward the one-sided rests, mm, in the order of [`super::Contacts::supports`]: for every
    /// station, or once where it does not depend on where the tool is.
    pub rests_mm: Vec<f64>,
}

impl Beam {
    /// What supports set off by these amounts do, with the tool at every station; stations ascending, mm.
    ///
    /// A support that is not in the list stays where it is. A one-sided rest set off has its gap enlarged by as much.
    pub fn displaced(&self, stations_mm: &[f64], offsets: &[Offset]) -> Displaced {
        let mut of_supports = vec![0.0; self.supports.len()];
        for offset in offsets {
            if let Some(total) = of_supports.get_mut(offset.support) {
                *total += offset.offset_mm;
            }
        }
        match &self.steady {
            Some(steady) => self.displaced_at_rest(steady, stations_mm, &of_supports),
            None => self.displaced_with_tool(stations_mm, &of_supports),
        }
    }

    /// By what a rest must be set off to move the shaft that it holds by 1: 1 + c/G, G the compliance of the shaft at
    /// the rest without it. A rest that yields does not hold the shaft where it stands itself. For [`super::State::Mixed`]
    /// the finished section; one-sided rests open, follow rests away.
    ///
    /// # Errors
    /// [`BeamError::Unstable`] if nothing else holds the shaft.
    pub fn offset_per_displacement(&self, support: usize) -> Result<f64, BeamError> {
        let Some(given) = self.supports.get(support) else { return Ok(1.0) };
        let compliance = given.springs().radial_mm_per_n;
        let Some(z_mm) = given.fixed_z_mm().filter(|_| compliance > 0.0) else { return Ok(1.0) };
        let without = self.influence(z_mm, &[z_mm], Some(support))?;
        Ok(without.first().filter(|g| **g > 0.0).map_or(1.0, |g| 1.0 + compliance / g))
    }

    /// Of the base's generalised reactions.
    fn base_offsets(&self, of_supports: &[f64]) -> [f64; 2] {
        let [first, second] = self.frame.base.supports;
        [of_supports[first], if self.frame.base.is_chuck() { 0.0 } else { of_supports[second] }]
    }

    /// The base's displacements at loads with these reactions, less what their own supports are set off: first the
    /// fixed unknowns, then the follow rests, then what stands at no support.
    fn column(&self, reactions: &[[f64; 2]], of_supports: &[f64]) -> Vec<f64> {
        let base = self.base_offsets(of_supports);
        let fixed = self.unknowns.iter().map(|unknown| if unknown.couple { 0.0 } else { of_supports[unknown.support] });
        let follow = self.follow.iter().map(|&(support, _)| of_supports[support]);
        let own = fixed.chain(follow).chain(std::iter::repeat(0.0));
        reactions.iter().zip(own).map(|(rho, own)| rho[0] * base[0] + rho[1] * base[1] - own).collect()
    }

    /// Where nothing but the load moves with the tool: polynomials between the break points.
    fn displaced_at_rest(&self, steady: &Steady, stations: &[f64], of_supports: &[f64]) -> Displaced {
        let columns = self.frame.columns();
        let mut column = self.column(&self.frame.reactions[..columns], of_supports);
        let factor = &steady.radial;
        let eliminated = factor.matrix.reduce_column(&self.radial.redundants, &factor.pivots, &mut column);
        let base = self.base_offsets(of_supports);
        let pieces = self.pieces(&self.radial, factor);
        let forms = (0..self.frame.intervals.len()).map(|k| pieces.displaced(k, base, &eliminated));
        Displaced {
            work_mm: self.sample(forms, stations),
            rests_mm: self.one_sided().into_iter().map(|rest| column[rest]).collect(),
        }
    }

    /// Station by station, where the section or a rest moves with the tool.
    fn displaced_with_tool(&self, stations: &[f64], of_supports: &[f64]) -> Displaced {
        let rests = self.one_sided();
        let rows = Rows { couple: false, weight: false };
        let mut works = Works::new(&self.frame, &self.left, &self.right, &self.follow, rows);
        let mut reduction = Reduction::default();
        let mut displaced = Displaced::default();
        for &station in stations {
            works.place(station);
            reduction.reduce(&works, &self.radial);
            let mut column = self.column(&works.reactions, of_supports);
            let Reduction { matrix, redundants, pivots, .. } = &reduction;
            Symmetric::reduce_column(matrix, redundants, pivots, &mut column);
            displaced.work_mm.push(column[works.force_row()]);
            // A rest that cannot act is never reached.
            let reached =
                rests.iter().map(|&rest| if reduction.idle(&works, &self.radial, rest) { 0.0 } else { column[rest] });
            displaced.rests_mm.extend(reached);
        }
        displaced
    }
}
