//! Settings that can be read and make no sense.

use tracing_subscriber::EnvFilter;

use super::{Callbacks, Config, OwnerSecret, Role};

impl Config {
    /// All of them.
    pub(super) fn faults(&self) -> Vec<String> {
        let mut faults = Vec::new();
        self.numbers(&mut faults);
        self.callbacks_and_traces(&mut faults);
        if self.role != Role::All && !self.store.is_shared() {
            faults.push("role: other than \"all\" only with a store that processes share: postgres://...".to_owned());
        }
        if let Err(error) = EnvFilter::builder().parse(&self.log.level) {
            faults.push(format!("log.level = \"{}\": {error}", self.log.level));
        }
        for (index, key) in self.auth.keys.iter().enumerate() {
            if blake3::Hash::from_hex(&key.hash).is_err() {
                faults.push(format!(
                    "auth.keys[{index}].hash (\"{}\"): must be 64 hexadecimal digits, as `precut hash-key` prints them",
                    key.name
                ));
            }
            if key.owner.as_deref().unwrap_or(&key.name).is_empty() {
                faults.push(format!("auth.keys[{index}]: needs a name or an owner"));
            }
        }
        for origin in &self.cors.origins {
            let is_origin = origin.split_once("://").is_some_and(|(scheme, host)| {
                !scheme.is_empty() && !host.is_empty() && !host.contains('/') && host.is_ascii()
            });
            if origin != "*" && !is_origin {
                faults.push(format!("cors.origins: \"{origin}\" is no origin such as https://cam.example.com"));
            }
        }
        faults
    }

    fn numbers(&self, faults: &mut Vec<String>) {
        const ANY: f64 = f64::MAX;
        let (limits, jobs) = (&self.limits, &self.jobs);
        for (name, number, range, must_be) in [
            ("limits.body_timeout_s", limits.body_timeout_s, 0.001..=86_400.0, "0.001 to 86400 s"),
            ("limits.header_timeout_s", limits.header_timeout_s, 0.001..=86_400.0, "0.001 to 86400 s"),
            ("shutdown.grace_s", self.shutdown.grace_s, 0.001..=86_400.0, "0.001 to 86400 s"),
            ("postgres.wait_s", self.postgres.wait_s, 0.001..=86_400.0, "0.001 to 86400 s"),
            ("postgres.connections", self.postgres.connections.into(), 2.0..=1000.0, "2 to 1000"),
            ("limits.requests_per_s", limits.requests_per_s, 0.0..=ANY, "0 or more"),
            ("limits.burst", limits.burst, 1.0..=ANY, "at least 1"),
            ("limits.direct_ms", limits.direct_ms, f64::MIN_POSITIVE..=ANY, "above 0"),
            ("limits.job_ms", limits.job_ms, f64::MIN_POSITIVE..=ANY, "above 0"),
            ("quota.work_s_per_hour", self.quota.work_s_per_hour, 0.0..=ANY, "0 or more"),
            ("jobs.short_ms", jobs.short_ms, 0.0..=ANY, "0 or more"),
            ("jobs.queue", jobs.queue as f64, 1.0..=ANY, "at least 1"),
            ("jobs.days", jobs.days.into(), 1.0..=ANY, "at least 1"),
            ("jobs.streams", jobs.streams as f64, 1.0..=ANY, "at least 1"),
            ("limits.json_bytes", limits.json_bytes as f64, 1.0..=ANY, "at least 1"),
            ("limits.multipart_bytes", limits.multipart_bytes as f64, 1.0..=ANY, "at least 1"),
            ("limits.bodies_bytes", limits.bodies_bytes as f64, 1.0..=ANY, "at least 1"),
            ("limits.connections", limits.connections as f64, 1.0..=ANY, "at least 1"),
            ("limits.connections_per_client", limits.connections_per_client as f64, 1.0..=ANY, "at least 1"),
            ("limits.concurrent_requests", limits.concurrent_requests as f64, 1.0..=ANY, "at least 1"),
            ("callbacks.timeout_s", self.callbacks.timeout_s, 0.1..=60.0, "0.1 to 60 s"),
            ("traces.share", self.traces.share, 0.0..=1.0, "0 to 1"),
        ] {
            if !range.contains(&number) {
                faults.push(format!("{name} = {number}: must be {must_be}"));
            }
        }
    }

    /// Of where the service sends something by itself.
    fn callbacks_and_traces(&self, faults: &mut Vec<String>) {
        let Callbacks { hosts, secret_file, owners, pauses_s, .. } = &self.callbacks;
        for host in hosts {
            if allowed_host(host).is_none() {
                faults.push(format!(
                    "callbacks.hosts: \"{host}\" is no host such as mes.plant.example or mes.plant.example:8443"
                ));
            }
        }
        if !hosts.is_empty() && secret_file.is_empty() {
            faults.push("callbacks.secret_file: has to be given with callbacks.hosts".to_owned());
        }
        for OwnerSecret { owner, secret_file } in owners {
            if owner.is_empty() || secret_file.is_empty() {
                faults.push("callbacks.owners: each needs an owner and a secret_file".to_owned());
            }
        }
        if pauses_s.len() > 30 || !pauses_s.iter().all(|pause| (0.0..=604_800.0).contains(pause)) {
            faults.push("callbacks.pauses_s: must be at most 30 pauses of 0 to 604800 s".to_owned());
        }
        let endpoint = &self.traces.endpoint;
        let is_http = |url: url::Url| matches!(url.scheme(), "http" | "https") && url.has_host();
        if !endpoint.is_empty() && !endpoint.parse().is_ok_and(is_http) {
            faults.push(format!(
                "traces.endpoint = \"{endpoint}\": must be an address such as http://127.0.0.1:4318/v1/traces"
            ));
        }
    }
}

/// A host that may be called, with its port where one is given: as they stand in an address that was read.
pub(crate) fn allowed_host(text: &str) -> Option<(String, Option<u16>)> {
    // The default port of its scheme would not be told from none; no scheme has port 0.
    let url: url::Url = format!("precut://{text}").parse().ok()?;
    let is_bare = url.path().is_empty() && url.query().is_none() && url.fragment().is_none();
    let is_nobodys = url.username().is_empty() && url.password().is_none();
    let port = url.port();
    if !is_bare || !is_nobodys || text.contains(['@', '*']) || text.ends_with(':') {
        return None;
    }
    // A host of a scheme that the web knows is brought into its one form: lower case, Punycode, numbers as addresses.
    let host: url::Url = format!("http://{}", url.host_str()?).parse().ok()?;
    let host = host.host_str()?;
    Some((host.strip_suffix('.').unwrap_or(host).to_owned(), port))
}
