//! The job: a cutter, a cut, what yields on either side, and what is asked.

use serde::{Deserialize, Serialize};
use utoipa::openapi::schema::OneOfBuilder;
use utoipa::openapi::{RefOr, Schema};
use utoipa::{PartialSchema, ToSchema};

use crate::effects::MillingEffect;
use crate::fixture_stability::{Spindle, SpindlePoint, Vise};
use crate::force::choice;
use crate::receptance_fit::{Job as FitJob, ReceptanceFile, Residuals};

use super::super::model::Side;
use super::held::PartClamping;
use super::uncertain::MillingUncertainty;

/// A cutter in a cut, what yields of tool and workpiece, and what is to be known before it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
#[schema(title = "MillingStabilityJob")]
pub struct Job {
    /// The cutter.
    #[schema(extensions(("x-group" = json!("tool"))))]
    pub cutter: Cutter,
    /// How the force of an edge follows from the thickness of its chip.
    #[schema(extensions(("x-group" = json!("cut"))))]
    pub force: EdgeForce,
    /// The working point.
    #[schema(extensions(("x-group" = json!("cut"))))]
    pub cut: Cut,
    /// What yields of the tool in its spindle.
    #[schema(extensions(("x-group" = json!("machine"))))]
    pub tool: Yielding,
    /// What yields of the workpiece in its fixture.
    #[schema(extensions(("x-group" = json!("machine"))))]
    pub work: Yielding,
    /// What the spindle can give; without it power, torque and speed limit nothing.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(extensions(("x-group" = json!("machine"))))]
    pub spindle: Option<MillSpindle>,
    /// How the workpiece is held; needed by the analysis `clamping` alone.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(extensions(("x-group" = json!("machine"))))]
    pub clamping: Option<PartClamping>,
    /// Rubbing of the flank in the waves that it left, which damps slow cuts.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(extensions(("x-group" = json!("cut")), ("x-advanced" = json!(true))))]
    pub process_damping: Option<FlankRubbing>,
    /// A spindle speed that goes up and down as a sine.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(extensions(("x-group" = json!("machine")), ("x-advanced" = json!(true))))]
    pub speed_variation: Option<SpeedVariation>,
    /// What chips, and the surfaces that teeth meet, are taken about where teeth stand out.
    #[serde(default)]
    #[schema(default = json!("forced_motion"), example = "forced_motion", extensions(("x-group" = json!("numerics")), ("x-advanced" = json!(true))))]
    pub about: ChipsAbout,
    /// What is uncertain in it, and which probability is wanted; acts with the analysis `certainty`.
    #[serde(default)]
    #[schema(extensions(("x-group" = json!("cut"))))]
    pub uncertainty: MillingUncertainty,
    /// What is asked. Force, torque and power and the zeroth order are always told.
    #[serde(default = "usual_analyses")]
    #[schema(max_items = 8, default = json!(["verdict", "intervals"]), example = json!(["verdict", "intervals", "lobes"]), extensions(("x-group" = json!("numerics"))))]
    pub analyses: Vec<Asked>,
    /// What must be kept, and how deep is looked.
    #[serde(default)]
    #[schema(extensions(("x-group" = json!("numerics"))))]
    pub limits: CutLimits,
    /// The plane of the lobe diagram; what it leaves out is chosen around the working point.
    #[serde(default)]
    #[schema(extensions(("x-group" = json!("numerics"))))]
    pub lobes: LobePlane,
    /// Named physical effects that act beside the base model; a kind occurs once, of modes once for each mode.
    #[serde(default)]
    #[schema(max_items = 64, extensions(("x-group" = json!("effects"))))]
    pub effects: Vec<MillingEffect>,
}

fn usual_analyses() -> Vec<Asked> {
    vec![Asked::Verdict, Asked::Intervals]
}

