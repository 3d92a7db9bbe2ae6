//! The run of a job and what is read off it.

use std::f64::consts::TAU;

use rayon::prelude::*;

use crate::calculator::{Failure, Finding, Message, Monitor, Pace, checkpoint};
use crate::num::roundness::{Grid, Section, least_squares};

use crate::ring_roundness::answer::output::{
    Evaluated, HistoryColumns, PathColumns, ProfileColumns, ReplayOutcome, SimulationOutcome, SpectrumColumns,
    WaveColumn,
};
use crate::ring_roundness::job::input::{ErrorEstimate, Job, Method};
use crate::ring_roundness::job::sampling::{samples_for_teeth, samples_of};
use crate::ring_roundness::model::causes::{causes, switched_off};
use crate::ring_roundness::model::replay::Recorder;
use crate::ring_roundness::model::scene::{Scene, mirrored_rad};
use crate::ring_roundness::model::stance::Stance;
use crate::ring_roundness::model::surface::{Surface, UM_PER_MM, difference, of_radii, of_section, unevaluable};
use crate::ring_roundness::model::turning::plane::{Vec2, angle, direction, norm, scaled, sub};
use crate::ring_roundness::model::turning::{Place, Revolution, Stuck, Turned, turn, turn_sampled};

/// Most entries of the history.
const HISTORY_ENTRIES: f64 = 400.0;
/// Entries of the path.
const PATH_ENTRIES: usize = 360;
/// Highest order followed in the history.
const FOLLOWED: u32 = 7;
/// Errors are stated so many times as large as the larger difference from two runs with other numbers of nodes: the
/// differences do not fall steadily, and one alone can be small by chance.
pub(in crate::ring_roundness) const SAFETY: f64 = 2.0;
/// And at least so many times as large as the surfaces differ (root mean square). With both no error of the roundness was
/// short in 300 random runs at 1800 nodes.
const FORM: f64 = 4.0;
/// A wave below this is nothing, um: rounding of a radius of a metre.
const NOTHING_UM: f64 = 1e-9;
/// Codes of failures.
pub(in crate::ring_roundness) const FAILURE_CODES: &[&str] =
    &["nothing_cut", "ring_falls_in_run", "profile_not_evaluable"];

impl From<Stuck> for Failure {
    fn from(stuck: Stuck) -> Self {
        Self::Infeasible(
            Finding::new("ring_falls_in_run", "/supports/distance_mm")
                .measured(stuck.apart_mm, stuck.reach_mm, "mm")
                .with("revolution", stuck.turned_revolutions),
        )
    }
}

/// Part of a job's progress.
#[derive(Clone, Copy)]
pub(in crate::ring_roundness) struct Share<'a> {
    pub monitor: &'a dyn Monitor,
    pub from: f64,
    pub to: f64,
}

impl<'a> Share<'a> {
    /// The piece from `from` to `to` of this part.
    pub(in crate::ring_roundness) fn part(&self, from: f64, to: f64) -> Share<'a> {
        let at = |share: f64| self.from + share * (self.to - self.from);
        Share { monitor: self.monitor, from: at(from), to: at(to) }
    }

    pub(in crate::ring_roundness) fn report(&self, share: f64, stage: Message) {
        self.monitor.progress((self.from + share.clamp(0.0, 1.0) * (self.to - self.from)).clamp(0.0, 1.0), stage);
    }
}

/// Many runs, as many at once as there are threads. A cancel ends it before any of them looks for it twice.
pub(in crate::ring_roundness) fn side_by_side<T: Sync, R: Send>(
    items: &[T],
    run: impl Fn(&T) -> Result<R, Failure> + Sync,
) -> Result<Vec<R>, Failure> {
    let mut all = Vec::with_capacity(items.len());
    for some in items.chunks(rayon::current_num_threads()) {
        for found in some.par_iter().map(&run).collect::<Vec<_>>() {
            all.push(found?);
        }
    }
    Ok(all)
}

/// `None` for whatever has no answer, but for a cancel.
pub(in crate::ring_roundness) fn or_none<T>(found: Result<T, Failure>) -> Result<Option<T>, Failure> {
    match found {
        Ok(value) => Ok(Some(value)),
        Err(Failure::Cancelled) => Err(Failure::Cancelled),
        Err(_) => Ok(None),
    }
}

/// A run with the surface it leaves, in the body frame of the job.
pub(in crate::ring_roundness) struct Run {
    pub turned: Turned,
    pub surface: Surface,
    pub start: Surface,
    pub uncut_share: f64,
    pub blank_mm: Vec<f64>,
    pub history: HistoryColumns,
    pub replay: Option<ReplayOutcome>,
}

