//! A finished program driven over the work as it yields: what it leaves, how near its rapid motion comes, how long it takes.

use std::f64::consts::PI;

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::calculator::{Block, Failure, Finding};

use super::write::Written;
use super::{Surface, Yielding};

const UM_PER_MM: f64 = 1e3;
/// Less than this is no chip, mm.
const CHIP_MM: f64 = 1e-9;
/// Halvings of the search for a distance: a nanometre of a metre.
const HALVINGS: u32 = 40;
/// Rounding of distances, mm.
const ROUNDING_MM: f64 = 1e-6;

/// What the program was seen to do, driven over the blank with yielding work, pass by pass on what the last one left.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct Proof {
    /// Largest diameter error that the program leaves, and where.
    pub largest: ProofPlace,
    /// Smallest diameter error that the program leaves, and where: negative is undersize.
    pub smallest: ProofPlace,
    /// Largest minus smallest diameter error.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub form_error_um: f64,
    /// Largest difference between what the program leaves and what the answer predicts, on the diameter; null where the
    /// answer predicts no surface of its own.
    #[serde(skip_serializing_if = "Option::is_none")]
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub beside_prediction_um: Option<f64>,
    /// Smallest distance of a rapid motion from what stands of the work at that moment; null where there is none.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub rapid_clearance_mm: Option<f64>,
    /// Time at the feed: in the cut and in the air.
    #[schema(extensions(("x-unit" = json!("min"))))]
    pub feed_time_min: f64,
    /// Part of it that the tool feeds in the air: approaches and exits.
    #[schema(extensions(("x-unit" = json!("min"))))]
    pub air_time_min: f64,
    /// Cuts, each with its approach.
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub approaches: u32,
    /// Stops of the program (M0).
    #[schema(extensions(("x-unit" = json!("1"))))]
    pub stops: u32,
}

/// A diameter error and where it was found.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
pub struct ProofPlace {
    /// Station from the headstock end.
    #[schema(extensions(("x-unit" = json!("mm"))))]
    pub z_mm: f64,
    /// Diameter error, positive = oversize.
    #[schema(extensions(("x-unit" = json!("um"))))]
    pub diameter_error_um: f64,
}

/// A move at the feed: station and diameter at both ends.
#[derive(Debug, Clone, Copy)]
pub(super) struct Cutting {
    pub from: (f64, f64),
    pub to: (f64, f64),
    pub cut: usize,
    pub slack_mm: f64,
}

impl Cutting {
    /// Turns the surface; comes back with the share of the way that a chip was cut on. `passed_last` is the point that the
    /// tool passed last on its way: where two moves meet it passes a point once, not twice.
    pub(super) fn turn(&self, surface: &mut Surface, work: &mut dyn Yielding, passed_last: &mut Option<usize>) -> f64 {
        let ((z0, x0), (z1, x1)) = (self.from, self.to);
        let along = z1 - z0;
        if along.abs() <= self.slack_mm {
            // What follows is another way, which may turn back.
            *passed_last = None;
            return self.plunged(surface);
        }
        let passed: Vec<usize> =
            surface.passed(z0, z1, self.slack_mm).filter(|point| Some(*point) != *passed_last).collect();
        *passed_last = if along > 0.0 { passed.last() } else { passed.first() }.copied().or(*passed_last);
        let (mut cut_mm, mut before): (f64, Option<(f64, bool)>) = (0.0, None);
        for k in passed {
            let point = surface.points()[k];
            let share = ((point.z_mm - z0) / along).clamp(0.0, 1.0);
            let command_mm = 0.5 * (x0 + share * (x1 - x0));
            let left = match point.station {
                // Nothing is asked where the tool does not come near: work may stand toward it, but not by its radius.
                Some(station) => work.left_mm(self.cut, station, point.radius_mm, command_mm),
                None => point.radius_mm.min(command_mm),
            };
            let is_cut = left < point.radius_mm - CHIP_MM;
            if let Some((z, was_cut)) = before
                && (is_cut || was_cut)
            {
                cut_mm += (point.z_mm - z).abs();
            }
            before = Some((point.z_mm, is_cut));
            surface.set(k, left.min(point.radius_mm));
        }
        (cut_mm / along.abs()).min(1.0)
    }

    /// Share of a radial move that goes below what stands there.
    fn plunged(&self, surface: &Surface) -> f64 {
        let (low, high) = (self.from.1.min(self.to.1), self.from.1.max(self.to.1));
        let stands = 2.0 * surface.at_mm(self.to.0);
        if self.to.1 >= self.from.1 || high - low <= 0.0 {
            0.0
        } else {
            ((stands - low) / (high - low)).clamp(0.0, 1.0)
        }
    }
}

