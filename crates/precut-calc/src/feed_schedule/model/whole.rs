//! Whole edges as part of the optimum: how many, and which cuts what (`feed/6.7`).
//!
//! With e edges and the borders between them given the problem is convex. Borders are found by branch and bound: a node
//! holds a range for every border, and what is certain of them as limits, so that no plan inside it is better than its own
//! optimum. Where the effort ends first, the least bound that is still open is told.

use crate::calculator::{Failure, Monitor};

use crate::feed_schedule::job::case::Case;
use crate::feed_schedule::job::input::UsageScope;
use crate::feed_schedule::job::models::Output;
use crate::feed_schedule::model::edges::{KEPT, capacity, counted, more_parts, units, used_to};
use crate::feed_schedule::model::program::{EdgeLimits, Rates, Variation};
use crate::feed_schedule::model::solve::{Solved, Unsolved, solve_as};

/// Programs solved in the search times zones, and least and most programs.
const EFFORT: usize = 20_000;
const PROGRAMS: (usize, usize) = (40, 2000);
/// Bounds nearer than this, relative, are equal.
const SAME: f64 = 1e-9;

/// Ranges of the borders between edges: border j stands before a unit in its range.
struct Node {
    ranges: Vec<(usize, usize)>,
    solved: Solved,
}

/// Programs that a search may solve.
pub(in crate::feed_schedule) fn programs(zones: usize) -> usize {
    (EFFORT / zones.max(1)).clamp(PROGRAMS.0, PROGRAMS.1)
}

struct Search<'a> {
    case: &'a Case,
    units: Vec<Vec<usize>>,
    /// Share of an edge's life that may be used, and of its median life at the job's risk.
    capacity: f64,
    used_to: f64,
    per_edge: f64,
    programs: usize,
    best: Option<Solved>,
    /// Least bound of a node whose optimum is a plan, or that the effort did not reach.
    closed: f64,
    monitor: &'a dyn Monitor,
}

/// The schedule with edges paid whole, what each cuts, and a bound that no other plan comes below.
pub(in crate::feed_schedule) fn edges(case: &Case, why: bool, monitor: &dyn Monitor) -> Result<Solved, Unsolved> {
    let mut search = Search {
        case,
        units: units(case),
        capacity: capacity(case),
        used_to: used_to(case),
        per_edge: Rates::of(case).map_or(0.0, |rates| rates.per_edge),
        programs: programs(case.zones.len()),
        best: None,
        closed: f64::INFINITY,
        monitor,
    };
    // Every unit on an edge of its own: nothing is looser, and with a fresh edge for every surface nothing else is meant.
    let each: Vec<usize> = (0..=search.units.len()).collect();
    let solved = search.at_borders(&each, why)?;
    if search.is_fresh_always() || search.per_edge <= 0.0 {
        let bound = solved.objective;
        return Ok(with_bound(solved, bound));
    }
    search.offer(&solved)?;
    let bound = search.all()?;
    let best = search.best.ok_or_else(|| Failure::Internal("no plan of whole edges was tried".to_owned()))?;
    Ok(with_bound(best, bound))
}

fn with_bound(mut solved: Solved, bound: f64) -> Solved {
    let objective = solved.objective;
    if let Some((_, least)) = &mut solved.whole {
        *least = bound.min(objective);
    }
    solved
}

