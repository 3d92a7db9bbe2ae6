//! Workpiece and vise as masses, springs and dampers.
//!
//! Type 1 (self-locking): both jaws are springs to ground, preloaded by the clamp force. Type 2 (constant clamp
//! force): the movable jaw is a second mass that the force presses on the workpiece. x and x3 count from the clamped
//! equilibrium, positive toward the movable jaw. "Left" is the joint at the movable jaw, "right" that at the fixed one.

use nalgebra::DMatrix;

use crate::num::dde::Matrix;

/// m x'' in kg mm/s2 over the force in N.
pub(in crate::fixture_stability) const MM_PER_S2: f64 = 1000.0;

/// A joint between workpiece and jaw.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::fixture_stability) struct Joint {
    pub stiffness_n_per_mm: f64,
    pub damping_n_s_per_mm: f64,
}

/// The movable jaw of a vise with constant clamp force.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::fixture_stability) struct Jaw {
    pub mass_kg: f64,
    /// Friction of its piston, to ground.
    pub damping_n_s_per_mm: f64,
}

/// A mass hung on the workpiece by a spring and a damper.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::fixture_stability) struct Hung {
    pub mass_kg: f64,
    pub joint: Joint,
}

/// Workpiece and vise.
#[derive(Debug, Clone, PartialEq)]
pub(in crate::fixture_stability) struct Holding {
    pub mass_kg: f64,
    /// At the movable jaw.
    pub left: Joint,
    /// At the fixed jaw.
    pub right: Joint,
    /// Type 2 where there is one.
    pub jaw: Option<Jaw>,
    pub hung: Option<Hung>,
    /// c of the stiffness C (1 + c x^2), 1/mm2.
    pub hardening_per_mm2: f64,
    pub clamp_force_n: Option<f64>,
}

/// Which joints carry.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::fixture_stability) struct Closed {
    pub left: bool,
    pub right: bool,
}

impl Closed {
    pub(in crate::fixture_stability) const BOTH: Self = Self { left: true, right: true };
}

/// q' = A q + b F, q = (x, x'/w, x3, x3'/w3, ...): velocities over a frequency of their own mass, so that norms mean something.
#[derive(Debug, Clone)]
pub(in crate::fixture_stability) struct System<const N: usize> {
    pub a: Matrix<N>,
    pub b: [f64; N],
    /// rad/s by which the velocities are divided, per mass.
    pub scale: [f64; N],
    /// Index of the jaw's displacement in q.
    pub jaw: Option<usize>,
    /// Largest modulus of the eigenvalues of A, rad/s.
    pub radius_rad_per_s: f64,
    /// Per mass: a force of 1 N on it, as it enters q'.
    pub push: [f64; N],
}

/// A mode of the closed vise without cutting.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::fixture_stability) struct Mode {
    /// Modulus of the eigenvalue over 2 pi.
    pub natural_hz: f64,
    /// Imaginary part over 2 pi.
    pub damped_hz: f64,
    pub damping_ratio: f64,
}

impl Holding {
    /// Length of the state.
    pub(in crate::fixture_stability) fn states(&self) -> usize {
        2 * (1 + usize::from(self.jaw.is_some()) + usize::from(self.hung.is_some()))
    }

    /// C1 + C2, or C2 alone where the jaw follows at constant force (`fixture/4.3`).
    pub(in crate::fixture_stability) fn static_stiffness_n_per_mm(&self) -> f64 {
        let right = self.right.stiffness_n_per_mm;
        if self.jaw.is_some() { right } else { self.left.stiffness_n_per_mm + right }
    }

    /// Stiffness that grows with the displacement of the workpiece: of every joint that is compressed by x alone.
    pub(in crate::fixture_stability) fn hardening_n_per_mm3(&self, closed: Closed) -> f64 {
        let of = |carries: bool, joint: Joint| if carries { joint.stiffness_n_per_mm } else { 0.0 };
        let left = if self.jaw.is_some() { 0.0 } else { of(closed.left, self.left) };
        self.hardening_per_mm2 * (left + of(closed.right, self.right))
    }

    fn masses_kg(&self) -> Vec<f64> {
        let mut masses = vec![self.mass_kg];
        masses.extend(self.jaw.map(|jaw| jaw.mass_kg));
        masses.extend(self.hung.map(|hung| hung.mass_kg));
        masses
    }

    /// Stiffness and damping between masses; `None` is the ground.
    fn links(&self, closed: Closed) -> Vec<(usize, Option<usize>, Joint)> {
        let mut links = Vec::new();
        let jaw = self.jaw.map(|_| 1);
        if closed.left {
            links.push((0, jaw, self.left));
        }
        if closed.right {
            links.push((0, None, self.right));
        }
        if let Some(jaw) = self.jaw {
            links.push((1, None, Joint { stiffness_n_per_mm: 0.0, damping_n_s_per_mm: jaw.damping_n_s_per_mm }));
        }
        if let Some(hung) = self.hung {
            links.push((0, Some(self.masses_kg().len() - 1), hung.joint));
        }
        links
    }

