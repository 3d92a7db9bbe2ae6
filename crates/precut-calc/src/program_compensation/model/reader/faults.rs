//! What is wrong with a program, and what is to be said of it: places with codes.

use std::collections::{BTreeMap, BTreeSet};

use crate::calculator::Finding;

/// Where the program stands in the job.
const PROGRAM: &str = "/nc_program";

/// So many faults are listed, and so many warnings of one code.
const MOST_LISTED: usize = 100;
/// Most characters of a word that are shown.
const LONGEST_WORD: usize = 60;

/// A place in the program: a line and a column, from 1, the column in characters of the line, and the word that stands there.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) struct Spot<'a> {
    /// Line.
    pub(crate) line: usize,
    /// Column.
    pub(crate) column: usize,
    /// What stands there.
    pub(crate) word: &'a str,
}

impl Spot<'_> {
    /// A code about this place.
    pub(crate) fn finding(&self, code: &'static str) -> Finding {
        let word: String = self.word.chars().take(LONGEST_WORD).collect();
        Finding::new(code, PROGRAM).with("line", self.line).with("column", self.column).with("word", word)
    }
}

/// Faults and warnings, gathered.
#[derive(Debug, Default)]
pub(super) struct Notes {
    /// By line, column and code: a contour that is run twice is not blamed twice.
    faults: BTreeMap<(usize, usize, &'static str), Finding>,
    unlisted: usize,
    warnings: Vec<Finding>,
    /// Where something was said, by its code.
    warned: BTreeMap<&'static str, BTreeSet<(usize, usize)>>,
    assumed: BTreeSet<&'static str>,
}

impl Notes {
    /// Adds a fault.
    pub(super) fn fault(&mut self, spot: Spot<'_>, code: &'static str) {
        self.fault_with(spot, code, |finding| finding);
    }

    /// Adds a fault with more to be said.
    pub(super) fn fault_with(&mut self, spot: Spot<'_>, code: &'static str, and: impl FnOnce(Finding) -> Finding) {
        let key = (spot.line, spot.column, code);
        if self.faults.contains_key(&key) {
            return;
        }
        if self.faults.len() >= MOST_LISTED {
            self.unlisted += 1;
        } else {
            self.faults.insert(key, and(spot.finding(code)));
        }
    }

    /// Adds a warning.
    pub(super) fn warn(&mut self, spot: Spot<'_>, code: &'static str) {
        self.warn_with(spot, code, |finding| finding);
    }

    /// Adds a warning with more to be said.
    pub(super) fn warn_with(&mut self, spot: Spot<'_>, code: &'static str, and: impl FnOnce(Finding) -> Finding) {
        let places = self.warned.entry(code).or_default();
        if places.len() < MOST_LISTED && places.insert((spot.line, spot.column)) {
            self.warnings.push(and(spot.finding(code)));
        }
    }

    /// Says once that something is assumed.
    pub(super) fn assume(&mut self, spot: Spot<'_>, what: &'static str, value: &'static str) {
        if self.assumed.insert(what) {
            self.warn_with(spot, "mode_assumed", |finding| finding.with("what", what).with("assumed", value));
        }
    }

    /// How many faults there are.
    pub(super) fn count(&self) -> usize {
        self.faults.len() + self.unlisted
    }

    /// The faults in the order of the program, how many there are, and the warnings.
    pub(super) fn into_parts(self) -> (Vec<Finding>, usize, Vec<Finding>) {
        let total = self.count();
        (self.faults.into_values().collect(), total, self.warnings)
    }
}
