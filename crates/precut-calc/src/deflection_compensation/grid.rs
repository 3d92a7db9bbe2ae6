//! Stations along the shaft, and the segments and zones that they belong to.

use super::input::{Job, Segment, Stations};

const UM_PER_MM: f64 = 1e3;

/// Stations, ascending in z (equal at a shoulder, where a zone ends and the next begins).
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Grid {
    pub z_mm: Vec<f64>,
    /// Segment that a station belongs to; on a step the one that ends there.
    pub segment: Vec<usize>,
    /// Runs of stations with one drawing diameter, neighbouring along the shaft.
    pub zones: Vec<Zone>,
    pub length_mm: f64,
    /// Left ends of the segments, and the end of the shaft.
    pub steps_mm: Vec<f64>,
}

/// Stations `first..end` lie in neighbouring segments of one drawing diameter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Zone {
    pub first: usize,
    pub end: usize,
    pub diameter_mm: f64,
}

/// Most intervals between the stations of a zone that the path goes through, where the job's are fewer: those that a
/// zone has by default.
const PATH_INTERVALS: u32 = 200;
/// By how much of an interval two stations may stand farther apart: rounding of evenly spaced ones.
const SPACING_SLACK: f64 = 1e-6;

/// Stations for the path, and which of them are the job's own.
pub(super) struct Refined {
    pub grid: Grid,
    pub own: Vec<usize>,
}

/// Neighbouring segments `first..end` of one drawing diameter.
struct SegmentRun {
    first: usize,
    end: usize,
}

impl Grid {
    /// The stations that the job asks for.
    pub(super) fn of(job: &Job) -> Self {
        let segments = &job.shaft.segments;
        let mut grid = Self {
            z_mm: Vec::new(),
            segment: Vec::new(),
            zones: Vec::new(),
            length_mm: 0.0,
            steps_mm: step_positions(segments),
        };
        grid.length_mm = grid.steps_mm[segments.len()];
        let runs = runs_of_one_diameter(segments);
        let stations = station_count(job);
        grid.z_mm.reserve_exact(stations);
        grid.segment.reserve_exact(stations);
        match &job.stations {
            Stations::PerZone { count } => {
                for run in runs.iter().filter(|run| is_turned(job, run)) {
                    grid.fill_run(run, *count, segments);
                }
            }
            Stations::List { z_mm } => grid.take_list(z_mm, &runs, segments),
        }
        grid
    }

    fn fill_run(&mut self, run: &SegmentRun, count: u32, segments: &[Segment]) {
        let (from, to) = (self.steps_mm[run.first], self.steps_mm[run.end]);
        let first = self.z_mm.len();
        let steps = f64::from(count.saturating_sub(1));
        self.z_mm.extend((0..count.saturating_sub(1)).map(|k| from + (to - from) * (f64::from(k) / steps)));
        self.z_mm.push(to);
        let mut rest = &self.z_mm[first..];
        for segment in run.first..run.end {
            let here = if segment + 1 == run.end {
                rest.len()
            } else {
                rest.partition_point(|z| *z <= self.steps_mm[segment + 1])
            };
            self.segment.extend(std::iter::repeat_n(segment, here));
            rest = &rest[here..];
        }
        self.zones.push(Zone { first, end: self.z_mm.len(), diameter_mm: segments[run.first].diameter_mm });
    }

    fn take_list(&mut self, z_mm: &[f64], runs: &[SegmentRun], segments: &[Segment]) {
        let mut segment = 0;
        let mut run = 0;
        for (i, &z) in z_mm.iter().enumerate() {
            while segment + 1 < segments.len() && z > self.steps_mm[segment + 1] {
                segment += 1;
            }
            let before = run;
            while segment >= runs[run].end {
                run += 1;
            }
            if i == 0 || run != before {
                self.zones.push(Zone { first: i, end: i, diameter_mm: segments[segment].diameter_mm });
            }
            if let Some(zone) = self.zones.last_mut() {
                zone.end = i + 1;
            }
            self.z_mm.push(z);
            self.segment.push(segment);
        }
    }

