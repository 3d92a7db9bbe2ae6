//! Programs as G-code.
//!
//! The choices per dialect:
//!
//! | | Fanuc (lathe) | Siemens (Sinumerik, ISO mode off) | LinuxCNC |
//! |---|---|---|---|
//! | frame | `%` at both ends, as the controls read in; no `O`: the number is chosen at the machine | none | none |
//! | comment | `(...)` | `; ...` | `(...)` |
//! | millimetres | `G21`; system C: `G71` | `G710`, `G21` is unknown there | `G21` |
//! | absolute, per revolution | systems B, C: `G90 G95`; system A: by the letters X and Z, `G99` | `G90 G95` | `G90 G95` |
//! | diameters | always | `DIAMON` | `G7` |
//! | path | exact enough by default | exact enough by default | `G64 P` one increment: bare `G64` may cut corners |
//! | speed limit | systems B, C: `G92 S`; system A: `G50 S` | `LIMS=` | `G96 D` |
//! | tool | `T0303`: number and offset | `T3 D1` | `T3 M6`, `G43` for the offset |
//! | stop | `M5`, then `M0` | `M5`, then `M0` | `M5`, then `M0` |
//! | end, unless the job says which | `M30` | `M30` | `M2` |
//! | end of a called program | `M99` | `M17` | `M2`: LinuxCNC returns from files by their end |
//!
//! In the others of Fanuc's systems `G90`, `G92`, `G50` and `G71` mean something else, so the program says which one it is for.

#[cfg(test)]
mod tests;

use precut_calc::calculator::{Block, Dialect, Program, ProgramEnd};

use super::number::{at_most, decimals_of};

/// Longest line of a comment: every control reads lines of this length.
const COMMENT_LENGTH: usize = 96;

/// Decimals of a feed in mm/rev.
const FEED_DECIMALS: usize = 4;

/// First words by which LinuxCNC and its screens take a comment for a command.
const ACTIVE: [&str; 9] = ["abort", "axis", "debug", "log", "msg", "preview", "print", "probe", "py"];

/// A program in its dialect's words, with `header` as comments before it, one for each entry. ASCII,
/// a line feed after every line. An axis word is written where its number changes, the feed where it
/// changes. Coordinates are rounded to the program's increment, halves away from zero.
pub fn gcode(program: &Program, header: &[String]) -> String {
    let mut writer = Writer::new(program);
    if writer.is_fanuc() {
        writer.line("%");
    }
    for text in header {
        writer.comment(text);
    }
    for block in &program.blocks {
        writer.block(block);
    }
    if writer.is_fanuc() {
        writer.line("%");
    }
    writer.text
}

/// The program so far, and what the control remembers of it.
struct Writer {
    text: String,
    dialect: Dialect,
    increment_mm: f64,
    decimals: usize,
    x: Option<String>,
    z: Option<String>,
    feed: Option<String>,
}

impl Writer {
    fn new(program: &Program) -> Self {
        let step = program.increment_mm;
        let increment_mm = if step.is_finite() && step > 0.0 { step } else { 0.001 };
        let decimals = decimals_of(increment_mm);
        Self { text: String::new(), dialect: program.dialect, increment_mm, decimals, x: None, z: None, feed: None }
    }

    fn line(&mut self, line: &str) {
        self.text.push_str(line);
        self.text.push('\n');
    }

    fn is_fanuc(&self) -> bool {
        matches!(self.dialect, Dialect::Fanuc | Dialect::FanucA | Dialect::FanucC)
    }

    /// A comment, on as many lines as it takes.
    fn comment(&mut self, text: &str) {
        for text in lines(&plain(text)) {
            let text = inactive(text, self.dialect);
            match self.dialect {
                Dialect::Siemens => self.line(&format!("; {text}")),
                Dialect::Fanuc | Dialect::FanucA | Dialect::FanucC | Dialect::LinuxCnc => {
                    self.line(&format!("({text})"));
                }
            }
        }
    }

    fn block(&mut self, block: &Block) {
        match *block {
            Block::Modes => self.modes(),
            Block::Note(ref text) => self.comment(text),
            Block::SpindleSpeed { rpm } => {
                let speed = self.speed(rpm);
                self.line(&format!("G97 S{speed} M3"));
            }
            Block::SurfaceSpeed { speed_m_per_min, limit_rpm } => self.surface_speed(speed_m_per_min, limit_rpm),
            Block::Rapid { x_diameter_mm, z_mm } => {
                let words = self.axes(x_diameter_mm, z_mm);
                if !words.is_empty() {
                    self.line(&format!("G0{words}"));
                }
            }
            Block::Cut { x_diameter_mm, z_mm, feed_mm_per_rev } => {
                let axes = self.axes(Some(x_diameter_mm), Some(z_mm));
                let feed = feed_mm_per_rev.map(|feed| self.feed(feed)).unwrap_or_default();
                if !axes.is_empty() || !feed.is_empty() {
                    self.line(&format!("G1{axes}{feed}"));
                }
            }
            Block::Tool { number } => self.tool(number),
            Block::Coolant { on } => self.line(if on { "M8" } else { "M9" }),
            Block::Stop { ref reason } => {
                self.line("M5");
                self.comment(reason);
                self.line("M0");
            }
            Block::End(end) => {
                self.line("M5");
                self.line(match (end, self.dialect) {
                    (None | Some(ProgramEnd::Return), Dialect::LinuxCnc) | (Some(ProgramEnd::M2), _) => "M2",
                    (Some(ProgramEnd::Return), Dialect::Siemens) => "M17",
                    (Some(ProgramEnd::Return), Dialect::Fanuc | Dialect::FanucA | Dialect::FanucC) => "M99",
                    (None | Some(ProgramEnd::M30), _) => "M30",
                });
            }
        }
    }

