//! Zones that are found: the continuous schedule, and the fewest zones within a stated loss (`feed/8`).

use crate::calculator::{Failure, Message, Monitor, checkpoint};
use crate::num::gp;

use crate::feed_schedule::answer::output::{Continuous, SegmentTime};
use crate::feed_schedule::job::acting::Bend;
use crate::feed_schedule::job::case::{Case, Ceiling, ZoneCase};
use crate::feed_schedule::job::compliance::Held;
use crate::feed_schedule::job::input::{Goal, Job, SpeedMode, UsageScope};
use crate::feed_schedule::job::models::Output;
use crate::feed_schedule::job::segments::{self, Grid};
use crate::feed_schedule::model::program::{Variation, build};
use crate::feed_schedule::model::solve::{Solved, Unsolved, solve};

/// What the method was told.
#[derive(Debug, Clone, Copy, PartialEq)]
pub(in crate::feed_schedule) struct Asked {
    pub grid_points: usize,
    pub loss_percent: f64,
    pub segments_max: usize,
    pub gradient_per_mm: Option<f64>,
}

/// Zones that were found, with their schedule.
pub(in crate::feed_schedule) struct Zoned {
    pub case: Case,
    pub solved: Solved,
    pub outcome: Continuous,
    /// What made them, where a gradient ties their feeds to the limits at other places.
    pub smooth: Option<Smooth>,
}

/// Zones under a limit on the gradient, to be asked for under other limits.
pub(in crate::feed_schedule) struct Smooth {
    base: Case,
    grid: Grid,
    cut: segments::Cut,
    gradient_per_mm: f64,
}

impl Smooth {
    /// The same zones under changed limits; `None` where no continuous schedule keeps these.
    pub(in crate::feed_schedule) fn changed(
        &self,
        change: &dyn Fn(&mut Case),
        held: Option<&Held>,
        monitor: &dyn Monitor,
    ) -> Result<Option<Case>, Failure> {
        let mut base = self.base.clone();
        change(&mut base);
        let field = field(&base, &self.grid, held, Some(self.gradient_per_mm), monitor)?;
        Ok(field.map(|field| case_of_cut(&base, &self.grid, &self.cut, field.ceilings.as_ref(), held)))
    }
}

/// The found zones with their schedule.
pub(in crate::feed_schedule) fn find(
    job: &Job,
    asked: &Asked,
    held: Option<&Held>,
    monitor: &dyn Monitor,
) -> Result<Zoned, Unsolved> {
    let base = Case::of(job, held, None)?;
    let grid = points(&base, job, asked.grid_points);
    monitor.progress(0.1, Message::new("stage_continuous"));
    let Some(field) = field(&base, &grid, held, asked.gradient_per_mm, monitor)? else {
        return Err(none(&base, monitor));
    };
    monitor.progress(0.5, Message::new("stage_segments"));
    let cuts = segments::cut(&grid, &field.cost, asked.segments_max, monitor)?;
    let forced = grid.stretches.len();
    if cuts.is_empty() {
        return Err(Failure::OutOfModel(
            crate::calculator::Finding::new("too_few_segments", "/method/segments_max").measured(
                asked.segments_max as f64,
                forced as f64,
                "1",
            ),
        )
        .into());
    }
    choose(base, grid, &field, &cuts, asked, held, monitor)
}

/// The continuous schedule; `None` where no schedule keeps the limits.
fn field(
    base: &Case,
    grid: &Grid,
    held: Option<&Held>,
    gradient: Option<f64>,
    monitor: &dyn Monitor,
) -> Result<Option<Field>, Failure> {
    let explicit = if is_explicit(base) { explicit(base, grid, held, gradient) } else { None };
    match explicit {
        Some(field) => Ok(Some(field)),
        None => by_program(base, grid, held, gradient, monitor),
    }
}

/// The continuous schedule on the grid.
struct Field {
    /// ln S at every point, from the left and from the right of a border the same.
    ln_feed: Vec<f64>,
    speed_m_per_min: Option<f64>,
    time_min: f64,
    /// Time per length at every point.
    cost: Vec<f64>,
    /// The times of the cuts are final: speed is given and nothing couples the zones.
    exact_cuts: bool,
    /// What a gradient leaves to zones.
    ceilings: Option<Ceilings>,
}

/// The continuous schedule under a gradient over every cell, each named by its right point.
///
/// A zone has one feed, and feeds that change in steps have no gradient: what can be kept of it is that they nowhere
/// exceed a schedule that has none steeper. So the zones honour it too where they are few, and cannot be faster.
struct Ceilings {
    ln_feed: Vec<f64>,
    /// ln(feed times speed), where the speed is free.
    ln_rate: Option<Vec<f64>>,
}

