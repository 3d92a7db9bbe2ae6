//! One cut along the shaft: what the nominal path gives, what must be commanded.

use crate::calculator::{Failure, Monitor, checkpoint};

use super::equilibrium::{Engagement, command_radius_mm, commanded_model_depth_mm, copying_factor};
use super::model::{Line, Loads, NominalLoads, Radii};
use super::output::{OneStep, StatusCompensated, StatusUncompensated};

const UM_PER_MM: f64 = 1e3;
/// Stations between two looks at the monitor: about a millisecond of work.
const STATIONS_PER_CHECK: usize = 2048;

/// A cut along the shaft, station by station.
pub(super) struct CutLine {
    /// Planned depth a.
    pub nominal_depth_mm: Vec<f64>,
    /// All loads at the planned depth, also those that do not act.
    pub loads: Vec<Loads>,
    /// Y(a).
    pub y_mm: Vec<f64>,
    /// Z(a).
    pub z_mm: Vec<f64>,
    /// S'/(1+S') at the planned depth and the command: the copying factor of the compensated cut.
    pub planned_copying: Vec<f64>,
    /// Elastic part of Y(a): without stated errors.
    pub elastic_mm: Vec<f64>,
    /// Command r_c.
    pub command_mm: Vec<Option<f64>>,
    pub status_compensated: Vec<StatusCompensated>,
    /// Depth really cut along the nominal line.
    pub uncompensated_depth_mm: Vec<f64>,
    pub status_uncompensated: Vec<StatusUncompensated>,
    pub copying: Vec<Option<f64>>,
    /// Largest residual of the equilibrium equation, mm.
    pub residual_mm: f64,
    /// Lost depth over its linear estimate at the station before: along a shaft it hardly changes.
    loss_ratio: f64,
}

impl CutLine {
    /// Computes a cut with the forces and compliances of `line` about the radii given.
    pub(super) fn of(line: &Line, radii: &Radii, monitor: &dyn Monitor) -> Result<Self, Failure> {
        let n = radii.target.len();
        let mut cut = Self::with_capacity(n);
        let mut last = NominalLoads::default();
        for i in 0..n {
            if i % STATIONS_PER_CHECK == 0 {
                checkpoint(monitor)?;
            }
            cut.plan(line, radii, i, &mut last);
            cut.predict_uncompensated(line, radii, i);
        }
        Ok(cut)
    }

    fn with_capacity(n: usize) -> Self {
        Self {
            nominal_depth_mm: Vec::with_capacity(n),
            loads: Vec::with_capacity(n),
            y_mm: Vec::with_capacity(n),
            z_mm: Vec::with_capacity(n),
            planned_copying: Vec::with_capacity(n),
            elastic_mm: Vec::with_capacity(n),
            command_mm: Vec::with_capacity(n),
            status_compensated: Vec::with_capacity(n),
            uncompensated_depth_mm: Vec::with_capacity(n),
            status_uncompensated: Vec::with_capacity(n),
            copying: Vec::with_capacity(n),
            residual_mm: 0.0,
            loss_ratio: 1.0,
        }
    }

    /// The explicit command for the wanted radius.
    fn plan(&mut self, line: &Line, radii: &Radii, i: usize, last: &mut NominalLoads) {
        let target = radii.target[i];
        let depth = radii.planned[i] - target;
        let loads = line.nominal_loads(i, depth, last);
        let opening = line.opening(i, &loads);
        let command = command_radius_mm(target, opening.y_mm, opening.z_mm);
        let slope = match command {
            // S = r_t in the wanted state, so S' = ((r_c + Y) Y' + Z Z')/r_t.
            Some(r_c) => ((r_c + opening.y_mm) * opening.y_slope + opening.z_mm * opening.z_slope) / target,
            None => 0.0,
        };
        self.status_compensated.push(match command {
            None => StatusCompensated::NoSolution,
            Some(_) if depth <= 0.0 => StatusCompensated::NoStock,
            Some(r_c) if r_c <= 0.0 => StatusCompensated::ToolPastAxis,
            Some(_) => StatusCompensated::Ok,
        });
        self.nominal_depth_mm.push(depth);
        self.elastic_mm.push(line.elastic_mm(i, &opening));
        self.planned_copying.push(slope / (1.0 + slope));
        self.y_mm.push(opening.y_mm);
        self.z_mm.push(opening.z_mm);
        self.loads.push(loads);
        self.command_mm.push(command);
    }

