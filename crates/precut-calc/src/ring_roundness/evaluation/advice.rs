//! What the numbers say, what dominates, and where not to trust them: codes with numbers.

use crate::calculator::{Finding, Message};

use super::assess::{judged, of_reference};
use super::check::filter_points;
use super::input::{Job, RoundnessFilter, SpikeTreatment};
use super::output::Outcome;
use super::readings::Table;

/// Codes of the explanations made here.
pub(super) const EXPLANATION_CODES: &[&str] = &[
    "roundness_is",
    "harmonic_dominates",
    "filter_removed",
    "zone_against_least_squares",
    "eccentricity_taken_out",
    "known_to",
    "tolerance_kept",
    "several_inscribed_circles",
    "contacts_tied",
    "repaired_in_reading",
];

/// Codes of the warnings made here.
pub(super) const WARNING_CODES: &[&str] = &[
    "too_few_points_for_filter",
    "filter_not_applied",
    "form_between_points_unknown",
    "finer_than_any_instrument",
    "radius_unlike_nominal",
    "spike_suspected",
    "zone_not_proven",
    "inscribed_not_proven",
    "tolerance_exceeded",
    "tolerance_undecided",
];

/// Points per wave of the cut-off that the standard asks for (ISO 12181-2).
const POINTS_PER_WAVE: f64 = 7.0;
/// The noise of a good roundness tester, and the roundness of its glass master, µm.
const FINEST_UM: f64 = 0.02;
/// A mean radius farther from the nominal one than this is of another quantity or unit.
const UNLIKE: f64 = 0.02;
/// Widest spread of the ratio that a mistaken unit makes.
const SAME_RATIO: f64 = 0.01;

pub(super) fn warnings(job: &Job, outcome: &Outcome) -> Vec<Finding> {
    let mut found = Vec::new();
    let table = Table::of(job).first().map_or("", |table| table.name());
    let points = filter_points(job);
    if let Some((cutoff, field)) = job.filter.highest_cutoff()
        && points < POINTS_PER_WAVE * cutoff
        && outcome.data.filter_applied
    {
        found.push(
            Finding::new("too_few_points_for_filter", format!("/filter/{field}"))
                .measured(points, POINTS_PER_WAVE * cutoff, "1")
                .with("cutoff_upr", cutoff),
        );
    }
    if let (Some((cutoff, field)), false) = (job.filter.highest_cutoff(), outcome.data.filter_applied) {
        let finding = Finding::new("filter_not_applied", format!("/filter/{field}"));
        found.push(if outcome.spectrum.order.is_empty() {
            finding.value(cutoff, "1").with("gap_deg", outcome.data.largest_gap_deg)
        } else {
            finding.measured(cutoff, (0.5 * points).floor(), "1")
        });
    }
    if outcome.measured.least_squares.sampling_error_um.is_none() {
        found.push(
            Finding::new("form_between_points_unknown", format!("/{table}"))
                .value(outcome.data.largest_gap_deg, "deg")
                .with("points", outcome.data.points),
        );
    }
    found.extend(units(job, outcome, table));
    found.extend(spike(job, outcome, table));
    for circles in [&outcome.measured, &outcome.filtered] {
        let unproven = |proof: &Option<super::output::RoundnessProof>| proof.as_ref().is_some_and(|p| !p.is_global);
        let (zone, inscribed) = (&circles.minimum_zone, &circles.maximum_inscribed);
        if unproven(&zone.proof) && !found.iter().any(|f| f.code == "zone_not_proven") {
            found.push(Finding::new("zone_not_proven", "").value(zone.ront_um, "um"));
        }
        if unproven(&inscribed.proof) && !found.iter().any(|f| f.code == "inscribed_not_proven") {
            found.push(Finding::new("inscribed_not_proven", "").value(inscribed.radius_mm, "mm"));
        }
    }
    found.extend(tolerance(job, outcome).and_then(Result::err));
    found
}

/// Readings that look like another quantity or unit.
fn units(job: &Job, outcome: &Outcome, table: &'static str) -> Vec<Finding> {
    let mut found = Vec::new();
    let ront_um = outcome.measured.least_squares.ront_um;
    if ront_um < FINEST_UM {
        let looks_like = match Table::of(job).first() {
            Some(Table::Deviations) => "deviations_in_mm",
            _ => "rounded_radii",
        };
        found.push(
            Finding::new("finer_than_any_instrument", format!("/{table}"))
                .measured(ront_um, FINEST_UM, "um")
                .with("looks_like", looks_like),
        );
    }
    found.extend(unlike_nominal(job.nominal_radius_mm, outcome.measured.least_squares.radius_mm, table));
    found
}

