//! Attacks on the service along the OWASP API Security Top 10, byte by byte. docs/security.md says what they found, and which
//! other tests hold the rest of that list.

use std::io::{Read as _, Write as _};
use std::time::Duration;

use precut::config::Config;
use serde_json::Value;
use tokio::io::{AsyncReadExt, AsyncWriteExt};
use tokio::net::TcpStream;
use tokio::time::timeout;

use crate::isolation::{As, with_keys};
use crate::support::{Server, address_of, header, precut_command, problem, toy};

/// Everything that comes back to a request as it stands here.
async fn raw(server: &Server, request: &[u8]) -> String {
    let mut stream = TcpStream::connect(server.address).await.unwrap();
    stream.write_all(request).await.unwrap();
    let mut said = Vec::new();
    // A connection that is reset has said what it had to say.
    let _ = timeout(Duration::from_mins(1), stream.read_to_end(&mut said)).await.expect("it is closed");
    String::from_utf8_lossy(&said).into_owned()
}

/// Statuses of all answers on a connection.
fn statuses(said: &str) -> Vec<&str> {
    said.split("HTTP/1.1 ").skip(1).map(|answer| &answer[..3]).collect()
}

async fn guarded() -> Server {
    Server::start_with(with_keys).await
}

#[tokio::test]
async fn no_spelling_of_an_address_goes_round_the_keys() {
    let server = guarded().await;
    for target in [
        "/v1/jobs",
        "//v1/jobs",
        "/./v1/jobs",
        "/V1/jobs",
        "/v1//jobs",
        "/v1/jobs/",
        "/v1/%6aobs",
        "/%76%31/jobs",
        "/x/../v1/jobs",
        "/health/../v1/jobs",
        "/v1/jobs;x",
        "/v1/jobs%00",
        "/v1/jobs%2f",
        "/v1\\jobs",
        "http://a/v1/jobs",
        "/v1/jobs?key=the%20secret%20key%20of%20a-one",
        "/metrics",
        "//metrics",
        "/%6detrics",
    ] {
        let said =
            raw(&server, format!("GET {target} HTTP/1.1\r\nHost: a\r\nConnection: close\r\n\r\n").as_bytes()).await;
        assert!(matches!(statuses(&said)[..], ["400" | "401" | "404"]), "{target}: {said}");
    }
    for key in [
        "Authorization: Basic YTph",
        "Authorization: Bearer",
        "Authorization: Bearer ",
        "Authorization: Bearer the secret key of a-on",
        "Authorization: Bearer THE SECRET KEY OF A-ONE",
        "X-Api-Key: the secret key of a-one",
        "Cookie: key=the secret key of a-one",
        "X-Forwarded-User: root",
        "X-Original-URL: /health/live",
        "X-Forwarded-For: 127.0.0.1",
    ] {
        let said =
            raw(&server, format!("GET /v1/jobs HTTP/1.1\r\nHost: a\r\nConnection: close\r\n{key}\r\n\r\n").as_bytes())
                .await;
        assert_eq!(statuses(&said), ["401"], "{key}: {said}");
    }
    server.stop().await;
}

#[tokio::test]
async fn no_header_changes_the_method_and_no_method_does_what_it_does_not_say() {
    let server = guarded().await;
    let (mine, reader) = (As(&server, "a-one"), As(&server, "reader"));
    let accepted = mine.post(toy::JOB).header("prefer", "respond-async").send().await.unwrap();
    let job = header(&accepted, "location").to_owned();
    for name in ["x-http-method-override", "x-http-method", "x-method-override"] {
        let read = reader.request(reqwest::Method::GET, &job).header(name, "DELETE").send().await.unwrap();
        assert_eq!(read.status(), 200);
        assert_ne!(read.json::<Value>().await.unwrap()["state"], "cancelled", "{name}");
    }
    for method in ["TRACE", "PATCH", "PROPFIND", "QUERY"] {
        let method = reqwest::Method::from_bytes(method.as_bytes()).unwrap();
        problem(mine.request(method, "/v1/jobs").send().await.unwrap(), 405, "method_not_allowed").await;
    }
    server.stop().await;
}

#[tokio::test]
async fn what_two_servers_could_read_in_two_ways_is_refused_and_ends_the_connection() {
    let server = guarded().await;
    let next = "GET /health/live HTTP/1.1\r\nHost: a\r\n\r\n";
    for (rest, what) in [
        ("Content-Length: 4\r\nTransfer-Encoding: chunked\r\n\r\n0\r\n\r\n", "a length beside pieces"),
        ("Content-Length: 4\r\nContent-Length: 5\r\n\r\nabcd", "two lengths"),
        ("Content-Length: 4, 5\r\n\r\nabcd", "a list of lengths"),
        ("Content-Length: +4\r\n\r\nabcd", "a sign before a length"),
        ("Content-Length: 0x4\r\n\r\nabcd", "a length in hexadecimal digits"),
        ("Transfer-Encoding: xchunked\r\n\r\n0\r\n\r\n", "an unknown way to send pieces"),
        ("Transfer-Encoding : chunked\r\n\r\n0\r\n\r\n", "a space before the colon"),
        ("Transfer-Encoding: chunked\r\nTransfer-Encoding: identity\r\n\r\n0\r\n\r\n", "two ways to send"),
        ("Transfer-Encoding: chunked\r\n\r\n-1\r\nab", "a negative piece"),
        ("X: a\r\n b\r\nContent-Length: 0\r\n\r\n", "a header over two lines"),
        ("X: a\0b\r\nContent-Length: 0\r\n\r\n", "a header with a zero byte"),
    ] {
        let head = format!(
            "POST /v1/{} HTTP/1.1\r\nHost: a\r\nContent-Type: application/json\r\n\
             Authorization: Bearer the secret key of a-one\r\n",
            toy::BAR
        );
        let said = raw(&server, format!("{head}{rest}{next}").as_bytes()).await;
        assert_eq!(statuses(&said), ["400"], "{what}: {said}");
    }
    server.stop().await;
}

