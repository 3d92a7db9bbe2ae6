//! The equilibrium at a place of a move: the tool is pushed off until the chip that is left pushes no harder (`program/4.7`).

use std::borrow::Cow;

use crate::deflection_compensation::{Gaps, Held, Opening, Planned, Push};
use crate::force::{Component, DepthLaw, ForceModel};

use super::super::super::job::ProgramTool;
use super::super::reader::{Feed, Speed};
use super::super::stock::Stroke;
use super::aim::Aim;
use super::near::Near;
use super::outline::{Engaged, Outline};

/// Steps to the equilibrium at the most: halving alone needs fewer.
const MOST_STEPS: u32 = 80;
/// How closely it is solved, mm.
const SOLVED_MM: f64 = 1e-8;
/// Steps from a guess before both sides are looked for, and the least by which what is left of a lift has to grow with it there, 1.
const SECANT_STEPS: u32 = 5;
const LEAST_SLOPE: f64 = 0.3;
/// Nothing is said of cuts nearer to the axis, mm on the radius.
pub(crate) const AXIS_MM: f64 = 1.0;

/// Where a move goes on, its depth is that at a place a little on, mm; how deep it is there is asked so far on, mm.
const ON_MM: f64 = 2e-3;
const BEYOND_MM: f64 = 0.5;
/// No edge leans back by more, rad.
const STEEPEST_RAD: f64 = 1.0;

/// What happens at a place of a move.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct CutPlace {
    /// Share of the move before it.
    pub(crate) share: f64,
    /// Programmed point: station and radius, mm.
    pub(crate) z_mm: f64,
    pub(crate) radius_mm: f64,
    /// Depth on work and machine that do not yield, mm.
    pub(crate) nominal_depth_mm: f64,
    /// Depth really cut, mm.
    pub(crate) depth_mm: f64,
    /// Angle from the surface to the edge that cuts, rad.
    pub(crate) lead_rad: f64,
    /// Compliance at the tool, mm/N.
    pub(crate) compliance_mm_per_n: f64,
    /// Radial force on the work, N.
    pub(crate) radial_force_n: f64,
    /// By how much the tool comes to stand off its path, mm.
    pub(crate) lift_mm: f64,
    /// By how much it is meant to: 0, or what a corrected move is off the drawing, mm.
    pub(crate) wanted_mm: f64,
    /// Beside corrected moves, at the ends of a move and where it cuts nothing: how far the tool may be set in there without
    /// touching what is left, mm.
    pub(crate) clear_mm: f64,
    /// What the cut asks of machine and edge, where that is wanted and anything is cut.
    pub(crate) load: Option<Load>,
}

/// What a cut asks of machine and edge at a place.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(crate) struct Load {
    pub(crate) feed_mm_per_rev: f64,
    pub(crate) rpm: f64,
    /// Radius at which the outline leaves the stock, mm.
    pub(crate) outer_radius_mm: f64,
    pub(crate) passive_n: f64,
    pub(crate) main_n: f64,
}

impl Load {
    /// Cutting speed, m/min.
    pub(crate) fn speed_m_per_min(&self) -> f64 {
        2.0 * std::f64::consts::PI * self.outer_radius_mm.max(AXIS_MM) * self.rpm / 1000.0
    }
}

/// Feed and speed of a move, as far as the program says them.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Pace {
    pub(crate) feed: Option<Feed>,
    pub(crate) speed: Option<Speed>,
}

impl Pace {
    /// Turns of the spindle at a programmed radius, rev/min.
    pub(crate) fn rpm(self, radius_mm: f64) -> Option<f64> {
        match self.speed? {
            Speed::Spindle(rpm) => Some(rpm),
            Speed::Surface(speed, limit) => {
                let rpm = 1000.0 * speed / (2.0 * std::f64::consts::PI * radius_mm.max(AXIS_MM));
                Some(limit.map_or(rpm, |limit| rpm.min(limit)))
            }
        }
    }

    /// Feed per revolution at a programmed radius, mm.
    pub(crate) fn feed_mm_per_rev(self, radius_mm: f64) -> Option<f64> {
        match self.feed? {
            Feed::PerRev(feed) => Some(feed),
            Feed::PerMinute(feed) => self.rpm(radius_mm).filter(|rpm| *rpm > 0.0).map(|rpm| feed / rpm),
        }
    }
}

