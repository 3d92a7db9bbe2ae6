//! Effects beside what a job states.

use crate::calculator::{Finding, Violations};
use crate::effects::MillingEffect as Effect;

use super::super::model::{Milling, Mode, Rubbing};
use super::case::Case;
use super::input::{Job, Yielding};

/// Tangential over radial force of a flank of which nothing else is known.
const FLANK_FRICTION: f64 = 0.3;

impl Case {
    /// The same with effects beside it; those on a mode that there is not are left out, which the check refuses.
    pub(in crate::milling_stability) fn with_effects(mut self, effects: &[Effect]) -> Self {
        for effect in effects {
            self.add(effect);
        }
        self
    }

    fn add(&mut self, effect: &Effect) {
        let milling = &mut self.milling;
        let mut of_mode = |mode: u32, change: fn(&mut Mode, f64), factor: f64| {
            let index = usize::try_from(mode).unwrap_or(0).checked_sub(1);
            if let Some(mode) = index.and_then(|index| self.structure.modes.get_mut(index)) {
                change(mode, factor);
            }
        };
        match *effect {
            Effect::ModeFrequency { mode, factor } => of_mode(mode, Mode::tune, factor),
            Effect::ModeDamping { mode, factor } => of_mode(mode, Mode::damp, factor),
            Effect::ModeStiffness { mode, factor } => of_mode(mode, Mode::stiffen, factor),
            Effect::ForceCoefficient { factor } => milling.law.scale([factor; 3]),
            Effect::RadialRatio { factor } => milling.law.scale([1.0, factor, 1.0]),
            Effect::ToothRunout { runout_mm } => stand_out(milling, runout_mm),
            Effect::ProcessDamping { coefficient_n_per_mm } => {
                let friction = milling.rubbing.map_or(FLANK_FRICTION, |of| of.friction);
                let stated = milling.rubbing.map_or(0.0, |of| of.coefficient_n_per_mm);
                let coefficient_n_per_mm = stated + coefficient_n_per_mm;
                // Of none the map is that of a cut without.
                milling.rubbing = (coefficient_n_per_mm > 0.0).then_some(Rubbing { coefficient_n_per_mm, friction });
            }
        }
    }
}

/// A single tooth cuts the same wherever it stands.
fn stand_out(milling: &mut Milling, runout_mm: f64) {
    if milling.teeth.len() > 1 {
        milling.teeth[0].radial_mm += runout_mm;
    }
}

/// How many modes a job has; `None` where measured functions tell.
fn count_of_modes(job: &Job) -> Option<usize> {
    let of = |yielding: &Yielding| match yielding {
        Yielding::Modes(of) => Some(of.modes.len()),
        Yielding::Vise(_) => Some(1),
        Yielding::Rigid(_) => Some(0),
        Yielding::Receptances(_) => None,
    };
    job.sides().iter().map(|(.., yielding)| of(yielding)).sum()
}

/// Of a mode that there is not.
pub(in crate::milling_stability) fn beyond_modes(effects: &[Effect], count: usize) -> Option<Finding> {
    let beyond = |mode: u32| usize::try_from(mode).is_ok_and(|mode| mode > count);
    effects.iter().enumerate().find_map(|(i, effect)| {
        let mode = effect.mode().filter(|mode| beyond(*mode))?;
        let finding = Finding::new("effect_without_mode", format!("/effects/{i}/mode"));
        Some(finding.measured(f64::from(mode), count as f64, "1").with("kind", effect.kind()))
    })
}

pub(super) fn check(job: &Job, violations: &mut Violations) {
    for (i, effect) in job.effects.iter().enumerate() {
        let same = |before: &Effect| before.kind() == effect.kind() && before.mode() == effect.mode();
        violations.require(!job.effects[..i].iter().any(same), || {
            Finding::new("duplicate_effect", format!("/effects/{i}/kind")).with("kind", effect.kind())
        });
    }
    if let Some(finding) = count_of_modes(job).and_then(|count| beyond_modes(&job.effects, count)) {
        violations.add(finding);
    }
}
