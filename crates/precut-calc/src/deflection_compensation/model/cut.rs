//! One cut along the shaft: what the nominal path gives, what must be commanded.

use std::ops::Range;

use crate::calculator::{Failure, Monitor, checkpoint};

use crate::deflection_compensation::answer::output::{OneStep, StatusCompensated, StatusUncompensated};
use crate::deflection_compensation::model::equilibrium::{
    Engagement, command_radius_mm, commanded_model_depth_mm, copying_factor,
};
use crate::deflection_compensation::model::laws::Loads;
use crate::deflection_compensation::model::yielding::{Line, Radii, Solver};

const UM_PER_MM: f64 = 1e3;
/// Stations between two looks at the monitor: less than a millisecond of work.
const STATIONS_PER_CHECK: usize = 2048;

/// A cut along the shaft, station by station.
pub(in crate::deflection_compensation) struct CutLine {
    /// Planned depth a.
    pub nominal_depth_mm: Vec<f64>,
    /// All loads at the planned depth, also those that do not act.
    pub loads: NominalLoads,
    /// Y(a).
    pub y_mm: Vec<f64>,
    /// Z(a); empty where nothing moves the axis aside, see `model::at`.
    pub z_mm: Vec<f64>,
    /// S'/(1+S') at the planned depth and the command: the copying factor of the compensated cut.
    pub planned_copying: Vec<f64>,
    /// Command r_c.
    pub command_mm: Vec<Option<f64>>,
    pub status_compensated: Vec<StatusCompensated>,
    /// Depth really cut along the nominal line; always there, as the answer has it.
    pub uncompensated_depth_mm: Vec<Option<f64>>,
    pub status_uncompensated: Vec<StatusUncompensated>,
    pub copying: Vec<Option<f64>>,
    /// Largest residual of the equilibrium equation, mm.
    pub residual_mm: f64,
    /// Exponent of the depth, where a power of it is all that acts.
    exponent: Option<f64>,
    /// Lost depth over its linear estimate at the station before: along a shaft it hardly changes.
    loss_ratio: f64,
}

/// Loads at the nominal depth along a shaft. Stations in a row mostly share depth and law, and with them the loads.
#[derive(Debug, Default)]
pub(in crate::deflection_compensation) struct NominalLoads {
    runs: Vec<LoadRun>,
    stations: usize,
}

/// Stations from `first` to the next run have these loads.
#[derive(Debug)]
struct LoadRun {
    first: usize,
    /// Law, and bits of the depth.
    key: (u32, u64),
    loads: Loads,
}

impl NominalLoads {
    /// The loads of the next station.
    #[inline]
    fn next(&mut self, line: &Line, depth_mm: f64) -> Loads {
        let i = self.stations;
        self.stations += 1;
        let key = Self::key(line, i, depth_mm);
        match self.runs.last() {
            Some(run) if run.key == key => run.loads,
            _ => {
                let loads = line.nominal_loads(i, depth_mm);
                self.runs.push(LoadRun { first: i, key, loads });
                loads
            }
        }
    }

    /// Stations with one key have the same loads.
    #[inline]
    fn key(line: &Line, i: usize, depth_mm: f64) -> (u32, u64) {
        (line.law_index(i), depth_mm.to_bits())
    }

    /// The loads at one station.
    pub(in crate::deflection_compensation) fn of(&self, i: usize) -> Loads {
        let after = self.runs.partition_point(|run| run.first <= i);
        self.runs[..after].last().map_or_else(Loads::default, |run| run.loads)
    }

    /// One entry for every run of equal loads.
    pub(in crate::deflection_compensation) fn distinct(&self) -> impl Iterator<Item = &Loads> {
        self.runs.iter().map(|run| &run.loads)
    }

    /// One entry for every station.
    pub(in crate::deflection_compensation) fn along(&self) -> impl Iterator<Item = &Loads> {
        self.runs().flat_map(|(loads, run)| std::iter::repeat_n(loads, run.len()))
    }

    /// One component at every station.
    pub(in crate::deflection_compensation) fn column(&self, component: impl Fn(&Loads) -> f64) -> Vec<f64> {
        let mut column = Vec::with_capacity(self.stations);
        for (loads, run) in self.runs() {
            column.resize(run.end, component(loads));
        }
        column
    }

