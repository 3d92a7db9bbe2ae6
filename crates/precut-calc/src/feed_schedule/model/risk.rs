//! Schedules at a stated risk (`certainty/5`): limits moved in by so many standard deviations that results pass them no more
//! often than is accepted; over all limits of a part together where that is what is stated.

use std::borrow::Cow;

use serde::{Deserialize, Serialize};
use utoipa::ToSchema;

use crate::calculator::{Failure, Finding, Monitor, Violations, checkpoint};
use crate::certainty::normal_below;
use crate::num::gp::{self, Affines, Objective, Solution};

use crate::feed_schedule::job::case::{Case, Margin, ZoneCase};
use crate::feed_schedule::job::compliance::Held;
use crate::feed_schedule::job::input::{Goal, Job};
use crate::feed_schedule::job::models::Output;
use crate::feed_schedule::job::plan::Method;
use crate::feed_schedule::job::scatter::{OUTPUT_LIMITS, Scatter, deviations, scatter};
use crate::feed_schedule::model::program::{Built, Kind, Place, Variation, build};
use crate::feed_schedule::model::solve::{Solved, Unsolved, convex, finish, safer, solve};

/// Codes of the faults found here.
pub(in crate::feed_schedule) const CODES: &[&str] = &["joint_risk_elsewhere", "scrap_without_cost"];
/// Codes of the failures told here.
pub(in crate::feed_schedule) const FAILURE_CODES: &[&str] = &["infeasible_at_this_risk"];

/// Largest risk that can be asked for: beyond it a limit would move out.
const MOST: f64 = 0.5;
/// Most tangents by which a joint risk is held, and by how much of itself it may be passed.
const ROUNDS: u32 = 200;
const SHARED: f64 = 1e-6;
/// Linearisations end at steps of ln V, ln S below this.
const SETTLED: f64 = 1e-7;
/// A share of the risk below this is none.
const NOTHING: f64 = 1e-4;
/// Steps over speed and over feed in which the largest deviation of an edge's life is looked for where it may bend either way.
const EDGE_STEPS: usize = 8;
/// Halvings in which the least risk is found.
const HALVINGS: u32 = 30;
/// Steps in which the largest joint probability is found.
const STEPS: u32 = 80;
/// The risk that costs least is looked for between these, and found to this share of itself.
const COSTS_LEAST: (f64, f64, f64) = (1e-6, 0.3, 1e-4);

/// With which probability results may pass their limits, because they scatter about their models.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize, ToSchema)]
#[serde(tag = "kind", rename_all = "snake_case", deny_unknown_fields)]
#[schema(as = ScheduleRisk)]
pub enum Risk {
    /// The limits hold for what the models expect: where one binds, every second result passes it.
    None {},
    /// Each limit of each zone may be passed with this probability.
    Each {
        /// Of an output in a zone.
        #[schema(exclusive_minimum = 0.0, exclusive_maximum = 50.0, example = 1.0, extensions(("x-unit" = json!("percent")), ("x-symbol" = json!("alpha"))))]
        risk_percent: f64,
        /// Of an edge that is worn out before it is changed; not said: edges are used as far as their median life allows.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schema(exclusive_minimum = 0.0, exclusive_maximum = 50.0, example = 2.0, extensions(("x-unit" = json!("percent")), ("x-symbol" = json!("alpha_e"))))]
        edge_risk_percent: Option<f64>,
        /// What an edge that is worn out before it is changed costs beside itself, in the money of the objective: it is paid with the
        /// probability of that.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schema(exclusive_minimum = 0.0, maximum = 1e9, example = 80.0, extensions(("x-unit" = json!("money")), ("x-symbol" = json!("k_f"))))]
        edge_failure_cost: Option<f64>,
    },
    /// At least one limit of a part may be passed with this probability: it is shared out as costs least.
    Joint {
        /// Of a part.
        #[schema(exclusive_minimum = 0.0, exclusive_maximum = 50.0, example = 1.0, extensions(("x-unit" = json!("percent")), ("x-symbol" = json!("alpha"))))]
        risk_percent: f64,
        /// Of an edge that is worn out before it is changed; not said: edges are used as far as their median life allows.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schema(exclusive_minimum = 0.0, exclusive_maximum = 50.0, example = 2.0, extensions(("x-unit" = json!("percent")), ("x-symbol" = json!("alpha_e"))))]
        edge_risk_percent: Option<f64>,
        /// What an edge that is worn out before it is changed costs beside itself, in the money of the objective: it is paid with the
        /// probability of that.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schema(exclusive_minimum = 0.0, maximum = 1e9, example = 80.0, extensions(("x-unit" = json!("money")), ("x-symbol" = json!("k_f"))))]
        edge_failure_cost: Option<f64>,
    },
    /// The joint risk at which the objective and the parts that are lost cost least together.
    LeastCost {
        /// What a part that passes a limit costs, in the money of the objective.
        #[schema(exclusive_minimum = 0.0, maximum = 1e9, example = 30.0, extensions(("x-unit" = json!("money")), ("x-symbol" = json!("k_s"))))]
        scrap_cost: f64,
        /// Of an edge that is worn out before it is changed; not said: edges are used as far as their median life allows.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schema(exclusive_minimum = 0.0, exclusive_maximum = 50.0, example = 2.0, extensions(("x-unit" = json!("percent")), ("x-symbol" = json!("alpha_e"))))]
        edge_risk_percent: Option<f64>,
        /// What an edge that is worn out before it is changed costs beside itself, in the money of the objective: it is paid with the
        /// probability of that.
        #[serde(default, skip_serializing_if = "Option::is_none")]
        #[schema(exclusive_minimum = 0.0, maximum = 1e9, example = 80.0, extensions(("x-unit" = json!("money")), ("x-symbol" = json!("k_f"))))]
        edge_failure_cost: Option<f64>,
    },
}

