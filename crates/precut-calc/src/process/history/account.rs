//! What paths brought: every part as it was cut, beside what it would have been on other paths (`process/6`).

use std::collections::VecDeque;
use std::sync::Arc;

use nalgebra::{DMatrix, DVector};
use serde::{Deserialize, Serialize};

use crate::calculator::{Failure, ForwardModel, Limits, Monitor, Watched};
use crate::num::stats::{Resampler, quantile};
use crate::process::answer::output::State;
use crate::process::change::null::Null;
use crate::process::history::memory::Memory;
use crate::process::history::watch::Watch;
use crate::process::part::document::{DocumentOf, PartOf};
use crate::process::part::sight::{Eye, Sighting, Signs};

/// Draws of what is not known of the model.
const DRAWS: usize = 400;
/// Ends of an interval that holds 95 %.
const ENDS: [f64; 2] = [0.025, 0.975];

/// What the paths of a process brought, over all parts that were used and are not odd.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct Gain {
    /// Parts in the account.
    pub parts: usize,
    /// Of these cut on another path than the base job's; the others count with a gain of 0.
    pub parts_cut_with_new_path: usize,
    /// Mean form of those on the nominal path, um on the diameter.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub form_nothing_um: Option<f64>,
    /// Mean form of those on the path of the base job.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub form_base_um: Option<f64>,
    /// Mean form of those as they were cut.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub form_as_cut_um: Option<f64>,
    /// By how much the form is smaller than on the path of the base job, summed over all parts.
    pub form_gain_um: f64,
    /// The same with 95 %.
    pub form_gain_interval_95: [f64; 2],
    /// The same, mean over all parts.
    pub form_gain_per_part_um: f64,
    /// Parts within the drawing that would not have been on the path of the base job: expected number.
    pub parts_saved: f64,
    /// The same with 95 %.
    pub parts_saved_interval_95: [f64; 2],
    /// Parts beyond the drawing that would have been within it on the path of the base job: expected number.
    pub parts_spoilt: f64,
    /// The same with 95 %.
    pub parts_spoilt_interval_95: [f64; 2],
}

/// A part on three paths.
#[derive(Debug, Clone, PartialEq, Serialize)]
pub struct PartGain {
    /// The part.
    pub number: u32,
    /// On the nominal path.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub nothing: Option<OnPath>,
    /// On the path of the base job.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub base: Option<OnPath>,
    /// As it was cut and measured.
    pub as_cut: OnPath,
}

/// Form and size of a part on a path.
#[derive(Debug, Clone, Copy, PartialEq, Serialize)]
pub struct OnPath {
    /// Largest minus smallest deviation, um on the diameter.
    pub form_um: f64,
    /// The same with 95 %.
    pub form_interval_95: [f64; 2],
    /// Mean deviation, um on the diameter.
    pub size_um: f64,
    /// The same with 95 %.
    pub size_interval_95: [f64; 2],
    /// Probability that it would have been within the drawing; absent where that allows anything.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub in_tolerance_probability: Option<f64>,
}

/// Paths on which a part might have been cut.
#[derive(Clone, Copy)]
enum Tier {
    Nothing,
    Base,
}

/// A part whose account is still open.
pub(in crate::process) struct Cut<M: Watched> {
    pub(in crate::process) part: PartOf<M>,
    pub(in crate::process) sighting: Sighting,
}

/// Path that the base job gives, and the run that decided it.
type Decided<M> = (<M as ForwardModel>::Run, Option<<M as ForwardModel>::Run>);

/// The account: parts in memory are open, as what is known of their model still changes; older ones are closed.
pub(in crate::process) struct Account<M: Watched> {
    pub(in crate::process) open: VecDeque<Cut<M>>,
    /// Look at parts as if they were cut on the nominal path, and on that of the base job.
    eyes: [Eye<M>; 2],
    /// Of each type the last one.
    decided: Vec<Option<Decided<M>>>,
    pub(in crate::process) closed: Totals,
    /// Standard normal numbers, a draw each row.
    normals: DMatrix<f64>,
}

/// Sums over parts.
#[derive(Clone, Serialize, Deserialize)]
pub(in crate::process) struct Totals {
    parts: usize,
    on_other: usize,
    /// Forms of those on another path: without compensation, on the base job's path, and as cut.
    #[serde(with = "crate::process::part::bits")]
    forms: [f64; 3],
    /// How many had a path of the base job.
    with_base: usize,
    /// Draw by draw: form gained, parts saved, parts spoilt.
    draws: Vec<[f64; 3]>,
}

