//! Stored models: exported, stored, compared, deleted.

use precut::registry::Registry;
use serde_json::{Value, json};

use crate::support::{Server, problem};

async fn server() -> Server {
    Server::start_of(Registry::standard().unwrap(), |_| {}).await
}

fn lathe(delta: f64, low: f64, high: f64) -> Value {
    json!({
        "calculator": "deflection-compensation",
        "effects": [{ "kind": "headstock_compliance", "delta_um_per_n": delta }],
        "provenance": {
            "quantity": "diameter_deviation_um",
            "causes": [{ "kind": "headstock_compliance", "label": "",
                "parameters": [{ "name": "delta_um_per_n", "value": delta, "interval_95": [low, high] }] }]
        }
    })
}

async fn put(server: &Server, name: &str, model: &Value) -> u16 {
    let request = server.client.put(server.url(&format!("/v1/models/{name}")));
    request.header("content-type", "application/json").body(model.to_string()).send().await.unwrap().status().as_u16()
}

async fn got(server: &Server, path: &str) -> Value {
    server.get(path).send().await.unwrap().json().await.unwrap()
}

#[tokio::test]
async fn two_models_are_compared_cause_by_cause() {
    let server = server().await;
    assert_eq!(put(&server, "winter", &lathe(0.022, 0.020, 0.024)).await, 201);
    let mut summer = lathe(0.030, 0.027, 0.033);
    summer["effects"].as_array_mut().unwrap().push(json!({ "kind": "tailstock_offset", "offset_um": 5.0 }));
    assert_eq!(put(&server, "summer", &summer).await, 201);

    let model = got(&server, "/v1/models/winter").await;
    let address = format!("{}summer", model["links"]["comparison"].as_str().unwrap());
    let both = got(&server, &address).await;
    assert_eq!(both["calculator"], "deflection-compensation");
    assert_eq!((&both["model"]["name"], &both["other"]["name"]), (&json!("winter"), &json!("summer")));
    assert_eq!(both["identical"], false);
    let delta = &both["effects"][0]["parameters"][0];
    assert_eq!(
        (&delta["name"], &delta["model"], &delta["other"]),
        (&json!("delta_um_per_n"), &json!(0.022), &json!(0.03))
    );
    assert_eq!(delta["apart"], true);
    assert_eq!(
        (&both["effects"][1]["kind"], &both["effects"][1]["has"]),
        (&json!("tailstock_offset"), &json!("other"))
    );

    // Two revisions of one name; the same one twice.
    assert_eq!(put(&server, "winter", &lathe(0.023, 0.021, 0.025)).await, 200);
    let revisions = got(&server, "/v1/models/winter@1/comparison?with=winter").await;
    assert_eq!(revisions["other"]["revision"], 2);
    assert_eq!(revisions["effects"][0]["parameters"][0]["apart"], false);
    assert_eq!(got(&server, "/v1/models/winter/comparison?with=winter@2").await["identical"], true);
}

#[tokio::test]
async fn what_cannot_be_compared_says_why() {
    let server = server().await;
    assert_eq!(put(&server, "winter", &lathe(0.022, 0.020, 0.024)).await, 201);
    let ring =
        json!({ "calculator": "ring-roundness", "effects": [{ "kind": "tool_push_off", "push_off_ratio": 0.4 }] });
    assert_eq!(put(&server, "ring", &ring).await, 201);
    for (path, status, code) in [
        ("/v1/models/winter/comparison?with=ring", 422, "invalid_model"),
        ("/v1/models/winter/comparison?with=wintr", 404, "unknown_model"),
        ("/v1/models/wintr/comparison?with=winter", 404, "unknown_model"),
        ("/v1/models/winter/comparison", 400, "bad_query"),
        ("/v1/models/winter/comparison?with=ring&x=1", 400, "bad_query"),
    ] {
        let response = server.get(path).send().await.unwrap();
        problem(response, status, code).await;
    }
}

#[tokio::test]
async fn an_exported_model_is_stored_elsewhere_as_it_was_and_deleted() {
    let server = server().await;
    assert_eq!(put(&server, "winter", &lathe(0.022, 0.020, 0.024)).await, 201);
    let exported = got(&server, "/v1/models/winter").await;
    assert_eq!(put(&server, "copy", &exported).await, 201);
    assert_eq!(got(&server, "/v1/models/copy").await["sha256"], exported["sha256"]);
    let names: Vec<Value> = got(&server, "/v1/models").await["items"]
        .as_array()
        .unwrap()
        .iter()
        .map(|model| model["name"].clone())
        .collect();
    assert_eq!(names, ["copy", "winter"]);
    let gone = server.client.delete(server.url("/v1/models/copy")).send().await.unwrap();
    assert_eq!(gone.status(), 204);
    assert_eq!(server.get("/v1/models/copy").send().await.unwrap().status(), 404);
    let mut damaged = exported;
    damaged["effects"][0]["delta_um_per_n"] = json!(0.5);
    assert_eq!(put(&server, "other", &damaged).await, 422);
}

