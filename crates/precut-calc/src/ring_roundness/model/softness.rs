//! What machine and tool give under the thrust of the cut: at rest (`ring/4.2`), and at the natural frequencies of their
//! modes (`ring/5.6`).

use crate::ring_roundness::job::input::{Job, Mode, ModePlace};
use crate::ring_roundness::model::lobing::{Lobing, Resonance};
use crate::ring_roundness::model::stance::Copying;

/// What gives, in the kernel's frame.
#[derive(Debug, Clone, Default)]
pub(crate) struct Softness {
    /// Compliance ratio that is stated as such, by the job and its effects.
    stated: f64,
    /// Springs: where, and the stiffness of the cut over theirs.
    springs: Vec<(ModePlace, f64)>,
    modes: Vec<Mode>,
    cut_n_per_mm: f64,
    work_speed_rpm: f64,
}

/// What a yielding of 1 mm at a place moves the tool off the surface, squared: as force and as way (`ring/4.2`).
fn weight(place: ModePlace, copying: &Copying) -> f64 {
    match place {
        ModePlace::Tool => 1.0,
        ModePlace::SupportA => copying.a.powi(2),
        ModePlace::SupportB => copying.b.powi(2),
    }
}

fn mirrored(place: ModePlace) -> ModePlace {
    match place {
        ModePlace::Tool => ModePlace::Tool,
        ModePlace::SupportA => ModePlace::SupportB,
        ModePlace::SupportB => ModePlace::SupportA,
    }
}

impl Softness {
    /// Of a job; `push_off` is what its effects add.
    pub(crate) fn of(job: &Job, push_off: f64) -> Self {
        let springs = job.stiffness.map_or_else(Vec::new, |stiffness| {
            [
                (ModePlace::Tool, stiffness.tool_n_per_mm),
                (ModePlace::SupportA, stiffness.support_a_n_per_mm),
                (ModePlace::SupportB, stiffness.support_b_n_per_mm),
            ]
            .map(|(place, n_per_mm)| (place, stiffness.cut_n_per_mm.unwrap_or(0.0) / n_per_mm))
            .to_vec()
        });
        let dynamics = job.dynamics.as_ref();
        Self {
            stated: job.compliance_ratio + push_off,
            springs,
            modes: dynamics.map_or_else(Vec::new, |dynamics| dynamics.modes.clone()),
            cut_n_per_mm: dynamics.and_then(|dynamics| dynamics.cut_n_per_mm).unwrap_or(0.0),
            work_speed_rpm: dynamics.map_or(1.0, |dynamics| dynamics.work_speed_rpm),
        }
    }

    /// The supports have changed places.
    pub(crate) fn mirrored(mut self) -> Self {
        self.springs.iter_mut().for_each(|(place, _)| *place = mirrored(*place));
        self.modes.iter_mut().for_each(|mode| mode.at = mirrored(mode.at));
        self
    }

    /// Compliance ratio K at rest, of springs and modes together.
    pub(crate) fn ratio(&self, copying: &Copying) -> f64 {
        let springs: f64 = self.springs.iter().map(|(place, ratio)| ratio * weight(*place, copying)).sum();
        self.stated + springs + self.modes.iter().map(|mode| self.mode_ratio(mode, copying)).sum::<f64>()
    }

    fn mode_ratio(&self, mode: &Mode, copying: &Copying) -> f64 {
        self.cut_n_per_mm / mode.stiffness_n_per_mm * weight(mode.at, copying)
    }

    /// The modes at a work speed.
    fn resonances(&self, copying: &Copying, speed_rpm: f64) -> Vec<Resonance> {
        let of = |mode: &Mode| Resonance {
            ratio: self.mode_ratio(mode, copying),
            lobes: mode.frequency_hz * 60.0 / speed_rpm,
            damping_ratio: mode.damping_ratio,
        };
        self.modes.iter().map(of).collect()
    }

    /// The characteristic equation of a setting at the job's work speed.
    pub(crate) fn lobing(&self, copying: Copying) -> Lobing {
        self.lobing_at(copying, self.work_speed_rpm)
    }

    /// The same at another work speed.
    pub(crate) fn lobing_at(&self, copying: Copying, speed_rpm: f64) -> Lobing {
        let resonances = self.resonances(&copying, speed_rpm);
        Lobing { copying, compliance_ratio: self.ratio(&copying), resonances }
    }

    /// The same of a machine that gives at once, however fast the force changes.
    pub(crate) fn lobing_at_rest(&self, copying: Copying) -> Lobing {
        Lobing { copying, compliance_ratio: self.ratio(&copying), resonances: Vec::new() }
    }
}
