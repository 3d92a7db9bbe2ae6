//! From the job's shaft and supports to the elastic structure.

use crate::calculator::Failure;
use crate::num::beam::{self, Beam, Displaced, Offset};
use crate::shaft::elastic::{self, clamping, ends};

use crate::deflection_compensation::job::acting::{SetOff, StructureChange};
use crate::deflection_compensation::job::check::steady_at;
use crate::deflection_compensation::job::input::{FeedDirection, Job, Section, Segment, Theory};

const MM_PER_UM: f64 = 1e-3;

/// The held shaft and what else yields.
pub(in crate::deflection_compensation) struct Structure {
    pub beam: Beam,
    /// Compliance of carriage and tool, radial, mm/N.
    pub carriage_mm_per_n: f64,
    /// The same across the radial direction.
    pub carriage_tangential_mm_per_n: f64,
}

/// How a structure is to differ from the job as it stands.
#[derive(Debug, Clone, Copy)]
pub(in crate::deflection_compensation) struct Variant<'a> {
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
    pub(in crate::deflection_compensation) fn of(job: &Job, change: &'a StructureChange) -> Self {
        let section = if change.uncut_side { Section::Mixed } else { job.shaft.section() };
        Self {
            change,
            section,
            theory: job.shaft.theory(),
            direction: job.cut.feed_direction,
            pass_diameter_mm: None,
            touching: &[],
        }
    }
}

/// Diameter that a pass leaves in a segment.
pub(in crate::deflection_compensation) fn pass_diameter_mm(segment: &Segment, pass_diameter_mm: Option<f64>) -> f64 {
    pass_diameter_mm.map_or(segment.diameter_mm, |d| d.max(segment.diameter_mm))
}

impl Structure {
    /// Builds the structure of a checked and filled job.
    pub(in crate::deflection_compensation) fn of(job: &Job, variant: &Variant<'_>) -> Result<Self, Failure> {
        let segments: Vec<beam::Segment> =
            job.shaft.segments.iter().map(|segment| beam_segment(job, segment, variant)).collect();
        let (head, tail) = ends(&job.supports);
        let clamped = clamping(&job.supports);
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
                let rotation = change.headstock_rotation_rad_per_n_mm.filter(|_| Some(i) == clamped);
                elastic::support(support, added, rotation)
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

impl Structure {
    /// What supports that are set off do along the shaft, with the tool at every station (`diagnosis/4.5`,
    /// `diagnosis/4.20`); `None` where all stand on the axis.
    pub(in crate::deflection_compensation) fn displaced(
        &self,
        job: &Job,
        set_off: &[SetOff],
        z_mm: &[f64],
    ) -> Result<Option<Displaced>, Failure> {
        if set_off.is_empty() {
            return Ok(None);
        }
        let offsets = set_off.iter().map(|set_off| self.offset(job, *set_off)).collect::<Result<Vec<Offset>, _>>()?;
        Ok(Some(self.beam.displaced(z_mm, &offsets)))
    }

    fn offset(&self, job: &Job, set_off: SetOff) -> Result<Offset, Failure> {
        let missing = |what: &str| Failure::Internal(format!("a checked job has no {what} to set off"));
        match set_off {
            SetOff::Tailstock { offset_mm } => {
                let support = ends(&job.supports).1.ok_or_else(|| missing("tailstock"))?;
                Ok(Offset { support, offset_mm })
            }
            SetOff::SteadyRest { station_mm, offset_mm } => {
                let support = steady_at(job, station_mm).ok_or_else(|| missing("steady rest"))?;
                let unstable = |error| Failure::Internal(format!("without the rest that is set off: {error}"));
                Ok(Offset {
                    support,
                    offset_mm: offset_mm * self.beam.offset_per_displacement(support).map_err(unstable)?,
                })
            }
        }
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

fn section(job: &Job, variant: &Variant<'_>, diameter_mm: f64, bore_mm: f64) -> beam::Section {
    let g = job.gravity.acceleration_m_per_s2;
    elastic::section(&job.shaft, variant.theory, variant.change.flexibility, diameter_mm, bore_mm, g)
}
