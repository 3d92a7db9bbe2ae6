//! Where the turned shaft itself is at its limits: whirl, walls too thin for a beam, shoulders that the edge runs into,
//! and a tolerance narrower than what is known.

use std::f64::consts::{PI, SQRT_2};

use crate::calculator::{Failure, Finding};
use crate::num::beam::{BeamError, area_mm2};
use crate::turning::{EDGE_MEETS_SHOULDER, Finished, edge_meets_shoulders};

use crate::deflection_compensation::answer::output::Outcome;
use crate::deflection_compensation::job::grid::Grid;
use crate::deflection_compensation::job::input::{Job, Segment};
use crate::deflection_compensation::model::regime::{Speed, spindle_speed_rpm};
use crate::deflection_compensation::model::stage::Stage;

/// Pieces of the shaft whose masses whirl; the frequency of a uniform one is missed by less than a hundredth.
const MASSES: usize = 24;
/// Rounds of the power iteration; the second frequency lies well above the first, so that each gains a digit or more.
const ROUNDS: usize = 60;
const M_PER_MM: f64 = 1e-3;
/// kg/m³ mm³ = 1e-9 kg.
const KG: f64 = 1e-9;
/// Share of the critical speed at which the bow of a shaft is doubled: 1/(1 - 1/2) = 2.
const BOW_DOUBLED: f64 = 1.0 / SQRT_2;
/// A wall is thin where the shell yields more than this share of the beam.
const SHELL_SHARE: f64 = 0.1;
/// Mean radius over wall from which on a tube is a shell.
const THIN: f64 = 5.0;
/// Standard deviations on either side.
const DEVIATIONS: f64 = 2.0;

/// Codes of the warnings made here.
pub(in crate::deflection_compensation) const WARNING_CODES: &[&str] =
    &["near_critical_speed", "thin_wall", EDGE_MEETS_SHOULDER, "uncertainty_exceeds_tolerance"];

/// First critical speed of the held shaft in bending, rev/min: masses on the flexibility of the finished shaft on its
/// bilateral supports, largest eigenvalue by power iteration. A rest that travels or bears on one side holds nothing here.
pub(in crate::deflection_compensation) fn critical_speed_rpm(job: &Job, stage: &Stage) -> Result<Option<f64>, Failure> {
    let ends_mm = job.shaft.ends_mm();
    let length_mm = job.shaft.length_mm();
    let piece_mm = length_mm / MASSES as f64;
    let edges_mm: Vec<f64> = (0..=MASSES).map(|k| piece_mm * k as f64).collect();
    let middles_mm: Vec<f64> = edges_mm.windows(2).map(|pair| 0.5 * (pair[0] + pair[1])).collect();
    let mass_kg = |from: f64, to: f64| {
        let of = |(segment, ends): (&Segment, &[f64])| {
            let inside = (to.min(ends[1]) - from.max(ends[0])).max(0.0);
            inside * area_mm2(segment.diameter_mm, segment.bore_diameter_mm)
        };
        job.shaft.density() * KG * job.shaft.segments.iter().zip(ends_mm.windows(2)).map(of).sum::<f64>()
    };
    let masses: Vec<f64> = edges_mm.windows(2).map(|pair| mass_kg(pair[0], pair[1])).collect();
    let rows = middles_mm.iter().map(|z| stage.structure.beam.influence(*z, &middles_mm, None));
    let rows: Vec<Vec<f64>> = match rows.collect::<Result<_, _>>() {
        Ok(rows) => rows,
        Err(BeamError::Unstable) => return Ok(None),
        Err(error) => return Err(Failure::Internal(format!("the held shaft has no flexibility: {error}"))),
    };
    let mut shape = vec![1.0; MASSES];
    let mut largest = 0.0_f64;
    for _ in 0..ROUNDS {
        let moved: Vec<f64> = rows
            .iter()
            .map(|row| row.iter().zip(&masses).zip(&shape).map(|((w, m), s)| w * M_PER_MM * m * s).sum())
            .collect();
        largest = moved.iter().fold(0.0, |most: f64, s| most.max(s.abs()));
        if largest <= 0.0 {
            return Ok(None);
        }
        shape = moved.into_iter().map(|s| s / largest).collect();
    }
    let rad_per_s = largest.sqrt().recip();
    Ok(Some(rad_per_s * 60.0 / (2.0 * PI)).filter(|rpm| rpm.is_finite()))
}

/// Everything that is warned of here.
pub(in crate::deflection_compensation) fn warnings(
    job: &Job,
    grid: &Grid,
    stage: &Stage,
    outcome: &Outcome,
    uncertainty_um: &[f64],
) -> Vec<Finding> {
    let mut found: Vec<Finding> = whirl(job, stage, outcome).into_iter().collect();
    found.extend(thin_walls(job, grid, stage));
    if outcome.path.is_some() {
        found.extend(shoulders(job, stage));
        found.extend(wide(job, uncertainty_um));
    }
    found
}

/// A spindle speed at which the bow of the shaft is doubled, or more.
fn whirl(job: &Job, stage: &Stage, outcome: &Outcome) -> Option<Finding> {
    let critical_rpm = outcome.critical_speed_rpm?;
    let (speed_rpm, pointer) = fastest_rpm(job, stage)?;
    let limit_rpm = BOW_DOUBLED * critical_rpm;
    (speed_rpm > limit_rpm).then(|| {
        Finding::new("near_critical_speed", pointer)
            .measured(speed_rpm, limit_rpm, "rev/min")
            .with("critical_rpm", critical_rpm)
            .with("share", speed_rpm / critical_rpm)
    })
}

