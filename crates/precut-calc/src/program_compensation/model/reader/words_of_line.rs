//! Where in the text a line says where its move ends, so that it can be made to end elsewhere (`program/6`).

use std::ops::Range;

use super::super::super::job::DecimalPoint;
use super::Reader;
use super::block::Words;
use super::lexer::{Operand, Word};
use super::state::INCH_MM;

/// A number in the text.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct NumberInText {
    /// Its bytes.
    pub(crate) range: Range<usize>,
    /// Whether it counts from where the tool is.
    pub(crate) is_relative: bool,
    /// What one of it is, with a decimal point: of X on the diameter, mm.
    pub(crate) unit_mm: f64,
    /// What one of it is without a point, where that is so many increments, mm.
    pub(crate) step_mm: Option<f64>,
}

/// The words of a line that makes one move along a path.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct WordsOfLine {
    /// Which of the moves of the program.
    pub(crate) mv: usize,
    pub(crate) x: Option<NumberInText>,
    pub(crate) z: Option<NumberInText>,
    /// The word of the radius of an arc.
    pub(crate) radius: Option<Range<usize>>,
    /// Whether its arc is told by a centre.
    pub(crate) has_centre: bool,
    /// Where a word of X is put in, in bytes of the text.
    pub(crate) put_in_at: usize,
    /// Whether words count from where the tool is unless they say otherwise.
    pub(crate) is_relative: bool,
    /// What one of an absolute word of X and of Z is, mm.
    pub(crate) unit_x_mm: f64,
    pub(crate) unit_z_mm: f64,
    /// Whether it has words that act at the end of the block.
    pub(crate) ends_something: bool,
}

/// Functions that act when the motion of their block is over.
const AT_END: [f64; 6] = [0.0, 1.0, 2.0, 5.0, 9.0, 30.0];

impl<'a> Reader<'a> {
    /// Keeps the words of a line that has just made a move. A line that makes one twice is kept as such.
    pub(super) fn keep_words(&mut self, words: &Words<'_, 'a>) {
        let line = words.block.line;
        let is_again = self.contour.is_some() || self.words_of_lines.contains_key(&line);
        let Some(mv) = self.moves.len().checked_sub(1).filter(|_| !is_again) else {
            self.words_of_lines.insert(line, None);
            return;
        };
        let by_letter = |letter: u8| words.look(letter);
        let x = by_letter(b'X').or_else(|| by_letter(b'U'));
        let z = by_letter(b'Z').or_else(|| by_letter(b'W'));
        let in_text = |word: Word<'a>| self.range_of(word);
        let named = words.block.words.iter().find(|word| word.is_named("CR")).copied();
        let radius = by_letter(b'R').or(named);
        let last = words.block.words.iter().map(|word| self.range_of(*word).end).max();
        let put_in_at = z.map(|word| self.offset(word.spot.word)).or(last).unwrap_or(0);
        let unit = if self.state.inch { INCH_MM } else { 1.0 };
        let ends_something =
            words.block.words.iter().any(|word| {
                word.letter == b'M' && AT_END.iter().any(|function| (word.number() - function).abs() < 1e-9)
            });
        let kept = WordsOfLine {
            mv,
            x: x.and_then(|word| self.number_of(word, true)),
            z: z.and_then(|word| self.number_of(word, false)),
            radius: radius.map(in_text),
            has_centre: by_letter(b'I').is_some() || by_letter(b'K').is_some(),
            put_in_at,
            is_relative: self.state.is_relative && self.dialect != super::Dialect::FanucA,
            unit_x_mm: unit * self.state.to_diameter(false),
            unit_z_mm: unit,
            ends_something,
        };
        self.words_of_lines.insert(line, Some(kept));
    }

    /// Where a piece of the text stands in it.
    fn offset(&self, piece: &str) -> usize {
        (piece.as_ptr() as usize).wrapping_sub(self.text.as_ptr() as usize)
    }

    fn range_of(&self, word: Word<'a>) -> Range<usize> {
        let from = self.offset(word.spot.word);
        from..from + word.spot.word.len()
    }

    fn number_of(&self, word: Word<'a>, is_x: bool) -> Option<NumberInText> {
        let (number, is_relative) = match word.operand {
            Operand::Number(number) => {
                let by_letter = matches!(word.letter, b'U' | b'W');
                let by_mode = self.state.is_relative && self.dialect != super::Dialect::FanucA;
                (number, by_letter || by_mode)
            }
            Operand::Relative(number) => (number, true),
            Operand::Absolute(number) => (number, false),
            _ => return None,
        };
        let text = word.spot.word;
        // Behind an equals sign, where there is one: what stands before it is an index.
        let head = text.find('=').unwrap_or(1);
        let is_of_number = |c: char| c.is_ascii_digit() || matches!(c, '.' | '+' | '-');
        let from = head + text.get(head..)?.find(is_of_number)?;
        let to = text.rfind(|c: char| c.is_ascii_digit() || c == '.')? + 1;
        let start = self.offset(text);
        let unit = if self.state.inch { INCH_MM } else { 1.0 };
        let factor = if is_x { self.state.to_diameter(is_relative) } else { 1.0 };
        let as_increments = self.is_fanuc() && self.reading.decimal_point == Some(DecimalPoint::AsIncrements);
        let step = if self.state.inch { 0.1 } else { 1.0 } * self.reading.increment_um * 1e-3;
        Some(NumberInText {
            range: start + from..start + to,
            is_relative,
            unit_mm: unit * factor,
            step_mm: (as_increments && !number.has_point).then_some(step * unit * factor),
        })
    }
}
