//! The map over a period of modes that meet, through two or three directions, what earlier teeth left (`milling/4.15`).
//!
//! On an element with the Gauss points t_i the force F_i on the tool is, with r = tool minus work,
//!
//! ```text
//!     F_i = sum over entries D (r_i - r(t_i - tau)) + C r'_i,
//!     r_i = Phi_i q + sum_j K_ij F_j,   r'_i likewise:
//! ```
//!
//! one system in the forces of the element, whatever the number of modes. Delayed motion is interpolated on the points of
//! the element it falls into; what falls into the running element enters its matrix. The map acts on (q, r at the points of
//! the period before that are met).

use std::collections::BTreeSet;

use nalgebra::{DMatrix, DVector};

use crate::calculator::{Failure, Monitor, Pace};
use crate::num::dde::{Propagator, Rule};

use super::cutter::{Milling, Tensor};
use super::edge::Edges;
use super::mesh;
use super::rotation::Rotation;
use super::structure::{Structure, dot};

/// What the modes do over an element, put together for all directions.
#[derive(Debug)]
struct Passage {
    length_s: f64,
    /// r at the points by q: a row per point and direction.
    by_state: DMatrix<f64>,
    /// r at the points by the forces there.
    by_force: DMatrix<f64>,
    /// The same of r', where the flank rubs.
    velocity: Option<(DMatrix<f64>, DMatrix<f64>)>,
    /// q at the end by q, a block per mode, and by the forces.
    whole: Vec<[[f64; 2]; 2]>,
    end_by_force: DMatrix<f64>,
}

/// Motion that an element meets: of which element, in this period or the one before, and by which matrix.
#[derive(Debug)]
struct Met {
    element: usize,
    is_before: bool,
    matrix: DMatrix<f64>,
}

#[derive(Debug)]
struct Element {
    passage: usize,
    /// F by q and by the motion that is met; none where nothing is cut.
    cut: Option<Forces>,
    /// Where its motion stands in the vector, where the next period meets it.
    kept: Option<usize>,
    /// Where it stands among the motions of the period.
    met_now: bool,
}

/// What acts beside the rubbing of flanks.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Acting {
    /// What earlier teeth left: the map of a disturbance.
    Waves,
    /// That and the force of undisturbed chips: the map of the motion itself.
    WavesAndForce,
    /// The force alone: of a motion that every tooth repeats no wave is left.
    Force,
}

/// The map of a period.
#[derive(Debug)]
pub struct Map {
    pub(super) times: Vec<f64>,
    passages: Vec<Passage>,
    elements: Vec<Element>,
    states: usize,
    rows: usize,
    dimension: usize,
}

/// What is looked at.
#[derive(Debug, Clone, Copy)]
pub struct Cut<'a> {
    /// Cutter and engagement.
    pub milling: &'a Milling,
    /// What yields.
    pub structure: &'a Structure,
    /// How the spindle turns.
    pub rotation: Rotation,
    /// Axial depth, mm.
    pub depth_mm: f64,
}

impl Map {
    /// The map; `None` where the equations of an element are singular.
    pub fn new<const P: usize>(cut: &Cut<'_>, rule: &Rule<P>, monitor: &dyn Monitor) -> Result<Option<Self>, Failure> {
        Self::of(cut, rule, Acting::Waves, monitor)
    }

    /// The same of what acts.
    pub(super) fn of<const P: usize>(
        cut: &Cut<'_>,
        rule: &Rule<P>,
        acting: Acting,
        monitor: &dyn Monitor,
    ) -> Result<Option<Self>, Failure> {
        let (structure, rotation) = (cut.structure, &cut.rotation);
        let edges = Edges::new(cut.milling, cut.depth_mm);
        let times = mesh::times_s(cut.milling, &edges, rotation, structure.fastest_rad_per_s());
        let directions = structure.basis.len();
        let rows = P * directions;
        let mut map =
            Self { times, passages: Vec::new(), elements: Vec::new(), states: structure.states(), rows, dimension: 0 };
        let mut pace = Pace::new(monitor);
        for index in 0..map.times.len() - 1 {
            let pair = [map.times[index], map.times[index + 1]];
            let length_s = pair[1] - pair[0];
            let passage = map.passage(cut, rule, length_s);
            pace.work(6 * rows.pow(3) + 60 * P * P * structure.modes.len() + 2 * P * edges.work())?;
            let assembled =
                Assembly { cut, rule, edges: &edges, times: &map.times, index, acting }.element(&map.passages[passage]);
            let cut = match assembled {
                Assembled::Nothing => None,
                Assembled::Cut(forces) => Some(forces),
                Assembled::Singular => return Ok(None),
            };
            map.elements.push(Element { passage, cut, kept: None, met_now: false });
        }
        map.place();
        Ok(Some(map))
    }

