//! The operations of processes under watch.

use serde_json::{Value, json};
use utoipa::openapi::content::ContentBuilder;
use utoipa::openapi::path::{HttpMethod, OperationBuilder, Parameter, ParameterIn, PathItem};
use utoipa::openapi::request_body::{RequestBody, RequestBodyBuilder};
use utoipa::openapi::response::ResponseBuilder;
use utoipa::openapi::schema::{Object, ObjectBuilder, SchemaType, Type};
use utoipa::openapi::{Ref, RefOr, Required, Schema};

use super::{jobs, parts};
use crate::engine::WhichPath;
use crate::http::processes;
use crate::registry::Registry;

const NAME: &str = "^[a-z0-9][a-z0-9_-]{0,63}$";
const PART: &str = "^[A-Za-z0-9][A-Za-z0-9._-]{0,99}$";
const EXAMPLE: &str = "shaft-560";
/// What is posted to whom a process names.
pub(super) const SAID: &str = "process_said";
/// The operation that takes the address for it, and where it stands there.
pub(super) const SAID_TO: (&str, &str) = ("store_process", "{$request.body#/callback/url}");

/// Address and operations.
pub(super) fn paths(registry: &Registry) -> Vec<(String, PathItem)> {
    let one = "/v1/processes/{name}";
    let under = |part: &str| format!("{one}/{part}");
    let get = |operation: OperationBuilder| PathItem::new(HttpMethod::Get, operation);
    let mut process = get(read());
    process.put = Some(store(registry).build());
    process.delete = Some(delete().build());
    let mut all_parts = get(list_parts());
    all_parts.post = Some(import().build());
    let mut part = get(read_part());
    part.put = Some(put_part(registry).build());
    part.delete = Some(withdraw().build());
    vec![
        ("/v1/processes".to_owned(), get(list())),
        (one.to_owned(), process),
        (under("parts"), all_parts),
        (under("parts/{part}"), part),
        (under("state"), get(state())),
        (under("figures"), get(figures())),
        (under("history"), get(history())),
        (under("changes"), get(changes())),
        (under("changes/{id}"), PathItem::new(HttpMethod::Post, decide())),
        (under("next"), get(next(registry))),
        (under("gain"), get(gain())),
        (under("events"), get(events())),
        (under("export"), get(export())),
    ]
}

fn typed(schema: Value) -> RefOr<Schema> {
    serde_json::from_value(schema).expect("a schema written here")
}

fn reference(name: &str) -> Value {
    json!({ "$ref": format!("#/components/schemas/{name}") })
}

fn count(text: &str, example: u32) -> Value {
    json!({ "type": "integer", "minimum": 0, "description": text, "examples": [example], "x-unit": "1", "x-symbol": "n" })
}

fn page(of: &str, text: &str, next: &str) -> Value {
    json!({
        "type": "object", "description": text, "required": ["items"],
        "properties": {
            "items": { "type": "array", "description": "In order.", "items": reference(of) },
            "next": { "type": ["string", "null"], "description": "Address of the next page; null on the last.", "examples": [next] },
        },
    })
}

fn open(text: &str) -> Value {
    json!({ "type": "object", "description": text, "additionalProperties": true })
}

