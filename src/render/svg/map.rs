//! A number over the plane as colour. Colours change at round numbers, so that their borders read as
//! contours, and cells of one colour are drawn as one.

use precut_calc::calculator::{Axis, Item, Panel, Spacing};

use super::colour;
use super::page::{Page, Px, put};
use super::plane::Plane;
use super::scale::{Range, Scale, Ticks, coordinate};

/// The numbers of a map.
#[derive(Debug, Clone, Copy)]
pub(super) struct Cells<'a> {
    x: &'a [f64],
    y: &'a [f64],
    values: &'a [Option<f64>],
}

/// Which colour stands for which number.
#[derive(Debug)]
pub(super) struct Key<'a> {
    pub(super) value: Axis,
    pub(super) cells: Cells<'a>,
    pub(super) diverging: bool,
    range: Range,
    /// Ends of the ranges of one colour, ascending, the outer ends among them.
    bounds: Vec<f64>,
    /// The step of the colour scale for each.
    steps: Vec<u8>,
}

/// One of `steps` for the range that is `rank`-th of `count`, the outer ones for the outer ranges.
fn share(rank: usize, count: usize, steps: u8) -> u8 {
    let last = usize::from(steps - 1);
    u8::try_from(rank * last / (count - 1).max(1)).map_or(steps - 1, |step| step.min(steps - 1))
}

/// The step of the range round `middle`: the farther from where colours part, the stronger, alike on both sides.
/// They part where the number is 0; where it is 1, if it is drawn by its logarithm: both have the coordinate 0.
fn from_the_parting(round: &[f64], reach: f64, middle: f64) -> u8 {
    const HALF: u8 = colour::STEPS / 2;
    let within = |size: f64| round.iter().filter(|at| **at > 1e-9 * reach && **at < size).count();
    let step = share(within(middle.abs()), within(reach) + 1, HALF);
    if middle < 0.0 { HALF - 1 - step } else { HALF + step }
}

impl<'a> Key<'a> {
    /// Of the map in a panel, if it has one.
    pub(super) fn of(panel: &'a Panel) -> Option<Self> {
        panel.items.iter().find_map(|item| match item {
            Item::HeatMap { value, x, y, values, diverging } => {
                Some(Self::new(*value, Cells { x, y, values }, *diverging))
            }
            _ => None,
        })
    }

    fn new(value: Axis, cells: Cells<'a>, diverging: bool) -> Self {
        let range = Range::of(value.scale, cells.values.iter().copied().flatten());
        let reach = range.low.abs().max(range.high.abs());
        let spread = if diverging { Range { low: -reach, high: reach } } else { range };
        let most = if diverging { colour::STEPS } else { colour::STEPS - 3 };
        let ticks = Ticks::new(value.scale, spread, f64::from(most), '.');
        let round: Vec<f64> = ticks.marks.iter().map(|(at, _)| *at).collect();
        let inner = round.iter().copied().filter(|at| *at > range.low && *at < range.high);
        let bounds: Vec<f64> = std::iter::once(range.low).chain(inner).chain([range.high]).collect();
        let middles = bounds.windows(2).map(|ends| f64::midpoint(ends[0], ends[1]));
        let steps = if diverging {
            middles.map(|middle| from_the_parting(&round, reach, middle)).collect()
        } else {
            (0..bounds.len() - 1).map(|rank| share(rank, bounds.len() - 1, colour::STEPS)).collect()
        };
        Self { value, cells, diverging, range, bounds, steps }
    }

    fn step(&self, value: f64) -> Option<u8> {
        let at = coordinate(self.value.scale, value)?;
        let inner = &self.bounds[1..self.bounds.len() - 1];
        self.steps.get(inner.partition_point(|bound| *bound <= at)).copied()
    }

    fn is_above(&self, step: u8) -> bool {
        self.diverging && step >= colour::STEPS / 2
    }

    /// About one number for every 27 px.
    pub(super) fn ticks(&self, height: f64, decimal: char) -> Ticks {
        Ticks::new(self.value.scale, self.range, (height / 27.0).clamp(2.0, 10.0), decimal)
    }

    /// From the number to its place on the scale beside the panel.
    pub(super) fn scale(&self, top: f64, bottom: f64) -> Scale {
        Scale::new(self.value.scale, self.range, bottom, top)
    }

