//! Cylindricity: bodies with closed forms through the calculator, in every form that they come in.
#![allow(clippy::unwrap_used, clippy::panic, clippy::cast_precision_loss, missing_docs)]

use std::f64::consts::TAU;

use precut_calc::calculator::{Answer, Calculator, Check, Unwatched, Violations};
use precut_calc::num::cylinder::Axis;
use precut_calc::ring_roundness::cylindricity::{
    CylinderVerdict, CylindricityEvaluation, Job, Outcome, PartKind, RequirementKind,
};
use serde_json::{Value, json};

fn faults(text: &Value) -> Vec<&'static str> {
    let job: Job = serde_json::from_value(text.clone()).unwrap();
    let mut violations = Violations::default();
    job.check(&mut violations);
    violations.into_vec().into_iter().map(|finding| finding.code).collect()
}

fn solve(text: Value) -> Answer<Outcome> {
    assert_eq!(faults(&text), Vec::<&str>::new());
    let job: Job = serde_json::from_value(text).unwrap();
    CylindricityEvaluation::run(&job, &Unwatched).unwrap()
}

fn warned(answer: &Answer<Outcome>) -> Vec<&'static str> {
    answer.warnings.iter().map(|finding| finding.code).collect()
}

fn part_um(answer: &Answer<Outcome>, part: PartKind) -> f64 {
    answer.output.parts.iter().find(|p| p.part == part).unwrap().without_um
}

const HEIGHTS_MM: [f64; 5] = [0.0, 10.0, 20.0, 30.0, 40.0];

/// Points of sections square to an axis that is inclined and off: circles of a true cylinder.
fn sections(radius: impl Fn(f64, f64) -> f64, centre: impl Fn(f64) -> [f64; 2]) -> Vec<[f64; 3]> {
    let axis = Axis::through([40.0, -7.0, -1.0], [40.002, -7.004, 1.0]);
    let mut points = Vec::new();
    for z in HEIGHTS_MM {
        for k in 0..72 {
            let angle = TAU * f64::from(k) / 72.0;
            let ([x, y], r) = (centre(z), radius(angle, z));
            points.push(axis.place_mm([x + r * angle.cos(), y + r * angle.sin()], z));
        }
    }
    points
}

fn job(points: &[[f64; 3]], more: Value) -> Value {
    let rows: Vec<Value> = points.iter().map(|[x, y, z]| json!({ "x_mm": x, "y_mm": y, "z_mm": z })).collect();
    let mut job = json!({ "points": rows, "filter": { "kind": "none" } });
    for (name, value) in more.as_object().unwrap() {
        job[name] = value.clone();
    }
    job
}

fn straight(_z: f64) -> [f64; 2] {
    [0.0; 2]
}

#[test]
fn a_taper_is_told_as_taper_and_taken_out_leaves_nothing() {
    // 4 um of radius over 40 mm: the diameter grows by 8 um, the zone is half of that.
    let answer = solve(job(&sections(|_, z| 20.0 + 1e-4 * z, straight), json!({})));
    let out = &answer.output;
    assert!((out.taper.diameter_change_um - 8.0).abs() < 1e-3, "{:?}", out.taper);
    assert!((out.taper.diameter_change_um_per_mm - 0.2).abs() < 1e-4);
    assert!(out.taper.barrel_um.unwrap().abs() < 1e-3);
    assert!((out.cylindricity_um - 4.0).abs() < 2e-3, "{}", out.cylindricity_um);
    // Square to z such a cylinder is an ellipse of r tilt²/2 = 0.05 um: not taken for ovality.
    assert!(out.roundness_um < 1e-3, "{}", out.roundness_um);
    assert!(out.axis.straightness_um < 1e-3);
    assert!(part_um(&answer, PartKind::Taper) < 2e-3);
    for other in [PartKind::Barrel, PartKind::Bend, PartKind::Roundness] {
        assert!((part_um(&answer, other) - 4.0).abs() < 3e-3, "{other:?}");
    }
    let said = answer.explanation.iter().find(|m| m.code == "cylindricity_from").unwrap();
    assert_eq!(said.values.get("part"), Some(&"taper".into()));
}