    /// Stations in a row with the same loads.
    pub(in crate::deflection_compensation) fn runs(&self) -> impl Iterator<Item = (&Loads, Range<usize>)> {
        let ends = self.runs.iter().skip(1).map(|run| run.first).chain([self.stations]);
        self.runs.iter().zip(ends).map(|(run, end)| (&run.loads, run.first..end))
    }
}

/// What becomes of a command that there is.
#[inline]
fn status_of(depth_mm: f64, command_mm: f64) -> StatusCompensated {
    if depth_mm <= 0.0 {
        StatusCompensated::NoStock
    } else if command_mm <= 0.0 {
        StatusCompensated::ToolPastAxis
    } else {
        StatusCompensated::Ok
    }
}

impl CutLine {
    /// Whether all that was computed can be worked with: forces and compliances at the ends of their ranges overflow.
    pub(in crate::deflection_compensation) fn is_in_reach(&self) -> bool {
        let all = |values: &[f64]| values.iter().all(|value| in_reach(*value));
        let known = |values: &[Option<f64>]| values.iter().flatten().all(|value| in_reach(*value));
        all(&self.y_mm) && all(&self.z_mm) && known(&self.uncompensated_depth_mm) && known(&self.copying)
    }

    /// Computes a cut with the forces and compliances of `line` about the radii given.
    pub(in crate::deflection_compensation) fn of(
        line: &Line,
        radii: &Radii,
        monitor: &dyn Monitor,
    ) -> Result<Self, Failure> {
        let n = radii.target.len();
        let mut cut = Self::with_capacity(n, line);
        cut.nominal_depth_mm
            .extend(radii.planned().iter().zip(&radii.target).map(|(planned, target)| planned - target));
        let mut solver = line.solver();
        for first in (0..n).step_by(STATIONS_PER_CHECK) {
            checkpoint(monitor)?;
            let block = first..n.min(first + STATIONS_PER_CHECK);
            if line.only_radial() {
                cut.plan_radial(line, radii, block.clone());
            } else {
                block.clone().for_each(|i| cut.plan(line, radii, i));
            }
            block.for_each(|i| cut.predict_uncompensated(&mut solver, radii, i));
        }
        Ok(cut)
    }

    fn with_capacity(n: usize, line: &Line) -> Self {
        Self {
            nominal_depth_mm: Vec::with_capacity(n),
            loads: NominalLoads::default(),
            y_mm: Vec::with_capacity(n),
            z_mm: Vec::with_capacity(if line.moves_aside() { n } else { 0 }),
            planned_copying: Vec::with_capacity(n),
            command_mm: Vec::with_capacity(n),
            status_compensated: Vec::with_capacity(n),
            uncompensated_depth_mm: Vec::with_capacity(n),
            status_uncompensated: Vec::with_capacity(n),
            copying: Vec::with_capacity(n),
            residual_mm: 0.0,
            exponent: line.exponent(),
            loss_ratio: 1.0,
        }
    }

    /// The explicit command for the wanted radius.
    fn plan(&mut self, line: &Line, radii: &Radii, i: usize) {
        let loads = self.loads.next(line, self.nominal_depth_mm[i]);
        self.plan_at(line, radii, i, &loads);
    }

    fn plan_at(&mut self, line: &Line, radii: &Radii, i: usize, loads: &Loads) {
        let (target, depth) = (radii.target[i], self.nominal_depth_mm[i]);
        let opening = line.opening(i, loads);
        let command = command_radius_mm(target, opening.y_mm, opening.z_mm);
        // S = r_t in the wanted state, so S' = ((r_c + Y) Y' + Z Z')/r_t.
        let slope_at = |r_c: f64| ((r_c + opening.y_mm) * opening.y_slope + opening.z_mm * opening.z_slope) / target;
        // Where the force falls so steeply that the tool is drawn in by itself, no command holds the depth.
        let command = command.filter(|r_c| 1.0 + slope_at(*r_c) > 0.0);
        let slope = command.map_or(0.0, slope_at);
        self.status_compensated.push(match command {
            None => StatusCompensated::NoSolution,
            Some(r_c) => status_of(depth, r_c),
        });
        self.planned_copying.push(slope / (1.0 + slope));
        self.y_mm.push(opening.y_mm);
        if line.moves_aside() {
            self.z_mm.push(opening.z_mm);
        }
        self.command_mm.push(command);
    }

