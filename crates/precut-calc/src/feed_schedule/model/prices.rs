//! What every number of the job that limits costs: one price for one number, however many rows it enters (`feed/6.6`).

use crate::calculator::{Failure, Monitor};

use crate::feed_schedule::answer::output::{Looser, NextWhole, Price, PriceBasis};
use crate::feed_schedule::job::case::{Case, PassSplit};
use crate::feed_schedule::job::compliance::Held;
use crate::feed_schedule::job::input::{Goal, Job};
use crate::feed_schedule::model::dual::{Active, NEAR};
use crate::feed_schedule::model::edges::capacity;
use crate::feed_schedule::model::program::{EdgeLimits, Kind, Label, Place, Variation};
use crate::feed_schedule::model::solve::{Solved, Unsolved, solve_as};

/// A multiplier up to this is none.
const NONE: f64 = 1e-9;
/// Gains up to this are rounding, percent.
const LEAST: f64 = 1e-4;
/// Step of a number that is solved anew, in logarithms: far above what a schedule is solved to, and short enough for prices
/// that change by a fifth within a thousandth.
pub(in crate::feed_schedule) const STEP: f64 = 1e-5;
/// Most numbers solved anew: those that cost most.
const TRIED: usize = 16;
/// A difference within this of the price, relative and in percent, is the price.
const AGREES: (f64, f64) = (2e-3, 3e-5);

/// A number of the job in a row: its place, whether less of it is looser, and how the row moves with its logarithm.
struct Knob {
    pointer: String,
    /// The constraint that it is called by, and its zone.
    name: (String, String),
    lower: bool,
    weight: f64,
    /// Something else holds the row where it is: looser alone buys nothing.
    is_held: bool,
}

/// What re-solving needs beside the schedule itself.
pub(in crate::feed_schedule) struct Again<'a> {
    pub job: &'a Job,
    pub held: Option<&'a Held>,
    pub split: Option<PassSplit>,
    /// Whether the zones are those of the job: found ones cannot be solved anew with another limit.
    pub is_possible: bool,
}

/// Prices of all numbers that bind, the most costly first; whole numbers last.
pub(in crate::feed_schedule) fn prices(
    case: &Case,
    solved: &Solved,
    again: &Again<'_>,
    monitor: &dyn Monitor,
) -> Result<Vec<Price>, Failure> {
    let solution = &solved.certificate;
    let active = Active::of(solved);
    let multipliers = solution.row_multipliers.iter().chain(&solution.sum_multipliers);
    let labels = solved.built.rows.iter().chain(&solved.built.sums);
    let mut found: Vec<(Price, Vec<(usize, f64)>)> = Vec::new();
    let mut held: Vec<String> = Vec::new();
    let mut places: std::collections::HashMap<String, usize> = std::collections::HashMap::new();
    for (row, (label, &multiplier)) in labels.zip(multipliers).enumerate() {
        if multiplier <= NONE && !active.holds(row) {
            continue;
        }
        for knob in knobs(label, case, again.job, is_upper_spread(solved, row)) {
            // One percent of a semi-log limit is so many units of its row.
            let by = knob.weight * if label.plain { label.limit.abs() } else { 1.0 };
            if knob.is_held {
                held.push(knob.pointer.clone());
            }
            let at = *places.entry(knob.pointer.clone()).or_insert_with(|| {
                found.push((priceless(&knob, label), Vec::new()));
                found.len() - 1
            });
            let (price, rows) = &mut found[at];
            price.gain_percent = price.gain_percent.map(|gain| gain + multiplier * by * solved.gain);
            rows.push((row, by));
        }
    }
    found.retain(|(price, _)| price.gain_percent.is_some_and(|gain| gain > LEAST));
    found.sort_by(|a, b| b.0.gain_percent.unwrap_or(0.0).total_cmp(&a.0.gain_percent.unwrap_or(0.0)));
    let mut tries = if active.is_known() { TRIED } else { TRIED / 4 };
    for (price, rows) in &mut found {
        // Of a shared risk every limit has its part of one multiplier, whichever others bind.
        if solved.shares_risk || active.settles(rows) && !held.contains(&price.pointer) {
            continue;
        }
        price.basis = PriceBasis::OneOfSeveral;
        if tries > 0 && again.is_possible {
            tries -= 1;
            try_it(price, case, solved, again, monitor)?;
        }
    }
    let mut prices: Vec<Price> = found.into_iter().map(|(price, _)| price).collect();
    prices.retain(|price| price.gain_percent.is_some_and(|gain| gain > LEAST) || price.loss_percent.is_some());
    prices.sort_by(|a, b| b.gain_percent.unwrap_or(0.0).total_cmp(&a.gain_percent.unwrap_or(0.0)));
    prices.extend(whole_parts(solved));
    Ok(prices)
}