/// A number of a list, with its unit and range.
macro_rules! number {
    ($name:ident, $about:literal, $unit:literal, $symbol:literal, $least:literal, $most:literal, $example:literal) => {
        #[doc = $about]
        #[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
        #[serde(transparent)]
        pub struct $name(pub f64);

        impl PartialSchema for $name {
            fn schema() -> RefOr<Schema> {
                let mut extensions = utoipa::openapi::extensions::Extensions::default();
                extensions.insert("x-unit".to_owned(), $unit.into());
                extensions.insert("x-symbol".to_owned(), $symbol.into());
                utoipa::openapi::schema::ObjectBuilder::new()
                    .schema_type(utoipa::openapi::schema::SchemaType::new(utoipa::openapi::schema::Type::Number))
                    .description(Some($about))
                    .minimum(Some($least))
                    .maximum(Some($most))
                    .examples([$example])
                    .extensions(Some(extensions))
                    .into()
            }
        }

        impl ToSchema for $name {}
    };
}
pub(super) use number;

number!(ToothPitch, "Angle from a tooth to the tooth before it, at the tip.", "deg", "theta_j", 0.1, 360.0, 90.0);
number!(ToothHelix, "Helix angle of one tooth.", "deg", "eta_j", -80.0, 80.0, 30.0);
number!(ToothOffset, "How far a tooth stands out or down.", "um", "rho_j", -1000.0, 1000.0, 10.0);
number!(CutWidth, "Width of a milled strip.", "mm", "a_e", 0.001, 5000.0, 8.0);
number!(DirectionPart, "Part of a direction along an axis of the fixture.", "1", "d", -1000.0, 1000.0, 1.0);

/// A cutter whose teeth may be uneven.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
#[schema(as = MillCutter)]
pub struct Cutter {
    /// Diameter over the tips.
    #[schema(minimum = 0.1, maximum = 5000.0, example = 31.75, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("D"))))]
    pub diameter_mm: f64,
    /// Number of teeth.
    #[schema(minimum = 1, maximum = 100, example = 2, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("z"))))]
    pub teeth: u32,
    /// Helix angle of all teeth; positive is a right hand helix on a right hand cutter.
    #[serde(default)]
    #[schema(minimum = -80.0, maximum = 80.0, default = 0.0, example = 30.0, extensions(("x-unit" = json!("deg")), ("x-symbol" = json!("eta"))))]
    pub helix_angle_deg: f64,
    /// Angle between edge and feed: 90 for a shoulder mill, 45 for a common face mill.
    #[serde(default = "right_angle")]
    #[schema(minimum = 1.0, maximum = 90.0, default = 90.0, example = 90.0, extensions(("x-unit" = json!("deg")), ("x-symbol" = json!("kappa"))))]
    pub cutting_edge_angle_deg: f64,
    /// Angle from each tooth to the tooth before it at the tip, one for each tooth; even where it is left out.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schema(max_items = 100, example = json!([70.0, 110.0, 70.0, 110.0]))]
    pub pitch_deg: Vec<ToothPitch>,
    /// Helix angle of each tooth, in place of that of all.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schema(max_items = 100, example = json!([35.0, 38.0]))]
    pub tooth_helix_angle_deg: Vec<ToothHelix>,
    /// How far each tooth stands out: run-out.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schema(max_items = 100, example = json!([0.0, 10.0]))]
    pub radial_offset_um: Vec<ToothOffset>,
    /// How far each tooth stands down; it matters where the cutting edge angle is not 90.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schema(max_items = 100, example = json!([0.0, 5.0]))]
    pub axial_offset_um: Vec<ToothOffset>,
}

fn right_angle() -> f64 {
    90.0
}

/// Force per millimetre of edge over the chip (`milling/2.3`).
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum EdgeForce {
    /// An edge force and a share of the chip.
    Mechanistic(MechanisticForce),
    /// A power of the chip for each direction (Kienzle).
    Kienzle(KienzleForce),
    /// One power of the chip, with radial and axial ratios: the law of the calculator of fixture stability.
    PowerLaw(PowerForce),
}

impl PartialSchema for EdgeForce {
    fn schema() -> RefOr<Schema> {
        RefOr::T(Schema::OneOf(
            OneOfBuilder::new()
                .description(Some("How the force of an edge follows from the thickness of its chip."))
                .item(choice("mechanistic", MechanisticForce::schema()))
                .item(choice("kienzle", KienzleForce::schema()))
                .item(choice("power_law", PowerForce::schema()))
                .build(),
        ))
    }
}

impl ToSchema for EdgeForce {
    fn schemas(schemas: &mut Vec<(String, RefOr<Schema>)>) {
        MechanisticForce::schemas(schemas);
        KienzleForce::schemas(schemas);
        PowerForce::schemas(schemas);
    }
}

