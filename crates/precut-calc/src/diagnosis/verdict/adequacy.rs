//! Is anything wrong beyond the scatter? Classical tests beside the posterior (`diagnosis/3.3`).

use nalgebra::{Cholesky, DMatrix, DVector};
use statrs::distribution::{ChiSquared, ContinuousCDF, FisherSnedecor, Normal};

use crate::calculator::{Failure, Monitor, Smooth};
use crate::diagnosis::rows::basis::{dot, smooth_columns};
use crate::diagnosis::rows::noise::pure_error;
use crate::diagnosis::rows::sparse::Sparse;
use crate::diagnosis::verdict::class_tests::of_classes;
use crate::diagnosis::verdict::weigh::Weighing;

/// A test with its statistic and p-value.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Test {
    /// Which.
    pub kind: TestKind,
    /// Its statistic.
    pub statistic: f64,
    /// Degrees of freedom: of the numerator, of the denominator where there is one.
    pub dof: (f64, Option<f64>),
    /// Probability of a larger statistic if the base were right.
    pub p: f64,
    /// The same, corrected for the number of tests after Holm.
    pub p_holm: f64,
}

/// The tests.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum TestKind {
    /// Spread of the means of repeats about the base against the spread within repeats (F).
    LackOfFit,
    /// Residuals in the smooth directions against the scatter and the allowances (F).
    SmoothDirections,
    /// Correlation from row to row (Ljung-Box, chi-squared).
    LjungBox,
    /// Number of runs of one sign (Wald-Wolfowitz, normal).
    Runs,
    /// Squared errors of the base, of which no row is fitted, against what scatter and allowances leave to any model (F).
    HeldOut,
    /// Of classes: minus twice the log-probability of those seen, against classes drawn from the base.
    Deviance,
    /// Of classes: by how much that falls where the rows of every group may be off together, against the same draws.
    Levels,
}

impl TestKind {
    /// Whether neighbours scatter independently is a question of the scatter: rows that are correlated otherwise than its one
    /// number says are no error of the base.
    const OF_SCATTER: [Self; 2] = [Self::LjungBox, Self::Runs];

    /// Whether it holds the base against the scatter.
    pub fn is_of_base(self) -> bool {
        !Self::OF_SCATTER.contains(&self)
    }

    /// The same of a test by its name.
    pub(in crate::diagnosis) fn names_one_of_base(name: &str) -> bool {
        Self::OF_SCATTER.iter().all(|kind| kind.name() != name)
    }

    /// As it is called in the answer.
    pub fn name(self) -> &'static str {
        match self {
            Self::LackOfFit => "lack_of_fit",
            Self::SmoothDirections => "smooth_directions",
            Self::LjungBox => "ljung_box",
            Self::Runs => "runs",
            Self::HeldOut => "held_out",
            Self::Deviance => "deviance",
            Self::Levels => "levels",
        }
    }
}

/// All tests that these rows allow.
pub fn adequacy(weighing: &Weighing<'_>, monitor: &dyn Monitor) -> Result<Vec<Test>, Failure> {
    if let Some(sides) = &weighing.foundation.data.sides {
        let mut tests = of_classes(weighing, sides, monitor)?;
        holm(&mut tests);
        return Ok(tests);
    }
    let mut tests: Vec<Test> =
        [lack_of_fit(weighing), smooth_directions(weighing), ljung_box(weighing), runs(weighing), held_out(weighing)]
            .into_iter()
            .flatten()
            .collect();
    holm(&mut tests);
    Ok(tests)
}

/// Holm's step-down correction: p_(i) times the number of tests not yet rejected, never falling.
fn holm(tests: &mut [Test]) {
    let count = tests.len();
    let mut order: Vec<usize> = (0..count).collect();
    order.sort_by(|&a, &b| tests[a].p.total_cmp(&tests[b].p));
    let mut most: f64 = 0.0;
    for (rank, &index) in order.iter().enumerate() {
        most = most.max(tests[index].p * (count - rank) as f64).min(1.0);
        tests[index].p_holm = most;
    }
}

