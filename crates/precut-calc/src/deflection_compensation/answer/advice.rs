//! What dominates, what would help, where not to trust: codes with numbers.

use crate::calculator::{Failure, Finding, Message, Monitor};
use crate::diameters;

use crate::deflection_compensation::answer::auto::settled;
use crate::deflection_compensation::answer::driven::Again;
use crate::deflection_compensation::job::acting::Acting;
use crate::deflection_compensation::job::encounters::{Reach, body, met};
use crate::deflection_compensation::model::extremes::Extremes;

use crate::deflection_compensation::answer::output::{AddedSupport, OneMoreRest, Outcome, Shares, StatusCompensated};
use crate::deflection_compensation::answer::toolpath::Drawn;
use crate::deflection_compensation::job::grid::Grid;
use crate::deflection_compensation::job::input::{Job, Segment, Support, Theory};
use crate::deflection_compensation::job::structure::Structure;
use crate::deflection_compensation::model::form::{Deviation, Form};
use crate::deflection_compensation::model::regime::{Speed, spindle_speed_rpm};
use crate::deflection_compensation::model::second_order::left_out;
use crate::deflection_compensation::model::soundness;
use crate::deflection_compensation::model::stage::reached;
use crate::deflection_compensation::model::stage::{Stage, all_cuts};
use crate::deflection_compensation::model::yielding::{OpeningParts, at};
use crate::shaft::elastic::ends;

const UM_PER_MM: f64 = 1e3;
/// Deflection over depth above which the one-step formulas fail and chatter is likely.
const DEFLECTION_OVER_DEPTH: f64 = 0.2;
/// Small deflections: at most this share of the length, and of the diameter.
const DEFLECTION_OVER_LENGTH: f64 = 0.01;
const DEFLECTION_OVER_DIAMETER: f64 = 0.1;
/// Share of the yield strength that bending may use.
const STRESS_SHARE: f64 = 0.5;
/// Thrust over buckling load above which the compliance grows noticeably.
const THRUST_RATIO: f64 = 0.05;
/// Slenderness below which shear counts.
const SLENDER: f64 = 10.0;
/// Most stations at which one more rest is tried: so many that the form error between them is missed by nothing that counts.
const REST_SAMPLES: usize = 1025;
/// Stations from which on a sample of them shows what a rest leaves.
const REST_LEAST: usize = 9;
/// Stations at which bending stress is looked at: of a smooth moment curve the largest is missed by less than a thousandth.
const STRESS_SAMPLES: usize = 65;
/// Share by which passive forces may differ and still make the same size everywhere.
const EVEN: f64 = 0.01;
/// Stations at which rests are tried for touching the shaft.
const CONTACT_SAMPLES: usize = 1025;
/// Share of the form error that one more rest must take away to be worth naming.
const WORTHWHILE: f64 = 0.2;
/// A depth beyond so many nominal depths is worth a look.
const DEPTH_RATIO: f64 = 2.0;

/// Codes of the explanations made here.
pub(in crate::deflection_compensation) const EXPLANATION_CODES: &[&str] = &[
    "work_dominates",
    "nothing_yields",
    "headstock_dominates",
    "tailstock_dominates",
    "rests_dominate",
    "tool_dominates",
    "weight_dominates",
    "couple_dominates",
    "offset_dominates",
    "compensation_holds",
    "nominal_path_leaves",
    "compensated_path_leaves",
    "path_has_gaps",
    "one_more_rest_buys",
    "uncertain_by",
    "tailstock_buys",
    "one_step_overcuts",
    "stock_is_copied",
    "stock_is_inverted",
    "machine_taken_as_rigid",
    "effect_acts_by_default",
];

/// Standard deviations on either side that hold 95 % of a normal scatter.
const TWO_SIDED_95: f64 = 1.96;

/// Codes of the warnings made here.
pub(in crate::deflection_compensation) const WARNING_CODES: &[&str] = &[
    "deflection_over_depth",
    "linear_theory_exceeded",
    "bending_stress_high",
    "thrust_near_buckling",
    "shear_neglected",
    "command_too_steep",
    "command_too_deep",
    "command_doubles_depth",
    "blank_undersize",
    "tool_passes_support",
    "tool_reaches_support",
    "tool_hits_chuck",
    "plunge_at_shoulder",
    "rest_never_touches",
    "form_tolerance_missed",
    "size_tolerance_missed",
    "spindle_limit_binds",
    "stretch_stays_uncut",
];

