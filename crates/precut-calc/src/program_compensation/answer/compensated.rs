//! Numbers of the answer: the program that is given back.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::super::model::correction::{ChangedLine, Corrected, Proof, Transition as ThickStretch, WhyLeftAlone};
use super::super::model::refeed::Refed;
use super::super::model::yielding::contour;
use super::left::ErrorAlong;

/// The program that is given back: its finishing cuts are shifted against what they would leave, or its feeds are others.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct CompensatedProgram {
    /// Lines of the given program that become others.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub lines_changed: Vec<usize>,
    /// What they become.
    pub changes: Vec<LineChange>,
    /// Finishing lines that stay as they are.
    pub left_alone: Vec<LineLeftAlone>,
    /// Stretches over which the work stays thick, because the shift jumps there and is laid on the side of the stock.
    pub transitions: Vec<Transition>,
    /// What came of the shifts when the program that is given back was read and driven again; null where nothing is shifted.
    pub proof: Option<CompensationProof>,
    /// The error that the program that is given back leaves along the contour, by columns; empty where nothing changes.
    pub contour: ErrorAlong,
    /// The change as a unified diff; empty where nothing changes.
    pub diff: String,
    /// The program that is given back: every line that is not among the changed ones is as it was, byte for byte.
    pub nc_program: String,
}

/// A line of a program that becomes others.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct LineChange {
    /// Line of the given program, from 1.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub line: usize,
    /// As it was.
    pub old: String,
    /// As it is now.
    pub new: Vec<String>,
    /// Least shift along it, on the diameter.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub smallest_shift_um: f64,
    /// Largest shift along it, on the diameter.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub largest_shift_um: f64,
}

/// A finishing line that stays as it is.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct LineLeftAlone {
    /// Line of the given program, from 1.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub line: usize,
    /// Why.
    pub reason: WhyLeftAlone,
}

/// A stretch over which the work stays thick.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
#[schema(as = ThickStretch)]
pub struct Transition {
    /// Line of the given program, from 1.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub line: usize,
    /// Where it begins, from the headstock end.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub z_mm: f64,
    /// How long it is.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub length_mm: f64,
    /// By how much the diameter is larger there at the most than the corrected program aims at.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub leaves_um: f64,
}

/// The given and the corrected program, driven over the blank. Errors are those of the diameter along the contour, outside
/// transitions.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct CompensationProof {
    /// Least error of the given program.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub smallest_error_before_um: f64,
    /// Largest error of the given program.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub largest_error_before_um: f64,
    /// Least error of the corrected program.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub smallest_error_after_um: f64,
    /// Largest error of the corrected program.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub largest_error_after_um: f64,
    /// How far the radius comes out at the most from what the corrected moves aim at.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub largest_residual_um: f64,
    /// Where, from the headstock end.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub largest_residual_z_mm: f64,
    /// How near rapid moves of the given program come to the work, across the axis: 0 where one begins at the end of a cut;
    /// null where none comes within 1 mm.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub rapid_clearance_before_mm: Option<f64>,
    /// The same of the corrected program.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub rapid_clearance_after_mm: Option<f64>,
    /// Lines that are as they were.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub lines_compared: usize,
    /// Moves that are no others than before.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub moves_compared: usize,
}

impl CompensatedProgram {
    pub(super) fn of(corrected: &Corrected, refed: Option<&Refed>) -> Self {
        let change = |one: &ChangedLine| LineChange {
            line: one.line,
            old: one.old.clone(),
            new: one.new.clone(),
            smallest_shift_um: one.smallest_shift_um,
            largest_shift_um: one.largest_shift_um,
        };
        let mut contour = ErrorAlong::default();
        match (&corrected.proof, refed) {
            (Some(proof), _) => proof.contour.iter().for_each(|error| contour.push(error)),
            // What is not shifted leaves its error at the new feeds.
            (None, Some(refed)) => self::contour(&refed.yielded).iter().for_each(|error| contour.push(error)),
            (None, None) => {}
        }
        let transition = |one: &ThickStretch| Transition {
            line: one.line,
            z_mm: one.from_mm,
            length_mm: one.to_mm - one.from_mm,
            leaves_um: one.leaves_um,
        };
        Self {
            lines_changed: corrected.changed.iter().map(|one| one.line).collect(),
            changes: corrected.changed.iter().map(change).collect(),
            left_alone: corrected
                .left_alone
                .iter()
                .map(|one| LineLeftAlone { line: one.line, reason: one.why })
                .collect(),
            transitions: corrected.proof.iter().flat_map(|proof| &proof.transitions).map(transition).collect(),
            proof: corrected.proof.as_ref().map(CompensationProof::of),
            contour,
            diff: corrected.diff.clone(),
            nc_program: corrected.text.clone(),
        }
    }
}

impl CompensationProof {
    fn of(proof: &Proof) -> Self {
        // What stands in work that comes back touches it.
        let clearance = |clearance: Option<f64>| clearance.map(|clearance| clearance.max(0.0));
        Self {
            smallest_error_before_um: proof.before_um[0],
            largest_error_before_um: proof.before_um[1],
            smallest_error_after_um: proof.after_um[0],
            largest_error_after_um: proof.after_um[1],
            largest_residual_um: proof.residual_um,
            largest_residual_z_mm: proof.residual_at_mm,
            rapid_clearance_before_mm: clearance(proof.clearance_mm[0]),
            rapid_clearance_after_mm: clearance(proof.clearance_mm[1]),
            lines_compared: proof.lines_compared,
            moves_compared: proof.moves_compared,
        }
    }
}
