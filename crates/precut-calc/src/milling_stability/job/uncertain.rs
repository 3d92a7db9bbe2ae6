//! What is uncertain in a cut: its quantities, and what a draw of them changes (`certainty/1.4`).

use std::borrow::Cow;

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::calculator::{Failure, Violations};
use crate::certainty::{
    Block, Contradiction, Distribution, Level, OpenEffects, Quantity, Source, Uncertain, Uncertainties, WidthUnit,
    check_brought, open, uncertainty_block,
};
use crate::effects::{JointUncertainty, MillingEffect, ParameterMove};
use crate::fixture_stability::usual_scatter::{CUTTING_FORCE, DAMPING, FRICTION, SET_BY_HAND, SET_BY_PRESSURE};

use super::super::model::{Milling, Mode, Side, Structure};
use super::case::Case;
use super::held::PartClamping;
use super::input::{Job, Yielding};
use super::measured::Fit;

/// Standard deviation of what nobody states: of the natural frequency in percent, of other factors that of their logarithm.
const MODE_FREQUENCY_PERCENT: f64 = 2.0;
const MODE_STIFFNESS: f64 = 0.10;
const RUNOUT: f64 = 0.20;

/// A quantity of a cut that is not known exactly; all are factors on what the job states.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum MillingQuantity {
    /// On the natural frequency of each mode, the stiffness as it is; every mode has its own draw.
    ModeFrequency,
    /// On the stiffness of each mode, the natural frequency as it is; every mode has its own draw.
    ModeStiffness,
    /// On the damping of each mode; every mode has its own draw.
    ModeDamping,
    /// The same of the tool alone, in place of `mode_frequency`.
    ToolModeFrequency,
    /// The same of the tool alone, in place of `mode_stiffness`.
    ToolModeStiffness,
    /// The same of the tool alone, in place of `mode_damping`.
    ToolModeDamping,
    /// The same of the workpiece alone, in place of `mode_frequency`.
    WorkModeFrequency,
    /// The same of the workpiece alone, in place of `mode_stiffness`.
    WorkModeStiffness,
    /// The same of the workpiece alone, in place of `mode_damping`.
    WorkModeDamping,
    /// On all forces of the edges.
    CuttingForce,
    /// On how far teeth stand out and down.
    Runout,
    /// On the clamp force at hand.
    ClampForce,
    /// On the likely friction of all contacts.
    Friction,
}

/// A number of a mode.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
enum Part {
    Frequency,
    Stiffness,
    Damping,
}

impl Part {
    const ALL: [Self; 3] = [Self::Frequency, Self::Stiffness, Self::Damping];

    /// The effect that is the same quantity of a mode, as a diagnosis finds it.
    fn effect(self) -> &'static str {
        match self {
            Self::Frequency => "mode_frequency",
            Self::Stiffness => "mode_stiffness",
            Self::Damping => "mode_damping",
        }
    }
}

impl MillingQuantity {
    /// Whether what is not known of the effects of the job tells all of it: of a quantity of modes that of every one. One that is told of
    /// some modes alone acts on the others.
    fn is_brought(self, job: &Job, structure: &Structure) -> bool {
        if let Some((side, part)) = self.of_modes() {
            let is_of = |mode: &&Mode| side.is_none_or(|side| mode.side == side);
            let modes = structure.modes.iter().enumerate().filter(|(_, mode)| is_of(mode));
            let mut told = modes.map(|(mode, _)| is_brought(job, part.effect(), Some(mode))).peekable();
            return told.peek().is_some() && told.all(|told| told);
        }
        match self {
            Self::CuttingForce => is_brought(job, "force_coefficient", None),
            Self::Runout => is_brought(job, "tooth_runout", None),
            _ => false,
        }
    }

    /// Of which side, `None` of both, and what of its modes; `None` of what is not of modes.
    fn of_modes(self) -> Option<(Option<Side>, Part)> {
        Some(match self {
            Self::ModeFrequency => (None, Part::Frequency),
            Self::ModeStiffness => (None, Part::Stiffness),
            Self::ModeDamping => (None, Part::Damping),
            Self::ToolModeFrequency => (Some(Side::Tool), Part::Frequency),
            Self::ToolModeStiffness => (Some(Side::Tool), Part::Stiffness),
            Self::ToolModeDamping => (Some(Side::Tool), Part::Damping),
            Self::WorkModeFrequency => (Some(Side::Work), Part::Frequency),
            Self::WorkModeStiffness => (Some(Side::Work), Part::Stiffness),
            Self::WorkModeDamping => (Some(Side::Work), Part::Damping),
            Self::CuttingForce | Self::Runout | Self::ClampForce | Self::Friction => return None,
        })
    }

