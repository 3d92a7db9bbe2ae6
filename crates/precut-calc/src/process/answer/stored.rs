//! The model of a process as later jobs take it: effects, and what the parts leave open of them (`process/3.5`).

use nalgebra::DVector;
use serde::Serialize;

use crate::calculator::{Failure, Monitor, Watched};
use crate::diagnosis::{JointUncertainty, moves_between};
use crate::process::answer::next::sizes;
use crate::process::change::null::{Null, Source};
use crate::process::change::verdict::NORMAL_95;
use crate::process::history::watch::Watch;

/// How far each open direction is followed, in standard deviations: small beside what bends, large beside what is rounded.
const STEP: f64 = 0.01;

/// The model of a process.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct StoredModel<E> {
    /// What acts: the effects of the base job, those of the causes that changed and of those that come and go with conditions as
    /// far as the parts tell of them, and what has no name along the part. A drift acts as in the part after the last one.
    pub effects: Vec<E>,
    /// What the parts leave open of them, in independent standard deviations.
    pub effects_uncertainty: Vec<JointUncertainty>,
    /// Type of the part with whose job the effects stand.
    pub part_type: String,
    /// Whether the mean profile of that type is in it. Where there are several types each has its own, and the model holds only
    /// what all have.
    pub with_profile: bool,
}

/// Which columns become effects: changes that joined the model, and causes that come and go with conditions where their 95 % interval
/// does not hold 0. The others stay in what has no name, so that a later job need not state conditions for them.
fn are_effects(null: &Null) -> Vec<bool> {
    let (mean, inverse) = (null.mean(), null.factor.inverse());
    let is_told = |k: usize| mean[k].abs() > NORMAL_95 * inverse[(k, k)].sqrt();
    (0..null.columns.len()).map(|k| null.columns[k].since.is_some() || is_told(k)).collect()
}

impl<M: Watched> Watch<M> {
    /// The model as it is by now, at the type and the conditions of the last part; nothing while the process is learned.
    ///
    /// What may have changed and is not accepted yet acts as far as it is expected; what it leaves open is not told.
    pub fn stored(&mut self, monitor: &dyn Monitor) -> Result<Option<StoredModel<M::Effect>>, Failure> {
        let Some((part_type, conditions)) = self.last_conditions() else { return Ok(None) };
        let (part_type, conditions) = (part_type.to_owned(), conditions.clone());
        let Some(ahead) = self.ahead(&part_type, &conditions, monitor)? else { return Ok(None) };
        let with_profile = self.eye.document.part_types.len() == 1;
        let (memory, catalogue, number) = (&self.memory, &self.memory.catalogue, ahead.part.number);
        let of_null = memory.with_null(|told, null| {
            let all = null.rows_of(&ahead.part).into_iter().map(DVector::from_vec).collect::<Vec<_>>();
            let expected = memory.expected(&ahead.part, told, null).mean;
            let chosen = are_effects(null);
            let own = |amounts: &DVector<f64>| sizes(catalogue, null, amounts, number, &chosen);
            let count = null.columns.len();
            let unit = |k: usize| DVector::from_fn(count, |row, _| f64::from(u8::from(row == k)));
            let open: Vec<_> = (0..count)
                .map(|k| null.back(&unit(k)))
                .map(|amounts| (own(&amounts), self.shift(null, &all, &amounts, with_profile)))
                .collect();
            let mean = null.mean();
            let common = self.shift(null, &all, &mean, false);
            (own(&mean), if with_profile { expected } else { common }, open)
        });
        let Some((sizes, wanted, open)) = of_null else { return Ok(None) };
        let base = if with_profile { None } else { Some(ahead.acting(&[], catalogue)?) };
        let base = base.map(|effects| M::predict(ahead.bound.prepared(), &effects, monitor)).transpose()?;
        let wanted = match base {
            Some(base) => wanted + DVector::from_iterator(base.len(), base.into_iter().map(|row| row.unwrap_or(0.0))),
            None => wanted,
        };
        let at = |deviations: f64, (of_sizes, of_rows): &(Vec<(usize, f64)>, DVector<f64>)| {
            let moved = sizes.iter().zip(of_sizes).map(|(&(own, size), (_, by))| (own, size + deviations * by));
            let moved: Vec<(usize, f64)> = moved.collect();
            ahead.effects(&moved, catalogue, &(&wanted + of_rows * deviations), monitor)
        };
        let still = (vec![(0, 0.0); sizes.len()], DVector::zeros(wanted.len()));
        let effects = at(0.0, &still)?;
        let mut effects_uncertainty = Vec::new();
        for direction in &open {
            let (below, above) = (at(-STEP, direction)?, at(STEP, direction)?);
            effects_uncertainty.extend(moves_between(&below, &above, 2.0 * STEP));
        }
        Ok(Some(StoredModel { effects, effects_uncertainty, part_type, with_profile }))
    }

    /// The shift of the rows of a part by these amounts of the columns. The gauge shifts readings, not the part; the mean profile
    /// shifts it only where asked.
    fn shift(&self, null: &Null, rows: &[DVector<f64>], amounts: &DVector<f64>, with_profile: bool) -> DVector<f64> {
        let gauge = self.memory.catalogue.gauge();
        let acts = |source: Source| match source {
            Source::Cause(variant) => gauge != Some(variant),
            Source::Profile { .. } => with_profile,
            Source::Wave(_) => true,
        };
        let count = rows.first().map_or(0, DVector::len);
        let all = null.columns.iter().zip(rows).zip(amounts.iter());
        all.filter(|((column, _), _)| acts(column.source))
            .fold(DVector::zeros(count), |sum, ((_, row), amount)| sum + row * *amount)
    }
}
