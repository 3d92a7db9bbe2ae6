//! The stepped beam on springs: displacement under the tool for every place of the tool.
//!
//! `deflection/3.2` and `3.3`: Euler-Bernoulli or Timoshenko beam, force method on a statically determinate base with
//! running integrals of positive terms. There is no mesh between the stations: `n` stations cost O(n), and the
//! only break points are steps, supports and tool. A finite-element mesh with one element per station loses all
//! digits at some ten thousand stations; this does not.
//!
//! Error: some 1e-14 of the compliance that the base structure has at the place (the outermost two bilateral supports,
//! or a chuck alone), so at most `max(1e-9 W, 1e-12 max W)` at every station. Only where redundants hold back all but
//! a millionth of that, as two rigid rests a few millimetres apart on a slender overhang do, is it more.
//!
//! Three ways to the same result, by what changes with the tool: nothing but the load (`pieces`: one polynomial of
//! degree six per interval), the section too (`turning`: polynomials and an elimination per station), follow rests
//! too (`station`: the general case).
//!
//! Directions: `u` radial, positive away from the tool; `w` tangential; `x` along the shaft from the headstock end. A
//! couple is conjugate to the rotation of the section, which for Euler-Bernoulli is `dv/dx`.
//! Units: mm, N, rad.

mod bending;
mod contact;
mod displaced;
mod form;
mod frame;
mod matrix;
mod model;
mod pieces;
mod plane;
mod profile;
mod section;
mod statics;
mod station;
mod tables;
mod turning;

pub use contact::{Contacts, MAX_ONE_SIDED_RESTS, Response, ToolLoad};
pub use displaced::{Displaced, Offset};
pub use model::{BeamError, Contact, Segment, Side, Springs, State, Support};
pub use profile::{Profile, Wanted};
pub use section::{Material, Section, Theory, area_mm2, cowper_shear_coefficient, second_moment_mm4};
pub use statics::{BendingMoment, Reaction, Shares};

use bending::Bending;
use form::Raised;
use frame::{Base, Frame};
use pieces::Pieces;
use plane::{Direction, Factor, Plane, Unknown};
use tables::Tables;

/// A shaft on its supports, prepared for any number of stations.
#[derive(Debug, Clone)]
pub struct Beam {
    segments: Vec<Segment>,
    supports: Vec<Support>,
    frame: Frame,
    left: Tables,
    right: Tables,
    /// The fixed unknowns, in the order of the frame's loads.
    unknowns: Vec<Unknown>,
    /// Follow rests: index of the support and offset from the tool, mm.
    follow: Vec<(usize, f64)>,
    radial: Plane,
    tangential: Plane,
    /// The stock's section counts everywhere.
    stock: bool,
    /// The section changes with the tool.
    changing: bool,
    /// Where nothing but the load moves with the tool.
    steady: Option<Steady>,
}

/// What is known once and for all when nothing but the load moves with the tool.
#[derive(Debug, Clone)]
struct Steady {
    radial: Factor,
    tangential: Factor,
    /// Radial compliance, by interval.
    compliance: Vec<Raised>,
}

impl Beam {
    /// Prepares a shaft.
    ///
    /// Supports in any order, at distinct places. The cost is O((segments + supports) supports²).
    ///
    /// # Errors
    /// What [`BeamError`] lists; the first fault found.
    pub fn new(segments: &[Segment], supports: &[Support], state: State) -> Result<Self, BeamError> {
        Self::with_probe(segments, supports, state, None)
    }

    /// With a further unit force at a place where no support stands.
    fn with_probe(
        segments: &[Segment],
        supports: &[Support],
        state: State,
        probe: Option<f64>,
    ) -> Result<Self, BeamError> {
        let mut length_mm = model::validate(segments, supports)?;
        for z in supports.iter().filter_map(Support::fixed_z_mm) {
            length_mm = length_mm.max(z);
        }
        let changing = matches!(state, State::Mixed { .. }) && segments.iter().any(|s| s.finished != s.stock);
        let state = if changing || state == State::Stock { state } else { State::Finished };
        let base = Base::choose(supports).ok_or(BeamError::Unstable)?;
        let (unknowns, mut loads) = plane::fixed_unknowns(supports, &base);
        loads.extend(probe.map(|z| frame::Load { z: z.clamp(0.0, length_mm), couple: false }));
        let frame = Frame::new(segments, length_mm, base, loads, state);
        let left = Tables::new(&frame, Side::Left);
        let right = Tables::new(&frame, Side::Right);
        let follow: Vec<(usize, f64)> = supports
            .iter()
            .enumerate()
            .filter_map(|(i, support)| match support {
                Support::FollowRest { offset_mm, .. } => Some((i, *offset_mm)),
                _ => None,
            })
            .collect();
        let radial = Plane::new(Direction::Radial, supports, &unknowns, &frame, &follow);
        let tangential = Plane::new(Direction::Tangential, supports, &unknowns, &frame, &follow);
        let mut beam = Self {
            segments: segments.to_vec(),
            supports: supports.to_vec(),
            frame,
            left,
            right,
            unknowns,
            follow,
            radial,
            tangential,
            stock: state == State::Stock,
            changing,
            steady: None,
        };
        beam.steady = beam.settle();
        Ok(beam)
    }

    /// Length of the shaft, mm.
    pub fn length_mm(&self) -> f64 {
        self.frame.intervals.last().map_or(0.0, |interval| interval.end)
    }

    fn settle(&self) -> Option<Steady> {
        if !self.follow.is_empty() || (self.changing && self.frame.columns() > 0) {
            return None;
        }
        let end = self.frame.intervals.len();
        let pair = |i: usize, j: usize| self.left.pair(end, i, j);
        let radial = Factor::new(&self.frame, &self.radial, pair);
        let tangential = Factor::new(&self.frame, &self.tangential, pair);
        let pieces = self.pieces(&self.radial, &radial);
        let compliance = (0..end).map(|k| pieces.compliance(k)).collect();
        Some(Steady { radial, tangential, compliance })
    }

    fn bending(&self) -> Bending<'_> {
        Bending { frame: &self.frame, left: &self.left, right: &self.right }
    }

    fn pieces<'a>(&'a self, plane: &'a Plane, factor: &'a Factor) -> Pieces<'a> {
        Pieces { bending: self.bending(), plane, factor }
    }
}
