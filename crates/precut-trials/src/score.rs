//! Counts of right and wrong answers, with binomial intervals.

use std::collections::BTreeMap;

use statrs::distribution::{Beta, ContinuousCDF};

use crate::{Class, Truth};

/// What a diagnosis said of a trial.
#[derive(Debug, Clone, PartialEq)]
pub struct Said {
    /// `adequate`, `named`, `confounded`, `unknown`, `refused`.
    pub verdict: String,
    /// Kinds of the causes named; of `unknown` those said to act at least.
    pub named: Vec<String>,
    /// Kinds of every set in the list of a `confounded` answer.
    pub likely: Vec<Vec<String>>,
    /// Kinds of the heaviest set that is not empty.
    pub first: Vec<String>,
    /// Whether the 95 % intervals hold the hidden sizes, for those causes that are named and right.
    pub covered: Vec<bool>,
    /// The same of their other parameters.
    pub covered_shapes: Vec<bool>,
    /// What was explained on data held back, where the gain was asked for and there is something to explain.
    pub held_out: Option<HeldOut>,
    /// Of every hidden cause, how far it stands from what any other single cause could make of the rows, sigmas; empty
    /// where that was not looked at.
    pub separations: Vec<f64>,
    /// Of causes named in the place of others: how far what is hidden stands from what they could make of the rows, sigmas.
    pub named_instead: Option<f64>,
    /// Whether an observer finds the one cause who knows what every cause would look like; `None` where nobody was asked.
    pub ideal: Option<bool>,
    /// What the extended model explains of rows that were measured afterwards under other conditions, where there are such.
    pub later: Option<HeldOut>,
}

/// Mean squares on rows that no fit has seen, in squares of the scatter.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct HeldOut {
    /// What the base leaves less what the extended model leaves.
    pub explained: f64,
    /// What the base leaves less what no model can explain.
    pub explainable: f64,
}

/// How many of how many.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Share {
    /// Of those, how many.
    pub hits: usize,
    /// Out of how many.
    pub of: usize,
}

impl Share {
    /// Counts one more.
    pub fn add(&mut self, hit: bool) {
        self.hits += usize::from(hit);
        self.of += 1;
    }

    /// The share; 1 where there are none.
    pub fn share(self) -> f64 {
        if self.of == 0 { 1.0 } else { self.hits as f64 / self.of as f64 }
    }

    /// Whether the share reaches a goal within two binomial standard deviations of the goal.
    pub fn reaches(self, goal: f64) -> bool {
        self.of == 0 || self.share() >= goal - 2.0 * (goal * (1.0 - goal) / self.of as f64).sqrt()
    }
}

impl Share {
    /// 95 % interval of the share after Clopper and Pearson.
    pub fn interval_95(self) -> [f64; 2] {
        let quantile = |a: usize, b: usize, p: f64| {
            Beta::new(a as f64, b as f64).map_or(f64::NAN, |distribution| distribution.inverse_cdf(p))
        };
        let misses = self.of - self.hits;
        let lower = if self.hits == 0 { 0.0 } else { quantile(self.hits, misses + 1, 0.025) };
        let upper = if misses == 0 { 1.0 } else { quantile(self.hits + 1, misses, 0.975) };
        [lower, upper]
    }
}

impl std::fmt::Display for Share {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let [lower, upper] = self.interval_95();
        let percent = format!("{:.1} %, {:.1} to {:.1}", 100.0 * self.share(), 100.0 * lower, 100.0 * upper);
        write!(f, "{}/{} ({percent})", self.hits, self.of)
    }
}

/// Upper ends of the classes of separation, sigmas; the last has none.
const CLASSES: [f64; 3] = [3.0, 5.0, 8.0];
/// Separation from which on a cause is told apart.
const APART: f64 = 5.0;
/// Distance from which on rows object to a set that is named in the place of the truth, sigmas.
const OBJECTED: f64 = 4.0;
/// Separation from the whole catalogue from which on something that it lacks is told apart.
const APART_FROM_ALL: f64 = 6.0;

/// One cause, by how far it stands from the others.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
pub struct Apart {
    /// The heaviest set is it.
    pub first_right: Share,
    /// It is named, and rightly.
    pub named_right: Share,
    /// Something else is named.
    pub named_wrong: usize,
}

