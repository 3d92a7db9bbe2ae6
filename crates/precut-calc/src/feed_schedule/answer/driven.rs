//! The work of a schedule as it yields, for driving its program.

use crate::calculator::Failure;
use crate::deflection_compensation::{Opening, engage};
use crate::turning::{Point, Surface, Yielding};

use crate::feed_schedule::answer::toolpath::Pass;
use crate::feed_schedule::answer::words::{Spoken, Words, is_surface};
use crate::feed_schedule::job::blank::{Blank, Turned};
use crate::feed_schedule::job::compliance::Held;
use crate::feed_schedule::job::input::Job;
use crate::feed_schedule::job::models::Output;

/// Points along every stretch of the blank between its edges, the corners of the path and the breaks of the compliance,
/// ends included. An extreme lies at most a 64th of a stretch beside a point: of a parabola over all of it a thousandth is
/// not seen.
const POINTS: u32 = 33;
const MM_PER_UM: f64 = 1e-3;
/// Places nearer than this are one, mm.
const APART_MM: f64 = 1e-6;

/// Passive force of a cut over its depth.
struct Force {
    at_depth_n: f64,
    depth_mm: f64,
    exponent: f64,
}

impl Force {
    fn at(&self, depth_mm: f64) -> (f64, f64) {
        let force = self.at_depth_n * (depth_mm / self.depth_mm).powf(self.exponent);
        (force, if depth_mm > 0.0 { force * self.exponent / depth_mm } else { 0.0 })
    }
}

/// The shaft and its cuts.
pub(in crate::feed_schedule) struct Work {
    forces: Vec<Option<Force>>,
    /// By station; of every zone where the job states it, else of the beam.
    compliance_mm_per_n: Vec<f64>,
    wanted_mm: Vec<f64>,
}

impl Work {
    /// The work of passes with their words, and the blank as a surface of its stations.
    pub(in crate::feed_schedule) fn of(
        job: &Job,
        said: &Spoken,
        passes: &[Pass],
        words: &[Words],
        blank: &Blank,
    ) -> Result<(Self, Surface), Failure> {
        let held = Held::of(job)?;
        let mut points: Vec<Point> = Vec::new();
        let mut work = Self { forces: Vec::new(), compliance_mm_per_n: Vec::new(), wanted_mm: Vec::new() };
        let mut stations_mm: Vec<f64> = Vec::new();
        let mut stated: Vec<Option<f64>> = Vec::new();
        for (ends, diameter_mm) in blank.stretches() {
            let middle = f64::midpoint(ends[0], ends[1]);
            let over = passes.iter().filter(|pass| lies_in(middle, &pass.turned));
            let last = over.min_by(|a, b| a.turned.diameter_mm.total_cmp(&b.turned.diameter_mm));
            for z_mm in places(ends, held.as_ref()) {
                let station = last.map(|pass| {
                    let zone = &said.case.zones[pass.zone];
                    stations_mm.push(z_mm);
                    stated.push(if zone.compliance_is_of_beam { None } else { zone.compliance_um_per_n });
                    work.wanted_mm.push(0.5 * pass.turned.diameter_mm);
                    stations_mm.len() - 1
                });
                points.push(Point { z_mm, radius_mm: 0.5 * diameter_mm, station });
            }
        }
        let of_beam = held.as_ref().map(|held| held.at(&stations_mm));
        let of_beam = |i: usize| of_beam.as_ref().map_or(0.0, |of_beam| of_beam[i]);
        work.compliance_mm_per_n =
            stated.iter().enumerate().map(|(i, stated)| stated.unwrap_or_else(|| of_beam(i)) * MM_PER_UM).collect();
        work.forces = passes.iter().zip(words).map(|(pass, words)| force(job, said, pass, *words)).collect();
        Ok((work, Surface::new(points)))
    }

    /// Radius that the zones ask for at a station, mm.
    pub(in crate::feed_schedule) fn wanted_mm(&self, station: usize) -> f64 {
        self.wanted_mm[station]
    }
}

fn force(job: &Job, said: &Spoken, pass: &Pass, words: Words) -> Option<Force> {
    let zone = &said.case.zones[pass.zone];
    let turning = std::f64::consts::PI * pass.turned.diameter_mm / 1000.0;
    let speed = if is_surface(job) { words.speed } else { words.speed * turning };
    let at_depth_n = zone.model(Output::ForceY)?.output(speed.ln(), words.feed_mm_per_rev.ln());
    Some(Force { at_depth_n, depth_mm: zone.depth_mm, exponent: zone.force_depth_exponent.max(0.0) })
}

fn lies_in(z_mm: f64, turned: &Turned) -> bool {
    turned.from_mm < z_mm && z_mm < turned.to_mm
}

/// Places along a stretch.
fn places([from, to]: [f64; 2], held: Option<&Held>) -> Vec<f64> {
    let breaks = held.iter().flat_map(|held| held.breaks_mm()).filter(|z| from + APART_MM < *z && *z < to - APART_MM);
    let ends: Vec<f64> = std::iter::once(from).chain(breaks).chain(std::iter::once(to)).collect();
    let last = f64::from(POINTS - 1);
    let mut places = vec![from];
    for pair in ends.windows(2).filter(|pair| pair[0] < pair[1]) {
        let between = (1..POINTS - 1).map(|k| pair[0] + (pair[1] - pair[0]) * (f64::from(k) / last));
        places.extend(between);
        places.push(pair[1]);
    }
    places
}

impl Yielding for Work {
    fn left_mm(&mut self, cut: usize, station: usize, stands_mm: f64, command_mm: f64) -> f64 {
        let compliance = self.compliance_mm_per_n[station];
        let Some(force) = self.forces[cut].as_ref().filter(|_| compliance > 0.0) else {
            return stands_mm.min(command_mm);
        };
        let opening = |depth_mm: f64| {
            let (force_n, slope) = force.at(depth_mm);
            Opening { y_mm: compliance * force_n, y_slope: compliance * slope, ..Opening::default() }
        };
        stands_mm - engage(stands_mm, command_mm, stands_mm - command_mm, opening(0.0), opening).depth_mm()
    }
}