    /// What the nominal path r_c = r_t gives.
    fn predict_uncompensated(&mut self, line: &Line, radii: &Radii, i: usize) {
        let (target, stock) = (radii.target[i], radii.stock[i]);
        let commanded = stock - target;
        let linear_loss = commanded - self.guess_mm(i, commanded);
        let engagement = line.engage(i, stock, target, commanded - self.loss_ratio * linear_loss);
        if let Engagement::Cut { depth_mm, .. } = engagement {
            self.loss_ratio = if linear_loss.abs() > 0.0 { (commanded - depth_mm) / linear_loss } else { 1.0 };
        }
        self.status_uncompensated.push(match engagement {
            Engagement::Cut { .. } => StatusUncompensated::Ok,
            Engagement::NoContact => StatusUncompensated::NoContact,
            Engagement::NoCut => StatusUncompensated::NoCut,
        });
        self.note(engagement);
        self.copying.push(match engagement {
            Engagement::Cut { opening, .. } => Some(copying_factor(target, opening)),
            _ => None,
        });
        self.uncompensated_depth_mm.push(engagement.depth_mm());
    }

    /// Depth that the nominal state lets expect: t_c - Y/(1 + Y'), one Newton step of the linearised cut.
    fn guess_mm(&self, i: usize, commanded_depth_mm: f64) -> f64 {
        let copying = self.planned_copying[i];
        let extra = commanded_depth_mm - self.nominal_depth_mm[i];
        self.nominal_depth_mm[i] + (extra - self.y_mm[i]) * (1.0 - copying)
    }

    fn note(&mut self, engagement: Engagement) {
        if let Engagement::Cut { residual_mm, .. } = engagement {
            self.residual_mm = self.residual_mm.max(residual_mm.abs());
        }
    }

    /// Produced radius with given commands, mm: implicit prediction at every station that has one.
    pub(super) fn produced_mm(
        &mut self,
        line: &Line,
        radii: &Radii,
        commands: &[Option<f64>],
        monitor: &dyn Monitor,
    ) -> Result<Vec<Option<f64>>, Failure> {
        let mut produced = Vec::with_capacity(commands.len());
        for (i, command) in commands.iter().enumerate() {
            if i % STATIONS_PER_CHECK == 0 {
                checkpoint(monitor)?;
            }
            produced.push(command.map(|command| {
                let stock = radii.stock[i];
                let engagement = line.engage(i, stock, command, self.guess_mm(i, stock - command));
                self.note(engagement);
                stock - engagement.depth_mm()
            }));
        }
        Ok(produced)
    }

    /// Diameter errors of the uncompensated cut, um.
    pub(super) fn uncompensated_errors_um(&self, radii: &Radii) -> Vec<Option<f64>> {
        self.uncompensated_depth_mm
            .iter()
            .zip(radii.stock.iter().zip(&radii.target))
            .map(|(t, (stock, target))| Some(2.0 * (stock - t - target) * UM_PER_MM))
            .collect()
    }
}

/// The source paper's one-step formula at every station, and what it leaves (`deflection/4.3`).
///
/// t_calc = a + y i with y = W P_y(a) and i = P_y(a + y)/P_y(a), which is (1 + y/a)^z for a power law.
pub(super) fn one_step(line: &Line, radii: &Radii, cut: &CutLine, depth_exponent: Option<f64>) -> OneStep {
    let n = radii.target.len();
    let mut step = OneStep {
        factor: Vec::with_capacity(n),
        depth_mm: Vec::with_capacity(n),
        diameter_error_um: Vec::with_capacity(n),
        residual_commanded_model_um: Vec::with_capacity(n),
        depth_commanded_model_mm: Vec::with_capacity(n),
    };
    for i in 0..n {
        let a = cut.nominal_depth_mm[i];
        let force = cut.loads[i].passive_n;
        if a <= 0.0 || force <= 0.0 {
            step.push_nothing();
            continue;
        }
        let w = line.compliance_mm_per_n(i);
        let y = w * force;
        let factor = line.passive(i, a + y).0 / force;
        let depth = a + y * factor;
        let (stock, target) = (radii.stock[i], radii.target[i]);
        let command = radii.planned[i] - depth;
        let produced = stock - line.engage(i, stock, command, cut.guess_mm(i, stock - command)).depth_mm();
        step.factor.push(Some(factor));
        step.depth_mm.push(Some(depth));
        step.diameter_error_um.push(Some(2.0 * (produced - target) * UM_PER_MM));
        step.residual_commanded_model_um.push(Some((depth - w * line.passive(i, depth).0 - a) * UM_PER_MM));
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