    /// The passage of an element of so many seconds, made once.
    fn passage<const P: usize>(&mut self, cut: &Cut<'_>, rule: &Rule<P>, length_s: f64) -> usize {
        let same = |known: &Passage| (known.length_s - length_s).abs() <= 1e-12 * length_s;
        self.passages.iter().position(same).unwrap_or_else(|| {
            self.passages.push(Passage::new(cut.structure, rule, length_s, cut.milling.rubbing.is_some()));
            self.passages.len() - 1
        })
    }

    /// Gives every motion that is met its place.
    fn place(&mut self) {
        let met: BTreeSet<(usize, bool)> = self
            .elements
            .iter()
            .filter_map(|element| element.cut.as_ref())
            .flat_map(|forces| forces.met.iter().map(|one| (one.element, one.is_before)))
            .collect();
        self.dimension = self.states;
        for (index, element) in self.elements.iter_mut().enumerate() {
            element.met_now = met.contains(&(index, false));
            if met.contains(&(index, true)) {
                element.kept = Some(self.dimension);
                self.dimension += self.rows;
            }
        }
    }

    /// Length of the vector that it acts on.
    pub fn dimension(&self) -> usize {
        self.dimension
    }

    /// Motion at the points of an element by the state at its beginning and the forces in it.
    pub(super) fn motion(&self, element: usize, force: &[f64], state: &[f64]) -> Vec<f64> {
        let passage = &self.passages[self.elements[element].passage];
        let mut motion = vec![0.0; self.rows];
        add_product(&mut motion, &passage.by_state, state);
        add_product(&mut motion, &passage.by_force, force);
        motion
    }

    /// How many multiplications one application takes, roughly.
    pub fn work(&self) -> usize {
        self.elements.len() * self.rows * (3 * self.rows + 2 * self.states)
    }

    /// One period on, in place.
    pub fn apply(&self, vector: &mut [f64]) {
        self.apply_seen(vector, |_, _, _| ());
    }

    /// The same, showing of every element its number, the force at its points (in the basis, point by point) and the state at
    /// its beginning.
    pub(super) fn apply_seen(&self, vector: &mut [f64], mut seen: impl FnMut(usize, &[f64], &[f64])) {
        let mut q = vector[..self.states].to_vec();
        let mut kept: Vec<f64> = vector.to_vec();
        let mut now: Vec<Vec<f64>> = vec![Vec::new(); self.elements.len()];
        let (mut force, mut motion) = (vec![0.0; self.rows], vec![0.0; self.rows]);
        for (index, element) in self.elements.iter().enumerate() {
            let passage = &self.passages[element.passage];
            force.fill(0.0);
            if let Some(Forces { by_state, met, driving }) = &element.cut {
                if let Some(driving) = driving {
                    force.copy_from_slice(driving);
                }
                add_product(&mut force, by_state, &q);
                for one in met {
                    let from = match (one.is_before, self.elements[one.element].kept) {
                        (true, Some(at)) => &vector[at..at + self.rows],
                        _ => &now[one.element],
                    };
                    add_product(&mut force, &one.matrix, from);
                }
            }
            seen(index, &force, &q);
            if element.kept.is_some() || element.met_now {
                motion.fill(0.0);
                add_product(&mut motion, &passage.by_state, &q);
                if element.cut.is_some() {
                    add_product(&mut motion, &passage.by_force, &force);
                }
                if let Some(at) = element.kept {
                    kept[at..at + self.rows].copy_from_slice(&motion);
                }
                if element.met_now {
                    now[index].clone_from(&motion);
                }
            }
            for (pair, whole) in q.chunks_exact_mut(2).zip(&passage.whole) {
                let (x, v) = (pair[0], pair[1]);
                pair[0] = whole[0][0] * x + whole[0][1] * v;
                pair[1] = whole[1][0] * x + whole[1][1] * v;
            }
            if element.cut.is_some() {
                add_product(&mut q, &passage.end_by_force, &force);
            }
        }
        vector.copy_from_slice(&kept);
        vector[..self.states].copy_from_slice(&q);
    }
}

