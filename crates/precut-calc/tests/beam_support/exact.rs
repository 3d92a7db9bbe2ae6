//! An independent solution of the beam: one dense system for displacements and rotations at the nodes, bending moment
//! and shear of every element, and the reactions; exact for loads at nodes and uniform loads.
//!
//! Not the stiffness matrix of finite elements: its rounded entries alone, `12 EJ/h³` against `6 EJ/h²`, put a chucked
//! bar of four elements out of equilibrium by 1e-7. Here the coefficients of the unknowns are flexibilities and lengths.

use nalgebra::{DMatrix, DVector};
use precut_calc::num::beam::{Contact, Section, Segment, Side, State, Support};

/// Direction of the displacement.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) enum Plane {
    Radial,
    Tangential,
}

/// What acts on the shaft at the tool.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Acting {
    pub(crate) force: f64,
    pub(crate) couple: f64,
    pub(crate) weight: f64,
}

/// A constraint `displacement - compliance * (-multiplier) = gap`.
#[derive(Debug, Clone, Copy)]
struct Hold {
    support: usize,
    freedom: usize,
    compliance: f64,
    gap: f64,
}

/// The shaft with the tool at one place.
pub(crate) struct Exact {
    nodes: Vec<f64>,
    sections: Vec<Section>,
    holds: Vec<Hold>,
    /// One-sided rests that can act.
    rests: Vec<Hold>,
}

/// One state of equilibrium.
pub(crate) struct Equilibrium {
    displacements: DVector<f64>,
    /// By support: force of the shaft on it.
    pub(crate) forces: Vec<f64>,
    /// By support: couple of the shaft on it.
    pub(crate) couples: Vec<f64>,
    /// Largest bending moment at a node, without weight.
    pub(crate) peak_moment: f64,
}

fn springs(support: &Support) -> (f64, f64) {
    match support {
        Support::Centre { springs, .. }
        | Support::Chuck { springs, .. }
        | Support::SteadyRest { springs, .. }
        | Support::FollowRest { springs, .. } => (springs.radial_mm_per_n, springs.tangential_mm_per_n),
    }
}

fn gap(support: &Support) -> Option<f64> {
    match support {
        Support::SteadyRest { contact: Contact::OneSided { gap_mm }, .. }
        | Support::FollowRest { contact: Contact::OneSided { gap_mm }, .. } => Some(*gap_mm),
        _ => None,
    }
}

fn place(support: &Support, tool: f64, length: f64) -> Option<f64> {
    match support {
        Support::Centre { z_mm, .. } | Support::Chuck { z_mm, .. } | Support::SteadyRest { z_mm, .. } => Some(*z_mm),
        Support::FollowRest { offset_mm, .. } => Some(tool + offset_mm).filter(|z| (0.0..=length).contains(z)),
    }
}

impl Exact {
    /// `extra` are places where displacements are wanted besides the tool.
    pub(crate) fn new(
        segments: &[Segment],
        supports: &[Support],
        state: State,
        plane: Plane,
        tool: f64,
        extra: &[f64],
    ) -> Self {
        let length: f64 = segments.iter().map(|segment| segment.length_mm).sum();
        let mut nodes = vec![0.0, tool];
        nodes.extend_from_slice(extra);
        let mut ends = Vec::new();
        for segment in segments {
            ends.push(ends.last().copied().unwrap_or(0.0) + segment.length_mm);
        }
        nodes.extend_from_slice(&ends);
        nodes.extend(supports.iter().filter_map(|support| place(support, tool, length)));
        nodes.sort_by(f64::total_cmp);
        nodes.dedup();
        let mut sections = Vec::new();
        for pair in nodes.windows(2) {
            let middle = 0.5 * (pair[0] + pair[1]);
            let segment = &segments[ends.iter().position(|end| middle < *end).unwrap()];
            let stock = match state {
                State::Finished => false,
                State::Stock => true,
                State::Mixed { stock_side: Side::Left } => middle < tool,
                State::Mixed { stock_side: Side::Right } => middle > tool,
            };
            sections.push(if stock { segment.stock } else { segment.finished });
        }
        let mut found = Self { nodes, sections, holds: Vec::new(), rests: Vec::new() };
        for (support, given) in supports.iter().enumerate() {
            let Some(z) = place(given, tool, length) else { continue };
            let (radial, tangential) = springs(given);
            let freedom = 2 * found.node(z);
            let compliance = if plane == Plane::Radial { radial } else { tangential };
            let hold = Hold { support, freedom, compliance, gap: 0.0 };
            match gap(given) {
                Some(gap) if plane == Plane::Radial => found.rests.push(Hold { gap, ..hold }),
                _ => found.hold(hold),
            }
            if let Support::Chuck { rotational_rad_per_n_mm, .. } = given {
                found.hold(Hold { freedom: freedom + 1, compliance: *rotational_rad_per_n_mm, ..hold });
            }
        }
        // A rest on a rigid support cannot act, whatever its own compliance.
        let holds = found.holds.clone();
        found.rests.retain(|rest| !holds.iter().any(|hold| hold.freedom == rest.freedom && hold.compliance <= 0.0));
        found
    }

