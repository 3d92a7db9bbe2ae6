//! Long texts of a job that come as files beside it: byte for byte, so that the same bytes give the same key.

use precut_calc::calculator::{Finding, ProgramEncoding};
use serde_json::Value;

use super::FilePart;
use super::table::{place_at, pointer_of, put};
use crate::registry::{Faults, TextPlace};

/// Puts texts where they belong. Gives the files that are none, and the pointers of texts that could not be read and are null
/// in the job.
pub(crate) fn resolve<'p>(
    job: &mut Value,
    parts: &'p [FilePart],
    places: &[TextPlace],
    faults: &mut Faults,
) -> (Vec<&'p FilePart>, Vec<String>) {
    let mut unread = Vec::new();
    let mut others = Vec::new();
    for part in parts {
        let Some((place, path)) = places.iter().find_map(|place| Some((place, place.way.fit(&part.name)?))) else {
            others.push(part);
            continue;
        };
        if let Err(finding) = read(job, part, (place, &path)) {
            faults.add(finding);
            if place_at(job, &path).is_some_and(|text| text.is_null()) {
                unread.push(pointer_of(&path));
            }
        }
    }
    (others, unread)
}

/// Reads a text as the job says, or, where it says nothing, as its bytes are; what they are is then said.
fn read(job: &mut Value, part: &FilePart, (place, path): (&TextPlace, &[String])) -> Result<(), Finding> {
    let beside = path.len().saturating_sub(1);
    let said = [&path[..beside], &place.encoding].concat();
    let named = job.pointer(&pointer_of(&said)).and_then(Value::as_str).and_then(ProgramEncoding::named);
    let encoding = named.unwrap_or_else(|| ProgramEncoding::of(&part.bytes));
    if named.is_none() && encoding != ProgramEncoding::default()
        // What else is written there the schema refuses.
        && let Some(value) = place_at(job, &said).filter(|value| value.is_null())
    {
        *value = encoding.name().into();
    }
    let text = encoding.decoded(&part.bytes);
    let not_read = || Finding::new("table_not_utf8", pointer_of(path)).with("name", part.name.clone());
    put(job, path, &part.name, text.ok_or_else(not_read)?.into())
}

#[cfg(test)]
#[allow(clippy::unwrap_used)]
mod tests {
    use serde_json::json;

    use super::*;
    use crate::registry::Registry;

    fn resolved(mut job: Value, bytes: &'static [u8]) -> (Value, Vec<&'static str>) {
        let registry = Registry::standard().unwrap();
        let parts = [FilePart { name: "nc_program".to_owned(), bytes: bytes.into() }];
        let mut faults = Faults::default();
        let places = registry.entry("program-compensation").unwrap().texts_of(&Value::Null);
        let (others, _) = resolve(&mut job, &parts, places, &mut faults);
        assert!(others.is_empty());
        (job, faults.listed.iter().map(|finding| finding.code).collect())
    }

    #[test]
    fn a_file_is_read_as_its_bytes_are_unless_the_job_says_how() {
        let latin = json!({ "reading": { "encoding": "latin_1" } });
        let with = |mut job: Value, text: &str| {
            job["nc_program"] = text.into();
            job
        };
        assert_eq!(resolved(json!({}), b"G0\r\n").0["nc_program"], "G0\r\n");
        assert_eq!(resolved(json!({}), b"(\xF6)"), (with(latin.clone(), "(\u{f6})"), vec![]));
        assert_eq!(resolved(latin.clone(), "(ö)".as_bytes()), (with(latin, "(\u{c3}\u{b6})"), vec![]));
        let utf8 = json!({ "reading": { "encoding": "utf_8" } });
        assert_eq!(resolved(utf8, b"(\xF6)").1, ["table_not_utf8"]);
        assert_eq!(resolved(json!({ "nc_program": "G0" }), b"G1").1, ["table_given_twice"]);
    }
}
