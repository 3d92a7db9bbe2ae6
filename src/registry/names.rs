//! Machines, tools and materials in the contract of a job: where they may be named. Names go before a job is held against
//! its schema; here is what the reader of JSON keeps of them, and what the contract says.

use precut_library::Kind;
use serde_json::{Map, Value, json};

use super::family;
use super::schema::Components;
use super::shape::Shape;

/// Whether jobs of a calculator may name a record of that kind.
pub(crate) fn takes(calculator: &str, kind: Kind) -> bool {
    !precut_library::asked(calculator, &json!({ kind.name(): "x" })).is_empty()
}

/// What belongs to names elsewhere in a job; `*` are the items of a list.
const BESIDE: [&[&str]; 12] = [
    &["supports", "*", "rest"],
    &["cutter", "name"],
    &["tools", "*", "name"],
    &["tools", "*", "insert"],
    &["tools", "*", "holder"],
    &["stock", "material"],
    &["shaft", "material"],
    &["force", "material"],
    &["force", "normal_force"],
    &["force", "kienzle_row"],
    &["force", "source"],
    &["cut_kind"],
];

/// Lets a job name records.
pub(super) fn let_in(shape: &mut Shape, calculator: &str) {
    let taken = Kind::NAMED.into_iter().filter(|kind| takes(calculator, *kind));
    let mut any = false;
    for kind in taken {
        any = true;
        shape.let_in(&[kind.name()], Shape::of(&json!({ "type": ["string", "object"] })));
    }
    for way in BESIDE.iter().filter(|_| any) {
        shape.let_in(way, Shape::of(&json!({ "type": "string" })));
    }
}

/// What the contract says of a name.
struct Named {
    kind: Kind,
    /// The component that says what stands beside it.
    component: &'static str,
    example: &'static str,
    about: &'static str,
}

const NAMED: [Named; Kind::NAMED.len()] = [
    Named {
        kind: Kind::Machine,
        component: "NamedMachine",
        example: "lathe_engine_medium",
        about: "A machine by name: its compliances, limits and prices fill in what the job leaves open.",
    },
    Named {
        kind: Kind::Tool,
        component: "NamedTool",
        example: "cnmg120408_pclnr2525m12",
        about: "A tool by name or by its ISO codes: its geometry and prices fill in what the job leaves open.",
    },
    Named {
        kind: Kind::Material,
        component: "NamedMaterial",
        example: "42crmo4",
        about: "A material by any of its names: its constants and force law fill in what the job leaves open.",
    },
];

/// Whether jobs of a calculator may name any.
pub(super) fn takes_any(calculator: &str) -> bool {
    Kind::NAMED.into_iter().any(|kind| takes(calculator, kind))
}

/// Fields that stand beside names, by the component that has them.
fn beside(component: &str) -> Vec<(&'static str, Value)> {
    match component {
        "ForceModelKienzle" | "RingForceLaw" => vec![
            (
                "normal_force",
                json!({ "type": "string", "enum": ["judged"], "example": "judged", "x-group": "cut",
                    "description": "Lets the normal force be judged from the cutting force of the material that the job names: no table gives it." }),
            ),
            (
                "kienzle_row",
                json!({ "type": "integer", "minimum": 0, "maximum": 100, "example": 1, "x-unit": "1", "x-symbol": "i", "x-group": "cut", "x-advanced": true,
                    "description": "Takes this row of the material that the job names, counted from 0, in place of the preferred one." }),
            ),
            (
                "source",
                json!({ "type": "string", "maxLength": 100, "example": "iscar_2017", "x-group": "cut", "x-advanced": true,
                    "description": "Takes the row of this source in place of the preferred one." }),
            ),
        ],
        "ProgramTool" => vec![
            (
                "name",
                json!({ "type": "string", "maxLength": 100, "example": "cnmg120408_pclnr2525m12", "x-group": "cut",
                    "description": "A tool by name: its record gives the edge." }),
            ),
            (
                "insert",
                json!({ "type": "string", "maxLength": 64, "example": "DNMG150608", "x-group": "cut", "x-advanced": true,
                    "description": "Designation of the insert, ISO 1832: it gives the nose." }),
            ),
            (
                "holder",
                json!({ "type": "string", "maxLength": 64, "example": "PDJNL2525M15", "x-group": "cut", "x-advanced": true,
                    "description": "Designation of the holder, ISO 5608, or of the bar, ISO 6261: it gives the angles." }),
            ),
        ],
        "MillCutter" => vec![(
            "name",
            json!({ "type": "string", "maxLength": 100, "example": "endmill_12_z4_r1", "x-group": "cut",
                "description": "A cutter by name: its record gives diameter, teeth, helix and cutting edge angle." }),
        )],
        "SupportSteadyRest" | "SupportFollowRest" => vec![(
            "rest",
            json!({ "type": "string", "maxLength": 64, "example": "steady", "x-group": "machine", "x-advanced": true,
                "description": "Name of a rest of the machine that the job names: its compliance is the machine's." }),
        )],
        _ => Vec::new(),
    }
}

