//! What a part shows: how far it lies from the model, and what every cause would do to it (`process/3.1`).

use std::borrow::Cow;
use std::sync::Arc;

use serde::{Deserialize, Serialize};

use crate::calculator::{
    Calculator, Failure, Hypothesis, Measurement, Monitor, PrepareError, Rows, Smooth, Treatment, Watched,
};
use crate::diagnosis::{Bound, Data, DiagnosisOptions, Known, Layout, Signatures, Sparse, Subject, cosine, layout};
use crate::effects::Cause;
use crate::process::answer::output::ModelShape;
use crate::process::part::document::{Document, GaugeCheck, Part};

/// The part is off by the same all along it.
const LEVEL: &str = "size_offset";
/// Cosines along a part.
pub(in crate::process) const COSINES: usize = 8;
/// The gauge is off: what it reads, not the part.
pub(in crate::process) const GAUGE: &str = "gauge_offset";
/// What is known of that: kind, field and unit. It is no effect of a job, so that no catalogue has it.
pub const GAUGE_SIZE: (&str, &str, &str) = (GAUGE, "offset_um", "um");
/// Prior standard deviation of that, on the radius as that of `size_offset`, um.
const GAUGE_UM: f64 = 8.0;

/// A cause that may change, by its name.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(in crate::process) struct Name {
    pub(in crate::process) kind: Cow<'static, str>,
    /// Which of several of one kind.
    pub(in crate::process) label: String,
}

/// One size of a cause at one point of the grid of its shapes: one column.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(in crate::process) struct Variant {
    pub(in crate::process) name: usize,
    /// The size: its field, unit and prior standard deviation.
    pub(in crate::process) parameter: Cow<'static, str>,
    pub(in crate::process) unit: Cow<'static, str>,
    pub(in crate::process) prior_sd: f64,
    /// Least and largest value of the change.
    #[serde(with = "crate::process::part::bits")]
    pub(in crate::process) range: [f64; 2],
    /// Which of the variables of the hypothesis, and what the others are; none of the gauge.
    pub(in crate::process) setting: Option<(usize, Vec<f64>)>,
    /// The form that it has: what tells it from the other columns of its cause.
    pub(in crate::process) shape: Vec<ModelShape>,
    /// Whether it is free although nothing changed.
    pub(in crate::process) in_null: bool,
}

impl Variant {
    /// Least and largest change, in prior standard deviations. Of what is free although nothing changed nobody knows from where
    /// it changes: it has no bounds.
    pub(in crate::process) fn reach(&self) -> [f64; 2] {
        if self.in_null {
            return [f64::NEG_INFINITY, f64::INFINITY];
        }
        self.range.map(|end| end / self.prior_sd)
    }
}

/// All causes that the parts so far can speak of.
#[derive(Debug, Clone, Default, Serialize, Deserialize)]
pub(in crate::process) struct Catalogue {
    pub(in crate::process) names: Vec<Name>,
    pub(in crate::process) variants: Vec<Variant>,
}

impl Catalogue {
    fn name(&mut self, kind: &'static str, label: &str) -> usize {
        let is_it = |name: &Name| name.kind == kind && name.label == label;
        self.names.iter().position(is_it).unwrap_or_else(|| {
            self.names.push(Name { kind: kind.into(), label: label.to_owned() });
            self.names.len() - 1
        })
    }

    fn variant(&mut self, variant: Variant) -> usize {
        let is_it = |own: &Variant| own.name == variant.name && own.setting == variant.setting;
        self.variants.iter().position(is_it).unwrap_or_else(|| {
            self.variants.push(variant);
            self.variants.len() - 1
        })
    }

    /// Share of every variant of all that may change. Names have equal shares, which their variants divide; a level that
    /// moved is one name, be it that of the part or of the gauge.
    pub(in crate::process) fn shares(&self) -> Vec<f64> {
        let weight = |name: usize| if [LEVEL, GAUGE].contains(&&*self.names[name].kind) { 0.5 } else { 1.0 };
        let total: f64 = (0..self.names.len()).map(weight).sum();
        let count = |name: usize| self.variants.iter().filter(|variant| variant.name == name).count() as f64;
        self.variants.iter().map(|own| weight(own.name) / total / count(own.name)).collect()
    }