/// Runs the exact method with `n` nodes; `with_history` also follows the surface. Without a share of the progress nothing is
/// reported.
pub(in crate::ring_roundness) fn run_exact(
    job: &Job,
    scene: &Scene,
    n: u32,
    with_history: bool,
    monitor: &dyn Monitor,
    progress: Option<Share<'_>>,
) -> Result<Run, Failure> {
    let total = scene.setting.revolutions + scene.setting.spark_out_revolutions;
    let blank = scene.blank_mm(job, n as usize).map_err(unevaluable)?;
    let grid = Grid::new(n as usize).map_err(unevaluable)?;
    let mut follower = Follower::new(total);
    let frames = if with_history { job.replay_frames } else { 0 };
    follower.recorder = Recorder::new(scene, frames, total);
    let turned = turn::<Failure>(&blank, &scene.setting, &mut |revolution, radii| {
        checkpoint(monitor)?;
        let Some(revolution) = revolution else { return Ok(()) };
        let done = revolution.turned_revolutions;
        if let Some(progress) = &progress {
            progress.report(done / total, stage(done, total));
        }
        if with_history { follower.follow(revolution, radii, &grid, monitor) } else { Ok(()) }
    })?;
    if turned.first_contact_rev.is_none() {
        return Err(Failure::Infeasible(
            Finding::new("nothing_cut", "/tool").value(turned.smallest_gap_mm * UM_PER_MM, "um"),
        ));
    }
    let never = turned.radii_mm.iter().zip(&blank).filter(|(end, start)| end >= start).count();
    let radii = scene.unmirrored(turned.radii_mm.clone());
    let blank_mm = scene.unmirrored(blank);
    Ok(Run {
        surface: of_radii(&radii, job.filter, job.highest_order, monitor)?,
        start: of_radii(&blank_mm, job.filter, job.highest_order, monitor)?,
        uncut_share: never as f64 / f64::from(n),
        turned: Turned { radii_mm: radii, ..turned },
        blank_mm,
        history: follower.columns,
        replay: follower.recorder.map(|recorder| recorder.replay(n as usize)),
    })
}

/// Errors that are stated of a surface, from those with other numbers of nodes. Two values can agree by chance where the
/// surfaces differ: what is read off as far apart as peak and valley is no surer than the form.
pub(in crate::ring_roundness) fn stated_errors(main: &Surface, others: &[(&Surface, f64)]) -> Evaluated {
    let of_values: Vec<(&Evaluated, f64)> = others.iter().map(|(other, factor)| (&other.evaluated, *factor)).collect();
    let mut errors = difference(&main.evaluated, &of_values);
    let apart = |of: fn(&Surface) -> Vec<f64>| {
        let rms = others.iter().filter_map(|(other, _)| rms_apart_um(&of(main), &of(other)));
        FORM * rms.fold(0.0, f64::max)
    };
    let (filtered, unfiltered) = (apart(Surface::filtered_um), apart(Surface::deviations_um));
    for (circles, least) in [(&mut errors.filtered, filtered), (&mut errors.unfiltered, unfiltered)] {
        for value in [
            &mut circles.least_squares_um,
            &mut circles.minimum_zone_um,
            &mut circles.inscribed_um,
            &mut circles.circumscribed_um,
            &mut circles.peak_um,
            &mut circles.valley_um,
        ] {
            *value = value.max(least);
        }
    }
    errors
}

/// Root mean square of the difference of two surfaces about their circles, one with a multiple of the other's nodes.
fn rms_apart_um(p: &[f64], q: &[f64]) -> Option<f64> {
    let (fine, coarse) = if p.len() >= q.len() { (p, q) } else { (q, p) };
    let every = fine.len() / coarse.len();
    let squares: f64 = coarse.iter().enumerate().map(|(i, value)| (fine[i * every] - value).powi(2)).sum();
    (every * coarse.len() == fine.len()).then(|| (squares / coarse.len() as f64).sqrt())
}

fn stage(done: f64, total: f64) -> Message {
    Message::new("stage_revolution").with("revolution", done.ceil()).with("of", total.ceil())
}

/// Follows the surface revolution by revolution.
struct Follower<'s> {
    columns: HistoryColumns,
    recorder: Option<Recorder<'s>>,
    every: u64,
    seen: u64,
    total: f64,
    deepest_mm: f64,
    cutting: f64,
    since: f64,
}

