//! Pictures of a study: a map over two numbers, curves over one.
//!
//! Labels are those of fields: the title's values hold the ways to them through the contract, under the codes that the
//! axes and curves have, and the reader's language calls them by their names.

use precut_calc::calculator::{Axis, Figure, Frame, Item, Message, Panel, Role, Value};

use super::input::{Combine, Spacing};
use super::label::{Side, ways};
use super::plan::Plan;
use super::result::{Row, Setting, StudyResult};
use crate::registry::{Entry, Registry, interned};

/// `id`s of the figures.
pub(crate) const FIGURES: &[&str] = &["map", "curves"];
/// Codes of axes that have texts.
pub(crate) const LABELS: &[&str] = &["study_row"];
/// Codes of titles.
pub(crate) const TITLES: &[&str] = &["study_map", "study_curves"];

const VALUES: [&str; 4] = ["study_value_0", "study_value_1", "study_value_2", "study_value_3"];
const CURVES: [&str; 8] = [
    "study_curve_0",
    "study_curve_1",
    "study_curve_2",
    "study_curve_3",
    "study_curve_4",
    "study_curve_5",
    "study_curve_6",
    "study_curve_7",
];
const SLICES: [&str; 6] =
    ["study_slice_0", "study_slice_1", "study_slice_2", "study_slice_3", "study_slice_4", "study_slice_5"];
const X: &str = "study_x";
const Y: &str = "study_y";

/// What is drawn: a study with as many of its rows as there are.
struct Board<'s> {
    combine: Combine,
    variables: Vec<Variable>,
    outputs: Vec<Output>,
    rows: &'s [Option<&'s Row>],
}

struct Variable {
    way: String,
    unit: Option<String>,
    spacing: Option<Spacing>,
    values: Vec<Setting>,
}

struct Output {
    way: String,
    unit: Option<String>,
}

/// The main picture of a study under way.
pub(super) fn of_plan(plan: &Plan, rows: &[Option<&Row>]) -> Option<Figure> {
    let variables = plan.variables.iter().map(|one| {
        let values = one.values.iter().filter_map(Setting::of).collect();
        (one.pointer.as_str(), one.unit.as_deref(), one.spacing, values)
    });
    let outputs = plan.outputs.iter().map(|one| (one.pointer.as_str(), one.unit.as_deref()));
    let parts = (variables.collect(), outputs.collect::<Vec<_>>());
    let board = Board::new(Some(&plan.entry), plan.input.combine, parts, rows);
    board.map().or_else(|| board.curves())
}

/// The pictures of a study; the first is the main one.
pub(super) fn of_result(registry: &Registry, result: &StudyResult) -> Vec<Figure> {
    let rows: Vec<Option<&Row>> = result.rows.iter().map(Some).collect();
    let variables =
        result.variables.iter().map(|one| (one.pointer.as_str(), one.unit.as_deref(), one.spacing, one.values.clone()));
    let outputs = result.outputs.iter().map(|one| (one.pointer.as_str(), one.unit.as_deref()));
    let entry = registry.entry(&result.calculator).map(|entry| &**entry);
    let board = Board::new(entry, result.combine, (variables.collect(), outputs.collect()), &rows);
    board.map().into_iter().chain(board.curves()).collect()
}

type VariableParts<'p> = (&'p str, Option<&'p str>, Option<Spacing>, Vec<Setting>);

impl<'s> Board<'s> {
    fn new(
        entry: Option<&Entry>,
        combine: Combine,
        (variables, outputs): (Vec<VariableParts<'_>>, Vec<(&str, Option<&str>)>),
        rows: &'s [Option<&'s Row>],
    ) -> Self {
        let fields: Vec<_> = variables.iter().map(|(pointer, ..)| *pointer).collect();
        let names = ways(entry, Side::Job, &fields);
        let variables = variables.into_iter().zip(names).map(|((_, unit, spacing, values), way)| Variable {
            way,
            unit: unit.map(str::to_owned),
            spacing,
            values,
        });
        let names = ways(entry, Side::Result, &outputs.iter().map(|(pointer, _)| *pointer).collect::<Vec<_>>());
        let outputs = outputs.iter().zip(names).map(|((_, unit), way)| Output { way, unit: unit.map(str::to_owned) });
        Self { combine, variables: variables.collect(), outputs: outputs.collect(), rows }
    }

