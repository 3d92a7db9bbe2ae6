//! What stands of the workpiece before the program runs, and whether the zones fit it.

use crate::calculator::{Failure, Finding};
use crate::turning::Finished;

use crate::feed_schedule::answer::output::Outcome;
use crate::feed_schedule::job::input::Job;

/// Stretches shorter than this are rounding, mm.
const LEAST_MM: f64 = 1e-6;
/// Diameters that differ by less are one, mm: half a step of the control.
pub(in crate::feed_schedule) const SAME_MM: f64 = 0.0005;

/// A cut along a zone, as far as the blank is concerned.
#[derive(Debug, Clone, Copy, PartialEq)]
#[allow(clippy::struct_field_names)] // all are lengths
pub(in crate::feed_schedule) struct Turned {
    pub from_mm: f64,
    pub to_mm: f64,
    /// Diameter that is left.
    pub diameter_mm: f64,
    /// Depth on the radius that is taken.
    pub depth_mm: f64,
}

/// Diameters along the shaft before the first cut.
#[derive(Debug, Clone, PartialEq)]
pub(in crate::feed_schedule) struct Blank {
    /// Ends of the stretches, ascending.
    edges_mm: Vec<f64>,
    /// One for every stretch; 0 where nothing is known to stand.
    diameters_mm: Vec<f64>,
}

impl Blank {
    /// Before all cuts: the shaft's blank, and what the cuts need where that is more; with edges of their own at `further_mm`.
    pub(in crate::feed_schedule) fn of(job: &Job, cuts: &[Turned], further_mm: &[f64]) -> Self {
        let segments = segments(job);
        let mut edges_mm: Vec<f64> = segments.iter().flat_map(|segment| [segment.from_mm, segment.to_mm]).collect();
        edges_mm.extend(cuts.iter().flat_map(|cut| [cut.from_mm, cut.to_mm]));
        if let (Some(least), Some(most)) =
            (edges_mm.iter().copied().reduce(f64::min), edges_mm.iter().copied().reduce(f64::max))
        {
            edges_mm.extend(further_mm.iter().copied().filter(|z| least < *z && *z < most));
        }
        edges_mm.sort_by(f64::total_cmp);
        edges_mm.dedup_by(|a, b| (*a - *b).abs() < LEAST_MM);
        let mut blank = Self { diameters_mm: vec![0.0; edges_mm.len().saturating_sub(1)], edges_mm };
        for segment in &segments {
            blank.change(segment.from_mm, segment.to_mm, |_| segment.stock_mm);
        }
        for cut in cuts {
            blank.change(cut.from_mm, cut.to_mm, |there| there.max(cut.diameter_mm + 2.0 * cut.depth_mm));
        }
        blank
    }

    /// The shaft after all cuts.
    pub(in crate::feed_schedule) fn finished(mut self, cuts: &[Turned]) -> Vec<Finished> {
        for cut in cuts {
            self.change(cut.from_mm, cut.to_mm, |there| there.min(cut.diameter_mm));
        }
        let is_turned = |ends: &[f64]| {
            let over = |cut: &Turned| cut.from_mm.max(ends[0]) + LEAST_MM < cut.to_mm.min(ends[1]);
            cuts.iter().any(over)
        };
        let stretches = self.edges_mm.windows(2).zip(&self.diameters_mm);
        stretches
            .map(|(ends, &diameter_mm)| Finished { to_mm: ends[1], diameter_mm, is_turned: is_turned(ends) })
            .collect()
    }

    /// Ends and diameter of every stretch, along the shaft.
    pub(in crate::feed_schedule) fn stretches(&self) -> impl Iterator<Item = ([f64; 2], f64)> + '_ {
        self.edges_mm.windows(2).map(|ends| [ends[0], ends[1]]).zip(self.diameters_mm.iter().copied())
    }

    fn change(&mut self, from_mm: f64, to_mm: f64, to: impl Fn(f64) -> f64) {
        for k in self.touched(from_mm, to_mm).collect::<Vec<_>>() {
            self.diameters_mm[k] = to(self.diameters_mm[k]);
        }
    }

    /// Stretches of which more than rounding lies between two stations.
    fn touched(&self, from_mm: f64, to_mm: f64) -> impl Iterator<Item = usize> + '_ {
        let ends = self.edges_mm.windows(2).enumerate();
        ends.filter(move |(_, ends)| ends[0].max(from_mm) + LEAST_MM < ends[1].min(to_mm)).map(|(k, _)| k)
    }
}

