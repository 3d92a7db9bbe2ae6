//! A unified diff of lines that became others (`program/6`).

use std::fmt::Write as _;

use super::super::reader::lines_of_text;
use super::rewrite::ChangedLine;

/// Lines that stand around a change.
const CONTEXT: usize = 3;

/// The diff; empty where nothing changes. Lines keep the CR of their ends, as tools that lay a diff on a file expect.
pub(crate) fn unified(text: &str, changed: &[ChangedLine]) -> String {
    let ranges = lines_of_text(text);
    let line_of = |line: usize| &text[ranges[line - 1].clone()];
    let mut changed: Vec<&ChangedLine> = changed.iter().collect();
    changed.sort_by_key(|one| one.line);
    let mut out = String::new();
    if !changed.is_empty() {
        out.push_str("--- given\n+++ corrected\n");
    }
    let put = |out: &mut String, sign: char, shown: &str, line: usize, is_last: bool| {
        let end = &text[ranges[line - 1].end..];
        let return_of = if end.starts_with("\r\n") { "\r" } else { "" };
        let _ = writeln!(out, "{sign}{shown}{return_of}");
        if end.is_empty() && is_last {
            out.push_str("\\ No newline at end of file\n");
        }
    };
    let (mut at, mut added) = (0, 0);
    while at < changed.len() {
        // Changes whose surroundings touch stand in one hunk.
        let mut last = at;
        while last + 1 < changed.len() && changed[last + 1].line - changed[last].line <= 2 * CONTEXT + 1 {
            last += 1;
        }
        let from = changed[at].line.saturating_sub(CONTEXT).max(1);
        let to = (changed[last].line + CONTEXT).min(ranges.len());
        let more: usize = changed[at..=last].iter().map(|one| one.new.len() - 1).sum();
        let _ = writeln!(out, "@@ -{from},{} +{},{} @@", to + 1 - from, from + added, to + 1 - from + more);
        let mut next = at;
        for line in from..=to {
            if next > last || changed[next].line != line {
                put(&mut out, ' ', line_of(line), line, true);
                continue;
            }
            // Neighbours that change follow each other: old ones first.
            let is_run = |pair: [usize; 2]| changed[pair[1]].line == changed[pair[0]].line + 1;
            if next == at || !is_run([next - 1, next]) {
                let end = (next..last).find(|&i| !is_run([i, i + 1])).unwrap_or(last);
                let old: Vec<(&str, usize)> =
                    changed[next..=end].iter().map(|one| (one.old.as_str(), one.line)).collect();
                let new: Vec<(&str, usize)> = changed[next..=end]
                    .iter()
                    .flat_map(|one| one.new.iter().map(|new| (new.as_str(), one.line)))
                    .collect();
                // What stays at both ends of a run has not changed.
                let head = old.iter().zip(&new).take_while(|(old, new)| old.0 == new.0).count();
                let left = old.len().min(new.len()) - head;
                let tail = old.iter().rev().zip(new.iter().rev()).take(left);
                let tail = tail.take_while(|(old, new)| old.0 == new.0).count();
                let kinds = [
                    (' ', &old[..head], false),
                    ('-', &old[head..old.len() - tail], tail == 0),
                    ('+', &new[head..new.len() - tail], tail == 0),
                    (' ', &old[old.len() - tail..], true),
                ];
                for (sign, shown, is_end) in kinds {
                    for (i, &(text, line)) in shown.iter().enumerate() {
                        put(&mut out, sign, text, line, is_end && i + 1 == shown.len());
                    }
                }
            }
            next += 1;
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

    #[test]
    fn ends_of_lines_and_of_the_file_are_told() {
        let change = |line: usize, old: &str, new: &[&str]| ChangedLine {
            line,
            old: old.to_owned(),
            new: new.iter().map(|&new| new.to_owned()).collect(),
            smallest_shift_um: 0.0,
            largest_shift_um: 0.0,
        };
        let diff = unified("%\r\na\r\nb", &[change(1, "%", &["%", "(c)"]), change(3, "b", &["d", "e"])]);
        let none = "\\ No newline at end of file";
        let wanted =
            format!("--- given\n+++ corrected\n@@ -1,3 +1,5 @@\n %\r\n+(c)\r\n a\r\n-b\n{none}\n+d\n+e\n{none}\n");
        assert_eq!(diff, wanted);
    }
}
