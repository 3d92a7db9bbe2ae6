//! The points of a job, whatever form they came in.

use std::collections::HashSet;

use crate::num::roundness::{LeastSquares, RoundnessError, Section, least_squares};

use super::input::{FileColumn, Job, SpikeTreatment};
use super::instrument::{self, Column, Rows, Understood, Unknown};
use super::output::{RepairKind, RoundnessRepair, RoundnessSpike};
use super::spikes;

const UM_PER_MM: f64 = 1e3;
/// Widest gap between neighbouring points through which a curve is laid: half a wave of six lobes. Of few points, so many
/// times as wide as even ones would leave.
const WIDEST_GAP_DEG: f64 = 30.0;
const MORE_THAN_EVEN: f64 = 1.5;

/// A table of the job.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Table {
    Radii,
    Deviations,
    Points,
    File,
}

impl Table {
    /// Name of the field.
    pub(super) const fn name(self) -> &'static str {
        match self {
            Self::Radii => "radii",
            Self::Deviations => "deviations",
            Self::Points => "points",
            Self::File => "file",
        }
    }

    /// Which tables a job has.
    pub(super) fn of(job: &Job) -> Vec<Self> {
        let given = [
            job.radii.as_ref().map(|_| Self::Radii),
            job.deviations.as_ref().map(|_| Self::Deviations),
            job.points.as_ref().map(|_| Self::Points),
            job.file.as_ref().map(|_| Self::File),
        ];
        given.into_iter().flatten().collect()
    }
}

/// Number of points of a job.
pub(super) fn count(job: &Job) -> usize {
    let radii = job.radii.as_ref().map_or(0, |table| table.rows().len());
    let deviations = job.deviations.as_ref().map_or(0, |table| table.rows().len());
    let in_file = file_rows(job).map_or(0, |rows| rows.len());
    radii + deviations + job.points.as_ref().map_or(0, |table| table.rows().len()) + in_file
}

/// Angles nearer than this share of the mean step are one place.
const SAME_PLACE: f64 = 1e-6;

/// The points in counter-clockwise order, their least-squares circle, and where they stood.
pub(in crate::ring_roundness) struct Readings {
    pub(in crate::ring_roundness) section: Section,
    pub(super) circle: LeastSquares,
    /// Row of the job's table for each point.
    pub(in crate::ring_roundness) rows: Vec<usize>,
    /// Direction of each point from the least-squares centre, degrees, 0 to 360.
    pub(super) angles_deg: Vec<f64>,
    /// Widest angle between neighbours, degrees, and the point after it.
    pub(super) largest_gap: (f64, usize),
    /// What was put right in reading.
    pub(in crate::ring_roundness) repairs: Vec<RoundnessRepair>,
    /// Readings that stand off all around them; left out of the points where the job asks for that.
    pub(super) spikes: Vec<RoundnessSpike>,
}

/// The file of a job as it is understood.
pub(super) fn file(job: &Job) -> Option<Result<Understood, Unknown>> {
    let file = job.file.as_ref()?;
    Some(instrument::read(&file.text, &columns(&file.columns), job.nominal_radius_mm))
}

/// Columns as a job names them.
pub(in crate::ring_roundness) fn columns(named: &[FileColumn]) -> Vec<Column> {
    const DEG_PER_RAD: f64 = 180.0 / std::f64::consts::PI;
    let column = |column: &FileColumn| match column {
        FileColumn::AngleDeg => Column::Angle(1.0),
        FileColumn::AngleRad => Column::Angle(DEG_PER_RAD),
        FileColumn::RadiusMm => Column::Radius(1.0),
        FileColumn::DiameterMm => Column::Radius(0.5),
        FileColumn::DeviationUm => Column::Deviation(1.0),
        FileColumn::DeviationMm => Column::Deviation(UM_PER_MM),
        FileColumn::XMm => Column::X(1.0),
        FileColumn::YMm => Column::Y(1.0),
        FileColumn::ZMm => Column::Z(1.0),
        FileColumn::Ignored => Column::Other,
    };
    named.iter().map(column).collect()
}

