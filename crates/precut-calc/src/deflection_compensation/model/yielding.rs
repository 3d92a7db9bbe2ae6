//! The model along the shaft: how far the gap opens under the forces of an engaged depth.

use crate::num::beam::{Contacts, Displaced, Profile, ToolLoad, Wanted};

use crate::deflection_compensation::job::acting::{Acting, Passage};
use crate::deflection_compensation::job::grid::Grid;
use crate::deflection_compensation::job::input::{FeedDirection, Include, Job};
use crate::deflection_compensation::job::structure::Structure;
use crate::deflection_compensation::model::equilibrium::{Engagement, Opening, engage};
use crate::deflection_compensation::model::laws::{Loads, PowerLine, StationLaws};
use crate::deflection_compensation::model::power_cut::{NearbyPower, PowerCut};
use crate::deflection_compensation::model::regime::Regime;

/// What every depth has in common along the shaft: compliances, sag, stated errors, force laws.
///
/// A column that is 0 all along is left empty, see [`at`].
#[derive(Clone)]
pub(in crate::deflection_compensation) struct Line {
    pub work_mm_per_n: Vec<f64>,
    pub carriage_mm_per_n: f64,
    /// ∓ r_t G_vt: radial opening per feed force, 0 where the moment does not act, mm/N.
    moment_mm_per_n: Vec<f64>,
    /// W_z + w_cz, 0 where the tangential deflection does not act, mm/N.
    tangential_mm_per_n: Vec<f64>,
    /// Sag in the radial direction, mm.
    sag_mm: Vec<f64>,
    /// Stated errors, and what supports do that are set off, one-sided rests open, mm.
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
    /// Where nothing but a rising power of the depth acts on bilateral supports: y = W C t^z + e.
    power: Option<PowerLine>,
    /// Nothing opens the gap before a chip forms: no rubbing, no sag, no stated error.
    closed_at_zero: bool,
}

/// What the loads at a station add to the radial opening, mm: every part scales with the compliances, the first two
/// with the forces. What else opens the gap, stated errors and the gaps of rests, scales with neither.
#[derive(Debug, Clone, Copy, PartialEq)]
#[allow(clippy::struct_field_names, reason = "the unit stands in every name")]
pub(in crate::deflection_compensation) struct OpeningParts {
    /// By the passive force: W P_y.
    pub force_mm: f64,
    /// By the couple of the feed force: G_vt M.
    pub couple_mm: f64,
    /// By the weight.
    pub sag_mm: f64,
}

/// The step by which gravity is varied, relative: Y is piecewise linear in it, so the difference is exact but for
/// round-off.
const GRAVITY_STEP: f64 = 1e-6;

/// The entry of a column, 0 where the column was left empty.
#[inline]
pub(in crate::deflection_compensation) fn at(column: &[f64], i: usize) -> f64 {
    column.get(i).copied().unwrap_or(0.0)
}

/// Radii along the shaft that a cut is about, mm.
#[derive(Debug, Clone)]
pub(in crate::deflection_compensation) struct Radii {
    /// Wanted.
    pub target: Vec<f64>,
    /// Stock really there.
    pub stock: Vec<f64>,
    /// Stock that the compensation is planned on, and the cutting speed counted with, where it is not the real one.
    pub planned: Option<Vec<f64>>,
    /// Where the tool does not come, since nothing was planned to be cut; empty where it comes everywhere.
    pub idle: Vec<bool>,
}

impl Radii {
    /// Whether the tool does not come to a station.
    #[inline]
    pub(in crate::deflection_compensation) fn is_idle(&self, i: usize) -> bool {
        self.idle.get(i).copied().unwrap_or(false)
    }

    /// Stock that the compensation is planned on.
    pub(in crate::deflection_compensation) fn planned(&self) -> &[f64] {
        self.planned.as_ref().unwrap_or(&self.stock)
    }
}

