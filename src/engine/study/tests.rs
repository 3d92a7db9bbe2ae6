//! Studies of the toy, without a service: what is refused, what comes out.

#![allow(clippy::unwrap_used, clippy::panic, clippy::float_cmp, clippy::needless_pass_by_value)]

use precut_calc::calculator::{Figure, Item, Message, Monitor, Unwatched};
use proptest::prelude::*;
use serde_json::{Value, json};

use super::{META, STUDIES};
use crate::engine::{Body, Error, Given, check_now, read, solve_now, studies_of};
use crate::registry::{Registry, toy};
use crate::text::{Language, Texts};

fn study(vary: Value) -> Value {
    json!({"calculator": "toy-bar", "job": {"length_mm": 500, "segments": [{"diameter_mm": 20}]}, "vary": vary})
}

fn body(study: &Value) -> Body {
    Body::Json(study.to_string().into())
}

/// Code and pointer of every fault; each must have a text that fits its values.
fn faults(study: &Value) -> Vec<(&'static str, String)> {
    match check_now(&toy::registry(), STUDIES, body(study), &Given::default()) {
        Err(Error::Invalid { findings, .. }) => {
            for finding in &findings {
                let said = Texts::shared().try_finding(Language::En, "fault", finding).unwrap();
                assert!(!said.contains("  ") && !said.is_empty(), "{said}");
            }
            findings.into_iter().map(|finding| (finding.code, finding.pointer)).collect()
        }
        other => panic!("{study}: {other:?}"),
    }
}

fn solved(study: &Value) -> Value {
    let stored = solve_now(&toy::registry(), STUDIES, body(study), &Given::default(), &Unwatched)
        .unwrap_or_else(|error| panic!("{study}: {error:?}"));
    serde_json::from_slice(&stored.body).unwrap()
}

