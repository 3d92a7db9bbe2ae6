//! Places along the shaft: decimals of a drawing, and sums of them.
//!
//! 39.2 + 292.9 is 332.09999999999997 to a computer and 332.1 on the drawing. So a sum of lengths is taken as the decimal
//! that it stands for, a place that differs from the end of a segment by rounding alone is that end, and two places are
//! compared with a tolerance far below the last digit of any drawing. All of it stands here and nowhere else.

use std::ops::Range;

/// Places no farther apart than this are one, mm: a thousandth of the last digit of a fine drawing, and more than a
/// hundred times the rounding of a sum of two hundred lengths.
pub(crate) const SAME_MM: f64 = 1e-6;
/// Digits of a millimetre that a sum of lengths keeps: finer ones are rounding.
const PER_MM: f64 = 1e8;
/// Largest share of a sum that its rounding is: two hundred lengths make 4.4e-14.
const ROUNDING: f64 = 1e-12;

/// Whether two places are one.
pub(crate) fn same(a_mm: f64, b_mm: f64) -> bool {
    (a_mm - b_mm).abs() <= SAME_MM
}

/// Whether a place lies between two others, or on one of them.
pub(crate) fn within(z_mm: f64, ends_mm: [f64; 2]) -> bool {
    ends_mm[0] - SAME_MM <= z_mm && z_mm <= ends_mm[1] + SAME_MM
}

/// Where pieces that lie end to end begin, from 0, and where the last one ends.
pub(crate) fn ends_mm(lengths_mm: impl IntoIterator<Item = f64>) -> Vec<f64> {
    let mut sum = 0.0;
    let sums = lengths_mm.into_iter().map(|length| {
        sum += length;
        decimal(sum)
    });
    std::iter::once(0.0).chain(sums).collect()
}

/// The end of a piece that a place stands on; the place itself where it stands on none. `ends_mm` ascend.
pub(crate) fn settled(z_mm: f64, ends_mm: &[f64]) -> f64 {
    let next = ends_mm.partition_point(|end| *end < z_mm - SAME_MM);
    ends_mm.get(next).copied().filter(|end| same(*end, z_mm)).unwrap_or(z_mm)
}

/// The pieces that hold a place, by the ends of all: two where it stands between them, none where it stands beside all.
pub(crate) fn pieces_at(z_mm: f64, ends_mm: &[f64]) -> Range<usize> {
    let Some((_, right)) = ends_mm.split_first() else { return 0..0 };
    let first = right.partition_point(|end| *end < z_mm - SAME_MM);
    let end = ends_mm[..right.len()].partition_point(|start| *start <= z_mm + SAME_MM);
    first..end.max(first)
}

/// The decimal that a sum of decimals stands for: the same number as the one that is typed. What differs from it by more than
/// rounding is no such sum, and stays.
fn decimal(sum_mm: f64) -> f64 {
    let typed = (sum_mm * PER_MM).round() / PER_MM;
    if (typed - sum_mm).abs() <= ROUNDING * sum_mm.abs() { typed } else { sum_mm }
}

#[cfg(test)]
#[allow(clippy::float_cmp, clippy::excessive_precision)] // places are one number
mod tests {
    use super::*;

    #[test]
    fn a_sum_of_decimals_is_the_decimal_that_is_typed() {
        assert_ne!(39.2 + 292.9, 332.1);
        assert_eq!(ends_mm([39.2, 292.9]), [0.0, 39.2, 332.1]);
        assert_eq!(ends_mm([0.1; 10]).last(), Some(&1.0));
        // An eighth of an inch, thrice, and a third of a metre, thrice.
        assert_eq!(ends_mm([3.175; 3]).last(), Some(&9.525));
        assert_eq!(ends_mm([1000.0 / 3.0; 3]).last(), Some(&1000.0));
        assert_eq!(ends_mm([]), [0.0]);
        // No decimal of a drawing: as it is.
        assert_eq!(ends_mm([0.006_130_829_587_834_8]).last(), Some(&0.006_130_829_587_834_8));
    }

    #[test]
    fn a_place_beside_an_end_by_rounding_is_that_end_and_one_a_digit_off_is_not() {
        let ends = [0.0, 39.2, 332.1];
        assert_eq!(settled(332.099_999_999_999_97, &ends), 332.1);
        assert_eq!(settled(-1e-15, &ends), 0.0);
        assert_eq!(settled(39.200_000_000_000_003, &ends), 39.2);
        for z in [332.11, 332.09, 39.201, -0.001] {
            assert_eq!(settled(z, &ends), z);
        }
        assert!(within(332.100_000_000_000_02, [0.0, 332.1]) && !within(332.11, [0.0, 332.1]));
    }

    #[test]
    fn a_step_belongs_to_both_of_its_pieces() {
        let ends = [0.0, 10.0, 30.0];
        let at = |z: f64| pieces_at(z, &ends);
        assert_eq!([at(-1.0), at(0.0), at(10.0), at(10.000_000_000_1), at(20.0)], [0..0, 0..1, 0..2, 0..2, 1..2]);
        assert_eq!([at(30.0), at(31.0).start..at(31.0).start], [1..2, 2..2]);
        assert!(at(31.0).is_empty() && pieces_at(0.0, &[]).is_empty());
    }
}
