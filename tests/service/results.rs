//! Kept results.

use std::time::{Duration, Instant};

use precut::registry::Registry;
use serde_json::Value;

use crate::support::{Server, header, problem, toy};

async fn fill(server: &Server, count: u32) -> Vec<String> {
    let mut keys = Vec::new();
    for length in 0..count {
        let job = format!("{{\"length_mm\": {}, \"load_n\": 1}}", 100 + length);
        let response = server.post(job).send().await.unwrap();
        keys.push(header(&response, "content-location").rsplit('/').next().unwrap().to_owned());
    }
    keys
}

/// Results reach the database behind the answer.
async fn listed(server: &Server, path: &str, count: usize) -> Value {
    let begun = Instant::now();
    loop {
        let list: Value = server.get(path).send().await.unwrap().json().await.unwrap();
        if list["items"].as_array().is_some_and(|items| items.len() >= count) {
            return list;
        }
        assert!(begun.elapsed() < Duration::from_mins(1), "{list:#}");
        tokio::time::sleep(Duration::from_millis(20)).await;
    }
}

#[tokio::test]
async fn results_are_listed_by_pages_without_gap_or_repetition() {
    let server = Server::start().await;
    let mut keys = fill(&server, 7).await;
    let all = listed(&server, "/v1/results", 7).await;
    assert_eq!(all["items"].as_array().unwrap().len(), 7);
    assert_eq!(all["next"], Value::Null);
    let item = &all["items"][0];
    assert_eq!(item["calculator"], toy::BAR);
    assert_eq!(item["version"], 1);
    assert!(item["bytes"].as_u64().unwrap() > 100);
    assert!(item["created_at"].as_str().unwrap().ends_with('Z'), "{item}");

    let mut seen = Vec::new();
    let mut path = "/v1/results?limit=3&calculator=sagging-bar".to_owned();
    loop {
        let page: Value = server.get(&path).send().await.unwrap().json().await.unwrap();
        seen.extend(page["items"].as_array().unwrap().iter().map(|item| item["key"].as_str().unwrap().to_owned()));
        match page["next"].as_str() {
            Some(next) => path = next.to_owned(),
            None => break,
        }
    }
    let times: Vec<_> = all["items"].as_array().unwrap().iter().map(|item| item["created_at"].to_string()).collect();
    assert!(times.is_sorted_by(|a, b| a >= b), "newest first: {times:?}");
    seen.sort();
    keys.sort();
    assert_eq!(seen, keys);
}

/// What was computed stands in the lists, in the reader's language, and costs no answer its place.
#[tokio::test]
async fn results_and_jobs_are_told_apart_in_lists() {
    let server = Server::start_of(precut::registry::Registry::standard().unwrap(), |_| {}).await;
    let entry = precut::registry::Registry::standard().unwrap();
    let mut job: Value =
        serde_json::from_str(entry.entry("deflection-compensation").unwrap().meta().examples[0].job).unwrap();
    let ask = |job: &Value| server.post_to("/v1/deflection-compensation", job.to_string());
    assert_eq!(ask(&job).send().await.unwrap().status(), 200);
    listed(&server, "/v1/results", 1).await;
    job["cut"]["feed_mm_per_rev"] = 0.25.into();
    assert_eq!(ask(&job).header("prefer", "respond-async").send().await.unwrap().status(), 202);
    let all = listed(&server, "/v1/results", 2).await;
    assert_eq!(all["items"].as_array().unwrap().len(), 2);
    for (language, first, second) in [
        ("en", "Diameter 90 mm · length 2000 mm · feed 0.25 mm/rev · ", "feed 0.5 mm/rev"),
        ("ru", "Диаметр 90 мм · длина 2000 мм · подача 0,25 мм/об · ", "подача 0,5 мм/об"),
    ] {
        for (path, count) in [("/v1/results", 2), ("/v1/jobs", 1)] {
            // Twice: read, then remembered.
            for _ in 0..2 {
                let response = server.get(path).header("accept-language", language).send().await.unwrap();
                assert_eq!(header(&response, "content-language"), language);
                let list: Value = response.json().await.unwrap();
                let items = list["items"].as_array().unwrap();
                assert_eq!(items.len(), count, "{path}");
                assert!(items[0]["summary"].as_str().unwrap().starts_with(first), "{path}: {}", items[0]);
                assert!(count == 1 || items[1]["summary"].as_str().unwrap().contains(second), "{}", items[1]);
            }
        }
    }
    // A job that is too large to be read for a list has its line all the same.
    let server = Server::start().await;
    let mut noise = 1_u32;
    let rows: Vec<Value> = (0..10_000)
        .map(|_| {
            noise = noise.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
            serde_json::json!({"z_mm": f64::from(noise % 1_000_000) / 1e3, "sag_um": f64::from(noise >> 9) / 1e3})
        })
        .collect();
    let job = serde_json::json!({"length_mm": 321, "load_n": 5, "measurements": rows});
    assert_eq!(server.post(job.to_string()).send().await.unwrap().status(), 200);
    assert_eq!(server.post(toy::JOB).send().await.unwrap().status(), 200);
    let all = listed(&server, "/v1/results", 2).await;
    // Written in one group they have one time.
    let mut told: Vec<_> = all["items"].as_array().unwrap().iter().map(|item| item["summary"].as_str()).collect();
    told.sort_unstable();
    assert_eq!(told, [None, Some("Length 500 mm · quick")]);
}

