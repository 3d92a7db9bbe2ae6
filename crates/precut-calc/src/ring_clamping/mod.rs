//! Ring clamping: how round is a thin ring after it is let go, and how hard may it be held?
//!
//! Held, the wall bends (`bending`, wave by wave); the last cut makes it round; let go, it springs back by what it was
//! bent. The way of a job: `input` -> `check` -> `bending` -> `output`; `advice` says what it means, `picture` draws.

// Orders and angles are far fewer than 2^53.
#![allow(clippy::cast_precision_loss)]

mod advice;
mod bending;
mod check;
mod input;
mod output;
mod picture;

pub use input::{Grip, GripDemand, Holding, Job, RingContact};
pub use output::{GripLimits, OtherJaws, Outcome, ReleasedLobes, ReleasedProfile};

use crate::calculator::{
    Answer, Basis, Calculator, CalculatorKind, Codes, Cost, Example, Failure, Figure, Finding, Hallmark, Message, Meta,
    Monitor, Table, checkpoint,
};
use crate::material;
use crate::num::roundness::{Section, circles};

use bending::{ANGLES, Press, Ring, profile};

const UM_PER_MM: f64 = 1e3;
const DEFAULT_POISSON_RATIO: f64 = 0.3;
/// Numbers of jaws that are tried besides.
const OTHER_JAWS: [u32; 6] = [2, 3, 4, 6, 8, 12];
/// Share of the turn that segment jaws cover.
const SEGMENTS: f64 = 0.9;
/// Waves of the answer.
const LOBES: usize = 12;
/// Waves below this share of the largest are left out.
const SMALLEST: f64 = 1e-6;

/// Roundness that is rounding.
const NO_LOBES_UM: f64 = 1e-6;

/// The calculator.
#[derive(Debug, Clone, Copy)]
pub struct RingClamping;

impl Calculator for RingClamping {
    type Input = Job;
    type Output = Outcome;

    const META: Meta = Meta {
        id: "ring-clamping",
        kind: CalculatorKind::Calculator,
        version: 1,
        title: "Ring clamping",
        question: "How round is a thin ring after the chuck is opened, and how hard may it be clamped?",
        summary: "From the finished section of a ring and what holds it (two or more jaws, from outside or inside, with \
                  points or bored jaws; shoes and rollers one by one): the lobes that come when it is let go, the \
                  roundness and what a two-point gauge would see of it, the largest bending stress, the force that the \
                  tolerance allows and the cut asks for, and the same by other jaws. Curved beam with stretching and \
                  shear, wave by wave.",
        references: &[
            "Young, Budynas, Sadegh, Roark's formulas for stress and strain, 8th ed., table 9.2, cases 1 and 7",
            "Timoshenko, Strength of materials, part II, 3rd ed., bending of rings",
            "ISO 12181-1:2011, Roundness",
        ],
        examples: &[
            Example {
                id: "three_jaws",
                title: "Bearing ring 150 x 130 x 24 bored in a three-jaw chuck, to 10 um",
                job: include_str!("examples/three_jaws.json"),
            },
            Example {
                id: "two_shoes",
                title: "Ring ground on two shoes: forces of wheel and shoes",
                job: include_str!("examples/two_shoes.json"),
            },
        ],
        hallmarks: &[
            Hallmark::Of("/outer_diameter_mm"),
            Hallmark::Of("/inner_diameter_mm"),
            Hallmark::Of("/holding/jaws"),
            Hallmark::Of("/holding/force_per_jaw_n"),
            Hallmark::Count("/holding/contacts"),
        ],
        study_outputs: &["/roundness_um", "/two_point_um", "/limits/force_per_jaw_max_n", "/bending_stress_n_per_mm2"],
        codes: CODES,
        figures: picture::FIGURE_IDS,
        tables: picture::TABLE_IDS,
        program: None,
    };

    fn fill(job: &mut Job) {
        if let Some(found) = job.material.take().as_deref().and_then(material::find) {
            job.youngs_modulus_n_per_mm2.get_or_insert(found.youngs_modulus_n_per_mm2.value);
            job.poisson_ratio.get_or_insert(found.poisson_ratio.value);
            if let (None, Some(strength)) = (job.yield_strength_n_per_mm2, found.yield_strength_n_per_mm2) {
                job.yield_strength_n_per_mm2 = Some(strength.value);
            }
        }
        job.poisson_ratio.get_or_insert(DEFAULT_POISSON_RATIO);
    }

