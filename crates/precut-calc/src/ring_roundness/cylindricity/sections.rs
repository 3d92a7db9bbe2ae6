//! The sections of a job, whatever form they came in.

use crate::calculator::Measured;
use crate::num::cylinder::Point;
use crate::num::roundness::RoundnessError;
use crate::ring_roundness::evaluation::instrument::{
    self, FileSection, Rows, SECTION_GAP_MM, Understood, Unknown, groups,
};
use crate::ring_roundness::evaluation::readings::{Readings, columns};
use crate::ring_roundness::evaluation::{
    Job as SectionJob, ReferenceCircle, RoundnessDeviationRow, RoundnessFilter, RoundnessPointRow, RoundnessRadiusRow,
    RoundnessRepair, SpikeTreatment,
};

use super::input::Job;

/// A table of the job.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Table {
    Points,
    Radii,
    Deviations,
    File,
}

impl Table {
    /// Which tables a job has.
    pub(super) fn of(job: &Job) -> Vec<Self> {
        let given = [
            job.points.as_ref().map(|_| Self::Points),
            job.radii.as_ref().map(|_| Self::Radii),
            job.deviations.as_ref().map(|_| Self::Deviations),
            job.file.as_ref().map(|_| Self::File),
        ];
        given.into_iter().flatten().collect()
    }

    /// Name of the field.
    pub(super) const fn name(self) -> &'static str {
        match self {
            Self::Points => "points",
            Self::Radii => "radii",
            Self::Deviations => "deviations",
            Self::File => "file",
        }
    }
}

/// Why a job has no sections.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum NoSections {
    File(Unknown),
    /// The file does not tell heights; so many were given for so many sections.
    Heights {
        given: usize,
        sections: usize,
    },
}

/// Number of rows of a job's tables; of a file its lines, which are at least as many.
pub(super) fn count(job: &Job) -> usize {
    let rows = job.points.as_ref().map_or(0, |table| table.rows().len())
        + job.radii.as_ref().map_or(0, |table| table.rows().len())
        + job.deviations.as_ref().map_or(0, |table| table.rows().len());
    rows + job.file.as_ref().map_or(0, |file| file.text.lines().count())
}

/// The file of a job as it is understood.
pub(super) fn file(job: &Job) -> Option<Result<Understood, Unknown>> {
    let file = job.file.as_ref()?;
    Some(instrument::read(&file.text, &columns(&file.columns), job.nominal_radius_mm))
}

/// The sections from the lowest, each with a height for every row.
pub(super) fn sections(job: &Job) -> Result<Vec<FileSection>, NoSections> {
    let mut sections = match file(job) {
        Some(Err(unknown)) => return Err(NoSections::File(unknown)),
        Some(Ok(read)) => told_heights(job, read)?,
        None => of_tables(job),
    };
    let middle = |section: &FileSection| section.heights_mm.iter().sum::<f64>() / section.heights_mm.len() as f64;
    sections.sort_by(|a, b| middle(a).total_cmp(&middle(b)));
    Ok(sections)
}

/// The sections of a file with heights that the job gives where the file does not.
fn told_heights(job: &Job, read: Understood) -> Result<Vec<FileSection>, NoSections> {
    let given = job.file.as_ref().map_or(&[][..], |file| &file.section_heights_mm);
    let sections = read.sections.len();
    if given.is_empty() && read.sections.iter().all(|section| !section.heights_mm.is_empty()) {
        return Ok(read.sections);
    }
    if given.len() != sections {
        return Err(NoSections::Heights { given: given.len(), sections });
    }
    let with = |(section, height): (FileSection, &super::input::SectionHeight)| FileSection {
        heights_mm: vec![height.0; section.rows.len()],
        ..section
    };
    Ok(read.sections.into_iter().zip(given).map(with).collect())
}

fn of_tables(job: &Job) -> Vec<FileSection> {
    fn grouped<R>(
        rows: &[R],
        z: fn(&R) -> f64,
        pair: fn(&R) -> (f64, f64),
        kind: fn(Vec<(f64, f64)>) -> Rows,
    ) -> Vec<FileSection> {
        let heights: Vec<f64> = rows.iter().map(z).collect();
        let section = |group: Vec<usize>| FileSection {
            rows: kind(group.iter().map(|&row| pair(&rows[row])).collect()),
            heights_mm: group.iter().map(|&row| heights[row]).collect(),
        };
        groups(&heights, SECTION_GAP_MM).into_iter().map(section).collect()
    }
    if let Some(table) = &job.points {
        return grouped(table.rows(), |row| row.z_mm, |row| (row.x_mm, row.y_mm), Rows::Points);
    }
    if let Some(table) = &job.radii {
        return grouped(table.rows(), |row| row.z_mm, |row| (row.angle_deg, row.radius_mm), Rows::Radii);
    }
    let rows = job.deviations.as_ref().map_or(&[][..], |table| table.rows());
    grouped(rows, |row| row.z_mm, |row| (row.angle_deg, row.radial_deviation_um), Rows::Deviations)
}

/// What deviations are deviations from: of the job, else of the file's header.
fn nominal_mm(job: &Job) -> Option<f64> {
    job.nominal_radius_mm.or_else(|| file(job)?.ok()?.nominal_mm)
}

/// A job without a table that evaluates sections as this job asks.
pub(super) fn section_job(job: &Job, nominal_radius_mm: Option<f64>) -> SectionJob {
    SectionJob {
        radii: None,
        deviations: None,
        points: None,
        file: None,
        nominal_radius_mm,
        filter: job.filter,
        spikes: SpikeTreatment::Keep,
        reference: job.reference,
        profile_points: None,
        highest_harmonic: 50,
        tolerance_um: None,
    }
}

/// A section as a job of its own, in the form that it came in; the angles and radii as they are.
pub(super) fn as_job(job: &Job, section: &FileSection) -> SectionJob {
    let nominal = nominal_mm(job);
    let plain = SectionJob {
        filter: RoundnessFilter::None {},
        reference: ReferenceCircle::LeastSquares,
        ..section_job(job, nominal)
    };
    match &section.rows {
        Rows::Points(rows) => {
            let row = |&(x_mm, y_mm): &(f64, f64)| RoundnessPointRow { x_mm, y_mm };
            SectionJob { points: Some(Measured(rows.iter().map(row).collect())), ..plain }
        }
        Rows::Radii(rows) => {
            let row = |&(angle_deg, radius_mm): &(f64, f64)| RoundnessRadiusRow { angle_deg, radius_mm };
            SectionJob { radii: Some(Measured(rows.iter().map(row).collect())), ..plain }
        }
        Rows::Deviations(rows) => {
            let row = |&(angle_deg, radial_deviation_um): &(f64, f64)| RoundnessDeviationRow {
                angle_deg,
                radial_deviation_um,
            };
            SectionJob { deviations: Some(Measured(rows.iter().map(row).collect())), ..plain }
        }
    }
}

/// Points of a section in space, in order round it, and what was put right in reading them.
pub(super) fn points(job: &Job, section: &FileSection) -> Result<(Vec<Point>, Vec<RoundnessRepair>), RoundnessError> {
    let readings = Readings::of(&as_job(job, section), &|| true)?;
    let point = |(index, &row): (usize, &usize)| {
        let [x, y] = readings.section.point_mm(index);
        [x, y, section.heights_mm[row]]
    };
    Ok((readings.rows.iter().enumerate().map(point).collect(), readings.repairs))
}