/// Counts over many trials of one calculator.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Score {
    /// Nothing hidden: no alarm.
    pub quiet: Share,
    /// One cause: the heaviest set is it.
    pub first_right: Share,
    /// One cause: of those named, the name is right.
    pub named_right: Share,
    /// One or two causes: of the answers `named` and `confounded`, the truth is in what was said.
    pub truth_listed: Share,
    /// Two causes: of those named, both names are right.
    pub pair_right: Share,
    /// One or two causes: of those named otherwise, the rows cannot tell what is named from what is hidden.
    pub alike: Share,
    /// Outside the catalogue: `unknown`.
    pub unknown: Share,
    /// 95 % intervals that hold the truth.
    pub coverage: Share,
    /// The same of the parameters beside the sizes.
    pub shape_coverage: Share,
    /// One cause, by separation: below 3, 5, 8 sigmas, and beyond.
    pub apart: [Apart; CLASSES.len() + 1],
    /// One cause: an observer finds it who knows what every cause would look like.
    pub ideal: Share,
    /// Two causes, each told apart from every other: the heaviest set is they.
    pub pair_apart: Share,
    /// Outside the catalogue, told apart from all of it: `unknown`.
    pub unknown_apart: Share,
    /// What was explained on data held back, of trials with causes of the catalogue; of those that are told apart where that
    /// was looked at.
    pub held_out: Vec<HeldOut>,
    /// What was explained of rows measured afterwards, of trials with causes of the catalogue that are told apart.
    pub later: Vec<HeldOut>,
    /// Sets in the lists of `confounded` answers.
    pub listed: Vec<usize>,
    /// One cause: the heaviest set is what the draw before hides, if that is another, as often as chance will have it.
    pub permuted: Share,
    /// What the draw before hides.
    before: Vec<String>,
    /// Verdict by hidden cause.
    pub confusion: BTreeMap<String, BTreeMap<String, usize>>,
}

impl Score {
    /// Adds an answer.
    pub fn add(&mut self, truth: &Truth, said: &Said) {
        let mut kinds: Vec<&str> = truth.causes.iter().map(|cause| cause.kind).collect();
        kinds.sort_unstable();
        let same = |set: &[String]| {
            let mut set: Vec<&str> = set.iter().map(String::as_str).collect();
            set.sort_unstable();
            set == kinds
        };
        let answer = match said.verdict.as_str() {
            "named" => said.named.join(" + "),
            other => other.to_owned(),
        };
        *self.confusion.entry(kinds.join(" + ")).or_default().entry(answer).or_default() += 1;
        let nearest = said.separations.iter().copied().reduce(f64::min);
        let told_apart = |from: f64| nearest.is_some_and(|sigmas| sigmas >= from);
        match truth.class {
            Class::Nothing => self.quiet.add(said.verdict == "adequate"),
            Class::Outside => {
                self.unknown.add(said.verdict == "unknown");
                if told_apart(APART_FROM_ALL) {
                    self.unknown_apart.add(said.verdict == "unknown");
                }
            }
            Class::One => {
                self.first_right.add(same(&said.first));
                let is_named = said.verdict == "named";
                if is_named {
                    self.named_right.add(same(&said.named));
                }
                if let Some(sigmas) = nearest {
                    let apart = &mut self.apart[CLASSES.iter().filter(|end| sigmas >= **end).count()];
                    apart.first_right.add(same(&said.first));
                    apart.named_right.add(is_named && same(&said.named));
                    apart.named_wrong += usize::from(is_named && !same(&said.named));
                }
                said.ideal.into_iter().for_each(|found| self.ideal.add(found));
            }
            Class::Two => {
                if told_apart(APART) {
                    self.pair_apart.add(same(&said.first));
                }
                if said.verdict == "named" {
                    self.pair_right.add(same(&said.named));
                }
            }
        }
        if matches!(truth.class, Class::One | Class::Two) {
            said.named_instead.into_iter().for_each(|sigmas| self.alike.add(sigmas < OBJECTED));
            match said.verdict.as_str() {
                "named" => self.truth_listed.add(same(&said.named)),
                "confounded" => self.truth_listed.add(said.likely.iter().any(|set| same(set))),
                _ => {}
            }
        }
        said.covered.iter().for_each(|held| self.coverage.add(*held));
        said.covered_shapes.iter().for_each(|held| self.shape_coverage.add(*held));
        if said.verdict == "confounded" {
            self.listed.push(said.likely.len());
        }
        if matches!(truth.class, Class::One | Class::Two) && nearest.is_none_or(|sigmas| sigmas >= APART) {
            self.held_out.extend(said.held_out);
            self.later.extend(said.later);
        }
        if truth.class == Class::One {
            let before = std::mem::replace(&mut self.before, kinds.iter().map(|kind| (*kind).to_owned()).collect());
            if !before.is_empty() && before != self.before {
                self.permuted.add(said.first == before);
            }
        }
    }

