//! The answer: numbers, pictures, and what is said of it.

pub(super) mod advice;
mod clamping;
pub(super) mod conformance;
mod growth;
pub(super) mod lobes;
mod measured;
pub(super) mod output;
pub(super) mod picture;
mod proposals;
mod rigid;
mod speeds;

use std::f64::consts::{PI, TAU};

use crate::calculator::{Failure, Message, Monitor};
use crate::fixture_stability::power_kw;

use super::job::{Asked, Case, Fit, Held, Job, RubbingSource};
use super::model::{
    self, Cut, Law, MOST_OSCILLATIONS, Milling, Orders, Rotation, Scan, Search, Structure, Wall, Zeroth, scan,
    slow_limit, statics, unstable, zeroth,
};
use growth::{Growth, multiplier};
use output::{
    ClampingStatus, CrossingMethod, DepthLine, ForceOfSide, MillingClamping, MillingCost, MillingEngagement,
    MillingForces, MillingMotion, MillingState, MillingVerdict, ModeShare, OtherAssumptions, Outcome, UnstableInterval,
    WallSide, WallSurface, YieldingSide,
};

const UM_PER_MM: f64 = 1e3;
const N_MM_PER_N_M: f64 = 1e3;
const MM3_PER_CM3: f64 = 1e3;
/// Depths are looked at up to so many times the least limit of the zeroth order, and so many times the working depth.
const ZEROTH_TIMES: f64 = 6.0;
const WORKING_TIMES: f64 = 1.5;
/// Where there is neither.
const SOME_DEPTH_MM: f64 = 10.0;
/// The deepest that is looked at.
const DEEPEST_MM: f64 = 1000.0;
/// Short of the height at which two teeth meet.
const SHORT_OF_MEETING: f64 = 0.99;
/// Heights at which the error of a wall is told.
const HEIGHTS: u32 = 20;
/// Motion beyond this share of the radius ends the model.
pub(super) const MODEL_ENDS: f64 = 0.2;

/// What is computed for one job.
pub(super) struct Study<'a> {
    pub job: &'a Job,
    pub case: Case,
    /// Sides that were measured.
    pub fits: Vec<Fit>,
    pub orders: Orders,
    pub zeroth: Option<Zeroth>,
    /// Hundreds of oscillations from tooth to tooth: closed forms in place of multipliers.
    pub is_slow: bool,
    pub examined_mm: f64,
    /// Mean torque of 1 mm of depth.
    torque_at_1_mm_n_m: f64,
    /// How the workpiece is held, where that is asked for.
    pub held: Option<Held>,
    pub monitor: &'a dyn Monitor,
}

/// Numbers beside the answer that sentences need.
#[derive(Debug, Default)]
pub(super) struct Aside {
    /// Swing of a motion that is beyond the model, mm.
    pub beyond_mm: Option<f64>,
    /// Frequency at which a slow cut begins to chatter, where it does up to what was examined.
    pub slow_hz: Option<f64>,
    /// No periodic motion was found.
    pub no_motion: bool,
    /// Swing of the forced motion of a cutter with run-out whose chips are taken undisturbed, mm.
    pub beside_run_out_mm: Option<f64>,
    /// Along or about which axis nothing holds the workpiece against the cut.
    pub free: Option<&'static str>,
}

impl<'a> Study<'a> {
    /// Of a job whose measured sides have become modes, and what was measured.
    pub(super) fn new(job: &'a Job, case: Case, fits: Vec<Fit>, monitor: &'a dyn Monitor) -> Result<Self, Failure> {
        let zeroth = if case.structure.modes.is_empty() { None } else { zeroth(&case.milling, &case.structure) };
        let examined_mm = examined_mm(job, &case, zeroth);
        let torque_at_1_mm_n_m = statics(&case.milling, 1.0, monitor)?.torque_mean_n_mm / N_MM_PER_N_M;
        let clamping = job.clamping.as_ref().filter(|_| job.asks(Asked::Clamping));
        let held = clamping.and_then(|clamping| clamping.held(job.cut.feed_direction_deg)?.ok());
        let is_slow = case.cut().is_slow();
        Ok(Self {
            job,
            case,
            fits,
            orders: Orders::default(),
            zeroth,
            is_slow,
            examined_mm,
            torque_at_1_mm_n_m,
            held,
            monitor,
        })
    }

