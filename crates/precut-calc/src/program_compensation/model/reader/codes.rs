//! What the codes of each control mean. One number means different things to different controls, so there is one table for
//! each.

use super::super::super::job::Dialect;
use super::moves::Nose;

/// A path between two points.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Path {
    /// As fast as the axes go.
    Rapid,
    /// In a straight line at the feed.
    Line,
    /// Clockwise with Z to the right and X up.
    Clockwise,
    /// The other way round.
    CounterClockwise,
}

/// What a G code means.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Meaning {
    Path(Path),
    /// A thread in one motion.
    Thread,
    /// Along the axis, and back: one pass of a block.
    Along,
    /// Across the axis, and back.
    Across,
    ThreadCycle,
    Drill,
    /// No motion until the next one is named.
    NoMotion,
    ThreadRepeated,
    /// Grooves and pecks.
    Groove,
    RoughAlong,
    RoughAcross,
    RoughPattern,
    Finish,
    Dwell,
    Home,
    MachinePlace,
    Absolute,
    Relative,
    FeedPerMinute,
    FeedPerRev,
    /// With S a limit of the speed, with X or Z a shift of the coordinates.
    LimitOrShift,
    /// With S the upper limit of the speed.
    UpperLimit,
    /// Inches; whether feeds are in inches, too.
    Inch(bool),
    Millimetre(bool),
    PlaneOfTurning,
    Nose(Nose),
    SurfaceSpeed,
    SpindleSpeed,
    Diameter,
    Radius,
    CentreAbsolute,
    CentreRelative,
    /// A zero that is kept in the control.
    Zero(u32),
    /// Moves nothing; takes these words.
    Neutral(&'static str),
    /// Not read.
    Refused(&'static str),
}

/// Codes of one group exclude each other in a block.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Group {
    Once,
    Motion,
    /// Of a Fanuc, where it is not a motion.
    Drilling,
    Plane,
    Distance,
    Feed,
    Units,
    Nose,
    Zero,
    Speed,
    Width,
    Centre,
}

impl Meaning {
    /// Its group; what may stand beside anything has none.
    pub(super) fn group(self) -> Option<Group> {
        Some(match self {
            Self::Path(_)
            | Self::Thread
            | Self::Along
            | Self::Across
            | Self::ThreadCycle
            | Self::Drill
            | Self::NoMotion => Group::Motion,
            Self::ThreadRepeated
            | Self::Groove
            | Self::RoughAlong
            | Self::RoughAcross
            | Self::RoughPattern
            | Self::Finish
            | Self::Dwell
            | Self::Home
            | Self::MachinePlace
            | Self::LimitOrShift
            | Self::UpperLimit => Group::Once,
            Self::Absolute | Self::Relative => Group::Distance,
            Self::FeedPerMinute | Self::FeedPerRev => Group::Feed,
            Self::Inch(_) | Self::Millimetre(_) => Group::Units,
            Self::PlaneOfTurning => Group::Plane,
            Self::Nose(_) => Group::Nose,
            Self::SurfaceSpeed | Self::SpindleSpeed => Group::Speed,
            Self::Diameter | Self::Radius => Group::Width,
            Self::CentreAbsolute | Self::CentreRelative => Group::Centre,
            Self::Zero(_) => Group::Zero,
            Self::Neutral(_) | Self::Refused(_) => return None,
        })
    }
}

/// The number of a G code in tenths; `None` where it is no code.
pub(super) fn tenths(number: f64) -> Option<u32> {
    let tenths = (number * 10.0).round();
    let is_code = (0.0..100_000.0).contains(&tenths) && (tenths - number * 10.0).abs() < 1e-6;
    // Between 0 and 100 000.
    #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
    is_code.then_some(tenths as u32)
}