    fn cost(_job: &Job) -> Cost {
        // Measured: some thousand waves at 720 angles, a dozen times.
        Cost { ms: 40.0, bytes: 1_000_000, driver: "/holding" }
    }

    fn run(job: &Job, monitor: &dyn Monitor) -> Result<Answer<Outcome>, Failure> {
        let output = outcome(job, monitor)?;
        let warnings = advice::warnings(job, &output);
        let explanation = advice::explanation(job, &output);
        monitor.progress(1.0, Message::new("stage_done"));
        Ok(Answer { output, warnings, explanation, basis: BASIS.to_vec() })
    }

    fn figures(_job: &Job, outcome: &Outcome) -> Vec<Figure> {
        picture::figures(outcome)
    }

    fn tables(_job: &Job, outcome: &Outcome) -> Vec<Table> {
        picture::tables(outcome)
    }
}

/// The equations that act.
const BASIS: &[Basis] = &[
    Basis { equation: "clamping/2.1", source: "radial forces as waves" },
    Basis { equation: "clamping/3.1", source: "curved beam; Roark, table 9.2" },
    Basis { equation: "clamping/4.1", source: "linear elasticity" },
];

/// Everything that this calculator may utter, from where it is said.
const CODES: Codes = Codes {
    faults: &[check::CODES],
    failures: &[FAILURE_CODES],
    warnings: &[advice::WARNING_CODES],
    explanations: &[advice::EXPLANATION_CODES],
    stages: &[&["stage_released", "stage_done"]],
    labels: &[picture::LABEL_CODES],
};

/// Codes of a faultless job without answer.
const FAILURE_CODES: &[&str] = &["bent_out_of_round"];

/// The forces of what holds a ring.
fn presses(holding: &Holding) -> Vec<Press> {
    match holding {
        Holding::Jaws { jaws, force_per_jaw_n, contact_angle_deg, grip } => {
            let sense = if *grip == Grip::Inside { -1.0 } else { 1.0 };
            jaws_of(*jaws, sense * force_per_jaw_n, *contact_angle_deg)
        }
        Holding::Contacts { contacts } => contacts
            .iter()
            .map(|contact| Press {
                angle_rad: contact.angle_deg.to_radians(),
                force_n: contact.force_n,
                over_rad: contact.contact_angle_deg.to_radians(),
            })
            .collect(),
    }
}

fn jaws_of(jaws: u32, force_n: f64, over_deg: f64) -> Vec<Press> {
    let angle = |jaw: u32| std::f64::consts::TAU * f64::from(jaw) / f64::from(jaws);
    (0..jaws).map(|jaw| Press { angle_rad: angle(jaw), force_n, over_rad: over_deg.to_radians() }).collect()
}

impl Job {
    /// Section and material of a filled job; NaN, which no answer lets pass, of one that is not.
    fn ring(&self) -> Ring {
        Ring {
            radius_mm: 0.25 * (self.outer_diameter_mm + self.inner_diameter_mm),
            wall_mm: 0.5 * (self.outer_diameter_mm - self.inner_diameter_mm),
            width_mm: self.width_mm,
            modulus_n_per_mm2: self.youngs_modulus_n_per_mm2.unwrap_or(f64::NAN),
            poisson: self.poisson_ratio.unwrap_or(f64::NAN),
        }
    }
}

fn outcome(job: &Job, monitor: &dyn Monitor) -> Result<Outcome, Failure> {
    checkpoint(monitor)?;
    monitor.progress(0.0, Message::new("stage_released"));
    let ring = job.ring();
    let presses = presses(&job.holding);
    let waves = ring.waves(&presses);
    // What was bent inward when it was cut round stands outward when it is let go.
    let released = profile(&waves);
    let roundness_um = roundness_um(&ring, &released)?;
    let half = ANGLES / 2;
    let diameters = || (0..half).map(|i| released[i] + released[i + half]);
    let (low, high) = diameters().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), d| (l.min(d), h.max(d)));
    let most = waves.iter().map(|wave| wave.cos.hypot(wave.sin)).fold(0.0, f64::max);
    let shown = || waves.iter().filter(|wave| wave.cos.hypot(wave.sin) > SMALLEST * most).take(LOBES);
    let lobes = ReleasedLobes {
        order: shown().map(|wave| wave.order as f64).collect(),
        amplitude_um: shown().map(|wave| UM_PER_MM * wave.cos.hypot(wave.sin)).collect(),
        angle_of_max_deg: shown()
            .map(|wave| {
                let period = 360.0 / wave.order as f64;
                let at = wave.sin.atan2(wave.cos).to_degrees() / wave.order as f64;
                // -0.0 and rounding just below a period are 0.
                let first = at.rem_euclid(period);
                if period - first < 1e-9 { 0.0 } else { first }
            })
            .collect(),
    };
    let (limits, alternatives) = match &job.holding {
        Holding::Jaws { jaws, force_per_jaw_n, contact_angle_deg, .. } => {
            let limits = GripLimits {
                force_per_jaw_max_n: allowed_n(job, *force_per_jaw_n, roundness_um),
                force_per_jaw_min_n: needed_n(job, *jaws),
            };
            (Some(limits), alternatives(job, &ring, *jaws, *force_per_jaw_n, *contact_angle_deg, monitor)?)
        }
        Holding::Contacts { .. } => (None, Vec::new()),
    };
    Ok(Outcome {
        roundness_um,
        two_point_um: UM_PER_MM * (high - low),
        radius_change_um: UM_PER_MM * ring.shrink_mm(&presses),
        lobes,
        profile: ReleasedProfile {
            angle_deg: (0..ANGLES).map(|i| 360.0 * i as f64 / ANGLES as f64).collect(),
            radial_deviation_um: released.iter().map(|mm| UM_PER_MM * mm).collect(),
        },
        bending_stress_n_per_mm2: ring.stress_n_per_mm2(&presses),
        limits,
        alternatives,
    })
}

