//! How probable it is that a cut stays quiet and keeps every limit (`certainty/6.1`).

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::calculator::{Failure, Finding, Message};
use crate::certainty::around::{Asked, Real, far};
use crate::certainty::deepest::deepest_mm;
use crate::certainty::judging::{Checking, Judging, Told};
use crate::certainty::lines::{Margins, Together};
use crate::certainty::{ConformanceMethod, Contribution, JointlyKept, LimitKept, Uncertainties, improbable, probably};
use crate::clamping::Load;
use crate::fixture_stability::quiet_to;

use super::super::job::{Drawn, Held, OneQuantity, clamped, drawn, uncertainties};
use super::super::model::{Cut, slow_limit};
use super::clamping::yields;
use super::output::MillingMotion;
use super::{Study, drive_margin, forces_of, motion_of};

/// What may give out.
const LIMITS: usize = 6;
const STABLE: usize = 0;
const DRIVE: usize = 1;
const AMPLITUDE: usize = 2;
const SURFACE_ERROR: usize = 3;
const ROUGHNESS: usize = 4;
const HELD: usize = 5;
/// Their names, and the fields of the job that set them.
const NAMES: [(&str, &str); LIMITS] = [
    ("stable", "/cut/depth_mm"),
    ("drive", "/spindle"),
    ("amplitude", "/limits/amplitude_max_um"),
    ("surface_error", "/limits/surface_error_max_um"),
    ("roughness", "/limits/roughness_max_um"),
    ("held", "/clamping"),
];
/// Sets of them of which the probability is asked: each alone, then all.
const SETS: [Together; LIMITS + 1] = [
    STABLE..=STABLE,
    DRIVE..=DRIVE,
    AMPLITUDE..=AMPLITUDE,
    SURFACE_ERROR..=SURFACE_ERROR,
    ROUGHNESS..=ROUGHNESS,
    HELD..=HELD,
    STABLE..=HELD,
];
/// Lines of one scrambling on which cuts are compared.
const COMPARED_LINES: usize = 4;
/// Draws of the real model that an answer takes, roughly: lines of the answer itself, of a depth that is tried, and of a quantity of
/// half a width.
const DRAWS: f64 = 5000.0;
const DRAWS_TRIED: f64 = 1300.0;
const DRAWS_COMPARED: f64 = 600.0;
const DEPTHS_TRIED: f64 = 6.0;

/// Codes of what is said here.
pub(in crate::milling_stability) const EXPLANATION_CODES: &[&str] = &["probably_quiet_cut"];

/// How probable it is that the cut stays quiet and every limit is kept, and what makes that uncertain.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct MillingConformance {
    /// Every limit alone that the job has: `stable` (no chatter), `drive` (power and torque suffice), `amplitude`, `surface_error` and
    /// `roughness` of the forced motion, `held` (no contact slips or opens, at the likely friction and without a factor of safety).
    pub limits: Vec<LimitKept>,
    /// All limits together.
    pub joint: JointlyKept,
    /// What the doubt is made of, the largest share first; modes of a side together.
    pub contributions: Vec<Contribution>,
    /// Deepest cut of this speed and width that keeps all limits with the probability that is wanted; null where none does.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub depth_at_wanted_mm: Option<f64>,
    /// How the numbers were found.
    pub method: ConformanceMethod,
}

/// A cut that is judged by what may give out in it.
#[derive(Clone)]
struct Judged<'a> {
    study: &'a Study<'a>,
    of: Uncertainties<OneQuantity>,
    /// Which limits there are.
    limits: Vec<usize>,
    /// How the workpiece is held, and the clamp force at hand.
    held: Option<(Held, f64)>,
}

/// The block of the answer; `None` where nothing is uncertain.
pub(super) fn conformance(study: &Study<'_>) -> Result<Option<MillingConformance>, Failure> {
    let Some(judged) = Judged::new(study)? else { return Ok(None) };
    let depth_mm = study.case.depth_mm;
    let wanted = study.job.uncertainty.wanted_probability;
    let Told { limits, joint, contributions, method } =
        judged.told(depth_mm, wanted, Checking::WithHalves(COMPARED_LINES))?;
    let mut probability = |depth_mm: f64| judged.probability(depth_mm);
    let depth_at_wanted_mm = deepest_mm(depth_mm, study.examined_mm, wanted, &mut probability)?;
    Ok(Some(MillingConformance { limits, joint, contributions, depth_at_wanted_mm, method }))
}

