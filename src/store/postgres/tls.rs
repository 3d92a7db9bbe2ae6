//! TLS to the database: what is asked for, looked at before anything is sent, and why it did not come about, in words.
//! Nothing that asks for it is passed over: who believes that the server is checked must not be wrong.

use rustls::CertificateError;
use sqlx::ConnectOptions;
use sqlx::postgres::{PgConnectOptions, PgSslMode};

/// What the address may say of TLS; the environment says the same as PGSSLMODE and so on.
const PARAMETERS: [&str; 4] = ["sslmode", "sslrootcert", "sslcert", "sslkey"];

/// The same options if what they ask for can be done.
pub(super) fn checked(options: PgConnectOptions, address: &str) -> Result<PgConnectOptions, String> {
    if let Some(unknown) = unknown_parameter(address) {
        return Err(format!("the address says {unknown}, which this program does not know; it knows {}", listed()));
    }
    if let Ok(mode) = std::env::var("PGSSLMODE")
        && mode.parse::<PgSslMode>().is_err()
    {
        return Err("PGSSLMODE is none of disable, prefer, require, verify-ca, verify-full".to_owned());
    }
    let files = files(&options);
    for (name, file) in &files {
        readable(name, file)?;
    }
    if !files.iter().any(|(name, _)| name == "sslrootcert") {
        return Ok(options);
    }
    match options.get_ssl_mode() {
        // As the database's own programs do.
        PgSslMode::Require => Ok(options.ssl_mode(PgSslMode::VerifyCa)),
        PgSslMode::Prefer | PgSslMode::Allow => Err(format!(
            "sslrootcert is given, but with sslmode={} no certificate is looked at; say sslmode=verify-full",
            word(options.get_ssl_mode())
        )),
        PgSslMode::Disable | PgSslMode::VerifyCa | PgSslMode::VerifyFull => Ok(options),
    }
}

/// A parameter about TLS that would be passed over.
fn unknown_parameter(address: &str) -> Option<&str> {
    let (_, query) = address.split_once('?')?;
    let names = query.split(['&', '#']).filter_map(|pair| pair.split('=').next());
    let mut names = names.filter(|name| name.starts_with("ssl"));
    names.find(|name| !PARAMETERS.contains(name))
}

fn listed() -> String {
    PARAMETERS.join(", ")
}

/// Files that are named, by what they are, wherever they were named.
fn files(options: &PgConnectOptions) -> Vec<(String, String)> {
    // Only what stands behind the question mark is of interest: nothing before it may make an address impossible.
    let all = options.clone().username("u").host("h").to_url_lossy();
    let files = all.query_pairs().filter_map(|(name, value)| {
        let file = value.strip_prefix("file: ")?;
        PARAMETERS.contains(&name.as_ref()).then(|| (name.to_string(), file.to_owned()))
    });
    files.collect()
}

fn readable(name: &str, file: &str) -> Result<(), String> {
    let text = std::fs::read(file).map_err(|error| format!("{name}: the file {file} cannot be read ({error})"))?;
    if String::from_utf8_lossy(&text).contains("-----BEGIN ") {
        Ok(())
    } else {
        Err(format!("{name}: the file {file} holds nothing in PEM form (-----BEGIN ...)"))
    }
}

const fn word(mode: PgSslMode) -> &'static str {
    match mode {
        PgSslMode::Disable => "disable",
        PgSslMode::Allow => "allow",
        PgSslMode::Prefer => "prefer",
        PgSslMode::Require => "require",
        PgSslMode::VerifyCa => "verify-ca",
        PgSslMode::VerifyFull => "verify-full",
    }
}

/// Whether one of both sides refused the other: waiting does not help.
pub(super) fn is_refusal(error: &std::io::Error) -> bool {
    refusal(error).is_some()
}

fn refusal(error: &std::io::Error) -> Option<&rustls::Error> {
    error.get_ref()?.downcast_ref()
}

