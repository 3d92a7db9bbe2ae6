//! The contract: an OpenAPI 3.1 document, made from the calculators' own declarations.

mod fixed;
mod jobs;
mod library;
mod models;
mod named;
mod parts;
mod processes;
mod rooms;

use std::collections::BTreeMap;

use serde_json::{Map, Value, json};
use utoipa::openapi::path::PathsBuilder;
use utoipa::openapi::security::{HttpAuthScheme, HttpBuilder, SecurityScheme};
use utoipa::openapi::server::ServerBuilder;
use utoipa::openapi::tag::TagBuilder;
use utoipa::openapi::{ComponentsBuilder, InfoBuilder, LicenseBuilder, OpenApiBuilder};
use utoipa::openapi::{RefOr, Schema};
use utoipa::{PartialSchema, ToSchema};

use crate::engine::STUDIES;
use crate::registry::Registry;

const DESCRIPTION: &str = "\
What to know before the cut: how accurate a machined part will be, and what to change so that it is accurate.

**Ask** by posting a job to a calculator. Units stand in the fields' names. The answer says which model made it, \
what dominates it, and where an input left the range for which a formula was checked.

**Answers are kept** under the hash of their complete job: the same job twice is computed once (`Precut-Cache`), \
`Content-Location` is its lasting address, `ETag` and `If-None-Match` save its transfer, also on `POST`, which here is \
a safe query.

**Long calculations** become jobs (`202` and `Location`): to be asked for, followed as events, cancelled. An accepted \
job is done whatever happens to the process. `Prefer: respond-async` makes a job of anything, `Prefer: wait=N` waits for \
one, `Idempotency-Key` makes sending it twice harmless, `?callback=` has its end told to an address (webhooks).

**Forms**: `Accept` chooses among JSON, CSV (`?table=`), SVG (`?figure=`) and, where a path is the answer, G-code. \
`Accept-Language` chooses the language of sentences; names and codes are never translated.

**Errors** are problem documents (RFC 9457), whatever was accepted; every fault of a job is listed at once with its \
place. `x-request-id` comes back with every answer; the log of the service knows it.";

/// The contract as JSON text, in a stable order.
#[allow(clippy::missing_panics_doc)] // a document of names and words can always be written
pub fn json(registry: &Registry) -> String {
    let mut text = serde_json::to_string_pretty(&document(registry)).expect("a document has only words and numbers");
    text.push('\n');
    text
}

/// The contract as a value.
#[allow(clippy::missing_panics_doc)]
pub fn document(registry: &Registry) -> Value {
    let mut schemas: BTreeMap<String, RefOr<Schema>> = BTreeMap::new();
    let mut paths = PathsBuilder::new();
    for entry in registry.entries() {
        let room = rooms::room(entry);
        paths = paths.path(format!("/v1/{}", entry.meta().id), room.path);
        schemas.extend(room.schemas);
    }
    let studies = rooms::studies(registry);
    paths = paths.path(format!("/v1/{STUDIES}"), studies.path);
    schemas.extend(studies.schemas);
    for (address, path) in jobs::paths(registry).into_iter().chain(models::paths()).chain(fixed::paths(registry)) {
        paths = paths.path(address, path);
    }
    for (address, path) in library::paths().into_iter().chain(processes::paths(registry)) {
        paths = paths.path(address, path);
    }
    for (name, schema) in parts::schemas()
        .into_iter()
        .chain(fixed::schemas())
        .chain(jobs::schemas())
        .chain(models::schemas())
        .chain(library::schemas())
        .chain(processes::schemas(registry))
    {
        let before = schemas.insert(name.clone(), schema.clone());
        debug_assert!(before.is_none_or(|before| before == schema), "two schemas are called {name}");
    }
    let components = schemas
        .into_iter()
        .fold(ComponentsBuilder::new(), |components, (name, schema)| components.schema(name, schema))
        .responses_from_iter(parts::responses())
        .security_scheme(
            parts::BEARER,
            SecurityScheme::Http(
                HttpBuilder::new()
                    .scheme(HttpAuthScheme::Bearer)
                    .description(Some("Needed only where the service is configured with keys (`auth.keys`)."))
                    .build(),
            ),
        );
    let api = OpenApiBuilder::new()
        .info(
            InfoBuilder::new()
                .title("precut")
                .version(env!("CARGO_PKG_VERSION"))
                .description(Some(DESCRIPTION))
                .license(Some(LicenseBuilder::new().name("MIT").identifier(Some("MIT")).build()))
                .build(),
        )
        .tags(Some(parts::TAGS.map(|(name, text)| TagBuilder::new().name(name).description(Some(text)).build())))
        .servers(Some([ServerBuilder::new()
            .url("/")
            .description(Some("The service that this document comes from."))
            .build()]))
        .paths(paths)
        .webhooks(Some(
            PathsBuilder::new().path(jobs::OVER, jobs::callback()).path(processes::SAID, processes::callback()),
        ))
        .components(Some(components.build()))
        .build();
    let mut document = stable(serde_json::to_value(&api).expect("a document has only words and numbers"));
    called_back(&mut document);
    named::choices(&mut document);
    document
}

/// `utoipa` has no callbacks. What it holds as a webhook belongs to the operations that take an address for it, in each
/// written out: one generator of clients stumbles over webhooks, another over references to callbacks.
fn called_back(document: &mut Value) {
    let Some(calls) = document.as_object_mut().and_then(|parts| parts.shift_remove("webhooks")) else { return };
    let paths = document["paths"].as_object_mut().into_iter().flat_map(|paths| paths.values_mut());
    for operation in paths.filter_map(Value::as_object_mut).flat_map(|path| path.values_mut()) {
        let takes_address =
            |parameters: &Vec<Value>| parameters.iter().any(|parameter| parameter["name"] == "callback");
        let Some(id) = operation["operationId"].as_str() else { continue };
        if id == processes::SAID_TO.0 {
            operation["callbacks"] = json!({ processes::SAID: { processes::SAID_TO.1: calls[processes::SAID] } });
            continue;
        }
        if operation["parameters"].as_array().is_some_and(takes_address) {
            let mut call = calls[jobs::OVER].clone();
            call["post"]["operationId"] = format!("{id}_is_over").into();
            operation["callbacks"] = json!({ jobs::OVER: { "{$request.query.callback}": call } });
        }
    }
}

/// Extensions (`x-...`) behind the other members and by name: `utoipa` keeps them in a hash map.
fn stable(value: Value) -> Value {
    match value {
        Value::Object(map) => {
            let (extensions, own): (Vec<_>, Vec<_>) = map.into_iter().partition(|(name, _)| name.starts_with("x-"));
            let extensions: BTreeMap<_, _> = extensions.into_iter().collect();
            let members: Map<_, _> =
                own.into_iter().chain(extensions).map(|(name, part)| (name, stable(part))).collect();
            members.into()
        }
        Value::Array(items) => items.into_iter().map(stable).collect(),
        other => other,
    }
}

/// A type's schema and all that it refers to, by name.
fn schemas_of<T: ToSchema>() -> Vec<(String, RefOr<Schema>)> {
    let mut schemas = vec![(T::name().into_owned(), <T as PartialSchema>::schema())];
    T::schemas(&mut schemas);
    schemas
}