/// A segment of the job's shaft by its stations.
#[allow(clippy::struct_field_names)] // all are lengths
struct Placed {
    from_mm: f64,
    to_mm: f64,
    diameter_mm: f64,
    stock_mm: f64,
}

fn segments(job: &Job) -> Vec<Placed> {
    let mut from_mm = 0.0;
    let shaft = job.shaft.iter().flat_map(|shaft| &shaft.segments);
    shaft
        .map(|segment| {
            let to_mm = from_mm + segment.length_mm;
            let placed = Placed { from_mm, to_mm, diameter_mm: segment.diameter_mm, stock_mm: segment.stock_mm() };
            from_mm = to_mm;
            placed
        })
        .collect()
}

/// A program turns zones to their diameters by their depths: refused where the job's own shaft has another drawing there,
/// or a blank that leaves more to cut than the schedule counts with.
pub(in crate::feed_schedule) fn zones_fit_the_shaft(
    job: &Job,
    outcome: &Outcome,
    cuts: &[Turned],
) -> Result<(), Failure> {
    let segments = segments(job);
    for zone in &outcome.zones {
        let (from_mm, to_mm) = (zone.z_start_mm, zone.z_end_mm);
        let cut = |segment: &&Placed| segment.from_mm.max(from_mm) + LEAST_MM < segment.to_mm.min(to_mm);
        // Roughing passes and finish lie over one stretch.
        let over =
            cuts.iter().filter(|cut| (cut.from_mm - from_mm).abs() < LEAST_MM && (cut.to_mm - to_mm).abs() < LEAST_MM);
        let depth_mm: f64 = over.map(|cut| cut.depth_mm).sum();
        for segment in segments.iter().filter(cut) {
            let fault = |code, value_mm: f64, limit_mm: f64| {
                Finding::new(code, "/zones")
                    .measured(value_mm, limit_mm, "mm")
                    .with("zone", zone.id.clone())
                    .with("from_mm", segment.from_mm.max(from_mm))
                    .with("to_mm", segment.to_mm.min(to_mm))
            };
            if (zone.diameter_mm - segment.diameter_mm).abs() > SAME_MM {
                return Err(Failure::OutOfModel(fault("zone_off_drawing", zone.diameter_mm, segment.diameter_mm)));
            }
            let needed_mm = (segment.stock_mm - segment.diameter_mm) / 2.0;
            if needed_mm > depth_mm + SAME_MM {
                return Err(Failure::OutOfModel(fault("zone_off_blank", depth_mm, needed_mm)));
            }
        }
    }
    Ok(())
}

#[cfg(test)]
#[allow(clippy::float_cmp)] // what stands is what was given
mod tests {
    use super::*;

    fn cut(from_mm: f64, to_mm: f64, diameter_mm: f64, depth_mm: f64) -> Turned {
        Turned { from_mm, to_mm, diameter_mm, depth_mm }
    }

    #[test]
    fn the_blank_is_what_the_cuts_need() {
        let cuts = [cut(0.0, 100.0, 52.0, 1.0), cut(0.0, 100.0, 50.0, 1.0), cut(120.0, 150.0, 60.0, 0.5)];
        let job: Job = serde_json::from_str("{}").unwrap_or_else(|_| unreachable!("every field has a default"));
        let blank: Vec<_> = Blank::of(&job, &cuts, &[50.0, 170.0]).stretches().collect();
        // Nothing is known to stand between two cuts, and nothing stands beyond them.
        let expected = [([0.0, 50.0], 54.0), ([50.0, 100.0], 54.0), ([100.0, 120.0], 0.0), ([120.0, 150.0], 61.0)];
        assert_eq!(blank, expected);
    }
}
