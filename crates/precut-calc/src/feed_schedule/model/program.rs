//! From a case to a geometric program with named limits (`feed/6.1`).

use std::borrow::Cow;
use std::f64::consts::PI;

use crate::calculator::ConstraintName;
use crate::num::gp::{Affines, Objective, Program};

use crate::feed_schedule::job::acting::Form;
use crate::feed_schedule::job::case::{Case, ZoneCase};
use crate::feed_schedule::job::input::{FeedMode, Goal, SpeedMode};
use crate::feed_schedule::job::models::Output;
use crate::feed_schedule::model::edges::{fewer_parts, more_parts, shared};

/// A kind of limit, as answers name it.
#[derive(Debug, Clone, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub(in crate::feed_schedule) enum Kind {
    Deflection,
    Spread,
    Roughness,
    Hardening,
    HardeningDepth,
    ToolLifeMin,
    ToolUsage,
    /// A whole number of parts per edge.
    WholeParts,
    /// What one edge cuts, with whole edges.
    WholeEdge,
    TimeMax,
    Power,
    Torque,
    ForceZ,
    ForceY,
    RpmMin,
    RpmMax,
    FeedRateMax,
    FeedMin,
    FeedMax,
    SpeedMin,
    SpeedMax,
    FeedStep,
    FeedGradient,
    Custom(String),
    Coupling(String),
    /// A step of successive linearisation may not go further.
    Trust,
    /// Part of a least-of-the-largest objective, no limit of the job.
    Epigraph,
}

impl Kind {
    pub(in crate::feed_schedule) fn name(&self) -> Cow<'static, str> {
        Cow::Borrowed(match self {
            Self::Deflection => "deflection",
            Self::Spread => "deflection_spread",
            Self::Roughness => "roughness",
            Self::Hardening => "hardening",
            Self::HardeningDepth => "hardening_depth",
            Self::ToolLifeMin => "tool_life_min",
            Self::ToolUsage => "tool_usage",
            Self::WholeParts => "whole_parts_per_edge",
            Self::WholeEdge => "whole_edges",
            Self::TimeMax => "time_max",
            Self::Power => "power",
            Self::Torque => "torque",
            Self::ForceZ => "force_z",
            Self::ForceY => "force_y",
            Self::RpmMin => "rpm_min",
            Self::RpmMax => "rpm_max",
            Self::FeedRateMax => "feed_rate_max",
            Self::FeedMin => "feed_min",
            Self::FeedMax => "feed_max",
            Self::SpeedMin => "speed_min",
            Self::SpeedMax => "speed_max",
            Self::FeedStep => "feed_step",
            Self::FeedGradient => "feed_gradient",
            Self::Custom(name) | Self::Coupling(name) => return Cow::Owned(name.clone()),
            Self::Trust => "trust",
            Self::Epigraph => "largest",
        })
    }

    /// Whether the least relaxation may loosen it before machine and data ranges (`feed/6.5`).
    pub(in crate::feed_schedule) fn is_requirement(&self) -> bool {
        matches!(
            self,
            Self::Deflection
                | Self::Spread
                | Self::Roughness
                | Self::Hardening
                | Self::HardeningDepth
                | Self::ToolUsage
                | Self::WholeParts
                | Self::WholeEdge
                | Self::ToolLifeMin
                | Self::TimeMax
                | Self::ForceZ
                | Self::ForceY
                | Self::FeedStep
        )
    }

    /// Whether it is a limit of the job.
    pub(in crate::feed_schedule) fn is_limit(&self) -> bool {
        !matches!(self, Self::Trust | Self::Epigraph)
    }
}

/// Where a limit holds.
#[derive(Debug, Clone, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub(in crate::feed_schedule) enum Place {
    Zone(usize),
    Part,
    Surface(usize),
    Zones(Vec<usize>),
}

