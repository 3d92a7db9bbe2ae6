//! From the points to the answer.

use crate::calculator::{Failure, Finding, Message, Monitor, Quiet, checkpoint};
use crate::num::roundness::{
    Circles, Evaluation, Filter, Grid, PeriodicSpline, RoundnessError, circles, evaluate, refer,
};

use super::input::{Job, ReferenceCircle, RoundnessFilter, SpikeTreatment};
use super::output::{
    ContactKind, OtherCircle, Outcome, RoundnessCircle, RoundnessCircles, RoundnessContact, RoundnessData,
    RoundnessProfile, RoundnessProof, RoundnessSpectrum,
};
use super::readings::Readings;

const UM_PER_MM: f64 = 1e3;
/// Angles are uniform when they differ from uniform ones by less than this share of a step: printed decimals.
const UNIFORM: f64 = 1e-3;
/// How many times as densely the profile is read to see peaks between the points.
const DENSER: usize = 4;
/// A spline of the third degree errs with the fourth power of the step.
const ERROR_RATIO_OF_DOUBLE_STEP: f64 = 16.0;

/// Fewest points of which every second one still makes a spline.
const LEAST_FOR_HALF: usize = 6;

/// Codes of a faultless job without answer.
pub(super) const FAILURE_CODES: &[&str] = &["not_star_shaped", "points_without_circle"];

/// Everything of a checked and filled job.
pub(in crate::ring_roundness) fn outcome(job: &Job, monitor: &dyn Monitor) -> Result<Outcome, Failure> {
    checkpoint(monitor)?;
    monitor.progress(0.0, Message::new("stage_circles"));
    let goes_on = || !monitor.cancelled();
    let readings = Readings::of(job, &goes_on).map_err(|error| failure(error, None))?;
    let mut outcome = of_readings(job, &readings, monitor)?;
    if job.spikes == SpikeTreatment::Keep && !readings.spikes.is_empty() {
        // What would come without them is tried, not guessed.
        let without = Job { spikes: SpikeTreatment::Remove, ..job.clone() };
        let readings = Readings::of(&without, &goes_on).map_err(|error| failure(error, None))?;
        outcome.data.roundness_without_spikes_um =
            of_readings(&without, &readings, &Quiet(monitor)).ok().map(|without| without.roundness_um);
        checkpoint(monitor)?;
    }
    monitor.progress(1.0, Message::new("stage_done"));
    Ok(outcome)
}

fn of_readings(job: &Job, readings: &Readings, monitor: &dyn Monitor) -> Result<Outcome, Failure> {
    if readings.is_closed() { curve(job, readings, monitor) } else { scattered(job, readings, monitor) }
}

/// Points through which a curve can be laid: everything.
fn curve(job: &Job, readings: &Readings, monitor: &dyn Monitor) -> Result<Outcome, Failure> {
    let n = job.profile_points.map_or(readings.section.len(), |points| usize::try_from(points).unwrap_or(usize::MAX));
    let fail = |error| failure(error, Some(readings));
    let (grid, fine) = (Grid::new(n).map_err(fail)?, Grid::new(DENSER * n).map_err(fail)?);
    let highest = usize::try_from(job.highest_harmonic).unwrap_or(usize::MAX);
    // Two points per wave at least.
    let told = number(readings.section.len().min(n)) / 2.0;
    let applies = job.filter.highest_cutoff().is_none_or(|(cutoff, _)| cutoff <= told);
    let filter = if applies { job.filter.filter() } else { Filter::None };
    let goes_on = || !monitor.cancelled();
    let found = evaluate(&readings.section, &grid, filter, n / 2, &goes_on).map_err(fail)?;
    checkpoint(monitor)?;
    monitor.progress(0.5, Message::new("stage_denser"));
    let centre = found.unfiltered.least_squares.circle.centre_mm;
    let denser = refer(&readings.section, centre, DENSER * n).map_err(fail)?;
    checkpoint(monitor)?;
    let measured_denser = circles(&fine.section(&denser).map_err(fail)?, &goes_on).map_err(fail)?;
    let filtered = grid.resampled(&found.referred_mm, filter, &fine).map_err(fail)?;
    checkpoint(monitor)?;
    let filtered_denser = circles(&fine.section(&filtered).map_err(fail)?, &goes_on).map_err(fail)?;
    checkpoint(monitor)?;
    let rows = |index: usize| row_contact(readings, index);
    let step_deg = 360.0 / number(n);
    let places =
        |index: usize| RoundnessContact { kind: ContactKind::Peak, angle_deg: step_deg * number(index), row: None };
    let measured = circles_out(&found.unfiltered, Some(&measured_denser), &rows);
    let filtered = circles_out(&found.filtered, Some(&filtered_denser), &places);
    let judged = judged(job, applies, &measured, &filtered);
    Ok(Outcome {
        roundness_um: judged.ront_um,
        numerical_error_um: judged.numerical_error_um.max(UM_PER_MM * numerical_error_mm(&found)),
        data: RoundnessData { filter_applied: applies, ..data(job, readings, &found)? },
        measured,
        filtered,
        profile: profile(&found),
        spectrum: spectrum(&found, highest, filter),
    })
}

