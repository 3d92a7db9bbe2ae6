//! One model: a polynomial in logarithms, read as a power law or as it stands.

use crate::material::Certainty;
use nalgebra::DMatrix;
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;
use utoipa::openapi::extensions::Extensions;
use utoipa::openapi::schema::{ArrayBuilder, ObjectBuilder, Schema, SchemaType, Type};

/// How the polynomial in logarithms L = c_0 + a_V ln V + a_S ln S + a_t ln t + a_phi ln phi gives the
/// output (`feed/2.1`).
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, Default, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum ModelForm {
    /// Y = exp(L): a power law.
    #[default]
    LogLog,
    /// Y = L.
    SemiLog,
}

/// A variable that every model knows.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub enum Variable {
    /// Cutting speed V, m/min.
    Speed,
    /// Feed S, mm/rev.
    Feed,
    /// Depth of cut t, mm.
    Depth,
    /// Major cutting edge angle phi, degrees.
    Angle,
}

impl Variable {
    /// All of them, in the order of the equation.
    pub const ALL: [Self; 4] = [Self::Speed, Self::Feed, Self::Depth, Self::Angle];

    /// Its field in a job or a table of trials.
    pub const fn field(self) -> &'static str {
        match self {
            Self::Speed => "speed_m_per_min",
            Self::Feed => "feed_mm_per_rev",
            Self::Depth => "depth_mm",
            Self::Angle => "cutting_edge_angle_deg",
        }
    }

    /// Its unit.
    pub const fn unit(self) -> &'static str {
        match self {
            Self::Speed => "m/min",
            Self::Feed => "mm/rev",
            Self::Depth => "mm",
            Self::Angle => "deg",
        }
    }
}

/// Conditions at which a model is evaluated; every one positive.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Conditions {
    /// V, m/min.
    pub speed_m_per_min: f64,
    /// S, mm/rev.
    pub feed_mm_per_rev: f64,
    /// t, mm.
    pub depth_mm: f64,
    /// phi, degrees; a model that does not depend on it does not ask.
    pub cutting_edge_angle_deg: Option<f64>,
}

impl Conditions {
    /// The value of a variable.
    pub fn of(&self, variable: Variable) -> Option<f64> {
        match variable {
            Variable::Speed => Some(self.speed_m_per_min),
            Variable::Feed => Some(self.feed_mm_per_rev),
            Variable::Depth => Some(self.depth_mm),
            Variable::Angle => self.cutting_edge_angle_deg,
        }
    }
}

/// An output of the cut as a polynomial of first order in the logarithms of speed, feed, depth, edge angle and,
/// where stated, further variables. Equation `feed/2.1`.
#[derive(Debug, Clone, PartialEq, Default, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct MachinabilityModel {
    /// Whether the polynomial is the logarithm of the output or the output itself.
    #[serde(default)]
    #[schema(default = "log_log", example = "log_log")]
    pub form: ModelForm,
    /// Constant c_0: the logarithm of the output (`log_log`) or the output (`semi_log`) at 1 m/min, 1 mm/rev, 1 mm, 1 degree.
    #[schema(minimum = -1000.0, maximum = 1000.0, example = 2.3, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("c_0")), ("x-code" = json!("absurd_exponent"))))]
    pub constant: f64,
    /// Coefficient of ln V: with `log_log` the exponent of the cutting speed.
    #[serde(default)]
    #[schema(minimum = -100.0, maximum = 100.0, default = 0.0, example = -0.21, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("a_V")), ("x-code" = json!("absurd_exponent"))))]
    pub speed_exponent: f64,
    /// Coefficient of ln S: with `log_log` the exponent of the feed.
    #[serde(default)]
    #[schema(minimum = -100.0, maximum = 100.0, default = 0.0, example = 0.78, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("a_S")), ("x-code" = json!("absurd_exponent"))))]
    pub feed_exponent: f64,
    /// Coefficient of ln t: with `log_log` the exponent of the depth of cut.
    #[serde(default)]
    #[schema(minimum = -100.0, maximum = 100.0, default = 0.0, example = 0.15, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("a_t")), ("x-code" = json!("absurd_exponent"))))]
    pub depth_exponent: f64,
    /// Coefficient of ln phi: with `log_log` the exponent of the major cutting edge angle in degrees.
    #[serde(default)]
    #[schema(minimum = -100.0, maximum = 100.0, default = 0.0, example = 0.31, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("a_phi")), ("x-code" = json!("absurd_exponent"))))]
    pub angle_exponent: f64,
    /// Further variables that a schedule cannot change, each with its coefficient and the value that it has.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schema(max_items = 8)]
    pub further: Vec<FurtherVariable>,
    /// Ranges of the trials; an answer outside them draws a warning.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub range: Option<ModelRange>,
    /// Standard deviation of single trials about the model: of ln(output) with `log_log`, of the output with `semi_log`.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0.0, maximum = 1e6, example = 0.08, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("s_res"))))]
    pub residual_scatter: Option<f64>,
    /// How uncertain the coefficients are, and how they go together; a fit gives it. It acts where a risk is stated.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(extensions(("x-advanced" = json!(true))))]
    pub coefficient_covariance: Option<CoefficientCovariance>,
    /// Trials behind the model.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 1, maximum = 1_000_000, example = 27, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("n"))))]
    pub trials: Option<u32>,
    /// Where the coefficients come from. Changes no number.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(max_length = 1000, example = "own trials, March")]
    pub source: Option<String>,
    /// How certain they are. Changes no number.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub certainty: Option<Certainty>,
}

