//! What no cause explains as an effect over one or two conditions of the cut (`diagnosis/5.21`).

use crate::calculator::{Finding, KnownOver, Violations};
use crate::effects::{MachinabilityConditions, RemainderPoint};
use crate::num::table::{Straight, straight};

use crate::feed_schedule::job::input::Job;

/// A condition that it may go with.
pub(in crate::feed_schedule) struct Known {
    /// As the design calls it.
    pub(in crate::feed_schedule) name: &'static str,
    /// Its field.
    pub(in crate::feed_schedule) field: &'static str,
    pub(in crate::feed_schedule) unit: &'static str,
    /// Whether it is taken in its logarithm.
    is_logarithmic: bool,
    pub(in crate::feed_schedule) of_point: fn(&RemainderPoint) -> Option<f64>,
    pub(in crate::feed_schedule) set: fn(&mut RemainderPoint, f64),
}

/// In the order in which pairs of them are told.
pub(in crate::feed_schedule) const KNOWN: [Known; 7] = [
    Known {
        name: "speed",
        field: "speed_m_per_min",
        unit: "m/min",
        is_logarithmic: true,
        of_point: |point| point.speed_m_per_min,
        set: |point, value| point.speed_m_per_min = Some(value),
    },
    Known {
        name: "feed",
        field: "feed_mm_per_rev",
        unit: "mm/rev",
        is_logarithmic: true,
        of_point: |point| point.feed_mm_per_rev,
        set: |point, value| point.feed_mm_per_rev = Some(value),
    },
    Known {
        name: "depth",
        field: "depth_mm",
        unit: "mm",
        is_logarithmic: true,
        of_point: |point| point.depth_mm,
        set: |point, value| point.depth_mm = Some(value),
    },
    Known {
        name: "edge_angle",
        field: "cutting_edge_angle_deg",
        unit: "deg",
        is_logarithmic: false,
        of_point: |point| point.cutting_edge_angle_deg,
        set: |point, value| point.cutting_edge_angle_deg = Some(value),
    },
    Known {
        name: "nose_radius",
        field: "nose_radius_mm",
        unit: "mm",
        is_logarithmic: false,
        of_point: |point| point.nose_radius_mm,
        set: |point, value| point.nose_radius_mm = Some(value),
    },
    Known {
        name: "flank_wear",
        field: "flank_wear_mm",
        unit: "mm",
        is_logarithmic: false,
        of_point: |point| point.flank_wear_mm,
        set: |point, value| point.flank_wear_mm = Some(value),
    },
    Known {
        name: "time",
        field: "time_min",
        unit: "min",
        is_logarithmic: false,
        of_point: |point| point.time_min,
        set: |point, value| point.time_min = Some(value),
    },
];

impl Known {
    pub(in crate::feed_schedule) fn named(name: &str) -> Option<&'static Self> {
        KNOWN.iter().find(|known| known.name == name)
    }

    /// In what it is taken straight between two places.
    pub(in crate::feed_schedule) fn coordinate(&self, value: f64) -> f64 {
        if self.is_logarithmic { value.ln() } else { value }
    }

    pub(in crate::feed_schedule) fn value(&self, coordinate: f64) -> f64 {
        if self.is_logarithmic { coordinate.exp() } else { coordinate }
    }

    pub(in crate::feed_schedule) fn place(&self, point: &RemainderPoint) -> f64 {
        self.coordinate((self.of_point)(point).unwrap_or(f64::NAN))
    }
}

/// The conditions that points state: those of the first.
pub(in crate::feed_schedule) fn over(profile: &[RemainderPoint]) -> Vec<&'static Known> {
    profile
        .first()
        .map_or_else(Vec::new, |first| KNOWN.iter().filter(|known| (known.of_point)(first).is_some()).collect())
}

/// How many points the last of the conditions has.
pub(in crate::feed_schedule) fn width(profile: &[RemainderPoint], over: &[&Known]) -> usize {
    if over.len() < 2 {
        return 1;
    }
    let first = over[0].place(&profile[0]);
    profile.iter().take_while(|point| over[0].place(point).total_cmp(&first).is_eq()).count()
}

/// The first point that is not in its place of a table over one or two conditions, values of both ascending, those of the second
/// first.
fn out_of_place(profile: &[RemainderPoint]) -> Option<usize> {
    let over = over(profile);
    if !(1..=2).contains(&over.len()) {
        return Some(0);
    }
    let width = width(profile, &over);
    let states = |point: &RemainderPoint| {
        KNOWN.iter().all(|known| (known.of_point)(point).is_some() == over.iter().any(|own| own.name == known.name))
    };
    let is_in_place = |index: usize| {
        let (row, column) = (index / width, index % width);
        let place = |condition: usize, of: usize| over[condition].place(&profile[of]);
        let in_row = place(0, index).total_cmp(&place(0, row * width)).is_eq();
        let in_column = over.len() < 2 || place(1, index).total_cmp(&place(1, column)).is_eq();
        let ascends = (column > 0 || row == 0 || place(0, index) > place(0, index - width))
            && (column == 0 || place(1, index) > place(1, index - 1));
        states(&profile[index]) && in_row && in_column && ascends
    };
    let first = (0..profile.len()).find(|&index| !is_in_place(index));
    first.or_else(|| (!profile.len().is_multiple_of(width)).then_some(profile.len() - 1))
}

/// Adds the faults of a remainder at a place of the job.
pub(in crate::feed_schedule) fn check(job: &Job, profile: &[RemainderPoint], at: &str, violations: &mut Violations) {
    if let Some(index) = out_of_place(profile) {
        violations.add(Finding::new("remainder_not_a_table", format!("{at}/profile/{index}")).with("point", index + 1));
        return;
    }
    for known in over(profile) {
        require(job, known, at, violations);
    }
}

