//! Programs as controls read them.
#![allow(clippy::unwrap_used)]

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
        assert!(said.starts_with("WARNING a_code: it gives way by 104 um, 30 percent of the depth, WARNING"), "{said}");
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
    assert_eq!(text, include_str!("../../../tests/tools/rs274/example.ngc"));
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
