//! Series of parts whose scatter, always acting causes and change are known: what figures are measured on.

use nalgebra::{DMatrix, DVector};
use precut_calc::calculator::{ForwardModel, Rows, Unwatched};
use precut_calc::deflection_compensation::{DeflectionCompensation, DeflectionPoint, DeflectionRun};
use precut_calc::effects::DeflectionEffect;
use precut_calc::num::stats::Resampler;

use super::{Document, Part, process, stream};

/// Scatter of a reading and of the setting, um on the diameter, and of the force from part to part.
pub(crate) const SIGMA_UM: f64 = 1.0;
pub(crate) const SETUP_UM: f64 = 1.0;
pub(crate) const FORCE: f64 = 0.007;

/// What may change in a series.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Hidden {
    Tailstock,
    Headstock,
    Carriage,
    TailstockOffset,
    Wear,
    Warmth,
    Force,
    Gauge,
    Distortion,
}

impl Hidden {
    /// The nine of the tables.
    pub(crate) const ALL: [Self; 9] = [
        Self::Tailstock,
        Self::Headstock,
        Self::Carriage,
        Self::TailstockOffset,
        Self::Wear,
        Self::Warmth,
        Self::Force,
        Self::Gauge,
        Self::Distortion,
    ];

    pub(crate) fn kind(self) -> &'static str {
        match self {
            Self::Tailstock => "tailstock_compliance",
            Self::Headstock => "headstock_compliance",
            Self::Carriage => "carriage_compliance",
            Self::TailstockOffset => "tailstock_offset",
            Self::Wear => "tool_wear",
            Self::Warmth => "thermal_growth",
            Self::Force => "force_level",
            Self::Gauge => "gauge_offset",
            Self::Distortion => "unnamed",
        }
    }

    /// Whether edges wear and the machine warms in its series.
    pub(crate) fn lives(self) -> bool {
        matches!(self, Self::Wear | Self::Warmth | Self::Force)
    }

    /// One unit, of the size that is natural for it.
    fn unit(self) -> f64 {
        match self {
            Self::Tailstock | Self::Headstock | Self::Carriage => 1e-3,
            Self::Force => 0.01,
            _ => 1.0,
        }
    }

    /// What acts at a size, beside what always does; none where it is nothing of the part.
    fn effect(self, size: f64) -> Option<DeflectionEffect> {
        let delta_um_per_n = size;
        Some(match self {
            Self::Tailstock => DeflectionEffect::TailstockCompliance { delta_um_per_n },
            Self::Headstock => DeflectionEffect::HeadstockCompliance { delta_um_per_n },
            Self::Carriage => DeflectionEffect::CarriageCompliance { delta_um_per_n },
            Self::TailstockOffset => DeflectionEffect::TailstockOffset { offset_um: size },
            Self::Wear => wear(size),
            Self::Warmth => warmth(size),
            Self::Force => DeflectionEffect::ForceLevel { delta: size },
            Self::Gauge | Self::Distortion => return None,
        })
    }

    /// What it adds to a reading at a share of the length, um on the diameter, where it is nothing of the part.
    fn adds(self, share: f64) -> f64 {
        match self {
            Self::Gauge => 1.0,
            // Three half waves along the part.
            Self::Distortion => (3.0 * std::f64::consts::PI * share).sin(),
            _ => 0.0,
        }
    }

    pub(crate) fn both_signs(self) -> bool {
        matches!(self, Self::TailstockOffset | Self::Force | Self::Gauge | Self::Distortion)
    }
}

fn wear(rate_um_per_km: f64) -> DeflectionEffect {
    DeflectionEffect::ToolWear { rate_um_per_km, wear_in_um: 0.0, wear_in_path_m: 400.0 }
}

fn warmth(growth_um: f64) -> DeflectionEffect {
    DeflectionEffect::ThermalGrowth { growth_um, time_constant_min: 12.0 }
}

/// What a series is made of.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Recipe {
    pub(crate) count: u32,
    /// What changes, by how many standard deviations of a part, and with which part.
    pub(crate) change: Option<(Hidden, f64, u32)>,
    /// Whether edges wear and the machine warms.
    pub(crate) lives: bool,
    /// Whether two types come in lots of five.
    pub(crate) two_types: bool,
    /// Whether readings scatter with tails, as Student's t with five degrees.
    pub(crate) tails: bool,
}