/// Name, place and size of a limit.
#[derive(Debug, Clone, PartialEq)]
pub(in crate::feed_schedule) struct Label {
    pub kind: Kind,
    pub place: Place,
    /// The limit in its unit.
    pub limit: f64,
    pub unit: &'static str,
    /// The row is in units of the limit, not in logarithms: a semi-log model.
    pub plain: bool,
    /// A lower limit: its relaxation divides.
    pub lower: bool,
}

impl Label {
    pub(in crate::feed_schedule) fn name(&self, case: &Case) -> ConstraintName {
        let zone = match &self.place {
            Place::Zone(i) => case.zones[*i].id.clone(),
            Place::Part => "part".to_owned(),
            Place::Surface(s) => case.surfaces[*s].clone(),
            Place::Zones(zones) => zones.iter().map(|&i| case.zones[i].id.as_str()).collect::<Vec<_>>().join("|"),
        };
        ConstraintName { constraint: self.kind.name().into_owned(), zone }
    }
}

/// ln V or ln S of a zone: a variable of the program plus a constant, or a constant.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::feed_schedule) struct Source {
    pub variable: Option<usize>,
    pub constant: f64,
}

impl Source {
    pub(in crate::feed_schedule) fn at(&self, y: &[f64]) -> f64 {
        self.variable.map_or(0.0, |v| y[v]) + self.constant
    }
}

/// A program with what its rows and variables mean.
#[derive(Debug, Clone)]
pub(in crate::feed_schedule) struct Built {
    pub program: Program,
    pub rows: Vec<Label>,
    pub sums: Vec<Label>,
    pub speed: Vec<Source>,
    pub feed: Vec<Source>,
    /// Constant part of the objective: fixed times and costs, tool parts of whole edges.
    pub fixed: f64,
}

/// What differs from the case as it stands.
#[derive(Debug, Clone, Default)]
pub(in crate::feed_schedule) struct Variation<'a> {
    /// A whole number of parts per edge.
    pub parts_per_edge: Option<u32>,
    /// Whole edges, and what each may cut.
    pub edges: Option<&'a EdgeLimits>,
    /// Where bending models are linearised: ln V, ln S per zone, and how far the step may go.
    pub about: Option<(&'a [(f64, f64)], f64)>,
    /// Further schedules at which limits that are moved in by what bends have tangents.
    pub beside: &'a [Vec<(f64, f64)>],
}

/// Whole edges of a part, and limits on what some of them cut together.
#[derive(Debug, Clone, PartialEq)]
pub(in crate::feed_schedule) struct EdgeLimits {
    /// Edges that one part takes.
    pub per_part: f64,
    /// Zones, and the share of edges that they may use together.
    pub groups: Vec<(Vec<usize>, f64)>,
    /// Where one edge serves whole parts: how many.
    parts: Option<Parts>,
}

/// Whole parts that one edge serves.
#[derive(Debug, Clone, Copy, PartialEq)]
struct Parts {
    per_edge: u32,
    batch: Option<u32>,
}

impl EdgeLimits {
    /// Edges of which each may be used for so much of these zones.
    pub(in crate::feed_schedule) fn new(per_part: f64, groups: Vec<(Vec<usize>, f64)>) -> Self {
        Self { per_part, groups, parts: None }
    }

    /// One edge for so many whole parts.
    pub(in crate::feed_schedule) fn several_parts(
        parts: u32,
        batch: Option<u32>,
        zones: Vec<usize>,
        capacity: f64,
    ) -> Self {
        Self {
            per_part: shared(parts, batch),
            groups: vec![(zones, capacity * (1.0 / f64::from(parts)))],
            parts: Some(Parts { per_edge: parts, batch }),
        }
    }

    /// The same edges with every limit times a factor.
    pub(in crate::feed_schedule) fn used_further(&self, factor: f64) -> Self {
        let groups = self.groups.iter().map(|(zones, most)| (zones.clone(), most * factor)).collect();
        Self { groups, ..self.clone() }
    }

