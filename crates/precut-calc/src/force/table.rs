//! Forces measured over depth.

use super::law::{Component, DepthLaw, Law};
use super::{Forces, ReachedCut, range, rules};
use crate::calculator::{Basis, Finding, Measured, MeasuredRow, Violations};
use serde::{Deserialize, Serialize};
use utoipa::{PartialSchema, ToSchema};

/// Largest depth that the schema allows, mm.
const MOST_DEPTH_MM: f64 = 100.0;

/// Forces measured at one depth of cut.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct ForceRow {
    /// Depth of cut (radial); rows in ascending order.
    #[schema(minimum = 0, maximum = 100, example = 0.5,
        extensions(("x-unit" = json!("mm")), ("x-symbol" = json!("t")), ("x-group" = json!("cut"))))]
    pub depth_mm: f64,
    /// Passive (radial) force P_y.
    #[schema(minimum = 0, maximum = 1_000_000, example = 194.5,
        extensions(("x-unit" = json!("N")), ("x-symbol" = json!("P_y")), ("x-group" = json!("cut"))))]
    pub passive_n: f64,
    /// Main (tangential) force P_z; 0 where it was not measured.
    #[serde(default)]
    #[schema(minimum = 0, maximum = 1_000_000, default = 0.0, example = 424.0,
        extensions(("x-unit" = json!("N")), ("x-symbol" = json!("P_z")), ("x-group" = json!("cut"))))]
    pub main_n: f64,
    /// Feed (axial) force P_x; 0 where it was not measured.
    #[serde(default)]
    #[schema(minimum = 0, maximum = 1_000_000, default = 0.0, example = 165.0,
        extensions(("x-unit" = json!("N")), ("x-symbol" = json!("P_x")), ("x-group" = json!("cut"))))]
    pub feed_n: f64,
}

impl MeasuredRow for ForceRow {
    const MAX_ROWS: usize = 1000;
}

/// Forces measured over the depth at the feed and speed of the job. Equation `deflection/6.3`.
///
/// Between the rows by monotone cubic interpolation (Fritsch and Carlson): no overshoot, and
/// monotone wherever the rows are. From (0, 0) to the first row likewise, unless the first row is
/// at depth 0: then its forces are the constant part. Beyond the last row in a straight line with
/// the slope reached there, and with a warning.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub struct ForceTable {
    /// Rows by ascending depth, at least one at a depth above 0.
    #[schema(schema_with = Measured::<ForceRow>::schema)]
    pub rows: Measured<ForceRow>,
    /// Constant part P_0 by rubbing of the worn flank, added to the law wherever something is cut.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub rubbing: Option<Forces>,
    /// Factor on the law for a worn edge; 1 for a sharp one. Does not act on `rubbing`.
    #[serde(default = "rules::one")]
    #[schema(exclusive_minimum = 0, maximum = 10, default = 1.0, example = 1.2,
        extensions(("x-unit" = json!("1")), ("x-symbol" = json!("K_w")), ("x-group" = json!("cut")), ("x-advanced" = json!(true))))]
    pub wear_factor: f64,
}

impl ForceTable {
    pub(super) fn check(&self, pointer: &str, violations: &mut Violations) {
        let rows = self.rows.rows();
        for (index, row) in rows.iter().enumerate() {
            let at = format!("{pointer}/rows/{index}");
            rules::check_forces(&row.forces(), "bad_force_table", &at, violations);
            let above = if index == 0 { 0.0 } else { rows[index - 1].depth_mm };
            let ascending = row.depth_mm > above || (index == 0 && rules::not_negative(row.depth_mm));
            violations.require(row.depth_mm.is_finite() && ascending, || {
                let finding = Finding::new("bad_force_table", format!("{at}/depth_mm"));
                let finding = finding.measured(row.depth_mm, above, "mm").with("maximum", MOST_DEPTH_MM);
                finding.with(if index == 0 { "minimum" } else { "above" }, above)
            });
        }
        violations.require(rows.last().is_some_and(|row| row.depth_mm > 0.0), || {
            Finding::new("bad_force_table", format!("{pointer}/rows")).with("rows", rows.len())
        });
        rules::check_rubbing(self.rubbing.as_ref(), pointer, violations);
        rules::check_wear(self.wear_factor, pointer, violations);
    }

    pub(super) fn law(&self) -> DepthLaw {
        let law = Law::Table(Box::new(TableLaw::new(self.rows.rows())));
        DepthLaw::new(law, self.wear_factor, self.rubbing.unwrap_or_default())
    }

    pub(super) fn extrapolations(&self, cut: &ReachedCut) -> Vec<Finding> {
        let last = self.rows.rows().last().map_or(0.0, |row| row.depth_mm);
        // Below the first row the origin is known as well.
        range::outside(cut.depth_mm, (0.0, last), "depth", "mm").into_iter().collect()
    }
}