    /// Median number of sets in the lists of `confounded` answers.
    pub fn median_listed(&self) -> Option<f64> {
        median(self.listed.iter().map(|count| *count as f64).collect())
    }
}

/// Of what could be explained of rows that no fit has seen: median over the answers, and all of them together. `None` where
/// there are none.
pub fn explained(rows: &[HeldOut]) -> Option<[f64; 2]> {
    let shares = rows.iter().map(|one| one.explained / one.explainable);
    let sum = |of: fn(&HeldOut) -> f64| rows.iter().map(of).sum::<f64>();
    Some([median(shares.collect())?, sum(|one| one.explained) / sum(|one| one.explainable)])
}

fn median(mut values: Vec<f64>) -> Option<f64> {
    values.sort_by(f64::total_cmp);
    let (low, high) = (values.get(values.len().checked_sub(1)? / 2)?, values.get(values.len() / 2)?);
    Some(f64::midpoint(*low, *high))
}

impl std::fmt::Display for Score {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        for (what, share) in [
            ("nothing hidden, no alarm", self.quiet),
            ("one cause, heaviest set right", self.first_right),
            ("one cause, of those named: right", self.named_right),
            ("one or two, truth in what was said", self.truth_listed),
            ("two causes, of those named: both right", self.pair_right),
            ("two causes 5 sigmas apart, heaviest right", self.pair_apart),
            ("others named, below 4 sigmas from the truth", self.alike),
            ("outside the catalogue, unknown", self.unknown),
            ("... and 6 sigmas apart from all of it", self.unknown_apart),
            ("95 % intervals that hold the truth", self.coverage),
            ("... of shapes", self.shape_coverage),
            ("an observer who knows all signatures", self.ideal),
            ("heaviest set of the draw before", self.permuted),
        ] {
            if share.of > 0 {
                writeln!(f, "{what:<42}{share}")?;
            }
        }
        for (k, apart) in self.apart.iter().enumerate().filter(|(_, apart)| apart.first_right.of > 0) {
            let Apart { first_right, named_right, named_wrong } = apart;
            let what = match CLASSES.get(k) {
                Some(end) => format!("one cause, apart by less than {end} sigmas"),
                None => format!("one cause, apart by {} sigmas or more", CLASSES[k - 1]),
            };
            let named = format!("named right {}, wrong {named_wrong}", named_right.hits);
            writeln!(f, "{what:<42}heaviest right {first_right}, {named}")?;
        }
        if let Some(count) = self.median_listed() {
            writeln!(f, "{:<42}{count} (median of {})", "sets in a list", self.listed.len())?;
        }
        for (what, rows) in
            [("explained on data held back", &self.held_out), ("explained on rows measured later", &self.later)]
        {
            if let Some([median, pooled]) = explained(rows) {
                let count = rows.len();
                writeln!(f, "{what:<42}{median:.3} (median of {count}), {pooled:.3} (all together)")?;
            }
        }
        for (truth, answers) in &self.confusion {
            let answers: Vec<String> = answers.iter().map(|(answer, count)| format!("{answer} {count}")).collect();
            writeln!(f, "  {:<42}{}", if truth.is_empty() { "(nothing)" } else { truth }, answers.join(", "))?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn intervals_are_those_of_clopper_and_pearson() {
        // Closed forms where all or none hit: 1 - (0.025)^(1/n) from the end.
        let [lower, upper] = Share { hits: 20, of: 20 }.interval_95();
        assert!((lower - 0.025_f64.powf(0.05)).abs() < 1e-9 && upper >= 1.0, "{lower} {upper}");
        let [lower, upper] = Share { hits: 0, of: 20 }.interval_95();
        assert!(lower <= 0.0 && (upper - (1.0 - 0.025_f64.powf(0.05))).abs() < 1e-9, "{lower} {upper}");
        // The definition: so few hits or fewer have the probability of 2.5 % at the upper end.
        let [lower, upper] = Share { hits: 2, of: 10 }.interval_95();
        let at_most = |hits: usize, p: f64| -> f64 {
            let ways = [1.0, 10.0, 45.0];
            let of = |(k, ways): (i32, &f64)| ways * p.powi(k) * (1.0 - p).powi(10 - k);
            (0..).zip(&ways[..=hits]).map(of).sum()
        };
        assert!((at_most(2, upper) - 0.025).abs() < 1e-9, "{upper}");
        assert!((1.0 - at_most(1, lower) - 0.025).abs() < 1e-9, "{lower}");
    }
}