/// The section of the file that is asked for.
fn file_rows(job: &Job) -> Option<Rows> {
    let section = (job.file.as_ref()?.section as usize).checked_sub(1)?;
    file(job)?.ok()?.sections.into_iter().nth(section).map(|section| section.rows)
}

/// Whether the readings are deviations.
pub(super) fn has_deviations(job: &Job) -> bool {
    job.deviations.is_some() || matches!(file_rows(job), Some(Rows::Deviations(_)))
}

/// What deviations are deviations from: of the job, else of the file's header.
pub(super) fn nominal_mm(job: &Job) -> Option<f64> {
    job.nominal_radius_mm.or_else(|| file(job)?.ok()?.nominal_mm)
}

/// A row that came at an angle.
#[derive(Clone, Copy)]
struct Reading {
    angle_deg: f64,
    radius_mm: f64,
    row: usize,
}

impl Readings {
    /// Of a job with one table; a deviation without nominal radius counts from 0.
    pub(in crate::ring_roundness) fn of(job: &Job, goes_on: &dyn Fn() -> bool) -> Result<Self, RoundnessError> {
        let mut repairs = Vec::new();
        if let Some(Ok(read)) = file(job) {
            repairs.extend(read.done.into_iter().map(|(kind, count)| RoundnessRepair::new(kind, count, 0.0)));
        }
        let polar = polar(job);
        let is_points = polar.is_none();
        let (section, mut rows) = match polar {
            Some(readings) => {
                let readings = one_turn(readings, &mut repairs);
                let angles: Vec<f64> = readings.iter().map(|reading| reading.angle_deg.to_radians()).collect();
                let radii: Vec<f64> = readings.iter().map(|reading| reading.radius_mm).collect();
                (Section::from_polar(&angles, &radii)?, readings.iter().map(|reading| reading.row).collect())
            }
            None => points(job, &mut repairs)?,
        };
        let circle = least_squares(&section, goes_on)?;
        let mut angles_deg: Vec<f64> =
            (0..section.len()).map(|index| direction_deg(&section, circle.circle.centre_mm, index)).collect();
        let mut section = section;
        if is_points {
            let mut order: Vec<usize> = (0..section.len()).collect();
            order.sort_by(|&a, &b| angles_deg[a].total_cmp(&angles_deg[b]).then(a.cmp(&b)));
            let (x, y): (Vec<f64>, Vec<f64>) = order.iter().map(|&index| section.point_mm(index).into()).unzip();
            section = Section::from_points(&x, &y)?;
            rows = order.iter().map(|&index| rows[index]).collect();
            angles_deg = order.iter().map(|&index| angles_deg[index]).collect();
        }
        let largest_gap = largest_gap(&angles_deg);
        let read = Self { section, circle, rows, angles_deg, largest_gap, repairs, spikes: Vec::new() };
        read.with_spikes(job.spikes, goes_on)
    }

    /// Finds spikes, and leaves them out where that is asked for.
    fn with_spikes(mut self, treatment: SpikeTreatment, goes_on: &dyn Fn() -> bool) -> Result<Self, RoundnessError> {
        let mut distances_mm = self.section.distances_mm(self.circle.circle.centre_mm);
        let mut found = spikes::spikes(&distances_mm, goes_on)?;
        if found.is_empty() {
            return Ok(self);
        }
        // A keyway draws the circle aside: about that of the rest smaller ones show, too.
        let centre_mm = self.without(&found, goes_on)?.2.circle.centre_mm;
        let distances_about_rest_mm = self.section.distances_mm(centre_mm);
        let found_about_rest = spikes::spikes(&distances_about_rest_mm, goes_on)?;
        if !found_about_rest.is_empty() {
            (distances_mm, found) = (distances_about_rest_mm, found_about_rest);
        }
        self.spikes = found.iter().map(|run| spikes::told(run, &self.angles_deg, &distances_mm, &self.rows)).collect();
        if treatment == SpikeTreatment::Keep {
            return Ok(self);
        }
        let (kept, section, circle) = self.without(&found, goes_on)?;
        let angles_deg: Vec<f64> =
            (0..section.len()).map(|index| direction_deg(&section, circle.circle.centre_mm, index)).collect();
        let highest_um = self.spikes.iter().map(|spike| spike.height_um.abs()).fold(0.0, f64::max);
        self.repairs.push(RoundnessRepair::new(RepairKind::SpikesLeftOut, self.rows.len() - kept.len(), highest_um));
        Ok(Self {
            rows: kept.iter().map(|&at| self.rows[at]).collect(),
            largest_gap: largest_gap(&angles_deg),
            section,
            circle,
            angles_deg,
            ..self
        })
    }

