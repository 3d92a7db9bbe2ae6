//! Numbers of a job as the model takes them, in the axes of the cut.

use std::f64::consts::TAU;

use crate::fixture_stability::{Vise, engagement_rad};

use super::super::model::{
    About, Cut as ModelCut, Law, Milling, Mode, Rotation, Rubbing, Side, Structure, Tooth, Vector,
};
use super::input::{
    ChipsAbout, Cut, Cutter, DirectionPart, EdgeForce, FlankRubbing, Job, Milling as Sense, Yielding, YieldingMode,
};

/// Modulations of the speed in a period of the map at most.
pub(in crate::milling_stability) const MODULATIONS: u32 = 8;
/// A modulation is moved by so much at most to fit into a period.
const MOVED: f64 = 0.005;
/// m x'' in kg mm/s2 over the force in N.
const MM_PER_S2: f64 = 1000.0;

/// What a job means.
#[derive(Debug, Clone, PartialEq)]
pub(in crate::milling_stability) struct Case {
    pub milling: Milling,
    pub structure: Structure,
    pub rotation: Rotation,
    pub depth_mm: f64,
    pub width_mm: f64,
}

impl Case {
    /// Of a job without faults, whose measured sides have become modes; `None` of another.
    pub(in crate::milling_stability) fn of(job: &Job) -> Option<Self> {
        let (milling, spindle_rpm) = (milling(job)?, job.spindle_rpm()?);
        let rotation = rotation(job, &milling, spindle_rpm)?;
        let turn = job.cut.feed_direction_deg.to_radians();
        let mut modes = Vec::new();
        for (_, side, yielding) in job.sides() {
            match yielding {
                Yielding::Modes(of) => {
                    for one in &of.modes {
                        modes.push(mode(one, side, turn)?);
                    }
                }
                Yielding::Vise(of) => modes.push(of_vise(&of.fixture, side)?),
                Yielding::Receptances(_) => return None,
                Yielding::Rigid(_) => {}
            }
        }
        let width_mm = milling.radius_mm * (milling.entry_rad.cos() - milling.exit_rad.cos());
        let (structure, depth_mm) = (Structure::new(modes), job.cut.depth_mm);
        Some(Self { milling, structure, rotation, depth_mm, width_mm }.with_effects(&job.effects))
    }

    /// The cut of the job.
    pub(in crate::milling_stability) fn cut(&self) -> ModelCut<'_> {
        let Self { milling, structure, rotation, depth_mm, .. } = self;
        ModelCut { milling, structure, rotation: *rotation, depth_mm: *depth_mm }
    }

    /// Oscillations of the fastest mode in a period of the map.
    pub(in crate::milling_stability) fn oscillations(&self) -> f64 {
        self.oscillations_at(&self.rotation)
    }

    /// The same of another rotation.
    pub(in crate::milling_stability) fn oscillations_at(&self, rotation: &Rotation) -> f64 {
        ModelCut { rotation: *rotation, ..self.cut() }.oscillations()
    }

    /// The spindle at another speed; `None` where its modulation fits into no period there.
    pub(in crate::milling_stability) fn at_speed(&self, spindle_rpm: f64) -> Option<Rotation> {
        if !self.rotation.varies() {
            return Some(Rotation::steady(spindle_rpm));
        }
        varying(&self.milling, spindle_rpm, self.rotation.amplitude, self.rotation.frequency_hz).ok()
    }

    /// Seconds from tooth to tooth on average.
    pub(in crate::milling_stability) fn tooth_period_s(&self) -> f64 {
        60.0 / (self.rotation.spindle_rpm * self.milling.teeth.len() as f64)
    }

    /// Height below which no two teeth of unequal helix meet; infinite where none do.
    pub(in crate::milling_stability) fn teeth_meet_mm(milling: &Milling) -> f64 {
        let teeth = 0..milling.teeth.len();
        let of = |tooth: usize| {
            (1..milling.teeth.len()).filter_map(move |l| {
                let (at_tip, at_1_mm) = (milling.turned_rad(tooth, l, 0.0), milling.turned_rad(tooth, l, 1.0));
                let falls = at_tip - at_1_mm;
                (falls > 1e-15).then(|| at_tip / falls)
            })
        };
        teeth.flat_map(of).fold(f64::INFINITY, f64::min)
    }
}

/// The speeds of a diagram: as the job says, by the spindle, or half to twice the working speed.
pub(in crate::milling_stability) fn range_rpm(job: &Job, working_rpm: f64) -> (f64, f64) {
    let spindle = job.spindle.as_ref();
    let tabled = spindle.and_then(|spindle| spindle.drive().tabled_rpm());
    let least = spindle.and_then(|of| of.speed_min_rpm).or(tabled.map(|(from, _)| from));
    let most = spindle.and_then(|of| of.speed_max_rpm).or(tabled.map(|(_, to)| to));
    let to = job.lobes.to_rpm.or(most).unwrap_or(2.0 * working_rpm);
    let from = job.lobes.from_rpm.or(least).unwrap_or((0.5 * working_rpm).min(0.25 * to));
    (from, to)
}

