//! Where in the text a line says where its move ends, so that it can be made to end elsewhere (`program/6`).

use std::ops::Range;

use super::super::super::job::DecimalPoint;
use super::Reader;
use super::block::Words;
use super::lexer::{Block, Operand, Word};
use super::moves::Speed;
use super::state::INCH_MM;
use super::values::FOOT_M;

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
    /// The words of the centre of an arc that is told by one: along the radius and along the axis.
    pub(crate) centre: [Option<NumberInText>; 2],
    /// Whether a centre counts from program zero unless its words say otherwise.
    pub(crate) is_centre_absolute: bool,
    /// Where a word of X is put in, in bytes of the text.
    pub(crate) put_in_at: usize,
    /// Whether words count from where the tool is unless they say otherwise.
    pub(crate) is_relative: bool,
    /// What one of an absolute word of X and of Z is, mm.
    pub(crate) unit_x_mm: f64,
    pub(crate) unit_z_mm: f64,
    /// Its words that act at the end of the block.
    pub(crate) at_end: Vec<Range<usize>>,
    /// Whether it names its motion, whatever the line before it did.
    pub(crate) names_motion: bool,
}

/// A cycle that a line of its own calls, and that may be written out as its moves.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Call {
    /// Line of the call, from 1.
    pub(crate) line: usize,
    /// Its moves.
    pub(crate) moves: Range<usize>,
    /// Speed that holds before it; none where its line says one.
    pub(crate) speed_before: Option<Speed>,
    /// What one of a word of X, of Z and of a feed is, and of a speed of the surface, mm and m/min.
    pub(crate) unit_x_mm: f64,
    pub(crate) unit_z_mm: f64,
    pub(crate) unit_of_feed: f64,
    pub(crate) unit_of_speed: f64,
    /// Whether its line names the cycle, whatever the line before it did.
    pub(crate) names_motion: bool,
    /// Whether its line has nothing but the cycle in it.
    pub(crate) is_plain: bool,
}

/// Where a line says its feed, or would.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct FeedOfLine {
    /// Its number; none where the line says none.
    pub(crate) number: Option<NumberInText>,
    /// Where a word of the feed is put in: behind its last word.
    pub(crate) put_in_at: usize,
    /// What one of a feed is, mm.
    pub(crate) unit_mm: f64,
}

/// What a number is.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Axis {
    X,
    Z,
    /// Of a centre, on the radius or along the axis.
    Centre,
}

/// Functions that act when the motion of their block is over.
const AT_END: [f64; 6] = [0.0, 1.0, 2.0, 5.0, 9.0, 30.0];

/// Whether a block says where the tool goes, how fast, and nothing else.
pub(super) fn says_way_alone(block: &Block<'_>) -> bool {
    block.words.iter().all(|word| b"GPQXZUWRIKFS".contains(&word.letter))
}

