//! The forced motion while both joints stay closed, where the force answers to it: uneven teeth, joints that harden. Exact.
//!
//! With uneven teeth the period is a revolution, in which x(t) and x(t - tau) differ, so the chips answer (`fixture/5.2`):
//! x = G (F - K x^3), F = level * sum over the teeth in cut of share * (chip - d (x(t) - x(t - tau)))^(1-k), with G the closed
//! vise, K the hardening of its joints, and d = 1 where the feed goes toward the movable jaw, else -1. Newton's method on the
//! Gauss points of elements, each step by GMRES: an application of G is two sweeps over the period, and few directions (those
//! near a resonance) are not damped by it. Of a cut that chatters it is the motion about which it does, as with even teeth.

use std::sync::LazyLock;

use nalgebra::DMatrix;

use crate::calculator::{Failure, Finding, Monitor, Pace, checkpoint};
use crate::num::dde::{Matrix, Propagator, Rule, product, times};
use crate::num::dense::length;
use crate::num::gmres::gmres;

use crate::fixture_stability::model::cutting::{Cutting, Stretch};
use crate::fixture_stability::model::floquet::{MULTIPLICATIONS_PER_CHIP, Working, damped, elements};
use crate::fixture_stability::model::holding::System;
use crate::fixture_stability::model::response::{Forces, Range};

/// Points of an element. With elements of at most 0.56 period of the fastest oscillation the force of the chips, a polynomial
/// between them, is off by 2e-7 of its change; x^3 oscillates three times as fast.
const POINTS: usize = 10;
const PARTS_WITH_HARDENING: u32 = 3;
/// A solution satisfies its equation to this share of the feed per tooth.
const SETTLED: f64 = 1e-10;
const NEWTON_STEPS: u32 = 30;
/// Least share of a step of Newton's method.
const LEAST_SHARE: f64 = 1.0 / 64.0;
/// Steps in which the load is raised where it cannot be put on at once.
const LOADS: u32 = 16;
/// What a step of Newton's method leaves of its linear equation, and how many applications of G it may take.
const LINEAR_RESIDUAL: f64 = 1e-3;
const LINEAR_STEPS: usize = 400;
/// Products that the linear equations of a motion may take: of one that is asked for, and of one that is but looked for, at
/// depths that nobody may want to cut. Some seconds, and a tenth of one; with six uneven teeth a motion takes a millionth of the
/// first.
const ASKED_FOR: f64 = 1e10;
const LOOKED_FOR: f64 = 2e8;
/// Places within an element between which an extreme is looked for, and how far from it they are in the second look.
const PLACES: usize = 16;
const NEARER: f64 = 0.01;

static TABLES: LazyLock<Tables> = LazyLock::new(Tables::new);

/// What depends on nothing but the number of points.
struct Tables {
    rule: Rule<POINTS>,
    /// From the points to anywhere.
    force: Interpolation<POINTS>,
    /// From both ends and the points to anywhere.
    motion: Interpolation<{ POINTS + 2 }>,
    /// Of `motion` at 0, 1/16 ... 1.
    places: Vec<[f64; POINTS + 2]>,
}

impl Tables {
    fn new() -> Self {
        let rule = Rule::<POINTS>::new();
        let mut nodes = [0.0; POINTS + 2];
        nodes[1..=POINTS].copy_from_slice(&rule.points);
        nodes[POINTS + 1] = 1.0;
        let (force, motion) = (Interpolation::new(rule.points), Interpolation::new(nodes));
        let places = (0..=PLACES).map(|i| motion.weights(i as f64 / PLACES as f64)).collect();
        Self { rule, force, motion, places }
    }
}

/// Barycentric interpolation.
struct Interpolation<const M: usize> {
    nodes: [f64; M],
    factors: [f64; M],
}

