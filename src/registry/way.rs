//! What a pointer goes through on its way: the names of fields with the types that they belong to, so that each can be
//! called by its label in any language.

use serde_json::Value;

/// A way through a contract and what is at its end.
#[derive(Debug, Clone, PartialEq, Eq)]
pub(crate) struct Way {
    /// From type to type.
    pub(crate) steps: Vec<String>,
    /// Unit of the field at its end.
    pub(crate) unit: Option<String>,
}

/// A way through a contract, from type to type: `Cut.feed_mm_per_rev`, `ShaftInput.segments/1/Segment.diameter_mm`.
/// Items of lists are counted from 1. `document` is a schema that stands alone, `root` what its type is called. What
/// the schema does not know keeps its name.
pub(crate) fn way(document: &Value, root: &str, tokens: &[String]) -> Way {
    let mut nodes = vec![(document, root)];
    let mut steps = Vec::with_capacity(tokens.len());
    for token in tokens {
        let forms: Vec<(&Value, &str)> =
            nodes.iter().flat_map(|&(node, component)| forms(document, node, component, 0)).collect();
        let item = token.parse::<usize>().ok();
        let of_list = || forms.iter().filter(|(form, _)| form["items"].is_object());
        let listed = item.filter(|_| of_list().next().is_some());
        let step = if let Some(index) = listed {
            nodes = of_list().map(|&(form, component)| (&form["items"], component)).collect();
            (index + 1).to_string()
        } else {
            let fields: Vec<_> = forms
                .iter()
                .filter_map(|&(form, component)| Some((form["properties"].get(token)?, component)))
                .collect();
            let component = fields.first().map_or("", |(_, component)| component);
            let step = format!("{component}.{}", token.replace(['/', '.'], " "));
            nodes = fields;
            step
        };
        steps.push(step);
    }
    let unit = nodes
        .iter()
        .flat_map(|&(node, component)| forms(document, node, component, 0))
        .find_map(|(form, _)| form["x-unit"].as_str().map(str::to_owned));
    Way { steps, unit }
}

/// References are not followed deeper.
const DEEPEST: usize = 16;

/// What a node may be, each with its type's name: references followed, variants beside each other.
pub(crate) fn forms<'d>(
    document: &'d Value,
    node: &'d Value,
    component: &'d str,
    depth: usize,
) -> Vec<(&'d Value, &'d str)> {
    if depth > DEEPEST {
        return Vec::new();
    }
    let mut found = vec![(node, component)];
    if let Some(name) = node["$ref"].as_str().and_then(|place| place.strip_prefix("#/$defs/")) {
        found.extend(forms(document, &document["$defs"][name], name, depth + 1));
    }
    for keyword in ["allOf", "oneOf", "anyOf"] {
        let inner = node[keyword].as_array().into_iter().flatten();
        found.extend(inner.flat_map(|form| forms(document, form, component, depth + 1)));
    }
    found
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn every_field_is_named_with_the_type_that_it_belongs_to() {
        let document = json!({
            "properties": {
                "shaft": {"$ref": "#/$defs/Shaft"},
                "support": {"oneOf": [{"type": "null"}, {"$ref": "#/$defs/Support"}]},
            },
            "$defs": {
                "Shaft": {"properties": {"segments": {"type": "array", "items": {"$ref": "#/$defs/Segment"}}}},
                "Segment": {"properties": {"diameter_mm": {"type": ["number", "null"], "x-unit": "mm"}}},
                "Support": {"oneOf": [{"properties": {"kind": {}}}, {"properties": {"compliance_um_per_n": {}}}]},
            },
        });
        let of = |pointer: &str| {
            let tokens: Vec<String> = pointer.split('/').skip(1).map(str::to_owned).collect();
            way(&document, "job", &tokens).steps.join("/")
        };
        assert_eq!(of("/shaft/segments/0/diameter_mm"), "job.shaft/Shaft.segments/1/Segment.diameter_mm");
        assert_eq!(of("/support/compliance_um_per_n"), "job.support/Support.compliance_um_per_n");
        assert_eq!(of("/new/names.of/old"), ".new/.names of/.old");
        let tokens = ["shaft", "segments", "0", "diameter_mm"].map(str::to_owned);
        assert_eq!(way(&document, "job", &tokens).unit.as_deref(), Some("mm"));
    }
}
