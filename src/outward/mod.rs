//! Requests that the service makes itself: a small body posted to an address, and the status that comes back.
//!
//! Nothing is followed that an answer says but how long to stay away: no redirect is taken, no proxy asked, no body read. Where the address was given
//! by a client, it goes to an address that was looked at ([`Reach`]), so that nobody sends the service where he cannot go
//! himself.

mod address;

use std::sync::Arc;
use std::time::Duration;

use bytes::Bytes;
use http_body_util::Full;
use hyper::client::conn::http1;
use hyper::header::{CONTENT_TYPE, HOST, HeaderMap, HeaderValue, RETRY_AFTER, USER_AGENT};
use hyper::http::response::Parts;
use hyper::{Method, Request, StatusCode};
use hyper_util::rt::TokioIo;
use jiff::Timestamp;
use rustls::pki_types::ServerName;
use rustls::{ClientConfig, RootCertStore};
use tokio::io::{AsyncRead, AsyncWrite};
use tokio::net::TcpStream;
use tokio_rustls::TlsConnector;
use url::Url;

pub(crate) use address::{Reach, host_of, place_of, port_of};

/// Largest header of an answer, bytes.
const MOST_HEADER_BYTES: usize = 16 << 10;

/// Why a request came to nothing. Its word is a code, which callers are told.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Fault {
    /// The name of the host has no address.
    NoAddress,
    /// All addresses of the host are of a kind that is not called.
    PrivateAddress,
    /// Nobody listens there.
    NoConnection,
    /// The other end has no certificate that is trusted here, or none at all.
    NoTls,
    /// No answer came in time, or none that is HTTP.
    NoAnswer,
    /// The answer has another status than 2xx.
    Status {
        /// That.
        status: StatusCode,
        /// For how long the other end asks to be left alone.
        retry_after: Option<Duration>,
    },
}

impl Fault {
    /// As it is told.
    pub(crate) fn code(self) -> String {
        match self {
            Self::NoAddress => "no_address".to_owned(),
            Self::PrivateAddress => "private_address".to_owned(),
            Self::NoConnection => "no_connection".to_owned(),
            Self::NoTls => "no_tls".to_owned(),
            Self::NoAnswer => "no_answer".to_owned(),
            Self::Status { status, .. } => format!("http_{}", status.as_u16()),
        }
    }
}

/// Posts. Cheap to clone.
#[derive(Clone)]
pub(crate) struct Outward {
    tls: TlsConnector,
    reach: Reach,
    timeout: Duration,
}

impl Outward {
    /// One that trusts the authorities of the system (`SSL_CERT_FILE` names others) and goes as far as it may.
    pub(crate) fn new(reach: Reach, timeout: Duration) -> Result<Self, rustls::Error> {
        let mut roots = RootCertStore::empty();
        let found = rustls_native_certs::load_native_certs();
        for error in found.errors {
            tracing::warn!(%error, "a certificate of the system cannot be read");
        }
        roots.add_parsable_certificates(found.certs);
        let provider = Arc::new(rustls::crypto::ring::default_provider());
        let config = ClientConfig::builder_with_provider(provider)
            .with_safe_default_protocol_versions()?
            .with_root_certificates(roots)
            .with_no_client_auth();
        Ok(Self { tls: TlsConnector::from(Arc::new(config)), reach, timeout })
    }

    /// Posts a body; that the answer has a status of 2xx.
    pub(crate) async fn post(&self, url: &Url, headers: HeaderMap, body: Bytes) -> Result<(), Fault> {
        let answered = tokio::time::timeout(self.timeout, self.answered(url, headers, body));
        let answer = answered.await.unwrap_or(Err(Fault::NoAnswer))?;
        let status = answer.status;
        if status.is_success() {
            Ok(())
        } else {
            Err(Fault::Status { status, retry_after: retry_after(&answer.headers) })
        }
    }

