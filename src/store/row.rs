//! A result as a row: compressed, with a checksum.

use std::io;

use bytes::Bytes;
use zstd::zstd_safe::CParameter;

use super::KeptResult;
use crate::key::Key;

/// Fast: answers shrink to a quarter anyway, and nobody waits less for the rest.
const LEVEL: i32 = 1;
/// Shortest repetition that is looked for. Answers are digits, where shorter ones are chance: without them an answer
/// stays within 3 % of its size and takes three quarters of the time.
const LEAST_MATCH: u32 = 7;

/// Makes rows, one after the other in the same workspace: setting one up costs as much as a small answer.
pub(super) struct Packer(zstd::bulk::Compressor<'static>);

impl Packer {
    pub(super) fn new() -> io::Result<Self> {
        let mut compressor = zstd::bulk::Compressor::new(LEVEL)?;
        compressor.set_parameter(CParameter::MinMatch(LEAST_MATCH))?;
        Ok(Self(compressor))
    }

    pub(super) fn row(&mut self, result: &KeptResult) -> io::Result<ResultRow> {
        let mut row = ResultRow {
            key: result.key.as_bytes().to_vec(),
            calculator: result.calculator.clone(),
            version: result.version,
            engine: result.engine.clone(),
            input: self.0.compress(&result.input)?,
            body: self.0.compress(&result.body)?,
            checksum: Vec::new(),
            records: result.records.clone(),
        };
        row.checksum = row.sum().to_vec();
        Ok(row)
    }
}

/// The columns that hold the result itself.
#[derive(Debug, Clone, PartialEq)]
pub(super) struct ResultRow {
    pub(super) key: Vec<u8>,
    pub(super) calculator: String,
    pub(super) version: u32,
    pub(super) engine: String,
    pub(super) input: Vec<u8>,
    pub(super) body: Vec<u8>,
    pub(super) checksum: Vec<u8>,
    /// Follows from the input, and is no part of the checksum.
    pub(super) records: String,
}

from_row!(ResultRow { key, calculator, version as i32, engine, input, body, checksum, records });

impl ResultRow {
    /// What it takes of the disk, about.
    pub(super) fn bytes(&self) -> i64 {
        /// Key, checksum, names, times and their copies in the indices.
        const REST: usize = 300;
        i64::try_from(self.input.len() + self.body.len() + self.records.len() + REST).unwrap_or(i64::MAX)
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
            records: self.records,
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
