//! Forces of the wide edge from the force law of the ring (`ring/4.3`).

use std::borrow::Cow;

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::calculator::{Finding, Violations};
use crate::ring_roundness::job::input::{Analysis, Job};
use crate::ring_roundness::model::scene::Scene;

/// Kienzle's law of a straight edge that cuts over its whole width. Equation `ring/4.3`.
///
/// Valid for a chip that is much wider than it is thick, and for a sharp edge.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
#[schema(as = RingForceLaw)]
pub struct ForceLaw {
    /// Width of the cut: of the edge, or of a narrower ring.
    #[schema(exclusive_minimum = 0.0, maximum = 10_000.0, example = 12.0, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("b"))))]
    pub edge_width_mm: f64,
    /// Specific cutting force at 1 mm chip thickness and 1 mm width, k_c1.1.
    #[schema(exclusive_minimum = 0.0, maximum = 100_000.0, example = 2100.0, extensions(("x-unit" = json!("N/mm2")), ("x-symbol" = json!("k_c1.1"))))]
    pub specific_cutting_force_n_per_mm2: f64,
    /// Exponent of the chip thickness in the specific cutting force, m_c.
    #[schema(minimum = 0.0, exclusive_maximum = 1.0, example = 0.26, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("m_c"))))]
    pub cutting_exponent: f64,
    /// Specific force normal to the edge, k_n1.1. No table gives it: as a rule 0.35 to 0.6 of k_c1.1 for a sharp carbide edge.
    #[schema(exclusive_minimum = 0.0, maximum = 100_000.0, example = 900.0, extensions(("x-unit" = json!("N/mm2")), ("x-symbol" = json!("k_n1.1"))))]
    pub specific_normal_force_n_per_mm2: f64,
    /// Exponent of the chip thickness in the specific normal force, m_n. No table gives it: as a rule 0.3 to 0.5.
    #[schema(minimum = 0.0, exclusive_maximum = 1.0, example = 0.35, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("m_n"))))]
    pub normal_exponent: f64,
}

/// What the force law comes to.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
#[schema(as = RingCutForce)]
pub struct CutForce {
    /// Chip thickness: the radius that a revolution of feed takes off.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub chip_thickness_um: f64,
    /// Thrust toward the centre.
    #[schema(extensions(("x-unit" = json!("N"))))]
    pub thrust_n: f64,
    /// Main cutting force, against the surface.
    #[schema(extensions(("x-unit" = json!("N"))))]
    pub cutting_n: f64,
    /// Thrust force per mm of depth.
    #[schema(extensions(("x-unit" = json!("N/mm"))))]
    pub cut_n_per_mm: f64,
}

impl ForceLaw {
    /// F_p = k_n b h^(1-m_n), F_c = k_c b h^(1-m_c), k_c w = dF_p/dh, at a chip thickness. Equation `ring/4.3`.
    fn at(&self, chip_mm: f64) -> CutForce {
        let force = |specific: f64, exponent: f64| specific * self.edge_width_mm * chip_mm.powf(1.0 - exponent);
        let thrust_n = force(self.specific_normal_force_n_per_mm2, self.normal_exponent);
        CutForce {
            chip_thickness_um: chip_mm * 1000.0,
            thrust_n,
            cutting_n: force(self.specific_cutting_force_n_per_mm2, self.cutting_exponent),
            cut_n_per_mm: (1.0 - self.normal_exponent) * thrust_n / chip_mm,
        }
    }
}

/// What the job's force law comes to where its feed ends; nothing without a law, and where the ring cannot rest.
pub(in crate::ring_roundness) fn of(job: &Job) -> Option<CutForce> {
    let law = job.force.as_ref()?;
    // Where the ring rests does not depend on what gives.
    let rigid = Job { force: None, stiffness: None, dynamics: None, ..job.clone() };
    let scene = Scene::of(&rigid, &rigid.effects);
    let per_feed = scene.end()?.radius_per_feed(scene.setting.feed_direction);
    let chip_mm = per_feed * job.tool.feed_mm_per_rev;
    (chip_mm > 0.0).then(|| law.at(chip_mm))
}

/// The job with what its force law gives, where it leaves that open: what it states itself stays.
pub(in crate::ring_roundness) fn resolved(job: &Job) -> Cow<'_, Job> {
    let Some(cut) = of(job) else { return Cow::Borrowed(job) };
    let mut job = job.clone();
    let give = |field: &mut Option<f64>, value: f64| {
        field.get_or_insert(value);
    };
    if let Some(stiffness) = &mut job.stiffness {
        give(&mut stiffness.cut_n_per_mm, cut.cut_n_per_mm);
    }
    if let Some(dynamics) = &mut job.dynamics {
        give(&mut dynamics.cut_n_per_mm, cut.cut_n_per_mm);
    }
    if let Some(forces) = &mut job.forces {
        give(&mut forces.thrust_n, cut.thrust_n);
        give(&mut forces.cutting_n, cut.cutting_n);
    }
    job.force = None;
    Cow::Owned(job)
}

/// Where the law gives nothing, what it would give has to be stated. A search tries other feeds, at which a cut by this law
/// is stiffer or softer: it takes a stiffness that is stated.
pub(in crate::ring_roundness) fn check(job: &Job, violations: &mut Violations) {
    let open = open_fields(job);
    if job.force.is_none() {
        for at in open {
            violations.add(Finding::new("cut_force_missing", at));
        }
    } else if job.asks(Analysis::SettingsSearch) {
        for at in open.into_iter().filter(|at| at.ends_with("cut_n_per_mm")) {
            violations.add(Finding::new("search_needs_cut_stiffness", at));
        }
    }
}

/// What the job leaves open.
fn open_fields(job: &Job) -> Vec<&'static str> {
    let stiffness = job.stiffness.as_ref().is_some_and(|stiffness| stiffness.cut_n_per_mm.is_none());
    let dynamics = job.dynamics.as_ref().is_some_and(|dynamics| dynamics.cut_n_per_mm.is_none());
    let thrust = job.forces.as_ref().is_some_and(|forces| forces.thrust_n.is_none());
    let cutting = job.forces.as_ref().is_some_and(|forces| forces.cutting_n.is_none());
    [
        (stiffness, "/stiffness/cut_n_per_mm"),
        (dynamics, "/dynamics/cut_n_per_mm"),
        (thrust, "/forces/thrust_n"),
        (cutting, "/forces/cutting_n"),
    ]
    .into_iter()
    .filter_map(|(is_open, at)| is_open.then_some(at))
    .collect()
}
