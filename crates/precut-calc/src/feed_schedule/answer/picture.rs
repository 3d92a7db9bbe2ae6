//! Figures and tables of an answer.

use std::borrow::Cow;
use std::collections::BTreeMap;

use crate::calculator::{
    Along, Axis, Column, Figure, Frame, Glyph, Handle, Item, Message, Move, Panel, Place, Role, Setting, Table,
};
use crate::shaft::handles::of_supports;
use crate::shaft::{Shaft, Support, places};

use crate::feed_schedule::answer::output::{Outcome, ZoneOutcome};
use crate::feed_schedule::answer::toolpath::path_table;
use crate::feed_schedule::job::input::{Job, Zone};
use crate::feed_schedule::job::plan::TradedLimit;

const Z: Axis = Axis::linear("station", "mm");
/// A zone whose end is pulled keeps at least this share of its length.
const LEAST_OF_ZONE: f64 = 0.1;

pub(in crate::feed_schedule) const FIGURE_IDS: &[&str] = &["schedule", "trade_off", "zones_found"];
pub(in crate::feed_schedule) const TABLE_IDS: &[&str] =
    &["zones", "binding", "path", "segments", "trade_off", "passes"];

/// Codes that the figures utter.
pub(in crate::feed_schedule) const LABEL_CODES: &[&str] = &[
    "station",
    "radius",
    "held_shaft",
    "blank",
    "feed",
    "cutting_speed",
    "radial_deflection",
    "height_of_roughness",
    "limit_gain",
    "scheduled_feed",
    "constant_feed",
    "continuous_feed",
    "scheduled_speed",
    "zone_deflection",
    "deflection_limit",
    "zone_roughness",
    "roughness_limit",
    "schedule_figure",
    "trade_off_figure",
    "zones_found_figure",
    "limit_factor",
    "objective_value",
    "handle_zone",
    "objective_over_limit",
    "limits_as_they_are",
    "zone_count",
    "binds_deflection",
    "binds_spread",
    "binds_surface",
    "binds_edge",
    "binds_time",
    "binds_machine",
    "binds_force",
    "binds_feed_bound",
    "binds_speed_bound",
    "binds_feed_step",
    "binds_other",
];

pub(in crate::feed_schedule) fn figures(job: &Job, outcome: &Outcome) -> Vec<Figure> {
    let mut panels = vec![outline(job, outcome, 0.8), feeds(outcome, 1.0), speeds(outcome, 0.6)];
    panels.extend(bindings(job, outcome, 0.45));
    if outcome.zones.iter().any(|zone| zone.deflection_um.is_some()) {
        panels.push(deflections(job, outcome, 0.9));
    }
    if outcome.zones.iter().any(|zone| zone.roughness_um.is_some()) {
        panels.push(roughnesses(job, outcome, 0.7));
    }
    let stacked = |id, title, x, panels| Figure { id, title: Message::new(title), frame: Frame::Stacked, x, panels };
    let mut figures = vec![stacked("schedule", "schedule_figure", Z, panels)];
    if !outcome.trade_off.is_empty() {
        let x = Axis::logarithmic("limit_factor", "1");
        figures.push(stacked("trade_off", "trade_off_figure", x, vec![trade_off(outcome)]));
    }
    if outcome.continuous.is_some() {
        let panels = vec![outline(job, outcome, 0.8), found(outcome)];
        figures.push(stacked("zones_found", "zones_found_figure", Z, panels));
    }
    figures
}

/// A level over every zone, with gaps where zones do not touch.
fn steps(zones: &[ZoneOutcome], value: impl Fn(&ZoneOutcome) -> Option<f64>) -> (Vec<f64>, Vec<Option<f64>>) {
    let (mut x, mut y) = (Vec::new(), Vec::new());
    for zone in zones {
        if x.last().is_some_and(|last: &f64| (zone.z_start_mm - last).abs() > 1e-6) {
            x.push(zone.z_start_mm);
            y.push(None);
        }
        x.extend([zone.z_start_mm, zone.z_end_mm]);
        y.extend([value(zone), value(zone)]);
    }
    (x, y)
}

/// Finishing passes alone: roughing ones stand over the same stretch.
fn shown(outcome: &Outcome) -> Vec<ZoneOutcome> {
    outcome.zones.iter().filter(|zone| !zone.id.ends_with(":rough")).cloned().collect()
}