impl Map {
    /// The transposed map, in place: its eigenvectors say how well an eigenvalue is conditioned.
    pub(super) fn apply_transposed(&self, vector: &mut [f64]) {
        let mut q = vector[..self.states].to_vec();
        let mut met = vec![0.0; vector.len()];
        let mut now: Vec<Vec<f64>> = self
            .elements
            .iter()
            .map(|element| if element.met_now { vec![0.0; self.rows] } else { Vec::new() })
            .collect();
        let (mut force, mut motion) = (vec![0.0; self.rows], vec![0.0; self.rows]);
        for (index, element) in self.elements.iter().enumerate().rev() {
            let passage = &self.passages[element.passage];
            motion.fill(0.0);
            if let Some(at) = element.kept {
                motion.copy_from_slice(&vector[at..at + self.rows]);
            }
            for (sum, value) in motion.iter_mut().zip(&now[index]) {
                *sum += value;
            }
            let mut before = vec![0.0; self.states];
            for ((pair, after), whole) in before.chunks_exact_mut(2).zip(q.chunks_exact(2)).zip(&passage.whole) {
                pair[0] = whole[0][0] * after[0] + whole[1][0] * after[1];
                pair[1] = whole[0][1] * after[0] + whole[1][1] * after[1];
            }
            add_transposed(&mut before, &passage.by_state, &motion);
            if let Some(forces) = &element.cut {
                force.fill(0.0);
                add_transposed(&mut force, &passage.end_by_force, &q);
                add_transposed(&mut force, &passage.by_force, &motion);
                add_transposed(&mut before, &forces.by_state, &force);
                for one in &forces.met {
                    let target = match (one.is_before, self.elements[one.element].kept) {
                        (true, Some(at)) => &mut met[at..at + self.rows],
                        _ => &mut now[one.element][..],
                    };
                    add_transposed(target, &one.matrix, &force);
                }
            }
            q = before;
        }
        vector.copy_from_slice(&met);
        vector[..self.states].copy_from_slice(&q);
    }
}

impl Passage {
    fn new<const P: usize>(structure: &Structure, rule: &Rule<P>, length_s: f64, rubs: bool) -> Self {
        let propagators = structure.propagators(rule, length_s);
        let (by_state, by_force) = at_points(structure, &propagators, |_, row| row);
        let velocity = rubs.then(|| {
            let moving = structure.velocities(rule, length_s);
            // Their state is (x', x w), of which q = (x, x'/w).
            at_points(structure, &moving, |k, [v, x]| {
                let w = structure.modes[k].rad_per_s();
                [x * w, v * w]
            })
        });
        let d = structure.basis.len();
        let mut end_by_force = DMatrix::zeros(structure.states(), P * d);
        for (k, propagator) in propagators.iter().enumerate() {
            for (j, row) in propagator.end_by_force.iter().enumerate() {
                for (b, along) in structure.directions[k].iter().enumerate() {
                    end_by_force[(2 * k, j * d + b)] = row[0] * along;
                    end_by_force[(2 * k + 1, j * d + b)] = row[1] * along;
                }
            }
        }
        let whole = propagators.iter().map(|p| p.whole).collect();
        Self { length_s, by_state, by_force, velocity, whole, end_by_force }
    }
}

/// Motion at the points by the state and by the forces, summed over the modes.
fn at_points<const P: usize>(
    structure: &Structure,
    propagators: &[Propagator<2, P>],
    state: impl Fn(usize, [f64; 2]) -> [f64; 2],
) -> (DMatrix<f64>, DMatrix<f64>) {
    let d = structure.basis.len();
    let mut by_state = DMatrix::zeros(P * d, structure.states());
    let mut by_force = DMatrix::zeros(P * d, P * d);
    for (k, propagator) in propagators.iter().enumerate() {
        let along = &structure.directions[k];
        for i in 0..P {
            let row = state(k, propagator.at_points[i]);
            for a in 0..d {
                by_state[(i * d + a, 2 * k)] = along[a] * row[0];
                by_state[(i * d + a, 2 * k + 1)] = along[a] * row[1];
                for j in 0..P {
                    for b in 0..d {
                        by_force[(i * d + a, j * d + b)] += along[a] * along[b] * propagator.points_by_force[i][j];
                    }
                }
            }
        }
    }
    (by_state, by_force)
}