/// What a drive found.
pub(crate) struct Driven {
    pub surface: Surface,
    pub rapid_clearance_mm: Option<f64>,
    pub feed_time_min: f64,
    pub air_time_min: f64,
    pub approaches: u32,
    pub stops: u32,
}

/// Drives a program over a blank; `zero_mm` is the station of its zero.
pub(crate) fn drive(written: &Written, blank: &Surface, zero_mm: f64, work: &mut dyn Yielding) -> Driven {
    let mut driver = Driver {
        driven: Driven {
            surface: blank.clone(),
            rapid_clearance_mm: None,
            feed_time_min: 0.0,
            air_time_min: 0.0,
            approaches: 0,
            stops: 0,
        },
        at: (None, None),
        feed_mm_per_rev: 0.0,
        rpm: Rpm::Constant(0.0),
        zero_mm,
        slack_mm: 1.01 * written.program.increment_mm,
        cutting: false,
        passed_last: None,
    };
    for (block, &cut) in written.program.blocks.iter().zip(&written.cuts) {
        driver.block(block, cut, work);
    }
    driver.driven
}

enum Rpm {
    Constant(f64),
    /// m/min, at most rev/min.
    Surface(f64, f64),
}

struct Driver {
    driven: Driven,
    /// Station and diameter; unknown at first.
    at: (Option<f64>, Option<f64>),
    feed_mm_per_rev: f64,
    rpm: Rpm,
    zero_mm: f64,
    slack_mm: f64,
    cutting: bool,
    /// Point of the surface that the tool passed last since it came to the work.
    passed_last: Option<usize>,
}

impl Driver {
    fn block(&mut self, block: &Block, cut: usize, work: &mut dyn Yielding) {
        match *block {
            Block::SpindleSpeed { rpm } => self.rpm = Rpm::Constant(rpm),
            Block::SurfaceSpeed { speed_m_per_min, limit_rpm } => self.rpm = Rpm::Surface(speed_m_per_min, limit_rpm),
            Block::Rapid { x_diameter_mm, z_mm } => self.rapid(x_diameter_mm, z_mm),
            Block::Cut { x_diameter_mm, z_mm, feed_mm_per_rev } => {
                self.feed_mm_per_rev = feed_mm_per_rev.unwrap_or(self.feed_mm_per_rev);
                self.cut((z_mm + self.zero_mm, x_diameter_mm), cut, work);
            }
            Block::Stop { .. } => self.driven.stops += 1,
            Block::Modes | Block::Note(_) | Block::Tool { .. } | Block::Coolant { .. } | Block::End(_) => {}
        }
    }

    fn cut(&mut self, to: (f64, f64), cut: usize, work: &mut dyn Yielding) {
        if !self.cutting {
            self.driven.approaches += 1;
        }
        self.cutting = true;
        if let (Some(z), Some(x)) = self.at {
            let from = (z, x);
            let cutting = Cutting { from, to, cut, slack_mm: self.slack_mm };
            let share = cutting.turn(&mut self.driven.surface, work, &mut self.passed_last);
            let time = self.time_min(from, to);
            self.driven.feed_time_min += time;
            self.driven.air_time_min += (1.0 - share) * time;
        }
        self.at = (Some(to.0), Some(to.1));
    }

    /// Time of a straight move at the feed per revolution, min.
    fn time_min(&self, from: (f64, f64), to: (f64, f64)) -> f64 {
        let length = (to.0 - from.0).hypot(0.5 * (to.1 - from.1));
        let revolutions = length / self.feed_mm_per_rev;
        match self.rpm {
            Rpm::Constant(rpm) => revolutions / rpm,
            Rpm::Surface(speed, limit_rpm) => {
                // Below this diameter the limit holds.
                let least = 1000.0 * speed / (PI * limit_rpm);
                revolutions * PI * mean_at_least(from.1, to.1, least) / (1000.0 * speed)
            }
        }
    }

    fn rapid(&mut self, x_diameter_mm: Option<f64>, z_mm: Option<f64>) {
        self.cutting = false;
        self.passed_last = None;
        let from = self.at;
        self.at = (z_mm.map(|z| z + self.zero_mm).or(from.0), x_diameter_mm.or(from.1));
        let (Some(z1), Some(x1)) = self.at else { return };
        let (z0, x0) = (from.0.unwrap_or(z1), from.1.unwrap_or(x1));
        let least = self.driven.rapid_clearance_mm;
        // A program of many approaches alike is not measured to the nanometre at each of them.
        if let Some(clearance) = clearance_mm(&self.driven.surface, [z0, z1], 0.5 * x0.min(x1), least) {
            self.driven.rapid_clearance_mm = Some(least.map_or(clearance, |least| least.min(clearance)));
        }
    }
}

