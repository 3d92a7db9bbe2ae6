//! Rows that were written more than once: a copy says nothing that the row before did not say (`diagnosis/8`).

use std::f64::consts::PI;

use statrs::distribution::{Binomial, DiscreteCDF};

use crate::calculator::Smooth;
use crate::diagnosis::rows::data::Data;

/// Different rows from which on a table of which each stands equally often is that table several times.
const LEAST_ROWS: usize = 4;
/// Rows of a sweep from which on another that agrees digit for digit is a copy of it.
const LEAST_OF_SWEEP: usize = 3;
/// Chance by which two repeats agree to the digit beyond which it is no sign of a copy.
const COARSE: f64 = 0.1;
/// Chance of so many repeats that agree below which they are copies.
const BY_CHANCE: f64 = 0.01;

/// Rows that copy an earlier one, ascending; `digit` is that to which every value was written, in the unit of the rows;
/// `same_run` tells whether two runs were made alike.
pub(in crate::diagnosis) fn copies(data: &Data, digit: &[f64], same_run: impl Fn(usize, usize) -> bool) -> Vec<usize> {
    if data.sides.is_some() {
        // Two cuts of one class are two cuts.
        return Vec::new();
    }
    let layout = &data.layout;
    let rows = data.value.len();
    let mut sweep = vec![0; rows];
    if layout.design.smooth != Smooth::None {
        for (index, members) in layout.traces.iter().enumerate() {
            for &row in members {
                sweep[row] = index;
            }
        }
    }
    let place = |row: usize| (sweep[row], layout.design.cell[row]);
    let mut copied = Vec::new();
    // Among rows of one test most copies are found without the repeats that agree by chance.
    if let Some(order) = &layout.design.order {
        copied = repeats(data, digit, (0..rows).collect(), |row| (place(row), order[row].to_bits()));
        copied.sort_unstable();
    }
    let others = (0..rows).filter(|row| copied.binary_search(row).is_err()).collect();
    copied.extend(repeats(data, digit, others, place));
    copied.extend(sweeps(data, same_run));
    copied.sort_unstable();
    copied.dedup();
    copied
}

/// Of these rows those that agree digit for digit with one of the same place (and sweep) or of the same condition.
///
/// Repeats may agree by chance, where they are rounded. Their differences d ~ N(0, 2 s^2), rounded to delta, are 0 with
/// a probability of delta/(2 sqrt(pi) s).
fn repeats<P: Ord>(data: &Data, digit: &[f64], mut rows: Vec<usize>, place: impl Fn(usize) -> P) -> Vec<usize> {
    rows.sort_by_key(|&row| (place(row), data.value[row].to_bits(), row));
    let equal = |a: &usize, b: &usize| place(*a) == place(*b) && data.value[*a].to_bits() == data.value[*b].to_bits();
    let classes: Vec<&[usize]> = rows.chunk_by(equal).collect();
    // The whole table several times.
    let times = classes.iter().fold(0, |times, class| greatest_common_divisor(times, class.len()));
    if times > 1 && classes.len() >= LEAST_ROWS {
        return classes.iter().flat_map(|class| &class[class.len() / times..]).copied().collect();
    }
    let alike: Vec<usize> = classes.iter().flat_map(|class| &class[1..]).copied().collect();
    let pairs_of = |count: usize| count * (count - 1) / 2;
    let ties: usize = classes.iter().map(|class| pairs_of(class.len())).sum();
    if ties == 0 {
        return alike;
    }
    let (mut pairs, mut different, mut squares, mut digits) = (0, 0, 0.0, 0.0);
    for at_place in classes.chunk_by(|a, b| place(a[0]) == place(b[0])) {
        let values: Vec<f64> = at_place.iter().flat_map(|class| class.iter().map(|&row| data.value[row])).collect();
        let count = values.len() as f64;
        let mean = values.iter().sum::<f64>() / count;
        different += pairs_of(at_place.len());
        // Sum of (a - b)^2 over all pairs, those that agree among them.
        squares += count * values.iter().map(|value| (value - mean) * (value - mean)).sum::<f64>();
        let here = pairs_of(values.len());
        pairs += here;
        digits += here as f64 * digit[at_place[0][0]];
    }
    if different == 0 {
        return alike;
    }
    let s = (squares / (2.0 * pairs as f64)).sqrt();
    let chance = digits / pairs as f64 / (2.0 * PI.sqrt() * s);
    let by_chance = |chance: f64| Binomial::new(chance, pairs as u64).map(|law| law.sf(ties as u64 - 1));
    if chance < COARSE && by_chance(chance).is_ok_and(|p| p < BY_CHANCE) { alike } else { Vec::new() }
}