/// How uncertain the coefficients of a model are together (`fit/1.5`): s^2 (X'X)^-1 of a regression.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct CoefficientCovariance {
    /// Which coefficients, in the order of rows and columns.
    #[schema(min_items = 1, max_items = 5, example = json!(["constant", "speed_exponent", "feed_exponent"]))]
    pub order: Vec<ModelCoefficient>,
    /// Covariances, row by row; with further variables the constant's are those at their values.
    #[schema(schema_with = covariances)]
    pub matrix: Vec<Vec<f64>>,
    /// Degrees of freedom of the residuals behind it: limits are then those of Student's t; not said: of the normal distribution.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 1.0, maximum = 1e6, example = 9.0, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("nu"))))]
    pub degrees_of_freedom: Option<f64>,
}

fn covariances() -> Schema {
    let extensions = Extensions::builder().add("x-unit", "1").add("x-symbol", "C").build();
    let covariance = ObjectBuilder::new()
        .schema_type(SchemaType::new(Type::Number))
        .minimum(Some(-1e9))
        .maximum(Some(1e9))
        .examples([0.28])
        .extensions(Some(extensions));
    let row = ArrayBuilder::new().items(covariance).min_items(Some(1)).max_items(Some(5));
    ArrayBuilder::new()
        .items(row)
        .min_items(Some(1))
        .max_items(Some(5))
        .description(Some("Covariances, row by row; with further variables the constant's are those at their values."))
        .examples([[[0.28, -0.056], [-0.056, 0.013]]])
        .into()
}

/// A coefficient of a model, by its field.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum ModelCoefficient {
    /// The constant.
    Constant,
    /// That of the speed.
    SpeedExponent,
    /// That of the feed.
    FeedExponent,
    /// That of the depth of cut.
    DepthExponent,
    /// That of the major cutting edge angle.
    AngleExponent,
}

impl ModelCoefficient {
    /// Of a variable.
    pub fn of(variable: Variable) -> Self {
        match variable {
            Variable::Speed => Self::SpeedExponent,
            Variable::Feed => Self::FeedExponent,
            Variable::Depth => Self::DepthExponent,
            Variable::Angle => Self::AngleExponent,
        }
    }

    /// What it is multiplied by, as parts of 1, ln V and ln S. An angle that is asked for and absent gives NaN.
    fn factor(self, depth_mm: f64, cutting_edge_angle_deg: Option<f64>) -> [f64; 3] {
        match self {
            Self::Constant => [1.0, 0.0, 0.0],
            Self::SpeedExponent => [0.0, 1.0, 0.0],
            Self::FeedExponent => [0.0, 0.0, 1.0],
            Self::DepthExponent => [depth_mm.ln(), 0.0, 0.0],
            Self::AngleExponent => [cutting_edge_angle_deg.unwrap_or(f64::NAN).ln(), 0.0, 0.0],
        }
    }
}

