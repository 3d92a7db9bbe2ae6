//! The sets of machinability models that come with the engine.

use super::{MachinabilityModel, ModelForm, ModelRange};
use crate::material::Certainty;
use serde::Serialize;
use utoipa::ToSchema;

/// A set of models of one material and one tool.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, ToSchema)]
pub struct ModelSet {
    /// Name in a job; never changes its meaning.
    #[schema(example = "vt9_tk20")]
    pub id: &'static str,
    /// A few words for a list.
    pub title: &'static str,
    /// Insert and grade that the trials were cut with.
    pub tool: &'static str,
    /// What is doubtful about the source.
    pub caveat: &'static str,
    /// The models.
    pub models: &'static [LibraryModel],
}

/// A model of the library: c_0 and the coefficients of ln V, ln S, ln t, ln phi.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, ToSchema)]
pub struct LibraryModel {
    /// The output's field in `models`, or its name among the further ones.
    #[schema(example = "roughness")]
    pub output: &'static str,
    /// Unit of the output.
    #[schema(example = "um")]
    pub unit: &'static str,
    /// Form in which the polynomial acts.
    pub form: ModelForm,
    /// Constant.
    #[schema(example = 2.3, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("c_0"))))]
    pub constant: f64,
    /// Coefficient of ln V.
    #[schema(example = -0.21, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("a_V"))))]
    pub speed_exponent: f64,
    /// Coefficient of ln S.
    #[schema(example = 0.78, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("a_S"))))]
    pub feed_exponent: f64,
    /// Coefficient of ln t.
    #[schema(example = 0.15, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("a_t"))))]
    pub depth_exponent: f64,
    /// Coefficient of ln phi.
    #[schema(example = 0.31, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("a_phi"))))]
    pub angle_exponent: f64,
    /// Where the numbers come from.
    pub source: &'static str,
    /// How certain the form is in which they are read.
    pub certainty: Certainty,
}

impl LibraryModel {
    /// The model as it stands in a job.
    pub fn model(&self) -> MachinabilityModel {
        MachinabilityModel {
            form: self.form,
            constant: self.constant,
            speed_exponent: self.speed_exponent,
            feed_exponent: self.feed_exponent,
            depth_exponent: self.depth_exponent,
            angle_exponent: self.angle_exponent,
            range: Some(RANGE),
            source: Some(self.source.to_owned()),
            certainty: Some(self.certainty),
            ..MachinabilityModel::default()
        }
    }
}

/// All sets.
pub fn sets() -> &'static [ModelSet] {
    &SETS
}

/// The set of that id.
pub fn find_set(id: &str) -> Option<&'static ModelSet> {
    sets().iter().find(|set| set.id == id)
}

/// Ranges of the source paper's table 1.
const RANGE: ModelRange = ModelRange {
    least_speed_m_per_min: Some(10.0),
    largest_speed_m_per_min: Some(80.0),
    least_feed_mm_per_rev: Some(0.08),
    largest_feed_mm_per_rev: Some(0.4),
    least_depth_mm: Some(0.3),
    largest_depth_mm: Some(5.0),
    least_cutting_edge_angle_deg: Some(15.0),
    largest_cutting_edge_angle_deg: Some(105.0),
};

const VT9: &str = "turning of gas-turbine shafts of variable stiffness, table 2, VT9 with TK20 SNMP";
const KHN73: &str = "turning of gas-turbine shafts of variable stiffness, table 2, KhN73MBTYu-VD with TK25 SNMA";

const CAVEAT_VT9: &str = "The table's caption prints neither the form nor the fourth variable legibly and names VT6, its rows and the text VT9. \
    Read here: VT9; power laws, but hardening and its depth as they stand (as exponentials they would be 345 to 4919 % and above 1e16 um); \
    the fourth variable the major cutting edge angle in degrees. Tool life then spans 0.01 min to 640 days inside the stated ranges. \
    The machining error hardly reacts to feed and is never used as a limit.";
const CAVEAT_KHN73: &str = "The table's caption prints neither the form nor the fourth variable legibly. Read here: power laws, but hardening and \
    its depth as they stand; the fourth variable the major cutting edge angle in degrees (tool life of 10 to 60 min at 25 m/min needs 79 to 94). \
    Tool life rises with the tenth power of that angle, against common experience. The machining error hardly reacts to feed and is never used as a limit.";

const fn row(
    output: &'static str,
    unit: &'static str,
    form: ModelForm,
    c: [f64; 5],
    source: &'static str,
    certainty: Certainty,
) -> LibraryModel {
    LibraryModel {
        output,
        unit,
        form,
        constant: c[0],
        speed_exponent: c[1],
        feed_exponent: c[2],
        depth_exponent: c[3],
        angle_exponent: c[4],
        source,
        certainty,
    }
}

use Certainty::{Likely, ToBeChecked};
use ModelForm::{LogLog, SemiLog};

static SETS: [ModelSet; 2] = [
    ModelSet {
        id: "vt9_tk20",
        title: "Titanium alloy VT9, carbide TK20 SNMP",
        tool: "TK20 SNMP",
        caveat: CAVEAT_VT9,
        models: &[
            row("tool_life", "min", LogLog, [6.42, -3.87, -2.01, -0.99, 2.14], VT9, Likely),
            row("roughness", "um", LogLog, [2.3, -0.21, 0.78, 0.15, 0.31], VT9, Likely),
            row("cost", "rub", LogLog, [3.16, 0.73, 0.07, 0.31, -0.39], VT9, Likely),
            row("productivity", "1/min", LogLog, [-2.37, 0.22, 0.23, 0.001, 0.004], VT9, Likely),
            row("machining_error", "um", LogLog, [1.6, 0.25, -0.031, 0.036, 0.12], VT9, ToBeChecked),
            row("hardening", "percent", SemiLog, [8.66, -0.136, 0.61, 0.48, -0.022], VT9, ToBeChecked),
            row("hardening_depth", "um", SemiLog, [84.308, 2.223, -4.095, -7.749, -9.095], VT9, ToBeChecked),
        ],
    },
    ModelSet {
        id: "khn73mbtyu_tk25",
        title: "Nickel alloy KhN73MBTYu-VD, carbide TK25 SNMA",
        tool: "TK25 SNMA",
        caveat: CAVEAT_KHN73,
        models: &[
            row("tool_life", "min", LogLog, [-29.17, -4.26, -0.72, -0.56, 9.95], KHN73, Likely),
            row("roughness", "um", LogLog, [1.8, -0.33, 0.54, 0.027, 0.197], KHN73, Likely),
            row("cost", "rub", LogLog, [15.69, 0.42, -0.46, 0.13, -2.82], KHN73, Likely),
            row("productivity", "1/min", LogLog, [-2.81, 0.38, 0.39, 0.006, 0.027], KHN73, Likely),
            row("machining_error", "um", LogLog, [1.12, 0.14, -0.02, 0.044, 0.308], KHN73, ToBeChecked),
            row("hardening", "percent", SemiLog, [21.45, -0.74, -0.045, -0.453, -0.127], KHN73, ToBeChecked),
            row("hardening_depth", "um", SemiLog, [138.65, -1.01, -0.081, -0.39, -0.026], KHN73, ToBeChecked),
        ],
    },
];
