//! The evaluation as a calculator: forms of input, what is refused, what is warned of, and the errors that it states.
#![allow(
    clippy::unwrap_used,
    clippy::panic,
    clippy::cast_possible_truncation,
    clippy::cast_sign_loss,
    clippy::cast_precision_loss,
    missing_docs
)]

use std::f64::consts::TAU;

use precut_calc::calculator::{Answer, Calculator, Check, Failure, Item, Unwatched, Violations};
use precut_calc::ring_roundness::evaluation::{ContactKind, Job, Outcome, RoundnessEvaluation};
use serde_json::{Value, json};

fn job(text: Value) -> Job {
    serde_json::from_value(text).unwrap()
}

/// Codes and pointers of a job's faults.
fn faults(text: Value) -> Vec<(&'static str, String)> {
    let mut violations = Violations::default();
    job(text).check(&mut violations);
    violations.into_vec().into_iter().map(|finding| (finding.code, finding.pointer)).collect()
}

fn run(text: Value) -> Result<Answer<Outcome>, Failure> {
    assert_eq!(faults(text.clone()), []);
    let mut job = job(text);
    RoundnessEvaluation::fill(&mut job);
    RoundnessEvaluation::run(&job, &Unwatched)
}

fn solve(text: Value) -> Answer<Outcome> {
    run(text).unwrap()
}

fn warned(answer: &Answer<Outcome>) -> Vec<&'static str> {
    answer.warnings.iter().map(|finding| finding.code).collect()
}

/// Deviation of a form of a few lobes, µm.
fn form_um(angle: f64) -> f64 {
    4.0 * (3.0 * (angle - 0.3)).cos() + 1.5 * (5.0 * (angle - 0.1)).cos() + 0.5 * (11.0 * angle).cos()
}

/// A ring of 25 mm radius, its centre where it is said, as seen from the origin: exact radii of a profile about its own centre.
fn ring(count: usize, centre: [f64; 2]) -> Vec<(f64, f64)> {
    (0..count)
        .map(|i| TAU * i as f64 / count as f64)
        .map(|angle| (angle, 25.0 + form_um(angle) / 1e3))
        .map(|(angle, r)| (centre[0] + r * angle.cos(), centre[1] + r * angle.sin()))
        .collect()
}

/// As seen from the origin, by angle from 0 to 360 degrees.
fn radii(points: &[(f64, f64)]) -> Vec<Value> {
    let polar = |(x, y): &(f64, f64)| (y.atan2(*x).to_degrees().rem_euclid(360.0), x.hypot(*y));
    let mut rows: Vec<(f64, f64)> = points.iter().map(polar).collect();
    // Round-off puts the direction 0 at 360.
    for row in rows.iter_mut().filter(|row| row.0 > 360.0 - 1e-9) {
        row.0 = 0.0;
    }
    rows.sort_by(|a, b| a.0.total_cmp(&b.0));
    rows.iter().map(|(angle, radius)| json!({ "angle_deg": angle, "radius_mm": radius })).collect()
}

fn deviations(points: &[(f64, f64)], nominal: f64, per_mm: f64) -> Vec<Value> {
    radii(points)
        .iter()
        .map(|row| {
            let deviation = (row["radius_mm"].as_f64().unwrap() - nominal) * per_mm;
            json!({ "angle_deg": row["angle_deg"], "radial_deviation_um": deviation })
        })
        .collect()
}

fn xy(points: &[(f64, f64)]) -> Vec<Value> {
    points.iter().map(|(x, y)| json!({ "x_mm": x, "y_mm": y })).collect()
}

fn close(a: f64, b: f64, within: f64) {
    assert!((a - b).abs() <= within, "{a} and {b} differ by {:e}", (a - b).abs());
}