impl<const M: usize> Interpolation<M> {
    fn new(nodes: [f64; M]) -> Self {
        let distances = |j: usize| -> f64 { (0..M).filter(|&k| k != j).map(|k| nodes[j] - nodes[k]).product() };
        Self { nodes, factors: std::array::from_fn(|j| 1.0 / distances(j)) }
    }

    fn weights(&self, at: f64) -> [f64; M] {
        if let Some(node) = self.nodes.iter().position(|node| (at - node).abs() < 1e-14) {
            return std::array::from_fn(|j| f64::from(u8::from(j == node)));
        }
        let shares: [f64; M] = std::array::from_fn(|j| self.factors[j] / (at - self.nodes[j]));
        let sum: f64 = shares.iter().sum();
        shares.map(|share| share / sum)
    }

    fn at(&self, at: f64, values: &[f64; M]) -> f64 {
        weighted(&self.weights(at), values)
    }
}

fn weighted<const M: usize>(weights: &[f64; M], values: &[f64; M]) -> f64 {
    weights.iter().zip(values).map(|(weight, value)| weight * value).sum()
}

/// An element of the tooth pitch.
struct Element {
    propagator: usize,
    from_rad: f64,
    length_rad: f64,
    /// Share in the force of every tooth in cut, at the points.
    shares: Vec<[f64; POINTS]>,
}

/// A value at every point of the period: element by element, tooth pitch by tooth pitch.
type Field = Vec<f64>;

/// A period of the force: a tooth pitch, of uneven teeth a revolution.
pub(in crate::fixture_stability) struct Period<'a, const N: usize> {
    cutting: &'a Cutting,
    working: Working,
    /// Cp H^(1-mu), positive toward the movable jaw.
    level: f64,
    hardening_n_per_mm3: f64,
    propagators: Vec<Propagator<N, POINTS>>,
    elements: Vec<Element>,
    monitor: &'a dyn Monitor,
    /// State at the start of a period by the state that a force leaves at its end of a start at rest.
    closing: Matrix<N>,
}

/// The forced motion.
pub(in crate::fixture_stability) struct AnsweringMotion<'a, const N: usize> {
    period: Period<'a, N>,
    x_mm: Field,
    /// x at the start of every element and at the end of the last.
    ends_mm: Vec<f64>,
    /// Of the chips, and with what the hardening takes away.
    force_n: Field,
    acting_n: Field,
}

/// Why there is none.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::fixture_stability) enum NoMotion {
    /// A tooth loses the cut: the next one meets what it left.
    CutLost,
    /// Newton's method does not settle, not even when the load is raised in steps.
    Unsettled { residual_mm: f64, steps: u32 },
}

/// Why a search for a motion ends.
enum Stop {
    No(NoMotion),
    Failed(Failure),
}

impl From<NoMotion> for Stop {
    fn from(why: NoMotion) -> Self {
        Self::No(why)
    }
}

impl From<Failure> for Stop {
    fn from(failure: Failure) -> Self {
        Self::Failed(failure)
    }
}

/// How much a motion is worth.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::fixture_stability) enum Effort {
    /// Of a cut that is asked about.
    Asked,
    /// Of one among many depths at which a limit is looked for.
    Looked,
}

/// The forced motion.
pub(in crate::fixture_stability) fn answering_motion<'a, const N: usize>(
    system: &System<N>,
    cutting: &'a Cutting,
    working: Working,
    hardening_n_per_mm3: f64,
    effort: Effort,
    monitor: &'a dyn Monitor,
) -> Result<Result<AnsweringMotion<'a, N>, NoMotion>, Failure> {
    let products = match effort {
        Effort::Asked => ASKED_FOR,
        Effort::Looked => LOOKED_FOR,
    };
    match Period::new(system, cutting, working, hardening_n_per_mm3, monitor)?.motion(products) {
        Ok(motion) => Ok(Ok(motion)),
        Err(Stop::No(why)) => Ok(Err(why)),
        Err(Stop::Failed(failure)) => Err(failure),
    }
}

