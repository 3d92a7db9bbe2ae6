//! Running sums over parts from an onset on, and the evidence that they hold (`process/3.2`).

use nalgebra::{Cholesky, DMatrix, DVector, Dyn};
use statrs::function::erf::erfc;

use crate::process::change::null::{DRIFT_PARTS, Form, Null, Told};
use crate::process::part::sight::COSINES;

/// G, b and c of every basic column over the parts since an onset, for a step and for a drift; of the cosines all products.
pub(in crate::process) struct Sums {
    /// X'X of every column alone: times 1, times n - tau, and times its square.
    square: [Vec<f64>; 3],
    /// X'r: times 1, and times n - tau.
    right: [Vec<f64>; 2],
    /// X'B, likewise.
    free: [DMatrix<f64>; 2],
    /// X'X of the cosines.
    waves: DMatrix<f64>,
}

/// One column on some parts.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::process) struct Fit {
    /// ln BF.
    pub(in crate::process) log_bf: f64,
    /// Size in prior standard deviations at scale 1: its posterior mean.
    pub(in crate::process) mean: f64,
    pub(in crate::process) variance: f64,
}

/// Beyond so many standard deviations a bound is no bound.
const FAR: f64 = 6.0;

/// Where the size of a cause cannot leave a range.
#[derive(Debug, Clone, Copy)]
pub(in crate::process) enum Reach {
    Free,
    /// Between these ends, where the prior has ln P(within) of its own.
    Bounded {
        least: f64,
        most: f64,
        log_before: f64,
    },
}

impl Reach {
    /// `scale` is the standard deviation of the prior.
    pub(in crate::process) fn of(scale: f64, [least, most]: [f64; 2]) -> Self {
        if least < -FAR * scale && most > FAR * scale {
            return Self::Free;
        }
        Self::Bounded { least, most, log_before: normal_between(least / scale, most / scale).ln() }
    }
}

impl Fit {
    /// The same where the size cannot leave a range: both densities are cut off there.
    pub(in crate::process) fn within(self, reach: &Reach) -> Self {
        let &Reach::Bounded { least, most, log_before } = reach else { return self };
        let deviation = self.variance.sqrt();
        let [a, b] = [least, most].map(|end| (end - self.mean) / deviation);
        let own = normal_between(a, b);
        // So far outside that only the bound is left.
        if own < f64::MIN_POSITIVE {
            let log_bf = self.log_bf - 0.5 * a.max(-b).powi(2) - log_before;
            return Self { log_bf, mean: self.mean.clamp(least, most), variance: 0.0 };
        }
        let density =
            |x: f64| if x.is_finite() { (-0.5 * x * x).exp() / (2.0 * std::f64::consts::PI).sqrt() } else { 0.0 };
        let times = |x: f64| if x.is_finite() { x * density(x) } else { 0.0 };
        let shift = (density(a) - density(b)) / own;
        let spread = 1.0 + (times(a) - times(b)) / own - shift * shift;
        Self {
            log_bf: self.log_bf + own.ln() - log_before,
            mean: (self.mean + deviation * shift).clamp(least, most),
            variance: self.variance * spread.max(0.0),
        }
    }
}

/// Probability of a standard normal number between two ends.
fn normal_between(a: f64, b: f64) -> f64 {
    // On the side where it loses no digits.
    if a > 0.0 { upper_tail(a) - upper_tail(b) } else { upper_tail(-b) - upper_tail(-a) }
}

fn upper_tail(x: f64) -> f64 {
    if x == f64::INFINITY {
        0.0
    } else if x == f64::NEG_INFINITY {
        1.0
    } else {
        0.5 * erfc(x / std::f64::consts::SQRT_2)
    }
}

impl Sums {
    pub(in crate::process) fn none(free: usize, basic: usize) -> Self {
        let zeros = || vec![0.0; basic];
        Self {
            square: [zeros(), zeros(), zeros()],
            right: [zeros(), zeros()],
            free: [DMatrix::zeros(basic, free), DMatrix::zeros(basic, free)],
            waves: DMatrix::zeros(COSINES, COSINES),
        }
    }

