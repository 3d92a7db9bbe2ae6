//! A part of a job that is kept as one's own.

use super::Field;
use super::field::{Form, NOTE, TAGS, TITLE, needed};

pub(super) const FIELDS: &[Field] = &[
    TITLE,
    needed("field", Form::Text(64), "The field of a job where it stands, as shaft."),
    needed(
        "type",
        Form::Text(128),
        "The type of that field in the contract, of its items where it is a list, as Shaft.",
    ),
    needed("value", Form::OfJob, "What stands there."),
    NOTE,
    TAGS,
];