/// Mean of the larger of a linear course and a constant.
fn mean_at_least(a: f64, b: f64, least: f64) -> f64 {
    let (low, high) = (a.min(b), a.max(b));
    if low >= least || high - low <= 0.0 {
        return f64::midpoint(low, high).max(least);
    }
    if high <= least {
        return least;
    }
    let below = (least - low) / (high - low);
    below * least + (1.0 - below) * f64::midpoint(least, high)
}

/// Distance of a motion over a stretch from the surface, the larger of its two components, mm: none where the surface is
/// farther than the radius of the motion, or than what was found elsewhere; negative never, 0 at and in the work.
fn clearance_mm(surface: &Surface, [z0, z1]: [f64; 2], radius_mm: f64, elsewhere: Option<f64>) -> Option<f64> {
    let (low, high) = (z0.min(z1), z0.max(z1));
    let touches = |d: f64| surface.highest_mm(low - d, high + d) + d >= radius_mm;
    if elsewhere.is_some_and(|least| least < radius_mm && !touches(least)) {
        return None;
    }
    let widest = surface.widest_mm();
    let (mut free, mut met) = (0.0, radius_mm.max(0.0));
    if surface.highest_mm(low - met, high + met) <= 0.0 {
        return None;
    }
    if touches(1e-12) || surface.at_mm(low).max(surface.at_mm(high)) >= radius_mm {
        return Some(0.0);
    }
    free = f64::max(free, radius_mm - widest);
    for _ in 0..HALVINGS {
        let middle = f64::midpoint(free, met);
        if touches(middle) {
            met = middle;
        } else {
            free = middle;
        }
    }
    Some(free)
}

/// What a program is held against.
pub(crate) struct Limits {
    /// Least distance of rapid motion.
    pub clearance_mm: f64,
    /// Largest difference from the prediction on the diameter, um.
    pub beside_prediction_um: f64,
}

impl Driven {
    /// The proof, of the points that carry a station: `wanted` is the drawing's radius there, `predicted` what the answer
    /// says is left.
    pub(crate) fn proof(
        &self,
        wanted: impl Fn(usize) -> f64,
        predicted: impl Fn(usize) -> Option<f64>,
    ) -> Option<Proof> {
        let mut found: Option<(ProofPlace, ProofPlace)> = None;
        let mut beside: Option<f64> = None;
        for point in self.surface.points() {
            let Some(station) = point.station else { continue };
            let diameter_error_um = 2.0 * (point.radius_mm - wanted(station)) * UM_PER_MM;
            let here = ProofPlace { z_mm: point.z_mm, diameter_error_um };
            let (largest, smallest) = found.get_or_insert((here, here));
            if diameter_error_um > largest.diameter_error_um {
                *largest = here;
            }
            if diameter_error_um < smallest.diameter_error_um {
                *smallest = here;
            }
            if let Some(predicted) = predicted(station) {
                let off = 2.0 * (point.radius_mm - predicted).abs() * UM_PER_MM;
                beside = Some(beside.map_or(off, |most| most.max(off)));
            }
        }
        let (largest, smallest) = found?;
        Some(Proof {
            largest,
            smallest,
            form_error_um: largest.diameter_error_um - smallest.diameter_error_um,
            beside_prediction_um: beside,
            rapid_clearance_mm: self.rapid_clearance_mm,
            feed_time_min: self.feed_time_min,
            air_time_min: self.air_time_min,
            approaches: self.approaches,
            stops: self.stops,
        })
    }
}

impl Proof {
    /// Codes of the refusals.
    pub(crate) const CODES: &'static [&'static str] = &["program_off_prediction", "program_rapid_close"];

    /// Larger magnitude of the two ends, signed, um.
    pub(crate) fn farthest_um(&self) -> f64 {
        let (high, low) = (self.largest.diameter_error_um, self.smallest.diameter_error_um);
        if high.abs() >= low.abs() { high } else { low }
    }

    /// Refuses a program that does not do what the answer says.
    pub(crate) fn holds(&self, limits: &Limits) -> Result<(), Failure> {
        let fault = |code, value: f64, limit: f64, unit| {
            Err(Failure::OutOfModel(Finding::new(code, "/program").measured(value, limit, unit)))
        };
        if let Some(off) = self.beside_prediction_um.filter(|off| *off > limits.beside_prediction_um) {
            return fault("program_off_prediction", off, limits.beside_prediction_um, "um");
        }
        match self.rapid_clearance_mm {
            Some(clearance) if clearance < limits.clearance_mm - ROUNDING_MM => {
                fault("program_rapid_close", clearance, limits.clearance_mm, "mm")
            }
            _ => Ok(()),
        }
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used, clippy::float_cmp)]
mod tests {
    use super::super::{Point, Rigid};
    use super::*;
    use crate::calculator::{Dialect, Program};

