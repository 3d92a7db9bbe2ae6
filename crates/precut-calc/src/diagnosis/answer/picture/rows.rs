//! Pictures with a point for every row.

use utoipa::ToSchema;

use super::{figure, panel};
use crate::calculator::{Axis, Figure, Item, Role, Value};
use crate::diagnosis::answer::output::{DiagnosisResult, RowColumns};

/// Labels of the panels of single runs, whose number stands in the title's values; the first so many runs have one.
const OF_RUNS: [&str; 6] = [
    "diagnosis_measured_1",
    "diagnosis_measured_2",
    "diagnosis_measured_3",
    "diagnosis_measured_4",
    "diagnosis_measured_5",
    "diagnosis_measured_6",
];
/// Sets whose signatures are drawn.
const SET_NAMES: [&str; 4] = ["diagnosis_set_1", "diagnosis_set_2", "diagnosis_set_3", "diagnosis_set_4"];
/// Of a normal distribution, two-sided.
const NINETY_FIVE: f64 = 1.959_963_984_540_054;

/// Before and after: in the order of the rows, along the part, and of every run the root mean square.
pub(super) fn residuals<E: ToSchema, R: ToSchema>(output: &DiagnosisResult<E, R>, unit: &'static str) -> Vec<Figure> {
    let rows = &output.rows;
    let left = Residuals::of(rows);
    let axis = Axis::linear("diagnosis_residual", unit);
    let numbers: Vec<f64> = left.index.iter().map(|&index| f64::from(rows.row[index])).collect();
    let sigma = output.noise.standard_deviation;
    let mut figures = vec![figure(
        "residuals",
        "diagnosis_residuals",
        Axis::linear("diagnosis_row", "1"),
        vec![panel(axis, left.items(numbers, sigma))],
    )];
    if let Some((x, places)) = places(rows, &left.index) {
        let items = left.items(places, sigma);
        figures.push(figure("residuals_along", "diagnosis_residuals_along", x, vec![panel(axis, items)]));
    }
    let runs = runs(rows);
    if runs.len() > 1 {
        let rms = |values: &[f64]| -> Vec<Option<f64>> {
            runs.iter()
                .map(|run| {
                    let of: Vec<f64> = left
                        .index
                        .iter()
                        .zip(values)
                        .filter(|(index, _)| rows.run[**index] == *run)
                        .map(|(_, value)| value * value)
                        .collect();
                    (!of.is_empty()).then(|| (of.iter().sum::<f64>() / of.len() as f64).sqrt())
                })
                .collect()
        };
        let x: Vec<f64> = runs.iter().map(|run| f64::from(*run)).collect();
        let bars = |name, values: &[f64], role| Item::Bars { name, x: x.clone(), y: rms(values), role };
        let items = vec![
            bars("diagnosis_base_residual", &left.before, Role::Before),
            bars("diagnosis_extended_residual", &left.after, Role::After),
        ];
        figures.push(figure(
            "residuals_by_run",
            "diagnosis_residuals_by_run",
            Axis::linear("diagnosis_run", "1"),
            vec![panel(Axis::linear("diagnosis_residual_rms", unit), items)],
        ));
    }
    figures
}

/// Measured minus predicted of the rows that have a prediction.
struct Residuals {
    index: Vec<usize>,
    before: Vec<f64>,
    after: Vec<f64>,
}

impl Residuals {
    fn of(rows: &RowColumns) -> Self {
        let mut left = Self { index: Vec::new(), before: Vec::new(), after: Vec::new() };
        for index in 0..rows.row.len() {
            if let (Some(base), Some(extended)) = (rows.base[index], rows.extended[index]) {
                left.index.push(index);
                left.before.push(rows.measured[index] - base);
                left.after.push(rows.measured[index] - extended);
            }
        }
        left
    }

    fn items(&self, x: Vec<f64>, sigma: f64) -> Vec<Item> {
        let (low, high) = x.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), x| (l.min(*x), h.max(*x)));
        let ends = if x.is_empty() { Vec::new() } else { vec![low, high] };
        let band = |value: f64| vec![value; ends.len()];
        vec![
            Item::Band {
                name: "diagnosis_scatter",
                lower: band(-2.0 * sigma),
                upper: band(2.0 * sigma),
                x: ends.clone(),
                role: Role::Uncertainty,
            },
            Item::Points { name: "diagnosis_base_residual", x: x.clone(), y: self.before.clone(), role: Role::Before },
            Item::Points { name: "diagnosis_extended_residual", x, y: self.after.clone(), role: Role::After },
        ]
    }
}

