//! A job with its effects, as the kernel takes it: a setting whose ring turns counter-clockwise, and the blank.

use std::f64::consts::{PI, TAU};

use crate::effects::RingEffect as Effect;
use crate::num::roundness::{PeriodicSpline, RoundnessError};

use crate::ring_roundness::job::cut_force;
use crate::ring_roundness::job::input::{Job, Ring, Rotation};
use crate::ring_roundness::model::lobing::Lobing;
use crate::ring_roundness::model::softness::Softness;
use crate::ring_roundness::model::stance::{Copying, Stance, through_tip};
use crate::ring_roundness::model::turning::plane::{Vec2, direction};
use crate::ring_roundness::model::turning::{Motion, Oscillation, Setting, moved_across};

const MM_PER_UM: f64 = 1e-3;

/// A job as the kernel takes it.
#[derive(Debug, Clone)]
pub(crate) struct Scene {
    /// The machine; mirrored where the ring turns clockwise.
    pub setting: Setting,
    pub mirrored: bool,
    pub softness: Softness,
    /// Waves that effects add to the blank: order, amplitude (mm), phase.
    waves: Vec<(f64, f64, f64)>,
}

impl Scene {
    pub(crate) fn of(job: &Job, effects: &[Effect]) -> Self {
        let half = 0.5 * job.supports.distance_mm;
        let mut setting = Setting {
            support_a_mm: [-half, -job.supports.depth_mm],
            support_b_mm: [half, -job.supports.depth_mm],
            roller_radius_mm: job.supports.roller_radius_mm,
            tip_start_mm: [job.tool.x_mm, job.tool.y_mm],
            feed_direction: feed_direction(job.tool.feed_direction_deg),
            feed_mm_per_rev: job.tool.feed_mm_per_rev,
            revolutions: job.tool.revolutions,
            spark_out_revolutions: job.tool.spark_out_revolutions,
            compliance_ratio: 0.0,
            wheel_radius_mm: job.tool.wheel_radius_mm,
            motion: Motion::default(),
        };
        let mut waves = Vec::new();
        let mut push_off = 0.0;
        for effect in effects {
            match *effect {
                Effect::InitialHarmonic { order, amplitude_mm, phase_rad } => {
                    waves.push((f64::from(order), amplitude_mm, phase_rad));
                }
                Effect::ToolOffLine { tangential_offset_mm } => {
                    setting.tip_start_mm = moved_across(setting.tip_start_mm, tangential_offset_mm);
                }
                Effect::SupportPosition { support_b_shift_mm } => setting.support_b_mm[0] += support_b_shift_mm,
                Effect::SupportWear { recession_um_per_rev } => {
                    setting.motion.wear_mm_per_rev += recession_um_per_rev * MM_PER_UM;
                }
                Effect::RollerRunout { amplitude_mm, ratio, phase_rad } => {
                    setting.motion.runout_a.push(Oscillation { amplitude_mm, ratio, phase_rad });
                }
                Effect::ToolPushOff { push_off_ratio } => push_off += push_off_ratio,
                Effect::SparkOutMissing { spark_out_revolutions } => {
                    setting.spark_out_revolutions = spark_out_revolutions;
                }
                Effect::ChatterHarmonic { amplitude_mm, waves_per_revolution } => setting
                    .motion
                    .chatter
                    .push(Oscillation { amplitude_mm, ratio: f64::from(waves_per_revolution), phase_rad: 0.0 }),
                Effect::WorkSlip { slip_deg_per_rev } => setting.motion.slip += slip_deg_per_rev / 360.0,
            }
        }
        let softness = Softness::of(&cut_force::resolved(job), push_off);
        let mirrored = job.rotation == Rotation::Clockwise;
        let (mut setting, softness) =
            if mirrored { (mirror(&setting), softness.mirrored()) } else { (setting, softness) };
        // Where the ring cannot rest there is nothing to cut.
        setting.compliance_ratio = through_tip(&setting, setting.tip_end_mm())
            .map_or(job.compliance_ratio + push_off, |stance| softness.ratio(&stance.copying()));
        Self { setting, mirrored, softness, waves }
    }

    /// The characteristic equation of the waves at a place of tool and supports.
    pub(crate) fn lobing(&self, copying: Copying) -> Lobing {
        self.softness.lobing(copying)
    }