impl Default for Risk {
    fn default() -> Self {
        Self::None {}
    }
}

impl Risk {
    /// Its name, as in the contract.
    pub(in crate::feed_schedule) fn name(self) -> &'static str {
        match self {
            Self::None {} => "none",
            Self::Each { .. } => "each",
            Self::Joint { .. } => "joint",
            Self::LeastCost { .. } => "least_cost",
        }
    }

    /// Of the limits of a part, as a share.
    pub(in crate::feed_schedule) fn of_part(self) -> Option<f64> {
        match self {
            Self::None {} | Self::LeastCost { .. } => None,
            Self::Each { risk_percent, .. } | Self::Joint { risk_percent, .. } => Some(risk_percent / 100.0),
        }
    }

    /// Of an edge, as a share.
    pub(in crate::feed_schedule) fn of_edges(self) -> Option<f64> {
        match self {
            Self::None {} => None,
            Self::Each { edge_risk_percent, .. }
            | Self::Joint { edge_risk_percent, .. }
            | Self::LeastCost { edge_risk_percent, .. } => Some(edge_risk_percent? / 100.0),
        }
    }

    /// What edges that are worn out before they are changed cost on average, money per edge.
    pub(in crate::feed_schedule) fn cost_per_edge(self) -> f64 {
        self.edge_failure_cost().zip(self.of_edges()).map_or(0.0, |(cost, risk)| cost * risk)
    }

    fn edge_failure_cost(self) -> Option<f64> {
        match self {
            Self::None {} => None,
            Self::Each { edge_failure_cost, .. }
            | Self::Joint { edge_failure_cost, .. }
            | Self::LeastCost { edge_failure_cost, .. } => edge_failure_cost,
        }
    }

    fn with_part(self, risk: f64) -> Self {
        let mut changed = self;
        if let Self::Each { risk_percent, .. } | Self::Joint { risk_percent, .. } = &mut changed {
            *risk_percent = 100.0 * risk;
        }
        changed
    }
}

