//! A remainder without a name: smooth columns or free levels with amplitudes of their own (`diagnosis/3.5`).

use std::f64::consts::PI;

use nalgebra::{Cholesky, DMatrix, DVector};

use crate::calculator::{Condition, Failure, Grouping, Monitor, Over, Smooth, checkpoint};
use crate::diagnosis::rows::basis::cosine;
use crate::diagnosis::rows::data::Data;
use crate::diagnosis::rows::sparse::Sparse;
use crate::diagnosis::statistics::blocks::Blocks;
use crate::diagnosis::statistics::evidence::{Normal, Scale, Side, log_det, log_mean_exp};
use crate::diagnosis::statistics::likelihood::Likelihood;
use crate::diagnosis::statistics::values_beside::{ValuesBeside, members};
use crate::diagnosis::statistics::whiten::White;

/// Cosines common to all runs.
const COMMON_ORDERS: usize = 25;
/// Cosines free in every run.
const RUN_ORDERS: usize = 8;
/// Fourier orders round a part.
const FOURIER: std::ops::RangeInclusive<usize> = 2..=60;
/// Cosines over the order of testing.
const TEST_ORDERS: std::ops::RangeInclusive<usize> = 1..=15;
/// Cosines over a condition, and over each of a pair of conditions, at most.
const CONDITION_ORDERS: usize = 7;
const PAIR_ORDERS: usize = 3;
/// Correlation lengths, share of the length.
const LENGTHS: [f64; 3] = [0.0, 0.08, 0.2];
/// Pointwise root mean square, in standard deviations of the scatter.
const SIZES: [f64; 4] = [1.0, 3.0, 10.0, 30.0];
/// Places of an effect over conditions, at most: as many as may be unsure together.
const MOST_PLACES: usize = 128;
/// Levels that are told by their independent directions, at most: each tells of each, and a stored model has its size.
const MOST_LEVELS: usize = 40;
/// A direction of which rows know less than this share of what its prior says is left out of what they leave open.
const SEEN: f64 = 0.05;

/// A kind of remainder.
pub(in crate::diagnosis) struct Kind {
    /// What it is free over: `common`, `per_run`, `around`, a grouping's name, `test_order`, `conditions`,
    /// `pair_of_conditions`.
    pub(in crate::diagnosis) name: &'static str,
    /// Which conditions or which factor, where the name does not say.
    pub(in crate::diagnosis) over: Vec<String>,
    /// Its columns on the rows, for the picture of the remainder.
    pub(in crate::diagnosis) columns: Vec<Sparse>,
    /// Order of every column, where the columns are waves: along a part half waves, round it whole ones.
    pub(in crate::diagnosis) orders: Option<Vec<f64>>,
    /// Where the model has an effect for it.
    pub(in crate::diagnosis) effect: Option<OfEffect>,
    form: Form,
    /// Prior standard deviations of the amplitudes for every correlation length, at a size of one.
    spreads: Vec<Vec<f64>>,
}

/// How a remainder stands in an effect of the model.
pub(in crate::diagnosis) struct OfEffect {
    /// What one unit of the effect does to the rows, root mean square.
    pub(in crate::diagnosis) per_unit: f64,
    /// What it goes with, by the names of the design.
    pub(in crate::diagnosis) over: Vec<&'static str>,
    pub(in crate::diagnosis) basis: OfBasis,
}

/// What the columns are of.
pub(in crate::diagnosis) enum OfBasis {
    /// Products of so many half waves over each axis, the last first.
    Waves(Vec<usize>),
    /// Of each group of rows one, by the group of every row.
    Levels(Vec<usize>),
}

/// What evidence is made of.
enum Form {
    /// Columns that act on all rows: their inner products.
    Whole { white: Vec<White>, gram: DMatrix<f64> },
    /// Columns of which each acts in its block.
    Blocks(Blocks),
    /// Of classes.
    Classes(Vec<White>),
}

