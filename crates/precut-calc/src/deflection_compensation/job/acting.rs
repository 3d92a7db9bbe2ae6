//! Named effects, digested into what they change: the structure, the force, the radial error.

use crate::calculator::{Failure, Finding};
use crate::effects::{DeflectionConditions, DeflectionEffect as Effect, ErrorPoint};

use crate::deflection_compensation::job::formula::Written;
use crate::deflection_compensation::job::input::FeedDirection;
use crate::deflection_compensation::model::yielding::Line;

/// What the effects of a job change.
#[derive(Debug, Clone, PartialEq)]
pub(in crate::deflection_compensation) struct Acting {
    pub structure: StructureChange,
    pub force: ForceChange,
    /// Supports that are set off the axis.
    pub set_off: Vec<SetOff>,
    errors: Vec<ErrorTerm>,
    /// Standard deviation of the radius from trace to trace, mm.
    pub scatter_mm: f64,
}

/// Change of what bends and of what holds.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::deflection_compensation) struct StructureChange {
    /// Added compliance of the leftmost carrying support, mm/N.
    pub headstock_mm_per_n: f64,
    /// Added compliance of the rightmost, mm/N.
    pub tailstock_mm_per_n: f64,
    /// Added compliance of the carriage, mm/N.
    pub carriage_mm_per_n: f64,
    /// Factor on the flexibility of the shaft.
    pub flexibility: f64,
    /// Rotational compliance that the headstock gets, rad/(N mm).
    pub headstock_rotation_rad_per_n_mm: Option<f64>,
    /// The uncut side bends with the blank's section.
    pub uncut_side: bool,
}

impl StructureChange {
    const NONE: Self = Self {
        headstock_mm_per_n: 0.0,
        tailstock_mm_per_n: 0.0,
        carriage_mm_per_n: 0.0,
        flexibility: 1.0,
        headstock_rotation_rad_per_n_mm: None,
        uncut_side: false,
    };
}

/// Change of the force: P -> P * factor(u, s, v) * (t/t_ref)^dx, and an addition to the passive force.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::deflection_compensation) struct ForceChange {
    level: f64,
    gradient: f64,
    feed: Option<(f64, f64)>,
    speed: Option<(f64, f64)>,
    built_up_edge: Option<(f64, f64, f64)>,
    /// Change of the depth exponent and the depth about which it turns, mm.
    pub depth: Option<(f64, f64)>,
    /// Added to the passive force, N.
    pub added_passive_n: f64,
}

impl ForceChange {
    const NONE: Self = Self {
        level: 1.0,
        gradient: 0.0,
        feed: None,
        speed: None,
        built_up_edge: None,
        depth: None,
        added_passive_n: 0.0,
    };

    /// Whether one factor holds for all stations that are cut at one speed.
    pub(in crate::deflection_compensation) fn same_everywhere(&self) -> bool {
        self.gradient.abs() <= 0.0
    }

    /// Whether the factor changes with the cutting speed.
    pub(in crate::deflection_compensation) fn depends_on_speed(&self) -> bool {
        self.speed.is_some() || self.built_up_edge.is_some()
    }

    /// Factor on all components at relative station u, feed and speed (`diagnosis/4.10` to `4.15`).
    pub(in crate::deflection_compensation) fn factor(&self, u: f64, feed_mm_per_rev: f64, speed_m_per_min: f64) -> f64 {
        let mut factor = self.level * (1.0 + self.gradient * (u - 0.5));
        if let Some((delta, reference)) = self.feed {
            factor *= (feed_mm_per_rev / reference).powf(delta);
        }
        if let Some((delta, reference)) = self.speed {
            factor *= (speed_m_per_min / reference).powf(delta);
        }
        if let Some((drop, centre, width)) = self.built_up_edge {
            let distance = (speed_m_per_min - centre) / width;
            factor *= 1.0 - drop * (-distance * distance).exp();
        }
        factor.max(0.0)
    }
}

/// A support that is set off the axis; positive away from the tool.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::deflection_compensation) enum SetOff {
    /// The rightmost carrying support.
    Tailstock { offset_mm: f64 },
    /// The steady rest at a station, by what it moves the shaft that it holds.
    SteadyRest { station_mm: f64, offset_mm: f64 },
}

/// A term of the extra radial error e that depends on nothing but where and when the tool passes.
#[derive(Debug, Clone, PartialEq)]
enum ErrorTerm {
    Constant { error_mm: f64 },
    Bow { at_middle_mm: f64 },
    Wear { rate_mm_per_m: f64, wear_in_mm: f64, wear_in_path_m: f64, path_at_start_m: f64 },
    Growth { growth_mm: f64, time_constant_min: f64, warm_at_start_min: f64 },
    Heating { strain: f64, time_constant_min: f64 },
    Profile { scale: f64, profile: Vec<ErrorPoint> },
    Formula(Written),
}

