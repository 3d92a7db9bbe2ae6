//! The commanded path in the fewest straight moves.

use crate::calculator::{Failure, Monitor};
use crate::path::{round_to_increment, simplified};

use crate::deflection_compensation::answer::output::{Path, PathZone, StatusCompensated};
use crate::deflection_compensation::job::grid::{Grid, Zone, interpolate};
use crate::deflection_compensation::job::input::Job;
use crate::deflection_compensation::model::stage::Stage;

const UM_PER_MM: f64 = 1e3;
/// Chord tolerance where the job states neither it nor a tolerance of form, um on the radius.
const DEFAULT_CHORD_UM: f64 = 1.0;
/// Share of the form tolerance that the chords may use up.
const CHORD_SHARE: f64 = 0.1;

/// The path and, per station, the radius that it really commands.
pub(in crate::deflection_compensation) struct Programmed {
    pub path: Path,
    /// Commanded radius of the rounded moves, mm; `None` outside them.
    pub command_mm: Vec<Option<f64>>,
}

/// Largest radial deviation that the chords may have, um.
pub(in crate::deflection_compensation) fn chord_tolerance_um(job: &Job) -> f64 {
    job.path.chord_tolerance_um.unwrap_or_else(|| {
        // The form tolerance is on the diameter, the chord's deviation on the radius.
        job.tolerance.form_um.map_or(DEFAULT_CHORD_UM, |form| (CHORD_SHARE * form).max(job.path.increment_um) / 2.0)
    })
}

/// Cuts the commands of a cut into the fewest straight moves, zone by zone: never across a shoulder, nor where they jump.
pub(in crate::deflection_compensation) fn programmed(
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