/// What a G code, in tenths, means to a control; `None` where it knows none of that number.
pub(super) fn meaning(dialect: Dialect, tenths: u32) -> Option<Meaning> {
    let of_all = match tenths {
        0 => Meaning::Path(Path::Rapid),
        10 => Meaning::Path(Path::Line),
        20 => Meaning::Path(Path::Clockwise),
        30 => Meaning::Path(Path::CounterClockwise),
        40 => Meaning::Dwell,
        170 | 190 => Meaning::Refused("wrong_plane"),
        180 => Meaning::PlaneOfTurning,
        400 => Meaning::Nose(Nose::Off),
        410 => Meaning::Nose(Nose::Left),
        420 => Meaning::Nose(Nose::Right),
        530 => Meaning::MachinePlace,
        540 | 550 | 560 | 570 => Meaning::Zero(tenths),
        960 => Meaning::SurfaceSpeed,
        970 => Meaning::SpindleSpeed,
        _ => {
            return match dialect {
                Dialect::FanucA => of_fanuc_a(tenths).or_else(|| of_fanuc(tenths)),
                Dialect::Fanuc => of_fanuc_b(tenths).or_else(|| of_fanuc_b_and_c(tenths)).or_else(|| of_fanuc(tenths)),
                Dialect::FanucC => of_fanuc_c(tenths).or_else(|| of_fanuc_b_and_c(tenths)).or_else(|| of_fanuc(tenths)),
                Dialect::Siemens => of_siemens(tenths),
                Dialect::LinuxCnc => of_linuxcnc(tenths),
            };
        }
    };
    Some(of_all)
}

/// Of every lathe of Fanuc.
fn of_fanuc(tenths: u32) -> Option<Meaning> {
    Some(match tenths {
        71 | 121 | 1070 | 1120 => Meaning::Refused("polar_or_cylinder"),
        90 | 110 | 131 | 610 | 640 | 670 | 690 | 1130 => Meaning::Neutral(""),
        100 | 520 => Meaning::Refused("offset_change"),
        220 | 230 => Meaning::Neutral("XZIK"),
        250 | 260 => Meaning::Neutral("PQRI"),
        280 | 300 => Meaning::Home,
        310 | 360 | 370 => Meaning::Refused("probing"),
        580 | 590 => Meaning::Zero(tenths),
        650 | 660 => Meaning::Refused("macro_call"),
        680 | 501 | 511 => Meaning::Refused("frame_turned"),
        800 => Meaning::NoMotion,
        830 | 840 | 850 => Meaning::Drill,
        870 | 880 | 890 => Meaning::Refused("cycle_not_read"),
        _ => return None,
    })
}

/// Of G-code system A.
fn of_fanuc_a(tenths: u32) -> Option<Meaning> {
    Some(match tenths {
        200 => Meaning::Inch(true),
        210 => Meaning::Millimetre(true),
        320 | 340 => Meaning::Thread,
        500 => Meaning::LimitOrShift,
        700 => Meaning::Finish,
        710 => Meaning::RoughAlong,
        720 => Meaning::RoughAcross,
        730 => Meaning::RoughPattern,
        740 | 750 => Meaning::Groove,
        760 => Meaning::ThreadRepeated,
        900 => Meaning::Along,
        920 => Meaning::ThreadCycle,
        940 => Meaning::Across,
        980 => Meaning::FeedPerMinute,
        990 => Meaning::FeedPerRev,
        _ => return None,
    })
}

/// Of system B where it is not as C.
fn of_fanuc_b(tenths: u32) -> Option<Meaning> {
    Some(match tenths {
        200 => Meaning::Inch(true),
        210 => Meaning::Millimetre(true),
        700 => Meaning::Finish,
        710 => Meaning::RoughAlong,
        720 => Meaning::RoughAcross,
        730 => Meaning::RoughPattern,
        740 | 750 => Meaning::Groove,
        760 => Meaning::ThreadRepeated,
        770 => Meaning::Along,
        780 => Meaning::ThreadCycle,
        790 => Meaning::Across,
        _ => return None,
    })
}

/// Of system C where it is not as B.
fn of_fanuc_c(tenths: u32) -> Option<Meaning> {
    Some(match tenths {
        200 => Meaning::Along,
        210 => Meaning::ThreadCycle,
        240 => Meaning::Across,
        700 => Meaning::Inch(true),
        710 => Meaning::Millimetre(true),
        720 => Meaning::Finish,
        730 => Meaning::RoughAlong,
        740 => Meaning::RoughAcross,
        750 => Meaning::RoughPattern,
        760 | 770 => Meaning::Groove,
        780 => Meaning::ThreadRepeated,
        _ => return None,
    })
}

