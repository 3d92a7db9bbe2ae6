//! Tables as people and machines write them.
#![allow(clippy::unwrap_used)]

use super::*;
use crate::registry::toy;
use crate::text::{Language, Texts};
use proptest::prelude::*;
use serde_json::json;

fn place() -> TablePlace {
    toy::registry().entry("toy-bar").unwrap().tables_of(&Value::Null)[0].clone()
}

fn rows(text: &str) -> Value {
    let mut faults = Faults::default();
    let read = read(text, &place(), ("/measurements", &Room::default()), &mut faults);
    assert!(faults.listed.is_empty(), "{text}: {:?}", faults.listed);
    read.unwrap().rows.into()
}

fn codes(text: &str) -> Vec<&'static str> {
    let mut faults = Faults::default();
    assert!(read(text, &place(), ("/measurements", &Room::default()), &mut faults).is_none(), "{text}");
    for finding in &faults.listed {
        Texts::shared().try_finding(Language::En, "fault", finding).unwrap();
    }
    faults.listed.iter().map(|finding| finding.code).collect()
}

#[test]
fn every_way_to_write_a_table_gives_the_same_rows() {
    let expected = json!([{"z_mm": 10, "deviation_um": -1.5}, {"z_mm": 20, "deviation_um": 0.012}]);
    for text in [
        "z_mm,deviation_um\n10,-1.5\n20,0.012\n",
        "z [mm];deviation [um]\r\n10;-1,5\r\n20;0,012\r\n",
        "\u{feff}z_mm\tdeviation_um\n\n10\t-1.5\n\n20\t1.2e-2\n\n",
        "Z [mm],Deviation [nm]\n10,-1500\n20,12\n",
        "z [cm];deviation [µm]\n1;-1.5\n2;,012\n",
        "\"z [m]\",\"deviation_mm\"\n\"0.01\",\"-0.0015\"\n0.02,0.000012\n",
        "z_mm;deviation_um;\n10;\u{2212}1,5;\n20;0,012;;\n",
        "deviation [um],z_mm,gauge\n-1.5,10,\n0.012,20,\n",
    ] {
        let read = rows(text);
        for (row, expected) in read.as_array().unwrap().iter().zip(expected.as_array().unwrap()) {
            for name in ["z_mm", "deviation_um"] {
                let (a, b) = (row[name].as_f64().unwrap(), expected[name].as_f64().unwrap());
                assert!(a.to_bits() == b.to_bits(), "{text}: {name} is {a:e}, not {b:e}");
            }
        }
        assert_eq!(read.as_array().unwrap().len(), 2, "{text}");
    }
}

#[test]
fn numbers_in_another_unit_are_those_of_the_rows() {
    for (text, z, deviation) in [
        ("z [m],deviation [mm]\n0.0275,0.02757\n", "27.5", "27.57"),
        ("z [cm];deviation [nm]\n1,15;-27570,3\n", "11.5", "-27.5703"),
        ("z [in],deviation [uin]\n0.1,40\n", "2.54", "1.016"),
        ("z_ft,deviation_thou\n0.25,-1.1\n", "76.2", "-27.94"),
        ("z_m,deviation_mm\n1.1234567890123456,0.1234567890123456\n", "1123.4567890123456", "123.4567890123456"),
    ] {
        let read = rows(text);
        for (name, expected) in [("z_mm", z), ("deviation_um", deviation)] {
            let expected: f64 = expected.parse().unwrap();
            assert_eq!(read[0][name].as_f64().map(f64::to_bits), Some(expected.to_bits()), "{text}: {name}");
        }
    }
}

/// A field's name ends in its unit, so that the header may leave it to the bracket: `feed [mm/tooth]` as `feed [mm/rev]`.
#[test]
fn a_feed_per_tooth_has_its_own_unit() {
    let registry = crate::registry::Registry::standard().unwrap();
    let place = registry.entry("fixture-identification").unwrap().tables_of(&Value::Null)[0].clone();
    for header in ["feed [mm/tooth]", "feed [um/tooth]", "feed_mm_per_tooth", "feed_um_per_tooth"] {
        let column = column(header, &place).ok().unwrap();
        assert_eq!(column.field.name, "feed_mm_per_tooth", "{header}");
    }
    assert!(matches!(column("feed [mm/rev]", &place), Err(BadHeader::WrongUnit { .. })));
}

#[test]
fn a_column_that_comes_twice_names_the_field() {
    let mut faults = Faults::default();
    read("z_mm,z [m]\n1,2", &place(), ("/measurements", &Room::default()), &mut faults);
    let said = Texts::shared().try_finding(Language::En, "fault", &faults.listed[0]).unwrap();
    assert_eq!(said, "line 1: the column z [m] fills z_mm, which another column fills already");
}

#[test]
fn columns_without_a_field_go_where_the_row_takes_them() {
    let mut place = place();
    place.free =
        crate::registry::FreeColumns { numbers: Some("further".to_owned()), words: Some("factors".to_owned()) };
    let mut faults = Faults::default();
    let text = "z_mm;deviation_um;Nose radius [mm];coolant;humidity\n1;2;0,8;on;\n3;4;1,2;7;0,5\n";
    let read = read(text, &place, ("/measurements", &Room::default()), &mut faults).unwrap();
    assert!(faults.listed.is_empty(), "{:?}", faults.listed);
    assert_eq!(
        Value::Array(read.rows),
        json!([
            {"z_mm": 1, "deviation_um": 2, "further": {"nose_radius_mm": 0.8}, "factors": {"coolant": "on"}},
            {"z_mm": 3, "deviation_um": 4, "further": {"nose_radius_mm": 1.2, "humidity": 0.5}, "factors": {"coolant": "7"}}
        ])
    );
}

