//! The contract: complete, stable, and usable without a network.

use std::path::Path;

use precut::http::openapi;
use precut::registry::Registry;
use serde_json::Value;

use crate::support::{Server, header, toy};

#[test]
fn the_committed_contract_is_the_one_that_the_service_gives() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("openapi/precut.json");
    let made = openapi::json(&Registry::standard().unwrap());
    let committed = std::fs::read_to_string(&path).unwrap_or_default();
    assert!(made == committed, "{} is stale: `cargo run -- openapi > openapi/precut.json`", path.display());
}

#[test]
fn the_contract_is_the_same_each_time_it_is_made() {
    let registry = toy::registry();
    assert_eq!(openapi::json(&registry), openapi::json(&registry));
}

/// Every object of a document, with its pointer.
fn walk<'v>(value: &'v Value, pointer: &str, visit: &mut dyn FnMut(&str, &'v Value)) {
    visit(pointer, value);
    match value {
        Value::Object(map) => {
            for (name, part) in map {
                let name = name.replace('~', "~0").replace('/', "~1");
                walk(part, &format!("{pointer}/{name}"), visit);
            }
        }
        Value::Array(items) => {
            for (index, part) in items.iter().enumerate() {
                walk(part, &format!("{pointer}/{index}"), visit);
            }
        }
        _ => {}
    }
}

#[test]
fn every_reference_of_the_contract_leads_somewhere() {
    let document = openapi::document(&toy::registry());
    let mut count = 0;
    walk(&document, "", &mut |at, value| {
        if let Some(target) = value.get("$ref").and_then(Value::as_str) {
            count += 1;
            let pointer = target.strip_prefix('#').unwrap();
            assert!(document.pointer(pointer).is_some(), "{at} refers to {target}");
        }
    });
    assert!(count > 50);
}

#[test]
fn every_operation_is_described_with_its_parameters_and_problems() {
    let document = openapi::document(&toy::registry());
    assert!(document["openapi"].as_str().unwrap().starts_with("3.1."));
    let mut ids = Vec::new();
    for (path, item) in document["paths"].as_object().unwrap() {
        for (method, operation) in item.as_object().unwrap() {
            let at = format!("{method} {path}");
            for part in ["summary", "description", "operationId"] {
                assert!(operation[part].as_str().is_some_and(|text| !text.is_empty()), "{part} of {at}");
            }
            ids.push(operation["operationId"].as_str().unwrap().to_owned());
            for parameter in operation["parameters"].as_array().into_iter().flatten() {
                assert!(parameter["description"].as_str().is_some_and(|text| text.len() > 10), "{parameter} of {at}");
            }
            let responses = operation["responses"].as_object().unwrap();
            assert!(
                (responses.contains_key("200") || responses.contains_key("204")) && responses.contains_key("500"),
                "{at}"
            );
            let needs_key = path.starts_with("/v1/") || path == "/metrics";
            assert_eq!(responses.contains_key("401"), needs_key, "{at}");
            assert_eq!(operation["security"] != serde_json::json!([]), needs_key, "{at}");
        }
    }
    let count = ids.len();
    ids.sort();
    ids.dedup();
    assert_eq!(ids.len(), count, "operation ids are unique");
}

#[test]
fn every_named_field_of_the_contract_is_described() {
    let document = openapi::document(&toy::registry());
    for (name, schema) in document["components"]["schemas"].as_object().unwrap() {
        walk(schema, "", &mut |at, value| {
            for (field, part) in value.get("properties").and_then(Value::as_object).into_iter().flatten() {
                let described = part.get("description").or(part.get("$ref"));
                // The multipart form and tagged unions describe themselves by what they refer to.
                let is_tag = field == "kind";
                let is_union = part.get("oneOf").is_some();
                assert!(described.is_some() || is_tag || is_union, "{name}{at}/properties/{field}: {part}");
            }
        });
    }
}