/// Draws of the real model that a job takes with so many quantities that have a distribution, so many of which bounds alone are known,
/// and so many names of them.
pub(in crate::milling_stability) fn draws([quantities, within]: [usize; 2], names: usize) -> f64 {
    let count = quantities as f64;
    let surface = 1.0 + 2.0 * count + 0.5 * count * (count - 1.0);
    let compared = (1.0 + names as f64) * DRAWS_COMPARED;
    let all = surface + DRAWS + DEPTHS_TRIED * (surface + DRAWS_TRIED) + compared;
    if within == 0 {
        return all;
    }
    // Surfaces in the middle and, of each quantity, at the ends on three lines; and the largest probability beside the least.
    all + (1.0 + DEPTHS_TRIED) * (1.0 + 6.0 * within as f64) * surface + surface + DRAWS
}

impl<'a> Judged<'a> {
    fn new(study: &'a Study<'a>) -> Result<Option<Self>, Failure> {
        let Study { job, case, .. } = study;
        let of = uncertainties(job, &case.structure, &study.fits).map_err(|off| {
            let finding = Finding::new("correlations_contradict", "/uncertainty/correlations");
            Failure::OutOfModel(finding.with("largest_factor", off.largest_factor))
        })?;
        let held = clamped(job)
            .and_then(|(clamping, force_n)| Some((clamping.held(job.cut.feed_direction_deg)?.ok()?, force_n)));
        let has_drive = job.spindle.as_ref().is_some_and(|spindle| {
            let available = spindle.drive().available(case.rotation.spindle_rpm);
            available.power_kw.is_some() || available.torque_n_m.is_some()
        });
        let limits = [
            (STABLE, !case.structure.modes.is_empty()),
            (DRIVE, has_drive),
            (AMPLITUDE, job.limits.amplitude_max_um.is_some()),
            (SURFACE_ERROR, job.limits.surface_error_max_um.is_some()),
            (ROUGHNESS, job.limits.roughness_max_um.is_some()),
            (HELD, held.is_some()),
        ];
        let limits: Vec<usize> = limits.into_iter().filter(|(_, is)| *is).map(|(limit, _)| limit).collect();
        let is_known = of.is_empty() || limits.is_empty();
        Ok((!is_known).then_some(Self { study, of, limits, held }))
    }

    /// The cut at a depth, with the loads on the workpiece at the stated values: those of a rigid one go with the force.
    fn at(&self, depth_mm: f64) -> Result<There<'_>, Failure> {
        let cut = Cut { depth_mm, ..self.study.cut() };
        let loads = match &self.held {
            Some((held, _)) if !yields(&cut) => Some(self.study.loads_of(held, &cut)?),
            _ => None,
        };
        Ok(There { of: self, depth_mm, loads })
    }
}

impl Judging<LIMITS, { LIMITS + 1 }> for Judged<'_> {
    type Of = OneQuantity;
    /// The depth, mm.
    type At = f64;

    const NAMES: [(&'static str, &'static str); LIMITS] = NAMES;
    const MOST_LINES: [usize; 2] = [512, 32];
    const MOST_LINES_TRIED: [usize; 2] = [512, 8];

    fn uncertainties(&self) -> &Uncertainties<OneQuantity> {
        &self.of
    }

    fn with(&self, of: Uncertainties<OneQuantity>) -> Self {
        Self { of, ..self.clone() }
    }

    fn real(&self, depth_mm: f64) -> Result<impl Fn(&[f64]) -> Result<Margins<LIMITS>, Failure>, Failure> {
        let there = self.at(depth_mm)?;
        Ok(move |factors: &[f64]| there.margins(factors))
    }

    fn asked<'b>(
        &'b self,
        real: &'b Real<'b, LIMITS>,
        most_lines: [usize; 2],
    ) -> Asked<'b, OneQuantity, LIMITS, { LIMITS + 1 }> {
        Asked {
            uncertainties: &self.of,
            limits: &self.limits,
            sets: SETS,
            seed: self.study.job.uncertainty.seed,
            most_lines,
            monitor: self.study.monitor,
            real,
        }
    }
}

/// The same at one depth.
struct There<'a> {
    of: &'a Judged<'a>,
    depth_mm: f64,
    loads: Option<Vec<Load>>,
}

