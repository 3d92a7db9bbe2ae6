//! Fields of the job.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::calculator::Dialect;
use crate::deflection_compensation::{Carriage, Gravity, Holding, Segment, Shaft, Support, Theory};
use crate::diameters::{Asked, Draw, Tolerance, Uncertainty};
use crate::effects::{DeflectionConditions, DeflectionEffect};
use crate::force::ForceModel;

use super::mode::{Mode, Refeed};
use super::reading::Reading;

/// A program for a lathe, and what is asked of it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
#[schema(title = "ProgramCompensationJob")]
pub struct Job {
    /// The program as it is, with its line ends; as a file part of `multipart/form-data`, its bytes.
    #[schema(min_length = 1, max_length = 8_000_000, example = "%\nO0042\nN10 G21 G18 G40 G99\n", extensions(("x-text-file" = json!("reading/encoding"))))]
    pub nc_program: String,
    /// The control that the program is for. It is never guessed.
    #[schema(example = "fanuc_a")]
    pub dialect: Dialect,
    /// How the control reads what the program does not say.
    #[serde(default)]
    pub reading: Reading,
    /// What is asked.
    pub mode: Mode,
    /// Where program zero is on the work, from its headstock end. Needed with `stock`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = -100_000.0, maximum = 100_000.0, example = 400.0, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("Z_0")), ("x-group" = json!("workpiece"))))]
    pub program_zero_z_mm: Option<f64>,
    /// The blank. With it the answer says which surface the program leaves on work and machine that do not yield, which line makes
    /// which part of it, and whether a rapid move goes through the stock.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(extensions(("x-group" = json!("workpiece"))))]
    pub stock: Option<ProgramStock>,
    /// The part of the drawing from the headstock end; a place twice is a step. With it the answer says how far the program is off it on
    /// work and machine that do not yield; it is corrected to it where `mode.correct_to` says so.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schema(max_items = 1000, extensions(("x-group" = json!("workpiece")), ("x-advanced" = json!(true))))]
    pub drawing: Vec<StockRow>,
    /// What the drawing allows, on the diameter, all along the contour that the program makes. With it, and with `force`, the answer says
    /// how probable it is that a part keeps it.
    #[serde(default)]
    #[schema(extensions(("x-group" = json!("limits"))))]
    pub tolerance: Tolerance,
    /// How sure what goes in is; of use with `tolerance`.
    #[serde(default)]
    #[schema(extensions(("x-group" = json!("numerics")), ("x-advanced" = json!(true))))]
    pub uncertainty: Uncertainty,
    /// The tools that cut. Needed with `stock`.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schema(max_items = 100, extensions(("x-group" = json!("cut"))))]
    pub tools: Vec<ProgramTool>,
    /// What the feeds are bounded by that the modes `refeed` and `both` write.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(extensions(("x-group" = json!("limits"))))]
    pub refeed: Option<Refeed>,
    /// How cutting forces follow from depth, feed and speed. With it the answer says what the program leaves where work and
    /// machine yield. Nose and edge of Kienzle's law are those of the tool that cuts.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(extensions(("x-group" = json!("cut"))))]
    pub force: Option<ForceModel>,
    /// What holds it, from the headstock on: two centres, a chuck, rests.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schema(max_items = 8, extensions(("x-group" = json!("machine"))))]
    pub supports: Vec<Support>,
    /// Supports that act in some lines only: a centre or a rest that comes by an M code.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schema(max_items = 32, extensions(("x-group" = json!("machine")), ("x-advanced" = json!(true))))]
    pub support_lines: Vec<SupportLines>,
    /// Where no tool may come: jaws, rests, a centre. A program that does so is told, and not corrected.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schema(max_items = 16, extensions(("x-group" = json!("machine")), ("x-advanced" = json!(true))))]
    pub keep_out: Vec<KeepOut>,
    /// Compliance of carriage and tool.
    #[serde(default)]
    #[schema(extensions(("x-group" = json!("machine"))))]
    pub carriage: Carriage,
    /// Which parts of the base physics act beside the passive force.
    #[serde(default)]
    #[schema(extensions(("x-group" = json!("numerics"))))]
    pub include: ProgramInclude,
    /// Direction and size of gravity, for `include.weight`.
    #[serde(default)]
    #[schema(extensions(("x-group" = json!("machine")), ("x-advanced" = json!(true))))]
    pub gravity: Gravity,
    /// Named physical effects that act beside the base model; a kind occurs once.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schema(max_items = 22, extensions(("x-group" = json!("effects"))))]
    pub effects: Vec<DeflectionEffect>,
    /// The state that effects depend on.
    #[serde(default)]
    #[schema(extensions(("x-group" = json!("effects"))))]
    pub conditions: DeflectionConditions,
}

