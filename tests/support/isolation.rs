//! The things of one owner under the keys of another, over any store: listed, read, followed, cancelled, deleted,
//! overwritten. To him they are not there.

use precut::config::{ApiKey, Config, Scope};
use precut::http::auth;
use reqwest::{Method, RequestBuilder, Response};
use serde_json::Value;

use crate::support::{Server, header, problem, toy};

/// Keys by name, owner and scopes.
fn keys() -> [(&'static str, &'static str, Vec<Scope>); 6] {
    [
        ("a-one", "alpha", Scope::usual()),
        ("a-two", "alpha", Scope::usual()),
        ("b", "beta", Scope::usual()),
        ("reader", "alpha", vec![Scope::Read]),
        ("station", "alpha", vec![Scope::Parts(Some("shaft-560".to_owned()))]),
        ("root", "root", vec![Scope::Admin]),
    ]
}

fn secret(name: &str) -> String {
    format!("the secret key of {name}")
}

pub fn with_keys(config: &mut Config) {
    let key = |(name, owner, scopes): (&str, &str, Vec<Scope>)| ApiKey {
        name: name.to_owned(),
        hash: auth::hash(&secret(name)).to_string(),
        owner: Some(owner.to_owned()),
        scopes,
    };
    config.auth.keys = keys().map(key).to_vec();
}

/// A server, asked with a key.
pub struct As<'a>(pub &'a Server, pub &'static str);

impl As<'_> {
    pub fn request(&self, method: Method, path: &str) -> RequestBuilder {
        let request = self.0.client.request(method, self.0.url(path));
        request.header("authorization", format!("Bearer {}", secret(self.1)))
    }
    pub async fn get(&self, path: &str) -> Response {
        self.request(Method::GET, path).send().await.unwrap()
    }
    pub async fn json(&self, path: &str) -> Value {
        let response = self.get(path).await;
        assert_eq!(response.status(), 200, "{path} as {}", self.1);
        response.json().await.unwrap()
    }
    /// Waits for the end of a job.
    async fn ended(&self, job: &str) {
        let begun = std::time::Instant::now();
        while self.json(job).await["finished_at"].is_null() {
            assert!(begun.elapsed() < std::time::Duration::from_mins(1), "{job}");
            tokio::time::sleep(std::time::Duration::from_millis(10)).await;
        }
    }
    pub fn post(&self, job: &str) -> RequestBuilder {
        let path = format!("/v1/{}", toy::BAR);
        self.request(Method::POST, &path).header("content-type", "application/json").body(job.to_owned())
    }
    pub async fn names(&self, path: &str, field: &str) -> Vec<String> {
        let list = self.json(path).await;
        list["items"].as_array().unwrap().iter().map(|item| item[field].as_str().unwrap().to_owned()).collect()
    }
}

pub async fn jobs_are_their_owners_alone(server: &Server) {
    let (mine, same, other, root) = (As(server, "a-one"), As(server, "a-two"), As(server, "b"), As(server, "root"));
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
    // A client's own name for a request is his own: under it another finds nothing of his.
    let named = |caller: &As<'_>, length: u32| {
        let job = format!("{{\"length_mm\": {length}, \"load_n\": 1}}");
        caller.post(&job).header("prefer", "respond-async").header("idempotency-key", "monday").send()
    };
    let (his, another) = (named(&mine, 713).await.unwrap(), named(&other, 714).await.unwrap());
    assert_eq!((his.status().as_u16(), another.status().as_u16()), (202, 202));
    assert_ne!(header(&his, "location"), header(&another, "location"));
    for address in [header(&his, "location"), header(&another, "location")] {
        root.ended(address).await;
    }
    assert_eq!(
        same.request(Method::DELETE, &address).send().await.unwrap().json::<Value>().await.unwrap()["state"],
        "cancelled"
    );
    drop(held);
    let result = format!("{}/result", header(&beside, "location"));
    let waited = other.post(job).header("prefer", "wait=60").send().await.unwrap();
    // The end of a job is written after the answer that it shares is there.
    root.ended(header(&beside, "location")).await;
    assert_eq!((waited.status().as_u16(), other.get(&result).await.status().as_u16()), (200, 200));
}

