//! Numbers of which some may be infinite or none at all, which JSON does not have.

use serde::de::Error;
use serde::{Deserialize, Deserializer, Serialize, Serializer};

pub(crate) fn serialize<S: Serializer, const N: usize>(all: &[f64; N], serializer: S) -> Result<S::Ok, S::Error> {
    all.map(f64::to_bits).to_vec().serialize(serializer)
}

pub(crate) fn deserialize<'de, D: Deserializer<'de>, const N: usize>(deserializer: D) -> Result<[f64; N], D::Error> {
    let all: [u64; N] = Vec::deserialize(deserializer)?.try_into().map_err(|_| D::Error::custom("other numbers"))?;
    Ok(all.map(f64::from_bits))
}