#[tokio::test]
async fn the_service_serves_its_contract_with_examples_that_run() {
    let server = Server::start().await;
    let response = server.get("/openapi.json").send().await.unwrap();
    let tag = header(&response, "etag").to_owned();
    let document: Value = response.json().await.unwrap();
    assert_eq!(document, openapi::document(&toy::registry()));
    assert_eq!(server.get("/openapi.json").header("if-none-match", tag).send().await.unwrap().status(), 304);
    let body = &document["paths"]["/v1/sagging-bar"]["post"]["requestBody"]["content"]["application/json"];
    for (name, example) in body["examples"].as_object().unwrap() {
        let response = server.post(example["value"].to_string()).send().await.unwrap();
        assert_eq!(response.status(), 200, "{name}");
    }
}

#[tokio::test]
async fn answers_are_what_the_contract_says() {
    let server = Server::start().await;
    let document = openapi::document(&toy::registry());
    let matches = |name: &str, answer: &Value| {
        let schema =
            serde_json::json!({"$ref": format!("#/components/schemas/{name}"), "components": document["components"]});
        let validator = jsonschema::validator_for(&schema).unwrap();
        let faults: Vec<_> =
            validator.iter_errors(answer).map(|fault| format!("{}: {fault}", fault.instance_path())).collect();
        assert!(faults.is_empty(), "{name}: {faults:#?}\n{answer:#}");
    };
    let answer: Value = server.post(toy::JOB).send().await.unwrap().json().await.unwrap();
    matches("SaggingBarAnswer", &answer);
    let study = serde_json::json!({
        "calculator": toy::BAR, "job": {"length_mm": 500, "load_n": 100},
        "vary": [{"pointer": "/load_n", "values": [1, 9000]}, {"pointer": "/behaviour", "values": ["quick", "infeasible"]}],
    });
    let answer: Value = server.post_to("/v1/studies", study.to_string()).send().await.unwrap().json().await.unwrap();
    matches("StudyAnswer", &answer);
    for (path, name) in [
        ("/", "Landing"),
        ("/v1/calculators", "CalculatorList"),
        ("/v1/calculators/sagging-bar", "CalculatorDescription"),
        ("/v1/results", "ResultList"),
        ("/v1/materials", "MaterialRecordList"),
        ("/v1/materials/steel_45", "MaterialRecord"),
        ("/health/live", "Health"),
        ("/health/ready", "Health"),
        ("/problems/invalid_job", "ProblemPage"),
    ] {
        let answer: Value = server.get(path).send().await.unwrap().json().await.unwrap();
        matches(name, &answer);
    }
    for body in ["{", "{}", "{\"length_mm\": 1, \"load_n\": 11, \"x\": 0}"] {
        matches("Problem", &server.post(body).send().await.unwrap().json().await.unwrap());
    }
}

#[tokio::test]
async fn the_interactive_documentation_needs_nothing_from_outside() {
    let server = Server::start().await;
    let page = server.get("/docs").send().await.unwrap();
    let policy = header(&page, "content-security-policy").to_owned();
    assert!(policy.contains("default-src 'self'") && policy.contains("style-src 'self' 'unsafe-inline'"), "{policy}");
    assert!(!policy.contains("http") && !policy.contains("script-src") && !policy.contains('*'), "{policy}");
    let html = page.text().await.unwrap();
    assert!(!html.contains("//"), "no address with a host: {html}");
    assert!(html.contains("load-fonts=\"false\""));
    let mut count = 0;
    for attribute in ["src=\"", "href=\"", "spec-url=\""] {
        for (start, _) in html.match_indices(attribute) {
            let rest = &html[start + attribute.len()..];
            let path = &rest[..rest.find('"').unwrap()];
            assert_eq!(server.get(path).send().await.unwrap().status(), 200, "{path}");
            count += 1;
        }
    }
    assert!(count >= 2);
    // Elsewhere not even styles may stand in the page.
    let other = server.get("/").header("accept", "text/html").send().await.unwrap();
    assert!(!header(&other, "content-security-policy").contains("unsafe"));
}