pub async fn results_are_shared_by_content_and_shown_to_who_asked(server: &Server) {
    let (mine, same, other, root) = (As(server, "a-one"), As(server, "a-two"), As(server, "b"), As(server, "root"));
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
}

pub async fn models_are_their_owners_alone(server: &Server) {
    let (mine, same, other) = (As(server, "a-one"), As(server, "a-two"), As(server, "b"));
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
}

pub async fn records_are_their_owners_alone(server: &Server) {
    let (mine, same, other) = (As(server, "a-one"), As(server, "a-two"), As(server, "b"));
    let put = async |caller: &As<'_>, carriage: f64| {
        let set = serde_json::json!({ "/compliance/carriage_um_per_n": carriage });
        let record = serde_json::json!({ "from": "lathe_engine_medium", "set": set });
        let response = caller.request(Method::PUT, "/v1/machines/lathe-3").json(&record).send().await.unwrap();
        (response.status().as_u16(), response.json::<Value>().await.unwrap())
    };
    assert_eq!(put(&mine, 0.02).await.0, 201);
    assert_eq!(same.json("/v1/machines/lathe-3").await["revision"], 1);
    // To another it is not there, in no list and in no job; the engine's own are there for all.
    problem(other.get("/v1/machines/lathe-3").await, 404, "unknown_machine").await;
    assert_eq!(other.names("/v1/machines?own=true", "name").await, Vec::<String>::new());
    assert_eq!(other.json("/v1/machines/lathe_engine_medium").await["built_in"], true);
    problem(other.request(Method::DELETE, "/v1/machines/lathe-3").send().await.unwrap(), 404, "unknown_machine").await;
    let job = serde_json::json!({
        "machine": "lathe-3",
        "shaft": {"segments": [{"length_mm": 500, "diameter_mm": 60, "stock_diameter_mm": 62}], "material": "steel_45"},
        "supports": [{"kind": "chuck", "z_mm": 0}, {"kind": "centre", "z_mm": 500}],
        "force": {"kind": "constant", "passive_n": 200},
        "cut": {"feed_mm_per_rev": 0.3, "spindle_speed_rpm": 500},
    });
    let solve = async |caller: &As<'_>| {
        caller.request(Method::POST, "/v1/deflection-compensation").json(&job).send().await.unwrap()
    };
    let refused = problem(solve(&other).await, 422, "invalid_job").await;
    assert_eq!(refused["errors"][0]["code"], "unknown_machine", "{refused:#}");
    assert!(!refused.to_string().contains("lathe-3\"]"), "it does not tell what another has");
    // The same name of two owners means two things.
    assert_eq!(put(&other, 0.07).await.1["revision"], 1);
    let carriage = async |caller: &As<'_>| -> Value {
        let answer: Value = solve(caller).await.json().await.unwrap();
        answer["input"]["carriage"]["compliance_um_per_n"].clone()
    };
    assert_eq!((carriage(&mine).await, carriage(&other).await), (0.02.into(), 0.07.into()));
    assert!(
        !mine.request(Method::GET, "/v1/library/export").send().await.unwrap().text().await.unwrap().contains("0.07")
    );
    assert_eq!(other.request(Method::DELETE, "/v1/machines/lathe-3").send().await.unwrap().status(), 204);
    assert_eq!(mine.json("/v1/machines/lathe-3").await["revision"], 1);
}

