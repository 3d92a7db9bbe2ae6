//! The operations of stored models.

use serde_json::json;
use utoipa::openapi::content::ContentBuilder;
use utoipa::openapi::path::{HttpMethod, OperationBuilder, Parameter, ParameterIn, PathItem};
use utoipa::openapi::request_body::RequestBodyBuilder;
use utoipa::openapi::response::ResponseBuilder;
use utoipa::openapi::schema::{ObjectBuilder, SchemaType, Type};
use utoipa::openapi::{Ref, RefOr, Required, Schema};

use super::parts;
use crate::engine::ModelComparison;
use crate::http::models;
use crate::http::query::DEFAULT_ITEMS;

const NAME: &str = "^[a-z0-9][a-z0-9_-]{0,63}$";
const REVISION: &str = "^[a-z0-9][a-z0-9_-]{0,63}(@[1-9][0-9]{0,8})?$";

/// Address and operations.
pub(super) fn paths() -> Vec<(&'static str, PathItem)> {
    let mut one = PathItem::new(HttpMethod::Get, read());
    one.put = Some(store().build());
    one.delete = Some(delete().build());
    vec![
        ("/v1/models", PathItem::new(HttpMethod::Get, list())),
        ("/v1/models/{name}", one),
        ("/v1/models/{name}/comparison", PathItem::new(HttpMethod::Get, compare())),
    ]
}

/// Schemas of what they take and answer.
pub(super) fn schemas() -> Vec<(String, RefOr<Schema>)> {
    [
        super::schemas_of::<models::ModelList>(),
        super::schemas_of::<models::SourceDocument>(),
        super::schemas_of::<ModelComparison>(),
    ]
    .concat()
}

fn name(pattern: &str, text: &str) -> Parameter {
    let schema = ObjectBuilder::new().schema_type(SchemaType::new(Type::String)).pattern(Some(pattern)).build();
    parts::path_parameter("name", text, schema, json!("lathe-7-winter"))
}

fn operation(id: &str, summary: &str, description: &str) -> OperationBuilder {
    OperationBuilder::new().tag("models").operation_id(Some(id)).summary(Some(summary)).description(Some(description))
}

fn document(text: &str) -> ResponseBuilder {
    parts::success(text, "application/json", parts::json_of("Model"))
}

fn list() -> OperationBuilder {
    let query = |name, text: &str, schema| parts::parameter(name, ParameterIn::Query, text, schema).build();
    let operation = operation(
        "list_models",
        "Which models are stored?",
        "The newest revision of each stored model, by name and by pages: follow `next` until it is null.",
    )
    .parameter(parts::limit("Most models of one page.", DEFAULT_ITEMS))
    .parameter(query("after", "Where the page before ended: taken from its `next`.", parts::string()))
    .response("200", parts::success("A page of models.", "application/json", parts::json_of("ModelList")));
    parts::guarded(operation, &[400, 507])
}

fn read() -> OperationBuilder {
    let operation = operation(
        "read_model",
        "What does a model say?",
        "A stored model: its newest revision, or the one that is named behind `@`. The document can be stored elsewhere \
         by `PUT`.",
    )
    .parameter(name(REVISION, "Name of the model, or name and revision."))
    .response("200", document("The model."));
    parts::guarded(operation, &[404, 507])
}

fn compare() -> OperationBuilder {
    let with = ObjectBuilder::new().schema_type(SchemaType::new(Type::String)).pattern(Some(REVISION)).build();
    let operation = operation(
        "compare_models",
        "What has changed between two models?",
        "Two stored models of one calculator beside each other: which causes both have, how far the sizes lie apart, and \
         whether their 95 % intervals still meet. Two revisions of one name can be compared, too.",
    )
    .parameter(name(REVISION, "Name of the model, or name and revision."))
    .parameter(parts::parameter("with", ParameterIn::Query, "The other model, or one revision of it.", with).required(Required::True))
    .response("200", parts::success("Both.", "application/json", parts::json_of("ModelComparison")));
    parts::guarded(operation, &[400, 404, 422, 507])
}

fn store() -> OperationBuilder {
    let body = RequestBodyBuilder::new()
        .description(Some(
            "`from_result` or `from_job` of a diagnosis that named its causes, or a model as `GET` gave it.",
        ))
        .required(Some(Required::True))
        .content("application/json", ContentBuilder::new().schema(Some(Ref::from_schema_name("ModelSource"))).build());
    let only_new =
        parts::parameter("If-None-Match", ParameterIn::Header, "`*`: only if nothing has the name.", parts::string());
    let location = || parts::text_header("Address of the revision.", "/v1/models/lathe-7-winter@1");
    let operation = operation(
        "store_model",
        "May later jobs use what a diagnosis found?",
        "Stores the causes that a diagnosis named, as effects with their provenance, under a name that a job gives in \
         `model`. Each `PUT` makes a new revision; revisions never change.",
    )
    .parameter(name(NAME, "Name of the model: lower-case letters, digits, `-` and `_`."))
    .parameter(only_new.build())
    .request_body(Some(body.build()))
    .response("200", document("The new revision of a name that was there.").header("Location", location()))
    .response("201", document("The first revision of a new name.").header("Location", location()));
    parts::guarded(operation, &[400, 404, 408, 409, 410, 412, 413, 415, 422, 507])
}

fn delete() -> OperationBuilder {
    let operation = operation(
        "delete_model",
        "How does a model go?",
        "Deletes every revision of a model. Jobs and results that used it keep what they hold of it, and its numbers are \
         never given again.",
    )
    .parameter(name(NAME, "Name of the model."))
    .response(
        "204",
        ResponseBuilder::new().description("It is gone.").header("x-request-id", parts::request_id()),
    );
    parts::guarded(operation, &[404, 507])
}
