//! The causes of the catalogue as they stand for a ring and its measured traces.

use std::f64::consts::TAU;

use crate::calculator::{
    Design, Expansions, Hypotheses, Hypothesis, Inapplicability, Inapplicable, Range, Shape, Smooth, Treatment,
    Variable, values_by_name,
};
use crate::effects::{Cause, Fit, Parameter, RING_CAUSES, RingEffect, whole};
use crate::ring_roundness::job::input::Job;
use crate::ring_roundness::model::scene::Scene;

/// Blocks of a trace that are held back by turns, deg: longer than what a remainder is correlated over.
const BLOCK_DEG: f64 = 30.0;
/// Folds that the blocks go to by turns.
const FOLDS: usize = 4;
/// Steps between two whole ratios of ring to roller, where nothing is known of the roller.
const PARTS_OF_A_RATIO: u32 = 2;
/// Sizes about which a displacement or a slip is linearised, prior standard deviations: from one to the next the teeth that
/// the feed leaves move by a part of their width, and a signature is another one after a few of these steps.
const EXPANSION_STEP: f64 = 0.2;
/// How many of them to either side: three prior standard deviations.
const EXPANSIONS: u32 = 15;

/// What a roller's ratio may be where nothing is known of it.
const RATIO: Shape = Shape { mean: 7.0, sd: 3.0, logarithmic: false };
/// Amplitudes of a wave of the blank about which it is linearised, prior standard deviations, and at how many phases.
const WAVES: &[(f64, u32)] = &[(0.15, 6), (0.4, 8), (0.8, 12), (1.4, 16)];
/// The same of a roller that runs out.
const RUNOUTS: &[(f64, u32)] = &[(0.5, 6), (1.2, 8), (2.2, 10), (3.5, 12)];
/// Parts of a step of the ratio where it is looked for: a wave that comes back alike in every turn is seen within a hundredth or two of its
/// ratio, and as another one beyond.
const RATIO_PARTS: u32 = 25;
/// How many of them, where the model comes nearest to the rows.
const WAVES_TRIED: usize = 8;

/// The catalogue, sorted by whether traces of these rings can speak about a cause.
///
/// A wave with a phase is two sizes, A cos ph and A sin ph: the model is linear in both, and no phase is tried first.
pub(in crate::ring_roundness) fn hypotheses(rings: &[&Job], held: &[RingEffect]) -> Hypotheses {
    let mut sorted = Hypotheses::default();
    for cause in RING_CAUSES {
        match inapplicability(cause, rings) {
            Some(reason) => sorted.inapplicable.push(Inapplicable { cause, reason }),
            None => sorted.applicable.extend(hypotheses_of(cause, rings, held)),
        }
    }
    sorted
}

fn inapplicability(cause: &'static Cause, rings: &[&Job]) -> Option<Inapplicability> {
    match cause.kind {
        "spark_out_missing" if rings.iter().all(|job| job.tool.spark_out_revolutions <= 0.0) => {
            Some(Inapplicability::NothingToActOn)
        }
        // The sides of a wheel are those of a rigid machine.
        "tool_push_off" if rings.iter().any(|job| job.tool.wheel_radius_mm.is_some()) => {
            Some(Inapplicability::NothingToActOn)
        }
        _ => None,
    }
}

fn hypotheses_of(cause: &'static Cause, rings: &[&Job], held: &[RingEffect]) -> Vec<Hypothesis> {
    let known: Vec<f64> =
        held.iter().filter(|effect| effect.kind() == cause.kind).filter_map(RingEffect::recurs_by).collect();
    let of = |label: String, variables: Vec<Variable>, prior_weight: f64| Hypothesis {
        cause,
        label,
        variables,
        prior_weight,
        held: None,
    };
    match cause.kind {
        "initial_harmonic" => {
            let grid = grid_of(cause, "order");
            let orders = grid.iter().chain(known.iter().filter(|order| !grid.contains(order)));
            // Several waves are one cause: they share its weight.
            let share = 1.0 / grid.len() as f64;
            let stated = |order: f64| Treatment::Stated { value: order };
            orders
                .map(|&order| {
                    let mut variables = quadratures(cause, ["amplitude_cos_phase_mm", "amplitude_sin_phase_mm"]);
                    variables.push(variable(parameter(cause, "order"), stated(order)));
                    of(format!("order {order}"), variables, share)
                })
                .collect()
        }
        "roller_runout" => {
            let mut variables = quadratures(cause, ["amplitude_cos_end_phase_mm", "amplitude_sin_end_phase_mm"]);
            variables.push(variable(parameter(cause, "ratio"), ratio(cause, rings)));
            vec![of(String::new(), variables, 1.0)]
        }
        "chatter_harmonic" => {
            let waves = grid_of(cause, "waves_per_revolution").iter().copied().filter(|m| !known.contains(m)).collect();
            let size = parameter(cause, "amplitude_mm");
            let wave = |label, waves: Treatment| {
                let size = variable(size, Treatment::Amplitude { prior_sd: size.prior_sd });
                of(label, vec![size, variable(parameter(cause, "waves_per_revolution"), waves)], 1.0)
            };
            let of_known = known.iter().map(|&m| wave(format!("order {m}"), Treatment::Stated { value: m }));
            of_known.chain([wave(String::new(), Treatment::Shape { grid: waves, prior: None })]).collect()
        }
        _ => {
            let treated = |p: &Parameter| match p.fit {
                Fit::Fixed { default } => Treatment::Stated { value: default },
                _ => Treatment::Amplitude { prior_sd: p.prior_sd },
            };
            vec![of(String::new(), cause.parameters.iter().map(|p| variable(p, treated(p))).collect(), 1.0)]
        }
    }
}

