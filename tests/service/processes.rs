//! Processes under watch over HTTP: the reference stream of a tailstock that softens, fed part by part.

use std::fmt::Write as _;
use std::path::Path;
use std::sync::OnceLock;

use precut::registry::Registry;
use reqwest::{Method, RequestBuilder, Response};
use serde_json::{Value, json};
use sqlx::Connection as _;
use sqlx::sqlite::{SqliteConnectOptions, SqliteConnection};

use crate::isolation::{As, with_keys};
use crate::stream::process_file;
use crate::support::{Server, address_of, header, precut_command, problem};

async fn server() -> Server {
    Server::start_of(Registry::standard().unwrap(), |_| {}).await
}

/// The stream of the reference, read once.
fn stream() -> &'static Value {
    static STREAM: OnceLock<Value> = OnceLock::new();
    STREAM.get_or_init(|| process_file("r01-tailstock-softer.json"))
}

/// A measured row as CSV has it.
fn csv_row(row: &Value) -> String {
    format!("{},{}\n", row["z_mm"], row["diameter_deviation_um"])
}

/// The process of the stream without its parts.
fn declared() -> Value {
    let mut process = stream().clone();
    process.as_object_mut().unwrap().remove("parts");
    process
}

/// The same with every number written in one way.
fn plain(value: &Value) -> Value {
    match value {
        Value::Number(number) => json!(number.as_f64()),
        Value::Array(items) => items.iter().map(plain).collect(),
        Value::Object(fields) => fields.iter().map(|(name, part)| (name.clone(), plain(part))).collect(),
        other => other.clone(),
    }
}

/// The part of a number.
fn part(number: usize) -> Value {
    stream()["parts"][number - 1].clone()
}

fn send(server: &Server, method: Method, path: &str, body: &Value) -> RequestBuilder {
    let request = server.client.request(method, server.url(path)).header("content-type", "application/json");
    request.body(body.to_string())
}

async fn put(server: &Server, path: &str, body: &Value) -> Response {
    send(server, Method::PUT, path, body).send().await.unwrap()
}

async fn put_part(server: &Server, number: usize) -> Value {
    let response = put(server, &format!("/v1/processes/shaft-560/parts/p-{number}"), &part(number)).await;
    let (status, text) = (response.status(), response.text().await.unwrap());
    assert_eq!(status, 201, "{text}");
    serde_json::from_str(&text).unwrap()
}

async fn got(server: &Server, path: &str) -> Value {
    let response = server.get(path).send().await.unwrap();
    let (status, text) = (response.status(), response.text().await.unwrap());
    assert_eq!(status, 200, "{path}: {text}");
    serde_json::from_str(&text).unwrap()
}

/// A process that has the first parts of the stream, all in one request.
async fn with_parts(server: &Server, count: usize) -> Value {
    assert_eq!(put(server, "/v1/processes/shaft-560", &declared()).await.status(), 201);
    let parts: Vec<Value> = (1..=count)
        .map(|number| {
            let mut part = part(number);
            part["part"] = json!(format!("p-{number}"));
            part
        })
        .collect();
    let sent = json!({ "parts": parts });
    let response = send(server, Method::POST, "/v1/processes/shaft-560/parts", &sent).send().await.unwrap();
    let (status, text) = (response.status(), response.text().await.unwrap());
    assert_eq!(status, 200, "{text}");
    serde_json::from_str(&text).unwrap()
}

#[tokio::test]
async fn the_tailstock_that_softened_at_part_37_is_told_part_by_part() {
    let server = server().await;
    let history = with_parts(&server, 36).await;
    assert_eq!((&history["taken"], &history["state"]["state"]), (&json!(36), &json!("in_control")), "{history}");
    let said_of_20 = &history["said"][19];
    assert_eq!((&said_of_20["part"], &said_of_20["state"]), (&json!("p-20"), &json!("in_control")));
    let mut reported = None;
    for number in 37..=46 {
        let said = put_part(&server, number).await;
        assert_eq!(said["sequence"], number + 1);
        assert_eq!((&said["number"], &said["parts"]), (&json!(number), &json!(number)));
        if reported.is_none() && said["state"] == "changed" {
            reported = Some(number);
            assert!(said["news"].as_array().unwrap().contains(&json!("change")), "{said}");
        }
    }
    assert!(reported.is_some_and(|number| number <= 43), "{reported:?}");
    let process = got(&server, "/v1/processes/shaft-560").await;
    assert_eq!(process["state"]["changes"][0]["since_part"], 37);
    assert_eq!(process["state"]["changes"][0]["causes"][0]["kind"], "tailstock_compliance");
    assert_eq!(plain(&process["document"]), plain(&declared()));
    let state = got(&server, "/v1/processes/shaft-560/state").await;
    assert_eq!(state, process["state"]);
    assert_eq!(got(&server, "/v1/processes/shaft-560/changes").await["items"], state["changes"]);
    // What was said when a part came stays as it was said.
    let kept = got(&server, "/v1/processes/shaft-560/parts/p-37").await;
    assert_eq!((&kept["said"]["number"], &kept["revision"]), (&json!(37), &json!(1)));
    assert_eq!(plain(&kept["sent"]), plain(&part(37)));
    let russian = server.get("/v1/processes/shaft-560/state").header("accept-language", "ru").send().await.unwrap();
    assert_eq!(header(&russian, "content-language"), "ru");
    let russian: Value = russian.json().await.unwrap();
    assert_ne!(russian["explanation"][0]["text"], state["explanation"][0]["text"]);
    let table = server.get("/v1/processes/shaft-560/state").header("accept", "text/csv").send().await.unwrap();
    let table = table.text().await.unwrap();
    assert_eq!(table.lines().count(), 47);
    assert!(table.lines().nth(20).unwrap().starts_with("20,p-20,in_control,,"), "{table}");
    let changes = server.get("/v1/processes/shaft-560/state?table=changes").header("accept", "text/csv");
    let changes = changes.send().await.unwrap().text().await.unwrap();
    assert!(changes.lines().nth(1).unwrap().starts_with("c1,37,"), "{changes}");
    server.stop().await;
}

