//! A job in the numbers that the program needs: zones with compliances and acting models, limits, what is least.

use std::sync::Arc;

use crate::calculator::Failure;
use crate::effects::MachinabilityEffect;
use crate::force::Component;
use crate::shaft::FeedDirection;

use crate::feed_schedule::job::acting::{ActingModel, Bend, Form};
use crate::feed_schedule::job::compliance::Held;
use crate::feed_schedule::job::input::{Goal, Job, Limits, Machine, Reference, UsageScope, Variables, Zone};
use crate::feed_schedule::job::models::Output;
use crate::feed_schedule::job::open::OpenModels;
use crate::feed_schedule::job::scatter::{OUTPUT_LIMITS, Scatter};
use crate::feed_schedule::model::risk;

/// What is scheduled.
#[derive(Debug, Clone)]
pub(in crate::feed_schedule) struct Case {
    pub zones: Vec<ZoneCase>,
    pub surfaces: Vec<String>,
    pub machine: Machine,
    pub limits: Limits,
    pub variables: Variables,
    pub goal: Goal,
    /// Which way the tool travels: the order in which edges wear.
    pub direction: FeedDirection,
    pub custom: Vec<CustomCase>,
    pub couplings: Vec<CouplingCase>,
    /// Time of the passes beside the cut, min.
    pub passes_time_min: f64,
    /// By how much less of an edge's median life is used at the job's risk, in its logarithm.
    pub edge_margin: f64,
    /// What edges that are worn out before they are changed cost on average, money per edge.
    pub edge_failures_cost: f64,
    /// The models as they may be by what is not known of the effects.
    pub open: Arc<OpenModels>,
}

/// A zone, or one of its passes.
#[derive(Debug, Clone)]
#[allow(clippy::struct_excessive_bools, reason = "facts of a zone, none a state of another")]
pub(in crate::feed_schedule) struct ZoneCase {
    pub id: String,
    /// Index in the job.
    pub index: usize,
    pub from_mm: f64,
    pub to_mm: f64,
    pub diameter_mm: f64,
    pub depth_mm: f64,
    pub repeat: u32,
    pub surface: usize,
    /// Whether the job names its surface.
    pub names_surface: bool,
    /// The roughing of a split into passes.
    pub is_rough: bool,
    /// The compliance comes from the beam, not from the job.
    pub compliance_is_of_beam: bool,
    /// Largest radial compliance, um/N; `None` where nothing says it.
    pub compliance_um_per_n: Option<f64>,
    pub deflection_max_um: Option<f64>,
    pub roughness_max_um: Option<f64>,
    pub hardening_max_percent: Option<f64>,
    pub hardening_depth_max_um: Option<f64>,
    pub feed_max_mm_per_rev: f64,
    /// What a limit on the feed's gradient leaves to a zone that was found.
    pub ceiling: Option<Ceiling>,
    /// By how much limits on outputs are moved in at the job's risk, in the scale of the model; by [`OUTPUT_LIMITS`].
    pub margins: [Margin; OUTPUT_LIMITS.len()],
    /// Whether the next zone touches this one: a link in the chain of feed steps.
    pub touches_next: bool,
    /// Exponent of the depth in the passive force.
    pub force_depth_exponent: f64,
    /// By [`Output`].
    pub models: [Option<ActingModel>; 6],
    /// Further outputs, in the job's order.
    pub further: Vec<ActingModel>,
}

/// By how much a limit on an output is moved in: so many standard deviations of it.
#[derive(Debug, Clone, PartialEq, Default)]
pub(in crate::feed_schedule) struct Margin {
    deviations: f64,
    scatter: Option<Scatter>,
}

impl Margin {
    pub(in crate::feed_schedule) fn new(deviations: f64, scatter: Scatter) -> Self {
        Self { deviations, scatter: Some(scatter) }
    }

    pub(in crate::feed_schedule) fn bends(&self) -> bool {
        self.scatter.as_ref().is_some_and(Scatter::bends)
    }

    /// Whether it may bend either way.
    pub(in crate::feed_schedule) fn is_mixed(&self) -> bool {
        self.scatter.as_ref().is_some_and(Scatter::is_mixed)
    }

