//! From the sections to the answer.

use crate::calculator::{Calculator, Failure, Finding, Measured, Message, Monitor, checkpoint};
use crate::num::cylinder::{
    Axis, Contact, CylinderError, Envelope, Kind, LeastSquares, Point, envelope, least_squares, median_line,
};
use crate::ring_roundness::evaluation;
use crate::ring_roundness::evaluation::{
    ContactKind, Job as SectionJob, Outcome as SectionOutcome, ReferenceCircle, RoundnessFilter, RoundnessPointRow,
    RoundnessRepair, advice::error_um,
};

use super::form::{Form, Line, Sample, barrel, line, points, without};
use super::input::Job;
use super::output::{
    CylinderAxis, CylinderContact, CylinderData, CylinderPart, CylinderProof, CylinderRequirement, CylinderSection,
    CylinderSurface, CylinderTaper, CylinderVerdict, Outcome, PartKind, ReferenceCylinder, ReferenceCylinders,
    RequirementKind,
};
use super::sections;

const UM_PER_MM: f64 = 1e3;
/// Angles at which the unrolled surface is given.
const SURFACE_ANGLES: usize = 120;
/// Distances are right to so many units of the last place of the radius.
const ROUNDING: f64 = 16.0 * f64::EPSILON;

/// Codes of a faultless job without answer.
pub(super) const FAILURE_CODES: &[&str] = &["not_star_shaped", "points_without_circle", "no_cylinder"];

/// Everything of a checked and filled job.
pub(super) fn outcome(job: &Job, monitor: &dyn Monitor) -> Result<Outcome, Failure> {
    checkpoint(monitor)?;
    monitor.progress(0.0, Message::new("stage_sections"));
    let (measured, repairs) = measured(job)?;
    let all: Vec<Point> = measured.iter().flatten().copied().collect();
    // Sections are evaluated square to this axis: a tilted cut of a round cylinder is an ellipse.
    let frame = least_squares(&all).map_err(failure)?.axis;
    let mut evaluated = Vec::with_capacity(measured.len());
    for (index, section) in measured.iter().enumerate() {
        checkpoint(monitor)?;
        monitor.progress(0.5 * index as f64 / measured.len() as f64, Message::new("stage_sections"));
        evaluated.push(evaluate(job, frame, section, monitor)?);
    }
    let filter_applied =
        job.filter != (RoundnessFilter::None {}) && evaluated.iter().all(|section| section.outcome.data.filter_applied);
    let forms: Vec<Form> = evaluated.iter().map(|section| section.form(filter_applied)).collect();
    checkpoint(monitor)?;
    monitor.progress(0.5, Message::new("stage_cylinders"));
    let surface = points(&forms);
    let (cylinders, least) = cylinders(&forms, &surface, frame, monitor)?;
    checkpoint(monitor)?;
    monitor.progress(0.8, Message::new("stage_parts"));
    let parts = parts(job, &forms, monitor)?;
    let reference = of_reference(&cylinders, job.reference);
    let axis = axis(job, &forms)?;
    let sections: Vec<CylinderSection> =
        evaluated.iter().zip(&forms).map(|(section, form)| section_out(job, section, form, &forms, &least)).collect();
    let (low, high) = surface.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), p| (l.min(p[2]), h.max(p[2])));
    let outcome = Outcome {
        cylindricity_um: reference.cylt_um,
        roundness_um: sections.iter().map(|section| section.ront_um).fold(0.0, f64::max),
        requirements: requirements(job, &cylinders, &sections, &axis),
        taper: taper(&forms),
        surface: unrolled(&evaluated, &forms, &least),
        data: CylinderData {
            points: all.len(),
            sections: measured.len(),
            length_mm: high - low,
            filter_applied,
            repairs,
        },
        cylinders,
        sections,
        axis,
        parts,
    };
    monitor.progress(1.0, Message::new("stage_done"));
    Ok(outcome)
}