/// What a [`Line`] is made of.
pub(in crate::deflection_compensation) struct Ingredients<'a> {
    pub job: &'a Job,
    pub grid: &'a Grid,
    pub acting: &'a Acting,
    pub structure: &'a Structure,
    pub regime: &'a Regime,
    pub radii: &'a Radii,
    /// At every station, or none where no effect asks for them.
    pub passages: &'a [Passage],
    /// What supports do that are set off.
    pub displaced: Option<&'a Displaced>,
}

impl Line {
    /// Whether the stated errors are a number at a station; a formula of the user need not have a value.
    #[inline]
    pub(in crate::deflection_compensation) fn has_error_value(&self, i: usize) -> bool {
        at(&self.error_mm, i).is_finite()
    }

    /// Everything along the shaft that no depth changes; `profile` holds what [`wanted`] of the job says.
    pub(in crate::deflection_compensation) fn of(from: &Ingredients<'_>, profile: Profile) -> Self {
        let Ingredients { job, acting, structure, regime, radii, .. } = *from;
        let include = &job.include;
        let Profile {
            radial_mm_per_n,
            couple_per_n,
            tangential_mm_per_n,
            sag_radial_mm,
            sag_tangential_mm,
            mut contacts,
        } = profile;
        if let (Some(contacts), Some(displaced)) = (&mut contacts, from.displaced) {
            contacts.displace(displaced.rests_mm.clone());
        }
        let sign = couple_sign(regime.direction);
        let arm_mm: Vec<f64> =
            if include.axial_moment() { radii.target.iter().map(|r| sign * r).collect() } else { Vec::new() };
        // Without the moment the beam was not asked for the couple: both are empty.
        let moment_mm_per_n = arm_mm.iter().zip(&couple_per_n).map(|(arm, g)| arm * g).collect();
        let carriage = structure.carriage_tangential_mm_per_n;
        let tangential_mm_per_n =
            if include.tangential() { tangential_mm_per_n.iter().map(|w| w + carriage).collect() } else { Vec::new() };
        let (gravity_tangential, gravity_radial) = gravity_components(job);
        let error_mm = errors_mm(from);
        let (sag_mm, tangential_offset_mm) = if include.weight {
            (
                sag_radial_mm.iter().map(|sag| gravity_radial * sag).collect(),
                sag_tangential_mm.iter().map(|sag| gravity_tangential * sag).collect(),
            )
        } else {
            (Vec::new(), Vec::new())
        };
        let laws = StationLaws::of(from);
        let closed_at_zero = !include.weight && !acting.has_errors() && laws.vanish_with_depth();
        let only_passive = !include.tangential() && !include.axial_moment() && !include.weight && contacts.is_none();
        let power = only_passive.then(|| laws.power()).flatten();
        Self {
            work_mm_per_n: radial_mm_per_n,
            carriage_mm_per_n: structure.carriage_mm_per_n,
            moment_mm_per_n,
            tangential_mm_per_n,
            sag_mm,
            error_mm,
            tangential_offset_mm,
            contacts,
            gravity_radial: if include.weight { gravity_radial } else { 0.0 },
            arm_mm,
            laws,
            with_main: needs_main(include),
            with_feed: include.axial_moment(),
            closed_at_zero,
            power,
        }
    }

    /// The same under cutting forces multiplied by `load`, of a shaft that sags `weight` times as far.
    pub(in crate::deflection_compensation) fn under(&self, load: f64, weight: f64) -> Self {
        let mut line = self.clone();
        line.laws.scale(load);
        line.power = self.power.as_ref().and_then(|_| line.laws.power());
        line.sag_mm.iter_mut().chain(&mut line.tangential_offset_mm).for_each(|sag| *sag *= weight);
        line.gravity_radial *= weight;
        line
    }

    /// Puts one-sided rests farther away from the shaft.
    pub(in crate::deflection_compensation) fn widen_gaps(&mut self, by_mm: f64) {
        if let Some(contacts) = &mut self.contacts {
            contacts.widen_gaps(by_mm);
        }
    }