#[test]
fn a_header_has_its_columns_and_so_many_more() {
    let mut place = place();
    place.free.numbers = Some("further".to_owned());
    let further = |count: usize| (0..count).map(|i| format!("a{i}")).collect::<Vec<_>>().join(",");
    let table = |count: usize| format!("z_mm,deviation_um,{}\n1,2{}\n", further(count), ",3".repeat(count));
    let most = place.columns.len() + MOST_FURTHER;
    let mut faults = Faults::default();
    let rows = read(&table(most - 2), &place, ("/measurements", &Room::default()), &mut faults).unwrap().rows;
    assert_eq!(rows[0]["further"].as_object().map(Map::len), Some(most - 2));
    // Of a longer header nothing is read but its length.
    for further in [most - 1, 100_000, 1_000_000] {
        let mut faults = Faults::default();
        assert!(read(&table(further), &place, ("/measurements", &Room::default()), &mut faults).is_none());
        let finding = &faults.listed[0];
        assert_eq!((finding.code, faults.total), ("too_many_columns", 1));
        let said = |language| Texts::shared().try_finding(language, "fault", finding).unwrap();
        let columns = further + 2;
        assert_eq!(
            said(Language::En),
            format!("the table measurements has {columns} columns, at most {most} are taken")
        );
        assert!(said(Language::Ru).contains("столб"), "{}", said(Language::Ru));
    }
}

#[test]
fn words_and_counts_are_read() {
    assert_eq!(
        rows("z_mm;deviation_um;gauge;repeats\n1;2;\"A;B\";3\n"),
        json!([{"z_mm": 1, "deviation_um": 2, "gauge": "A;B", "repeats": 3}])
    );
}

#[test]
fn a_table_says_what_is_wrong_with_it() {
    assert_eq!(codes(""), ["empty_table"]);
    assert_eq!(codes("z,deviation_um\n1,2"), ["missing_unit"]);
    assert_eq!(codes("z [N],deviation_um\n1,2"), ["wrong_unit"]);
    assert_eq!(codes("z [furlong],deviation_um\n1,2"), ["wrong_unit"]);
    assert_eq!(codes("z_mm,deviaton_um\n1,2"), ["unknown_column"]);
    assert_eq!(codes("z_mm,z [m]\n1,2"), ["duplicate_column"]);
    assert_eq!(codes("z_mm\n1"), ["missing_column"]);
    assert_eq!(codes("z_mm,deviation_um\n1,2,3"), ["ragged_row"]);
    assert_eq!(codes("z_mm,deviation_um\n1,"), ["empty_cell"]);
    assert_eq!(codes("z_mm,deviation_um\n1,nan\n1,inf\n1,1e999\n1,x"), ["bad_cell"; 4]);
    assert_eq!(codes("z_mm;deviation_um\n1;1.000,5"), ["bad_cell"]);
    assert_eq!(codes(&format!("z_mm,deviation_um\n{}", "1,2\n".repeat(2001))), ["too_many_rows"]);
}

#[test]
fn a_bad_cell_is_named_by_line_and_column() {
    let mut faults = Faults::default();
    read("z_mm,deviation_um\n\n1,2\n3,four\n", &place(), ("/measurements", &Room::default()), &mut faults);
    let finding = &faults.listed[0];
    assert_eq!(finding.pointer, "/measurements/1/deviation_um");
    assert_eq!(finding.values.get("line"), Some(&4.0.into()));
    assert_eq!(finding.values.get("column"), Some(&"deviation_um".into()));
    assert_eq!(finding.values.get("received"), Some(&"four".into()));
}

proptest! {
    #[test]
    fn no_text_makes_it_panic(text in "[a-z_ \\[\\];,\t\r\n\"0-9.eE+-]{0,200}") {
        let mut faults = Faults::default();
        let read = read(&text, &place(), ("/measurements", &Room::default()), &mut faults);
        prop_assert_eq!(read.is_none(), faults.total > 0);
    }

    #[test]
    fn any_bytes_after_a_good_header_give_rows_or_faults(text in "\\PC{0,200}") {
        let mut faults = Faults::default();
        let read = read(&format!("z_mm,deviation_um\n{text}"), &place(), ("", &Room::default()), &mut faults);
        prop_assert_eq!(read.is_none(), faults.total > 0);
    }

    #[test]
    fn numbers_are_read_back_to_the_last_bit(z in 0.0..20000.0_f64, d in -1e6..1e6_f64) {
        let read = rows(&format!("z_mm;deviation_um\n{z};{}\n", format!("{d}").replace('.', ",")));
        prop_assert_eq!(read[0]["z_mm"].as_f64().unwrap().to_bits(), z.to_bits());
        prop_assert_eq!(read[0]["deviation_um"].as_f64().unwrap().to_bits(), d.to_bits());
    }
}
