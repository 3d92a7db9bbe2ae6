//! Cutting trials: roughness, force or tool life over regimes, one value a cut.
//!
//! The law is a product of powers of ratios, not a polynomial of logarithms; speed and depth that are really cut differ
//! from what is written down; scatter is that of Student's t with six degrees of freedom, uneven from cut to cut.

mod hide;
mod ideal;

pub use ideal::is_found;

use serde_json::{Value, json};

use crate::{Class, Hidden, Later, Random, Scatter, Trial, Truth};
use hide::{CAUSES, OUTSIDE, OUTSIDE_CONDITIONS, Scaled, Size};

const SPEEDS: [f64; 5] = [20.0, 35.0, 60.0, 100.0, 160.0];
const FEEDS: [f64; 5] = [0.06, 0.1, 0.16, 0.25, 0.4];
const DEPTHS: [f64; 5] = [0.3, 0.6, 1.0, 1.8, 3.0];
/// Where the law has its value.
pub(crate) const MIDDLE: [f64; 3] = [60.0, 0.2, 1.0];
/// Standard deviation of the level that is allowed without being a finding.
const LEVEL: f64 = 0.01;
/// Largest error of the speed and of the depth really cut.
const SPEED_ERROR: f64 = 0.01;
const DEPTH_ERROR: f64 = 0.005;

/// A measured output and its law.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Output {
    pub(crate) quantity: &'static str,
    pub(crate) model: &'static str,
    pub(crate) middle: f64,
    pub(crate) powers: [f64; 3],
}

/// One cut as it is written down.
#[derive(Debug, Clone, Copy)]
pub(crate) struct Cut {
    pub(crate) speed: f64,
    pub(crate) feed: f64,
    pub(crate) depth: f64,
    pub(crate) wear_mm: f64,
    pub(crate) second_batch: bool,
    pub(crate) test: u32,
    /// Place in the order of testing, 0 to 1.
    pub(crate) when: f64,
    pub(crate) radius_mm: f64,
    /// How long the edge has cut.
    pub(crate) time_min: f64,
}

/// How the regimes of a trial are chosen.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Plan {
    /// Of a few levels each, some cut several times, in a stated order.
    Levels,
    /// As a workshop's records have them: any values, none twice, no order; with the time and the nose radius of every cut.
    Continuous,
}

impl Output {
    /// The law without anything hidden.
    pub(crate) fn plain(&self, cut: &Cut) -> f64 {
        let ratios = [cut.speed / MIDDLE[0], cut.feed / MIDDLE[1], cut.depth / MIDDLE[2]];
        self.middle * ratios.iter().zip(self.powers).map(|(ratio, power)| ratio.powf(power)).product::<f64>()
    }
}

/// Draws a trial. `snr` is that of every hidden cause.
pub fn draw(class: Class, snr: f64, seed: u64) -> Trial {
    draw_scattered(Scatter::Student, class, snr, seed)
}

/// The same with rows that scatter otherwise.
pub fn draw_scattered(scatter: Scatter, class: Class, snr: f64, seed: u64) -> Trial {
    drawn((Plan::Levels, scatter), class, snr, seed).trial
}

/// The same over regimes of any values, none of which is cut twice, without an order.
pub fn draw_continuous(class: Class, snr: f64, seed: u64) -> Trial {
    draw_continuous_scattered(Scatter::Student, class, snr, seed)
}

/// Regimes of any values, and rows that scatter otherwise.
pub fn draw_continuous_scattered(scatter: Scatter, class: Class, snr: f64, seed: u64) -> Trial {
    drawn((Plan::Continuous, scatter), class, snr, seed).trial
}

/// A trial and what it was made of.
struct Drawn {
    trial: Trial,
    output: Output,
    cuts: Vec<Cut>,
    hidden: Vec<Scaled>,
    /// Logarithm of what was measured over what the law alone would give.
    residual: Vec<f64>,
}

impl Drawn {
    /// What a cause alone changes in the logarithm of every row.
    fn signature(&self, hidden: &[Scaled]) -> Vec<f64> {
        self.cuts.iter().map(|cut| (with(hidden, &self.output, cut) / self.output.plain(cut)).ln()).collect()
    }
}

fn drawn(plan: (Plan, Scatter), class: Class, snr: f64, seed: u64) -> Drawn {
    let mut random = Random::new(seed);
    loop {
        // A cause that this draw cannot show is drawn again.
        if let Some(drawn) = attempt(plan, class, snr, &mut random) {
            return drawn;
        }
    }
}