/// Who yields at the station that deflects most (`deflection/3.2`), one-sided rests as they stand there: by virtual
/// work the shares are exact.
pub(in crate::deflection_compensation) fn shares(
    job: &Job,
    grid: &Grid,
    acting: &Acting,
    stage: &Stage,
    most_deflected: usize,
) -> Result<Shares, Failure> {
    let i = most_deflected;
    let z_mm = grid.z_mm.get(i).copied().unwrap_or(0.0);
    let touching = stage.line.touching(i, &stage.cut.loads.of(i));
    let parts = if touching.is_empty() {
        stage.structure.beam.shares(z_mm)
    } else {
        let mut variant = stage.variant(job, acting);
        variant.touching = &touching;
        Structure::of(job, &variant)?.beam.shares(z_mm)
    };
    let (head, tail) = ends(&job.supports);
    let work = parts.bending_mm_per_n + parts.shear_mm_per_n;
    let carriage = stage.line.carriage_mm_per_n;
    let total = parts.supports_mm_per_n.iter().fold(work + carriage, |sum, part| sum + part);
    let share = |part: f64| if total > 0.0 { part / total } else { 0.0 };
    let of = |support: Option<usize>| support.map_or(0.0, |s| parts.supports_mm_per_n[s]);
    let others = parts.supports_mm_per_n.iter().enumerate().filter(|(s, _)| Some(*s) != head && Some(*s) != tail);
    Ok(Shares {
        z_mm,
        work: share(work),
        headstock: share(of(head)),
        tailstock: share(of(tail)),
        // Not `sum`: that of nothing is -0.
        rests: share(others.fold(0.0, |sum, (_, part)| sum + part)),
        tool: share(carriage),
    })
}

/// The first station of the largest |Y(a)|; 0 where there is none.
pub(in crate::deflection_compensation) fn most_deflected(stage: &Stage) -> usize {
    let mut best = (0, 0.0);
    for (i, y) in stage.cut.y_mm.iter().enumerate() {
        if y.abs() > best.1 {
            best = (i, y.abs());
        }
    }
    best.0
}

/// What a bilateral steady rest would do where the shaft gives way most, as compliant as the stiffest support that
/// carries: the same cuts with it, at a sample of the stations. `None` where the rest would stand at a support, or beyond
/// the one that an effect calls headstock or tailstock: it would be taken for that one.
pub(in crate::deflection_compensation) fn one_more_rest(
    job: &Job,
    grid: &Grid,
    acting: &Acting,
    stage: &Stage,
    monitor: &dyn Monitor,
) -> Result<Option<OneMoreRest>, Failure> {
    let Some(&z_mm) = grid.z_mm.get(most_deflected(stage)) else { return Ok(None) };
    let near = 0.01 * grid.length_mm;
    let at_support = job.supports.iter().filter_map(Support::station_mm).any(|z| (z - z_mm).abs() < near);
    if at_support {
        return Ok(None);
    }
    let stiffest = job.supports.iter().filter(|s| s.carries()).map(Support::compliance_um_per_n);
    let compliance_um_per_n = stiffest.fold(f64::INFINITY, f64::min);
    // Between a few stations far apart a rest may leave more than at them: of that nothing is said.
    if grid.len() < REST_LEAST {
        return Ok(None);
    }
    let chosen = grid.sample(REST_SAMPLES);
    let (kind, z_mm) = placed(job, z_mm);
    let with_rest = held_more(job, (kind, z_mm, compliance_um_per_n));
    // With the support other effects may act by default.
    let with_rest = match settled(&with_rest, monitor) {
        Ok((with_rest, _)) => with_rest,
        Err(Failure::OutOfModel(_)) => return Ok(None),
        Err(failure) => return Err(failure),
    };
    if acting.changes_an_end() && ends(&with_rest.supports) != ends(&job.supports) {
        return Ok(None);
    }
    let sampled = grid.at(&chosen);
    let with_rest = &*with_rest;
    // All passes with it: the stock that the last one meets is thicker where the shaft was not held.
    let held = match all_cuts(with_rest, &sampled, acting, &mut |_, _, _| (), &Again(monitor)) {
        Ok((held, _)) => held,
        Err(Failure::OutOfModel(_)) => return Ok(None),
        Err(failure) => return Err(failure),
    };
    let form = Form::of(&sampled.z_mm, &held.cut.uncompensated_errors_um(&held.radii));
    Ok(form.form_error_um.map(|form_error_um| OneMoreRest { kind, z_mm, compliance_um_per_n, form_error_um }))
}

