//! The values that come nearest to the readings, how well they are known, and which further load would tell more.

use std::collections::BTreeMap;

use crate::calculator::{Failure, Finding, Monitor};
use crate::num::dense::{Columns, Qr, length};
use crate::num::lsq;
use crate::num::stats::chi_squared_tail;
use crate::shaft::places;

use super::input::{GaugeRow, GaugedAt};
use super::model::{Model, Unknown};

/// Codes of a faultless job without answer.
pub(super) const FAILURE_CODES: &[&str] = &["not_identifiable"];

/// Columns of unit length of which one is nearer than this to the others: they cannot be told apart by any gauge.
const SAME: f64 = 1e-6;
/// Share of a column that another one makes up and is worth naming.
const NAMED: f64 = 0.05;
/// Readings that are less probable than this do not fit.
pub(super) const UNLIKELY: f64 = 0.01;

/// What was found.
pub(super) struct Found {
    pub values: Vec<f64>,
    /// Standard uncertainties.
    pub uncertainties: Vec<f64>,
    pub p_value: Option<f64>,
    pub repeat_um: Option<f64>,
    pub widened: f64,
}

/// Finds the values.
pub(super) fn solve(model: &Model<'_>, monitor: &dyn Monitor) -> Result<Found, Failure> {
    let rows = model.job.measurements.rows();
    let start = model.start();
    let slopes = model.slopes(&start, rows).ok_or_else(does_not_stand)?;
    if let Some(alike) = told_apart(&slopes).err() {
        return Err(Failure::OutOfModel(not_identifiable(model, &start, &alike)));
    }
    let parameters: Vec<lsq::Parameter> =
        start.iter().map(|start| lsq::Parameter::free(*start).within(0.0, f64::INFINITY)).collect();
    let stop = || monitor.cancelled();
    let settings = lsq::Settings { stop: Some(&stop), ..lsq::Settings::default() };
    let fit = lsq::fit(model, &parameters, &settings)
        .map_err(|error| Failure::Internal(format!("readings without a start: {error}")))?;
    if matches!(fit.ending, lsq::Ending::Stopped) {
        return Err(Failure::Cancelled);
    }
    let slopes = model.slopes(&fit.parameters, rows).ok_or_else(does_not_stand)?;
    if let Some(alike) = told_apart(&slopes).err() {
        return Err(Failure::OutOfModel(not_identifiable(model, &fit.parameters, &alike)));
    }
    let chi_squared: f64 = fit.residuals.iter().map(|residual| residual * residual).sum();
    let spare = rows.len() - model.unknowns.len();
    // Rows are far fewer than 2^53.
    #[allow(clippy::cast_precision_loss)]
    let spare = spare as f64;
    let p_value = (spare > 0.0).then(|| chi_squared_tail(chi_squared, spare));
    let widened = if p_value.is_some_and(|p| p < UNLIKELY) { (chi_squared / spare).sqrt() } else { 1.0 };
    let uncertainties = uncertainties(&slopes).into_iter().map(|one| widened * one).collect();
    Ok(Found { values: fit.parameters, uncertainties, p_value, repeat_um: repeat_um(rows), widened })
}

fn does_not_stand() -> Failure {
    Failure::Internal("a checked bar does not stand".to_owned())
}

/// Standard uncertainties of a linear fit with these slopes in units of the gauge's error.
pub(super) fn uncertainties(slopes: &Columns) -> Vec<f64> {
    let inverse = Qr::pivoted(slopes.clone()).inverse_gram();
    (0..slopes.count()).map(|j| inverse.at(j, j).max(0.0).sqrt()).collect()
}

/// Whether readings with these slopes tell all unknowns apart; otherwise the places of some that they do not.
pub(super) fn told_apart(slopes: &Columns) -> Result<(), Vec<usize>> {
    let mut unit = slopes.clone();
    for j in 0..unit.count() {
        let column = unit.column_mut(j);
        let size = length(column);
        if size == 0.0 {
            return Err(vec![j]);
        }
        for entry in column {
            *entry /= size;
        }
    }
    let factors = Qr::pivoted(unit);
    let rank = factors.rank(SAME);
    let Some(&left_over) = factors.order().get(rank) else { return Ok(()) };
    let mut shares: Vec<f64> = (0..rank).map(|i| factors.r(i, rank)).collect();
    factors.solve_upper(&mut shares);
    let others = (0..rank).filter(|&i| shares[i].abs() > NAMED).map(|i| factors.order()[i]);
    let mut alike: Vec<usize> = std::iter::once(left_over).chain(others).collect();
    alike.sort_unstable();
    Err(alike)
}

