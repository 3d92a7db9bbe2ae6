//! Kienzle's specific force, integrated along an edge with nose and lead angle.

use super::law::{Component, DepthLaw, Law, Power};
use super::sine_integral::SineIntegral;
use super::{Forces, Range, ReachedCut, rules};
use crate::calculator::{Basis, Finding, Violations};
use crate::material::{self, Certainty};
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

/// Edge angles below this one are those of tools, degrees.
const MOST_EDGE_ANGLE_DEG: f64 = 120.0;
/// Beyond what the sources of specific forces cover: depth, mm (judgement: longer edges are not made), feed, mm/rev, and
/// speed, m/min (the law does not know it; measured with carbide).
const LARGEST: (f64, f64, f64) = (20.0, 2.5, 400.0);
/// Largest specific force that the schema allows, N/mm2.
const MOST_SPECIFIC_FORCE_N_PER_MM2: f64 = 100_000.0;

/// Specific force over local chip thickness along the edge and its nose. Equation `deflection/6.2`.
///
/// Valid for a lead angle below 120 degrees and a feed well below the nose radius; the trailing edge
/// and the scallop are left out. Beyond 90 degrees the straight edge pulls the work towards the tool: the passive force
/// falls with the depth. The force does not depend on the cutting speed.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct Kienzle {
    /// Lead angle (cutting edge angle) of the straight edge.
    #[schema(exclusive_minimum = 0, exclusive_maximum = 120, example = 95.0,
        extensions(("x-unit" = json!("deg")), ("x-symbol" = json!("kappa")), ("x-group" = json!("cut"))))]
    pub cutting_edge_angle_deg: f64,
    /// Nose radius; 0 for a sharp corner.
    #[serde(default)]
    #[schema(minimum = 0, maximum = 50, default = 0.0, example = 0.8,
        extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("r")), ("x-group" = json!("cut"))))]
    pub nose_radius_mm: f64,
    /// Material of the library that gives `specific_cutting_force_n_per_mm2` and `cutting_exponent` in their place.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(max_length = 64, example = "42crmo4", extensions(("x-group" = json!("cut")), ("x-library" = json!("materials"))))]
    pub material: Option<String>,
    /// Specific cutting force at 1 mm chip thickness and 1 mm width, k_c1.1.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(exclusive_minimum = 0, maximum = 100_000, example = 2100.0,
        extensions(("x-unit" = json!("N/mm2")), ("x-symbol" = json!("k_c1.1")), ("x-group" = json!("cut"))))]
    pub specific_cutting_force_n_per_mm2: Option<f64>,
    /// Exponent of the chip thickness in the specific cutting force, m_c.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    #[schema(minimum = 0, exclusive_maximum = 1, example = 0.26,
        extensions(("x-unit" = json!("1")), ("x-symbol" = json!("m_c")), ("x-group" = json!("cut"))))]
    pub cutting_exponent: Option<f64>,
    /// Specific force normal to the edge in the base plane, k_n1.1. No table gives it: as a rule 0.35 to 0.6 of k_c1.1 for a sharp carbide edge.
    #[schema(exclusive_minimum = 0, maximum = 100_000, example = 900.0,
        extensions(("x-unit" = json!("N/mm2")), ("x-symbol" = json!("k_n1.1")), ("x-group" = json!("cut"))))]
    pub specific_normal_force_n_per_mm2: f64,
    /// Exponent of the chip thickness in the specific normal force, m_n. No table gives it: as a rule 0.3 to 0.5.
    #[schema(minimum = 0, exclusive_maximum = 1, example = 0.35,
        extensions(("x-unit" = json!("1")), ("x-symbol" = json!("m_n")), ("x-group" = json!("cut"))))]
    pub normal_exponent: f64,
    /// How certain k_c1.1 and m_c are, where they come from the library. Changes no number.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub certainty: Option<Certainty>,
    /// Constant part P_0 by rubbing of the worn flank, added to the law wherever something is cut.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rubbing: Option<Forces>,
    /// Factor on the law for a worn edge; 1 for a sharp one. Does not act on `rubbing`.
    #[serde(default = "rules::one")]
    #[schema(exclusive_minimum = 0, maximum = 10, default = 1.0, example = 1.2,
        extensions(("x-unit" = json!("1")), ("x-symbol" = json!("K_w")), ("x-group" = json!("cut")), ("x-advanced" = json!(true))))]
    pub wear_factor: f64,
}