impl<M: Watched> Account<M> {
    pub(in crate::process) fn new(document: &DocumentOf<M>) -> Self {
        Self {
            open: VecDeque::new(),
            eyes: [Eye::new(document.clone()), Eye::new(document.clone())],
            decided: document.part_types.keys().map(|_| None).collect(),
            closed: Totals { parts: 0, on_other: 0, forms: [0.0; 3], with_base: 0, draws: vec![[0.0; 3]; DRAWS] },
            normals: DMatrix::zeros(DRAWS, 0),
        }
    }

    pub(in crate::process) fn copy(&self) -> Self {
        Self {
            open: self.open.iter().map(|cut| Cut { part: cut.part.clone(), sighting: cut.sighting.clone() }).collect(),
            eyes: [self.eyes[0].copy(), self.eyes[1].copy()],
            decided: self.decided.clone(),
            closed: self.closed.clone(),
            normals: self.normals.clone(),
        }
    }

    /// The last part of a type that counts.
    pub(in crate::process) fn last_of(&self, kind: usize) -> Option<&PartOf<M>> {
        self.open.iter().rev().find(|cut| cut.sighting.kind == kind).map(|cut| &cut.part)
    }

    /// The run on the path that the base job gives for it.
    pub(in crate::process) fn on_base(
        &mut self,
        kind: usize,
        run: &M::Run,
        monitor: &dyn Monitor,
    ) -> Result<Option<M::Run>, Failure> {
        let Some(of_type) = self.eyes[0].document.part_types.values().nth(kind) else { return Ok(None) };
        let deciding = M::deciding(&of_type.job, run);
        if !self.decided[kind].as_ref().is_some_and(|(known, _)| *known == deciding) {
            let path = M::compensated(&of_type.job, &deciding, monitor)?;
            self.decided[kind] = Some((deciding, path));
        }
        let path = self.decided[kind].as_ref().and_then(|(_, path)| path.as_ref());
        Ok(path.map(|path| M::on_path_of(run, path)))
    }

    /// A part as it would have been seen on another path; `None` on a path that there is not.
    fn seen_on(
        &mut self,
        tier: Tier,
        part: &PartOf<M>,
        memory: &Memory,
        monitor: &dyn Monitor,
    ) -> Result<Option<Arc<Signs>>, Failure> {
        let kind = self.eyes[0].kind(part)?;
        let run = match tier {
            Tier::Nothing => Some(M::on_path_of(&part.conditions, &M::Run::default())),
            Tier::Base => self.on_base(kind, &part.conditions, monitor)?,
        };
        let Some(run) = run else { return Ok(None) };
        // Another path shows the same causes.
        let mut catalogue = memory.catalogue.clone();
        let other = PartOf::<M> { conditions: run, ..part.clone() };
        self.eyes[tier as usize].signs(&other, &mut catalogue, monitor).map(Some)
    }

    fn draws(&mut self, null: &Null) -> DMatrix<f64> {
        let count = null.columns.len();
        for column in self.normals.ncols()..count {
            let mut random = Resampler::new(6, column as u64);
            self.normals = self.normals.clone().insert_column(column, 0.0);
            self.normals.column_mut(column).iter_mut().for_each(|own| *own = random.normal());
        }
        // theta = mean + L'^-1 z, a draw each column.
        let mut draws = self.normals.columns(0, count).transpose();
        null.factor.l_dirty().tr_solve_lower_triangular_mut(&mut draws);
        let mean = null.mean();
        draws.column_iter_mut().for_each(|mut own| own += &mean);
        draws
    }

    /// A part on both other paths.
    fn weighed(
        &mut self,
        cut: &Cut<M>,
        null: &Null,
        draws: &DMatrix<f64>,
        memory: &Memory,
        monitor: &dyn Monitor,
    ) -> Result<Weighed, Failure> {
        let Cut { part, sighting } = cut;
        let limits = M::limits(&self.eyes[0].document.part_types[&part.part_type].job);
        let as_cut = Shape::of(sighting.value.iter().copied(), sighting);
        let is_nominal = part.conditions == M::on_path_of(&part.conditions, &M::Run::default());
        let base = self.on_base(sighting.kind, &part.conditions, monitor)?;
        let is_base = base.as_ref() == Some(&part.conditions);
        let mut on = |tier: Tier, is_own: bool| -> Result<Option<Vec<Shape>>, Failure> {
            if is_own {
                return Ok(Some(vec![as_cut; DRAWS]));
            }
            let Some(signs) = self.seen_on(tier, part, memory, monitor)? else { return Ok(None) };
            let other = Sighting { signs, ..sighting.clone() };
            let scatter = memory.scattered(&other) - memory.scattered(sighting);
            Ok(others(sighting, &other, null, draws, &scatter))
        };
        let (nothing, on_base) = (on(Tier::Nothing, is_nominal)?, on(Tier::Base, is_base)?);
        Ok(Weighed { number: part.number, limits, as_cut, nothing, base: on_base, is_base })
    }
}

