//! Linear theory of lobing: which waves of the surface grow, stay or decay (`ring/5.2`).
//!
//! Small deviations ρ(t) of the surface cut at the rotation t obey
//!
//! ```text
//! (1+K) ρ(t) = d(t) + a ρ(t-τ_A) + b ρ(t-τ_B) + K ρ(t-2π)                    (ring/5.2)
//! ```
//!
//! so ρ ~ exp(λt) with λ = σ + iω needs 1 + K - a exp(-λτ_A) - b exp(-λτ_B) - K exp(-2πλ) = 0: ω lobes per revolution,
//! factor exp(2πσ) per revolution. A machine that swings gives by the frequency of the force (`ring/5.6`):
//!
//! ```text
//! K(λ) = K_0 + Σ K_i / P_i(λ),   P_i = 1 + 2 ζ_i λ/ν_i + (λ/ν_i)²            (ring/5.6)
//! ```

use std::f64::consts::TAU;

use nalgebra::Complex;

use crate::ring_roundness::model::stance::Copying;

/// A root of the characteristic equation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Root {
    /// ω, lobes per revolution; not always whole.
    pub lobes: f64,
    /// σ, 1/rad.
    pub growth_per_rad: f64,
}

impl Root {
    /// Factor on the amplitude per revolution.
    pub(crate) fn factor_per_revolution(&self) -> f64 {
        (TAU * self.growth_per_rad).exp()
    }
}

/// A mode of machine or tool at a work speed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Resonance {
    /// Thrust stiffness of the cut over the stiffness of the mode as the tool sees it, K_i.
    pub ratio: f64,
    /// Natural frequency over the work speed, ν_i.
    pub lobes: f64,
    /// Damping ratio ζ_i.
    pub damping_ratio: f64,
}

/// The characteristic equation of a setting.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Lobing {
    pub copying: Copying,
    /// Compliance ratio K at rest, that of the modes included.
    pub compliance_ratio: f64,
    pub resonances: Vec<Resonance>,
}

/// The characteristic function f at a place, with what Newton's method and the argument principle need. f has poles at the
/// natural frequencies of the modes; f·Π P_i has none.
struct Value {
    /// f.
    f: Complex<f64>,
    /// df/dλ.
    slope: Complex<f64>,
    /// Π P_i.
    poles: Complex<f64>,
    /// d ln Π P_i / dλ.
    poles_slope: Complex<f64>,
}

/// Slowest decay that is still looked for, 1/rad: below it a lobe is gone within one revolution (factor 0.0066).
pub(crate) const FASTEST_DECAY_PER_RAD: f64 = -0.8;
/// A step of Newton's method below this is the last: what it leaves is some times its square.
const ARRIVED: f64 = 1e-8;
/// Longest step.
const LONGEST_STEP: f64 = 0.5;
/// A root that grows no faster than the worst one found by more than this is not looked for, 1/rad.
const MISSED_PER_RAD: f64 = 1e-3;
/// Roots found last among which one that is found again is looked for.
const KNOWN_NEAR: usize = 60;
/// Roots nearer than this are one.
const SAME: f64 = 1e-7;

impl Lobing {
    /// Compliance ratio of what does not swing, K_0.
    fn still_ratio(&self) -> f64 {
        self.compliance_ratio - self.resonances.iter().map(|mode| mode.ratio).sum::<f64>()
    }