impl Follower<'_> {
    fn new(total: f64) -> Self {
        let waves = (2..=FOLLOWED).map(|order| WaveColumn { order, amplitude_um: Vec::new() }).collect();
        Self {
            columns: HistoryColumns { waves, ..HistoryColumns::default() },
            recorder: None,
            every: every(total),
            seen: 0,
            total,
            deepest_mm: 0.0,
            cutting: 0.0,
            since: 0.0,
        }
    }

    fn follow(
        &mut self,
        revolution: &Revolution,
        radii: &[f64],
        grid: &Grid,
        monitor: &dyn Monitor,
    ) -> Result<(), Failure> {
        self.seen += 1;
        self.deepest_mm = self.deepest_mm.max(revolution.deepest_cut_mm);
        self.cutting += revolution.cutting_share;
        self.since += 1.0;
        let last = revolution.turned_revolutions > self.total - 1.5 / radii.len() as f64;
        if let Some(recorder) = &mut self.recorder {
            recorder.see((self.seen, last), revolution.turned_revolutions, radii, grid)?;
        }
        if !self.seen.is_multiple_of(self.every) && !last {
            return Ok(());
        }
        let section = grid.section(radii).map_err(unevaluable)?;
        let circle = least_squares(&section, &|| !monitor.cancelled()).map_err(unevaluable)?;
        let columns = &mut self.columns;
        columns.revolution.push(revolution.turned_revolutions);
        columns.roundness_um.push(circle.span.width_mm() * UM_PER_MM);
        columns.mean_radius_mm.push(circle.circle.radius_mm);
        columns.deepest_cut_um.push(std::mem::take(&mut self.deepest_mm) * UM_PER_MM);
        columns.cutting_share.push(std::mem::take(&mut self.cutting) / std::mem::take(&mut self.since));
        // About the body's origin: the eccentricity enters the waves from 2 on in second order only.
        let spectrum = grid.spectrum(radii, FOLLOWED as usize).map_err(unevaluable)?;
        for wave in &mut columns.waves {
            let found = spectrum.iter().find(|harmonic| harmonic.order == wave.order as usize);
            wave.amplitude_um.push(found.map_or(0.0, |harmonic| harmonic.amplitude_mm * UM_PER_MM));
        }
        Ok(())
    }
}

#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "revolutions below 1e8")]
fn every(total: f64) -> u64 {
    (total / HISTORY_ENTRIES).ceil().max(1.0) as u64
}

/// The analysis `simulation`.
pub(in crate::ring_roundness) fn simulate(
    job: &Job,
    scene: &Scene,
    end: &Stance,
    share: Share<'_>,
) -> Result<SimulationOutcome, Failure> {
    match job.method {
        Method::ExactContact => exact(job, scene, end, share),
        Method::NearestSamples => nearest(job, scene, end, share),
    }
}

fn exact(job: &Job, scene: &Scene, end: &Stance, share: Share<'_>) -> Result<SimulationOutcome, Failure> {
    let n = samples_of(job);
    let (beside, factor, third) = match job.error_estimate {
        ErrorEstimate::HalfSamples => (n / 2, SAFETY, n / 3),
        ErrorEstimate::DoubleSamples => (2 * n, 2.0 * SAFETY, n / 2),
    };
    let third = third.next_multiple_of(4);
    let monitor = share.monitor;
    let without_progress = |n: u32| run_exact(job, scene, n, false, monitor, None);
    let (main, (others, switched_off)) = rayon::join(
        || run_exact(job, scene, n, true, monitor, Some(share.part(0.0, 1.0))),
        || {
            rayon::join(
                || Ok::<_, Failure>((without_progress(beside)?, without_progress(third)?)),
                || switched_off(job, scene, end, monitor),
            )
        },
    );
    let (main, (other, third), switched_off) = (main?, others?, switched_off?);
    checkpoint(monitor)?;
    let others = [(&other.surface, factor), (&third.surface, SAFETY)];
    let error = stated_errors(&main.surface, &others);
    let um = |mm: f64| mm * UM_PER_MM;
    Ok(SimulationOutcome {
        samples: n,
        samples_beside: beside,
        samples_for_teeth: samples_for_teeth(job),
        start: main.start.evaluated.clone(),
        end: Some(main.surface.evaluated.clone()),
        end_error: Some(error),
        size_error_um: Some(um(main.surface.evaluated.mean_radius_mm - end.radius_mm)),
        largest_bite_um: Some(um(main.turned.largest_bite_mm)),
        first_contact_rev: main.turned.first_contact_rev,
        last_air_cut_rev: main.turned.last_air_cut_rev,
        uncut_share: main.uncut_share,
        location_error_um: um(main.turned.unmet_mm),
        causes: causes(job, scene, end, &main, switched_off, monitor)?,
        spectrum: spectrum(job, &main.start, Some((&main.surface, others.as_slice()))),
        profile: profile(job, &main.blank_mm, &main.start, Some((&main.turned.radii_mm, &main.surface))),
        centre_path: path(&main.turned.path, scene.mirrored),
        history: main.history,
        replay: main.replay,
        exact_contact: None,
    })
}

