//! Whole edges: which edge cuts what, where the tool is changed, and what the plan costs in edges (`feed/6.7`).

use crate::shaft::FeedDirection;

use crate::feed_schedule::answer::output::{ChangePlace, EdgeUse, Outcome, ToolChange, ZoneOutcome};
use crate::feed_schedule::job::case::Case;
use crate::feed_schedule::job::input::UsageScope;
use crate::feed_schedule::model::program::{EdgeLimits, Rates};

/// An edge may be passed by this share of itself: what a schedule is solved to.
pub(in crate::feed_schedule) const KEPT: f64 = 1e-8;
/// Most edges and changes that are listed.
const LISTED: usize = 1000;

/// Zones in the order in which they are cut: along the tool's way, roughing of all before the finish.
pub(in crate::feed_schedule) fn cutting_order(
    direction: FeedDirection,
    count: usize,
    is_rough: impl Fn(usize) -> bool,
) -> Vec<usize> {
    let mut order: Vec<usize> = (0..count).collect();
    if direction == FeedDirection::ToHeadstock {
        order.reverse();
    }
    order.sort_by_key(|&i| !is_rough(i));
    order
}

/// The zones of a case in the order in which they are cut.
fn order_of(case: &Case) -> Vec<usize> {
    cutting_order(case.direction, case.zones.len(), |i| case.zones[i].is_rough)
}

/// Share of an edge's life that may be used, where edges are whole.
pub(in crate::feed_schedule) fn capacity(case: &Case) -> f64 {
    let most = case.limits.tool_usage_max.filter(|_| case.limits.whole_edges);
    most.unwrap_or(1.0).min(1.0)
}

/// Share of an edge's median life that is used before it is changed: at the job's risk.
pub(in crate::feed_schedule) fn used_to(case: &Case) -> f64 {
    capacity(case) * (-case.edge_margin).exp()
}

/// Zones that one edge cuts without a change between them, in the order of the cut: those of one surface. A zone that
/// names no surface stands by itself, but for edges that are fresh for every surface, where all of these are one.
pub(in crate::feed_schedule) fn units(case: &Case) -> Vec<Vec<usize>> {
    let by_surface = case.limits.tool_usage_scope == UsageScope::Surface;
    let is_named = |i: usize| by_surface || case.zones[i].names_surface;
    let mut units: Vec<Vec<usize>> = Vec::new();
    for i in order_of(case) {
        match units.last_mut() {
            Some(unit) if is_named(i) && is_named(unit[0]) && case.zones[unit[0]].surface == case.zones[i].surface => {
                unit.push(i);
            }
            _ => units.push(vec![i]),
        }
    }
    units
}

/// Edges that one part takes of those that serve so many parts each: over a batch, the last of its edges whole.
pub(in crate::feed_schedule) fn shared(parts_per_edge: u32, batch_parts: Option<u32>) -> f64 {
    match batch_parts {
        Some(batch) => f64::from(batch.div_ceil(parts_per_edge)) / f64::from(batch),
        None => 1.0 / f64::from(parts_per_edge),
    }
}

/// Most whole parts per edge tried.
pub(in crate::feed_schedule) const MOST_PARTS: u32 = 10_000;

/// The next number of parts per edge that is worth a try: of all with which a batch takes as many edges only the least.
pub(in crate::feed_schedule) fn more_parts(parts: u32, batch_parts: Option<u32>) -> Option<u32> {
    let more = match batch_parts {
        Some(batch) => {
            let edges = batch.div_ceil(parts);
            batch.div_ceil(edges.checked_sub(1).filter(|fewer| *fewer > 0)?)
        }
        None => parts + 1,
    };
    (more <= MOST_PARTS).then_some(more)
}

/// The number of parts per edge before.
pub(in crate::feed_schedule) fn fewer_parts(parts: u32, batch_parts: Option<u32>) -> Option<u32> {
    let fewer = match batch_parts {
        Some(batch) => batch.div_ceil(batch.div_ceil(parts) + 1),
        None => parts.checked_sub(1)?,
    };
    (1..parts).contains(&fewer).then_some(fewer)
}