fn expected(list: &[(&'static str, &str)]) -> Vec<(&'static str, String)> {
    let mut list: Vec<_> = list.iter().map(|(code, pointer)| (*code, (*pointer).to_owned())).collect();
    list.sort_by(|a, b| a.1.cmp(&b.1));
    list
}

#[test]
fn every_code_has_its_words() {
    let has = |section, code| Texts::shared().has(Language::En, section, code);
    let codes = META.codes;
    for (section, lists) in [
        ("fault", codes.faults),
        ("warning", codes.warnings),
        ("explanation", codes.explanations),
        ("stage", codes.stages),
    ] {
        for code in lists.iter().copied().flatten() {
            assert!(has(section, code), "{section}.{code}");
        }
    }
    assert!(super::figure::LABELS.iter().all(|code| has("label", code)));
    assert!(super::figure::TITLES.iter().all(|code| has("figure", code)));
}

#[test]
fn every_calculators_own_choice_of_outputs_is_one() {
    for entry in Registry::standard().unwrap().entries() {
        for pointer in entry.meta().study_outputs {
            let tokens = super::expand::tokens(pointer).unwrap();
            let field = super::place::field(entry.strict_output(), None, &tokens);
            assert!(field.is_ok_and(|field| field.is_number()), "{} has no number at {pointer}", entry.meta().id);
        }
    }
}

#[test]
fn every_example_runs() {
    let registry = Registry::standard().unwrap();
    for example in super::EXAMPLES {
        let stored = solve_now(&registry, STUDIES, Body::Json(example.job.into()), &Given::default(), &Unwatched)
            .unwrap_or_else(|e| panic!("{e:?}"));
        let answer: Value = serde_json::from_slice(&stored.body).unwrap();
        assert!(answer["result"]["succeeded"].as_u64().unwrap() > 3, "{}", example.id);
        assert!(!stored.figures().unwrap().is_empty());
    }
}

#[test]
fn a_grid_has_a_row_for_each_combination_and_each_is_the_ordinary_job() {
    let study = study(json!([
        {"pointer": "/length_mm", "from": 100, "to": 300, "count": 3},
        {"pointer": "/stations", "values": [2, 4]},
    ]));
    let answer = solved(&study);
    let result = &answer["result"];
    assert_eq!((&answer["calculator"], &result["calculator"]), (&json!("studies"), &json!("toy-bar")));
    assert_eq!(
        (&result["points"], &result["succeeded"], &result["calculator_version"]),
        (&json!(6), &json!(6), &json!(7))
    );
    let rows = result["rows"].as_array().unwrap();
    let values: Vec<_> =
        rows.iter().map(|row| (row["values"][0].as_f64().unwrap(), row["values"][1].as_f64().unwrap())).collect();
    assert_eq!(values, [(100.0, 2.0), (100.0, 4.0), (200.0, 2.0), (200.0, 4.0), (300.0, 2.0), (300.0, 4.0)]);
    for ((length, stations), row) in values.iter().zip(rows) {
        assert_eq!(row["outputs"], json!([length / 3.0]), "the calculator's own choice: /deflections_um/0");
        let job = json!({"length_mm": length, "segments": [{"diameter_mm": 20}], "stations": stations});
        let checked = check_now(&toy::registry(), "toy-bar", body(&job), &Given::default()).unwrap();
        assert_eq!(row["key"], json!(checked.key.to_string()));
    }
    assert_eq!(
        result["outputs"][0]["least"],
        json!({"value": 100.0 / 3.0, "row": 0, "at": [100.0, 2.0],
        "at_end_of": ["/length_mm", "/stations"]})
    );
    assert_eq!(result["outputs"][0]["unit"], "um");
    let codes: Vec<_> =
        answer["explanation"].as_array().unwrap().iter().map(|one| one["code"].as_str().unwrap()).collect();
    assert_eq!(
        codes,
        ["study_extremes", "study_dominant", "study_least_at_end", "study_largest_at_end", "study_own_error"]
    );
    assert_eq!(answer["explanation"][1]["values"]["variable"], "/length_mm");
    assert_eq!(answer["explanation"][1]["values"]["share"], 1.0);
    let warning = &answer["warnings"][0];
    let values = ["code", "of", "points"].map(|name| warning["values"][name].clone());
    assert_eq!(values, [json!("toy_is_slender"), json!(6.0), json!(6.0)]);
    // It says what the first of them says.
    let detail = warning["detail"].as_str().unwrap();
    let (value, limit) = (&warning["values"]["first"][0], &warning["values"]["first"][1]);
    assert_eq!((&value[0], &limit[0]), (&json!("value"), &json!("limit")));
    let first = format!("{} mm is above {} mm", value[1], limit[1]).replace(".0 ", " ");
    assert!(detail.starts_with("6 of 6 answers warn here") && detail.ends_with(&first), "{detail}");
    assert_eq!(answer["warnings"][0]["pointer"], "/job/length_mm");
    assert_eq!(answer["basis"], json!([{"equation": "toy/1", "source": "none"}]));
    assert_eq!(answer["input"]["outputs"], json!(["/deflections_um/0"]));
    assert_eq!(answer["input"]["combine"], "grid");
}

#[test]
fn points_without_an_answer_keep_their_rows() {
    let study = study(json!([
        {"pointer": "/mode", "values": ["plain", "infeasible", "panic", "not_finite"]},
        {"pointer": "/segments/0/diameter_mm", "values": [20, 600, -1]},
    ]));
    let result = &solved(&study)["result"];
    let rows: Vec<_> = result["rows"].as_array().unwrap().iter().map(|row| (&row["status"], &row["code"])).collect();
    let row = |status: &str, code: Option<&str>| (json!(status), json!(code));
    let both_bad = [row("invalid", Some("thicker_than_long")), row("invalid", Some("out_of_range"))];
    let mut want = Vec::new();
    for first in [
        row("succeeded", None),
        row("infeasible", Some("no_solution_here")),
        row("failed", Some("crashed")),
        row("failed", Some("internal")),
    ] {
        want.push(first);
        want.extend(both_bad.clone());
    }
    assert_eq!(rows, want.iter().map(|(status, code)| (status, code)).collect::<Vec<_>>());
    assert_eq!((&result["succeeded"], &result["failed"]), (&json!(1), &json!(11)));
    assert_eq!(
        result["failures"][0],
        json!({"status": "invalid", "code": "thicker_than_long", "points": 4, "first_row": 1})
    );
    let rows = result["rows"].as_array().unwrap();
    assert_eq!(rows[1]["detail"], "diameter_mm 600 mm is above the length, 500 mm");
    assert_eq!((&rows[1]["key"], &rows[1]["outputs"]), (&Value::Null, &json!([null])));
    assert!(rows[3]["key"].is_string(), "a job that runs has a key, whatever comes of it");
}

#[test]
fn a_study_of_a_billion_points_is_refused_with_limit_and_count() {
    let range = |pointer: &str, count: u64| json!({"pointer": pointer, "from": 1, "to": 2, "count": count});
    for counts in [[1000, 1000, 1000], [1 << 53, 1 << 53, 1 << 53]] {
        let study = study(json!([
            range("/length_mm", counts[0]),
            range("/work_ms", counts[1]),
            range("/youngs_modulus_n_per_mm2", counts[2]),
        ]));
        let Err(Error::Invalid { findings, total: 1 }) =
            check_now(&toy::registry(), STUDIES, body(&study), &Given::default())
        else {
            panic!("not one fault")
        };
        let finding = &findings[0];
        assert_eq!((finding.code, finding.pointer.as_str()), ("too_many_points", "/vary"));
        assert_eq!((finding.value, finding.limit), (Some(counts.iter().map(|&one| one as f64).product()), Some(1e5)));
    }
}

#[test]
fn a_large_study_has_the_faults_of_its_rows_and_spares_those_that_a_variable_leads_into() {
    // Blanks make it large: of its lists the heads are kept at first.
    let large = |study: &Value| Body::Json((study.to_string() + &" ".repeat(100_000)).into());
    let read = |study: &Value| match check_now(&toy::registry(), STUDIES, large(study), &Given::default()) {
        Ok(checked) => Ok(checked.key),
        Err(Error::Invalid { findings, total }) => {
            assert_eq!(total, findings.len());
            Err(findings.into_iter().map(|finding| (finding.code, finding.pointer)).collect::<Vec<_>>())
        }
        other => panic!("{other:?}"),
    };
    let with_rows = |bad: &[usize], pointer: &str| {
        let rows: Vec<Value> = (0..600)
            .map(|row| if bad.contains(&row) { json!({"z_mm": 1}) } else { json!({"z_mm": 1, "deviation_um": 2}) })
            .collect();
        let mut study = study(json!([{"pointer": pointer, "values": [500, 501]}]));
        study["job"]["measurements"] = rows.into();
        study
    };
    let good = with_rows(&[], "/length_mm");
    assert_eq!(read(&good), Ok(check_now(&toy::registry(), STUDIES, body(&good), &Given::default()).unwrap().key));
    for bad in [&[3][..], &[300], &[3, 300, 599]] {
        let study = with_rows(bad, "/length_mm");
        let places: Vec<_> =
            bad.iter().map(|row| ("missing_field", format!("/job/measurements/{row}/deviation_um"))).collect();
        assert_eq!((faults(&study), read(&study)), (places.clone(), Err(places)));
    }
    for row in [3, 300] {
        let filled_in = with_rows(&[row], &format!("/measurements/{row}/deviation_um"));
        assert_eq!(
            read(&filled_in),
            Ok(check_now(&toy::registry(), STUDIES, body(&filled_in), &Given::default()).unwrap().key)
        );
    }
    let mut nobodys = with_rows(&[3], "/length_mm");
    nobodys["calculator"] = json!("nobodys");
    assert_eq!(read(&nobodys), Err(faults(&nobodys)));
}

#[test]
fn a_variable_without_values_hides_no_other_that_has_too_many() {
    let vast = json!({"pointer": "/work_ms", "from": 1, "to": 2, "count": 1_u64 << 53});
    for (empty, fault) in [
        (json!({"pointer": "/length_mm", "values": []}), ("too_few_items", "/vary/0/values")),
        (json!({"pointer": "/length_mm", "from": 1, "to": 2, "count": 0}), ("out_of_range", "/vary/0/count")),
    ] {
        let study = study(json!([empty, vast]));
        assert_eq!(faults(&study), expected(&[("too_many_points", "/vary"), fault]));
    }
}

#[test]
fn every_fault_of_a_study_is_listed_at_once() {
    let study = json!({
        "calculator": "toy-bar",
        "job": {"length_mm": 500, "segments": [{"diameter_mm": 20}], "colour": 1, "measurements": {"csv": "z_mm\n1\n"}},
        "vary": [
            {"pointer": "/lenght_mm", "values": [1, 2]},
            {"pointer": "/segments/3/diameter_mm", "from": 1, "to": 1, "count": 3},
            {"pointer": "/segments", "values": [1, 2], "count": 3},
        ],
        "combine": "zip",
        "outputs": ["/deflections_um", "/deflections_um/0", "/deflections_um/0", "/rows/x", "rows", "/row"],
    });
    assert_eq!(
        faults(&study),
        expected(&[
            ("unknown_field", "/job/colour"),
            ("missing_column", "/job/measurements"),
            ("not_a_number", "/outputs/0"),
            ("repeated_output", "/outputs/2"),
            ("no_such_field", "/outputs/3"),
            ("bad_pointer", "/outputs/4"),
            ("no_such_field", "/outputs/5"),
            ("unequal_lengths", "/vary"),
            ("no_such_field", "/vary/0/pointer"),
            ("no_such_item", "/vary/1/pointer"),
            ("empty_range", "/vary/1/to"),
            ("values_and_range", "/vary/2"),
            ("not_variable", "/vary/2/pointer"),
        ])
    );
}

#[test]
fn values_must_fit_their_field() {
    let all = |values: Value| study(json!([values]));
    for (vary, want) in [
        (
            json!({"pointer": "/length_mm", "values": [1, "2", true]}),
            vec![("wrong_type", "/vary/0/values/1"), ("wrong_type", "/vary/0/values/2")],
        ),
        (
            json!({"pointer": "/mode", "values": ["plain", "plein", 3]}),
            vec![("not_one_of", "/vary/0/values/1"), ("wrong_type", "/vary/0/values/2")],
        ),
        (json!({"pointer": "/mode", "from": 1, "to": 2, "count": 2}), vec![("range_of_words", "/vary/0")]),
        (json!({"pointer": "/length_mm", "values": [5, 5.0]}), vec![("duplicate_value", "/vary/0/values/1")]),
        (json!({"pointer": "/length_mm", "values": [1, null]}), vec![("wrong_type", "/vary/0/values/1")]),
        (json!({"pointer": "/length_mm", "values": []}), vec![("too_few_items", "/vary/0/values")]),
        (json!({"pointer": "/length_mm"}), vec![("no_values", "/vary/0")]),
        (
            json!({"pointer": "/length_mm", "from": 1}),
            vec![("missing_field", "/vary/0/count"), ("missing_field", "/vary/0/to")],
        ),
        (
            json!({"pointer": "/length_mm", "from": 0, "to": -1, "count": 3, "spacing": "log"}),
            vec![("log_not_positive", "/vary/0/from"), ("log_not_positive", "/vary/0/to")],
        ),
        (
            json!({"pointer": "/length_mm", "from": 1, "to": 1.000_000_000_000_001, "count": 9}),
            vec![("range_too_fine", "/vary/0/count")],
        ),
        (json!({"pointer": "/length_mm", "from": 100, "to": 200, "count": 1}), vec![("out_of_range", "/vary/0/count")]),
        (json!({"pointer": "/stations", "from": 2, "to": 5, "count": 3}), vec![("range_not_whole", "/vary/0/count")]),
        (json!({"pointer": "/stations", "values": [2.5]}), vec![("wrong_type", "/vary/0/values/0")]),
        (json!({"pointer": "/length_mm", "values": [1], "colour": 2}), vec![("unknown_field", "/vary/0/colour")]),
    ] {
        assert_eq!(faults(&all(vary.clone())), expected(&want), "{vary}");
    }
    let twice = study(json!([{"pointer": "/length_mm", "values": [1]}, {"pointer": "/length_mm", "values": [2]}]));
    assert_eq!(faults(&twice), expected(&[("duplicate_variable", "/vary/1/pointer")]));
    let four: Vec<Value> = (0..4).map(|_| json!({"pointer": "/length_mm", "values": [1]})).collect();
    assert!(faults(&study(four.into())).contains(&("too_many_items", "/vary".to_owned())));
    assert!(faults(&study(json!([]))).contains(&("too_few_items", "/vary".to_owned())));
    let mut other = study(json!([{"pointer": "/length_mm", "values": [1]}]));
    other["calculator"] = json!("toy-baar");
    assert_eq!(faults(&other), expected(&[("unknown_study_calculator", "/calculator")]));
    other["calculator"] = json!("studies");
    assert_eq!(faults(&other), expected(&[("unknown_study_calculator", "/calculator")]));
}

#[test]
fn a_job_that_is_at_fault_at_every_point_is_a_fault_of_the_study() {
    let mut whole = study(json!([{"pointer": "/stations", "values": [2, 3]}]));
    whole["job"]["segments"][0]["diameter_mm"] = json!(600);
    assert_eq!(faults(&whole), expected(&[("thicker_than_long", "/job/segments/0/diameter_mm")]));
    let varied = study(json!([{"pointer": "/segments/0/diameter_mm", "values": [600, 700]}]));
    assert_eq!(faults(&varied), expected(&[("thicker_than_long", "/vary/0")]));
}

#[test]
fn a_varied_field_may_be_absent_and_a_table_may_come_as_text() {
    let rows = json!([{"z_mm": 10, "deviation_um": 12}]);
    let mut one = study(json!([{"pointer": "/length_mm", "values": [100, 200]}]));
    one["job"] = json!({"segments": [{"diameter_mm": 20}], "measurements": rows});
    one["outputs"] = json!(["/rows"]);
    let mut other = one.clone();
    other["job"]["measurements"] = json!({"csv": "z [cm];deviation_mm\n1;0,012\n"});
    let (one, other) = (solved(&one), solved(&other));
    assert_eq!(one, other, "the same data give the same key however they come");
    assert_eq!(one["input"]["job"]["measurements"]["rows"], 1);
    assert_eq!(one["result"]["rows"][1]["outputs"], json!([1.0]));
    assert_eq!(one["explanation"][0]["code"], "study_constant");
}

#[test]
fn side_by_side_the_first_goes_with_the_first() {
    let mut study = study(json!([
        {"pointer": "/length_mm", "values": [100, 200, 200]},
        {"pointer": "/stations", "values": [2, 2, 4]},
    ]));
    study["combine"] = json!("zip");
    let rows: Vec<Value> =
        solved(&study)["result"]["rows"].as_array().unwrap().iter().map(|row| row["values"].clone()).collect();
    assert_eq!(rows, [json!([100.0, 2.0]), json!([200.0, 2.0]), json!([200.0, 4.0])]);
}

#[test]
fn the_version_of_the_calculator_is_part_of_the_key() {
    // The same study over another version of the toy.
    struct Later;
    impl precut_calc::calculator::Calculator for Later {
        type Input = toy::ToyInput;
        type Output = toy::ToyOutput;
        const META: precut_calc::calculator::Meta =
            precut_calc::calculator::Meta { version: 8, ..<toy::Toy as precut_calc::calculator::Calculator>::META };
        fn fill(_: &mut toy::ToyInput) {}
        fn cost(input: &toy::ToyInput) -> precut_calc::calculator::Cost {
            toy::Toy::cost(input)
        }
        fn run(
            input: &toy::ToyInput,
            monitor: &dyn Monitor,
        ) -> Result<precut_calc::calculator::Answer<toy::ToyOutput>, precut_calc::calculator::Failure> {
            toy::Toy::run(input, monitor)
        }
        fn figures(input: &toy::ToyInput, output: &toy::ToyOutput) -> Vec<Figure> {
            toy::Toy::figures(input, output)
        }
        fn tables(input: &toy::ToyInput, output: &toy::ToyOutput) -> Vec<precut_calc::calculator::Table> {
            toy::Toy::tables(input, output)
        }
    }
    use precut_calc::calculator::Registrar;
    let later = Registry::with(Registrar::calculator::<Later>).unwrap();
    let study = study(json!([{"pointer": "/length_mm", "values": [100]}]));
    let key = |registry: &Registry| check_now(registry, STUDIES, body(&study), &Given::default()).unwrap().key;
    assert_ne!(key(&toy::registry()), key(&later));
    assert_eq!(key(&toy::registry()), key(&toy::registry()));
}

#[test]
fn pictures_are_a_map_over_two_and_curves_over_one() {
    let of = |vary: Value, combine: &str| {
        let mut study = study(vary);
        study["combine"] = json!(combine);
        study["outputs"] = json!(["/deflections_um/0", "/rows"]);
        solve_now(&toy::registry(), STUDIES, body(&study), &Given::default(), &Unwatched).unwrap().figures().unwrap()
    };
    let length = json!({"pointer": "/length_mm", "from": 400, "to": 100, "count": 3, "spacing": "log"});
    let diameter = json!({"pointer": "/segments/0/diameter_mm", "values": [20, 150, 10]});
    let stations = json!({"pointer": "/stations", "values": [1, 2]});
    let mode = json!({"pointer": "/mode", "values": ["plain", "infeasible"]});
    let ids = |figures: &[Figure]| figures.iter().map(|figure| figure.id).collect::<Vec<_>>();

    let figures = of(json!([length]), "grid");
    assert_eq!(ids(&figures), ["curves"]);
    assert_eq!(figures[0].panels.len(), 2, "one panel for each output");
    let Item::Line { x, y, .. } = &figures[0].panels[0].items[0] else { panic!("no line") };
    assert_eq!((x, y), (&vec![100.0, 200.0, 400.0], &vec![Some(100.0 / 3.0), Some(200.0 / 3.0), Some(400.0 / 3.0)]));

    let figures = of(json!([length, diameter]), "grid");
    assert_eq!(ids(&figures), ["map", "curves"]);
    let Item::HeatMap { x, y, values, .. } = &figures[0].panels[0].items[0] else { panic!("no map") };
    assert_eq!((x, y), (&vec![100.0, 200.0, 400.0], &vec![10.0, 20.0, 150.0]), "in order, whatever the study's was");
    let third = |length: f64| Some(length / 3.0);
    assert_eq!(
        values,
        &[
            third(100.0),
            third(200.0),
            third(400.0),
            third(100.0),
            third(200.0),
            third(400.0),
            None,
            third(200.0),
            third(400.0)
        ],
        "row by row; where the bar is thicker than long there is none"
    );

    let figures = of(json!([diameter, length, stations]), "grid");
    assert_eq!(ids(&figures), ["map", "curves"]);
    assert_eq!(figures[0].panels.len(), 2, "one slice for each value of the third");

    let figures = of(json!([mode, length]), "grid");
    assert_eq!(ids(&figures), ["curves"], "words are no axis");
    assert_eq!(figures[0].panels[0].items.len(), 2, "one curve for each word");
    let figures = of(json!([mode]), "grid");
    assert!(matches!(figures[0].panels[0].items[0], Item::Bars { .. }));
    let figures = of(json!([{"pointer": "/length_mm", "values": [100, 200]}, stations]), "zip");
    assert_eq!(ids(&figures), ["curves"]);
}

#[test]
fn pictures_of_the_examples_are_labelled_in_the_language_of_the_reader() {
    let registry = Registry::standard().unwrap();
    for example in super::EXAMPLES {
        let stored =
            solve_now(&registry, STUDIES, Body::Json(example.job.into()), &Given::default(), &Unwatched).unwrap();
        for figure in stored.figures().unwrap() {
            for (code, value) in figure.title.values.iter() {
                let [english, russian] =
                    [Language::En, Language::Ru].map(|language| Texts::names(language, value).unwrap());
                let is_name = |word: &str| word.contains('_') || word.starts_with('/');
                assert!(!english.split_whitespace().any(is_name), "{code}: {english}");
                let left = crate::text::complete::english_in(&russian);
                assert!(left.is_empty() && russian != english, "{}: {code}: {russian}: {left:?}", example.id);
            }
            let title = Texts::shared().message(Language::Ru, "figure", &figure.title);
            assert!(crate::text::complete::english_in(&title).is_empty(), "{title}");
        }
    }
}

#[test]
fn every_label_of_a_picture_has_its_words_in_the_title_or_a_text() {
    let vary = [
        json!({"pointer": "/length_mm", "from": 100, "to": 400, "count": 3}),
        json!({"pointer": "/segments/0/diameter_mm", "values": [10, 20]}),
        json!({"pointer": "/stations", "values": [1, 2]}),
        json!({"pointer": "/mode", "values": ["plain", "infeasible"]}),
    ];
    let sets: [&[usize]; 7] = [&[0], &[3], &[0, 1], &[0, 3], &[0, 1, 2], &[3, 0, 1], &[0, 3, 1]];
    for set in sets {
        let vary: Vec<Value> = set.iter().map(|&index| vary[index].clone()).collect();
        let stored =
            solve_now(&toy::registry(), STUDIES, body(&study(vary.into())), &Given::default(), &Unwatched).unwrap();
        for figure in stored.figures().unwrap() {
            let title = Texts::shared().message(Language::En, "figure", &figure.title);
            assert!(title.contains("Deflections 1"), "{title}");
            let russian = Texts::shared().message(Language::Ru, "figure", &figure.title);
            assert!(!russian.contains(" over "), "{russian}");
            let mut codes = vec![figure.x.label];
            for panel in &figure.panels {
                codes.push(panel.y.label);
                for item in &panel.items {
                    codes.push(match item {
                        Item::Line { name, .. } | Item::Bars { name, .. } => name,
                        Item::HeatMap { value, .. } => value.label,
                        other => panic!("{other:?}"),
                    });
                }
            }
            for code in codes {
                let known = figure.title.values.get(code).is_some() || Texts::shared().has(Language::En, "label", code);
                assert!(known, "{set:?} {}: {code}", figure.id);
            }
        }
    }
}

#[test]
fn tables_have_a_line_for_each_point_and_one_for_each_output() {
    let study = study(json!([
        {"pointer": "/length_mm", "values": [100, 10]},
        {"pointer": "/mode", "values": ["plain", "infeasible"]},
    ]));
    let stored = solve_now(&toy::registry(), STUDIES, body(&study), &Given::default(), &Unwatched).unwrap();
    let tables = stored.tables().unwrap();
    let answer: Value = serde_json::from_slice(&stored.body).unwrap();
    let key = |row: usize| answer["result"]["rows"][row]["key"].as_str().unwrap().to_owned();
    let detail = |row: usize| {
        let said = answer["result"]["rows"][row]["detail"].as_str().unwrap();
        assert!(said.len() > 10, "{said}");
        if said.contains(',') { format!("\"{said}\"") } else { said.to_owned() }
    };
    let csv = crate::render::csv(&tables[0]);
    let expected = format!(
        "length [mm],mode,status,code,detail,deflections.0 [um],key\n\
         100,plain,succeeded,,,33.333333333333336,{}\n100,infeasible,infeasible,no_solution_here,{},,{}\n\
         10,plain,invalid,thicker_than_long,{},,\n10,infeasible,invalid,thicker_than_long,{},,\n",
        key(0),
        detail(1),
        key(1),
        detail(2),
        detail(3),
    );
    assert_eq!(csv, expected);
    // The sentence of a failed row is in the language of the reader; nothing else changes.
    let russian = crate::render::csv(&stored.tables_in(Language::Ru).unwrap()[0]);
    let differ = csv.lines().zip(russian.lines()).filter(|(english, russian)| english != russian);
    let differ: Vec<_> = differ.map(|(_, russian)| russian).collect();
    assert_eq!(differ.len(), 3, "{russian}");
    assert!(differ.iter().all(|line| line.chars().any(|c| ('а'..='я').contains(&c))), "{russian}");
    let extremes = crate::render::csv(&tables[1]);
    assert!(
        extremes.starts_with("output,unit,least,least_row,largest,largest_row,least_at.length [mm],"),
        "{extremes}"
    );
    assert!(extremes.contains("/deflections_um/0,um,33.333333333333336,0,"), "{extremes}");
    let ids: Vec<&str> = tables.iter().map(|table| table.id).collect();
    assert_eq!(ids, super::table::TABLES);
}

/// Cancels after so many looks; notes what it was told.
struct Impatient {
    looks: std::sync::atomic::AtomicUsize,
    most: usize,
    told: std::sync::Mutex<Vec<f64>>,
}

impl Monitor for Impatient {
    fn cancelled(&self) -> bool {
        self.looks.fetch_add(1, std::sync::atomic::Ordering::Relaxed) >= self.most
    }
    fn progress(&self, fraction: f64, stage: Message) {
        Texts::shared().try_word(Language::En, "stage", stage.code, &stage.values).unwrap();
        self.told.lock().unwrap().push(fraction);
    }
}

#[test]
fn it_tells_how_far_it_is_and_stops_when_nobody_waits() {
    let study = study(json!([{"pointer": "/length_mm", "from": 100, "to": 500, "count": 50}]));
    let run = |most: usize| {
        let monitor = Impatient { looks: 0.into(), most, told: Vec::new().into() };
        let outcome = solve_now(&toy::registry(), STUDIES, body(&study), &Given::default(), &monitor);
        (outcome, monitor.told.into_inner().unwrap())
    };
    let (outcome, told) = run(usize::MAX);
    assert!(outcome.is_ok());
    assert_eq!(told.len(), 50);
    assert!(told.windows(2).all(|pair| pair[0] <= pair[1]) && told[49] == 1.0, "{told:?}");
    let (outcome, told) = run(20);
    assert_eq!(outcome.unwrap_err(), Error::Cancelled);
    assert!(told.len() < 20);
}

#[test]
fn the_cost_is_that_of_its_points() {
    let cost = |count: u64| {
        let mut study = study(json!([{"pointer": "/length_mm", "from": 100, "to": 500, "count": count}]));
        study["job"]["work_ms"] = json!(10);
        check_now(&toy::registry(), STUDIES, body(&study), &Given::default()).unwrap().cost
    };
    assert!((cost(10).ms - 102.0).abs() < 1e-9, "{:?}", cost(10));
    assert!((cost(10_000).ms - 102_000.0).abs() < 1e-6, "{:?}", cost(10_000));
    assert_eq!(cost(10).driver, "/vary");
}

#[test]
fn a_composed_entry_is_never_run_where_it_arrives() {
    let entry = studies_of(&toy::registry());
    assert!(entry.is_composed());
    let models = crate::engine::names::Names::new(toy::shared(), crate::engine::names::Found::default());
    let study = study(json!([{"pointer": "/length_mm", "values": [100]}]));
    let ready = read::read(&entry, &body(&study), &models).unwrap();
    assert!(ready.prepared.cost.ms < 0.5, "although it is short");
}

/// Something like a study: right names, any values.
fn any_study() -> impl Strategy<Value = Value> {
    let scalar = prop_oneof![
        Just(Value::Null),
        any::<bool>().prop_map(Value::from),
        (-5_i32..2000).prop_map(Value::from),
        any::<f64>().prop_map(Value::from),
        prop_oneof![Just("plain"), Just("rigid"), Just("log"), Just("zip"), Just("grid")].prop_map(Value::from),
    ];
    let pointer = prop_oneof![
        Just("/length_mm"),
        Just("/segments/0/diameter_mm"),
        Just("/segments"),
        Just("/mode"),
        Just("/support/kind"),
        Just("/stations"),
        Just("/stations/0"),
        Just("/steady/compliance_um_per_n"),
        Just("/measurements/0/z_mm"),
        Just("/"),
        Just(""),
        Just("/effects/0/kind"),
        Just("/~2"),
    ];
    let field = prop_oneof![Just("values"), Just("from"), Just("to"), Just("count"), Just("spacing")];
    let value = prop_oneof![scalar.clone(), prop::collection::vec(scalar.clone(), 0..4).prop_map(Value::from)];
    let variable = (pointer, prop::collection::vec((field, value.clone()), 0..5)).prop_map(|(pointer, fields)| {
        let mut variable = json!({ "pointer": pointer });
        for (name, value) in fields {
            variable[name] = value;
        }
        variable
    });
    let output = prop_oneof![Just("/rows"), Just("/deflections_um/1"), Just("/x"), Just("")];
    (prop::collection::vec(variable, 0..4), scalar, prop::collection::vec(output, 0..3), value).prop_map(
        |(vary, combine, outputs, length)| {
            json!({
                "calculator": "toy-bar", "job": {"length_mm": length, "segments": [{"diameter_mm": 20}]},
                "vary": vary, "combine": combine, "outputs": outputs,
            })
        },
    )
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(256))]
    /// Whatever comes is refused with faults that have words, or runs to an answer with a row for each point.
    #[test]
    fn no_study_makes_it_panic(study in any_study()) {
        match solve_now(&toy::registry(), STUDIES, body(&study), &Given::default(), &Unwatched) {
            Ok(stored) => {
                let answer: Value = serde_json::from_slice(&stored.body).unwrap();
                let rows = answer["result"]["rows"].as_array().unwrap().len();
                prop_assert_eq!(json!(rows), answer["result"]["points"].clone());
                prop_assert!(!stored.figures().unwrap().is_empty());
                prop_assert_eq!(stored.tables().unwrap().len(), 2);
            }
            Err(Error::Invalid { findings, total }) => {
                prop_assert!(total > 0);
                for finding in findings {
                    Texts::shared().try_finding(Language::En, "fault", &finding).unwrap();
                }
            }
            Err(other) => prop_assert!(matches!(other, Error::Syntax(_)), "{:?}", other),
        }
    }
}
