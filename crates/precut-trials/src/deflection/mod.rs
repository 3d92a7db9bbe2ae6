//! Slender shafts between centres, measured along their length after several runs.

mod beam;
mod hide;
mod ideal;

pub use ideal::is_found;

use serde_json::{Value, json};

use crate::{Class, Hidden, Later, Random, Scatter, Trial, Truth};
use hide::{CAUSES, OUTSIDE, Size};

/// Depth, feed and speed at which the force is stated.
const REFERENCE: (f64, f64, f64) = (1.0, 0.3, 100.0);
const FORCE_LEVEL_ALLOWANCE: f64 = 0.009;
const FORCE_PER_RUN_ALLOWANCE: f64 = 0.007;
const BENDING_ALLOWANCE: f64 = 0.003_5;
const SETUP_ALLOWANCE_UM: f64 = 1.0;
const GAUGE_POSITION_MM: f64 = 0.3;

/// A machine and its shaft.
#[derive(Debug, Clone)]
pub(crate) struct Lathe {
    pub(crate) length_mm: f64,
    pub(crate) diameter_mm: f64,
    pub(crate) headstock_um_per_n: f64,
    pub(crate) tailstock_um_per_n: f64,
    pub(crate) carriage_um_per_n: f64,
    pub(crate) force_n: f64,
    pub(crate) exponents: (f64, f64, f64),
}

/// Conditions of a run.
#[derive(Debug, Clone)]
pub(crate) struct Run {
    pub(crate) depth_mm: f64,
    pub(crate) feed_mm_per_rev: f64,
    pub(crate) speed_m_per_min: f64,
    pub(crate) to_headstock: bool,
    pub(crate) path_at_start_m: f64,
    pub(crate) warm_at_start_min: f64,
}

impl Run {
    /// As a request states it.
    fn said(&self) -> Value {
        json!({
            "depth_mm": self.depth_mm, "feed_mm_per_rev": self.feed_mm_per_rev, "speed_m_per_min": self.speed_m_per_min,
            "feed_direction": if self.to_headstock { "to_headstock" } else { "to_tailstock" },
            "tool_path_at_start_m": self.path_at_start_m, "warm_time_at_start_min": self.warm_at_start_min
        })
    }

    /// The run that a request states with all of these conditions.
    fn stated(run: &Value) -> Self {
        let number = |field: &str| run[field].as_f64().unwrap_or(f64::NAN);
        Self {
            depth_mm: number("depth_mm"),
            feed_mm_per_rev: number("feed_mm_per_rev"),
            speed_m_per_min: number("speed_m_per_min"),
            to_headstock: run["feed_direction"] == "to_headstock",
            path_at_start_m: number("tool_path_at_start_m"),
            warm_at_start_min: number("warm_time_at_start_min"),
        }
    }
}

/// What acts at a station beside the base: the hidden effects.
#[derive(Debug, Clone, Copy, Default)]
pub(crate) struct Acting {
    /// Added to the compliance, um/N.
    pub(crate) compliance: f64,
    /// Factor on the force less one.
    pub(crate) factor: f64,
    /// Power of the depth over its reference, on the force.
    pub(crate) depth_power: f64,
    /// Added to the force, N.
    pub(crate) force_n: f64,
    /// Radial error, um.
    pub(crate) error_um: f64,
}

/// Draws a trial. `snr` is that of every hidden cause.
pub fn draw(class: Class, snr: f64, seed: u64) -> Trial {
    draw_scattered(Scatter::Student, class, snr, seed)
}

/// The same with rows that scatter otherwise.
pub fn draw_scattered(scatter: Scatter, class: Class, snr: f64, seed: u64) -> Trial {
    drawn(scatter, class, snr, seed).trial
}

/// Diameter deviations of a shaft that the machine of a trial turns along a commanded path, in the regime of the job and without
/// scatter: at each of these places, of a stated commanded diameter, um.
pub fn turned_um(class: Class, snr: f64, seed: u64, path: &[(f64, f64)]) -> Vec<f64> {
    let drawn = drawn(Scatter::Student, class, snr, seed);
    let lathe = &drawn.lathe;
    let (depth_mm, feed_mm_per_rev, speed_m_per_min) = REFERENCE;
    let stock_mm = lathe.diameter_mm + 2.0 * depth_mm;
    let at = |&(z, commanded_mm): &(f64, f64)| {
        let run = Run {
            depth_mm: 0.5 * (stock_mm - commanded_mm),
            feed_mm_per_rev,
            speed_m_per_min,
            to_headstock: true,
            path_at_start_m: 0.0,
            warm_at_start_min: 0.0,
        };
        let elastic = elastic_um_per_n(lathe, z, &drawn.hidden, 1.0);
        let opened_um = deviation_um(lathe, &run, 0, (z, elastic), &drawn.hidden, 1.0);
        1e3 * (commanded_mm - lathe.diameter_mm) + opened_um
    };
    path.iter().map(at).collect()
}