/// A move that cuts, with all that its places have in common.
#[allow(clippy::struct_excessive_bools)] // each is a fact of its own
pub(crate) struct Cutting<'a> {
    pub(crate) stroke: &'a Stroke<'a>,
    pub(crate) held: &'a Held,
    pub(crate) force: &'a ForceModel,
    pub(crate) with_main: bool,
    /// Whether it is told what the cut asks of machine and edge.
    pub(crate) with_loads: bool,
    /// The work before the move: as it would be, did nothing yield, and as it is.
    pub(crate) nominal: Near<'a>,
    pub(crate) real: Near<'a>,
    /// Whether the move goes on where the last one stopped cutting.
    pub(crate) goes_on: bool,
    /// Whether the surface comes out as it is meant: then the depth is that at the place that is meant.
    pub(crate) is_corrected: bool,
    /// The drawing, where that is meant.
    pub(crate) aim: Option<&'a Aim>,
}

/// Forces at a place, for any depth.
struct Loaded<'a> {
    outline: Outline,
    law: Law<'a>,
    with_main: bool,
}

/// A law that may depend on the speed, which follows the diameter.
struct Law<'a> {
    held: &'a Held,
    kept: &'a KeptLaw,
    rpm: f64,
}

impl Law<'_> {
    fn at(&self, outer_radius_mm: f64) -> Cow<'_, DepthLaw> {
        if let Some(law) = &self.kept.fixed {
            return Cow::Borrowed(law);
        }
        let KeptLaw { force, z_mm, feed_mm_per_rev, .. } = self.kept;
        let speed = 2.0 * std::f64::consts::PI * outer_radius_mm.max(AXIS_MM) * self.rpm / 1000.0;
        Cow::Owned(self.held.law(force, *z_mm, *feed_mm_per_rev, speed))
    }
}

/// What one place of a move takes over from the one before.
#[derive(Default)]
pub(crate) struct Kept {
    law: Option<KeptLaw>,
    /// By how much what is left of a lift over the one that it makes grows with it, 1; 0 before it is known.
    slope: f64,
}

/// A force law at an angle of the edge and a feed.
struct KeptLaw {
    lead: f64,
    feed_mm_per_rev: f64,
    z_mm: f64,
    force: ForceModel,
    /// Where the speed changes nothing.
    fixed: Option<DepthLaw>,
}

impl Loaded<'_> {
    fn load(&self, engaged: Engaged, feed_mm_per_rev: f64, rpm: f64) -> Load {
        let law = self.law.at(engaged.outer_radius_mm);
        let force = |component| law.component_and_slope(component, engaged.depth_mm).0;
        let (passive_n, main_n) = (force(Component::Passive).abs(), force(Component::Main));
        Load { feed_mm_per_rev, rpm, outer_radius_mm: engaged.outer_radius_mm, passive_n, main_n }
    }

    fn push(&self, engaged: Engaged) -> Push {
        if engaged.depth_mm <= 0.0 {
            return Push::default();
        }
        let law = self.law.at(engaged.outer_radius_mm);
        let force = |component| law.component_and_slope(component, engaged.depth_mm).0;
        let (passive, feed) = (force(Component::Passive), force(Component::Feed));
        let Outline { normal, feed: along, .. } = self.outline;
        Push {
            radial_n: -(passive * normal[1] + feed * along[1]),
            main_n: if self.with_main { force(Component::Main) } else { 0.0 },
            axial_n: passive * normal[0] + feed * along[0],
        }
    }
}

/// The force law of a tool that cuts at an angle: Kienzle's is integrated along this very edge, the others are as they were
/// measured.
fn force_of(force: &ForceModel, tool: &ProgramTool, lead_rad: f64) -> ForceModel {
    let mut force = force.clone();
    if let ForceModel::Kienzle(law) = &mut force {
        law.cutting_edge_angle_deg = lead_rad.to_degrees();
        law.nose_radius_mm = tool.nose_radius_mm;
    }
    force
}

