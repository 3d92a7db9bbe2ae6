//! The operations of machines, tools, materials and parts.

use precut_library::Kind;
use precut_library::resolve::Origin;
use serde_json::{Value, json};
use utoipa::openapi::content::ContentBuilder;
use utoipa::openapi::path::{HttpMethod, OperationBuilder, Parameter, ParameterIn, PathItem};
use utoipa::openapi::request_body::RequestBodyBuilder;
use utoipa::openapi::response::ResponseBuilder;
use utoipa::openapi::schema::{Object, ObjectBuilder, SchemaType, Type};
use utoipa::openapi::{Ref, RefOr, Required, Schema};

use super::parts;
use crate::engine::{ImportReport, RecordComparison};
use crate::http::provenance::RecordOrigin;
use crate::http::query::MOST_ITEMS;
use crate::http::{library, records};

const NAME: &str = "^[a-z0-9][a-z0-9_-]{0,63}$";
const REVISION: &str = "^[a-z0-9][a-z0-9_-]{0,63}(@[1-9][0-9]{0,8})?$";

/// Address and operations.
pub(super) fn paths() -> Vec<(String, PathItem)> {
    let mut paths = Vec::new();
    for kind in Kind::ALL {
        let folder = kind.plural();
        let mut one = PathItem::new(HttpMethod::Get, read(kind));
        one.put = Some(store(kind).build());
        one.delete = Some(delete(kind).build());
        paths.push((format!("/v1/{folder}"), PathItem::new(HttpMethod::Get, list(kind))));
        paths.push((format!("/v1/{folder}/{{name}}"), one));
        paths.push((format!("/v1/{folder}/{{name}}/comparison"), PathItem::new(HttpMethod::Get, compare(kind))));
    }
    paths.push(("/v1/tools/parse".to_owned(), PathItem::new(HttpMethod::Post, parse())));
    paths.push(("/v1/library/import".to_owned(), PathItem::new(HttpMethod::Post, import())));
    paths.push(("/v1/library/export".to_owned(), PathItem::new(HttpMethod::Get, export())));
    paths
}

fn component(kind: Kind) -> &'static str {
    match kind {
        Kind::Machine => "MachineRecord",
        Kind::Tool => "ToolRecord",
        Kind::Material => "MaterialRecord",
        Kind::Part => "PartRecord",
    }
}

fn example(kind: Kind) -> &'static str {
    match kind {
        Kind::Machine => "lathe-3",
        Kind::Tool => "bar-25",
        Kind::Material => "42crmo4-own",
        Kind::Part => "shaft-shaft",
    }
}

fn typed(schema: Value) -> RefOr<Schema> {
    serde_json::from_value(schema).expect("a schema written here")
}

const RECORD_VALUE: &str = "#/components/schemas/RecordValue";
/// Largest whole number of a body, 2^53.
const MOST: i64 = 9_007_199_254_740_992;

/// What stands in a record: words, numbers, parts, and lists of them. Not a list of lists, and no type that is its own part
/// without an object between, which generators of clients cannot write.
fn record_values() -> [(String, RefOr<Schema>); 3] {
    let number = json!({
        "type": "number", "description": "A number of a record.", "minimum": -MOST, "maximum": MOST,
    });
    let plain = [
        json!({ "type": ["string", "boolean", "null"] }),
        json!({ "$ref": "#/components/schemas/RecordNumber" }),
        json!({ "$ref": "#/components/schemas/RecordPart" }),
    ];
    let list = json!({ "type": "array", "items": { "anyOf": plain } });
    let value = json!({
        "description": "What stands in a record. No number of it is larger than a whole number may be.",
        "anyOf": plain.into_iter().chain([list]).collect::<Vec<Value>>(),
    });
    let part = json!({
        "type": "object", "description": "A part of a record.", "additionalProperties": { "$ref": RECORD_VALUE },
    });
    [("RecordValue", value), ("RecordPart", part), ("RecordNumber", number)]
        .map(|(name, schema)| (name.to_owned(), typed(schema)))
}

