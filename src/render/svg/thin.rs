//! Fewer points that look the same.

/// More points than this are thinned.
const MANY: usize = 2000;

/// Points of a run, thinned where there are many: of consecutive points in one pixel column the first,
/// the lowest, the highest and the last stay, in their order. No extreme is lost.
pub(super) fn line(points: Vec<(f64, f64)>) -> Vec<(f64, f64)> {
    if points.len() <= MANY {
        return points;
    }
    let mut kept = Vec::new();
    for column in points.chunk_by(|a, b| same_cell(a.0, b.0, 1.0)) {
        let last = column.len() - 1;
        let by_height = |a: &&usize, b: &&usize| column[**a].1.total_cmp(&column[**b].1);
        let indices: Vec<usize> = (0..column.len()).collect();
        let lowest = indices.iter().min_by(by_height).copied().unwrap_or(0);
        let highest = indices.iter().max_by(by_height).copied().unwrap_or(0);
        let mut stay = [0, lowest, highest, last];
        stay.sort_unstable();
        let mut previous = None;
        for index in stay {
            if previous != Some(index) {
                kept.push(column[index]);
            }
            previous = Some(index);
        }
    }
    kept
}

/// Markers, thinned where there are many: one for every cell of half a marker's size.
pub(super) fn markers(points: Vec<(f64, f64)>) -> Vec<(f64, f64)> {
    const CELL_PX: f64 = 3.0;
    if points.len() <= MANY {
        return points;
    }
    let mut taken = std::collections::BTreeSet::new();
    let cell = |px: f64| (px / CELL_PX).floor().to_bits();
    points.into_iter().filter(|(x, y)| taken.insert((cell(*x), cell(*y)))).collect()
}

/// Bars, thinned where there are many: of those in one pixel column the one that reaches farthest to each side.
pub(super) fn bars(bars: Vec<Bar>) -> Vec<Bar> {
    if bars.len() <= MANY {
        return bars;
    }
    let top = |bar: &&Bar| bar.1.1;
    let mut kept = Vec::new();
    for column in bars.chunk_by(|a, b| same_cell(a.0.0, b.0.0, 1.0)) {
        let lowest = column.iter().min_by(|a, b| top(a).total_cmp(&top(b)));
        let highest = column.iter().max_by(|a, b| top(a).total_cmp(&top(b)));
        kept.extend(lowest.into_iter().chain(highest));
    }
    kept
}

/// Its ends across, and its foot and top.
type Bar = ((f64, f64), (f64, f64));

#[allow(clippy::float_cmp)] // whole numbers
fn same_cell(a: f64, b: f64, size: f64) -> bool {
    (a / size).floor() == (b / size).floor()
}

#[cfg(test)]
#[allow(clippy::unwrap_used, clippy::float_cmp, clippy::cast_precision_loss)]
mod tests {
    use super::*;

    #[test]
    fn few_points_stay_as_they_are() {
        let points: Vec<_> = (0..MANY).map(|i| (i as f64 * 1e-3, 0.0)).collect();
        assert_eq!(line(points.clone()), points);
        assert_eq!(markers(points.clone()), points);
    }

    #[test]
    fn many_points_lose_no_extreme() {
        let count = 100_000;
        let mut points: Vec<_> =
            (0..count).map(|i| (i as f64 * 800.0 / count as f64, (i as f64 * 0.7).sin())).collect();
        points[54_321].1 = 9.0;
        points[54_322].1 = -9.0;
        let thin = line(points.clone());
        assert!(thin.len() <= 4 * 801, "{}", thin.len());
        assert!(thin.contains(&points[54_321]) && thin.contains(&points[54_322]));
        assert_eq!((thin[0], thin[thin.len() - 1]), (points[0], points[count - 1]));
        assert!(thin.is_sorted_by(|a, b| a.0 <= b.0));
    }

    #[test]
    fn many_markers_leave_no_hole() {
        let points: Vec<_> = (0..50_000).map(|i| (f64::from(i % 800), f64::from((i * 7) % 300))).collect();
        let thin = markers(points.clone());
        assert!(thin.len() < points.len() / 2);
        assert!(points.iter().all(|p| thin.iter().any(|t| (p.0 - t.0).abs() < 3.0 && (p.1 - t.1).abs() < 3.0)));
    }
}