/// The points of every section, and what was put right in reading them.
fn measured(job: &Job) -> Result<(Vec<Vec<Point>>, Vec<RoundnessRepair>), Failure> {
    let sections = sections::sections(job).map_err(|_| Failure::Internal("sections of a checked job".to_owned()))?;
    let mut repairs: Vec<RoundnessRepair> = Vec::new();
    let mut add = |repair: RoundnessRepair| match repairs.iter_mut().find(|known| known.kind == repair.kind) {
        Some(known) => {
            known.count += repair.count;
            known.change_um = known.change_um.max(repair.change_um);
        }
        None => repairs.push(repair),
    };
    if let Some(Ok(read)) = sections::file(job) {
        read.done.into_iter().for_each(|(kind, count)| add(RoundnessRepair::new(kind, count, 0.0)));
    }
    let mut all = Vec::with_capacity(sections.len());
    for section in &sections {
        let (points, repaired) = sections::points(job, section)
            .map_err(|_| Failure::OutOfModel(Finding::new("points_without_circle", "")))?;
        repaired.into_iter().for_each(&mut add);
        all.push(points);
    }
    Ok((all, repairs))
}

/// A section as its roundness evaluation sees it, square to the cylinder's axis.
struct Evaluated {
    job: SectionJob,
    outcome: SectionOutcome,
    /// Height of its middle as measured, mm.
    given_height_mm: f64,
    /// Points in the frame of the axis.
    points: Vec<Point>,
}

fn evaluate(job: &Job, frame: Axis, section: &[Point], monitor: &dyn Monitor) -> Result<Evaluated, Failure> {
    let points: Vec<Point> = section.iter().map(|point| frame.coordinates_mm(*point)).collect();
    let rows = points.iter().map(|[x, y, _]| RoundnessPointRow { x_mm: *x, y_mm: *y }).collect();
    let mut section_job = SectionJob { points: Some(Measured(rows)), ..sections::section_job(job, None) };
    evaluation::RoundnessEvaluation::fill(&mut section_job);
    let outcome = evaluation::assess::outcome(&section_job, &Quiet(monitor))?;
    let given_height_mm = section.iter().map(|point| point[2]).sum::<f64>() / section.len() as f64;
    Ok(Evaluated { job: section_job, outcome, given_height_mm, points })
}

/// Passes a cancel on and keeps the progress of a part to itself.
struct Quiet<'a>(&'a dyn Monitor);

impl Monitor for Quiet<'_> {
    fn cancelled(&self) -> bool {
        self.0.cancelled()
    }
    fn progress(&self, _fraction: f64, _stage: Message) {}
}

impl Evaluated {
    /// The section about its least-squares circle: its filtered profile, or its points as they are.
    fn form(&self, filtered: bool) -> Form {
        let circle = &self.outcome.measured.least_squares;
        let centre_mm = [circle.centre_x_mm, circle.centre_y_mm];
        let height_mm = self.points.iter().map(|point| point[2]).sum::<f64>() / self.points.len() as f64;
        let profile = &self.outcome.profile;
        let samples = if filtered {
            let sample =
                |(angle, um): (&f64, &f64)| Sample { angle_rad: angle.to_radians(), off_mm: um / UM_PER_MM, height_mm };
            profile.angle_deg.iter().zip(&profile.filtered_deviation_um).map(sample).collect()
        } else {
            let sample = |[x, y, height_mm]: &Point| {
                let (x, y) = (x - centre_mm[0], y - centre_mm[1]);
                Sample { angle_rad: y.atan2(x), off_mm: x.hypot(y) - circle.radius_mm, height_mm: *height_mm }
            };
            self.points.iter().map(sample).collect()
        };
        Form { height_mm, centre_mm, radius_mm: circle.radius_mm, samples }
    }
}

fn failure(error: CylinderError) -> Failure {
    match error {
        CylinderError::Undetermined => Failure::OutOfModel(Finding::new("no_cylinder", "")),
        CylinderError::Stopped => Failure::Cancelled,
        CylinderError::NotConverged { iterations, left_mm } => {
            Failure::NotConverged { what: "reference cylinder", residual: left_mm, iterations }
        }
    }
}

fn kind(reference: ReferenceCircle) -> Option<Kind> {
    match reference {
        ReferenceCircle::LeastSquares => None,
        ReferenceCircle::MinimumZone => Some(Kind::MinimumZone),
        ReferenceCircle::MaximumInscribed => Some(Kind::Inscribed),
        ReferenceCircle::MinimumCircumscribed => Some(Kind::Circumscribed),
    }
}

