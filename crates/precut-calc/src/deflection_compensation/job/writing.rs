//! How the program of a job is to be written: its zero, its clearances, where it leaves the work.

use crate::path::round_to_increment;
use crate::turning::{Rest, Setting};

use crate::deflection_compensation::job::input::{FeedDirection, Job, ProgramSettings, ProgramZero, Support};

const UM_PER_MM: f64 = 1e3;

impl ProgramSettings {
    /// How a program of these settings is written, for a shaft of this length.
    pub(crate) fn setting(
        &self,
        increment_mm: f64,
        zero_mm: f64,
        direction: FeedDirection,
        supports: &[Support],
    ) -> Setting {
        let rest = |support: &Support| match *support {
            Support::SteadyRest { z_mm, .. } => Some(Rest { z_mm }),
            _ => None,
        };
        Setting {
            dialect: self.dialect,
            increment_mm,
            zero_mm,
            clearance_x_mm: self.clearance_x_mm,
            clearance_z_mm: self.clearance_z_mm,
            side: direction.comes_from(),
            rests: supports.iter().filter_map(rest).collect(),
            tool_number: self.tool_number,
            coolant: self.coolant,
            safe_position: self.safe_position.map(|safe| (safe.x_diameter_mm, safe.z_mm)),
            end: self.end,
        }
    }
}

/// How the program of a job is written.
pub(in crate::deflection_compensation) fn setting(job: &Job, length_mm: f64) -> Setting {
    let increment_mm = job.path.increment_um / UM_PER_MM;
    job.program.setting(increment_mm, zero_mm(job, length_mm), job.cut.feed_direction, &job.supports)
}

/// Station at which the tool leaves the work before a rest that it is to pass, mm.
pub(in crate::deflection_compensation) fn stop_before_mm(job: &Job, length_mm: f64, rest_mm: f64, side: f64) -> f64 {
    let zero = zero_mm(job, length_mm);
    let beside = setting(job, length_mm).beside_z_mm();
    round_to_increment(rest_mm + side * beside - zero, job.path.increment_um / UM_PER_MM) + zero
}

/// Station of the program's zero, mm.
pub(in crate::deflection_compensation) fn zero_mm(job: &Job, length_mm: f64) -> f64 {
    match job.program.zero {
        ProgramZero::RightFace => length_mm,
        ProgramZero::LeftFace => 0.0,
    }
}
