//! The reader against texts that nobody wrote: bytes of any kind, and programs of every control with some of their bytes changed. There is
//! an answer or a refusal with its place, and what says nothing changes neither. `PRECUT_READINGS=1000000` goes on for long.
#![allow(clippy::unwrap_used, clippy::panic, clippy::cast_precision_loss, missing_docs)]

use std::fmt::Write as _;

use precut_calc::calculator::{Answer, Calculator, Failure, ProgramEncoding};
use precut_calc::program_compensation::{Outcome, ProgramCompensation};
use serde_json::{Value, json};

use crate::draw::Draw;
use crate::program_reading::{DIALECTS, Row, cases, draws, job, number, part, read, without_lines, written};
use crate::program_yielding::try_solve;

/// What is put into programs.
const PIECES: &[&str] = &[
    "G71",
    "G70",
    "P1",
    "Q2",
    "N1",
    "N2",
    "G90",
    "G92",
    "X",
    "Z-5.",
    "U",
    "W",
    "#",
    "[",
    "(",
    ")",
    "\"",
    "=",
    "IC(",
    "CR=",
    "CYCLE97(",
    "G2",
    "G3",
    "R-5.",
    "I",
    "K",
    "\n",
    "\r",
    "\r\n",
    " ",
    "\t",
    "%",
    "/",
    ",",
    "-",
    ".",
    "99999999999",
    "M99",
    "O1",
    "T0101",
    "G50",
    "S",
    "F0.1",
    "G28",
    "ü",
    "\u{feff}",
    "\0",
    "G73",
    "D0.001",
    "é=",
    "LIMS=",
    ":",
    "<",
    ">",
];

/// Numbers of a draw.
struct Pick(Draw);

impl Pick {
    fn of(&mut self, count: usize) -> usize {
        ((self.0.share() * count as f64) as usize).min(count - 1)
    }
    fn is(&mut self, share: f64) -> bool {
        self.0.share() < share
    }
}

/// A program of a control with some of its characters changed; of four one is made of pieces alone.
fn mutated(texts: &[(String, String)], pick: &mut Pick) -> (String, String) {
    let (text, dialect) = if pick.is(0.5) {
        texts[pick.of(texts.len())].clone()
    } else {
        let dialect = DIALECTS[pick.of(5)];
        let steps = part(&mut pick.0);
        (written(&steps, dialect, &mut pick.0), dialect.to_owned())
    };
    let mut text = if pick.of(4) == 0 { String::new() } else { text };
    for _ in 0..=pick.of(12) {
        let mut at = pick.of(text.len() + 1);
        while !text.is_char_boundary(at) {
            at -= 1;
        }
        if pick.of(3) == 0 && at < text.len() {
            text.remove(at);
        } else {
            text.insert_str(at, PIECES[pick.of(PIECES.len())]);
        }
    }
    let dialect = if pick.of(3) == 0 { DIALECTS[pick.of(5)].to_owned() } else { dialect };
    (text, dialect)
}

/// The same text with other ends of lines, and with comments, blanks and lines that say nothing.
fn dressed(text: &str, pick: &mut Pick) -> String {
    let end = ["\n", "\r\n", "\r"][pick.of(3)];
    let mut out = String::new();
    for line in text.replace("\r\n", "\n").split(['\n', '\r']) {
        // What stands beside a percent sign or a name is no comment.
        let is_head = line.trim_matches(['\u{feff}', ' ', '\t']).starts_with(['%', 'O', 'o', ':']);
        // Beside the program a blank line is nothing, and a comment something.
        let is_blank = line.trim_matches(['\u{feff}', ' ', '\t']).is_empty();
        let is_plain = !is_head && !is_blank && !line.contains(';') && line.chars().count() < 4000;
        let said = match pick.of(6) {
            0 if is_plain => "  \t",
            1 if is_plain => " ; X5 said",
            _ => "",
        };
        let between = if pick.of(8) == 0 && is_plain { format!("{end}; said") } else { String::new() };
        let _ = write!(out, "{line}{said}{between}{end}");
    }
    out
}