/// An edge force and a share of the chip, each tangential, radial and axial.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
#[schema(as = MillMechanisticForce)]
pub struct MechanisticForce {
    /// Tangential force per area of the chip.
    #[schema(minimum = 0.001, maximum = 1e6, example = 1319.4, extensions(("x-unit" = json!("N/mm2")), ("x-symbol" = json!("K_tc"))))]
    pub tangential_n_per_mm2: f64,
    /// Radial force per area of the chip, away from the work.
    #[serde(default)]
    #[schema(minimum = -1e6, maximum = 1e6, default = 0.0, example = 788.8, extensions(("x-unit" = json!("N/mm2")), ("x-symbol" = json!("K_rc"))))]
    pub radial_n_per_mm2: f64,
    /// Axial force per area of the chip; positive lifts the workpiece.
    #[serde(default)]
    #[schema(minimum = -1e6, maximum = 1e6, default = 0.0, example = 150.0, extensions(("x-unit" = json!("N/mm2")), ("x-symbol" = json!("K_ac"))))]
    pub axial_n_per_mm2: f64,
    /// Tangential force of the edge itself.
    #[serde(default)]
    #[schema(minimum = 0.0, maximum = 1e5, default = 0.0, example = 25.0, extensions(("x-unit" = json!("N/mm")), ("x-symbol" = json!("K_te"))))]
    pub tangential_edge_n_per_mm: f64,
    /// Radial force of the edge itself.
    #[serde(default)]
    #[schema(minimum = -1e5, maximum = 1e5, default = 0.0, example = 30.0, extensions(("x-unit" = json!("N/mm")), ("x-symbol" = json!("K_re"))))]
    pub radial_edge_n_per_mm: f64,
    /// Axial force of the edge itself.
    #[serde(default)]
    #[schema(minimum = -1e5, maximum = 1e5, default = 0.0, example = 5.0, extensions(("x-unit" = json!("N/mm")), ("x-symbol" = json!("K_ae"))))]
    pub axial_edge_n_per_mm: f64,
}

/// A power of the chip for each direction.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
#[schema(as = MillKienzleForce)]
pub struct KienzleForce {
    /// Tangential force at a chip of 1 mm by 1 mm.
    #[schema(minimum = 0.001, maximum = 1e6, example = 1800.0, extensions(("x-unit" = json!("N/mm2")), ("x-symbol" = json!("k_c1.1"))))]
    pub tangential_n_per_mm2: f64,
    /// Tangential force goes with the power 1-m of the chip.
    #[schema(minimum = 0.0, exclusive_maximum = 1.0, example = 0.25, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("m_c"))))]
    pub tangential_exponent: f64,
    /// Radial force at a chip of 1 mm by 1 mm, away from the work.
    #[serde(default)]
    #[schema(minimum = -1e6, maximum = 1e6, default = 0.0, example = 600.0, extensions(("x-unit" = json!("N/mm2")), ("x-symbol" = json!("k_r1.1"))))]
    pub radial_n_per_mm2: f64,
    /// Radial force goes with the power 1-m of the chip.
    #[serde(default)]
    #[schema(minimum = 0.0, exclusive_maximum = 1.0, default = 0.0, example = 0.4, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("m_r"))))]
    pub radial_exponent: f64,
    /// Axial force at a chip of 1 mm by 1 mm; positive lifts the workpiece.
    #[serde(default)]
    #[schema(minimum = -1e6, maximum = 1e6, default = 0.0, example = 300.0, extensions(("x-unit" = json!("N/mm2")), ("x-symbol" = json!("k_a1.1"))))]
    pub axial_n_per_mm2: f64,
    /// Axial force goes with the power 1-m of the chip.
    #[serde(default)]
    #[schema(minimum = 0.0, exclusive_maximum = 1.0, default = 0.0, example = 0.4, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("m_a"))))]
    pub axial_exponent: f64,
    /// Below this chip the power is a straight line: no law is measured there.
    #[serde(default = "chip_floor")]
    #[schema(minimum = 0.0, maximum = 1.0, default = 0.005, example = 0.005, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("h_c"))))]
    pub chip_floor_mm: f64,
}

fn chip_floor() -> f64 {
    0.005
}