/// Of the systems B and C.
fn of_fanuc_b_and_c(tenths: u32) -> Option<Meaning> {
    Some(match tenths {
        330 | 340 => Meaning::Thread,
        900 => Meaning::Absolute,
        910 => Meaning::Relative,
        920 => Meaning::LimitOrShift,
        940 => Meaning::FeedPerMinute,
        950 => Meaning::FeedPerRev,
        980 | 990 => Meaning::Neutral(""),
        _ => return None,
    })
}

/// Of Siemens, ISO mode off.
fn of_siemens(tenths: u32) -> Option<Meaning> {
    Some(match tenths {
        90 | 600 | 640 | 6010 | 6020 | 6030 | 6410..=6450 | 4500 | 4510 | 4600 | 4610 | 4620 => Meaning::Neutral(""),
        250 => Meaning::Neutral("SXZ"),
        260 => Meaning::UpperLimit,
        330 | 340 | 350 => Meaning::Thread,
        580 | 590 => Meaning::Refused("offset_change"),
        630 | 3310 | 3320 => Meaning::Refused("cycle_not_read"),
        700 => Meaning::Inch(false),
        7000 => Meaning::Inch(true),
        710 => Meaning::Millimetre(false),
        7100 => Meaning::Millimetre(true),
        740 | 750 => Meaning::Home,
        900 => Meaning::Absolute,
        910 => Meaning::Relative,
        930 => Meaning::Refused("inverse_time_feed"),
        940 => Meaning::FeedPerMinute,
        950 => Meaning::FeedPerRev,
        1100 | 1110 | 1120 => Meaning::Refused("polar_or_cylinder"),
        1530 => Meaning::MachinePlace,
        5000 | 5050..=5990 if tenths.is_multiple_of(10) => Meaning::Zero(tenths),
        _ => return None,
    })
}

/// Of LinuxCNC.
fn of_linuxcnc(tenths: u32) -> Option<Meaning> {
    Some(match tenths {
        50..=53 => Meaning::Refused("spline"),
        70 => Meaning::Diameter,
        80 => Meaning::Radius,
        100 | 431 | 432 | 520 | 920..=923 => Meaning::Refused("offset_change"),
        200 => Meaning::Inch(true),
        210 => Meaning::Millimetre(true),
        280 | 300 => Meaning::Home,
        281 | 301 | 490 | 610 | 611 | 980 | 990 => Meaning::Neutral(""),
        330 => Meaning::Thread,
        331 | 730 | 740 | 810..=890 if tenths.is_multiple_of(10) || tenths == 331 => Meaning::Drill,
        382..=385 => Meaning::Refused("probing"),
        411 | 421 => Meaning::Nose(if tenths == 411 { Nose::Left } else { Nose::Right }),
        430 => Meaning::Neutral("H"),
        580 | 590..=593 => Meaning::Zero(tenths),
        640 => Meaning::Neutral("PQ"),
        700 => Meaning::Finish,
        710 | 711 => Meaning::RoughAlong,
        720 | 721 => Meaning::RoughAcross,
        // Pockets alone.
        712..=719 | 722 => Meaning::Refused("cycle_not_read"),
        760 => Meaning::ThreadRepeated,
        800 => Meaning::NoMotion,
        900 => Meaning::Absolute,
        901 => Meaning::CentreAbsolute,
        910 => Meaning::Relative,
        911 => Meaning::CentreRelative,
        930 => Meaning::Refused("inverse_time_feed"),
        940 => Meaning::FeedPerMinute,
        950 => Meaning::FeedPerRev,
        _ => return None,
    })
}

/// What an M code does to the reading.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Function {
    /// Nothing that moves the tool.
    Known,
    /// The tool that was named is taken.
    TakeTool,
    End,
    /// Back to whoever called.
    Return,
    Call,
    Unknown,
}

