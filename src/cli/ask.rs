//! Asks the service: one that runs at an address, or this program over a data folder. Either way it is the same interface, so
//! that the command line says nothing else than the service does.

use std::path::PathBuf;
use std::time::Duration;

use bytes::Bytes;
use clap::Args;
use http_body_util::{BodyExt, Full};
use hyper::header::{ACCEPT, ACCEPT_LANGUAGE, AUTHORIZATION, CONTENT_TYPE, HOST, IF_MATCH};
use hyper::{Method, Request, StatusCode};
use hyper_util::rt::TokioIo;
use tokio::net::TcpStream;

use super::Failed;
use crate::config::{Config, Flags};
use crate::engine::{Engine, EngineSettings};
use crate::http::{self, App};
use crate::registry::Registry;
use crate::text::Language;

/// How long running calculations may take at the end.
const GRACE: Duration = Duration::from_secs(1);

/// Where what is kept is kept.
#[derive(Debug, Clone, Args)]
#[group(required = true, multiple = false)]
pub(super) struct Where {
    /// Data folder of a service that does not run
    #[arg(long, value_name = "DIR")]
    data: Option<PathBuf>,
    /// Address of a service that runs, as http://127.0.0.1:8080; its key in PRECUT_KEY
    #[arg(long, value_name = "URL")]
    url: Option<String>,
}

/// What is asked.
pub(super) struct Question {
    pub(super) method: Method,
    pub(super) path: String,
    /// Type and bytes of what is sent.
    pub(super) body: Option<(&'static str, Vec<u8>)>,
    pub(super) accept: &'static str,
    /// Tag of what is changed.
    pub(super) if_match: Option<String>,
}

impl Question {
    pub(super) fn get(path: String) -> Self {
        Self { method: Method::GET, path, body: None, accept: "application/json", if_match: None }
    }
}

/// Asks one question after another. What is refused ends it, in the service's words.
pub(super) struct Asker {
    to: To,
    language: Language,
}

enum To {
    Here(Box<App>, Engine),
    There { authority: String, base: String },
}

impl Asker {
    pub(super) async fn of(place: &Where, registry: &Registry, language: Language) -> Result<Self, Failed> {
        let to = match (&place.data, &place.url) {
            (Some(data), _) => {
                let flags = Flags { data: Some(data.clone()), ..Flags::default() };
                let config =
                    Config::load(None, &flags).map_err(|error| Failed::Machine(format!("settings: {error}")))?;
                let settings = EngineSettings::of(&config);
                let opened = Engine::open(registry.clone(), settings).await;
                let engine = opened.map_err(|error| Failed::Machine(error.to_string()))?;
                To::Here(Box::new(App::new(engine.clone(), &config)), engine)
            }
            (None, url) => {
                let url = url.clone().unwrap_or_default();
                let (authority, base) = super::health::parts(&url)
                    .ok_or_else(|| Failed::Machine(format!("{url} is no address such as http://127.0.0.1:8080")))?;
                To::There { authority: authority.to_owned(), base: base.to_owned() }
            }
        };
        Ok(Self { to, language })
    }

    /// The bytes of an answer.
    pub(super) async fn ask(&self, question: Question) -> Result<Vec<u8>, Failed> {
        let (base, host) = match &self.to {
            To::Here(..) => ("", "localhost"),
            To::There { authority, base } => (base.as_str(), authority.as_str()),
        };
        let mut request = Request::builder()
            .method(question.method)
            .uri(format!("{base}{}", question.path))
            .header(HOST, host)
            .header(ACCEPT, question.accept)
            .header(ACCEPT_LANGUAGE, self.language.tag());
        if let Some(tag) = &question.if_match {
            request = request.header(IF_MATCH, format!("\"{tag}\""));
        }
        if let Ok(key) = std::env::var("PRECUT_KEY") {
            request = request.header(AUTHORIZATION, format!("Bearer {key}"));
        }
        let body = match question.body {
            Some((kind, bytes)) => {
                request = request.header(CONTENT_TYPE, kind);
                Bytes::from(bytes)
            }
            None => Bytes::new(),
        };
        let request = request.body(body).map_err(|error| Failed::Machine(error.to_string()))?;
        let (status, bytes) = match &self.to {
            To::Here(app, _) => http::answer_to(app, request).await,
            To::There { authority, .. } => there(authority, request).await?,
        };
        if status.is_success() { Ok(bytes.to_vec()) } else { Err(refused(status, &bytes)) }
    }

    /// Writes what waits to be written.
    pub(super) async fn close(self) {
        if let To::Here(_, engine) = self.to {
            engine.close(GRACE).await;
        }
    }
}

async fn there(authority: &str, request: Request<Bytes>) -> Result<(StatusCode, Bytes), Failed> {
    let failed = |reason: String| Failed::Machine(format!("{authority} does not answer: {reason}"));
    let address = if authority.contains(':') { authority.to_owned() } else { format!("{authority}:80") };
    let stream = TcpStream::connect(address).await.map_err(|error| failed(error.to_string()))?;
    let connected = hyper::client::conn::http1::handshake(TokioIo::new(stream)).await;
    let (mut sender, connection) = connected.map_err(|error| failed(error.to_string()))?;
    tokio::spawn(connection);
    let response = sender.send_request(request.map(Full::new)).await.map_err(|error| failed(error.to_string()))?;
    let status = response.status();
    let body = response.into_body().collect().await.map_err(|error| failed(error.to_string()))?;
    Ok((status, body.to_bytes()))
}

/// A problem document, as the service wrote it.
fn refused(status: StatusCode, document: &[u8]) -> Failed {
    let text = String::from_utf8_lossy(document).into_owned();
    let told = serde_json::from_str::<serde_json::Value>(&text).and_then(|told| serde_json::to_string_pretty(&told));
    Failed::Refused { text: told.unwrap_or(text), is_ours: status.is_server_error() }
}