impl Ceilings {
    /// What is left to a zone over points from one to another.
    fn over(&self, (first, last): (usize, usize), diameter_mm: f64) -> Ceiling {
        let least = |of: &[f64]| (of[first + 1..=last].iter().copied().fold(f64::INFINITY, f64::min) + ABOVE).exp();
        let per_speed = 1000.0 / (std::f64::consts::PI * diameter_mm);
        Ceiling {
            feed_mm_per_rev: least(&self.ln_feed),
            feed_rate_mm_per_min: self.ln_rate.as_ref().map(|ln_rate| per_speed * least(ln_rate)),
        }
    }
}

/// How far above the continuous schedule a ceiling stands, in logarithms: where a zone's own limits allow no more than
/// the schedule has there, it is they that bind, and have the price. Zones may be faster by this share at most.
const ABOVE: f64 = 1e-6;

/// The lesser of both ends of every cell, by its right point.
fn of_cells(points: &[f64]) -> Vec<f64> {
    (0..points.len()).map(|k| if k == 0 { points[0] } else { points[k - 1].min(points[k]) }).collect()
}

/// No limit couples the points and the speed is given: the feed is explicit.
fn is_explicit(case: &Case) -> bool {
    let time = matches!(case.goal, Goal::Time { tool_change_time_min, .. } if tool_change_time_min <= 0.0);
    let limits = &case.limits;
    case.variables.speed == SpeedMode::Fixed
        && time
        && limits.time_max_min.is_none()
        && limits.deflection_spread_ratio_max.is_none()
        && (limits.tool_usage_max.is_none() || limits.tool_usage_scope == UsageScope::Part)
        && !case.bends()
}

/// Points over all stretches of constant diameter and zone, by their length.
fn points(case: &Case, job: &Job, count: usize) -> Grid {
    let mut steps = vec![0.0];
    if let Some(shaft) = &job.shaft {
        for segment in &shaft.segments {
            steps.push(steps.last().copied().unwrap_or(0.0) + segment.length_mm);
        }
    }
    let mut stretches: Vec<(usize, f64, f64)> = Vec::new();
    for (i, zone) in case.zones.iter().enumerate() {
        let mut from = zone.from_mm;
        for &step in steps.iter().filter(|&&step| step > zone.from_mm + 1e-6 && step < zone.to_mm - 1e-6) {
            stretches.push((i, from, step));
            from = step;
        }
        stretches.push((i, from, zone.to_mm));
    }
    Grid::new(&stretches, count)
}

/// A case whose zones are the points of the grid, each with its own compliance.
fn case_of_points(base: &Case, grid: &Grid, held: Option<&Held>) -> Case {
    let mut case = base.clone();
    case.zones = Vec::with_capacity(grid.z_mm.len());
    case.custom.clear();
    let compliance = held.map(|held| held.at(&grid.z_mm));
    for (k, &zone) in grid.zone.iter().enumerate() {
        let mut point = base.zones[zone].clone();
        if base.zones[zone].compliance_is_of_beam
            && let Some(c) = &compliance
        {
            point.compliance_um_per_n = Some(c[k]);
        }
        point.touches_next = false;
        add_zone(&mut case, base, zone, point);
    }
    case.limits.feed_step_ratio_max = None;
    case
}

/// Adds a piece of a zone with the zone's custom limits.
pub(in crate::feed_schedule) fn add_zone(case: &mut Case, base: &Case, zone: usize, piece: ZoneCase) {
    let at = case.zones.len();
    case.zones.push(piece);
    for custom in base.custom.iter().filter(|custom| custom.zone == zone) {
        let mut own = custom.clone();
        own.zone = at;
        case.custom.push(own);
    }
}

