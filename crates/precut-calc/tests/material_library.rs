//! The library of work materials: complete, sourced, equal to the reference coefficients.
#![allow(clippy::unwrap_used, clippy::float_cmp, missing_docs)]

use precut_calc::force::ToolMaterial;
use precut_calc::force::handbook::{self, Coefficients, HandbookRow};
use precut_calc::material::{Certainty, Material, find, library};
use serde_json::{Value, json};
use utoipa::openapi::{RefOr, Schema};
use utoipa::{PartialSchema, ToSchema};

fn coefficients() -> Value {
    let path = format!(
        "{}/tests/reference/deflection-compensation/coefficients.json",
        concat!(env!("CARGO_MANIFEST_DIR"), "/..")
    );
    serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap()
}

fn rows() -> Vec<(&'static str, &'static [HandbookRow])> {
    vec![
        ("steel", &handbook::STEEL),
        ("stainless 12Kh18N9T", &handbook::STAINLESS),
        ("grey cast iron", &handbook::GREY_IRON),
        ("malleable iron", &handbook::MALLEABLE_IRON),
        ("copper alloy, multiphase", &handbook::COPPER),
        ("aluminium, silumin", &handbook::ALUMINIUM),
    ]
}

fn assert_force(got: Option<Coefficients>, expected: &Value, title: &str) {
    let Some(got) = got else {
        assert!(expected.is_null(), "{title}");
        return;
    };
    let number = |name: &str| expected[name].as_f64().unwrap();
    assert_eq!(got.coefficient, 10.0 * number("C"), "{title}");
    assert_eq!(got.depth_exponent, number("x"), "{title}");
    assert_eq!(got.feed_exponent, number("y"), "{title}");
    assert_eq!(got.speed_exponent, number("n"), "{title}");
}

#[test]
fn the_rows_are_those_of_the_reference_file() {
    let file = coefficients();
    let printed = file["power_law"].as_array().unwrap();
    let ours: usize = rows().iter().map(|(_, rows)| rows.len()).sum();
    assert_eq!(ours, printed.len());
    for row in printed {
        let material = row["material"].as_str().unwrap();
        let (_, candidates) = rows().into_iter().find(|(name, _)| *name == material).unwrap();
        let tool = if row["tool"] == "HSS" { ToolMaterial::Hss } else { ToolMaterial::Carbide };
        let wiper = row["operation"].as_str().unwrap().contains("wiper");
        let found = candidates.iter().find(|one| one.tool_material == tool && one.wiper_edge == wiper).unwrap();
        let title = format!("{material}, {tool:?}, wiper {wiper}");
        assert_force(Some(found.main), &row["Pz"], &title);
        assert_force(found.passive, &row["Py"], &title);
        assert_force(found.feed, &row["Px"], &title);
        let doubtful = row["certainty"].as_str().unwrap().contains("check");
        assert_eq!(found.main.certainty.needs_check(), doubtful, "{title}");
    }
}

#[test]
fn the_specific_forces_are_those_of_the_reference_file() {
    let file = coefficients();
    let check = |row: &Value, ids: &[&str], certainty: Certainty| {
        for id in ids {
            let kienzle = find(id).unwrap().kienzle.unwrap();
            assert_eq!(kienzle.specific_cutting_force_n_per_mm2, row[1].as_f64().unwrap(), "{id}");
            assert_eq!(kienzle.cutting_exponent, row[2].as_f64().unwrap(), "{id}");
            assert_eq!(kienzle.certainty, certainty, "{id}");
        }
    };
    let ids = |name: &str| -> &'static [&'static str] {
        match name {
            "St 42" => &["st42"],
            "E295" => &["e295"],
            "E335/C45/C60" => &["e335", "steel_45", "c60"],
            "E360/18CrNi8" => &["e360", "18crni8"],
            "42CrMo4" => &["42crmo4"],
            "16MnCr5" => &["16mncr5"],
            "Mn, CrNi steels" => &["mn_crni_steel"],
            "austenitic Mn steel" => &["austenitic_mn_steel"],
            "GE240" => &["ge240"],
            "GE260" => &["ge260"],
            "EN-GJL-160" => &["en_gjl_160"],
            "EN-GJL-250" => &["en_gjl_250"],
            "1.4301" => &["x5crni18_10"],
            "brass" => &["brass"],
            "aluminium wrought" => &["aluminium_wrought"],
            "Ti-6Al-4V" => &["ti_6al_4v"],
            other => unreachable!("{other}"),
        }
    };
    let mut met = 0;
    for (list, certainty) in [("rows", Certainty::Likely), ("textbook_not_verified", Certainty::TextbookUnverified)] {
        for row in file["kienzle"][list].as_array().unwrap() {
            let ids = ids(row[0].as_str().unwrap());
            check(row, ids, certainty);
            met += ids.len();
        }
    }
    assert_eq!(met, library().iter().filter(|material| material.kienzle.is_some()).count(), "no other rows");
}

