//! The power law in depth, feed and speed.

use super::law::{DepthLaw, Law, Power};
use super::{Forces, Range, ToolMaterial, rules};
use crate::calculator::{Basis, Finding, Violations};
use crate::material::Certainty;
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// Largest coefficient, exponent (of either sign) and correction factor that the schema allows.
const MOST_COEFFICIENT_N: f64 = 10_000_000.0;
const MOST_EXPONENT: f64 = 3.0;
const MOST_CORRECTION: f64 = 100.0;
/// Depths that the handbook's law was measured for, mm: its tables of cuts go to 12.
const DEPTHS_MM: (f64, f64) = (0.1, 12.0);
/// Feeds that the handbook's law was measured for, mm/rev: its tables of feeds go to 2.
const FEEDS_MM_PER_REV: (f64, f64) = (0.05, 2.0);
/// Speeds that high-speed steel stands, m/min (judgement): the law does not know the speed.
const HSS_SPEEDS_M_PER_MIN: (f64, f64) = (0.0, 100.0);
/// Speeds that the handbook's law for carbide was measured for, m/min.
const CARBIDE_SPEEDS_M_PER_MIN: (f64, f64) = (30.0, 300.0);

/// One force as P = P_0 + C K t^x s^y v^n, t in mm, s in mm/rev, v in m/min, for t > 0.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct PowerTerm {
    /// Force at 1 mm depth, 1 mm/rev and 1 m/min: ten times the handbook's C_p, which is in kgf (2430, not 243).
    #[schema(exclusive_minimum = 0, maximum = 10_000_000, example = 2430.0,
        extensions(("x-unit" = json!("N")), ("x-symbol" = json!("10 C")), ("x-group" = json!("cut"))))]
    pub coefficient: f64,
    /// Exponent of the depth of cut.
    #[schema(minimum = 0, maximum = 3, example = 0.9,
        extensions(("x-unit" = json!("1")), ("x-symbol" = json!("x")), ("x-group" = json!("cut"))))]
    pub depth_exponent: f64,
    /// Exponent of the feed.
    #[schema(minimum = -3, maximum = 3, example = 0.6,
        extensions(("x-unit" = json!("1")), ("x-symbol" = json!("y")), ("x-group" = json!("cut"))))]
    pub feed_exponent: f64,
    /// Exponent of the cutting speed, as a rule negative or 0.
    #[serde(default)]
    #[schema(minimum = -3, maximum = 3, default = 0.0, example = -0.3,
        extensions(("x-unit" = json!("1")), ("x-symbol" = json!("n")), ("x-group" = json!("cut"))))]
    pub speed_exponent: f64,
    /// Product of the correction factors for material and edge geometry; does not act on `constant_n`.
    #[serde(default = "rules::one")]
    #[schema(exclusive_minimum = 0, maximum = 100, default = 1.0, example = 0.74,
        extensions(("x-unit" = json!("1")), ("x-symbol" = json!("K_p")), ("x-group" = json!("cut"))))]
    pub correction_factor: f64,
    /// Constant part by rubbing of the worn flank, added wherever something is cut.
    #[serde(default)]
    #[schema(minimum = 0, maximum = 1_000_000, default = 0.0, example = 60.0,
        extensions(("x-unit" = json!("N")), ("x-symbol" = json!("P_0")), ("x-group" = json!("cut")), ("x-advanced" = json!(true))))]
    pub constant_n: f64,
    /// How certain the coefficients are, where they come from the library. Changes no number.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub certainty: Option<Certainty>,
}

impl PowerTerm {
    pub(super) fn check(&self, pointer: &str, violations: &mut Violations) {
        let bad = |field: &str, value: f64, unit: &'static str, (least, most): (f64, f64)| {
            let limit = if value > most { most } else { least };
            let finding = Finding::new("bad_power_law", format!("{pointer}/{field}")).measured(value, limit, unit);
            finding.with("maximum", most)
        };
        for (field, value, unit, most) in [
            ("coefficient", self.coefficient, "N", MOST_COEFFICIENT_N),
            ("correction_factor", self.correction_factor, "1", MOST_CORRECTION),
        ] {
            violations.require(rules::positive(value), || bad(field, value, unit, (0.0, most)).with("above", 0.0));
        }
        for (field, value, unit, most) in [
            ("depth_exponent", self.depth_exponent, "1", MOST_EXPONENT),
            ("constant_n", self.constant_n, "N", rules::MOST_FORCE_N),
        ] {
            violations
                .require(rules::not_negative(value), || bad(field, value, unit, (0.0, most)).with("minimum", 0.0));
        }
        for (field, value) in [("feed_exponent", self.feed_exponent), ("speed_exponent", self.speed_exponent)] {
            let ends = (-MOST_EXPONENT, MOST_EXPONENT);
            violations.require(value.is_finite(), || bad(field, value, "1", ends).with("minimum", ends.0));
        }
    }

    fn at(&self, feed_mm_per_rev: f64, speed_m_per_min: f64) -> Power {
        let factor = self.coefficient
            * self.correction_factor
            * feed_mm_per_rev.powf(self.feed_exponent)
            * speed_m_per_min.powf(self.speed_exponent);
        Power::new(factor, self.depth_exponent)
    }
}

