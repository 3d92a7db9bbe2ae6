//! Schemas of choices: objects told apart by `kind`.

use utoipa::openapi::schema::{ObjectBuilder, SchemaType, Type};
use utoipa::openapi::{RefOr, Schema};

/// The schema of one choice: the object's own schema with the property `kind` in front.
///
/// The derived schema of an internally tagged newtype variant is an `allOf` of the object and its
/// tag, which contradicts the object's own `additionalProperties: false`; that of a struct variant
/// lets unknown fields pass. Hence this one.
pub(crate) fn choice(kind: &'static str, schema: RefOr<Schema>) -> RefOr<Schema> {
    let RefOr::T(Schema::Object(mut object)) = schema else { return schema };
    let tag = ObjectBuilder::new()
        .schema_type(SchemaType::new(Type::String))
        .enum_values(Some([kind]))
        .description(Some("Which of the choices this is."))
        .build();
    let fields = std::mem::take(&mut object.properties);
    object.properties.insert("kind".to_owned(), RefOr::T(Schema::Object(tag)));
    object.properties.extend(fields);
    object.required.insert(0, "kind".to_owned());
    RefOr::T(Schema::Object(object))
}
