//! How hard the workpiece must be clamped: the kernel of clamping under the loads of a period (`milling/6.21`).

use crate::calculator::{Failure, checkpoint};
use crate::clamping::{Asked as AskedOfSheet, Contact, Criterion, Load, Rest, Sheet, Unheld, Vector};

use super::super::job::{Held, way};
use super::super::model::{Carried, Cut, Forced, Instant, MOST_OSCILLATIONS, Sampling, Side, statics};
use super::output::{
    ClampCriterion, ClampDeciding, ClampLift, ClampRemedy, ClampRemedyKind, ClampStation, ClampTurn, ClampingStatus,
    ContactUse, MillingClamping,
};
use super::{MODEL_ENDS, Study};

/// A clamp force holds where it is short of what is asked by no more than rounding.
const ROUNDED: f64 = 1e-9;
/// Contacts in all programmes for certain slip together: they are the dearest part.
const PROGRAMMES: usize = 4800;
/// Contacts in all loads of a period together, roughly.
const CONTACT_LOADS: f64 = 48_000.0;
/// Multiplications that a contact takes under a load.
const PER_CONTACT: usize = 300;
/// Stiffness of a contact that is added, along its normal and across, N/mm.
const ADDED_N_PER_MM: [f64; 2] = [40_000.0, 28_000.0];

/// The loads of a period on the workpiece.
struct Loads {
    instants: Vec<Instant>,
    /// Instant by instant, at each of the places of the cut.
    all: Vec<Load>,
}

/// Whether the work does.
pub(super) fn yields(cut: &Cut<'_>) -> bool {
    cut.structure.modes.iter().any(|mode| mode.side == Side::Work)
}

/// A forced motion that the model knows; `None` of one that has none, or beyond the model, or over too many oscillations.
fn known<'a>(study: &'a Study<'_>, cut: &'a Cut<'a>) -> Result<Option<Forced<'a>>, Failure> {
    let is_dear = cut.oscillations() > MOST_OSCILLATIONS && !cut.is_slow();
    if !yields(cut) || cut.rotation.varies() || is_dear {
        return Ok(None);
    }
    let forced = study.orders.forced(cut, study.monitor)?;
    Ok(forced.filter(|forced| {
        let (low, high) = forced.extremes();
        (0..3).all(|q| high[q] - low[q] <= MODEL_ENDS * cut.milling.radius_mm)
    }))
}

impl Study<'_> {
    /// The load on the workpiece by a force on the tool, in the axes of the fixture.
    fn load(&self, on_tool: &Vector, point_mm: Vector) -> Load {
        let [x, y, z] = on_tool.map(|force| -force);
        let (sin, cos) = self.job.cut.feed_direction_deg.to_radians().sin_cos();
        Load { force_n: [x * cos - y * sin, x * sin + y * cos, z], point_mm }
    }

    /// The loads of a cut.
    fn loads(&self, held: &Held, carried: &Carried<'_>) -> Result<Loads, Failure> {
        // Where nothing holds every instant asks for as much.
        let asked = |force: &Vector| {
            let at = |point: &Vector| asked_n(held, &[self.load(force, *point)]).unwrap_or(0.0);
            held.points_mm.iter().map(at).fold(f64::NEG_INFINITY, f64::max)
        };
        let contacts = held.points_mm.len() * held.fixture.contacts.len();
        let sampling = Sampling { most: CONTACT_LOADS / contacts as f64, work: PER_CONTACT * contacts };
        let instants = carried.instants(asked, sampling, self.monitor)?;
        let of = |instant: &Instant| held.points_mm.iter().map(|point| self.load(&instant.force_n, *point)).collect();
        let all = instants.iter().flat_map(|instant| -> Vec<Load> { of(instant) }).collect();
        Ok(Loads { instants, all })
    }

    /// Peak of what the springs of the work carry over that of the static force; 1 of a rigid work.
    fn dynamic_factor(&self, cut: &Cut<'_>, carried: &Carried<'_>) -> Result<Option<f64>, Failure> {
        if !yields(cut) {
            return Ok(Some(1.0));
        }
        let largest =
            |instants: &[Instant]| instants.iter().filter_map(|one| carried.yielding_n(&one.force_n)).reduce(f64::max);
        let of = |force: &Vector| carried.yielding_n(force).unwrap_or(0.0);
        let sampling = Sampling { most: f64::INFINITY, work: 0 };
        let still = Carried::new(cut, None).instants(of, sampling, self.monitor)?;
        let moving = carried.instants(of, sampling, self.monitor)?;
        let both = largest(&moving).zip(largest(&still)).filter(|(_, still)| *still > 0.0);
        Ok(both.map(|(moving, still)| moving / still))
    }

    /// The least clamp force that a cut asks for at the lowest friction, N; `None` where none holds.
    pub(super) fn clamp_asked_n(&self, held: &Held, cut: &Cut<'_>) -> Result<Option<f64>, Failure> {
        Ok(asked_n(held, &self.loads_of(held, cut)?).ok())
    }

    /// The same of the static force at its largest, and of the mean force, at a depth; whatever the speed.
    pub(super) fn static_clamp_n(&self, held: &Held, depth_mm: f64) -> Result<[Option<f64>; 2], Failure> {
        let cut = Cut { depth_mm, ..self.cut() };
        let peaks = self.loads(held, &Carried::new(&cut, None))?.all;
        let mean = statics(cut.milling, depth_mm, self.monitor)?.mean_n;
        let means: Vec<Load> = held.points_mm.iter().map(|point| self.load(&mean, *point)).collect();
        Ok([peaks, means].map(|loads| asked_n(held, &loads).ok().map(|force| force.max(0.0))))
    }

    /// The loads of a cut over a period at all places.
    pub(super) fn loads_of(&self, held: &Held, cut: &Cut<'_>) -> Result<Vec<Load>, Failure> {
        let forced = known(self, cut)?;
        Ok(self.loads(held, &Carried::new(cut, forced.as_ref()))?.all)
    }
}