/// Schemas of what they take and answer.
pub(super) fn schemas() -> Vec<(String, RefOr<Schema>)> {
    let mut all = [
        super::schemas_of::<RecordComparison>(),
        super::schemas_of::<ImportReport>(),
        super::schemas_of::<RecordOrigin>(),
        super::schemas_of::<Origin>(),
    ]
    .concat();
    for kind in Kind::ALL {
        let (name, word) = (component(kind), kind.name());
        all.push((name.to_owned(), typed(record(kind))));
        all.push((
            format!("{name}List"),
            typed(json!({
                "type": "object", "description": format!("A page of {}.", kind.plural()), "required": ["items"],
                "properties": {
                    "items": { "type": "array", "items": { "$ref": format!("#/components/schemas/{name}") },
                        "description": format!("Own ones by name, then the engine's; the newest revision of each {word}.") },
                    "next": { "type": ["string", "null"], "description": "Address of the next page; null on the last.",
                        "examples": [format!("/v1/{}?limit=50&after={}", kind.plural(), example(kind))] },
                },
            })),
        ));
        all.push((
            format!("{name}Source"),
            typed(json!({
                "type": "object", "additionalProperties": { "$ref": RECORD_VALUE },
                "description": format!("A whole {word}, its fields as docs/library.md lists them, or `from` and `set`."),
                "properties": {
                    "from": { "type": "string", "maxLength": 80, "description": "Copy this record: `name`, or `name@revision`.",
                        "examples": [example(kind)] },
                    "set": { "type": "object", "additionalProperties": { "$ref": RECORD_VALUE },
                        "description": "Changes of the copy: a value for each JSON Pointer; null takes away what is there." },
                },
            })),
        ));
    }
    all.extend(record_values());
    all.push((
        "LibraryFile".to_owned(),
        typed(json!({
            "type": "object", "additionalProperties": { "$ref": RECORD_VALUE }, "description": "Lists of records: `machines`, `tools`, `materials`, `parts`.",
            "properties": { "schema_version": { "type": ["integer", "null"], "minimum": 1, "maximum": 1, "examples": [1], "x-unit": "1",
                "x-symbol": "v", "description": "Version of the form." } },
        })),
    ));
    all.push((
        "ToolCodes".to_owned(),
        typed(json!({
            "type": "object", "description": "Designations of a tool.", "additionalProperties": false,
            "properties": {
                "insert": { "type": ["string", "null"], "maxLength": 64, "description": "Insert, ISO 1832.", "examples": ["CNMG120408"] },
                "holder": { "type": ["string", "null"], "maxLength": 64, "description": "Holder, ISO 5608, or bar, ISO 6261.", "examples": ["PCLNR2525M12"] },
            },
        })),
    ));
    all.push((
        "ToolCodesRead".to_owned(),
        typed(json!({
            "type": "object", "description": "What designations say; null where they do not.", "required": ["insert", "holder", "geometry"],
            "properties": {
                "insert": { "type": ["object", "null"], "additionalProperties": true, "description": "Of the insert." },
                "holder": { "type": ["object", "null"], "additionalProperties": true, "description": "Of the holder or bar." },
                "geometry": { "type": ["object", "null"], "additionalProperties": true, "description": "Of both together: nose radius, edge angles." },
            },
        })),
    ));
    all
}

fn record(kind: Kind) -> Value {
    json!({
        "type": "object", "additionalProperties": true, "required": ["name", "built_in", "sha256", "links"],
        "description": match kind {
            Kind::Part => "A part of a job: beside these `field`, `type` and `value`, as docs/library.md says.".to_owned(),
            _ => format!("A {}: beside these its own fields, as docs/library.md lists them, each number with its source and how certain it is.", kind.name()),
        },
        "properties": {
            "name": { "type": "string", "pattern": NAME, "description": "Its name.", "examples": [example(kind)] },
            "title": { "type": "string", "description": "A few words for a list.", "examples": ["Lathe 3"] },
            "built_in": { "type": "boolean", "description": "Whether it is the engine's own.", "examples": [false] },
            "revision": { "type": "integer", "minimum": 1, "description": "Of an own one: rises with each `PUT`; a revision never changes.", "examples": [4], "x-unit": "1", "x-symbol": "r" },
            "data_version": { "type": "integer", "minimum": 1, "description": "Of the engine's own: grows with every changed number.", "examples": [1], "x-unit": "1", "x-symbol": "v" },
            "sha256": { "type": "string", "pattern": "^[0-9a-f]{64}$", "description": "SHA-256 of the record in canonical JSON (RFC 8785)." },
            "created_at": { "type": "string", "format": "date-time", "description": "When the revision was stored, UTC.", "examples": ["2026-02-03T10:15:00.123Z"] },
            "uses": { "type": "integer", "minimum": 0, "description": "Kept results whose jobs got this revision; told where one record is asked for.", "examples": [12], "x-unit": "1", "x-symbol": "u" },
            "links": { "type": "object", "additionalProperties": true, "description": "Where to go from here: `self`, `newest`, `comparison`, `revisions`, and `uses`, the kept results whose jobs got it." },
        },
    })
}

