//! The causes of the catalogue as they stand for a shaft and its measured runs.

use crate::calculator::{
    Design, Hypotheses, Hypothesis, Inapplicability, Inapplicable, Range, Shape, Smooth, Treatment, Variable,
};
use crate::deflection_compensation::job::check::passive_exponent;
use crate::deflection_compensation::job::formula;
use crate::deflection_compensation::job::input::{Job, Support};
use crate::deflection_compensation::measured::run::DeflectionRun;
use crate::deflection_compensation::model::regime::Regime;
use crate::effects::{Cause, DEFLECTION_CAUSES, DeflectionEffect, Fit, Parameter};
use crate::num::beam::second_moment_mm4;
use crate::shaft::elastic::{clamping, ends};

/// What decides which causes runs can speak about.
pub(in crate::deflection_compensation) struct Experiment<'a> {
    pub(in crate::deflection_compensation) job: &'a Job,
    pub(in crate::deflection_compensation) runs: &'a [DeflectionRun],
    /// Effects that act already.
    pub(in crate::deflection_compensation) held: &'a [DeflectionEffect],
}

impl Experiment<'_> {
    pub(in crate::deflection_compensation) fn hypotheses(&self) -> Hypotheses {
        let mut sorted = Hypotheses::default();
        for cause in DEFLECTION_CAUSES {
            match self.inapplicability(cause) {
                Some(reason) => sorted.inapplicable.push(Inapplicable { cause, reason }),
                None => sorted.applicable.extend(self.hypotheses_of(cause)),
            }
        }
        sorted
    }

    fn inapplicability(&self, cause: &'static Cause) -> Option<Inapplicability> {
        if !cause.moves_mean {
            return Some(Inapplicability::ScatterOnly);
        }
        if let Some(absent) = cause.conditions.iter().find(|field| !self.is_given(field)) {
            return Some(Inapplicability::ConditionAbsent(absent));
        }
        let constant = |field, varies: bool| (!varies).then_some(Inapplicability::ConditionConstant(field));
        let supports = &self.job.supports;
        match cause.kind {
            "depth_exponent" => constant("depth_mm", self.varies(|run| run.depth_mm)),
            "feed_exponent" => constant("feed_mm_per_rev", self.varies(|run| run.feed_mm_per_rev)),
            "speed_exponent" | "built_up_edge" => constant(
                "speed_m_per_min",
                self.varies(|run| run.speed_m_per_min) || self.varies(|run| run.spindle_speed_rpm),
            ),
            "reversal_backlash" => constant("feed_direction", self.both_directions()),
            "steady_rest_offset" if !supports.iter().any(|s| matches!(s, Support::SteadyRest { .. })) => {
                Some(Inapplicability::NothingToActOn)
            }
            // What was never found has no shape by which it could be known again.
            "remainder" if !self.held.iter().any(|effect| effect.kind() == cause.kind) => {
                Some(Inapplicability::NothingToActOn)
            }
            "formula" if self.formulas(cause).next().is_none() => Some(Inapplicability::NothingToActOn),
            "chuck_rotational_stiffness" if !self.headstock_is_centre() => Some(Inapplicability::NothingToActOn),
            "tailstock_compliance" | "tailstock_offset" if self.tailstock_um_per_n().is_none() => {
                Some(Inapplicability::NothingToActOn)
            }
            _ => None,
        }
    }

    fn is_given(&self, field: &str) -> bool {
        let conditions = &self.job.conditions;
        match field {
            "tool_path_at_start_m" => {
                conditions.tool_path_at_start_m.is_some() || self.runs.iter().all(|r| r.tool_path_at_start_m.is_some())
            }
            "warm_time_at_start_min" => {
                conditions.warm_time_at_start_min.is_some()
                    || self.runs.iter().all(|r| r.warm_time_at_start_min.is_some())
            }
            _ => false,
        }
    }

    fn varies(&self, condition: impl Fn(&DeflectionRun) -> Option<f64>) -> bool {
        let mut values = self.runs.iter().map(condition);
        values.next().is_some_and(|first| {
            values.any(|value| match (first, value) {
                (Some(a), Some(b)) => (a - b).abs() > 1e-9 * a.abs(),
                (a, b) => a.is_some() != b.is_some(),
            })
        })
    }

    fn both_directions(&self) -> bool {
        let direction = |run: &DeflectionRun| run.feed_direction.unwrap_or(self.job.cut.feed_direction);
        self.runs.windows(2).any(|pair| direction(&pair[0]) != direction(&pair[1]))
    }

    /// A chuck has a rotational compliance of its own, stated in the job.
    fn headstock_is_centre(&self) -> bool {
        let head = clamping(&self.job.supports).map(|i| &self.job.supports[i]);
        matches!(head, Some(Support::Centre { .. }))
    }

    fn headstock_um_per_n(&self) -> Option<f64> {
        ends(&self.job.supports).0.and_then(|i| compliance_um_per_n(&self.job.supports[i]))
    }

    fn tailstock_um_per_n(&self) -> Option<f64> {
        ends(&self.job.supports).1.and_then(|i| compliance_um_per_n(&self.job.supports[i]))
    }

    fn hypotheses_of(&self, cause: &'static Cause) -> Vec<Hypothesis> {
        let of = |label: String, variables: Vec<Variable>| Hypothesis {
            cause,
            label,
            variables,
            prior_weight: 1.0,
            held: None,
        };
        match cause.kind {
            "steady_rest_offset" => {
                let stations = self.job.supports.iter().filter_map(|support| match support {
                    Support::SteadyRest { z_mm, .. } => Some(*z_mm),
                    _ => None,
                });
                stations
                    .map(|z| {
                        let variables = cause.parameters.iter().map(|p| self.variable(cause, p, Some(z))).collect();
                        of(format!("{z} mm"), variables)
                    })
                    .collect()
            }
            // Known by the name that the user gave to it.
            "remainder" => {
                let name = self.held.iter().map(remainder_name).collect();
                vec![of(name, cause.parameters.iter().map(|p| self.variable(cause, p, None)).collect())]
            }
            "formula" => self.formulas(cause).collect(),
            // C is almost linear in kappa = k/(k + 3 E I/L).
            "chuck_rotational_stiffness" => vec![of(
                String::new(),
                vec![Variable {
                    name: "kappa",
                    unit: "1",
                    treatment: Treatment::Amplitude { prior_sd: 0.5 },
                    range: Range { lower: 0.0, upper: 0.999 },
                }],
            )],
            _ => vec![of(String::new(), cause.parameters.iter().map(|p| self.variable(cause, p, None)).collect())],
        }
    }

    /// Formulas of the user that have numbers to be fitted.
    fn formulas(&self, cause: &'static Cause) -> impl Iterator<Item = Hypothesis> {
        self.held.iter().filter_map(move |effect| formula::ROOM.hypothesis(cause, &effect.formula()?))
    }

    fn variable(&self, cause: &Cause, parameter: &Parameter, station_mm: Option<f64>) -> Variable {
        let at_least = |compliance: Option<f64>| compliance.map_or(0.0, |c| -c);
        let lower = match cause.kind {
            "headstock_compliance" => at_least(self.headstock_um_per_n()),
            "tailstock_compliance" => at_least(self.tailstock_um_per_n()),
            "carriage_compliance" => -self.job.carriage.compliance_um_per_n,
            // A force that falls with depth is refused.
            "depth_exponent" if parameter.name == "delta" => passive_exponent(&self.job.force)
                .map_or(parameter.lower, |exponent| parameter.lower.max(0.0 - exponent)),
            _ => parameter.lower,
        };
        let treatment = match parameter.fit {
            Fit::Amplitude | Fit::Factor => Treatment::Amplitude { prior_sd: parameter.prior_sd },
            Fit::Shape { grid } => Treatment::Shape { grid: grid.to_vec(), prior: shape_prior(parameter.name) },
            Fit::Fixed { default } => Treatment::Stated { value: self.reference(parameter.name).unwrap_or(default) },
            Fit::OfJob => Treatment::Stated { value: station_mm.unwrap_or(0.0) },
        };
        Variable {
            name: parameter.name,
            unit: parameter.unit,
            treatment,
            range: Range { lower, upper: parameter.upper },
        }
    }

    /// Where the exponent effects turn: the regime of the job itself.
    fn reference(&self, name: &str) -> Option<f64> {
        let cut = &self.job.cut;
        let turned = self.job.shaft.segments.iter().find(|s| s.stock_mm() > s.diameter_mm);
        match name {
            "reference_depth_mm" => turned.map(|s| (s.stock_mm() - s.diameter_mm) / 2.0),
            "reference_feed_mm_per_rev" => Some(cut.feed_mm_per_rev),
            "reference_speed_m_per_min" => {
                turned.map(|s| Regime::of(cut).speed_m_per_min(s.stock_mm() / 2.0, s.diameter_mm / 2.0))
            }
            _ => None,
        }
    }
}