/// The same job with one more support at a station, of a compliance.
pub(in crate::deflection_compensation) fn held_more(
    job: &Job,
    (kind, z_mm, compliance_um_per_n): (AddedSupport, f64, f64),
) -> Job {
    let mut held = job.clone();
    let mut added = match kind {
        AddedSupport::SteadyRest => Support::SteadyRest {
            z_mm,
            compliance_um_per_n,
            tangential_compliance_um_per_n: None,
            one_sided: false,
            gap_um: 0.0,
        },
        AddedSupport::Centre => Support::Centre { z_mm, compliance_um_per_n, tangential_compliance_um_per_n: None },
    };
    added.fill(&job.shaft.ends_mm());
    held.supports.push(added);
    held
}

/// The support that is tried where the shaft gives way most, and its station: a steady rest, or a tailstock at a free end.
fn placed(job: &Job, z_mm: f64) -> (AddedSupport, f64) {
    let carrying = || job.supports.iter().filter(|s| s.carries()).filter_map(Support::station_mm);
    let (first, last) = (carrying().fold(f64::INFINITY, f64::min), carrying().fold(f64::NEG_INFINITY, f64::max));
    if z_mm > last {
        (AddedSupport::Centre, job.shaft.length_mm())
    } else if z_mm < first {
        (AddedSupport::Centre, 0.0)
    } else {
        (AddedSupport::SteadyRest, z_mm)
    }
}

/// The answer in words, most important first; `dominating` says what dominates.
pub(in crate::deflection_compensation) fn explanation(
    job: &Job,
    outcome: &Outcome,
    seen_along: &SeenAlong,
) -> Vec<Message> {
    let (nominal, dominating) = (nominal_path(&outcome.before), seen_along.dominating.clone());
    let mut said = match decision(job, outcome, seen_along.uncertainty_um) {
        Some(decision) => vec![decision, dominating, nominal],
        None => vec![nominal, dominating],
    };
    if let Some(conformance) = &outcome.conformance {
        let place = usize::from(said.len() > 2);
        said.splice(place..place, diameters::said(conformance));
    }
    if let Some(path) = &outcome.path {
        said.push(match (outcome.form_error_after_um, outcome.largest_error_after_um) {
            (Some(form), Some(largest)) => Message::new("compensated_path_leaves")
                .with("form_error_um", seen(form, outcome))
                .with("largest_error_um", seen(largest.abs(), outcome))
                .with("moves", f64::from(path.moves)),
            _ => Message::new("path_has_gaps").with("stations", without_command(outcome)),
        });
    }
    said.push(uncertain_by(job, seen_along.uncertainty_um));
    said.extend(worthwhile_rest(job, outcome));
    let overcut =
        outcome.one_step.iter().flat_map(|step| &step.diameter_error_um).flatten().copied().fold(0.0, f64::min);
    if overcut < 0.0 {
        said.push(Message::new("one_step_overcuts").with("undersize_um", -overcut));
    }
    said.extend(copied(job, outcome, seen_along.copying_factor));
    if seen_along.least_copying_factor < 0.0 {
        said.push(Message::new("stock_is_inverted").with("copying_factor", -seen_along.least_copying_factor));
    }
    said.extend(outcome.included_automatically.iter().map(|automatic| automatic.said(job)));
    said
}

/// By how much the diameter is uncertain, and of what.
fn uncertain_by(job: &Job, uncertainty_um: f64) -> Message {
    let said = Message::new("uncertain_by")
        .with("uncertainty_um", uncertainty_um)
        .with("effects", if job.uncertainty.effects.is_empty() { "no" } else { "yes" });
    let shares = ["force_percent", "stiffness_percent"].into_iter().zip(job.asked().of_force_and_stiffness());
    shares
        .filter_map(|(name, share)| Some((name, 100.0 * share?)))
        .fold(said, |said, (name, share)| said.with(name, share))
}

