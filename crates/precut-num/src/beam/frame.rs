//! The statically determinate base structure: break points, unit loads and their moment diagrams.
//!
//! Base (`deflection/3.3` item 1): the two outermost bilateral translational supports at `p < q`, or a chuck alone at
//! `p = q`. Bending moments are positive where a force in the positive direction between two supports puts them,
//! `v'' = -M/EJ`; shear is `dM/ds`. A couple is conjugate to the rotation of the section.

use super::model::{Segment, Side, State, Support};
use super::section::Section;

/// A unit force or a unit couple at a place.
#[derive(Debug, Clone, Copy)]
pub(super) struct Load {
    pub(super) z: f64,
    pub(super) couple: bool,
}

/// Where an interval lies relative to the supports of the base.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Zone {
    /// Overhang on the headstock side.
    Left,
    /// Between the two supports.
    Span,
    /// Overhang on the tailstock side.
    Right,
}

/// The shaft between two neighbouring break points.
#[derive(Debug, Clone, Copy)]
pub(super) struct Interval {
    pub(super) start: f64,
    pub(super) end: f64,
    pub(super) length: f64,
    pub(super) zone: Zone,
    /// The section in force where the interval lies left of the tool.
    left: Section,
    /// The section in force where it lies right of the tool.
    right: Section,
}

impl Interval {
    pub(super) fn section(&self, side: Side) -> &Section {
        match side {
            Side::Left => &self.left,
            Side::Right => &self.right,
        }
    }
}

/// The supports that make the base, and how it answers a load.
#[derive(Debug, Clone, Copy)]
pub(super) struct Base {
    pub(super) p: f64,
    pub(super) q: f64,
    /// Index of the support at `p` and of that at `q`; the same one for a chuck alone.
    pub(super) supports: [usize; 2],
    /// 1/(q - p), 1/mm; 0 for a chuck alone.
    pub(super) inverse_span: f64,
}

impl Base {
    /// The outermost two bilateral translational supports, else the chuck.
    pub(super) fn choose(supports: &[Support]) -> Option<Self> {
        let places = || supports.iter().enumerate().filter_map(|(i, support)| Some((i, support.bilateral_z_mm()?)));
        let (first, p) = places().min_by(|a, b| a.1.total_cmp(&b.1))?;
        let (second, q) = places().max_by(|a, b| a.1.total_cmp(&b.1))?;
        if q > p {
            return Some(Self { p, q, supports: [first, second], inverse_span: 1.0 / (q - p) });
        }
        supports[first].rotational()?;
        Some(Self { p, q, supports: [first, first], inverse_span: 0.0 })
    }

    /// Whether a chuck alone holds the shaft: its clamping couple then belongs to the base.
    pub(super) fn is_chuck(&self) -> bool {
        self.supports[0] == self.supports[1]
    }

    /// Generalised reactions to a unit load: the forces at `p` and `q`, or force and couple of the chuck.
    pub(super) fn reactions(&self, load: Load) -> [f64; 2] {
        match (self.is_chuck(), load.couple) {
            (false, false) => [(self.q - load.z) * self.inverse_span, (load.z - self.p) * self.inverse_span],
            (false, true) => [-self.inverse_span, self.inverse_span],
            (true, false) => [1.0, load.z - self.p],
            (true, true) => [0.0, 1.0],
        }
    }

    fn zone(&self, start: f64, end: f64) -> Zone {
        if end <= self.p {
            Zone::Left
        } else if start >= self.q {
            Zone::Right
        } else {
            Zone::Span
        }
    }

    /// Moments at `[s0, s1]` and the shear between them of a unit load that lies left or right of both.
    pub(super) fn diagram(&self, zone: Zone, load: Load, side_of_part: Side, s: [f64; 2]) -> ([f64; 2], f64) {
        match (zone, side_of_part) {
            (Zone::Span, Side::Left) => {
                let reaction = self.reactions(load)[0];
                ([reaction * (s[0] - self.p), reaction * (s[1] - self.p)], reaction)
            }
            (Zone::Span, Side::Right) => {
                let reaction = self.reactions(load)[1];
                ([reaction * (self.q - s[0]), reaction * (self.q - s[1])], -reaction)
            }
            (Zone::Right, Side::Left) if load.couple => ([-1.0; 2], 0.0),
            (Zone::Right, Side::Left) => ([s[0] - load.z, s[1] - load.z], 1.0),
            (Zone::Left, Side::Right) if load.couple => ([1.0; 2], 0.0),
            (Zone::Left, Side::Right) => ([load.z - s[0], load.z - s[1]], -1.0),
            (Zone::Right, Side::Right) | (Zone::Left, Side::Left) => ([0.0; 2], 0.0),
        }
    }
}

/// Moments at both ends and the middle of a part of an interval, and the mean shear.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Ordinates {
    pub(super) moment: [f64; 3],
    pub(super) shear: f64,
}