/// Points with a gap that a curve would have to invent: an arc, a keyway, a few touches. Circles of the points alone.
fn scattered(job: &Job, readings: &Readings, monitor: &dyn Monitor) -> Result<Outcome, Failure> {
    let found = circles(&readings.section, &|| !monitor.cancelled()).map_err(|error| failure(error, Some(readings)))?;
    let measured = circles_out(&found, None, &|index| row_contact(readings, index));
    let mut filtered = measured.clone();
    let [x, y] = found.least_squares.circle.centre_mm;
    for circle in filtered.all_mut() {
        circle.centre_x_mm -= x;
        circle.centre_y_mm -= y;
    }
    let radius_mm = found.least_squares.circle.radius_mm;
    let off = readings.section.distances_mm([x, y]).into_iter().map(|mm| UM_PER_MM * (mm - radius_mm));
    let mut places: Vec<(f64, f64)> = readings.angles_deg.iter().copied().zip(off).collect();
    places.sort_by(|a, b| a.0.total_cmp(&b.0));
    let (angle_deg, deviation_um): (Vec<f64>, Vec<f64>) = places.into_iter().unzip();
    let judged = of_reference(&measured, job.reference);
    Ok(Outcome {
        roundness_um: judged.ront_um,
        numerical_error_um: judged.numerical_error_um,
        data: RoundnessData {
            points: readings.section.len(),
            largest_gap_deg: readings.largest_gap.0,
            uniform: false,
            eccentricity_mm: x.hypot(y),
            eccentricity_angle_deg: y.atan2(x).to_degrees().rem_euclid(360.0),
            filter_applied: job.filter == (RoundnessFilter::None {}),
            repairs: readings.repairs.clone(),
            spikes: readings.spikes.clone(),
            roundness_without_spikes_um: None,
            interpolation_error_um: 0.0,
            aliasing_um: 0.0,
        },
        measured,
        filtered,
        profile: RoundnessProfile {
            angle_deg,
            filtered_deviation_um: deviation_um.clone(),
            radial_deviation_um: deviation_um,
        },
        spectrum: RoundnessSpectrum::default(),
    })
}

/// A point of the job's table as a contact.
fn row_contact(readings: &Readings, index: usize) -> RoundnessContact {
    RoundnessContact { kind: ContactKind::Peak, angle_deg: readings.angles_deg[index], row: Some(readings.rows[index]) }
}

/// The circle that `roundness_um` is about.
pub(super) fn judged<'a>(
    job: &Job,
    filter_applied: bool,
    measured: &'a RoundnessCircles,
    filtered: &'a RoundnessCircles,
) -> &'a RoundnessCircle {
    // Without a filter there is no need to bring the points to uniform angles first.
    let of_points = job.filter == (RoundnessFilter::None {}) || !filter_applied;
    of_reference(if of_points { measured } else { filtered }, job.reference)
}

/// The circle that was asked for.
pub(super) fn of_reference(circles: &RoundnessCircles, reference: ReferenceCircle) -> &RoundnessCircle {
    match reference {
        ReferenceCircle::LeastSquares => &circles.least_squares,
        ReferenceCircle::MinimumZone => &circles.minimum_zone,
        ReferenceCircle::MaximumInscribed => &circles.maximum_inscribed,
        ReferenceCircle::MinimumCircumscribed => &circles.minimum_circumscribed,
    }
}