#[tokio::test]
async fn what_a_name_held_before_it_was_deleted_is_no_longer_there() {
    let server = server().await;
    assert_eq!(put(&server, "winter", &lathe(0.022, 0.020, 0.024)).await, 201);
    assert_eq!(put(&server, "winter", &lathe(0.023, 0.020, 0.024)).await, 200);
    let gone = server.client.delete(server.url("/v1/models/winter")).send().await.unwrap();
    assert_eq!(gone.status(), 204);
    assert_eq!(put(&server, "winter", &lathe(0.024, 0.020, 0.026)).await, 201);
    // A revision never means two things.
    assert_eq!(got(&server, "/v1/models/winter").await["revision"], 3);
}

#[tokio::test]
async fn a_model_that_is_too_large_is_refused() {
    let server = server().await;
    let mut large = lathe(0.022, 0.020, 0.024);
    large["provenance"]["note"] = "x".repeat(300_000).into();
    let request = server.client.put(server.url("/v1/models/large")).header("content-type", "application/json");
    let response = request.body(large.to_string()).send().await.unwrap();
    let refused = problem(response, 422, "invalid_model").await;
    assert_eq!(refused["errors"][0]["code"], "model_too_large");
    assert!(refused["errors"][0]["detail"].as_str().unwrap().contains("262144"), "{refused}");
}

/// Its points would all be computed without any model.
#[tokio::test]
async fn a_study_does_not_vary_the_model() {
    let server = server().await;
    assert_eq!(put(&server, "winter", &lathe(0.022, 0.020, 0.024)).await, 201);
    let example = Registry::standard().unwrap().entry("deflection-compensation").unwrap().meta().examples[0].job;
    let job: Value = serde_json::from_str(example).unwrap();
    let study = json!({
        "calculator": "deflection-compensation", "job": job,
        "vary": [{ "pointer": "/model", "values": ["winter", "summer"] }]
    });
    let refused =
        problem(server.post_to("/v1/studies", study.to_string()).send().await.unwrap(), 422, "invalid_job").await;
    let faults: Vec<_> =
        refused["errors"].as_array().unwrap().iter().map(|fault| (&fault["code"], &fault["pointer"])).collect();
    assert_eq!(faults, [(&json!("model_not_variable"), &json!("/vary/0/pointer"))]);
}

#[tokio::test]
async fn a_model_has_each_effect_once() {
    let server = server().await;
    let mut twice = lathe(0.022, 0.020, 0.024);
    let effect = twice["effects"][0].clone();
    twice["effects"].as_array_mut().unwrap().push(effect);
    let request = server.client.put(server.url("/v1/models/twice")).header("content-type", "application/json");
    let refused = problem(request.body(twice.to_string()).send().await.unwrap(), 422, "invalid_model").await;
    assert_eq!(refused["errors"][0]["code"], "duplicate_effect");
    assert_eq!(refused["errors"][0]["pointer"], "/effects/1/kind");
    // Waves of different orders are different effects.
    let wave =
        |order: u32| json!({ "kind": "initial_harmonic", "order": order, "amplitude_mm": 0.01, "phase_rad": 0.0 });
    let waves = json!({ "calculator": "ring-roundness", "effects": [wave(3), wave(5)], "provenance": null });
    assert_eq!(put(&server, "waves", &waves).await, 201);
}