    fn modes(&mut self) {
        match self.dialect {
            Dialect::Fanuc => {
                self.comment("for G-code system B: G90 absolute, G95 feed per revolution, G92 S speed limit");
                self.line("G21 G18 G40 G90 G95");
            }
            Dialect::FanucA => {
                self.comment("for G-code system A: X Z absolute, G99 feed per revolution, G50 S speed limit");
                self.line("G21 G18 G40 G99");
            }
            Dialect::FanucC => {
                self.comment("for G-code system C: G71 millimetres, G95 feed per revolution, G92 S speed limit");
                self.line("G71 G18 G40 G90 G95");
            }
            Dialect::Siemens => {
                self.line("G710 G18 G40 G90 G95");
                self.line("DIAMON");
            }
            Dialect::LinuxCnc => {
                self.line("G21 G18 G40 G90 G95");
                self.line("G7");
                let tolerance = at_most(self.increment_mm, self.decimals);
                self.line(&format!("G64 P{tolerance}"));
            }
        }
    }

    fn tool(&mut self, number: u32) {
        match self.dialect {
            Dialect::Fanuc | Dialect::FanucA | Dialect::FanucC => self.line(&format!("T{number:02}{number:02}")),
            Dialect::Siemens => self.line(&format!("T{number} D1")),
            Dialect::LinuxCnc => {
                self.line(&format!("T{number} M6"));
                self.line("G43");
            }
        }
    }

    fn surface_speed(&mut self, speed_m_per_min: f64, limit_rpm: f64) {
        // A limit is never rounded up.
        let limit = at_most(limit_rpm.floor().max(1.0), 0);
        let speed = self.speed(speed_m_per_min);
        match self.dialect {
            Dialect::Fanuc | Dialect::FanucC => {
                self.line(&format!("G92 S{limit}"));
                self.line(&format!("G96 S{speed} M3"));
            }
            Dialect::FanucA => {
                self.line(&format!("G50 S{limit}"));
                self.line(&format!("G96 S{speed} M3"));
            }
            Dialect::Siemens => self.line(&format!("G96 S{speed} LIMS={limit} M3")),
            Dialect::LinuxCnc => self.line(&format!("G96 D{limit} S{speed} M3")),
        }
    }

    /// Of the spindle, rev/min or m/min. Many Fanuc controls know whole ones only.
    fn speed(&self, value: f64) -> String {
        match self.dialect {
            Dialect::Fanuc | Dialect::FanucA | Dialect::FanucC => at_most(value.max(1.0), 0),
            Dialect::Siemens | Dialect::LinuxCnc => at_most(value, 3),
        }
    }

    fn feed(&mut self, feed_mm_per_rev: f64) -> String {
        let feed = with_point(at_most(feed_mm_per_rev.max(1e-4), FEED_DECIMALS));
        changed(&mut self.feed, 'F', feed)
    }

    fn axes(&mut self, x_diameter_mm: Option<f64>, z_mm: Option<f64>) -> String {
        let x = x_diameter_mm.map(|x| self.coordinate(x));
        let z = z_mm.map(|z| self.coordinate(z));
        let mut words = x.map(|x| changed(&mut self.x, 'X', x)).unwrap_or_default();
        words += &z.map(|z| changed(&mut self.z, 'Z', z)).unwrap_or_default();
        words
    }

    fn coordinate(&self, value_mm: f64) -> String {
        let steps = (value_mm / self.increment_mm).round();
        with_point(at_most(steps * self.increment_mm, self.decimals))
    }
}

/// The word with a space before it if it says something new.
fn changed(last: &mut Option<String>, letter: char, number: String) -> String {
    if last.as_ref() == Some(&number) {
        return String::new();
    }
    let word = format!(" {letter}{number}");
    *last = Some(number);
    word
}

/// A coordinate without a point means increments to some controls.
fn with_point(mut number: String) -> String {
    if !number.contains('.') {
        number.push('.');
    }
    number
}

/// What stands in a comment and ends neither it nor the program: printable ASCII without `( ) % ;`.
fn plain(text: &str) -> String {
    let mut plain = String::new();
    for c in text.chars() {
        match c {
            '(' => plain.push('['),
            ')' => plain.push(']'),
            ';' => plain.push(','),
            '%' => plain.push_str("percent"),
            'µ' | 'μ' => plain.push('u'),
            '²' => plain.push('2'),
            '³' => plain.push('3'),
            '°' => plain.push_str(" deg"),
            '–' | '—' | '−' => plain.push('-'),
            c if c.is_whitespace() => plain.push(' '),
            c if c.is_ascii_graphic() => plain.push(c),
            _ => plain.push('?'),
        }
    }
    plain
}

/// Words on lines that every control reads; a word that fits on none is cut short.
fn lines(text: &str) -> Vec<String> {
    let mut lines: Vec<String> = Vec::new();
    for word in text.split_ascii_whitespace() {
        let word = word.get(..COMMENT_LENGTH).unwrap_or(word);
        match lines.last_mut().filter(|line| line.len() + 1 + word.len() <= COMMENT_LENGTH) {
            Some(line) => {
                line.push(' ');
                line.push_str(word);
            }
            None => lines.push(word.to_owned()),
        }
    }
    lines
}

/// The line such that no control takes it for a command.
fn inactive(line: String, dialect: Dialect) -> String {
    let first = line.to_ascii_lowercase();
    let acts = dialect == Dialect::LinuxCnc && ACTIVE.iter().any(|word| first.starts_with(word));
    if acts { format!("- {line}") } else { line }
}
