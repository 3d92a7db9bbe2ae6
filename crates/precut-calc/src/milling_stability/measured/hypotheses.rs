//! The causes of the catalogue as they stand for a cutter, its modes and a log of cuts.

use crate::calculator::{
    Condition, Design, Expansions, Grouping, Hypotheses, Hypothesis, Inapplicability, Inapplicable, Range, Smooth,
    Treatment, Variable, values_by_name,
};
use crate::effects::{Cause, MILLING_CAUSES, MillingEffect};
use crate::fixture_stability::{RUNOUTS, SHIFTS};

use super::super::model::{Law, Milling, Vector};
use super::forward::MOST_FOLDS;
use super::predict::{PreparedMilling, PreparedRow};

/// Sizes about which other factors are linearised, prior standard deviations: which mode chatters first may change with them.
const FACTORS: [f64; 2] = [1.0, 2.0];
/// A tooth that stands out farther than so many feeds leaves its neighbours no chip.
const MOST_FEEDS: f64 = 2.0;

/// The catalogue, sorted by whether a log can speak about a cause. What is of a mode is there once for each mode.
pub(super) fn hypotheses(prepared: &PreparedMilling) -> Hypotheses {
    let mut sorted = Hypotheses::default();
    let Some(case) = prepared.case() else { return sorted };
    let modes = prepared.modes().len();
    let nothing = Inapplicability::NothingToActOn;
    for cause in MILLING_CAUSES {
        let acts = match cause.kind {
            "mode_frequency" | "mode_damping" | "mode_stiffness" => modes > 0,
            "radial_ratio" => radial(&case.milling.law).abs() > 0.0,
            "tooth_runout" => case.milling.teeth.len() > 1,
            _ => true,
        };
        if !acts {
            sorted.inapplicable.push(Inapplicable { cause, reason: nothing });
        } else if is_of_modes(cause) {
            // Several modes are one cause: they share its weight.
            let weight = 1.0 / modes as f64;
            sorted.applicable.extend((1..=modes).map(|mode| of_mode(cause, mode, weight)));
        } else {
            let range = |p: &crate::effects::Parameter| range_of(cause, p, prepared);
            let variables = cause.parameters.iter().map(|p| Variable::of(p, range(p))).collect();
            sorted.applicable.push(Hypothesis {
                cause,
                label: String::new(),
                variables,
                prior_weight: 1.0,
                held: None,
            });
        }
    }
    sorted
}

fn is_of_modes(cause: &Cause) -> bool {
    cause.parameters.iter().any(|parameter| parameter.name == "mode")
}

fn of_mode(cause: &'static Cause, mode: usize, prior_weight: f64) -> Hypothesis {
    let variable = |p: &crate::effects::Parameter| {
        let variable = Variable::of(p, Range { lower: p.lower, upper: p.upper });
        match p.name {
            "mode" => Variable { treatment: Treatment::Stated { value: mode as f64 }, ..variable },
            _ => variable,
        }
    };
    let variables = cause.parameters.iter().map(variable).collect();
    Hypothesis { cause, label: format!("mode {mode}"), variables, prior_weight, held: None }
}

fn radial(law: &Law) -> f64 {
    let part = |[_, radial, _]: &Vector| *radial;
    match law {
        Law::Mechanistic { cutting, .. } => part(cutting),
        Law::Power { at_1_mm, .. } => part(at_1_mm),
    }
}

fn range_of(cause: &Cause, parameter: &crate::effects::Parameter, prepared: &PreparedMilling) -> Range {
    let Range { mut lower, mut upper } = Range { lower: parameter.lower, upper: parameter.upper };
    if cause.kind == "tooth_runout" {
        let feeds = prepared.rows.iter().map(|row| row.feed_mm);
        upper = feeds.fold(upper, |least, feed| least.min(MOST_FEEDS * feed));
        lower = -upper;
        // Of two teeth either may be called the one that stands out.
        if prepared.case().is_some_and(|case| is_a_pair(&case.milling)) {
            lower = 0.0;
        }
    }
    Range { lower, upper }
}