/// What an M code means.
pub(super) fn function(dialect: Dialect, number: f64) -> Function {
    // Codes are small; what is none is unknown.
    let is = |code: u32| (number - f64::from(code)).abs() < 1e-9;
    let any = |codes: &[u32]| codes.iter().any(|&code| is(code));
    match dialect {
        _ if any(&[2, 30]) => Function::End,
        Dialect::Siemens if is(17) => Function::Return,
        Dialect::Siemens if any(&[98, 99]) => Function::Unknown,
        _ if is(99) => Function::Return,
        _ if any(&[98, 198]) => Function::Call,
        Dialect::LinuxCnc if is(6) => Function::TakeTool,
        Dialect::Fanuc | Dialect::FanucA | Dialect::FanucC if any(&[96, 97]) => Function::Call,
        _ if any(&[0, 1, 3, 4, 5, 6, 7, 8, 9, 19, 40, 41, 42, 43, 44, 45, 48, 49]) => Function::Known,
        _ => Function::Unknown,
    }
}

/// What a name of Siemens means.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Named {
    Diameter,
    Radius,
    /// Absolute words are diameters, relative ones radii.
    DiameterOfAbsolute,
    MachinePlace,
    SpeedLimit,
    CircleRadius,
    Neutral,
    /// A thread or a groove whose words are not read.
    Passed(&'static str, super::moves::Kind),
    Return,
    Refused(&'static str),
}

/// What a name of Siemens means; `called` where parentheses follow, `set` where an equals sign does.
pub(super) fn named(name: &str, called: bool, set: bool) -> Named {
    use super::moves::Kind;
    let name = name.to_ascii_uppercase();
    match name.as_str() {
        "DIAMON" => Named::Diameter,
        "DIAMOF" => Named::Radius,
        "DIAM90" => Named::DiameterOfAbsolute,
        "SUPA" => Named::MachinePlace,
        "LIMS" => Named::SpeedLimit,
        "CR" => Named::CircleRadius,
        "MSG" | "STOPRE" | "FFWON" | "FFWOF" | "SOFT" | "BRISK" | "BRISKA" | "SOFTA" | "DRIVE" | "DRIVEA" | "CFC"
        | "CFTCP" | "CFIN" | "NORM" | "KONT" | "KONTT" | "KONTC" | "SPOS" | "SPOSA" | "SETMS" | "WAITS" | "TRAFOOF"
        | "COMPOF" | "ADIS" | "ADISPOS" | "OVR" | "ACC" | "DISPLOF" | "SAVE" | "GWPSOF" | "UPATH" | "SPATH" => {
            Named::Neutral
        }
        "CYCLE97" => Named::Passed("thread_passed", Kind::Thread),
        "CYCLE93" => Named::Passed("cycle_passed", Kind::Opaque),
        "CHF" | "CHR" | "RND" | "RNDM" | "ANG" | "FRC" | "FRCM" => Named::Refused("drawing_dimension"),
        "AP" | "RP" | "TRANSMIT" | "TRACYL" | "TRAANG" | "TRAORI" => Named::Refused("polar_or_cylinder"),
        "TRANS" | "ATRANS" => Named::Refused("offset_change"),
        "ROT" | "AROT" | "ROTS" | "AROTS" | "MIRROR" | "AMIRROR" | "SCALE" | "ASCALE" => Named::Refused("frame_turned"),
        "ASPLINE" | "BSPLINE" | "CSPLINE" | "POLY" | "INVCW" | "INVCCW" => Named::Refused("spline"),
        "MEAS" | "MEAW" | "MEASA" | "MEAWA" => Named::Refused("probing"),
        "CIP" | "CT" | "AR" | "TURN" => Named::Refused("arc_form_not_read"),
        "IF" | "ELSE" | "ENDIF" | "GOTO" | "GOTOF" | "GOTOB" | "GOTOC" | "GOTOS" | "FOR" | "ENDFOR" | "WHILE"
        | "ENDWHILE" | "REPEAT" | "REPEATB" | "UNTIL" | "LOOP" | "ENDLOOP" | "CASE" => {
            Named::Refused("jump_in_program")
        }
        "DEF" | "SET" | "REDEF" => Named::Refused("variable_in_program"),
        "PROC" | "CALL" | "PCALL" | "EXTCALL" | "EXTERN" | "MCALL" => Named::Refused("subprogram"),
        "RET" => Named::Return,
        _ if name.starts_with("CYCLE") || name.starts_with("HOLES") || name.starts_with("POCKET") => {
            Named::Refused("cycle_not_read")
        }
        _ if set => Named::Refused("variable_in_program"),
        _ if called => Named::Refused("subprogram"),
        _ => Named::Refused("unknown_word"),
    }
}
