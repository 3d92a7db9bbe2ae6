//! What the drawing allows of diameters, where within that they are aimed at, and how sure what goes in is.

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use super::quantities::{DeflectionCorrelation, DeflectionUncertainQuantity};
use crate::effects::JointUncertainty;

/// What the drawing allows, on the diameter.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct Tolerance {
    /// Tolerance of form: largest minus smallest diameter along the shaft.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.01, maximum = 100_000.0, example = 20.0, extensions(("x-unit" = json!("um")), ("x-symbol" = json!("T_f")), ("x-group" = json!("workpiece"))))]
    pub form_um: Option<f64>,
    /// Tolerance of size: the diameter may deviate by plus or minus half of it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.01, maximum = 100_000.0, example = 40.0, extensions(("x-unit" = json!("um")), ("x-symbol" = json!("T_d")), ("x-group" = json!("workpiece"))))]
    pub diameter_um: Option<f64>,
    /// Upper limit of the diameter's deviation, in place of a tolerance to both sides: 0 of an h.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = -100_000.0, maximum = 100_000.0, example = 0.0, extensions(("x-unit" = json!("um")), ("x-symbol" = json!("es")), ("x-group" = json!("workpiece"))))]
    pub diameter_upper_um: Option<f64>,
    /// Lower limit of the diameter's deviation: -16 of an h6 of 40 mm.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = -100_000.0, maximum = 100_000.0, example = -16.0, extensions(("x-unit" = json!("um")), ("x-symbol" = json!("ei")), ("x-group" = json!("workpiece"))))]
    pub diameter_lower_um: Option<f64>,
}

/// Limits of the diameter's deviation.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct SizeLimits {
    pub(crate) lower_um: Option<f64>,
    pub(crate) upper_um: Option<f64>,
}

impl SizeLimits {
    /// Half of the room between them, where both are there.
    pub(crate) fn half_width_um(self) -> Option<f64> {
        Some(0.5 * (self.upper_um? - self.lower_um?))
    }

    /// The middle of them, where both are there.
    pub(crate) fn middle_um(self) -> Option<f64> {
        Some(0.5 * (self.upper_um? + self.lower_um?))
    }
}

impl Tolerance {
    /// The limits of size.
    pub(crate) fn size(&self) -> SizeLimits {
        match self.diameter_um {
            Some(whole) => SizeLimits { lower_um: Some(-0.5 * whole), upper_um: Some(0.5 * whole) },
            None => SizeLimits { lower_um: self.diameter_lower_um, upper_um: self.diameter_upper_um },
        }
    }

    /// The field that limits the size; `None` where none does.
    pub(crate) fn size_pointer(&self) -> Option<&'static str> {
        if self.diameter_um.is_some() {
            Some("/tolerance/diameter_um")
        } else if self.diameter_upper_um.is_some() {
            Some("/tolerance/diameter_upper_um")
        } else {
            self.diameter_lower_um.map(|_| "/tolerance/diameter_lower_um")
        }
    }

    /// Whether the largest and the smallest error, um, are within all of it.
    pub(crate) fn holds(&self, [largest, smallest]: [f64; 2]) -> bool {
        let size = self.size();
        size.upper_um.is_none_or(|upper| largest <= upper)
            && size.lower_um.is_none_or(|lower| smallest >= lower)
            && self.form_um.is_none_or(|form| largest - smallest <= form)
    }

    /// Whether nothing is limited.
    pub(crate) fn is_none(&self) -> bool {
        self.form_um.is_none() && self.size_pointer().is_none()
    }
}

/// Where within its limits a diameter is aimed at.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
pub enum Aim {
    /// At the drawing's diameter.
    Nominal {},
    /// At the middle of the limits.
    Middle {},
    /// Where a part is good most probably.
    MostProbable {},
    /// Where what is lost by parts that are too large and too small costs least.
    LeastLoss {
        /// What a part that is too large costs, as rework; in any money.
        #[schema(minimum = 0.0, maximum = 1_000_000_000.0, example = 3.0, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("c_o"))))]
        oversize_cost: f64,
        /// What a part that is too small costs, as scrap; in the same money.
        #[schema(minimum = 0.0, maximum = 1_000_000_000.0, example = 40.0, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("c_u"))))]
        undersize_cost: f64,
    },
}