/// An element that is being put together.
struct Assembly<'a, const P: usize> {
    cut: &'a Cut<'a>,
    rule: &'a Rule<P>,
    edges: &'a Edges<'a>,
    times: &'a [f64],
    index: usize,
    acting: Acting,
}

/// F by the state, the motions met with the matrices that make F of them, and F without either where chips drive.
#[derive(Debug)]
struct Forces {
    by_state: DMatrix<f64>,
    met: Vec<Met>,
    driving: Option<Vec<f64>>,
}

/// What an element came to.
enum Assembled {
    /// Nothing is cut in it.
    Nothing,
    Cut(Forces),
    /// Its equations have no solution.
    Singular,
}

impl<const P: usize> Assembly<'_, P> {
    fn element(&self, passage: &Passage) -> Assembled {
        let d = self.cut.structure.basis.len();
        let rows = P * d;
        let (from, length) = (self.times[self.index], self.times[self.index + 1] - self.times[self.index]);
        let mut present: DMatrix<f64> = DMatrix::zeros(rows, rows);
        let mut rubbing: DMatrix<f64> = DMatrix::zeros(rows, rows);
        let mut met: Vec<Met> = Vec::new();
        let mut chips: Vec<f64> = Vec::new();
        let is_driven = self.acting != Acting::Waves;
        for (i, point) in self.rule.points.iter().enumerate() {
            let time = from + point * length;
            let rotation_rad = self.cut.rotation.rotation_rad(time);
            let instant = self.edges.at(rotation_rad);
            if is_driven {
                let force = self.edges.driving(rotation_rad);
                chips.extend(self.cut.structure.basis.iter().map(|b| dot(b, &force)));
            }
            for entry in instant.entries.iter().filter(|_| self.acting != Acting::Force) {
                let stiffness = self.reduced(&entry.stiffness);
                add_block(&mut present, i, i, d, &stiffness, 1.0);
                let (element, is_before, weights) = self.met_at(time, entry.turned_rad, i);
                let target = if element == self.index && !is_before {
                    // The delay ends inside this element: its own motion.
                    for (j, weight) in weights.iter().enumerate() {
                        add_block(&mut present, i, j, d, &stiffness, -weight);
                    }
                    continue;
                } else {
                    let place = met.iter().position(|one| one.element == element && one.is_before == is_before);
                    let place = place.unwrap_or_else(|| {
                        met.push(Met { element, is_before, matrix: DMatrix::zeros(rows, rows) });
                        met.len() - 1
                    });
                    &mut met[place].matrix
                };
                for (j, weight) in weights.iter().enumerate().filter(|(_, weight)| weight.abs() > 0.0) {
                    add_block(target, i, j, d, &stiffness, -weight);
                }
            }
            if self.cut.milling.rubbing.is_some() {
                let speed_mm_per_s = self.cut.rotation.rad_per_s(time) * self.cut.milling.radius_mm;
                add_block(&mut rubbing, i, i, d, &self.reduced(&instant.rubbing), 1.0 / speed_mm_per_s);
            }
        }
        let is_still = |values: &[f64]| values.iter().all(|value| value.abs() <= 0.0);
        if met.is_empty() && is_still(present.as_slice()) && is_still(rubbing.as_slice()) && is_still(&chips) {
            return Assembled::Nothing;
        }
        let mut system = DMatrix::identity(rows, rows) - &present * &passage.by_force;
        let mut by_state = &present * &passage.by_state;
        if let Some((state, force)) = &passage.velocity {
            system -= &rubbing * force;
            by_state += &rubbing * state;
        }
        let Some(inverse) = system.try_inverse() else { return Assembled::Singular };
        for one in &mut met {
            one.matrix = &inverse * &one.matrix;
        }
        let driving = is_driven.then(|| (&inverse * DVector::from_vec(chips)).as_slice().to_vec());
        Assembled::Cut(Forces { by_state: inverse * by_state, met, driving })
    }

    /// D in the directions of the motion.
    fn reduced(&self, tensor: &Tensor) -> Vec<f64> {
        let basis = &self.cut.structure.basis;
        basis.iter().flat_map(|a| basis.iter().map(|b| dot(a, &tensor.map(|row| dot(&row, b))))).collect()
    }

    /// Where the motion of so much rotation ago stands: element, whether in the period before, weights of its points.
    fn met_at(&self, time_s: f64, turned_rad: f64, point: usize) -> (usize, bool, [f64; P]) {
        let period = self.times[self.times.len() - 1];
        let rotation = &self.cut.rotation;
        let ago = if rotation.varies() {
            time_s - rotation.time_s(rotation.rotation_rad(time_s) - turned_rad)
        } else {
            rotation.time_s(turned_rad)
        };
        let own = |weights: &mut [f64; P]| weights[point] = 1.0;
        let mut weights = [0.0; P];
        if (ago - period).abs() <= 1e-12 * period {
            own(&mut weights);
            return (self.index, true, weights);
        }
        let at = time_s - ago;
        let is_before = at < 0.0;
        let at = if is_before { at + period } else { at };
        let element = (self.times.partition_point(|t| *t <= at).max(1) - 1).min(self.times.len() - 2);
        let share = (at - self.times[element]) / (self.times[element + 1] - self.times[element]);
        (element, is_before, self.rule.weights_at(share))
    }
}