/// Parts, and what is true of them.
pub(crate) struct Series {
    pub(crate) document: Document,
    pub(crate) parts: Vec<Part>,
    /// Of every part the mean of its rows where nothing changed, and its covariance.
    pub(crate) mean: Vec<DVector<f64>>,
    pub(crate) covariance: Vec<DMatrix<f64>>,
    /// What its change does to every part in which it acts; nothing where nothing changes.
    pub(crate) shift: Vec<DVector<f64>>,
    /// Where each row stands along its part, 0 to 1.
    pub(crate) share: Vec<Vec<f64>>,
}

/// Predictions of one type.
struct Rule<'a> {
    document: &'a Document,
    template: &'a Part,
    runs: Vec<DeflectionRun>,
}

impl Rule<'_> {
    fn predict(&self, effects: &[DeflectionEffect]) -> Vec<DVector<f64>> {
        let rows = self.template.measurements.len();
        let points = (0..self.runs.len()).flat_map(|run| {
            self.template.measurements.iter().map(move |row| (run, DeflectionPoint { z_mm: row.z_mm }))
        });
        let rows_of = Rows { runs: self.runs.clone(), points: points.collect() };
        let job = &self.document.part_types[&self.template.part_type].job;
        let prepared = DeflectionCompensation::prepare(job, &rows_of, &self.document.quantity, &Unwatched).unwrap();
        let all = DeflectionCompensation::predict(&prepared, effects, &Unwatched).unwrap();
        let all: Vec<f64> = all.into_iter().map(Result::unwrap).collect();
        all.chunks(rows).map(DVector::from_row_slice).collect()
    }
}

/// One type of parts over all numbers.
struct OfType<'a> {
    rule: Rule<'a>,
    mean: Vec<DVector<f64>>,
    /// What one unit of force more does.
    force: Vec<DVector<f64>>,
    covariance: Vec<DMatrix<f64>>,
}