fn name(kind: Kind, pattern: &str, text: &str) -> Parameter {
    let schema = ObjectBuilder::new().schema_type(SchemaType::new(Type::String)).pattern(Some(pattern)).build();
    parts::path_parameter("name", text, schema, json!(example(kind)))
}

fn operation(id: String, summary: &str, description: &str) -> OperationBuilder {
    OperationBuilder::new().tag("library").operation_id(Some(id)).summary(Some(summary)).description(Some(description))
}

fn document(kind: Kind, text: &str) -> ResponseBuilder {
    parts::success(text, "application/json", parts::json_of(component(kind)))
}

fn list(kind: Kind) -> OperationBuilder {
    let query = |name, text: &str, schema| parts::parameter(name, ParameterIn::Query, text, schema).build();
    let (class, about) = (
        records::class_parameter(kind),
        match kind {
            Kind::Machine | Kind::Tool => "Only of this kind.",
            Kind::Material => "Only of this group of ISO 513, as `P`.",
            Kind::Part => "Only for this field of a job, as `shaft`.",
        },
    );
    let operation = operation(
        format!("list_{}", kind.plural()),
        &format!("Which {} are known?", kind.plural()),
        match kind {
            Kind::Part => "Own ones; the engine has none. `q` finds them by name and title, however it is spelled, best first.",
            _ => {
                "Own ones and the engine's, each number with its source and how certain it is. `q` finds them by any of their \
                 names, however it is spelled, best first."
            }
        },
    )
    .parameter(query("q", "What somebody types: name, title, any other name.", parts::string()))
    .parameter(query(class, about, parts::string()))
    .parameter(query("own", "`true`: without the engine's.", yes_or_no()))
    .parameter(parts::limit("Most of one page.", MOST_ITEMS))
    .parameter(query("after", "Where the page before ended: taken from its `next`.", parts::string()));
    let page = parts::success("A page.", "application/json", parts::json_of(&format!("{}List", component(kind))));
    parts::guarded(parts::conditional(operation.response("200", parts::tagged(page))), &[400, 507])
}

fn read(kind: Kind) -> OperationBuilder {
    let operation = operation(
        format!("read_{}", kind.name()),
        &format!("What is known of a {}?", kind.name()),
        "Its newest revision, or the one that is named behind `@`.",
    )
    .parameter(name(kind, REVISION, "Its name, or name and revision."))
    .response("200", parts::tagged(document(kind, "The record.")));
    parts::guarded(parts::conditional(operation), &[404, 507])
}

fn compare(kind: Kind) -> OperationBuilder {
    let with = ObjectBuilder::new().schema_type(SchemaType::new(Type::String)).pattern(Some(REVISION)).build();
    let operation = operation(
        format!("compare_{}", kind.plural()),
        &format!("What has changed between two {}?", kind.plural()),
        "The fields in which two records, or two revisions of one, differ; numbers in percent.",
    )
    .parameter(name(kind, REVISION, "Its name, or name and revision."))
    .parameter(parts::parameter("with", ParameterIn::Query, "The other one.", with).required(Required::True))
    .response("200", parts::tagged(parts::success("Both.", "application/json", parts::json_of("RecordComparison"))));
    parts::guarded(parts::conditional(operation), &[400, 404, 507])
}

fn store(kind: Kind) -> OperationBuilder {
    let body = RequestBodyBuilder::new()
        .description(Some("A whole record, or a copy of one with changes."))
        .required(Some(Required::True))
        .content(
            "application/json",
            ContentBuilder::new()
                .schema(Some(Ref::from_schema_name(format!("{}Source", component(kind)))))
                .example(Some(source_example(kind)))
                .build(),
        );
    let only_new =
        parts::parameter("If-None-Match", ParameterIn::Header, "`*`: only if nothing has the name.", parts::string());
    let location = || parts::text_header("Address of the revision.", "/v1/machines/lathe-3@1");
    let operation = operation(
        format!("store_{}", kind.name()),
        &match kind {
            Kind::Part => "May I keep a part of a job?".to_owned(),
            _ => format!("May jobs name my own {}?", kind.name()),
        },
        match kind {
            Kind::Part => {
                "Stores what stands in a field of a job, such as a shaft, for jobs that are written later. It must be what the \
                 field takes. Each `PUT` makes a new revision; revisions never change."
            }
            _ => "Stores it under a name that jobs give. Each `PUT` makes a new revision; revisions never change.",
        },
    )
    .parameter(name(kind, NAME, "Its name: lower-case letters, digits, `-` and `_`."))
    .parameter(only_new.build())
    .request_body(Some(body.build()))
    .response("200", document(kind, "The new revision of a name that was there.").header("Location", location()))
    .response("201", document(kind, "The first revision of a new name.").header("Location", location()));
    parts::guarded(operation, &[400, 408, 409, 412, 413, 415, 422, 507])
}