impl ForceRow {
    fn forces(&self) -> Forces {
        Forces { passive_n: self.passive_n, main_n: self.main_n, feed_n: self.feed_n }
    }
}

pub(super) fn basis() -> Vec<Basis> {
    vec![
        Basis { equation: "deflection/6.3", source: "forces measured by the user" },
        Basis {
            equation: "deflection/6.3",
            source: "F. N. Fritsch, R. E. Carlson, Monotone piecewise cubic interpolation, SIAM J. Numer. Anal. 17 (1980) 238-246",
        },
    ]
}

/// Cubic Hermite polynomials between the rows, slopes limited so that they stay monotone.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct TableLaw {
    depths_mm: Vec<f64>,
    curves: [Curve; 3],
}

#[derive(Debug, Clone, PartialEq)]
struct Curve {
    values: Vec<f64>,
    slopes: Vec<f64>,
}

impl TableLaw {
    fn new(rows: &[ForceRow]) -> Self {
        let origin = ForceRow { depth_mm: 0.0, passive_n: 0.0, main_n: 0.0, feed_n: 0.0 };
        let needs_origin = rows.first().is_none_or(|row| row.depth_mm > 0.0);
        let nodes: Vec<ForceRow> = needs_origin.then_some(origin).into_iter().chain(rows.iter().copied()).collect();
        let depths_mm: Vec<f64> = nodes.iter().map(|row| row.depth_mm).collect();
        let curves = [Component::Passive, Component::Main, Component::Feed].map(|component| {
            let values: Vec<f64> = nodes.iter().map(|row| row.forces().get(component)).collect();
            let slopes = monotone_slopes(&depths_mm, &values);
            Curve { values, slopes }
        });
        Self { depths_mm, curves }
    }

    fn curve(&self, component: Component) -> &Curve {
        match component {
            Component::Passive => &self.curves[0],
            Component::Main => &self.curves[1],
            Component::Feed => &self.curves[2],
        }
    }

    pub(super) fn limit(&self, component: Component) -> f64 {
        self.curve(component).values[0]
    }

    pub(super) fn value_and_slope(&self, component: Component, depth_mm: f64) -> (f64, f64) {
        let Curve { values, slopes } = self.curve(component);
        let last = self.depths_mm.len() - 1;
        let right = self.depths_mm.partition_point(|&node| node < depth_mm);
        if right > last {
            return (values[last] + slopes[last] * (depth_mm - self.depths_mm[last]), slopes[last]);
        }
        if right == 0 {
            return (values[0], slopes[0]);
        }
        let left = right - 1;
        let width = self.depths_mm[right] - self.depths_mm[left];
        let u = (depth_mm - self.depths_mm[left]) / width;
        let rise = values[right] - values[left];
        let (from, to) = (slopes[left] * width, slopes[right] * width);
        // v = v_l + u [m_l + u (3 D - 2 m_l - m_r + u (m_l + m_r - 2 D))]
        let (second, third) = (3.0 * rise - 2.0 * from - to, from + to - 2.0 * rise);
        let value = values[left] + u * (from + u * (second + u * third));
        let slope = (from + u * (2.0 * second + 3.0 * u * third)) / width;
        (value, slope)
    }
}

/// Slopes at the nodes: the weighted harmonic mean of the neighbouring chords (Fritsch and
/// Butland's choice within Fritsch and Carlson's region), 0 at an extremum; at the ends the parabola
/// through three points, limited.
fn monotone_slopes(x: &[f64], y: &[f64]) -> Vec<f64> {
    let count = x.len();
    if count < 2 {
        return vec![0.0; count];
    }
    let widths: Vec<f64> = x.windows(2).map(|pair| pair[1] - pair[0]).collect();
    let chords: Vec<f64> = y.windows(2).zip(&widths).map(|(pair, width)| (pair[1] - pair[0]) / width).collect();
    if count == 2 {
        return vec![chords[0]; 2];
    }
    let mut slopes = vec![0.0; count];
    for node in 1..count - 1 {
        let (before, after) = (chords[node - 1], chords[node]);
        if before * after > 0.0 {
            let (near, far) = (2.0 * widths[node] + widths[node - 1], widths[node] + 2.0 * widths[node - 1]);
            slopes[node] = (near + far) / (near / before + far / after);
        }
    }
    slopes[0] = end_slope(widths[0], widths[1], chords[0], chords[1]);
    slopes[count - 1] = end_slope(widths[count - 2], widths[count - 3], chords[count - 2], chords[count - 3]);
    slopes
}

/// Slope at an end: of the parabola through the last three points, but not against the last chord
/// and not above three times it where the chord turns.
fn end_slope(width: f64, next_width: f64, chord: f64, next_chord: f64) -> f64 {
    let slope = ((2.0 * width + next_width) * chord - width * next_chord) / (width + next_width);
    if slope * chord <= 0.0 {
        0.0
    } else if chord * next_chord <= 0.0 && slope.abs() > 3.0 * chord.abs() {
        3.0 * chord
    } else {
        slope
    }
}