impl<'a, const N: usize> Period<'a, N> {
    fn new(
        system: &System<N>,
        cutting: &'a Cutting,
        working: Working,
        hardening_n_per_mm3: f64,
        monitor: &'a dyn Monitor,
    ) -> Result<Self, Failure> {
        let mut pace = Pace::new(monitor);
        let seconds_per_rad = cutting.tooth_period_s(working.spindle_rpm) / cutting.pitch_rad();
        let (mut propagators, mut placed): (Vec<Propagator<N, POINTS>>, Vec<Element>) = (Vec::new(), Vec::new());
        let mut known: Vec<(f64, usize)> = Vec::new();
        let parts = if hardening_n_per_mm3 > 0.0 { PARTS_WITH_HARDENING } else { 1 };
        let mut pitch: Matrix<N> = identity();
        for stretch in cutting.stretches() {
            let a = damped(system, cutting, &working, stretch.teeth);
            let mut from_rad = stretch.from_rad;
            let whole = elements(cutting, &stretch, seconds_per_rad, system.radius_rad_per_s).into_iter();
            for length_rad in whole.flat_map(|length| (0..parts).map(move |_| length / f64::from(parts))) {
                pace.work(MULTIPLICATIONS_PER_CHIP * POINTS * (1 + stretch.teeth))?;
                let same = |(length, teeth): &(f64, usize)| {
                    (length - length_rad).abs() <= 1e-12 * length_rad && *teeth == stretch.teeth
                };
                let propagator = known.iter().position(same).unwrap_or_else(|| {
                    known.push((length_rad, stretch.teeth));
                    propagators.push(Propagator::new(&TABLES.rule, &a, &system.b, length_rad * seconds_per_rad));
                    propagators.len() - 1
                });
                pitch = product(&propagators[propagator].whole, &pitch);
                let share = |j: usize, point: f64| cutting.shape(cutting.angle_rad(from_rad + point * length_rad, j));
                let shares = (0..stretch.teeth).map(|j| TABLES.rule.points.map(|point| share(j, point))).collect();
                placed.push(Element { propagator, from_rad, length_rad, shares });
                from_rad += length_rad;
            }
        }
        let whole = (0..cutting.phases()).fold(identity(), |whole, _| product(&pitch, &whole));
        let open = DMatrix::from_fn(N, N, |i, j| f64::from(u8::from(i == j)) - whole[i][j]);
        let closing = open.try_inverse().filter(|inverse| inverse.iter().all(|value| value.is_finite()));
        let closing =
            closing.ok_or_else(|| Failure::OutOfModel(Finding::new("undamped_resonance", "/cut/spindle_speed_rpm")))?;
        Ok(Self {
            cutting,
            working,
            level: cutting.direction * cutting.level(working.depth_mm),
            hardening_n_per_mm3,
            propagators,
            elements: placed,
            monitor,
            closing: std::array::from_fn(|i| std::array::from_fn(|j| closing[(i, j)])),
        })
    }

    fn points_per_pitch(&self) -> usize {
        self.elements.len() * POINTS
    }

    fn points(&self) -> usize {
        self.cutting.phases() * self.points_per_pitch()
    }

    /// Elements of the revolution, each with its place among the points.
    fn in_order(&self) -> impl Iterator<Item = (usize, &Element)> {
        let pitch = self.points_per_pitch();
        (0..self.cutting.phases()).flat_map(move |phase| {
            self.elements.iter().enumerate().map(move |(index, element)| (phase * pitch + index * POINTS, element))
        })
    }

