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
    /// Share of what could be explained on data held back that was, where the gain was asked for and there is something to
    /// explain.
    pub explained_share: Option<f64>,
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
    /// Outside the catalogue: `unknown`.
    pub unknown: Share,
    /// 95 % intervals that hold the truth.
    pub coverage: Share,
    /// Explained shares of the answers that have one, of trials with causes of the catalogue.
    pub explained_shares: Vec<f64>,
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
        match truth.class {
            Class::Nothing => self.quiet.add(said.verdict == "adequate"),
            Class::Outside => self.unknown.add(said.verdict == "unknown"),
            Class::One => {
                self.first_right.add(same(&said.first));
                if said.verdict == "named" {
                    self.named_right.add(same(&said.named));
                }
            }
            Class::Two => {
                if said.verdict == "named" {
                    self.pair_right.add(same(&said.named));
                }
            }
        }
        if matches!(truth.class, Class::One | Class::Two) {
            match said.verdict.as_str() {
                "named" => self.truth_listed.add(same(&said.named)),
                "confounded" => self.truth_listed.add(said.likely.iter().any(|set| same(set))),
                _ => {}
            }
        }
        said.covered.iter().for_each(|held| self.coverage.add(*held));
        if matches!(truth.class, Class::One | Class::Two) {
            self.explained_shares.extend(said.explained_share);
        }
    }

    /// Median of the explained shares; `None` where there are none.
    pub fn explained_share(&self) -> Option<f64> {
        let mut shares = self.explained_shares.clone();
        shares.sort_by(f64::total_cmp);
        let (low, high) = (shares.get(shares.len().checked_sub(1)? / 2)?, shares.get(shares.len() / 2)?);
        Some(f64::midpoint(*low, *high))
    }
}

impl std::fmt::Display for Score {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        for (what, share) in [
            ("nothing hidden, no alarm", self.quiet),
            ("one cause, heaviest set right", self.first_right),
            ("one cause, of those named: right", self.named_right),
            ("one or two, truth in what was said", self.truth_listed),
            ("two causes, of those named: both right", self.pair_right),
            ("outside the catalogue, unknown", self.unknown),
            ("95 % intervals that hold the truth", self.coverage),
        ] {
            if share.of > 0 {
                writeln!(f, "{what:<42}{share}")?;
            }
        }
        if let Some(median) = self.explained_share() {
            let count = self.explained_shares.len();
            writeln!(f, "{:<42}{median:.3} (median of {count})", "explained on data held back")?;
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