/// Whether two documents are the same but for the last digits of their numbers.
fn nearly_equal(one: &Value, other: &Value) -> bool {
    match (one, other) {
        (Value::Number(one), Value::Number(other)) => {
            let (one, other) = (one.as_f64().unwrap(), other.as_f64().unwrap());
            (one - other).abs() <= 1e-9 * one.abs().max(1.0)
        }
        (Value::Array(one), Value::Array(other)) => {
            one.len() == other.len() && one.iter().zip(other).all(|(one, other)| nearly_equal(one, other))
        }
        (Value::Object(one), Value::Object(other)) => {
            one.len() == other.len() && one.iter().all(|(name, one)| nearly_equal(one, &other[name]))
        }
        (one, other) => one == other,
    }
}

#[tokio::test]
async fn its_model_can_be_used_by_any_job() {
    let server = server().await;
    with_parts(&server, 37).await;
    problem(server.get("/v1/models/shaft-560").send().await.unwrap(), 404, "unknown_model").await;
    assert_eq!(got(&server, "/v1/processes/shaft-560").await["links"]["model"], Value::Null);
    let accepted = async |number: usize| {
        let said = put_part(&server, number).await;
        assert_eq!(said["model"]["name"], "shaft-560");
        said["news"].as_array().unwrap().contains(&json!("accepted"))
    };
    let mut number = 38;
    while !accepted(number).await {
        number += 1;
        assert!(number < 46, "nothing joined the model");
    }
    let address = got(&server, "/v1/processes/shaft-560").await["links"]["model"].as_str().unwrap().to_owned();
    let figures = got(&server, "/v1/processes/shaft-560/figures").await;
    let drawn = figures["items"].as_array().unwrap().iter().find(|figure| figure["id"] == "model").unwrap();
    let panel =
        drawn["panels"].as_array().unwrap().iter().find(|panel| panel["y"]["label"] == "delta_um_per_n").unwrap();
    let curves: Vec<&Value> = panel["items"].as_array().unwrap().iter().map(|item| &item["name"]).collect();
    assert!(curves.contains(&&json!("tailstock_compliance")), "{panel}");
    let picture = server.get("/v1/processes/shaft-560/state?figure=model").header("accept", "image/svg+xml");
    assert_eq!(picture.send().await.unwrap().status(), 200);
    let model = got(&server, &address).await;
    assert_eq!((&model["revision"], &model["provenance"]["after_part"]), (&json!(1), &json!(number)), "{model}");
    assert_eq!(model["provenance"]["changes"][0]["since_part"], 37);
    assert!(!model["provenance"]["effects_uncertainty"].as_array().unwrap().is_empty());
    // The base job with the model is the job that the process proposes for the next part.
    let mut job = declared()["part_types"]["A"]["job"].clone();
    job["model"] = json!("shaft-560");
    let solved = send(&server, Method::POST, "/v1/deflection-compensation", &job).send().await.unwrap();
    let (status, text) = (solved.status(), solved.text().await.unwrap());
    assert_eq!(status, 200, "{text}");
    let next = got(&server, "/v1/processes/shaft-560/next?path=new_path").await;
    let told = serde_json::from_str::<Value>(&text).unwrap();
    assert!(nearly_equal(&told["input"]["effects"], &next["job"]["effects"]), "{told} {next}");
    // Its name is its own.
    let other = json!({ "calculator": model["calculator"], "effects": model["effects"] });
    problem(put(&server, &address, &other).await, 409, "model_of_process").await;
    assert_eq!(put(&server, "/v1/models/shaft-9", &other).await.status(), 201);
    problem(put(&server, "/v1/processes/shaft-9", &declared()).await, 409, "model_name_taken").await;
    assert_eq!(server.client.delete(server.url("/v1/models/shaft-9")).send().await.unwrap().status(), 204);
    assert_eq!(put(&server, "/v1/processes/shaft-9", &declared()).await.status(), 201, "as the refusal advises");
    // A decision that takes the change out of the model is in its next revision.
    let rejected = json!({ "decision": "reject" });
    let rejected = send(&server, Method::POST, "/v1/processes/shaft-560/changes/c1", &rejected).send().await.unwrap();
    assert_eq!(rejected.status(), 200);
    let model = got(&server, &address).await;
    assert_eq!((&model["revision"], &model["provenance"]["changes"]), (&json!(2), &json!([])));
    server.stop().await;
}

#[tokio::test]
async fn without_its_last_part_a_process_has_no_state() {
    let server = server().await;
    assert_eq!(put(&server, "/v1/processes/shaft-560", &declared()).await.status(), 201);
    put_part(&server, 1).await;
    let gone = server.client.delete(server.url("/v1/processes/shaft-560/parts/p-1")).send().await.unwrap();
    assert_eq!(gone.json::<Value>().await.unwrap()["process"], "shaft-560");
    assert_eq!(got(&server, "/v1/processes/shaft-560").await["state"], Value::Null);
    assert_eq!(got(&server, "/v1/processes/shaft-560/changes").await["items"], json!([]));
    let table = server.get("/v1/processes/shaft-560/state?table=changes").header("accept", "text/csv").send().await;
    assert_eq!(table.unwrap().status(), 200);
    assert_eq!(got(&server, "/v1/processes/shaft-560/state").await, Value::Null);
    server.stop().await;
}

