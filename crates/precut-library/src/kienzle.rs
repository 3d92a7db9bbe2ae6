//! Kienzle's constants of a material from several sources: `library/2`, `library/3`, `library/6`.

use serde_json::Value;

use crate::built_in;
use crate::record::Record;

/// Chip thickness at which rows are compared, mm: k_c1.1 alone misleads, since it trades with m_c.
pub const REFERENCE_CHIP_THICKNESS_MM: f64 = 0.2;
/// Rows that are further apart differ, percent.
pub const DIFFERS_ABOVE_PERCENT: f64 = 10.0;
/// Scatter of a cut about its law that no table tells, as a share: a judgement.
const COMMON: f64 = 0.05;
/// No force is known better, percent.
const LEAST_PERCENT: f64 = 8.0;
/// No force is known better from a row of a group or class, percent.
const LEAST_OF_GROUP_PERCENT: f64 = 15.0;

/// A row of Kienzle's constants with both of them.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Row<'a> {
    /// Its place in the record's list.
    pub index: usize,
    /// k_c1.1, N/mm².
    pub specific_cutting_force_n_per_mm2: f64,
    /// m_c.
    pub cutting_exponent: f64,
    /// k_n1.1 and m_n, where they were measured.
    pub normal: Option<(f64, f64)>,
    /// Key or text of its source.
    pub source: &'a str,
    /// How certain it is.
    pub certainty: &'a str,
    /// Whether it was stated for the material itself.
    pub of_material: bool,
    /// Whether it is taken where nothing else is said.
    pub is_preferred: bool,
    /// Copies of one measurement are one family.
    pub family: &'a str,
    /// Whether a newer edition replaced it.
    pub is_superseded: bool,
    /// Rake at which it holds, degrees, and how much less a degree more makes it, percent.
    pub rake: Option<(f64, f64)>,
}

impl<'a> Row<'a> {
    fn of(index: usize, row: &'a Value) -> Option<Self> {
        let number = |name: &str| row.get(name).and_then(Value::as_f64);
        let text = |name: &str| row.get(name).and_then(Value::as_str).unwrap_or_default();
        Some(Self {
            index,
            specific_cutting_force_n_per_mm2: number("specific_cutting_force_n_per_mm2")?,
            cutting_exponent: number("cutting_exponent")?,
            normal: number("specific_normal_force_n_per_mm2").zip(number("normal_exponent")),
            source: text("source"),
            certainty: text("certainty"),
            of_material: text("holds_for") == "material",
            is_preferred: text("use") == "preferred",
            family: text("family"),
            is_superseded: row.get("superseded_by").is_some(),
            rake: number("base_rake_deg").zip(number("rake_slope_percent_per_deg")),
        })
    }

    /// k_c at the reference chip thickness, N/mm².
    pub fn at_reference(&self) -> f64 {
        self.specific_cutting_force_n_per_mm2 * REFERENCE_CHIP_THICKNESS_MM.powf(-self.cutting_exponent)
    }

    /// Factor on k_c at a rake, degrees: `library/2`. `None` where the row does not say its own rake, or the tool's is
    /// further than 20 degrees from it.
    pub fn rake_factor(&self, rake_deg: f64) -> Option<f64> {
        let (base, slope) = self.rake?;
        ((rake_deg - base).abs() <= 20.0).then(|| 1.0 - slope * (rake_deg - base) / 100.0)
    }
}

/// The rows of a material that have both constants.
pub fn rows(material: &Record) -> Vec<Row<'_>> {
    material.rows("kienzle").iter().enumerate().filter_map(|(index, row)| Row::of(index, row)).collect()
}

/// What several sources say of one material.
#[derive(Debug, Clone, PartialEq)]
pub struct Sources<'a> {
    /// The row that is taken.
    pub used: Row<'a>,
    /// Rows with both constants.
    pub rows: usize,
    /// Measurements behind them, without editions that were replaced.
    pub families: usize,
    /// Row with the least k_c at the reference.
    pub least: Row<'a>,
    /// Row with the largest.
    pub largest: Row<'a>,
    /// How much the largest is above the least, percent.
    pub differs_percent: f64,
    /// Relative standard uncertainty of the force, percent.
    pub force_percent: f64,
}

