//! The general path: all works of a tool position, for structures that change with it.
//!
//! The shaft is cut at the tool and at the follow rests. What lies outside the outermost cut comes from the running
//! integrals, what lies between two cuts is integrated directly, each part with the section that is in force on its
//! side of the tool. The cost does not depend on the number of segments, unless a follow rest is far away.

use super::frame::{Frame, Interval, Load, Ordinates, Resultant, Work, Zone};
use super::matrix::Symmetric;
use super::model::Side;
use super::plane::Plane;
use super::tables::Tables;

/// What moves with the tool besides itself.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Rows {
    /// The couple at the tool.
    pub(super) couple: bool,
    /// The weight.
    pub(super) weight: bool,
}

/// Works of all unit loads with each other for one place of the tool, and room to compute them.
///
/// Rows: fixed unknowns, follow rests, force at the tool, then as asked couple at the tool and weight.
#[derive(Debug, Clone)]
pub(super) struct Works<'a> {
    frame: &'a Frame,
    left: &'a Tables,
    right: &'a Tables,
    follow: &'a [(usize, f64)],
    rows: Rows,
    /// Bending and shear; the same in both planes.
    pub(super) matrix: Symmetric,
    /// Base reactions of every row.
    pub(super) reactions: Vec<[f64; 2]>,
    /// The moving loads: follow rests, tool, couple.
    moving: Vec<Load>,
    /// Follow rests on the shaft.
    pub(super) active: Vec<bool>,
    cuts: Vec<f64>,
    ordinates: Vec<Ordinates>,
    functionals: Vec<[f64; 2]>,
    lost_weight: Vec<[Resultant; 2]>,
}

/// The weight seen from one side of the tool: that of this side's sections on the whole shaft, and for the difference
/// on the other side the force and couple at the tool that replace it.
#[derive(Debug, Clone, Copy, Default)]
struct Replaced {
    force: f64,
    couple: f64,
}

impl<'a> Works<'a> {
    pub(super) fn new(
        frame: &'a Frame,
        left: &'a Tables,
        right: &'a Tables,
        follow: &'a [(usize, f64)],
        rows: Rows,
    ) -> Self {
        // The weight of a partly turned shaft is replaced on one side by a couple at the tool.
        let rows = Rows { couple: rows.couple || rows.weight, ..rows };
        let moving = follow.len() + 1 + usize::from(rows.couple);
        let order = frame.columns() + moving + usize::from(rows.weight);
        Self {
            frame,
            left,
            right,
            follow,
            rows,
            matrix: Symmetric::zeros(order),
            reactions: frame.reactions[..frame.columns()]
                .iter()
                .copied()
                .chain(vec![[0.0; 2]; order - frame.columns()])
                .collect(),
            moving: vec![Load { z: 0.0, couple: false }; moving],
            active: vec![true; follow.len()],
            cuts: Vec::with_capacity(follow.len() + 1),
            ordinates: vec![Ordinates::default(); order],
            functionals: vec![[0.0; 2]; order],
            lost_weight: if rows.weight { differences(frame) } else { Vec::new() },
        }
    }

    /// Row of the force at the tool.
    pub(super) fn force_row(&self) -> usize {
        self.frame.columns() + self.follow.len()
    }

    /// Row of the couple at the tool.
    pub(super) fn couple_row(&self) -> usize {
        self.force_row() + 1
    }

    /// Row of the weight.
    pub(super) fn weight_row(&self) -> usize {
        self.couple_row() + 1
    }

    /// A follow rest that is not on the shaft now.
    pub(super) fn is_absent(&self, row: usize) -> bool {
        row.checked_sub(self.frame.columns()).and_then(|rest| self.active.get(rest)).is_some_and(|active| !active)
    }

    /// Computes all works for the tool at `tool`; the interval it lies in.
    pub(super) fn place(&mut self, tool: f64) -> usize {
        self.matrix.clear();
        self.arrange(tool);
        let (Some(&first), Some(&last)) = (self.cuts.first(), self.cuts.last()) else { return 0 };
        let (from, to) = (self.frame.locate(first), self.frame.locate(last));
        let replaced = self.replace_weight(tool);
        self.outside(from, Side::Left, replaced[0]);
        self.outside(to + 1, Side::Right, replaced[1]);
        let mut next = 0;
        for k in from..=to {
            let interval = self.frame.intervals[k];
            let mut start = interval.start;
            while next < self.cuts.len() && self.cuts[next] < interval.end {
                let end = self.cuts[next].max(start);
                self.part(k, start, end, tool, replaced);
                start = end;
                next += 1;
            }
            self.part(k, start, interval.end, tool, replaced);
        }
        self.matrix.mirror();
        self.frame.locate(tool)
    }

