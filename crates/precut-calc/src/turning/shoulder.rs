//! Shoulders that the edge runs into before the nose is there.

use crate::calculator::Finding;
use crate::shaft::FeedDirection;

/// Code of the warning made here.
pub(crate) const EDGE_MEETS_SHOULDER: &str = "edge_meets_shoulder";

/// An edge at this angle stands square to the axis, degrees.
const SQUARE_DEG: f64 = 90.0;

/// A stretch of the finished shaft.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Finished {
    pub to_mm: f64,
    pub diameter_mm: f64,
    /// Whether the tool cuts it.
    pub is_turned: bool,
}

/// Shoulders toward which the tool feeds with an edge below 90 degrees: it leads the nose by h/tan(kappa) at the height h
/// and cuts into the face before the nose is there. The stretches ascend; `pointer` is the field of the angle.
pub(crate) fn edge_meets_shoulders(
    angle_deg: Option<f64>,
    pointer: &'static str,
    direction: FeedDirection,
    finished: &[Finished],
) -> Vec<Finding> {
    let Some(angle_deg) = angle_deg.filter(|angle| *angle < SQUARE_DEG) else { return Vec::new() };
    let lead = angle_deg.to_radians().tan().recip();
    let meets = |pair: &[Finished]| {
        let (cut, ahead) = match direction {
            FeedDirection::ToHeadstock => (pair[1], pair[0]),
            FeedDirection::ToTailstock => (pair[0], pair[1]),
        };
        let height_mm = (ahead.diameter_mm - cut.diameter_mm) / 2.0;
        (cut.is_turned && height_mm > 0.0).then(|| {
            Finding::new(EDGE_MEETS_SHOULDER, pointer)
                .measured(angle_deg, SQUARE_DEG, "deg")
                .with("z_mm", pair[0].to_mm)
                .with("height_mm", height_mm)
                .with("reach_mm", height_mm * lead)
        })
    };
    finished.windows(2).filter_map(meets).collect()
}