#[test]
fn the_form_of_the_input_does_not_matter() {
    let points = ring(360, [0.01, -0.02]);
    let mut shuffled = points.clone();
    shuffled.reverse();
    shuffled.rotate_left(100);
    let all = [
        solve(json!({ "radii": radii(&points) })),
        solve(json!({ "deviations": deviations(&points, 25.0, 1e3), "nominal_radius_mm": 25.0 })),
        solve(json!({ "points": xy(&points) })),
        solve(json!({ "points": xy(&shuffled) })),
        solve(json!({ "points": xy(&ring(360, [800.01, -400.02])) })),
    ];
    let first = &all[0].output;
    for answer in &all {
        let outcome = &answer.output;
        // Round-off of the coordinates, up to 1000 mm here, in um: 1000·2.2e-16·1e3 for every last place.
        let slack = 1e-8;
        close(outcome.roundness_um, first.roundness_um, slack);
        for (a, b) in [
            (&outcome.measured.minimum_zone, &first.measured.minimum_zone),
            (&outcome.filtered.least_squares, &first.filtered.least_squares),
            (&outcome.filtered.maximum_inscribed, &first.filtered.maximum_inscribed),
            (&outcome.filtered.minimum_circumscribed, &first.filtered.minimum_circumscribed),
        ] {
            close(a.radius_mm, b.radius_mm, slack);
            close(a.ront_um, b.ront_um, slack);
        }
        for (a, b) in outcome.spectrum.amplitude_um.iter().zip(&first.spectrum.amplitude_um) {
            close(*a, *b, slack);
        }
        assert_eq!(warned(answer), Vec::<&str>::new());
    }
    // Amplitude and phase of the form itself; the centre that least squares finds is that of the form to 1e-6 mm.
    close(first.spectrum.amplitude_um[1], 4.0, 1e-5);
    close(first.spectrum.angle_of_max_deg[1], 0.3_f64.to_degrees(), 1e-4);
    close(first.spectrum.amplitude_um[9], 0.5, 1e-5);
    close(first.data.eccentricity_mm, 0.01_f64.hypot(0.02), 1e-6);
}

/// A case of the reference files through the whole calculator: a profile without eccentricity, and its filter.
#[test]
fn a_reference_case_as_a_job() {
    let path = std::path::Path::new(concat!(env!("CARGO_MANIFEST_DIR"), "/.."))
        .join("tests/reference/ring-roundness/ron_07_spiral_step.json");
    let case: Value = serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap();
    let rows: Vec<Value> = (0..1000)
        .map(|i| 0.36 * f64::from(i))
        .map(|angle| json!({ "angle_deg": angle, "radius_mm": 149.4 + 0.0145 * (angle - 48.0).rem_euclid(360.0) / 360.0 }))
        .collect();
    let answer = solve(
        json!({ "radii": rows, "filter": { "kind": "low_pass", "cutoff_upr": 50 }, "reference": "minimum_zone" }),
    );
    let number = |pointer: &str| case["expected"].pointer(pointer).unwrap().as_f64().unwrap();
    // The case file's own tolerances.
    close(answer.output.roundness_um, number("/filtered/MZCI/RONt_um"), 1e-4);
    let ls = &answer.output.filtered.least_squares;
    close(ls.ront_um, number("/filtered/LSCI/RONt_um"), 1e-4);
    close(ls.ronp_um.unwrap(), number("/filtered/LSCI/RONp_um"), 1e-4);
    close(ls.ronv_um.unwrap(), number("/filtered/LSCI/RONv_um"), 1e-4);
    close(ls.ronq_um.unwrap(), number("/filtered/LSCI/RONq_um"), 1e-4);
    close(answer.output.measured.maximum_inscribed.radius_mm, number("/unfiltered/MICI/radius_mm"), 1e-8);
    close(answer.output.measured.minimum_zone.centre_x_mm, number("/unfiltered/MZCI/center_mm/0"), 1e-7);
}

