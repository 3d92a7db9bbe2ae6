//! What the columns of an instrument's file hold: by their names, else by their values.

use super::header::{ANGLE, DEG_PER_RAD, DEVIATION, DIAMETER, HEIGHT, INDEX, RADIUS, is_named, unit_of};
use super::instrument::{Block, Column, Format, Unknown};

/// The names of a block's columns: the nearest line above with as many cells, none of them a number.
pub(super) fn names(lines: &[&str], block: &Block, format: Format) -> Vec<String> {
    let width = block.rows[0].len();
    let fits = |line: &&str| {
        let bare = line.trim_start_matches(['#', '%', ';', '*', '!']).trim_start_matches("//").trim();
        let cells: Vec<String> = format.cells(bare).iter().map(|cell| cell.to_lowercase()).collect();
        let wordy = cells.iter().all(|cell| format.number(cell).is_none());
        (cells.len() == width && wordy).then_some(cells)
    };
    let above: Vec<&str> = lines[..block.from].iter().rev().take(4).copied().filter(|line| !line.is_empty()).collect();
    let fitting: Vec<Vec<String>> = above.iter().filter_map(fits).collect();
    // A line of units below the line of names.
    match fitting.as_slice() {
        [units, names, ..] if units.iter().all(|cell| unit_of(cell).is_some() || cell.len() <= 1) => {
            names.iter().zip(units).map(|(name, unit)| format!("{name} {unit}")).collect()
        }
        [names, ..] => names.clone(),
        [] => Vec::new(),
    }
}

/// What the columns of a block are, by their names, else by their values.
pub(super) fn roles(
    lines: &[&str],
    block: &Block,
    format: Format,
    heading: &[String],
    nominal_mm: Option<f64>,
) -> Result<(Vec<Column>, bool), Unknown> {
    let names = names(lines, block, format);
    // A unit stated once for the file.
    let stated = heading
        .iter()
        .filter(|line| ["unit", "einheit", "единиц", "unité", "unità", "unidad"].iter().any(|w| line.contains(w)));
    let common = stated.filter_map(|line| unit_of(line)).find_map(|(length, size)| length.then_some(size));
    let length = |name: &str, otherwise: f64| {
        unit_of(name).filter(|(length, _)| *length).map(|(_, mm)| mm).or(common).unwrap_or(otherwise)
    };
    if names.is_empty() {
        let roles = by_values(block, common, nominal_mm).ok_or_else(|| found(block, &names))?;
        return Ok((roles, false));
    }
    let mut roles: Vec<Column> = Vec::new();
    for (at, name) in names.iter().enumerate() {
        let column = || block.rows.iter().map(|row| row[at]);
        roles.push(if is_named(name, ANGLE) {
            let radians = column().fold(0.0_f64, |most, v| most.max(v.abs())) <= 6.3 && block.rows.len() > 16;
            Column::Angle(
                unit_of(name)
                    .filter(|(length, _)| !length)
                    .map_or(if radians { DEG_PER_RAD } else { 1.0 }, |(_, deg)| deg),
            )
        } else if is_named(name, DIAMETER) {
            Column::Radius(0.5 * length(name, 1.0))
        } else if is_named(name, RADIUS) || matches!(name.split([' ', '[', '(', '_']).next(), Some("r")) {
            Column::Radius(length(name, 1.0))
        } else if matches!(name.split([' ', '[', '(', '_']).next(), Some("x")) {
            Column::X(length(name, 1.0))
        } else if matches!(name.split([' ', '[', '(', '_']).next(), Some("y")) {
            Column::Y(length(name, 1.0))
        } else if is_named(name, HEIGHT) {
            Column::Z(length(name, 1.0))
        } else if is_named(name, DEVIATION) {
            Column::Deviation(1e3 * length(name, 1e-3))
        } else if is_named(name, INDEX) {
            Column::Other
        } else if matches!(unit_of(name), Some((false, _))) {
            Column::Angle(unit_of(name).map_or(1.0, |(_, deg)| deg))
        } else {
            Column::Other
        });
    }
    // Of several deviations (raw, filtered) the first is the profile; radii say more than deviations.
    let radius = roles.iter().position(|role| matches!(role, Column::Radius(_)));
    let points =
        roles.iter().any(|role| matches!(role, Column::X(_))) && roles.iter().any(|role| matches!(role, Column::Y(_)));
    let mut seen = false;
    for (at, role) in roles.iter_mut().enumerate() {
        let value = matches!(role, Column::Radius(_) | Column::Deviation(_));
        let spare = value && (points || seen || radius.is_some_and(|radius| radius != at));
        seen |= value && !spare;
        if spare || (points && matches!(role, Column::Angle(_))) {
            *role = Column::Other;
        }
    }
    let unit = |at: usize| unit_of(&names[at]).filter(|(length, _)| *length).map(|(_, mm)| mm).or(common);
    let assumed = roles.iter().enumerate().any(|(at, role)| matches!(role, Column::Deviation(_)) && unit(at).is_none());
    if seen || points { Ok((roles, assumed)) } else { Err(found(block, &names)) }
}

