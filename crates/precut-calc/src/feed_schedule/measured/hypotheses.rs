//! The causes of the catalogue as they stand for a model and its measured cuts.

use crate::calculator::{
    Expansions, Hypotheses, Hypothesis, Inapplicability, Inapplicable, Range, Shape, Treatment, Variable,
    values_by_name, values_of_formula,
};
use crate::effects::{Cause, Fit, MACHINABILITY_CAUSES, MachinabilityEffect as Effect, Parameter};
use crate::machinability::ModelForm;

use crate::feed_schedule::job::formula;
use crate::feed_schedule::job::remainder::label;
use crate::feed_schedule::measured::forward::{PreparedMachinability, Row};
use crate::feed_schedule::measured::levels::{NamedLevel, batches, factors};

/// Prior standard deviation of a force that does not vanish with the chip, share of the force at the reference.
const EDGE_FORCE_SHARE: f64 = 0.1;

impl PreparedMachinability {
    /// `held` acts already.
    pub(in crate::feed_schedule) fn hypotheses(&self, held: &[Effect]) -> Hypotheses {
        let mut sorted = Hypotheses::default();
        for cause in MACHINABILITY_CAUSES {
            match self.inapplicability(cause, held) {
                Some(reason) => sorted.inapplicable.push(Inapplicable { cause, reason }),
                None => sorted.applicable.extend(self.hypotheses_of(cause, held)),
            }
        }
        sorted
    }

    fn is_force(&self) -> bool {
        matches!(self.output.as_str(), "force_z" | "force_y")
    }

    fn is_wear(&self) -> bool {
        self.output.starts_with("flank_wear")
    }

    fn inapplicability(&self, cause: &'static Cause, held: &[Effect]) -> Option<Inapplicability> {
        let acts = match cause.kind {
            "nose_radius_floor" => self.output == "roughness",
            "edge_force_offset" | "wear_force_additive" => self.is_force(),
            "wear_multiplicative" => !self.is_wear(),
            "wear_in" => self.is_wear(),
            // What was never found has no shape by which it could be known again.
            "remainder" => self.remainders(held).next().is_some(),
            "formula" => self.formulas(held, cause).next().is_some(),
            _ => true,
        };
        if !acts {
            return Some(Inapplicability::NothingToActOn);
        }
        match cause.kind {
            "batch_shift" => named(batches(&self.rows).len(), "batch"),
            "factor_shift" => self.factors(1),
            "factor_interaction" => self.factors(2),
            "speed_exponent" | "built_up_edge" => self.varies("speed_m_per_min", 2),
            "feed_exponent" => self.varies("feed_mm_per_rev", 2),
            "depth_exponent" => self.varies("depth_mm", 2),
            "angle_exponent" => self.varies("cutting_edge_angle_deg", 2),
            "speed_curvature" => self.varies("speed_m_per_min", 3),
            "feed_curvature" => self.varies("feed_mm_per_rev", 3),
            "depth_curvature" => self.varies("depth_mm", 3),
            "speed_feed_interaction" => self.varies("speed_m_per_min", 2).or_else(|| self.varies("feed_mm_per_rev", 2)),
            "feed_depth_interaction" => self.varies("feed_mm_per_rev", 2).or_else(|| self.varies("depth_mm", 2)),
            "speed_depth_interaction" => self.varies("speed_m_per_min", 2).or_else(|| self.varies("depth_mm", 2)),
            "nose_radius_floor" => {
                let known = self.rows.iter().all(|row| row.nose_radius_mm.is_some());
                (!known).then_some(Inapplicability::ConditionAbsent("nose_radius_mm"))
            }
            "wear_multiplicative" | "wear_force_additive" => self.varies("flank_wear_mm", 2),
            "wear_in" => self.varies("time_min", 2),
            _ => None,
        }
    }