impl<'a> Reader<'a> {
    /// Keeps the words of a line that has just made a move. A line that makes one twice is kept as such.
    pub(super) fn keep_words(&mut self, words: &Words<'_, 'a>, names_motion: bool) {
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
        let acts_at_end = |word: &&Word<'a>| {
            word.letter == b'M' && AT_END.iter().any(|function| (word.number() - function).abs() < 1e-9)
        };
        let at_end = words.block.words.iter().filter(acts_at_end).map(|word| self.range_of(*word)).collect();
        let kept = WordsOfLine {
            mv,
            x: x.and_then(|word| self.number_of(word, Axis::X)),
            z: z.and_then(|word| self.number_of(word, Axis::Z)),
            radius: radius.map(in_text),
            centre: [b'I', b'K'].map(|letter| by_letter(letter).and_then(|word| self.number_of(word, Axis::Centre))),
            is_centre_absolute: self.state.centre_absolute,
            put_in_at,
            is_relative: self.state.is_relative && self.dialect != super::Dialect::FanucA,
            unit_x_mm: unit * self.state.to_diameter(false),
            unit_z_mm: unit,
            at_end,
            names_motion,
        };
        self.words_of_lines.insert(line, Some(kept));
    }

    /// Keeps where a line says the feed, or may: not the pitch of a thread, nor a time.
    pub(super) fn keep_feed(&mut self, words: &Words<'_, 'a>, word: Option<(Word<'a>, f64)>) {
        let Some(put_in_at) = words.block.words.iter().map(|word| self.range_of(*word).end).max() else { return };
        let unit_mm = if self.state.feed_inch { INCH_MM } else { 1.0 };
        let number = word.and_then(|(word, step)| {
            let step_mm = (step < 1.0).then_some(step);
            Some(NumberInText { range: self.range_of_number(word)?, is_relative: false, unit_mm, step_mm })
        });
        self.feeds_of_lines.insert(words.block.line, FeedOfLine { number, put_in_at, unit_mm });
    }

    /// Keeps a cycle whose moves have just been made, from the first one on.
    pub(super) fn keep_call(
        &mut self,
        words: &Words<'_, 'a>,
        (first, speed_before): (usize, Option<Speed>),
        names_motion: bool,
    ) {
        let block = words.block;
        let codes = block.words.iter().filter(|word| word.letter == b'G').count();
        let is_absolute = !self.state.is_relative || self.dialect == super::Dialect::FanucA;
        let is_plain = says_way_alone(block) && codes <= 1 && !block.has_stroke && is_absolute;
        let unit = if self.state.inch { INCH_MM } else { 1.0 };
        self.calls.push(Call {
            line: block.line,
            moves: first..self.moves.len(),
            speed_before: speed_before.filter(|_| words.look(b'S').is_none()),
            unit_x_mm: unit * self.state.to_diameter(false),
            unit_z_mm: unit,
            unit_of_feed: if self.state.feed_inch { INCH_MM } else { 1.0 },
            unit_of_speed: if self.state.inch { FOOT_M } else { 1.0 },
            names_motion,
            is_plain: is_plain && self.contour.is_none(),
        });
    }

    /// Where a piece of the text stands in it.
    fn offset(&self, piece: &str) -> usize {
        (piece.as_ptr() as usize).wrapping_sub(self.text.as_ptr() as usize)
    }

    fn range_of(&self, word: Word<'a>) -> Range<usize> {
        let from = self.offset(word.spot.word);
        from..from + word.spot.word.len()
    }

    /// The bytes of the number of a word.
    fn range_of_number(&self, word: Word<'a>) -> Option<Range<usize>> {
        let text = word.spot.word;
        // Behind an equals sign, where there is one: what stands before it is an index.
        let head = text.find('=').unwrap_or(1);
        let is_of_number = |c: char| c.is_ascii_digit() || matches!(c, '.' | '+' | '-');
        let from = head + text.get(head..)?.find(is_of_number)?;
        let to = text.rfind(|c: char| c.is_ascii_digit() || c == '.')? + 1;
        let start = self.offset(text);
        Some(start + from..start + to)
    }

    fn number_of(&self, word: Word<'a>, axis: Axis) -> Option<NumberInText> {
        let (number, is_relative) = match word.operand {
            Operand::Number(number) => {
                let by_letter = matches!(word.letter, b'U' | b'W');
                let by_mode = self.state.is_relative && self.dialect != super::Dialect::FanucA;
                (number, if axis == Axis::Centre { !self.state.centre_absolute } else { by_letter || by_mode })
            }
            Operand::Relative(number) => (number, true),
            Operand::Absolute(number) => (number, false),
            _ => return None,
        };
        let range = self.range_of_number(word)?;
        let unit = if self.state.inch { INCH_MM } else { 1.0 };
        let factor = if axis == Axis::X { self.state.to_diameter(is_relative) } else { 1.0 };
        let as_increments = self.is_fanuc() && self.reading.decimal_point == Some(DecimalPoint::AsIncrements);
        let step = if self.state.inch { 0.1 } else { 1.0 } * self.reading.increment_um * 1e-3;
        Some(NumberInText {
            range,
            is_relative,
            unit_mm: unit * factor,
            step_mm: (as_increments && !number.has_point).then_some(step * unit * factor),
        })
    }
}
