//! A unified diff of lines that became others (`program/6`).

use std::fmt::Write as _;

use super::super::reader::lines_of_text;
use super::rewrite::ChangedLine;

/// Lines that stand around a change.
const CONTEXT: usize = 3;

/// The diff; empty where nothing changes.
pub(crate) fn unified(text: &str, changed: &[ChangedLine]) -> String {
    let lines: Vec<&str> = lines_of_text(text).into_iter().map(|range| &text[range]).collect();
    let mut changed: Vec<&ChangedLine> = changed.iter().collect();
    changed.sort_by_key(|one| one.line);
    let mut out = String::new();
    if !changed.is_empty() {
        out.push_str("--- given\n+++ corrected\n");
    }
    let (mut at, mut added) = (0, 0);
    while at < changed.len() {
        // Changes whose surroundings touch stand in one hunk.
        let mut last = at;
        while last + 1 < changed.len() && changed[last + 1].line - changed[last].line <= 2 * CONTEXT + 1 {
            last += 1;
        }
        let from = changed[at].line.saturating_sub(CONTEXT).max(1);
        let to = (changed[last].line + CONTEXT).min(lines.len());
        let more: usize = changed[at..=last].iter().map(|one| one.new.len() - 1).sum();
        let _ = writeln!(out, "@@ -{from},{} +{},{} @@", to + 1 - from, from + added, to + 1 - from + more);
        let mut next = at;
        for line in from..=to {
            if next <= last && changed[next].line == line {
                // Neighbours that change follow each other: old ones first.
                let mut run = next;
                while run < last && changed[run + 1].line == changed[run].line + 1 {
                    run += 1;
                }
                let is_first_of_run = next == at || changed[next - 1].line + 1 != line;
                if is_first_of_run {
                    for one in &changed[next..=run] {
                        let _ = writeln!(out, "-{}", one.old);
                    }
                    for new in changed[next..=run].iter().flat_map(|one| &one.new) {
                        let _ = writeln!(out, "+{new}");
                    }
                }
                next += 1;
            } else {
                let _ = writeln!(out, " {}", lines[line - 1]);
            }
        }
        added += more;
        at = last + 1;
    }
    out
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn changes_stand_with_what_is_around_them() {
        let text = "1\n2\n3\n4\n5\n6\n7\n8\n9\n10\n11\n12\n";
        let change = |line: usize, new: &[&str]| ChangedLine {
            line,
            old: line.to_string(),
            new: new.iter().map(|&new| new.to_owned()).collect(),
            smallest_shift_um: 0.0,
            largest_shift_um: 0.0,
        };
        let diff = unified(text, &[change(2, &["b"]), change(3, &["c", "d"]), change(12, &["l"])]);
        let wanted = "--- given\n+++ corrected\n@@ -1,6 +1,7 @@\n 1\n-2\n-3\n+b\n+c\n+d\n 4\n 5\n 6\n@@ -9,4 +10,4 @@\n 9\n 10\n 11\n-12\n+l\n";
        assert_eq!(diff, wanted);
    }
}