fn failure(error: RoundnessError, readings: Option<&Readings>) -> Failure {
    match error {
        RoundnessError::NotStarShaped { index } => {
            let row = readings.and_then(|readings| readings.rows.get(index).copied());
            let finding = Finding::new("not_star_shaped", "");
            Failure::OutOfModel(row.map_or(finding.clone(), |row| finding.with("row", row)))
        }
        RoundnessError::NotConverged { iterations, left_mm } => {
            Failure::NotConverged { what: "reference circle", residual: left_mm, iterations }
        }
        RoundnessError::NoCircle | RoundnessError::NotSurrounding => {
            Failure::OutOfModel(Finding::new("points_without_circle", ""))
        }
        RoundnessError::Stopped => Failure::Cancelled,
        other => Failure::Internal(other.to_string()),
    }
}

/// Round-off of distances, and of the filter: the transform adds some units of the last place of the radius.
fn numerical_error_mm(found: &Evaluation) -> f64 {
    let zone = found.unfiltered.minimum_zone.width_error_mm.max(found.filtered.minimum_zone.width_error_mm);
    let radius = found.unfiltered.inscribed.radius_error_mm.max(found.unfiltered.circumscribed.radius_error_mm);
    zone.max(radius) + 8.0 * f64::EPSILON * found.unfiltered.circumscribed.circle.radius_mm
}

fn data(job: &Job, readings: &Readings, found: &Evaluation) -> Result<RoundnessData, Failure> {
    let [x, y] = found.unfiltered.least_squares.circle.centre_mm;
    let n = readings.section.len();
    let step_deg = 360.0 / number(n);
    let angles = &readings.angles_deg;
    let off = |(index, angle): (usize, &f64)| {
        let off = (angle - angles[0] - step_deg * number(index)).rem_euclid(360.0);
        off.min(360.0 - off)
    };
    let uniform = angles.iter().enumerate().map(off).fold(0.0, f64::max) <= UNIFORM * step_deg;
    let amplitudes = found.spectrum.iter().map(|harmonic| harmonic.amplitude_mm);
    // Of the harmonics that the points can tell apart, not those of a denser profile.
    let told = (n / 2).min(found.spectrum.len());
    let highest: Vec<f64> = amplitudes.take(told).skip(told - told / 4).collect();
    let squares: f64 = highest.iter().map(|amplitude| amplitude * amplitude).sum();
    Ok(RoundnessData {
        points: n,
        largest_gap_deg: readings.largest_gap.0,
        uniform,
        filter_applied: true,
        repairs: readings.repairs.clone(),
        spikes: readings.spikes.clone(),
        roundness_without_spikes_um: None,
        eccentricity_mm: x.hypot(y),
        eccentricity_angle_deg: y.atan2(x).to_degrees().rem_euclid(360.0),
        interpolation_error_um: if uniform && is_at_grid(job, readings) {
            0.0
        } else {
            interpolation_error_um(readings)?
        },
        aliasing_um: UM_PER_MM * (squares / number(highest.len().max(1))).sqrt(),
    })
}

/// Whether the spline is read at the points themselves: uniform angles from 0, as many, and centred.
fn is_at_grid(job: &Job, readings: &Readings) -> bool {
    let n = readings.section.len();
    let same = job.profile_points.is_none_or(|points| usize::try_from(points) == Ok(n));
    let step_deg = 360.0 / number(n);
    let off = |(index, angle): (usize, &f64)| {
        let off = (angle - step_deg * number(index)).abs();
        off.min(360.0 - off)
    };
    same && readings.angles_deg.iter().enumerate().map(off).fold(0.0, f64::max) <= UNIFORM * step_deg
}

