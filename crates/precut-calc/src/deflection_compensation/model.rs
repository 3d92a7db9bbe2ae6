//! The model along the shaft: how far the gap opens under the forces of an engaged depth.

use crate::calculator::Failure;
use crate::effects::DeflectionEffect as Effect;
use crate::force::{DepthLaw, ForceModel, Forces};
use crate::num::beam::{BeamError, Contacts, Profile, ToolLoad, Wanted};

use super::acting::{Acting, ForceChange, Passage};
use super::equilibrium::{Engagement, Opening, engage};
use super::grid::Grid;
use super::input::{FeedDirection, Include, Job};
use super::regime::Regime;
use super::structure::Structure;

/// Forces at a depth and their slopes dP/dt.
#[derive(Debug, Clone, Copy, Default, PartialEq)]
pub(super) struct Loads {
    pub passive_n: f64,
    pub passive_slope: f64,
    pub main_n: f64,
    pub main_slope: f64,
    pub feed_n: f64,
    pub feed_slope: f64,
}

/// Loads at the nominal depth of the station before.
#[derive(Debug, Default)]
pub(super) struct NominalLoads {
    key: Option<(u32, u64)>,
    loads: Loads,
}

/// What every depth has in common along the shaft: compliances, sag, stated errors, force laws.
pub(super) struct Line {
    pub work_mm_per_n: Vec<f64>,
    pub carriage_mm_per_n: f64,
    /// ∓ r_t G_vt: radial opening per feed force, 0 where the moment does not act, mm/N.
    moment_mm_per_n: Vec<f64>,
    /// W_z + w_cz, 0 where the tangential deflection does not act, mm/N.
    tangential_mm_per_n: Vec<f64>,
    /// Sag and stated errors in the radial direction, mm.
    radial_offset_mm: Vec<f64>,
    /// The stated errors among them, mm.
    error_mm: Vec<f64>,
    /// Sag across it, mm.
    tangential_offset_mm: Vec<f64>,
    contacts: Option<Contacts>,
    /// Radial component of gravity, relative.
    gravity_radial: f64,
    /// Signed arm of the feed force, 0 where its moment does not act, mm.
    arm_mm: Vec<f64>,
    laws: StationLaws,
    with_main: bool,
    with_feed: bool,
    /// Factor and exponent of every law where nothing but a rising power of the depth acts.
    powers: Option<Vec<(f64, f64)>>,
    /// Nothing opens the gap before a chip forms: no rubbing, no sag, no stated error.
    closed_at_zero: bool,
}

/// Force laws at the stations, effects in them: one for every speed and hardness that differ.
struct StationLaws {
    laws: Vec<DepthLaw>,
    of_station: Vec<u32>,
}

/// Radii along the shaft that a cut is about, mm.
#[derive(Debug, Clone)]
pub(super) struct Radii {
    /// Wanted.
    pub target: Vec<f64>,
    /// Stock really there.
    pub stock: Vec<f64>,
    /// Stock that the compensation is planned on, and the cutting speed counted with.
    pub planned: Vec<f64>,
}

impl Radii {
    /// The radii at some of the stations.
    pub(super) fn at(&self, chosen: &[usize]) -> Self {
        let of = |radii: &[f64]| chosen.iter().map(|&i| radii[i]).collect();
        Self { target: of(&self.target), stock: of(&self.stock), planned: of(&self.planned) }
    }
}

/// What a [`Line`] is made of.
pub(super) struct Ingredients<'a> {
    pub job: &'a Job,
    pub grid: &'a Grid,
    pub acting: &'a Acting,
    pub structure: &'a Structure,
    pub regime: &'a Regime,
    pub radii: &'a Radii,
    pub passages: &'a [Passage],
    /// Shape of every displaced rest at the stations.
    pub rest_shapes: &'a [Vec<f64>],
}

