//! The next part: what is expected of it, averaged over all that may have changed (`process/4`).

use nalgebra::{DMatrix, DVector};

use super::action;
use super::measure;
use super::memory::Memory;
use super::null::{Null, Source, Told};
use super::onsets::{Entry, What};
use super::sight::{COSINES, Sighting};
use super::state::{Forecast, Outlook, PathForecast};
use super::watch::Watch;
use crate::calculator::{Failure, Limits, Monitor, Watched};
use crate::diagnosis::log_sum_exp;
use crate::num::stats::Resampler;

/// Profiles that are drawn.
const DRAWS: usize = 4000;
/// Hypotheses of less than this share of all are drawn as no change.
const DRAWN: f64 = 1e-4;

/// What the next part's mean deviation may be, at the rows of the last part.
pub(super) struct Expected {
    /// Mean over all hypotheses, and its variance without what a part scatters by itself.
    pub(super) mean: DVector<f64>,
    pub(super) variance: DVector<f64>,
    /// Independent standard deviations of what is free.
    free: DMatrix<f64>,
    /// With nothing changed.
    unchanged: DVector<f64>,
    drawn: Vec<Drawn>,
}

/// A hypothesis that is drawn.
struct Drawn {
    share: f64,
    shift: DVector<f64>,
    directions: DMatrix<f64>,
}

impl<M: Watched> Watch<M> {
    /// The next part, of the type and under the conditions of the last, and what to do; nothing while the process is learned.
    pub fn outlook(&mut self, monitor: &dyn Monitor) -> Result<Option<Outlook>, Failure> {
        let Some(last) = self.last.clone() else { return Ok(None) };
        let limits = M::limits(&self.eye.document.part_types[&last.part_type].job);
        let memory = &self.memory;
        let Some((part, _)) = memory.parts.back() else { return Ok(None) };
        let Some(expected) = memory.with_null(|told, null| memory.expected(part, told, null)) else { return Ok(None) };
        let scatter = memory.scattered(part);
        let per_um = part.signs.per_um;
        let forecast = Forecast {
            as_now: expected.forecast(&DVector::zeros(expected.mean.len()), &scatter, per_um, limits),
            new_path: expected.forecast(&expected.mean, &scatter, per_um, limits),
        };
        let action = action::of(memory, part, &expected, &scatter, &forecast, limits);
        let measure_next = measure::ranked(self, &last, monitor)?;
        Ok(Some(Outlook { forecast, action, measure_next }))
    }
}

impl Memory {
    /// What parts scatter by themselves, one standard deviation a column, at the rows of a part.
    fn scattered(&self, part: &Sighting) -> DMatrix<f64> {
        let factors = self.scatter.as_ref().map_or(&[][..], |scatter| &scatter.factors);
        let columns = part.signs.scatter.iter().zip(factors);
        let columns: Vec<DVector<f64>> =
            columns.map(|(column, factor)| DVector::from_column_slice(column) * *factor).collect();
        if columns.is_empty() { DMatrix::zeros(part.value.len(), 0) } else { DMatrix::from_columns(&columns) }
    }