    /// Whether one-sided rests may open and close.
    pub(in crate::deflection_compensation) fn has_contacts(&self) -> bool {
        self.contacts.is_some()
    }

    /// The one-sided rests that touch under the nominal loads at a station, as indices of the job's supports.
    pub(in crate::deflection_compensation) fn touching(&self, i: usize, loads: &Loads) -> Vec<usize> {
        let Some(contacts) = &self.contacts else { return Vec::new() };
        let closed = contacts.respond(i, self.tool_load(i, loads)).closed;
        let touches = |rest: usize| closed >> rest & 1 == 1;
        contacts.supports().iter().enumerate().filter(|(rest, _)| touches(*rest)).map(|(_, &support)| support).collect()
    }

    fn tool_load(&self, i: usize, loads: &Loads) -> ToolLoad {
        ToolLoad {
            force_n: loads.passive_n,
            couple_n_mm: at(&self.arm_mm, i) * loads.feed_n,
            gravity_radial: self.gravity_radial,
        }
    }

    /// Total compliance W = W_work + w_c at a station, mm/N.
    #[inline]
    pub(in crate::deflection_compensation) fn compliance_mm_per_n(&self, i: usize) -> f64 {
        self.work_mm_per_n[i] + self.carriage_mm_per_n
    }

    fn loads(&self, i: usize, depth_mm: f64) -> Loads {
        self.laws.loads(i, depth_mm, self.with_main, self.with_feed)
    }

    /// Loads in the limit of a vanishing depth: rubbing and ploughing.
    fn loads_at_zero(&self, i: usize) -> Loads {
        self.laws.loads_at_zero(i, self.with_main, self.with_feed)
    }

    /// Opening of the gap at an engaged depth.
    pub(in crate::deflection_compensation) fn opening_at(&self, i: usize, depth_mm: f64) -> Opening {
        self.opening(i, &self.loads(i, depth_mm))
    }

    /// Opening of the gap under given loads (`deflection/4.1`).
    #[inline]
    pub(in crate::deflection_compensation) fn opening(&self, i: usize, loads: &Loads) -> Opening {
        let (y_mm, y_slope) = match &self.contacts {
            None => {
                let w = self.compliance_mm_per_n(i);
                let moment = at(&self.moment_mm_per_n, i);
                (
                    w * loads.passive_n + moment * loads.feed_n + self.offset_mm(i),
                    w * loads.passive_slope + moment * loads.feed_slope,
                )
            }
            Some(contacts) => self.opening_with_contacts(contacts, i, loads),
        };
        let wz = at(&self.tangential_mm_per_n, i);
        Opening {
            y_mm,
            y_slope,
            z_mm: wz * loads.main_n + at(&self.tangential_offset_mm, i),
            z_slope: wz * loads.main_slope,
        }
    }

    /// With one-sided rests the displacement is piecewise linear in the complete load (`deflection/3.3`, item 3).
    fn opening_with_contacts(&self, contacts: &Contacts, i: usize, loads: &Loads) -> (f64, f64) {
        let arm = at(&self.arm_mm, i);
        let load =
            ToolLoad { force_n: loads.passive_n, couple_n_mm: arm * loads.feed_n, gravity_radial: self.gravity_radial };
        let response = contacts.respond(i, load);
        let y = response.displacement_mm + self.carriage_mm_per_n * loads.passive_n + at(&self.error_mm, i);
        let slope = (response.compliance_mm_per_n + self.carriage_mm_per_n) * loads.passive_slope
            + response.coupling_per_n * arm * loads.feed_slope;
        (y, slope)
    }