/// What a spline through every second point misses at the others (root mean square), over sixteen.
fn interpolation_error_um(readings: &Readings) -> Result<f64, Failure> {
    let distances = readings.section.distances_mm(readings.circle.circle.centre_mm);
    if distances.len() < LEAST_FOR_HALF {
        // Every second of so few is no curve; the form between them is as unknown as it is large.
        return Ok(UM_PER_MM * readings.circle.span.width_mm());
    }
    let first =
        (0..distances.len()).min_by(|&a, &b| readings.angles_deg[a].total_cmp(&readings.angles_deg[b])).unwrap_or(0);
    let n = distances.len();
    let at = |k: usize| {
        let index = (first + k) % n;
        (readings.angles_deg[index].to_radians(), distances[index])
    };
    let (angles, values): (Vec<f64>, Vec<f64>) = (0..n).step_by(2).map(at).unzip();
    let spline = PeriodicSpline::new(angles, values).map_err(|error| failure(error, Some(readings)))?;
    let missed: Vec<f64> = (1..n).step_by(2).map(at).map(|(angle, value)| spline.at(angle) - value).collect();
    let squares: f64 = missed.iter().map(|miss| miss * miss).sum();
    Ok(UM_PER_MM * (squares / number(missed.len().max(1))).sqrt() / ERROR_RATIO_OF_DOUBLE_STEP)
}

fn profile(found: &Evaluation) -> RoundnessProfile {
    let radius = found.unfiltered.least_squares.circle.radius_mm;
    let step_deg = 360.0 / number(found.referred_mm.len());
    let deviations = |radii: &[f64]| radii.iter().map(|r| UM_PER_MM * (r - radius)).collect();
    RoundnessProfile {
        angle_deg: (0..found.referred_mm.len()).map(|index| step_deg * number(index)).collect(),
        radial_deviation_um: deviations(&found.referred_mm),
        filtered_deviation_um: deviations(&found.filtered_profile_mm),
    }
}

fn spectrum(found: &Evaluation, highest: usize, filter: Filter) -> RoundnessSpectrum {
    let shown = || found.spectrum.iter().filter(|harmonic| (2..=highest).contains(&harmonic.order));
    RoundnessSpectrum {
        order: shown().map(|harmonic| number(harmonic.order)).collect(),
        amplitude_um: shown().map(|harmonic| UM_PER_MM * harmonic.amplitude_mm).collect(),
        angle_of_max_deg: shown().map(|harmonic| harmonic.angle_of_max_rad.to_degrees()).collect(),
        transmission: shown().map(|harmonic| filter.transmission(harmonic.order)).collect(),
    }
}

