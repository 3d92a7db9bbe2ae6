//! A result as a row: compressed, with a checksum.

use std::io;

use bytes::Bytes;
use sqlx::FromRow;

use super::KeptResult;
use crate::engine::Key;

/// Fast: answers shrink to a fifth anyway, and nobody waits less for the rest.
const LEVEL: i32 = 1;

/// The columns that hold the result itself.
#[derive(Debug, Clone, PartialEq, FromRow)]
pub(super) struct ResultRow {
    pub(super) key: Vec<u8>,
    pub(super) calculator: String,
    pub(super) version: u32,
    pub(super) engine: String,
    pub(super) input: Vec<u8>,
    pub(super) body: Vec<u8>,
    pub(super) checksum: Vec<u8>,
}

impl ResultRow {
    pub(super) fn of(result: &KeptResult) -> io::Result<Self> {
        let mut row = Self {
            key: result.key.as_bytes().to_vec(),
            calculator: result.calculator.clone(),
            version: result.version,
            engine: result.engine.clone(),
            input: zstd::encode_all(&*result.input, LEVEL)?,
            body: zstd::encode_all(&*result.body, LEVEL)?,
            checksum: Vec::new(),
        };
        row.checksum = row.sum().to_vec();
        Ok(row)
    }

    /// What it takes of the disk, about.
    pub(super) fn bytes(&self) -> i64 {
        /// Key, checksum, names, times and their copies in the indices.
        const REST: usize = 300;
        i64::try_from(self.input.len() + self.body.len() + REST).unwrap_or(i64::MAX)
    }

    /// The result; `None` if a bit has changed since it was written.
    pub(super) fn result(self) -> Option<KeptResult> {
        if self.checksum != self.sum() {
            return None;
        }
        Some(KeptResult {
            key: Key::from_bytes(&self.key)?,
            input: Bytes::from(zstd::decode_all(&*self.input).ok()?),
            body: Bytes::from(zstd::decode_all(&*self.body).ok()?),
            calculator: self.calculator,
            version: self.version,
            engine: self.engine,
        })
    }

    fn sum(&self) -> [u8; 32] {
        let mut hasher = blake3::Hasher::new();
        let version = self.version.to_le_bytes();
        let parts = [&self.key, self.calculator.as_bytes(), &version, self.engine.as_bytes(), &self.input, &self.body];
        for part in parts {
            hasher.update(&(part.len() as u64).to_le_bytes()).update(part);
        }
        *hasher.finalize().as_bytes()
    }
}