    fn bar() -> Surface {
        let point = |z_mm, radius_mm, station| Point { z_mm, radius_mm, station: Some(station) };
        Surface::new(vec![point(0.0, 21.0, 0), point(50.0, 21.0, 1), point(100.0, 21.0, 2)])
    }

    fn program(blocks: Vec<Block>) -> Written {
        let cuts = vec![0; blocks.len()];
        Written { program: Program { dialect: Dialect::Fanuc, increment_mm: 0.001, blocks }, cuts, plunges: Vec::new() }
    }

    fn rapid(x: Option<f64>, z: Option<f64>) -> Block {
        Block::Rapid { x_diameter_mm: x, z_mm: z }
    }

    fn cut(x_diameter_mm: f64, z_mm: f64) -> Block {
        Block::Cut { x_diameter_mm, z_mm, feed_mm_per_rev: Some(0.2) }
    }

    #[test]
    fn a_drive_finds_what_is_left_the_air_and_the_nearest_rapid() {
        let blocks = vec![
            Block::SpindleSpeed { rpm: 500.0 },
            rapid(Some(47.0), Some(2.0)),
            rapid(Some(40.0), None),
            cut(40.0, -100.0),
            cut(45.0, -100.0),
            rapid(Some(47.0), None),
        ];
        let driven = drive(&program(blocks), &bar(), 100.0, &mut Rigid);
        let proof = driven.proof(|_| 20.0, |_| Some(20.0)).unwrap();
        assert_eq!((proof.form_error_um, proof.beside_prediction_um), (0.0, Some(0.0)));
        // 2 mm before the face, and 2.5 mm above it on the way out.
        assert!((proof.rapid_clearance_mm.unwrap() - 2.0).abs() < 1e-6, "{proof:?}");
        assert!((proof.feed_time_min - (102.0 + 2.5) / 100.0).abs() < 1e-12);
        assert!((proof.air_time_min - (2.0 + 2.5) / 100.0).abs() < 1e-12);
        let limits = |clearance_mm, beside_prediction_um| Limits { clearance_mm, beside_prediction_um };
        assert!(proof.holds(&limits(2.0, 0.0)).is_ok() && proof.holds(&limits(2.1, 0.0)).is_err());
    }

    #[test]
    fn a_program_that_gouges_or_comes_near_is_refused() {
        let gouge = vec![rapid(Some(47.0), Some(2.0)), rapid(Some(39.9), None), cut(39.9, -100.0)];
        let proof = drive(&program(gouge), &bar(), 100.0, &mut Rigid).proof(|_| 20.0, |_| Some(20.0)).unwrap();
        assert!((proof.smallest.diameter_error_um + 100.0).abs() < 1e-9);
        let code = |failure| match failure {
            Err(Failure::OutOfModel(finding)) => finding.code,
            other => unreachable!("{other:?}"),
        };
        let limits = Limits { clearance_mm: 1.0, beside_prediction_um: 1.0 };
        assert_eq!(code(proof.holds(&limits)), "program_off_prediction");
        let near =
            vec![rapid(Some(47.0), Some(2.0)), rapid(Some(40.0), None), rapid(None, Some(0.5)), cut(40.0, -100.0)];
        let proof = drive(&program(near), &bar(), 100.0, &mut Rigid).proof(|_| 20.0, |_| Some(20.0)).unwrap();
        assert_eq!(code(proof.holds(&limits)), "program_rapid_close");
        let through = vec![rapid(Some(47.0), Some(2.0)), rapid(Some(40.0), None), rapid(None, Some(-50.0))];
        let driven = drive(&program(through), &bar(), 100.0, &mut Rigid);
        assert_eq!(driven.rapid_clearance_mm, Some(0.0));
    }

    #[test]
    fn the_limit_of_the_spindle_counts_in_the_time() {
        assert_eq!([mean_at_least(10.0, 20.0, 5.0), mean_at_least(20.0, 10.0, 30.0)], [15.0, 30.0]);
        assert_eq!(mean_at_least(0.0, 20.0, 10.0), 12.5);
    }
}
