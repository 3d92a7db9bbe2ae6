//! The commanded path in straight moves, and the program that drives it.

use crate::calculator::{Block, Column, Failure, Finding, Monitor, Program, Table};
use crate::path::{round_to_increment, simplified};

use super::encounters::{BESIDE_MM, hit_chuck};
use super::grid::{Grid, Zone};
use super::input::{FeedDirection, Job, ProgramZero, Segment};
use super::output::{Outcome, Path, PathZone, StatusCompensated};
use super::regime::{Regime, Speed};

const UM_PER_MM: f64 = 1e3;
/// Chord tolerance where the job states neither it nor a tolerance of form, um on the radius.
const DEFAULT_CHORD_UM: f64 = 1.0;
/// Share of the form tolerance that the chords may use up.
const CHORD_SHARE: f64 = 0.1;

/// The path and, per station, the radius that it really commands.
pub(super) struct Programmed {
    pub path: Path,
    /// Commanded radius of the rounded moves, mm; `None` outside them.
    pub command_mm: Vec<Option<f64>>,
}

/// Largest radial deviation that the chords may have, um.
pub(super) fn chord_tolerance_um(job: &Job) -> f64 {
    job.path.chord_tolerance_um.unwrap_or_else(|| {
        // The form tolerance is on the diameter, the chord's deviation on the radius.
        job.tolerance.form_um.map_or(DEFAULT_CHORD_UM, |form| (CHORD_SHARE * form).max(job.path.increment_um) / 2.0)
    })
}

/// Cuts the exact commands into the fewest straight moves, zone by zone; never across a shoulder.
pub(super) fn programmed(
    job: &Job,
    grid: &Grid,
    exact_mm: &[Option<f64>],
    status: &[StatusCompensated],
    monitor: &dyn Monitor,
) -> Result<Programmed, Failure> {
    let tolerance_um = chord_tolerance_um(job);
    let increment_mm = job.path.increment_um / UM_PER_MM;
    let mut command_mm: Vec<Option<f64>> = vec![None; grid.len()];
    let mut zones = Vec::new();
    let mut achieved: Option<f64> = None;
    for zone in &grid.zones {
        let stations = zone.first..zone.end;
        let usable =
            status[stations.clone()].iter().all(|s| matches!(s, StatusCompensated::Ok | StatusCompensated::NoStock));
        let radii: Option<Vec<f64>> = exact_mm[stations.clone()].iter().copied().collect();
        let (true, Some(radii)) = (usable, radii) else { continue };
        // Where no station has anything to be cut, the tool does not come: nothing is left undone there.
        if status[stations.clone()].iter().all(|s| matches!(s, StatusCompensated::NoStock)) {
            command_mm[stations].copy_from_slice(&exact_mm[zone.first..zone.end]);
            continue;
        }
        let z_mm = &grid.z_mm[stations];
        let chords = simplified(z_mm, &radii, tolerance_um / UM_PER_MM, increment_mm, monitor)?;
        let corners: Vec<f64> = chords.vertices.iter().map(|&v| z_mm[v]).collect();
        let half: Vec<f64> = chords.diameters_mm.iter().map(|d| d / 2.0).collect();
        achieved = Some(achieved.map_or(chords.deviation_mm, |most| most.max(chords.deviation_mm)));
        for (slot, r) in
            command_mm[zone.first..zone.end].iter_mut().zip(super::grid::interpolate(&corners, &half, z_mm))
        {
            *slot = Some(r);
        }
        zones.push(path_zone(zone, corners, chords.diameters_mm, job.path.increment_um));
    }
    let complete = command_mm.iter().all(Option::is_some);
    let moves = zones.iter().map(|z| z.z_mm.len().saturating_sub(1)).sum::<usize>();
    let path = Path {
        zones,
        // At most one move per station, and stations are limited to 200 000.
        moves: u32::try_from(moves).unwrap_or(u32::MAX),
        chord_tolerance_um: tolerance_um,
        achieved_deviation_um: achieved.map(|d| d * UM_PER_MM),
        complete,
    };
    Ok(Programmed { path, command_mm })
}

fn path_zone(zone: &Zone, z_mm: Vec<f64>, commanded_diameter_mm: Vec<f64>, increment_um: f64) -> PathZone {
    let delta = |d: &f64| round_to_increment((d - zone.diameter_mm) * UM_PER_MM, increment_um);
    let delta_x_um = commanded_diameter_mm.iter().map(delta).collect();
    PathZone { diameter_mm: zone.diameter_mm, z_mm, commanded_diameter_mm, delta_x_um }
}