    /// The tangent at ln V, ln S: its constant and what it has by them. Unless it is mixed, upward of it lies nothing but the margin itself,
    /// which is convex where it moves a limit in.
    pub(in crate::feed_schedule) fn form(&self, u: f64, x: f64) -> [f64; 3] {
        let Some(scatter) = &self.scatter else { return [0.0; 3] };
        let (deviation, [by_u, by_x]) = scatter.deviation(u, x);
        [deviation - by_u * u - by_x * x, by_u, by_x].map(|part| self.deviations * part)
    }
}

/// The least of the continuous schedule over a zone: what the zone may not exceed where its feed may change along the
/// shaft by no more than a gradient.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::feed_schedule) struct Ceiling {
    pub feed_mm_per_rev: f64,
    /// Feed per time, where the speed is free.
    pub feed_rate_mm_per_min: Option<f64>,
}

/// A custom limit in one zone.
#[derive(Debug, Clone)]
pub(in crate::feed_schedule) struct CustomCase {
    pub name: String,
    pub zone: usize,
    /// Its power law at the zone's depth.
    pub own: Form,
    /// Index of the further output that it multiplies.
    pub further: Option<usize>,
    pub max: Option<f64>,
    pub min: Option<f64>,
}

/// A coupling over zones.
#[derive(Debug, Clone)]
pub(in crate::feed_schedule) struct CouplingCase {
    pub name: String,
    /// Zone, exponent of speed, exponent of feed.
    pub terms: Vec<(usize, f64, f64)>,
    pub constant: f64,
    pub max: f64,
}

impl ZoneCase {
    /// Length of the cut, mm.
    pub(in crate::feed_schedule) fn length_mm(&self) -> f64 {
        self.to_mm - self.from_mm
    }

    /// A_i = r pi D L/1000: the cutting time is A/(V S), min.
    pub(in crate::feed_schedule) fn work(&self) -> f64 {
        f64::from(self.repeat) * std::f64::consts::PI * self.diameter_mm * self.length_mm() / 1000.0
    }

    /// The acting model of an output.
    pub(in crate::feed_schedule) fn model(&self, output: Output) -> Option<&ActingModel> {
        self.models[output as usize].as_ref()
    }

    /// By how much a limit is moved in.
    pub(in crate::feed_schedule) fn margin(&self, limit: &str) -> Margin {
        OUTPUT_LIMITS
            .iter()
            .position(|one| one.name == limit)
            .map_or_else(Margin::default, |place| self.margins[place].clone())
    }

    /// Compliance that bends, um/N; `None` where there is none to speak of.
    pub(in crate::feed_schedule) fn yields(&self) -> Option<f64> {
        self.compliance_um_per_n.filter(|c| *c > 0.0)
    }
}

/// Models act on depth and angle; the same for whole passes.
pub(in crate::feed_schedule) struct Resolver<'a> {
    job: &'a Job,
    reference: Reference,
}

impl<'a> Resolver<'a> {
    pub(in crate::feed_schedule) fn new(job: &'a Job) -> Self {
        Self { job, reference: job.reference.unwrap_or_default() }
    }