#[test]
fn every_circle_names_its_contacts_and_its_proof() {
    let points = ring(90, [0.05, 0.0]);
    let outcome = solve(json!({ "points": xy(&points), "filter": { "kind": "none" } })).output;
    let distance = |row: usize, x: f64, y: f64| (points[row].0 - x).hypot(points[row].1 - y);
    for circle in
        [&outcome.measured.minimum_zone, &outcome.measured.maximum_inscribed, &outcome.measured.minimum_circumscribed]
    {
        let proof = circle.proof.as_ref().unwrap();
        assert!(proof.is_global && proof.is_unique && proof.others.is_empty());
        for contact in &circle.contacts {
            let row = contact.row.unwrap();
            let radius = match contact.kind {
                ContactKind::Outer | ContactKind::Peak => circle.outer_radius_mm,
                ContactKind::Inner | ContactKind::Valley => circle.inner_radius_mm,
            };
            close(distance(row, circle.centre_x_mm, circle.centre_y_mm), radius, 1e-13);
        }
    }
    let zone = &outcome.measured.minimum_zone;
    close(zone.proof.as_ref().unwrap().bound_mm * 1e3, zone.ront_um, zone.numerical_error_um);
    assert_eq!(zone.contacts.len(), 4);
    assert!(outcome.measured.least_squares.proof.is_none());
    // Without a filter the points themselves are judged.
    assert_eq!(outcome.roundness_um.to_bits(), outcome.measured.least_squares.ront_um.to_bits());
}

/// Between the points of a coarse profile stand higher peaks; the stated error covers what the denser profile shows.
#[test]
fn the_sampling_error_covers_what_lies_between_the_points() {
    let dense = solve(json!({ "points": xy(&ring(7200, [0.0; 2])), "filter": { "kind": "none" } })).output.measured;
    for count in [47, 60, 75, 90] {
        let coarse =
            solve(json!({ "points": xy(&ring(count, [0.0; 2])), "filter": { "kind": "none" } })).output.measured;
        for (a, b) in [(&coarse.least_squares, &dense.least_squares), (&coarse.minimum_zone, &dense.minimum_zone)] {
            // A quarter of the step shows 15/16 of the miss of a spline that follows the form; with four to eight points
            // for the shortest wave it does so to some tenths only.
            assert!(
                (a.ront_um - b.ront_um).abs() < 3.0 * a.sampling_error_um.unwrap() + 0.02,
                "{count}: {} {} {}",
                a.ront_um,
                b.ront_um,
                a.sampling_error_um.unwrap()
            );
        }
    }
}

/// The estimate of the spline's error against the error itself.
#[test]
fn the_interpolation_error_is_of_the_right_size() {
    let count = 90;
    let jitter = |i: usize| 0.3 * ((i * 7919 % 101) as f64 / 101.0 - 0.5);
    let points: Vec<(f64, f64)> = (0..count)
        .map(|i| TAU * (i as f64 + jitter(i)) / count as f64)
        .map(|angle| (angle, 25.0 + form_um(angle) / 1e3))
        .map(|(angle, r)| (r * angle.cos(), r * angle.sin()))
        .collect();
    let outcome = solve(json!({ "points": xy(&points), "filter": { "kind": "none" }, "profile_points": 3600 })).output;
    let (x, y) = (outcome.measured.least_squares.centre_x_mm, outcome.measured.least_squares.centre_y_mm);
    let radius = outcome.measured.least_squares.radius_mm;
    let miss = |angle_deg: &f64, deviation_um: &f64| {
        // To first order in the centre, which lies within 1e-4 mm of the origin: 1e-8/25 mm is left.
        let angle = angle_deg.to_radians();
        let true_um = form_um(angle) - 1e3 * (x * angle.cos() + y * angle.sin()) + 1e3 * (25.0 - radius);
        (deviation_um - true_um).powi(2)
    };
    let profile = &outcome.profile;
    let squares: f64 = profile.angle_deg.iter().zip(&profile.radial_deviation_um).map(|(a, d)| miss(a, d)).sum();
    let real = (squares / 3600.0).sqrt();
    let ratio = outcome.data.interpolation_error_um / real;
    assert!(ratio > 0.3 && ratio < 3.0, "{ratio}: stated {}, real {real}", outcome.data.interpolation_error_um);
    assert!(!outcome.data.uniform);
    // At uniform angles from 0 about a centred profile the spline is read at its knots.
    let exact = solve(json!({ "points": xy(&ring(90, [0.0; 2])), "filter": { "kind": "none" } })).output;
    assert!(exact.data.uniform && exact.data.interpolation_error_um == 0.0);
}

