//! The cut: which teeth are in the arc, and the force along the feed.

use std::f64::consts::{PI, TAU};

use crate::num::quadrature::integrate;

/// Arcs that differ from a whole number of pitches by less than this, rad, are taken as whole.
const SAME_ANGLE_RAD: f64 = 1e-9;
/// Samples of a smooth piece of the force before the extreme is refined by a parabola: error below 1e-9 of the force.
const PIECE_SAMPLES: u32 = 400;

/// Cutter, engagement and force law.
#[derive(Debug, Clone, PartialEq)]
pub(in crate::fixture_stability) struct Cutting {
    pub teeth: usize,
    pub radius_mm: f64,
    /// Angle at which a tooth enters, from the normal to the feed on the entry side.
    pub entry_rad: f64,
    pub exit_rad: f64,
    /// Cp of the law, N/mm^(2-k-mu).
    pub coefficient: f64,
    /// k: the force goes with the power 1-k of the chip thickness.
    pub chip_exponent: f64,
    /// mu: the force goes with the power 1-mu of the depth.
    pub depth_exponent: f64,
    /// Radial over tangential force.
    pub radial_ratio: f64,
    /// Axial over tangential force, positive where it lifts the workpiece.
    pub axial_ratio: f64,
    /// +1: feed toward the movable jaw, -1: toward the fixed jaw.
    pub direction: f64,
    /// How far tooth 0 stands out, mm.
    pub runout_mm: f64,
    /// Process damping K_pd, N/mm per tooth in cut.
    pub process_damping_n_per_mm: f64,
}

/// A stretch of the tooth period in which no tooth enters or leaves. Angles count from the entry of a tooth.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::fixture_stability) struct Stretch {
    pub from_rad: f64,
    pub to_rad: f64,
    /// Teeth in cut: at from_rad + j pitch behind the entry, j below this.
    pub teeth: usize,
}

impl Stretch {
    pub(in crate::fixture_stability) fn length_rad(&self) -> f64 {
        self.to_rad - self.from_rad
    }
}

/// Entry and exit angle of a strip from `offset - width/2` to `offset + width/2` (`fixture/2.1`); `None` when it misses the cutter.
pub(crate) fn engagement_rad(radius_mm: f64, width_mm: f64, offset_mm: f64) -> Option<(f64, f64)> {
    let entry = ((offset_mm + 0.5 * width_mm) / radius_mm).min(1.0);
    let exit = ((offset_mm - 0.5 * width_mm) / radius_mm).max(-1.0);
    let (entry_rad, exit_rad) = (entry.max(-1.0).acos(), exit.min(1.0).acos());
    (exit_rad - entry_rad > SAME_ANGLE_RAD).then_some((entry_rad, exit_rad))
}

impl Cutting {
    pub(in crate::fixture_stability) fn pitch_rad(&self) -> f64 {
        TAU / self.teeth as f64
    }

    pub(in crate::fixture_stability) fn arc_rad(&self) -> f64 {
        self.exit_rad - self.entry_rad
    }

    /// Time from tooth to tooth, s.
    pub(in crate::fixture_stability) fn tooth_period_s(&self, spindle_rpm: f64) -> f64 {
        60.0 / (spindle_rpm * self.teeth as f64)
    }

    /// sin^(1-k) phi (cos phi + rho sin phi): the share of one tooth in the force along the feed (`fixture/2.2`).
    pub(in crate::fixture_stability) fn shape(&self, angle_rad: f64) -> f64 {
        let (sin, cos) = angle_rad.sin_cos();
        let sin = sin.max(0.0);
        self.thickness(sin) * (cos + self.radial_ratio * sin)
    }

    /// The same across the feed: sin^(1-k) phi (rho cos phi - sin phi).
    pub(in crate::fixture_stability) fn across(&self, angle_rad: f64) -> f64 {
        let (sin, cos) = angle_rad.sin_cos();
        let sin = sin.max(0.0);
        self.thickness(sin) * (self.radial_ratio * cos - sin)
    }

    /// sin^(1-k) phi: the share of one tooth in the tangential force.
    pub(in crate::fixture_stability) fn tangential(&self, angle_rad: f64) -> f64 {
        self.thickness(angle_rad.sin().max(0.0))
    }

    /// sin phi to the power 1-k.
    fn thickness(&self, sin: f64) -> f64 {
        if self.chip_exponent > 0.0 { sin.powf(1.0 - self.chip_exponent) } else { sin }
    }