fn priceless(knob: &Knob, label: &Label) -> Price {
    Price {
        pointer: knob.pointer.clone(),
        constraint: knob.name.0.clone(),
        zone: knob.name.1.clone(),
        looser: if knob.lower { Looser::Less } else { Looser::More },
        gain_percent: Some(0.0),
        loss_percent: None,
        basis: PriceBasis::Multipliers,
        limit: label.limit,
        unit: label.unit.to_owned(),
        next: None,
    }
}

/// A whole number of parts has no price, but a neighbour.
fn whole_parts(solved: &Solved) -> Option<Price> {
    let parts = solved.parts_per_edge?;
    let row = solved.built.sums.iter().position(|label| label.kind == Kind::WholeParts)?;
    (solved.certificate.sum_multipliers[row] * solved.gain > LEAST).then(|| Price {
        pointer: "/limits/whole_parts_per_edge".to_owned(),
        constraint: Kind::WholeParts.name().into_owned(),
        zone: "part".to_owned(),
        looser: Looser::More,
        gain_percent: None,
        loss_percent: None,
        basis: PriceBasis::Whole,
        limit: f64::from(parts),
        unit: "1".to_owned(),
        next: solved.one_part_more.map(|objective| NextWhole { parts_per_edge: parts + 1, objective }),
    })
}

/// Both rows of a spread bear its name, but only the one with the ratio moves with it.
fn is_upper_spread(solved: &Solved, row: usize) -> bool {
    let rows = &solved.built.rows;
    row > 0 && row < rows.len() && rows[row].kind == Kind::Spread && rows[row - 1] == rows[row]
}

/// The numbers of the job behind a row.
fn knobs(label: &Label, case: &Case, job: &Job, upper_spread: bool) -> Vec<Knob> {
    let zone = if let Place::Zone(i) = label.place { Some(i) } else { None };
    let kind = label.kind.name().into_owned();
    let of =
        |pointer: String, name: (String, String), lower| Knob { pointer, name, lower, weight: 1.0, is_held: false };
    let general = |pointer: &str| of(pointer.to_owned(), (kind.clone(), "part".to_owned()), label.lower);
    let of_zone = |field: &str| {
        zone.map(|i| {
            let index = case.zones[i].index;
            of(format!("/zones/{index}/{field}"), (kind.clone(), job.zones[index].id.clone()), label.lower)
        })
    };
    let further =
        |pointer: &str, field: &str, lower| of(pointer.to_owned(), (field.to_owned(), "part".to_owned()), lower);
    match &label.kind {
        Kind::Deflection => {
            let left = job.limits.as_ref().is_some_and(|limits| limits.deflection_residual_fraction < 1.0);
            let kappa =
                left.then(|| further("/limits/deflection_residual_fraction", "deflection_residual_fraction", true));
            of_zone("deflection_max_um").into_iter().chain(kappa).collect()
        }
        Kind::Epigraph => {
            // The objective is relative to the limit.
            let (field, name) = match case.goal {
                Goal::Deflection {} => ("deflection_max_um", "deflection"),
                Goal::Roughness {} => ("roughness_max_um", "roughness"),
                _ => return Vec::new(),
            };
            let knob = of_zone(field).map(|knob| Knob { name: (name.to_owned(), knob.name.1.clone()), ..knob });
            knob.into_iter().collect()
        }
        Kind::Roughness => of_zone("roughness_max_um").into_iter().collect(),
        Kind::Hardening => of_zone("hardening_max_percent").into_iter().collect(),
        Kind::HardeningDepth => of_zone("hardening_depth_max_um").into_iter().collect(),
        Kind::ToolLifeMin => vec![general("/limits/tool_life_min_min")],
        Kind::ToolUsage => vec![general("/limits/tool_usage_max")],
        Kind::WholeEdge => {
            let given = job.limits.as_ref().and_then(|limits| limits.tool_usage_max);
            // Beyond a whole edge there is none.
            let knob = |most: f64| Knob {
                is_held: most.ln() >= -NEAR,
                ..further("/limits/tool_usage_max", "tool_usage", false)
            };
            given.map(knob).into_iter().collect()
        }
        Kind::TimeMax => vec![general("/limits/time_max_min")],
        Kind::Power => {
            let mut knobs = vec![general("/machine/power_kw")];
            if job.machine.efficiency < 1.0 {
                knobs.push(further("/machine/efficiency", "efficiency", false));
            }
            knobs
        }
        Kind::Torque => vec![general("/machine/torque_n_m")],
        Kind::ForceZ => vec![general("/limits/force_z_max_n")],
        Kind::ForceY => vec![general("/limits/force_y_max_n")],
        Kind::RpmMin => vec![general("/machine/spindle_speed_min_rpm")],
        Kind::RpmMax => vec![general("/machine/spindle_speed_max_rpm")],
        Kind::FeedRateMax => vec![general("/machine/feed_rate_max_mm_per_min")],
        Kind::FeedMin => vec![general("/limits/feed_min_mm_per_rev")],
        Kind::FeedMax => {
            let index = zone.map(|i| case.zones[i].index);
            let own = index.and_then(|index| job.zones[index].feed_max_mm_per_rev);
            let all = job.limits.as_ref().map_or(f64::INFINITY, |limits| limits.feed_max_mm_per_rev);
            let of_all = general("/limits/feed_max_mm_per_rev");
            let own = own.and_then(|own| Some(((own / all).ln(), of_zone("feed_max_mm_per_rev")?)));
            match own {
                // Of two alike each holds the feed without the other.
                Some((apart, own)) if apart.abs() <= NEAR => {
                    [own, of_all].map(|knob| Knob { is_held: true, ..knob }).into_iter().collect()
                }
                Some((apart, own)) if apart < 0.0 => vec![own],
                _ => vec![of_all],
            }
        }
        Kind::SpeedMin => vec![general("/limits/speed_min_m_per_min")],
        Kind::SpeedMax => vec![general("/limits/speed_max_m_per_min")],
        Kind::FeedStep => vec![general("/limits/feed_step_ratio_max")],
        Kind::Spread if upper_spread => vec![general("/limits/deflection_spread_ratio_max")],
        Kind::Custom(name) => {
            let bound = |min: bool| if min { "min" } else { "max" };
            let same = |limit: Option<f64>| limit.is_some_and(|limit| limit.total_cmp(&label.limit).is_eq());
            let is_it = |custom: &crate::feed_schedule::job::input::CustomLimit| {
                custom.name == *name && same(if label.lower { custom.min } else { custom.max })
            };
            job.custom
                .iter()
                .position(is_it)
                .map(|k| general(&format!("/custom/{k}/{}", bound(label.lower))))
                .into_iter()
                .collect()
        }
        Kind::Coupling(name) => {
            let at = job.couplings.iter().position(|coupling| coupling.name == *name);
            at.map(|k| general(&format!("/couplings/{k}/max"))).into_iter().collect()
        }
        Kind::Spread | Kind::WholeParts | Kind::FeedGradient | Kind::Trust => Vec::new(),
    }
}