/// A stored model does not blind: what of it changed is named, with what it was, and takes its place in the next revision.
#[tokio::test]
async fn what_a_stored_model_holds_is_found_changed_and_replaced() {
    let server = server().await;
    let unsure = |effect: u32, parameter: &str, by: f64| json!({ "moves": [{ "effect": effect, "parameter": parameter, "by": by }] });
    let mut model = lathe(0.002, 0.001, 0.003);
    model["effects"].as_array_mut().unwrap().insert(0, json!({ "kind": "size_offset", "offset_um": 0.02 }));
    model["provenance"]["effects_uncertainty"] = json!([
        unsure(1, "offset_um", 0.03),
        unsure(2, "delta_um_per_n", 0.0005),
        // What is of no number of the model says nothing.
        unsure(2, "kind", 1.0),
        unsure(3, "delta_um_per_n", 1.0),
    ]);
    assert_eq!(put(&server, "lathe", &model).await, 201);

    let example =
        include_str!("../../crates/precut-calc/src/deflection_compensation/examples/diagnosis_headstock.json");
    let mut job: Value = serde_json::from_str(example).unwrap();
    job["options"] = json!({ "held_out": false });
    job["model"] = json!("lathe");
    // Stated beside the model: its effects come behind.
    job["job"]["effects"] = json!([{ "kind": "guideway_bow", "bow_um": 0.01 }]);
    job["effects_uncertainty"] = json!([unsure(1, "bow_um", 0.05)]);
    let answer = diagnosed(&server, &job).await;
    assert_eq!(
        answer["input"]["effects_uncertainty"],
        json!([unsure(1, "bow_um", 0.05), unsure(2, "offset_um", 0.03), unsure(3, "delta_um_per_n", 0.0005)])
    );
    let result = &answer["result"];
    assert_eq!((&result["verdict"], &result["named"][0]["kind"]), (&json!("named"), &json!("headstock_compliance")));
    let found = &result["named"][0]["parameters"][0];
    assert_eq!(found["was"], 0.002);
    assert!(found["value"].as_f64().unwrap() > 0.01, "{found}");
    let said =
        answer["explanation"].as_array().unwrap().iter().find(|said| said["code"] == "diagnosis_changed").unwrap();
    assert_eq!((&said["values"]["from"], &said["values"]["to"]), (&found["was"], &found["value"]));

    let from = json!({ "from_result": answer["key"] });
    assert_eq!(put(&server, "lathe", &from).await, 200);
    let stored = got(&server, "/v1/models/lathe").await;
    let kinds: Vec<&str> =
        stored["effects"].as_array().unwrap().iter().map(|effect| effect["kind"].as_str().unwrap()).collect();
    assert_eq!(kinds, ["size_offset", "headstock_compliance"]);
    assert_eq!(stored["effects"][1]["delta_um_per_n"], found["value"]);
    let kept = stored["provenance"]["effects_uncertainty"].as_array().unwrap();
    assert_eq!(kept[0], unsure(1, "offset_um", 0.03));
    assert_eq!((kept.len(), &kept[1]["moves"][0]["effect"]), (2, &json!(2)));

    // Under it the same rows hold nothing new.
    let again = diagnosed(&server, &job).await;
    assert_eq!(again["result"]["verdict"], "adequate", "{}", again["result"]["named"]);
}

/// What a diagnosis left open of a model is in the doubt about the parts that are made with it, in place of what is usual.
#[tokio::test]
async fn what_a_stored_model_leaves_open_is_in_the_probability_of_a_good_part() {
    let server = server().await;
    let open =
        |effect: u32, by: f64| json!({ "moves": [{ "effect": effect, "parameter": "delta_um_per_n", "by": by }] });
    let mut model = lathe(0.022, 0.020, 0.024);
    assert_eq!(put(&server, "sure", &model).await, 201);
    model["provenance"]["effects_uncertainty"] = json!([open(1, 0.004)]);
    assert_eq!(put(&server, "unsure", &model).await, 201);

    let example = include_str!("../../crates/precut-calc/src/deflection_compensation/examples/paper.json");
    let mut job: Value = serde_json::from_str(example).unwrap();
    job["tolerance"] = json!({ "diameter_um": 30.0 });
    // Stated beside the model: its effects come behind.
    job["effects"] = json!([{ "kind": "guideway_bow", "bow_um": 0.5 }]);
    job["model"] = json!("unsure");
    let answer: Value =
        server.post_to("/v1/deflection-compensation", job.to_string()).send().await.unwrap().json().await.unwrap();
    assert_eq!(answer["input"]["uncertainty"]["effects"], json!([open(2, 0.004)]));
    let quantities = |answer: &Value| -> Vec<String> {
        let all = answer["result"]["conformance"]["contributions"].as_array().unwrap();
        let mut names: Vec<String> = all.iter().map(|one| one["quantity"].as_str().unwrap().to_owned()).collect();
        names.sort();
        names
    };
    assert_eq!(quantities(&answer), ["force", "model:headstock_compliance/delta_um_per_n", "tool_setting"]);

    job["model"] = json!("sure");
    let sure: Value =
        server.post_to("/v1/deflection-compensation", job.to_string()).send().await.unwrap().json().await.unwrap();
    assert_eq!(quantities(&sure), ["force", "stiffness", "tool_setting"]);

    // Nothing is counted twice.
    job["model"] = json!("unsure");
    let width = json!({ "kind": "lognormal", "log_standard_deviation": 0.1 });
    job["uncertainty"] = json!({ "quantities": [{ "quantity": "headstock_compliance", "distribution": width }] });
    let response = server.post_to("/v1/deflection-compensation", job.to_string()).send().await.unwrap();
    let refused = problem(response, 422, "invalid_job").await;
    assert_eq!(refused["errors"][0]["code"], "duplicate_quantity");
    assert_eq!(refused["errors"][0]["pointer"], "/uncertainty/quantities/0/quantity");
}

