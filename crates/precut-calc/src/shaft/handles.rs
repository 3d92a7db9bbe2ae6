//! What of a drawn shaft can be taken hold of: its shoulders, its diameters, its end, and what holds it.

use super::{Shaft, Support};
use crate::calculator::{Along, Handle, Item, Move};

/// Codes of what handles are called.
pub(crate) const LABEL_CODES: &[&str] =
    &["handle_shoulder", "handle_end", "handle_diameter", "handle_centre", "handle_chuck", "handle_rest"];

/// A segment keeps at least this share of its length, of its wall, and of what is to be turned off it.
const LEAST_SHARE: f64 = 0.1;
/// Two handles this share of the shaft apart can be told apart.
const APART: f64 = 0.12;
/// So many times its largest radius above the axis nothing of a shaft is drawn.
const ABOVE: f64 = 1.8;
/// A shaft that is not to be turned down may become so many times as thick, or as long.
const MOST_TIMES: f64 = 2.0;

/// Handles of a shaft that stands at `/shaft`, held by `/supports`.
pub(crate) fn handles(shaft: &Shaft, supports: &[Support]) -> Vec<Item> {
    let ends_mm = shaft.ends_mm();
    let diameters = (0..shaft.segments.len()).map(|i| diameter(shaft, supports, &ends_mm, i));
    let shoulders = (1..shaft.segments.len()).map(|i| shoulder(shaft, &ends_mm, i));
    let end = end(shaft, supports, &ends_mm);
    let of_part: Vec<Item> = diameters.chain(shoulders).chain(end).map(Item::Handle).collect();
    of_part.into_iter().chain(of_supports(shaft, supports)).collect()
}

/// Handles of what holds a shaft whose form follows from other fields of the job.
pub(crate) fn of_supports(shaft: &Shaft, supports: &[Support]) -> Vec<Item> {
    let ends_mm = shaft.ends_mm();
    let handles = supports.iter().enumerate().filter_map(|(i, of)| support(shaft, &ends_mm, i, of));
    handles.map(Item::Handle).collect()
}

fn of_segment(i: usize, field: &str, per_unit: f64) -> Move {
    Move { pointer: format!("/shaft/segments/{i}/{field}"), per_unit }
}

/// Radius of the drawing at a station; of a shoulder the larger one.
fn radius_mm(shaft: &Shaft, ends_mm: &[f64], z_mm: f64) -> f64 {
    let there = super::places::pieces_at(z_mm, ends_mm);
    shaft.segments.get(there).unwrap_or_default().iter().map(|segment| segment.diameter_mm / 2.0).fold(0.0, f64::max)
}

/// Above a segment, where no rest stands on it: between its bore and its blank.
fn diameter(shaft: &Shaft, supports: &[Support], ends_mm: &[f64], i: usize) -> Handle {
    let segment = &shaft.segments[i];
    let at = |share: f64| ends_mm[i] + share * segment.length_mm;
    let apart = APART * shaft.length_mm();
    let is_free = |z: &f64| supports.iter().filter_map(Support::station_mm).all(|other| (other - z).abs() > apart);
    let radius = segment.diameter_mm / 2.0;
    let stock = segment.stock_mm() / 2.0;
    let least = segment.bore_diameter_mm / 2.0 + LEAST_SHARE * (radius - segment.bore_diameter_mm / 2.0);
    Handle {
        name: "handle_diameter",
        x: [0.5, 0.3, 0.7].map(at).into_iter().find(is_free).unwrap_or_else(|| at(0.5)),
        y: radius,
        along: Along::Y,
        reach: [least, if stock > radius { stock - LEAST_SHARE * (stock - radius) } else { MOST_TIMES * radius }],
        stops: Vec::new(),
        moves: vec![of_segment(i, "diameter_mm", 2.0)],
    }
}

/// Between two segments: what one gains the other loses.
fn shoulder(shaft: &Shaft, ends_mm: &[f64], i: usize) -> Handle {
    let (before, after) = (shaft.segments[i - 1].length_mm, shaft.segments[i].length_mm);
    Handle {
        name: "handle_shoulder",
        x: ends_mm[i],
        y: -radius_mm(shaft, ends_mm, ends_mm[i]),
        along: Along::X,
        reach: [ends_mm[i] - (1.0 - LEAST_SHARE) * before, ends_mm[i] + (1.0 - LEAST_SHARE) * after],
        stops: Vec::new(),
        moves: vec![of_segment(i - 1, "length_mm", 1.0), of_segment(i, "length_mm", -1.0)],
    }
}

/// The end at the tailstock: what stands there goes with it, and nothing else is passed by.
fn end(shaft: &Shaft, supports: &[Support], ends_mm: &[f64]) -> Option<Handle> {
    let (last, length) = (shaft.segments.len().checked_sub(1)?, *ends_mm.last()?);
    let stations = || supports.iter().enumerate().filter_map(|(i, of)| of.station_mm().map(|z| (i, z)));
    // Both were settled on the same ends.
    let is_there = |z: f64| z.total_cmp(&length).is_eq();
    let kept = length - (1.0 - LEAST_SHARE) * shaft.segments[last].length_mm;
    let least = stations().map(|(_, z)| z).filter(|z| *z < length).fold(kept, f64::max);
    let with_it = stations().filter(|(_, z)| is_there(*z));
    let follow = with_it.map(|(i, _)| Move { pointer: format!("/supports/{i}/z_mm"), per_unit: 1.0 });
    Some(Handle {
        name: "handle_end",
        x: length,
        // Above all that is drawn there: what holds the end has a handle, too.
        y: ABOVE * shaft.segments.iter().map(|segment| segment.diameter_mm / 2.0).fold(0.0, f64::max),
        along: Along::X,
        reach: [least, MOST_TIMES * length],
        stops: Vec::new(),
        moves: [of_segment(last, "length_mm", 1.0)].into_iter().chain(follow).collect(),
    })
}

/// What holds the shaft goes along it and stops at its ends and shoulders; a follow rest goes with the tool.
fn support(shaft: &Shaft, ends_mm: &[f64], i: usize, of: &Support) -> Option<Handle> {
    let z_mm = of.station_mm()?;
    let (name, y) = match of {
        Support::Centre { .. } => ("handle_centre", 0.0),
        Support::Chuck { .. } => ("handle_chuck", 0.0),
        Support::SteadyRest { .. } | Support::FollowRest { .. } => ("handle_rest", radius_mm(shaft, ends_mm, z_mm)),
    };
    Some(Handle {
        name,
        x: z_mm,
        y,
        along: Along::X,
        reach: [*ends_mm.first()?, *ends_mm.last()?],
        stops: ends_mm.to_vec(),
        moves: vec![Move { pointer: format!("/supports/{i}/z_mm"), per_unit: 1.0 }],
    })
}
