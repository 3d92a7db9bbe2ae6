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

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// reference/deflection-compensation/path.json, `gcode_example`.
    fn example(dialect: Dialect) -> Program {
        let cut = |x_diameter_mm, z_mm, feed_mm_per_rev| Block::Cut { x_diameter_mm, z_mm, feed_mm_per_rev };
        Program {
            dialect,
            increment_mm: 0.001,
            blocks: vec![
                Block::Modes,
                Block::SpindleSpeed { rpm: 500.0 },
                Block::Rapid { x_diameter_mm: Some(96.0), z_mm: Some(2.0) },
                Block::Rapid { x_diameter_mm: Some(89.966_654), z_mm: None },
                cut(89.966_654, 0.0, Some(0.5)),
                cut(89.884_68, -1000.0, Some(0.5)),
                cut(89.977_769, -2000.0, None),
                Block::Rapid { x_diameter_mm: Some(96.0), z_mm: None },
                Block::End(None),
            ],
        }
    }

    const PATH: [&str; 6] =
        ["G0 X96. Z2.", "G0 X89.967", "G1 Z0. F0.5", "G1 X89.885 Z-1000.", "G1 X89.978 Z-2000.", "G0 X96."];

    const SYSTEM_B: &str = "(for G-code system B: G90 absolute, G95 feed per revolution, G92 S speed limit)";

    fn expected(before: &[&str], after: &[&str]) -> String {
        [before, &PATH, after].concat().join("\n") + "\n"
    }

    #[test]
    fn fanuc_as_in_the_reference() {
        assert_eq!(
            gcode(&example(Dialect::Fanuc), &["key b3:0af9".to_owned(), "part Shaft (left)".to_owned()]),
            expected(
                &["%", "(key b3:0af9)", "(part Shaft [left])", SYSTEM_B, "G21 G18 G40 G90 G95", "G97 S500 M3"],
                &["M5", "M30", "%"]
            )
        );
    }

    /// G90 would be a turning cycle there, G95 unknown, and G92 a thread.
    #[test]
    fn fanuc_of_system_a() {
        let text = gcode(&example(Dialect::FanucA), &[]);
        let system = "(for G-code system A: X Z absolute, G99 feed per revolution, G50 S speed limit)";
        assert_eq!(text, expected(&["%", system, "G21 G18 G40 G99", "G97 S500 M3"], &["M5", "M30", "%"]));
    }

    #[test]
    fn a_long_comment_goes_on_over_lines_and_keeps_what_it_says() {
        let warning = "WARNING a_code: it gives way by 104 µm, 30 % of the depth; ".repeat(4) + "probe it";
        for dialect in [Dialect::Fanuc, Dialect::Siemens, Dialect::LinuxCnc] {
            let text = gcode(&Program { dialect, increment_mm: 0.001, blocks: vec![] }, std::slice::from_ref(&warning));
            let lines: Vec<_> = text.lines().filter(|line| *line != "%").collect();
            assert!(lines.len() > 2 && lines.iter().all(|line| line.is_ascii() && line.len() <= COMMENT_LENGTH + 4));
            let inside = |line: &&str| line.trim_start_matches(['(', ';', ' ']).trim_end_matches(')').to_owned();
            let said = lines.iter().map(inside).collect::<Vec<_>>().join(" ");
            assert!(
                said.starts_with("WARNING a_code: it gives way by 104 um, 30 percent of the depth, WARNING"),
                "{said}"
            );
            assert!(said.ends_with("probe it"), "{said}");
        }
    }

    #[test]
    fn siemens() {
        assert_eq!(
            gcode(&example(Dialect::Siemens), &["key b3:0af9".to_owned()]),
            expected(&["; key b3:0af9", "G710 G18 G40 G90 G95", "DIAMON", "G97 S500 M3"], &["M5", "M30"])
        );
    }

    /// The file is also what the check with LinuxCNC's interpreter is tested with.
    #[test]
    fn linuxcnc() {
        let text = gcode(&example(Dialect::LinuxCnc), &["key b3:0af9".to_owned()]);
        assert_eq!(text, include_str!("../../tests/tools/rs274/example.ngc"));
    }

    #[test]
    fn surface_speed_with_its_limit() {
        let lines = |dialect| {
            let blocks = vec![Block::SurfaceSpeed { speed_m_per_min: 141.372, limit_rpm: 2500.9 }];
            gcode(&Program { dialect, increment_mm: 0.001, blocks }, &[])
        };
        assert_eq!(lines(Dialect::Fanuc), "%\nG92 S2500\nG96 S141 M3\n%\n");
        assert_eq!(lines(Dialect::FanucA), "%\nG50 S2500\nG96 S141 M3\n%\n");
        assert_eq!(lines(Dialect::Siemens), "G96 S141.372 LIMS=2500 M3\n");
        assert_eq!(lines(Dialect::LinuxCnc), "G96 D2500 S141.372 M3\n");
    }

    #[test]
    fn tool_coolant_stop_and_end_in_every_dialect() {
        let lines = |dialect, end| {
            let stop = Block::Stop { reason: "open the rest (at Z-200)".to_owned() };
            let blocks = vec![Block::Tool { number: 3 }, Block::Coolant { on: true }, stop, Block::End(end)];
            gcode(&Program { dialect, increment_mm: 0.001, blocks }, &[])
        };
        let fanuc = "%\nT0303\nM8\nM5\n(open the rest [at Z-200])\nM0\nM5\nM99\n%\n";
        assert_eq!(lines(Dialect::FanucA, Some(ProgramEnd::Return)), fanuc);
        assert_eq!(lines(Dialect::Siemens, None), "T3 D1\nM8\nM5\n; open the rest [at Z-200]\nM0\nM5\nM30\n");
        assert!(lines(Dialect::Siemens, Some(ProgramEnd::Return)).ends_with("M5\nM17\n"));
        assert!(lines(Dialect::LinuxCnc, None).starts_with("T3 M6\nG43\nM8\n"));
        assert!(lines(Dialect::LinuxCnc, Some(ProgramEnd::M30)).ends_with("M5\nM30\n"));
    }

    #[test]
    fn increments_that_are_no_power_of_ten() {
        let cut = |x_diameter_mm| Block::Cut { x_diameter_mm, z_mm: 0.0, feed_mm_per_rev: None };
        let blocks = vec![cut(10.000_24), cut(10.000_25), cut(-0.000_1)];
        let program = Program { dialect: Dialect::Siemens, increment_mm: 0.000_5, blocks };
        assert_eq!(gcode(&program, &[]), "G1 X10. Z0.\nG1 X10.0005\nG1 X0.\n");
    }

    #[test]
    fn nothing_in_a_comment_acts() {
        for dialect in [Dialect::Fanuc, Dialect::FanucA, Dialect::Siemens, Dialect::LinuxCnc] {
            let program = Program { dialect, increment_mm: 0.001, blocks: vec![] };
            let text = gcode(&program, &["MSG, x)\nG0 X0 (%; Вал µ".to_owned(), "m".repeat(500)]);
            let lines: Vec<_> = text.lines().filter(|line| *line != "%").collect();
            assert_eq!(lines.len(), 2, "{text}");
            for line in lines {
                assert!(line.is_ascii() && line.len() <= COMMENT_LENGTH + 4, "{line}");
                assert!(dialect != Dialect::LinuxCnc || !line.starts_with("(MSG"), "{line}");
                let inside = line.trim_start_matches(['(', ';']).trim_end_matches(')');
                assert!(!inside.contains(['(', ')', '%', ';']), "{line}");
            }
        }
    }

    fn any_block() -> impl Strategy<Value = Block> {
        let length = -1e5..1e5;
        prop_oneof![
            Just(Block::Modes),
            Just(Block::End(None)),
            (1..99_u32).prop_map(|number| Block::Tool { number }),
            Just(Block::Stop { reason: "G0 X1. (open the rest)".to_owned() }),
            (0.1..1e4).prop_map(|rpm| Block::SpindleSpeed { rpm }),
            (0.1..1e4, 0.1..1e4)
                .prop_map(|(speed_m_per_min, limit_rpm)| Block::SurfaceSpeed { speed_m_per_min, limit_rpm }),
            (proptest::option::of(length.clone()), proptest::option::of(length.clone()))
                .prop_map(|(x_diameter_mm, z_mm)| Block::Rapid { x_diameter_mm, z_mm }),
            (length.clone(), length, proptest::option::of(1e-5..10.0))
                .prop_map(|(x_diameter_mm, z_mm, feed_mm_per_rev)| Block::Cut { x_diameter_mm, z_mm, feed_mm_per_rev }),
        ]
    }

    proptest! {
        /// Read back with the rules of a control (words are modal), the path is the rounded one.
        #[test]
        fn the_path_reads_back(blocks in proptest::collection::vec(any_block(), 0..40)) {
            let program = Program { dialect: Dialect::Fanuc, increment_mm: 0.001, blocks };
            let (mut x, mut z) = (f64::NAN, f64::NAN);
            for line in gcode(&program, &[]).lines().filter(|line| line.starts_with("G0 ") || line.starts_with("G1 ")) {
                for word in line.split(' ').skip(1) {
                    let number = word[1..].parse::<f64>().unwrap();
                    prop_assert!(word.contains('.') && &word[1..] != "-0.");
                    match &word[..1] {
                        "X" => x = number,
                        "Z" => z = number,
                        _ => prop_assert!(word.starts_with('F') && number > 0.0),
                    }
                }
            }
            let (mut want_x, mut want_z) = (f64::NAN, f64::NAN);
            for block in &program.blocks {
                match *block {
                    Block::Rapid { x_diameter_mm, z_mm } => {
                        want_x = x_diameter_mm.unwrap_or(want_x);
                        want_z = z_mm.unwrap_or(want_z);
                    }
                    Block::Cut { x_diameter_mm, z_mm, .. } => (want_x, want_z) = (x_diameter_mm, z_mm),
                    _ => {}
                }
            }
            for (got, want) in [(x, want_x), (z, want_z)] {
                prop_assert_eq!(got.is_nan(), want.is_nan());
                prop_assert!(want.is_nan() || (got - want).abs() <= 0.000_500_001, "{} {}", got, want);
            }
        }
    }
}
