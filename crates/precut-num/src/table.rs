//! Values over one or two axes, straight between the places they are given at, beyond them as at the ends.

/// An axis: its places, ascending, at least one; and where is asked.
pub type Asked<'a> = (&'a [f64], f64);

/// A value with its slopes.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Straight {
    /// The value.
    pub value: f64,
    /// Its slope along each axis; 0 beyond the ends.
    pub slopes: [f64; 2],
}

/// The value where is asked. `values` run through the places of the second axis first.
pub fn straight(first: Asked<'_>, second: Option<Asked<'_>>, values: &[f64]) -> Straight {
    let (a, b) = (Bracket::of(first), second.map_or(Bracket::WHOLE, Bracket::of));
    let width = second.map_or(1, |(places, _)| places.len());
    let of = |i: usize, j: usize| values.get(i * width + j).copied().unwrap_or(0.0);
    let along_b = |i: usize| (1.0 - b.share) * of(i, b.below) + b.share * of(i, b.above);
    let slope_b = |i: usize| (of(i, b.above) - of(i, b.below)) * b.per_step;
    Straight {
        value: (1.0 - a.share) * along_b(a.below) + a.share * along_b(a.above),
        slopes: [
            (along_b(a.above) - along_b(a.below)) * a.per_step,
            (1.0 - a.share) * slope_b(a.below) + a.share * slope_b(a.above),
        ],
    }
}

/// The places about where is asked.
struct Bracket {
    below: usize,
    above: usize,
    share: f64,
    /// 1/(distance of both).
    per_step: f64,
}

impl Bracket {
    const WHOLE: Self = Self { below: 0, above: 0, share: 0.0, per_step: 0.0 };

    fn of((places, at): Asked<'_>) -> Self {
        let next = places.partition_point(|place| *place <= at);
        match next.checked_sub(1) {
            Some(below) if next < places.len() => {
                let step = places[next] - places[below];
                Self { below, above: next, share: (at - places[below]) / step, per_step: 1.0 / step }
            }
            Some(last) => Self { below: last, above: last, share: 0.0, per_step: 0.0 },
            None => Self::WHOLE,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_table_of_a_bilinear_function_is_that_function_within_it() {
        let (speeds, depths) = ([1.0, 2.0, 5.0], [0.5, 3.0]);
        let of = |u: f64, t: f64| 2.0 - 0.3 * u + 1.5 * t + 0.7 * u * t;
        let values: Vec<f64> = speeds.iter().flat_map(|u| depths.map(|t| of(*u, t))).collect();
        for (u, t) in [(1.0, 0.5), (1.7, 2.9), (2.0, 1.0), (4.2, 0.6)] {
            let found = straight((&speeds, u), Some((&depths, t)), &values);
            assert!((found.value - of(u, t)).abs() < 1e-12);
            assert!(
                (found.slopes[0] - (0.7 * t - 0.3)).abs() < 1e-12 && (found.slopes[1] - (1.5 + 0.7 * u)).abs() < 1e-12
            );
        }
        // Beyond it as at the ends.
        let beyond = straight((&speeds, 9.0), Some((&depths, 0.1)), &values);
        assert!((beyond.value - of(5.0, 0.5)).abs() < 1e-12 && beyond.slopes.iter().all(|slope| slope.abs() < 1e-12));
        let line = straight((&speeds, 3.5), None, &[1.0, 4.0, 1.0]);
        assert!((line.value - 2.5).abs() < 1e-12 && (line.slopes[0] + 1.0).abs() < 1e-12);
    }
}
