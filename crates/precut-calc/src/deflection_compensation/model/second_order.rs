//! Effects of second order, estimated always, also where they are switched off (`deflection/4.5`).

use std::f64::consts::PI;

use crate::calculator::{Failure, Finding};
use crate::num::beam::{Displaced, Profile, ToolLoad, Wanted};

use crate::deflection_compensation::answer::output::SecondOrder;
use crate::deflection_compensation::job::acting::Acting;
use crate::deflection_compensation::job::grid::Grid;
use crate::deflection_compensation::job::input::{Include, Job, Section, Segment, Support, Theory};
use crate::deflection_compensation::job::structure::Structure;
use crate::deflection_compensation::model::laws::Loads;
use crate::deflection_compensation::model::stage::Stage;
use crate::deflection_compensation::model::yielding::{at, couple_sign, gravity_components, wanted};

const UM_PER_MM: f64 = 1e3;
/// Stations at which the estimates are made: extrema of smooth functions, to a percent.
const SAMPLES: usize = 33;
/// The same with one-sided rests: where one opens the shaft gives way many times as far within a few millimetres.
const SAMPLES_WITH_CONTACTS: usize = 257;
/// Share of the form tolerance above which an effect that was left out is warned of.
const NOTICEABLE_SHARE: f64 = 0.1;

/// Codes of the warnings about effects that were left out.
pub(in crate::deflection_compensation) const WARNING_CODES: &[&str] = &["effect_left_out"];

/// Largest change of the diameter by every effect of second order.
pub(in crate::deflection_compensation) fn second_order(
    job: &Job,
    grid: &Grid,
    acting: &Acting,
    stage: &Stage,
) -> Result<SecondOrder, Failure> {
    let all = Wanted { tangential: true, couple: true, weight: true };
    let estimates = Estimates::of(job, grid, acting, stage, all)?;
    let (main, feed) = (job.force.has_main(), job.force.has_feed());
    Ok(SecondOrder {
        tangential_um: main.then(|| estimates.tangential_um()),
        axial_moment_um: feed.then(|| estimates.axial_moment_um()),
        weight_um: Some(estimates.with_include_um(|include| include.weight = !include.weight)),
        partly_turned_um: Some(estimates.partly_turned_um()?),
        shear_um: Some(estimates.shear_um()?),
        thrust_ratio: (feed || job.tailstock_thrust_n.is_some()).then(|| thrust_ratio(job, &estimates.sample)),
    })
}

/// Makes the estimates: the state under the same loads with an effect and without it, one-sided rests as they stand in
/// each.
pub(in crate::deflection_compensation) struct Estimates<'a> {
    job: &'a Job,
    acting: &'a Acting,
    stage: &'a Stage,
    sample: Sample,
    /// The shaft as the stage has it.
    state: State,
}

impl<'a> Estimates<'a> {
    /// About a cut; `wanted` is what the effects of loads need that are asked for, beside what the job has.
    pub(in crate::deflection_compensation) fn of(
        job: &'a Job,
        grid: &Grid,
        acting: &'a Acting,
        stage: &'a Stage,
        wanted: Wanted,
    ) -> Result<Self, Failure> {
        let (chosen, sample) = Sample::of(grid, stage);
        let is_known = wanted == Wanted::default() && !stage.line.has_contacts();
        let profile = if is_known {
            let radial_mm_per_n = chosen.iter().map(|&i| stage.line.work_mm_per_n[i]).collect();
            Profile { radial_mm_per_n, ..Profile::default() }
        } else {
            stage.structure.beam.profile(&sample.z_mm, wanted)
        };
        let state = State::of(job, acting, stage, &stage.structure, &sample, profile)?;
        Ok(Self { job, acting, stage, sample, state })
    }

    pub(in crate::deflection_compensation) fn tangential_um(&self) -> f64 {
        self.with_include_um(|include| include.tangential = Some(!include.tangential()))
    }

    pub(in crate::deflection_compensation) fn axial_moment_um(&self) -> f64 {
        self.with_include_um(|include| include.axial_moment = Some(!include.axial_moment()))
    }

    pub(in crate::deflection_compensation) fn partly_turned_um(&self) -> Result<f64, Failure> {
        let section = self.stage.variant(self.job, self.acting).section;
        let other = if section == Section::Mixed { Section::Finished } else { Section::Mixed };
        self.with_structure_um(other, self.job.shaft.theory())
    }

