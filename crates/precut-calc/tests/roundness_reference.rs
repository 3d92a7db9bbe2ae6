//! Reference circles, filter and spectrum against the reference cases and against the NIST reference pairs.
#![allow(
    clippy::unwrap_used,
    clippy::panic,
    clippy::print_stdout,
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    clippy::cast_precision_loss,
    missing_docs
)]

use std::path::Path;

use precut_calc::num::roundness::{
    Circles, Filter, Grid, Section, Span, circles, evaluate, least_squares, minimum_zone,
};
use serde_json::Value;

const UM: f64 = 1e3;

fn number(value: &Value) -> f64 {
    value.as_f64().unwrap_or_else(|| panic!("{value} is no number"))
}

fn pairs(value: &Value) -> (Vec<f64>, Vec<f64>) {
    value.as_array().unwrap().iter().map(|p| (number(&p[0]), number(&p[1]))).unzip()
}

/// The radius that a sketch of a profile describes.
fn radius_mm(profile: &Value, angle: f64) -> f64 {
    let mean = number(&profile["R_mm"]);
    let e = profile["ellipse_e_mm"].as_f64().unwrap_or(0.0);
    let (a, b) = (mean + e / 2.0, mean - e / 2.0);
    let ellipse = a * b / ((b * angle.cos()).powi(2) + (a * angle.sin()).powi(2)).sqrt();
    let harmonic = |h: &Value| {
        let max = number(&h["angle_of_max_deg"]).to_radians();
        number(&h["amplitude_um"]) / UM * (number(&h["k"]) * (angle - max)).cos()
    };
    let waves: f64 = profile["harmonics"].as_array().into_iter().flatten().map(harmonic).sum();
    ellipse + waves
}

fn section(input: &Value) -> Section {
    if input["points_xy"].is_array() {
        let (x, y) = pairs(&input["points_xy"]);
        return Section::from_points(&x, &y).unwrap();
    }
    let n = input["samples"].as_u64().unwrap() as usize;
    let angles: Vec<f64> = (0..n).map(|i| std::f64::consts::TAU * i as f64 / n as f64).collect();
    let mut radii: Vec<f64> = angles.iter().map(|&angle| radius_mm(&input["profile"], angle)).collect();
    for step in input["steps"].as_array().into_iter().flatten() {
        for (radius, angle) in radii.iter_mut().zip(&angles) {
            let after = (angle.to_degrees() - number(&step["angle_deg"])).rem_euclid(360.0);
            *radius += number(&step["height_um"]) / UM * after / 360.0;
        }
    }
    for spike in input["spikes"].as_array().into_iter().flatten() {
        radii[spike["index"].as_u64().unwrap() as usize] += number(&spike["height_um"]) / UM;
    }
    let moved = |axis: usize| input["eccentricity_mm"].get(axis).map_or(0.0, number);
    let x: Vec<f64> = radii.iter().zip(&angles).map(|(r, a)| r * a.cos() + moved(0)).collect();
    let y: Vec<f64> = radii.iter().zip(&angles).map(|(r, a)| r * a.sin() + moved(1)).collect();
    Section::from_points(&x, &y).unwrap()
}

/// Compares whatever the case states.
struct Comparison<'a> {
    name: String,
    expected: &'a Value,
    tolerance: &'a Value,
    flat: &'a Value,
    compared: usize,
}