/// A cos ph and A sin ph of a wave, each with the prior of the amplitude.
fn quadratures(cause: &Cause, names: [&'static str; 2]) -> Vec<Variable> {
    let size = parameter(cause, "amplitude_mm");
    names
        .into_iter()
        .map(|name| Variable { name, ..variable(size, Treatment::Amplitude { prior_sd: size.prior_sd }) })
        .collect()
}

/// Of a stated roller the ratio is known, that of the finished ring; else it is looked for.
fn ratio(cause: &Cause, rings: &[&Job]) -> Treatment {
    let known = rings.first().filter(|job| job.supports.roller_radius_mm > 0.0).and_then(|job| {
        let end = Scene::of(job, &job.effects).end()?;
        Some(end.radius_mm / job.supports.roller_radius_mm)
    });
    match known {
        Some(ratio) => Treatment::Shape { grid: vec![ratio], prior: None },
        None => Treatment::Shape { grid: finer(grid_of(cause, "ratio")), prior: Some(RATIO) },
    }
}

/// A grid with its steps divided.
fn finer(grid: &[f64]) -> Vec<f64> {
    let parts = f64::from(PARTS_OF_A_RATIO);
    let between = grid.windows(2).flat_map(|pair| {
        (0..PARTS_OF_A_RATIO).map(move |part| pair[0] + (pair[1] - pair[0]) * f64::from(part) / parts)
    });
    between.chain(grid.last().copied()).collect()
}

fn variable(parameter: &Parameter, treatment: Treatment) -> Variable {
    let range = Range { lower: parameter.lower, upper: parameter.upper };
    Variable { name: parameter.name, unit: parameter.unit, treatment, range }
}

fn parameter(cause: &Cause, name: &str) -> &'static Parameter {
    let all: &'static [Parameter] = cause.parameters;
    all.iter().find(|p| p.name == name).expect("the catalogue names this parameter; a test builds every hypothesis")
}

fn grid_of(cause: &Cause, name: &str) -> &'static [f64] {
    match parameter(cause, name).fit {
        Fit::Shape { grid } => grid,
        _ => &[],
    }
}

/// Sizes about which a hypothesis is linearised beside 0.
pub(in crate::ring_roundness) fn expansions(hypothesis: &Hypothesis) -> Expansions {
    match (hypothesis.cause.kind, hypothesis.variables.as_slice()) {
        (
            "tool_off_line" | "support_position" | "work_slip",
            [Variable { treatment: Treatment::Amplitude { prior_sd }, .. }],
        ) => Expansions::along(
            (1..=EXPANSIONS).map(|k| EXPANSION_STEP * f64::from(k) * prior_sd).flat_map(|size| [size, -size]),
        ),
        ("initial_harmonic", [Variable { treatment: Treatment::Amplitude { prior_sd }, .. }, ..]) => {
            Expansions { places: rosette(WAVES, *prior_sd), nearest: WAVES_TRIED, parts: 1 }
        }
        ("roller_runout", [Variable { treatment: Treatment::Amplitude { prior_sd }, .. }, ..]) => {
            Expansions { places: rosette(RUNOUTS, *prior_sd), nearest: WAVES_TRIED, parts: RATIO_PARTS }
        }
        _ => Expansions::default(),
    }
}