fn add_block(matrix: &mut DMatrix<f64>, i: usize, j: usize, d: usize, block: &[f64], factor: f64) {
    for a in 0..d {
        for b in 0..d {
            matrix[(i * d + a, j * d + b)] += factor * block[a * d + b];
        }
    }
}

/// y += A x, column by column.
fn add_product(y: &mut [f64], matrix: &DMatrix<f64>, x: &[f64]) {
    for (column, factor) in matrix.as_slice().chunks_exact(y.len()).zip(x) {
        for (sum, value) in y.iter_mut().zip(column) {
            *sum += value * factor;
        }
    }
}

/// y += A' x, column by column.
fn add_transposed(y: &mut [f64], matrix: &DMatrix<f64>, x: &[f64]) {
    for (sum, column) in y.iter_mut().zip(matrix.as_slice().chunks_exact(x.len())) {
        *sum += column.iter().zip(x).map(|(a, b)| a * b).sum::<f64>();
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::calculator::Unwatched;
    use crate::milling_stability::model::{About, Law, Mode, Side, Tooth};

    /// y' (M x) = (M' y)' x for any x and y, where delays meet this period and the one before.
    #[test]
    fn the_transposed_map_is_that() {
        let tooth = |pitch: f64| Tooth { pitch_rad: pitch, lag_rad_per_mm: 0.03, radial_mm: 0.0, axial_mm: 0.0 };
        let milling = Milling {
            radius_mm: 10.0,
            teeth: vec![tooth(1.9), tooth(2.3), tooth(std::f64::consts::TAU - 4.2)],
            edge_angle_rad: 1.3,
            entry_rad: 0.2,
            exit_rad: 1.4,
            feed_mm: 0.1,
            law: Law::Mechanistic { edge: [0.0; 3], cutting: [900.0, 400.0, 200.0] },
            depth_exponent: 0.0,
            rubbing: None,
            about: About::SmoothChips,
        };
        let mode = |direction, frequency_hz| Mode {
            side: Side::Tool,
            direction,
            frequency_hz,
            damping_ratio: 0.03,
            mass_kg: 0.4,
        };
        let structure = Structure::new(vec![mode([0.6, 0.8, 0.0], 500.0), mode([0.0, 0.6, 0.8], 820.0)]);
        let cut = Cut { milling: &milling, structure: &structure, rotation: Rotation::steady(4000.0), depth_mm: 3.0 };
        let rule: Rule<8> = Rule::new();
        let Ok(Some(map)) = Map::new(&cut, &rule, &Unwatched) else { unreachable!("the map is regular") };
        let vector =
            |seed: f64| -> Vec<f64> { (0..map.dimension()).map(|k| (seed * (k as f64 + 1.0)).sin()).collect() };
        let (x, y) = (vector(1.3), vector(0.7));
        let (mut moved, mut back) = (x.clone(), y.clone());
        map.apply(&mut moved);
        map.apply_transposed(&mut back);
        let dot = |a: &[f64], b: &[f64]| a.iter().zip(b).map(|(p, q)| p * q).sum::<f64>();
        let (one, other) = (dot(&y, &moved), dot(&back, &x));
        assert!((one - other).abs() < 1e-11 * one.abs().max(1.0), "{one} {other}");
    }
}
