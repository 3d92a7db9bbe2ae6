//! One cut with everything that belongs to it, and the passes that lead to the last one.

use crate::calculator::{Failure, Finding, Message, Monitor};
use crate::force::{Reached, ReachedCut};

use crate::deflection_compensation::answer::output::{PassOutcome, Path};
use crate::deflection_compensation::job::acting::Acting;
use crate::deflection_compensation::job::grid::{Grid, interpolate};
use crate::deflection_compensation::job::input::Job;
use crate::deflection_compensation::job::structure::{Structure, Variant, pass_diameter_mm};
use crate::deflection_compensation::model::chords::{Programmed, programmed};
use crate::deflection_compensation::model::cut::CutLine;
use crate::deflection_compensation::model::equilibrium::copying_factor;
use crate::deflection_compensation::model::regime::{Regime, Speed, Step, passages, section_of_pass};
use crate::deflection_compensation::model::yielding::{Ingredients, Line, Radii, wanted};

const UM_PER_MM: f64 = 1e3;

/// One cut: structure, forces, radii, and what they give.
pub(in crate::deflection_compensation) struct Stage {
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
    pub(in crate::deflection_compensation) fn of(
        job: &Job,
        grid: &Grid,
        acting: &Acting,
        regime: Regime,
        step: Step,
        radii: Radii,
        monitor: &dyn Monitor,
    ) -> Result<Self, Failure> {
        let (structure, line) = line_of(job, grid, acting, &regime, &step, &radii)?;
        let cut = CutLine::of(&line, &radii, monitor)?;
        let stage = Self { regime, structure, radii, line, cut, step };
        within_reach_of_law(job, &stage)?;
        Ok(stage)
    }

    /// How the structure of this cut differs from the job as it stands.
    pub(in crate::deflection_compensation) fn variant<'a>(&self, job: &Job, acting: &'a Acting) -> Variant<'a> {
        variant(job, acting, &self.regime, self.step.pass_mm)
    }

    /// Radius that the cut leaves along commands.
    fn left_by(&mut self, commands: &[Option<f64>], monitor: &dyn Monitor) -> Result<Vec<Option<f64>>, Failure> {
        self.cut.produced_mm(&self.line, &self.radii, commands, monitor)
    }

    /// Exact commands: compensated, or the nominal line.
    fn commands(&self, compensated: bool) -> Vec<Option<f64>> {
        if compensated { self.cut.command_mm.clone() } else { self.radii.target.iter().copied().map(Some).collect() }
    }
}

/// The held shaft of a cut and everything along it that no depth changes.
pub(in crate::deflection_compensation) fn line_of(
    job: &Job,
    grid: &Grid,
    acting: &Acting,
    regime: &Regime,
    step: &Step,
    radii: &Radii,
) -> Result<(Structure, Line), Failure> {
    let structure = Structure::of(job, &variant(job, acting, regime, step.pass_mm))?;
    let passages = if acting.has_errors() { passages(job, grid, regime, step, radii) } else { Vec::new() };
    let displaced = structure.displaced(job, &acting.set_off, &grid.z_mm)?;
    let ingredients = Ingredients {
        job,
        grid,
        acting,
        structure: &structure,
        regime,
        radii,
        passages: &passages,
        displaced: displaced.as_ref(),
    };
    let line = Line::of(&ingredients, structure.beam.profile(&grid.z_mm, wanted(job)));
    acting.values(&line, &passages)?;
    Ok((structure, line))
}

fn variant<'a>(job: &Job, acting: &'a Acting, regime: &Regime, pass_mm: Option<f64>) -> Variant<'a> {
    let mut variant = Variant::of(job, &acting.structure);
    variant.direction = regime.direction;
    variant.section = section_of_pass(job, acting.structure.uncut_side);
    variant.pass_diameter_mm = pass_mm;
    variant
}

