//! Rows that are classes: what each model says of them, where the limits run, and how both fare on rows held back
//! (`diagnosis/3.11`).

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::calculator::{Diagnosable, Failure, Finding, LimitCurve, Monitor, Prediction};
use crate::diagnosis::answer::band::band;
use crate::diagnosis::base::Bound;
use crate::diagnosis::calculator::Measured;
use crate::diagnosis::causes::subject::{Belief, Setting};
use crate::diagnosis::model::gain::Gain;
use crate::diagnosis::rows::link;
use crate::diagnosis::verdict::weigh::Weighing;

/// Probability of a class below which a set does not explain it.
const AGAINST: f64 = 1e-3;
/// Leading sets that have to leave a class unexplained before its row is named.
const LEADING: usize = 4;
/// Resamples of folds.
const RESAMPLES: usize = 2000;

/// What each model says of rows that are classes: one entry for every margin that a row speaks about, in the order of `rows`.
#[derive(Debug, Clone, Default, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct ClassReport {
    /// The class seen.
    pub class: Vec<String>,
    /// The margin that this entry is about: `chatter` or `opening`; `frequency` of the frequency that was heard beside a class.
    pub margin: Vec<String>,
    /// Spindle speed.
    #[schema(extensions(("x-unit" = json!("rev/min"))))]
    pub spindle_speed_rpm: Vec<f64>,
    /// Depth of cut.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub depth_mm: Vec<f64>,
    /// Probability that the base gives to the side of the margin that was seen; absent where it has no margin, and of a frequency.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub probability_base: Vec<Option<f64>>,
    /// The same of the extended model: the base where nothing is named.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub probability_extended: Vec<Option<f64>>,
    /// Share of the entries on the side that the base predicts.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub share_right_base: f64,
    /// Of the extended model.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub share_right_extended: f64,
    /// On data held back, base against extended.
    pub held_out: Option<ClassHeldOut>,
    /// Depth at which chatter begins in the base, of every feed.
    #[schema(inline)]
    pub limits_base: Vec<LimitCurve>,
    /// The same in the extended model; none where nothing is named.
    #[schema(inline)]
    pub limits_extended: Vec<LimitCurve>,
    /// The same of the likely sets of causes together, by their probabilities, with its 95 % interval; none where nothing is wrong, or
    /// nobody knows what is.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    #[schema(inline)]
    pub limit_band: Vec<LimitCurve>,
}

/// Classes on data held back.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct ClassHeldOut {
    /// Parts of the data that were held back one after the other.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub folds: u32,
    /// Mean logarithm of the probability that the base gives to what was seen; of frequencies of their density, up to its constant.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub log_score_base: f64,
    /// Of the extended model, causes chosen and fitted anew without each part.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub log_score_extended: f64,
    /// 95 % interval of the extended score less that of the base.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub gain_interval_95: [f64; 2],
    /// Share of the entries on the side that the base predicts.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub share_right_base: f64,
    /// Of the extended model.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub share_right_extended: f64,
}

/// Nothing where the rows are values.
pub(in crate::diagnosis) fn report<M: Diagnosable>(
    bound: &Bound<'_, M>,
    weighing: &Weighing<'_>,
    measured: &Measured<M::Run, M::Point>,
    extended: Option<&[Prediction]>,
    settings: &[Setting],
    gain: Option<&Gain>,
    (seed, monitor): (u64, &dyn Monitor),
) -> Result<Option<ClassReport>, Failure> {
    let foundation = weighing.foundation;
    let Some(sides) = &foundation.data.sides else { return Ok(None) };
    let limits_with =
        |settings: &[Setting]| M::class_limits(bound.prepared(), &bound.acting(&Belief::of(settings))?, monitor);
    let Some(places) = limits_with(&[])? else { return Ok(None) };
    let limits_extended = match extended {
        Some(_) => limits_with(settings)?.map_or_else(Vec::new, |limits| limits.curves),
        None => Vec::new(),
    };
    let count = sides.len();
    let base: Vec<Option<f64>> =
        (0..count).map(|row| foundation.predicted[row].then_some(foundation.base[row])).collect();
    let with: Vec<Option<f64>> =
        extended.map_or_else(|| base.clone(), |with| with.iter().map(|margin| margin.ok()).collect());
    let probability = |margins: &[Option<f64>]| -> Vec<Option<f64>> {
        let of = |row: usize| {
            let margin = margins[row].filter(|_| !link::is_value(sides[row]));
            margin.map(|margin| link::log_probability(sides[row] * margin / weighing.scatter(row)).exp())
        };
        (0..count).map(of).collect()
    };
    let right = |margins: &[Option<f64>]| {
        let classes = (0..count).filter(|&row| !link::is_value(sides[row]));
        let answered: Vec<bool> = classes.filter_map(|row| margins[row].map(|m| m * sides[row] > 0.0)).collect();
        answered.iter().filter(|right| **right).count() as f64 / answered.len().max(1) as f64
    };
    Ok(Some(ClassReport {
        class: measured.seen.iter().map(|seen| seen.class.to_owned()).collect(),
        margin: measured.seen.iter().map(|seen| seen.asks.to_owned()).collect(),
        spindle_speed_rpm: places.spindle_speed_rpm,
        depth_mm: places.depth_mm,
        probability_base: probability(&base),
        probability_extended: probability(&with),
        share_right_base: right(&base),
        share_right_extended: right(&with),
        held_out: gain.map(|gain| held_out(weighing, sides, gain, seed)),
        limits_base: places.curves,
        limits_extended,
        limit_band: band(bound, weighing, monitor)?,
    }))
}

