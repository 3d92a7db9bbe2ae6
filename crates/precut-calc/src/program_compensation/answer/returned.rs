//! The corrected program as a file, with what it says of itself where that is asked for (`program/6`).

use std::fmt::Write as _;
use std::ops::Range;

use crate::calculator::ReturnedProgram;
use crate::certainty::JointlyKept;

use super::super::job::{Dialect, Job};
use super::super::model::correction::{ChangedLine, unified};
use super::super::model::reader::lines_of_text;
use super::compensated::{CompensatedProgram, LineChange};

/// Most characters of the comment.
const LONGEST: usize = 220;

/// The program and its diff; `made_by` names the answer in its stamp, and `kept` is how probably its limits are kept.
pub(crate) fn returned(
    job: &Job,
    compensation: &CompensatedProgram,
    (made_by, kept): (&str, Option<&JointlyKept>),
) -> ReturnedProgram {
    let (mut text, mut diff) = (compensation.nc_program.clone(), compensation.diff.clone());
    // What comes back as it was has nothing to say.
    if job.mode.stamp && !compensation.changes.is_empty() {
        let does = if job.mode.kind.refeeds() { "changes feeds and shifts X" } else { "shifts X" };
        let stamp = stamp(job.dialect, &compensation.changes, (made_by, does, kept));
        let (line, end) = head(&job.nc_program, job.dialect);
        text = stamped(&text, line, end, &stamp);
        diff = unified(&job.nc_program, &with_stamp(&job.nc_program, &compensation.changes, line, &stamp));
    }
    ReturnedProgram { text, diff, encoding: job.reading.encoding, dialect: job.dialect }
}

/// The comment.
fn stamp(
    dialect: Dialect,
    changes: &[LineChange],
    (made_by, does, kept): (&str, &str, Option<&JointlyKept>),
) -> String {
    let largest = |change: &LineChange| change.smallest_shift_um.abs().max(change.largest_shift_um.abs());
    let shift_um = changes.iter().map(largest).fold(0.0, f64::max);
    let mut said = format!("{made_by} {does} by up to {shift_um:.0} um in {} lines", changes.len());
    if let Some(kept) = kept {
        // Within bounds it is the least.
        let at_least = if kept.probability_most.is_some() { "at least " } else { "" };
        let _ = write!(said, ", within all limits with probability {at_least}{:.3}", kept.probability);
    }
    // Nothing in a comment acts, whatever names the answer.
    let plain = said.chars().map(|c| if c.is_ascii_alphanumeric() || " .,:-_".contains(c) { c } else { ' ' });
    let plain: String = plain.take(LONGEST).collect();
    match dialect {
        Dialect::Siemens => format!("; {plain}"),
        Dialect::Fanuc | Dialect::FanucA | Dialect::FanucC | Dialect::LinuxCnc => format!("({plain})"),
    }
}

/// Behind how many lines of a program its body begins (its sign, its name), and how its lines end.
fn head(text: &str, dialect: Dialect) -> (usize, &str) {
    let lines = lines_of_text(text);
    let shown = |line: &Range<usize>| text[line.clone()].trim_matches(['\u{feff}', ' ', '\t']);
    let is_sign = |line: &&Range<usize>| dialect != Dialect::Siemens && shown(line).starts_with('%');
    // A leader stands before the first of two signs.
    let sign = lines.iter().position(|line| is_sign(&line)).filter(|_| lines.iter().filter(is_sign).count() > 1);
    let first = sign.or_else(|| lines.iter().position(|line| !shown(line).is_empty())).unwrap_or(0);
    let is_head = |line: &&Range<usize>| {
        let is_named = dialect != Dialect::Siemens && shown(line).starts_with(['O', 'o', ':']);
        is_named || shown(line).starts_with('%') || shown(line).starts_with(";$PATH")
    };
    let heads = lines[first..].iter().take_while(is_head).count();
    let behind = if heads > 0 { first + heads } else { 0 };
    let ended = lines.iter().zip(lines.iter().skip(1)).next().map_or("\n", |(one, next)| &text[one.end..next.start]);
    (behind, if ended.starts_with("\r\n") { "\r\n" } else { &ended[..1] })
}

/// A text with a line put in behind its first ones.
fn stamped(text: &str, behind: usize, end: &str, stamp: &str) -> String {
    let lines = lines_of_text(text);
    let at = lines.get(behind).map_or(text.len(), |line| line.start);
    let at = if behind == 0 && text.starts_with('\u{feff}') { '\u{feff}'.len_utf8() } else { at };
    [&text[..at], stamp, end, &text[at..]].concat()
}

/// The changes with the line that is put in.
fn with_stamp(text: &str, changes: &[LineChange], behind: usize, stamp: &str) -> Vec<ChangedLine> {
    let mut changed: Vec<ChangedLine> = changes
        .iter()
        .map(|one| ChangedLine {
            line: one.line,
            old: one.old.clone(),
            new: one.new.clone(),
            smallest_shift_um: one.smallest_shift_um,
            largest_shift_um: one.largest_shift_um,
        })
        .collect();
    let line = behind.max(1);
    if !changed.iter().any(|one| one.line == line) {
        let old = lines_of_text(text).get(line - 1).map_or("", |line| &text[line.clone()]).to_owned();
        changed.push(ChangedLine { line, new: vec![old.clone()], old, smallest_shift_um: 0.0, largest_shift_um: 0.0 });
    }
    for one in changed.iter_mut().filter(|one| one.line == line) {
        if behind > 0 {
            one.new.push(stamp.to_owned());
        } else if let Some(first) = one.new.first_mut().filter(|first| first.starts_with('\u{feff}')) {
            let rest = first.split_off('\u{feff}'.len_utf8());
            first.push_str(stamp);
            one.new.insert(1, rest);
        } else {
            one.new.insert(0, stamp.to_owned());
        }
    }
    changed
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_comment_stands_behind_sign_and_name() {
        for (text, dialect, wanted) in [
            ("%\nO42\nG0\n%\n", Dialect::FanucA, "%\nO42\n(c)\nG0\n%\n"),
            ("leader\r\n%\r\nG0\r\n%", Dialect::Fanuc, "leader\r\n%\r\n(c)\r\nG0\r\n%"),
            ("G0\nM30\n%\n", Dialect::LinuxCnc, "(c)\nG0\nM30\n%\n"),
            ("\u{feff}G0\rM30", Dialect::LinuxCnc, "\u{feff}(c)\rG0\rM30"),
            ("%_N_A_MPF\n;$PATH=/_N_WKS_DIR\nG0\n", Dialect::Siemens, "%_N_A_MPF\n;$PATH=/_N_WKS_DIR\n(c)\nG0\n"),
        ] {
            let (behind, end) = head(text, dialect);
            assert_eq!(stamped(text, behind, end, "(c)"), wanted);
        }
    }

    #[test]
    fn nothing_in_the_comment_acts() {
        assert_eq!(
            stamp(Dialect::Fanuc, &[], ("a) G0 (b;\n%", "shifts X", None)),
            "(a  G0  b    shifts X by up to 0 um in 0 lines)"
        );
    }
}