/// Finds a joint risk where it is not shared out.
pub(in crate::feed_schedule) fn check(job: &Job, violations: &mut Violations) {
    let has_whole_edges = job.limits.as_ref().is_some_and(|limits| limits.whole_edges || limits.whole_parts_per_edge);
    let is_plain = matches!(job.method, Method::Optimal) && job.passes.is_none() && job.trade_off.is_none();
    let is_shared = is_plain && !has_whole_edges;
    violations.require(is_shared || !matches!(job.risk, Risk::Joint { .. } | Risk::LeastCost { .. }), || {
        Finding::new("joint_risk_elsewhere", "/risk/kind")
    });
    let is_money = matches!(job.objective, Goal::Cost { .. });
    violations.require(is_money || !matches!(job.risk, Risk::LeastCost { .. }), || {
        Finding::new("scrap_without_cost", "/objective/kind").with("objective", job.objective.name())
    });
    if job.risk.edge_failure_cost().is_some() {
        violations.require(is_money, || {
            Finding::new("edge_failure_without_cost", "/objective/kind").with("objective", job.objective.name())
        });
        violations.require(job.risk.of_edges().is_some(), || {
            Finding::new("edge_failure_without_risk", "/risk/edge_failure_cost")
        });
    }
    for (i, _) in job.zones.iter().enumerate().filter(|(_, zone)| zone.risk_percent.is_some()) {
        violations.require(matches!(job.risk, Risk::Each { .. }), || {
            Finding::new("zone_risk_without_each", format!("/zones/{i}/risk_percent"))
        });
    }
}

impl Job {
    /// The risk of every limit of a zone, as a share: its own, else that of all.
    pub(in crate::feed_schedule) fn risk_in_zone(&self, zone: usize) -> Option<f64> {
        let own = self.zones.get(zone).and_then(|zone| zone.risk_percent).map(|percent| percent / 100.0);
        self.risk.of_part().map(|risk| own.unwrap_or(risk))
    }

    /// The least of them.
    fn least_risk(&self) -> Option<f64> {
        (0..self.zones.len()).filter_map(|zone| self.risk_in_zone(zone)).chain(self.risk.of_part()).reduce(f64::min)
    }

    /// The same with no limit at less than a risk.
    fn at_risk(&self, risk: f64) -> Self {
        let mut raised = Self { risk: self.risk.with_part(risk), ..self.clone() };
        for own in raised.zones.iter_mut().filter_map(|zone| zone.risk_percent.as_mut()) {
            *own = own.max(100.0 * risk);
        }
        raised
    }
}

/// The job with the risk that costs least in place of the wish for it: there the objective falls by as much as the parts cost
/// that are lost, -df/d alpha = scrap cost (`certainty/5.4`).
pub(in crate::feed_schedule) fn acting<'j>(
    job: &'j Job,
    held: Option<&Held>,
    monitor: &dyn Monitor,
) -> Result<Cow<'j, Job>, Unsolved> {
    let Risk::LeastCost { scrap_cost, edge_risk_percent, edge_failure_cost } = job.risk else {
        return Ok(Cow::Borrowed(job));
    };
    let at = |alpha: f64| {
        let risk = Risk::Joint { risk_percent: 100.0 * alpha, edge_risk_percent, edge_failure_cost };
        Job { risk, ..job.clone() }
    };
    // How much more the objective falls with a risk than the lost parts cost.
    let excess = |alpha: f64| -> Result<f64, Unsolved> {
        let job = at(alpha);
        let (_, solved, worth) = solved(Case::of(&job, held, None)?, &job, held, monitor)?;
        Ok(solved.objective * worth.unwrap_or(0.0) / alpha - scrap_cost)
    };
    let (mut low, mut high) = (COSTS_LEAST.0.ln(), COSTS_LEAST.1.ln());
    while high - low > COSTS_LEAST.2 {
        checkpoint(monitor)?;
        let middle = 0.5 * (low + high);
        match excess(middle.exp()) {
            Ok(excess) if excess < 0.0 => high = middle,
            // Where no schedule keeps so small a risk, a larger one is needed whatever it costs.
            Ok(_) | Err(Unsolved::Failed(Failure::OutOfModel(_))) => low = middle,
            Err(unsolved) => return Err(unsolved),
        }
    }
    Ok(Cow::Owned(at(high.exp())))
}

/// Whether a risk that was found to cost least lies at an end of where it was looked for: beyond it another one may cost less.
pub(in crate::feed_schedule) fn is_at_an_end(percent: f64) -> bool {
    let near = |end: f64| (0.01 * percent / end).ln().abs() < 2.0 * COSTS_LEAST.2;
    near(COSTS_LEAST.0) || near(COSTS_LEAST.1)
}

/// A limit of a part whose output scatters: its zone, its place among [`OUTPUT_LIMITS`], and how.
#[derive(Debug, Clone)]
struct Scattered {
    zone: usize,
    limit: usize,
    scatter: Scatter,
}