/// Where and when the tool passes a station.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::deflection_compensation) struct Passage {
    /// Station from the headstock end, mm.
    pub z_mm: f64,
    /// z/L.
    pub u: f64,
    /// Diameter produced, mm.
    pub diameter_mm: f64,
    /// Path that this edge has cut in the job before the station, in earlier passes and in this one, m.
    pub path_m: f64,
    /// Time in the cut before the station, likewise, min.
    pub time_min: f64,
    /// Depth that is planned to be cut there, mm.
    pub depth_mm: f64,
    pub feed_mm_per_rev: f64,
    pub speed_m_per_min: f64,
}

const MM_PER_UM: f64 = 1e-3;

impl Acting {
    /// What `effects` change. A condition that is absent counts as 0; [`crate::deflection_compensation::job::check`] has refused it where it matters.
    pub(in crate::deflection_compensation) fn of(
        effects: &[Effect],
        conditions: &DeflectionConditions,
        direction: FeedDirection,
    ) -> Self {
        let mut acting = Self {
            structure: StructureChange::NONE,
            force: ForceChange::NONE,
            set_off: Vec::new(),
            errors: Vec::new(),
            scatter_mm: 0.0,
        };
        for effect in effects {
            acting.add(effect, conditions, direction);
        }
        acting
    }

    fn add(&mut self, effect: &Effect, conditions: &DeflectionConditions, direction: FeedDirection) {
        let (structure, force) = (&mut self.structure, &mut self.force);
        match *effect {
            Effect::HeadstockCompliance { delta_um_per_n } => {
                structure.headstock_mm_per_n += delta_um_per_n * MM_PER_UM;
            }
            Effect::TailstockCompliance { delta_um_per_n } => {
                structure.tailstock_mm_per_n += delta_um_per_n * MM_PER_UM;
            }
            Effect::CarriageCompliance { delta_um_per_n } => structure.carriage_mm_per_n += delta_um_per_n * MM_PER_UM,
            Effect::BendingScale { delta } => structure.flexibility *= 1.0 + delta,
            Effect::ChuckRotationalStiffness { ktheta_n_mm_per_rad } => {
                structure.headstock_rotation_rad_per_n_mm = Some(1.0 / ktheta_n_mm_per_rad);
            }
            Effect::UncutSideStiffness {} => structure.uncut_side = true,
            Effect::ForceLevel { delta } => force.level *= 1.0 + delta,
            Effect::DepthExponent { delta, reference_depth_mm } => force.depth = Some((delta, reference_depth_mm)),
            Effect::FeedExponent { delta, reference_feed_mm_per_rev } => {
                force.feed = Some((delta, reference_feed_mm_per_rev));
            }
            Effect::SpeedExponent { delta, reference_speed_m_per_min } => {
                force.speed = Some((delta, reference_speed_m_per_min));
            }
            Effect::HardnessGradient { gradient } => force.gradient += gradient,
            Effect::BuiltUpEdge { drop, centre_m_per_min, width_m_per_min } => {
                force.built_up_edge = Some((drop, centre_m_per_min, width_m_per_min));
            }
            Effect::PloughingForce { force_n } => force.added_passive_n += force_n,
            Effect::SpindleScatter { sd_um } => self.scatter_mm = sd_um * MM_PER_UM,
            Effect::TailstockOffset { offset_um } => {
                self.set_off.push(SetOff::Tailstock { offset_mm: offset_um * MM_PER_UM });
            }
            Effect::GuidewayBow { bow_um } => self.errors.push(ErrorTerm::Bow { at_middle_mm: bow_um * MM_PER_UM }),
            Effect::ReversalBacklash { backlash_um } => {
                let sign = if direction == FeedDirection::ToHeadstock { 0.5 } else { -0.5 };
                self.errors.push(ErrorTerm::Constant { error_mm: sign * backlash_um * MM_PER_UM });
            }
            Effect::SizeOffset { offset_um } => {
                self.errors.push(ErrorTerm::Constant { error_mm: offset_um * MM_PER_UM });
            }
            Effect::ToolWear { rate_um_per_km, wear_in_um, wear_in_path_m } => self.errors.push(ErrorTerm::Wear {
                rate_mm_per_m: rate_um_per_km * MM_PER_UM / 1000.0,
                wear_in_mm: wear_in_um * MM_PER_UM,
                wear_in_path_m,
                path_at_start_m: conditions.tool_path_at_start_m.unwrap_or(0.0),
            }),
            Effect::ThermalGrowth { growth_um, time_constant_min } => self.errors.push(ErrorTerm::Growth {
                growth_mm: growth_um * MM_PER_UM,
                time_constant_min,
                warm_at_start_min: conditions.warm_time_at_start_min.unwrap_or(0.0),
            }),
            Effect::WorkpieceHeating { temperature_rise_k, time_constant_min, expansion_um_per_m_k } => {
                self.errors.push(ErrorTerm::Heating {
                    // um/(m K) is 1e-6/K.
                    strain: temperature_rise_k * expansion_um_per_m_k * 1e-6,
                    time_constant_min,
                });
            }
            Effect::SteadyRestOffset { station_mm, offset_um } => {
                self.set_off.push(SetOff::SteadyRest { station_mm, offset_mm: offset_um * MM_PER_UM });
            }
            Effect::Remainder { scale, ref profile, .. } => {
                self.errors.push(ErrorTerm::Profile { scale: scale * MM_PER_UM, profile: profile.clone() });
            }
            Effect::Formula { .. } => {
                let written = effect.formula().and_then(|own| Written::of(&own, conditions));
                self.errors.extend(written.map(ErrorTerm::Formula));
            }
        }
    }

