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
    /// [`State::Mixed`] only where the sections differ.
    state: State,
    /// Where nothing but the load moves with the tool.
    steady: Option<Steady>,
}

/// What is known once and for all when nothing but the load moves with the tool.
#[derive(Debug, Clone)]
struct Steady {
    radial: Factor,
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
        Ok(Self::on(frame, segments.to_vec(), supports.to_vec(), unknowns, state))
    }

    /// With the works of a frame.
    fn on(frame: Frame, segments: Vec<Segment>, supports: Vec<Support>, unknowns: Vec<Unknown>, state: State) -> Self {
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
        let radial = Plane::new(Direction::Radial, &supports, &unknowns, &frame, &follow);
        let mut beam = Self { segments, supports, frame, left, right, unknowns, follow, radial, state, steady: None };
        beam.steady = beam.settle();
        beam
    }

    /// The same with the weight among the loads.
    fn weighed(&self) -> Self {
        let Self { segments, supports, unknowns, .. } = self.clone();
        Self::on(self.frame.weighed(), segments, supports, unknowns, self.state)
    }

    /// The section changes with the tool.
    fn is_changing(&self) -> bool {
        matches!(self.state, State::Mixed { .. })
    }

    fn tangential(&self) -> Plane {
        Plane::new(Direction::Tangential, &self.supports, &self.unknowns, &self.frame, &self.follow)
    }

    /// Length of the shaft, mm.
    pub fn length_mm(&self) -> f64 {
        self.frame.intervals.last().map_or(0.0, |interval| interval.end)
    }

    /// By what share of itself the compliance of a finished shaft changes at most at any place, whichever segments have
    /// the blank's section instead.
    ///
    /// The compliance is the least complementary energy: with all flexibilities scaled by a factor it lies between itself
    /// and as many times itself, since the supports keep theirs. So the segment whose two sections differ most decides.
    pub fn stock_changes_at_most(&self) -> f64 {
        let ratio = |of: fn(&Section) -> f64, segment: &Segment| {
            let (stock, finished) = (of(&segment.stock), of(&segment.finished));
            if finished > 0.0 { (stock / finished - 1.0).abs() } else { 0.0 }
        };
        let bending = |segment| ratio(|section| section.bending_flexibility_per_n_mm2, segment);
        let shear = |segment| ratio(|section| section.shear_flexibility_per_n, segment);
        self.segments.iter().map(|segment| bending(segment).max(shear(segment))).fold(0.0, f64::max)
    }

    fn settle(&self) -> Option<Steady> {
        if !self.follow.is_empty() || (self.is_changing() && self.frame.columns() > 0) {
            return None;
        }
        let radial = self.factor(&self.radial);
        let compliance = self.pieces(&self.radial, &radial).compliances();
        Some(Steady { radial, compliance })
    }

    fn factor(&self, plane: &Plane) -> Factor {
        let end = self.frame.intervals.len();
        Factor::new(&self.frame, plane, |i, j| self.left.pair(end, i, j))
    }

    fn bending(&self) -> Bending<'_> {
        Bending { frame: &self.frame, left: &self.left, right: &self.right }
    }

    fn pieces<'a>(&'a self, plane: &'a Plane, factor: &'a Factor) -> Pieces<'a> {
        Pieces { bending: self.bending(), plane, factor }
    }
}