/// Circles as the contract has them; `place` says where a point is.
#[allow(clippy::too_many_lines)] // four circles, field by field
fn circles_out(
    found: &Circles,
    denser: Option<&Circles>,
    place: &dyn Fn(usize) -> RoundnessContact,
) -> RoundnessCircles {
    let contact = |kind, index| RoundnessContact { kind, ..place(index) };
    let (ls, mz) = (&found.least_squares, &found.minimum_zone);
    let (mi, mc) = (&found.inscribed, &found.circumscribed);
    let circle =
        |centre: [f64; 2], radius_mm: f64, inner_mm: f64, outer_mm: f64, denser_mm: Option<f64>| RoundnessCircle {
            centre_x_mm: centre[0],
            centre_y_mm: centre[1],
            radius_mm,
            inner_radius_mm: inner_mm,
            outer_radius_mm: outer_mm,
            ront_um: UM_PER_MM * (outer_mm - inner_mm),
            ronp_um: None,
            ronv_um: None,
            ronq_um: None,
            contacts: Vec::new(),
            proof: None,
            sampling_error_um: denser_mm.map(|mm| UM_PER_MM * (mm - (outer_mm - inner_mm)).abs()),
            touching: None,
            numerical_error_um: 0.0,
            centre_numerical_error_um: None,
        };
    let um = |mm: f64| Some(UM_PER_MM * mm);
    // The far and the near end of a diameter move by the error of the centre, in opposite directions at worst.
    let about_centre = |distance_mm: f64, centre_mm: f64| UM_PER_MM * (distance_mm + 2.0 * centre_mm);
    let (peak, valley) = (ContactKind::Peak, ContactKind::Valley);
    let (outer, inner) = (ContactKind::Outer, ContactKind::Inner);
    let least_squares = RoundnessCircle {
        ronp_um: um(ls.peak_mm),
        ronv_um: um(ls.valley_mm),
        ronq_um: um(ls.rms_mm),
        contacts: vec![contact(peak, ls.span.farthest), contact(valley, ls.span.nearest)],
        numerical_error_um: about_centre(mc.radius_error_mm, ls.centre_error_mm),
        centre_numerical_error_um: um(ls.centre_error_mm),
        ..circle(
            ls.circle.centre_mm,
            ls.circle.radius_mm,
            ls.span.nearest_mm,
            ls.span.farthest_mm,
            denser.map(|denser| denser.least_squares.span.width_mm()),
        )
    };
    let middle_mm = f64::midpoint(mz.inner_radius_mm, mz.outer_radius_mm);
    let zone_contacts = mz.outer_contacts.iter().map(|&i| contact(outer, i));
    let minimum_zone = RoundnessCircle {
        touching: Some(mz.touching.iter().sum()),
        contacts: zone_contacts.chain(mz.inner_contacts.iter().map(|&i| contact(inner, i))).collect(),
        proof: Some(RoundnessProof {
            bound_mm: mz.lower_bound_mm,
            stiffness: mz.stiffness,
            certified_within_mm: Some(mz.certified_within_mm),
            is_global: mz.is_global,
            is_unique: mz.is_unique,
            others: Vec::new(),
        }),
        numerical_error_um: UM_PER_MM * mz.width_error_mm,
        centre_numerical_error_um: mz.centre_error_mm.map(|mm| UM_PER_MM * mm),
        ..circle(
            mz.centre_mm,
            middle_mm,
            mz.inner_radius_mm,
            mz.outer_radius_mm,
            denser.map(|denser| denser.minimum_zone.width_mm()),
        )
    };
    let maximum_inscribed = RoundnessCircle {
        touching: Some(mi.touching),
        contacts: mi.contacts.iter().map(|&i| contact(inner, i)).chain([contact(peak, mi.span.farthest)]).collect(),
        proof: Some(RoundnessProof {
            bound_mm: mi.circle.radius_mm + mi.radius_gap_mm,
            stiffness: mi.stiffness,
            certified_within_mm: Some(mi.certified_within_mm),
            is_global: mi.is_global,
            is_unique: mi.is_global && mi.others.is_empty(),
            others: mi.others.iter().map(|other| other_out(other.circle.centre_mm, other.circle.radius_mm)).collect(),
        }),
        numerical_error_um: about_centre(mi.radius_error_mm, mi.centre_error_mm),
        centre_numerical_error_um: um(mi.centre_error_mm),
        ..circle(
            mi.circle.centre_mm,
            mi.circle.radius_mm,
            mi.circle.radius_mm,
            mi.span.farthest_mm,
            denser.map(|denser| denser.inscribed.span.width_mm()),
        )
    };
    let (first, second, third) = mc.contacts;
    let held = [Some(first), Some(second), third].into_iter().flatten().map(|i| contact(outer, i));
    let minimum_circumscribed = RoundnessCircle {
        touching: Some(mc.touching),
        contacts: held.chain([contact(valley, mc.span.nearest)]).collect(),
        proof: Some(RoundnessProof {
            bound_mm: mc.circle.radius_mm,
            stiffness: mc.stiffness,
            certified_within_mm: None,
            is_global: true,
            is_unique: true,
            others: Vec::new(),
        }),
        numerical_error_um: about_centre(mc.radius_error_mm, mc.centre_error_mm),
        centre_numerical_error_um: um(mc.centre_error_mm),
        ..circle(
            mc.circle.centre_mm,
            mc.circle.radius_mm,
            mc.span.nearest_mm,
            mc.circle.radius_mm,
            denser.map(|denser| denser.circumscribed.span.width_mm()),
        )
    };
    RoundnessCircles { least_squares, minimum_zone, maximum_inscribed, minimum_circumscribed }
}

fn other_out([x, y]: [f64; 2], radius_mm: f64) -> OtherCircle {
    OtherCircle { centre_x_mm: x, centre_y_mm: y, radius_mm }
}

/// A count as a number.
fn number(count: usize) -> f64 {
    // At most 800 000.
    #[allow(clippy::cast_precision_loss)]
    let number = count as f64;
    number
}