    /// What a side's own is called, and what that of both.
    fn of_side(side: Side, part: Part) -> [Self; 2] {
        match (side, part) {
            (Side::Tool, Part::Frequency) => [Self::ToolModeFrequency, Self::ModeFrequency],
            (Side::Tool, Part::Stiffness) => [Self::ToolModeStiffness, Self::ModeStiffness],
            (Side::Tool, Part::Damping) => [Self::ToolModeDamping, Self::ModeDamping],
            (Side::Work, Part::Frequency) => [Self::WorkModeFrequency, Self::ModeFrequency],
            (Side::Work, Part::Stiffness) => [Self::WorkModeStiffness, Self::ModeStiffness],
            (Side::Work, Part::Damping) => [Self::WorkModeDamping, Self::ModeDamping],
        }
    }

    /// The field of the job without which there is nothing of that kind, where it is not there.
    fn missing_in(self, job: &Job) -> Option<&'static str> {
        let is_rigid = |yielding: &Yielding| matches!(yielding, Yielding::Rigid(_));
        if let Some((side, _)) = self.of_modes() {
            return match side {
                Some(Side::Tool) => is_rigid(&job.tool).then_some("/tool"),
                Some(Side::Work) => is_rigid(&job.work).then_some("/work"),
                None => (is_rigid(&job.tool) && is_rigid(&job.work)).then_some("/tool"),
            };
        }
        let cutter = &job.cutter;
        let is_missing = match self {
            Self::Runout => cutter.radial_offset_um.is_empty() && cutter.axial_offset_um.is_empty(),
            Self::ClampForce | Self::Friction => clamped(job).is_none(),
            _ => false,
        };
        let field = if self == Self::Runout { "/cutter/radial_offset_um" } else { "/clamping" };
        is_missing.then_some(field)
    }
}

impl Quantity for MillingQuantity {
    fn name(self) -> &'static str {
        match self {
            Self::ModeFrequency => "mode_frequency",
            Self::ModeStiffness => "mode_stiffness",
            Self::ModeDamping => "mode_damping",
            Self::ToolModeFrequency => "tool_mode_frequency",
            Self::ToolModeStiffness => "tool_mode_stiffness",
            Self::ToolModeDamping => "tool_mode_damping",
            Self::WorkModeFrequency => "work_mode_frequency",
            Self::WorkModeStiffness => "work_mode_stiffness",
            Self::WorkModeDamping => "work_mode_damping",
            Self::CuttingForce => "cutting_force",
            Self::Runout => "runout",
            Self::ClampForce => "clamp_force",
            Self::Friction => "friction",
        }
    }

    fn unit(self) -> WidthUnit {
        WidthUnit::Percent
    }
}

uncertainty_block! {
    /// What is uncertain, and which probability is wanted; acts with the analysis `certainty`.
    MillingUncertainty {
        force_percent: Option<f64>, of CuttingForce;
        quantities: MillingUncertainQuantity of MillingQuantity (max_items = 13), such as "mode_damping";
        correlations: MillingCorrelation (78), such as ["mode_stiffness", "mode_damping"];
        effects: Vec<JointUncertainty>;
        /// Whether what is usual is uncertain, too, where nothing is said of it: frequency, stiffness and damping of all modes,
        /// cutting force, run-out, clamp force, friction.
        defaults;
        /// Probability of a quiet cut that is wanted; below it the answer warns.
        wanted_probability;
    }
}

/// A quantity, of one mode where it is of modes.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(in crate::milling_stability) struct OneQuantity {
    quantity: MillingQuantity,
    mode: Option<usize>,
}

impl OneQuantity {
    /// Whether a name of the contract means it.
    fn is(self, named: MillingQuantity) -> bool {
        match (self.quantity.of_modes(), named.of_modes()) {
            (Some((side, part)), Some((of_side, of_part))) => part == of_part && (of_side.is_none() || of_side == side),
            _ => self.quantity == named,
        }
    }

    /// Whether it goes together with another one of a pair: within a mode, and where one of both is of no mode or of another side.
    fn goes_with(self, other: Self) -> bool {
        let side = |one: Self| one.quantity.of_modes().and_then(|(side, _)| side);
        self.mode.is_none() || other.mode.is_none() || self.mode == other.mode || side(self) != side(other)
    }
}

impl Quantity for OneQuantity {
    fn name(self) -> &'static str {
        self.quantity.name()
    }

    fn unit(self) -> WidthUnit {
        self.quantity.unit()
    }
}

/// A clamping whose force at hand is known.
pub(in crate::milling_stability) fn clamped(job: &Job) -> Option<(&PartClamping, f64)> {
    let clamping = job.clamping.as_ref()?;
    clamping.clamp_force().map(|(force_n, _)| (clamping, force_n)).filter(|(_, force_n)| *force_n > 0.0)
}

