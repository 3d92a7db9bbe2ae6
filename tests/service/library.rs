//! Machines, tools and materials: stored, named in jobs, brought along and taken away.

use precut::registry::Registry;
use reqwest::Method;
use serde_json::{Value, json};

use crate::isolation::{self, As, with_keys};
use crate::support::{Server, header, problem};

const DEFLECTION: &str = "/v1/deflection-compensation";

async fn server() -> Server {
    Server::start_of(Registry::standard().unwrap(), |_| {}).await
}

async fn got(server: &Server, path: &str) -> Value {
    let response = server.get(path).send().await.unwrap();
    assert_eq!(response.status(), 200, "{path}");
    response.json().await.unwrap()
}

async fn put(server: &Server, path: &str, record: &Value) -> (u16, Value) {
    let response = server.client.put(server.url(path)).json(record).send().await.unwrap();
    (response.status().as_u16(), response.json().await.unwrap())
}

async fn answer(server: &Server, path: &str, job: &Value) -> Value {
    let response = server.post_to(path, job.to_string()).send().await.unwrap();
    let (status, text) = (response.status().as_u16(), response.text().await.unwrap());
    assert_eq!(status, 200, "{text}");
    serde_json::from_str(&text).unwrap()
}

/// A shaft in a lathe, with names for all that is not its own.
fn shaft_by_names() -> Value {
    json!({
        "machine": "lathe_engine_medium", "tool": { "name": "bar_a25_pclnr12", "overhang_mm": 100 }, "material": "4140",
        "shaft": { "segments": [{ "length_mm": 400, "diameter_mm": 60, "stock_diameter_mm": 63 }] },
        "supports": [{ "kind": "chuck", "z_mm": 0 }, { "kind": "centre", "z_mm": 400 }],
        "force": { "kind": "kienzle", "normal_force": "judged" },
        "cut": { "feed_mm_per_rev": 0.25, "speed_m_per_min": 180 },
    })
}

fn schedule_by_names() -> Value {
    json!({
        "machine": "lathe_engine_medium", "tool": "dnmg150608_pdjnr2525m15", "material": "1.7225", "cut_kind": "medium",
        "shaft": { "segments": [{ "length_mm": 400, "diameter_mm": 60 }] },
        "supports": [{ "kind": "chuck", "z_mm": 0 }, { "kind": "centre", "z_mm": 400 }],
        "force": { "kind": "kienzle", "normal_force": "judged" },
        "zones": [
            { "id": "a", "z_start_mm": 50, "z_end_mm": 200, "diameter_mm": 60, "depth_mm": 1, "deflection_max_um": 40 },
            { "id": "b", "z_start_mm": 200, "z_end_mm": 380, "diameter_mm": 60, "depth_mm": 1, "deflection_max_um": 40 },
        ],
        "objective": { "kind": "time" },
    })
}

fn milling_by_names() -> Value {
    json!({
        "machine": "vmc_bt40", "tool": "face_100_z7_sekt12", "material": "C45", "force": { "radial_ratio": 0.6 },
        "cut": { "width_mm": 50, "depth_mm": 3, "spindle_speed_rpm": 190.2, "feed_mm_per_tooth": 0.039,
            "feed_toward": "movable_jaw" },
        "fixture": { "kind": "self_locking", "workpiece_mass_kg": 3.311,
            "movable_joint": { "stiffness_n_per_mm": 10830, "damping_n_s_per_mm": 1.473 },
            "fixed_joint": { "stiffness_n_per_mm": 32510, "damping_n_s_per_mm": 0.08673 }, "clamp_force_n": 5400 },
    })
}

fn ring_by_name() -> Value {
    json!({
        "material": "4140", "force": { "edge_width_mm": 12, "normal_force": "judged" },
        "ring": { "radius_mm": 150, "ellipticity_mm": 0.5 }, "supports": { "distance_mm": 200, "depth_mm": 111 },
        "tool": { "x_mm": 100, "y_mm": 113.5, "feed_mm_per_rev": 0.08, "revolutions": 32, "spark_out_revolutions": 1 },
        "stiffness": { "tool_n_per_mm": 60_000, "support_a_n_per_mm": 150_000, "support_b_n_per_mm": 150_000 },
        "forces": { "weight_n": 300 },
    })
}

/// An example of programs, with a lathe, a steel, and tools by codes and by name.
fn program_by_names() -> Value {
    let all = Registry::standard().unwrap();
    let example = all.entry("program-compensation").unwrap().meta().examples[1].job;
    let mut job: Value = serde_json::from_str(example).unwrap();
    let tools = job["tools"].clone();
    job["machine"] = json!("lathe_engine_medium");
    job["material"] = json!("4140");
    job["tools"] = json!([
        { "number": tools[0]["number"], "tip_direction": 3, "insert": "CNMG120408", "holder": "PCLNL2525M12" },
        { "number": tools[1]["number"], "tip_direction": 3, "name": "dnmg150608_pdjnr2525m15", "nose_radius_mm": 0.4 },
    ]);
    job["force"] = json!({ "kind": "kienzle", "normal_force": "judged" });
    job["mode"] = json!({ "kind": "read" });
    job["stock"].as_object_mut().unwrap().remove("material");
    for support in job["supports"].as_array_mut().unwrap() {
        for number in ["compliance_um_per_n", "rotational_compliance_rad_per_n_mm"] {
            support.as_object_mut().unwrap().remove(number);
        }
    }
    job.as_object_mut().unwrap().remove("carriage");
    job
}

