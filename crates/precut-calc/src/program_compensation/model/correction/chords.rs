//! The fewest chords that stay in a tube about a curve: never thinner than it by more than the tolerance, and thicker only where it
//! jumps (`program/5`).

use std::collections::BTreeSet;

/// A place along a move and the shift there, mm.
pub(crate) type Knot = [f64; 2];

/// Places that are no two, mm.
const SAME_MM: f64 = 1e-6;
/// Places beside a jump at which a chord may end, to a least length of a chord.
const PLACES: f64 = 8.0;
/// How far beside it, to that length or to the one over which a chord gains what it loses.
const BESIDE: f64 = 6.0;
/// What may be lost where no height is gained yet, to the tolerance.
const ALLOWED: f64 = 1.5;

/// A place of the curve.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Wanted {
    /// Along the move, mm.
    pub(crate) at: f64,
    /// The shift, mm; where nothing is cut the least one that touches nothing.
    pub(crate) shift: f64,
    /// Whether anything is cut: elsewhere every larger one does as well.
    pub(crate) cuts: bool,
}

/// What chords are laid by, mm.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Limits {
    /// To either side of the curve.
    pub(crate) tolerance: f64,
    /// No chord is shorter.
    pub(crate) shortest: f64,
    /// What a chord is taken to lose of the lift by its slope, to the lift itself.
    pub(crate) lost: f64,
}

/// The tube at a place, mm.
#[derive(Debug, Clone, Copy)]
struct Gate {
    at: f64,
    low: f64,
    high: f64,
    /// Where a chord would best end.
    aim: f64,
    /// A chord that ends lower makes the next one, which is no shorter than the least length, climb beyond what is near.
    knot: f64,
}

/// Knots of the chords: the first one is `start` at the begin of the curve. `end` is the shift at its end, where that is given.
pub(crate) fn chords(curve: &[Wanted], start: f64, end: Option<f64>, limits: Limits) -> Vec<Knot> {
    let curve = beside_jumps(curve, limits);
    let (Some(first), Some(last)) = (curve.first(), curve.last()) else { return Vec::new() };
    let mut gates = gates(&curve, start, limits);
    if let (Some(gate), Some(end)) = (gates.last_mut(), end) {
        (gate.low, gate.high, gate.aim) = (end, end, end);
    }
    if let Some(gate) = gates.first_mut().filter(|_| first.cuts) {
        gate.low = gate.low.max(start - limits.tolerance);
    }
    lean(&mut gates, &curve, limits);
    lift_knots(&mut gates, limits.shortest);
    let mut knots: Vec<Knot> = vec![[first.at, start]];
    let mut i = 0;
    while i + 1 < gates.len() {
        let from = knots.last().map_or(start, |knot| knot[1]);
        let (next, shift) = farthest(&gates, i, (from, last.at), limits.shortest);
        knots.push([gates[next].at, shift]);
        i = next;
    }
    knots
}

/// The curve at a place between two of its own.
pub(crate) fn between(a: Wanted, b: Wanted, at: f64) -> Wanted {
    let length = b.at - a.at;
    let share = if length > 0.0 { (at - a.at) / length } else { 1.0 };
    let cuts = a.cuts && b.cuts || if share < 0.5 { a.cuts } else { b.cuts };
    Wanted { at, shift: a.shift + share * (b.shift - a.shift), cuts }
}