fn not_identifiable(model: &Model<'_>, values: &[f64], alike: &[usize]) -> Finding {
    let names: Vec<&'static str> = alike.iter().map(|&j| model.part(model.unknowns[j]).name()).collect();
    let finding = Finding::new("not_identifiable", "/measurements").with("names", names);
    let tells = candidates(model).into_iter().find(|candidate| {
        let rows = with_row(model, *candidate);
        model.slopes(values, &rows).is_some_and(|slopes| told_apart(&slopes).is_ok())
    });
    match tells {
        None => finding,
        Some(row) => {
            let finding = finding.with("force_n", row.force_n).with("at", at_name(row.gauged_at()));
            match row.z_load_mm {
                Some(z) => finding.with("z_load_mm", z),
                None => finding,
            }
        }
    }
}

/// Name of a place of the gauge, as in the contract.
pub(super) fn at_name(at: GaugedAt) -> &'static str {
    match at {
        GaugedAt::Work => "work",
        GaugedAt::Tool => "tool",
    }
}

/// The rows with one more.
fn with_row(model: &Model<'_>, row: GaugeRow) -> Vec<GaugeRow> {
    model.job.measurements.rows().iter().copied().chain([row]).collect()
}

/// Loads that may tell more: at the supports, between them, at the ends of the bar and at the tool, both ways and by half.
fn candidates(model: &Model<'_>) -> Vec<GaugeRow> {
    let job = model.job;
    let most = job.measurements.rows().iter().map(|row| row.force_n.abs()).fold(0.0, f64::max);
    let mut stations: Vec<f64> =
        job.supports.iter().map(|support| support.z_mm().clamp(0.0, job.length_mm())).collect();
    stations.extend([0.0, job.length_mm()]);
    stations.sort_by(f64::total_cmp);
    stations.dedup_by(|a, b| places::same(*a, *b));
    let between: Vec<f64> = stations.windows(2).map(|pair| 0.5 * (pair[0] + pair[1])).collect();
    stations.extend(between);
    let at_work = stations.into_iter().map(|z| (GaugedAt::Work, Some(z)));
    let at_tool = model.unknowns.iter().any(|one| matches!(one, Unknown::Carriage | Unknown::PlayAtTool));
    let places: Vec<(GaugedAt, Option<f64>)> = at_work.chain(at_tool.then_some((GaugedAt::Tool, None))).collect();
    [most, -most, 0.5 * most]
        .into_iter()
        .flat_map(|force_n| {
            places.iter().map(move |&(at, z_load_mm)| GaugeRow {
                at: Some(at),
                z_load_mm,
                force_n,
                ..GaugeRow::default()
            })
        })
        .collect()
}

/// The load that narrows an unknown most: with its uncertainty then, as it is now otherwise counted.
pub(super) fn narrowing(model: &Model<'_>, found: &Found, unknown: usize) -> Option<(GaugeRow, f64)> {
    candidates(model)
        .into_iter()
        .filter_map(|row| {
            let slopes = model.slopes(&found.values, &with_row(model, row))?;
            Some((row, found.widened * uncertainties(&slopes)[unknown]))
        })
        .min_by(|a, b| a.1.total_cmp(&b.1))
}

/// Scatter of readings under the same load at the same place.
fn repeat_um(rows: &[GaugeRow]) -> Option<f64> {
    let mut groups: BTreeMap<_, Vec<f64>> = BTreeMap::new();
    for row in rows {
        let place = (row.gauged_at() == GaugedAt::Work).then(|| {
            let load = row.z_load_mm.unwrap_or_default();
            (load.to_bits(), row.z_reading_mm.unwrap_or(load).to_bits())
        });
        groups.entry((place, row.force_n.to_bits())).or_default().push(row.reading_um);
    }
    let (mut squares, mut spare) = (0.0, 0.0);
    for group in groups.values() {
        // A count of rows is far below 2^53.
        #[allow(clippy::cast_precision_loss)]
        let count = group.len() as f64;
        let mean = group.iter().sum::<f64>() / count;
        squares += group.iter().map(|reading| (reading - mean) * (reading - mean)).sum::<f64>();
        spare += count - 1.0;
    }
    (spare > 0.0).then(|| (squares / spare).sqrt())
}