#[tokio::test]
async fn a_job_with_names_has_the_answer_of_the_job_with_their_numbers() {
    let (server, elsewhere) = (server().await, server().await);
    for (path, job, kinds) in [
        (DEFLECTION, shaft_by_names(), ["machine", "tool", "material"]),
        ("/v1/feed-schedule", schedule_by_names(), ["machine", "tool", "material"]),
        ("/v1/fixture-stability", milling_by_names(), ["machine", "tool", "material"]),
        ("/v1/ring-roundness", ring_by_name(), ["material"; 3]),
        ("/v1/program-compensation", program_by_names(), ["machine", "material", "tools_1"]),
    ] {
        let named = answer(&server, path, &job).await;
        for kind in kinds {
            let resource = &named["resources"][kind];
            assert_eq!(resource["built_in"], true, "{path} {kind}");
            let folder = kind.split('_').next().unwrap().trim_end_matches('s');
            let record = got(&server, &format!("/v1/{folder}s/{}", resource["name"].as_str().unwrap())).await;
            assert_eq!((&resource["sha256"], &resource["data_version"]), (&record["sha256"], &record["data_version"]));
        }
        // Every number in the origins is that at its pointer; what a record filled in has an origin.
        let (origins, input) = (named["origins"].as_array().unwrap(), &named["input"]);
        assert!(origins.len() >= 4, "{path}: {origins:#?}");
        for origin in origins {
            let pointer = origin["pointer"].as_str().unwrap();
            let there = input.pointer(pointer).unwrap_or(&Value::Null);
            assert_eq!(there.as_f64(), origin["value"].as_f64(), "{pointer}");
            for part in origin["parts"].as_array().unwrap() {
                let said = part["certainty"].is_string() && part["source"].is_string();
                assert!(part["from"] == "job" || said || pointer.starts_with("/uncertainty"), "{pointer}: {part}");
            }
        }
        // What is echoed stands alone: without names, where nothing is stored, it has the same result.
        let plain = answer(&elsewhere, path, input).await;
        assert!(plain.get("resources").is_none_or(Value::is_null), "{path}");
        assert_eq!(plain["result"], named["result"], "{path}");
        assert_ne!(plain["key"], named["key"], "{path}: the answer with names says more");
        // The key is of what the names stand for, not of how they are written.
        let mut spelled = job.clone();
        spelled["material"] = json!(named["resources"]["material"]["name"]);
        assert_eq!(answer(&server, path, &spelled).await["key"], named["key"], "{path}");
    }
    server.stop().await;
    elsewhere.stop().await;
}

#[tokio::test]
async fn a_changed_record_changes_new_answers_and_no_old_one() {
    let server = server().await;
    let stiff = json!({ "from": "lathe_engine_medium", "set": { "/compliance/carriage_um_per_n": 0.018, "/title": "Lathe 3" } });
    let (status, first) = put(&server, "/v1/machines/lathe-3", &stiff).await;
    assert_eq!((status, &first["revision"], &first["built_in"]), (201, &json!(1), &json!(false)));
    assert_eq!(
        first["compliance"]["carriage_um_per_n"],
        json!({ "value": 0.018, "source": "user", "certainty": "user" })
    );
    let mut job = shaft_by_names();
    job["machine"] = json!("lathe-3");
    let before = answer(&server, DEFLECTION, &job).await;
    assert_eq!(before["resources"]["machine"]["revision"], 1);
    let of_carriage = |answer: &Value| answer["input"]["carriage"]["compliance_um_per_n"].as_f64().unwrap();
    // 64 L^3 / (3 pi E D^4) of the bar stands in the chain with the carriage.
    let bar = 1e3 * 64.0 * 1e6 / (3.0 * std::f64::consts::PI * 210_000.0 * 25.0_f64.powi(4));
    assert!((of_carriage(&before) - (0.018 + bar)).abs() < 1e-12, "{}", of_carriage(&before));

    let soft = json!({ "from": "lathe-3@1", "set": { "/compliance/carriage_um_per_n": 0.05 } });
    assert_eq!(put(&server, "/v1/machines/lathe-3", &soft).await.0, 200);
    let after = answer(&server, DEFLECTION, &job).await;
    assert_eq!(after["resources"]["machine"]["revision"], 2);
    assert!((of_carriage(&after) - (0.05 + bar)).abs() < 1e-12);
    assert_ne!(after["key"], before["key"]);
    let mut at_first = job.clone();
    at_first["machine"] = json!("lathe-3@1");
    let again = answer(&server, DEFLECTION, &at_first).await;
    assert_eq!((&again["key"], &again["result"]), (&before["key"], &before["result"]));

    let both = got(&server, "/v1/machines/lathe-3@1/comparison?with=lathe-3").await;
    assert_eq!(both["identical"], false);
    let field = both["fields"].as_array().unwrap().iter().find(|field| field["record"] == 0.018).unwrap();
    assert_eq!(field["pointer"], "/compliance/carriage_um_per_n/value");
    assert!((field["difference_percent"].as_f64().unwrap() - 100.0 * (0.05 / 0.018 - 1.0)).abs() < 1e-9);

    let gone = server.client.delete(server.url("/v1/machines/lathe-3")).send().await.unwrap();
    assert_eq!(gone.status(), 204);
    let refused = problem(server.post_to(DEFLECTION, job.to_string()).send().await.unwrap(), 422, "invalid_job").await;
    assert_eq!(
        (&refused["errors"][0]["code"], &refused["errors"][0]["pointer"]),
        (&json!("deleted_record"), &json!("/machine"))
    );
    // What was answered stays, with the numbers that it had.
    let kept = got(&server, &format!("/v1/results/{}", before["key"].as_str().unwrap())).await;
    assert_eq!((&kept["input"], &kept["resources"]), (&before["input"], &before["resources"]));
    assert_eq!(put(&server, "/v1/machines/lathe-3", &stiff).await.1["revision"], 3, "a number is never given again");
    server.stop().await;
}

