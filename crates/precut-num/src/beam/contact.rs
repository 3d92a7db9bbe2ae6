//! One-sided rests: which of them touch, found anew for every load (`deflection/3.3` item 3).

/// The most one-sided rests a shaft may have.
pub const MAX_ONE_SIDED_RESTS: usize = 16;

/// Share of a rest's own base compliance added to it: keeps the matrix positive definite when two rigid rests meet.
pub(super) const REGULARISATION: f64 = 16.0 * f64::EPSILON;

/// A violation below this share of its terms is rounding.
const TOLERANCE: f64 = 1e-14;

/// The one-sided rests of a shaft at every station, all other redundants eliminated.
#[derive(Debug, Clone, Default)]
pub struct Contacts {
    pub(super) supports: Vec<usize>,
    pub(super) gaps_mm: Vec<f64>,
    /// Per station with all rests open.
    pub(super) compliance: Vec<f64>,
    pub(super) coupling: Vec<f64>,
    pub(super) sag: Vec<f64>,
    /// Station by station, rest by rest: displacement of the rest by a unit force, a unit couple at the tool.
    pub(super) influence: Vec<f64>,
    pub(super) couple_influence: Vec<f64>,
    /// Displacement of the rests by each other and by the full weight; one for all stations or one for each.
    pub(super) matrix: Vec<f64>,
    pub(super) rest_sag: Vec<f64>,
    /// Displacement of the work at the rests, away from them, by supports that are set off; likewise, or empty.
    pub(super) displaced: Vec<f64>,
}

/// The state of the shaft under a complete load.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Response {
    /// Displacement of the work at the tool, mm: force, couple, weight and rests.
    pub displacement_mm: f64,
    /// Its derivative with respect to the force, mm/N, in the set of rests that touch.
    pub compliance_mm_per_n: f64,
    /// Its derivative with respect to the couple, 1/N, in the same set.
    pub coupling_per_n: f64,
    /// Bit `i` is set when the rest `i` of [`Contacts::supports`] touches.
    pub closed: u32,
    forces_n: [f64; MAX_ONE_SIDED_RESTS],
}

impl Response {
    /// The force with which a rest pushes the work back toward the tool, N, >= 0; 0 where it is open.
    pub fn force_n(&self, rest: usize) -> f64 {
        self.forces_n.get(rest).copied().unwrap_or(0.0)
    }
}

/// A load on the shaft at the tool.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct ToolLoad {
    /// Force in `u`, N, positive away from the tool.
    pub force_n: f64,
    /// Couple conjugate to the rotation of the section, N mm.
    pub couple_n_mm: f64,
    /// Share of the weight that acts in `u`: the cosine of gravity's angle; 0 leaves the weight out.
    pub gravity_radial: f64,
}

const ZEROS: Rests = [0.0; MAX_ONE_SIDED_RESTS];

/// Vector over the rests.
type Rests = [f64; MAX_ONE_SIDED_RESTS];

impl Contacts {
    /// The supports that act on one side, as indices in the list given to the beam.
    pub fn supports(&self) -> &[usize] {
        &self.supports
    }

    /// Puts the rests where supports that are set off leave them: [`super::Displaced::rests_mm`].
    ///
    /// Only what touches changes: [`Self::respond`] gives the displacement less [`super::Displaced::work_mm`].
    pub fn displace(&mut self, rests_mm: Vec<f64>) {
        self.displaced = rests_mm;
    }

    /// Puts all rests farther away by so much; nearer, they may touch without a load.
    pub fn widen_gaps(&mut self, by_mm: f64) {
        self.gaps_mm.iter_mut().for_each(|gap| *gap += by_mm);
    }

    /// Whether supports are set off, so that rests may touch without a load.
    pub fn are_displaced(&self) -> bool {
        !self.displaced.is_empty()
    }