/// Whether the shaft that is cut along the compensated path keeps the tolerance of its size, as surely as that is known;
/// `None` where there is no path or no tolerance.
fn decision(job: &Job, outcome: &Outcome, uncertainty_um: f64) -> Option<Message> {
    let allowed_um = job.tolerance.diameter_um? / 2.0;
    let (before, after) = (outcome.form_error_um?, outcome.form_error_after_um?);
    let largest = outcome.largest_error_after_um?.abs();
    let unsure_um = TWO_SIDED_95 * uncertainty_um;
    let holds = if largest > allowed_um {
        "no"
    } else if largest + unsure_um > allowed_um {
        "unsure"
    } else {
        "yes"
    };
    let message = Message::new("compensation_holds")
        .with("before_um", before)
        .with("after_um", seen(after, outcome))
        .with("largest_um", seen(largest, outcome));
    Some(message.with("unsure_um", unsure_um).with("allowed_um", allowed_um).with("holds", holds))
}

/// How much of a deviation of the blank is left: after all passes, where there are several.
fn copied(job: &Job, outcome: &Outcome, of_cut: f64) -> Option<Message> {
    let of_all =
        outcome.passes.last().map(|last| largest(last.copied_so_far.iter().flatten().map(|share| share.abs())));
    let (cut, copied) = match of_all {
        Some(copied) => ("passes", copied),
        None if job.stock_profile.is_some() => ("measured", of_cut),
        None => ("nominal", of_cut),
    };
    (copied > 0.0).then(|| Message::new("stock_is_copied").with("copying_factor", copied).with("cut", cut))
}

/// One more rest, where it takes away a good part of the form error and more than the control can make.
fn worthwhile_rest(job: &Job, outcome: &Outcome) -> Option<Message> {
    let (rest, before_um) = (outcome.one_more_rest.as_ref()?, outcome.form_error_um?);
    let gain_um = before_um - rest.form_error_um;
    let code = match rest.kind {
        AddedSupport::SteadyRest => "one_more_rest_buys",
        AddedSupport::Centre => "tailstock_buys",
    };
    let message = Message::new(code)
        .with("z_mm", rest.z_mm)
        .with("form_error_um", rest.form_error_um)
        .with("compliance_um_per_n", rest.compliance_um_per_n)
        .with("before_um", before_um);
    (gain_um > WORTHWHILE * before_um && gain_um > job.path.increment_um).then_some(message)
}

/// The largest value above 0. By comparison: `f64::max` also settles signed zeros and NaN, at three times the cost.
fn largest(values: impl Iterator<Item = f64>) -> f64 {
    values.fold(0.0, |most, value| if value > most { value } else { most })
}

/// A deviation as far as the numbers themselves are known.
fn seen(deviation_um: f64, outcome: &Outcome) -> f64 {
    if deviation_um < outcome.numerical_error_um { 0.0 } else { deviation_um }
}

fn without_command(outcome: &Outcome) -> usize {
    let status = &outcome.stations.status_compensated;
    status.iter().filter(|s| !matches!(s, StatusCompensated::Ok | StatusCompensated::NoStock)).count()
}

fn nominal_path(before: &Form) -> Message {
    let message = Message::new("nominal_path_leaves")
        .with("class", before.class.map_or("incomplete", crate::deflection_compensation::model::form::FormClass::name));
    let message = message.with("form_error_um", before.form_error_um.unwrap_or(0.0));
    match before.farthest() {
        Some(farthest) => message.with("largest_error_um", farthest.diameter_error_um).with("z_mm", farthest.z_mm),
        None => message.with("largest_error_um", 0.0).with("z_mm", 0.0),
    }
}

/// What the sentences need of the stations once their arrays have gone into the answer.
pub(in crate::deflection_compensation) struct SeenAlong {
    /// What opens the gap most.
    dominating: Message,
    /// The largest standard uncertainty of the diameter, um.
    uncertainty_um: f64,
    /// The largest share of a stock deviation that this cut leaves.
    copying_factor: f64,
    /// The least; below 0 where the force falls with the depth.
    least_copying_factor: f64,
}

impl SeenAlong {
    /// What stands along the last cut.
    pub(in crate::deflection_compensation) fn of(stage: &Stage, shares: &Shares, uncertainty_um: &[f64]) -> Self {
        Self {
            dominating: dominating(stage, shares),
            // The moment of the feed force alone may make it negative, too: of that the sentence does not speak.
            least_copying_factor: if stage.cut.loads.distinct().any(|loads| loads.passive_slope < 0.0) {
                stage.cut.copying.iter().flatten().copied().fold(0.0, f64::min)
            } else {
                0.0
            },
            uncertainty_um: largest(uncertainty_um.iter().copied()),
            copying_factor: largest(stage.cut.copying.iter().flatten().copied()),
        }
    }
}