/// Range in which the coefficients were measured; a cut outside it draws a warning.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct MeasuredRange {
    /// Least depth of cut of the trials.
    #[schema(minimum = 0, maximum = 100, example = 0.25,
        extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("t_min")), ("x-group" = json!("cut")), ("x-advanced" = json!(true))))]
    pub least_depth_mm: f64,
    /// Largest depth of cut of the trials.
    #[schema(exclusive_minimum = 0, maximum = 100, example = 3.0,
        extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("t_max")), ("x-group" = json!("cut")), ("x-advanced" = json!(true))))]
    pub largest_depth_mm: f64,
    /// Least feed of the trials.
    #[schema(minimum = 0, maximum = 20, example = 0.1,
        extensions(("x-unit" = json!("mm/rev")), ("x-symbol" = json!("s_min")), ("x-group" = json!("cut")), ("x-advanced" = json!(true))))]
    pub least_feed_mm_per_rev: f64,
    /// Largest feed of the trials.
    #[schema(exclusive_minimum = 0, maximum = 20, example = 0.6,
        extensions(("x-unit" = json!("mm/rev")), ("x-symbol" = json!("s_max")), ("x-group" = json!("cut")), ("x-advanced" = json!(true))))]
    pub largest_feed_mm_per_rev: f64,
    /// Least cutting speed of the trials.
    #[schema(minimum = 0, maximum = 10_000, example = 60.0,
        extensions(("x-unit" = json!("m/min")), ("x-symbol" = json!("v_min")), ("x-group" = json!("cut")), ("x-advanced" = json!(true))))]
    pub least_speed_m_per_min: f64,
    /// Largest cutting speed of the trials.
    #[schema(exclusive_minimum = 0, maximum = 10_000, example = 250.0,
        extensions(("x-unit" = json!("m/min")), ("x-symbol" = json!("v_max")), ("x-group" = json!("cut")), ("x-advanced" = json!(true))))]
    pub largest_speed_m_per_min: f64,
}

/// Where the coefficients of a power law come from. Changes no number.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum CoefficientOrigin {
    /// Stated in the job.
    #[default]
    Given,
    /// The handbook's tables, through `handbook`.
    Handbook,
}

/// Forces as powers of depth, feed and speed. Equation `deflection/6.1`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct PowerLaw {
    /// Passive (radial) force P_y.
    pub passive: PowerTerm,
    /// Main (tangential) force P_z; left out: 0.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub main: Option<PowerTerm>,
    /// Feed (axial) force P_x; left out: 0.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub feed: Option<PowerTerm>,
    /// Factor on the law for a worn edge; 1 for a sharp one. Does not act on the constant parts.
    #[serde(default = "rules::one")]
    #[schema(exclusive_minimum = 0, maximum = 10, default = 1.0, example = 1.2,
        extensions(("x-unit" = json!("1")), ("x-symbol" = json!("K_w")), ("x-group" = json!("cut")), ("x-advanced" = json!(true))))]
    pub wear_factor: f64,
    /// Tool material of the trials: decides which speeds count as measured where `measured_range` is left out.
    #[serde(default)]
    pub tool_material: ToolMaterial,
    /// Angle of the straight edge to the direction of feed, where it is known. Changes no force; says which shoulders the
    /// tool can cut.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(exclusive_minimum = 0, exclusive_maximum = 120, example = 95.0,
        extensions(("x-unit" = json!("deg")), ("x-symbol" = json!("kappa")), ("x-group" = json!("cut")), ("x-advanced" = json!(true))))]
    pub cutting_edge_angle_deg: Option<f64>,
    /// Range of the trials. Left out: that of the handbook, t = 0.1 to 12 mm, s = 0.05 to 2 mm/rev, for carbide v = 30 to
    /// 300 m/min.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub measured_range: Option<MeasuredRange>,
    /// Where the coefficients come from; written by the service.
    #[serde(default)]
    pub origin: CoefficientOrigin,
}