impl Scattered {
    fn name(&self) -> &'static str {
        OUTPUT_LIMITS[self.limit].name
    }

    /// Its standard deviation at a schedule, and the slopes of that over ln V and ln S.
    fn deviation(&self, at: &[(f64, f64)]) -> (f64, [f64; 2]) {
        let (u, x) = at[self.zone];
        self.scatter.deviation(u, x)
    }
}

fn scattered(case: &Case, job: &Job) -> Vec<Scattered> {
    let mut all = Vec::new();
    for (zone, of) in case.zones.iter().enumerate() {
        for (place, limit) in OUTPUT_LIMITS.iter().enumerate() {
            let is_limited = of.model(limit.output).is_some() && (limit.limit)(case, of).is_some();
            if let (true, Some(scatter)) = (is_limited, scatter(job, &case.open, limit.output, of.depth_mm)) {
                all.push(Scattered { zone, limit: place, scatter });
            }
        }
    }
    all
}

/// Limits moved in by what the job's risk asks for; a joint one is shared evenly, until it is shared out.
pub(in crate::feed_schedule) fn move_in(case: &mut Case, job: &Job) {
    if let Some(risk) = job.risk.of_edges() {
        case.edge_margin = case.zones.iter().filter_map(|zone| of_edges(case, zone, job, risk)).fold(0.0, f64::max);
    }
    let Some(risk) = job.risk.of_part() else { return };
    let all = scattered(case, job);
    for one in &all {
        let own = match job.risk {
            Risk::Joint { .. } => -((-risk).ln_1p() / all.len().max(1) as f64).exp_m1(),
            _ => job.risk_in_zone(case.zones[one.zone].index).unwrap_or(risk),
        };
        case.zones[one.zone].margins[one.limit] = Margin::new(one.scatter.deviations(own), one.scatter.clone());
    }
}

/// By how much less of the life of an edge is used in a zone: where coefficients are uncertain by the largest that they bring at any
/// speed and feed that are allowed, so that the risk is never above the stated one.
fn of_edges(case: &Case, zone: &ZoneCase, job: &Job, risk: f64) -> Option<f64> {
    let scatter = scatter(job, &case.open, Output::ToolLife, zone.depth_mm)?;
    let limits = &case.limits;
    // A deviation that bends upward is largest in a corner.
    let steps = if scatter.is_mixed() { EDGE_STEPS } else { 1 };
    let along = |from: f64, to: f64| (0..=steps).map(move |k| from + (to - from) * k as f64 / steps as f64);
    let [slowest, fastest] = [limits.speed_min_m_per_min, limits.speed_max_m_per_min].map(f64::ln);
    let [least, most] = [limits.feed_min_mm_per_rev, zone.feed_max_mm_per_rev].map(f64::ln);
    let places = along(slowest, fastest).flat_map(|u| along(least, most).map(move |x| (u, x)));
    let largest = places.map(|(u, x)| scatter.deviation(u, x).0).fold(0.0, f64::max);
    Some(scatter.deviations(risk) * largest)
}

/// The schedule of a case with its risk shared out, and what a percent of that risk is worth.
pub(in crate::feed_schedule) fn solved(
    case: Case,
    job: &Job,
    held: Option<&Held>,
    monitor: &dyn Monitor,
) -> Result<(Case, Solved, Option<f64>), Unsolved> {
    let Some(risk) = job.risk.of_part() else {
        let solved = solve(&case, true, monitor)?;
        return Ok((case, solved, None));
    };
    let all = scattered(&case, job);
    if matches!(job.risk, Risk::Joint { .. }) && !all.is_empty() {
        let is_common = all.iter().any(|one| one.scatter.bends());
        // d budget/d ln alpha.
        let (budget, slope) = if is_common { (risk, risk) } else { (-(-risk).ln_1p(), risk / (1.0 - risk)) };
        let mut sharing = Sharing { case, all, budget, is_common, monitor };
        let (solved, worth) = sharing.shared_out(job, held)?;
        return Ok((sharing.case, solved, Some(worth * slope)));
    }
    match solve(&case, true, monitor) {
        Ok(solved) => {
            // d ln f/d ln alpha over all limits that have no risk of their own: each moves by s alpha/phi(q).
            let has_own = |one: &&Scattered| {
                job.zones.get(case.zones[one.zone].index).is_some_and(|zone| zone.risk_percent.is_some())
            };
            let slope = |one: &Scattered| {
                one.deviation(&solved.at).0 * risk / one.scatter.density(one.scatter.deviations(risk))
            };
            let worth = all.iter().filter(|one| !has_own(one)).map(|one| multiplier(&solved, one) * slope(one)).sum();
            Ok((case, solved, Some(worth)))
        }
        Err(Unsolved::Infeasible(found)) => {
            let least = least_of_each(job, held, monitor)?;
            Err(least.map_or(Unsolved::Infeasible(found), |least| at_this_risk(job, least)))
        }
        Err(failed) => Err(failed),
    }
}