/// What a remainder is called; nothing of other effects.
pub(in crate::deflection_compensation) fn remainder_name(effect: &DeflectionEffect) -> &str {
    match effect {
        DeflectionEffect::Remainder { name, .. } => name,
        _ => "",
    }
}

fn compliance_um_per_n(support: &Support) -> Option<f64> {
    match support {
        Support::Centre { compliance_um_per_n, .. } | Support::Chuck { compliance_um_per_n, .. } => {
            Some(*compliance_um_per_n)
        }
        _ => None,
    }
}

/// Priors of the shapes that are fitted beyond their grids (`diagnosis/3.4`).
fn shape_prior(name: &str) -> Option<Shape> {
    match name {
        "time_constant_min" => Some(Shape { mean: 8.0_f64.ln(), sd: 0.7, logarithmic: true }),
        "centre_m_per_min" => Some(Shape { mean: 42.0, sd: 12.0, logarithmic: false }),
        "width_m_per_min" => Some(Shape { mean: 20.0_f64.ln(), sd: 0.4, logarithmic: true }),
        _ => None,
    }
}

/// 3 E I/L, with 1/(E I) averaged along the shaft, N mm/rad.
pub(in crate::deflection_compensation) fn chuck_scale_n_mm_per_rad(job: &Job) -> f64 {
    let flexibility: f64 = job
        .shaft
        .segments
        .iter()
        .map(|s| s.length_mm / (job.shaft.modulus() * second_moment_mm4(s.diameter_mm, s.bore_diameter_mm)))
        .sum();
    3.0 / flexibility
}

/// Rows along the shaft; equal stations of one run are repeats; a run is held back whole.
pub(in crate::deflection_compensation) fn design(job: &Job, places: &[(usize, f64)]) -> Design {
    let length: f64 = job.shaft.segments.iter().map(|s| s.length_mm).sum();
    let mut cells: Vec<(usize, f64)> = Vec::new();
    let mut sorted: Vec<usize> = (0..places.len()).collect();
    sorted.sort_by(|&a, &b| places[a].0.cmp(&places[b].0).then(places[a].1.total_cmp(&places[b].1)));
    let mut cell = vec![0; places.len()];
    for row in sorted {
        let (run, z) = places[row];
        if cells.last().is_none_or(|(r, at)| *r != run || (z - at).abs() > 1e-9 * length) {
            cells.push((run, z));
        }
        cell[row] = cells.len() - 1;
    }
    Design {
        smooth: Smooth::Along(places.iter().map(|(_, z)| z / length).collect()),
        cell,
        regressors: Vec::new(),
        groupings: Vec::new(),
        conditions: Vec::new(),
        order: None,
        fold: places.iter().map(|(run, _)| *run).collect(),
    }
}