    /// The same for a block of stations where nothing moves the axis aside: then r_c = r_t - Y(a) and S' = Y'(a) up to
    /// the rounding of r_c, and column by column there is no branch left.
    fn plan_radial(&mut self, line: &Line, radii: &Radii, block: std::ops::Range<usize>) {
        let mut first = block.start;
        while first < block.end {
            // Stations with the same loads.
            let loads = self.loads.next(line, self.nominal_depth_mm[first]);
            let key = NominalLoads::key(line, first, self.nominal_depth_mm[first]);
            let mut end = first + 1;
            while end < block.end && NominalLoads::key(line, end, self.nominal_depth_mm[end]) == key {
                end += 1;
            }
            self.loads.stations = end;
            if loads.passive_slope < 0.0 {
                (first..end).for_each(|i| self.plan_at(line, radii, i, &loads));
            } else {
                self.plan_run(line, radii, first..end, &loads);
            }
            first = end;
        }
    }

    fn plan_run(&mut self, line: &Line, radii: &Radii, run: std::ops::Range<usize>, loads: &Loads) {
        let target = &radii.target[run.clone()];
        let depth = self.nominal_depth_mm[run.start];
        let work = &line.work_mm_per_n[run.clone()];
        self.y_mm.extend(work.iter().map(|work| (work + line.carriage_mm_per_n) * loads.passive_n));
        let y = &mut self.y_mm[run.clone()];
        line.add_errors(run, y);
        self.command_mm.extend(y.iter().zip(target).map(|(y, target)| Some(target - y)));
        self.status_compensated.extend(y.iter().zip(target).map(|(y, target)| status_of(depth, target - y)));
        self.planned_copying.extend(work.iter().zip(target).zip(&*y).map(|((work, target), y)| {
            let y_slope = (work + line.carriage_mm_per_n) * loads.passive_slope;
            let slope = ((target - y) + y) * y_slope / target;
            slope / (1.0 + slope)
        }));
    }

    /// What the nominal path r_c = r_t gives.
    #[inline]
    fn predict_uncompensated(&mut self, solver: &mut Solver<'_>, radii: &Radii, i: usize) {
        let (target, stock) = (radii.target[i], radii.stock[i]);
        let commanded = stock - target;
        let guess = self.guess_mm(i, commanded);
        let engagement = if radii.is_idle(i) {
            Engagement::NoContact
        } else if self.exponent.is_some() {
            solver.engage(i, stock, target, guess)
        } else {
            let linear_loss = commanded - guess;
            let engagement = solver.engage(i, stock, target, commanded - self.loss_ratio * linear_loss);
            if let Engagement::Cut { depth_mm, .. } = engagement {
                self.loss_ratio = if linear_loss.abs() > 0.0 { (commanded - depth_mm) / linear_loss } else { 1.0 };
            }
            engagement
        };
        let (status, copying) = match engagement {
            Engagement::Cut { opening, residual_mm, .. } => {
                self.note(residual_mm);
                (StatusUncompensated::Ok, Some(copying_factor(target, opening)))
            }
            Engagement::NoContact => (StatusUncompensated::NoContact, None),
            Engagement::NoCut => (StatusUncompensated::NoCut, None),
        };
        self.status_uncompensated.push(status);
        self.copying.push(copying);
        self.uncompensated_depth_mm.push(Some(engagement.depth_mm()));
    }

    /// Depth that the nominal state lets expect: a + d with d = (t_c - a - Y)/(1 + Y'), one Newton step; where Y is a
    /// power of the depth, the two terms more of the inverse series in q = d/a that its exponent gives.
    #[inline]
    fn guess_mm(&self, i: usize, commanded_depth_mm: f64) -> f64 {
        let (nominal, copying) = (self.nominal_depth_mm[i], self.planned_copying[i]);
        let newton = (commanded_depth_mm - nominal - self.y_mm[i]) * (1.0 - copying);
        match self.exponent {
            Some(z) if nominal > 0.0 => {
                let q = newton / nominal;
                let lean = (1.0 - z) * copying;
                nominal + newton * (1.0 + q * lean * (0.5 + q * (0.5 * lean - (2.0 - z) / 6.0)))
            }
            _ => nominal + newton,
        }
    }

    /// Commands a radius that is larger by so much, mm.
    pub(in crate::deflection_compensation) fn aim(&mut self, by_mm: f64) {
        self.command_mm.iter_mut().flatten().for_each(|command| *command += by_mm);
    }

