//! Speeds, feeds and lengths of words.

use super::super::super::job::{DecimalPoint, Dialect};
use super::Reader;
use super::block::{Asked, Once, Words};
use super::faults::Spot;
use super::lexer::{Number, Operand, Word};
use super::moves::Feed;
use super::state::{INCH_MM, Motion};

/// Feet in metres.
pub(super) const FOOT_M: f64 = 0.3048;
/// Increment of a feed per revolution, mm: F20 is 0.20 mm where X100 is 0.100 mm.
const FEED_STEP_MM: f64 = 0.01;

impl<'a> Reader<'a> {
    pub(super) fn speed(&mut self, words: &mut Words<'_, 'a>, asked: &Asked<'a>) {
        let once = asked.once.map(|(once, _)| once);
        if once != Some(Once::Dwell)
            && let Some(word) = words.take(b'S')
        {
            let value = word.number();
            match once {
                Some(Once::Limit) => self.state.limit_rpm = Some(value),
                _ if self.state.is_surface => {
                    let unit = if self.state.inch { FOOT_M } else { 1.0 };
                    self.state.surface_m_per_min = Some(value * unit);
                }
                _ => self.state.rpm = Some(value),
            }
        }
        if self.dialect == Dialect::LinuxCnc
            && self.state.is_surface
            && !asked.is_over_contour()
            && let Some(word) = words.take(b'D')
        {
            self.state.limit_rpm = Some(word.number());
        }
    }

    pub(super) fn feed(&mut self, words: &mut Words<'_, 'a>, asked: &Asked<'a>) {
        let once = asked.once.map(|(once, _)| once);
        let motion = asked.motion.map(|(motion, _)| motion).or(self.state.motion);
        // There F is a pitch, or a time.
        let is_other = matches!(once, Some(Once::ThreadRepeated | Once::Dwell))
            || (once.is_none() && matches!(motion, Some(Motion::Thread | Motion::ThreadCycle)));
        if is_other {
            if once != Some(Once::Dwell) {
                words.take_all("F");
            }
            return;
        }
        let Some(word) = words.take(b'F') else { return self.keep_feed(words, None) };
        let unit = if self.state.feed_inch { INCH_MM } else { 1.0 };
        let Operand::Number(number) = word.operand else {
            return self.notes.fault(word.spot, "word_without_number");
        };
        let is_bare = self.is_fanuc() && !number.has_point && number.value != 0.0;
        // Without a point a feed per minute is mm/min to every Fanuc, one per revolution as the job says; in inches nobody says.
        let is_unclear = is_bare && if self.state.feed_inch { true } else { !self.state.per_minute };
        let step = match self.reading.decimal_point {
            Some(DecimalPoint::AsIncrements) if is_unclear && !self.state.feed_inch => FEED_STEP_MM,
            Some(DecimalPoint::AsUnits) => 1.0,
            _ if is_unclear => {
                self.unclear(word.spot);
                1.0
            }
            _ => 1.0,
        };
        self.keep_feed(words, Some((word, step)));
        let feed = number.value * step * unit;
        self.state.feed = Some(if self.state.per_minute { Feed::PerMinute(feed) } else { Feed::PerRev(feed) });
    }

    pub(super) fn is_fanuc(&self) -> bool {
        matches!(self.dialect, Dialect::Fanuc | Dialect::FanucA | Dialect::FanucC)
    }

    /// The number of a word in the program's unit; without a point it is so many increments, where the job says so.
    fn scaled(&mut self, word: Word<'a>, number: Number) -> f64 {
        if number.has_point || number.value == 0.0 || !self.is_fanuc() {
            return number.value;
        }
        match self.reading.decimal_point {
            Some(DecimalPoint::AsUnits) => number.value,
            Some(DecimalPoint::AsIncrements) => {
                // 0.001 mm or 0.0001 inch.
                let step = if self.state.inch { 0.1 } else { 1.0 } * self.reading.increment_um * 1e-3;
                number.value * step
            }
            None => {
                self.unclear(word.spot);
                number.value
            }
        }
    }

    /// The first word that matters is enough: every other one has the same remedy.
    fn unclear(&mut self, spot: Spot<'a>) {
        if !self.is_unclear {
            self.is_unclear = true;
            self.notes.fault(spot, "decimal_point_unclear");
        }
    }

    /// A length of a word, mm.
    pub(super) fn length(&mut self, word: Word<'a>) -> f64 {
        let unit = if self.state.inch { INCH_MM } else { 1.0 };
        match word.operand {
            Operand::Number(number) | Operand::Relative(number) | Operand::Absolute(number) => {
                self.scaled(word, number) * unit
            }
            Operand::Text(_) | Operand::Call | Operand::Nothing => {
                self.notes.fault(word.spot, "word_without_number");
                0.0
            }
        }
    }
}
