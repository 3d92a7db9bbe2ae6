//! The next part: what is expected of it, averaged over all that may have changed (`process/4`).

use nalgebra::{DMatrix, DVector};

use crate::calculator::{Failure, Limits, Monitor, Watched};
use crate::diagnosis::log_sum_exp;
use crate::num::stats::Resampler;
use crate::process::answer::action;
use crate::process::answer::measure;
use crate::process::answer::output::{Forecast, Model, Outlook, PathForecast};
use crate::process::change::null::{Column, Null, Source, Told};
use crate::process::change::onsets::{Entry, What};
use crate::process::change::report;
use crate::process::history::memory::Memory;
use crate::process::history::watch::Watch;
use crate::process::part::document::PartOf;
use crate::process::part::sight::{COSINES, Sighting};

/// Profiles that are drawn.
const DRAWS: usize = 4000;
/// Hypotheses of less than this share of all are drawn as no change.
const DRAWN: f64 = 1e-4;

/// What the next part's mean deviation may be, at the rows of the last part.
pub(in crate::process) struct Expected {
    /// Mean over all hypotheses, and its variance without what a part scatters by itself.
    pub(in crate::process) mean: DVector<f64>,
    pub(in crate::process) variance: DVector<f64>,
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

/// The next part as it may be cut: of which type, under which conditions, on which path.
pub(in crate::process) struct Coming<M: Watched> {
    pub(in crate::process) part: PartOf<M>,
    pub(in crate::process) sighting: Sighting,
}

impl<M: Watched> Watch<M> {
    /// The next part, of the type and under the conditions of the last, and what to do; nothing while the process is learned.
    pub fn outlook(&mut self, monitor: &dyn Monitor) -> Result<Option<Outlook>, Failure> {
        let Some(last) = self.last.clone() else { return Ok(None) };
        self.outlook_of(&last.part_type, &last.conditions, monitor)
    }

    /// The next part where it is of this type, under these conditions and on their path; nothing while the process is learned, or
    /// where no part of that type came.
    pub fn outlook_of(
        &mut self,
        part_type: &str,
        conditions: &M::Run,
        monitor: &dyn Monitor,
    ) -> Result<Option<Outlook>, Failure> {
        let Some(Coming { part, sighting }) = self.coming(part_type, conditions, monitor)? else { return Ok(None) };
        let limits = M::limits(&self.eye.document.part_types[part_type].job);
        let on_base = match self.account.on_base(sighting.kind, conditions, monitor)? {
            Some(run) if run != *conditions => self.coming(part_type, &run, monitor)?,
            _ => None,
        };
        let Some(own) = self.memory.expectation(&sighting) else { return Ok(None) };
        let scatter = self.memory.scattered(&sighting);
        let tried = if action::is_beyond_dead_band(&own, &scatter) {
            self.on_new_path(part_type, conditions, monitor)?
        } else {
            None
        };
        let memory = &self.memory;
        let per_um = sighting.signs.per_um;
        let as_is = DVector::zeros(own.mean.len());
        let as_now = own.forecast(&as_is, &scatter, per_um, limits);
        let on = |next: &Sighting| {
            let expected = memory.expectation(next)?;
            let forecast = expected.forecast(&as_is, &memory.scattered(next), per_um, limits);
            Some((expected, forecast))
        };
        let base_path = on_base.and_then(|next| on(&next.sighting)).map_or_else(|| as_now.clone(), |(_, own)| own);
        let (tried, new_path) = tried.and_then(|next| on(&next.sighting)).unzip();
        let new_path = new_path.unwrap_or_else(|| own.forecast(&own.mean, &scatter, per_um, limits));
        let forecast = Forecast { as_now, new_path, base_path };
        let expected = action::Expectation { now: &own, tried: tried.as_ref(), scatter: &scatter };
        let action = action::of(memory, &sighting, &expected, &forecast, limits);
        let model = memory.model(&sighting);
        let measure_next = measure::ranked(self, &part, monitor)?;
        let (gain, _) = self.gain(monitor)?;
        Ok(Some(Outlook { model, forecast, action, measure_next, gain }))
    }

    /// The next part on the path that the calculator gives for its job; nothing where it gives none.
    fn on_new_path(
        &mut self,
        part_type: &str,
        conditions: &M::Run,
        monitor: &dyn Monitor,
    ) -> Result<Option<Coming<M>>, Failure> {
        let Some(next) = self.next(part_type, conditions, monitor)? else { return Ok(None) };
        match M::compensated(&next.job, conditions, monitor)? {
            Some(run) => self.coming(part_type, &run, monitor),
            None => Ok(None),
        }
    }