async fn diagnosed(server: &Server, job: &Value) -> Value {
    let request = server.post_to("/v1/diagnosis", job.to_string()).header("prefer", "wait=60");
    request.send().await.unwrap().json().await.unwrap()
}

/// What has no name in cuts is a term of the model that a diagnosis leaves: a schedule is made with it, and the same rows show it again.
#[tokio::test]
async fn what_has_no_name_is_stored_and_used() {
    let server = server().await;
    let mut rows = Vec::new();
    for i in 0..12_u32 {
        let speed = 20.0 * 8.0_f64.powf(f64::from(i) / 11.0);
        for (k, depth) in [0.3_f64, 0.6, 1.2].into_iter().enumerate() {
            for (n, feed) in [0.1_f64, 0.2].into_iter().enumerate() {
                // As if at random, about a wave over the speed.
                let scatter = 0.03 * ((17 * i as usize + 29 * k + 41 * n) as f64 * 2.399).sin();
                let wave = 0.2 * (5.0 * (speed / 20.0).ln()).sin() + scatter;
                let ln = 1.1 - 0.2 * speed.ln() + 0.8 * feed.ln() + 0.1 * depth.ln() + wave;
                let cut = json!({ "speed_m_per_min": speed, "feed_mm_per_rev": feed, "depth_mm": depth, "roughness_um": ln.exp() });
                rows.push(cut);
            }
        }
    }
    let roughness = json!({
        "form": "log_log", "constant": 1.1, "speed_exponent": -0.2, "feed_exponent": 0.8, "depth_exponent": 0.1
    });
    let example = Registry::standard().unwrap().entry("feed-schedule").unwrap().meta().examples[0].job;
    let mut job: Value = serde_json::from_str(example).unwrap();
    job["models"]["roughness"] = roughness;
    let base = json!({ "models": { "roughness": job["models"]["roughness"] } });
    let measured =
        json!({ "calculator": "feed-schedule", "job": base, "quantity": "roughness_um", "measurements": rows });
    let found = diagnosed(&server, &measured).await;
    let result = &found["result"];
    assert_eq!(
        (&result["verdict"], &result["extension"]),
        (&json!("unknown"), &json!("remainder")),
        "{}",
        result["remainder"]["kind"]
    );
    assert_eq!(result["remainder"]["known_between"][0]["field"], "speed_m_per_min");
    let said =
        found["explanation"].as_array().unwrap().iter().find(|said| said["code"] == "diagnosis_extended").unwrap();
    let said = said["text"].as_str().unwrap();
    assert!(said.contains("20 to 160 m/min"), "{said}");

    assert_eq!(put(&server, "lathe", &json!({ "from_result": found["key"] })).await, 201);
    let stored = got(&server, "/v1/models/lathe").await;
    assert_eq!(stored["effects"].as_array().unwrap().last().unwrap()["kind"], "remainder");
    let solve = async |job: &Value| -> Value {
        let request = server.post_to("/v1/feed-schedule", job.to_string()).header("prefer", "wait=60");
        request.send().await.unwrap().json().await.unwrap()
    };
    let plain = solve(&job).await;
    job["model"] = json!("lathe");
    let with = solve(&job).await;
    assert_eq!(with["input"]["model"]["name"], "lathe", "{with}");
    assert_ne!(plain["result"]["zones"][0]["roughness_um"], with["result"]["zones"][0]["roughness_um"]);

    let mut again = measured;
    again["model"] = json!("lathe");
    let again = diagnosed(&server, &again).await;
    assert_eq!(again["result"]["verdict"], "adequate", "{again}");
    assert!(again["result"]["recognised"]["sigmas"].as_f64().unwrap() > 5.0);
}