fn attempt((plan, scatter): (Plan, Scatter), class: Class, snr: f64, random: &mut Random) -> Option<Drawn> {
    let output = output(random);
    let cuts = cuts(plan, random);
    let sigma = random.uniform(0.03, 0.06);
    let causes: Vec<Size> = match class {
        Class::Nothing => Vec::new(),
        Class::One => vec![random.pick(CAUSES)],
        Class::Two => {
            let (first, second) = (random.pick(CAUSES), random.pick(CAUSES));
            if first.kind == second.kind {
                return None;
            }
            vec![first, second]
        }
        Class::Outside => match plan {
            Plan::Levels => vec![random.pick(OUTSIDE)],
            Plan::Continuous => vec![random.pick(OUTSIDE_CONDITIONS)],
        },
    };
    let mut hidden = Vec::new();
    for cause in causes {
        hidden.push(scaled(cause, &output, &cuts, snr * sigma, random)?);
    }
    let level = 1.0 + random.uniform_sd(LEVEL);
    let (rows, measured) = measure((plan, scatter), &output, &hidden, &cuts, (level, sigma), random);
    let residual = measured.iter().zip(&cuts).map(|(value, cut)| (value / output.plain(cut)).ln()).collect();
    // Another day, other regimes, the same tool.
    let same_tool = |cut: &Cut| if plan == Plan::Levels { Cut { radius_mm: cuts[0].radius_mm, ..*cut } } else { *cut };
    let cuts_later: Vec<Cut> = self::cuts(plan, random).iter().map(same_tool).collect();
    let (rows_later, _) = measure((plan, scatter), &output, &hidden, &cuts_later, (level, sigma), random);
    let best = cuts_later.iter().map(|cut| with(&hidden, &output, cut).ln()).collect();
    let radius_mm = cuts.first().map_or(0.8, |cut| cut.radius_mm);
    let truth = Truth { class, causes: Vec::new(), together: Vec::new() };
    let later = Some(Later { request: request(&output, radius_mm, rows_later), best });
    let trial = Trial { request: request(&output, radius_mm, rows), truth, sigma, later };
    let mut drawn = Drawn { trial, output, cuts, hidden, residual };
    let of = |one: &Scaled| Hidden {
        kind: one.cause.kind,
        size: one.size,
        shapes: one.shapes(),
        snr,
        signature: drawn.signature(std::slice::from_ref(one)),
    };
    let causes = drawn.hidden.iter().map(of).collect();
    drawn.trial.truth = Truth { class, causes, together: drawn.signature(&drawn.hidden) };
    Some(drawn)
}

/// Rows of these cuts, and their values; `level` is a factor on all of them.
fn measure(
    (plan, scatter): (Plan, Scatter),
    output: &Output,
    hidden: &[Scaled],
    cuts: &[Cut],
    (level, sigma): (f64, f64),
    random: &mut Random,
) -> (Vec<Value>, Vec<f64>) {
    let mut measured = |cut: &Cut| {
        let real = Cut {
            speed: cut.speed * (1.0 + random.uniform(-SPEED_ERROR, SPEED_ERROR)),
            depth: cut.depth * (1.0 + random.uniform(-DEPTH_ERROR, DEPTH_ERROR)),
            ..*cut
        };
        let noise = sigma * random.uniform(0.8, 1.2) * scatter.next(random);
        let value = level * with(hidden, output, &real) * noise.exp();
        let mut row = json!({
            "speed_m_per_min": cut.speed, "feed_mm_per_rev": cut.feed, "depth_mm": cut.depth,
            "flank_wear_mm": cut.wear_mm, "batch": if cut.second_batch { "B" } else { "A" }
        });
        match plan {
            Plan::Levels => row["test"] = json!(cut.test),
            Plan::Continuous => {
                row["time_min"] = json!(cut.time_min);
                row["nose_radius_mm"] = json!(cut.radius_mm);
            }
        }
        row[output.quantity] = json!(rounded(value, if scatter == Scatter::Rounded { 2 } else { 4 }));
        (row, value)
    };
    cuts.iter().map(&mut measured).unzip()
}

fn output(random: &mut Random) -> Output {
    match random.whole(0, 2) {
        0 => Output {
            quantity: "roughness_um",
            model: "roughness",
            middle: random.uniform(1.2, 2.5),
            powers: [random.uniform(-0.3, -0.1), random.uniform(0.6, 1.0), random.uniform(0.05, 0.2)],
        },
        1 => Output {
            quantity: "force_z_n",
            model: "force_z",
            middle: random.uniform(250.0, 700.0),
            powers: [random.uniform(-0.2, 0.0), random.uniform(0.65, 0.8), random.uniform(0.85, 1.0)],
        },
        _ => Output {
            quantity: "tool_life_min",
            model: "tool_life",
            middle: random.uniform(30.0, 120.0),
            powers: [random.uniform(-3.5, -2.0), random.uniform(-1.2, -0.5), random.uniform(-0.4, -0.1)],
        },
    }
}

fn cuts(plan: Plan, random: &mut Random) -> Vec<Cut> {
    match plan {
        Plan::Levels => cuts_on_levels(random),
        Plan::Continuous => cuts_anywhere(random),
    }
}