    /// The points without those of some runs, and their circle.
    fn without(
        &self,
        runs: &[Vec<usize>],
        goes_on: &dyn Fn() -> bool,
    ) -> Result<(Vec<usize>, Section, LeastSquares), RoundnessError> {
        let left_out: HashSet<usize> = runs.iter().flatten().copied().collect();
        let kept: Vec<usize> = (0..self.rows.len()).filter(|at| !left_out.contains(at)).collect();
        let (x, y): (Vec<f64>, Vec<f64>) = kept.iter().map(|&at| self.section.point_mm(at).into()).unzip();
        let section = Section::from_points(&x, &y)?;
        let circle = least_squares(&section, goes_on)?;
        Ok((kept, section, circle))
    }

    /// Whether no gap is so wide that a curve through the points would be invention: none much wider than even points
    /// would leave.
    pub(super) fn is_closed(&self) -> bool {
        self.largest_gap.0 <= WIDEST_GAP_DEG.max(MORE_THAN_EVEN * 360.0 / self.rows.len() as f64)
    }
}

fn direction_deg(section: &Section, [cx, cy]: [f64; 2], index: usize) -> f64 {
    let [x, y] = section.point_mm(index);
    let angle = (y - cy).atan2(x - cx).to_degrees();
    if angle < 0.0 { angle + 360.0 } else { angle }
}

/// The readings of a table by angle; `None` of points in the plane.
fn polar(job: &Job) -> Option<Vec<Reading>> {
    let reading = |(row, (angle_deg, radius_mm)): (usize, (f64, f64))| Reading { angle_deg, radius_mm, row };
    if let Some(table) = &job.radii {
        return Some(table.rows().iter().map(|row| (row.angle_deg, row.radius_mm)).enumerate().map(reading).collect());
    }
    let nominal_mm = nominal_mm(job).unwrap_or(0.0);
    match file_rows(job) {
        Some(Rows::Radii(rows)) => return Some(rows.into_iter().enumerate().map(reading).collect()),
        Some(Rows::Deviations(rows)) => {
            let radius = |(angle, um): (f64, f64)| (angle, nominal_mm + um / UM_PER_MM);
            return Some(rows.into_iter().map(radius).enumerate().map(reading).collect());
        }
        Some(Rows::Points(_)) => return None,
        None => {}
    }
    let of =
        |row: &super::input::RoundnessDeviationRow| (row.angle_deg, nominal_mm + row.radial_deviation_um / UM_PER_MM);
    job.deviations.as_ref().map(|table| table.rows().iter().map(of).enumerate().map(reading).collect())
}

/// Angles of a job's rows as they came, degrees; `None` of points in the plane.
pub(super) fn given_angles_deg(job: &Job) -> Option<Vec<f64>> {
    Some(polar(job)?.into_iter().map(|reading| reading.angle_deg).collect())
}

/// The points of the plane, those given twice once.
fn points(job: &Job, repairs: &mut Vec<RoundnessRepair>) -> Result<(Section, Vec<usize>), RoundnessError> {
    let table: Vec<(f64, f64)> = match (file_rows(job), &job.points) {
        (Some(Rows::Points(rows)), _) => rows,
        (_, Some(table)) => table.rows().iter().map(|row| (row.x_mm, row.y_mm)).collect(),
        _ => Vec::new(),
    };
    let mut seen = HashSet::new();
    let kept: Vec<usize> =
        (0..table.len()).filter(|&row| seen.insert((table[row].0.to_bits(), table[row].1.to_bits()))).collect();
    if kept.len() < table.len() {
        repairs.push(RoundnessRepair::new(RepairKind::SamePointLeftOut, table.len() - kept.len(), 0.0));
    }
    let (x, y): (Vec<f64>, Vec<f64>) = kept.iter().map(|&row| table[row]).unzip();
    Ok((Section::from_points(&x, &y)?, kept))
}