/// The stock of the first cut: the profile where one is given, else the segments'.
pub(in crate::deflection_compensation) fn stock_radii_mm(job: &Job, grid: &Grid) -> Vec<f64> {
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

/// All cuts of a job along their exact commands: the last cut as a stage, and all passes as outcomes, none where there is one
/// cut only. `look` is shown every pass before the last, with its number.
pub(in crate::deflection_compensation) fn all_cuts(
    job: &Job,
    grid: &Grid,
    acting: &Acting,
    look: &mut dyn FnMut(&Grid, &Stage, usize),
    monitor: &dyn Monitor,
) -> Result<(Stage, Vec<PassOutcome>), Failure> {
    let mut cuts = Cuts::of(job, grid, acting, Along::Exact, look, monitor)?;
    match cuts.stages.pop() {
        Some(last) => Ok((last, cuts.passes)),
        None => Err(Failure::Internal("no cut was computed".to_owned())),
    }
}

/// What the tool follows.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::deflection_compensation) enum Along {
    /// The exact command of every station.
    Exact,
    /// The moves of the program, in the last cut with a commanded radius that is larger by so much, mm.
    Moves { aim_mm: f64 },
}

/// The cuts of a job, each on what the one before it has left.
pub(in crate::deflection_compensation) struct Cuts {
    pub stages: Vec<Stage>,
    /// One for every pass of several.
    pub passes: Vec<PassOutcome>,
    /// One for every cut along moves.
    pub paths: Vec<Path>,
    /// Commanded radius at every station, mm; likewise.
    pub commands: Vec<Vec<Option<f64>>>,
    /// Radius that the last cut leaves, mm.
    pub produced_mm: Vec<Option<f64>>,
}

impl Cuts {
    pub(in crate::deflection_compensation) fn of(
        job: &Job,
        grid: &Grid,
        acting: &Acting,
        along: Along,
        look: &mut dyn FnMut(&Grid, &Stage, usize),
        monitor: &dyn Monitor,
    ) -> Result<Self, Failure> {
        let base = Regime::of(&job.cut);
        let mut stock = stock_radii_mm(job, grid);
        let mut cuts = Self {
            stages: Vec::new(),
            passes: Vec::new(),
            paths: Vec::new(),
            commands: Vec::new(),
            produced_mm: Vec::new(),
        };
        if job.passes.is_empty() {
            // The stock of a single cut is known: depth and speed follow it.
            let target = target_radii_mm(job, grid, None);
            let idle = idle(job, grid, &stock, &target);
            let radii = Radii { target, stock, planned: None, idle };
            let mut stage = Stage::of(job, grid, acting, base, Step::default(), radii, monitor)?;
            if along != Along::Exact {
                let commands = cuts.commands(job, grid, &stage, true, along, monitor)?;
                cuts.produced_mm = stage.left_by(&commands, monitor)?;
            }
            cuts.stages.push(stage);
            return Ok(cuts);
        }
        let mut planned = planned_stock_radii_mm(job, grid, &stock);
        for (k, pass) in job.passes.iter().enumerate() {
            let share = |k: usize| k as f64 / job.passes.len() as f64;
            monitor.progress(share(k), Message::new("stage_pass").with("pass", k + 1).with("of", job.passes.len()));
            let regime = base.of_pass(pass);
            let step = match cuts.stages.last() {
                None => Step::first(pass.diameter_mm),
                Some(before) => before.step.next(job, &before.regime, pass.diameter_mm),
            };
            // Where the blank is thinner than the pass there is nothing to be cut.
            let target: Vec<f64> =
                target_radii_mm(job, grid, step.pass_mm).iter().zip(&planned).map(|(t, p)| t.min(*p)).collect();
            let idle = idle(job, grid, &planned, &target);
            let radii = Radii { target: target.clone(), stock, planned: Some(planned), idle };
            let mut stage = Stage::of(job, grid, acting, regime, step, radii, monitor)?;
            let is_last = k + 1 == job.passes.len();
            let along = match along {
                Along::Moves { .. } if !is_last => Along::Moves { aim_mm: 0.0 },
                _ => along,
            };
            let commands = cuts.commands(job, grid, &stage, pass.compensated, along, monitor)?;
            cuts.produced_mm = stage.left_by(&commands, monitor)?;
            let produced = known(&cuts.produced_mm, &stage)?;
            let mut outcome = pass_outcome(&stage, pass.compensated, &produced, &commands, cuts.passes.last());
            outcome.path = cuts.paths.last().cloned();
            cuts.passes.push(outcome);
            if !is_last {
                look(grid, &stage, k + 1);
            }
            stock = produced;
            planned = target;
            if along == Along::Exact {
                cuts.stages.clear();
            }
            cuts.stages.push(stage);
        }
        Ok(cuts)
    }