fn of_reference(cylinders: &ReferenceCylinders, reference: ReferenceCircle) -> &ReferenceCylinder {
    match reference {
        ReferenceCircle::LeastSquares => &cylinders.least_squares,
        ReferenceCircle::MinimumZone => &cylinders.minimum_zone,
        ReferenceCircle::MaximumInscribed => &cylinders.maximum_inscribed,
        ReferenceCircle::MinimumCircumscribed => &cylinders.minimum_circumscribed,
    }
}

fn cylinders(
    forms: &[Form],
    surface: &[Point],
    frame: Axis,
    monitor: &dyn Monitor,
) -> Result<(ReferenceCylinders, LeastSquares), Failure> {
    let least = least_squares(surface).map_err(failure)?;
    let distances: Vec<f64> = surface.iter().map(|point| least.axis.local(*point).distance_mm).collect();
    let extreme = |sign: f64| {
        (0..distances.len()).max_by(|&a, &b| (sign * distances[a]).total_cmp(&(sign * distances[b]))).unwrap_or(0)
    };
    let contact = |kind, point| contact_out(forms, kind, point);
    let least_squares = ReferenceCylinder {
        cylp_um: Some(UM_PER_MM * (least.farthest_mm - least.radius_mm)),
        cylv_um: Some(UM_PER_MM * (least.radius_mm - least.nearest_mm)),
        cylq_um: Some(UM_PER_MM * least.rms_mm),
        contacts: vec![contact(ContactKind::Peak, extreme(1.0)), contact(ContactKind::Valley, extreme(-1.0))],
        ..plain(frame, least.axis, least.radius_mm, least.nearest_mm, least.farthest_mm)
    };
    let fit = |kind: Kind| -> Result<ReferenceCylinder, Failure> {
        checkpoint(monitor)?;
        let found = envelope(kind, surface, least.axis, &|| !monitor.cancelled()).map_err(failure)?;
        Ok(envelope_out(forms, frame, kind, &found))
    };
    let cylinders = ReferenceCylinders {
        least_squares,
        minimum_zone: fit(Kind::MinimumZone)?,
        maximum_inscribed: fit(Kind::Inscribed)?,
        minimum_circumscribed: fit(Kind::Circumscribed)?,
    };
    Ok((cylinders, least))
}

fn envelope_out(forms: &[Form], frame: Axis, kind: Kind, found: &Envelope) -> ReferenceCylinder {
    let contact = |contact: &Contact| {
        contact_out(forms, if contact.is_outer { ContactKind::Outer } else { ContactKind::Inner }, contact.point)
    };
    let radius_mm = match kind {
        Kind::MinimumZone => f64::midpoint(found.inner_mm, found.outer_mm),
        Kind::Inscribed => found.inner_mm,
        Kind::Circumscribed => found.outer_mm,
    };
    ReferenceCylinder {
        contacts: found.contacts.iter().map(contact).collect(),
        proof: Some(CylinderProof { gap_um: UM_PER_MM * found.proof.gap_mm, within_mm: found.proof.within_mm }),
        ..plain(frame, found.axis, radius_mm, found.inner_mm, found.outer_mm)
    }
}

/// A cylinder in the coordinates of the job.
fn plain(frame: Axis, axis: Axis, radius_mm: f64, inner_mm: f64, outer_mm: f64) -> ReferenceCylinder {
    let in_job = |height: f64| {
        let [x, y, z] = axis.place_mm([0.0; 2], height);
        frame.place_mm([x, y], z)
    };
    let (middle, ahead) = (in_job(0.0), in_job(1.0));
    let rise = ahead[2] - middle[2];
    ReferenceCylinder {
        centre_x_mm: middle[0],
        centre_y_mm: middle[1],
        slope_x_um_per_mm: UM_PER_MM * (ahead[0] - middle[0]) / rise,
        slope_y_um_per_mm: UM_PER_MM * (ahead[1] - middle[1]) / rise,
        radius_mm,
        inner_radius_mm: inner_mm,
        outer_radius_mm: outer_mm,
        cylt_um: UM_PER_MM * (outer_mm - inner_mm),
        cylp_um: None,
        cylv_um: None,
        cylq_um: None,
        contacts: Vec::new(),
        proof: None,
    }
}