#[tokio::test]
async fn a_record_tells_which_results_got_it() {
    let server = server().await;
    let record = json!({ "from": "lathe_engine_medium" });
    let changed = json!({ "from": "lathe_engine_medium", "set": { "/tags": ["a"] } });
    for record in [record, changed] {
        put(&server, "/v1/machines/lathe-3", &record).await;
    }
    let mut job = shaft_by_names();
    assert_eq!(got(&server, "/v1/machines/lathe-3@2").await["uses"], 0);
    job["machine"] = json!("lathe-3@2");
    let key = answer(&server, DEFLECTION, &job).await["key"].clone();
    let stored = got(&server, "/v1/machines/lathe-3@2").await;
    assert_eq!(stored["uses"], 1);
    let there = got(&server, stored["links"]["uses"].as_str().unwrap()).await;
    assert_eq!(there["items"].as_array().unwrap().iter().map(|item| &item["key"]).collect::<Vec<_>>(), [&key]);
    // Of no other revision, and of the built-in ones that it names beside.
    assert_eq!(got(&server, "/v1/machines/lathe-3@1").await["uses"], 0);
    assert_eq!(got(&server, "/v1/machines/lathe_engine_medium").await["uses"], 0);
    assert_eq!(got(&server, "/v1/tools/bar_a25_pclnr12").await["uses"], 1);
    let material = got(&server, "/v1/materials/42crmo4").await;
    assert_eq!(
        (&material["uses"], &got(&server, "/v1/results?record=materials/42crmo4").await["items"]),
        (&json!(1), &there["items"])
    );
    let mut bare = answer(&server, DEFLECTION, &job).await["input"].clone();
    bare["cut"]["speed_m_per_min"] = json!(181);
    assert!(answer(&server, DEFLECTION, &bare).await["resources"].is_null());
    assert_eq!(got(&server, "/v1/machines/lathe-3@2").await["uses"], 1);
    for bad in ["lathe-3", "shafts/lathe-3", "machines/lathe-3@0", "machines/Lathe", "machines/lathe-3@04", "parts/a"] {
        let response = server.get(&format!("/v1/results?record={bad}")).send().await.unwrap();
        let problem = problem(response, 400, "bad_query").await;
        assert!(problem["detail"].as_str().unwrap().contains("machines/lathe-3@4"), "{problem}");
    }
}

#[tokio::test]
async fn a_job_that_waits_keeps_the_numbers_that_it_was_accepted_with() {
    let server = server().await;
    let lathe =
        |carriage: f64| json!({ "from": "lathe_engine_medium", "set": { "/compliance/carriage_um_per_n": carriage } });
    put(&server, "/v1/machines/lathe-3", &lathe(0.018)).await;
    let mut job = shaft_by_names();
    job["machine"] = json!("lathe-3");
    let accepted = server.post_to(DEFLECTION, job.to_string()).header("prefer", "respond-async").send().await.unwrap();
    let place = header(&accepted, "location").to_owned();
    put(&server, "/v1/machines/lathe-3", &lathe(0.05)).await;
    if accepted.status() == 202 {
        let asked = got(&server, &format!("{place}/job")).await;
        assert!(asked["job"].get("machine").is_none(), "{asked:#}");
        let mut record = got(&server, &place).await;
        while record["state"] != "succeeded" {
            assert!(["queued", "running"].contains(&record["state"].as_str().unwrap()), "{record:#}");
            record = got(&server, &place).await;
        }
        let result = got(&server, &format!("{place}/result")).await;
        assert_eq!(result["resources"]["machine"]["revision"], 1);
    } else {
        assert_eq!(accepted.json::<Value>().await.unwrap()["resources"]["machine"]["revision"], 1);
    }
    server.stop().await;
}

#[tokio::test]
async fn what_the_job_says_wins_and_zero_is_something_said() {
    let server = server().await;
    let mut job = shaft_by_names();
    job["tool"] = json!({ "insert": "DNMG150608", "holder": "PDJNL2525M15" });
    job["carriage"] = json!({ "compliance_um_per_n": 0 });
    let rigid = answer(&server, DEFLECTION, &job).await;
    assert_eq!(rigid["input"]["carriage"]["compliance_um_per_n"], 0.0);
    let warned: Vec<&str> = rigid["warnings"].as_array().unwrap().iter().map(|w| w["code"].as_str().unwrap()).collect();
    assert!(warned.contains(&"overrides_record"), "{warned:?}");
    assert_eq!(rigid["input"]["force"]["cutting_edge_angle_deg"], 93.0, "of the holder's style J");
    assert_eq!(rigid["input"]["force"]["nose_radius_mm"], 0.8);
    // Fields of a record may be overruled where it is named.
    job["carriage"].take();
    job.as_object_mut().unwrap().remove("carriage");
    job["machine"] = json!({ "name": "lathe_engine_medium", "compliance": { "carriage_um_per_n": 0.02 } });
    let overruled = answer(&server, DEFLECTION, &job).await;
    assert_eq!(overruled["input"]["carriage"]["compliance_um_per_n"], 0.02);
    // In Russian everything is said, too.
    let russian = server.post_to(DEFLECTION, shaft_by_names().to_string()).header("accept-language", "ru");
    let russian: Value = russian.send().await.unwrap().json().await.unwrap();
    let said = russian["warnings"].to_string() + &russian["explanation"].to_string();
    assert!(said.contains("Станок lathe_engine_medium") || said.contains("нормальная сила оценена"), "{said}");
    server.stop().await;
}

