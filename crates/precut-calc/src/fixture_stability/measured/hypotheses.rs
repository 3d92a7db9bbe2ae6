//! The causes of the catalogue as they stand for a vise and what was measured on it.

use crate::calculator::{
    Condition, Design, Expansions, Failure, Grouping, Hypotheses, Hypothesis, Inapplicability, Inapplicable, Monitor,
    Range, Shape, Smooth, Treatment, Variable, values_by_name,
};
use crate::effects::{Cause, FIXTURE_CAUSES, FixtureEffect, Parameter};
use crate::fixture_stability::answer::study::forced_span_mm;
use crate::fixture_stability::measured::forward::Measure;
use crate::fixture_stability::measured::margins::or_missing;
use crate::fixture_stability::measured::predict::{PreparedFixture, PreparedRow};

/// Largest sum of an exponent of the job and what is added to it: a force that hardly depends on the chip any more.
const LARGEST_EXPONENT: f64 = 0.95;
/// Largest share of the feed by which a tooth may stand out: beyond it the next one does not cut.
const RUNOUT_SHARE: f64 = 0.9;
/// A mass below this is none, kg.
const NO_MASS_KG: f64 = 1e-4;
/// Sizes about which a runout is linearised, prior standard deviations.
pub(crate) const RUNOUTS: [f64; 4] = [0.25, 0.5, 1.0, 2.0];
/// Prior standard deviation of a mass that swings on the workpiece, as a share of the workpiece's.
const HUNG_SHARE: f64 = 0.1;
/// Sizes about which what shifts a resonance is linearised, prior standard deviations: one of a tenth in frequency moves it by
/// its own width, and a straight line through none of it ends long before.
pub(crate) const SHIFTS: [f64; 3] = [0.5, 1.0, 1.5];
/// The same of joints that harden: near the onset of chatter a little of it does as much as much of it does elsewhere.
const HARDENINGS: [f64; 4] = [0.1, 0.3, 1.0, 3.0];
/// Prior standard deviation of what hardening adds to the stiffness at the swings of the rows: that of the stiffness itself.
/// Its constant says nothing without them: a vise that swings by a tenth of a millimetre feels a hundredth of the constant
/// that one of a hundredth does.
const HARDENED_SHARE: f64 = 0.2;
/// Sizes about which a mass that swings is linearised, prior standard deviations: a resonance splits in two by the root of the ratio of the
/// masses, which is more than its width from a hundredth of the workpiece on.
const HUNG_EXPANSIONS: [f64; 2] = [0.1, 0.4];
/// Its frequencies, as shares of those of the vise: from below the lowest to where it is but one more mass.
const HUNG_FREQUENCIES: (f64, f64) = (0.7, 2.2);
/// From one frequency to the next: the width of a resonance of 5 % damping.
const HUNG_STEP: f64 = 1.1;
/// Most frequencies, where the vise has two modes far apart.
const MOST_FREQUENCIES: usize = 24;
/// Prior of the frequency's logarithm about 1.2 times the middle of the vise's, of the damping ratio's about 0.03.
const HUNG_FREQUENCY_SD: f64 = 0.35;
const HUNG_DAMPING: Shape = Shape { mean: -3.506_557_897_319_982, sd: 0.4, logarithmic: true };

/// What decides which causes rows can speak about.
pub(in crate::fixture_stability) struct Experiment<'a> {
    pub(in crate::fixture_stability) prepared: &'a PreparedFixture,
    pub(in crate::fixture_stability) monitor: &'a dyn Monitor,
}