    /// The colours as a bar.
    pub(super) fn bar(&self, page: &mut Page, (left, width): (f64, f64), (top, bottom): (f64, f64)) {
        let scale = self.scale(top, bottom);
        put!(page, "<g shape-rendering=\"crispEdges\">");
        for (ends, step) in self.bounds.windows(2).zip(&self.steps) {
            let (low, high) = (scale.px(ends[0]), scale.px(ends[1]));
            let (x, y, height) = (Px(left), Px(high), Px(low - high));
            for class in self.classes(*step) {
                put!(page, "<rect class=\"{class}\" x=\"{x}\" y=\"{y}\" width=\"{width}\" height=\"{height}\"/>");
            }
        }
        let (x, y, height) = (Px(left), Px(top), Px(bottom - top));
        put!(page, "</g><rect class=\"frame\" x=\"{x}\" y=\"{y}\" width=\"{width}\" height=\"{height}\"/>");
    }

    /// A few of its colours, for a legend.
    pub(super) fn sample(&self, page: &mut Page, (left, top): (f64, f64), (width, height): (f64, f64)) {
        const PARTS: u8 = 6;
        let wide = width / f64::from(PARTS);
        for part in 0..PARTS {
            let step = part * (colour::STEPS - 1) / (PARTS - 1);
            let (x, y) = (Px(left + wide * f64::from(part)), Px(top));
            for class in self.classes(step) {
                put!(page, "<rect class=\"{class}\" x=\"{x}\" y=\"{y}\" width=\"{}\" height=\"{height}\"/>", Px(wide));
            }
        }
    }

    fn classes(&self, step: u8) -> impl Iterator<Item = String> + use<> {
        let hatched = self.is_above(step).then(|| "hatch".to_owned());
        std::iter::once(colour::class(self.diverging, step)).chain(hatched)
    }

    /// The map itself.
    pub(super) fn draw(&self, page: &mut Page, plane: &Plane, spacing: (Spacing, Spacing)) {
        let cells = &self.cells;
        let columns: Vec<_> = edges(spacing.0, cells.x).into_iter().map(|ends| Some(plane.abscissae(ends?))).collect();
        let rows: Vec<_> = edges(spacing.1, cells.y).into_iter().map(|ends| Some(plane.ordinates(ends?))).collect();
        let at = |row: usize, column: usize| {
            let value = cells.values.get(row * cells.x.len() + column).copied().flatten()?;
            (columns[column].is_some() && rows[row].is_some()).then(|| self.step(value)).flatten()
        };
        put!(page, "<g shape-rendering=\"crispEdges\">");
        let blocks = blocks(rows.len(), columns.len(), at);
        for step in 0..colour::STEPS {
            let class = colour::class(self.diverging, step);
            draw_blocks(page, plane, (&columns, &rows), &class, blocks.iter().filter(|block| block.kind == step));
        }
        put!(page, "</g>");
        if self.diverging {
            let above = |row, column| at(row, column).filter(|step| self.is_above(*step)).map(|_| 0);
            let blocks = self::blocks(rows.len(), columns.len(), above);
            draw_blocks(page, plane, (&columns, &rows), "hatch", blocks.iter());
        }
    }
}

/// A rectangle of equal cells.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
struct Block {
    kind: u8,
    /// First and last.
    columns: (usize, usize),
    /// First and last.
    rows: (usize, usize),
}

/// Runs of equal cells in each row, those that lie alike in following rows joined.
fn blocks(rows: usize, columns: usize, kind: impl Fn(usize, usize) -> Option<u8>) -> Vec<Block> {
    let mut done = Vec::new();
    let mut open: Vec<Block> = Vec::new();
    for row in 0..rows {
        let mut runs: Vec<Block> = Vec::new();
        for column in 0..columns {
            let Some(kind) = kind(row, column) else { continue };
            match runs.last_mut() {
                Some(run) if run.kind == kind && run.columns.1 + 1 == column => run.columns.1 = column,
                _ => runs.push(Block { kind, columns: (column, column), rows: (row, row) }),
            }
        }
        // Both in the order of their columns.
        let mut above = open.into_iter().peekable();
        for run in &mut runs {
            while let Some(block) = above.next_if(|block| block.columns.0 < run.columns.0) {
                done.push(block);
            }
            if let Some(block) = above.next_if(|block| block.columns == run.columns && block.kind == run.kind) {
                run.rows.0 = block.rows.0;
            }
        }
        done.extend(above);
        open = runs;
    }
    done.extend(open);
    done
}

type Ends = Vec<Option<(f64, f64)>>;

fn draw_blocks<'b>(
    page: &mut Page,
    plane: &Plane,
    (columns, rows): (&Ends, &Ends),
    class: &str,
    blocks: impl Iterator<Item = &'b Block>,
) {
    let mut blocks = blocks.peekable();
    if blocks.peek().is_none() {
        return;
    }
    put!(page, "<path class=\"{class}\" d=\"");
    for block in blocks {
        let ends = |ends: &Ends, (first, last): (usize, usize)| Some((ends[first]?.0, ends[last]?.1));
        if let Some((across, up)) = ends(columns, block.columns).zip(ends(rows, block.rows)) {
            plane.cell(page, across, up);
        }
    }
    put!(page, "\"/>");
}