    /// Of two rigid constraints of one freedom the second one does nothing.
    fn hold(&mut self, hold: Hold) {
        let same = |other: &Hold| other.freedom == hold.freedom;
        if hold.compliance <= 0.0 && self.holds.iter().any(|other| same(other) && other.compliance <= 0.0) {
            return;
        }
        if hold.compliance <= 0.0 {
            // The rigid one carries all.
            self.holds.retain(|other| !same(other));
        } else if self.holds.iter().any(|other| same(other) && other.compliance <= 0.0) {
            return;
        }
        self.holds.push(hold);
    }

    /// Sets supports off, in the order in which they were given: `displacement - compliance * force = gap + offset`.
    pub(crate) fn displace(&mut self, offsets: &[f64]) {
        for hold in self.holds.iter_mut().chain(&mut self.rests).filter(|hold| hold.freedom.is_multiple_of(2)) {
            hold.gap += offsets[hold.support];
        }
    }

    pub(crate) fn node(&self, z: f64) -> usize {
        self.nodes.iter().position(|node| (node - z).abs() <= 0.0).unwrap()
    }

    /// With some of the one-sided rests closed.
    fn solve(&self, tool: f64, acting: Acting, closed: u32, supports: usize) -> Option<Equilibrium> {
        let mut holds = self.holds.clone();
        holds.extend(self.rests.iter().enumerate().filter(|(i, _)| closed & (1 << i) != 0).map(|(_, rest)| *rest));
        let (nodes, elements) = (self.nodes.len(), self.sections.len());
        let unknowns = 2 * nodes + 2 * elements + holds.len();
        let mut system = System { matrix: DMatrix::zeros(unknowns, unknowns), right: DVector::zeros(unknowns) };
        // Units in which the unknowns are of order one: length, and displacement per force.
        let length = self.nodes[nodes - 1];
        let soft = self.sections.iter().fold(0.0_f64, |f, section| f.max(section.bending_flexibility_per_n_mm2));
        let give = soft * length.powi(3);
        for (e, section) in self.sections.iter().enumerate() {
            let h = (self.nodes[e + 1] - self.nodes[e]) / length;
            let f = section.bending_flexibility_per_n_mm2 / soft;
            let s = section.shear_flexibility_per_n * length / give;
            let q = acting.weight * section.weight_n_per_mm * length;
            let (moment, shear) = (2 * nodes + 2 * e, 2 * nodes + 2 * e + 1);
            let (start, end) = (2 * e, 2 * e + 2);
            // v' = rotation + s V, rotation' = -f M, M' = V, V' = -q.
            let row = 2 * e;
            system.set(row, &[(end, 1.0), (start, -1.0), (start + 1, -h), (moment, f * h * h / 2.0)]);
            system.set(row, &[(shear, f * h * h * h / 6.0 - s * h)]);
            system.right[row] = f * q * h.powi(4) / 24.0 - s * q * h * h / 2.0;
            system.set(row + 1, &[(end + 1, 1.0), (start + 1, -1.0), (moment, f * h), (shear, f * h * h / 2.0)]);
            system.right[row + 1] = f * q * h.powi(3) / 6.0;
            // Equilibrium of the nodes: what the element gives to the one before it and to the one behind it.
            let (before, behind) = (2 * elements + 2 * e, 2 * elements + 2 * e + 2);
            system.set(before, &[(shear, 1.0)]);
            system.set(before + 1, &[(moment, 1.0)]);
            system.set(behind, &[(shear, -1.0)]);
            system.right[behind] -= q * h;
            system.set(behind + 1, &[(moment, -1.0), (shear, -h)]);
            system.right[behind + 1] -= q * h * h / 2.0;
        }
        let tool = 2 * elements + 2 * self.node(tool);
        system.right[tool] -= acting.force;
        system.right[tool + 1] += acting.couple / length;
        for (i, hold) in holds.iter().enumerate() {
            let (row, turns) = (2 * elements + 2 * nodes + i, hold.freedom % 2 == 1);
            let (unit, sign) = if turns { (give / length / length, 1.0) } else { (give, -1.0) };
            system.set(2 * elements + hold.freedom, &[(row, sign)]);
            system.set(row, &[(hold.freedom, 1.0), (row, -hold.compliance / unit)]);
            system.right[row] = hold.gap / give;
        }
        let solution = system.solve()?;
        let (mut forces, mut couples) = (vec![0.0; supports], vec![0.0; supports]);
        for (i, hold) in holds.iter().enumerate() {
            let reaction = solution[2 * elements + 2 * nodes + i];
            if hold.freedom % 2 == 0 {
                forces[hold.support] += reaction;
            } else {
                couples[hold.support] += reaction * length;
            }
        }
        let peak_moment = (0..elements).fold(0.0_f64, |peak, e| {
            let (start, shear) = (solution[2 * nodes + 2 * e] * length, solution[2 * nodes + 2 * e + 1]);
            peak.max(start.abs()).max((start + shear * (self.nodes[e + 1] - self.nodes[e])).abs())
        });
        Some(Equilibrium { displacements: solution.rows(0, 2 * nodes) * give, forces, couples, peak_moment })
    }

