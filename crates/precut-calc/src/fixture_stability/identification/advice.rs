//! What the table fixes, what it cannot, where the model fails it, what to measure next.

use crate::calculator::{Finding, Message};

use super::output::{Combination, IdentificationOutcome};
use super::problem::{HUBER, Problem};
use super::unknowns::Parameter;

/// A difference of the objective that decides between laws: odds of 20 to 1.
const DECISIVE: f64 = 6.0;
/// Correlation from which two parameters are hardly told apart.
const CORRELATED: f64 = 0.95;
/// Relative standard error above which a parameter is hardly fixed.
const LOOSE: f64 = 0.5;
/// Change of an amplitude by half the step that says there are two motions.
const TWO_MOTIONS: f64 = 0.15;
/// Power in a combination that is worth naming in any case.
const NAMED_POWER: f64 = 0.1;
/// What a combination as it is worded is known to may be so many times what the combination itself is known to.
const TRUE_TO: f64 = 1.1;
/// Decimals of a power: so many where the words are then true, else more.
const DECIMALS: std::ops::RangeInclusive<usize> = 2..=4;
/// A share of a combination that the table does not see which is more than rounding.
const SHARE: f64 = 1e-3;

/// Codes of the warnings made here.
pub(super) const WARNING_CODES: &[&str] = &[
    "identification_at_bound",
    "identification_not_fixed",
    "identification_correlated",
    "identification_row_missed",
    "identification_two_motions",
    "identification_onset_missed",
    "identification_law_undecided",
    "identification_one_speed",
    "identification_clamp_contradicted",
];

/// Codes of the explanations made here.
pub(super) const EXPLANATION_CODES: &[&str] = &[
    "identification_fits",
    "identification_predicts",
    "identification_law_is",
    "identification_known_best",
    "identification_known_least",
    "identification_clamp_between",
    "identification_clamp_above",
    "identification_not_unique",
];

pub(super) fn warnings(problem: &Problem<'_>, outcome: &IdentificationOutcome) -> Vec<Finding> {
    let mut found = Vec::new();
    for (parameter, unknown) in outcome.parameters.iter().zip(&problem.unknowns) {
        let at = format!("/unknowns/{}", parameter.name);
        let unit = unknown.parameter.unit();
        if parameter.at_bound {
            let end =
                if parameter.value - unknown.from < unknown.to - parameter.value { unknown.from } else { unknown.to };
            found.push(
                Finding::new("identification_at_bound", at.clone())
                    .measured(parameter.value, end, unit)
                    .with("name", parameter.name.clone()),
            );
        }
        let size = if unknown.parameter.is_logarithmic() { parameter.value } else { unknown.to - unknown.from };
        if parameter.standard_error.is_none_or(|error| error > LOOSE * size) {
            found.push(
                Finding::new("identification_not_fixed", at)
                    .value(parameter.value, unit)
                    .with("name", parameter.name.clone())
                    .with("lower", parameter.lower)
                    .with("upper", parameter.upper),
            );
        }
    }
    for pair in outcome.correlations.iter().filter(|pair| pair.correlation.abs() > CORRELATED) {
        found.push(
            Finding::new("identification_correlated", format!("/unknowns/{}", pair.first))
                .measured(pair.correlation, CORRELATED, "1")
                .with("first", pair.first.clone())
                .with("second", pair.second.clone()),
        );
    }
    for row in &outcome.rows {
        let at = format!("/measurements/{}", row.row - 1);
        if row.residual.is_some_and(|residual| residual.abs() > HUBER) {
            found.push(
                Finding::new("identification_row_missed", at.clone())
                    .measured(row.simulated_um, row.measured_um.unwrap_or(0.0), "um")
                    .with("row", row.row)
                    .with("ratio", row.ratio.unwrap_or(1.0)),
            );
        }
        if row.simulated_error_um > TWO_MOTIONS * row.simulated_um {
            found.push(
                Finding::new("identification_two_motions", at)
                    .measured(row.simulated_error_um, TWO_MOTIONS * row.simulated_um, "um")
                    .with("row", row.row)
                    .with("simulated_um", row.simulated_um),
            );
        }
    }
    for onset in outcome.onsets.iter().filter(|onset| !onset.within) {
        let mut finding =
            Finding::new("identification_onset_missed", "/measurements").with("teeth", f64::from(onset.teeth));
        for (name, depth) in [
            ("stable_mm", onset.table_stable_mm),
            ("chatter_mm", onset.table_chatter_mm),
            ("predicted_mm", onset.predicted_mm),
        ] {
            if let Some(depth) = depth {
                finding = finding.with(name, depth);
            }
        }
        found.push(finding);
    }
    if let Some(second) = outcome.hypotheses.get(1).filter(|second| second.worse_by < DECISIVE) {
        found.push(
            Finding::new("identification_law_undecided", "/regenerations")
                .measured(second.worse_by, DECISIVE, "1")
                .with("first", law(outcome.regeneration.name(), outcome.amplitude.name()))
                .with("second", law(second.regeneration.name(), second.amplitude.name())),
        );
    }
    let mut speeds: Vec<u64> = outcome.rows.iter().map(|row| row.spindle_speed_rpm.to_bits()).collect();
    speeds.sort_unstable();
    speeds.dedup();
    let asks_frequency = problem.unknowns.iter().any(|unknown| {
        matches!(unknown.parameter, Parameter::NaturalFrequency | Parameter::Mass | Parameter::SpindleSpeed)
    });
    if speeds.len() == 1 && asks_frequency {
        found.push(Finding::new("identification_one_speed", "/measurements"));
    }
    if let Some(clamp) = outcome.clamp_force.as_ref().filter(|clamp| !clamp.consistent) {
        found.push(
            Finding::new("identification_clamp_contradicted", "/measurements")
                .measured(clamp.least_n, clamp.most_n.unwrap_or(clamp.least_n), "N")
                .with("best_n", clamp.best_n)
                .with("rows", numbers(&clamp.contradicted_rows)),
        );
    }
    if let Some(rows) = outcome.clamp_force.as_ref().and_then(|clamp| clamp.contradicted_by_stated.as_ref())
        && !rows.is_empty()
    {
        found.push(
            Finding::new("identification_clamp_contradicted", "/fixture/clamp_force_n")
                .value(problem.job.fixture.common().3.unwrap_or(0.0), "N")
                .with("rows", numbers(rows)),
        );
    }
    found
}