    /// The same edges, and where one serves whole parts, those that serve the next fewer and more.
    pub(in crate::feed_schedule) fn with_neighbours(&self) -> Vec<Self> {
        let mut all = vec![self.clone()];
        if let (Some(Parts { per_edge, batch }), [(zones, most)]) = (self.parts, self.groups.as_slice()) {
            let capacity = most * f64::from(per_edge);
            let neighbours = [fewer_parts(per_edge, batch), more_parts(per_edge, batch)];
            let of = |parts| Self::several_parts(parts, batch, zones.clone(), capacity);
            all.extend(neighbours.into_iter().flatten().map(of));
        }
        all
    }
}

/// What the objective's terms are made of: money or minutes per minute in the cut and per edge, and fixed.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::feed_schedule) struct Rates {
    pub per_minute: f64,
    pub per_edge: f64,
    pub fixed: f64,
}

impl Rates {
    pub(in crate::feed_schedule) fn of(case: &Case) -> Option<Self> {
        match case.goal {
            Goal::Time { tool_change_time_min, fixed_time_min } => Some(Self {
                per_minute: 1.0,
                per_edge: tool_change_time_min,
                fixed: fixed_time_min + case.passes_time_min,
            }),
            Goal::Cost { machine_rate_per_min, tool_change_time_min, edge_cost, fixed_time_min, fixed_cost } => {
                Some(Self {
                    per_minute: machine_rate_per_min,
                    per_edge: machine_rate_per_min * tool_change_time_min + edge_cost + case.edge_failures_cost,
                    fixed: machine_rate_per_min * (fixed_time_min + case.passes_time_min) + fixed_cost,
                })
            }
            Goal::Deflection {} | Goal::Roughness {} | Goal::Hardening {} => None,
        }
    }
}

struct Builder<'a> {
    case: &'a Case,
    variation: &'a Variation<'a>,
    speed: Vec<Source>,
    feed: Vec<Source>,
    local: usize,
    common: usize,
    rows: Affines,
    labels: Vec<Label>,
}

/// The program of a case.
pub(in crate::feed_schedule) fn build(case: &Case, variation: &Variation<'_>) -> Built {
    let n = case.zones.len();
    let (speed, feed, local, common) = sources(case);
    let mut builder = Builder {
        case,
        variation,
        speed,
        feed,
        local,
        common,
        rows: Affines::with_capacity(12 * n, 24 * n),
        labels: Vec::with_capacity(12 * n),
    };
    for i in 0..n {
        builder.zone(i);
    }
    builder.spread();
    builder.couplings();
    let (sums, sum_labels) = builder.sums();
    let (objective, fixed) = builder.objective();
    let mut start = vec![0.0; builder.local + builder.common];
    builder.middle(&mut start);
    builder.trust();
    Built {
        program: Program { local: builder.local, common: builder.common, objective, rows: builder.rows, sums, start },
        rows: builder.labels,
        sums: sum_labels,
        speed: builder.speed,
        feed: builder.feed,
        fixed,
    }
}

/// Variables of every zone; those that are common stand behind the chain.
fn sources(case: &Case) -> (Vec<Source>, Vec<Source>, usize, usize) {
    let v = &case.variables;
    let n = case.zones.len();
    let (own_speed, own_feed) = (v.speed == SpeedMode::PerZone, v.feed == FeedMode::PerZone);
    let stride = usize::from(own_speed) + usize::from(own_feed);
    let local = n * stride;
    let mut common = 0;
    let mut shared = |wanted: bool| {
        wanted.then(|| {
            common += 1;
            local + common - 1
        })
    };
    let common_speed = shared(matches!(v.speed, SpeedMode::ConstantSpeed | SpeedMode::ConstantRpm));
    let common_feed = shared(v.feed == FeedMode::Constant);
    let speed = case
        .zones
        .iter()
        .enumerate()
        .map(|(i, zone)| match v.speed {
            SpeedMode::PerZone => Source { variable: Some(i * stride), constant: 0.0 },
            SpeedMode::ConstantSpeed => Source { variable: common_speed, constant: 0.0 },
            SpeedMode::ConstantRpm => {
                Source { variable: common_speed, constant: (PI * zone.diameter_mm / 1000.0).ln() }
            }
            SpeedMode::Fixed => Source { variable: None, constant: v.fixed_speed_m_per_min.unwrap_or(f64::NAN).ln() },
        })
        .collect();
    let feed = (0..n)
        .map(|i| match v.feed {
            FeedMode::PerZone => Source { variable: Some(i * stride + stride - 1), constant: 0.0 },
            FeedMode::Constant => Source { variable: common_feed, constant: 0.0 },
            FeedMode::Fixed => Source { variable: None, constant: v.fixed_feed_mm_per_rev.unwrap_or(f64::NAN).ln() },
        })
        .collect();
    (speed, feed, local, common)
}

