//! Whether a program that is not read looks like one for another control.

use std::ops::Range;

use crate::calculator::Finding;

use super::super::super::job::Dialect;
use super::faults::Notes;
use super::lexer;

/// Lines that are looked at.
const LINES: usize = 50;

/// What another control would be, with the place of what looks like it.
pub(super) fn other_dialect(text: &str, lines: &[Range<usize>], dialect: Dialect) -> Option<Finding> {
    lines.iter().take(LINES).enumerate().find_map(|(at, line)| {
        let line = &text[line.clone()];
        looks_like(line, dialect).filter(|other| *other != dialect).map(|other| {
            Finding::new("dialect_looks_like", "/dialect")
                .with("line", at + 1)
                .with("word", line.trim().chars().take(60).collect::<String>())
                .with("looks_like", other.name())
        })
    })
}

fn looks_like(line: &str, dialect: Dialect) -> Option<Dialect> {
    let large = line.to_ascii_uppercase();
    let bare = large.trim_start();
    if bare.starts_with("%_N_")
        || ["LIMS=", "LIMS =", "DIAMON", "DIAMOF", "DIAM90", "CR="].iter().any(|word| large.contains(word))
    {
        return Some(Dialect::Siemens);
    }
    let as_read = if dialect == Dialect::Siemens { Dialect::FanucA } else { dialect };
    let block = lexer::block(line, 1, as_read, &mut Notes::default());
    let has = |letter: u8, number: f64| {
        block.words.iter().any(|word| word.letter == letter && (word.number() - number).abs() < 1e-9)
    };
    let names = |letters: &[u8]| block.words.iter().any(|word| letters.contains(&word.letter));
    if has(b'G', 7.0) || has(b'G', 8.0) || (has(b'G', 96.0) && names(b"D")) || (has(b'M', 6.0) && names(b"T")) {
        return Some(Dialect::LinuxCnc);
    }
    let is_system_a = (has(b'G', 50.0) && names(b"S"))
        || (names(b"UW") && !block.words.iter().any(|word| word.letter == b'G' && word.number() > 4.0));
    is_system_a.then_some(Dialect::FanucA)
}
