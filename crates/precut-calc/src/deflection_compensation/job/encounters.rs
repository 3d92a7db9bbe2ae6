//! What the tool meets where the program takes it: chucks and steady rests.
//!
//! A job knows the station at which a support holds the shaft, not how far its body reaches. So the tool may not pass
//! that station of a chuck, nor come to it in rapid motion; and near it there is a warning.

use crate::calculator::{Block, Finding, Program};

use crate::deflection_compensation::job::input::{Job, ProgramZero, Support};

/// How the tool meets a support.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::deflection_compensation) enum Encounter {
    /// It comes to the support, or past it, in rapid motion.
    Rapid,
    /// It passes the support while it cuts.
    Cut,
    /// It ends at the support or within the clearance of the approach from it.
    Near,
}

impl Encounter {
    /// Name of the motion.
    fn motion(self) -> &'static str {
        if self == Self::Rapid { "rapid" } else { "cut" }
    }
}

/// Where along the shaft a program takes the tool; stations, mm.
#[derive(Debug)]
pub(crate) struct Reach {
    from: f64,
    to: f64,
    /// First and last station of every run of cuts, the way from the approach left out.
    cuts: Vec<[f64; 2]>,
    /// Where rapid motion along the shaft ends.
    approaches: Vec<f64>,
    clearance_mm: f64,
    increment_mm: f64,
}

impl Reach {
    /// Of a program of the job.
    pub(in crate::deflection_compensation) fn of(job: &Job, program: &Program) -> Self {
        let zero_mm = match job.program.zero {
            ProgramZero::RightFace => job.shaft.length_mm(),
            ProgramZero::LeftFace => 0.0,
        };
        Self::along(program, zero_mm, job.program.clearance_z_mm)
    }

    /// Of a program whose zero lies at a station, with the clearance of its approaches, mm.
    pub(crate) fn along(program: &Program, zero_mm: f64, clearance_mm: f64) -> Self {
        let mut reach = Self {
            from: f64::INFINITY,
            to: f64::NEG_INFINITY,
            cuts: Vec::new(),
            approaches: Vec::new(),
            clearance_mm,
            increment_mm: program.increment_mm,
        };
        let mut cutting = false;
        for block in &program.blocks {
            match *block {
                Block::Rapid { z_mm: Some(z), .. } => {
                    reach.come_to(z + zero_mm);
                    reach.approaches.push(z + zero_mm);
                }
                Block::Cut { z_mm, .. } => reach.cut_to(z_mm + zero_mm, cutting),
                _ => {}
            }
            cutting = matches!(block, Block::Cut { .. });
        }
        reach
    }

    fn come_to(&mut self, z_mm: f64) {
        (self.from, self.to) = (self.from.min(z_mm), self.to.max(z_mm));
    }

    fn cut_to(&mut self, z_mm: f64, cutting: bool) {
        self.come_to(z_mm);
        match self.cuts.last_mut().filter(|_| cutting) {
            Some([from, to]) => (*from, *to) = (from.min(z_mm), to.max(z_mm)),
            None => self.cuts.push([z_mm, z_mm]),
        }
    }

    /// How the tool meets what stands at a station.
    pub(in crate::deflection_compensation) fn meets(&self, z_mm: f64) -> Option<Encounter> {
        let step = self.increment_mm;
        let inside = |from: f64, to: f64| from + step < z_mm && z_mm < to - step;
        if self.cuts.iter().any(|[from, to]| inside(*from, *to)) {
            return Some(Encounter::Cut);
        }
        // Whatever lies between two places where the tool is was passed on the way from one to the other.
        if inside(self.from, self.to) || self.approaches.iter().any(|approach| (approach - z_mm).abs() <= step) {
            return Some(Encounter::Rapid);
        }
        let near = self.clearance_mm + step;
        (self.from - near <= z_mm && z_mm <= self.to + near).then_some(Encounter::Near)
    }
}

/// Kind and station of a support that stands round the shaft, where the tool cannot be.
pub(in crate::deflection_compensation) fn body(support: &Support) -> Option<(&'static str, f64)> {
    match *support {
        Support::Chuck { z_mm, .. } => Some(("chuck", z_mm)),
        Support::SteadyRest { z_mm, .. } => Some(("steady_rest", z_mm)),
        Support::Centre { .. } | Support::FollowRest { .. } => None,
    }
}

/// The tool at or in a chuck or steady rest; `None` where they do not meet.
pub(crate) fn met(reach: &Reach, index: usize, support: &Support) -> Option<Finding> {
    let (kind, z_mm) = body(support)?;
    let encounter = reach.meets(z_mm)?;
    let finding = |code| Finding::new(code, format!("/supports/{index}/z_mm")).value(z_mm, "mm");
    Some(match (kind, encounter) {
        (_, Encounter::Near) => {
            finding("tool_reaches_support").with("kind", kind).with("clearance_mm", reach.clearance_mm)
        }
        ("chuck", _) => {
            let finding = finding("tool_hits_chuck").with("motion", encounter.motion());
            finding.with("from_mm", reach.from).with("to_mm", reach.to)
        }
        _ => finding("tool_passes_support").with("kind", kind),
    })
}

/// The first chuck that a program would take the tool through.
pub(in crate::deflection_compensation) fn hit_chuck(job: &Job, program: &Program) -> Option<Finding> {
    chuck_in_the_way(&Reach::of(job, program), &job.supports)
}

/// The first chuck of those supports through which the tool would go.
pub(crate) fn chuck_in_the_way(reach: &Reach, supports: &[Support]) -> Option<Finding> {
    let mut found = supports.iter().enumerate().filter_map(|(i, support)| met(reach, i, support));
    found.find(|finding| finding.code == "tool_hits_chuck")
}