impl Builder<'_> {
    /// Entries and constant of v ln V_i + s ln S_i + c.
    fn affine(&self, i: usize, v: f64, s: f64, c: f64) -> ([(usize, f64); 2], f64) {
        let (speed, feed) = (self.speed[i], self.feed[i]);
        let entry = |source: Source, a: f64| source.variable.map_or((0, 0.0), |variable| (variable, a));
        // A fixed speed may stand beside any exponent; 0 times its logarithm is 0 also where none is given.
        let fixed = |source: Source, a: f64| if a == 0.0 { 0.0 } else { a * source.constant };
        ([entry(speed, v), entry(feed, s)], c + fixed(speed, v) + fixed(feed, s))
    }

    #[allow(clippy::too_many_arguments, reason = "one row of the table of limits per call, read as such")]
    fn row(&mut self, i: usize, v: f64, s: f64, c: f64, kind: Kind, limit: f64, unit: &'static str, plain: bool) {
        let (entries, constant) = self.affine(i, v, s, c);
        self.rows.push(&entries, constant);
        let lower = matches!(kind, Kind::RpmMin | Kind::FeedMin | Kind::SpeedMin | Kind::ToolLifeMin);
        self.labels.push(Label { kind, place: Place::Zone(i), limit, unit, plain, lower });
    }

    /// The form of an output in a zone, linearised where it bends.
    fn form(&self, i: usize, output: Output) -> Option<Form> {
        let (u, x) = self.about(i);
        self.case.zones[i].model(output).map(|model| model.form(u, x))
    }

    fn about(&self, i: usize) -> (f64, f64) {
        self.variation.about.map_or_else(|| middle_of(self.case, i), |(at, _)| at[i])
    }

    /// By how much a limit in a zone is moved in, as its constant and what it has by ln V and ln S: every tangent that is asked for.
    fn margins(&self, i: usize, kind: &Kind) -> Vec<[f64; 3]> {
        let margin = self.case.zones[i].margin(&kind.name());
        let beside = self.variation.beside.iter().filter(|_| margin.bends()).map(|at| at[i]);
        std::iter::once(self.about(i)).chain(beside).map(|(u, x)| margin.form(u, x)).collect()
    }

    /// An upper limit on an output, in logarithms or plain.
    fn output_limit(&mut self, i: usize, output: Output, limit: Option<f64>, kind: &Kind) {
        let (Some(form), Some(limit)) = (self.form(i, output), limit) else { return };
        let bound = if form.log_log { limit.ln() } else { limit };
        for [margin, by_speed, by_feed] in self.margins(i, kind) {
            let (v, s, constant) = (form.speed + by_speed, form.feed + by_feed, form.constant - bound + margin);
            self.row(i, v, s, constant, kind.clone(), limit, output.unit(), !form.log_log);
        }
    }

    fn zone(&mut self, i: usize) {
        let case = self.case;
        let zone = &case.zones[i];
        let (limits, machine) = (&case.limits, &case.machine);
        if let (Some(y), Some(c), Some(limit)) = (self.form(i, Output::ForceY), zone.yields(), zone.deflection_max_um) {
            let kappa = limits.deflection_residual_fraction;
            for [margin, by_speed, by_feed] in self.margins(i, &Kind::Deflection) {
                let constant = y.constant + (kappa * c / limit).ln() + margin;
                self.row(i, y.speed + by_speed, y.feed + by_feed, constant, Kind::Deflection, limit, "um", false);
            }
        }
        self.output_limit(i, Output::Roughness, zone.roughness_max_um, &Kind::Roughness);
        self.output_limit(i, Output::Hardening, zone.hardening_max_percent, &Kind::Hardening);
        self.output_limit(i, Output::HardeningDepth, zone.hardening_depth_max_um, &Kind::HardeningDepth);
        self.output_limit(i, Output::ForceZ, limits.force_z_max_n, &Kind::ForceZ);
        self.output_limit(i, Output::ForceY, limits.force_y_max_n, &Kind::ForceY);
        if let (Some(t), Some(least)) = (self.form(i, Output::ToolLife), limits.tool_life_min_min) {
            let constant = least.ln() - t.constant + case.edge_margin;
            self.row(i, -t.speed, -t.feed, constant, Kind::ToolLifeMin, least, "min", false);
        }
        if let Some(z) = self.form(i, Output::ForceZ) {
            if let Some(power) = machine.power_kw {
                let c = z.constant - (60_000.0 * machine.efficiency * power).ln();
                self.row(i, z.speed + 1.0, z.feed, c, Kind::Power, power, "kW", false);
            }
            if let Some(torque) = machine.torque_n_m {
                let c = z.constant + (zone.diameter_mm / (2000.0 * torque)).ln();
                self.row(i, z.speed, z.feed, c, Kind::Torque, torque, "N m", false);
            }
        }
        self.bounds(i, zone);
        self.custom(i);
        if let (true, Some(ratio)) = (zone.touches_next, limits.feed_step_ratio_max) {
            self.feed_step(i, ratio);
        }
    }

    fn bounds(&mut self, i: usize, zone: &ZoneCase) {
        let case = self.case;
        let (limits, machine) = (&case.limits, &case.machine);
        // n = 1000 V/(pi D).
        let per_speed = (1000.0 / (PI * zone.diameter_mm)).ln();
        if let Some(n) = machine.spindle_speed_min_rpm {
            self.row(i, -1.0, 0.0, n.ln() - per_speed, Kind::RpmMin, n, "rev/min", false);
        }
        if let Some(n) = machine.spindle_speed_max_rpm {
            self.row(i, 1.0, 0.0, per_speed - n.ln(), Kind::RpmMax, n, "rev/min", false);
        }
        if let Some(rate) = machine.feed_rate_max_mm_per_min {
            self.row(i, 1.0, 1.0, per_speed - rate.ln(), Kind::FeedRateMax, rate, "mm/min", false);
        }
        let (low, high) = (limits.feed_min_mm_per_rev, zone.feed_max_mm_per_rev);
        self.row(i, 0.0, -1.0, low.ln(), Kind::FeedMin, low, "mm/rev", false);
        self.row(i, 0.0, 1.0, -high.ln(), Kind::FeedMax, high, "mm/rev", false);
        let (low, high) = (limits.speed_min_m_per_min, limits.speed_max_m_per_min);
        self.row(i, -1.0, 0.0, low.ln(), Kind::SpeedMin, low, "m/min", false);
        self.row(i, 1.0, 0.0, -high.ln(), Kind::SpeedMax, high, "m/min", false);
        if let Some(ceiling) = zone.ceiling {
            let most = ceiling.feed_mm_per_rev;
            self.row(i, 0.0, 1.0, -most.ln(), Kind::FeedGradient, most, "mm/rev", false);
            if let Some(rate) = ceiling.feed_rate_mm_per_min {
                self.row(i, 1.0, 1.0, per_speed - rate.ln(), Kind::FeedGradient, rate, "mm/min", false);
            }
        }
    }

    fn custom(&mut self, i: usize) {
        let case = self.case;
        for custom in case.custom.iter().filter(|custom| custom.zone == i) {
            let mut form = custom.own;
            if let Some(further) = custom.further.and_then(|k| case.zones[i].further.get(k)) {
                let (u, x) = self.about(i);
                let other = further.form(u, x);
                form.constant += other.constant;
                form.speed += other.speed;
                form.feed += other.feed;
                form.log_log = other.log_log;
            }
            let bound = |limit: f64| if form.log_log { limit.ln() } else { limit };
            let kind = || Kind::Custom(custom.name.clone());
            if let Some(max) = custom.max {
                self.row(i, form.speed, form.feed, form.constant - bound(max), kind(), max, "1", !form.log_log);
            }
            if let Some(min) = custom.min {
                self.row(i, -form.speed, -form.feed, bound(min) - form.constant, kind(), min, "1", !form.log_log);
                if let Some(label) = self.labels.last_mut() {
                    label.lower = true;
                }
            }
        }
    }

    fn feed_step(&mut self, i: usize, ratio: f64) {
        let (here, next) = (self.feed[i], self.feed[i + 1]);
        let (Some(a), Some(b)) = (here.variable, next.variable) else { return };
        if a == b {
            return;
        }
        for (up, down) in [(a, b), (b, a)] {
            self.rows.push(&[(up, 1.0), (down, -1.0)], -ratio.ln());
            self.labels.push(Label {
                kind: Kind::FeedStep,
                place: Place::Zones(vec![i, i + 1]),
                limit: ratio,
                unit: "1",
                plain: false,
                lower: false,
            });
        }
    }

    fn new_common(&mut self) -> usize {
        self.common += 1;
        self.local + self.common - 1
    }

    fn spread(&mut self) {
        let Some(ratio) = self.case.limits.deflection_spread_ratio_max else { return };
        let w = self.new_common();
        for i in 0..self.case.zones.len() {
            let (Some(y), Some(c)) = (self.form(i, Output::ForceY), self.case.zones[i].yields()) else { continue };
            let (entries, constant) = self.affine(i, y.speed, y.feed, y.constant + c.ln());
            let label = Label {
                kind: Kind::Spread,
                place: Place::Zone(i),
                limit: ratio,
                unit: "1",
                plain: false,
                lower: false,
            };
            self.rows.push(&[entries[0], entries[1], (w, -1.0)], constant);
            self.labels.push(label.clone());
            let negative = entries.map(|(variable, a)| (variable, -a));
            self.rows.push(&[negative[0], negative[1], (w, 1.0)], -constant - ratio.ln());
            self.labels.push(label);
        }
    }

    fn couplings(&mut self) {
        let case = self.case;
        for coupling in &case.couplings {
            let mut entries = Vec::with_capacity(2 * coupling.terms.len());
            let mut constant = coupling.constant - coupling.max.ln();
            for &(zone, v, s) in &coupling.terms {
                let (of_zone, c) = self.affine(zone, v, s, 0.0);
                entries.extend(of_zone);
                constant += c;
            }
            self.rows.push(&entries, constant);
            self.labels.push(Label {
                kind: Kind::Coupling(coupling.name.clone()),
                place: Place::Zones(coupling.terms.iter().map(|term| term.0).collect()),
                limit: coupling.max,
                unit: "1",
                plain: false,
                lower: false,
            });
        }
    }

    /// Term of the cutting time over `scale`.
    fn time_term(&self, terms: &mut Affines, i: usize, ln_scale: f64) {
        let (entries, constant) = self.affine(i, -1.0, -1.0, self.case.zones[i].work().ln() + ln_scale);
        terms.push(&entries, constant);
    }

    /// Term of the tool usage over `scale`; none without a tool life.
    fn usage_term(&self, terms: &mut Affines, i: usize, ln_scale: f64) {
        let Some(t) = self.form(i, Output::ToolLife) else { return };
        let c = self.case.zones[i].work().ln() - t.constant + ln_scale;
        let (entries, constant) = self.affine(i, -1.0 - t.speed, -1.0 - t.feed, c);
        terms.push(&entries, constant);
    }

    fn sums(&self) -> (Vec<Affines>, Vec<Label>) {
        let case = self.case;
        let (mut sums, mut labels) = (Vec::new(), Vec::new());
        let label = |kind, place, limit, unit| Label { kind, place, limit, unit, plain: false, lower: false };
        let mut usage = |kind, group: &[usize], place, most: f64| {
            let mut terms = Affines::with_capacity(group.len(), 2 * group.len());
            for &i in group {
                self.usage_term(&mut terms, i, case.edge_margin - most.ln());
            }
            sums.push(terms);
            labels.push(label(kind, place, most, "1"));
        };
        let parts = self.variation.parts_per_edge.map(|m| 1.0 / f64::from(m));
        if let Some(edges) = self.variation.edges {
            for (group, most) in &edges.groups {
                let ends: Vec<usize> = group.first().into_iter().chain(group.last()).copied().collect();
                usage(Kind::WholeEdge, group, Place::Zones(ends), *most);
            }
        } else if let Some(most) = case.limits.tool_usage_max.filter(|most| parts.is_none_or(|parts| *most < parts)) {
            for (s, group) in case.usage_groups().iter().enumerate() {
                let of_part = case.limits.tool_usage_scope == crate::feed_schedule::job::input::UsageScope::Part;
                usage(Kind::ToolUsage, group, if of_part { Place::Part } else { Place::Surface(s) }, most);
            }
        }
        if let Some(parts) = parts {
            let all: Vec<usize> = (0..case.zones.len()).collect();
            usage(Kind::WholeParts, &all, Place::Part, parts);
        }
        if let Some(most) = case.limits.time_max_min {
            let mut terms = Affines::with_capacity(case.zones.len(), 2 * case.zones.len());
            (0..case.zones.len()).for_each(|i| self.time_term(&mut terms, i, -most.ln()));
            sums.push(terms);
            labels.push(label(Kind::TimeMax, Place::Part, most, "min"));
        }
        (sums, labels)
    }

    fn objective(&mut self) -> (Objective, f64) {
        let n = self.case.zones.len();
        if let Some(rates) = Rates::of(self.case) {
            let mut terms = Affines::with_capacity(2 * n, 4 * n);
            (0..n).for_each(|i| self.time_term(&mut terms, i, rates.per_minute.ln()));
            let mut fixed = rates.fixed;
            match (self.variation.edges, self.variation.parts_per_edge) {
                (Some(edges), _) => fixed += rates.per_edge * edges.per_part,
                (None, Some(m)) => fixed += rates.per_edge / f64::from(m),
                (None, None) if rates.per_edge > 0.0 => {
                    (0..n).for_each(|i| self.usage_term(&mut terms, i, rates.per_edge.ln()));
                }
                (None, None) => {}
            }
            return (Objective::Sum(terms), fixed);
        }
        let g = self.new_common();
        for i in 0..n {
            let zone = &self.case.zones[i];
            let form = match self.case.goal {
                Goal::Roughness {} => zone.roughness_max_um.and_then(|limit| {
                    self.form(i, Output::Roughness).map(|form| Form { constant: form.constant - limit.ln(), ..form })
                }),
                Goal::Hardening {} => self.form(i, Output::Hardening),
                _ => match (self.form(i, Output::ForceY), zone.yields(), zone.deflection_max_um) {
                    (Some(y), Some(c), Some(limit)) => Some(Form { constant: y.constant + (c / limit).ln(), ..y }),
                    _ => None,
                },
            };
            let Some(form) = form else { continue };
            let (entries, constant) = self.affine(i, form.speed, form.feed, form.constant);
            self.rows.push(&[entries[0], entries[1], (g, -1.0)], constant);
            self.labels.push(Label {
                kind: Kind::Epigraph,
                place: Place::Zone(i),
                limit: 1.0,
                unit: "1",
                plain: false,
                lower: false,
            });
        }
        let mut least = Affines::new();
        least.push(&[(g, 1.0)], 0.0);
        (Objective::Linear(least), 0.0)
    }

    /// The start: the middle of the bounds in logarithms, auxiliary variables where their rows meet it.
    fn middle(&self, start: &mut [f64]) {
        for i in 0..self.case.zones.len() {
            let (u, x) = self.variation.about.map_or_else(|| middle_of(self.case, i), |(at, _)| at[i]);
            for (source, value) in [(self.speed[i], u), (self.feed[i], x)] {
                if let Some(variable) = source.variable {
                    start[variable] = value - source.constant;
                }
            }
        }
        // Auxiliary variables stand above everything they bound.
        for row in 0..self.rows.len() {
            if let Some((aux, _)) = self.rows.entries(row).find(|&(v, a)| v >= self.aux_from() && a < 0.0) {
                let others: f64 = self.rows.value(row, start) + start[aux];
                start[aux] = start[aux].max(others + 0.1);
            }
        }
    }

    fn aux_from(&self) -> usize {
        let v = &self.case.variables;
        let shared = usize::from(matches!(v.speed, SpeedMode::ConstantSpeed | SpeedMode::ConstantRpm))
            + usize::from(v.feed == FeedMode::Constant);
        self.local + shared
    }

    /// Bounds on the step of a linearised program.
    fn trust(&mut self) {
        let Some((at, radius)) = self.variation.about else { return };
        if !radius.is_finite() {
            return;
        }
        for (i, &(u, x)) in at.iter().enumerate() {
            for (v, s, centre) in [(1.0, 0.0, u), (0.0, 1.0, x)] {
                self.row(i, v, s, -centre - radius, Kind::Trust, radius, "1", false);
                self.row(i, -v, -s, centre - radius, Kind::Trust, radius, "1", false);
            }
        }
    }
}

