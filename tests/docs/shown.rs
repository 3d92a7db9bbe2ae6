//! Compares what is shown with what came. `...` stands for anything: in a line, as a line of its own, as a member of
//! an object, as elements of an array, as a value, at the end of a number.

use std::fmt::Write as _;

use serde_json::Value;

const ANYTHING: &str = "...";

/// Lines of an output that a fault repeats.
const SHOWN_LINES: usize = 40;
/// And characters of a line or value.
const SHOWN_CHARACTERS: usize = 200;

/// Whether a text fits a pattern.
pub(crate) fn fits(pattern: &str, text: &str) -> bool {
    let mut parts = pattern.split(ANYTHING);
    let Some(mut rest) = parts.next().and_then(|first| text.strip_prefix(first)) else { return false };
    let parts: Vec<&str> = parts.collect();
    let Some((last, middle)) = parts.split_last() else { return rest.is_empty() };
    for part in middle {
        let Some(at) = rest.find(part) else { return false };
        rest = &rest[at + part.len()..];
    }
    rest.ends_with(last)
}

/// Compares line by line.
pub(crate) fn lines(shown: &str, came: &str) -> Result<(), String> {
    let shown: Vec<&str> = shown.lines().map(str::trim_end).collect();
    let came: Vec<&str> = came.lines().map(str::trim_end).collect();
    if lines_fit(&shown, &came) {
        return Ok(());
    }
    let head: Vec<String> = came.iter().take(SHOWN_LINES).map(|line| begin(line)).collect();
    let mut fault = format!("of {} lines these came instead of what is shown:\n{}", came.len(), head.join("\n"));
    if let Some(line) = shown.iter().find(|line| **line != ANYTHING && !came.iter().any(|came| fits(line, came))) {
        let _ = write!(fault, "\nnothing fits the line: {line}");
    }
    Err(fault)
}

fn lines_fit(shown: &[&str], came: &[&str]) -> bool {
    match (shown, came) {
        ([], []) | ([ANYTHING], _) => true,
        ([ANYTHING, rest @ ..], _) => (0..=came.len()).any(|skip| lines_fit(rest, &came[skip..])),
        ([first, shown @ ..], [line, came @ ..]) => fits(first, line) && lines_fit(shown, came),
        _ => false,
    }
}

/// Enough of a text to recognise it.
fn begin(text: &str) -> String {
    text.chars().take(SHOWN_CHARACTERS).collect()
}

/// Compares as JSON: order of members and white space do not count.
pub(crate) fn json(shown: &str, came: &str) -> Result<(), String> {
    let pattern: Value =
        serde_json::from_str(&quoted(shown)).map_err(|error| format!("what is shown is no JSON: {error}"))?;
    let came: Value = serde_json::from_str(came).map_err(|error| format!("no JSON came ({error}): {}", begin(came)))?;
    compare(&pattern, &came, "")
}

/// Makes JSON of JSON with dots.
fn quoted(shown: &str) -> String {
    let mut out = String::with_capacity(shown.len());
    let mut open = Vec::new();
    let mut in_string = false;
    let mut token = String::new();
    let mut rest = shown;
    while let Some(c) = rest.chars().next() {
        if in_string || !(c.is_ascii_digit() || matches!(c, '-' | '+' | '.' | 'e' | 'E')) {
            flush(&mut token, &mut out, open.last() == Some(&'{'));
        }
        if in_string {
            out.push(c);
            if c == '\\' {
                rest = &rest[1..];
                out.extend(rest.chars().next());
            }
            in_string = c != '"';
        } else if c.is_ascii_digit() || matches!(c, '-' | '.' | '+') || (!token.is_empty() && matches!(c, 'e' | 'E')) {
            token.push(c);
        } else {
            match c {
                '{' | '[' => open.push(c),
                '}' | ']' => drop(open.pop()),
                '"' => in_string = true,
                _ => {}
            }
            out.push(c);
        }
        rest = &rest[rest.chars().next().map_or(0, char::len_utf8)..];
    }
    out
}