impl Job {
    /// Whether a support acts in a line of the program.
    pub(crate) fn acts(&self, support: u32, line: usize) -> bool {
        let mut told = self.support_lines.iter().filter(|told| told.support == support);
        told.all(|told| {
            told.from_line.is_none_or(|from| from as usize <= line) && told.to_line.is_none_or(|to| line <= to as usize)
        })
    }

    /// What it asks of the diameters that it makes.
    pub(crate) fn asked(&self) -> Asked<'_> {
        let Self { tolerance, uncertainty, effects, .. } = self;
        Asked { tolerance, uncertainty, effects, open_aim_um: None, places_over_mm: None }
    }

    /// What holds the blank and what pushes it, where the job says by which forces.
    pub(crate) fn holding(&self) -> Option<Holding> {
        let (stock, force) = self.stock.as_ref().zip(self.force.as_ref())?;
        Some(Holding {
            shaft: stock.shaft(),
            supports: self.supports.clone(),
            carriage: self.carriage.clone(),
            force: force.clone(),
            tangential: self.include.tangential,
            axial_moment: self.include.axial_moment,
            weight: self.include.weight,
            gravity: self.gravity.clone(),
            effects: self.effects.clone(),
            conditions: self.conditions.clone(),
            draw: Draw::STATED,
        })
    }

    /// Takes the elastic constants of the blank from its material, and what follows from other fields of forces and supports.
    pub(crate) fn fill(&mut self) {
        if let Some(stock) = &mut self.stock {
            let mut shaft = stock.shaft();
            let is_asked = shaft.material.is_some() || shaft.youngs_modulus_n_per_mm2.is_some();
            shaft.fill();
            if is_asked {
                stock.material = None;
                stock.youngs_modulus_n_per_mm2 = shaft.youngs_modulus_n_per_mm2;
                stock.poisson_ratio = shaft.poisson_ratio;
                stock.density_kg_per_m3 = shaft.density_kg_per_m3;
            }
        }
        if let Some(force) = &mut self.force {
            force.fill();
        }
    }
}

/// Which parts of the base physics act beside the passive and the feed force across the axis.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct ProgramInclude {
    /// The main force bends the shaft across the radial direction.
    #[serde(default)]
    #[schema(default = false, example = true)]
    pub tangential: bool,
    /// The axial force bends the shaft by its moment about the axis.
    #[serde(default)]
    #[schema(default = false, example = true)]
    pub axial_moment: bool,
    /// The shaft sags under its own weight.
    #[serde(default)]
    #[schema(default = false, example = true)]
    pub weight: bool,
}

/// The lines in which a support acts; what lies before and behind them is cut without it.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct SupportLines {
    /// Place of the support in `supports`, from 0.
    #[schema(minimum = 0, maximum = 7, example = 1, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("i"))))]
    pub support: u32,
    /// First line in which it acts.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 1, maximum = 200_000, example = 12, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("N_1"))))]
    pub from_line: Option<u32>,
    /// Last line in which it acts.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 1, maximum = 200_000, example = 40, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("N_2"))))]
    pub to_line: Option<u32>,
}

/// A cylinder about the axis in which no tool may come.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct KeepOut {
    /// Where it begins, from the headstock end.
    #[schema(minimum = -100_000.0, maximum = 100_000.0, example = 0.0, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("x_1"))))]
    pub z_start_mm: f64,
    /// Where it ends.
    #[schema(minimum = -100_000.0, maximum = 100_000.0, example = 15.0, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("x_2"))))]
    pub z_end_mm: f64,
    /// Diameter.
    #[schema(minimum = 0.01, maximum = 10_000.0, example = 120.0, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("D"))))]
    pub diameter_mm: f64,
    /// The support that it belongs to, by its place in `supports`, from 0: it stands there in the lines in which that acts. Left out,
    /// it always does.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0, maximum = 7, example = 1, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("i"))))]
    pub support: Option<u32>,
}