#[tokio::test]
async fn a_result_is_read_in_every_form_without_computing() {
    let server = Server::start().await;
    let job = r#"{"length_mm": 321, "load_n": 5, "behaviour": "slow"}"#;
    let posted = server.post(job).send().await.unwrap();
    let location = header(&posted, "content-location").to_owned();
    let body = posted.bytes().await.unwrap();
    let response = server.get(&location).send().await.unwrap();
    assert_eq!(response.status(), 200);
    assert_eq!(header(&response, "precut-cache"), "hit");
    assert_eq!(response.bytes().await.unwrap(), body);
    for (accept, query, begins) in
        [("text/csv", "?table=summary", "max_sag [um]\n"), ("image/svg+xml", "", "<svg"), ("text/x-gcode", "", "")]
    {
        let response = server.get(&format!("{location}{query}")).header("accept", accept).send().await.unwrap();
        assert_eq!(response.status(), 200, "{accept}");
        assert_eq!(header(&response, "precut-cache"), "hit", "{accept}");
        assert!(response.text().await.unwrap().starts_with(begins), "{accept}");
    }
    problem(server.get(&format!("{location}?table=none")).send().await.unwrap(), 404, "unknown_table").await;
    let response = server.get(&location).header("accept", "text/html").send().await.unwrap();
    problem(response, 406, "not_acceptable").await;
}

#[tokio::test]
async fn equal_jobs_at_the_same_time_share_one_computation() {
    let server = Server::start().await;
    let job = r#"{"length_mm": 322, "load_n": 5, "behaviour": "slow"}"#;
    let asked: Vec<_> = (0..8).map(|_| tokio::spawn(server.post(job).send())).collect();
    let mut bodies = Vec::new();
    for answer in asked {
        let response = answer.await.unwrap().unwrap();
        assert_eq!(response.status(), 200);
        bodies.push(response.bytes().await.unwrap());
    }
    assert!(bodies.windows(2).all(|pair| pair[0] == pair[1]));
    assert_eq!(toy::runs(322), 1);
}

