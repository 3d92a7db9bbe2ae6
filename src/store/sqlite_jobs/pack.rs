//! What is large of a job, compressed before it waits for the disk.

use std::io;

use crate::key::Key;
use crate::store::StoreError;
use crate::store::jobs::{Ending, NewJob};
use crate::store::row::{Packer, ResultRow};

/// Inputs and results up to this size are packed where they are, larger ones on a thread that may block.
const PACK_AT_ONCE: usize = 64 << 10;
/// Fast: a job's input is read once or never.
const LEVEL: i32 = 1;

/// A job with its input packed, to be written.
pub(in crate::store) struct Packed {
    pub(in crate::store) job: NewJob,
    pub(in crate::store) input: Vec<u8>,
    pub(in crate::store) result: Option<ResultRow>,
}

pub(in crate::store) async fn packed(job: NewJob) -> Result<Packed, StoreError> {
    let size = job.input.len() + job.result.as_ref().map_or(0, |result| result.body.len() + result.input.len());
    let pack = move || -> io::Result<Packed> {
        let input = zstd::bulk::compress(&job.input, LEVEL)?;
        let result = job.result.as_ref().map(|result| Packer::new()?.row(result)).transpose()?;
        Ok(Packed { job, input, result })
    };
    blocking(size, pack).await
}

pub(in crate::store) async fn packed_ending(ending: Ending) -> Result<PackedEnding, StoreError> {
    match ending {
        Ending::Failed(problem) => Ok(PackedEnding::Failed(problem)),
        Ending::Shard(content) => {
            let pack = move || {
                let mut packer = zstd::bulk::Compressor::new(LEVEL)?;
                // What is damaged is not taken for what the shard came to.
                packer.include_checksum(true)?;
                packer.compress(&content)
            };
            blocking(0, pack).await.map(PackedEnding::Shard)
        }
        Ending::Succeeded(result) => {
            let size = result.body.len() + result.input.len();
            blocking(size, move || Packer::new()?.row(&result)).await.map(PackedEnding::Succeeded)
        }
    }
}

pub(in crate::store) enum PackedEnding {
    Succeeded(ResultRow),
    Shard(Vec<u8>),
    Failed(String),
}

impl PackedEnding {
    /// Address of its result.
    pub(in crate::store) fn key(&self) -> Option<Key> {
        match self {
            Self::Succeeded(result) => Key::from_bytes(&result.key),
            Self::Shard(_) | Self::Failed(_) => None,
        }
    }
}

async fn blocking<T: Send + 'static>(
    size: usize,
    work: impl FnOnce() -> io::Result<T> + Send + 'static,
) -> Result<T, StoreError> {
    let failed = |error: String| StoreError::Failed(error);
    if size <= PACK_AT_ONCE {
        return work().map_err(|error| failed(error.to_string()));
    }
    let done = tokio::task::spawn_blocking(work).await.map_err(|error| failed(error.to_string()))?;
    done.map_err(|error| failed(error.to_string()))
}
