//! Fields of an object, found in its text and added to it.

use std::ops::Range;

/// A field of an object in its text: where it begins, and its value.
struct Member {
    begin: usize,
    value: Range<usize>,
}

impl Member {
    fn name<'t>(&self, object: &'t [u8]) -> &'t [u8] {
        object.get(self.begin + 1..self.value.start - 2).unwrap_or_default()
    }
}

/// The fields of an object, written without white space, as they come; up to where it is no object any more.
fn members(object: &[u8]) -> impl Iterator<Item = Member> {
    let (mut depth, mut in_text, mut escaped) = (0_usize, false, false);
    // Where the member that is being read begins, and its value.
    let (mut begin, mut value) = (1, None);
    object
        .iter()
        .enumerate()
        .map_while(move |(index, byte)| {
            if in_text {
                match byte {
                    _ if escaped => escaped = false,
                    b'\\' => escaped = true,
                    b'"' => in_text = false,
                    _ => {}
                }
                return Some(None);
            }
            let mut ended = None;
            match byte {
                b'"' => in_text = true,
                b'{' | b'[' => depth += 1,
                b':' if depth == 1 => value = Some(index + 1),
                b',' | b'}' if depth == 1 => {
                    ended = value.take().map(|value| Member { begin, value: value..index });
                    begin = index + 1;
                }
                b'}' | b']' => depth = depth.checked_sub(1)?,
                _ => {}
            }
            Some(ended)
        })
        .flatten()
}

/// Where in the text of an object, written without white space, the value of a field of its own stands.
pub(crate) fn top_level_field(object: &[u8], name: &str) -> Option<Range<usize>> {
    members(object).find(|member| member.name(object) == name.as_bytes()).map(|member| member.value)
}

/// An object in canonical JSON with one field more, which it does not have yet. All names are ASCII.
pub(crate) fn with_top_level(object: &[u8], name: &str, value: &[u8]) -> Vec<u8> {
    let next = members(object).find(|member| member.name(object) > name.as_bytes());
    let (before, after) = match next {
        Some(next) => (&object[..next.begin], [b",", &object[next.begin..]].concat()),
        None => (&object[..object.len().saturating_sub(1)], b"}".to_vec()),
    };
    let comma: &[u8] = if after[0] == b'}' && before.len() > 1 { b"," } else { b"" };
    [before, comma, b"\"", name.as_bytes(), b"\":", value, &after].concat()
}