    /// Formulas that act on this output and have numbers to be fitted.
    fn formulas<'a>(&'a self, held: &'a [Effect], cause: &'static Cause) -> impl Iterator<Item = Hypothesis> + 'a {
        let acts = move |effect: &&Effect| effect.output().is_none_or(|output| output == self.output);
        held.iter().filter(acts).filter_map(move |effect| formula::ROOM.hypothesis(cause, &effect.formula()?))
    }

    /// Why nothing can be said that needs so many factors with levels that differ.
    fn factors(&self, needed: usize) -> Option<Inapplicability> {
        let known = factors(&self.rows);
        let varying = known.iter().filter(|(_, levels)| levels.len() > 1).count();
        match (known.len() < needed, varying < needed) {
            (true, _) => Some(Inapplicability::ConditionAbsent("factors")),
            (_, true) => Some(Inapplicability::ConditionConstant("factors")),
            _ => None,
        }
    }

    /// Why nothing can be said that needs so many values of a condition.
    fn varies(&self, field: &'static str, needed: usize) -> Option<Inapplicability> {
        let Some(mut values) = self.rows.iter().map(|row| condition(row, field)).collect::<Option<Vec<f64>>>() else {
            return Some(Inapplicability::ConditionAbsent(field));
        };
        values.sort_by(f64::total_cmp);
        values.dedup_by(|a, b| same(*a, *b));
        match values.len() {
            0 | 1 => Some(Inapplicability::ConditionConstant(field)),
            2 if needed > 2 => Some(Inapplicability::ConditionAtTwoLevels(field)),
            _ => None,
        }
    }

    fn hypotheses_of(&self, cause: &'static Cause, held: &[Effect]) -> Vec<Hypothesis> {
        let of = |label: String, prior_weight: f64| Hypothesis {
            cause,
            label,
            variables: cause.parameters.iter().map(|parameter| self.variable(parameter)).collect(),
            prior_weight,
            held: None,
        };
        if matches!(cause.kind, "batch_shift" | "factor_shift" | "factor_interaction") {
            let levels = self.named.iter().filter(|level| level.effect.kind() == cause.kind);
            return levels.map(|level| of(level.label.clone(), level.weight)).collect();
        }
        if cause.kind == "formula" {
            return self.formulas(held, cause).collect();
        }
        if cause.kind == "remainder" {
            return self.remainders(held).map(|(name, _, profile)| of(label(name, profile), 1.0)).collect();
        }
        vec![of(String::new(), 1.0)]
    }

    fn variable(&self, parameter: &Parameter) -> Variable {
        let at_reference = self.value_at_reference().abs();
        // Of a model that is no power law what is added is added to the output itself.
        let unit_of_l = if self.model.form == ModelForm::SemiLog { at_reference } else { 1.0 };
        let size = match parameter.name {
            "offset_n" => EDGE_FORCE_SHARE * at_reference,
            "scale" | "n_per_mm" | "wear_in_mm" | "rate_mm_per_min" => parameter.prior_sd,
            _ => parameter.prior_sd * unit_of_l,
        };
        let treatment = match parameter.fit {
            Fit::Amplitude | Fit::Factor => Treatment::Amplitude { prior_sd: size },
            Fit::Shape { grid } => Treatment::Shape { grid: grid.to_vec(), prior: shape_prior(parameter.name) },
            Fit::Fixed { default } => Treatment::Stated { value: default },
            Fit::OfJob => Treatment::Stated { value: self.of_job(parameter.name) },
        };
        let stretch = if matches!(treatment, Treatment::Amplitude { .. }) { size / parameter.prior_sd } else { 1.0 };
        let range = if parameter.name == "offset_n" {
            Range { lower: parameter.lower, upper: parameter.upper }
        } else {
            Range { lower: parameter.lower * stretch, upper: parameter.upper * stretch }
        };
        Variable { name: parameter.name, unit: parameter.unit, treatment, range }
    }

    fn of_job(&self, name: &str) -> f64 {
        let r = &self.reference;
        let stated = match name {
            "reference_speed_m_per_min" => r.speed_m_per_min,
            "reference_feed_mm_per_rev" => r.feed_mm_per_rev,
            "reference_depth_mm" => r.depth_mm,
            "reference_angle_deg" => r.cutting_edge_angle_deg,
            "nose_radius_mm" => self.rows.first().and_then(|row| row.nose_radius_mm),
            _ => None,
        };
        stated.unwrap_or(1.0)
    }

    fn level_of(&self, hypothesis: &Hypothesis) -> Option<&NamedLevel> {
        let is_it =
            |level: &&NamedLevel| level.effect.kind() == hypothesis.cause.kind && level.label == hypothesis.label;
        self.named.iter().find(is_it)
    }

    /// The values of a hypothesis' variables at which it is this effect.
    pub(in crate::feed_schedule) fn values_of(&self, hypothesis: &Hypothesis, effect: &Effect) -> Option<Vec<f64>> {
        if effect.output().is_some_and(|output| output != self.output) {
            return None;
        }
        if let Effect::Remainder { name, profile, .. } = effect
            && hypothesis.label != label(name, profile)
        {
            return None;
        }
        if let Some(own) = effect.formula() {
            return values_of_formula(hypothesis, &own);
        }
        match self.level_of(hypothesis) {
            Some(level) => level.shift_in(effect).map(|by| vec![by]),
            None => values_by_name(hypothesis, effect),
        }
    }

    /// The effects that a hypothesis stands for at these values of its variables.
    pub(in crate::feed_schedule) fn effects_of(&self, hypothesis: &Hypothesis, values: &[f64]) -> Option<Vec<Effect>> {
        let mut effect = match (self.level_of(hypothesis), values) {
            (Some(level), &[by]) => level.shifted(by),
            _ => Effect::from_parameters(hypothesis.cause, values)?,
        };
        effect.set_output(Some(self.output.clone()));
        Some(vec![effect])
    }
}