fn source_example(kind: Kind) -> Value {
    match kind {
        Kind::Machine => {
            json!({ "from": "lathe_engine_medium", "set": { "/compliance/carriage_um_per_n": { "value": 0.018, "determined_by": "measured" } } })
        }
        Kind::Tool => json!({ "kind": "turning_external", "insert": "DNMG150608", "holder": "PDJNL2525M15" }),
        Kind::Material => json!({ "from": "42crmo4", "set": { "/title": "42CrMo4 of our forge" } }),
        Kind::Part => {
            json!({ "field": "shaft", "type": "Shaft", "value": { "segments": [{ "length_mm": 400, "diameter_mm": 60 }] } })
        }
    }
}

fn delete(kind: Kind) -> OperationBuilder {
    let operation = operation(
        format!("delete_{}", kind.name()),
        &format!("How does a {} go?", kind.name()),
        "Deletes every revision of an own record. Jobs and results that used it keep their numbers, and its numbers are never \
         given again.",
    )
    .parameter(name(kind, NAME, "The name of an own record."))
    .response("204", ResponseBuilder::new().description("It is gone.").header("x-request-id", parts::request_id()));
    parts::guarded(operation, &[404, 409, 507])
}

fn parse() -> OperationBuilder {
    let body = RequestBodyBuilder::new().required(Some(Required::True)).content(
        "application/json",
        ContentBuilder::new()
            .schema(Some(Ref::from_schema_name("ToolCodes")))
            .example(Some(json!({ "insert": "CNMG120408", "holder": "PCLNR2525M12" })))
            .build(),
    );
    let operation = operation(
        "parse_tool".to_owned(),
        "What do the codes of a tool say?",
        "Reads the designations of an insert, a holder or both, and what follows for the cut. Nothing is stored.",
    )
    .request_body(Some(body.build()))
    .response("200", parts::success("What they say.", "application/json", parts::json_of("ToolCodesRead")));
    parts::guarded(operation, &[400, 408, 413, 415, 422])
}

fn import() -> OperationBuilder {
    let content = |kind: &str| {
        match kind {
        "application/json" => ContentBuilder::new()
            .schema(Some(Ref::from_schema_name("LibraryFile")))
            .example(Some(json!({ "schema_version": 1, "tools": [{ "id": "cnmg-own", "kind": "turning_external", "insert": "CNMG120408" }] })))
            .build(),
        _ => parts::text_of("The same as TOML, or rows."),
    }
    };
    let body = library::TYPES.into_iter().fold(
        RequestBodyBuilder::new().required(Some(Required::True)).description(Some(
            "Lists of records. CSV has a row for each number (`kind,name,pointer,value,unit,source,certainty,low,high,note`), or \
             for tools a row for each.",
        )),
        |body, kind| body.content(kind, content(kind)),
    );
    let dry_run = parts::parameter("dry_run", ParameterIn::Query, "`true`: only tell what would change.", yes_or_no());
    let operation = operation(
        "import_library".to_owned(),
        "How do I bring my records along?",
        "Stores all records of a file, or none. Records that say what is stored already make no revision.",
    )
    .parameter(dry_run.build())
    .request_body(Some(body.build()))
    .response("200", parts::success("What it changed.", "application/json", parts::json_of("ImportReport")));
    parts::guarded(operation, &[400, 408, 413, 415, 422, 507])
}

/// The words of a parameter that is on or off.
fn yes_or_no() -> Object {
    words(&["true", "false"])
}

fn words(all: &[&str]) -> Object {
    parts::one_of(all.iter().map(|word| (*word).to_owned()))
}

fn export() -> OperationBuilder {
    let format = parts::parameter(
        "format",
        ParameterIn::Query,
        "`json`, `toml` or `csv`; else by `Accept`.",
        words(&["json", "toml", "csv"]),
    );
    let response = parts::success("The file.", "application/json", parts::json_of("LibraryFile"))
        .content("application/toml", parts::text_of("The same as TOML."))
        .content("text/csv", parts::text_of("A row for each number and each word."));
    let operation = operation(
        "export_library".to_owned(),
        "How do I take my records away?",
        "The newest revisions of all own records as a file that can be imported again.",
    )
    .parameter(format.build())
    .response("200", response);
    parts::guarded(operation, &[400, 406, 507])
}
