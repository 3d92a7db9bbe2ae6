//! Who may see what: keys with owners and scopes.

use precut::config::{ApiKey, Config, Scope};
use precut::http::auth;
use reqwest::{Method, RequestBuilder, Response};
use serde_json::Value;

use crate::support::{Server, header, problem, toy};

/// Keys by name, owner and scopes.
const KEYS: [(&str, &str, &[Scope]); 5] = [
    ("a-one", "alpha", &[Scope::Solve, Scope::Read, Scope::Models]),
    ("a-two", "alpha", &[Scope::Solve, Scope::Read, Scope::Models]),
    ("b", "beta", &[Scope::Solve, Scope::Read, Scope::Models]),
    ("reader", "alpha", &[Scope::Read]),
    ("root", "root", &[Scope::Admin]),
];

fn secret(name: &str) -> String {
    format!("the secret key of {name}")
}

fn with_keys(config: &mut Config) {
    let key = |(name, owner, scopes): (&str, &str, &[Scope])| ApiKey {
        name: name.to_owned(),
        hash: auth::hash(&secret(name)).to_string(),
        owner: Some(owner.to_owned()),
        scopes: scopes.to_vec(),
    };
    config.auth.keys = KEYS.map(key).to_vec();
}

struct As<'a>(&'a Server, &'static str);

impl As<'_> {
    fn request(&self, method: Method, path: &str) -> RequestBuilder {
        let request = self.0.client.request(method, self.0.url(path));
        request.header("authorization", format!("Bearer {}", secret(self.1)))
    }
    async fn get(&self, path: &str) -> Response {
        self.request(Method::GET, path).send().await.unwrap()
    }
    async fn json(&self, path: &str) -> Value {
        let response = self.get(path).await;
        assert_eq!(response.status(), 200, "{path} as {}", self.1);
        response.json().await.unwrap()
    }
    fn post(&self, job: &str) -> RequestBuilder {
        let path = format!("/v1/{}", toy::BAR);
        self.request(Method::POST, &path).header("content-type", "application/json").body(job.to_owned())
    }
    async fn names(&self, path: &str, field: &str) -> Vec<String> {
        let list = self.json(path).await;
        list["items"].as_array().unwrap().iter().map(|item| item[field].as_str().unwrap().to_owned()).collect()
    }
}

#[tokio::test]
async fn jobs_are_their_owners_alone() {
    let server = Server::start_with(with_keys).await;
    let (mine, same, other, root) = (As(&server, "a-one"), As(&server, "a-two"), As(&server, "b"), As(&server, "root"));
    let held = toy::hold(711);
    let job = r#"{"length_mm": 711, "load_n": 1, "duration_ms": 900}"#;
    let accepted = mine.post(job).header("prefer", "respond-async").send().await.unwrap();
    assert_eq!(accepted.status(), 202);
    let address = header(&accepted, "location").to_owned();
    let id = address.rsplit('/').next().unwrap().to_owned();
    // Listed, read, followed, cancelled: to another it is not there. Nor is what it asks.
    assert_eq!(other.names("/v1/jobs", "id").await, Vec::<String>::new());
    for part in ["", "/result", "/job", "/events"] {
        problem(other.get(&format!("{address}{part}")).await, 404, "unknown_job").await;
    }
    problem(other.request(Method::DELETE, &address).send().await.unwrap(), 404, "unknown_job").await;
    assert!(matches!(mine.json(&address).await["state"].as_str(), Some("queued" | "running")));
    // Another key of the same owner sees it, and so does who looks after the service.
    for caller in [&mine, &same, &root] {
        assert_eq!(caller.names("/v1/jobs", "id").await, [id.as_str()]);
        assert_eq!(caller.json(&address).await["id"], id.as_str());
    }
    // The same job of another owner is a job of his own, computed with it.
    let beside = other.post(job).header("prefer", "respond-async").send().await.unwrap();
    assert_ne!(header(&beside, "location"), address);
    assert_eq!(other.names("/v1/jobs", "id").await.len(), 1);
    assert_eq!(
        same.request(Method::DELETE, &address).send().await.unwrap().json::<Value>().await.unwrap()["state"],
        "cancelled"
    );
    drop(held);
    let result = format!("{}/result", header(&beside, "location"));
    let waited = other.post(job).header("prefer", "wait=60").send().await.unwrap();
    assert_eq!((waited.status().as_u16(), other.get(&result).await.status().as_u16()), (200, 200));
    server.stop().await;
}