    /// What the tool is told in a cut: nothing where it does not come.
    fn commands(
        &mut self,
        job: &Job,
        grid: &Grid,
        stage: &Stage,
        compensated: bool,
        along: Along,
        monitor: &dyn Monitor,
    ) -> Result<Vec<Option<f64>>, Failure> {
        let exact = stage.commands(compensated);
        let Along::Moves { aim_mm } = along else { return Ok(exact) };
        let aimed: Vec<_> = exact.iter().map(|command| command.map(|command| command + aim_mm)).collect();
        let Programmed { path, command_mm } = programmed(job, grid, stage, compensated, &aimed, monitor)?;
        self.paths.push(path);
        self.commands.push(command_mm.clone());
        Ok(command_mm)
    }
}

/// Stations to which the tool does not come in a cut: nothing is planned to be cut in all of their piece.
fn idle(job: &Job, grid: &Grid, planned: &[f64], target: &[f64]) -> Vec<bool> {
    let mut idle = vec![false; grid.len()];
    let mut any = false;
    for piece in grid.pieces(&job.shaft.segments) {
        if piece.clone().all(|i| planned[i] <= target[i]) {
            idle[piece].fill(true);
            any = true;
        }
    }
    if any { idle } else { Vec::new() }
}

/// What a pass leaves, where every station has a command.
fn known(produced: &[Option<f64>], stage: &Stage) -> Result<Vec<f64>, Failure> {
    produced.iter().copied().collect::<Option<Vec<f64>>>().ok_or_else(|| {
        Failure::OutOfModel(
            Finding::new("pass_without_command", "/passes").with("diameter_mm", stage.step.pass_mm.unwrap_or(0.0)),
        )
    })
}

/// Refuses a cut whose numbers overflow.
pub(in crate::deflection_compensation) fn in_reach(stage: &Stage) -> Result<(), Failure> {
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
        path: None,
    }
}

/// Depth, feed and speed of a cut; `None` where nothing is cut.
pub(in crate::deflection_compensation) fn reached(
    stage: &Stage,
    least: f64,
    largest: f64,
) -> Option<ReachedCut<'static>> {
    if least > largest || largest <= 0.0 {
        return None;
    }
    let speed_pointer = match stage.regime.speed {
        Speed::Surface(_) => "/cut/speed_m_per_min",
        Speed::Spindle(_) => "/cut/spindle_speed_rpm",
    };
    let (slowest, fastest) = speed_range_m_per_min(stage);
    let feed = stage.regime.feed_mm_per_rev;
    Some(ReachedCut {
        depth_mm: Reached { pointer: "/shaft/segments", least, largest },
        feed_mm_per_rev: Reached { pointer: "/cut/feed_mm_per_rev", least: feed, largest: feed },
        speed_m_per_min: Reached { pointer: speed_pointer, least: slowest, largest: fastest },
    })
}

/// Refuses a cut of which the force law says nothing any more.
fn within_reach_of_law(job: &Job, stage: &Stage) -> Result<(), Failure> {
    let deepest = stage.cut.nominal_depth_mm.iter().copied().fold(0.0, f64::max);
    let far = reached(stage, deepest, deepest).and_then(|cut| job.force.far_beyond(&cut));
    far.map_or(Ok(()), |finding| Err(Failure::OutOfModel(finding)))
}

fn speed_range_m_per_min(stage: &Stage) -> (f64, f64) {
    if let Speed::Surface(speed) = stage.regime.speed {
        return (speed, speed);
    }
    let radii = stage.radii.planned().iter().zip(&stage.radii.target);
    radii
        .map(|(planned, target)| stage.regime.speed_m_per_min(*planned, *target))
        .fold((f64::INFINITY, 0.0), |(least, largest): (f64, f64), speed| (least.min(speed), largest.max(speed)))
}
