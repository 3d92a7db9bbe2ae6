//! From the job's shaft and supports to the elastic structure.

use crate::calculator::Failure;
use crate::num::beam::{self, Beam};

use super::acting::StructureChange;
use super::input::{FeedDirection, Job, Section, Segment, Support, Theory};

const MM_PER_UM: f64 = 1e-3;
/// kg/m³ m/s² = N/m³ = 1e-9 N/mm³.
const N_PER_MM3: f64 = 1e-9;

/// The held shaft and what else yields.
pub(super) struct Structure {
    pub beam: Beam,
    /// Compliance of carriage and tool, radial, mm/N.
    pub carriage_mm_per_n: f64,
    /// The same across the radial direction.
    pub carriage_tangential_mm_per_n: f64,
}

/// How a structure is to differ from the job as it stands.
#[derive(Debug, Clone, Copy)]
pub(super) struct Variant<'a> {
    pub change: &'a StructureChange,
    pub section: Section,
    pub theory: Theory,
    pub direction: FeedDirection,
    /// Diameter that a pass aims at; no segment is turned below its drawing diameter.
    pub pass_diameter_mm: Option<f64>,
    /// One-sided rests that touch, and so hold like any other; the others stay open.
    pub touching: &'a [usize],
}

impl<'a> Variant<'a> {
    /// The job as it stands, with the structural effects in it.
    pub(super) fn of(job: &Job, change: &'a StructureChange) -> Self {
        let section = if change.uncut_side { Section::Mixed } else { job.shaft.section };
        Self {
            change,
            section,
            theory: job.shaft.theory,
            direction: job.cut.feed_direction,
            pass_diameter_mm: None,
            touching: &[],
        }
    }
}

/// Diameter that a pass leaves in a segment.
pub(super) fn pass_diameter_mm(segment: &Segment, pass_diameter_mm: Option<f64>) -> f64 {
    pass_diameter_mm.map_or(segment.diameter_mm, |d| d.max(segment.diameter_mm))
}

/// Indices of the leftmost and rightmost support that carries; the latter only where it is another.
pub(super) fn ends(supports: &[Support]) -> (Option<usize>, Option<usize>) {
    let carrying =
        || supports.iter().enumerate().filter(|(_, s)| s.carries()).filter_map(|(i, s)| s.station_mm().map(|z| (i, z)));
    let left = carrying().min_by(|a, b| a.1.total_cmp(&b.1)).map(|(i, _)| i);
    let right = carrying().max_by(|a, b| a.1.total_cmp(&b.1)).map(|(i, _)| i);
    (left, right.filter(|right| Some(*right) != left))
}

impl Structure {
    /// Builds the structure of a checked and filled job.
    pub(super) fn of(job: &Job, variant: &Variant<'_>) -> Result<Self, Failure> {
        let segments: Vec<beam::Segment> =
            job.shaft.segments.iter().map(|segment| beam_segment(job, segment, variant)).collect();
        let (head, tail) = ends(&job.supports);
        let mut supports: Vec<beam::Support> = job
            .supports
            .iter()
            .enumerate()
            .map(|(i, support)| {
                let change = variant.change;
                let added = if Some(i) == head {
                    change.headstock_mm_per_n
                } else if Some(i) == tail {
                    change.tailstock_mm_per_n
                } else {
                    0.0
                };
                let rotation = change.headstock_rotation_rad_per_n_mm.filter(|_| Some(i) == head);
                beam_support(support, added, rotation)
            })
            .collect();
        for &i in variant.touching {
            if let beam::Support::SteadyRest { contact, .. } | beam::Support::FollowRest { contact, .. } =
                &mut supports[i]
            {
                *contact = beam::Contact::Bilateral;
            }
        }
        let state = match (variant.section, variant.direction) {
            (Section::Finished, _) => beam::State::Finished,
            (Section::Stock, _) => beam::State::Stock,
            (Section::Mixed, FeedDirection::ToHeadstock) => beam::State::Mixed { stock_side: beam::Side::Left },
            (Section::Mixed, FeedDirection::ToTailstock) => beam::State::Mixed { stock_side: beam::Side::Right },
        };
        let beam = Beam::new(&segments, &supports, state)
            .map_err(|error| Failure::Internal(format!("a checked job gave no beam: {error}")))?;
        Ok(Self {
            beam,
            carriage_mm_per_n: (job.carriage.compliance_um_per_n * MM_PER_UM + variant.change.carriage_mm_per_n)
                .max(0.0),
            carriage_tangential_mm_per_n: job.carriage.tangential_compliance_um_per_n * MM_PER_UM,
        })
    }
}