impl Line {
    /// Everything along the shaft that no depth changes; `profile` holds what [`wanted`] of the job says.
    pub(super) fn of(from: &Ingredients<'_>, profile: Profile) -> Self {
        let Ingredients { job, grid, acting, structure, regime, radii, .. } = *from;
        let include = &job.include;
        let Profile { radial_mm_per_n, couple_per_n, tangential_mm_per_n, sag_radial_mm, sag_tangential_mm, contacts } =
            profile;
        let n = grid.len();
        // Fed to the headstock the tool pushes the work toward -z at u = -r_t: a couple -r_t P_x (`deflection/4.1`).
        let sign = if regime.direction == FeedDirection::ToHeadstock { -1.0 } else { 1.0 };
        let arm_mm: Vec<f64> =
            if include.axial_moment { radii.target.iter().map(|r| sign * r).collect() } else { vec![0.0; n] };
        let moment_mm_per_n = if include.axial_moment {
            arm_mm.iter().zip(&couple_per_n).map(|(arm, g)| arm * g).collect()
        } else {
            vec![0.0; n]
        };
        let tangential_mm_per_n = if include.tangential {
            tangential_mm_per_n.iter().map(|w| w + structure.carriage_tangential_mm_per_n).collect()
        } else {
            vec![0.0; n]
        };
        let (gravity_tangential, gravity_radial) = gravity_components(job);
        let error_mm = errors_mm(from);
        let mut radial_offset_mm = error_mm.clone();
        let mut tangential_offset_mm = vec![0.0; n];
        if include.weight {
            for i in 0..n {
                radial_offset_mm[i] += gravity_radial * sag_radial_mm[i];
                tangential_offset_mm[i] = gravity_tangential * sag_tangential_mm[i];
            }
        }
        let laws = StationLaws::of(from);
        let closed_at_zero =
            !include.weight && !acting.has_errors() && laws.laws.iter().all(|law| law.limit() == Forces::default());
        let only_passive = !include.tangential && !include.axial_moment && !include.weight && contacts.is_none();
        let powers = only_passive.then(|| laws.powers()).flatten();
        Self {
            work_mm_per_n: radial_mm_per_n,
            carriage_mm_per_n: structure.carriage_mm_per_n,
            moment_mm_per_n,
            tangential_mm_per_n,
            radial_offset_mm,
            error_mm,
            tangential_offset_mm,
            contacts,
            gravity_radial: if include.weight { gravity_radial } else { 0.0 },
            arm_mm,
            laws,
            with_main: needs_main(include),
            with_feed: include.axial_moment,
            closed_at_zero,
            powers,
        }
    }

    /// Whether one-sided rests may open and close.
    pub(super) fn has_contacts(&self) -> bool {
        self.contacts.is_some()
    }

    /// The one-sided rests that touch under the nominal loads at a station, as indices of the job's supports.
    pub(super) fn touching(&self, i: usize, loads: &Loads) -> Vec<usize> {
        let Some(contacts) = &self.contacts else { return Vec::new() };
        let closed = contacts.respond(i, self.tool_load(i, loads)).closed;
        let touches = |rest: usize| closed >> rest & 1 == 1;
        contacts.supports().iter().enumerate().filter(|(rest, _)| touches(*rest)).map(|(_, &support)| support).collect()
    }

    fn tool_load(&self, i: usize, loads: &Loads) -> ToolLoad {
        ToolLoad {
            force_n: loads.passive_n,
            couple_n_mm: self.arm_mm[i] * loads.feed_n,
            gravity_radial: self.gravity_radial,
        }
    }

    /// Total compliance W = W_work + w_c at a station, mm/N.
    pub(super) fn compliance_mm_per_n(&self, i: usize) -> f64 {
        self.work_mm_per_n[i] + self.carriage_mm_per_n
    }

    /// All force components at a station and depth, with slopes; also those that do not act.
    fn all_loads(&self, i: usize, depth_mm: f64) -> Loads {
        self.laws.loads(i, depth_mm, true, true)
    }

    fn loads(&self, i: usize, depth_mm: f64) -> Loads {
        self.laws.loads(i, depth_mm, self.with_main, self.with_feed)
    }

    /// Loads in the limit of a vanishing depth: rubbing and ploughing.
    fn loads_at_zero(&self, i: usize) -> Loads {
        self.laws.loads_at_zero(i, self.with_main, self.with_feed)
    }

    /// Opening of the gap at an engaged depth.
    pub(super) fn opening_at(&self, i: usize, depth_mm: f64) -> Opening {
        self.opening(i, &self.loads(i, depth_mm))
    }

    /// Opening of the gap under given loads (`deflection/4.1`).
    pub(super) fn opening(&self, i: usize, loads: &Loads) -> Opening {
        let (y_mm, y_slope) = match &self.contacts {
            None => {
                let w = self.compliance_mm_per_n(i);
                let moment = self.moment_mm_per_n[i];
                (
                    w * loads.passive_n + moment * loads.feed_n + self.radial_offset_mm[i],
                    w * loads.passive_slope + moment * loads.feed_slope,
                )
            }
            Some(contacts) => self.opening_with_contacts(contacts, i, loads),
        };
        let wz = self.tangential_mm_per_n[i];
        Opening {
            y_mm,
            y_slope,
            z_mm: wz * loads.main_n + self.tangential_offset_mm[i],
            z_slope: wz * loads.main_slope,
        }
    }