pub(super) fn test(kind: TestKind, statistic: f64, dof: (f64, Option<f64>), p: f64) -> Option<Test> {
    (statistic.is_finite() && p.is_finite()).then_some(Test { kind, statistic, dof, p, p_holm: p })
}

/// F = [SS_lof/c] / [SS_pe/(n - c)], c distinct conditions; the base has no fitted parameter. Of rows
/// without an order: in a trace neighbours are no repeats of each other.
///
/// SS_lof is what of r' C^-1 r lies between the conditions: what an allowance explains is no lack of fit. Repeats of a
/// condition share its allowances, so SS_pe holds none.
fn lack_of_fit(weighing: &Weighing<'_>) -> Option<Test> {
    let (data, residual) = (weighing.foundation.data, &weighing.foundation.residual);
    if data.layout.design.smooth != Smooth::None {
        return None;
    }
    let scaled: Vec<f64> = residual.iter().enumerate().map(|(row, r)| r / weighing.scatter(row)).collect();
    let (within, dof) = pure_error(data, &scaled, &weighing.keep);
    if dof < 1.0 || within <= 0.0 {
        return None;
    }
    let white = &weighing.linear.residual;
    let conditions: f64 = weighing.whitener.rows() - dof;
    let f = ((white.inner(white) - within) / conditions) / (within / dof);
    let p = FisherSnedecor::new(conditions, dof).ok()?.sf(f.max(0.0));
    test(TestKind::LackOfFit, f, (conditions, Some(dof)), p)
}

/// F = r'r/tr C ~ F(m, nu), m = (tr C)^2/tr(C^2) (Satterthwaite): a sum of squares whose parts hang together through the
/// allowances has fewer degrees of freedom than rows.
///
/// tr(C^2) with C = S + N N', S the scatter: tr(S^2) + 2 tr(N'SN) + |N'N|^2; over long sweeps a correlation rho multiplies
/// the first by (1 + rho^2)/(1 - rho^2) and, of allowances that go smoothly along a sweep, the second by
/// (1 + rho)/(1 - rho).
fn held_out(weighing: &Weighing<'_>) -> Option<Test> {
    let foundation = weighing.foundation;
    let kept = || (0..weighing.keep.len()).filter(|&row| weighing.keep[row]);
    let scatter = |row: usize| weighing.scatter(row).powi(2);
    let rho = weighing.noise.rho;
    let trace: f64 = kept().map(|row| weighing.own_variance(row)).sum();
    let of_scatter: f64 = kept().map(|row| scatter(row).powi(2)).sum();
    let allowed: Vec<Sparse> = foundation.nuisances.iter().map(|column| column.of_rows(&weighing.keep)).collect();
    let of_both: f64 = allowed.iter().flat_map(Sparse::entries).map(|(row, value)| scatter(row) * value * value).sum();
    let mut of_allowances = 0.0;
    for (k, one) in allowed.iter().enumerate() {
        of_allowances += one.inner(one).powi(2);
        of_allowances += allowed[..k].iter().map(|other| 2.0 * one.inner(other).powi(2)).sum::<f64>();
    }
    let square =
        of_scatter * (1.0 + rho * rho) / (1.0 - rho * rho) + 2.0 * of_both * (1.0 + rho) / (1.0 - rho) + of_allowances;
    let left: f64 = kept().map(|row| foundation.residual[row].powi(2)).sum();
    let f = left / trace;
    p_of(TestKind::HeldOut, f, trace * trace / square, weighing.noise.dof)
}

/// The upper tail of F; of a scatter that is known, of chi-squared over its degrees of freedom.
fn p_of(kind: TestKind, f: f64, directions: f64, nu: f64) -> Option<Test> {
    let p = if nu.is_finite() {
        FisherSnedecor::new(directions, nu).ok()?.sf(f.max(0.0))
    } else {
        ChiSquared::new(directions).ok()?.sf((f * directions).max(0.0))
    };
    test(kind, f, (directions, Some(nu)), p)
}