/// The explicit schedule: the largest feed within every limit at each point, no steeper than the gradient, and where
/// the edge would not last, slowed by one multiplier. `None` where a limit cannot be met.
fn explicit(base: &Case, grid: &Grid, held: Option<&Held>, gradient: Option<f64>) -> Option<Field> {
    let case = case_of_points(base, grid, held);
    let usage_max = base.limits.tool_usage_max.map(|most| most * (-base.edge_margin).exp());
    let mut local = case.clone();
    local.limits.tool_usage_max = None;
    let built = build(&local, &Variation::default());
    let mut highest = vec![f64::INFINITY; grid.z_mm.len()];
    let mut lowest = vec![f64::NEG_INFINITY; grid.z_mm.len()];
    for row in 0..built.program.rows.len() {
        let constant = built.program.rows.constant(row);
        match built.program.rows.entries(row).next() {
            Some((point, a)) if a > 0.0 => highest[point] = highest[point].min(-constant / a),
            Some((point, a)) => lowest[point] = lowest[point].max(-constant / a),
            None if constant > 1e-9 => return None,
            None => {}
        }
    }
    let speed = base.variables.fixed_speed_m_per_min?;
    let works: Vec<f64> = grid.zone.iter().map(|&i| base.zones[i].work() / base.zones[i].length_mm()).collect();
    let enveloped = |cap: f64| -> Vec<f64> {
        let mut x: Vec<f64> = highest.iter().zip(&lowest).map(|(h, l)| h.min(cap.max(*l))).collect();
        if let Some(g) = gradient {
            envelope(&mut x, grid, g);
        }
        x
    };
    let usage = |x: &[f64]| -> f64 {
        let density: Vec<f64> = (0..x.len())
            .map(|k| {
                let life = base.zones[grid.zone[k]]
                    .model(Output::ToolLife)
                    .map_or(f64::INFINITY, |t| t.output(speed.ln(), x[k]));
                works[k] / (speed * x[k].exp() * life)
            })
            .collect();
        grid.integral(&density)
    };
    let mut ln_feed = enveloped(f64::INFINITY);
    if let Some(most) = usage_max
        && usage(&ln_feed) > most
    {
        // At one speed the free minimiser of time plus usage is one feed for all points of a depth; a cap on the feed is
        // its image, and usage falls with it while the feed exponent of the tool life is below -1.
        let (mut low, mut high) = (
            lowest.iter().copied().fold(f64::INFINITY, f64::min),
            highest.iter().copied().fold(f64::NEG_INFINITY, f64::max),
        );
        if usage(&enveloped(low)) > most || !one_depth(base) {
            return None;
        }
        for _ in 0..100 {
            let middle = 0.5 * (low + high);
            if usage(&enveloped(middle)) > most {
                high = middle;
            } else {
                low = middle;
            }
        }
        ln_feed = enveloped(low);
    }
    if ln_feed.iter().zip(&lowest).any(|(x, low)| *x < low - 1e-9) {
        return None;
    }
    let cost: Vec<f64> = works.iter().zip(&ln_feed).map(|(w, x)| w / (speed * x.exp())).collect();
    // A usage limit is the zones' own affair: at one speed and depth its cap on the feed is one number, no steeper than
    // anything, so zones below what the other limits leave are not faster than the continuous schedule with it.
    let ceilings = gradient.map(|_| Ceilings { ln_feed: of_cells(&enveloped(f64::INFINITY)), ln_rate: None });
    Some(Field {
        time_min: grid.integral(&cost),
        ln_feed,
        speed_m_per_min: Some(speed),
        cost,
        exact_cuts: usage_max.is_none() && base.limits.feed_step_ratio_max.is_none(),
        ceilings,
    })
}

/// Whether all zones have one depth and a straight tool life, so that one cap on the feed serves all points.
fn one_depth(case: &Case) -> bool {
    let first = case.zones[0].depth_mm;
    case.zones.iter().all(|zone| {
        (zone.depth_mm - first).abs() <= 1e-12 * first
            && zone.model(Output::ToolLife).is_some_and(|t| t.bends() == Bend::Straight && t.form(0.0, 0.0).feed < -1.0)
    })
}

/// The largest function below `x` that changes by at most `g` per mm along touching stretches: two sweeps.
fn envelope(x: &mut [f64], grid: &Grid, g: f64) {
    for k in 1..x.len() {
        if grid.touches(k - 1, k) {
            x[k] = x[k].min(x[k - 1] + g * (grid.z_mm[k] - grid.z_mm[k - 1]));
        }
    }
    for k in (1..x.len()).rev() {
        if grid.touches(k - 1, k) {
            x[k - 1] = x[k - 1].min(x[k] + g * (grid.z_mm[k] - grid.z_mm[k - 1]));
        }
    }
}