    /// Angle of the j-th tooth back from the one that entered last.
    pub(in crate::fixture_stability) fn angle_rad(&self, since_entry_rad: f64, tooth: usize) -> f64 {
        self.entry_rad + since_entry_rad + tooth as f64 * self.pitch_rad()
    }

    /// The tooth period as one or two smooth stretches, in order.
    pub(in crate::fixture_stability) fn stretches(&self) -> Vec<Stretch> {
        let pitch = self.pitch_rad();
        let mut whole = (self.arc_rad() / pitch).floor();
        let mut rest = self.arc_rad() - whole * pitch;
        if pitch - rest < SAME_ANGLE_RAD {
            whole += 1.0;
            rest = 0.0;
        }
        // Teeth in an arc of at most 180 degrees are at most half of all teeth.
        let whole = (0..=self.teeth).take_while(|&n| n as f64 <= whole).last().unwrap_or(0);
        if rest < SAME_ANGLE_RAD {
            return vec![Stretch { from_rad: 0.0, to_rad: pitch, teeth: whole }];
        }
        vec![
            Stretch { from_rad: 0.0, to_rad: rest, teeth: whole + 1 },
            Stretch { from_rad: rest, to_rad: pitch, teeth: whole },
        ]
    }

    /// Whether a period of the force is a whole revolution instead of a tooth pitch.
    pub(in crate::fixture_stability) fn uneven(&self) -> bool {
        self.runout_mm.abs() > 0.0 && self.teeth > 1
    }

    /// Tooth periods in a period of the force.
    pub(in crate::fixture_stability) fn phases(&self) -> usize {
        if self.uneven() { self.teeth } else { 1 }
    }

    /// Feed per tooth that a tooth really takes when all cut: the one that stands out more, the next one less.
    pub(in crate::fixture_stability) fn chip_mm(&self, feed_mm: f64, tooth: usize) -> f64 {
        if !self.uneven() {
            return feed_mm;
        }
        match tooth % self.teeth {
            0 => feed_mm + self.runout_mm,
            1 => feed_mm - self.runout_mm,
            _ => feed_mm,
        }
    }

    /// Number of the tooth that is j-th back from the entry in the phase-th tooth period.
    pub(in crate::fixture_stability) fn tooth_number(&self, phase: usize, j: usize) -> usize {
        (phase + self.teeth - j % self.teeth) % self.teeth
    }

    /// Cp H^(1-mu), N/mm^(1-k).
    pub(in crate::fixture_stability) fn level(&self, depth_mm: f64) -> f64 {
        self.coefficient * self.depth_power(depth_mm)
    }

    pub(in crate::fixture_stability) fn depth_power(&self, depth_mm: f64) -> f64 {
        if depth_mm <= 0.0 { 0.0 } else { depth_mm.powf(1.0 - self.depth_exponent) }
    }

    /// Chip thickness to the power 1-k.
    pub(in crate::fixture_stability) fn chip_power(&self, chip_mm: f64) -> f64 {
        if chip_mm <= 0.0 {
            0.0
        } else if self.chip_exponent > 0.0 {
            chip_mm.powf(1.0 - self.chip_exponent)
        } else {
            chip_mm
        }
    }

    /// Sum over the teeth in cut of their share times the power of their chip: the force over the level, without its direction.
    pub(in crate::fixture_stability) fn smooth_force(
        &self,
        stretch: &Stretch,
        since_entry_rad: f64,
        phase: usize,
        feed_mm: f64,
    ) -> f64 {
        self.smooth(stretch, since_entry_rad, phase, feed_mm, &|angle| self.shape(angle))
    }

    /// The same for any share of one tooth over its angle.
    fn smooth(
        &self,
        stretch: &Stretch,
        since_entry_rad: f64,
        phase: usize,
        feed_mm: f64,
        shape: &dyn Fn(f64) -> f64,
    ) -> f64 {
        (0..stretch.teeth)
            .map(|j| {
                let chip = self.chip_mm(feed_mm, self.tooth_number(phase, j));
                shape(self.angle_rad(since_entry_rad, j)) * self.chip_power(chip)
            })
            .sum()
    }

