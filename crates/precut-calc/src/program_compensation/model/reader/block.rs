//! One block: modes first, then what it does.

use crate::calculator::Failure;

use super::super::super::job::{DecimalPoint, Dialect};
use super::arcs;
use super::codes::{self, Function, Group, Meaning, Named, Path};
use super::contour::Use;
use super::faults::Spot;
use super::lexer::{Block, Number, Operand, Word};
use super::moves::{Feed, Kind, Place};
use super::state::{INCH_MM, Motion, SingleWords, State, Width};
use super::{Reader, whole};

/// Feet in metres.
pub(super) const FOOT_M: f64 = 0.3048;
/// Increment of a feed per revolution, mm: F20 is 0.20 mm where X100 is 0.100 mm.
const FEED_STEP_MM: f64 = 0.01;

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
enum Once {
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
struct Asked<'a> {
    once: Option<(Once, Spot<'a>)>,
    motion: Option<(Motion, Spot<'a>)>,
    /// A thread or cycle of Siemens that is passed.
    passed: Option<(&'static str, Kind, Spot<'a>)>,
    ends: bool,
    returns: Option<Spot<'a>>,
    takes_tool: bool,
}

impl Asked<'_> {
    /// Whether a cycle over a contour is asked for, whose words are its own.
    fn is_over_contour(&self) -> bool {
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

    fn speed(&mut self, words: &mut Words<'_, 'a>, asked: &Asked<'a>) {
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

    fn feed(&mut self, words: &mut Words<'_, 'a>, asked: &Asked<'a>) {
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

    /// Where the words of the axes lead, of which one at least is there.
    pub(super) fn target(&mut self, words: &mut Words<'_, 'a>) -> Place {
        let from = self.state.place;
        Place { x: self.axis(words, [b'X', b'U'], from.x), z: self.axis(words, [b'Z', b'W'], from.z) }
    }

    fn axis(&mut self, words: &mut Words<'_, 'a>, [absolute, relative]: [u8; 2], from: Option<f64>) -> Option<f64> {
        let by_letter = words.look(absolute).is_none() && self.dialect == Dialect::FanucA;
        let Some(word) = words.take(if by_letter { relative } else { absolute }) else {
            return from;
        };
        let is_relative = match word.operand {
            Operand::Relative(_) => true,
            Operand::Absolute(_) => false,
            _ => by_letter || (self.state.is_relative && self.dialect != Dialect::FanucA),
        };
        let factor = if absolute == b'X' { self.state.to_diameter(is_relative) } else { 1.0 };
        let length = factor * self.length(word);
        if !is_relative {
            return Some(length);
        }
        if from.is_none() {
            self.lost(word.spot);
        }
        from.map(|from| from + length)
    }

    /// The tool is nobody knows where; said once until that is known again.
    pub(super) fn lost(&mut self, spot: Spot<'a>) {
        if !self.is_doubtful {
            self.notes.fault(spot, "position_unknown");
        }
        self.is_doubtful = true;
    }

    /// The first word of an axis.
    pub(super) fn first_axis(words: &Words<'_, 'a>) -> Option<Spot<'a>> {
        words.block.words.iter().find(|word| matches!(word.letter, b'X' | b'Z' | b'U' | b'W')).map(|word| word.spot)
    }

    fn act(&mut self, words: &mut Words<'_, 'a>, asked: &Asked<'a>) -> Result<Option<usize>, Failure> {
        let line = words.block.line;
        // A motion that is named holds on, whatever this block does beside it.
        if let Some((motion, _)) = asked.motion {
            if motion == Motion::Drill && self.state.motion != Some(Motion::Drill) {
                self.state.before_drill = self.state.motion;
            }
            self.state.motion = Some(motion);
        }
        if let Some((code, kind, spot)) = asked.passed {
            self.notes.warn(spot, code);
            words.take_rest();
            // Where such a cycle ends, its own words say.
            self.go(line, kind, Place::default(), None);
            return Ok(None);
        }
        let Some((once, spot)) = asked.once else {
            self.move_by(words, asked);
            return Ok(None);
        };
        match once {
            Once::Dwell => {
                words.take_all("XUPFS");
                self.go(line, Kind::Dwell, self.state.place, None);
            }
            Once::Home => self.home(words, true),
            Once::MachinePlace => self.home(words, false),
            Once::Limit => {
                words.take_all("PQ");
            }
            Once::ThreadRepeated => {
                self.notes.warn(spot, "thread_passed");
                words.take_rest();
                self.go(line, Kind::Thread, self.state.place, None);
            }
            Once::Groove => {
                self.notes.warn(spot, "cycle_passed");
                words.take_rest();
                self.go(line, Kind::Opaque, self.state.place, None);
            }
            Once::RoughAlong => return self.rough(words, spot, Use::RoughZ),
            Once::RoughAcross => return self.rough(words, spot, Use::RoughX),
            Once::Pattern => return self.rough(words, spot, Use::Pattern),
            Once::Finish => return self.finish(words, spot),
        }
        Ok(None)
    }

    /// To a place of the machine. The axes that are named are then the control's business alone, all of them if none is.
    fn home(&mut self, words: &mut Words<'_, 'a>, by_way: bool) {
        let line = words.block.line;
        let named = |letters: [u8; 2]| letters.iter().any(|&letter| words.look(letter).is_some());
        let (x, z) = (named([b'X', b'U']), named([b'Z', b'W']));
        let (x, z) = if x || z { (x, z) } else { (true, true) };
        let before = self.state.place;
        // To the point that the words say, and home from there. Siemens' words say the point itself.
        if by_way && self.dialect != Dialect::Siemens {
            let was_doubtful = std::mem::replace(&mut self.is_doubtful, true);
            let way = self.target(words);
            self.is_doubtful = was_doubtful;
            if way != before {
                self.go(line, Kind::Rapid, way, None);
            }
        }
        words.take_all("XZUW");
        let after = self.state.place;
        let place = Place { x: after.x.filter(|_| !x), z: after.z.filter(|_| !z) };
        self.go(line, Kind::Home, place, None);
    }

    fn move_by(&mut self, words: &mut Words<'_, 'a>, asked: &Asked<'a>) {
        let Some(first) = Self::first_axis(words) else {
            // A full circle names no end; a cycle without an end of its own does nothing.
            if let Some((Motion::Path(path @ (Path::Clockwise | Path::CounterClockwise)), spot)) = asked.motion
                && (words.look(b'I').is_some() || words.look(b'K').is_some())
            {
                self.path_to(words, asked, path, spot);
            }
            return;
        };
        let Some(motion) = self.state.motion else {
            if !self.is_doubtful {
                self.notes.fault(first, "motion_not_said");
            }
            words.take_rest();
            return;
        };
        let line = words.block.line;
        self.assume_modes(first);
        match motion {
            Motion::Path(path) => self.path_to(words, asked, path, first),
            Motion::Thread => {
                self.warn_named(asked, "thread_passed");
                let end = self.target(words);
                words.take_rest();
                self.go(line, Kind::Thread, end, None);
            }
            Motion::ThreadCycle => {
                self.warn_named(asked, "thread_passed");
                words.take_rest();
                self.go(line, Kind::Thread, self.state.place, None);
            }
            Motion::Drill => {
                self.warn_named(asked, "cycle_passed");
                words.take_rest();
                self.go(line, Kind::Opaque, self.state.place, None);
            }
            Motion::Nowhere => {
                if !self.is_doubtful {
                    self.notes.fault(first, "motion_not_said");
                }
                words.take_rest();
            }
            Motion::Single { across, words: kept } => {
                self.single(words, first, (across, asked.motion.is_some()), kept);
            }
        }
    }

    fn warn_named(&mut self, asked: &Asked<'a>, code: &'static str) {
        if let Some((_, spot)) = asked.motion {
            self.notes.warn(spot, code);
        }
    }

    /// Says what the first motion takes for granted.
    fn assume_modes(&mut self, spot: Spot<'a>) {
        let said = self.state.said;
        if !said.units {
            self.notes.assume(spot, "units", "mm");
        }
        if !said.plane {
            self.notes.assume(spot, "plane", "G18");
        }
        if !said.width {
            self.notes.assume(spot, "x_words", "diameter");
        }
    }

    /// Whether a move at the feed can be read: it needs a place to begin at, and a feed.
    pub(super) fn may_cut(&mut self, spot: Spot<'a>, end: Place) -> bool {
        if self.state.place.known().is_none() || end.known().is_none() {
            self.lost(spot);
            return false;
        }
        if !self.state.said.feed_mode {
            self.notes.assume(spot, "feed_mode", if self.state.per_minute { "per_min" } else { "per_rev" });
        }
        if self.state.tool.is_none() {
            let named = self.reading.tool.clone().map(|name| self.tool_named(name));
            self.state.tool = named;
            if named.is_none() {
                self.notes.assume(spot, "tool", "none");
            }
        }
        let is_roughed = matches!(self.contour, Some(Use::RoughZ | Use::RoughX | Use::Pattern));
        if self.state.feed.is_none() && !is_roughed {
            if !self.is_doubtful {
                self.notes.fault(spot, "feed_missing");
            }
            // Once is enough: nothing comes of a program with a fault.
            self.state.feed = Some(Feed::PerRev(1.0));
        }
        true
    }

    fn path_to(&mut self, words: &mut Words<'_, 'a>, asked: &Asked<'a>, path: Path, spot: Spot<'a>) {
        let line = words.block.line;
        let end = self.target(words);
        let before = self.moves.len();
        match path {
            Path::Rapid => self.go(line, Kind::Rapid, end, None),
            Path::Line => {
                if self.may_cut(spot, end) {
                    self.go(line, Kind::Line, end, None);
                }
            }
            Path::Clockwise | Path::CounterClockwise => {
                let of_arc = self.centre(words, asked, end, path);
                if self.may_cut(spot, end)
                    && let Some(centre) = of_arc
                {
                    let kind = if path == Path::Clockwise { Kind::ArcCw } else { Kind::ArcCcw };
                    self.go(line, kind, end, Some([2.0 * centre[0], centre[1]]));
                }
            }
        }
        if self.moves.len() > before {
            self.keep_words(words, asked.motion.is_some());
        }
        if end.known().is_some() {
            // A later fault is one of its own.
            self.is_doubtful = false;
        }
        self.state.place = end;
    }

    /// Centre of an arc: radius and z, mm.
    fn centre(&mut self, words: &mut Words<'_, 'a>, asked: &Asked<'a>, end: Place, path: Path) -> Option<[f64; 2]> {
        let radius = match self.dialect {
            Dialect::Siemens => words.block.words.iter().find(|word| word.is_named("CR")).copied(),
            _ => words.take(b'R'),
        };
        let (i, k) = (words.take(b'I'), words.take(b'K'));
        let spot = radius.or(i).or(k).map(|word| word.spot).or(asked.motion.map(|(_, spot)| spot));
        let spot = spot.or_else(|| Self::first_axis(words))?;
        let i_mm = i.map(|word| (word, self.length(word)));
        let k_mm = k.map(|word| (word, self.length(word)));
        let radius_mm = radius.map(|word| self.length(word));
        let ([x0, z0], [x1, z1]) = (self.state.place.known()?, end.known()?);
        let (from, to) = ([0.5 * x0, z0], [0.5 * x1, z1]);
        match (radius_mm, i_mm, k_mm) {
            (Some(radius), None, None) if arcs::are_apart(from, to) => {
                let found = arcs::centre_of_radius(from, to, radius, path);
                if found.is_none() {
                    self.notes.fault(spot, "arc_radius_too_small");
                }
                found
            }
            (None, i, k) if i.is_some() || k.is_some() => {
                let absolute = self.state.centre_absolute;
                let of = |given: Option<(Word<'a>, f64)>, start: f64| match given {
                    Some((word, length)) if absolute || matches!(word.operand, Operand::Absolute(_)) => length,
                    Some((_, length)) => start + length,
                    // An absolute centre needs both words; one that is left out of a relative one is 0.
                    None => start,
                };
                let centre = [of(i, from[0]), of(k, from[1])];
                if !arcs::fits(from, to, centre) {
                    self.notes.fault(spot, "arc_radius_mismatch");
                    return None;
                }
                Some(centre)
            }
            _ => {
                self.notes.fault(spot, "arc_not_defined");
                None
            }
        }
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