    /// What the loads add to the radial opening, with the one-sided rests as they stand under them.
    pub(in crate::deflection_compensation) fn parts(&self, i: usize, loads: &Loads) -> OpeningParts {
        let (work, coupling, sag_mm) = match &self.contacts {
            None => (self.work_mm_per_n[i], None, at(&self.sag_mm, i)),
            Some(contacts) => {
                let load = self.tool_load(i, loads);
                let response = contacts.respond(i, load);
                (response.compliance_mm_per_n, Some(response.coupling_per_n), sag_in_contact_mm(contacts, i, load))
            }
        };
        let couple_mm = match coupling {
            None => at(&self.moment_mm_per_n, i) * loads.feed_n,
            Some(coupling) => coupling * at(&self.arm_mm, i) * loads.feed_n,
        };
        OpeningParts { force_mm: (work + self.carriage_mm_per_n) * loads.passive_n, couple_mm, sag_mm }
    }

    /// Share of the tangential offset Z that the main force makes, mm; the rest is sag.
    #[inline]
    pub(in crate::deflection_compensation) fn tangential_by_force_mm(&self, i: usize, loads: &Loads) -> f64 {
        at(&self.tangential_mm_per_n, i) * loads.main_n
    }

    /// Sag and stated errors in the radial direction, mm.
    #[inline]
    fn offset_mm(&self, i: usize) -> f64 {
        at(&self.error_mm, i) + at(&self.sag_mm, i)
    }

    /// All loads at a nominal depth, none where there is no stock.
    pub(in crate::deflection_compensation) fn nominal_loads(&self, i: usize, depth_mm: f64) -> Loads {
        if depth_mm > 0.0 { self.laws.loads(i, depth_mm, true, true) } else { Loads::default() }
    }

    /// Whether anything moves the axis out of the radial direction.
    pub(in crate::deflection_compensation) fn moves_aside(&self) -> bool {
        !self.tangential_mm_per_n.is_empty() || !self.tangential_offset_mm.is_empty()
    }

    /// Whether the opening is W P_y(t) and stated errors, no more.
    pub(in crate::deflection_compensation) fn only_radial(&self) -> bool {
        self.contacts.is_none() && !self.moves_aside() && self.arm_mm.is_empty()
    }

    /// Adds the stated errors at the stations of `run` to `y_mm`.
    pub(in crate::deflection_compensation) fn add_errors(&self, run: std::ops::Range<usize>, y_mm: &mut [f64]) {
        if let Some(errors) = self.error_mm.get(run) {
            for (y, error) in y_mm.iter_mut().zip(errors) {
                *y += error;
            }
        }
    }

    /// Which of the force laws acts at a station.
    #[inline]
    pub(in crate::deflection_compensation) fn law_index(&self, i: usize) -> u32 {
        self.laws.index(i)
    }

    /// Passive force and its slope at a station and depth.
    pub(in crate::deflection_compensation) fn passive(&self, i: usize, depth_mm: f64) -> (f64, f64) {
        self.laws.law(i).passive_and_slope(depth_mm)
    }

    /// Exponent of the depth where nothing but a rising power of it acts.
    pub(in crate::deflection_compensation) fn exponent(&self) -> Option<f64> {
        self.power.as_ref().map(|power| power.exponent)
    }

    /// What solves the equilibrium station by station.
    pub(in crate::deflection_compensation) fn solver(&self) -> Solver<'_> {
        let power = self.power.as_ref().map(|power| (power, NearbyPower::new(power.exponent)));
        Solver { line: self, power }
    }

    /// What a command does at a station, solved in general.
    fn engage(&self, i: usize, stock_radius_mm: f64, command_mm: f64, start_mm: f64) -> Engagement {
        let at_zero = if self.closed_at_zero { Opening::default() } else { self.opening(i, &self.loads_at_zero(i)) };
        engage(stock_radius_mm, command_mm, start_mm, at_zero, |t| self.opening_at(i, t))
    }

    /// Share of the radial opening that force makes, mm: all but stated errors and what supports do that are set off.
    #[inline]
    pub(in crate::deflection_compensation) fn elastic_mm(&self, i: usize, y_mm: f64) -> f64 {
        y_mm - at(&self.error_mm, i) - self.held_back_mm(i)
    }

    /// By how much rests that touch with nothing cut hold back a shaft whose supports are set off, mm, <= 0.
    #[inline]
    fn held_back_mm(&self, i: usize) -> f64 {
        match &self.contacts {
            Some(contacts) if contacts.are_displaced() => contacts.respond(i, ToolLoad::default()).displacement_mm,
            _ => 0.0,
        }
    }
}