impl Ordinates {
    pub(super) fn linear([start, end]: [f64; 2], shear: f64) -> Self {
        Self { moment: [start, 0.5 * (start + end), end], shear }
    }

    /// `self + factor * other`.
    pub(super) fn plus(mut self, factor: f64, other: &Self) -> Self {
        for (mine, theirs) in self.moment.iter_mut().zip(&other.moment) {
            *mine += factor * theirs;
        }
        self.shear += factor * other.shear;
        self
    }
}

/// `∫ M N / EJ + V U / kGA` over a part of one section; Simpson's rule, exact up to cubic products.
#[derive(Debug, Clone, Copy)]
pub(super) struct Work {
    sixth: f64,
    shear: f64,
}

impl Work {
    pub(super) fn new(length: f64, section: &Section) -> Self {
        Self {
            sixth: length * section.bending_flexibility_per_n_mm2 / 6.0,
            shear: length * section.shear_flexibility_per_n,
        }
    }

    pub(super) fn bending(&self, a: &Ordinates, b: &Ordinates) -> f64 {
        let (m, n) = (&a.moment, &b.moment);
        self.sixth * (m[0] * n[0] + 4.0 * (m[1] * n[1]) + m[2] * n[2])
    }

    pub(super) fn shearing(&self, a: &Ordinates, b: &Ordinates) -> f64 {
        self.shear * a.shear * b.shear
    }

    pub(super) fn of(&self, a: &Ordinates, b: &Ordinates) -> f64 {
        self.bending(a, b) + self.shearing(a, b)
    }
}

/// A diagram over one interval: linear, or with the parabola of a distributed load.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Diagram {
    /// Moments at start and end, N mm.
    pub(super) ends: [f64; 2],
    /// Height of the parabola above the chord, `q h² / 8`.
    pub(super) bulge: f64,
    /// Shear at start and end, N.
    pub(super) shear: [f64; 2],
}

impl Diagram {
    fn at(&self, xi: f64) -> f64 {
        let eta = 1.0 - xi;
        self.ends[0] * eta + self.ends[1] * xi + 4.0 * self.bulge * xi * eta
    }

    /// Over the part `[from, to]`, in shares of the interval.
    pub(super) fn part(&self, from: f64, to: f64) -> Ordinates {
        let middle = 0.5 * (from + to);
        Ordinates {
            moment: [self.at(from), self.at(middle), self.at(to)],
            shear: self.shear[0] * (1.0 - middle) + self.shear[1] * middle,
        }
    }

    /// Over the whole interval.
    pub(super) fn whole(&self) -> Ordinates {
        let [start, end] = self.ends;
        Ordinates {
            moment: [start, 0.5 * (start + end) + self.bulge, end],
            shear: 0.5 * (self.shear[0] + self.shear[1]),
        }
    }
}

/// Resultants of a distributed load: what lies left of a break point and what lies right of it.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct Resultant {
    /// `∫ q ds`, N.
    pub(super) force: f64,
    /// `∫ q |s - x| ds` about the break point, N mm.
    pub(super) moment: f64,
}

impl Resultant {
    /// Of the same load and another piece of uniform load next to it, about the far end of that piece.
    pub(super) fn advanced(self, weight: f64, length: f64) -> Self {
        Self {
            force: self.force + weight * length,
            moment: self.moment + length * (self.force + 0.5 * weight * length),
        }
    }
}

/// Break points, base, and the diagrams of the fixed unit loads and of the weight.
#[derive(Debug, Clone)]
pub(super) struct Frame {
    pub(super) intervals: Vec<Interval>,
    pub(super) base: Base,
    /// Unit loads that stand still: what the redundants do.
    pub(super) loads: Vec<Load>,
    /// Base reactions of each load, and last in a weighed frame those of the weight of the section left of the tool.
    pub(super) reactions: Vec<[f64; 2]>,
    /// By interval, then by load.
    diagrams: Vec<Diagram>,
    /// In a weighed frame, weight over the whole shaft of the sections that are in force left and right of the tool; by
    /// interval.
    weights: [Vec<Diagram>; 2],
}

impl Frame {
    /// Break points at the steps, the ends, and `places`, all of which lie on the shaft; without the weight.
    pub(super) fn new(segments: &[Segment], length_mm: f64, base: Base, loads: Vec<Load>, state: State) -> Self {
        let intervals = divide(segments, length_mm, &base, &loads, state);
        let reactions = loads.iter().map(|load| base.reactions(*load)).collect();
        let mut diagrams = Vec::with_capacity(intervals.len() * loads.len());
        for interval in &intervals {
            for load in &loads {
                let side = if interval.end <= load.z { Side::Left } else { Side::Right };
                let (ends, shear) = base.diagram(interval.zone, *load, side, [interval.start, interval.end]);
                diagrams.push(Diagram { ends, bulge: 0.0, shear: [shear; 2] });
            }
        }
        Self { intervals, base, loads, reactions, diagrams, weights: [Vec::new(), Vec::new()] }
    }

