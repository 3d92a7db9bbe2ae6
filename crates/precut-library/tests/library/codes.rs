//! ISO 1832, 5608, 6261.

use precut_calc::calculator::{Finding, Value as Told};
use precut_library::iso::{Holder, Insert, fit, read};
use proptest::prelude::*;
use serde_json::{Value, json};

use super::cases;

fn file() -> Value {
    cases(include_str!("../reference/iso-codes.json"))
}

fn list<'a>(file: &'a Value, name: &str) -> &'a [Value] {
    file[name].as_array().unwrap()
}

fn insert_as_json(insert: &Insert) -> Value {
    let mut said = json!({
        "shape": insert.shape.to_string(), "included_angle_deg": insert.included_angle_deg(),
        "clearance_angle_deg": insert.clearance_angle_deg(), "tolerance_class": insert.tolerance_class.to_string(),
        "chip_breaker_faces": insert.chip_breaker_faces(), "hole": insert.has_hole(),
        "double_sided": insert.is_double_sided(), "thickness_mm": insert.thickness_mm(),
        "inscribed_circle_mm": insert.inscribed_circle_mm(), "cutting_edge_length_mm": insert.cutting_edge_length_mm(),
        "nose_radius_mm": insert.nose_radius_mm(), "edge_condition": insert.edge_condition,
        "direction": insert.direction, "maker": insert.maker,
    });
    if let Some((angle, clearance)) = insert.wiper_deg() {
        said["wiper_edge_angle_deg"] = json!(angle);
        said["wiper_clearance_deg"] = json!(clearance);
    }
    said
}

fn holder_as_json(holder: &Holder) -> Value {
    let mut said = json!({
        "clamping": holder.clamping.to_string(), "shape": holder.shape.to_string(), "style": holder.style.to_string(),
        "cutting_edge_angle_deg": holder.cutting_edge_angle_deg(), "clearance_angle_deg": holder.clearance_angle_deg(),
        "hand": holder.hand.name(), "length_mm": holder.length_mm(),
        "insert_size": format!("{:02}", holder.insert_size), "for_facing": holder.is_for_facing(),
    });
    if let Some((height, width)) = holder.shank_mm {
        said["shank_height_mm"] = json!(height);
        said["shank_width_mm"] = json!(width);
    }
    if let Some(bar) = holder.bar {
        said["bar"] = json!({
            "material": bar.material().name(), "coolant": bar.has_coolant(), "diameter_mm": bar.diameter_mm,
        });
    }
    said
}

/// Numbers by value, so that 80 and 80.0 are one.
fn same(a: &Value, b: &Value) -> bool {
    match (a, b) {
        (Value::Object(a), Value::Object(b)) => {
            a.len() == b.len() && a.iter().all(|(name, value)| b.get(name).is_some_and(|other| same(value, other)))
        }
        _ => match (a.as_f64(), b.as_f64()) {
            (Some(a), Some(b)) => (a - b).abs() < 1e-9,
            _ => a == b,
        },
    }
}

#[test]
fn inserts_say_what_the_standard_says() {
    for case in list(&file(), "inserts") {
        let code = case["code"].as_str().unwrap();
        match (code.parse::<Insert>(), case.get("expected")) {
            (Ok(insert), Some(expected)) => {
                assert!(
                    same(&insert_as_json(&insert), expected),
                    "{code}: {} against {expected}",
                    insert_as_json(&insert)
                );
            }
            (Err(fault), None) => {
                assert_eq!(
                    (case["error"].as_str(), case["at"].as_u64()),
                    (Some(fault.code), Some(fault.at as u64)),
                    "{code}"
                );
            }
            (read, _) => panic!("{code}: {read:?}"),
        }
    }
}

#[test]
fn holders_say_what_the_standard_says() {
    for case in list(&file(), "holders") {
        let code = case["code"].as_str().unwrap();
        match (code.parse::<Holder>(), case.get("expected")) {
            (Ok(holder), Some(expected)) => {
                assert!(
                    same(&holder_as_json(&holder), expected),
                    "{code}: {} against {expected}",
                    holder_as_json(&holder)
                );
            }
            (Err(fault), None) => {
                assert_eq!(
                    (case["error"].as_str(), case["at"].as_u64()),
                    (Some(fault.code), Some(fault.at as u64)),
                    "{code}"
                );
            }
            (read, _) => panic!("{code}: {read:?}"),
        }
    }
}

fn word(finding: &Finding, name: &str) -> Option<String> {
    match finding.values.get(name) {
        Some(Told::Text(text)) => Some(text.to_string()),
        _ => None,
    }
}

#[test]
fn pairs_fit_or_say_where_not() {
    for case in list(&file(), "pairs") {
        let (insert, holder) = (case["insert"].as_str().unwrap(), case["holder"].as_str().unwrap());
        let read = read(Some(insert), Some(holder));
        if let Some(expected) = case.get("expected") {
            let geometry = read.geometry.unwrap_or_else(|| panic!("{insert} {holder}: {:?}", read.faults));
            let said = json!({
                "nose_radius_mm": geometry.nose_radius_mm, "cutting_edge_angle_deg": geometry.cutting_edge_angle_deg,
                "minor_edge_angle_deg": geometry.minor_edge_angle_deg,
                "clearance_angle_deg": geometry.clearance_angle_deg, "round_insert": geometry.is_round,
            });
            assert!(same(&said, expected), "{insert} {holder}: {said} against {expected}");
        } else {
            let [fault] = read.faults.as_slice() else { panic!("{insert} {holder}: {:?}", read.faults) };
            assert_eq!(Some(fault.code), case["error"].as_str());
            assert_eq!(word(fault, "at").as_deref(), case["at"].as_str());
        }
    }
}