/// Middle of the bounds of a zone, ln V and ln S; the fixed values where they are.
fn middle_of(case: &Case, i: usize) -> (f64, f64) {
    let limits = &case.limits;
    let between = |low: f64, high: f64| 0.5 * (low.ln() + high.ln());
    let u = match case.variables.fixed_speed_m_per_min {
        Some(speed) if case.variables.speed == SpeedMode::Fixed => speed.ln(),
        _ => between(limits.speed_min_m_per_min, limits.speed_max_m_per_min),
    };
    let x = match case.variables.fixed_feed_mm_per_rev {
        Some(feed) if case.variables.feed == FeedMode::Fixed => feed.ln(),
        _ => between(limits.feed_min_mm_per_rev, case.zones[i].feed_max_mm_per_rev),
    };
    (u, x)
}

/// Least ln V over all zones, or least usage, or least time: what breaks a tie (`feed/6.2`).
pub(in crate::feed_schedule) fn second_objective(case: &Case, built: &Built) -> Objective {
    let n = case.zones.len();
    let entry = |source: Source, a: f64| source.variable.map_or((0, 0.0), |variable| (variable, a));
    let is_time = Rates::of(case).is_some();
    let life = case.zones.iter().all(|zone| {
        zone.model(Output::ToolLife).is_some_and(|t| t.bends() == crate::feed_schedule::job::acting::Bend::Straight)
    });
    if is_time && !life {
        let mut form = Affines::new();
        let entries: Vec<(usize, f64)> = built.speed.iter().map(|&source| entry(source, 1.0)).collect();
        form.push(&entries, 0.0);
        return Objective::Linear(form);
    }
    let mut terms = Affines::with_capacity(n, 2 * n);
    for i in 0..n {
        let (v, s, c) = if is_time {
            let form = case.zones[i]
                .model(Output::ToolLife)
                .map_or(Form { constant: 0.0, speed: 0.0, feed: 0.0, log_log: true }, |t| t.form(0.0, 0.0));
            (-1.0 - form.speed, -1.0 - form.feed, -form.constant)
        } else {
            (-1.0, -1.0, 0.0)
        };
        let fixed = |source: Source, a: f64| if a == 0.0 { 0.0 } else { a * source.constant };
        let constant = case.zones[i].work().ln() + c + fixed(built.speed[i], v) + fixed(built.feed[i], s);
        terms.push(&[entry(built.speed[i], v), entry(built.feed[i], s)], constant);
    }
    Objective::Sum(terms)
}