/// The edges of a schedule.
#[derive(Debug, Clone, PartialEq, Default)]
pub(in crate::feed_schedule) struct Plan {
    /// Edges that one part takes; 1 where one serves several parts.
    count: u32,
    /// Whole parts that one edge serves.
    parts_per_edge: u32,
    batch_parts: Option<u32>,
    pub edges: Vec<EdgeUse>,
    pub changes: Vec<ToolChange>,
}

impl Plan {
    /// Edges per part.
    pub(in crate::feed_schedule) fn per_part(&self) -> f64 {
        f64::from(self.count) * shared(self.parts_per_edge, self.batch_parts)
    }
}

struct Filling<'a> {
    case: &'a Case,
    /// What an edge may be used to, with what rounding adds.
    most: f64,
    plan: Plan,
    edge: EdgeUse,
}

/// A count; what is beyond any is the most that can be counted.
#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "not negative; the cast saturates")]
pub(in crate::feed_schedule) fn counted(value: f64) -> u32 {
    value as u32
}

/// What one edge after the other cuts, each filled as far as it goes: no other way needs fewer. The tool is changed
/// between units; inside one only where it alone takes more than an edge.
///
/// `None` without a tool life.
fn plan(case: &Case, zones: &[ZoneOutcome], parts: Option<u32>) -> Option<Plan> {
    let usage: Vec<f64> = zones.iter().map(|zone| zone.tool_usage).collect::<Option<_>>()?;
    let fresh_always = case.limits.tool_usage_scope == UsageScope::Surface;
    let most = used_to(case) * (1.0 + KEPT);
    let batch_parts = case.limits.batch_parts;
    let plan = Plan { count: 1, batch_parts, ..Plan::default() };
    let mut filling = Filling { case, most, plan, edge: EdgeUse::default() };
    let mut last: Option<usize> = None;
    for unit in units(case) {
        let whole: f64 = unit.iter().map(|&i| usage[i]).sum();
        let over = filling.edge.tool_usage + whole > most;
        if let (Some(before), true) = (last, fresh_always || (over && whole <= most)) {
            filling.change(before, unit[0], 0.0);
        }
        for &i in &unit {
            filling.cut(last, i, usage[i]);
            last = Some(i);
        }
    }
    let Filling { mut plan, edge, .. } = filling;
    let used = edge.tool_usage;
    plan.parts_per_edge = parts.unwrap_or(1);
    if plan.count == 1 && !fresh_always && used > 0.0 && parts.is_none() {
        // Beyond a million parts nobody counts, beyond a batch there are none.
        plan.parts_per_edge = counted((most / used).floor().clamp(1.0, batch_parts.map_or(1e6, f64::from)));
    }
    let order = order_of(case);
    if let (Some(&first), Some(&last)) = (order.first(), order.last()) {
        let parts = plan.parts_per_edge;
        let after = ToolChange {
            place: ChangePlace::BetweenParts,
            edge: 1,
            after_zone: case.zones[last].id.clone(),
            before_zone: case.zones[first].id.clone(),
            pass: 1,
            z_mm: begins_mm(case, first),
            tool_usage: used * f64::from(parts),
            every_parts: parts,
        };
        push(&mut plan.changes, after);
    }
    push(&mut plan.edges, edge);
    Some(plan)
}

/// Lists an item unless there are too many.
fn push<T>(list: &mut Vec<T>, item: T) {
    if list.len() < LISTED {
        list.push(item);
    }
}

/// Where the cut of a zone begins.
fn begins_mm(case: &Case, index: usize) -> f64 {
    let zone = &case.zones[index];
    if case.direction == FeedDirection::ToHeadstock { zone.to_mm } else { zone.from_mm }
}

