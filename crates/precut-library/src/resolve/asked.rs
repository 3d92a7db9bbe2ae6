//! Which records a job names.

use precut_calc::material;
use serde_json::Value;

use super::kinds::Room;
use crate::record::Kind;

/// A record that a job names.
#[derive(Debug, Clone, PartialEq, Eq)]
pub struct Asked {
    /// What it is to be.
    pub kind: Kind,
    /// Where the job names it.
    pub pointer: String,
    /// The name without its revision.
    pub name: String,
    /// The revision asked for, with `name@3`.
    pub revision: Option<u32>,
}

/// Every record that a job of `calculator` names; none for a calculator that takes no names, and for a job as it was
/// before there were names.
pub fn asked(calculator: &str, job: &Value) -> Vec<Asked> {
    let Some(room) = Room::of(calculator) else { return Vec::new() };
    let mut found = Vec::new();
    for kind in Kind::NAMED.into_iter().filter(|kind| room.takes(*kind)) {
        let Some(value) = job.get(kind.name()) else { continue };
        match value {
            Value::String(name) => push(kind, format!("/{}", kind.name()), name, &mut found),
            Value::Object(fields) => {
                if let Some(Value::String(name)) = fields.get("name") {
                    push(kind, format!("/{}/name", kind.name()), name, &mut found);
                }
            }
            _ => {}
        }
    }
    for place in tools(room, job) {
        if let Some(Value::String(name)) = job.pointer(&place).and_then(|tool| tool.get("name")) {
            push(Kind::Tool, format!("{place}/name"), name, &mut found);
        }
    }
    for part in [room.work(), "force"] {
        let Some(Value::String(name)) = job.get(part).and_then(|part| part.get("material")) else { continue };
        if !found.is_empty() || needs_record(part, job, name) {
            push(Kind::Material, format!("/{part}/material"), name, &mut found);
        }
    }
    found
}

/// The places of the tools that a job names where it describes them.
pub(super) fn tools(room: Room, job: &Value) -> Vec<String> {
    match room {
        Room::Program => {
            let count = job.get("tools").and_then(Value::as_array).map_or(0, Vec::len);
            (0..count).map(|index| format!("/tools/{index}")).collect()
        }
        Room::Cutter => vec!["/cutter".to_owned()],
        _ => Vec::new(),
    }
}

/// Whether the material of a part is for the library: not where the calculator knows it itself.
fn needs_record(part: &str, job: &Value, name: &str) -> bool {
    let asks = |field: &str| job.get("force").is_some_and(|force| force.get(field).is_some());
    let says_more = part == "force" && ["normal_force", "kienzle_row", "source"].into_iter().any(asks);
    says_more || material::find(name).is_none()
}

fn push(kind: Kind, pointer: String, text: &str, found: &mut Vec<Asked>) {
    let plain = |digits: &str| !digits.starts_with('0') && digits.bytes().all(|byte| byte.is_ascii_digit());
    let (name, revision) = match text.rsplit_once('@') {
        Some((name, digits)) if plain(digits) => (name, digits.parse().ok()),
        _ => (text, None),
    };
    found.push(Asked { kind, pointer, name: name.to_owned(), revision });
}