#[test]
fn barrel_waist_bend_and_lobes_are_told_apart() {
    let bow = |z: f64| ((z - 20.0) / 20.0).powi(2);
    let named = |answer: &Answer<Outcome>| {
        answer.explanation.iter().find(|m| m.code == "cylindricity_from").unwrap().values.get("part").cloned()
    };
    let barrel = solve(job(&sections(|_, z| 20.0 - 0.005 * bow(z), straight), json!({})));
    assert!((barrel.output.taper.barrel_um.unwrap() - 10.0).abs() < 1e-3, "{:?}", barrel.output.taper);
    assert!((barrel.output.cylindricity_um - 5.0).abs() < 2e-3);
    assert_eq!(named(&barrel), Some("barrel".into()));
    let waist = solve(job(&sections(|_, z| 20.0 + 0.005 * bow(z), straight), json!({})));
    assert!((waist.output.taper.barrel_um.unwrap() + 10.0).abs() < 1e-3);
    assert_eq!(named(&waist), Some("waist".into()));
    // The line of centres is a bow of 6 um: so wide is the cylinder that holds it, and the zone of the round sections.
    let bent = solve(job(&sections(|_, _| 20.0, |z| [0.0, 0.006 * bow(z)]), json!({})));
    assert!((bent.output.axis.straightness_um - 6.0).abs() < 1e-3, "{:?}", bent.output.axis);
    assert!((bent.output.cylindricity_um - 6.0).abs() < 0.01, "{}", bent.output.cylindricity_um);
    assert!(part_um(&bent, PartKind::Bend) < 0.01);
    assert_eq!(named(&bent), Some("bend".into()));
    let lobed = solve(job(&sections(|angle, _| 20.0 + 0.002 * (3.0 * angle).cos(), straight), json!({})));
    assert!((lobed.output.roundness_um - 4.0).abs() < 1e-3);
    assert!((lobed.output.cylindricity_um - 4.0).abs() < 1e-3);
    assert!(part_um(&lobed, PartKind::Roundness) < 1e-3);
    assert_eq!(named(&lobed), Some("roundness".into()));
}

/// The zone of all points is at least as wide as that of any section, and the other cylinders are no narrower.
#[test]
fn the_narrowest_zone_is_the_least_and_no_less_than_any_section() {
    let form =
        |angle: f64, z: f64| 20.0 + 0.003 * (2.0 * angle + 0.1 * z).cos() + 0.001 * (5.0 * angle).sin() + 5e-5 * z;
    let points = sections(form, |z| [0.0005 * (z / 9.0).sin(), 0.0]);
    for filter in [json!({ "kind": "none" }), json!({ "kind": "low_pass", "cutoff_upr": 15 })] {
        let answer = solve(job(&points, json!({ "filter": filter })));
        let cylinders = &answer.output.cylinders;
        let zone = cylinders.minimum_zone.cylt_um;
        assert!(answer.output.roundness_um <= zone + 1e-6, "{} {zone}", answer.output.roundness_um);
        for other in [&cylinders.least_squares, &cylinders.maximum_inscribed, &cylinders.minimum_circumscribed] {
            assert!(other.cylt_um >= zone - cylinders.minimum_zone.proof.unwrap().gap_um);
        }
        assert!(cylinders.maximum_inscribed.radius_mm <= cylinders.least_squares.radius_mm);
        assert!(cylinders.minimum_circumscribed.radius_mm >= cylinders.least_squares.radius_mm);
        // The axis is that of the points as the machine has them.
        assert!((cylinders.least_squares.slope_x_um_per_mm - 1.0).abs() < 0.05);
        assert!((cylinders.least_squares.slope_y_um_per_mm + 2.0).abs() < 0.05);
        assert!((cylinders.least_squares.centre_x_mm - 40.021).abs() < 1e-3);
    }
}