/// Entry and exit by width or by angles; `None` where neither or an empty arc is given.
pub(super) fn arc_rad(cutter: &Cutter, cut: &Cut) -> Option<(f64, f64)> {
    let radius = 0.5 * cutter.diameter_mm;
    if let Some(width) = cut.width_mm {
        let reach = radius - 0.5 * width.min(cutter.diameter_mm);
        return match cut.milling {
            Sense::Up => engagement_rad(radius, width.min(cutter.diameter_mm), reach),
            Sense::Down => engagement_rad(radius, width.min(cutter.diameter_mm), -reach),
            Sense::Centred => engagement_rad(radius, width, cut.offset_mm),
        };
    }
    let (entry, exit) = (cut.entry_deg?.to_radians(), cut.exit_deg?.to_radians());
    (exit > entry).then_some((entry, exit))
}

pub(super) fn milling(job: &Job) -> Option<Milling> {
    let cutter = &job.cutter;
    let count = usize::try_from(cutter.teeth).ok()?;
    let radius_mm = 0.5 * cutter.diameter_mm;
    let (entry_rad, exit_rad) = arc_rad(cutter, &job.cut)?;
    let tooth = |j: usize| Tooth {
        pitch_rad: cutter.pitch_deg.get(j).map_or(TAU / count as f64, |pitch| pitch.0.to_radians()),
        lag_rad_per_mm: cutter
            .tooth_helix_angle_deg
            .get(j)
            .map_or(cutter.helix_angle_deg, |of| of.0)
            .to_radians()
            .tan()
            / radius_mm,
        radial_mm: cutter.radial_offset_um.get(j).map_or(0.0, |of| of.0 / 1e3),
        axial_mm: cutter.axial_offset_um.get(j).map_or(0.0, |of| of.0 / 1e3),
    };
    let mut teeth: Vec<Tooth> = (0..count).map(tooth).collect();
    // Pitches given to two digits make a turn.
    let turn: f64 = teeth.iter().map(|tooth| tooth.pitch_rad).sum();
    for tooth in &mut teeth {
        tooth.pitch_rad *= TAU / turn;
    }
    let (law, depth_exponent) = law(&job.force);
    Some(Milling {
        radius_mm,
        teeth,
        edge_angle_rad: cutter.cutting_edge_angle_deg.to_radians(),
        entry_rad,
        exit_rad,
        feed_mm: job.feed_mm()?,
        law,
        depth_exponent,
        rubbing: match &job.process_damping {
            Some(rubbing) => Some(Rubbing { coefficient_n_per_mm: coefficient(rubbing)?, friction: rubbing.friction }),
            None => None,
        },
        about: match job.about {
            ChipsAbout::ForcedMotion => About::ForcedMotion,
            ChipsAbout::SmoothChips => About::SmoothChips,
        },
    })
}

fn law(force: &EdgeForce) -> (Law, f64) {
    match force {
        EdgeForce::Mechanistic(of) => {
            let edge = [of.tangential_edge_n_per_mm, of.radial_edge_n_per_mm, of.axial_edge_n_per_mm];
            let cutting = [of.tangential_n_per_mm2, of.radial_n_per_mm2, of.axial_n_per_mm2];
            (Law::Mechanistic { edge, cutting }, 0.0)
        }
        EdgeForce::Kienzle(of) => {
            let at_1_mm = [of.tangential_n_per_mm2, of.radial_n_per_mm2, of.axial_n_per_mm2];
            let exponent = [of.tangential_exponent, of.radial_exponent, of.axial_exponent];
            (Law::Power { at_1_mm, exponent, floor_mm: of.chip_floor_mm }, 0.0)
        }
        EdgeForce::PowerLaw(of) => {
            let at_1_mm = [1.0, of.radial_ratio, of.axial_ratio].map(|ratio| of.coefficient * ratio);
            let exponent = [of.chip_thickness_exponent; 3];
            (Law::Power { at_1_mm, exponent, floor_mm: of.chip_floor_mm }, of.depth_exponent)
        }
    }
}

/// K_w as stated, or by indentation and wear (`milling/2.8`).
pub(super) fn coefficient(rubbing: &FlankRubbing) -> Option<f64> {
    rubbing.coefficient_n_per_mm.or_else(|| Some(0.25 * rubbing.indentation_n_per_mm3? * rubbing.wear_land_mm?.powi(2)))
}

/// The spindle of a job; `None` where its modulation fits into no period.
pub(super) fn rotation(job: &Job, milling: &Milling, spindle_rpm: f64) -> Option<Rotation> {
    match job.speed_variation {
        None => Some(Rotation::steady(spindle_rpm)),
        Some(of) => varying(milling, spindle_rpm, of.amplitude, of.frequency_hz).ok(),
    }
}

