//! Places along a move, so close that between them its path is straight.

use crate::calculator::Failure;
use crate::deflection_compensation::ToolPlace;

use super::super::stock::{Part, Way};
use super::cut::{AXIS_MM, CutPlace, Cutting, Kept, Pace};
use super::near::Near;

/// Places stand no farther apart than this at first, mm; of a short move, and there are four of them otherwise, than this.
const APART_MM: f64 = 5.0;
const APART_SHORT_MM: f64 = 0.1;
/// On an arc no farther than by this angle, rad: the edge turns against the surface.
const APART_RAD: f64 = std::f64::consts::PI / 180.0;
/// And no nearer than this where the path jumps, mm.
const NEAREST_MM: f64 = 0.01;
/// Most places at the beginning, and in all.
const MOST_AT_FIRST: f64 = 400.0;
const MOST_PLACES: usize = 4000;
/// Steps of the stock that get places of their own.
const MOST_STEPS: usize = 100;

/// Where an outline turns by less, and does not jump, the depth hardly does: slope, mm.
const TURNS: f64 = 0.05;
const JUMPS_MM: f64 = 1e-4;

/// Whether the outline has a step or a corner between two parts of it.
fn is_corner(pair: &[&Part]) -> bool {
    let x = pair[1].piece.x0;
    let [left, right] = [pair[0], pair[1]].map(|part| part.piece.curve);
    (left.at(x) - right.at(x)).abs() > JUMPS_MM || (left.slope(x) - right.slope(x)).abs() > TURNS
}

/// Path and time in the cut so far.
#[derive(Debug, Clone, Copy, Default)]
pub(super) struct SoFar {
    path_m: f64,
    time_min: f64,
}

/// Path and time after a way.
pub(super) fn after(so_far: SoFar, way: &Way, pace: Pace) -> SoFar {
    let radius_mm = way.at(0.5)[1].max(AXIS_MM);
    let Some(feed) = pace.feed_mm_per_rev(radius_mm) else { return so_far };
    let turns = way.length_mm() / feed;
    let time_min = pace.rpm(radius_mm).filter(|rpm| *rpm > 0.0).map_or(0.0, |rpm| turns / rpm);
    SoFar {
        path_m: so_far.path_m + 2.0 * std::f64::consts::PI * radius_mm * turns / 1000.0,
        time_min: so_far.time_min + time_min,
    }
}

/// A move along which places are laid.
pub(super) struct Along<'a> {
    pub(super) cutting: Cutting<'a>,
    pub(super) way: &'a Way,
    /// Share from which on the depth is what the tool meets.
    pub(super) from: f64,
    pub(super) so_far: SoFar,
    pub(super) move_pace: Pace,
    pub(super) straight_mm: f64,
    /// Shares at which it is looked at, and no others; none where they are to be found.
    pub(super) shares: Vec<f64>,
}