/// One more run on the machine of a trial, measured at its places as often as the others; without conditions it is one that a
/// later shift would make. The run as a request states it, and its rows, of run `number`.
pub fn measured_next(
    class: Class,
    snr: f64,
    seed: u64,
    conditions: Option<&Value>,
    number: usize,
) -> (Value, Vec<Value>) {
    let drawn = drawn(Scatter::Student, class, snr, seed);
    // Numbers of its own: what the draw takes is not changed by what comes after it.
    let mut random = Random::new(seed ^ 0x4e87);
    let shift = runs(&drawn.lathe, &mut random);
    let any = random.whole(0, shift.len() - 1);
    let run = conditions.map_or_else(|| shift[any].clone(), Run::stated);
    let Drawn { lathe, hidden, trial, .. } = &drawn;
    let machine = Machine {
        lathe,
        hidden,
        level: drawn.level,
        bending: drawn.bending,
        sigma: trial.sigma,
        scatter: Scatter::Student,
    };
    // What depends on the order of runs counts on from those before.
    let (rows, _) = machine.measure(&vec![run.clone(); number], &drawn.places, drawn.traces, &mut random);
    let own = rows.into_iter().filter(|row| row["run"] == number);
    (run.said(), own.collect())
}

/// A trial and what it was made of.
struct Drawn {
    trial: Trial,
    lathe: Lathe,
    /// Factors on the force and on the flexibility of the shaft that are no finding.
    level: f64,
    bending: f64,
    runs: Vec<Run>,
    places: Vec<f64>,
    traces: usize,
    hidden: Vec<Scaled>,
    /// What was measured beside what the shaft would give without anything hidden, um.
    residual_um: Vec<f64>,
}

impl Drawn {
    /// Of one trace of every run, as often as it was measured.
    fn by_trace(&self, column: &[f64]) -> Vec<f64> {
        column.chunks(self.places.len()).flat_map(|run| run.repeat(self.traces)).collect()
    }

    /// Diameter deviations of one trace of every run without scatter, um; `bending` and `force` are factors.
    fn clean_um(&self, hidden: &[Scaled], bending: f64, force: f64) -> Vec<f64> {
        let stations = stations(&self.lathe, &self.places, hidden, bending);
        deviations_um(&self.lathe, &self.runs, &stations, hidden, force)
    }

    /// What causes change in every row.
    fn signature_um(&self, hidden: &[Scaled]) -> Vec<f64> {
        let (with, without) = (self.clean_um(hidden, 1.0, 1.0), self.clean_um(&[], 1.0, 1.0));
        let change: Vec<f64> = with.iter().zip(&without).map(|(with, without)| with - without).collect();
        self.by_trace(&change)
    }
}

fn drawn(scatter: Scatter, class: Class, snr: f64, seed: u64) -> Drawn {
    let mut random = Random::new(seed);
    loop {
        // A cause that needs what this draw does not have (both directions, two depths) is drawn again.
        if let Some(drawn) = attempt(scatter, class, snr, &mut random) {
            return drawn;
        }
    }
}