/// A remainder fitted beside a set of causes.
#[derive(Debug, Clone, PartialEq)]
pub(in crate::diagnosis) struct Remainder {
    /// Mean over names, over the kinds of each, and over their lengths and sizes.
    pub(in crate::diagnosis) log_z: f64,
    /// The best single one: kind, amplitudes, and their factor.
    pub(in crate::diagnosis) kind: usize,
    pub(in crate::diagnosis) amplitudes: Vec<f64>,
    /// Sizes of the causes beside it there, in units of their priors.
    pub(in crate::diagnosis) of_causes: Vec<f64>,
    /// Standard deviations of their priors at the best length and size.
    pub(in crate::diagnosis) prior_sd: Vec<f64>,
    /// Where the model has an effect for it: independent directions of one standard deviation each of what the rows leave open
    /// of both, causes first.
    pub(in crate::diagnosis) directions: Vec<Vec<f64>>,
}

/// A wave: its order, and which share of its squared amplitude is its pointwise variance.
#[derive(Debug, Clone, Copy)]
struct Wave {
    order: f64,
    share: f64,
}

impl Wave {
    /// A cosine of an order.
    fn of(order: usize) -> Self {
        Self { order: order as f64, share: if order == 0 { 1.0 } else { 0.5 } }
    }

    /// The product of two.
    fn times(self, other: Self) -> Self {
        Self { order: self.order.hypot(other.order), share: self.share * other.share }
    }
}

/// Standard deviations of amplitudes, proportional to exp(-(k pi l)^2 / 2), whose pointwise variance is sigma^2.
fn spread(waves: &[Wave], length: f64, sigma: f64) -> Vec<f64> {
    let shape = |wave: &Wave| (-0.5 * (wave.order * PI * length).powi(2)).exp();
    let variance: f64 = waves.iter().map(|wave| wave.share * shape(wave) * shape(wave)).sum();
    waves.iter().map(|wave| sigma * shape(wave) / variance.sqrt()).collect()
}

/// The same of so many cosines along a part.
pub(crate) fn spread_of_cosines(count: usize, length: f64, sigma: f64) -> Vec<f64> {
    spread(&(0..count).map(Wave::of).collect::<Vec<_>>(), length, sigma)
}