/// What opens the gap most where it opens most. Where that is the passive force, who yields to it: the shares are those
/// of its compliance and say nothing of sag, couple and stated errors.
fn dominating(stage: &Stage, shares: &Shares) -> Message {
    let i = most_deflected(stage);
    let opening_mm = at(&stage.cut.y_mm, i);
    let OpeningParts { force_mm, couple_mm, sag_mm } = stage.line.parts(i, &stage.cut.loads.of(i));
    let others = [
        ("weight_dominates", sag_mm),
        ("couple_dominates", couple_mm),
        ("offset_dominates", opening_mm - force_mm - couple_mm - sag_mm),
    ];
    let most = others.into_iter().fold(others[0], |a, b| if b.1.abs() > a.1.abs() { b } else { a });
    if most.1.abs() <= force_mm.abs() {
        return yielding(stage, shares);
    }
    Message::new(most.0)
        .with("z_mm", shares.z_mm)
        .with("part_um", most.1 * UM_PER_MM)
        .with("force_um", force_mm * UM_PER_MM)
        .with("deflection_um", opening_mm * UM_PER_MM)
}

/// Who yields most to the passive force.
fn yielding(stage: &Stage, shares: &Shares) -> Message {
    let parts = [
        ("work_dominates", shares.work),
        ("headstock_dominates", shares.headstock),
        ("tailstock_dominates", shares.tailstock),
        ("rests_dominate", shares.rests),
        ("tool_dominates", shares.tool),
    ];
    let most = parts.into_iter().fold(("work_dominates", f64::NEG_INFINITY), |a, b| if b.1 > a.1 { b } else { a });
    if most.1 <= 0.0 {
        return Message::new("nothing_yields").with("z_mm", shares.z_mm);
    }
    // A machine without compliances in the job cannot be compared with the work.
    let machine = shares.headstock + shares.tailstock + shares.rests + shares.tool;
    if most.0 == "work_dominates" && machine <= 0.0 {
        return Message::new("machine_taken_as_rigid").with("z_mm", shares.z_mm);
    }
    let force = stage.cut.loads.distinct().map(|loads| loads.passive_n);
    let [least, most_n] = force.fold([f64::INFINITY, 0.0], |[least, most], n| [least.min(n), most.max(n)]);
    let is_even = u8::from(most_n <= least * (1.0 + EVEN));
    Message::new(most.0).with("share", most.1).with("z_mm", shares.z_mm).with("even", f64::from(is_even))
}

/// Where a pass before the last leaves the range in which the model holds, or what insert and spindle take.
pub(in crate::deflection_compensation) fn of_pass(
    job: &Job,
    grid: &Grid,
    stage: &Stage,
    number: usize,
) -> Vec<Finding> {
    let extremes = Extremes::of(stage);
    let mut found: Vec<Finding> = bending_stress(job, grid, stage).into_iter().collect();
    found.extend(too_deep(job, &extremes));
    found.extend(force_warnings(job, stage, &extremes));
    found.extend(spindle_limit_binds(job, stage));
    found.into_iter().map(|finding| finding.with("pass", number)).collect()
}

/// Warnings with those of passes before the last: each once, and what holds of the last pass, too, of that one.
pub(in crate::deflection_compensation) fn with_earlier(
    mut warnings: Vec<Finding>,
    earlier: Vec<Finding>,
) -> Vec<Finding> {
    let quantity = |finding: &Finding| finding.values.get("quantity").cloned();
    for finding in earlier {
        if !warnings.iter().any(|known| known.code == finding.code && quantity(known) == quantity(&finding)) {
            warnings.push(finding);
        }
    }
    warnings
}