/// The program of the (last) cut; none for a path with gaps, and none that would take the tool through a chuck.
pub(super) fn program(job: &Job, outcome: &Outcome) -> Result<Program, Failure> {
    let Some(path) = &outcome.path else {
        return Err(Failure::OutOfModel(Finding::new("path_not_computed", "/detail")));
    };
    if !path.complete {
        let status = &outcome.stations.status_compensated;
        let without =
            status.iter().filter(|s| !matches!(s, StatusCompensated::Ok | StatusCompensated::NoStock)).count();
        let first = status.iter().position(|s| !matches!(s, StatusCompensated::Ok | StatusCompensated::NoStock));
        // Between the stations of the answer the path goes through others.
        let z = first.map_or_else(|| first_without_path_mm(outcome, path), |i| outcome.stations.z_mm[i]);
        return Err(Failure::OutOfModel(
            Finding::new("path_incomplete", "/stations").with("stations", without).with("first_z_mm", z),
        ));
    }
    let program = drawn(job, path);
    match hit_chuck(job, &program) {
        Some(chuck) => Err(Failure::OutOfModel(chuck)),
        None => Ok(program),
    }
}

/// The first station of the answer that no zone of the path reaches, mm; 0 where there is none.
fn first_without_path_mm(outcome: &Outcome, path: &Path) -> f64 {
    let reaches = |zone: &PathZone, z: f64| {
        let ends = zone.z_mm.first().zip(zone.z_mm.last());
        ends.is_some_and(|(from, to)| *from <= z && z <= *to)
    };
    let mut stations = outcome.stations.z_mm.iter().copied();
    stations.find(|&z| !path.zones.iter().any(|zone| reaches(zone, z))).unwrap_or(0.0)
}

/// The moves along a path: every zone with its own approach and retract, in the order of the feed.
pub(super) fn drawn(job: &Job, path: &Path) -> Program {
    Writer::new(job, &last_regime(job)).write(path)
}

fn last_regime(job: &Job) -> Regime {
    job.passes.last().map_or_else(|| Regime::of(&job.cut), |pass| Regime::of(&job.cut).of_pass(pass))
}

/// Warns of every place where the program along a path feeds the tool in radially.
pub(super) fn plunges(job: &Job, path: &Path) -> Vec<Finding> {
    let regime = last_regime(job);
    let writer = Writer::new(job, &regime);
    let zones = corners_in_feed_order(path, regime.direction);
    let starts = zones.iter().enumerate().filter_map(|(k, corners)| Some((k, *corners.first()?)));
    let plunge = |z_mm: f64, diameter_mm: f64| {
        Finding::new("plunge_at_shoulder", "/shaft/segments")
            .value(z_mm, "mm")
            .with("z_program_mm", writer.programmed_z(z_mm))
            .with("diameter_mm", diameter_mm)
    };
    starts
        .filter(|(k, (z_mm, x_mm))| writer.is_blocked_before(*z_mm, *x_mm, &zones[..*k]))
        .map(|(_, (z_mm, x_mm))| plunge(z_mm, x_mm))
        .collect()
}

struct Writer<'a> {
    job: &'a Job,
    regime: &'a Regime,
    length_mm: f64,
    increment_mm: f64,
    /// Largest diameter of the blank.
    widest_mm: f64,
    retract_mm: f64,
    blocks: Vec<Block>,
}

impl<'a> Writer<'a> {
    fn new(job: &'a Job, regime: &'a Regime) -> Self {
        let increment_mm = job.path.increment_um / UM_PER_MM;
        let profile = job.stock_profile.iter().flat_map(|p| p.rows().iter().map(|row| row.diameter_mm));
        let widest = job.shaft.segments.iter().map(Segment::stock_mm).chain(profile).fold(0.0, f64::max);
        Self {
            job,
            regime,
            length_mm: job.shaft.segments.iter().map(|s| s.length_mm).sum(),
            increment_mm,
            widest_mm: widest,
            retract_mm: rounded_up(widest + job.program.clearance_x_mm, increment_mm),
            blocks: vec![Block::Modes],
        }
    }

    fn write(mut self, path: &Path) -> Program {
        self.blocks.push(match self.regime.speed {
            Speed::Spindle(rpm) => Block::SpindleSpeed { rpm },
            Speed::Surface(speed_m_per_min) => {
                Block::SurfaceSpeed { speed_m_per_min, limit_rpm: self.job.program.spindle_limit_rpm }
            }
        });
        let mut feed = Some(self.regime.feed_mm_per_rev);
        let zones = corners_in_feed_order(path, self.regime.direction);
        for (k, corners) in zones.iter().enumerate() {
            self.zone(corners, &zones[..k], &mut feed);
        }
        self.blocks.push(Block::End);
        Program { dialect: self.job.program.dialect, increment_mm: self.increment_mm, blocks: self.blocks }
    }

    fn zone(&mut self, corners: &[(f64, f64)], done: &[Corners], feed: &mut Option<f64>) {
        let Some(&(first_z, first_x)) = corners.first() else { return };
        // The tool feeds in radially where it cannot come down before the cut.
        let clear = if self.is_blocked_before(first_z, first_x, done) { 0.0 } else { self.clearance() };
        let approach_z = self.programmed_z(first_z + clear);
        self.blocks.push(Block::Rapid { x_diameter_mm: Some(self.retract_mm), z_mm: Some(approach_z) });
        if clear.abs() > 0.0 {
            self.blocks.push(Block::Rapid { x_diameter_mm: Some(first_x), z_mm: None });
        }
        for &(z, x) in corners {
            let z_mm = self.programmed_z(z);
            self.blocks.push(Block::Cut { x_diameter_mm: x, z_mm, feed_mm_per_rev: feed.take() });
        }
        self.blocks.push(Block::Rapid { x_diameter_mm: Some(self.retract_mm), z_mm: None });
    }