/// The continuous schedule as a program on the cells of the grid.
fn by_program(
    base: &Case,
    grid: &Grid,
    held: Option<&Held>,
    gradient: Option<f64>,
    monitor: &dyn Monitor,
) -> Result<Option<Field>, Failure> {
    let compliance = held.map(|held| held.at(&grid.z_mm));
    let mut case = base.clone();
    case.zones = Vec::new();
    case.custom.clear();
    case.limits.feed_step_ratio_max = None;
    let mut of_cell = Vec::new();
    for k in 1..grid.z_mm.len() {
        if grid.zone_break(k) {
            continue;
        }
        let zone = grid.zone[k];
        let mut cell = base.zones[zone].clone();
        (cell.from_mm, cell.to_mm) = (grid.z_mm[k - 1], grid.z_mm[k]);
        if base.zones[zone].compliance_is_of_beam
            && let Some(c) = &compliance
        {
            cell.compliance_um_per_n = Some(c[k - 1].max(c[k]));
        }
        cell.touches_next = false;
        of_cell.push(k);
        add_zone(&mut case, base, zone, cell);
    }
    let solved = match solve_cells(&case, gradient, monitor) {
        Ok(solved) => solved,
        Err(Unsolved::Infeasible(_)) => return Ok(None),
        Err(Unsolved::Failed(failure)) => return Err(failure),
    };
    let mut ln_feed = vec![f64::INFINITY; grid.z_mm.len()];
    let mut ln_speed = vec![0.0; grid.z_mm.len()];
    for (cell, &k) in of_cell.iter().enumerate() {
        let (u, x) = solved.at[cell];
        for point in [k - 1, k] {
            if x < ln_feed[point] {
                (ln_feed[point], ln_speed[point]) = (x, u);
            }
        }
    }
    let cost = (0..ln_feed.len())
        .map(|k| {
            let zone = &base.zones[grid.zone[k]];
            zone.work() / zone.length_mm() * (-ln_feed[k] - ln_speed[k]).exp()
        })
        .collect();
    let common = matches!(base.variables.speed, SpeedMode::ConstantSpeed | SpeedMode::Fixed);
    Ok(Some(Field {
        time_min: crate::feed_schedule::model::assess::cutting_time_min(&case, &solved.at),
        speed_m_per_min: common.then(|| ln_speed[0].exp()),
        ceilings: gradient.map(|_| ceilings_of_cells(base, grid, &of_cell, &solved.at)),
        ln_feed,
        cost,
        exact_cuts: false,
    }))
}

/// The solved cells as ceilings.
fn ceilings_of_cells(base: &Case, grid: &Grid, of_cell: &[usize], at: &[(f64, f64)]) -> Ceilings {
    let mut ln_feed = vec![f64::INFINITY; grid.z_mm.len()];
    let mut ln_rate = ln_feed.clone();
    for (&k, &(u, x)) in of_cell.iter().zip(at) {
        (ln_feed[k], ln_rate[k]) = (x, u + x);
    }
    Ceilings { ln_feed, ln_rate: (base.variables.speed != SpeedMode::Fixed).then_some(ln_rate) }
}

/// Solves the cells, with the gradient as a feed step between the middles of neighbours.
fn solve_cells(case: &Case, gradient: Option<f64>, monitor: &dyn Monitor) -> Result<Solved, Unsolved> {
    let Some(g) = gradient else { return solve(case, false, monitor) };
    if case.bends() {
        return Err(Failure::OutOfModel(crate::calculator::Finding::new(
            "gradient_with_bending_model",
            "/method/feed_gradient_per_mm",
        ))
        .into());
    }
    let mut built = build(case, &Variation::default());
    for i in 1..case.zones.len() {
        let (a, b) = (&case.zones[i - 1], &case.zones[i]);
        if (b.from_mm - a.to_mm).abs() > crate::feed_schedule::job::case::TOUCHING_MM {
            continue;
        }
        let apart = 0.5 * (b.to_mm - a.from_mm);
        if let (Some(left), Some(right)) = (built.feed[i - 1].variable, built.feed[i].variable) {
            built.program.rows.push(&[(left, 1.0), (right, -1.0)], -g * apart);
            built.program.rows.push(&[(right, 1.0), (left, -1.0)], -g * apart);
        }
    }
    let solution =
        gp::minimise(&built.program, &gp::Settings::default()).map_err(|_| Unsolved::Infeasible(Box::default()))?;
    let at = (0..case.zones.len()).map(|i| (built.speed[i].at(&solution.y), built.feed[i].at(&solution.y))).collect();
    let objective = solution.objective.exp() + built.fixed;
    Ok(Solved {
        built,
        at,
        objective,
        certificate: solution,
        elasticity: 1.0,
        gain: 1.0,
        tie_broken: false,
        parts_per_edge: None,
        one_part_more: None,
        whole: None,
        linearisations: 0,
        local: false,
        conic: false,
        shares_risk: false,
    })
}

