//! A file as a roundness tester or a coordinate machine wrote it: header text in any language, comments, decimal comma,
//! several sections, angle or none. What was taken for what is told; what cannot be told is asked.

use super::columns::{found, names, roles};
use super::header::{CLOCKWISE, COUNTER, has_word, magnification, stated_height_mm, stated_radius_mm};
use super::output::RepairKind;

/// What a column holds, and how many mm, um or degrees its unit is.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::ring_roundness) enum Column {
    /// Degrees per unit.
    Angle(f64),
    /// mm per unit of a distance from the axis.
    Radius(f64),
    /// um per unit of a deviation.
    Deviation(f64),
    /// mm per unit.
    X(f64),
    Y(f64),
    /// mm per unit of the height along the axis.
    Z(f64),
    Other,
}

/// A section of the file.
#[derive(Debug, Clone, PartialEq)]
pub(in crate::ring_roundness) struct FileSection {
    pub(in crate::ring_roundness) rows: Rows,
    /// Height of each row, mm; none where the file does not tell.
    pub(in crate::ring_roundness) heights_mm: Vec<f64>,
}

/// Rows of a section.
#[derive(Debug, Clone, PartialEq)]
pub(in crate::ring_roundness) enum Rows {
    /// Angles (degrees) and radii (mm).
    Radii(Vec<(f64, f64)>),
    /// Angles (degrees) and deviations (um).
    Deviations(Vec<(f64, f64)>),
    /// Points, mm.
    Points(Vec<(f64, f64)>),
}

/// What was done to the text, and to how much of it.
pub(in crate::ring_roundness) type Done = (RepairKind, usize);

/// A file that was understood.
#[derive(Debug, Clone, PartialEq)]
pub(in crate::ring_roundness) struct Understood {
    /// One entry per section, in the order of the file; rows of one block at several heights are several sections.
    pub(in crate::ring_roundness) sections: Vec<FileSection>,
    pub(in crate::ring_roundness) done: Vec<Done>,
    /// Nominal radius that the header states, mm.
    pub(in crate::ring_roundness) nominal_mm: Option<f64>,
}

/// Why a file was not understood.
#[derive(Debug, Clone, PartialEq)]
pub(in crate::ring_roundness) enum Unknown {
    /// No rows of numbers.
    NoNumbers,
    /// The columns as found: name, or `?`, with the range of the values.
    Columns(Vec<String>),
}

/// Fewest rows of a section.
const FEWEST_ROWS: usize = 3;
/// Heights that are nearer than this to their neighbours belong to one section, mm.
pub(in crate::ring_roundness) const SECTION_GAP_MM: f64 = 0.2;