impl Sources<'_> {
    /// Whether the rows differ.
    pub fn is_conflict(&self) -> bool {
        self.differs_percent > DIFFERS_ABOVE_PERCENT
    }
}

/// Which row of a material a job asks for.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Choice<'a> {
    /// The preferred one.
    Preferred,
    /// That of this place in the list.
    Row(usize),
    /// That of this source.
    Source(&'a str),
}

/// The row that a job asks for, with what the others say. `None` where there is none.
pub fn choose<'a>(rows: &[Row<'a>], choice: Choice<'_>) -> Option<Sources<'a>> {
    let used = *match choice {
        Choice::Preferred => rows.iter().find(|row| row.is_preferred)?,
        Choice::Row(index) => rows.iter().find(|row| row.index == index)?,
        Choice::Source(source) => rows.iter().find(|row| row.source == source)?,
    };
    let by_force = |a: &&Row<'_>, b: &&Row<'_>| a.at_reference().total_cmp(&b.at_reference());
    let (least, largest) = (*rows.iter().min_by(by_force)?, *rows.iter().max_by(by_force)?);
    let logs = of_families(rows);
    Some(Sources {
        used,
        rows: rows.len(),
        families: logs.len(),
        least,
        largest,
        differs_percent: 100.0 * (largest.at_reference() / least.at_reference() - 1.0),
        force_percent: force_percent(&used, &logs),
    })
}

/// ln k_c of every family: that of its preferred row, else of its first.
fn of_families(rows: &[Row<'_>]) -> Vec<f64> {
    let mut families: Vec<&Row<'_>> = Vec::new();
    for row in rows.iter().filter(|row| !row.is_superseded) {
        match families.iter_mut().find(|other| other.family == row.family) {
            Some(other) if row.is_preferred => *other = row,
            Some(_) => {}
            None => families.push(row),
        }
    }
    families.iter().map(|row| row.at_reference().ln()).collect()
}

/// Relative standard uncertainty, percent, of a force by the row `used`: the scatter of the families with the common
/// part, or what its certainty stands for.
fn force_percent(used: &Row<'_>, logs: &[f64]) -> f64 {
    let percent = match logs {
        [] | [_] => of_certainty_percent(used.certainty),
        logs => {
            let mean = logs.iter().sum::<f64>() / logs.len() as f64;
            let square = logs.iter().map(|log| (log - mean).powi(2)).sum::<f64>() / (logs.len() - 1) as f64;
            100.0 * (square + COMMON * COMMON).sqrt()
        }
    };
    percent.max(if used.of_material { LEAST_PERCENT } else { LEAST_OF_GROUP_PERCENT })
}

/// Relative standard uncertainty that a certainty stands for, percent: a judgement (`library/3`).
pub fn of_certainty_percent(certainty: &str) -> f64 {
    match certainty {
        "measured" => 7.0,
        "confirmed" => 8.0,
        "user" => 10.0,
        "likely" => 12.0,
        "published_table" => 15.0,
        "to_be_checked" | "textbook_unverified" => 25.0,
        _ => 40.0,
    }
}

/// A judged normal force (`library/6`): k_n1.1, N/mm², and m_n of a material of that group.
///
/// k_n = rho k_c at the reference chip thickness, with m_n of the judgement.
pub fn judged_normal_force(group: &str, specific_cutting_force: f64, cutting_exponent: f64) -> Option<(f64, f64)> {
    let judged = built_in::judged_normal_force(group)?;
    let at_reference = specific_cutting_force * REFERENCE_CHIP_THICKNESS_MM.powf(-cutting_exponent);
    let exponent = judged.normal_exponent;
    let share = judged.normal_to_cutting_force_at_0_2_mm;
    Some((share * at_reference * REFERENCE_CHIP_THICKNESS_MM.powf(exponent), exponent))
}

/// Least uncertainty of a force with a judged normal force, percent.
pub const JUDGED_FORCE_PERCENT: f64 = 40.0;
