//! Words of a line. A word is a letter and a number, or with Siemens a name with a value; what is neither is a fault with
//! its place.

use super::super::super::job::Dialect;
use super::faults::{Notes, Spot};

/// Largest number of a word: a control takes none.
const LARGEST: f64 = 999_999_999.0;

/// Words of Fanuc's macros.
const MACRO_WORDS: [&str; 7] = ["IF", "GOTO", "WHILE", "DO", "END", "THEN", "ELSE"];

/// A number as it is written.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Number {
    /// Its value.
    pub(super) value: f64,
    /// Whether it has a decimal point.
    pub(super) has_point: bool,
}

/// What stands behind the letter or name of a word.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Operand<'a> {
    /// A number.
    Number(Number),
    /// `IC(number)` of Siemens: relative to where the axis is.
    Relative(Number),
    /// `AC(number)` of Siemens: from program zero.
    Absolute(Number),
    /// `"text"` of Siemens.
    Text(&'a str),
    /// `(...)` of Siemens.
    Call,
    /// Nothing: a flag.
    Nothing,
}

/// A word.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Word<'a> {
    /// Its letter, large; 0 of a name.
    pub(super) letter: u8,
    /// Its name as it is written, of a letter that letter.
    pub(super) name: &'a str,
    /// What stands behind it.
    pub(super) operand: Operand<'a>,
    /// All of it.
    pub(super) spot: Spot<'a>,
}

impl Word<'_> {
    /// Whether it has this name.
    pub(super) fn is_named(&self, name: &str) -> bool {
        self.letter == 0 && self.name.eq_ignore_ascii_case(name)
    }

    /// Its number, however it is meant; 0 where it has none.
    pub(super) fn number(&self) -> f64 {
        match self.operand {
            Operand::Number(number) | Operand::Relative(number) | Operand::Absolute(number) => number.value,
            Operand::Text(_) | Operand::Call | Operand::Nothing => 0.0,
        }
    }
}

/// A line in words.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Block<'a> {
    /// Line, from 1.
    pub(super) line: usize,
    /// Whether a stroke at its head lets the control skip it.
    pub(super) has_stroke: bool,
    /// The words, without the number of the block and the name of a program.
    pub(super) words: Vec<Word<'a>>,
    /// The number of the block.
    pub(super) number: Option<f64>,
    /// Whether something on the line is not read.
    pub(super) is_faulty: bool,
}

/// Reads one line.
pub(super) fn block<'a>(text: &'a str, line: usize, dialect: Dialect, notes: &mut Notes) -> Block<'a> {
    let before = notes.count();
    let mut lexer = Lexer {
        text,
        bytes: text.as_bytes(),
        at: 0,
        dialect,
        notes,
        block: Block { line, has_stroke: false, words: Vec::new(), number: None, is_faulty: false },
        chars: (0, 0),
    };
    lexer.run();
    let Lexer { mut block, notes, .. } = lexer;
    block.is_faulty = notes.count() > before;
    block
}

struct Lexer<'a, 'n> {
    text: &'a str,
    bytes: &'a [u8],
    at: usize,
    dialect: Dialect,
    notes: &'n mut Notes,
    block: Block<'a>,
    /// How many characters stand before a place, which was asked last.
    chars: (usize, usize),
}