fn attempt(scatter: Scatter, class: Class, snr: f64, random: &mut Random) -> Option<Drawn> {
    let lathe = lathe(random);
    let runs = runs(&lathe, random);
    let sigma = random.uniform(0.8, 1.8);
    let traces = random.whole(1, 2);
    let places = places(&lathe, random);
    let sizes = match class {
        Class::Nothing => Vec::new(),
        Class::One => vec![random.pick(CAUSES)],
        Class::Two => {
            let (first, second) = (random.pick(CAUSES), random.pick(CAUSES));
            if first.kind == second.kind {
                return None;
            }
            vec![first, second]
        }
        Class::Outside => vec![random.pick(OUTSIDE)],
    };
    let mut hidden = Vec::new();
    for cause in &sizes {
        hidden.push(scaled(*cause, &lathe, &runs, &places, snr * sigma, random)?);
    }
    let level = 1.0 + random.uniform_sd(FORCE_LEVEL_ALLOWANCE);
    let bending = 1.0 + random.uniform_sd(BENDING_ALLOWANCE);
    let machine = Machine { lathe: &lathe, hidden: &hidden, level, bending, sigma, scatter };
    let (rows, measured) = machine.measure(&runs, &places, traces, random);
    // Another shift on the same machine.
    let runs_later = self::runs(&lathe, random);
    let (rows_later, _) = machine.measure(&runs_later, &places, 1, random);
    let stations = stations(&lathe, &places, &hidden, 1.0);
    let best = deviations_um(&lathe, &runs_later, &stations, &hidden, 1.0);
    let later = Some(Later { request: request(&lathe, &runs_later, &rows_later), best });
    let truth = Truth { class, causes: Vec::new(), together: Vec::new() };
    let trial = Trial { request: request(&lathe, &runs, &rows), truth, sigma, later };
    let mut drawn = Drawn { trial, lathe, level, bending, runs, places, traces, hidden, residual_um: Vec::new() };
    let of = |one: &Scaled| Hidden {
        kind: one.cause.kind,
        size: one.size,
        shapes: one.shapes(),
        snr,
        signature: drawn.signature_um(std::slice::from_ref(one)),
    };
    let causes = drawn.hidden.iter().map(of).collect();
    let plain = drawn.by_trace(&drawn.clean_um(&[], 1.0, 1.0));
    drawn.residual_um = measured.iter().zip(plain).map(|(measured, plain)| measured - plain).collect();
    drawn.trial.truth = Truth { class, causes, together: drawn.signature_um(&drawn.hidden) };
    Some(drawn)
}

/// A lathe with what is hidden in it and what is off without being a finding.
struct Machine<'a> {
    lathe: &'a Lathe,
    hidden: &'a [Scaled],
    level: f64,
    bending: f64,
    sigma: f64,
    scatter: Scatter,
}

impl Machine<'_> {
    /// Rows of runs that are measured so many times, and their values.
    fn measure(&self, runs: &[Run], places: &[f64], traces: usize, random: &mut Random) -> (Vec<Value>, Vec<f64>) {
        let Self { lathe, hidden, level, bending, sigma, scatter } = *self;
        let digits = if scatter == Scatter::Rounded { 0 } else { 2 };
        let (mut rows, mut measured) = (Vec::new(), Vec::new());
        for (index, run) in runs.iter().enumerate() {
            let force = level * (1.0 + random.uniform_sd(FORCE_PER_RUN_ALLOWANCE));
            let setup_um = random.uniform_sd(SETUP_ALLOWANCE_UM);
            for trace in 1..=traces {
                let mut before = scatter.next(random);
                for &place in places {
                    let z = (place + random.uniform(-GAUGE_POSITION_MM, GAUGE_POSITION_MM)).clamp(0.0, lathe.length_mm);
                    let elastic = elastic_um_per_n(lathe, z, hidden, bending);
                    let clean = deviation_um(lathe, run, index, (z, elastic), hidden, force);
                    let fresh = scatter.next(random);
                    let noise = if scatter == Scatter::Correlated {
                        before = 0.4 * before + 0.84_f64.sqrt() * fresh;
                        before
                    } else {
                        // A moving average with coefficient 0.2: correlated by 0.19 with its neighbour.
                        (fresh + 0.2 * std::mem::replace(&mut before, fresh)) / 1.04_f64.sqrt()
                    };
                    let uneven = random.uniform(0.8, 1.2);
                    let value = clean + setup_um + sigma * uneven * noise;
                    measured.push(value);
                    rows.push(json!({
                        "run": index + 1, "trace": trace, "z_mm": round(place, 3),
                        "diameter_deviation_um": round(value, digits)
                    }));
                }
            }
        }
        (rows, measured)
    }
}

fn round(value: f64, digits: i32) -> f64 {
    let scale = 10.0_f64.powi(digits);
    (value * scale).round() / scale
}