impl Series {
    pub(crate) fn of(recipe: &Recipe, seed: u64) -> Self {
        let (mut document, known) = process(&stream("r03-carriage-two-part-types.json"));
        document.options.false_alarm_every_parts = 500;
        if !recipe.two_types {
            document.part_types.remove("B");
        }
        let mut random = Resampler::new(seed, 17);
        let templates: Vec<&Part> =
            document.part_types.keys().map(|name| known.iter().find(|part| part.part_type == *name).unwrap()).collect();
        let runs: Vec<DeflectionRun> = (0..recipe.count).map(|n| conditions(n, recipe.lives)).collect();
        let always = if recipe.lives { vec![wear(3.0), warmth(6.0)] } else { Vec::new() };
        let with = |effect: Option<DeflectionEffect>| -> Vec<DeflectionEffect> {
            let others = always.iter().filter(|own| effect.as_ref().is_none_or(|e| e.kind() != own.kind()));
            others.cloned().chain(effect.clone()).collect()
        };
        let sign = if recipe.change.is_some_and(|(hidden, ..)| hidden.both_signs()) && random.uniform() < 0.5 {
            -1.0
        } else {
            1.0
        };
        let mut of_types = Vec::new();
        for template in &templates {
            let rule = Rule { document: &document, template, runs: runs.clone() };
            let mean = rule.predict(&always);
            let harder = rule.predict(&with(Some(DeflectionEffect::ForceLevel { delta: 1e-3 })));
            let force: Vec<DVector<f64>> = harder.iter().zip(&mean).map(|(a, b)| (a - b) / 1e-3).collect();
            let covariance: Vec<DMatrix<f64>> = force.iter().map(covariance_of).collect();
            of_types.push(OfType { rule, mean, force, covariance });
        }
        let place = |n: usize| if recipe.two_types { n / 5 % 2 } else { 0 };
        let moved = recipe.change.map(|(hidden, delta, since)| {
            let length_mm = |kind: usize| document.part_types[&templates[kind].part_type].job.shaft.length_mm();
            let added = |kind: usize, size: f64| -> DVector<f64> {
                let rows = templates[kind].measurements.iter();
                DVector::from_vec(rows.map(|row| size * hidden.adds(row.z_mm / length_mm(kind))).collect())
            };
            let base = match hidden {
                Hidden::Wear => 3.0,
                Hidden::Warmth => 6.0,
                _ => 0.0,
            };
            let shift_of = |kind: usize, own: &OfType<'_>, size: f64| -> Vec<DVector<f64>> {
                match hidden.effect(base + size) {
                    Some(effect) => {
                        own.rule.predict(&with(Some(effect))).iter().zip(&own.mean).map(|(a, b)| a - b).collect()
                    }
                    None => vec![added(kind, size); own.mean.len()],
                }
            };
            let shift = |size: f64| -> Vec<Vec<DVector<f64>>> {
                of_types.iter().enumerate().map(|(kind, own)| shift_of(kind, own, size)).collect()
            };
            // Its size: so many standard deviations of a part, root mean square over the parts since.
            let unit = shift(hidden.unit());
            let after = since as usize - 1..recipe.count as usize;
            let square = |n: usize| {
                let own = &unit[place(n)][n];
                own.dot(&of_types[place(n)].covariance[n].clone().cholesky().unwrap().solve(own))
            };
            let length = (after.clone().map(square).sum::<f64>() / after.len() as f64).sqrt();
            (shift(sign * delta / length * hidden.unit()), since)
        });
        let parts = (0..recipe.count as usize).map(|n| {
            let OfType { mean, force, .. } = &of_types[place(n)];
            let (setup, by_force) = (SETUP_UM * random.normal(), FORCE * random.normal());
            let mut part = templates[place(n)].clone();
            part.number = u32::try_from(n).unwrap() + 1;
            part.conditions = runs[n].clone();
            part.edge = None;
            for (row, own) in part.measurements.iter_mut().enumerate() {
                let change = moved.as_ref().filter(|(_, since)| part.number >= *since);
                let change = change.map_or(0.0, |(shift, _)| shift[place(n)][n][row]);
                let reading = if recipe.tails { student(&mut random) } else { random.normal() };
                own.diameter_deviation_um =
                    Some(mean[n][row] + change + setup + force[n][row] * by_force + SIGMA_UM * reading);
            }
            part
        });
        let parts: Vec<Part> = parts.collect();
        let all = 0..recipe.count as usize;
        let shift = moved.map_or_else(Vec::new, |(shift, _)| all.clone().map(|n| shift[place(n)][n].clone()).collect());
        let length_mm = |part: &Part| document.part_types[&part.part_type].job.shaft.length_mm();
        let share_of = |part: &Part| part.measurements.iter().map(|row| row.z_mm / length_mm(part)).collect();
        let share = parts.iter().map(share_of).collect();
        let mean = all.clone().map(|n| of_types[place(n)].mean[n].clone()).collect();
        let covariance = all.map(|n| of_types[place(n)].covariance[n].clone()).collect();
        Self { document, parts, mean, covariance, shift, share }
    }
}

/// Edges of twelve parts; days of twenty-five, with a pause after the twelfth part.
fn conditions(n: u32, lives: bool) -> DeflectionRun {
    let (of_edge, of_day) = (f64::from(n % 12), f64::from(n % 25));
    let pause = if n % 25 >= 12 { 20.0 } else { 0.0 };
    let acts = f64::from(u8::from(lives));
    DeflectionRun {
        tool_path_at_start_m: Some(acts * 234.572 * of_edge),
        warm_time_at_start_min: Some(acts * (4.846 * of_day - pause)),
        ..DeflectionRun::default()
    }
}

fn covariance_of(force: &DVector<f64>) -> DMatrix<f64> {
    let rows = force.len();
    let ones = DVector::from_element(rows, SETUP_UM);
    DMatrix::identity(rows, rows) * SIGMA_UM.powi(2)
        + &ones * ones.transpose()
        + force * force.transpose() * FORCE.powi(2)
}

/// Student's t with five degrees, at a variance of 1.
fn student(random: &mut Resampler) -> f64 {
    let square: f64 = (0..5).map(|_| random.normal().powi(2)).sum();
    random.normal() / (square / 5.0).sqrt() * (3.0_f64 / 5.0).sqrt()
}
