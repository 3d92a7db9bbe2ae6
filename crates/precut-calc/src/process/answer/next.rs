//! The job of the next part: the calculator's own, with the model of the state (`process/5`).

use std::sync::Arc;

use nalgebra::DVector;
use serde::Serialize;

use crate::calculator::{Calculator, Failure, Hypothesis, Measurement, Monitor, Over, Unnamed, Watched};
use crate::diagnosis::{Bound, Setting, Subject, put};
use crate::num::table::straight;
use crate::process::change::null::{Column, Null, Source};
use crate::process::history::watch::Watch;
use crate::process::part::sight::{Catalogue, Sighting};

/// Places along the part at which what no cause explains is given.
const PLACES: usize = 33;
/// Rounds in which it is fitted: what it does is straight but for some percent.
const ROUNDS: usize = 3;

/// A job that cuts the next part.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Next<J> {
    /// The job: the path that the calculator gives for it takes out what is expected of the next part.
    pub job: J,
    /// Revision of the model that it holds.
    pub revision: usize,
}

impl<M: Watched> Watch<M> {
    /// Type and conditions of the last part.
    pub fn last_conditions(&self) -> Option<(&str, &M::Run)> {
        self.last.as_ref().map(|last| (last.part_type.as_str(), &last.conditions))
    }

    /// The job of the next part, of this type and under these conditions; nothing while the process is learned, or where no part
    /// of that type came. Named causes that joined the model act in it with their sizes; what else is expected of the part
    /// acts as something without a name along it. The path of the conditions is the one about which the model is linear.
    pub fn next(
        &mut self,
        part_type: &str,
        conditions: &M::Run,
        monitor: &dyn Monitor,
    ) -> Result<Option<Next<<M as Calculator>::Input>>, Failure> {
        let Some(ahead) = self.ahead(part_type, conditions, monitor)? else { return Ok(None) };
        let memory = &self.memory;
        let number = ahead.part.number;
        let expected = memory.with_null(|told, null| {
            let mean = memory.expected(&ahead.part, told, null).mean;
            let changed: Vec<bool> = null.columns.iter().map(|column| column.since.is_some()).collect();
            (mean, sizes(&memory.catalogue, null, &null.mean(), number, &changed))
        });
        let Some((wanted, changed)) = expected else { return Ok(None) };
        let effects = ahead.effects(&changed, &memory.catalogue, &wanted, monitor)?;
        let job = M::under(&self.eye.document.part_types[part_type].job, conditions, effects);
        Ok(Some(Next { job, revision: memory.joined + 1 }))
    }

    /// The next part of this type and under these conditions, at places along all of it that is measured.
    pub(in crate::process) fn ahead<'m>(
        &mut self,
        part_type: &str,
        conditions: &M::Run,
        monitor: &'m dyn Monitor,
    ) -> Result<Option<Ahead<'m, M>>, Failure> {
        let Some(coming) = self.coming(part_type, conditions, monitor)? else { return Ok(None) };
        let (kind, number) = (coming.sighting.kind, coming.sighting.number);
        let job = &self.eye.document.part_types[part_type].job;
        let Some(ends) = measured_over::<M>(job, &coming.part.measurements) else { return Ok(None) };
        let at: Vec<f64> =
            (0..PLACES).map(|k| ends[0] + (ends[1] - ends[0]) * k as f64 / (PLACES - 1) as f64).collect();
        let points = || at.iter().map(|&share| M::point_along(job, share)).collect();
        let mut catalogue = self.memory.catalogue.clone();
        let signs = self.eye.signs_at(part_type, conditions, points(), &mut catalogue, monitor)?;
        let part = Arc::new(signs).unmeasured(number, kind);
        let bound = self.eye.bound_at(part_type, conditions, points(), monitor)?;
        Ok(Some(Ahead { part, bound, at }))
    }
}

/// A part that did not come yet, at places along it.
pub(in crate::process) struct Ahead<'m, M: Watched> {
    pub(in crate::process) part: Sighting,
    pub(in crate::process) bound: Bound<'m, M>,
    /// The places, as shares of the length.
    at: Vec<f64>,
}

