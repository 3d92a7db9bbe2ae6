//! The fastest feeds of a program that is there (`program/8`).
//!
//! `stretch` (the lines that cut, and what comes out of them at a feed) -> the schedule's optimiser, in turn with driving the
//! program, until both say the same -> whole steps of the feed, driven again -> `words` (F in the text) -> the text read and
//! driven as any other program.

mod stretch;
mod words;

use std::collections::{BTreeMap, BTreeSet};

use crate::calculator::{Failure, Finding, Monitor};
use crate::deflection_compensation::Holding;
use crate::feed_schedule::stretches::{Bounds, PriceOfLimit, Scheduled, fastest};

use super::super::job::{Job, ProgramStock, Refeed};
use super::correction::{ChangedLine, Corrected, unified};
use super::reader::Program;
use super::yielding::{Driven, Yielded, yielding};

use stretch::{CuttingLine, Reached, lines, reached};
use words::written;

/// Why a program is not given other feeds.
pub(crate) const FAILURE_CODES: &[&str] =
    &["infeasible_schedule", "refeed_not_settled", "nothing_to_refeed", "feed_not_put_back"];

/// How often the schedule is laid anew for what comes out at its feeds, and what need not be, in the logarithm of a feed.
const MOST_ROUNDS: usize = 16;
const SETTLED: f64 = 2e-5;
/// How often feeds in whole steps are lowered, and the usage of an edge is asked to be less.
const MOST_STEPS: usize = 60;
const MOST_USAGES: usize = 6;
/// Of more lines not each is tried by itself.
const MOST_TRIED: usize = 40;
/// How much less, beside what it is over.
const LESS_USAGE: f64 = 0.999;
/// Above a limit by a smaller share is none.
const KEPT: f64 = 1e-9;

/// Names of limits.
pub(crate) type Names = BTreeSet<&'static str>;

/// Feeds in whole steps, with what stops each line and what a looser limit would bring.
struct Settled {
    steps: Vec<f64>,
    binding: Vec<Names>,
    prices: Vec<PriceOfLimit>,
}

/// A program with other feeds.
#[derive(Debug, Clone)]
pub(crate) struct Refed {
    pub(crate) text: String,
    pub(crate) changed: Vec<ChangedLine>,
    /// The text as it is read, and what it leaves.
    pub(crate) program: Program,
    pub(crate) yielded: Yielded,
    pub(crate) stretches: Vec<RefedStretch>,
    /// Lines that cut and keep their feed.
    pub(crate) kept_lines: Vec<usize>,
    pub(crate) prices: Vec<PriceOfLimit>,
    /// Time at the feed, before and after, min.
    pub(crate) time_min: [f64; 2],
    /// The limits with what is reached of them, and in which line.
    pub(crate) limits: Vec<LimitReached>,
    pub(crate) lines_compared: usize,
    pub(crate) moves_compared: usize,
}

impl Refed {
    /// The program that is given back where nothing else changes.
    pub(crate) fn alone(&self, job: &Job) -> Corrected {
        Corrected {
            text: self.text.clone(),
            changed: self.changed.clone(),
            left_alone: Vec::new(),
            support_lines: job.support_lines.clone(),
            diff: unified(&job.nc_program, &self.changed),
            undersize: Vec::new(),
            proof: None,
        }
    }

    /// The same with what a correction made of it: one change of each line of the given program.
    pub(crate) fn joined(&self, corrected: Corrected, given: &str) -> Corrected {
        let mut changed: BTreeMap<usize, ChangedLine> =
            self.changed.iter().map(|one| (one.line, one.clone())).collect();
        for one in &corrected.changed {
            let old = changed.get(&one.line).map_or_else(|| one.old.clone(), |refed| refed.old.clone());
            changed.insert(one.line, ChangedLine { old, ..one.clone() });
        }
        let changed: Vec<ChangedLine> = changed.into_values().collect();
        Corrected { diff: unified(given, &changed), changed, ..corrected }
    }
}