/// Why there is no connection, where it is for TLS or for its absence.
pub(super) fn reason(error: &sqlx::Error, options: &PgConnectOptions) -> Option<String> {
    let mode = word(options.get_ssl_mode());
    match error {
        sqlx::Error::Tls(fault) if fault.to_string().contains("does not support TLS") => Some(format!(
            "it offers no TLS, which sslmode={mode} asks for; switch it on there (`ssl = on`), or say sslmode=disable \
             where nobody else can reach the network between"
        )),
        sqlx::Error::Tls(fault) => Some(format!("TLS cannot be set up (sslmode={mode}): {fault}")),
        sqlx::Error::Io(error) => refusal(error).map(|fault| refused(fault, mode)),
        sqlx::Error::Database(fault) if fault.code().as_deref() == Some("28000") => Some(turned_away(mode)),
        _ => None,
    }
}

fn refused(fault: &rustls::Error, mode: &str) -> String {
    let what = match fault {
        rustls::Error::InvalidCertificate(CertificateError::UnknownIssuer) => {
            "the authority that signed it is not trusted here; name the file of its certificate by sslrootcert=FILE"
                .to_owned()
        }
        rustls::Error::InvalidCertificate(CertificateError::NotValidForNameContext { presented, .. }) => {
            format!("it is for another host than the address says: for {}", presented.join(", "))
        }
        rustls::Error::InvalidCertificate(CertificateError::NotValidForName) => {
            "it is for another host than the address says".to_owned()
        }
        rustls::Error::InvalidCertificate(CertificateError::Expired | CertificateError::ExpiredContext { .. }) => {
            "it has expired (or the clock here is wrong)".to_owned()
        }
        rustls::Error::InvalidCertificate(fault) => fault.to_string(),
        rustls::Error::AlertReceived(alert) => {
            return format!("it refused TLS with us (sslmode={mode}): {alert:?}; its log says why");
        }
        other => return format!("TLS with it failed (sslmode={mode}): {other}"),
    };
    format!("its certificate is not accepted (sslmode={mode}): {what}")
}

/// Which of the lines of its access file did not fit, it tells nobody but its own log.
fn turned_away(mode: &str) -> String {
    let encrypted = match mode {
        "disable" | "allow" => {
            format!("; the connection is not encrypted (sslmode={mode}): if it asks for TLS, say sslmode=verify-full")
        }
        _ => "; if it asks for a certificate of ours, name it by sslcert=FILE and sslkey=FILE".to_owned(),
    };
    format!("it does not let this user into this database from here (its pg_hba.conf, its log){encrypted}")
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use std::str::FromStr;

    use super::*;

    fn fault_of(address: &str) -> Result<PgSslMode, String> {
        checked(PgConnectOptions::from_str(address).unwrap(), address).map(|options| options.get_ssl_mode())
    }

    #[test]
    fn what_asks_for_a_check_is_not_passed_over() {
        let folder = tempfile::tempdir().unwrap();
        let file = |name: &str, text: &str| {
            let path = folder.path().join(name).display().to_string();
            std::fs::write(&path, text).unwrap();
            path
        };
        let authority = file("authority", "-----BEGIN CERTIFICATE-----");
        let at = |parameters: &str| fault_of(&format!("postgres://anna:pa55w0rd@db/precut?{parameters}"));
        assert!(matches!(at(&format!("sslmode=require&sslrootcert={authority}")), Ok(PgSslMode::VerifyCa)));
        assert!(matches!(at(&format!("sslmode=verify-full&sslrootcert={authority}")), Ok(PgSslMode::VerifyFull)));
        assert!(matches!(at("sslmode=require"), Ok(PgSslMode::Require)));
        assert!(matches!(at("user=a:b/c"), Ok(PgSslMode::Prefer)), "a strange name is no address of its own");
        for (parameters, words) in [
            (format!("sslrootcert={authority}"), "say sslmode=verify-full"),
            (format!("sslmode=allow&sslrootcert={authority}"), "say sslmode=verify-full"),
            ("ssl_mode=verify-full".to_owned(), "ssl_mode, which this program does not know"),
            ("sslmode=verify-full&sslcrl=x".to_owned(), "sslcrl, which"),
            (format!("sslmode=verify-full&sslrootcert={authority}.absent"), "cannot be read"),
            (format!("sslmode=verify-full&sslrootcert={}", file("empty", "nothing")), "nothing in PEM form"),
            (format!("sslmode=require&sslcert={authority}&sslkey=/absent"), "sslkey: the file /absent"),
        ] {
            let said = at(&parameters).unwrap_err();
            assert!(said.contains(words) && !said.contains("anna") && !said.contains("pa55"), "{said}");
        }
    }
}
