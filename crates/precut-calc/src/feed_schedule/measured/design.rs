//! How measured cuts hang together: repeats, regressors without physics, groups, the order of testing.

use crate::calculator::{Condition, Design, Grouping, Smooth};

use crate::feed_schedule::job::remainder::KNOWN;
use crate::feed_schedule::measured::forward::{PreparedMachinability, Row};
use crate::feed_schedule::measured::hypotheses::same;
use crate::feed_schedule::measured::levels::{batches, factors};

/// Most folds: more conditions share them by turns, each condition whole.
pub(in crate::feed_schedule) const MOST_FOLDS: usize = 24;

/// Rows that the full regression has to leave for the scatter; below, only slopes are taken out.
const LEAST_LEFT: usize = 5;

/// Cuts without an order along a part; equal cuts are repeats; a condition is held back whole.
pub(in crate::feed_schedule) fn design(prepared: &PreparedMachinability) -> Design {
    let rows = &prepared.rows;
    let cell = cells(rows);
    let count = cell.iter().copied().max().map_or(0, |most| most + 1);
    let pairs: [(&'static str, [&'static str; 2], Of, Of); 3] = [
        ("speed_and_feed", ["speed", "feed"], speed, feed),
        ("speed_and_depth", ["speed", "depth"], speed, depth),
        ("feed_and_depth", ["feed", "depth"], feed, depth),
    ];
    let mut groupings: Vec<Grouping> = pairs
        .into_iter()
        .map(|(name, pair, first, second)| {
            let group = groups(rows, first, second);
            Grouping { name, over: Vec::new(), conditions: pair.to_vec(), group }
        })
        // A level for every condition, or for none, would be scatter or a shift.
        .filter(|grouping| {
            let groups = grouping.group.iter().copied().max().map_or(0, |most| most + 1);
            groups > 1 && groups < count
        })
        .collect();
    groupings.extend(levels(rows));
    Design {
        smooth: Smooth::None,
        fold: cell.iter().map(|cell| cell % MOST_FOLDS).collect(),
        cell,
        regressors: regressors(rows),
        groupings,
        conditions: conditions(rows),
        order: order(rows),
    }
}

/// Levels of every factor, and of the batch, that has more than two: of two the second is shifted, which has a name.
fn levels(rows: &[Row]) -> Vec<Grouping> {
    let place = |levels: &[String], own: Option<&str>| levels.iter().position(|level| Some(level.as_str()) == own);
    let of_batch = {
        let levels = batches(rows);
        let group = rows.iter().map(|row| place(&levels, row.conditions.batch.as_deref()).unwrap_or(0)).collect();
        ("batch".to_owned(), levels, group)
    };
    let of_factor = |(name, levels): (String, Vec<String>)| {
        let group = rows.iter().map(|row| place(&levels, row.conditions.level(&name)).unwrap_or(0)).collect();
        (name, levels, group)
    };
    let all = std::iter::once(of_batch).chain(factors(rows).into_iter().map(of_factor));
    let many = all.filter(|(_, levels, _): &(String, Vec<String>, Vec<usize>)| levels.len() > 2);
    many.map(|(name, _, group)| Grouping { name: "factor", over: vec![name], conditions: Vec::new(), group }).collect()
}

/// What every row states as a number and what differs between them.
fn conditions(rows: &[Row]) -> Vec<Condition> {
    let stated = KNOWN.iter().filter_map(|known| {
        let values = rows.iter().map(|row| row.place(known)).collect::<Option<Vec<f64>>>()?;
        Condition::of(known.name, &values)
    });
    stated.collect()
}

type Of = fn(&Row) -> f64;

fn speed(row: &Row) -> f64 {
    row.u
}

fn feed(row: &Row) -> f64 {
    row.x
}

fn depth(row: &Row) -> f64 {
    row.depth_mm.ln()
}

/// Everything that makes two cuts different for the model.
fn key(row: &Row) -> (Vec<f64>, Vec<String>) {
    let conditions = &row.conditions;
    let absent = -1.0;
    let numbers = vec![
        row.u,
        row.x,
        row.depth_mm.ln(),
        row.angle_deg.unwrap_or(absent),
        row.nose_radius_mm.unwrap_or(absent),
        conditions.flank_wear_mm.unwrap_or(absent),
        conditions.time_min.unwrap_or(absent),
    ];
    let mut words: Vec<String> =
        conditions.factors.iter().map(|known| format!("{}={}", known.factor, known.level)).collect();
    words.sort();
    words.push(conditions.batch.clone().unwrap_or_default());
    (numbers, words)
}

