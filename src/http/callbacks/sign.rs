//! Signatures as Standard Webhooks has them: HMAC-SHA256 of name, time and body under a secret that both sides have.

use std::collections::HashMap;
use std::fmt;
use std::path::{Path, PathBuf};

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use hmac::{Hmac, KeyInit, Mac};
use sha2::Sha256;

use crate::config;

/// What every secret begins with.
const PREFIX: &str = "whsec_";
/// Lengths of a secret, bytes.
const BYTES: std::ops::RangeInclusive<usize> = 24..=64;
/// Secrets of one file: the one in force, and the one that is being replaced.
const MOST: usize = 2;

/// Where the secrets are.
pub(super) struct Secrets {
    file: PathBuf,
    of_owners: HashMap<String, PathBuf>,
}

/// A secret. It is shown nowhere.
pub(super) struct Secret(Vec<u8>);

impl fmt::Debug for Secret {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("Secret(hidden)")
    }
}

impl Secrets {
    pub(super) fn new(settings: &config::Callbacks) -> Self {
        let own = |one: &config::OwnerSecret| (format!("key:{}", one.owner), PathBuf::from(&one.secret_file));
        Self { file: PathBuf::from(&settings.secret_file), of_owners: settings.owners.iter().map(own).collect() }
    }

    /// Those that sign for an owner. Read anew each time, so that a secret is replaced without a restart.
    pub(super) async fn of(&self, owner: &str) -> Result<Vec<Secret>, String> {
        let file = self.of_owners.get(owner).unwrap_or(&self.file);
        read(file, tokio::fs::read_to_string(file).await)
    }

    /// Whether all of them can be read.
    pub(super) fn check(&self) -> Result<(), String> {
        std::iter::once(&self.file)
            .chain(self.of_owners.values())
            .try_for_each(|file| read(file, std::fs::read_to_string(file)).map(drop))
    }
}

fn read(file: &Path, text: std::io::Result<String>) -> Result<Vec<Secret>, String> {
    let fault = |what: &str| format!("the secret of callbacks in {}: {what}", file.display());
    secrets(&text.map_err(|error| fault(&error.to_string()))?).map_err(fault)
}

/// What a file of secrets says. A fault names no part of it.
fn secrets(text: &str) -> Result<Vec<Secret>, &'static str> {
    let lines: Vec<&str> = text.lines().map(str::trim).filter(|line| !line.is_empty()).collect();
    if !(1..=MOST).contains(&lines.len()) {
        return Err("one line is needed, or two while a secret is replaced");
    }
    let secret = |line: &&str| {
        let bytes = line.strip_prefix(PREFIX).and_then(|rest| STANDARD.decode(rest).ok());
        let bytes = bytes.filter(|bytes| BYTES.contains(&bytes.len()));
        bytes
            .map(Secret)
            .ok_or("a secret is whsec_ and 24 to 64 bytes in base64, such as `openssl rand -base64 32` prints")
    };
    lines.iter().map(secret).collect()
}

/// The header `webhook-signature`: one signature for each secret.
pub(super) fn signatures(secrets: &[Secret], id: &str, timestamp_s: i64, body: &[u8]) -> String {
    let signature = |secret: &Secret| {
        let mut mac = Hmac::<Sha256>::new_from_slice(&secret.0).expect("a key of any length is one");
        mac.update(format!("{id}.{timestamp_s}.").as_bytes());
        mac.update(body);
        format!("v1,{}", STANDARD.encode(mac.finalize().into_bytes()))
    };
    secrets.iter().map(signature).collect::<Vec<_>>().join(" ")
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;

    #[test]
    fn a_signature_is_the_one_of_the_standard() {
        // The example of Standard Webhooks.
        let secret = secrets("whsec_MfKQ9r8GKYqrTwjUPD8ILPZIo2LaLaSw\n").unwrap();
        let signed = |secrets: &[Secret]| {
            let body = br#"{"test": 2432232314}"#;
            signatures(secrets, "msg_p5jXN8AQM9LWM0D4loKWxJek", 1_614_265_330, body)
        };
        assert_eq!(signed(&secret), "v1,g0hM9SsE+OTPJTGt/tmIKtSyZlE3uFJELVlNIOLJ1OE=");
        let other = format!("whsec_{}", STANDARD.encode([7; 32]));
        let two = secrets(&format!("{other}\n\n  whsec_MfKQ9r8GKYqrTwjUPD8ILPZIo2LaLaSw")).unwrap();
        assert_eq!(signed(&two).split(' ').nth(1), Some("v1,g0hM9SsE+OTPJTGt/tmIKtSyZlE3uFJELVlNIOLJ1OE="));
        assert_eq!(format!("{secret:?}"), "[Secret(hidden)]");
    }

    #[test]
    fn what_is_no_secret_is_refused_without_being_shown() {
        let short = format!("whsec_{}", STANDARD.encode([7; 23]));
        let long = format!("whsec_{}", STANDARD.encode([7; 65]));
        let good = format!("whsec_{}", STANDARD.encode([7; 24]));
        assert!(secrets(&good).is_ok());
        let three = [good.as_str(); 3].join("\n");
        for bad in ["", "\n", "whsec_", "whsec_!!", "a plain word that somebody chose", &short, &long, &three] {
            let fault = secrets(bad).unwrap_err();
            assert!(bad.len() < 7 || !fault.contains(bad), "{fault}");
        }
    }
}
