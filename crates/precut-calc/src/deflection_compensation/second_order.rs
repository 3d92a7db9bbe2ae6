//! Effects of second order, estimated always, also where they are switched off (`deflection/4.5`).

use std::f64::consts::PI;

use crate::calculator::{Failure, Finding};
use crate::num::beam::{Profile, Wanted};

use super::acting::Acting;
use super::grid::Grid;
use super::input::{Job, Section, Segment, Support, Theory};
use super::model::gravity_components;
use super::output::SecondOrder;
use super::stage::Stage;
use super::structure::Structure;

const UM_PER_MM: f64 = 1e3;
/// Stations at which the estimates are made: extrema of smooth functions, to a percent.
const SAMPLES: usize = 33;
/// Share of the form tolerance above which an effect that was left out is warned of.
const NOTICEABLE_SHARE: f64 = 0.1;

/// Codes of the warnings about effects that were left out.
pub(super) const WARNING_CODES: &[&str] = &["effect_left_out"];

/// Largest change of the diameter by every effect of second order.
pub(super) fn second_order(job: &Job, grid: &Grid, acting: &Acting, stage: &Stage) -> Result<SecondOrder, Failure> {
    let sample = Sample::of(grid, stage);
    let wanted = Wanted { tangential: true, couple: true, weight: true };
    let profile = stage.structure.beam.profile(&sample.z_mm, wanted);
    let variant = stage.variant(job, acting);
    let change_by = |section: Section, theory: Theory| -> Result<f64, Failure> {
        let mut other = variant;
        other.section = section;
        other.theory = theory;
        let structure = Structure::of(job, &other)?;
        let none = Wanted { tangential: false, couple: false, weight: false };
        let changed = structure.beam.profile(&sample.z_mm, none).radial_mm_per_n;
        let against = stage.structure.beam.profile(&sample.z_mm, none).radial_mm_per_n;
        Ok(sample.largest(|k| (changed[k] - against[k]) * sample.passive_n[k]))
    };
    let other_theory = match job.shaft.theory {
        Theory::EulerBernoulli => Theory::Timoshenko,
        Theory::Timoshenko => Theory::EulerBernoulli,
    };
    let section = variant.section;
    let other_section = if section == Section::Mixed { Section::Finished } else { Section::Mixed };
    Ok(SecondOrder {
        tangential_um: job.force.has_main().then(|| tangential_um(stage, &sample, &profile)),
        axial_moment_um: job
            .force
            .has_feed()
            .then(|| sample.largest(|k| sample.target_mm[k] * sample.feed_n[k] * profile.couple_per_n[k])),
        weight_um: Some(weight_um(job, &sample, &profile)),
        partly_turned_um: Some(change_by(other_section, job.shaft.theory)?),
        shear_um: Some(change_by(section, other_theory)?),
        thrust_ratio: job.force.has_feed().then(|| thrust_ratio(job, &sample)),
    })
}

/// Stations, forces and radii at which the estimates are made.
struct Sample {
    z_mm: Vec<f64>,
    target_mm: Vec<f64>,
    passive_n: Vec<f64>,
    main_n: Vec<f64>,
    feed_n: Vec<f64>,
}

impl Sample {
    fn of(grid: &Grid, stage: &Stage) -> Self {
        let mut sample = Self {
            z_mm: Vec::new(),
            target_mm: Vec::new(),
            passive_n: Vec::new(),
            main_n: Vec::new(),
            feed_n: Vec::new(),
        };
        for i in grid.sample(SAMPLES) {
            let loads = &stage.cut.loads[i];
            sample.z_mm.push(grid.z_mm[i]);
            sample.target_mm.push(stage.radii.target[i]);
            sample.passive_n.push(loads.passive_n);
            sample.main_n.push(loads.main_n);
            sample.feed_n.push(loads.feed_n);
        }
        sample
    }

    /// Largest change of the diameter, um, of a change of the radius in mm.
    fn largest(&self, radius_mm: impl Fn(usize) -> f64) -> f64 {
        (0..self.z_mm.len()).map(|k| (2.0 * radius_mm(k)).abs() * UM_PER_MM).fold(0.0, f64::max)
    }
}

/// e_d grows by z²/r_t.
fn tangential_um(stage: &Stage, sample: &Sample, profile: &Profile) -> f64 {
    let carriage = stage.structure.carriage_tangential_mm_per_n;
    sample.largest(|k| {
        let z = (profile.tangential_mm_per_n[k] + carriage) * sample.main_n[k];
        z * z / (2.0 * sample.target_mm[k])
    })
}

fn weight_um(job: &Job, sample: &Sample, profile: &Profile) -> f64 {
    let (across, along) = gravity_components(job);
    sample.largest(|k| {
        let z = across * profile.sag_tangential_mm[k];
        along * profile.sag_radial_mm[k] + z * z / (2.0 * sample.target_mm[k])
    })
}

/// N/N_cr with N_cr = pi² E J/l² between supports, a quarter of it for a chuck alone, J of the thinnest segment.
fn thrust_ratio(job: &Job, sample: &Sample) -> f64 {
    let thinnest =
        |segment: &Segment| crate::num::beam::second_moment_mm4(segment.diameter_mm, segment.bore_diameter_mm);
    let j = job.shaft.segments.iter().map(thinnest).fold(f64::INFINITY, f64::min);
    let length: f64 = job.shaft.segments.iter().map(|s| s.length_mm).sum();
    let carrying = job.supports.iter().filter(|s| s.carries()).count();
    let cantilever = carrying < 2 && job.supports.iter().any(|s| matches!(s, Support::Chuck { .. }));
    let fixity = if cantilever { 0.25 } else { 1.0 };
    let critical = fixity * PI * PI * job.shaft.modulus() * j / (length * length);
    sample.feed_n.iter().copied().fold(0.0, f64::max) / critical
}

/// Warnings about effects that are switched off although they would take a noticeable share of the tolerance.
pub(super) fn left_out(job: &Job, sizes: &SecondOrder) -> Vec<Finding> {
    let Some(form_um) = job.tolerance.form_um else { return Vec::new() };
    let limit = NOTICEABLE_SHARE * form_um;
    let section_mixed = job.shaft.section == Section::Mixed;
    [
        ("tangential", "/include/tangential", sizes.tangential_um, job.include.tangential),
        ("axial_moment", "/include/axial_moment", sizes.axial_moment_um, job.include.axial_moment),
        ("weight", "/include/weight", sizes.weight_um, job.include.weight),
        ("partly_turned", "/shaft/section", sizes.partly_turned_um, section_mixed),
        ("shear", "/shaft/theory", sizes.shear_um, job.shaft.theory == Theory::Timoshenko),
    ]
    .into_iter()
    .filter_map(|(name, pointer, size, on)| {
        let size = size.filter(|size| !on && *size > limit)?;
        Some(Finding::new("effect_left_out", pointer).measured(size, limit, "um").with("effect", name))
    })
    .collect()
}