/// Whether a set of named levels varies.
fn named(levels: usize, field: &'static str) -> Option<Inapplicability> {
    match levels {
        0 => Some(Inapplicability::ConditionAbsent(field)),
        1 => Some(Inapplicability::ConditionConstant(field)),
        _ => None,
    }
}

/// A condition of a row as a number.
pub(in crate::feed_schedule) fn condition(row: &Row, field: &str) -> Option<f64> {
    match field {
        "speed_m_per_min" => Some(row.u.exp()),
        "feed_mm_per_rev" => Some(row.x.exp()),
        "depth_mm" => Some(row.depth_mm),
        "cutting_edge_angle_deg" => row.angle_deg,
        "nose_radius_mm" => row.nose_radius_mm,
        "flank_wear_mm" => row.conditions.flank_wear_mm,
        "time_min" => row.conditions.time_min,
        _ => None,
    }
}

/// Whether two values of a condition are one: equal to the rounding of the logarithm and back.
pub(in crate::feed_schedule) fn same(a: f64, b: f64) -> bool {
    (a - b).abs() <= 1e-9 * a.abs().max(b.abs())
}

/// Priors of the shapes that are fitted beyond their grids (`diagnosis/3.4`).
fn shape_prior(name: &str) -> Option<Shape> {
    match name {
        "centre_m_per_min" => Some(Shape { mean: 38.0, sd: 10.0, logarithmic: false }),
        "width_m_per_min" => Some(Shape { mean: 18.0_f64.ln(), sd: 0.4, logarithmic: true }),
        // Ideal marks have 1; worn or vibrating edges up to 3.
        "k" => Some(Shape { mean: 0.0, sd: 0.6, logarithmic: true }),
        "time_constant_min" => Some(Shape { mean: 5.0_f64.ln(), sd: 0.7, logarithmic: true }),
        _ => None,
    }
}

/// Sizes about which a hypothesis is linearised beside 0: a wear-in stands in place of the model and has no value at 0.
pub(in crate::feed_schedule) fn expansions(hypothesis: &Hypothesis) -> Expansions {
    match (hypothesis.cause.kind, hypothesis.variables.first()) {
        ("wear_in", Some(Variable { treatment: Treatment::Amplitude { prior_sd }, .. })) => {
            Expansions::along([0.5, 1.0, 2.0].map(|share| share * prior_sd))
        }
        _ => Expansions::default(),
    }
}
