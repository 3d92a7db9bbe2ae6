//! How a field of a record is declared.

/// A field of a record or of a part of one.
#[derive(Debug, Clone, Copy)]
pub struct Field {
    /// Its name; a number's unit stands at the end.
    pub name: &'static str,
    /// What stands there.
    pub form: Form,
    /// Whether a record without it is none.
    pub required: bool,
    /// What it means.
    pub about: &'static str,
}

/// What stands in a field.
#[derive(Debug, Clone, Copy)]
pub enum Form {
    /// `{value, source, certainty, ...}`; a bare number on input.
    Number(Quantity),
    /// A number of a row that has source and certainty as a whole.
    Plain(Quantity),
    /// One of these words.
    Word(&'static [&'static str]),
    /// `{value, source, certainty}` with a word for a value, one of these where there are any; a bare word on input.
    SourcedWord(&'static [&'static str]),
    /// A text of so many characters at most.
    Text(usize),
    /// Texts, each with so many characters at most.
    Texts(usize),
    /// Fields of a part.
    Group(&'static [Field]),
    /// Rows, so many at most; each has `source` and `certainty` beside its fields.
    Rows(&'static [Field], usize),
    /// Entries that are no numbers, so many at most.
    List(&'static [Field], usize),
    /// Numbers by names that the user chooses.
    Named(Quantity),
    /// Texts by names that the user chooses.
    NamedTexts,
    /// A model of the tool life in the form of a feed schedule's `models/tool_life`.
    Model,
    /// What stands in a field of a job.
    OfJob,
}

/// A physical quantity: unit, symbol and the range that makes sense.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Quantity {
    /// Unit as in the contract.
    pub unit: &'static str,
    /// Symbol in the documentation of the physics.
    pub symbol: &'static str,
    /// Least value.
    pub least: f64,
    /// Largest value.
    pub largest: f64,
    /// A typical value.
    pub example: f64,
    /// Whether only whole numbers make sense.
    pub whole: bool,
}

/// A quantity between two ends.
pub(super) const fn quantity(unit: &'static str, symbol: &'static str, ends: (f64, f64), example: f64) -> Quantity {
    Quantity { unit, symbol, least: ends.0, largest: ends.1, example, whole: false }
}

/// A count between two ends.
pub(super) const fn count(symbol: &'static str, ends: (f64, f64), example: f64) -> Quantity {
    Quantity { unit: "1", symbol, least: ends.0, largest: ends.1, example, whole: true }
}

/// A field that may be left out.
pub(super) const fn field(name: &'static str, form: Form, about: &'static str) -> Field {
    Field { name, form, required: false, about }
}

/// A field that must be there.
pub(super) const fn needed(name: &'static str, form: Form, about: &'static str) -> Field {
    Field { name, form, required: true, about }
}

/// `title`, which every record may have.
pub(super) const TITLE: Field = field("title", Form::Text(200), "A few words for a list.");
/// `note`, which every record may have.
pub(super) const NOTE: Field = field("note", Form::Text(10_000), "Free text; never computed with.");
/// `tags`, which every record may have.
pub(super) const TAGS: Field = field("tags", Form::Texts(64), "Words to find it by; never computed with.");
/// `note` of a row.
pub(super) const ROW_NOTE: Field = field("note", Form::Text(1000), "What is to be known of the row.");

/// For which materials a number was stated.
pub(super) const HOLDS_FOR: &[&str] = &["material", "material_class", "vdi3323_group"];
/// How a number was found.
pub(super) const DETERMINED_BY: &[&str] = &["measured", "catalogue", "preset", "diagnosis"];
/// Groups of ISO 513.
pub(super) const GROUPS: &[&str] = &["P", "M", "K", "N", "S", "H"];