/// A number, a number that breaks off, or dots alone.
fn flush(token: &mut String, out: &mut String, in_object: bool) {
    let is_member = in_object && !out.trim_end().ends_with(':');
    match token.as_str() {
        "" => {}
        ANYTHING if is_member => out.push_str("\"...\":0"),
        dots if dots.ends_with(ANYTHING) => {
            let _ = write!(out, "\"{dots}\"");
        }
        number => out.push_str(number),
    }
    token.clear();
}

fn compare(shown: &Value, came: &Value, place: &str) -> Result<(), String> {
    let differs = || Err(format!("at {place:?}: shown {shown}, came {}", begin(&came.to_string())));
    match (shown, came) {
        (Value::String(pattern), Value::String(text)) if fits(pattern, text) => Ok(()),
        (Value::String(pattern), _) if pattern == ANYTHING => Ok(()),
        (Value::String(pattern), Value::Number(number)) if pattern.ends_with(ANYTHING) => {
            if fits(pattern, &number.to_string()) { Ok(()) } else { differs() }
        }
        (Value::Object(shown), Value::Object(members)) => {
            for (name, value) in shown.iter().filter(|(name, _)| *name != ANYTHING) {
                let Some(member) = members.get(name) else {
                    return Err(format!("at {place:?}: no {name} in {}", begin(&came.to_string())));
                };
                compare(value, member, &format!("{place}/{name}"))?;
            }
            let all = shown.contains_key(ANYTHING) || shown.len() == members.len();
            if all {
                Ok(())
            } else {
                Err(format!("at {place:?}: more came than is shown: {}", begin(&came.to_string())))
            }
        }
        (Value::Array(shown), Value::Array(elements)) => elements_fit(shown, elements, place),
        (Value::Number(a), Value::Number(b)) if a.as_f64() == b.as_f64() => Ok(()),
        _ if shown == came => Ok(()),
        _ => differs(),
    }
}

fn elements_fit(shown: &[Value], came: &[Value], place: &str) -> Result<(), String> {
    match (shown, came) {
        ([], []) => Ok(()),
        ([Value::String(dots), rest @ ..], _) if dots == ANYTHING => {
            let fits = (0..=came.len()).any(|skip| elements_fit(rest, &came[skip..], place).is_ok());
            if fits { Ok(()) } else { Err(format!("at {place:?}: none of the elements fits")) }
        }
        ([first, shown @ ..], [element, came @ ..]) => {
            compare(first, element, &format!("{place}/-"))?;
            elements_fit(shown, came, place)
        }
        _ => Err(format!("at {place:?}: {} elements left that are shown, {} that came", shown.len(), came.len())),
    }
}

#[cfg(test)]
mod tests {
    use super::{fits, json, lines};

    #[test]
    fn dots_stand_for_anything_and_nothing_else_does() {
        assert!(fits("a...c...", "abcd") && fits("abc", "abc") && fits("...", ""));
        assert!(!fits("a...c", "abcd") && !fits("abc", "abcd") && !fits("ab...bc", "abc"));
        assert!(lines("a\n...\nd", "a\nb\nc\nd\n").is_ok() && lines("a\n...", "a\r\n").is_ok());
        assert!(lines("a\n...\nd", "a\nb\n").is_err() && lines("a", "a\nb").is_err());
    }

    #[test]
    fn shown_json_may_leave_out_but_not_differ() {
        let came = r#"{"a":{"b":12.345,"c":[1,2,3]},"d":"b3:00ff","e":null,"f":-1e-7}"#;
        for shown in [
            "{\"a\": ..., \"d\": \"b3:...\", ...}",
            "{ \"f\": -1e-7, \"a\": { \"b\": 12.3..., \"c\": [1, ..., 3] }, ... }",
            "{ \"a\": { \"c\": [..., 2, ...], ... }, ... }",
            "{ ..., \"e\": null }",
            "{ ... }",
        ] {
            assert_eq!(json(shown, came), Ok(()), "{shown}");
        }
        for shown in [
            "{ \"a\": ... }",
            "{ \"a\": { \"b\": 12.4..., ... }, ... }",
            "{ \"a\": { \"c\": [1, ..., 2], ... }, ... }",
            "{ \"d\": \"00ff\", ... }",
            "{ \"g\": ..., ... }",
            "{ \"e\": 0, ... }",
        ] {
            assert!(json(shown, came).is_err(), "{shown}");
        }
    }
}