    /// Keeps the largest residual.
    #[inline]
    pub(in crate::deflection_compensation) fn note(&mut self, residual_mm: f64) {
        if residual_mm.abs() > self.residual_mm {
            self.residual_mm = residual_mm.abs();
        }
    }

    /// Produced radius with given commands, mm: implicit prediction at every station that has one.
    pub(in crate::deflection_compensation) fn produced_mm(
        &mut self,
        line: &Line,
        radii: &Radii,
        commands: &[Option<f64>],
        monitor: &dyn Monitor,
    ) -> Result<Vec<Option<f64>>, Failure> {
        let mut produced = Vec::with_capacity(commands.len());
        let mut solver = line.solver();
        for (i, command) in commands.iter().enumerate() {
            if i % STATIONS_PER_CHECK == 0 {
                checkpoint(monitor)?;
            }
            let stock = radii.stock[i];
            if radii.is_idle(i) {
                produced.push(Some(stock));
                continue;
            }
            produced.push(command.map(|command| {
                let engagement = solver.engage(i, stock, command, self.guess_mm(i, stock - command));
                if let Engagement::Cut { residual_mm, .. } = engagement {
                    self.note(residual_mm);
                }
                stock - engagement.depth_mm()
            }));
        }
        Ok(produced)
    }

    /// Diameter errors of the uncompensated cut, um.
    pub(in crate::deflection_compensation) fn uncompensated_errors_um(&self, radii: &Radii) -> Vec<Option<f64>> {
        self.uncompensated_depth_mm
            .iter()
            .zip(radii.stock.iter().zip(&radii.target))
            .map(|(t, (stock, target))| t.map(|t| 2.0 * (stock - t - target) * UM_PER_MM))
            .collect()
    }
}

/// Whether a number survives what is still done with it: units, squares, sums along the shaft. False for NaN.
fn in_reach(value: f64) -> bool {
    const REACH: f64 = 1e150;
    value.abs() < REACH
}

/// The source paper's one-step formula at every station, and what it leaves (`deflection/4.3`).
///
/// t_calc = a + y i with y = W P_y(a) and i = P_y(a + y)/P_y(a), which is (1 + y/a)^z for a power law.
pub(in crate::deflection_compensation) fn one_step(
    line: &Line,
    radii: &Radii,
    cut: &CutLine,
    depth_exponent: Option<f64>,
) -> OneStep {
    let n = radii.target.len();
    let mut step = OneStep {
        factor: Vec::with_capacity(n),
        depth_mm: Vec::with_capacity(n),
        diameter_error_um: Vec::with_capacity(n),
        residual_commanded_model_um: Vec::with_capacity(n),
        depth_commanded_model_mm: Vec::with_capacity(n),
    };
    let mut solver = line.solver();
    for (i, loads) in cut.loads.along().enumerate() {
        let a = cut.nominal_depth_mm[i];
        let force = loads.passive_n;
        if a <= 0.0 || force <= 0.0 {
            step.push_nothing();
            continue;
        }
        let w = line.compliance_mm_per_n(i);
        let y = w * force;
        let factor = line.passive(i, a + y).0 / force;
        let depth = a + y * factor;
        let residual = depth - w * line.passive(i, depth).0 - a;
        if !in_reach(residual) {
            // Depths beyond the shaft and steep laws: the formula has no number there.
            step.push_nothing();
            continue;
        }
        let (stock, target) = (radii.stock[i], radii.target[i]);
        let command = radii.planned()[i] - depth;
        let produced = stock - solver.engage(i, stock, command, cut.guess_mm(i, stock - command)).depth_mm();
        step.factor.push(Some(factor));
        step.depth_mm.push(Some(depth));
        step.diameter_error_um.push(Some(2.0 * (produced - target) * UM_PER_MM));
        step.residual_commanded_model_um.push(Some(residual * UM_PER_MM));
        step.depth_commanded_model_mm.push(depth_exponent.and_then(|exponent| {
            commanded_model_depth_mm(a, depth, exponent, |t| {
                let (force, slope) = line.passive(i, t);
                (w * force, w * slope)
            })
        }));
    }
    step
}

impl OneStep {
    fn push_nothing(&mut self) {
        self.factor.push(None);
        self.depth_mm.push(None);
        self.diameter_error_um.push(None);
        self.residual_commanded_model_um.push(None);
        self.depth_commanded_model_mm.push(None);
    }
}