#[tokio::test]
async fn nothing_is_served_that_the_contract_does_not_name() {
    let server = guarded().await;
    for target in [
        "/admin",
        "/debug/pprof",
        "/actuator",
        "/.env",
        "/.git/config",
        "/server-status",
        "/swagger",
        "/graphql",
        "/v0/jobs",
        "/v2/jobs",
        "/v1/keys",
        "/v1/owners",
        "/backup",
        "/config",
        "/../../etc/passwd",
        "/assets/..%2f..%2fetc/passwd",
        "/%2e%2e/%2e%2e/etc/passwd",
        "/docs/../../etc/passwd",
        "/docs/..%5c..%5cetc",
    ] {
        let key = "Authorization: Bearer the secret key of root";
        let said =
            raw(&server, format!("GET {target} HTTP/1.1\r\nHost: a\r\nConnection: close\r\n{key}\r\n\r\n").as_bytes())
                .await;
        assert_eq!(statuses(&said), ["404"], "{target}: {said}");
    }
    for path in ["/", "/docs", "/v1/jobs", "/nothing", "/health/live"] {
        let answer = As(&server, "root").get(path).await;
        assert_eq!(header(&answer, "x-content-type-options"), "nosniff", "{path}");
        assert!(header(&answer, "content-security-policy").contains("frame-ancestors 'none'"), "{path}");
        assert!(answer.headers().get("server").is_none() && answer.headers().get("x-powered-by").is_none(), "{path}");
    }
    server.stop().await;
}

#[tokio::test]
async fn a_packed_body_is_not_unpacked() {
    let server = guarded().await;
    // The first bytes of a packed megabyte: no byte of it may be unpacked.
    let packed = [0x78, 0x9c, 0xed, 0xc1, 0x01, 0x01, 0x00, 0x00];
    for encoding in ["gzip", "deflate", "br", "zstd", "gzip, gzip"] {
        let sent = As(&server, "a-one").post("").header("content-encoding", encoding).body(packed.to_vec());
        problem(sent.send().await.unwrap(), 415, "unsupported_media_type").await;
    }
    server.stop().await;
}

/// `callbacks.hosts` names one host: nothing that only looks like it is one.
#[tokio::test]
async fn no_spelling_of_an_address_is_called_that_the_settings_do_not_name() {
    let secret = crate::receiver::secret_file(crate::receiver::SECRET);
    let one_host = |config: &mut Config| {
        config.callbacks.hosts = vec!["mes.example".to_owned()];
        secret.path().to_str().unwrap().clone_into(&mut config.callbacks.secret_file);
    };
    let server = Server::start_with(one_host).await;
    for url in [
        "http://169.254.169.254/latest",
        "http://2852039166/",
        "http://0xa9fea9fe/",
        "http://0251.0376.0251.0376/",
        "http://[::ffff:169.254.169.254]/",
        "http://127.1/",
        "http://[::1]/",
        "http://localhost/",
        "http://mes.example@169.254.169.254/",
        "https://169.254.169.254@mes.example/",
        "https://mes.example:22/",
        "https://mes.example.evil.com/",
        "https://evil.com#mes.example",
        "https://evil.com?mes.example",
        "https://mes.example%2eevil.com/",
        "file:///etc/passwd",
        "gopher://mes.example/",
        "javascript:alert(1)",
        "//mes.example/",
        "mes.example",
        "",
    ] {
        let mut path: reqwest::Url = server.url(&format!("/v1/{}", toy::BAR)).parse().unwrap();
        path.query_pairs_mut().append_pair("callback", url);
        let sent = server.client.post(path).header("content-type", "application/json").body(toy::JOB);
        problem(sent.send().await.unwrap(), 422, "bad_callback").await;
    }
    server.stop().await;
}

#[test]
fn the_log_names_the_key_of_a_request_and_never_has_it() {
    let folder = tempfile::tempdir().unwrap();
    let at = |name: &str| folder.path().join(name);
    let key = "the secret key of the cell";
    let hash = precut::http::auth::hash(key);
    std::fs::write(at("precut.toml"), format!("[auth]\nkeys = [{{ name = \"cell-2026\", hash = \"{hash}\" }}]\n"))
        .unwrap();
    let (settings, data) = (at("precut.toml"), at("data"));
    let arguments =
        ["serve", "--config", settings.to_str().unwrap(), "--listen", "127.0.0.1:0", "--data", data.to_str().unwrap()];
    let mut command = precut_command(&arguments);
    let mut child = command.stderr(std::fs::File::create(at("log")).unwrap()).spawn().unwrap();
    let address = address_of(&mut child);
    let mut stream = std::net::TcpStream::connect(address).unwrap();
    let head = "GET /v1/jobs?limit=none HTTP/1.1\r\nHost: a\r\nConnection: close\r\n";
    stream.write_all(format!("{head}Authorization: Bearer {key}\r\n\r\n").as_bytes()).unwrap();
    let mut said = String::new();
    stream.read_to_string(&mut said).unwrap();
    assert_eq!(statuses(&said), ["400"], "{said}");
    child.kill().unwrap();
    child.wait().unwrap();
    let log = std::fs::read_to_string(at("log")).unwrap();
    let line = log.lines().find(|line| line.contains("refused")).unwrap_or_else(|| panic!("{log}"));
    assert!(line.contains("cell-2026"), "{line}");
    assert!(!log.contains(key), "{log}");
}