/// The paper's algorithm with the exact run beside it.
fn nearest(job: &Job, scene: &Scene, end: &Stance, share: Share<'_>) -> Result<SimulationOutcome, Failure> {
    let n = samples_of(job);
    let beside = crate::ring_roundness::job::input::DEFAULT_SAMPLES;
    let exact = run_exact(job, scene, beside, false, share.monitor, Some(share.part(0.0, 0.4)))?;
    let points = sampled_blank(job, scene, n as usize)?;
    let total = scene.setting.revolutions + scene.setting.spark_out_revolutions;
    let part = share.part(0.4, 1.0);
    let mut pace = Pace::new(share.monitor);
    let mut after = |revolution: &Revolution| {
        checkpoint(share.monitor)?;
        let done = revolution.turned_revolutions;
        part.report(done / total, stage(done, total));
        Ok(())
    };
    let sampled = turn_sampled::<Failure>(&points, &scene.setting, &mut after, &mut |done| pace.work(done))?;
    let flip = |p: &Vec2| if scene.mirrored { [-p[0], p[1]] } else { *p };
    let surface = if sampled.torn {
        None
    } else {
        let mut points: Vec<Vec2> = sampled.points_mm.iter().map(flip).collect();
        let section = section_of(&points)?;
        let centre = least_squares(&section, &|| !share.monitor.cancelled()).map_err(unevaluable)?.circle.centre_mm;
        points.sort_by(|p, q| angle(sub(*p, centre)).total_cmp(&angle(sub(*q, centre))));
        points.dedup_by(|p, q| angle(sub(*p, centre)) <= angle(sub(*q, centre)));
        let grid = Grid::new(n as usize).map_err(unevaluable)?;
        or_none(of_section(&section_of(&points)?, &grid, job.filter, job.highest_order.min(n / 2), share.monitor))?
    };
    let start = of_radii(
        &scene.unmirrored(scene.blank_mm(job, n as usize).map_err(unevaluable)?),
        job.filter,
        job.highest_order.min(n / 2),
        share.monitor,
    )?;
    let blank_mm = scene.unmirrored(scene.blank_mm(job, n as usize).map_err(unevaluable)?);
    let radii_mm: Option<Vec<f64>> = surface.as_ref().map(|surface| surface.evaluation.referred_mm.clone());
    let error = surface.as_ref().map(|surface| difference(&surface.evaluated, &[(&exact.surface.evaluated, 1.0)]));
    let beside_it = [(&exact.surface, 1.0)];
    let both = surface.as_ref().map(|surface| (surface, beside_it.as_slice()));
    let after = radii_mm.as_ref().zip(surface.as_ref());
    Ok(SimulationOutcome {
        samples: n,
        samples_beside: beside,
        samples_for_teeth: samples_for_teeth(job),
        start: start.evaluated.clone(),
        end_error: error,
        size_error_um: surface.as_ref().map(|s| (s.evaluated.mean_radius_mm - end.radius_mm) * UM_PER_MM),
        largest_bite_um: None,
        first_contact_rev: None,
        last_air_cut_rev: None,
        uncut_share: 0.0,
        location_error_um: 0.0,
        causes: causes(job, scene, end, &exact, switched_off(job, scene, end, share.monitor)?, share.monitor)?,
        spectrum: spectrum(job, &start, both),
        profile: profile(job, &blank_mm, &start, after),
        centre_path: PathColumns::default(),
        history: HistoryColumns::default(),
        replay: None,
        exact_contact: Some(exact.surface.evaluated.clone()),
        end: surface.map(|surface| surface.evaluated),
    })
}

fn section_of(points: &[Vec2]) -> Result<Section, Failure> {
    let (x, y): (Vec<f64>, Vec<f64>) = points.iter().map(|p| (p[0], p[1])).unzip();
    Section::from_points(&x, &y).map_err(unevaluable)
}