#[tokio::test]
async fn a_part_is_taken_once_and_corrected_by_who_has_seen_it() {
    let server = server().await;
    assert_eq!(put(&server, "/v1/processes/shaft-560", &declared()).await.status(), 201);
    let first = put_part(&server, 1).await;
    put_part(&server, 2).await;
    let path = "/v1/processes/shaft-560/parts/p-1";
    let again = put(&server, path, &part(1)).await;
    assert_eq!((again.status().as_u16(), header(&again, "etag")), (200, "\"1\""));
    assert_eq!(again.json::<Value>().await.unwrap(), first, "the same answer, nothing done");
    assert_eq!(got(&server, "/v1/processes/shaft-560").await["sequence"], 3);
    let mut other = part(1);
    other["measurements"][0]["diameter_deviation_um"] = json!(30.5);
    problem(put(&server, path, &other).await, 428, "precondition_required").await;
    let correct = |tag: &'static str| send(&server, Method::PUT, path, &other).header("if-match", tag).send();
    problem(correct("\"7\"").await.unwrap(), 412, "precondition_failed").await;
    let corrected = correct("\"1\"").await.unwrap();
    assert_eq!((corrected.status().as_u16(), header(&corrected, "etag")), (200, "\"2\""));
    let corrected: Value = corrected.json().await.unwrap();
    assert_eq!((&corrected["replayed_parts"], &corrected["revision"]), (&json!(1), &json!(2)));
    assert!(corrected["news"].as_array().unwrap().contains(&json!("replayed")));
    // Another part cannot have its number.
    let taken = put(&server, "/v1/processes/shaft-560/parts/q", &part(1)).await;
    let taken = problem(taken, 409, "part_number_taken").await;
    assert!(taken["detail"].as_str().unwrap().contains("p-1"), "{taken}");
    let gone = server.client.delete(server.url(path)).send().await.unwrap();
    assert_eq!(gone.status(), 200);
    let gone: Value = gone.json().await.unwrap();
    assert_eq!((&gone["parts"], &gone["number"]), (&json!(1), &Value::Null));
    problem(server.client.delete(server.url(path)).send().await.unwrap(), 404, "unknown_process_part").await;
    // It stays on record.
    let kept = got(&server, path).await;
    let kinds: Vec<&Value> = kept["history"].as_array().unwrap().iter().map(|entry| &entry["kind"]).collect();
    assert_eq!(kinds, ["part", "part", "withdrawn"]);
    assert_eq!(kept["withdrawn"], true);
    let log = got(&server, "/v1/processes/shaft-560/history?limit=3").await;
    assert_eq!(log["items"].as_array().unwrap().len(), 3);
    let rest = got(&server, log["next"].as_str().unwrap()).await;
    assert_eq!((rest["items"][0]["sequence"].clone(), rest["next"].clone()), (json!(4), Value::Null));
    server.stop().await;
}

#[tokio::test]
async fn the_order_in_which_parts_arrive_changes_no_digit() {
    let server = server().await;
    with_parts(&server, 42).await;
    let path = |name: &str| format!("/v1/processes/{name}/state");
    let expected = got(&server, &path("shaft-560")).await;
    assert_eq!(put(&server, "/v1/processes/other", &declared()).await.status(), 201);
    // The last first, then pairs the wrong way round; one of them wrong, and put right.
    let order = [42].into_iter().chain((1..=20).flat_map(|k| [2 * k, 2 * k - 1])).chain([41]);
    for number in order {
        let at = format!("/v1/processes/other/parts/p-{number}");
        if number == 7 {
            let mut wrong = part(7);
            wrong["measurements"][3]["diameter_deviation_um"] = json!(99.0);
            assert_eq!(put(&server, &at, &wrong).await.status(), 201);
            let right = send(&server, Method::PUT, &at, &part(7)).header("if-match", "\"1\"").send().await.unwrap();
            assert_eq!(right.status(), 200);
        } else {
            assert_eq!(put(&server, &at, &part(number)).await.status(), 201, "{number}");
        }
    }
    let mut found = got(&server, &path("other")).await;
    for field in ["process", "sequence", "action"] {
        found[field] = expected[field].clone();
    }
    found["model"]["name"] = expected["model"]["name"].clone();
    assert_eq!(found, expected);
    server.stop().await;
}

#[tokio::test]
async fn what_a_person_decides_is_kept_and_taken() {
    let server = server().await;
    with_parts(&server, 40).await;
    let changed = got(&server, "/v1/processes/shaft-560/state").await;
    assert_eq!(changed["state"], "changed", "{changed}");
    let decide = async |id: &str, said: Value| {
        let path = format!("/v1/processes/shaft-560/changes/{id}");
        send(&server, Method::POST, &path, &said).send().await.unwrap()
    };
    problem(decide("c9", json!({ "decision": "reject" })).await, 404, "unknown_change").await;
    let unlisted = decide("c1", json!({ "decision": "name", "cause": "roller_runout" })).await;
    assert_eq!(problem(unlisted, 422, "invalid_process").await["errors"][0]["code"], "cause_not_listed");
    problem(decide("c1", json!({ "decision": "name" })).await, 422, "invalid_process").await;
    let named = decide("c1", json!({ "decision": "name", "cause": "tailstock_compliance", "note": "loose" })).await;
    assert_eq!(named.status(), 200);
    let named: Value = named.json().await.unwrap();
    let change = &named["changes"][0];
    assert_eq!((&change["decided"], &change["accepted"]), (&json!("named"), &json!(true)), "{change}");
    assert_eq!(change["causes"].as_array().unwrap().len(), 1);
    let said = put_part(&server, 41).await;
    assert_eq!(said["changes"][0]["decided"], "named");
    let log = got(&server, "/v1/processes/shaft-560/history?after=41").await;
    assert_eq!(log["items"][0]["sent"]["note"], "loose");
    // A part that comes late is judged with the decision where it was made.
    let mut late = part(42);
    late["number"] = json!(42);
    assert_eq!(put(&server, "/v1/processes/shaft-560/parts/p-42", &late).await.status(), 201);
    let withdrawn = server.client.delete(server.url("/v1/processes/shaft-560/parts/p-3")).send().await.unwrap();
    let withdrawn: Value = withdrawn.json().await.unwrap();
    assert_eq!(withdrawn["changes"][0]["decided"], "named", "{withdrawn}");
    server.stop().await;
}

