//! The partly turned shaft: its section changes where the tool is, so redundants are eliminated at every station.
//!
//! All works are still polynomials between break points. They are sampled in blocks of stations, and the elimination
//! runs over a block at once: the same few operations on all its stations.

use super::bending::Bending;
use super::form::{Form, Raised, Span, sample};
use super::frame::{Frame, Resultant};
use super::matrix::VANISHING;
use super::model::Side;
use super::plane::Plane;
use super::station::{Rows, differences};

/// Stations of a block.
const BLOCK: usize = 32;

/// One work at all stations of a block.
type Lane = [f64; BLOCK];

/// The works of one plane over the whole shaft. Rows: fixed unknowns, force at the tool, then as asked couple and weight.
pub(super) struct Turning<'a> {
    frame: &'a Frame,
    plane: &'a Plane,
    order: usize,
    builder: Builder<'a>,
    lost: Vec<[Resultant; 2]>,
    lanes: Vec<Lane>,
    /// Diagonal of the redundants before the elimination.
    pub(super) original: Vec<Lane>,
}

impl<'a> Turning<'a> {
    pub(super) fn new(bending: Bending<'a>, plane: &'a Plane, rows: Rows) -> Self {
        let frame = bending.frame;
        let columns = frame.columns();
        // The weight needs the row of the couple.
        let order = columns + 1 + usize::from(rows.couple || rows.weight) + usize::from(rows.weight);
        let lost = if rows.weight { differences(frame) } else { Vec::new() };
        let builder = Builder { bending, plane, rows, order };
        let lanes = vec![[0.0; BLOCK]; order * (order + 1) / 2];
        Self { frame, plane, order, builder, lost, lanes, original: vec![[0.0; BLOCK]; columns] }
    }

    /// All stations, block by block: the visitor finds the reduced works in [`Self::work`].
    pub(super) fn run(&mut self, stations: &[f64], mut visit: impl FnMut(&Self, &[f64])) {
        let mut rest = stations;
        let mut values = Vec::with_capacity(BLOCK);
        let last = self.frame.intervals.len() - 1;
        // Of one interval: the upper triangle by rows.
        let mut works = vec![Raised::ZERO; self.lanes.len()];
        for k in 0..=last {
            let interval = &self.frame.intervals[k];
            let count = if k == last { rest.len() } else { rest.partition_point(|place| *place < interval.end) };
            let (here, behind) = rest.split_at(count);
            let span = Span { start: interval.start, end: interval.end, inverse_length: 1.0 / interval.length };
            // Stations of a short move lie in few of many intervals.
            if !here.is_empty() {
                works.fill(Raised::ZERO);
                self.builder.interval(k, &self.lost, &mut works);
            }
            for block in here.chunks(BLOCK) {
                for (form, lane) in works.iter().zip(&mut self.lanes) {
                    values.clear();
                    sample(form, span, block, &mut values);
                    lane[..block.len()].copy_from_slice(&values);
                }
                self.eliminate(block.len());
                self.hold(k, block);
                visit(self, block);
            }
            rest = behind;
        }
    }

    /// A work of two rows, `i <= j`, with the redundants in place.
    pub(super) fn work(&self, i: usize, j: usize) -> &Lane {
        &self.lanes[packed(self.order, i, j)]
    }

    /// Row of the force at the tool; couple and weight follow.
    pub(super) fn force_row(&self) -> usize {
        self.frame.columns()
    }

    /// The first `count` stations of the block.
    fn eliminate(&mut self, count: usize) {
        let columns = self.frame.columns();
        for (i, original) in self.original.iter_mut().enumerate().take(columns) {
            *original = self.lanes[packed(self.order, i, i)];
        }
        let mut eliminated = vec![false; self.order];
        for &e in &self.plane.redundants {
            eliminated[e] = true;
            let pivot = &self.lanes[packed(self.order, e, e)][..count];
            let mut inverse: Lane = [0.0; BLOCK];
            for ((inverse, pivot), original) in inverse.iter_mut().zip(pivot).zip(&self.original[e]) {
                *inverse = if *pivot > VANISHING * original { 1.0 / pivot } else { 0.0 };
            }
            for i in (0..self.order).filter(|i| !eliminated[*i]) {
                let mut factor = self.lanes[packed(self.order, i.min(e), i.max(e))];
                for (factor, inverse) in factor[..count].iter_mut().zip(&inverse) {
                    *factor *= inverse;
                }
                for j in (i..self.order).filter(|j| !eliminated[*j]) {
                    let other = self.lanes[packed(self.order, j.min(e), j.max(e))];
                    let lane = &mut self.lanes[packed(self.order, i, j)];
                    for ((work, factor), other) in lane[..count].iter_mut().zip(&factor).zip(&other) {
                        *work -= factor * other;
                    }
                }
            }
        }
    }

