//! The points of a job, whatever form they came in.

use crate::num::roundness::{LeastSquares, RoundnessError, Section, least_squares};

use super::input::Job;

const UM_PER_MM: f64 = 1e3;

/// A table of the job.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Table {
    Radii,
    Deviations,
    Points,
}

impl Table {
    /// Name of the field.
    pub(super) const fn name(self) -> &'static str {
        match self {
            Self::Radii => "radii",
            Self::Deviations => "deviations",
            Self::Points => "points",
        }
    }

    /// Which tables a job has.
    pub(super) fn of(job: &Job) -> Vec<Self> {
        let given = [
            job.radii.as_ref().map(|_| Self::Radii),
            job.deviations.as_ref().map(|_| Self::Deviations),
            job.points.as_ref().map(|_| Self::Points),
        ];
        given.into_iter().flatten().collect()
    }
}

/// Number of points of a job.
pub(super) fn count(job: &Job) -> usize {
    let radii = job.radii.as_ref().map_or(0, |table| table.rows().len());
    let deviations = job.deviations.as_ref().map_or(0, |table| table.rows().len());
    radii + deviations + job.points.as_ref().map_or(0, |table| table.rows().len())
}

/// Angles of a job's rows, degrees; `None` of points in the plane.
pub(super) fn angles_deg(job: &Job) -> Option<Vec<f64>> {
    let radii = job.radii.as_ref().map(|table| table.rows().iter().map(|row| row.angle_deg).collect());
    radii.or_else(|| job.deviations.as_ref().map(|table| table.rows().iter().map(|row| row.angle_deg).collect()))
}

/// The points in counter-clockwise order, their least-squares circle, and where they stood.
pub(super) struct Readings {
    pub(super) section: Section,
    pub(super) circle: LeastSquares,
    /// Row of the job's table for each point.
    pub(super) rows: Vec<usize>,
    /// Direction of each point from the least-squares centre, degrees, 0 to 360.
    pub(super) angles_deg: Vec<f64>,
    /// Widest angle between neighbours, degrees, and the point after it.
    pub(super) largest_gap: (f64, usize),
}

impl Readings {
    /// Of a job with one table; a deviation without nominal radius counts from 0.
    pub(super) fn of(job: &Job) -> Result<Self, RoundnessError> {
        let section = section(job)?;
        let circle = least_squares(&section)?;
        let mut rows: Vec<usize> = (0..section.len()).collect();
        let [cx, cy] = circle.circle.centre_mm;
        let angle = |index: usize| {
            let [x, y] = section.point_mm(index);
            let angle = (y - cy).atan2(x - cx).to_degrees();
            if angle < 0.0 { angle + 360.0 } else { angle }
        };
        let angles: Vec<f64> = rows.iter().map(|&index| angle(index)).collect();
        let section = if job.points.is_some() {
            rows.sort_by(|&a, &b| angles[a].total_cmp(&angles[b]).then(a.cmp(&b)));
            let (x, y): (Vec<f64>, Vec<f64>) = rows.iter().map(|&row| section.point_mm(row).into()).unzip();
            Section::from_points(&x, &y)?
        } else {
            section
        };
        let angles_deg: Vec<f64> = rows.iter().map(|&row| angles[row]).collect();
        let largest_gap = largest_gap(&angles_deg);
        Ok(Self { section, circle, rows, angles_deg, largest_gap })
    }
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

fn section(job: &Job) -> Result<Section, RoundnessError> {
    if let Some(points) = &job.points {
        let (x, y): (Vec<f64>, Vec<f64>) = points.rows().iter().map(|row| (row.x_mm, row.y_mm)).unzip();
        return Section::from_points(&x, &y);
    }
    let angles: Vec<f64> = angles_deg(job).unwrap_or_default().into_iter().map(f64::to_radians).collect();
    let nominal_mm = job.nominal_radius_mm.unwrap_or(0.0);
    let radii: Vec<f64> = match (&job.radii, &job.deviations) {
        (Some(table), _) => table.rows().iter().map(|row| row.radius_mm).collect(),
        (None, Some(table)) => {
            table.rows().iter().map(|row| nominal_mm + row.radial_deviation_um / UM_PER_MM).collect()
        }
        (None, None) => Vec::new(),
    };
    Section::from_polar(&angles, &radii)
}