    /// No less than [`Self::partly_turned_um`], without a structure: the compliance of a finished shaft shrinks at most
    /// like the flexibility of its stiffest blank. `None` where more than the passive force acts.
    pub(in crate::deflection_compensation) fn partly_turned_at_most_um(&self) -> Option<f64> {
        let Self { job, stage, sample, state, .. } = self;
        if !stage.line.only_radial() || job.include.weight || !self.acting.set_off.is_empty() {
            return None;
        }
        let share = stage.structure.beam.stock_changes_at_most();
        Some(sample.largest(|place| share * state.profile.radial_mm_per_n[place.k] * place.loads.passive_n))
    }

    pub(in crate::deflection_compensation) fn shear_um(&self) -> Result<f64, Failure> {
        let other = match self.job.shaft.theory() {
            Theory::EulerBernoulli => Theory::Timoshenko,
            Theory::Timoshenko => Theory::EulerBernoulli,
        };
        self.with_structure_um(self.stage.variant(self.job, self.acting).section, other)
    }

    /// By another set of loads.
    fn with_include_um(&self, change: fn(&mut Include)) -> f64 {
        let include = &self.job.include;
        let mut other = include.clone();
        change(&mut other);
        self.sample.largest(|place| self.state.moved_mm(place, &other) - self.state.moved_mm(place, include))
    }

    /// By another structure.
    fn with_structure_um(&self, section: Section, theory: Theory) -> Result<f64, Failure> {
        let Self { job, acting, stage, sample, state } = self;
        let mut other = stage.variant(job, acting);
        other.section = section;
        other.theory = theory;
        let structure = Structure::of(job, &other)?;
        let profile = structure.beam.profile(&sample.z_mm, wanted(job));
        let changed = State::of(job, acting, stage, &structure, sample, profile)?;
        let include = &job.include;
        Ok(sample.largest(|place| changed.moved_mm(place, include) - state.moved_mm(place, include)))
    }
}

/// A held shaft at the stations of a sample.
struct State {
    profile: Profile,
    /// What supports do that are set off.
    displaced: Displaced,
    /// Direction of the feed force's couple.
    sign: f64,
    carriage_tangential_mm_per_n: f64,
    /// Gravity across and along the radial direction, relative.
    gravity: (f64, f64),
}

impl State {
    fn of(
        job: &Job,
        acting: &Acting,
        stage: &Stage,
        structure: &Structure,
        sample: &Sample,
        mut profile: Profile,
    ) -> Result<Self, Failure> {
        let displaced = structure.displaced(job, &acting.set_off, &sample.z_mm)?.unwrap_or_default();
        if let Some(contacts) = &mut profile.contacts {
            contacts.displace(displaced.rests_mm.clone());
        }
        Ok(Self {
            profile,
            displaced,
            sign: couple_sign(stage.regime.direction),
            carriage_tangential_mm_per_n: structure.carriage_tangential_mm_per_n,
            gravity: gravity_components(job),
        })
    }

    /// How far the work moves away on the radius, mm: Y + Z²/(2 r_t), less what the carriage yields. The rests that
    /// touch are found for this load.
    fn moved_mm(&self, place: &Place, include: &Include) -> f64 {
        let Place { k, target_mm, loads } = *place;
        let profile = &self.profile;
        let (across, along) = if include.weight { self.gravity } else { (0.0, 0.0) };
        let load = ToolLoad {
            force_n: loads.passive_n,
            couple_n_mm: if include.axial_moment() { self.sign * target_mm * loads.feed_n } else { 0.0 },
            gravity_radial: along,
        };
        let y = match &profile.contacts {
            Some(contacts) => contacts.respond(k, load).displacement_mm,
            None => {
                profile.radial_mm_per_n[k] * load.force_n
                    + at(&profile.couple_per_n, k) * load.couple_n_mm
                    + at(&profile.sag_radial_mm, k) * load.gravity_radial
            }
        };
        let main_n = if include.tangential() { loads.main_n } else { 0.0 };
        let z = (at(&profile.tangential_mm_per_n, k) + self.carriage_tangential_mm_per_n) * main_n
            + at(&profile.sag_tangential_mm, k) * across;
        y + at(&self.displaced.work_mm, k) + z * z / (2.0 * target_mm)
    }
}