/// The least clamp force at the lowest friction, N, below 0 where loads press.
fn asked_n(held: &Held, loads: &[Load]) -> Result<f64, Unheld> {
    let loaded = held.rest.loaded(&held.fixture, loads, held.safety)?;
    Ok(held.rest.against_slip(&loaded, &held.friction[0]).map_or(0.0, |deciding| deciding.clamp_force_n))
}

impl Held {
    /// The same with more contacts, as rough as the smoothest of its own; `None` where the clamps do not balance.
    fn with(&self, added: &[Contact]) -> Option<Self> {
        let mut more = self.clone();
        more.fixture.contacts.extend_from_slice(added);
        more.rest = Rest::of(&more.fixture).ok()?;
        for friction in &mut more.friction {
            let least = friction.iter().copied().fold(f64::INFINITY, f64::min);
            friction.resize(more.fixture.contacts.len(), least);
        }
        Some(more)
    }
}

/// Whether a clamp force is enough.
pub(super) fn is_enough(force_n: f64, asked_n: f64) -> bool {
    force_n >= asked_n * (1.0 - ROUNDED)
}

/// Everything that is asked of the clamping.
pub(super) fn clamping(study: &Study<'_>, held: &Held) -> Result<(MillingClamping, Option<&'static str>), Failure> {
    let cut = study.cut();
    let forced = known(study, &cut)?;
    let carried = Carried::new(&cut, forced.as_ref());
    let Loads { instants, all: loads } = study.loads(held, &carried)?;
    let dynamic_factor = study.dynamic_factor(&cut, &carried)?;
    let mean = statics(cut.milling, cut.depth_mm, study.monitor)?.mean_n;
    let means: Vec<Load> = held.points_mm.iter().map(|point| study.load(&mean, *point)).collect();
    let [low, likely, high] = &held.friction;
    let asked = AskedOfSheet {
        fixture: &held.fixture,
        peaks: &loads,
        means: &means,
        safety: held.safety,
        friction: [low, likely, high],
        clamp_force_n: held.clamp_force_n,
        programmes: (PROGRAMMES / held.fixture.contacts.len()).max(8),
    };
    checkpoint(study.monitor)?;
    let upward_n = loads.iter().map(|load| load.force_n[2]).fold(0.0, f64::max);
    Ok(match asked.sheet() {
        Ok(sheet) => (told(held, &sheet, &instants, &loads, upward_n, dynamic_factor), None),
        Err(unheld) => {
            let free = if let Unheld::Free(free) = unheld { Some(way(&free)) } else { None };
            let nothing = MillingClamping {
                status: ClampingStatus::CannotHold,
                clamp_force_min_n: None,
                at_likely_friction_n: None,
                at_high_friction_n: None,
                against_mean_n: None,
                certain_slip_below_n: None,
                certain_slip_by_mean_n: None,
                stations: stations(held, &loads),
                stations_assumed: held.is_way_assumed,
                decides: None,
                clamp_safety: None,
                certain_slip_safety: None,
                friction_needed: None,
                upward_n,
                lifts: Vec::new(),
                comes_off_n: None,
                dynamic_factor,
                contacts: Vec::new(),
                over_turn: ClampTurn::default(),
                remedy: remedy(study, held, &carried, &loads)?,
            };
            (nothing, free)
        }
    })
}