/// Reads a file. `columns` overrides what the header says; `nominal_mm` tells deviations from radii where nothing else does.
pub(in crate::ring_roundness) fn read(
    text: &str,
    columns: &[Column],
    nominal_mm: Option<f64>,
) -> Result<Understood, Unknown> {
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
        let read = section(block, &roles, clockwise, magnification)
            .ok_or_else(|| found(block, &names(&lines, block, format)))?;
        let stated = block_height_mm(&lines, block, format);
        let has_angles = roles.iter().any(|role| matches!(role, Column::Angle(_) | Column::X(_)));
        if sections.is_empty() && !has_angles {
            done.push((RepairKind::AnglesSpreadEvenly, block.rows.len()));
        }
        sections.extend(at_heights(read, stated, (!has_angles).then_some(if clockwise { -360.0 } else { 360.0 })));
    }
    if clockwise && !matches!(sections[0].rows, Rows::Points(_)) {
        done.push((RepairKind::TurnedRound, 1));
    }
    if magnification.is_some_and(|by| by > 1.0) && matches!(sections[0].rows, Rows::Deviations(_)) {
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

/// The height that the lines before a block state: "Section 2, Z = 12.5 mm".
fn block_height_mm(lines: &[&str], block: &Block, format: Format) -> Option<f64> {
    let above = lines[..block.from].iter().rev();
    above.take_while(|line| format.row(line).is_none()).find_map(|line| stated_height_mm(&line.to_lowercase()))
}

/// Rows of several heights as several sections, from the lowest; those of one height as they are. `turn_deg` is what rows
/// without angles are spread over.
fn at_heights(read: FileSection, stated_mm: Option<f64>, turn_deg: Option<f64>) -> Vec<FileSection> {
    if read.heights_mm.is_empty() {
        let heights_mm = stated_mm.map_or_else(Vec::new, |height| vec![height; read.rows.len()]);
        return vec![FileSection { heights_mm, ..read }];
    }
    let groups = groups(&read.heights_mm, SECTION_GAP_MM);
    // Scattered heights are not sections.
    if groups.len() < 2 || groups.iter().any(|group| group.len() < FEWEST_ROWS) {
        return vec![read];
    }
    let part = |group: &Vec<usize>| FileSection {
        rows: read.rows.part(group, turn_deg),
        heights_mm: group.iter().map(|&row| read.heights_mm[row]).collect(),
    };
    groups.iter().map(part).collect()
}

/// Which values lie together: sorted, every gap wider than `gap` begins a new group; each group in the order it came.
pub(in crate::ring_roundness) fn groups(values: &[f64], gap: f64) -> Vec<Vec<usize>> {
    let mut order: Vec<usize> = (0..values.len()).collect();
    order.sort_by(|&a, &b| values[a].total_cmp(&values[b]));
    let mut groups: Vec<Vec<usize>> = Vec::new();
    let mut last = f64::NEG_INFINITY;
    for at in order {
        match groups.last_mut().filter(|_| values[at] - last <= gap) {
            Some(group) => group.push(at),
            None => groups.push(vec![at]),
        }
        last = values[at];
    }
    for group in &mut groups {
        group.sort_unstable();
    }
    groups
}

impl Rows {
    pub(in crate::ring_roundness) fn len(&self) -> usize {
        match self {
            Self::Radii(rows) | Self::Deviations(rows) | Self::Points(rows) => rows.len(),
        }
    }

    /// Some of the rows; those without angles spread over a turn anew.
    fn part(&self, of: &[usize], turn_deg: Option<f64>) -> Self {
        let angle = |at: usize, given| turn_deg.map_or(given, |turn| turn * at as f64 / of.len() as f64);
        let row = |rows: &[(f64, f64)], at: usize, row: usize| (angle(at, rows[row].0), rows[row].1);
        let part = |rows: &[(f64, f64)]| of.iter().enumerate().map(|(at, &from)| row(rows, at, from)).collect();
        match self {
            Self::Radii(rows) => Self::Radii(part(rows)),
            Self::Deviations(rows) => Self::Deviations(part(rows)),
            Self::Points(rows) => Self::Points(part(rows)),
        }
    }
}

fn section(block: &Block, roles: &[Column], clockwise: bool, magnification: Option<f64>) -> Option<FileSection> {
    let at = |fits: fn(&Column) -> bool| roles.iter().position(fits);
    let pairs =
        |i: usize, p: f64, j: usize, q: f64| block.rows.iter().map(|row| (p * row[i], q * row[j])).collect::<Vec<_>>();
    let heights_mm = match at(|c| matches!(c, Column::Z(_))).map(|i| (i, roles[i])) {
        Some((i, Column::Z(mm))) => block.rows.iter().map(|row| mm * row[i]).collect(),
        _ => Vec::new(),
    };
    if let (Some(i), Some(j)) = (at(|c| matches!(c, Column::X(_))), at(|c| matches!(c, Column::Y(_)))) {
        let (Column::X(p), Column::Y(q)) = (roles[i], roles[j]) else { return None };
        return Some(FileSection { rows: Rows::Points(pairs(i, p, j, q)), heights_mm });
    }
    let value = at(|c| matches!(c, Column::Radius(_) | Column::Deviation(_)))?;
    let n = block.rows.len() as f64;
    let sense = if clockwise { -1.0 } else { 1.0 };
    let angles: Vec<f64> = match at(|c| matches!(c, Column::Angle(_))).map(|i| (i, roles[i])) {
        Some((i, Column::Angle(deg))) => block.rows.iter().map(|row| sense * deg * row[i]).collect(),
        _ => (0..block.rows.len()).map(|i| sense * 360.0 * i as f64 / n).collect(),
    };
    let with = |by: f64| angles.iter().zip(&block.rows).map(|(angle, row)| (*angle, by * row[value])).collect();
    let rows = match roles[value] {
        Column::Radius(mm) => Rows::Radii(with(mm)),
        Column::Deviation(um) => Rows::Deviations(with(um / magnification.unwrap_or(1.0))),
        _ => return None,
    };
    Some(FileSection { rows, heights_mm })
}
