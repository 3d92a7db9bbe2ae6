//! Schemas of what the operations of processes take and answer.

use serde_json::{Value, json};
use utoipa::openapi::{RefOr, Schema};

use super::EXAMPLE;
use crate::engine::WhichPath;
use crate::registry::Registry;

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

/// All of them by name.
#[allow(clippy::too_many_lines)] // a list
pub(in crate::http::openapi) fn schemas(registry: &Registry) -> Vec<(String, RefOr<Schema>)> {
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