/// Form and size of every draw of a part on another path: y + f(other) - f(own), the causes of either path at their sizes
/// (`process/6.1`). What the part scatters by itself is in both; `scatter` is by how much it does more on the other path.
/// `None` where the model does not say what that path gives.
fn others(
    own: &Sighting,
    other: &Sighting,
    null: &Null,
    draws: &DMatrix<f64>,
    scatter: &DMatrix<f64>,
) -> Option<Vec<Shape>> {
    let kept = |row: usize| own.keep[row];
    if (0..own.value.len()).any(|row| kept(row) && !other.signs.predicted[row]) {
        return None;
    }
    let rows = own.value.len();
    let slopes: Vec<DVector<f64>> = null
        .rows_of(other)
        .into_iter()
        .zip(null.rows_of(own))
        .map(|(there, here)| DVector::from_vec(there) - DVector::from_vec(here))
        .collect();
    let moved = DVector::from_fn(rows, |row, _| own.value[row] + other.signs.base[row] - own.signs.base[row]);
    let mut moved = DMatrix::from_columns(&slopes) * draws + moved * DMatrix::from_element(1, draws.ncols(), 1.0);
    if scatter.amax() > 0.0 {
        let mut random = Resampler::new(7, u64::from(own.number));
        moved += scatter * DMatrix::from_fn(scatter.ncols(), draws.ncols(), |_, _| random.normal());
    }
    Some(moved.column_iter().map(|column| Shape::of(column.iter().copied(), own)).collect())
}

/// Largest, smallest and mean deviation, um on the diameter.
#[derive(Clone, Copy)]
struct Shape {
    most: f64,
    least: f64,
    mean: f64,
}

impl Shape {
    fn of(values: impl Iterator<Item = f64>, part: &Sighting) -> Self {
        let (mut most, mut least, mut sum, mut count) = (f64::NEG_INFINITY, f64::INFINITY, 0.0, 0.0);
        for (value, _) in values.zip(&part.keep).filter(|(_, keep)| **keep) {
            let um = value / part.signs.per_um;
            (most, least) = (f64::max(most, um), f64::min(least, um));
            (sum, count) = (sum + um, count + 1.0);
        }
        Self { most, least, mean: sum / count }
    }

    fn form(&self) -> f64 {
        self.most - self.least
    }

    fn fits(&self, limits: &Limits) -> bool {
        limits.form_um.is_none_or(|allowed| self.form() <= allowed)
            && limits.lower_um.is_none_or(|allowed| self.least >= allowed)
            && limits.upper_um.is_none_or(|allowed| self.most <= allowed)
    }
}

/// A part on its path and on others, draw by draw.
struct Weighed {
    number: u32,
    limits: Limits,
    as_cut: Shape,
    nothing: Option<Vec<Shape>>,
    base: Option<Vec<Shape>>,
    /// Whether it was cut on the path of the base job.
    is_base: bool,
}

impl Weighed {
    fn on(&self, shapes: &[Shape]) -> OnPath {
        let spread = |of: &dyn Fn(&Shape) -> f64| {
            let mut all: Vec<f64> = shapes.iter().map(of).collect();
            let mean = all.iter().sum::<f64>() / all.len() as f64;
            (mean, interval(&mut all))
        };
        let (form_um, form_interval_95) = spread(&Shape::form);
        let (size_um, size_interval_95) = spread(&|shape| shape.mean);
        let within = shapes.iter().filter(|shape| shape.fits(&self.limits)).count();
        let is_limited = self.limits != Limits::default();
        let in_tolerance_probability = is_limited.then(|| within as f64 / shapes.len() as f64);
        OnPath { form_um, form_interval_95, size_um, size_interval_95, in_tolerance_probability }
    }

    fn told(&self) -> PartGain {
        PartGain {
            number: self.number,
            nothing: self.nothing.as_ref().map(|shapes| self.on(shapes)),
            base: self.base.as_ref().map(|shapes| self.on(shapes)),
            as_cut: self.on(&[self.as_cut]),
        }
    }
}