fn outline(job: &Job, outcome: &Outcome, height: f64) -> Panel {
    let mut items = Vec::new();
    let (mut x, mut y) = (Vec::new(), Vec::new());
    if let Some(shaft) = &job.shaft {
        let mut left = 0.0;
        for segment in &shaft.segments {
            x.extend([left, left + segment.length_mm]);
            y.extend([segment.diameter_mm / 2.0; 2]);
            left += segment.length_mm;
        }
    } else {
        for zone in shown(outcome) {
            x.extend([zone.z_start_mm, zone.z_end_mm]);
            y.extend([zone.diameter_mm / 2.0; 2]);
        }
    }
    let (mut below_x, mut below_y) = (x.clone(), y.clone());
    below_x.reverse();
    below_y.reverse();
    x.extend(below_x);
    y.extend(below_y.into_iter().map(|r: f64| -r));
    items.push(Item::Outline { name: "held_shaft", x, y, role: Role::Part });
    for zone in shown(outcome) {
        let (r, top) = (zone.diameter_mm / 2.0, zone.diameter_mm / 2.0 + zone.depth_mm);
        items.push(Item::Outline {
            name: "blank",
            x: vec![zone.z_start_mm, zone.z_end_mm, zone.z_end_mm, zone.z_start_mm],
            y: vec![r, r, top, top],
            role: Role::Stock,
        });
    }
    let radius_at = |z_mm: f64| {
        let segments = job.shaft.iter().flat_map(|shaft| &shaft.segments);
        let mut right = 0.0;
        let ends = segments.map(|segment| {
            right += segment.length_mm;
            (right, segment.diameter_mm / 2.0)
        });
        let ends: Vec<(f64, f64)> = ends.collect();
        ends.iter().find(|(right, _)| z_mm <= *right).or(ends.last()).map_or(0.0, |(_, radius)| *radius)
    };
    for (i, support) in job.supports.iter().enumerate() {
        let glyph = match support {
            Support::Centre { .. } if i == 0 => Glyph::CentreLeft,
            Support::Centre { .. } => Glyph::CentreRight,
            Support::Chuck { .. } => Glyph::Chuck,
            Support::SteadyRest { .. } => Glyph::SteadyRest,
            Support::FollowRest { .. } => Glyph::FollowRest,
        };
        if let (Some(z), Some(_)) = (support.station_mm(), &job.shaft) {
            // Centres and jaws hold the axis; a rest bears on the surface.
            let on_surface = matches!(glyph, Glyph::SteadyRest | Glyph::FollowRest);
            items.push(Item::Glyph { glyph, x: z, y: if on_surface { radius_at(z) } else { 0.0 } });
        }
    }
    // Its zones have diameters of their own: of the shaft nothing can be pulled alone.
    items.extend(job.shaft.iter().flat_map(|shaft| of_supports(shaft, &job.supports)));
    items.extend(job.zones.windows(2).enumerate().filter_map(|(i, pair)| meeting(job, i, &pair[0], &pair[1])));
    Panel { y: Axis::linear("radius", "mm"), height, items }
}

/// Where two zones meet within a segment: what one gains the other loses, and neither leaves its segment.
fn meeting(job: &Job, i: usize, before: &Zone, after: &Zone) -> Option<Item> {
    let z = before.z_end_mm;
    let ends_mm = job.shaft.as_ref().map_or_else(|| vec![before.z_start_mm, after.z_end_mm], Shaft::ends_mm);
    let left = ends_mm.iter().copied().rfind(|end| *end <= z)?;
    let right = ends_mm.iter().copied().find(|end| *end > z)?;
    let is_within = places::same(z, after.z_start_mm) && !places::same(z, left) && !places::same(z, right);
    let keeps = |zone: &Zone| LEAST_OF_ZONE * (zone.z_end_mm - zone.z_start_mm);
    let least = (before.z_start_mm + keeps(before)).max(left + keeps(before));
    let most = (after.z_end_mm - keeps(after)).min(right - keeps(after));
    let follows = |k: usize, field: &str| Move { pointer: format!("/zones/{k}/{field}"), per_unit: 1.0 };
    (is_within && least <= z && z <= most).then(|| {
        Item::Handle(Handle {
            name: "handle_zone",
            x: z,
            y: -before.diameter_mm.max(after.diameter_mm) / 2.0,
            along: Along::X,
            reach: [least, most],
            stops: Vec::new(),
            moves: vec![follows(i, "z_end_mm"), follows(i + 1, "z_start_mm")],
        })
    })
}