    /// The onset moves so many parts back: (k + d)^2 = k^2 + 2 d k + d^2.
    pub(in crate::process) fn earlier(&mut self, by: f64) {
        let [one, first, second] = &mut self.square;
        for ((second, first), one) in second.iter_mut().zip(first.iter_mut()).zip(one.iter()) {
            *second += by * (2.0 * *first + by * one);
            *first += by * one;
        }
        let [one, first] = &mut self.right;
        first.iter_mut().zip(one.iter()).for_each(|(first, one)| *first += by * one);
        let [one, first] = &mut self.free;
        first.zip_apply(&*one, |first, one| *first += by * one);
    }

    /// A part with which it begins.
    pub(in crate::process) fn begin_with(&mut self, part: &Told<'_>) {
        let (inner, last) = (&part.gram.inner, part.gram.residual());
        for basic in 0..last {
            self.square[0][basic] += inner[(basic, basic)];
            self.right[0][basic] += inner[(basic, last)];
        }
        for (k, &(weight, own)) in part.free.iter().enumerate() {
            if weight == 0.0 {
                continue;
            }
            let column = inner.column(own);
            let sums = self.free[0].column_mut(k).into_iter().zip(column.iter());
            sums.for_each(|(sum, product)| *sum += weight * product);
        }
        self.waves += inner.view((0, 0), (COSINES, COSINES));
    }

    /// L^-1 c of every basic column.
    pub(in crate::process) fn halved(&self, form: Form, null: &Null) -> DMatrix<f64> {
        match form {
            Form::Step => null.halved(&self.free[0].transpose()),
            Form::Drift => null.halved(&((&self.free[0] + &self.free[1]).transpose() / DRIFT_PARTS)),
        }
    }

    /// ln BF = -1/2 ln(1 + s^2 G*) + 1/2 s^2 b*^2/(1 + s^2 G*), of one column of prior standard deviation s.
    pub(in crate::process) fn one(
        &self,
        basic: usize,
        form: Form,
        scale: f64,
        halved: &DMatrix<f64>,
        null: &Null,
    ) -> Fit {
        let (g, b) = match form {
            Form::Step => (self.square[0][basic], self.right[0][basic]),
            // A drift acts (n - tau + 1)/20: (k + 1)^2 = k^2 + 2 k + 1.
            Form::Drift => {
                let [one, first, second] = self.square.each_ref().map(|sums| sums[basic]);
                let right = self.right[0][basic] + self.right[1][basic];
                ((second + 2.0 * first + one) / DRIFT_PARTS.powi(2), right / DRIFT_PARTS)
            }
        };
        let own = halved.column(basic);
        let (g, b) = ((g - own.norm_squared()).max(0.0), b - own.dot(&null.half));
        let s2 = scale * scale;
        let spread = 1.0 + s2 * g;
        Fit { log_bf: -0.5 * spread.ln() + 0.5 * s2 * b * b / spread, mean: s2 * b / spread, variance: s2 / spread }
    }

    /// G* and b* of all cosines.
    pub(in crate::process) fn cosines(&self, halved: &DMatrix<f64>, null: &Null) -> Cosines {
        let own = halved.columns(0, COSINES);
        let g = &self.waves - own.tr_mul(&own);
        let b = DVector::from_column_slice(&self.right[0][..COSINES]) - own.tr_mul(&null.half);
        Cosines { g, b }
    }
}

/// What parts since an onset tell of a step of all cosines, what is free taken out.
pub(in crate::process) struct Cosines {
    g: DMatrix<f64>,
    b: DVector<f64>,
}

impl Cosines {
    /// The evidence of all of them with these prior standard deviations.
    pub(in crate::process) fn waves(&self, sd: &[f64]) -> Option<Waves> {
        let sd = DVector::from_column_slice(sd);
        let unit = |i: usize, j: usize| f64::from(u8::from(i == j));
        let scaled = DMatrix::from_fn(COSINES, COSINES, |i, j| unit(i, j) + sd[i] * self.g[(i, j)] * sd[j]);
        let factor = Cholesky::new(scaled)?;
        let right = sd.component_mul(&self.b);
        let solved = factor.solve(&right);
        let log_det: f64 = factor.l_dirty().diagonal().iter().map(|d| d.ln()).sum();
        let (log_bf, mean) = (0.5 * right.dot(&solved) - log_det, sd.component_mul(&solved));
        Some(Waves { log_bf, mean, sd, factor })
    }
}

