//! A detector that knows more than any watch can: which changes may come, and how large exactly they are. Like a watch it learns the
//! mean profile from the parts. What it needs to find and to name a change is what the parts allow at best.

use nalgebra::{Cholesky, DMatrix, DVector};
use precut_calc::num::stats::Resampler;

use super::series::{Hidden, Recipe, Series};

/// Prior standard deviation of a cosine of the mean profile, um, and how many there are, as in the watch.
const PROFILE_UM: f64 = 10.0;
const COSINES: usize = 8;
/// Parts before anything is called a change.
const LEARNING: usize = 20;
/// So many parts after a change was found it is named.
const AFTER: usize = 3;

/// Inner products of what a part may show, whitened by its true covariance: what is free, and then the changes.
struct Place {
    rows: DMatrix<f64>,
    gram: DMatrix<f64>,
}

/// What may come in one kind of series, part by part.
pub(crate) struct Knowing {
    pub(crate) changes: Vec<Hidden>,
    free: usize,
    /// The part with which a change comes.
    changed: u32,
    places: Vec<Place>,
}

/// The statistic after a part, and the change that leads then.
#[derive(Debug, Clone, Copy)]
struct Said {
    log_r: f64,
    leader: usize,
}

impl Knowing {
    /// Of all changes of these series, of a size of `delta` standard deviations of a part.
    pub(crate) fn of(changes: Vec<Hidden>, delta: f64, changed: u32, count: u32) -> Self {
        let series = |hidden: &Hidden| {
            let change = Some((*hidden, delta, changed));
            Series::of(&Recipe { count, change, lives: hidden.lives(), two_types: false, tails: false }, 0)
        };
        let all: Vec<Series> = changes.iter().map(series).collect();
        let place = |n: usize| {
            let one = &all[0];
            let cosine = |k: usize| {
                let at = |u: &f64| PROFILE_UM * (k as f64 * std::f64::consts::PI * u).cos();
                DVector::from_iterator(one.share[n].len(), one.share[n].iter().map(at))
            };
            let columns: Vec<_> = (0..COSINES).map(cosine).chain(all.iter().map(|own| own.shift[n].clone())).collect();
            let factor = one.covariance[n].clone().cholesky().unwrap();
            let rows = factor.l().solve_lower_triangular(&DMatrix::from_columns(&columns)).unwrap();
            Place { gram: rows.tr_mul(&rows), rows }
        };
        Self { free: COSINES, changed, places: (0..count as usize).map(place).collect(), changes }
    }

    /// Parts of which one change acts from an index on; whitened inner products of what they show with everything.
    fn drawn(&self, random: &mut Resampler, change: Option<(usize, f64, usize)>) -> Vec<DVector<f64>> {
        let of = |(n, place): (usize, &Place)| {
            let mut rows = DVector::from_fn(place.rows.nrows(), |_, _| random.normal());
            if let Some((own, sign, since)) = change
                && n >= since
            {
                rows += place.rows.column(self.free + own) * sign;
            }
            place.rows.tr_mul(&rows)
        };
        self.places.iter().enumerate().map(of).collect()
    }

    /// After the first `count` parts: the sum over onsets of all Bayes factors, a change having one size and the signs that it may have.
    fn said(&self, right: &[DVector<f64>], count: usize) -> Said {
        let free = self.free;
        let (mut a, mut eta) = (DMatrix::<f64>::identity(free, free), DVector::<f64>::zeros(free));
        for (place, right) in self.places.iter().zip(right).take(count) {
            a += place.gram.view((0, 0), (free, free));
            eta += right.rows(0, free);
        }
        let factor = Cholesky::new(a).unwrap();
        let half = factor.l_dirty().solve_lower_triangular(&eta).unwrap();
        let each = self.changes.len();
        let (mut g, mut b) = (DVector::<f64>::zeros(each), DVector::<f64>::zeros(each));
        let mut c = DMatrix::<f64>::zeros(free, each);
        let mut sums = vec![0.0; each];
        for n in (0..count).rev() {
            let gram = &self.places[n].gram;
            g += gram.diagonal().rows(free, each);
            b += right[n].rows(free, each);
            c += gram.view((0, free), (free, each));
            let halved = factor.l_dirty().solve_lower_triangular(&c).unwrap();
            for (own, sum) in sums.iter_mut().enumerate() {
                let column = halved.column(own);
                let (g, b) = (g[own] - column.norm_squared(), b[own] - column.dot(&half));
                let signs: &[f64] = if self.changes[own].both_signs() { &[1.0, -1.0] } else { &[1.0] };
                let of = |sign: &f64| (sign * b - 0.5 * g).exp() / (signs.len() * each) as f64;
                *sum += signs.iter().map(of).sum::<f64>();
            }
        }
        let leader = (0..each).max_by(|&a, &b| sums[a].total_cmp(&sums[b])).unwrap_or(0);
        Said { log_r: sums.iter().sum::<f64>().ln(), leader }
    }

    /// ln of the threshold with one false alarm in `every` parts, by simulation of so many streams.
    pub(crate) fn threshold(&self, every: f64, streams: u64) -> f64 {
        let stream = |seed: u64| -> Vec<f64> {
            let right = self.drawn(&mut Resampler::new(seed, 31), None);
            (LEARNING + 1..=self.places.len()).map(|count| self.said(&right, count).log_r).collect()
        };
        let all: Vec<Vec<f64>> = (0..streams).map(stream).collect();
        let length = |limit: f64| {
            let until = |own: &Vec<f64>| own.iter().position(|log_r| *log_r >= limit);
            let watched: usize = all.iter().map(|own| until(own).map_or(own.len(), |place| place + 1)).sum();
            watched as f64 / (all.iter().filter(|own| until(own).is_some()).count() as f64).max(1.0)
        };
        let (mut low, mut high) = (0.0, 12.0);
        for _ in 0..30 {
            let middle = f64::midpoint(low, high);
            (low, high) = if length(middle) < every { (middle, high) } else { (low, middle) };
        }
        high
    }

    /// Delay of one draw of a change, and whether it leads some parts after it was found; nothing where
    /// chance alarms before. 99 is not found within `waited` parts.
    pub(crate) fn draw(&self, own: usize, log_threshold: f64, waited: u32, seed: u64) -> Option<(u32, bool)> {
        let mut random = Resampler::new(seed, 32);
        let sign = if self.changes[own].both_signs() && random.uniform() < 0.5 { -1.0 } else { 1.0 };
        let before = self.changed as usize - 1;
        let right = self.drawn(&mut random, Some((own, sign, before)));
        let alarms = |count: &usize| self.said(&right, *count).log_r >= log_threshold;
        let Some(found) = (LEARNING + 1..=before + waited as usize).find(alarms) else { return Some((99, false)) };
        let delay = u32::try_from(found.checked_sub(before)?).ok().filter(|delay| *delay > 0)?;
        Some((delay, self.said(&right, found + AFTER).leader == own))
    }
}