    /// The variant of the gauge.
    pub(in crate::process) fn gauge(&self) -> Option<usize> {
        self.variants.iter().position(|variant| variant.setting.is_none())
    }
}

/// What does not depend on what was measured: parts that were cut and measured alike share it.
pub(in crate::process) struct Signs {
    /// Prediction of the model, in the unit of the quantity; 0 where it has none.
    pub(in crate::process) base: Vec<f64>,
    pub(in crate::process) predicted: Vec<bool>,
    pub(in crate::process) layout: Layout,
    pub(in crate::process) cosines: Vec<Vec<f64>>,
    /// Columns of variants, at one prior standard deviation.
    pub(in crate::process) causes: Vec<(usize, Vec<f64>)>,
    /// One stated standard deviation of each allowance of a single part.
    pub(in crate::process) scatter: Vec<Vec<f64>>,
    /// What the gauge reads of 1 um on the diameter.
    pub(in crate::process) per_um: f64,
}

/// Looks at parts; what it saw last of each type is kept.
pub(in crate::process) struct Eye<M: Watched> {
    pub(in crate::process) document: Document<<M as Calculator>::Input, M::Allowances>,
    seen: Vec<Option<Before<M>>>,
}

/// Sweep and place of a row.
type Place = (u32, Vec<(&'static str, Option<f64>)>);

struct Before<M: Watched> {
    run: M::Run,
    rows: Vec<Place>,
    signs: Arc<Signs>,
}

impl<M: Watched> Eye<M> {
    pub(in crate::process) fn new(document: Document<<M as Calculator>::Input, M::Allowances>) -> Self {
        let seen = document.part_types.keys().map(|_| None).collect();
        Self { document, seen }
    }

    pub(in crate::process) fn copy(&self) -> Self {
        let copied = |before: &Before<M>| Before {
            run: before.run.clone(),
            rows: before.rows.clone(),
            signs: Arc::clone(&before.signs),
        };
        let seen = self.seen.iter().map(|before| before.as_ref().map(copied)).collect();
        Self { document: self.document.clone(), seen }
    }

    /// Number of a type in the order of the names.
    pub(in crate::process) fn kind(&self, part: &Part<M::Run, M::Row>) -> Result<usize, Failure> {
        let known = self.document.part_types.keys().position(|name| *name == part.part_type);
        known.ok_or_else(|| Failure::Internal(format!("a part of an unknown type {}", part.part_type)))
    }

    /// What was measured of a part, row by row.
    pub(in crate::process) fn values(&self, part: &Part<M::Run, M::Row>) -> Vec<f64> {
        used(part).into_iter().filter_map(|row| part.measurements[row].value(&self.document.quantity)).collect()
    }

    /// What a part shows, whatever was measured of it.
    pub(in crate::process) fn signs(
        &mut self,
        part: &Part<M::Run, M::Row>,
        catalogue: &mut Catalogue,
        monitor: &dyn Monitor,
    ) -> Result<Arc<Signs>, Failure> {
        let kind = self.kind(part)?;
        let place = |row: usize| (part.measurements[row].trace(), M::place(&part.measurements[row].point()));
        let rows: Vec<_> = used(part).into_iter().map(place).collect();
        if let Some(before) = &self.seen[kind]
            && before.run == part.conditions
            && before.rows == rows
        {
            return Ok(before.signs.clone());
        }
        let signs = Arc::new(self.looked_at(part, catalogue, monitor)?);
        self.seen[kind] = Some(Before { run: part.conditions.clone(), rows, signs: signs.clone() });
        Ok(signs)
    }

    /// The model bound to the rows of a part.
    pub(in crate::process) fn bound<'m>(
        &self,
        part: &Part<M::Run, M::Row>,
        monitor: &'m dyn Monitor,
    ) -> Result<(Bound<'m, M>, Layout), Failure> {
        let points = used(part).into_iter().map(|row| part.measurements[row].point()).collect();
        let bound = self.bound_at(&part.part_type, &part.conditions, points, monitor)?;
        let layout = layout(&part.measurements, &used(part), M::design(bound.prepared()));
        Ok((bound, layout))
    }

    /// The model bound to places on a part.
    pub(in crate::process) fn bound_at<'m>(
        &self,
        part_type: &str,
        run: &M::Run,
        points: Vec<M::Point>,
        monitor: &'m dyn Monitor,
    ) -> Result<Bound<'m, M>, Failure> {
        let job = &self.document.part_types[part_type].job;
        let quantity = &self.document.quantity;
        let rows = Rows { runs: vec![run.clone()], points: points.into_iter().map(|point| (0, point)).collect() };
        let prepared = M::prepare(&M::without_effects(job), &rows, quantity, monitor).map_err(unprepared)?;
        let known = Known { effects: M::own_effects(job).to_vec(), unsure: Vec::new() };
        let options = DiagnosisOptions::default();
        let allowances = self.document.allowances.clone();
        Bound::new(prepared, known, allowances, quantity, &options, monitor)
    }

    /// What a part would show at places along it, all in one sweep.
    pub(in crate::process) fn signs_at(
        &self,
        part_type: &str,
        run: &M::Run,
        points: Vec<M::Point>,
        catalogue: &mut Catalogue,
        monitor: &dyn Monitor,
    ) -> Result<Signs, Failure> {
        let rows = points.len();
        let bound = self.bound_at(part_type, run, points, monitor)?;
        let design = M::design(bound.prepared());
        let layout = Layout { traces: vec![(0..rows).collect()], run_of_trace: vec![0], design };
        self.signs_of(part_type, &bound, layout, catalogue, monitor)
    }

    fn looked_at(
        &self,
        part: &Part<M::Run, M::Row>,
        catalogue: &mut Catalogue,
        monitor: &dyn Monitor,
    ) -> Result<Signs, Failure> {
        let (bound, layout) = self.bound(part, monitor)?;
        self.signs_of(&part.part_type, &bound, layout, catalogue, monitor)
    }

    fn signs_of(
        &self,
        part_type: &str,
        bound: &Bound<'_, M>,
        layout: Layout,
        catalogue: &mut Catalogue,
        monitor: &dyn Monitor,
    ) -> Result<Signs, Failure> {
        let predictions = bound.predict(&[])?;
        let predicted: Vec<bool> = predictions.iter().map(Result::is_ok).collect();
        let base: Vec<f64> = predictions.into_iter().map(|f| f.unwrap_or(0.0)).collect();
        let signatures = Signatures::of(bound, &base, &vec![0.0; base.len()], monitor)?;
        let mut causes = Vec::new();
        for (hypothesis, variants) in bound.hypotheses().iter().zip(&signatures.variants) {
            for variant in variants {
                let sizes = variant.free.iter().filter(|_| variant.offset.is_none() && variant.grid_point.is_some());
                for (order, free) in sizes.enumerate() {
                    let mut own = of_size(catalogue, hypothesis, free.variable, &variant.setting.values);
                    own.in_null = lives_by_conditions(hypothesis.cause, order, variant.grid_point, variants.len());
                    causes.push((catalogue.variant(own), signatures.columns[free.column].clone()));
                }
            }
        }
        let per_um = M::per_diameter_um(&self.document.quantity);
        let name = catalogue.name(GAUGE, "");
        let gauge = catalogue.variant(Variant {
            name,
            parameter: GAUGE_SIZE.1.into(),
            unit: GAUGE_SIZE.2.into(),
            prior_sd: GAUGE_UM,
            range: [f64::NEG_INFINITY, f64::INFINITY],
            setting: None,
            shape: Vec::new(),
            in_null: false,
        });
        causes.push((gauge, vec![2.0 * GAUGE_UM * per_um; base.len()]));
        let Smooth::Along(along) = &layout.design.smooth else {
            return Err(Failure::Internal("a watched part whose rows do not stand along it".to_owned()));
        };
        let cosines = (0..COSINES).map(|k| along.iter().map(|&u| cosine(k, u)).collect()).collect();
        let own = M::own_effects(&self.document.part_types[part_type].job);
        let scatter = M::scatter(bound.prepared(), own, &self.document.allowances, monitor)?;
        Ok(Signs { base, predicted, layout, cosines, causes, scatter, per_um })
    }
}