#[test]
fn what_is_wrong_is_said_at_its_place_and_all_at_once() {
    let points = ring(72, [0.0; 2]);
    let good = radii(&points);
    let with = |change: &dyn Fn(&mut Vec<Value>)| {
        let mut rows = good.clone();
        change(&mut rows);
        json!({ "radii": rows, "filter": { "kind": "none" } })
    };
    let at = |code, pointer: &str| vec![(code, pointer.to_owned())];
    assert_eq!(faults(json!({ "filter": { "kind": "none" } })), at("profile_missing", ""));
    assert_eq!(faults(json!({ "radii": good, "points": xy(&points) })), at("profile_given_twice", ""));
    assert_eq!(
        faults(json!({ "deviations": deviations(&points, 25.0, 1e3), "filter": { "kind": "none" } })),
        at("nominal_radius_missing", "/nominal_radius_mm")
    );
    assert_eq!(faults(with(&|rows| rows.truncate(2))), at("too_few_points", "/radii"));
    let line: Vec<Value> = (0..20).map(|i| json!({ "x_mm": f64::from(i), "y_mm": 1.0 })).collect();
    assert_eq!(faults(json!({ "points": line, "filter": { "kind": "none" } })), at("points_on_a_line", "/points"));
    let deep = json!({ "deviations": deviations(&points, 50.0, 2e3), "nominal_radius_mm": 25.0, "filter": { "kind": "none" } });
    assert_eq!(faults(deep), at("deviation_below_centre", "/deviations/0/radial_deviation_um"));
    // Deviations in um sent as radii in mm.
    let wrong: Vec<Value> = (0..72)
        .map(|i| f64::from(i) * 5.0)
        .map(|a| json!({ "angle_deg": a, "radius_mm": 10.0 + form_um(a.to_radians()) }))
        .collect();
    assert_eq!(faults(json!({ "radii": wrong, "filter": { "kind": "none" } })), at("not_round", "/radii"));
    let radians = with(&|rows| {
        for row in rows.iter_mut() {
            row["angle_deg"] = json!(row["angle_deg"].as_f64().unwrap().to_radians());
        }
    });
    assert_eq!(faults(radians), at("angles_look_like_radians", "/radii"));
    let several = json!({
        "deviations": deviations(&points, 25.0, 1e3),
        "filter": { "kind": "band_pass", "from_upr": 30, "to_upr": 15 }
    });
    let codes: Vec<&str> = faults(several).into_iter().map(|(code, _)| code).collect();
    assert_eq!(codes, ["band_inside_out", "nominal_radius_missing"]);
}

#[test]
fn suspicions_are_said() {
    let points = ring(360, [0.0; 2]);
    let low = json!({ "kind": "low_pass", "cutoff_upr": 15 });
    let plain = |more: Value| {
        let mut text = json!({ "radii": radii(&points), "filter": low });
        text.as_object_mut().unwrap().extend(more.as_object().unwrap().clone());
        solve(text)
    };
    assert_eq!(warned(&plain(json!({ "nominal_radius_mm": 25.1 }))), Vec::<&str>::new());
    for (nominal, looks_like) in [
        (12.5, Some("diameters")),
        (50.0, Some("nominal_diameter")),
        (25.0 / 25.4, Some("nominal_in_inch")),
        (30.0, None),
    ] {
        let answer = plain(json!({ "nominal_radius_mm": nominal }));
        assert_eq!(warned(&answer), ["radius_unlike_nominal"]);
        let said = serde_json::to_value(&answer.warnings[0].values).unwrap();
        assert_eq!(said["looks_like"].as_str(), looks_like, "{nominal}");
    }
    // Deviations in mm given as um.
    let answer =
        solve(json!({ "deviations": deviations(&points, 25.0, 1.0), "nominal_radius_mm": 25.0, "filter": low }));
    assert_eq!(warned(&answer), ["finer_than_any_instrument"]);
    let answer = solve(json!({ "points": xy(&ring(90, [0.0; 2])), "filter": low }));
    assert_eq!(warned(&answer), ["too_few_points_for_filter"]);
    let mut rows = radii(&points);
    for (i, row) in rows.iter_mut().enumerate() {
        let roughness = 1e-4 * ((i * 7919 % 101) as f64 / 101.0 - 0.5);
        row["radius_mm"] = (row["radius_mm"].as_f64().unwrap() + roughness + if i == 100 { 0.01 } else { 0.0 }).into();
    }
    let answer = solve(json!({ "radii": rows, "filter": low }));
    assert_eq!(warned(&answer), ["spike_suspected"]);
    let said = serde_json::to_value(&answer.warnings[0].values).unwrap();
    // Seen from the least-squares centre, which the spike moves by 0.06 um.
    close(said["angle_deg"].as_f64().unwrap(), 100.0, 2e-4);
    let found = plain(json!({})).output.roundness_um;
    assert_eq!(warned(&plain(json!({ "tolerance_um": found * 1.2 }))), Vec::<&str>::new());
    assert_eq!(warned(&plain(json!({ "tolerance_um": found * 0.8 }))), ["tolerance_exceeded"]);
    assert_eq!(warned(&plain(json!({ "tolerance_um": found }))), ["tolerance_undecided"]);
}

