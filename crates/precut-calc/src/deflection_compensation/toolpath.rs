//! The commanded path in straight moves, and the program that drives it.

use crate::calculator::{Column, Failure, Finding, Monitor, Program, Table, Unwatched};
use crate::path::{round_to_increment, simplified};
use crate::turning::{self, Limits, Point, Rest, Setting, Stretch, Surface, Written, Yielding};

use super::acting::Acting;
use super::auto;
use super::driven::drive;
use super::encounters::hit_chuck;
use super::grid::{Grid, Zone, interpolate};
use super::input::{FeedDirection, Job, ProgramSettings, ProgramZero, Support};
use super::model::Solver;
use super::output::{Outcome, Path, PathZone, StatusCompensated};
use super::regime::{Regime, Speed};
use super::stage::Stage;

const UM_PER_MM: f64 = 1e3;
/// Chord tolerance where the job states neither it nor a tolerance of form, um on the radius.
const DEFAULT_CHORD_UM: f64 = 1.0;
/// Share of the form tolerance that the chords may use up.
const CHORD_SHARE: f64 = 0.1;
/// Beside the increment, a program may be so far from the prediction: rounding of what both compute, um.
const PREDICTED_UM: f64 = 0.1;

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

/// Cuts the commands of a cut into the fewest straight moves, zone by zone: never across a shoulder, nor where they jump.
pub(super) fn programmed(
    job: &Job,
    grid: &Grid,
    stage: &Stage,
    compensated: bool,
    exact_mm: &[Option<f64>],
    monitor: &dyn Monitor,
) -> Result<Programmed, Failure> {
    let tolerance_um = chord_tolerance_um(job);
    let increment_mm = job.path.increment_um / UM_PER_MM;
    let status = &stage.cut.status_compensated;
    let has_command =
        |i: usize| !compensated || matches!(status[i], StatusCompensated::Ok | StatusCompensated::NoStock);
    let mut command_mm: Vec<Option<f64>> = vec![None; grid.len()];
    let mut zones = Vec::new();
    let mut achieved: Option<f64> = None;
    let mut complete = true;
    for zone in &grid.zones {
        let stations = zone.first..zone.end;
        // Where nothing is planned to be cut the tool does not come: nothing is left undone there.
        if stations.clone().all(|i| stage.radii.is_idle(i)) {
            continue;
        }
        let radii: Option<Vec<f64>> = exact_mm[stations.clone()].iter().copied().collect();
        let (true, Some(radii)) = (stations.clone().all(has_command), radii) else {
            complete = false;
            continue;
        };
        let z_mm = &grid.z_mm[stations];
        let chords = simplified(z_mm, &radii, tolerance_um / UM_PER_MM, increment_mm, monitor)?;
        let corners: Vec<f64> = chords.vertices.iter().map(|&v| z_mm[v]).collect();
        let half: Vec<f64> = chords.diameters_mm.iter().map(|d| d / 2.0).collect();
        achieved = Some(achieved.map_or(chords.deviation_mm, |most| most.max(chords.deviation_mm)));
        for (slot, r) in command_mm[zone.first..zone.end].iter_mut().zip(interpolate(&corners, &half, z_mm)) {
            *slot = Some(r);
        }
        zones.push(path_zone(zone, corners, chords.diameters_mm, job.path.increment_um));
    }
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

/// The program of all cuts; none for a path with gaps, none that would take the tool through a chuck, and none that was
/// not seen to do what the answer says.
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
    // With the effects that act in the answer, not only those that the job states.
    let (job, _) = auto::settled(job, &Unwatched)?;
    let job = &*job;
    let acting = Acting::of(&job.effects, &job.conditions, job.cut.feed_direction);
    let driven = drive(job, &Grid::of(job), &acting, outcome.aim_shift_um, &mut |_, _, _| (), &Unwatched)?;
    let (Some(drawn), Some(proof)) = (driven.drawn, driven.proof) else {
        return Err(Failure::Internal("a complete path has no program".to_owned()));
    };
    if let Some(chuck) = hit_chuck(job, &drawn.written.program) {
        return Err(Failure::OutOfModel(chuck));
    }
    proof.holds(&drawn.limits)?;
    Ok(drawn.written.program)
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

/// The program along paths, and what it is held against.
pub(super) struct Drawn {
    pub written: Written,
    pub limits: Limits,
    stretches: Vec<Stretch>,
    zero_mm: f64,
}

impl ProgramSettings {
    /// How a program of these settings is written, for a shaft of this length.
    pub(crate) fn setting(
        &self,
        increment_mm: f64,
        zero_mm: f64,
        direction: FeedDirection,
        supports: &[Support],
    ) -> Setting {
        let rest = |support: &Support| match *support {
            Support::SteadyRest { z_mm, .. } => Some(Rest { z_mm }),
            _ => None,
        };
        Setting {
            dialect: self.dialect,
            increment_mm,
            zero_mm,
            clearance_x_mm: self.clearance_x_mm,
            clearance_z_mm: self.clearance_z_mm,
            side: direction.comes_from(),
            rests: supports.iter().filter_map(rest).collect(),
            tool_number: self.tool_number,
            coolant: self.coolant,
            safe_position: self.safe_position.map(|safe| (safe.x_diameter_mm, safe.z_mm)),
            end: self.end,
        }
    }
}

/// How the program of a job is written.
fn setting(job: &Job, length_mm: f64) -> Setting {
    let increment_mm = job.path.increment_um / UM_PER_MM;
    job.program.setting(increment_mm, zero_mm(job, length_mm), job.cut.feed_direction, &job.supports)
}

/// Station at which the tool leaves the work before a rest that it is to pass, mm.
pub(super) fn stop_before_mm(job: &Job, length_mm: f64, rest_mm: f64, side: f64) -> f64 {
    let zero = zero_mm(job, length_mm);
    let beside = setting(job, length_mm).beside_z_mm();
    round_to_increment(rest_mm + side * beside - zero, job.path.increment_um / UM_PER_MM) + zero
}

/// Writes the program along the paths of all cuts, and drives it over the blank.
pub(super) fn drawn(job: &Job, grid: &Grid, stages: &[Stage], paths: &[Path]) -> (Drawn, turning::Driven) {
    let setting = setting(job, grid.length_mm);
    let stretches = stretches(job, grid, stages, paths);
    let blank = blank(job, grid, stages);
    let mut work = Work { solvers: stages.iter().map(|stage| stage.line.solver()).collect() };
    let written = turning::write(&setting, &blank, &mut work, Vec::new(), &stretches);
    let driven = turning::drive(&written, &blank, setting.zero_mm, &mut work);
    let limits = Limits {
        clearance_mm: setting.beside_x_mm().min(setting.beside_z_mm()),
        beside_prediction_um: job.path.increment_um + PREDICTED_UM,
    };
    (Drawn { written, limits, stretches, zero_mm: setting.zero_mm }, driven)
}

/// The shaft as it yields in every cut.
struct Work<'a> {
    solvers: Vec<Solver<'a>>,
}