#[tokio::test]
async fn a_rejected_change_causes_no_alarm_any_more() {
    let server = server().await;
    with_parts(&server, 40).await;
    let path = "/v1/processes/shaft-560/changes/c1";
    let rejected = send(&server, Method::POST, path, &json!({ "decision": "reject" })).send().await.unwrap();
    let rejected: Value = rejected.json().await.unwrap();
    assert_eq!(rejected["changes"][0]["decided"], "rejected", "{rejected}");
    for number in 41..=46 {
        let said = put_part(&server, number).await;
        assert_ne!(said["state"], "changed", "{said}");
    }
    server.stop().await;
}

/// Rows in another unit are held back until a person says that they are right.
#[tokio::test]
async fn rows_in_a_wrong_unit_wait_for_a_person() {
    let server = server().await;
    with_parts(&server, 30).await;
    let mut wrong = part(31);
    for row in wrong["measurements"].as_array_mut().unwrap() {
        row["diameter_deviation_um"] = json!(row["diameter_deviation_um"].as_f64().unwrap() / 25.4);
    }
    let at = "/v1/processes/shaft-560/parts/p-31";
    let told = problem(put(&server, at, &wrong).await, 422, "invalid_process").await;
    assert_eq!(
        (&told["errors"][0]["code"], &told["errors"][0]["pointer"]),
        (&json!("unit_suspected"), &json!("/measurements"))
    );
    let factor = told["errors"][0]["values"]["factor"].as_f64().unwrap();
    assert!((factor * 25.4 - 1.0).abs() < 0.12 || (factor / 25.4 - 1.0).abs() < 0.12, "{told}");
    wrong["confirmed"] = json!(true);
    let taken = put(&server, at, &wrong).await;
    assert_eq!(taken.status(), 201);
    assert!(taken.json::<Value>().await.unwrap()["unused"].is_null());
    server.stop().await;
}

#[tokio::test]
async fn the_next_part_has_the_calculators_own_job_and_program() {
    let server = server().await;
    with_parts(&server, 46).await;
    let next = got(&server, "/v1/processes/shaft-560/next?path=new_path").await;
    assert_eq!((&next["number"], &next["part_type"]), (&json!(47), &json!("A")));
    let effects = next["job"]["effects"].as_array().unwrap();
    // What has a name acts under it; what is left of the part beside acts as something without one.
    let named = effects.iter().find(|effect| effect["kind"] == "tailstock_compliance").unwrap();
    let softer = named["delta_um_per_n"].as_f64().unwrap();
    // What was hidden is 0.004369 um/N.
    assert!((0.002..0.007).contains(&softer), "{softer}");
    // The job is one that the calculator takes, and its answer is kept.
    assert_eq!(got(&server, next["answer"].as_str().unwrap()).await["calculator"], "deflection-compensation");
    let asked = server.post_to("/v1/deflection-compensation", next["job"].to_string()).send().await.unwrap();
    assert_eq!(header(&asked, "content-location"), next["answer"].as_str().unwrap());
    let state = got(&server, "/v1/processes/shaft-560").await;
    // A look gives no path out; taking the program does, once.
    let program = server.get("/v1/processes/shaft-560/next?path=new_path").header("accept", "text/x-gcode");
    let program = program.send().await.unwrap();
    assert_eq!((program.status().as_u16(), header(&program, "precut-path")), (200, "1"));
    assert!(program.text().await.unwrap().contains('X'));
    let with_path = got(&server, "/v1/processes/shaft-560").await;
    assert_eq!(with_path["sequence"].as_i64(), state["sequence"].as_i64().map(|sequence| sequence + 1));
    let again = server.get("/v1/processes/shaft-560/next?path=new_path").header("accept", "text/x-gcode");
    assert_eq!(header(&again.send().await.unwrap(), "precut-path"), "1");
    // From now on a part says on which path it was cut.
    let at = "/v1/processes/shaft-560/parts/p-47";
    let silent = problem(put(&server, at, &part(47)).await, 422, "invalid_process").await;
    assert_eq!(
        (&silent["errors"][0]["code"], &silent["errors"][0]["pointer"]),
        (&json!("path_not_stated"), &json!("/path"))
    );
    let on = |path: Value| {
        let mut part = part(47);
        part["path"] = path;
        part
    };
    let strange = put(&server, at, &on(json!({ "kind": "process", "revision": 9 }))).await;
    assert_eq!(problem(strange, 422, "invalid_process").await["errors"][0]["code"], "unknown_path");
    // Rows of a part on the nominal path, said to be of a compensated one, are far off: the path counts.
    let off = put(&server, at, &on(json!({ "kind": "process", "revision": 1 }))).await;
    assert_eq!(off.status(), 201);
    let off: Value = off.json().await.unwrap();
    assert!(off["score"]["chi2"].as_f64().unwrap() > 1000.0 || off["unused"].is_string(), "{off}");
    let right = send(&server, Method::PUT, at, &on(json!({ "kind": "nominal" }))).header("if-match", "\"1\"");
    let right: Value = right.send().await.unwrap().json().await.unwrap();
    assert!(right["score"]["p"].as_f64().unwrap() > 1e-6, "{right}");
    let unknown = server.get("/v1/processes/shaft-560/next?part_type=B").send().await.unwrap();
    problem(unknown, 422, "invalid_process").await;
    let warm = got(&server, "/v1/processes/shaft-560/next?warm_time_at_start_min=12.5").await;
    assert_eq!(warm["job"]["conditions"]["warm_time_at_start_min"], 12.5);
    server.stop().await;
}