    /// The same with the weight: few ask for it.
    pub(super) fn weighed(&self) -> Self {
        let mut frame = self.clone();
        let (left, reactions) = weigh(&self.intervals, &self.base, Side::Left);
        let (right, _) = weigh(&self.intervals, &self.base, Side::Right);
        frame.reactions.push(reactions);
        frame.weights = [left, right];
        frame
    }

    /// Whether the weight is among the diagrams.
    pub(super) fn is_weighed(&self) -> bool {
        self.reactions.len() > self.loads.len()
    }

    /// Number of fixed unit loads.
    pub(super) fn columns(&self) -> usize {
        self.loads.len()
    }

    /// Number of diagrams: the fixed unit loads, and in a weighed frame the weight.
    pub(super) fn width(&self) -> usize {
        self.reactions.len()
    }

    /// Diagram of a fixed load over an interval; the index after the last load is the weight.
    pub(super) fn diagram(&self, interval: usize, column: usize, side: Side) -> &Diagram {
        if column < self.loads.len() {
            &self.diagrams[interval * self.loads.len() + column]
        } else {
            &self.weights[usize::from(side == Side::Right)][interval]
        }
    }

    /// The interval that a place belongs to: half-open, the last one closed.
    pub(super) fn locate(&self, place: f64) -> usize {
        self.intervals.partition_point(|interval| interval.end <= place).min(self.intervals.len() - 1)
    }
}

/// Cuts the shaft at steps, base supports and loads.
fn divide(segments: &[Segment], length_mm: f64, base: &Base, loads: &[Load], state: State) -> Vec<Interval> {
    let mut breaks = vec![0.0, length_mm];
    let mut end = 0.0;
    let mut ends = Vec::with_capacity(segments.len());
    for segment in segments {
        end += segment.length_mm;
        ends.push(end);
    }
    breaks.extend_from_slice(&ends);
    breaks.extend([base.p, base.q]);
    breaks.extend(loads.iter().map(|load| load.z));
    breaks.sort_unstable_by(f64::total_cmp);
    breaks.dedup();
    let mut segment = 0;
    breaks
        .windows(2)
        .map(|pair| {
            let (start, end) = (pair[0], pair[1]);
            while segment + 1 < segments.len() && ends[segment] <= start {
                segment += 1;
            }
            let Segment { finished, stock, .. } = segments[segment];
            let (left, right) = match state {
                State::Finished => (finished, finished),
                State::Stock => (stock, stock),
                State::Mixed { stock_side: Side::Left } => (stock, finished),
                State::Mixed { stock_side: Side::Right } => (finished, stock),
            };
            Interval { start, end, length: end - start, zone: base.zone(start, end), left, right }
        })
        .collect()
}

/// Diagrams of the weight in the base structure and its reactions.
fn weigh(intervals: &[Interval], base: &Base, side: Side) -> (Vec<Diagram>, [f64; 2]) {
    let count = intervals.len();
    let mut before = vec![Resultant::default(); count + 1];
    let mut behind = vec![Resultant::default(); count + 1];
    let mut reactions = [0.0; 2];
    for (k, interval) in intervals.iter().enumerate() {
        let weight = interval.section(side).weight_n_per_mm;
        before[k + 1] = before[k].advanced(weight, interval.length);
        let middle = Load { z: 0.5 * (interval.start + interval.end), couple: false };
        let share = base.reactions(middle);
        reactions[0] += share[0] * weight * interval.length;
        reactions[1] += share[1] * weight * interval.length;
    }
    for (k, interval) in intervals.iter().enumerate().rev() {
        behind[k] = behind[k + 1].advanced(interval.section(side).weight_n_per_mm, interval.length);
    }
    let moment = |node: usize, place: f64, zone: Zone| match zone {
        Zone::Left => -before[node].moment,
        Zone::Right => -behind[node].moment,
        // From the nearer support: the smaller numbers.
        Zone::Span if place - base.p < base.q - place => reactions[0] * (place - base.p) - before[node].moment,
        Zone::Span => reactions[1] * (base.q - place) - behind[node].moment,
    };
    let shear = |node: usize, zone: Zone| match zone {
        Zone::Left => -before[node].force,
        Zone::Right => behind[node].force,
        Zone::Span => reactions[0] - before[node].force,
    };
    let diagrams = intervals
        .iter()
        .enumerate()
        .map(|(k, interval)| Diagram {
            ends: [moment(k, interval.start, interval.zone), moment(k + 1, interval.end, interval.zone)],
            bulge: interval.section(side).weight_n_per_mm * interval.length * interval.length / 8.0,
            shear: [shear(k, interval.zone), shear(k + 1, interval.zone)],
        })
        .collect();
    (diagrams, reactions)
}