/// Row numbers as words: a list of them is read, not computed with.
fn numbers(rows: &[usize]) -> Vec<String> {
    rows.iter().map(ToString::to_string).collect()
}

fn law(regeneration: &str, amplitude: &str) -> String {
    format!("{regeneration}, {amplitude}")
}

pub(super) fn explanation(problem: &Problem<'_>, outcome: &IdentificationOutcome) -> Vec<Message> {
    let fit = &outcome.fit;
    let code = if problem.unknowns.is_empty() { "identification_predicts" } else { "identification_fits" };
    let mut said = vec![
        Message::new(code)
            .with("rows", fit.rows)
            // A factor of e^x is off by e^x - 1.
            .with("median_share", fit.median_log.exp_m1())
            .with("worst_share", fit.worst_log.exp_m1())
            .with("worst_row", fit.worst_row.unwrap_or(0)),
    ];
    if let Some(second) = outcome.hypotheses.get(1) {
        said.push(
            Message::new("identification_law_is")
                .with("regeneration", outcome.regeneration.name())
                .with("amplitude", outcome.amplitude.name())
                .with("objective", fit.objective)
                .with("other_regeneration", second.regeneration.name())
                .with("other_amplitude", second.amplitude.name())
                .with("other_objective", second.fit.objective),
        );
    }
    if let (Some(best), Some(least)) = (outcome.combinations.first(), outcome.combinations.last())
        && outcome.combinations.len() > 1
    {
        let (best, least) = (Words::of(outcome, best), Words::of(outcome, least));
        if let Some(sd) = best.standard_deviation {
            said.push(best.message("identification_known_best").with("share", sd));
        }
        let message = least.message("identification_known_least");
        said.push(match least.standard_deviation {
            Some(sd) => message.with("share", sd),
            None => message,
        });
    }
    if let Some(clamp) = outcome.clamp_force.as_ref().filter(|clamp| clamp.consistent) {
        said.push(match clamp.most_n {
            Some(most) => {
                Message::new("identification_clamp_between").with("least_n", clamp.least_n).with("most_n", most)
            }
            None => Message::new("identification_clamp_above").with("least_n", clamp.least_n),
        });
    }
    said.push(Message::new("identification_not_unique"));
    said
}

/// A combination of parameters as it is worded: a product of powers, and what is known of it.
#[derive(Default)]
struct Words {
    /// Parameters, with their powers.
    names: Vec<String>,
    powers: Vec<f64>,
    standard_deviation: Option<f64>,
}

impl Words {
    /// The largest powers, as many and with as many digits as it takes for the words to be known as well as what they stand
    /// for: a small power of a parameter that is hardly known is no small part of it.
    fn of(outcome: &IdentificationOutcome, combination: &Combination) -> Self {
        let powers = &combination.powers;
        let mut order: Vec<usize> = (0..powers.len()).collect();
        order.sort_by(|&a, &b| powers[b].abs().total_cmp(&powers[a].abs()));
        let least = order.iter().filter(|&&k| powers[k].abs() >= NAMED_POWER).count().max(1);
        let tries = DECIMALS.flat_map(|decimals| (least..=order.len()).map(move |count| (decimals, count)));
        let mut last = Self::default();
        for (decimals, count) in tries {
            last = Self::with(outcome, powers, &order[..count], decimals);
            let is_true = match (last.standard_deviation, combination.standard_deviation) {
                (Some(said), Some(meant)) => said <= TRUE_TO * meant,
                (said, meant) => said.is_none() && meant.is_none(),
            };
            if is_true {
                break;
            }
        }
        last
    }

    fn with(outcome: &IdentificationOutcome, powers: &[f64], named: &[usize], decimals: usize) -> Self {
        let scale = (0..decimals).fold(1.0, |scale, _| 10.0 * scale);
        let mut said = vec![0.0; powers.len()];
        let mut words = Self::default();
        for &k in named {
            let power = (powers[k] * scale).round() / scale;
            if power.abs() > 0.0 {
                said[k] = power;
                words.names.push(outcome.parameters[k].name.clone());
                words.powers.push(power);
            }
        }
        words.standard_deviation = standard_deviation(&outcome.combinations, &said);
        words
    }

    fn message(&self, code: &'static str) -> Message {
        Message::new(code).with("names", self.names.clone()).with("powers", self.powers.clone())
    }
}

/// Of a product of powers, from what is known of the combinations, which are independent of one another; `None` where the
/// table does not see it.
fn standard_deviation(combinations: &[Combination], powers: &[f64]) -> Option<f64> {
    let mut square = 0.0;
    for of in combinations {
        let share: f64 = of.powers.iter().zip(powers).map(|(a, b)| a * b).sum();
        match of.standard_deviation {
            Some(sd) => square += (share * sd).powi(2),
            None if share.abs() > SHARE => return None,
            None => {}
        }
    }
    Some(square.sqrt())
}
