//! Asks a running service whether it is ready: one GET over a plain socket.

use std::io::{Read, Write};
use std::net::{IpAddr, Ipv4Addr, Ipv6Addr, SocketAddr, TcpStream, ToSocketAddrs};
use std::time::Duration;

use super::{Failed, print};

const PATIENCE: Duration = Duration::from_secs(5);
/// The document is far shorter.
const MOST_BYTES: u64 = 64 * 1024;

/// `precut health`
pub(super) fn ask(url: Option<String>) -> Result<(), Failed> {
    let url = url.unwrap_or_else(own_url);
    let (authority, base) =
        parts(&url).ok_or_else(|| Failed::Machine(format!("{url} is no address such as http://127.0.0.1:8080")))?;
    let answer = get(authority, &format!("{base}/health/ready"))
        .map_err(|error| Failed::Machine(format!("{authority} does not answer: {error}")))?;
    let (head, body) = answer.split_once("\r\n\r\n").unwrap_or((&answer, ""));
    let status = head.split(' ').nth(1).unwrap_or_default();
    if status == "200" {
        print(format!("{}\n", body.trim_end()).as_bytes())
    } else {
        Err(Failed::Machine(format!("{authority} is not ready: status {status}\n{body}")))
    }
}

/// Where a service with this environment answers for its health, as seen from this machine.
fn own_url() -> String {
    let given = |name| std::env::var(name).ok().and_then(|text| text.parse::<SocketAddr>().ok());
    let listen = given("PRECUT_ADMIN_LISTEN").or_else(|| given("PRECUT_LISTEN"));
    let mut listen = listen.unwrap_or(SocketAddr::from((Ipv4Addr::LOCALHOST, 8080)));
    match listen.ip() {
        IpAddr::V4(ip) if ip.is_unspecified() => listen.set_ip(Ipv4Addr::LOCALHOST.into()),
        IpAddr::V6(ip) if ip.is_unspecified() => listen.set_ip(Ipv6Addr::LOCALHOST.into()),
        _ => {}
    }
    format!("http://{listen}")
}

/// `host:port` and the path before `/health/ready`.
pub(super) fn parts(url: &str) -> Option<(&str, &str)> {
    let rest = url.strip_prefix("http://")?;
    let (authority, path) = rest.find('/').map_or((rest, ""), |slash| rest.split_at(slash));
    let is_clean = |text: &str| !text.contains(|character: char| character.is_whitespace() || character.is_control());
    (!authority.is_empty() && is_clean(rest)).then(|| (authority, path.trim_end_matches('/')))
}

fn get(authority: &str, path: &str) -> std::io::Result<String> {
    let addresses = authority.to_socket_addrs().or_else(|_| (authority, 80).to_socket_addrs())?;
    let mut failure = std::io::Error::from(std::io::ErrorKind::AddrNotAvailable);
    for address in addresses {
        match TcpStream::connect_timeout(&address, PATIENCE) {
            Ok(mut stream) => {
                stream.set_read_timeout(Some(PATIENCE))?;
                stream.set_write_timeout(Some(PATIENCE))?;
                write!(stream, "GET {path} HTTP/1.1\r\nHost: {authority}\r\nConnection: close\r\n\r\n")?;
                let mut answer = String::new();
                stream.take(MOST_BYTES).read_to_string(&mut answer)?;
                return Ok(answer);
            }
            Err(error) => failure = error,
        }
    }
    Err(failure)
}

#[cfg(test)]
mod tests {
    use super::parts;

    #[test]
    fn addresses_are_taken_apart() {
        assert_eq!(parts("http://127.0.0.1:8080"), Some(("127.0.0.1:8080", "")));
        assert_eq!(parts("http://cam.example/precut/"), Some(("cam.example", "/precut")));
        assert_eq!(parts("http://[::1]:80/"), Some(("[::1]:80", "")));
        for url in ["", "https://x", "http://", "http:///x", "http://a b", "127.0.0.1:8080"] {
            assert_eq!(parts(url), None, "{url}");
        }
    }
}