    /// The complete answer to a load with the tool at a station.
    ///
    /// `Y = W P + G M + sag - sum h_k r_k` with the rests' forces `r >= 0` from the linear complementarity problem
    /// `s = (H + C) r - (d - gap) >= 0`, `r s = 0`; `d` is the displacement of the rests by the load and by supports
    /// that are set off. `H + C` is positive definite, so the solution is unique, and Murty's least-index pivoting
    /// finds it in finitely many steps. K. G. Murty, Opsearch 11 (1974) 113-135. A station that does not exist answers
    /// zero.
    pub fn respond(&self, station: usize, load: ToolLoad) -> Response {
        let count = self.supports.len();
        let at = |values: &[f64]| values.get(station).copied().unwrap_or(0.0);
        let (compliance, coupling) = (at(&self.compliance), at(&self.coupling));
        let mut response = Response {
            displacement_mm: compliance * load.force_n
                + coupling * load.couple_n_mm
                + at(&self.sag) * load.gravity_radial,
            compliance_mm_per_n: compliance,
            coupling_per_n: coupling,
            closed: 0,
            forces_n: [0.0; MAX_ONE_SIDED_RESTS],
        };
        if count == 0 || station >= self.compliance.len() {
            return response;
        }
        let influence = entries(&self.influence, station, count);
        let turned = entries(&self.couple_influence, station, count);
        let sag = entries(&self.rest_sag, station, count);
        let displaced = entries(&self.displaced, station, count);
        let matrix = entries(&self.matrix, station, count * count);
        let (mut excess, mut scale) = (ZEROS, ZEROS);
        for rest in 0..count {
            let parts = [
                influence[rest] * load.force_n,
                turned[rest] * load.couple_n_mm,
                sag[rest] * load.gravity_radial,
                displaced[rest],
                -self.gaps_mm[rest],
            ];
            excess[rest] = parts.iter().sum();
            scale[rest] = parts.iter().map(|part| part.abs()).sum();
        }
        if count == 1 {
            let force_n = excess[0] / matrix[0];
            if excess[0] > TOLERANCE * scale[0] {
                let per_force = influence[0] / matrix[0];
                response.displacement_mm -= influence[0] * force_n;
                response.compliance_mm_per_n -= influence[0] * per_force;
                response.coupling_per_n -= turned[0] * per_force;
                response.closed = 1;
                response.forces_n[0] = force_n;
            }
            return response;
        }
        let problem = Problem { count, matrix };
        let (closed, forces) = problem.solve(&excess, &scale);
        response.closed = closed;
        response.forces_n = forces;
        if closed == 0 {
            return response;
        }
        let mut stiffened = Rests::default();
        stiffened[..count].copy_from_slice(influence);
        let per_force = problem.restricted(closed, &stiffened);
        for rest in 0..count {
            response.displacement_mm -= influence[rest] * forces[rest];
            response.compliance_mm_per_n -= influence[rest] * per_force[rest];
            response.coupling_per_n -= turned[rest] * per_force[rest];
        }
        response
    }
}

/// The entries of a station: of its own, those common to all, or zeros where nothing is kept.
fn entries(values: &[f64], station: usize, count: usize) -> &[f64] {
    if values.is_empty() {
        &ZEROS[..count]
    } else if values.len() == count {
        values
    } else {
        &values[station * count..(station + 1) * count]
    }
}

/// `(H + C) r = b` with sign conditions.
struct Problem<'a> {
    count: usize,
    matrix: &'a [f64],
}

impl Problem<'_> {
    /// The set that touches and its forces.
    fn solve(&self, excess: &Rests, scale: &Rests) -> (u32, Rests) {
        let mut closed = 0_u32;
        let mut forces = Rests::default();
        // Murty's method visits a set at most once; the bound only guards against rounding.
        for _ in 0..(1_u32 << self.count) {
            let Some(rest) = self.violated(closed, &forces, excess, scale) else { break };
            closed ^= 1 << rest;
            forces = self.restricted(closed, excess);
        }
        (closed, forces)
    }

    /// The first rest that pulls while closed or is pierced while open.
    fn violated(&self, closed: u32, forces: &Rests, excess: &Rests, scale: &Rests) -> Option<usize> {
        (0..self.count).find(|&rest| {
            if closed & (1 << rest) != 0 {
                return forces[rest] < 0.0;
            }
            let row = &self.matrix[rest * self.count..(rest + 1) * self.count];
            let (mut slack, mut size) = (-excess[rest], scale[rest]);
            for (entry, force) in row.iter().zip(forces) {
                slack += entry * force;
                size += (entry * force).abs();
            }
            slack < -TOLERANCE * size
        })
    }

    /// Solves for the rests of a set, the others at zero: Cholesky's decomposition in place.
    fn restricted(&self, closed: u32, right: &Rests) -> Rests {
        let mut members = [0_usize; MAX_ONE_SIDED_RESTS];
        let mut size = 0;
        for rest in (0..self.count).filter(|rest| closed & (1 << rest) != 0) {
            members[size] = rest;
            size += 1;
        }
        let members = &members[..size];
        let mut factor = [[0.0; MAX_ONE_SIDED_RESTS]; MAX_ONE_SIDED_RESTS];
        let mut solution = Rests::default();
        let mut partial = Rests::default();
        for (i, &row) in members.iter().enumerate() {
            let mut rest = right[row];
            for j in 0..=i {
                let mut entry = self.matrix[row * self.count + members[j]];
                for (a, b) in factor[i][..j].iter().zip(&factor[j][..j]) {
                    entry -= a * b;
                }
                if i != j {
                    factor[i][j] = entry * factor[j][j];
                    rest -= factor[i][j] * partial[j];
                } else if entry > 0.0 {
                    factor[i][i] = 1.0 / entry.sqrt();
                }
            }
            partial[i] = rest * factor[i][i];
        }
        for i in (0..size).rev() {
            let mut rest = partial[i];
            for later in i + 1..size {
                rest -= factor[later][i] * solution[members[later]];
            }
            solution[members[i]] = rest * factor[i][i];
        }
        solution
    }
}