#[tokio::test]
async fn a_bad_name_is_refused_where_it_stands_with_what_there_is() {
    let server = server().await;
    put(&server, "/v1/tools/mine", &json!({ "kind": "turning_external", "insert": "CNMG120408" })).await;
    let faults: &[(&str, Value, &str, &str)] = &[
        ("machine", json!("lathe_engine_mediun"), "unknown_machine", "/machine"),
        ("tool", json!({ "name": "dnmg150608" }), "unknown_tool", "/tool/name"),
        ("material", json!("42CrMo5"), "unknown_material", "/material"),
        ("machine", json!("lathe_engine_medium@9"), "unknown_revision", "/machine"),
        ("tool", json!("mine@7"), "unknown_revision", "/tool"),
        ("machine", json!("vmc_bt40"), "wrong_kind_of_machine", "/machine"),
        ("tool", json!("endmill_10_z4"), "wrong_kind_of_tool", "/tool"),
        ("tool", json!({ "insert": "XNMG120408" }), "bad_insert_shape", "/tool/insert"),
        ("tool", json!({ "holder": "PDFNL2525M15" }), "holder_for_facing", "/tool"),
        (
            "tool",
            json!({ "insert": "CNMG120408", "holder": "PDJNL2525M15" }),
            "insert_does_not_fit_holder",
            "/tool/insert",
        ),
        ("machine", json!(3), "not_a_record", "/machine"),
        ("machine", json!({ "name": "lathe_engine_medium", "complyance": {} }), "unknown_field", "/machine/complyance"),
        (
            "cut",
            json!({ "feed_mm_per_rev": 0.25, "spindle_speed_rpm": 2100 }),
            "above_machine_limit",
            "/cut/spindle_speed_rpm",
        ),
    ];
    for (field, value, code, pointer) in faults {
        let mut job = shaft_by_names();
        job[*field] = value.clone();
        let refused =
            problem(server.post_to(DEFLECTION, job.to_string()).send().await.unwrap(), 422, "invalid_job").await;
        let errors = refused["errors"].as_array().unwrap();
        let is_it = |error: &&Value| error["code"] == *code && error["pointer"] == *pointer;
        assert!(errors.iter().any(|error| is_it(&error)), "{field} {value}: {errors:#?}");
    }
    // All at once, each with what was meant.
    let mut job = shaft_by_names();
    (job["machine"], job["material"]) = (json!("lathe_engine_mediun"), json!("42CrMo5"));
    let refused = problem(server.post_to(DEFLECTION, job.to_string()).send().await.unwrap(), 422, "invalid_job").await;
    assert_eq!(refused["errors_total"], 2, "{refused:#}");
    assert_eq!(refused["errors"][0]["values"]["nearest"][0], "lathe_engine_medium");
    server.stop().await;
}

#[tokio::test]
async fn records_are_found_by_any_name_and_the_engines_own_stay() {
    let server = server().await;
    for text in ["4140", "1.7225", "SCM440", "38ХМ", "42crmo4"] {
        let found: Value = server.get(&format!("/v1/materials?q={text}")).send().await.unwrap().json().await.unwrap();
        assert_eq!(found["items"][0]["name"], "42crmo4", "{text}");
    }
    let lathes = got(&server, "/v1/machines?kind=lathe").await;
    assert!(lathes["items"].as_array().unwrap().iter().all(|machine| machine["kind"] == "lathe"));
    assert_eq!(got(&server, "/v1/machines?own=true").await["items"], json!([]));
    let steels = got(&server, "/v1/materials?group=P&limit=3").await;
    assert_eq!(steels["items"].as_array().unwrap().len(), 3);
    let next = got(&server, steels["next"].as_str().unwrap()).await;
    assert_ne!(next["items"][0]["name"], steels["items"][2]["name"]);

    let (status, refused) = put(&server, "/v1/materials/42crmo4", &json!({ "from": "42crmo4" })).await;
    assert_eq!((status, &refused["code"]), (409, &json!("name_is_built_in")));
    let gone = server.client.delete(server.url("/v1/materials/42crmo4")).send().await.unwrap();
    problem(gone, 409, "name_is_built_in").await;
    let unknown =
        problem(server.get("/v1/machines/lathe_engine_mediun").send().await.unwrap(), 404, "unknown_machine").await;
    assert!(unknown["detail"].as_str().unwrap().contains("lathe_engine_medium"), "{unknown:#}");
    let tool = json!({ "kind": "turning_external", "insert": "CNMG120408" });
    assert_eq!(put(&server, "/v1/tools/mine", &tool).await.0, 201);
    let again = server.client.put(server.url("/v1/tools/mine")).header("if-none-match", "*").json(&tool);
    problem(again.send().await.unwrap(), 412, "record_exists").await;
    // A second material must not take a name that another one of one's own has; the engine's are found beside it.
    let ours = |name: &str| json!({ "from": "42crmo4", "set": { "/names": { "other": [name] } } });
    assert_eq!(put(&server, "/v1/materials/forge-a", &ours("forge steel")).await.0, 201);
    let (status, taken) = put(&server, "/v1/materials/forge-b", &ours("Forge-Steel")).await;
    assert_eq!((status, &taken["errors"][0]["code"]), (422, &json!("name_taken")), "{taken:#}");
    // Faults of a record are told all at once.
    let broken = json!({ "kind": "lathe", "compliance": { "carriage_um_per_n": -1 }, "spindle": { "speed_max": 3 } });
    let (status, broken) = put(&server, "/v1/machines/broken", &broken).await;
    assert_eq!(
        (status, &broken["code"], &broken["errors_total"]),
        (422, &json!("invalid_record"), &json!(2)),
        "{broken:#}"
    );
    let read = server
        .client
        .post(server.url("/v1/tools/parse"))
        .json(&json!({ "insert": "CNMG120408", "holder": "PCLNR2525M12" }));
    let read: Value = read.send().await.unwrap().json().await.unwrap();
    assert_eq!(
        (&read["geometry"]["cutting_edge_angle_deg"], &read["insert"]["nose_radius_mm"]),
        (&json!(95.0), &json!(0.8))
    );
    server.stop().await;
}