    pub(super) fn cut(&self) -> Cut<'_> {
        self.case.cut()
    }

    /// The same cut with another cutter or structure.
    pub(super) fn of<'b>(&self, milling: &'b Milling, structure: &'b Structure) -> Cut<'b> {
        Cut { milling, structure, rotation: self.case.rotation, depth_mm: self.case.depth_mm }
    }

    /// Depth at which a cut first becomes unstable.
    pub(super) fn first_limit_mm(&self, cut: &Cut<'_>) -> Result<Option<f64>, Failure> {
        if cut.is_slow() || (self.is_slow && cut.is_as_slow()) {
            return Ok(self.slow_limit(cut)?.map(|limit| limit.depth_mm));
        }
        Ok(scan_of(self, cut, true)?.first_mm())
    }

    /// That of a slow cut, with its frequency.
    pub(super) fn slow_limit(&self, cut: &Cut<'_>) -> Result<Option<Zeroth>, Failure> {
        slow_limit(cut, self.examined_mm, self.monitor)
    }

    /// The exponent by which 1 over the modulus of a period becomes that of a tooth.
    pub(super) fn teeth_per_period(&self, rotation: &Rotation) -> f64 {
        let turned = rotation.rotation_rad(rotation.period_s(self.case.milling.period_rad()));
        turned / TAU * self.case.milling.teeth.len() as f64
    }

    /// Depths at which power and torque of the spindle give out at a speed, mm.
    pub(super) fn drive_depths_mm(&self, spindle_rpm: f64) -> [Option<f64>; 2] {
        let Some(spindle) = &self.job.spindle else { return [None; 2] };
        let available = spindle.drive().available(spindle_rpm);
        let torque_at_1_mm = self.torque_at_1_mm_n_m;
        let power_at_1_mm = power_kw(torque_at_1_mm, spindle_rpm) / spindle.efficiency;
        let exponent = 1.0 / (1.0 - self.case.milling.depth_exponent);
        let depth = |limit: Option<f64>, at_1_mm: f64| {
            limit.filter(|_| at_1_mm > 0.0).map(|limit| (limit / at_1_mm).powf(exponent))
        };
        [depth(available.power_kw, power_at_1_mm), depth(available.torque_n_m, torque_at_1_mm)]
    }
}

/// How deep is looked: as the job says, or by the zeroth order, and never where two teeth have met.
fn examined_mm(job: &Job, case: &Case, zeroth: Option<Zeroth>) -> f64 {
    let usual = || {
        let by_limit = zeroth.map_or(SOME_DEPTH_MM, |zeroth| ZEROTH_TIMES * zeroth.depth_mm);
        by_limit.max(WORKING_TIMES * case.depth_mm).min(DEEPEST_MM)
    };
    let asked = job.limits.depth_max_mm.unwrap_or_else(usual);
    asked.min(SHORT_OF_MEETING * Case::teeth_meet_mm(&case.milling))
}