impl CoefficientCovariance {
    /// What every coefficient is multiplied by, as parts of 1, ln V and ln S.
    pub fn factors(&self, depth_mm: f64, cutting_edge_angle_deg: Option<f64>) -> Vec<[f64; 3]> {
        self.order.iter().map(|one| one.factor(depth_mm, cutting_edge_angle_deg)).collect()
    }

    /// The matrix, where it is one: a row and a column for every coefficient, symmetric to 1e-6 of its entries.
    pub fn as_matrix(&self) -> Option<DMatrix<f64>> {
        let count = self.order.len();
        if self.matrix.len() != count || self.matrix.iter().any(|row| row.len() != count) {
            return None;
        }
        let matrix = DMatrix::from_fn(count, count, |i, j| self.matrix[i][j]);
        let largest = matrix.amax();
        ((&matrix - matrix.transpose()).amax() <= 1e-6 * largest).then_some(matrix)
    }
}

/// A variable beside speed, feed, depth and edge angle, at the value that it has in this job.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct FurtherVariable {
    /// Its name, unit at the end.
    #[schema(min_length = 1, max_length = 64, example = "nose_radius_mm")]
    pub name: String,
    /// Coefficient of its logarithm.
    #[schema(minimum = -100.0, maximum = 100.0, example = -0.5, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("a"))))]
    pub exponent: f64,
    /// The value that it has.
    #[schema(exclusive_minimum = 0.0, maximum = 1e9, example = 0.8, extensions(("x-unit" = json!("as the name says")), ("x-symbol" = json!("x"))))]
    pub value: f64,
    /// Least value of the trials.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(exclusive_minimum = 0.0, maximum = 1e9, example = 0.4, extensions(("x-unit" = json!("as the name says")), ("x-symbol" = json!("x_min"))))]
    pub least: Option<f64>,
    /// Largest value of the trials.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(exclusive_minimum = 0.0, maximum = 1e9, example = 1.2, extensions(("x-unit" = json!("as the name says")), ("x-symbol" = json!("x_max"))))]
    pub largest: Option<f64>,
}

/// Ranges of the trials behind a model; what is left out is unknown.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct ModelRange {
    /// Least cutting speed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(exclusive_minimum = 0.0, maximum = 20_000.0, example = 10.0, extensions(("x-unit" = json!("m/min")), ("x-symbol" = json!("V_min"))))]
    pub least_speed_m_per_min: Option<f64>,
    /// Largest cutting speed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(exclusive_minimum = 0.0, maximum = 20_000.0, example = 80.0, extensions(("x-unit" = json!("m/min")), ("x-symbol" = json!("V_max"))))]
    pub largest_speed_m_per_min: Option<f64>,
    /// Least feed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(exclusive_minimum = 0.0, maximum = 20.0, example = 0.08, extensions(("x-unit" = json!("mm/rev")), ("x-symbol" = json!("S_min"))))]
    pub least_feed_mm_per_rev: Option<f64>,
    /// Largest feed.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(exclusive_minimum = 0.0, maximum = 20.0, example = 0.4, extensions(("x-unit" = json!("mm/rev")), ("x-symbol" = json!("S_max"))))]
    pub largest_feed_mm_per_rev: Option<f64>,
    /// Least depth of cut.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(exclusive_minimum = 0.0, maximum = 1000.0, example = 0.3, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("t_min"))))]
    pub least_depth_mm: Option<f64>,
    /// Largest depth of cut.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(exclusive_minimum = 0.0, maximum = 1000.0, example = 5.0, extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("t_max"))))]
    pub largest_depth_mm: Option<f64>,
    /// Least major cutting edge angle.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(exclusive_minimum = 0.0, maximum = 180.0, example = 15.0, extensions(("x-unit" = json!("deg")), ("x-symbol" = json!("phi_min"))))]
    pub least_cutting_edge_angle_deg: Option<f64>,
    /// Largest major cutting edge angle.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(exclusive_minimum = 0.0, maximum = 180.0, example = 105.0, extensions(("x-unit" = json!("deg")), ("x-symbol" = json!("phi_max"))))]
    pub largest_cutting_edge_angle_deg: Option<f64>,
}