/// The fastest that the spindle turns while something is cut, and the field that says so.
fn fastest_rpm(job: &Job, stage: &Stage) -> Option<(f64, &'static str)> {
    let surface = match stage.regime.speed {
        Speed::Spindle(rpm) => return Some((rpm, "/cut/spindle_speed_rpm")),
        Speed::Surface(speed) => speed,
    };
    let cut = stage.radii.planned().iter().zip(&stage.radii.target).filter(|(planned, target)| planned > target);
    let thinnest_mm = cut.map(|(_, target)| 2.0 * target).reduce(f64::min)?;
    Some((spindle_speed_rpm(surface, thinnest_mm).min(job.program.spindle_limit_rpm), "/cut/speed_m_per_min"))
}

/// What a long thin tube yields under a radial point load beside its bending as a beam, mm/N: every wave round it a beam on
/// an elastic foundation (circumferential bending against axial stretching, Vlasov's semi-membrane shell), summed over
/// all waves from the second on: 0.813/(2 pi) R³/D sqrt(t/(R³ sqrt(48 (1-nu²)))), D = E t³/(12 (1-nu²)).
fn shell_mm_per_n(job: &Job, radius_mm: f64, wall_mm: f64) -> f64 {
    let (e, nu) = (job.shaft.modulus(), job.shaft.poisson());
    let free = 1.0 - nu * nu;
    let plate = e * wall_mm.powi(3) / (12.0 * free);
    let cube = radius_mm.powi(3);
    WAVES / (2.0 * PI) * cube / plate * (wall_mm / (cube * (48.0 * free).sqrt())).sqrt()
}

/// Sum of n (n² - 1)^(-3/2) over the waves n = 2, 3, ...
const WAVES: f64 = 0.813_2;

/// Bored segments that give way as a shell under the tool: the beam does not know of it.
fn thin_walls(job: &Job, grid: &Grid, stage: &Stage) -> Vec<Finding> {
    let mut softest = vec![0.0_f64; job.shaft.segments.len()];
    for (i, segment) in grid.segment.iter().enumerate() {
        if stage.cut.nominal_depth_mm[i] > 0.0 {
            softest[*segment] = softest[*segment].max(stage.line.compliance_mm_per_n(i));
        }
    }
    let bored = job.shaft.segments.iter().zip(softest).enumerate();
    bored.filter_map(|(i, (segment, beam_mm_per_n))| thin_wall(job, i, segment, beam_mm_per_n)).collect()
}

fn thin_wall(job: &Job, index: usize, segment: &Segment, beam_mm_per_n: f64) -> Option<Finding> {
    let wall_mm = (segment.diameter_mm - segment.bore_diameter_mm) / 2.0;
    let radius_mm = (segment.diameter_mm - wall_mm) / 2.0;
    if segment.bore_diameter_mm <= 0.0 || radius_mm < THIN * wall_mm || beam_mm_per_n <= 0.0 {
        return None;
    }
    let shell = shell_mm_per_n(job, radius_mm, wall_mm);
    let share = shell / beam_mm_per_n;
    (share > SHELL_SHARE).then(|| {
        // At nearly the same radius the shell yields as the wall to the power -5/2, a beam of it as 1/wall.
        let enough_mm = (wall_mm * (share / SHELL_SHARE).powf(2.0 / 3.0)).min(segment.diameter_mm / (2.0 * THIN + 1.0));
        Finding::new("thin_wall", format!("/shaft/segments/{index}/bore_diameter_mm"))
            .measured(wall_mm, enough_mm, "mm")
            .with("shell_um_per_n", shell / M_PER_MM)
            .with("beam_um_per_n", beam_mm_per_n / M_PER_MM)
            .with("share", share)
    })
}

/// Shoulders that the edge runs into.
fn shoulders(job: &Job, stage: &Stage) -> Vec<Finding> {
    let ends_mm = job.shaft.ends_mm();
    let finished: Vec<Finished> = job
        .shaft
        .segments
        .iter()
        .zip(&ends_mm[1..])
        .map(|(segment, &to_mm)| Finished {
            to_mm,
            diameter_mm: segment.diameter_mm,
            is_turned: job.stock_profile.is_some() || segment.stock_mm() > segment.diameter_mm,
        })
        .collect();
    let angle_deg = job.force.cutting_edge_angle_deg();
    edge_meets_shoulders(angle_deg, "/force/cutting_edge_angle_deg", stage.regime.direction, &finished)
}

/// Tolerances that two standard deviations of what is known do not fit into: of size to one side; of form by how much the
/// uncertainty differs along the shaft, since what is the same everywhere moves the size alone.
fn wide(job: &Job, uncertainty_um: &[f64]) -> Vec<Finding> {
    let (least, most) = uncertainty_um.iter().fold((f64::INFINITY, 0.0_f64), |(a, b), u| (a.min(*u), b.max(*u)));
    let judged = |pointer, deviation_um: f64, allowed_um: Option<f64>| {
        let allowed_um = allowed_um?;
        (DEVIATIONS * deviation_um > allowed_um).then(|| {
            Finding::new("uncertainty_exceeds_tolerance", pointer).measured(DEVIATIONS * deviation_um, allowed_um, "um")
        })
    };
    [
        judged("/tolerance/form_um", most - least, job.tolerance.form_um),
        judged(job.tolerance.size_pointer().unwrap_or("/tolerance"), most, job.tolerance.size().half_width_um()),
    ]
    .into_iter()
    .flatten()
    .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_sum_over_all_waves_is_that_of_its_terms() {
        let term = |n: f64| n * (n * n - 1.0).powf(-1.5);
        let last = 100_000;
        // What lies beyond behaves as 1/n².
        let sum: f64 = (2..=last).map(|n| term(f64::from(n))).sum::<f64>() + 1.0 / (f64::from(last) + 0.5);
        assert!((sum - WAVES).abs() < 5e-5, "{sum}");
    }
}