    /// Places, reactions and activity of what moves, for the tool at `tool`: enough where no works are wanted.
    pub(super) fn arrange(&mut self, tool: f64) {
        let base = &self.frame.base;
        let columns = self.frame.columns();
        let end = self.frame.intervals.last().map_or(0.0, |interval| interval.end);
        self.cuts.clear();
        self.cuts.push(tool);
        for (rest, &(_, offset)) in self.follow.iter().enumerate() {
            let place = tool + offset;
            let on_shaft = place >= 0.0 && place <= end;
            self.active[rest] = on_shaft;
            // A rest beside the shaft keeps a row, that of the tool, and is not used.
            self.moving[rest].z = if on_shaft { place } else { tool };
            if on_shaft {
                self.cuts.push(place);
            }
        }
        self.cuts.sort_unstable_by(f64::total_cmp);
        let force = self.follow.len();
        self.moving[force].z = tool;
        if self.rows.couple {
            self.moving[force + 1] = Load { z: tool, couple: true };
        }
        for (slot, load) in self.moving.iter().enumerate() {
            self.reactions[columns + slot] = base.reactions(*load);
        }
    }

    /// For both sides of the tool; also the reactions of the weight.
    fn replace_weight(&mut self, tool: f64) -> [Replaced; 2] {
        if !self.rows.weight {
            return [Replaced::default(); 2];
        }
        let k = self.frame.locate(tool);
        let interval = &self.frame.intervals[k];
        let missing = interval.section(Side::Right).weight_n_per_mm - interval.section(Side::Left).weight_n_per_mm;
        let [before, _] = self.lost_weight[k];
        let [_, behind] = self.lost_weight[k + 1];
        let before = before.advanced(missing, tool - interval.start);
        let behind = behind.advanced(missing, interval.end - tool);
        let replaced = [
            Replaced { force: behind.force, couple: behind.moment },
            Replaced { force: -before.force, couple: before.moment },
        ];
        let (force, couple) = (self.reactions[self.force_row()], self.reactions[self.couple_row()]);
        let whole = self.frame.reactions[self.frame.columns()];
        let row = self.weight_row();
        for (generalised, reaction) in whole.iter().enumerate() {
            self.reactions[row][generalised] =
                reaction + replaced[0].force * force[generalised] + replaced[0].couple * couple[generalised];
        }
        replaced
    }

    /// Everything beyond the outermost cuts and their intervals, from the running integrals.
    fn outside(&mut self, node: usize, side: Side, replaced: Replaced) {
        let tables = if side == Side::Left { self.left } else { self.right };
        let intervals = &self.frame.intervals;
        let (zone, place) = match side {
            Side::Left => (intervals[node].zone, intervals[node].start),
            Side::Right => (intervals[node - 1].zone, intervals[node - 1].end),
        };
        let columns = self.frame.columns();
        for (slot, load) in self.moving.iter().enumerate() {
            let reaction = self.reactions[columns + slot];
            self.functionals[columns + slot] = match (zone, side) {
                (Zone::Span, Side::Left) => [reaction[0], 0.0],
                (Zone::Span, Side::Right) => [reaction[1], 0.0],
                (Zone::Right, Side::Left) | (Zone::Left, Side::Right) if load.couple => [0.0, 1.0],
                (Zone::Right, Side::Left) | (Zone::Left, Side::Right) => [1.0, load.z - place],
                (Zone::Left, Side::Left) | (Zone::Right, Side::Right) => [0.0; 2],
            };
        }
        let weight = self.rows.weight.then(|| self.weight_row());
        if let Some(row) = weight {
            let (force, couple) = (self.functionals[self.force_row()], self.functionals[self.couple_row()]);
            self.functionals[row] = [0, 1].map(|i| replaced.force * force[i] + replaced.couple * couple[i]);
        }
        let [vv, vt, tt] = tables.gram(node);
        let order = self.matrix.order;
        for i in 0..columns {
            for j in i..columns {
                self.matrix.add(i, j, tables.pair(node, i, j));
            }
            let [c0, c1] = tables.column(node, i);
            for j in columns..order {
                let [f0, f1] = self.functionals[j];
                self.matrix.add(i, j, f0 * c0 + f1 * c1);
            }
            if let Some(row) = weight {
                self.matrix.add(i, row, tables.pair(node, i, columns));
            }
        }
        for i in columns..order {
            let [f0, f1] = self.functionals[i];
            let carried = [f0 * vv + f1 * vt, f0 * vt + f1 * tt];
            for j in i..order {
                let [g0, g1] = self.functionals[j];
                self.matrix.add(i, j, carried[0] * g0 + carried[1] * g1);
            }
            if let Some(row) = weight.filter(|row| i < *row) {
                let [w0, w1] = tables.column(node, columns);
                self.matrix.add(i, row, f0 * w0 + f1 * w1);
            }
        }
    }