    fn value(&self, lambda: Complex<f64>) -> Value {
        let Copying { a, b, delay_a_rad, delay_b_rad } = self.copying;
        let delayed = |size: f64, delay: f64| {
            if size.abs() < 1e-300 { Complex::new(0.0, 0.0) } else { (-lambda * delay).exp() * size }
        };
        let one = Complex::new(1.0, 0.0);
        let (mut k, mut k_slope) = (Complex::new(self.still_ratio(), 0.0), Complex::new(0.0, 0.0));
        let (mut poles, mut poles_slope) = (one, k_slope);
        for mode in &self.resonances {
            let at = lambda / mode.lobes;
            let p = one + at * (2.0 * mode.damping_ratio) + at * at;
            let p_slope = (at * 2.0 + 2.0 * mode.damping_ratio) / mode.lobes;
            k += one / p * mode.ratio;
            k_slope -= p_slope / (p * p) * mode.ratio;
            poles *= p;
            poles_slope += p_slope / p;
        }
        let (at_a, at_b) = (delayed(a, delay_a_rad), delayed(b, delay_b_rad));
        let at_tool = if self.compliance_ratio > 0.0 { (-lambda * TAU).exp() } else { Complex::new(0.0, 0.0) };
        let value = one - at_a - at_b + k * (one - at_tool);
        let slope = at_a * delay_a_rad + at_b * delay_b_rad + k * at_tool * TAU + k_slope * (one - at_tool);
        Value { f: value, slope, poles, poles_slope }
    }

    fn newton(&self, mut lambda: Complex<f64>) -> Option<Complex<f64>> {
        for _ in 0..40 {
            let at = self.value(lambda);
            let step = at.f / (at.slope + at.f * at.poles_slope);
            if !step.is_finite() {
                return None;
            }
            let size2 = step.norm_sqr();
            if size2 > LONGEST_STEP * LONGEST_STEP {
                // Far from a root the exponentials send the step anywhere.
                lambda -= step * (LONGEST_STEP / size2.sqrt());
                continue;
            }
            lambda -= step;
            if size2 < ARRIVED * ARRIVED {
                return Some(lambda);
            }
        }
        None
    }

    /// Largest σ that any root can have: 1 + K_0 = |a| e^{-στ_A} + |b| e^{-στ_B} + K_0 e^{-2πσ} + Σ |K_i/P_i| (1 + e^{-2πσ}),
    /// where with the poles at -ζν ± iν√(1-ζ²) and ω ≥ 0 |P_i| ≥ (σ+ζν) √((σ+ζν)² + ν²(1-ζ²))/ν².
    fn largest_growth(&self) -> f64 {
        let Copying { a, b, delay_a_rad, delay_b_rad } = self.copying;
        let k = self.still_ratio();
        let swinging = |s: f64| -> f64 {
            let most = |mode: &Resonance| {
                let from_pole = s + mode.damping_ratio * mode.lobes;
                let damped2 = mode.lobes.powi(2) * (1.0 - mode.damping_ratio.powi(2)).max(0.0);
                mode.ratio * mode.lobes.powi(2) / (from_pole * (from_pole.powi(2) + damped2).sqrt())
            };
            self.resonances.iter().map(most).sum()
        };
        let excess = |s: f64| {
            let turn = (-s * TAU).exp();
            a.abs() * (-s * delay_a_rad).exp() + b.abs() * (-s * delay_b_rad).exp() + k * turn - 1.0 - k
                + swinging(s) * (1.0 + turn)
        };
        let (mut low, mut high) = (0.0, 1.0);
        while excess(high) > 0.0 && high < 1e3 {
            high *= 2.0;
        }
        for _ in 0..60 {
            let mid = 0.5 * (low + high);
            if excess(mid) > 0.0 {
                low = mid;
            } else {
                high = mid;
            }
        }
        high
    }

    /// A(k) = 1 - a exp(-ikτ_A) - b exp(-ikτ_B): the share of an error of k lobes that one pass of the tool finds; a
    /// lobe is invisible where it vanishes, and grows in a soft machine where its real part is negative (`ring/5.3`).
    pub(crate) fn visibility(&self, order: f64) -> (f64, f64) {
        let Copying { a, b, delay_a_rad, delay_b_rad } = self.copying;
        let (angle_a, angle_b) = (order * delay_a_rad, order * delay_b_rad);
        (1.0 - a * angle_a.cos() - b * angle_b.cos(), a * angle_a.sin() + b * angle_b.sin())
    }