    fn effects(&self, output: &'a str) -> impl Iterator<Item = &'a MachinabilityEffect> {
        self.job.effects.iter().filter(move |effect| effect.output() == Some(output))
    }

    /// The acting models of the known outputs at a depth.
    pub(in crate::feed_schedule) fn models(&self, depth_mm: f64) -> [Option<ActingModel>; 6] {
        Output::ALL.map(|output| self.model(&self.job.effects, output, depth_mm))
    }

    /// That of one of them with these effects.
    pub(in crate::feed_schedule) fn model(
        &self,
        effects: &[MachinabilityEffect],
        output: Output,
        depth_mm: f64,
    ) -> Option<ActingModel> {
        let model = self.job.models.at_depth(output, self.job.force.as_ref(), depth_mm)?;
        let own = effects.iter().filter(|effect| effect.output() == Some(output.name()));
        let angle_deg = self.job.cutting_edge_angle_deg;
        Some(ActingModel::of(&model, own, &self.job.conditions, &self.reference, depth_mm, angle_deg))
    }

    /// The acting models of the further outputs at a depth.
    pub(in crate::feed_schedule) fn further(&self, depth_mm: f64) -> Vec<ActingModel> {
        self.job
            .models
            .further
            .iter()
            .map(|further| {
                ActingModel::of(
                    &further.model,
                    self.effects(&further.name),
                    &self.job.conditions,
                    &self.reference,
                    depth_mm,
                    self.job.cutting_edge_angle_deg,
                )
            })
            .collect()
    }

    /// Exponent of the depth in the passive force at a depth.
    fn depth_exponent(&self, depth_mm: f64) -> f64 {
        if let Some(model) = &self.job.models.force_y {
            return model.depth_exponent;
        }
        let Some(force) = &self.job.force else { return 0.0 };
        let at = |depth_mm| force.monomial_at(Component::Passive, depth_mm).map(|power| power.coefficient.ln());
        let step = 1e-4_f64;
        match (at(depth_mm * (-step).exp()), at(depth_mm * step.exp())) {
            (Some(low), Some(high)) if low.is_finite() && high.is_finite() => (high - low) / (2.0 * step),
            _ => 0.0,
        }
    }

    fn zone(&self, index: usize, zone: &Zone, depth_mm: f64, surface: usize) -> ZoneCase {
        let limits = self.job.limits.as_ref();
        let general = limits.map_or(f64::INFINITY, |limits| limits.feed_max_mm_per_rev);
        let next = self.job.zones.get(index + 1);
        ZoneCase {
            id: zone.id.clone(),
            index,
            from_mm: zone.z_start_mm,
            to_mm: zone.z_end_mm,
            diameter_mm: zone.diameter_mm,
            depth_mm,
            repeat: zone.repeat,
            surface,
            names_surface: zone.surface.is_some(),
            is_rough: false,
            compliance_is_of_beam: zone.compliance_um_per_n.is_none(),
            compliance_um_per_n: zone.compliance_um_per_n,
            deflection_max_um: zone.deflection_max_um,
            roughness_max_um: zone.roughness_max_um,
            hardening_max_percent: zone.hardening_max_percent,
            hardening_depth_max_um: zone.hardening_depth_max_um,
            feed_max_mm_per_rev: zone.feed_max_mm_per_rev.map_or(general, |own| own.min(general)),
            ceiling: None,
            margins: std::array::from_fn(|_| Margin::default()),
            touches_next: next.is_some_and(|next| (next.z_start_mm - zone.z_end_mm).abs() <= TOUCHING_MM),
            force_depth_exponent: self.depth_exponent(depth_mm),
            models: self.models(depth_mm),
            further: self.further(depth_mm),
        }
    }
}

/// Zones nearer than this touch, mm.
pub(in crate::feed_schedule) use crate::shaft::places::SAME_MM as TOUCHING_MM;

/// Names of the surfaces and the surface of every zone.
fn surfaces(job: &Job) -> (Vec<String>, Vec<usize>) {
    let mut names: Vec<String> = Vec::new();
    let of = job
        .zones
        .iter()
        .map(|zone| {
            let name = zone.surface.as_deref().unwrap_or("part");
            names.iter().position(|known| known == name).unwrap_or_else(|| {
                names.push(name.to_owned());
                names.len() - 1
            })
        })
        .collect();
    (names, of)
}

/// Depths of the passes over every zone: what a pass plan tries.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::feed_schedule) struct PassSplit {
    pub roughing_passes: u32,
    pub roughing_mm: f64,
    pub finishing_mm: f64,
}

impl Case {
    /// The job as it stands, in one pass, or in the passes of a split.
    pub(in crate::feed_schedule) fn of(
        job: &Job,
        held: Option<&Held>,
        split: Option<&PassSplit>,
    ) -> Result<Self, Failure> {
        let limits = job.limits.clone().ok_or_else(|| Failure::Internal("a checked job without limits".to_owned()))?;
        let (names, of_zone) = surfaces(job);
        let resolver = Resolver::new(job);
        let stretches: Vec<(f64, f64)> = job.zones.iter().map(|zone| (zone.z_start_mm, zone.z_end_mm)).collect();
        let needed = job.zones.iter().any(|zone| zone.compliance_um_per_n.is_none());
        let beam = held.filter(|_| needed).map(|held| held.largest(&stretches));
        let mut zones = Vec::with_capacity(job.zones.len());
        for (i, zone) in job.zones.iter().enumerate() {
            let mut one = resolver.zone(i, zone, split.map_or(zone.depth_mm, |split| split.finishing_mm), of_zone[i]);
            if one.compliance_um_per_n.is_none() {
                one.compliance_um_per_n = beam.as_ref().map(|beam| beam[i]);
            }
            if let Some(split) = split.filter(|split| split.roughing_passes > 0) {
                zones.push(rough(&resolver, &one, split));
            }
            if split.is_some() {
                one.id = format!("{}:finish", zone.id);
                one.touches_next = false;
            }
            zones.push(one);
        }
        let mut case = Self {
            zones,
            surfaces: names,
            machine: job.machine.clone(),
            limits,
            variables: job.variables.clone(),
            goal: job.objective.clone(),
            direction: job.feed_direction,
            custom: Vec::new(),
            couplings: Vec::new(),
            passes_time_min: 0.0,
            edge_margin: 0.0,
            edge_failures_cost: job.risk.cost_per_edge(),
            open: Arc::new(OpenModels::of(job)?),
        };
        if let (Some(split), Some(plan)) = (split, &job.passes) {
            case.passes_time_min =
                plan.time_per_pass_min * f64::from(split.roughing_passes + 1) * job.zones.len() as f64;
        }
        case.add_custom(job);
        case.add_couplings(job);
        risk::move_in(&mut case, job);
        Ok(case)
    }

