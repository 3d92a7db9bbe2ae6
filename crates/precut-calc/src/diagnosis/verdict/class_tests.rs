//! Tests of the base, and of sets of causes, on classes: against classes that are drawn from them (`diagnosis/3.11`).

use rand::{RngExt, SeedableRng};
use rand_pcg::Pcg64;
use statrs::distribution::{ContinuousCDF, Normal};

use crate::calculator::{Failure, Monitor, checkpoint};
use crate::diagnosis::rows::link;
use crate::diagnosis::rows::sparse::Sparse;
use crate::diagnosis::statistics::values_beside::members;
use crate::diagnosis::verdict::adequacy::{Test, TestKind, test};
use crate::diagnosis::verdict::weigh::Weighing;

/// Draws behind a p-value: it is known to a hundredth where it is 0.1.
const DRAWS: usize = 2000;
/// Groups of a grouping that is tested have so many classes each, on average, at least: a class alone is never odd.
const LEAST_CLASSES: usize = 2;
/// How far the rows of a group may be off together, either way, and in which steps: standard deviations of their scatter. The
/// likelihood of two rows and more changes little over half a step.
const FARTHEST: usize = 16;
const STEP: f64 = 1.0;

/// D = -2 sum of ln F(s m/sigma) of the base's margins, and of every grouping the sum of what one level for each group takes off D. Neither
/// has a chi-squared distribution for single classes, so both are drawn: allowances from their prior, classes from the margins under them.
/// Values beside them are drawn about the base.
///
/// What a catalogue lacks is most often off at one speed, or at one depth: of many rows D then rises by little more than its own scatter,
/// the gain of levels by many times theirs.
pub(super) fn of_classes(weighing: &Weighing<'_>, sides: &[f64], monitor: &dyn Monitor) -> Result<Vec<Test>, Failure> {
    let margin = |row: usize| weighing.foundation.base[row] / weighing.scatter(row);
    let margins = (0..weighing.keep.len()).filter(|&row| weighing.keep[row]).map(margin).collect();
    tests(&Foreseen::new(weighing, margins, sides), &weighing.foundation.nuisances, monitor)
}

/// Probability that classes drawn from these margins are as odd as those seen, or odder, by the test that finds them oddest; doubled
/// where both are made, so that it is below a level by chance no more often than that (Bonferroni). The margins were fitted to the
/// classes seen, those that are drawn are not fitted again: what fits is objected to less often than the level says.
pub(in crate::diagnosis) fn fit_of_classes(
    weighing: &Weighing<'_>,
    margins: Vec<f64>,
    sides: &[f64],
    monitor: &dyn Monitor,
) -> Result<Option<f64>, Failure> {
    let tests = tests(&Foreseen::new(weighing, margins, sides), &weighing.foundation.nuisances, monitor)?;
    let least = tests.iter().map(|test| test.p).min_by(f64::total_cmp);
    Ok(least.map(|p| (tests.len() as f64 * p).min(1.0)))
}

fn tests(foreseen: &Foreseen<'_>, nuisances: &[Sparse], monitor: &dyn Monitor) -> Result<Vec<Test>, Failure> {
    let found = foreseen.statistics(&foreseen.log_likelihoods());
    let mut random = Pcg64::seed_from_u64(1);
    let nuisances: Vec<Vec<f64>> = nuisances.iter().map(Sparse::dense).collect();
    let mut larger = vec![0.0; found.len()];
    for _ in 0..DRAWS {
        checkpoint(monitor)?;
        let drawn = foreseen.statistics(&foreseen.drawn(&nuisances, &mut random));
        for (larger, (drawn, found)) in larger.iter_mut().zip(drawn.iter().zip(&found)) {
            *larger += f64::from(u8::from(drawn >= found));
        }
    }
    // Counted with the rows themselves, so that it is never 0.
    let probability = |larger: f64| (larger + 1.0) / (DRAWS as f64 + 1.0);
    let rows = (foreseen.rows.len() as f64, None);
    let deviance = test(TestKind::Deviance, found[0], rows, probability(larger[0]));
    // Of several groupings the one that is oddest, as many times as likely as there are (Bonferroni).
    let groupings = foreseen.groupings.len();
    let oddest = (1..=groupings).min_by(|a, b| larger[*a].total_cmp(&larger[*b]));
    let levels = oddest.and_then(|k| {
        let groups = (foreseen.groupings[k - 1].len() as f64, None);
        test(TestKind::Levels, found[k], groups, (groupings as f64 * probability(larger[k])).min(1.0))
    });
    Ok(deviance.into_iter().chain(levels).collect())
}