    /// All roots with ω from `from` to `to` and σ above [`FASTEST_DECAY_PER_RAD`], by rising ω, and whether the argument
    /// principle finds as many in that rectangle. Roots to 1e-12.
    pub(crate) fn roots(&self, from: f64, to: f64) -> (Vec<Root>, bool) {
        let top = self.largest_growth() + 0.02;
        let inside = |z: &Complex<f64>| z.im > from && z.im < to && z.re > FASTEST_DECAY_PER_RAD && z.re < top;
        let expected = self.winding(from, to, FASTEST_DECAY_PER_RAD, top);
        let mut found: Vec<Complex<f64>> = Vec::new();
        for density in [1_u32, 3] {
            let columns = 9 * density;
            let rows = whole((to - from) * 8.0) * density;
            for row in 0..=rows {
                for column in 0..=columns {
                    let start = Complex::new(
                        FASTEST_DECAY_PER_RAD + (top - FASTEST_DECAY_PER_RAD) * f64::from(column) / f64::from(columns),
                        from + (to - from) * f64::from(row) / f64::from(rows),
                    );
                    let Some(root) = self.newton(start) else { continue };
                    if inside(&root) && found.iter().all(|other| (other - root).norm_sqr() > SAME * SAME) {
                        found.push(root);
                    }
                }
            }
            if expected.is_some_and(|count| count == found.len()) {
                break;
            }
        }
        found.sort_by(|p, q| p.im.total_cmp(&q.im).then(q.re.total_cmp(&p.re)));
        let complete = expected.is_some_and(|count| count == found.len());
        let roots = found.iter().map(|z| Root { lobes: z.im, growth_per_rad: z.re }).collect();
        (roots, complete)
    }

    /// Number of roots in a rectangle by the argument principle; `None` where its edge runs through one.
    fn winding(&self, from: f64, to: f64, left: f64, right: f64) -> Option<usize> {
        let corners =
            [Complex::new(left, from), Complex::new(right, from), Complex::new(right, to), Complex::new(left, to)];
        let mut turned = 0.0;
        for i in 0..4 {
            turned += self.argument_change(corners[i], corners[(i + 1) % 4])?;
        }
        let count = turned / TAU;
        ((count - count.round()).abs() < 1e-3).then(|| whole(count.round()) as usize)
    }

    /// Change of the argument along a straight line, in steps over which it turns little.
    fn argument_change(&self, start: Complex<f64>, end: Complex<f64>) -> Option<f64> {
        const PIECES: u32 = 4;
        let way = end - start;
        let (mut at, mut step, mut turned) = (0.0, 1.0 / (f64::from(PIECES) * way.norm().max(1.0)), 0.0);
        let whole = |lambda| {
            let at = self.value(lambda);
            at.f * at.poles
        };
        let mut value = whole(start);
        while at < 1.0 {
            let next = (at + step).min(1.0);
            let there = whole(start + way * next);
            let turn = (there / value).arg();
            if !turn.is_finite() || step < 1e-9 {
                return None;
            }
            if turn.abs() > 0.3 {
                step *= 0.5;
                continue;
            }
            turned += turn;
            (at, value) = (next, there);
            if turn.abs() < 0.1 {
                step *= 1.6;
            }
        }
        Some(turned)
    }

    /// The roots near neutral growth with ω in `from..to`, for maps, where the certificate of [`Self::roots`] would cost too
    /// much: Newton's method from three starts per lobe. The worst root is among them (tests compare).
    pub(crate) fn near_neutral(&self, from: f64, to: f64) -> Vec<Root> {
        self.roots_from(from, to, 3.0, &[0.0])
    }