pub(super) fn outcome(study: &Study<'_>, estimate_ms: f64) -> Result<(Outcome, Aside), Failure> {
    let (job, case, monitor) = (study.job, &study.case, study.monitor);
    let mut aside = Aside::default();
    monitor.progress(0.02, Message::new("stage_multiplier"));
    let force = forces_of(study, &case.milling, case.depth_mm)?;
    let about_asked = job.asks(Asked::Verdict) || job.asks(Asked::Motion);
    let about = if about_asked { study.orders.about(&study.cut(), monitor)? } else { None };
    let multiplier = if job.asks(Asked::Verdict) { multiplier(study, about.as_ref())? } else { None };
    monitor.progress(0.1, Message::new("stage_intervals"));
    let intervals_asked = job.asks(Asked::Intervals);
    let seen = if intervals_asked && !study.is_slow { Some(scan_of(study, &study.cut(), false)?) } else { None };
    let limit_asked = study.is_slow && (intervals_asked || job.asks(Asked::Verdict));
    let slow = if limit_asked { study.slow_limit(&study.cut())? } else { None };
    aside.slow_hz = slow.map(|limit| limit.frequency_hz);
    let limited_by = if intervals_asked { rigid::limits(study)? } else { None };
    let other_assumptions = if intervals_asked { other_assumptions(study)? } else { OtherAssumptions::default() };
    monitor.progress(0.4, Message::new("stage_motion"));
    let motion = if job.asks(Asked::Motion) { motion(study, about.as_ref(), &mut aside)? } else { None };
    if case.milling.has_run_out() && job.asks_stability() && !study.is_slow && about.is_none() {
        aside.beside_run_out_mm = swing_mm(study)?;
    }
    monitor.progress(0.45, Message::new("stage_clamping"));
    let clamping = study.held.as_ref().map(|held| clamping::clamping(study, held)).transpose()?;
    let clamping = clamping.map(|(clamping, free)| {
        aside.free = free;
        clamping
    });
    let rows = if job.asks(Asked::Lobes) || job.asks(Asked::Speeds) { lobes::rows(study)? } else { Vec::new() };
    let lobes = if job.asks(Asked::Lobes) { Some(lobes::lobes(study, &rows)?) } else { None };
    let first_limit_mm = seen.as_ref().and_then(Scan::first_mm).or(slow.map(|limit| limit.depth_mm));
    let by_receptance = if intervals_asked { measured::limit(study, first_limit_mm)? } else { None };
    let growth = match &multiplier {
        Some((found, _)) => Growth::of(found, study.is_slow),
        None if first_limit_mm.is_some_and(|limit| case.depth_mm >= limit) => Growth::Grows,
        None => Growth::DiesOut,
    };
    let verdict = job.asks(Asked::Verdict).then(|| MillingVerdict {
        state: state(study, growth, &force, motion.as_ref(), clamping.as_ref()),
        depth_margin: first_limit_mm.filter(|_| case.depth_mm > 0.0).map(|limit| limit / case.depth_mm),
        drive_margin: drive_margin(&force),
    });
    let energy = multiplier.as_ref().and_then(|(_, energy)| energy.clone());
    let mut outcome = Outcome {
        verdict,
        engagement: engagement(study),
        force,
        multiplier: multiplier.map(|(found, _)| found),
        modes: modes(case, energy.as_deref()),
        first_limit_mm,
        unstable_intervals: match slow.filter(|_| intervals_asked) {
            Some(limit) => vec![UnstableInterval::of_slow(limit.depth_mm)],
            None => seen.as_ref().map(intervals).unwrap_or_default(),
        },
        examined_to_mm: study.examined_mm,
        islands_checked_to_mm: seen.as_ref().map(|_| study.examined_mm),
        depth_line: seen.as_ref().map(|seen| depth_line(study, seen)),
        limited_by,
        measured: measured::sides(study),
        limit_by_receptance_mm: by_receptance.and_then(|of| of.0),
        receptance_limit: by_receptance.map(|of| of.1),
        other_assumptions,
        zeroth_order_min_mm: study.zeroth.map(|zeroth| zeroth.depth_mm),
        zeroth_order_frequency_hz: study.zeroth.map(|zeroth| zeroth.frequency_hz),
        motion,
        clamping,
        lobes,
        speeds: Vec::new(),
        speed_curve: None,
        proposals: Vec::new(),
        conformance: None,
        cost: MillingCost { oscillations_per_period: case.oscillations(), estimate_ms },
    };
    if job.asks(Asked::Speeds) {
        let (mut best, curve) = speeds::speeds(study, &rows, &outcome)?;
        best.extend(speeds::of_other_widths(study, &outcome)?);
        (outcome.speeds, outcome.speed_curve) = (speeds::ranked(best), Some(curve));
    }
    if job.asks(Asked::Proposals) {
        let hz = outcome.multiplier.as_ref().and_then(|multiplier| multiplier.chatter_frequency_hz);
        outcome.proposals = proposals::proposals(study, hz.or(outcome.zeroth_order_frequency_hz))?;
    }
    if job.asks(Asked::Certainty) {
        monitor.progress(0.9, Message::new("stage_certainty"));
        outcome.conformance = conformance::conformance(study)?;
    }
    Ok((outcome, aside))
}