    /// The stations with more among them for the path: from the first to the last one to both ends of whatever is turned
    /// between them, none farther from the next than the default would place it. `None` where nothing is to be added.
    pub(super) fn refined(&self, job: &Job) -> Option<Refined> {
        if path_station_count(job) == 0 {
            return None;
        }
        let (&first, &last) = (self.z_mm.first()?, self.z_mm.last()?);
        let mut fine = Self {
            z_mm: Vec::with_capacity(self.len()),
            segment: Vec::with_capacity(self.len()),
            zones: Vec::new(),
            length_mm: self.length_mm,
            steps_mm: self.steps_mm.clone(),
        };
        let mut own = Vec::with_capacity(self.len());
        let mut zones = self.zones.iter().peekable();
        for run in runs_of_one_diameter(&job.shaft.segments) {
            let stations = zones.next_if(|zone| self.segment[zone.first] < run.end).map(|zone| zone.first..zone.end);
            let ends = [self.steps_mm[run.first], self.steps_mm[run.end]];
            let reached = is_turned(job, &run).then_some(ends);
            let reached = reached.map(|ends| ends.map(|z| (first <= z && z <= last).then_some(z)));
            fine.add_run(self, &run, stations.unwrap_or(0..0), reached.unwrap_or_default(), job, &mut own);
        }
        (fine.len() > self.len()).then_some(Refined { grid: fine, own })
    }

    /// Adds the stations that `from` has of a run, its ends as far as they are reached, and more between.
    fn add_run(
        &mut self,
        from: &Self,
        run: &SegmentRun,
        stations: std::ops::Range<usize>,
        ends: [Option<f64>; 2],
        job: &Job,
        own: &mut Vec<usize>,
    ) {
        let increment_mm = job.path.increment_um / UM_PER_MM;
        let (known, of) = (&from.z_mm[stations.clone()], &from.segment[stations]);
        let is_new = |z: f64| known.iter().all(|known| (known - z).abs() > increment_mm);
        let [left, right] = ends.map(|end| end.filter(|z| is_new(*z)));
        let left = left.map(|z| (z, run.first, false));
        let right = right.map(|z| (z, run.end - 1, false));
        let known = known.iter().zip(of).map(|(&z, &segment)| (z, segment, true));
        let all: Vec<(f64, usize, bool)> = left.into_iter().chain(known).chain(right).collect();
        let (Some(&(from_mm, ..)), Some(&(to_mm, ..))) = (all.first(), all.last()) else { return };
        let spacing_mm = (to_mm - from_mm) / f64::from(PATH_INTERVALS);
        let first = self.len();
        for (k, &(z, segment, is_own)) in all.iter().enumerate() {
            if let Some(&(before, ..)) = k.checked_sub(1).and_then(|k| all.get(k)) {
                self.fill_between(before, z, spacing_mm);
            }
            if is_own {
                own.push(self.len());
            }
            self.z_mm.push(z);
            self.segment.push(segment);
        }
        self.zones.push(Zone { first, end: self.len(), diameter_mm: job.shaft.segments[run.first].diameter_mm });
    }

    /// Adds stations after the last one and before `to_mm`, evenly, no farther apart than `spacing_mm`.
    fn fill_between(&mut self, from_mm: f64, to_mm: f64, spacing_mm: f64) {
        let gap_mm = to_mm - from_mm;
        let steps = if gap_mm > 0.0 { (gap_mm / spacing_mm - SPACING_SLACK).ceil() } else { 0.0 };
        let mut segment = self.segment.last().copied().unwrap_or(0);
        let places = (1..=PATH_INTERVALS).map(f64::from).take_while(|k| *k < steps);
        for z in places.map(|k| from_mm + gap_mm * (k / steps)) {
            while z > self.steps_mm[segment + 1] {
                segment += 1;
            }
            self.z_mm.push(z);
            self.segment.push(segment);
        }
    }

    /// Stretches of what is turned that lie before the first station or beyond the last, mm.
    pub(super) fn beyond(&self, job: &Job) -> Vec<[f64; 2]> {
        let (Some(&first), Some(&last)) = (self.z_mm.first(), self.z_mm.last()) else { return Vec::new() };
        let increment_mm = job.path.increment_um / UM_PER_MM;
        let runs = runs_of_one_diameter(&job.shaft.segments);
        let turned = runs.iter().filter(|run| is_turned(job, run));
        turned
            .map(|run| [self.steps_mm[run.first], self.steps_mm[run.end]])
            .flat_map(|[from, to]| [[from, to.min(first)], [from.max(last), to]])
            .filter(|[from, to]| to - from > increment_mm)
            .collect()
    }