    /// Force of the chips at the points, N, and its slope over x(t) - x(t - tau), N/mm, into `slope_n_per_mm`; `None` where a
    /// tooth loses the cut.
    fn force_n(&self, x_mm: &Field, load: f64, slope_n_per_mm: &mut Field) -> Result<Option<Field>, Failure> {
        let mut pace = Pace::new(self.monitor);
        let power = 1.0 - self.cutting.chip_exponent;
        let mut force_n = vec![0.0; self.points()];
        for (at, element) in self.in_order() {
            pace.work(MULTIPLICATIONS_PER_CHIP * POINTS * (1 + element.shares.len()))?;
            let phase = at / self.points_per_pitch();
            let before = (at + self.points() - self.points_per_pitch()) % self.points();
            for i in 0..POINTS {
                let moved_mm = self.cutting.direction * (x_mm[at + i] - x_mm[before + i]);
                let (mut force, mut slope) = (0.0, 0.0);
                for (j, shares) in element.shares.iter().enumerate() {
                    let fed_mm = self.cutting.chip_mm(self.working.feed_mm, self.cutting.tooth_number(phase, j));
                    let chip_mm = fed_mm - moved_mm;
                    if chip_mm <= 0.0 {
                        return Ok(None);
                    }
                    let of_tooth = shares[i] * self.cutting.chip_power(chip_mm);
                    force += of_tooth;
                    slope -= of_tooth * power / chip_mm;
                }
                force_n[at + i] = load * self.level * force;
                slope_n_per_mm[at + i] = load * self.cutting.direction * self.level * slope;
            }
        }
        Ok(Some(force_n))
    }

    /// One sweep over the period from a state to the last: `seen` is told where every element begins, and in which state.
    fn sweep(
        &self,
        start: &[f64; N],
        force_n: &[f64],
        mut seen: impl FnMut(usize, &[f64; N], &Propagator<N, POINTS>),
    ) -> [f64; N] {
        let mut q = *start;
        for (at, element) in self.in_order() {
            let propagator = &self.propagators[element.propagator];
            seen(at, &q, propagator);
            let mut end = times(&propagator.whole, &q);
            for (force, by_force) in force_n[at..at + POINTS].iter().zip(&propagator.end_by_force) {
                for k in 0..N {
                    end[k] += by_force[k] * force;
                }
            }
            q = end;
        }
        q
    }

    /// G: the periodic motion under a force, and x at the start of every element and at the end of the last.
    fn answer(&self, force_n: &[f64]) -> (Field, Vec<f64>) {
        let left = self.sweep(&[0.0; N], force_n, |_, _, _| {});
        let start = times(&self.closing, &left);
        let mut x_mm = vec![0.0; force_n.len()];
        let mut ends_mm = Vec::with_capacity(force_n.len() / POINTS + 1);
        let last = self.sweep(&start, force_n, |at, q, propagator| {
            ends_mm.push(q[0]);
            for i in 0..POINTS {
                let mut x = weighted(&propagator.at_points[i], q);
                for (by_force, force) in propagator.points_by_force[i].iter().zip(&force_n[at..at + POINTS]) {
                    x += by_force * force;
                }
                x_mm[at + i] = x;
            }
        });
        ends_mm.push(last[0]);
        (x_mm, ends_mm)
    }