impl Kienzle {
    pub(super) fn check(&self, pointer: &str, violations: &mut Violations) {
        let angle = self.cutting_edge_angle_deg;
        violations.require(rules::positive(angle) && angle < MOST_EDGE_ANGLE_DEG, || {
            rules::bad_lead_angle(angle, ("below", MOST_EDGE_ANGLE_DEG), format!("{pointer}/cutting_edge_angle_deg"))
        });
        violations.require(rules::not_negative(self.nose_radius_mm), || {
            rules::bad_nose_radius(self.nose_radius_mm, "minimum", format!("{pointer}/nose_radius_mm"))
        });
        self.check_constants(pointer, violations);
        rules::check_rubbing(self.rubbing.as_ref(), pointer, violations);
        rules::check_wear(self.wear_factor, pointer, violations);
    }

    fn check_constants(&self, pointer: &str, violations: &mut Violations) {
        let normal = self.specific_normal_force_n_per_mm2;
        check_specific(normal, &format!("{pointer}/specific_normal_force_n_per_mm2"), violations);
        check_exponent(self.normal_exponent, &format!("{pointer}/normal_exponent"), violations);
        match (&self.material, self.specific_cutting_force_n_per_mm2, self.cutting_exponent) {
            (Some(id), None, None) => {
                let at = format!("{pointer}/material");
                match material::find(id) {
                    None => violations.add(Finding::new("unknown_material", at).with("material", id.clone())),
                    Some(found) => violations.require(found.kienzle.is_some(), || {
                        Finding::new("material_without_force_law", at).with("material", found.id)
                    }),
                }
            }
            (None, Some(force), Some(exponent)) => {
                check_specific(force, &format!("{pointer}/specific_cutting_force_n_per_mm2"), violations);
                check_exponent(exponent, &format!("{pointer}/cutting_exponent"), violations);
            }
            _ => violations.add(Finding::new("kienzle_or_material", pointer)),
        }
    }

    pub(super) fn fill(&mut self) {
        if let Some(row) = self.material.as_deref().and_then(material::find).and_then(|found| found.kienzle) {
            self.specific_cutting_force_n_per_mm2 = Some(row.specific_cutting_force_n_per_mm2);
            self.cutting_exponent = Some(row.cutting_exponent);
            self.certainty = Some(row.certainty);
            self.material = None;
        }
    }

    pub(super) fn at(&self, feed_mm_per_rev: f64) -> DepthLaw {
        let mut filled = self.clone();
        filled.fill();
        let (Some(force), Some(exponent)) = (filled.specific_cutting_force_n_per_mm2, filled.cutting_exponent) else {
            return DepthLaw::zero();
        };
        let law = KienzleLaw::new(self, force, exponent, feed_mm_per_rev);
        DepthLaw::new(law.simplified(), self.wear_factor, self.rubbing.unwrap_or_default())
    }

    pub(super) fn extrapolations(&self, cut: &ReachedCut) -> Vec<Finding> {
        let radius = self.nose_radius_mm;
        let feed = cut.feed_mm_per_rev;
        let exceeds = radius > 0.0 && feed.largest >= radius;
        let finding =
            || Finding::new("feed_exceeds_nose_radius", feed.pointer).measured(feed.largest, radius, "mm/rev");
        exceeds.then(finding).into_iter().chain(cut.outside(&Self::range())).collect()
    }

    pub(super) fn range() -> Range {
        Range { depth_mm: (0.0, LARGEST.0), feed_mm_per_rev: (0.0, LARGEST.1), speed_m_per_min: (0.0, LARGEST.2) }
    }

    pub(super) fn cautions(&self, pointer: &str) -> Vec<Finding> {
        let mut filled = self.clone();
        filled.fill();
        let certainty = filled.certainty.filter(|certainty| certainty.needs_check());
        let finding = |certainty: Certainty| {
            Finding::new("unconfirmed_force_coefficient", format!("{pointer}/specific_cutting_force_n_per_mm2"))
                .with("certainty", certainty.name())
        };
        certainty.map(finding).into_iter().collect()
    }
}

fn check_specific(value: f64, pointer: &str, violations: &mut Violations) {
    violations.require(rules::positive(value), || {
        Finding::new("bad_kienzle", pointer)
            .measured(value, 0.0, "N/mm2")
            .with("above", 0.0)
            .with("maximum", MOST_SPECIFIC_FORCE_N_PER_MM2)
    });
}

fn check_exponent(value: f64, pointer: &str, violations: &mut Violations) {
    violations.require(rules::not_negative(value) && value < 1.0, || {
        let limit = if value >= 1.0 { 1.0 } else { 0.0 };
        Finding::new("bad_kienzle", pointer).measured(value, limit, "1").with("minimum", 0.0).with("below", 1.0)
    });
}

