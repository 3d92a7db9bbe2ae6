//! Lines of a program, and which of them are read.

use std::ops::Range;

use super::super::super::job::Dialect;

/// Lines without their ends: LF, CR LF and CR end one, in any mixture.
pub(crate) fn lines(text: &str) -> Vec<Range<usize>> {
    let bytes = text.as_bytes();
    let mut found = Vec::new();
    let mut start = 0;
    let mut at = 0;
    while at < bytes.len() {
        let length = match bytes[at] {
            b'\r' if bytes.get(at + 1) == Some(&b'\n') => 2,
            b'\r' | b'\n' => 1,
            _ => 0,
        };
        if length > 0 {
            found.push(start..at);
            start = at + length;
        }
        at += length.max(1);
    }
    if start < bytes.len() {
        found.push(start..bytes.len());
    }
    found
}

/// What of a program is read: the lines between its percent signs, or all up to the only one.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Extent {
    /// The first line that is read, from 0.
    pub(super) start: usize,
    /// The line behind the last one.
    pub(super) end: usize,
    /// The first line beside it on which something stands, which nobody reads.
    pub(super) beside: Option<usize>,
}

impl Extent {
    /// Of a program of this dialect. `%_N_..._MPF` of Siemens is a name and ends nothing.
    pub(super) fn of(text: &str, lines: &[Range<usize>], dialect: Dialect) -> Self {
        let shown = |line: &Range<usize>| text[line.clone()].trim_matches(['\u{feff}', ' ', '\t']);
        let is_sign = |line: &Range<usize>| dialect != Dialect::Siemens && shown(line).starts_with('%');
        let signs: Vec<usize> = (0..lines.len()).filter(|&i| is_sign(&lines[i])).take(2).collect();
        let first_shown = lines.iter().position(|line| !shown(line).is_empty()).unwrap_or(0);
        let (start, end) = match signs[..] {
            [] => (0, lines.len()),
            // Before the only sign stands the program, unless the sign is what it begins with.
            [only] if only > first_shown => (0, only),
            [only] => (only, lines.len()),
            [first, second, ..] => (first, second),
        };
        let beside = (0..start).chain((end + 1).min(lines.len())..lines.len()).find(|&i| !shown(&lines[i]).is_empty());
        Self { start, end, beside }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn texts(text: &str) -> Vec<&str> {
        lines(text).into_iter().map(|line| &text[line]).collect()
    }

    #[test]
    fn every_end_of_a_line_ends_it() {
        assert_eq!(texts("a\nb\r\nc\rd"), ["a", "b", "c", "d"]);
        assert_eq!(texts("a\r\n\r\nb\n"), ["a", "", "b"]);
        assert_eq!(texts(""), Vec::<&str>::new());
    }

    #[test]
    fn the_program_stands_between_its_signs() {
        let extent = |text: &str| {
            let lines = lines(text);
            let Extent { start, end, beside } = Extent::of(text, &lines, Dialect::FanucA);
            (start, end, beside)
        };
        assert_eq!(extent("%\nG0\n%\n"), (0, 2, None));
        assert_eq!(extent("G0\nM30\n%\n"), (0, 2, None));
        assert_eq!(extent("\n%\nG0\nM30\n"), (1, 4, None));
        assert_eq!(extent("leader\n%\nG0\n%\ntrailer"), (1, 3, Some(0)));
        assert_eq!(extent("%\nG0\n%\n\ntrailer"), (0, 2, Some(4)));
    }
}
