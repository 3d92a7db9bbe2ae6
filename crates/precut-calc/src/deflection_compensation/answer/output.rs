//! The answer: the profile before and after, the command, and what dominates.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::certainty::Conformance;
use crate::deflection_compensation::answer::auto::Automatic;
use crate::deflection_compensation::model::form::Form;
use crate::turning::Proof;

/// What will come out of the cut, and where the tool must go.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[schema(title = "DeflectionCompensationResult")]
pub struct Outcome {
    /// Form error if the tool follows the nominal line (diameter, largest minus smallest).
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub form_error_um: Option<f64>,
    /// Form error with the compensated path as programmed: rounded, in straight moves.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub form_error_after_um: Option<f64>,
    /// Largest deviation of the diameter from the drawing if the tool follows the nominal line.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub largest_error_um: Option<f64>,
    /// Largest deviation of the diameter from the drawing with the compensated path as programmed.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub largest_error_after_um: Option<f64>,
    /// Time in the cut, all passes.
    #[schema(extensions(("x-unit" = json!("min"))))]
    pub cutting_time_min: f64,
    /// Form and size without compensation.
    pub before: Form,
    /// Form and size with the compensated path as programmed; only with `detail: full`.
    pub after: Option<Form>,
    /// Everything along the shaft; of the last pass where there are several.
    pub stations: StationColumns,
    /// The commanded path in straight moves, of the last pass where there are several; only with `detail: full`.
    pub path: Option<Path>,
    /// The program of all passes, driven over the blank before it is given out; only with `detail: full`, and where there is a
    /// program.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub proof: Option<Proof>,
    /// Shift of the commanded diameter that `aim` makes.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub aim_shift_um: f64,
    /// How probable it is that the shaft is good; only with `detail: full`, a tolerance and a whole path.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub conformance: Option<Conformance>,
    /// How the diameters of single parts scatter along the shaft; likewise.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub error_fan: Option<ErrorFan>,
    /// What yields, at the station that deflects most.
    pub shares: Shares,
    /// Effects of second order on the diameter, whether switched on or not; only with `detail: full`.
    pub second_order: Option<SecondOrder>,
    /// Effects that act although the job does not say so.
    pub included_automatically: Vec<Automatic>,
    /// First critical speed of the held shaft in bending, rests that bear on one side away; only with `detail: full`.
    #[schema(extensions(("x-unit" = json!("rev/min"))))]
    pub critical_speed_rpm: Option<f64>,
    /// What one more steady rest would do, or a tailstock where the end that yields most is free; only with `detail: full`.
    pub one_more_rest: Option<OneMoreRest>,
    /// The one-step formula of the source paper beside the exact command; only with `compare_one_step`, `detail: full`
    /// and without one-sided rests, for which the formula has no compliance.
    pub one_step: Option<OneStep>,
    /// Every pass where there are several.
    pub passes: Vec<PassOutcome>,
    /// Bound of the numerical error of every diameter: solver residual, and round-off of the compliance.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub numerical_error_um: f64,
}

/// Diameter errors that so many percent of the parts stay below, along the shaft.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct ErrorFan {
    /// Station from the headstock end.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub z_mm: Vec<f64>,
    /// One of twenty.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub below_5_percent_um: Vec<f64>,
    /// One of four.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub below_25_percent_um: Vec<f64>,
    /// One of two.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub below_50_percent_um: Vec<f64>,
    /// Three of four.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub below_75_percent_um: Vec<f64>,
    /// Nineteen of twenty.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub below_95_percent_um: Vec<f64>,
}