    /// Signed distance of the approach before a cut along Z.
    fn clearance(&self) -> f64 {
        self.clearance_sign() * self.job.program.clearance_z_mm
    }

    fn clearance_sign(&self) -> f64 {
        if self.regime.direction == FeedDirection::ToHeadstock { 1.0 } else { -1.0 }
    }

    /// Whether something as thick as the cut stands where the tool would come down before it; `done` are the zones
    /// that are cut by then.
    fn is_blocked_before(&self, z_mm: f64, x_mm: f64, done: &[Corners]) -> bool {
        let side = self.clearance_sign();
        // Rounded corners may stand a step off a shoulder, and no tool is as thin as a line.
        let (near, far) =
            (z_mm + side * self.increment_mm, z_mm + side * (self.increment_mm + BESIDE_MM) + self.clearance());
        let (from, to) = (near.min(far), near.max(far));
        let mut left = 0.0;
        self.job.shaft.segments.iter().any(|segment| {
            let right = left + segment.length_mm;
            let stands = [from.max(left), to.min(right)];
            left = right;
            stands[0] < stands[1] && self.thickness_mm(segment, stands, done) >= x_mm
        })
    }

    /// Diameter of a segment between two stations: the drawing's where a zone is cut already, else the blank's.
    fn thickness_mm(&self, segment: &Segment, [from, to]: [f64; 2], done: &[Corners]) -> f64 {
        let is_cut = done.iter().any(|corners| {
            let ends = corners.first().zip(corners.last());
            ends.is_some_and(|(a, b)| a.0.min(b.0) <= from && to <= a.0.max(b.0))
        });
        if is_cut {
            segment.diameter_mm
        } else if self.job.stock_profile.is_some() {
            self.widest_mm
        } else {
            segment.stock_mm()
        }
    }

    fn programmed_z(&self, z_mm: f64) -> f64 {
        programmed_z_mm(self.job, self.length_mm, z_mm)
    }
}

/// Z of the program at a station: from the program's zero, rounded to the increment.
fn programmed_z_mm(job: &Job, length_mm: f64, z_mm: f64) -> f64 {
    let zero = match job.program.zero {
        ProgramZero::RightFace => length_mm,
        ProgramZero::LeftFace => 0.0,
    };
    round_to_increment(z_mm - zero, job.path.increment_um / UM_PER_MM)
}

/// To the next increment that is no less.
fn rounded_up(diameter_mm: f64, increment_mm: f64) -> f64 {
    let near = round_to_increment(diameter_mm, increment_mm);
    if near < diameter_mm - 1e-9 { round_to_increment(near + increment_mm, increment_mm) } else { near }
}

/// Station and commanded diameter of a zone's corners.
type Corners = Vec<(f64, f64)>;

/// The corners of every zone, as the tool passes them.
fn corners_in_feed_order(path: &Path, direction: FeedDirection) -> Vec<Corners> {
    let mut zones: Vec<Corners> = path
        .zones
        .iter()
        .map(|zone| zone.z_mm.iter().copied().zip(zone.commanded_diameter_mm.iter().copied()).collect())
        .collect();
    if direction == FeedDirection::ToHeadstock {
        zones.reverse();
        for corners in &mut zones {
            corners.reverse();
        }
    }
    zones
}

/// The path as a table, in the order of the feed: station, drawing's diameter, and the program's X and Z.
pub(super) fn path_table(job: &Job, path: Option<&Path>) -> Table {
    let length_mm: f64 = job.shaft.segments.iter().map(|s| s.length_mm).sum();
    let (mut station, mut drawing, mut x, mut z) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    let empty =
        Path { zones: Vec::new(), moves: 0, chord_tolerance_um: 0.0, achieved_deviation_um: None, complete: true };
    let path = path.unwrap_or(&empty);
    let mut diameters: Vec<f64> = path.zones.iter().map(|zone| zone.diameter_mm).collect();
    if job.cut.feed_direction == FeedDirection::ToHeadstock {
        diameters.reverse();
    }
    for (corners, diameter) in corners_in_feed_order(path, job.cut.feed_direction).into_iter().zip(diameters) {
        for (at, commanded) in corners {
            station.push(at);
            drawing.push(diameter);
            x.push(commanded);
            z.push(programmed_z_mm(job, length_mm, at));
        }
    }
    Table {
        id: "path",
        columns: vec![
            Column::numbers("z", "mm", &station),
            Column::numbers("diameter", "mm", &drawing),
            Column::numbers("x_diameter", "mm", &x),
            Column::numbers("z_program", "mm", &z),
        ],
    }
}
