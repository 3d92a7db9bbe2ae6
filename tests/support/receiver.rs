//! Somebody who is told that a job is over: a small HTTP server that answers as a test wants it to.

use std::collections::HashMap;
use std::io::{BufRead, BufReader, Read, Write};
use std::net::{SocketAddr, TcpListener};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use hmac::{Hmac, KeyInit, Mac};
use serde_json::Value;

/// The secret that both sides have.
pub const SECRET: &str = "whsec_MfKQ9r8GKYqrTwjUPD8ILPZIo2LaLaSwMfKQ9r8GKYo=";
/// Longer than anything takes on a busy machine.
const PATIENCE: Duration = Duration::from_mins(2);

/// What came.
#[derive(Debug, Clone)]
pub struct Call {
    pub path: String,
    pub headers: HashMap<String, String>,
    pub body: Vec<u8>,
}

impl Call {
    pub fn header(&self, name: &str) -> &str {
        self.headers.get(name).map_or("", String::as_str)
    }

    pub fn json(&self) -> Value {
        serde_json::from_slice(&self.body).unwrap()
    }

    /// Whether it is signed under a secret, as a receiver finds out.
    pub fn is_signed_with(&self, secret: &str) -> bool {
        let key = STANDARD.decode(secret.strip_prefix("whsec_").unwrap()).unwrap();
        let mut mac = Hmac::<sha2::Sha256>::new_from_slice(&key).unwrap();
        mac.update(format!("{}.{}.", self.header("webhook-id"), self.header("webhook-timestamp")).as_bytes());
        mac.update(&self.body);
        let expected = format!("v1,{}", STANDARD.encode(mac.finalize().into_bytes()));
        self.header("webhook-signature").split(' ').any(|signature| signature == expected)
    }
}

type Answers = Box<dyn FnMut(&Call) -> Option<String> + Send>;

/// Listens until the test is over.
pub struct Receiver {
    pub address: SocketAddr,
    calls: Arc<Mutex<Vec<Call>>>,
}

impl Receiver {
    /// One that takes everything.
    pub fn start() -> Self {
        Self::answering(|_| 204)
    }

    /// One that answers with a status.
    pub fn answering(mut status: impl FnMut(&Call) -> u16 + Send + 'static) -> Self {
        Self::saying(move |call| Some(format!("HTTP/1.1 {} x\r\nContent-Length: 0\r\n\r\n", status(call))))
    }

    /// One that says something, or nothing and keeps the connection.
    pub fn saying(answers: impl FnMut(&Call) -> Option<String> + Send + 'static) -> Self {
        Self::listening(answers, None)
    }

    /// One that takes everything, over TLS.
    #[allow(dead_code)] // not every program of tests has one
    pub fn secured(tls: Arc<rustls::ServerConfig>) -> Self {
        Self::listening(|_| Some("HTTP/1.1 204 x\r\n\r\n".to_owned()), Some(tls))
    }

    fn listening(
        answers: impl FnMut(&Call) -> Option<String> + Send + 'static,
        tls: Option<Arc<rustls::ServerConfig>>,
    ) -> Self {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let address = listener.local_addr().unwrap();
        let calls = Arc::new(Mutex::new(Vec::new()));
        let (kept, answers): (_, Arc<Mutex<Answers>>) = (Arc::clone(&calls), Arc::new(Mutex::new(Box::new(answers))));
        std::thread::spawn(move || {
            for stream in listener.incoming().map_while(Result::ok) {
                let (kept, answers) = (Arc::clone(&kept), Arc::clone(&answers));
                let tls = tls.clone().map(|tls| rustls::ServerConnection::new(tls).unwrap());
                std::thread::spawn(move || match tls {
                    Some(tls) => answer(rustls::StreamOwned::new(tls, stream), &kept, &answers),
                    None => answer(stream, &kept, &answers),
                });
            }
        });
        Self { address, calls }
    }

    /// The setting that allows it.
    pub fn host(&self) -> String {
        self.address.to_string()
    }

    pub fn url(&self, path: &str) -> String {
        format!("http://{}{path}", self.address)
    }

    pub fn calls(&self) -> Vec<Call> {
        self.calls.lock().unwrap().clone()
    }

    /// Waits until so many calls have come; all that have.
    pub async fn after(&self, calls: usize) -> Vec<Call> {
        let begun = Instant::now();
        loop {
            let there = self.calls();
            if there.len() >= calls {
                return there;
            }
            assert!(begun.elapsed() < PATIENCE, "{} calls of {calls}", there.len());
            tokio::time::sleep(Duration::from_millis(5)).await;
        }
    }
}

fn answer(mut stream: impl Read + Write, kept: &Mutex<Vec<Call>>, answers: &Mutex<Answers>) {
    let Some(call) = read(&mut stream) else { return };
    let said = (answers.lock().unwrap())(&call);
    kept.lock().unwrap().push(call);
    match said {
        Some(said) => drop(stream.write_all(said.as_bytes())),
        None => std::thread::sleep(PATIENCE),
    }
}

fn read(stream: &mut impl Read) -> Option<Call> {
    let mut reader = BufReader::new(stream);
    let mut line = String::new();
    reader.read_line(&mut line).ok()?;
    let path = line.split(' ').nth(1)?.to_owned();
    let mut headers = HashMap::new();
    loop {
        let mut line = String::new();
        reader.read_line(&mut line).ok()?;
        let Some((name, value)) = line.trim_end().split_once(':') else { break };
        headers.insert(name.to_ascii_lowercase(), value.trim().to_owned());
    }
    let bytes: usize = headers.get("content-length").and_then(|text| text.parse().ok()).unwrap_or(0);
    let mut body = vec![0; bytes];
    reader.read_exact(&mut body).ok()?;
    Some(Call { path, headers, body })
}

/// A file with a secret.
pub fn secret_file(text: &str) -> tempfile::NamedTempFile {
    let mut file = tempfile::NamedTempFile::new().unwrap();
    file.write_all(text.as_bytes()).unwrap();
    file
}