/// Tangential force C_p h^(1-k) H^(1-mu), radial and axial shares of it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
#[schema(as = MillPowerForce)]
pub struct PowerForce {
    /// Tangential force at 1 mm of chip thickness and 1 mm of depth.
    #[schema(minimum = 0.001, maximum = 1e6, example = 3000.0, extensions(("x-unit" = json!("N/mm2")), ("x-symbol" = json!("C_p"))))]
    pub coefficient: f64,
    /// The force goes with the power 1-k of the chip thickness.
    #[serde(default)]
    #[schema(minimum = 0.0, exclusive_maximum = 1.0, default = 0.0, example = 0.1, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("k"))))]
    pub chip_thickness_exponent: f64,
    /// The force goes with the power 1-mu of the depth.
    #[serde(default)]
    #[schema(minimum = 0.0, exclusive_maximum = 1.0, default = 0.0, example = 0.0, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("mu"))))]
    pub depth_exponent: f64,
    /// Radial over tangential force.
    #[serde(default = "radial_ratio")]
    #[schema(minimum = 0.0, maximum = 10.0, default = 0.6, example = 0.6, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("rho"))))]
    pub radial_ratio: f64,
    /// Axial over tangential force; positive lifts the workpiece.
    #[serde(default)]
    #[schema(minimum = -10.0, maximum = 10.0, default = 0.0, example = 0.3, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("rho_a"))))]
    pub axial_ratio: f64,
    /// Below this chip the power is a straight line: no law is measured there.
    #[serde(default = "chip_floor")]
    #[schema(minimum = 0.0, maximum = 1.0, default = 0.005, example = 0.005, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("h_c"))))]
    pub chip_floor_mm: f64,
}

fn radial_ratio() -> f64 {
    0.6
}

/// The working point: how wide by `width_mm`, or by the angles at which teeth enter and leave.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
#[schema(as = MillCut)]
pub struct Cut {
    /// Axial depth of cut.
    #[schema(minimum = 0.0, maximum = 1000.0, example = 1.5, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("H"))))]
    pub depth_mm: f64,
    /// Width of the milled strip; or give both angles.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.001, maximum = 5000.0, example = 15.875, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("a_e"))))]
    pub width_mm: Option<f64>,
    /// Other widths that may be cut, in the same way: the analysis `speeds` looks for the best of all of them.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schema(max_items = 11, example = json!([8.0, 12.0]))]
    pub widths_mm: Vec<CutWidth>,
    /// Where the strip lies: at the side at which teeth begin with no chip (up), end with none (down), or about the centre line.
    #[serde(default)]
    #[schema(default = "centred", example = "down")]
    pub milling: Milling,
    /// Centre line of a centred strip from the cutter's axis, positive toward the side where teeth enter.
    #[serde(default)]
    #[schema(minimum = -5000.0, maximum = 5000.0, default = 0.0, example = 0.0, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("e"))))]
    pub offset_mm: f64,
    /// Angle at which a tooth enters, from across the feed, growing with rotation; or give the width.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.0, maximum = 180.0, example = 90.0, extensions(("x-unit" = json!("deg")), ("x-symbol" = json!("phi_st"))))]
    pub entry_deg: Option<f64>,
    /// Angle at which it leaves.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.0, maximum = 180.0, example = 180.0, extensions(("x-unit" = json!("deg")), ("x-symbol" = json!("phi_ex"))))]
    pub exit_deg: Option<f64>,
    /// Spindle speed; or give the cutting speed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.1, maximum = 200_000.0, example = 9500.0, extensions(("x-unit" = json!("rev/min")), ("x-symbol" = json!("n")), ("x-code" = json!("bad_spindle_speed"))))]
    pub spindle_speed_rpm: Option<f64>,
    /// Cutting speed; or give the spindle speed. The echoed job has the spindle speed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.001, maximum = 20_000.0, example = 950.0, extensions(("x-unit" = json!("m/min")), ("x-symbol" = json!("V"))))]
    pub speed_m_per_min: Option<f64>,
    /// Mean feed per tooth; or give the table feed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.000_01, maximum = 10.0, example = 0.1, extensions(("x-unit" = json!("mm/tooth")), ("x-symbol" = json!("S_z")), ("x-code" = json!("bad_feed_per_tooth"))))]
    pub feed_mm_per_tooth: Option<f64>,
    /// Table feed; or give the feed per tooth. Where both are given they must agree to 1 %. The echoed job has the feed per tooth.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.000_1, maximum = 1e6, example = 1900.0, extensions(("x-unit" = json!("mm/min")), ("x-symbol" = json!("S"))))]
    pub feed_mm_per_min: Option<f64>,
    /// Direction of feed about the spindle, against the X of the fixture, in which modes are given.
    #[serde(default)]
    #[schema(minimum = -360.0, maximum = 360.0, default = 0.0, example = 0.0, extensions(("x-unit" = json!("deg")), ("x-symbol" = json!("alpha"))))]
    pub feed_direction_deg: f64,
}