/// Where an input leaves the range in which the model holds.
pub(in crate::deflection_compensation) fn warnings(
    job: &Job,
    grid: &Grid,
    acting: &Acting,
    stage: &Stage,
    outcome: &Outcome,
    drawn: Option<&Drawn>,
    uncertainty_um: &[f64],
) -> Vec<Finding> {
    let extremes = Extremes::of(stage);
    let mut found = deflection_warnings(job, grid, &extremes);
    found.extend(met_supports(job, grid, drawn));
    found.extend(drawn.iter().flat_map(|drawn| drawn.plunges(job)));
    found.extend(idle_rests(job, grid, stage));
    found.extend(structure_warnings(job, grid, stage, outcome));
    found.extend(command_warnings(job, &extremes, outcome));
    found.extend(force_warnings(job, stage, &extremes));
    found.extend(outcome.second_order.iter().flat_map(|sizes| left_out(job, acting, stage, sizes)));
    if outcome.path.is_some() {
        found.extend(spindle_limit_binds(job, stage));
        found.extend(grid.beyond(job).into_iter().map(stays_uncut));
    }
    found.extend(missed_tolerances(job, outcome));
    found.extend(soundness::warnings(job, grid, stage, outcome, uncertainty_um));
    found.extend(outcome.conformance.iter().flat_map(|found| diameters::warnings(&job.asked(), found)));
    found
}

/// Tolerances that even the compensated path does not keep. That of size allows half of it to either side.
fn missed_tolerances(job: &Job, outcome: &Outcome) -> Vec<Finding> {
    let missed = |code, pointer, value: Option<f64>, limit: Option<f64>| {
        let (value, limit) = (value?, limit?);
        (value > limit).then(|| Finding::new(code, pointer).measured(value, limit, "um"))
    };
    let tolerance = &job.tolerance;
    let limits = tolerance.size();
    let after = outcome.after.as_ref();
    let of = |deviation: Option<Deviation>| deviation.map(|deviation| deviation.diameter_error_um);
    let (largest, smallest) = (of(after.and_then(|form| form.largest)), of(after.and_then(|form| form.smallest)));
    let beyond = |sign: f64, value: Option<f64>, limit: Option<f64>| {
        let (value, limit) = (value?, limit?);
        (sign * (value - limit) > 0.0).then_some((value, limit))
    };
    let size =
        beyond(1.0, largest, limits.upper_um).or(beyond(-1.0, smallest, limits.lower_um)).map(|(value, limit)| {
            let pointer = tolerance.size_pointer().unwrap_or("/tolerance");
            Finding::new("size_tolerance_missed", pointer).measured(value.abs(), limit.abs(), "um")
        });
    [missed("form_tolerance_missed", "/tolerance/form_um", outcome.form_error_after_um, tolerance.form_um), size]
        .into_iter()
        .flatten()
        .collect()
}

/// A stretch that should be turned and that the path does not reach.
fn stays_uncut([from_mm, to_mm]: [f64; 2]) -> Finding {
    let finding = Finding::new("stretch_stays_uncut", "/stations").value(to_mm - from_mm, "mm");
    finding.with("from_mm", from_mm).with("to_mm", to_mm)
}

/// A spindle limit that the program states and the cut reaches: from there on the tool cuts slower than the forces and
/// the time of the answer are counted with.
fn spindle_limit_binds(job: &Job, stage: &Stage) -> Option<Finding> {
    let Speed::Surface(wanted) = stage.regime.speed else { return None };
    let limit_rpm = job.program.spindle_limit_rpm;
    let cut = stage.radii.planned().iter().zip(&stage.radii.target).filter(|(planned, target)| planned > target);
    let thinnest_mm = cut.map(|(_, target)| 2.0 * target).fold(f64::INFINITY, f64::min);
    let needed_rpm = spindle_speed_rpm(wanted, thinnest_mm);
    (needed_rpm > limit_rpm).then(|| {
        Finding::new("spindle_limit_binds", "/program/spindle_limit_rpm")
            .measured(needed_rpm, limit_rpm, "rev/min")
            .with("diameter_mm", thinnest_mm)
            .with("wanted_m_per_min", wanted)
            .with("left_m_per_min", wanted * limit_rpm / needed_rpm)
    })
}

fn deflection_warnings(job: &Job, grid: &Grid, extremes: &Extremes) -> Vec<Finding> {
    let mut found = Vec::new();
    let ratio = extremes.elastic_over_depth.value();
    let (largest, over_diameter) = (extremes.moved_mm, extremes.moved_over_diameter.value());
    let undersize = 2.0 * extremes.undersize_mm;
    if ratio > DEFLECTION_OVER_DEPTH {
        found.push(Finding::new("deflection_over_depth", "/cut").measured(ratio, DEFLECTION_OVER_DEPTH, "1"));
    }
    let limit = DEFLECTION_OVER_LENGTH * grid.length_mm;
    if largest > limit || over_diameter > DEFLECTION_OVER_DIAMETER {
        found.push(
            Finding::new("linear_theory_exceeded", "/shaft")
                .measured(largest * UM_PER_MM, limit * UM_PER_MM, "um")
                .with("over_diameter", over_diameter),
        );
    }
    if undersize > 0.0 {
        let pointer = if job.stock_profile.is_some() { "/stock_profile" } else { "/shaft/segments" };
        found.push(Finding::new("blank_undersize", pointer).value(undersize, "mm"));
    }
    found
}