impl There<'_> {
    /// By how much the limits are kept, as logarithms.
    fn margins(&self, factors: &[f64]) -> Result<Margins<LIMITS>, Failure> {
        let Judged { study, limits, .. } = self.of;
        let drawn = drawn(study.job, &study.case, &self.of.of, factors)?;
        let cut = Cut {
            milling: &drawn.milling,
            structure: &drawn.structure,
            rotation: study.case.rotation,
            depth_mm: self.depth_mm,
        };
        let mut margins = [f64::INFINITY; LIMITS];
        let has = |limit: usize| limits.contains(&limit);
        if has(STABLE) {
            margins[STABLE] = self.stable(&cut)?;
        }
        if has(DRIVE) {
            let margin = drive_margin(&forces_of(study, cut.milling, cut.depth_mm)?);
            margins[DRIVE] = margin.map_or(f64::INFINITY, |margin| far(margin.ln()));
        }
        if has(AMPLITUDE) || has(SURFACE_ERROR) || has(ROUGHNESS) {
            self.of_motion(&cut, &mut margins)?;
        }
        if has(HELD) {
            margins[HELD] = self.held(&cut, &drawn)?;
        }
        Ok(margins)
    }

    fn stable(&self, cut: &Cut<'_>) -> Result<f64, Failure> {
        let Study { orders, monitor, examined_mm, .. } = self.of.study;
        if cut.is_slow() && !cut.repeats() {
            let limit = slow_limit(cut, examined_mm.max(2.0 * cut.depth_mm), *monitor)?;
            return Ok(limit.map_or(f64::INFINITY, |limit| far((limit.depth_mm / cut.depth_mm).ln())));
        }
        let unsolved = Failure::NotConverged { what: "largest Floquet multiplier", residual: 1.0, iterations: 0 };
        Ok(far(-orders.on_map(cut, *monitor)?.ok_or(unsolved)?.growth()))
    }

    /// None is kept of a cut without a motion that the model knows.
    fn of_motion(&self, cut: &Cut<'_>, margins: &mut Margins<LIMITS>) -> Result<(), Failure> {
        let limits = &self.of.study.job.limits;
        let motion = motion_of(self.of.study, cut)?.ok();
        let over = |limit: Option<f64>, of: &dyn Fn(&MillingMotion) -> f64| match (limit, &motion) {
            (Some(limit), Some(motion)) => far((limit / of(motion)).ln()),
            (Some(_), None) => f64::NEG_INFINITY,
            (None, _) => f64::INFINITY,
        };
        margins[AMPLITUDE] = over(limits.amplitude_max_um, &|motion| motion.peak_to_peak_um);
        margins[SURFACE_ERROR] = over(limits.surface_error_max_um, &|motion| {
            motion.walls.iter().map(super::WallSurface::largest_um).fold(0.0, f64::max)
        });
        margins[ROUGHNESS] = over(limits.roughness_max_um, &|motion| {
            motion.walls.iter().map(|wall| wall.roughness_rz_um).fold(0.0, f64::max)
        });
        Ok(())
    }

    /// ln of the clamp force over the least that holds, at the likely friction.
    fn held(&self, cut: &Cut<'_>, drawn: &Drawn) -> Result<f64, Failure> {
        let Some((held, force_n)) = &self.of.held else { return Ok(f64::INFINITY) };
        let scaled = |load: &Load| Load { force_n: load.force_n.map(|part| part * drawn.force), ..*load };
        let loads = match &self.loads {
            Some(loads) if drawn.has_scaled_loads => loads.iter().map(scaled).collect(),
            _ => self.of.study.loads_of(held, cut)?,
        };
        let Ok(loaded) = held.rest.loaded(&held.fixture, &loads, 1.0) else { return Ok(f64::NEG_INFINITY) };
        let friction: Vec<f64> = held.friction[1].iter().map(|one| one * drawn.friction).collect();
        let asked_n = held.rest.against_slip(&loaded, &friction).map_or(0.0, |deciding| deciding.clamp_force_n);
        Ok(far((drawn.clamp * force_n / asked_n.max(0.0)).ln()))
    }
}

/// What is said of it.
pub(super) fn said(conformance: &MillingConformance) -> Vec<Message> {
    let MillingConformance { limits, joint, contributions, .. } = conformance;
    let first = probably("probably_quiet_cut", joint, limits, contributions);
    let deep = conformance.depth_at_wanted_mm.map(|depth_mm| quiet_to(depth_mm, joint));
    std::iter::once(first).chain(deep).collect()
}

/// What is warned of.
pub(super) fn warning(conformance: &MillingConformance) -> Option<Finding> {
    improbable("improbable_cut", &conformance.joint)
}
