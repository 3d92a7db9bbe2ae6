//! One cut with everything that belongs to it, and the passes that lead to the last one.

use crate::calculator::{Failure, Finding, Message, Monitor};

use super::acting::Acting;
use super::cut::CutLine;
use super::equilibrium::copying_factor;
use super::grid::{Grid, interpolate};
use super::input::Job;
use super::model::{Ingredients, Line, Radii, wanted};
use super::output::PassOutcome;
use super::regime::{Regime, Step, passages, section_of_pass};
use super::structure::{Structure, Variant, pass_diameter_mm};

const UM_PER_MM: f64 = 1e3;

/// One cut: structure, forces, radii, and what they give.
pub(super) struct Stage {
    pub regime: Regime,
    pub structure: Structure,
    pub radii: Radii,
    pub line: Line,
    pub cut: CutLine,
    /// Which of the job's cuts it is.
    pub step: Step,
}

impl Stage {
    /// Computes a cut of a job with the effects that act.
    pub(super) fn of(
        job: &Job,
        grid: &Grid,
        acting: &Acting,
        regime: Regime,
        step: Step,
        radii: Radii,
        monitor: &dyn Monitor,
    ) -> Result<Self, Failure> {
        let structure = Structure::of(job, &variant(job, acting, &regime, step.pass_mm))?;
        let passages = if acting.has_errors() { passages(job, grid, &regime, &step) } else { Vec::new() };
        let displaced = structure.displaced(job, &acting.set_off, &grid.z_mm)?;
        let ingredients = Ingredients {
            job,
            grid,
            acting,
            structure: &structure,
            regime: &regime,
            radii: &radii,
            passages: &passages,
            displaced: displaced.as_ref(),
        };
        let line = Line::of(&ingredients, structure.beam.profile(&grid.z_mm, wanted(job)));
        let cut = CutLine::of(&line, &radii, monitor)?;
        Ok(Self { regime, structure, radii, line, cut, step })
    }

    /// How the structure of this cut differs from the job as it stands.
    pub(super) fn variant<'a>(&self, job: &Job, acting: &'a Acting) -> Variant<'a> {
        variant(job, acting, &self.regime, self.step.pass_mm)
    }

    /// Deviation that the cut leaves on the radius when the path is followed that the pass asks for.
    fn outcome(&mut self, compensated: bool, monitor: &dyn Monitor) -> Result<(Vec<f64>, Vec<Option<f64>>), Failure> {
        let commands: Vec<Option<f64>> = if compensated {
            self.cut.command_mm.clone()
        } else {
            self.radii.target.iter().copied().map(Some).collect()
        };
        let produced = self.cut.produced_mm(&self.line, &self.radii, &commands, monitor)?;
        let produced: Option<Vec<f64>> = produced.into_iter().collect();
        let produced = produced.ok_or_else(|| {
            Failure::OutOfModel(
                Finding::new("pass_without_command", "/passes").with("diameter_mm", self.step.pass_mm.unwrap_or(0.0)),
            )
        })?;
        Ok((produced, commands))
    }
}

fn variant<'a>(job: &Job, acting: &'a Acting, regime: &Regime, pass_mm: Option<f64>) -> Variant<'a> {
    let mut variant = Variant::of(job, &acting.structure);
    variant.direction = regime.direction;
    variant.section = section_of_pass(job, acting.structure.uncut_side);
    variant.pass_diameter_mm = pass_mm;
    variant
}

/// The stock of the first cut: the profile where one is given, else the segments'.
pub(super) fn stock_radii_mm(job: &Job, grid: &Grid) -> Vec<f64> {
    match &job.stock_profile {
        Some(profile) => {
            let (z, d): (Vec<f64>, Vec<f64>) = profile.rows().iter().map(|row| (row.z_mm, row.diameter_mm)).unzip();
            interpolate(&z, &d, &grid.z_mm).into_iter().map(|d| d / 2.0).collect()
        }
        None => nominal_stock_radii_mm(job, grid),
    }
}

fn nominal_stock_radii_mm(job: &Job, grid: &Grid) -> Vec<f64> {
    grid.segment.iter().map(|&i| job.shaft.segments[i].stock_mm() / 2.0).collect()
}

/// The blank that the first of several passes is planned on: the nominal one; the measured one where none is stated, or
/// where the stated one leaves nothing to a pass that the measured one does.
fn planned_stock_radii_mm(job: &Job, grid: &Grid, measured: &[f64]) -> Vec<f64> {
    let nominal = nominal_stock_radii_mm(job, grid);
    if job.stock_profile.is_none() {
        return nominal;
    }
    let first = target_radii_mm(job, grid, job.passes.first().and_then(|pass| Step::first(pass.diameter_mm).pass_mm));
    let of = |i: usize| {
        let is_stated = job.shaft.segments[grid.segment[i]].stock_diameter_mm.is_some();
        if is_stated && nominal[i] > first[i] { nominal[i] } else { nominal[i].max(measured[i]) }
    };
    (0..nominal.len()).map(of).collect()
}