    /// A part of an interval between two cuts.
    fn part(&mut self, k: usize, start: f64, end: f64, tool: f64, replaced: [Replaced; 2]) {
        if end <= start {
            return;
        }
        let side = self.draw(k, start, end, tool);
        if self.rows.weight {
            let replaced = replaced[usize::from(side == Side::Right)];
            let row = self.weight_row();
            let (from, to) = shares(&self.frame.intervals[k], start, end);
            self.ordinates[row] = self
                .frame
                .diagram(k, self.frame.columns(), side)
                .part(from, to)
                .plus(replaced.force, &self.ordinates[self.force_row()])
                .plus(replaced.couple, &self.ordinates[self.couple_row()]);
        }
        let work = Work::new(end - start, self.frame.intervals[k].section(side));
        let order = self.matrix.order;
        for i in 0..order {
            for j in i..order {
                self.matrix.add(i, j, work.of(&self.ordinates[i], &self.ordinates[j]));
            }
        }
    }

    /// The diagrams of all unit loads over a part of an interval; the side of the tool on which it lies.
    fn draw(&mut self, k: usize, start: f64, end: f64, tool: f64) -> Side {
        let interval = &self.frame.intervals[k];
        let side = if end <= tool { Side::Left } else { Side::Right };
        let columns = self.frame.columns();
        let (from, to) = shares(interval, start, end);
        for column in 0..columns {
            self.ordinates[column] = self.frame.diagram(k, column, side).part(from, to);
        }
        for (slot, load) in self.moving.iter().enumerate() {
            let of_load = if end <= load.z { Side::Left } else { Side::Right };
            let (ends, shear) = self.frame.base.diagram(interval.zone, *load, of_load, [start, end]);
            self.ordinates[columns + slot] = Ordinates::linear(ends, shear);
        }
        side
    }

    /// All parts of the shaft with the tool where it was placed last: visits start, end, work and diagrams.
    pub(super) fn walk(&mut self, tool: f64, mut visit: impl FnMut([f64; 2], &Work, &[Ordinates])) {
        for k in 0..self.frame.intervals.len() {
            let interval = self.frame.intervals[k];
            let mut start = interval.start;
            for cut in 0..=self.cuts.len() {
                let end = self.cuts.get(cut).copied().unwrap_or(interval.end);
                if end > start && end <= interval.end {
                    let side = self.draw(k, start, end, tool);
                    visit([start, end], &Work::new(end - start, interval.section(side)), &self.ordinates);
                    start = end;
                }
            }
        }
    }

    /// The works of a plane: with its springs, in `into`.
    pub(super) fn sprung(&self, plane: &Plane, into: &mut Symmetric) {
        into.clone_from(&self.matrix);
        let order = into.order;
        for i in 0..order {
            for j in i..order {
                into.add(i, j, plane.base_work(self.reactions[i], self.reactions[j]));
            }
        }
        for (i, compliance) in plane.fixed.iter().chain(&plane.follow).enumerate() {
            into.add(i, i, *compliance);
        }
        into.mirror();
    }

    /// The rows that hold both ways in a plane, in the order of elimination.
    pub(super) fn redundants(&self, plane: &Plane, into: &mut Vec<usize>) {
        into.clear();
        into.extend_from_slice(&plane.redundants);
        let columns = self.frame.columns();
        into.extend(plane.bilateral_follow.iter().filter(|&&rest| self.active[rest]).map(|rest| columns + rest));
    }
}

/// A part of an interval in shares of its length.
fn shares(interval: &Interval, start: f64, end: f64) -> (f64, f64) {
    ((start - interval.start) / interval.length, 1.0 - (interval.end - end) / interval.length)
}

/// By break point: what the sections right of the tool weigh more than those left of it, over the shaft before the
/// break point and behind it.
pub(super) fn differences(frame: &Frame) -> Vec<[Resultant; 2]> {
    let count = frame.intervals.len();
    let mut found = vec![[Resultant::default(); 2]; count + 1];
    let missing = |k: usize| {
        let interval = &frame.intervals[k];
        interval.section(Side::Right).weight_n_per_mm - interval.section(Side::Left).weight_n_per_mm
    };
    for k in 0..count {
        found[k + 1][0] = found[k][0].advanced(missing(k), frame.intervals[k].length);
    }
    for k in (0..count).rev() {
        found[k][1] = found[k + 1][1].advanced(missing(k), frame.intervals[k].length);
    }
    found
}