/// One entry per station, in the order of z. With `detail: profile` what the shaft does and where the tool must go.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct StationColumns {
    /// Station from the headstock end.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub z_mm: Vec<f64>,
    /// Diameter wanted.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub diameter_mm: Vec<f64>,
    /// Diameter of the stock of this pass.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub stock_diameter_mm: Vec<f64>,
    /// Compliance of the held shaft at the cutting point, one-sided rests open; only with `detail: full`.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schema(extensions(("x-unit" = json!("um/N"))))]
    pub work_compliance_um_per_n: Option<Vec<f64>>,
    /// Compliance of the held shaft and the carriage at the cutting point, one-sided rests open.
    #[schema(extensions(("x-unit" = json!("um/N"))))]
    pub compliance_um_per_n: Vec<f64>,
    /// Nominal depth of cut (radial).
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub depth_mm: Vec<f64>,
    /// Passive force at the nominal depth.
    #[schema(extensions(("x-unit" = json!("N"))))]
    pub passive_force_n: Vec<f64>,
    /// Main force at the nominal depth; absent where the force model has none.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schema(extensions(("x-unit" = json!("N"))))]
    pub main_force_n: Option<Vec<f64>>,
    /// Feed force at the nominal depth; absent where the force model has none.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schema(extensions(("x-unit" = json!("N"))))]
    pub feed_force_n: Option<Vec<f64>>,
    /// Radial opening of the gap at the nominal depth: deflection, sag and stated errors.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub deflection_um: Vec<f64>,
    /// Tangential offset of the axis at the nominal depth; absent where nothing moves it.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub tangential_deflection_um: Option<Vec<f64>>,
    /// Depth really cut if the tool follows the nominal line; only with `detail: full`.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub depth_uncompensated_mm: Option<Vec<Option<f64>>>,
    /// Diameter error if the tool follows the nominal line, positive = oversize.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub diameter_error_uncompensated_um: Vec<Option<f64>>,
    /// Radial offset of the commanded path from the nominal line, positive away from the axis; only with `detail: full`.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub offset_um: Option<Vec<Option<f64>>>,
    /// Commanded diameter.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub commanded_diameter_mm: Vec<Option<f64>>,
    /// Diameter error with the path as programmed (straight moves, rounded), positive = oversize; only with `detail: full`.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub diameter_error_compensated_um: Option<Vec<Option<f64>>>,
    /// Standard uncertainty of the diameter from those of force and stiffness; only with `detail: full`.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub diameter_uncertainty_um: Option<Vec<f64>>,
    /// Share of a stock deviation that one uncompensated cut leaves; only with `detail: full`.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub copying_factor: Option<Vec<Option<f64>>>,
    /// What becomes of the nominal command.
    pub status_uncompensated: Vec<StatusUncompensated>,
    /// What becomes of the compensated command.
    pub status_compensated: Vec<StatusCompensated>,
}

/// What becomes of the nominal command at a station.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum StatusUncompensated {
    /// A chip is cut.
    Ok,
    /// The tool does not reach the stock.
    NoContact,
    /// The system yields before a chip forms.
    NoCut,
}

/// What becomes of the compensated command at a station.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum StatusCompensated {
    /// The command gives the drawing's diameter.
    Ok,
    /// Nothing to be cut there.
    NoStock,
    /// No command gives the drawing's diameter: the axis moves aside by more than the radius.
    NoSolution,
    /// The command would lie beyond the axis.
    ToolPastAxis,
}

impl StatusUncompensated {
    /// Its name, as in the contract.
    pub fn name(self) -> &'static str {
        match self {
            Self::Ok => "ok",
            Self::NoContact => "no_contact",
            Self::NoCut => "no_cut",
        }
    }
}

impl StatusCompensated {
    /// Its name, as in the contract.
    pub fn name(self) -> &'static str {
        match self {
            Self::Ok => "ok",
            Self::NoStock => "no_stock",
            Self::NoSolution => "no_solution",
            Self::ToolPastAxis => "tool_past_axis",
        }
    }
}

/// The commanded path in straight moves.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Path {
    /// One polyline for every turned zone, along the shaft; a new one wherever the command may jump.
    pub zones: Vec<PathZone>,
    /// Moves in all zones.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub moves: u32,
    /// Largest radial deviation allowed between moves and computed path, before rounding.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub chord_tolerance_um: f64,
    /// Largest radial deviation of the rounded moves from the computed path at any station.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub achieved_deviation_um: Option<f64>,
    /// Whether every station has a command; only then there is a program.
    pub complete: bool,
}