/// Schemas of what they take and answer.
#[allow(clippy::too_many_lines)] // a list
pub(super) fn schemas(registry: &Registry) -> Vec<(String, RefOr<Schema>)> {
    let mut all = Vec::new();
    let (mut documents, mut bodies) = (Vec::new(), Vec::new());
    for observed in registry.entries().iter().filter_map(|entry| entry.observed()) {
        for (entry, into) in [(&observed.document, &mut documents), (&observed.part, &mut bodies)] {
            let schemas = entry.schemas();
            into.push(schemas.input);
            all.extend(schemas.components);
        }
    }
    for (name, forms) in [("ProcessDocument", documents), ("ProcessPartBody", bodies)] {
        // Of a service that watches nothing there is nothing to say.
        let form = forms.into_iter().next().unwrap_or_else(|| typed(open("As the calculator says.")));
        all.push((name.to_owned(), form));
    }
    let time = json!({ "type": "string", "format": "date-time", "description": "When, UTC.", "examples": ["2026-02-03T10:15:00.123Z"] });
    let word = |text: &str, example: &str| json!({ "type": "string", "description": text, "examples": [example] });
    let maybe =
        |text: &str, example: &str| json!({ "type": ["string", "null"], "description": text, "examples": [example] });
    let some = |text: &str| json!({ "type": ["integer", "null"], "minimum": 0, "description": text, "examples": [39], "x-unit": "1", "x-symbol": "n" });
    let mut add = |name: &str, schema: Value| all.push((name.to_owned(), typed(schema)));
    let one_of = |text: &str, words: &[&str]| json!({ "type": "string", "enum": words, "description": text, "examples": [words[0]] });
    let yes = |text: &str| json!({ "type": "boolean", "description": text, "examples": [false] });
    let two = |text: &str, of: Value| json!({ "type": "array", "minItems": 2, "maxItems": 2, "description": text, "items": of });
    let size =
        |text: &str| json!({ "type": "number", "description": text, "examples": [0.0044], "x-unit": "as `unit` says" });
    add(
        "ProcessChangedCause",
        json!({
            "type": "object", "description": "A cause that may have changed.",
            "required": ["kind", "share", "form", "parameter", "unit", "delta", "interval_95", "at_bound", "same_as_other"],
            "properties": {
                "kind": word("Its kind in the catalogue; `gauge_offset` of the gauge, `unnamed` of what has none.", "tailstock_compliance"),
                "label": word("Which of several of one kind.", "end"),
                "share": { "type": "number", "minimum": 0, "maximum": 1, "description": "Probability.", "examples": [0.71], "x-unit": "1" },
                "form": one_of("How it goes on.", &["step", "drift"]),
                "parameter": word("The field of the effect that changed.", "compliance_um_per_n"),
                "unit": word("Its unit.", "um/N"),
                "delta": size("By how much it changed."),
                "interval_95": two("The same with 95 %.", size("An end.")),
                "at_bound": yes("Whether it lies beyond what the cause allows."),
                "same_as_other": yes("Whether another cause of the list does the same to these parts."),
            },
        }),
    );
    add(
        "ProcessChange",
        json!({
            "type": "object", "description": "A change of a process.",
            "required": ["id", "verdict", "reported_at_part", "since_part", "since_parts_90", "accepted", "causes"],
            "properties": {
                "id": word("Its name within the process.", "c1"),
                "verdict": one_of("How sure its name is.", &["named", "one_of", "unnamed"]),
                "reported_at_part": count("The part after which it was reported.", 39),
                "since_part": count("The part with which it began, most probably.", 37),
                "since_parts_90": two("The shortest range of parts in which it began with 90 %.", count("A part.", 36)),
                "accepted": yes("Whether it is part of the model."),
                "decided": one_of("What a person said of it; absent where nobody did.", &["confirmed", "rejected", "named"]),
                "causes": { "type": "array", "description": "Causes that together have 95 %, likeliest first.", "items": reference("ProcessChangedCause") },
            },
        }),
    );
    add(
        "ProcessSaid",
        json!({
            "type": "object", "additionalProperties": true,
            "description": "What is said of a process after its last part, as docs/physics/process.md says: `state`, `evidence`, `score`, \
             `change`, `changes`, `odd_parts`, `scatter`, `forecast`, `action`, `measure_next`, `explanation`; after a part also \
             `part`, `number`, `revision`, `replayed_parts` and `news`.",
            "properties": {
                "changes": { "type": "array", "description": "Every change so far.", "items": reference("ProcessChange") },
            },
        }),
    );
    add(
        "ProcessState",
        json!({ "description": "What was said last; null before the first part.", "oneOf": [{ "type": "null" }, reference("ProcessSaid")] }),
    );
    add("ProcessSent", open("What was sent, or what a person decided, or a path that was given out."));
    add(
        "Process",
        json!({
            "type": "object", "description": "A process under watch.",
            "required": ["name", "revision", "sequence", "created_at", "document", "state", "links"],
            "properties": {
                "name": word("Its name.", EXAMPLE), "revision": count("Of its document.", 1),
                "sequence": count("Number of the last entry of its record.", 41), "created_at": time,
                "document": reference("ProcessSent"),
                "state": reference("ProcessState"),
                "links": open("Where to go from here; `model` is its own stored model, null before a change joined it."),
            },
        }),
    );
    add("ProcessList", page("Process", "A page of processes, by name.", "/v1/processes?limit=50&after=shaft-560"));
    add(
        "ProcessEntry",
        json!({
            "type": "object", "description": "Something that happened to a process.",
            "required": ["sequence", "kind", "revision", "created_at", "sent", "said", "callback"],
            "properties": {
                "sequence": count("Its number, without a gap.", 41),
                "kind": { "type": "string", "enum": ["document", "part", "withdrawn", "decision", "path"], "description": "What it is.", "examples": ["part"] },
                "part": maybe("The part that it is about.", "2026-02-03-0039"), "number": some("Number of that part."),
                "revision": count("Of the document, the part or the path.", 1), "created_at": time,
                "sent": { "description": "What came.", "oneOf": [{ "type": "null" }, reference("ProcessSent")] },
                "said": { "description": "What was said then; it never changes.", "oneOf": [{ "type": "null" }, reference("ProcessSaid")] },
                "callback": { "description": "What has become of the callback that tells of it; null where nobody is told.", "oneOf": [{ "type": "null" }, reference("Callback")] },
            },
        }),
    );
    add(
        "ProcessHistory",
        page("ProcessEntry", "A page of a record.", "/v1/processes/shaft-560/history?limit=50&after=50"),
    );
    add(
        "ProcessPart",
        json!({
            "type": "object", "description": "A part of a process.",
            "required": ["process", "part", "revision", "sequence", "created_at", "withdrawn", "sent", "said", "now", "links"],
            "properties": {
                "process": word("Its process.", EXAMPLE), "part": word("Its name.", "2026-02-03-0039"),
                "number": some("Its number; null where it was withdrawn."), "revision": count("Rises with each correction.", 1),
                "sequence": count("Of its last entry in the record.", 41), "created_at": time,
                "withdrawn": { "type": "boolean", "description": "Whether it was withdrawn.", "examples": [false] },
                "sent": { "description": "What came.", "oneOf": [{ "type": "null" }, reference("ProcessSent")] },
                "said": reference("ProcessSaid"),
                "now": open("What is said of it now: `state`, `unused`, `evidence`, `score`, `change`."),
                "history": { "type": "array", "description": "All that happened to it; told of one part.", "items": reference("ProcessEntry") },
                "links": open("Where to go from here."),
            },
        }),
    );
    add(
        "ProcessParts",
        page("ProcessPart", "A page of parts, by number.", "/v1/processes/shaft-560/parts?limit=50&from=51"),
    );
    add(
        "ProcessImport",
        json!({
            "type": "object", "description": "Parts of a history, each with its name.", "required": ["parts"],
            "properties": { "parts": { "type": "array", "maxItems": 100_000, "description": "A part each: `part`, its name, beside what a single part is made of.", "items": reference("ProcessSent") } },
        }),
    );
    add(
        "ProcessImported",
        json!({
            "type": "object", "description": "What would have been said when.", "required": ["taken", "replayed_parts", "said", "state"],
            "properties": {
                "taken": count("Parts that are new.", 36), "replayed_parts": count("Parts that were judged anew.", 0),
                "said": { "type": "array", "description": "A line for each part.", "items": open("What is said after it: `part`, `number`, `state`, `evidence`, `score`, `change`, `unused`.") },
                "state": reference("ProcessState"),
            },
        }),
    );
    add(
        "ProcessChanges",
        json!({
            "type": "object", "description": "Changes of a process.", "required": ["items"],
            "properties": {
                "items": { "type": "array", "description": "In the order in which they were reported.", "items": open("A change: `id`, `verdict`, `since_part`, `since_parts_90`, `accepted`, `decided`, `causes`.") },
                "next": { "type": "null", "description": "Always null: all are there." },
            },
        }),
    );
    add(
        "ProcessDecision",
        json!({
            "type": "object", "description": "What a person says of a change.", "required": ["decision"], "additionalProperties": false,
            "properties": {
                "decision": { "type": "string", "enum": ["confirm", "reject", "name"], "description": "It is one; it is none; it is this cause alone.", "examples": ["name"] },
                "cause": { "type": ["string", "null"], "maxLength": 64, "description": "With `name`: one of the causes of the change.", "examples": ["tailstock_compliance"] },
                "note": { "type": ["string", "null"], "maxLength": 2000, "description": "For the record.", "examples": ["Clamping lever was loose."] },
            },
        }),
    );
    add(
        "ProcessNext",
        json!({
            "type": "object", "description": "The next part.",
            "required": ["process", "number", "part_type", "path", "which", "calculator", "job", "answer", "links"],
            "properties": {
                "process": word("Its process.", EXAMPLE), "number": count("Its number, unless another part comes first.", 47),
                "part_type": word("What it is.", "A"), "path": open("What a part that is cut on it states: `kind` and `revision`."),
                "which": { "type": "string", "enum": WhichPath::ALL.iter().map(|path| path.word()).collect::<Vec<_>>(), "description": "The path as it is, or a new one.", "examples": ["new_path"] },
                "calculator": word("Whose job it is.", "deflection-compensation"), "job": open("The calculator's own job."),
                "answer": word("Address of its answer.", "/v1/results/b3:5d41402abc4b2a76b9719d911017c5925d41402abc4b2a76b9719d911017c592"),
                "forecast": { "type": ["object", "null"], "additionalProperties": true, "description": "What is expected of it." },
                "action": { "type": ["object", "null"], "additionalProperties": true, "description": "What to do." },
                "explanation": { "type": ["array", "null"], "description": "What there is to say.", "items": open("A sentence.") },
                "links": open("Where to go from here."),
            },
        }),
    );
    add(
        "ProcessGain",
        json!({
            "type": "object", "description": "The account of the gain.", "required": ["process"],
            "properties": { "process": word("Its process.", EXAMPLE), "gain": { "type": ["object", "null"], "additionalProperties": true, "description": "The account; null where nothing was cut with a new path." } },
        }),
    );
    add(
        "ProcessRecord",
        open("A whole record: `form`, `name`, `sha256` and `record`. `PUT` takes it elsewhere as it is."),
    );
    all
}