/// The points of the paper: a bare ellipse by its parameter, any other profile by uniform angles; in the kernel's frame.
fn sampled_blank(job: &Job, scene: &Scene, n: usize) -> Result<Vec<Vec2>, Failure> {
    if let (Some(ring), None) = (&job.ring, &job.measured_profile)
        && ring.harmonics.is_empty()
    {
        let (long, short) = (ring.radius_mm + 0.5 * ring.ellipticity_mm, ring.radius_mm - 0.5 * ring.ellipticity_mm);
        let axis = direction(mirrored_rad(ring.major_axis_deg.to_radians(), scene.mirrored));
        return Ok((0..n)
            .map(|i| {
                let t = TAU * i as f64 / n as f64;
                let (along, across) = (long * t.cos(), short * t.sin());
                [along * axis[0] - across * axis[1], along * axis[1] + across * axis[0]]
            })
            .collect());
    }
    let radii = scene.blank_mm(job, n).map_err(unevaluable)?;
    Ok(radii.iter().enumerate().map(|(i, r)| scaled(direction(TAU * i as f64 / n as f64), *r)).collect())
}

fn spectrum(job: &Job, start: &Surface, end: Option<(&Surface, &[(&Surface, f64)])>) -> SpectrumColumns {
    let mut columns = SpectrumColumns::default();
    for order in 2..=job.highest_order {
        let Some(before) = start.harmonic(order) else { break };
        let found = end.and_then(|(end, others)| {
            let after = end.harmonic(order)?;
            // A wave that fewer nodes cannot hold is all error there.
            let off = |(other, factor): &(&Surface, f64)| {
                factor * (after.amplitude_mm - other.harmonic(order).map_or(0.0, |wave| wave.amplitude_mm)).abs()
            };
            Some((after, others.iter().map(off).fold(0.0, f64::max)))
        });
        let Some((after, error)) = found else { break };
        let start_um = before.amplitude_mm * UM_PER_MM;
        columns.order.push(order);
        columns.start_um.push(start_um);
        columns.end_um.push(after.amplitude_mm * UM_PER_MM);
        columns.end_error_um.push(error * UM_PER_MM);
        columns.end_angle_of_max_deg.push(after.angle_of_max_rad.to_degrees());
        columns.ratio.push((start_um > NOTHING_UM).then(|| after.amplitude_mm * UM_PER_MM / start_um));
    }
    columns
}

fn profile(job: &Job, blank_mm: &[f64], start: &Surface, end: Option<(&Vec<f64>, &Surface)>) -> ProfileColumns {
    let n = blank_mm.len();
    let m = (job.profile_points as usize).min(n);
    let pick = |values: &[f64]| (0..m).map(|i| values[i * n / m]).collect::<Vec<f64>>();
    ProfileColumns {
        angle_deg: (0..m).map(|i| 360.0 * (i * n / m) as f64 / n as f64).collect(),
        start_radius_mm: pick(blank_mm),
        end_radius_mm: end.map_or_else(Vec::new, |(radii, _)| pick(radii)),
        start_deviation_um: pick(&start.deviations_um()),
        end_deviation_um: end.map_or_else(Vec::new, |(_, surface)| pick(&surface.deviations_um())),
        end_filtered_um: end.map_or_else(Vec::new, |(_, surface)| pick(&surface.filtered_um())),
    }
}

fn path(places: &[Place], mirrored: bool) -> PathColumns {
    let count = places.len();
    let mut columns = PathColumns::default();
    if count == 0 {
        return columns;
    }
    let mean = |axis: usize| places.iter().map(|place| place.centre_mm[axis]).sum::<f64>() / count as f64;
    let (x, y) = (mean(0), mean(1));
    let m = PATH_ENTRIES.min(count);
    for i in 0..m {
        let place = places[i * count / m];
        let sign = if mirrored { -1.0 } else { 1.0 };
        columns.revolution.push(place.turned_rad / TAU);
        columns.x_um.push(sign * (place.centre_mm[0] - x) * UM_PER_MM);
        columns.y_um.push((place.centre_mm[1] - y) * UM_PER_MM);
    }
    columns
}

/// Distance of the tip from the blank at rest, mm, negative inside.
pub(in crate::ring_roundness) fn gap_at_start_mm(job: &Job, scene: &Scene) -> Result<f64, Failure> {
    let blank =
        scene.blank_mm(job, crate::ring_roundness::job::input::DEFAULT_SAMPLES as usize).map_err(unevaluable)?;
    let centre = crate::ring_roundness::model::turning::centre_at_rest_mm(&blank, &scene.setting)?;
    let to_tip = sub(scene.setting.tip_start_mm, centre);
    let n = blank.len();
    let at = angle(to_tip).rem_euclid(TAU) / TAU * n as f64;
    let (below, share) = below(at);
    let radius = blank[below % n] * (1.0 - share) + blank[(below + 1) % n] * share;
    Ok(norm(to_tip) - radius)
}

#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a position between nodes, 0 to n")]
fn below(position: f64) -> (usize, f64) {
    let floor = position.floor();
    (floor as usize, position - floor)
}