/// The kinds of remainder that these rows can show. `unnamed`: what one unit of the effect does to the rows that the model
/// has for what acts alike in all runs.
pub(in crate::diagnosis) fn kinds(
    data: &Data,
    likelihood: &Likelihood,
    sigma: f64,
    unnamed: Option<&[f64]>,
    monitor: &dyn Monitor,
) -> Result<Vec<Kind>, Failure> {
    let rows = data.value.len();
    let on_all = |of: &dyn Fn(usize) -> f64| Sparse::new(rows, (0..rows).map(|row| (row, of(row))));
    let smooth = |name, columns, waves: &[Wave]| Kind::smooth(name, columns, waves, likelihood, sigma);
    let per_unit = unnamed.map(|column| (column.iter().map(|c| c * c).sum::<f64>() / rows as f64).sqrt());
    let per_unit = per_unit.filter(|per_unit| *per_unit > 0.0);
    // What one size of the effect does to a row, relative to all rows.
    let share = |row: usize| unnamed.zip(per_unit).map_or(1.0, |(column, whole)| column[row] / whole);
    // Of rows beside classes that are values: what moves a limit without a name need not move a frequency with it.
    let values = ValuesBeside::of(data, sigma);
    let effect = |over, basis| per_unit.map(|per_unit| OfEffect { per_unit, over, basis });
    let mut kinds = Vec::new();
    checkpoint(monitor)?;
    match &data.layout.design.smooth {
        Smooth::Along(u) => {
            let common = (0..COMMON_ORDERS).map(|k| on_all(&|row| share(row) * cosine(k, u[row]))).collect();
            let waves: Vec<Wave> = (0..COMMON_ORDERS).map(Wave::of).collect();
            let effect = effect(vec![Over::ALONG], OfBasis::Waves(vec![COMMON_ORDERS]));
            kinds.push(Kind { effect, ..smooth("common", common, &waves) });
            let runs: Vec<Vec<usize>> = runs(data);
            if runs.len() > 1 {
                checkpoint(monitor)?;
                let of_run =
                    |run: &[usize], k: usize| Sparse::new(rows, run.iter().map(|&row| (row, cosine(k, u[row]))));
                let columns = runs.iter().flat_map(|run| (0..RUN_ORDERS).map(|k| of_run(run, k))).collect();
                // A row lies in one run.
                let of_one = |wave: Wave| Wave { share: wave.share / runs.len() as f64, ..wave };
                let waves: Vec<Wave> = runs.iter().flat_map(|_| (0..RUN_ORDERS).map(|k| of_one(Wave::of(k)))).collect();
                kinds.push(smooth("per_run", columns, &waves));
            }
        }
        Smooth::Around(angle) => {
            let mut columns = Vec::new();
            let mut waves = Vec::new();
            for k in FOURIER {
                columns.push(on_all(&|row| (k as f64 * angle[row]).cos()));
                columns.push(on_all(&|row| (k as f64 * angle[row]).sin()));
                // Once round is two lengths of the cosines along a part.
                waves.extend([Wave::of(2 * k); 2]);
            }
            kinds.push(smooth("around", columns, &waves));
        }
        Smooth::None => {}
    }
    for grouping in &data.layout.design.groupings {
        checkpoint(monitor)?;
        let groups = members(&grouping.group);
        let over = varying(grouping, &data.layout.design.conditions, groups.len());
        let of_effect = over.and_then(|over| effect(over, OfBasis::Levels(grouping.group.clone())));
        let size = |row: usize| if of_effect.is_some() { share(row) } else { values.unit(row) };
        let of_rows = |group: &[usize]| Sparse::new(rows, group.iter().map(|&row| (row, size(row))));
        let mut add = |levels: Vec<Sparse>, of_effect: Option<OfEffect>| {
            let kind = Kind::levels(grouping.name, levels, likelihood, sigma);
            kinds.push(Kind { over: grouping.over.clone(), effect: of_effect, ..kind });
        };
        if !values.are_there() {
            add(groups.iter().map(|group| of_rows(group)).collect(), of_effect);
            continue;
        }
        let [of_classes, of_values] = values.apart(&groups);
        let of_classes: Vec<Sparse> = of_classes.iter().map(|group| of_rows(group)).collect();
        add(of_classes.iter().cloned().chain(of_values.iter().map(|group| of_rows(group))).collect(), None);
        add(of_classes, None);
    }
    if let Some(order) = &data.layout.design.order {
        let columns = TEST_ORDERS.map(|k| on_all(&|row| cosine(k, order[row]))).collect();
        let waves: Vec<Wave> = TEST_ORDERS.map(Wave::of).collect();
        kinds.push(smooth("test_order", columns, &waves));
    }
    let conditions = &data.layout.design.conditions;
    for (index, first) in conditions.iter().enumerate() {
        checkpoint(monitor)?;
        // So many values allow no more waves.
        let orders = 0..=CONDITION_ORDERS.min(first.levels - 1);
        let share = |row: usize| if values.holds(row) { 0.0 } else { share(row) };
        let columns = orders.clone().map(|k| on_all(&|row| share(row) * cosine(k, first.place[row]))).collect();
        let waves: Vec<Wave> = orders.map(Wave::of).collect();
        let of_effect = effect(vec![first.name], OfBasis::Waves(vec![waves.len()]));
        let kind = smooth("conditions", columns, &waves);
        kinds.push(Kind { over: vec![first.name.to_owned()], effect: of_effect, ..kind });
        for second in &conditions[index + 1..] {
            checkpoint(monitor)?;
            let of_each = |condition: &Condition| 0..=PAIR_ORDERS.min(condition.levels - 1);
            let both: Vec<(usize, usize)> = of_each(first).flat_map(|j| of_each(second).map(move |k| (j, k))).collect();
            let product = |&(j, k): &(usize, usize)| {
                on_all(&|row| share(row) * cosine(j, first.place[row]) * cosine(k, second.place[row]))
            };
            let waves: Vec<Wave> = both.iter().map(|&(j, k)| Wave::of(j).times(Wave::of(k))).collect();
            let counts = [first, second].map(|condition| of_each(condition).count());
            let of_effect = effect(vec![first.name, second.name], OfBasis::Waves(counts.to_vec()));
            let kind = smooth("pair_of_conditions", both.iter().map(product).collect(), &waves);
            let over = vec![first.name.to_owned(), second.name.to_owned()];
            // Its waves run in two directions: there is no order by which they could be drawn.
            kinds.push(Kind { over, orders: None, effect: of_effect, ..kind });
        }
    }
    Ok(kinds)
}