/// Crossings of a cut over the depth.
fn scan_of(study: &Study<'_>, cut: &Cut<'_>, only_first: bool) -> Result<Scan, Failure> {
    let search = Search { depth_max_mm: study.examined_mm, steps: study.job.limits.depths, only_first, on_map: false };
    scan(&study.orders, cut, &search, study.monitor)
}

/// Whether the floor of the chip plays a part: a power of the chip in an arc that reaches no chip.
fn floor_acts(milling: &Milling) -> bool {
    milling.law.bends() && (milling.entry_rad < 1e-9 || milling.exit_rad > PI - 1e-9)
}

fn other_assumptions(study: &Study<'_>) -> Result<OtherAssumptions, Failure> {
    let milling = &study.case.milling;
    let limit = |milling: &Milling| -> Result<Option<f64>, Failure> {
        study.first_limit_mm(&study.of(milling, &study.case.structure))
    };
    let mut found = OtherAssumptions::default();
    if floor_acts(milling)
        && let Law::Power { floor_mm, .. } = milling.law
        && floor_mm > 0.0
    {
        let with_floor = |times: f64| {
            let mut other = milling.clone();
            if let Law::Power { floor_mm, .. } = &mut other.law {
                *floor_mm *= times;
            }
            other
        };
        found.floor_halved_limit_mm = limit(&with_floor(0.5))?;
        found.floor_doubled_limit_mm = limit(&with_floor(2.0))?;
    }
    if study.job.process_damping.as_ref().is_some_and(|of| of.source != RubbingSource::Measured) {
        found.without_process_damping_limit_mm = limit(&Milling { rubbing: None, ..milling.clone() })?;
    }
    Ok(found)
}

fn state(
    study: &Study<'_>,
    growth: Growth,
    force: &MillingForces,
    motion: Option<&MillingMotion>,
    clamping: Option<&MillingClamping>,
) -> MillingState {
    match growth {
        Growth::Unknown => return MillingState::Undecided,
        Growth::Grows => return MillingState::Chatter,
        Growth::GrowsWithin => return MillingState::GrowsWithin,
        Growth::DiesOut => {}
    }
    if let Some(state) = clamping.and_then(loose) {
        return state;
    }
    if drive_margin(force).is_some_and(|margin| margin < 1.0) {
        return MillingState::Overloaded;
    }
    let limits = &study.job.limits;
    let passes = |value: f64, limit: Option<f64>| limit.is_some_and(|limit| value > limit);
    let is_out = motion.is_some_and(|motion| {
        passes(motion.peak_to_peak_um, limits.amplitude_max_um)
            || motion.walls.iter().any(|wall| {
                passes(wall.largest_um(), limits.surface_error_max_um)
                    || passes(wall.roughness_rz_um, limits.roughness_max_um)
            })
    });
    if is_out { MillingState::SurfaceOut } else { MillingState::Stable }
}

/// How a clamping fails, the worst first.
fn loose(clamping: &MillingClamping) -> Option<MillingState> {
    match clamping.status {
        ClampingStatus::Slips | ClampingStatus::Creeps | ClampingStatus::CannotHold => Some(MillingState::Slips),
        ClampingStatus::Opens => Some(MillingState::Opens),
        ClampingStatus::Holds | ClampingStatus::NoForceGiven => clamping.comes_off_n.map(|_| MillingState::Lifts),
    }
}

fn drive_margin(force: &MillingForces) -> Option<f64> {
    let of = |limit: Option<f64>, asked: f64| limit.filter(|_| asked > 0.0).map(|limit| limit / asked);
    let both = [of(force.power_limit_kw, force.motor_power_kw), of(force.torque_limit_n_m, force.torque_mean_n_m)];
    both.into_iter().flatten().reduce(f64::min)
}