/// Chucks and steady rests that the tool comes near to or would have to pass: on the way that the program takes it, or
/// from one turned segment to another.
fn met_supports(job: &Job, grid: &Grid, drawn: Option<&Drawn>) -> Vec<Finding> {
    let turned = turned_span(job, grid);
    let reach = drawn.map(|drawn| Reach::of(job, &drawn.written.program));
    let between = |i: usize, support: &Support| {
        let (kind, z_mm) = body(support)?;
        let finding = Finding::new("tool_passes_support", format!("/supports/{i}/z_mm")).value(z_mm, "mm");
        (turned[0] < z_mm && z_mm < turned[1]).then(|| finding.with("kind", kind))
    };
    let meets = |i: usize, support: &Support| reach.as_ref().and_then(|reach| met(reach, i, support));
    let supports = job.supports.iter().enumerate();
    // Where there is a path its own way counts: stations may keep clear of what stands between turned segments.
    let passed = |i: usize, support: &Support| if reach.is_some() { None } else { between(i, support) };
    supports.filter_map(|(i, support)| meets(i, support).or_else(|| passed(i, support))).collect()
}

/// First and last station of the turned segments, mm.
fn turned_span(job: &Job, grid: &Grid) -> [f64; 2] {
    let turned = |s: &Segment| job.stock_profile.is_some() || s.stock_mm() > s.diameter_mm;
    let ends = grid.steps_mm.windows(2).zip(&job.shaft.segments).filter(|(_, s)| turned(s)).map(|(ends, _)| ends);
    ends.fold([f64::INFINITY, f64::NEG_INFINITY], |span, ends| [span[0].min(ends[0]), span[1].max(ends[1])])
}

/// Rests that the shaft never touches while something is cut: beside the shaft, or open under the nominal forces, which
/// are those of the compensated cut.
fn idle_rests(job: &Job, grid: &Grid, stage: &Stage) -> Vec<Finding> {
    if job.supports.iter().all(Support::carries) {
        return Vec::new();
    }
    let mut cut = grid.sample(CONTACT_SAMPLES);
    cut.retain(|&i| stage.radii.planned()[i] > stage.radii.target[i]);
    if cut.is_empty() {
        return Vec::new();
    }
    let mut touching: Vec<usize> = cut.iter().flat_map(|&i| stage.line.touching(i, &stage.cut.loads.of(i))).collect();
    touching.sort_unstable();
    touching.dedup();
    let is_beside = |offset_mm: f64| !cut.iter().any(|&i| (0.0..=grid.length_mm).contains(&(grid.z_mm[i] + offset_mm)));
    let rests = job.supports.iter().enumerate();
    rests.filter_map(|(i, support)| idle_rest(i, support, is_beside, touching.binary_search(&i).is_ok())).collect()
}

/// A rest that stands beside the shaft, or is open where it bears on one side only.
fn idle_rest(index: usize, rest: &Support, is_beside: impl Fn(f64) -> bool, touches: bool) -> Option<Finding> {
    let (kind, offset_mm, one_sided, gap_um) = match *rest {
        Support::FollowRest { offset_mm, one_sided, gap_um, .. } => ("follow_rest", Some(offset_mm), one_sided, gap_um),
        Support::SteadyRest { one_sided, gap_um, .. } => ("steady_rest", None, one_sided, gap_um),
        Support::Centre { .. } | Support::Chuck { .. } => return None,
    };
    let finding = |field: &str, cause| {
        let finding = Finding::new("rest_never_touches", format!("/supports/{index}/{field}"));
        finding.with("kind", kind).with("cause", cause)
    };
    match offset_mm.filter(|offset_mm| is_beside(*offset_mm)) {
        Some(offset_mm) => Some(finding("offset_mm", "place").value(offset_mm, "mm")),
        None => (one_sided && !touches).then(|| finding("gap_um", "gap").value(gap_um, "um")),
    }
}