/// An insert's designation by the letters and signs of the standard, drawn independently of the parser.
fn any_insert() -> impl Strategy<Value = String> {
    let one = |letters: &'static str| proptest::sample::select(letters.chars().collect::<Vec<_>>());
    let thickness =
        proptest::sample::select(vec!["01", "T1", "02", "T2", "03", "T3", "04", "05", "06", "07", "09", "12"]);
    let corner = prop_oneof![
        (1_u8..33).prop_map(|tenths| format!("{tenths:02}")),
        ("[ADEFGP]", "[ABCDEFGNPO]").prop_map(|(angle, clearance)| format!("{angle}{clearance}")),
    ];
    let tail =
        ("[FETSKP]?", "[RLN]?", "(-[A-Z0-9]{1,5})?").prop_map(|(edge, hand, maker)| format!("{edge}{hand}{maker}"));
    let letters = (one("ABCDEHKLMOPSTVW"), one("ABCDEFGNPO"), one("AFCHEGJKLMUN"), one("NRFAMGWTQUBHCJX"));
    (letters, 3_u8..40, thickness, corner, tail).prop_map(|((a, b, c, d), size, thickness, corner, tail)| {
        format!("{a}{b}{c}{d}{size:02}{thickness}{corner}{tail}")
    })
}

fn any_round_insert() -> impl Strategy<Value = String> {
    ("[BCDEFGNPO]", "[MGU]", "[MTGX]", 5_u8..33, "(03|04|06)", "(M0|00)").prop_map(
        |(clearance, tolerance, kind, size, thickness, corner)| {
            format!("R{clearance}{tolerance}{kind}{size:02}{thickness}{corner}")
        },
    )
}

fn any_holder() -> impl Strategy<Value = String> {
    let head = "[CDMPSWX][ABCDEHKLMOPRSTVW][ABCDEFGHJKLMNPRSTUVWYX][ABCDEFGNPO][RLN]";
    let external = (head, 8_u8..60, 8_u8..60, "[ABCDEFGHJKLMNPQRSTUVWYX]", 6_u8..33, "(-[A-Z0-9]{1,4})?").prop_map(
        |(head, height, width, length, size, tail)| format!("{head}{height:02}{width:02}{length}{size:02}{tail}"),
    );
    let bar = ("[SABCDEFGHJ]", 8_u8..60, "[ABCDEFGHJKLMNPQRSTUVWYX]", head, 6_u8..33).prop_map(
        |(material, diameter, length, head, size)| format!("{material}{diameter:02}{length}-{head}{size:02}"),
    );
    prop_oneof![external, bar]
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 200, ..ProptestConfig::default() })]

    #[test]
    fn an_insert_is_written_back(code in prop_oneof![9 => any_insert(), 1 => any_round_insert()]) {
        prop_assert_eq!(code.parse::<Insert>().unwrap().to_string(), code);
    }

    #[test]
    fn a_holder_is_written_back(code in any_holder()) {
        prop_assert_eq!(code.parse::<Holder>().unwrap().to_string(), code);
    }

    #[test]
    fn blanks_and_case_do_not_count(code in any_insert(), holder in any_holder()) {
        let apart: String = code.to_lowercase().chars().flat_map(|letter| [letter, ' ']).collect();
        prop_assert_eq!(apart.parse::<Insert>(), code.parse::<Insert>());
        prop_assert_eq!(holder.to_lowercase().parse::<Holder>(), holder.parse::<Holder>());
    }

    #[test]
    fn whatever_is_typed_is_read_or_refused(insert in "\\PC{0,40}", holder in "[A-Z0-9 -]{0,24}") {
        let read = read(Some(&insert), Some(&holder));
        prop_assert!(read.insert.is_some() || !read.faults.is_empty());
        prop_assert!(read.holder.is_some() || !read.faults.is_empty());
    }

    #[test]
    fn a_changed_letter_is_refused_at_its_place(code in any_insert(), at in 0_usize..4) {
        let broken: String = code.chars().enumerate().map(|(index, letter)| if index == at { 'I' } else { letter }).collect();
        prop_assert_eq!(broken.parse::<Insert>().unwrap_err().at, at);
    }

    #[test]
    fn a_pair_that_fits_leaves_the_minor_edge_clear(code in any_insert(), holder in any_holder()) {
        let (Ok(mut insert), Ok(holder)) = (code.parse::<Insert>(), holder.parse::<Holder>()) else { return Ok(()) };
        insert.shape = holder.shape;
        insert.clearance = holder.clearance;
        insert.size = holder.insert_size;
        if let Ok(geometry) = fit(&insert, &holder) {
            prop_assert!(geometry.minor_edge_angle_deg.is_none_or(|angle| angle > 0.0));
        }
    }
}