/// Where the milled strip lies against the cutter.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
#[schema(as = MillingSense)]
pub enum Milling {
    /// Teeth begin with no chip.
    Up,
    /// Teeth end with no chip.
    Down,
    /// About the line of feed, moved by `offset_mm`.
    #[default]
    Centred,
}

impl Milling {
    /// Whether the strip lies at a side of the cutter, so that an offset says nothing.
    pub(in crate::milling_stability) fn is_at_a_side(self) -> bool {
        self != Self::Centred
    }
}

/// What chips are taken about.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum ChipsAbout {
    /// The motion that the chips force: which surface a tooth meets depends on it.
    #[default]
    ForcedMotion,
    /// Undisturbed chips.
    SmoothChips,
}

/// What yields of one side.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
pub enum Yielding {
    /// Modes at the cut.
    Modes(YieldingModes),
    /// Measured frequency responses at the cut, of which modes are made.
    Receptances(YieldingReceptances),
    /// A vise along the feed, as the calculator of fixture stability takes it.
    Vise(YieldingVise),
    /// Nothing.
    Rigid(NothingYields),
}

impl PartialSchema for Yielding {
    fn schema() -> RefOr<Schema> {
        RefOr::T(Schema::OneOf(
            OneOfBuilder::new()
                .description(Some("What yields of one side."))
                .item(choice("modes", YieldingModes::schema()))
                .item(choice("receptances", YieldingReceptances::schema()))
                .item(choice("vise", YieldingVise::schema()))
                .item(choice("rigid", NothingYields::schema()))
                .build(),
        ))
    }
}

impl ToSchema for Yielding {
    fn schemas(schemas: &mut Vec<(String, RefOr<Schema>)>) {
        YieldingModes::schemas(schemas);
        YieldingReceptances::schemas(schemas);
        YieldingVise::schemas(schemas);
        NothingYields::schemas(schemas);
    }
}

/// Modes at the cut.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct YieldingModes {
    /// In any order.
    #[schema(min_items = 1, max_items = 20)]
    pub modes: Vec<YieldingMode>,
}

/// Frequency responses at the cut, along X, Y and Z of the fixture: of one direction or several, with those across or without. A
/// direction without any counts as rigid.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct YieldingReceptances {
    /// What was measured: CSV, or universal files with datasets 58 and 58b.
    #[schema(min_items = 1, max_items = 16)]
    pub files: Vec<ReceptanceFile>,
    /// How many modes there are; as many as the lines ask for where it is left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 1, maximum = 20, example = 2, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("N")), ("x-advanced" = json!(true))))]
    pub modes: Option<u32>,
    /// Lines below it are left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.0, maximum = 1_000_000.0, example = 100.0, extensions(("x-unit" = json!("Hz")), ("x-symbol" = json!("f_1")), ("x-advanced" = json!(true))))]
    pub from_hz: Option<f64>,
    /// Lines above it are left out.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.0, maximum = 1_000_000.0, example = 2500.0, extensions(("x-unit" = json!("Hz")), ("x-symbol" = json!("f_2")), ("x-advanced" = json!(true))))]
    pub to_hz: Option<f64>,
    /// What modes beside the band leave in it.
    #[serde(default)]
    #[schema(default = "mass_and_stiffness", extensions(("x-advanced" = json!(true))))]
    pub residuals: Residuals,
}

impl YieldingReceptances {
    /// The same as the evaluation of frequency responses takes it.
    pub(in crate::milling_stability) fn fit_job(&self) -> FitJob {
        let Self { files, modes, from_hz, to_hz, residuals } = self;
        FitJob { files: files.clone(), modes: *modes, from_hz: *from_hz, to_hz: *to_hz, residuals: *residuals }
    }
}

