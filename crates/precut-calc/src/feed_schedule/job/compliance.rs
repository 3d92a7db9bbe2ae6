//! Radial compliance along the shaft and its largest value in every zone (`feed/3.1`).

use crate::calculator::Failure;
use crate::num::beam::{self, Beam, Wanted};
use crate::shaft::elastic;
use crate::shaft::{FeedDirection, Section, Shaft, Support};

use crate::feed_schedule::job::input::Job;

const UM_PER_MM: f64 = 1e3;
/// Points per stretch between breaks of the compliance, ends included: its polynomial of degree six at most has no two
/// maxima nearer to each other than these.
const SAMPLES: usize = 9;
/// Rounds of finer points about a maximum, each four times as fine. After three a bracket of a quarter stretch has points
/// 1/2048 of the stretch apart; the parabola through three of them misses the place by about a millionth of the stretch
/// and the value, flat there, by the square of it: 1e-12 of the curvature's share, far below 1e-9.
const ROUNDS: usize = 3;
/// How far beside an end, as a share of the stretch, the compliance is looked at: a maximum nearer than this rises above
/// the end by no more than the square of it.
const BESIDE: f64 = 1e-6;

/// How far from a jump its sides are looked at, mm: over it the compliance of a shaft changes by some 1e-11 of itself.
const SIDE_MM: f64 = 1e-9;

/// The held shaft and what yields beside it.
pub(in crate::feed_schedule) struct Held {
    beam: Beam,
    carriage_um_per_n: f64,
    /// Steps and supports, where the compliance is not smooth, for the tool and for a rest that follows it.
    breaks_mm: Vec<f64>,
}

impl Held {
    /// The held shaft of a checked and filled job that has one.
    pub(in crate::feed_schedule) fn of(job: &Job) -> Result<Option<Self>, Failure> {
        let Some(shaft) = &job.shaft else { return Ok(None) };
        let beam = beam(shaft, &job.supports, job.feed_direction)?;
        let mut breaks_mm = shaft.ends_mm();
        breaks_mm.extend(job.supports.iter().filter_map(Support::station_mm));
        let follow = job.supports.iter().filter_map(|support| match support {
            Support::FollowRest { offset_mm, .. } => Some(*offset_mm),
            _ => None,
        });
        let of_follow: Vec<f64> =
            follow.flat_map(|offset_mm| breaks_of_follow_rest(&breaks_mm, shaft.length_mm(), offset_mm)).collect();
        breaks_mm.extend(of_follow);
        breaks_mm.sort_by(f64::total_cmp);
        Ok(Some(Self { beam, carriage_um_per_n: job.carriage.compliance_um_per_n, breaks_mm }))
    }