/// Rows that count, as the base or a set foresees them.
struct Foreseen<'a> {
    rows: Vec<usize>,
    sides: &'a [f64],
    /// Margins in standard deviations of their scatter, and that scatter.
    margin: Vec<f64>,
    scatter: Vec<f64>,
    is_value: Vec<bool>,
    /// Of every grouping its groups of more than one row: places in `rows`.
    groupings: Vec<Vec<Vec<usize>>>,
    /// Log-likelihood of the quiet and of the other class of every row at every level.
    classes: Vec<[Vec<f64>; 2]>,
}

/// Log-likelihood of a row at every level; the one in the middle is that of what is foreseen.
type OfLevels = Vec<f64>;

impl<'a> Foreseen<'a> {
    fn new(weighing: &Weighing<'_>, margin: Vec<f64>, sides: &'a [f64]) -> Self {
        let rows: Vec<usize> = (0..weighing.keep.len()).filter(|&row| weighing.keep[row]).collect();
        let scatter: Vec<f64> = rows.iter().map(|&row| weighing.scatter(row)).collect();
        let is_value: Vec<bool> = rows.iter().map(|&row| link::is_value(sides[row])).collect();
        let groupings = weighing.foundation.data.layout.design.groupings.iter();
        let groupings = groupings.filter_map(|grouping| groups(&grouping.group, &rows, &is_value)).collect();
        let classes = margin.iter().map(|margin| [1.0, -1.0].map(|side| of_levels(side, *margin))).collect();
        Self { rows, sides, margin, scatter, is_value, groupings, classes }
    }

    /// Of the rows as they are, in the order of `rows`; a value is where it was measured.
    fn log_likelihoods(&self) -> Vec<OfLevels> {
        let side = |row: usize| self.sides[self.rows[row]];
        let of =
            |row: usize| if self.is_value[row] { of_levels(0.0, self.margin[row]) } else { self.class(row, side(row)) };
        (0..self.rows.len()).map(of).collect()
    }

    fn class(&self, row: usize, side: f64) -> OfLevels {
        let [quiet, other] = &self.classes[row];
        if side > 0.0 { quiet.clone() } else { other.clone() }
    }

    /// The same of rows that are drawn.
    fn drawn(&self, nuisances: &[Vec<f64>], random: &mut Pcg64) -> Vec<OfLevels> {
        let normal = Normal::standard();
        let scatter = |random: &mut Pcg64| normal.inverse_cdf(random.random::<f64>().clamp(1e-12, 1.0 - 1e-12));
        let sizes: Vec<f64> = nuisances.iter().map(|_| scatter(random)).collect();
        let of = |row: usize| {
            let moved = |(size, column): (&f64, &Vec<f64>)| size * column[self.rows[row]];
            let moved: f64 = sizes.iter().zip(nuisances).map(moved).sum::<f64>() / self.scatter[row];
            if self.is_value[row] {
                let off = scatter(random) - moved;
                return of_levels(0.0, link::drawn_value(off, random.random()));
            }
            let quiet = link::log_probability(self.margin[row] + moved).exp();
            self.class(row, if random.random::<f64>() < quiet { 1.0 } else { -1.0 })
        };
        (0..self.rows.len()).map(of).collect()
    }

    /// The deviance, then of every grouping what levels take off it.
    fn statistics(&self, rows: &[OfLevels]) -> Vec<f64> {
        let deviance = -2.0 * rows.iter().map(|row| row[FARTHEST]).sum::<f64>();
        let gain = |group: &Vec<usize>| {
            let at = |level: usize| group.iter().map(|&row| rows[row][level]).sum::<f64>();
            let most = (0..=2 * FARTHEST).map(at).fold(f64::NEG_INFINITY, f64::max);
            2.0 * (most - at(FARTHEST))
        };
        let gains = self.groupings.iter().map(|groups| groups.iter().map(gain).sum());
        std::iter::once(deviance).chain(gains).collect()
    }
}

/// Groups of more than one row, classes and values apart, by their places among the rows that count; `None` where most are alone.
fn groups(group: &[usize], rows: &[usize], is_value: &[bool]) -> Option<Vec<Vec<usize>>> {
    let own: Vec<usize> = (0..rows.len()).map(|place| 2 * group[rows[place]] + usize::from(is_value[place])).collect();
    let groups: Vec<Vec<usize>> = members(&own).into_iter().filter(|group| !group.is_empty()).collect();
    let of_classes: Vec<&Vec<usize>> = groups.iter().filter(|group| !is_value[group[0]]).collect();
    let classes: usize = of_classes.iter().map(|group| group.len()).sum();
    let are_tested = of_classes.len() > 1 && classes >= LEAST_CLASSES * of_classes.len();
    are_tested.then(|| groups.into_iter().filter(|group| group.len() > 1).collect())
}

fn of_levels(side: f64, margin: f64) -> OfLevels {
    let moved = |k: usize| margin + STEP * (k as f64 - FARTHEST as f64);
    (0..=2 * FARTHEST).map(|k| link::log_likelihood(side, moved(k))).collect()
}