#[tokio::test]
async fn results_are_shared_by_content_and_shown_to_who_asked() {
    let server = Server::start_with(with_keys).await;
    let (mine, same, other, root) = (As(&server, "a-one"), As(&server, "a-two"), As(&server, "b"), As(&server, "root"));
    let answer = mine.post(toy::JOB).send().await.unwrap();
    assert_eq!(header(&answer, "precut-cache"), "miss");
    let address = header(&answer, "content-location").to_owned();
    for part in ["", "/figures", "/tables", "/job"] {
        problem(other.get(&format!("{address}{part}")).await, 404, "unknown_result").await;
        for caller in [&mine, &same, &root] {
            assert_eq!(caller.get(&format!("{address}{part}")).await.status(), 200, "{part} as {}", caller.1);
        }
    }
    assert_eq!(other.names("/v1/results", "key").await, Vec::<String>::new());
    assert_eq!((mine.names("/v1/results", "key").await.len(), root.names("/v1/results", "key").await.len()), (1, 1));
    // Who asks the same has it from then on: it is computed once.
    let again = other.post(toy::JOB).send().await.unwrap();
    assert_eq!((header(&again, "precut-cache"), header(&again, "content-location")), ("hit", address.as_str()));
    assert_eq!(other.get(&address).await.status(), 200);
    assert_eq!(other.names(&format!("/v1/results?calculator={}", toy::BAR), "key").await.len(), 1);
    server.stop().await;
}

#[tokio::test]
async fn models_are_their_owners_alone() {
    let registry = precut::registry::Registry::standard().unwrap();
    let server = Server::start_of(registry, with_keys).await;
    let (mine, same, other) = (As(&server, "a-one"), As(&server, "a-two"), As(&server, "b"));
    let model = |size: f64| {
        serde_json::json!({
            "calculator": "deflection-compensation", "provenance": {},
            "effects": [{"kind": "tool_wear", "rate_um_per_km": size}],
        })
    };
    let put = async |caller: &As<'_>, size: f64| {
        let request = caller.request(Method::PUT, "/v1/models/lathe").json(&model(size));
        let response = request.send().await.unwrap();
        (response.status().as_u16(), response.json::<Value>().await.unwrap())
    };
    let (status, kept) = put(&mine, 1.0).await;
    assert_eq!((status, &kept["revision"], &kept["name"]), (201, &1.into(), &"lathe".into()), "{kept:#}");
    problem(other.get("/v1/models/lathe").await, 404, "unknown_model").await;
    problem(other.request(Method::DELETE, "/v1/models/lathe").send().await.unwrap(), 404, "unknown_model").await;
    assert_eq!(other.names("/v1/models", "name").await, Vec::<String>::new());
    // The name is another's own, too: nothing is overwritten.
    assert_eq!(put(&other, 2.0).await.0, 201);
    assert_eq!(same.json("/v1/models/lathe").await["effects"], kept["effects"]);
    assert_eq!(put(&same, 3.0).await.1["revision"], 2);
    assert_eq!(other.json("/v1/models/lathe").await["revision"], 1);
    for caller in [&mine, &other] {
        assert_eq!(caller.names("/v1/models", "name").await, ["lathe"]);
    }
    assert_eq!(other.request(Method::DELETE, "/v1/models/lathe").send().await.unwrap().status(), 204);
    assert_eq!(mine.json("/v1/models/lathe").await["revision"], 2);
    server.stop().await;
}

#[tokio::test]
async fn a_key_may_what_its_scopes_say() {
    let server = Server::start_with(with_keys).await;
    let (mine, reader, root) = (As(&server, "a-one"), As(&server, "reader"), As(&server, "root"));
    let refused = problem(reader.post(toy::JOB).send().await.unwrap(), 403, "forbidden").await;
    assert!(refused["detail"].as_str().unwrap().contains("solve"), "{refused:#}");
    let put = reader.request(Method::PUT, "/v1/models/x").json(&serde_json::json!({})).send().await.unwrap();
    problem(put, 403, "forbidden").await;
    for caller in [&mine, &reader] {
        problem(caller.get("/metrics").await, 403, "forbidden").await;
        assert_eq!(caller.get("/v1/jobs").await.status(), 200);
    }
    assert_eq!(root.get("/metrics").await.status(), 200);
    assert_eq!(root.post(toy::JOB).send().await.unwrap().status(), 200);
    server.stop().await;
}
