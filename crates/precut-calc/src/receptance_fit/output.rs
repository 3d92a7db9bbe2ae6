//! The answer: modes as a job of milling takes them, how well they are known, and what of the lines they leave.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::input::{Direction, Unit};

/// What the functions say of the structure.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[schema(title = "ReceptanceFit")]
pub struct Outcome {
    /// The modes, by frequency within each direction. `modes` of tool or work in a job of milling takes them as they are.
    pub modes: Vec<FittedMode>,
    /// How well each is known, in the same order.
    pub certainty: Vec<ModeCertainty>,
    /// Largest share that the modes leave of a function.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub largest_residual_share: f64,
    /// Directions that were fitted together, and how many modes they ask for.
    pub groups: Vec<FittedGroup>,
    /// How well each function is met.
    pub functions: Vec<FittedFunction>,
    /// Line by line.
    pub curve: Vec<CurveRow>,
}

/// A mode at the cut, mass-normalised there.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct FittedMode {
    /// Direction of its motion, of length 1: along the feed, across it, along the spindle.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub direction: [f64; 3],
    /// Natural frequency.
    #[schema(extensions(("x-unit" = json!("Hz"))))]
    pub frequency_hz: f64,
    /// Share of critical damping.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub damping_ratio: f64,
    /// Modal mass.
    #[schema(extensions(("x-unit" = json!("kg"))))]
    pub mass_kg: f64,
}

/// How well a mode is known.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct ModeCertainty {
    /// Modal stiffness.
    #[schema(extensions(("x-unit" = json!("N/mm"))))]
    pub stiffness_n_per_mm: f64,
    /// Standard error of the natural frequency.
    #[schema(extensions(("x-unit" = json!("Hz"))))]
    pub frequency_error_hz: f64,
    /// Standard error of the share of critical damping.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub damping_ratio_error: f64,
    /// Standard error of the modal mass.
    #[schema(extensions(("x-unit" = json!("kg"))))]
    pub mass_error_kg: f64,
    /// Phase by which its residue leaves that of a real mode where it may: 0 where damping is proportional.
    #[schema(extensions(("x-unit" = json!("deg"))))]
    pub residue_phase_deg: f64,
    /// Standard error of that phase.
    #[schema(extensions(("x-unit" = json!("deg"))))]
    pub residue_phase_error_deg: f64,
}

/// Directions that were fitted together.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct FittedGroup {
    /// The directions.
    pub directions: Vec<Direction>,
    /// How many modes they have.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub modes: usize,
    /// Schwarz's criterion: the least tells the number of modes.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub bic: f64,
    /// The same with one mode less; null with one mode.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub bic_one_less: Option<f64>,
    /// The same with one more; null where no start of a further mode is found.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub bic_one_more: Option<f64>,
    /// How many modes would meet the lines better, where the job states another number; else null.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub better_modes: Option<usize>,
}

/// How well a function is met.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct FittedFunction {
    /// Place of its file in `files`, from 0.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub file: usize,
    /// Its set in that file, from 1.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub set: usize,
    /// Direction in which the motion was measured.
    pub response: Direction,
    /// Direction in which it was struck or shaken.
    pub excitation: Direction,
    /// What was measured and is met with least squares, and its unit.
    pub unit: Unit,
    /// Lines that were fitted.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub lines: usize,
    /// What the modes leave, as a share of the root mean square of what was measured.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub residual_share: f64,
    /// How far what is left on a line tells what is left on the next: 0 for noise, toward 1 where the model is wrong.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub neighbour_correlation: f64,
    /// The same share in parts of the band.
    pub bands: Vec<FittedBand>,
}

/// What is left in a part of the band.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct FittedBand {
    /// Its first line.
    #[schema(extensions(("x-unit" = json!("Hz"))))]
    pub from_hz: f64,
    /// Its last line.
    #[schema(extensions(("x-unit" = json!("Hz"))))]
    pub to_hz: f64,
    /// What the modes leave, as a share of the root mean square of what was measured there.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub residual_share: f64,
}

/// A line as displacement over force.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct CurveRow {
    /// Place of its function in `functions`, from 0.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub function: usize,
    /// Frequency.
    #[schema(extensions(("x-unit" = json!("Hz"))))]
    pub frequency_hz: f64,
    /// Real part, measured.
    #[schema(extensions(("x-unit" = json!("um/N"))))]
    pub real_um_per_n: f64,
    /// Imaginary part, measured.
    #[schema(extensions(("x-unit" = json!("um/N"))))]
    pub imaginary_um_per_n: f64,
    /// Real part by the modes.
    #[schema(extensions(("x-unit" = json!("um/N"))))]
    pub fitted_real_um_per_n: f64,
    /// Imaginary part by the modes.
    #[schema(extensions(("x-unit" = json!("um/N"))))]
    pub fitted_imaginary_um_per_n: f64,
}
