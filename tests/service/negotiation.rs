//! Forms of an answer: which one is sent, how it is tagged, what is sent again.

use reqwest::multipart::{Form, Part};
use serde_json::Value;

use crate::support::{Server, header, problem, toy};

#[tokio::test]
async fn an_answer_has_every_form_that_it_promises() {
    let server = Server::start().await;
    for (accept, path, kind, begins) in [
        (None, "/v1/sagging-bar", "application/json", "{\"calculator\":\"sagging-bar\""),
        (Some("*/*"), "/v1/sagging-bar", "application/json", "{"),
        (Some("text/csv"), "/v1/sagging-bar", "text/csv; charset=utf-8; header=present", "z [mm],sag [um]\n"),
        (
            Some("text/csv"),
            "/v1/sagging-bar?table=summary",
            "text/csv; charset=utf-8; header=present",
            "max_sag [um]\n",
        ),
        (Some("image/svg+xml"), "/v1/sagging-bar", "image/svg+xml", "<svg"),
        (Some("image/svg+xml"), "/v1/sagging-bar?figure=load", "image/svg+xml", "<svg"),
        (Some("text/x-gcode"), "/v1/sagging-bar", "text/x-gcode; charset=utf-8", ""),
        (
            Some("text/csv;q=0.2, application/json;q=0.1"),
            "/v1/sagging-bar",
            "text/csv; charset=utf-8; header=present",
            "z [mm]",
        ),
        (Some("text/html, */*;q=0.5"), "/v1/sagging-bar", "application/json", "{"),
    ] {
        let mut request = server.post_to(path, toy::JOB);
        if let Some(accept) = accept {
            request = request.header("accept", accept);
        }
        let response = request.send().await.unwrap();
        assert_eq!(response.status(), 200, "{accept:?} {path}");
        assert_eq!(header(&response, "content-type"), kind, "{accept:?} {path}");
        assert_eq!(header(&response, "content-language"), "en");
        assert_eq!(header(&response, "vary"), "Accept, Accept-Language, Accept-Encoding");
        let text = response.text().await.unwrap();
        assert!(text.starts_with(begins), "{accept:?} {path}: {text}");
        assert!(text.len() > 20, "{accept:?} {path}: {text}");
    }
}

#[tokio::test]
async fn a_program_names_its_result() {
    let server = Server::start().await;
    let response = server.post(toy::JOB).header("accept", "text/x-gcode").send().await.unwrap();
    let key = header(&response, "content-location").rsplit('/').next().unwrap().to_owned();
    let text = response.text().await.unwrap();
    assert!(text.to_lowercase().contains(&key[3..]), "{key} in {text}");
    assert!(text.contains("M30") || text.contains("M2"), "{text}");
}

#[tokio::test]
async fn what_does_not_exist_is_not_acceptable_and_the_problem_lists_what_does() {
    let server = Server::start().await;
    for accept in ["text/html", "application/xml", "application/json;q=0", "image/png, text/plain"] {
        let response = server.post(toy::JOB).header("accept", accept).send().await.unwrap();
        let document = problem(response, 406, "not_acceptable").await;
        let detail = document["detail"].as_str().unwrap();
        for kind in
            ["application/json", "text/csv", "image/svg+xml", "text/x-gcode", "spreadsheetml.sheet", "application/pdf"]
        {
            assert!(detail.contains(kind), "{kind} in {detail}");
        }
    }
}

#[tokio::test]
async fn only_the_program_of_an_incomplete_path_is_refused() {
    let server = Server::start().await;
    let job = r#"{"length_mm": 500, "load_n": 1, "behaviour": "incomplete"}"#;
    assert_eq!(server.post(job).send().await.unwrap().status(), 200);
    let response = server.post(job).header("accept", "text/x-gcode").send().await.unwrap();
    problem(response, 422, "path_incomplete").await;
}