    /// The linear system with the joints that carry. `N` is [`Self::states`].
    pub(in crate::fixture_stability) fn system<const N: usize>(&self, closed: Closed) -> System<N> {
        let masses = self.masses_kg();
        let matrices = |closed: Closed| {
            let n = masses.len();
            let (mut k, mut l) = (vec![vec![0.0; n]; n], vec![vec![0.0; n]; n]);
            for (i, other, joint) in self.links(closed) {
                for (matrix, value) in [(&mut k, joint.stiffness_n_per_mm), (&mut l, joint.damping_n_s_per_mm)] {
                    matrix[i][i] += value;
                    if let Some(j) = other {
                        matrix[j][j] += value;
                        matrix[i][j] -= value;
                        matrix[j][i] -= value;
                    }
                }
            }
            (k, l)
        };
        let (stiffness, damping) = matrices(closed);
        // The scale is that of the closed vise, whatever is open: the state keeps its meaning.
        let (held, _) = matrices(Closed::BOTH);
        let rate: Vec<f64> = masses.iter().enumerate().map(|(i, m)| (MM_PER_S2 * held[i][i] / m).sqrt()).collect();
        let (mut a, mut b, mut scale, mut push) = ([[0.0; N]; N], [0.0; N], [1.0; N], [0.0; N]);
        for (i, &mass) in masses.iter().enumerate() {
            a[2 * i][2 * i + 1] = rate[i];
            scale[2 * i + 1] = rate[i];
            push[2 * i + 1] = MM_PER_S2 / (mass * rate[i]);
            for j in 0..masses.len() {
                a[2 * i + 1][2 * j] = -MM_PER_S2 * stiffness[i][j] / (mass * rate[i]);
                a[2 * i + 1][2 * j + 1] = -MM_PER_S2 * damping[i][j] * rate[j] / (mass * rate[i]);
            }
        }
        b[1] = push[1];
        let radius_rad_per_s = eigenvalues(&a).into_iter().map(|(re, im)| f64::hypot(re, im)).fold(0.0, f64::max);
        System { a, b, scale, jaw: self.jaw.map(|_| 2), radius_rad_per_s, push }
    }

    /// Natural frequencies and damping of the closed vise, rising (`fixture/4.4`).
    pub(in crate::fixture_stability) fn modes(&self) -> Vec<Mode> {
        match self.states() {
            2 => modes(&self.system::<2>(Closed::BOTH)),
            4 => modes(&self.system::<4>(Closed::BOTH)),
            _ => modes(&self.system::<6>(Closed::BOTH)),
        }
    }

    /// x of the workpiece by a force of 1 N at the angular frequency: the receptance G, mm/N, real and imaginary part (`fixture/5.4`).
    pub(in crate::fixture_stability) fn receptance(&self, rad_per_s: f64) -> (f64, f64) {
        let dynamic = |joint: Joint| Complex { re: joint.stiffness_n_per_mm, im: rad_per_s * joint.damping_n_s_per_mm };
        let inertia = |mass: f64| Complex { re: -mass * rad_per_s * rad_per_s / MM_PER_S2, im: 0.0 };
        // A mass behind a spring acts as both in series.
        let series = |spring: Complex, end: Complex| spring.times(end).over(spring.plus(end));
        let left = match self.jaw {
            None => dynamic(self.left),
            Some(jaw) => {
                let piston = Complex { re: 0.0, im: rad_per_s * jaw.damping_n_s_per_mm };
                series(dynamic(self.left), inertia(jaw.mass_kg).plus(piston))
            }
        };
        let mut total = inertia(self.mass_kg).plus(left).plus(dynamic(self.right));
        if let Some(hung) = self.hung {
            total = total.plus(series(dynamic(hung.joint), inertia(hung.mass_kg)));
        }
        let g = Complex { re: 1.0, im: 0.0 }.over(total);
        (g.re, g.im)
    }
}

/// A complex number, as far as receptances need it.
#[derive(Clone, Copy)]
struct Complex {
    re: f64,
    im: f64,
}

impl Complex {
    fn plus(self, other: Self) -> Self {
        Self { re: self.re + other.re, im: self.im + other.im }
    }
    fn times(self, other: Self) -> Self {
        Self { re: self.re * other.re - self.im * other.im, im: self.re * other.im + self.im * other.re }
    }
    fn over(self, other: Self) -> Self {
        let square = other.re * other.re + other.im * other.im;
        let by = self.times(Self { re: other.re, im: -other.im });
        Self { re: by.re / square, im: by.im / square }
    }
}

pub(in crate::fixture_stability) fn eigenvalues<const N: usize>(a: &Matrix<N>) -> Vec<(f64, f64)> {
    let matrix = DMatrix::from_fn(N, N, |i, j| a[i][j]);
    matrix.complex_eigenvalues().iter().map(|value| (value.re, value.im)).collect()
}

fn modes<const N: usize>(system: &System<N>) -> Vec<Mode> {
    let tau = std::f64::consts::TAU;
    let mut modes = Vec::new();
    let mut values = eigenvalues(&system.a);
    values.sort_by(|p, q| f64::hypot(p.0, p.1).total_cmp(&f64::hypot(q.0, q.1)));
    for (re, im) in values {
        // Of a pair the upper one; an overdamped mode is two real eigenvalues, each with damping ratio 1.
        if im >= 0.0 {
            let modulus = f64::hypot(re, im);
            let ratio = if modulus > 0.0 { -re / modulus } else { 0.0 };
            modes.push(Mode { natural_hz: modulus / tau, damped_hz: im / tau, damping_ratio: ratio });
        }
    }
    modes
}

impl<const N: usize> System<N> {
    /// x', mm/s.
    #[inline]
    pub(in crate::fixture_stability) fn velocity(&self, q: &[f64; N], mass: usize) -> f64 {
        q[2 * mass + 1] * self.scale[2 * mass + 1]
    }
}
