//! Radial compliance along the shaft and its largest value in every zone (`feed/3.1`).

use crate::calculator::Failure;
use crate::num::beam::{self, Beam, Wanted};
use crate::shaft::elastic;
use crate::shaft::{FeedDirection, Section, Shaft, Support};

use super::input::Job;

const UM_PER_MM: f64 = 1e3;
/// Points per stretch between breaks of the compliance, ends included.
const SAMPLES: usize = 9;
/// Rounds of refinement of a maximum; each shrinks the bracket eightfold, and the parabola through it is exact to the
/// fourth power of the bracket: (1/8)^(4·4) of the curvature's share is far below 1e-9.
const ROUNDS: usize = 4;

/// The held shaft and what yields beside it.
pub(super) struct Held {
    beam: Beam,
    carriage_um_per_n: f64,
    /// Steps and supports, where the compliance is not smooth.
    breaks_mm: Vec<f64>,
}

impl Held {
    /// The held shaft of a checked and filled job that has one.
    pub(super) fn of(job: &Job) -> Result<Option<Self>, Failure> {
        let Some(shaft) = &job.shaft else { return Ok(None) };
        let beam = beam(shaft, &job.supports, job.feed_direction)?;
        let mut breaks_mm = vec![0.0];
        let mut z = 0.0;
        for segment in &shaft.segments {
            z += segment.length_mm;
            breaks_mm.push(z);
        }
        breaks_mm.extend(job.supports.iter().filter_map(Support::station_mm));
        breaks_mm.sort_by(f64::total_cmp);
        Ok(Some(Self { beam, carriage_um_per_n: job.carriage.compliance_um_per_n, breaks_mm }))
    }

    /// Compliance at ascending stations, um/N.
    pub(super) fn at(&self, z_mm: &[f64]) -> Vec<f64> {
        let profile = self.beam.profile(z_mm, Wanted { tangential: false, couple: false, weight: false });
        profile.radial_mm_per_n.iter().map(|w| w * UM_PER_MM + self.carriage_um_per_n).collect()
    }

    /// Largest compliance in every closed stretch, um/N, exact to 1e-9 relative.
    pub(super) fn largest(&self, stretches: &[(f64, f64)]) -> Vec<f64> {
        stretches.iter().map(|&(from, to)| self.largest_in(from, to)).collect()
    }

    fn largest_in(&self, from: f64, to: f64) -> f64 {
        let inside = self.breaks_mm.iter().copied().filter(|z| *z > from && *z < to);
        let ends: Vec<f64> = std::iter::once(from).chain(inside).chain(std::iter::once(to)).collect();
        let mut z = Vec::with_capacity(SAMPLES * ends.len());
        for pair in ends.windows(2) {
            let step = (pair[1] - pair[0]) / (SAMPLES - 1) as f64;
            z.extend((0..SAMPLES).map(|k| if k + 1 == SAMPLES { pair[1] } else { pair[0] + step * k as f64 }));
        }
        let c = self.at(&z);
        let mut best = 0;
        for k in 1..c.len() {
            if c[k] > c[best] {
                best = k;
            }
        }
        let mut largest = c[best];
        // An end of a smooth stretch is a maximum by itself; inside one the parabola through three points leads on.
        let at_end = best.is_multiple_of(SAMPLES) || best % SAMPLES == SAMPLES - 1;
        if !at_end {
            let mut three = [(z[best - 1], c[best - 1]), (z[best], c[best]), (z[best + 1], c[best + 1])];
            for _ in 0..ROUNDS {
                let Some(vertex) = vertex(&three) else { break };
                let half = (three[2].0 - three[0].0) / 16.0;
                let (low, high) = ((vertex - half).max(three[0].0), (vertex + half).min(three[2].0));
                let stations = [low, vertex, high];
                let values = self.at(&stations);
                three = [(low, values[0]), (vertex, values[1]), (high, values[2])];
                largest = values.iter().copied().fold(largest, f64::max);
            }
        }
        largest
    }
}

/// Abscissa of the vertex of the parabola through three points, kept between the outer ones.
fn vertex(three: &[(f64, f64); 3]) -> Option<f64> {
    let [(a, fa), (b, fb), (c, fc)] = *three;
    let (left, right) = ((b - a) * (fb - fc), (b - c) * (fb - fa));
    let twice = left - right;
    if twice.abs() <= f64::EPSILON * (left.abs() + right.abs()) {
        return None;
    }
    let z = b - 0.5 * ((b - a) * left - (b - c) * right) / twice;
    (z > a && z < c).then_some(z)
}

fn beam(shaft: &Shaft, supports: &[Support], direction: FeedDirection) -> Result<Beam, Failure> {
    let section = |diameter: f64, bore: f64| elastic::section(shaft, shaft.theory, 1.0, diameter, bore, 0.0);
    let segments: Vec<beam::Segment> = shaft
        .segments
        .iter()
        .map(|segment| beam::Segment {
            length_mm: segment.length_mm,
            finished: section(segment.diameter_mm, segment.bore_diameter_mm),
            stock: section(segment.stock_mm(), segment.bore_diameter_mm),
        })
        .collect();
    let supports: Vec<beam::Support> = supports.iter().map(|support| elastic::support(support, 0.0, None)).collect();
    let state = match (shaft.section, direction) {
        (Section::Finished, _) => beam::State::Finished,
        (Section::Stock, _) => beam::State::Stock,
        (Section::Mixed, FeedDirection::ToHeadstock) => beam::State::Mixed { stock_side: beam::Side::Left },
        (Section::Mixed, FeedDirection::ToTailstock) => beam::State::Mixed { stock_side: beam::Side::Right },
    };
    Beam::new(&segments, &supports, state)
        .map_err(|error| Failure::Internal(format!("a checked job gave no beam: {error}")))
}