fn structure_warnings(job: &Job, grid: &Grid, stage: &Stage, outcome: &Outcome) -> Vec<Finding> {
    let mut found: Vec<Finding> = bending_stress(job, grid, stage).into_iter().collect();
    if let Some(ratio) = outcome.second_order.as_ref().and_then(|s| s.thrust_ratio).filter(|r| *r > THRUST_RATIO) {
        found.push(
            Finding::new(
                "thrust_near_buckling",
                if job.tailstock_thrust_n.is_some() { "/tailstock_thrust_n" } else { "/force" },
            )
            .measured(ratio, THRUST_RATIO, "1")
            .with("margin", ratio.recip()),
        );
    }
    let length: f64 = job.shaft.segments.iter().map(|s| s.length_mm).sum();
    let thickest = job.shaft.segments.iter().map(|s| s.diameter_mm).fold(0.0, f64::max);
    if job.shaft.theory() == Theory::EulerBernoulli && length / thickest < SLENDER {
        found.push(
            Finding::new("shear_neglected", "/shaft/theory")
                .measured(length / thickest, SLENDER, "1")
                .with("shear_um", outcome.second_order.as_ref().and_then(|s| s.shear_um).unwrap_or(0.0)),
        );
    }
    found
}

fn bending_stress(job: &Job, grid: &Grid, stage: &Stage) -> Option<Finding> {
    let limit = STRESS_SHARE * job.shaft.yield_strength_n_per_mm2?;
    let stress = peak_stress_n_per_mm2(job, grid, stage);
    (stress > limit).then(|| {
        Finding::new("bending_stress_high", "/shaft/yield_strength_n_per_mm2").measured(stress, limit, "N/mm2")
    })
}

/// |M| d/(2J) with the largest moment under the tool at a sample of its stations, by the largest of the passive and main
/// forces together, and the thinnest segment: an upper bound.
fn peak_stress_n_per_mm2(job: &Job, grid: &Grid, stage: &Stage) -> f64 {
    let force = stage.cut.loads.distinct().map(|l| l.passive_n.hypot(l.main_n)).fold(0.0, f64::max);
    let tools_mm = grid.sample(STRESS_SAMPLES).into_iter().map(|i| grid.z_mm[i]);
    let moment = force * stage.structure.beam.peak_bending_moment_mm(tools_mm);
    let stress = |s: &Segment| {
        moment * s.diameter_mm / (2.0 * crate::num::beam::second_moment_mm4(s.diameter_mm, s.bore_diameter_mm))
    };
    job.shaft.segments.iter().map(stress).fold(0.0, f64::max)
}

fn too_deep(job: &Job, extremes: &Extremes) -> Option<Finding> {
    let deepest = extremes.commanded_mm;
    let limit = job.limits.depth_mm.filter(|limit| deepest > *limit)?;
    Some(Finding::new("command_too_deep", "/limits/depth_mm").measured(deepest, limit, "mm"))
}

fn command_warnings(job: &Job, extremes: &Extremes, outcome: &Outcome) -> Vec<Finding> {
    let mut found: Vec<Finding> = too_deep(job, extremes).into_iter().collect();
    let ratio = extremes.commanded_over_depth.value();
    if ratio > DEPTH_RATIO {
        found.push(Finding::new("command_doubles_depth", "/cut").measured(ratio, DEPTH_RATIO, "1"));
    }
    if let Some(limit) = job.limits.slope {
        let steepest = outcome
            .path
            .iter()
            .flat_map(|path| &path.zones)
            .flat_map(|zone| zone.z_mm.windows(2).zip(zone.delta_x_um.windows(2)))
            .filter(|(z, _)| z[1] > z[0])
            .map(|(z, x)| ((x[1] - x[0]) / 2.0 / UM_PER_MM / (z[1] - z[0])).abs())
            .fold(0.0, f64::max);
        if steepest > limit {
            found.push(Finding::new("command_too_steep", "/limits/slope").measured(steepest, limit, "1"));
        }
    }
    found
}

/// Depth, feed and speed that the force law meets, held against the range it was measured in.
fn force_warnings(job: &Job, stage: &Stage, extremes: &Extremes) -> Vec<Finding> {
    let Some(cut) = reached(stage, extremes.least_depth_mm, extremes.largest_depth_mm) else { return Vec::new() };
    let mut found = job.force.extrapolations(&cut);
    found.extend(job.force.cautions("/force"));
    found
}