#[test]
fn ids_are_unique_names_and_found() {
    let mut ids: Vec<&str> = library().iter().map(|material| material.id).collect();
    ids.sort_unstable();
    assert!(ids.windows(2).all(|pair| pair[0] != pair[1]));
    for material in library() {
        let plain = |c: char| c.is_ascii_lowercase() || c.is_ascii_digit() || c == '_';
        assert!(material.id.chars().all(plain) && material.id.len() <= 64, "{}", material.id);
        assert_eq!(find(material.id), Some(material));
        assert!(!material.title.is_empty());
    }
    assert_eq!(find("unobtainium"), None);
}

/// Every object inside a value that has a source.
fn sourced(value: &Value, found: &mut Vec<Value>) {
    match value {
        Value::Object(fields) => {
            if fields.contains_key("source") {
                found.push(value.clone());
            }
            fields.values().for_each(|field| sourced(field, found));
        }
        Value::Array(items) => items.iter().for_each(|item| sourced(item, found)),
        _ => {}
    }
}

#[test]
fn every_number_is_sourced_and_plausible() {
    for material in library() {
        let json = serde_json::to_value(material).unwrap();
        let mut found = Vec::new();
        sourced(&json, &mut found);
        assert!(found.len() >= 3);
        assert!(found.iter().all(|entry| !entry["source"].as_str().unwrap().is_empty()), "{}", material.id);
        // No bare number beside the sourced ones.
        let bare = json.as_object().unwrap().values().any(Value::is_number);
        assert!(!bare, "{}", material.id);
        let within = |value: f64, least: f64, largest: f64| (least..=largest).contains(&value);
        assert!(within(material.youngs_modulus_n_per_mm2.value, 6e4, 2.2e5), "{}", material.id);
        assert!(within(material.poisson_ratio.value, 0.2, 0.36), "{}", material.id);
        assert!(within(material.density_kg_per_m3.value, 2500.0, 9000.0), "{}", material.id);
        if let (Some(yields), Some(breaks)) = (material.yield_strength_n_per_mm2, material.tensile_strength_n_per_mm2) {
            assert!(yields.value < breaks.value, "{}", material.id);
        }
        assert_eq!(material.work_material.map_or(0, |class| class.rows().len()), material.power_laws.len());
    }
}

#[test]
fn the_schema_gives_every_number_a_unit_and_a_description() {
    fn walk(schema: &Value, name: &str, numbers: &mut usize) {
        if schema["type"] == "number" {
            *numbers += 1;
            assert!(schema["x-unit"].is_string() && schema["description"].is_string(), "{name}: {schema}");
        }
        if let Some(fields) = schema["properties"].as_object() {
            fields.iter().for_each(|(name, field)| walk(field, name, numbers));
        }
    }
    let schema = serde_json::to_value(Material::schema()).unwrap();
    let mut numbers = 0;
    walk(&schema, "Material", &mut numbers);
    assert_eq!(numbers, 6);
    let units = [
        ("youngs_modulus_n_per_mm2", "N/mm2"),
        ("poisson_ratio", "1"),
        ("density_kg_per_m3", "kg/m3"),
        ("yield_strength_n_per_mm2", "N/mm2"),
        ("tensile_strength_n_per_mm2", "N/mm2"),
        ("brinell_hardness", "1"),
    ];
    for (field, unit) in units {
        assert_eq!(schema["properties"][field]["properties"]["value"]["x-unit"], json!(unit));
    }
    let mut components: Vec<(String, RefOr<Schema>)> = Vec::new();
    Material::schemas(&mut components);
    for (name, component) in &components {
        walk(&serde_json::to_value(component).unwrap(), name, &mut numbers);
    }
    assert!(numbers >= 6 + 4 + 2, "handbook rows and Kienzle rows are components");
    let text = format!("{schema}{}", serde_json::to_string(&components).unwrap());
    for reference in text.split("#/components/schemas/").skip(1) {
        let name = reference.split('"').next().unwrap();
        assert!(components.iter().any(|(known, _)| known == name), "{name}");
    }
}

#[test]
fn certainty_knows_what_to_doubt() {
    use Certainty::{Confirmed, Likely, TextbookUnverified, ToBeChecked};
    assert!(Confirmed < Likely && Likely < ToBeChecked && ToBeChecked < TextbookUnverified);
    for (certainty, doubtful) in [(Confirmed, false), (Likely, false), (ToBeChecked, true), (TextbookUnverified, true)]
    {
        assert_eq!(certainty.needs_check(), doubtful);
        assert_eq!(serde_json::to_value(certainty).unwrap(), json!(certainty.name()));
    }
}