/// Runs that have rows, ascending.
fn runs(rows: &RowColumns) -> Vec<u32> {
    let mut runs = rows.run.clone();
    runs.sort_unstable();
    runs.dedup();
    runs
}

/// Where these rows lie along the part, with the axis of it; `None` where rows have no place.
fn places(rows: &RowColumns, index: &[usize]) -> Option<(Axis, Vec<f64>)> {
    let places: Option<Vec<f64>> = index.iter().map(|&index| rows.place[index]).collect();
    places.filter(|places| !places.is_empty()).map(|places| (Axis::linear("diagnosis_place", "1"), places))
}

/// Abscissa of rows: their place, else their number.
fn abscissa(rows: &RowColumns, index: &[usize]) -> (Axis, Vec<f64>) {
    places(rows, index).unwrap_or_else(|| {
        let numbers = index.iter().map(|&index| f64::from(rows.row[index])).collect();
        (Axis::linear("diagnosis_row", "1"), numbers)
    })
}

/// Measured with both predictions and the band of the extended one, run by run; and predicted against measured.
pub(super) fn predictions<E: ToSchema, R: ToSchema>(output: &DiagnosisResult<E, R>, unit: &'static str) -> Vec<Figure> {
    let rows = &output.rows;
    let shown = Residuals::of(rows).index;
    let value = |column: &[Option<f64>]| -> Vec<f64> { shown.iter().filter_map(|&index| column[index]).collect() };
    let measured: Vec<f64> = shown.iter().map(|&index| rows.measured[index]).collect();
    let points = |name, x, role| Item::Points { name, x, y: measured.clone(), role };
    let (low, high) = measured.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), y| (l.min(*y), h.max(*y)));
    let ends = if measured.is_empty() { Vec::new() } else { vec![low, high] };
    let agreement = vec![
        Item::Line {
            name: "diagnosis_agreement",
            y: ends.iter().copied().map(Some).collect(),
            x: ends,
            role: Role::Nominal,
        },
        points("diagnosis_base_residual", value(&rows.base), Role::Before),
        points("diagnosis_extended_residual", value(&rows.extended), Role::After),
    ];
    vec![
        run_by_run(rows, &shown, unit),
        figure(
            "predicted_against_measured",
            "diagnosis_predicted_against_measured",
            Axis::linear("diagnosis_predicted", unit),
            vec![panel(Axis::linear("diagnosis_measured", unit), agreement)],
        ),
    ]
}

/// Measured with both predictions, a panel for each run. Without places the rows of all runs stand one after the other.
fn run_by_run(rows: &RowColumns, shown: &[usize], unit: &'static str) -> Figure {
    let (x, _) = abscissa(rows, shown);
    let runs: Vec<u32> =
        runs(rows).into_iter().filter(|run| shown.iter().any(|&index| rows.run[index] == *run)).collect();
    let mut drawn = figure("prediction", "diagnosis_prediction", x, Vec::new());
    if runs.len() < 2 || !rows.place.iter().all(Option::is_some) {
        let all = Axis::linear("diagnosis_measured", unit);
        drawn.panels.extend((!shown.is_empty()).then(|| panel(all, of_run(rows, shown.to_vec()))));
        return drawn;
    }
    for (label, run) in OF_RUNS.into_iter().zip(runs) {
        let own = shown.iter().copied().filter(|&index| rows.run[index] == run).collect();
        drawn.panels.push(panel(Axis::linear(label, unit), of_run(rows, own)));
        let measured_in: Vec<Value> = vec!["measured".into(), "run".into(), f64::from(run).into()];
        drawn.title = drawn.title.with(label, vec![measured_in]);
    }
    drawn
}

