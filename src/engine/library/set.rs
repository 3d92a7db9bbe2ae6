//! Writing into a record by JSON Pointer.

use precut_library::record::pointer_parts;
use serde_json::{Map, Value};

/// Puts a value where a pointer leads, or takes away what is there where it is null. Objects on the way are made, and the
/// place behind the last item of a list is one. Whether there is a way.
pub(super) fn set(record: &mut Value, pointer: &str, value: Value) -> bool {
    if !pointer.starts_with('/') {
        return false;
    }
    let parts: Vec<String> = pointer_parts(pointer).collect();
    let Some((last, way)) = parts.split_last() else { return false };
    let mut place = record;
    for part in way {
        if place.is_null() {
            *place = Value::Object(Map::new());
        }
        let next = match place {
            // What is not there need not be made to be taken away.
            Value::Object(fields) if value.is_null() && !fields.contains_key(part) => return true,
            Value::Object(fields) => Some(fields.entry(part.as_str()).or_insert(Value::Null)),
            Value::Array(items) => index(part).and_then(|index| items.get_mut(index)),
            _ => None,
        };
        let Some(next) = next else { return false };
        place = next;
    }
    if place.is_null() && !value.is_null() {
        *place = Value::Object(Map::new());
    }
    match place {
        Value::Object(fields) if value.is_null() => {
            fields.shift_remove(last);
            true
        }
        Value::Object(fields) => {
            fields.insert(last.clone(), value);
            true
        }
        Value::Array(items) => match index(last) {
            Some(index) if index < items.len() && value.is_null() => {
                items.remove(index);
                true
            }
            Some(index) if index < items.len() => {
                items[index] = value;
                true
            }
            Some(index) if index == items.len() && !value.is_null() => {
                items.push(value);
                true
            }
            _ => false,
        },
        _ => false,
    }
}

/// An index as RFC 6901 writes it.
pub(super) fn index(part: &str) -> Option<usize> {
    let is_index = part == "0" || (!part.starts_with('0') && !part.is_empty());
    (is_index && part.bytes().all(|byte| byte.is_ascii_digit())).then(|| part.parse().ok())?
}

#[cfg(test)]
mod tests {
    use super::*;
    use serde_json::json;

    #[test]
    fn values_go_where_pointers_lead() {
        let mut record = json!({ "a": { "b": 1 }, "rows": [1, 2] });
        assert!(set(&mut record, "/a/c", json!(2)) && set(&mut record, "/x/y", json!(3)));
        assert!(set(&mut record, "/rows/2", json!(4)) && set(&mut record, "/rows/0", Value::Null));
        assert!(set(&mut record, "/a/b", Value::Null) && set(&mut record, "/none/at/all", Value::Null));
        assert_eq!(record, json!({ "a": { "c": 2 }, "rows": [2, 4], "x": { "y": 3 } }));
        for nowhere in ["", "a", "/rows/5", "/rows/01", "/a/c/d"] {
            assert!(!set(&mut record, nowhere, json!(1)), "{nowhere}");
        }
    }
}