/// Percent of the objective per percent of a limit, or per unit of one that is not in logarithms.
fn multiplier(solved: &Solved, of: &Scattered) -> f64 {
    let rows = solved.built.rows.iter().zip(&solved.certificate.row_multipliers);
    let is_it = |kind: &Kind, place: &Place| *place == Place::Zone(of.zone) && kind.name() == of.name();
    rows.filter(|(label, _)| is_it(&label.kind, &label.place)).map(|(_, price)| price * solved.elasticity).sum()
}

/// Largest step between two schedules, in logarithms.
fn furthest(one: &[(f64, f64)], other: &[(f64, f64)]) -> f64 {
    one.iter().zip(other).map(|(a, b)| (a.0 - b.0).abs().max((a.1 - b.1).abs())).fold(0.0, f64::max)
}

fn density(x: f64) -> f64 {
    (-0.5 * x * x).exp() / (2.0 * std::f64::consts::PI).sqrt()
}

/// How fast the logarithm of the probability rises with the distance of a limit in deviations.
fn hazard(t: f64) -> f64 {
    density(t) / normal_below(t)
}

fn at_this_risk(job: &Job, least: f64) -> Unsolved {
    let asked = job.least_risk().unwrap_or(0.0);
    let finding = Finding::new("infeasible_at_this_risk", "/risk")
        .measured(100.0 * asked, 100.0 * least, "percent")
        .with("least_risk_percent", 100.0 * least);
    Unsolved::Failed(Failure::OutOfModel(finding))
}

/// The least risk of each limit at which there is a schedule; `None` where none is found below a half.
fn least_of_each(job: &Job, held: Option<&Held>, monitor: &dyn Monitor) -> Result<Option<f64>, Failure> {
    let is_possible = |risk: f64| -> Result<bool, Failure> {
        let case = Case::of(&job.at_risk(risk), held, None)?;
        match solve(&case, false, monitor) {
            Ok(_) => Ok(true),
            Err(Unsolved::Failed(Failure::Cancelled)) => Err(Failure::Cancelled),
            Err(_) => Ok(false),
        }
    };
    let (mut no, mut yes) = (deviations(job.least_risk().unwrap_or(MOST)), deviations(0.999 * MOST));
    if !is_possible(normal_below(-yes))? {
        return Ok(None);
    }
    for _ in 0..HALVINGS {
        let middle = 0.5 * (no + yes);
        if is_possible(normal_below(-middle))? {
            yes = middle;
        } else {
            no = middle;
        }
    }
    Ok(Some(normal_below(-yes)))
}

/// A joint risk among the limits of a part: with b_k = -ln Phi(t_k) the sum of all b is at most -ln(1 - alpha), exact where
/// results scatter independently; with coefficients that are common to them b_k = Phi(-t_k) and at most alpha, whatever goes
/// together (`certainty/5.3`). That sum is convex over the logarithms of speed and feed: it is held by tangents, each at the
/// optimum of those before (Kelley 1960), until the optimum keeps it.
struct Sharing<'a> {
    case: Case,
    all: Vec<Scattered>,
    budget: f64,
    /// Whether coefficients that limits have in common are uncertain.
    is_common: bool,
    monitor: &'a dyn Monitor,
}

/// What the limits of a part use of a joint risk at a schedule.
struct Shares {
    at: Vec<(f64, f64)>,
    /// Row of every limit in the program, and its distance in deviations.
    rows: Vec<(usize, f64)>,
    sum: f64,
}