/// What columns without names are.
fn by_values(block: &Block, common: Option<f64>, nominal_mm: Option<f64>) -> Option<Vec<Column>> {
    let width = block.rows[0].len();
    let column = |at: usize| block.rows.iter().map(|row| row[at]).collect::<Vec<f64>>();
    let range = |v: &[f64]| v.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| (l.min(*x), h.max(*x)));
    let n = block.rows.len() as f64;
    let value = |v: &[f64]| {
        let (low, high) = range(v);
        let (middle, spread) = (0.5 * (low + high), high - low);
        let mm = common.unwrap_or(1.0);
        if low > 0.0
            && spread < 0.1 * middle
            && middle * mm > 0.1
            && nominal_mm.is_none_or(|r| (middle * mm / r - 1.0).abs() < 0.1)
        {
            Some(Column::Radius(mm))
        } else if nominal_mm.is_some() && middle.abs() <= 2.0 * spread {
            // Hundredths of a mm at most, or um.
            common.map(|mm| Column::Deviation(1e3 * mm))
        } else {
            None
        }
    };
    let even = |v: &[f64]| v.windows(2).all(|p| ((p[1] - p[0]) - (v[1] - v[0])).abs() < 1e-2 * (v[1] - v[0]).abs());
    let counts =
        |v: &[f64]| even(v) && (v[1] - v[0] - 1.0).abs() < 1e-9 && (v[0].abs() < 1e-9 || (v[0] - 1.0).abs() < 1e-9);
    let turns = |v: &[f64]| {
        let (low, high) = range(v);
        let span = (high - low) * n / (n - 1.0).max(1.0);
        v.windows(2).filter(|p| (p[1] > p[0]) == (v[1] > v[0])).count() + 2 >= v.len()
            && (355.0..=365.0).contains(&span)
    };
    let radians = |v: &[f64]| {
        let (low, high) = range(v);
        v.windows(2).all(|p| p[1] > p[0])
            && ((high - low) * n / (n - 1.0).max(1.0) - std::f64::consts::TAU).abs() < 0.05
    };
    let first = usize::from(width > 1 && counts(&column(0)) && !turns(&column(0)));
    let mut roles = vec![Column::Other; first];
    match width - first {
        1 => roles.push(value(&column(first))?),
        rest => {
            let (a, b) = (column(first), column(first + 1));
            if turns(&a) || radians(&a) {
                roles.push(Column::Angle(if turns(&a) { 1.0 } else { DEG_PER_RAD }));
                roles.push(value(&b)?);
            } else if is_circle(&a, &b) {
                let mm = common.unwrap_or(1.0);
                roles.extend([Column::X(mm), Column::Y(mm)]);
                if rest > 2 {
                    roles.push(Column::Z(mm));
                }
            } else {
                return None;
            }
            roles.extend(vec![Column::Other; width - roles.len()]);
        }
    }
    Some(roles)
}

/// Whether two columns go round: all about equally far from the middle of their ranges.
fn is_circle(x: &[f64], y: &[f64]) -> bool {
    let middle = |v: &[f64]| {
        let (low, high) = v.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| (l.min(*x), h.max(*x)));
        0.5 * (low + high)
    };
    let (cx, cy) = (middle(x), middle(y));
    let r: Vec<f64> = x.iter().zip(y).map(|(x, y)| (x - cx).hypot(y - cy)).collect();
    let mean = r.iter().sum::<f64>() / r.len() as f64;
    mean > 0.0 && r.iter().all(|r| (r / mean - 1.0).abs() < 0.1)
}

pub(super) fn found(block: &Block, names: &[String]) -> Unknown {
    let width = block.rows[0].len();
    Unknown::Columns(
        (0..width)
            .map(|at| {
                let values = block.rows.iter().map(|row| row[at]);
                let (low, high) = values.fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), v| (l.min(v), h.max(v)));
                format!("{} ({low} .. {high})", names.get(at).map_or("?", String::as_str))
            })
            .collect(),
    )
}