    fn add_custom(&mut self, job: &Job) {
        for custom in &job.custom {
            for (i, zone) in self.zones.iter().enumerate() {
                if !meant(&custom.zone, zone, &job.zones[zone.index].id) {
                    continue;
                }
                let constant = custom.constant + custom.depth_exponent * zone.depth_mm.ln();
                self.custom.push(CustomCase {
                    name: custom.name.clone(),
                    zone: i,
                    own: Form { constant, speed: custom.speed_exponent, feed: custom.feed_exponent, log_log: true },
                    further: custom
                        .output
                        .as_ref()
                        .and_then(|name| job.models.further.iter().position(|further| &further.name == name)),
                    max: custom.max,
                    min: custom.min,
                });
            }
        }
    }

    fn add_couplings(&mut self, job: &Job) {
        for coupling in &job.couplings {
            let find =
                |name: &str| self.zones.iter().position(|zone| zone.id == name || zone.id == format!("{name}:finish"));
            let terms: Option<Vec<(usize, f64, f64)>> = coupling
                .terms
                .iter()
                .map(|term| find(&term.zone).map(|zone| (zone, term.speed_exponent, term.feed_exponent)))
                .collect();
            // A split without roughing has no roughing pass to couple.
            let Some(terms) = terms else { continue };
            self.couplings.push(CouplingCase {
                name: coupling.name.clone(),
                terms,
                constant: coupling.constant,
                max: coupling.max,
            });
        }
    }

    /// Usage limits: one over the part, or one per surface; the zones of each.
    pub(in crate::feed_schedule) fn usage_groups(&self) -> Vec<Vec<usize>> {
        match self.limits.tool_usage_scope {
            UsageScope::Part => vec![(0..self.zones.len()).collect()],
            UsageScope::Surface => (0..self.surfaces.len())
                .map(|s| (0..self.zones.len()).filter(|&i| self.zones[i].surface == s).collect())
                .collect(),
        }
    }

    /// Whether any model, or the margin of a limit, bends over speed and feed.
    pub(in crate::feed_schedule) fn bends(&self) -> bool {
        self.models_bend() || self.zones.iter().flat_map(|zone| &zone.margins).any(Margin::bends)
    }

    /// Whether any model does.
    pub(in crate::feed_schedule) fn models_bend(&self) -> bool {
        let mut models = self.zones.iter().flat_map(|zone| zone.models.iter().flatten().chain(&zone.further));
        models.any(|model| model.bends() != Bend::Straight)
    }
}

/// A custom limit holds in a zone that it names, in both its passes, or in all.
fn meant(name: &str, zone: &ZoneCase, of_job: &str) -> bool {
    name == "all" || name == zone.id || name == of_job
}

/// The roughing passes over a zone.
fn rough(resolver: &Resolver<'_>, finish: &ZoneCase, split: &PassSplit) -> ZoneCase {
    ZoneCase {
        id: format!("{}:rough", finish.id),
        depth_mm: split.roughing_mm,
        is_rough: true,
        repeat: finish.repeat.saturating_mul(split.roughing_passes),
        deflection_max_um: None,
        roughness_max_um: None,
        hardening_max_percent: None,
        hardening_depth_max_um: None,
        touches_next: false,
        models: resolver.models(split.roughing_mm),
        further: resolver.further(split.roughing_mm),
        ..finish.clone()
    }
}