impl Cutting<'_> {
    fn outline(&self, share: f64) -> Option<Outline> {
        let Stroke { tool, shape, way, .. } = self.stroke;
        way.direction(share).and_then(|feed| Outline::of(tool, shape, feed))
    }

    /// From which share on the depth is what the tool meets: where a move goes on, an edge that leans back stands beside the
    /// stock until it has passed the wall that stands for what it left leaning.
    pub(crate) fn meets_from(&self) -> f64 {
        let length_mm = self.stroke.way.length_mm();
        let Some(outline) = self.outline(0.0).filter(|_| self.goes_on && length_mm > 0.0) else { return 0.0 };
        let beyond = self.stroke.way.at((BEYOND_MM / length_mm).min(1.0));
        let depth_mm = outline.engaged(&self.real, beyond).depth_mm;
        let lean = (outline.lead - std::f64::consts::FRAC_PI_2).clamp(0.0, STEEPEST_RAD).tan();
        ((depth_mm * lean + ON_MM) / length_mm).min(1.0)
    }

    /// Depth, feed and cutting speed that are planned at a share of the move, where a formula of the user may ask for them.
    pub(crate) fn planned(&self, share: f64, from: f64) -> Planned {
        if !self.held.has_formulas() {
            return Planned::default();
        }
        let way = &self.stroke.way;
        let radius_mm = way.at(share)[1];
        let pace = Pace { feed: self.stroke.one.feed, speed: self.stroke.one.speed };
        let depth_of = |outline: Outline| outline.engaged(&self.nominal, way.at(share.max(from))).depth_mm;
        Planned {
            depth_mm: self.outline(share).map_or(0.0, depth_of),
            feed_mm_per_rev: pace.feed_mm_per_rev(radius_mm).unwrap_or(0.0),
            speed_m_per_min: 2.0 * std::f64::consts::PI * radius_mm * pace.rpm(radius_mm).unwrap_or(0.0) / 1000.0,
        }
    }

    /// How far off its path the tool is meant to be, mm.
    fn wanted_mm(&self, share: f64) -> f64 {
        self.aim.filter(|_| self.is_corrected).map_or(0.0, |aim| aim.off_mm(self.stroke, share))
    }

    /// The force law at an angle of the edge: that of the place before, where nothing changes it.
    fn law<'k>(&self, kept: &'k mut Option<KeptLaw>, lead: f64, feed_mm_per_rev: f64, z_mm: f64) -> &'k KeptLaw {
        let same = |a: f64, b: f64| a.to_bits() == b.to_bits();
        let is_as_before = |kept: &KeptLaw| {
            let at_place = self.held.is_same_everywhere() || same(kept.z_mm, z_mm);
            same(kept.lead, lead) && same(kept.feed_mm_per_rev, feed_mm_per_rev) && at_place
        };
        let known = kept.take().filter(is_as_before);
        kept.insert(known.unwrap_or_else(|| {
            let force = force_of(self.force, self.stroke.tool, lead);
            let of_speed = force.depends_on_speed() || self.held.depends_on_speed();
            let fixed = (!of_speed).then(|| self.held.law(&force, z_mm, feed_mm_per_rev, 100.0));
            KeptLaw { lead, feed_mm_per_rev, z_mm, force, fixed }
        }))
    }

    /// What happens at a share of the move, at the depth that is met from `from` on; `place` is its number among those of the gaps,
    /// `guess_mm` a lift near that there.
    pub(crate) fn at(
        &self,
        (share, from): (f64, f64),
        (gaps, place): (&Gaps, usize),
        guess_mm: f64,
        kept: &mut Kept,
    ) -> CutPlace {
        let [z_mm, radius_mm] = self.stroke.way.at(share);
        let compliance_mm_per_n = gaps.compliance_mm_per_n(place);
        let still = CutPlace {
            share,
            z_mm,
            radius_mm,
            nominal_depth_mm: 0.0,
            depth_mm: 0.0,
            lead_rad: 0.0,
            compliance_mm_per_n,
            radial_force_n: 0.0,
            lift_mm: lift_mm(radius_mm, gaps.opening(place, Push::default())),
            wanted_mm: self.wanted_mm(share),
            clear_mm: 0.0,
            load: None,
        };
        let pace = Pace { feed: self.stroke.one.feed, speed: self.stroke.one.speed };
        let (Some(outline), Some(feed_mm_per_rev)) = (self.outline(share), pace.feed_mm_per_rev(radius_mm)) else {
            return still;
        };
        if radius_mm < AXIS_MM {
            return CutPlace { lift_mm: 0.0, ..still };
        }
        let [met_z_mm, met_radius_mm] = self.stroke.way.at(share.max(from));
        let nominal_depth_mm = outline.engaged(&self.nominal, [met_z_mm, met_radius_mm]).depth_mm;
        let rpm = pace.rpm(radius_mm).unwrap_or(1.0);
        let law = Law { held: self.held, kept: self.law(&mut kept.law, outline.lead, feed_mm_per_rev, z_mm), rpm };
        let loaded = Loaded { outline, law, with_main: self.with_main };
        let at = |lift: f64| {
            let engaged = outline.engaged(&self.real, [met_z_mm, met_radius_mm + lift]);
            let push = loaded.push(engaged);
            (lift_mm(radius_mm, gaps.opening(place, push)), engaged.depth_mm, push.radial_n)
        };
        let wanted_mm = still.wanted_mm;
        let (lift_mm, depth_mm, radial_force_n) =
            if self.is_corrected { at(wanted_mm) } else { equilibrium(at, guess_mm, &mut kept.slope) };
        let load = (self.with_loads && depth_mm > 0.0).then(|| {
            let lift = if self.is_corrected { wanted_mm } else { lift_mm };
            let engaged = outline.engaged(&self.real, [met_z_mm, met_radius_mm + lift]);
            loaded.load(engaged, feed_mm_per_rev, rpm)
        });
        CutPlace { load, nominal_depth_mm, depth_mm, lead_rad: outline.lead, radial_force_n, lift_mm, ..still }
    }
}