impl Search<'_> {
    /// Solves with limits on what edges cut together.
    fn solve(&mut self, limits: EdgeLimits, why: bool) -> Result<Solved, Unsolved> {
        self.programs = self.programs.saturating_sub(1);
        let mut solved =
            solve_as(self.case, &Variation { edges: Some(&limits), ..Variation::default() }, why, self.monitor)?;
        solved.whole = Some((limits, f64::NEG_INFINITY));
        Ok(solved)
    }

    /// One edge between each border and the next; the first border is 0, the last the number of units.
    fn at_borders(&mut self, borders: &[usize], why: bool) -> Result<Solved, Unsolved> {
        let groups = borders.windows(2).map(|pair| (self.zones(pair[0], pair[1]), self.capacity)).collect();
        let edges = borders.len() - 1;
        let limits =
            if edges == 1 && !self.is_fresh_always() { self.parts(1) } else { EdgeLimits::new(edges as f64, groups) };
        self.solve(limits, why)
    }

    /// One edge for so many whole parts.
    fn parts(&self, parts: u32) -> EdgeLimits {
        EdgeLimits::several_parts(parts, self.case.limits.batch_parts, self.zones(0, self.units.len()), self.capacity)
    }

    /// Whether every surface takes a fresh edge, whatever is left of the last.
    fn is_fresh_always(&self) -> bool {
        self.case.limits.tool_usage_scope == UsageScope::Surface
    }

    /// The zones of some units.
    fn zones(&self, from: usize, to: usize) -> Vec<usize> {
        self.units[from..to].concat()
    }

    fn cost_at(&self, solved: &Solved, edges: usize) -> f64 {
        let own = solved.whole.as_ref().map_or(0.0, |(limits, _)| limits.per_part);
        solved.objective + self.per_edge * (edges as f64 - own)
    }

    /// Shares of an edge that the units use.
    fn usage(&self, solved: &Solved) -> Vec<f64> {
        let of = |&i: &usize| {
            let (zone, (u, x)) = (&self.case.zones[i], solved.at[i]);
            let life = zone.model(Output::ToolLife).map_or(f64::INFINITY, |life| life.output(u, x));
            zone.work() * (-u - x).exp() / life
        };
        self.units.iter().map(|unit| unit.iter().map(of).sum()).collect()
    }

    /// Borders where every edge is filled as far as it goes; `None` where a unit alone takes more.
    fn filled(&self, usage: &[f64]) -> Option<Vec<usize>> {
        let most = self.used_to * (1.0 + KEPT);
        let (mut borders, mut used) = (vec![0], 0.0);
        for (k, own) in usage.iter().enumerate() {
            if *own > most {
                return None;
            }
            if used + own > most {
                borders.push(k);
                used = 0.0;
            }
            used += own;
        }
        borders.push(usage.len());
        Some(borders)
    }

    /// A schedule is a plan with the edges that it fills, and a better one with feeds for these.
    fn offer(&mut self, solved: &Solved) -> Result<(), Unsolved> {
        let Some(borders) = self.filled(&self.usage(solved)) else { return Ok(()) };
        let worth = self.cost_at(solved, borders.len() - 1);
        if self.best.as_ref().is_some_and(|best| worth >= best.objective * 1.05) {
            return Ok(());
        }
        match self.at_borders(&borders, false) {
            Ok(own) => {
                self.take(own);
                Ok(())
            }
            Err(Unsolved::Infeasible(_)) => Ok(()),
            Err(failed) => Err(failed),
        }
    }

    fn take(&mut self, solved: Solved) {
        if self.best.as_ref().is_none_or(|best| solved.objective < best.objective) {
            self.best = Some(solved);
        }
    }

    fn is_worse(&self, bound: f64) -> bool {
        self.best.as_ref().is_some_and(|best| bound >= best.objective - SAME * best.objective.abs())
    }

    /// All numbers of edges and of parts per edge; the least bound that is left open.
    fn all(&mut self) -> Result<f64, Unsolved> {
        let mut open: Vec<Node> = Vec::new();
        // Edges paid by their share: fewer whole edges than the shares need are only had by slower cutting.
        let first = match &self.best {
            Some(best) => self.usage(best).iter().sum::<f64>() / self.used_to,
            None => 1.0,
        };
        // The cost over the number of edges is convex: from the first guess down and up until it rises beyond the best.
        let start = (counted(first.ceil().max(1.0)) as usize).min(self.units.len());
        let mut edges = start;
        let mut is_down = true;
        let mut before = f64::INFINITY;
        loop {
            let root = vec![(0, self.units.len()); edges - 1];
            let found = self.node(root)?;
            let value = found.as_ref().map_or(f64::INFINITY, |node| node.solved.objective);
            let ends = self.is_worse(value) && value >= before;
            open.extend(found);
            before = value;
            if is_down && edges > 1 && !(ends || value.is_infinite()) {
                edges -= 1;
                continue;
            }
            if is_down {
                (is_down, edges, before) = (false, start, f64::INFINITY);
            } else if ends {
                break;
            } else if self.programs == 0 {
                self.closed = self.closed.min(self.by_shares()?);
                break;
            }
            edges += 1;
            if edges > self.units.len() {
                break;
            }
        }
        self.several_parts()?;
        while let Some(k) = least(&open) {
            let node = open.swap_remove(k);
            if self.is_worse(node.solved.objective) {
                continue;
            }
            if self.programs == 0 {
                self.closed = self.closed.min(node.solved.objective);
                continue;
            }
            open.extend(self.branched(&node)?);
        }
        Ok(self.closed)
    }

    /// The objective with edges paid by their share and no limit on it: no plan of whole edges comes below.
    fn by_shares(&self) -> Result<f64, Unsolved> {
        let mut case = self.case.clone();
        case.limits.tool_usage_max = None;
        solve_as(&case, &Variation::default(), false, self.monitor).map(|solved| solved.objective)
    }

    /// Several whole parts per edge: convex in their number where every part pays its share of the edge. A batch pays the
    /// last edge whole, which is never less.
    fn several_parts(&mut self) -> Result<(), Unsolved> {
        let batch_parts = self.case.limits.batch_parts;
        let (mut parts, mut before) = (1, f64::INFINITY);
        while let Some(more) = more_parts(parts, batch_parts) {
            parts = more;
            let limits = self.parts(parts);
            let (share, per_part) = (1.0 / f64::from(parts), limits.per_part);
            match self.solve(limits, false) {
                Ok(solved) => {
                    let by_share = solved.objective - self.per_edge * (per_part - share);
                    self.take(solved);
                    if by_share >= before && self.is_worse(by_share) {
                        return Ok(());
                    }
                    before = by_share;
                }
                Err(Unsolved::Infeasible(_)) => return Ok(()),
                Err(failed) => return Err(failed),
            }
        }
        Ok(())
    }

    /// The best that any borders in these ranges can be; `None` where nothing is feasible.
    fn node(&mut self, ranges: Vec<(usize, usize)>) -> Result<Option<Node>, Unsolved> {
        let (n, edges) = (self.units.len(), ranges.len() + 1);
        let of = |count: usize| self.capacity * count as f64;
        let mut groups = vec![(0, n, of(edges))];
        for (j, &(low, high)) in ranges.iter().enumerate() {
            let to = if j == 0 { 0 } else { ranges[j - 1].1 };
            // The units before a border's least place are cut by the edges before it, and so on.
            groups.push((0, low, of(j + 1)));
            groups.push((high, n, of(edges - j - 1)));
            groups.push((to, low, of(1)));
        }
        if let Some(&(_, to)) = ranges.last() {
            groups.push((to, n, of(1)));
        }
        // Of groups over the same units the tightest says all.
        groups.retain(|group| group.0 < group.1);
        groups.sort_by(|a, b| (a.0, a.1).cmp(&(b.0, b.1)).then(a.2.total_cmp(&b.2)));
        groups.dedup_by_key(|group| (group.0, group.1));
        let contains = |a: &(usize, usize, f64), b: &(usize, usize, f64)| a.0 <= b.0 && b.1 <= a.1;
        let kept: Vec<(usize, usize, f64)> = groups
            .iter()
            .filter(|group| {
                !groups.iter().any(|other| *other != **group && contains(other, group) && other.2 <= group.2)
            })
            .copied()
            .collect();
        let groups = kept.into_iter().map(|(from, to, most)| (self.zones(from, to), most)).collect();
        match self.solve(EdgeLimits::new(edges as f64, groups), false) {
            Ok(solved) => Ok(Some(Node { ranges, solved })),
            Err(Unsolved::Infeasible(_)) => Ok(None),
            Err(failed) => Err(failed),
        }
    }

    /// A node's two halves; none where its own optimum is a plan.
    fn branched(&mut self, node: &Node) -> Result<Vec<Node>, Unsolved> {
        let usage = self.usage(&node.solved);
        let edges = node.ranges.len() + 1;
        let filled = self.filled(&usage);
        if let Some(borders) = &filled {
            let bound = node.solved.objective;
            self.offer(&node.solved)?;
            if borders.len() - 1 <= edges {
                self.closed = self.closed.min(bound);
                return Ok(Vec::new());
            }
        }
        let Some((j, at)) = self.border(&node.ranges, &usage) else { return Ok(Vec::new()) };
        let mut halves = Vec::new();
        for left in [true, false] {
            let mut ranges = node.ranges.clone();
            if left {
                // Borders stand in their order.
                ranges[..=j].iter_mut().for_each(|range| range.1 = range.1.min(at));
            } else {
                ranges[j..].iter_mut().for_each(|range| range.0 = range.0.max(at + 1));
            }
            if ranges.iter().all(|range| range.0 <= range.1) {
                halves.extend(self.node(ranges)?);
            }
        }
        Ok(halves)
    }

    /// The border, and the place after which one half begins, that exclude most of what a node's optimum uses.
    fn border(&self, ranges: &[(usize, usize)], usage: &[f64]) -> Option<(usize, usize)> {
        let edges = ranges.len() + 1;
        let mut before = vec![0.0];
        for own in usage {
            before.push(before.last().copied().unwrap_or(0.0) + own);
        }
        let total = before[usage.len()];
        let beyond = |j: usize, at: usize| {
            let left = total - before[at] - self.used_to * (edges - j - 1) as f64;
            let right = before[at + 1] - self.used_to * (j + 1) as f64;
            left.min(right)
        };
        let mut found: Option<(usize, usize, f64)> = None;
        for (j, &(low, high)) in ranges.iter().enumerate() {
            for at in low..high {
                let worth = beyond(j, at);
                if found.is_none_or(|(.., most)| worth > most) {
                    found = Some((j, at, worth));
                }
            }
        }
        found.map(|(j, at, _)| (j, at))
    }
}

fn least(open: &[Node]) -> Option<usize> {
    (0..open.len()).min_by(|&a, &b| open[a].solved.objective.total_cmp(&open[b].solved.objective))
}