#[tokio::test]
async fn what_a_new_path_brought_is_told_drawn_and_given_as_a_table() {
    let server = server().await;
    with_parts(&server, 46).await;
    let figures = |list: Value| -> Vec<String> {
        list["items"].as_array().unwrap().iter().map(|figure| figure["id"].as_str().unwrap().to_owned()).collect()
    };
    let before = figures(got(&server, "/v1/processes/shaft-560/figures").await);
    assert_eq!(before, ["chart", "next"], "of a history that came at once nobody was told the account part by part");
    let program = server.get("/v1/processes/shaft-560/next?path=new_path").header("accept", "text/x-gcode");
    assert_eq!(header(&program.send().await.unwrap(), "precut-path"), "1");
    let state = got(&server, "/v1/processes/shaft-560/state").await;
    // A part that comes out as it is expected on the new path.
    let mut better = part(47);
    better["path"] = json!({ "kind": "process", "revision": 1 });
    let expected = state["forecast"]["new_path"]["mean"].as_array().unwrap();
    for (row, mean) in better["measurements"].as_array_mut().unwrap().iter_mut().zip(expected) {
        row["diameter_deviation_um"] = json!((10.0 * mean.as_f64().unwrap()).round() / 10.0);
    }
    assert_eq!(put(&server, "/v1/processes/shaft-560/parts/p-47", &better).await.status(), 201);
    let gain = got(&server, "/v1/processes/shaft-560/gain").await["gain"].take();
    // Those of the stream are cut on the nominal path, which is not that of the job either.
    assert_eq!(gain["parts_cut_with_new_path"], 47);
    let gained = gain["form_gain_um"].as_f64().unwrap();
    assert!(gained > state["gain"]["form_gain_um"].as_f64().unwrap(), "{gain}");
    assert_eq!(figures(got(&server, "/v1/processes/shaft-560/figures").await), ["chart", "gain", "model", "next"]);
    let table = async |name: &str| {
        let asked = server.get(&format!("/v1/processes/shaft-560/state?table={name}")).header("accept", "text/csv");
        asked.send().await.unwrap().text().await.unwrap()
    };
    let of_gain = table("gain").await;
    let last: Vec<&str> = of_gain.lines().last().unwrap().split(',').collect();
    assert_eq!((last[0], last[1], last[3]), ("47", "p-47", "47"));
    assert!((last[4].parse::<f64>().unwrap() - gained).abs() < 1e-9);
    let of_model = table("model").await;
    assert!(of_model.lines().any(|line| line.starts_with("tailstock_compliance,")), "{of_model}");
    // Of two that warm up with different time constants each is told apart.
    let state = got(&server, "/v1/processes/shaft-560/state").await;
    let sizes = state["model"]["sizes"].as_array().unwrap();
    let mut said: Vec<String> =
        sizes.iter().map(|size| format!("{} {} {}", size["text"], size["parameter"], size["since_part"])).collect();
    assert!(said.iter().any(|text| text.contains("Thermal growth, time constant 2")), "{said:?}");
    said.sort();
    said.dedup();
    assert_eq!(said.len(), sizes.len(), "{said:?}");
    let drawn = server.get("/v1/processes/shaft-560/state?figure=gain").header("accept", "image/svg+xml");
    assert!(drawn.send().await.unwrap().text().await.unwrap().starts_with("<svg"));
    server.stop().await;
}

#[tokio::test]
async fn every_fault_of_a_process_or_a_part_is_told_at_once() {
    let server = server().await;
    let mut process = declared();
    process["part_types"]["A"]["job"]["cut"]["feed_mm_per_rev"] = json!(-1.0);
    process["options"]["learning_parts"] = json!(1);
    process["optoins"] = json!({});
    let told = problem(put(&server, "/v1/processes/shaft-560", &process).await, 422, "invalid_process").await;
    let places: Vec<&str> = told["errors"].as_array().unwrap().iter().map(|e| e["pointer"].as_str().unwrap()).collect();
    assert_eq!(places, ["/options/learning_parts", "/optoins", "/part_types/A/job/cut/feed_mm_per_rev"], "{told}");
    for name in ["ring-clamping", "shaft-compensation"] {
        let mut other = declared();
        other["calculator"] = json!(name);
        let told = problem(put(&server, "/v1/processes/shaft-560", &other).await, 422, "invalid_process").await;
        assert_eq!(told["errors"][0]["code"], "calculator_not_watched", "{name}");
    }
    problem(put(&server, "/v1/processes/Shaft", &declared()).await, 422, "invalid_process").await;
    problem(put(&server, "/v1/processes/none/parts/a", &part(1)).await, 404, "unknown_process").await;
    assert_eq!(put(&server, "/v1/processes/shaft-560", &declared()).await.status(), 201);
    let near = server.get("/v1/processes/shaft-561").send().await.unwrap();
    assert!(problem(near, 404, "unknown_process").await["detail"].as_str().unwrap().contains("shaft-560"));
    put_part(&server, 1).await;
    let mut bad = part(2);
    bad["part_type"] = json!("C");
    bad["conditions"]["edge"] = json!(0);
    bad["measurements"][1]["z_mm"] = json!(9000.0);
    bad["measurements"][2]["diameter_deviation_um"] = Value::Null;
    let told = problem(put(&server, "/v1/processes/shaft-560/parts/p-2", &bad).await, 422, "invalid_process").await;
    assert!(told["errors_total"].as_u64().unwrap() >= 1, "{told}");
    let mut bad = part(2);
    bad["conditions"]["edge"] = json!(0);
    bad["part_type"] = json!("C");
    let told = problem(put(&server, "/v1/processes/shaft-560/parts/p-2", &bad).await, 422, "invalid_process").await;
    let places: Vec<&str> = told["errors"].as_array().unwrap().iter().map(|e| e["pointer"].as_str().unwrap()).collect();
    assert_eq!(places, ["/conditions/edge", "/part_type"], "{told}");
    let mut cold = part(2);
    cold["conditions"].as_object_mut().unwrap().remove("warm_time_at_start_min");
    let told = problem(put(&server, "/v1/processes/shaft-560/parts/p-2", &cold).await, 422, "invalid_process").await;
    assert_eq!(told["errors"][0]["code"], "condition_missing", "{told}");
    let mut few = part(2);
    few["measurements"].as_array_mut().unwrap().truncate(3);
    let few = put(&server, "/v1/processes/shaft-560/parts/p-2", &few).await;
    assert_eq!(few.status(), 201);
    assert_eq!(few.json::<Value>().await.unwrap()["unused"], "too_few_rows");
    server.stop().await;
}