/// What is read, as far as the places of its lines say nothing: the moves and the codes of the warnings, or code and column of every
/// fault.
#[derive(Debug, PartialEq)]
enum Read {
    Moves(Vec<Row>, Vec<&'static str>),
    Faults(Vec<(&'static str, f64)>),
}

fn meaning(read: Result<Answer<Outcome>, Failure>) -> Read {
    match read {
        Ok(answer) => Read::Moves(without_lines(&answer.output), answer.warnings.iter().map(|one| one.code).collect()),
        // That it looks like a program for another control is seen in its first lines.
        Err(Failure::NotRead { findings, .. }) => Read::Faults(
            findings
                .iter()
                .filter(|fault| fault.code != "dialect_looks_like")
                .map(|fault| (fault.code, number(fault, "column")))
                .collect(),
        ),
        Err(other) => panic!("{other:?}"),
    }
}

#[test]
fn any_text_is_read_or_refused_and_what_says_nothing_changes_neither() {
    let texts: Vec<(String, String)> = ["reading.json", "refused.json"]
        .iter()
        .flat_map(|name| cases(name))
        .map(|case| (case["program"].as_str().unwrap().to_owned(), case["dialect"].as_str().unwrap().to_owned()))
        .collect();
    for seed in 0..draws(1500) {
        let mut pick = Pick(Draw::new(77 + seed));
        let (text, dialect) = mutated(&texts, &mut pick);
        let reading = match pick.of(4) {
            0 => json!({ "decimal_point": "as_increments" }),
            1 => json!({ "decimal_point": "as_units", "block_delete": true }),
            2 => json!({ "start": { "x_diameter_mm": 50, "z_mm": 5 }, "tool": "1" }),
            _ => json!({}),
        };
        if text.is_empty() {
            continue;
        }
        let found = read(&job(&text, &dialect, &reading));
        match &found {
            Ok(answer) => {
                let finite = serde_json::to_string(&answer.output).unwrap();
                assert!(!finite.contains("NaN") && !answer.output.moves.line.is_empty(), "{text:?}");
            }
            Err(Failure::NotRead { findings, total }) => {
                assert!(!findings.is_empty() && *total >= findings.len());
                let lines = text.split(['\n', '\r']).count();
                for fault in findings {
                    assert!((1.0..=lines as f64).contains(&number(fault, "line")), "{fault:?}: {text:?}");
                    assert!(fault.code == "dialect_looks_like" || number(fault, "column") >= 1.0, "{fault:?}");
                }
            }
            Err(other) => panic!("{other:?}: {text:?}"),
        }
        let other = dressed(&text, &mut pick);
        let again = read(&job(&other, &dialect, &reading));
        assert_eq!(meaning(again), meaning(found), "seed {seed}, {dialect}, {reading}\n{text:?}\n{other:?}");
    }
}

/// Bytes that programs are made of.
const LETTERS: &[u8] = b"GXZFSTNM0123456789.- \n\r%();";

/// Every byte is a character to somebody: no bytes are lost on the way in and out, and none make the reader stumble.
#[test]
fn any_bytes_come_back_as_they_were() {
    for seed in 0..draws(400) {
        let mut pick = Pick(Draw::new(9_000 + seed));
        let bytes: Vec<u8> = (0..=pick.of(300))
            .map(|_| match pick.of(3) {
                0 => pick.of(256) as u8,
                _ => LETTERS[pick.of(LETTERS.len())],
            })
            .collect();
        let encoding = ProgramEncoding::of(&bytes);
        let text = encoding.decoded(&bytes).unwrap();
        assert_eq!(encoding.encoded(&text).unwrap(), bytes);
        let mut job = job(&text, DIALECTS[pick.of(5)], &json!({}));
        job["reading"]["encoding"] = encoding.name().into();
        let found = read(&job);
        assert!(matches!(found, Ok(_) | Err(Failure::NotRead { .. })), "{bytes:?}");
    }
}

/// No number is passed over: another digit is another program, or none.
#[test]
fn no_digit_of_a_program_is_passed_over() {
    for seed in 0..draws(300) {
        let mut pick = Pick(Draw::new(20_000 + seed));
        let dialect = DIALECTS[pick.of(5)];
        let steps = part(&mut pick.0);
        let text = written(&steps, dialect, &mut pick.0);
        // The numbers of places, radii, feeds and speeds; what stands at the head says how they are read.
        let head = text.find('T').unwrap();
        // Feed and speed that no move has say nothing.
        if !["G1 ", "G2 ", "G3 "].iter().any(|code| text.contains(code)) {
            continue;
        }
        let is_of_word = |at: usize| {
            let word = text[..at].trim_end_matches(|c: char| c.is_ascii_digit() || "-.".contains(c));
            word.ends_with(['X', 'Z', 'U', 'W', 'R', 'F', 'S', '=', '('])
        };
        let digits: Vec<usize> =
            (head..text.len()).filter(|&at| text.as_bytes()[at].is_ascii_digit() && is_of_word(at)).collect();
        let at = digits[pick.of(digits.len())];
        let digit = (text.as_bytes()[at] - b'0' + 1 + pick.of(9) as u8) % 10;
        let other = format!("{}{digit}{}", &text[..at], &text[at + 1..]);
        let (before, after) =
            (meaning(read(&job(&text, dialect, &json!({})))), meaning(read(&job(&other, dialect, &json!({})))));
        assert_ne!(before, after, "seed {seed}, {dialect}: {at}\n{text}\n{other}");
    }
}

/// A corrected program, however its lines end and whatever its comments are in: all that is not changed is as it was, byte for byte,
/// the same numbers change, and where nothing may change all of it comes back.
#[test]
fn a_corrected_program_keeps_every_byte_that_it_may() {
    let plain: Value = serde_json::from_str(ProgramCompensation::META.examples[1].job).unwrap();
    let text = plain["nc_program"].as_str().unwrap().to_owned();
    let changes = |answer: &Answer<Outcome>| -> Vec<Vec<String>> {
        let compensation = answer.output.compensation.as_ref().unwrap();
        let code = |line: &String| line.split(';').next().unwrap().trim_end().to_owned();
        compensation.changes.iter().map(|change| change.new.iter().map(code).collect()).collect()
    };
    let wanted = changes(&try_solve(&plain).unwrap());
    assert!(!wanted.is_empty());
    for seed in 0..draws(300).div_ceil(100) {
        let mut pick = Pick(Draw::new(40_000 + seed));
        let mut job = plain.clone();
        let mut given = dressed(&text, &mut pick);
        if pick.is(0.5) {
            given.truncate(given.trim_end_matches(['\r', '\n']).len());
        }
        if pick.is(0.3) {
            given.insert(0, '\u{feff}');
        }
        job["nc_program"] = json!(given);
        let answer = try_solve(&job).unwrap();
        assert_eq!(changes(&answer), wanted, "seed {seed}");
        let compensation = answer.output.compensation.as_ref().unwrap();
        // The changed lines put back, all of it is what was given.
        let mut back = compensation.nc_program.clone();
        for change in compensation.changes.iter().rev() {
            let ends = ["\r\n", "\n", "\r", ""];
            let found = ends.iter().find_map(|end| {
                let new = change.new.join(end);
                back.find(&new).map(|at| (at, new.len()))
            });
            let (at, length) = found.unwrap_or_else(|| panic!("{change:?}"));
            back.replace_range(at..at + length, &change.old);
        }
        assert_eq!(back, given, "seed {seed}");
        job["force"]["specific_normal_force_n_per_mm2"] = json!(1e-3);
        let rigid = try_solve(&job).unwrap();
        assert_eq!(rigid.output.compensation.unwrap().nc_program, given, "seed {seed}");
    }
}