fn engagement(study: &Study<'_>) -> MillingEngagement {
    let case = &study.case;
    let (milling, rotation) = (&case.milling, &case.rotation);
    let teeth = milling.teeth.len() as f64;
    let per_min = milling.feed_mm * teeth * rotation.spindle_rpm;
    let lag = milling.teeth[0].lag_rad_per_mm.abs();
    MillingEngagement {
        entry_angle_deg: milling.entry_rad.to_degrees(),
        exit_angle_deg: milling.exit_rad.to_degrees(),
        width_mm: case.width_mm,
        teeth_in_cut_mean: teeth * (milling.exit_rad - milling.entry_rad) / TAU,
        helix_pitch_mm: (lag > 0.0 && milling.has_one_helix()).then(|| TAU / (teeth * lag)),
        spindle_speed_rpm: rotation.spindle_rpm,
        speed_m_per_min: TAU * milling.radius_mm * rotation.spindle_rpm / 1e3,
        feed_mm_per_tooth: milling.feed_mm,
        feed_mm_per_min: per_min,
        tooth_frequency_hz: 1.0 / case.tooth_period_s(),
        removal_rate_cm3_per_min: case.width_mm * case.depth_mm * per_min / MM3_PER_CM3,
    }
}

fn forces_of(study: &Study<'_>, milling: &Milling, depth_mm: f64) -> Result<MillingForces, Failure> {
    let case = &study.case;
    let found = statics(milling, depth_mm, study.monitor)?;
    let torque = found.torque_mean_n_mm / N_MM_PER_N_M;
    let power = power_kw(torque, case.rotation.spindle_rpm);
    let available = study.job.spindle.as_ref().map(|spindle| spindle.drive().available(case.rotation.spindle_rpm));
    let [power_depth_mm, torque_depth_mm] = study.drive_depths_mm(case.rotation.spindle_rpm);
    let turned = |of: model::Vector| of.map(|force| -force);
    Ok(MillingForces {
        tool: ForceOfSide::of(found.mean_n, found.min_n, found.max_n),
        work: ForceOfSide::of(turned(found.mean_n), turned(found.max_n), turned(found.min_n)),
        torque_mean_n_m: torque,
        torque_max_n_m: found.torque_max_n_mm / N_MM_PER_N_M,
        power_kw: power,
        motor_power_kw: power / study.job.spindle.as_ref().map_or(1.0, |spindle| spindle.efficiency),
        power_limit_kw: available.and_then(|of| of.power_kw),
        torque_limit_n_m: available.and_then(|of| of.torque_n_m),
        power_depth_mm,
        torque_depth_mm,
    })
}

fn modes(case: &Case, energy: Option<&[f64]>) -> Vec<ModeShare> {
    let of = |(index, mode): (usize, &model::Mode)| ModeShare {
        side: if mode.side == model::Side::Tool { YieldingSide::Tool } else { YieldingSide::Work },
        x: mode.direction[0],
        y: mode.direction[1],
        z: mode.direction[2],
        frequency_hz: mode.frequency_hz,
        mass_kg: mode.mass_kg,
        stiffness_n_per_mm: mode.stiffness_n_per_mm(),
        damping_ratio: mode.damping_ratio,
        energy_share: energy.and_then(|energy| energy.get(index).copied()),
    };
    case.structure.modes.iter().enumerate().map(of).collect()
}

fn intervals(seen: &Scan) -> Vec<UnstableInterval> {
    let mut stretches = unstable(&seen.crossings);
    // Unstable at the least depth and ever on.
    if stretches.is_empty() && seen.first_mm().is_some() {
        stretches.push(model::Unstable { from: None, to: None });
    }
    let of = |stretch: &model::Unstable| {
        let known = stretch.from.or(stretch.to);
        UnstableInterval {
            from_mm: stretch.from.map(|at| at.depth_mm),
            to_mm: stretch.to.map(|at| at.depth_mm),
            kind: known.map_or(model::Kind::Hopf, |at| at.kind).into(),
            from_low_mm: stretch.from.map(|at| at.bracket_mm[0]),
            from_high_mm: stretch.from.map(|at| at.bracket_mm[1]),
            to_low_mm: stretch.to.map(|at| at.bracket_mm[0]),
            to_high_mm: stretch.to.map(|at| at.bracket_mm[1]),
            found_by: CrossingMethod::Multiplier,
            certified: [stretch.from, stretch.to].into_iter().flatten().all(|at| at.certified),
        }
    };
    stretches.iter().map(of).collect()
}