impl ModelRange {
    /// Least and largest value of a variable, as far as known.
    pub fn of(&self, variable: Variable) -> (Option<f64>, Option<f64>) {
        match variable {
            Variable::Speed => (self.least_speed_m_per_min, self.largest_speed_m_per_min),
            Variable::Feed => (self.least_feed_mm_per_rev, self.largest_feed_mm_per_rev),
            Variable::Depth => (self.least_depth_mm, self.largest_depth_mm),
            Variable::Angle => (self.least_cutting_edge_angle_deg, self.largest_cutting_edge_angle_deg),
        }
    }

    /// Sets the range of a variable.
    pub fn set(&mut self, variable: Variable, least: f64, largest: f64) {
        let (low, high) = match variable {
            Variable::Speed => (&mut self.least_speed_m_per_min, &mut self.largest_speed_m_per_min),
            Variable::Feed => (&mut self.least_feed_mm_per_rev, &mut self.largest_feed_mm_per_rev),
            Variable::Depth => (&mut self.least_depth_mm, &mut self.largest_depth_mm),
            Variable::Angle => (&mut self.least_cutting_edge_angle_deg, &mut self.largest_cutting_edge_angle_deg),
        };
        (*low, *high) = (Some(least), Some(largest));
    }
}

impl MachinabilityModel {
    /// A power law Y = K V^v S^s t^d, from ln K.
    pub fn power_law(ln_coefficient: f64, speed: f64, feed: f64, depth: f64) -> Self {
        Self {
            form: ModelForm::LogLog,
            constant: ln_coefficient,
            speed_exponent: speed,
            feed_exponent: feed,
            depth_exponent: depth,
            ..Self::default()
        }
    }

    /// Coefficient of a variable's logarithm.
    pub fn exponent(&self, variable: Variable) -> f64 {
        match variable {
            Variable::Speed => self.speed_exponent,
            Variable::Feed => self.feed_exponent,
            Variable::Depth => self.depth_exponent,
            Variable::Angle => self.angle_exponent,
        }
    }

    /// Whether it cannot be evaluated without a cutting edge angle.
    pub fn needs_angle(&self) -> bool {
        self.angle_exponent != 0.0
    }

    /// The part of L that neither speed nor feed changes: c_0, depth, angle and further variables.
    /// An angle that the model needs and that is absent gives NaN.
    pub fn constant_at(&self, depth_mm: f64, cutting_edge_angle_deg: Option<f64>) -> f64 {
        let mut sum = self.constant;
        if self.depth_exponent != 0.0 {
            sum += self.depth_exponent * depth_mm.ln();
        }
        if self.angle_exponent != 0.0 {
            sum += self.angle_exponent * cutting_edge_angle_deg.unwrap_or(f64::NAN).ln();
        }
        self.further.iter().fold(sum, |sum, variable| sum + variable.exponent * variable.value.ln())
    }

    /// L at given conditions (`feed/2.1`).
    pub fn logarithm(&self, at: &Conditions) -> f64 {
        let mut sum = self.constant_at(at.depth_mm, at.cutting_edge_angle_deg);
        if self.speed_exponent != 0.0 {
            sum += self.speed_exponent * at.speed_m_per_min.ln();
        }
        if self.feed_exponent != 0.0 {
            sum += self.feed_exponent * at.feed_mm_per_rev.ln();
        }
        sum
    }

    /// The output at given conditions.
    pub fn value(&self, at: &Conditions) -> f64 {
        self.of_logarithm(self.logarithm(at))
    }

    /// The output where the polynomial has the value `logarithm`.
    pub fn of_logarithm(&self, logarithm: f64) -> f64 {
        match self.form {
            ModelForm::LogLog => logarithm.exp(),
            ModelForm::SemiLog => logarithm,
        }
    }

    /// Variables outside the range of the trials: which, the value and the end that it passed.
    pub fn outside_range(&self, at: &Conditions) -> Vec<(Variable, f64, f64)> {
        let Some(range) = &self.range else { return Vec::new() };
        Variable::ALL
            .into_iter()
            .filter_map(|variable| {
                let value = at.of(variable)?;
                let (least, largest) = range.of(variable);
                // An optimum on the end of the range must not be called outside for the last bit.
                let below = least.filter(|least| value < least * (1.0 - 1e-6));
                let above = largest.filter(|largest| value > largest * (1.0 + 1e-6));
                below.or(above).map(|end| (variable, value, end))
            })
            .collect()
    }
}
