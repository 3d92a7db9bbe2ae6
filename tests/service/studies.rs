//! Parameter studies over HTTP.

use std::time::{Duration, Instant};

use serde_json::{Value, json};
use sqlx::Connection as _;
use sqlx::sqlite::{SqliteConnectOptions, SqliteConnection};

use crate::support::{Process, Server, header, problem, toy};

const STUDIES: &str = "/v1/studies";

#[allow(clippy::needless_pass_by_value)] // it is handed over as it is written
fn study(vary: Value) -> Value {
    json!({"calculator": toy::BAR, "job": {"length_mm": 500.0, "load_n": 100.0}, "vary": vary})
}

/// So many points of so many milliseconds.
fn long(points: u32, each_ms: u32) -> Value {
    let mut study = study(json!([{"pointer": "/length_mm", "from": 100, "to": 100 + points, "count": points}]));
    study["job"]["duration_ms"] = json!(each_ms);
    study
}

#[tokio::test]
async fn a_small_study_is_answered_at_once_in_every_form() {
    let server = Server::start().await;
    let study = study(json!([
        {"pointer": "/length_mm", "values": [100, 200, 400]},
        {"pointer": "/load_n", "from": 10, "to": 1000, "count": 3, "spacing": "log"},
    ]));
    let post = || server.post_to(STUDIES, study.to_string());
    let response = post().send().await.unwrap();
    assert_eq!((response.status().as_u16(), header(&response, "precut-cache")), (200, "miss"));
    let place = header(&response, "content-location").to_owned();
    let tag = header(&response, "etag").to_owned();
    let answer: Value = response.json().await.unwrap();
    assert_eq!(place, format!("/v1/results/{}", answer["key"].as_str().unwrap()));
    let result = &answer["result"];
    assert_eq!((&result["points"], &result["failed"]), (&json!(9), &json!(0)));
    assert_eq!(result["outputs"][0]["pointer"], "/max_sag_um");

    // Each point is the ordinary job, there already.
    let row = &result["rows"][4];
    assert_eq!(row["values"], json!([200.0, 100.0]));
    let job = json!({"length_mm": 200, "load_n": 100}).to_string();
    let point = server.post(job).send().await.unwrap();
    assert_eq!(header(&point, "precut-cache"), "hit");
    let point: Value = point.json().await.unwrap();
    assert_eq!((&point["key"], &point["result"]["max_sag_um"]), (&row["key"], &row["outputs"][0]));

    let again = post().send().await.unwrap();
    assert_eq!(header(&again, "precut-cache"), "hit");
    assert_eq!(post().header("if-none-match", tag).send().await.unwrap().status(), 304);
    let csv = post().header("accept", "text/csv").send().await.unwrap().text().await.unwrap();
    assert_eq!(csv.lines().next(), Some("length [mm],load [N],status,code,detail,max_sag [um],key"));
    assert_eq!(csv.lines().count(), 10);
    let extremes = server.get(&format!("{place}?table=extremes")).header("accept", "text/csv").send().await.unwrap();
    assert!(extremes.text().await.unwrap().contains("/max_sag_um,um,"));
    for (figure, words) in
        [("", "Max sag over length and load"), ("?figure=map", "load"), ("?figure=curves", "Load = 10 N")]
    {
        let drawn = server.get(&format!("{place}{figure}")).header("accept", "image/svg+xml").send().await.unwrap();
        let drawn = drawn.text().await.unwrap();
        assert!(drawn.contains(words), "{figure}: {}", &drawn[..drawn.len().min(2000)]);
    }
    problem(server.get(&format!("{place}?table=x")).send().await.unwrap(), 404, "unknown_table").await;
    let gcode = server.get(&place).header("accept", "text/x-gcode").send().await.unwrap();
    problem(gcode, 406, "not_acceptable").await;
    let listed: Value = server.get("/v1/results?calculator=studies").send().await.unwrap().json().await.unwrap();
    assert_eq!(listed["items"][0]["key"], answer["key"]);
}

#[tokio::test]
async fn a_study_at_fault_says_everything_at_once() {
    let server = Server::start().await;
    let mut bad = study(json!([
        {"pointer": "/lenght_mm", "values": [1]},
        {"pointer": "/load_n", "from": 0, "to": 1, "count": 3, "spacing": "log"},
    ]));
    bad["outputs"] = json!(["/max_sag"]);
    let document = problem(server.post_to(STUDIES, bad.to_string()).send().await.unwrap(), 422, "invalid_job").await;
    let faults: Vec<_> = document["errors"]
        .as_array()
        .unwrap()
        .iter()
        .map(|one| (one["code"].as_str().unwrap(), one["pointer"].as_str().unwrap()))
        .collect();
    assert_eq!(
        faults,
        [("no_such_field", "/outputs/0"), ("no_such_field", "/vary/0/pointer"), ("log_not_positive", "/vary/1/from")]
    );
    assert!(document["errors"][1]["detail"].as_str().unwrap().contains("did you mean length_mm?"));
    let billion = study(json!([
        {"pointer": "/length_mm", "from": 1, "to": 2, "count": 1_000_000},
        {"pointer": "/load_n", "from": 1, "to": 2, "count": 1000},
    ]));
    let begun = Instant::now();
    let document =
        problem(server.post_to(STUDIES, billion.to_string()).send().await.unwrap(), 422, "invalid_job").await;
    let fault = &document["errors"][0];
    assert_eq!(
        (&fault["code"], &fault["value"], &fault["limit"]),
        (&json!("too_many_points"), &json!(1e9), &json!(1e5))
    );
    assert!(begun.elapsed() < Duration::from_secs(30), "nothing was made of it");
    let text = server.post_to(STUDIES, "{\"calculator\": 1").send().await.unwrap();
    problem(text, 400, "unexpected_end").await;
}