fn text(pattern: &str) -> Object {
    ObjectBuilder::new().schema_type(SchemaType::new(Type::String)).pattern(Some(pattern)).build()
}

fn name() -> Parameter {
    parts::path_parameter("name", "Name of the process.", text(NAME), json!(EXAMPLE))
}

fn part() -> Parameter {
    parts::path_parameter("part", "Name of the part.", text(PART), json!("2026-02-03-0039"))
}

fn query(name: &str, about: &str, schema: Object) -> Parameter {
    parts::parameter(name, ParameterIn::Query, about, schema).build()
}

fn limit() -> Parameter {
    query("limit", "Most of one page.", parts::integer(1, processes::MOST_ITEMS, processes::DEFAULT_ITEMS))
}

fn header(name: &str, about: &str) -> Parameter {
    parts::parameter(name, ParameterIn::Header, about, parts::string()).build()
}

fn if_match() -> Parameter {
    header("If-Match", "The ETag of what is changed: needed where something else is there.")
}

fn language() -> Parameter {
    header(
        "Accept-Language",
        "Languages of sentences by preference: `en` (English) or `ru` (Russian); English where none fits.",
    )
}

fn operation(id: &str, summary: &str, description: &str) -> OperationBuilder {
    OperationBuilder::new()
        .tag("processes")
        .operation_id(Some(id))
        .summary(Some(summary))
        .description(Some(description))
}