fn contact_out(forms: &[Form], kind: ContactKind, mut point: usize) -> CylinderContact {
    for (index, form) in forms.iter().enumerate() {
        if let Some(sample) = form.samples.get(point) {
            let angle_deg = sample.angle_rad.to_degrees().rem_euclid(360.0);
            return CylinderContact { kind, section: index + 1, angle_deg };
        }
        point -= form.samples.len();
    }
    CylinderContact { kind, section: forms.len(), angle_deg: 0.0 }
}

/// What is left of the cylindricity when a part is taken out.
fn parts(job: &Job, forms: &[Form], monitor: &dyn Monitor) -> Result<Vec<CylinderPart>, Failure> {
    let mut parts = Vec::new();
    for part in [PartKind::Roundness, PartKind::Taper, PartKind::Barrel, PartKind::Bend] {
        checkpoint(monitor)?;
        let Some(left) = without(forms, part) else { continue };
        let surface = points(&left);
        let least = least_squares(&surface).map_err(failure)?;
        let width_mm = match kind(job.reference) {
            None => least.farthest_mm - least.nearest_mm,
            Some(kind) => envelope(kind, &surface, least.axis, &|| !monitor.cancelled()).map_err(failure)?.width_mm(),
        };
        parts.push(CylinderPart { part, without_um: UM_PER_MM * width_mm });
    }
    Ok(parts)
}

/// The lines of a datum axis, along x and y.
fn datum(job: &Job, forms: &[Form]) -> Option<[Line; 2]> {
    if job.datum_sections.is_empty() {
        return None;
    }
    let of = |k: usize| {
        let is_datum = |index: usize| job.datum_sections.iter().any(|section| section.0 as usize == index + 1);
        let places = forms.iter().enumerate().filter(|(index, _)| is_datum(*index));
        line(&places.map(|(_, form)| (form.height_mm, form.centre_mm[k])).collect::<Vec<_>>())
    };
    Some([of(0), of(1)])
}

fn off(lines: &[Line; 2], form: &Form) -> f64 {
    let [x, y] = [0, 1].map(|k| form.centre_mm[k] - lines[k].at(form.height_mm));
    x.hypot(y)
}

fn axis(job: &Job, forms: &[Form]) -> Result<CylinderAxis, Failure> {
    let centres: Vec<Point> = forms.iter().map(|f| [f.centre_mm[0], f.centre_mm[1], f.height_mm]).collect();
    let median = median_line(&centres).map_err(failure)?;
    let others = |index: &usize| !job.datum_sections.iter().any(|section| section.0 as usize == index + 1);
    let coaxiality_um = datum(job, forms).map(|lines| {
        let farthest = (0..forms.len()).filter(others).map(|index| off(&lines, &forms[index])).fold(0.0, f64::max);
        2.0 * UM_PER_MM * farthest
    });
    Ok(CylinderAxis {
        straightness_um: UM_PER_MM * median.diameter_mm,
        straightness_gap_um: UM_PER_MM * median.gap_mm,
        coaxiality_um,
    })
}

fn taper(forms: &[Form]) -> CylinderTaper {
    let radii = line(&forms.iter().map(|form| (form.height_mm, form.radius_mm)).collect::<Vec<_>>());
    let (low, high) = (forms[0].height_mm, forms[forms.len() - 1].height_mm);
    CylinderTaper {
        diameter_change_um: 2.0 * UM_PER_MM * radii.slope * (high - low),
        diameter_change_um_per_mm: 2.0 * UM_PER_MM * radii.slope,
        barrel_um: barrel(forms).map(|barrel| 2.0 * UM_PER_MM * barrel.rise_mm),
    }
}

fn section_out(job: &Job, section: &Evaluated, form: &Form, forms: &[Form], least: &LeastSquares) -> CylinderSection {
    let at = least.axis.coordinates_mm([form.centre_mm[0], form.centre_mm[1], form.height_mm]);
    CylinderSection {
        height_mm: section.given_height_mm,
        points: section.points.len(),
        radius_mm: form.radius_mm,
        off_x_um: UM_PER_MM * at[0],
        off_y_um: UM_PER_MM * at[1],
        ront_um: section.outcome.roundness_um,
        error_um: error_um(&section.job, &section.outcome),
        off_datum_um: datum(job, forms).map(|lines| UM_PER_MM * off(&lines, form)),
    }
}