/// A vise along the feed, as the calculator of fixture stability takes it.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct YieldingVise {
    /// The vise with the workpiece; one whose screw locks itself.
    pub fixture: Vise,
}

/// Nothing of this side yields.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct NothingYields {}

/// A mode: two of frequency, mass and stiffness, and one of damping ratio and damping.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct YieldingMode {
    /// Direction in which the cut moves, along X, Y and Z of the fixture; its length does not matter.
    #[schema(min_items = 3, max_items = 3, example = json!([1.0, 0.0, 0.0]))]
    pub direction: Vec<DirectionPart>,
    /// Natural frequency.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.001, maximum = 1e7, example = 456.8, extensions(("x-unit" = json!("Hz")), ("x-symbol" = json!("f"))))]
    pub frequency_hz: Option<f64>,
    /// Modal mass at the cut.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 1e-9, maximum = 1e9, example = 0.963, extensions(("x-unit" = json!("kg")), ("x-symbol" = json!("m"))))]
    pub mass_kg: Option<f64>,
    /// Modal stiffness at the cut.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 1e-6, maximum = 1e12, example = 7933.0, extensions(("x-unit" = json!("N/mm")), ("x-symbol" = json!("C"))))]
    pub stiffness_n_per_mm: Option<f64>,
    /// Share of critical damping.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.0, exclusive_maximum = 1.0, example = 0.03, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("zeta"))))]
    pub damping_ratio: Option<f64>,
    /// Modal damping at the cut.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.0, maximum = 1e9, example = 0.17, extensions(("x-unit" = json!("N s/mm")), ("x-symbol" = json!("lambda")), ("x-code" = json!("negative_damping"))))]
    pub damping_n_s_per_mm: Option<f64>,
}

/// What the spindle can give. What is stated for all speeds and what the table says both hold: the least counts.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct MillSpindle {
    /// Power of the motor, at every speed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 1e-6, maximum = 10_000.0, example = 15.0, extensions(("x-unit" = json!("kW")), ("x-symbol" = json!("P_max"))))]
    pub power_kw: Option<f64>,
    /// Torque at the spindle, at every speed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 1e-6, maximum = 1e7, example = 40.0, extensions(("x-unit" = json!("N m")), ("x-symbol" = json!("M_max"))))]
    pub torque_n_m: Option<f64>,
    /// Share of the motor's power that reaches the cutter.
    #[serde(default = "whole_power")]
    #[schema(exclusive_minimum = 0.0, maximum = 1.0, default = 1.0, example = 0.85, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("eta"))))]
    pub efficiency: f64,
    /// Power and torque over the spindle speed, by rising speed, straight lines between; nothing is known of speeds outside.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schema(max_items = 200)]
    pub characteristic: Vec<SpindlePoint>,
    /// Lowest speed that is looked at for better ones.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.1, maximum = 200_000.0, example = 3000.0, extensions(("x-unit" = json!("rev/min")), ("x-symbol" = json!("n_min"))))]
    pub speed_min_rpm: Option<f64>,
    /// Highest speed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.1, maximum = 200_000.0, example = 16_000.0, extensions(("x-unit" = json!("rev/min")), ("x-symbol" = json!("n_max"))))]
    pub speed_max_rpm: Option<f64>,
    /// Moment of inertia of all that turns; without it no varying speed is proposed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 1e-9, maximum = 1e6, example = 0.02, extensions(("x-unit" = json!("kg m2")), ("x-symbol" = json!("J"))))]
    pub inertia_kg_m2: Option<f64>,
    /// Largest angular acceleration.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 1e-3, maximum = 1e9, example = 2000.0, extensions(("x-unit" = json!("rad/s2")), ("x-symbol" = json!("alpha_max"))))]
    pub acceleration_max_rad_per_s2: Option<f64>,
}

fn whole_power() -> f64 {
    1.0
}

impl MillSpindle {
    /// What it gives, as the calculator of fixture stability asks for it.
    pub(in crate::milling_stability) fn drive(&self) -> Spindle {
        Spindle {
            power_kw: self.power_kw,
            torque_n_m: self.torque_n_m,
            efficiency: self.efficiency,
            characteristic: self.characteristic.clone(),
        }
    }
}