/// Turns the number both ways and solves anew.
fn try_it(
    price: &mut Price,
    case: &Case,
    solved: &Solved,
    again: &Again<'_>,
    monitor: &dyn Monitor,
) -> Result<(), Failure> {
    let sign = if price.looser == Looser::Less { -1.0 } else { 1.0 };
    let Slope::Of(gain) = slope(price, sign, case, solved, again, monitor)? else { return Ok(()) };
    let loss = match slope(price, -sign, case, solved, again, monitor)? {
        Slope::Of(loss) => Some(loss),
        Slope::Impossible => None,
        Slope::Unknown => return Ok(()),
    };
    let gain = gain.max(0.0);
    let agrees = |a: f64, b: f64| (a - b).abs() <= AGREES.0 * a.abs().max(b.abs()) + AGREES.1;
    let multiplier = price.gain_percent.unwrap_or(gain);
    if agrees(gain, multiplier) && loss.is_some_and(|loss| agrees(loss, multiplier)) {
        price.basis = PriceBasis::Multipliers;
        return Ok(());
    }
    price.basis = PriceBasis::SolvedAnew;
    price.gain_percent = Some(gain);
    price.loss_percent = loss;
    Ok(())
}

/// What turning a number does to the objective, percent per percent.
enum Slope {
    Of(f64),
    /// No schedule is left.
    Impossible,
    /// The schedule is not solved closely enough to tell.
    Unknown,
}

/// Turns the number up or down. In thin room a schedule is solved less closely, and a longer step tells what a short one
/// does not.
fn slope(
    price: &Price,
    sign: f64,
    case: &Case,
    solved: &Solved,
    again: &Again<'_>,
    monitor: &dyn Monitor,
) -> Result<Slope, Failure> {
    let points = matches!(case.goal, Goal::Hardening {});
    let is_looser = (sign < 0.0) == (price.looser == Looser::Less);
    for step in [STEP, 10.0 * STEP] {
        let Some((objective, gap)) = turned(price, sign * step, case, solved, again, monitor)? else {
            // Where a shorter step left a schedule, room ends between them.
            return Ok(if step > STEP { Slope::Unknown } else { Slope::Impossible });
        };
        let (from, to) = if is_looser { (solved.objective, objective) } else { (objective, solved.objective) };
        let slope = if points { (from - to) / (100.0 * step) } else { (from / to).ln() / step };
        let error = (gap + solved.certificate.gap) * solved.gain / step;
        if error <= LEAST.max(AGREES.0 * slope.abs()) {
            return Ok(Slope::Of(slope));
        }
    }
    Ok(Slope::Unknown)
}