impl Default for Aim {
    fn default() -> Self {
        Self::Nominal {}
    }
}

/// Standard uncertainties of what goes in; what comes out carries theirs.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct Uncertainty {
    /// Of the cutting force, relative, one standard deviation.
    #[serde(default = "ten_percent")]
    #[schema(minimum = 0.0, maximum = 100.0, default = 10.0, example = 10.0, extensions(("x-unit" = json!("percent")), ("x-symbol" = json!("u_F"))))]
    pub force_percent: f64,
    /// Of the compliance of shaft, supports and carriage, relative, one standard deviation.
    #[serde(default = "ten_percent")]
    #[schema(minimum = 0.0, maximum = 100.0, default = 10.0, example = 10.0, extensions(("x-unit" = json!("percent")), ("x-symbol" = json!("u_W"))))]
    pub stiffness_percent: f64,
    /// What else is uncertain, or how force and stiffness are; what is named here takes the place of the two above.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schema(max_items = 11, extensions(("x-advanced" = json!(true))))]
    pub quantities: Vec<DeflectionUncertainQuantity>,
    /// Which of them go together.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schema(max_items = 55, extensions(("x-advanced" = json!(true))))]
    pub correlations: Vec<DeflectionCorrelation>,
    /// What is not known of the effects of the job, as a diagnosis leaves it; a stored model brings its own. It takes the
    /// place of what is usual of the same.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schema(max_items = 256, extensions(("x-advanced" = json!(true))))]
    pub effects: Vec<JointUncertainty>,
    /// Whether what is usual is uncertain, too, where nothing is said of it: force, stiffness and the tool's setting.
    #[serde(default = "yes")]
    #[schema(default = true, example = true)]
    pub defaults: bool,
    /// With what parts are measured; the answer says then which readings to accept.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub measurement: Option<GaugeUncertainty>,
    /// Probability of a good part that is wanted; below it the answer warns.
    #[serde(default = "nineteen_of_twenty")]
    #[schema(exclusive_minimum = 0.0, exclusive_maximum = 1.0, default = 0.95, example = 0.95, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("P"))))]
    pub wanted_probability: f64,
    /// Parts of one set-up.
    #[serde(default = "hundred")]
    #[schema(minimum = 1, maximum = 1_000_000, default = 100, example = 100, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("n"))))]
    pub parts_per_setup: u32,
    /// Seed of the points over which probabilities are integrated.
    #[serde(default = "one")]
    #[schema(minimum = 0, maximum = 100_000_000, default = 1, example = 1, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("seed"))))]
    pub seed: u32,
}

/// With what parts are measured.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct GaugeUncertainty {
    /// Standard uncertainty of a reading of a diameter; its error is the same for all readings of a part.
    #[schema(exclusive_minimum = 0.0, maximum = 1000.0, example = 1.2, extensions(("x-unit" = json!("um")), ("x-symbol" = json!("u_m"))))]
    pub standard_uncertainty_um: f64,
}

fn yes() -> bool {
    true
}

fn nineteen_of_twenty() -> f64 {
    0.95
}

fn hundred() -> u32 {
    100
}

fn one() -> u32 {
    1
}

fn ten_percent() -> f64 {
    10.0
}

impl Default for Uncertainty {
    fn default() -> Self {
        Self {
            force_percent: ten_percent(),
            stiffness_percent: ten_percent(),
            quantities: Vec::new(),
            correlations: Vec::new(),
            effects: Vec::new(),
            measurement: None,
            defaults: yes(),
            wanted_probability: nineteen_of_twenty(),
            parts_per_setup: hundred(),
            seed: one(),
        }
    }
}