impl Yielding for Work<'_> {
    fn left_mm(&mut self, cut: usize, station: usize, stands_mm: f64, command_mm: f64) -> f64 {
        let start_mm = stands_mm - command_mm;
        stands_mm - self.solvers[cut].engage(station, stands_mm, command_mm, start_mm).depth_mm()
    }
}

/// The blank: the stations of the path, and what is not turned beside them.
fn blank(job: &Job, grid: &Grid, stages: &[Stage]) -> Surface {
    let stock = stages.first().map_or(&[][..], |stage| &stage.radii.stock[..]);
    let mut points: Vec<Point> = Vec::with_capacity(grid.len() + 2 * job.shaft.segments.len());
    let mut covered = 0.0;
    let fill = |points: &mut Vec<Point>, from: f64, to: f64| {
        for (segment, ends) in job.shaft.segments.iter().zip(grid.steps_mm.windows(2)) {
            let (left, right) = (ends[0].max(from), ends[1].min(to));
            if left < right {
                let radius = |z: f64| profile_radius_mm(job, z).unwrap_or(0.5 * segment.stock_mm());
                let rows = job.stock_profile.iter().flat_map(crate::calculator::Measured::rows).map(|row| row.z_mm);
                let inside = rows.filter(|z| left < *z && *z < right);
                let places = std::iter::once(left).chain(inside).chain(std::iter::once(right));
                points.extend(places.map(|z_mm| Point { z_mm, radius_mm: radius(z_mm), station: None }));
            }
        }
    };
    for zone in &grid.zones {
        fill(&mut points, covered, grid.z_mm[zone.first]);
        let stations = zone.first..zone.end;
        points.extend(stations.map(|i| Point { z_mm: grid.z_mm[i], radius_mm: stock[i], station: Some(i) }));
        covered = grid.z_mm[zone.end - 1];
    }
    fill(&mut points, covered, grid.length_mm);
    Surface::new(points)
}

fn profile_radius_mm(job: &Job, z_mm: f64) -> Option<f64> {
    let rows = job.stock_profile.as_ref()?.rows();
    let after = rows.partition_point(|row| row.z_mm < z_mm).clamp(1, rows.len().max(2) - 1);
    let near = &rows[after - 1..(after + 1).min(rows.len())];
    let (z, d): (Vec<f64>, Vec<f64>) = near.iter().map(|row| (row.z_mm, row.diameter_mm)).unzip();
    interpolate(&z, &d, &[z_mm]).first().map(|d| 0.5 * d)
}