/// A radius that is not the nominal one.
pub(in crate::ring_roundness) fn unlike_nominal(
    nominal_mm: Option<f64>,
    radius_mm: f64,
    table: &'static str,
) -> Option<Finding> {
    let nominal_mm = nominal_mm.filter(|nominal| (radius_mm / nominal - 1.0).abs() > UNLIKE)?;
    let ratio = radius_mm / nominal_mm;
    let known =
        [(2.0, "diameters"), (0.5, "nominal_diameter"), (25.4, "nominal_in_inch"), (1.0 / 25.4, "radii_in_inch")];
    let looks_like = known.iter().find(|(factor, _)| (ratio / factor - 1.0).abs() < SAME_RATIO);
    let finding = Finding::new("radius_unlike_nominal", format!("/{table}")).measured(radius_mm, nominal_mm, "mm");
    Some(match looks_like {
        Some((_, words)) => finding.with("looks_like", *words),
        None => finding,
    })
}

/// Readings that count although they stand off all around them.
fn spike(job: &Job, outcome: &Outcome, table: &'static str) -> Option<Finding> {
    let spikes = &outcome.data.spikes;
    let highest = spikes.iter().max_by(|p, q| p.height_um.abs().total_cmp(&q.height_um.abs()))?;
    let finding = Finding::new("spike_suspected", format!("/{table}"))
        .value(highest.height_um, "um")
        .with("angle_deg", highest.angle_deg)
        .with("width_deg", highest.width_deg)
        .with("row", highest.row)
        .with("count", spikes.len())
        .with("roundness_um", outcome.roundness_um);
    let without = outcome.data.roundness_without_spikes_um;
    (job.spikes == SpikeTreatment::Keep).then(|| match without {
        Some(without_um) => finding.with("without_um", without_um),
        None => finding,
    })
}

/// Whether the tolerance is kept; `Err` where it is not, or where the errors leave it open.
fn tolerance(job: &Job, outcome: &Outcome) -> Option<Result<Message, Finding>> {
    let limit_um = job.tolerance_um?;
    let error_um = error_um(job, outcome);
    let found_um = outcome.roundness_um;
    let finding =
        |code| Finding::new(code, "/tolerance_um").measured(found_um, limit_um, "um").with("error_um", error_um);
    Some(if (found_um - limit_um).abs() <= error_um {
        Err(finding("tolerance_undecided"))
    } else if found_um > limit_um {
        Err(finding("tolerance_exceeded"))
    } else {
        Ok(Message::new("tolerance_kept")
            .with("roundness_um", found_um)
            .with("tolerance_um", limit_um)
            .with("share", found_um / limit_um))
    })
}

/// What is known to be unknown of the roundness asked for: between the points, of the spline, of the round-off.
pub(in crate::ring_roundness) fn error_um(job: &Job, outcome: &Outcome) -> f64 {
    let sampling_um = sampling_um(job, outcome);
    // A peak and a valley, each with the error of the spline.
    let spline_um = if job.filter == (RoundnessFilter::None {}) || !outcome.data.filter_applied {
        0.0
    } else {
        outcome.data.interpolation_error_um
    };
    sampling_um + 2.0 * spline_um + outcome.numerical_error_um
}

/// What peaks between the points may add; nothing is known of it across a gap.
fn sampling_um(job: &Job, outcome: &Outcome) -> f64 {
    judged(job, outcome.data.filter_applied, &outcome.measured, &outcome.filtered).sampling_error_um.unwrap_or(0.0)
}