/// Number of the condition of every row, in the order of the conditions: the order of the rows changes nothing.
fn cells(rows: &[Row]) -> Vec<usize> {
    let keys: Vec<(Vec<f64>, Vec<String>)> = rows.iter().map(key).collect();
    let compare = |a: &(Vec<f64>, Vec<String>), b: &(Vec<f64>, Vec<String>)| {
        let numbers =
            a.0.iter().zip(&b.0).map(|(a, b)| if same(*a, *b) { 0.0_f64.total_cmp(&0.0) } else { a.total_cmp(b) });
        numbers.fold(std::cmp::Ordering::Equal, std::cmp::Ordering::then).then_with(|| a.1.cmp(&b.1))
    };
    number(rows.len(), |i, j| compare(&keys[i], &keys[j]))
}

fn groups(rows: &[Row], first: Of, second: Of) -> Vec<usize> {
    let compare = |a: f64, b: f64| if same(a, b) { std::cmp::Ordering::Equal } else { a.total_cmp(&b) };
    number(rows.len(), |i, j| {
        let (a, b) = (&rows[i], &rows[j]);
        compare(first(a), first(b)).then(compare(second(a), second(b)))
    })
}

/// Numbers of classes of equal rows, from 0 in their order.
fn number(rows: usize, compare: impl Fn(usize, usize) -> std::cmp::Ordering) -> Vec<usize> {
    let mut sorted: Vec<usize> = (0..rows).collect();
    sorted.sort_by(|&i, &j| compare(i, j));
    let mut class = vec![0; rows];
    let mut current = 0;
    for (place, &row) in sorted.iter().enumerate() {
        if place > 0 && compare(sorted[place - 1], row).is_ne() {
            current += 1;
        }
        class[row] = current;
    }
    class
}

/// 1, v, s, d, their squares and products, angle, nose radius, wear, batches and levels (`diagnosis/3.1`); of few rows the
/// slopes alone.
fn regressors(rows: &[Row]) -> Vec<Vec<f64>> {
    let column = |of: &dyn Fn(&Row) -> f64| -> Vec<f64> { rows.iter().map(of).collect() };
    // About the mean, so that squares are not nearly their slopes.
    let centred = |of: Of| -> Vec<f64> {
        let mean = rows.iter().map(of).sum::<f64>() / rows.len().max(1) as f64;
        rows.iter().map(|row| of(row) - mean).collect()
    };
    let slopes: Vec<Vec<f64>> = [speed as Of, feed, depth].into_iter().map(centred).collect();
    let mut columns = vec![vec![1.0; rows.len()]];
    columns.extend(slopes.iter().cloned());
    for of in [
        |row: &Row| row.angle_deg.map(f64::ln),
        |row: &Row| row.nose_radius_mm.map(f64::ln),
        |row: &Row| row.conditions.flank_wear_mm,
        |row: &Row| row.conditions.time_min.map(f64::ln_1p),
    ] {
        columns.push(column(&|row| of(row).unwrap_or(0.0)));
    }
    let indicator = |holds: bool| f64::from(u8::from(holds));
    for batch in batches(rows).iter().skip(1) {
        columns.push(column(&|row| indicator(row.conditions.batch.as_deref() == Some(batch))));
    }
    for (factor, levels) in factors(rows) {
        for level in levels.iter().skip(1) {
            columns.push(column(&|row| indicator(row.conditions.level(&factor) == Some(level))));
        }
    }
    // Columns that do not vary say what the constant says.
    let varies = |column: &Vec<f64>| column.iter().any(|value| !same(*value, column[0]));
    let mut kept: Vec<Vec<f64>> =
        columns.into_iter().enumerate().filter(|(k, column)| *k == 0 || varies(column)).map(|(_, c)| c).collect();
    let mut bends = Vec::new();
    for (i, first) in slopes.iter().enumerate() {
        for second in &slopes[i..] {
            bends.push(first.iter().zip(second).map(|(a, b)| a * b).collect::<Vec<f64>>());
        }
    }
    bends.retain(varies);
    if kept.len() + bends.len() + LEAST_LEFT <= rows.len() {
        kept.extend(bends);
    }
    kept
}

/// Place in the order of testing, 0 to 1, where every row has one and they differ.
fn order(rows: &[Row]) -> Option<Vec<f64>> {
    let tests: Vec<f64> = rows.iter().map(|row| row.test).collect::<Option<_>>()?;
    let low = tests.iter().copied().reduce(f64::min)?;
    let high = tests.iter().copied().reduce(f64::max)?;
    (high > low).then(|| tests.iter().map(|test| (test - low) / (high - low)).collect())
}
