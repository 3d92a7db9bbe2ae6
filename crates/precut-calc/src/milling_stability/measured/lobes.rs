//! Speeds at which a limit is drawn: close together where it bends, as between two lobes and at their tops.

use rayon::prelude::*;

use crate::calculator::Failure;

/// Speeds with even ratios first; then so many rounds, in each of which so many stretches are halved.
const EVEN: u32 = 16;
const ROUNDS: usize = 4;
const HALVED: usize = 6;

/// The limit over the speed, with the number of speeds that even steps of 4 % over a ratio of five would take: stretches are halved whose
/// ends lie farthest from the straight line between their neighbours, in the logarithms of depth and speed. A speed without a limit
/// counts as one at `most_mm`.
pub(super) fn limit_over_speed(
    [slowest, fastest]: [f64; 2],
    most_mm: f64,
    limit_mm: impl Fn(f64) -> Result<Option<f64>, Failure> + Sync,
) -> Result<Vec<(f64, Option<f64>)>, Failure> {
    let at = |speeds: Vec<f64>| -> Result<Vec<(f64, Option<f64>)>, Failure> {
        speeds.into_par_iter().map(|speed| Ok((speed, limit_mm(speed)?))).collect()
    };
    let share = |k: u32| f64::from(k) / f64::from(EVEN - 1);
    let mut known = at((0..EVEN).map(|k| slowest * (fastest / slowest).powf(share(k))).collect())?;
    for _ in 0..ROUNDS {
        let off = bends(&known, most_mm);
        let mut stretches: Vec<usize> = (0..known.len() - 1).collect();
        let of = |k: usize| off[k].max(off[k + 1]);
        // Of those alike the slower first: the order is the same on every machine.
        stretches.sort_by(|a, b| of(*b).total_cmp(&of(*a)).then(a.cmp(b)));
        let middles = stretches.into_iter().take(HALVED).map(|k| (known[k].0 * known[k + 1].0).sqrt());
        known.extend(at(middles.collect())?);
        known.sort_by(|a, b| a.0.total_cmp(&b.0));
    }
    Ok(known)
}

/// How far the logarithm of each limit lies from the straight line between its neighbours; 0 at the ends.
fn bends(known: &[(f64, Option<f64>)], most_mm: f64) -> Vec<f64> {
    let ln = |k: usize| (known[k].0.ln(), known[k].1.unwrap_or(most_mm).ln());
    let of = |k: usize| {
        if k == 0 || k + 1 == known.len() {
            return 0.0;
        }
        let ((from, low), (here, own), (to, high)) = (ln(k - 1), ln(k), ln(k + 1));
        (own - low - (high - low) * (here - from) / (to - from)).abs()
    };
    (0..known.len()).map(of).collect()
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    /// ln of a limit with lobes: valleys at 1, round, tops at whole numbers of swings, sharp.
    fn lobed(speed: f64) -> f64 {
        let swings = 20_000.0 / speed;
        (swings.fract() - 0.5).powi(2) * 6.0
    }

    fn largest_error(known: &[(f64, f64)]) -> f64 {
        let between = |pair: &[(f64, f64)]| {
            let [(from, low), (to, high)] = [pair[0], pair[1]];
            let at = |k: u32| {
                let share = f64::from(k) / 20.0;
                (low + (high - low) * share - lobed(from + (to - from) * share)).abs()
            };
            (0..=20).map(at).fold(0.0, f64::max)
        };
        known.windows(2).map(between).fold(0.0, f64::max)
    }

    #[test]
    fn lines_between_the_speeds_follow_the_lobes_better_than_between_even_ones() {
        let [slowest, fastest] = [3600.0, 19_000.0];
        let limit = |speed: f64| Ok(Some(lobed(speed).exp()));
        let known = limit_over_speed([slowest, fastest], 20.0, limit).unwrap();
        assert_eq!(known.len(), EVEN as usize + ROUNDS * HALVED);
        assert!(known.windows(2).all(|pair| pair[0].0 < pair[1].0));
        let adaptive: Vec<(f64, f64)> = known.iter().map(|(speed, limit)| (*speed, limit.unwrap().ln())).collect();
        let even = (0..known.len()).map(|k| slowest * (fastest / slowest).powf(k as f64 / (known.len() - 1) as f64));
        let even: Vec<(f64, f64)> = even.map(|speed| (speed, lobed(speed))).collect();
        let (adaptive, even) = (largest_error(&adaptive), largest_error(&even));
        assert!(adaptive < 0.6 * even, "{adaptive} {even}");
    }

    #[test]
    fn a_speed_without_a_limit_is_one_where_there_is_no_more_to_look_for() {
        let limit = |speed: f64| Ok((speed < 9000.0).then_some(2.0));
        let known = limit_over_speed([4000.0, 16_000.0], 8.0, limit).unwrap();
        // The step is found to a sixteenth of an even stretch and half of that.
        let last = known.iter().filter(|(_, limit)| limit.is_some()).map(|(speed, _)| *speed).fold(0.0, f64::max);
        let first = known.iter().filter(|(_, limit)| limit.is_none()).map(|(speed, _)| *speed).fold(1e9, f64::min);
        assert!(last < 9000.0 && first >= 9000.0 && first / last < 1.02, "{last} {first}");
    }
}