/// Why there is no continuous schedule: the given zones have none either, their limits are the same.
fn none(base: &Case, monitor: &dyn Monitor) -> Unsolved {
    match solve(base, true, monitor) {
        Err(unsolved) => unsolved,
        Ok(_) => Unsolved::Failed(Failure::NotConverged {
            what: "the continuous schedule",
            residual: f64::NAN,
            iterations: 0,
        }),
    }
}

/// The fewest zones within the loss, with their schedule.
fn choose(
    base: Case,
    grid: Grid,
    field: &Field,
    cuts: &[segments::Cut],
    asked: &Asked,
    held: Option<&Held>,
    monitor: &dyn Monitor,
) -> Result<Zoned, Unsolved> {
    let allowed = field.time_min * (1.0 + asked.loss_percent / 100.0);
    let loss = |time: f64| 100.0 * (time / field.time_min - 1.0);
    let mut by_segments = Vec::with_capacity(cuts.len());
    let mut chosen: Option<(&segments::Cut, Case, Solved)> = None;
    let mut reached = false;
    for cut in cuts {
        checkpoint(monitor)?;
        let boundaries_mm: Vec<f64> = segments::boundaries(&grid, cut);
        let mut time = cut.cost;
        // With given speed and no coupling the cut's own time is the optimum; only the zones answered are solved.
        let last = cut.segments == cuts[cuts.len() - 1].segments;
        let wanted = !reached && (!field.exact_cuts || time <= allowed || last);
        if wanted {
            let case = case_of_cut(&base, &grid, cut, field.ceilings.as_ref(), held);
            match solve(&case, false, monitor) {
                Ok(solved) => {
                    if !field.exact_cuts {
                        time = crate::feed_schedule::model::assess::cutting_time_min(&case, &solved.at);
                    }
                    reached = time <= allowed * (1.0 + 1e-12);
                    chosen = Some((cut, case, solved));
                }
                Err(Unsolved::Infeasible(_)) => continue,
                Err(failed) => return Err(failed),
            }
        }
        by_segments.push(SegmentTime {
            segments: u32::try_from(cut.segments).unwrap_or(u32::MAX),
            cutting_time_min: time,
            loss_percent: loss(time),
            boundaries_mm,
        });
    }
    let Some((cut, case, solved)) = chosen else { return Err(none(&base, monitor)) };
    let time = crate::feed_schedule::model::assess::cutting_time_min(&case, &solved.at);
    let outcome = Continuous {
        cutting_time_min: field.time_min,
        segments: u32::try_from(case.zones.len()).unwrap_or(u32::MAX),
        loss_percent: loss(time),
        loss_reached: reached,
        speed_m_per_min: field.speed_m_per_min,
        z_mm: grid.z_mm.clone(),
        feed_mm_per_rev: field.ln_feed.iter().map(|x| x.exp()).collect(),
        by_segments,
    };
    let smooth = asked.gradient_per_mm.map(|gradient_per_mm| Smooth { base, grid, cut: cut.clone(), gradient_per_mm });
    Ok(Zoned { case, solved, outcome, smooth })
}

/// The case of the zones of a cut.
fn case_of_cut(
    base: &Case,
    grid: &Grid,
    cut: &segments::Cut,
    ceilings: Option<&Ceilings>,
    held: Option<&Held>,
) -> Case {
    let mut case = base.clone();
    case.zones = Vec::with_capacity(cut.pieces.len());
    case.custom.clear();
    let stretches: Vec<(f64, f64)> = cut.pieces.iter().map(|&(a, b)| (grid.z_mm[a], grid.z_mm[b])).collect();
    let compliance = held.map(|held| held.largest(&stretches));
    let mut count = vec![0; base.zones.len()];
    for (k, &(from, to)) in stretches.iter().enumerate() {
        let zone = grid.zone[cut.pieces[k].0];
        count[zone] += 1;
        let mut piece = base.zones[zone].clone();
        (piece.from_mm, piece.to_mm) = (from, to);
        piece.id = format!("{}.{}", base.zones[zone].id, count[zone]);
        if base.zones[zone].compliance_is_of_beam
            && let Some(c) = &compliance
        {
            piece.compliance_um_per_n = Some(c[k]);
        }
        piece.ceiling = ceilings.map(|ceilings| ceilings.over(cut.pieces[k], piece.diameter_mm));
        piece.touches_next = stretches
            .get(k + 1)
            .is_some_and(|next| (next.0 - to).abs() <= crate::feed_schedule::job::case::TOUCHING_MM);
        add_zone(&mut case, base, zone, piece);
    }
    case
}
