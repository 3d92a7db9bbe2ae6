//! Stations along the shaft, and the segments and zones that they belong to.

use crate::deflection_compensation::job::input::{Job, Segment, Stations, Support};

const UM_PER_MM: f64 = 1e3;

/// Stations, ascending in z (equal at a shoulder, where a zone ends and the next begins).
#[derive(Debug, Clone, PartialEq)]
pub(in crate::deflection_compensation) struct Grid {
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
pub(in crate::deflection_compensation) struct Zone {
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
pub(in crate::deflection_compensation) struct Refined {
    pub grid: Grid,
    pub own: Vec<usize>,
}

/// A place that the path needs a station at.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Mark {
    z_mm: f64,
    kind: MarkKind,
}

/// What a place is, in the order in which those of one place stand.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord)]
enum MarkKind {
    /// A station of the job.
    Own,
    /// The course of the command turns.
    Kink,
    /// The command may jump, or the tool leaves the work.
    Jump,
}

/// Half of the distance over which a follow rest comes to the shaft, mm.
const SIDE_MM: f64 = 1e-6;

/// Neighbouring segments `first..end` of one drawing diameter.
struct SegmentRun {
    first: usize,
    end: usize,
}

impl Grid {
    /// The stations that the job asks for.
    pub(in crate::deflection_compensation) fn of(job: &Job) -> Self {
        let segments = &job.shaft.segments;
        let mut grid = Self {
            z_mm: Vec::new(),
            segment: Vec::new(),
            zones: Vec::new(),
            length_mm: 0.0,
            steps_mm: job.shaft.ends_mm(),
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
    /// between them, wherever the compliance has a kink, and none farther from the next than the default would place it.
    /// Where what is commanded may jump, two stations share the place and the zone ends: its path is a path of its own.
    pub(in crate::deflection_compensation) fn refined(&self, job: &Job) -> Refined {
        let mut fine = Self {
            z_mm: Vec::with_capacity(self.len()),
            segment: Vec::with_capacity(self.len()),
            zones: Vec::new(),
            length_mm: self.length_mm,
            steps_mm: self.steps_mm.clone(),
        };
        let mut own = Vec::with_capacity(self.len());
        let (Some(&first), Some(&last)) = (self.z_mm.first(), self.z_mm.last()) else {
            return Refined { grid: fine, own };
        };
        let breaks = self.breaks(job);
        let mut zones = self.zones.iter().peekable();
        for run in runs_of_one_diameter(&job.shaft.segments) {
            let stations = zones.next_if(|zone| self.segment[zone.first] < run.end).map(|zone| zone.first..zone.end);
            let known = stations.unwrap_or(0..0);
            let ends = [self.steps_mm[run.first], self.steps_mm[run.end]];
            let reached = is_turned(job, &run).then_some(ends);
            let reached = reached.map(|ends| ends.map(|z| (first <= z && z <= last).then_some(z)));
            let marks = self.marks(known, &run, reached.unwrap_or_default(), &breaks, job);
            fine.add_run(&run, &marks, job.shaft.segments[run.first].diameter_mm, &mut own);
        }
        Refined { grid: fine, own }
    }

    /// Where the command has a kink or may jump, ascending.
    fn breaks(&self, job: &Job) -> Vec<Mark> {
        let mark = |z_mm, kind| Mark { z_mm, kind };
        let segments = &job.shaft.segments;
        let mut breaks: Vec<Mark> = Vec::new();
        for (i, pair) in segments.windows(2).enumerate() {
            let jumps = pair[0].stock_mm().to_bits() != pair[1].stock_mm().to_bits();
            breaks.push(mark(self.steps_mm[i + 1], if jumps { MarkKind::Jump } else { MarkKind::Kink }));
        }
        let side = job.cut.feed_direction.comes_from();
        for support in &job.supports {
            match *support {
                Support::FollowRest { offset_mm, .. } => {
                    let met = self.steps_mm.iter().map(|z| mark(z - offset_mm, MarkKind::Kink));
                    breaks.extend(met);
                    // There it comes to the shaft, or leaves it.
                    for end in [0.0, self.length_mm] {
                        breaks.push(mark(end - offset_mm - SIDE_MM, MarkKind::Jump));
                        breaks.push(mark(end - offset_mm + SIDE_MM, MarkKind::Kink));
                    }
                }
                Support::SteadyRest { z_mm, .. } => {
                    breaks.push(mark(z_mm, MarkKind::Kink));
                    breaks.push(mark(
                        crate::deflection_compensation::job::writing::stop_before_mm(job, self.length_mm, z_mm, side),
                        MarkKind::Jump,
                    ));
                }
                Support::Centre { z_mm, .. } | Support::Chuck { z_mm, .. } => breaks.push(mark(z_mm, MarkKind::Kink)),
            }
        }
        if let Some(profile) = &job.stock_profile {
            breaks.extend(profile.rows().iter().map(|row| mark(row.z_mm, MarkKind::Kink)));
        }
        breaks.sort_by(|a, b| a.z_mm.total_cmp(&b.z_mm));
        breaks
    }

    /// The stations of a run of segments that the path needs, ascending: its known ones, its ends, and the breaks between.
    fn marks(
        &self,
        known: std::ops::Range<usize>,
        run: &SegmentRun,
        ends: [Option<f64>; 2],
        breaks: &[Mark],
        job: &Job,
    ) -> Vec<Mark> {
        let increment_mm = job.path.increment_um / UM_PER_MM;
        let mut marks: Vec<Mark> = known.map(|i| Mark { z_mm: self.z_mm[i], kind: MarkKind::Own }).collect();
        let is_new = |z: f64| marks.iter().all(|mark| (mark.z_mm - z).abs() > increment_mm);
        let ends: Vec<Mark> =
            ends.into_iter().flatten().filter(|z| is_new(*z)).map(|z_mm| Mark { z_mm, kind: MarkKind::Kink }).collect();
        marks.extend(ends);
        marks.sort_by(|a, b| a.z_mm.total_cmp(&b.z_mm));
        let (Some(&Mark { z_mm: from, .. }), Some(&Mark { z_mm: to, .. })) = (marks.first(), marks.last()) else {
            return marks;
        };
        let (from, to) = (from.max(self.steps_mm[run.first]), to.min(self.steps_mm[run.end]));
        let inside = breaks.iter().filter(|mark| from + increment_mm < mark.z_mm && mark.z_mm < to - increment_mm);
        marks.extend(inside.copied());
        // A jump stands after a station of the job at the same place.
        marks.sort_by(|a, b| a.z_mm.total_cmp(&b.z_mm).then(a.kind.cmp(&b.kind)));
        marks.dedup_by(|later, kept| {
            let gap = later.z_mm - kept.z_mm;
            match (kept.kind, later.kind) {
                (_, MarkKind::Kink) | (MarkKind::Jump, MarkKind::Jump) => gap <= increment_mm,
                _ => false,
            }
        });
        marks
    }

    /// Adds the stations of a run: its marks, and more between.
    fn add_run(&mut self, run: &SegmentRun, marks: &[Mark], diameter_mm: f64, own: &mut Vec<usize>) {
        let (Some(&Mark { z_mm: from_mm, .. }), Some(&Mark { z_mm: to_mm, .. })) = (marks.first(), marks.last()) else {
            return;
        };
        let spacing_mm = (to_mm - from_mm) / f64::from(PATH_INTERVALS);
        let mut first = self.len();
        let mut segment = run.first;
        for (k, &Mark { z_mm: z, kind }) in marks.iter().enumerate() {
            if let Some(before) = k.checked_sub(1).map(|k| marks[k].z_mm) {
                let gap_mm = z - before;
                let steps = if gap_mm > 0.0 { (gap_mm / spacing_mm - SPACING_SLACK).ceil() } else { 0.0 };
                for at in (1..=PATH_INTERVALS)
                    .map(f64::from)
                    .take_while(|k| *k < steps)
                    .map(|k| before + gap_mm * (k / steps))
                {
                    self.add(at, &mut segment, run);
                }
            }
            let is_there = self.len() > first && self.z_mm.last().is_some_and(|last| last.to_bits() == z.to_bits());
            if kind != MarkKind::Jump || !is_there {
                self.add(z, &mut segment, run);
            }
            if kind == MarkKind::Own {
                own.push(self.len() - 1);
            }
            if kind == MarkKind::Jump {
                self.zones.push(Zone { first, end: self.len(), diameter_mm });
                first = self.len();
                // The other side belongs to the segment that begins there.
                if z >= self.steps_mm[segment + 1] && segment + 1 < run.end {
                    segment += 1;
                }
                self.z_mm.push(z);
                self.segment.push(segment);
            }
        }
        self.zones.push(Zone { first, end: self.len(), diameter_mm });
    }

    fn add(&mut self, z_mm: f64, segment: &mut usize, run: &SegmentRun) {
        while z_mm > self.steps_mm[*segment + 1] && *segment + 1 < run.end {
            *segment += 1;
        }
        self.z_mm.push(z_mm);
        self.segment.push(*segment);
    }

    /// Runs of stations in neighbouring segments of one drawing and one blank: the tool comes to a piece or does not.
    pub(in crate::deflection_compensation) fn pieces(&self, segments: &[Segment]) -> Vec<std::ops::Range<usize>> {
        let key = |segment: usize| (segments[segment].diameter_mm.to_bits(), segments[segment].stock_mm().to_bits());
        let (mut pieces, mut first) = (Vec::new(), 0);
        for (i, pair) in self.segment.windows(2).enumerate() {
            if pair[0] != pair[1] && (pair[1] != pair[0] + 1 || key(pair[0]) != key(pair[1])) {
                pieces.push(first..i + 1);
                first = i + 1;
            }
        }
        pieces.push(first..self.len());
        pieces
    }

    /// Stretches of what is turned that lie before the first station or beyond the last, mm.
    pub(in crate::deflection_compensation) fn beyond(&self, job: &Job) -> Vec<[f64; 2]> {
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
    pub(in crate::deflection_compensation) fn sample(&self, count: usize) -> Vec<usize> {
        let n = self.len();
        let step = n.div_ceil(count).max(1);
        let last = (n > 1 && !(n - 1).is_multiple_of(step)).then_some(n - 1);
        (0..n).step_by(step).chain(last).collect()
    }

    /// The grid of some of the stations, ascending.
    pub(in crate::deflection_compensation) fn at(&self, chosen: &[usize]) -> Self {
        Self {
            z_mm: chosen.iter().map(|&i| self.z_mm[i]).collect(),
            segment: chosen.iter().map(|&i| self.segment[i]).collect(),
            zones: Vec::new(),
            length_mm: self.length_mm,
            steps_mm: self.steps_mm.clone(),
        }
    }

    /// How many stations there are.
    pub(in crate::deflection_compensation) fn len(&self) -> usize {
        self.z_mm.len()
    }
}

/// How many stations the job asks for, without making them.
pub(in crate::deflection_compensation) fn station_count(job: &Job) -> usize {
    match &job.stations {
        Stations::List { z_mm } => z_mm.len(),
        Stations::PerZone { count } => {
            let zones = runs_of_one_diameter(&job.shaft.segments).iter().filter(|run| is_turned(job, run)).count();
            zones * (*count as usize)
        }
    }
}

/// At most about how many stations the path goes through beside the job's own, without making them.
pub(in crate::deflection_compensation) fn path_station_count(job: &Job) -> usize {
    let runs = runs_of_one_diameter(&job.shaft.segments).len();
    let between = match &job.stations {
        Stations::PerZone { count } if *count > PATH_INTERVALS => 0,
        _ => runs * PATH_INTERVALS as usize,
    };
    let rows = job.stock_profile.as_ref().map_or(0, |profile| profile.rows().len());
    between + 2 * job.shaft.segments.len() + 4 * job.supports.len() + rows
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
pub(in crate::deflection_compensation) fn interpolate(rows_z: &[f64], rows_value: &[f64], z_mm: &[f64]) -> Vec<f64> {
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