impl Along<'_> {
    /// Places, so close that between them the path is straight.
    pub(super) fn places(&self) -> Result<Vec<CutPlace>, Failure> {
        let mut kept = Kept::default();
        if !self.shares.is_empty() {
            return self.at(&self.shares, &[], &mut kept);
        }
        let mut places = self.at(&self.first_shares(), &[], &mut kept)?;
        // Whether what lies behind a place may still be bent.
        let mut is_open = vec![true; places.len()];
        let nearest = NEAREST_MM / self.way.length_mm();
        while places.len() < MOST_PLACES {
            let wanted: Vec<usize> = (1..places.len())
                .filter(|&i| is_open[i - 1] && places[i].share - places[i - 1].share > nearest)
                .collect();
            if wanted.is_empty() {
                break;
            }
            let shares: Vec<f64> = wanted.iter().map(|&i| 0.5 * (places[i - 1].share + places[i].share)).collect();
            let guesses: Vec<f64> = wanted.iter().map(|&i| 0.5 * (places[i - 1].lift_mm + places[i].lift_mm)).collect();
            let found = self.at(&shares, &guesses, &mut kept)?;
            let (mut laid, mut open) = (Vec::new(), Vec::new());
            let mut next = wanted.iter().zip(&found).peekable();
            for (i, place) in places.iter().enumerate() {
                if let Some((_, inside)) = next.next_if(|(at, _)| **at == i) {
                    let before: &CutPlace = &places[i - 1];
                    let off = |of: fn(&CutPlace) -> f64| of(inside) - 0.5 * (of(before) + of(place));
                    let off = off(|place| place.lift_mm).abs().max(off(|place| place.wanted_mm).abs());
                    let bent = off > self.straight_mm;
                    if let Some(last) = open.last_mut() {
                        *last = bent;
                    }
                    laid.push(*inside);
                    open.push(bent);
                }
                laid.push(*place);
                open.push(is_open[i] && next.peek().is_some_and(|(at, _)| **at == i + 1));
            }
            (places, is_open) = (laid, open);
        }
        Ok(places)
    }

    /// Evenly, and on both sides of every step of the stock.
    fn first_shares(&self) -> Vec<f64> {
        let length = self.way.length_mm();
        let turned = if let Way::Arc { turn, .. } = self.way { turn.abs() } else { 0.0 };
        let least = (length / APART_SHORT_MM).ceil().clamp(1.0, 4.0);
        let count = (length / APART_MM).max(turned / APART_RAD).ceil().clamp(least, MOST_AT_FIRST);
        // At most MOST_AT_FIRST.
        #[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss)]
        let whole = count as usize;
        let mut shares: Vec<f64> = (0..=whole).map(|i| i as f64 / count).collect();
        let [from, to] = self.way.ends();
        let (low, high) = (from[0].min(to[0]), from[0].max(to[0]));
        if let Way::Line(..) = self.way
            && high - low > NEAREST_MM
        {
            let stock: &Near<'_> = &self.cutting.nominal;
            let parts: Vec<&Part> = stock.parts_between(low, high).collect();
            // What does not turn much is seen from places that are near anyhow.
            let is_seen = |pair: &&[&Part]| length >= 4.0 * APART_SHORT_MM || is_corner(pair);
            let corners = parts.windows(2).filter(is_seen).map(|pair| pair[1].piece.x0);
            // The ends of all of it stand beside no other part.
            let ends = [parts.first().map(|part| part.piece.x0), parts.last().map(|part| part.piece.x1)];
            let steps = corners.chain(ends.into_iter().flatten());
            for x in steps.filter(|x| low < *x && *x < high).take(MOST_STEPS) {
                shares.extend([-NEAREST_MM, NEAREST_MM].map(|by| (x + by - from[0]) / (to[0] - from[0])));
            }
        }
        if let Some(aim) = self.cutting.aim.filter(|_| self.cutting.is_corrected) {
            let beside = [-NEAREST_MM, NEAREST_MM].map(|by| by / length);
            shares.extend(aim.breaks(self.cutting.stroke).iter().flat_map(|at| beside.map(|by| at + by)));
        }
        shares.retain(|share| (0.0..=1.0).contains(share));
        shares.sort_by(f64::total_cmp);
        let nearest = 0.5 * NEAREST_MM / length;
        let last = shares.last().copied();
        shares.dedup_by(|later, kept| *later - *kept <= nearest);
        if let (Some(kept), Some(last)) = (shares.last_mut(), last) {
            *kept = last;
        }
        shares
    }

    /// What happens at shares, near lifts that are guessed, or those of the place before.
    fn at(&self, shares: &[f64], guesses_mm: &[f64], kept: &mut Kept) -> Result<Vec<CutPlace>, Failure> {
        let whole = after(self.so_far, self.way, self.move_pace);
        let between = |from: f64, to: f64, share: f64| from + share * (to - from);
        let place = |&share: &f64| {
            let [z_mm, radius_mm] = self.way.at(share);
            ToolPlace {
                z_mm,
                radius_mm: radius_mm.max(AXIS_MM),
                path_m: between(self.so_far.path_m, whole.path_m, share),
                time_min: between(self.so_far.time_min, whole.time_min, share),
                planned: self.cutting.planned(share, self.from),
            }
        };
        let places: Vec<ToolPlace> = shares.iter().map(place).collect();
        let gaps = self.cutting.held.gaps(&places)?;
        let mut found: Vec<CutPlace> = Vec::with_capacity(shares.len());
        for (i, &share) in shares.iter().enumerate() {
            let before = found.last().map_or(0.0, |place| place.lift_mm);
            let guess_mm = guesses_mm.get(i).copied().unwrap_or(before);
            found.push(self.cutting.at((share, self.from), (&gaps, i), guess_mm, kept));
        }
        Ok(found)
    }
}