impl Comparison<'_> {
    fn close(&mut self, circle: &str, key: &str, tolerance: &str, got: f64) {
        let wanted = &self.expected[circle][key];
        // Where the optimum is flat the case has a tolerance of its own for the inscribed and circumscribed circle.
        let flat = ["MICI", "MCCI"].contains(&circle).then(|| &self.flat[tolerance]).filter(|own| own.is_number());
        let slack = number(flat.unwrap_or(&self.tolerance[tolerance]));
        if !wanted.is_null() {
            self.compared += 1;
            let error = (got - number(wanted)).abs();
            assert!(error <= slack, "{} {circle} {key}: {got} instead of {wanted}, off by {error:e}", self.name);
        }
    }

    fn centre(&mut self, circle: &str, got: [f64; 2]) {
        let wanted = &self.expected[circle]["center_mm"];
        for (axis, got) in got.iter().enumerate() {
            if !wanted.is_null() {
                self.compared += 1;
                let error = (got - number(&wanted[axis])).abs();
                assert!(
                    error <= number(&self.tolerance["center_mm"]),
                    "{} {circle}: centre off by {error:e}",
                    self.name
                );
            }
        }
    }

    fn circle(&mut self, name: &str, centre: [f64; 2], radius: f64, span: &Span) {
        self.centre(name, centre);
        self.close(name, "radius_mm", "radius_mm", radius);
        self.close(name, "RONt_um", "RON_um", span.width_mm() * UM);
    }

    fn all(&mut self, found: &Circles) {
        let ls = &found.least_squares;
        self.circle("LSCI", ls.circle.centre_mm, ls.circle.radius_mm, &ls.span);
        self.close("LSCI", "RONp_um", "RON_um", ls.peak_mm * UM);
        self.close("LSCI", "RONv_um", "RON_um", ls.valley_mm * UM);
        self.close("LSCI", "RONq_um", "RON_um", ls.rms_mm * UM);
        let mz = &found.minimum_zone;
        self.centre("MZCI", mz.centre_mm);
        self.close("MZCI", "RONt_um", "RON_um", mz.width_mm() * UM);
        self.close("MZCI", "radius_mm", "radius_mm", f64::midpoint(mz.inner_radius_mm, mz.outer_radius_mm));
        self.close("MZCI", "outer_radius_mm", "radius_mm", mz.outer_radius_mm);
        self.close("MZCI", "inner_radius_mm", "radius_mm", mz.inner_radius_mm);
        let mi = &found.inscribed;
        self.circle("MICI", mi.circle.centre_mm, mi.circle.radius_mm, &mi.span);
        let mc = &found.circumscribed;
        self.circle("MCCI", mc.circle.centre_mm, mc.circle.radius_mm, &mc.span);
    }
}

#[test]
fn all_reference_cases() {
    let folder = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/..")).join("tests/reference/ring-roundness");
    let mut cases = 0;
    for entry in std::fs::read_dir(folder).unwrap() {
        let path = entry.unwrap().path();
        let name = path.file_stem().unwrap().to_string_lossy().into_owned();
        if !name.starts_with("ron_") {
            continue;
        }
        cases += 1;
        let case: Value = serde_json::from_str(&std::fs::read_to_string(&path).unwrap()).unwrap();
        let section = section(&case["input"]);
        let found = circles(&section, &|| true).unwrap();
        let (tolerance, flat) = (&case["tolerance_abs"], &case["tolerance_abs_MICI_MCCI"]);
        let comparison = |kind| Comparison {
            name: format!("{name} {kind}"),
            expected: &case["expected"][kind],
            tolerance,
            flat,
            compared: 0,
        };
        let mut unfiltered = comparison("unfiltered");
        unfiltered.all(&found);
        assert!(unfiltered.compared >= 14, "{name}: {} numbers compared", unfiltered.compared);
        let Some(cutoff_upr) = case["input"]["filter_cutoff_upr"].as_f64() else { continue };
        let grid = Grid::new(section.len()).unwrap();
        let evaluation = evaluate(&section, &grid, Filter::LowPass { cutoff_upr }, 50, &|| true).unwrap();
        let mut filtered = comparison("filtered");
        filtered.all(&evaluation.filtered);
        assert!(filtered.compared >= 14, "{name}: {} numbers compared", filtered.compared);
        for (order, amplitude) in case["expected"]["harmonic_amplitudes_um"].as_object().unwrap() {
            let order: usize = order.parse().unwrap();
            let got = evaluation.spectrum[order - 1];
            assert_eq!(got.order, order);
            let error = (got.amplitude_mm * UM - number(amplitude)).abs();
            assert!(error < number(&tolerance["RON_um"]), "{name}: harmonic {order} off by {error:e} um");
        }
    }
    assert_eq!(cases, 8);
}