    /// With one-sided rests the displacement is piecewise linear in the complete load (`deflection/3.3`, item 3).
    fn opening_with_contacts(&self, contacts: &Contacts, i: usize, loads: &Loads) -> (f64, f64) {
        let arm = self.arm_mm[i];
        let load =
            ToolLoad { force_n: loads.passive_n, couple_n_mm: arm * loads.feed_n, gravity_radial: self.gravity_radial };
        let response = contacts.respond(i, load);
        let y = response.displacement_mm + self.carriage_mm_per_n * loads.passive_n + self.error_mm[i];
        let slope = (response.compliance_mm_per_n + self.carriage_mm_per_n) * loads.passive_slope
            + response.coupling_per_n * arm * loads.feed_slope;
        (y, slope)
    }

    /// All loads at a nominal depth, none where there is no stock. Stations in a row mostly share depth and law:
    /// `last` keeps what was computed before.
    pub(super) fn nominal_loads(&self, i: usize, depth_mm: f64, last: &mut NominalLoads) -> Loads {
        let key = (self.laws.of_station[i], depth_mm.to_bits());
        if last.key != Some(key) {
            let loads = if depth_mm > 0.0 { self.all_loads(i, depth_mm) } else { Loads::default() };
            *last = NominalLoads { key: Some(key), loads };
        }
        last.loads
    }

    /// Passive force and its slope at a station and depth.
    pub(super) fn passive(&self, i: usize, depth_mm: f64) -> (f64, f64) {
        self.laws.law(i).passive_and_slope(depth_mm)
    }

    /// What a command does at a station; `start_mm` is a guess of the engaged depth.
    pub(super) fn engage(&self, i: usize, stock_radius_mm: f64, command_mm: f64, start_mm: f64) -> Engagement {
        if let Some(powers) = &self.powers {
            return self.engage_by_power(
                i,
                powers[self.laws.of_station[i] as usize],
                stock_radius_mm,
                command_mm,
                start_mm,
            );
        }
        let at_zero = if self.closed_at_zero { Opening::default() } else { self.opening(i, &self.loads_at_zero(i)) };
        engage(stock_radius_mm, command_mm, start_mm, at_zero, |t| self.opening_at(i, t))
    }

    /// The same where nothing but a pure power of the depth acts on bilateral supports: y = W C t^z + e.
    #[inline]
    fn engage_by_power(
        &self,
        i: usize,
        (factor_n, exponent): (f64, f64),
        stock_radius_mm: f64,
        command_mm: f64,
        start_mm: f64,
    ) -> Engagement {
        let stiffness = self.compliance_mm_per_n(i) * factor_n;
        let offset = self.radial_offset_mm[i];
        let at_zero = Opening { y_mm: offset, ..Opening::default() };
        engage(stock_radius_mm, command_mm, start_mm, at_zero, |t| {
            let y = stiffness * (exponent * t.ln()).exp();
            Opening { y_mm: y + offset, y_slope: exponent * y / t, z_mm: 0.0, z_slope: 0.0 }
        })
    }

    /// Share of the radial opening that force makes, mm: all but stated errors.
    pub(super) fn elastic_mm(&self, i: usize, opening: &Opening) -> f64 {
        opening.y_mm - self.error_mm[i]
    }
}

/// What of the beam's profile the job's physics needs.
pub(super) fn wanted(job: &Job) -> Wanted {
    Wanted { tangential: job.include.tangential, couple: job.include.axial_moment, weight: job.include.weight }
}

/// Whether the main force acts on anything that is computed.
fn needs_main(include: &Include) -> bool {
    include.tangential
}

/// Gravity across and along the radial direction, relative to g. Exact at the multiples of 90 degrees.
pub(super) fn gravity_components(job: &Job) -> (f64, f64) {
    let angle = job.gravity.angle_deg;
    let quarter = angle / 90.0;
    if (quarter - quarter.round()).abs() < f64::EPSILON {
        let turns = quarter.round().rem_euclid(4.0);
        return if turns < 0.5 {
            (0.0, 1.0)
        } else if turns < 1.5 {
            (1.0, 0.0)
        } else if turns < 2.5 {
            (0.0, -1.0)
        } else {
            (-1.0, 0.0)
        };
    }
    angle.to_radians().sin_cos()
}

