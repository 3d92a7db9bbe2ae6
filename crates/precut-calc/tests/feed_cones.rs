//! Schedules at a stated risk against a program that is written here on its own: limits, life and cost of random jobs as cones of the
//! general solver Clarabel, a joint risk by cutting planes. `PRECUT_CERTAINTY_SCHEDULES` sets how many; the suite takes few.
#![allow(clippy::unwrap_used, clippy::panic, missing_docs)]

use std::f64::consts::{PI, SQRT_2};

use clarabel::algebra::CscMatrix;
use clarabel::solver::{DefaultSettings, DefaultSolver, IPSolver, SolverStatus, SupportedConeT};
use precut_calc::calculator::{Calculator, Failure, Unwatched};
use precut_calc::feed_schedule::FeedSchedule;
use serde_json::{Value, json};

use crate::draw::Draw;
use crate::feed_support::{self, solve};

/// An affine form of the variables.
#[derive(Clone, Default)]
struct Form {
    of: Vec<(usize, f64)>,
    constant: f64,
}

impl Form {
    fn of(terms: &[(usize, f64)], constant: f64) -> Self {
        Self { of: terms.to_vec(), constant }
    }

    fn at(&self, y: &[f64]) -> f64 {
        self.constant + self.of.iter().map(|(variable, factor)| factor * y[*variable]).sum::<f64>()
    }

    fn plus(&self, other: &Self, factor: f64) -> Self {
        let of = self.of.iter().copied().chain(other.of.iter().map(|(variable, value)| (*variable, factor * value)));
        Self { of: of.collect(), constant: self.constant + factor * other.constant }
    }
}

/// min cost.y where forms are at least 0, first parts of `second_order` at least the length of the others, and
/// exp(of the first part) at most the second.
#[derive(Clone)]
struct Cones {
    variables: usize,
    cost: Vec<(usize, f64)>,
    at_least_0: Vec<Form>,
    second_order: Vec<Vec<Form>>,
    exponential: Vec<(Form, usize)>,
}

impl Cones {
    /// `None` where nothing keeps all of it.
    fn solved(&self) -> Option<(Vec<f64>, f64)> {
        let (mut rows, mut columns, mut values, mut right, mut kinds) = (vec![], vec![], vec![], vec![], vec![]);
        let mut put = |form: &Form| {
            for (variable, factor) in &form.of {
                rows.push(right.len());
                columns.push(*variable);
                values.push(-factor);
            }
            right.push(form.constant);
        };
        self.at_least_0.iter().for_each(&mut put);
        kinds.push(SupportedConeT::NonnegativeConeT(self.at_least_0.len()));
        for cone in &self.second_order {
            cone.iter().for_each(&mut put);
            kinds.push(SupportedConeT::SecondOrderConeT(cone.len()));
        }
        for (exponent, above) in &self.exponential {
            [exponent.clone(), Form::of(&[], 1.0), Form::of(&[(*above, 1.0)], 0.0)].iter().for_each(&mut put);
            kinds.push(SupportedConeT::ExponentialConeT());
        }
        let mut q = vec![0.0; self.variables];
        self.cost.iter().for_each(|(variable, factor)| q[*variable] += factor);
        let a = CscMatrix::new_from_triplets(right.len(), self.variables, rows, columns, values);
        let p = CscMatrix::zeros((self.variables, self.variables));
        let settings = DefaultSettings {
            verbose: false,
            tol_gap_abs: 1e-9,
            tol_gap_rel: 1e-9,
            tol_feas: 1e-9,
            ..DefaultSettings::default()
        };
        let mut solver = DefaultSolver::new(&p, &q, &a, &right, &kinds, settings).unwrap();
        solver.solve();
        let found = &solver.solution;
        match found.status {
            SolverStatus::Solved | SolverStatus::AlmostSolved => Some((found.x.clone(), found.obj_val)),
            SolverStatus::PrimalInfeasible | SolverStatus::AlmostPrimalInfeasible => None,
            other => panic!("{other:?}"),
        }
    }
}

/// The number that a standard normal one is below with 1 - `risk`.
fn deviations(risk: f64) -> f64 {
    SQRT_2 * statrs::function::erf::erfc_inv(2.0 * risk)
}

fn below(x: f64) -> f64 {
    0.5 * statrs::function::erf::erfc(-x / SQRT_2)
}

fn number(value: &Value, pointer: &str) -> f64 {
    value.pointer(pointer).and_then(Value::as_f64).unwrap_or_else(|| panic!("{pointer} in {value}"))
}