fn feeds(outcome: &Outcome, height: f64) -> Panel {
    let zones = shown(outcome);
    let (x, y) = steps(&zones, |zone| Some(zone.feed_mm_per_rev));
    let mut items = Vec::new();
    if let (Some(constant), Some(first), Some(last)) = (&outcome.comparison.constant_feed, zones.first(), zones.last())
    {
        items.push(Item::Line {
            name: "constant_feed",
            x: vec![first.z_start_mm, last.z_end_mm],
            y: vec![Some(constant.feed_mm_per_rev); 2],
            role: Role::Comparison,
        });
    }
    items.push(Item::Line { name: "scheduled_feed", x, y, role: Role::Command });
    Panel { y: Axis::linear("feed", "mm/rev"), height, items }
}

fn speeds(outcome: &Outcome, height: f64) -> Panel {
    let (x, y) = steps(&shown(outcome), |zone| Some(zone.speed_m_per_min));
    let items = vec![Item::Line { name: "scheduled_speed", x, y, role: Role::Command }];
    Panel { y: Axis::linear("cutting_speed", "m/min"), height, items }
}

fn deflections(job: &Job, outcome: &Outcome, height: f64) -> Panel {
    let zones = shown(outcome);
    let (x, y) = steps(&zones, |zone| zone.zone_of(job)?.deflection_max_um);
    let mut items = vec![Item::Line { name: "deflection_limit", x, y, role: Role::Limit }];
    let (x, y) = steps(&zones, |zone| zone.deflection_um);
    items.push(Item::Line { name: "zone_deflection", x, y, role: Role::After });
    Panel { y: Axis::linear("radial_deflection", "um"), height, items }
}

fn roughnesses(job: &Job, outcome: &Outcome, height: f64) -> Panel {
    let zones = shown(outcome);
    let (x, y) = steps(&zones, |zone| zone.zone_of(job)?.roughness_max_um);
    let mut items = vec![Item::Line { name: "roughness_limit", x, y, role: Role::Limit }];
    let (x, y) = steps(&zones, |zone| zone.roughness_um);
    items.push(Item::Line { name: "zone_roughness", x, y, role: Role::After });
    Panel { y: Axis::linear("height_of_roughness", "um"), height, items }
}

/// What kind of limit a name stands for. Eight numbers have colours of their own: the kinds that share one hardly ever
/// bind together.
fn family(constraint: &str) -> (&'static str, u8) {
    match constraint {
        "deflection" => ("binds_deflection", 0),
        "deflection_spread" => ("binds_spread", 1),
        "roughness" | "hardening" | "hardening_depth" => ("binds_surface", 2),
        "tool_usage" | "tool_life_min" => ("binds_edge", 3),
        "speed_min" | "speed_max" => ("binds_speed_bound", 4),
        "power" | "torque" | "rpm_min" | "rpm_max" | "feed_rate_max" => ("binds_machine", 5),
        "feed_step" | "feed_gradient" => ("binds_feed_step", 6),
        "feed_min" | "feed_max" => ("binds_feed_bound", 7),
        "time_max" => ("binds_time", 8),
        "force_z" | "force_y" => ("binds_force", 9),
        _ => ("binds_other", 10),
    }
}

/// The stretches over which a limit holds, by the name of its place: its zones, those of its surface, or the part.
fn holds_over(job: &Job, zones: &[ZoneOutcome], place: &str) -> Vec<usize> {
    let over = |test: &dyn Fn(&ZoneOutcome) -> bool| -> Vec<usize> {
        zones.iter().enumerate().filter(|(_, zone)| test(zone)).map(|(at, _)| at).collect()
    };
    let named = over(&|zone| place.split('|').any(|part| part == zone.id));
    let on_surface = || over(&|zone| zone.zone_of(job).is_some_and(|own| own.surface.as_deref() == Some(place)));
    match (named.is_empty(), place) {
        (false, _) => named,
        (true, "part") => over(&|_| true),
        (true, _) => on_surface(),
    }
}