impl PowerLaw {
    fn terms(&self) -> impl Iterator<Item = (&'static str, &PowerTerm)> {
        [("passive", Some(&self.passive)), ("main", self.main.as_ref()), ("feed", self.feed.as_ref())]
            .into_iter()
            .filter_map(|(name, term)| term.map(|term| (name, term)))
    }

    pub(super) fn check(&self, pointer: &str, violations: &mut Violations) {
        for (name, term) in self.terms() {
            term.check(&format!("{pointer}/{name}"), violations);
        }
        rules::check_wear(self.wear_factor, pointer, violations);
        if let Some(range) = &self.measured_range {
            range.check(&format!("{pointer}/measured_range"), violations);
        }
    }

    pub(super) fn at(&self, feed_mm_per_rev: f64, speed_m_per_min: f64) -> DepthLaw {
        let power =
            |term: Option<&PowerTerm>| term.map_or(Power::ZERO, |term| term.at(feed_mm_per_rev, speed_m_per_min));
        let constant = |term: Option<&PowerTerm>| term.map_or(0.0, |term| term.constant_n);
        let (main, feed) = (self.main.as_ref(), self.feed.as_ref());
        let law = Law::Power { passive: power(Some(&self.passive)), main: power(main), feed: power(feed) };
        let added = Forces { passive_n: self.passive.constant_n, main_n: constant(main), feed_n: constant(feed) };
        DepthLaw::new(law, self.wear_factor, added)
    }

    pub(super) fn depends_on_speed(&self) -> bool {
        self.terms().any(|(_, term)| term.speed_exponent.abs() > 0.0)
    }

    /// The trials' range where it is stated, else that of the handbook's tables.
    pub(super) fn range(&self) -> Range {
        match (&self.measured_range, self.tool_material) {
            (Some(range), _) => Range {
                depth_mm: (range.least_depth_mm, range.largest_depth_mm),
                feed_mm_per_rev: (range.least_feed_mm_per_rev, range.largest_feed_mm_per_rev),
                speed_m_per_min: (range.least_speed_m_per_min, range.largest_speed_m_per_min),
            },
            (None, tool) => Range {
                depth_mm: DEPTHS_MM,
                feed_mm_per_rev: FEEDS_MM_PER_REV,
                speed_m_per_min: match tool {
                    ToolMaterial::Carbide => CARBIDE_SPEEDS_M_PER_MIN,
                    ToolMaterial::Hss => HSS_SPEEDS_M_PER_MIN,
                },
            },
        }
    }

    pub(super) fn cautions(&self, pointer: &str) -> Vec<Finding> {
        let last = super::handbook::LAST_EDGE_ANGLE_DEG;
        let of_table = self.cutting_edge_angle_deg.filter(|_| self.origin == CoefficientOrigin::Handbook);
        let beyond = of_table.filter(|angle| *angle > last).map(|angle| {
            Finding::new("edge_angle_beyond_table", format!("{pointer}/cutting_edge_angle_deg"))
                .measured(angle, last, "deg")
        });
        let unconfirmed = self.terms().filter_map(|(name, term)| {
            let certainty = term.certainty.filter(|certainty| certainty.needs_check())?;
            Some(
                Finding::new("unconfirmed_force_coefficient", format!("{pointer}/{name}"))
                    .with("certainty", certainty.name()),
            )
        });
        beyond.into_iter().chain(unconfirmed).collect()
    }

    pub(super) fn basis(&self) -> Vec<Basis> {
        match self.origin {
            CoefficientOrigin::Given => {
                vec![Basis { equation: "deflection/6.1", source: "coefficients stated in the job" }]
            }
            CoefficientOrigin::Handbook => handbook_basis(),
        }
    }
}

pub(super) fn handbook_basis() -> Vec<Basis> {
    vec![Basis { equation: "deflection/6.1", source: super::handbook::SOURCE }]
}

impl MeasuredRange {
    fn check(&self, pointer: &str, violations: &mut Violations) {
        let ranges = [
            ("largest_depth_mm", self.least_depth_mm, self.largest_depth_mm, "mm", 100.0),
            ("largest_feed_mm_per_rev", self.least_feed_mm_per_rev, self.largest_feed_mm_per_rev, "mm/rev", 20.0),
            ("largest_speed_m_per_min", self.least_speed_m_per_min, self.largest_speed_m_per_min, "m/min", 10_000.0),
        ];
        for (field, least, largest, unit, most) in ranges {
            violations.require(rules::not_negative(least) && largest.is_finite() && least <= largest, || {
                Finding::new("bad_power_law", format!("{pointer}/{field}"))
                    .measured(largest, least, unit)
                    .within(least, most)
            });
        }
    }
}