#[test]
fn coaxiality_is_twice_the_distance_from_the_datum_axis() {
    // The middle section stands 3 and 4 um off the line of the end sections.
    let off = |z: f64| if (z - 20.0).abs() < 1.0 { [0.003, 0.004] } else { [0.0; 2] };
    let points = sections(|_, _| 20.0, off);
    let more = json!({ "datum_sections": [1, 5], "coaxiality_tolerance_um": 9.9, "uncertainty_um": 0.2 });
    let answer = solve(job(&points, more));
    assert!((answer.output.axis.coaxiality_um.unwrap() - 10.0).abs() < 1e-3, "{:?}", answer.output.axis);
    let asked = &answer.output.requirements[0];
    assert_eq!((asked.of, asked.section), (RequirementKind::Coaxiality, Some(3)));
    assert_eq!(asked.verdict, CylinderVerdict::Undecided);
    assert!((answer.output.sections[2].off_datum_um.unwrap() - 5.0).abs() < 1e-3);
    assert_eq!(faults(&job(&points, json!({ "datum_sections": [1] }))), ["datum_sections_wrong"]);
    assert_eq!(faults(&job(&points, json!({ "datum_sections": [1, 6] }))), ["datum_sections_wrong"]);
    assert_eq!(faults(&job(&points, json!({ "datum_sections": [1, 2, 3, 4, 5] }))), ["datum_sections_wrong"]);
    assert_eq!(faults(&job(&points, json!({ "coaxiality_tolerance_um": 5 }))), ["datum_sections_missing"]);
}

/// Kept, undecided, exceeded: on both sides of each border.
#[test]
fn a_verdict_counts_the_uncertainty() {
    let points = sections(|_, z| 20.0 + 1e-4 * z, straight);
    let verdict = |tolerance_um: f64| {
        let answer = solve(job(&points, json!({ "cylindricity_tolerance_um": tolerance_um, "uncertainty_um": 0.5 })));
        let asked = answer.output.requirements[0].clone();
        assert!(asked.error_um >= 0.5 && asked.error_um < 0.6, "{asked:?}");
        let is_warned = warned(&answer).iter().any(|code| code.starts_with("requirement_"));
        assert_eq!(is_warned, asked.verdict != CylinderVerdict::Kept);
        asked.verdict
    };
    assert_eq!(verdict(4.7), CylinderVerdict::Kept);
    assert_eq!(verdict(4.4), CylinderVerdict::Undecided);
    assert_eq!(verdict(3.6), CylinderVerdict::Undecided);
    assert_eq!(verdict(3.3), CylinderVerdict::Exceeded);
}

/// Points, radii, deviations and files of the same body give the same answer.
#[test]
fn every_form_of_the_same_data_gives_the_same_cylinder() {
    let form = |angle: f64, z: f64| 20.0 + 0.003 * (3.0 * angle).cos() + 1e-4 * z;
    let polar: Vec<[f64; 3]> = HEIGHTS_MM
        .iter()
        .flat_map(|&z| (0..72).map(move |k| [z, 5.0 * f64::from(k), form(TAU * f64::from(k) / 72.0, z)]))
        .collect();
    let rows = |row: &dyn Fn(&[f64; 3]) -> Value| Value::Array(polar.iter().map(row).collect());
    let lines = |row: &dyn Fn(&[f64; 3]) -> String| polar.iter().map(row).collect::<Vec<_>>().join("\n");
    let xy = |[_, deg, r]: &[f64; 3]| [r * deg.to_radians().cos(), r * deg.to_radians().sin()];
    let blocks: Vec<String> = HEIGHTS_MM
        .iter()
        .enumerate()
        .map(|(n, z)| {
            let own = polar.iter().filter(|row| (row[0] - z).abs() < 1e-9);
            let text: Vec<String> = own.map(|[_, deg, r]| format!("{deg};{r}")).collect();
            format!("Section {} Z = {z} mm\nAngle [deg];Radius [mm]\n{}", n + 1, text.join("\n"))
        })
        .collect();
    let bare: Vec<String> = blocks.iter().map(|block| block.lines().skip(1).collect::<Vec<_>>().join("\n")).collect();
    let bare = bare.iter().enumerate().map(|(n, block)| format!("Trace {n}\n{block}")).collect::<Vec<_>>().join("\n\n");
    let forms = [
        json!({ "points": rows(&|row| json!({ "x_mm": xy(row)[0], "y_mm": xy(row)[1], "z_mm": row[0] })) }),
        json!({ "radii": rows(&|[z, deg, r]| json!({ "z_mm": z, "angle_deg": deg, "radius_mm": r })) }),
        json!({
            "deviations": rows(&|[z, deg, r]| json!({ "z_mm": z, "angle_deg": deg, "radial_deviation_um": 1e3 * (r - 20.0) })),
            "nominal_radius_mm": 20,
        }),
        json!({ "file": { "text": format!("x [mm];y [mm];z [mm]\n{}", lines(&|row| {
            format!("{};{};{}", xy(row)[0], xy(row)[1], row[0]).replace('.', ",")
        })) } }),
        json!({ "file": { "text": lines(&|row| format!("{} {} {}", xy(row)[0], xy(row)[1], row[0])) } }),
        json!({ "file": { "text": format!("Höhe [mm]\tWinkel [°]\tRadius [mm]\n{}", lines(&|[z, deg, r]| format!("{z}\t{deg}\t{r}"))) } }),
        json!({ "file": { "text": blocks.join("\n\n") } }),
        json!({ "file": { "text": bare, "section_heights_mm": HEIGHTS_MM } }),
    ];
    let first = solve(forms[0].clone()).output;
    assert_eq!(first.sections.len(), 5);
    for (index, form) in forms.into_iter().enumerate() {
        let out = solve(form).output;
        assert!((out.cylindricity_um - first.cylindricity_um).abs() < 1e-5, "{index}: {}", out.cylindricity_um);
        assert!((out.taper.diameter_change_um - first.taper.diameter_change_um).abs() < 1e-5, "{index}");
        let heights: Vec<f64> = out.sections.iter().map(|section| section.height_mm).collect();
        assert!(heights.iter().zip(HEIGHTS_MM).all(|(a, b)| (a - b).abs() < 1e-9), "{index}: {heights:?}");
    }
    let without = json!({ "file": { "text": bare } });
    assert_eq!(faults(&without), ["section_heights_missing"]);
}