pub async fn an_answer_is_traced_to_what_made_it(server: &Server) {
    let (mine, other, root) = (As(server, "a-one"), As(server, "b"), As(server, "root"));
    // The line of a program is all that there is.
    let job = r#"{"length_mm": 717, "load_n": 1}"#;
    let program = mine.post(job).header("accept", "text/x-gcode").send().await.unwrap().text().await.unwrap();
    let line = program.lines().find(|line| line.contains("result b3:")).unwrap();
    let key = &line[line.find("b3:").unwrap()..][..67];
    let address = format!("/v1/results/{key}/provenance");
    problem(other.get(&address).await, 404, "unknown_result").await;
    let direct = mine.json(&address).await;
    assert_eq!((&direct["key"], &direct["calculator"]), (&key.into(), &toy::BAR.into()), "{direct:#}");
    let answer = mine.json(direct["links"]["result"].as_str().unwrap()).await;
    for field in ["calculator", "version", "engine", "key", "model"] {
        assert_eq!(direct[field], answer[field], "{field}");
    }
    assert!(direct["computed_at"].as_str().unwrap().ends_with('Z') && direct["model"].is_null());
    assert_eq!((&direct["jobs"], &direct["asked_by"]), (&serde_json::json!([]), &serde_json::json!(["alpha"])));
    let made_of = mine.json(direct["links"]["job"].as_str().unwrap()).await;
    assert_eq!(made_of["job"]["length_mm"], 717.0);
    assert_eq!(mine.json(direct["links"]["calculator"].as_str().unwrap()).await["id"], toy::BAR);
    // Jobs of two owners come to the same answer: each is told of his own, who looks after the service of all.
    let mut jobs = Vec::new();
    for caller in [&mine, &other] {
        let named = caller.post(job).header("idempotency-key", "traced").header("prefer", "wait=60");
        assert_eq!(named.send().await.unwrap().status(), 200);
        let listed = caller.json("/v1/jobs?state=succeeded&limit=1").await;
        assert_eq!(listed["items"][0]["key"], key);
        jobs.push(listed["items"][0]["id"].as_str().unwrap().to_owned());
    }
    let told = |provenance: &Value| -> Vec<(String, String)> {
        let text = |value: &Value| value.as_str().unwrap().to_owned();
        let jobs = provenance["jobs"].as_array().unwrap();
        jobs.iter().map(|job| (text(&job["id"]), text(&job["owner"]))).collect()
    };
    let pair = |index: usize, owner: &str| (jobs[index].clone(), owner.to_owned());
    assert_eq!(told(&mine.json(&address).await), [pair(0, "alpha")]);
    let of_other = other.json(&address).await;
    assert_eq!(told(&of_other), [pair(1, "beta")]);
    assert!(!of_other["asked_by"].as_array().unwrap().contains(&"alpha".into()), "{of_other:#}");
    assert_eq!(told(&root.json(&address).await), [pair(1, "beta"), pair(0, "alpha")]);
    assert_eq!(other.get(of_other["jobs"][0]["job"].as_str().unwrap()).await.status(), 200);
    let unknown = format!("/v1/results/b3:{}/provenance", "0".repeat(64));
    problem(root.get(&unknown).await, 404, "unknown_result").await;
    problem(root.get("/v1/results/b3:0/provenance").await, 400, "bad_key").await;
}

pub async fn an_answer_is_traced_to_its_model(server: &Server) {
    let mine = As(server, "a-one");
    let model = serde_json::json!({
        "calculator": "deflection-compensation", "provenance": {},
        "effects": [{"kind": "tool_wear", "rate_um_per_km": 1.0}],
    });
    let kept = mine.request(Method::PUT, "/v1/models/traced").json(&model).send().await.unwrap();
    let kept: Value = kept.json().await.unwrap();
    let job = serde_json::json!({
        "shaft": {"segments": [{"length_mm": 500, "diameter_mm": 60, "stock_diameter_mm": 62}], "material": "steel_45"},
        "supports": [{"kind": "centre", "z_mm": 0}, {"kind": "centre", "z_mm": 500}],
        "force": {"kind": "constant", "passive_n": 200},
        "cut": {"feed_mm_per_rev": 0.3, "spindle_speed_rpm": 500},
        "conditions": {"tool_path_at_start_m": 0},
        "model": "traced",
    });
    let answer = mine.request(Method::POST, "/v1/deflection-compensation").json(&job).send().await.unwrap();
    let (status, place) = (answer.status().as_u16(), header(&answer, "content-location").to_owned());
    assert_eq!(status, 200, "{}", answer.text().await.unwrap());
    let provenance = mine.json(&format!("{place}/provenance")).await;
    for field in ["name", "revision", "sha256"] {
        assert_eq!(provenance["model"][field], kept[field], "{field} in {provenance:#}");
    }
    assert_eq!(mine.json(provenance["links"]["model"].as_str().unwrap()).await["sha256"], kept["sha256"]);
}