/// Which limits bind where, and what one percent more of each buys; `None` where no limit is known to.
fn bindings(job: &Job, outcome: &Outcome, height: f64) -> Option<Panel> {
    let zones = shown(outcome);
    // By kind, what its limits buy over each zone.
    let mut kinds: BTreeMap<(u8, &'static str), Vec<f64>> = BTreeMap::new();
    for bound in outcome.binding.iter().filter(|bound| bound.gain_percent > 0.0) {
        let (name, series) = family(&bound.constraint);
        let gains = kinds.entry((series, name)).or_insert_with(|| vec![0.0; zones.len()]);
        for at in holds_over(job, &zones, &bound.zone) {
            gains[at] += bound.gain_percent;
        }
    }
    let ribbon = |((series, name), gains): ((u8, &'static str), Vec<f64>)| {
        let held: Vec<(&ZoneOutcome, f64)> = zones.iter().zip(gains).filter(|(_, gain)| *gain > 0.0).collect();
        (!held.is_empty()).then(|| Item::Ribbon {
            name,
            x: held.iter().map(|(zone, _)| zone.z_start_mm).collect(),
            x_end: held.iter().map(|(zone, _)| zone.z_end_mm).collect(),
            weight: held.iter().map(|(_, gain)| *gain).collect(),
            places: held.iter().map(|(zone, _)| zone.id.clone()).collect(),
            role: Role::Series(series),
        })
    };
    let items: Vec<Item> = kinds.into_iter().filter_map(ribbon).collect();
    (!items.is_empty()).then(|| Panel { y: Axis::linear("limit_gain", "percent"), height, items })
}

fn trade_off(outcome: &Outcome) -> Panel {
    let x = outcome.trade_off.iter().map(|point| point.factor).collect();
    let y = outcome.trade_off.iter().map(|point| point.objective).collect();
    let unit = match outcome.objective_unit.as_str() {
        "min" => "min",
        "money" => "money",
        "percent" => "percent",
        _ => "1",
    };
    let here =
        Setting { name: "limits_as_they_are", x: 1.0, y: outcome.objective, tried_in: Some("schedule"), about: None };
    let line = Item::Line { name: "objective_over_limit", x, y, role: Role::Command };
    let items = vec![line, Item::Setting(here)];
    Panel { y: Axis::linear("objective_value", unit), height: 1.0, items }
}

/// The job of a place on the trade-off curve: all limits of its kind so many times what they are, to four digits.
pub(in crate::feed_schedule) fn at_place(job: &Job, place: &Place<'_>) -> Option<Job> {
    let traded = job.trade_off.as_ref().filter(|_| place.figure == "trade_off" && place.x > 0.0)?.limit;
    let mut next = job.clone();
    let limits: Vec<&mut Option<f64>> = match traded {
        TradedLimit::Deflection => next.zones.iter_mut().map(|zone| &mut zone.deflection_max_um).collect(),
        TradedLimit::Roughness => next.zones.iter_mut().map(|zone| &mut zone.roughness_max_um).collect(),
        TradedLimit::ToolUsage => next.limits.iter_mut().map(|limits| &mut limits.tool_usage_max).collect(),
        TradedLimit::Time => next.limits.iter_mut().map(|limits| &mut limits.time_max_min).collect(),
    };
    for limit in limits.into_iter().flatten() {
        *limit = four_digits(*limit * place.x);
    }
    Some(next)
}

fn four_digits(value: f64) -> f64 {
    if value > 0.0 {
        let scale = 10_f64.powf(3.0 - value.log10().floor());
        (value * scale).round() / scale
    } else {
        value
    }
}

fn found(outcome: &Outcome) -> Panel {
    let mut items = Vec::new();
    if let Some(continuous) = &outcome.continuous {
        items.push(Item::Line {
            name: "continuous_feed",
            x: continuous.z_mm.clone(),
            y: continuous.feed_mm_per_rev.iter().copied().map(Some).collect(),
            role: Role::Limit,
        });
    }
    let (x, y) = steps(&outcome.zones, |zone| Some(zone.feed_mm_per_rev));
    items.push(Item::Line { name: "scheduled_feed", x, y, role: Role::Command });
    Panel { y: Axis::linear("feed", "mm/rev"), height: 1.2, items }
}

pub(in crate::feed_schedule) fn tables(job: &Job, outcome: &Outcome) -> Vec<Table> {
    vec![
        zones(outcome),
        binding(outcome),
        path_table(job, outcome),
        segments(outcome),
        trade_off_table(outcome),
        passes(outcome),
    ]
}

fn words<'a>(items: impl Iterator<Item = &'a str>) -> Vec<Cow<'static, str>> {
    items.map(|item| Cow::Owned(item.to_owned())).collect()
}