impl Filling<'_> {
    /// A fresh edge after so much of a zone's cut, 0 at its begin.
    fn change(&mut self, before: usize, zone: usize, done: f64) {
        let of = &self.case.zones[zone];
        let passes = f64::from(of.repeat);
        // An edge that is used up with a pass is changed before the next one, not a hair before the end.
        let whole = (done * passes).round();
        let done_passes = if (done * passes - whole).abs() < KEPT && whole < passes { whole } else { done * passes };
        let pass = done_passes.floor().min(passes - 1.0);
        let along = (done_passes - pass) * of.length_mm();
        let begin = begins_mm(self.case, zone);
        let to_headstock = self.case.direction == FeedDirection::ToHeadstock;
        let edge = std::mem::take(&mut self.edge);
        self.plan.count = self.plan.count.saturating_add(1);
        let change = ToolChange {
            place: if done > 0.0 { ChangePlace::InsideZone } else { ChangePlace::BetweenZones },
            edge: self.plan.count,
            after_zone: self.case.zones[before].id.clone(),
            before_zone: of.id.clone(),
            pass: counted(pass) + 1,
            z_mm: if to_headstock { begin - along } else { begin + along },
            tool_usage: edge.tool_usage,
            every_parts: 1,
        };
        push(&mut self.plan.edges, edge);
        push(&mut self.plan.changes, change);
    }

    /// Cuts a zone, with changes inside where it wears out what it is cut with.
    fn cut(&mut self, last: Option<usize>, zone: usize, usage: f64) {
        let mut left = usage;
        while self.edge.tool_usage + left > self.most {
            let room = (self.most / (1.0 + KEPT) - self.edge.tool_usage).max(0.0);
            if self.plan.edges.len() >= LISTED {
                // Too many to list: the rest is counted.
                let more = ((left - room) / self.most).ceil();
                self.plan.count = self.plan.count.saturating_add(counted(more));
                left -= room + (more - 1.0) * self.most;
                self.edge.tool_usage = 0.0;
                break;
            }
            // What is left of an edge by rounding alone begins no zone.
            if room > KEPT {
                self.uses(zone, room);
                left -= room;
                self.change(zone, zone, 1.0 - left / usage);
            } else {
                self.change(last.unwrap_or(zone), zone, 0.0);
            }
        }
        self.uses(zone, left.max(0.0));
    }

    fn uses(&mut self, zone: usize, usage: f64) {
        let of = &self.case.zones[zone];
        let surface = &self.case.surfaces[of.surface];
        if self.edge.surfaces.last() != Some(surface) {
            self.edge.surfaces.push(surface.clone());
        }
        if self.edge.zones.last() != Some(&of.id) {
            self.edge.zones.push(of.id.clone());
        }
        self.edge.tool_usage += usage;
    }
}

/// Writes the edges of the answer's own zones into it, and what the plan costs with them.
pub(in crate::feed_schedule) fn recount(case: &Case, outcome: &mut Outcome) {
    let Some(plan) = plan(case, &outcome.zones, outcome.parts_per_edge) else { return };
    if let Some(rates) = Rates::of(case) {
        outcome.whole_edge_objective =
            Some(rates.fixed + rates.per_minute * outcome.cutting_time_min + rates.per_edge * plan.per_part());
    }
    if case.limits.whole_edges
        && let Some(whole) = outcome.whole_edge_objective
    {
        outcome.objective = whole;
    }
    outcome.edges_per_part = Some(plan.per_part());
    outcome.edges = plan.edges;
    outcome.tool_changes = plan.changes;
}

/// What every edge of an answer with whole edges may cut.
pub(in crate::feed_schedule) fn limits_of(case: &Case, outcome: &Outcome) -> EdgeLimits {
    let per_part = outcome.edges_per_part.unwrap_or(1.0);
    let after = outcome.tool_changes.iter().find(|change| change.place == ChangePlace::BetweenParts);
    let most = capacity(case) * (1.0 / f64::from(after.map_or(1, |change| change.every_parts)));
    let zone = |id: &String| case.zones.iter().position(|zone| zone.id == *id);
    let group = |edge: &EdgeUse| (edge.zones.iter().filter_map(zone).collect(), most);
    EdgeLimits::new(per_part, outcome.edges.iter().map(group).collect())
}