#[tokio::test]
async fn a_process_is_revised_stopped_and_deleted_by_who_has_seen_it() {
    let server = server().await;
    with_parts(&server, 25).await;
    let path = "/v1/processes/shaft-560";
    let same = put(&server, path, &declared()).await;
    assert_eq!((same.status().as_u16(), header(&same, "etag")), (200, "\"1-26\""));
    let mut stopped = declared();
    stopped["stopped"] = json!(true);
    problem(put(&server, path, &stopped).await, 428, "precondition_required").await;
    let revise = |tag: &'static str| send(&server, Method::PUT, path, &stopped).header("if-match", tag).send();
    problem(revise("\"1-25\"").await.unwrap(), 412, "precondition_failed").await;
    let revised = revise("\"1-26\"").await.unwrap();
    assert_eq!((revised.status().as_u16(), header(&revised, "etag")), (200, "\"2-27\""));
    assert_eq!(revised.json::<Value>().await.unwrap()["state"]["state"], "stopped");
    let said = put_part(&server, 26).await;
    assert_eq!((&said["state"], &said["action"]), (&json!("stopped"), &Value::Null));
    let program = server.get("/v1/processes/shaft-560/next").header("accept", "text/x-gcode").send().await.unwrap();
    problem(program, 409, "action_is_call_person").await;
    let list = got(&server, "/v1/processes?limit=1").await;
    assert_eq!((&list["items"][0]["name"], &list["next"]), (&json!("shaft-560"), &Value::Null));
    let delete = |tag: Option<&'static str>| {
        let request = server.client.delete(server.url(path));
        tag.map_or(server.client.delete(server.url(path)), |tag| request.header("if-match", tag)).send()
    };
    problem(delete(None).await.unwrap(), 428, "precondition_required").await;
    assert_eq!(delete(Some("\"2-28\"")).await.unwrap().status(), 204);
    problem(server.get(path).send().await.unwrap(), 404, "unknown_process").await;
    server.stop().await;
}

#[tokio::test]
async fn a_whole_record_goes_out_and_in() {
    let server = server().await;
    with_parts(&server, 40).await;
    let path = "/v1/processes/shaft-560/changes/c1";
    let confirmed = send(&server, Method::POST, path, &json!({ "decision": "confirm" })).send().await.unwrap();
    assert_eq!(confirmed.status(), 200);
    server.client.delete(server.url("/v1/processes/shaft-560/parts/p-2")).send().await.unwrap();
    let record = got(&server, "/v1/processes/shaft-560/export").await;
    problem(put(&server, "/v1/processes/shaft-560", &record).await, 409, "process_exists").await;
    let mut damaged = record.clone();
    damaged["record"][3]["content"]["number"] = json!(77);
    let refused = problem(put(&server, "/v1/processes/copy", &damaged).await, 422, "invalid_process").await;
    assert_eq!(refused["errors"][0]["code"], "record_damaged");
    assert_eq!(put(&server, "/v1/processes/copy", &record).await.status(), 201);
    let mut copied = got(&server, "/v1/processes/copy/state").await;
    let own = got(&server, "/v1/processes/shaft-560/state").await;
    for field in ["process", "action"] {
        copied[field] = own[field].clone();
    }
    copied["model"]["name"] = own["model"]["name"].clone();
    assert_eq!(copied, own);
    assert_eq!(got(&server, "/v1/processes/copy/export").await["sha256"], record["sha256"]);
    server.stop().await;
}

#[tokio::test]
async fn a_history_comes_as_a_table_and_a_part_as_a_bare_one() {
    let server = server().await;
    with_parts(&server, 22).await;
    assert_eq!(put(&server, "/v1/processes/table", &declared()).await.status(), 201);
    let mut table =
        "part;number;part_type;edge;batch;tool_path_at_start_m;warm_time_at_start_min;z [mm];diameter deviation [um]\n"
            .to_owned();
    let comma = |value: &Value| value.to_string().replace('.', ",").replace('"', "");
    let rows = |part: &Value| part["measurements"].as_array().unwrap().clone();
    for number in 1..=21 {
        let part = part(number);
        let c = &part["conditions"];
        for row in rows(&part) {
            let cells = [&c["edge"], &c["batch"], &c["tool_path_at_start_m"], &c["warm_time_at_start_min"]].map(comma);
            let measured = [&row["z_mm"], &row["diameter_deviation_um"]].map(comma).join(";");
            let _ = writeln!(table, "p-{number};{number};A;{};{measured}", cells.join(";"));
        }
    }
    let post = server.client.post(server.url("/v1/processes/table/parts")).header("content-type", "text/csv");
    let taken = post.body(table).send().await.unwrap();
    let (status, text) = (taken.status(), taken.text().await.unwrap());
    assert_eq!(status, 200, "{text}");
    let last = part(22);
    let c = &last["conditions"];
    let bare: String = rows(&last).iter().map(csv_row).collect::<Vec<_>>().concat();
    let query = format!(
        "number=22&part_type=A&edge={}&batch={}&tool_path_at_start_m={}&warm_time_at_start_min={}",
        c["edge"],
        c["batch"].as_str().unwrap(),
        c["tool_path_at_start_m"],
        c["warm_time_at_start_min"]
    );
    let put = server.client.put(server.url(&format!("/v1/processes/table/parts/p-22?{query}")));
    let put = put.header("content-type", "text/csv").body(format!("z_mm,diameter_deviation_um\n{bare}"));
    let put = put.send().await.unwrap();
    let (status, text) = (put.status(), put.text().await.unwrap());
    assert_eq!(status, 201, "{text}");
    let mut found = got(&server, "/v1/processes/table/state").await;
    let expected = got(&server, "/v1/processes/shaft-560/state").await;
    for field in ["process", "action"] {
        found[field] = expected[field].clone();
    }
    found["model"]["name"] = expected["model"]["name"].clone();
    assert_eq!(found, expected);
    let short = server.client.post(server.url("/v1/processes/table/parts")).header("content-type", "text/csv");
    let refused = problem(short.body("part,z_mm\na,1\n").send().await.unwrap(), 422, "invalid_process").await;
    assert_eq!(refused["errors_total"], 2, "{refused}");
    server.stop().await;
}