fn zones(outcome: &Outcome) -> Table {
    let all = &outcome.zones;
    let number = |name, unit, value: &dyn Fn(&ZoneOutcome) -> f64| {
        Column::numbers(name, unit, &all.iter().map(value).collect::<Vec<_>>())
    };
    let optional = |name, unit, value: &dyn Fn(&ZoneOutcome) -> Option<f64>| {
        Column::optional(name, unit, &all.iter().map(value).collect::<Vec<_>>())
    };
    Table {
        id: "zones",
        columns: vec![
            Column::words("zone", words(all.iter().map(|zone| zone.id.as_str()))),
            number("z_start", "mm", &|zone| zone.z_start_mm),
            number("z_end", "mm", &|zone| zone.z_end_mm),
            number("diameter", "mm", &|zone| zone.diameter_mm),
            number("depth", "mm", &|zone| zone.depth_mm),
            number("feed", "mm/rev", &|zone| zone.feed_mm_per_rev),
            number("speed", "m/min", &|zone| zone.speed_m_per_min),
            number("spindle_speed", "rev/min", &|zone| zone.spindle_speed_rpm),
            number("cutting_time", "min", &|zone| zone.cutting_time_min),
            optional("compliance", "um/N", &|zone| zone.compliance_um_per_n),
            optional("force_y", "N", &|zone| zone.force_y_n),
            optional("force_z", "N", &|zone| zone.force_z_n),
            optional("power", "kW", &|zone| zone.power_kw),
            optional("torque", "N m", &|zone| zone.torque_n_m),
            optional("deflection", "um", &|zone| zone.deflection_um),
            optional("diameter_error", "um", &|zone| zone.diameter_error_um),
            optional("roughness", "um", &|zone| zone.roughness_um),
            optional("hardening", "percent", &|zone| zone.hardening_percent),
            optional("hardening_depth", "um", &|zone| zone.hardening_depth_um),
            optional("tool_life", "min", &|zone| zone.tool_life_min),
            optional("tool_usage", "1", &|zone| zone.tool_usage),
            Column::words("active", all.iter().map(|zone| Cow::Owned(zone.active.join(" "))).collect()),
        ],
    }
}

fn binding(outcome: &Outcome) -> Table {
    let all = &outcome.binding;
    let number = |name, unit, value: &dyn Fn(&crate::feed_schedule::answer::output::Binding) -> f64| {
        Column::numbers(name, unit, &all.iter().map(value).collect::<Vec<_>>())
    };
    Table {
        id: "binding",
        columns: vec![
            Column::words("constraint", words(all.iter().map(|b| b.constraint.as_str()))),
            Column::words("zone", words(all.iter().map(|b| b.zone.as_str()))),
            number("limit", "1", &|b| b.limit),
            Column::words("unit", words(all.iter().map(|b| b.unit.as_str()))),
            number("multiplier", "1", &|b| b.multiplier),
            number("gain", "percent", &|b| b.gain_percent),
        ],
    }
}

fn segments(outcome: &Outcome) -> Table {
    let all = outcome.continuous.as_ref().map(|found| found.by_segments.as_slice()).unwrap_or_default();
    let number = |name, unit, value: &dyn Fn(&crate::feed_schedule::answer::output::SegmentTime) -> f64| {
        Column::numbers(name, unit, &all.iter().map(value).collect::<Vec<_>>())
    };
    Table {
        id: "segments",
        columns: vec![
            number("segments", "1", &|s| f64::from(s.segments)),
            number("cutting_time", "min", &|s| s.cutting_time_min),
            number("loss", "percent", &|s| s.loss_percent),
        ],
    }
}

fn trade_off_table(outcome: &Outcome) -> Table {
    let all = &outcome.trade_off;
    let optional = |name, unit, value: &dyn Fn(&crate::feed_schedule::answer::output::TradePoint) -> Option<f64>| {
        Column::optional(name, unit, &all.iter().map(value).collect::<Vec<_>>())
    };
    Table {
        id: "trade_off",
        columns: vec![
            optional("factor", "1", &|point| Some(point.factor)),
            optional("objective", "1", &|point| point.objective),
            optional("cutting_time", "min", &|point| point.cutting_time_min),
            optional("tool_usage", "1", &|point| point.tool_usage),
        ],
    }
}

fn passes(outcome: &Outcome) -> Table {
    let all = outcome.passes.as_ref().map(|passes| passes.tried.as_slice()).unwrap_or_default();
    Table {
        id: "passes",
        columns: vec![
            Column::numbers(
                "roughing_passes",
                "1",
                &all.iter().map(|p| f64::from(p.roughing_passes)).collect::<Vec<_>>(),
            ),
            Column::optional("finishing_depth", "mm", &all.iter().map(|p| p.finishing_depth_mm).collect::<Vec<_>>()),
            Column::optional("objective", "1", &all.iter().map(|p| p.objective).collect::<Vec<_>>()),
        ],
    }
}
