//! Places along a shaft at which errors of its diameter are told, and how far they go between them.

use std::ops::Range;

/// Places, mm, in zones that are steady in themselves.
#[derive(Debug, Clone, Default, PartialEq)]
pub(crate) struct Places {
    pub(crate) z_mm: Vec<f64>,
    pub(crate) zones: Vec<Range<usize>>,
}

impl Places {
    /// Largest and smallest error, between the stations, too.
    pub(crate) fn extremes_um(&self, errors_um: &[f64]) -> [f64; 2] {
        let mut most = [f64::NEG_INFINITY, f64::INFINITY];
        let mut take = |error: f64| most = [most[0].max(error), most[1].min(error)];
        for zone in &self.zones {
            let (z, e) = (&self.z_mm[zone.clone()], &errors_um[zone.clone()]);
            e.iter().copied().for_each(&mut take);
            between(z, e, &mut take);
        }
        most
    }
}

/// The tops and bottoms between places, each by the parabolas through the two places beside it and either neighbour: where both
/// neighbours are there, that which is less beyond the ends. At a bend beside a long step one parabola alone swings far beyond both.
fn between(z: &[f64], e: &[f64], mut take: impl FnMut(f64)) {
    // Almost nowhere does anything turn, and whether it does costs no division.
    let mut turned = true;
    for end in 1..e.len() {
        let [turns, next] =
            if end + 1 < e.len() { turns(&z[end - 1..=end + 1], &e[end - 1..=end + 1]) } else { [true, false] };
        if turned
            && turns
            && let Some(top) = top_between(z, e, end)
        {
            take(top);
        }
        turned = next;
    }
}

/// Whether the parabola through three points turns between the first two, and between the last two: its slopes at the points, times
/// one positive number.
fn turns(z: &[f64], e: &[f64]) -> [bool; 2] {
    let (before, after) = (z[1] - z[0], z[2] - z[1]);
    let (left, right) = (e[1] - e[0], e[2] - e[1]);
    let (p, q, twice) = (left * after * after, right * before * before, 2.0 * before * after);
    let [first, middle, last] = [p + twice * left - q, p + q, q + twice * right - p];
    [first * middle < 0.0, middle * last < 0.0]
}

/// The top or bottom between a place and the one before it.
fn top_between(z: &[f64], e: &[f64], end: usize) -> Option<f64> {
    let within = z[end - 1]..=z[end];
    let through = |from: usize| -> Option<Option<f64>> {
        let three = from..from + 3;
        let top = top(z.get(three.clone())?, e.get(three)?);
        Some(top.filter(|(at, _)| within.contains(at)).map(|(_, value)| value))
    };
    let beyond = |top: f64| (top - e[end - 1]).abs().min((top - e[end]).abs());
    match (end.checked_sub(2).and_then(through), through(end - 1)) {
        (Some(before), Some(after)) => {
            before.zip(after).map(|(one, other)| if beyond(one) <= beyond(other) { one } else { other })
        }
        (one, other) => one.or(other).flatten(),
    }
}

/// Where the parabola through three points turns, and its value there.
fn top(z: &[f64], e: &[f64]) -> Option<(f64, f64)> {
    let [z, e]: [[f64; 3]; 2] = [z.try_into().ok()?, e.try_into().ok()?];
    let (before, after) = (z[1] - z[0], z[2] - z[1]);
    let (left, right) = ((e[1] - e[0]) / before, (e[2] - e[1]) / after);
    let curvature = (right - left) / (before + after);
    let slope = (left * after + right * before) / (before + after);
    Some((z[1] - 0.5 * slope / curvature, e[1] - 0.25 * slope * slope / curvature))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn places(z_mm: &[f64]) -> Places {
        Places { z_mm: z_mm.to_vec(), zones: std::iter::once(0..z_mm.len()).collect() }
    }

    #[test]
    fn a_parabola_has_its_top() {
        let e = |z: f64| 7.0 - 0.5 * (z - 1.3).powi(2);
        for z in [vec![0.0, 1.0, 2.5], vec![-1.0, 0.2, 1.1, 2.0, 4.0]] {
            let errors: Vec<f64> = z.iter().map(|z| e(*z)).collect();
            assert!((places(&z).extremes_um(&errors)[0] - 7.0).abs() < 1e-12);
        }
        let rising = places(&[0.0, 1.0, 2.5]).extremes_um(&[1.0, 2.0, 3.0]);
        assert!((rising[0] - 3.0).abs() + (rising[1] - 1.0).abs() < 1e-12);
    }

    #[test]
    fn what_turns_nowhere_is_passed_over_and_nothing_else() {
        let mut random = crate::num::stats::Resampler::new(5, 0);
        for count in [2, 3, 4, 9].into_iter().cycle().take(4000) {
            let steps: Vec<f64> = (0..count).map(|_| 0.1 + random.uniform()).collect();
            let z: Vec<f64> = steps
                .iter()
                .scan(0.0, |sum, step| {
                    *sum += step;
                    Some(*sum)
                })
                .collect();
            let e: Vec<f64> = (0..count).map(|_| random.normal()).collect();
            let mut found = Vec::new();
            between(&z, &e, |top| found.push(top));
            let all: Vec<f64> = (1..count).filter_map(|end| top_between(&z, &e, end)).collect();
            assert_eq!(found, all, "{z:?} {e:?}");
        }
    }

    /// At the end of a long straight stretch something falls within a short step: no curve through the places needs to rise far above.
    #[test]
    fn a_bend_beside_a_long_step_does_not_swing_beyond() {
        let z = [0.0, 50.0, 100.0, 100.5, 101.0];
        let [most, _] = places(&z).extremes_um(&[0.0, 0.1, 0.2, -1.3, -2.8]);
        let one = top(&z[1..4], &[0.1, 0.2, -1.3]).map(|(_, value)| value);
        assert!(most <= 0.2 + 1e-12 && one.is_some_and(|one| one > 1.0), "{most}, by one parabola {one:?}");
    }
}