fn document(about: &str, schema: &str) -> ResponseBuilder {
    parts::success(about, "application/json", parts::json_of(schema))
}

fn changed(about: &str, schema: &str) -> ResponseBuilder {
    document(about, schema).header("ETag", parts::etag())
}

fn number() -> Object {
    parts::integer(0, processes::MOST_NUMBER, 0)
}

fn body(about: &str, schema: &str, example: Option<Value>) -> RequestBody {
    let content = ContentBuilder::new().schema(Some(Ref::from_schema_name(schema))).example(example).build();
    RequestBodyBuilder::new()
        .description(Some(about))
        .required(Some(Required::True))
        .content("application/json", content)
        .build()
}

fn list() -> OperationBuilder {
    let operation = operation(
        "list_processes",
        "Which processes are watched?",
        "By name and by pages: follow `next` until it is null.",
    )
    .parameter(limit())
    .parameter(query("after", "Where the page before ended: taken from its `next`.", parts::string()))
    .parameter(language())
    .response("200", document("A page.", "ProcessList"));
    parts::guarded(operation, &[400, 507])
}

fn read() -> OperationBuilder {
    let operation = operation("read_process", "How is a process?", "Its document and what was said last.")
        .parameter(name())
        .response("200", parts::tagged(document("The process.", "Process")));
    parts::guarded(parts::conditional(operation), &[404, 507])
}

