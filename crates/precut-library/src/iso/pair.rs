//! An insert in its holder.

use precut_calc::calculator::Finding;

use super::{Holder, Insert};

/// What insert and holder together say of the cut.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Geometry {
    /// Nose radius, mm.
    pub nose_radius_mm: Option<f64>,
    /// Angle of the main edge to the feed, degrees.
    pub cutting_edge_angle_deg: Option<f64>,
    /// Angle of the minor edge to the feed, 180 degrees less main and included angle; a round insert has none.
    pub minor_edge_angle_deg: Option<f64>,
    /// Clearance angle, degrees.
    pub clearance_angle_deg: Option<f64>,
    /// Whether the insert is round: no straight edge.
    pub is_round: bool,
}

/// The geometry of an insert in a holder that takes it: shape, clearance and size agree, and the minor edge is clear of
/// the surface that the nose leaves.
pub fn fit(insert: &Insert, holder: &Holder) -> Result<Geometry, Box<Finding>> {
    let misfit = |at: &'static str, insert_has: String, holder_takes: String| {
        Err(Box::new(
            Finding::new("insert_does_not_fit_holder", "/insert")
                .with("at", at)
                .with("insert", insert_has)
                .with("holder", holder_takes),
        ))
    };
    if insert.shape != holder.shape {
        return misfit("shape", insert.shape.to_string(), holder.shape.to_string());
    }
    if insert.clearance != holder.clearance {
        return misfit("clearance", insert.clearance.to_string(), holder.clearance.to_string());
    }
    if insert.size != holder.insert_size {
        return misfit("size", format!("{:02}", insert.size), format!("{:02}", holder.insert_size));
    }
    let main = holder.cutting_edge_angle_deg();
    let minor = main.zip(insert.included_angle_deg()).map(|(main, included)| 180.0 - main - included);
    if let Some(angle) = minor.filter(|angle| *angle <= 0.0) {
        return Err(Box::new(
            Finding::new("no_minor_edge_clearance", "/holder").measured(angle, 0.0, "deg").with("at", "angle"),
        ));
    }
    Ok(Geometry {
        nose_radius_mm: insert.nose_radius_mm(),
        cutting_edge_angle_deg: main,
        minor_edge_angle_deg: minor,
        clearance_angle_deg: insert.clearance_angle_deg(),
        is_round: insert.is_round(),
    })
}