fn target_radii_mm(job: &Job, grid: &Grid, pass_mm: Option<f64>) -> Vec<f64> {
    grid.segment.iter().map(|&i| pass_diameter_mm(&job.shaft.segments[i], pass_mm) / 2.0).collect()
}

/// All cuts of a job: all passes as outcomes, none where there is one cut only, and the last cut as a stage. `look` is shown
/// every pass before the last, with its number.
pub(super) fn all_cuts(
    job: &Job,
    grid: &Grid,
    acting: &Acting,
    look: &mut dyn FnMut(&Stage, usize),
    monitor: &dyn Monitor,
) -> Result<(Stage, Vec<PassOutcome>), Failure> {
    let base = Regime::of(&job.cut);
    let mut stock = stock_radii_mm(job, grid);
    if job.passes.is_empty() {
        // The stock of a single cut is known: depth and speed follow it.
        let radii = Radii { target: target_radii_mm(job, grid, None), stock, planned: None };
        let last = Stage::of(job, grid, acting, base, Step::default(), radii, monitor)?;
        return Ok((last, Vec::new()));
    }
    let mut planned = planned_stock_radii_mm(job, grid, &stock);
    let mut outcomes: Vec<PassOutcome> = Vec::new();
    let mut last: Option<Stage> = None;
    for (k, pass) in job.passes.iter().enumerate() {
        let share = |k: usize| k as f64 / job.passes.len() as f64;
        monitor.progress(share(k), Message::new("stage_pass").with("pass", k + 1).with("of", job.passes.len()));
        let regime = base.of_pass(pass);
        let step = match &last {
            None => Step::first(pass.diameter_mm),
            Some(before) => before.step.next(job, &before.regime, pass.diameter_mm),
        };
        // Where the blank is thinner than the pass there is nothing to be cut.
        let target: Vec<f64> =
            target_radii_mm(job, grid, step.pass_mm).iter().zip(&planned).map(|(t, p)| t.min(*p)).collect();
        let radii = Radii { target: target.clone(), stock, planned: Some(planned) };
        let mut stage = Stage::of(job, grid, acting, regime, step, radii, monitor)?;
        let (produced, commands) = stage.outcome(pass.compensated, monitor)?;
        outcomes.push(pass_outcome(&stage, pass.compensated, &produced, &commands, outcomes.last()));
        if k + 1 < job.passes.len() {
            look(&stage, k + 1);
        }
        stock = produced;
        planned = target;
        last = Some(stage);
    }
    match last {
        Some(last) => Ok((last, outcomes)),
        None => Err(Failure::Internal("no pass was computed".to_owned())),
    }
}

/// Refuses a cut whose numbers overflow.
pub(super) fn in_reach(stage: &Stage) -> Result<(), Failure> {
    if stage.cut.is_in_reach() {
        return Ok(());
    }
    Err(Failure::OutOfModel(Finding::new("numbers_out_of_reach", "")))
}

fn pass_outcome(
    stage: &Stage,
    compensated: bool,
    produced: &[f64],
    commands: &[Option<f64>],
    before: Option<&PassOutcome>,
) -> PassOutcome {
    let error: Vec<f64> =
        produced.iter().zip(&stage.radii.target).map(|(r, target)| 2.0 * (r - target) * UM_PER_MM).collect();
    let copying: Vec<Option<f64>> = commands
        .iter()
        .enumerate()
        .map(|(i, command)| {
            let depth = stage.radii.stock[i] - produced[i];
            let at = |command| copying_factor(command, stage.line.opening_at(i, depth));
            command.filter(|_| depth > 0.0).map(at)
        })
        .collect();
    let copied_so_far = copying
        .iter()
        .enumerate()
        .map(|(i, eps)| match before {
            None => *eps,
            // Where a pass cuts nothing it leaves all.
            Some(before) => Some(eps.unwrap_or(1.0) * before.copied_so_far[i].unwrap_or(1.0)),
        })
        .collect();
    let high = error.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    let low = error.iter().copied().fold(f64::INFINITY, f64::min);
    PassOutcome {
        diameter_mm: stage.step.pass_mm.unwrap_or(0.0),
        compensated,
        produced_diameter_mm: produced.iter().map(|r| 2.0 * r).collect(),
        diameter_error_um: error,
        commanded_diameter_mm: commands.iter().map(|c| c.map(|r| 2.0 * r)).collect(),
        copying_factor: copying,
        form_error_um: high - low,
        copied_so_far,
    }
}
