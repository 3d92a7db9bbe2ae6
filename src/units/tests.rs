//! Units by name.
#![allow(clippy::unwrap_used, clippy::float_cmp)]

use super::*;
use proptest::prelude::*;

#[test]
fn a_unit_converts_within_its_dimension_only() {
    assert_eq!(convert(12.0, "um", "mm"), Some(0.012));
    assert_eq!(convert(0.012, "mm", "µm"), Some(12.0));
    assert_eq!(convert(2.0, "inch", "mm"), Some(50.8));
    assert_eq!(convert(1.0, "mm", "N"), None);
    assert_eq!(convert(210.0, "GPa", "N/mm2"), Some(210_000.0));
    assert_eq!(convert(30.0, "nm", "um"), Some(0.03));
    assert_eq!(convert(83.0, "%", "1"), Some(0.83));
    assert_eq!(convert(1.0, "furlong", "mm"), None);
    assert_eq!(convert(f64::NAN, "mm", "um"), None);
    assert_eq!(convert(1e308, "m", "um"), None);
}

#[test]
fn units_of_the_shop_in_inches_and_pounds_convert_to_the_last_bit() {
    for (text, from, to, expected) in [
        ("400", "ft/min", "m/min", 121.92),
        ("400", "sfm", "m/min", 121.92),
        ("2.5", "m/s", "m/min", 150.0),
        ("32", "uin", "um", 0.8128),
        ("1", "thou", "um", 25.4),
        ("0.1", "in", "mm", 2.54),
        ("0.005", "ipr", "mm/rev", 0.127),
        ("10", "lbf", "N", 44.482_216_152_605),
        ("1", "psi", "N/mm2", 0.006_894_757_293_168_362),
        ("30", "ksi", "MPa", 206.842_718_795_050_84),
        ("1", "hp", "kW", 0.745_699_871_582_270_2),
        ("1", "lbf ft", "N m", 1.355_817_948_331_400_3),
        ("12", "lbf in", "N m", 1.355_817_948_331_400_3),
        ("1", "in/lbf", "um/N", 5_710.147_154_732_646),
        ("1000", "lbf/in", "N/mm", 175.126_835_246_476_4),
        ("18", "degF", "K", 10.0),
        ("1", "lb/in3", "kg/m3", 27_679.904_710_203_12),
        ("90", "s", "min", 1.5),
        ("1", "s", "min", 1.0 / 60.0),
    ] {
        assert_eq!(converted(text, from, to), Some(expected), "{text} {from} in {to}");
    }
    assert!((convert(1.0, "rad", "deg").unwrap() - 180.0 / std::f64::consts::PI).abs() < 1e-13);
}

#[test]
fn a_power_of_ten_moves_the_decimal_point_only() {
    for (text, from, to, expected) in [
        ("0.02757", "mm", "um", "27.57"),
        ("-27.57", "um", "mm", "-0.02757"),
        ("+.3", "m", "mm", "300"),
        ("7.", "cm", "mm", "70"),
        ("1.1e-3", "m", "mm", "1.1"),
        ("0.1", "GPa", "N/mm2", "100"),
        ("0", "mm", "um", "0"),
        ("12.345678901234567890123", "mm", "um", "12345.678901234567890123"),
    ] {
        let expected: f64 = expected.parse().unwrap();
        assert_eq!(converted(text, from, to).map(f64::to_bits), Some(expected.to_bits()), "{text} {from} in {to}");
    }
    for bad in ["", "-", ".", "e3", "1,5", "1e", "--1", "inf"] {
        assert_eq!(converted(bad, "mm", "um"), None, "{bad}");
    }
    assert_eq!(converted("1e99999999999999999999", "mm", "um"), None);
}

proptest! {
    #[test]
    fn a_table_in_another_unit_has_the_same_numbers(whole in 0_u32..100_000, decimals in 0_u64..10_u64.pow(12)) {
        let text = format!("{whole}.{decimals:012}");
        let digits = format!("{whole}{decimals:012}");
        let (head, tail) = digits.split_at(digits.len() - 9);
        let moved: f64 = format!("{head}.{tail}").parse().unwrap();
        prop_assert_eq!(converted(&text, "mm", "um").unwrap().to_bits(), moved.to_bits());
        let feet: f64 = text.parse::<f64>().unwrap() * 0.3048;
        let exact = converted(&text, "ft/min", "m/min").unwrap();
        prop_assert!((exact - feet).abs() <= 4.0 * f64::EPSILON * feet, "{} is not {}", exact, feet);
    }
}

#[test]
fn suffixes_are_those_of_the_contract() {
    for (unit, expected) in [
        ("um/N", "_um_per_n"),
        ("N/mm2", "_n_per_mm2"),
        ("um/(m K)", "_um_per_m_k"),
        ("mm/rev", "_mm_per_rev"),
        ("%", "_percent"),
        ("rev/min", "_rpm"),
        ("1", ""),
    ] {
        assert_eq!(suffix(unit), expected);
    }
}

#[test]
fn no_spelling_stands_for_two_units() {
    let mut seen = std::collections::BTreeSet::new();
    for unit in UNITS {
        for spelling in unit.spellings {
            assert!(seen.insert(*spelling), "{spelling} twice");
        }
    }
}

#[test]
fn a_modulus_in_gigapascals_is_recognised() {
    let meant = probably_meant(210.0, "N/mm2", (1e3, 1e6), Some(210_000.0)).unwrap();
    assert_eq!((meant.unit, meant.converted), ("GPa", 210_000.0));
    let meant = probably_meant(2.1e11, "N/mm2", (1e3, 1e6), None).unwrap();
    assert_eq!((meant.unit, meant.converted), ("Pa", 210_000.0));
    // 0.21 would have to be TPa, which nobody writes.
    assert_eq!(probably_meant(0.21, "N/mm2", (1e3, 1e6), Some(210_000.0)), None);
}

#[test]
fn an_inch_and_a_metre_are_told_apart_by_what_is_typical() {
    assert_eq!(probably_meant(0.5, "mm", (1.0, 2e4), Some(500.0)).unwrap().unit, "m");
    assert_eq!(probably_meant(0.5, "mm", (1.0, 2e4), Some(12.0)).unwrap().unit, "inch");
    assert_eq!(probably_meant(0.25, "deg", (1.0, 90.0), Some(45.0)).unwrap().unit, "rad");
}