#[tokio::test]
async fn what_is_exported_is_imported_elsewhere_as_it_was() {
    let server = server().await;
    put(
        &server,
        "/v1/machines/lathe-3",
        &json!({ "from": "lathe_engine_medium", "set": { "/note": "line one\nline two; \"three\"" } }),
    )
    .await;
    put(&server, "/v1/tools/mine", &json!({ "from": "dnmg150608_pdjnr2525m15" })).await;
    put(
        &server,
        "/v1/materials/ours",
        &json!({ "from": "42crmo4", "set": { "/names": null, "/title": "42CrMo4, ours" } }),
    )
    .await;
    let hashes = async |server: &Server| {
        let mut hashes = Vec::new();
        for path in ["/v1/machines/lathe-3", "/v1/tools/mine", "/v1/materials/ours"] {
            hashes.push(got(server, path).await["sha256"].clone());
        }
        hashes
    };
    let expected = hashes(&server).await;
    for (format, kind) in [("json", "application/json"), ("toml", "application/toml"), ("csv", "text/csv")] {
        let file = server.get(&format!("/v1/library/export?format={format}")).send().await.unwrap();
        assert_eq!(header(&file, "content-type"), kind);
        let file = file.text().await.unwrap();
        let elsewhere = self::server().await;
        let import = async |query: &str, file: &str| {
            let post = elsewhere.client.post(elsewhere.url(&format!("/v1/library/import{query}")));
            let response = post.header("content-type", kind).body(file.to_owned()).send().await.unwrap();
            (response.status().as_u16(), response.json::<Value>().await.unwrap())
        };
        let lengths = |report: &Value| ["new", "changed", "equal"].map(|list| report[list].as_array().unwrap().len());
        let (status, dry) = import("?dry_run=true", &file).await;
        assert_eq!((status, lengths(&dry)), (200, [3, 0, 0]), "{format}: {dry:#}");
        assert_eq!(got(&elsewhere, "/v1/machines?own=true").await["items"], json!([]), "nothing was written");
        assert_eq!(lengths(&import("", &file).await.1), [3, 0, 0], "{format}");
        assert_eq!(hashes(&elsewhere).await, expected, "{format}");
        assert_eq!(lengths(&import("", &file).await.1), [0, 0, 3], "equal records make no revision");
        assert_eq!(got(&elsewhere, "/v1/tools/mine").await["revision"], 1);
        elsewhere.stop().await;
    }
    // One that is bad keeps all of them out, and says where it stands.
    let file = json!({ "schema_version": 1, "tools": [
        { "id": "good", "kind": "turning_external", "insert": "CNMG120408" },
        { "id": "bad", "kind": "turning_external", "insert": "CQMG120408" },
    ] });
    let refused = server.client.post(server.url("/v1/library/import")).json(&file).send().await.unwrap();
    let refused = problem(refused, 422, "invalid_record").await;
    assert_eq!(refused["errors"][0]["pointer"], "/tools/1/insert", "{refused:#}");
    problem(server.get("/v1/tools/good").send().await.unwrap(), 404, "unknown_tool").await;
    // Tools as they leave a spreadsheet: ISO 13399 symbols in the header.
    let sheet = "id,kind,RE,KAPR,insert\nsheet-1,turning_external,0.8,95,CNMG120408\n";
    let post = server.client.post(server.url("/v1/library/import")).header("content-type", "text/csv").body(sheet);
    assert_eq!(post.send().await.unwrap().status(), 200);
    assert_eq!(got(&server, "/v1/tools/sheet-1").await["nose_radius_mm"]["value"], 0.8);
    let other = server.client.post(server.url("/v1/library/import")).header("content-type", "text/plain").body("x");
    problem(other.send().await.unwrap(), 415, "unsupported_media_type").await;
    server.stop().await;
}

#[tokio::test]
async fn records_are_their_owners_alone() {
    let server = Server::start_of(Registry::standard().unwrap(), with_keys).await;
    isolation::records_are_their_owners_alone(&server).await;
    // Who may solve may read what codes say; to store a record takes a scope of its own.
    let reader = As(&server, "reader");
    let put = reader.request(Method::PUT, "/v1/machines/x").json(&json!({ "from": "lathe_engine_medium" }));
    let refused = problem(put.send().await.unwrap(), 403, "forbidden").await;
    assert!(refused["detail"].as_str().unwrap().contains("library"), "{refused:#}");
    let import = reader.request(Method::POST, "/v1/library/import").json(&json!({ "schema_version": 1 }));
    problem(import.send().await.unwrap(), 403, "forbidden").await;
    let parse = As(&server, "a-one").request(Method::POST, "/v1/tools/parse").json(&json!({ "insert": "CNMG120408" }));
    assert_eq!(parse.send().await.unwrap().status(), 200);
    server.stop().await;
}