    /// All one-sided rests open.
    pub(crate) fn open(&self, tool: f64, acting: Acting, supports: usize) -> Equilibrium {
        self.solve(tool, acting, 0, supports).unwrap()
    }

    /// Displacement at a node.
    pub(crate) fn displacement(&self, equilibrium: &Equilibrium, z: f64) -> f64 {
        equilibrium.displacements[2 * self.node(z)]
    }

    /// The subset of one-sided rests that meets all conditions, by trying every one: bit mask over the rests that can
    /// act, and the state. The margin tells how clearly the conditions are met, relative to forces and displacements.
    pub(crate) fn in_contact(&self, tool: f64, acting: Acting, supports: usize) -> (Equilibrium, f64) {
        let mut best: Option<(Equilibrium, f64)> = None;
        for closed in 0..1_u32 << self.rests.len() {
            let members = |i: usize| closed & (1 << i) != 0;
            let rigid_twice = (0..self.rests.len()).any(|i| {
                (0..i).any(|j| {
                    members(i)
                        && members(j)
                        && self.rests[i].freedom == self.rests[j].freedom
                        && self.rests[i].compliance + self.rests[j].compliance <= 0.0
                })
            });
            if rigid_twice {
                continue;
            }
            let Some(state) = self.solve(tool, acting, closed, supports) else { continue };
            let force = state.forces.iter().fold(0.0_f64, |largest, force| largest.max(force.abs()));
            let moved = state.displacements.iter().step_by(2).fold(0.0_f64, |largest, v| largest.max(v.abs()));
            let margin = self.rests.iter().enumerate().fold(f64::INFINITY, |margin, (i, rest)| {
                margin.min(if members(i) {
                    state.forces[rest.support] / force.max(1e-30)
                } else {
                    (rest.gap - state.displacements[rest.freedom]) / moved.max(1e-30)
                })
            });
            if best.as_ref().is_none_or(|(_, found)| margin > *found) {
                best = Some((state, margin));
            }
        }
        best.unwrap()
    }
}

/// A dense linear system.
struct System {
    matrix: DMatrix<f64>,
    right: DVector<f64>,
}

impl System {
    fn set(&mut self, row: usize, entries: &[(usize, f64)]) {
        for &(column, value) in entries {
            self.matrix[(row, column)] += value;
        }
    }

    fn solve(self) -> Option<DVector<f64>> {
        let factor = self.matrix.clone().full_piv_lu();
        let mut solution = factor.solve(&self.right)?;
        for _ in 0..2 {
            solution += factor.solve(&(&self.right - &self.matrix * &solution))?;
        }
        Some(solution)
    }
}