fn lathe(random: &mut Random) -> Lathe {
    let diameter_mm = random.pick(&[32.0, 36.0, 40.0, 45.0, 50.0]);
    Lathe {
        length_mm: (diameter_mm * random.uniform(11.0, 18.0) / 10.0).round() * 10.0,
        diameter_mm,
        headstock_um_per_n: round(random.uniform(0.012, 0.028), 6),
        tailstock_um_per_n: round(random.uniform(0.028, 0.06), 6),
        carriage_um_per_n: round(random.uniform(0.02, 0.045), 6),
        force_n: random.uniform(250.0, 450.0).round(),
        exponents: (0.9, 0.6, -0.15),
    }
}

/// Runs in the order of a shift: the edge wears on, a new one now and then; the machine warms, and cools in pauses.
fn runs(lathe: &Lathe, random: &mut Random) -> Vec<Run> {
    let count = random.whole(5, 8);
    let (mut path_m, mut warm_min) = (0.0, random.uniform(0.0, 6.0));
    (0..count)
        .map(|_| {
            let run = Run {
                depth_mm: random.pick(&[0.3, 0.5, 0.8, 1.2, 1.6]),
                feed_mm_per_rev: random.pick(&[0.12, 0.2, 0.3, 0.4]),
                speed_m_per_min: random.pick(&[35.0, 60.0, 90.0, 130.0, 180.0]),
                to_headstock: random.chance(0.7),
                path_at_start_m: round(path_m, 1),
                warm_at_start_min: round(warm_min, 3),
            };
            let cut_m = std::f64::consts::PI * lathe.diameter_mm * lathe.length_mm / (1000.0 * run.feed_mm_per_rev);
            path_m = if random.chance(0.25) { 0.0 } else { path_m + cut_m };
            let minutes = cut_m / run.speed_m_per_min;
            warm_min = if random.chance(0.3) { 0.0 } else { warm_min + minutes + random.uniform(2.0, 8.0) };
            run
        })
        .collect()
}

fn places(lathe: &Lathe, random: &mut Random) -> Vec<f64> {
    let count = random.whole(20, 32);
    let margin = 0.03 * lathe.length_mm;
    let step = (lathe.length_mm - 2.0 * margin) / (count - 1) as f64;
    (0..count).map(|i| round(margin + step * i as f64, 3)).collect()
}

/// A hidden cause at its size.
#[derive(Debug, Clone)]
pub(crate) struct Scaled {
    pub(crate) cause: Size,
    pub(crate) size: f64,
    /// Drawn constants of its form.
    pub(crate) form: [f64; 3],
}

/// The size at which the root mean square of the signature over the rows is as asked for: bisection on
/// the size, since some effects are far from linear. `None` where the cause cannot be seen in these runs.
fn scaled(
    cause: Size,
    lathe: &Lathe,
    runs: &[Run],
    places: &[f64],
    rms_um: f64,
    random: &mut Random,
) -> Option<Scaled> {
    if !cause.applies(runs) {
        return None;
    }
    let sign = if cause.two_sided { random.sign() } else { 1.0 };
    let form = [random.uniform(0.0, 1.0), random.uniform(0.0, 1.0), random.uniform(0.0, 1.0)];
    let at = |size: f64| Scaled { cause, size: sign * size, form };
    let bare = stations(lathe, places, &[], 1.0);
    let without = deviations_um(lathe, runs, &bare, &[], 1.0);
    let rms = |size: f64| {
        let hidden = [at(size)];
        let with = if hidden[0].changes_beam() {
            deviations_um(lathe, runs, &stations(lathe, places, &hidden, 1.0), &hidden, 1.0)
        } else {
            deviations_um(lathe, runs, &bare, &hidden, 1.0)
        };
        let sum: f64 = with.iter().zip(&without).map(|(with, without)| (with - without).powi(2)).sum();
        (sum / without.len() as f64).sqrt()
    };
    let (mut low, mut high) = (0.0, cause.most());
    if rms(high) < rms_um {
        return None;
    }
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if rms(middle) < rms_um { low = middle } else { high = middle }
    }
    Some(at(0.5 * (low + high)))
}

/// Every place with the compliance of shaft and centres there.
fn stations(lathe: &Lathe, places: &[f64], hidden: &[Scaled], bending: f64) -> Vec<(f64, f64)> {
    places.iter().map(|&z| (z, elastic_um_per_n(lathe, z, hidden, bending))).collect()
}

/// Diameter deviations of all runs at these stations, without scatter, um; `force` is a factor.
fn deviations_um(lathe: &Lathe, runs: &[Run], stations: &[(f64, f64)], hidden: &[Scaled], force: f64) -> Vec<f64> {
    let of_run = |(index, run): (usize, &Run)| -> Vec<f64> {
        stations.iter().map(|&station| deviation_um(lathe, run, index, station, hidden, force)).collect()
    };
    runs.iter().enumerate().flat_map(of_run).collect()
}