impl Experiment<'_> {
    /// The catalogue, sorted by whether these rows can speak about a cause.
    pub(in crate::fixture_stability) fn hypotheses(&self) -> Result<Hypotheses, Failure> {
        let mut sorted = Hypotheses::default();
        for cause in FIXTURE_CAUSES {
            match self.inapplicability(cause) {
                Some(reason) => sorted.inapplicable.push(Inapplicable { cause, reason }),
                None => sorted.applicable.push(self.hypothesis(cause)?),
            }
        }
        Ok(sorted)
    }

    fn inapplicability(&self, cause: &'static Cause) -> Option<Inapplicability> {
        let PreparedFixture { base, rows, measure, .. } = self.prepared;
        let nothing = |acts: bool| (!acts).then_some(Inapplicability::NothingToActOn);
        match cause.kind {
            // At one depth it is a force level.
            "depth_exponent" if *measure != Measure::DepthLimit && !varies(rows, |row| row.working.depth_mm) => {
                Some(Inapplicability::ConditionConstant("depth_mm"))
            }
            "tooth_runout" => nothing(base.cutting.teeth > 1),
            "jaw_mass" => nothing(base.holding.jaw.is_some()),
            // Stable amplitudes and limits are those of closed joints: a history shows one that opens, and a class.
            "preload_loss"
                if !matches!(measure, Measure::Displacement | Measure::Regime)
                    || base.holding.clamp_force_n.is_none() =>
            {
                nothing(false)
            }
            "preload_loss" if rows.iter().any(|row| row.time_since_clamping_min.is_none()) => {
                Some(Inapplicability::ConditionAbsent("time_since_clamping_min"))
            }
            _ => None,
        }
    }

    fn hypothesis(&self, cause: &'static Cause) -> Result<Hypothesis, Failure> {
        let variables: Result<_, Failure> = cause.parameters.iter().map(|p| self.variable(cause, p)).collect();
        let variables = variables?;
        Ok(Hypothesis { cause, label: String::new(), variables, prior_weight: 1.0, held: None })
    }

    fn variable(&self, cause: &Cause, parameter: &Parameter) -> Result<Variable, Failure> {
        let cutting = &self.prepared.base.cutting;
        let (mut lower, mut upper) = (parameter.lower, parameter.upper);
        match cause.kind {
            "chip_thickness_exponent" => {
                lower = lower.max(-cutting.chip_exponent);
                upper = upper.min(LARGEST_EXPONENT - cutting.chip_exponent);
            }
            "depth_exponent" => {
                lower = lower.max(-cutting.depth_exponent);
                upper = upper.min(LARGEST_EXPONENT - cutting.depth_exponent);
            }
            "tooth_runout" => {
                let feeds = self.prepared.rows.iter().map(|row| row.working.feed_mm);
                upper = feeds.fold(upper, |least, feed| least.min(RUNOUT_SHARE * feed));
                lower = -upper;
            }
            _ => {}
        }
        match cause.kind {
            "second_mode" => return Ok(self.hung(parameter, Range { lower, upper })),
            "contact_hardening" => return self.hardening(parameter, Range { lower, upper }),
            _ => {}
        }
        Ok(Variable::of(parameter, Range { lower, upper }))
    }
}

impl Experiment<'_> {
    /// Hardening in the measure of the swings at which it is to be seen; in that of the catalogue where the base has none.
    fn hardening(&self, parameter: &Parameter, range: Range) -> Result<Variable, Failure> {
        let PreparedFixture { base, rows, .. } = self.prepared;
        let (mut sum, mut count) = (0.0, 0.0);
        for row in rows {
            if let Ok(span_mm) = or_missing(forced_span_mm(base, row.working, self.monitor))? {
                sum += (0.5 * span_mm) * (0.5 * span_mm);
                count += 1.0;
            }
        }
        let prior_sd = if sum > 0.0 { HARDENED_SHARE * count / sum } else { parameter.prior_sd };
        let treatment = Treatment::Amplitude { prior_sd: prior_sd.min(range.upper) };
        Ok(Variable { name: parameter.name, unit: parameter.unit, treatment, range })
    }

    /// What swings on the workpiece, in the measures of workpiece and vise: beside a resonance it shows only near its own
    /// frequency, so a grid that does not follow the vise passes it by.
    fn hung(&self, parameter: &Parameter, range: Range) -> Variable {
        let holding = &self.prepared.base.holding;
        let modes = holding.modes();
        let (lowest, highest) = modes
            .iter()
            .fold((f64::INFINITY, 0.0_f64), |(low, high), mode| (low.min(mode.natural_hz), high.max(mode.natural_hz)));
        let treatment = match parameter.name {
            "mass_kg" => Treatment::Amplitude { prior_sd: HUNG_SHARE * holding.mass_kg },
            "frequency_hz" => {
                let (from, to) = (HUNG_FREQUENCIES.0 * lowest, HUNG_FREQUENCIES.1 * highest);
                let steps = std::iter::successors(Some(from), |hz| Some(hz * HUNG_STEP));
                let prior =
                    Shape { mean: (1.2 * (lowest * highest).sqrt()).ln(), sd: HUNG_FREQUENCY_SD, logarithmic: true };
                let grid = steps.take_while(|hz| *hz <= to).take(MOST_FREQUENCIES).collect();
                Treatment::Shape { grid, prior: Some(prior) }
            }
            _ => Treatment::Shape { grid: vec![HUNG_DAMPING.mean.exp()], prior: Some(HUNG_DAMPING) },
        };
        // The catalogue's least mass keeps an effect of a job finite; here none is none.
        let lower = if parameter.name == "mass_kg" { 0.0 } else { range.lower };
        Variable { name: parameter.name, unit: parameter.unit, treatment, range: Range { lower, ..range } }
    }
}