/// From what every held-back row left: minus the margin, as the boundary stands for its value.
fn held_out(weighing: &Weighing<'_>, sides: &[f64], gain: &Gain, seed: u64) -> ClassHeldOut {
    let fold = &weighing.foundation.data.layout.design.fold;
    let folds: Vec<usize> = (0..fold.iter().copied().max().map_or(0, |most| most + 1))
        .filter(|f| fold.iter().zip(&weighing.keep).any(|(of, keep)| of == f && *keep))
        .collect();
    let score = |row: usize, left: f64| -0.5 * weighing.loss(row, left);
    // Of every fold: scores of base and extended, and its rows.
    let sums: Vec<[f64; 3]> = folds
        .iter()
        .map(|f| {
            (0..fold.len()).filter(|&row| fold[row] == *f && weighing.keep[row]).fold([0.0; 3], |sum, row| {
                let (base, extended) = gain.errors[row];
                [sum[0] + score(row, base), sum[1] + score(row, extended), sum[2] + 1.0]
            })
        })
        .collect();
    let mean = |chosen: &mut dyn Iterator<Item = usize>| -> [f64; 2] {
        let sum = chosen.fold([0.0; 3], |sum, f| [0, 1, 2].map(|k: usize| sum[k] + sums[f][k]));
        [sum[0] / sum[2], sum[1] / sum[2]]
    };
    let [base, extended] = mean(&mut (0..sums.len()));
    let mut random = Pcg64::seed_from_u64(seed);
    let mut gains: Vec<f64> = (0..RESAMPLES)
        .map(|_| {
            let [base, extended] = mean(&mut (0..sums.len()).map(|_| random.random_range(0..sums.len())));
            extended - base
        })
        .collect();
    gains.sort_by(f64::total_cmp);
    let right = |of: &dyn Fn(&(f64, f64)) -> f64| {
        let counts = |row: &usize| weighing.keep[*row] && !link::is_value(sides[*row]);
        let kept: Vec<usize> = (0..sides.len()).filter(counts).collect();
        let hits = kept.iter().filter(|&&row| of(&gain.errors[row]) * sides[row] < 0.0).count();
        hits as f64 / kept.len().max(1) as f64
    };
    ClassHeldOut {
        folds: u32::try_from(gain.folds).unwrap_or(u32::MAX),
        log_score_base: base,
        log_score_extended: extended,
        gain_interval_95: [gains[RESAMPLES / 40], gains[RESAMPLES - 1 - RESAMPLES / 40]],
        share_right_base: right(&|left| left.0),
        share_right_extended: right(&|left| left.1),
    }
}

/// What is odd about classes: all of one, or some that no model explains.
pub(in crate::diagnosis) fn warnings(weighing: &Weighing<'_>, used: &[usize]) -> Vec<Finding> {
    let foundation = weighing.foundation;
    let Some(sides) = &foundation.data.sides else { return Vec::new() };
    let counts = |row: &usize| weighing.keep[*row] && !link::is_value(sides[*row]);
    let kept: Vec<usize> = (0..sides.len()).filter(counts).collect();
    let mut found = Vec::new();
    if kept.windows(2).all(|pair| sides[pair[0]] * sides[pair[1]] > 0.0) {
        found.push(Finding::new("one_class", "/measurements").with("count", kept.len()));
    }
    let mut margins: Vec<Vec<Option<f64>>> =
        vec![foundation.base.iter().zip(&foundation.predicted).map(|(m, ok)| ok.then_some(*m)).collect()];
    for set in weighing.named_sets().take(LEADING) {
        if let Ok(with) = foundation.subject.predict(&set.settings) {
            margins.push(with.into_iter().map(Result::ok).collect());
        }
    }
    let unlikely =
        |row: usize, margin: f64| link::log_probability(sides[row] * margin / weighing.scatter(row)) < AGAINST.ln();
    let mut rows: Vec<usize> = kept
        .into_iter()
        .filter(|&row| margins.iter().all(|of| of[row].is_some_and(|margin| unlikely(row, margin))))
        .map(|row| used[row] + 1)
        .collect();
    rows.dedup();
    if let Some(first) = rows.first() {
        let finding = Finding::new("classes_against_all", format!("/measurements/{}", first - 1));
        found.push(finding.with("count", rows.len()).with("rows", rows));
    }
    found
}