    async fn answered(&self, url: &Url, headers: HeaderMap, body: Bytes) -> Result<Parts, Fault> {
        let stream = self.connected(url).await?;
        let request = request(url, headers, body).ok_or(Fault::NoAnswer)?;
        if url.scheme() == "http" {
            return exchanged(stream, request).await;
        }
        let host = host_of(url).ok_or(Fault::NoAddress)?;
        // An address in brackets is one without them here.
        let name = ServerName::try_from(host.trim_matches(['[', ']']).to_owned()).map_err(|_| Fault::NoTls)?;
        let secured = self.tls.connect(name, stream).await.map_err(|error| {
            tracing::debug!(%error, host, "no TLS");
            Fault::NoTls
        })?;
        exchanged(secured, request).await
    }

    async fn connected(&self, url: &Url) -> Result<TcpStream, Fault> {
        for address in self.reach.addresses(url).await? {
            if let Ok(stream) = TcpStream::connect(address).await {
                return Ok(stream);
            }
        }
        Err(Fault::NoConnection)
    }
}

fn request(url: &Url, headers: HeaderMap, body: Bytes) -> Option<Request<Full<Bytes>>> {
    let target = url.query().map_or_else(|| url.path().to_owned(), |query| format!("{}?{query}", url.path()));
    let host = match url.port() {
        Some(port) => format!("{}:{port}", url.host_str()?),
        None => url.host_str()?.to_owned(),
    };
    let mut request = Request::builder().method(Method::POST).uri(target).body(Full::new(body)).ok()?;
    *request.headers_mut() = headers;
    let agent = concat!("precut/", env!("CARGO_PKG_VERSION"));
    request.headers_mut().insert(HOST, HeaderValue::try_from(host).ok()?);
    request.headers_mut().insert(USER_AGENT, HeaderValue::from_static(agent));
    request.headers_mut().entry(CONTENT_TYPE).or_insert(HeaderValue::from_static("application/json"));
    Some(request)
}

/// Sends a request over a connection of its own, which ends with the header of the answer.
async fn exchanged<S>(stream: S, request: Request<Full<Bytes>>) -> Result<Parts, Fault>
where
    S: AsyncRead + AsyncWrite + Unpin,
{
    let shaken = http1::Builder::new().max_buf_size(MOST_HEADER_BYTES).handshake(TokioIo::new(stream)).await;
    let (mut sender, connection) = shaken.map_err(|_| Fault::NoAnswer)?;
    let answer = sender.send_request(request);
    tokio::pin!(answer, connection);
    let answered = tokio::select! {
        biased;
        answered = &mut answer => answered,
        // It ends with the answer where the other end closes at once.
        _ = &mut connection => answer.await,
    };
    answered.map(|answer| answer.into_parts().0).map_err(|_| Fault::NoAnswer)
}

/// What `Retry-After` says: seconds, or a date (RFC 9110, section 10.2.3). A date that has passed says nothing.
fn retry_after(headers: &HeaderMap) -> Option<Duration> {
    let text = headers.get(RETRY_AFTER)?.to_str().ok()?;
    if let Ok(seconds) = text.parse() {
        return Some(Duration::from_secs(seconds));
    }
    let date = jiff::fmt::rfc2822::parse(text).ok()?;
    date.timestamp().duration_since(Timestamp::now()).try_into().ok()
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    #[test]
    fn how_long_to_stay_away_is_said_in_seconds_or_by_a_date() {
        let said =
            |text: &str| retry_after(&HeaderMap::from_iter([(RETRY_AFTER, HeaderValue::try_from(text).unwrap())]));
        assert_eq!(said("120"), Some(Duration::from_mins(2)));
        assert_eq!(said("18446744073709551615"), Some(Duration::from_secs(u64::MAX)));
        let later = said("Tue, 31 Dec 2199 23:59:59 GMT").unwrap();
        assert!(later > Duration::from_hours(24), "{later:?}");
        for nothing in ["", "soon", "-1", "1.5", "18446744073709551616", "Wed, 21 Oct 2015 07:28:00 GMT"] {
            assert_eq!(said(nothing), None, "{nothing}");
        }
        assert_eq!(retry_after(&HeaderMap::new()), None);
    }
}