/// The sampled ellipse has two largest inscribed circles, mirrored in its minor axis; the answer says so.
#[test]
fn the_inscribed_circle_of_an_ellipse_is_not_unique() {
    let path = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/.."))
        .join("tests/reference/ring-roundness/ron_02_ellipse.json");
    let case: Value = serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap();
    let found = circles(&section(&case["input"]), &|| true).unwrap();
    let mi = &found.inscribed;
    assert!(mi.is_global);
    assert_eq!(mi.others.len(), 1, "{mi:?}");
    let (here, there) = (mi.circle.centre_mm, mi.others[0].circle.centre_mm);
    // The case file: about 0.004 mm on either side; the centres are known to the bounds that the answer states.
    assert!((here[0] + there[0]).abs() < 2.0 * mi.centre_error_mm && (here[0].abs() - 0.004).abs() < 5e-4, "{mi:?}");
    assert!(found.minimum_zone.is_global);
}

/// The file of reference pairs is public, but not ours to copy.
fn nist() -> Option<Value> {
    let path = Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/.."))
        .join("../../../shared/reference/nist/circle2d_reference_pairs.json");
    match std::fs::read_to_string(&path) {
        Ok(text) => Some(serde_json::from_str(&text).unwrap()),
        Err(error) => {
            assert!(std::env::var_os("CI").is_none(), "{}: {error}", path.display());
            println!("{} is not there: nothing compared", path.display());
            None
        }
    }
}

#[test]
fn least_squares_circles_meet_the_nist_pairs() {
    let Some(file) = nist() else { return };
    let mut sets = 0;
    let mut worst: f64 = 0.0;
    for set in file["sets"].as_array().unwrap() {
        sets += 1;
        let (x, y) = pairs(&set["points"]);
        let section = Section::from_points(&x, &y).unwrap();
        let found = least_squares(&section, &|| true).unwrap();
        let text = |value: &Value| value.as_str().unwrap().parse::<f64>().unwrap();
        let wanted = &set["nist_least_squares"];
        let centre = [text(&wanted["center"][0]), text(&wanted["center"][1])];
        let error = (0..2).map(|axis| (found.circle.centre_mm[axis] - centre[axis]).abs()).fold(0.0, f64::max);
        let error = error.max((2.0 * found.circle.radius_mm - text(&wanted["diameter"])).abs());
        // Asked: 1e-11 mm or 1e-13 of the distance from the origin; reached: 1e-12 mm, and the bound that is stated,
        // beside the last place of the coordinate itself.
        let place = f64::EPSILON * centre[0].hypot(centre[1]);
        assert!(error < 1e-12, "{}: off by {error:e}", set["id"]);
        assert!(error <= found.centre_error_mm + place, "{}: {error:e} > {:e}", set["id"], found.centre_error_mm);
        worst = worst.max(error);
    }
    assert_eq!(sets, 30);
    println!("largest error of centre or diameter: {worst:e} mm");
}

#[test]
fn minimum_zones_of_the_nist_sets_are_not_wider_than_those_found_before() {
    let Some(file) = nist() else { return };
    for set in file["sets"].as_array().unwrap() {
        let (x, y) = pairs(&set["points"]);
        let section = Section::from_points(&x, &y).unwrap();
        let start = least_squares(&section, &|| true).unwrap().circle.centre_mm;
        if section.len() < 4 {
            let width = minimum_zone(&section, start, &|| true).unwrap().width_mm();
            assert!(width < 1e-12, "three points lie on a circle: {width}");
            continue;
        }
        let found = minimum_zone(&section, start, &|| true).unwrap_or_else(|e| panic!("{}: {e}", set["id"]));
        let before = &set["computed"]["minimum_zone"];
        let (width, known) = (found.width_mm(), number(&before["width"]));
        // The zones in the file were found by linear programming in double precision; one is 3e-11 mm too wide.
        assert!(width <= known + 1e-12 && width >= known - 1e-10, "{}: {width} against {known}", set["id"]);
        assert!(found.stiffness > 0.0 && found.width_error_mm < 1e-11, "{}: {found:?}", set["id"]);
        if set["arc_span_deg"].as_f64().unwrap() > 300.0 {
            assert!(found.is_global, "{}: {found:?}", set["id"]);
        }
    }
}