/// Polyline of one zone of constant drawing diameter, or of a part of it between jumps.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct PathZone {
    /// Drawing diameter of the zone.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub diameter_mm: f64,
    /// Vertices along the shaft.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub z_mm: Vec<f64>,
    /// Commanded diameters at the vertices, rounded to the increment.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub commanded_diameter_mm: Vec<f64>,
    /// Change of X on the diameter against the drawing at the vertices, for a compensation memory.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub delta_x_um: Vec<f64>,
}

/// Who yields how much, at the station of the largest deflection; the shares add up to 1.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Shares {
    /// The station.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub z_mm: f64,
    /// Bending and shear of the shaft.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub work: f64,
    /// The leftmost support that carries.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub headstock: f64,
    /// The rightmost support that carries, where it is another.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub tailstock: f64,
    /// All other supports that touch there.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub rests: f64,
    /// Carriage and tool.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub tool: f64,
}

/// Effects of second order: the largest change of the diameter along the shaft, whether acting or not;
/// null where the job does not give what the estimate needs.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct SecondOrder {
    /// Bending across the radial direction under the main force.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub tangential_um: Option<f64>,
    /// Moment of the feed force.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub axial_moment_um: Option<f64>,
    /// Sag under the shaft's own weight.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub weight_um: Option<f64>,
    /// Blank's stiffness where the tool has yet to pass.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub partly_turned_um: Option<f64>,
    /// Shear deformation.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub shear_um: Option<f64>,
    /// Axial thrust, of the feed and of the tailstock, over the buckling load.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub thrust_ratio: Option<f64>,
}

/// One support more, as compliant as the stiffest carrying one, where the shaft deflects most.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct OneMoreRest {
    /// A bilateral steady rest; a centre, the tailstock's, where the end that deflects most is free.
    pub kind: AddedSupport,
    /// Where it would stand.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub z_mm: f64,
    /// Its compliance in this estimate.
    #[schema(extensions(("x-unit" = json!("um/N"))))]
    pub compliance_um_per_n: f64,
    /// Form error without compensation that it would leave.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub form_error_um: f64,
}

/// What is put under a shaft.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum AddedSupport {
    /// A steady rest.
    SteadyRest,
    /// A centre at a free end.
    Centre,
}

/// The paper's one-step formula t_calc = a + y i (`deflection/4.3`), and what it leaves.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct OneStep {
    /// Factor i on the deflection; null where nothing is cut.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub factor: Vec<Option<f64>>,
    /// Commanded depth of the formula.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub depth_mm: Vec<Option<f64>>,
    /// Diameter error that this command leaves, negative = undersize.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub diameter_error_um: Vec<Option<f64>>,
    /// What the formula leaves in the paper's own model, where the force belongs to the commanded depth (radius).
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub residual_commanded_model_um: Vec<Option<f64>>,
    /// Depth that solves the paper's own model; null where it has no solution or the law is no power law.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub depth_commanded_model_mm: Vec<Option<f64>>,
}

/// One pass of several.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct PassOutcome {
    /// Diameter that the pass aims at.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub diameter_mm: f64,
    /// Whether the path of the pass is compensated.
    pub compensated: bool,
    /// Diameter that the pass leaves, station by station.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub produced_diameter_mm: Vec<f64>,
    /// Diameter error against the aim of the pass.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub diameter_error_um: Vec<f64>,
    /// Commanded diameter.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub commanded_diameter_mm: Vec<Option<f64>>,
    /// Share of the stock's deviation that the pass leaves, at its own command.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub copying_factor: Vec<Option<f64>>,
    /// Largest minus smallest diameter error.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub form_error_um: f64,
    /// Copying factors of this and all passes before, multiplied: what is left of a deviation of the blank.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub copied_so_far: Vec<Option<f64>>,
    /// The path of the pass in straight moves, as programmed; only with `detail: full`.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub path: Option<Path>,
}
