//! A file as a roundness tester or a coordinate machine wrote it: header text in any language, comments, decimal comma,
//! several sections, angle or none. What was taken for what is told; what cannot be told is asked.

use super::columns::{found, names, roles};
use super::header::{CLOCKWISE, COUNTER, has_word, magnification, stated_radius_mm};
use super::output::RepairKind;

/// What a column holds, and how many mm, um or degrees its unit is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) enum Column {
    /// Degrees per unit.
    Angle(f64),
    /// mm per unit of a distance from the axis.
    Radius(f64),
    /// um per unit of a deviation.
    Deviation(f64),
    /// mm per unit.
    X(f64),
    Y(f64),
    Other,
}

/// A section of the file.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Rows {
    /// Angles (degrees) and radii (mm).
    Radii(Vec<(f64, f64)>),
    /// Angles (degrees) and deviations (um).
    Deviations(Vec<(f64, f64)>),
    /// Points, mm.
    Points(Vec<(f64, f64)>),
}

/// What was done to the text, and to how much of it.
pub(super) type Done = (RepairKind, usize);

/// A file that was understood.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct Understood {
    /// One entry per section, in the order of the file.
    pub(super) sections: Vec<Rows>,
    pub(super) done: Vec<Done>,
    /// Nominal radius that the header states, mm.
    pub(super) nominal_mm: Option<f64>,
}

/// Why a file was not understood.
#[derive(Debug, Clone, PartialEq)]
pub(super) enum Unknown {
    /// No rows of numbers.
    NoNumbers,
    /// The columns as found: name, or `?`, with the range of the values.
    Columns(Vec<String>),
}

/// Fewest rows of a section.
const FEWEST_ROWS: usize = 3;

/// Reads a file. `columns` overrides what the header says; `nominal_mm` tells deviations from radii where nothing else does.
pub(super) fn read(text: &str, columns: &[Column], nominal_mm: Option<f64>) -> Result<Understood, Unknown> {
    let mut done: Vec<Done> = Vec::new();
    let text = text.strip_prefix('\u{feff}').unwrap_or(text);
    let lines: Vec<&str> = text.lines().map(str::trim).collect();
    let format = Format::of(&lines).ok_or(Unknown::NoNumbers)?;
    if format.decimal_comma {
        done.push((RepairKind::DecimalCommaRead, 1));
    }
    let blocks = blocks(&lines, format);
    if blocks.is_empty() {
        return Err(Unknown::NoNumbers);
    }
    let first = blocks.first().map_or(0, |block| block.from);
    let heading: Vec<String> = lines[..first].iter().map(|line| line.to_lowercase()).collect();
    let skipped =
        lines.iter().filter(|line| !line.is_empty()).count() - blocks.iter().map(|b| b.rows.len()).sum::<usize>();
    if skipped > 0 {
        done.push((RepairKind::TextLinesSkipped, skipped));
    }
    let stated_mm = stated_radius_mm(&heading);
    let nominal = nominal_mm.or(stated_mm);
    let magnification = heading.iter().find_map(|line| magnification(line));
    let clockwise =
        heading.iter().any(|line| has_word(line, CLOCKWISE)) && !heading.iter().any(|line| has_word(line, COUNTER));
    let mut sections = Vec::new();
    for block in &blocks {
        let (roles, assumed) = if columns.is_empty() {
            roles(&lines, block, format, &heading, nominal)?
        } else {
            (columns.to_vec(), false)
        };
        if assumed && sections.is_empty() {
            done.push((RepairKind::TakenAsUm, 1));
        }
        if roles.len() > block.rows[0].len() {
            return Err(found(block, &names(&lines, block, format)));
        }
        let further = roles.iter().filter(|role| **role == Column::Other).count() + block.rows[0].len() - roles.len();
        if further > 0 && sections.is_empty() {
            done.push((RepairKind::ColumnsLeftOut, further));
        }
        let rows = section(block, &roles, clockwise, magnification)
            .ok_or_else(|| found(block, &names(&lines, block, format)))?;
        if sections.is_empty() && !roles.iter().any(|role| matches!(role, Column::Angle(_) | Column::X(_))) {
            done.push((RepairKind::AnglesSpreadEvenly, block.rows.len()));
        }
        sections.push(rows);
    }
    if clockwise && !matches!(sections[0], Rows::Points(_)) {
        done.push((RepairKind::TurnedRound, 1));
    }
    if magnification.is_some_and(|by| by > 1.0) && matches!(sections[0], Rows::Deviations(_)) {
        done.push((RepairKind::MagnificationTakenOut, 1));
    }
    Ok(Understood { sections, done, nominal_mm: stated_mm })
}

/// How the numbers of a file are written.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(super) struct Format {
    /// `None`: any white space.
    separator: Option<char>,
    decimal_comma: bool,
}

