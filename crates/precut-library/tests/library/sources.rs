//! Several sources of one number, tool life, normal force: `library/2`, `library/3`, `library/5`, `library/6`.

use precut_calc::machinability::MachinabilityModel;
use precut_library::kienzle::{self, Choice};
use precut_library::record::Kind;
use precut_library::{built_in, life};
use serde_json::{Value, json};

use super::{cases, near};

#[test]
fn sources_differ_as_published() {
    let file = cases(include_str!("../reference/conflicts.json"));
    let mut conflicts = 0;
    for case in file["cases"].as_array().unwrap() {
        let name = case["material"].as_str().unwrap();
        let record = built_in::find(Kind::Material, name).unwrap();
        let rows = kienzle::rows(record);
        let sources = kienzle::choose(&rows, Choice::Preferred).unwrap();
        let expected = |field: &str| case[field].as_f64().unwrap();
        // The file prints one decimal of forces and two of percents.
        for (field, value, half_a_digit) in [
            ("preferred_n_per_mm2", sources.used.at_reference(), 0.051),
            ("least_n_per_mm2", sources.least.at_reference(), 0.051),
            ("largest_n_per_mm2", sources.largest.at_reference(), 0.051),
            ("differs_percent", sources.differs_percent, 0.0051),
            ("force_percent", sources.force_percent, 0.0051),
        ] {
            let slack = f64::max(half_a_digit, 1e-4 * expected(field));
            assert!((value - expected(field)).abs() <= slack, "{name} {field}: {value} against {}", expected(field));
        }
        assert_eq!(
            [sources.rows, sources.families].map(Value::from),
            [&case["rows"], &case["families"]].map(Clone::clone),
            "{name}"
        );
        assert_eq!(Some(sources.is_conflict()), case["conflict"].as_bool(), "{name}");
        conflicts += usize::from(sources.is_conflict());
    }
    assert!(conflicts >= 37, "{conflicts}");
}

#[test]
fn another_row_is_taken_where_it_is_asked_for() {
    let rows = kienzle::rows(built_in::find(Kind::Material, "42crmo4").unwrap());
    let iscar = kienzle::choose(&rows, Choice::Source("iscar_2017")).unwrap().used;
    assert!(near(iscar.at_reference(), 2611.9, 1e-4), "{}", iscar.at_reference());
    assert_eq!(kienzle::choose(&rows, Choice::Row(iscar.index)).unwrap().used, iscar);
    assert_eq!(kienzle::choose(&rows, Choice::Row(99)), None);
    assert_eq!(kienzle::choose(&rows, Choice::Source("nobody")), None);
}

/// V = 100 m/min, t = 2 mm, s = 0.5 mm/rev in cast iron of HB 190 with C_v = 243: 201.5 min.
#[test]
fn the_handbooks_life_is_its_printed_formula() {
    let row = json!({
        "form": "handbook", "tool": "carbide", "coefficient": 243, "depth_exponent": 0.15, "feed_exponent": 0.40,
        "life_exponent": 0.20, "source": "user", "certainty": "user", "feed_above_mm_per_rev": 0.4,
    });
    let model = life::model(&row, "source").unwrap();
    let number = |name: &str| model[name].as_f64().unwrap();
    let ln = number("constant")
        + number("speed_exponent") * 100.0_f64.ln()
        + number("depth_exponent") * 2.0_f64.ln()
        + number("feed_exponent") * 0.5_f64.ln();
    assert!(near(ln.exp(), 201.5, 3e-4), "{}", ln.exp());
    assert_eq!(model["range"], json!({"least_feed_mm_per_rev": 0.4}));
}

#[test]
fn taylors_life_is_stated_near_its_trials_alone() {
    let row = json!({
        "form": "taylor", "tool": "coated_carbide", "speed_at_one_minute_m_per_min": 700, "life_exponent": 0.25,
        "at_feed_mm_per_rev": 0.2, "at_depth_mm": 2.0, "source": "user", "certainty": "user",
    });
    let model = life::model(&row, "source").unwrap();
    let number = |name: &str| model[name].as_f64().unwrap();
    let minutes = (number("constant") + number("speed_exponent") * 350.0_f64.ln()).exp();
    assert!(near(minutes, 16.0, 1e-12), "{minutes}");
    assert_eq!(
        model["range"],
        json!({
            "least_feed_mm_per_rev": 0.2 * 0.75, "largest_feed_mm_per_rev": 0.25,
            "least_depth_mm": 1.5, "largest_depth_mm": 2.5,
        })
    );
}

#[test]
fn every_row_of_lives_is_a_model_of_schedules() {
    let mut count = 0;
    for record in built_in::records(Kind::Material) {
        for row in record.rows("taylor") {
            let model = life::model(row, "source").unwrap_or_else(|| panic!("{}: {row}", record.name));
            let read: MachinabilityModel = serde_json::from_value(model).unwrap();
            assert!(read.speed_exponent < 0.0 && read.constant.is_finite(), "{}", record.name);
            count += 1;
        }
    }
    assert_eq!(count, 376);
}

/// k_n is the judged share of k_c at 0.2 mm of chip thickness, whatever its exponent.
#[test]
fn the_judged_normal_force_is_its_share_at_the_reference() {
    for (group, share) in [("P", 0.5), ("M", 0.5), ("K", 0.45), ("N", 0.35), ("S", 0.6), ("H", 1.2)] {
        let (force, exponent) = kienzle::judged_normal_force(group, 2085.0, 0.173).unwrap();
        let of = |force: f64, exponent: f64| force * 0.2_f64.powf(-exponent);
        assert!(near(of(force, exponent), share * of(2085.0, 0.173), 1e-12), "{group}");
        assert!(near(exponent, 0.35, 1e-12));
    }
    assert_eq!(kienzle::judged_normal_force("X", 2085.0, 0.173), None);
}

#[test]
fn the_rake_corrects_near_its_base_alone() {
    let row = built_in::records(Kind::Material)
        .iter()
        .flat_map(|record| kienzle::rows(record))
        .find(|row| row.rake == Some((6.0, 1.0)))
        .unwrap();
    assert_eq!(row.rake_factor(6.0), Some(1.0));
    assert!(near(row.rake_factor(-6.0).unwrap(), 1.12, 1e-12));
    assert!(near(row.rake_factor(26.0).unwrap(), 0.8, 1e-12));
    assert_eq!(row.rake_factor(26.1), None);
    assert_eq!(kienzle::Row { rake: None, ..row }.rake_factor(6.0), None);
}
