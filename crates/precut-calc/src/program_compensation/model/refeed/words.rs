//! Feeds in the text: F where it stands, F put in where a line relied on another one (`program/8`).

use std::collections::{BTreeMap, BTreeSet};
use std::ops::Range;

use crate::calculator::{Dialect, Failure, Finding, Monitor};

use super::super::super::job::Job;
use super::super::correction::{ChangedLine, applied, decimal, number_like};
use super::super::reader::{self, Feed, FeedOfLine, Kind, Program, ProgramMove, lines_of_text};
use super::failed;
use super::stretch::CuttingLine;

/// Least step of a word of the feed as it is written.
const STEP_OF_WORD: f64 = 1e-6;
/// Feeds that are one differ by a smaller share.
const SAME_SHARE: f64 = 1e-9;

/// A text with its feeds, and how it is read.
pub(super) struct Written {
    pub(super) text: String,
    pub(super) program: Program,
    pub(super) changed: Vec<ChangedLine>,
}

/// Writes the feeds. What a feed goes on to hold for, the reader says: where a move reads another one than it should have, its
/// line gets a word.
pub(super) fn written(
    (program, job): (&Program, &Job),
    lines: &[CuttingLine],
    feeds: &[f64],
    monitor: &dyn Monitor,
) -> Result<Written, Failure> {
    let mut wanted: Vec<Option<Feed>> = program.moves.iter().map(|one| one.feed).collect();
    for (line, &feed) in lines.iter().zip(feeds) {
        line.moves.iter().for_each(|one| wanted[one.mv] = Some(line.feed_of(feed)));
    }
    let mut of_lines: BTreeMap<usize, Feed> = BTreeMap::new();
    for (one, feed) in program.moves.iter().zip(&wanted) {
        if let Some(feed) = feed {
            of_lines.entry(one.line).or_insert(*feed);
        }
    }
    let text = Text { job, program, ranges: lines_of_text(&job.nc_program) };
    let mut put_in: BTreeSet<usize> = BTreeSet::new();
    loop {
        let changed = text.changed(&of_lines, &put_in);
        let new = applied(&job.nc_program, &text.ranges, &changed);
        let read = reader::read(&new, job.dialect, &job.reading, monitor)?;
        let lacking = lacking(program, &read, &wanted)?;
        if lacking.is_empty() {
            return Ok(Written { text: new, program: read, changed });
        }
        // A cycle that is a call takes no word beside it.
        let is_call = |one: &&ProgramMove| one.kind == Kind::Opaque && lacking.contains(&one.line);
        if let Some(call) = program.moves.iter().find(is_call).filter(|_| job.dialect == Dialect::Siemens) {
            let finding = Finding::new("feed_not_put_back", "/nc_program").with("line", call.line);
            return Err(Failure::OutOfModel(finding));
        }
        let known = put_in.len();
        put_in.extend(lacking.iter().filter(|line| !text.says(**line)));
        // What has a word and is read otherwise is run at more than one feed.
        if put_in.len() == known {
            return Err(failed("read_again", lacking[0]));
        }
    }
}

/// Lines whose moves are read at another feed than they should have: of those that follow each other at one feed the first.
fn lacking(old: &Program, new: &Program, wanted: &[Option<Feed>]) -> Result<Vec<usize>, Failure> {
    if old.moves.len() != new.moves.len() {
        return Err(failed("read_again", new.moves.last().map_or(1, |one| one.line)));
    }
    let mut found = Vec::new();
    let mut goes_on: Option<Feed> = None;
    for ((one, other), feed) in old.moves.iter().zip(&new.moves).zip(wanted) {
        if !is_same_way(one, other) {
            return Err(failed("read_again", one.line));
        }
        let Some(feed) = *feed else { continue };
        if other.feed.is_some_and(|read| is_same(read, feed)) {
            goes_on = None;
        } else if !goes_on.is_some_and(|before| is_same(before, feed)) {
            found.push(one.line);
            goes_on = Some(feed);
        }
    }
    Ok(found)
}

/// Whether two moves are one but for the feed.
fn is_same_way(a: &ProgramMove, b: &ProgramMove) -> bool {
    let bare = |one: &ProgramMove| ProgramMove { feed: None, ..*one };
    bare(a) == bare(b)
}

fn is_same(a: Feed, b: Feed) -> bool {
    match (a, b) {
        (Feed::PerRev(a), Feed::PerRev(b)) | (Feed::PerMinute(a), Feed::PerMinute(b)) => {
            (a - b).abs() <= SAME_SHARE * a.abs()
        }
        _ => false,
    }
}

struct Text<'a> {
    job: &'a Job,
    program: &'a Program,
    ranges: Vec<Range<usize>>,
}

impl Text<'_> {
    /// Whether a line has a word of the feed.
    fn says(&self, line: usize) -> bool {
        self.program.feeds_of_lines.get(&line).is_some_and(|of| of.number.is_some())
    }

    fn changed(&self, of_lines: &BTreeMap<usize, Feed>, put_in: &BTreeSet<usize>) -> Vec<ChangedLine> {
        let line = |(&line, &feed): (&usize, &Feed)| {
            let (of, range) = (self.program.feeds_of_lines.get(&line)?, self.ranges.get(line - 1)?);
            let (Feed::PerRev(length) | Feed::PerMinute(length)) = feed;
            let (place, word) = match &of.number {
                Some(number) => (number.range.clone(), self.number(number, length)?),
                None if put_in.contains(&line) => (of.put_in_at..of.put_in_at, self.word(of, range, length)),
                None => return None,
            };
            let text = &self.job.nc_program;
            let new = [&text[range.start..place.start], word.as_str(), &text[place.end..range.end]].concat();
            let old = text[range.clone()].to_owned();
            Some(ChangedLine { line, old, new: vec![new], smallest_shift_um: 0.0, largest_shift_um: 0.0 })
        };
        of_lines.iter().filter_map(line).collect()
    }

    /// The number of a word that stands; none where it is that already.
    fn number(&self, number: &reader::NumberInText, length: f64) -> Option<String> {
        let before = &self.job.nc_program[number.range.clone()];
        let bare: String = before.chars().filter(|c| !c.is_whitespace()).collect();
        let was = bare.parse::<f64>().ok().map(|value| value * number.step_mm.unwrap_or(1.0) * number.unit_mm);
        let is_it = was.is_some_and(|was| (was - length).abs() <= SAME_SHARE * length.abs());
        (!is_it).then(|| number_like(before, length, number, STEP_OF_WORD))
    }

    /// A word for a line that has none, and what parts it from the one before.
    fn word(&self, of: &FeedOfLine, range: &Range<usize>, length: f64) -> String {
        let before = &self.job.nc_program[range.start..of.put_in_at];
        let is_small = before.bytes().rev().find(u8::is_ascii_alphabetic).is_some_and(|c| c.is_ascii_lowercase());
        let is_parted = before.trim().contains(' ') || self.job.dialect == Dialect::Siemens;
        let letter = if is_small { 'f' } else { 'F' };
        format!("{}{letter}{}", if is_parted { " " } else { "" }, decimal(length / of.unit_mm, STEP_OF_WORD))
    }
}