    /// Exactly zero on rigid supports.
    fn hold(&mut self, k: usize, block: &[f64]) {
        let force = self.force_row();
        for (slot, place) in block.iter().enumerate() {
            if self.plane.holds_tool(self.frame, k, *place) {
                for other in 0..self.order {
                    self.lanes[packed(self.order, force.min(other), force.max(other))][slot] = 0.0;
                }
            }
        }
    }
}

/// Place of an entry `i <= j` in the upper triangle.
fn packed(order: usize, i: usize, j: usize) -> usize {
    i * order - i * (i + 1) / 2 + j
}

/// Makes the polynomials of one plane.
struct Builder<'a> {
    bending: Bending<'a>,
    plane: &'a Plane,
    rows: Rows,
    order: usize,
}

/// The weight as one side of the tool sees it: force and couple at the tool in place of the difference on the other one.
struct Replaced {
    force: Form<2>,
    couple: Form<3>,
}

impl Builder<'_> {
    /// Adds up the works of an interval.
    fn interval(&self, k: usize, lost: &[[Resultant; 2]], forms: &mut [Raised]) {
        let columns = self.bending.frame.columns();
        let replaced = if self.rows.weight { self.replaced(k, lost) } else { Vec::new() };
        for (end, side) in [Side::Left, Side::Right].into_iter().enumerate() {
            let mut add = |i: usize, j: usize, form: Raised| {
                let entry = &mut forms[packed(self.order, i, j)];
                *entry = entry.plus(form);
            };
            let (moved, turned) = self.bending.by_force(k, side);
            add(columns, columns, moved.raised());
            if self.order > columns + 1 {
                add(columns, columns + 1, turned.raised());
            }
            let weight = replaced.get(end);
            for i in 0..columns {
                let (displacement, rotation) = self.bending.by_column(k, side, i);
                add(i, columns, displacement.raised());
                if self.order > columns + 1 {
                    add(i, columns + 1, rotation.raised());
                }
                for j in i..columns {
                    add(i, j, self.bending.pair(k, side, i, j).raised());
                }
                if let Some(weight) = weight {
                    add(i, columns + 2, self.bending.pair(k, side, i, columns).raised());
                    add(i, columns + 2, displacement.times(weight.force).plus(rotation.times::<3, 7>(weight.couple)));
                }
            }
            if let Some(weight) = weight {
                add(columns, columns + 2, self.bending.by_column(k, side, columns).0.raised());
                add(columns, columns + 2, moved.times(weight.force).plus(turned.times::<3, 7>(weight.couple)));
            }
        }
        self.spring(k, forms, replaced.first());
    }

    /// Springs of the base and of the unknowns.
    fn spring(&self, k: usize, forms: &mut [Raised], weight: Option<&Replaced>) {
        let frame = self.bending.frame;
        let columns = frame.columns();
        let mut reactions: Vec<Form<3>> = Vec::with_capacity(self.order);
        for generalised in 0..2 {
            reactions.clear();
            reactions.extend(frame.reactions[..columns].iter().map(|r| Form([r[generalised]]).raised()));
            let (force, couple) =
                (self.bending.reaction(k, generalised), Form([self.bending.couple_reactions()[generalised]]));
            reactions.push(force.raised());
            if self.order > columns + 1 {
                reactions.push(couple.raised());
            }
            if let Some(weight) = weight {
                let whole: Form<3> = Form([frame.reactions[columns][generalised]]).raised();
                let replaced = force.times::<2, 3>(weight.force).plus(couple.times::<3, 3>(weight.couple));
                reactions.push(whole.plus(replaced));
            }
            // The work of couple or weight with themselves is never asked for.
            for i in 0..=columns {
                for j in i..self.order {
                    let entry = &mut forms[packed(self.order, i, j)];
                    *entry = entry.plus(reactions[i].times::<3, 5>(reactions[j]).scaled(self.plane.base[generalised]));
                }
            }
        }
        for (i, compliance) in self.plane.fixed.iter().enumerate() {
            let entry = &mut forms[packed(self.order, i, i)];
            *entry = entry.plus(Form([*compliance]));
        }
    }

    /// For the left and the right side of the tool.
    fn replaced(&self, k: usize, lost: &[[Resultant; 2]]) -> Vec<Replaced> {
        let interval = &self.bending.frame.intervals[k];
        let missing = interval.section(Side::Right).weight_n_per_mm - interval.section(Side::Left).weight_n_per_mm;
        // The moment about the tool of a uniform load is convex: `q h²/2 xi eta` below its chord.
        let below = Form([0.0, -0.5 * missing * interval.length * interval.length, 0.0]);
        let between = |pick: fn(&Resultant) -> f64, end: usize| Form([pick(&lost[k][end]), pick(&lost[k + 1][end])]);
        vec![
            Replaced { force: between(|r| r.force, 1), couple: below.plus(between(|r| r.moment, 1)) },
            Replaced { force: between(|r| r.force, 0).scaled(-1.0), couple: below.plus(between(|r| r.moment, 0)) },
        ]
    }
}