/// A modulation that fits into at most eight of its periods, moved by half a percent at most; else the nearest one that fits, Hz.
pub(in crate::milling_stability) fn varying(
    milling: &Milling,
    spindle_rpm: f64,
    amplitude: f64,
    frequency_hz: f64,
) -> Result<Rotation, f64> {
    let per_s = TAU * spindle_rpm / 60.0 / milling.period_rad();
    let fitting = |q: u32| {
        let periods = (per_s * f64::from(q) / frequency_hz).round().max(1.0);
        (q, per_s * f64::from(q) / periods)
    };
    let off = |(_, hz): &(u32, f64)| (hz / frequency_hz - 1.0).abs();
    // The shortest period that is near enough.
    let all: Vec<(u32, f64)> = (1..=MODULATIONS).map(fitting).collect();
    let exact = all.iter().find(|one| off(one) < 1e-9);
    let near = exact.or_else(|| all.iter().find(|one| off(one) <= MOVED));
    match near {
        Some(&(modulations, frequency_hz)) => Ok(Rotation { spindle_rpm, amplitude, frequency_hz, modulations }),
        None => Err(all.iter().min_by(|a, b| off(a).total_cmp(&off(b))).map_or(frequency_hz, |one| one.1)),
    }
}

/// Frequency, mass and damping ratio by what is stated.
pub(super) fn numbers(mode: &YieldingMode) -> Option<(f64, f64, f64)> {
    let (frequency_hz, mass_kg) = match (mode.frequency_hz, mode.mass_kg, mode.stiffness_n_per_mm) {
        (Some(f), Some(m), _) => (f, m),
        (Some(f), None, Some(c)) => (f, MM_PER_S2 * c / (TAU * f).powi(2)),
        (None, Some(m), Some(c)) => ((MM_PER_S2 * c / m).sqrt() / TAU, m),
        _ => return None,
    };
    let critical = 2.0 * mass_kg * TAU * frequency_hz / MM_PER_S2;
    let ratio = mode.damping_ratio.or_else(|| Some(mode.damping_n_s_per_mm? / critical))?;
    Some((frequency_hz, mass_kg, ratio))
}

impl YieldingMode {
    /// Natural frequency, stated or implied, Hz.
    pub(in crate::milling_stability) fn natural_hz(&self) -> Option<f64> {
        Some(numbers(self)?.0)
    }

    /// Damping ratio, stated or implied.
    pub(in crate::milling_stability) fn ratio(&self) -> Option<f64> {
        Some(numbers(self)?.2)
    }
}

fn mode(mode: &YieldingMode, side: Side, turn_rad: f64) -> Option<Mode> {
    let (frequency_hz, mass_kg, damping_ratio) = numbers(mode)?;
    let direction = in_the_cut(direction(mode)?, turn_rad);
    Some(Mode { side, direction, frequency_hz, damping_ratio, mass_kg })
}

/// A vector in the axes of the fixture in those of a cut whose feed is turned by so much.
pub(super) fn in_the_cut([x, y, z]: Vector, turn_rad: f64) -> Vector {
    let (sin, cos) = turn_rad.sin_cos();
    [x * cos + y * sin, y * cos - x * sin, z]
}

/// The workpiece between both joints of a vise whose screw locks itself: one mode along the feed. A jaw that a cylinder presses is a
/// second mass whose damping is not that of modes.
fn of_vise(vise: &Vise, side: Side) -> Option<Mode> {
    let Vise::SelfLocking(of) = vise else { return None };
    let stiffness = of.movable_joint.stiffness_n_per_mm + of.fixed_joint.stiffness_n_per_mm;
    let damping = of.movable_joint.damping_n_s_per_mm + of.fixed_joint.damping_n_s_per_mm;
    let mass_kg = of.workpiece_mass_kg;
    let rad_per_s = (MM_PER_S2 * stiffness / mass_kg).sqrt();
    Some(Mode {
        side,
        direction: [1.0, 0.0, 0.0],
        frequency_hz: rad_per_s / TAU,
        damping_ratio: MM_PER_S2 * damping / (2.0 * mass_kg * rad_per_s),
        mass_kg,
    })
}

/// Of length 1, in the axes of the fixture.
pub(super) fn direction(mode: &YieldingMode) -> Option<Vector> {
    unit(&mode.direction)
}

/// A direction of length 1; `None` where it has none.
pub(super) fn unit(direction: &[DirectionPart]) -> Option<Vector> {
    let [x, y, z] = direction else { return None };
    let length = (x.0 * x.0 + y.0 * y.0 + z.0 * z.0).sqrt();
    (length > 1e-9).then(|| [x.0 / length, y.0 / length, z.0 / length])
}
