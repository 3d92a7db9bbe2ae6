//! From shaft and supports in a job to the beam's sections and springs.

use super::{Shaft, Support, Theory};
use crate::num::beam;

const MM_PER_UM: f64 = 1e-3;
/// kg/m³ m/s² = N/m³ = 1e-9 N/mm³.
const N_PER_MM3: f64 = 1e-9;

/// Indices of the leftmost and rightmost support that carries; the latter only where it is another.
pub(crate) fn ends(supports: &[Support]) -> (Option<usize>, Option<usize>) {
    let carrying =
        || supports.iter().enumerate().filter(|(_, s)| s.carries()).filter_map(|(i, s)| s.station_mm().map(|z| (i, z)));
    let left = carrying().min_by(|a, b| a.1.total_cmp(&b.1)).map(|(i, _)| i);
    let right = carrying().max_by(|a, b| a.1.total_cmp(&b.1)).map(|(i, _)| i);
    (left, right.filter(|right| Some(*right) != left))
}

/// Index of the support that may hold the shaft against rotation at the headstock: the leftmost chuck or centre. A
/// steady rest does not clamp, and a centre that is the tailstock is not the headstock.
pub(crate) fn clamping(supports: &[Support]) -> Option<usize> {
    let clamps = |s: &Support| matches!(s, Support::Chuck { .. } | Support::Centre { .. });
    let (index, first) = supports
        .iter()
        .enumerate()
        .filter(|(_, s)| clamps(s))
        .filter_map(|(i, s)| s.station_mm().map(|z| (i, z)))
        .min_by(|a, b| a.1.total_cmp(&b.1))
        .map(|(i, _)| (i, &supports[i]))?;
    let is_tailstock = matches!(first, Support::Centre { .. }) && ends(supports).1 == Some(index);
    (!is_tailstock).then_some(index)
}

/// Flexibilities and weight of a section (`deflection/3.2`).
///
/// `flexibility` scales bending and shear alike; `gravity_m_per_s2` makes the weight.
pub(crate) fn section(
    shaft: &Shaft,
    theory: Theory,
    flexibility: f64,
    diameter_mm: f64,
    bore_mm: f64,
    gravity_m_per_s2: f64,
) -> beam::Section {
    let (e, nu, rho) = (shaft.modulus(), shaft.poisson(), shaft.density());
    let area = beam::area_mm2(diameter_mm, bore_mm);
    let shear = match theory {
        Theory::EulerBernoulli => 0.0,
        Theory::Timoshenko => {
            let k = beam::cowper_shear_coefficient(nu, bore_mm / diameter_mm);
            2.0 * (1.0 + nu) / (e * k * area)
        }
    };
    beam::Section {
        bending_flexibility_per_n_mm2: flexibility / (e * beam::second_moment_mm4(diameter_mm, bore_mm)),
        shear_flexibility_per_n: flexibility * shear,
        weight_n_per_mm: rho * gravity_m_per_s2 * area * N_PER_MM3,
    }
}

/// A support as the beam sees it, with what is added to its radial compliance and the rotation that it gets.
pub(crate) fn support(support: &Support, added_mm_per_n: f64, rotation: Option<f64>) -> beam::Support {
    let springs = |radial: f64, tangential: Option<f64>| beam::Springs {
        radial_mm_per_n: (radial * MM_PER_UM + added_mm_per_n).max(0.0),
        tangential_mm_per_n: tangential.unwrap_or(radial) * MM_PER_UM,
    };
    let contact = |one_sided: bool, gap_um: f64| {
        if one_sided { beam::Contact::OneSided { gap_mm: gap_um * MM_PER_UM } } else { beam::Contact::Bilateral }
    };
    match *support {
        Support::Centre { z_mm, compliance_um_per_n: c, tangential_compliance_um_per_n: cz } => match rotation {
            None => beam::Support::Centre { z_mm, springs: springs(c, cz) },
            Some(rotational_rad_per_n_mm) => {
                beam::Support::Chuck { z_mm, springs: springs(c, cz), rotational_rad_per_n_mm }
            }
        },
        Support::Chuck {
            z_mm,
            compliance_um_per_n: c,
            tangential_compliance_um_per_n: cz,
            rotational_compliance_rad_per_n_mm,
        } => beam::Support::Chuck {
            z_mm,
            springs: springs(c, cz),
            rotational_rad_per_n_mm: rotation.unwrap_or(rotational_compliance_rad_per_n_mm),
        },
        Support::SteadyRest { z_mm, compliance_um_per_n: c, tangential_compliance_um_per_n: cz, one_sided, gap_um } => {
            beam::Support::SteadyRest { z_mm, springs: springs(c, cz), contact: contact(one_sided, gap_um) }
        }
        Support::FollowRest {
            offset_mm,
            compliance_um_per_n: c,
            tangential_compliance_um_per_n: cz,
            one_sided,
            gap_um,
        } => beam::Support::FollowRest { offset_mm, springs: springs(c, cz), contact: contact(one_sided, gap_um) },
    }
}