/// All quantities of a checked job whose modes are known that are uncertain, and how they go together. What measured functions tell
/// of their modes takes the place of what is usual.
pub(in crate::milling_stability) fn uncertainties(
    job: &Job,
    structure: &Structure,
    fits: &[Fit],
) -> Result<Uncertainties<OneQuantity>, Contradiction> {
    let block = &job.uncertainty;
    let mut all: Vec<Uncertain<OneQuantity>> = Vec::new();
    for (mode, of) in structure.modes.iter().enumerate() {
        let before = structure.modes[..mode].iter().filter(|other| other.side == of.side).count();
        let measured = fits.iter().find(|fit| fit.side == of.side);
        for part in Part::ALL.into_iter().filter(|part| !is_brought(job, part.effect(), Some(mode))) {
            all.extend(of_mode(block, of.side, part, measured.and_then(|fit| scatter(fit, before, part))).map(|one| {
                let quantity = OneQuantity { quantity: one.quantity, mode: Some(mode) };
                Uncertain { quantity, distribution: one.distribution, level: one.level, source: one.source }
            }));
        }
    }
    for quantity in
        [MillingQuantity::CuttingForce, MillingQuantity::Runout, MillingQuantity::ClampForce, MillingQuantity::Friction]
    {
        let is_usual = quantity.missing_in(job).is_none() && !quantity.is_brought(job, structure);
        let usual = is_usual.then(|| usual(quantity, job));
        all.extend(block.uncertain(quantity, Level::Setup, usual).map(|one| Uncertain {
            quantity: OneQuantity { quantity, mode: None },
            distribution: one.distribution,
            level: one.level,
            source: one.source,
        }));
    }
    let pairs = pairs(block, &all);
    let all = Uncertainties::new(all, pairs.iter().map(|(between, coefficient)| (&between[..], *coefficient)))?;
    Ok(all.beside(OpenEffects::of(&job.effects, &block.effects)))
}

/// Whether what is not known of the effects of a job is of this kind, and of this mode where one is meant.
fn is_brought(job: &Job, kind: &str, mode: Option<usize>) -> bool {
    let of = |unsure: &ParameterMove| unsure.place().and_then(|place| job.effects.get(place));
    let is_of_mode = |effect: &MillingEffect| {
        mode.is_none_or(|mode| effect.mode().and_then(|own| usize::try_from(own).ok()) == Some(mode + 1))
    };
    let moves = job.uncertainty.effects.iter().flat_map(|entry| &entry.moves).filter(|unsure| unsure.by.abs() > 0.0);
    moves.filter_map(of).any(|effect| effect.kind() == kind && is_of_mode(effect))
}

/// That of a mode: as stated of its side, as stated of both, as measured, or as is usual.
fn of_mode(
    block: &MillingUncertainty,
    side: Side,
    part: Part,
    measured: Option<Distribution>,
) -> Option<Uncertain<MillingQuantity>> {
    let [own, of_both] = MillingQuantity::of_side(side, part);
    let is_stated = |quantity| block.quantities.iter().any(|one| one.quantity == quantity);
    if is_stated(own) {
        return block.uncertain(own, Level::Setup, None);
    }
    if is_stated(of_both) {
        return block.uncertain(of_both, Level::Setup, None).map(|one| Uncertain { quantity: own, ..one });
    }
    let source = if measured.is_some() { Source::Measured } else { Source::Default };
    let usual = measured.unwrap_or(match part {
        Part::Frequency => Distribution::normal_percent(MODE_FREQUENCY_PERCENT),
        Part::Stiffness => Distribution::Lognormal { log_standard_deviation: MODE_STIFFNESS },
        Part::Damping => Distribution::Lognormal { log_standard_deviation: DAMPING },
    });
    block.uncertain(own, Level::Setup, Some(usual)).map(|one| Uncertain { source, ..one })
}

/// How well a mode of a measured side is known, by its standard errors. That of the mass at a known frequency is that of the stiffness.
fn scatter(fit: &Fit, mode: usize, part: Part) -> Option<Distribution> {
    let (of, known) = (fit.fitted.modes.get(mode)?, fit.fitted.certainty.get(mode)?);
    let share = match part {
        Part::Frequency => known.frequency_error_hz / of.frequency_hz,
        Part::Stiffness => known.mass_error_kg / of.mass_kg,
        Part::Damping => known.damping_ratio_error / of.damping_ratio,
    };
    share.is_finite().then_some(Distribution::Lognormal { log_standard_deviation: share.powi(2).ln_1p().sqrt() })
}

