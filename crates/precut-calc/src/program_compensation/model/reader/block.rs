//! One block: modes first, then what it does.

use crate::calculator::Failure;

use super::super::super::job::Dialect;
use super::codes::{self, Function, Group, Meaning, Named, Path};
use super::faults::Spot;
use super::lexer::{Block, Operand, Word};
use super::moves::Kind;
use super::state::{Motion, SingleWords, State, Width};
use super::{Reader, whole};

/// The words of a block, and which of them have been used.
pub(super) struct Words<'b, 'a> {
    pub(super) block: &'b Block<'a>,
    used: Vec<bool>,
}

impl<'b, 'a> Words<'b, 'a> {
    fn of(block: &'b Block<'a>) -> Self {
        Self { block, used: vec![false; block.words.len()] }
    }

    /// The word of this letter, which is used then.
    pub(super) fn take(&mut self, letter: u8) -> Option<Word<'a>> {
        let index = (0..self.used.len()).find(|&i| !self.used[i] && self.block.words[i].letter == letter)?;
        self.used[index] = true;
        Some(self.block.words[index])
    }

    /// The word of this letter.
    pub(super) fn look(&self, letter: u8) -> Option<Word<'a>> {
        self.block.words.iter().find(|word| word.letter == letter).copied()
    }

    /// Uses all words of these letters.
    pub(super) fn take_all(&mut self, letters: &str) {
        for (word, used) in self.block.words.iter().zip(&mut self.used) {
            *used |= letters.as_bytes().contains(&word.letter);
        }
    }

    /// Uses every word.
    pub(super) fn take_rest(&mut self) {
        self.used.fill(true);
    }

    fn rest(&self) -> impl Iterator<Item = Word<'a>> {
        let words = self.block.words.iter().zip(&self.used);
        words.filter(|(_, used)| !**used).map(|(word, _)| *word)
    }
}

/// What a block does once.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Once {
    Dwell,
    Home,
    MachinePlace,
    Limit,
    ThreadRepeated,
    Groove,
    RoughAlong,
    RoughAcross,
    Pattern,
    Finish,
}

/// What the codes of a block ask for beside modes.
#[derive(Default)]
pub(super) struct Asked<'a> {
    pub(super) once: Option<(Once, Spot<'a>)>,
    pub(super) motion: Option<(Motion, Spot<'a>)>,
    /// A thread or cycle of Siemens that is passed.
    pub(super) passed: Option<(&'static str, Kind, Spot<'a>)>,
    pub(super) ends: bool,
    pub(super) returns: Option<Spot<'a>>,
    pub(super) takes_tool: bool,
}

impl Asked<'_> {
    /// Whether a cycle over a contour is asked for, whose words are its own.
    pub(super) fn is_over_contour(&self) -> bool {
        let once = self.once.map(|(once, _)| once);
        matches!(once, Some(Once::RoughAlong | Once::RoughAcross | Once::Finish))
    }
}

impl<'a> Reader<'a> {
    /// Runs a block; gives the line that comes next where that is not the next one.
    pub(super) fn execute(&mut self, block: &Block<'a>) -> Result<Option<usize>, Failure> {
        if block.is_faulty {
            self.is_doubtful = true;
            return Ok(None);
        }
        let before = self.notes.count();
        let mut words = Words::of(block);
        self.refuse_twice(block);
        let mut asked = Asked::default();
        self.codes(&mut words, &mut asked);
        self.names(&mut words, &mut asked);
        self.functions(&mut words, &mut asked);
        self.tool(&mut words, &asked);
        if self.notes.count() > before {
            self.is_doubtful = true;
            return Ok(None);
        }
        self.speed(&mut words, &asked);
        self.feed(&mut words, &asked);
        let next = self.act(&mut words, &asked)?;
        self.refuse_unused(&words, &asked);
        if let Some(spot) = asked.returns {
            self.end_of_subprogram(spot, block.line);
        }
        self.is_over |= asked.ends;
        self.is_doubtful |= self.notes.count() > before;
        Ok(next)
    }