/// Rows of every run, ascending.
fn runs(data: &Data) -> Vec<Vec<usize>> {
    let count = data.layout.run_of_trace.iter().copied().max().map_or(0, |most| most + 1);
    let mut runs = vec![Vec::new(); count];
    for (rows, &run) in data.layout.traces.iter().zip(&data.layout.run_of_trace) {
        runs[run].extend_from_slice(rows);
    }
    runs.retain(|rows| !rows.is_empty());
    for rows in &mut runs {
        rows.sort_unstable();
    }
    runs
}

impl Kind {
    /// Amplitudes with standard deviations proportional to exp(-(k pi l)^2 / 2), so that the pointwise
    /// variance is sigma^2.
    fn smooth(name: &'static str, columns: Vec<Sparse>, waves: &[Wave], likelihood: &Likelihood, sigma: f64) -> Self {
        let spreads = LENGTHS.map(|length| spread(waves, length, sigma));
        let halved = |wave: &Wave| if name == "around" { 0.5 * wave.order } else { wave.order };
        Self {
            orders: Some(waves.iter().map(halved).collect()),
            ..Self::new(name, columns, spreads.to_vec(), likelihood)
        }
    }

    fn levels(name: &'static str, columns: Vec<Sparse>, likelihood: &Likelihood, sigma: f64) -> Self {
        let spreads = vec![vec![sigma; columns.len()]];
        Self::new(name, columns, spreads, likelihood)
    }

    fn new(name: &'static str, columns: Vec<Sparse>, spreads: Vec<Vec<f64>>, likelihood: &Likelihood) -> Self {
        let white = || columns.iter().map(|column| likelihood.white(&column.dense())).collect();
        let form = match likelihood {
            Likelihood::Classes(_) => Form::Classes(white()),
            Likelihood::Gaussian { whitener, .. } => match Blocks::of(&columns, whitener) {
                Some(blocks) => Form::Blocks(blocks),
                None => Form::whole(white()),
            },
        };
        Self { name, over: Vec::new(), columns, orders: None, effect: None, form, spreads }
    }
}

impl Form {
    fn whole(white: Vec<White>) -> Self {
        let (white, gram) = inner_products(white);
        Self::Whole { white, gram }
    }
}

fn inner_products(white: Vec<White>) -> (Vec<White>, DMatrix<f64>) {
    let count = white.len();
    let mut gram = DMatrix::zeros(count, count);
    for i in 0..count {
        for j in 0..=i {
            let product = white[i].inner(&white[j]);
            gram[(i, j)] = product;
            gram[(j, i)] = product;
        }
    }
    (white, gram)
}

/// The conditions that groups are pairs of values of, those that differ, where an effect can hold all pairs.
fn varying(grouping: &Grouping, conditions: &[Condition], groups: usize) -> Option<Vec<&'static str>> {
    let of = |name: &&str| conditions.iter().find(|condition| condition.name == *name);
    let known: Vec<&Condition> = grouping.conditions.iter().filter_map(of).collect();
    let places: usize = known.iter().map(|condition| condition.levels).product();
    let fits = !known.is_empty() && places <= MOST_PLACES && groups <= MOST_LEVELS;
    fits.then(|| known.iter().map(|condition| condition.name).collect())
}