    /// `products` that its linear equations may take.
    fn motion(self, products: f64) -> Result<AnsweringMotion<'a, N>, Stop> {
        let mut left = products;
        let still = || vec![0.0; self.points()];
        let mut found = self.newton(still(), 1.0, &mut left);
        if matches!(found, Err(Stop::No(_))) {
            let raised = |step: u32| f64::from(step) / f64::from(LOADS);
            found = (2..=LOADS).fold(self.newton(still(), raised(1), &mut left), |found, step| {
                found.and_then(|balance| self.newton(balance.answer_mm, raised(step), &mut left))
            });
        }
        let Balance { answer_mm, force_n, acting_n, ends_mm, .. } = found?;
        Ok(AnsweringMotion { period: self, x_mm: answer_mm, ends_mm, force_n, acting_n })
    }

    /// What holds of a motion under a share of the force; `None` where a tooth loses the cut.
    fn balance(&self, x_mm: Field, load: f64) -> Result<Option<Balance>, Failure> {
        checkpoint(self.monitor)?;
        let mut slope_n_per_mm = vec![0.0; x_mm.len()];
        let Some(force_n) = self.force_n(&x_mm, load, &mut slope_n_per_mm)? else { return Ok(None) };
        let acting_n: Field =
            force_n.iter().zip(&x_mm).map(|(force, x)| force - self.hardening_n_per_mm3 * x.powi(3)).collect();
        let (answer_mm, ends_mm) = self.answer(&acting_n);
        let missing_mm = answer_mm.iter().zip(&x_mm).map(|(answer, x)| answer - x).collect();
        Ok(Some(Balance { x_mm, force_n, slope_n_per_mm, acting_n, answer_mm, ends_mm, missing_mm }))
    }

    /// Newton's method from x under a share of the force. Steps are halved where a tooth would lose the cut, or more be missing
    /// than before. What it takes comes off the products that are `left`.
    fn newton(&self, from_mm: Field, load: f64, left: &mut f64) -> Result<Balance, Stop> {
        let mut now = self.balance(from_mm, load)?.ok_or(NoMotion::CutLost)?;
        for steps in 1..=NEWTON_STEPS {
            let residual_mm = now.largest_mm();
            // Of numbers that are none the largest is 0, but the length is none either.
            if residual_mm <= SETTLED * self.working.feed_mm && now.length_mm().is_finite() {
                return Ok(now);
            }
            let unsettled = NoMotion::Unsettled { residual_mm, steps };
            let step = self.step(&now, left)?.ok_or(unsettled)?;
            let moved = |share: f64| {
                let x_mm = now.x_mm.iter().zip(&step).map(|(x, step)| x + share * step).collect();
                self.balance(x_mm, load)
            };
            let (mut share, mut next) = (1.0, moved(1.0)?);
            let is_nearer = |next: &Balance| next.length_mm() < now.length_mm();
            while !next.as_ref().is_some_and(is_nearer) {
                share *= 0.5;
                if share < LEAST_SHARE {
                    return Err(Stop::No(if next.is_none() { NoMotion::CutLost } else { unsettled }));
                }
                next = moved(share)?;
            }
            now = next.ok_or(NoMotion::CutLost)?;
        }
        Err(Stop::No(NoMotion::Unsettled { residual_mm: now.largest_mm(), steps: NEWTON_STEPS }))
    }

    /// (1 - G (slope (1 - S) - 3 K x^2)) step = what is missing, with S the shift by a tooth pitch; `None` where that is more than
    /// the products `left` allow.
    fn step(&self, now: &Balance, left: &mut f64) -> Result<Option<Field>, Failure> {
        let (points, pitch) = (self.points(), self.points_per_pitch());
        let most = affordable(*left, points);
        let found = gmres(&now.missing_mm, LINEAR_RESIDUAL, most, |v| {
            checkpoint(self.monitor)?;
            let force_of = |i: usize| {
                let own = 3.0 * self.hardening_n_per_mm3 * now.x_mm[i] * now.x_mm[i] * v[i];
                now.slope_n_per_mm[i] * (v[i] - v[(i + points - pitch) % points]) - own
            };
            let force: Field = (0..points).map(force_of).collect();
            let (by_force, _) = self.answer(&force);
            Ok::<_, Failure>(v.iter().zip(&by_force).map(|(v, g)| v - g).collect())
        })?;
        *left -= products(found.steps, points);
        Ok((found.residual <= LINEAR_RESIDUAL || most == LINEAR_STEPS).then_some(found.x))
    }
}

/// A motion with what it asks and gets.
struct Balance {
    x_mm: Field,
    /// Of the chips, its slope over x(t) - x(t - tau), and with what the hardening takes away.
    force_n: Field,
    slope_n_per_mm: Field,
    acting_n: Field,
    /// How the vise moves under it: at the points, and at the start of every element and the end of the last.
    answer_mm: Field,
    ends_mm: Vec<f64>,
    missing_mm: Field,
}