/// What is cut in one go, in the order of the program: pass by pass, every zone of a path.
fn stretches(job: &Job, grid: &Grid, stages: &[Stage], paths: &[Path]) -> Vec<Stretch> {
    let increment_mm = job.path.increment_um / UM_PER_MM;
    let side = job.cut.feed_direction.comes_from();
    let rests = job.supports.iter().filter_map(|support| match *support {
        Support::SteadyRest { z_mm, .. } => Some(stop_before_mm(job, grid.length_mm, z_mm, side)),
        _ => None,
    });
    let stops: Vec<f64> = rests.collect();
    let mut all: Vec<Stretch> = Vec::new();
    for (cut, (stage, path)) in stages.iter().zip(paths).enumerate() {
        let mut before: Option<(f64, f64)> = None;
        for (drawing_mm, corners) in corners_in_feed_order(path, stage.regime.direction) {
            let (Some(&(from, _)), Some(&(to, _))) = (corners.first(), corners.last()) else { continue };
            let touches =
                before.is_some_and(|(at, of)| (at - from).abs() <= increment_mm && (of - drawing_mm).abs() <= 0.0);
            let is_stop = stops.iter().any(|stop| (stop - from).abs() <= increment_mm);
            let first = before.is_none() && paths.len() > 1;
            all.push(Stretch {
                goes_on: touches && !is_stop,
                feed_mm_per_rev: stage.regime.feed_mm_per_rev,
                speed: speed(&stage.regime, job),
                cut,
                notes: if first { vec![format!("pass {} of {}", cut + 1, paths.len())] } else { Vec::new() },
                stop: None,
                corners,
            });
            before = Some((to, drawing_mm));
        }
    }
    all
}

fn speed(regime: &Regime, job: &Job) -> turning::Speed {
    match regime.speed {
        Speed::Spindle(rpm) => turning::Speed::Spindle(rpm),
        Speed::Surface(speed) => turning::Speed::Surface(speed, job.program.spindle_limit_rpm),
    }
}

impl Drawn {
    /// Warns of every place where the program feeds the tool in radially, once each with the smallest diameter.
    pub(super) fn plunges(&self, job: &Job) -> Vec<Finding> {
        let increment_mm = job.path.increment_um / UM_PER_MM;
        let mut places: Vec<(f64, f64)> = Vec::new();
        for &(z, x) in self.written.plunges.iter().filter_map(|&k| self.stretches[k].corners.first()) {
            match places.iter_mut().find(|(known, _)| (*known - z).abs() <= increment_mm) {
                Some((_, least)) => *least = least.min(x),
                None => places.push((z, x)),
            }
        }
        let plunge = |(z_mm, diameter_mm): (f64, f64)| {
            Finding::new("plunge_at_shoulder", "/shaft/segments")
                .value(z_mm, "mm")
                .with("z_program_mm", round_to_increment(z_mm - self.zero_mm, increment_mm))
                .with("diameter_mm", diameter_mm)
        };
        places.into_iter().map(plunge).collect()
    }
}

/// Station of the program's zero, mm.
fn zero_mm(job: &Job, length_mm: f64) -> f64 {
    match job.program.zero {
        ProgramZero::RightFace => length_mm,
        ProgramZero::LeftFace => 0.0,
    }
}

/// Drawing diameter of a zone, and station and commanded diameter of its corners.
type Corners = (f64, Vec<(f64, f64)>);

/// The corners of every zone, as the tool passes them.
fn corners_in_feed_order(path: &Path, direction: FeedDirection) -> Vec<Corners> {
    let corners = |zone: &PathZone| zone.z_mm.iter().copied().zip(zone.commanded_diameter_mm.iter().copied()).collect();
    let mut zones: Vec<Corners> = path.zones.iter().map(|zone| (zone.diameter_mm, corners(zone))).collect();
    if direction == FeedDirection::ToHeadstock {
        zones.reverse();
        for (_, corners) in &mut zones {
            corners.reverse();
        }
    }
    zones
}

/// The paths of all passes as a table, in the order of the program: station, drawing's diameter, and the program's X and Z.
pub(super) fn path_table(job: &Job, outcome: &Outcome) -> Table {
    let zero_mm = zero_mm(job, job.shaft.length_mm());
    let increment_mm = job.path.increment_um / UM_PER_MM;
    let of_passes: Vec<&Path> = outcome.passes.iter().filter_map(|pass| pass.path.as_ref()).collect();
    let paths = if of_passes.is_empty() { outcome.path.iter().collect() } else { of_passes };
    let (mut station, mut drawing, mut x, mut z) = (Vec::new(), Vec::new(), Vec::new(), Vec::new());
    for path in paths {
        for (diameter, corners) in corners_in_feed_order(path, job.cut.feed_direction) {
            for (at, commanded) in corners {
                station.push(at);
                drawing.push(diameter);
                x.push(commanded);
                z.push(round_to_increment(at - zero_mm, increment_mm));
            }
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