/// The example job of the first calculator whose process is watched, as a process.
fn example(registry: &Registry) -> Option<Value> {
    let entry = registry.entries().iter().find(|entry| entry.observed().is_some())?;
    let job: Value = serde_json::from_str(entry.meta().examples.first()?.job).ok()?;
    let quantity = entry.observed()?.document.input_document()["properties"]["quantity"]["enum"][0].clone();
    Some(json!({
        "calculator": entry.meta().id, "part_types": { "A": { "job": job } }, "quantity": quantity,
        "options": { "false_alarm_every_parts": 500, "path": "advise" },
    }))
}

fn store(registry: &Registry) -> OperationBuilder {
    let operation = operation(
        "store_process",
        "May a process be watched?",
        "Declares a process, or declares it otherwise: then all parts are judged anew, and nothing changes of what was said when \
         they came. A record that was exported goes in whole, under a new name.",
    )
    .parameter(name())
    .parameter(if_match())
    .parameter(header("If-None-Match", "`*`: only if nothing has the name."))
    .parameter(language())
    .request_body(Some(body("The process, or its exported record.", "ProcessDocument", example(registry))))
    .response("200", changed("It is declared otherwise, or was so already.", "Process"))
    .response("201", changed("It is new.", "Process").header("Location", parts::text_header("Its address.", "/v1/processes/shaft-560")));
    parts::guarded(operation, &[400, 408, 409, 412, 413, 415, 422, 428, 507])
}

/// What the service posts to whom a process names.
pub(super) fn callback() -> PathItem {
    let said = operation(
        SAID,
        "What is said of that process?",
        "Posted to the address that a process names as `callback.url`, when what it wants to hear is new, signed as Standard \
         Webhooks has it. It is delivered at least once; `webhook-id` is the same each time. A history that comes at once is not told.",
    );
    jobs::posted(said, "ProcessEvent", "What is said. The same at every try.")
}

fn delete() -> OperationBuilder {
    let operation = operation("delete_process", "How does a process go?", "Deletes it with its whole record.")
        .parameter(name())
        .parameter(if_match())
        .response("204", ResponseBuilder::new().description("It is gone.").header("x-request-id", parts::request_id()));
    parts::guarded(operation, &[404, 412, 428, 507])
}

fn list_parts() -> OperationBuilder {
    let states = ["learning", "in_control", "warning", "changed"].map(ToOwned::to_owned);
    let operation = operation(
        "list_process_parts",
        "Which parts were measured?",
        "Parts that are not withdrawn, by number: what was sent, what was said then, what is said now.",
    )
    .parameter(name())
    .parameter(query("from", "Least number.", number()))
    .parameter(query("to", "Largest number.", number()))
    .parameter(query("state", "Only parts of which this is said now; pages may then be short.", parts::one_of(states)))
    .parameter(limit())
    .parameter(language())
    .response("200", document("A page.", "ProcessParts"));
    parts::guarded(operation, &[400, 404, 507])
}

fn import() -> OperationBuilder {
    let mut body = body("All parts.", "ProcessImport", None);
    body.content.insert(
        "text/csv".to_owned(),
        RefOr::T(parts::text_of(
            "A row for each measured place: `part`, `number`, `part_type`, conditions, and the columns of measured rows.",
        )),
    );
    let operation = operation(
        "import_process_parts",
        "What would have been said when?",
        "Takes a whole history, all of it or nothing, and judges it part by part. Parts that are there as they are sent stay.",
    )
    .parameter(name())
    .parameter(language())
    .request_body(Some(body))
    .response("200", document("What would have been said.", "ProcessImported"));
    parts::guarded(operation, &[400, 404, 408, 409, 413, 415, 422, 428, 507])
}