/// Far off the axis the rays from the axis cross the surface askew; teeth along them turn back as seen from the centre.
#[test]
fn a_profile_that_turns_back_is_refused_with_its_row() {
    let rows: Vec<Value> = (0..360)
        .map(|i| {
            let (angle, tooth) = (f64::from(i).to_radians(), if i % 2 == 0 { 1.0 } else { -1.0 });
            let circle = 9.0 * angle.cos() + (625.0 - 81.0 * angle.sin().powi(2)).sqrt();
            json!({ "angle_deg": i, "radius_mm": circle + tooth })
        })
        .collect();
    match run(json!({ "radii": rows, "filter": { "kind": "none" } })) {
        Err(Failure::OutOfModel(finding)) => {
            assert_eq!(finding.code, "not_star_shaped");
            assert!(finding.values.get("row").is_some());
        }
        other => panic!("{:?}", other.map(|answer| answer.output.roundness_um)),
    }
}

#[test]
fn the_chart_holds_the_profile_between_its_circles() {
    let text = json!({ "points": xy(&ring(360, [0.3, 0.1])), "reference": "minimum_zone" });
    let mut job = job(text);
    RoundnessEvaluation::fill(&mut job);
    let outcome = RoundnessEvaluation::run(&job, &Unwatched).unwrap().output;
    let figures = RoundnessEvaluation::figures(&job, &outcome);
    let line = |wanted: &str| {
        let items = &figures[0].panels[0].items;
        let found = items.iter().find_map(|item| match item {
            Item::Line { name, y, .. } if *name == wanted => Some(y.iter().map(|y| y.unwrap()).collect::<Vec<f64>>()),
            _ => None,
        });
        found.unwrap_or_else(|| panic!("no line {wanted}"))
    };
    let (profile, inscribed, circumscribed) =
        (line("filtered_profile"), line("inscribed_circle"), line("circumscribed_circle"));
    let (inner, outer) = (line("minimum_zone_inner"), line("minimum_zone_circles"));
    // Both are drawn at whole degrees; the circles are exact, so nothing but round-off is allowed, in um.
    for degree in 0..360 {
        let within =
            |low: &[f64], high: &[f64]| profile[degree] >= low[degree] - 1e-8 && profile[degree] <= high[degree] + 1e-8;
        assert!(within(&inner, &outer) && within(&inscribed, &circumscribed), "at {degree} degrees");
    }
    let Some(Item::Points { x, y, .. }) = figures[0].panels[0].items.iter().find(|i| matches!(i, Item::Points { .. }))
    else {
        panic!("no contacts")
    };
    assert!(x.len() >= 4);
    for (x, y) in x.iter().zip(y) {
        let at = x.round() as usize % 360;
        let circles = [inner[at], outer[at], inscribed[at], circumscribed[at]];
        assert!(circles.iter().any(|circle| (circle - y).abs() < 1e-8), "at {x} degrees");
    }
}