/// The objective, and the gap of its program, with the number changed by so much in its logarithm; `None` where there is
/// no schedule. Edges are as they are, but an edge may cut one part more or less.
fn turned(
    price: &Price,
    by: f64,
    as_it_is: &Case,
    solved: &Solved,
    again: &Again<'_>,
    monitor: &dyn Monitor,
) -> Result<Option<(f64, f64)>, Failure> {
    let mut job = again.job.clone();
    let Some(number) = number(&mut job, &price.pointer) else { return Ok(None) };
    *number *= by.exp();
    let case = Case::of(&job, again.held, again.split.as_ref())?;
    // How far an edge may be used is one of the numbers.
    let further = capacity(&case) / capacity(as_it_is);
    let plans: Vec<Option<EdgeLimits>> = match &solved.whole {
        Some((limits, _)) => limits.with_neighbours().iter().map(|limits| Some(limits.used_further(further))).collect(),
        None => vec![None],
    };
    let mut best: Option<(f64, f64)> = None;
    for edges in &plans {
        let variation =
            Variation { parts_per_edge: solved.parts_per_edge, edges: edges.as_ref(), about: None, beside: &[] };
        match solve_as(&case, &variation, false, monitor) {
            Ok(turned) if best.is_none_or(|(least, _)| turned.objective < least) => {
                best = Some((turned.objective, turned.certificate.gap));
            }
            Err(Unsolved::Failed(Failure::Cancelled)) => return Err(Failure::Cancelled),
            _ => {}
        }
    }
    Ok(best)
}

/// The number of a job at a place.
fn number<'j>(job: &'j mut Job, pointer: &str) -> Option<&'j mut f64> {
    let parts: Vec<&str> = pointer.split('/').skip(1).collect();
    let machine = &mut job.machine;
    let limits = job.limits.as_mut()?;
    match parts.as_slice() {
        ["zones", index, field] => {
            let zone = job.zones.get_mut(index.parse::<usize>().ok()?)?;
            match *field {
                "deflection_max_um" => zone.deflection_max_um.as_mut(),
                "roughness_max_um" => zone.roughness_max_um.as_mut(),
                "hardening_max_percent" => zone.hardening_max_percent.as_mut(),
                "hardening_depth_max_um" => zone.hardening_depth_max_um.as_mut(),
                "feed_max_mm_per_rev" => zone.feed_max_mm_per_rev.as_mut(),
                _ => None,
            }
        }
        ["custom", index, end] => {
            let custom = job.custom.get_mut(index.parse::<usize>().ok()?)?;
            if *end == "min" { custom.min.as_mut() } else { custom.max.as_mut() }
        }
        ["couplings", index, _] => {
            job.couplings.get_mut(index.parse::<usize>().ok()?).map(|coupling| &mut coupling.max)
        }
        ["machine", field] => match *field {
            "power_kw" => machine.power_kw.as_mut(),
            "efficiency" => Some(&mut machine.efficiency),
            "torque_n_m" => machine.torque_n_m.as_mut(),
            "spindle_speed_min_rpm" => machine.spindle_speed_min_rpm.as_mut(),
            "spindle_speed_max_rpm" => machine.spindle_speed_max_rpm.as_mut(),
            "feed_rate_max_mm_per_min" => machine.feed_rate_max_mm_per_min.as_mut(),
            _ => None,
        },
        ["limits", field] => match *field {
            "feed_min_mm_per_rev" => Some(&mut limits.feed_min_mm_per_rev),
            "feed_max_mm_per_rev" => Some(&mut limits.feed_max_mm_per_rev),
            "speed_min_m_per_min" => Some(&mut limits.speed_min_m_per_min),
            "speed_max_m_per_min" => Some(&mut limits.speed_max_m_per_min),
            "tool_usage_max" => limits.tool_usage_max.as_mut(),
            "tool_life_min_min" => limits.tool_life_min_min.as_mut(),
            "time_max_min" => limits.time_max_min.as_mut(),
            "force_z_max_n" => limits.force_z_max_n.as_mut(),
            "force_y_max_n" => limits.force_y_max_n.as_mut(),
            "feed_step_ratio_max" => limits.feed_step_ratio_max.as_mut(),
            "deflection_spread_ratio_max" => limits.deflection_spread_ratio_max.as_mut(),
            "deflection_residual_fraction" => Some(&mut limits.deflection_residual_fraction),
            _ => None,
        },
        _ => None,
    }
}