/// Rubbing of the flank (`milling/2.8`): the coefficient, or indentation and wear.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct FlankRubbing {
    /// K_w itself.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.0, maximum = 1e9, example = 800.0, extensions(("x-unit" = json!("N/mm")), ("x-symbol" = json!("K_w"))))]
    pub coefficient_n_per_mm: Option<f64>,
    /// Force per volume that the flank presses in.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.0, maximum = 1e9, example = 40_000.0, extensions(("x-unit" = json!("N/mm3")), ("x-symbol" = json!("K_sp"))))]
    pub indentation_n_per_mm3: Option<f64>,
    /// Width of the worn flank.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.0, maximum = 5.0, example = 0.08, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("w"))))]
    pub wear_land_mm: Option<f64>,
    /// Tangential over radial force of the flank.
    #[serde(default = "flank_friction")]
    #[schema(minimum = 0.0, maximum = 2.0, default = 0.3, example = 0.3, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("mu_w"))))]
    pub friction: f64,
    /// Where the coefficient comes from. Unless it was measured the limit without it is told, too.
    pub source: RubbingSource,
}

fn flank_friction() -> f64 {
    0.3
}

/// Where a coefficient comes from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum RubbingSource {
    /// From cuts with this tool in this material.
    Measured,
    /// From a book.
    Handbook,
    /// A guess.
    Assumed,
}

/// A spindle speed that goes up and down as a sine (`milling/4.18`).
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct SpeedVariation {
    /// Largest change over the mean speed.
    #[schema(exclusive_minimum = 0.0, exclusive_maximum = 0.5, example = 0.1, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("A"))))]
    pub amplitude: f64,
    /// How often it goes up and down.
    #[schema(minimum = 0.01, maximum = 1000.0, example = 50.0, extensions(("x-unit" = json!("Hz")), ("x-symbol" = json!("f_m"))))]
    pub frequency_hz: f64,
}

/// A question.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
#[schema(as = MillingQuestion)]
pub enum Asked {
    /// Stable, chattering, overloaded, or out of the limits of the surface.
    Verdict,
    /// Depths at which this speed is unstable, and which side limits.
    Intervals,
    /// Limiting depth over spindle speed.
    Lobes,
    /// The motion that the chips force, and the surface that it leaves.
    Motion,
    /// How hard the workpiece must be clamped so that it neither slips, opens nor lifts.
    Clamping,
    /// Better speeds, ranked by removal rate within all limits.
    Speeds,
    /// Other pitches, another helix, a varying speed, each tried at the working speed.
    Proposals,
    /// How probable it is that the cut stays quiet and every limit is kept, what makes that uncertain, and how deep one may cut with the
    /// wanted probability.
    Certainty,
}

/// What must be kept, and how deep is looked.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields, default)]
#[schema(as = MillingLimits)]
pub struct CutLimits {
    /// Greatest depth that is looked at; chosen from the zeroth-order limit where it is left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.001, maximum = 1000.0, example = 6.0, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("H_max"))))]
    pub depth_max_mm: Option<f64>,
    /// Even steps in which depths are looked at.
    #[schema(minimum = 8, maximum = 400, default = 24, example = 24, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("N_H"))))]
    pub depths: u32,
    /// How far a cut is to stay below chatter.
    #[schema(minimum = 0.0, maximum = 90.0, default = 10.0, example = 10.0, extensions(("x-unit" = json!("percent")), ("x-symbol" = json!("q"))))]
    pub margin_percent: f64,
    /// Largest peak-to-peak motion in any direction.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.001, maximum = 1e6, example = 40.0, extensions(("x-unit" = json!("um")), ("x-symbol" = json!("A_max"))))]
    pub amplitude_max_um: Option<f64>,
    /// Largest error of a wall, either way.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.001, maximum = 1e6, example = 20.0, extensions(("x-unit" = json!("um")), ("x-symbol" = json!("e_max"))))]
    pub surface_error_max_um: Option<f64>,
    /// Largest roughness Rz of a wall.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.001, maximum = 1e5, example = 6.3, extensions(("x-unit" = json!("um")), ("x-symbol" = json!("Rz_max"))))]
    pub roughness_max_um: Option<f64>,
}