/// A station of a sample under some loads.
#[derive(Debug, Clone, Copy)]
struct Place {
    /// Index in the sample.
    k: usize,
    target_mm: f64,
    loads: Loads,
}

/// Stations, radii and loads at which the estimates are made.
struct Sample {
    z_mm: Vec<f64>,
    /// Every station under the loads of the nominal depth. Where rests open and close they do so elsewhere at the depth
    /// really cut along the nominal line: then its loads, too.
    places: Vec<Place>,
}

impl Sample {
    /// With the indices of its stations.
    fn of(grid: &Grid, stage: &Stage) -> (Vec<usize>, Self) {
        let contacts = stage.line.has_contacts();
        let chosen = grid.sample(if contacts { SAMPLES_WITH_CONTACTS } else { SAMPLES });
        let mut places = Vec::new();
        for (k, &i) in chosen.iter().enumerate() {
            let target_mm = stage.radii.target[i];
            places.push(Place { k, target_mm, loads: stage.cut.loads.of(i) });
            if let Some(cut_mm) = stage.cut.uncompensated_depth_mm[i].filter(|_| contacts) {
                places.push(Place { k, target_mm, loads: stage.line.nominal_loads(i, cut_mm) });
            }
        }
        let z_mm = chosen.iter().map(|&i| grid.z_mm[i]).collect();
        (chosen, Self { z_mm, places })
    }

    /// Largest change of the diameter, um, of a change of the radius in mm.
    fn largest(&self, radius_mm: impl Fn(&Place) -> f64) -> f64 {
        self.places.iter().map(|place| (2.0 * radius_mm(place)).abs() * UM_PER_MM).fold(0.0, f64::max)
    }
}

/// N/N_cr, N the feed force and the thrust of the tailstock together, with N_cr = pi² E J/l² between supports, a quarter of it for a chuck alone, J of the thinnest segment.
fn thrust_ratio(job: &Job, sample: &Sample) -> f64 {
    let thinnest =
        |segment: &Segment| crate::num::beam::second_moment_mm4(segment.diameter_mm, segment.bore_diameter_mm);
    let j = job.shaft.segments.iter().map(thinnest).fold(f64::INFINITY, f64::min);
    let length: f64 = job.shaft.segments.iter().map(|s| s.length_mm).sum();
    let carrying = job.supports.iter().filter(|s| s.carries()).count();
    let cantilever = carrying < 2 && job.supports.iter().any(|s| matches!(s, Support::Chuck { .. }));
    let fixity = if cantilever { 0.25 } else { 1.0 };
    let critical = fixity * PI * PI * job.shaft.modulus() * j / (length * length);
    let feed_n = sample.places.iter().map(|place| place.loads.feed_n).fold(0.0, f64::max);
    (feed_n + job.tailstock_thrust_n.unwrap_or(0.0)) / critical
}

/// Warnings about effects that are switched off although they would take a noticeable share of the tolerance.
pub(in crate::deflection_compensation) fn left_out(
    job: &Job,
    acting: &Acting,
    stage: &Stage,
    sizes: &SecondOrder,
) -> Vec<Finding> {
    let Some(form_um) = job.tolerance.form_um else { return Vec::new() };
    let limit = NOTICEABLE_SHARE * form_um;
    // What bends is not always what the job says: an effect may change it, and passes have their own section.
    let mixed = stage.variant(job, acting).section == Section::Mixed;
    let (partly_turned, section) = if job.passes.is_empty() {
        ("partly_turned", "/shaft/section")
    } else {
        ("partly_turned_in_passes", "/passes")
    };
    [
        ("tangential", "/include/tangential", sizes.tangential_um, job.include.tangential()),
        ("axial_moment", "/include/axial_moment", sizes.axial_moment_um, job.include.axial_moment()),
        ("weight", "/include/weight", sizes.weight_um, job.include.weight),
        (partly_turned, section, sizes.partly_turned_um, mixed),
        ("shear", "/shaft/theory", sizes.shear_um, job.shaft.theory() == Theory::Timoshenko),
    ]
    .into_iter()
    .filter_map(|(name, pointer, size, on)| {
        let size = size.filter(|size| !on && *size > limit)?;
        Some(Finding::new("effect_left_out", pointer).measured(size, limit, "um").with("effect", name))
    })
    .collect()
}
