//! Tables that the user measured, as they stand in a job.

use serde::{Deserialize, Deserializer, Serialize, Serializer};
use utoipa::openapi::schema::{ArrayBuilder, ObjectBuilder, OneOfBuilder, SchemaType, Type};
use utoipa::openapi::{RefOr, Schema};
use utoipa::{PartialSchema, ToSchema};

/// A row of a measured table: a plain struct whose fields are its columns, units in their names.
pub trait MeasuredRow: Serialize + for<'de> Deserialize<'de> + ToSchema + Clone + Send + Sync + 'static {
    /// Most rows accepted.
    const MAX_ROWS: usize;
    /// Columns that hold what was measured, where a row may do without one or another of them; none where the measured
    /// columns are those that every row must have.
    const MEASURED: &'static [&'static str] = &[];
}

/// A measured table in a job: rows, or in their place `{"csv": "..."}`, or a file part of the same
/// name. The service turns the latter two into rows before the physics sees the job, so that the
/// same data give the same key however they came.
#[derive(Debug, Clone, PartialEq)]
pub struct Measured<R>(pub Vec<R>);

impl<R> Default for Measured<R> {
    fn default() -> Self {
        Self(Vec::new())
    }
}

impl<R> Measured<R> {
    /// The rows.
    pub fn rows(&self) -> &[R] {
        &self.0
    }
    /// Whether there are none.
    pub fn is_empty(&self) -> bool {
        self.0.is_empty()
    }
}

impl<R: Serialize> Serialize for Measured<R> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        self.0.serialize(serializer)
    }
}

impl<'de, R: Deserialize<'de>> Deserialize<'de> for Measured<R> {
    fn deserialize<D: Deserializer<'de>>(deserializer: D) -> Result<Self, D::Error> {
        Vec::deserialize(deserializer).map(Self)
    }
}

impl<R: MeasuredRow> PartialSchema for Measured<R> {
    fn schema() -> RefOr<Schema> {
        let rows =
            ArrayBuilder::new().items(R::schema()).max_items(Some(R::MAX_ROWS)).description(Some("Rows.")).build();
        let csv = ObjectBuilder::new()
            .property(
                "csv",
                ObjectBuilder::new().schema_type(SchemaType::new(Type::String)).description(Some(
                    "The table as CSV text. Header `name [unit]` or `name_unit`; separator comma, semicolon or tab; \
                     decimal comma where the separator is no comma.",
                )),
            )
            .required("csv")
            .additional_properties(Some(utoipa::openapi::schema::AdditionalProperties::FreeForm(false)))
            .description(Some("The same as text."))
            .build();
        let mut extensions = utoipa::openapi::extensions::Extensions::default();
        extensions.insert("x-table".to_owned(), true.into());
        if !R::MEASURED.is_empty() {
            extensions.insert("x-measured".to_owned(), R::MEASURED.into());
        }
        RefOr::T(Schema::OneOf(
            OneOfBuilder::new()
                .description(Some("A measured table: rows, or the same as CSV text, or a file part of this name."))
                .item(Schema::Array(rows))
                .item(Schema::Object(csv))
                .extensions(Some(extensions))
                .build(),
        ))
    }
}

impl<R: MeasuredRow> ToSchema for Measured<R> {
    fn name() -> std::borrow::Cow<'static, str> {
        format!("Measured{}", R::name()).into()
    }
    fn schemas(schemas: &mut Vec<(String, RefOr<Schema>)>) {
        R::schemas(schemas);
    }
}