/// The size of a hypothesis as a cause that may change.
fn of_size(catalogue: &mut Catalogue, hypothesis: &Hypothesis, variable: usize, values: &[f64]) -> Variant {
    let own = &hypothesis.variables[variable];
    let prior_sd = match own.treatment {
        Treatment::Amplitude { prior_sd } => prior_sd,
        _ => 1.0,
    };
    let shape =
        hypothesis.variables.iter().zip(values).filter(|(of, _)| matches!(of.treatment, Treatment::Shape { .. }));
    let shape = shape.map(|(of, &value)| ModelShape { parameter: of.name.into(), unit: of.unit.into(), value });
    Variant {
        name: catalogue.name(hypothesis.cause.kind, &hypothesis.label),
        parameter: own.name.into(),
        unit: own.unit.into(),
        prior_sd,
        range: [own.range.lower, own.range.upper],
        setting: Some((variable, values.to_vec())),
        shape: shape.collect(),
        in_null: false,
    }
}

/// Whether a cause comes and goes with the conditions of the parts, so that it acts although nothing changed: its first size, at
/// every second point of the grid of its shapes.
fn lives_by_conditions(cause: &Cause, order: usize, grid_point: Option<usize>, points: usize) -> bool {
    let is_tried = points == 1 || grid_point.is_some_and(|point| point % 2 == 1);
    !cause.conditions.is_empty() && order == 0 && is_tried
}