/// The value of a number, or why it is none.
enum Told<'a> {
    Operand(Operand<'a>),
    Fault(&'static str),
}

impl<'a> Lexer<'a, '_> {
    fn run(&mut self) {
        while let Some(byte) = self.peek() {
            match byte {
                b' ' | b'\t' => self.at += 1,
                b';' => break,
                b'(' if self.dialect != Dialect::Siemens => {
                    let Some(length) = self.text[self.at..].find(')') else {
                        self.fault(self.at, self.bytes.len(), "comment_not_closed");
                        break;
                    };
                    self.at += length + 1;
                }
                b'/' => self.stroke(),
                b'%' if self.is_head() => break,
                b'<' if self.is_head() && self.text[self.at..].contains('>') => {
                    self.at += self.text[self.at..].find('>').unwrap_or(0) + 1;
                }
                b':' if self.is_head() => {
                    self.at += 1;
                    self.at = self.while_at(self.at, |b| b.is_ascii_digit());
                }
                b'#' | b'$' => self.refuse_to_blank("variable_in_program"),
                b'[' => self.refuse_to_blank("expression_in_program"),
                b',' => self.comma(),
                b if b.is_ascii_alphabetic() || b == b'_' => self.word(),
                // A byte order mark, which is no character of the line.
                0xEF if self.at == 0 && self.text.starts_with('\u{feff}') => self.at += 3,
                _ => self.refuse_to_blank("stray_text"),
            }
        }
    }

    fn peek(&self) -> Option<u8> {
        self.bytes.get(self.at).copied()
    }

    fn is_head(&self) -> bool {
        self.block.words.is_empty()
    }

    fn while_at(&self, from: usize, is: impl Fn(u8) -> bool) -> usize {
        self.bytes[from..].iter().position(|&b| !is(b)).map_or(self.bytes.len(), |length| from + length)
    }

    /// Column of a place, from 1. Places are asked in their order, so that a line is counted once.
    fn column(&mut self, at: usize) -> usize {
        if at < self.chars.0 {
            self.chars = (0, 0);
        }
        let more = self.text[self.chars.0..at].chars().filter(|&c| c != '\u{feff}').count();
        self.chars = (at, self.chars.1 + more);
        self.chars.1 + 1
    }

    fn spot(&mut self, from: usize, to: usize) -> Spot<'a> {
        Spot { line: self.block.line, column: self.column(from), word: &self.text[from..to] }
    }

    fn fault(&mut self, from: usize, to: usize, code: &'static str) {
        let spot = self.spot(from, to);
        self.notes.fault(spot, code);
    }

    /// Refuses all up to the next blank.
    fn refuse_to_blank(&mut self, code: &'static str) {
        let end = self.while_at(self.at, |b| !matches!(b, b' ' | b'\t' | b';' | b'('));
        let end = end.max(self.at + 1);
        // A character of several bytes is none of these.
        let end = (end..=self.bytes.len()).find(|&end| self.text.is_char_boundary(end)).unwrap_or(self.bytes.len());
        self.fault(self.at, end, code);
        self.at = end;
    }

    fn stroke(&mut self) {
        if self.is_head() {
            self.block.has_stroke = true;
            self.at = self.while_at(self.at + 1, |b| b.is_ascii_digit());
        } else {
            self.refuse_to_blank("block_delete_inside");
        }
    }

    /// `,R2.` of Fanuc is a dimension of the drawing.
    fn comma(&mut self) {
        let is_dimension = self.bytes.get(self.at + 1).is_some_and(u8::is_ascii_alphabetic);
        if !is_dimension {
            return self.refuse_to_blank("stray_text");
        }
        let end = self.while_at(self.at + 2, |b| b.is_ascii_digit() || matches!(b, b'.' | b'-' | b'+'));
        self.fault(self.at, end, "drawing_dimension");
        self.at = end;
    }

    fn word(&mut self) {
        let start = self.at;
        let letters = self.while_at(start, |b| b.is_ascii_alphabetic() || b == b'_');
        if self.dialect == Dialect::Siemens && letters > start + 1 {
            return self.name(start);
        }
        let run = &self.text[start..letters];
        if self.dialect != Dialect::LinuxCnc && MACRO_WORDS.iter().any(|word| run.eq_ignore_ascii_case(word)) {
            return self.refuse_to_blank("jump_in_program");
        }
        let letter = self.bytes[start].to_ascii_uppercase();
        if letter == b'_' {
            return self.refuse_to_blank("stray_text");
        }
        if letter == b'O' && self.dialect == Dialect::LinuxCnc {
            let end = self.while_at(start + 1, |b| b.is_ascii_digit());
            self.fault(start, end, "subprogram");
            self.at = self.bytes.len();
            return;
        }
        self.at = start + 1;
        let told = if self.dialect == Dialect::Siemens { self.siemens_operand(start) } else { self.operand() };
        match told {
            Told::Operand(operand) => self.push(letter, start, start + 1, operand),
            Told::Fault(code) => {
                let end = if code == "word_without_number" { start + 1 } else { self.at };
                self.fault(start, end, code);
                // What follows is no word of its own.
                if code == "word_without_number" {
                    self.at = self
                        .while_at(start + 1, |b| !b.is_ascii_alphabetic() && !matches!(b, b' ' | b'\t' | b';' | b'('));
                    self.at =
                        (self.at..=self.bytes.len()).find(|&at| self.text.is_char_boundary(at)).unwrap_or(self.at);
                }
            }
        }
    }

    fn push(&mut self, letter: u8, start: usize, name_end: usize, operand: Operand<'a>) {
        let spot = self.spot(start, self.at);
        let name = &self.text[start..name_end];
        let word = Word { letter, name, operand, spot };
        if word.number().abs() > LARGEST {
            return self.notes.fault(spot, "number_too_large");
        }
        match letter {
            b'N' if self.block.number.is_none() => self.block.number = Some(word.number()),
            b'O' if self.is_head() => {}
            _ => self.block.words.push(word),
        }
    }

    /// A number behind a letter; on entry behind the letter, on exit behind the number.
    fn operand(&mut self) -> Told<'a> {
        let at = self.while_at(self.at, |b| matches!(b, b' ' | b'\t'));
        match self.bytes.get(at) {
            Some(b'[') => {
                let length = self.text[at..].find(']').map_or(self.bytes.len() - at, |length| length + 1);
                self.at = at + length;
                Told::Fault("expression_in_program")
            }
            Some(b'#') => {
                self.at = self.while_at(at, |b| {
                    b == b'#' || b.is_ascii_digit() || b == b'<' || b == b'>' || b == b'_' || b.is_ascii_alphabetic()
                });
                Told::Fault("variable_in_program")
            }
            _ => match self.number(at) {
                Some(number) => Told::Operand(Operand::Number(number)),
                None => Told::Fault("word_without_number"),
            },
        }
    }

    /// The number at a place, behind which the reader then stands.
    fn number(&mut self, from: usize) -> Option<Number> {
        // LinuxCNC reads over blanks, be they in a number.
        let reads_over_blanks = self.dialect == Dialect::LinuxCnc;
        let mut digits = String::new();
        let (mut at, mut end) = (from, from);
        let (mut has_point, mut has_digit) = (false, false);
        while let Some(&byte) = self.bytes.get(at) {
            match byte {
                b' ' | b'\t' if reads_over_blanks => {}
                b'+' | b'-' if digits.is_empty() => digits.push(char::from(byte)),
                b'.' if !has_point => {
                    has_point = true;
                    digits.push('.');
                }
                b'0'..=b'9' => {
                    has_digit = true;
                    digits.push(char::from(byte));
                }
                _ => break,
            }
            at += 1;
            if !matches!(byte, b' ' | b'\t') {
                end = at;
            }
        }
        if !has_digit {
            return None;
        }
        self.at = end;
        digits.parse().ok().map(|value| Number { value, has_point })
    }

    /// What stands behind a letter of Siemens: a number, `=number`, `=IC(number)`, `=AC(number)`, `="text"`, or behind an
    /// index `1=number`.
    fn siemens_operand(&mut self, start: usize) -> Told<'a> {
        let blank = |b: u8| matches!(b, b' ' | b'\t');
        let after_index = self.while_at(self.at, |b| b.is_ascii_digit());
        let equals = self.while_at(after_index, blank);
        if self.bytes.get(equals) == Some(&b'=') {
            // R1=5 sets a parameter; S1=500 is the speed of the first spindle.
            if self.bytes[start].eq_ignore_ascii_case(&b'R') {
                self.at = self.while_at(equals, |b| !blank(b));
                return Told::Fault("variable_in_program");
            }
            return self.value(equals + 1);
        }
        let at = self.while_at(self.at, blank);
        match self.number(at) {
            Some(number) => Told::Operand(Operand::Number(number)),
            None => Told::Fault("word_without_number"),
        }
    }

    /// What stands behind an equals sign.
    fn value(&mut self, from: usize) -> Told<'a> {
        let at = self.while_at(from, |b| matches!(b, b' ' | b'\t'));
        if self.bytes.get(at) == Some(&b'"') {
            let Some(length) = self.text[at + 1..].find('"') else {
                self.at = self.bytes.len();
                return Told::Fault("text_not_closed");
            };
            self.at = at + 1 + length + 1;
            return Told::Operand(Operand::Text(&self.text[at + 1..at + 1 + length]));
        }
        if let Some(number) = self.number(at) {
            // An operator behind it makes it an expression.
            let next = self.while_at(self.at, |b| matches!(b, b' ' | b'\t'));
            if !matches!(self.bytes.get(next), Some(b'+' | b'-' | b'*' | b'/')) {
                return Told::Operand(Operand::Number(number));
            }
        } else if let Some(inner) = ["IC(", "AC("]
            .into_iter()
            .find(|call| self.text.get(at..at + call.len()).is_some_and(|text| text.eq_ignore_ascii_case(call)))
        {
            let from = self.while_at(at + inner.len(), |b| matches!(b, b' ' | b'\t'));
            if let Some(number) = self.number(from) {
                let close = self.while_at(self.at, |b| matches!(b, b' ' | b'\t'));
                if self.bytes.get(close) == Some(&b')') {
                    self.at = close + 1;
                    let operand = if inner == "IC(" { Operand::Relative(number) } else { Operand::Absolute(number) };
                    return Told::Operand(operand);
                }
            }
        }
        self.at = self.while_at(at, |b| !matches!(b, b' ' | b'\t' | b';')).max(at);
        Told::Fault("variable_in_program")
    }

    /// A name of Siemens with what follows it.
    fn name(&mut self, start: usize) {
        let end = self.while_at(start, |b| b.is_ascii_alphanumeric() || b == b'_');
        let next = self.while_at(end, |b| matches!(b, b' ' | b'\t'));
        match self.bytes.get(next) {
            Some(b'=') => match self.value(next + 1) {
                Told::Operand(operand) => self.push(0, start, end, operand),
                Told::Fault(code) => self.fault(start, self.at.max(end), code),
            },
            Some(b'(') => {
                let Some(close) = closing(self.bytes, next) else {
                    self.fault(start, self.bytes.len(), "text_not_closed");
                    self.at = self.bytes.len();
                    return;
                };
                // The word is the name: what it is called with is not read.
                self.at = end;
                self.push(0, start, end, Operand::Call);
                self.at = close + 1;
            }
            // A label.
            Some(b':') if self.is_head() => self.at = next + 1,
            _ => {
                self.at = end;
                self.push(0, start, end, Operand::Nothing);
            }
        }
    }
}

