//! What deflection compensation costs.

use precut_calc::calculator::{Calculator, Unwatched};
use precut_calc::deflection_compensation::{DeflectionCompensation, Job};
use precut_calc::num::beam::{Beam, Contact, Material, Section, Segment, Springs, State, Support, Theory, Wanted};
use precut_calc::path::fewest_chords;
use serde_json::json;

use crate::measure::{Measured, cpu_time};

const LENGTH_MM: f64 = 2000.0;

fn stations(count: u32) -> Vec<f64> {
    (0..count).map(|k| LENGTH_MM * f64::from(k) / f64::from(count - 1)).collect()
}

/// Compliance along a shaft of five segments between two centres, with a steady rest; the shaft is prepared anew each time.
pub(crate) fn compliance(count: u32) -> Result<Measured, String> {
    let steel = Material {
        youngs_modulus_n_per_mm2: 210_000.0,
        poisson_ratio: 0.3,
        density_kg_per_m3: 7850.0,
        gravity_m_per_s2: 9.81,
    };
    let segments: Vec<Segment> = [40.0, 50.0, 60.0, 50.0, 40.0]
        .into_iter()
        .map(|diameter_mm| {
            let section = Section::round(diameter_mm, 0.0, &steel, Theory::EulerBernoulli);
            Segment { length_mm: LENGTH_MM / 5.0, finished: section, stock: section }
        })
        .collect();
    let springs = Springs { radial_mm_per_n: 3e-5, tangential_mm_per_n: 3e-5 };
    let supports = [
        Support::Centre { z_mm: 0.0, springs },
        Support::SteadyRest { z_mm: 900.0, springs, contact: Contact::Bilateral },
        Support::Centre { z_mm: LENGTH_MM, springs },
    ];
    let at = stations(count);
    let none = Wanted { tangential: false, couple: false, weight: false };
    cpu_time(|| Beam::new(&segments, &supports, State::Finished).map(|beam| beam.profile(&at, none)))
}

/// The whole answer of a job: with `detail: profile` the profile, the command, the prediction, copying and form. By default
/// what the job leaves open is tried, and its partly turned section acts; with `as_stated` the finished shaft bends.
pub(crate) fn answer(count: u32, detail: &str, mode: &str) -> Result<Measured, String> {
    let segments: Vec<_> = [0, 10, 0, 5, 0]
        .into_iter()
        .map(|bore| json!({ "length_mm": 400, "diameter_mm": 40, "stock_diameter_mm": 42, "bore_diameter_mm": bore }))
        .collect();
    let mut job: Job = serde_json::from_value(json!({
        "shaft": { "segments": segments, "youngs_modulus_n_per_mm2": 210_000 },
        "supports": [
            { "kind": "centre", "z_mm": 0, "compliance_um_per_n": 0.03 },
            { "kind": "steady_rest", "z_mm": 900, "compliance_um_per_n": 0.03 },
            { "kind": "centre", "z_mm": 2000, "compliance_um_per_n": 0.03 }
        ],
        "carriage": { "compliance_um_per_n": 0.03 },
        "force": {
            "kind": "power_law",
            "passive": { "coefficient": 2430, "depth_exponent": 0.9, "feed_exponent": 0.6, "speed_exponent": -0.3 }
        },
        "cut": { "feed_mm_per_rev": 0.2, "speed_m_per_min": 140 },
        "stations": { "kind": "per_zone", "count": count },
        "tolerance": { "form_um": 20 },
        "include": { "mode": mode },
        "detail": detail
    }))
    .map_err(|error| error.to_string())?;
    DeflectionCompensation::fill(&mut job);
    cpu_time(|| DeflectionCompensation::run(&job, &Unwatched))
}

/// Fewest chords within 0.5 um of the paper's example between unequal centres.
pub(crate) fn chords(count: u32) -> Result<Measured, String> {
    let z = stations(count);
    let flexural = 210_000.0 * std::f64::consts::PI * 90.0_f64.powi(4) / 64.0;
    let radius = |&x: &f64| {
        let u = x / LENGTH_MM;
        let bending = x * x * (LENGTH_MM - x).powi(2) / (3.0 * flexural * LENGTH_MM);
        45.0 - 194.515 * (bending + (1.0 - u).powi(2) * 2.857e-5 + u * u * 5.714e-5 + 2.857e-5)
    };
    let r: Vec<f64> = z.iter().map(radius).collect();
    cpu_time(|| fewest_chords(&z, &r, 5e-4))
}