/// What each place of the cut asks for; loads go instant by instant over all places.
fn stations(held: &Held, loads: &[Load]) -> Vec<ClampStation> {
    let count = held.points_mm.len();
    let of = |(place, &[x_mm, y_mm, z_mm]): (usize, &Vector)| {
        let there: Vec<Load> = loads.iter().skip(place).step_by(count).copied().collect();
        let clamp_force_min_n = asked_n(held, &there).ok().map(|force_n| force_n.max(0.0));
        ClampStation { x_mm, y_mm, z_mm, clamp_force_min_n }
    };
    held.points_mm.iter().enumerate().map(of).collect()
}

fn number(index: usize) -> u32 {
    u32::try_from(index + 1).unwrap_or(u32::MAX)
}

fn told(
    held: &Held,
    sheet: &Sheet,
    instants: &[Instant],
    loads: &[Load],
    upward_n: f64,
    dynamic_factor: Option<f64>,
) -> MillingClamping {
    let stations = held.points_mm.len();
    let deciding = sheet.decides.filter(|_| sheet.clamp_force_min_n > 0.0);
    let decides = deciding.map(|of| ClampDeciding {
        contact: number(of.contact),
        station: number(of.load % stations),
        rotation_deg: instants[of.load / stations].rotation_rad.to_degrees(),
        criterion: match of.criterion {
            Criterion::Slip => ClampCriterion::Slip,
            Criterion::Opening => ClampCriterion::Opening,
        },
    });
    let pressed = || sheet.contacts.iter().zip(&held.rest.shares).filter(|(_, share)| **share > 0.0);
    let opens = pressed().any(|(used, _)| used.least_normal_n <= 0.0);
    let status = match held.clamp_force_n {
        None => ClampingStatus::NoForceGiven,
        Some(force) if is_enough(force, sheet.clamp_force_min_n) => ClampingStatus::Holds,
        Some(force) if sheet.certain_slip_below_n.is_some_and(|certain| force < certain) => ClampingStatus::Slips,
        Some(_) if opens => ClampingStatus::Opens,
        Some(_) => ClampingStatus::Creeps,
    };
    let asked = |instant: &[Load]| asked_n(held, instant).unwrap_or(0.0).max(0.0);
    let contacts = held.fixture.contacts.iter().zip(&sheet.contacts).zip(&held.rest.shares);
    MillingClamping {
        status,
        clamp_force_min_n: Some(sheet.clamp_force_min_n),
        at_likely_friction_n: Some(sheet.at_likely_friction_n),
        at_high_friction_n: Some(sheet.at_high_friction_n),
        against_mean_n: Some(sheet.against_mean_n),
        certain_slip_below_n: sheet.certain_slip_below_n,
        certain_slip_by_mean_n: sheet.certain_slip_by_mean_n,
        stations: self::stations(held, loads),
        stations_assumed: held.is_way_assumed,
        decides,
        clamp_safety: sheet.at_hand.map(|at_hand| at_hand.no_slip_factor),
        certain_slip_safety: sheet.at_hand.and_then(|at_hand| at_hand.certain_slip_factor),
        friction_needed: sheet.at_hand.and_then(|at_hand| at_hand.friction_needed),
        upward_n,
        lifts: sheet.lifts.iter().map(|of| ClampLift { contact: number(of.contact), off_n: of.off_n }).collect(),
        comes_off_n: sheet.comes_off.map(|of| of.off_n),
        dynamic_factor,
        contacts: contacts
            .map(|((contact, used), share)| ContactUse {
                x_mm: contact.position_mm[0],
                y_mm: contact.position_mm[1],
                z_mm: contact.position_mm[2],
                rest_n: used.rest_n,
                least_normal_n: used.least_normal_n,
                tangential_n: used.tangential_n,
                // One that no clamp force presses on carries no friction.
                friction_used_percent: used.friction_used_percent.filter(|_| *share > 0.0),
            })
            .collect(),
        over_turn: ClampTurn {
            rotation_deg: instants.iter().map(|instant| instant.rotation_rad.to_degrees()).collect(),
            clamp_force_n: loads.chunks(stations).map(asked).collect(),
        },
        remedy: None,
    }
}