    /// The variables, those first that can be an axis.
    fn order(&self) -> Vec<usize> {
        let (mut numeric, other): (Vec<_>, Vec<_>) =
            (0..self.variables.len()).partition(|&index| self.variables[index].is_axis());
        numeric.extend(other);
        numeric
    }

    /// An output where the variables have these values, by number.
    fn output(&self, output: usize, places: &[usize]) -> Option<f64> {
        // The last variable changes fastest.
        let lengths = self.variables.iter().map(|variable| variable.values.len());
        let row = places.iter().zip(lengths).fold(0, |row, (place, length)| row * length + place);
        self.rows.get(row).copied().flatten()?.outputs.get(output).copied().flatten()
    }

    fn map(&self) -> Option<Figure> {
        let order = self.order();
        let [x, y, rest @ ..] = order.as_slice() else { return None };
        let (x, y) = (*x, *y);
        let fits = self.combine == Combine::Grid && self.variables[x].is_axis() && self.variables[y].is_axis();
        if !fits {
            return None;
        }
        let names = self.outputs.iter().take(VALUES.len()).map(|output| output.way.clone()).collect::<Vec<_>>();
        let mut title = Message::new("study_map")
            .with(X, self.variables[x].name())
            .with(Y, self.variables[y].name())
            .with("outputs", if rest.is_empty() { names.clone() } else { names[..1].to_vec() });
        let panels = if let [third] = rest {
            title = title.with(VALUES[0], vec![names[0].clone()]);
            let slices = &self.variables[*third];
            let chosen = chosen(slices.values.len(), SLICES.len());
            let mut panels = Vec::new();
            for (code, place) in SLICES.into_iter().zip(chosen) {
                title = title.with(code, Value::List(vec![self.variables[y].way.clone().into(), slices.is(place)]));
                panels.push(self.map_panel(0, (x, y), Some((*third, place)), code));
            }
            panels
        } else {
            for (code, name) in VALUES.into_iter().zip(&names) {
                title = title.with(code, vec![name.clone()]);
            }
            (0..names.len()).map(|output| self.map_panel(output, (x, y), None, Y)).collect()
        };
        let x = self.variables[x].axis(X);
        Some(Figure { id: "map", title, frame: Frame::Stacked, x, panels })
    }

    fn map_panel(
        &self,
        output: usize,
        (x, y): (usize, usize),
        slice: Option<(usize, usize)>,
        label: &'static str,
    ) -> Panel {
        let (columns, rows) = (self.variables[x].ascending(), self.variables[y].ascending());
        let mut places = vec![0; self.variables.len()];
        if let Some((variable, place)) = slice {
            places[variable] = place;
        }
        let mut values = Vec::with_capacity(columns.len() * rows.len());
        for (_, row) in &rows {
            for (_, column) in &columns {
                places[x] = *column;
                places[y] = *row;
                values.push(self.output(output, &places));
            }
        }
        let has = |sign: fn(f64) -> bool| values.iter().flatten().any(|&value| sign(value));
        let diverging = has(|value| value < 0.0) && has(|value| value > 0.0);
        let numbers = |places: &[(f64, usize)]| places.iter().map(|(number, _)| *number).collect();
        let item = Item::HeatMap {
            value: Axis::linear(VALUES[output], self.outputs[output].unit()),
            x: numbers(&columns),
            y: numbers(&rows),
            values,
            diverging,
        };
        Panel { y: self.variables[y].axis(label), height: 1.0, items: vec![item] }
    }