#[test]
fn what_is_no_cylinder_is_refused_with_its_section() {
    let points = sections(|_, _| 20.0, straight);
    assert_eq!(faults(&json!({})), ["sections_missing"]);
    assert_eq!(faults(&job(&points[..72], json!({}))), ["too_few_sections"]);
    assert_eq!(faults(&job(&points[..74], json!({}))), ["too_few_points"]);
    assert_eq!(faults(&job(&points, json!({ "radii": [] }))), ["sections_given_twice"]);
    let band = json!({ "filter": { "kind": "band_pass", "from_upr": 50, "to_upr": 15 } });
    assert_eq!(faults(&job(&points, band)), ["band_inside_out"]);
    let mut lost = points.clone();
    lost[100][0] += 10.0;
    let job: Job = serde_json::from_value(job(&lost, json!({}))).unwrap();
    let mut violations = Violations::default();
    job.check(&mut violations);
    let found = violations.into_vec();
    assert_eq!((found[0].code, found[0].values.get("section")), ("not_round", Some(&2_usize.into())));
    assert_eq!(found[0].pointer, "/points");
}

/// A gap in one section takes the filter from all, so that the cylinder has one kind of points; and says so.
#[test]
fn a_keyway_takes_the_filter_and_leaves_the_cylinder() {
    let all = sections(|angle, _| 20.0 + 0.002 * (2.0 * angle).cos(), straight);
    let open: Vec<[f64; 3]> = all.iter().enumerate().filter(|(k, _)| !(80..92).contains(k)).map(|(_, p)| *p).collect();
    let filter = json!({ "filter": { "kind": "low_pass", "cutoff_upr": 15 } });
    let answer = solve(job(&open, filter.clone()));
    assert!(!answer.output.data.filter_applied);
    assert!(warned(&answer).contains(&"section_filter_not_applied"));
    assert!((answer.output.cylindricity_um - 4.0).abs() < 0.01);
    assert_eq!(answer.output.surface.height_mm.len(), 4);
    let whole = solve(job(&all, filter));
    assert!(whole.output.data.filter_applied && warned(&whole).is_empty(), "{:?}", warned(&whole));
}

#[test]
fn two_sections_say_what_they_cannot_tell() {
    let points: Vec<[f64; 3]> = sections(|_, z| 20.0 + 1e-4 * z, straight);
    let ends: Vec<[f64; 3]> = points[..72].iter().chain(&points[288..]).copied().collect();
    let answer = solve(job(&ends, json!({})));
    assert_eq!(warned(&answer), ["two_sections_only"]);
    assert_eq!(answer.output.taper.barrel_um, None);
    assert!(answer.output.axis.straightness_um < 1e-6);
}