/// Speeds and feeds within their range, times and use of an edge above their exponentials, and the cost of both.
fn plain(job: &Value) -> Cones {
    let zones = job["zones"].as_array().unwrap();
    let count = zones.len();
    let mut cones =
        Cones { variables: 4 * count, cost: vec![], at_least_0: vec![], second_order: vec![], exponential: vec![] };
    let rate = number(job, "/objective/machine_rate_per_min");
    let of_edge = rate * number(job, "/objective/tool_change_time_min") + number(job, "/objective/edge_cost");
    let scatter = number(job, "/models/tool_life/residual_scatter");
    let allowed = number(job, "/limits/tool_usage_max")
        * (-deviations(number(job, "/risk/edge_risk_percent") / 100.0) * scatter).exp();
    let mut left = Form::of(&[], allowed);
    for (zone, of) in zones.iter().enumerate() {
        let (u, x, time, used) = (zone, count + zone, 2 * count + zone, 3 * count + zone);
        for (variable, low, high) in
            [(u, "speed_min_m_per_min", "speed_max_m_per_min"), (x, "feed_min_mm_per_rev", "feed_max_mm_per_rev")]
        {
            let [low, high] = [low, high].map(|name| number(job, &format!("/limits/{name}")).ln());
            cones.at_least_0.extend([Form::of(&[(variable, 1.0)], -low), Form::of(&[(variable, -1.0)], high)]);
        }
        let length_mm = number(of, "/z_end_mm") - number(of, "/z_start_mm");
        let work = (PI * number(of, "/diameter_mm") * length_mm / 1000.0).ln();
        let turned = Form::of(&[(u, -1.0), (x, -1.0)], work);
        let life = mean(job, "tool_life", of, u, x);
        cones.exponential.extend([(turned.clone(), time), (turned.plus(&life, -1.0), used)]);
        cones.cost.extend([(time, rate), (used, of_edge)]);
        left = left.plus(&Form::of(&[(used, 1.0)], 0.0), -1.0);
    }
    cones.at_least_0.push(left);
    cones
}

/// Logarithm of what a model expects.
fn mean(job: &Value, model: &str, zone: &Value, u: usize, x: usize) -> Form {
    let model = &job["models"][model];
    let exponent = |name: &str| model[name].as_f64().unwrap_or(0.0);
    let depth = exponent("depth_exponent") * number(zone, "/depth_mm").ln();
    Form::of(&[(u, exponent("speed_exponent")), (x, exponent("feed_exponent"))], exponent("constant") + depth)
}

/// Of every limit that scatters: by how much its logarithm is kept on average, its standard deviation, and the parts of that which
/// go with speed and feed.
fn limits(job: &Value) -> Vec<(Form, f64, Vec<Form>)> {
    let zones = job["zones"].as_array().unwrap();
    let mut found = Vec::new();
    for (zone, of) in zones.iter().enumerate() {
        let (u, x) = (zone, zones.len() + zone);
        let rough = Form::of(&[], number(of, "/roughness_max_um").ln()).plus(&mean(job, "roughness", of, u, x), -1.0);
        let most_n = number(of, "/deflection_max_um") / number(of, "/compliance_um_per_n");
        let bent = Form::of(&[], most_n.ln()).plus(&mean(job, "force_y", of, u, x), -1.0);
        found.push((rough, number(job, "/models/roughness/residual_scatter"), common(job, u, x)));
        found.push((bent, number(job, "/models/force_y/residual_scatter"), Vec::new()));
    }
    found
}

/// L' (1, u, x) of the covariance L L' of the roughness, where there is one.
fn common(job: &Value, u: usize, x: usize) -> Vec<Form> {
    let Some(matrix) = job.pointer("/models/roughness/coefficient_covariance/matrix") else { return Vec::new() };
    let at = |i: usize, j: usize| matrix[i][j].as_f64().unwrap();
    let lower = nalgebra::Matrix3::from_fn(at).cholesky().unwrap().l();
    (0..3).map(|j| Form::of(&[(u, lower[(1, j)]), (x, lower[(2, j)])], lower[(0, j)])).collect()
}

/// The least cost with a risk of each limit.
fn each(job: &Value, risk: f64) -> Option<f64> {
    let mut cones = plain(job);
    let q = deviations(risk);
    for (kept, scatter, common) in limits(job) {
        if common.is_empty() {
            cones.at_least_0.push(kept.plus(&Form::of(&[], q * scatter), -1.0));
            continue;
        }
        let first = Form::default().plus(&kept, 1.0 / q);
        cones.second_order.push([vec![first, Form::of(&[], scatter)], common].concat());
    }
    cones.solved().map(|(_, cost)| cost)
}