/// A line with its feeds.
#[derive(Debug, Clone)]
pub(crate) struct RefedStretch {
    pub(crate) line: usize,
    pub(crate) tool: Option<u32>,
    pub(crate) is_finishing: bool,
    pub(crate) length_mm: f64,
    /// Where its first move begins and its last one ends, from the headstock end.
    pub(crate) ends_mm: [f64; 2],
    pub(crate) depth_mm: f64,
    pub(crate) feeds_mm_per_rev: [f64; 2],
    /// The limits that one step more passes.
    pub(crate) binding: Names,
}

/// A limit and what is reached of it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct LimitReached {
    pub(crate) name: &'static str,
    pub(crate) limit: f64,
    pub(crate) reached: f64,
    /// None of a limit on a tool.
    pub(crate) line: Option<usize>,
}

/// What the limits are.
fn bounds(refeed: &Refeed) -> Bounds {
    let largest = stretch::FORCES.iter().filter_map(|force| Some((force.name, (force.limit)(refeed)?)));
    Bounds {
        feed_mm_per_rev: [refeed.feed_min_mm_per_rev, refeed.feed_max_mm_per_rev],
        feed_step_ratio_max: refeed.feed_step_ratio_max,
        deflection_max_um: refeed.deflection_max_um,
        roughness_max_um: refeed.roughness_max_um,
        tool_usage_max: refeed.tool_usage_max,
        largest: largest.collect(),
    }
}

/// A program that is given other feeds, with what it is driven over.
struct Task<'a> {
    program: &'a Program,
    job: &'a Job,
    refeed: &'a Refeed,
    holding: &'a Holding,
    blank: (&'a ProgramStock, f64),
    finishing: &'a [usize],
    lines: Vec<CuttingLine>,
    monitor: &'a dyn Monitor,
}

/// Gives a program that has been driven as it is the fastest feeds.
pub(crate) fn refed(
    program: &Program,
    job: &Job,
    refeed: &Refeed,
    holding: &Holding,
    blank: (&ProgramStock, f64),
    (finishing, before): (&[usize], &Yielded),
    monitor: &dyn Monitor,
) -> Result<Refed, Failure> {
    let (lines, kept_lines) = lines((program, job), blank.1, finishing, before)?;
    if lines.is_empty() {
        return Err(Failure::OutOfModel(Finding::new("nothing_to_refeed", "/nc_program")));
    }
    let task = Task { program, job, refeed, holding, blank, finishing, lines, monitor };
    let Settled { steps, binding, prices } = task.settled(before)?;
    let feeds = task.feeds(&steps);
    let text = written((program, job), &task.lines, &feeds, monitor)?;
    let mut again = job.clone();
    again.nc_program.clone_from(&text.text);
    let yielded = task.drive_read(&again, &text.program)?;
    let reached = task.reached(&yielded);
    // What was driven was the same moves at the same feeds; the text itself has to keep the limits.
    if let Some(&at) = task.above(&reached, &feeds).first() {
        return Err(failed("limit", task.lines[at].line));
    }
    let stretches = task.lines.iter().zip(&feeds).zip(&reached).zip(binding);
    let stretches = stretches.map(|(((line, &feed), reached), binding)| RefedStretch {
        line: line.line,
        tool: line.tool,
        is_finishing: line.is_finishing,
        length_mm: line.length_mm,
        ends_mm: line.ends_mm,
        depth_mm: reached.depth_mm,
        feeds_mm_per_rev: [line.feed_mm_per_rev, feed],
        binding,
    });
    let time = |program: &Program, job: &Job| stretch::time_min(program, job, blank.1);
    Ok(Refed {
        time_min: [time(program, job), time(&text.program, &again)],
        limits: task.limits(&reached),
        stretches: stretches.collect(),
        kept_lines,
        prices,
        lines_compared: program.lines - text.changed.len(),
        moves_compared: text.program.moves.len(),
        text: text.text,
        changed: text.changed,
        program: text.program,
        yielded,
    })
}