/// By how much the surface that is made stands off the one that is programmed, mm: the work moves away, and aside.
fn lift_mm(radius_mm: f64, opening: Opening) -> f64 {
    if opening.z_mm.abs() <= 0.0 {
        return opening.y_mm;
    }
    (radius_mm + opening.y_mm).hypot(opening.z_mm) - radius_mm
}

/// The lift that makes itself: with the depth and the force there. Near a guess, with how what is left of a lift grows with it at the
/// place before, a few steps find it.
fn equilibrium(at: impl Fn(f64) -> (f64, f64, f64), guess_mm: f64, slope: &mut f64) -> (f64, f64, f64) {
    let mut state = at(guess_mm);
    let mut last = (guess_mm, guess_mm - state.0);
    for _ in 0..SECANT_STEPS {
        if last.1.abs() <= SOLVED_MM {
            return state;
        }
        let lift = last.0 - last.1 / if *slope > 0.0 { *slope } else { 1.0 };
        state = at(lift);
        let left = lift - state.0;
        let found = (left - last.1) / (lift - last.0);
        if found < LEAST_SLOPE || left.abs() > 0.5 * last.1.abs() {
            break;
        }
        (*slope, last) = (found, (lift, left));
    }
    bracketed(at)
}

/// The same from none: between two lifts of which one is too small and one too large.
fn bracketed(at: impl Fn(f64) -> (f64, f64, f64)) -> (f64, f64, f64) {
    let first = at(0.0);
    if first.0.abs() <= SOLVED_MM {
        return first;
    }
    // What is left of the lift over the one it makes; it rises with the lift.
    let mut low = (0.0, -first.0);
    let mut high = (first.0, 0.0);
    let mut state = at(high.0);
    high.1 = high.0 - state.0;
    for _ in 0..MOST_STEPS {
        if low.1.signum() * high.1.signum() < 0.0 {
            break;
        }
        if high.1.abs() <= SOLVED_MM {
            return state;
        }
        low = high;
        high.0 = state.0 + (state.0 - high.0);
        state = at(high.0);
        high.1 = high.0 - state.0;
    }
    for _ in 0..MOST_STEPS {
        if high.1.abs() <= SOLVED_MM || (high.0 - low.0).abs() <= SOLVED_MM {
            break;
        }
        let next = high.0 - high.1 * (high.0 - low.0) / (high.1 - low.1);
        state = at(next);
        let left = next - state.0;
        if left.signum() * high.1.signum() < 0.0 {
            low = high;
        } else {
            // An end that stays is taken half as seriously each time.
            low.1 *= 0.5;
        }
        high = (next, left);
    }
    state
}