fn requirements(
    job: &Job,
    cylinders: &ReferenceCylinders,
    sections: &[CylinderSection],
    axis: &CylinderAxis,
) -> Vec<CylinderRequirement> {
    let reference = of_reference(cylinders, job.reference);
    // Peaks between the points of a section, beside the round-off and what another cylinder could have.
    let between_um = sections.iter().map(|section| section.error_um).fold(0.0, f64::max);
    let gap_um = reference.proof.map_or(UM_PER_MM * ROUNDING * reference.outer_radius_mm, |proof| proof.gap_um);
    let worst = (0..sections.len()).max_by(|&a, &b| sections[a].ront_um.total_cmp(&sections[b].ront_um)).unwrap_or(0);
    let farthest = (0..sections.len())
        .filter(|index| !job.datum_sections.iter().any(|section| section.0 as usize == index + 1))
        .max_by(|&a, &b| sections[a].off_datum_um.unwrap_or(0.0).total_cmp(&sections[b].off_datum_um.unwrap_or(0.0)));
    let asked = [
        (
            RequirementKind::Cylindricity,
            job.cylindricity_tolerance_um,
            Some(reference.cylt_um),
            between_um + gap_um,
            None,
        ),
        (
            RequirementKind::Roundness,
            job.roundness_tolerance_um,
            Some(sections[worst].ront_um),
            sections[worst].error_um,
            Some(worst + 1),
        ),
        (
            RequirementKind::Straightness,
            job.straightness_tolerance_um,
            Some(axis.straightness_um),
            axis.straightness_gap_um,
            None,
        ),
        (
            RequirementKind::Coaxiality,
            job.coaxiality_tolerance_um,
            axis.coaxiality_um,
            UM_PER_MM * ROUNDING * reference.outer_radius_mm,
            farthest.map(|index| index + 1),
        ),
    ];
    asked
        .into_iter()
        .filter_map(|(of, tolerance_um, value_um, own_um, section)| {
            let (tolerance_um, value_um) = (tolerance_um?, value_um?);
            let error_um = job.uncertainty_um + own_um;
            let verdict = if value_um + error_um <= tolerance_um {
                CylinderVerdict::Kept
            } else if value_um - error_um > tolerance_um {
                CylinderVerdict::Exceeded
            } else {
                CylinderVerdict::Undecided
            };
            Some(CylinderRequirement { of, section, value_um, error_um, tolerance_um, verdict })
        })
        .collect()
}

/// Deviations from the least-squares cylinder at uniform angles about its axis, read between neighbouring points.
fn unrolled(evaluated: &[Evaluated], forms: &[Form], least: &LeastSquares) -> CylinderSurface {
    let step_deg = 360.0 / SURFACE_ANGLES as f64;
    let mut surface = CylinderSurface {
        angle_deg: (0..SURFACE_ANGLES).map(|k| step_deg * k as f64).collect(),
        ..CylinderSurface::default()
    };
    for (section, form) in evaluated.iter().zip(forms) {
        // A gap leaves the form unknown: there is no spectrum then.
        if section.outcome.spectrum.order.is_empty() {
            continue;
        }
        let mut places: Vec<(f64, f64)> = form
            .points()
            .map(|point| {
                let local = least.axis.local(point);
                let angle = local.towards[1].atan2(local.towards[0]).to_degrees().rem_euclid(360.0);
                (angle, UM_PER_MM * (local.distance_mm - least.radius_mm))
            })
            .collect();
        places.sort_by(|a, b| a.0.total_cmp(&b.0));
        surface.height_mm.push(section.given_height_mm);
        surface.deviation_um.extend(surface.angle_deg.iter().map(|angle| between(&places, *angle)));
    }
    surface
}

/// The value at an angle, on the straight line between its neighbours round the turn.
fn between(places: &[(f64, f64)], angle: f64) -> f64 {
    let n = places.len();
    let after = places.partition_point(|place| place.0 <= angle);
    let (next, last) = (places[after % n], places[(after + n - 1) % n]);
    let width = (next.0 - last.0).rem_euclid(360.0);
    let share = if width > 0.0 { (angle - last.0).rem_euclid(360.0) / width } else { 0.0 };
    last.1 + share * (next.1 - last.1)
}