#[tokio::test]
async fn a_place_in_the_list_is_written_in_one_way_only() {
    let server = Server::start().await;
    for length in [323, 324] {
        server.post(format!(r#"{{"length_mm": {length}, "load_n": 5}}"#)).send().await.unwrap();
    }
    let page = loop {
        // Results reach the list behind their answers.
        let page: Value = server.get("/v1/results?limit=1").send().await.unwrap().json().await.unwrap();
        if page["next"].is_string() {
            break page;
        }
        tokio::time::sleep(Duration::from_millis(10)).await;
    };
    let next = page["next"].as_str().unwrap();
    assert_eq!(server.get(next).send().await.unwrap().status(), 200);
    let (before, cursor) = next.split_once("after=").unwrap();
    let (time, key) = cursor.split_once('-').unwrap();
    for other in [
        format!("%2B{cursor}"),
        format!("0{cursor}"),
        format!("-{cursor}"),
        format!("{time}-b3:{key}"),
        format!("{time}-{}", "A".repeat(64)),
        format!("{time}.{key}"),
        format!("{cursor}%20"),
    ] {
        problem(server.get(&format!("{before}after={other}")).send().await.unwrap(), 400, "bad_query").await;
    }
    let id = "0198c5f1-8a3e-7c40-b0a1-5e2d9f4c6b7a";
    for other in [id.to_uppercase(), id.replace('-', ""), format!("%7B{id}%7D"), format!("urn:uuid:{id}")] {
        problem(server.get(&format!("/v1/jobs?after={other}")).send().await.unwrap(), 400, "bad_query").await;
        problem(server.get(&format!("/v1/jobs/{other}")).send().await.unwrap(), 404, "unknown_job").await;
    }
}

#[tokio::test]
async fn a_result_is_read_in_parts_with_words() {
    let server = Server::start().await;
    let key = fill(&server, 1).await.remove(0);
    let read = async |part: &str| -> Value {
        let response = server.get(&format!("/v1/results/{key}/{part}")).send().await.unwrap();
        assert_eq!(response.status(), 200, "{part}");
        assert!(header(&response, "cache-control").contains("private"));
        response.json().await.unwrap()
    };
    let figures = read("figures").await;
    let figure = &figures["items"][0];
    assert_eq!(figure["id"], "sag");
    let texts = [&figure["title"]["text"], &figure["x"]["text"], &figure["panels"][0]["items"][0]["text"]];
    assert!(
        texts.iter().all(|text| text.as_str().is_some_and(|text| !text.is_empty() && !text.contains('_'))),
        "{figure}"
    );

    let tables = read("tables").await;
    let columns = tables["items"][0]["columns"].as_array().unwrap();
    assert!(
        columns
            .iter()
            .all(|column| column["text"].as_str().is_some() && !column["cells"].as_array().unwrap().is_empty())
    );

    // The job of a result gives that result again.
    let file = read("job").await;
    assert_eq!(file["calculator"], toy::BAR);
    let again = server.post(file["job"].to_string()).send().await.unwrap();
    assert_eq!(header(&again, "precut-cache"), "hit");
    assert!(header(&again, "content-location").ends_with(&key));

    let zeros = "0".repeat(64);
    for part in ["figures", "tables", "job"] {
        let absent = server.get(&format!("/v1/results/b3:{zeros}/{part}")).send().await.unwrap();
        problem(absent, 404, "unknown_result").await;
        problem(server.get(&format!("/v1/results/none/{part}")).send().await.unwrap(), 400, "bad_key").await;
    }
}

/// What a click in a picture stands for is a job that may be sent, and it is the one of that place.
#[tokio::test]
async fn another_place_of_a_picture_is_a_job() {
    let server = Server::start_of(Registry::standard().unwrap(), |_| {}).await;
    let about: Value = server.get("/v1/calculators/fixture-stability").send().await.unwrap().json().await.unwrap();
    let solve =
        |job: &Value| server.post_to("/v1/fixture-stability", job.to_string()).header("prefer", "wait=60").send();
    let answer: Value = solve(&about["jobs"]["lobes"]).await.unwrap().json().await.unwrap();
    let path = format!("/v1/results/{}", answer["key"].as_str().unwrap());
    let own: Value = server.get(&format!("{path}/job")).send().await.unwrap().json().await.unwrap();
    let place = "figure=lobes&setting=working_point&x=1500&y=1.25";
    let moved: Value = server.get(&format!("{path}/job_at?{place}")).send().await.unwrap().json().await.unwrap();
    let mut expected = own.clone();
    expected["job"]["cut"]["spindle_speed_rpm"] = 1500.0.into();
    expected["job"]["cut"]["depth_mm"] = 1.25.into();
    assert_eq!(moved, expected);
    assert_eq!(solve(&moved["job"]).await.unwrap().status(), 200);
    // A place is all four, and what is missing is named.
    for missing in ["figure", "setting", "x", "y"] {
        let rest: Vec<&str> = place.split('&').filter(|part| !part.starts_with(&format!("{missing}="))).collect();
        let response = server.get(&format!("{path}/job_at?{}", rest.join("&"))).send().await.unwrap();
        assert_eq!(response.status(), 400);
        let problem: Value = response.json().await.unwrap();
        assert_eq!(problem["detail"], format!("the parameter {missing} is missing"));
    }
}