/// The curve with places of its own on both sides of every jump, at which a chord may end.
fn beside_jumps(curve: &[Wanted], limits: Limits) -> Vec<Wanted> {
    let (Some(first), Some(last)) = (curve.first(), curve.last()) else { return Vec::new() };
    let mut places: Vec<f64> = curve.iter().map(|wanted| wanted.at).collect();
    let jumps =
        |pair: &&[Wanted]| (pair[1].shift - pair[0].shift).abs() > limits.tolerance || pair[0].cuts != pair[1].cuts;
    let step = limits.shortest / PLACES;
    let mut near: BTreeSet<i64> = BTreeSet::new();
    let mut add = |from: f64, to: f64| {
        // Moves are shorter than 10 km.
        #[allow(clippy::cast_possible_truncation)]
        near.extend((from / step).ceil() as i64..=(to / step).floor() as i64);
    };
    let deepest = curve.iter().map(|wanted| wanted.shift.abs()).fold(0.0, f64::max);
    let beside = BESIDE * (limits.lost * deepest).max(limits.shortest);
    for pair in curve.windows(2).filter(jumps) {
        add(pair[0].at - beside, (pair[0].at + beside).min(pair[1].at));
        add((pair[1].at - beside).max(pair[0].at), pair[1].at + beside);
    }
    add(first.at, first.at + beside);
    add(last.at - beside, last.at);
    places.extend(near.into_iter().map(|k| k as f64 * step));
    places.extend([first.at + limits.shortest, last.at - limits.shortest]);
    places.retain(|at| (first.at..=last.at).contains(at));
    places.sort_by(f64::total_cmp);
    places.dedup_by(|later, kept| *later - *kept <= SAME_MM);
    let mut i = 1;
    let at = |at: f64| {
        while i + 1 < curve.len() && curve[i].at < at {
            i += 1;
        }
        between(curve[i - 1], curve[i], at)
    };
    if curve.len() < 2 { curve.to_vec() } else { places.into_iter().map(at).collect() }
}

/// The tube: the curve less the tolerance at the bottom, at the top the largest shift that is near.
fn gates(curve: &[Wanted], start: f64, limits: Limits) -> Vec<Gate> {
    let near = 1.5 * limits.shortest;
    let (mut from, mut to) = (0, 0);
    let mut gates: Vec<Gate> = Vec::with_capacity(curve.len());
    let begin = curve.first().map_or(0.0, |first| first.at);
    let all = curve.iter().map(|wanted| wanted.shift).fold(start, f64::max);
    for wanted in curve {
        while curve[from].at < wanted.at - near {
            from += 1;
        }
        while to < curve.len() && curve[to].at <= wanted.at + near {
            to += 1;
        }
        let highest = curve[from..to].iter().map(|other| other.shift).fold(wanted.shift, f64::max);
        // A move that has to begin above its curve comes down to it.
        let highest = if wanted.at - begin <= near { highest.max(start) } else { highest };
        let high = if wanted.cuts { highest } else { all } + limits.tolerance;
        let low = wanted.shift - limits.tolerance;
        gates.push(Gate { at: wanted.at, low, high, aim: wanted.shift, knot: low });
    }
    gates
}

/// Raises the bottom of the tube beside jumps. A chord that climbs changes the cut, and so by how much the tool is pushed off, in
/// proportion to its slope: it may climb as it has gained height to lose.
fn lean(gates: &mut [Gate], curve: &[Wanted], limits: Limits) {
    let allowed = ALLOWED * limits.tolerance;
    let raise = |gate: &mut Gate, other: Gate, base: f64| {
        let height = other.low + limits.tolerance - base;
        let scale = limits.lost * base.abs();
        if height > 0.0 && scale > 0.0 {
            let left = (height + allowed) * (-(gate.at - other.at).abs() / scale).exp() - allowed;
            gate.low = gate.low.max(base + left - limits.tolerance);
        }
        gate.high = gate.high.max(gate.low);
        gate.aim = gate.aim.max(gate.low + limits.tolerance).min(gate.high);
    };
    for i in (1..gates.len()).rev() {
        let other = gates[i];
        raise(&mut gates[i - 1], other, curve[i - 1].shift);
    }
    for i in 1..gates.len() {
        let other = gates[i - 1];
        raise(&mut gates[i], other, curve[i].shift);
    }
}

/// Where the tube rises within the least length of a chord, the chord before it ends as high as the tube is there.
fn lift_knots(gates: &mut [Gate], shortest: f64) {
    for i in 0..gates.len() {
        let from = gates[i].at;
        let near = gates[i..].iter().take_while(|gate| gate.at < from + shortest - SAME_MM);
        gates[i].knot = near.map(|gate| gate.low).fold(f64::NEG_INFINITY, f64::max).min(gates[i].high);
    }
}