/// The blank.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct ProgramStock {
    /// Its outline from the headstock end; a place twice is a step.
    #[schema(min_items = 2, max_items = 1000, extensions(("x-code" = json!("stock_without_length"))))]
    pub profile: Vec<StockRow>,
    /// Diameter of the bore, 0 for solid.
    #[serde(default)]
    #[schema(minimum = 0.0, maximum = 10_000.0, default = 0.0, example = 0.0, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("d_in")), ("x-code" = json!("bad_bore"))))]
    pub bore_diameter_mm: f64,
    /// Name in the material library; gives the elastic constants that are not stated. The echoed job has the numbers.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(example = "steel_45", max_length = 64, extensions(("x-library" = json!("materials"))))]
    pub material: Option<String>,
    /// Young's modulus; needed where no material is named.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 1000.0, maximum = 2_000_000.0, example = 210_000.0, extensions(("x-unit" = json!("N/mm2")), ("x-symbol" = json!("E")), ("x-code" = json!("bad_modulus"))))]
    pub youngs_modulus_n_per_mm2: Option<f64>,
    /// Poisson's ratio; of the material, or 0.3. It acts with `theory` Timoshenko.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(exclusive_minimum = -1.0, exclusive_maximum = 0.5, example = 0.3, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("nu")), ("x-code" = json!("bad_poisson"))))]
    pub poisson_ratio: Option<f64>,
    /// Density; of the material, or 7850. It acts with `include.weight`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 1.0, maximum = 30_000.0, example = 7850.0, extensions(("x-unit" = json!("kg/m3")), ("x-symbol" = json!("rho"))))]
    pub density_kg_per_m3: Option<f64>,
    /// Beam theory.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(example = "euler_bernoulli")]
    pub theory: Option<Theory>,
}

impl ProgramStock {
    /// The blank as a shaft: a segment between any two places of its outline.
    pub(crate) fn shaft(&self) -> Shaft {
        let first = self.profile.first().map_or(0.0, |row| row.z_mm);
        let ends = [(0.0, first)].into_iter().chain(self.profile.windows(2).map(|pair| (pair[0].z_mm, pair[1].z_mm)));
        let diameter_mm = self.profile.iter().map(|row| row.diameter_mm).fold(f64::INFINITY, f64::min);
        let segments = ends.filter(|(from, to)| to > from).map(|(from, to)| Segment {
            length_mm: to - from,
            diameter_mm,
            stock_diameter_mm: None,
            bore_diameter_mm: self.bore_diameter_mm,
        });
        Shaft {
            segments: segments.collect(),
            material: self.material.clone(),
            youngs_modulus_n_per_mm2: self.youngs_modulus_n_per_mm2,
            poisson_ratio: self.poisson_ratio,
            density_kg_per_m3: self.density_kg_per_m3,
            yield_strength_n_per_mm2: None,
            theory: self.theory,
            section: None,
        }
    }
}

/// A point of the outline of a blank.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct StockRow {
    /// Station from the headstock end.
    #[schema(minimum = 0.0, maximum = 100_000.0, example = 400.0, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("x"))))]
    pub z_mm: f64,
    /// Diameter.
    #[schema(minimum = 0.01, maximum = 10_000.0, example = 30.0, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("2 R"))))]
    pub diameter_mm: f64,
}

/// A tool as it stands in the turret.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
#[schema(as = ProgramTool)]
pub struct ProgramTool {
    /// What the program calls it: its number, or its name where the control has names.
    #[schema(min_length = 1, max_length = 64, example = "1")]
    pub number: String,
    /// Radius of the nose; 0 for a corner.
    #[schema(minimum = 0.0, maximum = 100.0, example = 0.8, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("r_e"))))]
    pub nose_radius_mm: f64,
    /// Angle of the leading edge, from the axis.
    #[schema(minimum = 5.0, maximum = 135.0, example = 95.0, extensions(("x-unit" = json!("deg")), ("x-symbol" = json!("kappa"))))]
    pub cutting_edge_angle_deg: f64,
    /// Angle of the trailing edge, from the axis.
    #[schema(minimum = 1.0, maximum = 120.0, example = 5.0, extensions(("x-unit" = json!("deg")), ("x-symbol" = json!("kappa'"))))]
    pub minor_edge_angle_deg: f64,
    /// Which point of the tool the program moves: 3 the corner toward headstock and axis (a right-hand tool), 4 that toward
    /// tailstock and axis (a left-hand tool), 8 the lowest point, 0 and 9 the centre of the nose.
    #[schema(minimum = 0, maximum = 9, example = 3, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("T"))))]
    pub tip_direction: u8,
    /// Length of its edges from the corner that they would have without a nose, as in ISO 1832. With it a cut that goes on beyond
    /// the end of the edge is told, and the tool comes into a place of `keep_out` no farther than its edges reach.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.1, maximum = 1000.0, example = 12.0, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("l")), ("x-advanced" = json!(true))))]
    pub edge_length_mm: Option<f64>,
}