/// A set of causes with a remainder of any kind beside it.
pub(in crate::diagnosis) fn beside(
    kinds: &[Kind],
    columns: &[&White],
    residual: &White,
    sides: &[Side],
    likelihood: &Likelihood,
    monitor: &dyn Monitor,
) -> Result<Option<Remainder>, Failure> {
    let own = Normal::of(columns, residual);
    let mut best: Option<(f64, Remainder)> = None;
    // Names with the evidence of their kinds: kinds of one name have the weight of one.
    let mut named: Vec<(&'static str, Vec<f64>)> = Vec::new();
    for (index, kind) in kinds.iter().enumerate() {
        let mut all = Vec::new();
        let explained = kind.explained(&own, columns, residual, sides, likelihood);
        for spread in &kind.spreads {
            for size in SIZES {
                checkpoint(monitor)?;
                let prior_sd: Vec<f64> = spread.iter().map(|s| s * size).collect();
                let Some((log_z, t)) = explained(&prior_sd) else { return Ok(None) };
                if best.as_ref().is_none_or(|(most, _)| log_z > *most) {
                    let (of_causes, of_kind) = t.split_at(columns.len());
                    let amplitudes = of_kind.iter().zip(&prior_sd).map(|(t, s)| t * s).collect();
                    let of_causes = of_causes.to_vec();
                    let directions = Vec::new();
                    best = Some((log_z, Remainder { log_z, kind: index, amplitudes, of_causes, prior_sd, directions }));
                }
                all.push(log_z);
            }
        }
        let log_z = log_mean_exp(&all);
        match named.iter_mut().find(|(name, _)| *name == kind.name) {
            Some((_, of_name)) => of_name.push(log_z),
            None => named.push((kind.name, vec![log_z])),
        }
    }
    let log_z = log_mean_exp(&named.iter().map(|(_, of_name)| log_mean_exp(of_name)).collect::<Vec<_>>());
    Ok(best.map(|(_, remainder)| {
        let kind = &kinds[remainder.kind];
        let is_term = kind.effect.is_some();
        let directions = if is_term { kind.directions(&remainder, columns, (&own, likelihood)) } else { Vec::new() };
        Remainder { log_z, directions, ..remainder }
    }))
}

/// Evidence with the columns of a kind scaled by what is given, and the sizes of causes and columns.
type Explained<'a> = Box<dyn Fn(&[f64]) -> Option<(f64, Vec<f64>)> + 'a>;

impl Kind {
    /// Evidence of causes and of this remainder.
    fn explained<'a>(
        &'a self,
        own: &Normal,
        columns: &'a [&White],
        residual: &'a White,
        sides: &'a [Side],
        likelihood: &'a Likelihood,
    ) -> Explained<'a> {
        let all_scales = move |scales: &[f64]| [vec![1.0; columns.len()].as_slice(), scales].concat();
        match (&self.form, likelihood) {
            (Form::Blocks(blocks), Likelihood::Gaussian { scale, .. }) => {
                let beside = blocks.beside(columns, residual);
                Box::new(move |scales| beside.evidence(scales, sides, *scale))
            }
            (Form::Whole { white, gram }, Likelihood::Gaussian { whitener, scale }) => {
                let joint = joined(white, gram, own, columns, residual);
                Box::new(move |scales| scaled_evidence(&joint, &all_scales(scales), sides, *scale, whitener.rows()))
            }
            (Form::Classes(white) | Form::Whole { white, .. }, _) => Box::new(move |scales| {
                let all = columns.iter().copied().chain(white);
                let scaled: Vec<White> =
                    all.zip(all_scales(scales)).map(|(column, scale)| column.times(scale)).collect();
                let evidence = likelihood.evidence(&scaled.iter().collect::<Vec<_>>(), residual, sides)?;
                Some((evidence.log_z, evidence.t))
            }),
            // Blocks are made of values only.
            (Form::Blocks(_), Likelihood::Classes(_)) => Box::new(|_| None),
        }
    }

    /// Independent directions of one standard deviation each of what the rows leave open of causes and remainder: with
    /// A = S G S + I, S the prior standard deviations and G the inner products, those of the eigenvectors of S G S. What rows
    /// do not see is left out: there the prior alone speaks.
    fn directions(
        &self,
        remainder: &Remainder,
        columns: &[&White],
        (own, likelihood): (&Normal, &Likelihood),
    ) -> Vec<Vec<f64>> {
        let of_levels;
        let (white, gram) = match &self.form {
            Form::Whole { white, gram } => (white, gram),
            Form::Blocks(_) => {
                of_levels = inner_products(self.columns.iter().map(|c| likelihood.white(&c.dense())).collect());
                (&of_levels.0, &of_levels.1)
            }
            // The extended model of classes holds no remainder.
            Form::Classes(_) => return Vec::new(),
        };
        let all = joined_gram(white, gram, own, columns);
        let scale: Vec<f64> =
            std::iter::repeat_n(1.0, columns.len()).chain(remainder.prior_sd.iter().copied()).collect();
        let count = scale.len();
        let eigen = DMatrix::from_fn(count, count, |i, j| all[(i, j)] * scale[i] * scale[j]).symmetric_eigen();
        let seen = eigen.eigenvalues.iter().zip(eigen.eigenvectors.column_iter());
        seen.filter(|(seen, _)| **seen > SEEN)
            .map(|(seen, vector)| vector.iter().zip(&scale).map(|(v, scale)| v * scale / (1.0 + seen).sqrt()).collect())
            .collect()
    }

    /// Posterior standard deviation of a remainder at every row, beside causes with these columns.
    pub(in crate::diagnosis) fn deviation(
        &self,
        remainder: &Remainder,
        columns: &[&White],
        residual: &White,
        likelihood: &Likelihood,
    ) -> Option<Vec<f64>> {
        let causes = columns.len();
        let rows = self.columns.first().map_or(0, Sparse::length);
        let joint = match &self.form {
            Form::Blocks(blocks) => {
                return blocks.beside(columns, residual).deviation(&remainder.prior_sd, &self.columns, rows);
            }
            Form::Whole { white, gram } => joined(white, gram, &Normal::of(columns, residual), columns, residual),
            Form::Classes(white) => {
                let all: Vec<&White> = columns.iter().copied().chain(white).collect();
                let sizes = remainder.of_causes.iter().chain(&remainder.amplitudes);
                let left = all
                    .iter()
                    .zip(sizes)
                    .fold(residual.clone(), |left, (column, size)| left.minus(&column.times(*size)));
                likelihood.normal(&all, &left)?
            }
        };
        let scale = |i: usize| if i < causes { 1.0 } else { remainder.prior_sd[i - causes] };
        let count = joint.right.len();
        let a = DMatrix::from_fn(count, count, |i, j| {
            joint.gram[(i, j)] * scale(i) * scale(j) + f64::from(u8::from(i == j))
        });
        let factor = Cholesky::new(a)?;
        let of_row = |row: usize| {
            let of = |i: usize| if i < causes { 0.0 } else { self.columns[i - causes].at(row) * scale(i) };
            factor.l_dirty().solve_lower_triangular(&DVector::from_fn(count, |i, _| of(i))).map(|half| half.norm())
        };
        (0..rows).map(of_row).collect()
    }
}