impl Totals {
    fn add(&mut self, part: &Weighed) {
        self.parts += 1;
        if part.is_base {
            return;
        }
        self.on_other += 1;
        let (own, mean) =
            (part.as_cut.form(), |shapes: &[Shape]| shapes.iter().map(Shape::form).sum::<f64>() / DRAWS as f64);
        let Some(base) = &part.base else { return };
        self.with_base += 1;
        self.forms[0] += part.nothing.as_ref().map_or(f64::NAN, |shapes| mean(shapes));
        self.forms[1] += mean(base);
        self.forms[2] += own;
        let is_good = part.as_cut.fits(&part.limits);
        for (sums, shape) in self.draws.iter_mut().zip(base) {
            let would_be = shape.fits(&part.limits);
            sums[0] += shape.form() - own;
            sums[1] += f64::from(u8::from(is_good && !would_be));
            sums[2] += f64::from(u8::from(!is_good && would_be));
        }
    }

    fn told(&self) -> Gain {
        let of = |k: usize| {
            let mut all: Vec<f64> = self.draws.iter().map(|sums| sums[k]).collect();
            (all.iter().sum::<f64>() / DRAWS as f64, interval(&mut all))
        };
        let form = |k: usize| Some(self.forms[k] / self.with_base as f64).filter(|form| form.is_finite());
        let ((form_gain_um, form_gain_interval_95), saved, spoilt) = (of(0), of(1), of(2));
        Gain {
            parts: self.parts,
            parts_cut_with_new_path: self.on_other,
            form_nothing_um: form(0),
            form_base_um: form(1),
            form_as_cut_um: form(2),
            form_gain_um,
            form_gain_interval_95,
            form_gain_per_part_um: form_gain_um / self.parts.max(1) as f64,
            parts_saved: saved.0,
            parts_saved_interval_95: saved.1,
            parts_spoilt: spoilt.0,
            parts_spoilt_interval_95: spoilt.1,
        }
    }
}

/// Where 95 % of them lie.
fn interval(all: &mut [f64]) -> [f64; 2] {
    all.sort_by(f64::total_cmp);
    ENDS.map(|end| quantile(all, end).unwrap_or(0.0))
}

impl<M: Watched> Watch<M> {
    /// Takes a part into the account, closes it over parts that left the memory, and takes odd ones out.
    pub(in crate::process) fn book(
        &mut self,
        part: &PartOf<M>,
        state: &State,
        monitor: &dyn Monitor,
    ) -> Result<(), Failure> {
        let newest = self.memory.parts.back().filter(|(own, _)| own.number == part.number);
        let newest = newest.map(|(own, _)| Cut { part: part.clone(), sighting: own.clone() });
        self.account.open.extend(newest);
        let is_odd = |number: u32| state.odd_parts.iter().any(|odd| odd.number == number);
        self.account.open.retain(|cut| !is_odd(cut.part.number));
        let Some(first) = self.memory.parts.front().map(|(part, _)| part.number) else { return Ok(()) };
        let mut left = VecDeque::new();
        while self.account.open.front().is_some_and(|cut| cut.part.number < first) {
            left.extend(self.account.open.pop_front());
        }
        if left.is_empty() {
            return Ok(());
        }
        let weighed = self.weighed(&left, monitor)?;
        for part in &weighed {
            self.account.closed.add(part);
        }
        Ok(())
    }

    /// What the paths brought so far, and of the parts in memory one by one.
    pub fn gain(&mut self, monitor: &dyn Monitor) -> Result<(Gain, Vec<PartGain>), Failure> {
        let open = std::mem::take(&mut self.account.open);
        let weighed = self.weighed(&open, monitor);
        self.account.open = open;
        let weighed = weighed?;
        let mut totals = self.account.closed.clone();
        for part in &weighed {
            totals.add(part);
        }
        Ok((totals.told(), weighed.iter().map(Weighed::told).collect()))
    }

    fn weighed(&mut self, cuts: &VecDeque<Cut<M>>, monitor: &dyn Monitor) -> Result<Vec<Weighed>, Failure> {
        let Self { memory, account, .. } = self;
        let all = memory.with_null(|_, null| {
            let draws = account.draws(null);
            cuts.iter().map(|cut| account.weighed(cut, null, &draws, memory, monitor)).collect()
        });
        // While the scatter is not known nothing is known of the model.
        all.unwrap_or_else(|| Ok(Vec::new()))
    }
}
