//! Who asks: optional bearer keys, of which only the hashes are known here.

use axum::http::HeaderMap;
use axum::http::header::AUTHORIZATION;

use crate::config;

/// The keys that open the service.
pub(super) struct Keys(Vec<(String, blake3::Hash)>);

impl Keys {
    /// Those of a configuration that was checked.
    pub(super) fn new(auth: &config::Auth) -> Self {
        let parse = |key: &config::ApiKey| Some((key.name.clone(), blake3::Hash::from_hex(&key.hash).ok()?));
        Self(auth.keys.iter().filter_map(parse).collect())
    }

    /// Whether a key is needed at all.
    pub(super) fn required(&self) -> bool {
        !self.0.is_empty()
    }

    /// Whose key the request carries. Takes the same time whichever key it is, and whether it is one.
    pub(super) fn owner(&self, headers: &HeaderMap) -> Option<&str> {
        if self.0.is_empty() {
            return None;
        }
        let (scheme, token) = headers.get(AUTHORIZATION)?.to_str().ok()?.split_once(' ')?;
        if !scheme.eq_ignore_ascii_case("bearer") {
            return None;
        }
        let sent = hash(token.trim());
        // `blake3::Hash` compares in constant time; every key is compared.
        self.0.iter().fold(None, |found, (name, known)| if *known == sent { Some(name.as_str()) } else { found })
    }
}

/// The hash under which a key stands in the configuration.
pub fn hash(key: &str) -> blake3::Hash {
    blake3::hash(key.as_bytes())
}
