//! The address of an answer.

use std::fmt;
use std::str::FromStr;
use std::sync::LazyLock;

use precut_calc::calculator::Meta;
use precut_calc::material;

/// Version of this crate; stands in every answer.
pub const ENGINE_VERSION: &str = env!("CARGO_PKG_VERSION");

/// The address of an answer: a hash of everything that its numbers depend on. Printed `b3:{64 hex digits}`.
#[derive(Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord)]
pub struct Key([u8; 32]);

/// A text that is no key.
#[derive(Debug, Clone, Copy, PartialEq, Eq, thiserror::Error)]
#[error("a key is `b3:` and 64 hexadecimal digits")]
pub struct BadKey;

impl Key {
    /// The key of a calculator's filled job in canonical JSON (RFC 8785):
    /// `BLAKE3("precut-cache-1\n" name 0 version 0 engine 0 job)`. The separators occur in no part before the job.
    ///
    /// Where the numbers are another calculator's (`numbers_of`), its name and version stand before the job, too.
    pub(crate) fn of(meta: &Meta, numbers_of: Option<&Meta>, canonical_job: &[u8]) -> Self {
        let mut hasher = blake3::Hasher::new();
        hasher.update(b"precut-cache-1\n");
        for part in [meta.id, &meta.version.to_string(), &ENGINE_FINGERPRINT] {
            hasher.update(part.as_bytes()).update(&[0]);
        }
        if let Some(meta) = numbers_of {
            hasher.update(meta.id.as_bytes()).update(&[0]).update(meta.version.to_string().as_bytes()).update(&[0]);
        }
        hasher.update(canonical_job);
        Self(*hasher.finalize().as_bytes())
    }

    /// The key of a shard as a job: `BLAKE3("precut-shard-1\n" key number)`, the number as four bytes, the highest first.
    pub(crate) fn of_shard(parent: &Self, number: u32) -> Self {
        let mut hasher = blake3::Hasher::new();
        hasher.update(b"precut-shard-1\n").update(&parent.0).update(&number.to_be_bytes());
        Self(*hasher.finalize().as_bytes())
    }

    /// A key from its 32 bytes.
    pub(crate) fn from_bytes(bytes: &[u8]) -> Option<Self> {
        bytes.try_into().ok().map(Self)
    }

    /// The 32 bytes.
    pub const fn as_bytes(&self) -> &[u8; 32] {
        &self.0
    }
}

/// What of the engine the numbers depend on: its version and the data built into it.
static ENGINE_FINGERPRINT: LazyLock<String> =
    LazyLock::new(|| format!("{ENGINE_VERSION}+{}", data_fingerprint().to_hex()));

/// Hash of the data tables built into the engine: a changed material makes new keys.
fn data_fingerprint() -> blake3::Hash {
    let mut hasher = blake3::Hasher::new();
    let materials = serde_json::to_writer(&mut hasher, material::library());
    materials.expect("plain data with text keys serialises, and a hasher takes everything");
    hasher.finalize()
}

impl fmt::Display for Key {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "b3:{}", blake3::Hash::from_bytes(self.0).to_hex())
    }
}

impl fmt::Debug for Key {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(self, f)
    }
}

impl FromStr for Key {
    type Err = BadKey;
    fn from_str(text: &str) -> Result<Self, BadKey> {
        // One key, one spelling: it is an address.
        let digits = text.strip_prefix("b3:").filter(|text| !text.contains(char::is_uppercase)).ok_or(BadKey)?;
        blake3::Hash::from_hex(digits).map(|hash| Self(*hash.as_bytes())).map_err(|_| BadKey)
    }
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use super::*;
    use crate::registry::toy;

    #[test]
    fn a_key_is_read_back_from_its_text() {
        let registry = toy::registry();
        let key = Key::of(registry.entry("toy-bar").unwrap().meta(), None, b"{}");
        assert_eq!(key.to_string().parse(), Ok(key));
        assert_eq!(key.to_string().len(), 67);
        let capitals = format!("b3:{}", key.to_string()[3..].to_uppercase());
        for bad in ["", "b3:", "b3:00", &key.to_string()[3..], &format!("{key}0"), "b2:00", &capitals] {
            assert_eq!(bad.parse::<Key>(), Err(BadKey), "{bad}");
        }
    }

    #[test]
    fn name_and_version_are_part_of_the_key() {
        let meta = *toy::registry().entry("toy-bar").unwrap().meta();
        let key = |id, version| Key::of(&Meta { id, version, ..meta }, None, b"{}");
        assert_ne!(key("toy-bar", 1), key("toy-bar", 2));
        assert_ne!(key("toy-bar", 1), key("toy-baz", 1));
        assert_ne!(key("toy-bar", 11), key("toy-bar1", 1));
        let other = |version| Meta { version, ..meta };
        assert_ne!(Key::of(&meta, Some(&other(1)), b"{}"), Key::of(&meta, Some(&other(2)), b"{}"));
        assert_ne!(Key::of(&meta, Some(&other(1)), b"{}"), Key::of(&meta, None, b"{}"));
    }
}