/// Inner products of causes and of the columns of a remainder together.
fn joined(white: &[White], gram: &DMatrix<f64>, own: &Normal, columns: &[&White], residual: &White) -> Normal {
    let (causes, free) = (columns.len(), white.len());
    let mut right = DVector::zeros(causes + free);
    right.rows_mut(0, causes).copy_from(&own.right);
    for (j, white) in white.iter().enumerate() {
        right[causes + j] = white.inner(residual);
    }
    Normal { gram: joined_gram(white, gram, own, columns), right, square: own.square }
}

fn joined_gram(white: &[White], gram: &DMatrix<f64>, own: &Normal, columns: &[&White]) -> DMatrix<f64> {
    let (causes, free) = (columns.len(), white.len());
    let mut all = DMatrix::zeros(causes + free, causes + free);
    all.view_mut((0, 0), (causes, causes)).copy_from(&own.gram);
    all.view_mut((causes, causes), (free, free)).copy_from(gram);
    for (i, column) in columns.iter().enumerate() {
        for (j, white) in white.iter().enumerate() {
            let product = column.inner(white);
            all[(i, causes + j)] = product;
            all[(causes + j, i)] = product;
        }
    }
    all
}

/// [`Normal::evidence`] with every column scaled, and without the inverse of what nobody asks for.
fn scaled_evidence(
    normal: &Normal,
    scales: &[f64],
    sides: &[Side],
    scale: Scale,
    rows: f64,
) -> Option<(f64, Vec<f64>)> {
    let count = scales.len();
    let a = DMatrix::from_fn(count, count, |i, j| {
        normal.gram[(i, j)] * scales[i] * scales[j] + f64::from(u8::from(i == j))
    });
    let right = DVector::from_iterator(count, normal.right.iter().zip(scales).map(|(b, s)| b * s));
    let factor = Cholesky::new(a)?;
    let t = factor.solve(&right);
    let q = (normal.square - right.dot(&t)).max(0.0);
    let mut log_z = scale.log_likelihood(q, rows) - 0.5 * log_det(&factor);
    for (i, side) in sides.iter().enumerate() {
        if let Some(sign) = side.sign() {
            let mut unit = DVector::zeros(count);
            unit[i] = 1.0;
            let variance = factor.solve(&unit)[i];
            log_z += std::f64::consts::LN_2
                + crate::diagnosis::statistics::evidence::log_normal_cdf(sign * t[i] / variance.sqrt());
        }
    }
    Some((log_z, t.as_slice().to_vec()))
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use std::sync::atomic::{AtomicUsize, Ordering};

    use super::*;
    use crate::calculator::{Design, Message, Unwatched};
    use crate::diagnosis::rows::data::Layout;
    use crate::diagnosis::rows::noise::{Noise, NoiseSource};
    use crate::diagnosis::statistics::whiten::Whitener;

    const RUNS: usize = 4;
    const ROWS: usize = 13 * RUNS;

    /// Whether a row counts.
    type Kept = fn(usize) -> bool;

    fn wave(row: usize, frequency: f64) -> f64 {
        (frequency * row as f64 + 0.3).sin()
    }

    /// Four runs of two sweeps each, rows in turn, with a grouping across the runs.
    fn data() -> Data {
        let run = |row: usize| row % RUNS;
        let sweep = |k: usize| (0..ROWS).filter(|&row| run(row) == k / 2 && row / 20 == k % 2).collect();
        let design = Design {
            smooth: Smooth::Along((0..ROWS).map(|row| row as f64 / ROWS as f64).collect()),
            cell: (0..ROWS).collect(),
            regressors: Vec::new(),
            groupings: vec![Grouping {
                name: "third",
                over: Vec::new(),
                conditions: Vec::new(),
                group: (0..ROWS).map(|row| row % 3).collect(),
            }],
            conditions: Vec::new(),
            order: None,
            fold: (0..ROWS).map(run).collect(),
        };
        let layout = Layout {
            traces: (0..2 * RUNS).map(sweep).collect(),
            run_of_trace: (0..2 * RUNS).map(|k| k / 2).collect(),
            design,
        };
        Data { value: (0..ROWS).map(|row| wave(row, 0.7)).collect(), uncertainty: None, sides: None, layout }
    }

    /// A set-up of every run, one level of all runs, and one of two.
    fn likelihood(data: &Data, rho: f64, keep: &[bool]) -> Likelihood {
        let of = |acts: &dyn Fn(usize) -> bool, by: f64| {
            Sparse::new(ROWS, (0..ROWS).filter(|row| acts(*row)).map(|row| (row, by * (1.0 + wave(row, 0.11)))))
        };
        let mut nuisances: Vec<Sparse> = (0..RUNS).map(|k| of(&|row| row % RUNS == k, 2.0)).collect();
        nuisances.push(of(&|_| true, 0.7));
        nuisances.push(of(&|row| row % RUNS < 2, 0.4));
        let noise = Noise { sigma: 0.3, per_row: None, rho, dof: 20.0, source: NoiseSource::Profile };
        Likelihood::Gaussian { whitener: Whitener::new(data, &noise, &nuisances, keep), scale: Scale::SameRows }
    }

    /// Cancels at a look.
    struct CancelAt {
        looks: AtomicUsize,
        at: usize,
    }

    impl Monitor for CancelAt {
        fn cancelled(&self) -> bool {
            self.looks.fetch_add(1, Ordering::Relaxed) >= self.at
        }

        fn progress(&self, _fraction: f64, _stage: Message) {}
    }

    #[test]
    fn every_size_is_preceded_by_a_look() {
        let data = data();
        let likelihood = likelihood(&data, 0.3, &[true; ROWS]);
        let kinds = kinds(&data, &likelihood, 0.3, None, &Unwatched).unwrap();
        let sizes: usize = kinds.iter().map(|kind| kind.spreads.len() * SIZES.len()).sum();
        let residual = likelihood.white(&data.value);
        for at in [0, sizes - 1, sizes] {
            let monitor = CancelAt { looks: AtomicUsize::new(0), at };
            let found = beside(&kinds, &[], &residual, &[], &likelihood, &monitor);
            assert_eq!(found.is_ok_and(|remainder| remainder.is_some()), at == sizes, "{at} of {sizes}");
            assert_eq!(monitor.looks.into_inner(), sizes.min(at + 1));
        }
    }

    #[test]
    fn block_by_block_is_what_it_is_as_a_whole() {
        let data = data();
        // One row is left out, and in the second case a whole run.
        let cases: [(f64, Kept); 2] = [(0.3, |row| row != 7), (0.0, |row| row % RUNS != 2)];
        for (rho, keep) in cases {
            let keep: Vec<bool> = (0..ROWS).map(keep).collect();
            let likelihood = likelihood(&data, rho, &keep);
            let white =
                |frequency: f64| likelihood.white(&(0..ROWS).map(|row| wave(row, frequency)).collect::<Vec<_>>());
            let (causes, residual) = ([white(0.05), white(0.4)], likelihood.white(&data.value));
            let (causes, sides) = (causes.iter().collect::<Vec<_>>(), [Side::Positive, Side::Both]);
            let own = Normal::of(&causes, &residual);
            let kinds = kinds(&data, &likelihood, 0.3, None, &Unwatched).unwrap();
            let apart: Vec<&Kind> = kinds.iter().filter(|kind| matches!(kind.form, Form::Blocks(_))).collect();
            // Levels of rows that a correlation ties together are one block.
            assert_eq!(apart.len(), if rho > 0.0 { 1 } else { 2 });
            for kind in apart {
                let columns = || kind.columns.clone();
                let form = Form::whole(columns().iter().map(|column| likelihood.white(&column.dense())).collect());
                let spreads = kind.spreads.clone();
                let whole = Kind {
                    name: kind.name,
                    over: Vec::new(),
                    columns: columns(),
                    orders: None,
                    effect: None,
                    form,
                    spreads,
                };
                let prior_sd: Vec<f64> = (0..kind.columns.len()).map(|k| 0.5 + 0.4 * wave(k, 1.0)).collect();
                let of = |kind: &Kind| {
                    let (log_z, t) = kind.explained(&own, &causes, &residual, &sides, &likelihood)(&prior_sd).unwrap();
                    let remainder = Remainder {
                        log_z,
                        kind: 0,
                        amplitudes: Vec::new(),
                        of_causes: Vec::new(),
                        prior_sd: prior_sd.clone(),
                        directions: Vec::new(),
                    };
                    let deviation = kind.deviation(&remainder, &causes, &residual, &likelihood).unwrap();
                    [vec![log_z], t, deviation].concat()
                };
                let (blocks, whole) = (of(kind), of(&whole));
                assert_eq!(blocks.len(), whole.len());
                let near = blocks.iter().zip(&whole).all(|(a, b)| (a - b).abs() < 1e-10 * (1.0 + b.abs()));
                assert!(near, "{}: {blocks:?} {whole:?}", kind.name);
            }
        }
    }
}