/// Regimes as they came up, written down to three digits.
fn cuts_anywhere(random: &mut Random) -> Vec<Cut> {
    let between = |[low, high]: [f64; 2], random: &mut Random| {
        three_digits((low.ln() + (high / low).ln() * random.uniform(0.0, 1.0)).exp())
    };
    let tests = random.whole(50, 90);
    let mut cut = |test: usize| Cut {
        speed: between([20.0, 160.0], random),
        feed: between([0.06, 0.4], random),
        depth: between([0.3, 3.0], random),
        wear_mm: (100.0 * random.uniform(0.02, 0.4)).round() / 100.0,
        second_batch: random.chance(0.5),
        test: u32::try_from(test + 1).unwrap_or(u32::MAX),
        when: 0.0,
        radius_mm: random.pick(&[0.4, 0.8, 1.2]),
        time_min: (10.0 * random.uniform(1.0, 30.0)).round() / 10.0,
    };
    (0..tests).map(&mut cut).collect()
}

/// Regimes of a plan in random order, some of them cut twice or thrice.
fn cuts_on_levels(random: &mut Random) -> Vec<Cut> {
    let tests = random.whole(36, 60);
    let radius_mm = random.pick(&[0.4, 0.8, 1.2]);
    let mut cuts = Vec::new();
    for test in 0..tests {
        let cut = Cut {
            speed: random.pick(&SPEEDS),
            feed: random.pick(&FEEDS),
            depth: random.pick(&DEPTHS),
            wear_mm: (100.0 * random.uniform(0.02, 0.4)).round() / 100.0,
            second_batch: random.chance(0.5),
            test: u32::try_from(test + 1).unwrap_or(u32::MAX),
            when: test as f64 / (tests - 1) as f64,
            radius_mm,
            time_min: 0.0,
        };
        let repeats = random.pick(&[1, 1, 2, 3]);
        cuts.extend(std::iter::repeat_n(cut, repeats));
    }
    cuts
}

fn with(hidden: &[Scaled], output: &Output, cut: &Cut) -> f64 {
    let times: f64 = hidden.iter().map(|effect| effect.times(cut)).product();
    let marks = hidden.iter().filter_map(|effect| effect.marks_um(cut)).fold(0.0, f64::max);
    let added: f64 = hidden.iter().map(|effect| effect.added(output, cut)).sum();
    let own = output.plain(cut) * times;
    // The larger of the two, rounded off where they are alike.
    let top = own.max(marks);
    top * ((own / top).powi(8) + (marks / top).powi(8)).powf(0.125) + added
}

/// The size at which the root mean square of what it does to the logarithm is as asked for; `None` where the cause
/// cannot act on this output, or only at a size that nobody would believe.
fn scaled(cause: Size, output: &Output, cuts: &[Cut], rms: f64, random: &mut Random) -> Option<Scaled> {
    if !cause.acts_on(output) {
        return None;
    }
    let sign = if cause.two_sided { random.sign() } else { 1.0 };
    let form = [random.uniform(0.0, 1.0), random.uniform(0.0, 1.0)];
    let unit = if cause.share { output.middle } else { 1.0 };
    let at = |size: f64| Scaled { cause, size: sign * size * unit, form };
    let reached = |size: f64| {
        let effect = [at(size)];
        let square = |cut: &Cut| (with(&effect, output, cut) / output.plain(cut)).ln().powi(2);
        (cuts.iter().map(square).sum::<f64>() / cuts.len() as f64).sqrt()
    };
    if reached(cause.most) < rms {
        return None;
    }
    let (mut low, mut high) = (0.0, cause.most);
    for _ in 0..40 {
        let middle = 0.5 * (low + high);
        if reached(middle) < rms { low = middle } else { high = middle }
    }
    Some(at(0.5 * (low + high)))
}

fn three_digits(value: f64) -> f64 {
    rounded(value, 3)
}

fn rounded(value: f64, digits: u8) -> f64 {
    let scale = 10.0_f64.powf(f64::from(digits) - 1.0 - value.log10().floor());
    (value * scale).round() / scale
}

#[allow(clippy::needless_pass_by_value)] // they become part of the request
fn request(output: &Output, radius_mm: f64, rows: Vec<Value>) -> Value {
    let powers = output.powers;
    let constant = output.middle.ln() - powers.iter().zip(MIDDLE).map(|(power, at)| power * at.ln()).sum::<f64>();
    let model = json!({
        "form": "log_log", "constant": constant,
        "speed_exponent": powers[0], "feed_exponent": powers[1], "depth_exponent": powers[2]
    });
    json!({
        "calculator": "feed-schedule",
        "job": {
            "models": { output.model: model },
            "reference": { "speed_m_per_min": MIDDLE[0], "feed_mm_per_rev": MIDDLE[1], "depth_mm": MIDDLE[2] }
        },
        "runs": [{ "nose_radius_mm": radius_mm }],
        "quantity": output.quantity,
        "measurements": rows
    })
}