/// Solves the equilibrium along a shaft; keeps what one station can take over from another.
pub(in crate::deflection_compensation) struct Solver<'a> {
    line: &'a Line,
    power: Option<(&'a PowerLine, NearbyPower)>,
}

impl Solver<'_> {
    /// What a command does at a station; `start_mm` is a guess of the engaged depth.
    #[inline]
    pub(in crate::deflection_compensation) fn engage(
        &mut self,
        i: usize,
        stock_radius_mm: f64,
        command_mm: f64,
        start_mm: f64,
    ) -> Engagement {
        let line = self.line;
        if let Some((along, power)) = &mut self.power {
            let cut = PowerCut {
                stock_radius_mm,
                command_radius_mm: command_mm,
                stiffness_mm: line.compliance_mm_per_n(i) * along.factors_n[line.law_index(i) as usize],
                offset_mm: line.offset_mm(i),
                start_mm,
            };
            if let Some(engagement) = cut.engage(power) {
                return engagement;
            }
        }
        line.engage(i, stock_radius_mm, command_mm, start_mm)
    }
}

/// Sag under weight of the shaft on the rests that touch under a load, mm: dY/d(gravity) times gravity.
fn sag_in_contact_mm(contacts: &Contacts, i: usize, load: ToolLoad) -> f64 {
    if load.gravity_radial.abs() <= 0.0 {
        return 0.0;
    }
    let heavier = |by: f64| contacts.respond(i, ToolLoad { gravity_radial: load.gravity_radial * (1.0 + by), ..load });
    let here = contacts.respond(i, load);
    // Where a heavier shaft would open or close a rest, a lighter one leaves them as they stand.
    let step = if heavier(GRAVITY_STEP).closed == here.closed { GRAVITY_STEP } else { -GRAVITY_STEP };
    (heavier(step).displacement_mm - here.displacement_mm) / step
}

/// What of the beam's profile the job's physics needs.
pub(in crate::deflection_compensation) fn wanted(job: &Job) -> Wanted {
    Wanted { tangential: job.include.tangential(), couple: job.include.axial_moment(), weight: job.include.weight }
}

/// Whether the main force acts on anything that is computed.
fn needs_main(include: &Include) -> bool {
    include.tangential()
}

/// Sign of the feed force's couple: fed to the headstock the tool pushes the work toward -z at u = -r_t, a couple
/// -r_t P_x (`deflection/4.1`).
pub(in crate::deflection_compensation) fn couple_sign(direction: FeedDirection) -> f64 {
    if direction == FeedDirection::ToHeadstock { -1.0 } else { 1.0 }
}

/// Gravity across and along the radial direction, relative to g. Exact at the multiples of 90 degrees.
pub(in crate::deflection_compensation) fn gravity_components(job: &Job) -> (f64, f64) {
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

/// Stated errors at every station, mm, with what supports do that are set off; empty where there are none.
fn errors_mm(from: &Ingredients<'_>) -> Vec<f64> {
    let mut errors: Vec<f64> = from.passages.iter().map(|at| from.acting.error_mm(*at)).collect();
    if let Some(displaced) = from.displaced {
        errors.resize(displaced.work_mm.len(), 0.0);
        for (error, moved) in errors.iter_mut().zip(&displaced.work_mm) {
            *error += moved;
        }
    }
    errors
}
