//! What a record may say: its fields, each declared once.
//!
//! From the declarations follow the schema ([`schema()`]), what a short or foreign spelling stands for ([`settle()`]), and
//! which fields are numbers ([`numbers`]). Rules between fields are in [`faults`].

mod field;
mod machine;
mod material;
mod part;
mod rules;
mod schema;
mod settle;
mod tool;
mod view;

pub use field::{Field, Form, Quantity};
pub use rules::faults;
pub use schema::schema;
pub use settle::settle;
pub use tool::ISO_13399;
pub use view::{Number, numbers, pointer_parts};

use serde::{Deserialize, Serialize};
use serde_json::Value;
use utoipa::ToSchema;

/// Largest record as JSON, bytes.
pub const MAX_BYTES: usize = 256 * 1024;

/// What a record describes.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize, ToSchema)]
#[serde(rename_all = "snake_case")]
pub enum Kind {
    /// A lathe or a mill.
    Machine,
    /// An insert in its holder, a bar, a cutter.
    Tool,
    /// A work material.
    Material,
    /// A part of a job, such as a shaft. No job names it: whoever writes a job begins with it.
    Part,
}

impl Kind {
    /// All of them.
    pub const ALL: [Self; 4] = [Self::Machine, Self::Tool, Self::Material, Self::Part];
    /// Those that jobs name.
    pub const NAMED: [Self; 3] = [Self::Machine, Self::Tool, Self::Material];

    /// Its place in [`Self::ALL`].
    pub const fn place(self) -> usize {
        self as usize
    }

    /// Its word; the field of a job that names one.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Machine => "machine",
            Self::Tool => "tool",
            Self::Material => "material",
            Self::Part => "part",
        }
    }

    /// The resource, and the list in a file of records.
    pub const fn plural(self) -> &'static str {
        match self {
            Self::Machine => "machines",
            Self::Tool => "tools",
            Self::Material => "materials",
            Self::Part => "parts",
        }
    }

    /// Code of the fault that there is none of a name.
    pub const fn unknown(self) -> &'static str {
        match self {
            Self::Machine => "unknown_machine",
            Self::Tool => "unknown_tool",
            Self::Material => "unknown_material",
            Self::Part => "unknown_part",
        }
    }

    /// The fields of such a record.
    pub const fn fields(self) -> &'static [Field] {
        match self {
            Self::Machine => machine::FIELDS,
            Self::Tool => tool::FIELDS,
            Self::Material => material::FIELDS,
            Self::Part => part::FIELDS,
        }
    }

    /// The field that lists are filtered by.
    pub const fn class(self) -> &'static str {
        match self {
            Self::Machine | Self::Tool => "kind",
            Self::Material => "iso513_group",
            Self::Part => "field",
        }
    }

    /// Whether its numbers say where they are from. Those of a part stand as a job has them.
    pub const fn has_sources(self) -> bool {
        !matches!(self, Self::Part)
    }
}

/// A record that keeps to its schema: what is settled by [`settle()`] and has no [`faults`].
#[derive(Debug, Clone, PartialEq)]
pub struct Record {
    /// What it describes.
    pub kind: Kind,
    /// Its name: `[a-z0-9][a-z0-9_-]{0,63}`.
    pub name: String,
    /// Its fields, without the name.
    pub value: Value,
}

impl Record {
    /// The text of a field of the record itself.
    pub fn text(&self, field: &str) -> Option<&str> {
        self.value.get(field)?.as_str()
    }

    /// The number at the end of a path of fields.
    pub fn number(&self, path: &[&str]) -> Option<Number<'_>> {
        Number::of(path.iter().try_fold(&self.value, |value, name| value.get(name))?)
    }

    /// The word at the end of a path of fields, with source and certainty as a number has them.
    pub fn word(&self, path: &[&str]) -> Option<&str> {
        path.iter().try_fold(&self.value, |value, name| value.get(name))?.get("value")?.as_str()
    }

    /// The rows of a list.
    pub fn rows(&self, field: &str) -> &[Value] {
        self.value.get(field).and_then(Value::as_array).map_or(&[], Vec::as_slice)
    }

    /// All names of a material: its own, and those of the standards.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        let standards = self.value.get("names").and_then(Value::as_object).into_iter().flat_map(|names| names.values());
        let of_standards = standards.filter_map(Value::as_array).flatten().filter_map(Value::as_str);
        std::iter::once(self.name.as_str()).chain(of_standards)
    }
}

/// Whether a text can name a record.
pub fn is_name(text: &str) -> bool {
    let plain = |byte: u8| byte.is_ascii_lowercase() || byte.is_ascii_digit();
    (1..=64).contains(&text.len())
        && text.bytes().next().is_some_and(plain)
        && text.bytes().all(|byte| plain(byte) || byte == b'_' || byte == b'-')
}
