//! Coefficients and exponents, table 22.

use crate::force::ToolMaterial;
use crate::material::Certainty;
use serde::Serialize;
use utoipa::ToSchema;

/// One force of a row: P = 10 C t^x s^y v^n, N, t in mm, s in mm/rev, v in m/min.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, ToSchema)]
pub struct Coefficients {
    /// Force at 1 mm, 1 mm/rev and 1 m/min: ten times the handbook's C_p.
    #[schema(minimum = 0, example = 2430.0, extensions(("x-unit" = json!("N")), ("x-symbol" = json!("10 C"))))]
    pub coefficient: f64,
    /// Exponent of the depth of cut.
    #[schema(minimum = 0, example = 0.9, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("x"))))]
    pub depth_exponent: f64,
    /// Exponent of the feed.
    #[schema(minimum = 0, example = 0.6, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("y"))))]
    pub feed_exponent: f64,
    /// Exponent of the cutting speed.
    #[schema(maximum = 0, example = -0.3, extensions(("x-unit" = json!("1")), ("x-symbol" = json!("n"))))]
    pub speed_exponent: f64,
    /// How certain these four numbers are.
    pub certainty: Certainty,
}

/// External longitudinal turning of one work material with one tool material.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, ToSchema)]
pub struct HandbookRow {
    /// Tool material.
    pub tool_material: ToolMaterial,
    /// With a wiper edge (end cutting edge angle 0).
    pub wiper_edge: bool,
    /// Main force P_z.
    pub main: Coefficients,
    /// Passive force P_y; absent where the handbook gives none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub passive: Option<Coefficients>,
    /// Feed force P_x; absent where the handbook gives none.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub feed: Option<Coefficients>,
    /// Where the row comes from.
    pub source: &'static str,
}

use Certainty::{Confirmed, Likely, ToBeChecked};
use ToolMaterial::{Carbide, Hss};

/// C as printed, in kgf, x, y, n.
const fn force(
    c: f64,
    depth_exponent: f64,
    feed_exponent: f64,
    speed_exponent: f64,
    certainty: Certainty,
) -> Coefficients {
    Coefficients { coefficient: 10.0 * c, depth_exponent, feed_exponent, speed_exponent, certainty }
}

const fn row(
    tool_material: ToolMaterial,
    main: Coefficients,
    passive: Option<Coefficients>,
    feed: Option<Coefficients>,
) -> HandbookRow {
    HandbookRow { tool_material, wiper_edge: false, main, passive, feed, source: super::SOURCE }
}

/// Constructional steel and steel castings of 750 N/mm² tensile strength.
pub static STEEL: [HandbookRow; 3] = [
    row(
        Carbide,
        force(300.0, 1.0, 0.75, -0.15, Confirmed),
        Some(force(243.0, 0.9, 0.6, -0.3, Confirmed)),
        Some(force(339.0, 1.0, 0.5, -0.4, Likely)),
    ),
    HandbookRow {
        wiper_edge: true,
        ..row(
            Carbide,
            force(384.0, 0.9, 0.9, -0.15, ToBeChecked),
            Some(force(355.0, 0.6, 0.8, -0.3, ToBeChecked)),
            Some(force(241.0, 1.05, 0.2, -0.4, ToBeChecked)),
        )
    },
    row(
        Hss,
        force(200.0, 1.0, 0.75, 0.0, Likely),
        Some(force(125.0, 0.9, 0.75, 0.0, Likely)),
        Some(force(67.0, 1.2, 0.65, 0.0, Likely)),
    ),
];

/// Stainless and heat-resistant steel 12Kh18N9T, HB 141.
pub static STAINLESS: [HandbookRow; 1] = [row(Carbide, force(204.0, 1.0, 0.75, 0.0, Likely), None, None)];

/// Grey cast iron of HB 190.
pub static GREY_IRON: [HandbookRow; 1] = [row(
    Carbide,
    force(92.0, 1.0, 0.75, 0.0, Likely),
    Some(force(54.0, 0.9, 0.75, 0.0, Likely)),
    Some(force(46.0, 1.0, 0.4, 0.0, Likely)),
)];

/// Malleable cast iron of HB 150.
pub static MALLEABLE_IRON: [HandbookRow; 2] = [
    row(
        Carbide,
        force(81.0, 1.0, 0.75, 0.0, Likely),
        Some(force(43.0, 0.9, 0.75, 0.0, Likely)),
        Some(force(38.0, 1.0, 0.4, 0.0, Likely)),
    ),
    row(
        Hss,
        force(100.0, 1.0, 0.75, 0.0, Likely),
        Some(force(88.0, 0.9, 0.75, 0.0, Likely)),
        Some(force(40.0, 1.2, 0.65, 0.0, Likely)),
    ),
];

/// Multiphase copper alloys of HB 120.
pub static COPPER: [HandbookRow; 1] = [row(Hss, force(55.0, 1.0, 0.66, 0.0, Likely), None, None)];

/// Aluminium and silumin.
pub static ALUMINIUM: [HandbookRow; 1] = [row(Hss, force(40.0, 1.0, 0.75, 0.0, Likely), None, None)];