    fn curves(&self) -> Option<Figure> {
        let order = self.order();
        let (&x, rest) = order.split_first()?;
        let family = if self.combine == Combine::Zip { &[] } else { rest };
        let variable = &self.variables[x];
        let mut title = Message::new("study_curves");
        let mut outputs: Vec<String> = self.outputs.iter().take(VALUES.len()).map(|one| one.way.clone()).collect();
        let along: Vec<(f64, usize)> = if variable.is_axis() {
            title = title.with(X, variable.name());
            variable.ascending()
        } else {
            (0..variable.values.len()).map(|place| (place as f64, place)).collect()
        };
        let mut panels = Vec::new();
        match family {
            [] | [_] => {
                for (output, code) in (0..self.outputs.len()).zip(VALUES) {
                    title = title.with(code, vec![outputs[output].clone()]);
                    let items = self.lines(output, x, &along, family.first().copied(), None, code);
                    let y = Axis::linear(code, self.outputs[output].unit());
                    panels.push(Panel { y, height: 1.0, items });
                }
            }
            [second, third, ..] => {
                outputs.truncate(1);
                let slices = &self.variables[*third];
                for (code, place) in SLICES.into_iter().zip(chosen(slices.values.len(), SLICES.len())) {
                    title = title.with(code, Value::List(vec![outputs[0].clone().into(), slices.is(place)]));
                    let items = self.lines(0, x, &along, Some(*second), Some((*third, place)), code);
                    let y = Axis::linear(code, self.outputs[0].unit());
                    panels.push(Panel { y, height: 1.0, items });
                }
            }
        }
        if let Some(&second) = family.first() {
            let second = &self.variables[second];
            for (code, place) in CURVES.into_iter().zip(chosen(second.values.len(), CURVES.len())) {
                title = title.with(code, Value::List(vec![second.is(place)]));
            }
        }
        title = title.with("outputs", outputs);
        let axis = if variable.is_axis() { variable.axis(X) } else { Axis::linear("study_row", "1") };
        Some(Figure { id: "curves", title, frame: Frame::Stacked, x: axis, panels })
    }

    /// One curve, or one for each chosen value of the variable `family`.
    fn lines(
        &self,
        output: usize,
        x: usize,
        along: &[(f64, usize)],
        family: Option<usize>,
        slice: Option<(usize, usize)>,
        alone: &'static str,
    ) -> Vec<Item> {
        let mut places = vec![0; self.variables.len()];
        if let Some((variable, place)) = slice {
            places[variable] = place;
        }
        let curve = |name, places: &mut Vec<usize>, role| {
            let numbers = along.iter().map(|(number, _)| *number).collect();
            let ordinates = along
                .iter()
                .map(|&(_, place)| {
                    if self.combine == Combine::Zip {
                        return self.rows.get(place).copied().flatten()?.outputs.get(output).copied().flatten();
                    }
                    places[x] = place;
                    self.output(output, places)
                })
                .collect();
            if self.variables[x].is_axis() {
                Item::Line { name, x: numbers, y: ordinates, role }
            } else {
                Item::Bars { name, x: numbers, y: ordinates, role }
            }
        };
        let Some(family) = family else { return vec![curve(alone, &mut places, Role::Plain)] };
        let chosen = chosen(self.variables[family].values.len(), CURVES.len());
        let each = CURVES.into_iter().zip(0_u8..).zip(chosen).map(|((name, number), place)| {
            places[family] = place;
            curve(name, &mut places, Role::Series(number))
        });
        each.collect()
    }
}

impl Variable {
    /// Whether it can be an axis: at least two numbers.
    fn is_axis(&self) -> bool {
        self.values.len() > 1 && self.values.iter().all(|value| value.number().is_some())
    }

    /// Its numbers in ascending order with their places among the values.
    fn ascending(&self) -> Vec<(f64, usize)> {
        let numbers = self.values.iter().enumerate();
        let mut numbers: Vec<(f64, usize)> =
            numbers.filter_map(|(place, value)| value.number().map(|number| (number, place))).collect();
        numbers.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
        numbers
    }

    fn axis(&self, label: &'static str) -> Axis {
        let unit = self.unit.as_deref().map_or("1", interned);
        match self.spacing {
            Some(Spacing::Log) => Axis::logarithmic(label, unit),
            _ => Axis::linear(label, unit),
        }
    }

    fn name(&self) -> Value {
        vec![self.way.clone()].into()
    }

    /// What it is set to: way, value, unit.
    fn is(&self, place: usize) -> Value {
        set(&self.way, &self.values[place], self.unit.as_deref())
    }
}

/// A field that is set, as the texts take it: way, value, unit.
pub(super) fn set(way: &str, setting: &Setting, unit: Option<&str>) -> Value {
    let value = setting.number().map_or_else(|| setting.to_string().into(), Value::Number);
    Value::List(vec![way.to_owned().into(), value, unit.unwrap_or("1").to_owned().into()])
}

impl Output {
    fn unit(&self) -> &'static str {
        self.unit.as_deref().map_or("1", interned)
    }
}

/// At most so many of a list, evenly, both ends among them.
fn chosen(of: usize, most: usize) -> Vec<usize> {
    if of <= most { (0..of).collect() } else { (0..most).map(|index| index * (of - 1) / (most - 1)).collect() }
}