fn beam_segment(job: &Job, segment: &Segment, variant: &Variant<'_>) -> beam::Segment {
    let bore = segment.bore_diameter_mm;
    beam::Segment {
        length_mm: segment.length_mm,
        finished: section(job, variant, pass_diameter_mm(segment, variant.pass_diameter_mm), bore),
        stock: section(job, variant, segment.stock_mm(), bore),
    }
}

/// Flexibilities and weight of a section (`deflection/3.2`).
fn section(job: &Job, variant: &Variant<'_>, diameter_mm: f64, bore_mm: f64) -> beam::Section {
    let (e, nu, rho) = (job.shaft.modulus(), job.shaft.poisson(), job.shaft.density());
    let area = beam::area_mm2(diameter_mm, bore_mm);
    let flexibility = variant.change.flexibility;
    let shear = match variant.theory {
        Theory::EulerBernoulli => 0.0,
        Theory::Timoshenko => {
            let k = beam::cowper_shear_coefficient(nu, bore_mm / diameter_mm);
            2.0 * (1.0 + nu) / (e * k * area)
        }
    };
    beam::Section {
        bending_flexibility_per_n_mm2: flexibility / (e * beam::second_moment_mm4(diameter_mm, bore_mm)),
        shear_flexibility_per_n: flexibility * shear,
        weight_n_per_mm: rho * job.gravity.acceleration_m_per_s2 * area * N_PER_MM3,
    }
}

fn beam_support(support: &Support, added_mm_per_n: f64, rotation: Option<f64>) -> beam::Support {
    let springs = |radial: f64, tangential: Option<f64>| beam::Springs {
        radial_mm_per_n: (radial * MM_PER_UM + added_mm_per_n).max(0.0),
        tangential_mm_per_n: tangential.unwrap_or(radial) * MM_PER_UM,
    };
    let contact = |one_sided: bool, gap_um: f64| {
        if one_sided { beam::Contact::OneSided { gap_mm: gap_um * MM_PER_UM } } else { beam::Contact::Bilateral }
    };
    match *support {
        Support::Centre { z_mm, compliance_um_per_n: c, tangential_compliance_um_per_n: cz } => match rotation {
            None => beam::Support::Centre { z_mm, springs: springs(c, cz) },
            Some(rotational_rad_per_n_mm) => {
                beam::Support::Chuck { z_mm, springs: springs(c, cz), rotational_rad_per_n_mm }
            }
        },
        Support::Chuck {
            z_mm,
            compliance_um_per_n: c,
            tangential_compliance_um_per_n: cz,
            rotational_compliance_rad_per_n_mm,
        } => beam::Support::Chuck {
            z_mm,
            springs: springs(c, cz),
            rotational_rad_per_n_mm: rotation.unwrap_or(rotational_compliance_rad_per_n_mm),
        },
        Support::SteadyRest { z_mm, compliance_um_per_n: c, tangential_compliance_um_per_n: cz, one_sided, gap_um } => {
            beam::Support::SteadyRest { z_mm, springs: springs(c, cz), contact: contact(one_sided, gap_um) }
        }
        Support::FollowRest {
            offset_mm,
            compliance_um_per_n: c,
            tangential_compliance_um_per_n: cz,
            one_sided,
            gap_um,
        } => beam::Support::FollowRest { offset_mm, springs: springs(c, cz), contact: contact(one_sided, gap_um) },
    }
}