#[tokio::test]
async fn what_happens_is_told_as_it_happens_and_again_from_where_it_ended() {
    let server = server().await;
    with_parts(&server, 36).await;
    let mut stream = server.get("/v1/processes/shaft-560/events").header("last-event-id", "36").send().await.unwrap();
    assert_eq!(header(&stream, "content-type"), "text/event-stream");
    for number in 37..=40 {
        put_part(&server, number).await;
    }
    let mut told = String::new();
    while !told.contains("id: 41") {
        told.push_str(&String::from_utf8_lossy(&stream.chunk().await.unwrap().unwrap()));
    }
    assert!(told.starts_with("event: part\ndata:") || told.starts_with("event: part\n"), "{told}");
    for word in ["id: 37", "id: 38", "event: change"] {
        assert!(told.contains(word), "{word} in {told}");
    }
    server.stop().await;
}

#[tokio::test]
async fn processes_are_their_owners_alone_and_a_gauge_station_reports_parts_only() {
    let server = Server::start_of(Registry::standard().unwrap(), with_keys).await;
    let (mine, other, station) = (As(&server, "a-one"), As(&server, "b"), As(&server, "station"));
    let put = async |caller: &As<'_>, path: &str, body: &Value| {
        caller.request(Method::PUT, path).json(body).send().await.unwrap()
    };
    assert_eq!(put(&mine, "/v1/processes/shaft-560", &declared()).await.status(), 201);
    assert_eq!(other.get("/v1/processes/shaft-560").await.status(), 404);
    assert_eq!(put(&other, "/v1/processes/shaft-560", &declared()).await.status(), 201, "a name of his own");
    let at = "/v1/processes/shaft-560/parts/p-1";
    assert_eq!(put(&station, at, &part(1)).await.status(), 201);
    problem(put(&station, "/v1/processes/shaft-560", &declared()).await, 403, "forbidden").await;
    problem(put(&station, "/v1/processes/other/parts/p-1", &part(1)).await, 403, "forbidden").await;
    problem(station.request(Method::DELETE, at).send().await.unwrap(), 403, "forbidden").await;
    assert_eq!(mine.get(at).await.status(), 200);
    assert_eq!(other.get(at).await.status(), 404);
    server.stop().await;
}

/// The shipped program over a folder, as a process that can be killed.
struct Killable {
    child: std::process::Child,
    address: std::net::SocketAddr,
}

impl Killable {
    fn start(folder: &std::path::Path) -> Self {
        let folder = folder.to_str().unwrap();
        let mut child = precut_command(&["serve", "--listen", "127.0.0.1:0", "--data", folder]).spawn().unwrap();
        let address = address_of(&mut child);
        Self { child, address }
    }

    fn kill(mut self) {
        // SIGKILL: nothing is told to it.
        self.child.kill().unwrap();
        self.child.wait().unwrap();
    }

    fn url(&self, path: &str) -> String {
        format!("http://{}{path}", self.address)
    }
}

#[tokio::test]
async fn killed_between_a_part_and_its_answer_it_has_lost_nothing() {
    let whole = server().await;
    with_parts(&whole, 42).await;
    let expected = got(&whole, "/v1/processes/shaft-560/state").await;
    whole.stop().await;
    let folder = tempfile::tempdir().unwrap();
    let client = reqwest::Client::new();
    let put = async |service: &Killable, path: &str, body: &Value| {
        let request = client.put(service.url(path)).header("content-type", "application/json");
        request.body(body.to_string()).send().await
    };
    let mut service = Killable::start(folder.path());
    assert_eq!(put(&service, "/v1/processes/shaft-560", &declared()).await.unwrap().status(), 201);
    let mut number = 1;
    for stop_at in [9, 21, 38, 43] {
        while number < stop_at {
            let said =
                put(&service, &format!("/v1/processes/shaft-560/parts/p-{number}"), &part(number)).await.unwrap();
            assert!([200, 201].contains(&said.status().as_u16()), "{number}");
            number += 1;
        }
        if stop_at == 43 {
            break;
        }
        // The next part is on its way when the process dies; whether it was taken nobody was told.
        let path = format!("/v1/processes/shaft-560/parts/p-{number}");
        let sent =
            client.put(service.url(&path)).header("content-type", "application/json").body(part(number).to_string());
        let on_its_way = tokio::spawn(sent.send());
        tokio::task::yield_now().await;
        service.kill();
        let _ = on_its_way.await;
        service = Killable::start(folder.path());
        let kept: Value =
            client.get(service.url("/v1/processes/shaft-560")).send().await.unwrap().json().await.unwrap();
        let taken = kept["sequence"].as_u64().unwrap() - 1;
        assert!(taken == number as u64 - 1 || taken == number as u64, "{taken} of {number}");
        assert_eq!(kept["state"]["parts"].as_u64().unwrap_or(0), taken);
    }
    let state = client.get(service.url("/v1/processes/shaft-560/state")).send().await.unwrap();
    assert_eq!(state.json::<Value>().await.unwrap(), expected);
    service.kill();
}