/// Waves of several amplitudes and all phases, as A cos ph and A sin ph.
fn rosette(waves: &[(f64, u32)], prior_sd: f64) -> Vec<Vec<f64>> {
    let of = |&(share, phases): &(f64, u32)| {
        let amplitude = share * prior_sd;
        (0..phases).map(move |k| {
            let (sin, cos) = (TAU * f64::from(k) / f64::from(phases)).sin_cos();
            vec![amplitude * cos, amplitude * sin]
        })
    };
    waves.iter().flat_map(of).collect()
}

/// The effects that a hypothesis stands for at these values of its variables.
///
/// The phase of a roller is fitted as it stands when the ring is finished, since it is the last revolutions that show: about
/// the start, a hundredth more of the ratio would turn everything that is seen.
pub(in crate::ring_roundness) fn effects(
    hypothesis: &Hypothesis,
    values: &[f64],
    rings: &[&Job],
) -> Option<Vec<RingEffect>> {
    let cause = hypothesis.cause;
    let effect = match (cause.kind, values) {
        ("initial_harmonic", &[cos, sin, order]) => {
            RingEffect::from_parameters(cause, &[cos.hypot(sin), sin.atan2(cos), order])?
        }
        ("roller_runout", &[cos, sin, ratio]) => {
            let phase = (sin.atan2(cos) - ratio * turned_rad(rings)).rem_euclid(TAU);
            RingEffect::from_parameters(cause, &[cos.hypot(sin), phase, ratio])?
        }
        _ => RingEffect::from_parameters(cause, values)?,
    };
    Some(vec![effect])
}

/// All that the first ring turns.
fn turned_rad(rings: &[&Job]) -> f64 {
    rings.first().map_or(0.0, |job| TAU * (job.tool.revolutions + job.tool.spark_out_revolutions))
}

/// The values of a hypothesis' variables at which it is this effect.
pub(in crate::ring_roundness) fn values(
    hypothesis: &Hypothesis,
    effect: &RingEffect,
    rings: &[&Job],
) -> Option<Vec<f64>> {
    let stated = hypothesis.variables.last().map(|variable| &variable.treatment);
    let quadratures = |amplitude: f64, phase: f64, wave: f64| {
        let (sin, cos) = phase.sin_cos();
        vec![amplitude * cos, amplitude * sin, wave]
    };
    match *effect {
        RingEffect::InitialHarmonic { order, amplitude_mm, phase_rad } => {
            let is_of = hypothesis.cause.kind == effect.kind()
                && matches!(stated, Some(Treatment::Stated { value }) if whole(*value) == order);
            is_of.then(|| quadratures(amplitude_mm, phase_rad, f64::from(order)))
        }
        RingEffect::RollerRunout { amplitude_mm, ratio, phase_rad } => (hypothesis.cause.kind == effect.kind())
            .then(|| quadratures(amplitude_mm, phase_rad + ratio * turned_rad(rings), ratio)),
        // One that is looked for on a grid is another one.
        RingEffect::ChatterHarmonic { .. } if !matches!(stated, Some(Treatment::Stated { .. })) => None,
        _ => values_by_name(hypothesis, effect),
    }
}

/// Rows round the ring; equal angles of one ring are repeats; blocks of 30 degrees are held back by turns, in every trace
/// alike: a neighbour or a repeat would give the held-back row away.
pub(in crate::ring_roundness) fn design(places: &[(usize, f64)]) -> Design {
    let turn = |angle_rad: f64| (angle_rad / TAU).rem_euclid(1.0);
    let mut sorted: Vec<usize> = (0..places.len()).collect();
    let key = |row: usize| (places[row].0, turn(places[row].1));
    sorted.sort_by(|&a, &b| key(a).0.cmp(&key(b).0).then(key(a).1.total_cmp(&key(b).1)));
    let mut cell = vec![0; places.len()];
    let mut cells: Vec<(usize, f64)> = Vec::new();
    for row in sorted {
        let (ring, at) = key(row);
        if cells.last().is_none_or(|(r, before)| *r != ring || at - before > 1e-9) {
            cells.push((ring, at));
        }
        cell[row] = cells.len() - 1;
    }
    Design {
        smooth: Smooth::Around(places.iter().map(|(_, angle)| turn(*angle) * TAU).collect()),
        cell,
        regressors: Vec::new(),
        groupings: Vec::new(),
        conditions: Vec::new(),
        order: None,
        fold: places.iter().map(|(_, angle)| block(turn(*angle) * 360.0) % FOLDS).collect(),
    }
}

#[allow(clippy::cast_possible_truncation, clippy::cast_sign_loss, reason = "0 to 12")]
fn block(angle_deg: f64) -> usize {
    (angle_deg / BLOCK_DEG) as usize
}