/// `RONt` about the least-squares circle.
fn roundness_um(ring: &Ring, released_mm: &[f64]) -> Result<f64, Failure> {
    let angles: Vec<f64> = (0..ANGLES).map(|i| std::f64::consts::TAU * i as f64 / ANGLES as f64).collect();
    let radii: Vec<f64> = released_mm.iter().map(|mm| ring.radius_mm + mm).collect();
    let beyond = || Failure::OutOfModel(Finding::new("bent_out_of_round", "/holding"));
    if radii.iter().any(|radius| (radius / ring.radius_mm - 1.0).abs() > 0.05) {
        return Err(beyond());
    }
    let section = Section::from_polar(&angles, &radii).map_err(|_| beyond())?;
    let found = circles(&section, &|| true).map_err(|_| beyond())?;
    Ok(UM_PER_MM * found.least_squares.span.width_mm())
}

/// The force at which the roundness is the tolerance: both grow alike. `None` where jaws all round leave no lobes.
fn allowed_n(job: &Job, force_n: f64, roundness_um: f64) -> Option<f64> {
    let tolerance_um = job.roundness_tolerance_um?;
    (roundness_um > NO_LOBES_UM).then(|| force_n * tolerance_um / roundness_um)
}

/// The force per jaw that the cut asks for: friction at the jaws' diameter against torque and feed force.
fn needed_n(job: &Job, jaws: u32) -> Option<f64> {
    let cutting = job.cutting?;
    let Holding::Jaws { grip, .. } = &job.holding else { return None };
    let held_mm = match grip {
        Grip::Outside => job.outer_diameter_mm,
        Grip::Inside => job.inner_diameter_mm,
    };
    let round_n = cutting.tangential_force_n * cutting.cutting_diameter_mm / held_mm;
    Some(cutting.safety * round_n.hypot(cutting.axial_force_n) / (cutting.friction * f64::from(jaws)))
}

/// Other jaws with the same sum of forces: as narrow as the given ones, and as segments.
fn alternatives(
    job: &Job,
    ring: &Ring,
    jaws: u32,
    force_n: f64,
    over_deg: f64,
    monitor: &dyn Monitor,
) -> Result<Vec<OtherJaws>, Failure> {
    let sum_n = force_n * f64::from(jaws);
    let mut others = Vec::new();
    for count in OTHER_JAWS {
        checkpoint(monitor)?;
        let segment_deg = SEGMENTS * 360.0 / f64::from(count);
        for contact_angle_deg in [over_deg, segment_deg] {
            let is_given = count == jaws && contact_angle_deg.to_bits() == over_deg.to_bits();
            if is_given || contact_angle_deg > segment_deg {
                continue;
            }
            let each_n = sum_n / f64::from(count);
            let released = profile(&ring.waves(&jaws_of(count, each_n, contact_angle_deg)));
            // What would bend a ring out of all round is no way to hold it.
            let Ok(roundness_um) = roundness_um(ring, &released) else { continue };
            others.push(OtherJaws {
                jaws: count,
                contact_angle_deg,
                force_per_jaw_n: each_n,
                roundness_um,
                force_per_jaw_max_n: allowed_n(job, each_n, roundness_um),
            });
        }
    }
    Ok(others)
}