fn read_part() -> OperationBuilder {
    let operation = operation("read_process_part", "What was said of a part?", "With all that happened to it.")
        .parameter(name())
        .parameter(part())
        .parameter(language())
        .response("200", changed("The part.", "ProcessPart"));
    parts::guarded(operation, &[404, 507])
}

fn put_part(registry: &Registry) -> OperationBuilder {
    let quantity = registry.entries().iter().find_map(|entry| entry.observed());
    let quantity =
        quantity.map(|observed| observed.document.input_document()["properties"]["quantity"]["enum"][0].clone());
    let quantity = quantity.as_ref().and_then(Value::as_str).unwrap_or("value").to_owned();
    let example = json!({
        "number": 39, "part_type": "A",
        "measurements": [{ "z_mm": 16.8, quantity.clone(): 1.9 }, { "z_mm": 64.7, quantity.clone(): 2.6 },
            { "z_mm": 112.5, quantity.clone(): 3.1 }, { "z_mm": 160.4, quantity: 2.2 }],
    });
    let mut body = body("The part; its table may come as a file part.", "ProcessPartBody", Some(example));
    body.content.insert(
        "text/csv".to_owned(),
        RefOr::T(parts::text_of("The measured rows alone; number, type and conditions stand in the query.")),
    );
    let operation = operation(
        "put_process_part",
        "Is the process still as its model says, with this part?",
        "Takes a part, or corrects it. The same part again changes nothing and is answered as it was. A part may come late: then \
         those after it are judged anew.",
    )
    .parameter(name())
    .parameter(part())
    .parameter(if_match())
    .parameter(language())
    .request_body(Some(body))
    .response("200", changed("It was there, or is corrected.", "ProcessSaid"))
    .response("201", changed("It is taken.", "ProcessSaid").header("Location", parts::text_header("Its address.", "/v1/processes/shaft-560/parts/2026-02-03-0039")));
    parts::guarded(operation, &[400, 404, 408, 409, 412, 413, 415, 422, 428, 507])
}

fn withdraw() -> OperationBuilder {
    let operation = operation(
        "withdraw_process_part",
        "What if a part was none?",
        "Withdraws it: those after it are judged anew. It stays on record.",
    )
    .parameter(name())
    .parameter(part())
    .parameter(if_match())
    .parameter(language())
    .response("200", changed("What is said without it.", "ProcessSaid"));
    parts::guarded(operation, &[404, 412, 428, 507])
}

fn state() -> OperationBuilder {
    let tables = processes::TABLES.iter().map(|&table| table.to_owned());
    let operation = operation(
        "read_process_state",
        "What is said of a process?",
        "What was said last; as CSV a line for each part, change, cause of the model, or part with what paths brought by then.",
    )
    .parameter(name())
    .parameter(query("table", "As CSV: which table.", parts::one_of(tables)))
    .parameter(query("figure", "As SVG: which figure.", parts::one_of(processes::FIGURES.iter().map(|&figure| figure.to_owned()))))
    .response(
        "200",
        parts::tagged(document("What is said.", "ProcessState"))
            .content("text/csv", parts::text_of("One of its tables."))
            .content("image/svg+xml", parts::text_of("One of its figures.")),
    );
    parts::guarded(parts::conditional(operation), &[400, 404, 406, 507])
}

fn figures() -> OperationBuilder {
    let operation = operation(
        "read_process_figures",
        "What does a process look like?",
        "Its control chart, what its paths brought, and what is expected of the next part, as data that a page draws.",
    )
    .parameter(name())
    .parameter(language())
    .response("200", document("The figures.", "FigureList"));
    parts::guarded(operation, &[404, 507])
}

fn history() -> OperationBuilder {
    let operation = operation("read_process_history", "What happened to a process?", "Its record, in order, by pages.")
        .parameter(name())
        .parameter(query("after", "Number of the last entry that is known.", number()))
        .parameter(limit())
        .parameter(language())
        .response("200", document("A page.", "ProcessHistory"));
    parts::guarded(operation, &[400, 404, 507])
}