/// Two teeth that differ in nothing.
fn is_a_pair(milling: &Milling) -> bool {
    milling.teeth.len() == 2 && milling.teeth_are_alike()
}

/// The effects that a hypothesis stands for at these values of its variables.
pub(super) fn effects(hypothesis: &Hypothesis, values: &[f64]) -> Option<Vec<MillingEffect>> {
    let mut own = values.to_vec();
    for (value, variable) in own.iter_mut().zip(&hypothesis.variables) {
        if variable.name == "ln_factor" {
            *value = value.exp();
        }
    }
    // None rubs nothing, and leaves the period of the cut as it is.
    let is_none = matches!(hypothesis.cause.kind, "process_damping" | "tooth_runout")
        && own.first().is_some_and(|size| size.abs() < f64::MIN_POSITIVE);
    if is_none { Some(Vec::new()) } else { Some(vec![MillingEffect::from_parameters(hypothesis.cause, &own)?]) }
}

/// The values of a hypothesis' variables at which it is this effect.
pub(super) fn values(hypothesis: &Hypothesis, effect: &MillingEffect) -> Option<Vec<f64>> {
    let Some(factor) = effect.factor() else { return values_by_name(hypothesis, effect) };
    let mode = effect.mode().map(f64::from);
    let is_of_it = |variable: &Variable| match (variable.name, &variable.treatment) {
        ("mode", Treatment::Stated { value }) => mode.is_some_and(|mode| (mode - value).abs() < 0.5),
        _ => true,
    };
    if hypothesis.cause.kind != effect.kind() || !hypothesis.variables.iter().all(is_of_it) {
        return None;
    }
    Some(mode.into_iter().chain([factor.ln()]).collect())
}

/// Sizes about which a hypothesis is linearised beside 0: what shifts a lobe, or lets another mode chatter first, does not do so in a
/// straight line, nor does a tooth that stands out.
pub(super) fn expansions(hypothesis: &Hypothesis) -> Expansions {
    match (hypothesis.cause.kind, hypothesis.variables.as_slice()) {
        ("mode_damping" | "mode_stiffness", [_, factor]) | ("force_coefficient" | "radial_ratio", [factor]) => {
            Expansions::either_way(factor, &FACTORS)
        }
        ("mode_frequency", [_, factor]) => Expansions::either_way(factor, &SHIFTS),
        ("tooth_runout", [runout]) => Expansions::either_way(runout, &RUNOUTS),
        _ => Expansions::default(),
    }
}

/// Cuts of one condition are repeats; cuts of one speed are held back together, some speeds at a time.
pub(super) fn design(prepared: &PreparedMilling) -> Design {
    let rows = &prepared.rows;
    let of = |key: &dyn Fn(&PreparedRow) -> [u64; 4]| Design::numbered(&rows.iter().map(key).collect::<Vec<_>>());
    let cell = of(&|row| [row.case as u64, row.spindle_rpm.to_bits(), row.depth_mm.to_bits(), row.margin as u64]);
    let speed = of(&|row| [row.spindle_rpm.to_bits(), 0, 0, 0]);
    let grouping = |name, conditions: Vec<&'static str>, group: &[usize]| Grouping {
        name,
        over: Vec::new(),
        conditions,
        group: group.to_vec(),
    };
    let ln = |name, value: fn(&PreparedRow) -> f64| {
        Condition::of(name, &rows.iter().map(|row| value(row).max(f64::MIN_POSITIVE).ln()).collect::<Vec<_>>())
    };
    let conditions = [
        ln("speed", |row| row.spindle_rpm),
        ln("depth", |row| row.depth_mm),
        ln("width", |row| row.width_mm),
        ln("feed", |row| row.feed_mm),
    ];
    Design {
        smooth: Smooth::None,
        fold: speed.iter().map(|speed| speed % MOST_FOLDS).collect(),
        groupings: vec![grouping("per_speed", vec!["speed"], &speed), grouping("per_cell", Vec::new(), &cell)],
        cell,
        regressors: Vec::new(),
        conditions: conditions.into_iter().flatten().collect(),
        order: None,
    }
}