/// The least cost with a risk of all limits together, which scatter independently: -sum of ln Phi(t) <= -ln(1 - risk) by planes that
/// touch it, which is convex.
fn joint(job: &Value, risk: f64) -> Option<f64> {
    let budget = -(-risk).ln_1p();
    let of: Vec<Form> =
        limits(job).into_iter().map(|(kept, scatter, _)| Form::default().plus(&kept, 1.0 / scatter)).collect();
    let mut cones = plain(job);
    // No limit alone may take more than all of it.
    let alone = deviations(risk);
    cones.at_least_0.extend(of.iter().map(|t| t.plus(&Form::of(&[], alone), -1.0)));
    for _ in 0..200 {
        let (y, cost) = cones.solved()?;
        let spent: f64 = of.iter().map(|t| -below(t.at(&y)).ln()).sum();
        if spent <= budget * (1.0 + 1e-7) {
            return Some(cost);
        }
        // budget - spent(y0) - slope (t - t0), over the budget so that small risks are of size 1.
        let slope = |t: f64| (-0.5 * t * t).exp() / (2.0 * PI).sqrt() / below(t);
        let plane = of.iter().fold(Form::of(&[], (budget - spent) / budget), |plane, t| {
            let at = t.at(&y);
            plane.plus(&t.plus(&Form::of(&[], at), -1.0), slope(at) / budget)
        });
        cones.at_least_0.push(plane);
    }
    panic!("the planes do not end");
}

/// One to four zones, models and limits at random.
fn random(draw: &mut Draw) -> Value {
    let mut of = |low: f64, high: f64| low * (high / low).powf(draw.share());
    let count = of(1.0, 4.99) as usize;
    let mut end_mm = 0.0;
    let mut zone = |id: usize| {
        let start_mm = end_mm;
        end_mm += of(30.0, 300.0);
        json!({ "id": format!("z{id}"), "z_start_mm": start_mm, "z_end_mm": end_mm, "diameter_mm": of(30.0, 90.0),
            "depth_mm": of(0.4, 2.0), "roughness_max_um": of(0.9, 6.0), "compliance_um_per_n": of(0.01, 0.1),
            "deflection_max_um": of(5.0, 40.0) })
    };
    let zones: Vec<Value> = (0..count).map(&mut zone).collect();
    json!({
        "zones": zones,
        "models": {
            "roughness": { "constant": of(4.2, 4.8), "speed_exponent": -of(0.05, 0.3), "feed_exponent": of(1.2, 1.9), "residual_scatter": of(0.05, 0.3) },
            "tool_life": { "constant": of(20.0, 21.5), "speed_exponent": -of(3.0, 4.0), "feed_exponent": -of(0.8, 1.5), "residual_scatter": of(0.1, 0.5) },
            "force_y": { "constant": of(6.6, 7.2), "feed_exponent": of(0.4, 0.8), "depth_exponent": of(0.8, 1.0), "speed_exponent": -of(0.05, 0.3), "residual_scatter": of(0.05, 0.2) }
        },
        "limits": { "feed_min_mm_per_rev": 0.05, "feed_max_mm_per_rev": of(0.25, 0.6), "speed_min_m_per_min": 60, "speed_max_m_per_min": of(150.0, 320.0), "tool_usage_max": of(0.5, 1.0) },
        "objective": { "kind": "cost", "machine_rate_per_min": of(0.5, 3.0), "tool_change_time_min": of(0.5, 4.0), "edge_cost": of(1.0, 9.0) },
        "risk": { "kind": "each", "risk_percent": of(0.05, 20.0), "edge_risk_percent": of(0.5, 20.0) }
    })
}

/// A covariance of constant, exponent of speed and of feed, as trials about the middle of their range leave it.
fn with_covariance(job: &Value, draw: &mut Draw) -> Value {
    let mut job = job.clone();
    let scatter = number(&job, "/models/roughness/residual_scatter");
    // The inverse of X'X of 12 trials over ranges of ln V and ln S about their middles.
    let (u, x) = (draw.between(4.6, 5.0), draw.between(-2.0, -1.6));
    let [wide_u, wide_x] = [draw.between(0.3, 0.5), draw.between(0.4, 0.7)].map(|half: f64| half * half);
    let information = nalgebra::Matrix3::new(1.0, u, x, u, u * u + wide_u, u * x, x, u * x, x * x + wide_x) * 12.0;
    let covariance = information.try_inverse().unwrap() * scatter * scatter;
    let matrix: Vec<Vec<f64>> =
        (0..3).map(|i| (0..3).map(|j| 0.5 * (covariance[(i, j)] + covariance[(j, i)])).collect()).collect();
    job["models"]["roughness"]["coefficient_covariance"] =
        json!({ "order": ["constant", "speed_exponent", "feed_exponent"], "matrix": matrix });
    job
}