/// The parenthesis that closes the one at a place; texts in quotes are no parentheses.
fn closing(bytes: &[u8], open: usize) -> Option<usize> {
    let (mut depth, mut is_text) = (0_usize, false);
    for (at, &byte) in bytes.iter().enumerate().skip(open) {
        match byte {
            b'"' => is_text = !is_text,
            b'(' if !is_text => depth += 1,
            b')' if !is_text => {
                depth -= 1;
                if depth == 0 {
                    return Some(at);
                }
            }
            _ => {}
        }
    }
    None
}

#[cfg(test)]
mod tests {
    use super::*;

    fn words(text: &str, dialect: Dialect) -> Vec<(String, f64)> {
        let mut notes = Notes::default();
        let block = block(text, 1, dialect, &mut notes);
        assert_eq!(notes.count(), 0, "{text}");
        block.words.iter().map(|word| (word.name.to_ascii_uppercase(), word.number())).collect()
    }

    fn one(name: &str, value: f64) -> (String, f64) {
        (name.to_owned(), value)
    }

    #[test]
    fn numbers_and_blanks() {
        let packed = [one("G", 1.0), one("X", 40.0), one("Z", -5.0), one("F", 0.2)];
        assert_eq!(words("G1X40.Z-5.F.2", Dialect::FanucA), packed);
        assert_eq!(words("N5 g01 x+040. z -5 F .2 (so)", Dialect::Fanuc), packed);
        assert_eq!(words("g1 x4 0 z- 5 f.\t2", Dialect::LinuxCnc), packed);
        assert_eq!(words("G1 X=40 Z=-5. F=.2 ; so", Dialect::Siemens), packed);
    }

    #[test]
    fn names_of_siemens() {
        let found = words("DIAMON LIMS=3000 CR = 5 X=IC(-4) MSG(\"a (b\") S1=500", Dialect::Siemens);
        let names: Vec<&str> = found.iter().map(|(name, _)| name.as_str()).collect();
        assert_eq!(names, ["DIAMON", "LIMS", "CR", "X", "MSG", "S"]);
        assert!((found[3].1 + 4.0).abs() < 1e-12);
    }

    #[test]
    fn columns_are_those_of_characters() {
        let mut notes = Notes::default();
        block("(±±) #1=2", 7, Dialect::Fanuc, &mut notes);
        let (faults, ..) = notes.into_parts();
        assert_eq!(faults[0].values.get("column"), Some(&6.0.into()));
    }
}