#[tokio::test]
async fn a_study_varies_names_and_a_diagnosis_takes_them() {
    let server = server().await;
    put(
        &server,
        "/v1/machines/lathe-4",
        &json!({ "from": "lathe_engine_medium", "set": { "/compliance/carriage_um_per_n": 0.1 } }),
    )
    .await;
    let study = json!({
        "calculator": "deflection-compensation", "job": shaft_by_names(),
        "vary": [{ "pointer": "/machine", "values": ["lathe_engine_medium", "lathe-4"] }],
    });
    let response = server.post_to("/v1/studies", study.to_string()).header("prefer", "wait=60").send().await.unwrap();
    let (status, text) = (response.status().as_u16(), response.text().await.unwrap());
    assert_eq!(status, 200, "{text}");
    let study: Value = serde_json::from_str(&text).unwrap();
    assert_eq!(
        study["result"]["counts"]["succeeded"].as_u64().or(study["result"]["succeeded"].as_u64()),
        Some(2),
        "{study:#}"
    );

    let mode =
        json!({ "frequency_hz": 900, "damping_ratio": 0.03, "stiffness_n_per_mm": 18_000, "direction": [1, 0, 0] });
    let milling = json!({
        "machine": "vmc_bt40", "material": "AlMgSi1", "cutter": { "name": "endmill_12_z4_r1" },
        "tool": { "kind": "modes", "modes": [mode] }, "work": { "kind": "rigid" },
        "cut": { "depth_mm": 1, "width_mm": 4, "milling": "down", "spindle_speed_rpm": 8000, "feed_mm_per_tooth": 0.06 },
    });
    let study = json!({
        "calculator": "milling-stability", "job": milling,
        "vary": [{ "pointer": "/cutter/name", "values": ["endmill_12_z4_r1", "endmill_16_z4"] }],
    });
    let response = server.post_to("/v1/studies", study.to_string()).header("prefer", "wait=60").send().await.unwrap();
    let (status, text) = (response.status().as_u16(), response.text().await.unwrap());
    assert_eq!(status, 200, "{text}");
    let study: Value = serde_json::from_str(&text).unwrap();
    let rows = study["result"]["rows"].as_array().unwrap();
    assert_eq!(study["result"]["succeeded"], 2, "{study:#}");
    assert_ne!(rows[0], rows[1], "another cutter has another limit");

    let mut base = shaft_by_names();
    base["tool"] = json!("dnmg150608_pdjnr2525m15");
    let rows: Vec<Value> =
        (1..14).map(|i| json!({ "z_mm": 25 * i, "diameter_deviation_um": 20.0 + f64::from(i) })).collect();
    let diagnosis = json!({
        "calculator": "deflection-compensation", "job": base, "quantity": "diameter_deviation_um", "measurements": rows,
    });
    let response =
        server.post_to("/v1/diagnosis", diagnosis.to_string()).header("prefer", "wait=120").send().await.unwrap();
    let (status, text) = (response.status().as_u16(), response.text().await.unwrap());
    assert_eq!(status, 200, "{text}");
    let diagnosis: Value = serde_json::from_str(&text).unwrap();
    assert_eq!(diagnosis["resources"]["machine"]["name"], "lathe_engine_medium", "{}", diagnosis["resources"]);
    assert_eq!(diagnosis["origins"][0]["pointer"].as_str().unwrap().split('/').nth(1), Some("job"));
    server.stop().await;
}

#[tokio::test]
async fn a_machine_brings_its_learnt_model_along() {
    let server = server().await;
    let model = json!({ "calculator": "deflection-compensation", "provenance": {},
        "effects": [{ "kind": "headstock_compliance", "delta_um_per_n": 0.02 }] });
    assert_eq!(put(&server, "/v1/models/lathe-7", &model).await.0, 201);
    let machine = json!({ "from": "lathe_engine_medium", "set": { "/models/deflection-compensation": "lathe-7@1" } });
    assert_eq!(put(&server, "/v1/machines/lathe-3", &machine).await.0, 201);
    let mut job = shaft_by_names();
    job["machine"] = json!("lathe-3");
    let with = answer(&server, DEFLECTION, &job).await;
    assert_eq!((&with["model"]["name"], &with["model"]["revision"]), (&json!("lathe-7"), &json!(1)));
    job["model"] = Value::Null;
    let without = answer(&server, DEFLECTION, &job).await;
    assert_eq!(without["model"], Value::Null);
    assert_ne!(without["result"], with["result"]);
    server.stop().await;
}

/// A number of cases that may be raised (`PRECUT_NAMES=1000`).
fn cases(usual: u64) -> u64 {
    std::env::var("PRECUT_NAMES").ok().and_then(|count| count.parse().ok()).unwrap_or(usual)
}

/// Numbers that look random and are the same in every run.
struct Dice(u64);

impl Dice {
    fn of<'a, T>(&mut self, items: &'a [T]) -> &'a T {
        self.0 = self.0.wrapping_mul(6_364_136_223_846_793_005).wrapping_add(1_442_695_040_888_963_407);
        let index = usize::try_from(self.0 >> 33).unwrap() % items.len();
        &items[index]
    }
}