#[tokio::test]
async fn the_same_job_is_computed_once_however_it_is_spelled() {
    let server = Server::start().await;
    let first = server.post(toy::JOB).send().await.unwrap();
    assert_eq!(header(&first, "precut-cache"), "miss");
    assert!(header(&first, "server-timing").contains("run;dur="), "{:?}", first.headers());
    let location = header(&first, "content-location").to_owned();
    let first = first.bytes().await.unwrap();
    for spelling in [
        toy::JOB,
        r#"{"load_n":1e2,"length_mm":5.00e2}"#,
        r#"  {"length_mm": 500, "load_n": 100, "stations": 10, "behaviour": "quick"}  "#,
    ] {
        let again = server.post(spelling).send().await.unwrap();
        assert_eq!(header(&again, "precut-cache"), "hit", "{spelling}");
        assert_eq!(header(&again, "content-location"), location);
        assert!(header(&again, "server-timing").starts_with("parse;dur="));
        assert_eq!(again.bytes().await.unwrap(), first, "equal jobs give equal bytes");
    }
    let envelope: Value = serde_json::from_slice(&first).unwrap();
    assert_eq!(location, format!("/v1/results/{}", envelope["key"].as_str().unwrap()));
    assert_eq!(envelope["input"]["stations"], 10, "defaults are filled in");
    let other = server.post(r#"{"length_mm": 501, "load_n": 100}"#).send().await.unwrap();
    assert_eq!(header(&other, "precut-cache"), "miss");
    assert_ne!(header(&other, "content-location"), location);
}

#[tokio::test]
async fn a_table_gives_the_same_key_however_it_comes() {
    let server = Server::start().await;
    let rows =
        r#"{"length_mm": 500, "load_n": 1, "measurements": [{"z_mm": 10, "sag_um": 1.5}, {"z_mm": 20, "sag_um": 2}]}"#;
    let text = r#"{"length_mm": 500, "load_n": 1, "measurements": {"csv": "z [mm];sag [um]\n10;1,5\n20;2\n"}}"#;
    let first = server.post(rows).send().await.unwrap();
    assert_eq!(first.status(), 200, "{}", first.text().await.unwrap());
    let location = header(&first, "content-location").to_owned();
    let second = server.post(text).send().await.unwrap();
    assert_eq!(second.status(), 200, "{}", second.text().await.unwrap());
    assert_eq!(header(&second, "content-location"), location);
    let form = Form::new()
        .part("job", Part::text(r#"{"length_mm": 500, "load_n": 1}"#))
        .part("measurements", Part::text("z_mm,sag [mm]\n10,0.0015\n20,0.002\n").file_name("readings.csv"));
    let third = server.client.post(server.url("/v1/sagging-bar")).multipart(form).send().await.unwrap();
    assert_eq!(third.status(), 200, "{}", third.text().await.unwrap());
    assert_eq!(header(&third, "content-location"), location);
    assert_eq!(header(&third, "precut-cache"), "hit");
}

#[tokio::test]
async fn every_form_has_a_tag_of_its_own_and_is_not_sent_twice() {
    let server = Server::start().await;
    let location = header(&server.post(toy::JOB).send().await.unwrap(), "content-location").to_owned();
    let mut tags = Vec::new();
    for (accept, query) in [
        ("application/json", ""),
        ("text/csv", ""),
        ("text/csv", "?table=summary"),
        ("image/svg+xml", ""),
        ("image/svg+xml", "?figure=load"),
        ("text/x-gcode", ""),
    ] {
        let post = |tag: Option<&str>| {
            let request = server.post_to(&format!("/v1/sagging-bar{query}"), toy::JOB).header("accept", accept);
            tag.map_or(request.try_clone().unwrap(), |tag| request.header("if-none-match", tag)).send()
        };
        let get = |tag: Option<&str>| {
            let request = server.get(&format!("{location}{query}")).header("accept", accept);
            tag.map_or(request.try_clone().unwrap(), |tag| request.header("if-none-match", tag)).send()
        };
        let response = post(None).await.unwrap();
        let tag = header(&response, "etag").to_owned();
        assert!(tag.starts_with('"') && tag.ends_with('"'), "{tag}");
        assert_eq!(header(&get(None).await.unwrap(), "etag"), tag, "GET and POST tag alike");
        for known in [tag.as_str(), "*", &format!("\"other\", W/{tag}")] {
            for response in [post(Some(known)).await.unwrap(), get(Some(known)).await.unwrap()] {
                assert_eq!(response.status(), 304, "{known}");
                assert_eq!(header(&response, "etag"), tag);
                assert!(header(&response, "vary").contains("Accept"));
                assert_eq!(response.text().await.unwrap(), "");
            }
        }
        assert_eq!(post(Some("\"other\"")).await.unwrap().status(), 200);
        tags.push(tag);
    }
    tags.sort();
    tags.dedup();
    assert_eq!(tags.len(), 6, "{tags:?}");
}

#[tokio::test]
async fn only_preferences_that_were_followed_are_said_to_be_applied() {
    let server = Server::start().await;
    for (preferences, applied) in [
        ("handling=lenient", ""),
        ("respond-async, wait=5", "wait=5"),
        // What is there already needs no waiting.
        ("respond-async, wait=5", ""),
        ("respond-async", ""),
    ] {
        let job = if applied.is_empty() { toy::JOB } else { r#"{"length_mm": 501, "load_n": 1}"# };
        let response = server.post(job).header("prefer", preferences).send().await.unwrap();
        assert_eq!(response.status(), 200);
        assert_eq!(header(&response, "preference-applied"), applied, "{preferences}");
    }
}

#[tokio::test]
async fn a_language_that_is_not_spoken_is_answered_in_english() {
    let server = Server::start().await;
    let response = server.post("{").header("accept-language", "fi, sv;q=0.5").send().await.unwrap();
    assert_eq!(header(&response, "content-language"), "en");
}

#[tokio::test]
async fn bodies_are_compressed_for_those_who_want_it() {
    let server = Server::start().await;
    let job = r#"{"length_mm": 500, "load_n": 1, "stations": 2000}"#;
    let plain = server.post(job).send().await.unwrap().bytes().await.unwrap();
    // The bare client says what it takes and does not unpack by itself.
    let bare = reqwest::Client::builder().no_gzip().no_brotli().build().unwrap();
    let ask = |encoding: &'static str| {
        bare.post(server.url("/v1/sagging-bar"))
            .header("content-type", "application/json")
            .header("accept-encoding", encoding)
            .body(job)
            .send()
    };
    for (asked, got) in [("gzip", "gzip"), ("br", "br"), ("gzip;q=0.5, br", "br"), ("identity", ""), ("gzip;q=0", "")] {
        let response = ask(asked).await.unwrap();
        assert_eq!(response.status(), 200);
        assert_eq!(header(&response, "content-encoding"), got, "{asked}");
        let tag = header(&response, "etag").to_owned();
        assert_eq!(tag.starts_with("W/"), !got.is_empty(), "other bytes have no strong tag: {tag}");
        let bytes = response.bytes().await.unwrap();
        if got.is_empty() {
            assert_eq!(bytes, plain);
        } else {
            assert!(bytes.len() < plain.len() / 2, "{} of {}", bytes.len(), plain.len());
        }
    }
    let unpacking = reqwest::Client::builder().gzip(true).build().unwrap();
    let response = unpacking.post(server.url("/v1/sagging-bar")).header("content-type", "application/json").body(job);
    assert_eq!(response.send().await.unwrap().bytes().await.unwrap(), plain);
}