/// T = |Q'r|^2/m ~ F(m, nu), Q an orthonormal basis of the m smooth directions in whitened coordinates.
fn smooth_directions(weighing: &Weighing<'_>) -> Option<Test> {
    let data = weighing.foundation.data;
    let rows: Vec<usize> = (0..data.value.len()).collect();
    let columns: Vec<Vec<f64>> = match &data.layout.design.smooth {
        Smooth::Along(_) => smooth_columns(&data.layout.design.smooth, &rows, 8),
        // Orders 2 to 15: a round part's size and place are its evaluation's own.
        Smooth::Around(_) => smooth_columns(&data.layout.design.smooth, &rows, 15).into_iter().skip(3).collect(),
        Smooth::None => data.layout.design.regressors.clone(),
    };
    let white: Vec<_> = columns.iter().map(|column| weighing.whitener.white(column)).collect();
    let count = white.len();
    if count == 0 {
        return None;
    }
    let residual = &weighing.linear.residual;
    let gram = DMatrix::from_fn(count, count, |i, j| white[i].inner(&white[j]));
    let right = DVector::from_iterator(count, white.iter().map(|column| column.inner(residual)));
    let t = Cholesky::new(gram)?.solve(&right).dot(&right) / count as f64;
    p_of(TestKind::SmoothDirections, t, count as f64, weighing.noise.dof)
}

/// Residuals of every trace, decorrelated, in units of the scatter, less what the allowances explain.
fn whitened_traces(weighing: &Weighing<'_>) -> Vec<Vec<f64>> {
    weighing.whitener.beyond_allowances(&weighing.foundation.residual)
}

/// Q = n (n + 2) sum of r_k^2/(n - k) over lags inside traces.
fn ljung_box(weighing: &Weighing<'_>) -> Option<Test> {
    if weighing.foundation.data.layout.design.smooth == Smooth::None {
        return None;
    }
    let traces = whitened_traces(weighing);
    let shortest = traces.iter().map(Vec::len).min()?;
    let lags = (shortest / 5).min(10);
    if lags == 0 {
        return None;
    }
    let n: f64 = traces.iter().map(|trace| trace.len() as f64).sum();
    let variance: f64 = traces.iter().map(|trace| dot(trace, trace)).sum();
    if variance <= 0.0 {
        return None;
    }
    let mut q = 0.0;
    for lag in 1..=lags {
        let products: f64 = traces.iter().map(|trace| dot(&trace[lag..], &trace[..trace.len() - lag])).sum();
        let pairs: f64 = traces.iter().map(|trace| (trace.len() - lag) as f64).sum();
        q += (products / variance).powi(2) / pairs;
    }
    q *= n * (n + 2.0);
    let p = ChiSquared::new(lags as f64).ok()?.sf(q);
    test(TestKind::LjungBox, q, (lags as f64, None), p)
}

/// z of the number of runs of one sign, summed over traces.
fn runs(weighing: &Weighing<'_>) -> Option<Test> {
    if weighing.foundation.data.layout.design.smooth == Smooth::None {
        return None;
    }
    let (mut found, mut expected, mut variance) = (0.0, 0.0, 0.0);
    for trace in whitened_traces(weighing) {
        let up = trace.iter().filter(|r| **r > 0.0).count() as f64;
        let down = trace.len() as f64 - up;
        let n = up + down;
        if up < 1.0 || down < 1.0 || n < 3.0 {
            // One sign throughout is one run; with equal chances n/2 + 1 would be expected.
            found += 1.0;
            expected += n / 2.0 + 0.5;
            variance += (n - 1.0).max(0.0) / 4.0;
            continue;
        }
        found += 1.0 + trace.windows(2).filter(|pair| (pair[0] > 0.0) != (pair[1] > 0.0)).count() as f64;
        let mean = 2.0 * up * down / n + 1.0;
        expected += mean;
        variance += (mean - 1.0) * (mean - 2.0) / (n - 1.0);
    }
    if variance <= 0.0 {
        return None;
    }
    let z = (found - expected) / variance.sqrt();
    let p = 2.0 * Normal::standard().sf(z.abs());
    test(TestKind::Runs, z, (f64::NAN, None), p).map(|t| Test { dof: (0.0, None), ..t })
}