#[tokio::test]
async fn any_records_give_the_answer_of_their_numbers() {
    let (server, elsewhere) = (server().await, server().await);
    let names = async |path: &str| -> Vec<Value> {
        let list = got(&server, path).await;
        list["items"].as_array().unwrap().iter().map(|record| record["name"].clone()).collect()
    };
    let lathes = names("/v1/machines?kind=lathe").await;
    let tools = names("/v1/tools?kind=turning_external").await;
    let materials = names("/v1/materials").await;
    let supports = [
        json!([{ "kind": "chuck", "z_mm": 0 }, { "kind": "centre", "z_mm": 180 }]),
        json!([{ "kind": "centre", "z_mm": 0, "compliance_um_per_n": 0 }, { "kind": "centre", "z_mm": 180 }]),
        json!([{ "kind": "chuck", "z_mm": 0 }]),
    ];
    let (mut dice, mut answered) = (Dice(31), 0);
    for case in 0..cases(30) {
        let job = json!({
            "machine": dice.of(&lathes), "tool": dice.of(&tools), "material": dice.of(&materials),
            "shaft": { "segments": [{ "length_mm": 180, "diameter_mm": 18, "stock_diameter_mm": 19 }] },
            "supports": dice.of(&supports),
            "force": { "kind": "kienzle", "normal_force": "judged" },
            "cut": { "feed_mm_per_rev": 0.15, "spindle_speed_rpm": 200 }, "stations": { "kind": "per_zone", "count": 11 },
        });
        let response = server.post_to(DEFLECTION, job.to_string()).send().await.unwrap();
        let (status, named) = (response.status().as_u16(), response.json::<Value>().await.unwrap());
        if status != 200 {
            // Not every material has Kienzle's law, not every machine is so large.
            let of_records = ["above_machine_limit", "material_without_force_law"];
            let codes: Vec<&str> =
                named["errors"].as_array().unwrap().iter().map(|error| error["code"].as_str().unwrap()).collect();
            assert!(!codes.is_empty() && codes.iter().all(|code| of_records.contains(code)), "{case}: {job} {named:#}");
            continue;
        }
        answered += 1;
        for origin in named["origins"].as_array().unwrap() {
            let pointer = origin["pointer"].as_str().unwrap();
            assert_eq!(
                named["input"].pointer(pointer).unwrap().as_f64(),
                origin["value"].as_f64(),
                "{case}: {pointer}"
            );
        }
        let plain = answer(&elsewhere, DEFLECTION, &named["input"]).await;
        assert_eq!(plain["result"], named["result"], "case {case}: {job}");
    }
    assert!(4 * answered > 3 * cases(30), "most records go together: {answered}");
    server.stop().await;
    elsewhere.stop().await;
}

#[tokio::test]
async fn no_record_however_broken_is_a_fault_of_the_service() {
    let server = server().await;
    let hostile = [
        json!(null),
        json!(-1),
        json!(0),
        json!(1e308),
        json!("x"),
        json!("\u{0}'; --"),
        json!([]),
        json!({}),
        json!([[1]]),
        json!({ "value": "x" }),
        json!({ "value": null }),
        json!(true),
    ];
    let mut dice = Dice(7);
    for kind in ["machines", "tools", "materials"] {
        let records = got(&server, &format!("/v1/{kind}")).await;
        let records = records["items"].as_array().unwrap();
        for case in 0..cases(60) {
            let mut record = dice.of(records).clone();
            let fields = record.as_object_mut().unwrap();
            let names: Vec<String> = fields.keys().cloned().collect();
            fields.insert(dice.of(&names).clone(), dice.of(&hostile).clone());
            if case % 3 == 0 {
                fields.insert("spindel".to_owned(), dice.of(&hostile).clone());
            }
            let (status, said) = put(&server, &format!("/v1/{kind}/broken"), &record).await;
            assert!((200..300).contains(&status) || (400..500).contains(&status), "{status} {record} {said:#}");
            assert!(case % 3 != 0 || status == 422, "a field that nobody knows: {record}");
        }
    }
    server.stop().await;
}

#[tokio::test]
async fn a_part_of_a_job_is_kept_as_the_job_has_it_and_only_where_a_job_takes_it() {
    let server = server().await;
    let stock = json!({ "segments": [{ "length_mm": 400, "diameter_mm": 60, "stock_diameter_mm": 63 }] });
    let shaft = |value: &Value| json!({ "field": "shaft", "type": "Shaft", "value": value });
    let (status, kept) = put(&server, "/v1/parts/my-shaft", &shaft(&stock)).await;
    assert_eq!((status, &kept["value"], &kept["revision"]), (201, &stock, &json!(1)), "{kept:#}");
    // A list of items, and what names a record, with words that are keys of the data.
    let supports = json!([{ "kind": "chuck", "z_mm": 0 }, { "kind": "steady_rest", "rest": "front", "z_mm": 200 }]);
    let listed = json!({ "field": "supports", "type": "Support", "value": supports });
    assert_eq!(put(&server, "/v1/parts/my-supports", &listed).await.0, 201);
    let force = json!({ "kind": "kienzle", "normal_force": "judged", "source": "iscar_2017" });
    let (status, kept) =
        put(&server, "/v1/parts/my-force", &json!({ "field": "force", "type": "ForceModel", "value": force })).await;
    assert_eq!((status, &kept["value"]), (201, &force), "{kept:#}");
    // What is kept is what a job takes.
    let mut job = shaft_by_names();
    for (field, name) in [("shaft", "my-shaft"), ("force", "my-force")] {
        job[field] = got(&server, &format!("/v1/parts/{name}")).await["value"].clone();
    }
    answer(&server, DEFLECTION, &job).await;
    let names = |list: &Value| -> Vec<String> {
        list["items"].as_array().unwrap().iter().map(|item| item["name"].as_str().unwrap().to_owned()).collect()
    };
    assert_eq!(names(&got(&server, "/v1/parts").await), ["my-force", "my-shaft", "my-supports"]);
    assert_eq!(names(&got(&server, "/v1/parts?field=shaft").await), ["my-shaft"]);

    let refused = async |record: Value| {
        let (status, said) = put(&server, "/v1/parts/wrong", &record).await;
        assert_eq!(status, 422, "{said:#}");
        let of =
            |error: &Value| (error["pointer"].as_str().unwrap().to_owned(), error["code"].as_str().unwrap().to_owned());
        said["errors"].as_array().unwrap().iter().map(of).collect::<Vec<_>>()
    };
    let pair = |pointer: &str, code: &str| (pointer.to_owned(), code.to_owned());
    for (field, kind) in [("shaft", "Spindle"), ("spindle", "Shaft"), ("name", "string")] {
        let strange = json!({ "field": field, "type": kind, "value": {} });
        assert_eq!(refused(strange).await, [pair("/type", "unknown_part_type")]);
    }
    assert_eq!(
        refused(json!({ "field": "shaft" })).await,
        [pair("/type", "missing_field"), pair("/value", "missing_field")]
    );
    let thin = json!({ "segments": [{ "length_mm": 400, "diameter_mm": -1 }], "colour": "red" });
    let found = refused(shaft(&thin)).await;
    assert_eq!(found.len(), 2, "{found:?}");
    assert!(found.iter().any(|(pointer, _)| pointer == "/value/segments/0/diameter_mm"), "{found:?}");
    let unknown = server.get("/v1/parts/nothing").send().await.unwrap();
    problem(unknown, 404, "unknown_part").await;

    // They travel as records do; TOML has no null.
    let null = json!({ "segments": [{ "length_mm": 400, "diameter_mm": 60 }], "material": null });
    assert_eq!(put(&server, "/v1/parts/my-null", &shaft(&null)).await.0, 201);
    assert_eq!(server.get("/v1/library/export?format=toml").send().await.unwrap().status(), 200);
    server.client.delete(server.url("/v1/parts/my-null")).send().await.unwrap();
    let other = self::server().await;
    for (form, kind) in [("json", "application/json"), ("toml", "application/toml"), ("csv", "text/csv")] {
        let file = server.get(&format!("/v1/library/export?format={form}")).send().await.unwrap().text().await.unwrap();
        let import = other.client.post(other.url("/v1/library/import")).header("content-type", kind).body(file);
        let report: Value = import.send().await.unwrap().json().await.unwrap();
        let (new, equal) = if form == "json" { (3, 0) } else { (0, 3) };
        let count = |list: &str| report[list].as_array().map(Vec::len);
        assert_eq!((count("new"), count("equal")), (Some(new), Some(equal)), "{form}: {report:#}");
    }
    let gone = server.client.delete(server.url("/v1/parts/my-shaft")).send().await.unwrap();
    assert_eq!(gone.status(), 204);
    server.stop().await;
    other.stop().await;
}