/// Significant digits beyond which a number carries the error of its own arithmetic.
const MOST_DIGITS: usize = 12;

/// The digit to which every value was written: the last decimal place that any of them has, or as many significant digits as
/// the longest of them, whichever is coarser there.
pub(crate) fn digits_written(values: &[f64]) -> Vec<f64> {
    // Number of significant digits, and the power of ten of the first.
    let of = |value: f64| {
        let text = format!("{:.*e}", MOST_DIGITS - 1, value.abs());
        let (mantissa, power) = text.split_once('e')?;
        let digits = mantissa.replace('.', "").trim_end_matches('0').len();
        Some((i32::try_from(digits).ok()?, power.parse::<i32>().ok()?)).filter(|(digits, _)| *digits > 0)
    };
    let written: Vec<Option<(i32, i32)>> = values.iter().map(|value| of(*value)).collect();
    let longest = written.iter().flatten().map(|(digits, _)| *digits).max().unwrap_or(1);
    let last_place = written.iter().flatten().map(|(digits, power)| power - digits + 1).min().unwrap_or(0);
    let place = |own: &Option<(i32, i32)>| own.map_or(last_place, |(_, power)| last_place.max(power - longest + 1));
    written.iter().map(|own| 10.0_f64.powi(place(own))).collect()
}

/// Rows of sweeps that agree with an earlier one, of the same run or of one made alike, place by place.
fn sweeps(data: &Data, same_run: impl Fn(usize, usize) -> bool) -> Vec<usize> {
    let layout = &data.layout;
    let (Smooth::Along(place) | Smooth::Around(place)) = &layout.design.smooth else { return Vec::new() };
    let same = |a: usize, b: usize| {
        let (first, second) = (&layout.traces[a], &layout.traces[b]);
        first.len() == second.len()
            && first.iter().zip(second).all(|(&i, &j)| {
                data.value[i].to_bits() == data.value[j].to_bits() && place[i].to_bits() == place[j].to_bits()
            })
            && same_run(layout.run_of_trace[a], layout.run_of_trace[b])
    };
    let is_copy = |sweep: &usize| {
        layout.traces[*sweep].len() >= LEAST_OF_SWEEP && (0..*sweep).any(|earlier| same(earlier, *sweep))
    };
    (0..layout.traces.len()).filter(is_copy).flat_map(|sweep| layout.traces[sweep].iter().copied()).collect()
}

fn greatest_common_divisor(a: usize, b: usize) -> usize {
    if b == 0 { a } else { greatest_common_divisor(b, a % b) }
}

#[cfg(test)]
mod tests {
    use super::digits_written;

    #[test]
    fn values_are_written_to_a_decimal_place_or_to_so_many_digits() {
        let near = |found: Vec<f64>, right: [f64; 3]| found.iter().zip(right).all(|(a, b)| (a / b - 1.0).abs() < 1e-12);
        assert!(near(digits_written(&[0.85, 1.2, 12.45]), [0.01; 3]));
        // Two digits each, and an error of arithmetic.
        assert!(near(digits_written(&[0.1 + 0.2, 4.7, 120.0]), [0.1, 0.1, 10.0]));
        assert!(near(digits_written(&[0.0, -250.0, 1000.0]), [10.0, 10.0, 100.0]));
    }
}