/// Fields that need not be there where a record fills them in, by the component that has them.
fn filled(component: &str) -> &'static [&'static str] {
    match component {
        "ForceModelKienzle" => &["cutting_edge_angle_deg", "specific_normal_force_n_per_mm2", "normal_exponent"],
        "ForceModelHandbook" => &["cutting_edge_angle_deg"],
        "FaceMill" | "MillCutter" => &["diameter_mm", "teeth"],
        "MillingForce" => &["coefficient"],
        "ProgramTool" => &["nose_radius_mm", "cutting_edge_angle_deg", "minor_edge_angle_deg"],
        "RingForceLaw" => &[
            "specific_cutting_force_n_per_mm2",
            "cutting_exponent",
            "specific_normal_force_n_per_mm2",
            "normal_exponent",
        ],
        _ => &[],
    }
}

/// Adds what stands beside names to a component.
pub(super) fn add_beside(component: &str, part: &mut Value) {
    for_each_form(component, part, |name, form| {
        for (name, field) in beside(name) {
            form["properties"][name] = field;
        }
    });
}

/// Visits a component, or each form of one that is a choice, under the name that it has in the contract.
fn for_each_form(component: &str, part: &mut Value, visit: impl Fn(&str, &mut Value)) {
    let Some(Value::Array(forms)) = part.get_mut("oneOf") else { return visit(component, part) };
    for form in forms {
        let kind = form.pointer("/properties/kind/enum/0").and_then(Value::as_str).unwrap_or_default();
        visit(&format!("{component}{}", family::type_name(&kind.replace('_', "-"), "")), form);
    }
}

/// Adds what stands beside names to a job itself.
pub(super) fn add_to_job(calculator: &str, job: &mut Value) {
    if calculator == "feed-schedule" && job["properties"].get("zones").is_some() {
        job["properties"]["cut_kind"] = json!({
            "type": "string", "maxLength": 64, "example": "medium", "x-group": "cut", "x-advanced": true,
            "description": "Kind of cut, as `finish` or `medium`: which of the feeds recommended for the tool that the job names.",
        });
    }
}

/// Takes from the fields that a component needs those that a record may fill in. The service asks for them where none does.
pub(super) fn relax(component: &str, part: &mut Value) {
    for_each_form(component, part, |name, form| without(form, filled(name)));
}

fn without(part: &mut Value, names: &[&str]) {
    if let Some(required) = part.get_mut("required").and_then(Value::as_array_mut) {
        required.retain(|name| name.as_str().is_none_or(|name| !names.contains(&name)));
    }
}

/// Lets a job of a calculator, or the base job of its diagnosis, name records in the contract.
pub(super) fn offer(calculator: &str, root: &mut Value) {
    let is_base = root.pointer("/properties/job/properties").is_some();
    let job = if is_base { &mut root["properties"]["job"] } else { root };
    let fields = offered(calculator, job);
    if fields.is_empty() {
        return;
    }
    for (name, field) in fields {
        job["properties"][name] = field;
    }
    add_to_job(calculator, job);
    without(job, &["force", "cutter"]);
}

/// The fields that a job of a calculator has for names, with what it declares there itself.
fn offered(calculator: &str, declared: &Value) -> Map<String, Value> {
    let taken = NAMED.iter().filter(|named| takes(calculator, named.kind));
    taken
        .map(|named| {
            let name = named.kind.name();
            let word = json!({
                "type": "string", "maxLength": 100, "description": "`name`, or `name@revision`.", "examples": [named.example],
            });
            let object = json!({ "$ref": format!("#/components/schemas/{}", named.component) });
            let field = match declared["properties"].get(name) {
                // What a job states there itself is an object, too, so more than one of the forms can fit.
                Some(own) => json!({ "anyOf": [word, own, object], "description": named.about }),
                None => json!({ "oneOf": [word, object], "description": named.about }),
            };
            (name.to_owned(), field)
        })
        .collect()
}

/// What [`offered`] refers to.
pub(super) fn components() -> Components {
    let [machine, tool, material] = &NAMED;
    let name = |named: &Named| json!({ "type": "string", "maxLength": 100, "examples": [named.example], "description": "`name`, or `name@revision`." });
    let object = |named: &Named, about: &str| {
        json!({
            "type": "object", "description": about, "required": ["name"],
            "properties": { "name": name(named) }, "additionalProperties": true,
        })
    };
    let code = |about: &str, example: &str| json!({ "type": "string", "maxLength": 64, "description": about, "examples": [example] });
    let mut tool_object =
        object(tool, "A tool by name or by its codes, with fields of its record that the job overrules.");
    tool_object["required"] = json!([]);
    tool_object["properties"]["insert"] = code("Designation of the insert, ISO 1832.", "DNMG150608");
    tool_object["properties"]["holder"] =
        code("Designation of the holder, ISO 5608, or of the bar, ISO 6261.", "PDJNL2525M15");
    tool_object["properties"]["overhang_mm"] = json!({
        "type": "number", "minimum": 0.01, "maximum": 10_000.0, "example": 100.0, "x-unit": "mm", "x-symbol": "L",
        "description": "Overhang of a boring bar.",
    });
    Components::from([
        (
            machine.component.to_owned(),
            object(machine, "A machine by name, with fields of its record that the job overrules."),
        ),
        (tool.component.to_owned(), tool_object),
        (
            material.component.to_owned(),
            object(material, "A material by name, with fields of its record that the job overrules."),
        ),
    ])
}