impl Format {
    /// The way in which most lines are rows of numbers; of equals the one with most columns.
    fn of(lines: &[&str]) -> Option<Self> {
        let ways = [Some('\t'), Some(';'), Some('|'), None, Some(',')]
            .into_iter()
            .flat_map(|separator| [false, true].map(|decimal_comma| Self { separator, decimal_comma }))
            .filter(|way| !(way.separator == Some(',') && way.decimal_comma));
        let score = |way: &Self| {
            let mut counts = std::collections::BTreeMap::new();
            for line in lines {
                if let Some(row) = way.row(line) {
                    *counts.entry(row.len()).or_insert(0_usize) += 1;
                }
            }
            counts.into_iter().map(|(columns, rows)| (rows, columns)).max().unwrap_or((0, 0))
        };
        let mut best: Option<((usize, usize), Self)> = None;
        for way in ways {
            let found = score(&way);
            // Whole numbers read alike with either sign; a comma between digits of which the second group begins with
            // zeros is a decimal comma.
            let comma_is_decimal = way.separator == Some(',') && lines.iter().any(|line| leading_zeros(line));
            if found.0 >= FEWEST_ROWS && !comma_is_decimal && best.is_none_or(|(most, _)| found > most) {
                best = Some((found, way));
            }
        }
        best.map(|(_, way)| way)
    }

    pub(super) fn cells(self, line: &str) -> Vec<&str> {
        let cells: Vec<&str> = match self.separator {
            Some(separator) => line.split(separator).map(str::trim).collect(),
            None => line.split_whitespace().collect(),
        };
        let used = cells.iter().rposition(|cell| !cell.is_empty()).map_or(0, |last| last + 1);
        cells[..used].iter().map(|cell| cell.trim_matches('"')).collect()
    }

    /// The numbers of a line; `None` where it has anything else.
    fn row(self, line: &str) -> Option<Vec<f64>> {
        let row: Option<Vec<f64>> = self.cells(line).iter().map(|cell| self.number(cell)).collect();
        row.filter(|row| !row.is_empty())
    }

    pub(super) fn number(self, cell: &str) -> Option<f64> {
        let bare = cell
            .trim_end_matches(|c: char| c.is_alphabetic() && !matches!(c, 'e' | 'E') || matches!(c, '°' | '"'))
            .trim();
        let axis = bare.trim_start_matches(['X', 'Y', 'Z', 'x', 'y', 'z', 'R', 'A', '=']);
        let plain = axis.replace('\u{2212}', "-");
        let plain = if self.decimal_comma {
            if plain.contains('.') {
                return None;
            }
            plain.replace(',', ".")
        } else {
            plain
        };
        let digits = plain.chars().all(|c| c.is_ascii_digit() || matches!(c, '+' | '-' | '.' | 'e' | 'E'));
        plain.parse::<f64>().ok().filter(|value| digits && value.is_finite())
    }
}

/// Whether a line reads as `0,003`: two groups of digits, the second beginning with a zero before others.
fn leading_zeros(line: &str) -> bool {
    line.split_whitespace().any(|word| {
        let mut groups = word.split(',');
        let (Some(a), Some(b), None) = (groups.next(), groups.next(), groups.next()) else { return false };
        let digits = |s: &str| !s.is_empty() && s.chars().all(|c| c.is_ascii_digit());
        digits(a.trim_start_matches(['-', '+'])) && digits(b) && b.len() > 1 && b.starts_with('0')
    })
}

/// Rows of numbers that follow each other.
pub(super) struct Block {
    /// First line.
    pub(super) from: usize,
    pub(super) rows: Vec<Vec<f64>>,
}

fn blocks(lines: &[&str], format: Format) -> Vec<Block> {
    let mut blocks: Vec<Block> = Vec::new();
    let mut open = false;
    for (at, line) in lines.iter().enumerate() {
        if line.is_empty() {
            continue;
        }
        let row = format.row(line);
        let goes_on = open;
        open = row.is_some();
        let Some(row) = row else { continue };
        match blocks.last_mut().filter(|block| goes_on && block.rows[0].len() == row.len()) {
            Some(block) => block.rows.push(row),
            None => blocks.push(Block { from: at, rows: vec![row] }),
        }
    }
    let widest = blocks.iter().max_by_key(|block| block.rows.len()).map_or(0, |block| block.rows[0].len());
    blocks.retain(|block| block.rows.len() >= FEWEST_ROWS && block.rows[0].len() == widest);
    blocks
}

fn section(block: &Block, roles: &[Column], clockwise: bool, magnification: Option<f64>) -> Option<Rows> {
    let at = |fits: fn(&Column) -> bool| roles.iter().position(fits);
    let pairs =
        |i: usize, p: f64, j: usize, q: f64| block.rows.iter().map(|row| (p * row[i], q * row[j])).collect::<Vec<_>>();
    if let (Some(i), Some(j)) = (at(|c| matches!(c, Column::X(_))), at(|c| matches!(c, Column::Y(_)))) {
        let (Column::X(p), Column::Y(q)) = (roles[i], roles[j]) else { return None };
        return Some(Rows::Points(pairs(i, p, j, q)));
    }
    let value = at(|c| matches!(c, Column::Radius(_) | Column::Deviation(_)))?;
    let n = block.rows.len() as f64;
    let sense = if clockwise { -1.0 } else { 1.0 };
    let angles: Vec<f64> = match at(|c| matches!(c, Column::Angle(_))).map(|i| (i, roles[i])) {
        Some((i, Column::Angle(deg))) => block.rows.iter().map(|row| sense * deg * row[i]).collect(),
        _ => (0..block.rows.len()).map(|i| sense * 360.0 * i as f64 / n).collect(),
    };
    let with = |by: f64| angles.iter().zip(&block.rows).map(|(angle, row)| (*angle, by * row[value])).collect();
    match roles[value] {
        Column::Radius(mm) => Some(Rows::Radii(with(mm))),
        Column::Deviation(um) => Some(Rows::Deviations(with(um / magnification.unwrap_or(1.0)))),
        _ => None,
    }
}