fn varies(rows: &[PreparedRow], of: impl Fn(&PreparedRow) -> f64) -> bool {
    let first = rows.first().map_or(0.0, &of);
    rows.iter().any(|row| (of(row) - first).abs() > 1e-9 * first.abs())
}

/// The effects that a hypothesis stands for at these values of its variables.
pub(in crate::fixture_stability) fn effects(hypothesis: &Hypothesis, values: &[f64]) -> Option<Vec<FixtureEffect>> {
    let cause = hypothesis.cause;
    let effect = match (cause.kind, values) {
        ("second_mode", &[mass_kg, ..]) if mass_kg < NO_MASS_KG => return Some(Vec::new()),
        ("stiffness" | "damping" | "mass" | "force_coefficient" | "jaw_mass", &[ln_factor]) => {
            FixtureEffect::from_parameters(cause, &[ln_factor.exp()])?
        }
        _ => FixtureEffect::from_parameters(cause, values)?,
    };
    Some(vec![effect])
}

/// The values of a hypothesis' variables at which it is this effect.
pub(in crate::fixture_stability) fn values(hypothesis: &Hypothesis, effect: &FixtureEffect) -> Option<Vec<f64>> {
    match *effect {
        FixtureEffect::Stiffness { factor }
        | FixtureEffect::Damping { factor }
        | FixtureEffect::Mass { factor }
        | FixtureEffect::ForceCoefficient { factor }
        | FixtureEffect::JawMass { factor } => (hypothesis.cause.kind == effect.kind()).then(|| vec![factor.ln()]),
        _ => values_by_name(hypothesis, effect),
    }
}

/// Sizes about which a hypothesis is linearised beside 0: the amplitude of a cutter grows with a tooth that stands out to
/// either side, so that a straight line through none of it shows nothing; a mass that swings splits a resonance; and what
/// shifts one, or makes joints stiffer where they move most, does not do so in a straight line.
pub(in crate::fixture_stability) fn expansions(hypothesis: &Hypothesis) -> Expansions {
    match (hypothesis.cause.kind, hypothesis.variables.as_slice()) {
        ("tooth_runout", [runout]) => Expansions::either_way(runout, &RUNOUTS),
        ("stiffness" | "mass" | "jaw_mass", [factor]) => Expansions::either_way(factor, &SHIFTS),
        ("contact_hardening", [Variable { treatment: Treatment::Amplitude { prior_sd }, range, .. }]) => {
            Expansions::along(HARDENINGS.iter().map(|share| share * prior_sd).filter(|size| *size <= range.upper))
        }
        ("second_mode", [Variable { treatment: Treatment::Amplitude { prior_sd }, .. }, ..]) => {
            Expansions::along(HUNG_EXPANSIONS.iter().map(|share| share * prior_sd))
        }
        _ => Expansions::default(),
    }
}

