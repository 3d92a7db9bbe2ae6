//! Which addresses of the network are called.

use std::net::{IpAddr, Ipv4Addr, Ipv6Addr, SocketAddr};

use url::{Host, Url};

use super::Fault;

/// Connections are tried with so many addresses of a host.
const MOST_ADDRESSES: usize = 3;

/// How far requests go.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(crate) enum Reach {
    /// Public addresses only.
    Public,
    /// Those of private networks and of this machine, too.
    Private,
    /// Wherever whoever runs the service has sent it.
    Anywhere,
}

impl Reach {
    /// Where a host is to be reached, as far as that may be. What was looked at here is what is connected to: a name that
    /// means something else by then changes nothing.
    pub(super) async fn addresses(self, url: &Url) -> Result<Vec<SocketAddr>, Fault> {
        let port = port_of(url);
        let all: Vec<SocketAddr> = match url.host() {
            Some(Host::Ipv4(ip)) => vec![(ip, port).into()],
            Some(Host::Ipv6(ip)) => vec![(ip, port).into()],
            Some(Host::Domain(name)) => {
                tokio::net::lookup_host((name, port)).await.map_err(|_| Fault::NoAddress)?.collect()
            }
            None => Vec::new(),
        };
        if all.is_empty() {
            return Err(Fault::NoAddress);
        }
        let mut allowed: Vec<SocketAddr> = all.into_iter().filter(|address| self.allows(address.ip())).collect();
        allowed.truncate(MOST_ADDRESSES);
        if allowed.is_empty() { Err(Fault::PrivateAddress) } else { Ok(allowed) }
    }

    fn allows(self, ip: IpAddr) -> bool {
        match self {
            Self::Anywhere => true,
            Self::Private => is_public(ip) || is_private(ip),
            Self::Public => is_public(ip),
        }
    }
}

/// Whether an address is one of a private network or of this machine. Link-local ones are not: what answers there is the
/// machine's surroundings, such as the metadata of a cloud, and nobody's receiver.
fn is_private(ip: IpAddr) -> bool {
    match ip.to_canonical() {
        IpAddr::V4(ip) => ip.is_private() || ip.is_loopback() || is_shared(ip),
        IpAddr::V6(ip) => ip.is_loopback() || ip.is_unique_local(),
    }
}

/// Whether an address is anybody's.
fn is_public(ip: IpAddr) -> bool {
    match ip.to_canonical() {
        IpAddr::V4(ip) => is_public_v4(ip),
        IpAddr::V6(ip) => is_public_v6(ip),
    }
}

fn is_public_v4(ip: Ipv4Addr) -> bool {
    let [a, b, c, _] = ip.octets();
    let is_special = a == 0                              // this network
        || ip.is_private()
        || ip.is_loopback()
        || is_shared(ip)
        || ip.is_link_local()
        || (a, b, c) == (192, 0, 0)                      // protocol assignments
        || ip.is_documentation()
        || (a, b, c) == (192, 88, 99)                    // relays of 6to4
        || (a == 198 && (18..=19).contains(&b))          // benchmarks
        || a >= 224; // multicast, reserved, broadcast
    !is_special
}

/// 100.64.0.0/10: behind the address of a provider (RFC 6598).
fn is_shared(ip: Ipv4Addr) -> bool {
    let [a, b, ..] = ip.octets();
    a == 100 && (64..128).contains(&b)
}

/// Global unicast, without what stands for an address of the older kind or for none.
fn is_public_v6(ip: Ipv6Addr) -> bool {
    let [a, b, ..] = ip.segments();
    (0x2000..0x4000).contains(&a)
        && a != 0x2002                                   // 6to4: an older address is inside
        && !(a == 0x2001 && b < 0x0200)                  // Teredo and protocol assignments
        && !(a == 0x2001 && b == 0x0db8)                 // documentation
        && !(a == 0x3fff && b < 0x1000) // documentation
}

/// The host of an address as it is compared: a name in lower case, an IP address in its one form.
pub(crate) fn host_of(url: &Url) -> Option<&str> {
    url.host_str().map(|host| host.strip_suffix('.').unwrap_or(host))
}

/// The port of an address.
pub(crate) fn port_of(url: &Url) -> u16 {
    url.port_or_known_default().unwrap_or(443)
}

/// Host and port of an address.
pub(crate) fn place_of(url: &Url) -> String {
    format!("{}:{}", host_of(url).unwrap_or_default(), port_of(url))
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    #[test]
    fn an_address_is_public_private_or_neither() {
        for (address, public, private) in [
            ("8.8.8.8", true, false),
            ("100.63.255.255", true, false),
            ("198.20.0.1", true, false),
            ("2a00:1450:4001::1", true, false),
            ("10.1.2.3", false, true),
            ("172.16.0.1", false, true),
            ("192.168.1.1", false, true),
            ("100.64.0.1", false, true),
            ("127.0.0.1", false, true),
            ("127.8.8.8", false, true),
            ("::1", false, true),
            ("fd12::1", false, true),
            // An older address inside a newer one is what it is.
            ("::ffff:127.0.0.1", false, true),
            ("::ffff:8.8.8.8", true, false),
            ("::ffff:169.254.169.254", false, false),
            ("169.254.169.254", false, false),
            ("fe80::1", false, false),
            ("0.0.0.0", false, false),
            ("0.1.2.3", false, false),
            ("::", false, false),
            ("::127.0.0.1", false, false),
            ("64:ff9b::7f00:1", false, false),
            ("2002:7f00:1::", false, false),
            ("2001:0:4136:e378::", false, false),
            ("224.0.0.1", false, false),
            ("255.255.255.255", false, false),
            ("240.0.0.1", false, false),
            ("192.0.0.170", false, false),
            ("198.18.0.1", false, false),
            ("203.0.113.7", false, false),
            ("2001:db8::1", false, false),
            ("ff02::1", false, false),
        ] {
            let ip: IpAddr = address.parse().unwrap();
            assert_eq!((is_public(ip), is_private(ip)), (public, private), "{address}");
            assert_eq!(Reach::Public.allows(ip), public, "{address}");
            assert_eq!(Reach::Private.allows(ip), public || private, "{address}");
            assert!(Reach::Anywhere.allows(ip));
        }
    }

    #[tokio::test]
    async fn whichever_way_an_address_is_written_it_is_looked_at() {
        for url in [
            "http://127.0.0.1/",
            "http://2130706433/",
            "http://0x7f.1/",
            "http://0177.0.0.1/",
            "http://127.1/",
            "http://[::1]/",
            "http://[::ffff:7f00:1]/",
            "http://localhost/",
        ] {
            let url = Url::parse(url).unwrap();
            assert_eq!(Reach::Public.addresses(&url).await, Err(Fault::PrivateAddress), "{url}");
            assert!(Reach::Private.addresses(&url).await.is_ok(), "{url}");
        }
        let url = Url::parse("http://169.254.169.254/").unwrap();
        assert_eq!(Reach::Private.addresses(&url).await, Err(Fault::PrivateAddress));
        let url = Url::parse("http://nobody.invalid/").unwrap();
        assert_eq!(Reach::Private.addresses(&url).await, Err(Fault::NoAddress));
    }
}
