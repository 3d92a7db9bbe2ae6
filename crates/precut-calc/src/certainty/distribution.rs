//! How a quantity is distributed.

use serde::{Deserialize, Serialize};
use statrs::distribution::{ContinuousCDF, StudentsT};
use utoipa::ToSchema;

use crate::calculator::{Finding, Violations};

use super::normal_below;

/// Codes of the faults found here.
pub(crate) const CODES: &[&str] = &["unit_of_quantity", "normal_reaches_zero"];

/// Largest relative standard uncertainty of a normal factor, percent: beyond it the factor falls below 0 in more than 3e-5 of
/// all cases.
const LARGEST_NORMAL_PERCENT: f64 = 25.0;

/// How a quantity is distributed about what the job states (`certainty/1.1`). A factor has its width in percent, an addition
/// in the unit of what it adds to.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
pub enum Distribution {
    /// Normal about the stated value.
    Normal {
        /// Standard uncertainty of a factor; above 25 a lognormal one is needed, as this one would pass 0.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schema(minimum = 0.0, maximum = 100.0, example = 10.0, extensions(("x-unit" = json!("percent")), ("x-symbol" = json!("u"))))]
        standard_uncertainty_percent: Option<f64>,
        /// Standard uncertainty of an addition.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schema(minimum = 0.0, maximum = 100_000.0, example = 3.0, extensions(("x-unit" = json!("um")), ("x-symbol" = json!("u"))))]
        standard_uncertainty_um: Option<f64>,
        /// Standard uncertainty of an angle.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schema(minimum = 0.0, maximum = 10.0, example = 0.1, extensions(("x-unit" = json!("deg")), ("x-symbol" = json!("u"))))]
        standard_uncertainty_deg: Option<f64>,
    },
    /// A factor whose logarithm is normal; the stated value is its median.
    Lognormal {
        /// Standard deviation of the logarithm.
        #[schema(minimum = 0.0, maximum = 2.0, example = 0.1, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("s"))))]
        log_standard_deviation: f64,
    },
    /// Anything within a width to either side, evenly.
    Uniform {
        /// Half of the width of a factor.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schema(minimum = 0.0, maximum = 99.0, example = 15.0, extensions(("x-unit" = json!("percent")), ("x-symbol" = json!("w"))))]
        half_width_percent: Option<f64>,
        /// Half of the width of an addition.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schema(minimum = 0.0, maximum = 100_000.0, example = 60.0, extensions(("x-unit" = json!("um")), ("x-symbol" = json!("w"))))]
        half_width_um: Option<f64>,
        /// Half of the width of an angle.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schema(minimum = 0.0, maximum = 10.0, example = 0.2, extensions(("x-unit" = json!("deg")), ("x-symbol" = json!("w"))))]
        half_width_deg: Option<f64>,
    },
    /// The same, likelier toward the middle.
    Triangular {
        /// Half of the width of a factor.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schema(minimum = 0.0, maximum = 99.0, example = 15.0, extensions(("x-unit" = json!("percent")), ("x-symbol" = json!("w"))))]
        half_width_percent: Option<f64>,
        /// Half of the width of an addition.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schema(minimum = 0.0, maximum = 100_000.0, example = 60.0, extensions(("x-unit" = json!("um")), ("x-symbol" = json!("w"))))]
        half_width_um: Option<f64>,
        /// Half of the width of an angle.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schema(minimum = 0.0, maximum = 10.0, example = 0.2, extensions(("x-unit" = json!("deg")), ("x-symbol" = json!("w"))))]
        half_width_deg: Option<f64>,
    },
    /// Bounds alone: anything within a width to either side, with no distribution. The answer then has the least and the largest
    /// probability within them.
    Interval {
        /// Half of the width of a factor.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schema(minimum = 0.0, maximum = 99.0, example = 15.0, extensions(("x-unit" = json!("percent")), ("x-symbol" = json!("w"))))]
        half_width_percent: Option<f64>,
        /// Half of the width of an addition.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schema(minimum = 0.0, maximum = 100_000.0, example = 60.0, extensions(("x-unit" = json!("um")), ("x-symbol" = json!("w"))))]
        half_width_um: Option<f64>,
        /// Half of the width of an angle.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schema(minimum = 0.0, maximum = 10.0, example = 0.2, extensions(("x-unit" = json!("deg")), ("x-symbol" = json!("w"))))]
        half_width_deg: Option<f64>,
    },
    /// Student's, as few measured values give it.
    StudentT {
        /// Scale of an addition: its standard uncertainty but for the tails.
        #[schema(minimum = 0.0, maximum = 100_000.0, example = 3.0, extensions(("x-unit" = json!("um")), ("x-symbol" = json!("u"))))]
        standard_uncertainty_um: f64,
        /// Degrees of freedom.
        #[schema(minimum = 1.0, maximum = 1000.0, example = 4.0, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("nu"))))]
        degrees_of_freedom: f64,
    },
}