/// All cosines on some parts.
#[derive(Debug, Clone)]
pub(in crate::process) struct Waves {
    /// ln BF.
    pub(in crate::process) log_bf: f64,
    /// Posterior means of the sizes, in the unit of the quantity.
    pub(in crate::process) mean: DVector<f64>,
    /// Prior standard deviations, and the factor L of I + S G* S: the covariance is S (L L')^-1 S.
    sd: DVector<f64>,
    factor: Cholesky<f64, Dyn>,
}

impl Waves {
    /// Independent standard deviations of what these sizes do along columns, one size a column of them.
    pub(in crate::process) fn directions(&self, along: &DMatrix<f64>) -> DMatrix<f64> {
        let scaled = DMatrix::from_fn(COSINES, along.nrows(), |size, row| self.sd[size] * along[(row, size)]);
        let half = self.factor.l_dirty().solve_lower_triangular(&scaled);
        half.map_or_else(|| DMatrix::zeros(along.nrows(), COSINES), |half| half.transpose())
    }

    /// Root mean square along the part, and its variance.
    pub(in crate::process) fn rms(&self) -> (f64, f64) {
        let share = |k: usize| if k == 0 { 1.0 } else { 0.5 };
        let weighted = DVector::from_fn(COSINES, |k, _| share(k) * self.mean[k]);
        let rms = self.mean.dot(&weighted).sqrt();
        let slope = weighted / rms.max(f64::MIN_POSITIVE);
        let spread = self.directions(&DMatrix::from_row_slice(1, COSINES, slope.as_slice()));
        (rms, spread.norm_squared())
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::num::stats::Resampler;
    use crate::process::change::null::{Column, Gram, Older, Source};

    /// Causes beside the cosines.
    const CAUSES: usize = 3;
    /// The cause that changed before and stands in the model since then.
    const ACCEPTED: (u32, Form) = (9, Form::Drift);

    struct Stream {
        /// Number, type, and the whitened basic columns with the residual last.
        parts: Vec<(u32, usize, DMatrix<f64>)>,
        columns: Vec<Column>,
    }

    /// Two types, parts that miss rows, numbers that miss parts, a change that was accepted.
    fn stream() -> Stream {
        let mut random = Resampler::new(7, 0);
        let numbers = (1..=24).filter(|number: &u32| !number.is_multiple_of(7));
        let of = |number: u32| {
            let kind = usize::from(number.is_multiple_of(3));
            let rows = if number.is_multiple_of(5) { 6 } else { 9 + 2 * kind };
            (number, kind, DMatrix::from_fn(rows, COSINES + CAUSES + 1, |_, _| random.normal()))
        };
        let parts = numbers.map(of).collect();
        let mut columns: Vec<Column> = Column::profile(0, 0.1).chain(Column::profile(1, 0.2)).collect();
        columns.push(Column { source: Source::Cause(0), since: None, sd: 1.0 });
        columns.push(Column { source: Source::Cause(1), since: Some(ACCEPTED), sd: 0.7 });
        Stream { parts, columns }
    }

    /// ln of the normal density of all rows under covariance I + sum of s^2 x x'.
    fn log_density(rows: &DVector<f64>, columns: &[DVector<f64>]) -> f64 {
        let mut covariance = DMatrix::identity(rows.len(), rows.len());
        for column in columns {
            covariance += column * column.transpose();
        }
        let factor = Cholesky::new(covariance).unwrap();
        let log_det: f64 = factor.l_dirty().diagonal().iter().map(|d| d.ln()).sum();
        -0.5 * rows.dot(&factor.solve(rows)) - log_det
    }

    impl Stream {
        /// A basic column over all rows, weighed part by part.
        fn dense(&self, basic: usize, weight: impl Fn(u32, usize) -> f64) -> DVector<f64> {
            let of = |(number, kind, rows): &(u32, usize, DMatrix<f64>)| {
                (rows.column(basic) * weight(*number, *kind)).as_slice().to_vec()
            };
            DVector::from_vec(self.parts.iter().flat_map(of).collect())
        }
    }

    #[test]
    fn a_size_with_bounds_has_the_evidence_of_a_cut_off_prior() {
        // BF(theta) = exp(theta b - theta^2 g/2) over a normal prior, cut off: by the rectangle rule.
        let (scale, g, b) = (0.7, 3.0, -2.5);
        let spread = 1.0 + scale * scale * g;
        let whole = Fit {
            log_bf: -0.5 * f64::ln(spread) + 0.5 * scale * scale * b * b / spread,
            mean: scale * scale * b / spread,
            variance: scale * scale / spread,
        };
        for [least, most] in [[0.0, 2.0], [-0.3, 0.4], [-9.0, 0.1]] {
            let (mut prior, mut sums) = (0.0, [0.0; 3]);
            let steps = 400_000;
            for k in 0..steps {
                let theta: f64 = least + (most - least) * (f64::from(k) + 0.5) / f64::from(steps);
                let density = (-0.5 * (theta / scale).powi(2)).exp();
                let own = density * (theta * b - 0.5 * theta * theta * g).exp();
                prior += density;
                sums.iter_mut().zip([1.0, theta, theta * theta]).for_each(|(sum, power)| *sum += own * power);
            }
            let mean = sums[1] / sums[0];
            let fit = whole.within(&Reach::of(scale, [least, most]));
            assert!((fit.log_bf - f64::ln(sums[0] / prior)).abs() < 1e-6, "{fit:?}");
            assert!((fit.mean - mean).abs() < 1e-6 && (fit.variance - (sums[2] / sums[0] - mean * mean)).abs() < 1e-6);
        }
        assert_eq!(whole.within(&Reach::of(scale, [-9.0, 9.0])), whole);
        assert!((whole.within(&Reach::of(scale, [900.0, 901.0])).mean - 900.0).abs() < 1e-12);
    }

    #[test]
    fn running_sums_give_the_ratio_of_dense_normal_densities() {
        let stream = stream();
        let gram = |rows: &DMatrix<f64>| Gram::new(rows.tr_mul(rows), rows.nrows());
        let grams: Vec<Gram> = stream.parts.iter().map(|(.., rows)| gram(rows)).collect();
        let told: Vec<Told<'_>> = stream
            .parts
            .iter()
            .zip(&grams)
            .enumerate()
            .map(|(ordinal, ((number, kind, _), gram))| {
                let free = stream.columns.iter().map(|own| (own.weight(*kind, *number), own.basic())).collect();
                Told { number: *number, ordinal, gram, free }
            })
            .collect();
        let null = Null::of(&stream.columns, &Older::none(), told.iter()).unwrap();
        let residual = stream.dense(COSINES + CAUSES, |_, _| 1.0);
        let free: Vec<DVector<f64>> = stream
            .columns
            .iter()
            .map(|own| stream.dense(own.basic(), |number, kind| own.weight(kind, number)))
            .collect();
        let none = log_density(&residual, &free);
        let sd: Vec<f64> = (0..COSINES).map(|k| 1.5 / (1.0 + k as f64)).collect();
        let mut sums = Sums::none(null.columns.len(), COSINES + CAUSES);
        let mut next = None;
        for part in told.iter().rev() {
            sums.earlier(next.map_or(0.0, |next: u32| f64::from(next - part.number)));
            sums.begin_with(part);
            next = Some(part.number);
            let with = |more: &[(usize, f64)], form: Form| {
                let acts = |scale: f64| move |number: u32, _: usize| scale * form.of(number, part.number);
                let more = more.iter().map(|&(basic, scale)| stream.dense(basic, acts(scale)));
                log_density(&residual, &free.iter().cloned().chain(more).collect::<Vec<_>>()) - none
            };
            for form in [Form::Step, Form::Drift] {
                let halved = sums.halved(form, &null);
                for (basic, scale) in [(COSINES + 2, 0.2), (COSINES, 1.0), (COSINES + 1, 1.0)] {
                    let (fit, dense) = (sums.one(basic, form, scale, &halved, &null), with(&[(basic, scale)], form));
                    // Round-off of sums over some 200 rows.
                    assert!(
                        (fit.log_bf - dense).abs() < 1e-9,
                        "{form:?} since {}: {} {dense}",
                        part.number,
                        fit.log_bf
                    );
                }
            }
            let waves: Vec<(usize, f64)> = sd.iter().copied().enumerate().collect();
            let log_bf = sums.cosines(&sums.halved(Form::Step, &null), &null).waves(&sd).unwrap().log_bf;
            assert!((log_bf - with(&waves, Form::Step)).abs() < 1e-9, "since {}", part.number);
        }
    }
}