    fn refuse_twice(&mut self, block: &Block<'a>) {
        for (i, word) in block.words.iter().enumerate() {
            if matches!(word.letter, b'G' | b'M' | 0) {
                continue;
            }
            let same = |other: &Word<'_>| match (self.dialect, word.letter) {
                (Dialect::FanucA, b'X' | b'U') => matches!(other.letter, b'X' | b'U'),
                (Dialect::FanucA, b'Z' | b'W') => matches!(other.letter, b'Z' | b'W'),
                _ => other.letter == word.letter,
            };
            if block.words[..i].iter().any(same) {
                self.notes.fault(word.spot, "word_twice");
            }
        }
    }

    fn codes(&mut self, words: &mut Words<'_, 'a>, asked: &mut Asked<'a>) {
        let mut groups: Vec<Group> = Vec::new();
        while let Some(word) = words.take(b'G') {
            let spot = word.spot;
            let Some(meaning) = codes::tenths(word.number()).and_then(|tenths| codes::meaning(self.dialect, tenths))
            else {
                self.notes.fault(spot, "unknown_g");
                continue;
            };
            if let Some(group) = self.group(meaning) {
                if groups.contains(&group) {
                    self.notes.fault(spot, "modal_group_twice");
                    continue;
                }
                groups.push(group);
            }
            self.mean(meaning, spot, words, asked);
        }
    }

    fn group(&self, meaning: Meaning) -> Option<Group> {
        match meaning {
            Meaning::Drill | Meaning::NoMotion if self.is_fanuc() => Some(Group::Drilling),
            _ => meaning.group(),
        }
    }

    fn mean(&mut self, meaning: Meaning, spot: Spot<'a>, words: &mut Words<'_, 'a>, asked: &mut Asked<'a>) {
        match meaning {
            Meaning::Path(path) => asked.motion = Some((Motion::Path(path), spot)),
            Meaning::Thread => asked.motion = Some((Motion::Thread, spot)),
            Meaning::Along | Meaning::Across => {
                let across = meaning == Meaning::Across;
                asked.motion = Some((Motion::Single { across, words: SingleWords::default() }, spot));
            }
            Meaning::ThreadCycle => asked.motion = Some((Motion::ThreadCycle, spot)),
            Meaning::Drill => asked.motion = Some((Motion::Drill, spot)),
            // To a Fanuc it ends drilling and nothing else.
            Meaning::NoMotion if self.is_fanuc() => {
                if self.state.motion == Some(Motion::Drill) {
                    self.state.motion = self.state.before_drill;
                }
            }
            Meaning::NoMotion => asked.motion = Some((Motion::Nowhere, spot)),
            Meaning::ThreadRepeated => asked.once = Some((Once::ThreadRepeated, spot)),
            Meaning::Groove => asked.once = Some((Once::Groove, spot)),
            Meaning::RoughAlong => asked.once = Some((Once::RoughAlong, spot)),
            Meaning::RoughAcross => asked.once = Some((Once::RoughAcross, spot)),
            Meaning::RoughPattern => asked.once = Some((Once::Pattern, spot)),
            Meaning::Finish => asked.once = Some((Once::Finish, spot)),
            Meaning::Dwell => asked.once = Some((Once::Dwell, spot)),
            Meaning::Home => asked.once = Some((Once::Home, spot)),
            Meaning::MachinePlace => asked.once = Some((Once::MachinePlace, spot)),
            Meaning::LimitOrShift => {
                if b"XZUW".iter().any(|&letter| words.look(letter).is_some()) {
                    self.notes.fault(spot, "offset_change");
                }
                asked.once = Some((Once::Limit, spot));
            }
            // With an axis it limits where the tool may go.
            Meaning::UpperLimit => {
                words.take_all("XZ");
                asked.once = words.look(b'S').map(|_| (Once::Limit, spot));
            }
            Meaning::Absolute => self.state.is_relative = false,
            Meaning::Relative => self.state.is_relative = true,
            Meaning::FeedPerMinute | Meaning::FeedPerRev => self.feed_mode(meaning == Meaning::FeedPerMinute),
            Meaning::Inch(feeds) | Meaning::Millimetre(feeds) => {
                let is_inch = matches!(meaning, Meaning::Inch(_));
                if !feeds && self.state.feed_inch != is_inch {
                    self.notes.warn(spot, "feed_unit_not_switched");
                }
                self.state.inch = is_inch;
                self.state.said.units = true;
                if feeds {
                    self.state.feed_inch = is_inch;
                }
            }
            Meaning::PlaneOfTurning => self.state.said.plane = true,
            Meaning::Nose(nose) => self.state.nose = nose,
            Meaning::SurfaceSpeed => {
                self.state.is_surface = true;
                // There it is a feed per revolution as well.
                if self.dialect == Dialect::Siemens {
                    self.feed_mode(false);
                }
            }
            Meaning::SpindleSpeed => {
                // It goes on as fast as it happens to go, which nobody can know here.
                if self.state.is_surface {
                    self.state.rpm = None;
                }
                self.state.is_surface = false;
            }
            Meaning::Diameter | Meaning::Radius => {
                self.state.width = if meaning == Meaning::Diameter { Width::Diameter } else { Width::Radius };
                self.state.said.width = true;
            }
            Meaning::CentreAbsolute | Meaning::CentreRelative => {
                self.state.centre_absolute = meaning == Meaning::CentreAbsolute;
            }
            // Another zero moves the work under the program by what the control alone knows.
            Meaning::Zero(zero) => match self.state.zero {
                Some(before) if before != zero => self.notes.fault(spot, "offset_change"),
                _ => self.state.zero = Some(zero),
            },
            Meaning::Neutral(letters) => words.take_all(letters),
            Meaning::Refused(code) => {
                self.notes.fault(spot, code);
                words.take_rest();
            }
        }
    }

    /// A feed is said anew when what it means changes.
    fn feed_mode(&mut self, per_minute: bool) {
        if self.state.per_minute != per_minute {
            self.state.feed = None;
        }
        self.state.per_minute = per_minute;
        self.state.said.feed_mode = true;
    }

    fn names(&mut self, words: &mut Words<'_, 'a>, asked: &mut Asked<'a>) {
        while let Some(word) = words.take(0) {
            // Its number is used where the path is.
            if word.is_named("CR") {
                continue;
            }
            let (called, set) =
                (word.operand == Operand::Call, !matches!(word.operand, Operand::Call | Operand::Nothing));
            match codes::named(word.name, called, set) {
                Named::Diameter => self.width(Width::Diameter),
                Named::Radius => self.width(Width::Radius),
                Named::DiameterOfAbsolute => self.width(Width::DiameterOfAbsolute),
                Named::MachinePlace => asked.once = Some((Once::MachinePlace, word.spot)),
                Named::SpeedLimit => self.state.limit_rpm = Some(word.number()),
                Named::CircleRadius | Named::Neutral => {}
                Named::Passed(code, kind) => asked.passed = Some((code, kind, word.spot)),
                Named::Return => asked.returns = Some(word.spot),
                Named::Refused(code) => {
                    self.notes.fault(word.spot, code);
                    words.take_rest();
                }
            }
        }
        // L100 calls a program; a parameter needs no equals sign to be read.
        if self.dialect == Dialect::Siemens
            && let Some(word) = words.take(b'L')
        {
            self.notes.fault(word.spot, "subprogram");
            words.take_rest();
        }
    }

    fn width(&mut self, width: Width) {
        self.state.width = width;
        self.state.said.width = true;
    }

    fn functions(&mut self, words: &mut Words<'_, 'a>, asked: &mut Asked<'a>) {
        while let Some(word) = words.take(b'M') {
            match codes::function(self.dialect, word.number()) {
                Function::Known => {}
                Function::TakeTool => asked.takes_tool = true,
                Function::End => asked.ends = true,
                Function::Return if words.look(b'P').is_none() => asked.returns = Some(word.spot),
                Function::Return | Function::Call => {
                    self.notes.fault(word.spot, "subprogram");
                    words.take_rest();
                }
                Function::Unknown => {
                    let number = word.number().to_bits();
                    if !self.unknown_functions.contains(&number) {
                        self.unknown_functions.push(number);
                        self.notes.warn(word.spot, "unknown_m");
                    }
                }
            }
        }
    }

    fn tool(&mut self, words: &mut Words<'_, 'a>, asked: &Asked<'a>) {
        if let Some(word) = words.take(b'T') {
            let called = self.tool_of(word);
            match self.dialect {
                Dialect::LinuxCnc => self.state.next_tool = called.or(self.state.next_tool),
                _ => self.state.tool = called.or(self.state.tool),
            }
        }
        if asked.takes_tool {
            self.state.tool = self.state.next_tool.or(self.state.tool);
        }
        if self.dialect == Dialect::Siemens || self.dialect == Dialect::LinuxCnc {
            // Offsets: D of Siemens, and D of LinuxCNC where it is no limit of the speed.
            let is_limit = self.dialect == Dialect::LinuxCnc && self.state.is_surface;
            if !is_limit && !asked.is_over_contour() {
                words.take_all("D");
            }
        }
    }

    /// Which tool a word calls; `None` where it calls none.
    fn tool_of(&mut self, word: Word<'a>) -> Option<u32> {
        if let Operand::Text(name) = word.operand {
            return Some(self.tool_named(name.to_owned()));
        }
        let number = whole(word.number())?;
        let digits = word.spot.word.chars().filter(char::is_ascii_digit).count();
        // The last two digits are the number of the offset.
        let number = if self.is_fanuc() && digits > 2 { number / 100 } else { number };
        (number > 0).then(|| self.tool_named(number.to_string()))
    }

    pub(super) fn tool_named(&mut self, name: String) -> u32 {
        let index = self.tools.iter().position(|tool| *tool == name).unwrap_or_else(|| {
            self.tools.push(name);
            self.tools.len() - 1
        });
        // As many as there are lines at most.
        u32::try_from(index).unwrap_or(u32::MAX)
    }

    /// Words that nothing used mean something that is not read.
    fn refuse_unused(&mut self, words: &Words<'_, 'a>, asked: &Asked<'a>) {
        let is_cut = asked.once.is_none()
            && matches!(self.state.motion, Some(Motion::Path(Path::Line | Path::Clockwise | Path::CounterClockwise)));
        for word in words.rest() {
            let is_fanuc = self.is_fanuc();
            let code = match word.letter {
                b'R' | b'I' | b'K' | b'A' | b'C' if is_fanuc && is_cut => "drawing_dimension",
                b'A' | b'B' | b'C' | b'Y' | b'V' | b'U' | b'W' => "axis_not_turned",
                b'H' if is_fanuc => "axis_not_turned",
                _ => "word_not_used",
            };
            self.notes.fault(word.spot, code);
        }
    }

    /// The end of a program that others call is the end of what is read; before it, a return is a jump.
    fn end_of_subprogram(&mut self, spot: Spot<'a>, line: usize) {
        if self.contour.is_some() || (line..self.extent.end).any(|at| self.says_something(at)) {
            self.notes.fault(spot, "subprogram");
        }
        self.is_over = true;
    }

    /// The state as it is now, to be put back.
    pub(super) fn kept(&self) -> State {
        self.state.clone()
    }
}