/// Among what a quantity varies.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
#[schema(as = UncertaintyLevel)]
pub enum Level {
    /// Unknown, but the same for all parts of a set-up: measuring one part tells of it.
    Setup,
    /// New for every part.
    Part,
    /// New at every place along every part, alike at places that are near each other.
    Place,
}

/// Where a distribution is from.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
#[schema(as = UncertaintySource)]
pub enum Source {
    /// Nobody stated it: what is usual.
    Default,
    /// The job states it.
    Stated,
    /// What the job has measured tells it.
    Measured,
    /// What a diagnosis leaves open of an effect of the job.
    Model,
}

/// In what the width of a quantity is given.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum WidthUnit {
    /// A factor.
    Percent,
    /// An addition.
    Um,
    /// An angle.
    Deg,
}

impl WidthUnit {
    fn name(self) -> &'static str {
        match self {
            Self::Percent => "percent",
            Self::Um => "um",
            Self::Deg => "deg",
        }
    }
}

impl Distribution {
    /// A normal factor.
    pub(crate) const fn normal_percent(percent: f64) -> Self {
        Self::Normal {
            standard_uncertainty_percent: Some(percent),
            standard_uncertainty_um: None,
            standard_uncertainty_deg: None,
        }
    }

    /// A normal addition.
    pub(crate) const fn normal_um(um: f64) -> Self {
        Self::Normal {
            standard_uncertainty_percent: None,
            standard_uncertainty_um: Some(um),
            standard_uncertainty_deg: None,
        }
    }

    /// A normal error of an angle.
    pub(crate) const fn normal_deg(deg: f64) -> Self {
        Self::Normal {
            standard_uncertainty_percent: None,
            standard_uncertainty_um: None,
            standard_uncertainty_deg: Some(deg),
        }
    }

    /// Finds what cannot be for a quantity whose width is given in `unit`.
    pub(crate) fn check(&self, unit: WidthUnit, pointer: &str, violations: &mut Violations) {
        let of = |percent: Option<f64>, um: Option<f64>, deg: Option<f64>| {
            let stated = [(WidthUnit::Percent, percent), (WidthUnit::Um, um), (WidthUnit::Deg, deg)];
            stated.iter().all(|(of, width)| width.is_some() == (*of == unit))
        };
        let fits = match *self {
            Self::Normal {
                standard_uncertainty_percent: percent,
                standard_uncertainty_um: um,
                standard_uncertainty_deg: deg,
            }
            | Self::Uniform { half_width_percent: percent, half_width_um: um, half_width_deg: deg }
            | Self::Triangular { half_width_percent: percent, half_width_um: um, half_width_deg: deg }
            | Self::Interval { half_width_percent: percent, half_width_um: um, half_width_deg: deg } => {
                of(percent, um, deg)
            }
            Self::Lognormal { .. } => unit == WidthUnit::Percent,
            Self::StudentT { .. } => unit == WidthUnit::Um,
        };
        violations.require(fits, || Finding::new("unit_of_quantity", pointer).with("expected", unit.name()));
        if let (true, Self::Normal { standard_uncertainty_percent: Some(percent), .. }) = (fits, self) {
            violations.require(*percent <= LARGEST_NORMAL_PERCENT, || {
                Finding::new("normal_reaches_zero", format!("{pointer}/standard_uncertainty_percent"))
                    .measured(*percent, LARGEST_NORMAL_PERCENT, "percent")
                    .within(0.0, LARGEST_NORMAL_PERCENT)
                    .with("log_standard_deviation", percent / 100.0)
            });
        }
    }

    /// Whether there is none: bounds alone are known.
    pub(crate) fn is_interval(&self) -> bool {
        matches!(self, Self::Interval { .. })
    }

    /// The factor, or the addition in the unit of the quantity, at a standard normal score; of an interval at a place between
    /// its ends, which are at -1 and 1.
    pub(crate) fn at(&self, score: f64) -> f64 {
        match *self {
            Self::Normal { standard_uncertainty_percent: Some(percent), .. } => {
                // No factor is negative; beyond four standard deviations of the widest one.
                (1.0 + percent / 100.0 * score).max(1e-3)
            }
            Self::Normal { standard_uncertainty_um: um, standard_uncertainty_deg: deg, .. } => {
                um.or(deg).unwrap_or(0.0) * score
            }
            Self::Lognormal { log_standard_deviation } => (log_standard_deviation * score).exp(),
            Self::Uniform { half_width_percent, half_width_um: um, half_width_deg: deg } => {
                within(half_width_percent, um.or(deg), even(score))
            }
            Self::Triangular { half_width_percent, half_width_um: um, half_width_deg: deg } => {
                within(half_width_percent, um.or(deg), peaked(score))
            }
            Self::Interval { half_width_percent, half_width_um: um, half_width_deg: deg } => {
                within(half_width_percent, um.or(deg), score.clamp(-1.0, 1.0))
            }
            Self::StudentT { standard_uncertainty_um, degrees_of_freedom } => {
                standard_uncertainty_um * student(score, degrees_of_freedom)
            }
        }
    }