impl UnstableInterval {
    /// Of a slow cut: from its limit on. A closed form has no bracket.
    fn of_slow(limit_mm: f64) -> Self {
        Self {
            from_mm: Some(limit_mm),
            to_mm: None,
            kind: model::Kind::Hopf.into(),
            from_low_mm: None,
            from_high_mm: None,
            to_low_mm: None,
            to_high_mm: None,
            found_by: CrossingMethod::ClosedForm,
            certified: false,
        }
    }
}

fn depth_line(study: &Study<'_>, seen: &Scan) -> DepthLine {
    let teeth = study.teeth_per_period(&study.case.rotation);
    let (depth_mm, per_tooth) = seen.curve.iter().map(|(depth, growth)| (*depth, (growth / teeth).exp())).unzip();
    DepthLine { depth_mm, per_tooth }
}

/// Why there is no motion to tell of.
enum NoMotion {
    /// None repeats itself.
    None,
    /// It swings by so much, which is beyond the model, mm.
    Beyond(f64),
}

/// The forced motion; none where there is no periodic one, or it goes beyond the model.
fn motion(study: &Study<'_>, about: Option<&Milling>, aside: &mut Aside) -> Result<Option<MillingMotion>, Failure> {
    let cut = about.map_or(study.cut(), |milling| Cut { milling, ..study.cut() });
    Ok(match motion_of(study, &cut)? {
        Ok(motion) => Some(motion),
        Err(NoMotion::None) => {
            aside.no_motion = true;
            None
        }
        Err(NoMotion::Beyond(swing)) => {
            aside.beyond_mm = Some(swing);
            None
        }
    })
}

fn motion_of(study: &Study<'_>, cut: &Cut<'_>) -> Result<Result<MillingMotion, NoMotion>, Failure> {
    let Some(forced) = study.orders.forced(cut, study.monitor)? else { return Ok(Err(NoMotion::None)) };
    let (low, high) = forced.extremes();
    let swing = forced.swing_mm();
    if swing > MODEL_ENDS * cut.milling.radius_mm || !swing.is_finite() {
        return Ok(Err(NoMotion::Beyond(swing)));
    }
    let walls = forced.walls().into_iter().map(|wall| surface(&forced, wall, cut.depth_mm)).collect();
    let um = |mm: f64| mm * UM_PER_MM;
    Ok(Ok(MillingMotion {
        x_min_um: um(low[0]),
        x_max_um: um(high[0]),
        y_min_um: um(low[1]),
        y_max_um: um(high[1]),
        z_min_um: um(low[2]),
        z_max_um: um(high[2]),
        peak_to_peak_um: um(swing),
        walls,
    }))
}

/// The largest peak-to-peak motion of a direction; `None` where there is no periodic one.
fn swing_mm(study: &Study<'_>) -> Result<Option<f64>, Failure> {
    let cut = study.cut();
    if cut.oscillations() > MOST_OSCILLATIONS {
        return Ok(None);
    }
    let forced = study.orders.forced(&cut, study.monitor)?;
    Ok(forced.map(|forced| forced.swing_mm()).filter(|swing| swing.is_finite()))
}

fn surface(forced: &model::Forced<'_>, wall: Wall, depth_mm: f64) -> WallSurface {
    let height_mm: Vec<f64> = (0..=HEIGHTS).map(|k| depth_mm * f64::from(k) / f64::from(HEIGHTS)).collect();
    let surface_error_um: Vec<f64> =
        height_mm.iter().map(|height| UM_PER_MM * forced.surface_error_mm(wall, *height)).collect();
    let roughness = forced.roughness(wall, 0.5 * depth_mm);
    WallSurface {
        wall: if wall == Wall::Up { WallSide::Up } else { WallSide::Down },
        error_min_um: surface_error_um.iter().copied().fold(f64::INFINITY, f64::min),
        error_max_um: surface_error_um.iter().copied().fold(f64::NEG_INFINITY, f64::max),
        height_mm,
        surface_error_um,
        roughness_rz_um: UM_PER_MM * roughness.rz_mm,
        roughness_ra_um: UM_PER_MM * roughness.ra_mm,
    }
}

impl WallSurface {
    /// The larger of both errors, without its sign.
    pub(super) fn largest_um(&self) -> f64 {
        self.error_max_um.abs().max(self.error_min_um.abs())
    }
}