impl Sharing<'_> {
    /// The schedule, and what the budget is worth: d ln(objective) over d budget.
    fn shared_out(&mut self, job: &Job, held: Option<&Held>) -> Result<(Solved, f64), Unsolved> {
        let mut plain = Case::of(&Job { risk: Risk::None {}, ..job.clone() }, held, None)?;
        // Edges have a risk of their own beside it.
        plain.edge_margin = self.case.edge_margin;
        let first = self.shares_at(&plain, solve(&plain, true, self.monitor)?.at);
        let mut tangents = Affines::new();
        self.touch(&plain, &first, &mut tangents);
        let mut about = first.at.clone();
        let safest = self.safest(&plain, first)?;
        if safest.sum > self.budget {
            let least = if self.is_common { safest.sum } else { -(-safest.sum).exp_m1() };
            return Err(at_this_risk(job, least));
        }
        self.touch(&plain, &safest, &mut tangents);
        for _ in 0..ROUNDS {
            checkpoint(self.monitor)?;
            let (built, solution, conic) = self.within(&plain, &tangents, &about)?;
            let at = (0..plain.zones.len()).map(|i| (built.speed[i].at(&solution.y), built.feed[i].at(&solution.y)));
            let shares = self.shares_at(&plain, at.collect());
            // Models that bend are straight only where they were linearised.
            let is_there = !(plain.bends() || self.is_common) || furthest(&shares.at, &about) < SETTLED;
            if is_there && shares.sum <= self.budget * (1.0 + SHARED) {
                return Ok(self.settled(&plain, built, solution, shares, conic));
            }
            self.touch(&plain, &shares, &mut tangents);
            about = shares.at;
        }
        Err(Unsolved::Failed(Failure::NotConverged {
            what: "the sharing of the risk",
            residual: f64::INFINITY,
            iterations: ROUNDS,
        }))
    }

    /// Adds the tangent of the sum at a schedule, in units of the budget.
    fn touch(&self, plain: &Case, at: &Shares, tangents: &mut Affines) {
        let built = build(plain, &Variation { about: Some((&at.at, f64::INFINITY)), ..Variation::default() });
        let rows = &built.program.rows;
        let mut sums = vec![0.0; built.program.variables()];
        let mut constant = at.sum - self.budget;
        for (one, (row, t)) in self.all.iter().zip(&at.rows) {
            let (deviation, by) = one.deviation(&at.at);
            let slope = self.slope(one, *t) / deviation;
            constant += slope * (rows.constant(*row) - rows.value(*row, &built.program.start));
            rows.entries(*row).for_each(|(variable, a)| sums[variable] += slope * a);
            // The limit comes nearer, too, where the deviation grows.
            let (u, x) = at.at[one.zone];
            for (source, by, here) in [(built.speed[one.zone], by[0], u), (built.feed[one.zone], by[1], x)] {
                if let Some(variable) = source.variable {
                    sums[variable] += slope * t * by;
                    constant -= slope * t * by * (here - source.constant);
                }
            }
        }
        let entries: Vec<(usize, f64)> =
            sums.into_iter().enumerate().filter(|(_, a)| a.abs() > 0.0).map(|(v, a)| (v, a / self.budget)).collect();
        tangents.push(&entries, constant / self.budget);
    }

    /// The best schedule within the tangents.
    fn within(
        &self,
        plain: &Case,
        tangents: &Affines,
        about: &[(f64, f64)],
    ) -> Result<(Built, Solution, bool), Failure> {
        checkpoint(self.monitor)?;
        let built = build(plain, &Variation { about: Some((about, f64::INFINITY)), ..Variation::default() });
        let mut program = built.program.clone();
        for tangent in 0..tangents.len() {
            program.rows.push(&tangents.entries(tangent).collect::<Vec<_>>(), tangents.constant(tangent));
        }
        let (solution, conic) = safer(&program)?.ok_or(Failure::NotConverged {
            what: "the sharing of the risk",
            residual: f64::INFINITY,
            iterations: ROUNDS,
        })?;
        Ok((built, solution, conic))
    }

    /// The schedule as if each limit had been moved in by its share: its multiplier is that of the budget times h/sigma.
    fn settled(
        &mut self,
        plain: &Case,
        built: Built,
        mut solution: Solution,
        shares: Shares,
        conic: bool,
    ) -> (Solved, f64) {
        let count = built.rows.len();
        let of_tangents: f64 = solution.row_multipliers.drain(count..).sum::<f64>() / self.budget;
        solution.row_slacks.truncate(count);
        for (one, (row, t)) in self.all.iter().zip(&shares.rows) {
            solution.row_multipliers[*row] += of_tangents * self.slope(one, *t) / one.deviation(&shares.at).0;
            solution.row_slacks[*row] = 0.0;
            // Those that take next to nothing of the risk need not stand where they are.
            let most = deviations(NOTHING * self.budget);
            self.case.zones[one.zone].margins[one.limit] = Margin::new(t.min(most), one.scatter.clone());
        }
        let mut solved = finish(plain, built, solution, shares.at, false, &Variation::default(), conic);
        solved.shares_risk = true;
        solved.local = !convex(plain);
        let worth = of_tangents * solved.elasticity;
        (solved, worth)
    }

    /// The schedule that most probably keeps all limits: by tangents within a shrinking range.
    fn safest(&self, plain: &Case, first: Shares) -> Result<Shares, Unsolved> {
        let mut best = first;
        let mut radius = 0.5;
        for _ in 0..STEPS {
            checkpoint(self.monitor)?;
            let Some(next) = self.toward(plain, &best.at, radius) else { break };
            let next = self.shares_at(plain, next);
            if next.sum < best.sum {
                best = next;
            } else {
                radius *= 0.4;
            }
            if radius < 1e-9 {
                break;
            }
        }
        Ok(best)
    }

    /// What the limits use at a schedule.
    fn shares_at(&self, plain: &Case, at: Vec<(f64, f64)>) -> Shares {
        let rows = self.rows_at(plain, &at);
        let sum = self.all.iter().zip(&rows).map(|(one, (_, t))| self.used(one, *t)).sum();
        Shares { at, rows, sum }
    }

    /// What a limit takes of the budget at so many deviations.
    fn used(&self, one: &Scattered, t: f64) -> f64 {
        if self.is_common { one.scatter.tail(t) } else { -(-normal_below(-t)).ln_1p() }
    }

    /// How fast that falls with them.
    fn slope(&self, one: &Scattered, t: f64) -> f64 {
        if self.is_common { one.scatter.density(t) } else { hazard(t) }
    }

    /// The row of every scattered limit in the program about a schedule, and its distance in deviations there.
    fn rows_at(&self, plain: &Case, at: &[(f64, f64)]) -> Vec<(usize, f64)> {
        let built = build(plain, &Variation { about: Some((at, f64::INFINITY)), ..Variation::default() });
        let y = &built.program.start;
        // Every limit that scatters has a row: both follow from the same models and limits.
        let row_of = |one: &Scattered| {
            let is_it = |label: &crate::feed_schedule::model::program::Label| {
                label.place == Place::Zone(one.zone) && label.kind.name() == one.name()
            };
            built.rows.iter().position(is_it).unwrap_or(0)
        };
        let of = |one: &Scattered| {
            let row = row_of(one);
            (row, -built.program.rows.value(row, y) / one.deviation(at).0)
        };
        self.all.iter().map(of).collect()
    }

    /// The schedule within a range of one that is most probable by the tangents there.
    fn toward(&self, plain: &Case, at: &[(f64, f64)], radius: f64) -> Option<Vec<(f64, f64)>> {
        let variation = Variation { about: Some((at, radius)), ..Variation::default() };
        let mut built = build(plain, &variation);
        let mut sums = vec![0.0; built.program.variables()];
        for (one, (row, t)) in self.all.iter().zip(self.rows_at(plain, at)) {
            for (variable, a) in built.program.rows.entries(row) {
                sums[variable] += self.slope(one, t) / one.deviation(at).0 * a;
            }
        }
        let entries: Vec<(usize, f64)> = sums.into_iter().enumerate().filter(|(_, a)| a.abs() > 0.0).collect();
        if entries.is_empty() {
            return None;
        }
        let mut least = Affines::new();
        least.push(&entries, 0.0);
        built.program.objective = Objective::Linear(least);
        let found = gp::minimise(&built.program, &gp::Settings::default())
            .ok()
            .or_else(|| [1e-9, 1e-8, 1e-7].iter().find_map(|&most| gp::conic::minimise(&built.program, most).ok()));
        found.map(|solution| {
            let of = |i: usize| (built.speed[i].at(&solution.y), built.feed[i].at(&solution.y));
            (0..plain.zones.len()).map(of).collect()
        })
    }
}