impl Balance {
    fn largest_mm(&self) -> f64 {
        self.missing_mm.iter().fold(0.0, |most: f64, value| most.max(value.abs()))
    }

    fn length_mm(&self) -> f64 {
        length(&self.missing_mm)
    }
}

/// Products that so many directions take, each made orthogonal to those before it.
fn products(directions: usize, points: usize) -> f64 {
    (directions * directions * points) as f64
}

/// The most directions that so many products allow.
fn affordable(left: f64, points: usize) -> usize {
    (0..=LINEAR_STEPS).rev().find(|&directions| products(directions, points) <= left).unwrap_or(0)
}

fn identity<const N: usize>() -> Matrix<N> {
    std::array::from_fn(|i| std::array::from_fn(|j| f64::from(u8::from(i == j))))
}

impl<const N: usize> AnsweringMotion<'_, N> {
    /// Smallest and largest x, mm.
    pub(in crate::fixture_stability) fn range_mm(&self) -> Range {
        let (mut low, mut high) = (f64::INFINITY, f64::NEG_INFINITY);
        for (index, points) in self.x_mm.chunks_exact(POINTS).enumerate() {
            let mut nodes = [self.ends_mm[index + 1]; POINTS + 2];
            nodes[0] = self.ends_mm[index];
            nodes[1..=POINTS].copy_from_slice(points);
            let sampled: [f64; PLACES + 1] = std::array::from_fn(|i| weighted(&TABLES.places[i], &nodes));
            let mut take = |value: f64| {
                low = low.min(value);
                high = high.max(value);
            };
            sampled.into_iter().for_each(&mut take);
            // What lies at any place of an element is a value of the motion: a parabola only says where to look.
            let at = |place: f64| TABLES.motion.at(place, &nodes);
            for (i, three) in sampled.windows(3).enumerate() {
                let Some(turn) = turn(three) else { continue };
                let place = (((i + 1) as f64 + turn) / PLACES as f64).clamp(NEARER, 1.0 - NEARER);
                let near = [place - NEARER, place, place + NEARER].map(at);
                near.into_iter().for_each(&mut take);
                if let Some(turn) = self::turn(&near) {
                    take(at((place + turn * NEARER).clamp(0.0, 1.0)));
                }
            }
        }
        Range { low, high }
    }

    /// Force of all teeth, and what acts on the linear vise, at an angle since the entry of a tooth, within a stretch of the tooth
    /// pitch that it belongs to, N.
    pub(in crate::fixture_stability) fn forces_n(
        &self,
        stretch: &Stretch,
        since_entry_rad: f64,
        phase: usize,
    ) -> Forces {
        let elements = &self.period.elements;
        // Of a place where two stretches meet the element of the one that is asked about.
        let first = elements.partition_point(|element| element.from_rad < stretch.from_rad - 1e-12);
        let after = elements.partition_point(|element| element.from_rad <= since_entry_rad);
        let last = elements.partition_point(|element| element.from_rad < stretch.to_rad - 1e-12);
        let index = after.clamp(first + 1, last.max(first + 1)) - 1;
        let element = &elements[index];
        let at = phase * self.period.points_per_pitch() + index * POINTS;
        let place = ((since_entry_rad - element.from_rad) / element.length_rad).clamp(0.0, 1.0);
        let weights = TABLES.force.weights(place);
        let of =
            |field: &Field| weights.iter().zip(&field[at..at + POINTS]).map(|(weight, value)| weight * value).sum();
        Forces { chips_n: of(&self.force_n), acting_n: of(&self.acting_n) }
    }
}

/// Where the parabola through three values one apart turns, from the middle one, if it does so near them.
fn turn(three: &[f64]) -> Option<f64> {
    let &[before, here, next] = three else { return None };
    let curvature = before - 2.0 * here + next;
    let turn = -0.5 * (next - before) / curvature;
    (turn.abs() <= 2.0).then_some(turn)
}
