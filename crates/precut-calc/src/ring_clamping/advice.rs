//! What the numbers mean: codes with numbers.

use crate::calculator::{Finding, Message};

use super::input::{Holding, Job};
use super::output::{OtherJaws, Outcome};

/// Codes of the explanations made here.
pub(super) const EXPLANATION_CODES: &[&str] =
    &["released_is", "two_point_blind", "force_may_be", "force_must_be", "other_jaws", "size_changes"];

/// Codes of the warnings made here.
pub(super) const WARNING_CODES: &[&str] =
    &["released_out_of_tolerance", "grip_too_weak", "no_force_fits", "ring_thick", "ring_yields"];

/// Wall over mean radius up to which a curved beam with shear is good to some percent.
const THIN: f64 = 0.3;
/// Share of the yield strength that is warned of.
const HALF: f64 = 0.5;
/// A gauge that shows less than this of the roundness is blind to it.
const BLIND: f64 = 0.2;
/// Other jaws are told of when they leave less than this of the roundness.
const BETTER: f64 = 0.8;

pub(super) fn warnings(job: &Job, outcome: &Outcome) -> Vec<Finding> {
    let mut found = Vec::new();
    if let Some(tolerance_um) = job.roundness_tolerance_um.filter(|tolerance| outcome.roundness_um > *tolerance) {
        found.push(Finding::new("released_out_of_tolerance", "/roundness_tolerance_um").measured(
            outcome.roundness_um,
            tolerance_um,
            "um",
        ));
    }
    if let (Some(limits), Holding::Jaws { force_per_jaw_n, .. }) = (&outcome.limits, &job.holding) {
        if let Some(needed_n) = limits.force_per_jaw_min_n.filter(|needed| needed > force_per_jaw_n) {
            found.push(Finding::new("grip_too_weak", "/holding/force_per_jaw_n").measured(
                *force_per_jaw_n,
                needed_n,
                "N",
            ));
        }
        if let (Some(most), Some(least)) = (limits.force_per_jaw_max_n, limits.force_per_jaw_min_n)
            && least > most
        {
            let finding = Finding::new("no_force_fits", "/holding").measured(least, most, "N");
            found.push(match best_other(job, outcome) {
                Some(other) => {
                    finding.with("jaws", f64::from(other.jaws)).with("contact_angle_deg", other.contact_angle_deg)
                }
                None => finding,
            });
        }
    }
    let ring = job.ring();
    if ring.wall_mm > THIN * ring.radius_mm {
        found.push(Finding::new("ring_thick", "/inner_diameter_mm").measured(ring.wall_mm / ring.radius_mm, THIN, "1"));
    }
    if let Some(strength) = job.yield_strength_n_per_mm2
        && outcome.bending_stress_n_per_mm2 > HALF * strength
    {
        found.push(
            Finding::new("ring_yields", "/holding")
                .measured(outcome.bending_stress_n_per_mm2, HALF * strength, "N/mm2")
                .with("strength_n_per_mm2", strength),
        );
    }
    found
}

pub(super) fn explanation(job: &Job, outcome: &Outcome) -> Vec<Message> {
    let mut said = Vec::new();
    let lobes = &outcome.lobes;
    let largest = (0..lobes.order.len()).max_by(|&a, &b| lobes.amplitude_um[a].total_cmp(&lobes.amplitude_um[b]));
    let mut released = Message::new("released_is").with("roundness_um", outcome.roundness_um);
    if let Some(at) = largest {
        released = released
            .with("order", lobes.order[at])
            .with("amplitude_um", lobes.amplitude_um[at])
            .with("angle_deg", lobes.angle_of_max_deg[at]);
    }
    said.push(released);
    if outcome.two_point_um < BLIND * outcome.roundness_um {
        said.push(
            Message::new("two_point_blind")
                .with("two_point_um", outcome.two_point_um)
                .with("roundness_um", outcome.roundness_um),
        );
    }
    said.push(Message::new("size_changes").with("radius_change_um", outcome.radius_change_um));
    if let Some(limits) = &outcome.limits {
        said.extend(limits.force_per_jaw_max_n.map(|n| Message::new("force_may_be").with("force_n", n)));
        said.extend(limits.force_per_jaw_min_n.map(|n| Message::new("force_must_be").with("force_n", n)));
    }
    let other = best_other(job, outcome).filter(|_| !is_enough(job, outcome));
    said.extend(other.map(|other| {
        Message::new("other_jaws")
            .with("jaws", f64::from(other.jaws))
            .with("contact_angle_deg", other.contact_angle_deg)
            .with("force_per_jaw_n", other.force_per_jaw_n)
            .with("roundness_um", other.roundness_um)
    }));
    said
}

/// The fewest other jaws that do what is asked, of these the best: hold the cut and keep the tolerance, else keep the
/// tolerance, else leave much less.
fn best_other<'o>(job: &Job, outcome: &'o Outcome) -> Option<&'o OtherJaws> {
    let Holding::Jaws { jaws, .. } = &job.holding else { return None };
    let needed_n = outcome.limits.and_then(|limits| limits.force_per_jaw_min_n).map(|each| each * f64::from(*jaws));
    let is_better = |other: &&OtherJaws| match (needed_n, job.roundness_tolerance_um) {
        (Some(sum_n), Some(_)) => other.force_per_jaw_max_n.is_none_or(|most| most * f64::from(other.jaws) >= sum_n),
        (None, Some(tolerance_um)) => other.roundness_um <= tolerance_um,
        (_, None) => other.roundness_um < BETTER * outcome.roundness_um,
    };
    let better = || outcome.alternatives.iter().filter(is_better);
    let fewest = better().map(|other| other.jaws).min()?;
    better().filter(|other| other.jaws == fewest).min_by(|a, b| a.roundness_um.total_cmp(&b.roundness_um))
}

/// Whether the jaws as they are do all that is asked.
fn is_enough(job: &Job, outcome: &Outcome) -> bool {
    let window = outcome.limits.map(|limits| (limits.force_per_jaw_min_n, limits.force_per_jaw_max_n));
    let fits = !matches!(window, Some((Some(least), Some(most))) if least > most);
    fits && job.roundness_tolerance_um.is_some_and(|tolerance| outcome.roundness_um <= tolerance)
}