fn of_run(rows: &RowColumns, mut index: Vec<usize>) -> Vec<Item> {
    let key = |index: usize| rows.place[index].unwrap_or_else(|| f64::from(rows.row[index]));
    index.sort_by(|&a, &b| key(a).total_cmp(&key(b)).then(a.cmp(&b)));
    let (_, x) = abscissa(rows, &index);
    let line = |name, column: &[Option<f64>], role| Item::Line {
        name,
        x: x.clone(),
        y: index.iter().map(|&index| column[index]).collect(),
        role,
    };
    let mut items = Vec::new();
    let band: Option<Vec<(f64, f64)>> =
        index.iter().map(|&index| rows.extended[index].zip(rows.extended_deviation[index])).collect();
    if let Some(band) = band {
        let edge = |sign: f64| band.iter().map(|(middle, sd)| middle + sign * NINETY_FIVE * sd).collect();
        items.push(Item::Band {
            name: "diagnosis_band",
            x: x.clone(),
            lower: edge(-1.0),
            upper: edge(1.0),
            role: Role::Uncertainty,
        });
    }
    items.push(line("diagnosis_base_residual", &rows.base, Role::Before));
    items.push(line("diagnosis_extended_residual", &rows.extended, Role::After));
    let y = index.iter().map(|&index| rows.measured[index]).collect();
    items.push(Item::Points { name: "diagnosis_measured", x, y, role: Role::Plain });
    items
}

/// What is to be explained, and what each leading set makes of it.
pub(super) fn signatures<E: ToSchema, R: ToSchema>(
    output: &DiagnosisResult<E, R>,
    unit: &'static str,
) -> Option<Figure> {
    let rows = &output.rows;
    let mut index = Residuals::of(rows).index;
    let key = |index: usize| (rows.run[index], rows.place[index].unwrap_or_default());
    // Run after run, along the part in each.
    index.sort_by(|&a, &b| {
        let (a_key, b_key) = (key(a), key(b));
        a_key.0.cmp(&b_key.0).then(a_key.1.total_cmp(&b_key.1)).then(a.cmp(&b))
    });
    let x: Vec<f64> = (1..=index.len()).map(|place| place as f64).collect();
    let residual = index.iter().map(|&i| rows.base[i].map_or(0.0, |base| rows.measured[i] - base)).collect();
    let mut items =
        vec![Item::Points { name: "diagnosis_base_residual", x: x.clone(), y: residual, role: Role::Before }];
    for (number, (name, signature)) in (0_u8..).zip(SET_NAMES.iter().zip(&output.signatures)) {
        items.push(Item::Line {
            name,
            x: x.clone(),
            y: index.iter().map(|&i| Some(signature.change[i])).collect(),
            role: Role::Series(number),
        });
    }
    let panels = vec![panel(Axis::linear("diagnosis_residual", unit), items)];
    (!output.signatures.is_empty())
        .then(|| figure("signatures", "diagnosis_signatures", Axis::linear("diagnosis_row", "1"), panels))
}

/// What the catalogue does not explain, with its band, and the amplitudes of its waves.
pub(super) fn remainder<E: ToSchema, R: ToSchema>(output: &DiagnosisResult<E, R>, unit: &'static str) -> Vec<Figure> {
    let Some(remainder) = &output.remainder else { return Vec::new() };
    let rows = &output.rows;
    let key = |index: usize| rows.place[index].unwrap_or_else(|| f64::from(rows.row[index]));
    let mut index: Vec<usize> = (0..rows.row.len()).filter(|&index| rows.used[index]).collect();
    index.sort_by(|&a, &b| key(a).total_cmp(&key(b)).then(a.cmp(&b)));
    let (axis, x) = abscissa(rows, &index);
    let mut items = Vec::new();
    if remainder.standard_deviation.len() == remainder.value.len() {
        let edge = |sign: f64| {
            index.iter().map(|&i| remainder.value[i] + sign * NINETY_FIVE * remainder.standard_deviation[i]).collect()
        };
        items.push(Item::Band {
            name: "diagnosis_band",
            x: x.clone(),
            lower: edge(-1.0),
            upper: edge(1.0),
            role: Role::Uncertainty,
        });
    }
    let y = index.iter().map(|&i| remainder.value[i]).collect();
    items.push(Item::Points { name: "diagnosis_remainder_value", x, y, role: Role::Comparison });
    let value = Axis::linear("diagnosis_remainder_value", unit);
    let mut figures = vec![figure("remainder", "diagnosis_remainder", axis, vec![panel(value, items)])];
    if !remainder.orders.is_empty() {
        let y = remainder.amplitudes.iter().copied().map(Some).collect();
        let bars = Item::Bars { name: "diagnosis_amplitude", x: remainder.orders.clone(), y, role: Role::Comparison };
        figures.push(figure(
            "remainder_spectrum",
            "diagnosis_remainder_spectrum",
            Axis::linear("diagnosis_order", "1"),
            vec![panel(Axis::linear("diagnosis_amplitude", unit), vec![bars])],
        ));
    }
    figures
}