/// Compliance of shaft and centres at a station; `bending` is a factor on the flexibility of the shaft.
fn elastic_um_per_n(lathe: &Lathe, z: f64, hidden: &[Scaled], bending: f64) -> f64 {
    let change: f64 = hidden.iter().map(Scaled::bending_change).sum();
    beam::compliance_um_per_n(lathe, z, bending * (1.0 + change), rotation_n_mm_per_rad(lathe, hidden))
}

/// What clamps the shaft at the headstock, where that is hidden.
fn rotation_n_mm_per_rad(lathe: &Lathe, hidden: &[Scaled]) -> Option<f64> {
    hidden.iter().find_map(|effect| effect.chuck_n_mm_per_rad(lathe))
}

/// Diameter deviation at a station with its compliance, um: the depth that the tool keeps is found by
/// bisection; errors of the machine are added afterwards, not fed back.
fn deviation_um(
    lathe: &Lathe,
    run: &Run,
    index: usize,
    (z, elastic): (f64, f64),
    hidden: &[Scaled],
    force: f64,
) -> f64 {
    let mut acting = Acting::default();
    let rotation = rotation_n_mm_per_rad(lathe, hidden);
    for effect in hidden {
        effect.act(lathe, run, index, z, rotation, &mut acting);
    }
    let compliance = elastic + lathe.carriage_um_per_n + acting.compliance;
    let (x, p, n) = lathe.exponents;
    let (depth, feed, speed) = REFERENCE;
    let at_depth = |t: f64| {
        let power = force
            * lathe.force_n
            * (t / depth).powf(x + acting.depth_power)
            * (run.feed_mm_per_rev / feed).powf(p)
            * (run.speed_m_per_min / speed).powf(n)
            * (1.0 + acting.factor).max(0.0);
        power + acting.force_n
    };
    // t + C F(t) = commanded depth; the left side grows with t.
    let (mut low, mut high) = (1e-9, run.depth_mm);
    for _ in 0..60 {
        let t = 0.5 * (low + high);
        if t + 1e-3 * compliance * at_depth(t) < run.depth_mm { low = t } else { high = t }
    }
    let opening_um = 1e3 * (run.depth_mm - 0.5 * (low + high));
    2.0 * (opening_um + acting.error_um)
}

fn request(lathe: &Lathe, runs: &[Run], rows: &[Value]) -> Value {
    let (x, p, n) = lathe.exponents;
    let (depth, feed, speed) = REFERENCE;
    let coefficient = lathe.force_n / (depth.powf(x) * feed.powf(p) * speed.powf(n));
    let runs: Vec<Value> = runs.iter().map(Run::said).collect();
    json!({
        "calculator": "deflection-compensation",
        "job": {
            "shaft": {
                "segments": [{
                    "length_mm": lathe.length_mm, "diameter_mm": lathe.diameter_mm,
                    "stock_diameter_mm": lathe.diameter_mm + 2.0 * depth
                }],
                "youngs_modulus_n_per_mm2": beam::YOUNGS_MODULUS_N_PER_MM2
            },
            "supports": [
                { "kind": "centre", "z_mm": 0.0, "compliance_um_per_n": lathe.headstock_um_per_n },
                { "kind": "centre", "z_mm": lathe.length_mm, "compliance_um_per_n": lathe.tailstock_um_per_n }
            ],
            "carriage": { "compliance_um_per_n": lathe.carriage_um_per_n },
            "force": { "kind": "power_law", "passive": {
                "coefficient": coefficient, "depth_exponent": x, "feed_exponent": p, "speed_exponent": n
            } },
            "cut": { "feed_mm_per_rev": feed, "speed_m_per_min": speed, "feed_direction": "to_headstock" },
            "include": { "tangential": false, "axial_moment": false, "weight": false }
        },
        "runs": runs,
        "quantity": "diameter_deviation_um",
        "measurements": rows,
        "allowances": {
            "force_level_rel": FORCE_LEVEL_ALLOWANCE, "force_per_run_rel": FORCE_PER_RUN_ALLOWANCE,
            "bending_rel": BENDING_ALLOWANCE, "setup_diameter_um": SETUP_ALLOWANCE_UM
        }
    })
}