fn changes() -> OperationBuilder {
    let operation = operation("list_process_changes", "What has changed?", "The last changes, each with its causes.")
        .parameter(name())
        .parameter(language())
        .response("200", document("The changes.", "ProcessChanges"));
    parts::guarded(operation, &[404, 507])
}

fn decide() -> OperationBuilder {
    let id = parts::path_parameter("id", "Id of the change.", text("^c[1-9][0-9]{0,8}$"), json!("c1"));
    let operation = operation(
        "decide_process_change",
        "Is a change one?",
        "What a person says of a change: confirmed it joins the model at once; rejected it belongs to the process and causes no \
         alarm any more; named it is one of its causes alone.",
    )
    .parameter(name())
    .parameter(id)
    .parameter(language())
    .request_body(Some(body("The decision.", "ProcessDecision", Some(json!({ "decision": "confirm" })))))
    .response("200", changed("What is said now.", "ProcessSaid"));
    parts::guarded(operation, &[400, 404, 408, 413, 415, 422, 507])
}

fn next(registry: &Registry) -> OperationBuilder {
    let path = parts::one_of(WhichPath::ALL.iter().map(|path| path.word().to_owned()));
    let mut operation = operation(
        "next_process_part",
        "What is to be cut next?",
        "The next part's job, which is the calculator's own, and its answer. Who takes its program along cuts on its path: the \
         header `Precut-Path` has the revision that the part then states.",
    )
    .parameter(name())
    .parameter(query("part_type", "Its type; that of the last part.", parts::string()))
    .parameter(query("path", "The path as it is, or a new one; by `options.path` and the action.", path))
    .parameter(query("table", "With `text/csv`: which table of the answer.", parts::string()))
    .parameter(query("figure", "With `image/svg+xml`: which figure of the answer.", parts::string()))
    .parameter(language());
    let observed = registry.entries().iter().filter_map(|entry| entry.observed());
    for condition in observed.flat_map(|observed| observed.conditions) {
        let schema = ObjectBuilder::new()
            .schema_type(SchemaType::new(Type::Number))
            .minimum(Some(0.0))
            .maximum(Some(processes::MOST_NUMBER))
            .build();
        operation = operation.parameter(query(condition, "The same of the next part.", schema));
    }
    let operation = operation.response(
        "200",
        parts::other_forms(document("The next part.", "ProcessNext")).header(
            "Precut-Path",
            parts::header_of(parts::integer(1, 1_000_000, 1), "With a program: the revision of its path."),
        ),
    );
    parts::guarded(operation, &[400, 404, 406, 409, 422, 507])
}

fn gain() -> OperationBuilder {
    let operation = operation(
        "read_process_gain",
        "What did it bring?",
        "The account of the gain on parts that were cut with a path of the process.",
    )
    .parameter(name())
    .parameter(language())
    .response("200", document("The account.", "ProcessGain"));
    parts::guarded(operation, &[404, 507])
}

fn events() -> OperationBuilder {
    let stream = parts::events(
        "Each entry of the record, and before it what is new with it.",
        "`document`, `part`, `withdrawn`, `decision` or `path`; `warning`, `change`, `accepted`, `odd_part` or `replayed`.",
        "JSON: `sequence`, `kind`, `part`, `number` and `said` of the entry.",
    );
    let operation = operation(
        "follow_process",
        "What happens to a process?",
        "Its record as server-sent events, as it grows. `Last-Event-ID` resumes.",
    )
    .parameter(name())
    .parameter(header("Last-Event-ID", "Number of the last entry that is known; without it only what is new is told."))
    .parameter(language())
    .response("200", parts::success("Events.", "text/event-stream", stream));
    parts::guarded(operation, &[404, 507])
}

fn export() -> OperationBuilder {
    let operation = operation(
        "export_process",
        "May the record be kept elsewhere?",
        "All that happened, with a hash. `PUT` takes it again.",
    )
    .parameter(name())
    .response("200", document("The record.", "ProcessRecord"));
    parts::guarded(operation, &[404, 507])
}