fn errors_mm(from: &Ingredients<'_>) -> Vec<f64> {
    if !from.acting.has_errors() {
        return vec![0.0; from.grid.len()];
    }
    let mut shapes = vec![0.0; from.rest_shapes.len()];
    from.passages
        .iter()
        .enumerate()
        .map(|(i, at)| {
            for (shape, along) in shapes.iter_mut().zip(from.rest_shapes) {
                *shape = along[i];
            }
            from.acting.error_mm(*at, &shapes)
        })
        .collect()
}

impl StationLaws {
    fn of(from: &Ingredients<'_>) -> Self {
        let Ingredients { job, grid, acting, regime, radii, .. } = *from;
        let mut laws = Self { laws: Vec::new(), of_station: Vec::with_capacity(grid.len()) };
        let mut last = (f64::NAN, f64::NAN);
        for i in 0..grid.len() {
            let speed = regime.speed_m_per_min(radii.planned[i], radii.target[i]);
            let factor = acting.force.factor(grid.z_mm[i] / grid.length_mm, regime.feed_mm_per_rev, speed);
            if speed.to_bits() != last.0.to_bits() || factor.to_bits() != last.1.to_bits() {
                laws.laws.push(law_at(&job.force, regime.feed_mm_per_rev, speed, factor, &acting.force));
                last = (speed, factor);
            }
            // At most one law per station, and stations are limited to 200 000.
            laws.of_station.push(u32::try_from(laws.laws.len() - 1).unwrap_or(u32::MAX));
        }
        laws
    }

    /// Factor and exponent of the passive force of every law, where all are rising powers of the depth.
    fn powers(&self) -> Option<Vec<(f64, f64)>> {
        self.laws.iter().map(|law| law.passive_power().filter(|(_, exponent)| *exponent > 0.0)).collect()
    }

    fn law(&self, i: usize) -> &DepthLaw {
        &self.laws[self.of_station[i] as usize]
    }

    fn loads(&self, i: usize, depth_mm: f64, main: bool, feed: bool) -> Loads {
        let law = self.law(i);
        let (passive_n, passive_slope) = law.passive_and_slope(depth_mm);
        let (main_n, main_slope) = if main { law.main_and_slope(depth_mm) } else { (0.0, 0.0) };
        let (feed_n, feed_slope) = if feed { law.feed_and_slope(depth_mm) } else { (0.0, 0.0) };
        Loads { passive_n, passive_slope, main_n, main_slope, feed_n, feed_slope }
    }

    fn loads_at_zero(&self, i: usize, main: bool, feed: bool) -> Loads {
        let limit = self.law(i).limit();
        Loads {
            passive_n: limit.passive_n,
            main_n: if main { limit.main_n } else { 0.0 },
            feed_n: if feed { limit.feed_n } else { 0.0 },
            ..Loads::default()
        }
    }
}

/// The law at one feed and speed with the effects in it: factors on all components, then the turned
/// depth exponent, then what is added to the passive force.
fn law_at(
    force: &ForceModel,
    feed_mm_per_rev: f64,
    speed_m_per_min: f64,
    factor: f64,
    change: &ForceChange,
) -> DepthLaw {
    let mut law = force.at(feed_mm_per_rev, speed_m_per_min).scaled(factor);
    if let Some((delta, reference_mm)) = change.depth {
        law = law.with_depth_exponent(delta, reference_mm);
    }
    law.with_added(Forces { passive_n: change.added_passive_n, main_n: 0.0, feed_n: 0.0 })
}

/// Shape phi of the shaft for every displaced rest: G(z, z_s)/G(z_s, z_s) without the rest (`diagnosis/4.20`).
pub(super) fn rest_shapes(
    effects: &[Effect],
    job: &Job,
    grid: &Grid,
    structure: &Structure,
) -> Result<Vec<Vec<f64>>, Failure> {
    effects
        .iter()
        .filter_map(|effect| match effect {
            Effect::SteadyRestOffset { station_mm, .. } => Some(*station_mm),
            _ => None,
        })
        .map(|station_mm| {
            let rest = super::check::steady_at(job, station_mm)
                .ok_or_else(|| Failure::Internal("a displaced rest that is no support".to_owned()))?;
            let unstable = |error: BeamError| Failure::Internal(format!("without the displaced rest: {error}"));
            let at_rest = structure.beam.influence(station_mm, &[station_mm], Some(rest)).map_err(unstable)?;
            let along = structure.beam.influence(station_mm, &grid.z_mm, Some(rest)).map_err(unstable)?;
            Ok(along.into_iter().map(|g| g / at_rest[0]).collect())
        })
        .collect()
}
