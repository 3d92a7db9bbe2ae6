//! Cross sections: from diameters and material to flexibility and weight per length.

use std::f64::consts::PI;

/// What the kernel needs of a cross section, per millimetre of shaft.
#[derive(Debug, Clone, Copy, PartialEq, Default)]
pub struct Section {
    /// Bending flexibility `1/(E J)`, 1/(N mm²), > 0.
    pub bending_flexibility_per_n_mm2: f64,
    /// Shear flexibility `1/(k G A)`, 1/N; 0 is the Euler-Bernoulli beam.
    pub shear_flexibility_per_n: f64,
    /// Weight `rho g A`, N/mm; 0 if no weight is asked for.
    pub weight_n_per_mm: f64,
}

/// The beam theory.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub enum Theory {
    /// Bending only.
    #[default]
    EulerBernoulli,
    /// Bending and shear.
    Timoshenko,
}

/// Elastic constants and weight of the shaft's material.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Material {
    /// Young's modulus `E`, N/mm², > 0.
    pub youngs_modulus_n_per_mm2: f64,
    /// Poisson's ratio `nu`, 1, in (-1, 0.5).
    pub poisson_ratio: f64,
    /// Density, kg/m³.
    pub density_kg_per_m3: f64,
    /// Acceleration of gravity, m/s².
    pub gravity_m_per_s2: f64,
}

impl Section {
    /// A round section, solid (`bore_mm` = 0) or hollow, of one material.
    ///
    /// `1/(E J)`, `1/(k G A)` with `G = E / (2 (1 + nu))`, and `rho g A`; kg/m³ times m/s² is
    /// 1e-9 N/mm³. Defined for `0 <= bore_mm < outer_mm`.
    pub fn round(outer_mm: f64, bore_mm: f64, material: &Material, theory: Theory) -> Self {
        let nu = material.poisson_ratio;
        let shear_modulus = material.youngs_modulus_n_per_mm2 / (2.0 * (1.0 + nu));
        let area = area_mm2(outer_mm, bore_mm);
        let shear_flexibility_per_n = match theory {
            Theory::EulerBernoulli => 0.0,
            Theory::Timoshenko => 1.0 / (cowper_shear_coefficient(nu, bore_mm / outer_mm) * shear_modulus * area),
        };
        Self {
            bending_flexibility_per_n_mm2: 1.0
                / (material.youngs_modulus_n_per_mm2 * second_moment_mm4(outer_mm, bore_mm)),
            shear_flexibility_per_n,
            weight_n_per_mm: material.density_kg_per_m3 * material.gravity_m_per_s2 * 1e-9 * area,
        }
    }

    pub(super) fn is_valid(&self) -> bool {
        let flexible = self.bending_flexibility_per_n_mm2;
        flexible.is_finite()
            && flexible > 0.0
            && self.shear_flexibility_per_n.is_finite()
            && self.shear_flexibility_per_n >= 0.0
            && self.weight_n_per_mm.is_finite()
    }
}

/// Cowper's shear coefficient of a round section (`deflection/3.2`).
///
/// `k = 6 (1+nu) (1+m²)² / [(7+6 nu) (1+m²)² + (20+12 nu) m²]`, `m` = bore / outer diameter in [0, 1);
/// solid: `6 (1+nu) / (7+6 nu)`. G. R. Cowper, J. Appl. Mech. 33 (1966) 335-340.
pub fn cowper_shear_coefficient(poisson_ratio: f64, bore_ratio: f64) -> f64 {
    let square = bore_ratio * bore_ratio;
    let solid = (1.0 + square) * (1.0 + square);
    6.0 * (1.0 + poisson_ratio) * solid / ((7.0 + 6.0 * poisson_ratio) * solid + (20.0 + 12.0 * poisson_ratio) * square)
}

/// Second moment of area of a round section about a diameter, mm⁴: `pi (d⁴ - d_in⁴) / 64`.
///
/// Factored, so that a thin wall loses no digits.
pub fn second_moment_mm4(outer_mm: f64, bore_mm: f64) -> f64 {
    PI / 64.0 * (outer_mm - bore_mm) * (outer_mm + bore_mm) * (outer_mm * outer_mm + bore_mm * bore_mm)
}

/// Area of a round section, mm²: `pi (d² - d_in²) / 4`.
pub fn area_mm2(outer_mm: f64, bore_mm: f64) -> f64 {
    PI / 4.0 * (outer_mm - bore_mm) * (outer_mm + bore_mm)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn cowper_tends_to_the_solid_and_the_thin_tube() {
        let nu = 0.3;
        assert!((cowper_shear_coefficient(nu, 0.0) - 6.0 * 1.3 / 8.8).abs() < 1e-15);
        // Cowper's own limit for a thin tube: 2 (1 + nu) / (4 + 3 nu).
        assert!((cowper_shear_coefficient(nu, 1.0) - 2.6 / 4.9).abs() < 1e-15);
    }

    #[test]
    fn thin_wall_keeps_its_digits() {
        // J -> pi d³ t / 8 for a wall t << d; the relative difference is 3 t / d.
        let wall = 1e-9;
        let j = second_moment_mm4(100.0, 100.0 - 2.0 * wall);
        assert!((j / (PI * 1e6 * wall / 8.0) - 1.0).abs() < 1e-5);
    }
}