    /// The next part with the rows of the last one of its type; nothing where none came.
    pub(in crate::process) fn coming(
        &mut self,
        part_type: &str,
        conditions: &M::Run,
        monitor: &dyn Monitor,
    ) -> Result<Option<Coming<M>>, Failure> {
        let Some(number) = self.memory.parts.back().map(|(part, _)| part.number + 1) else { return Ok(None) };
        let Some(kind) = self.eye.document.part_types.keys().position(|name| name == part_type) else {
            return Ok(None);
        };
        let Some(template) = self.account.last_of(kind) else { return Ok(None) };
        let part = PartOf::<M> { number, conditions: conditions.clone(), ..template.clone() };
        // Other conditions may show causes that no part has shown; nothing is known of them.
        let mut catalogue = self.memory.catalogue.clone();
        let sighting = self.eye.signs(&part, &mut catalogue, monitor)?.unmeasured(number, kind);
        Ok(Some(Coming { part, sighting }))
    }
}

impl Memory {
    /// What the process is taken to be: the changes that joined its model, and what no cause explains of the next part.
    fn model(&self, part: &Sighting) -> Model {
        let rows = part.value.len();
        let none = Model {
            revision: self.joined + 1,
            sizes: Vec::new(),
            covariance: Vec::new(),
            remainder: vec![0.0; rows],
            remainder_deviation: vec![0.0; rows],
        };
        self.with_null(|_, null| {
            let is_profile = |column: &Column| !matches!(column.source, Source::Cause(_));
            let named: Vec<usize> = (0..null.columns.len()).filter(|&k| !is_profile(&null.columns[k])).collect();
            let inverse = null.factor.inverse();
            let mean = null.mean();
            let unit = |k: usize| match null.columns[k].source {
                Source::Cause(variant) => self.catalogue.variants[variant].prior_sd * null.columns[k].sd,
                _ => null.columns[k].sd,
            };
            let size =
                |k: usize| report::model_size(&self.catalogue, &null.columns[k], mean[k], inverse[(k, k)].sqrt());
            let covariance =
                named.iter().map(|&i| named.iter().map(|&j| inverse[(i, j)] * unit(i) * unit(j)).collect());
            let of_rows = null.rows_of(part);
            let profile: Vec<usize> = (0..null.columns.len()).filter(|&k| is_profile(&null.columns[k])).collect();
            let at = |row: usize| profile.iter().map(|&k| of_rows[k][row] * mean[k]).sum();
            let spread = |row: usize| {
                let along = |k: usize| of_rows[k][row];
                let square = |i: usize| profile.iter().map(|&j| along(i) * inverse[(i, j)] * along(j)).sum::<f64>();
                profile.iter().map(|&i| square(i)).sum::<f64>().max(0.0).sqrt()
            };
            Model {
                sizes: named.iter().filter_map(|&k| size(k)).collect(),
                covariance: covariance.collect(),
                remainder: (0..rows).map(at).collect(),
                remainder_deviation: (0..rows).map(spread).collect(),
                ..none.clone()
            }
        })
        .unwrap_or(none)
    }

    /// What parts scatter by themselves, one standard deviation a column, at the rows of a part.
    pub(in crate::process) fn scattered(&self, part: &Sighting) -> DMatrix<f64> {
        let factors = self.scatter.as_ref().map_or(&[][..], |scatter| &scatter.factors);
        let columns = part.signs.scatter.iter().zip(factors);
        let columns: Vec<DVector<f64>> =
            columns.map(|(column, factor)| DVector::from_column_slice(column) * *factor).collect();
        if columns.is_empty() { DMatrix::zeros(part.value.len(), 0) } else { DMatrix::from_columns(&columns) }
    }

    /// What the mean deviation of a part that did not come yet may be; nothing while the process is learned.
    pub(in crate::process) fn expectation(&self, part: &Sighting) -> Option<Expected> {
        self.with_null(|told, null| self.expected(part, told, null))
    }

    /// The same from what the parts tell.
    pub(in crate::process) fn expected(&self, part: &Sighting, told: &[Told<'_>], null: &Null) -> Expected {
        let (rows, number) = (part.value.len(), part.number);
        // The gauge moves readings, not parts.
        let is_of_gauge = |source: Source| self.catalogue.gauge().is_some_and(|own| source == Source::Cause(own));
        let of_rows: Vec<DVector<f64>> = null
            .rows_of(part)
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