/// Ends of cells with these middles, as coordinates: half way to the neighbours.
pub(super) fn edges(spacing: Spacing, middles: &[f64]) -> Vec<Option<(f64, f64)>> {
    let places: Vec<Option<f64>> = middles.iter().map(|middle| coordinate(spacing, *middle)).collect();
    let half_way = |from: Option<usize>, to: usize| {
        let (a, b) = (places.get(from?).copied()??, places.get(to).copied()??);
        Some(f64::midpoint(a, b))
    };
    (0..places.len())
        .map(|index| {
            let middle = places[index]?;
            Some(match (half_way(index.checked_sub(1), index), half_way(Some(index), index + 1)) {
                (Some(low), Some(high)) => (low, high),
                (Some(low), None) => (low, middle + (middle - low)),
                (None, Some(high)) => (middle - (high - middle), high),
                (None, None) => (middle - alone(middle), middle + alone(middle)),
            })
        })
        .collect()
}

/// Half the width of what has no neighbour to tell it.
pub(super) fn alone(middle: f64) -> f64 {
    if middle.abs() > 1e-290 { 0.1 * middle.abs() } else { 1.0 }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn key(values: &[Option<f64>], scale: Spacing, diverging: bool) -> Key<'_> {
        Key::new(Axis { label: "v", unit: "1", scale }, Cells { x: &[], y: &[], values }, diverging)
    }

    #[test]
    fn colours_change_at_round_numbers() {
        let values = [Some(-0.3), None, Some(9.7)];
        let key = key(&values, Spacing::Linear, false);
        assert_eq!(key.bounds, [-0.3, 0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0, 9.7]);
        assert_eq!((key.steps[0], key.steps[10]), (0, colour::STEPS - 1), "the whole scale is used");
        assert!(key.steps.is_sorted_by(|a, b| a < b), "each range has its colour: {:?}", key.steps);
        assert_eq!((key.step(-0.3), key.step(9.7)), (key.steps.first().copied(), key.steps.last().copied()));
        assert_ne!(key.step(0.999), key.step(1.0));
        assert_eq!(key.step(f64::NAN), None);
    }

    #[test]
    fn a_diverging_map_parts_at_zero_or_at_one() {
        let half = colour::STEPS / 2;
        let values = [Some(-8.0), Some(0.02)];
        let linear = key(&values, Spacing::Linear, true);
        assert!(linear.step(-1e-9).unwrap() < half && linear.step(0.02).unwrap() >= half, "however small a side is");
        assert_eq!(linear.step(-8.0), Some(0));
        let alike = |value: f64| (linear.step(-value).unwrap(), colour::STEPS - 1 - linear.step(value).unwrap());
        assert!([0.01, 0.02].iter().all(|value| alike(*value).0 == alike(*value).1), "equal sizes look equally strong");
        let values = [Some(0.01), Some(50.0)];
        let logarithmic = key(&values, Spacing::Logarithmic, true);
        assert!(logarithmic.step(0.999).unwrap() < half && logarithmic.step(1.001).unwrap() >= half);
    }

    #[test]
    fn cells_end_half_way_to_their_neighbours() {
        assert_eq!(edges(Spacing::Linear, &[0.0, 1.0, 3.0]), [Some((-0.5, 0.5)), Some((0.5, 2.0)), Some((2.0, 4.0))]);
        assert_eq!(edges(Spacing::Logarithmic, &[0.0, 1.0, 100.0]), [None, Some((-1.0, 1.0)), Some((1.0, 3.0))]);
        assert_eq!(edges(Spacing::Linear, &[10.0]), [Some((9.0, 11.0))]);
    }

    proptest! {
        /// Every cell is covered once, by its own colour.
        #[test]
        fn blocks_are_the_cells(columns in 1_usize..7, cells in proptest::collection::vec(proptest::option::of(0_u8..3), 0..60)) {
            let rows = cells.len() / columns;
            let at = |row: usize, column: usize| cells[row * columns + column];
            let blocks = blocks(rows, columns, at);
            for row in 0..rows {
                for column in 0..columns {
                    let over: Vec<u8> = blocks
                        .iter()
                        .filter(|b| (b.rows.0..=b.rows.1).contains(&row) && (b.columns.0..=b.columns.1).contains(&column))
                        .map(|b| b.kind)
                        .collect();
                    prop_assert_eq!(over, at(row, column).into_iter().collect::<Vec<_>>());
                }
            }
        }
    }
}