/// Rows of a part that count.
pub(in crate::process) fn used<R, W: Measurement>(part: &Part<R, W>) -> Vec<usize> {
    (0..part.measurements.len()).filter(|&row| !part.measurements[row].excluded()).collect()
}

fn unprepared(error: PrepareError) -> Failure {
    match error {
        PrepareError::Failed(failure) => failure,
        PrepareError::Invalid(findings) => findings
            .into_iter()
            .next()
            .map_or_else(|| Failure::Internal("rows without a reason".to_owned()), Failure::OutOfModel),
    }
}

impl Signs {
    /// A part of which nothing was measured.
    pub(in crate::process) fn unmeasured(self: Arc<Self>, number: u32, kind: usize) -> Sighting {
        let rows = self.base.len();
        Sighting {
            number,
            ordinal: 0,
            kind,
            value: vec![0.0; rows],
            residual: vec![0.0; rows],
            keep: self.predicted.clone(),
            signs: self,
            checks: Vec::new(),
            path_m: None,
            odd: false,
        }
    }
}

/// A part in the memory of the process.
#[derive(Clone)]
pub(in crate::process) struct Sighting {
    pub(in crate::process) number: u32,
    /// How many parts had come before it.
    pub(in crate::process) ordinal: usize,
    pub(in crate::process) kind: usize,
    pub(in crate::process) signs: Arc<Signs>,
    pub(in crate::process) value: Vec<f64>,
    /// Measured minus predicted.
    pub(in crate::process) residual: Vec<f64>,
    /// Rows that count.
    pub(in crate::process) keep: Vec<bool>,
    pub(in crate::process) checks: Vec<GaugeCheck>,
    /// Path that its edge had cut when it began, m, where that is known.
    pub(in crate::process) path_m: Option<f64>,
    /// Whether it is odd by itself and counts no more.
    pub(in crate::process) odd: bool,
}

impl Sighting {
    pub(in crate::process) fn data(&self) -> Data {
        Data { value: self.value.clone(), uncertainty: None, sides: None, layout: self.signs.layout.clone() }
    }

    /// Its allowances, each times a factor.
    pub(in crate::process) fn scatter(&self, factors: &[f64]) -> Vec<Sparse> {
        let scaled = |(column, factor): (&Vec<f64>, &f64)| column.iter().map(|x| x * factor).collect::<Vec<_>>();
        self.signs.scatter.iter().zip(factors).map(|pair| Sparse::of(&scaled(pair))).collect()
    }
}