    /// Radii of the blank at `n` uniform body angles, mm; in the mirror where the setting is.
    pub(crate) fn blank_mm(&self, job: &Job, n: usize) -> Result<Vec<f64>, RoundnessError> {
        let mut radii = match (&job.measured_profile, &job.ring) {
            (Some(measured), _) => {
                let (angles, radii) =
                    measured.rows().iter().map(|row| (row.angle_deg.to_radians(), row.radius_mm)).unzip();
                PeriodicSpline::new(angles, radii)?.uniform(n)
            }
            (None, Some(ring)) => form_mm(ring, n),
            (None, None) => return Err(RoundnessError::TooFewPoints { count: 0, needed: 3 }),
        };
        for &(order, amplitude, phase) in &self.waves {
            for (i, radius) in radii.iter_mut().enumerate() {
                *radius += amplitude * (order * angle_of(i, n) + phase).cos();
            }
        }
        Ok(if self.mirrored { mirrored_profile(&radii) } else { radii })
    }

    /// A profile of the kernel in the body frame of the job.
    pub(crate) fn unmirrored(&self, radii: Vec<f64>) -> Vec<f64> {
        if self.mirrored { mirrored_profile(&radii) } else { radii }
    }

    /// The end position, where it exists.
    pub(crate) fn end(&self) -> Option<Stance> {
        through_tip(&self.setting, self.setting.tip_end_mm())
    }
}

fn angle_of(i: usize, n: usize) -> f64 {
    TAU * i as f64 / n as f64
}

/// Whole quarters exactly: the tool must not drift sideways by the rounding of a cosine.
fn feed_direction(deg: f64) -> Vec2 {
    let quarter = deg.rem_euclid(360.0) / 90.0;
    if (quarter - quarter.round()).abs() < 1e-12 {
        [[1.0, 0.0], [0.0, 1.0], [-1.0, 0.0], [0.0, -1.0]][whole(quarter.round()) % 4]
    } else {
        direction(deg.to_radians())
    }
}

#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "a quarter, 0 to 4")]
fn whole(quarter: f64) -> usize {
    quarter as usize
}

/// A form by its definition (`ring/1.1`): the ellipse exactly, waves added to the radius.
pub(in crate::ring_roundness) fn form_mm(ring: &Ring, n: usize) -> Vec<f64> {
    let (long, short) = (ring.radius_mm + 0.5 * ring.ellipticity_mm, ring.radius_mm - 0.5 * ring.ellipticity_mm);
    let axis = ring.major_axis_deg.to_radians();
    (0..n)
        .map(|i| {
            let theta = angle_of(i, n);
            let (sin, cos) = (theta - axis).sin_cos();
            let ellipse = long * short / ((short * cos).powi(2) + (long * sin).powi(2)).sqrt();
            ring.harmonics.iter().fold(ellipse, |radius, wave| {
                let from_max = theta - wave.angle_of_max_deg.to_radians();
                radius + wave.amplitude_um * MM_PER_UM * (f64::from(wave.order) * from_max).cos()
            })
        })
        .collect()
}

/// Seen in the mirror x -> -x: the body angle θ becomes π - θ.
fn mirrored_profile(radii: &[f64]) -> Vec<f64> {
    let n = radii.len();
    (0..n).map(|i| radii[(n / 2 + n - i) % n]).collect()
}

fn mirror(setting: &Setting) -> Setting {
    let flip = |p: Vec2| [-p[0], p[1]];
    let (a, b) = (flip(setting.support_b_mm), flip(setting.support_a_mm));
    let mut motion = setting.motion.clone();
    std::mem::swap(&mut motion.runout_a, &mut motion.runout_b);
    Setting {
        support_a_mm: a,
        support_b_mm: b,
        tip_start_mm: flip(setting.tip_start_mm),
        feed_direction: flip(setting.feed_direction),
        motion,
        ..setting.clone()
    }
}

/// An angle seen in the mirror.
pub(in crate::ring_roundness) fn mirrored_rad(angle_rad: f64, mirrored: bool) -> f64 {
    if mirrored { (PI - angle_rad).rem_euclid(TAU) } else { angle_rad }
}