    fn expected(&self, part: &Sighting, told: &[Told<'_>], null: &Null) -> Expected {
        let (rows, number) = (part.value.len(), part.number + 1);
        // The gauge moves readings, not parts.
        let is_of_gauge = |source: Source| self.catalogue.gauge().is_some_and(|own| source == Source::Cause(own));
        let next = Sighting { number, ..part.clone() };
        let of_rows: Vec<DVector<f64>> = null
            .rows_of(&next)
            .into_iter()
            .zip(&null.columns)
            .map(|(column, own)| if is_of_gauge(own.source) { vec![0.0; rows] } else { column })
            .map(DVector::from_vec)
            .collect();
        let b = DMatrix::from_columns(&of_rows);
        // Rows of L^-1 B'.
        let half = null.halved(&b.transpose());
        let unchanged = DVector::from_column_slice(&part.signs.base) + &b * null.mean();
        let scale = self.scale();
        let mut weights = vec![0.0];
        let rarely = f64::from(self.options.change_every_parts).ln();
        scale.each(told, null, self.first, &mut |entry, _| weights.push(entry.log_weight - rarely));
        let total = log_sum_exp(&weights);
        let (mut shift, mut square) = (DVector::zeros(rows), DVector::zeros(rows));
        let mut drawn = Vec::new();
        scale.each(told, null, self.first, &mut |entry, halved| {
            let share = (entry.log_weight - rarely - total).exp();
            if share < DRAWN * DRAWN {
                return;
            }
            let Some((mean, directions)) = self.moved(part, number, &entry, halved, &half) else { return };
            let spread = DVector::from_fn(rows, |row, _| directions.row(row).norm_squared());
            shift += &mean * share;
            square += (mean.component_mul(&mean) + spread) * share;
            if share >= DRAWN {
                drawn.push(Drawn { share, shift: mean, directions });
            }
        });
        let of_free = DVector::from_fn(rows, |row, _| half.column(row).norm_squared());
        let variance = of_free + &square - shift.component_mul(&shift);
        Expected { mean: &unchanged + shift, variance, free: half.transpose(), unchanged, drawn }
    }

    /// How a hypothesis moves the next part beside no change: mean, and independent standard deviations of its sizes.
    fn moved(
        &self,
        part: &Sighting,
        number: u32,
        entry: &Entry,
        halved: &DMatrix<f64>,
        half: &DMatrix<f64>,
    ) -> Option<(DVector<f64>, DMatrix<f64>)> {
        let acts = entry.form.of(number, entry.since);
        let rows = part.value.len();
        let column = |basic: usize, own: Option<&Vec<f64>>| {
            let own = own.map_or_else(|| DVector::zeros(rows), |own| DVector::from_column_slice(own));
            own * acts - half.tr_mul(&halved.column(basic))
        };
        match (entry.what, &entry.waves) {
            (What::Cause(variant), _) => {
                let is_part = self.catalogue.gauge() != Some(variant);
                let own = part.signs.causes.iter().find(|(own, _)| *own == variant && is_part).map(|(_, own)| own);
                let along = column(COSINES + variant, own);
                let directions = DMatrix::from_columns(&[&along * entry.variance.sqrt()]);
                Some((along * entry.mean, directions))
            }
            (What::Unnamed(_), Some(waves)) => {
                let all: Vec<DVector<f64>> =
                    part.signs.cosines.iter().enumerate().map(|(order, own)| column(order, Some(own))).collect();
                let along = DMatrix::from_columns(&all);
                Some((&along * &waves.mean, waves.directions(&along)))
            }
            _ => None,
        }
    }
}

impl Expected {
    /// One path, which takes `less` out of the mean deviation.
    fn forecast(&self, less: &DVector<f64>, scatter: &DMatrix<f64>, per_um: f64, limits: Limits) -> PathForecast {
        let mut random = Resampler::new(1, 0);
        let (mut form, mut within) = (0.0, 0);
        for _ in 0..DRAWS {
            let profile = (self.draw(scatter, &mut random) - less) / per_um;
            let (least, most) = (profile.min(), profile.max());
            form += (most - least) / DRAWS as f64;
            let fits = limits.form_um.is_none_or(|allowed| most - least <= allowed)
                && limits.lower_um.is_none_or(|allowed| least >= allowed)
                && limits.upper_um.is_none_or(|allowed| most <= allowed);
            within += usize::from(fits);
        }
        let scattered = |row: usize| self.variance[row] + scatter.row(row).norm_squared();
        PathForecast {
            mean: (&self.mean - less).as_slice().to_vec(),
            deviation: (0..self.mean.len()).map(|row| scattered(row).max(0.0).sqrt()).collect(),
            form_um: form,
            in_tolerance_probability: (limits != Limits::default()).then(|| within as f64 / DRAWS as f64),
        }
    }

    fn draw(&self, scatter: &DMatrix<f64>, random: &mut Resampler) -> DVector<f64> {
        let mut left = random.uniform();
        let mut normal = |count: usize| DVector::from_fn(count, |_, _| random.normal());
        let mut profile = &self.unchanged + &self.free * normal(self.free.ncols()) + scatter * normal(scatter.ncols());
        for drawn in &self.drawn {
            if left < drawn.share {
                profile += &drawn.shift + &drawn.directions * normal(drawn.directions.ncols());
                break;
            }
            left -= drawn.share;
        }
        profile
    }
}