/// A fault where a job does not state what an effect at a place of it goes with.
pub(in crate::feed_schedule) fn require(job: &Job, known: &Known, at: &str, violations: &mut Violations) {
    let c = &job.conditions;
    let (there, pointer) = match known.name {
        "edge_angle" => (job.cutting_edge_angle_deg.is_some(), format!("/{}", known.field)),
        "nose_radius" => (c.nose_radius_mm.is_some(), format!("/conditions/{}", known.field)),
        "flank_wear" => (c.flank_wear_mm.is_some(), format!("/conditions/{}", known.field)),
        "time" => (c.time_min.is_some(), format!("/conditions/{}", known.field)),
        _ => (true, String::new()),
    };
    violations.require(there, || {
        Finding::new("effect_condition_missing", pointer).with("field", known.field).with("effect", at.to_owned())
    });
}

/// A remainder at one depth, edge, and state of it, over ln V and ln S.
#[derive(Debug, Clone, PartialEq)]
pub(in crate::feed_schedule) struct Table {
    /// The places of one or two conditions, and where the cut stands in each.
    axes: Vec<(Vec<f64>, At)>,
    values: Vec<f64>,
}

/// Where a cut stands in a condition.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::feed_schedule) enum At {
    Speed,
    Feed,
    /// There, whatever speed and feed are.
    Fixed(f64),
}

/// What a cut states beside speed and feed.
pub(in crate::feed_schedule) struct Stated<'a> {
    pub(in crate::feed_schedule) depth_mm: f64,
    pub(in crate::feed_schedule) angle_deg: Option<f64>,
    pub(in crate::feed_schedule) conditions: &'a MachinabilityConditions,
}

impl Stated<'_> {
    /// Where the cut stands in a condition, in its unit; `None` where it does not state it.
    pub(in crate::feed_schedule) fn value(&self, known: &Known) -> Option<At> {
        Some(match known.name {
            "speed" => At::Speed,
            "feed" => At::Feed,
            "depth" => At::Fixed(self.depth_mm),
            "edge_angle" => At::Fixed(self.angle_deg?),
            "nose_radius" => At::Fixed(self.conditions.nose_radius_mm?),
            "flank_wear" => At::Fixed(self.conditions.flank_wear_mm?),
            _ => At::Fixed(self.conditions.time_min?),
        })
    }
}

impl Table {
    /// `None` where the cut does not state what it goes with.
    pub(in crate::feed_schedule) fn of(scale: f64, profile: &[RemainderPoint], cut: &Stated<'_>) -> Option<Self> {
        let over = over(profile);
        let width = width(profile, &over);
        let at = |known: &Known| {
            Some(match cut.value(known)? {
                At::Fixed(value) => At::Fixed(known.coordinate(value)),
                moving => moving,
            })
        };
        let axis = |(k, known): (usize, &&'static Known)| {
            let along: Vec<&RemainderPoint> = match (k, over.len()) {
                (0, _) => profile.iter().step_by(width).collect(),
                _ => profile.iter().take(width).collect(),
            };
            Some((along.into_iter().map(|point| known.place(point)).collect(), at(known)?))
        };
        let axes = over.iter().enumerate().map(axis).collect::<Option<Vec<_>>>()?;
        Some(Self { axes, values: profile.iter().map(|point| scale * point.delta_ln).collect() })
    }

    /// What is added to L whatever speed and feed are; `None` where it goes with one of them.
    pub(in crate::feed_schedule) fn constant(&self) -> Option<f64> {
        let is_fixed = self.axes.iter().all(|(_, at)| matches!(at, At::Fixed(_)));
        is_fixed.then(|| self.at(0.0, 0.0).0)
    }

    /// What is added to L at ln V and ln S, and its slopes.
    pub(in crate::feed_schedule) fn at(&self, u: f64, x: f64) -> (f64, f64, f64) {
        let asked = |k: usize| {
            let (places, at) = self.axes.get(k)?;
            let at = match at {
                At::Speed => u,
                At::Feed => x,
                At::Fixed(at) => *at,
            };
            Some((places.as_slice(), at))
        };
        let Some(first) = asked(0) else { return (0.0, 0.0, 0.0) };
        let Straight { value, slopes } = straight(first, asked(1), &self.values);
        let along =
            |of: At| self.axes.iter().zip(slopes).filter(|((_, at), _)| *at == of).map(|(_, slope)| slope).sum::<f64>();
        (value, along(At::Speed), along(At::Feed))
    }
}

/// From where to where it is known.
pub(in crate::feed_schedule) fn known_over(profile: &[RemainderPoint]) -> Vec<KnownOver> {
    let ends = profile.first().zip(profile.last());
    let range = |known: &'static Known| {
        let (first, last) = ends?;
        Some(KnownOver {
            field: known.field,
            unit: known.unit,
            from: (known.of_point)(first)?,
            to: (known.of_point)(last)?,
        })
    };
    over(profile).into_iter().filter_map(range).collect()
}

/// What is over the same conditions, in the order of the table.
pub(in crate::feed_schedule) fn is_over_same(one: &[RemainderPoint], other: &[RemainderPoint]) -> bool {
    over(one).iter().map(|known| known.name).eq(over(other).iter().map(|known| known.name))
}

/// What a remainder is called: as the user does, else by its conditions.
pub(in crate::feed_schedule) fn label(name: &str, profile: &[RemainderPoint]) -> String {
    if !name.is_empty() {
        return name.to_owned();
    }
    over(profile).iter().map(|known| known.field).collect::<Vec<_>>().join(", ")
}