/// The farthest gate that one chord reaches through all before it, and the shift there. Neither this chord nor what is left for
/// the next ones is shorter than the least length.
fn farthest(gates: &[Gate], i: usize, (from, end): (f64, f64), shortest: f64) -> (usize, f64) {
    let (mut low, mut high) = (f64::NEG_INFINITY, f64::INFINITY);
    let mut found = None;
    for (j, gate) in gates.iter().enumerate().skip(i + 1) {
        let length = gate.at - gates[i].at;
        let is_last = j + 1 == gates.len();
        let (lowest, highest) = (low.max((gate.low - from) / length), high.min((gate.high - from) / length));
        if lowest > highest && found.is_some() {
            break;
        }
        // Until a chord is long enough it goes where it must: thick rather than thin.
        (low, high) = (lowest, highest.max(lowest));
        let is_long = length >= shortest - SAME_MM && end - gate.at >= shortest - SAME_MM;
        if is_long || is_last {
            let shift = from + ((gate.aim.max(gate.knot) - from) / length).clamp(low, high) * length;
            if is_last || found.is_none() || shift >= gate.knot - SAME_MM {
                found = Some((j, shift));
            }
        }
    }
    found.unwrap_or((gates.len() - 1, gates[gates.len() - 1].aim))
}

#[cfg(test)]
mod tests {
    use super::*;

    const LIMITS: Limits = Limits { tolerance: 5e-4, shortest: 0.1, lost: 1.6 };

    /// How far the chords are off the curve, down and up.
    fn deviation(curve: &[Wanted], knots: &[Knot]) -> (f64, f64) {
        let at = |x: f64| {
            let i = (1..knots.len() - 1).find(|&i| knots[i][0] >= x).unwrap_or(knots.len() - 1);
            let (a, b) = (knots[i - 1], knots[i]);
            a[1] + (x - a[0]) / (b[0] - a[0]) * (b[1] - a[1])
        };
        let off = curve.iter().map(|wanted| at(wanted.at) - wanted.shift);
        off.fold((0.0, 0.0), |(low, high), off| (off.min(low), off.max(high)))
    }

    fn curve(count: i32, step: f64, shift: impl Fn(f64) -> f64) -> Vec<Wanted> {
        let at = |i: i32| f64::from(i) * step;
        (0..=count).map(|i| Wanted { at: at(i), shift: shift(at(i)), cuts: true }).collect()
    }

    #[test]
    fn a_smooth_curve_takes_few_chords() {
        let points = curve(400, 0.5, |x| -0.02 * (x / 64.0).sin());
        let knots = chords(&points, 0.0, None, LIMITS);
        let (low, high) = deviation(&points, &knots);
        assert!(low > -5.1e-4 && high < 5.1e-4, "{low} {high}");
        assert!(knots.len() < 10, "{}", knots.len());
    }

    /// At a jump the work stays thick over a block or two, whichever way it goes, and is never cut thin.
    #[test]
    fn a_jump_is_laid_on_the_side_of_the_stock() {
        for sign in [1.0, -1.0] {
            let points = curve(1000, 0.01, |x| if x < 5.0 { 0.0 } else { sign * 0.03 });
            let knots = chords(&points, 0.0, None, LIMITS);
            let (low, _) = deviation(&points, &knots);
            assert!(low > -6e-4, "{low} {knots:?}");
            assert!(knots.len() <= 9, "{knots:?}");
            assert!(knots.windows(2).all(|pair| pair[1][0] - pair[0][0] > 0.0999), "{knots:?}");
            let far: Vec<Wanted> = points.iter().copied().filter(|wanted| (wanted.at - 5.0).abs() > 0.5).collect();
            assert!(deviation(&far, &knots).1 < 6e-4, "{knots:?}");
        }
    }

    /// In the air the shift is free above what would touch the work.
    #[test]
    fn air_is_crossed_without_a_knot() {
        let mut points = curve(500, 0.01, |x| if x < 2.0 { -1.0 } else { -0.02 });
        for wanted in &mut points {
            wanted.cuts = wanted.at >= 2.0;
        }
        let knots = chords(&points, 0.0, None, LIMITS);
        assert_eq!(knots.len(), 3, "{knots:?}");
    }
}