pub(super) fn basis() -> Vec<Basis> {
    vec![Basis {
        equation: "deflection/6.2",
        source: "O. Kienzle, Die Bestimmung von Kräften und Leistungen an spanenden Werkzeugen und Werkzeugmaschinen, VDI-Z. 94 (1952) 299-305; integrated along nose and edge",
    }]
}

/// The forces on the nose up to its end and on the straight edge beyond, for one feed.
///
/// With u = t/(2r) = sin²(phi/2), phi the angle up to which the nose cuts, sin²(phi) = 4u(1-u) and
/// cos(phi) = 1-2u lose no digit at small depths. On the straight edge all forces are linear in t.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct KienzleLaw {
    radius_mm: f64,
    nose_depth_mm: f64,
    /// k_n s^(1-mn), k_c s^(1-mc): N/mm of edge at full thickness.
    normal: f64,
    cutting: f64,
    normal_exponent: f64,
    cutting_exponent: f64,
    main_integral: SineIntegral,
    feed_integral: SineIntegral,
    /// At the end of the nose, and the slopes of the straight edge.
    end: Forces,
    slope: Forces,
}

impl KienzleLaw {
    fn new(tool: &Kienzle, specific: f64, cutting_exponent: f64, feed_mm_per_rev: f64) -> Self {
        let normal_exponent = tool.normal_exponent;
        let normal = tool.specific_normal_force_n_per_mm2 * feed_mm_per_rev.powf(1.0 - normal_exponent);
        let cutting = specific * feed_mm_per_rev.powf(1.0 - cutting_exponent);
        let radius_mm = tool.nose_radius_mm;
        let half = (0.5 * tool.cutting_edge_angle_deg).to_radians().sin();
        // Exactly one half at 90 degrees, where the straight edge adds no passive force at all.
        let is_square = (tool.cutting_edge_angle_deg - 90.0).abs() < f64::EPSILON;
        let u = if is_square { 0.5 } else { half * half };
        let mut law = Self {
            radius_mm,
            nose_depth_mm: 2.0 * radius_mm * u,
            normal,
            cutting,
            normal_exponent,
            cutting_exponent,
            main_integral: SineIntegral::new(1.0 - cutting_exponent),
            feed_integral: SineIntegral::new(2.0 - normal_exponent),
            end: Forces::default(),
            slope: Forces::default(),
        };
        let on_nose = |component| law.on_nose(component, u);
        let (passive, main, feed) = (on_nose(Component::Passive), on_nose(Component::Main), on_nose(Component::Feed));
        law.end = Forces { passive_n: passive.0, main_n: main.0, feed_n: feed.0 };
        law.slope = Forces { passive_n: passive.1, main_n: main.1, feed_n: feed.1 };
        law
    }

    /// Without a nose all forces are proportional to the depth.
    fn simplified(self) -> Law {
        if self.radius_mm > 0.0 {
            return Law::Kienzle(Box::new(self));
        }
        let Forces { passive_n, main_n, feed_n } = self.slope;
        Law::Power { passive: Power::Linear(passive_n), main: Power::Linear(main_n), feed: Power::Linear(feed_n) }
    }

    pub(super) fn value_and_slope(&self, component: Component, depth_mm: f64) -> (f64, f64) {
        if depth_mm < self.nose_depth_mm {
            // Kept above 0 for depths at the very end of the number range.
            let u = (0.5 * depth_mm / self.radius_mm).max(f64::MIN_POSITIVE);
            return self.on_nose(component, u);
        }
        let slope = self.slope.get(component);
        (self.end.get(component) + slope * (depth_mm - self.nose_depth_mm), slope)
    }

    /// Force and slope where the nose cuts up to u = sin²(phi/2).
    fn on_nose(&self, component: Component, u: f64) -> (f64, f64) {
        let sine = 2.0 * (u * (1.0 - u)).sqrt();
        let cosine = 1.0 - 2.0 * u;
        match component {
            Component::Passive => {
                let slope = self.normal * sine.powf(-self.normal_exponent);
                let value = self.radius_mm * slope * sine * sine / (2.0 - self.normal_exponent);
                (value, slope * cosine)
            }
            Component::Main => {
                let value = self.cutting * self.radius_mm * self.main_integral.at(u);
                (value, self.cutting * sine.powf(-self.cutting_exponent))
            }
            Component::Feed => {
                let value = self.normal * self.radius_mm * self.feed_integral.at(u);
                (value, self.normal * sine.powf(1.0 - self.normal_exponent))
            }
        }
    }
}
