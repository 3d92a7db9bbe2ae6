//! Places along a shaft at which errors of its diameter are told, and how far they go between them.

use std::ops::Range;

/// Places, mm, in zones that are steady in themselves.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct Places {
    pub(crate) z_mm: Vec<f64>,
    pub(crate) zones: Vec<Range<usize>>,
}

impl Places {
    /// Largest and smallest error, between the stations, too: there by the parabola through three neighbours.
    pub(crate) fn extremes_um(&self, errors_um: &[f64]) -> [f64; 2] {
        let mut most = [f64::NEG_INFINITY, f64::INFINITY];
        for zone in &self.zones {
            for (i, &error) in errors_um[zone.clone()].iter().enumerate() {
                most = [most[0].max(error), most[1].min(error)];
                let here = zone.start + i;
                if here > zone.start && here + 1 < zone.end {
                    let around = here - 1..here + 2;
                    if let Some(top) = top(&self.z_mm[around.clone()], &errors_um[around]) {
                        most = [most[0].max(top), most[1].min(top)];
                    }
                }
            }
        }
        most
    }
}

/// The value at the top or bottom of the parabola through three points, where that lies within them.
fn top(z: &[f64], e: &[f64]) -> Option<f64> {
    let [z, e]: [[f64; 3]; 2] = [z.try_into().ok()?, e.try_into().ok()?];
    if (e[1] - e[0]) * (e[2] - e[1]) >= 0.0 {
        return None;
    }
    let (before, after) = (z[1] - z[0], z[2] - z[1]);
    let (left, right) = ((e[1] - e[0]) / before, (e[2] - e[1]) / after);
    let curvature = (right - left) / (before + after);
    let slope = (left * after + right * before) / (before + after);
    Some(e[1] - 0.25 * slope * slope / curvature)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_parabola_has_its_top() {
        let e = |z: f64| 7.0 - 0.5 * (z - 1.3).powi(2);
        let z = [0.0, 1.0, 2.5];
        assert!(top(&z, &z.map(e)).is_some_and(|top| (top - 7.0).abs() < 1e-12));
        assert_eq!(top(&z, &[1.0, 2.0, 3.0]), None);
    }
}