/// Rows of one working point are repeats; rows of one speed are held back together. Of histories, rows of one run are.
pub(in crate::fixture_stability) fn design(prepared: &PreparedFixture) -> Design {
    let rows = &prepared.rows;
    let numbered = |key: &dyn Fn(&PreparedRow) -> [u64; 5]| Design::numbered(&rows.iter().map(key).collect::<Vec<_>>());
    let speed = |row: &PreparedRow| row.working.spindle_rpm.to_bits();
    let depth = |row: &PreparedRow| row.working.depth_mm.to_bits();
    if prepared.measure == Measure::Displacement {
        let longest = rows.iter().map(|row| row.time_s).fold(f64::MIN_POSITIVE, f64::max);
        return Design {
            smooth: Smooth::Along(rows.iter().map(|row| row.time_s / longest).collect()),
            cell: numbered(&|row| [row.run as u64, depth(row), row.time_s.to_bits(), 0, 0]),
            regressors: Vec::new(),
            groupings: Vec::new(),
            conditions: Vec::new(),
            order: None,
            fold: numbered(&|row| [row.run as u64, 0, 0, 0, 0]),
        };
    }
    // The depth of a limit is what was measured, not where.
    let limit = prepared.measure == Measure::DepthLimit;
    let at_depth = |row: &PreparedRow| if limit { 0 } else { depth(row) };
    let cell = numbered(&|row| {
        let (speed, feed, clamped) = row.regime();
        [speed, feed, clamped, at_depth(row), row.margin as u64]
    });
    let per_speed = numbered(&|row| [speed(row), 0, 0, 0, 0]);
    let grouping =
        |name, conditions: Vec<&'static str>, group: Vec<usize>| Grouping { name, over: Vec::new(), conditions, group };
    let mut groupings = vec![grouping("per_speed", vec!["speed"], per_speed.clone())];
    if !limit {
        let per_depth = numbered(&|row| [depth(row), 0, 0, 0, 0]);
        let per_point = numbered(&|row| [speed(row), depth(row), 0, 0, 0]);
        // Where feeds or times since clamping differ, too, a cell is no place of speed and depth.
        let of_cell = if per_point == cell { vec!["speed", "depth"] } else { Vec::new() };
        groupings.push(grouping("per_depth", vec!["depth"], per_depth));
        groupings.push(grouping("per_cell", of_cell, cell.clone()));
    }
    let ln = |name, of: &dyn Fn(&PreparedRow) -> f64| {
        Condition::of(name, &rows.iter().map(|row| of(row).max(f64::MIN_POSITIVE).ln()).collect::<Vec<_>>())
    };
    let conditions = [
        ln("speed", &|row| row.working.spindle_rpm),
        ln("feed", &|row| row.working.feed_mm),
        ln("depth", &|row| row.working.depth_mm).filter(|_| !limit),
    ];
    let conditions = conditions.into_iter().flatten().collect();
    let regressors = regressors(rows, &per_speed, &cell, limit);
    Design { smooth: Smooth::None, cell, regressors, groupings, conditions, order: None, fold: per_speed }
}

/// Columns for the scatter without repeats: a level per speed where there are cells enough, for resonances are sharper than
/// any parabola, and the logarithms of depth and feed with their squares.
fn regressors(rows: &[PreparedRow], per_speed: &[usize], cell: &[usize], limit: bool) -> Vec<Vec<f64>> {
    let count = |of: &[usize]| of.iter().copied().max().map_or(0, |most| most + 1);
    let (speeds, cells) = (count(per_speed), count(cell));
    let ln = |of: &dyn Fn(&PreparedRow) -> f64| -> Vec<f64> {
        let values: Vec<f64> = rows.iter().map(|row| of(row).max(f64::MIN_POSITIVE).ln()).collect();
        let mean = values.iter().sum::<f64>() / values.len().max(1) as f64;
        values.into_iter().map(|value| value - mean).collect()
    };
    let mut columns: Vec<Vec<f64>> = Vec::new();
    if cells >= 2 * (speeds + 4) {
        columns.extend((0..speeds).map(|s| per_speed.iter().map(|&of| f64::from(u8::from(of == s))).collect()));
    } else {
        let speed = ln(&|row| row.working.spindle_rpm);
        let square = speed.iter().map(|v| v * v).collect();
        columns.extend([vec![1.0; rows.len()], speed, square]);
    }
    let mut conditions = vec![ln(&|row| row.working.feed_mm)];
    if !limit {
        conditions.push(ln(&|row| row.working.depth_mm));
    }
    for column in conditions {
        if column.iter().any(|value| value.abs() > 1e-9) {
            columns.push(column.iter().map(|v| v * v).collect());
            columns.push(column);
        }
    }
    columns
}