    /// Indices of at most about `count` stations, evenly, with the first and the last.
    pub(super) fn sample(&self, count: usize) -> Vec<usize> {
        let n = self.len();
        let step = n.div_ceil(count).max(1);
        let last = (n > 1 && !(n - 1).is_multiple_of(step)).then_some(n - 1);
        (0..n).step_by(step).chain(last).collect()
    }

    /// The grid of some of the stations, ascending.
    pub(super) fn at(&self, chosen: &[usize]) -> Self {
        Self {
            z_mm: chosen.iter().map(|&i| self.z_mm[i]).collect(),
            segment: chosen.iter().map(|&i| self.segment[i]).collect(),
            zones: Vec::new(),
            length_mm: self.length_mm,
            steps_mm: self.steps_mm.clone(),
        }
    }

    /// How many stations there are.
    pub(super) fn len(&self) -> usize {
        self.z_mm.len()
    }
}

/// How many stations the job asks for, without making them.
pub(super) fn station_count(job: &Job) -> usize {
    match &job.stations {
        Stations::List { z_mm } => z_mm.len(),
        Stations::PerZone { count } => {
            let zones = runs_of_one_diameter(&job.shaft.segments).iter().filter(|run| is_turned(job, run)).count();
            zones * (*count as usize)
        }
    }
}

/// At most how many stations the path goes through beside the job's own, without making them.
pub(super) fn path_station_count(job: &Job) -> usize {
    let runs = runs_of_one_diameter(&job.shaft.segments).len();
    match &job.stations {
        Stations::PerZone { count } if *count > PATH_INTERVALS => 0,
        _ => runs * PATH_INTERVALS as usize,
    }
}

fn step_positions(segments: &[Segment]) -> Vec<f64> {
    let mut steps = vec![0.0];
    let mut z = 0.0;
    for segment in segments {
        z += segment.length_mm;
        steps.push(z);
    }
    steps
}

/// Diameters are compared as the drawing has them: equal numbers are one zone.
#[allow(clippy::float_cmp)]
fn runs_of_one_diameter(segments: &[Segment]) -> Vec<SegmentRun> {
    let mut runs: Vec<SegmentRun> = Vec::new();
    for (i, segment) in segments.iter().enumerate() {
        match runs.last_mut() {
            Some(run) if segments[run.first].diameter_mm == segment.diameter_mm => run.end = i + 1,
            _ => runs.push(SegmentRun { first: i, end: i + 1 }),
        }
    }
    runs
}

/// A zone is turned where its blank is thicker than the drawing; a measured blank may be so anywhere.
fn is_turned(job: &Job, run: &SegmentRun) -> bool {
    job.stock_profile.is_some() || job.shaft.segments[run.first..run.end].iter().any(|s| s.stock_mm() > s.diameter_mm)
}

/// Piecewise linear through the rows, constant beyond them. `z_mm` ascending on both sides.
pub(super) fn interpolate(rows_z: &[f64], rows_value: &[f64], z_mm: &[f64]) -> Vec<f64> {
    let last = rows_z.len() - 1;
    let mut k = 0;
    z_mm.iter()
        .map(|&z| {
            while k < last && z > rows_z[k + 1] {
                k += 1;
            }
            if z <= rows_z[0] {
                rows_value[0]
            } else if z >= rows_z[last] {
                rows_value[last]
            } else {
                let share = (z - rows_z[k]) / (rows_z[k + 1] - rows_z[k]);
                rows_value[k] + share * (rows_value[k + 1] - rows_value[k])
            }
        })
        .collect()
}

#[cfg(test)]
#[allow(clippy::float_cmp)]
mod tests {
    use super::*;

    #[test]
    fn interpolation_is_constant_beyond_its_ends() {
        let at = interpolate(&[0.0, 200.0, 400.0], &[44.0, 44.6, 43.8], &[-1.0, 0.0, 100.0, 200.0, 300.0, 500.0]);
        assert_eq!(at, [44.0, 44.0, 44.3, 44.6, 44.2, 43.8]);
    }
}