    /// Whether any effect adds a radial error.
    pub(in crate::deflection_compensation) fn has_errors(&self) -> bool {
        !(self.errors.is_empty() && self.set_off.is_empty())
    }

    /// Whether any effect acts on the outermost carrying supports as such.
    pub(in crate::deflection_compensation) fn changes_an_end(&self) -> bool {
        let StructureChange { headstock_mm_per_n, tailstock_mm_per_n, .. } = self.structure;
        let set_off = self.set_off.iter().any(|set_off| matches!(set_off, SetOff::Tailstock { .. }));
        set_off || headstock_mm_per_n.abs() + tailstock_mm_per_n.abs() > 0.0
    }

    /// The first formula that has no value at a station: what it is called.
    pub(in crate::deflection_compensation) fn without_value(&self, at: Passage) -> Option<&str> {
        self.errors.iter().find_map(|term| match term {
            ErrorTerm::Formula(written) if !written.error_mm(at).is_finite() => Some(written.label()),
            _ => None,
        })
    }

    /// Whether a formula of the user is among the errors.
    pub(in crate::deflection_compensation) fn has_formulas(&self) -> bool {
        self.errors.iter().any(|term| matches!(term, ErrorTerm::Formula(_)))
    }

    /// Whether all errors along a line have a value; where a formula of the user has none, which and where.
    pub(in crate::deflection_compensation) fn values(&self, line: &Line, passages: &[Passage]) -> Result<(), Failure> {
        let mut lacking = passages.iter().enumerate().filter(|(i, _)| !line.has_error_value(*i));
        match lacking.find_map(|(_, at)| Some((at, self.without_value(*at)?))) {
            None => Ok(()),
            Some((at, name)) => {
                let finding = Finding::new("formula_without_value", "/effects");
                Err(Failure::OutOfModel(finding.with("name", name.to_owned()).with("z_mm", at.z_mm)))
            }
        }
    }

    /// Extra radial error e at a station, mm, positive = oversize; without what supports do that are set off. Not finite where a
    /// formula of the user has no value.
    pub(in crate::deflection_compensation) fn error_mm(&self, at: Passage) -> f64 {
        self.errors.iter().map(|term| term.error_mm(at)).sum()
    }
}

impl ErrorTerm {
    fn error_mm(&self, at: Passage) -> f64 {
        match *self {
            Self::Constant { error_mm } => error_mm,
            Self::Bow { at_middle_mm } => 4.0 * at_middle_mm * at.u * (1.0 - at.u),
            Self::Wear { rate_mm_per_m, wear_in_mm, wear_in_path_m, path_at_start_m } => {
                let path = path_at_start_m + at.path_m;
                wear_in_mm * -(-path / wear_in_path_m).exp_m1() + rate_mm_per_m * path
            }
            Self::Growth { growth_mm, time_constant_min, warm_at_start_min } => {
                growth_mm * (-(warm_at_start_min + at.time_min) / time_constant_min).exp_m1()
            }
            Self::Heating { strain, time_constant_min } => {
                0.5 * at.diameter_mm * strain * (-at.time_min / time_constant_min).exp_m1()
            }
            Self::Profile { scale, ref profile } => scale * error_um(profile, at.z_mm),
            Self::Formula(ref written) => written.error_mm(at),
        }
    }
}

/// The error of a remainder at a place: straight between the places it is given at, beyond them as at the ends.
pub(in crate::deflection_compensation) fn error_um(profile: &[ErrorPoint], z_mm: f64) -> f64 {
    let next = profile.partition_point(|point| point.z_mm <= z_mm);
    match (next.checked_sub(1).map(|last| profile[last]), profile.get(next)) {
        (Some(before), Some(after)) => {
            let share = (z_mm - before.z_mm) / (after.z_mm - before.z_mm);
            before.error_um + share * (after.error_um - before.error_um)
        }
        (Some(last), None) => last.error_um,
        (None, first) => first.map_or(0.0, |first| first.error_um),
    }
}