/// Changes what is on the disk of a service that stands.
async fn change_on_disk(folder: &Path, statements: &[&str]) {
    let options = SqliteConnectOptions::new().filename(folder.join("precut.db"));
    let mut connection = SqliteConnection::connect_with(&options).await.unwrap();
    for statement in statements {
        let changed = sqlx::query(sqlx::AssertSqlSafe(*statement)).execute(&mut connection).await.unwrap();
        assert!(changed.rows_affected() > 0, "{statement}");
    }
    connection.close().await.unwrap();
}

#[tokio::test]
async fn started_again_it_goes_on_from_its_last_parts() {
    let long = process_file("r10-nothing-300.json");
    let mut document = long.clone();
    document.as_object_mut().unwrap().remove("parts");
    let named = |number: usize| {
        let mut part = long["parts"][number - 1].clone();
        part["part"] = json!(format!("p-{number}"));
        part
    };
    let history: Vec<Value> = (1..=260).map(named).collect();
    let folder = tempfile::tempdir().unwrap();
    let client = reqwest::Client::new();
    let process = |service: &Killable, path: &str| service.url(&format!("/v1/processes/shaft-560{path}"));
    let state = async |service: &Killable| -> Value {
        client.get(process(service, "/state")).send().await.unwrap().json().await.unwrap()
    };
    let service = Killable::start(folder.path());
    assert_eq!(client.put(process(&service, "")).json(&document).send().await.unwrap().status(), 201);
    let sent = json!({ "parts": history });
    assert_eq!(client.post(process(&service, "/parts")).json(&sent).send().await.unwrap().status(), 200);
    let before = state(&service).await;
    service.kill();
    // What the first part was is not looked at again: it says nothing any more but in what was kept.
    let rows = "json_set(content, '$.measurements[0].diameter_deviation_um', 999.0)";
    change_on_disk(folder.path(), &[&format!("UPDATE process_entries SET content = {rows} WHERE part = 'p-1'")]).await;
    let service = Killable::start(folder.path());
    assert_eq!(state(&service).await, before);
    let mut next = named(261);
    next.as_object_mut().unwrap().remove("part");
    let taken = client.put(process(&service, "/parts/p-261")).json(&next).send().await.unwrap();
    assert_eq!(taken.status(), 201);
    let (after, first) = (state(&service).await, &history[0]["measurements"][0]["diameter_deviation_um"]);
    service.kill();
    // Where nothing that was kept can be read, all parts are looked at.
    let rows = format!("json_set(content, '$.measurements[0].diameter_deviation_um', {first})");
    let restored = format!("UPDATE process_entries SET content = {rows} WHERE part = 'p-1'");
    change_on_disk(folder.path(), &[&restored, "UPDATE process_snapshots SET content = '{}'"]).await;
    let service = Killable::start(folder.path());
    assert_eq!(state(&service).await, after);
    service.kill();
}

#[tokio::test]
async fn the_command_line_keeps_a_process_in_a_folder_and_asks_a_service() {
    let folder = tempfile::tempdir().unwrap();
    let data = folder.path().join("data");
    let write = |name: &str, value: &Value| {
        let path = folder.path().join(name);
        std::fs::write(&path, value.to_string()).unwrap();
        path.to_str().unwrap().to_owned()
    };
    let (process, first) = (write("shaft-560.json", &declared()), write("p-1.json", &part(1)));
    let run = |arguments: &[&str]| {
        let output = precut_command(&[&["process"], arguments].concat()).output().unwrap();
        (output.status.code(), String::from_utf8(output.stdout).unwrap(), String::from_utf8(output.stderr).unwrap())
    };
    let here = ["--data", data.to_str().unwrap()];
    let (code, made, complaint) = run(&[&["new", &process], &here[..]].concat());
    assert_eq!(code, Some(0), "{complaint}");
    assert_eq!(serde_json::from_str::<Value>(&made).unwrap()["name"], "shaft-560");
    let (code, said, complaint) = run(&[&["add", "shaft-560", &first], &here[..]].concat());
    assert_eq!(code, Some(0), "{complaint}");
    assert_eq!(serde_json::from_str::<Value>(&said).unwrap()["state"], "learning");
    let rows: String = part(2)["measurements"].as_array().unwrap().iter().map(csv_row).collect::<Vec<_>>().concat();
    let table = folder.path().join("p-2.csv");
    std::fs::write(&table, format!("z_mm,diameter_deviation_um\n{rows}")).unwrap();
    let conditions: Vec<String> = part(2)["conditions"]
        .as_object()
        .unwrap()
        .iter()
        .map(|(name, value)| format!("{name}={}", value.as_str().map_or_else(|| value.to_string(), ToOwned::to_owned)))
        .collect();
    let mut add = vec!["add", "shaft-560", table.to_str().unwrap(), "--number", "2"];
    for condition in &conditions {
        add.extend(["--condition", condition]);
    }
    add.extend(here);
    let (code, said, complaint) = run(&add);
    assert_eq!(code, Some(0), "{complaint}");
    assert_eq!(serde_json::from_str::<Value>(&said).unwrap()["parts"], 2);
    let (code, history, _) = run(&[&["history", "shaft-560"], &here[..]].concat());
    assert_eq!((code, history.lines().count()), (Some(0), 3));
    let (code, _, complaint) = run(&[&["state", "shaft-561"], &here[..]].concat());
    assert_eq!(code, Some(2));
    assert!(complaint.contains("unknown_process"), "{complaint}");
    // The same of a service that runs.
    let service = Killable::start(&data);
    let url = service.url("");
    let (code, state, complaint) = run(&["state", "shaft-560", "--url", &url]);
    assert_eq!(code, Some(0), "{complaint}");
    assert_eq!(serde_json::from_str::<Value>(&state).unwrap()["parts"], 2);
    let (code, program, complaint) = run(&["next", "shaft-560", "--format", "gcode", "--url", &url]);
    assert_eq!(code, Some(0), "{complaint}");
    assert!(program.contains("G1"), "{program}");
    service.kill();
}