/// The best of what may be added that makes a clamp force hold: a stop, else a second pair of clamp and locator. Tried at the middle
/// of the contacts and as far out as they are, and solved again as it is told.
fn remedy(
    study: &Study<'_>,
    held: &Held,
    carried: &Carried<'_>,
    loads: &[Load],
) -> Result<Option<ClampRemedy>, Failure> {
    let contacts = &held.fixture.contacts;
    let count = contacts.len() as f64;
    let middle: Vector = std::array::from_fn(|q| contacts.iter().map(|one| one.position_mm[q]).sum::<f64>() / count);
    let far = |one: &Contact| (0..3).map(|q| (one.position_mm[q] - middle[q]).powi(2)).sum::<f64>().sqrt();
    let out_mm = contacts.iter().map(far).fold(0.0, f64::max).max(1.0);
    for kind in [ClampRemedyKind::Stop, ClampRemedyKind::SecondPair] {
        let mut best: Option<(f64, Held)> = None;
        for added in additions(kind, &middle, out_mm) {
            checkpoint(study.monitor)?;
            let Some(more) = held.with(&added) else { continue };
            let Ok(force_n) = asked_n(&more, loads) else { continue };
            if best.as_ref().is_none_or(|(least, _)| force_n < *least) {
                best = Some((force_n, more));
            }
        }
        let Some((_, more)) = best else { continue };
        let asked = asked_n(&more, &study.loads(&more, carried)?.all);
        let added = &more.fixture.contacts[contacts.len()];
        let ([x_mm, y_mm, z_mm], [normal_x, normal_y, normal_z]) = (added.position_mm, added.normal);
        let apart_mm = (kind == ClampRemedyKind::SecondPair).then_some(2.0 * out_mm);
        let told = |force_n: f64| ClampRemedy {
            kind,
            x_mm,
            y_mm,
            z_mm,
            normal_x,
            normal_y,
            normal_z,
            apart_mm,
            clamp_force_min_n: force_n.max(0.0),
        };
        return Ok(asked.ok().map(told));
    }
    Ok(None)
}

/// Contacts that may be added: along each axis, beside the middle along the two axes across.
fn additions(kind: ClampRemedyKind, middle: &Vector, out_mm: f64) -> Vec<Vec<Contact>> {
    let moved = |from: &Vector, axis: usize, by: f64| -> Vector {
        std::array::from_fn(|q| from[q] + if q == axis { by } else { 0.0 })
    };
    let contact = |position_mm: Vector, normal: Vector, clamp_share: f64| Contact {
        position_mm,
        normal,
        friction: 0.0,
        normal_stiffness_n_per_mm: ADDED_N_PER_MM[0],
        tangential_stiffness_n_per_mm: ADDED_N_PER_MM[1],
        clamp_share,
        constant_force: false,
    };
    let mut found = Vec::new();
    for (axis, side) in (0..3).flat_map(|axis| [(axis, -1.0), (axis, 1.0)]) {
        let (first, second) = ((axis + 1) % 3, (axis + 2) % 3);
        for (other, by) in [(first, 0.0), (first, -out_mm), (first, out_mm), (second, -out_mm), (second, out_mm)] {
            let place = moved(middle, other, by);
            let (at, normal) = (moved(&place, axis, side * out_mm), moved(&[0.0; 3], axis, -side));
            found.push(match kind {
                ClampRemedyKind::Stop => vec![contact(at, normal, 0.0)],
                ClampRemedyKind::SecondPair => {
                    let opposite = contact(moved(&place, axis, -side * out_mm), normal.map(|x| -x), 0.0);
                    vec![contact(at, normal, 1.0), opposite]
                }
            });
        }
    }
    found
}