async fn job(server: &Server, address: &str) -> Value {
    server.get(address).send().await.unwrap().json().await.unwrap()
}

/// Waits until the job says what is wanted.
async fn until(server: &Server, address: &str, wanted: impl Fn(&Value) -> bool) -> Value {
    let begun = Instant::now();
    loop {
        let job = job(server, address).await;
        if wanted(&job) {
            return job;
        }
        assert!(begun.elapsed() < Duration::from_mins(1), "{job:#}");
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
}

#[tokio::test]
async fn a_long_study_is_one_job_with_one_progress_and_pictures_on_the_way() {
    let server = Server::start().await;
    // The last of its points.
    let held = toy::hold(160);
    let response = server.post_to(STUDIES, long(60, 40).to_string()).send().await.unwrap();
    assert_eq!(response.status(), 202);
    let address = header(&response, "location").to_owned();
    let mut stream = server.get(&format!("{address}/events")).send().await.unwrap();
    let running = until(&server, &address, |job| job["stage"].is_string()).await;
    assert!(running["stage"].as_str().unwrap().ends_with(" of 60"), "{running:#}");
    let mut events = String::new();
    while !events.contains("event: interim") {
        let chunk = tokio::time::timeout(Duration::from_mins(1), stream.chunk()).await.expect("it goes on");
        events.push_str(std::str::from_utf8(&chunk.unwrap().expect("it goes on")).unwrap());
    }
    // Its shards are jobs that nobody sees.
    let listed: Value = server.get("/v1/jobs").send().await.unwrap().json().await.unwrap();
    let listed: Vec<&Value> = listed["items"].as_array().unwrap().iter().map(|job| &job["id"]).collect();
    assert_eq!(listed, [&running["id"]]);
    drop(held);
    let done = until(&server, &address, |job| job["state"] == "succeeded").await;
    assert_eq!((&done["calculator"], &done["progress"]), (&json!("studies"), &json!(1.0)));
    let result: Value = server.get(&format!("{address}/result")).send().await.unwrap().json().await.unwrap();
    assert_eq!(result["result"]["succeeded"], 60);
    events.push_str(&stream.text().await.unwrap());
    assert!(events.contains("\"text\":\"Length\""), "{events}");
    assert!(events.contains("event: done"), "{events}");
    let listed: Value = server.get("/v1/jobs?calculator=studies").send().await.unwrap().json().await.unwrap();
    assert_eq!(listed["items"].as_array().unwrap().len(), 1);
}

#[tokio::test]
async fn a_cancelled_study_stops_and_keeps_what_its_points_gave() {
    let server = Server::start().await;
    let response = server.post_to(STUDIES, long(1000, 40).to_string()).send().await.unwrap();
    let address = header(&response, "location").to_owned();
    until(&server, &address, |job| job["progress"].as_f64().unwrap() > 0.004).await;
    let cancelled = server.client.delete(server.url(&address)).send().await.unwrap();
    assert_eq!(cancelled.status(), 202);
    assert_eq!(job(&server, &address).await["state"], "cancelled");
    let first = json!({"length_mm": 100, "load_n": 100, "duration_ms": 40}).to_string();
    let point = server.post(first).send().await.unwrap();
    assert_eq!(header(&point, "precut-cache"), "hit");
}

#[tokio::test]
async fn with_one_place_studies_end_and_none_holds_it_while_its_shards_are_computed() {
    let server = Server::start_with(|config| {
        config.jobs.slots = 1;
        // No place beside it.
        config.jobs.short_ms = 0.0;
    })
    .await;
    let mut addresses = Vec::new();
    for length_mm in [100, 200, 300] {
        let mut study = long(24, 40);
        study["vary"][0]["from"] = json!(length_mm);
        study["vary"][0]["to"] = json!(length_mm + 24);
        let response = server.post_to(STUDIES, study.to_string()).send().await.unwrap();
        assert_eq!(response.status(), 202);
        addresses.push(header(&response, "location").to_owned());
    }
    for address in &addresses {
        let done = until(&server, address, |job| job["finished_at"].is_string()).await;
        assert_eq!((&done["state"], &done["attempt"]), (&json!("succeeded"), &json!(1)), "{done:#}");
    }
    // A study that is cancelled gives the place to the next.
    let response = server.post_to(STUDIES, long(1000, 41).to_string()).send().await.unwrap();
    let address = header(&response, "location").to_owned();
    until(&server, &address, |job| job["progress"].as_f64().unwrap() > 0.0).await;
    assert_eq!(server.client.delete(server.url(&address)).send().await.unwrap().status(), 202);
    let next = server.post_to(STUDIES, long(24, 42).to_string()).header("prefer", "wait=30").send().await.unwrap();
    assert_eq!(next.status(), 200);
}

#[tokio::test]
async fn a_study_of_more_shards_than_are_in_line_at_a_time_has_all_its_rows() {
    let server = Server::start().await;
    let mut study = long(300, 0);
    // Each of them a shard of its own, by its estimate.
    study["job"]["work_ms"] = json!(500);
    let response = server.post_to(STUDIES, study.to_string()).header("prefer", "wait=60").send().await.unwrap();
    assert_eq!(response.status(), 200);
    assert_eq!(response.json::<Value>().await.unwrap()["result"]["succeeded"], 300);
    let metrics = server.get("/metrics").send().await.unwrap().text().await.unwrap();
    let computed = metrics.lines().find_map(|line| line.strip_prefix("precut_jobs_shards_total ")).unwrap();
    assert!(computed.parse::<f64>().unwrap() >= 300.0, "{computed}");
}

#[tokio::test]
async fn a_study_gives_the_same_bytes_on_one_core_and_on_many() {
    let mut bodies = Vec::new();
    for slots in [1, 4] {
        let server = Server::start_with(|config| config.jobs.slots = slots).await;
        // Three shards.
        let mut study = long(320, 3);
        // Where the load is too large for the length, a row without an answer.
        study["vary"][0]["from"] = json!(5);
        let response = server.post_to(STUDIES, study.to_string()).header("prefer", "wait=60").send().await.unwrap();
        assert_eq!(response.status(), 200);
        bodies.push(response.bytes().await.unwrap());
        server.stop().await;
    }
    assert_eq!(bodies[0], bodies[1]);
    let answer: Value = serde_json::from_slice(&bodies[0]).unwrap();
    assert!(answer["result"]["failed"].as_u64().unwrap() > 0);
}

#[cfg(unix)]
#[tokio::test]
async fn a_study_that_its_process_took_along_goes_on_where_it_stood() {
    let folder = tempfile::tempdir().unwrap();
    let client = reqwest::Client::new();
    let slots = ("PRECUT_JOBS_SLOTS", "1");
    // The last of its points.
    let mut process = Process::start_with(folder.path(), &[(toy::HELD_MM, "180"), slots]);
    let url = |process: &Process, path: &str| format!("http://{}{path}", process.address);
    let response = client
        .post(url(&process, STUDIES))
        .header("content-type", "application/json")
        .body(long(80, 50).to_string())
        .send()
        .await
        .unwrap();
    assert_eq!(response.status(), 202);
    let address = header(&response, "location").to_owned();
    let ask = async |process: &Process, path: &str| client.get(url(process, path)).send().await.unwrap();
    let begun = Instant::now();
    // What is said to be done is on record, in shards of 500 ms.
    while ask(&process, &address).await.json::<Value>().await.unwrap()["progress"].as_f64().unwrap() < 0.5 {
        assert!(begun.elapsed() < Duration::from_mins(1));
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
    process.signal("KILL");
    process.wait(Duration::from_mins(1));
    drop(process);
    // And the disk has changed one of them: it is computed again, from what its points gave.
    let database = SqliteConnectOptions::new().filename(folder.path().join("precut.db"));
    let mut database = SqliteConnection::connect_with(&database).await.unwrap();
    let damage = "UPDATE jobs SET content = substr(content, 1, length(content) - 1) WHERE shard = 0";
    assert_eq!(sqlx::query(damage).execute(&mut database).await.unwrap().rows_affected(), 1);
    database.close().await.unwrap();

    let process = Process::start_with(folder.path(), &[slots]);
    let begun = Instant::now();
    let done = loop {
        let job: Value = ask(&process, &address).await.json().await.unwrap();
        if job["finished_at"].is_string() {
            break job;
        }
        assert!(begun.elapsed() < Duration::from_mins(1), "{job:#}");
        tokio::time::sleep(Duration::from_millis(20)).await;
    };
    assert_eq!((&done["state"], &done["attempt"]), (&json!("succeeded"), &json!(2)));
    let metrics = ask(&process, "/metrics").await.text().await.unwrap();
    let line = metrics.lines().find(|line| {
        line.starts_with("precut_calculations_total") && line.contains(toy::BAR) && line.contains("\"ok\"")
    });
    let computed: u32 = line.and_then(|line| line.rsplit(' ').next()?.parse().ok()).unwrap();
    assert!((1..=40).contains(&computed), "{computed} of 80 points: none of those that were done before");
    let result: Value = ask(&process, &format!("{address}/result")).await.json().await.unwrap();
    assert_eq!(result["result"]["succeeded"], 80);
    // Equal to the same study that nothing interrupted.
    let whole = Server::start().await;
    let other = whole.post_to(STUDIES, long(80, 50).to_string()).header("prefer", "wait=60").send().await.unwrap();
    assert_eq!(other.json::<Value>().await.unwrap(), result);
}
