//! The radius along the shaft as it stands, with its steps.

/// Points nearer than this share a station, mm.
const SAME_MM: f64 = 1e-9;

/// A point of the surface. Where the radius jumps two points share a station: the first belongs to what lies before it.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Point {
    pub z_mm: f64,
    pub radius_mm: f64,
    /// Number of the point in the calculator that knows how the work yields there; none where it is rigid.
    pub station: Option<usize>,
}

/// Radius along the shaft, linear between its points; nothing stands beyond the first and the last.
#[derive(Debug, Clone)]
pub(crate) struct Surface {
    points: Vec<Point>,
}

impl Surface {
    /// Of points ascending in z.
    pub(crate) fn new(points: Vec<Point>) -> Self {
        Self { points }
    }

    pub(crate) fn points(&self) -> &[Point] {
        &self.points
    }

    /// Largest radius anywhere, mm.
    pub(crate) fn widest_mm(&self) -> f64 {
        self.points.iter().map(|point| point.radius_mm).fold(0.0, f64::max)
    }

    /// Largest radius in the open stretch between two stations, mm; 0 where nothing stands.
    pub(crate) fn highest_mm(&self, a_mm: f64, b_mm: f64) -> f64 {
        let (from, to) = (a_mm.min(b_mm), a_mm.max(b_mm));
        let first = self.points.partition_point(|point| point.z_mm <= from).saturating_sub(1);
        let pieces = self.points[first..].windows(2).take_while(|pair| pair[0].z_mm < to);
        pieces
            .filter_map(|pair| {
                let (left, right) = (pair[0].z_mm.max(from), pair[1].z_mm.min(to));
                (left < right).then(|| between(pair, left).max(between(pair, right)))
            })
            .fold(0.0, f64::max)
    }

    /// Largest radius at a station, of both sides where it jumps, mm; 0 beside the shaft.
    pub(crate) fn at_mm(&self, z_mm: f64) -> f64 {
        let first = self.points.partition_point(|point| point.z_mm < z_mm).saturating_sub(1);
        let pieces = self.points[first..].windows(2).take_while(|pair| pair[0].z_mm <= z_mm);
        pieces
            .filter(|pair| pair[0].z_mm <= z_mm && z_mm <= pair[1].z_mm)
            .map(|pair| {
                if pair[0].z_mm < pair[1].z_mm { between(pair, z_mm) } else { pair[0].radius_mm.max(pair[1].radius_mm) }
            })
            .fold(0.0, f64::max)
    }

    /// Indices of the points that a move between two stations passes. An end of the move within `slack_mm` of a jump, or of
    /// an end of the shaft, means that place: the side of the jump counts that lies in the move.
    pub(crate) fn passed(&self, from_mm: f64, to_mm: f64, slack_mm: f64) -> impl Iterator<Item = usize> + use<'_> {
        let (low, high) = (from_mm.min(to_mm), from_mm.max(to_mm));
        let first = self.points.partition_point(|point| point.z_mm < low - slack_mm);
        let end = self.points.partition_point(|point| point.z_mm <= high + slack_mm);
        (first..end).filter(move |&k| {
            let z = self.points[k].z_mm;
            let begins = k == 0 || self.is_jump(k - 1);
            let ends = k + 1 == self.points.len() || self.is_jump(k);
            if (z - low).abs() <= slack_mm && begins != ends {
                begins
            } else if (z - high).abs() <= slack_mm && begins != ends {
                ends
            } else {
                low <= z && z <= high
            }
        })
    }

    /// Whether the radius jumps between a point and the next.
    fn is_jump(&self, point: usize) -> bool {
        self.points[point + 1].z_mm - self.points[point].z_mm <= SAME_MM
    }

    pub(crate) fn set(&mut self, point: usize, radius_mm: f64) {
        self.points[point].radius_mm = radius_mm;
    }
}

/// Radius of a piece at a station in it.
fn between(pair: &[Point], z_mm: f64) -> f64 {
    let share = (z_mm - pair[0].z_mm) / (pair[1].z_mm - pair[0].z_mm);
    pair[0].radius_mm + share * (pair[1].radius_mm - pair[0].radius_mm)
}

#[cfg(test)]
#[allow(clippy::float_cmp)] // what stands is what was given
mod tests {
    use super::*;

    fn stepped() -> Surface {
        let point = |z_mm, radius_mm| Point { z_mm, radius_mm, station: None };
        Surface::new(vec![
            point(0.0, 30.0),
            point(100.0, 30.0),
            point(100.0, 20.0),
            point(200.0, 20.0),
            point(300.0, 25.0),
        ])
    }

    #[test]
    fn the_highest_of_an_open_stretch_does_not_see_the_step_at_its_end() {
        let surface = stepped();
        assert_eq!(surface.highest_mm(100.0, 150.0), 20.0);
        assert_eq!(surface.highest_mm(150.0, 99.0), 30.0);
        assert_eq!(surface.highest_mm(200.0, 250.0), 22.5);
        assert_eq!([surface.highest_mm(300.0, 310.0), surface.highest_mm(-5.0, 0.0)], [0.0, 0.0]);
        assert_eq!([surface.at_mm(100.0), surface.at_mm(250.0), surface.at_mm(301.0)], [30.0, 22.5, 0.0]);
    }

    #[test]
    fn a_move_passes_its_own_side_of_a_step() {
        let surface = stepped();
        let passed = |a, b| surface.passed(a, b, 1e-4).collect::<Vec<_>>();
        assert_eq!(passed(0.0, 100.0), [0, 1]);
        assert_eq!(passed(200.0, 100.0), [2, 3]);
        assert_eq!(passed(50.0, 300.0), [1, 2, 3, 4]);
        assert_eq!((passed(0.0, 100.000_05), passed(99.999_95, 200.0)), (vec![0, 1], vec![2, 3]));
    }
}