/// What the product makes of it; `None` where it refuses the risk or the limits.
fn answered(job: &Value) -> Option<f64> {
    match solve(job.clone()) {
        Ok(outcome) => Some(outcome.objective),
        Err(Failure::OutOfModel(_) | Failure::Conflicting(_)) => None,
        Err(failure) => panic!("{failure:?}: {job}"),
    }
}

#[test]
fn schedules_at_a_risk_are_those_of_a_program_on_cones() {
    let count: u32 =
        std::env::var("PRECUT_CERTAINTY_SCHEDULES").ok().and_then(|count| count.parse().ok()).unwrap_or(40);
    let mut draw = Draw::new(41);
    let (mut furthest, mut refused) = ([0.0_f64; 3], [0; 3]);
    for index in 0..count {
        let job = random(&mut draw);
        let risk = number(&job, "/risk/risk_percent") / 100.0;
        let mut together = job.clone();
        together["risk"]["kind"] = json!("joint");
        let cases =
            [("each", answered(&job), each(&job, risk)), ("joint", answered(&together), joint(&together, risk)), {
                let job = with_covariance(&job, &mut draw);
                ("covariance", answered(&job), each(&job, risk))
            }];
        for (kind, (name, found, expected)) in cases.into_iter().enumerate() {
            match (found, expected) {
                (Some(found), Some(expected)) => {
                    let off = (found / expected - 1.0).abs();
                    furthest[kind] = furthest[kind].max(off);
                    // Clarabel's gap is 1e-9 of numbers of size 1, that of the planes 1e-7 of the risk.
                    assert!(off < 2e-6, "{index} {name}: {found}, on cones {expected}: {job}");
                }
                (None, None) => refused[kind] += 1,
                other => panic!("{index} {name}: {other:?}: {job}"),
            }
        }
    }
    eprintln!("{count} schedules: furthest from each other {furthest:?}, refused by both {refused:?}");
    assert!(refused.iter().all(|refused| *refused < count), "{refused:?}");
}

/// Tangents from schedule to schedule go round in circles where no schedule keeps the risk: all of them together tell it.
#[test]
fn a_risk_that_cannot_be_had_is_told_where_linearisations_do_not_settle() {
    let job = json!({
        "zones": [{ "id": "z", "z_start_mm": 0, "z_end_mm": 60.2815, "diameter_mm": 46.0402, "depth_mm": 0.940_173,
            "roughness_max_um": 2.54654, "compliance_um_per_n": 0.061_856_3, "deflection_max_um": 16.7368 }],
        "models": {
            "roughness": { "constant": 4.52809, "speed_exponent": -0.067_647, "feed_exponent": 1.32565, "residual_scatter": 0.256_241,
                "coefficient_covariance": { "order": ["constant", "speed_exponent", "feed_exponent"], "matrix": [
                    [1.329_953_88, -0.260_245_45, 0.036_014_29], [-0.260_245_45, 0.053_848_745, 0.0], [0.036_014_29, 0.0, 0.019_433_270_4]] } },
            "tool_life": { "constant": 20.3322, "speed_exponent": -3.608, "feed_exponent": -1.46988, "residual_scatter": 0.156_148 },
            "force_y": { "constant": 7.14569, "feed_exponent": 0.420_111, "depth_exponent": 0.884_701, "speed_exponent": -0.247_616,
                "residual_scatter": 0.125_840 }
        },
        "limits": { "feed_min_mm_per_rev": 0.05, "feed_max_mm_per_rev": 0.520_513, "speed_min_m_per_min": 60,
            "speed_max_m_per_min": 223.331, "tool_usage_max": 0.664_865 },
        "objective": { "kind": "cost", "machine_rate_per_min": 0.998_571, "tool_change_time_min": 0.532_966, "edge_cost": 6.83687 },
        "risk": { "kind": "each", "risk_percent": 0.229_037, "edge_risk_percent": 1.34642 }
    });
    assert!(each(&job, 0.002_290_37).is_none());
    let Err(Failure::OutOfModel(finding)) = FeedSchedule::run(&feed_support::job(job.clone()), &Unwatched) else {
        panic!("no schedule keeps that risk");
    };
    assert_eq!(finding.code, "infeasible_at_this_risk");
    // What is advised is done, and is the least by the cones, too.
    let least = finding.limit.unwrap();
    let at = |percent: f64| {
        let mut job = job.clone();
        job["risk"]["risk_percent"] = json!(percent);
        job
    };
    let (found, expected) = (answered(&at(1.001 * least)), each(&at(1.001 * least), 0.01 * 1.001 * least));
    assert!((found.unwrap() / expected.unwrap() - 1.0).abs() < 2e-6, "{found:?} {expected:?}");
    assert!(answered(&at(0.999 * least)).is_none() && each(&at(0.999 * least), 0.01 * 0.999 * least).is_none());
}