impl Default for CutLimits {
    fn default() -> Self {
        Self {
            depth_max_mm: None,
            depths: 24,
            margin_percent: 10.0,
            amplitude_max_um: None,
            surface_error_max_um: None,
            roughness_max_um: None,
        }
    }
}

/// The plane of the lobe diagram.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields, default)]
pub struct LobePlane {
    /// Lowest spindle speed; that of the spindle or half the working speed where it is left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.1, maximum = 200_000.0, example = 3000.0, extensions(("x-unit" = json!("rev/min")), ("x-symbol" = json!("n_1"))))]
    pub from_rpm: Option<f64>,
    /// Highest spindle speed; that of the spindle or twice the working speed where it is left out.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.1, maximum = 200_000.0, example = 16_000.0, extensions(("x-unit" = json!("rev/min")), ("x-symbol" = json!("n_2"))))]
    pub to_rpm: Option<f64>,
    /// Spindle speeds of boundary and map.
    #[schema(minimum = 2, maximum = 2000, default = 200, example = 200, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("N_n"))))]
    pub speeds: u32,
    /// Depths of the map.
    #[schema(minimum = 2, maximum = 1000, default = 60, example = 60, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("N_H"))))]
    pub depths: u32,
    /// Whether the multiplier is computed over the whole plane, not the boundary alone.
    #[schema(default = false, example = true)]
    pub map: bool,
}

impl Default for LobePlane {
    fn default() -> Self {
        Self { from_rpm: None, to_rpm: None, speeds: 200, depths: 60, map: false }
    }
}

impl Job {
    /// Spindle speed of a job that states one of both speeds.
    pub(in crate::milling_stability) fn spindle_rpm(&self) -> Option<f64> {
        let by_speed = |v: f64| 1000.0 * v / (std::f64::consts::PI * self.cutter.diameter_mm);
        self.cut.spindle_speed_rpm.or_else(|| self.cut.speed_m_per_min.map(by_speed))
    }

    /// Feed per tooth of a job that states a feed.
    pub(in crate::milling_stability) fn feed_mm(&self) -> Option<f64> {
        self.cut.feed_mm_per_tooth.or_else(|| Some(self.feed_of_table_mm()?.0))
    }

    /// Feed per tooth by the table feed, and the table feed.
    pub(in crate::milling_stability) fn feed_of_table_mm(&self) -> Option<(f64, f64)> {
        let table = self.cut.feed_mm_per_min?;
        Some((table / (self.spindle_rpm()? * f64::from(self.cutter.teeth)), table))
    }

    pub(in crate::milling_stability) fn asks(&self, what: Asked) -> bool {
        self.analyses.contains(&what)
    }

    /// Whether a multiplier is asked for.
    pub(in crate::milling_stability) fn asks_stability(&self) -> bool {
        [Asked::Verdict, Asked::Intervals, Asked::Lobes, Asked::Speeds, Asked::Proposals]
            .into_iter()
            .any(|what| self.asks(what))
    }

    /// The job with each of the other widths in place of its own.
    pub(in crate::milling_stability) fn with_other_widths(&self) -> Vec<Self> {
        let own = self.cut.width_mm.unwrap_or(0.0);
        let others = self.cut.widths_mm.iter().map(|of| of.0).filter(|width| (width - own).abs() > 0.0);
        let with = |width_mm: f64| {
            let cut = Cut { width_mm: Some(width_mm), widths_mm: Vec::new(), ..self.cut.clone() };
            Self { cut, ..self.clone() }
        };
        others.map(with).collect()
    }

    /// Both sides with where they stand.
    pub(in crate::milling_stability) fn sides(&self) -> [(&'static str, Side, &Yielding); 2] {
        [("/tool", Side::Tool, &self.tool), ("/work", Side::Work, &self.work)]
    }

    /// One of both sides.
    pub(in crate::milling_stability) fn side_mut(&mut self, side: Side) -> &mut Yielding {
        match side {
            Side::Tool => &mut self.tool,
            Side::Work => &mut self.work,
        }
    }

    /// Whether a side is given by its frequency responses.
    pub(in crate::milling_stability) fn is_measured(&self) -> bool {
        self.sides().iter().any(|(.., yielding)| matches!(yielding, Yielding::Receptances(_)))
    }
}
