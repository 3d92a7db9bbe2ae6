//! The commanded path in straight moves, and the program that drives it.

use crate::calculator::{Column, Failure, Finding, Program, Table, Unwatched};
use crate::path::round_to_increment;
use crate::turning::{self, Limits, Point, Stretch, Surface, Written, Yielding};

use crate::deflection_compensation::answer::auto;
use crate::deflection_compensation::answer::driven::drive;
use crate::deflection_compensation::answer::output::{Outcome, Path, PathZone, StatusCompensated};
use crate::deflection_compensation::job::acting::Acting;
use crate::deflection_compensation::job::encounters::hit_chuck;
use crate::deflection_compensation::job::grid::{Grid, interpolate};
use crate::deflection_compensation::job::input::{FeedDirection, Job, Support};
use crate::deflection_compensation::job::writing::{setting, stop_before_mm, zero_mm};
use crate::deflection_compensation::model::regime::{Regime, Speed};
use crate::deflection_compensation::model::stage::Stage;
use crate::deflection_compensation::model::yielding::Solver;

const UM_PER_MM: f64 = 1e3;
/// Beside the increment, a program may be so far from the prediction: rounding of what both compute, um.
const PREDICTED_UM: f64 = 0.1;

/// The program of all cuts; none for a path with gaps, none that would take the tool through a chuck, and none that was
/// not seen to do what the answer says.
pub(in crate::deflection_compensation) fn program(job: &Job, outcome: &Outcome) -> Result<Program, Failure> {
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
pub(in crate::deflection_compensation) struct Drawn {
    pub written: Written,
    pub limits: Limits,
    stretches: Vec<Stretch>,
    zero_mm: f64,
}

/// Writes the program along the paths of all cuts, and drives it over the blank.
pub(in crate::deflection_compensation) fn drawn(
    job: &Job,
    grid: &Grid,
    stages: &[Stage],
    paths: &[Path],
) -> (Drawn, turning::Driven) {
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
    pub(in crate::deflection_compensation) fn plunges(&self, job: &Job) -> Vec<Finding> {
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
pub(in crate::deflection_compensation) fn path_table(job: &Job, outcome: &Outcome) -> Table {
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