    /// Whether it leaves anything open: a quantity without width is known.
    pub(crate) fn is_wide(&self) -> bool {
        (self.at(1.0) - self.at(-1.0)).abs() > 0.0
    }

    /// Relative standard deviation of a factor, that of its logarithm where that is normal; of bounds alone half of their width.
    pub(crate) fn relative(&self) -> f64 {
        match *self {
            Self::Normal { standard_uncertainty_percent: Some(percent), .. }
            | Self::Interval { half_width_percent: Some(percent), .. } => percent / 100.0,
            Self::Uniform { half_width_percent: Some(percent), .. } => percent / 100.0 / 3.0_f64.sqrt(),
            Self::Triangular { half_width_percent: Some(percent), .. } => percent / 100.0 / 6.0_f64.sqrt(),
            Self::Lognormal { log_standard_deviation } => log_standard_deviation,
            Self::Normal { .. }
            | Self::Uniform { .. }
            | Self::Triangular { .. }
            | Self::Interval { .. }
            | Self::StudentT { .. } => 0.0,
        }
    }

    /// The same with half of its width.
    pub(crate) fn halved(&self) -> Self {
        let half = |width: &mut Option<f64>| *width = width.map(|width| 0.5 * width);
        let mut halved = self.clone();
        match &mut halved {
            Self::Normal {
                standard_uncertainty_percent: percent,
                standard_uncertainty_um: um,
                standard_uncertainty_deg: deg,
            }
            | Self::Uniform { half_width_percent: percent, half_width_um: um, half_width_deg: deg }
            | Self::Triangular { half_width_percent: percent, half_width_um: um, half_width_deg: deg }
            | Self::Interval { half_width_percent: percent, half_width_um: um, half_width_deg: deg } => {
                half(percent);
                half(um);
                half(deg);
            }
            Self::Lognormal { log_standard_deviation: width }
            | Self::StudentT { standard_uncertainty_um: width, .. } => *width *= 0.5,
        }
        halved
    }
}

fn within(half_width_percent: Option<f64>, half_width: Option<f64>, place: f64) -> f64 {
    match half_width_percent {
        Some(percent) => 1.0 + percent / 100.0 * place,
        None => half_width.unwrap_or(0.0) * place,
    }
}

/// Evenly between -1 and 1.
fn even(score: f64) -> f64 {
    2.0 * normal_below(score) - 1.0
}

/// Between -1 and 1, with a density that falls evenly to both ends.
fn peaked(score: f64) -> f64 {
    let below = normal_below(-score.abs());
    (1.0 - (2.0 * below).sqrt()).copysign(score)
}

fn student(score: f64, degrees_of_freedom: f64) -> f64 {
    // From the tail, where the distribution function has all its digits.
    match StudentsT::new(0.0, 1.0, degrees_of_freedom) {
        Ok(student) => student.inverse_cdf(normal_below(-score.abs()).max(1e-15)).abs().copysign(score),
        Err(_) => score,
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    #[test]
    fn shares_below_are_those_of_the_distribution() {
        let triangular =
            Distribution::Triangular { half_width_percent: None, half_width_um: Some(2.0), half_width_deg: None };
        // Of a triangle over -2 to 2 an eighth lies below -1.
        assert!((triangular.at(super::super::normal_quantile(0.125)) + 1.0).abs() < 1e-9);
        let uniform =
            Distribution::Uniform { half_width_percent: Some(20.0), half_width_um: None, half_width_deg: None };
        assert!((uniform.at(super::super::normal_quantile(0.25)) - 0.9).abs() < 1e-9);
        // Cauchy's: a quarter lies above 1.
        let student = Distribution::StudentT { standard_uncertainty_um: 3.0, degrees_of_freedom: 1.0 };
        assert!((student.at(super::super::normal_quantile(0.75)) - 3.0).abs() < 1e-6);
        let lognormal = Distribution::Lognormal { log_standard_deviation: 0.2 };
        assert!((lognormal.at(1.5) - 0.3_f64.exp()).abs() < 1e-12);
    }
}
