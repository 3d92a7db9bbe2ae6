//! The bytes of an answer: what every answer has in common around a result. Nothing volatile stands in it.

use std::io::Write;

use precut_calc::calculator::Failure;
use serde::Serialize;
use serde_json::Value;

use super::key::ENGINE_VERSION;
use super::read::Ready;
use crate::registry::{ComputedResult, non_finite_place};
use crate::text::{Language, Notice, Remark, Texts};

/// The envelope of a computed result, in English.
pub(crate) fn write(ready: &Ready, computed: &ComputedResult) -> Result<Vec<u8>, Failure> {
    let meta = ready.entry.meta();
    let input = ready.echo();
    let effects = input.get("effects").cloned().unwrap_or_else(|| Value::Array(Vec::new()));
    let texts = Texts::shared();
    let explanation: Vec<Remark> =
        computed.explanation.iter().map(|message| texts.remark(Language::En, message)).collect();
    let warnings: Vec<Notice> =
        computed.warnings.iter().map(|finding| texts.notice(Language::En, "warning", finding)).collect();
    if let Some(place) = non_finite_place(&explanation).or_else(|| non_finite_place(&warnings)) {
        return Err(Failure::Internal(format!("a remark of {} is not finite at {place}", meta.id)));
    }
    let mut body = Vec::with_capacity(computed.result.len() + ready.canonical.len() + 1024);
    let parts: [(&str, &dyn Part); 10] = [
        ("calculator", &meta.id),
        ("version", &meta.version),
        ("engine", &ENGINE_VERSION),
        ("key", &ready.key.to_string()),
        ("input", &input),
        ("effects", &effects),
        ("result", &Raw(&computed.result)),
        ("explanation", &explanation),
        ("warnings", &warnings),
        ("basis", &computed.basis),
    ];
    for (index, (name, part)) in parts.into_iter().enumerate() {
        let joint = if index == 0 { '{' } else { ',' };
        write!(body, "{joint}\"{name}\":").map_err(unwritable)?;
        part.append(&mut body)?;
    }
    body.push(b'}');
    Ok(body)
}

/// A value of the envelope.
trait Part {
    fn append(&self, body: &mut Vec<u8>) -> Result<(), Failure>;
}

impl<T: Serialize> Part for T {
    fn append(&self, body: &mut Vec<u8>) -> Result<(), Failure> {
        serde_json::to_writer(body, self).map_err(unwritable)
    }
}

/// JSON that is written already.
struct Raw<'a>(&'a [u8]);

impl Part for Raw<'_> {
    fn append(&self, body: &mut Vec<u8>) -> Result<(), Failure> {
        body.extend_from_slice(self.0);
        Ok(())
    }
}

fn unwritable(error: impl std::fmt::Display) -> Failure {
    Failure::Internal(format!("the envelope: {error}"))
}