    /// The same for a machine that swings, where more starts are needed near its natural frequencies: the argument principle
    /// says whether a root that grows faster than all that were found is missing.
    pub(crate) fn near_neutral_confirmed(&self, from: f64, to: f64) -> Vec<Root> {
        let found = self.near_neutral(from, to);
        let most = found.iter().map(|root| root.growth_per_rad).fold(FASTEST_DECAY_PER_RAD, f64::max);
        let top = self.largest_growth() + 0.02;
        if most + MISSED_PER_RAD >= top || self.winding(from, to, most + MISSED_PER_RAD, top) == Some(0) {
            return found;
        }
        self.roots_from(from, to, 9.0, &[0.0, 0.1, 0.25, 0.5, -0.1])
    }

    fn roots_from(&self, from: f64, to: f64, per_lobe: f64, growths: &[f64]) -> Vec<Root> {
        let mut found: Vec<Root> = Vec::new();
        let rows = whole((to - from) * per_lobe);
        let starts = (0..=rows).flat_map(|row| growths.iter().map(move |growth| (row, *growth)));
        for (row, growth) in starts {
            let lobes = from + (to - from) * f64::from(row) / f64::from(rows);
            let Some(root) = self.newton(Complex::new(growth, lobes)) else { continue };
            let known =
                |other: &Root| (other.lobes - root.im).powi(2) + (other.growth_per_rad - root.re).powi(2) < SAME * SAME;
            // Newton's method ends near where it started: what is known stands near the end.
            let near = found.iter().rev().take(KNOWN_NEAR).any(known);
            if root.im > from && root.im < to && root.re > FASTEST_DECAY_PER_RAD && !near {
                found.push(Root { lobes: root.im, growth_per_rad: root.re });
            }
        }
        found.sort_by(|p, q| p.lobes.total_cmp(&q.lobes).then(q.growth_per_rad.total_cmp(&p.growth_per_rad)));
        found.dedup_by(|p, q| (p.lobes - q.lobes).hypot(p.growth_per_rad - q.growth_per_rad) < SAME);
        found
    }
}

/// The root that decides about an order: of those nearer to it than half a lobe the one that decays slowest.
pub(crate) fn of_order(roots: &[Root], order: f64) -> Option<Root> {
    roots
        .iter()
        .filter(|root| (root.lobes - order).abs() <= 0.5)
        .copied()
        .max_by(|p, q| p.growth_per_rad.total_cmp(&q.growth_per_rad))
}

#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "counts of lobes, below 1e6")]
fn whole(x: f64) -> u32 {
    x.clamp(1.0, 1e6) as u32
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn no_small_change_of_the_angles_is_harmless_but_at_the_diameter() {
        // |a| + |b| >= 1, equal only opposite to a support.
        for beta in [20.0_f64, 42.0165, 60.0] {
            for tool in 0..=180_i32 {
                let copying = Copying::of_angles(beta.to_radians(), f64::from(tool).to_radians());
                assert!(copying.gain() > 1.0 - 1e-12);
            }
            assert!((Copying::of_angles(beta.to_radians(), (90.0 - beta).to_radians()).gain() - 1.0).abs() < 1e-12);
        }
    }

    #[test]
    fn the_quick_search_finds_the_worst_root() {
        let angles = (0..5).flat_map(|i| (0..6).map(move |j| (17.0 + 13.3 * f64::from(i), 3.0 + 34.7 * f64::from(j))));
        for ((beta, tool), k) in angles.zip([0.0, 0.1, 0.5, 1.0, 3.0].into_iter().cycle()) {
            let copying = Copying::of_angles(f64::to_radians(beta), f64::to_radians(tool));
            let lobing = Lobing { copying, compliance_ratio: k, resonances: Vec::new() };
            let (all, complete) = lobing.roots(1.5, 20.5);
            assert!(complete, "{beta} {tool} {k}");
            let worst = all.iter().map(|root| root.growth_per_rad).fold(f64::NEG_INFINITY, f64::max);
            let quick = lobing.near_neutral(1.5, 20.5);
            let quick = quick.iter().map(|root| root.growth_per_rad).fold(f64::NEG_INFINITY, f64::max);
            assert!((worst - quick).abs() < 1e-9, "{beta} {tool} {k}: {worst} {quick}");
        }
    }
}