/// What comes back is not given back.
fn failed(part: &'static str, line: usize) -> Failure {
    let finding = Finding::new("proof_failed", "/nc_program").with("part", part).with("line", line);
    Failure::OutOfModel(finding.with("off_um", 0.0))
}

impl Task<'_> {
    fn drive_read(&self, job: &Job, program: &Program) -> Result<Yielded, Failure> {
        let driven = Driven::as_it_is(self.finishing);
        yielding(program, job, self.holding, self.blank, driven, self.monitor)
    }

    /// What comes out at other feeds.
    fn drive(&self, feeds: &[f64]) -> Result<Vec<Reached>, Failure> {
        let mut program = self.program.clone();
        for (line, &feed) in self.lines.iter().zip(feeds) {
            line.moves.iter().for_each(|one| program.moves[one.mv].feed = Some(line.feed_of(feed)));
        }
        Ok(self.reached(&self.drive_read(self.job, &program)?))
    }

    fn reached(&self, yielded: &Yielded) -> Vec<Reached> {
        reached(yielded, &self.lines, self.refeed)
    }

    fn feeds(&self, steps: &[f64]) -> Vec<f64> {
        self.lines.iter().zip(steps).map(|(line, steps)| steps * line.step_mm_per_rev).collect()
    }

    /// Feeds in whole steps that keep all limits.
    fn settled(&self, before: &Yielded) -> Result<Settled, Failure> {
        let mut bounds = bounds(self.refeed);
        let mut feeds: Vec<f64> = self.lines.iter().map(|line| line.feed_mm_per_rev).collect();
        let mut reached = self.reached(before);
        for _ in 0..MOST_USAGES {
            let (exact, scheduled, last) = self.scheduled(&bounds, feeds, reached)?;
            let (steps, binding) = self.in_steps(&exact)?;
            let rounded = self.feeds(&steps);
            let now = self.drive(&rounded)?;
            // Slower is not always better for an edge.
            match (self.refeed.tool_usage_max, self.largest_usage(&now)) {
                (Some(most), Some(usage)) if usage > most * (1.0 + KEPT) => {
                    bounds.tool_usage_max = bounds.tool_usage_max.map(|asked| asked * most / usage * LESS_USAGE);
                }
                _ => return Ok(Settled { steps, binding, prices: scheduled.prices }),
            }
            (feeds, reached) = (exact, last);
        }
        Err(self.not_settled(0))
    }

    fn not_settled(&self, at: usize) -> Failure {
        let line = self.lines.get(at).map_or(1, |line| line.line);
        Failure::OutOfModel(Finding::new("refeed_not_settled", "/refeed").with("line", line))
    }

    /// The schedule that is one of what comes out at its own feeds.
    fn scheduled(
        &self,
        bounds: &Bounds,
        mut feeds: Vec<f64>,
        mut reached: Vec<Reached>,
    ) -> Result<(Vec<f64>, Scheduled, Vec<Reached>), Failure> {
        // Whether it was driven at the least feed, and whether that was the last time.
        let (mut was_slowest, mut is_slowest) = (false, false);
        let mut rounds = 0;
        loop {
            let stretches: Vec<_> = (0..self.lines.len()).map(|i| self.stretch(i, feeds[i], &reached[i])).collect();
            let found = match fastest(&stretches, bounds, self.monitor) {
                // Far from the feeds that keep the limits the laws may say too much: it is tried where least comes out.
                Err(Failure::Conflicting(_)) if !was_slowest => {
                    (was_slowest, is_slowest) = (true, true);
                    feeds = vec![bounds.feed_mm_per_rev[0]; self.lines.len()];
                    reached = self.drive(&feeds)?;
                    continue;
                }
                // One line may leave another too much at its own best feed: that is no conflict of limits.
                Err(Failure::Conflicting(conflict)) if !is_slowest => {
                    let names = conflict.infeasible.conflict_set;
                    let is_named = |line: &CuttingLine| names.iter().any(|name| name.zone == line.line.to_string());
                    return Err(self.not_settled(self.lines.iter().position(is_named).unwrap_or(0)));
                }
                Err(Failure::Conflicting(mut conflict)) => {
                    conflict.finding = Finding { pointer: "/refeed".to_owned(), ..conflict.finding };
                    return Err(Failure::Conflicting(conflict));
                }
                found => found?,
            };
            let far = |(new, old): (&f64, &f64)| (new / old).ln().abs();
            let off = found.feeds_mm_per_rev.iter().zip(&feeds).map(far).fold(0.0, f64::max);
            feeds.clone_from(&found.feeds_mm_per_rev);
            rounds += 1;
            if off <= SETTLED || rounds >= MOST_ROUNDS {
                return Ok((feeds, found, reached));
            }
            reached = self.drive(&feeds)?;
            is_slowest = false;
        }
    }

    /// Whole steps: down to what is allowed, then up as far as that still is; what stops each line.
    fn in_steps(&self, feeds: &[f64]) -> Result<(Vec<f64>, Vec<Names>), Failure> {
        let [low, high] = [self.refeed.feed_min_mm_per_rev, self.refeed.feed_max_mm_per_rev];
        let least = |line: &CuttingLine| (low / line.step_mm_per_rev * (1.0 - KEPT)).ceil();
        let most = |line: &CuttingLine| (high / line.step_mm_per_rev * (1.0 + KEPT)).floor();
        let down = |(line, feed): (&CuttingLine, &f64)| {
            (feed / line.step_mm_per_rev * (1.0 + KEPT)).floor().max(least(line)).min(most(line))
        };
        let mut steps: Vec<f64> = self.lines.iter().zip(feeds).map(down).collect();
        for _ in 0..MOST_STEPS {
            let now = self.feeds(&steps);
            let above = self.above(&self.drive(&now)?, &now);
            if above.is_empty() {
                return self.raised(steps, &self.lines.iter().map(most).collect::<Vec<f64>>());
            }
            for at in above {
                if steps[at] - 1.0 < least(&self.lines[at]) {
                    return Err(self.not_settled(at));
                }
                steps[at] -= 1.0;
            }
        }
        Err(self.not_settled(0))
    }

    /// Steps as far up as they hold, and the limits that stop each line: all lines by more and more steps at once, then each by
    /// itself.
    fn raised(&self, mut steps: Vec<f64>, most: &[f64]) -> Result<(Vec<f64>, Vec<Names>), Failure> {
        let mut more = vec![1.0; steps.len()];
        let mut stopped = vec![Names::new(); steps.len()];
        for _ in 0..MOST_STEPS {
            let tried: Vec<f64> = (0..steps.len()).map(|i| (steps[i] + more[i]).min(most[i])).collect();
            if tried == steps {
                break;
            }
            let passed = self.passed_at(&tried)?;
            let kept: Vec<f64> =
                (0..steps.len()).map(|i| if passed[i].is_empty() { tried[i] } else { steps[i] }).collect();
            // What those that pass none by themselves pass together.
            let together: Names =
                if kept == tried { Names::new() } else { self.passed_at(&kept)?.into_iter().flatten().collect() };
            for i in 0..steps.len() {
                if passed[i].is_empty() && together.is_empty() {
                    more[i] *= 2.0;
                } else {
                    more[i] = (more[i] / 2.0_f64).floor();
                    stopped[i] = if passed[i].is_empty() { together.clone() } else { passed[i].clone() };
                }
            }
            if together.is_empty() {
                steps = kept;
            }
        }
        if steps.len() <= MOST_TRIED {
            self.raise_each(&mut steps, most, &mut stopped)?;
        }
        for (i, names) in stopped.iter_mut().enumerate() {
            if steps[i] >= most[i] {
                *names = Names::from(["feed_max"]);
            }
        }
        Ok((steps, stopped))
    }

    /// Raises each line by itself until one step more of any passes a limit, in whichever line.
    fn raise_each(&self, steps: &mut [f64], most: &[f64], stopped: &mut [Names]) -> Result<(), Failure> {
        let mut is_higher = true;
        while is_higher {
            is_higher = false;
            for i in 0..steps.len() {
                while steps[i] < most[i] {
                    steps[i] += 1.0;
                    stopped[i] = self.passed_at(steps)?.into_iter().flatten().collect();
                    if !stopped[i].is_empty() {
                        steps[i] -= 1.0;
                        break;
                    }
                    is_higher = true;
                }
            }
        }
        Ok(())
    }

    /// The limits that each line passes at some feeds; an edge that is used too much is one of each of its lines.
    fn passed_at(&self, steps: &[f64]) -> Result<Vec<Names>, Failure> {
        let feeds = self.feeds(steps);
        let reached = self.drive(&feeds)?;
        let mut passed: Vec<Names> = (0..self.lines.len()).map(|i| self.passed(&reached, &feeds, i)).collect();
        if self.refeed.tool_usage_max.zip(self.largest_usage(&reached)).is_some_and(|(most, usage)| usage > most) {
            for names in &mut passed {
                names.insert("tool_usage");
            }
        }
        Ok(passed)
    }

    /// The limits of its own that a line passes, and that on what is beside it.
    fn passed(&self, reached: &[Reached], feeds: &[f64], i: usize) -> Names {
        let one = &reached[i];
        let pairs = [
            ("deflection", one.deflection_um, self.refeed.deflection_max_um),
            ("roughness", one.roughness_um, self.refeed.roughness_max_um),
        ];
        let forces = stretch::FORCES.iter().zip(&one.forces);
        let forces = forces.map(|(force, value)| (force.name, Some(*value), (force.limit)(self.refeed)));
        let is_above = |value: f64, limit: f64| value > limit * (1.0 + KEPT);
        let own = pairs.into_iter().chain(forces);
        let own =
            own.filter(|(_, value, limit)| value.zip(*limit).is_some_and(|(value, limit)| is_above(value, limit)));
        let ratio = self.refeed.feed_step_ratio_max.unwrap_or(f64::INFINITY);
        let beside = |j: usize| is_above(feeds[i], feeds[j] * ratio);
        let is_stepped = (i + 1 < feeds.len() && self.lines[i].touches_next && beside(i + 1))
            || (i > 0 && self.lines[i - 1].touches_next && beside(i - 1));
        own.map(|(name, ..)| name).chain(is_stepped.then_some("feed_step")).collect()
    }

    /// The lines that pass a limit.
    fn above(&self, reached: &[Reached], feeds: &[f64]) -> Vec<usize> {
        (0..self.lines.len()).filter(|&i| !self.passed(reached, feeds, i).is_empty()).collect()
    }

    /// The largest usage of an edge.
    fn largest_usage(&self, reached: &[Reached]) -> Option<f64> {
        let mut by_tool = BTreeMap::<Option<u32>, f64>::new();
        for (line, reached) in self.lines.iter().zip(reached) {
            *by_tool.entry(line.tool).or_default() += reached.tool_usage?;
        }
        by_tool.into_values().reduce(f64::max)
    }

    /// The limits with the most that is reached of them.
    fn limits(&self, reached: &[Reached]) -> Vec<LimitReached> {
        let mut found = Vec::new();
        let mut look = |name, limit: Option<f64>, value: &dyn Fn(&Reached) -> Option<f64>| {
            let Some(limit) = limit else { return };
            let values = self.lines.iter().zip(reached).filter_map(|(line, one)| Some((line.line, value(one)?)));
            if let Some((line, reached)) = values.max_by(|a, b| a.1.total_cmp(&b.1)) {
                found.push(LimitReached { name, limit, reached, line: Some(line) });
            }
        };
        look("deflection", self.refeed.deflection_max_um, &|one| one.deflection_um);
        look("roughness", self.refeed.roughness_max_um, &|one| one.roughness_um);
        for (i, force) in stretch::FORCES.iter().enumerate() {
            look(force.name, (force.limit)(self.refeed), &|one| Some(one.forces[i]));
        }
        if let Some((limit, reached)) = self.refeed.tool_usage_max.zip(self.largest_usage(reached)) {
            found.push(LimitReached { name: "tool_usage", limit, reached, line: None });
        }
        found
    }
}