    /// The same for the slope of the force over the chip: (1-k) chip^(-k) instead of chip^(1-k) (`fixture/5.1`).
    pub(in crate::fixture_stability) fn chip_slope(
        &self,
        stretch: &Stretch,
        since_entry_rad: f64,
        phase: usize,
        feed_mm: f64,
    ) -> f64 {
        let k = self.chip_exponent;
        (0..stretch.teeth)
            .map(|j| {
                let chip = self.chip_mm(feed_mm, self.tooth_number(phase, j));
                let slope = if k > 0.0 { (1.0 - k) * chip.powf(-k) } else { 1.0 };
                slope * self.shape(self.angle_rad(since_entry_rad, j))
            })
            .sum()
    }

    /// Largest and smallest force along the feed with a smooth chip, N, signed: positive toward the movable jaw.
    pub(in crate::fixture_stability) fn static_extremes_n(&self, feed_mm: f64, depth_mm: f64) -> (f64, f64) {
        let (high, low) = self.extremes(|stretch, since, phase| self.smooth_force(stretch, since, phase, feed_mm));
        let level = self.level(depth_mm);
        if self.direction > 0.0 { (high * level, low * level) } else { (-low * level, -high * level) }
    }

    /// Largest tangential force of all teeth in cut together with a smooth chip, N.
    pub(in crate::fixture_stability) fn tangential_max_n(&self, feed_mm: f64, depth_mm: f64) -> f64 {
        self.extremes_of(feed_mm, &|angle| self.tangential(angle)).0 * self.level(depth_mm)
    }

    /// Largest and smallest sum over the teeth in cut of a share times the power of their smooth chip.
    pub(in crate::fixture_stability) fn extremes_of(&self, feed_mm: f64, shape: &dyn Fn(f64) -> f64) -> (f64, f64) {
        self.extremes(|stretch, since, phase| self.smooth(stretch, since, phase, feed_mm, shape))
    }

    /// Largest and smallest value over a period of the force, one-sided limits at entries and exits included.
    fn extremes(&self, value: impl Fn(&Stretch, f64, usize) -> f64) -> (f64, f64) {
        let (mut high, mut low) = (f64::NEG_INFINITY, f64::INFINITY);
        let mut take = |value: f64| {
            high = high.max(value);
            low = low.min(value);
        };
        for phase in 0..self.phases() {
            for stretch in self.stretches() {
                let step = stretch.length_rad() / f64::from(PIECE_SAMPLES);
                let at = |s: f64| value(&stretch, stretch.from_rad + s * step, phase);
                let (mut before, mut here) = (at(0.0), at(1.0));
                take(before);
                for s in 2..=PIECE_SAMPLES {
                    let next = at(f64::from(s));
                    take(here);
                    let curvature = before - 2.0 * here + next;
                    if (here - before) * (next - here) < 0.0 {
                        let slope = 0.5 * (next - before);
                        take(here - 0.5 * slope * slope / curvature);
                    }
                    (before, here) = (here, next);
                }
                take(here);
            }
        }
        (high, low)
    }

    /// The mean directional factor a0 (`fixture/5.3`).
    pub(in crate::fixture_stability) fn mean_factor(&self) -> f64 {
        self.mean_of(&|angle| self.shape(angle))
    }

    /// z/(2 pi) times the integral of a share of one tooth over the arc.
    pub(in crate::fixture_stability) fn mean_of(&self, shape: &dyn Fn(f64) -> f64) -> f64 {
        // Half an arc each; the substitution takes the root of sin^(1-k) at 0 and pi away: phi = end + width s^4.
        let middle = 0.5 * (self.entry_rad + self.exit_rad);
        let half = |end: f64| {
            let width = middle - end;
            integrate(0.0, 1.0, 40, |s| shape(end + width * s.powi(4)) * 4.0 * s.powi(3)) * width.abs()
        };
        self.teeth as f64 / TAU * (half(self.entry_rad) + half(self.exit_rad))
    }

    /// Smallest distance of an engaged tooth from the root of sin phi at the start and at the end of a stretch.
    pub(in crate::fixture_stability) fn distance_from_root_rad(&self, stretch: &Stretch) -> (f64, f64) {
        let near = |since: f64| {
            (0..stretch.teeth)
                .map(|j| {
                    let angle = self.angle_rad(since, j);
                    angle.abs().min((PI - angle).abs())
                })
                .fold(f64::INFINITY, f64::min)
        };
        (near(stretch.from_rad), near(stretch.to_rad))
    }
}