/// Readings of any number of turns in any order as one turn counter-clockwise: a closing row left out, turns laid on each
/// other, rows sorted, several at one place averaged. Each is told.
fn one_turn(mut readings: Vec<Reading>, repairs: &mut Vec<RoundnessRepair>) -> Vec<Reading> {
    let (Some(first), Some(last)) = (readings.first().copied(), readings.last().copied()) else { return readings };
    let angles = || readings.iter().map(|reading| reading.angle_deg);
    let (low, high) = (angles().fold(f64::INFINITY, f64::min), angles().fold(f64::NEG_INFINITY, f64::max));
    let descents = readings.windows(2).filter(|pair| pair[1].angle_deg < pair[0].angle_deg).count();
    let near_deg = SAME_PLACE * 360.0 / readings.len() as f64;
    let beyond = angles().filter(|angle| angle - low >= 360.0 - near_deg).count();
    let closes = (last.angle_deg - first.angle_deg).abs() - 360.0;
    if beyond == 1 && closes.abs() <= near_deg {
        readings.pop();
        let change_um = UM_PER_MM * (last.radius_mm - first.radius_mm).abs();
        repairs.push(RoundnessRepair::new(RepairKind::ClosingRowLeftOut, 1, change_um));
    } else if beyond > 0 {
        // Less than 1440 degrees of angles.
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        let turns = ((high - low + near_deg) / 360.0).floor() as usize + 1;
        repairs.push(RoundnessRepair::new(RepairKind::TurnsLaidOnEachOther, turns, 0.0));
        for reading in &mut readings {
            reading.angle_deg = low + (reading.angle_deg - low).rem_euclid(360.0);
        }
    }
    if descents > 0 {
        repairs.push(RoundnessRepair::new(RepairKind::RowsPutInOrder, descents, 0.0));
    }
    readings.sort_by(|a, b| a.angle_deg.total_cmp(&b.angle_deg).then(a.row.cmp(&b.row)));
    let mut merged: Vec<(Reading, f64)> = Vec::with_capacity(readings.len());
    let mut change_um = 0.0_f64;
    for reading in readings {
        match merged.last_mut().filter(|(kept, _)| reading.angle_deg - kept.angle_deg <= near_deg) {
            Some((kept, count)) => {
                change_um = change_um.max(UM_PER_MM * (reading.radius_mm - kept.radius_mm).abs());
                *count += 1.0;
                kept.radius_mm += (reading.radius_mm - kept.radius_mm) / *count;
            }
            None => merged.push((reading, 1.0)),
        }
    }
    let averaged = merged.iter().filter(|(_, count)| *count > 1.0).count();
    if averaged > 0 {
        repairs.push(RoundnessRepair::new(RepairKind::SameAngleAveraged, averaged, change_um));
    }
    merged.into_iter().map(|(reading, _)| reading).collect()
}

/// Widest step between neighbouring angles round the circle, and the index of the point after it.
///
/// All steps add up to one turn; each that leads backwards counts as nearly a turn more and is no gap.
fn largest_gap(angles_deg: &[f64]) -> (f64, usize) {
    let n = angles_deg.len();
    let step = |index: usize| (angles_deg[index] - angles_deg[(index + n - 1) % n]).rem_euclid(360.0);
    let mut steps: Vec<(f64, usize)> = (0..n).map(|index| (step(index), index)).collect();
    let sum_deg: f64 = steps.iter().map(|(step, _)| step).sum();
    steps.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(&b.1)));
    let backwards = (1..n).take_while(|&turns| 360.0 * turns as f64 + 180.0 < sum_deg).count();
    steps.get(backwards).copied().unwrap_or((0.0, 0))
}