fn usual(quantity: MillingQuantity, job: &Job) -> Distribution {
    let log_standard_deviation = match quantity {
        MillingQuantity::Runout => RUNOUT,
        MillingQuantity::ClampForce => job
            .clamping
            .as_ref()
            .map_or(SET_BY_HAND, |of| if of.is_set_by_pressure() { SET_BY_PRESSURE } else { SET_BY_HAND }),
        MillingQuantity::Friction => {
            let frictions = job.clamping.iter().flat_map(PartClamping::frictions);
            let scatters = frictions.filter_map(|(_, friction)| friction.range().scatter());
            scatters.reduce(f64::max).unwrap_or(FRICTION)
        }
        _ => CUTTING_FORCE,
    };
    Distribution::Lognormal { log_standard_deviation }
}

type Pairs = Vec<([OneQuantity; 2], f64)>;

/// Pairs of the contract as those of single modes.
fn pairs(block: &MillingUncertainty, all: &[Uncertain<OneQuantity>]) -> Pairs {
    let mut found: Pairs = Vec::new();
    for (between, coefficient) in block.pairs() {
        let [one, other] = *between else { continue };
        let of = |named: MillingQuantity| all.iter().map(|of| of.quantity).filter(move |of| of.is(named));
        for (a, b) in of(one).flat_map(|a| of(other).map(move |b| (a, b))) {
            if a != b && a.goes_with(b) {
                found.push(([a, b], coefficient));
            }
        }
    }
    found
}

/// A cut as it may be.
pub(in crate::milling_stability) struct Drawn {
    pub milling: Milling,
    pub structure: Structure,
    /// Factors on force, clamp force and friction; that on the force has acted on `milling`.
    pub force: f64,
    pub clamp: f64,
    pub friction: f64,
    /// Whether loads on a rigid workpiece are those at the stated values times the factor on the force.
    pub has_scaled_loads: bool,
}

/// The cut where the quantities come to this; `case` is that of the job.
pub(in crate::milling_stability) fn drawn(
    job: &Job,
    case: &Case,
    of: &Uncertainties<OneQuantity>,
    factors: &[f64],
) -> Result<Drawn, Failure> {
    let effects = of.effects.effects(&job.effects, of.of_effects(factors))?;
    let has_scaled_loads = effects.is_none();
    let case = match effects {
        Some(effects) => {
            let moved = Case::of(&Job { effects, ..job.clone() });
            Cow::Owned(moved.ok_or_else(|| Failure::Internal("a job that the check refuses".to_owned()))?)
        }
        None => Cow::Borrowed(case),
    };
    let (milling, structure) = (case.milling.clone(), case.structure.clone());
    let mut draw = Drawn { milling, structure, force: 1.0, clamp: 1.0, friction: 1.0, has_scaled_loads };
    for (OneQuantity { quantity, mode }, factor) in of.drawn(factors) {
        if let (Some((_, part)), Some(mode)) = (quantity.of_modes(), mode) {
            put(part, factor, &mut draw.structure.modes[mode]);
            continue;
        }
        match quantity {
            MillingQuantity::Runout => {
                draw.has_scaled_loads = false;
                for tooth in &mut draw.milling.teeth {
                    tooth.radial_mm *= factor;
                    tooth.axial_mm *= factor;
                }
            }
            MillingQuantity::ClampForce => draw.clamp = factor,
            MillingQuantity::Friction => draw.friction = factor,
            _ => {
                draw.force = factor;
                draw.milling.law.scale([factor; 3]);
            }
        }
    }
    Ok(draw)
}

fn put(part: Part, factor: f64, mode: &mut Mode) {
    match part {
        Part::Frequency => mode.tune(factor),
        Part::Stiffness => mode.stiffen(factor),
        Part::Damping => mode.damp(factor),
    }
}

/// Finds what cannot be. Modes of a measured side are known only when it was fitted: until then some stand for them, and whether effects
/// tell of all of them is not known.
pub(super) fn check(job: &Job, violations: &mut Violations) {
    let structure = super::measured::guessed(job).and_then(|guessed| Some(Case::of(&guessed)?.structure));
    let block = &job.uncertainty;
    let contradiction = || uncertainties(job, structure.as_ref()?, &[]).err();
    block.check(contradiction, |quantity| quantity.missing_in(job), violations);
    open::check(&job.effects, &block.effects, violations);
    let is_measured = job.sides().iter().any(|(.., yielding)| matches!(yielding, Yielding::Receptances(_)));
    if let Some(structure) = structure.as_ref().filter(|_| !is_measured) {
        let stated = block.quantities.iter().map(|one| one.quantity);
        check_brought(stated, |one| one.is_brought(job, structure), violations);
    }
}