pub(super) fn explanation(job: &Job, outcome: &Outcome) -> Vec<Message> {
    let mut said = vec![roundness_is(job, outcome)];
    said.extend(harmonic_dominates(outcome));
    let (measured, kept) =
        (of_reference(&outcome.measured, job.reference), of_reference(&outcome.filtered, job.reference));
    if outcome.data.filter_applied && job.filter != (RoundnessFilter::None {}) && measured.ront_um > kept.ront_um {
        said.push(
            Message::new("filter_removed")
                .with("measured_um", measured.ront_um)
                .with("kept_um", kept.ront_um)
                .with("share", 1.0 - kept.ront_um / measured.ront_um),
        );
    }
    let shown = if job.filter == (RoundnessFilter::None {}) || !outcome.data.filter_applied {
        &outcome.measured
    } else {
        &outcome.filtered
    };
    let (least_squares_um, zone_um) = (shown.least_squares.ront_um, shown.minimum_zone.ront_um);
    if least_squares_um > 0.0 {
        said.push(
            Message::new("zone_against_least_squares")
                .with("zone_um", zone_um)
                .with("least_squares_um", least_squares_um)
                .with("share", 1.0 - zone_um / least_squares_um),
        );
    }
    let (e, radius_mm) = (outcome.data.eccentricity_mm, outcome.measured.least_squares.radius_mm);
    // What the limaçon leaves of a true circle: a second harmonic of e²/4R, peak to valley e²/2R.
    let limacon_um = 1e3 * e * e / (2.0 * radius_mm);
    // Below a nanometre nobody can have set it up.
    let is_centred = !matches!(Table::of(job).first(), Some(Table::Points | Table::File));
    if is_centred && e > 1e-6 {
        said.push(
            Message::new("eccentricity_taken_out")
                .with("eccentricity_um", 1e3 * e)
                .with("angle_deg", outcome.data.eccentricity_angle_deg)
                .with("limacon_um", limacon_um),
        );
    }
    said.push(
        Message::new("known_to")
            .with("error_um", error_um(job, outcome))
            .with("sampling_um", sampling_um(job, outcome))
            .with("interpolation_um", outcome.data.interpolation_error_um)
            .with("aliasing_um", outcome.data.aliasing_um),
    );
    said.extend(tolerance(job, outcome).and_then(Result::ok));
    let others = |circles: &super::output::RoundnessCircles| {
        circles.maximum_inscribed.proof.as_ref().map_or(0, |proof| proof.others.len())
    };
    let (of_points, of_profile) = (others(&outcome.measured), others(&outcome.filtered));
    if of_points + of_profile > 0 {
        said.push(
            Message::new("several_inscribed_circles")
                .with("of_points", of_points + 1)
                .with("of_profile", of_profile + 1),
        );
    }
    said.extend(contacts_tied(outcome));
    said.extend(outcome.data.repairs.iter().map(|repair| {
        Message::new("repaired_in_reading")
            .with("kind", repair.kind.name())
            .with("count", repair.count)
            .with("change_um", repair.change_um)
    }));
    said
}

/// A symmetric form touches its circles at more points than hold them: which of them are named is a matter of choice.
fn contacts_tied(outcome: &Outcome) -> Option<Message> {
    let circles = &outcome.measured;
    let most = [(&circles.minimum_zone, 4), (&circles.maximum_inscribed, 3), (&circles.minimum_circumscribed, 3)];
    let beyond = |(circle, held): &(&super::output::RoundnessCircle, usize)| circle.touching.is_some_and(|n| n > *held);
    let told = |at: usize| most[at].0.touching.unwrap_or(0);
    most.iter().any(beyond).then(|| {
        Message::new("contacts_tied").with("zone", told(0)).with("inscribed", told(1)).with("circumscribed", told(2))
    })
}

fn roundness_is(job: &Job, outcome: &Outcome) -> Message {
    let circle = judged(job, outcome.data.filter_applied, &outcome.measured, &outcome.filtered);
    let message = Message::new("roundness_is")
        .with("roundness_um", outcome.roundness_um)
        .with("reference", job.reference.name())
        .with("radius_mm", circle.radius_mm);
    match job.filter {
        _ if !outcome.data.filter_applied => message,
        RoundnessFilter::None {} => message,
        RoundnessFilter::LowPass { cutoff_upr } => message.with("to_upr", cutoff_upr),
        RoundnessFilter::HighPass { cutoff_upr } => message.with("from_upr", cutoff_upr),
        RoundnessFilter::BandPass { from_upr, to_upr } => message.with("from_upr", from_upr).with("to_upr", to_upr),
    }
}

/// The harmonic that carries most of what the filter lets pass.
fn harmonic_dominates(outcome: &Outcome) -> Option<Message> {
    let spectrum = &outcome.spectrum;
    let kept: Vec<f64> = spectrum.amplitude_um.iter().zip(&spectrum.transmission).map(|(a, t)| a * t).collect();
    let power: f64 = kept.iter().map(|amplitude| amplitude * amplitude).sum();
    let at = (0..kept.len()).max_by(|&a, &b| kept[a].total_cmp(&kept[b]))?;
    // Beside the round-off there is nothing to explain.
    (kept[at] > outcome.numerical_error_um).then(|| {
        Message::new("harmonic_dominates")
            .with("order", spectrum.order[at])
            .with("amplitude_um", spectrum.amplitude_um[at])
            .with("angle_of_max_deg", spectrum.angle_of_max_deg[at])
            .with("share", kept[at] * kept[at] / power)
    })
}