#[tokio::test]
async fn the_history_of_a_machine_only_grows() {
    let server = server().await;
    let entry = |model: &str| json!({ "calculator": "deflection-compensation", "model": model, "revision": 1, "from_date": "2026-02-03" });
    let with = |history: Value| json!({ "from": "lathe_engine_medium", "set": { "/history": history } });
    assert_eq!(put(&server, "/v1/machines/lathe-3", &with(json!([entry("a")]))).await.0, 201);
    assert_eq!(put(&server, "/v1/machines/lathe-3", &with(json!([entry("a"), entry("b")]))).await.0, 200);
    for shorter in [json!([entry("a")]), json!([entry("b"), entry("a")]), Value::Null] {
        let (status, refused) = put(&server, "/v1/machines/lathe-3", &with(shorter)).await;
        assert_eq!((status, &refused["errors"][0]["code"]), (422, &json!("history_only_grows")), "{refused:#}");
    }
    server.stop().await;
}

#[tokio::test]
async fn jobs_and_records_are_what_the_contract_says() {
    let server = server().await;
    let document = got(&server, "/openapi.json").await;
    let matches = |name: &str, value: &Value| {
        let schema = json!({ "$ref": format!("#/components/schemas/{name}"), "components": document["components"] });
        let validator = jsonschema::draft202012::new(&schema).unwrap();
        let faults: Vec<_> =
            validator.iter_errors(value).map(|fault| format!("{}: {fault}", fault.instance_path())).collect();
        assert!(faults.is_empty(), "{name}: {faults:#?}\n{value:#}");
    };
    for (path, component, job) in [
        (DEFLECTION, "DeflectionCompensation", shaft_by_names()),
        ("/v1/feed-schedule", "FeedSchedule", schedule_by_names()),
        ("/v1/fixture-stability", "FixtureStability", milling_by_names()),
    ] {
        matches(&format!("{component}Job"), &job);
        matches(&format!("{component}Answer"), &answer(&server, path, &job).await);
    }
    let diagnosis = json!({ "calculator": "deflection-compensation", "job": shaft_by_names(), "quantity": "diameter_deviation_um",
        "measurements": [{ "z_mm": 10, "diameter_deviation_um": 20 }] });
    matches("DiagnosisJob", &diagnosis);
    for (kind, name) in [("machines", "Machine"), ("tools", "Tool"), ("materials", "Material")] {
        let list = got(&server, &format!("/v1/{kind}")).await;
        matches(&format!("{name}RecordList"), &list);
        let address = list["items"][0]["links"]["self"].as_str().unwrap();
        matches(&format!("{name}Record"), &got(&server, address).await);
        let other = list["items"][1]["name"].as_str().unwrap();
        matches("RecordComparison", &got(&server, &format!("{address}/comparison?with={other}")).await);
    }
    let codes = server.client.post(server.url("/v1/tools/parse")).json(&json!({ "insert": "CNMG120408" }));
    matches("ToolCodesRead", &codes.send().await.unwrap().json().await.unwrap());
    let tool =
        json!({ "schema_version": 1, "tools": [{ "id": "mine", "kind": "turning_external", "insert": "CNMG120408" }] });
    let import = server.client.post(server.url("/v1/library/import")).json(&tool);
    matches("ImportReport", &import.send().await.unwrap().json().await.unwrap());
    matches("LibraryFile", &got(&server, "/v1/library/export").await);
    server.stop().await;
}