    /// Steps and supports, where the compliance is not smooth, ascending, mm.
    pub(in crate::feed_schedule) fn breaks_mm(&self) -> impl Iterator<Item = f64> + '_ {
        self.breaks_mm.iter().copied()
    }

    /// Compliance at ascending stations, um/N.
    pub(in crate::feed_schedule) fn at(&self, z_mm: &[f64]) -> Vec<f64> {
        let profile = self.beam.profile(z_mm, Wanted { tangential: false, couple: false, weight: false });
        profile.radial_mm_per_n.iter().map(|w| w * UM_PER_MM + self.carriage_um_per_n).collect()
    }

    /// Largest compliance in every closed stretch, um/N, exact to 1e-9 relative.
    pub(in crate::feed_schedule) fn largest(&self, stretches: &[(f64, f64)]) -> Vec<f64> {
        stretches.iter().map(|&(from, to)| self.largest_in(from, to)).collect()
    }

    fn largest_in(&self, from: f64, to: f64) -> f64 {
        let inside = self.breaks_mm.iter().copied().filter(|z| *z > from && *z < to);
        let ends: Vec<f64> = std::iter::once(from).chain(inside).chain(std::iter::once(to)).collect();
        let z: Vec<f64> = ends.windows(2).flat_map(|pair| between(pair[0], pair[1])).collect();
        let c = self.at(&z);
        let smooth = z.chunks(SAMPLES).zip(c.chunks(SAMPLES));
        smooth.map(|(z, c)| self.largest_smooth(z, c)).fold(f64::NEG_INFINITY, f64::max)
    }

    /// Largest compliance in a stretch without breaks, from points over it: every one that is not below its neighbours
    /// may have a maximum beside it, and the highest point need not be beside the highest maximum.
    fn largest_smooth(&self, z: &[f64], c: &[f64]) -> f64 {
        let last = z.len() - 1;
        let peaks = (0..=last).filter(|&k| (k == 0 || c[k] >= c[k - 1]) && (k == last || c[k] >= c[k + 1]));
        peaks
            .filter(|&k| (k > 0 && k < last) || self.rises_inward(z, c, k))
            .map(|k| self.peak(z[k.saturating_sub(1)], z[(k + 1).min(last)]))
            .chain(c.iter().copied())
            .fold(f64::NEG_INFINITY, f64::max)
    }

    /// Whether the compliance grows from an end of a stretch into it; where it falls the end is a maximum by itself.
    fn rises_inward(&self, z: &[f64], c: &[f64], end: usize) -> bool {
        let length = z[z.len() - 1] - z[0];
        let beside = if end == 0 { z[0] + BESIDE * length } else { z[end] - BESIDE * length };
        self.at(&[beside])[0] > c[end]
    }

    /// The maximum between two places that hold one between them.
    fn peak(&self, mut from: f64, mut to: f64) -> f64 {
        let mut largest = f64::NEG_INFINITY;
        let mut three = None;
        for _ in 0..ROUNDS {
            let z = between(from, to);
            let c = self.at(&z);
            let best = (1..c.len()).fold(0, |best, k| if c[k] > c[best] { k } else { best });
            largest = largest.max(c[best]);
            let (left, right) = (best.saturating_sub(1), (best + 1).min(z.len() - 1));
            three = (left < best && best < right).then(|| [left, best, right].map(|k| (z[k], c[k])));
            (from, to) = (z[left], z[right]);
        }
        match three.as_ref().and_then(vertex) {
            Some(z) => largest.max(self.at(&[z])[0]),
            None => largest,
        }
    }
}

/// Stations of the tool where a rest that travels with it comes to a break, or leaves the shaft: there it lets go, and
/// the compliance jumps, so that both sides are looked at.
fn breaks_of_follow_rest(breaks_mm: &[f64], length_mm: f64, offset_mm: f64) -> Vec<f64> {
    let met = breaks_mm.iter().map(|z| z - offset_mm);
    let left = [0.0, length_mm].into_iter().flat_map(|end| [-SIDE_MM, SIDE_MM].map(|side| end - offset_mm + side));
    met.chain(left).collect()
}

/// Places evenly from one to another, both included.
fn between(from: f64, to: f64) -> Vec<f64> {
    let step = (to - from) / (SAMPLES - 1) as f64;
    (0..SAMPLES).map(|k| if k + 1 == SAMPLES { to } else { from + step * k as f64 }).collect()
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
    let section = |diameter: f64, bore: f64| elastic::section(shaft, shaft.theory(), 1.0, diameter, bore, 0.0);
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
    let state = match (shaft.section(), direction) {
        (Section::Finished, _) => beam::State::Finished,
        (Section::Stock, _) => beam::State::Stock,
        (Section::Mixed, FeedDirection::ToHeadstock) => beam::State::Mixed { stock_side: beam::Side::Left },
        (Section::Mixed, FeedDirection::ToTailstock) => beam::State::Mixed { stock_side: beam::Side::Right },
    };
    Beam::new(&segments, &supports, state)
        .map_err(|error| Failure::Internal(format!("a checked job gave no beam: {error}")))
}