impl<M: Watched> Ahead<'_, M> {
    /// The effects with which the calculator predicts what is wanted at the places: the causes at their sizes, and what is left
    /// without a name.
    pub(in crate::process) fn effects(
        &self,
        sizes: &[(usize, f64)],
        catalogue: &Catalogue,
        wanted: &DVector<f64>,
        monitor: &dyn Monitor,
    ) -> Result<Vec<M::Effect>, Failure> {
        let acting = self.acting(sizes, catalogue)?;
        with_rest(&self.bound, acting, &self.at, wanted, monitor)
    }

    /// The effects of the base and those of the causes at their sizes.
    pub(in crate::process) fn acting(
        &self,
        sizes: &[(usize, f64)],
        catalogue: &Catalogue,
    ) -> Result<Vec<M::Effect>, Failure> {
        self.bound.with_settings(&settings(&self.bound, sizes, catalogue))
    }
}

/// Sizes of causes in a part, in the units of their fields, where so much of each column acts; of the columns that are chosen.
pub(in crate::process) fn sizes(
    catalogue: &Catalogue,
    null: &Null,
    amounts: &DVector<f64>,
    number: u32,
    chosen: &[bool],
) -> Vec<(usize, f64)> {
    let of = |((column, amount), chosen): ((&Column, &f64), &bool)| match column.source {
        Source::Cause(variant) if *chosen => {
            let acts = column.since.map_or(1.0, |(since, form)| form.of(number, since));
            Some((variant, amount * column.sd * acts * catalogue.variants[variant].prior_sd))
        }
        _ => None,
    };
    null.columns.iter().zip(amounts.iter()).zip(chosen).filter_map(of).collect()
}

/// From where to where a part is measured, as shares of its length.
pub(in crate::process) fn measured_over<M: Watched>(
    job: &<M as Calculator>::Input,
    rows: &[M::Row],
) -> Option<[f64; 2]> {
    let place = |point: &M::Point| M::place(point).first().and_then(|(_, place)| *place);
    let (from, to) = (place(&M::point_along(job, 0.0))?, place(&M::point_along(job, 1.0))?);
    let shares =
        rows.iter().filter(|row| !row.excluded()).filter_map(|row| Some((place(&row.point())? - from) / (to - from)));
    let (least, most) = shares.fold((f64::INFINITY, f64::NEG_INFINITY), |(a, b), share| (a.min(share), b.max(share)));
    (least < most).then_some([least, most])
}

/// Causes as settings of the model's hypotheses; those that it has no room for are left to what has no name.
fn settings<M: Watched>(bound: &Bound<'_, M>, changed: &[(usize, f64)], catalogue: &Catalogue) -> Vec<Setting> {
    let mut settings: Vec<Setting> = Vec::new();
    for &(variant, size) in changed {
        let own = &catalogue.variants[variant];
        let name = &catalogue.names[own.name];
        let Some((variable, values)) = &own.setting else { continue };
        let is_it = |known: &Hypothesis| known.cause.kind == name.kind && known.label == name.label;
        let Some(hypothesis) = bound.hypotheses().iter().position(is_it) else { continue };
        let place = settings.iter().position(|known| known.hypothesis == hypothesis);
        let before = place.map_or_else(|| values.clone(), |place| settings[place].values.clone());
        let is_same_shape = (0..values.len()).all(|k| k == *variable || before[k].to_bits() == values[k].to_bits());
        let mut moved = before;
        moved[*variable] += size;
        let [least, most] = own.range;
        if !is_same_shape || !(least..=most).contains(&moved[*variable]) {
            continue;
        }
        match place {
            Some(place) => settings[place].values = moved,
            None => settings.push(Setting { hypothesis, values: moved }),
        }
    }
    settings
}

/// With what else is needed so that the model predicts what is wanted at these places.
fn with_rest<M: Watched>(
    bound: &Bound<'_, M>,
    acting: Vec<M::Effect>,
    at: &[f64],
    wanted: &DVector<f64>,
    monitor: &dyn Monitor,
) -> Result<Vec<M::Effect>, Failure> {
    let Some(slope) = bound.unnamed()? else { return Ok(acting) };
    let mut rest = vec![0.0; at.len()];
    let mut effects = acting.clone();
    for _ in 0..ROUNDS {
        let given = M::predict(bound.prepared(), &effects, monitor)?;
        for (row, given) in given.into_iter().enumerate() {
            if let (Ok(given), true) = (given, slope[row] != 0.0) {
                rest[row] += (wanted[row] - given) / slope[row];
            }
        }
        let over = [Over { name: Over::ALONG, at: at.to_vec() }];
        let found = Unnamed { over: &over, size: &|place| straight((at, place[0]), None, &rest).value };
        let Some(remainder) = M::remainder(bound.prepared(), &acting, &found) else { return Ok(acting) };
        effects.clone_from(&acting);
        put::<M>(&mut effects, remainder);
    }
    Ok(effects)
}
